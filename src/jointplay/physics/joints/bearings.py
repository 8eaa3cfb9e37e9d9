"""Rolling bearings as joints: deep-groove and angular contact ball bearings, crossed rollers.

A bearing is given by a catalogue's designation, by boundary dimensions, or by its whole inner
geometry:

    jp.BallBearing(designation="6010/C3")
    jp.BallBearing(designation="7206 B", arrangement="DB", preload=120.0)
    jp.CrossedRollerBearing(designation="RB5013", clearance_class="C0")

Numbers that are not given are estimated from those that are; `estimates` lists them and how they
were found. The law of its elements is in `contact.rolling`, the catalogue and the origins of its
numbers in ``data/bearings.toml``.
"""

from __future__ import annotations

import difflib
import math
import re
from abc import abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache, partial
from typing import Any, ClassVar, NamedTuple, NoReturn

import numpy as np

from jointplay.base.errors import JointplayError, MissingName, require_known, within
from jointplay.base.files import shipped_table
from jointplay.base.schema import OptionalQuantity, Quantity, check_fields, choice, quantity
from jointplay.base.units import readable
from jointplay.physics.contact import resultant
from jointplay.physics.contact.law import ContactProperties, NormalForceLaw
from jointplay.physics.joints.base import SAMPLES, Hinge, Material, Outline, WholeLawJoint
from jointplay.physics.joints.elasticity import ABOUT_AXIS, Elasticity
from jointplay.physics.joints.element_play import ElementPlay
from jointplay.physics.joints.materials import material
from jointplay.physics.joints.play import Play

ARRANGEMENTS = ("single", "DB", "DF", "DT")
"""One row, or a pair: back to back (O), face to face (X), both the same way (tandem)."""
CLASSES = ("C0", "C1", "C2", "C3", "C4", "CN", "CC0")
"""Classes of internal clearance; each kind and size of bearing has some of them."""
AS_GIVEN, PRELOADED = "as given", "preloaded"
"""The choices for angular contact bearings, which have no classes of clearance."""
_SHIELDS = re.compile(r"[- ]?(2?ZZ?|2?RS[HLR12]?|DDU?|LLU)$")
"""Makers' suffixes for shields and seals, which change nothing here."""
BALL_SHARE = 0.2945
"""Ball diameter over the difference of outside diameter and bore: the mean of seven catalogue
bearings (0.291 to 0.298)."""
FILLING = 0.58
"""Part of the pitch circle that balls fill, of the same seven bearings (0.56 to 0.60)."""
ANGULAR_FILLING = 0.85
"""Part of the pitch circle that balls fill in angular contact bearings with machined cages: that of
a 7206 with 13 balls (unverified recollection; no source at hand)."""
STATIC_FACTOR = 15.0
"""f_0 of the static rating C_0 = f_0 Z D^2 [N/mm^2]; of the same seven bearings 13 to 16."""
ROLLER_FILLING, ROLLER_LENGTH, ROLLER_STATIC = 0.75, 0.9, 44.0
"""Crossed rollers: part of the pitch circle filled, length over diameter, factor of ISO 76."""
EXPANSION = 0.012e-3
"""Loss of clearance per temperature difference and mean diameter [1/K] (SKF's text)."""
MEAN_DRAG = 1.7 * 160e-7
"""f_0 of grease times 160e-7: M_0 = f_0 160e-7 d_m^3 [N mm/mm^3], Palmgren's
(unverified recollection; no source at hand)."""
BALL_FRICTION, ROLLER_FRICTION = 0.0015, 0.003
"""Friction torque over load and half of the bore, as in makers' tables (unverified recollection;
no source at hand)."""
STIFFNESS_DAMPING_S = 1e-5
"""Damping over stiffness of a rolling contact [s] (unverified recollection; no source at hand)."""
_element_play = lru_cache(maxsize=64)(ElementPlay)
"""The play of equal bearings, which share one object and its cached results."""


catalogue = partial(shipped_table, __file__, "bearings")
"""The content of ``data/bearings.toml``, by section."""


def parted(designation: str, section: str) -> tuple[str, str | None]:
    """Name of a designation in a section of the catalogue, and its class of clearance, if any."""
    text = designation.upper().replace("/", " ").split()
    classes = [word for word in text if word in CLASSES]
    name = " ".join(word for word in text if word not in (*CLASSES, *ARRANGEMENTS))
    if name not in catalogue()[section]:
        name = _SHIELDS.sub("", name)
    return name, classes[0] if classes else None


SECTIONS = {
    "deep_groove": "deep-groove ball",
    "angular_contact": "angular contact ball",
    "crossed_roller": "crossed roller",
}
"""The catalogue's sections of bearings, and the kind of bearing in words."""

_LOOKS_DESIGNATED = re.compile(
    r"\s*([A-Za-z]{1,4}[ -]?\d{2,}.*|\d{3,}(\s*|\s?[A-Z].*|[-/].*))", re.ASCII
)
"""Letters and digits, or at least three digits, alone or followed by capitals: unlike any length,
whose unit has small letters."""


def _section_of(designation: str) -> str | None:
    """The section of the catalogue that has a designation; None if none does."""
    for section in SECTIONS:
        if parted(designation, section)[0] in catalogue()[section]:
            return section
    return None


def is_catalogued(text: str) -> bool:
    """Whether `text` designates a bearing of the catalogue."""
    return _section_of(text) is not None


def is_designation(text: str) -> bool:
    """Whether `text` designates a bearing, known or not, rather than being a length."""
    return _section_of(text) is not None or _LOOKS_DESIGNATED.fullmatch(text) is not None


def bearing_kind(text: str) -> str | None:
    """Kind of joint of the bearing that `text` designates; None if it designates none.

    Raises:
        JointplayError: it looks like a designation, and the catalogue does not have it.
    """
    section = _section_of(text)
    if section is None:
        if _LOOKS_DESIGNATED.fullmatch(text):
            raise JointplayError(_unknown(text, SECTIONS))
        return None
    return (CrossedRollerBearing if section == "crossed_roller" else BallBearing).kind


def _unknown(designation: str, sections: Iterable[str]) -> str:
    """The message about a designation that these sections do not have, with the nearest ones."""
    names = [name for section in sections for name in catalogue()[section]]
    text = " ".join(designation.upper().split())
    begun = (name for name in names if re.match(rf"{re.escape(name)}(?!\d)", text))
    near = sorted(begun, key=len)[-1:]
    near = near or difflib.get_close_matches(text, names, 3)
    similar = f"did you mean {', '.join(near)}? " if near else ""
    known = "; ".join(
        f"{SECTIONS[section]} bearings "
        f"{', '.join(dict.fromkeys(map(_family, catalogue()[section])))}"
        for section in sections
    )
    return (
        f"unknown bearing {designation!r}; {similar}known: {known}; classes of clearance: "
        f"{', '.join(CLASSES)}; of another bearing give the dimensions (docs/bearings.md)"
    )


def _family(name: str) -> str:
    """Series of a designation: 62xx of 6206, 60x of 608, RB of RB5013."""
    letters, digits = re.match(r"([A-Z]*)(\d*)", name).groups()  # type: ignore[union-attr]
    size = 2 if len(digits) > 3 else 1
    return letters or f"{digits[:-size]}{'x' * size}"


