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
from functools import cache, partial
from importlib.resources import files
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import read_text
from jointplay.base.tables import Table
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
    Row,
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
from jointplay.simulation.result.certificate import MARKED
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
    if source is not None:
        head, *lines = claim_rows(source)
        verdicts = {"yes": "good", "no": "bad"}
        rows = [
            [a, b, c, markup('<span class="{}">{}</span>', verdicts.get(d, "open"), d), e]
            for a, b, c, d, e in lines
        ]
        caption = f"Ensembles of perturbed runs ({source.name})"
        parts.append(table(Table.of_texts([head, *rows]), caption))
    measures: dict[Html, Row] = {}
    for case in cases:
        if case.ideal is not None and can_be_measured(case.result, case.ideal):
            values = measure(case.result, case.ideal)
            measures[dark(case)] = {name: float(values[key]) for key, name in _MEASURES.items()}
    if measures:
        caption = "What the claims are about, in these single runs"
        parts.append(by_case("measure", [*measures], [*measures.values()], caption))
        parts.append(paragraph(note("single-runs")))
    return joined(parts) or paragraph(note("no-claims"))


# Modes, forms and impacts in joints with clearance.


def modes(cases: Sequence[Case], start: float) -> Html:
    """Shares of the time in each mode and form."""
    pairs = [
        (case, joint)
        for case in cases
        for joint in case.joints
        if not analysis.rolls(case.result, joint)
    ]
    if not pairs:
        return Html("")
    names = [markup("{}, {}", dark(case), joint) for case, joint in pairs]
    paper = is_paper({case.label: case.result for case in cases})

    def shares(what: str, place: str, members: Mapping[str, str]) -> Html:
        """Shares of the time by member, those that occur alone where they are forms."""
        rows: list[Row] = []
        for case, joint in pairs:
            share = analysis.time_fractions(case.result, joint, what, start)
            rows.append({name: (share.get(key), "1") for key, name in members.items()})
        caption = f"Share of the records in each {what}{since(start)}"
        return by_case(f"{what} ({place})" if paper else what, names, rows, caption)

    explained = (
        f"{name} (in the paper: {term}): {meaning}"
        for name, term, meaning in zip(MODES, MODE_TERMS, MODE_MEANINGS, strict=True)
    )
    keys = (mode.name.lower() for mode in Mode)
    parts = [shares("mode", "Table 1", dict(zip(keys, MODES, strict=True)))]
    parts.append(paragraph("; ".join(explained) + "."))
    by_form = [analysis.time_fractions(case.result, j, "form", start) for case, j in pairs]
    occurred = {key for one in by_form for key, share in one.items() if share > 0.0}
    forms = {
        form.name.lower(): f"{form.letter}: {form.name.lower().replace('_', ' ')}"
        if form
        else "no contact"
        for form in Form
        if form.name.lower() in occurred
    }
    return joined([*parts, shares("form", "Figure 2", forms)] if forms else parts)


def impacts(cases: Sequence[Case], start: float) -> Html:
    """Statistics of contacts by joint and place."""

    def percentile(values: np.ndarray, percent: float) -> float | None:
        return float(np.percentile(values, percent)) if len(values) else None

    rows: list[Row] = []
    for case in cases:
        for place in analysis.contacts(case.result, start):
            onsets = rate = impulse = shortest = None
            if case.replay is not None:
                exact = case.replay.statistics.sel(joint=place.joint, contact=place.contact)
                onsets, impulse = int(exact["onsets"]), float(exact["impulse"])
                rate, steps = onsets / case.duration, float(exact["shortest_steps"])
                shortest = int(steps) if math.isfinite(steps) else None
            rows.append(
                {
                    "case, place": place_of(case, place.joint, place.contact),
                    "contacts begun": onsets,
                    "rate": (rate, "1/s"),
                    "normal impulse": (impulse, "N*s"),
                    "shortest": (shortest, "steps"),
                    "time in contact": (place.share, "1"),
                    "duration, median": (percentile(place.duration, 50), "s", True),
                    "duration, 95 %": (percentile(place.duration, 95), "s", True),
                    "peak force, median": (percentile(place.peak, 50), "N"),
                    "peak force, 95 %": (percentile(place.peak, 95), "N"),
                    "peak force, largest": (percentile(place.peak, 100), "N"),
                }
            )
    intervals = {1e3 * float(np.median(np.diff(case.result.time))) for case in cases if case.joints}
    spacing = ", ".join(f"{value:g}" for value in sorted(intervals))
    return worst_first(rows, "peak force, largest", "places") + paragraph(note("impacts", spacing))


