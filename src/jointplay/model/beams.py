"""Flexible links: how one is described, and the stiffness and mass of its cross-section.

flexible = jp.FlexibleLink(section="tube 80x4 mm", material="aluminium", segments=6)
robot = jp.Mechanism("ur5", flexible={"forearm_link": flexible})

A flexible link is a beam of rigid segments with elastic hinges between them, into which
`model.flexible` cuts it. Each hinge has the stiffness EI/h of a stretch of length h. Hinges sit in
the middle of their stretches; the first and the last one are moved outwards by h/24, which is the
boundary term of the midpoint rule (Euler and Maclaurin), so that the error falls with about the
third power of h instead of the second.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jointplay.base.errors import JointplayError, require_whole
from jointplay.base.schema import Described, OptionalQuantity, Quantity, check_fields, quantity
from jointplay.base.units import convert
from jointplay.model.payload import Vector
from jointplay.physics.joints.base import Material

MOST_SEGMENTS = 50
"""Most segments of a flexible link: more would take steps of nanoseconds."""

CLAMPED_FREE = (1.875104068711961, 4.694091132974175, 7.854757438237613)
"""beta L of the first three bending modes of a cantilever: roots of cos(x) cosh(x) = -1."""

_WRITTEN = re.compile(r"^\s*(tube|rod|box|bar)\s+([\d.eE+-]+(?:\s*[x×]\s*[\d.eE+-]+)*)\s*(\S+)\s*$")

FORMS = {
    "tube": (2, "outside diameter and wall", "tube 80x4 mm"),
    "rod": (1, "diameter", "rod 20 mm"),
    "box": (3, "width, height and wall", "box 80x60x4 mm"),
    "bar": (2, "width and height", "bar 30x5 mm"),
}
"""Forms of a section by word: number of sizes, their meaning, an example."""

_ODD = np.arange(1, 200, 2)
"""Indices of Saint-Venant's series, whose terms fall as their fifth power: the rest is below 1e-10
of its sum."""


@dataclass(frozen=True)
class Section:
    """A cross-section; its width lies along x, its height along y.

    Attributes:
        form: ``tube``, ``rod``, ``box`` or ``bar``.
        size: width and height, or the diameter twice [m].
        area: area of the material [m^2].
        about_x, about_y: second moments of area [m^4].
        torsion: torsion constant [m^4].
        shear: function of Poisson's ratio that gives Timoshenko's shear coefficients along x and y.
    """

    form: str
    size: tuple[float, float]
    area: float
    about_x: float
    about_y: float
    torsion: float
    shear: Callable[[float], tuple[float, float]]


def section(text: str) -> Section:
    """Parse a section such as ``tube 80x4 mm``.

    Second moments are exact; torsion constants are exact for tubes, rods and bars (Saint-Venant's
    series), and those of a thin wall for boxes (Bredt). Shear coefficients are Cowper's, for tubes
    and boxes of thin walls; from memory.

    Raises:
        JointplayError: the text is no section; the message has the forms that are possible.
    """
    parsed = _WRITTEN.match(text)
    forms = ", ".join(f'"{example}" ({numbers})' for _, numbers, example in FORMS.values())
    if parsed is None:
        raise JointplayError(f"{text!r} is no section; possible are {forms}", where=("section",))
    form, numbers, unit = parsed[1], re.split(r"\s*[x×]\s*", parsed[2]), parsed[3]
    count, meaning, example = FORMS[form]
    try:
        sizes = [float(convert(f"{size} {unit}", "m")) for size in numbers]
    except ValueError as error:
        raise JointplayError(f"section {text!r}: {error}", where=("section",)) from None
    if len(sizes) != count:
        raise JointplayError(
            f'section {text!r}: a {form} has {meaning}, as in "{example}"', where=("section",)
        )
    if not all(0.0 < size < math.inf for size in sizes):
        raise JointplayError(f"section {text!r}: sizes must be positive", where=("section",))
    if form in ("tube", "box") and not 2.0 * sizes[-1] < min(sizes[:-1]):
        fault = f"section {text!r}: twice the wall must be less than the {form}'s size"
        raise JointplayError(fault, where=("section",))
    if form == "tube":
        inner = sizes[0] - 2.0 * sizes[1]
        return _round(form, sizes[0], inner, lambda nu: 2.0 * (1.0 + nu) / (4.0 + 3.0 * nu))
    if form == "rod":
        return _round(form, sizes[0], 0.0, lambda nu: 6.0 * (1.0 + nu) / (7.0 + 6.0 * nu))
    return _box(*sizes) if form == "box" else _bar(*sizes)


def _round(form: str, outer: float, inner: float, shear: Callable[[float], float]) -> Section:
    second = math.pi / 64.0 * (outer**4 - inner**4)
    area = math.pi / 4.0 * (outer**2 - inner**2)

    def factors(poisson: float) -> tuple[float, float]:
        return shear(poisson), shear(poisson)

    return Section(form, (outer, outer), area, second, second, 2.0 * second, factors)


def _bar(width: float, height: float) -> Section:
    long, short = max(width, height), min(width, height)
    tail = (np.tanh(0.5 * np.pi * _ODD * long / short) / _ODD**5.0).sum()
    torsion = long * short**3 / 3.0 * (1.0 - 192.0 / np.pi**5 * short / long * float(tail))

    def shear(poisson: float) -> tuple[float, float]:
        factor = 10.0 * (1.0 + poisson) / (12.0 + 11.0 * poisson)
        return factor, factor

    area = width * height
    about_x, about_y = area * height**2 / 12.0, area * width**2 / 12.0
    return Section("bar", (width, height), area, about_x, about_y, torsion, shear)


def _box(width: float, height: float, wall: float) -> Section:
    b, h = width - 2.0 * wall, height - 2.0 * wall
    area = width * height - b * h
    middle = (width - wall) * (height - wall)
    torsion = 2.0 * wall * middle**2 / (width + height - 2.0 * wall)

    def shear(_: float) -> tuple[float, float]:  # the walls along the force bear it
        return 2.0 * wall * width / area, 2.0 * wall * height / area

    about_x = (width * height**3 - b * h**3) / 12.0
    about_y = (height * width**3 - h * b**3) / 12.0
    return Section("box", (width, height), area, about_x, about_y, torsion, shear)


@dataclass(frozen=True)
class Beam:
    """Stiffness and mass of a beam; x along the width, y along the height, z along the beam."""

    bending: tuple[float, float]
    """Bending stiffness EI about x and about y [N m^2]."""
    torsion: float
    """Torsional stiffness GJ [N m^2]."""
    axial: float
    """Axial stiffness EA [N]."""
    shear: tuple[float, float] | None
    """Shear stiffness kappa G A along x and y [N]; None where it is not known."""
    mass: float
    """Mass per length [kg/m]."""
    turning: tuple[float, float]
    """Moments of inertia about x and y per length [kg m]; that about z is their sum."""

    def frequencies(self, length: float) -> np.ndarray:
        """First bending frequencies (3,) [Hz] of a cantilever of this length, softer plane."""
        roots = np.array(CLAMPED_FREE)
        omega: np.ndarray = roots**2 * math.sqrt(min(self.bending) / (self.mass * length**4))
        return omega / (2.0 * math.pi)

    def shear_share(self, length: float) -> float:
        """Sag of a cantilever's tip by shear, relative to that by bending, under a force there."""
        if self.shear is None:
            return 0.0
        (about_x, about_y), (along_x, along_y) = self.bending, self.shear
        return max(3.0 * about_x / along_y, 3.0 * about_y / along_x) / length**2


