"""The sections of a report in words and tables."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
import tomllib
from collections.abc import Sequence
from contextlib import suppress
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
from jointplay.mechanism.gear import Gear
from jointplay.plots.figures import is_paper
from jointplay.plots.names import MODE_MEANINGS, MODE_TERMS, MODES, robot_of
from jointplay.reports.cases import Case, dark, place_of, since
from jointplay.reports.html import Cell, Html, bullets, joined, markup, paragraph, table, table_of
from jointplay.result.certificate import MARKED, CertifiedFigure
from jointplay.result.settings import START_UP

# What the paper claims, and what these runs say of it.


CLAIM_COLUMNS = ["claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm"]
"""Header of the claims table that `jointplay scara` writes."""


_MEASURES = {
    "deviation_mm": "tool deviation about its mean, RMS [mm]",
    "speed_mm_s": "velocity deviation, RMS [mm/s]",
    "path_mm": "distance from the ideal path in the XOY plane, RMS [mm]",
    "free": f"{MODES[0]} [share of time]",
    "continuous": f"{MODES[1]} [share of time]",
    "penetration": f"{MODES[2]} [share of time]",
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
        rows: list[list[Cell]] = [
            [a, b, c, markup('<span class="{}">{}</span>', verdicts.get(d, "open"), d), e]
            for a, b, c, d, e in lines[1:]
        ]
        parts.append(table(lines[0], rows, f"Ensembles of perturbed runs ({source.name})", 5))
    columns = {}
    for case in cases:
        if case.error is None or case.ideal is None or len(case.joints) != 1:
            continue
        same = np.array_equal(case.result.time, case.ideal.time)
        if same and case.duration > 2.0 * START_UP:
            columns[case.label] = (dark(case), measure(case.result, case.ideal))
    if columns:
        rows = [
            [label, *(float(column[key]) for _, column in columns.values())]
            for key, label in _MEASURES.items()
        ]
        head = ["measure", *(name for name, _ in columns.values())]
        parts.append(table(head, rows, "What the claims are about, in these single runs"))
        parts.append(
            paragraph(
                "No claim is decided on single runs: impacts magnify small differences. Ensembles "
                "are judged by the command jointplay scara."
            )
        )
    return joined(parts) or paragraph(
        "There are no claims to judge: no claims table was given, and no run with clearance is "
        f"longer than {2.0 * START_UP:g} s."
    )


# Modes, forms and impacts in joints with clearance.


def ring_or_journal(cases: Sequence[Case]) -> str:
    """What is seen in its bearing: journals, inner rings, or both."""
    kinds = {analysis.rolls(case.result, joint) for case in cases for joint in case.joints}
    return {(True,): "Inner rings", (False, True): "Journals and inner rings"}.get(
        tuple(sorted(kinds)), "Journal"
    )


def modes(cases: Sequence[Case], start: float) -> Html:
    """Shares of the time in each mode and form."""
    every = [(case, joint) for case in cases for joint in case.joints]
    if not every:
        return paragraph("No case has clearance.")
    pairs = [(case, joint) for case, joint in every if not analysis.rolls(case.result, joint)]
    if not pairs:
        return Html("")
    names = [markup("{}, {}", dark(case), joint) for case, joint in pairs]
    shares = [analysis.shares(case.result, joint, "mode", start) for case, joint in pairs]
    keys = list(shares[0])
    rows: list[list[Cell]] = [
        [name, *(100.0 * share[key] for share in shares)]
        for name, key in zip(MODES, keys, strict=True)
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
    explained = (
        f"{name} (in the paper: {term}): {meaning}"
        for name, term, meaning in zip(MODES, MODE_TERMS, MODE_MEANINGS, strict=True)
    )
    parts = [
        table([mode, *names], rows, f"Share of the records in each mode [%]{since(start)}"),
        paragraph("; ".join(explained) + "."),
    ]
    if form_rows:
        caption = f"Share of the records in each form [%]{since(start)}"
        parts.append(table([form, *names], form_rows, caption))
    return joined(parts)


def impacts(cases: Sequence[Case], start: float) -> Html:
    """Statistics of contacts by joint and place."""
    rows: list[dict[str, Cell]] = []
    for case in cases:
        for place in analysis.contacts(case.result, start):
            onsets = impulse = shortest = None
            if case.replay is not None:
                one = case.replay.statistics.sel(joint=place.joint, contact=place.contact)
                onsets, impulse = int(one["onsets"]), float(one["impulse"])
                steps = float(one["shortest_steps"])
                shortest = int(steps) if math.isfinite(steps) else None
            row: dict[str, Cell] = {
                "case, place": place_of(case, place.joint, place.contact),
                "contacts begun": onsets,
                "rate [1/s]": None if onsets is None else onsets / case.duration,
                "normal impulse [N s]": impulse,
                "shortest [steps]": shortest,
                "in contact [% of time]": 100.0 * place.share,
            }
            for word, percent in (("median", 50), ("95 %", 95)):
                row[f"duration, {word} [ms]"] = _percentile(1e3 * place.duration, percent)
            for word, percent in (("median", 50), ("95 %", 95), ("largest", 100)):
                row[f"peak force, {word} [N]"] = _percentile(place.peak, percent)
            rows.append(row)
    if not rows:
        return paragraph("No case has clearance.")
    intervals = {1e3 * float(np.median(np.diff(case.result.time))) for case in cases if case.joints}
    spacing = ", ".join(f"{value:g}" for value in sorted(intervals))
    note = (
        "Contacts begun, impulse and shortest contact are exact: counted at every step of the "
        "whole run. Durations come from records, known to about one record interval "
        f"({spacing} ms), and contacts that follow each other within it count as one. Peak "
        "forces are held between records and exact."
    )
    return table_of(rows) + paragraph(note)


def bearings(cases: Sequence[Case], start: float) -> Html:
    """Loads, life and friction of rolling bearings; nothing without any."""
    rows: list[dict[str, Cell]] = []
    swings = False
    for case in cases:
        late = case.result.time >= start
        if not any(analysis.rolls(case.result, joint) for joint in case.joints) or late.sum() < 2:
            continue
        for joint, bearing in analysis.rolling_bearings(case.result).items():
            life = analysis.bearing_life(case.result, joint, start)
            loaded = case.result["loaded_elements"].sel(joint=joint).values[late]
            swings = swings or life.oscillates
            rows.append(
                {
                    "case, joint": markup("{}, {}", dark(case), joint),
                    "bearing": bearing.designation or bearing.kind.replace("-", " "),
                    "largest element load [N]": life.largest_load,
                    "the same, at C0 [N]": life.rated_load,
                    "elements loaded, least": int(loaded.min()),
                    "mean": float(loaded.mean()),
                    "most": life.most_loaded,
                    "of": life.elements,
                    "turned [rev]": life.turned,
                    "life L10": life.lasting,
                    "friction torque, mean [N mm]": 1e3 * life.mean_torque,
                    "friction power, mean [mW]": 1e3 * life.friction_power,
                }
            )
    if not rows:
        return Html("")
    note = (
        "Loads are those of single balls or rollers; at C0 that of the most loaded one under the "
        "basic static load rating. L10: basic reference rating life (ISO/TS 16281, a factor "
        "a_ISO of 1) of repeating this motion, with the damage of each instant's loads summed by "
        "Palmgren and Miner; the inner ring counts as the one that turns against the load."
    )
    if swings:
        note += (
            " Rings that swing by less than the distance of two elements: L10 is not meant for "
            "them, other damage (false brinelling) may come first."
        )
    heading = Html("<h3>Rolling bearings</h3>")
    return joined([heading, table_of(rows, left=2, name="bearings"), paragraph(note)])


def _percentile(values: np.ndarray, percent: float) -> float | None:
    """None of no values."""
    return float(np.percentile(values, percent)) if len(values) else None


def singles(cases: Sequence[Case]) -> Html:
    """The largest impacts, step by step, each with a button that zooms into it."""
    rows: list[dict[str, Cell]] = []
    for case in cases:
        windows = case.replay.windows if case.replay is not None else ()
        for impact, window in zip(case.impacts, windows, strict=True):
            time = window["time"].values
            force = window["normal_force"].sel(joint=impact.joint, contact=impact.contact)
            zoom = f"{float(time[0])!r},{float(time[-1])!r}"
            rows.append(
                {
                    "case, place": place_of(case, impact.joint, impact.contact),
                    "time [s]": f"{float(time[int(force.values.argmax())]):.5f}",
                    "peak normal force [N]": impact.peak_force,
                    "penetration [µm]": 1e6 * impact.penetration,
                    "steps in contact": impact.steps if impact.complete else f"> {impact.steps}",
                    "approach speed [mm/s]": 1e3 * impact.approach_speed,
                    "separation speed [mm/s]": 1e3 * impact.separation_speed,
                    "": markup('<button type="button" data-zoom="{}">zoom</button>', zoom),
                }
            )
    if not rows:
        return paragraph("No impact was followed step by step.")
    return table_of(rows, name="single-impacts")


# The runs' judgement of themselves, and their numerical errors.


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
    audit, result = case.result.audit, case.result
    limit, wall = audit.friction_step_limit, result.dataset.attrs.get("wall_time_s")
    contact: dict[str, Cell] = {
        "contacts begun": audit.impacts,
        "shortest contact [steps]": audit.shortest_contact_steps or None,
        "contacts under 10 steps": audit.under_resolved,
        "normal impulse [N s]": audit.normal_impulse,
        "largest penetration [µm]": 1e6 * audit.largest_penetration,
        "penetration [% of the clearance]": 100.0 * audit.penetration_over_clearance,
        "step that friction needs [µs]": 1e6 * limit if math.isfinite(limit) else None,
    }
    return {
        "ended": result.message,
        "energy residual [J]": audit.energy_residual,
        "energy exchanged [J]": audit.energy_exchanged,
        "residual [% of exchanged]": 100.0 * audit.relative_energy_residual,
        **(contact if case.joints else dict.fromkeys(contact)),
        "step [µs]": 1e6 * audit.step,
        "error by the step [µm]": None if audit.step_error is None else 1e6 * audit.step_error,
        "drift of ideal loops [µm]": 1e6 * audit.loop_drift
        if "loop_drift" in result.dataset
        else None,
        "computed in [s]": None if wall is None else float(wall),
    }


def certificates(cases: Sequence[Case]) -> Html:
    """Headline figures with their numerical errors; nothing if no run was certified."""
    known = [(case, case.result.certificate) for case in cases]
    given = [(case, certificate) for case, certificate in known if certificate is not None]
    if not given:
        return Html("")
    names = dict.fromkeys(figure.name for _, one in given for figure in one.headline)
    rows: list[list[Cell]] = []
    for name in names:
        found = [
            next((figure for figure in one.figures if figure.name == name), None)
            for _, one in given
        ]
        rows.append([name, *(None if figure is None else _certified(figure) for figure in found)])
    points: list[str] = []
    for case, one in given:
        others = [figure for figure in one.marked if figure not in one.headline]
        if others:
            text = ", ".join(figure.name for figure in others)
            points.append(markup("{} of the claims' measures above 5 %: {}.", dark(case), text))
    points += [markup("{} {}.", dark(case), one.note) for case, one in given if one.note]
    points += [
        markup("{} further runs: {}.", dark(case), "; ".join(one.runs))
        for case, one in given
        if one.runs
    ]
    note = (
        "Figures of the runs with their numerical errors, found by repeating the runs with steps "
        "chosen by their error: estimated from two further runs, certified by three. Those with "
        "errors above 5 % are marked."
    )
    head = ["figure", *(dark(case) for case, _ in given)]
    heading = Html("<h3>Numerical errors</h3>")
    return joined(
        [heading, paragraph(note), table(head, rows, name="certificates"), bullets(points)]
    )


def _certified(figure: CertifiedFigure) -> Cell:
    shown = str(figure)
    return markup('<strong class="warn">{} (!)</strong>', shown) if figure.marked else shown


# Errors of the tool over the run and at its stops, and its vibration.


def stops(case: Case) -> tuple[list[analysis.Stop], str]:
    """Stops of the reference motion, as far as the run came; or why nobody knows them."""
    assert case.error is not None
    try:
        motion = case.result.simulation.motion
    except JointplayError as error:  # the run cannot be built again
        return [], str(error)
    if motion is None:
        return [], ""
    return analysis.stops(motion, float(case.error["time"][-1])), ""


def accuracies(cases: Sequence[Case], start: float) -> Html:
    """Tool error per axis over the run, and at the stops of the reference motion."""
    rows: list[dict[str, Cell]] = []
    at_stops: list[dict[str, Cell]] = []
    unknown: list[Html] = []
    for case in cases:
        if case.error is None:
            continue
        accuracy = analysis.accuracy(case.error, min(start, float(case.error["time"][-1])))
        for k, axis in enumerate(analysis.COMPONENTS):
            row: dict[str, Cell] = {"case": dark(case), "axis": axis}
            row["mean [mm]"] = 1e3 * float(accuracy.mean[k])
            for how, values in (("RMS", accuracy.rms), ("peak", accuracy.peak)):
                name = f"{how} tool error" if axis == "total" else ""
                row[f"{how} [mm]"] = _glance_cell(case, start, 1e3 * float(values[k]), name)
            rows.append(row)
        reached, reason = stops(case)
        if reason:
            unknown.append(paragraph(f"{case.label}: its stops are not known: {reason}"))
        for stop in reached:
            at_stops.append(_at_stop(case, stop, "arrival", stop.start))
            if stop.kind == "dwell":
                row = _at_stop(case, stop, "end of dwell", stop.end)
                strong = {key: markup("<strong>{}</strong>", cell) for key, cell in row.items()}
                at_stops.append(strong | {"case": row["case"]})
    if not rows:
        return paragraph("No case has a tool error: none has play, or none has a reference.")
    caption = (
        "Tool position less the ideal mechanism's at the same time, world axes; total: the distance"
        f"{since(start)}"
    )
    parts = [table_of(rows, caption=caption, left=2), *unknown]
    if at_stops:
        caption = (
            "Tool error at the waypoints of the reference motion. The tool picks and places "
            "while the reference dwells: the end of a dwell (bold) is what matters to the "
            "process"
        )
        parts.append(table_of(at_stops, caption=caption, left=3, name="stops"))
    return joined(parts)


def _at_stop(case: Case, stop: analysis.Stop, what: str, moment: float) -> dict[str, Cell]:
    """The tool's error at a moment of a stop."""
    assert case.error is not None
    error = 1e3 * analysis.error_at(case.error, moment)
    components = {
        f"{axis} [mm]": float(value) for axis, value in zip(analysis.COMPONENTS, error, strict=True)
    }
    return {
        "case": dark(case),
        "reference": stop.kind,
        "moment": what,
        "time [s]": f"{moment:.4g}",
        **components,
    }


