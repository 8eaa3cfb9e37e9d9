"""Every headline figure of a run with its numerical error, found by running again otherwise.

`estimate_errors`, after every run, runs twice more with steps that go by their own error (equal
steps, where contacts have bristles), `certify` three times. docs/certificates.md says how, and how
often the stated errors cover the true ones.
"""

from __future__ import annotations

import json
import math
import warnings
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import signals
from jointplay.base.errors import JointplayError, require_a
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.integrators import DEFAULT
from jointplay.simulation import analysis, spool
from jointplay.simulation.analysis.claims import measure
from jointplay.simulation.analysis.tool_error import Reference
from jointplay.simulation.analysis.twins import COMPARED, hinges
from jointplay.simulation.result import netcdf
from jointplay.simulation.result.certificate import COUNTS, HEADLINE, Certificate, CertifiedFigure
from jointplay.simulation.result.histories import HistoryBuilder
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.settings import START_UP
from jointplay.simulation.result.thinning import SUMMARY_RECORDS
from jointplay.simulation.result.variables import LOSSES, Records
from jointplay.simulation.run import Run
from jointplay.simulation.saving import save
from jointplay.simulation.simulation import Simulation

if TYPE_CHECKING:
    import xarray as xr

SAFETY = 2.5
"""What differences between runs are multiplied by to make an error of them.

Four draws of a chaotic figure, and a fifth that is the truth: it lies within so many times their
range of the first in 95 to 98 of 100 cases, for normal and for skew distributions.
"""

CONTRACTS = 0.5
"""Finer runs agree if they differ by no more than this part of what they have moved."""

SENSITIVE = 5e-3
"""A figure in which further runs differ by more than this part of it is called sensitive."""

STRETCHES = 8
"""Stretches of a run, of equal length, that are compared one by one.

Two runs of a chaotic motion can have the same largest force, or the same loss, by chance; not in
all stretches.
"""

SUBSETS = 4
"""Subsets of the records, each of every fourth, whose root mean squares are compared."""

TOLERANCES = (1e-3, 6e-4, 2.5e-4)
"""Tolerances of the further runs, where the run has none itself; an estimate leaves the second out.

Two, because in one of thirty cases drawn at random one further run agrees with the run by chance.
"""

RELATIVE = (4.0, 0.6, 0.25)
"""The same relative to the run's own."""

FINER = (3, 5, 10)
"""How much smaller equal steps of the further runs are where contacts have bristles.

Bristles that begin to stick are followed in first order and less, whatever chooses the steps: a
tolerance leaves a run the error that equal steps have. Steps so far apart show how it falls.
"""

AT_ONCE = 16 * netcdf.CHUNK
"""Records of a long run that are in memory at once."""

ASIDE_M = ((0.0, 0.0, 0.0), (-1e-7, 1e-7, -1e-7), (1e-7, -1e-7, 1e-7))
"""How far aside journals start in these runs.

A nanometre would not show every chaos: stick-slip hangs on switches that it need not reach, and
that one step reaches and another does not.
"""

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


def estimate_errors(source: Simulation | Result, **options: Any) -> Certificate:
    """Estimate the numerical error of every headline figure from two further runs.

    Their steps go by their own error: see `TOLERANCES`, `ASIDE_M`. `options` and errors are those
    of `certify`.
    """
    return certify(source, strict=False, **options)


