"""`jointplay budget`: how far off play lets the tool be, and by which joint.

Static error budget of the tool from the play of all joints: worst case in every direction, the
position at rest under gravity and how far friction may change it, RMS for a load in a random
direction, and each joint's share. At a pose, along a motion, or over the workspace.
docs/budget.md explains the numbers.

Example: jointplay budget panda --clearance "0.05 mm" --workspace 500 --out panda
"""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.options import FLAG, Parser

if TYPE_CHECKING:
    import numpy as np

    from jointplay.model.mechanism import Mechanism


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", "gears", "contacts", "drive", "motion",
        "poses", "load", "whole error", required=True)
    add = parser.add_argument
    add("--rest-everywhere", **FLAG, help="for budget.csv, find the position at rest at every "
        "pose, not only the worst one (0.1 s per pose with one joint, 0.4 s with six)")
    add("--out", metavar="DIR", help="folder for budget.csv (errors.csv) and the figures")
    add = parser.add_argument_group("robot").add_argument
    add("--relative-to", metavar="BODY", help="link or frame from which the error is seen, in its "
        "axes, such as the palm of a hand or the trunk of what walks: what moves both does not "
        "count (default: the world)")
    parser.share("--json", "--detail")
# fmt: on


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["budget.csv" if options.whole is None else "errors.csv"])
    from jointplay.accuracy.error_budget import budget

    if options.causes is not None and options.whole is None:
        words = f"--causes {','.join(options.causes)} selects causes of the whole error"
        raise JointplayError(f"{words}: give --whole CLASS, too")
    posed = inputs.posed_machine(options, inertia=False)
    mechanism, poses = posed.mechanism, posed.poses
    if options.ideal and options.whole is None and not (mechanism.clearance or mechanism.gears):
        raise JointplayError("--ideal leaves nothing that has play; --whole has other causes")
    inputs.refuse_idle(posed.scenario, inputs.IN_MOTION, "acts on motion, and nothing moves here")
    inputs.refuse_idle_friction(options, posed)
    body = options.relative_to
    about: dict[str, Any] = {
        "force": inputs.force_on_tool(options), "relative_to": body, **poses.holding
    }  # fmt: skip
    seen = [] if body is None else [f"seen from {body!r}, in its axes"]
    at = [f"at: {poses.label}", *seen, *posed.notes]
    if options.whole is not None:
        out.names.append("errors.png")
        out.claim()
        about |= inputs.whole_errors(options, posed.scenario)
        whole = budget(mechanism, poses.q, **about)
        table, of_class = whole.table(), f"what nobody gave is that of class {about['kind']!r}"
        notes = [*[of_class] * bool(whole.assumed), *at, *table.notes]
        shown = [str(replace(table, notes=())), *_at_ends(options, mechanism, poses.q, about)]
        text = "\n".join(shown)
        print_answer(
            whole.sentence, text, notes, options,
            data=lambda: {"causes": whole.data(), "values": posed.values},
        )  # fmt: skip
        if options.out:
            from jointplay.show.plots.design import cause_bars

            out.write({"errors.csv": whole.data().csv(), "errors.png": cause_bars(whole)})
        return 0
    # Figures of the robot are in the world.
    out.names += ["bars.png", *([] if body else ["robot.png", "reach.png"])]
    of_kind = {"motion": ["course.png"], "workspace": [] if body else ["map.png"]}
    out.names += of_kind.get(poses.kind, [])
    out.claim()
    errors = budget(mechanism, poses.q, **about)
    shown = [str(errors.by_pose(poses.names))] if poses.names else []
    if len(errors.worst) > 1:
        k = errors.worst_pose
        name = poses.names[k] if poses.names else k
        place = ", ".join(f"{x:.3f}" for x in errors.positions[k])
        shown.append(
            f"worst-case error of {errors.tool!r} [m{errors.unit}]: least "
            f"{1e3 * errors.worst.min():.4f}, mean {1e3 * errors.worst.mean():.4f}, "
            f"largest {1e3 * errors.worst.max():.4f} (pose {name}, tool at {place} "
            "m), which is made up like this:"
        )
    table = errors.table()
    shown += [str(replace(table, notes=())), errors.ranking]
    shown += filter(None, [errors.from_side_to_side])
    shown += _at_ends(options, mechanism, poses.q, about)
    shown += [f"cure: {one}" for one in errors.cures]
    notes = [*at, *table.notes, errors.validity]
    sentence = f"{errors.sentence}{posed.undecided(any(about['force']))}"

    def found() -> dict[str, Any]:
        return {"poses": errors.data(poses.names), "joints": table, "values": posed.values}

    print_answer(sentence, "\n".join(shown), notes, options, data=found)
    if not options.out:
        return 0
    from jointplay.show.plots import design as plots

    if options.rest_everywhere:
        errors.rest_interval  # noqa: B018  which finds the places of rest, too
    contents = {"budget.csv": errors.data(poses.names).csv(), "bars.png": plots.bars(errors)}
    if not body:
        contents["robot.png"] = plots.robot(mechanism, errors, poses.q)
        if errors.unit == "m":  # an angle has no places
            contents["reach.png"] = plots.reachable(errors)
    if poses.times is not None:
        contents["course.png"] = plots.course(errors, poses.times)
    if poses.kind == "workspace" and not body:
        contents["map.png"] = plots.workspace_map(errors)
    out.write(contents)
    return 0


def _at_ends(
    options: argparse.Namespace, mechanism: Mechanism, q: np.ndarray, about: Mapping[str, Any]
) -> list[str]:
    """The worst case with plays that were measured at both ends of their intervals, in words."""
    own = inputs.chosen_preset(options)
    if own is None or not own.intervals:
        return []
    from jointplay.accuracy.error_budget import budget
    from jointplay.estimate.machine import at_ends

    ends = [budget(one, q, **about) for one in at_ends(mechanism, own.intervals)]
    low, high = (f"{1e3 * float(errors.worst.max()):.4g}" for errors in ends)
    unit = ends[0].unit
    return [
        f"with measured plays at the ends of their 95 % intervals: worst case {low} to {high} "
        f"m{unit}"
    ]
