"""A robot with the play of its joints as MJCF, compiled and checked by MuJoCo.

The MJCF is the robot's own URDF as MuJoCo compiles it, shapes included. In series with each joint
J that has a dead band is a hinge `J_play` about the same axis, in the same body: J is the motor,
loaded with its rotor's inertia, and J_play is the link's angle relative to it. A tendon whose
spring has a dead band holds J_play, as MuJoCo has none inside an actuator; a second tendon, J plus
J_play, is the link's angle and has the friction of bearing and joint. A journal that tilts has two
more hinges, J.pitch and J.roll, which a tendon, J.rim, keeps within the bore.

Three checks run the written file in MuJoCo: `find_play` pushes each link through its dead band,
`find_reach` pushes the tool through the tilts, `follow` repeats the reversals of the full model.
"""

from __future__ import annotations

import copy
import math
import time as clock
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from jointplay.base.errors import JointplayError, require_known
from jointplay.bridges.dead_band import DeadBand
from jointplay.bridges.reduced_files import bodies, check_encoder, refuse_taken
from jointplay.bridges.reduction import LONGEST_STEP_S, RESOLVED, SETTLED, Reduction
from jointplay.model.elements import Element, put
from jointplay.model.mechanism import Mechanism
from jointplay.model.meshes import FOLDER, readable
from jointplay.model.mjcf import load_mujoco
from jointplay.model.visuals import find_mesh, mesh_folders
from jointplay.simulation.loads.drive import Servo

_STIFF = np.array([0.99, 0.9999, 1e-6])
"""MuJoCo's impedance of the bore: as stiff as it takes."""
_PRESCRIBED = 1e6
"""Inertia given to joints with prescribed motion, when models are compared [kg m^2]: for an arm of
3 kg, 1e4 gives the same reach within 1e-3, 1e8 one that is 1 % larger."""
_MOST_IN_STL = 200_000
"""Most triangles of an STL that MuJoCo reads (by its error message); an OBJ may have any number."""
_COMPILER = {
    "fusestatic": "true",
    "discardvisual": "false",
    "strippath": "true",
    "balanceinertia": "true",
    "inertiafromgeom": "false",
    "boundmass": 1e-9,
    "boundinertia": 1e-12,
}
"""Options with which MuJoCo compiles a URDF: masses are the URDF's, never the shapes'."""


