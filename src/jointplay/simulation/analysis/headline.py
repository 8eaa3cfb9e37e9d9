"""Headline figures of a run, and the lines that report them: tool error, forces, rattle.

`Headline` gathers the figures from histories, in one part or in many, so that runs of any length
can be measured; with each figure it keeps what each stretch of the run contributes, by which
certificates compare runs. `headline` puts them into sentences.
"""

from __future__ import annotations

import json
import math
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted, few
from jointplay.physics.kernel import Status
from jointplay.simulation import spool
from jointplay.simulation.analysis import twins
from jointplay.simulation.analysis.bearings import bearing_life, rolling_bearings
from jointplay.simulation.analysis.claims import can_be_measured, measure
from jointplay.simulation.analysis.end_stops import struck_stops
from jointplay.simulation.analysis.parts import (
    ToolError,
    cause,
    drives_alone,
    ended_words,
    since_words,
    sizes_are_given,
)
from jointplay.simulation.analysis.tool_error import (
    Reference,
    deviation,
    difference,
    error_at,
    error_statistics,
    growth,
    has_tool_error,
    stops,
    time_weights,
    tops,
)
from jointplay.simulation.analysis.twins import TOOL_MOTIONS, hinges
from jointplay.simulation.analysis.vibration import rattle
from jointplay.simulation.motion.reference import GOES_ON
from jointplay.simulation.result import netcdf
from jointplay.simulation.result.certificate import alone, shown
from jointplay.simulation.result.histories import HistoryBuilder
from jointplay.simulation.result.result import COMPARED, Result
from jointplay.simulation.result.variables import LOSSES, Records
from jointplay.simulation.run import Run

if TYPE_CHECKING:
    import xarray as xr


# Figures, and what each stretch of a run contributes to them.

STRETCHES = 8
"""Number of equally long stretches of a run that are compared one by one.

Two runs of a chaotic motion can have the same largest force, or the same loss, by chance; not in
all stretches.
"""
SUBSETS = 4
"""Number of subsets of the records, each of every fourth, whose root mean squares are compared."""
AT_ONCE = 16 * netcdf.CHUNK
"""Number of records of a long run that are in memory at once."""

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
"""Units of the measures of `claims.measure`."""


@dataclass(frozen=True)
class Measured:
    """A figure of one run, and what each stretch of the run contributes to it."""

    value: float
    unit: str
    parts: np.ndarray
    """Contribution of each stretch, shape (STRETCHES,), or empty."""
    power: float = 1.0
    """How the parts make the figure: 1 by their sum, 2 by the root of it, infinity by the largest.
    """
    sampling: float = 0.0
    """Error because the figure is computed from records, not from all steps."""


def fits(result: Result) -> bool:
    """Whether all histories of a result can be in memory at once."""
    return result.dataset.nbytes <= spool.MOST_BYTES


def headline_of(result: Result, ideal: Reference | None, claims: bool) -> dict[str, Measured]:
    """The headline figures of a run, with those against the ideal tool if that is known; for
    `claims` also their measures, where they can be taken.
    """
    figures = Headline(result.time, result.judge_from, ideal, hinges(result))
    dataset, rows = result.dataset, len(result.time)
    if not fits(result):
        dataset = dataset[[name for name in Headline.HISTORIES if name in dataset]]
        rows = AT_ONCE
    for first in range(0, len(result.time), rows):
        figures.add(dataset.isel(time=slice(first, first + rows)).load())
    measured = figures.measured(result.audit.judged_impacts)
    return measured | (claims_of(result) if claims and fits(result) else {})


def claims_of(result: Result) -> dict[str, Measured]:
    """Measures of the paper's claims, of a long run with one joint with clearance; else none."""
    if not can_be_measured(result):
        return {}
    measures = measure(result)
    return {
        name: Measured(float(measures[name]), unit, np.empty(0))
        for name, unit in CLAIM_UNITS.items()
    }


