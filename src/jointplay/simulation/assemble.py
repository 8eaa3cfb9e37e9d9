"""From a mechanism to what the kernels know of it, and whether it can be stepped at all."""

from __future__ import annotations

from typing import Any

import numpy as np

from jointplay import kernel
from jointplay.contact.compiled import address, check_parameters
from jointplay.errors import JointplayError
from jointplay.kernel.workspace import ContactSite, FilmSite
from jointplay.mechanism.impact import (
    REFERENCE_SPEED,
    contact_duration,
    effective_mass,
    tooth_duration,
)
from jointplay.mechanism.mechanism import Mechanism

MIN_CONTACT_STEPS = 4.0
"""Fewer steps in an impact than this and the step is refused.

At 4 steps the restitution of an impact scatters by 0.03 (0.07 at c_e = 0.5), at 2 an impact can
gain energy (docs/validation.md).
"""

NO_MASS = 1e-9
"""Part of the mechanism's mass below which what a contact meets counts as no mass."""

FILM_LAG = 0.5
"""Part of the effective mass that a film's lag reckons with: it may fall on the way."""


def contact_site(mechanism: Mechanism, name: str, q: np.ndarray) -> ContactSite:
    """What the kernels must know of the joint with clearance `name`.

    Args:
        mechanism: whose joint it is.
        name: of the joint.
        q: configuration at the start, shape (nq,).
    """
    joint = mechanism.clearance[name]
    parameters = [
        check_parameters(joint.normal.parameters(joint.contact_properties(k)), joint.normal.name)
        for k in range(len(joint.contacts))
    ]
    rubbing = check_parameters(joint.friction.parameters(), joint.friction.name)
    first = mechanism.virtual_link(name) if mechanism.has_virtual_link(name) else None
    reach: dict[str, Any] = {}
    if first is None:
        reach = {
            "carriers": (mechanism.bearing_frame(name), mechanism.journal_frame(name)),
            "signs": mechanism.signs(name),
        }
    if joint.film is not None:
        law, properties = joint.film
        reach["film"] = FilmSite(
            address(law),
            properties.contacts,
            law.section * properties.length if properties.tilts else 0.0,
            properties.clearance,
            law.thickest(properties.clearance),
            law.transition,
            FILM_LAG * effective_mass(mechanism, name, q),
            check_parameters(law.parameters(properties), law.name),
        )
        reach["must_not_touch"] = 0 if law.hybrid else properties.contacts
    reach["wearing"] = len(joint.worn_widths) if joint.wears else 0
    return ContactSite(
        int(joint.shape),
        joint.dimensions,
        joint.depth_limit,
        address(joint.normal),
        address(joint.friction),
        joint.friction.bristles,
        parameters,
        rubbing,
        first,
        **reach,
    )


def _beside(mechanism: Mechanism, name: str) -> str:
    """The two links of a joint with clearance, with their masses."""
    sides = mechanism.bearing_frame(name)[0], mechanism.journal_frame(name)[0]
    if name in mechanism.loops:
        loop = mechanism.loops[name]
        links = (loop.bearing_link, loop.journal_link)
    else:
        entry = mechanism.description.joints[name]
        links = (entry.parent, entry.child)
    if mechanism.clearance[name].exchanged:
        sides = sides[::-1]
    masses = [float(mechanism.model.inertias[index].mass) for index in sides]
    return " and ".join(
        f"link {link!r} belongs to the ground" if index == 0 else f"link {link!r} has {mass:.2g} kg"
        for link, index, mass in zip(links, sides, masses, strict=True)
    )


def check_step(mechanism: Mechanism, mass_of_all: float, step: float, q: np.ndarray) -> None:
    """Refuse a step [s] too large for an impact, and contacts that meet no mass."""
    for name in mechanism.clearance:
        mass = effective_mass(mechanism, name, q)
        if not mass >= NO_MASS * mass_of_all:
            raise JointplayError(
                f"a contact in joint {name!r} would meet a mass of {mass:.2g} kg only, of "
                f"{mass_of_all:.3g} kg in all: {_beside(mechanism, name)}; give the lighter one "
                "more mass or inertia in the URDF"
            )
        impact = f"the contact stiffness at {name!r}: an impact at {REFERENCE_SPEED:g} m/s"
        _require_short(step, contact_duration(mechanism, name, q), impact)
    for name in mechanism.gears:
        impact = f"the stiffness of the gear at {name!r}: an impact of its teeth"
        _require_short(step, tooth_duration(mechanism, name, q), impact)


def _require_short(step: float, duration: float, impact: str) -> None:
    """Refuse a step in which an impact passes unseen."""
    if duration < MIN_CONTACT_STEPS * step:
        raise JointplayError(
            f"step {step:g} s is too large for {impact} lasts {duration:.2g} s, so take at most "
            f"{duration / kernel.WELL_RESOLVED_STEPS:.2g} s",
            where=("step",),
        )
