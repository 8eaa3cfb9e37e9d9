"""Figures of budgets, allocations, identifications, ISO 9283, wear, reduction and shares."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure

from jointplay.design.allocation import Allocation
from jointplay.design.cause_allocation import CauseAllocation
from jointplay.design.error_budget import ErrorBudget
from jointplay.design.levers import GEAR
from jointplay.design.reduction import Reduction
from jointplay.design.static_budget import Budget
from jointplay.identification import Calibration, Estimate, Identification
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.picture import picture
from jointplay.plots.palette import COLOURS
from jointplay.plots.style import footnote, listed, panels
from jointplay.study.iso9283 import Iso9283
from jointplay.study.maintenance import Maintenance
from jointplay.study.shares import DynamicBudget

# Figures of an error budget: bars, the coloured robot, the reachable set, course and map.


_SHARES = "YlOrRd"
_ERRORS = "viridis"


def bars(budget: Budget, pose: int | None = None) -> Figure:
    """What each joint adds to the tool's error at a pose, by default the worst one."""
    at = budget.worst_pose if pose is None else pose
    place = np.arange(len(budget.joints))
    rests, whole, _ = budget.standing.rest(at)
    groups = (
        ("worst case", budget.worst[at], budget.worst_parts[at], COLOURS[0]),
        ("RMS over load directions", budget.rms[at], budget.rms_parts[at], COLOURS[1]),
        ("at rest", np.linalg.norm(whole[:3]), np.linalg.norm(rests[:, :3], axis=1), COLOURS[3]),
    )
    with panels(7.0, 1.6 + 0.42 * len(place)) as (figure, axes):
        for index, (words, total, values, colour) in enumerate(groups):
            label = f"{words}, all {1e3 * total:.3g} mm"
            axes.barh(place + 0.27 * (index - 1), 1e3 * values, 0.25, label=label, color=colour)
        axes.set_yticks(place, budget.joints)
        axes.invert_yaxis()
        axes.set_xlabel(f"contribution of the joint to the error of {budget.tool!r} [mm]")
        figure.legend(loc="outside upper center", ncols=2)
        footnote(figure, budget.accuracy)
    return figure


def cause_bars(budget: ErrorBudget) -> Figure:
    """Each joint's part of the whole error at the worst pose, by cause."""
    at = budget.worst_pose
    joints = list(dict.fromkeys(one.joint for one in budget.contributions))
    causes = list(budget.by("cause"))
    variance = float(np.trace(budget.covariance[at])) or 1.0
    shown = np.zeros((2, len(causes), len(joints)))
    for part, one in zip(budget.parts[:, at], budget.contributions, strict=True):
        cell = causes.index(one.cause), joints.index(one.joint)
        shown[0][cell] += 1e3 * part
        shown[1][cell] += 100.0 * float(np.trace(one.variance()[at])) / variance
    labels = (
        f"part of the worst case of {1e3 * budget.worst[at]:.3g} mm [mm]",
        f"part of the variance (RMS with the mean {1e3 * budget.rms[at]:.3g} mm) [%]",
    )
    place = np.arange(len(joints))
    with panels(9.0, 1.8 + 0.35 * len(joints), 1, 2, sharey=True) as (figure, axes):
        for panel, values, label in zip(axes, shown, labels, strict=True):
            for k, cause in enumerate(causes):
                panel.barh(
                    place, values[k], 0.6, left=values[:k].sum(axis=0), color=COLOURS[k],
                    label=cause if panel is axes[0] else None,
                )  # fmt: skip
            panel.set_xlabel(label)
            _leave_room(panel)
        axes[0].set_yticks(place, joints)
        axes[0].invert_yaxis()
        figure.legend(loc="outside upper center", ncols=len(causes))
        footnote(figure, "; ".join(budget.assumed))
    return figure


def _leave_room(panel: Axes) -> None:
    """Leave room beside bars that begin where others end, which Matplotlib keeps at the edge."""
    low, high = panel.dataLim.intervalx
    panel.set_xlim(1.03 * min(low, 0.0), 1.03 * high)


