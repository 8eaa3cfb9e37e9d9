"""The blocks of a report on runs, in the order of the page."""

from __future__ import annotations

import io
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted
from jointplay.base.units import readable
from jointplay.physics.geometry import Form, Mode
from jointplay.show.plots import figures
from jointplay.show.plots.chart import Axis, Curve, Panel, Rule, Spans
from jointplay.show.plots.names import MODE_MEANINGS, MODE_TERMS, MODES, form_name, robot_of
from jointplay.show.plots.style import style
from jointplay.show.reports.assumptions import all_assumptions, conditions
from jointplay.show.reports.cases import Case, Runs
from jointplay.show.reports.charts import MAX_RECORDS
from jointplay.show.reports.html import Html, markup, paragraph
from jointplay.show.reports.inputs import parameters, value_rows
from jointplay.show.reports.parts import (
    Beside,
    Block,
    Drawing,
    Fold,
    Graph,
    Grid,
    Part,
    Points,
    Row,
    block,
    shortened,
)
from jointplay.simulation import analysis
from jointplay.simulation.analysis.bearings import Contacts
from jointplay.simulation.analysis.headline import headline
from jointplay.simulation.analysis.parts import AGAINST, DECISIVE
from jointplay.simulation.result.certificate import MARKED, CertifiedFigure
from jointplay.simulation.result.result import AXES, Result

BLOCKS: list[Block] = []

_ORBITS = 3  # orbits at a glance: those of the cases with the largest forces (judged)
_VALUES = 8  # assumed values that stand unfolded beside the figures (judged)


@block(BLOCKS, "At a glance", folded=False)
def glance(runs: Runs) -> Iterator[Part]:
    """The first lines of `jointplay run`, the main figures, the machine, three charts."""
    answers: list[tuple[float, Html]] = []  # sentences by the size of the tool error
    for case in runs.judged:
        if case.error is not None and analysis.has_play(case.result):
            with suppress(JointplayError):  # for example a user's own law, which is not imported
                sentence = headline(case.result)[0]
                largest = float(np.linalg.norm(case.error.values, axis=1).max())
                answers.append((largest, markup("{}{}.", case.prefix, sentence)))
    answers.sort(key=lambda answer: -answer[0])
    yield from shortened(Points([sentence for _, sentence in answers]), "case")
    caption = f"Tool errors are {AGAINST}{runs.since}"
    grid = runs.by_case(lambda case: _figures(runs, case), caption=caption, name="glance")
    # Beside a wide table the other two stand one below the other.
    others = [column for column in ([*_assumed(runs)], _picture(runs)) if column]
    yield Beside([[grid], [Beside(others)]] if others else [[grid]])
    warnings = [
        markup('{} <strong class="warn">Warning:</strong> {}.', case, warning)
        for case in runs.cases
        for warning in case.result.audit.warnings
    ]
    yield from shortened(Points(warnings), "warning")
    yield from _doubts(runs)
    yield from _first_error(runs)
    yield from _heaviest(runs)


def _first_error(runs: Runs) -> Iterator[Part]:
    """Tool error over time, also as the first line measures it; without play, the tool's motion."""
    if not runs.judged:
        panels = figures.tool_panels(runs.detailed, "tool_position")
        yield from _graph(runs, "tool_displacement", "Displacement of the tool", panels)
        return
    angle = all(case.result.tool_error.is_angle for case in runs.judged)
    of, name = ("orientation", "tool turn") if angle else ("position", "tool error")
    panels = []
    for case in runs.judged:
        panel = runs.detailed[case.label].plot.panel("deviation", "total", of=f"tool_{of}")
        stated = None if angle else case.stated_error
        label = "from the ideal machine" if case.alone and stated else case.label
        panel = panel.styled(colour=case.colour, name=label)
        if stated:
            label = stated.against if case.alone else f"{case.label}, {stated.against}"
            panel = panel.with_marks(figures.stated_error(stated, label, case.colour, "--"))
        panels.append(panel)
    title = "Tool error: distance from the ideal mechanism with the same drives"
    if any(len(panel.marks) > 1 for panel in panels):  # the legend tells from where
        title = "Tool error"
    title = "Turn of the tool against the ideal mechanism" if angle else title
    panel = figures.overlaid(panels).renamed(name)
    panel = replace(panel, y=replace(panel.y, low=0.0))
    yield from _graph(runs, "first_error", title, [panel])


