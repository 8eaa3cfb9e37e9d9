"""What the commands about static play have in common: which robot, which play, which poses."""

from __future__ import annotations

import argparse
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.commands import (
    add_option,
    add_repeatable,
    add_shared,
    given,
    listed,
    name_and_value,
    numbers_by_name,
    quantity,
)
from jointplay.core import files
from jointplay.core.errors import JointplayError, MissingName, require_non_negative

if TYPE_CHECKING:
    import numpy as np

    from jointplay.design.robot_errors import RobotErrors
    from jointplay.joints import Clearance
    from jointplay.mechanism.mechanism import Mechanism
    from jointplay.motion.reference import Motion
    from jointplay.scenario.presets import Preset
    from jointplay.scenario.settings import Setting
    from jointplay.simulation.simulation import Simulation


@dataclass(frozen=True)
class Task:
    """A robot with play, and the poses to look at."""

    mechanism: Mechanism
    q: np.ndarray
    """Configurations, (n, nq)."""
    poses: str
    """Which they are, in words."""
    kind: str
    """``pose``, ``motion`` or ``workspace``."""
    names: tuple[str, ...]
    """Of poses that were given one by one."""
    motion: Motion | None
    simulation: Simulation | None
    """Of the scenario, if one was given."""
    driven: tuple[str, ...] | None
    """Joints of closed loops that stand; None without loops."""
    notes: tuple[str, ...]
    """What was chosen for the user, a line each."""
    errors: RobotErrors | None = None
    """Besides play, of the scenario."""


def add_robot(parser: Any, default: str = "by default all joints that move the tool") -> Any:
    """Add the options that say which robot has which play; returns their last group.

    Args:
        default: which joints have clearance if --joint names none, in words.
    """
    parser.add_argument(
        "robot",
        metavar="ROBOT",
        help="URDF, name of a robot of example-robot-data (jointplay robots), or scenario (.toml)",
    )
    add_shared(parser, "--case")
    group = parser.add_argument_group("play")
    add_option(group, "--clearance LENGTH", "radial clearance of the joints given by --joint")
    add_repeatable(
        group,
        "--joint NAME[=LENGTH|=BEARING]",
        "joint with clearance, and optionally its radial clearance, or the designation of its "
        f'rolling bearing, such as elbow="6010/C3"; {default}',
    )
    add_option(group, "--axial LENGTH", "axial clearance (default: the radial one)")
    add_option(group, "--bearing-radius LENGTH", "R_i (default 10 mm)")
    add_option(group, "--bearing-length LENGTH", "L_i (default 40 mm)")
    add_repeatable(
        group, "--gear NAME=ANGLE", 'total play of a joint\'s gear, such as elbow="2 arcmin"'
    )
    group.add_argument(
        "--preset",
        metavar="NAME",
        nargs="?",
        const="",
        help="joints and gears as they are publicly known, or assumed for a class of robots "
        "(jointplay presets lists them; without NAME that of ROBOT); --joint and --gear count more",
    )
    group = parser.add_argument_group("robot")
    add_option(group, "--tool FRAME", "frame whose error is computed")
    add_shared(group, "--allow-unphysical")
    add_shared(group, "--fix")
    return group


def add_poses(parser: Any) -> None:
    """Add the options that say at which poses."""
    group = parser.add_argument_group("poses (default: along the scenario's motion, or one pose)")
    add_repeatable(
        group,
        "--pose JOINT=X,...",
        "joint positions [rad or m, or with a unit]; other joints are at zero, or mid-range if "
        "zero is outside their limits",
    )
    add_option(
        group,
        "--poses FILE",
        "CSV with a pose in each line and the header <joint>,..., or name,<joint>,... to name them",
    )
    add_option(group, "--motion CSV", "waypoints, with the header time_s,<joint>,...")
    add_option(group, "--workspace N", "N poses spread over the limits of all joints")


def add_load(parser: Any) -> None:
    """Add the options that say what pulls at the tool."""
    add_option(parser, "--force FX,FY,FZ", "force on the tool, world axes [N]")
    add_option(parser, "--payload MASS", "mass held at the tool")


def load_on_tool(
    options: argparse.Namespace, gravity: Sequence[float]
) -> tuple[float, float, float]:
    """Force on the tool in world axes [N]: what --force and --payload say."""
    parts = ["0"] * 3 if options.force is None else options.force.split(",")
    if len(parts) != 3:
        raise JointplayError(f"--force must be three numbers fx,fy,fz [N], got {options.force!r}")
    force = [quantity(part, "N", "--force") for part in parts]
    if options.payload is not None:
        require_non_negative("--payload", options.payload, "kg")
        force = [f + options.payload * g for f, g in zip(force, gravity, strict=True)]
    return force[0], force[1], force[2]