def loads(cases: Sequence[Case], start: float) -> Html:
    """The largest force in each joint with clearance; nothing for one joint: a glance has it."""
    rows: list[Row] = [
        {"case": dark(case), "joint": joint, "largest force": (force, "N")}
        for case in cases
        if len(case.joints) > 1
        for joint, force in joint_forces(case, start).items()
    ]
    return worst_first(rows, "largest force", "joints") if rows else Html("")


def bearings(cases: Sequence[Case], start: float) -> Html:
    """Loads, life and friction of rolling bearings; nothing without any."""
    rows: list[Row] = []
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
                    "largest element load": (life.largest_load, "N"),
                    "the same, at C0": (life.rated_load, "N"),
                    "elements loaded, least": int(loaded.min()),
                    "mean": float(loaded.mean()),
                    "most": life.most_loaded,
                    "of": life.elements,
                    "turned": (life.turned, "rev"),
                    "life L10": life.lasting,
                    "friction torque, mean": (life.mean_torque, "N*m"),
                    "friction power, mean": (life.friction_power, "W", True),
                }
            )
    if not rows:
        return Html("")
    made = worst_first(rows, "largest element load", "bearings", "bearings")
    words = paragraph(note("bearings") + (note("swings") if swings else ""))
    return joined([Html("<h3>Rolling bearings</h3>"), made, words])


def singles(cases: Sequence[Case]) -> Html:
    """The largest impacts, step by step, each with a button that zooms into it."""
    rows: list[Row] = []
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
                    "peak normal force": (impact.peak_force, "N"),
                    "penetration": (impact.penetration, "m", True),
                    "steps in contact": impact.steps if impact.complete else f"> {impact.steps}",
                    "approach speed": (impact.approach_speed, "m/s", True),
                    "separation speed": (impact.separation_speed, "m/s", True),
                    "": markup('<button type="button" data-zoom="{}">zoom</button>', zoom),
                }
            )
    if not rows:
        return paragraph("No impact was followed step by step.")
    return table(rows, name="single-impacts", left=1)


# The runs' judgement of themselves, and their numerical errors.


def audits(cases: Sequence[Case]) -> Html:
    """Audits of the runs: their own figures, and their warnings; nothing where one has none."""
    figures: list[Row] = []
    for case in cases:
        audit, result = case.result.audit, case.result
        limit, wall = audit.friction_step_limit, result.dataset.attrs.get("wall_time_s")
        contact: Row = {
            "contacts begun": audit.impacts,
            "shortest contact": (audit.shortest_contact_steps or None, "steps"),
            "contacts under 10 steps": audit.under_resolved,
            "normal impulse": (audit.normal_impulse, "N*s"),
            "largest penetration": (audit.largest_penetration, "m", True),
            "the same, of the clearance": (audit.penetration_over_clearance, "1"),
            "step that friction needs": readable(limit, "s", 3) if math.isfinite(limit) else None,
        }
        drift = audit.loop_drift if "loop_drift" in result.dataset else None
        figures.append(
            {
                "ended": result.message,
                "energy residual": (audit.energy_residual, "J"),
                "energy exchanged": (audit.energy_exchanged, "J"),
                "residual, of what is exchanged": (audit.relative_energy_residual, "1"),
                **(contact if case.joints else {}),
                "step": readable(audit.step, "s"),
                "error by the step": (audit.step_error, "m", True),
                "drift of ideal loops": (drift, "m", True),
                "computed in": (None if wall is None else float(wall), "s"),
            }
        )
    made = by_case("of the run", [*map(dark, cases)], figures, name="audit-table")
    return made + (bullets(_warnings(cases)) or paragraph("No run has warnings."))


