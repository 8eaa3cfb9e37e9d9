"""From a checked scenario to the simulation that it describes: motion, drives, loads, payloads.

`build` makes the mechanism first (`mechanism_of`), since its joints decide the units of the rest;
then the motion, completed for joints that it does not name; loads, drives, friction, payloads; and
notes on input that may be unintended.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import fields, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.accuracy.poses import along_motion
from jointplay.accuracy.robot_errors import RobotErrors, refuse_misfit
from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_known,
    require_positive,
    within,
)
from jointplay.base.schema import Draft, fields_of, unknown_key
from jointplay.base.tables import few
from jointplay.base.units import Measured, ask_unit, expected, named, readable, toml_text
from jointplay.model.beams import FlexibleLink
from jointplay.model.fixing import with_fixed, without_floating_base
from jointplay.model.flexible import end_of_tool
from jointplay.model.formats import read
from jointplay.model.linkage import Linkage
from jointplay.model.linkage_tree import tree_of
from jointplay.model.loop import Loop, refuse_name
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.model.robots import resolve
from jointplay.model.tool import choose_tool
from jointplay.model.urdf import Description, JointEntry
from jointplay.physics.joints import Clearance, Coordinate
from jointplay.physics.joints.base import RoundClearance
from jointplay.scenario.declarations import ANGLE, ANGULAR_SPEED, MOTION_SOURCES, PATHS, Model
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import (
    ComputedTorque,
    Drive,
    JointFriction,
    Prescribed,
    Torque,
    urdf_friction,
)
from jointplay.simulation.loads.gear_pair import led_by_teeth
from jointplay.simulation.motion.cartesian import cartesian_path
from jointplay.simulation.motion.completion import complete_motion
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.settings import Integration, LimitSettings, RecordSettings
from jointplay.simulation.simulation import Simulation

# Errors at keys of the scenario, and numbers in the unit of their joint.


@contextmanager
def _relocated(keys: Mapping[str, tuple[str, ...]]) -> Iterator[None]:
    """Move errors at an argument, in the block, to the key of the scenario that gives it."""
    try:
        yield
    except JointplayError as error:
        if error.where and error.where[0] in keys:
            error.where = (*keys[str(error.where[0])], *error.where[1:])
        raise


def drafts(table: Any) -> dict[str, Draft]:
    """Objects that a table describes, checked but not yet made, by name."""
    drafts: dict[str, Draft] = dict(table)
    return drafts


def fit(
    mechanism: Mechanism,
    joint: str,
    value: float,
    units: tuple[str, ...],
    path: tuple[str | int, ...],
) -> float:
    """A value in the unit of its joint, or of the coordinate `joint` in [start] and [start_speed].

    Args:
        value: the value, with the unit in which it was given, if any.
        units: unit of a revolute, and of a prismatic joint.
        path: key of the value.

    Raises:
        JointplayError: no such joint, or a unit of the other kind of joint.
    """
    if joint in mechanism.joints:
        return fit_entry(mechanism.description.joints[joint], value, units, path)
    if path[0] in ("start", "start_speed") and joint in mechanism.coordinates:
        length = mechanism.coordinates[mechanism.coordinates.index(joint)].length
        return _in_unit(value, units[length], f"{joint!r} is a {path[0]} of a journal", path)
    raise MissingName("moving joint", joint, mechanism.joints, where=path)


def fit_entry(
    entry: JointEntry, value: float, units: tuple[str, ...], path: tuple[str | int, ...]
) -> float:
    """`fit` for a joint of a robot's file."""
    return _in_unit(value, units[entry.slides], f"{entry.name!r} is {entry.kind}", path)


