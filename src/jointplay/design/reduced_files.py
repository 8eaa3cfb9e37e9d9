"""A reduced model of a joint's play as MJCF, SDF, URDF with YAML, and JSON.

A joint without play in its gear needs no further degree of freedom: it gets friction and damping.
Play in a gear needs the motor as a hinge of its own, loaded with its rotor's inertia. In MJCF,
which has no dead band inside an actuator, motor and link are joined by a tendon whose spring has
one; in SDF and URDF by a second hinge in series whose limits are the dead band. A servo is MuJoCo's
``dcmotor``; the other formats know none.
"""

from __future__ import annotations

import json
import sys
import time as clock
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError, MissingName, require_non_negative
from jointplay.core.imports import extra
from jointplay.design.reduction import SETTLED, Reduction
from jointplay.loads.drive import Servo
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.cartesian import joint_limits

ENCODERS = ("motor", "link")
"""Where the encoder sits: before the play, or after."""
SPREAD = 0.3
"""Half width of ranges for randomisation, relative, of what is not measured: an assumption."""
_STIFF = np.array([0.99, 0.9999, 1e-6])
"""MuJoCo's impedance of the bore: as stiff as it bears."""
_HELD = 1e6
"""Inertia of what moves as prescribed, when models are compared [kg m^2]."""


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


def to_mjcf(
    mechanism: Mechanism,
    reduction: Reduction,
    *,
    encoder: str = "motor",
    tilt: bool = False,
    servos: Mapping[str, Servo] = MappingProxyType({}),
) -> str:
    """The robot as MJCF with the reduced joint in it; bodies without shapes.

    Args:
        encoder: ``motor`` (before the play) or ``link`` (after): what sensor `J.encoder` reads.
        tilt: the joint's axis can lean, too: two more hinges, held within the bore by a tendon.
        servos: by joint; each is a ``dcmotor`` (MuJoCo 4) whose inputs `dc_motor` explains. Other
            joints have a ``motor`` whose input is the torque.

    Raises:
        MissingName: no such place for an encoder, or a servo of a joint that is none.
        JointplayError: a robot that MJCF cannot hold as a tree of single joints; a servo whose
            encoder is on the link of the joint with play.
    """
    check_encoder(encoder)
    check_servos(mechanism, servos, (reduction,))
    joint, geared = reduction.joint, reduction.dead_band > 0.0
    leans = tilt and reduction.tilt > 0.0
    root = ElementTree.Element("mujoco", model=mechanism.description.path.stem)
    least = {"boundmass": 1e-9, "boundinertia": 1e-12, "balanceinertia": "true"}
    put(root, "compiler", angle="radian", **least)
    step, gravity = reduction.timestep, mechanism.gravity
    put(root, "option", timestep=step, integrator="implicitfast", gravity=gravity)
    world = put(root, "worldbody")
    places: dict[str, ElementTree.Element] = {"": world}
    for body in bodies(mechanism):
        mine = body.name == joint
        element = places[body.name] = _body(places[body.parent], body)
        friction, damping = _losses(body, reduction)
        armature = 0.0
        if not (mine and geared):
            armature = rotor_inertia(mechanism, body.name)
            own = servo_friction(servos.get(body.name))
            friction, damping = friction + own["frictionloss"], damping + own["damping"]
        _joint(element, body, friction, damping, armature)
        if mine and leans:
            _lean(places[body.parent], element, body, reduction)
    if geared:
        rotor = put(world, "body", name=f"{joint}.motor")
        inertia = reduction.rotor_inertia
        named = {"name": f"{joint}.motor", "type": "hinge", "axis": (0, 0, 1)}
        losses = {name: value for name, value in servo_friction(servos.get(joint)).items() if value}
        put(rotor, "joint", **named, armature=inertia, **losses)
        put(rotor, "inertial", pos=np.zeros(3), mass=1e-6, diaginertia=np.full(3, 1e-9))
    ideal = mechanism.ideal()
    tool = ideal.model.frames[ideal.tool_frame]
    carrier = places.get(str(ideal.model.names[tool.parentJoint]), world)
    put(carrier, "site", name=f"{mechanism.tool}.tool", pos=tool.placement.translation)
    _wiring(root, mechanism, reduction, geared, leans, encoder, servos)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def check_servos(
    mechanism: Mechanism, servos: Mapping[str, Servo], reductions: Iterable[Reduction]
) -> None:
    """Refuse servos that MuJoCo's ``dcmotor`` cannot stand for.

    Raises:
        MissingName: a servo of a joint that is none.
        JointplayError: a servo whose encoder is on the link of a joint with play.
    """
    loose = {one.joint for one in reductions if one.dead_band > 0.0}
    for name, servo in servos.items():
        if name not in mechanism.joints:
            raise MissingName("moving joint", name, mechanism.joints)
        if name in loose and servo.encoder == "link":
            raise JointplayError(
                f"the servo of {name!r} has its encoder on the link, and MuJoCo's dcmotor can only "
                'control what it turns, the motor: give its encoder as "motor", or no servo'
            )


