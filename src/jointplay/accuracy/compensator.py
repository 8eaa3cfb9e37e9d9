"""Compensation of gears' play inside a controller, step by step; it needs nothing but numpy."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.schema import known_keywords
from jointplay.physics.kernel.constants import JOINT_FRICTION_SPEED

if TYPE_CHECKING:
    from jointplay.model.gear import Gearing
    from jointplay.simulation.loads.drive import JointFriction

STILL = 5.0 * JOINT_FRICTION_SPEED
"""Speed below which a joint counts as standing, with friction of either sign [rad/s or m/s]."""


@known_keywords
class Compensator:
    """Shifts a command by the play and wind-up of gears, step by step, in a controller.

    For each gear it remembers the side on which the teeth were pressed last.

    Args:
        play: whole play of each joint's gear, (j,) [rad or m]; 0 where there is none.
        stiffness: stiffness of each gear, (j,) [N m/rad or N/m]; inf where it is rigid.
        friction: Coulomb friction of each joint, (j,) [N m or N].
        still: speed below which a joint counts as standing [rad/s or m/s].
    """

    def __init__(
        self,
        play: Sequence[float] | np.ndarray,
        stiffness: Sequence[float] | np.ndarray,
        friction: Sequence[float] | np.ndarray,
        still: float = STILL,
    ) -> None:
        self._half = 0.5 * np.asarray(play, float)
        self._give = 1.0 / np.asarray(stiffness, float)
        self._friction, self._still = np.asarray(friction, float), still
        self._shift = np.zeros_like(self._half)

    @classmethod
    def of(
        cls,
        joints: Sequence[str],
        gears: Mapping[str, Gearing],
        friction: Mapping[str, JointFriction],
    ) -> Compensator:
        """The compensator of joints in this order; joints without a gear stay unchanged."""
        geared = [gears.get(name) for name in joints]
        return cls(
            [0.0 if gear is None else gear.play for gear in geared],
            [np.inf if gear is None else float(gear.curve().slopes[0]) for gear in geared],
            [friction[name].coulomb if name in friction else 0.0 for name in joints],
        )

    def update(self, q: np.ndarray, qd: np.ndarray, load: np.ndarray) -> np.ndarray:
        """The command for positions q, speeds qd, and loads without friction, (j,) each."""
        moves = (qd > self._still) * 1.0 - (qd < -self._still)
        torque = load + moves * self._friction
        # The friction of a standing joint can hold a smaller torque: the last shift stays.
        decided = np.abs(torque) > (moves == 0.0) * self._friction
        wound = np.sign(torque) * self._half + torque * self._give
        self._shift = np.where(decided, wound, self._shift)
        return np.asarray(q + self._shift)
