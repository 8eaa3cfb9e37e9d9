"""A whole robot with the play of all its joints, for other simulators, and random copies of it.

The MJCF is the robot's own URDF as MuJoCo compiles it, shapes included. In series with each joint
J that has a dead band stands a hinge `J_play` about the same axis, in the same body: J is the
motor, loaded with its rotor's inertia, and J_play is what the link lags behind. A tendon whose
spring has a dead band holds J_play; a second tendon, J plus J_play, is the link's angle and has
the friction of bearing and joint. A journal that leans has two more hinges, J.pitch and J.roll,
which a tendon, J.rim, keeps within the bore.
"""

from __future__ import annotations

import copy
import json
import math
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from jointplay.core.errors import JointplayError, MissingName, require_non_negative
from jointplay.core.tables import Column, Table
from jointplay.design.levers import LeanPlay, TurnPlay
from jointplay.design.reduced_files import (
    bodies,
    check_encoder,
    check_servos,
    dc_motor,
    document,
    explain,
    lean_axes,
    load_mujoco,
    put,
    put_rim,
    refuse_taken,
    rotor_inertia,
    servo_friction,
    with_play,
)
from jointplay.design.reduction import LONGEST_STEP_S, Reduction
from jointplay.design.static_budget import Budget, budget, farthest
from jointplay.loads.drive import Servo
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.meshes import readable
from jointplay.mechanism.visuals import find_mesh, mesh_folders

MESHES = "meshes"
"""Folder of the shapes, beside the MJCF."""
PLUGIN = "gz_ros2_control/GazeboSimSystem"
"""Hardware of ros2_control's tags, if no other is named: Gazebo's."""
QUANTITIES = {
    "half_play": "rad",
    "friction": "N m",
    "stiffness": "N m/rad",
    "motor_friction": "N m",
    "tilt": "rad",
}
"""What is drawn of each joint, and in which unit; the last two only MJCF has, the servo's friction
and how far the axis can lean."""
_RESOLVED = 0.2
"""Time step by the time in which the stiffest teeth swing through a radian of phase."""
_COMPILER = {
    "fusestatic": "true",
    "discardvisual": "false",
    "strippath": "true",
    "balanceinertia": "true",
    "inertiafromgeom": "false",
    "boundmass": 1e-9,
    "boundinertia": 1e-12,
}
"""How MuJoCo compiles a URDF here: masses are the URDF's, never the shapes'."""


