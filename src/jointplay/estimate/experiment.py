"""Comparison of a run with an experiment: measured curves against computed ones.

comparison = jp.estimate.beside_experiment(jp.Result.load("result.nc"), "measured.csv")

The measurement is a CSV file whose columns have the names of `curves`, with their units:
``time [s],slider acceleration [m/s^2],B force [N]``. The run is interpolated to its times.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError, require_a, require_whole
from jointplay.base.tables import Column, Table, few
from jointplay.base.units import displayed, readable, rounded
from jointplay.estimate import columns
from jointplay.estimate.unknowns import CONFIDENCE
from jointplay.simulation.result.result import AXES, Result
from jointplay.study.certification import further_runs
from jointplay.study.ensemble import ensemble

Curve = tuple[np.ndarray, np.ndarray, str]
"""A curve: times (n,) [s], values (n,) and their SI unit."""

BAND = (100.0 * (1.0 - CONFIDENCE), 100.0 * CONFIDENCE)
"""Percentiles of an ensemble's curves between which its band lies."""
MOST_SHIFT = 0.25
"""Largest shift that is sought, as a part of the run's length (judged: two turns of a crank in a
run of eight)."""
_LEAST = 3
"""Least number of measured times within the run: a constant and a slope fit two."""
_SHIFTS = 2001
"""Number of shifts that are tried, before the best is refined: in a run of 400 periods, 10 to a
period."""


def curves(result: Result) -> dict[str, Curve]:
    """Curves of a run that can be measured, by the name of a column.

    ``O``, ``O speed``, ``O acceleration`` of a coordinate, also by the link that a joint carries
    (``slider acceleration``); ``tool x``, ``tool speed x``, ``tool acceleration x``, also by the
    tool's name; ``B force`` and ``B force x`` of a joint with clearance, ``B displacement x`` of
    its journal; ``O effort`` of a drive. Accelerations are means over the intervals of records.
    """
    mechanism, time = result.simulation.mechanism, result.time
    between = 0.5 * (time[1:] + time[:-1])

    def motion(name: str, place: str, q: np.ndarray, v: np.ndarray, unit: str) -> dict[str, Curve]:
        rate = np.diff(v) / np.diff(time)
        return {
            f"{name}{place}": (time, q, unit),
            f"{name} speed{place}": (time, v, f"{unit}/s"),
            f"{name} acceleration{place}": (between, rate, f"{unit}/s^2"),
        }

    table: dict[str, Curve] = {}
    entries = mechanism.description.joints
    for i, coordinate in enumerate(mechanism.coordinates):
        q, v = result["q"].values[:, i], result["v"].values[:, i]
        unit = str(result.dataset["coordinate_unit"].values[i])
        names = [str(coordinate)]
        joint = coordinate.joint
        if joint in mechanism.joints and mechanism.coordinate(joint) == i:
            names += [joint, entries[joint].child]
        for name in dict.fromkeys(names):
            table = motion(name, "", q, v, unit) | table
        if "drive" in result.dataset:
            effort = result["drive"].values[:, i]
            named = names[1] if len(names) > 1 else names[0]
            table[f"{named} effort"] = time, effort, "N" if unit == "m" else "N*m"
    for name in ("tool", mechanism.tool):
        for k, axis in enumerate(AXES):
            place, speed = (result[of].values[:, k] for of in ("tool_position", "tool_velocity"))
            table |= motion(name, f" {axis}", place, speed, "m")
    for joint in result.joints:
        for name, of, unit in (
            ("force", "joint_force", "N"),
            ("displacement", "journal_centre", "m"),
        ):
            vector = result[of].sel(joint=joint).values
            table[f"{joint} {name}"] = (time, np.linalg.norm(vector, axis=1), unit)
            table |= {
                f"{joint} {name} {axis}": (time, vector[:, k], unit) for k, axis in enumerate(AXES)
            }
    return table


@dataclass(frozen=True)
class MeasuredCurve:
    """A measured column beside the run, at the measured times within it."""

    name: str
    unit: str
    times: np.ndarray
    """Times of the run, the measured ones shifted, (n,) [s]."""
    measured: np.ndarray
    """Measured values, (n,) [SI]."""
    computed: np.ndarray
    """Computed values, (n,) [SI]."""
    own_error: float
    """RMS difference of the computed values from a run with finer steps [SI]."""
    band: tuple[np.ndarray, np.ndarray] | None = None
    """Ends of the band of an ensemble of perturbed starts, (n,) each [SI]."""

    @property
    def difference(self) -> np.ndarray:
        """Computed less measured, (n,)."""
        return self.computed - self.measured

    @property
    def rms(self) -> float:
        """RMS difference [SI]."""
        return float(np.sqrt(np.mean(self.difference**2)))

    @property
    def peak(self) -> tuple[float, float]:
        """Largest difference, and its time [s]."""
        at = int(np.abs(self.difference).argmax())
        return float(abs(self.difference[at])), float(self.times[at])

    @property
    def relative(self) -> float:
        """RMS difference over the standard deviation of what was measured; nan of a constant."""
        spread = float(np.std(self.measured)) if np.ptp(self.measured) > 0.0 else math.nan
        return self.rms / spread

    @property
    def inside(self) -> float:
        """Part of the measured values within the band; nan without one."""
        if self.band is None:
            return math.nan
        low, high = self.band
        return float(np.mean((low <= self.measured) & (self.measured <= high)))


