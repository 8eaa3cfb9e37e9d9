"""Friction of a joint that grows with the force which the joint transmits."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.schema import Quantity, quantity
from jointplay.physics.kernel.constants import ALWAYS, JOINT_FRICTION_SPEED
from jointplay.simulation.loads.base import OnJoint, Site

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

TIME, LEVEL, RATE = range(3)
"""Indices of the numbers of `_friction_law`."""


def _friction_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: a time, the friction then, and its rate. Friction stays within zero and twice that."""
    level = p[1] + p[2] * (time - p[0])
    level = min(max(level, 0.0), 2.0 * p[1])
    out[0] = -level * math.tanh(dx[0] / JOINT_FRICTION_SPEED)


@dataclass(frozen=True)
class LoadedFriction(OnJoint):
    """Dry friction of a bearing under the force F that its joint transmits.

    Revolute: coefficient (radius |F across the axis| + axial_radius |F along it|); prismatic:
    coefficient |F across the axis|. Moments in the bearing do not enter. Its sign changes over 1
    mrad/s or 1 mm/s, as that of `JointFriction`, beside which it acts.

    F follows from the motion of all that the joint carries, as a mean over 0.2 ms
    (`simulation.acting`), extrapolated along a line for as long. In a mechanism with loops the
    motion does not determine the forces: there it is refused.
    """

    kind: ClassVar[str] = "loaded-friction"
    stores: ClassVar[bool] = True  # its answer at rest is zero

    coefficient: Quantity = quantity("", least=0.0, label="coefficient of friction")
    """Coefficient of friction."""
    radius: Quantity = quantity("m", default=0.0, least=0.0, label="bearing radius")
    """Radius of the bearing [m]."""
    axial_radius: Quantity = quantity("m", default=0.0, least=0.0, label="axial radius")
    """Mean radius of the face that takes the force along the axis [m]."""

    def site(self, mechanism: Mechanism) -> Site:
        site = super().site(mechanism)
        if mechanism.loops:
            raise JointplayError(
                f"the friction of joint {self.joint!r} cannot grow with its load: in a mechanism "
                f"with loops ({', '.join(mechanism.loops)}) motion does not tell the forces"
            )
        slides = mechanism.description.joints[self.joint].slides
        radii = (self.radius, self.axial_radius)
        if slides and any(radii):
            raise JointplayError(
                f"joint {self.joint!r} slides: its friction needs no radius, got {max(radii):g} m"
            )
        if not slides and not any(radii):
            raise JointplayError(
                f"friction that grows with the load of joint {self.joint!r} needs the radius of "
                "its bearing"
            )
        return site

    def law(self) -> Callable[..., None]:
        return _friction_law

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        return np.zeros(3)

    def implicit(self) -> int:
        return ALWAYS

    def friction(self, force: np.ndarray, axis: np.ndarray, slides: bool) -> float:
        """Friction [N m or N] under a force of the parent on the child [N]; `axis`: the joint's."""
        along = float(force @ axis)
        across = float(np.linalg.norm(force - along * axis))
        if slides:
            return self.coefficient * across
        return self.coefficient * (self.radius * across + self.axial_radius * abs(along))