@dataclass(frozen=True)
class CompiledRobot:
    """A robot that MuJoCo compiled, with hinges for the dead bands but without numbers of play."""

    mechanism: Mechanism
    root: ElementTree.Element
    meshes: Mapping[str, bytes]
    """Files of shapes (STL) by name, which belong into the folder `MESHES`."""
    mass: np.ndarray
    """Mass matrix at the pose, without rotors, (nv, nv)."""
    dofs: Mapping[str, int]
    """Rows of it by joint."""
    notes: tuple[str, ...]
    """What is not as in the URDF, a line each."""
    leaning: tuple[str, ...]
    """Joints whose axes lean."""

    def mjcf(
        self,
        reductions: Iterable[Reduction],
        *,
        encoder: str = "motor",
        servos: Mapping[str, Servo] = MappingProxyType({}),
    ) -> str:
        """The MJCF with these numbers of play.

        Args:
            reductions: of the joints for which the robot was compiled.
            encoder: ``motor`` or ``link``: what the sensor `J.encoder` reads.
            servos: by joint; each is a ``dcmotor`` (MuJoCo 4); other joints have a ``motor`` whose
                input is the torque. Joints that mimic others have none.

        Raises:
            MissingName: no such place for an encoder, or a servo of a joint that is none.
            JointplayError: a servo whose encoder is on the link of a joint with play.
        """
        check_encoder(encoder)
        reduced = {one.joint: one for one in reductions}
        check_servos(self.mechanism, servos, reduced.values())
        loose = {name: one for name, one in reduced.items() if one.dead_band > 0.0}
        root = copy.deepcopy(self.root)
        option = root.find("option")
        assert option is not None
        step = self.step(loose.values())
        option.set("timestep", f"{step:.6g}")
        world = root.find("worldbody")
        assert world is not None
        for element in world.iter("joint"):
            name = element.get("name", "")
            if name in self.mechanism.joints:
                numbers = self._losses(name, reduced.get(name), servos.get(name))
                for key, value in numbers.items():
                    element.attrib.pop(key, None)
                    if value > 0.0:
                        element.set(key, f"{value:.17g}")
        tendon, actuator, sensor = (put(root, tag) for tag in ("tendon", "actuator", "sensor"))
        for name, one in loose.items():
            half = 0.5 * one.dead_band
            teeth = {"stiffness": one.stiffness, "damping": one.damping}
            play = put(tendon, "fixed", name=f"{name}.play", springlength=(-half, half), **teeth)
            put(play, "joint", joint=f"{name}_play", coef=1.0)
            losses = {"frictionloss": one.friction, "damping": one.viscous}
            link = put(tendon, "fixed", name=f"{name}.link", **losses)
            for part in (name, f"{name}_play"):
                put(link, "joint", joint=part, coef=1.0)
        for name in self.leaning:
            put_rim(tendon, reduced[name], step)
        described = self.mechanism.description.joints
        for name in self.mechanism.joints:
            if described[name].mimics:
                continue
            if name in servos:
                actuator.append(ElementTree.Comment(explain(servos[name])))
                put(actuator, "dcmotor", name=name, joint=name, **dc_motor(servos[name]))
            else:
                put(actuator, "motor", name=name, joint=name)
            if name in loose and encoder == "link":
                put(sensor, "tendonpos", name=f"{name}.encoder", tendon=f"{name}.link")
            else:
                put(sensor, "jointpos", name=f"{name}.encoder", joint=name)
        ElementTree.indent(root)
        return ElementTree.tostring(root, encoding="unicode") + "\n"

    def _losses(
        self, name: str, reduction: Reduction | None, servo: Servo | None
    ) -> dict[str, float]:
        """Friction, damping and rotor of a joint of the URDF; of a loose one, the motor's."""
        numbers = servo_friction(servo)
        if reduction is not None and reduction.dead_band > 0.0:
            return numbers | {"armature": reduction.rotor_inertia}
        entry = self.mechanism.description.joints[name]
        own = (entry.friction, entry.damping)
        if reduction is not None:
            own = (reduction.friction, reduction.viscous)
        numbers["frictionloss"] += own[0]
        numbers["damping"] += own[1]
        return numbers | {"armature": rotor_inertia(self.mechanism, name)}

    def step(self, reductions: Iterable[Reduction]) -> float:
        """A step that resolves the stiffest teeth with what they turn, at most 1 ms [s]."""
        loose = list(reductions)
        matrix = self.mass.copy()
        for name in self.mechanism.joints:
            row = self.dofs[name]
            matrix[row, row] += rotor_inertia(self.mechanism, name)
        for one in loose:
            row = self.dofs[one.joint]
            matrix[row, row] += one.rotor_inertia - rotor_inertia(self.mechanism, one.joint)
        step = LONGEST_STEP_S
        if loose:
            rows = [self.dofs[f"{one.joint}_play"] for one in loose]
            gives = np.linalg.inv(matrix)[np.ix_(rows, rows)]
            root = np.sqrt([one.stiffness for one in loose])
            fastest = float(np.linalg.eigvalsh(root[:, None] * gives * root)[-1])
            step = min(step, _RESOLVED / math.sqrt(fastest))
        return step


