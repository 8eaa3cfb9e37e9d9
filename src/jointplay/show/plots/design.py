"""Figures of error budgets, allocations, identifications, calibrations, ISO 9283 tests, reduced
models and hunting."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import matplotlib as mpl
import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize, to_hex
from matplotlib.figure import Figure

from jointplay.accuracy.allocation import Allocation
from jointplay.accuracy.error_budget import ErrorBudget, PlayBudget
from jointplay.accuracy.jacobians import GEAR
from jointplay.base.units import readable
from jointplay.estimate import Calibration, Estimate, Identification
from jointplay.estimate.unknowns import Loop
from jointplay.model.mechanism import Mechanism
from jointplay.show.picture import picture
from jointplay.show.plots.chart import (
    Area,
    Axis,
    Bars,
    Chart,
    Curve,
    Dots,
    Label,
    Map,
    Mark,
    Panel,
    Rule,
    in_rows,
)
from jointplay.show.plots.draw import draw
from jointplay.show.plots.palette import BLUE, COLOURS, GREEN, LINE, PINK, SKY, VERMILION, many
from jointplay.study.corners import Judgement
from jointplay.study.hunting import UNITS, GainMap
from jointplay.study.iso9283 import Iso9283

if TYPE_CHECKING:
    from jointplay.bridges.reduction import Reduction

_SHARES = "YlOrRd"  # colours of bodies by share of the error


def _row(panels: Iterable[Panel], size: tuple[float, float], **more: Any) -> Figure:
    """A figure of panels side by side."""
    return draw(Chart([list(panels)], size, **more))


# Error budgets: bars, the coloured robot, the reachable set, the course along a motion, the map.


def bars(budget: PlayBudget) -> Figure:
    """Each joint's contribution to the tool's error at the worst pose."""
    at = budget.worst_pose
    rests, whole, *_ = budget.rest_positions.at(at)
    of = budget.components
    size, sizes = np.linalg.norm(whole[of]), np.linalg.norm(rests[:, of], axis=1)
    marks = [
        Bars(
            values,
            f"{load_case}, all {1e3 * total:.3g} m{budget.unit}",
            colour,
            shift=shift,
            height=0.25,
        )
        for shift, load_case, total, values, colour in (
            (-0.27, "worst case", budget.worst[at], budget.worst_parts[at], VERMILION),
            (0.0, "RMS over load directions", budget.rms[at], budget.rms_parts[at], BLUE),
            (0.27, "at rest", size, sizes, GREEN),
        )
    ]
    across = Axis(f"contribution of the joint to the error of {budget.tool!r}", budget.unit)
    panel = Panel(across, Axis(rows=budget.joints), marks)
    return _row([panel], (7.0, 1.6 + 0.42 * len(budget.joints)), note=budget.validity, key=2)


def _stacked(parts: np.ndarray, names: Sequence[str], **look: Any) -> list[Mark]:
    """Stacked bars of parts (causes, rows), with negative parts stacked to the left."""
    marks: list[Mark] = []
    ends = {1.0: np.zeros(parts.shape[1]), -1.0: np.zeros(parts.shape[1])}
    for size, name, colour in zip(parts, names, many(len(names)), strict=True):
        for sign, end in ends.items():  # a part is negative where loads shift the tool back
            part = np.where(np.sign(size) == sign, size, 0.0)
            if sign > 0.0 or part.any():
                marks.append(Bars(part, name if sign > 0.0 else "", colour, end.copy(), **look))
            end += part
    return marks


def cause_bars(budget: ErrorBudget) -> Figure:
    """Each joint's part of the worst case and of the variance at the worst pose, by cause."""
    at = budget.worst_pose
    joints = list(dict.fromkeys(contribution.joint for contribution in budget.model.contributions))
    causes = list(budget.by("cause"))
    parts, variances = budget.worst_parts[at], budget.variances
    whole = float(variances.sum()) or 1.0
    shown = np.zeros((2, len(causes), len(joints)))
    for part, variance, contribution in zip(
        parts, variances, budget.model.contributions, strict=True
    ):
        cell = causes.index(contribution.cause), joints.index(contribution.joint)
        shown[0][cell] += part
        shown[1][cell] += 100.0 * variance / whole
    axes = (
        Axis(f"part of the worst case of {1e3 * budget.worst[at]:.3g} mm", "m"),
        Axis(f"part of the variance (RMS with the mean {1e3 * budget.rms[at]:.3g} mm)", "%"),
    )
    panels = [
        Panel(axis, Axis(rows=joints), _stacked(values, causes))
        for axis, values in zip(axes, shown, strict=True)
    ]
    size, note = (9.0, 1.8 + 0.35 * len(joints)), "; ".join(budget.assumed)
    return _row(panels, size, note=note, key=len(causes), same_y=True)