def _heaviest(runs: Runs) -> Iterator[Part]:
    """Orbit and force of the joint with clearance that carries the largest force."""
    forces = {case.label: _joint_forces(case, runs.start) for case in runs.cases}
    largest = [(force, joint) for by_joint in forces.values() for joint, force in by_joint.items()]
    if not largest:
        return
    _, joint = max(largest)
    cases = [case for case in runs.cases if joint in case.result.joints]
    loaded = sorted(cases, key=lambda case: forces[case.label][joint])[-_ORBITS:]
    pairs = zip(cases, figures.orbit_panels(runs.detailed, [joint]), strict=True)
    shown = [pair for case, pair in pairs if case in loaded]
    # A single orbit gets a second panel, of the nearer rim: a tilted journal touches by its rims
    # while its middle stays inside the clearance.
    orbits = [panel for pair in shown for panel in pair[: 2 if len(shown) == 1 else 1] if panel]
    carries = ", which carries most" if len({j for _, j in runs.places}) > 1 else ""
    items = [(case.label, runs.detailed[case.label], case.colour) for case in cases]
    force = figures.over(items, "forces", "total", joint).styled(width=0.8).renamed("contact force")
    force = replace(force, y=replace(force.y, low=0.0))
    title = f"Centre in the bearing of {joint}{carries}, with its clearance"
    yield from _graph(runs, "first_orbit", title, orbits)
    yield from _graph(runs, "first_force", f"Contact force in {joint}{carries}", [force])


def _assumed(runs: Runs) -> Iterator[Part]:
    """Assumed values in a list, decisive ones first; folded, a table of all with their effects."""
    decisive: list[Html] = []
    others: list[Html] = []
    rows = value_rows(runs, assumed=True)
    for row in rows:
        # The last part of the key names the value, or its section where that part says too little.
        section, _, name = row["value"].partition(".")
        name = name.rpartition(".")[2] or section
        name = section.removesuffix("s") if name in ("kind", "coulomb") else name
        of = markup(" ({})", row["of"]) if row.get("of") else ""
        item = markup("{} {}{}", name.replace("_", " "), row["is"], of)
        group = decisive if name in ("motion", *DECISIVE) else others
        group += [] if item in group else [item]
    values = decisive + others
    if values:
        yield markup("<h3>{}</h3>", f"{counted(len(values), 'value')} assumed")
        yield Points(values[:_VALUES])
        more = f"{len(values) - _VALUES} more, and " if len(values) > _VALUES else ""
        yield Fold(f"{more}what others would change", [Grid.of_rows(rows, name="assumed")])


def _figures(runs: Runs, case: Case) -> Row:
    """The main figures of a case; None where one is unknown."""
    start, certificate, certified = runs.start, case.result.certificate, {}
    if certificate is not None and start == case.result.judge_from:  # the certificate's own time
        certified = {figure.name: figure for figure in certificate.figures}

    def with_error(value: float | None, name: str) -> Any:
        """A value, or where it is certified the figure with its numerical error."""
        return value if value is None or name not in certified else _marked(certified[name])

    stated = case.stated_error
    row: dict[str, Any] = {"ended": case.result.status.name.lower().replace("_", " ")}
    for error, head, name, unit in (
        (stated.reported if stated else None, f"tool {stated.against if stated else ''}", "", "m"),
        (case.error, "tool error", "tool error", "m"),
        (case.turn, "turn of the tool", "tool turn", "rad"),
    ):
        if error is not None and float(error["time"][-1]) >= start:
            accuracy = analysis.error_statistics(error, start)
            row[f"{head}, peak"] = with_error(accuracy.peak[3], f"peak {name}"), unit
            row[f"{head}, RMS"] = with_error(accuracy.rms[3], f"RMS {name}"), unit
    if case.error is not None:
        ends = [stop.end for stop in _stops(case) if stop.at_rest and stop.end > 0.0]
        errors = [float(analysis.error_at(case.error, end)[3]) for end in ends]
        row["tool error at stops, largest"] = max(errors, default=None), "m"
    if forces := _joint_forces(case, start):
        joint, force = max(forces.items(), key=lambda item: item[1])
        at = f", {joint}" if len(case.result.joints) > 1 else ""
        row["force at the joint, peak"] = with_error(force, f"peak joint force{at}"), "N"
        row["impacts"] = with_error(case.result.audit.judged_impacts, "impacts")
    if (rattle := _rattle(runs, case)) is not None:
        row["energy lost per impact"] = rattle.energy or None, "J", True
    return row | {"warnings": len(case.result.audit.warnings)}


