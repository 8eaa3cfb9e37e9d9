"""Frames on bodies: the pose and motion of one against another."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

Frame = tuple[int, pin.SE3]
"""A frame: the Pinocchio joint that carries it, and its placement in the joint's frame."""

Frames = tuple[Frame, Frame]
"""Two frames, such as bearing and journal."""

WORLD_FRAME: Frame = (0, pin.SE3.Identity())

TURNING, SLIDING = "JointModelR", "JointModelP"
"""Prefixes of Pinocchio's names for joints with one axis: revolute and prismatic ones. Planar
joints, ``JointModelPlanar``, have more than one coordinate."""


def carried(model: pin.Model, index: int) -> Frame:
    """The frame with number `index` of a model."""
    frame = model.frames[index]
    return int(frame.parentJoint), frame.placement


def motions(model: pin.Model, data: pin.Data, index: int) -> np.ndarray:
    """Twist of each coordinate of Pinocchio's joint `index` in the joint's frame, (nv, 6).

    After `pin.computeJointJacobians`; linear part first.
    """
    joint, local = model.joints[index], pin.ReferenceFrame.LOCAL
    columns = pin.getJointJacobian(model, data, index, local).reshape(6, model.nv)
    return columns[:, joint.idx_v : joint.idx_v + joint.nv].T


def single_axis(model: pin.Model, data: pin.Data, index: int) -> tuple[np.ndarray, bool] | None:
    """Axis of Pinocchio's joint `index` in the joint's frame, and whether it slides along it.

    None if the joint neither turns about one axis nor slides along one. After
    `pin.computeJointJacobians`.
    """
    joint = model.joints[index]
    kind = joint.shortname()
    if joint.nv != 1 or not kind.startswith((TURNING, SLIDING)):
        return None
    (motion,), slides = motions(model, data, index), kind.startswith(SLIDING)
    return (motion[:3] if slides else motion[3:]), slides


def signs_between(model: pin.Model, first: int, second: int) -> np.ndarray:
    """Sign with which each coordinate moves Pinocchio joint `second` against `first`, (nv,).

    +1 for coordinates that carry the second only, -1 the first only, 0 for both or neither: the
    relative Jacobian is the columns of `data.J` with these signs.
    """
    signs = np.zeros(model.nv)
    for end, sign in ((second, 1.0), (first, -1.0)):
        for index in list(model.supports[end])[1:]:
            member = model.joints[index]
            signs[member.idx_v : member.idx_v + member.nv] += sign
    return signs


def pose_between(data: pin.Data, frames: Frames) -> pin.SE3:
    """Pose of the second of two frames in the first, after `pin.forwardKinematics`."""
    (i, first), (j, second) = frames
    return (data.oMi[i] * first).actInv(data.oMi[j] * second)


def motion_between(data: pin.Data, frames: Frames, columns: np.ndarray) -> np.ndarray:
    """Velocity of the second frame's origin and angular velocity, in axes of the first, (6, k).

    `columns` (6, k): twists of the second body against the first, at the world's origin in its
    axes, such as columns of `data.J`.
    """
    (i, first), (j, second) = frames
    turn = (data.oMi[i] * first).rotation
    centre = (data.oMi[j] * second).translation
    linear = columns[:3] - pin.skew(centre) @ columns[3:]
    return np.concatenate([turn.T @ linear, turn.T @ columns[3:]])
