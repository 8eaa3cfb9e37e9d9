"""`jointplay run FILE`: all cases of a scenario, in parallel, and the figures that compare them."""

from __future__ import annotations

import argparse
import ctypes
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    Future,
    ProcessPoolExecutor,
    wait,
)
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.errors import JointplayError, MissingName
from jointplay.host import stopping, workers
from jointplay.host.stopping import INTERRUPTED

if TYPE_CHECKING:
    from jointplay.kernel import Status
    from jointplay.result.result import Result
    from jointplay.scenario import Scenario
    from jointplay.scenario.settings import Setting
    from jointplay.simulation.simulation import Run

STOPPED = 1

_LONGEST_NAME = 100
"""Bytes of a file's name that are taken of its case's."""

_LOOK_S = 0.2
"""Interval at which progress is looked at."""


def run(scenario: Scenario, options: argparse.Namespace) -> int:
    """Run the cases, draw the figures, say how each ended and what came out."""
    from jointplay.commands import resuming
    from jointplay.host.files import claim

    cases = _chosen(scenario, options.case)
    jobs = _jobs(options.jobs, len(cases))
    files = dict(zip(cases, file_names(cases), strict=True))
    figures = scenario.figures and not options.no_figures
    drawn = _figures(scenario, cases) if figures else []
    if not options.resume:
        resuming.refuse(Path(options.out), files, drawn)
    from jointplay import plots  # what comes now takes long to import
    from jointplay.analysis.certification import further_runs
    from jointplay.analysis.headline import HISTORIES
    from jointplay.kernel import Status
    from jointplay.scenario.keep import load_some

    certified = {
        case for case in cases if options.certify or scenario.model(case).integration.certify
    }
    out, total = Path(options.out), 0.0
    given = {}
    for case in cases:  # before anything is written
        records = resuming.records(out / files[case], case in certified)
        run = scenario.prepare(case, not options.quiet, records)
        given[case] = run.simulation.describe()
        runs = 1 + (further_runs(run.simulation) if case in certified else 0)
        total += runs * run.steps * run.simulation.step
        del run  # and its arrays
    for line in scenario.notes:
        print(line, file=sys.stderr)
    if options.resume:
        claim(out, ())
        done = resuming.finished(out, files, given)
        for name in drawn:
            (out / name).unlink(missing_ok=True)
    else:
        resuming.refuse_interrupted(out, files)
        done = []
        claim(out, [*files.values(), *drawn])
    left = {case: name for case, name in files.items() if case not in done}
    progress = not options.quiet
    if not left:
        interrupted = False
    elif jobs == 1 or len(left) == 1:
        interrupted = _one_by_one(scenario, left, certified, out, progress)
    else:
        interrupted = _side_by_side(scenario, left, certified, out, jobs, total, progress)
    saved = {case: out / name for case, name in files.items() if (out / name).exists()}
    # A long run's histories fill memory; where nothing is drawn, few of them are looked at.
    only = None if figures else HISTORIES
    results = {case: load_some(path, scenario.trust, only) for case, path in saved.items()}
    for case, result in results.items():
        print(f"\n{case}: {result.message}\n{result.judgement}")
        print("\n".join(_came_out(result, results, not options.quiet)))
    drawable = {case: result for case, result in results.items() if len(result.time) > 1}
    if figures and drawable:
        plots.save(drawable, out)
    print(f"\nresults in {out}")
    if interrupted or any(r.status == Status.INTERRUPTED for r in results.values()):
        missing = [case for case in cases if case not in results]
        there = f"; there is {', '.join(path.name for path in saved.values())}" if saved else ""
        note = f"; nothing of: {', '.join(missing)}" if missing else there
        print(f"interrupted{note}; the same command with --resume goes on", file=sys.stderr)
        return INTERRUPTED
    return 0 if all(r.status == Status.COMPLETED for r in results.values()) else STOPPED


def _figures(scenario: Scenario, cases: Sequence[str]) -> list[str]:
    """Names of the files of figures."""
    from jointplay.plots.names import file_names, is_paper_robot

    return file_names(all(is_paper_robot(scenario.model(case).robot.urdf) for case in cases))


