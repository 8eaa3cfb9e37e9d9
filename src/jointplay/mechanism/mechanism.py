"""A mechanism: a Pinocchio model in which some joints have clearance.

A joint with clearance replaces its URDF joint by the virtual link: a translation of the journal's
centre in the bearing frame, then yaw, pitch and roll (ZYX), but for what is locked. The bearing
frame's z is the joint's axis, so yaw (z, for a slider) is what the ideal joint's coordinate was:
the drive acts on it and the encoder sees it. Nothing but the contact force connects the two bodies.
A loop is cut at a joint with clearance and needs no coordinates at all.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError, MissingName, require_finite
from jointplay.host.late import late
from jointplay.joints import VIRTUAL_LINK, Clearance, joint_from_description
from jointplay.mechanism import urdf
from jointplay.mechanism.gear import Gear
from jointplay.mechanism.loop import Loop
from jointplay.mechanism.model import build, parse

if TYPE_CHECKING:
    from jointplay.mechanism.visuals import Visuals

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""Gravity in world axes [m/s^2]."""

_AXIS_ARM_M = 0.05
"""Distance of the two points that hold the axis of an ideal revolute joint in a loop."""


def frame_index(model: pin.Model, name: str) -> int:
    """Index of the frame `name`; if a link and a joint are called like this, of the link's."""
    if model.existFrame(name, pin.FrameType.BODY):
        return int(model.getFrameId(name, pin.FrameType.BODY))
    return int(model.getFrameId(name))