def compile_robot(
    mechanism: Mechanism,
    reductions: Sequence[Reduction],
    pose: Mapping[str, float] = MappingProxyType({}),
    tilt: bool = False,
) -> CompiledRobot:
    """Have MuJoCo compile the robot's URDF, and put a hinge in series with each loose joint.

    Pairs of bodies whose shapes touch at the pose do not collide in the file: MuJoCo takes each
    mesh for its convex hull.

    Args:
        reductions: joints with a dead band get the hinge.
        pose: joint positions at which shapes must not touch [rad or m]; the rest zero.
        tilt: joints whose axes can lean get hinges for it.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot compile the robot; a robot that is no
            tree of single joints, or has a `J_play` or `J_motor` already.
    """
    mujoco = load_mujoco()
    bodies(mechanism)
    leaning = [one for one in reductions if tilt and one.tilt > 0.0]
    refuse_taken(mechanism, reductions)
    root = mechanism.description.elements()
    for old in root.findall("mujoco"):
        root.remove(old)
    put(put(root, "mujoco"), "compiler", **_COMPILER)
    meshes, notes = _meshes(mechanism, root)
    text = ElementTree.tostring(root, encoding="unicode")
    try:
        spec = mujoco.MjSpec.from_string(text, assets=meshes)
        for mesh in spec.meshes:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # of flat ones, too
        _edit(mujoco, spec, mechanism, reductions, leaning)
        model = spec.compile()
        touching = _touching(mujoco, model, pose)
        for first, second in touching:
            spec.add_exclude(bodyname1=first, bodyname2=second)
        model = spec.compile()
        spec.meshdir = MESHES
        made = ElementTree.fromstring(spec.to_xml())
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise JointplayError(f"MuJoCo cannot compile the robot's URDF: {reason}") from None
    if touching:
        pairs = ", ".join(f"{a} and {b}" for a, b in touching)
        notes.append(f"shapes that touch at the pose do not collide in the MJCF: {pairs}")
    data = mujoco.MjData(model)
    _place(mujoco, model, data, pose)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    mass[np.diag_indices(model.nv)] -= model.dof_armature
    dofs = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    if made.find("option") is None:
        put(made, "option")
    names = tuple(one.joint for one in leaning)
    return CompiledRobot(mechanism, made, meshes, mass, dofs, tuple(notes), names)


def _meshes(mechanism: Mechanism, root: ElementTree.Element) -> tuple[dict[str, bytes], list[str]]:
    """Files of the URDF's meshes as STL, named in `root` instead; shapes without one go."""
    import trimesh

    folders, stored = mesh_folders(mechanism), mechanism.description.stored
    known: dict[Path, str] = {}
    made: dict[str, bytes] = {}
    missing: dict[str, None] = {}
    for link in root.findall("link"):
        for shape in (*link.findall("visual"), *link.findall("collision")):
            mesh = shape.find("geometry/mesh")
            if mesh is None:
                continue
            path = find_mesh(mesh.get("filename", ""), folders, anywhere=not stored)
            parts = None if path is None else readable(path)
            if path is None or parts is None:
                missing[mesh.get("filename", "")] = None
                link.remove(shape)
                continue
            if path not in known:
                stem, number = path.stem, 1
                while f"{stem}.stl" in made:
                    number += 1
                    stem = f"{path.stem}_{number}"
                corners = np.concatenate([part.corners() for part in parts])
                whole = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners))
                known[path] = f"{stem}.stl"
                made[f"{stem}.stl"] = whole.export(file_type="stl")
            mesh.set("filename", known[path])
    notes = []
    if missing:
        notes.append(f"shapes left out of the MJCF, their meshes are missing: {', '.join(missing)}")
    return made, notes


def _edit(
    mujoco: Any,
    spec: Any,
    mechanism: Mechanism,
    reductions: Sequence[Reduction],
    leaning: Sequence[Reduction],
) -> None:
    """Put hinges of play and lean, the tool and what mimics into the compiled tree."""
    spec.option.gravity = mechanism.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for one in reductions:
        if one.dead_band > 0.0:
            motor = spec.joint(one.joint)
            motor.armature = one.rotor_inertia  # without it two hinges would turn one inertia
            hinge = mujoco.mjtJoint.mjJNT_HINGE
            where = {"pos": motor.pos, "axis": motor.axis}
            motor.parent.add_joint(name=f"{one.joint}_play", type=hinge, **where)
    tree = {body.name: body for body in bodies(mechanism)}
    for one in leaning:
        body, moved = tree[one.joint], spec.joint(one.joint).parent
        for part, axis in lean_axes(body.axis).items():
            kind = mujoco.mjtJoint.mjJNT_HINGE
            moved.add_joint(name=f"{one.joint}.{part}", type=kind, axis=axis)
        end = one.half_length * body.axis
        moved.add_site(name=f"{one.joint}.rim", pos=end)
        holder = spec.joint(body.parent).parent if body.parent else spec.worldbody
        holder.add_site(name=f"{one.joint}.bore", pos=body.placement.act(end))
    ideal = mechanism.ideal()
    tool = ideal.model.frames[ideal.tool_frame]
    carrier = str(ideal.model.names[tool.parentJoint])
    body = spec.joint(carrier).parent if carrier in mechanism.joints else spec.worldbody
    body.add_site(name=f"{mechanism.tool}.tool", pos=tool.placement.translation)
    for name in mechanism.joints:
        mimic = mechanism.description.joints[name].mimic
        if mimic is not None:
            follows = spec.add_equality(
                type=mujoco.mjtEq.mjEQ_JOINT,
                objtype=mujoco.mjtObj.mjOBJ_JOINT,
                name1=name,
                name2=mimic.leader,
            )
            follows.data[:2] = mimic.offset, mimic.multiplier


