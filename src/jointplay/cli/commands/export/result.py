"""`jointplay export result`: a result as table, trajectory or ROS 2 bag.

Write a result for other programs: histories as a table, joint positions as a trajectory, or a
ROS 2 bag.

docs/exports.md describes the files. parquet, mcap and YAML need the extras tables and ros:
pip install '.[ros]' in the clone of jointplay.

    RESULT  result file (.nc)
    --to KIND  table (.csv), parquet, trajectory (.yaml, .yml, .csv) or mcap (default: by the
        extension of --out)
    --out FILE  file to write (required)
    --every N  only every N-th record and the last; peaks include the records between (default 1)
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
    )
    print(f"{path}: {path.stat().st_size / 1e6:.3g} MB")
    return 0
