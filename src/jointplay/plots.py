"""The paper's Figures 9-15 and an overview, for one or several cases, as PNG and PDF."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
import pinocchio as pin
from matplotlib.figure import Figure

from jointplay.mechanism import Mechanism
from jointplay.result import AXES, Result

COLOURS = ("red", "blue", "magenta", "darkgreen", "darkorange", "teal")
"""The paper's: ideal red, 0.2 mm blue, 0.5 mm magenta; then further ones for further cases."""

STYLE = {
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 0.9,
    "legend.frameon": False,
    "savefig.dpi": 160,
    "pdf.fonttype": 42,
    "figure.constrained_layout.use": True,
    "axes.formatter.useoffset": False,
}

Cases = Mapping[str, Result]
"""Results by label, in drawing order; the first one without clearance is the reference."""


def reference(cases: Cases) -> Result | None:
    """The ideal robot among the cases, if there is one."""
    return next((result for result in cases.values() if not result.joints), None)


def joint_of(cases: Cases) -> str | None:
    """The clearance joint that the cases compare: the first one of the first case that has any."""
    return next((result.joints[0] for result in cases.values() if result.joints), None)


def _coloured(cases: Cases) -> Iterator[tuple[str, Result, str]]:
    # Without an ideal case the first colour stays free: red means ideal.
    shift = 0 if reference(cases) is not None else 1
    for index, (label, result) in enumerate(cases.items()):
        yield label, result, COLOURS[(index + shift) % len(COLOURS)]


def _figure(width: float, height: float, rows: int, columns: int, **options: Any) -> Any:
    figure = Figure(figsize=(width, height))
    return figure, figure.subplots(rows, columns, squeeze=False, **options)


def _legend(figure: Figure, axes: Any) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    for line in figure.legends[0].get_lines():
        line.set_linewidth(2.0)


def _tool_history(cases: Cases, variable: str, scale: float, quantity: str, unit: str) -> Figure:
    """x, y, z over time; beside it the difference from the ideal robot, which is what play does."""
    ideal = reference(cases)
    compare = ideal is not None and len(cases) > 1
    figure, panels = _figure(9.0 if compare else 6.0, 6.0, 3, 2 if compare else 1, sharex=True)
    small = "mm" if unit == "m" else "mm/s"
    for row, axis in enumerate(AXES):
        for label, result, colour in _coloured(cases):
            values = result[variable].sel(axis=axis).values
            panels[row, 0].plot(result.time, values * scale, color=colour, label=label)
            if compare and result is not ideal:
                assert ideal is not None
                n = min(len(values), len(ideal.time))
                difference = values[:n] - ideal[variable].sel(axis=axis).values[:n]
                panels[row, 1].plot(result.time[:n], 1e3 * difference, color=colour)
        panels[row, 0].set_ylabel(f"{quantity} {axis} [{unit}]")
        if compare:
            panels[row, 1].set_ylabel(f"{axis} - ideal [{small}]")
    if compare:
        panels[0, 1].set_title("difference from the ideal robot", fontsize=9)
    for panel in panels[-1]:
        panel.set_xlabel("time [s]")
    _legend(figure, panels[0, 0])
    return figure


def tool_displacement(cases: Cases) -> Figure:
    """Figure 9: displacement of the end effector over time."""
    return _tool_history(cases, "tool_position", 1.0, "displacement", "m")


def tool_velocity(cases: Cases) -> Figure:
    """Figure 10: velocity of the end effector over time."""
    return _tool_history(cases, "tool_velocity", 1.0, "velocity", "m/s")


