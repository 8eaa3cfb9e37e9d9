"""`jointplay run FILE`: all cases of a scenario, in parallel, and the figures that compare them."""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.base import processes, signals, streams
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.files import claim, holds, names_for, refuse_present
from jointplay.base.imports import spare_other_arrays
from jointplay.base.progress import current, printing, whole
from jointplay.base.signals import INTERRUPTED
from jointplay.base.tables import Table, counted, few
from jointplay.simulation.working_files import check_own, working_paths

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.simulation.motion.reference import Motion
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation


STOPPED = 1
SHARED_S = 0.3
"""Runs that take longer [s] have their further runs made by several processes."""
IDLE, IDLE_S = 0.2, 1.0
"""More than this part of a run, and more than this [s], without motion is told of."""


@dataclass(frozen=True)
class CaseRun:
    """A case that is to be run."""

    case: str
    path: Path
    """Of its result."""
    errors: str
    """How numerical errors are found: ``certify``, ``estimate`` or not at all."""
    finished: bool = False
    """Whether its result is there, and only they are missing."""

    @property
    def certified(self) -> bool:
        return self.errors == "certify"

    @property
    def records(self) -> Path:
        return working_paths(self.path)[0]


def run(scenario: Scenario, options: argparse.Namespace) -> int:
    """Run the cases, draw the figures, say how each ended and what came out."""
    from jointplay.show.plots.names import MARK, is_paper_robot
    from jointplay.show.plots.names import file_names as names_of_figures

    if options.figures and options.no_figures:
        raise JointplayError("--figures and --no-figures exclude each other: give one")
    for case in options.case:
        require_known("case", case, scenario.cases)
    cases = [case for case in scenario.cases if not options.case or case in options.case]
    jobs = processes.number_of(options.jobs, cases)
    out, names = Path(options.out), names_for(cases, ".nc")
    drawn: list[str] = []
    if scenario.figures and not options.no_figures:
        robots = (scenario.model(case).robot.urdf for case in cases)
        drawn = names_of_figures(all(map(is_paper_robot, robots)), pdf=options.pdf)
    if not options.resume:
        check_output_folder(out, names, drawn)
    progress = not options.quiet
    items = {}
    lengths, simulations, meant = {}, {}, dict[str, str]()
    ready: list[Run] = []
    remarks: dict[str, list[str]] = {}  # cases by what is said of them
    for case, name in zip(cases, names, strict=True):  # before anything is written
        item = items[case] = CaseRun(case, out / name, _errors(scenario, case, options))
        run = scenario.ready_run(case, progress, item.records, ahead=True)
        if options.beside is not None:
            meant[case] = json.dumps(_meant(run.simulation, Path(options.beside)).describe())
        # What takes long to import is so while another process compiles, if one does.
        from jointplay.simulation.analysis.parts import has_both
        from jointplay.study.certification import number_of_runs

        simulations[case] = run.simulation
        runs = 1 + (number_of_runs(run.simulation) if item.errors else 0)
        length = run.total_steps * run.simulation.step
        # What gives is compared with the ideal mechanism, if no case is it, and without play.
        ideal = _gives(run.simulation) and (len(cases) > 1 or not item.errors)
        lengths[case] = runs * length, length * (ideal + has_both(run.simulation.mechanism))
        for line in _length_and_size(run):
            remarks.setdefault(line, []).append(case)
        ready = [run] if len(cases) == 1 else []
        del run  # and its arrays
    from jointplay.cli.commands import first_notes
    from jointplay.physics.kernel import Status
    from jointplay.scenario.assumptions import decisive
    from jointplay.show import plots
    from jointplay.simulation.analysis.headline import HISTORIES

    spare_other_arrays()
    save = plots.save if drawn else None
    for line in [*first_notes(decisive(scenario, simulations), options.detail), *scenario.notes]:
        streams.note(line)
    for line, of in remarks.items():
        streams.note(line if of == cases else f"case {few(of)}: {line}")
    if options.assumed:
        from jointplay.simulation.values import assumed_table

        tables = {case: assumed_table(simulations[case], scenario.origins(case)) for case in cases}
        for case, table in tables.items():
            print(f"{case}: assumed\n{table}\n")
    done: list[str] = []
    if options.resume:
        claim(out, ())
        for case, item in items.items():
            judged = is_judged(item.path, simulations[case])
            if judged is not None and item.errors and not judged:
                items[case] = replace(item, finished=True)
            elif judged is not None:
                done.append(case)
        for path in (out / name for name in drawn):
            if path.exists() and not holds(path, MARK):
                raise JointplayError(
                    f"{str(path)!r} is not a figure of a run; choose another folder"
                )
    else:
        check_not_interrupted(out, names)
        claim(out, [*names, *drawn])
    streams.release()
    left = [item for case, item in items.items() if case not in done]
    # A long run's histories fill memory; where nothing is drawn, few of them are looked at.
    only = None if drawn else HISTORIES
    made: dict[str, Result] = {}
    summaries = _Summaries(scenario, items, simulations, only, progress, options.detail, made)
    total = sum(lengths[item.case][0] for item in left)
    if all(map(_gives, simulations.values())):
        total += sum(more for _, more in lengths.values())
    with whole(total, progress):
        for case in done:
            summaries.keep(case)
        work = partial(_execute, scenario, options.jobs, progress, ready, made, meant)
        stopped = _run_all(work, left, jobs, summaries)
        summaries.finish()
    results = summaries.results
    drawable = {case: result for case, result in results.items() if len(result.time) > 1}
    if save is not None and drawable:
        short = len(cases) == 1 and not options.figures
        save(drawable, out, options.pdf, summaries.ideals, short)
    print(summaries.ending(out))
    missing = [case for case in cases if case not in results]
    unjudged = [
        case
        for case, result in results.items()
        if items[case].errors and result.status == Status.COMPLETED and not result.certificate
    ]
    bare = [case for case in unjudged if items[case].certified]
    interrupted = any(result.status == Status.INTERRUPTED for result in results.values())
    if interrupted or (stopped and missing + bare):
        there = ", ".join(items[case].path.name for case in results)
        note = f"; there is {there}" if there else ""
        note += f"; without numerical errors: {', '.join(unjudged)}" if unjudged else ""
        note = f"; no result of: {', '.join(missing)}" if missing else note
        print(f"interrupted{note}; the same command with --resume continues", file=sys.stderr)
        return INTERRUPTED
    if stopped:
        print(signals.SAVED, file=sys.stderr)
        if unjudged:
            print(
                f"without numerical errors: {', '.join(unjudged)}; the same command with --resume "
                "finds them",
                file=sys.stderr,
            )
    return 0 if all(r.status == Status.COMPLETED for r in results.values()) else STOPPED