def certify(
    source: Simulation | Result,
    *,
    progress: bool = False,
    simulation: Simulation | None = None,
    name: str = "",
    claims: bool = False,
    strict: bool = True,
) -> Certificate:
    """State the numerical error of every headline figure more strictly, from three further runs.

    They are those of `estimate_errors`, and one with journals displaced the other way.

    Args:
        source: what is certified; a simulation is run first.
        progress: show a bar that names what runs.
        simulation: what made the result; built from the result if not given.
        name: of the run, which the bar shows.
        claims: certify what the paper's claims use, too, of a run of more than 0.3 s with one joint
            with clearance.
        strict: without, as `estimate_errors` does.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        JointplayError: the simulation cannot be run.
    """
    require_a("source", source, "Simulation", "Result")
    if isinstance(source, Simulation):
        simulation, result = source, source.run(progress, estimate=False)
    else:
        simulation, result = simulation or source.simulation, source
    if result.status != Status.COMPLETED:
        note = f"none, for the run did not complete ({result.message})"
        return Certificate((), note=note, strict=strict)
    plans = further_simulations(simulation, result, strict)
    # The run's own: what the ideal mechanism's run is off, too, the run shares with it.
    ideal, unknown = _ideal(simulation, result, progress)
    with_claims = claims and _fits(result)
    measured, notes = [_measure(result, ideal, with_claims)], []
    what = f"{'certifying' if strict else 'estimating'} errors{name and f' of {name}'}"
    for number, (other, aside, macro) in enumerate(reversed(plans), 1):
        label = f"{what}, {number} of {len(plans)} ({_words(other)}) "
        figures = _Headline(result.time, result.judge_from, ideal, hinges(result))
        try:
            run = _completed(other, label, progress, aside, macro, figures)
        except JointplayError as why:
            notes.append(f"with {_words(other)}, {why}")
            continue
        found = figures.finish(run)
        if with_claims:
            found |= _of_claims(run.result(Status.COMPLETED), ideal)
        measured.append(found)
    certified, sensitive = [], []
    slow = _approaches_slowly(simulation)
    for name, one in measured[0].items():
        others = [of[name] for of in measured[1:] if name in of]
        # Where a further run failed, nobody knows.
        error = math.inf if notes else max(numerical_error(one, others), one.sampling)
        if name in COUNTS and math.isfinite(error) and one.value:
            # That runs agree says nothing of a contact that barely touches, or barely not.
            error = max(math.ceil(error), 1)
        elif name.startswith(HEADLINE) and not notes and is_sensitive(one, others, slow):
            sensitive.append(name)
        certified.append(CertifiedFigure(name, one.value, float(error), one.unit))
    if sensitive:
        notes.append(
            "the motion is sensitive: the further runs, which start up to 100 nm aside, differ "
            f"among each other in {', '.join(sensitive)}; the errors cover what was found, and "
            "one run is one draw"
        )
    notes += [unknown] if unknown else []
    if claims and not with_claims:
        notes.append(
            "the measures of the paper's claims are left out: they need all histories at once, "
            f"which take more than {spool.MOST_BYTES >> 20} MB; record less often"
        )
    runs = tuple(_words(other, aside) for other, aside, _ in plans)
    return Certificate(tuple(certified), runs, "; ".join(notes), strict)


def further_runs(simulation: Simulation, strict: bool = True) -> int:
    """How many runs `certify` or `estimate_errors` makes, that of the ideal mechanism included."""
    mechanism = simulation.mechanism
    return len(TOLERANCES) - (not strict) + bool(mechanism.clearance or mechanism.gears)


def scatter(runs: Sequence[Measured]) -> float:
    """How far apart a figure's values in several runs are, in all or stretch by stretch.

    The differences of stretches count as independent: those of sums by the root of their squares;
    those of largest values by how small the largest could be, had it been each stretch's least.
    """
    values = [one.value for one in runs]
    apart = float(np.ptp(values)) if np.isfinite(values).all() else math.inf
    if not math.isfinite(apart) or not runs[0].parts.size:
        return apart
    parts = np.array([one.parts for one in runs])
    power = runs[0].power
    if math.isinf(power):
        return max(apart, max(values) - float(parts.min(axis=0).max()))
    together = float(np.linalg.norm(np.ptp(parts, axis=0)))
    if power > 1.0:
        together /= power * max(max(values), 1e-300) ** (power - 1.0)
    return max(apart, together)


def numerical_error(one: Measured, others: Sequence[Measured]) -> float:
    """Error of a figure, given what the further runs made of it, the finest first."""
    moved = abs(one.value - others[0].value)
    uncertain = scatter(others)
    if not math.isfinite(moved + uncertain):
        return math.inf
    if uncertain > CONTRACTS * moved:
        return SAFETY * scatter([one, *others])
    # Further runs may agree by chance: no error is known to better than a tenth of itself.
    return max(moved + SAFETY * uncertain, 1.1 * moved)


def is_sensitive(one: Measured, others: Sequence[Measured], slow: bool = False) -> bool:
    """Whether the further runs differ more than the run does from them, and noticeably.

    Not where they get on slowly in one direction (`slow`), each with a smaller step.
    """
    changes = np.diff([one.value, *(of.value for of in reversed(others))])
    if slow and ((changes >= 0.0).all() or (changes <= 0.0).all()):
        return False
    uncertain = scatter(others)
    moved = abs(one.value - others[0].value)
    return uncertain > max(CONTRACTS * moved, SENSITIVE * abs(one.value))


