"""Reports on runs or on a sweep: an HTML page that needs no network, and a PDF."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError, require_a, require_whole
from jointplay.base.files import check_new
from jointplay.base.files import write as write_file
from jointplay.base.processes import in_parallel
from jointplay.base.schema import known_keywords
from jointplay.show.plots.names import load as load
from jointplay.show.plots.names import robot_of, title_of
from jointplay.show.reports import runs, sweep
from jointplay.show.reports.cases import Runs, Say, build, follow_impacts
from jointplay.show.reports.charts import Times
from jointplay.show.reports.html import Html
from jointplay.show.reports.parts import Block
from jointplay.show.reports.pdf import pdf as draw_pdf
from jointplay.show.reports.template import page
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.stored import versions
from jointplay.study import open_sweep
from jointplay.study.store import NOT_RUN

IMPACTS = 5  # impacts of each case that are followed step by step by default (judged)


@known_keywords
def report(
    results: Mapping[str, Result],
    path: str | Path,
    *,
    title: str | None = None,
    impacts: int = IMPACTS,
    pdf: bool = True,
    say: Say = lambda _: None,
) -> list[Path]:
    """Write a report on one or several results.

    Args:
        results: by label, in the order of the tables.
        path: the page, ending in .html; the PDF gets the same name with .pdf.
        title: the page's title; None takes the scenario's, or names the robot.
        impacts: how many of the largest impacts of each case to follow step by step, which repeats
            its run; 0 repeats none.
        pdf: write the PDF too.
        say: called with a line on each step of the work.

    Returns:
        The files written.

    Raises:
        JointplayError: no results, a result without records, or a file that exists or cannot be
            written.
    """
    require_a("results", results, "Mapping")
    if not results:
        raise JointplayError("a report needs at least one result")
    require_whole("impacts", impacts)
    for label, result in results.items():
        if len(result.time) < 2:
            raise JointplayError(
                f"result {label!r} has {len(result.time)} record; there is nothing to show"
            )
    targets = _targets(path, pdf)
    cases = build(results, say)
    follow_impacts(cases, impacts, say)
    subject = Runs(cases)
    times = [
        Times(records.time, case.result.audit.step, np.isin(records.time, case.result.time))
        for case, records in zip(cases, subject.detailed.values(), strict=True)
    ]
    robots = ", ".join(dict.fromkeys(robot_of(case.result) for case in cases))
    title = title or title_of(results)
    names = Html(" &ensp; ").join([*([robots] if robots != title else []), *cases])
    end = max(case.duration for case in cases)
    show = partial(page, subject=names, versions=versions(), times=times, end=end)
    return _write(targets, title, runs.BLOCKS, subject, show, subject.start, say)


def sweep_report(
    store: str | Path,
    path: str | Path,
    *,
    title: str | None = None,
    pdf: bool = True,
    say: Say = lambda _: None,
) -> list[Path]:
    """Write a report on a sweep and return the files written; existing files are refused."""
    store = Path(store)
    dataset = open_sweep(store).dataset()
    if not (dataset["status"].values != NOT_RUN).any():
        raise JointplayError(f"no case of the sweep {str(store)!r} was run yet")
    sizes = " x ".join(f"{name} {size}" for name, size in dataset.attrs["sizes"].items())
    cases = f"{sizes} = {dataset['status'].size} cases"
    show = partial(page, subject=cases, versions=dataset.attrs["versions"])
    title = title or f"Sweep {store.name}"
    return _write(_targets(path, pdf), title, sweep.BLOCKS, dataset, show, 0.0, say)


def _targets(path: str | Path, pdf: bool) -> list[Path]:
    """The files of a report, checked before any work is done."""
    path = Path(path)
    if path.suffix != ".html":
        raise JointplayError(f"the report is a page: {str(path)!r} must end in .html")
    return [check_new(file) for file in ([path, path.with_suffix(".pdf")] if pdf else [path])]


def _write(
    targets: Sequence[Path],
    title: str,
    blocks: Sequence[Block],
    subject: Any,
    show: Any,
    start: float,
    say: Say,
) -> list[Path]:
    """Write the page of the blocks that have parts, and their PDF if it is among the targets."""
    say("writing the page")
    parts = [(block, [*block.parts(subject)]) for block in blocks]
    shown = [(block, content) for block, content in parts if content]
    # Another process draws the PDF meanwhile.
    with (
        in_parallel(partial(draw_pdf, title, shown, start))
        if len(targets) > 1
        else nullcontext() as drawn
    ):
        contents = [show(title, blocks=shown, start=start).encode()]
        if drawn is not None:
            contents.append(drawn())
    for target, content in zip(targets, contents, strict=True):  # at the end: both or none
        write_file(target, content)
    return list(targets)