def _rattle(runs: Runs, case: Case) -> analysis.Rattle | None:
    """Figures of the case's impacts, if it can rattle and they are of the time that is judged."""
    if case.result.joints and runs.start == case.result.judge_from:
        with suppress(JointplayError):  # too few records
            return analysis.rattle(case.result)
    return None


def _marked(figure: CertifiedFigure) -> Html:
    """A figure with its numerical error, marked where that is large."""
    pattern = '{} <strong class="warn">uncertain</strong>' if figure.marked else "{}"
    return markup(pattern, figure.number.replace("± ", "±\u00a0"))  # a line may end before ±


def _joint_forces(case: Case, start: float) -> dict[str, float]:
    """Largest contact force in each joint with clearance from `start` on [N]."""
    result = case.result
    late = result.forces.values[result.time >= start] if result.joints else np.empty((0, 0))
    return dict(zip(result.joints, map(float, late.max(axis=0, initial=0.0)), strict=True))


def _picture(runs: Runs) -> list[Part]:
    """A picture of the mechanism with its play marked; nothing if it cannot be built or drawn."""
    from jointplay.show.picture import picture

    shown = next((case for case in runs.cases if analysis.has_play(case.result)), runs.cases[0])
    try:
        mechanism = shown.result.simulation.mechanism
        loose = {n: gear.play for n, gear in mechanism.gears.items() if gear.play > 0.0}
        units = mechanism.description.joints
        sizes = {name: readable(play, units[name].unit) for name, play in loose.items()}
        sizes |= {name: mechanism.clearance[name].play_words for name in shown.result.joints}
        pattern = "{}\nplay {}" if shown.alone else "{}: play"
        labels = {name: pattern.format(name, size) for name, size in sizes.items()}
        q, size_in = shown.result["q"].values[0], (4.4, 3.6)  # its letters are legible in the page
        figure, content = picture(mechanism, q, labels=labels, size_in=size_in), io.BytesIO()
    except JointplayError:  # for example a user's own law, which is not imported
        return []
    with style("screen"):
        figure.savefig(content, format="png", dpi=150, bbox_inches="tight", pad_inches=0.05)
    places = [name for name, joint in mechanism.clearance.items() if joint.has_play]
    places += [f"the gear{'s' if len(loose) > 1 else ''} of {', '.join(loose)}"] if loose else []
    play = f"play in {', '.join(places)}" if places else "nothing has play"
    title = f"{robot_of(shown.result)} at the start of the run; {play}"
    return [Drawing(title, content.getvalue())]


def _doubts(runs: Runs) -> Iterator[Part]:
    """What ± and a missing ± mean, and what to do about large numerical errors."""
    certificates = [case.result.certificate for case in runs.cases]
    unknown = [c for c in runs.cases if c.result.joints and c.result.certificate is None]
    points: list[str] = []
    if any(certificates):
        points.append(
            "±: numerical error, within which 9 of 10 figures are of what the model says. It does "
            "not say how well the model fits the machine."
        )
    if unknown:
        pattern = "{} Numerical errors are not known; jointplay run --certify finds them."
        points.append(markup(pattern, runs.named(unknown)))
    if any(figure.marked for c in certificates if c is not None for figure in c.headline):
        points.append(
            f"uncertain: the numerical error exceeds {100.0 * MARKED:g} % of the value (of a "
            "count, 1). Do not compare designs by smaller differences. A smaller tolerance or step "
            "(integration.tolerance, integration.step) helps where the step is the cause; where "
            "the motion itself magnifies small differences, only means over perturbed runs can be "
            "compared (jointplay study sweep, repeats)."
        )
    yield Points(points)


