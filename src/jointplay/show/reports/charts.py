"""Charts in pages: their descriptions as plain data, which `page/report.js` draws."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from jointplay.show.plots import figures
from jointplay.show.plots.chart import Axis, Curve, Panel, Rule, Spans
from jointplay.show.plots.names import PAPER
from jointplay.show.reports.cases import Case, inside_bearings
from jointplay.simulation import analysis
from jointplay.simulation.result.result import AXES, Result

# Time histories packed for the page: small, unpacked by `page/report.js`.


MAX_RECORDS = 40_000
"""More records than this are reduced to the smallest and the largest of each of a series of
intervals, so that no peak is lost."""

EXACT = 23  # bits of a float32's mantissa


class Pack:
    """Arrays in one compressed block; each is known by its number.

    Values are float32 or uint32, differences of consecutive bit patterns, bytes of equal weight
    together: smooth histories shrink to a fraction.
    """

    def __init__(self) -> None:
        self.chunks: list[bytes] = []
        self.layout: list[tuple[str, int]] = []
        self._known: dict[bytes, int] = {}

    def add(self, values: np.ndarray, bits: int = EXACT) -> int:
        """Store a one-dimensional array, unsigned integers as uint32, others as float32.

        `bits` of the mantissa are kept, by rounding; the relative error is 2^-(bits + 1).
        """
        whole = values.dtype.kind == "u"
        packed = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        pattern = packed.view("<u4")
        if not whole and bits < EXACT:
            spare = EXACT - bits
            rounded = (pattern + np.uint32(1 << (spare - 1))) & ~np.uint32((1 << spare) - 1)
            pattern = np.where(np.isfinite(packed), rounded, pattern).astype("<u4")
        steps = np.diff(pattern, prepend=np.zeros(1, "<u4"))
        content = steps.view(np.uint8).reshape(-1, 4).T.tobytes()
        kind = "u" if whole else "f"
        number = self._known.setdefault(kind.encode() + content, len(self.layout))
        if number == len(self.layout):  # the same series may be in several charts
            self.chunks.append(content)
            self.layout.append((kind, len(values)))
        return number

    def block(self) -> str:
        return base64.b64encode(gzip.compress(b"".join(self.chunks), 6, mtime=0)).decode()


_MOTION_BITS, _FORCE_BITS = 18, 13
"""Bits of the mantissa kept of motions (4e-6, relative) and of forces (6e-5)."""

Chart = dict[str, Any]
_DASHES = {"--": "6 3", ":": "1.5 3", "-.": "6 3 1.5 3"}  # as SVG has them


class Times:
    """Points of time of one case: whole numbers of its steps, each series of them packed once.

    Too many records, which are `sparse`, are reduced to about `MAX_RECORDS`; points that were
    recorded step by step are all kept.
    """

    def __init__(self, time: np.ndarray, step: float, sparse: np.ndarray) -> None:
        self.time, self.step = time, step
        records = np.flatnonzero(sparse)
        size = max(1, -(-2 * len(records) // MAX_RECORDS))
        self._thins, self._step_by_step = size > 2, np.flatnonzero(~sparse)
        self._intervals = np.split(records, range(size, len(records), size))

    def has(self, time: np.ndarray) -> bool:
        """Whether these are its own, or the first of them."""
        return len(time) > 1 and np.array_equal(self.time[: len(time)], time)

    def steps(self, time: np.ndarray) -> np.ndarray:
        """Times as whole numbers of steps."""
        return np.rint(time / self.step).astype(np.uint32)

    def kept(self, *series: np.ndarray) -> np.ndarray:
        """Indices that stay: of each interval those of the smallest and largest of each series.

        The line through them passes through every value of an interval within that interval, so
        that it is nowhere farther from the records than an interval is long.
        """
        if not self._thins:
            return np.arange(len(series[0]))
        indices = [self._step_by_step]
        for interval in self._intervals:
            for values in series:
                inside = values[interval]
                indices.append(interval[[int(inside.argmin()), int(inside.argmax())]])
        return np.unique(np.concatenate(indices))


class Drawing:
    """Charts in terms of a page; their series go into a `Pack`."""

    def __init__(self, pack: Pack, times: Sequence[Times]) -> None:
        self._pack, self._times = pack, times

    def chart(self, name: str, title: str, panels: Sequence[Panel], *, same: bool = False) -> Chart:
        """A chart: panels over time or frequency below each other, others side by side.

        `same`: whether their y axes are the same.
        """

        def axis(one: Axis) -> dict[str, Any]:
            rows = None if one.rows is None else list(one.rows)
            return {"label": one.name, "unit": one.shown[1], "log": one.log, "rows": rows}

        across = panels[0].x.name if panels else ""
        drawn = [
            {
                "x": axis(panel.x),
                "y": axis(panel.y),
                "title": panel.title,
                "equal": bool(panel.equal),
                "traces": [  # without lines across, which are the page's own
                    self._mark(one, panel) for one in panel.marks if isinstance(one, Spans | Curve)
                ],
            }
            for panel in panels
        ]
        kind = {"stacked": across in ("time", "frequency"), "time": across == "time", "same": same}
        return {"id": name, "title": title, **kind, "panels": drawn}

    def _mark(self, mark: Any, panel: Panel) -> dict[str, Any]:
        look = {"name": mark.name, "color": mark.colour}
        if isinstance(mark, Spans):
            owner = self._times[0]
            for one in self._times:
                owner = one if np.isin(mark.begin, one.time).all() else owner
            begin, end = (self._pack.add(owner.steps(time)) for time in (mark.begin, mark.end))
            return {"from": begin, "to": end, "dt": owner.step, "row": mark.row, **look}
        x, y = panel.x.shown[0] * np.asarray(mark.x), panel.y.shown[0] * np.asarray(mark.y)
        look |= {"dash": _DASHES.get(mark.line), "line": bool(mark.line), "frame": mark.frame}
        bits = (
            EXACT
            if panel.y.size == "large"
            else _FORCE_BITS
            if panel.y.unit in ("N", "")
            else _MOTION_BITS
        )
        time = np.asarray(mark.x if panel.x.unit == "s" and mark.at is None else mark.at)
        timed = next((one for one in self._times if time.ndim and one.has(time)), None)
        if timed is None:
            return {"x": self._pack.add(x), "y": self._pack.add(y, bits), **look}
        curve, ended = mark.at is not None, np.full(len(timed.time) - len(y), np.nan)
        x, y = np.append(x, ended), np.append(y, ended)  # such as where its reference ended
        kept = timed.kept(x, y) if curve else timed.kept(y)
        steps = self._pack.add(timed.steps(timed.time[kept]))
        shown = {"t": steps, "dt": timed.step, "y": self._pack.add(y[kept], bits)}
        return {**shown, **({"x": self._pack.add(x[kept], bits)} if curve else {}), **look}


def all_charts(cases: Sequence[Case], pack: Pack, start: float) -> list[Chart]:
    """All charts of a report, the `FIRST` ones first; their series go into `pack`."""
    results = {case.label: case.detailed() for case in cases}
    recorded = {case.label: case.result for case in cases}
    ideals = {
        case.label: case.ideal
        for case in cases
        if case.error is not None and case.ideal is not None
    }
    times = []
    for case in cases:
        time = results[case.label].time
        times.append(Times(time, case.result.audit.step, np.isin(time, case.result.time)))
    draw = Drawing(pack, times).chart
    paper = figures.is_paper(recorded)
    charts = _first(cases, results, start, draw)
    axes = figures.moving_axes(results)
    along = f" (along {' and '.join(axes)}, the others are at rest)" if len(axes) < 3 else ""
    for of, name, word in (
        ("tool_position", "tool_displacement", "Displacement"),
        ("tool_velocity", "tool_velocity", "Velocity"),
    ):
        title = f"{word} of the tool{along}"
        charts.append(draw(name, title, figures.tool_panels(results, of)))
        less = figures.difference_panels(results, of, ideals)
        charts.append(draw(f"{name}_error", f"{title}, less the ideal mechanism's", less))
    if not figures.is_straight(results):
        plane = figures.plane_of(recorded)
        where = "the XOY plane" if paper and plane == "xy" else f"the {plane} plane"
        panels = [figures.path_panel(results)]
        charts.append(draw("tool_path", f"Path of the tool in {where}", panels))
    _, centre, on = inside_bearings(cases)
    orbits = [panel for panel, _ in figures.orbit_panels(results)]
    charts.append(draw("journal_orbit", f"{centre}, with its clearance", orbits))
    for axis in AXES:
        title = f"Force on the {on} along world {axis}"
        forces = figures.force_panels(results, axis)
        charts.append(draw(f"force_{axis}", title, forces, same=True))
    modes = [  # shares are those of records, not of steps: the table has them
        replace(panel, y=Axis(rows=[mark.name for mark in panel.marks if isinstance(mark, Spans)]))
        for panel in _of_joints(results, "modes", rolling=(False,))
    ]
    charts.append(draw("modes", f"Contact mode{' (Table 1)' if paper else ''}", modes))
    loaded = _of_joints(results, "loaded", rolling=(True,))
    charts.append(draw("loaded", "Balls or rollers that bear load", loaded))
    for name, word in (("contacts", "Normal force"), ("gaps", "Gap")):
        panels = _of_joints(results, name)
        charts.append(draw(name, f"{word} of each contact", panels, same=True))
    contacts = [
        replace(panel, marks=[replace(one, name=one.name.rpartition(", ")[0]) for one in curves])
        for panel in _of_joints(recorded, "impacts", start=start)
        if (curves := _curves(panel))
    ]
    charts.append(draw("impacts", "Contacts by duration and peak force", contacts))
    density = [
        replace(panel, marks=curves)
        for panel in figures.spectrum_panels(recorded, start)
        if (curves := _curves(panel))
    ]
    title = "Power spectral density of the tool's acceleration"
    charts.append(draw("spectrum", title, density))
    for chart in charts:
        number = PAPER.get(chart["id"].removesuffix("_error"), "") if paper else ""
        if number:
            title = chart["title"]
            chart["title"] = f"Figure {int(number[3:])}: {title[0].lower()}{title[1:]}"
    return [chart for chart in charts if chart["panels"]]


FIRST = ("first_error", "first_orbit", "first_force")
"""Charts that stand beside the answer, however many joints and cases there are."""

_MOST_ORBITS = 3


def _first(
    cases: Sequence[Case], results: Mapping[str, Result], start: float, draw: Callable[..., Chart]
) -> list[Chart]:
    """The tool's error, and orbit and force of the joint that carries most."""
    charts = []
    errors = [
        results[case.label]
        .plot.panel("deviation", "total", case.ideal)
        .styled(colour=case.colour, name=case.label)
        for case in cases
        if case.error is not None
    ]
    if errors:
        over = figures.overlaid(errors).renamed("tool error")
        charts.append(draw("first_error", "Tool error: distance from the ideal mechanism", [over]))
    loaded = [most for case in cases if (most := strongest(case, start)) is not None]
    if not loaded:
        return charts
    worst, _ = max(loaded, key=lambda most: most[1])
    having = [case for case in cases if worst in case.joints]
    ring = any(analysis.rolls(case.result, worst) for case in having)
    by_force = sorted(having, key=lambda case: joint_forces(case, start)[worst])
    shown = [
        panel
        for case, (panel, _) in zip(having, figures.orbit_panels(results, [worst]), strict=True)
        if case in by_force[-_MOST_ORBITS:]
    ]
    several = len({joint for case in cases for joint in case.joints}) > 1
    carries = ", which carries most" if several else ""
    what = "Inner ring's centre in" if ring else "Journal's centre in"
    charts.append(draw("first_orbit", f"{what} {worst}{carries}, with its clearance", shown))
    forces = (
        results[case.label]
        .plot.panel("forces", "total", worst)
        .styled(colour=case.colour, width=0.8, name=case.label)
        for case in having
    )
    over = figures.overlaid(forces).renamed("contact force")
    charts.append(draw("first_force", f"Contact force in {worst}{carries}", [over]))
    return charts


