"""Where the kernels act: what they know of a joint with clearance, its film, and a load."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.physics.kernel import layout
from jointplay.physics.kernel.constants import NEVER

Carriers = tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]
"""Two Pinocchio joints, and the placement of a frame in each."""


@dataclass(frozen=True)
class JointSite:
    """One joint with clearance, as the kernels have it."""

    record: np.ndarray
    """Of `layout.JOINT`, shape (1,); what it points to is left to the workspace."""
    parameters: np.ndarray
    """Of the normal-force law, for each contact, shape (contacts, `MAX_PARAMETERS`)."""
    dimensions: tuple[float, ...]
    """Of its surfaces, as `geometry.touch` takes them [m]."""
    holds: bool = False
    """Whether springs, not surfaces, connect its bodies."""
    carriers: Carriers | None = None
    """Pinocchio joint that carries the bearing, and the bearing's placement in it; the same of the
    journal. None where the coordinates of a virtual link, from `first` on, move the journal."""
    signs: np.ndarray | None = None
    """With `carriers`: +1 for coordinates that move the journal only, -1 for those that move the
    bearing only, 0 for all others, shape (nv,)."""


PARTS = ("bearing", "journal")

CarriedFrame = tuple[int, np.ndarray]
"""A body by its place, and a frame's rotation, row by row, and origin in it, shape (12,)."""


@dataclass(frozen=True)
class LoadSite:
    """What the kernels know of one load (`kernel.load`), on coordinates or between two frames."""

    law: int
    """Address of its law."""
    numbers: np.ndarray
    """Of the law; what is written into it later, the law sees."""
    stores: bool = False
    """Whether its answer at rest is the slope of an energy."""
    implicit: int = NEVER
    """When the rest of it depends on velocity: `words.NEVER`, `ALWAYS` or `IF_PRESSED`."""
    inputs: tuple[int, ...] = ()
    """Coordinates that the law reads."""
    outputs: tuple[int, ...] = ()
    """Coordinates on which it acts; if it is implicit, those that it reads."""
    bounds: tuple[float, ...] = ()
    """Largest effort on each of them, if it is limited [N m or N]."""
    carriers: Carriers | None = None
    """Between frames: Pinocchio joints that carry them, and the frames' placements in these."""
    signs: np.ndarray | None = None
    """Of the coordinates that move the frames, as of a `JointSite`."""

    @property
    def size(self) -> int:
        """Numbers that the law gives."""
        return len(self.outputs) if self.carriers is None else 6


# What acts on single coordinates, as the kernels have it: drives, friction, gears.


@dataclass(frozen=True)
class CoordinateTables:
    """What acts on single coordinates."""

    drives: np.ndarray
    """Of `layout.DRIVE_ROW`, see `drive_row`."""
    servos: np.ndarray
    """Of `layout.SERVO`."""
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
    encoder: int | None = None,
    kp: float = 0.0,
    kd: float = 0.0,
    armature: float = 0.0,
    limit: float = np.inf,
) -> np.ndarray:
    """Record of the drive of one coordinate, shape (1,).

    Args:
        column: of the reference.
        coordinate: that it acts on.
        encoder: coordinate that its encoder measures; None takes its own.
        kp, kd: gains [N m/rad, N m s/rad, or N/m, N s/m].
        armature: > 0 prescribes the motion; the model must have this armature [kg m^2 or kg].
        limit: largest effort, to which others are cut [N m or N].
    """
    encoder = coordinate if encoder is None else encoder
    values = (column, coordinate, encoder, kp, kd, armature, limit, 0, 0.0)
    return np.array([values], layout.DRIVE_ROW)


def friction_row(coordinate: int, **given: float) -> np.ndarray:
    """Record of a joint's friction, shape (1,): fields of `layout.FRICTION_ROW`; see
    `drive.JointFriction`.
    """
    row = np.zeros(1, layout.FRICTION_ROW)
    row["coordinate"], row["stribeck"] = coordinate, 1.0
    for name, value in given.items():
        row[name] = value
    return row


def gear_row(**given: Any) -> np.ndarray:
    """Record of a gear, shape (1,): fields of `layout.GEAR_ROW`, lists shorter."""
    row = np.zeros(1, layout.GEAR_ROW)
    row["bend_twists"], row["presliding"], row["lever"] = np.inf, 1.0, 1.0
    for name, value in given.items():
        if np.ndim(value):
            row[name][0, : len(value)] = value
        else:
            row[name] = value
    return row


def stacked(rows: Sequence[np.ndarray], kind: np.dtype) -> np.ndarray:
    """All rows of one kind, an empty array if there are none."""
    return np.concatenate(rows) if rows else np.zeros(0, kind)
