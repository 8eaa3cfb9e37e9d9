"""The sections of a report in words and tables."""

from __future__ import annotations

import base64
import csv
import io
import json
import math
import tomllib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import read_text
from jointplay.base.tables import Head, Table
from jointplay.base.units import readable
from jointplay.model.gear import Gear
from jointplay.physics.geometry import Form, Mode
from jointplay.physics.joints import JOINT_KINDS
from jointplay.show.plots.figures import is_paper
from jointplay.show.plots.names import MODE_MEANINGS, MODE_TERMS, MODES, robot_of
from jointplay.show.reports.cases import Case, dark, place_of, since
from jointplay.show.reports.charts import joint_forces, strongest
from jointplay.show.reports.html import (
    Cell,
    Html,
    Quantity,
    bullets,
    by_case,
    details,
    folded,
    joined,
    markup,
    note,
    paragraph,
    table,
    worst_first,
)
from jointplay.simulation import analysis
from jointplay.simulation.analysis.claims import CLAIM_COLUMNS, can_be_measured, measure
from jointplay.simulation.analysis.headline import headline
from jointplay.simulation.result.certificate import MARKED, CertifiedFigure
from jointplay.simulation.result.result import AXES

# What the paper claims, and what these runs say of it.


_MEASURES = {
    "deviation_mm": "tool deviation about its mean, RMS [mm]",
    "speed_mm_s": "velocity deviation, RMS [mm/s]",
    "path_mm": "distance from the ideal path in the XOY plane, RMS [mm]",
    **{
        key: f"{mode} [share of time]"
        for key, mode in zip(("free", "continuous", "penetration"), MODES, strict=True)
    },
    **{f"f{axis}": f"largest |F{axis}| [N]" for axis in AXES},
    "busy": "force above 20 % of its peak [share of time]",
    "crossings": "turning points of the tool's deviation [1/s]",
    "swing_mm": "mean excursion between them [mm]",
}


def claim_rows(source: Path | None) -> list[list[str]]:
    """Rows of a claims table, its header first; nothing for no file."""
    if source is None:
        return []
    try:
        lines = list(csv.reader(io.StringIO(read_text(source, "claims"), newline=""), strict=True))
    except csv.Error as error:
        raise JointplayError(f"cannot read the claims {str(source)!r}: {error}") from None
    head = Table.of_texts([CLAIM_COLUMNS]).csv().strip()  # as `jointplay scara` writes it
    if not lines or ",".join(lines[0]) != head or any(len(line) != 5 for line in lines):
        words = f"is not a claims table of jointplay scara; its header must be {head}"
        raise JointplayError(f"{str(source)!r} {words}")
    return [list(CLAIM_COLUMNS), *lines[1:]]


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
        caption = f"Ensembles of perturbed runs ({source.name})"
        parts.append(table(Table.of_texts([lines[0], *rows]), caption))
    found: dict[Html, dict[str, Quantity]] = {}
    for case in cases:
        if case.ideal is not None and can_be_measured(case.result, case.ideal):
            values = measure(case.result, case.ideal)
            found[dark(case)] = {name: (float(values[key]), "") for key, name in _MEASURES.items()}
    if found:
        caption = "What the claims are about, in these single runs"
        made = by_case("measure", list(found), list(found.values()), caption=caption)
        parts += [made, paragraph(note("single-runs"))]
    return joined(parts) or paragraph(note("no-claims"))


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
    paper = is_paper({case.label: case.result for case in cases})

    def shown(what: str, place: str, words: Mapping[str, str]) -> Html:
        """A table of shares, a row for each of the words."""
        every = [analysis.time_fractions(case.result, joint, what, start) for case, joint in pairs]
        rows: list[dict[str, Quantity]] = [
            {text: (one.get(key), "1") for key, text in words.items()} for one in every
        ]
        caption = f"Share of the records in each {what}{since(start)}"
        return by_case(f"{what} ({place})" if paper else what, names, rows, caption=caption)

    explained = (
        f"{name} (in the paper: {term}): {meaning}"
        for name, term, meaning in zip(MODES, MODE_TERMS, MODE_MEANINGS, strict=True)
    )
    keys = (mode.name.lower() for mode in Mode)
    parts = [shown("mode", "Table 1", dict(zip(keys, MODES, strict=True)))]
    parts.append(paragraph("; ".join(explained) + "."))
    forms = {}
    for form in Form:
        key = form.name.lower()
        if any(
            analysis.time_fractions(c.result, j, "form", start).get(key, 0.0) > 0.0
            for c, j in pairs
        ):
            forms[key] = f"{form.letter}: {key.replace('_', ' ')}" if form else "no contact"
    return joined([*parts, shown("form", "Figure 2", forms)] if forms else parts)


