"""Restitution: by flights where a journal bounces freely, by simulated impacts elsewhere."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import median_filter
from scipy.signal import find_peaks
from scipy.stats import bootstrap, qmc
from scipy.stats import t as student

from jointplay.base.errors import JointplayError
from jointplay.base.progress import ProgressBar
from jointplay.estimate.least_squares import CONFIDENCE, LeastSquares, minimum
from jointplay.estimate.machine import delivered, drawn, nominal_of
from jointplay.estimate.measurement import Measurement
from jointplay.estimate.unknowns import NORMAL, Estimate, Unknown
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import Clearance
from jointplay.simulation.result.result import Result
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study, run_to_the_end

# An accelerometer shows an impact as a spike of few records, a force between bearing and journal
# as a pulse out of nothing. Neither needs to be calibrated: only times and ratios count.


IMPACT_KINDS = ("acceleration", "reaction")
_ABOVE = 10.0
"""Standard deviations of the records above which there is an impact."""
_PART = 0.005
"""Part of the largest impact's that an impact must reach."""
WINDOW = 31
"""Records whose median a spike stands out of."""
_APART = 3
"""Records between two impacts."""
_REACH = 2
"""Records to either side that belong to an impact."""
_STRETCH, _CALM = 64, 0.35
"""Records of a stretch, and the part of them that is calm for sure."""
_LOW = 0.945
"""That quantile of the medians of stretches of pure noise, relative to their mean."""
_DROWNED = 5.0
"""Standard deviations of the records below which the statistics see nothing."""
_NORMAL = 0.6745
"""Median of |x| for normal x of standard deviation one."""
BINS = 5
"""Parts of a measurement whose activity is stated each by itself."""


def unknown(joint: str) -> Unknown:
    """The restitution of a joint's impacts, whatever law and coefficient make it."""
    return Unknown(joint, "restitution", nominal=math.nan, most=1.0)


@dataclass(frozen=True)
class Channel:
    """A signal in which impacts show."""

    joint: str
    """Whose impacts; empty for an accelerometer, which feels all."""
    time: np.ndarray
    """Shape (n,) [s]."""
    size: np.ndarray
    """By how much records stand out, shape (n,) [m/s^2 or N]."""
    noise: float
    """Standard deviation of `size` where nothing hits."""

    @property
    def interval(self) -> float:
        return float(np.median(np.diff(self.time)))


def channels(measured: Measurement) -> tuple[Channel, ...]:
    """The accelerometer as one channel, and each force between bearing and journal.

    What has too few records is left out.
    """
    axes, made = measured.has("acceleration"), []
    groups = [("", "acceleration", axes)] if axes else []
    groups += [(joint, "reaction", [joint]) for joint in measured.has("reaction")]
    for joint, kind, names in groups:
        table = np.column_stack([measured.signals[kind, name] for name in names])
        good = np.isfinite(table).all(axis=1)
        time, table = measured.time[good], table[good]
        if len(time) <= WINDOW:
            continue
        given = measured.noise.get(kind)
        noise = record_noise(table) if given is None else given
        if kind == "acceleration":
            table = table - median_filter(table, size=(WINDOW, 1), mode="nearest")
        size = np.linalg.norm(table, axis=1)
        least = 1e-9 * float(size.max(initial=1.0))
        made.append(Channel(joint, time, size, max(float(noise), least)))
    return tuple(made)


def record_noise(table: np.ndarray) -> float:
    """Standard deviation of a record of signals (n, axes), by their calmest stretches.

    Third differences take out what changes smoothly; impacts and ringing are elsewhere.
    """
    bends = np.abs(np.diff(table, 3, axis=0)) / np.sqrt(20.0)
    if len(bends) < _STRETCH:
        return float(np.median(bends, axis=0).max(initial=0.0) / _NORMAL) if len(bends) else 0.0
    count = len(bends) // _STRETCH
    medians = np.median(bends[: count * _STRETCH].reshape(count, _STRETCH, -1), axis=1)
    return float(np.quantile(medians, _CALM, axis=0).max() / _NORMAL / _LOW)


