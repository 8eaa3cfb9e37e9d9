"""Interactive charts as plain data: what `page/report.js` draws with plotly."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence
from typing import Any

import numpy as np

from jointplay import analysis
from jointplay.analysis.spectra import TooShort
from jointplay.geometry import Mode
from jointplay.plots.figures import force_joints, is_paper, moving_axes, plane_of
from jointplay.plots.names import MODES, PAPER
from jointplay.plots.palette import MODE_COLOURS
from jointplay.plots.style import contact_line, spans
from jointplay.reports.cases import Case
from jointplay.result.result import AXES, Result

# Time histories packed for the page: small, unpacked by `page/report.js`.


MAX_RECORDS = 40_000
"""More records than this are reduced to the smallest and the largest of each of a series of
intervals, so that no peak is lost."""

EXACT = 23
"""Bits of a float32's mantissa."""


class Pack:
    """Arrays in one compressed block; each is known by its number.

    Values are float32 or uint32, differences of consecutive bit patterns, bytes of equal weight
    together: smooth histories shrink to a fraction.
    """

    def __init__(self) -> None:
        """An empty block."""
        self.chunks: list[bytes] = []
        self.layout: list[tuple[str, int]] = []

    def add(self, values: np.ndarray, bits: int = EXACT) -> int:
        """Store a one-dimensional array, unsigned integers as uint32, others as float32.

        Args:
            values: what to store.
            bits: of the mantissa that are kept, by rounding; the relative error is 2^-(bits + 1).
        """
        whole = values.dtype.kind == "u"
        packed = np.ascontiguousarray(values, "<u4" if whole else "<f4")
        pattern = packed.view("<u4")
        if not whole and bits < EXACT:
            spare = EXACT - bits
            rounded = (pattern + np.uint32(1 << (spare - 1))) & ~np.uint32((1 << spare) - 1)
            pattern = np.where(np.isfinite(packed), rounded, pattern).astype("<u4")
        steps = np.diff(pattern, prepend=np.zeros(1, "<u4"))
        self.chunks.append(steps.view(np.uint8).reshape(-1, 4).T.tobytes())
        self.layout.append(("u" if whole else "f", len(values)))
        return len(self.layout) - 1

    def block(self) -> str:
        """The compressed block in base64."""
        return base64.b64encode(gzip.compress(b"".join(self.chunks), 6, mtime=0)).decode()