def _wiring(
    root: ElementTree.Element,
    mechanism: Mechanism,
    reduction: Reduction,
    geared: bool,
    leans: bool,
    encoder: str,
    servos: Mapping[str, Servo],
) -> None:
    """Tendons, actuators and sensors."""
    joint = reduction.joint
    if geared or leans:
        tendon = put(root, "tendon")
    if geared:
        half = 0.5 * reduction.dead_band
        teeth = {"stiffness": reduction.stiffness, "damping": reduction.damping}
        play = put(tendon, "fixed", name=f"{joint}.play", springlength=(-half, half), **teeth)
        put(play, "joint", joint=f"{joint}.motor", coef=1.0)
        put(play, "joint", joint=joint, coef=-1.0)
    if leans:
        put_rim(tendon, reduction, reduction.timestep)
    actuator, sensor = put(root, "actuator"), put(root, "sensor")
    for name in mechanism.joints:
        driven = f"{name}.motor" if name == joint and geared else name
        if name in servos:
            actuator.append(ElementTree.Comment(explain(servos[name])))
            put(actuator, "dcmotor", name=name, joint=driven, **dc_motor(servos[name]))
        else:
            put(actuator, "motor", name=name, joint=driven)
        read = driven if encoder == "motor" else name
        put(sensor, "jointpos", name=f"{name}.encoder", joint=read)


def dc_motor(servo: Servo) -> dict[str, Any]:
    """Attributes of MuJoCo's ``dcmotor`` for a servo.

    MuJoCo's controller asks for a torque and cuts it to what the supply's voltage gives at the
    present speed; ours sets a voltage. Both are the same motor with the gains P k/R and
    D k/R + k^2/R, the back-EMF taking the latter's second part. What is lost: dead band, counts of
    the encoder, sampling.

    Its input is the goal [rad]; with a D gain a second one is the goal's speed times D / (D + k).
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
    """What a reader of the file must know of its actuator."""
    words = [f"servo: goal [rad], at most {servo.voltage:g} V"]
    if servo.d_gain > 0.0:
        part = servo.d_gain / (servo.d_gain + servo.torque_constant)
        words.append(f"second input: the goal's speed [rad/s] times {part:.6g}")
    lost = []
    if servo.band > 0.0:
        lost.append(f"dead band {servo.band:g} rad")
    if servo.resolution > 0.0:
        lost.append(f"counts of {servo.resolution:g} rad")
    if servo.period is not None:
        lost.append(f"sampling every {servo.period:g} s")
    if lost:
        words.append("not represented: " + ", ".join(lost))
    return f" {'; '.join(words)} "


def servo_friction(servo: Servo | None) -> dict[str, float]:
    """Dry and viscous friction of a servo's motor."""
    if servo is None:
        return {"frictionloss": 0.0, "damping": 0.0}
    return {"frictionloss": servo.friction, "damping": servo.viscous}


def rotor_inertia(mechanism: Mechanism, joint: str) -> float:
    """On the joint's side; zero without a gear [kg m^2]."""
    gear = mechanism.gears.get(joint)
    return 0.0 if gear is None else gear.rotor_inertia


