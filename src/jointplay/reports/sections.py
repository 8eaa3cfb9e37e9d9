"""The sections of a report in words and tables."""

from __future__ import annotations

import csv
import io
import json
import math
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from jointplay import analysis
from jointplay.analysis.claims import measure
from jointplay.core.errors import JointplayError
from jointplay.core.files import read_text
from jointplay.geometry import Form
from jointplay.joints import JOINT_KINDS
from jointplay.plots.figures import is_paper
from jointplay.plots.style import MODE_NAMES
from jointplay.reports.cases import Case, dark, place_of
from jointplay.reports.html import Cell, Html, bullets, joined, markup, paragraph, table
from jointplay.result.certificate import CertifiedFigure
from jointplay.result.settings import START_UP

# What the paper claims, and what these runs say of it.


CLAIM_COLUMNS = ["claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm"]
"""Header of the claims table that `jointplay scara` writes."""


_MEASURES = {
    "deviation_mm": "tool deviation about its mean, RMS [mm]",
    "speed_mm_s": "velocity deviation, RMS [mm/s]",
    "path_mm": "distance from the ideal path in the XOY plane, RMS [mm]",
    "free": "free flight [share of time]",
    "continuous": "continuous contact [share of time]",
    "penetration": "pseudo-penetration [share of time]",
    "fx": "largest |Fx| [N]",
    "fy": "largest |Fy| [N]",
    "fz": "largest |Fz| [N]",
    "busy": "force above 20 % of its peak [share of time]",
    "crossings": "turning points of the tool's deviation [1/s]",
    "swing_mm": "mean excursion between them [mm]",
}


def claim_rows(source: Path | None) -> list[list[str]]:
    """Rows of a claims table, its header first; nothing for no file.

    Raises:
        JointplayError: it cannot be read, or is no such table.
    """
    if source is None:
        return []
    try:
        lines = list(csv.reader(io.StringIO(read_text(source, "claims"), newline=""), strict=True))
    except csv.Error as error:
        raise JointplayError(f"cannot read the claims {str(source)!r}: {error}") from None
    if not lines or lines[0] != CLAIM_COLUMNS or any(len(line) != 5 for line in lines):
        raise JointplayError(
            f"{str(source)!r} is not a claims table of jointplay scara; its header must be "
            f"{','.join(CLAIM_COLUMNS)}"
        )
    return lines


def claims(cases: Sequence[Case], source: Path | None) -> Html:
    """Verdicts of an ensemble, if there are any, and the measures of the runs themselves."""
    parts = []
    lines = claim_rows(source)
    if source is not None and lines:
        verdicts = {"yes": "good", "no": "bad"}
        rows = [
            [a, b, c, markup('<span class="{}">{}</span>', verdicts.get(d, "open"), d), e]
            for a, b, c, d, e in lines[1:]
        ]
        parts.append(table(lines[0], rows, f"Ensembles of perturbed runs ({source.name})", 5))
    columns = {}
    for case in cases:
        reference = case.ideal
        if case.error is None or reference is None or len(case.joints) != 1:
            continue
        same = np.array_equal(case.result.time, reference.time)
        if same and case.duration > 2.0 * START_UP:
            columns[case.label] = (dark(case), measure(case.result, reference))
    if columns:
        measures: list[list[Cell]] = [
            [label, *(float(column[key]) for _, column in columns.values())]
            for key, label in _MEASURES.items()
        ]
        parts.append(
            table(
                ["measure", *(name for name, _ in columns.values())],
                measures,
                "What the claims are about, in these single runs",
            )
        )
        parts.append(
            paragraph(
                "No claim is decided on single runs: impacts magnify small differences. Ensembles "
                "are judged by the command jointplay scara."
            )
        )
    return joined(parts) or paragraph(
        "There is nothing to judge: no claims table was given, "
        f"and no run with clearance is longer than {2.0 * START_UP:g} s."
    )


# Modes, forms and impacts in joints with clearance.


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


# The runs' judgement of themselves, and their numerical errors.


_OF_CONTACTS = (
    "contacts begun",
    "shortest contact [steps]",
    "contacts under 10 steps",
    "normal impulse [N s]",
    "largest penetration [µm]",
    "penetration [% of the clearance]",
    "step that friction needs [µs]",
)