def spectra(cases: Sequence[Case], start: float) -> Html:
    """How the spectra were made, and what they sum up to."""
    rows: list[dict[str, Cell]] = []
    missing: list[str] = []
    for case in cases:
        try:
            density = analysis.spectrum(case.result, start=start)
        except JointplayError as error:
            missing.append(f"{case.label}: no spectrum, {error}.")
            continue
        frequency, values = density["frequency"].values, density.values
        width = float(frequency[1] - frequency[0])
        rms = np.sqrt(values[1:].sum(axis=0) * width)
        above = frequency >= 20.0
        row: dict[str, Cell] = {"case": dark(case)}
        for k, axis in enumerate(analysis.COMPONENTS):
            row[f"RMS {axis} [m/s²]"] = float(rms[k])
        for k, axis in enumerate("xyz"):
            strongest = float(frequency[above][values[above, k].argmax()]) if above.any() else None
            row[f"strongest above 20 Hz, {axis} [Hz]"] = strongest
        row["sampled at [kHz]"] = density.attrs["sampling_frequency_hz"] / 1e3
        row["window [s]"] = density.attrs["window_s"]
        row["windows"] = density.attrs["windows"]
        rows.append(row)
    note = (
        "Power spectral density of the tool's acceleration, world axes, by Welch's method: "
        "one-sided, Hann windows that overlap by half, each less its mean. The acceleration is the "
        "mean one of each record interval (difference of recorded velocities), which lowers the "
        "density towards the Nyquist frequency, by 59 % there."
    )
    parts = [table_of(rows)] if rows else []
    return joined([*parts, paragraph(note), bullets(missing)])


