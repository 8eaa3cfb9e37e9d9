"""What follows from the recorded coordinates: the tool, energies, gaps, forces of ideal joints."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.loads.drive import JointFriction
from jointplay.mechanism.loop import ANGLE_ARM_M, locked
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.tree import Frame, Motion, Tree
from jointplay.result.loads import Pushes


@dataclass(frozen=True)
class Phase:
    """A stretch of a run in which the bodies keep their inertias."""

    row: int
    """First record that belongs to it."""
    model: pin.Model
    energy: float = 0.0
    """What payloads have brought in since the start, when they were picked and released [J]."""


def stretches_of(phases: Sequence[Phase], n: int) -> list[tuple[int, int, Phase]]:
    """First record, end and phase of each stretch of the n records; none of them empty."""
    ends = [min(phase.row, n) for phase in phases[1:]] + [n]
    return [
        (phase.row, end, phase) for phase, end in zip(phases, ends, strict=True) if phase.row < end
    ]


def kinematics(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    stretches: Sequence[tuple[int, int, Phase]],
    more: Mapping[Any, tuple[Frame, Frame]],
) -> dict[str, Any]:
    """Tool motion and energies by record; by joint with clearance, loop and pair of `more`.

    `bearings` (n, 3, 3) and `poses` (n, 12), by name.
    """
    names: list[Any] = list(dict.fromkeys([*mechanism.clearance, *mechanism.loops]))
    pairs = [(mechanism.bearing_frame(name), mechanism.journal_frame(name)) for name in names]
    names += map(locked, mechanism.locks)
    pairs += mechanism.locks.values()
    names += more
    pairs += more.values()
    frame = mechanism.model.frames[mechanism.tool_frame]
    tool = int(frame.parentJoint), frame.placement
    motion, n = Motion.of(len(q), len(pairs)), len(q)
    for first, end, phase in stretches:
        Tree(phase.model).move(motion, first, end, q, v, tool, pairs)
    return {
        "position": motion.tool[:, :3],
        "velocity": motion.tool[:, 3:],
        "orientation": motion.orientation,
        "spin": motion.spin,
        "kinetic": motion.energy[:, 0],
        "potential": motion.energy[:, 1],
        "bearings": dict(zip(names, motion.bearings.reshape(len(pairs), n, 3, 3), strict=True)),
        "poses": dict(zip(names, motion.poses, strict=True)),
    }


def turning(body: Mapping[str, Any]) -> dict[str, Any]:
    """The tool's orientation and angular velocity."""
    text = "orientation of the tool in the world, unit quaternion w, x, y, z"
    return {
        "tool_orientation": (("time", "quaternion"), body["orientation"], "1", text),
        "tool_angular_velocity": (
            ("time", "axis"),
            body["spin"],
            "rad/s",
            "angular velocity of the tool, world axes",
        ),
    }


def gear_energy(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Energy stored in the teeth and shafts of all gears, shape (n,) [J]."""
    energy = np.zeros(len(q))
    for name, gear in mechanism.gears.items():
        twist = np.abs(q[:, mechanism.motor(name)] - q[:, mechanism.coordinate(name)])
        energy += 0.5 * gear.stiffness * np.maximum(twist - gear.play / 2.0, 0.0) ** 2
    return energy


def drift(mechanism: Mechanism, name: str, poses: np.ndarray) -> np.ndarray:
    """Largest `misfit` of an ideal loop or a lock, by the journal's poses (n, 12): (n,) [m]."""
    parts = [poses[:, :3]]
    if name not in mechanism.loops:
        parts.append(ANGLE_ARM_M * poses[:, [5, 8, 6]])
    elif mechanism.loop_class(name).holds_axis():  # an ideal slider closes no loop
        parts.append(ANGLE_ARM_M * poses[:, [5, 8]])
    return np.abs(np.concatenate(parts, axis=1)).max(axis=1)


def joint_forces(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    drive: np.ndarray,
    friction: Mapping[str, JointFriction],
    stretches: Sequence[tuple[int, int, Phase]],
    pushes: Pushes,
) -> np.ndarray:
    """Constraint forces at the joints of an ideal mechanism, world axes (n, joints, 3) [N].

    The joints of the tree come first, then those that close loops.
    """
    tree, loops = mechanism.joints, list(mechanism.loops)
    forces = np.zeros((len(q), len(tree) + len(loops), 3))
    effort = drive + pushes.efforts
    for name, joint in friction.items():
        at = mechanism.coordinate(name)
        effort[:, at] -= joint.torque(v[:, at])
    for first, end, phase in stretches:
        joints = [int(phase.model.getJointId(name)) for name in tree]
        held = mechanism.constraints(q[first], 0.0)
        found, holds = Tree(phase.model).reactions(
            first, end, q, v, effort, joints, held, pushes.bodies, pushes.wrenches
        )
        forces[first:end, : len(tree)] = found
        for k, constraint in enumerate(held):
            forces[first:end, len(tree) + loops.index(constraint.name)] += holds[:, k]
    return forces