def _warnings(cases: Sequence[Case]) -> list[Html]:
    return [
        markup('{} <strong class="warn">Warning:</strong> {}.', dark(case), warning)
        for case in cases
        for warning in case.result.audit.warnings
    ]


def certificates(cases: Sequence[Case]) -> Html:
    """Headline figures with their numerical errors; nothing if no run was certified."""
    each = [(case, case.result.certificate) for case in cases]
    given = [(case, certificate) for case, certificate in each if certificate is not None]
    if not given:
        return Html("")
    names = dict.fromkeys(one.name for _, certificate in given for one in certificate.headline)
    figures: list[Row] = []
    points: list[Html] = []
    for case, certificate in given:
        pattern = {True: '<strong class="warn">{} (!)</strong>', False: "{}"}
        known = {one.name: markup(pattern[one.marked], str(one)) for one in certificate.figures}
        figures.append({name: known.get(name) for name in names})
        further = [one.name for one in certificate.marked if one not in certificate.headline]
        for words, text in (
            ("of the claims' measures above 5 %:", ", ".join(further)),
            ("", certificate.note),
            ("further runs:", "; ".join(certificate.runs)),
        ):
            points += [markup("{} {} {}.", dark(case), words, text)] if text else []
    made = by_case("figure", [dark(case) for case, _ in given], figures, name="certificates")
    heading = Html("<h3>Numerical errors</h3>") + paragraph(note("certificates"))
    return joined([heading, made, bullets(points)])


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
    rows: list[Row] = []
    at_stops: list[Row] = []
    unknown: list[Html] = []
    for case in cases:
        if case.error is None:
            continue
        accuracy = analysis.error_statistics(case.error, min(start, float(case.error["time"][-1])))
        for k, axis in enumerate(analysis.COMPONENTS):
            row: dict[str, Quantity] = {"case": dark(case), "axis": axis}
            row["mean"] = float(accuracy.mean[k]), "m"
            for how, values in (("RMS", accuracy.rms), ("peak", accuracy.peak)):
                name = f"{how} tool error" if axis == "total" else ""
                row[how] = _with_error(case, start, float(values[k]), name), "m"
            rows.append(row)
        reached, reason = stops(case)
        if reason:
            unknown.append(paragraph(f"{case.label}: its stops are not known: {reason}"))
        for stop in reached:
            moments = [("arrival", stop.start, "{}")]
            if stop.kind == "dwell":
                moments.append(("end of dwell", stop.end, "<strong>{}</strong>"))
            for what, moment, pattern in moments:
                error = map(float, 1e3 * analysis.error_at(case.error, moment))
                cells = (f"{moment:.4g}", *error)
                heads = ("time [s]", *(f"{axis} [mm]" for axis in analysis.COMPONENTS))
                shown = {h: markup(pattern, cell) for h, cell in zip(heads, cells, strict=True)}
                at_stops.append(
                    {"case": dark(case), "reference": stop.kind, "moment": what, **shown}
                )
    if not rows:
        return paragraph("No case has a tool error: nothing has play, or there is no reference.")
    parts = [table(rows, note("accuracy", since(start)), left=2), *unknown]
    if at_stops:
        parts.append(table(at_stops, note("stops"), "stops", left=3))
    return joined(parts)


