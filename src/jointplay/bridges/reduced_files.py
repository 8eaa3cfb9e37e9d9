"""Files with the reduced models of joints' play: SDF, URDF with YAML, JSON, Python.

MJCF and USD have modules of their own. A joint without play in its gear needs no further degree of
freedom: it gets friction and damping. Play in a gear makes the motor a body of its own, the rotor,
which the joint J moves; the hinge J_play behind it, whose limits are the dead band, moves the link.
A servo is MuJoCo's ``dcmotor`` (`reduced_mjcf`); the other formats have none.
"""

from __future__ import annotations

import inspect
import json
import math
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.accuracy.error_budget import PlayBudget, budget
from jointplay.accuracy.error_model import Contribution, Line, Tilt
from jointplay.base.errors import JointplayError, require_known, require_non_negative
from jointplay.bridges import dead_band
from jointplay.bridges.reduction import LONGEST_STEP_S, RESOLVED, Reduction
from jointplay.model.elements import Element, document, moments, put, put_inertial, written
from jointplay.model.frames import motions
from jointplay.model.gear_rules import BRACKETS
from jointplay.model.mechanism import Mechanism
from jointplay.model.urdf import BEYOND
from jointplay.physics.joints.play import Play
from jointplay.simulation.loads.drive import ENCODERS
from jointplay.simulation.motion.cartesian import joint_limits

SPREAD = 0.3
"""Relative half width of the ranges for domain randomisation of numbers that are not measured: an
assumption."""
PLUGIN = "gz_ros2_control/GazeboSimSystem"
"""Hardware plugin of ros2_control's tags, if no other is named: Gazebo's."""
LIGHTEST = pin.Inertia(1e-3, np.zeros(3), 1e-6 * np.eye(3))
"""Inertia of bodies without mass, which no simulator takes (judged: a gram, of 3 cm)."""


@dataclass(frozen=True)
class Body:
    """A body and the joint that moves it; its frame is the joint's."""

    name: str
    """Name of the joint."""
    link: str
    """Name of the body."""
    parent: Body | None
    placement: pin.SE3
    """Pose of the joint's frame in the parent's, at position zero."""
    world_placement: pin.SE3
    """Pose of the joint's frame in the world, all positions zero."""
    slides: bool
    axis: np.ndarray
    """Axis in the joint's frame, shape (3,)."""
    limits: tuple[float, float]
    """Limits of the position, infinite where there are none [rad or m]."""
    inertia: pin.Inertia
    friction: float
    """Dry friction [N m or N]."""
    damping: float
    """Viscous friction [N m s/rad or N s/m]."""
    stop: float | None = None
    """Stiffness of the limits [N m/rad], whose damping is `damping`; None if they are rigid."""


