"""A mechanism: a Pinocchio model in which some joints have clearance.

A joint with clearance is no longer a constraint. In the tree, its URDF joint becomes a virtual link
of six coordinates: the translation of the journal's centre in the bearing frame, then yaw, pitch
and roll (ZYX), without the freedoms that the joint locks. z of the bearing frame is the joint's
axis, so yaw (z of a slider) takes the place of the ideal joint's coordinate: the drive acts on it,
the encoder reads it. Only the contact force connects the two bodies. A joint with clearance that
closes a loop is where the loop is cut: it adds no coordinates at all.

`design` collects what a mechanism is made of, `design.build` makes Pinocchio's model of it;
`Mechanism` is both, with the kinematics and dynamics that the rest of the package asks for.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, MissingName, Where, require_known
from jointplay.base.schema import Described, choice, plain, quantity
from jointplay.base.tables import Overview, counted, few
from jointplay.base.units import readable, typeset
from jointplay.model import urdf
from jointplay.model.beams import FlexibleLink
from jointplay.model.design import Design, build, design
from jointplay.model.flexible import HINGE, TIP
from jointplay.model.frames import Frame, Frames, motion_between, pose_between, signs_between
from jointplay.model.free_base import BASES, HELD
from jointplay.model.gear import Gear, Gearing
from jointplay.model.linkage import Linkage
from jointplay.model.loop import Loop
from jointplay.model.payload import Payload
from jointplay.model.tree import Tree
from jointplay.model.urdf import Description
from jointplay.model.xacro import Value
from jointplay.physics.joints import MOTOR, UNNAMED_KIND, VIRTUAL_LINK, Clearance, Coordinate

_AXIS_ARM_M = 0.05
"""Distance of the two points that hold the axis of an ideal revolute joint in a loop."""


def frame_index(
    model: pin.Model, name: str, noun: str = "frame", more: Sequence[str] = (), where: Where = ()
) -> int:
    """Index of the frame `name`; a link's frame goes before a joint's of the same name.

    Raises:
        MissingName: no such frame; the message calls it a `noun`, and offers the names `more`
            besides the frames.
    """
    if model.existFrame(name, pin.FrameType.BODY):
        return int(model.getFrameId(name, pin.FrameType.BODY))
    if not model.existFrame(name):
        frames = (frame.name for frame in model.frames if frame.name != "universe")
        raise MissingName(noun, name, dict.fromkeys([*more, *frames]), where=where)
    return int(model.getFrameId(name))


def loaded(model: pin.Model, payloads: Sequence[Payload], time: float) -> pin.Model:
    """Copy of a model, with the payloads that its frames hold at a time [s]."""
    bodies = model.copy()
    for payload in payloads:
        if payload.pick <= time and (payload.release is None or time < payload.release):
            frame = bodies.frames[frame_index(bodies, payload.frame)]
            bodies.inertias[frame.parentJoint] += frame.placement.act(payload.body)
    return bodies


@dataclass(frozen=True, kw_only=True)
class WrittenMechanism:
    """The fields of a mechanism in a result file."""

    urdf: str
    """Name of the URDF file."""
    urdf_text: str
    """The whole text of the URDF."""
    clearance: dict[str, Clearance]
    gravity: tuple[float, float, float] = quantity("m/s^2")
    tool: str
    allow_unphysical: tuple[str, ...]
    fix: tuple[str, ...] = ()
    loops: dict[str, Loop] = field(default_factory=dict)
    gears: dict[str, Gearing] = field(default_factory=dict)
    base: str = choice("base", BASES, default=HELD)


class Mechanism(Overview, Described, Design):
    """A robot or linkage from a URDF, ideal or with clearance in some of its joints.

    Args:
        path: the URDF or xacro, ``jointplay:NAME`` for one that ships with the package, or a name
            such as ``ur5`` for a robot of example-robot-data or robot_descriptions; or a
            ``pinocchio.Model``, whose placements, inertias, limits, gravity and armature count; or
            a `Linkage`, which brings its loops.
        clearance: joints with clearance, by the name of the URDF joint that each replaces or of the
            loop that each cuts. A joint whose field `ideal` is set has none.
        loops: joints that close loops, by name; without clearance they are ideal revolute joints.
        gears: gears with play between a joint and its motor, by joint.
        flexible: links that bend and twist, by name.
        gravity: in world axes, shape (3,) [m/s^2]; ``"loaded"`` is 9.81 m/s^2 along -z,
            ``"balanced"`` none. None: what an MJCF says (its base, gears with play and balls count
            likewise where nothing is given); ``"loaded"`` for other files.
        tool: name of the frame whose motion is reported; None takes the end of the chain of moving
            joints that has most of the joints with clearance (`mechanism.tool`).
        allow_unphysical: links whose inertia is used although no rigid body has it; ``["all"]``
            stands for all of them.
        fix: joints that are held, with the joints that mimic them: at zero, or in the middle of
            limits that exclude zero.
        base: ``"held"`` to the ground, or ``"free"`` like that of a robot that walks, flies or is
            carried. The coordinates of a free base, ``base.x``, ``.y``, ``.z`` [m], ``.yaw``,
            ``.pitch`` and ``.roll`` [rad], come first; they are zero where the URDF has the base.
            None: what an MJCF says, else ``"held"``.
        xacro: arguments of a robot that is written in xacro, by name.

    Attributes besides those of `Design`:
        model, data: the Pinocchio model and data that the simulation uses.
        coordinates: names of the generalised coordinates, in the order of q and v.
        locks: frames of the carriage and of the body fixed to it, by loop; for loops whose joint
            locks a freedom that nothing else in the loop does (`model.loop`).

    Raises:
        JointplayError: see `formats.read`; also a joint or link that does not exist, a joint of a
            kind that has no clearance of the given kind or has no coordinates.
    """

    written = WrittenMechanism

    def __init__(
        self,
        path: str | Path | Description | Linkage | pin.Model,
        clearance: Mapping[str, Clearance] | None = None,
        *,
        loops: Mapping[str, Loop] | None = None,
        gears: Mapping[str, Gearing] | None = None,
        flexible: Mapping[str, FlexibleLink] | None = None,
        gravity: Sequence[float] | str | None = None,
        tool: str | None = None,
        allow_unphysical: Collection[str] = (),
        fix: Collection[str] = (),
        base: str | None = None,
        xacro: Mapping[str, Value] | None = None,
    ) -> None:
        parts = design(
            path, clearance, loops=loops, gears=gears, flexible=flexible, gravity=gravity,
            tool=tool, allow_unphysical=allow_unphysical, fix=fix, base=base, xacro=xacro,
        )  # fmt: skip
        vars(self).update(vars(parts))
        self.model, self.coordinates, self.locks = build(parts)
        self.data = self.model.createData()
        self.tool_frame = frame_index(self.model, self.tool, where=("tool",))
        self._known_signs: dict[tuple[int, int], np.ndarray] = {}

    @property
    def base_joint(self) -> int:
        """Pinocchio joint that carries the base: 0, the ground, if it is held."""
        return 0 if self.free_base is None else int(self.model.getJointId(self.free_base))

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the URDF's moving joints, in the order of the ideal robot's coordinates."""
        names = dict.fromkeys(coordinate.joint for coordinate in self.coordinates)
        others = {*self.loops, *self.mounts, self.free_base}
        return tuple(name for name in names if name not in others)

    @property
    def mounts(self) -> tuple[str, ...]:
        """Names of the joints with clearance whose ideal joint is rigid: elastic mounts."""
        joints = self.clearance.items()
        return tuple(name for name, joint in joints if not joint.ideal_freedoms)

    @property
    def hinges(self) -> dict[str, list[str]]:
        """Names of the mounts that are the hinges of flexible links, by link."""
        hinges: dict[str, list[str]] = {}
        for name in self.clearance:
            link, _, number = name.rpartition(HINGE)
            if number.isdigit() and f"{link}{TIP}" in self.description.links:
                hinges.setdefault(link, []).append(name)
        return hinges

    def coordinate(self, joint: str) -> int:
        """Index in q of the ideal joint's coordinate; with clearance yaw, or z of a slider.

        Raises:
            MissingName: no such joint.
        """
        name = self.ideal_coordinate(joint)
        if name not in self.coordinates or joint in self.loops:
            raise MissingName("moving joint", joint, self.joints)
        return self.coordinates.index(name)

    def motor(self, joint: str) -> int:
        """Index in q of the coordinate on which a drive of `joint` acts: its motor's, if geared."""
        if joint in self.gears:
            return self.coordinates.index(Coordinate(joint, MOTOR))
        return self.coordinate(joint)

    def plays(self, index: int) -> bool:
        """Whether coordinate `index` belongs to the virtual link of a joint with clearance."""
        coordinate = self.coordinates[index]
        return coordinate.part in VIRTUAL_LINK and coordinate.joint in self.clearance

    def movers(self, relative_to: str | None = None) -> list[str]:
        """Joints that move the tool, in the world or against the link or frame `relative_to`.

        In a mechanism with loops: all joints and loops.

        Raises:
            MissingName: no such link or frame.
        """
        if self.loops:
            return [*dict.fromkeys(part.joint for part in self.coordinates), *self.loops]
        between = {*self.model.supports[self.model.frames[self.tool_frame].parentJoint]}
        if relative_to is not None:  # joints that carry both move neither against the other
            body = self.model.frames[frame_index(self.model, relative_to, "body")]
            between ^= {*self.model.supports[body.parentJoint]}
        owners = dict.fromkeys(self.owner(index) for index in sorted(between))
        return [name for name in owners if name not in (None, self.free_base)]

    def has_virtual_link(self, joint: str) -> bool:
        """Whether the journal's pose in the bearing is six coordinates of the tree."""
        clearance = self.clearance[joint]
        in_tree = joint not in self.loops and not clearance.exchanged
        return in_tree and clearance.freedoms == VIRTUAL_LINK

    def virtual_link(self, joint: str) -> int:
        """Index in q of the first coordinate of the joint's virtual link."""
        first = self.clearance[joint].freedoms[0]
        return self.coordinates.index(Coordinate(joint, first))

    @property
    def held(self) -> str:
        """A sentence that the base is held; empty where that goes without saying (linkages)."""
        return "" if self.loops or self.free_base else self.description.held

    @property
    def base_words(self) -> str:
        """A sentence on whether the base is free or held; empty where that goes without saying."""
        if self.free_base is None:
            return self.held
        falls = ", and it falls unless loads carry it" if any(self.gravity) else ""
        return f"the base {self.description.root!r} is free: nothing holds it{falls}"

    @property
    def runs_ideal(self) -> bool:
        """Whether the mechanism can be simulated without clearance."""
        return all(joint.runs_ideal for joint in self.given_joints.values())

    def ideal(self) -> Mechanism:
        """The mechanism without clearance and gears; built once, and itself if it has neither.

        Raises:
            JointplayError: a joint of the tree is a groove.
        """
        return self._ideal

    @cached_property
    def _ideal(self) -> Mechanism:
        if not self.given_joints and not self.gears:
            return self
        return self.with_clearance(self._ideal_joints(), {})

    def _ideal_joints(self) -> dict[str, Clearance]:
        """Ideal joints whose kind must still be known: in loops, or with several coordinates."""
        return {
            name: replace(joint, ideal=True)
            for name, joint in self.given_joints.items()
            if name in self.loops or joint.compound()
        }

    def without(self, cause: str) -> Mechanism:
        """The same machine without one cause of its error; built once, and itself if it has none.

        Args:
            cause: ``"play"``: gears have no play, and joints are ideal unless springs or preload
                hold them. The compliance of a bearing with play goes with its play.
                ``"elasticity"``: the machine has no play and is rigid. The rotors of its gears
                become the armature of their joints; the friction of its gears is left out.
        """
        require_known("cause", cause, ("play", "elasticity"))
        return self._without_play if cause == "play" else self._rigid

    @cached_property
    def _without_play(self) -> Mechanism:
        if not any(joint.has_play for joint in self.clearance.values()) and not any(
            gear.play for gear in self.gears.values()
        ):
            return self
        elastic = {name: joint for name, joint in self.clearance.items() if not joint.has_play}
        if not elastic and not self.gears:
            return self._rigid
        gears = {name: gear.with_play(0.0) for name, gear in self.gears.items()}
        return self.with_clearance(self._ideal_joints() | elastic, gears)

    @cached_property
    def _rigid(self) -> Mechanism:
        if not self.gears:
            return self.ideal()
        rotors = {name: gear.rotor_inertia for name, gear in self.gears.items()}
        description = urdf.with_armature(self.description, self.armature | rotors)
        return self._like(self._ideal_joints(), {}, self.base, description)

    def with_clearance(
        self, clearance: Mapping[str, Clearance], gears: Mapping[str, Gearing] | None = None
    ) -> Mechanism:
        """The same mechanism with another set of joints with clearance, and of gears if given."""
        return self._like(clearance, self.gears if gears is None else gears, self.base)

    def bolted(self) -> Mechanism:
        """The same mechanism with its base held to the ground; itself if it is held."""
        return self if self.base == HELD else self._like(self.given_joints, self.gears, HELD)

    def _like(
        self,
        clearance: Mapping[str, Clearance],
        gears: Mapping[str, Gearing],
        base: str,
        description: Description | None = None,
    ) -> Mechanism:
        copy = Mechanism(
            description or self.description,
            clearance,
            loops=self.loops,
            gears=gears,
            gravity=self.gravity,
            tool=self.tool,
            allow_unphysical=self.allow_unphysical,
            fix=self.fix,
            base=base,
        )
        # A number that a rule gave still comes from the rule, although it is given to the copy.
        copy.rules |= {
            (name, field): rule
            for (name, field), rule in self.rules.items()
            if getattr(copy.gears.get(name), field, None) == rule.value
        }
        return copy

    def configuration(self, positions: Mapping[str, float]) -> np.ndarray:
        """Configuration q with these joint positions [rad or m], zero else: journals centred."""
        q = np.zeros(self.model.nq)
        for joint, value in positions.items():
            q[self.coordinate(joint)] = value
            q[self.motor(joint)] = value
        return q

    def describe(self) -> dict[str, Any]:
        return {
            "urdf": self.description.path.name,
            "urdf_text": self.description.text,
            "clearance": plain(self.given_joints),
            "loops": plain(self.loops),
            "gears": plain(self.gears),
            "gravity": list(self.gravity),
            "tool": self.tool,
            "allow_unphysical": list(self.allow_unphysical),
            "fix": list(self.fix),
            "base": self.base,
        }

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Mechanism:
        allowed = fields["allow_unphysical"]
        name = Path(fields["urdf"]).name or "robot.urdf"
        parsed = replace(urdf.parse(fields["urdf_text"], Path(name), allowed), stored=True)
        others = {key: fields[key] for key in fields if key not in ("urdf", "urdf_text")}
        return cls(parsed, **others)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Mechanism) and self.describe() == other.describe()

    def __hash__(self) -> int:
        return hash((self.description.text, self.tool, self.gravity, tuple(self.given_joints)))

    def facts(self) -> tuple[str, dict[str, str]]:
        moving, hinges = list(self.joints), self.hinges
        facts = {"moving joints": few(moving)}
        if self.base_words:
            facts["base"] = self.base_words.removeprefix("the base ")
        if self.fix:
            facts["held joints"] = few(list(self.fix))
        for link, names in hinges.items():
            hinge = self.clearance[names[0]]
            facts[f"link {link}"] = (
                f"flexible, {counted(len(names), 'hinge')}, each {hinge.summary}"
            )
        in_links = {name for names in hinges.values() for name in names}
        for name, joint in self.clearance.items():
            if name in in_links:
                continue
            play = f"{joint.kind} with clearance, play {joint.play_words}"
            facts[f"joint {name}"] = play if joint.springs is None else joint.summary
        for name, loop in self.loops.items():
            kind = self.loop_class(name).kind
            facts[f"loop {name}"] = f"{kind}, {loop.bearing_link} - {loop.journal_link}"
        for name, gear in self.gears.items():
            parts = [f"play {readable(gear.play, self.description.joints[name].unit)}"]
            if gear.kind != Gear.kind:
                parts = [gear.kind, *parts, *([gear.notes] if gear.notes else [])]
            facts[f"gear {name}"] = ", ".join(parts)
        facts["tool"] = self.tool
        weight = " ".join(f"{g:g}" for g in self.gravity)
        facts["gravity"] = f"{weight} {typeset('m/s^2')}" if any(self.gravity) else "none"
        number = f"{len(moving)} moving joint{'' if len(moving) == 1 else 's'}"
        return f"{self.description.path.name}, {number}", facts

    @cached_property
    def tree(self) -> Tree:
        """The bodies of `model` for compiled kinematics at many records at once."""
        return Tree(self.model)

    @cached_property
    def visual_model(self) -> pin.GeometryModel:
        """Visual shapes of the URDF on the frames of `model`; stand-ins where it has none."""
        return self._geometry(collisions=False)

    @cached_property
    def collision_model(self) -> pin.GeometryModel:
        """Collision shapes of the URDF on the frames of `model`, without collision pairs."""
        return self._geometry(collisions=True)

    def _geometry(self, collisions: bool) -> pin.GeometryModel:
        from jointplay.model.visuals import geometry_model, look

        return geometry_model(self, look(self, collisions=collisions))

    def visualizer(self, meshes: Sequence[str | Path] = (), open: bool = False) -> Any:
        """Pinocchio's MeshcatVisualizer with the mechanism loaded; it plays `Result.q`.

            viz = mechanism.visualizer()  # its viz.viewer.jupyter_cell() is for a notebook
            viz.play(result.q[::10], 1e-3)

        Args:
            meshes: further folders in which meshes are looked for.
            open: whether to open a window of the browser.

        Raises:
            JointplayError: a given folder does not exist, or loops cannot be closed.
        """
        from jointplay.model.visuals import visualizer

        return visualizer(self, meshes, open)

    def owner(self, index: int) -> str | None:
        """Name of the joint to which Pinocchio's joint `index` belongs; None for the ground."""
        return self.coordinates[self.model.joints[index].idx_v].joint if index > 0 else None

    def loop_class(self, name: str) -> type[Clearance]:
        """Class of the joint that closes the loop `name`."""
        return type(self.given_joints[name]) if name in self.given_joints else UNNAMED_KIND

    def frames(self, name: str) -> Frames:
        """Frames of a joint's bearing and journal."""
        model = self.model
        if name in self.loops:
            bearing, journal = self.loops[name].frames(model)
        else:
            # A virtual link may be several Pinocchio joints, the last of which has its name.
            last = int(model.getJointId(name))
            first = last
            while self.owner(model.parents[first]) == name:
                first = model.parents[first]
            bearing = (int(model.parents[first]), model.jointPlacements[first])
            journal = (last, pin.SE3.Identity())
        stated = self.given_joints.get(name)
        return (journal, bearing) if stated is not None and stated.exchanged else (bearing, journal)

    def closing_frames(self, name: str) -> Frames:
        """`frames`, with the bearing's moved along its curve to the journal, if it has a curve.

        The bearing frame then stands where the journal would be without clearance, x along the
        curve. After `pin.forwardKinematics`.
        """
        (at, bearing), journal = frames = self.frames(name)
        stated = self.given_joints.get(name)
        centre = pose_between(self.data, frames).translation
        guide = None if stated is None else stated.guided_at(centre)
        return frames if guide is None else ((at, bearing * pin.SE3(*guide)), journal)

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M(q) of eq. 22, shape (nv, nv), symmetric [kg, kg m or kg m2 by its two coordinates].

        It is Pinocchio's `crba` on `model`, and includes the coordinates of each virtual link.
        """
        return self._symmetric(pin.crba(self.model, self.data, q))

    def inverse_mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """M(q)^-1, shape (nv, nv), symmetric."""
        return self._symmetric(pin.computeMinverse(self.model, self.data, q))

    def _symmetric(self, filled: np.ndarray) -> np.ndarray:
        """The symmetric matrix whose upper triangle Pinocchio has filled."""
        upper = np.triu(filled.reshape(self.model.nv, self.model.nv))
        return upper + np.triu(upper, 1).T

    def coriolis_matrix(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """C(q, qd) of eq. 22, shape (nv, nv): C qd are the Coriolis and centrifugal forces.

        By Christoffel's symbols, so that dM/dt - 2 C is skew-symmetric: C_ij is half the derivative
        of force i by v_j. The forces, Pinocchio's, are quadratic in v, and differences between any
        two speeds are exact. `pin.computeCoriolisMatrix` is not used: in Pinocchio 4.1 it omits how
        the axes of `JointModelSphericalZYX`, the virtual link's, turn with its coordinates (issue
        2053 of stack-of-tasks/pinocchio).
        """

        def forces(speed: np.ndarray) -> np.ndarray:
            return pin.nonLinearEffects(self.model, self.data, q, speed).copy()

        return np.column_stack(
            [0.25 * (forces(v + unit) - forces(v - unit)) for unit in np.eye(self.model.nv)]
        )

    def gravity_forces(self, q: np.ndarray) -> np.ndarray:
        """G(q) of eq. 22, (nv,) [N m or N]: the efforts that hold q at rest without contact."""
        return pin.computeGeneralizedGravity(self.model, self.data, q).copy()

    def journal_pose(self, joint: str) -> pin.SE3:
        """Pose of the journal frame in the bearing frame, after `pin.forwardKinematics`."""
        return pose_between(self.data, self.frames(joint))

    def signs(self, joint: str) -> np.ndarray:
        """+1 for coordinates that move the journal only, -1 the bearing only, 0 else, (nv,)."""
        (i, _), (j, _) = self.frames(joint)
        return self._signs(i, j)

    def _signs(self, first: int, second: int) -> np.ndarray:
        """`signs_between` two Pinocchio joints; each pair is computed once."""
        key = (first, second)
        if key not in self._known_signs:
            signs = signs_between(self.model, first, second)
            signs.flags.writeable = False
            self._known_signs[key] = signs
        return self._known_signs[key]

    def relative_jacobian(self, joint: str, q: np.ndarray) -> np.ndarray:
        """Jacobian of the journal's motion against the bearing in configuration q, (6, nv).

        Rows: velocity of the journal's centre, then angular velocity, both in the bearing frame.
        """
        return self.motion(self.frames(joint), q)

    def motion(self, frames: Frames, q: np.ndarray) -> np.ndarray:
        """Jacobian of the second frame's motion against the first; see `relative_jacobian`."""
        pin.computeJointJacobians(self.model, self.data, q)
        (i, _), (j, _) = frames
        columns = self.data.J.reshape(6, self.model.nv) * self._signs(i, j)
        return motion_between(self.data, frames, columns)

    def constraints(self, q: np.ndarray, frequency: float) -> list[pin.RigidConstraintModel]:
        """Pinocchio's constraints for the loops without clearance, and for locks.

        All are points held together. A ball needs its centre held; a revolute joint a second point
        on its axis, unless the mechanism keeps the axes parallel by itself (as planar ones do).

        Args:
            q: an assembled configuration, shape (nq,).
            frequency: of Baumgarte's stabilisation, critically damped [rad/s].

        Raises:
            JointplayError: a loop of a kind that cannot be simulated without clearance.
        """
        constraints = []
        for name in self.loops:
            if name in self.clearance:
                continue
            if not self.loop_class(name).runs_ideal:
                raise JointplayError(
                    f"a {self.loop_class(name).kind} joint without clearance cannot be simulated: "
                    "give it some",
                    where=("joints", name),
                )
            bearing, journal = self.frames(name)
            points = [np.zeros(3)]
            if self.loop_class(name).holds_axis():
                # Rows 3 and 4 are turns across the axis: a higher rank means something allows them.
                jacobian = self.relative_jacobian(name, q)
                ranks = [np.linalg.matrix_rank(jacobian[:n], tol=1e-9) for n in (3, 5)]
                points += [np.array([0.0, 0.0, _AXIS_ARM_M])] if ranks[1] > ranks[0] else []
            constraints += [self._pinned(name, journal, bearing, at, frequency) for at in points]
        for name, (carriage, held) in self.locks.items():
            for at in (np.zeros(3), *(_AXIS_ARM_M * np.eye(3)[:2])):  # three points hold a frame
                constraints.append(self._pinned(name, held, carriage, at, frequency))
        return constraints

    def _pinned(
        self, name: str, first: Frame, second: Frame, point: np.ndarray, frequency: float
    ) -> pin.RigidConstraintModel:
        """Constraint that holds a point of two frames together, stabilised; see `constraints`."""
        at = pin.SE3(np.eye(3), point)
        (i, a), (j, b) = first, second
        kind, axes = pin.ContactType.CONTACT_3D, pin.ReferenceFrame.LOCAL
        constraint = pin.RigidConstraintModel(kind, self.model, i, a * at, j, b * at, axes)
        constraint.name = name
        constraint.m_baumgarte_parameters.Kp = frequency**2
        constraint.m_baumgarte_parameters.Kd = 2.0 * frequency
        return constraint
