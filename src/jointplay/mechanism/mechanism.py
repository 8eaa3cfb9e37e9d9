"""A mechanism: a Pinocchio model in which some joints have clearance.

A joint with clearance replaces its URDF joint by the virtual link: a translation of the journal's
centre in the bearing frame, then yaw, pitch and roll (ZYX), but for what is locked. The bearing
frame's z is the joint's axis, so yaw (z, for a slider) is what the ideal joint's coordinate was:
the drive acts on it and the encoder sees it. Nothing but the contact force connects the two bodies.
A loop is cut at a joint with clearance and needs no coordinates at all.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pinocchio as pin

from jointplay.codec import Described, plain
from jointplay.errors import JointplayError, MissingName, require_finite, within
from jointplay.fields import quantity
from jointplay.joints import RELATIVE, VIRTUAL_LINK, Clearance
from jointplay.mechanism import urdf
from jointplay.mechanism.gear import Gear
from jointplay.mechanism.gravity import STANDARD_GRAVITY
from jointplay.mechanism.lock import Lock
from jointplay.mechanism.loop import Loop, refuse_name
from jointplay.mechanism.model import build, parse
from jointplay.mechanism.placed import Placed
from jointplay.mechanism.shown import Shown


def frame_index(model: pin.Model, name: str) -> int:
    """Index of the frame `name`; if a link and a joint are called like this, of the link's."""
    if model.existFrame(name, pin.FrameType.BODY):
        return int(model.getFrameId(name, pin.FrameType.BODY))
    return int(model.getFrameId(name))


@dataclass(frozen=True, kw_only=True)
class WrittenMechanism:
    """A mechanism as result files have it; keys that a later version adds are let through."""

    lets_through: ClassVar[bool] = True

    urdf: str
    """Name of the file."""
    urdf_text: str
    """All of its text."""
    clearance: dict[str, Clearance]
    gravity: tuple[float, float, float] = quantity("m/s^2")
    tool: str
    allow_unphysical: tuple[str, ...]
    loops: dict[str, Loop] = field(default_factory=dict)
    gears: dict[str, Gear] = field(default_factory=dict)