def bodies(mechanism: Mechanism, reductions: Iterable[Reduction] = ()) -> list[Body]:
    """Bodies of the ideal robot, and the rotors before play, from the base outwards.

    Raises:
        JointplayError: loops; joints with more than one coordinate (balls); the robot already has a
            `J_motor` or a `J_play`, where J is a joint with a dead band.
    """
    if mechanism.loops:
        raise JointplayError("a robot with closed loops cannot be written as a tree of bodies")
    reduced = {reduction.joint: reduction for reduction in reductions}
    refuse_taken(mechanism, reduced.values())
    ideal = mechanism.ideal()
    model, data = ideal.model, ideal.data
    pin.computeJointJacobians(model, data, np.zeros(model.nq))
    names = [str(name) for name in model.names]
    low, high = joint_limits(mechanism, [n for n in names[1:] if n in mechanism.joints])
    tree: list[Body] = []
    carriers: list[Body | None] = [None]  # by joint: the body that its children hang on
    for index in range(1, model.njoints):
        joint, name = model.joints[index], names[index]
        if joint.nv != 1:
            raise JointplayError(
                f"joint {name!r} has {joint.nv} coordinates; only joints with one can be written"
            )
        (direction,) = motions(model, data, index)
        slides = bool(np.linalg.norm(direction[3:]) < 0.5)
        # A joint that is not reduced keeps the friction of the URDF.
        entry = mechanism.description.joints[name]
        losses = Reduction(name, friction=entry.friction, viscous=entry.damping)
        reduction = reduced.get(name, losses)
        parent, placement = carriers[model.parents[index]], model.jointPlacements[index]
        inertia = model.inertias[index]
        world_placement = placement if parent is None else parent.world_placement * placement
        limits = float(low[index - 1]), float(high[index - 1])
        axis = direction[:3] if slides else direction[3:]
        inertia = inertia if inertia.mass > 0.0 else LIGHTEST
        body = Body(
            name, f"{name}_link", parent, placement, world_placement, slides, axis, limits, inertia,
            reduction.friction, reduction.viscous,
        )  # fmt: skip
        if reduction.dead_band > 0.0:  # the rotor takes the joint, the body hangs on it by the play
            half = 0.5 * reduction.dead_band
            turning = rotor(body.axis, reduction.rotor_inertia)
            motor = replace(body, link=f"{name}_motor", inertia=turning)
            tree.append(motor)
            body = replace(
                body, name=f"{name}_play", parent=motor, placement=pin.SE3.Identity(),
                limits=(-half, half), friction=0.0, damping=reduction.damping,
                stop=reduction.stiffness,
            )  # fmt: skip
        tree.append(body)
        carriers.append(body)
    return tree


def rotor(axis: np.ndarray, inertia: float) -> pin.Inertia:
    """Inertia of a rotor: hardly any mass, `inertia` about the axis, and a little more than half of
    that across, as physical inertias have.
    """
    along = np.outer(axis, axis)
    matrix = inertia * along + 0.5001 * inertia * (np.eye(3) - along)
    return pin.Inertia(1e-6, np.zeros(3), matrix)


def to_sdf(mechanism: Mechanism, *reductions: Reduction, encoder: str = "motor") -> str:
    """The robot as SDF 1.9: links and limits of the URDF, bodies without shapes.

    Links held by fixed joints are frames of the link they are fixed to, which has their mass. The
    bearing's friction acts on the motor's side of the play, as SDF has no joint parallel to
    another. Gazebo publishes what encoders read; the reading of an encoder on the link of a joint J
    with play is the sum of J and J_play.
    """
    check_encoder(encoder)
    root = Element("sdf", version="1.9")
    model = put(root, "model", name=mechanism.description.path.stem)
    described, ideal = mechanism.description, mechanism.ideal().model
    ground = described.root if described.root != "world" else "base"  # a word of SDF's own
    names = {f"{name}_link": described.joints[name].child for name in ideal.names[1:]}
    base = ideal.inertias[0]
    _put_link(model, ground, pin.SE3.Identity(), base if base.mass > 0.0 else LIGHTEST)
    _put_texts(put(model, "joint", name="base_fixed", type="fixed"), parent="world", child=ground)
    published = []
    for body in bodies(mechanism, reductions):
        link = names.get(body.link, body.link)
        _put_link(model, link, body.world_placement, body.inertia)
        joint = put(model, "joint", name=body.name, type="prismatic" if body.slides else "revolute")
        parent = ground if body.parent is None else names.get(body.parent.link, body.parent.link)
        _put_texts(joint, parent=parent, child=link)
        axis = put(joint, "axis")
        _put_texts(axis, xyz=body.axis)
        limit = put(axis, "limit")
        if np.isfinite(body.limits).all():
            _put_texts(limit, lower=body.limits[0], upper=body.limits[1])
        if body.stop is not None:
            _put_texts(limit, stiffness=body.stop, dissipation=body.damping)
        if (entry := described.joints.get(body.name)) is not None:
            rated = {"effort": entry.effort, "velocity": entry.speed}
            _put_texts(limit, **{tag: x for tag, x in rated.items() if x is not None})
        _put_texts(put(axis, "dynamics"), damping=body.damping, friction=body.friction)
        if body.stop is None or encoder == "link":
            published.append(body.name)
    # Links held by fixed joints become frames of the links that carry them.
    carriers = [ground, *(names[f"{name}_link"] for name in ideal.names[1:])]
    for frame in ideal.frames:
        carrier = carriers[frame.parentJoint]
        if frame.type == pin.FrameType.BODY and frame.name not in (*carriers, "world"):
            placement = frame.placement
            pose = [*placement.translation, *pin.rpy.matrixToRpy(placement.rotation)]
            _put_texts(put(model, "frame", name=frame.name, attached_to=carrier), pose=pose)
    plugin = put(model, "plugin", name="gz::sim::systems::JointStatePublisher")
    plugin.set("filename", "gz-sim-joint-state-publisher-system")
    for name in published:
        put(plugin, "joint_name").text = name
    return document(root)


