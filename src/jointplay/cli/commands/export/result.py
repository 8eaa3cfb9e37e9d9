"""`jointplay export result`: a result as table, trajectory or ROS 2 bag.

Write a result for other programs: histories as a table, joint positions as a trajectory, or a
ROS 2 bag.

docs/exports.md describes the files. parquet, mcap and YAML need the extras tables and ros:
pip install '.[ros]' in the clone of jointplay.
"""

import argparse

from jointplay import bridges
from jointplay.cli.options import Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("result", metavar="RESULT", help="result file (.nc), or a folder with one")
    add("--to", metavar="KIND", help="table (.csv), parquet, mat (MATLAB), trajectory (.yaml, "
        ".yml, .csv) or mcap (default: by the extension of --out)")
    add("--out", metavar="FILE", required=True, help="file to write")
    add("--every", metavar="N", type=int, default=1, help="only every N-th record and the last; "
        "peaks include the records between")
    parser.share("--quiet", "--import")
# fmt: on


def run(options: argparse.Namespace) -> int:
    bridges.check(options.out, options.to)
    from jointplay.show.plots.names import load_one

    result = load_one(options.result)
    path = bridges.export(
        result, options.out, options.to, every=options.every, progress=not options.quiet
    )
    print(f"{path}: {path.stat().st_size / 1e6:.3g} MB")
    return 0
