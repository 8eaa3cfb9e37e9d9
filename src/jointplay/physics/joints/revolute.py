"""The revolute joint with clearance: a journal in a bearing (eqs 1-3, 11-13)."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

from jointplay.base.errors import JointplayError, require_numbers, require_positive, within
from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.base.units import readable
from jointplay.physics import geometry
from jointplay.physics.contact import ContactProperties, FilmLaw, FilmProperties
from jointplay.physics.geometry import Shape
from jointplay.physics.joints import base

LEAST_AZIMUTHS = 16
"""Least number of azimuths of a worn profile."""


@dataclass(frozen=True, kw_only=True)
class RevoluteClearance(base.RoundClearance):
    """A journal of radius R_j and length L_j in a bearing of radius R_i and length L_i.

    Give the bearing and either the clearances or the journal; the others are derived from
    C_r = R_i - R_j (eq. 1) and C_a = (L_i - L_j)/2 (eqs 2, 3). Both may be given if they agree. An
    axial clearance that is not given equals the radial one. Without end walls (`lock_axial` or
    `open_ends`) the journal is as long as the bearing unless its length is given.

    Raises:
        JointplayError: a dimension that is missing, not positive, contradictory or impossible.
    """

    kind: ClassVar[str] = "revolute"
    replaces: ClassVar[tuple[str, ...]] = ("revolute", "continuous")
    ideal_freedoms: ClassVar[tuple[str, ...]] = ("yaw",)
    clearance_fields: ClassVar[Mapping[str, str | None]] = {
        "radial_clearance": "journal_radius",
        "axial_clearance": "journal_length",
    }

    bearing_length: Quantity = quantity("m", default=40e-3, above=0.0, label="bearing length")
    """Bearing length L_i between the end walls [m]."""
    axial_clearance: OptionalQuantity = quantity("m", default=None, label="axial clearance")
    """Axial clearance C_a on each side [m]; if neither it nor the journal length is given, C_r;
    0 is `lock_axial`."""
    journal_length: OptionalQuantity = quantity("m", default=None, label="journal length")
    """Journal length L_j [m]."""
    axial_stiffness: OptionalQuantity = quantity(
        "N/m^1.5", default=None, above=0.0, label="axial stiffness"
    )
    """Hertz stiffness of the axial contacts [N/m^1.5]; if not given, the radial one."""
    lock_tilt: bool = False
    """The axes stay parallel: one radial contact along the whole journal, axial contact of faces.
    """
    lock_axial: bool = False
    """The journal does not move along the bearing's axis, and touches no end wall."""
    open_ends: bool = False
    """No end walls; a run ends when the journal has left the bearing."""
    lubricant: FilmLaw | None = None
    """Oil between journal and bore; None for a dry joint. End walls stay dry."""
    wear_rate: OptionalQuantity = quantity("m^3/(N*m)", default=None, above=0.0, label="wear rate")
    """Specific wear rate of the bearing K/H [m^3/(N m)]; None: it does not wear."""
    journal_wear_rate: OptionalQuantity = quantity(
        "m^3/(N*m)", default=None, above=0.0, label="wear rate of the journal"
    )
    """Specific wear rate of the journal K/H [m^3/(N m)]; None: it does not wear."""
    worn: Sequence[float] | Sequence[Sequence[float]] | None = quantity("m", default=None)
    """Depth of wear of the bore at equal azimuths from the bearing's x axis [m].

    At least `LEAST_AZIMUTHS` of them; two rows, for ends A and B of the bore, or one for both.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.walls and self.axial_clearance is None and self.journal_length is None:
            object.__setattr__(self, "axial_clearance", self.cr)
        if self.axial_clearance == 0.0 and self.walls:
            object.__setattr__(self, "lock_axial", True)
        # Zero without walls was derived below: a result's description is being read back.
        if self.walls or self.axial_clearance:
            sizes = self.axial_clearance, self.bearing_length, self.journal_length
            lengths = base.complete(*sizes, 2.0, ("axial", "length"))
        else:
            length = self.bearing_length if self.journal_length is None else self.journal_length
            require_positive("journal length", length, "m", ("journal_length",))
            if length > self.bearing_length:
                raise JointplayError(
                    f"journal length {readable(length, 'm')} exceeds the bearing's "
                    f"{readable(self.bearing_length, 'm')}: "
                    "its rims would not touch the bore; exchange the roles of the two bodies",
                    where=("journal_length",),
                )
            lengths = ((self.bearing_length - length) / 2.0, length)
        object.__setattr__(self, "axial_clearance", lengths[0])
        object.__setattr__(self, "journal_length", lengths[1])
        if self.lubricant is not None:
            if not isinstance(self.lubricant, FilmLaw):
                raise JointplayError(
                    "lubricant must be a FilmLaw such as jointplay.physics.contact offers, "
                    f"got {self.lubricant!r}",
                    where=("lubricant",),
                )
            if not self.ideal:
                with within("lubricant"):
                    self.lubricant.thickest(self.cr)
        if self.worn is not None:
            with within("worn"):
                object.__setattr__(self, "worn", self._checked_profile(self.worn))
        # A much shorter journal can tilt so far that one rim touches both sides of the bore at
        # once, and its single deepest point would jump (docs/theory.md).
        shortest = 2.0 * math.sqrt(self.rj * self.cr)
        if not self.lock_tilt and self.lj <= shortest:
            raise JointplayError(
                f"journal length {readable(self.lj, 'm')} is too short for radial clearance "
                f"{readable(self.cr, 'm')}: "
                f"a rim would touch both sides of the bore; it must exceed {shortest:.3g} m",
                where=("journal_length",),
            )

    def _checked_profile(self, worn: object) -> tuple[tuple[float, ...], ...]:
        """The worn profile, checked: one row if the journal cannot tilt, else two."""
        rows = 1 if self.lock_tilt else 2
        depths = np.atleast_2d(require_numbers("the worn profile", worn))
        if depths.ndim != 2 or len(depths) not in (1, rows) or depths.shape[1] < LEAST_AZIMUTHS:
            raise JointplayError(
                f"the worn profile has the shape {depths.shape}; it must be (n,)"
                f"{'' if rows == 1 else ' or (2, n)'} with n >= {LEAST_AZIMUTHS} azimuths"
            )
        if not (np.isfinite(depths).all() and depths.min() >= 0.0):
            raise JointplayError("the worn profile must be finite depths >= 0 [m]")
        if depths.max() > 0.1 * self.rj:
            raise JointplayError(
                f"the worn profile is up to {readable(depths.max(), 'm')} deep; more than a tenth "
                f"of the journal's radius {readable(self.rj, 'm')} is not a bearing any more"
            )
        if self.lubricant is not None:
            raise JointplayError(
                "film laws are for round bores: leave out the lubricant or the worn profile"
            )
        return tuple(map(tuple, np.broadcast_to(depths, (rows, depths.shape[1])).tolist()))

    @classmethod
    def planar(cls, **fields: object) -> RevoluteClearance:
        """The planar joint of the literature: tilt and axial motion locked, one radial contact."""
        return cls(lock_tilt=True, lock_axial=True, **fields)  # type: ignore[arg-type]

    @property
    def summary(self) -> str:
        return (
            f"radial {readable(self.cr, 'm')}{self._limits}, axial {readable(self.ca, 'm')}, "
            f"bearing {2e3 * self.ri:g} x {1e3 * self.li:g} mm"
        )

    @property
    def walls(self) -> bool:
        """Whether the journal can touch end walls."""
        return not (self.open_ends or self.lock_axial)

    @property
    def engaged_within(self) -> float:
        open_ended = self.open_ends and not self.lock_axial
        return 0.5 * (self.li + self.lj) if open_ended else math.inf

    @property
    def li(self) -> float:
        """Bearing length L_i [m]."""
        return self.bearing_length

    @property
    def lj(self) -> float:
        """Journal length L_j [m]."""
        assert self.journal_length is not None
        return self.journal_length

    @property
    def ca(self) -> float:
        """Axial clearance C_a [m] (eq. 3)."""
        assert self.axial_clearance is not None
        return self.axial_clearance

    @property
    def radial_contact(self) -> ContactProperties:
        """Properties of the radial contacts for the normal-force law.

        The contact of one rim stands for half of the journal's length, one along it for the whole.
        """
        length = self.lj if self.lock_tilt else self.lj / 2
        return self.round_contact(journal_length=self.lj, contact_length=length)

    @property
    def axial_contact(self) -> ContactProperties:
        """Properties of the axial contacts for the normal-force law."""
        return self.round_contact(self.axial_stiffness, journal_length=self.lj, contact_length=0.0)

    def contact_properties(self, contact: int) -> ContactProperties:
        radial = self.contacts[contact].startswith("radial")
        return self.radial_contact if radial else self.axial_contact

    @property
    def film(self) -> tuple[FilmLaw, FilmProperties] | None:
        if self.lubricant is None:
            return None
        return self.lubricant, FilmProperties(self.cr, self.rj, self.lj, len(self._worn_widths))

    @property
    def hinge(self) -> base.Hinge:
        axial = self.ca if self.walls else 0.0
        return base.Hinge(self.rj, self.lj, not self.lock_tilt, self.cr, axial)

    @property
    def wear(self) -> base.Wear | None:
        rates = self.wear_rate or 0.0, self.journal_wear_rate or 0.0
        if not any(rates):
            return None
        profile = None if self.worn is None else np.array(self.worn)
        return base.Wear(rates, self.ri, self.rj, self._worn_widths, profile)

    def with_worn(self, profile: np.ndarray) -> Self:
        return replace(self, worn=profile.tolist())

    @property
    def _worn_widths(self) -> tuple[float, ...]:
        """Length of the bore that each radial contact wears: the journal's, or half of it [m]."""
        return (self.lj,) if self.lock_tilt else (self.lj / 2, self.lj / 2)

    @property
    def shape(self) -> Shape:
        if self.worn is not None:
            return Shape.WORN_ALIGNED_CYLINDER if self.lock_tilt else Shape.WORN_CYLINDER
        return Shape.ALIGNED_CYLINDER if self.lock_tilt else Shape.CYLINDER

    @property
    def dimensions(self) -> tuple[float, ...]:
        rows = [] if self.worn is None else [geometry.worn_bore(row) for row in np.array(self.worn)]
        return self.ri, self.rj, self.li / 2, self.lj / 2, *(x for row in rows for x in row)

    @property
    def contacts(self) -> tuple[str, ...]:
        radial = ("radial",) if self.lock_tilt else ("radial_A", "radial_B")
        return radial + (("axial_A", "axial_B") if self.walls else ())

    @property
    def contact_clearances(self) -> tuple[float, ...]:
        return tuple(self.cr if name.startswith("radial") else self.ca for name in self.contacts)

    @property
    def freedoms(self) -> tuple[str, ...]:
        locked = ("z",) * self.lock_axial + ("pitch", "roll") * self.lock_tilt
        return tuple(name for name in base.VIRTUAL_LINK if name not in locked)

    @property
    def outline(self) -> base.Outline:
        return base.Outline(
            "cylinder",
            (self.rj, self.rj, self.lj / 2),
            (self.cr, self.cr, 0.0 if self.lock_axial else self.ca),
            self.walls,
            tuple(self.worn or ()),  # type: ignore[arg-type]
        )

    @property
    def travel(self) -> dict[str, float]:
        return super().travel | ({} if self.walls else {"z": self.li})

    @property
    def clearances(self) -> dict[str, float]:
        return super().clearances if self.walls else {"radial_clearance": self.cr}
