"""A mechanism: a Pinocchio model in which some revolute joints are clearance joints.

A clearance joint replaces its revolute joint by the 6-DOF virtual link: a translation of the
journal's centre in the bearing frame, then yaw, pitch and roll (ZYX). The bearing frame's z is the
joint's axis, so yaw is what the ideal joint's coordinate was: the drive acts on it and the encoder
sees it. Nothing but the contact force connects the two bodies.
"""

from __future__ import annotations

import tempfile
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay import urdf
from jointplay.errors import JointplayError, MissingName, require_finite
from jointplay.joint import ClearanceJoint

VIRTUAL_LINK = ("x", "y", "z", "yaw", "pitch", "roll")
"""The six coordinates of a clearance joint, in their order in q."""

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""Gravity in world axes [m/s^2]."""

_REVOLUTE = ("JointModelR", "JointModelRevolute")
_PRISMATIC = ("JointModelP", "JointModelPrismatic")


class Mechanism:
    """A robot from a URDF, ideal or with clearance in some of its revolute joints.

    Args:
        path: the URDF.
        clearance: clearance joints by the name of the revolute joint that each replaces.
        gravity: in world axes, shape (3,) [m/s^2].
        tool: name of the frame whose motion is reported; None takes the last one of the URDF.
        allow_unphysical: links whose inertia is used although no rigid body has it.

    Attributes:
        model, data: the Pinocchio model and data that the simulation uses.
        coordinates: names of the generalised coordinates, in the order of q and v.

    Raises:
        JointplayError: see `urdf.read`; also a joint that does not exist, is not revolute, or is of
            a kind that has no single coordinate.
    """

    def __init__(
        self,
        path: str | Path,
        clearance: Mapping[str, ClearanceJoint] | None = None,
        *,
        gravity: tuple[float, float, float] = STANDARD_GRAVITY,
        tool: str | None = None,
        allow_unphysical: Collection[str] = (),
    ) -> None:
        """Read the URDF and build the model."""
        self._build(
            urdf.read(path, allow_unphysical), clearance or {}, gravity, tool, allow_unphysical
        )

    def _build(
        self,
        description: urdf.Description,
        clearance: Mapping[str, ClearanceJoint],
        gravity: tuple[float, float, float],
        tool: str | None,
        allow_unphysical: Collection[str],
    ) -> None:
        self.description = description
        self.clearance = dict(clearance)
        self.allow_unphysical = tuple(allow_unphysical)
        if len(gravity) != 3:
            raise JointplayError(f"gravity must have three components, got {gravity!r}")
        x, y, z = (require_finite("gravity", g, "m/s^2") for g in gravity)
        self.gravity = (x, y, z)
        for name, joint in self.clearance.items():
            self._check_joint(name, joint)
        source = _parse(description)
        self.model, self.coordinates = _with_virtual_links(source, self.clearance)
        self.model.gravity.linear = np.array(self.gravity)
        self.data = self.model.createData()
        self.tool = tool if tool is not None else source.frames[source.nframes - 1].name
        if not self.model.existFrame(self.tool):
            frames = [frame.name for frame in source.frames if frame.name != "universe"]
            raise MissingName("frame", self.tool, frames)
        self.tool_frame = int(self.model.getFrameId(self.tool))

    def _check_joint(self, name: str, joint: ClearanceJoint) -> None:
        choices = self.description.revolute
        entry = self.description.joints.get(name)
        if entry is None:
            raise MissingName("joint", name, choices, " (the revolute joints)")
        if name not in choices:
            raise JointplayError(
                f"joint {name!r} is {entry.kind}, not revolute; "
                f"revolute joints: {', '.join(choices) or 'none'}"
            )
        if not isinstance(joint, ClearanceJoint):
            raise JointplayError(f"joint {name!r} needs a ClearanceJoint, got {joint!r}")

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the URDF's moving joints, in the order of the ideal robot's coordinates."""
        names = (c.split(".")[0] for c in self.coordinates)
        return tuple(dict.fromkeys(names))

    def coordinate(self, joint: str) -> int:
        """Index in q of the coordinate that a drive of `joint` acts on (yaw, with clearance).

        Raises:
            MissingName: no such joint.
        """
        name = f"{joint}.yaw" if joint in self.clearance else joint
        if name not in self.coordinates:
            raise MissingName("moving joint", joint, self.joints)
        return self.coordinates.index(name)

    def virtual_link(self, joint: str) -> int:
        """Index in q of the first of the six coordinates of the clearance joint `joint`."""
        return self.coordinates.index(f"{joint}.x")

    def bearing_joint(self, joint: str) -> tuple[int, pin.SE3]:
        """Pinocchio joint that carries the bearing, and the bearing frame's placement in it."""
        first = self.model.getJointId(f"{joint}.centre")
        return int(self.model.parents[first]), self.model.jointPlacements[first]

    def ideal(self) -> Mechanism:
        """The same robot without clearance."""
        return self.with_clearance({})

    def with_clearance(self, clearance: Mapping[str, ClearanceJoint]) -> Mechanism:
        """The same robot with other clearance joints."""
        other = object.__new__(Mechanism)
        other._build(self.description, clearance, self.gravity, self.tool, self.allow_unphysical)
        return other

    def configuration(self, positions: Mapping[str, float]) -> np.ndarray:
        """Configuration q with the given joint positions, the rest zero, journals centred.

        Args:
            positions: rad, or m for prismatic joints, by joint name.
        """
        q = np.zeros(self.model.nq)
        for joint, value in positions.items():
            q[self.coordinate(joint)] = value
        return q

    def describe(self) -> dict[str, Any]:
        """All that is needed to build the mechanism again, the URDF's text included."""
        return {
            "urdf": self.description.path.name,
            "urdf_text": self.description.text,
            "clearance": {name: joint.describe() for name, joint in self.clearance.items()},
            "gravity": list(self.gravity),
            "tool": self.tool,
            "allow_unphysical": list(self.allow_unphysical),
        }

    @classmethod
    def from_description(cls, description: Mapping[str, Any]) -> Mechanism:
        """Build the mechanism that `describe` described."""
        text, path = description["urdf_text"], Path(description["urdf"])
        allowed = description["allow_unphysical"]
        joints = {
            name: ClearanceJoint.from_description(fields)
            for name, fields in description["clearance"].items()
        }
        gravity = tuple(description["gravity"])
        mechanism = object.__new__(cls)
        parsed = urdf.parse(text, path, allowed)
        mechanism._build(parsed, joints, gravity, description["tool"], allowed)
        return mechanism


