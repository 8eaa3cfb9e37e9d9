"""`jointplay study hunting`: why does my arm shake? At which gains and poses is it calm?

Look at one joint at a time, all others held: its motor, gear with play, inertia and weight at the
pose, friction, and its servo. Joints that controllers of your own ([loads]) set move together. They
are released beside their goal, several times, with play and without; printed are the swing that
lasts, if any, what the describing function of the play predicts, and up to which gain all is quiet.
Gears and servos come from a scenario, --preset, or --gear and --set; see docs/drives.md.

Example: jointplay study hunting so101 --preset --of elbow_flex
--set 'drives.elbow_flex.encoder="link"'
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import streams
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import misread, name_and_number, pair
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.commands.inputs import (
    ALL,
    for_joints,
    is_scenario,
    own_preset,
    positions,
    require_one_pose,
    scenario_of,
)
from jointplay.cli.options import REPEATED, TIME, Parser

if TYPE_CHECKING:
    from jointplay.scenario import Scenario

RUNS = "hunting.runs"
"""What is kept of runs, in the folder of --out."""


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser, "robot", "joints with clearance", "gears", "drive")
    add = parser.add_argument_group("hunting").add_argument
    add("--of", metavar="JOINT", **REPEATED, help="joint to look at (default: all that have play "
        "and a servo or controller)")
    add("--pose", **REPEATED, metavar="JOINT=X,...", help="positions at which joints are held "
        "(default: where the motion begins)")
    add("--poses", metavar="N", type=int, help="put each joint to N places over its limits, "
        "and say where it is calm, and up to which P gain")
    add("--time", **TIME, help="longest motion, if it is not clear before whether swings last "
        "(default: a day; under controllers of your own 300 s, 60 s to look for a gain, 12 s for a "
        "map)")
    add("--gain", metavar="GAIN", help="gain that is varied: p_gain, i_gain, d_gain, or a "
        "parameter of your controller, by the name in its class or p0, p1, ... (default: p_gain of "
        "servos, none of controllers)")
    add("--map", metavar="GAIN=FROM:TO:COUNT", **REPEATED, help="two of them, such as "
        "p_gain=10:400:20 d_gain=0:5:20: a map of the swings over both, of one joint; evenly by "
        "factors unless from 0")
    add("--out", metavar="DIR", help="folder for hunting.csv (of a map gains.csv, gains.png) and, "
        "during the run, for what is done: the same command goes on after an interruption")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["gains.csv", "gains.png"] if options.map else ["hunting.csv"])
    if options.poses is not None and (options.map or options.gain):
        raise JointplayError("--poses is of the P gain: leave out --map and --gain")
    spans = [_span(text) for text in options.map or ()]
    if spans and len(spans) != 2:
        raise JointplayError(f"a map is over two gains: give --map twice, got {len(spans)}")
    from jointplay.scenario.presets import preset
    from jointplay.simulation.loads import Servo
    from jointplay.study import hunting
    from jointplay.study.released import servo_of

    if options.preset is None and not (options.set or is_scenario(options)):
        names = [name_and_number(text)[0] for text in options.gear]
        joint = names[0] if names and names[0] != ALL else "JOINT"
        add = servo_of(joint)
        add = add if names else f"--gear {joint}=PLAY and {add}"
        robot = scenario_of(options, moves=False).mechanism().description
        own = own_preset(options)
        servos = preset(own).drives(robot).values() if own else ()
        if any(isinstance(one, Servo) for one in servos):
            add = f"--preset, which has the servos of {options.place}"
        raise JointplayError(
            f"hunting is of gears with play under servos, none is given: add {add}"
        )
    scenario = released(options)
    simulation, told = scenario.simulation(options.case), scenario.assumptions
    words = ("note: ", " is p_gain") if options.registers else ("note: ",)
    registers = [line for line in told if any(word in line for word in words)]
    require_one_pose(options)
    held = positions(simulation.mechanism, "".join(options.pose))
    how = {
        "longest": options.time,
        "jobs": options.jobs,
        "keep": Path(options.out) / RUNS if options.out else None,
        "progress": not options.quiet,
    }
    joints = options.of or ()
    if spans:
        these = hunting.released(simulation, joints, held)
        names = [axis.joint for one in these for axis in one.axes]
        if len(names) > 1:
            raise JointplayError(f"a map is of one joint: give --of, one of {', '.join(names)}")
        out.claim()
        streams.release()
        found = hunting.gain_map(these[0], *spans, **how)
        print(found.sentence)
        if options.out:
            from jointplay.show.plots.design import gains

            out.write({"gains.csv": found.table.csv(), "gains.png": gains(found)})
        return 0
    out.claim()
    streams.release()
    if options.poses is not None:
        from jointplay.study import calm

        answers = calm.calm(simulation, joints, held, places=options.poses, **how)
        table = calm.table(answers)
        notes = [*(one.advice for one in answers), *registers]
        print_answer("; ".join(one.sentence for one in answers), table, notes, options)
        if options.out:
            out.write({"hunting.csv": table.csv()})
        return 0
    all_found = hunting.hunting(simulation, joints, held, gain=options.gain, **how)
    table = hunting.table(all_found, options.gain)
    print_answer(
        hunting.sentence(all_found), table, [*hunting.notes(all_found), *registers], options
    )
    if options.out:
        out.write({"hunting.csv": table.csv()})
    return 0


def released(options: argparse.Namespace) -> Scenario:
    """The machine of whose joints some are released; journals, which are held, are refused."""
    if options.joint or (journals := for_joints(options)):
        option = "--joint" if options.joint else journals[0].name
        raise JointplayError(f"{option} is of journals, which are held here: hunting is of gears")
    return scenario_of(options)


def _span(text: str) -> tuple[str, Any]:
    """A gain and its values."""
    import numpy as np

    words = "--map GAIN=FROM:TO:COUNT, such as p_gain=10:400:20"
    gain, rest = pair(text, words)
    try:
        first, last, number = rest.split(":")
        low, high, count = float(first), float(last), int(number)
    except ValueError:
        raise misread(text, words) from None
    if not (0.0 <= low < high < float("inf") and 2 <= count <= 1000):
        raise misread(text, words)
    even = np.geomspace if low > 0.0 else np.linspace
    return gain, even(low, high, count)
