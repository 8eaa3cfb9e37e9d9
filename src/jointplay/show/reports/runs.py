"""The blocks of a report on runs, in its order: what each shows, assumes and comes from."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import read_text
from jointplay.base.tables import Table, few
from jointplay.base.units import readable
from jointplay.physics.geometry import Form, Mode
from jointplay.show.plots import figures
from jointplay.show.plots.chart import Axis, Curve, Panel, Rule, Spans
from jointplay.show.plots.names import MODE_MEANINGS, MODE_TERMS, MODES, PAPER, robot_of
from jointplay.show.reports.assumptions import all_assumptions, conditions
from jointplay.show.reports.cases import Case, Runs
from jointplay.show.reports.charts import MAX_RECORDS
from jointplay.show.reports.html import Html, joined, markup, paragraph
from jointplay.show.reports.inputs import parameters
from jointplay.show.reports.parts import (
    Beside,
    Block,
    Cell,
    Drawing,
    Fold,
    Graph,
    Grid,
    Part,
    Points,
    Row,
    block,
)
from jointplay.simulation import analysis
from jointplay.simulation.analysis.bearings import Contacts
from jointplay.simulation.analysis.claims import CLAIM_COLUMNS, can_be_measured, measure
from jointplay.simulation.analysis.headline import headline
from jointplay.simulation.analysis.parts import DECISIVE
from jointplay.simulation.result.certificate import MARKED
from jointplay.simulation.result.result import AXES, Result

BLOCKS: list[Block] = []

_ORBITS = 3  # of the cases with the largest forces, at a glance
_VALUES = 6  # assumed ones that are named before they are unfolded


@block(BLOCKS, "At a glance", folded=False)
def glance(runs: Runs) -> Iterator[Part]:
    """What `jointplay run` says first, the figures that matter most, the machine, three charts."""
    answers: list[tuple[float, Html]] = []  # the largest tool errors first
    for case in runs.cases:
        if case.error is not None and analysis.has_play(case.result):
            largest = float(np.linalg.norm(case.error.values, axis=1).max())
            with suppress(JointplayError):  # a law of the user's own that may not be imported
                sentence = headline(case.result)[0]
                answers.append((largest, markup("{}{}.", case.prefix, sentence)))
    answers.sort(key=lambda answer: -answer[0])
    yield Points([sentence for _, sentence in answers], "case")
    yield from _assumed_values(runs)
    caption = "Tool errors are against the ideal machine with the same drives, whose own errors "
    caption += f"they leave out{f'; figures from {runs.start:g} s on' if runs.start else ''}"
    grid = runs.by_case(lambda case: _figures(runs, case), caption=caption, name="glance")
    notes = [Points(_warnings(runs), "warning"), *_doubts(runs)]
    narrow = [grid, *notes] if len(runs.cases) == 1 else [grid]
    picture = _picture(runs)
    yield Beside([narrow, [picture]] if picture else [narrow])
    yield from notes if len(runs.cases) > 1 else ()
    judged = [case for case in runs.cases if case.error is not None]
    angle = all(case.result.tool_error.is_angle for case in judged)
    of = f"tool_{'orientation' if angle else 'position'}"
    errors = [
        runs.detailed[case.label]
        .plot.panel("deviation", "total", of=of)
        .styled(colour=case.colour, name=case.label)
        for case in judged
    ]
    for k, case in enumerate(judged):
        if not angle and (off := case.sent) is not None:
            size = np.linalg.norm(off.reported.values, axis=1)
            name = off.against if case.alone else f"{case.label}, {off.against}"
            curve = Curve(off.reported["time"].values, size, name, case.colour, line="--")
            errors[k] = errors[k].with_marks(curve)
    if errors:
        panel = figures.overlaid(errors).renamed("tool turn" if angle else "tool error")
        title = "Tool error: distance from the ideal mechanism with the same drives"
        title = "Turn of the tool against the ideal mechanism" if angle else title
        yield from _graph(runs, "first_error", title, [panel])
    else:
        panels = figures.tool_panels(runs.detailed, "tool_position")
        yield from _graph(runs, "tool_displacement", "Displacement of the tool", panels)
    yield from _heaviest(runs)


def _heaviest(runs: Runs) -> Iterator[Part]:
    """Orbit and force of the joint with clearance that carries most."""
    forces = {case.label: _joint_forces(case, runs.start) for case in runs.cases}
    largest = [(force, joint) for by_joint in forces.values() for joint, force in by_joint.items()]
    if not largest:
        return
    _, joint = max(largest)
    cases = [case for case in runs.cases if joint in case.joints]
    loaded = sorted(cases, key=lambda case: forces[case.label][joint])[-_ORBITS:]
    pairs = zip(cases, figures.orbit_panels(runs.detailed, [joint]), strict=True)
    shown = [pair for case, pair in pairs if case in loaded]
    # Of one the nearer rim stands beside the middle, which stays inside where a journal tilts.
    orbits = [panel for pair in shown for panel in pair[: 2 if len(shown) == 1 else 1] if panel]
    carries = ", which carries most" if len(runs.joints) > 1 else ""
    over = figures.overlaid(
        runs.detailed[case.label]
        .plot.panel("forces", "total", joint)
        .styled(colour=case.colour, width=0.8, name=case.label)
        for case in cases
    ).renamed("contact force")
    title = f"Centre in the bearing of {joint}{carries}, with its clearance"
    yield from _graph(runs, "first_orbit", title, orbits)
    yield from _graph(runs, "first_force", f"Contact force in {joint}{carries}", [over])


def _assumed_values(runs: Runs) -> Iterator[Fold]:
    """What nobody gave: values that decide in sight, all with their effects to unfold."""
    tables: dict[str, tuple[Table, list[Case]]] = {}
    for case in runs.cases:
        table = case.result.assumed
        tables.setdefault(str(table), (table, []))[1].append(case)
    for table, cases in tables.values():
        keys, values = (column.values for column in table.columns[:2])
        if not len(keys):
            continue
        decisive: list[str] = []
        others: list[str] = []
        for key, value in zip(keys, values, strict=True):
            name = key.rpartition(".")[2]
            kind = f"{key.partition('.')[0].removesuffix('s')} " if name == "kind" else ""
            known = decisive if name in ("motion", *DECISIVE) else others
            known.append(f"{kind}{name.replace('_', ' ')} {value}")
        named = decisive + others
        number = f"{len(named)} value{'s are' if len(named) > 1 else ' is'} assumed"
        of = Html(" in ") + joined(map(markup, ["{}"] * len(cases), cases), ", ")
        of = of if len(cases) < len(runs.cases) else Html("")
        summary = markup("{}{}: {}", number, of, few(named, _VALUES))
        yield Fold(summary, [Grid.of_table(table, name="assumed")])


def _figures(runs: Runs, case: Case) -> Row:
    """The figures of a case at a glance; None where one is unknown."""
    start, audit = runs.start, case.result.audit
    rms = peak = turn = turn_rms = at_stops = impacts = force = energy = None
    sent: dict[str, Any] = {}
    joint = ""
    if case.error is not None and float(case.error["time"][-1]) >= start:
        accuracy = analysis.error_statistics(case.error, start)
        rms, peak = accuracy.rms[3], accuracy.peak[3]
        ends = [stop.end for stop in _stops(case)[0] if stop.at_rest and stop.end > 0.0]
        errors = [float(analysis.error_at(case.error, end)[3]) for end in ends]
        at_stops = max(errors, default=None)
        if (off := case.sent) is not None:
            known_off = analysis.error_statistics(off.reported, start)
            sent[f"tool {off.against}, peak"] = known_off.peak[3], "m"
            sent[f"tool {off.against}, RMS"] = known_off.rms[3], "m"
    if case.turn is not None and float(case.turn["time"][-1]) >= start:
        rotation = analysis.error_statistics(case.turn, start)
        turn_rms, turn = rotation.rms[3], rotation.peak[3]
    if forces := _joint_forces(case, start):
        joint, force = max(forces.items(), key=lambda item: item[1])
        impacts = audit.judged_impacts
    if (rattle := _rattle(runs, case)) is not None:
        energy = rattle.energy or None
    at = f", {joint}" if len(case.joints) > 1 else ""

    def known(value: float | None, name: str) -> Any:
        return _with_error(case, start, value, name)

    return {
        "ended": case.result.status.name.lower().replace("_", " "),
        **sent,
        "tool error, peak": (known(peak, "peak tool error"), "m"),
        "tool error, RMS": (known(rms, "RMS tool error"), "m"),
        "turn of the tool, peak": (known(turn, "peak tool turn"), "rad"),
        "turn of the tool, RMS": (known(turn_rms, "RMS tool turn"), "rad"),
        "tool error at stops, largest": (at_stops, "m"),
        "force at the joint, peak": (known(force, f"peak joint force{at}"), "N"),
        "impacts": known(impacts, "impacts"),
        "energy lost per impact": (energy, "J", True),
        "warnings": len(audit.warnings),
    }


def _rattle(runs: Runs, case: Case) -> analysis.Rattle | None:
    if case.joints and runs.start == case.result.judge_from:
        with suppress(JointplayError):  # too few records
            return analysis.rattle(case.result)
    return None


def _with_error(case: Case, start: float, value: float | None, name: str) -> Cell:
    """A value with its numerical error, if that is of the time judged, marked where it is large."""
    certificate = case.result.certificate
    if value is None or certificate is None or start != case.result.judge_from:
        return value
    figure = next((figure for figure in certificate.figures if figure.name == name), None)
    if figure is None:
        return value
    pattern = '{} <strong class="warn">uncertain</strong>' if figure.marked else "{}"
    return markup(pattern, figure.number)


def _joint_forces(case: Case, start: float) -> dict[str, float]:
    """The largest force in each joint with clearance from `start` on [N]."""
    if not case.joints:
        return {}
    forces = case.result["joint_force_peak"].values[case.result.time >= start]
    largest = np.linalg.norm(forces, axis=2).max(axis=0, initial=0.0)
    return dict(zip(case.joints, map(float, largest), strict=True))


def _picture(runs: Runs) -> Drawing | None:
    """The mechanism with its play marked; nothing if it cannot be built or drawn."""
    from jointplay.show.picture import picture

    shown = next((case for case in runs.cases if analysis.has_play(case.result)), runs.cases[0])
    try:
        mechanism = shown.result.simulation.mechanism
        labels = {}
        for name in shown.joints:
            machines = (
                case.result.simulation.mechanism for case in runs.cases if name in case.joints
            )
            plays = {machine.clearance[name].play_words for machine in machines}
            labels[name] = f"{name}\nplay {plays.pop()}" if len(plays) == 1 else f"{name}: play"
        q = shown.result["q"].values[0]
        # Letters that can be read in half a page.
        figure = picture(mechanism, q, labels=labels, size_in=(6.0, 4.1))
    except JointplayError:  # such as a law of the user's own that may not be imported
        return None
    places = [name for name, joint in mechanism.clearance.items() if joint.has_play]
    places += [f"the gear of {name}" for name, gear in mechanism.gears.items() if gear.play > 0.0]
    play = f"play in {', '.join(places)}" if places else "nothing has play"
    return Drawing(f"{robot_of(shown.result)} at the start of the run; {play}", figure, "png")


def _warnings(runs: Runs) -> list[Html]:
    return [
        markup('{} <strong class="warn">Warning:</strong> {}.', case, warning)
        for case in runs.cases
        for warning in case.result.audit.warnings
    ]


def _doubts(runs: Runs) -> Iterator[Part]:
    """What ± and its absence stand for, and what to do about large errors."""
    certified = False
    unsure: list[str] = []
    unknown: list[Html] = []
    for case in runs.cases:
        certificate = case.result.certificate
        if certificate is None:
            unknown += [markup("{}", case)] if case.joints else []
            continue
        certified = True
        shown = ("peak joint force", "peak tool", "RMS tool", "impacts")
        large = [f.name for f in certificate.headline if f.name.startswith(shown) and f.marked]
        if runs.start == case.result.judge_from and large and case.joints:
            why = f" ({certificate.note})" if certificate.note else ""
            unsure.append(markup("{}{}{}", case.prefix, ", ".join(large), why))
    points = []
    if certified:
        points.append(
            "±: numerical error, within which 9 of 10 figures are of what the model says. It does "
            "not say how well the model fits the machine."
        )
    if unknown:
        which = joined(unknown, ", ")
        unknown_are = "{} numerical errors are not known; jointplay run --certify finds them."
        points.append(markup(unknown_are, which))
    yield Points(points)
    if unsure:
        summary = markup(
            '<strong class="warn">Uncertain:</strong> the numerical error exceeds {} % of the value'
            " (of a count, 1). Do not compare designs by smaller differences. A smaller tolerance "
            "or step (integration.tolerance, integration.step) helps where the step is the cause; "
            "where the motion itself magnifies small differences, only means over perturbed runs "
            "can be compared (jointplay study sweep, repeats).",
            f"{100.0 * MARKED:g}",
        )
        yield Fold(summary, [Points(unsure)])


block(BLOCKS, "Parameters")(parameters)


@block(BLOCKS, "Assumptions")
def assumptions(runs: Runs) -> Iterator[Part]:
    """What holds in these runs, and from when on they are judged."""
    holds = conditions(runs.cases)
    points = [sentence for when, sentence in all_assumptions() if holds[when]]
    if runs.start:
        points.append(
            "Tool accuracy, peak force, contact statistics, shares of time and spectra are judged "
            f"from {runs.start:g} s on; penetration and audit are those of whole runs."
        )
    for case in runs.cases:
        verdict = case.result.audit.headline_with(case.result.certificate)
        notes = [f"{verdict}.", *case.notes] if case.joints else case.notes
        points += [markup("{}{}", case.prefix, note) for note in notes]
    yield Points(points)


@block(BLOCKS, "Audit")
def audits(runs: Runs) -> Iterator[Part]:
    """Energy, steps, contacts and numerical errors of each run, by its own judgement."""
    yield runs.by_case(_audit, "of the run", name="audit-table")
    yield Points(_warnings(runs) or ["No run has warnings."])
    panels = [
        replace(case.result.plot.panel("energy"), title="" if case.alone else case.label)
        for case in runs.cases
    ]
    yield from _graph(runs, "energy", "Energy balance", panels)
    certified = [case for case in runs.cases if case.result.certificate is not None]
    if certified:
        yield from _certificates(certified)


def _audit(case: Case) -> Row:
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
    return {
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


def _certificates(cases: Sequence[Case]) -> Iterator[Part]:
    yield markup("<h3>Numerical errors</h3><p>{}</p>", (
        "Figures of the runs with their numerical errors, found by repeating the runs with steps "
        "chosen by their error: estimated from two further runs, or three where they leave an "
        "error above 0.5 %, certified by three. Those with errors above 5 % are marked."
    ))  # fmt: skip
    columns: list[Row] = []
    points: list[Html] = []
    for case in cases:
        certificate = case.result.certificate
        assert certificate is not None
        pattern = {True: '<strong class="warn">{} (!)</strong>', False: "{}"}
        headlines = certificate.headline
        columns.append(
            {figure.name: markup(pattern[figure.marked], str(figure)) for figure in headlines}
        )
        further = [figure.name for figure in certificate.marked if figure not in headlines]
        for label, text in (
            ("of the claims' measures above 5 %: ", ", ".join(further)),
            ("", certificate.note),
            ("further runs: ", "; ".join(certificate.runs)),
        ):
            points += [markup("{}{}{}.", case.prefix, label, text)] if text else []
    yield Grid.of_cases("figure", cases, columns)
    yield Points(points)


@block(BLOCKS, "Motion of the tool")
def motion(runs: Runs) -> Iterator[Part]:
    """Displacement, velocity and path, and how they differ from the ideal."""
    hint = (
        "Drag across a chart in time to zoom; all charts in time follow, and the paths and orbits "
        "show that time only. Double-click, or “whole run” above, to go back. Where an impact was "
        "followed step by step, each step is a point."
    )
    if runs.start:
        hint += (
            f" Charts begin at {runs.start:g} s, from which on the tables judge the runs; “whole "
            "run” shows also how the journals settle before."
        )
    if long := [case.label for case in runs.cases if len(case.result.time) > MAX_RECORDS]:
        hint += (
            f" Of {', '.join(long)} the smallest and the largest record of each of "
            f"{MAX_RECORDS // 2} intervals are shown."
        )
    yield markup('<p class="screen">{}</p>', hint)
    axes = figures.moving_axes(runs.detailed)
    along = f" (along {' and '.join(axes)}, the others are at rest)" if len(axes) < 3 else ""
    errors = any(case.error is not None for case in runs.cases)
    for of, quantity in (("position", "displacement"), ("velocity", "velocity")):
        title = f"{quantity.capitalize()} of the tool{along}"
        if of == "velocity" or errors:  # else it stands at a glance
            panels = figures.tool_panels(runs.detailed, f"tool_{of}")
            yield from _graph(runs, f"tool_{quantity}", title, panels)
        panels = figures.difference_panels(runs.detailed, f"tool_{of}")
        title += ", less the ideal mechanism's"
        yield from _graph(runs, f"tool_{quantity}_error", title, panels)
    if not figures.is_straight(runs.detailed):
        plane = figures.plane_of(runs.recorded)
        where = "the XOY plane" if runs.paper and plane == "xy" else f"the {plane} plane"
        panels = [figures.path_panel(runs.detailed)]
        yield from _graph(runs, "tool_path", f"Path of the tool in {where}", panels)


@block(BLOCKS, "Accuracy")
def accuracy(runs: Runs) -> Iterator[Part]:
    """Tool error by axis, and at each stop."""
    rows: list[Row] = []
    at_stops: list[Row] = []
    unknown: list[Html] = []
    for case in runs.cases:
        if case.error is None:
            continue
        start = min(runs.start, float(case.error["time"][-1]))
        statistics = analysis.error_statistics(case.error, start)
        for k, axis in enumerate(analysis.COMPONENTS):
            row: dict[str, Any] = {"case": case, "axis": axis}
            row["mean"] = float(statistics.mean[k]), "m"
            for how, values in (("RMS", statistics.rms), ("peak", statistics.peak)):
                name = f"{how} tool error" if axis == "total" else ""
                row[how] = _with_error(case, runs.start, float(values[k]), name), "m"
            rows.append(row)
        stops, reason = _stops(case)
        if reason:
            unknown.append(paragraph(f"{case.label}: its stops are not known: {reason}"))
        for stop in stops:
            moments = [("arrival", stop.start, "{}")]
            if stop.kind == "dwell":
                moments.append(("end of dwell", stop.end, "<strong>{}</strong>"))
            for moment, time, pattern in moments:
                errors = map(float, 1e3 * analysis.error_at(case.error, time))
                heads = ("time [s]", *(f"{axis} [mm]" for axis in analysis.COMPONENTS))
                cells = (markup(pattern, cell) for cell in (f"{time:.4g}", *errors))
                figures_ = dict(zip(heads, cells, strict=True))
                at_stops.append(
                    {"case": case, "reference": stop.kind, "moment": moment, **figures_}
                )
    if not rows:
        yield paragraph("No case has a tool error: nothing has play, or there is no reference.")
        return
    yield Grid.of_rows(rows, caption=(
        "Tool position less the ideal mechanism's at the same time, world axes; total: the distance"
        f"{runs.since}"
    ))  # fmt: skip
    yield from unknown
    if at_stops:
        named = sum(1 for head in ("case", "reference", "moment") if head != "case" or
                    not runs.cases[0].alone)  # fmt: skip
        yield Grid.of_rows(at_stops, left=named, caption=(
            "Tool error at the waypoints of the reference motion. The tool picks and places while "
            "the reference dwells: the end of a dwell (bold) is what matters to the process"
        ))  # fmt: skip


def _stops(case: Case) -> tuple[list[analysis.Stop], str]:
    """Stops of the reference motion, as far as the run came; or why nobody knows them."""
    assert case.error is not None
    try:
        motion = case.result.simulation.motion
    except JointplayError as error:  # the run cannot be built again
        return [], str(error)
    if motion is None:
        return [], ""
    return analysis.stops(motion, float(case.error["time"][-1])), ""


@block(BLOCKS, "Bearings")
def bearings(runs: Runs) -> Iterator[Part]:
    """Orbit of each joint, contact modes and forms, loads and life of rolling bearings."""
    if not runs.joints:
        return
    orbits = [panel for panel, _ in figures.orbit_panels(runs.detailed)]
    yield from _graph(runs, "journal_orbit", "Centre in the bearing, with its clearance", orbits)
    rims = [rims for _, rims in figures.orbit_panels(runs.detailed) if rims is not None]
    yield from _graph(runs, "rims", "Centre of the rim that is nearer to the bore: as far inside "
                      "the circle as its gap is wide, penetration as far outside, magnified",
                      rims)  # fmt: skip
    for kind, place in (("mode", "Table 1"), ("form", "Figure 2")):
        panels = _of_joints(runs, f"{kind}s", where=partial(_has_shares, kind=kind))
        timelines = []
        for panel in panels:
            rows = [mark for mark in panel.marks if isinstance(mark, Spans)]
            # Shares are those of records, not of steps: the table has them.
            axis = Axis(rows=[row.name.partition(", ")[0] for row in rows])
            timelines.append(replace(panel, y=axis, marks=[replace(row, name="") for row in rows]))
        title = f"Contact {kind}{f' ({place})' if runs.paper else ''}"
        yield from _graph(runs, f"{kind}s", title, timelines)
    yield from _shares(runs)
    tilt = _of_joints(runs, "tilt")
    yield from _graph(runs, "tilt", "Angle between the axes of journal and bearing", tilt)
    loaded = _of_joints(runs, "loaded", where=analysis.rolls)
    yield from _graph(runs, "loaded", "Balls or rollers that bear load", loaded)
    yield from _lives(runs)


def _has_shares(result: Result, joint: str, kind: str) -> bool:
    return not analysis.rolls(result, joint) and bool(analysis.time_fractions(result, joint, kind))


def _shares(runs: Runs) -> Iterator[Part]:
    """Shares of the time in each mode and form."""
    pairs = [
        (case, joint)
        for case in runs.cases
        for joint in case.joints
        if not analysis.rolls(case.result, joint)
    ]
    if not pairs:
        return

    def shares(kind: str, place: str, members: Mapping[str, str]) -> Grid:
        rows: list[Row] = []
        for case, joint in pairs:
            share = analysis.time_fractions(case.result, joint, kind, runs.start)
            rows.append({name: (share.get(key), "1") for key, name in members.items()})
        names = [markup("{} {}", case, joint) for case, joint in pairs]
        head = f"{kind} ({place})" if runs.paper else kind
        caption = f"Share of the records in each {kind}{runs.since}"
        return Grid.of_cases(head, names, rows, caption=caption)

    keys = (mode.name.lower() for mode in Mode)
    yield shares("mode", "Table 1", dict(zip(keys, MODES, strict=True)))
    meanings = zip(MODES, MODE_TERMS, MODE_MEANINGS, strict=True)
    yield paragraph("; ".join(f"{mode} (in the paper: {term}): {meaning}"
                              for mode, term, meaning in meanings) + ".")  # fmt: skip
    fractions = [analysis.time_fractions(case.result, j, "form", runs.start) for case, j in pairs]
    occurred = {key for by_form in fractions for key, share in by_form.items() if share > 0.0}
    if forms := {
        form.name.lower(): f"{form.letter}: {form.name.lower().replace('_', ' ')}"
        if form
        else "no contact"
        for form in Form
        if form.name.lower() in occurred
    }:
        yield shares("form", "Figure 2", forms)


def _lives(runs: Runs) -> Iterator[Part]:
    """Loads, life and friction of rolling bearings; nothing without any."""
    rows: list[Row] = []
    swings = False
    for case in runs.cases:
        late = case.result.time >= runs.start
        if not any(analysis.rolls(case.result, joint) for joint in case.joints) or late.sum() < 2:
            continue
        for joint, bearing in analysis.rolling_bearings(case.result).items():
            life = analysis.bearing_life(case.result, joint, runs.start)
            loaded = case.result["loaded_elements"].sel(joint=joint).values[late]
            swings = swings or life.oscillates
            rows.append(
                {
                    "joint": markup("{} {}", case, joint),
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
        return
    yield Html("<h3>Rolling bearings</h3>")
    yield Grid.of_rows(rows, "largest element load", 1, noun="bearing")
    note = (
        "Loads are those of single balls or rollers; at C0 that of the most loaded one under the "
        "basic static load rating. L10: basic reference rating life (ISO/TS 16281, a factor a_ISO "
        "of 1) of repeating this motion, with the damage of each instant's loads summed by "
        "Palmgren and Miner; the inner ring counts as the one that turns against the load."
    )
    if swings:
        note += (
            " Rings that swing by less than the distance of two elements: L10 is not meant for "
            "them, other damage (false brinelling) may come first."
        )
    yield paragraph(note)


@block(BLOCKS, "Forces")
def forces(runs: Runs) -> Iterator[Part]:
    """Force in each joint along x, y and z, and the largest."""
    rows: list[Row] = [
        {"joint": markup("{} {}", case, joint), "largest force": (force, "N")}
        for case in runs.cases
        if len(case.joints) > 1
        for joint, force in _joint_forces(case, runs.start).items()
    ]
    if rows:
        yield Grid.of_rows(rows, "largest force", noun="joint")
    for axis in AXES:
        panels = figures.force_panels(runs.detailed, axis)
        title = f"Force in the joint along world {axis}"
        yield from _graph(runs, f"force_{axis}", title, panels, same=True)


@block(BLOCKS, "Impacts")
def impacts(runs: Runs) -> Iterator[Part]:
    """Contacts by place, the largest ones step by step, normal forces and gaps."""
    if not runs.joints:  # where gears alone play, none strikes
        return
    rows = [
        _contact(runs, case, place)
        for case in runs.cases
        for place in analysis.contacts(case.result, runs.start)
    ]
    yield Grid.of_rows(rows, "peak force, largest", 1, noun="place")
    loose = (case.result for case in runs.cases if case.joints)
    spacing = sorted({1e3 * float(np.median(np.diff(result.time))) for result in loose})
    yield paragraph(
        "Contacts begun, impulse and shortest contact are exact: counted at every step of the "
        "whole run. Durations come from records, known to about one record interval "
        f"({', '.join(f'{value:g}' for value in spacing)} ms), and contacts that follow each other "
        "within it count as one. Peak forces are held between records and exact."
    )
    panels = [
        replace(
            panel, marks=[replace(curve, name=curve.name.rpartition(", ")[0]) for curve in curves]
        )
        for panel in _of_joints(runs, "impacts", runs.recorded, start=runs.start)
        if (curves := _curves(panel))
    ]
    yield from _graph(runs, "impacts", "Contacts by duration and peak force", panels)
    yield from _single_impacts(runs)
    for name, quantity in (("contacts", "Normal force"), ("gaps", "Gap")):
        title = f"{quantity} of each contact"
        yield from _graph(runs, name, title, _of_joints(runs, name), same=True)


def _contact(runs: Runs, case: Case, place: Contacts) -> Row:
    """Statistics of a place where a joint touches."""

    def percentile(values: np.ndarray, percent: float) -> float | None:
        return float(np.percentile(values, percent)) if len(values) else None

    onsets = rate = impulse = shortest = None
    if case.replay is not None:
        exact = case.replay.statistics.sel(joint=place.joint, contact=place.contact)
        onsets, impulse = int(exact["onsets"]), float(exact["impulse"])
        rate, steps = onsets / case.duration, float(exact["shortest_steps"])
        shortest = int(steps) if math.isfinite(steps) else None
    return {
        "place": _place(case, place.joint, place.contact),
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


def _single_impacts(runs: Runs) -> Iterator[Part]:
    """The largest impacts, step by step, each with a button that zooms into it."""
    rows: list[Row] = []
    for case in runs.cases:
        windows = case.replay.windows if case.replay is not None else ()
        for impact, window in zip(case.impacts, windows, strict=True):
            time = window["time"].values
            force = window["normal_force"].sel(joint=impact.joint, contact=impact.contact)
            zoom = f"{float(time[0])!r},{float(time[-1])!r}"
            rows.append(
                {
                    "place": _place(case, impact.joint, impact.contact),
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
        yield paragraph("No impact was followed step by step.")
    else:
        yield Grid.of_rows(rows, name="single-impacts", left=1)


def _place(case: Case, joint: str, contact: str) -> Html:
    return markup("{} {}, {}", case, joint, contact.replace("_", " "))


@block(BLOCKS, "Spectrum")
def spectrum(runs: Runs) -> Iterator[Part]:
    """The tool's acceleration by frequency, and in bands."""
    panels = [
        replace(panel, marks=curves)
        for panel in figures.spectrum_panels(runs.recorded, runs.start)
        if (curves := _curves(panel))
    ]
    title = "Power spectral density of the tool's acceleration"
    yield from _graph(runs, "spectrum", title, panels)
    rows: list[Row] = []
    missing: list[str] = []
    for case in runs.cases:
        try:
            density = analysis.spectrum(case.result, start=runs.start)
        except JointplayError as error:
            missing.append(f"{case.label}: no spectrum, {error}.")
            continue
        frequency, values = density["frequency"].values, density.values
        width = float(frequency[1] - frequency[0])
        above = frequency >= 20.0
        row: dict[str, Any] = {"case": case}
        for axis, column in zip(analysis.COMPONENTS, values.T, strict=True):
            row[f"RMS {axis}"] = float(np.sqrt(column[1:].sum() * width)), "m/s^2"
        for axis, column in zip(AXES, values.T, strict=False):
            strongest = float(frequency[above][column[above].argmax()]) if above.any() else None
            row[f"strongest above 20 Hz, {axis}"] = strongest, "Hz"
        row["sampled at"] = density.attrs["sampling_frequency_hz"], "Hz"
        row["window"] = density.attrs["window_s"], "s"
        rows.append(row | {"windows": density.attrs["windows"]})
    if rows:
        yield Grid.of_rows(rows)
    if bands := {case: rattle.bands for case in runs.cases if (rattle := _rattle(runs, case))}:
        columns = [{band.range: (band.rms, "m/s^2") for band in known} for known in bands.values()]
        yield Grid.of_cases("tool's acceleration, RMS", [*bands], columns, caption=(
            "Less the ideal mechanism's, where that is known"
        ))  # fmt: skip
    yield paragraph(
        "Power spectral density of the tool's acceleration, world axes, by Welch's method: "
        "one-sided, Hann windows that overlap by half, each less its mean. The acceleration is the "
        "mean one of each record interval (difference of recorded velocities), which lowers the "
        "density towards the Nyquist frequency, by 59 % there."
    )
    yield Points(missing)


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


