"""The clearance joint: dimensions, materials and laws of one bearing (eqs 1-3, 11-13)."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field
from typing import Any

from jointplay.contact import (
    Ambrosio,
    ContactProperties,
    FrictionLaw,
    LankaraniNikravesh,
    NormalForceLaw,
    friction_law,
    normal_law,
)
from jointplay.errors import JointplayError, require_finite, require_positive


@dataclass(frozen=True)
class Material:
    """Elastic constants of a body in contact.

    The default is the paper's steel (Table 3).

    Raises:
        JointplayError: Young's modulus not positive, or Poisson's ratio outside (-1, 0.5].
    """

    young: float = 207e9
    """Young's modulus E [Pa]."""
    poisson: float = 0.3
    """Poisson's ratio nu."""

    def __post_init__(self) -> None:
        """Check both constants."""
        require_positive("Young's modulus", self.young, "Pa")
        if not -1.0 < require_finite("Poisson's ratio", self.poisson, "") <= 0.5:
            raise JointplayError(f"Poisson's ratio must lie in (-1, 0.5], got {self.poisson:g}")

    @property
    def compliance(self) -> float:
        """sigma = (1 - nu^2) / (pi E) of eq. 12 [1/Pa]."""
        return (1.0 - self.poisson**2) / (math.pi * self.young)


def _close(a: float, b: float) -> bool:
    return math.isclose(a, b, rel_tol=1e-6, abs_tol=1e-9)