def robot(mechanism: Mechanism, budget: PlayBudget, q: np.ndarray) -> Figure:
    """The robot, each body coloured by its joint's share of the worst case at the worst pose."""
    share: dict[str, float] = {}
    gears = {name + GEAR: name for name in mechanism.gears}
    for name, value in zip(budget.joints, budget.shares, strict=True):
        joint = gears.get(name, name)
        share[joint] = share.get(joint, 0.0) + float(value)
    scale, palette = Normalize(0.0, 100.0 * max(*share.values(), 1e-9)), mpl.colormaps[_SHARES]
    colours = {name: to_hex(palette(scale(100.0 * value))) for name, value in share.items()}
    labels = {name: f"{name}: {100 * value:.1f} %" for name, value in share.items()}
    at = budget.worst_pose
    worst = f"{1e3 * budget.worst[at]:.3g} m{budget.unit}"
    title = f"origin of the worst case of {worst} at {budget.tool!r}"
    bar = ScalarMappable(scale, palette), "share of the joint that carries the body [%]"
    look: dict[str, Any] = {"title": f"{title} (static)", "colours": colours, "labels": labels}
    figure = picture(mechanism, q[at], scale=bar, **look)
    figure.set_dpi(130)
    return figure


def reachable(budget: PlayBudget) -> Figure:
    """The tool's reachable set at the worst pose, seen along z, y and x.

    Inside it, the place of rest, and a box of all places in which friction can hold the tool. The
    sag of drives is left out.
    """
    at = budget.worst_pose
    angle = np.linspace(0.0, 2.0 * np.pi, 241)
    place, sag = budget.rest_positions.at(at), np.nan_to_num(budget.rest_positions.at(at).sag[:3])
    rest, ends = place.error[:3] - sag, budget.rest_positions.interval(at)[:3] - sag[:, None]
    settled = "at rest, sag of drives aside" if sag.any() else "at rest"
    held = f"{budget.rest_positions.friction_text} may hold it"
    if not budget.rest_positions.coefficients:  # the play of gears alone
        held = "may rest within"
    if budget.rest_positions.unsearched:
        held = "entire play: friction not searched"
    panels = []
    for i, j in ((0, 1), (0, 2), (1, 2)):
        directions = np.zeros((len(budget.positions), len(angle), 3))
        directions[..., i], directions[..., j] = np.cos(angle), np.sin(angle)
        # The set is a Minkowski sum over joints: its support points in each direction add up, so
        # the grey curves are the sets of the first joint, the first two, and so on.
        edge = np.zeros((len(angle), 3))
        marks = []
        for error in budget.model.along(directions).error[:, at]:
            edge = edge + error[:, :3]
            marks.append(Curve(edge[:, i], edge[:, j], colour="#bfbfbf", width=0.6))
        (left, right), (low, high) = ends[i], ends[j]
        box = [left, right, right, left, left], [low, low, high, high, low]
        marks += [
            Curve(edge[:, i], edge[:, j], "reachable", VERMILION),
            Curve([rest[i]], [rest[j]], settled, GREEN, "", marker="o", size=5.0),
            Curve(*box, held, GREEN, "--", 1.0),
            Curve([0.0], [0.0], "without play", "black", "", marker="+", size=6.0),
        ]
        panels.append(Panel(Axis("xyz"[i], "m"), Axis("xyz"[j], "m"), marks, equal="data"))
    note = f"grey: first joint, first two, ... of {', '.join(budget.joints)}\n{budget.validity}"
    return _row(panels, (8.5, 3.4), note=note, key=4)