block(BLOCKS, "Parameters")(parameters)


@block(BLOCKS, "Assumptions")
def assumptions(runs: Runs) -> Iterator[Part]:
    """What these runs assume, and from when on they are judged."""
    holds = conditions(runs.cases)
    points = [sentence for when, sentence in all_assumptions() if holds[when]]
    if runs.start:
        points.append(
            "Tool accuracy, peak force, contact statistics, shares of time and spectra are judged "
            f"from {runs.start:g} s on; penetration and audit are those of whole runs."
        )
    points += [markup("{}{}", case.prefix, note) for case in runs.cases for note in case.notes]
    yield Points(points)


@block(BLOCKS, "Audit")
def audits(runs: Runs) -> Iterator[Part]:
    """Each run's own checks: energy, steps, contacts and numerical errors."""
    yield runs.by_case(_audit, "of the run", name="audit-table")
    points: list[Html] = []
    for case in runs.cases:
        certificate = case.result.certificate
        texts = [case.result.audit.headline_with(certificate)] if case.result.joints else []
        if certificate is not None:
            texts += [text for text in (certificate.origin, certificate.note) if text]
            texts.append(f"further runs: {'; '.join(certificate.runs)}")
        points += [markup("{}{}.", case.prefix, text) for text in texts]
    yield Points(points)
    panels = [
        replace(case.result.plot.panel("energy"), title="" if case.alone else case.label)
        for case in runs.cases
    ]
    yield from _graph(runs, "energy", "Energy balance", panels)


def _audit(case: Case) -> Row:
    audit, result = case.result.audit, case.result
    limit = audit.friction_step_limit
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
    certified = () if result.certificate is None else result.certificate.headline
    return {
        "ended": result.message,
        "energy residual": (audit.energy_residual, "J"),
        "the same, of what is exchanged": (audit.relative_energy_residual, "1"),
        **(contact if result.joints else {}),
        "step": readable(audit.step, "s"),
        "error by the step": (audit.step_error, "m", True),
        "drift of ideal loops": (drift, "m", True),
        **{figure.name: (_marked(figure), figure.unit) for figure in certified},
    }


@block(BLOCKS, "Motion of the tool")
def motion(runs: Runs) -> Iterator[Part]:
    """Displacement, velocity and path, and how they differ from the ideal."""
    hint = (
        "Drag across a chart in time to zoom; all charts in time follow, and the paths and orbits "
        "show that time only. Double-click, or “whole run” above, to go back."
    )
    if long := [case.label for case in runs.cases if len(case.result.time) > MAX_RECORDS]:
        hint += f" Of {', '.join(long)} the smallest and the largest record of each of "
        hint += f"{MAX_RECORDS // 2} intervals are shown."
    yield markup('<p class="screen">{}</p>', hint)
    axes = figures.moving_axes(runs.detailed)
    along = f" (along {' and '.join(axes)}, the others are at rest)" if len(axes) < 3 else ""
    for of, quantity in (("position", "displacement"), ("velocity", "velocity")):
        title = f"{quantity.capitalize()} of the tool{along}"
        if of == "velocity" or runs.judged:  # else it stands at a glance
            panels = figures.tool_panels(runs.detailed, f"tool_{of}")
            yield from _graph(runs, f"tool_{quantity}", title, panels)
        panels = figures.difference_panels(runs.detailed, f"tool_{of}")
        title += ", less the ideal mechanism's"
        yield from _graph(runs, f"tool_{quantity}_error", title, panels)
    if not figures.is_straight(runs.detailed):
        plane = figures.plane_of(runs.recorded)
        panels = [figures.path_panel(runs.detailed)]
        yield from _graph(runs, "tool_path", f"Path of the tool in the {plane} plane", panels)