def robot(mechanism: Mechanism, budget: Budget, q: np.ndarray) -> Figure:
    """The robot, each body coloured by its joint's share of the worst case at the worst pose."""
    share: dict[str, float] = {}
    gears = {name + GEAR: name for name in mechanism.gears}
    for name, value in zip(budget.joints, budget.shares, strict=True):
        joint = gears.get(name, name)
        share[joint] = share.get(joint, 0.0) + float(value)
    scale = Normalize(0.0, 100.0 * max(max(share.values()), 1e-9))
    palette = mpl.colormaps[_SHARES]
    colours = {name: to_hex(palette(scale(100.0 * value))) for name, value in share.items()}
    labels = {name: f"{name}: {100 * value:.1f} %" for name, value in share.items()}
    worst = 1e3 * budget.worst[budget.worst_pose]
    figure = picture(
        mechanism,
        q[budget.worst_pose],
        title=f"origin of the worst case of {worst:.3g} mm at {budget.tool!r} (static)",
        colours=colours,
        labels=labels,
    )
    figure.set_dpi(130)
    figure.colorbar(
        ScalarMappable(scale, palette),
        ax=figure.axes[0],
        shrink=0.6,
        label="share of the joint that carries the body [%]",
    )
    return figure


def reachable(budget: Budget, pose: int | None = None) -> Figure:
    """All places that the tool can take at a pose, seen along x, y and z; and where it rests.

    The box holds all places in which friction can hold it.
    """
    at = budget.worst_pose if pose is None else pose
    angle = np.linspace(0.0, 2.0 * np.pi, 241)
    rest = 1e3 * budget.standing.rest(at).whole
    ends = 1e3 * budget.standing.interval(at)
    held = f"{budget.standing.words} may hold it"
    if budget.standing.unsearched:
        held = "entire play: friction not searched"
    with panels(8.5, 3.4, 1, 3) as (figure, axes):
        for panel, (i, j) in zip(axes, ((0, 1), (0, 2), (1, 2)), strict=True):
            directions = np.zeros((len(budget.positions), len(angle), 3))
            directions[..., i], directions[..., j] = np.cos(angle), np.sin(angle)
            outline = np.zeros((len(angle), 3))
            for error in budget.sources.along(directions).error[:, at]:
                outline = outline + error[:, :3]
                panel.plot(*(1e3 * outline[:, [i, j]]).T, color="0.75", lw=0.6)
            panel.plot(*(1e3 * outline[:, [i, j]]).T, color=COLOURS[0], label="reachable")
            panel.plot(rest[i], rest[j], "o", color=COLOURS[3], ms=5, label="at rest")
            (left, right), (low, high) = ends[i], ends[j]
            box = [left, right, right, left, left], [low, low, high, high, low]
            panel.plot(*box, "--", color=COLOURS[3], lw=1.0, label=held)
            panel.plot(0.0, 0.0, "+", color="black", label="without play")
            panel.set(xlabel=f"{'xyz'[i]} [mm]", ylabel=f"{'xyz'[j]} [mm]")
            panel.set_aspect("equal", adjustable="datalim")
        handles, labels = axes[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=4)
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
    with panels(7.0, 3.6) as (figure, axes):
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
    with panels(8.0, 4.0, 1, 2) as (figure, axes):
        for panel, (across, up, word, other) in zip(axes, views, strict=True):
            dots: Any = {"c": 1e3 * budget.worst[order], "cmap": _ERRORS, "s": 14, "linewidths": 0}
            drawn = panel.scatter(across[order], up[order], **dots)
            panel.set(xlabel=word, ylabel=other)
            panel.set_aspect("equal", adjustable="datalim")
        figure.colorbar(drawn, ax=axes, label=f"worst-case error of {budget.tool!r} [mm]")
        footnote(figure, budget.accuracy)
    return figure