def spectra(cases: Sequence[Case], start: float) -> Html:
    """How the spectra were made, and what they sum up to."""
    rows: list[Row] = []
    missing: list[str] = []
    for case in cases:
        try:
            density = analysis.spectrum(case.result, start=start)
        except JointplayError as error:
            missing.append(f"{case.label}: no spectrum, {error}.")
            continue
        frequency, values = density["frequency"].values, density.values
        width = float(frequency[1] - frequency[0])
        above = frequency >= 20.0
        row: dict[str, Quantity] = {"case": dark(case)}
        for axis, column in zip(analysis.COMPONENTS, values.T, strict=True):
            row[f"RMS {axis}"] = float(np.sqrt(column[1:].sum() * width)), "m/s^2"
        for axis, column in zip(AXES, values.T, strict=False):
            strongest = float(frequency[above][column[above].argmax()]) if above.any() else None
            row[f"strongest above 20 Hz, {axis}"] = strongest, "Hz"
        row["sampled at"] = density.attrs["sampling_frequency_hz"], "Hz"
        row["window"] = density.attrs["window_s"], "s"
        rows.append(row | {"windows": density.attrs["windows"]})
    parts = [table(rows)] if rows else []
    return joined([*parts, paragraph(note("spectra")), bullets(missing)])


# The first screen: what `jointplay run` says first, the figures that matter most, the machine.


def glance(cases: Sequence[Case], start: float) -> Html:
    """The figures that matter most, a column for each case, with their numerical errors."""
    same = "Tool errors are against the ideal machine with the same drives"
    parts = [f"{same}, whose own errors they leave out"]
    caption = "; ".join([*parts, f"figures from {start:g} s on"] if start else parts)
    figures = [_figures(case, start)[0] for case in cases]
    made = by_case("", [*map(dark, cases)], figures, caption, "glance")
    answers: list[tuple[float, Html]] = []  # the largest tool errors first
    assumed: list[Html] = []
    for case in cases:
        several = len(cases) > 1
        if case.error is not None and analysis.has_play(case.result):
            largest = float(np.linalg.norm(case.error.values, axis=1).max())
            with suppress(JointplayError):  # a law of the user's own that may not be imported
                words = headline(case.result, case.ideal)[0]
                name = markup("{}: ", dark(case)) if several else ""
                answers.append((largest, markup("{}{}.", name, words)))
        values = case.result.assumed
        if number := len(values.columns[0].values):
            of = markup(" in {}", dark(case)) if several else ""
            shown = markup('<div class="assumed">{}</div>', table(values))
            are = "value is" if number == 1 else "values are"
            assumed.append(details(markup("{} {} assumed{}", number, are, of), shown))
    answers.sort(key=lambda answer: -answer[0])
    return joined(
        [
            folded([words for _, words in answers], "cases"),
            *assumed,
            markup('<div class="first">{}{}</div>', made, _robot(cases)),
            folded(_warnings(cases), "warnings"),
            bullets(_what_errors_mean(cases, start)),
        ]
    )


def further(cases: Sequence[Case], start: float) -> Html:
    """What `glance` leaves out."""
    caption = f"Figures from {start:g} s on, the penetration's of the whole run" if start else ""
    return by_case("", [*map(dark, cases)], [_figures(case, start)[1] for case in cases], caption)


def _figures(case: Case, start: float) -> tuple[Row, Row]:
    """The figures of a case: those told at a glance, and the others; None where one is unknown."""
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
    vibration: dict[str, Quantity] = {}
    if case.joints and start == case.result.judge_from:
        with suppress(JointplayError):  # too few records
            rattle = analysis.rattle(case.result, case.ideal)
            vibration["energy lost per impact"] = rattle.energy, "J", True
            for band in rattle.bands:
                vibration[f"tool acceleration, {band.range}, RMS"] = band.rms, "m/s^2"
    at = f", {where}" if len(case.joints) > 1 else ""
    known = partial(_with_error, case, start)
    first: Row = {
        "ended": case.result.status.name.lower().replace("_", " "),
        "tool error, peak": (known(peak, "peak tool error"), "m"),
        "tool error, RMS": (known(rms, "RMS tool error"), "m"),
        "turn of the tool, peak": (known(turn, "peak tool turn"), "rad"),
        "tool error at stops, largest": (at_stops, "m"),
        "force at the joint, peak": (known(force, f"peak joint force{at}"), "N"),
        "impacts": known(number, "impacts"),
        "warnings": len(audit.warnings),
    }
    return first, {
        "turn of the tool, RMS": (known(turned, "RMS tool turn"), "rad"),
        **vibration,
        "penetration, largest": (penetration, "m", True),
        "energy residual, of what is exchanged": (audit.relative_energy_residual, "1"),
    }