@dataclass(frozen=True)
class CompiledRobot:
    """A robot compiled by MuJoCo, with hinges for dead bands and tilts, yet without numbers."""

    mechanism: Mechanism
    root: Element
    meshes: Mapping[str, bytes]
    """Files of shapes by name, which belong in the folder `FOLDER`."""
    mass: np.ndarray
    """Mass matrix at the pose, without rotors, (nv, nv)."""
    dofs: Mapping[str, int]
    """Row of each joint in the mass matrix."""
    notes: tuple[str, ...]
    """Differences from the URDF, a line each."""
    tilting: tuple[str, ...]
    """Joints with hinges of tilt."""

    def mjcf(
        self,
        reductions: Iterable[Reduction],
        *,
        encoder: str = "motor",
        servos: Mapping[str, Servo] = MappingProxyType({}),
    ) -> str:
        """The MJCF with these numbers of play.

        Args:
            reductions: parameters of the joints' play.
            encoder: ``motor`` or ``link``: what the sensor `J.encoder` reads.
            servos: servos by joint; each is a ``dcmotor`` (MuJoCo 4). Other joints have a ``motor``
                whose input is the torque; joints that mimic others have no actuator.

        Raises:
            MissingName: no such place for an encoder, or no such joint for a servo.
            JointplayError: a servo whose encoder is on the link of a joint with play.
        """
        check_encoder(encoder)
        reduced = {reduction.joint: reduction for reduction in reductions}
        loose = {name: r for name, r in reduced.items() if r.dead_band > 0.0}
        for name, servo in servos.items():
            require_known("moving joint", name, self.mechanism.joints)
            if name in loose and servo.encoder == "link":
                raise JointplayError(
                    f"the servo of {name!r} has its encoder on the link, and MuJoCo's dcmotor can "
                    'only control what it turns, the motor: give its encoder as "motor", or no '
                    "servo"
                )
        root = copy.deepcopy(self.root)
        option, world = root.find("option"), root.find("worldbody")
        assert option is not None
        assert world is not None
        step = self.step(loose.values())
        option.set("timestep", f"{step:.6g}")
        # Joints: friction, damping and rotors.
        for element in world.iter("joint"):
            name = element.get("name", "")
            if name in self.mechanism.joints:
                numbers = self._losses(name, reduced.get(name), servos.get(name))
                for key, value in numbers.items():
                    element.attrib.pop(key, None)
                    if value > 0.0:
                        element.set(key, f"{value:.17g}")
        # Tendons: teeth with a dead band, and rims within the bore.
        tendon, actuator, sensor = (put(root, tag) for tag in ("tendon", "actuator", "sensor"))
        for name, reduction in loose.items():
            put_play(tendon, reduction, f"{name}_play")
        for name in self.tilting:
            rim = put(
                tendon, "spatial", name=f"{name}.rim", limited="true",
                range=(0.0, reduced[name].half_length * reduced[name].tilt),
                solreflimit=(2.0 * step, 1.0), solimplimit=_STIFF,
            )  # fmt: skip
            for end in ("bore", "rim"):
                put(rim, "site", site=f"{name}.{end}")
        # Actuators and encoders.
        described = self.mechanism.description.joints
        for name in self.mechanism.joints:
            if described[name].mimic:
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
        """Friction, damping and armature of a joint in the MJCF.

        With a dead band, the joint is the motor and has the servo's losses and the rotor; those of
        the link are in a tendon. Without, it has the losses of both.
        """
        numbers = {"frictionloss": 0.0, "damping": 0.0}
        if servo is not None:
            numbers = {"frictionloss": servo.friction, "damping": servo.viscous}
        if reduction is not None and reduction.dead_band > 0.0:
            return numbers | {"armature": reduction.rotor_inertia}
        entry = self.mechanism.description.joints[name]
        losses = (entry.friction, entry.damping)
        if reduction is not None:
            losses = (reduction.friction, reduction.viscous)
        numbers["frictionloss"] += losses[0]
        numbers["damping"] += losses[1]
        return numbers | {"armature": rotor_inertia(self.mechanism, name)}

    def step(self, reductions: Iterable[Reduction]) -> float:
        """Time step that resolves these joints' teeth at the pose; see `resolving_step` [s]."""
        loose = list(reductions)
        matrix, inertia = self.mass.copy(), {r.joint: r.rotor_inertia for r in loose}
        for name in self.mechanism.joints:
            row = self.dofs[name]
            matrix[row, row] += inertia.get(name, rotor_inertia(self.mechanism, name))
        rows = [self.dofs[f"{r.joint}_play"] for r in loose]
        return resolving_step(matrix, rows, [r.stiffness for r in loose])


def put_play(tendon: Element, reduction: Reduction, hinge: str) -> None:
    """Add the tendons of a joint's play: teeth that hold the `hinge`, and the link's losses."""
    name, half = reduction.joint, 0.5 * reduction.dead_band
    teeth = {"stiffness": reduction.stiffness, "damping": reduction.damping}
    play = put(tendon, "fixed", name=f"{name}.play", springlength=(-half, half), **teeth)
    put(play, "joint", joint=hinge, coef=1.0)
    losses = {"frictionloss": reduction.friction, "damping": reduction.viscous}
    link = put(tendon, "fixed", name=f"{name}.link", **losses)
    for part in (name, hinge):
        put(link, "joint", joint=part, coef=1.0)