def glance(cases: Sequence[Case], start: float) -> Html:
    """The figures that matter most, a column for each case, with their numerical errors."""
    columns = [_glanced(case, start) for case in cases]
    rows: list[list[Cell]] = [
        [name, *(column.get(name) for column in columns)]
        for name in max(columns, key=len)
        if any(column.get(name) is not None for column in columns)
    ]
    caption = f"Figures from {start:g} s on, the penetration's of the whole run" if start else ""
    made = table(["", *map(dark, cases)], rows, caption=caption, name="glance")
    beside = markup('<div class="first">{}{}</div>', made, _robot(cases))
    return beside + bullets(_what_errors_mean(cases, start))


def _robot(cases: Sequence[Case]) -> Html:
    """A picture of the mechanism with its play marked; nothing if it cannot be built or drawn."""
    from jointplay.mechanism.picture import picture

    shown = next((case for case in cases if case.joints), cases[0])
    try:
        mechanism = shown.result.simulation.mechanism
        labels = {name: _play_of(cases, name) for name in shown.joints}
        figure = picture(mechanism, shown.result["q"].values[0], labels=labels)
    except JointplayError:  # such as a law of the user's own that may not be imported
        return Html("")
    drawn = io.BytesIO()
    figure.set_size_inches(6.0, 4.1)  # letters that can be read in half a page
    figure.savefig(drawn, format="png", dpi=150, bbox_inches="tight", pad_inches=0.05)
    words = f"{robot_of(shown.result)} at the start of the run"
    words += f"; play in {', '.join(shown.joints)}" if shown.joints else "; no joint has play"
    return markup(
        '<figure><img alt="{}" src="data:image/png;base64,{}"><figcaption>{}</figcaption></figure>',
        words,
        base64.b64encode(drawn.getvalue()).decode(),
        words,
    )


