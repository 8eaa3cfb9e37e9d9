"""Every headline figure of a run with its numerical error, found by running again otherwise.

After every run two further ones are made with steps that go by their own error; a third where they
leave a figure open, and for a strict certificate. docs/certificates.md says how, and how often the
stated errors cover the true ones.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import signals
from jointplay.base.errors import JointplayError, JointplayWarning, require_a
from jointplay.base.processes import copies
from jointplay.base.schema import known_keywords
from jointplay.base.units import displayed
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.simulation import spool
from jointplay.simulation.analysis.headline import (
    AT_ONCE,
    Headline,
    Measured,
    claims_of,
    fits,
    headline_of,
)
from jointplay.simulation.analysis.tool_error import (
    Reference,
    compare_tools,
    compared,
    ideal_forces,
)
from jointplay.simulation.analysis.twins import (
    TOOL_MOTIONS,
    has_play,
    hinges,
    ideal_simulation,
    tool_motion,
)
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result import netcdf
from jointplay.simulation.result.certificate import COUNTS, HEADLINE, Certificate, CertifiedFigure
from jointplay.simulation.result.histories import HistoryBuilder
from jointplay.simulation.result.result import COMPARED, Result
from jointplay.simulation.result.thinning import SUMMARY_RECORDS
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study

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
"""A figure in which further runs differ by more than this part of it is called sensitive.

An estimate whose error of some figure is larger gets the third run, too: of 40 arms of 0.6 to 1.6 m
with two loose joints, starts 1 to 100 nm aside led beyond 15 of 200 stated errors by two runs, five
by three.
"""

TOLERANCES = (1e-3, 6e-4, 2.5e-4)
"""Tolerances of the further runs, where the run has none itself.

All three for a strict certificate or in doubt, else without the second: in one of thirty cases
drawn at random a single further run agrees with the run by chance.
"""

RELATIVE = (4.0, 0.6, 0.25)
"""The same relative to the run's own."""

ASIDE_M = ((1e-7, -1e-7, 1e-7), (-1e-7, 1e-7, -1e-7), (0.0, 0.0, 0.0))
"""How far aside journals start in these runs; not in the finest: what another start changes could
cancel what shorter steps do.

A nanometre would not show every chaos: stick-slip hangs on switches that it need not reach, and
that one step reaches and another does not.
"""