@dataclass(frozen=True)
class ExperimentComparison:
    """A run beside an experiment; see `beside_experiment`."""

    curves: tuple[MeasuredCurve, ...]
    shift: float
    """Time that was added to the measured times [s]."""
    fitted: bool
    """Whether the shift is the one that fits best, not a given one."""
    left_out: int
    """Number of measured times outside the run."""
    hint: str = ""
    """Text that names a shift which would fit much better."""

    @property
    def table(self) -> Table:
        """Table with a row for each curve."""
        rows, units = self.curves, [displayed(curve.unit) for curve in self.curves]
        sizes = [factor for factor, _ in units]

        def column(name: str, values: list[float], digits: int) -> Column:
            scaled = [size * value for size, value in zip(sizes, values, strict=True)]
            return Column(name, scaled, digits=digits)

        percent = [100.0 * curve.inside for curve in rows]
        band = [Column("measured in the band [%]", percent, digits=3)]
        names = [f"{curve.name} [{unit}]" for curve, (_, unit) in zip(rows, units, strict=True)]
        return Table(
            (
                Column("curve", names),
                column("RMS difference", [curve.rms for curve in rows], 4),
                Column("of measured [%]", [100.0 * curve.relative for curve in rows], digits=3),
                column("largest", [curve.peak[0] for curve in rows], 4),
                Column("at t [s]", [curve.peak[1] for curve in rows], digits=4),
                column("run's own error", [curve.own_error for curve in rows], 2),
                *(band if any(curve.band is not None for curve in rows) else ()),
            )
        )

    @property
    def csv(self) -> str:
        """Text of a CSV file of all curves at the measured times [SI]."""
        names, values = ["time [s]"], [self.curves[0].times]
        for curve in self.curves:
            unit = curve.unit.replace("*", " ")
            names += [f"{curve.name} {of} [{unit}]" for of in ("measured", "computed")]
            values += [curve.measured, curve.computed]
            if curve.band is not None:
                names += [f"{curve.name} {of} [{unit}]" for of in ("low", "high")]
                values += curve.band
        rows = (",".join(f"{value:.9g}" for value in row) for row in np.transpose(values))
        return "\n".join([",".join(names), *rows, ""])

    def __str__(self) -> str:
        lines = []
        for curve in self.curves:
            part = f", {100.0 * curve.relative:.3g} % of what was measured"
            lines.append(
                f"{curve.name}: computed and measured differ by {rounded(curve.rms, curve.unit)} "
                f"RMS{'' if math.isnan(curve.relative) else part}; the run's own error is "
                f"{rounded(curve.own_error, curve.unit, 2)}"
            )
        how = "found, as it fits best" if self.fitted else "as given"
        lines.append(f"measured times are shifted by {readable(self.shift, 's', 4)} ({how})")
        if self.left_out:
            lines.append(f"{self.left_out} measured times outside the run are left out")
        lines += [self.hint] if self.hint else []
        return "\n".join([*lines, "", str(self.table)])