@block(BLOCKS, "Claims")
def claims(runs: Runs) -> Iterator[Part]:
    """What the paper claims, and what these runs say of it."""
    if runs.claims is not None:
        head, *lines = claim_rows(runs.claims)
        classes = {"yes": "good", "no": "bad"}
        rows = [
            [
                *line,
                markup('<span class="{}">{}</span>', classes.get(verdict, "open"), verdict),
                last,
            ]
            for *line, verdict, last in lines
        ]
        caption = f"Ensembles of perturbed runs ({runs.claims.name})"
        yield Grid(head, rows, caption, left=len(head))
    elif not runs.paper:
        return
    measured = [(case, measure(case.result)) for case in runs.cases if can_be_measured(case.result)]
    if measured:
        columns = [
            {name: float(values[key]) for key, name in _MEASURES.items()} for _, values in measured
        ]
        caption = "What the claims are about, in these single runs"
        yield Grid.of_cases("measure", [case for case, _ in measured], columns, caption=caption)
        yield paragraph(
            "No claim is decided on single runs: impacts magnify small differences. Ensembles are "
            "judged by the command jointplay scara."
        )
    elif runs.claims is None:
        yield paragraph(
            "There are no claims to judge: no claims table was given, and no run with one joint "
            "with clearance is judged for longer than its start takes."
        )