def strongest(case: Case, start: float) -> tuple[str, float] | None:
    """The joint with clearance that carries most from `start` on, and its largest force [N]."""
    return max(joint_forces(case, start).items(), key=lambda one: one[1], default=None)


def joint_forces(case: Case, start: float) -> dict[str, float]:
    """The largest force in each joint with clearance from `start` on [N]."""
    if not case.joints:
        return {}
    forces = case.result["joint_force_peak"].values[case.result.time >= start]
    largest = np.linalg.norm(forces, axis=2).max(axis=0, initial=0.0)
    return dict(zip(case.joints, map(float, largest), strict=True))


def _curves(panel: Panel) -> list[Curve]:
    return [mark for mark in panel.marks if isinstance(mark, Curve) and len(mark.x)]


def _of_joints(
    results: Mapping[str, Result], name: str, rolling: Sequence[bool] = (False, True), **asked: Any
) -> list[Panel]:
    """A plot of each joint with clearance that is a rolling bearing, or none, as `rolling` says."""
    panels = []
    for label, result in results.items():
        for joint in result.joints:
            if analysis.rolls(result, joint) in rolling:
                panel = result.plot.panel(name, joint, **asked)
                marks = [mark for mark in panel.marks if not isinstance(mark, Rule)]
                panels.append(replace(panel, title=f"{label}, {joint}", marks=marks))
    return panels
