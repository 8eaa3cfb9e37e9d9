"""Words and tables of the report."""

from __future__ import annotations

import csv
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from jointplay import analysis
from jointplay.analysis.claims import measure
from jointplay.errors import JointplayError
from jointplay.geometry import Form
from jointplay.plots.accessor import MODE_NAMES
from jointplay.report.assumptions import made
from jointplay.report.cases import Case
from jointplay.report.html import (
    Cell,
    Html,
    bullets,
    details,
    joined,
    markup,
    paragraph,
    table,
)
from jointplay.report.laws import own_laws
from jointplay.result.certificate import CertifiedFigure
from jointplay.result.judging import START_UP
from jointplay.result.result import Result

CLAIM_COLUMNS = ["claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm"]
"""Header of the claims table that `jointplay scara` writes."""

_JOINT_FIELDS: dict[str, tuple[str, str, float]] = {
    "clearance": ("clearance across x, each side", "mm", 1e3),
    "clearance_y": ("clearance across y, each side", "mm", 1e3),
    "length": ("length of the slider", "mm", 1e3),
    "width": ("width of the slider, along x", "mm", 1e3),
    "height": ("height of the slider, along y", "mm", 1e3),
    "corner_radius": ("rounding of the corners", "mm", 1e3),
    "radial_clearance": ("radial clearance C_r", "mm", 1e3),
    "axial_clearance": ("axial clearance C_a, each side", "mm", 1e3),
    "bearing_radius": ("bearing radius R_i", "mm", 1e3),
    "bearing_length": ("bearing length L_i", "mm", 1e3),
    "journal_radius": ("journal radius R_j", "mm", 1e3),
    "journal_length": ("journal length L_j", "mm", 1e3),
    "restitution": ("restitution c_e", "", 1.0),
    "stiffness": ("stiffness k", "N/m^1.5", 1.0),
    "axial_stiffness": ("stiffness k, axial", "N/m^1.5", 1.0),
}

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


def dark(case: Case) -> Html:
    """The case's name with a swatch of its colour."""
    return markup('<span class="case" style="--c:{}">{}</span>', case.colour, case.label)


def settled(cases: Sequence[Case]) -> float:
    """From when on statistics are taken [s]: not while journals fall into their bearings."""
    latest = max(case.result.judge_from for case in cases)
    return latest if min(case.duration for case in cases) > latest else 0.0


