"""What joints have in common whose journal and bearing are round: one radial clearance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jointplay.contact import ContactProperties
from jointplay.fields import quantity
from jointplay.joints.base import VIRTUAL_LINK, Clearance
from jointplay.joints.dimensions import complete

SAMPLES = 72
"""Azimuths at which contact directions are sampled."""


@dataclass(frozen=True, kw_only=True)
class RoundClearance(Clearance):
    """A round journal of radius R_j in a round bearing of radius R_i (eqs 1, 11-13).

    Raises:
        JointplayError: a radius that is missing, not positive, contradictory or impossible.
    """

    in_the_bearing: ClassVar[Mapping[str, str]] = {"radial_clearance": "journal_radius"}

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
    def freedoms(self) -> tuple[str, ...]:
        """All six."""
        return VIRTUAL_LINK

    @property
    def drive_coordinate(self) -> str:
        """Yaw."""
        return "yaw"

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

    @property
    def clearances(self) -> dict[str, float]:
        """C_r [m]."""
        return {"radial_clearance": self.cr}

    def round_contact(self, stiffness: float | None = None, **lengths: float) -> ContactProperties:
        """Properties of a contact of the journal in its bearing.

        Args:
            stiffness: Hertz's [N/m^1.5]; None takes the joint's.
            lengths: what `ContactProperties` has of lengths [m].
        """
        return self.contact(
            stiffness or self.hertz_stiffness,
            bearing_radius=self.ri,
            journal_radius=self.rj,
            clearance=self.cr,
            **lengths,
        )


def azimuths() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Cosine, sine and zero at `SAMPLES` azimuths."""
    phi = np.linspace(0.0, 2.0 * np.pi, SAMPLES, endpoint=False)
    return np.cos(phi), np.sin(phi), np.zeros(SAMPLES)


def radial_directions(heights: Sequence[float]) -> np.ndarray:
    """Unit forces across the axis at these heights [m], and their moments, shape (n, 6)."""
    c, s, zero = azimuths()
    return np.concatenate([np.column_stack([c, s, zero, -h * s, h * c, zero]) for h in heights])


def upright(rotation: np.ndarray) -> np.ndarray:
    """The rotation (3, 3) with its axis turned back to z by the shortest way."""
    import pinocchio as pin  # not needed to check a scenario

    swing = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), rotation[:, 2])
    turned: np.ndarray = swing.toRotationMatrix().T @ rotation
    return turned
