"""Charts in pages: their descriptions as plain data, which `page/report.js` draws."""

from __future__ import annotations

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from jointplay.show.player.tracks import Packer
from jointplay.show.plots.chart import Axis, Curve, Panel, Spans
from jointplay.show.reports.parts import Graph

MAX_RECORDS = 20_000
"""More records than this are reduced to the smallest and the largest of each of a series of
intervals, so that no peak is lost: at least ten intervals for each pixel of the widest chart."""

_DASHES = {"--": "6 3", ":": "1.5 3", "-.": "6 3 1.5 3"}  # as SVG has them


class Times:
    """Points of time of one case: whole numbers of its steps.

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


class Charts:
    """Graphs in terms of a page; their series are in one compressed `block`, each once."""

    def __init__(self, times: Sequence[Times]) -> None:
        self._times, self._packer = times, Packer()
        self._known: dict[bytes, dict[str, int]] = {}

    @property
    def block(self) -> str:
        return base64.b64encode(self._packer.deflated()).decode()

    def _packed(self, values: np.ndarray) -> dict[str, int]:
        """Where a series is, unsigned integers as uint32, others as float32.

        Differences of consecutive bit patterns, bytes of equal weight together: smooth histories
        shrink to a fraction.
        """
        kind = "<u4" if values.dtype.kind == "u" else "<f4"
        steps = np.diff(np.ascontiguousarray(values, kind).view("<u4"), prepend=np.uint32(0))
        content = steps.view(np.uint8).reshape(-1, 4).T.tobytes()
        if content not in self._known:
            self._known[content] = self._packer.raw(content)
        return self._known[content]

    def described(self, graph: Graph) -> dict[str, Any]:
        """What `page/report.js` draws."""

        def axis(shown: Axis) -> dict[str, Any]:
            rows = None if shown.rows is None else list(shown.rows)
            return {"label": shown.name, "unit": shown.shown[1], "log": shown.log, "rows": rows}

        panels = [
            {
                "x": axis(panel.x),
                "y": axis(panel.y),
                "title": panel.title,
                "equal": bool(panel.equal),
                "traces": [  # without lines across, which are the page's own
                    self._trace(mark, panel)
                    for mark in panel.marks
                    if isinstance(mark, Spans | Curve)
                ],
            }
            for panel in graph.panels
        ]
        kind = {"stacked": graph.stacked, "time": graph.timed, "same": graph.same}
        return {"id": graph.name, "title": graph.title, **kind, "panels": panels}

    def _trace(self, mark: Spans | Curve, panel: Panel) -> dict[str, Any]:
        look: dict[str, Any] = {"name": mark.name, "color": mark.colour}
        if isinstance(mark, Spans):
            owner = self._times[0]
            for times in self._times:
                owner = times if np.isin(mark.begin, times.time).all() else owner
            begin, end = (self._packed(owner.steps(time)) for time in (mark.begin, mark.end))
            return {"from": begin, "to": end, "dt": owner.step, "row": mark.row, **look}
        x, y = panel.x.shown[0] * np.asarray(mark.x), panel.y.shown[0] * np.asarray(mark.y)
        look |= {"dash": _DASHES.get(mark.line), "line": bool(mark.line), "frame": mark.frame}
        look |= {"size": mark.size}
        time = np.asarray(mark.x if panel.x.unit == "s" and mark.at is None else mark.at)
        timed = next((times for times in self._times if time.ndim and times.has(time)), None)
        if timed is None:
            return {"x": self._packed(x), "y": self._packed(y), **look}
        ended = np.full(len(timed.time) - len(y), np.nan)
        series = [np.append(values, ended) for values in ([y] if mark.at is None else [y, x])]
        kept = timed.kept(*series)  # until its reference ended
        shown = [self._packed(values[kept]) for values in series]
        steps = self._packed(timed.steps(timed.time[kept]))
        return {"t": steps, "dt": timed.step, **dict(zip("yx", shown, strict=False)), **look}
