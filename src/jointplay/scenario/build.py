"""From a checked scenario to the simulation that it describes."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.contact import film_law, friction_law, normal_law
from jointplay.contact.trust import trusting
from jointplay.errors import JointplayError, MissingName, require_positive
from jointplay.host.files import is_file
from jointplay.joints import Clearance, Material
from jointplay.loads.drive import DRIVES, ComputedTorque, Drive, JointFriction
from jointplay.mechanism.gear import Gear
from jointplay.mechanism.loop import Loop
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.payload import Payload
from jointplay.mechanism.robots import PREFIX, robot_urdf
from jointplay.mechanism.urdf import shipped
from jointplay.motion.cartesian import cartesian_motion
from jointplay.motion.reference import Motion
from jointplay.scenario.model import CUSTOM_LAWS, KINDS, Model
from jointplay.scenario.tables import (
    ANGLE,
    ANGULAR_SPEED,
    TORQUE,
    Table,
    unit_of,
    unknown_key,
)
from jointplay.simulation.simulation import Simulation
from jointplay.units import WORDS, Measured, expected, shown

SHIPPED = "jointplay:"
"""Prefixes of files that are no paths."""

_LAWS: dict[str, Callable[[dict[str, Any]], Any]] = {
    "normal": normal_law,
    "friction": friction_law,
    "lubricant": film_law,
}
"""What builds the laws of a joint, by key."""

MOTION_SOURCES = {
    "file": ("interpolation", "faster"),
    "joints": ("times", "interpolation", "faster"),
    "speeds": (),
    "tool_position": ("times", "tool_rpy", "frame", "path", "faster"),
}
"""Keys of [motion] of which there is one, and those that go with it."""


class Misplaced(JointplayError):
    """Wrong input at a known key of the scenario."""

    def __init__(self, path: tuple[str | int, ...], message: str) -> None:
        """Keep the key's path."""
        super().__init__(message)
        self.path = path


@contextmanager
def at(*path: str | int, keys: Iterable[str] = ()) -> Iterator[None]:
    """Say of errors in the block that they stem from the key `path`.

    Or from that of `keys` within it that the message names first.
    """
    try:
        yield
    except Misplaced:
        raise
    except JointplayError as error:
        raise Misplaced((*path, *_named(str(error), keys)), str(error)) from None


def _named(message: str, keys: Iterable[str]) -> list[str]:
    """That of `keys`, if any, which `message` names first, as the key or in words."""
    found = []
    for key in keys:
        place = re.search(rf"\b{key.replace('_', '[_ ]')}\b", message)
        if place:
            found.append((place.start(), -len(key), key))
    return [min(found)[2]] if found else []


@contextmanager
def waypoint(key: str) -> Iterator[None]:
    """Say of errors in the block that they stem from the waypoint they name, in `key`."""
    try:
        yield
    except JointplayError as error:
        found = re.search(r"\bwaypoint (\d+)", str(error))
        place = (key, int(found[1]) - 1) if found else ()
        raise Misplaced(("motion", *place), str(error)) from None


def locate(place: str, folder: Path) -> Path:
    """Path of a file that a scenario in `folder` names.

    Raises:
        JointplayError: nothing of that name ships with the package, or with example-robot-data.
    """
    if place.startswith(SHIPPED):
        return shipped(place.removeprefix(SHIPPED))
    if place.startswith(PREFIX):
        return robot_urdf(place.removeprefix(PREFIX))
    return folder / place


def build(model: Model, folder: Path) -> Simulation:
    """Simulation that `model` describes; its paths are relative to `folder`.

    Raises:
        Misplaced: what cannot be, with the path of the key.
        JointplayError: what has no single key.
    """
    mechanism = _mechanism(model, folder)
    start = {
        name: _fit(mechanism, name, value, ANGLE, ("start", name))
        for name, value in model.start.items()
    }
    start_speed = {
        name: _fit(mechanism, name, value, ANGULAR_SPEED, ("start_speed", name))
        for name, value in model.start_speed.items()
    }
    motion = _motion(model, mechanism, folder, start)
    drive = _drive(model, mechanism, motion)
    integration = model.integration
    return Simulation(
        mechanism,
        motion,
        drive=drive,
        duration=integration.duration,
        step=integration.step,
        integrator=integration.integrator,
        macro_step=integration.macro_step,
        tolerance=integration.tolerance,
        record_every=model.output.record_every,
        joint_friction=_joint_friction(model, mechanism),
        seed=integration.seed,
        payloads=_payloads(model, mechanism),
        start=start,
        start_speed=start_speed,
    )


