"""Contact of one joint at rest: what its surfaces store, push with, and how stiff they are."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np

from jointplay.contact.calls import call_normal, pointer
from jointplay.contact.compiled import MAX_PARAMETERS, address
from jointplay.geometry import classify_many, touch
from jointplay.host.numba_cache import njit
from jointplay.joints import Clearance
from jointplay.kernel.sources import stamp

_SHIFT_M = 1e-9
"""Displacement by which wrenches are differentiated [m]."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)


@njit(cache=True, error_model="numpy")
def _wrench(shape, dimensions, count, law, parameters, pose, out):
    """Force and moment about the journal's centre of the elastic contacts at a pose, into `out`.

    `shape` is a `Shape` or the address of a touch, as for `geometry.touch`.
    """
    for i in range(6):
        out[i] = 0.0
    for k in range(count):
        gap, rx, ry, rz, nx, ny, nz = touch(
            shape, dimensions, 0, k, pose[0], pose[1], pose[2], pose, 3
        )
        if gap >= 0.0:
            continue
        own = pointer(parameters[k].ctypes.data)
        force = max(call_normal(law, -gap, 0.0, 1.0, own), 0.0)
        fx, fy, fz = force * nx, force * ny, force * nz
        out[0] += fx
        out[1] += fy
        out[2] += fz
        out[3] += ry * fz - rz * fy
        out[4] += rz * fx - rx * fz
        out[5] += rx * fy - ry * fx


@njit(cache=True, error_model="numpy")
def _energy(shape, dimensions, count, law, parameters, pose, nodes, weights):
    """Energy that the contacts store at a pose [J]."""
    total = 0.0
    for k in range(count):
        gap = touch(shape, dimensions, 0, k, pose[0], pose[1], pose[2], pose, 3)[0]
        depth = max(-gap, 0.0)
        if depth > 0.0:
            own = pointer(parameters[k].ctypes.data)
            for n in range(nodes.size):
                force = call_normal(law, 0.5 * depth * (1.0 + nodes[n]), 0.0, 1.0, own)
                total += 0.5 * depth * weights[n] * force
    return total


@njit(cache=True, error_model="numpy")
def _stiffness(shape, dimensions, count, law, parameters, pose, shift, turn):
    """Fall of the wrench per displacement and turn of the journal, in bearing axes, (6, 6)."""
    here, there = np.zeros(6), np.zeros(6)
    moved = np.zeros(12)
    stiffness = np.zeros((6, 6))
    _wrench(shape, dimensions, count, law, parameters, pose, here)
    for axis in range(6):
        for k in range(12):  # a slice would cost a first start a second more
            moved[k] = pose[k]
        size = shift if axis < 3 else turn
        if axis < 3:
            moved[axis] += shift
        else:
            u, w = (axis - 2) % 3, (axis - 1) % 3  # rows that turn into each other
            c, s = math.cos(turn), math.sin(turn)
            for k in range(3):
                a, b = pose[3 + 3 * u + k], pose[3 + 3 * w + k]
                moved[3 + 3 * u + k] = c * a - s * b
                moved[3 + 3 * w + k] = s * a + c * b
        _wrench(shape, dimensions, count, law, parameters, moved, there)
        for r in range(6):
            stiffness[r, axis] = (here[r] - there[r]) / size
    return stiffness


class ElasticJoint:
    """The elastic contacts of one joint, without friction and damping.

    Args:
        joint: the joint.
    """

    def __init__(self, joint: Clearance) -> None:
        """Gather what the compiled functions need."""
        count = len(joint.contacts)
        parameters = np.zeros((count, MAX_PARAMETERS))
        for k in range(count):
            values = joint.normal.parameters(joint.contact_properties(k))
            parameters[k, : len(values)] = values
        dimensions = np.array([*joint.dimensions, *(0.0,) * 4])
        self._of = (int(joint.shape), dimensions, count, address(joint.normal), parameters)
        self.reach = float(np.linalg.norm(joint.outline.size))
        """Farthest point of the journal from its centre [m]."""

    def energy(self, pose: np.ndarray) -> float:
        """Energy stored at a pose (12,) of the journal in its bearing [J]."""
        return float(_energy(*self._of, pose, _NODES, _WEIGHTS))

    def smallest_gap(self, pose: np.ndarray) -> float:
        """At a pose (12,) of the journal in its bearing; negative in penetration [m]."""
        shape, dimensions, count, *_ = self._of
        gaps, _, _ = classify_many(shape, dimensions, count, pose[None])
        return float(gaps.min())

    def wrench(self, pose: np.ndarray) -> np.ndarray:
        """Force on the journal and moment about its centre, bearing axes, (6,) [N, N m]."""
        out = np.zeros(6)
        _wrench(*self._of, pose, out)
        return out

    def stiffness(self, pose: np.ndarray) -> np.ndarray:
        """Fall of the wrench per displacement [m] and turn [rad] of the journal, (6, 6)."""
        stiffness: np.ndarray = _stiffness(*self._of, pose, _SHIFT_M, _SHIFT_M / self.reach)
        return stiffness


for _compiled in (_wrench, _energy, _stiffness):
    stamp(_compiled, Path(__file__))
