"""The base classes of joints with clearance, and what each kind of joint must define.

A kind defines how journal and bearing touch (`SlidingClearance.touch`, `contacts`,
`contact_properties`), the freedoms that it has without clearance (`ideal_freedoms`), and its
`outline`. All else follows from these: where the journal may start, and what URDFs, pictures,
budgets and the assembly of loops need.
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
"""The six coordinates in the order of a twist: velocity, then angular velocity."""
MOTOR = "motor"
"""Name of the coordinate of a geared joint's motor."""
SAMPLES = 72
"""Azimuths at which contact directions are sampled."""
_ROUNDING_M = 1e-12
"""Distance by which a clearance may be outside its limits, as rounding [m]."""
_ON_A_SPHERE = 200
"""Contact directions sampled on a ball."""


class Coordinate(str):
    """Name of a coordinate, ``joint`` or ``joint.part``, which keeps both parts.

    The name of a joint may itself have dots, so the two cannot be told from the text.
    """

    joint: str
    """Joint to which the coordinate belongs."""
    part: str
    """One of `VIRTUAL_LINK`, or `MOTOR`; empty for a joint's only coordinate."""

    def __new__(cls, joint: str, part: str = "") -> Coordinate:
        self = super().__new__(cls, f"{joint}.{part}" if part else joint)
        self.joint, self.part = joint, part
        return self

    def __getnewargs__(self) -> tuple[str, str]:  # type: ignore[override]
        return self.joint, self.part

    @property
    def length(self) -> bool:
        """Whether it is a part measured in metres."""
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
    """Density rho [kg/m^3]; None leaves the speed of impacts unchecked."""
    yield_strength: OptionalQuantity = quantity(
        "Pa", default=None, above=0.0, label="yield strength"
    )
    """Yield strength [Pa]; None leaves the pressure of contacts unchecked."""
    name: str | None = None
    """Name of the material."""

    def __post_init__(self) -> None:
        check_fields(self)
        if not -1.0 < self.poisson <= 0.5:
            raise JointplayError(
                f"Poisson's ratio must lie in (-1, 0.5], got {self.poisson:g}", where=("poisson",)
            )

    @property
    def compliance(self) -> float:
        """Compliance sigma = (1 - nu^2) / (pi E) of eq. 12 [1/Pa]."""
        return (1.0 - self.poisson**2) / (math.pi * self.young)

    @property
    def wave_speed(self) -> float:
        """Speed of longitudinal waves in a rod, sqrt(E/rho) [m/s]; infinite without a density."""
        return math.inf if self.density is None else math.sqrt(self.young / self.density)


PLASTIC = 0.01
"""Restitution used for 0, with which hysteresis factors would be infinite: a body that strikes
rebounds with a hundredth of its speed, loses 99.99 % of its energy, and stays.

Measured on a slider-crank: a smaller one changes no motion, but makes steps and the forces at first
touch, which grow with the factor, absurd (63 kN instead of 23 kN at 0.001).
"""

PAPER_STEEL = Material()
"""Steel of the paper's Table 3."""


@dataclass(frozen=True)
class Outline:
    """Size of a journal and the room around it, along the bearing's axes."""

    form: Literal["cylinder", "ball", "block"]
    size: tuple[float, float, float]
    """Half extents of the journal [m]."""
    room: tuple[float, float, float]
    """Clearance on each side [m]; zero where nothing limits the journal."""
    walls: bool = False
    """Whether a cylinder's bearing has end walls; a block's guide, walls across y."""
    worn: tuple[tuple[float, ...], ...] = ()
    """Depth of wear of a bore at equal azimuths from the x axis, at ends A and B (or one) [m]."""


# Abilities that only some kinds have are properties of `Clearance`, None for the others: code that
# needs one asks for it, and never for a kind of joint by name.


@dataclass(frozen=True)
class Hinge:
    """A journal that turns about the bearing's z, as needed to put a hinge in its place."""

    radius: float
    """Radius of the journal, at which friction about the axis acts [m]."""
    length: float
    """Length of the journal [m]."""
    tilts: bool
    """Whether it can tilt; it then touches at both ends."""
    lateral: float
    """Lateral travel, to either side [m]."""
    axial: float
    """Axial travel, to either side [m]; zero where it is locked or unlimited."""


WEARING_PARTS = "bore", "journal"
"""The parts that wear, in the order of all numbers by part."""


