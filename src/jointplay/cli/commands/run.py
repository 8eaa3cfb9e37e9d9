"""`jointplay run`: simulate one robot, or the cases of a scenario file.

Simulate all cases of a scenario file, or one robot with clearance in the joints named, and draw
figures that compare the cases, or an overview of one. Without FILE or ROBOT: the SCARA arm under
gravity, 0.2 mm in joint B, 3 s. Options override FILE.

DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load or any NetCDF
reader), and the figures as .png.
"""

from __future__ import annotations

import argparse
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.base import files, signals, streams
from jointplay.base.errors import require_whole
from jointplay.base.progress import printing
from jointplay.base.signals import INTERRUPTED
from jointplay.base.tables import Table
from jointplay.cli.commands import MORE, first_notes, given, inputs, print_json
from jointplay.cli.commands.inputs import is_scenario, scenario_of
from jointplay.cli.options import FLAG, REPEATED, STOPPED, Parser, listed
from jointplay.study.cases import Cases, check_output_folder

REVIEWS = {"converge": "convergence study", "laws": "comparison of laws", "ensemble": "ensemble"}
"""Names of the studies for reviewers, by option."""

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.simulation.result.result import Result


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument
    add("--out", metavar="DIR", required=True, help="folder for the results")
    add("--case", metavar="NAME", **REPEATED, help="run only this case of FILE")
    add("--beside", metavar="FILE", help="the intended motion, where --motion is a corrected "
        "one: the tool's error is its distance from the ideal mechanism's tool on this motion")
    add = parser.add_argument_group("integration and output").add_argument
    add("--certify", **FLAG, help="repeat the run with finer steps to give the headline figures "
        "numerical error bounds; takes about two and a half times as long")
    add("--no-error-estimate", **FLAG, help="leave out the further runs that estimate the "
        "numerical errors of the headline figures")
    add("--resume", **FLAG, help="continue the interrupted runs in DIR, bit for bit; finished ones "
        "are kept")
    figures = parser.add_argument_group("integration and output").add_mutually_exclusive_group()
    figures.add_argument("--figures", **FLAG, help="draw all figures of a single case, too: the "
        "tool's motion and path, orbits, forces")
    figures.add_argument("--no-figures", **FLAG, help="do not draw figures")
    add = parser.add_argument_group("what reviewers ask, with a figure for print").add_argument
    add("--converge", **FLAG, help="the headline figures over the step or tolerance, beside the "
        "errors that are stated")
    add("--laws", metavar="NAMES", type=listed, help="the headline figures with each of these "
        "normal-force laws, joined by commas, in all joints with clearance")
    add("--ensemble", metavar="N", type=int, help="N perturbed starts: bands of the curves, "
        "spread of the figures")
    parser.share("--pdf", "--assumed", group="integration and output")
    parser.share("--json", "--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    """Prepare all cases, print assumptions, run what is not done yet, draw, print the answers."""
    from jointplay.scenario.robot import LABEL
    from jointplay.show import plots
    from jointplay.show.plots.names import MARK

    if options.ensemble is not None:
        require_whole("--ensemble", options.ensemble, 2)
    if options.laws is not None:
        from jointplay.study.reviews import require_laws

        require_laws(options.laws)
    if not options.resume and not is_scenario(options):
        check_output_folder(Path(options.out), [f"{LABEL}.nc"])
    scenario = scenario_of(options)
    cases = Cases(
        scenario,
        options.out,
        options.case,
        figures=_figures(scenario, options),
        mark=MARK,
        estimate=not options.no_error_estimate,
        **given(options, "certify", "beside", "resume", "jobs", "detail"),
        progress=not options.quiet,
        say=lambda name, result: _print_answer(cases, name, result, options.detail),
    )
    _say_assumptions(cases, options)
    cases.claim_folder()
    streams.release()
    stopped = cases.run()
    drawable = {name: result for name, result in cases.results.items() if len(result.time) > 1}
    reviews = [(name, kind) for name in cases.cases for kind in REVIEWS if getattr(options, kind)]
    try:
        if cases.figures and drawable:
            short = len(cases.cases) == 1 and not options.figures
            plots.save(drawable, cases.out, options.pdf, short)
        if options.json:
            print_json(options, cases.data())
        print(_ending(cases, options.detail))
        while reviews and not stopped:
            _review(cases, *reviews[0], options)
            del reviews[0]
    except KeyboardInterrupt:
        raise KeyboardInterrupt("; ".join(_left_out(reviews))) from None
    return _status(cases, stopped, _left_out(reviews))


def _review(cases: Cases, name: str, kind: str, options: argparse.Namespace) -> None:
    """A study for reviewers, of a case: a table, and a PDF figure beside the result."""
    from jointplay.show.plots.reviews import review

    case, common = cases.cases[name], {"jobs": options.jobs, "progress": not options.quiet}
    answer, figure = review(kind, case.simulation, getattr(options, kind), **common)
    path = cases.out / f"{case.path.stem}_{kind}.pdf"
    files.picture(path, figure)
    print(f"\n{name}, {kind}: {answer}\n{path}")


def _left_out(reviews: Sequence[tuple[str, str]]) -> list[str]:
    return [f"the {REVIEWS[kind]} was not run" for kind in dict.fromkeys(k for _, k in reviews)]


def _figures(scenario: Scenario, options: argparse.Namespace) -> list[str]:
    """Names of the figures that will be drawn."""
    from jointplay.show.plots import file_names, is_paper_robot

    if not scenario.figures or options.no_figures:
        return []
    names = [name for name in scenario.cases if name in options.case] or scenario.cases
    robots = (scenario.model(name).robot.urdf for name in names)
    return file_names(all(map(is_paper_robot, robots)), pdf=options.pdf)


def _say_assumptions(cases: Cases, options: argparse.Namespace) -> None:
    from jointplay.scenario.assumptions import decisive

    scenario = cases.scenario
    simulations = {name: case.simulation for name, case in cases.cases.items()}
    lines = first_notes(decisive(scenario, simulations), options.detail)
    for line in [*lines, *scenario.notes, *cases.notes]:
        streams.note(line)
    if options.assumed:
        from jointplay.simulation.values import assumed_table

        for name, simulation in simulations.items():
            print(f"{name}: assumed\n{assumed_table(simulation, scenario.origins(name))}\n")


def _print_answer(cases: Cases, name: str, result: Result, detail: bool) -> None:
    """Print a case's answer and warnings; of several cases only the first line of each."""
    from jointplay.physics.kernel import Status

    lines, completed = [*cases.lines[name]], result.status == Status.COMPLETED
    if result.message in lines[:1]:
        pass
    elif not cases.cases[name].has_play:  # no error by play: the run's end comes first
        lines = [result.message, *lines]
    elif result.message not in lines and (detail or not completed):
        lines.append(result.message)
    if detail:
        judged = result.judgement
    else:
        judged = "\n".join(f"  warning: {text}" for text in result.audit.warnings)
        lines = lines[:1] if len(cases.cases) > 1 and completed else lines
    answers = "\n  ".join(lines)
    with printing():
        print(f"\n{name}: {answers}\n{judged}".rstrip("\n"), flush=True)


def _ending(cases: Cases, detail: bool) -> str:
    """A table of several cases, the folder of the results, and the next commands."""
    from jointplay.simulation.analysis.headline import headline_texts

    lines, rows = [""], {}
    if len(cases.cases) > 1 and not detail:
        texts = {n: headline_texts(result) for n, result in cases.results.items()}
        rows = {name: row for name, row in texts.items() if row}
    if rows:
        heads = list(dict.fromkeys(head for row in rows.values() for head in row))
        table = [[name, *(row.get(head, "") for head in heads)] for name, row in rows.items()]
        lines += [str(Table.of_texts([["case", *heads], *table])), ""]
    lines.append(f"results in {cases.out}")
    if cases.results:
        loose = (name for name in cases.results if cases.cases[name].has_play)
        path = cases.cases[next(loose, next(iter(cases.results)))].path
        opened = shlex.join(["jointplay", "play", str(path)])
        report = shlex.join(["jointplay", "report", str(cases.out)])
        lines.append(f"next: {opened}; {report}{'' if detail else f' {MORE}'}")
    return "\n".join(lines)


def _status(cases: Cases, stopped: bool, left_out: list[str]) -> int:
    """The exit status; what an interrupt left out is reported, with `left_out`."""
    from jointplay.physics.kernel import Status

    results = cases.results
    missing = [name for name in cases.cases if name not in results]
    unjudged = [
        name
        for name, result in results.items()
        if cases.cases[name].errors and result.status == Status.COMPLETED and not result.certificate
    ]
    interrupted = any(result.status == Status.INTERRUPTED for result in results.values())
    if interrupted or (stopped and (missing or unjudged or left_out)):
        present = ", ".join(cases.cases[name].path.name for name in results)
        parts = [f"no result of: {', '.join(missing)}" if missing else f"there is {present}"]
        parts += [f"without numerical errors: {', '.join(unjudged)}"] if unjudged else []
        parts = ["interrupted", *parts, *left_out, "the same command with --resume continues"]
        print("; ".join(parts), file=sys.stderr)
        return INTERRUPTED
    if stopped:
        print(signals.SAVED, file=sys.stderr)
    return 0 if all(r.status == Status.COMPLETED for r in results.values()) else STOPPED