def impacts(channel: Channel) -> tuple[np.ndarray, np.ndarray]:
    """Times of n impacts [s], in order, and sums over the records of each, shape (n,) each."""
    size = channel.size
    limit = max(_ABOVE * channel.noise, _PART * float(size.max(initial=0.0)))
    framed = np.concatenate([[0.0], size, [0.0]])
    at, _ = find_peaks(framed, height=limit, prominence=limit, distance=_APART)
    near = [slice(max(i - 1 - _REACH, 0), i + _REACH) for i in at]
    times = [np.average(channel.time[one], weights=size[one]) for one in near]
    return np.array(times), np.array([size[one].sum() for one in near])


def summary(channel: Channel) -> dict[str, float]:
    """Statistics of a measurement's impacts, by name; nan where there are too few.

    How strong the activity is (RMS and quantiles of the records, whole and in parts of the time),
    how many impacts, how far apart, and how the intervals between them shrink. Logarithms, so that
    their scatter is about normal.
    """
    size = np.hypot(channel.size, _DROWNED * channel.noise)

    def log_rms(part: np.ndarray) -> float:
        return float(0.5 * np.log(np.mean(part**2)))

    numbers = {"RMS": log_rms(size)}
    for share in (50, 90, 99):
        numbers[f"{share} % quantile"] = float(np.log(np.percentile(size, share)))
    for number, part in enumerate(np.array_split(size, BINS), 1):
        numbers[f"RMS in part {number} of {BINS}"] = log_rms(part)
    times, _ = impacts(channel)
    numbers["number of impacts"] = float(np.log1p(len(times)))
    gaps = np.diff(times)
    numbers["intervals, mean"] = float(np.log(gaps).mean()) if len(gaps) else np.nan
    numbers["intervals, spread"] = float(np.log(gaps).std()) if len(gaps) > 1 else np.nan
    ratios = gaps[1:] / gaps[:-1]
    shrinking = ratios[ratios < 1.0]
    numbers["ratio of intervals"] = float(np.log(shrinking).mean()) if len(shrinking) else np.nan
    return numbers


# Restitution from flights: those of a bouncing journal grow shorter by it.
#
# Under a constant load the flight after an impact that leaves with the speed v lasts 2 v / a, and
# the next begins with e v: the intervals between impacts are a geometric series with the ratio e,
# whatever mass and load are (A. D. Bernstein, American Journal of Physics 45 (1977) 41-44, for
# balls), and so are the impacts' impulses. Where both do not agree the load was not constant, or
# several places hit in turn, and nothing is stated.


FEWEST_RATIOS = 4
"""Ratios of successive flights from which on restitution is stated."""
SHORTEST = 6.0
"""Records that a flight must last."""
_STEADY = 0.15
"""Largest change of the ratio from flight to flight within a sequence."""
_GROWN = 1.3
"""Times the impulse before that one of the same sequence has at most, for noise."""
_LEAST_FLIGHTS = 3
_SCATTER = 0.2
"""Largest standard deviation of the ratios' logarithms."""
_LEAST_SHARE = 0.5
"""Part of the impacts that must belong to sequences that die away steadily."""
_AGREE = 0.1
"""By how much the ratio of impulses may differ from that of flights, besides their scatter."""
_MODEL = 0.02
"""Part of the value by which the load of flights in a machine is not constant."""
_RESAMPLES = 999