def _play_of(cases: Sequence[Case], joint: str) -> str:
    """What the picture says of a joint: its play in each case."""
    words = dict.fromkeys(
        case.result.simulation.mechanism.clearance[joint].play_words
        for case in cases
        if joint in case.joints
    )
    return f"{joint}\nplay {next(iter(words))}" if len(words) == 1 else f"{joint}: play"


def _glanced(case: Case, start: float) -> dict[str, Cell]:
    """The figures of a case by name; None where one does not apply."""
    audit = case.result.audit
    rms = peak = turn = turned = at_stops = number = force = penetration = None
    strongest = ""
    if case.error is not None and float(case.error["time"][-1]) >= start:
        accuracy = analysis.accuracy(case.error, start)
        rms, peak = 1e3 * accuracy.rms[3], 1e3 * accuracy.peak[3]
        ends = [stop.end for stop in stops(case)[0] if stop.at_rest and stop.end > 0.0]
        errors = [1e3 * float(analysis.error_at(case.error, end)[3]) for end in ends]
        at_stops = max(errors, default=None)
    if case.turn is not None and float(case.turn["time"][-1]) >= start:
        rotation = analysis.accuracy(case.turn, start)
        turned, turn = 1e3 * rotation.rms[3], 1e3 * rotation.peak[3]
    if case.joints:
        late = case.result.time >= start
        peaks = np.linalg.norm(case.result["joint_force_peak"].values[late], axis=2).max(axis=0)
        force, strongest = float(peaks.max()), case.joints[int(peaks.argmax())]
        penetration = 1e6 * audit.largest_penetration
        number = audit.impacts if audit.judged_impacts is None else audit.judged_impacts
    noise: dict[str, Cell] = {}
    if case.joints and start == case.result.judge_from:
        with suppress(JointplayError):  # too few records
            found = analysis.rattle(case.result, case.ideal)
            noise["energy lost per impact [mJ]"] = 1e3 * found.energy
            for band in found.bands:
                noise[f"tool acceleration, {band.range}, RMS [m/s²]"] = band.rms
    at = f", {strongest}" if len(case.joints) > 1 else ""
    return {
        "ended": case.result.status.name.lower().replace("_", " "),
        "tool error, peak [mm]": _glance_cell(case, start, peak, "peak tool error"),
        "tool error, RMS [mm]": _glance_cell(case, start, rms, "RMS tool error"),
        "turn of the tool, peak [mrad]": _glance_cell(case, start, turn, "peak tool turn"),
        "turn of the tool, RMS [mrad]": _glance_cell(case, start, turned, "RMS tool turn"),
        "tool error at stops, largest [mm]": at_stops,
        "force at the joint, peak [N]": _glance_cell(case, start, force, f"peak joint force{at}"),
        "impacts": _glance_cell(case, start, number, "impacts"),
        **noise,
        "penetration, largest [µm]": penetration,
        "energy residual [% of exchanged]": 100.0 * audit.relative_energy_residual,
        "warnings": len(audit.warnings),
    }