def audits(cases: Sequence[Case]) -> Html:
    """Audits of the runs."""
    given = [_judged(case) for case in cases]
    rows: list[list[Cell]] = [
        [name, *(one[name] for one in given)]
        for name in given[0]
        if any(one[name] is not None for one in given)
    ]
    warnings = [
        markup('{} <strong class="warn">Warning:</strong> {}.', dark(case), warning)
        for case in cases
        for warning in case.result.audit.warnings
    ]
    return joined(
        [
            table(["of the run", *map(dark, cases)], rows, name="audit-table"),
            bullets(warnings) or paragraph("No run has warnings."),
        ]
    )


def _judged(case: Case) -> dict[str, Cell]:
    """Audit figures of a run by name; None where a figure does not apply."""
    audit, attributes = case.result.audit, case.result.dataset.attrs
    contact: dict[str, Cell] = dict.fromkeys(_OF_CONTACTS)
    if case.joints:
        limit = audit.friction_step_limit
        values: list[Cell] = [
            audit.impacts,
            audit.shortest_contact_steps or None,
            audit.under_resolved,
            audit.normal_impulse,
            1e6 * audit.largest_penetration,
            100.0 * audit.penetration_over_clearance,
            1e6 * limit if math.isfinite(limit) else None,
        ]
        contact = dict(zip(_OF_CONTACTS, values, strict=True))
    drift = 1e6 * audit.loop_drift if "loop_drift" in case.result.dataset else None
    return {
        "ended": case.result.message,
        "energy residual [J]": audit.energy_residual,
        "energy exchanged [J]": audit.energy_exchanged,
        "residual [% of exchanged]": 100.0 * audit.relative_energy_residual,
        **contact,
        "step [µs]": 1e6 * audit.step,
        "error by the step [µm]": None if audit.step_error is None else 1e6 * audit.step_error,
        "drift of ideal loops [µm]": drift,
        "computed in [s]": float(attributes["wall_time_s"])
        if "wall_time_s" in attributes
        else None,
    }


def certificates(cases: Sequence[Case]) -> Html:
    """Headline figures with their numerical errors; nothing if no run was certified."""
    known = [(case, case.result.certificate) for case in cases]
    given = [(case, certificate) for case, certificate in known if certificate is not None]
    if not given:
        return Html("")
    names = dict.fromkeys(
        figure.name for _, certificate in given for figure in certificate.headline
    )
    rows: list[list[Cell]] = []
    for name in names:
        row: list[Cell] = [name]
        for _, certificate in given:
            figure = next((one for one in certificate.figures if one.name == name), None)
            row.append(None if figure is None else _certified(figure))
        rows.append(row)
    head: list[Cell] = ["figure", *(dark(case) for case, _ in given)]
    points: list[str] = [
        markup("{} of the claims' measures above 5 %: {}.", dark(case), ", ".join(others))
        for case, certificate in given
        if (others := [one.name for one in certificate.marked if one not in certificate.headline])
    ]
    points += [
        markup("{} {}.", dark(case), certificate.note)
        for case, certificate in given
        if certificate.note
    ]
    points += [
        markup("{} further runs: {}.", dark(case), "; ".join(certificate.runs))
        for case, certificate in given
        if certificate.runs
    ]
    return joined(
        [
            Html("<h3>Numerical errors</h3>"),
            paragraph(
                "Figures of the runs and how far they may be from what the model says, found by "
                "running again more finely; those with errors above 5 % are marked."
            ),
            table(head, rows, left=1, name="certificates"),
            bullets(points),
        ]
    )


def _certified(figure: CertifiedFigure) -> Cell:
    shown = str(figure)
    return markup('<strong class="warn">{} (!)</strong>', shown) if figure.marked else shown


# Errors of the tool over the run and at its stops, and its vibration.


def stops(case: Case) -> list[analysis.Stop]:
    """Stops of the reference motion, as far as the run came."""
    assert case.error is not None
    if unknown_stops(case):
        return []
    motion = case.result.simulation.motion
    if motion is None:
        return []
    return analysis.stops(motion, float(case.error["time"][-1]))


def unknown_stops(case: Case) -> str:
    """Why nobody knows where the reference stopped: the run cannot be built again; else nothing."""
    try:
        _ = case.result.simulation
    except JointplayError as error:
        return str(error)
    return ""


