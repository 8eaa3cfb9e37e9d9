"""Bases that nothing holds: six coordinates of the base, and the charts that describe its turns.

The base has three lengths along the world's axes and three angles yaw, pitch, roll, as a virtual
link has. Angles of this kind are no coordinates where the pitch is a right angle, and a base that
tumbles gets there. While a run is under way the angles are therefore counted from a rotation of
the run's own, its chart, which is replaced before the pitch gets far; what is recorded is counted
from the pose of the URDF throughout.
"""

from __future__ import annotations

import math

import numpy as np

FREE, HELD = "free", "held"
BASES = (HELD, FREE)
"""What can be said of a base: bolted to the ground, or held by nothing."""

BASE = "base"
"""Whose the coordinates of a free base are: ``base.x`` and so on."""

ANGLES = slice(3, 6)
"""Of the base's coordinates, those that turn it: yaw, pitch, roll."""

STEEPEST_START = 1e-3
"""Cosine of the pitch below which a base cannot start: its rates there would not be numbers."""

_LEAST_COSINE = 1e-12
"""Stands for a smaller cosine of the pitch, lest rates be divided by zero."""
_STILL = 1e-9
"""Angular velocity below which a chart does not ask for its direction [rad/s]."""


def rotation(angles: np.ndarray) -> np.ndarray:
    """Rotations R_z R_y R_x, shape (..., 3, 3), by yaw, pitch, roll (..., 3) [rad]."""
    cosines, sines = np.cos(angles), np.sin(angles)
    cy, cp, cr = np.moveaxis(cosines, -1, 0)
    sy, sp, sr = np.moveaxis(sines, -1, 0)
    rows = (
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )
    return np.stack([np.stack(row, -1) for row in rows], -2)


def turning(angles: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Angular velocity in the body's axes [rad/s], of yaw, pitch, roll and their rates (..., 3)."""
    _, cp, cr = np.moveaxis(np.cos(angles), -1, 0)
    _, sp, sr = np.moveaxis(np.sin(angles), -1, 0)
    yaw, pitch, roll = np.moveaxis(rates, -1, 0)
    return np.stack([roll - sp * yaw, cp * sr * yaw + cr * pitch, cp * cr * yaw - sr * pitch], -1)


def rates(angles: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """Rates of yaw, pitch, roll [rad/s] at an angular velocity: the inverse of `turning`."""
    _, cp, cr = np.moveaxis(np.cos(angles), -1, 0)
    _, sp, sr = np.moveaxis(np.sin(angles), -1, 0)
    x, y, z = np.moveaxis(spin, -1, 0)
    yaw = (y * sr + z * cr) / np.where(np.abs(cp) < _LEAST_COSINE, _LEAST_COSINE, cp)
    return np.stack([yaw, y * cr - z * sr, x + sp * yaw], -1)


def angles_of(turns: np.ndarray, before: np.ndarray | None = None) -> np.ndarray:
    """Yaw, pitch, roll (n, 3) [rad] of rotations (n, 3, 3) in a row, without jumps.

    Two triples of angles mean the same rotation, and either may have whole turns added: the one
    that goes on from the last is taken, the first from `before` (3,); without it the pitch begins
    below a right angle.
    """
    angles = np.stack(
        [
            np.arctan2(turns[:, 1, 0], turns[:, 0, 0]),
            np.arctan2(-turns[:, 2, 0], np.hypot(turns[:, 2, 1], turns[:, 2, 2])),
            np.arctan2(turns[:, 2, 1], turns[:, 2, 2]),
        ],
        axis=1,
    )
    first = angles[:1] if before is None else before[None]
    path = np.concatenate([first, angles])
    flipped = np.stack([path[:, 0] + math.pi, math.pi - path[:, 1], path[:, 2] + math.pi], axis=1)

    def jumps(last: np.ndarray) -> np.ndarray:
        """Largest difference of the triples from those before them, whole turns aside."""
        between = (path[1:] - last + math.pi) % (2.0 * math.pi) - math.pi
        return np.asarray(np.abs(between).max(axis=1))

    same, crossed = jumps(path[:-1]), jumps(flipped[:-1])
    through = np.cumsum(crossed < same) % 2 == 1  # from one triple to the other, and back
    path[1:][through] = flipped[1:][through]
    # Whole turns by their number: rounding must not depend on how many rotations are asked for.
    number = np.cumsum(np.rint(-np.diff(path, axis=0) / (2.0 * math.pi)), axis=0)
    gone: np.ndarray = path[1:] + 2.0 * math.pi * number
    return gone


def chart_for(turn: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """A chart (3, 3) in which the pitch is zero now, and stays so if the base goes on as it turns.

    Angles are counted from it. Its z is square to the body's x, and otherwise as near as can be to
    the axis of `spin` (3,), the angular velocity in the base's own axes: a body that turns about
    one axis, its own x or one square to that, keeps the chart.
    """
    x, across = turn[:, 0], np.array([0.0, spin[1], spin[2]])
    size = float(np.linalg.norm(across))
    z = turn @ (across / size) if size > _STILL else turn[:, 2]
    chart: np.ndarray = np.stack([x, np.cross(z, x), z], axis=1)
    return chart
