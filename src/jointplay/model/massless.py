"""Motions without inertia: the null space of the mass matrix, in which nothing determines motion.

A joint that moves a link without mass or inertia makes the mass matrix singular. The matrix is
scaled to a unit diagonal, since its entries have different units; eigenvalues that are zero are
motions that cost no energy.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.model.inertias import inertia_faults
from jointplay.model.vocabulary import as_option

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

_NO_INERTIA = 1e-12
"""Entry on the mass matrix's diagonal up to which it counts as zero [kg m^2 or kg]."""
_SINGULAR = 1e-13
"""Eigenvalue of the mass matrix, its diagonal scaled to 1, up to which it counts as zero."""
_STILL = 1e-6
"""Motion, relative to the fastest coordinate, up to which it counts as none [1, m or 1/m]."""


def massless_motions(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Motions that cost no kinetic energy, one a column, shape (nv, n); none if all have inertia.

    Raises:
        JointplayError: nothing can move, or a motion has negative energy, of links with inertias
            that no body has.
    """
    model = mechanism.model
    if not model.nv:
        raise JointplayError("nothing can move: the mechanism has no joint that is not fixed")
    mass = mechanism.mass_matrix(q)
    diagonal = mass.diagonal()
    bare = diagonal <= _NO_INERTIA  # cannot be scaled: each is a motion by itself
    scale = np.where(bare, 0.0, 1.0 / np.sqrt(np.where(bare, 1.0, diagonal)))
    values, vectors = np.linalg.eigh(mass * np.outer(scale, scale) + np.diag(bare * 1.0))
    if values[0] < -_SINGULAR or diagonal.min() < -_NO_INERTIA:
        direction = scale * vectors[:, 0] if values[0] < -_SINGULAR else diagonal == diagonal.min()
        raise JointplayError(_negative(mechanism, q, direction.astype(float)))
    motions = [scale * vector for vector in vectors.T[values <= _SINGULAR]]
    motions += list(np.eye(model.nv)[bare])
    return np.array([motion / np.abs(motion).max() for motion in motions]).reshape(-1, model.nv).T


def _negative(mechanism: Mechanism, q: np.ndarray, motion: np.ndarray) -> str:
    """Message on a motion (nv,) of negative energy: the links in it with negative moments."""
    moved = massless_links(mechanism, q, motion[:, None])
    inertias = inertia_faults(mechanism.description.elements())
    faults = [fault.partition(";")[0] for link, fault in inertias.items() if link in moved]
    faults = [fault for fault in faults if "positive" in fault]
    names = [mechanism.coordinates[i] for i in np.flatnonzero(np.abs(motion) > _STILL)]
    return (
        f"the mass matrix is indefinite, {', '.join(names)} would move with negative energy: "
        f"{'; '.join(faults) or 'see the inertias of the links'}; that was allowed, but only "
        "jointplay budget works with it: correct it"
    )


def massless_links(mechanism: Mechanism, q: np.ndarray, motions: np.ndarray) -> dict[str, str]:
    """Links that move in any of the motions (nv, n), with the URDF joint that moves each."""
    model, data = mechanism.model, mechanism.data
    if not motions.size:
        return {}
    pin.computeJointJacobians(model, data, q)
    links = {}
    for name, entry in mechanism.description.joints.items():
        if not model.existJointName(name):
            continue
        local = pin.getJointJacobian(model, data, model.getJointId(name), pin.ReferenceFrame.LOCAL)
        if np.abs(local.reshape(6, model.nv) @ motions).max() > _STILL:
            links[entry.child] = name
    return links


def require_inertia(mechanism: Mechanism, q: np.ndarray) -> None:
    """Raise unless all motions have inertia.

    Raises:
        JointplayError: some have none; the message names their links, gears or coordinates, and
            what would help.
    """
    motions = massless_motions(mechanism, q)
    if not motions.size:
        return
    links = massless_links(mechanism, q, motions)
    moving = np.flatnonzero(np.abs(motions).max(axis=1) > _STILL)
    parts = [mechanism.coordinates[i].joint for i in moving]
    play = [name for name in mechanism.clearance if name in parts]
    if not links:  # motors, or motions of which no joint of the URDF has more than a trace
        names = [mechanism.coordinates[i] for i in moving] or list(mechanism.coordinates)
        motors = [name.removesuffix(".motor") for name in names if name.endswith(".motor")]
        if motors:
            entries, gears = mechanism.description.joints, mechanism.gears
            rotors = (
                f"{gears[name].rotor_inertia:g} {'kg' if entries[name].slides else 'kg m2'}"
                for name in motors
            )
            raise JointplayError(
                f"{'the gear' if len(motors) == 1 else 'the gears'} of "
                f"{', '.join(map(repr, motors))} must have a larger rotor_inertia, got "
                f"{', '.join(rotors)}"
            )
        raise JointplayError(
            f"nothing that moves along {', '.join(names)} has mass or inertia to speak of beside "
            "the rest, so nothing says how it moves: give its links an <inertial> of their size"
        )
    single = len(links) == 1
    able = [name for name in links.values() if name not in mechanism.clearance]
    hold = f", or hold {'its joint' if single else 'their joints'} (--fix {as_option(able)})"
    when = f" when {', '.join(map(repr, play))} has clearance" if play else ""
    hold = hold if len(able) == len(links) else ""
    raise JointplayError(
        f"{'link' if single else 'links'} {', '.join(map(repr, links))} moved by joints "
        f"{'has' if single else 'have'} no mass or inertia to speak of, so nothing says how "
        f"{'it moves' if single else 'they move'}{when}: give "
        f"{'it' if single else 'each'} an <inertial> in the URDF{hold}; jointplay budget needs none"
    )
