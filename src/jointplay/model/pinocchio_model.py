"""Robots given as Pinocchio models: their placements, inertias and limits as a URDF."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.model import urdf
from jointplay.model.elements import document, put, put_inertial, put_joint
from jointplay.model.frames import single_axis

_WITHOUT_LIMITS = "JointModelRU"
"""Prefix of revolute joints with two coordinates, which have no limits (``RUBX`` and the like)."""


def description_of_model(
    model: pin.Model, allow_unphysical: tuple[str, ...] = ()
) -> urdf.Description:
    """Describe a model by a URDF: a link for each joint, and one for each frame of a body.

    What a URDF does not have is kept in `urdf.Beyond`: gravity, and armature (`model.armature`).

    Raises:
        JointplayError: a joint that neither turns about an axis nor slides along it; a mimicking
            joint; a name with a tab; see also `urdf.parse`.
    """
    root = ElementTree.Element("robot", name=model.name or "robot")
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    carriers = _links_of(model)
    for index in range(model.njoints):
        link = put(root, "link", name=carriers[index])
        if model.inertias[index].mass > 0.0:
            put_inertial(link, model.inertias[index])
    for index in range(1, model.njoints):
        _put_joint(root, model, data, index, carriers)
    names = {*carriers}
    for frame in model.frames:
        if frame.type not in (pin.FrameType.BODY, pin.FrameType.OP_FRAME) or frame.name in names:
            continue
        names.add(frame.name)
        put(root, "link", name=frame.name)
        parent = carriers[frame.parentJoint]
        put_joint(root, f"{frame.name}_fixed", parent, frame.name, frame.placement)
    gravity = [float(x) for x in model.gravity.linear]
    armature = {
        model.names[index]: float(model.armature[model.joints[index].idx_v])
        for index in range(1, model.njoints)
        if model.armature[model.joints[index].idx_v] > 0.0
    }
    beyond = {"tables": {"robot": {"gravity": gravity}}, "notes": [], "armature": armature}
    put(root, urdf.BEYOND).text = json.dumps(beyond)
    return urdf.parse(document(root), Path(f"{model.name or 'robot'}.urdf"), allow_unphysical)


def _links_of(model: pin.Model) -> list[str]:
    """Name of the link that each joint carries: its body's frame at the origin, or JOINT_link."""
    links: dict[int, str] = {}
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.placement.isIdentity(1e-12):
            links.setdefault(frame.parentJoint, frame.name)
    names = [links.get(index, f"{model.names[index]}_link") for index in range(model.njoints)]
    for name in (*names, *model.names):
        if "\t" in name:
            raise JointplayError(f"{name!r} has a tab in its name, which no file can have")
    return names


def _put_joint(
    root: ElementTree.Element, model: pin.Model, data: pin.Data, index: int, carriers: list[str]
) -> None:
    name, joint = model.names[index], model.joints[index]
    kind, single = joint.shortname(), single_axis(model, data, index)
    if single is None:
        raise JointplayError(
            f"joint {name!r} of the Pinocchio model is a {kind.removeprefix('JointModel')}; only "
            "joints that turn about one axis or slide along one can be taken"
        )
    axis, slides = single
    free = kind.startswith(_WITHOUT_LIMITS)  # its place in q holds a cosine and a sine
    row, at = joint.idx_v, joint.idx_q
    limits = {"effort": model.effortLimit[row], "velocity": model.velocityLimit[row]}
    low, high = np.nan, np.nan
    if not free:
        low, high = model.lowerPositionLimit[at], model.upperPositionLimit[at]
    ends = bool(np.isfinite([low, high]).all() and abs(low) < 1e300 and abs(high) < 1e300)
    kind_name = "prismatic" if slides else "revolute" if ends else "continuous"
    parent, place = carriers[model.parents[index]], model.jointPlacements[index]
    element = put_joint(root, name, parent, carriers[index], place, kind_name)
    put(element, "axis", xyz=axis)
    limits |= {"lower": low, "upper": high} if ends else {}
    limits = {key: x for key, x in limits.items() if np.isfinite(x) and abs(x) < 1e300}
    if limits:
        put(element, "limit", **limits)
    losses = {"friction": model.upperDryFrictionLimit, "damping": model.damping}
    put(element, "dynamics", **{key: float(values[row]) for key, values in losses.items()})
