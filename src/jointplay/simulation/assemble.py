"""From a mechanism to what the kernels know of it, and whether it can be stepped at all."""

from __future__ import annotations

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.model.impact import REFERENCE_SPEED, contact_duration, effective_mass, tooth_duration
from jointplay.model.mechanism import Mechanism
from jointplay.physics import kernel
from jointplay.physics.contact import elastic, resultant
from jointplay.physics.contact.compiled import address, check_parameters
from jointplay.physics.contact.law import Law
from jointplay.physics.kernel import layout
from jointplay.physics.kernel.sites import JointSite

MIN_CONTACT_STEPS = 4.0
"""Fewer steps in an impact than this and the step is refused.

At 4 steps the restitution of an impact scatters by 0.03 (0.07 at c_e = 0.5), at 2 an impact can
gain energy (docs/validation.md).
"""

NO_MASS = 1e-9
"""Part of the mechanism's mass below which what a contact meets counts as no mass."""

FILM_LAG = 0.5
"""Part of the effective mass that a film's lag reckons with: it may fall on the way."""

REST_SPEED = 0.05
"""Part of the speed of an impact that would store what a contact at rest stores, to which its
damping is referred.

Smaller, and explicit steps cannot follow the damper that a resting contact is; larger, and it
reaches into what moves: the restitution of an impact is left as it is while the mass that it meets
is below 1/REST_SPEED^2 = 400 times the smallest one of the start (docs/theory.md, section 5).
"""


LARGEST_TURN = 1.0
"""Step times natural frequency on a preloaded bearing above which it is refused [rad]."""


def joint_site(mechanism: Mechanism, name: str, q: np.ndarray) -> JointSite:
    """The joint with clearance `name` as the kernels have it; q is that of the start."""
    joint = mechanism.clearance[name]
    mass = effective_mass(mechanism, name, q)
    record = np.zeros(1, layout.JOINT)
    parameters = np.zeros((len(joint.contacts), layout.MAX_PARAMETERS))
    for contact, row in enumerate(parameters):
        _fill(row, joint.normal, joint.normal.parameters(joint.contact_properties(contact)))
    _fill(record["friction_parameters"][0], joint.friction, joint.friction.parameters())
    record["normal_law"], record["friction_law"] = address(joint.normal), address(joint.friction)
    record["bristles"] = joint.friction.bristles
    record["shape"], record["count"] = int(joint.shape), len(joint.contacts)
    if joint.resultant is not None:
        record["resultant"], record["element_law"] = 1, elastic.address(joint.law)
        record["cage"] = joint.resultant[resultant.CAGE]
    record["wearing"] = len(joint.wear.widths) if joint.wear else 0
    record["limit"] = -joint.depth_limit
    record["rest_mass"] = mass / REST_SPEED**2
    if joint.film is not None:
        law, properties = joint.film
        _fill(record["film_parameters"][0], law, law.parameters(properties))
        record["film_law"] = address(law)
        record["must_not_touch"] = 0 if law.hybrid else properties.contacts
        record["sections"] = properties.contacts
        record["section"] = law.section * properties.length if properties.tilts else 0.0
        record["clearance"] = properties.clearance
        record["thinnest"] = law.thickest(properties.clearance)
        record["transition"] = law.transition
        record["lag_mass"] = FILM_LAG * mass
    holds = joint.law in resultant.HOLDING
    if mechanism.has_virtual_link(name):
        record["first"] = mechanism.virtual_link(name)
        return JointSite(record, parameters, joint.dimensions, holds)
    record["first"] = layout.NO_VIRTUAL_LINK
    carriers = mechanism.frames(name)
    return JointSite(record, parameters, joint.dimensions, holds, carriers, mechanism.signs(name))


def _fill(row: np.ndarray, law: Law, parameters: tuple[float, ...]) -> None:
    row[: len(parameters)] = check_parameters(parameters, law.name)


def _link_masses(mechanism: Mechanism, name: str) -> str:
    sides = [index for index, _ in mechanism.frames(name)]
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


def _check_step_follows(mechanism: Mechanism, name: str, step: float, q: np.ndarray) -> None:
    """Refuse a step [s] too large for the swing on springs or on a preloaded bearing."""
    joint = mechanism.clearance[name]
    assert joint.resultant is not None
    centred = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    found = elastic.answers(joint.law, joint.resultant, centred[None])[0]
    stiffness = found[resultant.TANGENT : resultant.ANSWERS].reshape(6, 6)
    jacobian = mechanism.relative_jacobian(name, q)
    squares = np.linalg.eigvals(
        jacobian @ mechanism.inverse_mass_matrix(q) @ jacobian.T @ stiffness
    ).real
    frequency = float(np.sqrt(max(squares.max(), 0.0)))
    if frequency * step > LARGEST_TURN:
        raise JointplayError(
            f"step {step:g} s is too large for the stiffness of {name!r}: what it carries "
            f"would swing at {frequency / (2.0 * np.pi):.3g} Hz, so take at most "
            f"{LARGEST_TURN / frequency:.2g} s, or a tolerance",
            where=("step",),
        )


def check_step(mechanism: Mechanism, mass_of_all: float, step: float | None, q: np.ndarray) -> None:
    """Refuse contacts that meet no mass, and a step [s] too large for an impact; None: steps are
    chosen by their error, and none is too large.
    """
    for name in mechanism.clearance:
        mass = effective_mass(mechanism, name, q)
        if not mass >= NO_MASS * mass_of_all:
            raise JointplayError(
                f"a contact in joint {name!r} would meet a mass of {mass:.2g} kg only, of "
                f"{mass_of_all:.3g} kg in all: {_link_masses(mechanism, name)}; give the "
                "lighter one more mass or inertia in the URDF"
            )
        if step is None:
            continue
        joint = mechanism.clearance[name]
        if joint.resultant is not None:
            _check_step_follows(mechanism, name, step, q)
        if joint.law in resultant.HOLDING:  # nothing hits
            continue
        impact = f"the contact stiffness at {name!r}: an impact at {REFERENCE_SPEED:g} m/s"
        _check_step_resolves(step, contact_duration(mechanism, name, q), impact)
    for name in mechanism.gears:
        if step is None:
            continue
        impact = f"the stiffness of the gear at {name!r}: an impact of its teeth"
        _check_step_resolves(step, tooth_duration(mechanism, name, q), impact)


def _check_step_resolves(step: float, duration: float, impact: str) -> None:
    if duration < MIN_CONTACT_STEPS * step:
        raise JointplayError(
            f"step {step:g} s is too large for {impact} lasts {duration:.2g} s, so take at most "
            f"{duration / kernel.WELL_RESOLVED_STEPS:.2g} s",
            where=("step",),
        )
