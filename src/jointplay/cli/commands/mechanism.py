"""What the commands about static play have in common: which poses of which mechanism."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_non_negative
from jointplay.cli.commands import inputs, name_and_value, quantity, vector

if TYPE_CHECKING:
    import numpy as np

    from jointplay.accuracy.robot_errors import RobotErrors
    from jointplay.model.mechanism import Mechanism
    from jointplay.physics.joints import Clearance
    from jointplay.scenario import Scenario
    from jointplay.simulation.motion.reference import Motion
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


def load_on_tool(
    options: argparse.Namespace, gravity: Sequence[float]
) -> tuple[float, float, float]:
    """Force on the tool in world axes [N]: what --force and --payload say."""
    force = (0.0, 0.0, 0.0)
    if options.force is not None:
        force = vector(options.force, "N", "--force")
    require_non_negative("--payload", options.payload or 0.0, "kg")
    x, y, z = (f + (options.payload or 0.0) * g for f, g in zip(force, gravity, strict=True))
    return x, y, z


def error_class(options: argparse.Namespace, work: Task) -> str:
    """The class that --whole names, or else the scenario, or the preset.

    Raises:
        JointplayError: none of them does.
    """
    from jointplay.accuracy.robot_errors import CLASSES

    said = [options.whole, work.errors and work.errors.assumed]
    if (chosen := inputs.chosen_preset(options)) is not None:
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

    from jointplay.accuracy import poses

    of_file = inputs.is_scenario(options)
    chosen = [
        one
        for one in ("pose", "poses", "motion", "workspace")
        if getattr(options, one, None) not in (None, [])
    ]
    if len(chosen) > 1:
        raise JointplayError(f"give one of --{' and --'.join(chosen)}")
    notes = _all_loose(options)
    scenario = inputs.scenario_of(options, still=True)
    simulation = scenario.simulation(options.case) if of_file else None
    mechanism = scenario.mechanism(options.case)
    _require_sizes(options, scenario, mechanism)
    motion = None if simulation is None else simulation.motion
    if options.motion is not None and motion is None:
        from jointplay.simulation.motion.reference import Motion

        motion = Motion.from_csv(options.motion)
    errors = scenario.robot_errors(options.case) if of_file else None
    notes += [*_notes(options, mechanism), *scenario.notes]
    notes += [line for line in scenario.assumptions if line.startswith("preset ")]
    mechanism = _bolted(mechanism)
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
    from jointplay.accuracy import poses

    chain = mechanism.model.supports[mechanism.model.frames[mechanism.tool_frame].parentJoint]
    moving = set(driven or (mechanism.model.names[i] for i in chain))
    pose = {**poses.middle(mechanism), **positions}
    return "pose " + ", ".join(f"{name} {x:.4g}" for name, x in pose.items() if name in moving)


def _loops(mechanism: Mechanism, driven: tuple[str, ...]) -> str:
    """Which joints of the loops stand and which follow, a line."""
    from jointplay.accuracy import poses
    from jointplay.model.closed_loops import ClosedLoops

    passive = ClosedLoops(mechanism, mechanism.configuration({}), driven).passive
    follow = [name for name in poses.moving(mechanism) if mechanism.coordinate(name) in passive]
    return f"loops: driven {', '.join(driven) or 'none'}; following {', '.join(follow) or 'none'}"


def _all_loose(options: argparse.Namespace) -> list[str]:
    """Have --clearance be for all joints that move the tool, where nothing says for which.

    Returns:
        Which tool was chosen for them, if it was, a line.
    """
    if options.joint or not inputs.for_joints(options):
        return []
    bare = {flag.attribute: None for flag in inputs.FLAGS if flag.keys[0][0] != "robot"}
    plain = argparse.Namespace(**{**vars(options), **bare, "clearance": None, "gear": []})
    mechanism = inputs.scenario_of(plain, still=True).mechanism(options.case)
    if mechanism.clearance and options.clearance is None:
        return []
    mechanism = mechanism.ideal()
    options.joint = [json.dumps(name) for name in _chain(options, mechanism)]
    if options.tool is not None or not mechanism.tool_reason:
        return []
    options.tool = mechanism.tool
    return [_chosen(mechanism)]


def _chosen(mechanism: Mechanism) -> str:
    return f"tool: {mechanism.tool!r} (chosen: {mechanism.tool_reason}; see --tool)"


def _chain(options: argparse.Namespace, mechanism: Mechanism) -> list[str]:
    """Joints that can have clearance and move the tool, as seen from --relative-to.

    With loops, those are all joints.
    """
    from jointplay.model.mechanism import frame_index
    from jointplay.physics.joints import replacing

    model, entries = mechanism.model, mechanism.description.joints
    able = {name for name, entry in entries.items() if replacing(entry.kind)}
    if mechanism.loops:
        return [*(name for name in entries if name in able), *mechanism.loops]
    ends = [model.frames[mechanism.tool_frame]]
    if (body := getattr(options, "relative_to", None)) is not None:
        ends.append(model.frames[frame_index(model, body, "body")])
    ways = [{*model.supports[frame.parentJoint]} for frame in ends]
    between = ways[0].symmetric_difference(*ways[1:]) if ways[1:] else ways[0]
    return [model.names[i] for i in sorted(between) if i > 0 and model.names[i] in able]


def _require_sizes(options: argparse.Namespace, scenario: Scenario, mechanism: Mechanism) -> None:
    """Refuse joints of --joint of which nobody says how large their clearance is.

    Raises:
        JointplayError: there is one.
    """
    given = scenario.given(options.case or scenario.cases[0]).get("joints", {})
    for name in inputs.named_joints(options):
        sizes = mechanism.clearance[name].clearance_fields if name in mechanism.clearance else {}
        if sizes and not {*sizes, *sizes.values(), "designation"}.intersection(given.get(name, ())):
            raise JointplayError(
                f'--clearance is missing: the radial clearance of {name!r}, such as "0.1 mm"'
            )


def _notes(options: argparse.Namespace, mechanism: Mechanism) -> list[str]:
    """What a reader should know of the robot, a line each."""
    notes = [mechanism.held] if mechanism.held else []
    if mechanism.free_base is not None:
        notes.append(
            f"the base {mechanism.description.root!r} is free in the scenario; here it is held, as "
            "if bolted to the ground"
        )
    if mechanism.tool_reason:
        notes.append(_chosen(mechanism))
    chain = _chain(options, mechanism.ideal())
    body = getattr(options, "relative_to", None)
    seen = "" if body is None else f" as seen from {body!r}"
    for name in inputs.named_joints(options):
        if name not in chain:
            notes.append(
                f"note: {name} does not move {mechanism.tool!r}{seen}, so it adds nothing to the "
                "error"
            )
    if (options.joint or inputs.for_joints(options)) and mechanism.clearance:
        notes.append(f"play: {_words(mechanism.clearance)}")
    return notes


def _bolted(mechanism: Mechanism) -> Mechanism:
    """The mechanism with its base held."""
    from jointplay.model.mechanism import Mechanism

    if mechanism.free_base is None:
        return mechanism
    return Mechanism(
        mechanism.description,
        mechanism.given_joints,
        loops=mechanism.loops,
        gears=mechanism.gears,
        gravity=mechanism.gravity,
        tool=mechanism.tool,
        allow_unphysical=mechanism.allow_unphysical,
        fix=mechanism.fix,
    )


def _words(joints: Mapping[str, Clearance]) -> str:
    parts: dict[str, list[str]] = {}
    for name, joint in joints.items():
        parts.setdefault(joint.words, []).append(name)
    return "; ".join(f"{', '.join(names)} ({words})" for words, names in parts.items())


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