def further_simulations(
    simulation: Simulation, result: Result, strict: bool
) -> list[tuple[Simulation, tuple[float, float, float], float]]:
    """The further runs: how, how far aside, and how much shorter macro steps are.

    By the multi-rate method, for as long as the run lasted; the last is the finest. With a
    tolerance, or with smaller equal steps where that approaches the truth slowly.
    """
    lasted = float(result.time[-1])  # whose last digits must not shift when judging begins
    base = replace(
        simulation,
        integrator=DEFAULT,
        duration=lasted,
        settle=None,
        judge_from=result.audit.judged_from,
    )
    if _approaches_slowly(simulation):
        macros = [1.0, 1.0, 2.0]
        others = [  # with records at the same times
            replace(
                base, tolerance=None, step=base.step / times, record_every=base.record_every * times
            )
            for times in FINER
        ]
    else:
        own = simulation.tolerance
        tolerances = TOLERANCES if own is None else [min(factor * own, 1.0) for factor in RELATIVE]
        others = [replace(base, tolerance=one) for one in tolerances]
        # As the run chose its macro steps, they would not show what they are off.
        chosen = own is None and simulation.macro_step is None
        macros = [1.0 if chosen else 0.5, 1.0, 1.0]
    plans = list(zip(others, ASIDE_M, macros, strict=True))
    return plans if strict else [plans[0], plans[-1]]


def _approaches_slowly(simulation: Simulation) -> bool:
    """Whether any contact has bristles, see `FINER`."""
    return any(one.friction.bristles for one in simulation.mechanism.clearance.values())


def _words(simulation: Simulation, aside: Sequence[float] = ()) -> str:
    if simulation.tolerance is None:
        how = f"step {1e6 * simulation.step:.3g} µs"
    else:
        how = f"tolerance {simulation.tolerance:g}"
    words = f"{simulation.integrator}, {how}"
    if simulation.macro_step is not None:
        words += f", macro step {1e6 * simulation.macro_step:.3g} µs"
    if any(aside):
        words += f", journals {1e9 * max(aside):g} nm aside"
    return words


def _completed(
    simulation: Simulation,
    label: str,
    progress: bool,
    aside: Sequence[float] = (0.0, 0.0, 0.0),
    macro: float = 1.0,
    figures: _Headline | None = None,
) -> Run:
    """A further run at its end, or why there is none: journals start `aside` [m], macro steps are
    shorter by `macro`, and `figures` are made of its records.
    """
    try:
        run = Run(simulation, progress, None if figures is None else figures.take)
    except JointplayError as error:
        raise JointplayError(f"the run is refused: {error}") from None
    if any(aside):
        run.displace(aside)
    run.shorten_macro_steps(macro)
    run.label = label
    if figures is not None:
        figures.builder = HistoryBuilder(run)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # said in the certificate
        status = run.run_to_end(progress)
    if status == Status.INTERRUPTED:
        raise KeyboardInterrupt
    if status != Status.COMPLETED:
        raise JointplayError(f"the run {run.message(status)}")
    return run


def _ideal(simulation: Simulation, result: Result, progress: bool) -> tuple[Result | None, str]:
    """The ideal mechanism's run with the same settings, or None and why there is none."""
    if not analysis.has_play(result):
        return None, ""
    same = replace(simulation, duration=float(result.time[-1]), start=result.audit.start)
    if not _fits(result):  # what lies between records is interpolated
        seldom = math.ceil(len(result.time) / SUMMARY_RECORDS)
        same = replace(same, record_every=same.record_every * seldom)
    try:
        twin = analysis.ideal_simulation(same)
        run = _completed(twin, "the ideal mechanism ", progress)
        return run.result(Status.COMPLETED, reactions=False, only=COMPARED), ""
    except JointplayError as error:
        text = f"the tool error is unknown: the ideal mechanism cannot be simulated ({error})"
    warnings.warn(text, RuntimeWarning, stacklevel=4)
    return None, text


def figures(result: Result, ideal: Result | None) -> dict[str, tuple[float, str]]:
    """Value and unit of headline figures from `Result.judge_from` on, and of what claims use."""
    found = _measure(result, ideal, claims=True)
    return {name: (one.value, one.unit) for name, one in found.items()}


def _fits(result: Result) -> bool:
    return result.dataset.nbytes <= spool.MOST_BYTES


def _measure(result: Result, ideal: Result | None, claims: bool) -> dict[str, Measured]:
    """The headline figures of a run, and where it can be what the claims use."""
    figures = _Headline(result.time, result.judge_from, ideal, hinges(result))
    dataset, rows = result.dataset, len(result.time)
    if not _fits(result):
        dataset = dataset[[name for name in _Headline.HISTORIES if name in dataset]]
        rows = AT_ONCE
    for first in range(0, len(result.time), rows):
        figures.add(dataset.isel(time=slice(first, first + rows)).load())
    found = figures.measured(result.audit.judged_impacts)
    return found | (_of_claims(result, ideal) if claims and _fits(result) else {})