def _place(mujoco: Any, model: Any, data: Any, pose: Mapping[str, float]) -> None:
    """Put joints to positions and compute what follows."""
    for name, value in pose.items():
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)


def _touching(mujoco: Any, model: Any, pose: Mapping[str, float]) -> list[tuple[str, str]]:
    """Pairs of bodies whose shapes touch."""
    data = mujoco.MjData(model)
    _place(mujoco, model, data, pose)
    pairs: dict[tuple[str, str], None] = {}
    for contact in data.contact:
        first, second = (model.body(model.geom_bodyid[i]).name for i in contact.geom)
        pairs[first, second] = None
    return list(pairs)


@dataclass(frozen=True)
class PlayFound:
    """What MuJoCo's link does when it is pushed to and fro while its motor stands."""

    dead_band: float
    """Whole angle in which it turns freely [rad]."""
    stiffness: float
    """Of what stops it [N m/rad]."""


def _load(mujoco: Any, text: str, meshes: Mapping[str, bytes]) -> Any:
    """The model of a written MJCF, without gravity, friction and contacts."""
    try:
        model = mujoco.MjModel.from_xml_string(
            text, {f"{MESHES}/{k}": v for k, v in meshes.items()}
        )
    except ValueError as error:
        raise JointplayError(f"MuJoCo cannot load the MJCF: {error}") from None
    model.opt.gravity[:] = 0.0
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONTACT)
    model.tendon_frictionloss[:] = 0.0
    model.dof_frictionloss[:] = 0.0
    return model


def find_play(
    text: str, meshes: Mapping[str, bytes] = MappingProxyType({})
) -> dict[str, PlayFound]:
    """Play of each joint of a written MJCF: pushed both ways with two torques in MuJoCo.

    All other joints are held; gravity, friction and contacts are switched off. The torques turn the
    link by a tenth and by a fifth of its play beyond it.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot load the file.
    """
    mujoco = load_mujoco()
    model = _load(mujoco, text, meshes)
    found = {}
    for index in range(model.ntendon):
        tendon = model.tendon(index)
        if not tendon.name.endswith(".play"):
            continue
        name = tendon.name.removesuffix(".play")
        alone = copy.copy(model)
        row = int(alone.joint(f"{name}_play").dofadr[0])
        others = np.arange(alone.nv) != row
        alone.dof_armature[others] = 1e6
        data = mujoco.MjData(alone)
        mujoco.mj_setConst(alone, data)
        stiffness = float(np.ravel(model.tendon_stiffness[index])[0])
        inertia = 1.0 / float(alone.dof_invweight0[row])
        alone.dof_damping.reshape(alone.nv, -1)[row, 0] = 2.0 * math.sqrt(stiffness * inertia)
        push = 0.1 * stiffness * float(np.ptp(alone.tendon_lengthspring[index]))
        at = int(alone.joint(f"{name}_play").qposadr[0])
        widths = []
        for torque in (push, 2.0 * push):
            ends = []
            for sign in (-1.0, 1.0):
                mujoco.mj_resetData(alone, data)
                data.qfrc_applied[row] = sign * torque
                # Ten time constants of the spring, and as many of what the damper lets creep.
                swing = math.sqrt(inertia / stiffness)
                damping = 2.0 * inertia / swing + float(np.ravel(model.tendon_damping[index])[0])
                settle = 40.0 * max(damping / stiffness, swing)
                for _ in range(math.ceil(settle / alone.opt.timestep)):
                    mujoco.mj_step(alone, data)
                ends.append(float(data.qpos[at]))
            widths.append(ends[1] - ends[0])
        beyond = widths[1] - widths[0]
        found[name] = PlayFound(widths[0] - beyond, 2.0 * push / beyond)
    return found