def _in_unit(value: float, unit: str, whose: str, path: tuple[str | int, ...]) -> float:
    """The value as float, if it was given in a unit like `unit`."""
    if isinstance(value, Measured) and value.unit not in ("", unit):
        raise JointplayError(
            f"{toml_text(value.text)} is not {named(unit)}, but joint {whose}; "
            f"expected {expected(unit)}",
            where=path,
        )
    if not (isinstance(value, Measured) and value.unit):
        try:
            ask_unit(value, unit)
        except ValueError as error:
            raise JointplayError(str(error), path) from None
    return float(value)


def of_joint(draft: Draft, path: tuple[str, ...], fitted: Callable[..., float]) -> Draft:
    """A draft with its numbers in the unit of its joint, in fields with a unit for each kind.

    `fitted` is `fit` or `fit_entry` for the joint.

    Raises:
        JointplayError: no such joint, or a unit of another kind; `where` has the key.
    """
    values = dict(draft.fields)
    for key, value in draft.fields.items():
        units = fields_of(draft.kind)[key].units
        if len(units) == 2 and value is not None:
            each = value if isinstance(value, tuple) else (value,)
            numbers = tuple(fitted(number, units, (*path, key)) for number in each)
            values[key] = numbers if isinstance(value, tuple) else numbers[0]
    return replace(draft, fields=values)


def made_by_joint(table: Any, mechanism: Mechanism, *place: str) -> dict[str, Any]:
    """Make the objects of a table by moving joint; `place` is the table's key, for errors."""
    objects = {}
    for name, draft in drafts(table).items():
        path = (*place, name)
        require_known("moving joint", name, mechanism.joints, where=path)
        fitted = of_joint(draft, path, partial(fit, mechanism, name))
        with within(*path):
            objects[name] = fitted.make()
    return objects


# Drives, friction, loads, payloads.


def drive_of(model: Model, mechanism: Mechanism) -> dict[str, Drive]:
    """The drive of each moving joint: its own, or that of all.

    Raises:
        JointplayError: no such joint, or a drive that cannot be; `where` has the key.
    """
    common: Drive = ComputedTorque()
    shared: Any = model.drive
    if shared is not None:
        if shared.kind is Torque:
            raise JointplayError(
                "a torque acts on one joint; give [drives.JOINT]", where=("drive", "kind")
            )
        for name in mechanism.joints:
            of_joint(shared, ("drive",), partial(fit, mechanism, name))  # refuses misfits
        with within("drive"):
            common = shared.make()
    by_joint = made_by_joint(model.drives, mechanism, "drives")
    return dict.fromkeys(mechanism.joints, common) | by_joint


def led(
    model: Model, drives: Mapping[str, Drive], motion: Motion | None
) -> Drive | Mapping[str, Drive]:
    """Drives as a run has them: without those that follow a motion where none leads their joint.

    Raises:
        JointplayError: a joint's own drive follows a motion, and none leads it.
    """
    joints = () if motion is None else motion.joints
    for name in model.drives:
        if drives[name].follows and name not in joints:
            raise JointplayError(
                f"a {drives[name].kind} drive follows a motion, but [motion] does not give one for "
                "it",
                where=("drives", name),
            )
    if motion is not None and not model.drives:
        return next(iter(drives.values()))
    return {name: drive for name, drive in drives.items() if not drive.follows or name in joints}


def friction_of(model: Model, mechanism: Mechanism) -> dict[str, JointFriction] | None:
    """Friction of all moving joints; None unless the scenario states some."""
    if not model.joint_friction:
        return None
    by_joint = made_by_joint(model.joint_friction, mechanism, "joint_friction")
    return urdf_friction(mechanism) | by_joint


def loads_of(model: Model, mechanism: Mechanism) -> dict[str, Load]:
    """Springs, wrenches and other loads, by name, each checked against the mechanism."""
    loads: dict[str, Load] = {}
    for name, draft in drafts(model.loads).items():
        joint = draft.fields.get("joint", "")
        fitted = of_joint(draft, ("loads", name), partial(fit, mechanism, joint))
        with within("loads", name):
            load = fitted.make()
            load.site(mechanism)
            load.numbers(mechanism)
        loads[name] = load
    return loads


