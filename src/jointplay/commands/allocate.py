"""`jointplay allocate`: which clearances keep the tool within its tolerance, at the least cost."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands import (
    Outputs,
    add_option,
    add_repeatable,
    add_shared,
    add_switch,
    given,
    listed,
    numbers_by_name,
)
from jointplay.commands.inputs import MOTION, POSES, add_inputs, chosen_preset, explain, is_scenario
from jointplay.commands.mechanism import (
    LOOSE,
    add_load,
    add_poses,
    add_whole,
    error_class,
    load_on_tool,
    task,
)
from jointplay.core.errors import JointplayError

COSTS = ("reciprocal", "reciprocal-squared", "linear")


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "allocate",
        help="the largest clearances that keep the tool's error below a target",
        description="Find the cheapest clearances of all joints that keep the tool's static "
        "error below a target, at a pose, along a motion or over the workspace, and "
        "the marginal cost of each. The bearings' dimensions come from the options "
        "or the scenario; the ratio of axial to radial clearance is kept. With --whole, which "
        "cause of the whole error to improve at which joint. See docs/decisions.md.",
        epilog='Example: jointplay allocate ur5 --target "0.2 mm" --workspace 200',
        lazy=explain,
    )
    add_inputs(parser, (*POSES, MOTION), needed=True, joints=LOOSE)
    add_poses(parser)
    add_option(parser, "--target LENGTH", "largest error of the tool", required=True)
    add_option(
        parser,
        "--quantile P",
        "share of states that must meet the target, such as 0.99 (default: all)",
    )
    add_whole(parser)
    add_switch(
        parser, "--statistical", "with --whole, the target is of the RMS, not of the worst case"
    )
    add_option(
        parser,
        "--keep LIST",
        "with --whole, causes that count but stay as they are, such as heat,play",
        type=listed,
    )
    add_repeatable(
        parser,
        "--limit CAUSE=X",
        "with --whole, part of a cause that remains at least (default 0.1)",
    )
    add_load(parser)
    add_option(
        parser, "--cost", f"cost of a clearance c: 1/c, 1/c^2 or -c (default {COSTS[0]})",
        choices=COSTS,
    )  # fmt: skip
    add_repeatable(parser, "--weight JOINT=X", "weight of a joint's cost (default 1)")
    add_repeatable(
        parser,
        "--price NAME=X",
        "price of a class of rolling bearings (C2, CN, C3, C4, CC0, C0, C1, preloaded), relative: "
        "joints given as NAME=BEARING are allocated by class; with --whole, of halving a cause",
    )
    add_option(parser, "--least LENGTH", "smallest possible clearance (default 2 um)")
    add_option(parser, "--most LENGTH", "largest possible clearance (default 1 mm)")
    add_option(
        parser,
        "--verify RUNS",
        "simulate the motion with the clearances found, in this many perturbed runs (3 if no "
        "number is given)",
        nargs="?",
        const=3,
    )
    add_option(parser, "--out DIR", "folder for allocation.csv and the figure")
    add_shared(parser, "--jobs", "--quiet")


def run(options: argparse.Namespace) -> int:
    """Allocate, verify, print."""
    out = Outputs(options.out, ["allocation.csv", "allocation.png"])
    from jointplay.design.allocation import allocate
    from jointplay.joints import RollingBearing

    _require_fitting(options)
    if options.whole is not None:
        return _causes(options, out)
    chosen = chosen_preset(options)
    named = is_scenario(options) or (chosen is not None and chosen.bearings)
    if options.clearance is None and not named:
        options.clearance = options.axial_clearance or 1e-4  # sizes are what is sought
    work = task(options)
    if options.verify is not None and work.motion is None:
        raise JointplayError("--verify simulates a motion: give --motion CSV or a scenario")
    if any(isinstance(one, RollingBearing) for one in work.mechanism.clearance.values()):
        return _by_class(options, work, out)
    if options.price:
        raise JointplayError(
            f"--price {options.price[0]} is for classes of rolling bearings, and no joint has one "
            "(--joint NAME=BEARING); clearances have --cost and --weight"
        )
    weights = numbers_by_name(options.weight, "--weight JOINT=X")
    out.claim()
    allotment = allocate(
        work.mechanism,
        work.q,
        options.target,
        quantile=options.quantile,
        weights=weights,
        driven=work.driven,
        progress=not options.quiet,
        **given(options, "cost", "least", "most"),
    )
    notes = [note for note in work.notes if not note.startswith("play:")]
    print("\n".join([*notes, f"at: {work.poses}", str(allotment)]))
    if options.verify is not None:
        from jointplay.study.courses import dynamic_error

        assert work.motion is not None
        error = dynamic_error(
            allotment.mechanism,
            work.motion,
            work.simulation,
            runs=options.verify,
            jobs=options.jobs,
            progress=not options.quiet,
        )
        peak = float(error.peak.max())
        kept = "keeps" if peak <= allotment.target else "exceeds"
        print(f"{error}; {kept} the target ({peak / allotment.target:.2f} of it)")
    if options.out:
        from jointplay.plots.design import allocation

        out.write(
            {"allocation.csv": allotment.table.csv(), "allocation.png": allocation(allotment)}
        )
    return 0


_OF_CLEARANCES = ("quantile", "cost", "least", "most", "verify")
_OF_THE_WHOLE = ("causes", "keep", "limit", "statistical", "force", "payload")


def _require_fitting(options: argparse.Namespace) -> None:
    """Refuse options that would be ignored, with --whole or without.

    Raises:
        JointplayError: one of them was given.
    """
    for name in _OF_THE_WHOLE if options.whole is None else _OF_CLEARANCES:
        if getattr(options, name) not in (None, [], False):
            needs = "needs --whole" if options.whole is None else "does not go with --whole"
            raise JointplayError(f"--{name} {needs}, which allocates causes of the whole error")


def _causes(options: argparse.Namespace, out: Outputs) -> int:
    """Choose which causes of the whole error to improve."""
    from jointplay.design.cause_allocation import allocate_causes
    from jointplay.design.error_budget import CAUSES

    work = task(options)
    kind = error_class(options, work)
    numbers = {
        "prices": numbers_by_name(options.price, "--price CAUSE=X"),
        "weights": numbers_by_name(options.weight, "--weight JOINT=X"),
        "limits": numbers_by_name(options.limit, "--limit CAUSE=X"),
    }
    out.claim()
    found = allocate_causes(
        work.mechanism,
        work.q,
        options.target,
        statistical=options.statistical,
        force=load_on_tool(options, work.mechanism.gravity),
        errors=work.errors,
        kind=kind,
        causes=options.causes or CAUSES,
        keep=options.keep or (),
        progress=not options.quiet,
        **numbers,
    )
    print("\n".join([*work.notes, f"at: {work.poses}", str(found)]))
    if options.out:
        from jointplay.plots.design import cause_allocation

        out.write(
            {"allocation.csv": found.causes_table.csv(), "allocation.png": cause_allocation(found)}
        )
    return 0


def _by_class(options: argparse.Namespace, work: Any, out: Outputs) -> int:
    """Choose classes of rolling bearings."""
    from jointplay.design.class_allocation import allocate_classes

    for name in (*_OF_CLEARANCES, "weight"):
        if getattr(options, name) not in (None, []):
            raise JointplayError(
                f"--{name} is for clearances that can be any; bearings have classes (--price "
                "CLASS=X)"
            )
    prices = numbers_by_name(options.price, "--price CLASS=X")
    out.claim()
    found = allocate_classes(
        work.mechanism, work.q, options.target, prices=prices, driven=work.driven
    )
    print("\n".join([*work.notes, f"at: {work.poses}", str(found)]))
    if not prices:
        print("prices of the classes are assumed; give your own with --price CLASS=X")
    if options.out:
        out.write({"allocation.csv": found.table.csv()})
    return 0
