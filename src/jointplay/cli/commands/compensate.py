"""`jointplay compensate`: a motion corrected so that play does not displace the tool.

Find on which side each joint rests along the motion, and shift the commands so that the tool is
where the ideal robot's would be; then run both motions, also where the model may be wrong. What
makes the error larger is not written. No promise about hardware. See docs/compensate.md.

Example: jointplay compensate so101 --preset --motion pick.csv --trust "play 30 %" --out corrected
"""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import streams
from jointplay.base.errors import JointplayError, MissingName, require_whole
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.commands.inputs import chosen_preset, simulation_of
from jointplay.cli.options import FLAG, LENGTH, Parser, listed

if TYPE_CHECKING:
    from jointplay.accuracy.compensation import Compensation
    from jointplay.study.corners import Judgement


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument
    add("--trust", metavar="TEXT", help='how far the model may be off, such as "play 30 %, '
        'friction 50 %, payload 20 %, stiffness 30 %", or "identified, payload 20 %" with the '
        "intervals of --preset FILE (default: those, if it has any, or exact): both motions are "
        "run at the corners of that")
    add("--approach", **FLAG, help="reach stops at which friction leaves open on which side teeth "
        "lie from one side: the tool arrives aside, and the joint creeps while it stands")
    add("--tool-size", **LENGTH, help="of the tool or what it holds: by that its turn is weighed "
        "against its position (default: position first, the turn as far as that leaves joints "
        "free)")
    add("--passes", metavar="N", type=int, default=0, help="correct by what own runs leave, at "
        "most so often, as long as it improves")
    add("--out", metavar="DIR", help="folder for motion.csv, original.csv (run --beside compares "
        "with it), compensation.csv, corners.csv and error.png")
    add("--formats", type=listed, metavar="LIST", help="further files in DIR: yaml, mcap (ROS 2 "
        "JointTrajectory), table (joint, direction, load), linuxcnc, marlin, klipper, grblhal")
    add("--write-anyway", **FLAG, help="write a motion that makes the error larger, too")
    parser.share("--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    names = ["motion.csv", "original.csv", "compensation.csv", "corners.csv", "error.png"]
    out = Outputs(options.out, names)
    from jointplay.accuracy.compensation import compensate
    from jointplay.bridges import backlash
    from jointplay.study.corners import EXACT, IDENTIFIED, judge, learn, trust_of

    wanted, known = options.formats or [], ("yaml", "mcap", "table", *backlash.FORMATS)
    for one in wanted:
        if one not in known:
            raise MissingName("format", one, known)
    if wanted and not options.out:
        raise JointplayError("--formats are written into a folder: give --out DIR, too")
    preset = chosen_preset(options)
    measured = preset is not None and bool(preset.intervals)
    trust = trust_of(options.trust or (IDENTIFIED if measured else EXACT), preset)
    require_whole("--passes", options.passes, 0)
    simulation = simulation_of(options)
    out.claim()
    streams.release()
    progress = not options.quiet
    found = compensate(
        simulation, approach=options.approach, size=options.tool_size, progress=progress
    )
    more = []
    if options.passes:
        found, tried = learn(found, options.passes)
        told = ", ".join(f"{1e3 * one:.4g}" for one in tried)
        more.append(f"RMS error by pass: {told} mm; {found.learned} kept")
    extra = _further(found, wanted)
    judged = judge(found, trust, jobs=options.jobs, progress=progress)
    body = f"{found.table()}\n{judged.table()}" if options.detail else judged.table()
    notes = [*more, *judged.notes, *found.notes, *extra.pop("", ())]
    print_answer(judged.sentence, body, notes, options, more=True)
    if judged.worse and not options.write_anyway:
        where = judged.worse[0].label
        words = f"nothing written: it makes the error larger ({where}); see --write-anyway"
        raise JointplayError(words)
    if options.out:
        _write(out, judged, extra)
        motions = (str(Path(options.out) / name) for name in names[:2])
        asked = zip(("--motion", "--beside"), motions, strict=True)
        robot = [] if options.place is None else [str(options.place)]
        line = shlex.join(["jointplay", "run", *robot, *(word for pair in asked for word in pair)])
        print(f"next, with the joints and drives as here: {line} --out DIR")
        if "motion.yaml" in extra:
            print(f"next, in ROS 2: {_published(Path(options.out) / 'motion.yaml')}")
        else:
            print("next, for ROS 2: --formats yaml writes a JointTrajectory, mcap a bag")
    return 0


def _published(file: Path) -> str:
    """The command by which a controller is given a trajectory."""
    topic = "/joint_trajectory_controller/joint_trajectory"
    what = f'"$(cat {shlex.quote(str(file))})"'
    return f"ros2 topic pub --once {topic} trajectory_msgs/msg/JointTrajectory {what}"


def _further(found: Compensation, wanted: Sequence[str]) -> dict[str, Any]:
    """Contents of further files by name, and under no name what their formats lose."""
    from jointplay.accuracy.compensation import table_for_controllers
    from jointplay.bridges import backlash, bag
    from jointplay.bridges.trajectory import content, of_motion

    contents: dict[str, Any] = {}
    lost = []
    for one in wanted:
        if one == "yaml":
            contents["motion.yaml"] = content(of_motion(found.motion), ".yaml")
        elif one == "mcap":
            contents["motion.mcap"] = bag.of_trajectory(of_motion(found.motion))
        elif one == "table":
            contents["table.csv"] = table_for_controllers(found).csv()
        else:
            try:
                contents |= backlash.tables(backlash.corrected(found), one)
                lost.append(f"note: {one} cannot say {backlash.FORMATS[one].lost}")
            except JointplayError as error:
                lost.append(f"warning: no file for {one}: {error}")
    return contents | {"": lost}


def _write(out: Outputs, judged: Judgement, extra: Mapping[str, Any]) -> None:
    from jointplay.show.plots.design import before_and_after

    found = judged.compensation
    meant = found.simulation.motion
    assert meant is not None
    out.write({
        "motion.csv": found.motion.csv(),
        "original.csv": meant.csv(),
        "compensation.csv": found.data().csv(),
        "corners.csv": judged.table().csv(),
        "error.png": before_and_after(judged),
        **extra,
    })  # fmt: skip
