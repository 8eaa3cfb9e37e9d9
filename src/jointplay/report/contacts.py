"""Modes, forms and impacts in joints with clearance."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from jointplay import analysis
from jointplay.geometry import Form
from jointplay.plots.figures import is_paper
from jointplay.plots.panels import MODE_NAMES
from jointplay.report.cases import Case
from jointplay.report.html import Cell, Html, joined, markup, paragraph, table
from jointplay.report.naming import dark, place_of


def modes(cases: Sequence[Case], start: float) -> Html:
    """Shares of the time in each mode and form."""
    pairs = [(case, joint) for case in cases for joint in case.joints]
    if not pairs:
        return paragraph("No case has clearance.")
    names = [markup("{}, {}", dark(case), joint) for case, joint in pairs]
    shares = [analysis.shares(case.result, joint, "mode", start) for case, joint in pairs]
    keys = list(shares[0])
    rows: list[list[Cell]] = [
        [name, *(100.0 * share[key] for share in shares)]
        for name, key in zip(MODE_NAMES, keys, strict=True)
    ]
    forms = [analysis.shares(case.result, joint, "form", start) for case, joint in pairs]
    forms = [share or dict.fromkeys((f.name.lower() for f in Form), math.nan) for share in forms]
    form_rows: list[list[Cell]] = [
        [
            f"{form.letter}: {form.name.lower().replace('_', ' ')}" if form else "no contact",
            *(100.0 * share[form.name.lower()] for share in forms),
        ]
        for form in Form
        if any(share[form.name.lower()] > 0.0 for share in forms)
    ]
    paper = is_paper({case.label: case.result for case in cases})
    mode, form = ("mode (Table 1)", "form (Figure 2)") if paper else ("mode", "form")
    parts = [table([mode, *names], rows, "Share of the records in each mode [%]")]
    if form_rows:
        caption = "Share of the records in each form [%]"
        parts.append(table([form, *names], form_rows, caption))
    return joined(parts)


def impacts(cases: Sequence[Case], start: float) -> Html:
    """Statistics of contacts by joint and place."""
    head = [
        "case, place",
        "contacts begun",
        "rate [1/s]",
        "normal impulse [N s]",
        "shortest [steps]",
        "in contact [% of time]",
        "duration, median [ms]",
        "duration, 95 % [ms]",
        "peak force, median [N]",
        "peak force, 95 % [N]",
        "peak force, largest [N]",
    ]
    rows: list[list[Cell]] = []
    for case in cases:
        for place in analysis.contacts(case.result, start):
            name = place_of(case, place.joint, place.contact)
            exact: list[Cell] = [None, None, None, None]
            if case.replay is not None:
                one = case.replay.statistics.sel(joint=place.joint, contact=place.contact)
                shortest = float(one["shortest_steps"])
                onsets = int(one["onsets"])
                exact = [
                    onsets,
                    onsets / case.duration,
                    float(one["impulse"]),
                    int(shortest) if math.isfinite(shortest) else None,
                ]
            row: list[Cell] = [name, *exact, 100.0 * place.share]
            if len(place.peak):
                row += [_ms(float(np.percentile(place.duration, p))) for p in (50, 95)]
                row += [float(np.percentile(place.peak, p)) for p in (50, 95, 100)]
            else:
                row += [None] * 5
            rows.append(row)
    if not rows:
        return paragraph("No case has clearance.")
    intervals = sorted(
        {_ms(float(np.median(np.diff(case.result.time)))) for case in cases if case.joints}
    )
    spacing = ", ".join(f"{value:g}" for value in intervals)
    note = (
        "Contacts begun, impulse and shortest contact are exact: counted at every step of the "
        "whole run. Durations come from records, known to about one record interval "
        f"({spacing} ms), and contacts that follow each other within it count as one. Peak "
        "forces are held between records and exact."
    )
    return joined([table(head, rows), paragraph(note)])


def singles(cases: Sequence[Case]) -> Html:
    """The largest impacts, step by step, each with a button that zooms into it."""
    head = [
        "case, place",
        "time [s]",
        "peak normal force [N]",
        "penetration [µm]",
        "steps in contact",
        "approach speed [mm/s]",
        "separation speed [mm/s]",
        "",
    ]
    rows: list[list[Cell]] = []
    for case in cases:
        windows = case.replay.windows if case.replay is not None else ()
        for impact, window in zip(case.impacts, windows, strict=True):
            time = window["time"].values
            force = window["normal_force"].sel(joint=impact.joint, contact=impact.contact)
            rows.append(
                [
                    place_of(case, impact.joint, impact.contact),
                    f"{float(time[int(force.values.argmax())]):.5f}",
                    impact.peak_force,
                    1e6 * impact.penetration,
                    impact.steps if impact.complete else f"> {impact.steps}",
                    1e3 * impact.approach_speed,
                    1e3 * impact.separation_speed,
                    markup(
                        '<button type="button" data-zoom="{}">zoom</button>',
                        f"{float(time[0])!r},{float(time[-1])!r}",
                    ),
                ]
            )
    if not rows:
        return paragraph("No impact was followed step by step.")
    return table(head, rows, name="single-impacts")


def _ms(seconds: float) -> float:
    return 1e3 * seconds
