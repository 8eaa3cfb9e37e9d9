"""`jointplay compensate`: a motion corrected so that play does not displace the tool.

Find on which side each joint rests along the motion, and shift the commands so that the tool is
where the ideal robot's would be; then run both motions, also where the model may be wrong. A motion
that makes the error larger is not written. Hardware may differ. See docs/compensate.md.

Example: jointplay compensate so101 --preset --motion pick.csv --trust "play 30 %" --out corrected
"""

from __future__ import annotations

import argparse
import shlex
from pathlib import Path

from jointplay.base import streams
from jointplay.base.errors import JointplayError, require_whole
from jointplay.cli.commands import Outputs, inputs, print_answer
from jointplay.cli.commands.inputs import chosen_preset, simulation_of
from jointplay.cli.options import FLAG, LENGTH, Parser, listed


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument
    add("--trust", metavar="TEXT", help='how far the model may be off, such as "play 30 %, '
        'friction 50 %, payload 20 %, stiffness 30 %", or "identified, payload 20 %" with the '
        "intervals of --preset FILE (default: those, if it has any, or exact): both motions are "
        "run at the corners of that")
    add("--approach", **FLAG, help="reach stops from one side where friction leaves open on which "
        "side teeth rest: the tool arrives aside, and the joint creeps while it stands")
    add("--tool-size", **LENGTH, help="size of the tool or its load: weighs the tool's rotation "
        "against its position (default: position first, rotation as far as that leaves joints "
        "free)")
    add("--passes", metavar="N", type=int, default=0, help="correct further by the error that "
        "remains in simulated runs, at most N times, as long as it improves")
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
    from jointplay.accuracy.compensation import compensable, compensate
    from jointplay.bridges import backlash
    from jointplay.study.corners import EXACT, IDENTIFIED, judge, learn, trust_of

    formats = options.formats or []
    backlash.refuse_unwritten(formats, [*backlash.FILES, *backlash.FORMATS], options.out)
    preset = chosen_preset(options)
    measured = preset is not None and bool(preset.intervals)
    trust = trust_of(options.trust or (IDENTIFIED if measured else EXACT), preset)
    require_whole("--passes", options.passes, 0)
    simulation, assumed = simulation_of(options, compensable)
    out.claim()
    streams.release()
    progress = not options.quiet
    compensation = compensate(
        simulation, approach=options.approach, size=options.tool_size, progress=progress
    )
    notes = []
    if options.passes:
        compensation, errors = learn(compensation, options.passes)
        passes = ", ".join(f"{1e3 * error:.4g}" for error in errors)
        notes.append(f"RMS error by pass: {passes} mm; {compensation.learned} kept")
    further, lost = backlash.corrected_files(compensation, formats)
    judged = judge(compensation, trust, jobs=options.jobs, progress=progress)
    body = f"{compensation.table()}\n{judged.table()}" if options.detail else judged.table()
    notes += [*judged.notes, *compensation.notes, *lost]
    print_answer(judged.sentence + assumed, body, notes, options, more=True)
    if judged.worse and not options.write_anyway:
        where = judged.worse[0].label
        message = f"nothing written: it makes the error larger ({where}); see --write-anyway"
        raise JointplayError(message)
    if not options.out:
        return 0
    from jointplay.show.plots.design import before_and_after

    assert simulation.motion is not None
    tables = (compensation.motion, simulation.motion, compensation.data(), judged.table())
    contents = [*(table.csv() for table in tables), before_and_after(judged)]
    out.write(dict(zip(names, contents, strict=True)) | further)
    motion, original = (str(Path(options.out) / name) for name in names[:2])
    robot = [] if options.place is None else [str(options.place)]
    line = ["jointplay", "run", *robot, "--motion", motion, "--beside", original]
    print(f"next, with the joints and drives as here: {shlex.join(line)} --out DIR")
    if "motion.yaml" in further:
        topic = "/joint_trajectory_controller/joint_trajectory"
        text = f'"$(cat {shlex.quote(str(Path(options.out) / "motion.yaml"))})"'
        line = ["ros2 topic pub --once", topic, "trajectory_msgs/msg/JointTrajectory", text]
        print(f"next, in ROS 2: {' '.join(line)}")
    else:
        print("next, for ROS 2: --formats yaml writes a JointTrajectory, mcap a bag")
    return 0