@known_keywords
def certify(
    source: Simulation | Result,
    *,
    progress: bool = False,
    simulation: Simulation | None = None,
    name: str = "",
    claims: bool = False,
    strict: bool = True,
    jobs: int | None = 1,
) -> Certificate:
    """State the numerical error of every headline figure, from three further runs.

    Their steps go by their own error, and journals start aside: see `TOLERANCES`, `ASIDE_M`.

    Args:
        source: what is certified; a simulation is run first.
        progress: show a bar that names what runs.
        simulation: what made the result; built from the result if not given.
        name: of the run, which the bar shows.
        claims: certify what the paper's claims use, too, of a run with one joint with clearance of
            which more is judged than not.
        strict: without, from two further runs, in doubt three, as after every run.
        jobs: processes for these runs; None takes one for each core.

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
    plans = further_runs(simulation, result)
    ideal, reason = _ideal_tool(simulation, result, progress)
    with_claims = claims and fits(result)
    task = f"{'certifying' if strict else 'estimating'} errors{name and f' of {name}'}"

    def figures_of(numbered: tuple[int, FurtherRun]) -> dict[str, Measured] | str:
        number, further = numbered
        # The third run of an estimate is made in doubt only.
        label = f"{task}, {number} of {len(plans) if strict else max(number, 2)} ({further}) "
        beside = ideal
        if ideal is not None and number == 1:
            # Of its own: what that of the run is off, runs beside it share with the run.
            its, absence = _ideal(further.simulation, result, progress)
            if its is None:
                return f"with {further}, {absence}"
            beside = Reference(its)
        figures = Headline(result.time, result.judge_from, beside, hinges(result))
        try:
            run = further.completed(figures, label, progress)
        except JointplayError as error:
            return f"with {further}, {error}"
        of_run = figures.finish(run)
        if not with_claims or ideal is None:
            return of_run
        its_result = run.result(Status.COMPLETED)
        its_result.dataset = compared(its_result.dataset, ideal)
        return of_run | claims_of(its_result)

    finest, middle, first = reversed(plans)
    numbered = [*enumerate([finest, middle, first] if strict else [finest, first], 1)]
    outcomes = Study(numbered, figures_of).run(copies(jobs, numbered))
    headline = headline_of(result, ideal, with_claims)
    measured = [outcome for outcome in outcomes if not isinstance(outcome, str)]
    if not strict and len(measured) == len(outcomes) and leave_open(headline, measured):
        numbered.append((3, middle))
        outcomes.append(figures_of(numbered[-1]))
    notes = [outcome for outcome in outcomes if isinstance(outcome, str)]
    measured = [outcome for outcome in outcomes if not isinstance(outcome, str)]
    certified, sensitive = [], {}
    for name, figure in headline.items():
        further = [run[name] for run in measured if name in run]
        # Where a further run failed, nobody knows.
        error = math.inf if notes else max(numerical_error(figure, further), figure.sampling)
        if name in COUNTS and math.isfinite(error) and figure.value:
            # That runs agree says nothing of a contact that barely touches, or barely not.
            error = max(math.ceil(error), 1)
        elif name.startswith(HEADLINE) and not notes and is_sensitive(figure, further):
            sensitive[name] = [figure, *further]
        certified.append(CertifiedFigure(name, figure.value, float(error), figure.unit))
    if sensitive:
        widest = max(sensitive, key=lambda name: spread(sensitive[name]))
        factor, unit = displayed(headline[widest].unit)
        values = factor * np.array(_values(sensitive[widest]))
        notes.append(
            "the motion is sensitive: the further runs, which start up to 100 nm aside, differ "
            f"among each other in {', '.join(sensitive)}; one run is one draw of many: {widest} "
            f"{values.min():.4g} to {values.max():.4g} {unit} in {len(values)} runs"
        )
    notes += [reason] if reason else []
    if claims and not with_claims:
        notes.append(
            "the measures of the paper's claims are left out: they need all histories at once, "
            f"which take more than {spool.MOST_BYTES >> 20} MB; record less often"
        )
    completed = [run for _, run in numbered]
    runs = tuple(run.label for run in plans if run in completed)
    return Certificate(tuple(certified), runs, "; ".join(notes), strict)


def number_of_runs(simulation: Simulation) -> int:
    """How many runs `certify` makes at most, those of the ideal mechanism included."""
    mechanism = simulation.mechanism
    return len(TOLERANCES) + 2 * bool(mechanism.clearance or mechanism.gears)


def scatter(runs: Sequence[Measured]) -> float:
    """How far apart a figure's values in several runs are, in all or stretch by stretch.

    The differences of stretches count as independent: those of sums by the root of their squares;
    those of largest values by how small the largest could be, had it been each stretch's least.
    """
    values = [run.value for run in runs]
    difference = float(np.ptp(values)) if np.isfinite(values).all() else math.inf
    if not math.isfinite(difference) or not runs[0].parts.size:
        return difference
    parts = np.array([run.parts for run in runs])
    power = runs[0].power
    if math.isinf(power):
        return max(difference, max(values) - float(parts.min(axis=0).max()))
    combined = float(np.linalg.norm(np.ptp(parts, axis=0)))
    if power > 1.0:
        combined /= power * max(max(values), 1e-300) ** (power - 1.0)
    return max(difference, combined)


def numerical_error(figure: Measured, further: Sequence[Measured]) -> float:
    """Error of a figure, given what the further runs made of it, the finest first."""
    change = abs(figure.value - further[0].value)
    uncertainty = scatter(further)
    if not math.isfinite(change + uncertainty):
        return math.inf
    if uncertainty > CONTRACTS * change:
        return SAFETY * scatter([figure, *further])
    # Further runs may agree by chance: no error is known to better than a tenth of itself.
    return max(change + SAFETY * uncertainty, 1.1 * change)


def leave_open(figures: Mapping[str, Measured], further: Sequence[Mapping[str, Measured]]) -> bool:
    """Whether a figure's error, as two further runs (the finest first) have it, is noticeable."""
    return any(
        numerical_error(figure, [run[name] for run in further]) > SENSITIVE * abs(figure.value)
        for name, figure in figures.items()
        if name.startswith(HEADLINE) and name not in COUNTS and all(name in run for run in further)
    )