def impacts(cases: Sequence[Case], start: float) -> Html:
    """Statistics of contacts by joint and place."""
    rows: list[list[Cell]] = []
    for case in cases:
        for place in analysis.contacts(case.result, start):
            exact: list[Cell] = [None] * 4
            if case.replay is not None:
                one = case.replay.statistics.sel(joint=place.joint, contact=place.contact)
                onsets, steps = int(one["onsets"]), float(one["shortest_steps"])
                shortest = int(steps) if math.isfinite(steps) else None
                exact = [onsets, onsets / case.duration, float(one["impulse"]), shortest]
            durations = (_percentile(place.duration, percent) for percent in (50, 95))
            peaks = (_percentile(place.peak, percent) for percent in (50, 95, 100))
            label = place_of(case, place.joint, place.contact)
            rows.append([label, *exact, place.share, *durations, *peaks])
    if not rows:
        return paragraph("No case has clearance.")
    heads: list[Head] = [
        *(("case, place", ""), ("contacts begun", ""), ("rate", "1/s")),
        *(("normal impulse", "N*s"), ("shortest", "steps"), ("time in contact", "1")),
        *(("duration, median", "s", True), ("duration, 95 %", "s", True)),
        *((f"peak force, {word}", "N") for word in ("median", "95 %", "largest")),
    ]
    intervals = {1e3 * float(np.median(np.diff(case.result.time))) for case in cases if case.joints}
    spacing = ", ".join(f"{value:g}" for value in sorted(intervals))
    made = worst_first(heads, rows, len(heads) - 1, "places")
    return made + paragraph(note("impacts", spacing))


def loads(cases: Sequence[Case], start: float) -> Html:
    """The largest force in each joint with clearance; nothing for one joint: a glance has it."""
    rows: list[list[Cell]] = [
        [dark(case), joint, force]
        for case in cases
        if len(case.joints) > 1
        for joint, force in joint_forces(case, start).items()
    ]
    heads = (("case", ""), ("joint", ""), ("largest force", "N"))
    return worst_first(heads, rows, 2, "joints") if rows else Html("")


def bearings(cases: Sequence[Case], start: float) -> Html:
    """Loads, life and friction of rolling bearings; nothing without any."""
    rows: list[list[Cell]] = []
    swings = False
    for case in cases:
        late = case.result.time >= start
        if not any(analysis.rolls(case.result, joint) for joint in case.joints) or late.sum() < 2:
            continue
        for joint, bearing in analysis.rolling_bearings(case.result).items():
            life = analysis.bearing_life(case.result, joint, start)
            loaded = case.result["loaded_elements"].sel(joint=joint).values[late]
            swings = swings or life.oscillates
            name = bearing.designation or bearing.kind.replace("-", " ")
            row: list[Cell] = [
                markup("{}, {}", dark(case), joint),
                name,
                life.largest_load,
                life.rated_load,
            ]
            row += [int(loaded.min()), float(loaded.mean()), life.most_loaded, life.elements]
            rows.append([*row, life.turned, life.lasting, life.mean_torque, life.friction_power])
    if not rows:
        return Html("")
    words = note("bearings") + (note("swings") if swings else "")
    heading = Html("<h3>Rolling bearings</h3>")
    heads: tuple[Head, ...] = (
        *(("case, joint", ""), ("bearing", "")),
        *(("largest element load", "N"), ("the same, at C0", "N")),
        *(("elements loaded, least", ""), ("mean", ""), ("most", ""), ("of", "")),
        *(("turned", "rev"), ("life L10", "")),
        *(("friction torque, mean", "N*m"), ("friction power, mean", "W", True)),
    )
    made = worst_first(heads, rows, 2, "bearings", name="bearings")
    return joined([heading, made, paragraph(words)])