def course(budget: PlayBudget, time: np.ndarray | None = None) -> Figure:
    """Error along a motion: the worst case, stacked by joint, the RMS, and the error at rest.

    `time`: times of the poses [s], shape (n,); None numbers them.
    """
    x = np.arange(len(budget.worst)) if time is None else time
    tops = np.cumsum(np.column_stack([np.zeros(len(x)), budget.worst_parts]), axis=1).T
    tones = many(len(budget.joints))
    marks: list[Mark] = [
        Area(x, low, high, joint, tone)
        for (low, high), joint, tone in zip(pairwise(tops), budget.joints, tones, strict=False)
    ]
    for values, name, line in (
        (budget.worst, "worst case", "-"),
        (budget.rms, "RMS over load directions", "--"),
        (budget.rest_error, "at rest under its load", ":"),
    ):
        marks.append(Curve(x, values, name, "black", line))
    across = Axis("pose") if time is None else Axis("time in the motion", "s")
    across = replace(across, low=float(x[0]), high=float(x[-1]))
    panel = Panel(across, Axis(f"error of {budget.tool!r}", budget.unit, low=0.0), marks)
    at = "outside right upper"
    return _row([panel], (7.0, 3.6), note=budget.validity, key=1, key_at=at)


def before_and_after(judgement: Judgement) -> Figure:
    """The tool's error over time on a motion before and after correction, for the nominal machine
    and for the one that gains least."""
    corners = [judgement.nominal]
    if judgement.least_gain is not judgement.nominal:
        corners.append(judgement.least_gain)
    tool = judgement.compensation.simulation.mechanism.tool
    panels = []
    for corner in corners:
        marks: list[Mark] = [
            Curve(errors.times, np.linalg.norm(errors.values[:, :3], axis=1), name, tone)
            for errors, name, tone in (
                (corner.before, "as it was", BLUE),
                (corner.after, "corrected", VERMILION),
            )
        ]
        time = Axis("time", "s", low=0.0, high=float(corner.before.times[-1]))
        sizes = " to ".join(f"{1e3 * x.rms:.3g}" for x in (corner.before, corner.after))
        title = f"{corner.label}: RMS {sizes} mm"
        panels.append(Panel(time, Axis(f"error of {tool!r}", "m", low=0.0), marks, title))
    return _row(panels, (4.8 * len(panels), 3.6), key=2)


_LEAST_REACH_M = 1e-2
"""Least length of a workspace map's axes: a smaller workspace counts as a point (judged)."""


def workspace_map(budget: PlayBudget) -> Figure:
    """The worst case over the workspace, seen from the side and from above."""
    order = np.argsort(budget.worst)
    (x, y, z), worst = budget.positions[order].T, budget.worst[order]
    scale = Axis(f"worst-case error of {budget.tool!r}", budget.unit)
    point = np.ptp(budget.positions, axis=0).max() < _LEAST_REACH_M

    def axis(values: np.ndarray, name: str) -> Axis:
        if not point:
            return Axis(name, "m", "large")
        middle = float(values.mean())
        low, high = middle - 0.5 * _LEAST_REACH_M, middle + 0.5 * _LEAST_REACH_M
        return Axis(name, "m", "large", low=low, high=high)

    panels = []
    for across, up, *names in (
        (np.hypot(x, y), z, "distance from the z axis", "z"),
        (x, y, "x", "y"),
    ):
        sideways, upwards = map(axis, (across, up), names)
        dots = [Dots(across, up, worst, scale)]
        panels.append(Panel(sideways, upwards, dots, equal="" if point else "data"))
    return _row(panels, (8.0, 4.0), note=budget.validity)


