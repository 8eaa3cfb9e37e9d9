"""Figures that compare runs; those of the paper's robot get the paper's numbers."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from contextlib import nullcontext
from dataclasses import replace
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base import files
from jointplay.base.processes import in_parallel
from jointplay.model.mechanism import Mechanism
from jointplay.show.plots.chart import Axis, Chart, Curve, Label, Panel, Rule, in_rows, overlaid
from jointplay.show.plots.draw import draw
from jointplay.show.plots.names import MARK, PAPER, SHORT, is_paper_robot, kinds
from jointplay.show.plots.palette import GREY, VERMILION, Cases, colours, many, reference
from jointplay.simulation import analysis
from jointplay.simulation.analysis.parts import ToolError
from jointplay.simulation.analysis.twins import has_play
from jointplay.simulation.analysis.vibration import TooShort
from jointplay.simulation.result.result import AXES, Result

_LEGEND_COLUMNS = 3
_ORBITS = 3  # most orbits side by side
_HEADROOM = 1.2  # top of an axis relative to its labelled peak: room for a line of text (judged)
_STILL = 1e-6  # motion or force along an axis that counts as none, relative to the largest


def coloured(cases: Cases) -> list[tuple[str, Result, str]]:
    """Label, result and colour of each case."""
    return list(zip(cases, cases.values(), colours(cases), strict=True))


def _with_start(panels: Iterable[Panel], cases: Cases) -> tuple[list[Panel], str]:
    """Panels over time with the part that is not judged shaded, and a note that says so."""
    until = max((result.judge_from for result in cases.values() if result.joints), default=0.0)
    if until <= 0.0:
        return list(panels), ""
    note = f"Grey: the first {until:g} s, in which journals fall into their bearings, not judged."
    grey = Rule(0.0, "x", colour=GREY, width=0.0, end=until)
    return [panel.with_marks(grey) for panel in panels], note


def tool_panels(cases: Cases, of: str) -> list[Panel]:
    """Tool position or velocity over time, a panel for each moving axis, with all cases in each."""
    name = "displacement" if of == "tool_position" else "velocity"
    return [over(coloured(cases), name, axis) for axis in moving_axes(cases)]


def over(runs: Iterable[tuple[str, Result, str]], name: str, *asked: Any, **options: Any) -> Panel:
    """The result plot `name` of all runs in one panel, each under its label and in its colour."""
    return overlaid(
        result.plot.panel(name, *asked, **options).styled(colour=colour, name=label)
        for label, result, colour in runs
    )


def difference_panels(cases: Cases, of: str) -> list[Panel]:
    """The tool's difference from the ideal mechanism over time, a panel for each moving axis."""
    drawn = [item for item in coloured(cases) if analysis.has_tool_error(item[1])]
    axes = moving_axes(cases) if drawn else ()
    return [over(drawn, "deviation", axis, of=of).renamed(f"{axis} - ideal") for axis in axes]


def _tool_history(cases: Cases, of: str) -> Chart:
    """Tool position or velocity over time, and beside it the difference from the ideal robot, which
    is the effect of play."""
    axes = moving_axes(cases)
    panels, grey = _with_start(tool_panels(cases, of), cases)
    beside, _ = _with_start(difference_panels(cases, of), cases)
    rows: list[list[Panel | None]] = [[panel] for panel in panels]
    if beside:
        beside[0] = replace(beside[0], title="difference from the ideal robot")
        rows = [list(both) for both in zip(panels, beside, strict=True)]
    still = " and ".join(axis for axis in AXES if axis not in axes)
    note = " ".join(filter(None, [still and f"The tool does not move along {still}.", grey]))
    size = (9.0 if beside else 6.0, 1.4 + 1.55 * len(axes))
    return Chart(rows, size, note=note, key=_LEGEND_COLUMNS, same_x=True)