def _put_link(model: Element, name: str, placement: pin.SE3, inertia: pin.Inertia) -> None:
    link = put(model, "link", name=name)
    _put_texts(link, pose=[*placement.translation, *pin.rpy.matrixToRpy(placement.rotation)])
    inertial = put(link, "inertial")
    _put_texts(inertial, pose=[*inertia.lever, 0.0, 0.0, 0.0], mass=inertia.mass)
    _put_texts(put(inertial, "inertia"), **moments(inertia.inertia))


def _put_texts(element: Element, /, **values: Any) -> None:
    for tag, value in values.items():
        put(element, tag).text = written(value)


def refuse_taken(mechanism: Mechanism, reductions: Iterable[Reduction]) -> None:
    """Raise a JointplayError if the robot has a `J_motor` or `J_play` for a J with a dead band."""
    described = mechanism.description
    for reduction in reductions:
        for name in (f"{reduction.joint}_motor", f"{reduction.joint}_play"):
            if reduction.dead_band > 0.0 and name in {*described.joints, *described.links}:
                raise JointplayError(f"the URDF already has a {name!r}")


def to_urdf(mechanism: Mechanism, *reductions: Reduction, plugin: str = PLUGIN) -> str:
    """The robot's own URDF with the reduced joints in it, and tags of ros2_control.

    Without play in its gear, only a joint's <dynamics> change. With play, the joint moves a link
    that is the motor's rotor, which moves the old child by `J_play`, whose limits are the dead
    band.

    Motors have the command interface ``effort`` and a transmission of 1, as all numbers are those
    of the joint's side of the gear; hinges of play have state interfaces only. If the URDF has tags
    of ros2_control of its own, only the hinges of play are added to the first of them. `plugin` is
    that of the hardware, such as ``mock_components/GenericSystem``.
    """
    refuse_taken(mechanism, reductions)
    root = mechanism.description.elements()
    for element in root.findall(BEYOND):
        root.remove(element)
    joints = {element.get("name"): element for element in root.findall("joint")}
    for reduction in reductions:
        joint = joints[reduction.joint]
        for dynamics in joint.findall("dynamics"):
            joint.remove(dynamics)
        put(joint, "dynamics", friction=reduction.friction, damping=reduction.viscous)
        if reduction.dead_band > 0.0:
            _put_play(root, joint, reduction)
    _put_control(root, mechanism, reductions, plugin)
    return document(root)


def _put_play(root: Element, joint: Element, reduction: Reduction) -> None:
    """Put rotor and play hinge between a joint and its child link."""
    motor = f"{reduction.joint}_motor"
    child, axis_element = joint.find("child"), joint.find("axis")
    assert child is not None
    axis = "1 0 0" if axis_element is None else axis_element.get("xyz", "1 0 0")
    vector = np.array([float(x) for x in axis.split()])
    turning = rotor(vector / np.linalg.norm(vector), reduction.rotor_inertia)
    put_inertial(put(root, "link", name=motor), turning)
    play = put(root, "joint", name=f"{reduction.joint}_play", type="revolute")
    put(play, "parent", link=motor)
    put(play, "child", link=child.get("link", ""))
    put(play, "axis", xyz=axis)
    half = 0.5 * reduction.dead_band
    put(play, "limit", lower=-half, upper=half, effort="1", velocity="100")
    put(play, "dynamics", damping=reduction.damping, friction="0")
    child.set("link", motor)