def _ms(seconds: float) -> float:
    return 1e3 * seconds


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
            found = analysis.accuracy(case.error, start)
            row += [1e3 * found.rms[3], 1e3 * found.peak[3], None]
            ends = [
                1e3 * float(analysis.error_at(case.error, stop.end)[3])
                for stop in _stops(case)
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


def parameters(cases: Sequence[Case]) -> Html:
    """Every input, a column for each case, then motion and robot in full."""
    columns = [_parameters(case.result) for case in cases]
    names = dict.fromkeys(
        name for column in columns for name, value in column.items() if value is not None
    )
    rows = [[_symbol(name), *(column.get(name) for column in columns)] for name in names]
    found = table(["parameter", *(dark(case) for case in cases)], rows, left=1 + len(cases))
    return joined([found, own_laws(cases), _motions(cases), _robots(cases)])


def _symbol(name: str) -> Html:
    """C_r as a symbol with an index, units with exponents."""
    shown = markup("{}", name)
    for symbol in ("C_r", "C_a", "R_i", "L_i", "R_j", "L_j", "c_e"):
        shown = shown.replace(symbol, markup("<i>{}</i><sub>{}</sub>", *symbol.split("_")))
    for unit, power in (("m^1.5", "1.5"), ("s^2", "2")):
        shown = shown.replace(unit, markup("{}<sup>{}</sup>", unit[0], power))
    return shown


def _parameters(result: Result) -> dict[str, Cell]:
    inputs = analysis.inputs(result)
    robot = inputs["mechanism"]
    known = {"mechanism", "motion", "drive", "duration", "step", "integrator", "record_every"}
    found: dict[str, Cell] = {
        "robot (URDF)": robot.get("urdf"),
        "tool (frame)": robot.get("tool"),
        "gravity, world axes [m/s^2]": ", ".join(f"{g:g}" for g in robot.get("gravity", ())),
    }
    if robot.get("allow_unphysical"):
        found["links with an impossible inertia"] = ", ".join(robot["allow_unphysical"])
    if robot.get("loops"):
        found["closed loops"] = "; ".join(
            f"{name}: {loop.get('bearing_link')} - {loop.get('journal_link')}"
            for name, loop in robot["loops"].items()
        )
    for name, gear in robot.get("gears", {}).items():
        found[f"gear of {name}"] = _plain(gear)
    motion = inputs["motion"]
    found["motion"] = (
        "none" if motion is None else f"{len(motion['times'])} waypoints, {motion['interpolation']}"
    )
    drives = inputs["drive"]
    named = drives.items() if isinstance(drives, dict) else [("all joints", one) for one in drives]
    for name, drive in named:
        found[f"drive of {name}"] = _drive(drive)
    if inputs.get("joint_friction") is not None:
        found["joint friction"] = _plain(inputs["joint_friction"])
    found["time step [µs]"] = 1e6 * float(inputs["step"])
    found["integrator"] = inputs["integrator"]
    found["simulated [s]"] = float(result.time[-1])
    found["steps between records"] = int(inputs["record_every"])
    for name, value in inputs.items():
        if name not in known | {"joint_friction"} and value not in (None, [], {}):
            found[name.replace("_", " ")] = _plain(value)
    derived = _derived_stiffness(result)
    for joint, fields in analysis.clearance_inputs(result).items():
        for name, value in fields.items():
            label, unit, scale = _JOINT_FIELDS.get(name, (name.replace("_", " "), "", 1.0))
            label = f"{joint}: {label}{f' [{unit}]' if unit else ''}"
            if name == "stiffness" and value is None and joint in derived:
                found[label] = markup("{} (eq. 11)", derived[joint])
            elif name == "axial_stiffness" and value is None:
                found[label] = "as radial"
            elif name == "stiffness" and value is None:
                found[label] = "from eq. 11"
            elif isinstance(value, bool):
                found[label] = "yes" if value else None
            elif isinstance(value, (int, float)) and not isinstance(value, bool):
                found[label] = float(value) * scale
            elif isinstance(value, dict):
                found[label] = _law(value)
            else:
                found[label] = value
    versions = json.loads(result.dataset.attrs.get("versions", "{}"))
    found["made with"] = ", ".join(f"{name} {value}" for name, value in versions.items())
    return found


def _drive(fields: dict[str, Any]) -> str:
    """A drive in one line; long tables are counted, not shown."""
    short = {
        name: f"{len(value)} values" if isinstance(value, list) and len(value) > 6 else value
        for name, value in fields.items()
    }
    units = {"bandwidth": "bandwidth [rad/s]"}
    return ", ".join(f"{units.get(name, name)} {_plain(value)}" for name, value in short.items())


def _plain(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name.replace('_', ' ')} {_plain(v)}" for name, v in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_plain(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _law(fields: dict[str, Any]) -> str:
    """A law or a material in one line: its name first."""
    rest = {key: value for key, value in fields.items() if value is not None and key != "source"}
    name = next((str(rest.pop(key)) for key in ("law", "name") if key in rest), "")
    if set(rest) == {"young", "poisson"}:
        return f"E = {rest['young'] / 1e9:g} GPa, ν = {rest['poisson']:g}"
    return " ".join(part for part in (name, _plain(rest) and f"({_plain(rest)})") if part)


def _derived_stiffness(result: Result) -> dict[str, float]:
    try:
        joints = result.simulation.mechanism.clearance
        return {n: joint.contact_properties(0).stiffness for n, joint in joints.items()}
    except JointplayError:  # a law that cannot be imported
        return {}


def _motions(cases: Sequence[Case]) -> Html:
    seen: dict[str, list[str]] = {}
    for case in cases:
        motion = json.dumps(analysis.inputs(case.result)["motion"], sort_keys=True)
        seen.setdefault(motion, []).append(case.label)
    parts = []
    for packed, labels in seen.items():
        motion = json.loads(packed)
        if motion is None:
            continue
        rows = [
            [time, *position]
            for time, position in zip(motion["times"], motion["positions"], strict=True)
        ]
        of = "" if len(seen) == 1 else f" of {', '.join(labels)}"
        head = ["time [s]", *(f"{name} [rad or m]" for name in motion["joints"])]
        parts.append(details(f"Waypoints{of}", table(head, rows[:500], left=0)))
    return joined(parts)


def _robots(cases: Sequence[Case]) -> Html:
    seen: dict[str, list[str]] = {}
    for case in cases:
        source = analysis.inputs(case.result)["mechanism"].get("urdf_text", "")
        seen.setdefault(source, []).append(case.label)
    return joined(
        details(
            "Robot (URDF)" + ("" if len(seen) == 1 else f" of {', '.join(labels)}"),
            markup("<pre>{}</pre>", source),
        )
        for source, labels in seen.items()
        if source
    )


def assumptions(cases: Sequence[Case], start: float) -> Html:
    """What is assumed in these runs and in their evaluation."""
    points = made(cases)
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


def audits(cases: Sequence[Case]) -> Html:
    """The runs' judgement of themselves."""
    head = [
        "case",
        "message",
        "energy residual [J]",
        "exchanged [J]",
        "residual [%]",
        "contacts begun",
        "shortest [steps]",
        "under 10 steps",
        "normal impulse [N s]",
        "largest penetration [µm]",
        "of the clearance [%]",
        "step [µs]",
        "friction needs [µs]",
        "error by the step [µm]",
        "drift of ideal loops [µm]",
        "computed in [s]",
    ]
    rows: list[list[Cell]] = []
    for case in cases:
        audit = case.result.audit
        contact: list[Cell] = [None] * 8
        if case.joints:
            limit = audit.friction_step_limit
            contact = [
                audit.impacts,
                audit.shortest_contact_steps or None,
                audit.under_resolved,
                audit.normal_impulse,
                1e6 * audit.largest_penetration,
                100.0 * audit.penetration_over_clearance,
                1e6 * audit.step,
                1e6 * limit if math.isfinite(limit) else None,
            ]
        wall = case.result.dataset.attrs.get("wall_time_s")
        rows.append(
            [
                dark(case),
                case.result.message,
                audit.energy_residual,
                audit.energy_exchanged,
                100.0 * audit.relative_energy_residual,
                *contact,
                None if audit.step_error is None else 1e6 * audit.step_error,
                1e6 * audit.loop_drift if "loop_drift" in case.result.dataset else None,
                None if wall is None else float(wall),
            ]
        )
    warnings = [
        markup('{} <strong class="warn">Warning:</strong> {}.', dark(case), warning)
        for case in cases
        for warning in case.result.audit.warnings
    ]
    return joined(
        [
            table(head, rows, left=2),
            bullets(warnings) or paragraph("No run has anything to warn of."),
        ]
    )


def certificates(cases: Sequence[Case]) -> Html:
    """Headline figures with their numerical errors; nothing if no run was certified."""
    known = [(case, case.result.certificate) for case in cases]
    given = [(case, found) for case, found in known if found is not None]
    if not given:
        return Html("")
    names = dict.fromkeys(figure.name for _, found in given for figure in found.headline)
    rows: list[list[Cell]] = []
    for name in names:
        row: list[Cell] = [name]
        for _, found in given:
            figure = next((one for one in found.figures if one.name == name), None)
            row.append(None if figure is None else _certified(figure))
        rows.append(row)
    head: list[Cell] = ["figure", *(dark(case) for case, _ in given)]
    points: list[str] = [
        markup("{} of the claims' measures above 5 %: {}.", dark(case), ", ".join(others))
        for case, found in given
        if (others := [one.name for one in found.marked if one not in found.headline])
    ]
    points += [markup("{} {}.", dark(case), found.note) for case, found in given if found.note]
    points += [
        markup("{} further runs: {}.", dark(case), "; ".join(found.runs))
        for case, found in given
        if found.runs
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


def modes(cases: Sequence[Case], start: float) -> Html:
    """Shares of the time in each mode and form."""
    pairs = [(case, joint) for case in cases for joint in case.joints]
    if not pairs:
        return paragraph("No case has clearance.")
    names = [markup("{}, {}", dark(case), joint) for case, joint in pairs]
    found = [analysis.shares(case.result, joint, "mode", start) for case, joint in pairs]
    keys = list(found[0])
    rows: list[list[Cell]] = [
        [name, *(100.0 * share[key] for share in found)]
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
    parts = [table(["mode (Table 1)", *names], rows, "Share of the records in each mode [%]")]
    if form_rows:
        caption = "Share of the records in each form [%]"
        parts.append(table(["form (Figure 2)", *names], form_rows, caption))
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
            name = _place(case, place.joint, place.contact)
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


def _place(case: Case, joint: str, contact: str) -> Html:
    return markup("{}, {}, {}", dark(case), joint, contact.replace("_", " "))


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
                    _place(case, impact.joint, impact.contact),
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


def _stops(case: Case) -> list[analysis.Stop]:
    assert case.error is not None
    try:
        motion = case.result.simulation.motion
    except JointplayError:
        return []
    if motion is None:
        return []
    return analysis.stops(motion, float(case.error["time"][-1]))


def accuracies(cases: Sequence[Case], start: float) -> Html:
    """Tool error per axis over the run, and at the stops of the reference motion."""
    judged = [case for case in cases if case.error is not None]
    if not judged:
        return paragraph("No case has a tool error: none has play, or none has a reference.")
    rows: list[list[Cell]] = []
    for case in judged:
        assert case.error is not None
        found = analysis.accuracy(case.error, min(start, float(case.error["time"][-1])))
        for k, axis in enumerate(analysis.COMPONENTS):
            values = (found.mean, found.rms, found.peak)
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
        for stop in _stops(case):
            moments = [("arrival", stop.start)]
            if stop.kind == "dwell":
                moments.append(("end of dwell", stop.end))
            for what, moment in moments:
                error = 1e3 * analysis.error_at(case.error, moment)
                strong = what == "end of dwell"
                cells: list[Cell] = [stop.kind, what, f"{moment:.4g}"]
                cells += [float(value) for value in error]
                rows.append([dark(case), *(_strong(cell) if strong else cell for cell in cells)])
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


def claim_rows(source: Path | None) -> list[list[str]]:
    """Rows of a claims table, its header first; nothing for no file.

    Raises:
        JointplayError: it cannot be read, or is no such table.
    """
    if source is None:
        return []
    try:
        with source.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise JointplayError(f"cannot read the claims {str(source)!r}: {reason}") from None
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
            [label, *(float(found[key]) for _, found in columns.values())]
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