def resolving_step(mass: np.ndarray, rows: Sequence[int], stiffness: Sequence[float]) -> float:
    """Time step that resolves the fastest vibration on the teeth, at most 1 ms [s].

    Args:
        mass: mass matrix (nv, nv), rotors included.
        rows: rows of the hinges of play in it.
        stiffness: stiffness of their teeth [N m/rad].
    """
    if not rows:
        return LONGEST_STEP_S
    # Squared angular frequencies: eigenvalues of K^(1/2) M^-1 K^(1/2).
    inverse = np.linalg.inv(mass)[np.ix_(rows, rows)]
    root = np.sqrt(stiffness)
    fastest = float(np.linalg.eigvalsh(root[:, None] * inverse * root)[-1])
    return min(LONGEST_STEP_S, RESOLVED / math.sqrt(fastest))


def compile_robot(
    mechanism: Mechanism,
    reductions: Sequence[Reduction],
    pose: Mapping[str, float] = MappingProxyType({}),
    tilt: bool = False,
) -> CompiledRobot:
    """Have MuJoCo compile the robot's URDF, and put a hinge in series with each loose joint.

    Pairs of bodies whose shapes touch at the pose (joint positions [rad or m], the rest zero) do
    not collide in the file, as MuJoCo takes the convex hull of each mesh. With `tilt`, joints whose
    axes can tilt get hinges for that.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot compile the robot; a robot that is not a
            tree of single joints, or has a `J_play` or `J_motor` already.
    """
    mujoco = load_mujoco()
    bodies(mechanism)
    tilting = [r for r in reductions if tilt and r.tilt > 0.0]
    refuse_taken(mechanism, reductions)
    root = mechanism.description.elements()
    for element in root.findall("mujoco"):
        root.remove(element)
    put(put(root, "mujoco"), "compiler", **_COMPILER)
    meshes, notes = take_meshes(mechanism, root)
    text = ElementTree.tostring(root, encoding="unicode")
    try:
        spec = mujoco.MjSpec.from_string(text, assets=meshes)
        for mesh in spec.meshes:
            mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_SHELL  # flat meshes have no volume
        _edit(mujoco, spec, mechanism, reductions, tilting)
        # Compiled twice: only the first model tells which shapes touch at the pose.
        model = spec.compile()
        touching = _touching(mujoco, model, pose)
        for first, second in touching:
            spec.add_exclude(bodyname1=first, bodyname2=second)
        model = spec.compile()
        spec.meshdir = FOLDER
        compiled = ElementTree.fromstring(spec.to_xml())
    except (ValueError, mujoco.FatalError) as error:
        reason = " ".join(str(error).split())
        raise JointplayError(f"MuJoCo cannot compile the robot's URDF: {reason}") from None
    if touching:
        pairs = ", ".join(f"{a} and {b}" for a, b in touching)
        notes.append(f"shapes that touch at the pose do not collide in the MJCF: {pairs}")
    mass = mass_at(model, pose)
    mass[np.diag_indices(model.nv)] -= model.dof_armature
    dofs = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    if compiled.find("option") is None:
        put(compiled, "option")
    names = tuple(r.joint for r in tilting)
    return CompiledRobot(mechanism, compiled, meshes, mass, dofs, tuple(notes), names)


def take_meshes(mechanism: Mechanism, root: Element) -> tuple[dict[str, bytes], list[str]]:
    """Convert the URDF's meshes to STL or OBJ; `root` then names these, without missing ones.

    Returns:
        The files by name, and a note if meshes are missing.
    """
    import trimesh

    folders, stored = mesh_folders(mechanism), mechanism.description.stored
    names_by_path: dict[Path, str] = {}
    files: dict[str, bytes] = {}
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
            if path not in names_by_path:
                corners = np.concatenate([part.corners() for part in parts])
                solid = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners))
                kind = "stl" if len(corners) <= _MOST_IN_STL else "obj"
                name, number = f"{path.stem}.{kind}", 1
                while name in files:
                    number += 1
                    name = f"{path.stem}_{number}.{kind}"
                content = solid.export(file_type=kind)
                files[name] = content.encode() if isinstance(content, str) else content
                names_by_path[path] = name
            mesh.set("filename", names_by_path[path])
    note = f"shapes left out of the MJCF, their meshes are missing: {', '.join(missing)}"
    return files, [note] * bool(missing)


