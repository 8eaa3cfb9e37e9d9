"""Figures of one or several cases, named by what they show; the paper's, as it numbers them."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from jointplay import analysis
from jointplay.analysis.headline import reference as ideal_run
from jointplay.analysis.spectra import TooShort
from jointplay.core import files
from jointplay.mechanism.mechanism import Mechanism
from jointplay.plots.names import MARK, PAPER, is_paper_robot
from jointplay.plots.palette import COLOURS, Cases, colours, reference
from jointplay.plots.style import footnote, listed, new_figure, style
from jointplay.result.result import AXES, Result

_LEGEND_COLUMNS = 3
_ORBITS = 3
_STILL = 1e-6
"""Motion along an axis relative to the largest, below which there is none."""
"""Columns of a legend, and of orbits, at most."""


def joint_of(cases: Cases) -> str | None:
    """The clearance joint that the cases compare: the first one of the first case that has any."""
    return next((result.joints[0] for result in cases.values() if result.joints), None)


def coloured(cases: Cases) -> Iterator[tuple[str, Result, str]]:
    """Label, result and colour of each case."""
    for (label, result), colour in zip(cases.items(), colours(cases), strict=True):
        yield label, result, colour


def compared(cases: Cases) -> Iterator[tuple[str, Result, str, Result]]:
    """Label, result, colour and reference of each case that has a reference among the cases."""
    ideal = reference(cases)
    for label, result, colour in coloured(cases):
        if ideal is not None and analysis.has_play(result) and analysis.is_twin(result, ideal):
            yield label, result, colour, ideal


def is_paper(cases: Cases) -> bool:
    """Whether the cases are runs of the paper's robot, whose figures have the paper's numbers."""
    return all(
        is_paper_robot(analysis.inputs(result)["mechanism"]["urdf"]) for result in cases.values()
    )


def _figure(width: float, height: float, rows: int, columns: int, **options: Any) -> Any:
    figure = new_figure(width, height)
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def ordered_legend(figure: Figure, axes: Any) -> None:
    """Put the legend of some axes above the figure, to be read row by row."""
    handles, labels = axes.get_legend_handles_labels()
    columns = min(len(labels), _LEGEND_COLUMNS)
    # matplotlib fills columns; cases are read in rows.
    order = [i for column in range(columns) for i in range(column, len(labels), columns)]
    figure.legend(
        [handles[i] for i in order],
        [labels[i] for i in order],
        loc="outside upper center",
        ncols=columns,
    )
    for line in figure.legends[0].get_lines():
        line.set_linewidth(2.0)


def _mark_start(panels: Any, cases: Cases) -> str:
    """Shade over time what is not judged, while journals fall into their bearings; its words."""
    until = max((result.judge_from for result in cases.values() if result.joints), default=0.0)
    if until <= 0.0:
        return ""
    for panel in np.ravel(panels):
        panel.axvspan(0.0, until, color="0.88", lw=0.0, zorder=0.0)
    return f"Grey: the first {until:g} s, in which journals fall into their bearings, not judged."


def _tool_history(cases: Cases, of: str) -> Figure:
    """x, y, z over time; beside it the difference from the ideal robot, which is what play does."""
    pairs = list(compared(cases))
    axes = moving_axes(cases)
    high, columns = 1.4 + 1.55 * len(axes), 2 if pairs else 1
    figure, panels = _figure(9.0 if pairs else 6.0, high, len(axes), columns, sharex=True)
    for row, axis in enumerate(axes):
        for label, result, colour in coloured(cases):
            draw = result.plot.displacement if of == "tool_position" else result.plot.velocity
            draw(axis, ax=panels[row, 0], color=colour, label=listed(label))
        for _, result, colour, ideal in pairs:
            result.plot.deviation(axis, ideal, of=of, ax=panels[row, 1], color=colour)
        if pairs:
            unit = "mm" if of == "tool_position" else "mm/s"
            panels[row, 1].set_ylabel(f"{axis} - ideal [{unit}]")
    if pairs:
        panels[0, 1].set_title("difference from the ideal robot", fontsize=9)
    for panel in panels[:-1].flat:
        panel.set_xlabel("")
    ordered_legend(figure, panels[0, 0])
    still = [axis for axis in AXES if axis not in axes]
    words = [f"The tool does not move along {' and '.join(still)}."] if still else []
    words += [_mark_start(panels, cases)]
    if any(words):
        footnote(figure, " ".join(filter(None, words)))
    return figure


def moving_axes(cases: Cases) -> list[str]:
    """World axes along which the tool moves in any of the cases; all, if it moves along none."""
    paths = [result["tool_position"].values for result in cases.values()]
    reach = np.max([np.nanmax(path, axis=0) - np.nanmin(path, axis=0) for path in paths], axis=0)
    found = [axis for axis, one in zip(AXES, reach, strict=True) if one > _STILL * reach.max()]
    return found or list(AXES)


def is_straight(cases: Cases) -> bool:
    """Whether the tool stays on a straight line along an axis: there is no path to see."""
    return len(moving_axes(cases)) < 2


def tool_displacement(cases: Cases) -> Figure:
    """Displacement of the end effector over time (Figure 9)."""
    return _tool_history(cases, "tool_position")


def tool_velocity(cases: Cases) -> Figure:
    """Velocity of the end effector over time (Figure 10)."""
    return _tool_history(cases, "tool_velocity")


def tool_path(cases: Cases) -> Figure:
    """Path of the end effector in `plane_of` the cases, a close-up where it differs (Figure 11)."""
    pairs = list(compared(cases))
    plane = plane_of(cases)
    across = [AXES.index(axis) for axis in plane]
    figure, panels = _figure(9.0 if pairs else 5.0, 4.4, 1, 2 if pairs else 1)
    for label, result, colour in coloured(cases):
        for panel in panels[0]:
            result.plot.path(plane, ax=panel, color=colour, label=listed(label))
    begins = [result for result in cases.values() if result.joints and result.judge_from > 0.0]
    for result in begins:
        at = result["tool_position"].values[np.searchsorted(result.time, result.judge_from)]
        panels[0, 0].plot(*at[across], "x", color="black", ms=5.0, zorder=4.0)
    if begins:
        footnote(
            figure,
            "x: where the tool is when judging begins, "
            f"{max(result.judge_from for result in begins):g} s after the start.",
        )
    worst, spot = 0.0, np.zeros(2)
    for _, result, _, ideal in pairs:
        error = analysis.deviation(result, ideal)
        away = np.hypot(*error.values[:, across].T)
        if away.max() > worst:
            worst, k = float(away.max()), int(away.argmax())
            spot = (result["tool_position"].values[k] - error.values[k])[across]
    if worst > 0.0:
        close = panels[0, 1]
        reach = 2.5 * worst
        close.set_aspect("equal", adjustable="box")
        close.set_xlim(spot[0] - reach, spot[0] + reach)
        close.set_ylim(spot[1] - reach, spot[1] + reach)
        close.tick_params(axis="x", rotation=30)
        close.set_title(f"where it differs most: {1e3 * worst:.2f} mm", fontsize=9)
        panels[0, 0].plot(*spot, "s", mfc="none", mec="black", ms=9)
    ordered_legend(figure, panels[0, 0])
    return figure


def joints_of(cases: Cases) -> list[str]:
    """All joints that have clearance in any of the cases."""
    return list(dict.fromkeys(name for result in cases.values() for name in result.joints))


def force_joints(result: Result, cases: Cases) -> list[str]:
    """Joints whose force the figures show: those with clearance in any case, or the first."""
    if result.joints:
        return result.joints
    moving = [str(name) for name in result["moving_joint"].values]
    return [name for name in joints_of(cases) if name in moving] or moving[:1]


def journal_orbit(cases: Cases) -> Figure:
    """Where the journal goes inside the clearance circle, joint by joint (Figure 12).

    The centre of a cylinder's rim that is nearer to the bore, by mode, and below it the path of the
    journal's middle; the middle alone of what has no rims.
    """
    shown = [
        (joint, *item)
        for joint in joints_of(cases)
        for item in coloured(cases)
        if joint in item[1].joints
    ]
    columns = min(max(len(result.joints) and len(cases) for result in cases.values()), _ORBITS)
    columns = max(1, min(columns, len(shown)))
    rims = any(analysis.has_rims(result, joint) for joint, _, result, _ in shown)
    high = 2 if rims else 1
    rows = -(-len(shown) // columns)
    figure, panels = _figure(4.3 * columns, 0.8 + 4.1 * high * rows, high * rows, columns)
    for panel in panels.flat:
        panel.set_axis_off()
    for number, (joint, label, result, colour) in enumerate(shown):
        row, column = divmod(number, columns)
        middle = panels[high * row + high - 1, column]
        if reference(cases) is not None:
            middle.plot(0.0, 0.0, "o", color=COLOURS[0], ms=5.0, zorder=4.0)
        draws = [(middle, result.plot.orbit, {"color": colour})]
        if analysis.has_rims(result, joint):
            draws.insert(0, (panels[high * row, column], result.plot.rims, {}))
        for panel, draw, look in draws:
            panel.set_axis_on()
            draw(joint, ax=panel, **look)
            panel.set_title(f"{label}: {panel.get_title()}", fontsize=9)
    if rims:
        named = next(panel for panel in panels.flat if panel.get_legend_handles_labels()[0])
        ordered_legend(figure, named)
        for handle in figure.legends[0].legend_handles:
            handle.set_markersize(8.0)
        ideal = "; the ideal joint's is the red point" if reference(cases) else ""
        footnote(
            figure,
            "Above: the centre of the journal's rim that is nearer to the bore, as far inside the "
            "circle as its gap is wide, penetration as far outside, magnified; colours by the mode "
            "of the joint (inside it, penetration is at an end wall). "
            f"Below: the centre of the journal's middle{ideal}. A tilted journal touches the bore "
            "by its rims, while its middle stays inside.",
        )
    return figure


def joint_force(cases: Cases, axis: str) -> Figure:
    """Force on the journal along a world axis over time, a panel a case and joint (Figures 13-15).

    With clearance the contact force, each record showing the force at the instant since the last
    record at which its magnitude was largest; for the ideal robot the constraint force.
    """
    shown = [
        (label, result, colour, joint)
        for label, result, colour in coloured(cases)
        for joint in force_joints(result, cases)
    ]
    figure, panels = _figure(7.0, 1.3 + 1.7 * len(shown), len(shown), 1, sharex=True, sharey="col")
    column = panels[:, 0]
    several = len({joint for *_, joint in shown}) > 1
    for panel, (label, result, colour, joint) in zip(column, shown, strict=True):
        result.plot.forces(axis, joint, ax=panel, color=colour, lw=0.8)
        title = f"{label}, {joint}" if several else label
        panel.set_title(title, fontsize=9, loc="left", color=colour)
        panel.set_xlabel("")
    column[-1].set_xlabel("time [s]")
    where = "" if several or not shown else f" at {shown[0][3]}"
    figure.suptitle(f"force on the journal{where} along world {axis}", fontsize=10)
    words = [_mark_start(column, cases)]
    if not all(result.joints for _, result, _, _ in shown):
        words.append(
            "With clearance the force of the contacts, the largest since the last record; that of "
            "the ideal joint is a constraint force: nothing touches there."
        )
    if any(words):
        footnote(figure, " ".join(filter(None, words)))
    return figure


def _skeleton(mechanism: Mechanism, q: np.ndarray) -> list[np.ndarray]:
    """Lines from each joint to that of its parent, to the ends of loops on what it carries, then to
    the tool, in world axes (n, 3) [m]; nothing of the base."""
    model, data = mechanism.model, mechanism.data
    pin.framesForwardKinematics(model, data, q)
    at = [place.translation.copy() for place in data.oMi]
    lines = [
        np.array([at[model.parents[i]], at[i]]) for i in range(1, model.njoints) if model.parents[i]
    ]
    for name in mechanism.loops:
        for i, placement in (mechanism.bearing_frame(name), mechanism.journal_frame(name)):
            if i:
                lines.append(np.array([at[i], data.oMi[i].act(placement.translation)]))
    tool = model.frames[mechanism.tool_frame].parentJoint
    return [*lines, np.array([at[tool], data.oMf[mechanism.tool_frame].translation])]


def plane_of(cases: Cases) -> str:
    """The paper's XOY plane, or where the tool hardly moves in it the plane in which it does."""
    reach = np.ptp(np.concatenate([r["tool_position"].values for r in cases.values()]), axis=0)
    if min(reach[:2]) >= 0.01 * reach.max() or reach[2] <= min(reach[:2]):
        return "xy"
    return "xz" if reach[0] >= reach[1] else "yz"