class _Summaries:
    """The results of the cases, kept as files; what came out of each is printed as soon as it can
    be.
    """

    def __init__(
        self,
        scenario: Scenario,
        items: Mapping[str, CaseRun],
        simulations: Mapping[str, Simulation],
        only: Sequence[str] | None,
        progress: bool,
        detail: bool,
        made: dict[str, Result],
    ) -> None:
        self.scenario, self.items, self.simulations = scenario, items, simulations
        self.only, self.progress, self.detail = only, progress, detail
        self.made = made
        """Those that this process has computed; of others there is the file alone."""
        self.results: dict[str, Result] = {}
        """Of the cases that are there, in the order of the scenario once all are."""
        self.ideals: dict[str, Result | None] = {}
        """The ideal mechanism's run that each is measured against."""
        self._printed: set[str] = set()
        self._rows: dict[str, dict[str, str]] = {}
        """Figures of each case, by what they are called."""
        self._ideal = {case for case, one in simulations.items() if not _gives(one)}

        kept_in = next(iter(items.values())).path.parent
        self.recovery = f"completed results are in {str(kept_in)!r}"

    def __contains__(self, case: object) -> bool:
        return case in self.results

    def keep(self, case: str, _: None = None) -> None:
        """It is done. Those are printed whose ideal mechanism is there or is no case's."""
        self._load(case)
        if self._ideal <= set(self.results):
            self._print()
        if (bar := current()) is not None:
            bar.say(f"{len(self.results)} of {len(self.items)} cases done")
            bar.update()

    def finish(self) -> None:
        for case in self.items:
            self._load(case)
        self._print()
        self.results = {case: self.results[case] for case in self.items if case in self.results}

    def _load(self, case: str) -> None:
        from jointplay.simulation.result import thinning
        from jointplay.simulation.result.result import Result

        path = self.items[case].path
        if case in self.results or not path.exists():
            return
        result = self.made.pop(case, None)
        if path.stat().st_size < thinning.LARGE_FILE:
            result = result or Result.load(path)
        else:
            result = Result.load(path, most=thinning.SUMMARY_RECORDS, only=self.only)
        # What was run, rather than built once more from the file, recorded as seldom as this is.
        every = json.loads(result.dataset.attrs["simulation"])["record_every"]
        result.simulation = replace(self.simulations[case], record_every=every)
        self.results[case] = result

    def _print(self) -> None:
        for case, result in self.results.items():
            if case not in self._printed:
                self._printed.add(case)
                text = self._answer(case, result)
                with printing():
                    print(text, flush=True)

    def _answer(self, case: str, result: Result) -> str:
        """What came out of a case: of several the first line of each, and warnings."""
        from jointplay.physics.kernel import Status
        from jointplay.simulation.analysis import is_twin
        from jointplay.simulation.analysis.headline import headline, headline_texts, reference

        ideal = next((other for other in self.results.values() if is_twin(result, other)), None)
        ideal = self.ideals[case] = ideal or reference(result, self.progress)
        lines = headline(result, ideal, self.detail)
        if case in self._ideal or not lines:  # there is no error to begin with
            lines = [result.message, *lines]
        elif result.message not in lines and (self.detail or result.status != Status.COMPLETED):
            lines.append(result.message)
        if self.detail:
            judged = result.judgement
        else:
            judged = "\n".join(f"  warning: {text}" for text in result.audit.warnings)
            if len(self.items) > 1:
                lines = lines[:1] if result.status == Status.COMPLETED else lines
                self._rows[case] = headline_texts(result, ideal)
        answers = "\n  ".join(lines)
        return f"\n{case}: {answers}\n{judged}".rstrip("\n")

    def ending(self, out: Path) -> str:
        """A table of several cases, where the results are, and what to do with them."""
        from jointplay.cli.commands import MORE

        lines = [""]
        if any(self._rows.values()):
            lines += [str(Table.of_texts(_case_rows(self._rows))), ""]
        lines.append(f"results in {out}")
        if self.results:
            shown = next((case for case in self.results if case not in self._ideal), None)
            path = self.items[shown or next(iter(self.results))].path
            more = "" if self.detail else f" {MORE}"
            opened = shlex.join(["jointplay", "play", str(path)])
            lines.append(f"next: {opened}; {shlex.join(['jointplay', 'report', str(out)])}{more}")
        return "\n".join(lines)