def _edit(
    mujoco: Any,
    spec: Any,
    mechanism: Mechanism,
    reductions: Sequence[Reduction],
    tilting: Sequence[Reduction],
) -> None:
    """Add the hinges of play and tilt, the tool's site, and equalities for joints that mimic."""
    hinge = mujoco.mjtJoint.mjJNT_HINGE
    spec.option.gravity = mechanism.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    # Play: a second hinge in the same body, about the same axis.
    for reduction in reductions:
        if reduction.dead_band > 0.0:
            motor = spec.joint(reduction.joint)
            # Without a rotor, two hinges would turn one inertia: the mass matrix would be singular.
            motor.armature = reduction.rotor_inertia
            placement = {"type": hinge, "pos": motor.pos, "axis": motor.axis}
            motor.parent.add_joint(name=f"{reduction.joint}_play", **placement)
    # Tilt: two hinges across the axis, and sites at the rims of journal and bore, whose distance a
    # tendon limits.
    tree = {body.name: body for body in bodies(mechanism)}
    for reduction in tilting:
        body, moving = tree[reduction.joint], spec.joint(reduction.joint).parent
        for part, axis in tilt_axes(body.axis).items():
            moving.add_joint(name=f"{reduction.joint}.{part}", type=hinge, axis=axis)
        end = reduction.half_length * body.axis
        moving.add_site(name=f"{reduction.joint}.rim", pos=end)
        holder = spec.worldbody if body.parent is None else spec.joint(body.parent.name).parent
        holder.add_site(name=f"{reduction.joint}.bore", pos=body.placement.act(end))
    ideal = mechanism.ideal()
    tool = ideal.model.frames[ideal.tool_frame]
    carrier = str(ideal.model.names[tool.parentJoint])
    body = spec.joint(carrier).parent if carrier in mechanism.joints else spec.worldbody
    body.add_site(name=f"{mechanism.tool}.tool", pos=tool.placement.translation)
    for name in mechanism.joints:
        mimic = mechanism.description.joints[name].mimic
        if mimic is not None:
            kind = {"type": mujoco.mjtEq.mjEQ_JOINT, "objtype": mujoco.mjtObj.mjOBJ_JOINT}
            equality = spec.add_equality(name1=name, name2=mimic.leader, **kind)
            equality.data[:2] = mimic.offset, mimic.multiplier


def _place(mujoco: Any, model: Any, data: Any, pose: Mapping[str, float]) -> None:
    for name, value in pose.items():
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)


def mass_at(model: Any, pose: Mapping[str, float]) -> np.ndarray:
    """MuJoCo's mass matrix at a pose, rotors included, (nv, nv)."""
    mujoco = load_mujoco()
    data = mujoco.MjData(model)
    _place(mujoco, model, data, pose)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    return mass


def _touching(mujoco: Any, model: Any, pose: Mapping[str, float]) -> list[tuple[str, str]]:
    """Pairs of bodies whose shapes touch at the pose."""
    data = mujoco.MjData(model)
    _place(mujoco, model, data, pose)
    names = [[model.body(model.geom_bodyid[i]).name for i in c.geom] for c in data.contact]
    return list(dict.fromkeys((first, second) for first, second in names))


class MeasuredPlay(NamedTuple):
    """Play of a link in MuJoCo, found by pushing it to and fro while its motor stands."""

    dead_band: float
    """Whole angle in which the link turns freely [rad]."""
    stiffness: float
    """Stiffness of the teeth that stop it [N m/rad]."""


def _without_contacts(model: Any, bare: bool = False) -> Any:
    """A copy of a model without contacts between shapes; if `bare` without gravity and friction."""
    model = copy.copy(model)
    model.opt.disableflags |= int(load_mujoco().mjtDisableBit.mjDSBL_CONTACT)
    if bare:
        for numbers in (model.opt.gravity, model.tendon_frictionloss, model.dof_frictionloss):
            numbers[:] = 0.0
    return model


