"""What some joints can do and others cannot: stand for a hinge, wear.

Each is a property of `Clearance`, None where the joint cannot. Whoever needs it asks for it, and
for no kind of joint by name.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Hinge:
    """A journal that turns about one axis, as one needs to know it who puts a hinge in its place.

    The axis is the bearing's z.
    """

    radius: float
    """Of the journal, at which friction about the axis acts [m]."""
    length: float
    """Of the journal [m]."""
    leans: bool
    """Whether it can tilt; it then touches at both ends."""
    lateral: float
    """How far it can be aside, either way [m]."""
    axial: float
    """How far it can go along the axis, either way [m]; zero where it cannot or nothing ends it."""


@dataclass(frozen=True)
class BoreWear:
    """How a bore wears, by contact from the first on: one for the whole journal, or one an end."""

    rate: float
    """Specific wear rate K/H [m^3/(N m)]."""
    radius: float
    """Of the bore [m]."""
    journal_radius: float
    """[m]."""
    widths: tuple[float, ...]
    """Length of the bore that each contact wears [m]."""
    profile: np.ndarray | None
    """Depth so far by contact, at equal azimuths from the bearing's x axis, (contacts, n) [m]."""
