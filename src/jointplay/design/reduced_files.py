"""A reduced model of a joint's play as MJCF, SDF, URDF with YAML, and JSON."""

from __future__ import annotations

import json
import time as clock
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError, MissingName, require_non_negative
from jointplay.design.reduction import SETTLED, Reduction
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.cartesian import joint_limits

# A robot as a list of bodies and the joints that carry them, as other simulators want it.


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


# A reduced model of a joint's play as MJCF, and how well MuJoCo follows the full model with it.
#
# A joint without play in its gear needs no further degree of freedom: it gets friction and
# damping. Play in a gear needs the motor as a hinge of its own, loaded with its rotor's inertia:
# MuJoCo has no dead band inside an actuator. Motor and link are joined by a tendon whose spring
# has a dead band.


ENCODERS = ("motor", "link")
"""Where the encoder sits: before the play, or after."""
_STIFF = np.array([0.99, 0.9999, 1e-6])
"""MuJoCo's impedance of the bore: as stiff as it bears."""
_HELD = 1e6
"""Inertia of what moves as prescribed, when models are compared [kg m^2]."""


def to_mjcf(
    mechanism: Mechanism, reduction: Reduction, *, encoder: str = "motor", tilt: bool = False
) -> str:
    """The robot as MJCF with the reduced joint in it; bodies without shapes.

    Args:
        mechanism: the robot.
        reduction: of one of its joints.
        encoder: ``motor`` (before the play) or ``link`` (after): what sensor `J.encoder` reads.
        tilt: the joint's axis can lean, too: two more hinges, held within the bore by a tendon.

    Raises:
        MissingName: no such place for an encoder.
        JointplayError: a robot that MJCF cannot hold as a tree of single joints.
    """
    if encoder not in ENCODERS:
        raise MissingName("place for the encoder", encoder, ENCODERS)
    joint, geared = reduction.joint, reduction.dead_band > 0.0
    leans = tilt and reduction.tilt > 0.0
    root = ElementTree.Element("mujoco", model=mechanism.description.path.stem)
    _put(
        root, "compiler", angle="radian", boundmass=1e-9, boundinertia=1e-12, balanceinertia="true"
    )
    _put(
        root,
        "option",
        timestep=timestep(reduction),
        integrator="implicitfast",
        gravity=np.array(mechanism.gravity),
    )
    world = _put(root, "worldbody")
    places: dict[str, ElementTree.Element] = {"": world}
    for body in bodies(mechanism):
        mine = body.name == joint
        element = places[body.name] = _body(places[body.parent], body)
        friction = reduction.friction if mine else body.friction
        damping = reduction.viscous if mine else body.damping
        _joint(element, body, friction, damping)
        if mine and leans:
            _lean(places[body.parent], element, body, reduction)
    if geared:
        rotor = _put(world, "body", name=f"{joint}.motor")
        _put(
            rotor,
            "joint",
            name=f"{joint}.motor",
            type="hinge",
            axis=np.array([0.0, 0.0, 1.0]),
            armature=reduction.rotor_inertia,
        )
        _put(rotor, "inertial", pos=np.zeros(3), mass=1e-6, diaginertia=np.full(3, 1e-9))
    carrier, place = tool_site(mechanism)
    _put(places.get(carrier, world), "site", name=f"{mechanism.tool}.tool", pos=place)
    _wiring(root, mechanism, reduction, geared, leans, encoder)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def timestep(reduction: Reduction) -> float:
    """A step that resolves the teeth's stiffness, at most a millisecond [s]."""
    if reduction.stiffness <= 0.0:
        return 1e-3
    return float(min(1e-3, 0.2 * np.sqrt(reduction.rotor_inertia / reduction.stiffness)))