def moving_axes(cases: Cases) -> list[str]:
    """World axes along which the tool moves in any case; all of them if it does not move."""
    paths = [result["tool_position"].values for result in cases.values()]
    reach = np.max([np.nanmax(path, axis=0) - np.nanmin(path, axis=0) for path in paths], axis=0)
    moving = [axis for axis, size in zip(AXES, reach, strict=True) if size > _STILL * reach.max()]
    return moving or list(AXES)


def is_straight(cases: Cases) -> bool:
    """Whether the tool moves along one axis only, so that its path shows nothing."""
    return len(moving_axes(cases)) < 2


def path_panel(cases: Cases) -> Panel:
    """Paths of the tool in the plane that `plane_of` chooses."""
    return over(coloured(cases), "path", plane_of(cases))


def tool_path(cases: Cases) -> Chart:
    """Tool path, and a close-up where it differs most from the ideal one (Figure 11)."""
    panel = path_panel(cases)
    across = [AXES.index(axis) for axis in plane_of(cases)]
    whole, note = panel, ""
    look: dict[str, Any] = {"colour": "black", "line": "", "frame": True, "order": 4.0}
    judged_late = [result for result in cases.values() if result.joints and result.judge_from > 0.0]
    for result in judged_late:
        at = result["tool_position"].values[np.searchsorted(result.time, result.judge_from)]
        x, y = at[across]
        whole = whole.with_marks(Curve([x], [y], marker="x", size=5.0, **look))
    if judged_late:
        latest = max(result.judge_from for result in judged_late)
        note = f"x: where the tool is when judging begins, {latest:g} s after the start."
    # The largest deviation in the plane, and the ideal tool's place there.
    worst, spot = 0.0, np.zeros(2)
    with_error = [] if reference(cases) is None else filter(analysis.has_tool_error, cases.values())
    for result in with_error:
        deviation = np.nan_to_num(np.hypot(*result["tool_error_vector"].values[:, across].T))
        if deviation.max() > worst:
            worst, k = float(deviation.max()), int(deviation.argmax())
            spot = result["ideal_tool_position"].values[k, across]
    row: list[Panel | None] = [whole]
    if worst > 0.0:
        x_axis, y_axis = (
            replace(axis, low=at - 2.5 * worst, high=at + 2.5 * worst, ticks=4)
            for axis, at in zip((panel.x, panel.y), spot, strict=True)
        )
        title = f"where it differs most: {1e3 * worst:.2f} mm"
        frame = Curve([spot[0]], [spot[1]], marker="s", size=9.0, hollow=True, **look)
        row = [whole.with_marks(frame)]
        row.append(replace(panel, x=x_axis, y=y_axis, title=title, equal="box"))
    size = (9.0 if worst > 0.0 else 5.0, 4.4)
    return Chart([row], size, note=note, key=_LEGEND_COLUMNS)


def joints_of(cases: Cases) -> list[str]:
    """Joints that have clearance in any case."""
    return list(dict.fromkeys(name for result in cases.values() for name in result.joints))


def orbit_panels(
    cases: Cases, joints: Sequence[str] | None = None
) -> list[tuple[Panel, Panel | None]]:
    """Orbits of each journal's centre, and of its nearer rim if it has rims, joint by joint.

    `joints`: those to show; None shows all with clearance.
    """
    dot: dict[str, Any] = {"line": "", "marker": "o", "size": 5.0, "frame": True, "order": 4.0}
    ideal_point = Curve([0.0], [0.0], colour=VERMILION, **dot)
    panels = []
    for joint in joints_of(cases) if joints is None else joints:
        for label, result, colour in coloured(cases):
            if joint not in result.joints:
                continue
            orbit = result.plot.panel("orbit", joint).styled(colour=colour)
            if reference(cases) is not None:
                orbit = replace(orbit, marks=[ideal_point, *orbit.marks])
            rims = None
            if analysis.has_rims(result, joint):
                rims = result.plot.panel("rims", joint)
                rims = replace(rims, title=f"{label}: {rims.title}")
            panels.append((replace(orbit, title=f"{label}: {orbit.title}"), rims))
    return panels


