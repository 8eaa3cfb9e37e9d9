"""The report: one HTML page that needs no network, and a PDF of its figures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import nullcontext
from functools import partial
from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError, require_a
from jointplay.base.files import write as write_file
from jointplay.base.processes import in_parallel
from jointplay.show.player.pages import as_data, as_script, static
from jointplay.show.plots import figures
from jointplay.show.plots.names import load as load
from jointplay.show.plots.names import robot_of, title_of
from jointplay.show.reports import html, sections
from jointplay.show.reports.cases import (
    Case,
    Say,
    build,
    dark,
    follow_impacts,
    inside_bearings,
    settled,
)
from jointplay.show.reports.charts import FIRST, MAX_RECORDS, Pack, all_charts
from jointplay.show.reports.html import Html, joined, markup, note, targets
from jointplay.show.reports.inputs import parameters
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.stored import versions

IMPACTS = 5  # impacts of each case that are followed step by step, unless told otherwise


def report(
    results: Mapping[str, Result],
    path: str | Path,
    *,
    title: str | None = None,
    claims: Path | None = None,
    impacts: int = IMPACTS,
    pdf: bool = True,
    say: Say = lambda _: None,
) -> list[Path]:
    """Write a report on one or several results.

    Args:
        results: by label, in the order of the tables.
        path: the page, ending in .html; the figures' PDF gets the same name with .pdf.
        title: of the page; None takes that of the scenario, or names the robot.
        claims: a claims table that `jointplay scara` wrote.
        impacts: how many of the largest impacts of each case to follow step by step, which repeats
            its run; 0 repeats none.
        pdf: write the PDF too.
        say: told what is being done.

    Returns:
        The files written.

    Raises:
        JointplayError: no results, a result without records, a file that exists or cannot be
            written, or a claims table that is none.
    """
    require_a("results", results, "Mapping")
    if not results:
        raise JointplayError("a report needs at least one result")
    if impacts < 0:
        raise JointplayError(f"impacts must be a whole number >= 0, got {impacts}")
    for label, result in results.items():
        if len(result.time) < 2:
            raise JointplayError(
                f"result {label!r} has {len(result.time)} record; there is nothing to show"
            )
    written = targets(path, pdf)
    sections.claim_rows(claims)
    cases = build(results, say)
    shown = {case.label: case.result for case in cases}
    ideal = next((case.ideal for case in cases if case.ideal is not None), None)
    if ideal is not None and all(ideal is not result for result in shown.values()):
        shown = {"ideal": ideal} | shown
    drawing = partial(figures.pdf, shown, settled(cases))
    with in_parallel(drawing) if pdf else nullcontext() as drawn:
        if pdf:
            say("drawing the figures for the PDF")
        follow_impacts(cases, impacts, say)
        say("writing the page")
        contents = [page(cases, title or title_of(results), claims).encode()]
        if drawn is not None:
            contents.append(drawn())
    for target, made in zip(written, contents, strict=True):  # at the end: none without the other
        write_file(target, made)
    return written


def page(cases: Sequence[Case], title: str, claims: Path | None) -> str:
    """The page's source."""
    start = settled(cases)
    pack = Pack()
    drawn = all_charts(cases, pack, start)
    by_name = {chart["id"]: chart for chart in drawn}

    def chart(*names: str) -> Html:
        """Places of charts, with what each shows in words, for who cannot see it."""
        places = []
        for one in (by_name[name] for name in names if name in by_name):
            panels = one["panels"]
            what = dict.fromkeys(panel["title"] or panel["y"]["label"] for panel in panels)
            of = dict.fromkeys(trace["name"] for panel in panels for trace in panel["traces"])
            words = f"{one['title']}: {', '.join(what)} of {', '.join(filter(None, of))}"
            element = (
                '<h3>{}</h3><div class="chart" id="chart-{}" role="group" aria-label="{}"></div>'
            )
            places.append(markup(element, one["title"], one["id"], words.removesuffix(" of ")))
        return joined(places)

    thinned = [case.label for case in cases if len(case.result.time) > MAX_RECORDS]
    hint = note("zoom") + (note("begin", f"{start:g}") if start else "")
    if thinned:
        hint += note("thinned", ", ".join(thinned), MAX_RECORDS // 2)
    first = [name for name in FIRST if name in by_name] or ["tool_displacement"]
    motion = [f"tool_{what}" for what in ("displacement", "velocity")]
    motion = [*(name + less for name in motion for less in ("", "_error")), "tool_path"]
    motion = [name for name in motion if name not in first]
    parts = {
        "At a glance": sections.glance(cases, start) + chart(*first),
        "Further figures": sections.further(cases, start),
        "Parameters": parameters(cases),
        "Assumptions": sections.assumed(cases, start),
        "Audit": sections.audits(cases) + sections.certificates(cases),
        "Motion of the tool": markup('<p class="screen">{}</p>', hint) + chart(*motion),
        "Accuracy": sections.accuracies(cases, start),
    }
    journals = any(case.joints for case in cases)  # where gears alone play, none strikes
    if journals:
        parts[inside_bearings(cases)[0]] = (
            chart("journal_orbit", "modes", "loaded")
            + sections.modes(cases, start)
            + sections.bearings(cases, start)
        )
    parts["Forces"] = sections.loads(cases, start) + chart("force_x", "force_y", "force_z")
    if journals:
        parts["Impacts"] = (
            sections.impacts(cases, start)
            + chart("impacts")
            + sections.singles(cases)
            + chart("contacts", "gaps")
        )
    parts["Spectrum"] = chart("spectrum") + sections.spectra(cases, start)
    if claims is not None or figures.is_paper({case.label: case.result for case in cases}):
        parts["Claims"] = sections.claims(cases, claims)
    end = max(case.duration for case in cases)
    data = {"charts": drawn, "layout": pack.layout, "start": start, "end": end}
    script = html.own("report.js")
    robots = dict.fromkeys(robot_of(case.result) for case in cases)
    names = [Html("{}").format(", ".join(robots)), *(dark(case) for case in cases)]
    charts: dict[str, Any] = {
        "block": pack.block(),
        "data": as_data(json.dumps(data, separators=(",", ":"), allow_nan=False)),
        "scripts": [as_script("\n".join((static("page.js"), static("chart.js"), script)))],
        "judged": f"{start:g}" if start else "",
    }
    return html.page(title, joined(names, Html(" &ensp; ")), versions(), parts, **charts)