class Headline:
    """Gathers the headline figures of a run from its histories, in one part or in many.

    Args:
        time: times of all records [s].
        judge_from: time from which figures count [s].
        ideal: motion of the ideal mechanism's tool, if it is known.
        soft: hinges of flexible links, whose forces are left out: they hold their bodies by more
            than the force of their springs.
    """

    HISTORIES = (
        *("joint_force_peak", "joint_force", "reaction_force", "load_work"),
        *(*TOOL_MOTIONS, *LOSSES),
    )
    """Histories that `add` looks at."""

    builder: HistoryBuilder
    """Makes histories of the records that `take` gets."""

    def __init__(
        self, time: np.ndarray, judge_from: float, ideal: Reference | None, soft: set[str]
    ) -> None:
        self._judge_from, self._soft, self._ideal = judge_from, soft, ideal
        judged = time[time >= judge_from]
        compared = judged[:0] if ideal is None else judged[judged <= ideal.until]
        self._count, self._weights = len(judged), time_weights(judged)
        self._compared_weights = time_weights(compared)
        self._ends = np.linspace(0, max(self._count - 1, 0), STRETCHES + 1).astype(int)
        self._histories: dict[str, _History] = {}
        self._seen = 0
        """Number of judged records so far."""
        self._lost: list[np.ndarray] = []
        """Energy lost up to the ends of stretches [J]."""
        self._work: list[np.ndarray] = []
        """Work of each load up to the ends of stretches [J]."""
        self._play = False

    def take(self, records: Records) -> None:
        """Add records of the run of the `builder`."""
        self.add(self.builder.portion(records))

    def finish(self, run: Run) -> dict[str, Measured]:
        """The figures of the builder's run, at its end."""
        assert isinstance(run.overflow, spool.PassedRecords)
        run.overflow.finish()
        return self.measured(self.builder.audit().judged_impacts)

    def add(self, part: xr.Dataset) -> None:
        """Add the next histories."""
        judged = part["time"].values >= self._judge_from
        rows = slice(self._seen, self._seen + int(np.count_nonzero(judged)))
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
                    figure = _joint_figure(how, name, len(names) - len(self._soft))
                    history = self._histories.setdefault(figure, _History(how, "N", self._count))
                    history.add(sizes[judged, k], self._weights[rows])
        if self._ideal is not None:
            for quantity, of in (("error", "tool_position"), ("turn", "tool_orientation")):
                error = self._ideal.difference(part, of)
                error = error.sel(time=error["time"].values >= self._judge_from)
                sizes = np.linalg.norm(error.values, axis=1)
                moves = error["time"].values, growth(error.values, error["rate"].values)
                for how in ("peak", "RMS"):
                    weights = self._compared_weights
                    history = _History(how, error.attrs["units"], len(weights))
                    history = self._histories.setdefault(f"{how} tool {quantity}", history)
                    history.add(sizes, weights[rows], moves)
        self._add_losses(part, judged)

    def _add_losses(self, part: xr.Dataset, judged: np.ndarray) -> None:
        """Keep the energy lost, and the work of loads, at the ends of the stretches."""
        ends = self._ends - self._seen
        ends = ends[(ends >= 0) & (ends < np.count_nonzero(judged))]
        lost = np.zeros(len(ends))
        for name in LOSSES:
            if name in part:
                lost = lost + part[name].values[judged][ends]
        self._lost.append(lost)
        if "load_work" in part:
            self._work.append(part["load_work"].values[judged][ends])
        self._seen += int(np.count_nonzero(judged))

    def measured(self, impacts: int) -> dict[str, Measured]:
        """The figures by name; `impacts`: number of contacts that began."""
        figures = {name: history.measured() for name, history in self._histories.items()}
        if self._play:
            figures["impacts"] = Measured(float(impacts), "", np.empty(0))
        lost = np.concatenate(self._lost)
        if self._work:
            work = np.concatenate(self._work)
            # The work that a load has taken up on the whole; one that has given work counts 0.
            absorbed = work[0] - work
            lost = lost + absorbed[:, absorbed[-1] > 0.0].sum(axis=1)
        figures["dissipated energy"] = Measured(float(lost[-1] - lost[0]), "J", np.diff(lost))
        return figures


def _joint_figure(how: str, joint: str, joints: int) -> str:
    """Name of a joint's ``peak`` or ``RMS`` force, of a machine with so many joints."""
    return f"{how} joint force" if joints == 1 else f"{how} joint force, {joint}"


