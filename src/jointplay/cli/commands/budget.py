"""`jointplay budget`: how far off play lets the tool be, and by which joint.

Static error budget of the tool from the play of all joints: worst case in every direction, the
position at rest under gravity and how far friction may change it, RMS for a load in a random
direction, and each joint's share. At a pose, along a motion, or over the workspace.
docs/budget.md explains the numbers.

Example: jointplay budget panda --clearance "0.05 mm" --workspace 500 --out panda
"""

import argparse
from dataclasses import replace
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.options import FLAG, Parser


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
    whole, body = options.whole is not None, options.relative_to
    out = Outputs(options.out, ["errors.csv" if whole else "budget.csv"])
    from jointplay.accuracy.error_budget import budget
    from jointplay.scenario.posed import IN_MOTION

    if options.causes is not None and not whole:
        message = f"--causes {','.join(options.causes)} selects causes of the whole error"
        raise JointplayError(f"{message}: give --whole CLASS, too")
    posed = inputs.posed_machine(options, inertia=False)
    mechanism, poses = posed.mechanism, posed.poses
    if options.ideal and not (whole or mechanism.clearance or mechanism.gears):
        raise JointplayError("--ideal leaves nothing that has play; --whole has other causes")
    posed.refuse_idle(IN_MOTION, "acts on motion, and nothing moves here")
    posed.refuse_idle_friction(whole)
    arguments: dict[str, Any] = {
        "force": inputs.force_on_tool(options), "relative_to": body, **poses.holding
    }  # fmt: skip
    seen = [] if body is None else [f"seen from {body!r}, in its axes"]
    notes = [f"at: {poses.label}", *seen, *posed.notes]
    if whole:
        out.names.append("errors.png")
        arguments |= inputs.whole_errors(options, posed.scenario)
    else:  # figures of the robot are in the world
        out.names += ["bars.png", *([] if body else ["robot.png", "reach.png"])]
        of_kind = {"motion": ["course.png"], "workspace": [] if body else ["map.png"]}
        out.names += of_kind.get(poses.kind, [])
    out.claim()
    errors: Any = budget(mechanism, poses.q, **arguments)
    table, preset = errors.table(), inputs.chosen_preset(options)
    shown, sentence = [str(replace(table, notes=()))], errors.sentence
    if whole:
        of_class = f"values that are not given are those of class {arguments['kind']!r}"
        notes = [*[of_class] * bool(errors.assumed), *notes, *table.notes]
    else:
        above = [str(errors.by_pose(poses.names))] if poses.names else []
        above += [errors.worst_of(poses.names)] * (len(errors.worst) > 1)
        shown = [*above, *shown, errors.ranking, *filter(None, [errors.from_side_to_side])]
        notes += [*table.notes, errors.validity]
        sentence += posed.undecided(any(arguments["force"]))
    if preset is not None and preset.intervals:
        from jointplay.estimate.machine import worst_at_ends  # takes long to import

        shown += worst_at_ends(mechanism, preset.intervals, poses.q, **arguments)
    shown += [] if whole else [f"cure: {cure}" for cure in errors.cures]

    def data() -> dict[str, Any]:
        if whole:
            return {"causes": errors.data(), "values": posed.values}
        return {"poses": errors.data(poses.names), "joints": table, "values": posed.values}

    print_answer(sentence, "\n".join(shown), notes, options, data=data)
    if not options.out:
        return 0
    from jointplay.show.plots import design as plots

    if whole:
        out.write({"errors.csv": errors.data().csv(), "errors.png": plots.cause_bars(errors)})
        return 0
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