class Thinning:
    """How the records of one case are reduced to about `MAX_RECORDS`.

    Args:
        sparse: which points are records of which there may be too many; the others, recorded step
            by step, are all kept.
    """

    def __init__(self, sparse: np.ndarray) -> None:
        """Divide the records into intervals."""
        records = np.flatnonzero(sparse)
        self.size = max(1, -(-2 * len(records) // MAX_RECORDS))
        """Records in an interval; one: nothing is left out."""
        self._step_by_step = np.flatnonzero(~sparse)
        self._intervals = np.split(records, range(self.size, len(records), self.size))
        self.thins = self.size > 2
        """Whether anything is left out."""

    def kept(self, *series: np.ndarray) -> np.ndarray:
        """Indices that stay: of each interval those of the smallest and the largest of each series.

        The line through them passes through every value of an interval within that interval, so
        that it is nowhere farther from the records than an interval is long.
        """
        if not self.thins:
            return np.arange(len(series[0]))
        indices = [self._step_by_step]
        for interval in self._intervals:
            for values in series:
                inside = values[interval]
                indices.append(interval[[int(inside.argmin()), int(inside.argmax())]])
        return np.unique(np.concatenate(indices))


_FINE, _COARSE = 18, 13
"""Bits of the mantissa kept of motions (4e-6, relative) and of forces and gaps (6e-5)."""

Chart = dict[str, Any]
_DASHES = {"-": "solid", "--": "dash", ":": "dot"}
"""What plotly calls the dashes of figures."""


class ChartSeries:
    """One case's series in the block, each stored once."""

    def __init__(self, case: Case, pack: Pack) -> None:
        """Take the records, and every step where the run was replayed."""
        self.case = case
        self.result: Result = case.detailed()
        self._pack = pack
        self._step = case.result.audit.step
        self._at = np.rint(self.result.time / self._step).astype(np.uint32)
        self.thinning = Thinning(np.isin(self.result.time, case.result.time))
        self._times: dict[bytes, int] = {}

    def _time(self, kept: np.ndarray) -> int:
        steps = self._at[kept]
        key = steps.tobytes()
        if key not in self._times:
            self._times[key] = self._pack.add(steps)
        return self._times[key]

    def series(self, values: np.ndarray, bits: int, **look: Any) -> dict[str, Any]:
        """A trace of `values` over all points of time; further keywords are its look."""
        return self._trace(self.thinning.kept(values), values, bits, look)

    def _trace(
        self, kept: np.ndarray, values: np.ndarray, bits: int, look: dict[str, Any]
    ) -> dict[str, Any]:
        return {
            "t": self._time(kept),
            "dt": self._step,
            "y": self._pack.add(values[kept], bits),
            "color": self.case.colour,
            "name": self.case.label,
            **look,
        }

    def curve(self, x: np.ndarray, y: np.ndarray, bits: int, **look: Any) -> dict[str, Any]:
        """A trace in a plane, whose points keep their times."""
        kept = self.thinning.kept(x, y)
        return {**self._trace(kept, y, bits, look), "x": self._pack.add(x[kept], bits)}

    def spans(self, values: np.ndarray, row: int, member: int, **look: Any) -> dict[str, Any]:
        """A bar in `row` wherever `values` equals `member`."""
        begin, end = spans(self._at, values == member)
        return {
            "from": self._pack.add(begin),
            "to": self._pack.add(end),
            "dt": self._step,
            "row": row,
            **look,
        }


def _chart(kind: str, name: str, title: str, panels: list[Chart], **more: Any) -> Chart:
    return {"kind": kind, "id": name, "title": title, "panels": panels, **more}


def _panel(label: str, traces: list[dict[str, Any]], **more: Any) -> Chart:
    return {"label": label, "traces": traces, **more}


def all_charts(cases: Sequence[Case], pack: Pack, start: float) -> list[Chart]:
    """All charts of a report; their series go into `pack`."""
    histories = [ChartSeries(case, pack) for case in cases]
    paper = is_paper({case.label: case.result for case in cases})
    charts = [
        *_tool(histories, "tool_position", "tool_displacement", "Displacement of the tool"),
        *_tool(histories, "tool_velocity", "tool_velocity", "Velocity of the tool"),
        _path(histories, cases, paper),
        *_orbits(histories),
        *(_forces(histories, cases, axis, f"force_{axis}") for axis in AXES),
        *_modes(histories, paper),
        _loaded(histories),
        *_places(histories, "normal_force_peak", 1.0, "contacts", "Normal force of each contact"),
        *_places(histories, "gap_min", 1e3, "gaps", "Gap of each contact"),
        *_impacts(cases, pack, start),
        *_spectra(cases, pack, start),
    ]
    for chart in charts:
        number = PAPER.get(chart["id"].removesuffix("_error"), "") if paper else ""
        if number:
            title = chart["title"]
            chart["title"] = f"Figure {int(number[3:])}: {title[0].lower()}{title[1:]}"
    return [chart for chart in charts if chart["panels"]]


def _tool(histories: list[ChartSeries], of: str, name: str, title: str) -> list[Chart]:
    unit, small = ("m", "mm") if of == "tool_position" else ("m/s", "mm/s")
    panels: list[dict[str, Any]] = []
    differences: list[dict[str, Any]] = []
    axes = moving_axes({h.case.label: h.case.result for h in histories})
    shown = [(AXES.index(axis), axis) for axis in axes]
    if len(axes) < len(AXES):
        title += f" (along {' and '.join(axes)}, the others are at rest)"
    for k, axis in shown:
        bits = EXACT if of == "tool_position" else _FINE
        traces = [h.series(h.result[of].values[:, k], bits) for h in histories]
        panels.append(_panel(f"{axis} [{unit}]", traces))
    for h in histories:
        if h.case.error is None or h.case.ideal is None:
            continue
        error = 1e3 * analysis.deviation(h.result, h.case.ideal, of).values
        for row, (k, axis) in enumerate(shown):
            if len(differences) <= row:
                differences.append(_panel(f"{axis} − ideal [{small}]", []))
            differences[row]["traces"].append(
                h.series(_padded(error[:, k], len(h.result.time)), _FINE)
            )
    return [
        _chart("time", name, title, panels),
        _chart("time", f"{name}_error", f"{title}, less the ideal mechanism's", differences),
    ]


def _padded(values: np.ndarray, size: int) -> np.ndarray:
    """Not a number where the reference has ended."""
    return np.concatenate([values, np.full(size - len(values), np.nan)])


def _path(histories: list[ChartSeries], cases: Sequence[Case], paper: bool) -> Chart:
    plane = plane_of({case.label: case.result for case in cases})
    one, two = (AXES.index(axis) for axis in plane)
    paths = [(h, h.result["tool_position"].values) for h in histories]
    traces = [h.curve(path[:, one], path[:, two], EXACT) for h, path in paths]
    reach = np.ptp(np.concatenate([path for _, path in paths]), axis=0)
    if min(reach[one], reach[two]) < 1e-3 * max(reach[one], reach[two]):
        traces = []  # on a straight line there is no path to see
    name = "the XOY plane" if paper and plane == "xy" else f"the {plane} plane"
    panels = [_panel(f"{plane[1]} [m]", traces, across=f"{plane[0]} [m]")] if traces else []
    return _chart("plane", "tool_path", f"Path of the tool in {name}", panels)


def _orbits(histories: list[ChartSeries]) -> list[Chart]:
    panels = []
    for h in histories:
        for joint in h.case.joints:
            # The play of rolling bearings is of the order of micrometres.
            scale, unit = (1e6, "µm") if analysis.rolls(h.result, joint) else (1e3, "mm")
            centre = scale * h.result["journal_centre"].sel(joint=joint).values
            outline = analysis.clearance_outline(h.result, joint)
            panels.append(
                _panel(
                    f"y [{unit}]",
                    [h.curve(centre[:, 0], centre[:, 1], _COARSE)],
                    across=f"x [{unit}]",
                    title=f"{h.case.label}, {joint}",
                    outline=None if outline is None else np.round(scale * outline, 6).tolist(),
                )
            )
    kinds = {analysis.rolls(h.result, joint) for h in histories for joint in h.case.joints}
    what = {
        (True,): "Inner ring's centre in the outer ring",
        (False, True): "Centre in the bearing",
    }
    of = what.get(tuple(sorted(kinds)), "Journal centre in its bearing")
    title = f"{of}, with its clearance"
    return [_chart("plane", "journal_orbit", title, panels)]


def _forces(histories: list[ChartSeries], cases: Sequence[Case], axis: str, name: str) -> Chart:
    k, panels = AXES.index(axis), []
    by_label = {case.label: case.result for case in cases}
    for h in histories:
        for joint in force_joints(h.case.result, by_label):
            if h.case.joints:
                force = h.result["joint_force_peak"].sel(joint=joint).values[:, k]
            else:
                force = h.result["reaction_force"].sel(moving_joint=joint).values[:, k]
            traces = [h.series(force, _COARSE)]
            panels.append(_panel(f"F{axis} [N]", traces, title=f"{h.case.label}, {joint}"))
    kinds = {analysis.rolls(h.result, joint) for h in histories for joint in h.case.joints}
    on = {(True,): "inner ring", (False, True): "journal or inner ring"}
    title = f"Force on the {on.get(tuple(sorted(kinds)), 'journal')} along world {axis}"
    return _chart("time", name, title, panels, same=True)


def _modes(histories: list[ChartSeries], paper: bool) -> list[Chart]:
    panels = []
    for h in histories:
        for joint in h.case.joints:
            if analysis.rolls(h.result, joint):
                continue
            values = h.result["mode"].sel(joint=joint).values
            bars = [
                h.spans(values, row, int(mode), color=colour, name=text)
                for row, (mode, colour, text) in enumerate(
                    zip(Mode, MODE_COLOURS, MODES, strict=True)
                )
            ]
            panels.append(_panel("", bars, title=f"{h.case.label}, {joint}", rows=MODES))
    return [_chart("time", "modes", f"Contact mode{' (Table 1)' if paper else ''}", panels)]


def _loaded(histories: list[ChartSeries]) -> Chart:
    panels = []
    for h in histories:
        for joint in h.case.joints:
            if analysis.rolls(h.result, joint):
                values = h.result["loaded_elements"].sel(joint=joint).values
                traces = [h.series(values, _COARSE)]
                panels.append(_panel("loaded elements", traces, title=f"{h.case.label}, {joint}"))
    return _chart("time", "loaded", "Balls or rollers that bear load", panels)


def _look(index: int, contact: str) -> dict[str, Any]:
    """Colour, dashes and name of a contact, as in the figures."""
    line = contact_line(index)
    colour = "#808080" if line["color"] == "0.5" else line["color"]
    return {"color": colour, "dash": _DASHES[line["ls"]], "name": contact.replace("_", " ")}


def _places(
    histories: list[ChartSeries], of: str, scale: float, name: str, title: str
) -> list[Chart]:
    panels = []
    unit = "N" if scale == 1.0 else "mm"
    for h in histories:
        for joint in h.case.joints:
            values = h.result[of].sel(joint=joint)
            traces = [
                h.series(scale * values.sel(contact=contact).values, _COARSE, **_look(i, contact))
                for i, contact in enumerate(analysis.places(h.case.result, joint))
            ]
            label = f"{'normal force' if unit == 'N' else 'gap'} [{unit}]"
            if analysis.rolls(h.result, joint):
                of_element = "largest element load" if unit == "N" else "least gap of elements"
                label = f"{of_element} [{unit}]"
            panels.append(_panel(label, traces, title=f"{h.case.label}, {joint}"))
    return [_chart("time", name, title, panels, same=True)]


def _impacts(cases: Sequence[Case], pack: Pack, start: float) -> list[Chart]:
    panels = []
    for case in cases:
        contacts = analysis.contacts(case.result, start)
        for joint in case.joints:
            here = [place for place in contacts if place.joint == joint and len(place.peak)]
            traces = [
                {
                    "x": pack.add(1e3 * place.duration),
                    "y": pack.add(place.peak),
                    **_look(i, place.contact),
                }
                for i, place in enumerate(here)
            ]
            if traces:
                title = f"{case.label}, {joint}"
                across = "duration of the contact [ms]"
                panels.append(_panel("peak normal force [N]", traces, across=across, title=title))
    return [_chart("points", "impacts", "Contacts by duration and peak force", panels)]


def _spectra(cases: Sequence[Case], pack: Pack, start: float) -> list[Chart]:
    panels = [_panel(f"{axis} [(m/s²)²/Hz]", []) for axis in AXES]
    for case in cases:
        try:
            density = analysis.spectrum(case.result, start=start)
        except TooShort:  # the table beneath says so
            continue
        x = pack.add(density["frequency"].values[1:])
        for k, panel in enumerate(panels):
            if not density.values[1:, k].any():  # the tool does not move this way
                continue
            y = pack.add(density.values[1:, k], _COARSE)
            panel["traces"].append({"x": x, "y": y, "color": case.colour, "name": case.label})
    title = "Power spectral density of the tool's acceleration"
    panels = [panel for panel in panels if panel["traces"]]
    return [_chart("spectrum", "spectrum", title, panels)]