def add_whole(parser: Any) -> None:
    """Add the options that say which causes of error count beside play."""
    parser.add_argument(
        "--whole",
        metavar="CLASS",
        nargs="?",
        const="",
        help="the whole error: besides play elasticity, encoders, gears, geometry and heat, of a "
        "robot of this class where nothing else is known (calibrated-industrial, industrial, "
        "printed; without CLASS that of the scenario's [errors] or of the preset)",
    )
    add_option(
        parser,
        "--causes LIST",
        "causes that count in --whole, such as play,elasticity (default: all)",
        type=listed,
    )


def error_class(options: argparse.Namespace, work: Task) -> str:
    """The class that --whole names, or else the scenario, or the preset.

    Raises:
        JointplayError: none of them does.
    """
    from jointplay.design.robot_errors import CLASSES

    said = [options.whole, work.errors and work.errors.assumed]
    if (chosen := preset_chosen(options)) is not None:
        said.append(chosen.errors)
    for one in said:
        if one:
            return str(one)
    raise JointplayError(
        f"--whole needs a class of robots from which is taken what is not given: "
        f"{', '.join(CLASSES)}; or [errors] of the scenario says it, such as assumed = "
        f'"{CLASSES[1]}"'
    )


def task(options: argparse.Namespace) -> Task:
    """Build what the options say.

    Raises:
        JointplayError: what cannot be, in one line.
    """
    import numpy as np

    from jointplay.design import poses

    mechanism, simulation, errors, notes = _mechanism(options)
    chosen = [
        one
        for one in ("pose", "poses", "motion", "workspace")
        if getattr(options, one, None) not in (None, [])
    ]
    if len(chosen) > 1:
        raise JointplayError(f"give one of --{' and --'.join(chosen)}")
    motion = simulation.motion if simulation is not None else None
    if options.motion is not None:
        from jointplay.motion.reference import Motion

        motion = Motion.from_csv(options.motion)
    driven, near = None, {}
    if mechanism.loops:
        near = {} if simulation is None else poses.start_of(simulation)
        driven = poses.standing(mechanism, motion, near)
        notes.append(_loops(mechanism, driven))
    names: tuple[str, ...] = ()
    if options.workspace is not None:
        q = poses.over_workspace(mechanism, options.workspace, driven=driven, near=near)
        kind, words = "workspace", f"{len(q)} poses over the workspace"
        if len(q) < options.workspace:
            words += (
                f" ({options.workspace - len(q)} others were left out because the loops do not "
                "close there)"
            )
    elif motion is not None and not {"pose", "poses"}.intersection(chosen):
        q, kind = poses.along_motion(mechanism, motion, near=near), "motion"
        words = f"{len(q)} poses along the motion"
    else:
        asked = _given_poses(mechanism, options)
        rows = []
        for name, one in asked.items():
            try:
                rows.append(poses.at_pose(mechanism, one, driven, near))
            except JointplayError as error:
                if len(asked) == 1 and "poses" not in chosen:
                    raise
                raise JointplayError(f"pose {name}: {error}") from None
        q, kind = np.concatenate(rows), "pose"
        words = _words_of_pose(mechanism, next(iter(asked.values())), driven)
        if len(asked) > 1:
            names, words = tuple(asked), f"{len(asked)} poses"
        elif not chosen:
            words += " (chosen: zero, or the middle of the limits; see --pose, --motion)"
    return Task(mechanism, q, words, kind, names, motion, simulation, driven, tuple(notes), errors)