@dataclass(frozen=True, kw_only=True)
class ClearanceJoint:
    """A journal of radius R_j and length L_j in a bearing of radius R_i and length L_i.

    Give the bearing and either the clearances or the journal; whatever is missing is derived
    from C_r = R_i - R_j (eq. 1) and C_a = (L_i - L_j)/2 (eqs 2, 3). Both may be given if they
    agree.

    Raises:
        JointplayError: a dimension that is missing, not positive, contradictory or impossible.
    """

    bearing_radius: float = 10e-3
    """R_i [m]; the standard of the clearance literature, the paper gives none."""
    bearing_length: float = 40e-3
    """L_i, between the end walls [m]; this project's choice, the paper gives none."""
    radial_clearance: float | None = None
    """C_r, radial, not diametral [m]."""
    axial_clearance: float | None = None
    """C_a, on each side [m]."""
    journal_radius: float | None = None
    """R_j [m]."""
    journal_length: float | None = None
    """L_j [m]."""
    bearing_material: Material = field(default_factory=Material)
    journal_material: Material = field(default_factory=Material)
    restitution: float = 0.9
    """Nominal coefficient of restitution c_e, in (0, 1]."""
    normal: NormalForceLaw = field(default_factory=LankaraniNikravesh)
    friction: FrictionLaw = field(default_factory=Ambrosio)
    stiffness: float | None = None
    """Hertz stiffness of the radial contacts [N/m^1.5]; None derives it by eq. 11.

    A linear law with a stiffness of its own uses neither this nor `axial_stiffness`.
    """
    axial_stiffness: float | None = None
    """Hertz stiffness of the axial contacts [N/m^1.5]; None takes the radial one.

    Eq. 13 has no meaning for a rim on a flat wall, and the paper uses one k for both.
    """

    def __post_init__(self) -> None:
        """Derive what is missing and refuse what cannot be."""
        require_positive("bearing radius", self.bearing_radius, "m")
        require_positive("bearing length", self.bearing_length, "m")
        self._complete("radial", "radius", 1.0)
        self._complete("axial", "length", 2.0)
        if not 0.0 < require_finite("restitution", self.restitution, "") <= 1.0:
            raise JointplayError(f"restitution must lie in (0, 1], got {self.restitution:g}")
        for name in ("stiffness", "axial_stiffness"):
            value = getattr(self, name)
            if value is not None:
                require_positive(name.replace("_", " "), value, "N/m^1.5")
        for name, kind in (("normal", NormalForceLaw), ("friction", FrictionLaw)):
            if not isinstance(getattr(self, name), kind):
                raise JointplayError(
                    f"{name} must be a {kind.__name__} such as jointplay.contact offers, "
                    f"got {getattr(self, name)!r}"
                )
        # A much shorter journal can tilt so far that one rim touches both sides of the bore at
        # once, and its single deepest point would jump (docs/theory.md).
        shortest = 2.0 * math.sqrt(self.rj * self.cr)
        if self.lj <= shortest:
            raise JointplayError(
                f"journal length {self.lj:g} m is too short for radial clearance {self.cr:g} m: "
                f"a rim would touch both sides of the bore; it must exceed {shortest:.3g} m"
            )

    def _complete(self, clearance: str, dimension: str, factor: float) -> None:
        play = getattr(self, f"{clearance}_clearance")
        outer = getattr(self, f"bearing_{dimension}")
        inner = getattr(self, f"journal_{dimension}")
        if play is None and inner is None:
            raise JointplayError(f"give the {clearance} clearance or the journal {dimension}")
        if play is not None:
            require_positive(f"{clearance} clearance", play, "m")
        if inner is not None:
            require_positive(f"journal {dimension}", inner, "m")
            if inner >= outer:
                raise JointplayError(
                    f"journal {dimension} {inner:g} m does not fit into the bearing's {outer:g} m"
                )
            if play is not None and not _close(outer - inner, factor * play):
                raise JointplayError(
                    f"{clearance} clearance {play:g} m contradicts the dimensions: bearing "
                    f"{outer:g} m and journal {inner:g} m give {(outer - inner) / factor:g} m"
                )
        if play is None:
            play = (outer - inner) / factor
        if inner is None:
            inner = outer - factor * play
        if inner <= 0.0:
            raise JointplayError(
                f"{clearance} clearance {play:g} m leaves no journal in a bearing of "
                f"{dimension} {outer:g} m"
            )
        object.__setattr__(self, f"{clearance}_clearance", float(play))
        object.__setattr__(self, f"journal_{dimension}", float(inner))

    @property
    def ri(self) -> float:
        """R_i [m]."""
        return self.bearing_radius

    @property
    def li(self) -> float:
        """L_i [m]."""
        return self.bearing_length

    @property
    def rj(self) -> float:
        """R_j [m]."""
        assert self.journal_radius is not None
        return self.journal_radius

    @property
    def lj(self) -> float:
        """L_j [m]."""
        assert self.journal_length is not None
        return self.journal_length

    @property
    def cr(self) -> float:
        """C_r [m] (eq. 1)."""
        assert self.radial_clearance is not None
        return self.radial_clearance

    @property
    def ca(self) -> float:
        """C_a [m] (eq. 3)."""
        assert self.axial_clearance is not None
        return self.axial_clearance

    @property
    def hertz_stiffness(self) -> float:
        """k of eqs 11-13, or the given `stiffness` [N/m^1.5]."""
        if self.stiffness is not None:
            return self.stiffness
        radius = self.ri * self.rj / self.cr
        compliance = self.bearing_material.compliance + self.journal_material.compliance
        return 4.0 / (3.0 * math.pi * compliance) * math.sqrt(radius)

    @property
    def radial_contact(self) -> ContactProperties:
        """What the normal-force law needs to know of the radial contacts."""
        return ContactProperties(self.hertz_stiffness, self.restitution)

    @property
    def axial_contact(self) -> ContactProperties:
        """What the normal-force law needs to know of the axial contacts."""
        stiffness = self.axial_stiffness or self.hertz_stiffness
        return ContactProperties(stiffness, self.restitution)

    def describe(self) -> dict[str, Any]:
        """All fields as plain data, for result files; `from_description` reads it back."""
        fields = {key: getattr(self, key) for key in self.__dataclass_fields__}
        for key in ("bearing_material", "journal_material"):
            fields[key] = asdict(fields[key])
        for key in ("normal", "friction"):
            fields[key] = fields[key].describe()
        return fields

    @classmethod
    def from_description(cls, description: dict[str, Any]) -> ClearanceJoint:
        """Build the joint that `describe` described."""
        fields = dict(description)
        for key in ("bearing_material", "journal_material"):
            fields[key] = Material(**fields[key])
        fields["normal"] = normal_law(fields["normal"])
        fields["friction"] = friction_law(fields["friction"])
        return cls(**fields)
