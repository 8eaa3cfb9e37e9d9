"""A robot as a list of bodies and the joints that carry them, as other simulators want it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.arm import joint_limits


@dataclass(frozen=True)
class Body:
    """What moves with one joint; its frame is the joint's."""

    name: str
    """Of the joint."""
    parent: str
    """Joint that carries the parent, or empty for the base."""
    placement: pin.SE3
    """Of the joint's frame in the parent's, at position zero."""
    slides: bool
    axis: np.ndarray
    """In the joint's frame, shape (3,)."""
    limits: tuple[float, float]
    """Infinite where there are none [rad or m]."""
    inertia: pin.Inertia
    friction: float
    """Dry [N m or N]."""
    damping: float
    """[N m s/rad or N s/m]."""


def bodies(mechanism: Mechanism) -> list[Body]:
    """The ideal robot's bodies, from the base outwards.

    Raises:
        JointplayError: loops, or joints that have more than one coordinate (balls).
    """
    if mechanism.loops:
        raise JointplayError("a robot with closed loops cannot be written as a tree of bodies")
    ideal = mechanism.ideal()
    model, data = ideal.model, ideal.data
    pin.computeJointJacobians(model, data, np.zeros(model.nq))
    names = [str(name) for name in model.names]
    low, high = joint_limits(mechanism, [n for n in names[1:] if n in mechanism.joints])
    tree = []
    for index in range(1, model.njoints):
        joint, name = model.joints[index], names[index]
        if joint.nv != 1:
            raise JointplayError(f"joint {name!r} has {joint.nv} coordinates; one can be written")
        column = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
        twist = column.reshape(6, model.nv)[:, joint.idx_v]
        slides = bool(np.linalg.norm(twist[3:]) < 0.5)
        entry = mechanism.description.joints[name]
        tree.append(
            Body(
                name,
                "" if model.parents[index] == 0 else names[model.parents[index]],
                model.jointPlacements[index],
                slides,
                twist[:3] if slides else twist[3:],
                (float(low[index - 1]), float(high[index - 1])),
                model.inertias[index],
                entry.friction,
                entry.damping,
            )
        )
    return tree


def tool_site(mechanism: Mechanism) -> tuple[str, np.ndarray]:
    """The joint that carries the tool, and the tool's place in its frame, shape (3,) [m]."""
    ideal = mechanism.ideal()
    frame = ideal.model.frames[ideal.tool_frame]
    return str(ideal.model.names[frame.parentJoint]), frame.placement.translation


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors that make a right-handed system with `axis`, shape (3,) each."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)
