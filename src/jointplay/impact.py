"""What a single impact will look like, before anything is simulated: depth, duration, steps."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
from numba import njit

from jointplay.contact.law import NormalForceLaw, address, call_normal, pointer
from jointplay.joint import ClearanceJoint
from jointplay.mechanism import Mechanism

REFERENCE_SPEED = 0.1
"""Approach speed for which the resolution of impacts is judged before a run [m/s]."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


@njit(cache=True)
def _elastic_energy(law, parameters, depth, nodes, weights):
    energy = np.zeros(depth.size)
    for i in range(depth.size):
        half = 0.5 * depth.flat[i]
        if half > 0.0:
            for k in range(nodes.size):
                at = half * (1.0 + nodes[k])
                force = call_normal(law, at, 0.0, 1.0, pointer(parameters.ctypes.data))
                energy[i] += half * weights[k] * force
    return energy


def elastic_energy(law: NormalForceLaw, parameters: tuple[float, ...], depth: Any) -> np.ndarray:
    """Energy stored in a contact: the law at zero rate, integrated over the depth [J].

    Args:
        law: the normal-force law.
        parameters: its parameters for this contact.
        depth: penetration, any shape [m]; nothing is stored where it is not positive.
    """
    depth = np.asarray(depth, float)
    flat = np.ascontiguousarray(depth).reshape(-1)
    row = np.array(parameters or (0.0,), float)
    return _elastic_energy(address(law), row, flat, _NODES, _WEIGHTS).reshape(depth.shape)


def impact_depth(
    law: NormalForceLaw, parameters: tuple[float, ...], mass: float, speed: float
) -> float:
    """Depth at which a mass [kg] arriving at `speed` [m/s] has spent its energy [m], by bisection.

    The law's damping is left out: it makes the impact shallower, not shorter.
    """
    energy = 0.5 * mass * speed**2
    low, high = 0.0, 1e-9
    while elastic_energy(law, parameters, high) < energy:
        low, high = high, 2.0 * high
        if high > 1.0:  # a law without elastic part never stops the mass
            return float("inf")
    for _ in range(50):
        middle = 0.5 * (low + high)
        if elastic_energy(law, parameters, middle) < energy:
            low = middle
        else:
            high = middle
    return high


def impact_duration(
    law: NormalForceLaw, parameters: tuple[float, ...], mass: float, speed: float
) -> float:
    """Duration of an impact [s], about 3 depth/speed.

    Exactly 2.94 for Hertz (Goldsmith, Impact, 1960) and pi for a linear spring.
    """
    return 3.0 * impact_depth(law, parameters, mass, speed) / speed


def effective_mass(mechanism: Mechanism, joint: str, q: np.ndarray) -> float:
    """Smallest mass that a contact at the joint's rims meets, in configuration q [kg].

    1 / (J M^-1 J^T), J being the direction of the contact in the six coordinates of the virtual
    link: radial at both ends in two directions, axial at both ends and four points of the rim.
    """
    clearance = mechanism.clearance[joint]
    at = mechanism.virtual_link(joint)
    inverse = np.triu(pin.computeMinverse(mechanism.model, mechanism.data, q))
    inverse = inverse + np.triu(inverse, 1).T
    block = inverse[at : at + 6, at : at + 6]
    rj, height = clearance.rj, clearance.lj / 2
    rows: list[tuple[float, ...]] = [(1, 0, 0, 0, side * height, 0) for side in (1, -1)]
    rows += [(0, 1, 0, 0, 0, -side * height) for side in (1, -1)]
    rows += [(0, 0, 1, 0, -side * rj, 0) for side in (1, -1)]
    rows += [(0, 0, 1, 0, 0, side * rj) for side in (1, -1)]
    # The rows hold at zero yaw; the virtual link's axes turn with it.
    yaw = q[at + 3]
    turn = np.eye(6)
    c, s = np.cos(yaw), np.sin(yaw)
    turn[4:, 4:] = [[c, s], [-s, c]]
    turn[:2, :2] = [[c, s], [-s, c]]
    directions = np.array(rows, float) @ turn
    return float(1.0 / np.einsum("ij,jk,ik->i", directions, block, directions).max())


def contact_duration(mechanism: Mechanism, joint: str, q: np.ndarray) -> float:
    """Duration of the shortest impact to expect at `REFERENCE_SPEED` [s]."""
    clearance: ClearanceJoint = mechanism.clearance[joint]
    mass = effective_mass(mechanism, joint, q)
    law = clearance.normal
    return min(
        impact_duration(law, law.parameters(contact), mass, REFERENCE_SPEED)
        for contact in (clearance.radial_contact, clearance.axial_contact)
    )