def tool_path(cases: Cases) -> Figure:
    """Figure 11: path of the end effector in the XOY plane, and a close-up where it differs."""
    ideal = reference(cases)
    compare = ideal is not None and len(cases) > 1
    figure, panels = _figure(9.0 if compare else 5.0, 4.4, 1, 2 if compare else 1)
    whole = panels[0, 0]
    worst, spot = 0.0, np.zeros(2)
    for label, result, colour in _coloured(cases):
        x, y = (result["tool_position"].sel(axis=axis).values for axis in "xy")
        for panel in panels[0]:
            panel.plot(x, y, color=colour, label=label)
        if compare and result is not ideal:
            assert ideal is not None
            n = min(len(x), len(ideal.time))
            straight = ideal["tool_position"].values[:n, :2]
            away = np.hypot(x[:n] - straight[:, 0], y[:n] - straight[:, 1])
            if away.max() > worst:
                worst, spot = float(away.max()), straight[int(away.argmax())]
    whole.set_aspect("equal", adjustable="datalim")
    for panel in panels[0]:
        panel.set_xlabel("x [m]")
        panel.set_ylabel("y [m]")
    if compare and worst > 0.0:
        close = panels[0, 1]
        reach = 2.5 * worst
        close.set_xlim(spot[0] - reach, spot[0] + reach)
        close.set_ylim(spot[1] - reach, spot[1] + reach)
        close.set_aspect("equal")
        close.tick_params(axis="x", rotation=30)
        close.set_title(f"where it differs most: {1e3 * worst:.2f} mm", fontsize=9)
        whole.plot(*spot, "s", mfc="none", mec="black", ms=9)
    _legend(figure, whole)
    return figure


def journal_orbit(cases: Cases) -> Figure:
    """Figure 12: path of the journal's centre inside the bearing's clearance circle."""
    shown = [item for item in _coloured(cases) if item[1].joints]
    figure, panels = _figure(4.3 * len(shown), 4.5, 1, len(shown))
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    for panel, (label, result, colour) in zip(panels[0], shown, strict=True):
        name = result.joints[0]
        joint = result.simulation.mechanism.clearance[name]
        centre = 1e3 * result["journal_centre"].sel(joint=name).values
        radius = 1e3 * joint.radial_room
        circle = (radius * np.cos(angle), radius * np.sin(angle))
        panel.plot(*circle, color="black", lw=1.2, label=f"clearance circle, {radius:g} mm")
        panel.plot(centre[:, 0], centre[:, 1], color=colour, lw=0.5, label="journal centre")
        panel.set_aspect("equal")
        panel.set_title(f"{label}, {name}", fontsize=9)
        panel.set_xlabel("x in the bearing frame [mm]")
        panel.set_ylabel("y in the bearing frame [mm]")
        panel.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, fontsize=8)
    return figure


def joint_force(cases: Cases, axis: str) -> Figure:
    """Figures 13-15: force on the journal along a world axis over time, one panel a case.

    With clearance the contact force, each record showing the force at the instant since the last
    record at which its magnitude was largest; for the ideal robot the constraint force.
    """
    name = joint_of(cases)
    figure, panels = _figure(7.0, 1.3 + 1.7 * len(cases), len(cases), 1, sharex=True, sharey=True)
    column = panels[:, 0]
    for panel, (label, result, colour) in zip(column, _coloured(cases), strict=True):
        if result.joints:
            values = result["joint_force_peak"].sel(joint=result.joints[0], axis=axis).values
        else:
            joints = result["reaction_force"].sel(axis=axis)
            chosen = name if name is not None else str(joints["moving_joint"].values[0])
            values = joints.sel(moving_joint=chosen).values
        panel.plot(result.time, values, color=colour, lw=0.8)
        panel.set_ylabel(f"F{axis} [N]")
        panel.set_title(label, fontsize=9, loc="left", color=colour)
    column[-1].set_xlabel("time [s]")
    where = f" at {name}" if name is not None else ""
    figure.suptitle(f"joint contact force{where} along world {axis}", fontsize=10)
    return figure


def _skeleton(mechanism: Mechanism, q: np.ndarray) -> np.ndarray:
    """Origins of the joints down the chain to the tool, in world axes (n, 3) [m]."""
    model, data = mechanism.model, mechanism.data
    pin.framesForwardKinematics(model, data, q)
    joint = model.frames[mechanism.tool_frame].parentJoint
    points = [data.oMf[mechanism.tool_frame].translation.copy()]
    while joint > 0:
        points.append(data.oMi[joint].translation.copy())
        joint = model.parents[joint]
    return np.array(points[::-1])


