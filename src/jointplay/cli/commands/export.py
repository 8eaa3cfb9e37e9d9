"""`jointplay export`: a result for other programs."""

from __future__ import annotations

import argparse
from typing import Any

from jointplay import bridges
from jointplay.base.imports import how_to_install
from jointplay.cli.commands import add_option, add_shared


def add(commands: Any) -> None:
    """Add the command's parser."""
    parser = commands.add_parser(
        "export",
        help="write a result as table, joint trajectory, ROS 2 bag or rerun recording",
        description="Write a result for other programs. File kinds: "
        + "; ".join(
            f"{name} ({', '.join(kind.suffixes)}): {kind.about}"
            for name, kind in bridges.KINDS.items()
        )
        + ".",
        epilog="docs/exports.md describes the files. parquet, mcap, YAML and rerun need the "
        "extras tables, ros and rerun, .fmu the extra fmu: "
        f"{how_to_install('ros')}.",
    )
    parser.add_argument("result", metavar="RESULT", help="result file (.nc)")
    add_option(
        parser, "--to", "kind of file (default: by the extension of --out)", choices=bridges.KINDS
    )
    add_option(parser, "--out FILE", "file to write", required=True)
    add_option(
        parser,
        "--every N",
        "only every N-th record and the last; peaks include the records between",
        1,
    )
    add_option(
        parser,
        "--inputs",
        "of an .fmu: torques of the motors beside those of the drives, or references in place of "
        "motion and drives (default: none)",
        choices=("none", "torque", "reference"),
    )
    add_option(parser, "--period TIME", "of an .fmu: sampling period of its inputs (default 1 ms)")
    add_shared(parser, "--quiet", "--trust")


def run(options: argparse.Namespace) -> int:
    """Read, write, say what was written."""
    bridges.check(options.out, options.to)
    from jointplay.simulation.result.result import Result

    result = Result.load(options.result, options.trust)
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