def _mechanism(model: Model, folder: Path) -> Mechanism:
    """The mechanism as a whole, or if that fails part by part: an error then has a place."""
    try:
        return _whole(model, folder)
    except JointplayError:
        return _part_by_part(model, folder)


def _whole(model: Model, folder: Path) -> Mechanism:
    robot = model.robot
    path = locate(robot.urdf, folder)
    joints = {
        name: _joint(table, folder)
        for name, table in model.joints.items()
        if not (table.ideal and _plain_when_ideal(table.kind, name in model.loops))
    }
    mechanism = Mechanism(
        path,
        joints,
        loops={name: _loop(ends) for name, ends in model.loops.items()},
        gears={name: Gear(**table.given()) for name, table in model.gears.items()},
        gravity=robot.gravity,
        tool=robot.tool,
        allow_unphysical=robot.allow_unphysical,
    )
    for name in model.joints:
        if name not in mechanism.description.joints and name not in model.loops:
            raise MissingName("joint", name, [*mechanism.description.joints, *model.loops])
    return mechanism


def _loop(ends: Any) -> Loop:
    bearing, journal = ends.bearing, ends.journal
    return Loop(bearing.link, journal.link, bearing.xyz, bearing.rpy, journal.xyz, journal.rpy)


def _part_by_part(model: Model, folder: Path) -> Mechanism:
    robot = model.robot
    with at("robot", "urdf"):
        path = locate(robot.urdf, folder)
        description = Mechanism(path, allow_unphysical=robot.allow_unphysical).description
    options: dict[str, Any] = {
        "gravity": robot.gravity,
        "tool": robot.tool,
        "allow_unphysical": robot.allow_unphysical,
    }
    with at("robot", "tool"):
        Mechanism(path, **options)
    loops: dict[str, Loop] = {}
    for name, ends in model.loops.items():
        with at("loops", name):
            loops[name] = _loop(ends)
            Mechanism(path, loops=loops, **options)
    joints: dict[str, Clearance] = {}
    for name, table in model.joints.items():
        with at("joints", name, keys=table.given()):
            if name not in description.joints and name not in loops:
                raise MissingName("joint", name, [*description.joints, *loops])
            if table.ideal and _plain_when_ideal(table.kind, name in loops):
                continue
            joints[name] = _joint(table, folder)
            Mechanism(path, joints, loops=loops, **options)
    gears: dict[str, Gear] = {}
    for name, table in model.gears.items():
        with at("gears", name, keys=table.given()):
            gears[name] = Gear(**table.given())
            Mechanism(path, joints, loops=loops, gears=gears, **options)
    return Mechanism(path, joints, loops=loops, gears=gears, **options)


def _plain_when_ideal(kind: str, loop: bool) -> bool:
    """Whether an ideal joint of this kind is what stands there anyway, and needs no dimensions."""
    return kind in ("revolute", "planar") or (kind == "prismatic" and not loop)


def _joint(table: Any, folder: Path) -> Clearance:
    given = table.given()
    given.pop("kind", None)
    for key, value in given.items():
        if key in _LAWS:
            defaults = {"law": value.law}
            if value.law in CUSTOM_LAWS:
                defaults["parameters"] = tuple(value.parameters)
            with _beside(folder, getattr(value, "function", "")):
                given[key] = _LAWS[key](value.given() | defaults)
        elif isinstance(value, Table):
            given[key] = Material(**value.given())
    joint: Clearance = KINDS[table.kind][1](**given)
    return joint