def _body(parent: ElementTree.Element, body: Body) -> ElementTree.Element:
    quaternion = pin.Quaternion(body.placement.rotation)
    element = put(
        parent,
        "body",
        name=body.name,
        pos=body.placement.translation,
        quat=(quaternion.w, quaternion.x, quaternion.y, quaternion.z),
    )
    inertia = body.inertia.inertia
    if body.inertia.mass > 0.0:
        rows = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        put(element, "inertial", pos=body.inertia.lever, mass=body.inertia.mass, fullinertia=rows)
    else:
        put(element, "inertial", pos=np.zeros(3), mass=1e-9, diaginertia=np.full(3, 1e-12))
    return element


def _joint(
    element: ElementTree.Element,
    body: Body,
    friction: float,
    damping: float,
    armature: float,
) -> None:
    kind = "slide" if body.slides else "hinge"
    more: dict[str, Any] = {}
    if np.isfinite(body.limits).all() and body.limits[1] > body.limits[0]:
        more |= {"limited": "true", "range": body.limits}
    values = {"frictionloss": friction, "damping": damping, "armature": armature}
    more |= {name: value for name, value in values.items() if value > 0.0}
    put(element, "joint", name=body.name, type=kind, axis=body.axis, **more)


def _lean(
    parent: ElementTree.Element, element: ElementTree.Element, body: Body, reduction: Reduction
) -> None:
    """Two hinges across the axis, and the places whose distance the bore limits."""
    for part, axis in lean_axes(body.axis).items():
        put(element, "joint", name=f"{body.name}.{part}", type="hinge", axis=axis)
    end = reduction.half_length * body.axis
    put(element, "site", name=f"{body.name}.rim", pos=end)
    put(parent, "site", name=f"{body.name}.bore", pos=body.placement.act(end))


def lean_axes(axis: np.ndarray) -> dict[str, np.ndarray]:
    """Axes of the hinges across a joint's own, unit vectors (3,), by the ends of their names."""
    first = np.cross(axis, np.eye(3)[np.abs(axis).argmin()])
    first /= np.linalg.norm(first)
    return {"pitch": first, "roll": np.cross(axis, first)}


def put_rim(tendon: ElementTree.Element, reduction: Reduction, step: float) -> None:
    """Append the tendon that holds the sites `J.rim` and `J.bore` together as the bore does.

    Args:
        step: of the file [s]; the bore is as stiff as it bears.
    """
    rim = put(
        tendon,
        "spatial",
        name=f"{reduction.joint}.rim",
        limited="true",
        range=(0.0, reduction.half_length * reduction.tilt),
        solreflimit=(2.0 * step, 1.0),
        solimplimit=_STIFF,
    )
    for end in ("bore", "rim"):
        put(rim, "site", site=f"{reduction.joint}.{end}")


def put(parent: ElementTree.Element, tag: str, **values: Any) -> ElementTree.Element:
    """Append an element with attributes; numbers, and lists of them, are written in full."""
    texts = {name: _text(value) for name, value in values.items()}
    return ElementTree.SubElement(parent, tag, texts)


def _text(value: Any) -> str:
    """Numbers are written so that they read back the same."""
    if isinstance(value, str):
        return value
    return " ".join(f"{x + 0.0:.17g}" for x in np.ravel(value))


@dataclass(frozen=True)
class Followed:
    """How MuJoCo's link followed the full model's."""

    time: np.ndarray
    """[s]."""
    angle: np.ndarray
    """Of MuJoCo's link [rad]."""
    error: float
    """Largest difference of the link's angle [rad]."""
    rms: float
    """[rad]."""
    step_seconds: float
    """Computing time of a step [s]."""
    step: float
    """Time step [s]."""
    lean_error: float | None = None
    """Largest difference of the axis' lean, a vector, after a tenth of the time [rad]; None if the
    file's joint cannot lean."""


def load_mujoco() -> Any:
    """The package mujoco; what it warns of is written to stderr.

    By itself it writes that to a file in the folder that one happens to be in.

    Raises:
        JointplayError: it cannot be imported.
    """
    with extra("simulators", "mujoco"):
        import mujoco
    if mujoco.get_mju_user_warning() is None:
        mujoco.set_mju_user_warning(_warn)
    return mujoco


def _warn(text: str) -> None:
    print(f"MuJoCo: {text}", file=sys.stderr)