def _case_rows(figures: Mapping[str, Mapping[str, str]]) -> list[list[str]]:
    """Rows of a table of cases, the first of heads."""
    heads = list(dict.fromkeys(name for own in figures.values() for name in own))
    rows = [[case, *(own.get(name, "") for name in heads)] for case, own in figures.items() if own]
    return [["case", *heads], *rows]


def _length_and_size(run: Run) -> list[str]:
    """What is said of a run that goes on without moving, or whose records fill the disk."""
    simulation, lines = run.simulation, []
    length = run.total_steps * simulation.step
    ends = math.inf if simulation.motion is None else simulation.motion.still_from
    if length - ends > max(IDLE * length, IDLE_S):
        lines.append(
            f"the motion ends at {ends:g} s: for the other {length - ends:.4g} s of the duration "
            "the machine stands still"
        )
    if run.overflow is not None and run.overflow.needed:
        lines.append(
            f"{counted(run.total_steps // simulation.record_every + 1, 'record')}, one every "
            f"{1e6 * simulation.record_every * simulation.step:g} µs, take "
            f"{run.overflow.bytes / 1e9:.2g} GB on disk while it runs, and the result about as "
            "much (--record-every makes them fewer)"
        )
    return lines


def _meant(simulation: Simulation, path: Path) -> Motion:
    """The motion of a file, with the joints that it leaves out where the run's motion begins."""
    from jointplay.scenario.build import motion_from_file

    if simulation.motion is None:
        raise JointplayError("--beside is for a machine that follows a motion")
    motion, run = motion_from_file(path, None), simulation.motion
    begin = dict(zip(run.joints, run.waypoints[1][0].tolist(), strict=True))
    left = {name: at for name, at in begin.items() if name not in motion.joints}
    whole = replace(simulation, motion=motion, state={**simulation.state, **left}).motion
    assert whole is not None
    return whole


def _gives(simulation: Simulation) -> bool:
    return bool(simulation.mechanism.clearance or simulation.mechanism.gears)


def _errors(scenario: Scenario, case: str, options: argparse.Namespace) -> str:
    integration = scenario.model(case).integration
    if options.certify or integration.certify:
        return "certify"
    return "estimate" if integration.estimate_errors and not options.no_error_estimate else ""