def _percentile(values: np.ndarray, percent: float) -> float | None:
    return float(np.percentile(values, percent)) if len(values) else None


def singles(cases: Sequence[Case]) -> Html:
    """The largest impacts, step by step, each with a button that zooms into it."""
    rows: list[list[Cell]] = []
    for case in cases:
        windows = case.replay.windows if case.replay is not None else ()
        for impact, window in zip(case.impacts, windows, strict=True):
            time = window["time"].values
            force = window["normal_force"].sel(joint=impact.joint, contact=impact.contact)
            zoom = f"{float(time[0])!r},{float(time[-1])!r}"
            button = markup('<button type="button" data-zoom="{}">zoom</button>', zoom)
            label = place_of(case, impact.joint, impact.contact)
            moment = f"{float(time[int(force.values.argmax())]):.5f}"
            steps = impact.steps if impact.complete else f"> {impact.steps}"
            row: list[Cell] = [label, moment, impact.peak_force, impact.penetration, steps]
            rows.append([*row, impact.approach_speed, impact.separation_speed, button])
    if not rows:
        return paragraph("No impact was followed step by step.")
    heads: tuple[Head, ...] = (
        *(("case, place", ""), ("time [s]", ""), ("peak normal force", "N")),
        *(("penetration", "m", True), ("steps in contact", "")),
        *(("approach speed", "m/s", True), ("separation speed", "m/s", True), ("", "")),
    )
    return table(Table.of(heads, rows), name="single-impacts", left=1)


# The runs' judgement of themselves, and their numerical errors.


def audits(cases: Sequence[Case]) -> Html:
    """Audits of the runs."""
    given = [_judged(case) for case in cases]
    made = by_case("of the run", [*map(dark, cases)], given, name="audit-table")
    return made + (bullets(_warnings(cases)) or paragraph("No run has warnings."))


def _warnings(cases: Sequence[Case]) -> list[Html]:
    return [
        markup('{} <strong class="warn">Warning:</strong> {}.', dark(case), warning)
        for case in cases
        for warning in case.result.audit.warnings
    ]


def _judged(case: Case) -> dict[str, Quantity]:
    """Audit figures of a run by name; None where a figure does not apply."""
    audit, result = case.result.audit, case.result
    limit, wall = audit.friction_step_limit, result.dataset.attrs.get("wall_time_s")
    needed = readable(limit, "s", 3) if math.isfinite(limit) else None
    contact: dict[str, Quantity] = {
        "contacts begun": (audit.impacts, ""),
        "shortest contact": (audit.shortest_contact_steps or None, "steps"),
        "contacts under 10 steps": (audit.under_resolved, ""),
        "normal impulse": (audit.normal_impulse, "N*s"),
        "largest penetration": (audit.largest_penetration, "m", True),
        "the same, of the clearance": (audit.penetration_over_clearance, "1"),
        "step that friction needs": (needed, ""),
    }
    drift = audit.loop_drift if "loop_drift" in result.dataset else None
    return {
        "ended": (result.message, ""),
        "energy residual": (audit.energy_residual, "J"),
        "energy exchanged": (audit.energy_exchanged, "J"),
        "residual, of what is exchanged": (audit.relative_energy_residual, "1"),
        **(contact if case.joints else {}),
        "step": (readable(audit.step, "s"), ""),
        "error by the step": (audit.step_error, "m", True),
        "drift of ideal loops": (drift, "m", True),
        "computed in": (None if wall is None else float(wall), "s"),
    }