def allocation(allotment: Allocation) -> Figure:
    """Clearances, what they add to the error, and what another micrometre of each would save."""
    place = np.arange(len(allotment.joints))
    shown = (
        (1e6 * allotment.clearance, "clearance [µm]", COLOURS[1]),
        (1e6 * allotment.gain * allotment.clearance, "adds to the error [µm]", COLOURS[0]),
        (allotment.price, f"saved by one µm more\n[cost, {allotment.cost}]", COLOURS[3]),
    )
    with panels(9.0, 1.6 + 0.35 * len(place), 1, 3, sharey=True) as (figure, axes):
        for panel, (values, label, colour) in zip(axes, shown, strict=True):
            panel.barh(place, values, 0.6, color=colour)
            panel.set_xlabel(label)
        axes[0].set_yticks(place, allotment.joints)
        axes[0].invert_yaxis()
        figure.suptitle(
            f"{allotment.kind} {1e6 * allotment.error:.4g} µm, "
            f"target {1e6 * allotment.target:.4g} µm",
            fontsize=9,
        )
    return figure


def cause_allocation(allotment: CauseAllocation) -> Figure:
    """Each joint's causes as they are and in the end, and what each costs."""
    joints = list(dict.fromkeys(allotment.joints))
    causes = list(dict.fromkeys(allotment.causes))
    shown = np.zeros((3, len(causes), len(joints)))
    values = (1e3 * allotment.before, 1e3 * allotment.after, allotment.price)
    for k, (joint, cause) in enumerate(zip(allotment.joints, allotment.causes, strict=True)):
        shown[:, causes.index(cause), joints.index(joint)] += [one[k] for one in values]
    place, errors = np.arange(len(joints)), allotment.words
    labels = (
        f"part of the {errors} [mm]\npale: {1e3 * allotment.before.sum():.4g} mm as it is; full: "
        f"{1e3 * allotment.error:.4g} mm",
        f"price, {allotment.total:.4g} in all",
    )
    with panels(9.0, 1.9 + 0.42 * len(joints), 1, 2, sharey=True) as (figure, axes):
        for panel, label, bars_of in zip(
            axes, labels, (((0, -0.2, 0.45), (1, 0.2, 1.0)), ((2, 0.0, 1.0),)), strict=True
        ):
            for which, shift, opacity in bars_of:
                ends = {1.0: np.zeros(len(joints)), -1.0: np.zeros(len(joints))}
                for k, cause in enumerate(causes):
                    own = shown[which, k]
                    for sign, end in ends.items():  # loads may shift the tool back
                        part = np.where(np.sign(own) == sign, own, 0.0)
                        named = which == 1 and sign > 0.0
                        panel.barh(
                            place + shift, part, 0.36 if len(bars_of) > 1 else 0.6, left=end,
                            color=COLOURS[k], alpha=opacity, label=cause if named else None,
                        )  # fmt: skip
                        end += part
            panel.set_xlabel(label)
            _leave_room(panel)
        axes[0].set_yticks(place, joints)
        axes[0].invert_yaxis()
        figure.legend(loc="outside upper center", ncols=len(causes))
        footnote(figure, "; ".join(one for one in allotment.notes if one.startswith("assumed")))
    return figure


# Figure of an identification: what was found beside the scenario, restitution, agreement.


_SCALES = {
    "tool": (1e6, "deviation of the tool [µm]"),
    "link": (1e3, "link - motor [mrad]"),
}


def identification(fit: Identification) -> Figure:
    """Intervals relative to the scenario's values, predicted means over measured, restitution."""
    kinds = list(dict.fromkeys(kind for kind, _ in fit.observed.keys))
    words = "statistical; bars: 95 % intervals"
    shown = [one for one in fit.estimates if one.unknown.sought]
    count = bool(shown) + len(kinds) + bool(fit.restitutions)
    height = max(2.0 + 0.3 * len(shown), 3.2)
    with panels(1.6 + 3.0 * count, height, 1, count, squeeze=False) as (figure, axes):
        free = iter(axes[0])
        if shown:
            panel = next(free)
            _intervals(panel, shown, 1.0, [one.unknown.scale for one in shown])
            panel.axvline(1.0, color="0.5", lw=0.8, ls=":")
            panel.set_xlim(left=0.0)
            panel.set_xlabel("found / scenario")
            words += f"; static model, left over {fit.misfit:.2g} standard errors (RMS)"
        for kind in kinds:
            _agreement(next(free), fit, kind)
        if fit.restitutions:
            panel = next(free)
            _intervals(panel, fit.restitutions, 0.5, [1.0] * len(fit.restitutions))
            panel.set_xlim(0.0, 1.0)
            panel.set_xlabel("restitution")
        footnote(figure, words)
    return figure