def _parse(description: urdf.Description) -> pin.Model:
    """Pinocchio's own reading of the URDF, from a file because its text reader names no errors."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "robot.urdf"
        file.write_text(description.text, encoding="utf-8")
        try:
            return pin.buildModelFromUrdf(str(file))
        except (ValueError, RuntimeError) as error:
            reason = str(error).strip().splitlines()[0] if str(error).strip() else "no reason given"
            raise JointplayError(
                f"Pinocchio cannot read the URDF {str(description.path)!r}: {reason}"
            ) from None


def _with_virtual_links(
    source: pin.Model, clearance: Mapping[str, ClearanceJoint]
) -> tuple[pin.Model, tuple[str, ...]]:
    """Copy `source` joint by joint, each clearance joint as a translation and a ZYX rotation.

    The bearing frame is turned so that its z is the joint's axis. The bodies, frames and joints
    beyond are turned back, so that at zero yaw everything stands where it stood.
    Continuous joints become ordinary revolute ones: one coordinate, which may exceed a turn.
    """
    model = pin.Model()
    model.name = source.name
    data = source.createData()
    pin.computeJointJacobians(source, data, pin.neutral(source))
    moved = {0: 0}
    turned = {0: pin.SE3.Identity()}  # old joint frame as seen from the new one
    coordinates: list[str] = []
    for old in range(1, source.njoints):
        name = source.names[old]
        joint = source.joints[old]
        parent = moved[source.parents[old]]
        placement = turned[source.parents[old]] * source.jointPlacements[old]
        kind = joint.shortname()
        if not kind.startswith(_REVOLUTE + _PRISMATIC) or joint.nv != 1:
            raise JointplayError(
                f"joint {name!r} is of the kind {kind.removeprefix('JointModel')}; "
                "only revolute, continuous and prismatic joints are supported"
            )
        jacobian = pin.getJointJacobian(source, data, old, pin.ReferenceFrame.LOCAL)
        column = jacobian.reshape(6, source.nv)[:, joint.idx_v]  # flat for a single column
        if name in clearance:
            turn = pin.SE3(_z_to(column[3:]), np.zeros(3))
            centre = model.addJoint(
                parent, pin.JointModelTranslation(), placement * turn, f"{name}.centre"
            )
            new = model.addJoint(centre, pin.JointModelSphericalZYX(), pin.SE3.Identity(), name)
            coordinates += [f"{name}.{coordinate}" for coordinate in VIRTUAL_LINK]
            turned[old] = turn.inverse()
        else:
            if kind.startswith(_PRISMATIC):
                single = pin.JointModelPrismaticUnaligned(column[:3])
            else:
                single = _revolute(column[3:])
            new = model.addJoint(parent, single, placement, name)
            coordinates.append(name)
            turned[old] = pin.SE3.Identity()
        moved[old] = new
        model.appendBodyToJoint(new, turned[old].act(source.inertias[old]), pin.SE3.Identity())
        model.addJointFrame(new)
    for frame in source.frames:
        if frame.type == pin.FrameType.JOINT or frame.name == "universe":
            continue
        placement = turned[frame.parentJoint] * frame.placement
        model.addFrame(
            pin.Frame(frame.name, moved[frame.parentJoint], 0, placement, frame.type), False
        )
    return model, tuple(coordinates)


def _revolute(axis: np.ndarray) -> Any:
    """The cheapest Pinocchio joint about `axis`."""
    for index, aligned in enumerate((pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)):
        if axis[index] == 1.0:
            return aligned()
    return pin.JointModelRevoluteUnaligned(axis)


def _z_to(axis: np.ndarray) -> np.ndarray:
    """Rotation matrix that turns e_z into the unit vector `axis` by the shortest way."""
    x, y, z = axis
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + z)
