"""Closed loops: where a mechanism's branches meet again, and how it is put together.

A URDF describes a tree. A loop adds one more joint, between two links of different branches. With
clearance nothing holds it but contact: the loop is cut there. Ideal, it is a constraint, which
Pinocchio enforces.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from scipy.optimize import least_squares

from jointplay.errors import JointplayError, require_finite

if TYPE_CHECKING:
    from jointplay.mechanism import Mechanism

Vector = tuple[float, float, float]

ASSEMBLY_TOLERANCE_M = 1e-9
"""Gap that may remain in an assembled loop; angles count on an arm of `ANGLE_ARM_M`."""
ANGLE_ARM_M = 0.1

PROXIMAL = pin.ProximalSettings(1e-12, 1e-10, 10)
"""Accuracy, regularisation and iterations of Pinocchio's solver: constraints may be redundant."""


@dataclass(frozen=True)
class Loop:
    """A joint between two links that closes a loop: where bearing and journal sit.

    z of both frames is the joint's axis (for a slider, the direction of sliding).

    Raises:
        JointplayError: a vector that is not three finite numbers, or one link named twice.
    """

    bearing_link: str
    journal_link: str
    bearing_xyz: Vector = (0.0, 0.0, 0.0)
    """Bearing's centre in its link's frame [m]."""
    bearing_rpy: Vector = (0.0, 0.0, 0.0)
    """Orientation of the bearing frame: roll, pitch, yaw as in URDF [rad]."""
    journal_xyz: Vector = (0.0, 0.0, 0.0)
    journal_rpy: Vector = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check the vectors."""
        if self.bearing_link == self.journal_link:
            raise JointplayError(
                f"a loop needs two links, got {self.bearing_link!r} for both bearing and journal"
            )
        for name in ("bearing_xyz", "bearing_rpy", "journal_xyz", "journal_rpy"):
            values: Sequence[float] = getattr(self, name)
            unit = "m" if name.endswith("xyz") else "rad"
            if len(values) != 3:
                raise JointplayError(f"{name} must have three components, got {values!r}")
            checked = tuple(require_finite(name, value, unit) for value in values)
            object.__setattr__(self, name, checked)

    @property
    def bearing(self) -> pin.SE3:
        """Bearing frame in its link's frame."""
        return _placement(self.bearing_xyz, self.bearing_rpy)

    @property
    def journal(self) -> pin.SE3:
        """Journal frame in its link's frame."""
        return _placement(self.journal_xyz, self.journal_rpy)

    def describe(self) -> dict[str, Any]:
        """All fields as plain data."""
        return asdict(self)

    @classmethod
    def from_description(cls, description: dict[str, Any]) -> Loop:
        """Build the loop that `describe` described."""
        links = ("bearing_link", "journal_link")
        fields: Any = {k: v if k in links else tuple(v) for k, v in description.items()}
        return cls(**fields)


def _placement(xyz: Vector, rpy: Vector) -> pin.SE3:
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))


def misfit(mechanism: Mechanism, q: np.ndarray) -> dict[str, np.ndarray]:
    """What keeps each loop from being closed in configuration q, zero if it is.

    Returns:
        By loop, journal against bearing: the centre's offset (3) [m] but for the direction of
        sliding, and, unless the joint is a ball, the sine of the angle between the axes (2) - of
        all angles (3) for a slider - on an arm of `ANGLE_ARM_M` [m].
    """
    found = {}
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    for name in mechanism.loops:
        pose = mechanism.journal_pose(name)
        turn, kind = pose.rotation, mechanism.loop_kind(name)
        if kind == "spherical":
            found[name] = pose.translation.copy()
        elif kind == "prismatic":
            angles = pin.log3(turn)
            found[name] = np.concatenate([pose.translation[:2], ANGLE_ARM_M * angles])
        else:
            found[name] = np.concatenate([pose.translation, ANGLE_ARM_M * turn[:2, 2]])
    return found