def certificates(cases: Sequence[Case]) -> Html:
    """Headline figures with their numerical errors; nothing if no run was certified."""
    known = [(case, case.result.certificate) for case in cases]
    given = [(case, certificate) for case, certificate in known if certificate is not None]
    if not given:
        return Html("")
    names = dict.fromkeys(figure.name for _, one in given for figure in one.headline)
    found: list[dict[str, Quantity]] = [
        {name: (_certified(known[name]) if name in known else None, "") for name in names}
        for known in ({figure.name: figure for figure in one.figures} for _, one in given)
    ]
    points: list[str] = []
    for case, one in given:
        others = ", ".join(figure.name for figure in one.marked if figure not in one.headline)
        for words, text in (
            ("of the claims' measures above 5 %:", others),
            ("", one.note),
            ("further runs:", "; ".join(one.runs)),
        ):
            points += [markup("{} {} {}.", dark(case), words, text)] if text else []
    labels = [dark(case) for case, _ in given]
    made = by_case("figure", labels, found, name="certificates")
    heading = Html("<h3>Numerical errors</h3>") + paragraph(note("certificates"))
    return joined([heading, made, bullets(points)])


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
    rows: list[list[Cell]] = []
    at_stops: list[list[Cell]] = []
    unknown: list[Html] = []
    for case in cases:
        if case.error is None:
            continue
        accuracy = analysis.error_statistics(case.error, min(start, float(case.error["time"][-1])))
        for k, axis in enumerate(analysis.COMPONENTS):
            row: list[Cell] = [dark(case), axis, float(accuracy.mean[k])]
            for how, values in (("RMS", accuracy.rms), ("peak", accuracy.peak)):
                name = f"{how} tool error" if axis == "total" else ""
                row.append(_glance_cell(case, start, float(values[k]), name))
            rows.append(row)
        reached, reason = stops(case)
        if reason:
            unknown.append(paragraph(f"{case.label}: its stops are not known: {reason}"))
        for stop in reached:
            at_stops.append(_at_stop(case, stop, "arrival", stop.start))
            if stop.kind == "dwell":
                label, *cells = _at_stop(case, stop, "end of dwell", stop.end)
                at_stops.append([label, *(markup("<strong>{}</strong>", one) for one in cells)])
    if not rows:
        return paragraph("No case has a tool error: nothing has play, or there is no reference.")
    heads = (("case", ""), ("axis", ""), ("mean", "m"), ("RMS", "m"), ("peak", "m"))
    parts = [table(Table.of(heads, rows), note("accuracy", since(start)), left=2), *unknown]
    if at_stops:
        axes = ((f"{axis} [mm]", "") for axis in analysis.COMPONENTS)
        at = (("case", ""), ("reference", ""), ("moment", ""), ("time [s]", ""), *axes)
        parts.append(table(Table.of(at, at_stops), note("stops"), "stops", left=3))
    return joined(parts)


def _at_stop(case: Case, stop: analysis.Stop, what: str, moment: float) -> list[Cell]:
    """The tool's error at a moment of a stop [mm]."""
    assert case.error is not None
    error = map(float, 1e3 * analysis.error_at(case.error, moment))
    return [dark(case), stop.kind, what, f"{moment:.4g}", *error]


def spectra(cases: Sequence[Case], start: float) -> Html:
    """How the spectra were made, and what they sum up to."""
    rows: list[list[Cell]] = []
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
        strongest = [
            float(frequency[above][values[above, k].argmax()]) if above.any() else None
            for k in range(len(AXES))
        ]
        made = density.attrs
        how = (made["sampling_frequency_hz"], made["window_s"], made["windows"])
        rows.append([dark(case), *map(float, rms), *strongest, *how])
    heads: tuple[Head, ...] = (
        ("case", ""),
        *((f"RMS {axis}", "m/s^2") for axis in analysis.COMPONENTS),
        *((f"strongest above 20 Hz, {axis}", "Hz") for axis in AXES),
        *(("sampled at", "Hz"), ("window", "s"), ("windows", "")),
    )
    parts = [table(Table.of(heads, rows))] if rows else []
    return joined([*parts, paragraph(note("spectra")), bullets(missing)])


