"""`jointplay allocate`: the largest clearances and plays that keep the error below a target.

Find the cheapest clearances and plays of gears that keep the tool's static error below a target,
at a pose, along a motion or over the workspace, and the marginal cost of each; sizes that are given
only name what to allocate. With --whole, find which cause of the whole error to improve at which
joint. See docs/allocate.md.

Example: jointplay allocate ur5 --clearance "0.1 mm" --target "0.2 mm" --workspace 200
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError
from jointplay.base.pairs import length_or_angle, numbers_by_name
from jointplay.cli.commands import Outputs, given, inputs, print_answer, typed
from jointplay.cli.options import FLAG, LENGTH, REPEATED, Parser, listed

if TYPE_CHECKING:
    from jointplay.scenario.posed import PosedMachine


_OF_CLEARANCES = ("quantile", "cost", "least", "most", "verify")  # options without --whole
_OF_THE_WHOLE = ("causes", "by_class", "keep", "limit", "statistical")  # options with it


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", "gears", "contacts", "drive", "motion",
        "poses", "load", "whole error", required=True)
    add = parser.add_argument
    add("--target", metavar="SIZE", required=True, help='largest error of the tool, such as "0.2 '
        'mm", or angle by which it may be turned, such as "0.1 deg"')
    add("--quantile", metavar="P", type=float, help="share of states that must meet the target, "
        "such as 0.99 (default: all)")
    add("--verify", nargs="?", metavar="RUNS", type=int, const=3, help="simulate the motion with "
        "the clearances found, in this many perturbed runs (3 if no number is given)")
    add("--out", metavar="DIR", help="folder for allocation.csv and the figure")
    add = parser.add_argument_group("costs").add_argument
    add("--cost", choices=("reciprocal", "reciprocal-squared", "linear"), help="cost of a "
        "clearance c: 1/c, 1/c^2 or -c (default: reciprocal)")
    add("--weight", metavar="JOINT=X", **REPEATED, help="weight of a joint's cost (default: 1)")
    add("--price", metavar="NAME=X", **REPEATED, help="price of a class of rolling bearings (C2, "
        "CN, C3, C4, CC0, C0, C1, preloaded) or of a grade of a fit (IT6), relative: joints given "
        "as NAME=BEARING or NAME=FIT are allocated by class and by fit; with --whole, of halving a "
        "cause")
    add = parser.add_argument_group("compensation").add_argument
    add("--compensation", metavar="X", type=float, help="price of a motion corrected for play "
        "(jointplay compensate): put beside, with what it leaves of the error at rest")
    add("--trust", metavar="TEXT", help='how far play and friction may be off then, such as "play '
        '30 %, friction 50 %" (default: play 30 %)')
    add = parser.add_argument_group("bounds").add_argument
    add("--least", **LENGTH, help="smallest possible clearance (default: 2 um; of gears that turn "
        "0.1 arcmin)")
    add("--most", **LENGTH, help="largest possible clearance (default: 1 mm; of gears that turn 6 "
        "deg)")
    add = parser.add_argument_group("whole error").add_argument
    add("--statistical", **FLAG, help="with --whole, the target is of the RMS, not of the worst "
        "case")
    add("--by-class", type=listed, metavar="LIST", help="with --whole, joints whose rolling "
        "bearings or fits are chosen, too, among all of their size")
    add("--keep", type=listed, metavar="LIST", help="with --whole, causes that count but stay as "
        "they are, such as heat,play")
    add("--limit", metavar="CAUSE=X", **REPEATED, help="with --whole, part of a cause that remains "
        "at least (default: 0.1)")
    parser.share("--json", "--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["allocation.csv", "allocation.png"])
    from jointplay.accuracy.allocation import COMPENSATION, allocate, is_bought
    from jointplay.study.corners import correction

    whole = options.whole is not None
    needs = "does not go with" if whole else "needs"
    for name in typed(options, _OF_CLEARANCES if whole else _OF_THE_WHOLE):
        raise JointplayError(f"{name} {needs} --whole, which allocates causes of the whole error")
    target, turn = length_or_angle(options.target, "--target")
    if options.ideal and not whole:
        raise JointplayError("--ideal leaves nothing of which the size could be sought")
    posed = inputs.posed_machine(options, inertia=False)
    _refuse_idle(options, posed)
    if not (whole or posed.mechanism.clearance or posed.mechanism.gears):
        raise JointplayError(
            "say what is to be allocated: --clearance LENGTH for journals in all joints that move "
            "the tool, --joint NAME for one, or --gear JOINT=PLAY; their sizes are what is sought"
        )
    if options.verify is not None and turn:
        raise JointplayError("--verify looks at the tool's way: give a length as --target")
    if options.verify is not None and posed.motion is None:
        raise JointplayError("--verify simulates a motion: give --motion CSV or a scenario")
    joints = [joint for joint in posed.mechanism.clearance.values() if joint.clearances]
    bought = [joint for joint in joints if is_bought(joint)]
    if bought and len(bought) == len(joints) and not whole:
        fitted = any(joint.fitted for joint in bought)
        sizes = [name for name in _OF_CLEARANCES if name != "least" or not fitted]
        for name in typed(options, [*sizes, "weight"]):
            message = "bearings have classes only (--price CLASS=X), fits grades (--price IT6=X)"
            raise JointplayError(f"{name}: {message}")
    more: dict[str, Any] = {"offers": {}}
    if whole:
        more = {
            "statistical": options.statistical,
            "keep": options.keep or (),
            "offers": dict.fromkeys(options.by_class or (), ()),
            **inputs.whole_errors(options, posed.scenario),
        }
    if options.compensation is not None:
        more["offers"][COMPENSATION] = [correction(options.compensation, options.trust or "")]
    elif options.trust is not None:
        raise JointplayError("--trust is of a corrected motion: give its price, --compensation")
    more |= {
        "prices": numbers_by_name(options.price, f"--price {'CAUSE' if whole else 'CLASS'}=X"),
        "weights": numbers_by_name(options.weight, "--weight JOINT=X"),
        "limits": numbers_by_name(options.limit, "--limit CAUSE=X"),
    }
    out.claim()
    allotment = allocate(
        posed.mechanism,
        posed.poses.q,
        target,
        turn=turn,
        progress=not options.quiet,
        force=inputs.force_on_tool(options),
        **posed.poses.holding,
        **more,
        **given(options, "quantile", "cost", "least", "most"),
    )
    counts = whole or bought or more["offers"]
    notes = [note for note in posed.notes if counts or not note.startswith(("play:", "gears:"))]
    table = allotment.table()
    above = 1 + bool(allotment.corrections)
    shown, further = table.notes[:above], list(table.notes[above:])
    if any(choice.offer for choice in allotment.choices) and not options.price:
        prices = "--price CLASS=X (IT6=X, of a fit's grades)"
        further.insert(0, f"prices of the classes are assumed; give your own with {prices}")
    notes = [f"at: {posed.poses.label}", *notes, *further]

    def data() -> dict[str, Any]:
        error = {f"error_{allotment.unit}": allotment.error}
        return {"choices": allotment.data(), **error, "values": posed.values}

    answer = allotment.sentence + posed.bearings_not_given
    print_answer(answer, replace(table, notes=shown), notes, options, data=data)
    if options.verify is not None:
        from jointplay.study.courses import dynamic_error

        assert posed.motion is not None
        error = dynamic_error(
            allotment.mechanism,
            posed.motion,
            posed.scenario.simulation(posed.case),
            runs=options.verify,
            jobs=options.jobs,
            progress=not options.quiet,
        )
        peak = float(error.peak.max())
        verdict = "keeps" if peak <= allotment.target else "exceeds"
        print(f"{error}; {verdict} the target ({peak / allotment.target:.2f} of it)")
    if options.out:
        from jointplay.show.plots import design as plots

        figure = plots.allocation(allotment, posed.bearings_not_given)
        out.write({"allocation.csv": allotment.data().csv(), "allocation.png": figure})
    return 0


def _refuse_idle(options: argparse.Namespace, posed: PosedMachine) -> None:
    """Refuse options that do not affect how far play lets the tool go."""
    from jointplay.scenario.posed import AT_REST, IN_MOTION

    why = (
        "acts on where the machine rests, and play lets the tool go as far wherever that is; "
        "--compensation and --whole count it"
    )
    alone = options.whole is None and options.compensation is None
    if alone and options.force is not None:
        raise JointplayError(f"--force {why}")
    if options.verify is not None:  # the simulation takes all options
        return
    posed.refuse_idle(IN_MOTION, "acts on motion; --verify simulates it")
    if alone:
        posed.refuse_idle(AT_REST, why)
    posed.refuse_idle_friction(options.whole is not None)