@block(BLOCKS, "Accuracy")
def accuracy(runs: Runs) -> Iterator[Part]:
    """Tool error by axis, and at each stop."""
    if not runs.judged:  # nothing has play, or there is no reference
        return
    rows: list[Row] = []
    at_stops: list[Row] = []
    for case in runs.judged:
        assert case.error is not None
        start = min(runs.start, float(case.error["time"][-1]))
        statistics = analysis.error_statistics(case.error, start)
        columns = {"mean": statistics.mean, "RMS": statistics.rms, "peak": statistics.peak}
        for k, axis in enumerate(analysis.COMPONENTS):
            values = {head: (float(column[k]), "m") for head, column in columns.items()}
            rows.append({"case": case, "axis": axis, **values})
        for stop in _stops(case):
            dwells = [("end of dwell", stop.end)] if stop.kind == "dwell" else []
            for moment, time in [("arrival", stop.start), *dwells]:
                errors = zip(analysis.COMPONENTS, analysis.error_at(case.error, time), strict=True)
                row = {"case": case, "reference": stop.kind, "moment": moment}
                row |= {"time [s]": f"{time:.4g}"}
                at_stops.append(row | {axis: (float(error), "m") for axis, error in errors})
    yield Grid.of_rows(rows, caption=(
        "Tool position less the ideal mechanism's at the same time, world axes; total: the distance"
        f"{runs.since}"
    ))  # fmt: skip
    if at_stops:
        yield Grid.of_rows(at_stops, left=2 if runs.cases[0].alone else 3, caption=(
            "Tool error at the waypoints of the reference motion. The tool picks and places while "
            "the reference dwells: the end of a dwell is what matters to the process"
        ))  # fmt: skip


def _stops(case: Case) -> list[analysis.Stop]:
    """Stops of the reference motion up to the end of the tool error; none without a motion."""
    with suppress(JointplayError):  # the run's inputs may not be buildable here
        motion = case.result.simulation.motion
        if motion is not None and case.error is not None:
            return analysis.stops(motion, float(case.error["time"][-1]))
    return []


@block(BLOCKS, "Bearings")
def bearings(runs: Runs) -> Iterator[Part]:
    """Orbit of each joint, contact modes and forms, loads and life of rolling bearings."""
    if not runs.places:
        return
    both = figures.orbit_panels(runs.detailed)
    title = "Centre in the bearing, with its clearance"
    yield from _graph(runs, "journal_orbit", title, [panel for panel, _ in both])
    yield from _graph(runs, "rims", "Centre of the rim that is nearer to the bore: as far inside "
                      "the circle as its gap is wide, penetration as far outside, magnified",
                      [rims for _, rims in both if rims is not None])  # fmt: skip
    for kind in ("mode", "form"):
        timelines = []
        for panel in _of_joints(runs, f"{kind}s", where=partial(_slides, kind=kind)):
            rows = [mark for mark in panel.marks if isinstance(mark, Spans)]
            # Shares are those of records, not of steps: the table has them.
            axis = Axis(rows=[row.name.partition(", ")[0] for row in rows])
            timelines.append(replace(panel, y=axis, marks=[replace(row, name="") for row in rows]))
        yield from _graph(runs, f"{kind}s", f"Contact {kind}", timelines)
    yield from _shares(runs)
    tilt = _of_joints(runs, "tilt", where=lambda r, joint: bool(r["tilt"].sel(joint=joint).any()))
    yield from _graph(runs, "tilt", "Angle between the axes of journal and bearing", tilt)
    loaded = _of_joints(runs, "loaded", where=analysis.rolls)
    yield from _graph(runs, "loaded", "Balls or rollers that bear load", loaded)
    yield from _lives(runs)


def _slides(result: Result, joint: str, kind: str) -> bool:
    """Whether a joint's surfaces slide and it has contact modes, or forms (`kind`)."""
    return not analysis.rolls(result, joint) and bool(analysis.time_fractions(result, joint, kind))


