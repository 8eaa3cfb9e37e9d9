"""`jointplay allocate`: which clearances keep the tool within its tolerance, at the least cost."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay.commands import add_jobs, add_quiet, name_and_value
from jointplay.commands.mechanism import add_poses, add_robot, quantity, task
from jointplay.core.errors import JointplayError

FILES = ("allocation.csv", "allocation.png")

COSTS = ("reciprocal", "reciprocal-squared", "linear")


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "allocate",
        help="the loosest clearances that keep the tool's error below a target",
        description="The cheapest clearances of all joints with which the tool's static error "
        "stays below a target, at a pose, along a motion or over the workspace; and what the last "
        "micrometre of each costs. Sizes of the bearings are those of the options or the scenario; "
        "the ratio of axial to radial clearance is kept. See docs/decisions.md.",
        epilog='Example: jointplay allocate ur5 --target "0.2 mm" --workspace 200',
    )
    add_robot(parser)
    add_poses(parser)
    parser.add_argument(
        "--target", required=True, metavar="LENGTH", help='largest error of the tool, "0.05 mm"'
    )
    parser.add_argument(
        "--quantile", type=float, metavar="P", help="part of states, such as 0.99 (default: all)"
    )
    parser.add_argument(
        "--cost", choices=COSTS, default=COSTS[0], help="of a clearance c: 1/c (default), 1/c^2, -c"
    )
    parser.add_argument(
        "--weight",
        action="append",
        default=[],
        metavar="JOINT=X",
        help="weight of a joint's cost (repeatable; default 1)",
    )
    parser.add_argument("--least", metavar="LENGTH", help="clearance that can be had (2 um)")
    parser.add_argument("--most", metavar="LENGTH", help="largest clearance (1 mm)")
    parser.add_argument(
        "--verify",
        type=int,
        nargs="?",
        const=3,
        metavar="RUNS",
        help="simulate the motion with these clearances, so many perturbed runs (3)",
    )
    parser.add_argument("--out", metavar="DIR", help="folder for allocation.csv and the figure")
    add_jobs(parser)
    add_quiet(parser)


def run(options: argparse.Namespace) -> int:
    """Allocate, verify, print."""
    from jointplay.core import files

    if options.out:  # before anything is loaded that takes time
        files.refuse_present(options.out, FILES)
    from jointplay.design import allocation as module

    if options.clearance is None and not str(options.robot).endswith(".toml"):
        options.clearance = options.axial or "0.1 mm"  # sizes are what is sought
    work = task(options)
    if options.verify is not None and work.motion is None:
        raise JointplayError("--verify simulates a motion: give --motion CSV or a scenario")
    limits: dict[str, Any] = {
        name: quantity(getattr(options, name), "m", f"--{name}")
        for name in ("least", "most")
        if getattr(options, name) is not None
    }
    weights = {}
    for text in options.weight:
        name, value = name_and_value(text)
        if value is None:
            raise JointplayError(f"--weight must read JOINT=X, got {text!r}")
        weights[name] = quantity(value, "", f"--weight {name}")
    out = files.claim(options.out, FILES) if options.out else None
    allotment = module.allocate(
        work.mechanism,
        work.q,
        quantity(options.target, "m", "--target"),
        quantile=options.quantile,
        cost=options.cost,
        weights=weights,
        driven=work.driven,
        progress=not options.quiet,
        **limits,
    )
    for note in work.notes:
        if not note.startswith("play:"):
            print(note)
    print(f"at: {work.poses}")
    print(allotment)
    if options.verify is not None:
        from jointplay.design.verify import dynamic_error

        assert work.motion is not None
        seen = dynamic_error(
            allotment.mechanism,
            work.motion,
            work.simulation,
            runs=options.verify,
            jobs=options.jobs,
            progress=not options.quiet,
        )
        peak = float(seen.peak.max())
        kept = "keeps" if peak <= allotment.target else "exceeds"
        print(f"{seen}; {kept} the target ({peak / allotment.target:.2f} of it)")
    if out is not None:
        from jointplay.plots.design import allocation

        files.write(out / "allocation.csv", _csv(allotment))
        files.picture(out / "allocation.png", allocation(allotment))
        print(f"written to {options.out}: allocation.csv, allocation.png")
    return 0


def _csv(allotment: Any) -> str:
    rows = ["joint,clearance_m,error_per_clearance,saved_by_a_micrometre,held_by"]
    for name, *numbers, bound in zip(
        allotment.joints,
        allotment.clearance,
        allotment.gain,
        allotment.price,
        allotment.bound,
        strict=True,
    ):
        rows.append(",".join([name, *(f"{x:.9g}" for x in numbers), bound or "target"]))
    return "\n".join(rows) + "\n"
