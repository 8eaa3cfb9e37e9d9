"""Springs in the directions in which a joint holds: numbers, a matrix, or curves."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from jointplay.contact import resultant
from jointplay.core.errors import JointplayError, require_numbers
from jointplay.core.schema import Described, check_fields, quantity

_FREE = {"about its axis": 5, "along its axis": 2}
"""Which of the six directions x, y, z, about x, y, z is free."""

_FREE_WORDS = {
    "about its axis": "stiffness there is the gear's or the drive's",
    "along its axis": "stiffness there is the drive's",
}


def _turn(places: Sequence[tuple[int, float]]) -> np.ndarray:
    """Directions by parts of xi, (n, n), from where each part stands and its sign."""
    whole = np.zeros((len(places), len(places)))
    for k, (at, sign) in enumerate(places):
        whole[at, k] = sign
    return whole


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}"


@dataclass(frozen=True, kw_only=True)
class _Springs(Described):
    """Springs in the directions in which a joint holds."""

    directions: ClassVar[tuple[str, ...]]
    """Which stiffness holds in each direction."""
    turn: ClassVar[np.ndarray]
    """Directions of what compiled code calls xi, (n, n)."""
    free: ClassVar[str | None]
    """In which direction a joint is free; None: in none."""

    matrix: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Instead of numbers: of all directions in which it holds, (n, n)."""
    damping_time: float = quantity("s", default=1e-5, least=0.0, words="damping time")
    """Damping over stiffness [s]: a swing of angular frequency w decays by w damping_time / 2."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_fields(self)
        names = dict.fromkeys(self.directions)
        for name in (f"{one}_curve" for one in names):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _checked_curve(name, getattr(self, name)))
        if self.matrix is not None:
            object.__setattr__(self, "matrix", self._checked_matrix(self.matrix))
            if any(getattr(self, one) is not None for one in names):
                raise JointplayError(
                    f"give the stiffness matrix or {_listed(names)} stiffness, not both",
                    where=("matrix",),
                )
        lever = np.array([1.0 if row < 3 else 30.0 for row in self.rows])
        sizes = np.linalg.eigvalsh(self.stiffness * np.outer(lever, lever))
        if sizes.min() <= 1e-12 * sizes.max():
            but = "" if self.free is None else f" but {self.free}"
            raise JointplayError(
                f"a joint must be held in every direction{but}: give {_listed(names)} stiffness "
                "(or a curve for each), or a positive definite matrix"
            )

    def _checked_matrix(self, matrix: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
        given, where = require_numbers("the stiffness matrix", matrix), ("matrix",)
        ways = len(self.directions)
        if given.shape not in ((ways, ways), (6, 6)) or not np.isfinite(given).all():
            raise JointplayError(
                f"the stiffness matrix must be finite and ({ways}, {ways}), got {given.shape}",
                where=where,
            )
        if self.free is not None and given.shape == (6, 6):
            at = _FREE[self.free]
            if np.abs(given[at]).max() or np.abs(given[:, at]).max():
                raise JointplayError(
                    f"{self.free} a joint is free: row and column {at + 1} of a stiffness matrix "
                    f"must be zero ({_FREE_WORDS[self.free]})",
                    where=where,
                )
            given = np.delete(np.delete(given, at, axis=0), at, axis=1)
        if np.abs(given - given.T).max() > 1e-9 * np.abs(given).max():
            raise JointplayError("the stiffness matrix must be symmetric", where=where)
        return tuple(map(tuple, given.tolist()))

    @property
    def rows(self) -> list[int]:
        """Which of the six directions x, y, z, about x, y, z it holds."""
        return [row for row in range(6) if self.free is None or row != _FREE[self.free]]

    def displacements(self, loads: np.ndarray) -> np.ndarray:
        """By how much it gives way at its first stiffness.

        Args:
            loads: forces [N] and moments [N m], in its axes, (n, 6); what acts in the direction
                that is free has no effect.

        Returns:
            Displacements [m] and rotations [rad], (n, 6).
        """
        given = np.zeros_like(loads)
        given[:, self.rows] = np.linalg.solve(self.stiffness, loads[:, self.rows].T).T
        return given

    @property
    def _curves(self) -> list[list[tuple[float, float]]]:
        """By direction."""
        curves = (getattr(self, f"{name}_curve") for name in self.directions)
        return [[(one[0], one[1]) for one in curve or ()] for curve in curves]

    @cached_property
    def stiffness(self) -> np.ndarray:
        """At small displacements in the directions of `rows`, shape (n, n)."""
        if self.matrix is not None:
            whole = np.array(self.matrix)
        else:
            whole = np.diag([getattr(self, name) or 0.0 for name in self.directions])
        for k, curve in enumerate(self._curves):
            if curve:
                whole[k, k] += curve[0][1] / curve[0][0]
        return whole

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """By which compiled code knows them."""
        linear, curves = self.stiffness.copy(), self._curves
        for k, curve in enumerate(curves):
            if curve:
                linear[k, k] -= curve[0][1] / curve[0][0]
        at = np.abs(self.turn).argmax(axis=0)
        return resultant.spring_numbers(
            self.turn.T @ linear @ self.turn, [curves[int(k)] for k in at]
        )


@dataclass(frozen=True, kw_only=True)
class Elasticity(_Springs):
    """Stiffness and damping of what holds a joint that turns, in its own axes, z the axis.

    Give numbers, a matrix, or a curve for a direction, which is added to them. About the axis a
    joint is free: what gives way there is its gear or its drive.

    Raises:
        JointplayError: a stiffness that is not positive, a matrix that is not symmetric and
            positive definite, or a curve that does not rise.
    """

    directions: ClassVar[tuple[str, ...]] = ("radial", "radial", "axial", "tilt", "tilt")
    turn: ClassVar[np.ndarray] = _turn(((0, 1.0), (1, 1.0), (2, 1.0), (4, 1.0), (3, -1.0)))
    free: ClassVar[str] = "about its axis"

    radial: float | None = quantity("N/m", default=None, above=0.0, words="radial stiffness")
    """Across the axis, in x and y alike [N/m]."""
    axial: float | None = quantity("N/m", default=None, above=0.0, words="axial stiffness")
    """Along the axis [N/m]."""
    tilt: float | None = quantity("N*m/rad", default=None, above=0.0, words="tilt stiffness")
    """About x and y alike [N m/rad]."""
    radial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]), added in x and in y; at most 12."""
    axial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]) along the axis."""
    tilt_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about x and about y."""

    @property
    def words(self) -> str:
        """Stiffness, for a line of text."""
        x, _, z, tilt, _ = np.diag(self.stiffness)
        return f"{1e-6 * x:.3g} N/um across, {1e-6 * z:.3g} N/um along, {tilt:.3g} N m/rad in tilt"