@dataclass(frozen=True)
class Wear:
    """Wear of a bore and its journal, by contact: one for the whole journal, or one at each end.

    The contacts are the first ones of the joint.
    """

    rates: tuple[float, float]
    """Specific wear rates K/H of bore and journal; zero: no wear [m^3/(N m)]."""
    radius: float
    """Radius of the bore [m]."""
    journal_radius: float
    """Radius of the journal [m]."""
    widths: tuple[float, ...]
    """Length that each contact wears [m]."""
    profile: np.ndarray | None
    """Depth worn off the bore so far by contact, at equal azimuths from its x axis, (contacts, n)
    [m]."""


@dataclass(frozen=True, kw_only=True)
class Clearance(Described, ABC):
    """A joint with clearance: one body, the bearing, holds another, the journal, by contact only.

    Raises:
        JointplayError: a value that is missing, not positive, contradictory or impossible.
    """

    selector = ("kind", "kind")

    kind: ClassVar[str]
    """The word that selects the kind of joint."""
    replaces: ClassVar[tuple[str, ...]]
    """Types of URDF joint that this kind can take the place of."""
    ideal_freedoms: ClassVar[tuple[str, ...]]
    """The coordinates of `VIRTUAL_LINK` that are free without clearance."""
    runs_ideal: ClassVar[bool] = True
    """Whether a mechanism that has it without clearance can be simulated."""
    clearance_fields: ClassVar[Mapping[str, str | None]]
    """Fields that are clearances, first the one across x, and for each the field of the journal's
    dimension that can be given instead, None without one."""
    exchanged: bool = False
    """The parent link carries the journal and the child link the bearing (Figure 1b)."""
    ideal: bool = False
    """Without clearance, to compare."""

    if TYPE_CHECKING:  # a field of some kinds, a property of others

        @property
        def normal(self) -> NormalForceLaw:
            """Law of the normal force of each contact."""

        @property
        def friction(self) -> FrictionLaw:
            """Law of friction of each contact."""

    def __post_init__(self) -> None:
        check_fields(self)

    # Each kind must define these.

    @property
    @abstractmethod
    def shape(self) -> int:
        """The way to find gaps: a `geometry.Shape`, or the address of a compiled `touch`."""

    @property
    @abstractmethod
    def dimensions(self) -> tuple[float, ...]:
        """The numbers that `geometry.touch` takes for this shape."""

    @property
    @abstractmethod
    def contacts(self) -> tuple[str, ...]:
        """Names of the places where bearing and journal can touch."""

    @abstractmethod
    def contact_properties(self, contact: int) -> ContactProperties:
        """The properties that a normal-force law takes, of the contact with this index."""

    @property
    @abstractmethod
    def outline(self) -> Outline:
        """Form and size of the journal, and the room around it."""

    # These follow from them; a kind may override them.

    @property
    def freedoms(self) -> tuple[str, ...]:
        """The coordinates of `VIRTUAL_LINK` that are free; the others are locked."""
        return VIRTUAL_LINK

    @property
    def drive_coordinate(self) -> str | None:
        """The coordinate in which a drive moves the ideal joint; None if it has no freedom."""
        if not self.ideal_freedoms:
            return None
        return "yaw" if "yaw" in self.ideal_freedoms else self.ideal_freedoms[0]

    @property
    def clearances(self) -> dict[str, float]:
        """The clearances by the names of their fields [m]."""
        return {name: getattr(self, name) for name in self.clearance_fields}

    @property
    def radial_travel(self) -> float:
        """Radius of the journal centre's clearance circle; across x, for a slider [m]."""
        return next(iter(self.clearances.values()))

    @property
    def search_radius(self) -> float:
        """Length scale of the search for the journal's position of rest, never zero [m]."""
        return self.radial_travel

    @property
    def resultant(self) -> tuple[float, ...] | None:
        """Parameters of `law` for rolling elements or springs; None where surfaces slide."""
        return None

    @property
    def law(self) -> int:
        """The law of `contact.resultant` that takes the parameters `resultant`."""
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
        """The fit that limits the joint's clearance; None for a clearance of known size."""
        return None

    def at_clearance(self, size: float) -> Self:
        """The joint with another clearance that its fit allows [m]; that along the axis stays."""
        return self.with_clearances({next(iter(self.clearance_fields)): size})

    def with_fit(self, fit: Fit) -> Self:
        """The joint with another fit of the same size; clearances keep their ratio."""
        assert self.fitted is not None
        changes: dict[str, Any] = {"fit": str(fit)}
        return replace(self.scaled(fit.middle / self.radial_travel), **changes)

    @property
    def contact_clearances(self) -> tuple[float, ...]:
        """Clearance of each contact [m]."""
        return (self.radial_travel,) * len(self.contacts)

    @property
    def summary(self) -> str:
        """Kind and clearance in words."""
        return f"{self.kind}, {readable(self.radial_travel, 'm')}{self._limits}"

    @property
    def _limits(self) -> str:
        """A fit and its limits in words, to follow its clearance."""
        return "" if self.fitted is None else f" ({self.fitted}: {self.fitted.range})"

    @property
    def play_words(self) -> str:
        """The clearances in words, without their names."""
        return " and ".join(readable(c, "m") for c in sorted(set(self.clearances.values())))

    @property
    def half_width(self) -> float:
        """Half the journal's size across y, or the bearing's radius [m]."""
        return self.outline.size[1]

    @property
    def depth_limit(self) -> float:
        """Penetration at which the journal has broken out of its bearing [m].

        A tenth of the journal's half width: far beyond the validity of any contact law.
        """
        return 0.1 * min(self.outline.size[:2])

    @property
    def start_travels(self) -> dict[str, float]:
        """Largest distance of the journal's centre from the bearing's, by translation [m]."""
        rooms = zip(VIRTUAL_LINK[:3], self.outline.room, strict=True)
        return {part: room for part, room in rooms if part in self.freedoms}

    @property
    def travel(self) -> dict[str, float]:
        """Travel of the freedoms but the drive's in the clearance, to either side [m or rad]."""
        (wide, high, long), (x, y, z) = self.outline.size, self.outline.room
        turns = {"yaw": min(y / wide, x / high), "pitch": x / long, "roll": y / long}
        return {"x": x, "y": y, "z": z} | turns

    def play(self, second_order: bool = True) -> Play:
        """The set of displacements that the clearance allows; see `joints.play`."""
        return play_within(self.outline, self.freedoms, second_order)

    def directions(self) -> np.ndarray:
        """Unit contact forces and their moments about the journal's centre, shape (n, 6).

        A sample of all that are possible, in bearing axes, for a centred journal.
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
        """Distance from a journal's centre, (3,), to the farthest point where it can touch [m]."""
        return float(np.linalg.norm(self.outline.size))

    @property
    def engaged_within(self) -> float:
        """Axial displacement at which a journal has left its bearing [m]; inf if it cannot."""
        return math.inf

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        """Whether a displaced journal certainly touches nothing.

        Args:
            offset: displacement of its centre from where it would be without clearance, (3,) [m].
            lean: displacement of its farthest point by leaning [m].
            least: room that is granted in any case, for rounding [m].
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

        Both are a rotation (3, 3) and a centre (3,) [m] in the bearing frame. A position along the
        axis stays as it is if nothing limits it.
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
        """The point of the guiding curve that is nearest to a journal's centre (3,) [m].

        Axes (3, 3), x along the curve, and position (3,) [m], all in the bearing frame; None where
        no curve guides the journal.
        """
        return None

    @property
    def film(self) -> tuple[FilmLaw, FilmProperties] | None:
        """Film law and the joint's properties for it; None for a dry joint."""
        return None

    @property
    def hinge(self) -> Hinge | None:
        """The hinge that can stand for this joint; None: none can."""
        return None

    @property
    def wear(self) -> Wear | None:
        """Wear of the joint; None: it is not computed."""
        return None

    def with_worn(self, profile: np.ndarray) -> Self:
        """The joint with a bore worn to this `Wear.profile`, of a kind that can wear."""
        raise JointplayError(f"the bearing of a {self.kind} joint cannot be worn")

    def with_friction(self, law: FrictionLaw) -> Self:
        """The joint with another law of friction; unchanged if its kind has none."""
        return self

    # These hold for all kinds.

    def with_clearances(self, sizes: Mapping[str, float]) -> Self:
        """The joint with other clearances [m], by their fields' names, in the same bearing."""
        instead = (self.clearance_fields[name] for name in sizes)
        changes: dict[str, Any] = {**sizes, **dict.fromkeys(name for name in instead if name)}
        if self.fitted is not None:
            changes["fit"] = None
        return replace(self, **changes)

    def scaled(self, factor: float) -> Self:
        """The joint with all its clearances multiplied by a factor, in the same bearing."""
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
    """A joint whose whole wrench comes from one law: of rolling elements, springs, or both.

    A kind must also define `resultant` and `law`.
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
        """No friction law: the whole law includes its own losses."""
        return resultant.NoFriction()


@dataclass(frozen=True, kw_only=True)
class SlidingClearance(Clearance):
    """A joint whose surfaces hit and slide on each other: a plain bearing, a socket or a guide.

    It is `ideal` if the first of its `clearance_fields` is 0.

    Raises:
        JointplayError: a value that is missing, not positive, contradictory or impossible.
    """

    touch: ClassVar[Callable[..., Any]]
    """Gap, position and normal of contact k, as `geometry.touch` returns them; it is compiled.

    ``touch(k, pose, ...)`` takes the index of the contact, the pose of the journal
    (`geometry.contacts`), and then dimensions of the joint by the names of its attributes.
    """
    fit_size: ClassVar[tuple[str, float] | None] = None
    """Field of the dimension to which a fit belongs, and its ratio to the fit's nominal size; None:
    ISO 286 has no fits of such a joint."""

    fit: str | None = None
    """Nominal size in mm and classes of hole and shaft by ISO 286-1, such as ``"20H7/g6"``, instead
    of the clearance, which is then the middle of the fit's range unless another within it is given.
    The dimension need not be given; its default counts as not given.
    """

    bearing_material: Material = PAPER_STEEL
    journal_material: Material = PAPER_STEEL
    restitution: Quantity = quantity("", default=0.9)
    """Nominal coefficient of restitution c_e, in [0, 1]; 0, a plastic impact, needs a law that has
    one: `zhang-sharf`, `gonthier`, `flores`, `hu-guo` or `gharib-hurmuzlu`."""
    normal: NormalForceLaw = field(default_factory=LankaraniNikravesh)
    friction: FrictionLaw = field(default_factory=Ambrosio)
    stiffness: OptionalQuantity = quantity("N/m^1.5", default=None, above=0.0)
    """Hertz stiffness [N/m^1.5]; if not given, from geometry and materials. A linear law that has
    its own stiffness does not use it.
    """
    seat: Elasticity | None = None
    """Elasticity of the bearing's seat in the part that carries it, in series with its play; None:
    rigid.

    Where surfaces slide, the bush is then a body of its own between the two, held by a
    `CompliantMount`. An ideal joint is rigid. Seats of rolling bearings have no `torsion`.
    """
    seat_mass: OptionalQuantity = quantity("kg", default=None, above=0.0, label="mass of the bush")
    """Mass of the bush in its seat [kg]; None: that of a steel one as long as the bearing, its wall
    half as thick as its bore's half width (`compliance.parts_of_seat`).
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
        """Refuse a restitution of 0 for a law whose impacts rebound all the same."""
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
        """Set size and clearance from the fit; refuse given ones that contradict it."""
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
        """Sum of both bodies' compliances, sigma_i + sigma_j of eq. 11 [1/Pa]."""
        return self.bearing_material.compliance + self.journal_material.compliance

    def hertz(self, radius: float) -> float:
        """The given `stiffness`, or Hertz's (eq. 11) for an effective radius [m], in N/m^1.5."""
        if self.stiffness is not None:
            return self.stiffness
        return 4.0 / (3.0 * math.pi * self.combined_compliance) * math.sqrt(radius)

    def contact(self, stiffness: float, **geometry: float) -> ContactProperties:
        """Properties of a contact of the joint's materials with this Hertz stiffness [N/m^1.5]."""
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
        """Raise if the normal-force law is for line contacts, which this joint does not have."""
        if self.normal.line:
            raise JointplayError(
                f"law {self.normal.name!r} is for a cylinder in a bore, which a {self.kind} joint "
                "does not have; choose one for point contacts, such as 'lankarani-nikravesh'",
                where=("normal",),
            )