def _intervals(
    panel: Any, rows: Sequence[Estimate], middle: float, scales: Sequence[float]
) -> None:
    """Name, interval and value of a row each, by its scale; of what cannot be told that it is."""
    for row, (one, scale) in enumerate(zip(rows, scales, strict=True)):
        if one.reason:
            look: Any = {"va": "center", "ha": "center", "color": "0.4", "fontsize": 7}
            panel.text(middle, row, "cannot tell", **look)
            continue
        panel.plot([end / scale for end in one.interval], [row, row], color=COLOURS[1], lw=2.0)
        panel.plot(one.value / scale, row, "o", ms=4, color=COLOURS[1])
    panel.set_yticks(range(len(rows)), [one.label for one in rows])
    panel.set_ylim(len(rows) - 0.5, -0.5)


def _agreement(panel: Any, fit: Identification, kind: str) -> None:
    """Means by the model over measured ones, offsets included."""
    factor, label = _SCALES.get(kind, (1.0, "torque [N m]"))
    ends = []
    for column, (own, name) in enumerate(fit.observed.keys):
        use = np.isfinite(fit.error[:, column])
        if own != kind or not use.any():
            continue
        x = factor * fit.observed.mean[use, column]
        y = factor * fit.predicted[use, column]
        ends += [x.min(), x.max()]
        colour = COLOURS[column % len(COLOURS)]
        bars = factor * fit.error[use, column]
        panel.errorbar(x, y, xerr=bars, fmt=".", ms=3, lw=0.5, color=colour, label=listed(name))
    if ends:
        panel.plot([min(ends), max(ends)], [min(ends), max(ends)], color="0.5", lw=0.7)
        panel.legend(fontsize=6)
    panel.set_xlabel(f"measured: {label}")
    panel.set_ylabel("static model")


def calibration(fit: Calibration) -> Figure:
    """Errors in training and on held-back poses by model, each pose's error, bounds of play."""
    told = [one for one in fit.play if not one.reason]
    count = 3 if told else 2
    with panels(3.4 * count, 1.6 + 0.3 * max(len(fit.steps), 5), 1, count) as (figure, axes):
        place = np.arange(len(fit.steps))
        for offset, name, colour in (
            (-0.2, "training", COLOURS[0]),
            (0.2, "held_back", COLOURS[1]),
        ):
            sizes = [1e3 * getattr(one, name)[0] for one in fit.steps]
            axes[0].barh(place + offset, sizes, 0.38, color=colour, label=name.replace("_", " "))
        names = [one.added + (" (kept)" if one.kept else "") for one in fit.steps]
        axes[0].set_yticks(place, names)
        axes[0].invert_yaxis()
        axes[0].set_xlabel("position error [mm] (RMS)")
        figure.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        for name, colour in (("training", COLOURS[0]), ("held_back", COLOURS[1])):
            sizes = 1e3 * np.linalg.norm(getattr(fit, name)[0], axis=1)
            axes[1].plot(np.arange(1, len(sizes) + 1), sizes, ".", ms=4, color=colour)
        axes[1].set_xlabel("pose")
        axes[1].set_ylabel("position error [mm]")
        axes[1].set_ylim(bottom=0.0)
        for row, one in enumerate(told):
            if one.found:
                axes[2].plot([1e3 * one.low, 1e3 * one.high], [row, row], color=COLOURS[1], lw=2.0)
                axes[2].plot(1e3 * one.value, row, "o", ms=4, color=COLOURS[1])
            else:
                axes[2].barh(row, 1e3 * one.upper, 0.5, color="0.8")
        if told:
            axes[2].set_yticks(range(len(told)), [listed(one.joint) for one in told])
            axes[2].invert_yaxis()
            axes[2].set_xlabel("half-play [mrad or mm]\ninterval; grey: bound")
        footnote(figure, f"held back: {fit.folds}; statistical, 95 %")
    return figure


