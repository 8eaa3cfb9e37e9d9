"""`jointplay study iso9283`: accuracy and repeatability by ISO 9283, from perturbed cycles.

Simulate the cycle of a scenario or robot many times, with journals and teeth of gears displaced at
random at the start, and print pose accuracy AP and repeatability RP at each stop, and path accuracy
AT and repeatability RT, with confidence intervals. All input options of jointplay run are accepted
too. docs/iso9283.md explains the figures.

Example: jointplay study iso9283 ur5 --joint "elbow_joint=0.05 mm" --duration 2.2 --out ur5
"""

import argparse
from dataclasses import replace
from typing import Any

from jointplay.base import streams
from jointplay.base.errors import JointplayError, require_positive
from jointplay.base.pairs import vector
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.commands.inputs import simulation_of
from jointplay.cli.options import LENGTH, REPEATED, Parser

FILES = ("iso9283.csv", "poses.png", "path.png")
"""Files in --out; those at a part of the speed have its per cent before the dot."""


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument_group("cycles").add_argument
    add("--cycles", metavar="N", type=int, default=30, help="cycles for poses")
    add("--path-cycles", metavar="N", type=int, help="cycles for the path (default: 10, at most "
        "--cycles)")
    add("--speed", metavar="PERCENT", type=float, **REPEATED, help="percentage of the motion's "
        "speed, which is taken as the rated speed; the standard asks for 100, 50 and 10 (default: "
        "100)")
    add("--cube", **LENGTH, help="visit the five poses in a cube with this edge length instead")
    add("--cube-centre", metavar="X,Y,Z", help="centre of the cube, world axes [m]")
    add("--out", metavar="DIR", help="folder for the table, the figures and, during the run, "
        "finished cycles: with the same folder, an interrupted command continues")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    parts = {percent: "" if percent == 100.0 else f"_{percent:g}" for percent in options.speed}
    names = {
        percent: [name.replace(".", f"{part}.") for name in FILES]
        for percent, part in (parts or {100.0: ""}).items()
    }
    out = Outputs(options.out, [name for several in names.values() for name in several])
    from jointplay.study.courses import check_numbers
    from jointplay.study.iso9283 import Cycles, check, iso9283

    counts = Cycles.up_to(options.cycles)
    if options.path_cycles is not None:
        counts = replace(counts, path=options.path_cycles)
    check_numbers(counts.runs, options.jobs)
    for percent in names:
        require_positive("--speed", percent, "%")
    posed, assumed = simulation_of(options)
    simulation, poses = _in_cube(options, posed)
    for percent in names:
        check(simulation, percent / 100.0)
    folder = out.claim()
    streams.release()
    for percent, (table, drawn, along) in names.items():
        performance = iso9283(
            simulation,
            counts,
            speed=percent / 100.0,
            poses=poses,
            jobs=options.jobs,
            keep=None if folder is None else folder / "cycles",
            progress=not options.quiet,
        )
        answer = performance.sentence + assumed
        if options.detail:
            print_answer(answer, performance, (), options)
        else:
            conditions = f"conditions: {performance.conditions}"
            notes = [*performance.causes, conditions, performance.validity]
            print_answer(answer, performance.brief, notes, options, more=True)
        if options.out:
            from jointplay.show.plots import design as plots

            contents: dict[str, Any] = {table: performance.table.csv()}
            if performance.poses:
                contents[drawn] = plots.poses(performance)
            if performance.path:
                contents[along] = plots.path(performance)
            out.write(contents, f"; runs in {options.out}/cycles")
    return 0


def _in_cube(options: argparse.Namespace, simulation: Any) -> tuple[Any, str]:
    """The simulation, by --cube with the test's motion, and what its poses are, in words."""
    if (options.cube is None) != (options.cube_centre is None):
        raise JointplayError("--cube LENGTH and --cube-centre X,Y,Z go together")
    if options.cube is None:
        return simulation, "poses: the stops of the motion"
    for option in ("motion", "interpolation", "duration"):
        if getattr(options, option) is not None:
            raise JointplayError(f"--cube has a motion of its own: leave out --{option}")
    from jointplay.study.iso9283 import in_cube

    return in_cube(simulation, vector(options.cube_centre, "m", "--cube-centre"), options.cube)