def accuracies(cases: Sequence[Case], start: float) -> Html:
    """Tool error per axis over the run, and at the stops of the reference motion."""
    judged = [case for case in cases if case.error is not None]
    if not judged:
        return paragraph("No case has a tool error: none has play, or none has a reference.")
    rows: list[list[Cell]] = []
    for case in judged:
        assert case.error is not None
        accuracy = analysis.accuracy(case.error, min(start, float(case.error["time"][-1])))
        for k, axis in enumerate(analysis.COMPONENTS):
            values = (accuracy.mean, accuracy.rms, accuracy.peak)
            rows.append([dark(case), axis, *(1e3 * float(value[k]) for value in values)])
    whole = table(
        ["case", "axis", "mean [mm]", "RMS [mm]", "peak [mm]"],
        rows,
        "Tool position less the ideal mechanism's at the same time, world axes; total: the "
        "distance",
        left=2,
    )
    rows = []
    for case in judged:
        assert case.error is not None
        for stop in stops(case):
            moments = [("arrival", stop.start)]
            if stop.kind == "dwell":
                moments.append(("end of dwell", stop.end))
            for what, moment in moments:
                error = 1e3 * analysis.error_at(case.error, moment)
                strong = what == "end of dwell"
                cells: list[Cell] = [stop.kind, what, f"{moment:.4g}"]
                cells += [float(value) for value in error]
                rows.append([dark(case), *(_strong(cell) if strong else cell for cell in cells)])
    reasons = [(case.label, unknown_stops(case)) for case in judged]
    said = [paragraph(f"{label}: its stops are not known: {why}") for label, why in reasons if why]
    whole = joined([whole, *said])
    if not rows:
        return whole
    at_stops = table(
        ["case", "reference", "moment", "time [s]", "x [mm]", "y [mm]", "z [mm]", "total [mm]"],
        rows,
        "Tool error at the waypoints of the reference motion. The tool picks and places while the "
        "reference dwells: the end of a dwell (bold) is what the process gets",
        left=3,
        name="stops",
    )
    return joined([whole, at_stops])


def _strong(cell: Cell) -> Html:
    return markup("<strong>{}</strong>", cell)


def spectra(cases: Sequence[Case], start: float) -> Html:
    """How the spectra were made, and what they sum up to."""
    rows: list[list[Cell]] = []
    made: list[str] = []
    for case in cases:
        try:
            density = analysis.spectrum(case.result, start=start)
        except JointplayError as error:
            made.append(f"{case.label}: no spectrum, {error}.")
            continue
        frequency = density["frequency"].values
        width = float(frequency[1] - frequency[0])
        values = density.values
        rms = np.sqrt(values[1:].sum(axis=0) * width)
        above = frequency >= 20.0
        strongest = frequency[above][values[above].argmax(axis=0)] if above.any() else [None] * 4
        rows.append(
            [
                dark(case),
                *(float(value) for value in rms),
                *(None if value is None else float(value) for value in strongest[:3]),
                density.attrs["sampling_frequency_hz"] / 1e3,
                density.attrs["window_s"],
                density.attrs["windows"],
            ]
        )
    head = [
        "case",
        *(f"RMS {axis} [m/s²]" for axis in analysis.COMPONENTS),
        *(f"strongest above 20 Hz, {axis} [Hz]" for axis in "xyz"),
        "sampled at [kHz]",
        "window [s]",
        "windows",
    ]
    note = (
        "Power spectral density of the tool's acceleration, world axes, by Welch's method: "
        "one-sided, Hann windows that overlap by half, each less its mean. The acceleration is the "
        "mean one of each record interval (difference of recorded velocities), which lowers the "
        "density towards the Nyquist frequency, by 59 % there."
    )
    parts = [table(head, rows)] if rows else []
    return joined([*parts, paragraph(note), bullets(made)])


def glance(cases: Sequence[Case], start: float) -> Html:
    """One row for each case with the figures that matter most."""
    head = [
        "case",
        "ended",
        "tool error, RMS [mm]",
        "tool error, peak [mm]",
        "error at stops, largest [mm]",
        "contacts begun [1/s]",
        "force at the joint, peak [N]",
        "penetration, largest [µm]",
        "energy residual [% of exchanged]",
        "warnings",
    ]
    rows: list[list[Cell]] = []
    for case in cases:
        audit = case.result.audit
        row: list[Cell] = [dark(case), case.result.status.name.lower().replace("_", " ")]
        if case.error is None or float(case.error["time"][-1]) < start:
            row += [None, None, None]
        else:
            accuracy = analysis.accuracy(case.error, start)
            row += [1e3 * accuracy.rms[3], 1e3 * accuracy.peak[3], None]
            ends = [
                1e3 * float(analysis.error_at(case.error, stop.end)[3])
                for stop in stops(case)
                if stop.at_rest and stop.end > 0.0
            ]
            row[-1] = max(ends) if ends else None
        if case.joints:
            late = case.result.time >= start
            force = np.linalg.norm(case.result["joint_force_peak"].values[late], axis=2).max()
            since = case.result.judge_from
            begun = audit.judged_impacts
            rate = (
                audit.impacts / case.duration
                if begun is None
                else begun / max(case.duration - since, 1e-12)
            )
            row += [rate, float(force), 1e6 * audit.largest_penetration]
        else:
            row += [None, None, None]
        rows.append([*row, 100.0 * audit.relative_energy_residual, len(audit.warnings)])
    return table(head, rows, left=2)