# Figures of accuracy and repeatability: attained poses around the command, and the path.


MOST_POSES = 6
"""Stops that are drawn: the worst."""


def poses(performance: Iso9283) -> Figure:
    """Attained poses of each cycle about their barycentre, seen along z and y, by stop."""
    worst = sorted(performance.poses, key=lambda pose: -pose.figures["AP_p"].value)[:MOST_POSES]
    shown = sorted(worst, key=lambda pose: pose.time)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    with panels(1.4 + 2.4 * max(len(shown), 2), 5.6, 2, len(shown), squeeze=False) as (
        figure,
        axes,
    ):
        for column, pose in enumerate(shown):
            ap, rp = pose.figures["AP_p"].value, pose.figures["RP_l"].value
            centre = pose.attained.mean(axis=0)
            points = 1e6 * (pose.attained - centre)
            circle = 1e6 * rp * np.array([np.cos(angle), np.sin(angle)])
            towards = -centre / max(float(np.linalg.norm(centre)), 1e-300)
            arrow = 0.8e6 * rp * towards
            for row, (i, j) in enumerate(((0, 1), (0, 2))):
                panel = axes[row, column]
                panel.plot(*points[:, [i, j]].T, "o", ms=2.5, color=COLOURS[0], label="attained")
                panel.plot(0.0, 0.0, "x", color=COLOURS[1], label="barycentre")
                panel.plot(*circle, color=COLOURS[1], lw=0.8, label="RP_l")
                way = "direction to the command pose (length not to scale)"
                panel.plot([0.0, arrow[i]], [0.0, arrow[j]], color="0.6", lw=0.8, label=way)
                panel.set(xlabel=f"{'xyz'[i]} [um]", ylabel=f"{'xyz'[j]} [um]")
                panel.set_aspect("equal", adjustable="datalim")
                panel.locator_params(nbins=5)
            axes[0, column].set_title(
                f"t = {pose.time:.4g} s\nAP_p {1e3 * ap:.3g} mm, RP_l {1e6 * rp:.3g} um",
                fontsize=8,
            )
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        _note(figure, performance)
    return figure


def path(performance: Iso9283) -> Figure:
    """Accuracy and repeatability across the path, along it; AT and RT are their largest."""
    with panels(6.5, 3.4) as (figure, axes):
        lines = (
            (performance.path_accuracy, "AT_p", COLOURS[0]),
            (performance.path_repeatability, "RT_p", COLOURS[1]),
        )
        for values, name, colour in lines:
            label = f"{name} = {performance.path[name].words(1e3, 'mm')}"
            axes.plot(
                performance.path_times, 1e3 * values, ".-", ms=3, lw=0.8, color=colour, label=label
            )
        axes.set(xlabel="time in the cycle [s]", ylabel="across the command path [mm]")
        axes.set_ylim(bottom=0.0)
        figure.legend(loc="outside upper center", ncols=2)
        _note(figure, performance)
    return figure


def _note(figure: Figure, performance: Iso9283) -> None:
    parts = performance.accuracy.split("; ")
    half = len(parts) // 2
    text = "; ".join(parts[:half]) + ";\n" + "; ".join(parts[half:])
    footnote(figure, text)