def spread(runs: Sequence[Measured]) -> float:
    """By how much runs differ, in parts of the first; inf of nothing that is not always nothing."""
    return float(np.ptp(_values(runs)) / runs[0].value) if runs[0].value else math.inf


def _values(runs: Sequence[Measured]) -> list[float]:
    return [run.value for run in runs]


def is_sensitive(figure: Measured, further: Sequence[Measured]) -> bool:
    """Whether the further runs differ more than the run does from them, and noticeably."""
    uncertainty = scatter(further)
    change = abs(figure.value - further[0].value)
    return uncertainty > max(CONTRACTS * change, SENSITIVE * abs(figure.value))


@dataclass(frozen=True)
class FurtherRun:
    """A run that shows how far off another one is."""

    simulation: Simulation
    aside: tuple[float, float, float]
    """How far aside journals start [m]."""
    finer: float
    """How much shorter macro steps are."""

    def __str__(self) -> str:
        simulation = self.simulation
        if simulation.tolerance is None:
            setting = f"step {1e6 * simulation.step:.3g} µs"
        else:
            setting = f"tolerance {simulation.tolerance:g}"
        text = f"{simulation.integrator}, {setting}"
        if simulation.macro_step is not None:
            text += f", macro step {1e6 * simulation.macro_step:.3g} µs"
        return text

    @property
    def label(self) -> str:
        """What it is, with where its journals start."""
        aside = f", journals {1e9 * max(self.aside):g} nm aside" if any(self.aside) else ""
        return f"{self}{aside}"

    def completed(self, figures: Headline, label: str, progress: bool) -> Run:
        """The run at its end, of whose records `figures` are made, or why there is none."""
        try:
            run = Run(self.simulation, progress, figures.take)
        except JointplayError as error:
            raise JointplayError(f"the run is refused: {error}") from None
        if any(self.aside):
            run.displace(self.aside)
        run.shorten_macro_steps(self.finer)
        run.label, figures.builder = label, HistoryBuilder(run, figures.HISTORIES)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # said in the certificate
            status = run.run_to_end(progress)
        if status == Status.INTERRUPTED:
            raise KeyboardInterrupt
        if status != Status.COMPLETED:
            raise JointplayError(f"the run {run.message(status)}")
        return run


def further_runs(simulation: Simulation, result: Result) -> list[FurtherRun]:
    """The further runs, the finest last, before it the one that an estimate makes in doubt only.

    By the multi-rate method, for as long as the run lasted.
    """
    duration = float(result.time[-1])  # whose last digits must not shift when judging begins
    base = replace(
        simulation,
        integrator=DEFAULT,
        duration=duration,
        settle=None,
        judge_from=result.audit.judged_from,
    )
    tolerance = simulation.tolerance
    tolerances = TOLERANCES if tolerance is None else [min(x * tolerance, 1.0) for x in RELATIVE]
    simulations = [replace(base, tolerance=value) for value in tolerances]
    # As the run chose its macro steps, they would not show what they are off.
    chosen = tolerance is None and simulation.macro_step is None
    macros = [1.0 if chosen else 0.5, 1.0, 1.0]
    return [FurtherRun(*parts) for parts in zip(simulations, ASIDE_M, macros, strict=True)]


