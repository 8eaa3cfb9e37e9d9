"""Certificates: the numerical error of every headline figure, from further runs with other steps.

After every run two further runs are made, whose adaptive steps are controlled by their own error; a
third follows where these two leave a figure open, and for a strict certificate. The error of a
figure is its difference from the finest run, plus a margin for the scatter of the further runs
(`numerical_error`). docs/certificates.md says how often the stated errors cover the true ones.
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
"""Factor from the scatter of runs to an error.

Four draws of a chaotic figure, and a fifth that is the truth: it lies within so many times their
range of the first in 95 to 98 of 100 cases, for normal and for skew distributions.
"""

CONTRACTS = 0.5
"""Further runs agree if they scatter by no more than this part of the figure's change to them."""

SENSITIVE = 5e-3
"""A figure is called sensitive if further runs differ by more than this part of it.

An estimate that leaves some figure with a larger error gets the third run, too: of 40 arms of 0.6
to 1.6 m with two loose joints, starts 1 to 100 nm aside exceeded 15 of 200 errors stated from two
runs, and five of those stated from three.
"""

TOLERANCES = (1e-3, 6e-4, 2.5e-4)
"""Tolerances of the further runs, where the run has none itself.

All three are run for a strict certificate or in doubt, else the first and the last: in one of
thirty cases drawn at random a single further run agrees with the run by chance.
"""

RELATIVE = (4.0, 0.6, 0.25)
"""Tolerances of the further runs, relative to that of the run, where it has one."""

ASIDE_M = ((1e-7, -1e-7, 1e-7), (-1e-7, 1e-7, -1e-7), (0.0, 0.0, 0.0))
"""Displacement of journals at the start of these runs [m]; none in the finest, where the effect of
another start could cancel that of shorter steps.

A nanometre would not show every chaos: stick-slip depends on switches that so small a change may
miss, and that are reached with one step and not with another.
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
    """State the numerical error of every headline figure, from two or three further runs.

    Their steps adapt to their own error, and journals start displaced: see `TOLERANCES`, `ASIDE_M`.

    Args:
        source: what is certified; a simulation is run first.
        progress: show a bar that names what runs.
        simulation: the simulation that made the result; None: built from the result.
        name: name of the run, shown by the bar.
        claims: also certify the measures of the paper's claims, for a run with one joint with
            clearance of which more is judged than not.
        strict: make all three further runs; False: two, and a third only if they leave a figure
            open, as after every run.
        jobs: processes for these runs; None takes one for each core.

    Raises:
        KeyboardInterrupt: Ctrl-C.
        JointplayError: the simulation cannot be run.
    """
    require_a("source", source, "Simulation", "Result")
    if isinstance(source, Simulation):
        simulation, result = source, Run(source, progress).finish(progress)
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
        """Figures of a further run, or the reason why it has none."""
        number, further = numbered
        # The third run of an estimate is made in doubt only.
        label = f"{task}, {number} of {len(plans) if strict else max(number, 2)} ({further}) "
        reference = ideal
        if ideal is not None and number == 1:
            # The finest run is compared with an ideal run of its own steps: beside the ideal run of
            # `result`, all figures would share the error of that.
            own_ideal, absence = _ideal(further.simulation, result, progress)
            if own_ideal is None:
                return f"with {further}, {absence}"
            reference = Reference(own_ideal)
        figures = Headline(result.time, result.judge_from, reference, hinges(result))
        try:
            run = further.completed(figures, label, progress)
        except JointplayError as error:
            return f"with {further}, {error}"
        of_run = figures.finish(run)
        if not with_claims or ideal is None:
            return of_run
        further_result = run.result(Status.COMPLETED)
        further_result.dataset = compared(further_result.dataset, ideal)
        return of_run | claims_of(further_result)

    # The finest run is the first: `numerical_error` measures the change to it.
    finest, middle, first = reversed(plans)
    numbered = [*enumerate([finest, middle, first] if strict else [finest, first], 1)]
    outcomes = Study(numbered, figures_of).run(copies(jobs, numbered))
    headline = headline_of(result, ideal, with_claims)
    measured = [outcome for outcome in outcomes if not isinstance(outcome, str)]
    # In an estimate the third run decides where the first two leave a figure open.
    if not strict and len(measured) == len(outcomes) and leave_open(headline, measured):
        numbered.append((3, middle))
        outcomes.append(figures_of(numbered[-1]))
    notes = [outcome for outcome in outcomes if isinstance(outcome, str)]
    measured = [outcome for outcome in outcomes if not isinstance(outcome, str)]
    certified, sensitive = [], {}
    for name, figure in headline.items():
        further = [run[name] for run in measured if name in run]
        # Where a further run failed, the error is unknown.
        error = math.inf if notes else max(numerical_error(figure, further), figure.sampling)
        if name in COUNTS and math.isfinite(error) and figure.value:
            # Runs may agree in a count although one contact barely touches, or barely fails to.
            error = max(math.ceil(error), 1)
        elif name.startswith(HEADLINE) and not notes and is_sensitive(figure, further):
            sensitive[name] = [figure, *further]
        certified.append(CertifiedFigure(name, figure.value, float(error), figure.unit))
    if sensitive:
        widest = max(sensitive, key=lambda name: spread(sensitive[name]))
        factor, unit = displayed(headline[widest].unit)
        values = factor * np.array([run.value for run in sensitive[widest]])
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
    """Most further runs that `certify` makes, including those of the ideal mechanism."""
    mechanism = simulation.mechanism
    return len(TOLERANCES) + 2 * bool(mechanism.clearance or mechanism.gears)


def scatter(runs: Sequence[Measured]) -> float:
    """Range of a figure over several runs, of the whole runs or combined from stretches of them.

    The larger counts. The ranges of stretches are taken as independent: those of a sum add in
    quadrature; the largest value could have been as small as the largest of the stretches' least.
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
    if power > 1.0:  # from the sum of powers to its root: the derivative
        combined /= power * max(max(values), 1e-300) ** (power - 1.0)
    return max(difference, combined)