def follow(text: str, reduction: Reduction) -> Followed:
    """Load the MJCF in MuJoCo, move its motor as the full model's, and compare the links.

    The other joints stand as in the full model's run.

    Args:
        text: what `to_mjcf` wrote.
        reduction: with the history to compare with, such as another run's.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot load the file.
    """
    mujoco = load_mujoco()
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise JointplayError(f"MuJoCo cannot load the MJCF: {error}") from None
    data = mujoco.MjData(model)
    joint, past = reduction.joint, reduction.history
    link = model.joint(joint)
    motor = f"{joint}.motor"
    held = {}
    for index in range(model.njnt):
        name = model.joint(index).name
        if name == motor or (name == joint and not reduction.dead_band > 0.0):
            held[index] = past["motor"]
        elif name != joint and "." not in name:
            held[index] = np.full(len(past["time"]), reduction.pose.get(name, 0.0))
    at = [int(model.jnt_qposadr[i]) for i in held]
    dof = [int(model.jnt_dofadr[i]) for i in held]
    model.dof_armature[dof] = _HELD
    mujoco.mj_setConst(model, data)
    time, step = past["time"], float(model.opt.timestep)
    grid = np.arange(time[0], time[-1], step)
    goals = np.array([np.interp(grid, time, values) for values in held.values()]).T
    data.qpos[at] = goals[0]
    data.qpos[link.qposadr] = past["full"][0]
    data.qvel[link.dofadr] = (past["full"][1] - past["full"][0]) / (time[1] - time[0])
    angle = np.empty(len(grid))
    angle[0] = past["full"][0]
    sites = [f"{joint}.{end}" for end in ("rim", "bore")]
    named = {model.site(index).name for index in range(model.nsite)}
    leans = "lean" in past and named.issuperset(sites)
    lean = np.zeros((len(grid), 3))
    begun = clock.process_time()
    for i in range(1, len(grid)):
        data.qvel[dof] = (goals[i] - data.qpos[at]) / step
        mujoco.mj_step(model, data)
        angle[i] = data.qpos[link.qposadr[0]]
        if leans:
            rim, bore = (data.site(name).xpos for name in sites)
            lean[i] = (rim - bore) / reduction.half_length
    spent = clock.process_time() - begun
    difference = angle - np.interp(grid, time, past["full"])
    return Followed(
        grid,
        angle,
        float(np.abs(difference).max()),
        float(np.sqrt(np.mean(difference**2))),
        spent / max(len(grid) - 1, 1),
        step,
        _lean_difference(grid, lean, past) if leans else None,
    )


def _lean_difference(grid: np.ndarray, lean: np.ndarray, past: Mapping[str, np.ndarray]) -> float:
    """Largest difference of leans (n, 3), the beginning left aside, in which one falls."""
    wanted = np.column_stack([np.interp(grid, past["time"], one) for one in past["lean"].T])
    settled = grid >= grid[0] + SETTLED * (grid[-1] - grid[0])
    away = np.linalg.norm(lean - wanted, axis=1)[settled]
    return float(away.max())


def to_sdf(mechanism: Mechanism, *reductions: Reduction) -> str:
    """The robot as SDF 1.9; play is a hinge in series, `J_play`, behind the motor's link.

    The bearing's friction acts on the motor's side of the play, for SDF has no joint beside
    another.

    Raises:
        JointplayError: a robot that cannot be held as a tree of single joints; see `refuse_taken`.
    """
    refuse_taken(mechanism, reductions)
    reduced = {one.joint: one for one in reductions}
    root = ElementTree.Element("sdf", version="1.9")
    model = put(root, "model", name=mechanism.description.path.stem)
    _link(model, "base", pin.SE3.Identity(), None)
    _texts(put(model, "joint", name="base_fixed", type="fixed"), parent="world", child="base")
    places: dict[str, pin.SE3] = {"": pin.SE3.Identity()}
    for body in bodies(mechanism):
        name = body.name
        place = places[name] = places[body.parent] * body.placement
        parent, child = f"{body.parent}_link" if body.parent else "base", f"{name}_link"
        reduction = reduced.get(name, Reduction(name, friction=body.friction, viscous=body.damping))
        losses = reduction.friction, reduction.viscous
        if reduction.dead_band > 0.0:
            motor, half = f"{name}_motor", 0.5 * reduction.dead_band
            inertia = pin.Inertia(1e-6, np.zeros(3), rotor(body.axis, reduction.rotor_inertia))
            _link(model, motor, place, inertia)
            _sdf_joint(model, body, name, parent, motor, losses, body.limits)
            play = _sdf_joint(
                model, body, f"{name}_play", motor, child, (0.0, reduction.damping), (-half, half)
            )
            _texts(play, stiffness=reduction.stiffness, dissipation=reduction.damping)
        else:
            _sdf_joint(model, body, name, parent, child, losses, body.limits)
        _link(model, child, place, body.inertia)
    return document(root)


