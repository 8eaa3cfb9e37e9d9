"""`jointplay export result`: a result as table, trajectory, ROS 2 bag, FMU or rerun recording.

Write a result for other programs: histories as a table, joint positions as a trajectory, a ROS 2
bag and layouts of its charts for PlotJuggler and Foxglove, the simulation as an FMI 3 unit, a
recording for rerun.io.

docs/exports.md describes the files. parquet, mcap, YAML and rerun need the extras tables, ros and
rerun, .fmu the extra fmu: pip install '.[ros]' in the clone of jointplay.

    RESULT  result file (.nc)
    --to KIND  table (.csv), parquet, trajectory (.yaml, .yml, .csv), mcap, plotjuggler (.xml),
        foxglove (.json), fmu or rerun (.rrd) (default: by the extension of --out)
    --out FILE  file to write (required)
    --every N  only every N-th record and the last; peaks include the records between (default 1)
    --inputs {none,torque,reference}  of an .fmu: torques of the motors beside those of the drives,
        or references in place of motion and drives (default: none)
    --period TIME  of an .fmu: sampling period of its inputs (default: 1 ms)
    --quiet
    --import
"""

import argparse

from jointplay import bridges


def run(options: argparse.Namespace) -> int:
    bridges.check(options.out, options.to)
    from jointplay.simulation.result.result import Result

    result = Result.load(options.result)
    path = bridges.export(
        result,
        options.out,
        options.to,
        every=options.every,
        progress=not options.quiet,
        inputs=options.inputs,
        period=options.period,
    )
    print(f"{path}: {path.stat().st_size / 1e6:.3g} MB")
    return 0