def _wiring(
    root: ElementTree.Element,
    mechanism: Mechanism,
    reduction: Reduction,
    geared: bool,
    leans: bool,
    encoder: str,
) -> None:
    """Tendons, actuators and sensors."""
    joint = reduction.joint
    if geared or leans:
        tendon = _put(root, "tendon")
    if geared:
        half = 0.5 * reduction.dead_band
        play = _put(
            tendon,
            "fixed",
            name=f"{joint}.play",
            springlength=np.array([-half, half]),
            stiffness=reduction.stiffness,
            damping=reduction.damping,
        )
        _put(play, "joint", joint=f"{joint}.motor", coef=1.0)
        _put(play, "joint", joint=joint, coef=-1.0)
    if leans:
        rim = _put(
            tendon,
            "spatial",
            name=f"{joint}.rim",
            limited="true",
            range=np.array([0.0, reduction.half_length * reduction.tilt]),
            solreflimit=np.array([2.0 * timestep(reduction), 1.0]),
            solimplimit=_STIFF,
        )
        for end in ("bore", "rim"):
            _put(rim, "site", site=f"{joint}.{end}")
    actuator, sensor = _put(root, "actuator"), _put(root, "sensor")
    for name in mechanism.joints:
        driven = f"{name}.motor" if name == joint and geared else name
        _put(actuator, "motor", name=name, joint=driven)
        read = driven if encoder == "motor" else name
        _put(sensor, "jointpos", name=f"{name}.encoder", joint=read)