def journal_orbit(cases: Cases) -> Chart:
    """Orbits in the clearance circle, joint by joint (Figure 12).

    Above the orbit of a cylindrical journal's centre stands that of the centre of its nearer rim,
    coloured by mode; other journals have no rims.
    """
    shown = orbit_panels(cases)
    columns = min(max(len(result.joints) and len(cases) for result in cases.values()), _ORBITS)
    columns = max(1, min(columns, len(shown)))
    any_rims = any(rims is not None for _, rims in shown)
    rows, note = in_rows([orbit for orbit, _ in shown], columns), ""
    if any_rims:
        above = in_rows([rims for _, rims in shown], columns)
        rows = [row for both in zip(above, rows, strict=True) for row in both]
        ideal = "; the ideal joint's is the red point" if reference(cases) else ""
        note = (
            "Above: the centre of the journal's rim that is nearer to the bore, as far inside the "
            "circle as its gap is wide, penetration as far outside, magnified; colours by the mode "
            "of the joint (inside it, penetration is at an end wall). "
            f"Below: the centre of the journal's middle{ideal}. A tilted journal touches the bore "
            "by its rims, while its middle stays inside."
        )
    size = (4.3 * columns, 0.8 + 4.1 * len(rows))
    key = (_LEGEND_COLUMNS if columns > 1 else 1) if any_rims else 0
    return Chart(rows, size, note=note, key=key)


def force_panels(cases: Cases, axis: str) -> list[Panel]:
    """Force in a joint along a world axis over time, a panel for each case and joint.

    A case without clearance shows the joints that have clearance in another case, or else its first
    moving joint.
    """
    panels = []
    for label, result, colour in coloured(cases):
        joints = result.joints
        if not joints:
            moving = [str(name) for name in result["moving_joint"].values]
            joints = [name for name in joints_of(cases) if name in moving] or moving[:1]
        for joint in joints:
            panel = result.plot.panel("forces", axis, joint).styled(colour=colour, width=0.8)
            panels.append(replace(panel, title=f"{label}, {joint}", colour=colour))
    return panels


def loaded_axes(cases: Cases) -> list[str]:
    """World axes along which joints carry a force in any case; all of them if there is none."""
    largest = {
        axis: max(
            float(np.abs(mark.y).max(initial=0.0))
            for panel in force_panels(cases, axis)
            for mark in panel.marks
            if isinstance(mark, Curve)
        )
        for axis in AXES
    }
    loaded = [axis for axis, force in largest.items() if force > _STILL * max(largest.values())]
    return loaded or list(AXES)


def joint_force(cases: Cases, axis: str) -> Chart:
    """Force in a joint along a world axis over time, by case and joint (Figures 13-15).

    With clearance it is the contact force: each record holds the force at the instant since the
    last record at which its magnitude was largest. For the ideal robot it is the constraint force.
    """
    panels, note = _with_start(force_panels(cases, axis), cases)
    if not all(result.joints for result in cases.values()):
        note += (
            " With clearance the force of the contacts, the largest since the last record; that of "
            "the ideal joint is a constraint force: nothing touches there."
        )
    size, title = (7.0, 1.3 + 1.7 * len(panels)), f"force in the joint along world {axis}"
    rows = [[panel] for panel in panels]
    return Chart(rows, size, title=title, note=note.strip(), same_x=True, same_y="col")


def _skeleton(mechanism: Mechanism, q: np.ndarray) -> list[np.ndarray]:
    """A stick figure of the mechanism: lines (n, 3) [m] in world axes from each joint's parent to
    the joint, from moving bodies' joints to the ends of loops on them, and to the tool."""
    model, data = mechanism.model, mechanism.data
    pin.framesForwardKinematics(model, data, q)
    at = [place.translation.copy() for place in data.oMi]
    lines = [
        np.array([at[model.parents[i]], at[i]]) for i in range(1, model.njoints) if model.parents[i]
    ]
    for name in mechanism.loops:
        for i, placement in mechanism.frames(name):
            if i:
                lines.append(np.array([at[i], data.oMi[i].act(placement.translation)]))
    tool = model.frames[mechanism.tool_frame].parentJoint
    return [*lines, np.array([at[tool], data.oMf[mechanism.tool_frame].translation])]