class Mechanism:
    """A robot or linkage from a URDF, ideal or with clearance in some of its joints.

    Args:
        path: the URDF.
        clearance: joints with clearance, by the name of the URDF joint that each replaces or of the
            loop that each cuts. One whose field `ideal` is set has none.
        loops: joints that close loops, by name; without clearance they are ideal revolute joints.
        gears: gears with play between a joint and its motor, by joint.
        gravity: in world axes, shape (3,) [m/s^2].
        tool: name of the frame whose motion is reported; None takes the last one of the URDF.
        allow_unphysical: links whose inertia is used although no rigid body has it.

    Attributes:
        model, data: the Pinocchio model and data that the simulation uses.
        coordinates: names of the generalised coordinates, in the order of q and v.
        clearance: those of the joints that have clearance.
        loops, gears: as given.

    Raises:
        JointplayError: see `urdf.read`; also a joint or link that does not exist, a joint of a kind
            that has no clearance of the given kind or has no coordinates.
    """

    def __init__(
        self,
        path: str | Path,
        clearance: Mapping[str, Clearance] | None = None,
        *,
        loops: Mapping[str, Loop] | None = None,
        gears: Mapping[str, Gear] | None = None,
        gravity: tuple[float, float, float] = STANDARD_GRAVITY,
        tool: str | None = None,
        allow_unphysical: Collection[str] = (),
    ) -> None:
        """Read the URDF and build the model."""
        description = urdf.read(path, allow_unphysical)
        self._build(
            description, clearance or {}, loops or {}, gears or {}, gravity, tool, allow_unphysical
        )

    def _build(
        self,
        description: urdf.Description,
        joints: Mapping[str, Clearance],
        loops: Mapping[str, Loop],
        gears: Mapping[str, Gear],
        gravity: tuple[float, float, float],
        tool: str | None,
        allow_unphysical: Collection[str],
    ) -> None:
        self.description = description
        self._joints = dict(joints)
        self.clearance = {name: joint for name, joint in joints.items() if not joint.ideal}
        self.loops = dict(loops)
        self.gears = dict(gears)
        self.allow_unphysical = tuple(allow_unphysical)
        if len(gravity) != 3:
            raise JointplayError(f"gravity must have three components, got {gravity!r}")
        x, y, z = (require_finite("gravity", g, "m/s^2") for g in gravity)
        self.gravity = (x, y, z)
        for name in loops:
            if name in description.joints:
                raise JointplayError(f"loop {name!r} has the name of a joint of the URDF")
        for name, joint in joints.items():
            self._check_joint(name, joint)
        source = parse(description)
        self.model, self.coordinates = build(source, self._joints, self.gears)
        self.model.gravity.linear = np.array(self.gravity)
        self.data = self.model.createData()
        if tool is not None and not isinstance(tool, str):
            raise JointplayError(f"tool must be the name of a frame, got {tool!r}")
        self.tool = tool if tool is not None else source.frames[source.nframes - 1].name
        if not self.model.existFrame(self.tool):
            frames = [frame.name for frame in source.frames if frame.name != "universe"]
            raise MissingName("frame", self.tool, frames)
        self.tool_frame = frame_index(self.model, self.tool)
        for name, gear in gears.items():
            if not isinstance(gear, Gear):
                raise JointplayError(f"joint {name!r} needs a Gear, got {gear!r}")
            entry = description.joints.get(name)
            if entry is None or entry.kind not in ("revolute", "continuous"):
                raise MissingName("joint for a gear", name, description.revolute)
        for name, loop in loops.items():
            for link in (loop.bearing_link, loop.journal_link):
                if not self.model.existFrame(link, pin.FrameType.BODY):
                    raise MissingName(f"link for loop {name!r}:", link, description.links)
            if self.bearing_frame(name)[0] == self.journal_frame(name)[0]:
                raise JointplayError(
                    f"loop {name!r} joins {loop.bearing_link!r} and {loop.journal_link!r}, which "
                    "do not move against each other"
                )

    def _check_joint(self, name: str, joint: Clearance) -> None:
        if not isinstance(joint, Clearance):
            raise JointplayError(f"joint {name!r} needs a ClearanceJoint, got {joint!r}")
        if name in self.loops:
            if joint.ideal and joint.kind == "prismatic":
                raise JointplayError(
                    f"loop {name!r} cannot be closed by an ideal slider; "
                    "cut the loop at another joint and leave the slider in the URDF"
                )
            return
        choices = [j.name for j in self.description.joints.values() if j.kind in joint.replaces]
        entry = self.description.joints.get(name)
        words = " or ".join(joint.replaces)
        if entry is None:
            raise MissingName("joint", name, [*choices, *self.loops], f" (the {words} joints)")
        if entry.kind not in joint.replaces:
            raise JointplayError(
                f"joint {name!r} is {entry.kind}, not {words}; "
                f"{words} joints: {', '.join(choices) or 'none'}"
            )

    @cached_property
    def visual_model(self) -> pin.GeometryModel:
        """Shapes as the URDF has them, for `model`; stand-ins where it has none."""
        look: Visuals = late("mechanism.visuals:visuals")(self)
        return look.geometry

    @cached_property
    def collision_model(self) -> pin.GeometryModel:
        """Collision shapes as the URDF has them, for `model`, with no pairs of them chosen."""
        look: Visuals = late("mechanism.visuals:collisions")(self)
        return look.geometry

    def visualizer(self, meshes: Sequence[str | Path] = (), open: bool = False) -> Any:
        """Pinocchio's MeshcatVisualizer, ready: it plays `Result.q`, in a notebook too.

            viz = mechanism.visualizer()  # its viz.viewer.jupyter_cell() is for a notebook
            viz.play(result.q[::10], 1e-3)

        Args:
            meshes: folders where meshes may be, too.
            open: whether to open a window of the browser.

        Raises:
            JointplayError: a given folder does not exist, or loops cannot be closed.
        """
        return late("mechanism.visuals:visualizer")(self, meshes, open)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the URDF's moving joints, in the order of the ideal robot's coordinates."""
        names = (c.split(".")[0] for c in self.coordinates)
        return tuple(dict.fromkeys(names))

    def coordinate(self, joint: str) -> int:
        """Index in q of the ideal coordinate of `joint` (yaw, or z of a slider, with clearance).

        Raises:
            MissingName: no such joint.
        """
        given = self._joints.get(joint)
        name = joint
        if given is not None and (joint in self.clearance or given.kind == "spherical"):
            name = f"{joint}.{given.drive_coordinate}"
        if name not in self.coordinates:
            raise MissingName("moving joint", joint, self.joints)
        return self.coordinates.index(name)

    def motor(self, joint: str) -> int:
        """Index in q of the coordinate that a drive of `joint` acts on: the motor's, if geared."""
        if joint in self.gears:
            return self.coordinates.index(f"{joint}.motor")
        return self.coordinate(joint)

    def plays(self, index: int) -> bool:
        """Whether coordinate `index` is one of a joint's virtual link."""
        joint, _, part = self.coordinates[index].partition(".")
        return part in VIRTUAL_LINK and joint in self.clearance

    def has_virtual_link(self, joint: str) -> bool:
        """Whether the pose of the journal is that of six coordinates of the tree."""
        given = self.clearance[joint]
        return joint not in self.loops and not given.exchanged and given.freedoms == VIRTUAL_LINK

    def virtual_link(self, joint: str) -> int:
        """Index in q of the first of the coordinates of the joint's virtual link."""
        first = self.clearance[joint].freedoms[0]
        return self.coordinates.index(f"{joint}.{first}")

    def loop_kind(self, name: str) -> str:
        """Kind of joint that closes the loop `name`."""
        return self._joints[name].kind if name in self._joints else "revolute"

    def bearing_frame(self, joint: str) -> tuple[int, pin.SE3]:
        """Pinocchio joint that carries the bearing, and the bearing frame's placement in it."""
        return self._frames(joint)[0]

    def journal_frame(self, joint: str) -> tuple[int, pin.SE3]:
        """Pinocchio joint that carries the journal, and the journal frame's placement in it."""
        return self._frames(joint)[1]

    def _frames(self, name: str) -> tuple[tuple[int, pin.SE3], tuple[int, pin.SE3]]:
        model = self.model
        if name in self.loops:
            loop = self.loops[name]
            found = []
            for link, placement in (
                (loop.bearing_link, loop.bearing),
                (loop.journal_link, loop.journal),
            ):
                frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
                found.append((int(frame.parentJoint), frame.placement * placement))
            bearing, journal = found
        else:
            last = int(model.getJointId(name))
            first = last
            while model.names[model.parents[first]].split(".")[0] == name:
                first = model.parents[first]
            bearing = (int(model.parents[first]), model.jointPlacements[first])
            journal = (last, pin.SE3.Identity())
        given = self._joints.get(name)
        return (journal, bearing) if given is not None and given.exchanged else (bearing, journal)

    def journal_pose(self, joint: str) -> pin.SE3:
        """Journal frame in the bearing frame, after `pin.forwardKinematics`."""
        (i, bearing), (j, journal) = self._frames(joint)
        return (self.data.oMi[i] * bearing).actInv(self.data.oMi[j] * journal)

    def signs(self, joint: str) -> np.ndarray:
        """+1 for coordinates that move the journal only, -1 the bearing only, 0 else, (nv,)."""
        signs = np.zeros(self.model.nv)
        for (index, _), sign in (
            (self.journal_frame(joint), 1.0),
            (self.bearing_frame(joint), -1.0),
        ):
            while index > 0:
                member = self.model.joints[index]
                signs[member.idx_v : member.idx_v + member.nv] += sign
                index = self.model.parents[index]
        return signs

    def relative_jacobian(self, joint: str, q: np.ndarray) -> np.ndarray:
        """Motion of the journal relative to the bearing, shape (6, nv).

        Velocity of the journal's centre and angular velocity, both in the bearing frame, per
        generalised velocity in configuration q.
        """
        pin.computeJointJacobians(self.model, self.data, q)
        (i, bearing), (j, journal) = self._frames(joint)
        turn = (self.data.oMi[i] * bearing).rotation
        centre = (self.data.oMi[j] * journal).translation
        columns = self.data.J.reshape(6, self.model.nv) * self.signs(joint)
        linear = columns[:3] + np.cross(columns[3:], centre, axisa=0, axisc=0)
        return np.concatenate([turn.T @ linear, turn.T @ columns[3:]])

    def constraints(self, q: np.ndarray, frequency: float) -> list[pin.RigidConstraintModel]:
        """Pinocchio's constraints for the loops without clearance.

        A ball needs its centre held; a revolute joint a second point on its axis, unless the
        mechanism keeps the axes parallel by itself (as planar ones do).

        Args:
            q: an assembled configuration, shape (nq,).
            frequency: of Baumgarte's stabilisation, critically damped [rad/s].
        """
        found = []
        for name in self.loops:
            if name in self.clearance:
                continue
            (i, bearing), (j, journal) = self._frames(name)
            points = [0.0]
            if self.loop_kind(name) != "spherical":
                jacobian = self.relative_jacobian(name, q)
                held = [np.linalg.matrix_rank(jacobian[:n], tol=1e-9) for n in (3, 5)]
                points += [_AXIS_ARM_M] if held[1] > held[0] else []
            for height in points:
                up = pin.SE3(np.eye(3), np.array([0.0, 0.0, height]))
                constraint = pin.RigidConstraintModel(
                    pin.ContactType.CONTACT_3D,
                    self.model,
                    j,
                    journal * up,
                    i,
                    bearing * up,
                    pin.ReferenceFrame.LOCAL,
                )
                constraint.name = name
                constraint.m_baumgarte_parameters.Kp = frequency**2
                constraint.m_baumgarte_parameters.Kd = 2.0 * frequency
                found.append(constraint)
        return found

    def ideal(self) -> Mechanism:
        """The same mechanism without clearance and without play in its gears."""
        joints = {
            name: joint
            for name, joint in self._joints.items()
            if name in self.loops or joint.kind == "spherical"
        }
        return self._with({name: replace(joint, ideal=True) for name, joint in joints.items()}, {})

    def with_clearance(self, clearance: Mapping[str, Clearance]) -> Mechanism:
        """The same mechanism with other joints with clearance."""
        return self._with(clearance, self.gears)

    def _with(self, joints: Mapping[str, Clearance], gears: Mapping[str, Gear]) -> Mechanism:
        other = object.__new__(Mechanism)
        other._build(
            self.description,
            joints,
            self.loops,
            gears,
            self.gravity,
            self.tool,
            self.allow_unphysical,
        )
        return other

    def configuration(self, positions: Mapping[str, float]) -> np.ndarray:
        """Configuration q with the given joint positions, the rest zero, journals centred.

        Args:
            positions: rad, or m for prismatic joints, by joint name.
        """
        q = np.zeros(self.model.nq)
        for joint, value in positions.items():
            q[self.coordinate(joint)] = value
            q[self.motor(joint)] = value
        return q

    def describe(self) -> dict[str, Any]:
        """All that is needed to build the mechanism again, the URDF's text included."""
        return {
            "urdf": self.description.path.name,
            "urdf_text": self.description.text,
            "clearance": {name: joint.describe() for name, joint in self._joints.items()},
            "loops": {name: loop.describe() for name, loop in self.loops.items()},
            "gears": {name: gear.describe() for name, gear in self.gears.items()},
            "gravity": list(self.gravity),
            "tool": self.tool,
            "allow_unphysical": list(self.allow_unphysical),
        }

    @classmethod
    def from_description(cls, description: Mapping[str, Any]) -> Mechanism:
        """Build the mechanism that `describe` described."""
        allowed = description["allow_unphysical"]
        name = Path(description["urdf"]).name or "robot.urdf"
        parsed = urdf.parse(description["urdf_text"], Path(name), allowed)
        parsed = replace(parsed, stored=True)
        mechanism = object.__new__(cls)
        mechanism._build(
            parsed,
            {n: joint_from_description(fields) for n, fields in description["clearance"].items()},
            {n: Loop.from_description(fields) for n, fields in description["loops"].items()},
            {n: Gear(**fields) for n, fields in description["gears"].items()},
            tuple(description["gravity"]),
            description["tool"],
            allowed,
        )
        return mechanism