def numerical_error(figure: Measured, further: Sequence[Measured]) -> float:
    """Error of a figure, from its values in the further runs, the finest first.

    The change to the finest run plus `SAFETY` times the scatter of the further runs; where these
    do not agree (`CONTRACTS`), `SAFETY` times the scatter of all runs.
    """
    change = abs(figure.value - further[0].value)
    uncertainty = scatter(further)
    if not math.isfinite(change + uncertainty):
        return math.inf
    if uncertainty > CONTRACTS * change:
        return SAFETY * scatter([figure, *further])
    # Further runs may agree by chance: no error is known to better than a tenth of itself.
    return max(change + SAFETY * uncertainty, 1.1 * change)


def leave_open(figures: Mapping[str, Measured], further: Sequence[Mapping[str, Measured]]) -> bool:
    """Whether two further runs, the finest first, leave a figure with a noticeable error."""
    return any(
        numerical_error(figure, [run[name] for run in further]) > SENSITIVE * abs(figure.value)
        for name, figure in figures.items()
        if name.startswith(HEADLINE) and name not in COUNTS and all(name in run for run in further)
    )


def spread(runs: Sequence[Measured]) -> float:
    """Range of a figure over runs, relative to its value in the first; infinite if that is 0."""
    return float(np.ptp([run.value for run in runs]) / runs[0].value) if runs[0].value else math.inf


def is_sensitive(figure: Measured, further: Sequence[Measured]) -> bool:
    """Whether the further runs differ noticeably, and more than the run does from the finest."""
    uncertainty = scatter(further)
    change = abs(figure.value - further[0].value)
    return uncertainty > max(CONTRACTS * change, SENSITIVE * abs(figure.value))


@dataclass(frozen=True)
class FurtherRun:
    """A run whose difference from the certified one shows the numerical error."""

    simulation: Simulation
    aside: tuple[float, float, float]
    """Displacement of journals at the start [m]."""
    finer: float
    """Factor by which macro steps are shorter than the run would choose them."""

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
        """Method and steps, and how far aside journals start: the line of a certificate."""
        aside = f", journals {1e9 * max(self.aside):g} nm aside" if any(self.aside) else ""
        return f"{self}{aside}"

    def completed(self, figures: Headline, label: str, progress: bool) -> Run:
        """Run to the end, feeding the records to `figures`.

        Raises:
            JointplayError: the run is refused, or stops early.
        """
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
    """The further runs, by the multi-rate method, for as long as the run lasted.

    The finest is the last; the one before it an estimate makes in doubt only.
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
    # Macro steps as in the run would not show their own error: the first of these runs takes them
    # twice as long, unless the run left them and its tolerance to the defaults.
    chosen = tolerance is None and simulation.macro_step is None
    macros = [1.0 if chosen else 0.5, 1.0, 1.0]
    return [FurtherRun(*parts) for parts in zip(simulations, ASIDE_M, macros, strict=True)]


def _ideal_tool(
    simulation: Simulation, result: Result, progress: bool
) -> tuple[Reference | None, str]:
    """Motion of the ideal mechanism's tool, or None and why there is none.

    The result is given its comparison with the ideal tool, if it fits in memory.
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
    """Certificate of a finished run; None, with a warning, if it cannot be made.

    Whatever goes wrong here, the finished run is kept. `options`: see `certify`.

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
    """Add to the file of a saved result the tool's error against the ideal mechanism, and the
    numerical errors; nothing if the run was told to stop, or the program while it was saved.

    Args:
        result, path: the result of `run_and_save` (None: read the file), and its file.
        simulation, progress, claims, name, jobs: see `certify`.
        errors: how numerical errors are found: ``certify``, ``estimate``, or empty for not at all.

    Raises:
        JointplayError: the file cannot be written again; it is left as it was.
        KeyboardInterrupt: told to stop; the result is there without the errors.
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
    """Yield the histories `COMPARED`, `AT_ONCE` records at a time."""
    tool = dataset[[name for name in TOOL_MOTIONS if name in dataset]]
    for first in range(0, tool.sizes["time"], AT_ONCE):
        part = compared(tool.isel(time=slice(first, first + AT_ONCE)).load(), ideal)
        yield part[[name for name in COMPARED if name in part]]
