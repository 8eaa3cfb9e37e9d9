"""Running a sweep, from its plan to its store: which processes run the cases, and when it ends."""

from __future__ import annotations

import math
import re
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_a
from jointplay.base.processes import MOST_DEATHS, Pool, number_of
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords, one_of
from jointplay.base.units import toml_text
from jointplay.physics import kernel
from jointplay.scenario import Scenario
from jointplay.simulation.prepare import CHUNK
from jointplay.simulation.result import netcdf
from jointplay.simulation.run import Run
from jointplay.study.axes import Axis
from jointplay.study.case import Bench, Case, job, run_case
from jointplay.study.database import FILE, is_there
from jointplay.study.measures import shipped
from jointplay.study.store import FAILED, Index, Outcome, Sweep, SweepStore, open_sweep
from jointplay.study.study import Study, Workers
from jointplay.study.sweep_plan import REPEAT, SAMPLE, Cases, SweepPlan, plan_of

MANY = 20_000
"""Number of cases above which a sweep has to be confirmed."""
PATIENCE_S = 2.0
"""Time for which a case is run to estimate the sweep's [s]."""
MOST_CHECKED = 1000
"""Most values of an axis that are checked before anything runs."""
MEASURES_BYTES = 300
"""Size of a case's measures in the store [bytes]."""
_TIMES = ((86400.0, "days"), (3600.0, "hours"), (60.0, "minutes"), (1.0, "seconds"))
_SIZES = ((1e12, "TB"), (1e9, "GB"), (1e6, "MB"), (1e3, "kB"))


def cost_of(plan: SweepPlan, bench: Bench, processes: int) -> str:
    """Estimated time and size of a sweep in words, by the pace at which one of its cases begins."""
    started = time.perf_counter()
    run = _first_run(plan, bench, Cases(plan))
    ready = time.perf_counter() - started
    moments = run.steps(CHUNK * run.simulation.step)
    next(moments)
    started = time.perf_counter()
    while time.perf_counter() - started < PATIENCE_S and next(moments, None) is not None:
        pass
    share = max(run.workspace.steps, 1) / run.total_steps
    seconds = ready + (time.perf_counter() - started) / share
    stored = len(netcdf.pack(run.result().dataset)) / share if plan.results else 0
    return (
        f"about {_amount(plan.count * seconds / processes, _TIMES, 2.0)} on {processes} processes "
        f"and {_amount(plan.count * (MEASURES_BYTES + stored), _SIZES, 1.0)} of results"
    )


def _first_run(plan: SweepPlan, bench: Bench, indices: Iterable[Index]) -> Run:
    """Run of the first of some cases that can be built."""
    errors = []
    for index in indices:
        try:
            return Run(bench.simulation(plan.changes(index)))
        except JointplayError as error:  # another case may be buildable
            errors.append(error)
    raise errors[0]


def _amount(value: float, units: Sequence[tuple[float, str]], smallest: float) -> str:
    size, name = next((pair for pair in units[:-1] if value >= smallest * pair[0]), units[-1])
    part = value / size
    return f"{part:.2g} {name}" if part < 100.0 and size > 1.0 else f"{part:.0f} {name}"


def _lost(case: Case) -> Outcome:
    ended = f"{MOST_DEATHS} worker processes ended while running this case"
    return Outcome(case[0], FAILED, {}, f"{ended} (killed, out of memory, or crashed)")


@known_keywords
def sweep(
    source: Scenario | str | Path,
    store: str | Path,
    axes: Mapping[str, Any] | None = None,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    extend: bool = False,
    yes: bool = False,
    progress: bool = False,
    **options: Any,
) -> Sweep:
    """Run a sweep and keep its measures in a folder; after any interruption `resume` continues.

        jp.sweep("jointplay:scara.toml", "clearance_sweep",
                 {"joints.joint_b.radial_clearance": [0, "0.1 mm", "0.2 mm"]}, case="0.2 mm")

    Args:
        source: a scenario, or its file, whose table [sweep] is run.
        store: the folder of the store.
        axes: axes in place of the file's, by name; or lists of values by key.
        jobs: processes; None takes one for each core.
        scheduler: address of a Dask scheduler, whose workers run the cases instead.
        resume: continue the store if there is one; finished cases do not run again.
        extend: as `resume`, and the store may become larger: more samples, repeats, or values at
            the end of a list.
        yes: run a very large sweep, too; see `MANY`.
        progress: show a bar.
        options: keys of the table [sweep], in place of the file's: case, samples, repeats, ...

    Returns:
        `open_sweep` of the store.

    Raises:
        JointplayError: an empty or contradictory sweep, a key that does not exist, a store of
            another sweep or that another process writes to, a scheduler that does not answer.
        KeyboardInterrupt: Ctrl-C; finished cases are kept.
    """
    require_a("source", source, "Scenario", "str", "Path")
    require_a("store", store, "str", "Path")
    run_plan(
        plan_of(source, axes, **options), store, jobs=jobs, scheduler=scheduler,
        resume=resume, extend=extend, yes=yes, progress=progress,
    )  # fmt: skip
    return open_sweep(store)


