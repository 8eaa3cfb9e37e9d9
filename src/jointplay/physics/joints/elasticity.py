"""The elasticity of joints, seats and mounts: stiffness numbers, a matrix, or curves."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jointplay.base.errors import JointplayError, require_numbers
from jointplay.base.schema import Described, OptionalQuantity, Quantity, check_fields, quantity
from jointplay.physics.contact import resultant

_MOST_BENDS = 60
"""Most Newton steps that find displacements on curves."""
ABOUT_AXIS, ALONG_AXIS = 5, 2
"""The free direction of joints that turn, and of joints that slide: indices of `DIRECTIONS`."""
DIRECTIONS = ("radial", "radial", "axial", "tilt", "tilt", "torsion")
"""Names of the stiffness along x, y, z and about x, y, z."""

_LEFT_FREE = {
    ABOUT_AXIS: ("about its axis", "stiffness there is the gear's or the drive's"),
    ALONG_AXIS: ("along its axis", "stiffness there is the drive's"),
}
"""Free directions, and where their stiffness belongs, in words."""

_XI = {
    ABOUT_AXIS: np.eye(6)[:, [0, 1, 2, 4, 3]] * [1.0, 1.0, 1.0, 1.0, -1.0],
    ALONG_AXIS: np.eye(6)[:, [0, 1, 4, 3, 5]] * [1.0, 1.0, 1.0, -1.0, 1.0],
    None: np.eye(6),
}
"""Map from the coordinates xi of compiled code (`contact.elastic`) to the six directions, by the
direction that is free. A tilt is in xi the axis' components x and y across the bearing's axis, by a
rotation about y and about -x."""


@dataclass(frozen=True, kw_only=True)
class Elasticity(Described):
    """Stiffness and damping of a joint, a seat or a mount, in its own axes.

    z is the axis about which a joint turns, or along which it slides. Give numbers or a matrix, and
    for any direction a curve, which is added to them. A joint that turns has no torsion stiffness,
    one that slides no axial stiffness: there the gear or the drive is elastic. A mount, and the
    seat of a joint whose surfaces slide, are held in every direction.

    Raises:
        JointplayError: a stiffness that is not positive, a matrix that is not symmetric and
            positive definite where it holds, or a curve that does not rise.
    """

    matrix: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Stiffness matrix for displacements along x, y, z and rotations about them, (6, 6), instead of
    numbers; zero in the row and column of a direction that is free."""
    damping_time: Quantity = quantity("s", default=1e-5, least=0.0, label="damping time")
    """Damping over stiffness [s]: a vibration of angular frequency w has the damping ratio
    w damping_time / 2."""
    radial: OptionalQuantity = quantity("N/m", default=None, above=0.0, label="radial stiffness")
    """Stiffness across z, the same in x and y [N/m]."""
    axial: OptionalQuantity = quantity("N/m", default=None, above=0.0, label="axial stiffness")
    """Stiffness along z [N/m]."""
    tilt: OptionalQuantity = quantity("N*m/rad", default=None, above=0.0, label="tilt stiffness")
    """Stiffness about x and y, the same for both [N m/rad]."""
    torsion: OptionalQuantity = quantity(
        "N*m/rad", default=None, above=0.0, label="torsion stiffness"
    )
    """Stiffness about z [N m/rad]."""
    radial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]), added in x and in y; at most 12."""
    axial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]) along z."""
    tilt_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about x and about y."""
    torsion_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about z."""

    def __post_init__(self) -> None:
        check_fields(self)
        names = dict.fromkeys(DIRECTIONS)
        for name in (f"{direction}_curve" for direction in names):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _checked_curve(name, getattr(self, name)))
        if self.matrix is not None:
            object.__setattr__(self, "matrix", _checked_matrix(self.matrix))
            if any(getattr(self, direction) is not None for direction in names):
                raise JointplayError(
                    "give the stiffness matrix or radial, axial, tilt and torsion stiffness, not "
                    "both",
                    where=("matrix",),
                )
        # Scaled by a lever, so that N/m and N m/rad compare.
        held = self.held
        lever = np.array([1.0 if row < 3 else 30.0 for row in held])
        sizes = np.linalg.eigvalsh(self.stiffness[np.ix_(held, held)] * np.outer(lever, lever))
        if held and sizes.min() <= 1e-12 * sizes.max():
            raise JointplayError("the stiffness matrix must be positive definite", ("matrix",))

    def require_free(self, free: int | None) -> None:
        """Refuse unless all directions but `free`, an index of `DIRECTIONS` or None, are held.

        Raises:
            JointplayError: another direction is not held, or `free` is.
        """
        needed, but = dict.fromkeys(DIRECTIONS), ""
        if free is not None:
            where, why = _LEFT_FREE[free]
            del needed[DIRECTIONS[free]]
            but = f" but {where}"
            if free in self.held:
                raise JointplayError(
                    f"{where} a joint is free: it has no {DIRECTIONS[free]} stiffness, and row and "
                    f"column {free + 1} of a stiffness matrix must be zero ({why})"
                )
        if len(self.held) < 6 - (free is not None):
            *first, last = needed
            raise JointplayError(
                f"a joint must be held in every direction{but}: give {', '.join(first)} and {last} "
                "stiffness (or a curve for each), or a positive definite matrix"
            )

    @cached_property
    def held(self) -> list[int]:
        """Indices of the directions, along and about x, y, z, that have stiffness."""
        return [row for row in range(6) if self.stiffness[row].any()]

    def displacements(self, loads: np.ndarray) -> np.ndarray:
        """Displacements [m] and rotations [rad] (n, 6) under forces [N] and moments [N m] (n, 6).

        In its axes, with the stiffness at small displacements; loads in the direction that is free
        have no effect.
        """
        displaced, held = np.zeros_like(loads), self.held
        displaced[:, held] = np.linalg.solve(self.stiffness[np.ix_(held, held)], loads[:, held].T).T
        return displaced

    def sunk(self, loads: np.ndarray, free: int | None) -> np.ndarray:
        """As `displacements`, but on the curves; `free`: see `require_free`."""
        if not any(self._curves):
            return self.displacements(loads)
        turn = _XI[free]
        return np.array([turn @ self.under(turn.T @ load, free)[0] for load in loads])

    def under(self, push: np.ndarray, free: int | None) -> tuple[np.ndarray, np.ndarray]:
        """Displacement (n,) under a load (n,) on the curves, and the compliance there (n, n).

        In the coordinates xi of compiled code (see `contact.elastic`), by Newton's method; `free`:
        see `require_free`.
        """
        turn = _XI[free]
        linear, at = turn.T @ self._linear @ turn, np.abs(turn).argmax(axis=0)
        curves = [np.array([(0.0, 0.0), *self._curves[int(k)]]) for k in at]
        x, slopes = np.zeros(len(at)), np.zeros(len(at))
        for _ in range(_MOST_BENDS):
            load = linear @ x
            for i, curve in enumerate(curves):
                if len(curve) > 1:
                    k = min(int(np.searchsorted(curve[:, 0], abs(x[i]), "right")), len(curve) - 1)
                    (start, force), (end, end_force) = curve[k - 1], curve[k]
                    slopes[i] = (end_force - force) / (end - start)
                    load[i] += np.copysign(force + slopes[i] * (abs(x[i]) - start), x[i])
            soft = np.linalg.inv(linear + np.diag(slopes))
            step = soft @ (push - load)
            x = x + step
            if (np.abs(step) <= 1e-14 * np.abs(x)).all():
                break
        return x, soft

    @property
    def _curves(self) -> list[list[tuple[float, float]]]:
        """Points of the curve in each of the six directions; empty where there is none."""
        curves = (getattr(self, f"{name}_curve") for name in DIRECTIONS)
        return [[(point[0], point[1]) for point in curve or ()] for curve in curves]

    @cached_property
    def stiffness(self) -> np.ndarray:
        """Stiffness at small displacements along x, y, z and rotations about them, (6, 6)."""
        if self.matrix is not None:
            matrix = np.array(self.matrix)
        else:
            matrix = np.diag([getattr(self, name) or 0.0 for name in DIRECTIONS])
        for k, curve in enumerate(self._curves):
            if curve:
                matrix[k, k] += curve[0][1] / curve[0][0]
        return matrix

    @property
    def _linear(self) -> np.ndarray:
        """The stiffness without the curves, (6, 6)."""
        linear = self.stiffness.copy()
        for k, curve in enumerate(self._curves):
            if curve:
                linear[k, k] -= curve[0][1] / curve[0][0]
        return linear

    def numbers(self, free: int | None) -> tuple[float, ...]:
        """The springs as numbers for compiled code; `free`: see `require_free`."""
        linear, curves, turn = self._linear, self._curves, _XI[free]
        at = np.abs(turn).argmax(axis=0)
        return resultant.spring_numbers(turn.T @ linear @ turn, [curves[int(k)] for k in at])

    @property
    def summary(self) -> str:
        """Stiffness in words."""
        x, _, z, tilt, _, turn = np.diag(self.stiffness)
        parts = [f"{1e-6 * x:.3g} N/µm across"]
        parts += [f"{1e-6 * z:.3g} N/µm along"] if z else []
        parts += [f"{tilt:.3g} N m/rad in tilt"]
        parts += [f"{turn:.3g} in torsion"] if turn else []
        return ", ".join(parts)