def _came_out(result: Result, results: Mapping[str, Result], progress: bool) -> list[str]:
    """The headline of a case; its ideal mechanism is another case, or simulated for it."""
    from jointplay.analysis import is_twin
    from jointplay.analysis.headline import headline, reference

    ideal = next((other for other in results.values() if is_twin(result, other)), None)
    return headline(result, ideal or reference(result, progress))


def _chosen(scenario: Scenario, wanted: Sequence[str]) -> list[str]:
    for case in wanted:
        if case not in scenario.cases:
            raise MissingName("case", case, scenario.cases)
    return [case for case in scenario.cases if not wanted or case in wanted]


def _jobs(wanted: int | None, cases: int) -> int:
    if wanted is not None and wanted < 1:
        raise JointplayError(f"at least one process is needed, got {wanted}")
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    return min(wanted or cores or 1, cases)


def file_names(cases: Sequence[str]) -> list[str]:
    """A file for each case: its label, but for what some file system does not take."""
    import re

    names: list[str] = []
    for case in cases:
        stem = re.sub(r"[^\w.+-]+", "_", case).strip("._") or "case"
        stem = stem.encode()[:_LONGEST_NAME].decode(errors="ignore")
        name, number = f"{stem}.nc", 2
        while name.lower() in (other.lower() for other in names):
            name, number = f"{stem}_{number}.nc", number + 1
        names.append(name)
    return names


def _execute(
    scenario: Scenario,
    case: str,
    run: Run,
    path: Path,
    certified: bool,
    progress: bool,
    begin: Callable[[Run], None] = lambda _: None,
) -> Status:
    """Run a case and save it together with the scenario it is from; then certify it.

    Args:
        scenario, case, run: what is run.
        path: the file.
        certified: whether the case is certified.
        progress: show a bar.
        begin: told of each run before it begins.

    Returns:
        How it ended.
    """
    from jointplay.commands import resuming
    from jointplay.scenario.keep import add_certificate, run_and_save
    from jointplay.scenario.settings import words

    notes = {
        "scenario": scenario.text,
        "scenario_file": scenario.path.name,
        "title": scenario.title,
        "case": case,
    }
    if scenario.settings:
        notes["settings"] = "\n".join(words(scenario.settings))
    begin(run)
    resumed = resuming.go_on(run, path)
    status, result = run_and_save(run, path, progress, notes, overwrite=resumed)
    if certified:
        assert result is not None  # such runs stay in memory
        add_certificate(result, path, run.simulation, progress, begin)
    return status


def _one_by_one(
    scenario: Scenario, files: dict[str, str], certified: set[str], out: Path, progress: bool
) -> bool:
    """Run all in this process; returns whether it was told to stop."""
    from tqdm import tqdm

    from jointplay.commands import resuming
    from jointplay.kernel import Status

    for case, name in files.items():
        try:
            records = resuming.records(out / name, case in certified)
            prepared = scenario.prepare(case, progress, records)
            if progress:
                tqdm.write(f"case {case}:", file=sys.stderr)
            status = _execute(scenario, case, prepared, out / name, case in certified, progress)
        except stopping.GivenUp as error:
            stopping.say(str(error))
            return True
        except KeyboardInterrupt:
            return True
        if status == Status.INTERRUPTED or stopping.told():
            return True
    return False