def flights(channel: Channel) -> Estimate:
    """Restitution of a joint by its impacts in a channel."""
    times, impulses = impacts(channel)

    def dark(reason: str) -> Estimate:
        return Estimate(unknown(channel.joint), reason=reason)

    if not len(times):
        return dark(
            f"no impact exceeds the noise ({channel.noise:.2g} a record); let the load reverse "
            "suddenly, or use a quieter sensor"
        )
    bounces = sequences(times, impulses, channel.interval)
    ratios = [np.log(gaps[1:] / gaps[:-1]) for gaps, _ in bounces]
    number = sum(map(len, ratios))
    if number < FEWEST_RATIOS:
        return dark(_too_few(times, number, 1.0 / channel.interval))
    inside = sum(len(own) for _, own in bounces)
    turns = "several places hit in turn, or the load changes; --runs compares with simulations"
    if inside < _LEAST_SHARE * len(times):
        return dark(
            f"only {inside} of {len(times)} impacts are bounces that die away steadily: {turns}"
        )
    scatter = float(np.concatenate(ratios).std(ddof=1))
    if scatter > _SCATTER:
        return dark(f"ratios of successive flights scatter by {100 * scatter:.0f} %: {turns}")
    middle, half = _mean(ratios)
    half = float(np.hypot(half, _timing([gaps for gaps, _ in bounces], channel.interval)))
    impulse, other = _mean([np.log(own[1:] / own[:-1]) for _, own in bounces])
    value = float(np.exp(middle))
    if abs(impulse - middle) > np.hypot(half, other) + np.log1p(_AGREE):
        return dark(
            f"flights grow shorter by {value:.3g}, impulses smaller by {np.exp(impulse):.3g}: the "
            "load is not constant while the journal flies; --runs compares with simulations"
        )
    if value >= 1.0:
        return dark("impacts do not die away")
    half = value * float(np.hypot(half, _MODEL))
    return Estimate(unknown(channel.joint), value, half, note=f"{number} ratios of flights")


def _too_few(times: np.ndarray, number: int, rate: float) -> str:
    """What would give more ratios, at a rate of records [Hz]."""
    gaps = np.diff(times)
    words = f"{len(times)} impacts give {number} ratios of successive flights, {FEWEST_RATIOS} are "
    words += "needed; "
    if len(gaps) and np.median(gaps) * rate < 2.0 * SHORTEST:
        faster = 4.0 * SHORTEST / float(np.median(gaps))
        return words + f"at {rate:.4g} records a second flights are not resolved: {faster:.2g} may"
    return words + "let the load reverse more often"


def _mean(groups: list[np.ndarray]) -> tuple[float, float]:
    """Mean of logarithms by sequence, and half of its 95 % interval.

    The wider of Student's over all and the bootstrap (BCa) over sequences: flights of one sequence
    share impacts.
    """
    every = np.concatenate(groups)
    middle = float(every.mean())
    error = float(every.std(ddof=1)) / np.sqrt(len(every))
    half = error * float(student.ppf(0.5 + CONFIDENCE / 2.0, len(every) - 1))
    sums = np.array([group.sum() for group in groups])
    counts = np.array([float(len(group)) for group in groups])
    if len(groups) >= FEWEST_RATIOS and np.ptp(sums / counts) > 0.0:
        interval = bootstrap(
            (sums, counts),
            lambda total, number, axis=-1: total.sum(axis=axis) / number.sum(axis=axis),
            paired=True,
            n_resamples=_RESAMPLES,
            confidence_level=CONFIDENCE,
            rng=np.random.default_rng(0),
        ).confidence_interval
        ends = np.array([interval.low, interval.high])
        if np.isfinite(ends).all():
            half = max(half, float(np.abs(ends - middle).max()))
    return middle, half


def _timing(flights: list[np.ndarray], interval: float) -> float:
    """Half of the 95 % interval of the mean logarithm by the times' own error.

    Impacts are timed to an interval's uniform share; of a sequence only its ends count.
    """
    error = interval / np.sqrt(12.0)
    steps = sum(len(gaps) - 1 for gaps in flights)
    square = sum((error / gaps[0]) ** 2 + (error / gaps[-1]) ** 2 for gaps in flights)
    return float(NORMAL * np.sqrt(2.0 * square) / steps)