def glance(cases: Sequence[Case], start: float) -> Html:
    """The figures that matter most, a column for each case, with their numerical errors."""
    found = [_glanced(case, start) for case in cases]
    parts = ["Tool errors are against the ideal machine with the same drives"]
    caption = "; ".join([*parts, f"figures from {start:g} s on"] if start else parts)
    few = [{name: one[name] for name in _GLANCE if name in one} for one in found]
    made = by_case("", [*map(dark, cases)], few, caption=caption, name="glance")
    return joined(
        [
            folded(_answers(cases), "cases"),
            joined(_values_assumed(case, len(cases) > 1) for case in cases),
            markup('<div class="first">{}{}</div>', made, _robot(cases)),
            folded(_warnings(cases), "warnings"),
            bullets(_what_errors_mean(cases, start)),
        ]
    )


def _values_assumed(case: Case, named: bool) -> Html:
    """What nobody gave of a case, to unfold."""
    made = case.result.assumed
    if not made.columns[0].values:
        return Html("")
    of = markup(" in {}", dark(case)) if named else Html("")
    summary = markup("{} values are assumed{}", len(made.columns[0].values), of)
    return details(summary, markup('<div class="assumed">{}</div>', table(made)))


_GLANCE = (
    *("ended", "tool error, peak", "tool error, RMS", "turn of the tool, peak"),
    *("tool error at stops, largest", "force at the joint, peak", "impacts", "warnings"),
)
"""What is told at a glance; the other figures are one fold away."""


def further(cases: Sequence[Case], start: float) -> Html:
    """What `glance` leaves out."""
    found = [_glanced(case, start) for case in cases]
    more = [{name: one[name] for name in one if name not in _GLANCE} for one in found]
    caption = f"Figures from {start:g} s on, the penetration's of the whole run" if start else ""
    return by_case("", [*map(dark, cases)], more, caption=caption)


def _answers(cases: Sequence[Case]) -> list[Html]:
    """What `jointplay run` says first of each case, the largest tool errors first."""
    said: list[tuple[float, Html]] = []
    for case in cases:
        if case.error is not None and analysis.has_play(case.result):
            largest = float(np.linalg.norm(case.error.values, axis=1).max())
            try:
                words = headline(case.result, case.ideal)[0]
            except JointplayError:  # such as a law of the user's own that may not be imported
                continue
            name = markup("{}: ", dark(case)) if len(cases) > 1 else ""
            said.append((largest, markup("{}{}.", name, words)))
    return [words for _, words in sorted(said, key=lambda one: -one[0])]


def _robot(cases: Sequence[Case]) -> Html:
    """A picture of the mechanism with its play marked; nothing if it cannot be built or drawn."""
    from jointplay.show.picture import picture

    shown = next((case for case in cases if analysis.has_play(case.result)), cases[0])
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
    places = [name for name, joint in mechanism.clearance.items() if joint.has_play]
    places += [f"the gear of {name}" for name, gear in mechanism.gears.items() if gear.play > 0.0]
    words += f"; play in {', '.join(places)}" if places else "; nothing has play"
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