class BearingState(NamedTuple):
    """Forces in a bearing at a displacement of its inner ring; outer ring's axes."""

    wrench: np.ndarray
    """Force on the inner ring and moment about its centre, shape (6,) [N, N m]."""
    energy: float
    """Elastic energy of all elements [J]."""
    loads: np.ndarray
    """Load of each element, row by row, from the cage's azimuth on, shape (rows * Z,) [N]."""
    contact_angles: np.ndarray
    """Contact angle of each element in the same order [rad]; of unloaded balls, that of their play.
    """
    stiffness: np.ndarray
    """Decrease of the wrench per displacement and rotation, shape (6, 6) [N/m, N, N m/rad]."""

    @property
    def loaded(self) -> int:
        """Number of elements that bear load."""
        return int(np.count_nonzero(self.loads > 0.0))

    @property
    def largest(self) -> float:
        """Largest load of an element [N]."""
        return float(self.loads.max())


class BearingRest(NamedTuple):
    """Position of rest of a loaded bearing's inner ring, without friction; outer ring's axes."""

    displacement: np.ndarray
    """Displacement of the centre, and rotation vector, shape (6,) [m, rad]."""
    compliance: np.ndarray | None
    """Derivative of the displacement by force and moment, shape (6, 6) [m/N, rad/N, rad/(N m)],
    zero for the moment about the axis. None: the ring is free, or nearly free, in some direction.
    """