def sequences(
    times: np.ndarray, impulses: np.ndarray, interval: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Sequences of impacts that die away steadily, `interval` [s] being between records.

    Returns:
        Of each the n intervals between its impacts [s], and their n + 1 impulses.
    """
    gaps, made, first = np.diff(times), [], 0
    while first < len(gaps):
        last = first + 1
        while last < len(gaps) and _goes_on(
            gaps[first : last + 1], impulses[first : last + 2], interval
        ):
            last += 1
        if last - first >= _LEAST_FLIGHTS:
            made.append((gaps[first:last], impulses[first : last + 1]))
            first = last
        else:
            first += 1
    return made


def _goes_on(gaps: np.ndarray, impulses: np.ndarray, interval: float) -> bool:
    """Whether the last of the intervals (at least two) goes on as those before."""
    if gaps[-1] < SHORTEST * interval or not gaps[-1] < gaps[-2]:
        return False
    if (impulses[1:] > _GROWN * impulses[:-1]).any():
        return False  # a new drop
    return len(gaps) < 3 or bool(abs(gaps[-1] / gaps[-2] - gaps[-2] / gaps[-3]) <= _STEADY)


# The instruments that felt impacts, to look at simulated runs as they looked at the machine.


_FINER = 2.0
"""Records of a run for each of the measurement."""


class Instruments:
    """What showed the impacts of a measurement: how often, how well, in which signals.

    Raises:
        JointplayError: the measurement has no signal that shows impacts.
    """

    def __init__(self, measured: Measurement) -> None:
        felt = channels(measured)
        if not felt:
            words = "acceleration x (y, z) or JOINT reaction is needed to see impacts"
            raise JointplayError(f"{measured.source}: {words}")
        self.noise: dict[str, float] = {}
        for one in felt:
            kind = "reaction" if one.joint else "acceleration"
            self.noise[kind] = max(one.noise, self.noise.get(kind, 0.0))
        self.begin, self.end = float(measured.time[0]), float(measured.time[-1])
        self.rate = 1.0 / float(np.median(np.diff(measured.time)))
        keys = [("acceleration", axis) for axis in measured.has("acceleration")]
        self.keys = {*keys, *(("reaction", one.joint) for one in felt if one.joint)}

    def settings(self, simulation: Simulation) -> Simulation:
        """The simulation, as long as the measurement and recorded as finely.

        Raises:
            JointplayError: it has neither motion nor duration.
        """
        if simulation.motion is None and simulation.duration is None:
            raise JointplayError("the scenario needs the motion that was measured, or a duration")
        every = max(int(1.0 / (_FINER * self.rate * simulation.step)), 1)
        return replace(simulation, duration=self.end, record_every=every)

    def look(self, result: Result) -> dict[str, float]:
        """Statistics of a run, with noise of the instruments' own."""
        recorded = Measurement.from_result(
            result, rate=self.rate, noise=self.noise, kinds=tuple(self.noise),
            seed=result.simulation.seed or 0, delay=self.begin,
        )  # fmt: skip
        signals = {key: values for key, values in recorded.signals.items() if key in self.keys}
        return self.statistics(replace(recorded, signals=signals))

    def statistics(self, measured: Measurement) -> dict[str, float]:
        """Statistics of all channels, by name."""
        recorded = replace(measured, noise={**measured.noise, **self.noise})
        return {
            f"{name} of {one.joint + ' reaction' if one.joint else 'the acceleration'}": value
            for one in channels(recorded)
            for name, value in summary(one).items()
        }

    def statistics_of_run(self, simulation: Simulation) -> dict[str, float]:
        """Statistics of a simulation's run."""
        return self.look(run_to_the_end(simulation, RUN))


RUN = "a run to compare with the measurement"
"""For messages about one that fails."""


# Values of which simulations have the same statistics as a measurement.
#
# Runs of a machine with impacts part after a few of them, so that their traces cannot be
# compared; their statistics can. S. N. Wood, Statistical inference for noisy nonlinear ecological
# dynamic systems, Nature 466 (2010) 1102-1104: statistics s of runs with the values theta are
# taken as normal about a mean mu(theta), here a quadratic, with one covariance; theta is where
# the measured ones are most likely. How well that works is tried on the runs themselves, each in
# turn left out and played the measurement: the errors make the interval.


_SHRINK = 0.1
"""Part of the covariance that is taken as diagonal, at least; more with few runs."""
_STRANGE = 2.0
"""Times the runs' own largest distance from which on a measurement is like none of them."""
_LEAST_SPREAD = 0.02
"""Scatter below which statistics (logarithms) are not taken to be known."""


class LikelihoodEstimate(NamedTuple):
    """p values by statistics of runs."""

    value: np.ndarray
    half_width: np.ndarray
    """Of the 95 % intervals, shape (p,)."""
    strange: bool
    oddest: int
    """The statistic that is farthest off."""


def by_likelihood(
    values: np.ndarray,
    statistics: np.ndarray,
    measured: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> LikelihoodEstimate:
    """The values between `low` and `high` (p,) whose runs have the measured statistics (d,).

    By n runs with values (n, p) and finite statistics (n, d).
    """
    limits = low, high
    best, distance, odd = _likeliest(values, statistics, measured, limits)
    errors, distances = np.zeros(values.shape), np.zeros(len(values))
    for i in range(len(values)):
        others = np.arange(len(values)) != i
        rest = values[others], statistics[others]
        found, distances[i], _ = _likeliest(*rest, statistics[i], limits)
        errors[i] = found - values[i]
    away = np.linalg.norm((values - best) / np.maximum(high - low, 1e-12), axis=1)
    near = np.argsort(away)[: max(len(values) // 2, 1)]
    spread = np.sqrt(np.maximum(np.mean(errors**2, axis=0), np.mean(errors[near] ** 2, axis=0)))
    freedom = max(len(values) - _terms(values.shape[1]), 1)
    half = spread * float(student.ppf(0.5 + CONFIDENCE / 2.0, freedom))
    strange = distance > _STRANGE * max(float(distances.max()), 1.0)
    return LikelihoodEstimate(best, half, strange, odd)


def design(count: int, low: np.ndarray, high: np.ndarray, seed: int) -> np.ndarray:
    """Values for so many runs, spread evenly, shape (count, p)."""
    spread = qmc.LatinHypercube(len(low), rng=seed).random(count)
    return np.asarray(low + spread * (high - low))


def _terms(p: int) -> int:
    return 1 + p + p * (p + 1) // 2


def _basis(values: np.ndarray, centre: np.ndarray, width: np.ndarray) -> np.ndarray:
    """Terms of the quadratic, shape (n, terms)."""
    x = (values - centre) / width
    columns = [np.ones(len(x)), *x.T]
    columns += [x[:, i] * x[:, k] for i in range(x.shape[1]) for k in range(i + 1)]
    return np.column_stack(columns)


def _likeliest(
    values: np.ndarray,
    statistics: np.ndarray,
    measured: np.ndarray,
    limits: tuple[np.ndarray, np.ndarray],
) -> tuple[np.ndarray, float, int]:
    """The best values, their distance (mean square by statistic), the statistic farthest off."""
    centre, width = values.mean(axis=0), np.maximum(np.ptp(values, axis=0), 1e-12)
    terms = _basis(values, centre, width)
    slopes, *_ = np.linalg.lstsq(terms, statistics, rcond=None)
    left = statistics - terms @ slopes
    freedom = max(len(values) - terms.shape[1], 1)
    spread = np.maximum(np.sqrt(np.square(left).sum(axis=0) / freedom), _LEAST_SPREAD)
    correlation = (left / spread).T @ (left / spread) / freedom
    shrink = max(_SHRINK, statistics.shape[1] / (statistics.shape[1] + freedom))
    correlation = (1.0 - shrink) * correlation + shrink * np.eye(len(spread))
    # Statistics that are independent of each other, each with an error of one.
    root = np.linalg.cholesky(np.linalg.inv(correlation)).T / spread
    unknowns = tuple(
        Unknown("", "restitution", scale=high - low, least=low, most=high)
        for low, high in zip(*limits, strict=True)
    )

    def predicted(theta: np.ndarray) -> np.ndarray:
        return np.asarray(root @ (_basis(theta[None], centre, width) @ slopes)[0])

    problem = LeastSquares(unknowns, predicted, root @ measured, np.ones(len(root)))
    inside = np.clip(values, *limits)
    best = minimum(problem, min(inside, key=problem.cost))
    off = (measured - (_basis(best[None], centre, width) @ slopes)[0]) / spread
    return best, problem.cost(best) / len(measured), int(np.abs(off).argmax())


# In a machine impacts rarely die away as a ball's do: rims strike in turn, drives answer, loads
# turn. So runs of the scenario with different restitutions are compared with the measurement by
# the statistics of their impacts (below), never by their traces.


RUNS = 40
"""Runs by which restitutions are sought by default."""
LOW, HIGH = 0.05, 0.98
"""Restitutions between which is sought."""
_WIDEST = 0.15
"""Largest half width of an interval with which a restitution is identified."""
_FEWEST_IMPACTS = 3
GRAVITY = 9.81
"""Acceleration at which a journal is taken to fall [m/s^2]."""
_WIDER = 1.5
"""By which the second half of the runs covers more than the interval of the first."""


def by_flights(mechanism: Mechanism, measured: Measurement) -> tuple[Estimate, ...]:
    """Restitution of each joint with clearance by flights.

    A force between bearing and journal counts for its joint. An accelerometer cannot tell whose
    impact it feels: it counts where one joint only has clearance.
    """
    felt = {one.joint: one for one in channels(measured)}
    names = list(mechanism.clearance)
    found = []
    for name, joint in mechanism.clearance.items():
        channel = felt.get(name) or (felt.get("") if len(names) == 1 else None)
        if channel is not None:
            one = replace(flights(channel), unknown=unknown(name))
            found.append(_with_coefficient(one, joint))
            continue
        if felt:
            reason = f"an impact may belong to any of {', '.join(names)}: measure '{name} reaction'"
            reason += ", give the others no clearance, or compare with simulations (--runs)"
        elif any(measured.has(kind) for kind in IMPACT_KINDS):
            reason = f"{len(measured.time)} records are too few to see an impact; {WINDOW} at "
            reason += "least, many for each flight, are needed"
        else:
            reason = _without_signal(name, joint)
        found.append(Estimate(unknown(name), reason=reason))
    return tuple(found)


def _with_coefficient(one: Estimate, joint: Clearance) -> Estimate:
    """The estimate, with the coefficient by which the joint's law delivers it in the note."""
    if one.reason:
        return one
    nominal, words = nominal_of(joint, one.value), ""
    if np.isnan(nominal):
        words = "; the joint's law cannot produce it"
    elif abs(nominal - one.value) >= 5e-3:
        words = f"; c_e {nominal:.3g}"
    return replace(one, note=one.note + words)


def _without_signal(name: str, joint: Clearance) -> str:
    """Which signal would show a joint's impacts, and how fast."""
    room = 2.0 * max(joint.clearances.values(), default=0.0)
    words = f"no signal shows impacts; an accelerometer on the tool or '{name} reaction' would"
    if room <= 0.0:
        return words
    # A journal that falls through its room and bounces three times at half its speed.
    flight = 2.0 * math.sqrt(2.0 * room / GRAVITY) * 0.5**3
    return f"{words}, with {SHORTEST / flight:.2g} records a second or more"


def by_simulation(
    simulation: Simulation,
    measured: Measurement,
    known: Sequence[Estimate] = (),
    *,
    runs: int = RUNS,
    jobs: int | None = None,
    seed: int = 0,
    progress: bool = False,
) -> tuple[Estimate, ...]:
    """Restitution of each joint with clearance by the statistics of simulated impacts.

    Args:
        simulation: of the motion and the loads that were measured, times alike, with the
            clearances and friction that are known.
        measured: an accelerometer's or forces' records.
        known: what was found of clearances and friction; each run has others within it.
        runs: half over all restitutions, half about what these say.
        jobs: processes; None takes one for each core.
        seed: of the runs' values and starts.
        progress: show a bar.

    Raises:
        JointplayError: too few runs; no signal that shows impacts; no motion; a run that fails.
    """
    joints = simulation.mechanism.clearance
    least = 2 * (2 * _terms(len(joints)) + 4)
    if runs < least:
        raise JointplayError(f"at least {least} runs are needed for {len(joints)} joints: {runs}")
    instruments = Instruments(measured)
    own, random = instruments.settings(simulation), np.random.default_rng(seed)
    statistics = instruments.statistics(measured)
    seen = np.array(list(statistics.values()))
    hits = max(len(impacts(one)[0]) for one in channels(measured))
    if hits < _FEWEST_IMPACTS:
        reason = f"{hits} impacts exceed the noise; let loads reverse suddenly, or use a "
        reason += "quieter or faster sensor"
        return tuple(Estimate(unknown(name), reason=reason) for name in joints)

    def made(row: np.ndarray, number: int) -> Simulation:
        bouncing = {}
        for (name, joint), value in zip(joints.items(), row.tolist(), strict=True):
            nominal = nominal_of(joint, value)
            bouncing[name] = joint.with_restitution(value if np.isnan(nominal) else nominal)
        mechanism = drawn(own.mechanism.with_clearance(bouncing), known, random)
        return replace(own, mechanism=mechanism, seed=number)

    def fit(
        values: np.ndarray, table: np.ndarray, low: np.ndarray, high: np.ndarray
    ) -> tuple[LikelihoodEstimate | None, str]:
        """The estimate, None if no statistic is usable; name of that which is farthest off."""
        with np.errstate(invalid="ignore"):
            use = np.isfinite(seen) & np.isfinite(table).all(axis=0)
            use &= np.ptp(table, axis=0) > 1e-9
        if not use.any():
            return None, ""
        found = by_likelihood(values, table[:, use], seen[use], low, high)
        return found, list(statistics)[np.flatnonzero(use)[found.oddest]]

    def simulated(values: np.ndarray, first: int) -> np.ndarray:
        todo = [made(row, number) for number, row in enumerate(values, first)]
        rows = Study(todo, instruments.statistics_of_run).run(jobs, bar)
        return np.array([[row[name] for name in statistics] for row in rows])

    low, high = (np.array([delivered(o, end) for o in joints.values()]) for end in (LOW, HIGH))
    with ProgressBar(total=runs, desc="restitution", disable=not progress, unit="run") as bar:
        values = design(runs // 2, low, high, seed)
        table = simulated(values, seed + 1)
        first, _ = fit(values, table, low, high)
        begin, end = low, high
        if first is not None:
            begin = np.maximum(low, first.value - _WIDER * first.half_width)
            end = np.minimum(high, first.value + _WIDER * first.half_width)
        more = design(runs - len(values), begin, end, seed + 1)
        table = np.vstack([table, simulated(more, seed + 1 + len(values))])
        values = np.vstack([values, more])
    near = ((values >= begin) & (values <= end)).all(axis=1)
    found, oddest = fit(values[near], table[near], begin, end)

    def told(i: int, name: str, joint: Clearance) -> Estimate:
        dark = Estimate(unknown(name))
        if found is None:
            return replace(dark, reason="no statistic of the impacts exists in every run")
        if found.strange:
            reason = f"its impacts do not match any simulated machine ({oddest} is farthest "
            reason += "off); does the scenario's motion, load, clearance or noise differ?"
            return replace(dark, reason=reason)
        value, half = float(found.value[i]), float(found.half_width[i])
        if half > _WIDEST:
            reason = f"its 95 % interval would be {value:.2g} +- {half:.2g}: impacts of runs with "
            reason += "other restitutions look the same; more drops, or a faster or quieter sensor "
            return replace(dark, reason=reason + "may tell")
        evidence = f"impacts of {int(near.sum())} runs"
        sizes = [one for one in known if one.joint == name and one.identified]
        if not any(one.unknown.name.endswith("clearance") for one in sizes):
            evidence += ", clearance as in the scenario"
        if value - half < low[i] or value + half > high[i]:
            evidence += f", sought from {low[i]:.3g} to {high[i]:.3g}"
        return _with_coefficient(Estimate(unknown(name), value, half, note=evidence), joint)

    return tuple(told(i, name, joint) for i, (name, joint) in enumerate(joints.items()))
