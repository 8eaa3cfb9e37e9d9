"""What the commands about static play have in common: which poses of which mechanism."""

from __future__ import annotations

import argparse
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_non_negative
from jointplay.cli.commands import inputs, name_and_value, quantity, vector

if TYPE_CHECKING:
    import numpy as np

    from jointplay.accuracy.robot_errors import RobotErrors
    from jointplay.model.mechanism import Mechanism
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

    preset = inputs.chosen_preset(options)
    said = (options.whole, work.errors and work.errors.assumed, preset and preset.errors)
    for one in filter(None, said):
        return str(one)
    raise JointplayError(
        f"--whole needs a class of robots, from which is taken what is not given: "
        f'{", ".join(CLASSES)}; or [errors] of the scenario, such as assumed = "{CLASSES[1]}"'
    )


def task(options: argparse.Namespace) -> Task:
    """Build what the options say.

    Raises:
        JointplayError: what cannot be, in one line.
    """
    import numpy as np

    from jointplay.accuracy import poses
    from jointplay.simulation.motion.reference import Motion

    ways = {name: getattr(options, name, None) for name in ("pose", "poses", "motion", "workspace")}
    chosen = {name: value for name, value in ways.items() if value not in (None, [])}
    if len(chosen) > 1:
        raise JointplayError(f"give one of --{' and --'.join(chosen)}")
    notes = _all_loose(options)
    scenario = inputs.scenario_of(options, still=True)
    of_file = inputs.is_scenario(options)
    simulation = scenario.simulation(options.case) if of_file else None
    errors = scenario.robot_errors(options.case) if of_file else None
    mechanism = scenario.mechanism(options.case)
    _require_sizes(options, scenario, mechanism)
    motion = None if simulation is None else simulation.motion
    if "motion" in chosen and motion is None:
        motion = Motion.from_csv(chosen["motion"])
    notes += [*_notes(options, mechanism), *scenario.notes]
    notes += [line for line in scenario.assumptions if line.startswith("preset ")]
    mechanism = _bolted(mechanism)
    driven, near = None, {}
    if mechanism.loops:
        near = {} if simulation is None else poses.start_of(simulation)
        driven = poses.standing(mechanism, motion, near)
        notes.append(_loops(mechanism, driven))
    names: tuple[str, ...] = ()
    if "workspace" in chosen:
        q = poses.over_workspace(mechanism, chosen["workspace"], driven=driven, near=near)
        kind, words = "workspace", f"{len(q)} poses over the workspace"
        if out := chosen["workspace"] - len(q):
            words += f" ({out} others were left out because the loops do not close there)"
    elif motion is not None and not {"pose", "poses"} & set(chosen):
        q, kind = poses.along_motion(mechanism, motion, near=near), "motion"
        words = f"{len(q)} poses along the motion"
    else:
        asked = _given_poses(mechanism, chosen)
        rows = []
        for name, one in asked.items():
            with _of_pose(name if len(asked) > 1 or "poses" in chosen else ""):
                rows.append(poses.at_pose(mechanism, one, driven, near))
        q, kind = np.concatenate(rows), "pose"
        if len(asked) > 1:
            names, words = tuple(asked), f"{len(asked)} poses"
        else:
            chain = mechanism.model.supports[_tool_joint(mechanism)]
            moving = driven or [mechanism.model.names[i] for i in chain]
            at = {**poses.middle(mechanism), **next(iter(asked.values()))}
            words = "pose " + ", ".join(f"{n} {x:.4g}" for n, x in at.items() if n in moving)
            if not chosen:
                words += " (chosen: zero, or the middle of the limits; see --pose, --motion)"
    return Task(mechanism, q, words, kind, names, motion, simulation, driven, tuple(notes), errors)


@contextmanager
def _of_pose(name: str) -> Iterator[None]:
    """Say of errors in the block at which pose they are, if it has a name."""
    try:
        yield
    except JointplayError as error:
        raise JointplayError(f"pose {name}: {error}" if name else str(error)) from None


def _given_poses(mechanism: Mechanism, chosen: Mapping[str, Any]) -> dict[str, dict[str, float]]:
    """Joint positions of the poses that are given one by one, by name; at least one."""
    file = chosen.get("poses")
    if file is None:
        return {text: _positions(mechanism, text) for text in chosen.get("pose", [""])}
    (_, header), *rows = files.csv_rows(Path(file), "poses")
    header = [cell.strip() for cell in header]
    named = header[0] == "name"
    found: dict[str, dict[str, float]] = {}
    for number, row in rows:
        line, cells = f"{file}, line {number}", [cell.strip() for cell in row]
        name = cells[0] if named else str(len(found) + 1)
        if name in found:
            raise JointplayError(f"{line}: there are two poses {name!r}")
        pairs = [*zip(header, cells, strict=True)][named:]
        found[name] = {
            joint: _position(mechanism, joint, cell, f"{line}, {joint}") for joint, cell in pairs
        }
    if not found:
        raise JointplayError(f"{file} has no poses: give a line of joint positions for each")
    return found


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


def _loops(mechanism: Mechanism, driven: tuple[str, ...]) -> str:
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


def _tool_joint(mechanism: Mechanism) -> int:
    return int(mechanism.model.frames[mechanism.tool_frame].parentJoint)


def _chain(options: argparse.Namespace, mechanism: Mechanism) -> list[str]:
    """Joints that can have clearance and move the tool, as seen from --relative-to.

    With loops, those are all joints.
    """
    from jointplay.model.mechanism import frame_index
    from jointplay.physics.joints import replacing

    model, entries = mechanism.model, mechanism.description.joints
    able = [name for name, entry in entries.items() if replacing(entry.kind)]
    if mechanism.loops:
        return [*able, *mechanism.loops]
    between = {*model.supports[_tool_joint(mechanism)]}
    if (body := getattr(options, "relative_to", None)) is not None:
        other = model.frames[frame_index(model, body, "body")].parentJoint
        between ^= {*model.supports[other]}
    return [model.names[i] for i in sorted(between) if i > 0 and model.names[i] in able]


def _require_sizes(options: argparse.Namespace, scenario: Scenario, mechanism: Mechanism) -> None:
    """Refuse joints of --joint of which nobody says how large their clearance is."""
    given = scenario.given(options.case or scenario.cases[0]).get("joints", {})
    for name in inputs.named_joints(options):
        sizes = mechanism.clearance[name].clearance_fields if name in mechanism.clearance else {}
        if sizes and not {*sizes, *sizes.values(), "designation"}.intersection(given.get(name, ())):
            words = f'--clearance is missing: the radial clearance of {name!r}, such as "0.1 mm"'
            raise JointplayError(words)


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
            tool = f"{mechanism.tool!r}{seen}"
            notes.append(f"note: {name} does not move {tool}, so it adds nothing to the error")
    if (options.joint or inputs.for_joints(options)) and mechanism.clearance:
        parts: dict[str, list[str]] = {}
        for name, joint in mechanism.clearance.items():
            parts.setdefault(joint.words, []).append(name)
        play = [f"{', '.join(names)} ({words})" for words, names in parts.items()]
        notes.append(f"play: {'; '.join(play)}")
    return notes


def _bolted(mechanism: Mechanism) -> Mechanism:
    from jointplay.model.mechanism import Mechanism

    if mechanism.free_base is None:
        return mechanism
    same = ("loops", "gears", "gravity", "tool", "allow_unphysical", "fix")
    return Mechanism(
        mechanism.description,
        mechanism.given_joints,
        **{name: getattr(mechanism, name) for name in same},
    )