def assemble(
    mechanism: Mechanism,
    q: np.ndarray,
    held: Sequence[int],
    offsets: dict[str, np.ndarray] | None = None,
) -> np.ndarray:
    """Configuration near q in which all loops are closed.

    Args:
        mechanism: with loops; without, q comes back.
        q: where to begin, shape (nq,).
        held: coordinates that keep their values.
        offsets: where journals shall be in their bearings, by loop, shape (3,) [m]; centred if
            not given.

    Returns:
        q, shape (nq,).

    Raises:
        JointplayError: the loops cannot be closed; the message has the gap that remains.
    """
    if not mechanism.loops:
        return q.copy()
    free = np.setdiff1d(np.arange(len(q)), held)
    free = free[[not mechanism.plays(i) for i in free]] if len(free) else free
    offsets = offsets or {}

    def error(values: np.ndarray) -> np.ndarray:
        trial = q.copy()
        trial[free] = values
        parts = misfit(mechanism, trial)
        for name, offset in offsets.items():
            size = 2 if mechanism.loop_kind(name) == "prismatic" else 3
            parts[name][:size] -= offset[:size]
        return np.concatenate(list(parts.values()))

    if len(free):
        found = least_squares(error, q[free], xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
        best, left = found.x, found.fun
    else:
        best, left = q[free], error(q[free])
    if np.abs(left).max() > ASSEMBLY_TOLERANCE_M:
        closed = q.copy()
        closed[free] = best
        gaps = {name: float(np.abs(part).max()) for name, part in misfit(mechanism, closed).items()}
        worst = max(gaps, key=lambda name: gaps[name])
        raise JointplayError(
            f"the mechanism cannot be assembled: loop {worst!r} stays open by {gaps[worst]:.4g} m; "
            "check lengths and frames, or start from other joint positions"
        )
    assembled = q.copy()
    assembled[free] = best
    return assembled


def closing_rows(
    mechanism: Mechanism, q: np.ndarray, loops: Collection[str] | None = None
) -> np.ndarray:
    """Jacobian of what `loops` (None: all) forbid in configuration q, shape (rows, nv).

    Relative velocities of journal and bearing that are zero while the loops stay closed, journals
    resting in their bearings.
    """
    rows = [np.zeros((0, mechanism.model.nv))]
    for name in mechanism.loops if loops is None else loops:
        jacobian = mechanism.relative_jacobian(name, q)
        kind = mechanism.loop_kind(name)
        keep = {"spherical": [0, 1, 2], "prismatic": [0, 1, 3, 4, 5]}.get(kind, [0, 1, 2, 3, 4])
        rows.append(jacobian[keep])
    return np.concatenate(rows)


def consistent_velocity(
    mechanism: Mechanism, q: np.ndarray, v: np.ndarray, held: Sequence[int]
) -> np.ndarray:
    """Velocity nearest to v with which all loops stay closed.

    Args:
        mechanism: with loops; without, v comes back.
        q, v: state, shape (nv,).
        held: coordinates whose speeds are given.

    Raises:
        JointplayError: the given speeds would tear a loop apart.
    """
    if not mechanism.loops:
        return v.copy()
    rows = closing_rows(mechanism, q)
    free = np.setdiff1d(np.arange(len(v)), held)
    free = free[[not mechanism.plays(i) for i in free]] if len(free) else free
    change = -np.linalg.lstsq(rows[:, free], rows @ v, rcond=1e-10)[0]
    moved = v.copy()
    moved[free] += change
    left = float(np.abs(rows @ moved).max(initial=0.0))
    if left > 1e-9 * max(1.0, float(np.abs(v).max(initial=0.0))):
        raise JointplayError(
            f"the initial speeds would tear a loop apart at {left:.3g} m/s: the driven joints "
            "cannot move like this in this configuration"
        )
    return moved