def _shares(runs: Runs) -> Iterator[Part]:
    """Tables of the share of time in each contact mode, and in each form that occurred."""
    sliding = [place for place in runs.places if not analysis.rolls(place[0].result, place[1])]
    modes = {mode.name.lower(): name for mode, name in zip(Mode, MODES, strict=True)}
    forms = {form.name.lower(): form_name(form) for form in Form} | {"none": "no contact"}
    for kind, members in (("mode", modes), ("form", forms)) if sliding else ():
        shares = [analysis.time_fractions(c.result, j, kind, runs.start) for c, j in sliding]
        occurred = [k for k in members if kind == "mode" or any(s.get(k, 0.0) for s in shares)]
        rows: list[Row] = [{members[k]: (s.get(k, 0.0), "1") for k in occurred} for s in shares]
        heads = [markup("{} {}", case, joint) for case, joint in sliding]
        if occurred:
            caption = f"Share of the records in each {kind}{runs.since}"
            yield Grid.of_cases(kind, heads, rows, caption=caption)
    if sliding:
        meanings = zip(MODES, MODE_TERMS, MODE_MEANINGS, strict=True)
        texts = (f"{mode} (in the paper: {term}): {meaning}" for mode, term, meaning in meanings)
        yield paragraph("; ".join(texts) + ".")


def _lives(runs: Runs) -> Iterator[Part]:
    """A table of the loads, life and friction of rolling bearings, if there are any."""
    rows: list[Row] = []
    swings = False
    for case in runs.cases:
        if not any(analysis.rolls(case.result, joint) for joint in case.result.joints):
            continue
        for joint, bearing in analysis.rolling_bearings(case.result).items():
            with suppress(JointplayError):  # too few records
                life = analysis.bearing_life(case.result, joint, runs.start)
                swings = swings or life.oscillates
                row: Row = {
                    "joint": markup("{} {}", case, joint),
                    "bearing": bearing.designation or bearing.kind.replace("-", " "),
                    "largest element load": (life.largest_load, "N"),
                    "the same, at C0": (life.rated_load, "N"),
                    "elements loaded, most": f"{life.most_loaded} of {life.elements}",
                    "life L10": life.lasting,
                    "friction torque, mean": (life.mean_torque, "N*m"),
                }
                rows.append(row)
    if not rows:
        return
    table = Grid.of_rows(rows, "largest element load", 1, caption="Rolling bearings")
    yield from shortened(table, "bearing")
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
        if len(case.result.joints) > 1
        for joint, force in _joint_forces(case, runs.start).items()
    ]
    if rows:
        yield from shortened(Grid.of_rows(rows, "largest force"), "joint")
    loaded = figures.loaded_axes(runs.detailed)
    if idle := " and ".join(axis for axis in AXES if axis not in loaded):
        yield paragraph(f"No force acts along {idle}.")
    for axis in loaded:
        panels = figures.force_panels(runs.detailed, axis)
        title = f"Force in the joint along world {axis}"
        yield from _graph(runs, f"force_{axis}", title, panels, same=True)


@block(BLOCKS, "Impacts")
def impacts(runs: Runs) -> Iterator[Part]:
    """Contacts by place, the largest ones step by step, normal forces and gaps."""
    start = runs.start
    if not runs.places:  # play in gears alone has no contacts
        return
    rows = [_contact(c, place) for c in runs.cases for place in analysis.contacts(c.result, start)]
    yield from shortened(Grid.of_rows(rows, "peak force, largest", 1), "place")
    yield paragraph(
        "Contacts begun, impulse and shortest contact are exact: counted at every step of the "
        "whole run. Durations come from records, and contacts that follow each other within one "
        "record interval count as one. Peak forces are held between records and exact."
    )
    panels = []
    for panel in _of_joints(runs, "impacts", runs.recorded, start=start):
        curves = [replace(c, name=c.name.rpartition(", ")[0]) for c in _curves(panel)]
        panels += [replace(panel, marks=curves)] if curves else []
    yield from _graph(runs, "impacts", "Contacts by duration and peak force", panels)
    yield from _single_impacts(runs)
    for name, quantity in (("contacts", "Normal force"), ("gaps", "Gap")):
        title = f"{quantity} of each contact"
        yield from _graph(runs, name, title, _of_joints(runs, name), same=True)