def _losses(body: Body, reduction: Reduction) -> tuple[float, float]:
    """Dry and viscous friction of a joint."""
    if body.name == reduction.joint:
        return reduction.friction, reduction.viscous
    return body.friction, body.damping


def _sdf_joint(
    model: ElementTree.Element,
    body: Body,
    name: str,
    parent: str,
    child: str,
    losses: tuple[float, float],
    limits: tuple[float, float],
) -> ElementTree.Element:
    """Append a joint; its <limit>."""
    joint = put(model, "joint", name=name, type="prismatic" if body.slides else "revolute")
    _texts(joint, parent=parent, child=child)
    axis = ElementTree.SubElement(joint, "axis")
    _texts(axis, xyz=body.axis)
    limit = ElementTree.SubElement(axis, "limit")
    if np.isfinite(limits).all():
        _texts(limit, lower=limits[0], upper=limits[1])
    friction, damping = losses
    _texts(ElementTree.SubElement(axis, "dynamics"), damping=damping, friction=friction)
    return limit


def _link(
    model: ElementTree.Element, name: str, place: pin.SE3, inertia: pin.Inertia | None
) -> None:
    link = put(model, "link", name=name)
    _texts(link, pose=[*place.translation, *pin.rpy.matrixToRpy(place.rotation)])
    inertial = ElementTree.SubElement(link, "inertial")
    mass, lever, matrix = 1e-3, np.zeros(3), 1e-6 * np.eye(3)
    if inertia is not None and inertia.mass > 0.0:
        mass, lever, matrix = inertia.mass, inertia.lever, inertia.inertia
    _texts(inertial, pose=[*lever, 0.0, 0.0, 0.0], mass=mass)
    _texts(ElementTree.SubElement(inertial, "inertia"), **_moments(matrix))


def refuse_taken(mechanism: Mechanism, reductions: Iterable[Reduction]) -> None:
    """Refuse robots that already have a link or joint called as play needs it.

    Raises:
        JointplayError: the robot has a `J_motor` or a `J_play` of a joint J with a dead band.
    """
    described = mechanism.description
    for one in reductions:
        for name in (f"{one.joint}_motor", f"{one.joint}_play"):
            if one.dead_band > 0.0 and name in {*described.joints, *described.links}:
                raise JointplayError(f"the URDF already has a {name!r}")


def with_play(mechanism: Mechanism, reductions: Iterable[Reduction]) -> ElementTree.Element:
    """The robot's own URDF with the reduced joints in it, to be edited further; see `to_urdf`."""
    reductions = list(reductions)
    refuse_taken(mechanism, reductions)
    root = mechanism.description.elements()
    joints = {one.get("name"): one for one in root.findall("joint")}
    for reduction in reductions:
        joint = joints[reduction.joint]
        for old in joint.findall("dynamics"):
            joint.remove(old)
        put(joint, "dynamics", friction=reduction.friction, damping=reduction.viscous)
        if not reduction.dead_band > 0.0:
            continue
        motor, between = f"{reduction.joint}_motor", f"{reduction.joint}_play"
        child, written = joint.find("child"), joint.find("axis")
        assert child is not None
        axis = "1 0 0" if written is None else written.get("xyz", "1 0 0")
        inertial = put(put(root, "link", name=motor), "inertial")
        put(inertial, "mass", value="1e-06")
        vector = np.array([float(x) for x in axis.split()])
        matrix = rotor(vector / np.linalg.norm(vector), reduction.rotor_inertia)
        put(inertial, "inertia", **_moments(matrix))
        play = put(root, "joint", name=between, type="revolute")
        put(play, "parent", link=motor)
        put(play, "child", link=child.get("link", ""))
        put(play, "axis", xyz=axis)
        half = 0.5 * reduction.dead_band
        put(play, "limit", lower=-half, upper=half, effort="0", velocity="100")
        put(play, "dynamics", damping=reduction.damping, friction="0")
        child.set("link", motor)
    return root


