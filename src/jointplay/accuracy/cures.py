"""Cures of play that are worth it: the error that each would leave, at most three, the best first.

Tighter joints are computed by the sum of the sets, springs by statics, gains by the drives' sag. A
corrected motion is computed at rest, by the error that `compensate` leaves there: run on SO-101 and
AR4 with play 30 % off, its motions stop up to 2.21 and 0.60 mm off, where 2.20 and 0.88 are
predicted, or without friction 0.91 and 0.59.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from jointplay.base.units import readable
from jointplay.simulation.loads.drive import Servo

if TYPE_CHECKING:
    from jointplay.accuracy.error_budget import PlayBudget

KNOWN = 0.3
"""Relative uncertainty of the play for which a motion is corrected."""
_MOST = 3
"""Most cures that are reported."""
_WORTH = 0.05
"""Part of the error that a cure must remove to be reported."""


class Cure(NamedTuple):
    """A cure, and the error without and with it [m or rad]."""

    action: str
    before: float
    after: float
    of: str
    """The error that it is: at rest, or the worst case of play."""
    unit: str = "m"

    def __str__(self) -> str:
        now, then = (readable(error, self.unit, 3) for error in (self.after, self.before))
        return f"{self.action}: {now} instead of {then} {self.of}"


def cures(budget: PlayBudget) -> list[Cure]:
    """Cures of a machine's error at the worst pose, the best first."""
    at = budget.worst_pose
    candidates = [*_tighter(budget, at), *_sprung(budget, at), *_at_rest(budget, at)]
    worth = [cure for cure in candidates if cure.after < (1.0 - _WORTH) * cure.before]
    return sorted(worth, key=lambda cure: cure.after / cure.before)[:_MOST]


def _tighter(budget: PlayBudget, at: int) -> Iterator[Cure]:
    """Halving the play of the joint that adds most."""
    worst = float(budget.worst[at])
    if worst > 0.0:
        most = int(budget.shares.argmax())
        text = f"half the play of {budget.joints[most]} (jointplay allocate)"
        after = _worst(budget, at, most, 0.5)
        yield Cure(text, worst, after, "in the worst case", budget.unit)


def _worst(budget: PlayBudget, at: int, source: int, part: float) -> float:
    """The worst case of play with one source of it multiplied by `part` [m]."""
    factors = np.ones(len(budget.joints))
    factors[source] = part
    model = budget.model.subset(poses=[at])
    return float(model.scaled(factors).farthest().size[0])


def _sprung(budget: PlayBudget, at: int) -> Iterator[Cure]:
    """Springs that keep the teeth of a gear on one side at all poses of the budget.

    The gear's play then is a constant offset, which homing takes out.
    """
    rest, entries = budget.rest_positions, budget.mechanism.description.joints
    for k, contribution in enumerate(budget.model.contributions):
        if not contribution.gear or contribution.joint in rest.regulated:
            continue
        torque = budget.model.load[k, :, entries[contribution.joint].component]
        ends = float(max(torque.max(), 0.0)), float(max(-torque.min(), 0.0))
        if not min(ends) > 0.0:
            continue
        friction = rest.joint_friction.get(contribution.joint)
        more = 0.0 if friction is None else friction.coulomb
        unit = "N" if entries[contribution.joint].slides else "N m"
        text = (
            f"a spring or counterweight of {min(ends) + more:.3g} {unit} in {contribution.joint}, "
            f"which keeps its teeth on one side at all {len(torque)} poses"
        )
        worst, after = float(budget.worst[at]), _worst(budget, at, k, 0.0)
        yield Cure(text, worst, after, "in the worst case", budget.unit)


def _at_rest(budget: PlayBudget, at: int) -> Iterator[Cure]:
    """A corrected motion, with and without approaching stops from one side; stiffer servos."""
    rest, largest = budget.rest_positions, float(budget.rest_positions.interval(at)[3, 1])
    left = budget.compensated(at, KNOWN)
    if not np.isfinite(left) or budget.unit == "rad":  # compensation leaves a distance
        return
    text = f"compensated (jointplay compensate), its play known to {100 * KNOWN:g} %"
    sided = budget.compensated(at, KNOWN, friction=-1.0)
    if any(part.gear for part in budget.model.contributions) and sided < (1.0 - _WORTH) * left:
        text += f", with --approach {readable(sided, 'm', 3)}, without"
    yield Cure(text, largest, left, "at rest")
    place = rest.at(at)
    size, sag = float(np.linalg.norm(place.error[:3])), place.sag[:3]
    if any(isinstance(drive, Servo) for drive in rest.drives.values()) and sag.any():
        half = float(np.linalg.norm(place.error[:3] - 0.5 * sag))
        text = (
            "twice the P gain, if it is calm: jointplay study hunting with --of JOINT finds up to "
            "which it is, in some 20 s a joint"
        )
        yield Cure(text, size, half, "at rest")
