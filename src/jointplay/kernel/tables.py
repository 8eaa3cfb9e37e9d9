"""What acts on single coordinates, as the kernels have it: drives, friction, gears."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointplay.kernel import layout


@dataclass(frozen=True)
class Tables:
    """What acts on single coordinates."""

    drives: np.ndarray
    """Of `layout.DRIVE_ROW`, see `drive_row`."""
    frictions: np.ndarray
    """Of `layout.FRICTION_ROW`."""
    gears: np.ndarray
    """Of `layout.GEAR_ROW`."""
    reference: np.ndarray
    """Rows of q, v and feed-forward effort of the nu driven coordinates, shape (nref, 3 nu),
    nref >= 2."""
    interval: float
    """Between the rows of `reference` [s]."""
    nodes: int
    """Rows of the whole reference, of which `reference` is the beginning."""


def drive_row(
    column: int,
    coordinate: int,
    seen: int | None = None,
    kp: float = 0.0,
    kd: float = 0.0,
    armature: float = 0.0,
    limit: float = np.inf,
) -> np.ndarray:
    """Record of the drive of one coordinate, shape (1,).

    Args:
        column: of the reference.
        coordinate: that it acts on.
        seen: coordinate that its encoder sees; None takes its own.
        kp, kd: gains [N m/rad, N m s/rad, or N/m, N s/m].
        armature: > 0 prescribes the motion; the model must have this armature [kg m^2 or kg].
        limit: largest effort, to which others are cut [N m or N].
    """
    seen = coordinate if seen is None else seen
    return np.array([(column, coordinate, seen, kp, kd, armature, limit)], layout.DRIVE_ROW)


def friction_row(
    coordinate: int, coulomb: float, stiction: float, stribeck: float, viscous: float
) -> np.ndarray:
    """Record of a joint's friction, shape (1,); see `drive.JointFriction`."""
    return np.array([(coordinate, coulomb, stiction, stribeck, viscous)], layout.FRICTION_ROW)


def gear_row(
    motor: int, link: int, half_play: float, stiffness: float, damping: float
) -> np.ndarray:
    """Record of a gear, shape (1,): coordinates, half the play [rad], stiffness and damping."""
    return np.array([(motor, link, half_play, stiffness, damping)], layout.GEAR_ROW)


def stacked(rows: Sequence[np.ndarray], kind: np.dtype) -> np.ndarray:
    """All rows of one kind, an empty array if there are none."""
    return np.concatenate(rows) if rows else np.zeros(0, kind)