def _body(parent: ElementTree.Element, body: Body) -> ElementTree.Element:
    quaternion = pin.Quaternion(body.placement.rotation)
    element = _put(
        parent,
        "body",
        name=body.name,
        pos=body.placement.translation,
        quat=np.array([quaternion.w, quaternion.x, quaternion.y, quaternion.z]),
    )
    inertia = body.inertia.inertia
    if body.inertia.mass > 0.0:
        rows = inertia[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
        _put(element, "inertial", pos=body.inertia.lever, mass=body.inertia.mass, fullinertia=rows)
    else:
        _put(element, "inertial", pos=np.zeros(3), mass=1e-9, diaginertia=np.full(3, 1e-12))
    return element


def _joint(element: ElementTree.Element, body: Body, friction: float, damping: float) -> None:
    values: dict[str, Any] = {
        "name": body.name,
        "type": "slide" if body.slides else "hinge",
        "axis": body.axis,
    }
    if np.isfinite(body.limits).all() and body.limits[1] > body.limits[0]:
        values |= {"limited": "true", "range": np.array(body.limits)}
    if friction > 0.0:
        values["frictionloss"] = friction
    if damping > 0.0:
        values["damping"] = damping
    _put(element, "joint", **values)


def _lean(
    parent: ElementTree.Element, element: ElementTree.Element, body: Body, reduction: Reduction
) -> None:
    """Two hinges across the axis, and the places whose distance the bore limits."""
    for part, axis in zip(("pitch", "roll"), across(body.axis), strict=True):
        _put(element, "joint", name=f"{body.name}.{part}", type="hinge", axis=axis)
    end = reduction.half_length * body.axis
    _put(element, "site", name=f"{body.name}.rim", pos=end)
    _put(parent, "site", name=f"{body.name}.bore", pos=body.placement.act(end))


def _put(parent: ElementTree.Element, tag: str, **values: Any) -> ElementTree.Element:
    """Append an element; numbers are written so that they read back the same."""
    text = {
        key: value
        if isinstance(value, str)
        else " ".join(f"{x + 0.0:.17g}" for x in np.ravel(value))
        for key, value in values.items()
    }
    return ElementTree.SubElement(parent, tag, text)


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


def follow(text: str, reduction: Reduction) -> Followed:
    """Load the MJCF in MuJoCo, move its motor as the full model's, and compare the links.

    The other joints stand as in the full model's run.

    Args:
        text: what `to_mjcf` wrote.
        reduction: with the history to compare with, such as another run's.

    Raises:
        JointplayError: MuJoCo is not installed, or cannot load the file.
    """
    try:
        import mujoco
    except ImportError as error:
        text = f"MuJoCo cannot be imported ({error}): pip install mujoco"
        raise JointplayError(text) from None
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
    leans = "lean" in past and all(name in _sites(model) for name in sites)
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


def _sites(model: Any) -> set[str]:
    return {model.site(index).name for index in range(model.nsite)}


def _lean_difference(grid: np.ndarray, lean: np.ndarray, past: Mapping[str, np.ndarray]) -> float:
    """Largest difference of leans (n, 3), the beginning left aside, in which one falls."""
    wanted = np.column_stack([np.interp(grid, past["time"], one) for one in past["lean"].T])
    settled = grid >= grid[0] + SETTLED * (grid[-1] - grid[0])
    away = np.linalg.norm(lean - wanted, axis=1)[settled]
    return float(away.max())


# A reduced model of a joint's play as SDF, as URDF with YAML, and as JSON.


SPREAD = 0.3
"""Half width of ranges for randomisation, relative, of what is not measured: an assumption."""


def to_sdf(mechanism: Mechanism, reduction: Reduction) -> str:
    """The robot as SDF 1.9; play is a hinge in series, `J_play`, behind the motor's link.

    The bearing's friction acts on the motor's side of the play, for SDF has no joint beside
    another.
    """
    root = ElementTree.Element("sdf", version="1.9")
    model = ElementTree.SubElement(root, "model", name=mechanism.description.path.stem)
    base = _link(model, "base", pin.SE3.Identity(), None)
    fixed = ElementTree.SubElement(model, "joint", name="base_fixed", type="fixed")
    _texts(fixed, parent="world", child="base")
    assert base is not None
    places: dict[str, pin.SE3] = {"": pin.SE3.Identity()}
    for body in bodies(mechanism):
        place = places[body.name] = places[body.parent] * body.placement
        parent = f"{body.parent}_link" if body.parent else "base"
        mine = body.name == reduction.joint
        friction = reduction.friction if mine else body.friction
        damping = reduction.viscous if mine else body.damping
        if mine and reduction.dead_band > 0.0:
            rotor = pin.Inertia(1e-6, np.zeros(3), _rotor(body.axis, reduction.rotor_inertia))
            _link(model, f"{body.name}_motor", place, rotor)
            _sdf_joint(model, body, body.name, parent, f"{body.name}_motor", friction, damping)
            half = 0.5 * reduction.dead_band
            stop = reduction.stiffness, reduction.damping
            _sdf_joint(
                model,
                body,
                f"{body.name}_play",
                f"{body.name}_motor",
                f"{body.name}_link",
                0.0,
                reduction.damping,
                (-half, half),
                stop,
            )
        else:
            _sdf_joint(model, body, body.name, parent, f"{body.name}_link", friction, damping)
        _link(model, f"{body.name}_link", place, body.inertia)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _sdf_joint(
    model: ElementTree.Element,
    body: Body,
    name: str,
    parent: str,
    child: str,
    friction: float,
    damping: float,
    limits: tuple[float, float] | None = None,
    stop: tuple[float, float] | None = None,
) -> None:
    kind = "prismatic" if body.slides else "revolute"
    joint = ElementTree.SubElement(model, "joint", name=name, type=kind)
    _texts(joint, parent=parent, child=child)
    axis = ElementTree.SubElement(joint, "axis")
    _texts(axis, xyz=_numbers(body.axis))
    low, high = limits or body.limits
    limit = ElementTree.SubElement(axis, "limit")
    if np.isfinite([low, high]).all():
        _texts(limit, lower=f"{low:.17g}", upper=f"{high:.17g}")
    if stop is not None:
        _texts(limit, stiffness=f"{stop[0]:.17g}", dissipation=f"{stop[1]:.17g}")
    dynamics = ElementTree.SubElement(axis, "dynamics")
    _texts(dynamics, damping=f"{damping:.17g}", friction=f"{friction:.17g}")


def _link(
    model: ElementTree.Element, name: str, place: pin.SE3, inertia: pin.Inertia | None
) -> ElementTree.Element:
    link = ElementTree.SubElement(model, "link", name=name)
    angles = pin.rpy.matrixToRpy(place.rotation)
    _texts(link, pose=_numbers([*place.translation, *angles]))
    inertial = ElementTree.SubElement(link, "inertial")
    mass, lever, matrix = 1e-3, np.zeros(3), 1e-6 * np.eye(3)
    if inertia is not None and inertia.mass > 0.0:
        mass, lever, matrix = inertia.mass, inertia.lever, inertia.inertia
    _texts(inertial, pose=_numbers([*lever, 0.0, 0.0, 0.0]), mass=f"{mass:.17g}")
    tensor = ElementTree.SubElement(inertial, "inertia")
    _texts(
        tensor,
        **{
            f"i{a}{b}": f"{matrix['xyz'.index(a), 'xyz'.index(b)]:.17g}"
            for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
        },
    )
    return link


def to_urdf(mechanism: Mechanism, reduction: Reduction) -> str:
    """The robot's own URDF with the reduced joint in it.

    Without play in a gear only the joint's <dynamics> change. With it, the joint moves a link that
    is the motor's rotor, which moves the old child by `J_play`, whose limits are the dead band.
    """
    root = mechanism.description.elements()
    joint = next(j for j in root.findall("joint") if j.get("name") == reduction.joint)
    for old in joint.findall("dynamics"):
        joint.remove(old)
    ElementTree.SubElement(
        joint,
        "dynamics",
        friction=f"{reduction.friction:.17g}",
        damping=f"{reduction.viscous:.17g}",
    )
    if reduction.dead_band > 0.0:
        names = {one.get("name") for one in (*root.findall("joint"), *root.findall("link"))}
        motor, between = f"{reduction.joint}_motor", f"{reduction.joint}_play"
        for name in (motor, between):
            if name in names:
                raise JointplayError(f"the URDF already has a {name!r}")
        child = joint.find("child")
        written = joint.find("axis")
        assert child is not None
        axis = "1 0 0" if written is None else written.get("xyz", "1 0 0")
        link = ElementTree.SubElement(root, "link", name=motor)
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "mass", value="1e-06")
        vector = np.array([float(x) for x in axis.split()])
        matrix = _rotor(vector / np.linalg.norm(vector), reduction.rotor_inertia)
        ElementTree.SubElement(
            inertial,
            "inertia",
            {
                f"i{a}{b}": f"{matrix['xyz'.index(a), 'xyz'.index(b)]:.17g}"
                for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
            },
        )
        play = ElementTree.SubElement(root, "joint", name=between, type="revolute")
        ElementTree.SubElement(play, "parent", link=motor)
        ElementTree.SubElement(play, "child", link=child.get("link", ""))
        ElementTree.SubElement(play, "axis", xyz=axis)
        half = f"{0.5 * reduction.dead_band:.17g}"
        ElementTree.SubElement(
            play, "limit", lower=f"-{half}", upper=half, effort="0", velocity="100"
        )
        ElementTree.SubElement(play, "dynamics", damping=f"{reduction.damping:.17g}", friction="0")
        child.set("link", motor)
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
        reduction: the joint.
        encoder: ``motor`` (before the play) or ``link`` (after).
        spread: half width of the ranges of what is not measured, relative; an assumption. The
            friction's range is that of the full model's run.
    """
    require_non_negative("spread", spread, "")
    data = parameters(reduction, encoder)
    ranges: dict[str, Any] = {}
    for name in ("dead_band", "stiffness", "damping", "viscous", "tilt", "lateral", "axial"):
        value = getattr(reduction, name)
        if value > 0.0:
            ranges[name] = [value * max(1.0 - spread, 0.0), value * (1.0 + spread)]
    if reduction.friction > 0.0:
        low, high = reduction.friction_range
        ranges["friction"] = [min(low, reduction.friction), max(high, reduction.friction)]
    data["ranges"] = ranges
    data["ranges_note"] = (
        f"friction: 5 % to 95 % of the full model's run; all others: +-{100 * spread:g} %, assumed"
    )
    return json.dumps(data, indent=2) + "\n"


def parameters(reduction: Reduction, encoder: str) -> dict[str, Any]:
    """The reduction and where the encoder sits, as plain data.

    Raises:
        MissingName: no such place for an encoder.
    """
    if encoder not in ENCODERS:
        raise MissingName("place for the encoder", encoder, ENCODERS)
    return {**reduction.describe(), "encoder": encoder}


def _rotor(axis: np.ndarray, inertia: float) -> np.ndarray:
    """Inertia of a rotor about its axis, and a little more than half of it across, (3, 3)."""
    along = np.outer(axis, axis)
    return np.asarray(inertia * along + 0.5001 * inertia * (np.eye(3) - along))


def _texts(element: ElementTree.Element, /, **values: str) -> None:
    for tag, text in values.items():
        ElementTree.SubElement(element, tag).text = text


def _numbers(values: Any) -> str:
    return " ".join(f"{x + 0.0:.17g}" for x in np.ravel(values))
