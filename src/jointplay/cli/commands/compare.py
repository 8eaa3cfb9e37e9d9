"""`jointplay compare`: a result beside another one, or beside what was measured.

Compare two results: which inputs differ, by how much the headline figures do and whether that is
more than their numerical errors, how often the joints strike, and how far apart the two tools are.
Or compare a result with a measurement, a CSV with columns such as 'time [s]', 'slider acceleration
[m/s^2]', 'B force [N]': RMS and largest differences, the run's own error, the curves laid over each
other, and with --ensemble the band of runs with perturbed starts.

Examples: jointplay compare old/result.nc new/result.nc --out difference; jointplay compare
crank/crank.nc measured.csv --shift found --ensemble 20 --out beside
"""

import argparse
from pathlib import Path

from jointplay.base.errors import JointplayError
from jointplay.base.pairs import quantity
from jointplay.cli.commands import Outputs
from jointplay.cli.options import Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("a", metavar="A", help="result file (.nc), or a folder with one")
    add("b", metavar="B", help="another one, or a measurement (.csv)")
    add("--out", metavar="DIR", help="folder for comparison.txt and the figures that compare both")
    parser.share("--pdf")
    add("--shift", metavar="TIME", help="shift of the measured times; found takes the one that "
        "fits best (default: 0)")
    add("--ensemble", metavar="N", type=int, default=0, help="draw the band of N runs with "
        "perturbed starts, too")
    parser.share("--jobs", "--quiet", "--import")
# fmt: on


def run(options: argparse.Namespace) -> int:
    measured = options.b.lower().endswith(".csv")
    if not measured and (options.shift is not None or options.ensemble):
        raise JointplayError("--shift and --ensemble are for a measurement (.csv)")
    names = ["comparison.txt", *(["beside.png", "beside.csv"] if measured else [])]
    out = Outputs(options.out, names + ["beside.pdf"] * (measured and options.pdf))
    return _beside(options, out) if measured else _results(options, out)


def _results(options: argparse.Namespace, out: Outputs) -> int:
    from jointplay.show import plots
    from jointplay.show.plots.names import load_one
    from jointplay.simulation.analysis import compare

    paths = [Path(options.a), Path(options.b)]
    labels = [path.stem if path.is_file() else path.name for path in paths]
    if labels[0] == labels[1]:
        labels = [str(path) for path in paths]
    results = {label: load_one(path) for label, path in zip(labels, paths, strict=True)}
    if len(results) < 2:
        raise JointplayError(f"{str(paths[0])!r} twice: give two results")
    folder = out.claim()
    comparison = compare(results, not options.quiet)
    print(comparison)
    if folder is not None:
        out.write({"comparison.txt": f"{comparison}\n"})
        plots.save(results, folder, options.pdf)
    return 0


def _beside(options: argparse.Namespace, out: Outputs) -> int:
    from jointplay.estimate.experiment import beside_experiment
    from jointplay.show.plots.names import load_one

    result = load_one(options.a)
    shift = options.shift or "0 s"
    late = None if shift == "found" else quantity(shift, "s", "--shift")
    arguments = {"runs": options.ensemble, "jobs": options.jobs, "progress": not options.quiet}
    comparison = beside_experiment(result, options.b, shift=late, **arguments)
    print(comparison)
    if out.claim() is not None:
        from jointplay.show.plots.draw import draw
        from jointplay.show.plots.experiment import overlay

        figure = draw(overlay(comparison))
        contents = {"comparison.txt": f"{comparison}\n", "beside.csv": comparison.csv}
        out.write(contents | {name: figure for name in out.names if name.startswith("beside.p")})
    return 0