def payloads_of(model: Model, mechanism: Mechanism) -> tuple[Payload, ...]:
    """Payloads; held by the tool unless their frame is given."""
    payloads = []
    several: list[Any] = list(model.payloads)
    for index, draft in enumerate(several):
        with within("payloads", index):
            payload = Payload(**{"frame": mechanism.tool, **draft.fields})
            if not mechanism.model.existFrame(payload.frame):
                names = [f.name for f in mechanism.model.frames if f.name != "universe"]
                raise MissingName("frame", payload.frame, names, where=("frame",))
            payloads.append(payload)
    return tuple(payloads)


def errors_of(model: Model, mechanism: Mechanism) -> RobotErrors | None:
    """Errors besides play; None unless the scenario states some.

    Raises:
        JointplayError: no such joint, a unit of another kind of joint, or a value that cannot be;
            `where` has the key.
    """
    robot: Any = model.errors
    if robot is None:
        return None
    joints = made_by_joint(robot.fields.get("joints", {}), mechanism, "errors", "joints")
    with within("errors"):
        errors: RobotErrors = replace(robot, fields={**robot.fields, "joints": joints}).make()
        refuse_misfit(errors, mechanism)
        return errors


# The motion that a scenario gives: of a file, of joints, of the tool.


def motion_of(
    model: Model, mechanism: Mechanism, folder: Path, start: dict[str, float]
) -> Motion | None:
    """The reference motion; positions that it uses are taken out of `start`."""
    if model.motion is None:
        return None
    motion = _as_given(model, model.motion, mechanism, folder, start)
    if model.motion.faster is None:
        return motion
    with within("motion", "faster"):
        faster = require_positive("faster", model.motion.faster, "")
        return motion.at_speed(faster)


def _as_given(
    model: Model, table: Any, mechanism: Mechanism, folder: Path, start: dict[str, float]
) -> Motion:
    """The motion of [motion] at its own speed; see `motion_of`."""
    entries = table.given()
    sources = [key for key in MOTION_SOURCES if key in entries]
    if len(sources) != 1:
        several = " and ".join(sources) or "none"
        raise JointplayError(
            f"the motion needs one of {', '.join(MOTION_SOURCES)}; got {several}",
            where=("motion", *sources[1:2]),
        )
    (source,) = sources
    keys = (source, *MOTION_SOURCES[source])
    for key in (key for key in entries if key not in keys):
        raise JointplayError(unknown_key(key, keys) + f" (with {source})", where=("motion", key))
    if source == "file":
        with within("motion", "file"):
            return motion_from_file(resolve(entries["file"], folder), table.interpolation)
    if source == "speeds":
        return _turning(model, mechanism, start)
    if table.times is None:
        raise JointplayError(f"the key times is missing; {source} needs it", where=("motion",))
    if source == "tool_position":
        return _cartesian(table, mechanism, start)
    columns = []
    for name, values in entries["joints"].items():
        path = ("motion", "joints", name)
        if len(values) != len(table.times):
            raise JointplayError(
                f"{len(values)} positions for {len(table.times)} times; give one for each",
                where=path,
            )
        columns.append([fit(mechanism, name, value, ANGLE, path) for value in values])
    with within("motion"):
        positions = np.array(columns).reshape(len(columns), len(table.times)).T
        return Motion(list(entries["joints"]), table.times, positions, table.interpolation)


def motion_from_file(path: Path, interpolation: str | None) -> Motion:
    """Motion of a file, which is read again only once it has changed."""
    stamp: tuple[int, ...] = ()
    with suppress(OSError, ValueError):  # reading the file reports it
        status = path.stat()
        stamp = status.st_mtime_ns, status.st_size, status.st_ino
    return _read(path, interpolation, stamp)