def find_play(written: Any) -> dict[str, MeasuredPlay]:
    """Play of each joint of a compiled MJCF, found in MuJoCo by pushing with two torques both ways.

    All other joints are held; gravity, friction and contacts are switched off. The torques turn the
    link beyond the play by a tenth and by a fifth of it.
    """
    mujoco = load_mujoco()
    model = _without_contacts(written, bare=True)
    plays = {}
    for index in range(model.ntendon):
        tendon = model.tendon(index)
        if not tendon.name.endswith(".play"):
            continue
        name = tendon.name.removesuffix(".play")
        single, hinge = copy.copy(model), play_hinge(model, name)
        row = int(single.joint(hinge).dofadr[0])
        single.dof_armature[np.arange(single.nv) != row] = _PRESCRIBED
        # Zero may lie outside a joint's limits, which would accelerate even so large an inertia.
        single.jnt_limited[np.arange(single.njnt) != single.joint(hinge).id] = 0
        data = mujoco.MjData(single)
        mujoco.mj_setConst(single, data)
        stiffness = float(np.ravel(model.tendon_stiffness[index])[0])
        inertia = 1.0 / float(single.dof_invweight0[row])
        single.dof_damping.reshape(single.nv, -1)[row, 0] = 2.0 * math.sqrt(stiffness * inertia)
        push = 0.1 * stiffness * float(np.ptp(single.tendon_lengthspring[index]))
        coordinate = int(single.joint(hinge).qposadr[0])
        widths = []
        for torque in (push, 2.0 * push):
            ends = []
            for sign in (-1.0, 1.0):
                mujoco.mj_resetData(single, data)
                data.qfrc_applied[row] = sign * torque
                # Tens of time constants of the spring's vibration and of the damper's creep.
                swing = math.sqrt(inertia / stiffness)
                damping = 2.0 * inertia / swing + float(np.ravel(model.tendon_damping[index])[0])
                settle = 40.0 * max(damping / stiffness, swing)
                for _ in range(math.ceil(settle / single.opt.timestep)):
                    mujoco.mj_step(single, data)
                ends.append(float(data.qpos[coordinate]))
            widths.append(ends[1] - ends[0])
        deflection = widths[1] - widths[0]
        plays[name] = MeasuredPlay(widths[0] - deflection, 2.0 * push / deflection)
    return plays


def play_hinge(model: Any, joint: str) -> str | None:
    """Name of the hinge of a joint's play in a written MJCF; None if it has no dead band."""
    tendons = [model.tendon(index).name for index in range(model.ntendon)]
    if f"{joint}.play" not in tendons:
        return None
    first = model.tendon_adr[tendons.index(f"{joint}.play")]
    return str(model.joint(int(model.wrap_objid[first])).name)


_PUSH_N, _CROSSING_S = 100.0, 0.05
"""Force that pushes the tool in MuJoCo [N], and time in which journals tilt to the other side [s]:
with 10 N an arm's reach is the same within 1e-3, with 0.025 or 0.2 s within 6e-3; 1000 N press the
rims into the bore."""


def find_reach(written: Any, tool: str, pose: Mapping[str, float], direction: np.ndarray) -> float:
    """Displacement of the tool along a direction by the tilts of a compiled MJCF, either way [m].

    In MuJoCo the tool is pushed along the unit vector (3,) and back, with all hinges but those of
    tilt held at the pose, without gravity, friction and contacts.
    """
    mujoco = load_mujoco()
    model = _without_contacts(written, bare=True)
    tilts = [
        int(model.jnt_dofadr[i])
        for i in range(model.njnt)
        if model.joint(i).name.endswith((".pitch", ".roll"))
    ]
    locked = np.setdiff1d(np.arange(model.nv), tilts)
    model.dof_armature[locked] = _PRESCRIBED
    data = mujoco.MjData(model)
    mujoco.mj_setConst(model, data)
    _place(mujoco, model, data, pose)
    site = model.site(f"{tool}.tool").id
    jacobian = np.zeros((3, model.nv))
    mujoco.mj_jacSite(model, data, jacobian, None, site)
    torque = _PUSH_N * direction @ jacobian
    torque[locked] = 0.0
    # Dampers that let each journal tilt across its play in `_CROSSING_S` under its torque.
    damping = model.dof_damping.reshape(model.nv, -1)
    for first, second in zip(tilts[::2], tilts[1::2], strict=True):
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


