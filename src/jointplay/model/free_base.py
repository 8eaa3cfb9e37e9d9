"""Free bases: six coordinates of a base that nothing holds, and the charts that describe its turns.

The base has three lengths along the world's axes and three angles yaw, pitch, roll, as a virtual
link has. Angles of this kind are no coordinates where the pitch is a right angle, and a base that
tumbles gets there. During a run the angles therefore count from a rotation that the run chooses,
its chart, which is replaced before the pitch gets far; recorded angles count from the pose of the
URDF throughout.
"""

from __future__ import annotations

import math

import numpy as np

FREE, HELD = "free", "held"
BASES = (HELD, FREE)
"""Kinds of base: bolted to the ground, or held by nothing."""

BASE = "base"
"""Joint name of a free base's coordinates: ``base.x`` and so on."""

ANGLES = slice(3, 6)
"""Coordinates of the base that turn it: yaw, pitch, roll."""

STEEPEST_START = 1e-3
"""Cosine of the pitch below which a base cannot start: its rates there would not be numbers."""

_LEAST_COSINE = 1e-12
"""Least cosine of the pitch by which rates are divided."""
_STILL = 1e-9
"""Angular velocity below which its direction does not turn a chart: rounding [rad/s]."""


def rotation(angles: np.ndarray) -> np.ndarray:
    """Rotations R_z R_y R_x, shape (..., 3, 3), of yaw, pitch, roll (..., 3) [rad]."""
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
    """Angular velocity in the body's axes (..., 3) [rad/s], at yaw, pitch, roll and their rates."""
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
    """Yaw, pitch, roll (n, 3) [rad] of consecutive rotations (n, 3, 3), without jumps.

    Two triples of angles mean the same rotation, and whole turns may be added to either: the triple
    that continues from the last one is taken. The first continues from `before` (3,); without it,
    its pitch is below a right angle.
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
    # Whole turns are counted and multiplied, not summed up as angles: rounding must not depend on
    # how many rotations are asked for.
    number = np.cumsum(np.rint(-np.diff(path, axis=0) / (2.0 * math.pi)), axis=0)
    gone: np.ndarray = path[1:] + 2.0 * math.pi * number
    return gone


def chart_for(turn: np.ndarray, spin: np.ndarray) -> np.ndarray:
    """A chart (3, 3), from which angles count, in which the base's pitch is zero now.

    It stays zero if the base keeps its angular velocity, as far as possible: the chart's x is the
    body's x, its z is square to that and as near as possible to the axis of `spin` (3,), the
    angular velocity in the base's own axes. A body that turns about its own x, or about an axis
    square to that, keeps the chart.
    """
    x, across = turn[:, 0], np.array([0.0, spin[1], spin[2]])
    size = float(np.linalg.norm(across))
    z = turn @ (across / size) if size > _STILL else turn[:, 2]
    chart: np.ndarray = np.stack([x, np.cross(z, x), z], axis=1)
    return chart