def overview(cases: Cases) -> Figure:
    """The robot from above, its tool's error (or the tilt), the journal's orbit, the force."""
    figure = Figure(figsize=(9.0, 6.2))
    (plan, error), (orbit, force) = figure.subplots(2, 2, width_ratios=(1.0, 1.5))
    ideal = reference(cases)
    shown = [item for item in _coloured(cases) if item[1].joints]
    first = ideal or next(iter(cases.values()))
    mechanism = first.simulation.mechanism
    for moment in (0, int(np.abs(first["v"].values).sum(axis=1).argmax()), len(first.time) // 2):
        points = _skeleton(mechanism, first["q"].values[moment])
        plan.plot(points[:, 0], points[:, 1], "-o", color="0.6", lw=3.0, ms=5.0, alpha=0.7)
    for _, result, colour in _coloured(cases):
        path = result["tool_position"].values
        plan.plot(path[:, 0], path[:, 1], color=colour, lw=1.0)
    plan.set_title("from above, with the tool's path", fontsize=9)
    plan.set_xlabel("x [m]")
    plan.set_ylabel("y [m]")
    for label, result, colour in reversed(shown):
        if ideal is not None:
            n = min(len(result.time), len(first.time))
            away = result["tool_position"].values[:n] - ideal["tool_position"].values[:n]
            away = 1e3 * np.linalg.norm(away, axis=1)
            error.plot(result.time[:n], away, color=colour, label=label)
        else:
            error.plot(result.time, 1e3 * result["tilt"].values[:, 0], color=colour, label=label)
        peak = np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1)
        force.plot(result.time, peak, color=colour, label=label)
    error.set_ylabel("tool error [mm]" if ideal is not None else "tilt [mrad]")
    force.set_ylabel("contact force [N]")
    force.set_xlabel("time [s]")
    error.legend()
    label, result, colour = shown[-1]
    radius = 1e3 * result.simulation.mechanism.clearance[result.joints[0]].radial_room
    angle = np.linspace(0.0, 2.0 * np.pi, 361)
    centre = 1e3 * result["journal_centre"].values[:, 0]
    orbit.plot(radius * np.cos(angle), radius * np.sin(angle), color="black")
    orbit.plot(centre[:, 0], centre[:, 1], color=colour, lw=0.5)
    orbit.set_title(f"journal centre in its bearing, {label}", fontsize=9)
    orbit.set_xlabel("x in the bearing frame [mm]")
    orbit.set_ylabel("y in the bearing frame [mm]")
    for panel in (plan, orbit):
        panel.set_aspect("equal")
    return figure


def _force(axis: str) -> Callable[[Cases], Figure]:
    return lambda cases: joint_force(cases, axis)


FIGURES: dict[str, Callable[[Cases], Figure]] = {
    "fig09": tool_displacement,
    "fig10": tool_velocity,
    "fig11": tool_path,
    "fig12": journal_orbit,
    "fig13": _force("x"),
    "fig14": _force("y"),
    "fig15": _force("z"),
    "overview": overview,
}
NEEDS_CLEARANCE = ("fig12", "overview")


@contextmanager
def style() -> Iterator[None]:
    """Use this package's look, leaving the user's own settings alone."""
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]
        yield


def save(cases: Cases, folder: str | Path) -> list[Path]:
    """Draw Figures 9-15 and an overview into `folder`, each as PNG and PDF.

    Figure 12 and the overview are left out if no case has clearance.

    Returns:
        The files written.
    """
    written = []
    with style():
        for name, draw in FIGURES.items():
            if name in NEEDS_CLEARANCE and joint_of(cases) is None:
                continue
            figure = draw(cases)
            for kind in ("png", "pdf"):
                path = Path(folder) / f"{name}.{kind}"
                figure.savefig(path)
                figure.set_layout_engine("none")  # laid out by now; again costs a third more
                written.append(path)
    return written