def run_plan(
    plan: SweepPlan,
    path: str | Path,
    *,
    jobs: int | None = None,
    scheduler: str | None = None,
    resume: bool = False,
    extend: bool = False,
    yes: bool = False,
    progress: bool = False,
    begin: Callable[[Sequence[str]], None] | None = None,
) -> SweepPlan:
    """Run a plan; see `sweep` for errors and for arguments not listed here.

    Args:
        plan: the plan.
        path: the folder of the store.
        begin: called after all checks, before the first case, with notes on the cases, a line each.

    Returns:
        The plan as it was run: with `until` it may have more samples than at the beginning.
    """
    if "://" in str(path):
        raise JointplayError(
            f"a sweep is written to a folder, got {str(path)!r}; copy the finished folder there"
        )
    # All that can refuse the sweep comes before its store is made.
    number = number_of(jobs)
    first = probe(plan, progress)
    if plan.count > MANY and not yes:
        guess = cost_of(plan, first, number)
        raise JointplayError(f"{plan.summary}: {guess}; use --yes to run it anyway")
    _ = plan.identity  # reads all files, so that a missing one is an error now
    plan = _largest_so_far(plan, Path(path)) if resume or extend else plan
    with ExitStack() as stack:

        def hire(count: int) -> Workers[Case, Outcome]:
            workers = workers_for(plan, number if plan.until else min(number, count), scheduler)
            stack.callback(workers.close)
            return workers

        fresh = not is_there(Path(path), resume or extend)
        # A cluster may not answer: it is asked before a store is made.
        workers = hire(plan.count) if fresh and scheduler is not None else None
        store = SweepStore(path, plan, resume, extend)
        try:
            while True:  # once, or with `until` as often as the samples have to be doubled
                count = int(np.count_nonzero(~store.ran))
                workers = hire(count) if count and workers is None else workers
                if begin is not None:
                    begin(first.scenario.notes)
                    begin = None
                if workers is not None:
                    _run_all(store, workers, count, progress)
                if _enough(store):
                    break
                store.grow(store.plan.with_samples(2 * store.plan.samples))
            store.close()
            files.written.append(store.path / FILE)  # named if what follows is interrupted
        except BaseException as error:
            _give_up(store, error)
            raise
    return store.plan


def workers_for(
    plan: SweepPlan, number: int, scheduler: str | None = None
) -> Workers[Case, Outcome]:
    """Start workers on this machine, or on the cluster of a scheduler."""
    if scheduler is not None:
        from jointplay.study.cluster import ClusterWorkers

        return ClusterWorkers(partial(run_case, job(plan, send_files=True)), scheduler, _lost)
    kernel.caller_of()  # compiled here once, not once in each process
    return Pool(partial(run_case, job(plan)), number, lost=_lost, small=True)


def _run_all(store: SweepStore, workers: Workers[Case, Outcome], runs: int, progress: bool) -> None:
    plan = store.plan
    bar = ProgressBar(
        total=plan.count, initial=plan.count - runs, disable=not progress, unit="cases"
    )
    study = Study(Cases(plan), partial(run_case, job(plan)), store)
    with bar:
        bar.refresh()
        for _ in study.outcomes(progress=bar, workers=workers):
            if store.failed:
                bar.postfix = f"{store.failed} failed"


def _enough(store: SweepStore) -> bool:
    """Whether the sweep is over: it has no target precision, may not take more samples, or has
    reached the precision at every point of the grid.
    """
    plan = store.plan
    if plan.until is None or 2 * plan.samples > plan.until.most:
        return True
    values = np.moveaxis(store.column(plan.until.measure), list(plan.sizes).index(SAMPLE), 0)
    if plan.sampling == "saltelli":  # only two points of each block are independent
        block = len(plan.drawn) + 2
        values = np.concatenate([values[::block], values[block - 1 :: block]])
    if REPEAT in plan.sizes:
        values = values.mean(axis=-1)  # repeats of a point are not independent samples
    points = values.reshape(len(values), -1).T
    return all(plan.until.reached(point) for point in points if np.isfinite(point).any())


def _largest_so_far(plan: SweepPlan, path: Path) -> SweepPlan:
    """The plan with as many samples as the store has, if `until` has added some there."""
    if plan.until is None:
        return plan
    try:
        sizes = open_sweep(path).sizes
    except JointplayError:  # `SweepStore` will say what is wrong with it
        return plan
    larger = plan
    while larger.sizes[SAMPLE] != sizes.get(SAMPLE):
        if 2 * larger.samples > plan.until.most:
            return plan
        larger = larger.with_samples(2 * larger.samples)
    return larger


