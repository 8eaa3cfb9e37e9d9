"""What joints have in common whose journal and bearing are round: one radial clearance."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.fields import quantity
from jointplay.joints.base import Clearance, complete


@dataclass(frozen=True, kw_only=True)
class RoundClearance(Clearance):
    """A round journal of radius R_j in a round bearing of radius R_i (eqs 1, 11-13).

    Raises:
        JointplayError: a radius that is missing, not positive, contradictory or impossible.
    """

    bearing_radius: float = quantity("m", default=10e-3, above=0.0, words="bearing radius")
    """R_i [m]; the standard of the clearance literature, the paper gives none."""
    radial_clearance: float | None = quantity("m", default=None, words="radial clearance")
    """C_r, radial, not diametral [m]."""
    journal_radius: float | None = quantity("m", default=None, words="journal radius")
    """R_j [m]."""

    def __post_init__(self) -> None:
        """Derive what is missing and refuse what cannot be."""
        super().__post_init__()
        play, radius = complete(
            self.radial_clearance,
            self.bearing_radius,
            self.journal_radius,
            1.0,
            ("radial", "radius"),
        )
        object.__setattr__(self, "radial_clearance", play)
        object.__setattr__(self, "journal_radius", radius)

    @property
    def ri(self) -> float:
        """R_i [m]."""
        return self.bearing_radius

    @property
    def rj(self) -> float:
        """R_j [m]."""
        assert self.journal_radius is not None
        return self.journal_radius

    @property
    def cr(self) -> float:
        """C_r [m] (eq. 1)."""
        assert self.radial_clearance is not None
        return self.radial_clearance

    @property
    def radial_room(self) -> float:
        """C_r [m]."""
        return self.cr

    @property
    def half_width(self) -> float:
        """R_i [m]."""
        return self.ri

    @property
    def depth_limit(self) -> float:
        """A tenth of the journal's radius: far beyond what any contact law means."""
        return 0.1 * self.rj

    @property
    def hertz_stiffness(self) -> float:
        """k of eqs 11-13, or the given `stiffness` [N/m^1.5]."""
        if self.stiffness is not None:
            return self.stiffness
        return self.hertz(self.ri * self.rj / self.cr)
