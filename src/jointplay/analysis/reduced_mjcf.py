"""A reduced model of a joint's play as MJCF, and how well MuJoCo follows the full model with it.

A joint without play in its gear needs no further degree of freedom: it gets friction and damping.
Play in a gear needs the motor as a hinge of its own, loaded with its rotor's inertia: MuJoCo has no
dead band inside an actuator. Motor and link are joined by a tendon whose spring has a dead band.
"""

from __future__ import annotations

import time as clock
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.analysis.bodies import Body, across, bodies, tool_site
from jointplay.analysis.reduce import SETTLED, Reduction
from jointplay.errors import JointplayError, MissingName
from jointplay.mechanism.mechanism import Mechanism

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
    lean_rms: float | None = None
    """[rad]."""


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
    except ImportError:
        raise JointplayError("MuJoCo is not installed: pip install mujoco") from None
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
        *(_lean_difference(grid, lean, past) if leans else ()),
    )


def _sites(model: Any) -> set[str]:
    return {model.site(index).name for index in range(model.nsite)}


def _lean_difference(
    grid: np.ndarray, lean: np.ndarray, past: Mapping[str, np.ndarray]
) -> tuple[float, float]:
    """Largest and RMS difference of leans (n, 3), the beginning left aside, in which one falls."""
    wanted = np.column_stack([np.interp(grid, past["time"], one) for one in past["lean"].T])
    settled = grid >= grid[0] + SETTLED * (grid[-1] - grid[0])
    away = np.linalg.norm(lean - wanted, axis=1)[settled]
    return float(away.max()), float(np.sqrt(np.mean(away**2)))
