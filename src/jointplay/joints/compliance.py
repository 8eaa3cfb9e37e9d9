"""Joints that give way: springs in the directions in which a joint holds its two bodies.

`Elasticity` says how stiff; `CompliantJoint` is a joint without play that gives way like this, and
a rolling bearing can have it as its `seat`, in series with its balls or rollers.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from jointplay.contact import resultant
from jointplay.contact.law import ContactProperties, NormalForceLaw
from jointplay.core.errors import JointplayError, require_numbers
from jointplay.core.schema import Described, check_fields, quantity
from jointplay.joints.base import Outline, WholeLawJoint
from jointplay.joints.element_play import NO_PLAY
from jointplay.joints.play import Play

_FREE = {"about its axis": 5, "along its axis": 2}
"""Which of the six directions x, y, z, about x, y, z is free."""


def _turn(places: Sequence[tuple[int, float]]) -> np.ndarray:
    """Directions by parts of xi, (5, 5), from where each part stands and its sign."""
    whole = np.zeros((resultant.WAYS, resultant.WAYS))
    for k, (at, sign) in enumerate(places):
        whole[at, k] = sign
    return whole


def _listed(names: Iterable[str]) -> str:
    *first, last = names
    return f"{', '.join(first)} and {last}"


@dataclass(frozen=True, kw_only=True)
class _Springs(Described):
    """Springs in the five directions in which a joint holds."""

    directions: ClassVar[tuple[str, ...]]
    """Which stiffness holds in each direction."""
    turn: ClassVar[np.ndarray]
    """Directions of what compiled code calls xi, (5, 5)."""
    free: ClassVar[str]
    """In which direction a joint is free."""

    matrix: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Instead of numbers: of all five directions, (5, 5)."""
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
        lengths = 3 if _FREE[self.free] == 5 else 2
        lever = np.repeat([1.0, 30.0], [lengths, resultant.WAYS - lengths])
        sizes = np.linalg.eigvalsh(self.stiffness * np.outer(lever, lever))
        if sizes.min() <= 1e-12 * sizes.max():
            raise JointplayError(
                f"a joint must be held in every direction but {self.free}: give {_listed(names)} "
                "stiffness (or a curve for each), or a positive definite matrix"
            )

    def _checked_matrix(self, matrix: Sequence[Sequence[float]]) -> tuple[tuple[float, ...], ...]:
        given, where = require_numbers("the stiffness matrix", matrix), ("matrix",)
        if given.shape not in ((resultant.WAYS,) * 2, (6, 6)) or not np.isfinite(given).all():
            raise JointplayError(
                f"the stiffness matrix must be finite and (5, 5), got {given.shape}", where=where
            )
        if given.shape == (6, 6):
            at = _FREE[self.free]
            if np.abs(given[at]).max() or np.abs(given[:, at]).max():
                raise JointplayError(
                    f"{self.free} a joint is free: row and column {at + 1} of a stiffness matrix "
                    "must be zero (stiffness there is the gear's or the drive's)",
                    where=where,
                )
            given = np.delete(np.delete(given, at, axis=0), at, axis=1)
        if np.abs(given - given.T).max() > 1e-9 * np.abs(given).max():
            raise JointplayError("the stiffness matrix must be symmetric", where=where)
        return tuple(map(tuple, given.tolist()))

    @property
    def _curves(self) -> list[list[tuple[float, float]]]:
        """By direction."""
        curves = (getattr(self, f"{name}_curve") for name in self.directions)
        return [[(one[0], one[1]) for one in curve or ()] for curve in curves]

    @cached_property
    def stiffness(self) -> np.ndarray:
        """At small displacements in the five directions, shape (5, 5)."""
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


