"""Charts in pages: their descriptions as plain data, which `page/report.js` draws."""

from __future__ import annotations

import base64
import gzip
from collections.abc import Sequence
from typing import Any

import numpy as np

from jointplay.show.plots.chart import Axis, Curve, Panel, Spans
from jointplay.show.reports.parts import Graph

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


class Charts:
    """Graphs in terms of a page; their series go into a `Pack`."""

    def __init__(self, times: Sequence[Times]) -> None:
        self.pack, self._times = Pack(), times

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
        kind = {"stacked": graph.stacked, "time": graph.across == "time", "same": graph.same}
        return {"id": graph.name, "title": graph.title, **kind, "panels": panels}

    def _trace(self, mark: Spans | Curve, panel: Panel) -> dict[str, Any]:
        look: dict[str, Any] = {"name": mark.name, "color": mark.colour}
        if isinstance(mark, Spans):
            owner = self._times[0]
            for times in self._times:
                owner = times if np.isin(mark.begin, times.time).all() else owner
            begin, end = (self.pack.add(owner.steps(time)) for time in (mark.begin, mark.end))
            return {"from": begin, "to": end, "dt": owner.step, "row": mark.row, **look}
        x, y = panel.x.shown[0] * np.asarray(mark.x), panel.y.shown[0] * np.asarray(mark.y)
        look |= {"dash": _DASHES.get(mark.line), "line": bool(mark.line), "frame": mark.frame}
        look |= {"size": mark.size}
        bits = _FORCE_BITS if panel.y.unit in ("N", "") else _MOTION_BITS
        bits = EXACT if panel.y.size == "large" else bits
        time = np.asarray(mark.x if panel.x.unit == "s" and mark.at is None else mark.at)
        timed = next((times for times in self._times if time.ndim and times.has(time)), None)
        if timed is None:
            return {"x": self.pack.add(x), "y": self.pack.add(y, bits), **look}
        curve, ended = mark.at is not None, np.full(len(timed.time) - len(y), np.nan)
        x, y = np.append(x, ended), np.append(y, ended)  # such as where its reference ended
        kept = timed.kept(x, y) if curve else timed.kept(y)
        steps = self.pack.add(timed.steps(timed.time[kept]))
        shown = {"t": steps, "dt": timed.step, "y": self.pack.add(y[kept], bits)}
        return {**shown, **({"x": self.pack.add(x[kept], bits)} if curve else {}), **look}