def _ideal_tool(
    simulation: Simulation, result: Result, progress: bool
) -> tuple[Reference | None, str]:
    """The motion of the ideal mechanism's tool, which the result then has, if memory has room for
    it; or None and why there is none.
    """
    if "tool_error" in result.dataset and fits(result):
        return Reference(result, "ideal_"), ""
    ideal, unknown = _ideal(simulation, result, progress)
    if ideal is not None and fits(result):
        compare_tools(result, ideal)
    elif ideal is not None:
        result.dataset.attrs |= ideal_forces(result, ideal)
    return (None if ideal is None else Reference(ideal)), unknown


def _ideal(simulation: Simulation, result: Result, progress: bool) -> tuple[Result | None, str]:
    """The ideal mechanism's run with the same settings, or None and why there is none."""
    if not has_play(result):
        return None, ""
    twin = replace(simulation, duration=float(result.time[-1]), start=result.audit.start)
    if result.beside is not None:
        twin = replace(twin, motion=Motion.from_description(result.beside))
    if not fits(result):  # what lies between records is interpolated
        stride = math.ceil(len(result.time) / SUMMARY_RECORDS)
        twin = replace(twin, record_every=twin.record_every * stride)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # said below
            run = tool_motion(ideal_simulation(twin), progress)
        return run.completed("the run"), ""
    except JointplayError as error:
        text = f"the tool error is unknown: the ideal mechanism cannot be simulated ({error})"
    warnings.warn(text, JointplayWarning, stacklevel=4)
    return None, text


def errors_if_possible(result: Result, strict: bool, **options: Any) -> Certificate | None:
    """What `certify` says of a finished run; None, with a warning, if it cannot be.

    Whatever goes wrong here, the run has been made, and is kept. `options`: see `certify`.

    Raises:
        KeyboardInterrupt: Ctrl-C.
    """
    try:
        return certify(result, strict=strict, **options)
    except Exception as error:  # noqa: BLE001
        reason = str(error) if isinstance(error, JointplayError) else repr(error)
        text = f"the result is complete, but its numerical errors cannot be estimated: {reason}"
        warnings.warn(text, JointplayWarning, stacklevel=3)
        return None


def add_errors(
    result: Result | None,
    path: Path,
    simulation: Simulation,
    progress: bool = False,
    errors: str = "certify",
    claims: bool = False,
    name: str = "",
    jobs: int | None = 1,
) -> None:
    """Add to the file of a saved result the error of its tool, and the numerical errors.

    Not of a run that was told to stop, or while it was saved.

    Args:
        result, path: what `run_and_save` gave, and its file.
        simulation, progress, claims, name, jobs: see `certify`.
        errors: how numerical errors are found: ``certify``, ``estimate`` or not at all.

    Raises:
        JointplayError: the file cannot be written again; it is as it was.
        KeyboardInterrupt: told to stop; the result is there without them.
    """
    if signals.stop_requested():
        return
    options: dict[str, Any] = {"progress": progress, "claims": claims, "name": name, "jobs": jobs}
    saved = result or Result.open(path)
    with closing(saved.dataset) as dataset:
        if saved.status == Status.INTERRUPTED:
            return
        if errors:
            strict = errors == "certify"
            certificate = errors_if_possible(saved, strict, simulation=simulation, **options)
            if certificate is not None:
                saved.certificate = certificate
        ideal = None
        if "tool_error" not in dataset and (
            "tool_error" in saved.dataset or not (errors and fits(saved))  # else it has been tried
        ):
            ideal, _ = _ideal_tool(simulation, saved, progress)
        attrs = saved.dataset.attrs
        known = {name: attrs[name] for name in ("certificate", "ideal_forces") if name in attrs}
        histories = () if ideal is None else _histories_against(ideal, dataset)
        if known or histories:
            with signals.keeping(f"the errors of {path}"):
                netcdf.add(path, known, histories)


def _histories_against(ideal: Reference, dataset: xr.Dataset) -> Iterator[xr.Dataset]:
    """The histories `COMPARED`, portion by portion."""
    tool = dataset[[name for name in TOOL_MOTIONS if name in dataset]]
    for first in range(0, tool.sizes["time"], AT_ONCE):
        part = compared(tool.isel(time=slice(first, first + AT_ONCE)).load(), ideal)
        yield part[[name for name in COMPARED if name in part]]