def claim_rows(source: Path) -> list[list[str]]:
    """Rows of a claims table that `jointplay scara` wrote, its header first."""
    try:
        lines = list(csv.reader(io.StringIO(read_text(source, "claims"), newline=""), strict=True))
    except csv.Error as error:
        raise JointplayError(f"cannot read the claims {str(source)!r}: {error}") from None
    head = Table.of_texts([CLAIM_COLUMNS]).csv().strip()
    if not lines or ",".join(lines[0]) != head or any(len(line) != 5 for line in lines):
        raise JointplayError(
            f"{str(source)!r} is not a claims table of jointplay scara; its header must be {head}"
        )
    return [list(CLAIM_COLUMNS), *lines[1:]]


# Graphs.


def _graph(
    runs: Runs, name: str, title: str, panels: Sequence[Panel], same: bool = False
) -> Iterator[Graph]:
    """A graph, which for the paper's robot has the paper's number; none without panels."""
    number = PAPER.get(name.removesuffix("_error"), "") if runs.paper else ""
    if number:
        title = f"Figure {int(number[3:])}: {title[0].lower()}{title[1:]}"
    (case, *others) = runs.cases
    if panels:
        shown = panels if others else [_unnamed(panel, case.label) for panel in panels]
        yield Graph(name, title, shown, same)


def _of_joints(
    runs: Runs,
    name: str,
    results: Mapping[str, Result] | None = None,
    where: Callable[[Result, str], bool] = lambda *_: True,
    **asked: Any,
) -> list[Panel]:
    """A plot of each joint with clearance, or of those that `where` chooses."""
    panels = []
    for label, result in (results or runs.detailed).items():
        for joint in result.joints:
            if where(result, joint):
                panel = result.plot.panel(name, joint, **asked)
                marks = [mark for mark in panel.marks if not isinstance(mark, Rule)]
                panels.append(replace(panel, title=f"{label}, {joint}", marks=marks))
    return panels


def _unnamed(panel: Panel, label: str) -> Panel:
    """A panel that does not name the only case, of this label."""
    title = panel.title.removeprefix(f"{label}, ").removeprefix(f"{label}: ")
    marks = [
        replace(mark, name="") if isinstance(mark, Curve) and mark.name == label else mark
        for mark in panel.marks
    ]
    return replace(panel, title=title, marks=marks)


def _curves(panel: Panel) -> list[Curve]:
    return [mark for mark in panel.marks if isinstance(mark, Curve) and len(mark.x)]
