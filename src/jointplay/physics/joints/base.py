"""What a joint with clearance is, and what a kind of joint must say.

A kind says what it is: how journal and bearing touch (`Clearance.touch`, `contacts`,
`contact_properties`), what it leaves free without clearance (`ideal_freedoms`), and its `outline`.
Where the journal may start, what URDFs, pictures, budgets and the assembly of loops need follows
from these.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Self

import numpy as np

from jointplay.base.errors import (
    JointplayError,
    require_a,
    require_non_negative,
    require_positive,
    within,
)
from jointplay.base.schema import Described, OptionalQuantity, Quantity, check_fields, quantity
from jointplay.base.units import readable
from jointplay.physics.contact import (
    Ambrosio,
    ContactProperties,
    FilmLaw,
    FilmProperties,
    FrictionLaw,
    LankaraniNikravesh,
    NormalForceLaw,
    resultant,
)
from jointplay.physics.contact.machine_code import compiled_touch, parameter_names
from jointplay.physics.geometry import Shape
from jointplay.physics.joints.elasticity import Elasticity
from jointplay.physics.joints.fits import Fit
from jointplay.physics.joints.play import Play, play_within

VIRTUAL_LINK = ("x", "y", "z", "yaw", "pitch", "roll")
"""The six coordinates of a clearance joint, in their order in q."""
RELATIVE = ("x", "y", "z", "roll", "pitch", "yaw")
"""The same in the order of a twist: velocity, then angular velocity."""
MOTOR = "motor"
"""What the coordinate of a geared joint's motor is called."""
SAMPLES = 72
"""Azimuths at which contact directions are sampled."""
_ROUNDING_M = 1e-12
"""By which a clearance may be beyond its limits."""
_ON_A_SPHERE = 200
"""Directions at which those of a ball are sampled."""


class Coordinate(str):
    """Name of a coordinate, ``joint`` or ``joint.part``: it knows its parts.

    The name of a joint may have dots of its own, so that nobody can tell the two from the text.
    """

    joint: str
    """Whose it is."""
    part: str
    """One of `VIRTUAL_LINK`, or `MOTOR`; empty for a joint's only one."""

    def __new__(cls, joint: str, part: str = "") -> Coordinate:
        self = super().__new__(cls, f"{joint}.{part}" if part else joint)
        self.joint, self.part = joint, part
        return self

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return self.joint, self.part

    @property
    def length(self) -> bool:
        """Whether it is a part that is measured in metres."""
        return self.part in VIRTUAL_LINK[:3]


@dataclass(frozen=True)
class Material(Described):
    """Elastic constants of a body in contact; `materials.material` has those of common ones.

    The default is the paper's steel (Table 3).

    Raises:
        JointplayError: a constant that is not positive, or Poisson's ratio outside (-1, 0.5].
    """

    young: Quantity = quantity("Pa", default=207e9, above=0.0, label="Young's modulus")
    """Young's modulus E [Pa]."""
    poisson: Quantity = quantity("", default=0.3, label="Poisson's ratio")
    """Poisson's ratio nu."""
    density: OptionalQuantity = quantity("kg/m^3", default=None, above=0.0)
    """rho [kg/m^3]; None leaves the speed of impacts unchecked."""
    yield_strength: OptionalQuantity = quantity(
        "Pa", default=None, above=0.0, label="yield strength"
    )
    """Yield strength [Pa]; None leaves the pressure of contacts unchecked."""
    name: str | None = None
    """What the material is called."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not -1.0 < self.poisson <= 0.5:
            raise JointplayError(
                f"Poisson's ratio must lie in (-1, 0.5], got {self.poisson:g}", where=("poisson",)
            )

    @property
    def compliance(self) -> float:
        """sigma = (1 - nu^2) / (pi E) of eq. 12 [1/Pa]."""
        return (1.0 - self.poisson**2) / (math.pi * self.young)

    @property
    def wave_speed(self) -> float:
        """Speed of longitudinal waves in a rod, sqrt(E/rho) [m/s]; infinite without a density."""
        return math.inf if self.density is None else math.sqrt(self.young / self.density)


PLASTIC = 0.01
"""Restitution that stands for 0, with which hysteresis factors would be infinite: what strikes
springs back with a hundredth of its speed, loses 99.99 % of its energy, and stays.