def _of_claims(result: Result, ideal: Result | None) -> dict[str, Measured]:
    """What the claims use, of a long run with one joint with clearance."""
    if ideal is None or len(result.joints) != 1 or not result.time[-1] > 2.0 * START_UP:
        return {}
    found = measure(result, ideal)
    return {
        name: Measured(float(found[name]), unit, np.empty(0)) for name, unit in CLAIM_UNITS.items()
    }


class _Headline:
    """The headline figures of a run, from its histories, in one part or in many.

    `time` is that of all records [s]; `soft` are hinges of flexible links, which hold their bodies
    by more than the force of their springs.
    """

    HISTORIES = (
        *("joint_force_peak", "joint_force", "reaction_force", "load_work"),
        *("tool_position", "tool_orientation", *LOSSES),
    )

    builder: HistoryBuilder

    def __init__(
        self, time: np.ndarray, judge_from: float, ideal: Result | None, soft: set[str]
    ) -> None:
        self._judge_from, self._soft = judge_from, soft
        self._ideal = None if ideal is None else Reference(ideal)
        judged = time[time >= judge_from]
        self._count, self._told = len(judged), 0
        if self._ideal is not None:
            self._told = int(np.count_nonzero(judged <= self._ideal.until))
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
                    self._of(f"{how} joint force{at}", how, "N", self._count).add(sizes[judged, k])
        if self._ideal is not None:
            for what, of in (("error", "tool_position"), ("turn", "tool_orientation")):
                error = self._ideal.difference(part, of)
                sizes = np.linalg.norm(error.values, axis=1)
                sizes = sizes[error["time"].values >= self._judge_from]
                for how in ("peak", "RMS"):
                    unit = error.attrs["units"]
                    self._of(f"{how} tool {what}", how, unit, self._told).add(sizes)
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
        self._subsets, self._left = np.zeros(SUBSETS), np.empty(0)
        self._seen, self._total = 0, 0.0

    def add(self, sizes: np.ndarray) -> None:
        stretches = np.split(sizes, np.clip(self._ends[:-1] - self._seen, 0, len(sizes)))
        for k, part in enumerate(stretches):
            self._largest[k] = part.max(initial=self._largest[k])
            self._squares[k] += float(part @ part)
        self._total += float(np.sum(sizes**2))
        self._seen += len(sizes)
        sizes = np.concatenate([self._left, sizes]) if len(self._left) else sizes
        even = len(sizes) // SUBSETS * SUBSETS
        self._subsets += (sizes[:even].reshape(-1, SUBSETS) ** 2).sum(axis=0)
        self._left = sizes[even:].copy()

    def measured(self) -> Measured:
        if self._how == "peak":
            return Measured(float(self._largest.max()), self._unit, self._largest, math.inf)
        value = math.sqrt(self._total / self._seen)
        parts = self._squares / self._seen
        return Measured(value, self._unit, parts, 2.0, self._sampling_error(value))

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


def errors_if_possible(result: Result, strict: bool, **told: Any) -> Certificate | None:
    """What `certify` says of a finished run; None, with a warning, if it cannot be.

    Whatever goes wrong here, the run has been made, and is kept. `told`: see `certify`.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    try:
        return certify(result, strict=strict, **told)
    except Exception as error:  # noqa: BLE001
        reason = str(error) if isinstance(error, JointplayError) else repr(error)
        text = f"the result is complete, but its numerical errors cannot be estimated: {reason}"
        warnings.warn(text, RuntimeWarning, stacklevel=3)
        return None


def add_certificate(
    result: Result | None,
    path: Path,
    simulation: Simulation,
    progress: bool = False,
    strict: bool = True,
    claims: bool = False,
    name: str = "",
) -> None:
    """Certify a saved result, or estimate its errors, and save it again; until then it stays.

    A run that was told to stop, or while it was saved, is not certified.

    Args:
        result, path: what `run_and_save` gave, and its file.
        simulation, progress, strict, claims, name: see `certify`.

    Raises:
        JointplayError: the file cannot be written again; the message says where the result is.
        KeyboardInterrupt: told to stop; the result is there without certificate.
    """
    if signals.stop_requested():
        return
    told: dict[str, Any] = {"progress": progress, "claims": claims, "name": name}
    given = result or Result.open(path)
    with closing(given.dataset):
        if given.status == Status.INTERRUPTED:
            return
        certificate = errors_if_possible(given, strict, simulation=simulation, **told)
    if certificate is None:
        return
    with signals.keeping(f"the certificate of {path}"):
        if result is None:
            netcdf.add_attributes(path, {"certificate": json.dumps(certificate.describe())})
        else:
            result.certificate = certificate
            save(result, path, overwrite=True)