def dc_motor(servo: Servo) -> dict[str, Any]:
    """Attributes of MuJoCo's ``dcmotor`` for a servo.

    MuJoCo's controller demands a torque and limits it to what the supply's voltage gives at the
    present speed; ours sets a voltage. Both are the same motor with the gains P k/R and
    D k/R + k^2/R, whose second part is the back-EMF. Lost are I term, dead band, counts of the
    encoder, and sampling.

    The input is the goal [rad]; with a D gain a second one is the goal's speed times D / (D + k).
    """
    gain = servo.p_gain * servo.stall
    damping = servo.d_gain * servo.stall + servo.braking
    return {
        "motorconst": servo.torque_constant,
        "resistance": servo.resistance,
        "input": "pos vel" if servo.d_gain > 0.0 else "pos",
        "controller": (gain, 0.0, damping, 0.0, 0.0, servo.voltage),
    }


def explain(servo: Servo) -> str:
    """Comment in the file on a servo's actuator: its inputs, and what is not represented."""
    phrases = [f"servo: goal [rad], at most {servo.voltage:g} V"]
    if servo.d_gain > 0.0:
        part = servo.d_gain / (servo.d_gain + servo.torque_constant)
        phrases.append(f"second input: the goal's speed [rad/s] times {part:.6g}")
    omissions = [f"I gain {servo.i_gain:g} V/(rad s)"] if servo.i_gain > 0.0 else []
    omissions += [f"dead band {servo.band:g} rad"] if servo.band > 0.0 else []
    omissions += [f"counts of {servo.resolution:g} rad"] if servo.resolution > 0.0 else []
    omissions += [] if servo.effort is None else [f"limit of effort {servo.effort:g} N m"]
    omissions += [] if servo.goals is None else ["goals {:g} to {:g} rad".format(*servo.goals)]
    omissions += [] if servo.period is None else [f"sampling every {servo.period:g} s"]
    if omissions:
        phrases.append("not represented: " + ", ".join(omissions))
    return f" {'; '.join(phrases)} "


def rotor_inertia(mechanism: Mechanism, joint: str) -> float:
    """Rotor inertia on the joint's side, of its gear, or rigidly geared [kg m^2]."""
    gear = mechanism.gears.get(joint)
    return mechanism.armature.get(joint, 0.0) if gear is None else gear.rotor_inertia


def tilt_axes(axis: np.ndarray) -> dict[str, np.ndarray]:
    """Axes of a joint's hinges of tilt, unit vectors (3,) across its own, by their names' ends."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    return {"pitch": first, "roll": np.cross(axis, first)}


class Comparison(NamedTuple):
    """MuJoCo's link beside the full model's, in the same reversals."""

    time: np.ndarray
    """Times [s]."""
    angle: np.ndarray
    """Angle of MuJoCo's link [rad]."""
    error: float
    """Largest difference of the link's angle [rad]."""
    rms: float
    """RMS difference of the link's angle [rad]."""
    step_seconds: float
    """Computing time of a step [s]."""
    step: float
    """Time step [s]."""
    tilt_error: float | None = None
    """Largest difference of the axis' tilt, a vector, from `SETTLED` on [rad]; None if the file's
    joint cannot tilt."""