def _give_up(store: SweepStore, error: BaseException) -> None:
    """Close the store, and add to an error how to continue."""
    finished = int(np.count_nonzero(store.ran))
    store.close()
    note = f"{finished} of {store.plan.count} cases are kept; --resume continues"
    if isinstance(error, JointplayError):
        error.args = (f"{error}; {note}",)
    elif isinstance(error, KeyboardInterrupt):
        error.args = (note,)


def probe(plan: SweepPlan, progress: bool = False) -> Bench:
    """Check joints and axes, and build a case, before anything runs.

    If the first case cannot be built, a few others from all over the sweep are tried: single cases
    may fail, but not all of them.

    Raises:
        JointplayError: none of these can be built, or an axis has a value that no case can take.
    """
    bench = Bench(job(plan))
    _check_joints(plan, bench)
    _check_values(plan, bench, progress)
    for name in {axis.name for axis in (*plan.axes, *plan.drawn)} & shipped(plan.joints).keys():
        reason = f"an axis cannot be called {name!r}, as a measure is"
        raise JointplayError(f"{plan.scenario.path}, sweep: {reason}")
    _first_run(plan, bench, _some(plan))
    return bench


def _check_values(plan: SweepPlan, bench: Bench, progress: bool) -> None:
    """Raise a JointplayError if an axis has a value with which no simulation can be built.

    Checked are the extremes of a distribution's samples, and at most `MOST_CHECKED` values of a
    list or range, its ends among them.
    """
    rows = [
        (axis, number, axis.values[number], axis.coordinate[number])
        for axis in plan.axes
        for number in _spread(len(axis.values), MOST_CHECKED)
    ]
    for axis, column in zip(plan.drawn, plan.drawn_values.T if plan.drawn else (), strict=True):
        extremes = dict.fromkeys((int(np.argmin(column)), int(np.argmax(column))))
        rows += [(axis, number, float(column[number]), column[number]) for number in extremes]
    bar = ProgressBar(rows, "checking values", disable=not progress, delay=PATIENCE_S, leave=False)
    for axis, number, value, coordinate in bar:
        reason = _refusal(plan, bench, axis, number, value)
        if reason is None:
            continue
        text, detail = toml_text(value) if axis.keys else str(coordinate), ""
        if axis.sampled:
            text = f"{coordinate:g} {axis.unit}".rstrip()
            detail = f" (sample {number + 1} of {plan.sizes[SAMPLE]}; from and to keep them inside)"
        raise JointplayError(
            f"{plan.scenario.path}, sweep: axis {axis.name!r} cannot take {text}: {reason}{detail}"
        )


def _refusal(plan: SweepPlan, bench: Bench, axis: Axis, number: int, value: Any) -> str | None:
    """Reason why neither the scenario nor any of a few cases can take a value; None if one can."""
    dimension = list(plan.sizes).index(SAMPLE if axis.sampled else axis.name)
    candidates = (
        plan.with_value(axis, value),
        *(plan.changes(case) for case in _some(plan, {dimension: number})),
    )
    reason = None
    for changes in candidates:
        try:
            bench.simulation(changes)
        except JointplayError as error:
            text = str(error).removeprefix(f"{bench.scenario.path}, ")
            reason = reason or re.sub(r"^line \d+, ", "", text)  # the line has another value
        else:
            return None
    return reason


def _spread(size: int, count: int) -> list[int]:
    """`count` evenly spaced integers from 0 to `size` - 1, both included, or all of them."""
    return [int(k) for k in np.unique(np.linspace(0, size - 1, min(size, count)).astype(int))]


def _some(plan: SweepPlan, fixed: Mapping[int, int] | None = None) -> Iterator[Index]:
    """Yield a few cases from all over the sweep; `fixed` holds indices of some dimensions."""
    fixed = fixed or {}
    shape = tuple(1 if k in fixed else size for k, size in enumerate(plan.shape))
    for number in _spread(math.prod(shape), 16):
        index = map(int, np.unravel_index(number, shape))
        yield tuple(fixed.get(k, position) for k, position in enumerate(index))


def _check_joints(plan: SweepPlan, bench: Bench) -> None:
    """Raise a JointplayError if an axis, rather than the scenario, names a joint that is absent."""
    tables = plan.base.get("joints", {})
    unlisted = [name for name in plan.joints if name not in tables]
    if unlisted:
        ideal = {table: {"ideal": True} for table in tables}
        mechanism = bench.simulation({"joints": ideal}).mechanism
        names = [*mechanism.joints, *mechanism.loops]
    for name in unlisted:
        if name not in names:
            raise JointplayError(f"{plan.scenario.path}, sweep: {one_of('joint', name, names)}")