@lru_cache(maxsize=16)
def _read(path: Path, interpolation: str | None, stamp: tuple[int, ...]) -> Motion:
    if path.suffix.lower() == ".mcap":
        return Motion.from_mcap(path, interpolation=interpolation)
    return Motion.from_csv(path, interpolation)


def _turning(model: Model, mechanism: Mechanism, start: dict[str, float]) -> Motion:
    """Motion of joints at constant speeds, over the duration of the run."""
    table: Any = model.motion
    duration = model.integration.duration
    if duration is None:
        raise JointplayError(
            "constant speeds do not end by themselves; give duration in [integration]",
            where=("motion", "speeds"),
        )
    speeds = [
        fit(mechanism, name, speed, ANGULAR_SPEED, ("motion", "speeds", name))
        for name, speed in table.speeds.items()
    ]
    begin = np.array([start.pop(name, 0.0) for name in table.speeds])
    with within("motion", "speeds"):
        positions = np.array([begin, begin + np.array(speeds) * duration])
        return Motion(list(table.speeds), [0.0, duration], positions, "constant-speed")


def _cartesian(table: Any, mechanism: Mechanism, start: dict[str, float]) -> Motion:
    """Motion of joints along poses of the tool, by inverse kinematics of the ideal mechanism."""
    for key in ("tool_position", "tool_rpy"):
        rows = getattr(table, key)
        if rows is not None and len(rows) != len(table.times):
            raise JointplayError(
                f"{len(rows)} waypoints for {len(table.times)} times; give one for each",
                where=("motion", key),
            )
    keys = {"positions": ("tool_position",), "orientations": ("tool_rpy",)}
    ideal = mechanism.ideal()
    begin = {name: value for name, value in start.items() if name in ideal.coordinates}
    with within("motion"), _relocated(keys):
        solution = cartesian_path(
            ideal,
            np.array(table.times),
            np.array(table.tool_position).reshape(-1, 3),
            None if table.tool_rpy is None else np.array(table.tool_rpy).reshape(-1, 3),
            frame=table.frame,
            path=table.path or PATHS[0],
            start=begin if ideal.loops else dict(start),
            driven=table.driven,
        )
    for name in begin if ideal.loops else solution.motion.joints:
        start.pop(name, None)  # it chose the branch, and is in the motion now
    start.update(solution.start)
    return solution.motion


# Joints that a scenario's motion does not name.


def complete(
    model: Model,
    mechanism: Mechanism,
    motion: Motion,
    start: dict[str, float],
    loads: Mapping[str, Load],
) -> tuple[Motion, list[str]]:
    """The motion completed for joints that it does not name: their drives hold them, or follow.

    Left alone are joints that have another kind of drive in [drives], a controller in [loads], a
    speed in [start_speed] or teeth that lead them; and, if there are [drives] at all, joints in
    [start]: they were meant to move. Positions of held joints are taken out of `start`.

    Returns:
        The motion, and lines on what was added.
    """
    shared: Any = model.drive
    if shared is not None and not shared.kind.follows:
        return motion, []
    drives: dict[str, Any] = dict(model.drives)
    following = {name for name, draft in drives.items() if draft.kind.follows}
    alone = (drives.keys() - following) | set(model.start_speed)
    for load in loads.values():
        alone |= set(load.driven()) | led_by_teeth(load, mechanism, motion)
    if drives:
        alone |= start.keys() - following
    added = complete_motion(mechanism, motion, start, alone)
    for name in added.held:
        start.pop(name, None)
    return added.motion, added.notes()