@dataclass(frozen=True, kw_only=True)
class RollingBearing(WholeLawJoint):
    """A ball or crossed roller bearing: what both have in common.

    Raises:
        JointplayError: dimensions that are missing, not positive, contradictory or impossible; an
            unknown designation, with the nearest ones.
        MissingName: an unknown class.
    """

    replaces: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("yaw",)
    clearance_fields: ClassVar[Mapping[str, str | None]] = {"radial_clearance": None}
    section: ClassVar[str]
    """Section of the catalogue."""
    roller_elements: ClassVar[bool]

    designation: str | None = None
    """Designation in a catalogue, its class of clearance after a slash or a space: ``"6010/C3"``,
    ``"RB5013 C0"``."""
    bore: OptionalQuantity = quantity("m", default=None, above=0.0, label="bore")
    """Diameter of the shaft [m]; None takes the designation's."""
    outside_diameter: OptionalQuantity = quantity(
        "m", default=None, above=0.0, label="outside diameter"
    )
    """Outside diameter [m]; None takes the designation's."""
    width: OptionalQuantity = quantity("m", default=None, above=0.0, label="width")
    """Width of one row's rings [m]; None takes the designation's."""
    clearance_class: str | None = None
    """Class of internal clearance, the middle of its range; None takes the designation's, or CN."""
    radial_clearance: OptionalQuantity = quantity("m", default=None, label="radial clearance")
    """C_r as bought, half of the full travel; negative for preload [m]. None: the class's."""
    elements: int | None = quantity("", default=None, above=0.0, label="number of elements")
    """Number Z of elements in each row; None estimates it."""
    element_diameter: OptionalQuantity = quantity("m", default=None, above=0.0, label="diameter")
    """Diameter D of an element [m]; None estimates it."""
    pitch_diameter: OptionalQuantity = quantity(
        "m", default=None, above=0.0, label="pitch diameter"
    )
    """Diameter d_m of the circle of the elements' centres [m]; None takes the mean of bore and
    outside diameter."""
    element_stiffness: OptionalQuantity = quantity("", default=None, above=0.0)
    """Stiffness K of an element between both rings [N/m^n]; None: Hertz's for the geometry."""
    shaft_interference: Quantity = quantity("m", default=0.0, least=0.0)
    """Interference of shaft and bore, in diameter [m]."""
    housing_interference: Quantity = quantity("m", default=0.0, least=0.0)
    """Interference of outer ring and housing, in diameter [m]."""
    temperature_difference: Quantity = quantity("K", default=0.0)
    """Temperature of the inner ring less that of the outer one [K]."""
    dynamic_rating: OptionalQuantity = quantity("N", default=None, above=0.0)
    """C, basic dynamic load rating of one row [N]; None: the catalogue's, or an estimate."""
    static_rating: OptionalQuantity = quantity("N", default=None, above=0.0)
    """C_0, basic static load rating of one row [N]; None: the catalogue's, or an estimate."""
    drag_torque: OptionalQuantity = quantity("N*m", default=None, least=0.0)
    """M_0, friction torque without load [N m]; None estimates it for grease."""
    rolling_friction: OptionalQuantity = quantity("", default=None, least=0.0)
    """Load-dependent friction torque M_1 over half of the bore and the sum of the element loads;
    None: typical of the kind."""
    damping_time: Quantity = quantity("s", default=STIFFNESS_DAMPING_S, least=0.0)
    """Damping over stiffness of the loaded elements [s]."""
    cage_angle: Quantity = quantity("rad", default=0.0)
    """Azimuth of the first element at the start, from the outer ring's x axis [rad]."""
    seat: Elasticity | None = None
    """Elasticity of the outer ring's seat, in series with the bearing; None: rigid."""
    ring_material: Material = field(default_factory=lambda: material("bearing-steel"))
    """Material of rings and elements."""

    # Each kind must define these.

    @property
    @abstractmethod
    def row_places(self) -> tuple[tuple[float, float], ...]:
        """Axial position h and y_0 of each row [m]; see `contact.rolling`."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.seat is not None:
            with within("seat"):
                self.seat.require_free(ABOUT_AXIS)
        if self.designation is not None:
            self._entry  # noqa: B018 - unknown designations are refused
        for name in ("bore", "outside_diameter", "width"):
            if self._dimension(name) is None and (name != "width" or self._needs_width):
                raise JointplayError(
                    f"give the bearing's {name.replace('_', ' ')}, or a designation such as "
                    f"{next(iter(catalogue()[self.section]))!r}",
                    where=(name,),
                )
        sizes = self.d_bore, self.d_outside, self.d_pitch, 0.5 * (self.d_outside - self.d_bore)
        bore, outside, pitch, room = (readable(size, "m") for size in sizes)
        if self.d_outside <= self.d_bore:
            refuse("outside_diameter", f"outside diameter {outside} must exceed the bore {bore}")
        if not self.d_bore < self.d_pitch < self.d_outside:
            limits = f"between the bore {bore} and the outside diameter {outside}"
            refuse("pitch_diameter", f"pitch diameter {pitch} must lie {limits}")
        element = f"elements of {readable(self.d_element, 'm')} do not fit"
        if self.d_element >= sizes[3]:
            refuse("element_diameter", f"{element} between bore and outside diameter, {room} apart")
        if self.count < 3:
            refuse("elements", f"a bearing needs at least 3 elements, got {self.count}")
        if self.count * self.d_element > math.pi * self.d_pitch:
            refuse("elements", f"{self.count} {element} on a pitch circle of {pitch}")
        self.bought_clearance  # noqa: B018 - classes that the bore does not have are refused
        self.row_places  # noqa: B018

    # Dimensions: given, of the catalogue, or estimated.

    _needs_width: ClassVar[bool] = False
    _filling: ClassVar[float]
    """Part of the pitch circle that elements fill."""
    _diameter_source: ClassVar[str]
    """What the diameter of elements is estimated from, in words."""

    @property
    def estimates(self) -> dict[str, str]:
        """The numbers that are estimated, by field: value and method in words."""
        entry, notes = self._entry, {}
        filled = f"{100 * self._filling:g} % of the pitch circle filled"
        if self.element_diameter is None and "ball_diameter" not in entry:
            notes["element_diameter"] = f"{1e3 * self.d_element:.3g} mm: {self._diameter_source}"
        if self.elements is None and "balls" not in entry:
            notes["elements"] = f"{self.count}: {filled}"
        if self.pitch_diameter is None:
            notes["pitch_diameter"] = f"{1e3 * self.d_pitch:.4g} mm: mean of bore and outside"
        if self._by_class:
            low, high = (2e6 * end for end in self.class_range())
            notes["radial_clearance"] = (
                f"{1e6 * self.bought_clearance:.3g} µm: middle of {self.class_name}, "
                f"{low:g} to {high:g} µm full travel"
            )
        if self.drag_torque is None:
            notes["drag_torque"] = f"{1e3 * self.drag:.3g} N mm: grease, low speed"
        for listed, value in zip(("dynamic", "static"), self.ratings(), strict=True):
            if getattr(self, f"{listed}_rating") is None and listed not in entry:
                notes[f"{listed}_rating"] = f"{1e-3 * value:.3g} kN: from the elements"
        return notes

    @property
    def _by_class(self) -> bool:
        """Whether the clearance is that of a class."""
        return self.radial_clearance is None

    @cached_property
    def _parts(self) -> tuple[str, str | None]:
        """Designation without its class, and the class."""
        return parted(self.designation or "", self.section)

    @cached_property
    def _entry(self) -> Mapping[str, Any]:
        """The catalogue's entry for the designation; empty without one."""
        if self.designation is None:
            return {}
        lines, name = catalogue()[self.section], self._parts[0]
        if name not in lines:
            crossed = self.section == "crossed_roller"
            sections = [name for name in SECTIONS if (name == "crossed_roller") == crossed]
            raise JointplayError(_unknown(self.designation, sections), ("designation",))
        entry: Mapping[str, Any] = lines[name]
        return entry

    def _dimension(self, name: str) -> float | None:
        """A boundary dimension: given, or the catalogue's [m]."""
        size: float | None = getattr(self, name)
        if size is not None:
            return size
        listed = self._entry.get({"outside_diameter": "outside"}.get(name, name))
        return None if listed is None else 1e-3 * float(listed)

    @property
    def d_bore(self) -> float:
        """Bore [m]."""
        return self._dimension("bore") or 0.0

    @property
    def d_outside(self) -> float:
        """Outside diameter [m]."""
        return self._dimension("outside_diameter") or 0.0

    @property
    def row_width(self) -> float:
        """Width of the rings of one row [m]."""
        return self._dimension("width") or 0.0

    @property
    def d_pitch(self) -> float:
        """Pitch diameter d_m [m]."""
        return self._dimension("pitch_diameter") or 0.5 * (self.d_bore + self.d_outside)

    alpha: ClassVar[float]
    """Nominal contact angle [rad]."""

    @property
    def _gamma(self) -> float:
        """gamma = D cos(alpha) / d_m, of the standards."""
        return self.d_element * math.cos(self.alpha) / self.d_pitch

    @property
    def d_element(self) -> float:
        """Diameter D of an element: given, or estimated [m]."""
        if self.element_diameter is not None:
            return self.element_diameter
        return self._estimated_diameter

    @property
    @abstractmethod
    def _estimated_diameter(self) -> float:
        """Diameter D by the catalogue, or estimated from other numbers [m]."""

    @property
    @abstractmethod
    def count(self) -> int:
        """Number Z of elements in each row."""

    @cached_property
    def class_name(self) -> str:
        """The class of internal clearance."""
        return (self.clearance_class or self._parts[1] or self._normal_class).upper()

    _normal_class: ClassVar[str]

    def class_range(self) -> tuple[float, float]:
        """Least and largest internal clearance of the class, as radial clearance C_r [m].

        Raises:
            MissingName: the bearing has no such class.
            JointplayError: no class is known of this size.
        """
        size = self._class_size
        rows = catalogue()["clearance"][self.section.replace("angular_contact", "deep_groove")]
        series = self._parts[0][:2].upper() if self._entry else None
        fitting = [
            row
            for row in rows
            if row["over"] < 1e3 * size * (1.0 - 1e-12) <= row["up_to"]
            and (series is None or "series" not in row or series in row["series"])
        ]
        if not fitting:
            raise JointplayError(
                f"no classes of clearance are known for {readable(size, 'm')}: give the radial "
                "clearance",
                where=("radial_clearance",),
            )
        classes = {
            name: span
            for name, span in fitting[0].items()
            if isinstance(span, list) and name[0] == "C"
        }
        require_known("class of clearance", self.class_name, classes, where=("clearance_class",))
        low, high = classes[self.class_name]
        return 0.5e-6 * low, 0.5e-6 * high

    @property
    @abstractmethod
    def _class_size(self) -> float:
        """The diameter by which tables list classes of clearance [m]."""

    @cached_property
    def bought_clearance(self) -> float:
        """Radial clearance C_r before mounting [m]."""
        if self.radial_clearance is not None:
            return self.radial_clearance
        low, high = self.class_range()
        return 0.5 * (low + high)

    @cached_property
    def cr(self) -> float:
        """Radial clearance C_r in operation, reduced by fits and heat; negative for preload [m].

        On a solid shaft of the same steel the inner raceway grows by the interference times bore
        over raceway; in a thick housing the outer one shrinks by the interference times raceway
        over outside diameter (Lamé).
        """
        inner, outer = self.d_pitch - self.d_element, self.d_pitch + self.d_element
        loss = self.shaft_interference * self.d_bore / inner
        loss += self.housing_interference * outer / self.d_outside
        loss += EXPANSION * self.temperature_difference * self.d_pitch
        return self.bought_clearance - 0.5 * loss

    def of_classes(self) -> dict[str, RollingBearing]:
        """The bearing in each class of clearance that exists for its size, by class."""
        bearings: dict[str, RollingBearing] = {}
        for name in CLASSES:
            with suppress(MissingName):
                bearings[name] = replace(self, clearance_class=name, radial_clearance=None)
        return bearings

    # The law.

    @cached_property
    def stiffness_of_element(self) -> float:
        """Stiffness K of an element between both rings [N/m^n]."""
        return self.element_stiffness or self._hertz()

    @abstractmethod
    def _hertz(self) -> float:
        """Hertz's stiffness K for the geometry [N/m^n]."""

    @property
    @abstractmethod
    def _numbers(self) -> dict[str, Any]:
        """The arguments of `contact.resultant.bearing_numbers` that depend on the kind."""

    @property
    def drag(self) -> float:
        """Friction torque M_0 without load [N m]."""
        if self.drag_torque is not None:
            return self.drag_torque
        return len(self.row_places) * 1e-3 * MEAN_DRAG * (1e3 * self.d_pitch) ** 3

    @property
    def friction_lever(self) -> float:
        """Friction torque M_1 per sum of all element loads [m]."""
        typical = ROLLER_FRICTION if self.roller_elements else BALL_FRICTION
        coefficient = typical if self.rolling_friction is None else self.rolling_friction
        return coefficient * 0.5 * self.d_bore

    @property
    def reach(self) -> float:
        """r_i - r_o of balls, C_r of rollers; see `contact.rolling` [m]."""
        return float(self._numbers["reach"])

    @property
    def cage_ratio(self) -> float:
        """Rotation of the cage over that of the inner ring."""
        return float(self._numbers["ratio"])

    @cached_property
    def resultant(self) -> tuple[float, ...]:
        numbers = resultant.bearing_numbers(
            rollers=self.roller_elements,
            count=self.count,
            stiffness=self.stiffness_of_element,
            rows=self.row_places,
            drag=self.drag,
            friction=self.friction_lever,
            damping=self.damping_time,
            cage=self.cage_angle,
            **self._numbers,
        )
        return numbers if self.seat is None else (*numbers, *self.seat.numbers(ABOUT_AXIS))

    @property
    def law(self) -> int:
        return resultant.ELEMENTS if self.seat is None else resultant.SEATED

    def load(
        self, displacement: Sequence[float] | np.ndarray, cage: float | None = None
    ) -> BearingState:
        """Forces in the bearing at a displacement of its inner ring.

        The displacement is that of the centre and a rotation vector, outer ring's axes, (6,) [m,
        rad]; `cage` is the azimuth of the first element [rad], by default `cage_angle`.
        """
        xi = np.asarray(displacement, float)
        if xi.shape != (6,) or not np.isfinite(xi).all():
            raise JointplayError(f"a displacement has six finite components, got {displacement!r}")
        import pinocchio as pin  # not needed to check a scenario

        from jointplay.physics.contact.elastic import answers

        turn = self.cage_angle if cage is None else cage
        centre, axes = xi[:3], pin.exp3(xi[3:])
        pose = np.concatenate([centre, axes.ravel()])[None]
        out = answers(self.law, self.resultant, pose, turn)[0]
        loads, angles = self.element_loads(centre, axes[:, 2], turn)
        stiffness = out[resultant.TANGENT : resultant.ANSWERS].reshape(6, 6).copy()
        return BearingState(out[:6].copy(), float(out[resultant.ENERGY]), loads, angles, stiffness)

    def deflection(
        self,
        force: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        moment: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        cage: float | None = None,
    ) -> np.ndarray:
        """Displacement of the inner ring at rest under a load, without friction, (6,) [m, rad].

        Displacement of the centre and rotation vector under a force [N] and a moment about the
        centre, none about the axis [N m], outer ring's axes; `cage` as in `load`.

        Raises:
            JointplayError: a moment about the axis; no equilibrium.
        """
        return self.rest(force, moment, cage).displacement

    def rest(
        self,
        force: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        moment: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0),
        cage: float | None = None,
    ) -> BearingRest:
        """The position of rest under a load, as `deflection`, with its compliance.

        In a seat the compliance neglects a part as small as the seat's lean.

        Raises:
            JointplayError: a moment about the axis; no equilibrium.
        """
        load = np.concatenate([np.asarray(force, float), np.asarray(moment, float)])
        if load.shape != (6,) or not np.isfinite(load).all():
            raise JointplayError("force and moment have three finite components each")
        if abs(load[5]) > 1e-9 * max(np.abs(load).max(), 1e-300):
            raise JointplayError(
                f"a bearing bears no moment about its axis, got {load[5]:g} N m", where=("moment",)
            )
        (xi,), (soft,), (state,) = self._at_rest(load[None], cage)
        # The lean, the axis' components across the outer ring's, as a rotation vector.
        x, y = lean = xi[3:]
        sine = math.hypot(x, y)
        angle = math.asin(sine)
        place, compliance = np.zeros(6), np.zeros((6, 6))
        longer = angle / sine if sine > 0.0 else 1.0
        # Derivative of angle / sine by the sine, over the sine: a third near zero.
        growing = (1.0 / math.cos(angle) - longer) / sine**2 if sine > 1e-4 else 1.0 / 3.0
        across = np.array([[0.0, -1.0], [1.0, 0.0]])
        place[:3], place[3:5] = xi[:3], longer * across @ lean
        turned = across @ (longer * np.eye(2) + growing * np.outer(lean, lean))
        compliance[:3, :5], compliance[3:5, :5] = soft[:3], turned @ soft[3:]
        return BearingRest(place, compliance if state > 0.0 else None)

    def rests(
        self, loads: np.ndarray, cage: np.ndarray | float | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Displacements of the inner ring under many loads, and whether it is held.

        Loads are forces and moments (n, 6) [N, N m], of which the moment about the axis is
        ignored; `cage` is one azimuth or (n,) [rad]. Returns displacements like `deflection`'s,
        (n, 6) [m, rad], and whether the ring is held in every direction, (n,).

        Raises:
            JointplayError: no equilibrium.
        """
        xi, _, state = self._at_rest(np.asarray(loads, float).reshape(-1, 6), cage)
        lean = xi[:, 3:]
        sine = np.hypot(*lean.T)
        longer = np.where(sine > 0.0, np.arcsin(sine) / np.where(sine > 0.0, sine, 1.0), 1.0)
        place = np.zeros((len(xi), 6))
        place[:, :3] = xi[:, :3]
        place[:, 3], place[:, 4] = -longer * lean[:, 1], longer * lean[:, 0]
        return place, state > 0.0

    def _at_rest(
        self, loads: np.ndarray, cage: np.ndarray | float | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Centre and lean (n, 5), their compliance (n, 5, 5), and state (n,) of `rolling`."""
        from jointplay.physics.contact import rolling

        turn, seat = self.cage_angle if cage is None else cage, self.seat
        lean = np.zeros((len(loads), 2))
        # With a seat the bearing's load is in the axes of its outer ring, which leans under it:
        # repeat until the lean stays.
        for _ in range(_MOST_ROUNDS):
            results = rolling.rests(self.resultant, loads[:, :5], turn, lean)
            state = results[:, rolling.STATE]
            if (state == 0.0).any():
                load = loads[int(np.argmax(state == 0.0))]
                raise JointplayError(
                    f"no place of rest was found under the force {load[:3].tolist()} N and the "
                    f"moment {load[3:].tolist()} N m"
                )
            xi, soft = results[:, :5], results[:, rolling.SOFT :].reshape(-1, 5, 5)
            if seat is None:
                return xi, soft, state
            pushes = results[:, rolling.PUSH : rolling.SOFT]
            moved = [seat.under(push, ABOUT_AXIS) for push in pushes]
            shift = np.array([place for place, _ in moved]).reshape(-1, 5)
            if np.abs(shift[:, 3:] - lean).max(initial=0.0) <= _SAME_LEAN:
                softer = np.array([compliance for _, compliance in moved]).reshape(-1, 5, 5)
                return xi + shift, soft + softer @ _BY_LOAD, state
            lean = shift[:, 3:]
        raise JointplayError(f"its seat leans by {np.abs(lean).max():.3g} and more")

    def element_loads(
        self, centre: np.ndarray, axis: np.ndarray, cage: float | np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Loads [N] and contact angles [rad] of all elements, row by row, (..., rows * Z).

        At one or many positions of the inner ring: its centre (..., 3) [m] and axis (..., 3) in the
        outer one's axes, and the azimuth of the first element (...) [rad].
        """
        if self.seat is not None:
            shift = self._seat_shift(centre, axis, cage)
            centre, lean = centre - shift[..., :3], shift[..., 3:]
            axis = axis - np.concatenate([lean, np.zeros((*lean.shape[:-1], 1))], axis=-1)
        # The law of `contact.rolling` again, in numpy for arrays of any shape.
        d = self._numbers
        phi = np.asarray(cage)[..., None] + 2.0 * np.pi * np.arange(self.count) / self.count
        c, s = np.cos(phi), np.sin(phi)
        lie = c * axis[..., 0, None] + s * axis[..., 1, None]
        across = c * centre[..., 0, None] + s * centre[..., 1, None]
        rise, steep = centre[..., 2, None], axis[..., 2, None] - 1.0
        loads, angles = [], []
        for h, y in self.row_places:
            if self.roller_elements:
                sides = np.where(np.arange(self.count) % 2 == 0, 1.0, -1.0)
                delta = across - d["reach"] + sides * (y + rise - d["radius"] * lie)
                delta, exponent = np.sqrt(0.5) * delta, resultant.ROLLER_EXPONENT
                angles.append(np.broadcast_to(sides * np.pi / 4.0, delta.shape))
            else:
                x = d["reach"] + across + (h - 0.5 * d["radius"] * lie) * lie
                up = y + rise + h * steep - d["radius"] * lie
                delta, exponent = np.hypot(x, up) - d["distance"], resultant.BALL_EXPONENT
                angles.append(np.arctan2(up, x))
            loads.append(self.stiffness_of_element * np.maximum(delta, 0.0) ** exponent)
        return np.concatenate(loads, axis=-1), np.concatenate(angles, axis=-1)

    def _seat_shift(
        self, centre: np.ndarray, axis: np.ndarray, cage: float | np.ndarray
    ) -> np.ndarray:
        """Displacement of the outer ring in its seat, and lean of its axis, (..., 5) [m, 1]."""
        from jointplay.physics.contact.elastic import answers

        poses = np.zeros((*centre.shape[:-1], 12))
        poses[..., :3], poses[..., [5, 8, 11]] = centre, axis
        turns = np.broadcast_to(cage, centre.shape[:-1]).reshape(-1)
        out = answers(self.law, self.resultant, poses.reshape(-1, 12), turns)
        return out[:, resultant.SEAT :].reshape(*centre.shape[:-1], resultant.WAYS)

    # Life.

    def ratings(self) -> tuple[float, float]:
        """Ratings C and C_0 of one row: given, the catalogue's, or estimated [N]."""
        listed, (dynamic, static) = self._entry, self._estimated_ratings()
        return (
            self.dynamic_rating or float(listed.get("dynamic", dynamic)),
            self.static_rating or float(listed.get("static", static)),
        )

    @abstractmethod
    def _estimated_ratings(self) -> tuple[float, float]:
        """Ratings C and C_0 of one row by the geometry [N]."""

    def life(self, loads: np.ndarray, outer_turns: bool = False) -> float:
        """Basic reference rating life L10 under constant element loads (rows * Z,) [N], in
        revolutions.

        `outer_turns`: the outer ring turns against the load, not the inner one.
        """
        used = float(self.damage_of_turn(np.asarray(loads, float).reshape(1, -1), outer_turns)[0])
        return math.inf if used == 0.0 else 1.0 / used

    _life: ClassVar[tuple[tuple[float, float], float, float, float, float]]
    """Numbers of ISO/TS 16281: load ratings of an element on the inner and the outer raceway, in
    units of the dynamic rating; the factor between them; exponents of the mean load and of the
    life; Weibull's slope."""

    def damage_of_turn(self, loads: np.ndarray, outer_turns: bool = False) -> np.ndarray:
        """Part of the life L10 that one revolution takes at element loads (n, rows * Z) [N], (n,).

        `outer_turns`: see `life`.
        """
        loads = np.asarray(loads, float).reshape(-1, len(self.row_places), self.count)
        shares, factor, mean, life, slope = self._life
        inner, outer = (
            self.ratings()[0] * share * (1.0 + factor**power) ** (1.0 / life)
            for share, power in zip(shares, (life, -life), strict=True)
        )
        turning, standing = (np.mean(loads**p, axis=2) ** (1.0 / p) for p in (mean, life))
        on_inner, on_outer = (standing, turning) if outer_turns else (turning, standing)
        used = (on_inner / inner) ** life + (on_outer / outer) ** life
        # Rows survive together: their probabilities multiply.
        return np.asarray(1e-6 * np.sum(used, axis=1) ** (1.0 / slope))

    # As a joint: see `Clearance`.

    @property
    def contacts(self) -> tuple[str, ...]:
        return ("rollers",) if self.roller_elements else ("balls",)

    @property
    def exponent(self) -> float:
        """Exponent n of an element's load by its deflection."""
        return resultant.ROLLER_EXPONENT if self.roller_elements else resultant.BALL_EXPONENT

    @property
    def normal(self) -> NormalForceLaw:
        """Law of the normal force of one element."""
        return resultant.ElementContact(self.exponent, self.rated_load)

    @property
    def rated_load(self) -> float:
        """Load of the most loaded element at the static rating [N] (ISO 76)."""
        return self._most / math.cos(self.alpha) * self.ratings()[1] / self.count

    _most: ClassVar[float]
    """Q Z cos(alpha) / F of the most loaded element under a radial load."""

    def contact_properties(self, contact: int) -> ContactProperties:
        return ContactProperties(self.stiffness_of_element, 1.0)

    @property
    def clearances(self) -> dict[str, float]:
        return {"radial_clearance": self.bought_clearance}

    @property
    def loosest(self) -> float:
        """Largest radial clearance as bought with which elements keep the rings together [m]."""
        return _LOOSEST

    @property
    def preloaded(self) -> bool:
        """Whether elements bear load with both rings centred, so that there is no play."""
        return bool(self.element_loads(np.zeros(3), np.eye(3)[2], 0.0)[0].max() > 0.0)

    @cached_property
    def radial_travel(self) -> float:
        return float(self._reach[0])

    @cached_property
    def _reach(self) -> np.ndarray:
        """Free travel across and along the axis, and free tilt, to either side, (3,) [m, rad]."""
        loads = np.eye(6)[[0, 2, 4]]
        return np.abs(self._free_set.support(loads).value)

    @property
    def search_radius(self) -> float:
        """See `Clearance.search_radius`; at least a deflection of the elements, for preload [m]."""
        light = 1e-3 * self.ratings()[1] / self.count
        return max(self.radial_travel, (light / self.stiffness_of_element) ** (1.0 / self.exponent))

    @property
    def depth_limit(self) -> float:
        return 0.05 * self.d_element

    @property
    def outline(self) -> Outline:
        across, along, _ = self._reach
        places = [h for h, _ in self.row_places]
        half = 0.5 * (max(places) - min(places) + (self.row_width or self.d_element))
        radius = 0.5 * self.d_pitch
        return Outline("cylinder", (radius, radius, half), (across, across, along), walls=True)

    @property
    def travel(self) -> dict[str, float]:
        across, along, tilt = map(float, self._reach)
        return {"x": across, "y": across, "z": along, "yaw": math.pi, "pitch": tilt, "roll": tilt}

    @property
    def hinge(self) -> Hinge:
        across, along, _ = map(float, self._reach)
        return Hinge(0.5 * self.d_bore, 2.0 * self.outline.size[2], True, across, along)

    def fits(self, offset: np.ndarray, lean: float, least: float) -> bool:
        across = float(np.hypot(offset[0], offset[1])) - least
        steep = lean / max(self.outline.size[2], 1e-9)
        d, up = self._numbers, abs(float(offset[2])) + 0.0
        if self.roller_elements:
            return bool(across + up + d["radius"] * steep <= max(self.cr, 0.0) + least)
        for h, y in self.row_places:
            x = d["reach"] + across + abs(h) * steep
            high = abs(y) + up + d["radius"] * steep
            if x * x + high * high > (d["distance"] + least) ** 2:
                return False
        return True

    def directions(self) -> np.ndarray:
        phi = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
        c, s, zero = np.cos(phi), np.sin(phi), np.zeros(SAMPLES)
        d, parts = self._numbers, []
        for h, y in self.row_places:
            if self.roller_elements:
                angles = [math.pi / 4.0, -math.pi / 4.0]
            elif y:
                angles = [math.atan2(y, d["reach"])]
            else:  # a ball of a deep groove moves between the ends of the axial play
                most = math.acos(min(d["reach"] / d["distance"], 1.0))
                angles = [-most, 0.0, most]
            for angle in angles:
                across, up = math.cos(angle), math.sin(angle)
                lever = across * h - up * d["radius"]
                parts.append(
                    -np.column_stack(
                        [across * c, across * s, zero + up, -lever * s, lever * c, zero]
                    )
                )
        return np.concatenate(parts)

    @cached_property
    def _free_set(self) -> ElementPlay:
        """The play, to first order."""
        d = self._numbers
        return _element_play(
            rows=self.row_places,
            count=self.count,
            cage=self.cage_angle,
            radius=d["radius"],
            across=d["reach"],
            distance=d["distance"],
            rollers=self.roller_elements,
        )

    def play(self, second_order: bool = True) -> Play:
        return self._free_set.widened if second_order else self._free_set

    def scaled(self, factor: float) -> RollingBearing:
        return replace(self, radial_clearance=factor * self.bought_clearance, clearance_class=None)

    @property
    def has_play(self) -> bool:
        return not self.preloaded

    @property
    def play_words(self) -> str:
        if self.preloaded:
            return "none (preloaded)"
        across, _, tilt = map(float, self._reach)
        return f"{1e6 * across:.3g} µm and {1e3 * tilt:.3g} mrad of tilt"

    @property
    def summary(self) -> str:
        name = self.designation or f"{1e3 * self.d_bore:g} x {1e3 * self.d_outside:g} mm"
        across, along, tilt = map(float, self._reach)
        if self.preloaded:
            return f"{self.kind} {name}, preloaded"
        return (
            f"{self.kind} {name}, free ±{1e6 * across:.3g} µm across, ±{1e6 * along:.3g} µm along, "
            f"±{1e3 * tilt:.3g} mrad tilt"
        )


_BY_LOAD = np.array([1.0, 1.0, 1.0, 1.0, -1.0])[:, None] * np.eye(5)[[0, 1, 2, 4, 3]]
"""Maps a force and a moment about x and y to the load on xi of `contact.rolling`.

The last two components of xi are the x and y components of the axis's direction, which a rotation
about y and -x changes."""
_LOOSEST, _ROOM = 1e-3, 0.9
"""Largest clearance: of rollers [m]; of balls, relative to that without a contact angle."""
_MOST_ROUNDS, _SAME_LEAN = 60, 1e-14
"""Most rounds in which the outer ring's lean in its seat is found; change of the lean at the end.
"""


def refuse(field: str, message: str) -> NoReturn:
    """Raise an error at a field."""
    raise JointplayError(message, where=(field,))


def point_contact_stiffness(
    sum_of_curvatures: float, difference: float, modulus: float
) -> tuple[float, float]:
    """Hertz stiffness of an elliptic point contact, delta = (Q / K)^(2/3).

    Args:
        sum_of_curvatures: sum of both bodies' curvatures in both principal planes [1/m].
        difference: F(rho) of ISO/TS 16281, relative difference of the curvatures, in [0, 1).
        modulus: E / (1 - nu^2), the same for both bodies [Pa].

    Returns:
        K [N/m^1.5], and the ratio of the ellipse's axes.
    """
    from scipy.optimize import brentq  # takes long to import
    from scipy.special import ellipe, ellipk

    def misfit(ratio: float) -> float:
        m = 1.0 - 1.0 / ratio**2
        return 1.0 - 2.0 / (ratio**2 - 1.0) * (ellipk(m) / ellipe(m) - 1.0) - difference

    ratio = brentq(misfit, 1.0 + 1e-6, 1e4, xtol=1e-14, rtol=1e-14) if difference > 1e-6 else 1.0
    m = 1.0 - 1.0 / ratio**2
    size = ellipk(m) * (sum_of_curvatures / (ratio**2 * ellipe(m))) ** (1.0 / 3.0)
    constant = (9.0 / (2.0 * math.pi**2)) ** (1.0 / 3.0)  # 1.48 of ISO/TS 16281 is its -3/2 power
    return float(modulus * (constant * size) ** -1.5), float(ratio)


@dataclass(frozen=True, kw_only=True)
class BallBearing(RollingBearing):
    """A deep-groove or angular contact ball bearing, one row or a pair.

    Without a contact angle it is a deep-groove bearing. With one, C_r is the radial travel until
    the balls of a pair touch, and a single row is free in one direction along its axis only.
    References: T. A. Harris, M. N. Kotzalas, Rolling Bearing Analysis (2006); ISO/TS 16281:2008;
    angular contact bearings of one row: A. B. Jones, Trans. ASME D 82 (1960) 309-320.

    Raises:
        JointplayError: dimensions that are missing, not positive, contradictory or impossible; an
            unknown designation, with the nearest ones.
        MissingName: an unknown class.
    """

    kind: ClassVar[str] = "ball-bearing"
    roller_elements: ClassVar[bool] = False
    _normal_class: ClassVar[str] = "CN"
    _most: ClassVar[float] = 5.0

    arrangement: str | None = choice("arrangement", ARRANGEMENTS, default=None)
    """``single``, or a pair: ``DB`` back to back, ``DF`` face to face, ``DT`` in tandem. None takes
    the designation's, or ``single``."""
    spacing: OptionalQuantity = quantity("m", default=None, above=0.0, label="spacing")
    """Distance between the centres of a pair's rows [m]; None puts the rings side by side."""
    contact_angle: OptionalQuantity = quantity(
        "rad", default=None, least=0.0, label="contact angle"
    )
    """Nominal contact angle [rad]; None takes the designation's, 0 for deep-groove bearings."""
    preload: OptionalQuantity = quantity("N", default=None, least=0.0)
    """Axial force by which a pair is preloaded [N]; None: by its clearance, if that is negative."""
    inner_groove: Quantity = quantity("", default=0.52)
    """f_i, radius of the inner groove over the ball diameter."""
    outer_groove: Quantity = quantity("", default=0.52)
    """f_o, radius of the outer groove over the ball diameter."""

    def __post_init__(self) -> None:
        for name in ("inner_groove", "outer_groove"):
            value = getattr(self, name)
            if not (isinstance(value, int | float) and 0.5 < value < 1.0):
                limits = f"must lie between 0.5 and 1 ball diameters, got {value!r}"
                refuse(name, f"{name.replace('_', ' ')} {limits}")
        super().__post_init__()
        if self.alpha >= math.pi / 2:
            angle = f"contact angle {self.alpha:g} rad"
            refuse("contact_angle", f"{angle} must be below a right angle")
        if self.preload is not None and (self.pairing == "single" or self.alpha == 0.0):
            remedy = (
                "give an arrangement (DB, DF) and a contact angle, or a negative radial clearance"
            )
            refuse("preload", f"a preload is that of a pair of angular contact bearings: {remedy}")
        if self.preload is not None and self.pairing == "DT":
            refuse("preload", "bearings in tandem do not preload each other; take DB or DF")

    @property
    def section(self) -> str:  # type: ignore[override]
        name = (self.designation or "").strip()
        angular = name.startswith("7") or (not name and bool(self.contact_angle))
        return "angular_contact" if angular else "deep_groove"

    @property
    def _needs_width(self) -> bool:  # type: ignore[override]
        return self.pairing != "single" and self.spacing is None

    @cached_property
    def pairing(self) -> str:
        """One of `ARRANGEMENTS`."""
        named = [word for word in (self.designation or "").upper().split() if word in ARRANGEMENTS]
        return self.arrangement or (named[0] if named else "single")

    @cached_property
    def alpha(self) -> float:  # type: ignore[override]
        if self.contact_angle is not None:
            return self.contact_angle
        return math.radians(float(self._entry.get("contact_angle", 0.0)))

    @cached_property
    def _estimated_diameter(self) -> float:
        listed, entry = self._entry.get("ball_diameter"), self._entry
        if listed:
            return 1e-3 * float(listed)
        if "static" in entry:
            filled = self._filling * math.pi * 1e3 * self.d_pitch * math.cos(self.alpha)
            factor = float(entry.get("f0", STATIC_FACTOR))
            return 1e-3 * float(entry["static"]) / (factor * filled)
        return BALL_SHARE * (self.d_outside - self.d_bore)

    @property
    def _filling(self) -> float:  # type: ignore[override]
        return ANGULAR_FILLING if self.alpha > 0.0 else FILLING

    @property
    def count(self) -> int:
        if self.elements is not None:
            return int(self.elements)
        filled = self._filling * math.pi * self.d_pitch / self.d_element
        return int(self._entry.get("balls", round(filled)))

    @property
    def _diameter_source(self) -> str:  # type: ignore[override]
        return (
            "static rating" if "static" in self._entry else f"{BALL_SHARE:g} of outside less bore"
        )

    @property
    def _by_class(self) -> bool:
        return super()._by_class and self.preload is None

    @property
    def _class_size(self) -> float:
        return self.d_bore

    def of_classes(self) -> dict[str, RollingBearing]:
        """The bearing in each class of clearance; an angular contact pair as given, and preloaded.

        The preload, if none is given, is a hundredth of the static rating.
        """
        if self.alpha == 0.0:
            return super().of_classes()
        bearings: dict[str, RollingBearing] = {AS_GIVEN: self}
        if self.pairing in ("DB", "DF"):
            force = self.preload or 1e-2 * self.ratings()[1]
            bearings[PRELOADED] = replace(self, preload=force, radial_clearance=None)
        return bearings

    def class_range(self) -> tuple[float, float]:
        if self.alpha > 0.0:
            return 0.0, 0.0
        return super().class_range()

    @property
    def distance(self) -> float:
        """Distance A of the grooves' centres of curvature when a ball just touches both [m]."""
        return (self.inner_groove + self.outer_groove - 1.0) * self.d_element

    @property
    def loosest(self) -> float:
        room = 0.5 if self.alpha == 0.0 else 1.0 - math.cos(self.alpha)
        loss = self.bought_clearance - self.cr
        return max(_ROOM * room * self.distance + loss, self.bought_clearance)

    @cached_property
    def operating_clearance(self) -> float:
        """C_r of the mounted bearing [m]: with a preload, the negative one at which the rows of the
        pair press against each other with this force.
        """
        if self.preload is None:
            return self.cr
        force = self.preload
        if force == 0.0:
            return 0.0
        from scipy.optimize import brentq  # takes long to import

        reach, a = self.distance * math.cos(self.alpha), self.distance

        def surplus(up: float) -> float:
            length = math.hypot(reach, up)
            delta = max(length - a, 0.0)
            push = self.count * self.stiffness_of_element * delta**1.5 * up / length
            return float(push - force)

        start = a * math.sin(self.alpha)
        up = brentq(surplus, start, start + 0.2 * self.d_element, xtol=1e-16, rtol=1e-14)
        return math.sqrt(max(a * a - up * up, 0.0)) - reach

    @property
    def groove_radius(self) -> float:
        """Radius r_i of the circle of the inner groove's centres of curvature [m]."""
        angle = self.alpha  # at the ends of the axial play
        if not angle > 0.0:
            angle = math.acos(min(1.0, 1.0 - max(self.operating_clearance, 0.0) / self.distance))
        return 0.5 * self.d_pitch + (self.inner_groove - 0.5) * self.d_element * math.cos(angle)

    @cached_property
    def row_places(self) -> tuple[tuple[float, float], ...]:
        """Axial position h and y_0 of each row [m]."""
        a, clearance = self.distance, self.operating_clearance
        if clearance >= 0.5 * a:
            raise JointplayError(
                f"radial clearance {readable(clearance, 'm')} is too large for grooves whose "
                f"centres are {readable(a, 'm')} apart",
                where=("radial_clearance",),
            )
        if self.alpha == 0.0:
            up = 0.0
        else:
            across = a * math.cos(self.alpha) + clearance
            if across >= a:
                size = readable(clearance, "m")
                refuse("radial_clearance", f"radial clearance {size} leaves no contact angle")
            up = math.sqrt(a * a - across * across)
        if self.pairing == "single":
            return ((0.0, up),)
        half = 0.5 * (self.spacing or self.row_width)
        first, second = {"DB": (-up, up), "DF": (up, -up), "DT": (up, up)}[self.pairing]
        return (half, first), (-half, second)

    @property
    def _numbers(self) -> dict[str, Any]:
        reach = self.distance * math.cos(self.alpha)
        if self.alpha == 0.0:
            reach -= self.operating_clearance
        return {
            "radius": self.groove_radius,
            "reach": reach,
            "distance": self.distance,
            "ratio": 0.5 * (1.0 - self._gamma),
        }

    def race_contact(self, inner: bool) -> tuple[float, float]:
        """Hertz stiffness K of a ball on one ring [N/m^1.5], and its ellipse's ratio of axes."""
        gamma, d = self._gamma, self.d_element
        groove = self.inner_groove if inner else self.outer_groove
        curvature = gamma / (1.0 - gamma) if inner else -gamma / (1.0 + gamma)
        total = 2.0 + curvature - 0.5 / groove
        modulus = self.ring_material.young / (1.0 - self.ring_material.poisson**2)
        return point_contact_stiffness(2.0 * total / d, (curvature + 0.5 / groove) / total, modulus)

    def _hertz(self) -> float:
        soft = sum(self.race_contact(inner)[0] ** (-2.0 / 3.0) for inner in (True, False))
        return float(soft**-1.5)

    def _life_factor(self, lead: float) -> float:
        """Ratio of the raceways' ratings in Lundberg and Palmgren's theory.

        lead ((1 - gamma)/(1 + gamma))^1.72 (f_i (2 f_o - 1) / (f_o (2 f_i - 1)))^0.41.
        """
        gamma, fi, fo = self._gamma, self.inner_groove, self.outer_groove
        grooves = fi / fo * (2.0 * fo - 1.0) / (2.0 * fi - 1.0)
        return float(lead * ((1.0 - gamma) / (1.0 + gamma)) ** 1.72 * grooves**0.41)

    def _estimated_ratings(self) -> tuple[float, float]:
        """C of Lundberg and Palmgren, in Harris's form; C_0 = f_0 Z D^2 cos(alpha) [N]."""
        gamma, d, z, fi = self._gamma, 1e3 * self.d_element, self.count, self.inner_groove
        factor = 39.9 * (1.0 + self._life_factor(1.04) ** (10.0 / 3.0)) ** -0.3
        factor *= gamma**0.3 * (1.0 - gamma) ** 1.39 / (1.0 + gamma) ** (1.0 / 3.0)
        factor *= (2.0 * fi / (2.0 * fi - 1.0)) ** 0.41
        dynamic = factor * math.cos(self.alpha) ** 0.7 * z ** (2.0 / 3.0) * d**1.8
        return dynamic, STATIC_FACTOR * z * d * d * math.cos(self.alpha)

    @property
    def _life(self) -> tuple[tuple[float, float], float, float, float, float]:  # type: ignore[override]
        """Equations 19 to 29 of ISO/TS 16281."""
        unit = self.count * math.cos(self.alpha) ** 0.7
        shares = 1.0 / (0.407 * unit), 1.0 / (0.389 * unit)
        return shares, self._life_factor(1.044), 3.0, 10.0 / 3.0, 10.0 / 9.0


@dataclass(frozen=True, kw_only=True)
class CrossedRollerBearing(RollingBearing):
    """A crossed roller bearing: one row of rollers whose axes alternate by 45 degrees.

    Each roller bears axial load in one direction; all bear radial load. Reference: ISO/TS
    16281:2008 for the line contact, with one slice of each roller.

    Raises:
        JointplayError: dimensions that are missing, not positive, contradictory or impossible; an
            odd number of rollers.
        MissingName: an unknown class.
    """

    kind: ClassVar[str] = "crossed-roller-bearing"
    roller_elements: ClassVar[bool] = True
    section: ClassVar[str] = "crossed_roller"
    alpha: ClassVar[float] = math.pi / 4.0
    row_places: ClassVar[tuple[tuple[float, float], ...]] = ((0.0, 0.0),)
    _normal_class: ClassVar[str] = "C0"
    _filling: ClassVar[float] = ROLLER_FILLING
    _most: ClassVar[float] = 4.08

    roller_length: OptionalQuantity = quantity("m", default=None, above=0.0, label="roller length")
    """Length L of a roller [m]; None takes 0.9 of the diameter."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.count % 2:
            even = f"so their number must be even, got {self.count}"
            refuse("elements", f"crossed rollers alternate, {even}")
        if self.length > self.d_element:
            length, wide = (readable(size, "m") for size in (self.length, self.d_element))
            sizes = f"length {length}, diameter {wide}"
            refuse("roller_length", f"crossed rollers are no longer than wide: {sizes}")

    @cached_property
    def _estimated_diameter(self) -> float:
        """D at which C_0 = 44 (1 - gamma) Z L D cos(45 deg), or a part of the space [m]."""
        static = self.static_rating or float(self._entry.get("static", 0.0))
        if not static:
            return 0.3 * (self.d_outside - self.d_bore)
        from scipy.optimize import brentq  # takes long to import

        pitch = 1e3 * self.d_pitch

        def surplus(d: float) -> float:
            gamma, z = d * math.cos(self.alpha) / pitch, ROLLER_FILLING * math.pi * pitch / d
            size = z * ROLLER_LENGTH * d * d * math.sqrt(0.5)
            return float(ROLLER_STATIC * (1.0 - gamma) * size - static)

        most = 1e3 * 0.499 * (self.d_outside - self.d_bore)
        return 1e-3 * brentq(surplus, 1e-3, most) if surplus(most) > 0.0 else 1e-3 * most

    @property
    def count(self) -> int:
        if self.elements is not None:
            return int(self.elements)
        return 2 * int(0.5 * ROLLER_FILLING * math.pi * self.d_pitch / self.d_element)

    @property
    def length(self) -> float:
        """Length L of a roller [m]."""
        return self.roller_length or ROLLER_LENGTH * self.d_element

    @property
    def estimates(self) -> dict[str, str]:
        length = f"{1e3 * self.length:.3g} mm: {ROLLER_LENGTH:g} of the diameter"
        return super().estimates | ({} if self.roller_length else {"roller_length": length})

    @property
    def _diameter_source(self) -> str:  # type: ignore[override]
        known = self.static_rating or "static" in self._entry
        return "static rating" if known else "0.3 of outside less bore"

    @property
    def _class_size(self) -> float:
        return self.d_pitch

    @property
    def _numbers(self) -> dict[str, Any]:
        ratio = 0.5 * (1.0 - self._gamma)
        return {"radius": 0.5 * self.d_pitch, "reach": self.cr, "distance": 0.0, "ratio": ratio}

    def _hertz(self) -> float:
        """35948 L^(8/9) N/mm^(10/9) for steel (ISO/TS 16281), in proportion to other moduli."""
        steel, rings = material("bearing-steel"), self.ring_material
        softer = rings.young / (1.0 - rings.poisson**2) * (1.0 - steel.poisson**2) / steel.young
        return 35948.0 * (1e3 * self.length) ** (8.0 / 9.0) * 1e3 ** (10.0 / 9.0) * softer

    def _estimated_ratings(self) -> tuple[float, float]:
        """C_0 by ISO 76; C is three quarters of it, as in the makers' smaller sizes [N]."""
        size = 1e6 * self.count * self.length * self.d_element
        static = ROLLER_STATIC * (1.0 - self._gamma) * size * math.sqrt(0.5)
        return 0.75 * static, static

    @property
    def _life(self) -> tuple[tuple[float, float], float, float, float, float]:  # type: ignore[override]
        """The numbers for radial rollers, with one slice each."""
        factor = 1.038 * ((1.0 - self._gamma) / (1.0 + self._gamma)) ** (143.0 / 108.0)
        unit = 0.83 * self.count * math.cos(self.alpha)
        return (1.0 / (0.378 * unit), 1.0 / (0.364 * unit)), factor, 4.0, 4.5, 9.0 / 8.0