def allocation(allotment: Allocation, assumed: str = "") -> Figure:
    """Each joint's allowed size, and its parts of the error (pale: before) and of the cost.

    `assumed`: what the title adds to the answer.
    """
    joints = list(dict.fromkeys(allotment.joints))
    causes = list(dict.fromkeys(choice.cause for choice in allotment.choices))
    improved, unit, total = not np.isnan(allotment.was), allotment.unit, allotment.total or 1.0
    # Parts of the error before and after and of the cost, by cause and joint; by kind of size, each
    # joint's bar and label.
    parts = np.zeros((3, len(causes), len(joints)))
    sizes = {"m": np.zeros(len(joints)), "arcmin": np.zeros(len(joints))}
    texts = {kind: [""] * len(joints) for kind in sizes}
    for choice in allotment.choices:
        row, offer = joints.index(choice.joint), choice.offer
        cell = parts[:, causes.index(choice.cause), row]
        cell += np.nan_to_num([choice.before, choice.after, 100.0 * choice.price / total])
        turns = not np.isnan(choice.play)
        size = offer.free("x") if offer else choice.clearance
        size = float(np.degrees(60.0 * choice.play)) if turns else size
        if np.isnan(size):
            continue
        kind = "arcmin" if turns else "m"
        text = f"{size if turns else 1e6 * size:.3g}"
        if offer:
            text = f"{offer.name}: {text}"
        if choice.held == "most":  # at the upper bound; its bar would dwarf the others
            text = f"any, up to {text}"
        else:
            sizes[kind][row] = size
        texts[kind][row] = text
    axes = {"m": Axis("clearance allowed", "m", "fine"), "arcmin": Axis("play allowed [arcmin]")}
    rows = Axis(rows=joints)
    panels = [
        Panel(axes[kind], rows, [Bars(sizes[kind], colour=BLUE, texts=texts[kind])])
        for kind in axes
        if any(texts[kind])
    ]
    before, after, shares = parts
    nameless = [""] * len(causes)  # one legend names the causes of all panels
    whole = f"{allotment.kind} {1e3 * allotment.error:.4g} m{unit}"
    look: dict[str, Any] = {"shift": 0.2, "height": 0.36} if improved else {}
    marks = _stacked(after, causes if improved else nameless, **look)
    if improved:
        whole += f" (pale: before, {1e3 * allotment.was:.4g} m{unit})"
        marks += _stacked(before, nameless, shift=-0.2, height=0.36, opacity=0.45)
    panels += [
        Panel(Axis("part of the error", unit), rows, marks, whole),
        Panel(Axis("part of the cost", "%"), rows, _stacked(shares, nameless)),
    ]
    target = readable(allotment.target, unit, 3)
    title = f"for at most {target} at {allotment.mechanism.tool}: {allotment.chosen}{assumed}"
    note = "; ".join(note for note in allotment.notes if note.startswith(("assumed", "cost")))
    inches = (2.6 + 2.8 * len(panels), 2.0 + 0.36 * len(joints))
    look = {"key": 1, "key_at": "outside right center"}  # the title takes the room above
    return _row(panels, inches, title=title, note=note, same_y=True, **look)


# Identification and calibration: values found, agreement with the measurement, loops of reversals.


_AGREEMENT = {
    "tool": Axis("deviation of the tool", "m", "fine"),
    "link": Axis("link - motor", "rad"),
}
"""Axes of measured quantities by kind; other kinds are torques."""


