"""The headline figures of a run, and what its stretches contribute to each."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from jointplay.simulation import spool
from jointplay.simulation.analysis.claims import can_be_measured, measure
from jointplay.simulation.analysis.tool_error import Reference, growth, time_weights, tops
from jointplay.simulation.analysis.twins import TOOL_MOTIONS, hinges
from jointplay.simulation.result import netcdf
from jointplay.simulation.result.histories import HistoryBuilder
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.variables import LOSSES, Records
from jointplay.simulation.run import Run

if TYPE_CHECKING:
    import xarray as xr

STRETCHES = 8
"""Stretches of a run, of equal length, that are compared one by one.

Two runs of a chaotic motion can have the same largest force, or the same loss, by chance; not in
all stretches.
"""

SUBSETS = 4
"""Subsets of the records, each of every fourth, whose root mean squares are compared."""

AT_ONCE = 16 * netcdf.CHUNK
"""Records of a long run that are in memory at once."""

CLAIM_UNITS = {
    "deviation_mm": "mm",
    "path_mm": "mm",
    "speed_mm_s": "mm/s",
    **dict.fromkeys(("free", "continuous", "penetration", "busy"), ""),
    **dict.fromkeys(("fx", "fy", "fz"), "N"),
    "peak_time": "s",
    "rate": "1/s",
    "impulse": "N s",
    "crossings": "1/s",
    "swing_mm": "mm",
}
"""Units of what `claims.measure` finds."""


@dataclass(frozen=True)
class Measured:
    """A figure of one run, and what each stretch of the run contributes to it."""

    value: float
    unit: str
    parts: np.ndarray
    """(STRETCHES,) or none."""
    power: float = 1.0
    """Of the mean that the figure is: 1 a sum, 2 the root of a sum, infinity the largest."""
    sampling: float = 0.0
    """How far it may be off because it is computed from records, not from all steps."""


def figures(result: Result, ideal: Result | None) -> dict[str, tuple[float, str]]:
    """Value and unit of headline figures from `Result.judge_from` on, and of what claims use."""
    found = headline_of(result, ideal, claims=True)
    return {name: (one.value, one.unit) for name, one in found.items()}


def fits(result: Result) -> bool:
    """Whether all histories of a result can be in memory at once."""
    return result.dataset.nbytes <= spool.MOST_BYTES


def headline_of(result: Result, ideal: Result | None, claims: bool) -> dict[str, Measured]:
    """The headline figures of a run, and where it can be what the claims use."""
    figures = Headline(result.time, result.judge_from, ideal, hinges(result))
    dataset, rows = result.dataset, len(result.time)
    if not fits(result):
        dataset = dataset[[name for name in Headline.HISTORIES if name in dataset]]
        rows = AT_ONCE
    for first in range(0, len(result.time), rows):
        figures.add(dataset.isel(time=slice(first, first + rows)).load())
    found = figures.measured(result.audit.judged_impacts)
    return found | (claims_of(result, ideal) if claims and fits(result) else {})


def claims_of(result: Result, ideal: Result | None) -> dict[str, Measured]:
    """What the claims use, of a long run with one joint with clearance."""
    if ideal is None or not can_be_measured(result, ideal):
        return {}
    found = measure(result, ideal)
    return {
        name: Measured(float(found[name]), unit, np.empty(0)) for name, unit in CLAIM_UNITS.items()
    }


class Headline:
    """The headline figures of a run, from its histories, in one part or in many.

    `time` is that of all records [s]; `soft` are hinges of flexible links, which hold their bodies
    by more than the force of their springs.
    """

    HISTORIES = (
        *("joint_force_peak", "joint_force", "reaction_force", "load_work"),
        *(*TOOL_MOTIONS, *LOSSES),
    )

    builder: HistoryBuilder

    def __init__(
        self, time: np.ndarray, judge_from: float, ideal: Result | None, soft: set[str]
    ) -> None:
        self._judge_from, self._soft = judge_from, soft
        self._ideal = None if ideal is None else Reference(ideal)
        judged = time[time >= judge_from]
        told = judged[:0] if self._ideal is None else judged[judged <= self._ideal.until]
        self._count, self._weights, self._told = (
            len(judged),
            time_weights(judged),
            time_weights(told),
        )
        self._ends = np.linspace(0, max(self._count - 1, 0), STRETCHES + 1).astype(int)
        self._histories: dict[str, _History] = {}
        self._seen = 0
        self._lost: list[np.ndarray] = []
        self._work: list[np.ndarray] = []
        self._play = False

    def take(self, records: Records) -> None:
        """Add records of the run for which there is a `builder`."""
        self.add(self.builder.portion(records))

    def finish(self, run: Run) -> dict[str, Measured]:
        """The figures of that run, at its end."""
        assert isinstance(run.overflow, spool.PassedRecords)
        run.overflow.finish()
        return self.measured(self.builder.audit().judged_impacts)

    def add(self, part: xr.Dataset) -> None:
        judged = part["time"].values >= self._judge_from
        here = slice(self._seen, self._seen + int(np.count_nonzero(judged)))
        self._play = "joint" in part.dims
        if self._play:
            forces = {"peak": part["joint_force_peak"], "RMS": part["joint_force"]}
            names = [str(name) for name in part["joint"].values]
        else:
            forces = dict.fromkeys(("peak", "RMS"), part["reaction_force"])
            names = [str(name) for name in part["moving_joint"].values]
        for how, force in forces.items():
            sizes = np.linalg.norm(force.values, axis=2)
            for k, name in enumerate(names):
                if name not in self._soft:
                    at = "" if len(names) - len(self._soft) == 1 else f", {name}"
                    history = self._of(f"{how} joint force{at}", how, "N", self._count)
                    history.add(sizes[judged, k], self._weights[here])
        if self._ideal is not None:
            for what, of in (("error", "tool_position"), ("turn", "tool_orientation")):
                error = self._ideal.difference(part, of)
                error = error.sel(time=error["time"].values >= self._judge_from)
                sizes = np.linalg.norm(error.values, axis=1)
                moves = error["time"].values, growth(error.values, error["rate"].values)
                for how in ("peak", "RMS"):
                    unit = error.attrs["units"]
                    history = self._of(f"{how} tool {what}", how, unit, len(self._told))
                    history.add(sizes, self._told[here], moves)
        self._add_losses(part, judged)

    def _of(self, name: str, how: str, unit: str, count: int) -> _History:
        return self._histories.setdefault(name, _History(how, unit, count))

    def _add_losses(self, part: xr.Dataset, judged: np.ndarray) -> None:
        """Keep what was lost at the ends of the stretches."""
        here = self._ends - self._seen
        here = here[(here >= 0) & (here < np.count_nonzero(judged))]
        lost = np.zeros(len(here))
        for name in LOSSES:
            if name in part:
                lost = lost + part[name].values[judged][here]
        self._lost.append(lost)
        if "load_work" in part:
            self._work.append(part["load_work"].values[judged][here])
        self._seen += int(np.count_nonzero(judged))

    def measured(self, impacts: int | None) -> dict[str, Measured]:
        found = {name: history.measured() for name, history in self._histories.items()}
        if self._play:
            found["impacts"] = Measured(float(impacts or 0), "", np.empty(0))
        lost = np.concatenate(self._lost)
        if self._work:
            work = np.concatenate(self._work)
            # What a load has taken in all; none where it has given.
            taken = work[0] - work
            lost = lost + taken[:, taken[-1] > 0.0].sum(axis=1)
        found["dissipated energy"] = Measured(float(lost[-1] - lost[0]), "J", np.diff(lost))
        return found


class _History:
    """The ``peak`` or ``RMS`` of a history of `count` sizes, in one part or in many."""

    def __init__(self, how: str, unit: str, count: int) -> None:
        self._how, self._unit = how, unit
        each, more = divmod(count, STRETCHES)
        self._ends = np.cumsum([each + (k < more) for k in range(STRETCHES)])
        self._largest, self._squares = np.zeros(STRETCHES), np.zeros(STRETCHES)
        self._most, self._last = 0.0, np.empty((3, 0))
        self._subsets, self._left = np.zeros(SUBSETS), np.empty(0)
        self._seen = 0

    def add(
        self,
        sizes: np.ndarray,
        weights: np.ndarray,
        moves: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Add sizes with their weights in the mean, and where known their times and rates."""
        top = most = sizes
        if moves is not None:
            known = np.hstack([self._last, [moves[0], sizes, moves[1]]])
            top, most = tops(*known)
            top = top[self._last.shape[1] :]
            self._last = known[:, -3:]  # what follows tells more of the last records
        self._most = most.max(initial=self._most)
        cuts = np.clip(self._ends[:-1] - self._seen, 0, len(sizes))
        squares = weights * sizes**2
        for k, (tall, part) in enumerate(
            zip(np.split(top, cuts), np.split(squares, cuts), strict=True)
        ):
            self._largest[k] = tall.max(initial=self._largest[k])
            self._squares[k] += float(part.sum())
        self._seen += len(sizes)
        sizes = np.concatenate([self._left, sizes]) if len(self._left) else sizes
        even = len(sizes) // SUBSETS * SUBSETS
        self._subsets += (sizes[:even].reshape(-1, SUBSETS) ** 2).sum(axis=0)
        self._left = sizes[even:].copy()

    def measured(self) -> Measured:
        if self._how == "peak":
            value = float(self._largest.max())
            return Measured(value, self._unit, self._largest, math.inf, self._most - value)
        value = math.sqrt(self._squares.sum())
        return Measured(value, self._unit, self._squares, 2.0, self._sampling_error(value))

    def _sampling_error(self, value: float) -> float:
        """Twice the standard error of a root mean square: from how subsets of the records differ.

        Impacts last shorter than the interval of records, which meet some of them by chance.
        """
        if self._seen < 4 * SUBSETS or value == 0.0:
            return 0.0
        means = self._subsets / (self._seen // SUBSETS)
        # Each subset begins a record later: that of a smooth history shows a trend, no error.
        first = np.arange(SUBSETS)
        left = means - np.polyval(np.polyfit(first, means, 1), first)
        return float(np.linalg.norm(left) / math.sqrt((SUBSETS - 2) * SUBSETS) / value)