def _put_control(
    root: Element, mechanism: Mechanism, reductions: Sequence[Reduction], plugin: str
) -> None:
    system = root.find("ros2_control")
    if system is None:
        system = put(root, "ros2_control", name=mechanism.description.path.stem, type="system")
        _put_texts(put(system, "hardware"), plugin=plugin)
        mimics = {n: mechanism.description.joints[n].mimic for n in mechanism.joints}
        for name, mimic in mimics.items():
            _put_interfaces(system, name, () if mimic else ("effort",))
        for name, mimic in mimics.items():
            if not mimic:
                element = put(system, "transmission", name=f"{name}_transmission")
                _put_texts(element, plugin="transmission_interface/SimpleTransmission")
                put(element, "actuator", name=f"{name}_actuator", role="actuator1")
                joint = put(element, "joint", name=name, role="joint1")
                _put_texts(joint, mechanical_reduction="1.0")
    for reduction in reductions:
        if reduction.dead_band > 0.0:
            _put_interfaces(system, f"{reduction.joint}_play", ())


def _put_interfaces(system: Element, joint: str, commands: Sequence[str]) -> None:
    element = put(system, "joint", name=joint)
    for command in commands:
        put(element, "command_interface", name=command)
    for state in ("position", "velocity", "effort"):
        put(element, "state_interface", name=state)


def to_yaml(reductions: Iterable[Reduction], encoder: str = "motor") -> str:
    """Parameters that a URDF cannot hold, for a node to read: YAML by joint, SI units."""
    check_encoder(encoder)
    lines = ["# Reduced models of joints with play; SI units. See docs/simulator.md of jointplay."]
    for reduction in reductions:
        lines.append(f"{json.dumps(reduction.joint)}:")
        for key, value in (reduction.describe() | {"encoder": encoder}).items():
            # Readers of YAML 1.1 take 1e-05 for text, 1.0e-05 for a number.
            lines.append(re.sub(r"(?<![\d.])(\d+)e", r"\1.0e", f"  {key}: {json.dumps(value)}"))
    return "\n".join(lines) + "\n"


def to_json(
    reductions: Iterable[Reduction],
    encoder: str = "motor",
    spread: float = SPREAD,
    by_rule: Collection[tuple[str, str]] = (),
) -> str:
    """All parameters with ranges for domain randomisation, as JSON: a list ``joints``.

    Args:
        reductions: the reduced joints.
        encoder: place of the encoders, ``motor`` (before the play) or ``link`` (behind it).
        spread: relative half width of the ranges of numbers that are not measured, an assumption.
            The friction's range is that of the full model's run.
        by_rule: joints and numbers of their gears that a rule gave; their ranges are the rule's.

    Raises:
        MissingName: no such place for an encoder.
    """
    require_non_negative("spread", spread, "")
    check_encoder(encoder)
    joints = []
    names = ("dead_band", "stiffness", "damping", "viscous", "tilt", "lateral", "axial")
    for reduction in reductions:
        ranges: dict[str, Any] = {}
        note = "5 % to 95 % of the full model's run; "
        parts = dict.fromkeys(names, (max(1.0 - spread, 0.0), 1.0 + spread))
        for name, bracket in BRACKETS.items():
            if (reduction.joint, name) in by_rule:
                parts[name] = bracket
                wide = " to ".join(f"{part:g}" for part in bracket)
                note += f"{name}: {wide} times what a rule has, as gears differ; "
        for name, (low, high) in parts.items():
            if (value := getattr(reduction, name)) > 0.0:
                ranges[name] = [value * low, value * high]
        note += f"all others: +-{100 * spread:g} %, assumed"
        if reduction.friction > 0.0:
            low, high = reduction.friction_range
            ranges["friction"] = [min(low, reduction.friction), max(high, reduction.friction)]
        extras = {"encoder": encoder, "ranges": ranges, "ranges_note": f"friction: {note}"}
        joints.append(reduction.describe() | extras)
    return json.dumps({"joints": joints}, indent=2) + "\n"