def _checked_matrix(matrix: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    stiffness, where = require_numbers("the stiffness matrix", matrix), ("matrix",)
    if stiffness.shape != (6, 6) or not np.isfinite(stiffness).all():
        raise JointplayError(
            f"the stiffness matrix must be finite and (6, 6), got {stiffness.shape}", where=where
        )
    if np.abs(stiffness - stiffness.T).max() > 1e-9 * np.abs(stiffness).max():
        raise JointplayError("the stiffness matrix must be symmetric", where=where)
    return tuple(map(tuple, stiffness.tolist()))


def _checked_curve(name: str, points: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    rows = require_numbers(f"the {name.replace('_', ' ')}", points)
    where = (name,)
    if rows.ndim != 2 or rows.shape[1] != 2 or not 1 <= len(rows) <= resultant.NODES:
        raise JointplayError(
            f"a stiffness curve has 1 to {resultant.NODES} points (displacement, force), got the "
            f"shape {rows.shape}",
            where=where,
        )
    steps = np.diff(np.vstack([np.zeros(2), rows]), axis=0)
    if not np.isfinite(rows).all() or not (steps > 0.0).all():
        raise JointplayError(
            "displacements and forces of a stiffness curve must rise from zero on", where=where
        )
    return tuple(map(tuple, rows.tolist()))