def _glanced(case: Case, start: float) -> dict[str, Quantity]:
    """The figures of a case by name; None where one does not apply."""
    audit = case.result.audit
    rms = peak = turn = turned = at_stops = number = force = penetration = None
    where = ""
    if case.error is not None and float(case.error["time"][-1]) >= start:
        accuracy = analysis.error_statistics(case.error, start)
        rms, peak = accuracy.rms[3], accuracy.peak[3]
        ends = [stop.end for stop in stops(case)[0] if stop.at_rest and stop.end > 0.0]
        errors = [float(analysis.error_at(case.error, end)[3]) for end in ends]
        at_stops = max(errors, default=None)
    if case.turn is not None and float(case.turn["time"][-1]) >= start:
        rotation = analysis.error_statistics(case.turn, start)
        turned, turn = rotation.rms[3], rotation.peak[3]
    if (most := strongest(case, start)) is not None:
        where, force = most
        penetration = audit.largest_penetration
        number = audit.impacts if audit.judged_impacts is None else audit.judged_impacts
    noise: dict[str, Quantity] = {}
    if case.joints and start == case.result.judge_from:
        with suppress(JointplayError):  # too few records
            found = analysis.rattle(case.result, case.ideal)
            noise["energy lost per impact"] = found.energy, "J", True
            for band in found.bands:
                noise[f"tool acceleration, {band.range}, RMS"] = band.rms, "m/s^2"
    at = f", {where}" if len(case.joints) > 1 else ""

    def known(value: float | None, name: str) -> Cell:
        return _glance_cell(case, start, value, name)

    return {
        "ended": (case.result.status.name.lower().replace("_", " "), ""),
        "tool error, peak": (known(peak, "peak tool error"), "m"),
        "tool error, RMS": (known(rms, "RMS tool error"), "m"),
        "turn of the tool, peak": (known(turn, "peak tool turn"), "rad"),
        "turn of the tool, RMS": (known(turned, "RMS tool turn"), "rad"),
        "tool error at stops, largest": (at_stops, "m"),
        "force at the joint, peak": (known(force, f"peak joint force{at}"), "N"),
        "impacts": (known(number, "impacts"), ""),
        **noise,
        "penetration, largest": (penetration, "m", True),
        "energy residual, of what is exchanged": (audit.relative_energy_residual, "1"),
        "warnings": (len(audit.warnings), ""),
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
    points: list[Html | str] = [note("errors")] if known else []
    unsure: list[Html | str] = []
    for case in known:
        certificate = case.result.certificate
        assert certificate is not None
        shown = ("peak joint force", "peak tool", "RMS tool", "impacts")
        found = [f.name for f in certificate.headline if f.name.startswith(shown) and f.marked]
        if start == case.result.judge_from and found and case.joints:
            why = f" ({certificate.note})" if certificate.note else ""
            unsure.append(markup("{}: {}{}", dark(case), ", ".join(found), why))
    if unsure:
        points.append(note("uncertain", f"{100.0 * MARKED:g}", bullets(unsure)))
    unknown = [dark(case) for case in cases if case.result.certificate is None and case.joints]
    return [*points, note("unknown", joined(unknown, ", "))] if unknown else points


# What every reader of a report must know, from `assumptions.toml`, and which of it holds when.
#
# The site has the same texts as a page.


@cache
def all_assumptions() -> tuple[tuple[str, str], ...]:
    """In which runs each is made, a key of `conditions`, and its text; in the reports' order."""
    text = (files("jointplay.show.reports") / "assumptions.toml").read_text(encoding="utf-8")
    return tuple((when, one) for when, texts in tomllib.loads(text).items() for one in texts)


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
            joint["kind"] in analysis.SLIDING_KINDS and not joint.get("lubricant")
            for joint in bearings
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
    holds = conditions(cases)
    points = [text for when, text in all_assumptions() if holds[when]]
    if start:
        points.append(note("judged", f"{start:g}"))
    points += [
        markup("{}: {}.", dark(case), case.result.audit.headline_with(case.result.certificate))
        for case in cases
        if case.joints
    ]
    for case in cases:
        points += [markup("{} {}", dark(case), one) for one in case.notes]
    return bullets(points)


def page_section() -> str:
    """The table that the documentation's site has of them."""
    return Table.of_texts([("runs with", "assumed"), *all_assumptions()]).markdown() + "\n"