Measured on a slider-crank: less changes no motion, and makes forces at first touch, which grow as
the factor does, and steps absurd (63 kN instead of 23 kN at 0.001).
"""

PAPER_STEEL = Material()
"""Of the paper's Table 3."""


@dataclass(frozen=True)
class Outline:
    """A journal with room around it, all along the bearing's axes."""

    form: Literal["cylinder", "ball", "block"]
    size: tuple[float, float, float]
    """Half extents of the journal [m]."""
    room: tuple[float, float, float]
    """Clearance on each side [m]; zero where nothing limits the journal."""
    walls: bool = False
    """Whether a cylinder's bearing has end walls; a block's guide, walls across y."""
    worn: tuple[tuple[float, ...], ...] = ()
    """Depth of wear of a bore at equal azimuths from the x axis, at ends A and B (or one) [m]."""


# What only some kinds can do is a property of `Clearance`, None for the others: whoever needs it
# asks for it, and for no kind of joint by name.


@dataclass(frozen=True)
class Hinge:
    """A journal that turns about the bearing's z, as whoever puts a hinge in its place needs it."""

    radius: float
    """Of the journal, at which friction about the axis acts [m]."""
    length: float
    """Of the journal [m]."""
    tilts: bool
    """Whether it can tilt; it then touches at both ends."""
    lateral: float
    """How far it can be aside, either way [m]."""
    axial: float
    """How far it can go along the axis, either way [m]; zero where it cannot or nothing ends it."""


WEARING_PARTS = "bore", "journal"
"""In this order wherever wear is by part."""


@dataclass(frozen=True)
class Wear:
    """How a bore and its journal wear, by contact from the first on: one for the whole journal, or
    one an end."""

    rates: tuple[float, float]
    """Specific wear rates K/H of bore and journal; zero: it does not wear [m^3/(N m)]."""
    radius: float
    """Of the bore [m]."""
    journal_radius: float
    """[m]."""
    widths: tuple[float, ...]
    """Length that each contact wears [m]."""
    profile: np.ndarray | None
    """Depth of the bore so far by contact, at equal azimuths from its x axis, (contacts, n) [m]."""


