"""Charts of a page as plain data, with packed series, for `page/report.js` to draw."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from jointplay.show.player.tracks import Packer
from jointplay.show.plots.chart import Axis, Curve, Panel, Spans
from jointplay.show.reports.parts import Graph

MAX_RECORDS = 20_000
"""Most records that a curve shows whole. Of more, the extremes of `MAX_RECORDS` / 2 intervals stay,
so that no peak is lost: at least ten intervals for each pixel of the widest chart."""

_DASHES = {"--": "6 3", ":": "1.5 3", "-.": "6 3 1.5 3"}  # matplotlib's line styles in SVG


class Times:
    """Times of a case's curves, as whole numbers of its integration steps, and their decimation.

    Regular records (`sparse`) are reduced to about `MAX_RECORDS`; windows that were recorded step
    by step are kept whole.
    """

    def __init__(self, time: np.ndarray, step: float, sparse: np.ndarray) -> None:
        self.time, self.step = time, step
        records = np.flatnonzero(sparse)
        size = max(1, -(-2 * len(records) // MAX_RECORDS))
        self._thins, self._step_by_step = size > 2, np.flatnonzero(~sparse)
        self._intervals = np.split(records, range(size, len(records), size))

    def steps(self, time: np.ndarray) -> np.ndarray:
        """Times as whole numbers of steps."""
        return np.rint(time / self.step).astype(np.uint32)

    def kept(self, *series: np.ndarray) -> np.ndarray:
        """Indices of the points to draw: in each interval the extremes of each series.

        The line through them takes every value of an interval within that interval: it is nowhere
        farther from the records, along the time axis, than an interval is long.
        """
        if not self._thins:
            return np.arange(len(series[0]))
        indices = [self._step_by_step]
        for interval in self._intervals:
            for values in series:
                inside = values[interval]
                indices.append(interval[[int(inside.argmin()), int(inside.argmax())]])
        return np.unique(np.concatenate(indices))


class Charts:
    """Graphs described for a page; one compressed `block` holds their series, each once."""

    def __init__(self, times: Sequence[Times]) -> None:
        self._times, self._packer = times, Packer()

    @property
    def block(self) -> str:
        return base64.b64encode(self._packer.deflated()).decode()

    def _packed(self, values: np.ndarray) -> dict[str, Any]:
        """Pack a series as uint32 or float32, and return its place in the block.

        What is packed are differences of consecutive bit patterns, by which smooth histories
        compress to a fraction.
        """
        kind = "<u4" if values.dtype.kind == "u" else "<f4"
        bits = np.ascontiguousarray(values, kind).view("<u4")
        return self._packer.integers(np.diff(bits, prepend=np.uint32(0)))

    def described(self, graph: Graph) -> dict[str, Any]:
        """The description of a graph that `page/report.js` draws."""

        def axis(shown: Axis) -> dict[str, Any]:
            rows = None if shown.rows is None else list(shown.rows)
            look = {"log": shown.log, "rows": rows, "zero": shown.low == 0.0}
            return {"label": shown.name, "unit": shown.shown[1], **look}

        panels = []
        for panel in graph.panels:
            # Other marks, such as lines across a panel, are not drawn in pages.
            marks = [mark for mark in panel.marks if isinstance(mark, Spans | Curve)]
            traces = [self._trace(mark, panel) for mark in marks]
            frame = {"x": axis(panel.x), "y": axis(panel.y), "title": panel.title}
            panels.append({**frame, "equal": bool(panel.equal), "traces": traces})
        kind = {"stacked": graph.stacked, "time": graph.timed, "same": graph.same}
        return {"id": graph.name, "title": graph.title, **kind, "panels": panels}

    def _trace(self, mark: Spans | Curve, panel: Panel) -> dict[str, Any]:
        look: dict[str, Any] = {"name": mark.name, "color": mark.colour}
        if isinstance(mark, Spans):
            recorded = (times for times in self._times if np.isin(mark.begin, times.time).all())
            case = next(recorded, self._times[0])
            begin, end = (self._packed(case.steps(time)) for time in (mark.begin, mark.end))
            return {"from": begin, "to": end, "dt": case.step, "row": mark.row, **look}
        x, y = panel.x.shown[0] * np.asarray(mark.x), panel.y.shown[0] * np.asarray(mark.y)
        look |= {"dash": _DASHES.get(mark.line), "line": bool(mark.line), "frame": mark.frame}
        look |= {"size": mark.size}
        time = np.asarray(mark.x if panel.x.unit == "s" and mark.at is None else mark.at)
        # The case of a curve over time is that whose records begin with the curve's times.
        n = time.size if time.ndim else 0  # a curve without times has none
        cases = (t for t in self._times if n > 1 and np.array_equal(t.time[:n], time))
        timed = next(cases, None)
        if timed is None:
            return {"x": self._packed(x), "y": self._packed(y), **look}
        # A tool error ends with its reference, before its case does: from there on, no numbers.
        ended = np.full(len(timed.time) - len(y), np.nan)
        series = [np.append(values, ended) for values in ([y] if mark.at is None else [y, x])]
        kept = timed.kept(*series)
        shown = [self._packed(values[kept]) for values in series]
        steps = self._packed(timed.steps(timed.time[kept]))
        return {"t": steps, "dt": timed.step, **dict(zip("yx", shown, strict=False)), **look}
