"""`jointplay report`: one page on results or a sweep, with charts, to send.

Write a report on one or several results: parameters, assumptions, audit, zoomable Figures 9-15,
contact modes, impacts, spectra, accuracy of the tool. The page needs no network. For a sweep: a
table, lines with confidence bands, heat maps, distributions, failed cases. Runs are repeated to
show their largest impacts step by step.

The tool's error is its deviation from an ideal run with the same inputs, which is simulated if it
is not among the results.
"""

import argparse
import sys
from functools import partial
from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError
from jointplay.cli.commands import typed
from jointplay.cli.options import FLAG, REPEATED, Parser


# fmt: off
def declare(parser: Parser) -> None:
    add = parser.add_argument
    add("result", metavar="RESULT", nargs="+", help="result file (.nc), a folder of them such as "
        "jointplay scara writes, or the folder of a sweep")
    add("-o", "--out", metavar="FILE", help="the page (default: report.html beside the first "
        "result); the PDF, one A4 page, has the same name")
    add("--title", metavar="TEXT", help="title of the page (default: that of the scenario)")
    add("--label", metavar="TEXT", **REPEATED, help="label of a result, in the order of the "
        "results (default: its case, or the file name)")
    add("--impacts", metavar="N", type=int, help="impacts of each run to show step by step; with "
        "0, no run is repeated (default: 5)")
    add("--no-pdf", **FLAG, help="write the page only")
    parser.share("--quiet", "--import")
# fmt: on


def run(options: argparse.Namespace) -> int:
    from jointplay.base.files import check_new
    from jointplay.study.database import FILE

    paths = [Path(name) for name in options.result]
    shared: dict[str, Any] = {"title": options.title, "pdf": not options.no_pdf}
    shared["say"] = (lambda _: None) if options.quiet else partial(print, file=sys.stderr)
    if any((path / FILE).is_file() for path in paths):
        written = _sweep(paths, options, shared)
    else:
        home = paths[0] if paths[0].is_dir() else paths[0].parent
        for path in paths:  # before anything is loaded that takes time
            if not path.exists():
                raise JointplayError(f"no result file {str(path)!r}")
        out = Path(options.out) if options.out else home / "report.html"
        for target in [out] if options.no_pdf else [out, out.with_suffix(".pdf")]:
            check_new(target)
        from jointplay.show import reports

        results = reports.load(paths, options.label)
        impacts = reports.IMPACTS if options.impacts is None else options.impacts
        written = reports.report(results, out, impacts=impacts, **shared)
    print(*written, sep="\n")
    return 0


def _sweep(paths: list[Path], options: argparse.Namespace, shared: dict[str, Any]) -> list[Path]:
    from jointplay.show.reports import sweep_report

    if len(paths) > 1:
        raise JointplayError("a sweep gets a separate report; give only its folder")
    (store,) = paths
    for option in typed(options, ("label", "impacts")):
        raise JointplayError(f"{option} is for results; {str(store)!r} is a sweep")
    default = store.parent / f"{store.name}_report.html"
    return sweep_report(store, Path(options.out or default), **shared)