class _History:
    """The ``peak`` or ``RMS`` of a history of `count` sizes, gathered in one part or in many."""

    def __init__(self, how: str, unit: str, count: int) -> None:
        self._how, self._unit = how, unit
        size, more = divmod(count, STRETCHES)
        self._ends = np.cumsum([size + (k < more) for k in range(STRETCHES)])
        self._largest, self._squares = np.zeros(STRETCHES), np.zeros(STRETCHES)
        self._most = 0.0
        """Largest size with the error of its interpolation between records (`tops`)."""
        self._last = np.empty((3, 0))
        """Times, sizes and rates of the last records: their cubics need the next ones."""
        self._subsets, self._left = np.zeros(SUBSETS), np.empty(0)
        self._seen = 0

    def add(
        self,
        sizes: np.ndarray,
        weights: np.ndarray,
        moves: tuple[np.ndarray, np.ndarray] | None = None,
    ) -> None:
        """Add sizes with their weights in the mean; `moves`: their times and rates, if known."""
        top = most = sizes
        if moves is not None:
            known = np.hstack([self._last, [moves[0], sizes, moves[1]]])
            top, most = tops(*known)
            top = top[self._last.shape[1] :]
            self._last = known[:, -3:]
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
        """The figure of all sizes that were added."""
        if self._how == "peak":
            value = float(self._largest.max())
            return Measured(value, self._unit, self._largest, math.inf, self._most - value)
        value = math.sqrt(self._squares.sum())
        return Measured(value, self._unit, self._squares, 2.0, self._sampling_error(value))

    def _sampling_error(self, value: float) -> float:
        """Twice the standard error of a root mean square, by the scatter of subsets of the records.

        Impacts are shorter than the interval of records, which meet some of them by chance.
        """
        if self._seen < 4 * SUBSETS or value == 0.0:
            return 0.0
        means = self._subsets / (self._seen // SUBSETS)
        # Each subset begins a record later: the trend of a smooth history is no error.
        first = np.arange(SUBSETS)
        residual = means - np.polyval(np.polyfit(first, means, 1), first)
        return float(np.linalg.norm(residual) / math.sqrt((SUBSETS - 2) * SUBSETS) / value)


HISTORIES = (
    *(*TOOL_MOTIONS, *COMPARED, "joint_force_peak", "normal_force_peak"),
    *("q", "v", "cage_angle", "normal_dissipation"),
)
"""Histories that `headline` looks at."""

MOST_STOPS = 6
"""Largest number of stops that are listed one by one."""


def headline(result: Result, detail: bool = False) -> list[str]:
    """The outcome of a run from `Result.judge_from` on, in a few lines.

    Args:
        result: the run; if its ideal mechanism cannot be simulated, there is nothing on the tool.
        detail: also give its acceleration in bands of frequency, and the cost of the run.
    """
    known = has_tool_error(result)
    finite = np.isfinite(result["tool_position"].values).all(axis=1)
    if not finite.all():  # where the run stopped
        result = Result(result.dataset.isel(time=finite))
    start = result.judge_from
    since = since_words(result)
    lines: list[str] = []
    failed = result.status not in (Status.COMPLETED, Status.INTERRUPTED)
    if failed:
        lines.append(result.message)
    # How far a run came that diverged says nothing about the machine.
    if known and result.status != Status.RUN_AWAY:
        lines += _tool(result, detail)
    elif not (failed or twins.has_play(result)):
        lines += drives_alone(result)
    if result.joints:
        hinged = twins.hinges(result)  # they hold bodies by more than the force of their springs
        if bearings := [joint for joint in result.joints if joint not in hinged]:
            fall = result.audit.start == "centred" and not start
            note = ", judged from the start, with the fall of the journals" if fall else ""
            lines.append(_forces(result, bearings, since, detail) + note)
        lines += _bearings(result, since)
        with suppress(JointplayError):  # too few records
            noise = rattle(result)
            lines.append(f"{noise if detail else noise.impacts_words}{since}")
    lines += [f"{stop}{since}" for stop in struck_stops(result)]
    simulated = float(result.time[-1]) if len(result.time) else 0.0
    wall = float(result.dataset.attrs.get("wall_time_s", 0.0))
    if detail and wall > 0.0:
        lines.append(f"cost {wall:.2f} s for {simulated:.4g} s simulated")
    return lines


def headline_texts(result: Result) -> dict[str, str]:
    """The figures of `headline` by name, for a table of several runs."""
    texts: dict[str, str] = {}
    if has_tool_error(result) and result.status != Status.RUN_AWAY:
        with suppress(JointplayError):  # no records
            texts = ToolError(result).columns()
    if loose := [joint for joint in result.joints if joint not in twins.hinges(result)]:
        forces = result.forces.sel(joint=loose)
        sizes = forces.sel(time=forces["time"] >= result.judge_from).max("time").values
        worst = int(sizes.argmax())
        texts["peak force"] = peak_force(result, loose[worst], float(sizes[worst]))
        with suppress(JointplayError):
            texts["impacts a second"] = alone(rattle(result).rate)
    return texts


def in_a_line(result: Result) -> str:
    """Machine, play, length, end and first known figure of a result, in a line; nothing is run."""
    machine = twins.inputs(result)["mechanism"]
    parts = [Path(machine["urdf"]).stem]
    with suppress(JointplayError):  # a law of the user's own that is not at hand
        if twins.has_play(result):
            parts.append(cause(result)[0].lower() + cause(result)[1:])
    length = f"{counted(len(result.time), 'record')}"
    parts.append(f"{length} to {result.time[-1]:.4g} s" if len(result.time) else length)
    if result.status != Status.COMPLETED:
        parts.append(result.status.name.lower().replace("_", " "))
    elif "tool_error" in result.dataset:
        parts.append(f"tool error up to {_mm(result.tool_error.peak)} from the ideal mechanism")
    elif result.joints:
        parts.append(f"forces up to {alone(float(result.forces.max()))} N")
    return ", ".join(parts)


def summary(result: Result) -> str:
    """The text that `jointplay run` prints of a result: tool error, forces, rattle, warnings."""
    lines = headline(result) or [result.message]
    return "\n".join([*lines, *(f"warning: {text}" for text in result.audit.warnings)])


def _tool(result: Result, detail: bool) -> list[str]:
    """Lines on the tool's error."""
    until = deviation(result)
    if not len(until) or float(until["time"][-1]) < result.judge_from:
        since, ended = since_words(result), ended_words(result, until)
        return [f"the tool error{since} is unknown{ended}"]
    error = ToolError(result)
    lines = [error.sentence(detail), *error.further()]
    mechanism = result.simulation.mechanism
    if mechanism.free_base is not None:
        base = mechanism.description.root
        ideal = twins.tool_motion(twins.ideal_simulation(result))
        seen = error_statistics(difference(result, ideal, relative_to=base))
        lines.append(
            f"seen from the free base {base!r}, whose own motion differs as well: up to "
            f"{_mm(seen.peak[-1])} off{since_words(result)}, RMS {_mm(seen.rms[-1])}"
        )
    return [*lines, *_at_stops(result, error.reported)]


def _at_stops(result: Result, error: xr.DataArray) -> list[str]:
    """The tool's error where the reference stops, in a line, or none."""
    motion = result.simulation.motion
    if motion is None or motion.interpolation in GOES_ON:
        return []
    reached = stops(motion, float(error["time"][-1]))
    times = [
        stop.end
        for stop in reached
        if stop.at_rest and stop.end >= result.judge_from and stop.end > 0.0
    ]
    sizes = [float(error_at(error, time)[-1]) for time in times]
    if not any(sizes):
        return []
    known = result.certificate.headline if result.certificate else ()
    of_tool = [fig.error for fig in known if fig.name in ("peak tool error", "RMS tool error")]
    off = max(of_tool, default=0.0)
    if len(times) > MOST_STOPS:
        worst = int(np.argmax(sizes))
        return [
            f"at its {counted(len(times), 'stop')}: worst {_mm(sizes[worst], off)} at "
            f"t = {times[worst]:.4g} s, mean {_mm(float(np.mean(sizes)), off)}"
        ]
    listed = ", ".join(f"{_mm(s, off)} (t = {t:.4g} s)" for t, s in zip(times, sizes, strict=True))
    return [f"at its stops: {listed}"]


def _forces(result: Result, joints: list[str], since: str, detail: bool) -> str:
    """The peak force in each joint, in a line; of linkages with that in the ideal one."""
    forces = result.forces
    forces = forces.sel(time=forces["time"] >= result.judge_from)
    ideal = json.loads(result.dataset.attrs.get("ideal_forces", "{}"))
    parts: list[str] = []
    for joint in joints:
        sizes = forces.sel(joint=joint).values
        at = float(forces["time"][int(sizes.argmax())])
        peak = peak_force(result, joint, float(sizes.max()), detail)
        if result.simulation.mechanism.loops and joint in ideal:  # in the same pin
            peak += f" (ideal {alone(ideal[joint])} N)"
        parts.append(f"in {joint}{'' if parts else since} {peak} at t = {at:.4g} s")
    return f"peak force {few(parts)}"


def peak_force(result: Result, joint: str, largest: float, detail: bool = False) -> str:
    """The largest force in a joint, in words; `largest` [N] by its histories.

    Its numerical error is added if it is known, and all sizes were given or `detail` is wanted.
    """
    name = _joint_figure("peak", joint, len(set(result.joints) - twins.hinges(result)))
    exact = detail or sizes_are_given(result)
    return shown(result.certificate if exact else None, name, largest, "N")


def _bearings(result: Result, since: str) -> list[str]:
    """Lines on loads and life of rolling bearings."""
    if np.count_nonzero(result.time >= result.judge_from) < 2:
        return []
    lines = []
    for joint in rolling_bearings(result):
        life = bearing_life(result, joint)
        lines.append(f"{joint}{since}: {life}")
        if life.oscillates and math.isfinite(life.revolutions):
            lines.append(
                f"  it swings by {math.degrees(life.swing):.3g} deg, less than its elements are "
                f"apart ({math.degrees(life.spacing):.3g} deg): L10 is meant for rings that turn"
            )
    return lines


def _mm(metres: float, uncertain: float = 0.0) -> str:
    return f"{alone(1e3 * metres, 1e3 * uncertain)} mm"