def build(
    model: Model, folder: Path, built: Built, still: bool = False
) -> tuple[Simulation, list[str]]:
    """The simulation that `model` describes.

    Args:
        model: the checked scenario of a case.
        folder: where relative paths begin.
        built: mechanisms that were built before.
        still: whether the machine stands still: the drives of all joints then hold it, including
            joints that the motion does not name.

    Returns:
        The simulation, and lines on what was added, or may be unintended.

    Raises:
        JointplayError: invalid or inconsistent input; `where` has the key.
    """
    mechanism = mechanism_of(model, folder, built)
    start = {
        name: fit(mechanism, name, value, ANGLE, ("start", name))
        for name, value in model.start.items()
    }
    start_speed = {
        name: fit(mechanism, name, value, ANGULAR_SPEED, ("start_speed", name))
        for name, value in model.start_speed.items()
    }
    motion = motion_of(model, mechanism, folder, start)
    loads = loads_of(model, mechanism)
    notes: list[str] = []
    if motion is not None:
        motion, notes = complete(model, mechanism, motion, start, loads)
    notes += mechanism.description.doubts
    notes += [mechanism.base_words] if mechanism.base_words else []
    notes += [*_of_zero(model, mechanism), *_of_wide_clearances(mechanism)]
    notes += _of_idle_planes(mechanism)
    drives = drive_of(model, mechanism)
    if model.linkage is not None:
        notes += _of_reach(mechanism, motion, start, drives)
        if motion is None and not (model.drive or model.drives or model.loads):
            notes.append("nothing drives the linkage: [motion] speeds turns a crank")
    if still:
        drive: Drive | Mapping[str, Drive] = drives
    else:
        notes += _of_falling(model, mechanism, motion, drives)
        drive = led(model, drives, motion)
    errors_of(model, mechanism)  # only checked: a run has none
    tables = (
        (Integration, model.integration),
        (RecordSettings, model.output),
        (LimitSettings, model.robot),
    )
    simulation = Simulation(
        mechanism,
        motion,
        drive,
        joint_friction=friction_of(model, mechanism),
        payloads=payloads_of(model, mechanism),
        loads=loads,
        state={name: (start.get(name), start_speed.get(name)) for name in {**start, **start_speed}},
        **{
            field.name: getattr(table, field.name)
            for kind, table in tables
            for field in fields(kind)
        },
    )
    return simulation, notes


def _of_zero(model: Model, mechanism: Mechanism) -> list[str]:
    """Notes on clearances and masses of 0, which are taken as none."""
    notes = [
        f"joint {name!r} has a clearance of 0: it is ideal"
        for name, draft in drafts(model.joints).items()
        if name not in mechanism.clearance and not draft.fields.get("ideal")
    ]
    bodies: list[Any] = list(model.payloads)
    return notes + [
        f"payload {number} has a mass of 0 kg: there is none"
        for number, draft in enumerate(bodies, 1)
        if draft.fields["mass"] == 0.0
    ]


_WIDE = 0.1
"""Clearance, relative to the bearing's radius, from which a note asks for the unit: a loose fit has
a hundredth, and millimetres in place of micrometres are a thousand times off (judged)."""


def _of_wide_clearances(mechanism: Mechanism) -> list[str]:
    """Notes on clearances so wide that another unit may have been meant."""
    return [
        f"joint {name!r} has a radial clearance of {readable(joint.cr, 'm')} in a bearing of "
        f"radius {readable(joint.ri, 'm')}, {joint.cr / joint.ri:.0%} of it: is the unit right?"
        for name, joint in mechanism.clearance.items()
        if isinstance(joint, RoundClearance) and joint.cr >= _WIDE * joint.ri
    ]


_TURNED = 0.3
"""Position of joints at which it is judged whether gravity moves them [rad or m] (judged: any that
is no multiple of a quarter turn, where arms stand straight up, would do)."""


_NOT_COUPLED = 1e-9
"""Inertia that two coordinates share, relative to the geometric mean of their own, up to which it
is rounding (judged: a product of some ten transforms has 1e-15)."""