def _with_error(case: Case, start: float, value: float | None, name: str) -> Cell:
    """A value with its numerical error, if that is of the time judged, marked where it is large."""
    certificate = case.result.certificate
    if value is None or certificate is None or start != case.result.judge_from:
        return value
    figure = next((one for one in certificate.figures if one.name == name), None)
    if figure is None:
        return value
    pattern = '{}<br><strong class="warn">uncertain</strong>' if figure.marked else "{}"
    return markup(pattern, figure.number)


def _robot(cases: Sequence[Case]) -> Html:
    """A picture of the mechanism with its play marked; nothing if it cannot be built or drawn."""
    from jointplay.show.picture import picture

    shown = next((case for case in cases if analysis.has_play(case.result)), cases[0])
    try:
        mechanism = shown.result.simulation.mechanism
        labels = {}
        for name in shown.joints:
            having = (case.result.simulation.mechanism for case in cases if name in case.joints)
            plays = {one.clearance[name].play_words for one in having}
            labels[name] = f"{name}\nplay {plays.pop()}" if len(plays) == 1 else f"{name}: play"
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


def _what_errors_mean(cases: Sequence[Case], start: float) -> list[Html]:
    """What ± and its absence stand for, and what to do about large errors."""
    certified = False
    unsure: list[Html] = []
    unknown: list[Html] = []
    for case in cases:
        certificate = case.result.certificate
        if certificate is None:
            unknown += [dark(case)] if case.joints else []
            continue
        certified = True
        shown = ("peak joint force", "peak tool", "RMS tool", "impacts")
        large = [f.name for f in certificate.headline if f.name.startswith(shown) and f.marked]
        if start == case.result.judge_from and large and case.joints:
            why = f" ({certificate.note})" if certificate.note else ""
            unsure.append(markup("{}: {}{}", dark(case), ", ".join(large), why))
    points = [note("errors")] if certified else []
    if unsure:
        points.append(note("uncertain", f"{100.0 * MARKED:g}", bullets(unsure)))
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
    machines = [given["mechanism"] for given in inputs]
    moving = [given for case, given in zip(cases, inputs, strict=True) if case.joints]
    joints = [one for case in cases for one in analysis.clearance_inputs(case.result).values()]
    gears = [gear for machine in machines for gear in (machine.get("gears") or {}).values()]
    kinds = {joint["kind"] for joint in joints}
    drives = [json.dumps(given["drive"]) for given in inputs]
    return {
        "always": True,
        "clearance": bool(moving),
        "sliding": bool(kinds & analysis.SLIDING_KINDS),
        "rolling": bool(kinds & analysis.ROLLING_KINDS),
        "dry": any(
            joint["kind"] in analysis.SLIDING_KINDS and not joint.get("lubricant")
            for joint in joints
        ),
        "oil": any(joint.get("lubricant") for joint in joints),
        "worn": any(joint.get("worn") for joint in joints),
        "wearing": any(
            joint.get("wear_rate") or joint.get("journal_wear_rate") for joint in joints
        ),
        **{kind: kind in kinds for kind in JOINT_KINDS},
        "loops": any(machine.get("loops") for machine in machines),
        "gears": bool(gears),
        "refined gears": any(gear.get("kind", Gear.kind) != Gear.kind for gear in gears),
        "computed torque": any("computed-torque" in drive for drive in drives),
        "prescribed": any("prescribed" in drive for drive in drives),
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
        "balanced": any(not any(machine.get("gravity", (1,))) for machine in machines),
        "unphysical": any(machine.get("allow_unphysical") for machine in machines),
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