def plane_of(cases: Cases) -> str:
    """The plane to draw paths in: xy as in the paper, unless the tool hardly moves in it."""
    places = [result["tool_position"].values for result in cases.values()]
    path = np.sort(np.ptp(np.concatenate(places), axis=0))
    if path[1] <= 0.01 * path[2]:  # a point or a line is in many planes: the machine decides
        first = next(iter(cases.values()))
        for moment in (0, len(first.time) // 3, len(first.time) // 2):
            places += _skeleton(first.simulation.mechanism, first["q"].values[moment])
    reach = np.ptp(np.concatenate(places), axis=0)
    if min(reach[:2]) >= 0.01 * reach.max() or reach[2] <= min(reach[:2]):
        return "xy"
    return "xz" if reach[0] >= reach[1] else "yz"


def _with_peak(panel: Panel, start: float, until: float) -> Panel:
    """A panel over time from zero up, with its peak from `start` on marked and labelled."""
    curves = [mark for mark in panel.marks if isinstance(mark, Curve)]
    top, time, colour = 0.0, 0.0, ""
    for curve in curves:
        at, values = np.asarray(curve.x), np.asarray(curve.y)
        values = np.where(at >= start, values, 0.0)[: len(at)]
        if values.max(initial=0.0) > top:
            k = int(values.argmax())
            top, time, colour = float(values[k]), float(at[k]), curve.colour
    highest = max((float(np.max(curve.y, initial=0.0)) for curve in curves), default=0.0)
    if not top:
        return panel
    factor, unit = panel.y.shown
    side = "left" if time < until / 3.0 else "right" if time > 2.0 * until / 3.0 else "center"
    peak = Label(time, top, f"peak {factor * top:.3g} {unit} at {time:.3g} s", side)
    dot = Curve([time], [top], "", colour, "", marker="o", size=5.0, frame=True, order=4.0)
    up = replace(panel.y, low=0.0, high=_HEADROOM * highest)
    return replace(panel.with_marks(dot, peak), y=up)


def _journal(result: Result, joint: str, label: str, colour: str) -> Panel:
    """Orbit of a journal's centre; or of its rims, where the journal tilts and they alone touch."""
    orbit = result.plot.panel("orbit", joint).styled(colour=colour)
    case = f"{label}\n" if label else ""
    place = (
        "inner ring in the outer one"
        if analysis.rolls(result, joint)
        else "journal centre in its bearing"
    )
    room = analysis.clearance_outline(result, joint)
    centre = result["journal_centre"].sel(joint=joint).values[result.time >= result.judge_from]
    reach = float(np.hypot(*centre[:, :2].T).max())
    if room is None or not analysis.has_rims(result, joint) or reach >= room.max():
        return replace(orbit, title=f"{case}{place}, {joint}")
    rims = result.plot.panel("rims", joint)
    middle = replace(orbit, marks=orbit.marks[-1:]).styled(name="middle of the journal")
    magnified = rims.title.rpartition(", ")[2]
    title = f"{case}{joint}: the journal tilts,\nits rims touch, its middle does not"
    return replace(
        rims,
        marks=[*middle.marks, *rims.marks],
        title=title,
        legend="below",
        legend_title=magnified,
    )


def stated_error(error: ToolError, name: str, colour: str, line: str = "-") -> Curve:
    """The distance over time with which the run's first line begins (`ToolError.reported`)."""
    distance = np.linalg.norm(error.reported.values, axis=1)
    return Curve(error.reported["time"].values, distance, name, colour, line=line)


def overview(cases: Cases) -> Chart:
    """Tool error (or tilt), the machine with the tool's path, contact force and journal's orbit.

    A single case shows the forces of all its joints, named in the legend; several cases show that
    of one joint. Play in gears alone has neither orbit nor contact force.
    """
    runs = coloured(cases)
    single = len(runs) == 1
    several_joints = single and len(runs[0][1].joints) > 1  # colours then tell joints, not cases
    if several_joints:
        runs = [(label, result, "black") for label, result, _ in runs]
    with_contacts = [item for item in runs[::-1] if item[1].joints]  # cases with contacts
    first = reference(cases) or next(iter(cases.values()))
    mechanism, plane = first.simulation.mechanism, plane_of(cases)
    across = [AXES.index(axis) for axis in plane]
    look: dict[str, Any] = {"colour": "#999999", "opacity": 0.7, "width": 3.0, "marker": "o"}
    bones = [
        Curve(line[:, across[0]], line[:, across[1]], frame=True, size=5.0, **look)
        for moment in (0, int(np.abs(first["v"].values).sum(axis=1).argmax()), len(first.time) // 2)
        for line in _skeleton(mechanism, first["q"].values[moment])
    ]
    paths = [
        (label if has_play(result) and not single else "", result, tone)
        for label, result, tone in runs
    ]
    plan = over(paths, "path", plane).styled(width=1.0)
    plan = replace(plan, marks=[*bones, *plan.marks], title=f"{plane} plane, with the tool's path")
    error: Panel | None = None
    until = max(float(result.time[-1]) for result in cases.values())
    nameless = [("", result, tone) for _, result, tone in runs[::-1]]  # the paths have the names
    with_error = [item for item in nameless if analysis.has_tool_error(item[1])]
    if with_error:
        angle = all(result.tool_error.is_angle for _, result, _ in with_error)
        of, name = ("tool_orientation", "turn") if angle else ("tool_position", "error")
        panels, against = [], set()
        for _, result, tone in with_error:
            panel = result.plot.panel("deviation", "total", of=of).styled(colour=tone)
            if restated := not angle and result.tool_error.is_restated:
                panel = replace(panel, marks=[stated_error(result.tool_error, "", tone)])
            panels.append(panel)
            against.add(result.tool_error.against if restated else "against the ideal mechanism")
        title = f"tool {name} {against.pop() if len(against) == 1 else 'as each case states it'}"
        title = title.replace(" off, ", ", ")
        error = replace(overlaid(panels).renamed(f"tool {name}"), title=title)
        error = _with_peak(error, max(result.judge_from for _, result, _ in with_error), until)
    elif with_contacts:
        error = over([item for item in nameless if item[1].joints], "tilt")
        error = replace(error, title=f"tilt of the journal, {with_contacts[0][1].joints[0]}")
    around: dict[str, Any] = {"key": _LEGEND_COLUMNS, "wide": (1.5, 1.0)}
    if not with_contacts:
        return Chart([[error, plan]], (9.0, 3.4), **around)
    label, result, colour = with_contacts[0]
    joint = result.joints[0]
    title = f"contact force at {joint}"
    forces: list[Any] = [(result, None, tone, "") for _, result, tone in with_contacts]
    if several_joints:
        tones = many(len(result.joints))
        title, colour = "contact forces", tones[0]
        forces = [
            (result, name, tone, name) for name, tone in zip(result.joints, tones, strict=True)
        ]
    force = overlaid(
        result.plot.panel("forces", "total", name).styled(colour=tone, name=label)
        for result, name, tone, label in forces
    ).renamed("contact force")
    force = replace(force, y=replace(force.y, low=0.0), title=title)
    orbit = _journal(result, joint, "" if single else label, colour)
    return Chart([[error, plan], [force, orbit]], (9.0, 6.2), **around)


def bearing_loads(cases: Cases) -> Chart:
    """Largest element load and number of loaded elements over time, by rolling bearing."""
    rows = []
    for joint in joints_of(cases):
        for label, result, colour in coloured(cases):
            if joint not in result.joints or not analysis.rolls(result, joint):
                continue
            load = result.plot.panel("contacts", joint).styled(colour=colour)
            title = f"{label}, {joint}"
            load = replace(load, y=replace(load.y, low=0.0), title=title, colour=colour)
            rows.append([load, result.plot.panel("loaded", joint).styled(colour=colour, width=0.6)])
    return Chart(rows, (9.0, 0.6 + 2.0 * len(rows)), same_x=True)


CHARTS: dict[str, Callable[[Cases], Chart]] = {
    "tool_displacement": partial(_tool_history, of="tool_position"),
    "tool_velocity": partial(_tool_history, of="tool_velocity"),
    "tool_path": tool_path,
    "journal_orbit": journal_orbit,
    **{f"force_{axis}": partial(joint_force, axis=axis) for axis in AXES},
    "overview": overview,
    "bearing_loads": bearing_loads,
}
_NEEDS: dict[str, Callable[[Cases], Any]] = {
    "journal_orbit": joints_of,
    "overview": lambda cases: any(map(has_play, cases.values())),
    "tool_path": lambda cases: not is_straight(cases),
    "force_x": lambda cases: "x" in loaded_axes(cases),
    "force_y": lambda cases: "y" in loaded_axes(cases),
    "force_z": lambda cases: "z" in loaded_axes(cases),
    "bearing_loads": lambda cases: any(
        analysis.rolls(result, joint) for result in cases.values() for joint in result.joints
    ),
}
"""Conditions for drawing a figure; figures without one are always drawn."""


def _charts(cases: Cases, short: bool = False) -> list[tuple[str, Chart]]:
    """Names and charts of the figures for which the cases have data, or of `SHORT` among them."""
    names = [name for name in CHARTS if name not in _NEEDS or _NEEDS[name](cases)]
    if short and "overview" in names:
        names = [name for name in names if name in SHORT]
    return [(name, CHARTS[name](cases)) for name in names]


def save(cases: Cases, folder: str | Path, pdf: bool = False, short: bool = False) -> list[Path]:
    """Draw all figures into `folder` as PNG, those of the paper's robot under the paper's numbers.

    Orbits are left out if no case has clearance, the overview if none has play, the path if it is a
    straight line. Figures drawn earlier are replaced.

    Args:
        cases: results by label.
        folder: where the files go.
        pdf: also draw each as PDF.
        short: draw the overview and the loads of rolling bearings only; all if nothing has play.

    Returns:
        The files written.

    Raises:
        JointplayError: a file that is not such a figure has its name, or one cannot be written.
    """
    charts, written = _charts(cases, short), []
    urdfs = (analysis.inputs(result)["mechanism"]["urdf"] for result in cases.values())
    paper = all(map(is_paper_robot, urdfs))
    # A second process draws half of them; it costs as much time as one figure.
    half = (len(charts) + 1) // 2 if len(charts) > 2 else len(charts)
    rest = partial(_drawn, charts[half:], pdf)
    with in_parallel(rest) if charts[half:] else nullcontext(list) as others:
        for shown, kind, content in chain(_drawn(charts[:half], pdf), others()):
            path = Path(folder) / f"{PAPER.get(shown, shown) if paper else shown}.{kind}"
            written.append(files.write_picture(path, content, mark=MARK))
    return written


def _drawn(charts: Iterable[tuple[str, Chart]], pdf: bool) -> list[tuple[str, str, bytes]]:
    """Name, format and content of each picture."""
    pictures = []
    for name, chart in charts:
        figure = draw(chart)
        for kind in kinds(pdf):
            pictures.append((name, kind, files.drawn(figure, kind, MARK)))
            figure.set_layout_engine("none")  # it is laid out; to repeat that costs a third more
    return pictures


def spectrum_panels(cases: Cases, start: float | None) -> list[Panel]:
    """Spectra of the tool's acceleration by axis; legends say which runs are too short for one."""
    panels = []
    for axis in AXES:
        panel = Panel(Axis("frequency", "Hz", log=True), Axis(axis, "(m/s^2)^2/Hz", log=True))
        for label, result, colour in coloured(cases):
            try:
                spectrum = result.plot.panel("spectrum", axis, start=start)
                marks = spectrum.styled(colour=colour, name=label).marks
            except TooShort:
                marks = [Curve([], [], f"{label}: too short for a spectrum", colour)]
            panel = panel.with_marks(*marks)
        panels.append(panel)
    return panels
