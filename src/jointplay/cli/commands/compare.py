"""`jointplay compare`: two results side by side: inputs that differ, figures, tool paths.

Compare two results: which inputs differ, by how much the headline figures do and whether that is
more than their numerical errors, how often the joints strike, and how far apart the two tools are.

Example: jointplay compare old/result.nc new/result.nc --out difference
"""

import argparse
from pathlib import Path

from jointplay.cli.commands import Outputs
from jointplay.cli.options import FLAG, Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("a", metavar="A", help="result file (.nc), or a folder with one")
    add("b", metavar="B", help="result file (.nc), or a folder with one")
    add("--out", metavar="DIR", help="folder for comparison.txt and the figures that compare both")
    add("--pdf", **FLAG, help="draw each figure as .pdf, too")
    parser.share("--quiet", "--import")
# fmt: on


def run(options: argparse.Namespace) -> int:
    out = Outputs(options.out, ["comparison.txt"])
    from jointplay.base.errors import JointplayError
    from jointplay.show import plots, reports
    from jointplay.simulation.analysis import compare

    paths = [Path(options.a), Path(options.b)]
    labels = [path.stem if path.is_file() else path.name for path in paths]
    if labels[0] == labels[1]:
        labels = [str(path) for path in paths]
    found = {}
    for label, path in zip(labels, paths, strict=True):
        read = reports.load([path], [])
        if len(read) > 1:
            names = ", ".join(f"{name}.nc" for name in read)
            raise JointplayError(f"{str(path)!r} has {len(read)} results; name one: {names}")
        (found[label],) = read.values()
    if len(found) < 2:
        raise JointplayError(f"{str(paths[0])!r} twice: give two results")
    folder = out.claim()
    comparison = compare(found, not options.quiet)
    print(comparison)
    if folder is not None:
        out.write({"comparison.txt": f"{comparison}\n"})
        plots.save(found, folder, options.pdf)
    return 0