@dataclass(frozen=True, kw_only=True)
class FlexibleLink(Described):
    """A link that bends and twists: a beam of rigid segments with elastic hinges between them.

    The beam runs from `start`, by default the origin of the link's frame, to the origin of its
    child's joint; it is clamped at both. It is rigid in tension, and in shear unless `shear` is set
    (Euler and Bernoulli). Its mass is that of the section; if the URDF's link is heavier, the rest
    stays at the link's centre of mass, as a rigid body.

    Raises:
        JointplayError: a section or number that cannot be, or one that is missing.
    """

    section: str | None = None
    """``"tube 80x4 mm"`` (outside diameter x wall), ``"rod 20 mm"``, ``"box 80x60x4 mm"`` (width x
    height x wall) or ``"bar 30x5 mm"`` (width x height)."""
    material: Material | None = None
    """Material of the section, with a density."""
    segments: int = 7
    """Number of hinges between rigid pieces, of which there is one more."""
    damping_ratio: Quantity = quantity("", default=0.01, least=0.0, label="damping ratio")
    """Damping ratio of the first bending mode of the link alone, clamped and free; that of other
    modes grows in proportion to their frequency."""
    torsion: bool = True
    """Whether the link twists."""
    shear: bool = False
    """Whether the link gives way in shear, too (Timoshenko)."""
    to: str | None = None
    """Joint at whose origin the beam ends; needed if the link carries several moving joints."""
    start: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Point at which the beam begins, in the link's frame [m]."""
    tip: Vector | None = quantity("m", default=None)
    """Point at which the beam ends, in the link's frame, instead of at a joint [m]."""
    height_along: Vector | None = quantity("", default=None)
    """Direction of the section's height in the link's frame; if not given, z, or y for a link along
    z."""
    bending_stiffness: OptionalQuantity = quantity("N*m^2", default=None, above=0.0)
    """Bending stiffness EI in both planes, instead of section and material [N m^2]."""
    torsion_stiffness: OptionalQuantity = quantity("N*m^2", default=None, above=0.0)
    """Torsional stiffness GJ, instead of section and material [N m^2]."""
    line_mass: OptionalQuantity = quantity("kg/m", default=None, above=0.0, label="mass per length")
    """Mass per length, instead of section and material [kg/m]."""
    gyration_radius: OptionalQuantity = quantity("m", default=None, above=0.0)
    """Radius of gyration about the beam's axis, instead of section and material [m]."""

    def __post_init__(self) -> None:
        check_fields(self)
        require_whole("segments", self.segments, 1, MOST_SEGMENTS, ("segments",))
        names = ("bending_stiffness", "torsion_stiffness", "line_mass", "gyration_radius")
        stated = [name for name in names if getattr(self, name) is not None]
        if self.section is None:
            missing = [name for name in names if name not in stated]
            if missing:
                raise JointplayError(
                    f"a flexible link needs a section and a material, or {', '.join(names)}; "
                    f"missing: {', '.join(missing) if stated else 'section'}"
                )
            if self.shear:
                raise JointplayError("shear needs a section and a material", where=("shear",))
        else:
            if stated:
                raise JointplayError(f"give a section or {stated[0]}, not both", where=(stated[0],))
            section(self.section)
            if self.material is None:
                raise JointplayError("a section needs a material", where=("section",))
            if self.material.density is None:
                raise JointplayError(
                    f"the material {self.material.name or 'given'!r} has no density, which a "
                    "flexible link needs",
                    where=("material",),
                )
        if self.tip is not None and self.to is not None:
            raise JointplayError("give tip or to, not both", where=("tip",))
        if self.height_along is not None and not any(self.height_along):
            raise JointplayError("height_along has no direction", where=("height_along",))

    @cached_property
    def beam(self) -> Beam:
        """Stiffness and mass of the link, from its section and material or as given."""
        if self.section is None:
            stated = self.bending_stiffness, self.torsion_stiffness, self.line_mass
            stiff, twist, mass, radius = (x or 0.0 for x in (*stated, self.gyration_radius))
            half = 0.5 * mass * radius**2
            return Beam((stiff, stiff), twist, 2.0 * stiff / radius**2, None, mass, (half, half))
        form, material = section(self.section), self.material
        assert material is not None
        assert material.density is not None
        young, density = material.young, material.density
        rigidity = young / (2.0 * (1.0 + material.poisson))
        along_x, along_y = form.shear(material.poisson)
        return Beam(
            (young * form.about_x, young * form.about_y),
            rigidity * form.torsion,
            young * form.area,
            (along_x * rigidity * form.area, along_y * rigidity * form.area),
            density * form.area,
            (density * form.about_x, density * form.about_y),
        )

    def hinges(self, length: float) -> np.ndarray:
        """Positions of the hinges along a beam of this length, shape (segments,) [m]."""
        stretch = length / self.segments
        places = (np.arange(self.segments) + 0.5) * stretch
        places[0] -= stretch / 24.0
        places[-1] += stretch / 24.0
        return places

    def damping_time(self, length: float) -> float:
        """Ratio of damping to stiffness that gives the first mode its damping ratio [s]."""
        first = 2.0 * math.pi * float(self.beam.frequencies(length)[0])
        return 2.0 * self.damping_ratio / first