def follow(written: Any, reduction: Reduction, actuator: DeadBand | None = None) -> Comparison:
    """Move a motor of a compiled MJCF as in the full model's run, and compare the links.

    The other joints stand as in that run, whose history the reduction has. With an `actuator` the
    file is without play: its joint is the link, which the actuator's torque turns.
    """
    mujoco = load_mujoco()
    model = _without_contacts(written)
    data = mujoco.MjData(model)
    joint, past = reduction.joint, reduction.history
    time, step = past["time"], float(model.opt.timestep)
    grid = np.arange(time[0], time[-1], step)
    motor = np.interp(grid, time, past["motor"])
    names = [model.joint(index).name for index in range(model.njnt)]
    hinge = play_hinge(model, joint)
    # Free are the play, the tilt and, with an actuator, the link; all other joints are prescribed,
    # by a huge inertia and the force that moves it as wanted.
    free = [hinge, f"{joint}.pitch", f"{joint}.roll", *([] if actuator is None else [joint])]
    single = (mujoco.mjtJoint.mjJNT_SLIDE, mujoco.mjtJoint.mjJNT_HINGE)
    prescribed = [
        index
        for index, name in enumerate(names)
        if name not in free and mujoco.mjtJoint(model.jnt_type[index]) in single
    ]
    play = None if hinge is None else names.index(hinge)
    goals = np.tile([reduction.pose.get(names[index], 0.0) for index in prescribed], (len(grid), 1))
    if actuator is None:
        goals[:, prescribed.index(names.index(joint))] = motor
    addresses, dof = model.jnt_qposadr[prescribed], model.jnt_dofadr[prescribed]
    moving = [int(model.joint(name).dofadr[0]) for name in free if name in names]
    model.dof_armature[np.setdiff1d(np.arange(model.nv), moving)] = _PRESCRIBED
    mujoco.mj_setConst(model, data)
    # The link starts with the full model's angle and speed.
    data.qpos[addresses] = goals[0]
    data.qvel[dof] = (goals[1] - goals[0]) / step
    link, row = [int(model.joint(joint).qposadr[0])], int(model.joint(joint).dofadr[0])
    full_angle, speed = past["full"][0], (past["full"][1] - past["full"][0]) / (time[1] - time[0])
    if actuator is not None:
        data.qpos[link], data.qvel[row] = full_angle, speed
    if play is not None:
        link.append(int(model.jnt_qposadr[play]))
        data.qpos[link[1]] = full_angle - motor[0]
        data.qvel[model.jnt_dofadr[play]] = speed - (motor[1] - motor[0]) / step
    angle = np.empty(len(grid))
    angle[0] = data.qpos[link].sum()
    sites = [f"{joint}.{end}" for end in ("rim", "bore")]
    site_names = {model.site(index).name for index in range(model.nsite)}
    tilts = "tilt" in past and site_names.issuperset(sites)
    tilt = np.zeros((len(grid), 3))
    start = clock.process_time()
    for i in range(1, len(grid)):
        speed = (goals[i] - data.qpos[addresses]) / step
        data.qfrc_applied[dof] = _PRESCRIBED * (speed - data.qvel[dof]) / step
        if actuator is not None:
            lead = (motor[i] - motor[i - 1]) / step
            turning = actuator.torque(motor[i - 1], lead, data.qpos[link], data.qvel[[row]])
            data.qfrc_applied[[row]] = turning
        mujoco.mj_step(model, data)
        angle[i] = data.qpos[link].sum()
        if tilts:
            rim, bore = (data.site(name).xpos for name in sites)
            tilt[i] = (rim - bore) / reduction.half_length
    duration = clock.process_time() - start
    difference = angle - np.interp(grid, time, past["full"])
    tilt_error = None
    if tilts:  # without the beginning, in which the journal falls
        reference = np.column_stack(
            [np.interp(grid, time, component) for component in past["tilt"].T]
        )
        settled = grid >= grid[0] + SETTLED * (grid[-1] - grid[0])
        tilt_error = float(np.linalg.norm(tilt - reference, axis=1)[settled].max())
    largest, rms = float(np.abs(difference).max()), float(np.sqrt(np.mean(difference**2)))
    return Comparison(grid, angle, largest, rms, duration / max(len(grid) - 1, 1), step, tilt_error)