def _contact(case: Case, place: Contacts) -> Row:
    """Statistics of one contact place of a joint: exact ones where the run was replayed."""

    def percentile(values: np.ndarray, percent: float) -> float | None:
        return float(np.percentile(values, percent)) if len(values) else None

    onsets = impulse = shortest = None
    if case.replay is not None:
        exact = case.replay.statistics.sel(joint=place.joint, contact=place.contact)
        onsets, impulse = int(exact["onsets"]), float(exact["impulse"])
        steps = float(exact["shortest_steps"])
        shortest = int(steps) if math.isfinite(steps) else None
    return {
        "place": _place(case, place.joint, place.contact),
        "contacts begun": onsets,
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
    """A table of the largest impacts, each with a button that zooms into it."""
    rows: list[Row] = []
    for case in runs.cases:
        windows = case.replay.windows if case.replay is not None else ()
        for impact, window in zip(case.impacts, windows, strict=True):
            time = window["time"].values
            force = window["normal_force"].sel(joint=impact.joint, contact=impact.contact)
            zoom = f"{float(time[0])!r},{float(time[-1])!r}"
            row: Row = {
                "place": _place(case, impact.joint, impact.contact),
                "time [s]": f"{float(time[int(force.values.argmax())]):.5f}",
                "peak normal force": (impact.peak_force, "N"),
                "penetration": (impact.penetration, "m", True),
                "steps in contact": impact.steps if impact.complete else f"> {impact.steps}",
                "approach speed": (impact.approach_speed, "m/s", True),
                "separation speed": (impact.separation_speed, "m/s", True),
                "": markup('<button type="button" data-zoom="{}">zoom</button>', zoom),
            }
            rows.append(row)
    if rows:
        yield Grid.of_rows(rows, name="single-impacts", left=1)


def _place(case: Case, joint: str, contact: str) -> Html:
    return markup("{} {}, {}", case, joint, contact.replace("_", " "))


@block(BLOCKS, "Spectrum")
def spectrum(runs: Runs) -> Iterator[Part]:
    """The tool's acceleration by frequency, and in bands."""
    spectra = figures.spectrum_panels(runs.recorded, runs.start)
    panels = [replace(panel, marks=curves) for panel in spectra if (curves := _curves(panel))]
    title = "Power spectral density of the tool's acceleration"
    yield from _graph(runs, "spectrum", title, panels)
    rows: list[Row] = []
    for case in runs.cases:
        try:
            density = analysis.spectrum(case.result, start=runs.start)
        except JointplayError as error:
            yield paragraph(f"{case.label}: no spectrum, {error}.")
            continue
        frequency, values = density["frequency"].values, density.values
        width = float(frequency[1] - frequency[0])
        row: dict[str, Any] = {"case": case}
        for axis, column in zip(analysis.COMPONENTS, values.T, strict=True):
            row[f"RMS {axis}"] = float(np.sqrt(column[1:].sum() * width)), "m/s^2"
        rows.append(row)
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


# Graphs.


def _graph(
    runs: Runs, name: str, title: str, panels: Sequence[Panel], same: bool = False
) -> Iterator[Graph]:
    """A graph, if there are panels; a single case is not named in it."""
    case = runs.cases[0]
    if panels:
        shown = [_unnamed(panel, case.label) for panel in panels] if case.alone else panels
        yield Graph(name, title, shown, same)


def _of_joints(
    runs: Runs,
    name: str,
    results: Mapping[str, Result] | None = None,
    where: Callable[[Result, str], bool] = lambda *_: True,
    **asked: Any,
) -> list[Panel]:
    """The result plot `name` of each joint with clearance, or of those that `where` selects."""
    panels = []
    for label, result in (results or runs.detailed).items():
        for joint in result.joints:
            if where(result, joint):
                panel = result.plot.panel(name, joint, **asked)
                marks = [mark for mark in panel.marks if not isinstance(mark, Rule)]
                panels.append(replace(panel, title=f"{label}, {joint}", marks=marks))
    return panels


def _unnamed(panel: Panel, label: str) -> Panel:
    """The panel without the label of the only case in its title and legend."""
    title = panel.title.removeprefix(f"{label}, ").removeprefix(f"{label}: ")
    marks = [
        replace(mark, name="") if isinstance(mark, Curve) and mark.name == label else mark
        for mark in panel.marks
    ]
    return replace(panel, title=title, marks=marks)


def _curves(panel: Panel) -> list[Curve]:
    return [mark for mark in panel.marks if isinstance(mark, Curve) and len(mark.x)]
