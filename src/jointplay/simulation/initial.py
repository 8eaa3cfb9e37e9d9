"""The state in which a run begins."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from jointplay.errors import JointplayError, MissingName, require_finite
from jointplay.joints import VIRTUAL_LINK
from jointplay.mechanism.loop import assemble, consistent_velocity
from jointplay.mechanism.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

PERTURBATION = 0.5
"""Largest displacement of a perturbed journal at the start, relative to its clearances.

Nobody knows where in its bearing a journal rests when the motion begins. Much smaller
displacements are often forgotten: a journal wedged by the first stroke starts afresh.
"""


def initial_state(
    simulation: Simulation, mechanism: Mechanism, followed: Sequence[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Loops closed, journals centred or perturbed, and speeds that fit."""
    places, speeds = dict(simulation.start), dict(simulation.start_speed)
    for given, unit in ((places, "rad or m"), (speeds, "rad/s or m/s")):
        for name, value in given.items():
            if name not in mechanism.joints:
                raise MissingName("moving joint", name, mechanism.joints)
            if name in followed:
                raise JointplayError(
                    f"joint {name!r} follows the motion from its start; give no other"
                )
            given[name] = require_finite(f"start of joint {name!r}", value, unit)
    if simulation.motion is not None:
        position, velocity, _ = simulation.motion(np.zeros(1))
        for name in followed:
            index = simulation.motion.joints.index(name)
            places[name], speeds[name] = position[0, index], velocity[0, index]
    q = mechanism.configuration(places)
    v = mechanism.configuration(speeds)
    held, moving = (
        [i for name in given for i in (mechanism.coordinate(name), mechanism.motor(name))]
        for given in (places, speeds)
    )
    q = assemble(mechanism, q, held)
    if simulation.seed is not None:
        # A displaced journal moves the loop's other joints, also those whose start is given.
        leading = [i for n in followed for i in (mechanism.coordinate(n), mechanism.motor(n))]
        q = _perturbed(mechanism, q, leading, simulation.seed)
    led = [i for n in followed for i in (mechanism.coordinate(n), mechanism.motor(n))]
    return q, consistent_velocity(mechanism, q, v, moving, led)


def _perturbed(mechanism: Mechanism, q: np.ndarray, held: Sequence[int], seed: int) -> np.ndarray:
    random = np.random.default_rng(seed)
    offsets = {}
    for name, joint in mechanism.clearance.items():
        push = PERTURBATION * random.uniform(-1.0, 1.0, 3)
        rooms = np.array([joint.room_to_start.get(part, 0.0) for part in VIRTUAL_LINK[:3]])
        if name in mechanism.loops:
            free = mechanism.relative_jacobian(name, q)[:3].any(axis=1)
            offsets[name] = push * rooms * free
        else:
            for part, shift in zip(VIRTUAL_LINK[:3], push * rooms, strict=True):
                if part in joint.freedoms:
                    q[mechanism.coordinates.index(f"{name}.{part}")] += shift
    return assemble(mechanism, q, held, offsets)


def displace(mechanism: Mechanism, q: np.ndarray, distance: float) -> None:
    """Move every journal aside by `distance` along each axis [m]."""
    for name, joint in mechanism.clearance.items():
        if mechanism.has_virtual_link(name):
            for part in VIRTUAL_LINK[:3]:
                if part in joint.freedoms:
                    q[mechanism.coordinates.index(f"{name}.{part}")] += distance
        else:
            moves = mechanism.relative_jacobian(name, q)[:3]
            q += np.linalg.pinv(moves) @ np.full(3, distance)