def reach(
    mechanism: Mechanism,
    reductions: Iterable[Reduction],
    pose: Mapping[str, float],
    leaning: Iterable[str] = (),
) -> tuple[float, Budget]:
    """How far the files' play lets the tool be off at the pose [m], and the robot's own budget.

    Of both the worst case. Files have no travel of journals aside and along.

    Args:
        leaning: joints whose axes lean in the files.
    """
    found = budget(mechanism, pose)
    bands = {one.joint: one.dead_band for one in reductions}
    tilts = {one.joint: one.tilt for one in reductions if one.joint in set(leaning)}
    plays = [LeanPlay(tilts.get(name, 0.0)) for name in mechanism.clearance]
    turns = [TurnPlay(0.5 * bands.get(name, 0.0)) for name in mechanism.gears]
    written = replace(found.sources, plays=(*plays, *turns))
    return float(farthest(written, turn=False)[0][0]), found


_PUSH_N, _CROSSING_S = 100.0, 0.05
"""Force by which MuJoCo's tool is pushed, and time in which journals lean from side to side."""


def find_reach(
    text: str,
    meshes: Mapping[str, bytes],
    tool: str,
    pose: Mapping[str, float],
    direction: np.ndarray,
) -> float:
    """How far the lean of a written MJCF lets the tool move along a direction, either way [m].

    The tool is pushed there and back in MuJoCo, all hinges but those of lean held, without gravity,
    friction and contacts.

    Args:
        tool: frame of the tool.
        pose: joint positions [rad or m]; the rest zero.
        direction: unit vector in world axes, shape (3,).

    Raises:
        JointplayError: MuJoCo is not installed, or cannot load the file.
    """
    mujoco = load_mujoco()
    model = _load(mujoco, text, meshes)
    leans = [
        int(model.jnt_dofadr[i])
        for i in range(model.njnt)
        if model.joint(i).name.endswith((".pitch", ".roll"))
    ]
    held = np.setdiff1d(np.arange(model.nv), leans)
    model.dof_armature[held] = 1e6
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    _place(mujoco, model, data, pose)
    site = model.site(f"{tool}.tool").id
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, site)
    torque = _PUSH_N * direction @ jacobian
    torque[held] = 0.0
    damping = model.dof_damping.reshape(model.nv, -1)
    for first, second in zip(leans[::2], leans[1::2], strict=True):
        name = model.joint(int(model.dof_jntid[first])).name.removesuffix(".pitch")
        arm = float(np.linalg.norm(model.site(f"{name}.rim").pos))
        tilt = float(model.tendon_range[model.tendon(f"{name}.rim").id, 1]) / arm
        size = math.hypot(torque[first], torque[second])
        damping[[first, second], 0] = max(size, 1e-3) * _CROSSING_S / (2.0 * tilt)
    ends = []
    for sign in (-1.0, 1.0):
        data.qfrc_applied[:] = sign * torque
        for _ in range(math.ceil(20.0 * _CROSSING_S / model.opt.timestep)):
            mujoco.mj_step(model, data)
        ends.append(float(direction @ data.site_xpos[site]))
    return 0.5 * (ends[1] - ends[0])


# ROS.


def to_ros2(mechanism: Mechanism, reductions: Sequence[Reduction], plugin: str = PLUGIN) -> str:
    """The robot's own URDF with the play of all joints and ros2_control's tags.

    Motors have the command interface ``effort`` and a transmission of 1, for the numbers are those
    of the joint's side of the gear; hinges of play are only read. If the URDF has tags of
    ros2_control of its own, only the hinges of play are added to the first of them.

    Args:
        plugin: of the hardware, such as ``mock_components/GenericSystem``.

    Raises:
        JointplayError: see `refuse_taken`.
    """
    root = with_play(mechanism, reductions)
    system = root.find("ros2_control")
    if system is None:
        system = put(root, "ros2_control", name=mechanism.description.path.stem, type="system")
        ElementTree.SubElement(put(system, "hardware"), "plugin").text = plugin
        for name in mechanism.joints:
            mimics = mechanism.description.joints[name].mimics
            _interfaces(system, name, () if mimics else ("effort",))
        for name in mechanism.joints:
            if not mechanism.description.joints[name].mimics:
                _transmission(system, name)
    for one in reductions:
        if one.dead_band > 0.0:
            _interfaces(system, f"{one.joint}_play", ())
    return document(root)