def _side_by_side(
    scenario: Scenario,
    files: dict[str, str],
    certified: set[str],
    out: Path,
    jobs: int,
    total: float,
    progress: bool,
) -> bool:
    """Run each in a process of its own; returns whether it was told to stop."""
    from tqdm import tqdm

    clocks = multiprocessing.RawArray(ctypes.c_double, len(files))
    begun = multiprocessing.RawArray(ctypes.c_int, len(files))
    futures: dict[Future[None], str] = {}
    layout = "{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, {remaining} left"
    bar = tqdm(total=total, disable=not progress, bar_format=layout, mininterval=_LOOK_S)
    processes = workers.pool(
        jobs,
        f"what is complete is in {str(out)!r}",
        _begin,
        (clocks, begun),
        lambda pool: _wind_up(pool, futures),
    )
    try:
        with bar, processes as pool:
            for index, (case, name) in enumerate(files.items()):
                trust, source = scenario.trust, str(scenario.path)
                target = out / name
                certify = case in certified
                work = (
                    *(source, scenario.text, trust, scenario.settings),
                    *(case, target, certify, index),
                )
                futures[pool.submit(_work, *work)] = case
            pending = set(futures)
            while pending:
                done, pending = wait(pending, _LOOK_S, FIRST_COMPLETED)
                for future in done:
                    future.result()
                now = min(sum(clocks), total)
                ended = f"{len(futures) - len(pending)} of {len(futures)} cases done"
                under_way = {futures[future] for future in pending}
                for case, runs in zip(files, begun, strict=True):
                    if case in under_way and runs > 1:
                        ended += f", certifying {case} (further run {runs - 1})"
                bar.set_postfix_str(
                    ended if now else "starting (the first start ever compiles)", refresh=False
                )
                bar.update(now - bar.n)
    except KeyboardInterrupt:
        return True
    return False


def _wind_up(pool: ProcessPoolExecutor, futures: dict[Future[None], str]) -> None:
    """Have the processes save their runs as far as they came; told to stop again, end them."""
    ending = workers.processes(pool)
    if stopping.told():
        stopping.say("stopping; saving what was computed (once more gives it up)")
    try:
        for process in ending:
            process.terminate()  # which ends a run as Ctrl-C does
        pool.shutdown(cancel_futures=True)
    except KeyboardInterrupt:
        for process in ending:
            process.kill()
        lost = [case for future, case in futures.items() if not future.done()]
        stopping.say(f"gave up what was not saved: {', '.join(lost) or 'nothing'}")
        with suppress(KeyboardInterrupt):
            pool.shutdown(cancel_futures=True)


_clocks: Any = None
_begun: Any = None
_ending = False
_idle = threading.Lock()
"""Held while a case is being run and saved."""


def _begin(clocks: Any, begun: Any) -> None:
    """Set up a process: told to stop, or without its parent, it saves its run and takes no more."""
    global _clocks, _begun
    _clocks, _begun = clocks, begun
    signal.signal(signal.SIGTERM, _end)
    workers.begin(_save_and_end)


def _save_and_end() -> None:
    """Have the case at hand saved as far as it came."""
    os.kill(os.getpid(), signal.SIGTERM)
    _idle.acquire()


def _end(*_: Any) -> None:
    global _ending
    _ending = True


def _work(
    path: str,
    text: str,
    trust: tuple[str, ...],
    settings: tuple[Setting, ...],
    case: str,
    target: Path,
    certified: bool,
    index: int,
) -> None:
    """Run a case in this process and save it; then certify it."""
    from jointplay.commands import resuming
    from jointplay.scenario import Scenario

    with _idle:
        if _ending:
            return
        scenario = Scenario(text, path, trust, settings)
        prepared = scenario.prepare(case, records=resuming.records(target, certified))
        with _ticking(index) as begin:
            _execute(scenario, case, prepared, target, certified, False, begin)


@contextmanager
def _ticking(index: int) -> Iterator[Callable[[Run], None]]:
    """Tell the parent how far the runs of a case have come; gives what each run is begun with."""
    over = threading.Event()
    runs: list[Run] = []
    past = 0.0

    def tell() -> None:
        _clocks[index] = past + sum(run.workspace.time for run in runs)

    def begin(run: Run) -> None:
        nonlocal past
        if runs:
            past += runs.pop().workspace.time
        run.guards.append(_not_after_the_end)
        run.between.append(lambda: _ending)
        runs.append(run)
        _begun[index] += 1

    def tick() -> None:
        while not over.wait(_LOOK_S):
            tell()

    thread = threading.Thread(target=tick, daemon=True)
    thread.start()
    try:
        yield begin
    finally:
        over.set()
        thread.join()
        tell()


@contextmanager
def _not_after_the_end() -> Iterator[None]:
    """Told to stop before the time loop began, there is nothing to be kept."""
    if _ending:
        raise KeyboardInterrupt
    yield