def identification(fit: Identification) -> Figure:
    """Intervals relative to the scenario's values, and predicted over measured means by kind."""
    shown = [estimate for estimate in fit.estimates if estimate.unknown.sought]
    marks: list[Mark] = []  # a row for each unknown
    for row, estimate in enumerate(shown):
        scale = estimate.unknown.scale
        if estimate.reason:
            marks.append(Label(1.0, row, "cannot tell"))
            continue
        low, high = (end / scale for end in estimate.interval)
        marks += _interval(row, low, high, estimate.value / scale)
    marks.append(Rule(1.0, "x", colour=LINE, line=":"))
    rows = Axis(rows=[estimate.label for estimate in shown])
    panels = [Panel(Axis("found / scenario", low=0.0), rows, marks)]
    # A panel for each kind of signal, where a perfect model would lie on the diagonal.
    for kind in dict.fromkeys(kind for kind, _ in fit.observed.keys):
        axis = _AGREEMENT.get(kind, Axis("torque", "N*m"))
        means: list[Mark] = []
        ends: list[float] = []
        for column, (of, name) in enumerate(fit.observed.keys):
            use = np.isfinite(fit.error[:, column])
            if of != kind or not use.any():
                continue
            x, y = fit.observed.mean[use, column], fit.predicted[use, column]
            ends += [x.min(), x.max()]
            dots: dict[str, Any] = {"line": "", "width": 0.5, "marker": "o", "size": 2.5}
            dots["aside"] = fit.error[use, column]
            means.append(Curve(x, y, name, COLOURS[column % len(COLOURS)], **dots))
        if ends:
            line = [min(ends), max(ends)]
            means.append(Curve(line, line, colour=LINE, width=0.7))
        across = replace(axis, name=f"measured: {axis.name}")
        panels.append(Panel(across, replace(axis, name="static model"), means, legend="best"))
    note = (
        "statistical; bars: 95 % intervals; static model, left over "
        f"{fit.misfit:.2g} standard errors (RMS)"
    )
    height = max(2.0 + 0.3 * len(shown), 3.2)
    return _row(panels, (1.6 + 3.0 * len(panels), height), note=note)


def reversal_loops(loops: Sequence[Loop], estimates: Sequence[Estimate]) -> Figure:
    """Hysteresis loops: each joint's deviation from its motor, measured and fitted, by direction of
    motion; titles give the play."""
    note = "dots: measured, by the way moved or pushed (hollow: neither); lines: what was found"
    panels = []
    for loop in loops:
        marks: list[Mark] = []
        for way, colour in ((0, LINE), (-1, VERMILION), (1, BLUE)):
            along = np.flatnonzero(loop.branch == way)
            along = along[np.argsort(loop.x[along], kind="stable")]
            seen, fit = (along[np.isfinite(y[along])] for y in (loop.measured, loop.fitted))
            dots: dict[str, Any] = {"line": "", "marker": "o", "size": 4.0, "hollow": not way}
            marks.append(Curve(loop.x[seen], loop.measured[seen], "", colour, opacity=0.7, **dots))
            marks.append(Curve(loop.x[fit], loop.fitted[fit], "", colour, order=3.0))
        cells = [estimate.cells() for estimate in estimates if estimate.plays(loop.joint)]
        play = [interval if value == "-" else f"play {interval}" for value, interval in cells]
        x, up = (
            Axis(loop.x_name, loop.x_unit, ticks=5),
            Axis("deviation of the link", loop.unit, "fine"),
        )
        panels.append(Panel(x, up, marks, title="\n".join([loop.joint, *play])))
    across = min(len(panels), 3)
    rows = in_rows(panels, across)
    return draw(Chart(rows, (max(3.4 * across, 5.0), 0.6 + 3.0 * len(rows)), note=note))


def _interval(row: int, low: float, high: float, value: float) -> list[Mark]:
    return [
        Curve([low, high], [row, row], width=2.0),
        Curve([value], [row], line="", marker="o", size=4.0),
    ]