def _interfaces(system: ElementTree.Element, joint: str, commands: Sequence[str]) -> None:
    """A joint that is read, and commanded in these ways."""
    element = put(system, "joint", name=joint)
    for command in commands:
        put(element, "command_interface", name=command)
    for state in ("position", "velocity", "effort"):
        put(element, "state_interface", name=state)


def _transmission(system: ElementTree.Element, joint: str) -> None:
    element = put(system, "transmission", name=f"{joint}_transmission")
    kind = "transmission_interface/SimpleTransmission"
    ElementTree.SubElement(element, "plugin").text = kind
    put(element, "actuator", name=f"{joint}_actuator", role="actuator1")
    held = put(element, "joint", name=joint, role="joint1")
    ElementTree.SubElement(held, "mechanical_reduction").text = "1.0"


# Random copies.


@dataclass(frozen=True)
class Interval:
    """From where to where a number of a joint is drawn, each value as likely as any other."""

    joint: str
    quantity: str
    """Of `QUANTITIES`."""
    low: float
    high: float
    origin: str
    """``identified``, or ``assumed``."""

    @property
    def label(self) -> str:
        """Head of its column."""
        return f"{self.joint} {self.quantity} [{QUANTITIES[self.quantity]}]"


def intervals(
    mechanism: Mechanism,
    reductions: Iterable[Reduction],
    spread: float,
    identified: Mapping[str, Any] | None = None,
    servos: Mapping[str, Servo] = MappingProxyType({}),
    leaning: Iterable[str] = (),
) -> list[Interval]:
    """Intervals of half play, friction, stiffness and lean of each joint, and its servo's friction.

    Args:
        spread: half width, relative, of what was not identified: an assumption.
        identified: what `Identification.describe` says, the contents of ``identified.json``.
            Gear play, gear compliance and dry friction are taken as they are; the coefficient of
            friction scales the bearing's part of the friction. A clearance gives no dead band about
            the axis, and is not drawn; the lean is, within the spread.
        leaning: joints whose axes lean in the files.

    Raises:
        JointplayError: a negative spread, or one of 100 % or more, for which play would vanish;
            nothing that was identified belongs to the joints with play.
    """
    require_non_negative("spread", spread, "")
    if spread >= 1.0:
        raise JointplayError(f"the spread must be below 100 %, got {100.0 * spread:g} %")
    known = {} if identified is None else _known(identified)
    found, used, leaning = [], 0, set(leaning)
    for one in reductions:
        own = mechanism.description.joints[one.joint].friction
        numbers = {"half_play": 0.5 * one.dead_band}
        numbers |= {"friction": one.friction, "stiffness": one.stiffness}
        numbers["motor_friction"] = servo_friction(servos.get(one.joint))["frictionloss"]
        numbers["tilt"] = one.tilt if one.joint in leaning else 0.0
        ends = {k: (x * (1.0 - spread), x * (1.0 + spread)) for k, x in numbers.items()}
        mine = {name: row for (joint, name), row in known.items() if joint == one.joint}
        better = {}
        if "gear_play" in mine and one.dead_band > 0.0:
            low, high, _ = mine["gear_play"]
            better["half_play"] = (0.5 * low, 0.5 * high)
        if "gear_compliance" in mine and one.dead_band > 0.0 and mine["gear_compliance"][0] > 0.0:
            low, high, _ = mine["gear_compliance"]
            better["stiffness"] = (1.0 / high, 1.0 / low)
        if {"dry_friction", "friction"} & set(mine):
            bearing = max(one.friction - own, 0.0)
            dry = mine.get("dry_friction", (own, own, own))
            low, high, nominal = mine.get("friction", (1.0, 1.0, 1.0))
            better["friction"] = (
                dry[0] + bearing * low / nominal,
                dry[1] + bearing * high / nominal,
            )
        used += len(better)
        for quantity in QUANTITIES:
            low, high = better.get(quantity, ends[quantity])
            origin = "identified" if quantity in better else "assumed"
            if high > 0.0 or quantity in better:
                found.append(Interval(one.joint, quantity, low, high, origin))
    if known and not used:
        rows = ", ".join(f"{joint} {name.replace('_', ' ')}" for joint, name in known)
        names = ", ".join(one.joint for one in reductions)
        raise JointplayError(
            f"nothing that was identified ({rows}) is drawn for the joints {names}: gear play, "
            "gear compliance, dry friction and friction are"
        )
    return found