# What every reader of a report must know, from `assumptions.toml`, and which of it holds when.
#
# The same texts stand in docs/assumptions.md, written there by `python docs/site/assumptions.py`.


@dataclass(frozen=True)
class Assumption:
    """A sentence or two."""

    when: str
    """In which runs it is made: a key of `conditions`."""
    text: str


@cache
def all_assumptions() -> tuple[Assumption, ...]:
    """All of them, in the order in which reports have them."""
    text = (files("jointplay.reports") / "assumptions.toml").read_text(encoding="utf-8")
    return tuple(Assumption(**one) for one in tomllib.loads(text)["assumption"])


def assumptions_of(cases: Sequence[Case]) -> list[str]:
    """Texts of those that are made in these runs."""
    holds = conditions(cases)
    return [one.text for one in all_assumptions() if holds[one.when]]


def conditions(cases: Sequence[Case]) -> dict[str, bool]:
    """Whether each thing that assumptions are about occurs in these runs."""
    inputs = [analysis.inputs(case.result) for case in cases]
    moving = [given for case, given in zip(cases, inputs, strict=True) if case.joints]
    bearings = [
        joint for case in cases for joint in analysis.clearance_inputs(case.result).values()
    ]
    kinds = {joint["kind"] for joint in bearings}
    return {
        "always": True,
        "clearance": bool(moving),
        "dry": any(not joint.get("lubricant") for joint in bearings),
        "oil": any(joint.get("lubricant") for joint in bearings),
        "worn": any(joint.get("worn") for joint in bearings),
        "wearing": any(joint.get("wear_rate") for joint in bearings),
        **{kind: kind in kinds for kind in JOINT_KINDS},
        "loops": any(given["mechanism"].get("loops") for given in inputs),
        "gears": any(given["mechanism"].get("gears") for given in inputs),
        "computed torque": any("computed-torque" in json.dumps(given["drive"]) for given in inputs),
        "prescribed": any("prescribed" in json.dumps(given["drive"]) for given in inputs),
        "payloads": any(given.get("payloads") for given in inputs),
        "loads": any(given.get("loads") for given in inputs),
        "cut": any(given.get("limits") == "cut" for given in inputs),
        "derived stiffness": any(
            joint.get("stiffness", 0.0) is None
            for given in moving
            for joint in given["mechanism"]["clearance"].values()
            if not joint.get("ideal")
        ),
        "centred": any(
            given.get("seed") is None and given.get("start") != "rest" for given in moving
        ),
        "rest": any(given.get("start") == "rest" for given in moving),
        "seeded": any(given.get("seed") is not None for given in moving),
        "balanced": any(not any(given["mechanism"].get("gravity", (1,))) for given in inputs),
        "unphysical": any(given["mechanism"].get("allow_unphysical") for given in inputs),
    }


def assumed(cases: Sequence[Case], start: float) -> Html:
    """What is assumed in these runs and in their evaluation."""
    points = assumptions_of(cases)
    if start:
        points.append(
            f"Tool accuracy, peak force, contact statistics, shares of time and spectra are judged "
            f"from {start:g} s on; penetration and audit are those of whole runs."
        )
    points += [
        markup("{}: {}.", dark(case), case.result.audit.headline) for case in cases if case.joints
    ]
    for case in cases:
        points += [markup("{} {}", dark(case), note) for note in case.notes]
    return bullets(points)


def page_section() -> str:
    """The table that docs/assumptions.md has of them."""
    rows = [f"| {one.when} | {one.text} |" for one in all_assumptions()]
    return "\n".join(["| runs with | assumed |", "| --- | --- |", *rows]) + "\n"