def calibration(fit: Calibration) -> Figure:
    """Position errors in training and on held-back poses, by model and by pose; bounds of play."""
    known = [play for play in fit.play if not play.reason]
    groups = ((-0.2, "training", VERMILION), (0.2, "held_back", BLUE))
    steps: list[Mark] = []
    poses: list[Mark] = []
    for shift, name, colour in groups:
        sizes = [getattr(step, name)[0] for step in fit.steps]
        label = name.replace("_", " ")
        steps.append(Bars(sizes, label, colour, shift=shift, height=0.38))
        each = np.linalg.norm(fit.step().errors[name][0], axis=1)
        poses.append(Curve(np.arange(1, len(each) + 1), each, "", colour, "", marker="o", size=2.5))
    rows = [step.added + (" (kept)" if step.kept else "") for step in fit.steps]
    panels = [
        Panel(Axis("position error (RMS)", "m"), Axis(rows=rows), steps),
        Panel(Axis("pose"), Axis("position error", "m", low=0.0), poses),
    ]
    bounds: list[Mark] = []
    for row, play in enumerate(known):
        if not play.bounded:
            bounds += _interval(row, 1e3 * play.low, 1e3 * play.high, 1e3 * play.value)
        else:
            bounds.append(Bars([1e3 * play.upper], "", "#cccccc", height=0.5, rows=[row]))
    if known:
        across = Axis("play [mrad or mm]\ninterval; grey: bound")
        panels.append(Panel(across, Axis(rows=[play.joint for play in known]), bounds))
    size = (3.4 * len(panels), 1.6 + 0.3 * max(len(fit.steps), 5))
    return _row(panels, size, note=f"held back: {fit.folds}; statistical, 95 %", key=2)


# Accuracy and repeatability by ISO 9283: attained poses about their barycentre, and the path.


MOST_POSES = 6  # stops that are drawn, the worst ones: they make a figure of 16 inches


def poses(performance: Iso9283) -> Figure:
    """Attained poses of all cycles about their barycentre, seen along z and y, for each stop."""
    worst = sorted(performance.poses, key=lambda pose: -pose.figures["AP_p"].value)[:MOST_POSES]
    shown = sorted(worst, key=lambda pose: pose.time)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    rows: list[list[Panel | None]] = [[], []]
    for pose in shown:
        ap, rp = pose.figures["AP_p"].value, pose.figures["RP_l"].value
        centre = pose.attained.mean(axis=0)
        points = pose.attained - centre
        arrow = -0.8 * rp * centre / max(float(np.linalg.norm(centre)), 1e-300)
        title = f"t = {pose.time:.4g} s\nAP_p {1e3 * ap:.3g} mm, RP_l {1e6 * rp:.3g} µm"
        way = "direction to the command pose (length not to scale)"
        for row, (i, j) in zip(rows, ((0, 1), (0, 2)), strict=True):
            dot: dict[str, Any] = {"line": "", "marker": "o", "size": 2.5}
            cross: dict[str, Any] = {"line": "", "marker": "x", "size": 6.0}
            marks = [
                Curve(points[:, i], points[:, j], "attained", VERMILION, **dot),
                Curve([0.0], [0.0], "barycentre", BLUE, **cross),
                Curve(rp * np.cos(angle), rp * np.sin(angle), "RP_l", BLUE, width=0.8),
                Curve([0.0, arrow[i]], [0.0, arrow[j]], way, LINE, width=0.8),
            ]
            x, y = (Axis("xyz"[k], "m", "fine", ticks=5) for k in (i, j))
            row.append(Panel(x, y, marks, title if row is rows[0] else "", equal="data"))
    size = (1.4 + 2.4 * max(len(shown), 2), 5.6)
    return draw(Chart(rows, size, note=_note(performance), key=2))