def wear_course(estimate: Maintenance) -> Figure:
    """The tool's error up to its tolerance, and each joint's growth of clearance."""
    aside = np.sqrt(np.cumsum(np.nan_to_num(estimate.scatter) ** 2))
    with panels(7.5, 3.4, 1, 2) as (figure, axes):
        look: Any = {"fmt": "o-", "ms": 3, "capsize": 2, "color": COLOURS[0]}
        axes[0].errorbar(
            estimate.cycles,
            1e3 * estimate.error,
            xerr=2.0 * aside,
            label="worst case, static",
            **look,
        )
        axes[0].axhline(1e3 * estimate.target, color="black", ls="--", label="tolerance")
        axes[0].set(xlabel="cycles", ylabel="error of the tool [mm]")
        axes[0].set_ylim(bottom=0.0)
        axes[0].legend(fontsize=7)
        for name, depths in zip(estimate.joints, estimate.growth.T, strict=True):
            axes[1].plot(estimate.cycles, 1e6 * depths, "o-", ms=3, label=listed(name))
        axes[1].set(xlabel="cycles", ylabel="growth of clearance, deepest [um]")
        axes[1].legend(fontsize=7)
        low, high = estimate.spread
        footnote(
            figure,
            "an estimate from simulated cycles; bars: two standard errors of the perturbed runs; "
            f"{low:.2g} to {high:.2g} cycles if wear rates are known to a factor of "
            f"{estimate.factor:g}",
        )
    return figure


def reversals(reduction: Reduction) -> Figure:
    """The lag of the link behind the motor in time, and over the motor's angle (hysteresis)."""
    past = reduction.history
    with panels(8.5, 3.4, 1, 2) as (figure, axes):
        for name, colour, line in (("full", COLOURS[0], "-"), ("reduced", COLOURS[1], "--")):
            lag = 1e3 * (past["motor"] - past[name])
            axes[0].plot(past["time"], lag, line, color=colour, label=f"{name} model")
            axes[1].plot(past["motor"], lag, line, color=colour)
        half = 0.5e3 * reduction.dead_band
        for panel in axes:
            for side in (-half, half):
                panel.axhline(side, color="0.6", lw=0.7, ls=":")
            panel.set_ylabel("motor - link [mrad]")
        axes[1].locator_params(axis="x", nbins=5)
        axes[0].set_xlabel("time [s]")
        axes[1].set_xlabel(f"motor of {reduction.joint} [rad]")
        figure.legend(loc="outside upper center", ncols=2)
        footnote(
            figure,
            f"simulated; stated error of the link's angle {1e6 * reduction.angle_error:.3g} urad, "
            f"RMS difference {1e6 * reduction.angle_rms:.3g} urad; dotted: the dead band",
        )
    return figure


def share_bars(budget: DynamicBudget) -> Figure:
    """Errors of each source alone and of all together; shares with the interaction."""
    names = [*budget.joints, "all together"]
    rms = [*budget.alone_rms.mean(axis=0), budget.rms.mean()]
    peak = [*budget.alone_peak.max(axis=0), budget.peak.max()]
    parts = np.column_stack([budget.parts, budget.interaction])
    place = np.arange(len(names))
    several = len(parts) > 1
    known = 100 * parts.std(axis=0, ddof=1) / math.sqrt(len(parts)) if several else None
    with panels(8.5, 1.8 + 0.45 * len(names), 1, 2) as (figure, axes):
        axes[0].barh(place - 0.2, 1e3 * np.array(peak), 0.38, color=COLOURS[1], label="peak")
        axes[0].barh(place + 0.2, 1e3 * np.array(rms), 0.38, color=COLOURS[0], label="RMS")
        axes[0].set_yticks(place, names)
        axes[0].set_xlabel("error of the tool [mm]")
        axes[0].legend(fontsize=7)
        axes[1].barh(place, 100 * parts.mean(axis=0), 0.6, xerr=known, color=COLOURS[0])
        axes[1].set_yticks(place, [*budget.joints, "interaction"])
        axes[1].set_xlabel("share of the mean square of the error [%]")
        for panel in axes:
            panel.invert_yaxis()
            panel.axvline(0.0, color="black", lw=0.6)
        footnote(figure, budget.accuracy)
    return figure
