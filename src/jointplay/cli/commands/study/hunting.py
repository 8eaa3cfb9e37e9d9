"""`jointplay study hunting`: why does my arm shake? At which gains and poses is it calm?

Look at one joint at a time, all others held: its motor, gear with play, inertia and weight at the
pose, friction, and its servo. Joints that controllers of your own ([loads]) set move together. They
are released beside their goal, several times, with play and without. The answer tells the swing
that lasts, if any, what the describing function of the play predicts, and up to which gain all is
quiet.
Gears and servos come from a scenario, --preset, or --gear and --set; see docs/drives.md.

Example: jointplay study hunting so101 --preset --of elbow_flex
--set 'drives.elbow_flex.encoder="link"'
"""

import argparse
from pathlib import Path

from jointplay.base import streams
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import ALL, name_and_number
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.commands.inputs import is_scenario, of_journals, own_preset, pose_of, scenario_of
from jointplay.cli.options import REPEATED, TIME, Parser

RUNS = "hunting.runs"
"""File of finished runs in the folder of --out, from which an interrupted command continues."""


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
    add("--map", metavar="GAIN=FROM:TO:COUNT", **REPEATED, help="given twice, for two gains, such "
        "as p_gain=10:400:20 d_gain=0:5:20: a map of one joint's swings over both, in steps of "
        "equal factors unless from 0")
    add("--out", metavar="DIR", help="folder for hunting.csv (of a map gains.csv, gains.png) and, "
        "during the run, for what is done: the same command goes on after an interruption")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def refuse_journals(options: argparse.Namespace) -> None:
    for option in (["--joint"] if options.joint else []) + of_journals(options):
        raise JointplayError(f"{option} is of journals, which are held here: hunting is of gears")


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["gains.csv", "gains.png"] if options.map else ["hunting.csv"])
    if options.poses is not None and (options.map or options.gain):
        raise JointplayError("--poses is of the P gain: leave out --map and --gain")
    from jointplay.study import hunting

    spans = [hunting.read_span(text) for text in options.map or ()]
    if spans and len(spans) != 2:
        raise JointplayError(f"a map is over two gains: give --map twice, got {len(spans)}")
    from jointplay.accuracy.poses import read_pose
    from jointplay.scenario.presets import preset
    from jointplay.study.released import refuse_without_servo

    if options.preset is None and not (options.set or is_scenario(options)):
        names = [name for name, _ in map(name_and_number, options.gear) if name != ALL]
        robot = scenario_of(options, moves=False).mechanism().description
        known = own_preset(options)
        drives = preset(known).drives(robot).values() if known else ()
        refuse_without_servo(
            next(iter(names), "JOINT" if options.gear else None), drives, options.place
        )
    refuse_journals(options)
    scenario = scenario_of(options)
    simulation = scenario.simulation(options.case)
    marks = ("note: ", " is p_gain") if options.registers else ("note: ",)  # gains from registers
    assumed = [line for line in scenario.assumptions if any(mark in line for mark in marks)]
    held = read_pose(simulation.mechanism, pose_of(options))
    arguments = {"longest": options.time, "jobs": options.jobs, "progress": not options.quiet}
    arguments["keep"] = Path(options.out) / RUNS if options.out else None
    if spans:
        machines = hunting.released(simulation, options.of, held)
        names = [axis.joint for machine in machines for axis in machine.axes]
        if len(names) > 1:
            raise JointplayError(f"a map is of one joint: give --of, one of {', '.join(names)}")
    out.claim()
    streams.release()
    if spans:
        gain_map = hunting.gain_map(machines[0], *spans, **arguments)
        print(gain_map.sentence)
        if options.out:
            from jointplay.show.plots.design import gains

            out.write({"gains.csv": gain_map.table.csv(), "gains.png": gains(gain_map)})
        return 0
    if options.poses is not None:
        from jointplay.study import calm

        answers = calm.calm(simulation, options.of, held, positions=options.poses, **arguments)
        table, notes = calm.table(answers), [answer.advice for answer in answers]
        sentence = "; ".join(answer.sentence for answer in answers)
    else:
        hunts = hunting.hunting(simulation, options.of, held, gain=options.gain, **arguments)
        table, notes = hunting.table(hunts, options.gain), hunting.notes(hunts)
        sentence = hunting.sentence(hunts)
    print_answer(sentence, table, [*notes, *assumed], options)
    out.write({"hunting.csv": table.csv()})
    return 0