@dataclass(frozen=True, kw_only=True)
class Clearance(Described, ABC):
    """A joint with clearance: one body, the bearing, holds another, the journal, by contact only.

    Raises:
        JointplayError: a value that is missing, not positive, contradictory or impossible.
    """

    selector = ("kind", "kind")

    kind: ClassVar[str]
    """The one word that selects the kind of joint."""
    replaces: ClassVar[tuple[str, ...]]
    """Types of URDF joint that this kind can take the place of."""
    ideal_freedoms: ClassVar[tuple[str, ...]]
    """Those of `VIRTUAL_LINK` that the joint has without clearance."""
    runs_ideal: ClassVar[bool] = True
    """Whether a mechanism that has it without clearance can be simulated."""
    clearance_fields: ClassVar[Mapping[str, str | None]]
    """Fields that are clearances, first that across x; what the journal measures instead of each.

    None where no dimension of the journal can be given instead.
    """
    exchanged: bool = False
    """The parent link carries the journal and the child link the bearing (Figure 1b)."""
    ideal: bool = False
    """Without clearance, to compare."""

    if TYPE_CHECKING:  # a field of one kind, derived by another

        @property
        def normal(self) -> NormalForceLaw:
            """Law of the normal force of each contact."""

        @property
        def friction(self) -> FrictionLaw:
            """Law of friction of each contact."""

    def __post_init__(self) -> None:
        check_fields(self)

    # What a kind must say.

    @property
    @abstractmethod
    def shape(self) -> int:
        """How the gaps are found: a `geometry.Shape`, or the address of a compiled `touch`."""

    @property
    @abstractmethod
    def dimensions(self) -> tuple[float, ...]:
        """The numbers that `geometry.touch` needs for this shape."""

    @property
    @abstractmethod
    def contacts(self) -> tuple[str, ...]:
        """Names of the places where bearing and journal can touch."""

    @abstractmethod
    def contact_properties(self, contact: int) -> ContactProperties:
        """What a normal-force law needs to know of the contact with this index."""

    @property
    @abstractmethod
    def outline(self) -> Outline:
        """Form and size of the journal, and the room around it."""

    # What follows from it, and can be said otherwise.

    @property
    def freedoms(self) -> tuple[str, ...]:
        """Those of `VIRTUAL_LINK` that are free; the others are locked."""
        return VIRTUAL_LINK

    @property
    def drive_coordinate(self) -> str | None:
        """That of `freedoms` which is the ideal joint's own; None if that has none."""
        if not self.ideal_freedoms:
            return None
        return "yaw" if "yaw" in self.ideal_freedoms else self.ideal_freedoms[0]

    @property
    def clearances(self) -> dict[str, float]:
        """Its clearances by the names of their fields [m]."""
        return {name: getattr(self, name) for name in self.clearance_fields}

    @property
    def radial_travel(self) -> float:
        """Radius of the journal centre's clearance circle; across x, for a slider [m]."""
        return next(iter(self.clearances.values()))

    @property
    def search_radius(self) -> float:
        """A length on which the journal's place of rest is searched, never zero [m]."""
        return self.radial_travel

    @property
    def resultant(self) -> tuple[float, ...] | None:
        """Numbers of its rolling elements or springs; None where surfaces slide (`law`)."""
        return None

    @property
    def law(self) -> int:
        """Which law of `contact.resultant` goes by the numbers of `resultant`."""
        return resultant.ELEMENTS

    @property
    def springs(self) -> Any:
        """`elasticity.Elasticity` of a joint that springs alone hold; None for the others."""
        return None

    @property
    def has_play(self) -> bool:
        """Whether the journal is free somewhere, and not held by springs or preload."""
        return self.springs is None

    @property
    def fitted(self) -> Fit | None:
        """The fit that gives the joint's clearance its limits; None for one of a known size."""
        return None

    def at_clearance(self, size: float) -> Self:
        """The joint with another clearance of those that its fit allows [m]; that along stays."""
        return self.with_clearances({next(iter(self.clearance_fields)): size})

    def with_fit(self, fit: Fit) -> Self:
        """The joint with another fit of the same size; clearances keep their ratio."""
        assert self.fitted is not None
        changes: dict[str, Any] = {"fit": str(fit)}
        return replace(self.scaled(fit.middle / self.radial_travel), **changes)

    @property
    def contact_clearances(self) -> tuple[float, ...]:
        """Clearance that belongs to each contact [m]."""
        return (self.radial_travel,) * len(self.contacts)

    @property
    def summary(self) -> str:
        """Kind and clearance, for a line of text."""
        return f"{self.kind}, {readable(self.radial_travel, 'm')}{self._limits}"

    @property
    def _limits(self) -> str:
        """A fit and its limits, to add to its clearance in a line of text."""
        return "" if self.fitted is None else f" ({self.fitted}: {self.fitted.range})"

    @property
    def play_words(self) -> str:
        """Its clearances without names, for a line of text."""
        return " and ".join(readable(c, "m") for c in sorted(set(self.clearances.values())))

    @property
    def half_width(self) -> float:
        """Half of what the journal measures across y, or the bearing's radius [m]."""
        return self.outline.size[1]

    @property
    def depth_limit(self) -> float:
        """Penetration at which the journal has broken out of its bearing [m].

        A tenth of the journal's half width: far beyond what any contact law means.
        """
        return 0.1 * min(self.outline.size[:2])

    @property
    def start_travels(self) -> dict[str, float]:
        """How far the journal's centre can be from the bearing's, by translation [m]."""
        rooms = zip(VIRTUAL_LINK[:3], self.outline.room, strict=True)
        return {part: room for part, room in rooms if part in self.freedoms}

    @property
    def travel(self) -> dict[str, float]:
        """How far the freedoms but the drive's go within the clearance, either way [m or rad]."""
        (wide, high, long), (x, y, z) = self.outline.size, self.outline.room
        turns = {"yaw": min(y / wide, x / high), "pitch": x / long, "roll": y / long}
        return {"x": x, "y": y, "z": z} | turns

    def play(self, second_order: bool = True) -> Play:
        """The set of displacements that the clearance allows; see `joints.play`."""
        return play_within(self.outline, self.freedoms, second_order)

    def directions(self) -> np.ndarray:
        """Unit contact forces and their moments about the journal's centre, shape (n, 6).

        In bearing axes, for a centred journal; a sample of all that is possible.
        """
        outline, zero = self.outline, np.zeros(SAMPLES)
        if outline.form == "ball":
            # The force passes through the centre; friction does not, but it starts no impact.
            i = np.arange(_ON_A_SPHERE)
            z = 1.0 - (2.0 * i + 1.0) / _ON_A_SPHERE  # evenly: a Fibonacci lattice
            r, phi = np.sqrt(1.0 - z * z), i * np.pi * (3.0 - np.sqrt(5.0))
            moments = np.zeros((_ON_A_SPHERE, 3))
            return np.column_stack([r * np.cos(phi), r * np.sin(phi), z, moments])
        tilts = "pitch" in self.freedoms
        phi = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
        c, s = np.cos(phi), np.sin(phi)
        heights = (outline.size[2], -outline.size[2]) if tilts else (0.0,)
        parts = [np.column_stack([c, s, zero, -h * s, h * c, zero]) for h in heights]
        if outline.walls:
            arm = outline.size[0] if tilts else 0.0
            parts.append(np.column_stack([zero, zero, zero + 1.0, arm * s, -arm * c, zero]))
        return np.concatenate(parts)

    def arm(self, centre: np.ndarray) -> float:
        """Farthest point at which a journal with its centre here can touch, from it [m]."""
        return float(np.linalg.norm(self.outline.size))

    @property
    def engaged_within(self) -> float:
        """How far along its axis a journal may be with any of it in its bearing [m]; else inf."""
        return math.inf

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        """Whether a journal so displaced touches nothing, to be on the safe side.

        Its centre by `offset` (3,) [m] from where it would be without clearance, its farthest point
        by `lean` [m]; `least` room is granted in any case, for rounding [m].
        """
        form = self.outline.form
        if form == "ball":
            return bool(np.linalg.norm(offset) <= self.radial_travel)
        x, y, z = np.abs(offset)
        wide, high, along = (max(self.start_travels.get(part, 0.0), least) for part in "xyz")
        if form == "block":
            return bool(x + lean <= wide and y + lean <= high)
        return bool(np.hypot(x, y) + lean <= wide and (self.slides() or z + lean <= along))

    def ideal_part(self, rotation: np.ndarray, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The pose nearest to a given one that the journal could have without clearance.

        Rotation (3, 3) and centre (3,) [m] in the bearing frame, both ways. Along the axis, what
        nothing limits stays as it is; planar play has nothing there.
        """
        outline = self.outline
        open_along = outline.form == "cylinder" and not outline.walls
        stays = self.slides() or (open_along and VIRTUAL_LINK[2] in self.freedoms)
        place = np.array([0.0, 0.0, centre[2] if stays else 0.0])
        if not self.holds_axis():
            return rotation, place
        if "yaw" not in self.ideal_freedoms:
            return np.eye(3), place
        import pinocchio as pin  # not needed to check a scenario

        swing = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), rotation[:, 2])
        return swing.toRotationMatrix().T @ rotation, place

    def guided_at(self, centre: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
        """Axes (3, 3) and place (3,) [m] in the bearing frame at which the journal is closest to
        what it would do without clearance, x along the curve that guides it; None: no curve does.

        centre: of the journal in the bearing frame, (3,) [m].
        """
        return None

    @property
    def film(self) -> tuple[FilmLaw, FilmProperties] | None:
        """Film law and what it needs to know of the joint; None for a dry one."""
        return None

    @property
    def hinge(self) -> Hinge | None:
        """What a hinge in this joint's place is to know of it; None: no hinge can stand for it."""
        return None

    @property
    def wear(self) -> Wear | None:
        """How it wears; None: wear is not computed."""
        return None

    def with_worn(self, profile: np.ndarray) -> Self:
        """The joint with a bore worn so, of a kind that can wear; see `Wear`."""
        raise JointplayError(f"the bearing of a {self.kind} joint cannot be worn")

    def with_friction(self, law: FrictionLaw) -> Self:
        """The joint with another law of friction, of a kind that has one; else as it is."""
        return self

    # What holds for all kinds.

    def with_clearances(self, sizes: Mapping[str, float]) -> Self:
        """The joint with other clearances [m], by their fields' names, in the same bearing."""
        instead = (self.clearance_fields[name] for name in sizes)
        changes: dict[str, Any] = {**sizes, **dict.fromkeys(name for name in instead if name)}
        if self.fitted is not None:
            changes["fit"] = None
        return replace(self, **changes)

    def scaled(self, factor: float) -> Self:
        """The joint with all its clearances multiplied, in the same bearing."""
        factor = require_non_negative("factor", factor, "")
        return self.with_clearances({name: factor * c for name, c in self.clearances.items()})

    @classmethod
    def held(cls) -> list[int]:
        """Rows of a twist (`RELATIVE`) that are zero without clearance."""
        return [row for row, part in enumerate(RELATIVE) if part not in cls.ideal_freedoms]

    @classmethod
    def compound(cls) -> bool:
        """Whether the joint has several coordinates without clearance."""
        return len(cls.ideal_freedoms) > 1

    @classmethod
    def slides(cls) -> bool:
        """Whether the journal slides along the axis without clearance."""
        return "z" in cls.ideal_freedoms

    @classmethod
    def holds_axis(cls) -> bool:
        """Whether the axes are parallel without clearance."""
        return not {"pitch", "roll"} & set(cls.ideal_freedoms)


@dataclass(frozen=True, kw_only=True)
class WholeLawJoint(Clearance):
    """A joint for which one law answers as a whole: rolling elements, springs, or both.

    A kind must say, besides, `resultant` and `law`.
    """

    @property
    def shape(self) -> Shape:
        return Shape.ROLLING

    @property
    def dimensions(self) -> tuple[float, ...]:
        assert self.resultant is not None
        return self.resultant

    @property
    def friction(self) -> FrictionLaw:
        """None where anything touches: what the law loses, it says itself."""
        return resultant.NoFriction()


@dataclass(frozen=True, kw_only=True)
class SlidingClearance(Clearance):
    """A joint whose surfaces hit and slide on each other: a plain bearing, a socket or a guide.

    One with a clearance of 0 is `ideal`: the first of `clearance_fields` decides.

    Raises:
        JointplayError: a value that is missing, not positive, contradictory or impossible.
    """

    touch: ClassVar[Callable[..., Any]]
    """Gap, place and normal of contact k as `geometry.touch` returns them; it is compiled.

    ``touch(k, pose, ...)``: index of the contact and pose of the journal (`geometry.contacts`), and
    then dimensions of the joint by the names of its attributes.
    """
    fit_size: ClassVar[tuple[str, float] | None] = None
    """Field of the size that a fit is of, and how large it is of a nominal size of 1; None: ISO 286
    has no fits of such a joint."""

    fit: str | None = None
    """Nominal size in mm and classes of hole and shaft by ISO 286-1, such as ``"20H7/g6"``, instead
    of the clearance: the middle of its range, unless another within it is given. A size that is
    the usual one counts as not given.
    """

    bearing_material: Material = PAPER_STEEL
    journal_material: Material = PAPER_STEEL
    restitution: Quantity = quantity("", default=0.9)
    """Nominal coefficient of restitution c_e, in [0, 1]; 0, a plastic impact, needs a law that has
    one: `zhang-sharf`, `gonthier`, `flores`, `hu-guo` or `gharib-hurmuzlu`."""
    normal: NormalForceLaw = field(default_factory=LankaraniNikravesh)
    friction: FrictionLaw = field(default_factory=Ambrosio)
    stiffness: OptionalQuantity = quantity("N/m^1.5", default=None, above=0.0)
    """Hertz stiffness [N/m^1.5]; None derives it from geometry and materials. A linear law that has
    its own stiffness does not use it.
    """
    seat: Elasticity | None = None
    """How the bearing gives way in what carries it, in series with its play; None: not at all.

    Where surfaces slide, its bush is then a body of its own between the two, held by a
    `CompliantMount`. An ideal joint gives way nowhere. Seats of rolling bearings have no `torsion`.
    """
    seat_mass: OptionalQuantity = quantity("kg", default=None, above=0.0, label="mass of the bush")
    """Of the bush in its seat [kg]; None takes a steel one as long as the bearing, its wall half as
    thick as its bore's half width (`compliance.parts_of_seat`).
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.fit is not None:
            self._take_fit()
        if getattr(self, next(iter(self.clearance_fields))) == 0.0:
            object.__setattr__(self, "ideal", True)
        if self.seat is not None:
            require_a("seat", self.seat, "Elasticity")
            with within("seat"):
                self.seat.require_free(None)
        if self.seat is None and self.seat_mass is not None:
            bush = f"seat_mass {self.seat_mass:g} kg is of a bush in a seat"
            raise JointplayError(f"{bush}: give the seat, too", where=("seat_mass",))
        if not 0.0 <= self.restitution <= 1.0:
            raise JointplayError(
                f"restitution must lie in [0, 1], got {self.restitution:g}", where=("restitution",)
            )
        for name, kind in (("normal", NormalForceLaw), ("friction", FrictionLaw)):
            if not isinstance(getattr(self, name), kind):
                raise JointplayError(
                    f"{name} must be a {kind.__name__} such as jointplay.physics.contact offers, "
                    f"got {getattr(self, name)!r}",
                    where=(name,),
                )
        if self.restitution == 0.0:
            self._require_plastic()

    def _require_plastic(self) -> None:
        """Refuse a restitution of 0 of a law whose impacts spring back all the same."""
        least = self.normal.effective_restitution(PLASTIC)
        if least is None or least > 2.0 * PLASTIC:
            whose = f"law {self.normal.name!r} has no plastic impact"
            rebound = "" if least is None else f" (at 0 it springs back with {least:.2g})"
            raise JointplayError(
                f"restitution 0: {whose}{rebound}; choose normal = 'zhang-sharf', 'gonthier', "
                "'flores', 'hu-guo' or 'gharib-hurmuzlu'",
                where=("restitution",),
            )

    @cached_property
    def fitted(self) -> Fit | None:
        return None if self.fit is None else Fit(self.fit)

    def _take_fit(self) -> None:
        """Size and clearance of the fit, in place; refuse others that contradict it."""
        if self.fit_size is None:
            raise JointplayError(
                f"a {self.kind} joint has no fit: ISO 286 is for round holes and parallel faces; "
                f"give {next(iter(self.clearance_fields))}",
                where=("fit",),
            )
        with within("fit"):
            fit = self.fitted
            assert fit is not None
            fit.require_clearance()
        (name, part), play = self.fit_size, next(iter(self.clearance_fields))
        fitted, size, clearance = part * fit.size, getattr(self, name), getattr(self, play)
        if size not in (type(self).__dataclass_fields__[name].default, fitted):
            conflict = f"{name.replace('_', ' ')} {readable(size, 'm')} contradicts the fit {fit}"
            raise JointplayError(f"{conflict}, which has {readable(fitted, 'm')}", where=(name,))
        if clearance is None:
            clearance = fit.middle
        elif not fit.least - _ROUNDING_M <= clearance <= fit.most + _ROUNDING_M:
            noun = play.replace("_", " ")
            conflict = f"{noun} {readable(clearance, 'm')} contradicts the fit {fit}"
            raise JointplayError(f"{conflict}, which has {fit.range}: give one", where=(play,))
        for field_name, value in (("fit", str(fit)), (name, fitted), (play, clearance)):
            object.__setattr__(self, field_name, value)

    @property
    def shape(self) -> int:
        return compiled_touch(type(self).touch)

    @property
    def dimensions(self) -> tuple[float, ...]:
        names = parameter_names(type(self).touch, ("k", "pose")) or ()
        return tuple(getattr(self, name) for name in names)

    def with_friction(self, law: FrictionLaw) -> Self:
        return replace(self, friction=law)

    @property
    def combined_compliance(self) -> float:
        """sigma_i + sigma_j of eq. 11 [1/Pa]."""
        return self.bearing_material.compliance + self.journal_material.compliance

    def hertz(self, radius: float) -> float:
        """The given `stiffness`, or that of eq. 11 for an effective radius R [m], in N/m^1.5."""
        if self.stiffness is not None:
            return self.stiffness
        return 4.0 / (3.0 * math.pi * self.combined_compliance) * math.sqrt(radius)

    def contact(self, stiffness: float, **geometry: float) -> ContactProperties:
        """Properties of a contact of the joint's materials, with Hertz's k of eq. 11 [N/m^1.5]."""
        materials = self.bearing_material, self.journal_material
        strengths = [m.yield_strength for m in materials if m.yield_strength is not None]
        return ContactProperties(
            stiffness,
            self.restitution or PLASTIC,
            modulus=1.0 / (math.pi * self.combined_compliance),
            wave_speed=max(m.wave_speed for m in materials),
            yield_strength=min(strengths, default=math.inf),
            **geometry,
        )

    def refuse_line_contact(self) -> None:
        """Raise if the normal-force law is one for lines, which this joint's contacts are not."""
        if self.normal.line:
            raise JointplayError(
                f"law {self.normal.name!r} is for a cylinder in a bore, which a {self.kind} joint "
                "does not have; choose one for point contacts, such as 'lankarani-nikravesh'",
                where=("normal",),
            )


def complete(
    play: float | None, outer: float, inner: float | None, factor: float, names: tuple[str, str]
) -> tuple[float, float]:
    """Derive clearance from dimensions or dimensions from clearance: outer - inner = factor play.

    Args:
        play: clearance [m], or None.
        outer: dimension of the bearing [m].
        inner: dimension of the journal [m], or None.
        factor: clearances between outer and inner.
        names: of the clearance and of the dimension, for errors.

    Returns:
        play and inner [m].

    Raises:
        JointplayError: neither given, values that contradict each other, a negative clearance, or
            a dimension that is not positive.
    """
    clearance, dimension = names
    at_play, at_inner = (f"{clearance}_clearance",), (f"journal_{dimension}",)
    if play is None and inner is None:
        raise JointplayError(f"give the {clearance} clearance or the journal {dimension}")
    if play is not None:
        require_non_negative(f"{clearance} clearance", play, "m", at_play)
    if inner is not None:
        require_positive(f"journal {dimension}", inner, "m", at_inner)
        if inner >= outer and not (play == 0.0 and inner == outer):
            raise JointplayError(
                f"journal {dimension} {readable(inner, 'm')} does not fit into the bearing's "
                f"{readable(outer, 'm')}",
                where=at_inner,
            )
        left = outer - inner
        if play is not None and not math.isclose(left, factor * play, rel_tol=1e-6, abs_tol=1e-9):
            raise JointplayError(
                f"{clearance} clearance {readable(play, 'm')} contradicts the dimensions: bearing "
                f"{readable(outer, 'm')} and journal {readable(inner, 'm')} give "
                f"{readable(left / factor, 'm')}",
                where=at_play,
            )
        play = left / factor if play is None else play
    assert play is not None
    inner = outer - factor * play if inner is None else inner
    if inner <= 0.0:
        raise JointplayError(
            f"{clearance} clearance {readable(play, 'm')} leaves no room for a journal in a "
            f"bearing of {dimension} {readable(outer, 'm')}",
            where=at_play,
        )
    return float(play), float(inner)


@dataclass(frozen=True, kw_only=True)
class RoundClearance(SlidingClearance):
    """A round journal of radius R_j in a round bearing of radius R_i (eqs 1, 11-13).

    Raises:
        JointplayError: a radius that is missing, not positive, contradictory or impossible.
    """

    clearance_fields: ClassVar[Mapping[str, str | None]] = {"radial_clearance": "journal_radius"}
    fit_size: ClassVar[tuple[str, float] | None] = ("bearing_radius", 0.5)

    bearing_radius: Quantity = quantity("m", default=10e-3, above=0.0, label="bearing radius")
    """R_i [m]; 10 mm is usual in the literature on clearance."""
    radial_clearance: Quantity = quantity("m", default=None, label="radial clearance")
    """C_r, radial, not diametral [m]; 0: an ideal joint. One of it and R_j is given."""
    journal_radius: Quantity = quantity("m", default=None, label="journal radius")
    """R_j [m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        sizes = self.radial_clearance, self.bearing_radius, self.journal_radius
        play, radius = complete(*sizes, 1.0, ("radial", "radius"))
        object.__setattr__(self, "radial_clearance", play)
        object.__setattr__(self, "journal_radius", radius)

    @property
    def ri(self) -> float:
        """R_i [m]."""
        return self.bearing_radius

    @property
    def rj(self) -> float:
        """R_j [m]."""
        return self.journal_radius

    @property
    def cr(self) -> float:
        """C_r [m] (eq. 1)."""
        return self.radial_clearance

    @property
    def half_width(self) -> float:
        return self.ri

    @property
    def hertz_stiffness(self) -> float:
        """k of eqs 11-13, or the given `stiffness` [N/m^1.5]."""
        return self.hertz(self.ri * self.rj / self.cr)

    def contact_properties(self, contact: int) -> ContactProperties:
        return self.round_contact()

    def round_contact(self, stiffness: float | None = None, **lengths: float) -> ContactProperties:
        """Properties of a contact of the journal in its bearing, by default of the joint's k."""
        return self.contact(
            stiffness or self.hertz_stiffness,
            bearing_radius=self.ri,
            journal_radius=self.rj,
            clearance=self.cr,
            **lengths,
        )