def _execute(
    scenario: Scenario,
    jobs: int | None,
    progress: bool,
    ready: list[Run],
    made: dict[str, Result],
    meant: Mapping[str, str],
    item: CaseRun,
) -> None:
    """Run a case, save it with its scenario, find its errors.

    Args:
        jobs: processes for further runs, if the run took long enough to share them.
        ready: the run, if it has been made ready.
        made: gets the result, if it is in memory.
        meant: motions of --beside by case, as files have them.

    Raises:
        KeyboardInterrupt: told to stop; it is saved as far as it came.
    """
    from jointplay.base.origins import to_text
    from jointplay.physics.kernel import Status
    from jointplay.scenario.overrides import setting_texts
    from jointplay.simulation.checkpoint import check_replaceable, continue_run
    from jointplay.simulation.saving import run_and_save
    from jointplay.simulation.values import values
    from jointplay.study.certification import add_certificate

    run = ready.pop() if ready else scenario.ready_run(item.case, progress, item.records)
    notes = {"scenario": scenario.text, "scenario_file": scenario.path.name}
    notes |= {"title": scenario.title, "case": item.case}
    notes["values"] = to_text(values(run.simulation, scenario.origins(item.case)))
    if item.case in meant:
        notes["beside"] = meant[item.case]
    if scenario.settings:
        notes["settings"] = "\n".join(setting_texts(scenario.settings))
    status, result = Status.COMPLETED, None
    if not item.finished:
        run.label = f"case {item.case} "
        kept = working_paths(item.path)[1]
        if resumed := kept.exists():
            check_replaceable(item.path)
            continue_run(run, kept)
        status, result = run_and_save(run, item.path, progress, notes, overwrite=resumed)
    if result is not None:
        made[item.case] = result
    if item.errors:
        jobs = jobs if run.elapsed > SHARED_S else 1
        add_certificate(
            result, item.path, run.simulation, progress, item.certified, name=item.case, jobs=jobs
        )
    if status == Status.INTERRUPTED or signals.stop_requested():
        raise KeyboardInterrupt


def _run_all(
    work: Callable[[CaseRun], None], items: Sequence[CaseRun], jobs: int, summaries: _Summaries
) -> bool:
    """Run the cases; returns whether it was told to stop."""
    from jointplay.study import Study

    study = Study({item.case: item for item in items}, work, summaries, early=True)
    try:
        with closing(study.outcomes(jobs)) as outcomes:
            for _ in outcomes:
                pass
    except signals.GivenUp as error:
        signals.say(str(error))
        return True
    except KeyboardInterrupt:
        return True
    return False


# `jointplay run --resume`: which runs in a folder are finished, and going on with the others.


def check_not_interrupted(out: Path, names: Iterable[str]) -> None:
    """Refuse a folder with an interrupted run, which would be lost.

    Raises:
        JointplayError: there is one, or another file where one would be kept.
    """
    for name in names:
        check_own(out / name)
        kept = working_paths(out / name)[1]
        if kept.exists():
            raise JointplayError(
                f"{str(out)!r} holds an interrupted run ({kept.name}); --resume continues it, or "
                "choose another folder"
            )


def check_output_folder(out: Path, names: Sequence[str], drawn: Iterable[str] = ()) -> None:
    """Refuse a folder that holds results of a run; of an interrupted one it says how to go on."""
    try:
        refuse_present(out, [*names, *drawn])
    except JointplayError:
        check_not_interrupted(out, names)
        raise


def is_judged(path: Path, simulation: Simulation) -> bool | None:
    """Whether the errors of a result have been looked for; None if it is not there and whole.

    Raises:
        JointplayError: it is of another simulation, or was interrupted and left no checkpoint.
    """
    from jointplay.physics.kernel import Status
    from jointplay.simulation.checkpoint import require_same
    from jointplay.simulation.result.result import Result

    check_own(path)
    if working_paths(path)[1].exists() or not path.exists():
        return None
    with (result := Result.open(path)).dataset as dataset:
        was = json.loads(dataset.attrs["simulation"])
        judged = result.certificate is not None
    require_same(path, was, simulation)
    if result.status == Status.INTERRUPTED:
        raise JointplayError(
            f"{str(path)!r} was interrupted and has no checkpoint; delete it to start again, or "
            "choose another folder"
        )
    return judged