def complete(
    play: float | None, outer: float, inner: float | None, factor: float, names: tuple[str, str]
) -> tuple[float, float]:
    """Derive the clearance from the dimensions, or the journal's dimension from the clearance.

    They are related by outer - inner = factor play.

    Args:
        play: clearance [m], or None.
        outer: dimension of the bearing [m].
        inner: dimension of the journal [m], or None.
        factor: number of clearances between outer and inner.
        names: names of the clearance and of the dimension, for errors.

    Returns:
        The clearance and the journal's dimension [m].

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
    """Bearing radius R_i [m]; 10 mm is usual in the literature on clearance."""
    radial_clearance: Quantity = quantity("m", default=None, label="radial clearance")
    """Radial (not diametral) clearance C_r [m]; 0: an ideal joint. Give C_r or R_j."""
    journal_radius: Quantity = quantity("m", default=None, label="journal radius")
    """Journal radius R_j [m]."""

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
        """Hertz stiffness k of eqs 11-13, or the given `stiffness` [N/m^1.5]."""
        return self.hertz(self.ri * self.rj / self.cr)

    def contact_properties(self, contact: int) -> ContactProperties:
        return self.round_contact()

    def round_contact(self, stiffness: float | None = None, **lengths: float) -> ContactProperties:
        """Properties of the journal's contact with its bearing, by default with the joint's k."""
        return self.contact(
            stiffness or self.hertz_stiffness,
            bearing_radius=self.ri,
            journal_radius=self.rj,
            clearance=self.cr,
            **lengths,
        )