def actuator(reductions: Iterable[Reduction]) -> tuple[tuple[str, ...], dead_band.DeadBand]:
    """Joints with a dead band, and the parameters of their actuator."""
    loose = [r for r in reductions if r.dead_band > 0.0]
    rows = [
        (0.5 * r.dead_band, r.stiffness, r.damping, r.rotor_inertia, r.friction, r.viscous)
        for r in loose
    ]
    numbers = np.array(rows).reshape(len(loose), 6).T
    return tuple(r.joint for r in loose), dead_band.DeadBand(*numbers)


def actuator_step(
    mechanism: Mechanism, reductions: Iterable[Reduction], pose: Mapping[str, float]
) -> float:
    """Time step that resolves the teeth between each motor and its link, all else held [s].

    It is at most a millisecond, and so short that the damping within a step stops no link.
    """
    ideal = mechanism.ideal()
    mass = np.diag(pin.crba(ideal.model, ideal.data, ideal.configuration(pose)))
    step = LONGEST_STEP_S
    for reduction in reductions:
        if reduction.dead_band > 0.0:
            inertia = float(mass[ideal.coordinate(reduction.joint)])
            link = max(inertia, float(LIGHTEST.inertia[2, 2]))
            swing = math.sqrt(reduction.stiffness * (1.0 / link + 1.0 / reduction.rotor_inertia))
            step = min(step, RESOLVED / swing)
            if reduction.damping > 0.0:
                step = min(step, RESOLVED * link / reduction.damping)
    return step


def to_python(
    mechanism: Mechanism, reductions: Iterable[Reduction], pose: Mapping[str, float]
) -> str:
    """The play as an actuator: the source of `dead_band` with numbers, which needs no jointplay."""
    reductions = list(reductions)
    joints, play = actuator(reductions)
    rows = "".join(
        f"    {name}=np.array({numbers.tolist()!r}),\n" for name, numbers in play._asdict().items()
    )
    assignments = {
        "JOINTS": f"JOINTS: tuple[str, ...] = {joints!r}",
        "PLAY": f"PLAY = DeadBand(\n{rows})",
        "STEP": f"STEP = {actuator_step(mechanism, reductions, pose):.4g}",
    }
    source = inspect.getsource(dead_band)
    for name, line in assignments.items():
        (original,) = re.findall(rf"^{name}\b.*=.*$", source, re.MULTILINE)
        source = source.replace(original, line)
    return source


def check_encoder(encoder: str) -> None:
    """Raise a MissingName if a place is not one of `ENCODERS`."""
    require_known("place for the encoder", encoder, ENCODERS)


def reach(
    mechanism: Mechanism,
    reductions: Iterable[Reduction],
    pose: Mapping[str, float],
    tilting: Iterable[str] = (),
) -> tuple[float, PlayBudget]:
    """Largest error of the tool by the files' play at the pose [m], and the robot's own budget.

    The files have no lateral and axial travel of journals; the axes of the joints `tilting` tilt.
    """
    play_budget = budget(mechanism, pose)
    bands = {r.joint: r.dead_band for r in reductions}
    tilts = {r.joint: r.tilt for r in reductions if r.joint in set(tilting)}

    def written_play(contribution: Contribution) -> Play:
        if contribution.gear:
            return Line((0.0,) * 5 + (0.5 * bands.get(contribution.joint, 0.0),))
        return Tilt(tilts.get(contribution.joint, 0.0))

    model = play_budget.model
    contributions = tuple(replace(c, set=written_play(c)) for c in model.contributions)
    return float(replace(model, contributions=contributions).farthest().size[0]), play_budget