def _of_idle_planes(mechanism: Mechanism) -> list[str]:
    """Notes on planar guides whose play lies across the plane in which all else moves and weighs.

    In a loop nothing moves the journal along x; in the tree x shares no inertia with the other
    coordinates, and no weight acts along it.
    """
    q = _TURNED * np.ones(mechanism.model.nq)
    q[[i for i in range(len(q)) if mechanism.plays(i)]] = 0.0
    mass, weight = mechanism.mass_matrix(q), mechanism.gravity_forces(q)
    idle = []
    for name, joint in mechanism.clearance.items():
        planar = joint.slides() and "x" in joint.freedoms and "y" not in joint.freedoms
        if not planar:
            continue
        if name in mechanism.loops:
            moves = np.abs(mechanism.relative_jacobian(name, q)[:3])
            if moves[0].max() <= _NOT_COUPLED * moves.max():
                idle.append(name)
            continue
        at = mechanism.coordinates.index(Coordinate(name, "x"))
        others = [
            i for i, coordinate in enumerate(mechanism.coordinates) if coordinate.joint != name
        ]
        size = np.sqrt(mass[at, at] * mass.diagonal()[others])
        apart = np.abs(mass[at, others]) <= _NOT_COUPLED * size
        if others and apart.all() and abs(weight[at]) <= _NOT_COUPLED * mass[at, at]:
            idle.append(name)
    return [
        f"joint {name!r} has planar play along x of its frame, across which nothing else moves or "
        "weighs, so that it carries nothing: is its frame turned as meant (x across the guide in "
        "the plane of motion)?"
        for name in idle
    ]


def _of_reach(
    mechanism: Mechanism,
    motion: Motion | None,
    start: Mapping[str, float],
    drives: Mapping[str, Drive],
) -> list[str]:
    """Notes on where along the motion loops cannot be closed, as past a dead point.

    Raises:
        JointplayError: the motion is prescribed, so that nothing could follow it.
    """
    if motion is None or not mechanism.loops:
        return []
    try:
        along_motion(mechanism, motion, near=start)
    except JointplayError as error:
        if any(isinstance(drives.get(name), Prescribed) for name in motion.joints):
            raise JointplayError(
                f"{error}, and a prescribed drive gives way to nothing", where=("motion",)
            ) from None
        return [f"warning: {error}; a machine that is driven on breaks there"]
    return []


def _of_falling(
    model: Model, mechanism: Mechanism, motion: Motion | None, drives: Mapping[str, Drive]
) -> list[str]:
    """A warning about joints with motors that gravity moves and nothing holds; none if meant.

    Free drives, loads or loops in the scenario show that it is meant.
    """
    intended = model.drives or model.loads
    if motion is not None or intended or mechanism.loops or not any(mechanism.gravity):
        return []
    entries = mechanism.description.joints
    filed = mechanism.description.beyond.tables.get("drives", {})
    driven = [name for name in filed if filed[name]["kind"] != "free"]
    driven = [*mechanism.joints] if model.drive is not None else driven
    motors = [
        name
        for name in mechanism.joints
        if drives[name].follows and (entries[name].effort or name in driven)
    ]
    q = mechanism.configuration(dict.fromkeys(motors, _TURNED))
    weight = mechanism.gravity_forces(q)
    moved = {name: abs(weight[mechanism.coordinate(name)]) for name in motors}
    falling = [name for name, effort in moved.items() if effort > _WEIGHTLESS]
    if not falling:
        return []
    idle = "no motion, without which drives do nothing" if driven else "no motion and no drive"
    return [
        f"warning: {idle}: the arm falls ({few(falling)}); give [motion], or "
        '[drives] NAME = "free" if that is meant'
    ]


_WEIGHTLESS = 1e-6
"""Effort of gravity up to which it does not move a joint [N m or N] (judged: a milligram at a
tenth of a metre)."""


Built = OrderedDict[tuple[str, ...], Mechanism]
"""Mechanisms that a scenario has built, by their inputs: a case is checked, then run."""
_LAST_BUILT = 4
"""Number of mechanisms that are kept (judged: the ideal machine and three cases)."""