@dataclass(frozen=True, kw_only=True)
class GuideElasticity(_Springs):
    """Stiffness and damping of what holds a slider, z the direction of sliding.

    As `Elasticity`; a matrix is of displacements along x, y and rotations about x, y, z.

    Raises:
        JointplayError: see `Elasticity`.
    """

    directions: ClassVar[tuple[str, ...]] = ("across", "across", "tilt", "tilt", "torsion")
    turn: ClassVar[np.ndarray] = _turn(((0, 1.0), (1, 1.0), (3, 1.0), (2, -1.0), (4, 1.0)))
    free: ClassVar[str] = "along its axis"

    across: float | None = quantity("N/m", default=None, above=0.0, words="stiffness across")
    """In x and y alike [N/m]."""
    tilt: float | None = quantity("N*m/rad", default=None, above=0.0, words="tilt stiffness")
    """About x and y alike [N m/rad]."""
    torsion: float | None = quantity("N*m/rad", default=None, above=0.0, words="torsion stiffness")
    """About z [N m/rad]."""
    across_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]), added in x and in y; at most 12."""
    tilt_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about x and about y."""
    torsion_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about z."""

    @property
    def words(self) -> str:
        """Stiffness, for a line of text."""
        x, _, tilt, _, turn = np.diag(self.stiffness)
        return f"{1e-6 * x:.3g} N/um across, {tilt:.3g} N m/rad in tilt, {turn:.3g} in torsion"


@dataclass(frozen=True, kw_only=True)
class MountElasticity(_Springs):
    """Stiffness and damping of what holds a body in every direction, in its own axes.

    As `Elasticity`, and about z as well; a matrix is (6, 6), of displacements along x, y, z and
    rotations about them. Under a bush, z is the axis of the bush's joint.

    Raises:
        JointplayError: see `Elasticity`.
    """

    directions: ClassVar[tuple[str, ...]] = (
        *("radial", "radial", "axial"),
        *("tilt", "tilt", "torsion"),
    )
    turn: ClassVar[np.ndarray] = np.eye(6)
    free: ClassVar[str | None] = None

    radial: float | None = quantity("N/m", default=None, above=0.0, words="radial stiffness")
    """Across z, in x and y alike [N/m]."""
    axial: float | None = quantity("N/m", default=None, above=0.0, words="axial stiffness")
    """Along z [N/m]."""
    tilt: float | None = quantity("N*m/rad", default=None, above=0.0, words="tilt stiffness")
    """About x and y alike [N m/rad]."""
    torsion: float | None = quantity("N*m/rad", default=None, above=0.0, words="torsion stiffness")
    """About z [N m/rad]."""
    radial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]), added in x and in y; at most 12."""
    axial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]) along z."""
    tilt_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about x and about y."""
    torsion_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about z."""

    @property
    def words(self) -> str:
        """Stiffness, for a line of text."""
        x, _, z, tilt, _, turn = np.diag(self.stiffness)
        return (
            f"{1e-6 * x:.3g} N/um across, {1e-6 * z:.3g} N/um along, {tilt:.3g} N m/rad in tilt, "
            f"{turn:.3g} in torsion"
        )


def _checked_curve(name: str, given: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
    rows = require_numbers(f"the {name.replace('_', ' ')}", given)
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