@contextmanager
def _beside(folder: Path, function: str) -> Iterator[None]:
    """Let a law of the user's own be found beside the scenario that names it."""
    module = function.partition(":")[0].partition(".")[0]
    own = folder / f"{module}.py", folder / module / "__init__.py"
    if not module.isidentifier() or not any(is_file(path) for path in own):
        yield
        return
    place = str(folder.resolve())
    sys.path.insert(0, place)
    try:
        with trusting({module}):
            yield
    finally:
        sys.path.remove(place)


def _fit(
    mechanism: Mechanism,
    joint: str,
    value: float,
    units: tuple[str, str],
    path: tuple[str | int, ...],
) -> float:
    """`value` as float, if its unit is one for this joint: units are (revolute's, prismatic's)."""
    if joint not in mechanism.joints:
        raise Misplaced(path, str(MissingName("moving joint", joint, mechanism.joints)))
    kind = mechanism.description.joints[joint].kind
    unit = units[kind == "prismatic"]
    if isinstance(value, Measured) and value.unit not in ("", unit):
        raise Misplaced(
            path,
            f"{shown(value.text)} is no {WORDS[unit][0]}, but joint {joint!r} is {kind}; "
            f"expected {expected(unit)}",
        )
    return float(value)


def _motion(
    model: Model, mechanism: Mechanism, folder: Path, start: dict[str, float]
) -> Motion | None:
    """The reference; takes out of `start` what it uses."""
    if model.motion is None:
        return None
    motion = _as_given(model, model.motion, mechanism, folder, start)
    faster = model.motion.faster
    if faster == 1.0:
        return motion
    with at("motion", "faster"):
        require_positive("faster", faster, "")
        return Motion(motion.joints, motion.times / faster, motion.positions, motion.interpolation)


def _as_given(
    model: Model, table: Any, mechanism: Mechanism, folder: Path, start: dict[str, float]
) -> Motion:
    """The reference at the speed that the scenario gives it."""
    given = table.given()
    sources = [key for key in MOTION_SOURCES if key in given]
    if len(sources) != 1:
        raise Misplaced(
            ("motion", *sources[1:2]),
            f"the motion needs one of {', '.join(MOTION_SOURCES)}; "
            f"got {' and '.join(sources) or 'none'}",
        )
    (source,) = sources
    for key in given:
        if key not in (source, *MOTION_SOURCES[source]):
            keys = (source, *MOTION_SOURCES[source])
            raise Misplaced(("motion", key), unknown_key(key, keys) + f" (with {source})")
    if source == "file":
        with at("motion", "file"):
            return _from_csv(locate(given["file"], folder), table.interpolation)
    if source == "speeds":
        return _turning(model, mechanism, start)
    if table.times is None:
        raise Misplaced(("motion",), f"the key times is missing; {source} needs it")
    if source == "tool_position":
        return _cartesian(table, mechanism, start)
    columns = []
    for name, values in given["joints"].items():
        path = ("motion", "joints", name)
        if len(values) != len(table.times):
            raise Misplaced(
                path, f"{len(values)} positions for {len(table.times)} times; give one for each"
            )
        columns.append([_fit(mechanism, name, value, ANGLE, path) for value in values])
    with waypoint("times"):
        positions = np.array(columns).reshape(len(columns), len(table.times)).T
        return Motion(list(given["joints"]), table.times, positions, table.interpolation)


def _from_csv(path: Path, interpolation: str) -> Motion:
    """Motion of a file, which is read again only once it has changed."""
    try:
        found = path.stat()
    except (OSError, ValueError):  # which from_csv puts into words
        return Motion.from_csv(path, interpolation)
    return _read_csv(path, interpolation, (found.st_mtime_ns, found.st_size, found.st_ino))


@lru_cache(maxsize=16)
def _read_csv(path: Path, interpolation: str, stamp: tuple[int, ...]) -> Motion:
    return Motion.from_csv(path, interpolation)