def _known(identified: Mapping[str, Any]) -> dict[tuple[str, str], tuple[float, float, float]]:
    """Interval and the scenario's value of what was identified, by joint and name."""
    rows = identified.get("unknowns") if isinstance(identified, Mapping) else None
    if not isinstance(rows, list):
        raise JointplayError("this is no file of jointplay identify: it has no list 'unknowns'")
    found = {}
    for row in rows:
        if not {"low", "high", "joint", "unknown"} <= set(row):
            continue  # the measurement could not tell
        low, high = float(row["low"]), float(row["high"])
        nominal = float(row.get("scenario") or row.get("found") or 1.0)
        found[str(row["joint"]), str(row["unknown"])] = (low, high, nominal)
    if not found:
        raise JointplayError("nothing was identified: no unknown in the file has an interval")
    return found


def read_identified(path: str | Path, joints: Iterable[str]) -> dict[str, Any]:
    """What `jointplay identify` wrote as ``identified.json``, of a robot with these joints.

    Raises:
        MissingName: it is about a joint that the robot does not have.
        JointplayError: it cannot be read, or is another file.
    """
    try:
        data = json.loads(Path(path).read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise JointplayError(f"cannot read {str(path)!r}: {error}") from None
    except ValueError as error:
        raise JointplayError(f"{str(path)!r} is no JSON: {error}") from None
    names = list(joints)
    try:
        known = _known(data)
    except JointplayError as error:
        raise JointplayError(f"{str(path)!r}: {error}") from None
    for joint, _ in known:
        if joint and joint not in names:
            raise MissingName("joint", joint, names)
    return dict(data)


def draw(ranges: Sequence[Interval], count: int, seed: int) -> np.ndarray:
    """Values within the intervals, each as likely as any other, shape (count, len(ranges)) [SI].

    Raises:
        JointplayError: fewer than one copy, or a negative seed.
    """
    if count < 1:
        raise JointplayError(f"a batch has at least one copy, got {count}")
    if seed < 0:
        raise JointplayError(f"the seed must not be negative, got {seed}")
    low, high = np.array([[one.low, one.high] for one in ranges]).reshape(-1, 2).T
    return low + (high - low) * np.random.default_rng(seed).random((count, len(ranges)))


def drawn(
    reductions: Iterable[Reduction], ranges: Sequence[Interval], row: np.ndarray
) -> list[Reduction]:
    """The joints with the values of a row of `draw`."""
    changes: dict[str, dict[str, Any]] = {}
    for one, value in zip(ranges, row, strict=True):
        if one.quantity == "motor_friction":
            continue
        name = "dead_band" if one.quantity == "half_play" else one.quantity
        factor = 2.0 if one.quantity == "half_play" else 1.0
        changes.setdefault(one.joint, {})[name] = factor * float(value)
    return [replace(one, **changes.get(one.joint, {})) for one in reductions]


def drawn_servos(
    servos: Mapping[str, Servo], ranges: Sequence[Interval], row: np.ndarray
) -> dict[str, Servo]:
    """The servos with the friction of a row of `draw`."""
    values = zip(ranges, row, strict=True)
    found = {one.joint: float(x) for one, x in values if one.quantity == "motor_friction"}
    return {k: replace(s, friction=found[k]) if k in found else s for k, s in servos.items()}


def table(ranges: Sequence[Interval], values: np.ndarray, names: Sequence[str]) -> Table:
    """What was drawn, a row for each copy [SI]."""
    columns = [Column("copy", names)]
    for one, drawn in zip(ranges, values.T, strict=True):
        columns.append(Column(one.label, drawn, key=one.label))
    return Table(columns)
