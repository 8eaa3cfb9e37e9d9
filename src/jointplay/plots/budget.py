"""Figures of an error budget: bars, the coloured robot, the reachable set, course and map."""

from __future__ import annotations

from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure

from jointplay.analysis import together
from jointplay.analysis.levers import GEAR
from jointplay.analysis.static_budget import Budget
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.picture import picture
from jointplay.plots.style import COLOURS, footnote, new_figure, style

_SHARES = "YlOrRd"
_ERRORS = "viridis"


def bars(budget: Budget, pose: int | None = None) -> Figure:
    """What each joint adds to the tool's error at a pose, by default the worst one."""
    at = budget.worst_pose if pose is None else pose
    place = np.arange(len(budget.joints))
    groups = (
        (f"worst case, all {1e3 * budget.worst[at]:.3g} mm", budget.worst_parts[at], COLOURS[0]),
        (
            f"RMS over load directions, all {1e3 * budget.rms[at]:.3g} mm",
            budget.rms_parts[at],
            COLOURS[1],
        ),
        (
            f"at rest, all {1e3 * budget.rest_error[at]:.3g} mm",
            np.linalg.norm(budget.rest[at, :, :3], axis=1),
            COLOURS[3],
        ),
    )
    with style():
        figure = new_figure(7.0, 1.6 + 0.42 * len(place))
        axes: Any = figure.subplots()
        for index, (label, values, colour) in enumerate(groups):
            axes.barh(place + 0.27 * (index - 1), 1e3 * values, 0.25, label=label, color=colour)
        axes.set_yticks(place, budget.joints)
        axes.invert_yaxis()
        axes.set_xlabel(f"what the joint adds to the error of {budget.tool!r} [mm]")
        figure.legend(loc="outside upper center", ncols=2)
        footnote(figure, budget.accuracy)
    return figure


def robot(mechanism: Mechanism, budget: Budget, q: np.ndarray) -> Figure:
    """The robot, each body coloured by its joint's share of the worst case at the worst pose.

    Args:
        mechanism: the robot.
        budget: its budget.
        q: the budget's configurations, shape (n, nq).
    """
    share: dict[str, float] = {}
    for name, value in zip(budget.joints, budget.shares, strict=True):
        joint = name.removesuffix(GEAR)
        share[joint] = share.get(joint, 0.0) + float(value)
    scale = Normalize(0.0, 100.0 * max(max(share.values()), 1e-9))
    palette = mpl.colormaps[_SHARES]
    colours = {name: to_hex(palette(scale(100.0 * value))) for name, value in share.items()}
    labels = {name: f"{name}: {100 * value:.1f} %" for name, value in share.items()}
    worst = 1e3 * budget.worst[budget.worst_pose]
    figure = picture(
        mechanism,
        q[budget.worst_pose],
        title=f"where the worst case of {worst:.3g} mm at {budget.tool!r} comes from (static)",
        colours=colours,
        labels=labels,
    )
    figure.colorbar(
        ScalarMappable(scale, palette),
        ax=figure.axes[0],
        shrink=0.6,
        label="share of the joint that carries the body [%]",
    )
    return figure


def reachable(budget: Budget, pose: int | None = None) -> Figure:
    """All places that the tool can take at a pose, seen along x, y and z; and what rest is."""
    at = budget.worst_pose if pose is None else pose
    angle = np.linspace(0.0, 2.0 * np.pi, 241)
    rest = 1e3 * budget.rest[at, :, :3].sum(axis=0)
    with style():
        figure = new_figure(8.5, 3.4)
        axes: Any = figure.subplots(1, 3)
        for panel, (i, j) in zip(axes, ((0, 1), (0, 2), (1, 2)), strict=True):
            directions = np.zeros((len(budget.positions), len(angle), 3))
            directions[..., i], directions[..., j] = np.cos(angle), np.sin(angle)
            outline = np.zeros((len(angle), 3))
            for error in together.along(budget.sources, directions).error[:, at]:
                outline = outline + error[:, :3]
                panel.plot(*(1e3 * outline[:, [i, j]]).T, color="0.75", lw=0.6)
            panel.plot(*(1e3 * outline[:, [i, j]]).T, color=COLOURS[0], label="reachable")
            panel.plot(rest[i], rest[j], "o", color=COLOURS[3], ms=5, label="at rest")
            panel.plot(0.0, 0.0, "+", color="black", label="without play")
            panel.set(xlabel=f"{'xyz'[i]} [mm]", ylabel=f"{'xyz'[j]} [mm]")
            panel.set_aspect("equal", adjustable="datalim")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=3)
        joints = ", ".join(budget.joints)
        footnote(figure, f"grey: first joint, first two, ... of {joints}\n{budget.accuracy}")
    return figure


def course(budget: Budget, time: np.ndarray | None = None) -> Figure:
    """Error along a motion: worst case by joint, stacked; and at rest, and RMS.

    Args:
        budget: along the motion.
        time: of its poses [s], shape (n,); None counts them.
    """
    x = np.arange(len(budget.worst)) if time is None else time
    with style():
        figure = new_figure(7.0, 3.6)
        axes: Any = figure.subplots()
        tones = mpl.colormaps["tab20"](np.linspace(0.0, 1.0, max(len(budget.joints), 2)))
        axes.stackplot(
            x, 1e3 * budget.worst_parts.T, labels=budget.joints, colors=tones, alpha=0.75
        )
        axes.plot(x, 1e3 * budget.worst, color="black", label="worst case")
        axes.plot(x, 1e3 * budget.rms, "--", color="black", label="RMS over load directions")
        axes.plot(x, 1e3 * budget.rest_error, ":", color="black", label="at rest under its load")
        axes.set(
            xlabel="pose" if time is None else "time in the motion [s]",
            ylabel=f"error of {budget.tool!r} [mm]",
            xlim=(x[0], x[-1]),
        )
        axes.set_ylim(bottom=0.0)
        figure.legend(loc="outside right upper", fontsize=7)
        footnote(figure, budget.accuracy)
    return figure


def workspace_map(budget: Budget) -> Figure:
    """Where in the workspace the worst case is large: from the side and from above."""
    x, y, z = budget.positions.T
    views = (
        (np.hypot(x, y), z, "distance from the z axis [m]", "z [m]"),
        (x, y, "x [m]", "y [m]"),
    )
    order = np.argsort(budget.worst)
    with style():
        figure = new_figure(8.0, 4.0)
        axes: Any = figure.subplots(1, 2)
        for panel, (across, up, word, other) in zip(axes, views, strict=True):
            drawn = panel.scatter(
                across[order],
                up[order],
                c=1e3 * budget.worst[order],
                cmap=_ERRORS,
                s=14,
                linewidths=0,
            )
            panel.set(xlabel=word, ylabel=other)
            panel.set_aspect("equal", adjustable="datalim")
        figure.colorbar(drawn, ax=axes, label=f"worst-case error of {budget.tool!r} [mm]")
        footnote(figure, budget.accuracy)
    return figure