class Mechanism(Described, Shown, Placed):
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
        locks: by loop whose joint locks what nothing else in the loop does: frames of the carriage
            and of what is fixed to it (`mechanism.lock`).

    Raises:
        JointplayError: see `urdf.read`; also a joint or link that does not exist, a joint of a kind
            that has no clearance of the given kind or has no coordinates.
    """

    written = WrittenMechanism

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
            raise JointplayError(
                f"gravity must have three components, got {gravity!r}", where=("gravity",)
            )
        x, y, z = (require_finite("gravity", g, "m/s^2", ("gravity",)) for g in gravity)
        self.gravity = (x, y, z)
        for name in loops:
            with within("loops", name):
                refuse_name(name, description.joints)
        for name, joint in joints.items():
            with within("clearance", name):
                self._check_joint(name, joint)
        source = parse(description)
        self._make(source, {})
        if tool is not None and not isinstance(tool, str):
            raise JointplayError(f"tool must be the name of a frame, got {tool!r}", ("tool",))
        self.tool = tool if tool is not None else source.frames[source.nframes - 1].name
        if not self.model.existFrame(self.tool):
            frames = [frame.name for frame in source.frames if frame.name != "universe"]
            raise MissingName("frame", self.tool, frames, where=("tool",))
        self.tool_frame = frame_index(self.model, self.tool)
        for name, gear in gears.items():
            with within("gears", name):
                self._check_gear(name, gear)
        for name, loop in loops.items():
            with within("loops", name):
                self._check_loop(name, loop)
        needed = {
            name: Lock.between(
                name,
                self.clearance[name].freedoms,
                self.model,
                self.bearing_frame(name),
                self.journal_frame(name),
            )
            for name in loops
            if self._needs_lock(name)
        }
        if needed:
            self._make(source, needed)
            self.tool_frame = frame_index(self.model, self.tool)

    def _check_gear(self, name: str, gear: Gear) -> None:
        if not isinstance(gear, Gear):
            raise JointplayError(f"joint {name!r} needs a Gear, got {gear!r}")
        entry = self.description.joints.get(name)
        if entry is None or not entry.turns:
            raise MissingName("joint for a gear", name, self.description.revolute)

    def _check_loop(self, name: str, loop: Loop) -> None:
        for link in (loop.bearing_link, loop.journal_link):
            if not self.model.existFrame(link, pin.FrameType.BODY):
                raise MissingName(f"link for loop {name!r}:", link, self.description.links)
        if self.bearing_frame(name)[0] == self.journal_frame(name)[0]:
            raise JointplayError(
                f"loop {name!r} joins {loop.bearing_link!r} and {loop.journal_link!r}, which "
                "do not move against each other"
            )

    def _make(self, source: pin.Model, locks: Mapping[str, Lock]) -> None:
        """Build the model, with what `locks` need."""
        self.model, self.coordinates = build(source, self._joints, self.gears, locks)
        self.model.gravity.linear = np.array(self.gravity)
        self.locks = {}
        for name, lock in locks.items():
            carriage = int(self.model.getJointId(name))
            held = lock.share(self.model, carriage)
            self.locks[name] = ((carriage, pin.SE3.Identity()), held)
        self.data = self.model.createData()

    def _needs_lock(self, name: str) -> bool:
        """Whether a loop's joint locks what the loop's other joints leave free."""
        joint = self.clearance.get(name)
        if joint is None or joint.freedoms == VIRTUAL_LINK:
            return False
        locked = [row for row, part in enumerate(RELATIVE) if part not in joint.freedoms]
        somewhere = np.random.default_rng(0).uniform(-1.0, 1.0, (3, self.model.nq))
        moves = [self.relative_jacobian(name, q)[locked] for q in somewhere]
        return bool(np.abs(moves).max() > 1e-9)

    def _check_joint(self, name: str, joint: Clearance) -> None:
        if not isinstance(joint, Clearance):
            raise JointplayError(
                f"joint {name!r} needs a joint with clearance, such as a RevoluteClearance, "
                f"got {joint!r}"
            )
        if name in self.loops:
            if joint.ideal and joint.slides():
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

    @property
    def given_joints(self) -> dict[str, Clearance]:
        """Joints as given, ideal ones too, which say of what kind a loop's joint or a ball is."""
        return dict(self._joints)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the URDF's moving joints, in the order of the ideal robot's coordinates."""
        names = (c.split(".")[0] for c in self.coordinates)
        return tuple(name for name in dict.fromkeys(names) if name not in self.loops)

    def coordinate(self, joint: str) -> int:
        """Index in q of the ideal coordinate of `joint` (yaw, or z of a slider, with clearance).

        Raises:
            MissingName: no such joint.
        """
        given = self._joints.get(joint)
        name = joint
        if given is not None and (joint in self.clearance or given.compound()):
            name = f"{joint}.{given.drive_coordinate}"
        if name not in self.coordinates or joint in self.loops:
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

    def carriage(self, loop: str) -> list[int]:
        """Indices in q of the carriage of a lock."""
        parts = self.clearance[loop].freedoms
        return [self.coordinates.index(f"{loop}.{part}") for part in parts]

    def ideal(self) -> Mechanism:
        """The same mechanism without clearance and without play in its gears."""
        joints = {
            name: joint
            for name, joint in self._joints.items()
            if name in self.loops or joint.compound()
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
            "clearance": plain(self._joints),
            "loops": plain(self.loops),
            "gears": plain(self.gears),
            "gravity": list(self.gravity),
            "tool": self.tool,
            "allow_unphysical": list(self.allow_unphysical),
        }

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Mechanism:
        """Build the mechanism that `describe` described."""
        allowed = fields["allow_unphysical"]
        name = Path(fields["urdf"]).name or "robot.urdf"
        parsed = replace(urdf.parse(fields["urdf_text"], Path(name), allowed), stored=True)
        mechanism = object.__new__(cls)
        mechanism._build(
            parsed,
            fields["clearance"],
            fields.get("loops", {}),
            fields.get("gears", {}),
            fields["gravity"],
            fields["tool"],
            allowed,
        )
        return mechanism

    def __eq__(self, other: object) -> bool:
        """Whether robot, joints, loops, gears, gravity and tool are the same."""
        return isinstance(other, Mechanism) and self.describe() == other.describe()

    def __hash__(self) -> int:
        """Equal mechanisms hash alike."""
        return hash((self.description.text, self.tool, self.gravity, tuple(self._joints)))

    def __repr__(self) -> str:
        """As one would write it, what is not given left out."""
        parts = [repr(str(self.description.path))]
        parts += [repr(self._joints)] if self._joints else []
        given = {
            "loops": self.loops,
            "gears": self.gears,
            "gravity": None if self.gravity == STANDARD_GRAVITY else self.gravity,
            "tool": self.tool,
            "allow_unphysical": self.allow_unphysical,
        }
        parts += [f"{name}={value!r}" for name, value in given.items() if value]
        return f"Mechanism({', '.join(parts)})"