def mechanism_of(model: Model, folder: Path, built: Built) -> Mechanism:
    """The mechanism that `model` describes; alike ones are built once."""
    robot, linkage = model.robot, model.linkage
    closing: Mapping[str, Loop] = {}
    balls: Mapping[str, Clearance] = {}
    reason = ""  # why this tool, if none was named
    if linkage is None:
        with within("robot", "urdf"):
            description = read(robot.urdf, robot.allow_unphysical, folder, robot.xacro)
    else:
        with within("linkage"):
            drawn: Linkage = linkage.make() if isinstance(linkage, Draft) else linkage
            description, closing, balls = tree_of(drawn, model.joints)
            if robot.tool is None:
                robot, reason = replace(robot, tool=drawn.tool), drawn.tool_reason
    with within("robot"):
        description = with_fixed(description, robot.fix)
        description = without_floating_base(description, model.joints)
    parts = model.loops, closing, model.joints, model.gears, model.links
    inputs = (robot, reason, *parts, folder)
    key = (str(description.path), description.text, *map(repr, inputs))
    ready = built.pop(key, None) or _built_anew(
        replace(model, robot=robot), description, closing, balls, reason
    )
    built[key] = ready
    if len(built) > _LAST_BUILT:
        built.popitem(last=False)
    return ready


def _built_anew(
    model: Model,
    description: Description,
    closing: Mapping[str, Loop],
    balls: Mapping[str, Clearance],
    reason: str,
) -> Mechanism:
    """Make the objects of a model and the mechanism of them; see `mechanism_of`.

    Args:
        model: the checked scenario of a case.
        description: its robot, with joints held.
        closing, balls: loops and ideal balls of a linkage.
        reason: why the tool is a linkage's output.
    """
    robot = model.robot
    loops = dict(closing)
    for name, ends in model.loops.items():
        bearing, journal = ends.bearing, ends.journal
        with within("loops", name):
            refuse_name(name, description.joints)  # lest a joint be found missing instead
            loops[name] = Loop(
                bearing.link, journal.link, bearing.xyz, bearing.rpy, journal.xyz, journal.rpy
            )
    joints = dict(balls)
    for name, draft in drafts(model.joints).items():
        with within("joints", name):
            kind: Any = draft.kind
            if name not in description.joints and name not in loops:
                able = [j.name for j in description.joints.values() if j.kind in kind.replaces]
                raise MissingName("joint", name, [*able, *loops])
            # An ideal joint of this kind is what the URDF has there: it needs no dimensions.
            plain = not (kind.compound() or (name in loops and kind.slides()))
            plain = plain and draft.word is not None
            if not (plain and draft.fields.get("ideal")):
                joint = draft.make()
                if not (plain and joint.ideal):
                    joints[name] = joint
    gears = {}
    for name, draft in drafts(model.gears).items():
        entry = description.joints.get(name)
        if entry is not None:
            draft = of_joint(draft, ("gears", name), partial(fit_entry, entry))
        with within("gears", name):
            gears[name] = draft.make()
    flexible: dict[str, FlexibleLink] = {}
    tables: Mapping[str, Any] = model.links
    for name, table in tables.items():
        with within("links", name, "flexible"):
            flexible[name] = table.flexible.make()
    # The tool is chosen by all joints named, so that cases with and without play have the same one.
    tool = robot.tool
    if tool is None:
        tool, reason = choose_tool(description, {*model.joints, *model.gears})
        tool = end_of_tool(tool, flexible)
    places = {key: ("robot", key) for key in ("tool", "gravity", "allow_unphysical", "base")}
    with _relocated({**places, "clearance": ("joints",), "flexible": ("links",)}):
        mechanism = Mechanism(
            description, joints, loops=loops, gears=gears, flexible=flexible, gravity=robot.gravity,
            tool=tool, allow_unphysical=robot.allow_unphysical, fix=robot.fix, base=robot.base,
        )  # fmt: skip
    mechanism.tool_reason = reason
    return mechanism
