"""Materials, wear pairs and oils by name; the numbers and their sources are in ``data/``.

bearing = jp.RevoluteClearance(..., bearing_material=jp.material("bronze"))
viscosity = jp.oil("ISO VG 46").viscosity(60.0)  # Pa s
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from jointplay.base.errors import JointplayError, MissingName, require_a, require_finite
from jointplay.base.files import shipped_table
from jointplay.base.schema import Quantity, check_fields, quantity
from jointplay.physics.joints.base import Material

ZERO_CELSIUS = 273.15
"""0 °C [K]."""
THINNEST = 2e-6
"""Kinematic viscosity below which ASTM D341 needs further terms [m^2/s]."""


def _word(name: str) -> str:
    """A name as the tables have it: small letters and hyphens."""
    return name.strip().lower().replace(" ", "-").replace("_", "-")


def _entry(name: str) -> tuple[str, dict[str, Any]]:
    """A material's name in the table, and its numbers."""
    table = shipped_table(__file__, "materials")
    word = table["alias"].get(_word(name), _word(name))
    if word not in table["material"]:
        raise MissingName("material", name, materials(aliases=True))
    return word, table["material"][word]


def materials(aliases: bool = False) -> list[str]:
    """Names that `material` knows, with or without their synonyms."""
    table = shipped_table(__file__, "materials")
    return [*table["material"], *(table["alias"] if aliases else ())]


def material(name: str) -> Material:
    """A material such as ``phosphor-bronze``: typical E, nu and density at room temperature.

    Capitals do not matter, nor whether words are separated by spaces, hyphens or underscores.

    Raises:
        MissingName: no such material; the message lists those there are.
    """
    require_a("name", name, "str")
    word, entry = _entry(name)
    return Material(name=word, **{key: entry[key] for key in entry if key != "source"})


def source(name: str) -> str:
    """Key of the source of a material's numbers, explained in ``data/materials.toml``.

    Raises:
        MissingName: no such material.
    """
    return str(_entry(name)[1]["source"])


@dataclass(frozen=True)
class WearPair:
    """Unlubricated wear of the first body sliding on the second, by Archard's law."""

    bodies: tuple[str, str]
    """The body that wears, and the one it slides on."""
    coefficient: float
    """Wear coefficient K of V = K F s/H."""
    hardness: float
    """Hardness H of the body that wears [Pa]."""

    @property
    def specific(self) -> float:
        """Specific wear rate k = K/H of V = k F s [1/Pa], which is m^3/(N m)."""
        return self.coefficient / self.hardness


def wear_pairs() -> list[tuple[str, str]]:
    """Pairs that `wear_pair` knows: the body that wears, the one it slides on."""
    return [(p["bodies"][0], p["bodies"][1]) for p in shipped_table(__file__, "wear")["pair"]]


def wear_pair(worn: str, counterface: str) -> WearPair:
    """Archard coefficients of a body that wears on its counterface, an order of magnitude.

    Raises:
        MissingName: no such pair; the message lists those there are.
    """
    for pair in shipped_table(__file__, "wear")["pair"]:
        if pair["bodies"] == [_word(worn), _word(counterface)]:
            first, second = pair["bodies"]
            return WearPair((first, second), pair["coefficient"], pair["hardness"])
    raise MissingName("pair", f"{worn} on {counterface}", (" on ".join(p) for p in wear_pairs()))


@dataclass(frozen=True)
class Oil:
    """A lubricating oil, whose viscosity falls with temperature by Walther's equation.

    log log(nu/(mm^2/s) + 0.7) is linear in log T (ASTM D341), through the viscosities at 40 and
    100 C: an interpolation between, an extrapolation beyond.

    Raises:
        JointplayError: a value that is not positive, or an oil that thickens when heated.
    """

    name: str
    kinematic_40: Quantity = quantity("m^2/s", above=0.0, label="kinematic viscosity at 40 C")
    """Kinematic viscosity nu at 40 C [m^2/s]."""
    kinematic_100: Quantity = quantity("m^2/s", above=0.0, label="kinematic viscosity at 100 C")
    """Kinematic viscosity nu at 100 C [m^2/s]."""
    density_40: Quantity = quantity("kg/m^3", default=870.0, above=0.0, label="density")
    """Density rho at 40 C [kg/m^3]."""
    expansion: Quantity = quantity("1/K", default=7e-4)
    """Relative decrease of the density per temperature [1/K]."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.kinematic_100 >= self.kinematic_40:
            raise JointplayError(
                f"oil {self.name!r} must be thinner at 100 C than at 40 C, got "
                f"{self.kinematic_100:g} and {self.kinematic_40:g} m^2/s"
            )

    def kinematic_viscosity(self, celsius: float) -> float:
        """Kinematic viscosity nu at a temperature [m^2/s].

        Raises:
            JointplayError: no temperature, or one at which the oil is thinner than 2 mm^2/s or
                infinitely thick, where the equation does not hold.
        """
        kelvin = require_finite("temperature", celsius, "C") + ZERO_CELSIUS
        if kelvin <= 0.0:
            raise JointplayError(f"temperature must be above -273.15 C, got {celsius:g} C")
        cold, hot = (
            math.log(math.log(1e6 * nu + 0.7)) for nu in (self.kinematic_40, self.kinematic_100)
        )
        low, high = math.log(ZERO_CELSIUS + 40.0), math.log(ZERO_CELSIUS + 100.0)
        level = cold + (hot - cold) * (math.log(kelvin) - low) / (high - low)
        inner = math.exp(min(level, 700.0))
        nu = 1e-6 * (math.exp(inner) - 0.7) if inner < 50.0 else math.inf
        if not THINNEST * (1.0 - 1e-9) <= nu < math.inf:
            raise JointplayError(
                f"viscosity of oil {self.name!r} at {celsius:g} C is out of the range of ASTM "
                "D341, 2 mm^2/s and more"
            )
        return nu

    def density(self, celsius: float) -> float:
        """Density rho at a temperature, linear about 40 C [kg/m^3]."""
        celsius = require_finite("temperature", celsius, "C")
        return self.density_40 * (1.0 - self.expansion * (celsius - 40.0))

    def viscosity(self, celsius: float) -> float:
        """Dynamic viscosity eta = rho nu [Pa s]; it raises as `kinematic_viscosity`."""
        return self.density(celsius) * self.kinematic_viscosity(celsius)


def oils() -> list[str]:
    """Names that `oil` knows."""
    return [f"iso-vg-{grade}" for grade, _ in shipped_table(__file__, "oils")["grades"]]


def oil(name: str) -> Oil:
    """The oil of an ISO viscosity grade, such as ``ISO VG 46`` or ``iso-vg-46``.

    Raises:
        MissingName: no such oil; the message lists those there are.
    """
    require_a("name", name, "str")
    if _word(name) not in oils():
        raise MissingName("oil", name, oils())
    table = shipped_table(__file__, "oils")
    grade, hot = table["grades"][oils().index(_word(name))]
    return Oil(_word(name), 1e-6 * grade, 1e-6 * hot, table["density"], table["expansion"])