def _turning(model: Model, mechanism: Mechanism, start: dict[str, float]) -> Motion:
    """Joints at constant speed."""
    assert model.motion is not None
    assert model.motion.speeds is not None
    duration = model.integration.duration
    if duration is None:
        raise Misplaced(
            ("motion", "speeds"), "constant speeds have no end; give duration in [integration]"
        )
    names = list(model.motion.speeds)
    speeds = [
        _fit(mechanism, name, speed, ANGULAR_SPEED, ("motion", "speeds", name))
        for name, speed in model.motion.speeds.items()
    ]
    begin = np.array([start.pop(name, 0.0) for name in names])
    with at("motion", "speeds"):
        positions = [begin, begin + np.array(speeds) * duration]
        return Motion(names, [0.0, duration], np.array(positions), "constant-speed")


def _cartesian(table: Any, mechanism: Mechanism, start: dict[str, float]) -> Motion:
    """Joints that move a frame as asked."""
    for key in ("tool_position", "tool_rpy"):
        rows = getattr(table, key)
        if rows is not None and len(rows) != len(table.times):
            raise Misplaced(
                ("motion", key),
                f"{len(rows)} waypoints for {len(table.times)} times; give one for each",
            )
    with waypoint("tool_position"):
        motion: Motion = cartesian_motion(
            mechanism.ideal(),
            np.array(table.times),
            np.array(table.tool_position).reshape(-1, 3),
            None if table.tool_rpy is None else np.array(table.tool_rpy).reshape(-1, 3),
            frame=table.frame,
            path=table.path,
            start=dict(start) or None,
        )
    for name in motion.joints:
        start.pop(name, None)
    return motion


def _drive(
    model: Model, mechanism: Mechanism, motion: Motion | None
) -> Drive | Mapping[str, Drive]:
    common: Drive = ComputedTorque()
    if model.drive is not None:
        if model.drive.kind == "torque":
            raise Misplaced(("drive", "kind"), "a torque acts on one joint; give [drives.JOINT]")
        common = _one_drive(model.drive, ("drive",))
    if motion is not None and not model.drives:
        return common
    drives: dict[str, Drive] = {}
    if motion is not None and common.follows:
        drives = dict.fromkeys(motion.joints, common)
    for name, table in model.drives.items():
        path = ("drives", name)
        if name not in mechanism.joints:
            raise Misplaced(path, str(MissingName("moving joint", name, mechanism.joints)))
        fitted = {}
        if table.kind == "torque":
            fitted["values"] = tuple(
                _fit(mechanism, name, value, TORQUE, (*path, "values")) for value in table.values
            )
        drives[name] = _one_drive(table, path, **fitted)
        if drives[name].follows and (motion is None or name not in motion.joints):
            kind = drives[name].kind
            raise Misplaced(path, f"a {kind} drive follows a motion, and [motion] has none for it")
    return drives


def _one_drive(table: Any, path: tuple[str, ...], **fitted: Any) -> Drive:
    given = {key: value for key, value in table.given().items() if key != "kind"}
    with at(*path, keys=given):
        return DRIVES[table.kind](**(given | fitted))


def _joint_friction(model: Model, mechanism: Mechanism) -> dict[str, JointFriction] | None:
    """Friction of all moving joints, where the scenario says anything of it."""
    if not model.joint_friction:
        return None
    entries = mechanism.description.joints
    found = {
        name: JointFriction(entries[name].friction, entries[name].damping)
        for name in mechanism.joints
    }
    for name, table in model.joint_friction.items():
        path = ("joint_friction", name)
        fields = {}
        for key, value in table.given().items():
            revolute, prismatic = unit_of(JointFriction, key)
            fields[key] = _fit(mechanism, name, value, (revolute, prismatic), (*path, key))
        if name not in found:
            raise Misplaced(path, str(MissingName("moving joint", name, mechanism.joints)))
        with at(*path, keys=fields):
            found[name] = JointFriction(**fields)
    return found


def _payloads(model: Model, mechanism: Mechanism) -> tuple[Payload, ...]:
    found = []
    for index, table in enumerate(model.payloads):
        with at("payloads", index, keys=table.given()):
            payload = Payload(**{"frame": mechanism.tool, **table.given()})
            if not mechanism.model.existFrame(payload.frame):
                names = [f.name for f in mechanism.model.frames if f.name != "universe"]
                raise MissingName("frame", payload.frame, names)
            found.append(payload)
    return tuple(found)