def overview(cases: Cases) -> Figure:
    """The robot from above, its tool's error (or the tilt), the journal's orbit, the force."""
    figure = new_figure(9.0, 6.2)
    (plan, error), (orbit, force) = figure.subplots(2, 2, width_ratios=(1.0, 1.5))
    shown = [item for item in coloured(cases) if item[1].joints]
    pairs = list(compared(cases))
    if not pairs:  # the ideal mechanism is simulated, where it can be
        alone = ((item, ideal_run(item[1])) for item in coloured(cases))
        pairs = [(*item, ideal) for item, ideal in alone if ideal is not None]
    first = reference(cases) or next(iter(cases.values()))
    mechanism, plane = first.simulation.mechanism, plane_of(cases)
    for moment in (0, int(np.abs(first["v"].values).sum(axis=1).argmax()), len(first.time) // 2):
        for line in _skeleton(mechanism, first["q"].values[moment]):
            drawn = line[:, [AXES.index(axis) for axis in plane]].T
            plan.plot(*drawn, "-o", color="0.6", lw=3.0, ms=5.0, alpha=0.7)
    for _, result, colour in coloured(cases):
        result.plot.path(plane, ax=plan, color=colour, lw=1.0, label="_")
    plan.set_title(f"{plane} plane, with the tool's path", fontsize=9)
    for label, result, colour, ideal in reversed(pairs):
        result.plot.deviation("total", ideal, ax=error, color=colour, label=listed(label))
    for label, result, colour in reversed(shown):
        if not pairs:
            result.plot.tilt(ax=error, color=colour, label=listed(label))
        result.plot.forces("total", ax=force, color=colour, label=listed(label))
    if pairs:
        error.set_ylabel("tool error [mm]")
    error.set_xlabel("")
    force.set_ylabel("contact force [N]")
    for label, _, colour in shown:  # drawn from the last case on, named from the first
        plan.plot([], [], color=colour, label=listed(label))
    ordered_legend(figure, plan)
    label, result, colour = shown[-1]
    result.plot.orbit(ax=orbit, color=colour)
    ring = analysis.rolls(result, result.joints[0])
    what = "inner ring in the outer one" if ring else "journal centre in its bearing"
    joint = result.joints[0]
    orbit.set_title(f"{what}, {joint}, {label}", fontsize=9)
    force.set_title(f"contact force at {joint}", fontsize=9)
    plan.set_aspect("equal", adjustable="datalim")
    orbit.set_aspect("equal", adjustable="box")
    return figure


def bearings_of(cases: Cases) -> list[tuple[str, str, Result, str]]:
    """Rolling bearings of all cases: joint, label, result, colour."""
    return [
        (joint, *item)
        for joint in joints_of(cases)
        for item in coloured(cases)
        if joint in item[1].joints and analysis.rolls(item[1], joint)
    ]


def bearing_loads(cases: Cases) -> Figure:
    """Largest element load and number of loaded elements over time, a row a rolling bearing."""
    shown = bearings_of(cases)
    height = 0.6 + 2.0 * max(len(shown), 1)
    figure, panels = _figure(9.0, height, max(len(shown), 1), 2, sharex=True)
    for (load, loaded), (joint, label, result, colour) in zip(panels, shown, strict=True):
        result.plot.contacts(joint, ax=load, color=colour)
        load.set_ylim(bottom=0.0)
        result.plot.loaded(joint, ax=loaded, color=colour, lw=0.6)
        load.set_title(f"{label}, {joint}", fontsize=9, loc="left", color=colour)
        for panel in (load, loaded):
            panel.set_xlabel("")
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    return figure


FIGURES: dict[str, Callable[[Cases], Figure]] = {
    "tool_displacement": tool_displacement,
    "tool_velocity": tool_velocity,
    "tool_path": tool_path,
    "journal_orbit": journal_orbit,
    **{f"force_{axis}": partial(joint_force, axis=axis) for axis in AXES},
    "overview": overview,
    "bearing_loads": bearing_loads,
}
NEEDS_CLEARANCE = ("journal_orbit", "overview")


def _drawn(cases: Cases) -> Iterator[tuple[str, Figure]]:
    for name, draw in FIGURES.items():
        if name in NEEDS_CLEARANCE and joint_of(cases) is None:
            continue
        if name == "tool_path" and is_straight(cases):
            continue
        if name != "bearing_loads" or bearings_of(cases):
            yield name, draw(cases)


def save(cases: Cases, folder: str | Path) -> list[Path]:
    """Draw all figures into `folder`, each as PNG and PDF; the paper's under their numbers.

    Orbits and overview are left out if no case has clearance, the path if it is a straight line.
    Figures drawn earlier are replaced.

    Returns:
        The files written.

    Raises:
        JointplayError: another file has the name of one, or it cannot be written.
    """
    written = []
    paper = is_paper(cases)
    with style():
        for shown, figure in _drawn(cases):
            name = PAPER.get(shown, shown) if paper else shown
            for kind in ("png", "pdf"):
                path = Path(folder) / f"{name}.{kind}"
                written.append(files.picture(path, figure, mark=MARK))
                figure.set_layout_engine("none")  # laid out by now; again costs a third more
    return written


def _states(cases: Cases) -> Iterator[tuple[str, Figure]]:
    """Timelines, contacts and spectra of every case with clearance."""
    for label, result, colour in coloured(cases):
        for joint in result.joints:
            figure = new_figure(8.0, 8.0)
            has_forms = bool(analysis.shares(result, joint, "form"))
            ratios = (1, 2, 2, 2) if has_forms else (1, 2, 2)
            modes, *rest, contacts, gaps = figure.subplots(len(ratios), 1, height_ratios=ratios)
            result.plot.modes(joint, ax=modes)
            for forms in rest:
                result.plot.forms(joint, ax=forms)
            result.plot.contacts(joint, ax=contacts)
            result.plot.gaps(joint, ax=gaps)
            ring = analysis.rolls(result, joint)
            shown = "loads and gaps of elements" if ring else "modes, forms, contacts, gaps"
            figure.suptitle(f"{label}, {joint}: {shown}", color=colour)
            yield f"{label}, {joint}", figure
            figure = new_figure(7.0, 4.0)
            left, right = figure.subplots(1, 2)
            result.plot.impacts(joint, ax=left)
            result.plot.tilt(joint, ax=right, color=colour)
            figure.suptitle(f"{label}, {joint}: contacts by duration and peak; tilt", color=colour)
            yield f"{label}, {joint}", figure
        figure = new_figure(7.0, 4.2)
        panel = figure.subplots()
        result.plot.energy(ax=panel)
        figure.suptitle(f"{label}: energy balance", color=colour)
        yield label, figure


def _spectra(cases: Cases, start: float | None) -> Figure:
    figure, panels = _figure(7.0, 6.5, 3, 1, sharex=True)
    for panel, axis in zip(panels[:, 0], AXES, strict=True):
        for label, result, colour in coloured(cases):
            try:
                result.plot.spectrum(axis, start=start, ax=panel, color=colour, label=listed(label))
            except TooShort:
                reason = f"{listed(label)}: too short for a spectrum"
                panel.plot([], [], color=colour, label=reason)
        panel.set_xlabel("")
    panels[-1, 0].set_xlabel("frequency [Hz]")
    if panels[0, 0].get_lines():
        ordered_legend(figure, panels[0, 0])
    return figure


def save_pdf(
    cases: Cases, path: str | Path, start: float | None = None, look: str = "paper"
) -> Path:
    """Draw every figure of the cases into one PDF, vector graphics, a figure a page.

    Args:
        cases: results by label.
        path: the file; an existing one is refused.
        start: records before this are left out of spectra [s]; None: before each run is judged.
        look: style of the pages' type; pages keep the size they have on screen.

    Raises:
        JointplayError: the file exists or cannot be written.
    """
    path = files.check_new(path)
    return files.write(path, pdf(cases, start, look))


def pdf(cases: Cases, start: float | None = None, look: str = "paper") -> bytes:
    """The file that `save_pdf` writes."""
    drawn = io.BytesIO()
    with style(look), PdfPages(drawn) as pages:
        pages.infodict()["Title"] = f"jointplay: {', '.join(cases)}"
        for _, figure in _drawn(cases):
            pages.savefig(figure)
        for _, figure in _states(cases):
            pages.savefig(figure)
        pages.savefig(_spectra(cases, start))
    return drawn.getvalue()