@dataclass(frozen=True, kw_only=True)
class _Held(WholeLawJoint):
    """A joint without play that gives way in five directions: springs hold it."""

    clearance_fields: ClassVar[Mapping[str, str | None]] = {}
    spring_law: ClassVar[int]

    elasticity: Elasticity | GuideElasticity
    """How stiff it is."""

    @property
    def springs(self) -> Elasticity | GuideElasticity:
        """Those of `elasticity`."""
        return self.elasticity

    @property
    def contacts(self) -> tuple[str, ...]:
        """One, which always holds."""
        return ("springs",)

    @cached_property
    def resultant(self) -> tuple[float, ...]:
        """Numbers by which compiled code knows the springs; see `contact.elastic`."""
        head = resultant.bearing_numbers(
            rollers=False, count=0, stiffness=0.0, radius=0.0, reach=0.0, distance=0.0, ratio=0.0,
            rows=(), damping=self.elasticity.damping_time,
        )  # fmt: skip
        return (*head, *self.elasticity.numbers)

    @property
    def law(self) -> int:
        """Springs alone."""
        return self.spring_law

    @property
    def normal(self) -> NormalForceLaw:
        """A linear spring across."""
        return resultant.ElementContact(1.0)

    def contact_properties(self, contact: int) -> ContactProperties:
        """The stiffest direction."""
        return ContactProperties(float(np.diag(self.elasticity.stiffness)[:2].max()), 1.0)

    @property
    def clearances(self) -> dict[str, float]:
        """None."""
        return {}

    @property
    def radial_room(self) -> float:
        """Nothing is free."""
        return 0.0

    @property
    def search_room(self) -> float:
        """What 1 N displaces across [m]."""
        return 1.0 / float(np.diag(self.elasticity.stiffness)[:2].max())

    @property
    def depth_limit(self) -> float:
        """A tenth of a metre: far beyond what a joint gives way."""
        return 0.1

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        """Anywhere: nothing hits."""
        return True

    def play(self, second_order: bool = True) -> Play:
        """Nothing is free."""
        return NO_PLAY

    def scaled(self, factor: float) -> _Held:
        """As it is: it has no clearance."""
        return self

    @property
    def words(self) -> str:
        """Stiffness, for a line of text."""
        return f"compliant, {self.elasticity.words}"

    @property
    def play_words(self) -> str:
        """See `Clearance.play_words`."""
        return "no play"


@dataclass(frozen=True, kw_only=True)
class CompliantJoint(_Held):
    """A joint that turns without play, and gives way across, along and in tilt.

    Its six coordinates are free, and springs hold all but the turn about the axis.

    Raises:
        JointplayError: see `Elasticity`.
    """

    kind: ClassVar[str] = "compliant"
    replaces: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("yaw",)
    spring_law: ClassVar[int] = resultant.SPRINGS

    elasticity: Elasticity
    """How stiff it is."""

    @property
    def outline(self) -> Outline:
        """A disc to show, without room; its radius is that at which tilt is as stiff as axial."""
        _, _, along, tilt, _ = np.diag(self.elasticity.stiffness)
        radius = float(np.clip(math.sqrt(2.0 * tilt / along), 5e-3, 0.1))
        return Outline("cylinder", (radius, radius, 0.5 * radius), (0.0, 0.0, 0.0), walls=True)

    def directions(self) -> np.ndarray:
        """See `Clearance.directions`: across and along."""
        return np.eye(6)[:3]


@dataclass(frozen=True, kw_only=True)
class CompliantSlider(_Held):
    """A joint that slides without play, and gives way across and in all three rotations.

    Its six coordinates are free, and springs hold all but the displacement along z.

    Raises:
        JointplayError: see `GuideElasticity`.
    """

    kind: ClassVar[str] = "compliant-slider"
    replaces: ClassVar[tuple[str, ...]] = ("prismatic",)
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("z",)
    spring_law: ClassVar[int] = resultant.GUIDE

    elasticity: GuideElasticity
    """How stiff it is."""

    @property
    def outline(self) -> Outline:
        """A block to show, without room; where its sides are, torsion is as stiff as across."""
        across, _, _, _, torsion = np.diag(self.elasticity.stiffness)
        half = float(np.clip(math.sqrt(torsion / across), 5e-3, 0.1))
        return Outline("block", (half, half, 2.0 * half), (0.0, 0.0, 0.0), walls=True)

    def directions(self) -> np.ndarray:
        """See `Clearance.directions`: across."""
        return np.eye(6)[:2]
