"""Estimates of a single impact before a run: its depth, its duration, the time step that fits it.

A mass that meets a contact at some speed spends its kinetic energy in the normal force law at zero
rate: that gives the depth, and about three times depth over speed the duration. Damping is left
out.
"""

from __future__ import annotations

import ctypes
import math
from typing import Any

import numpy as np

from jointplay.base.compiler import compiled, pointer
from jointplay.base.errors import JointplayError, require_non_negative, require_positive
from jointplay.model.mechanism import Mechanism
from jointplay.physics.contact.bristle import BristleLaw
from jointplay.physics.contact.calls import call_normal
from jointplay.physics.contact.law import FrictionLaw, NormalForceLaw
from jointplay.physics.contact.machine_code import MAX_PARAMETERS, address, compiled_law
from jointplay.physics.kernel import WELL_RESOLVED_STEPS

REFERENCE_SPEED = 0.1
"""Approach speed for which the resolution of impacts is judged before a run [m/s]."""

REFERENCE_DEPTH = 1e-5
"""Depth at which a law is tried before a run: it must give a finite force [m]."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)  # exact to degree 23


@compiled
def _stored(law, parameters, depth, nodes, weights) -> float:
    """Elastic energy of the contact at one depth [J], by Gauss-Legendre quadrature."""
    energy, half = 0.0, 0.5 * depth
    if half > 0.0:
        for k in range(nodes.size):
            at = half * (1.0 + nodes[k])
            force = call_normal(law, (at, 0.0, 1.0, pointer(parameters.ctypes.data)))
            energy += half * weights[k] * force
    return energy


@compiled
def _elastic_energy(law, parameters, depth, nodes, weights, energy):
    for i in range(depth.size):
        energy[i] = _stored(law, parameters, depth[i], nodes, weights)


@compiled
def _depth_of(law, parameters, energy, nodes, weights) -> float:
    """Depth at which the contact stores an energy, by bisection [m]; inf if none does."""
    low, high = 0.0, 1e-9
    while _stored(law, parameters, high, nodes, weights) < energy:
        low, high = high, 2.0 * high
        if high > 1.0:  # a law without elastic part never stops the mass
            return math.inf
    for _ in range(50):
        middle = 0.5 * (low + high)
        if _stored(law, parameters, middle, nodes, weights) < energy:
            low = middle
        else:
            high = middle
    return high


def elastic_energy(law: NormalForceLaw, parameters: tuple[float, ...], depth: Any) -> np.ndarray:
    """Elastic energy of a contact [J] at depths [m] of any shape; 0 without contact.

    The integral of the law's force at zero rate over the depth.
    """
    depth = np.asarray(depth, float)
    flat = np.ascontiguousarray(depth).reshape(-1)
    energy = np.empty_like(flat)
    _elastic_energy(address(law), _row(parameters), flat, _NODES, _WEIGHTS, energy)
    return energy.reshape(depth.shape)


def _row(parameters: tuple[float, ...]) -> np.ndarray:
    return np.array(parameters or (0.0,), float)


def impact_depth(
    law: NormalForceLaw, parameters: tuple[float, ...], mass: float, speed: float
) -> float:
    """Depth [m] at which a mass [kg] that arrives at `speed` [m/s] stops, without damping.

    Raises:
        JointplayError: the law returns something that is not finite.
    """
    mass = require_non_negative("mass", mass, "kg")
    speed = require_non_negative("speed", speed, "m/s")
    energy = 0.5 * mass * speed**2
    if not np.isfinite(elastic_energy(law, parameters, REFERENCE_DEPTH)):
        name = getattr(law.function, "__name__", law.name)
        raise JointplayError(f"law {name!r} returns a non-finite force for a contact at rest")
    return float(_depth_of(address(law), _row(parameters), energy, _NODES, _WEIGHTS))


def impact_duration(
    law: NormalForceLaw, parameters: tuple[float, ...], mass: float, speed: float
) -> float:
    """Duration of an impact [s], by 3 depth/speed.

    The factor is 2.94 for Hertz's law (Goldsmith, Impact, 1960) and pi for a linear one.
    """
    depth = impact_depth(law, parameters, mass, require_positive("speed", speed, "m/s"))
    return 3.0 * depth / speed


def effective_mass(mechanism: Mechanism, joint: str, q: np.ndarray) -> float:
    """Smallest effective mass of the joint's contacts in configuration q [kg].

    It is 1 / (J M^-1 J^T), where J is the motion of journal against bearing along a contact's
    normal, over all `Clearance.directions`. Loops without clearance are left open, which makes it
    smaller.
    """
    inverse = mechanism.inverse_mass_matrix(q)
    jacobian = mechanism.relative_jacobian(joint, q)
    along = mechanism.clearance[joint].directions() @ jacobian
    softest = float(np.einsum("ki,ij,kj->k", along, inverse, along).max())
    if softest <= 0.0:
        raise JointplayError(f"joint {joint!r}: bearing and journal do not move at all")
    return 1.0 / softest


def tooth_duration(mechanism: Mechanism, joint: str, q: np.ndarray) -> float:
    """Duration of an impact of the teeth in a joint's gear, in configuration q [s].

    Half a period, pi sqrt(J / k), of the motor's inertia and the joint's smallest, in series, on
    the gear's spring where it is steepest. Loops without clearance are left open.
    """
    gear = mechanism.gears[joint]
    at = mechanism.coordinate(joint)
    mobility = float(mechanism.inverse_mass_matrix(q)[at, at])
    inertia = 1.0 / (1.0 / gear.rotor_inertia + mobility)
    return math.pi * math.sqrt(inertia / gear.steepest)


def friction_slope(law: FrictionLaw) -> float:
    """Steepest rise of the friction coefficient with the sliding speed [s/m], by sampling."""
    speeds = np.logspace(-6.0, 1.0, 1401)
    parameters = (ctypes.c_double * MAX_PARAMETERS)(*law.parameters())
    coefficient = compiled_law(law).ctypes
    mu = np.array([coefficient(speed, parameters) for speed in speeds])
    return float(max(np.max(np.diff(mu) / np.diff(speeds)), 0.0))


def friction_step_limit(
    mechanism: Mechanism, joint: str, q: np.ndarray, normal_force: float
) -> float:
    """Largest step at which friction under a lasting normal force [N] is stable [s].

    Where the coefficient rises with speed, friction is a damper of mu' F_n, which an explicit
    method follows only below 2 m / (mu' F_n) (docs/integrators.md). Bristles are a spring besides,
    and allow 2 sqrt(m/k). Infinite without friction.
    """
    law = mechanism.clearance[joint].friction
    spring = 0.0
    if isinstance(law, BristleLaw):
        spring, damper = law.stiffness(normal_force)
    else:
        damper = friction_slope(law) * normal_force
    if not (damper > 0.0 or spring > 0.0):
        return math.inf
    mass = effective_mass(mechanism, joint, q)
    slow = 2.0 * mass / damper if damper > 0.0 else math.inf
    return min(slow, 2.0 * math.sqrt(mass / spring) if spring > 0.0 else math.inf)


def contact_duration(mechanism: Mechanism, joint: str, q: np.ndarray) -> float:
    """Duration of the joint's shortest impact at `REFERENCE_SPEED` [s], over its contacts."""
    clearance = mechanism.clearance[joint]
    mass = effective_mass(mechanism, joint, q)
    law = clearance.normal
    contacts = {clearance.contact_properties(k) for k in range(len(clearance.contacts))}
    return min(
        impact_duration(law, law.parameters(contact), mass, REFERENCE_SPEED) for contact in contacts
    )


LONGEST_STEP_S = 1e-5
"""Longest time step of a run with impacts [s]."""


def fitting_step(mechanism: Mechanism, q: np.ndarray) -> float:
    """A time step that resolves the impacts of all joints [s]."""
    shortest = min(contact_duration(mechanism, name, q) for name in mechanism.clearance)
    return min(LONGEST_STEP_S, shortest / WELL_RESOLVED_STEPS)