def path(performance: Iso9283) -> Figure:
    """Accuracy and repeatability across the path over time; AT and RT are the largest values."""
    look: dict[str, Any] = {"width": 0.8, "marker": "o", "size": 2.5}
    marks = []
    for values, name, colour in (
        (performance.path_accuracy, "AT_p", VERMILION),
        (performance.path_repeatability, "RT_p", BLUE),
    ):
        name_and_value = f"{name} = {performance.path[name].text(1e3, 'mm')}"
        marks.append(Curve(performance.path_times, values, name_and_value, colour, **look))
    up = Axis("across the command path", "m", low=0.0)
    panel = Panel(Axis("time in the cycle", "s"), up, marks)
    return _row([panel], (6.5, 3.4), note=_note(performance), key=2)


def _note(performance: Iso9283) -> str:
    """The conditions of validity, in two lines."""
    parts = performance.validity.split("; ")
    half = len(parts) // 2
    return "; ".join(parts[:half]) + ";\n" + "; ".join(parts[half:])


def reversals(reduction: Reduction) -> Figure:
    """The link's lag behind the motor over time, and over the motor's angle (hysteresis)."""
    past, half = reduction.history, 0.5 * reduction.dead_band
    sides = [Rule(side, "y", colour=LINE, line=":", width=0.7) for side in (-half, half)]
    curves: list[list[Mark]] = [[*sides], [*sides]]
    for name, colour, line in (("full", VERMILION, "-"), ("reduced", BLUE, "--")):
        lag = past["motor"] - past[name]
        curves[0].append(Curve(past["time"], lag, f"{name} model", colour, line))
        curves[1].append(Curve(past["motor"], lag, "", colour, line))
    up = Axis("motor - link", "rad")
    low, high = float(past["motor"].min()), float(past["motor"].max())
    low, high = 1.03 * low - 0.03 * high, 1.03 * high - 0.03 * low
    # Few ticks: the motor's angle may have many digits.
    angle = Axis(f"motor of {reduction.joint}", "rad", "large", low=low, high=high, ticks=5)
    panels = [Panel(Axis("time", "s"), up, curves[0]), Panel(angle, up, curves[1])]
    note = (
        f"simulated; stated error of the link's angle {1e6 * reduction.angle_error:.3g} µrad, "
        f"RMS difference {1e6 * reduction.angle_rms:.3g} µrad; dotted: the dead band"
    )
    return _row(panels, (8.5, 3.4), note=note, key=2)


def gains(gain_map: GainMap) -> Figure:
    """Amplitude and frequency of limit cycles over two gains; marks tell where play is not the
    cause and where a run diverges."""
    (first, x), (second, y) = gain_map.first, gain_map.second
    names = [
        f"{name[0].upper()} gain [{UNITS[name]}]" if name in UNITS else name
        for name in (first, second)
    ]
    across, up = (Axis(name, log=bool(a[0] > 0.0)) for name, a in zip(names, (x, y), strict=True))
    length = "m" if gain_map.axis.slides else "rad"
    diverges = np.isinf(gain_map.amplitude)
    lasts = (gain_map.amplitude > 0.0) & ~diverges
    size, rate = (np.where(lasts, x, np.nan) for x in (gain_map.amplitude, gain_map.frequency))
    places = [a.ravel() for a in np.meshgrid(x, y)]
    kinds = [
        (gain_map.screen, "predicted by the describing function", ".", VERMILION),
        (gain_map.control, "without play, too", "x", SKY),
        (gain_map.unclear, "unclear: a longer run must tell", "*", PINK),
        (diverges, "diverges", "^", GREEN),
    ]
    marks: list[Mark] = []
    for where, name, marker, colour in kinds:
        if where.any():
            across_at, up_at = (place[where.ravel()] for place in places)
            look: dict[str, Any] = {"marker": marker, "size": 3.0, "order": 4.0}
            marks.append(Curve(across_at, up_at, name, colour, "", **look))
    shown = [(size, Axis("swing", length)), (rate, Axis("frequency", "Hz"))]
    panels = [Panel(across, up, [Map(values, scale, x, y), *marks]) for values, scale in shown]
    note = "blank: quiet; swing: half of the link's way to and fro"
    return _row(panels, (9.0, 4.2), note=f"{gain_map.sentence}; {note}", key=3)