def _given_poses(mechanism: Mechanism, options: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Joint positions of the poses that are given one by one, by name; at least one."""
    file = getattr(options, "poses", None)
    if file is None:
        return {text: _positions(mechanism, text) for text in options.pose or [""]}
    (_, header), *rows = files.csv_rows(Path(file), "poses")
    header = [cell.strip() for cell in header]
    named = header[0] == "name"
    found: dict[str, dict[str, float]] = {}
    for number, row in rows:
        cells = [cell.strip() for cell in row]
        name = cells[0] if named else str(len(found) + 1)
        if name in found:
            raise JointplayError(f"{file}, line {number}: there are two poses {name!r}")
        found[name] = {
            joint: _position(mechanism, joint, cell, f"{file}, line {number}, {joint}")
            for joint, cell in list(zip(header, cells, strict=True))[named:]
        }
    if not found:
        raise JointplayError(f"{file} has no poses: give a line of joint positions for each")
    return found


def _words_of_pose(
    mechanism: Mechanism, positions: dict[str, float], driven: tuple[str, ...] | None
) -> str:
    """Where the joints are that move the tool."""
    from jointplay.design import poses

    chain = mechanism.model.supports[mechanism.model.frames[mechanism.tool_frame].parentJoint]
    moving = set(driven or (mechanism.model.names[i] for i in chain))
    pose = {**poses.middle(mechanism), **positions}
    return "pose " + ", ".join(f"{name} {x:.4g}" for name, x in pose.items() if name in moving)


def _loops(mechanism: Mechanism, driven: tuple[str, ...]) -> str:
    """Which joints of the loops stand and which follow, a line."""
    from jointplay.design import poses
    from jointplay.mechanism.closed_loops import ClosedLoops

    passive = ClosedLoops(mechanism, mechanism.configuration({}), driven).passive
    follow = [name for name in poses.moving(mechanism) if mechanism.coordinate(name) in passive]
    return f"loops: driven {', '.join(driven) or 'none'}; following {', '.join(follow) or 'none'}"


def _mechanism(
    options: argparse.Namespace,
) -> tuple[Mechanism, Simulation | None, RobotErrors | None, list[str]]:
    from jointplay.mechanism.mechanism import Mechanism
    from jointplay.mechanism.tool import choose_tool

    simulation, errors, notes = None, None, []
    if str(options.robot).endswith(".toml"):
        from jointplay.scenario import Scenario

        scenario = Scenario.load(options.robot, settings=robot_settings(options))
        simulation, errors = scenario.simulation(options.case), scenario.robot_errors(options.case)
        named = scenario.model(options.case or scenario.cases[0]).robot.tool
        description = simulation.mechanism.description
        allowed, fix = simulation.mechanism.allow_unphysical, simulation.mechanism.fix
        plain = simulation.mechanism.ideal()
        if plain.free_base is not None:
            notes.append(
                f"the base {description.root!r} is free in the scenario; here it is held, as if "
                "bolted to the ground"
            )
    elif options.case is not None:
        raise JointplayError("--case needs a scenario (.toml)")
    else:
        allowed, fix, named = options.allow_unphysical, options.fix, None
        plain = Mechanism(options.robot, allow_unphysical=allowed, fix=fix)
        description = plain.description
    description.require_moving()
    if plain.held:
        notes.append(plain.held)
    tool = options.tool or named
    if tool is None:
        loose = [name_and_value(text, description.joints)[0] for text in options.joint]
        if simulation is not None and not loose:
            loose = [*simulation.mechanism.clearance]
        tool, reason = choose_tool(description, loose)
        notes.append(f"tool: {tool!r} (chosen: {reason}; see --tool)")
    elif not plain.model.existFrame(tool):
        Mechanism(description.path, tool=tool, allow_unphysical=allowed)  # says which there are
    if simulation is not None and options.clearance is None and not options.joint:
        clearance = dict(simulation.mechanism.clearance)
    else:
        clearance = _clearance(options, plain, tool, notes, simulation)
    gears = dict(simulation.mechanism.gears) if simulation is not None else {}
    if (chosen := preset_chosen(options)) is not None:
        made = chosen.mechanism(description.path, allow_unphysical=allowed, fix=fix)
        clearance = {**made.clearance, **clearance}
        gears = {**made.gears, **gears}
        notes += [f"preset {chosen.name}: {one}" for one in chosen.origins]
    mechanism = Mechanism(
        description,
        {**plain.given_joints, **clearance},
        loops=simulation.mechanism.loops if simulation is not None else {},
        gears=gears | _gears(options, gears),
        gravity=plain.gravity,
        tool=tool,
        allow_unphysical=allowed,
        fix=fix,
    )
    return mechanism, simulation, errors, notes


def robot_settings(options: argparse.Namespace) -> list[Setting]:
    """What --allow-unphysical and --fix say, as settings of a scenario."""
    from jointplay.scenario.settings import Setting

    given = {"allow_unphysical": options.allow_unphysical, "fix": options.fix}
    return [
        Setting(("robot", key), list(names), f"--{key.replace('_', '-')}")
        for key, names in given.items()
        if names
    ]


def preset_chosen(options: argparse.Namespace) -> Preset | None:
    """What --preset selects."""
    from jointplay.scenario.presets import preset_for

    return None if options.preset is None else preset_for(str(options.robot), options.preset)


def _clearance(
    options: argparse.Namespace,
    plain: Mechanism,
    tool: str,
    notes: list[str],
    simulation: Simulation | None,
) -> dict[str, Clearance]:
    """Joints with clearance that the options name, or all that move the tool.

    With loops, those are all joints; one that closes a loop keeps its kind and its bearing.
    """
    from jointplay.core.schema import read
    from jointplay.joints import JOINT_KINDS, Clearance, replacing
    from jointplay.joints.bearings import bearing_kind, is_designation
    from jointplay.mechanism.mechanism import frame_index

    entries = plain.description.joints
    able = {"revolute", "continuous", "prismatic", "floating"}
    ends = [plain.model.frames[frame_index(plain.model, tool)]]
    if (body := getattr(options, "relative_to", None)) is not None:
        ends.append(plain.model.frames[frame_index(plain.model, body, "body")])
    ways = [{*plain.model.supports[frame.parentJoint]} for frame in ends]
    between = ways[0].symmetric_difference(*ways[1:]) if ways[1:] else ways[0]
    chain = [plain.model.names[i] for i in sorted(between) if i > 0]
    chain = [name for name in chain if name in entries and entries[name].kind in able]
    if plain.loops:
        chain = [name for name, entry in entries.items() if entry.kind in able] + [*plain.loops]
    own: dict[str, str | None] = {}
    for text in options.joint:
        name, length = name_and_value(text, [*entries, *plain.loops], is_designation)
        if name not in plain.loops and (name not in entries or entries[name].kind not in able):
            choices = [n for n, e in entries.items() if e.kind in able] + [*plain.loops]
            raise MissingName("joint that can have play", name, choices, where=("--joint",))
        if name not in chain:
            seen = "" if body is None else f" as seen from {body!r}"
            notes.append(
                f"note: {name} does not move {tool!r}{seen}, so it adds nothing to the error"
            )
        own[name] = length
    if not own and options.clearance is not None:
        own = dict.fromkeys(chain)
    if None in own.values() and options.clearance is None:
        raise JointplayError('--clearance is missing: the radial clearance, such as "0.1 mm"')
    clearances = {}
    for name, length in own.items():
        radial = options.clearance
        if length is not None and (bearing := bearing_kind(length)) is not None:
            clearances[name] = read(Clearance, {"kind": bearing, "designation": length})
            continue
        if length is not None:
            radial = quantity(length, "m", f"--joint {name}")
        known = simulation.mechanism.clearance.get(name) if simulation is not None else None
        if name in plain.loops and known is not None:
            clearances[name] = known.scaled(radial / known.radial_room)
            continue
        if name in plain.loops:
            kind = plain.loop_class(name)
        else:
            kind = JOINT_KINDS[replacing(entries[name].kind)[0]]
        sizes = given(options, "bearing_radius", "bearing_length")
        clearances[name] = kind.of_room(radial, options.axial, sizes)
    if clearances:
        notes.append(f"play: {_words(clearances)}")
    return clearances


def _words(joints: dict[str, Clearance]) -> str:
    parts: dict[str, list[str]] = {}
    for name, joint in joints.items():
        parts.setdefault(joint.words, []).append(name)
    return "; ".join(f"{', '.join(names)} ({words})" for words, names in parts.items())


def _gears(options: argparse.Namespace, present: dict[str, Any]) -> dict[str, Any]:
    from jointplay.mechanism.gear import Gear

    gears = {}
    for name, whole in numbers_by_name(options.gear, "--gear JOINT=ANGLE", "rad").items():
        # Statics need the play only; a scenario's gear keeps the rest.
        gear = present.get(name, Gear(0.0, 0.1, 1e4))
        if "play" not in (one.name for one in fields(gear)):
            raise JointplayError(
                f"--gear {name}: the play of a gear of kind {gear.kind} follows from its stages"
            )
        gears[name] = replace(gear, play=whole)
    return gears


def _positions(mechanism: Mechanism, text: str) -> dict[str, float]:
    positions = {}
    names = mechanism.description.joints
    longest = sorted(map(re.escape, names), key=len, reverse=True)
    ahead = f"(?=\\s*(?:{'|'.join(longest)})\\s*=)"  # a name may have commas of its own
    for part in re.split(f",{ahead}", text) if text else ():
        name, value = name_and_value(part.strip(), names)
        name = name if name in names else name.strip()
        if value is None:
            raise JointplayError(f"--pose must read JOINT=X,JOINT=X,..., got {part!r}")
        positions[name] = _position(mechanism, name, value, f"--pose {name}")
    return positions


def _position(mechanism: Mechanism, joint: str, text: str, where: str) -> float:
    """Position of a joint [rad or m]; errors begin with `where`."""
    entry = mechanism.description.joints.get(joint)
    return quantity(text, "m" if entry is not None and entry.slides else "rad", where)
