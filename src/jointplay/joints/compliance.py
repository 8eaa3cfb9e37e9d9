"""Joints that give way: springs in the directions in which a joint holds its two bodies.

`Elasticity` says how stiff; `CompliantJoint` is a joint without play that gives way like this, and
a rolling bearing can have it as its `seat`, in series with its balls or rollers.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from jointplay.contact import resultant
from jointplay.contact.law import ContactProperties, FrictionLaw, NormalForceLaw
from jointplay.core.errors import JointplayError, require_numbers
from jointplay.core.schema import Described, check_fields, quantity
from jointplay.geometry import Shape
from jointplay.joints.base import Clearance, Outline
from jointplay.joints.element_play import NO_PLAY
from jointplay.joints.play import Play

Curve = Sequence[Sequence[float]]
"""Points (displacement, force) beyond zero."""


@dataclass(frozen=True, kw_only=True)
class Elasticity(Described):
    """Stiffness and damping of what holds a joint, in the joint's own axes, z the axis.

    Give numbers, a matrix, or a curve for a direction, which is added to them. About the axis a
    joint is free: what gives way there is its gear or its drive.

    Raises:
        JointplayError: a stiffness that is not positive, a matrix that is not symmetric and
            positive definite, or a curve that does not rise.
    """

    radial: float | None = quantity("N/m", default=None, above=0.0, words="radial stiffness")
    """Across the axis, in x and y alike [N/m]."""
    axial: float | None = quantity("N/m", default=None, above=0.0, words="axial stiffness")
    """Along the axis [N/m]."""
    tilt: float | None = quantity("N*m/rad", default=None, above=0.0, words="tilt stiffness")
    """About x and y alike [N m/rad]."""
    matrix: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Instead of the three: of displacements along x, y, z and rotations about x, y, (5, 5)."""
    radial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]), added in x and in y; at most 12."""
    axial_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (displacement [m], force [N]) along the axis."""
    tilt_curve: Sequence[Sequence[float]] | None = quantity("", default=None)
    """Points (angle [rad], moment [N m]) about x and about y."""
    damping_time: float = quantity("s", default=1e-5, least=0.0, words="damping time")
    """Damping over stiffness [s]: a swing of angular frequency w decays by w damping_time / 2."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_fields(self)
        for name in ("radial_curve", "axial_curve", "tilt_curve"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _checked_curve(name, getattr(self, name)))
        if self.matrix is not None:
            given = require_numbers("the stiffness matrix", self.matrix)
            if given.shape not in ((resultant.WAYS,) * 2, (6, 6)) or not np.isfinite(given).all():
                raise JointplayError(
                    f"the stiffness matrix must be finite and (5, 5), got {given.shape}",
                    where=("matrix",),
                )
            if given.shape == (6, 6) and (np.abs(given[5]).max() or np.abs(given[:, 5]).max()):
                raise JointplayError(
                    "about its axis a joint is free: the last row and column of a stiffness matrix "
                    "must be zero (torsion is the gear's: gears.NAME.stiffness)",
                    where=("matrix",),
                )
            given = given[: resultant.WAYS, : resultant.WAYS]
            if np.abs(given - given.T).max() > 1e-9 * np.abs(given).max():
                raise JointplayError("the stiffness matrix must be symmetric", where=("matrix",))
            if {self.radial, self.axial, self.tilt} != {None}:
                raise JointplayError(
                    "give the stiffness matrix or radial, axial and tilt stiffness, not both",
                    where=("matrix",),
                )
            object.__setattr__(self, "matrix", tuple(map(tuple, given.tolist())))
        size = self.stiffness
        lever = np.array([1.0, 1.0, 1.0, 30.0, 30.0])
        sizes = np.linalg.eigvalsh(size * np.outer(lever, lever))
        if sizes.min() <= 1e-12 * sizes.max():
            raise JointplayError(
                "a joint must be held in every direction but about its axis: give radial, axial "
                "and tilt stiffness (or a curve for each), or a positive definite matrix"
            )

    @cached_property
    def stiffness(self) -> np.ndarray:
        """At small displacements along x, y, z and rotations about x, y, shape (5, 5)."""
        if self.matrix is not None:
            whole = np.array(self.matrix)
        else:
            given = self.radial, self.radial, self.axial, self.tilt, self.tilt
            whole = np.diag([one or 0.0 for one in given])
        for k, curve in enumerate(self._curves):
            if curve:
                whole[k, k] += curve[0][1] / curve[0][0]
        return whole

    @property
    def _curves(self) -> tuple[Sequence[tuple[float, float]], ...]:
        """By direction: along x, y, z, about x, y."""
        across, along, tilt = (
            [(one[0], one[1]) for one in curve or ()]
            for curve in (self.radial_curve, self.axial_curve, self.tilt_curve)
        )
        return across, across, along, tilt, tilt

    @cached_property
    def numbers(self) -> tuple[float, ...]:
        """By which compiled code knows them; rotations there are the axis's parts across."""
        turn = np.zeros((resultant.WAYS, resultant.WAYS))
        turn[:3, :3] = np.eye(3)
        turn[3, 4], turn[4, 3] = -1.0, 1.0  # about x: -a_y, about y: a_x
        linear = self.stiffness.copy()
        for k, curve in enumerate(self._curves):
            if curve:
                linear[k, k] -= curve[0][1] / curve[0][0]
        across, _, along, tilt, _ = self._curves
        return resultant.spring_numbers(turn.T @ linear @ turn, (across, across, along, tilt, tilt))

    @property
    def words(self) -> str:
        """Stiffness, for a line of text."""
        x, _, z, tilt, _ = np.diag(self.stiffness)
        return f"{1e-6 * x:.3g} N/um across, {1e-6 * z:.3g} N/um along, {tilt:.3g} N m/rad in tilt"


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
class CompliantJoint(Clearance):
    """A joint that turns without play, and gives way across, along and in tilt.

    Its six coordinates are free, and springs hold all but the turn about the axis.

    Raises:
        JointplayError: see `Elasticity`.
    """

    kind: ClassVar[str] = "compliant"
    replaces: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("yaw",)
    clearance_fields: ClassVar[Mapping[str, str | None]] = {}

    elasticity: Elasticity
    """How stiff it is."""

    @property
    def springs(self) -> Elasticity:
        """Those of `elasticity`."""
        return self.elasticity

    @property
    def contacts(self) -> tuple[str, ...]:
        """One, which always holds."""
        return ("springs",)

    @property
    def shape(self) -> Shape:
        """No surfaces: a law of its own."""
        return Shape.ROLLING

    @property
    def dimensions(self) -> tuple[float, ...]:
        """The numbers of the law."""
        return self.resultant

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
        return resultant.SPRINGS

    @property
    def normal(self) -> NormalForceLaw:
        """A linear spring across."""
        return resultant.ElementContact(1.0)

    @property
    def friction(self) -> FrictionLaw:
        """None."""
        return resultant.NoFriction()

    def contact_properties(self, contact: int) -> ContactProperties:
        """The stiffest direction."""
        return ContactProperties(float(np.diag(self.elasticity.stiffness)[:3].max()), 1.0)

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
        return 1.0 / float(np.diag(self.elasticity.stiffness)[:3].max())

    @property
    def outline(self) -> Outline:
        """A disc to show, without room; its radius is that at which tilt is as stiff as axial."""
        _, _, along, tilt, _ = np.diag(self.elasticity.stiffness)
        radius = float(np.clip(math.sqrt(2.0 * tilt / along), 5e-3, 0.1))
        return Outline("cylinder", (radius, radius, 0.5 * radius), (0.0, 0.0, 0.0), walls=True)

    @property
    def depth_limit(self) -> float:
        """A tenth of a metre: far beyond what a joint gives way."""
        return 0.1

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        """Anywhere: nothing hits."""
        return True

    def directions(self) -> np.ndarray:
        """See `Clearance.directions`: across and along."""
        return np.eye(6)[:3]

    def play(self, second_order: bool = True) -> Play:
        """Nothing is free."""
        return NO_PLAY

    def scaled(self, factor: float) -> CompliantJoint:
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