def beside_experiment(
    result: Result,
    path: str | Path,
    *,
    shift: float | None = 0.0,
    runs: int = 0,
    jobs: int | None = None,
    progress: bool = False,
) -> ExperimentComparison:
    """Compare measured curves with those of a run.

    Args:
        result: the run.
        path: the CSV file; see `curves` for the names of its columns.
        shift: time that is added to the measured times [s]; None: that which fits all columns best.
        runs: number of perturbed starts of which an ensemble's band is made; 0: no band.
        jobs: processes for them; None takes one for each core.
        progress: show bars.

    Raises:
        JointplayError: a column without unit, or that the run does not have; fewer than three
            measured times within the run.
    """
    require_a("result", result, "Result")
    require_whole("runs", runs, 0)
    known = curves(result)
    times, measured = _read(Path(path), known)
    simulation = result.simulation
    end = float(result.time[-1])
    fitted = shift is None
    misfit = partial(_misfit, known, times, measured)
    best = _best_shift(misfit, MOST_SHIFT * end)
    shift = best if shift is None else shift
    within = (times + shift >= 0.0) & (times + shift <= end)
    if (there := np.count_nonzero(within)) < _LEAST:
        hint = "; give a shift" if len(times) >= _LEAST else ""
        raise JointplayError(
            f"{path}: of {len(times)} measured times {there} lie within the run, 0 to {end:g} s "
            f"(shift {shift:g} s), and {_LEAST} are needed at least{hint}"
        )
    at = times[within] + shift
    # The run's own error by a run with finer steps from the same start, and the band of perturbed
    # starts: all are one ensemble, of which the curves alone are kept.
    keep = partial(_at_times, names=tuple(measured), at=at)
    finest = replace(further_runs(simulation, result)[-1].simulation, start=result.audit.start)
    starts = [replace(simulation, seed=seed, duration=end) for seed in range(runs)]
    values = ensemble([finest, *starts], jobs=jobs, keep=keep, progress=progress)
    finer, members = values[0], values[1:]
    rows = []
    for name, column in measured.items():
        computed = np.interp(at, *known[name][:2])
        band = None
        if members:
            low, high = np.percentile([curve[name] for curve in members], BAND, axis=0)
            band = (low, high)
        error = float(np.sqrt(np.mean((finer[name] - computed) ** 2)))
        rows.append(MeasuredCurve(name, known[name][2], at, column[within], computed, error, band))
    return ExperimentComparison(
        tuple(rows), float(shift), fitted, int(np.count_nonzero(~within)),
        "" if fitted else _hint(misfit, shift, best),
    )  # fmt: skip


def _read(path: Path, known: dict[str, Curve]) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Times [s] and measured columns in SI, by name."""
    names = [name for name in known if not name.endswith(tuple(f" {axis}" for axis in AXES))]

    def meaning(name: str) -> tuple[columns.Key, str] | None:
        if name == "time":
            return ("time", ""), "s"
        return (("curve", name), known[name][2]) if name in known else None

    choices = f"'time [s]', and {few(names)}; of vectors also with ' x', ' y', ' z'"
    numbers, _ = columns.read(path, "measurement", meaning, choices)
    times = numbers.pop(("time", ""), None)
    if times is None:
        raise JointplayError(f"{path}: there is no column 'time [s]'")
    for (_, name), column in [(("", "time"), times), *numbers.items()]:
        if not np.isfinite(column).all():
            at = int(np.flatnonzero(~np.isfinite(column))[0]) + 1
            raise JointplayError(f"{path}: {name!r} has no number in row {at}; leave such rows out")
    if not numbers:
        raise JointplayError(f"{path}: there is no column beside the time; there may be {choices}")
    if (np.diff(times) <= 0.0).any():
        at = int(np.flatnonzero(np.diff(times) <= 0.0)[0]) + 1
        raise JointplayError(f"{path}: times must increase; number {at + 1} is {times[at]:g} s")
    return times, {name: column for (_, name), column in numbers.items()}


def _misfit(
    known: dict[str, Curve], times: np.ndarray, measured: dict[str, np.ndarray], shift: float
) -> float:
    """Sum over the columns of the mean square difference, relative to the column's variance.

    Infinite where less than half of the times lie within the run.
    """
    total = 0.0
    for name, column in measured.items():
        own_times, values, _ = known[name]
        at = times + shift
        within = (at >= own_times[0]) & (at <= own_times[-1])
        if 2 * np.count_nonzero(within) < len(times):
            return math.inf
        apart = np.interp(at[within], own_times, values) - column[within]
        if np.ptp(column) > 0.0:  # what stays the same tells no time
            total += float(np.mean(apart**2) / np.var(column))
    return total


def _best_shift(misfit: Callable[[float], float], reach: float) -> float:
    """Shift up to `reach` with the least misfit: the best of many, refined [s]."""
    from scipy.optimize import minimize_scalar  # slow to import

    tried = np.linspace(-reach, reach, _SHIFTS)
    sizes = [misfit(shift) for shift in tried]
    if not np.isfinite(sizes).any():
        return 0.0
    best, step = float(tried[int(np.argmin(sizes))]), float(tried[1] - tried[0])
    refined = minimize_scalar(misfit, bounds=(best - step, best + step), method="bounded")
    return float(refined.x) if refined.fun < misfit(best) else best


def _hint(misfit: Callable[[float], float], shift: float, best: float) -> str:
    """Text that another shift would halve the difference, as if the measurement had its own clock.

    Empty if none would.
    """
    now, then = misfit(shift), misfit(best)
    if not math.sqrt(then) < 0.5 * math.sqrt(now):
        return ""
    return (
        f"shifted by {readable(best, 's', 4)} the measurement would fit with "
        f"{100.0 * math.sqrt(then / now):.2g} % of the difference (--shift found)"
    )


def _at_times(result: Result, names: Sequence[str], at: np.ndarray) -> dict[str, np.ndarray]:
    """Some curves of a run at given times, by name."""
    known = curves(result)
    return {name: np.interp(at, *known[name][:2]) for name in names}