def _error_of(case: Case, start: float, name: str) -> CertifiedFigure | None:
    """A certified or estimated figure over the time that the report judges."""
    certificate = case.result.certificate
    if certificate is None or start != case.result.judge_from:
        return None
    return next((figure for figure in certificate.figures if figure.name == name), None)


def _glance_cell(case: Case, start: float, value: float | None, name: str) -> Cell:
    """A value with its numerical error, marked where `CertifiedFigure.marked`."""
    figure = None if value is None else _error_of(case, start, name)
    if value is None or figure is None:
        return value
    if not figure.marked:
        return figure.number
    return markup('{}<br><strong class="warn">uncertain</strong>', figure.number)


def _what_errors_mean(cases: Sequence[Case], start: float) -> list[Html | str]:
    """What ± and its absence stand for, and what to do about large errors."""
    known = [case for case in cases if case.result.certificate is not None]
    points: list[Html | str] = []
    if known:
        points.append(
            "±: numerical error, within which 9 of 10 figures are of what the model says. It does "
            "not say how well the model fits the machine."
        )
    unsure: list[Html | str] = []
    for case in known:
        certificate = case.result.certificate
        assert certificate is not None
        shown = ("peak joint force", "peak tool", "RMS tool", "impacts")
        found = [f.name for f in certificate.headline if f.name.startswith(shown) and f.marked]
        if start == case.result.judge_from and found and case.joints:
            note = f" ({certificate.note})" if certificate.note else ""
            unsure.append(markup("{}: {}{}", dark(case), ", ".join(found), note))
    if unsure:
        points.append(
            markup(
                '<strong class="warn">Uncertain:</strong> the numerical error exceeds {} % of the '
                "value (of a count, 1). Do not compare designs by smaller differences. A smaller "
                "tolerance or step (integration.tolerance, integration.step) helps "
                "where the step is the cause; where the motion itself magnifies small differences, "
                "only means over perturbed runs can be compared (jointplay sweep, repeats).{}",
                f"{100.0 * MARKED:g}",
                bullets(unsure),
            )
        )
    unknown = [case for case in cases if case.result.certificate is None and case.joints]
    if unknown:
        points.append(
            markup(
                "{} numerical errors are not known; jointplay run --certify finds them.",
                joined((dark(case) for case in unknown), ", "),
            )
        )
    return points


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
        "sliding": bool(kinds & analysis.SLIDING_KINDS),
        "rolling": bool(kinds & analysis.ROLLING_KINDS),
        "dry": any(
            not joint.get("lubricant")
            for joint in bearings
            if joint["kind"] in analysis.SLIDING_KINDS
        ),
        "oil": any(joint.get("lubricant") for joint in bearings),
        "worn": any(joint.get("worn") for joint in bearings),
        "wearing": any(joint.get("wear_rate") for joint in bearings),
        **{kind: kind in kinds for kind in JOINT_KINDS},
        "loops": any(given["mechanism"].get("loops") for given in inputs),
        "gears": any(given["mechanism"].get("gears") for given in inputs),
        "refined gears": any(
            gear.get("kind", Gear.kind) != Gear.kind
            for given in inputs
            for gear in (given["mechanism"].get("gears") or {}).values()
        ),
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
        markup("{}: {}.", dark(case), case.result.audit.headline_with(case.result.certificate))
        for case in cases
        if case.joints
    ]
    for case in cases:
        points += [markup("{} {}", dark(case), note) for note in case.notes]
    return bullets(points)


def page_section() -> str:
    """The table that docs/assumptions.md has of them."""
    rows = [f"| {one.when} | {one.text} |" for one in all_assumptions()]
    return "\n".join(["| runs with | assumed |", "| --- | --- |", *rows]) + "\n"