def to_urdf(mechanism: Mechanism, *reductions: Reduction) -> str:
    """The robot's own URDF with the reduced joints in it.

    Without play in a gear only the joint's <dynamics> change. With it, the joint moves a link that
    is the motor's rotor, which moves the old child by `J_play`, whose limits are the dead band.

    Raises:
        JointplayError: see `refuse_taken`.
    """
    return document(with_play(mechanism, reductions))


def document(root: ElementTree.Element) -> str:
    """The text of an XML file, indented."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def to_yaml(reduction: Reduction, encoder: str = "motor") -> str:
    """What a URDF cannot say, for a node to read: flat YAML, SI units."""
    data = parameters(reduction, encoder)
    lines = ["# Reduced model of a joint with play; SI units. See docs/decisions.md of jointplay."]
    for key, value in data.items():
        if isinstance(value, dict):
            lines.append(f"{key}:")
            lines += [f"  {name}: {json.dumps(one)}" for name, one in value.items()]
        else:
            lines.append(f"{key}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def to_json(reduction: Reduction, encoder: str = "motor", spread: float = SPREAD) -> str:
    """All parameters with ranges for domain randomisation, as JSON.

    Args:
        encoder: ``motor`` (before the play) or ``link`` (after).
        spread: half width of the ranges of what is not measured, relative; an assumption. The
            friction's range is that of the full model's run.
    """
    require_non_negative("spread", spread, "")
    data = parameters(reduction, encoder)
    data |= _ranges(reduction, spread)
    return json.dumps(data, indent=2) + "\n"


def _ranges(reduction: Reduction, spread: float) -> dict[str, Any]:
    """Ranges for domain randomisation, and where they come from."""
    ranges: dict[str, Any] = {}
    for name in ("dead_band", "stiffness", "damping", "viscous", "tilt", "lateral", "axial"):
        value = getattr(reduction, name)
        if value > 0.0:
            ranges[name] = [value * max(1.0 - spread, 0.0), value * (1.0 + spread)]
    if reduction.friction > 0.0:
        low, high = reduction.friction_range
        ranges["friction"] = [min(low, reduction.friction), max(high, reduction.friction)]
    note = (
        f"friction: 5 % to 95 % of the full model's run; all others: +-{100 * spread:g} %, assumed"
    )
    return {"ranges": ranges, "ranges_note": note}


def parameters(reduction: Reduction, encoder: str) -> dict[str, Any]:
    """The reduction and where the encoder sits, as plain data.

    Raises:
        MissingName: no such place for an encoder.
    """
    check_encoder(encoder)
    return {**reduction.describe(), "encoder": encoder}


def check_encoder(encoder: str) -> None:
    """Refuse what is no place for an encoder.

    Raises:
        MissingName: it is not of `ENCODERS`.
    """
    if encoder not in ENCODERS:
        raise MissingName("place for the encoder", encoder, ENCODERS)


def rotor(axis: np.ndarray, inertia: float) -> np.ndarray:
    """Inertia of a rotor about its axis, and a little more than half of it across, (3, 3)."""
    along = np.outer(axis, axis)
    return np.asarray(inertia * along + 0.5001 * inertia * (np.eye(3) - along))


def _moments(matrix: np.ndarray) -> dict[str, float]:
    """The entries of an inertia by their names, ixx to izz."""
    pairs = [("xyz"[i], "xyz"[k], matrix[i, k]) for i in range(3) for k in range(i, 3)]
    return {f"i{a}{b}": float(value) for a, b, value in pairs}


def _texts(element: ElementTree.Element, /, **values: Any) -> None:
    """Append an element with a text for each value."""
    for tag, value in values.items():
        ElementTree.SubElement(element, tag).text = _text(value)
