"""Runs of a scenario's cases into a folder: all are prepared first, then run several at a time."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import processes, signals
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.files import claim, holds, names_for, refuse_present
from jointplay.base.imports import spare_other_arrays
from jointplay.base.progress import current, overall
from jointplay.base.tables import counted, few
from jointplay.simulation.working_files import check_own, working_paths

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.simulation.motion.reference import Motion
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation

SHARED_S = 0.3
"""Runs that take longer have their further runs made by several processes [s] (judged: starting
some takes about as long)."""
IDLE, IDLE_S = 0.2, 1.0
"""A note is given if a run has no motion for more than this part of it, and for more than this time
[s] (judged: less is a rest to settle in)."""


@dataclass
class Case:
    """A case of the scenario, and how far it has been run."""

    path: Path
    """File of its result."""
    errors: str
    """How numerical errors are found: ``certify``, ``estimate``, or empty for not at all."""
    simulation: Simulation
    reference: str = ""
    """The motion with which the tool's is compared, as a result's file has it; empty: its own."""
    length_s: float = 0.0
    """Simulated time of its runs, with those for its numerical errors [s]."""
    twins_s: float = 0.0
    """Simulated time of the twins it is compared with: the ideal one, and that without play [s]."""
    finished: bool = False
    """Whether its result is there; its numerical errors may be missing."""
    done: bool = False
    """Whether nothing is missing."""

    @property
    def has_play(self) -> bool:
        """Whether there is play, so that it is compared with the ideal mechanism."""
        return bool(self.simulation.mechanism.clearance or self.simulation.mechanism.gears)


class Cases:
    """The cases of a scenario, and the store of their results, which are files in a folder.

    Attributes:
        cases: the cases to run, by label.
        remarks: notes on runs, each with the labels of the cases that it is about.
        results: results by label, in the order of the scenario once all are there.
        lines: the outcome of each case, in sentences.
    """

    def __init__(
        self,
        scenario: Scenario,
        out: str | Path,
        names: Sequence[str] = (),
        *,
        figures: Sequence[str] = (),
        mark: str = "",
        certify: bool = False,
        estimate: bool = True,
        beside: str | Path | None = None,
        resume: bool = False,
        jobs: int | None = None,
        detail: bool = False,
        progress: bool = False,
        say: Callable[[str, Result], None] | None = None,
    ) -> None:
        """Prepare each case as it will be run, so that errors arise before anything is written.

        Args:
            scenario: the scenario.
            names: cases to run; none: all.
            out: folder for the results.
            figures, mark: names of figures that will be drawn into it, and the mark of those that
                may be replaced.
            certify: state the numerical errors of all cases as a strict certificate does.
            estimate: estimate them, where the scenario does not say otherwise.
            beside: file of the intended motion, where the one that is run was corrected.
            resume: continue the interrupted runs in the folder, and keep finished ones.
            jobs: processes; None: one per core.
            detail: whether `lines` have everything that is known.
            progress: show bars on standard error.
            say: called with label and result of each case as it is done.

        Raises:
            JointplayError: no such case, a case that cannot be built, or a folder that already
                holds one of the files; if it holds an interrupted run, says how to continue it.
        """
        for name in names:
            require_known("case", name, scenario.cases)
        self.scenario, self.progress, self.resume = scenario, progress, resume
        names = [name for name in scenario.cases if not names or name in names]
        self.jobs, self._asked_jobs = processes.number_of(jobs, names), jobs
        self.out, self.figures, self._mark = Path(out), list(figures), mark
        self._files = dict(zip(names, names_for(names, ".nc"), strict=True))
        if not resume:
            check_output_folder(self.out, [*self._files.values()], self.figures)
        self._detail, self._say = detail, say
        self.cases: dict[str, Case] = {}
        self.remarks: dict[str, list[str]] = {}
        self._ready: Run | None = None
        """The prepared run, if there is only one case, so that it is not prepared twice."""
        self._computed: dict[str, Result] = {}
        """Results that this process has computed; those of other processes are files only."""
        self.results: dict[str, Result] = {}
        self.lines: dict[str, list[str]] = {}
        self.recovery = f"completed results are in {str(self.out)!r}"
        for name in names:
            self._make_ready(name, certify, estimate, beside)
        spare_other_arrays()

    def __getstate__(self) -> dict[str, Any]:
        """State for a process that runs a case and is not forked from this one: without runs and
        results, which only this process needs.
        """
        return {**vars(self), "_ready": None, "_computed": {}, "results": {}, "_say": None}

    def _make_ready(
        self, name: str, certify: bool, estimate: bool, beside: str | Path | None
    ) -> None:
        """Prepare a case's run, and note how it will be run and for how long."""
        path = self.out / self._files[name]
        run = self.scenario.ready_run(name, self.progress, working_paths(path)[0], ahead=True)
        # These imports take long; `ahead` may have another process compile the kernel meanwhile.
        from jointplay.simulation.analysis.parts import has_both
        from jointplay.study.certification import number_of_runs

        simulation, integration = run.simulation, self.scenario.model(name).integration
        errors = "estimate" if integration.estimate_errors and estimate else ""
        errors = "certify" if certify or integration.certify else errors
        case = Case(path, errors, simulation)
        if beside is not None:
            case.reference = json.dumps(_reference_motion(simulation, Path(beside)).describe())
        length = run.total_steps * simulation.step
        case.length_s = length * (1 + (number_of_runs(simulation) if errors else 0))
        # A machine with play is compared with the ideal one, whose run the errors have made
        # already; one with play and elasticity also with the one without play.
        case.twins_s = length * ((case.has_play and not errors) + has_both(simulation.mechanism))
        for line in _length_and_size(run):
            self.remarks.setdefault(line, []).append(name)
        self.cases[name] = case
        self._ready = run if len(self._files) == 1 else None

    @property
    def notes(self) -> list[str]:
        """Notes on runs whose length or size may surprise."""
        labels = [*self.cases]
        return [
            line if cases == labels else f"case {few(cases)}: {line}"
            for line, cases in self.remarks.items()
        ]

    def claim_folder(self) -> None:
        """Claim the folder for writing; to resume, find out which results are there."""
        if not self.resume:
            check_not_interrupted(self.out, self._files.values())
            claim(self.out, [*self._files.values(), *self.figures])
            return
        claim(self.out, ())
        for case in self.cases.values():
            judged = _is_judged(case.path, case.simulation)
            case.finished = judged is not None
            case.done = case.finished and (bool(judged) or not case.errors)
        for path in (self.out / name for name in self.figures):
            if path.exists() and not holds(path, self._mark):
                raise JointplayError(
                    f"{str(path)!r} is not a figure of a run; choose another folder"
                )

    def run(self) -> bool:
        """Run the cases that are not done, several at a time; returns whether told to stop."""
        from jointplay.study import Study

        pending = [name for name, case in self.cases.items() if not case.done]
        total = sum(self.cases[name].length_s for name in pending)
        total += sum(case.twins_s for case in self.cases.values())
        stopped = False
        with overall(total, self.progress):
            for name in self.cases:
                if name not in pending:
                    self.keep(name)
            study = Study(dict(zip(pending, pending, strict=True)), self.execute, self, early=True)
            try:
                with closing(study.outcomes(self.jobs)) as outcomes:
                    for _ in outcomes:
                        pass
            except signals.GivenUp as error:
                signals.say(str(error))
                stopped = True
            except KeyboardInterrupt:
                stopped = True
            for name in self.cases:
                self._load(name)
            self._say_lines()
        self.results = {name: self.results[name] for name in self.cases if name in self.results}
        return stopped

    def execute(self, name: str) -> None:
        """Run a case, save it with its scenario, and find its errors: the measure of the study,
        which may run in another process.

        Raises:
            KeyboardInterrupt: told to stop; the run is saved as far as it came.
        """
        from jointplay.base.origins import to_text
        from jointplay.physics.kernel import Status
        from jointplay.scenario.reading import setting_texts
        from jointplay.simulation.checkpoint import check_replaceable, continue_run
        from jointplay.simulation.saving import run_and_save
        from jointplay.simulation.values import values
        from jointplay.study.certification import add_errors

        scenario, progress, case = self.scenario, self.progress, self.cases[name]
        records, checkpoint = working_paths(case.path)
        run, self._ready = self._ready, None
        run = run or scenario.ready_run(name, progress, records)
        # The result's file holds all that it was made from.
        notes = {"scenario": scenario.text, "scenario_file": scenario.path.name}
        notes |= {"title": scenario.title, "case": name}
        notes["values"] = to_text(values(run.simulation, scenario.origins(name)))
        if case.reference:
            notes["beside"] = case.reference
        if scenario.settings:
            notes["settings"] = "\n".join(setting_texts(scenario.settings))
        status, result = Status.COMPLETED, None
        if not case.finished:
            run.label = f"case {name} "
            if resumed := checkpoint.exists():
                check_replaceable(case.path)
                continue_run(run, checkpoint)
            status, result = run_and_save(run, case.path, progress, notes, overwrite=resumed)
        if result is not None:
            self._computed[name] = result
        jobs = self._asked_jobs if run.elapsed > SHARED_S else 1
        add_errors(result, case.path, run.simulation, progress, case.errors, name=name, jobs=jobs)
        if status == Status.INTERRUPTED or signals.stop_requested():
            raise KeyboardInterrupt

    # The store of the study: results as they come.

    def __contains__(self, name: object) -> bool:
        return name in self.results

    def keep(self, name: str, _: None = None) -> None:
        self._load(name)
        self._say_lines()
        if (bar := current()) is not None:
            bar.say(f"{len(self.results)} of {len(self.cases)} cases done")
            bar.update()

    def _load(self, name: str) -> None:
        """Add the result of a case to `results`, from memory or from its file, if it is there."""
        from jointplay.simulation.analysis.headline import HISTORIES
        from jointplay.simulation.result import thinning
        from jointplay.simulation.result.result import Result

        path = self.cases[name].path
        if name in self.results or not path.exists():
            return
        result = self._computed.pop(name, None)
        if path.stat().st_size < thinning.LARGE_FILE:
            result = result or Result.load(path)
        else:
            # A long run's histories fill memory; where nothing is drawn, few of them are read.
            only = None if self.figures else HISTORIES
            result = Result.load(path, most=thinning.SUMMARY_RECORDS, only=only)
        # The simulation that was run serves, and need not be built again from the file; only its
        # recording interval is that of the result, which may have been thinned.
        interval = json.loads(result.dataset.attrs["simulation"])["record_every"]
        result.simulation = replace(self.cases[name].simulation, record_every=interval)
        self.results[name] = result

    def _say_lines(self) -> None:
        """Make the lines of new results, and tell the caller."""
        from jointplay.simulation.analysis.headline import headline

        for name, result in self.results.items():
            if name in self.lines:
                continue
            self.lines[name] = headline(result, self._detail) or [result.message]
            if self._say is not None:
                self._say(name, result)

    def data(self) -> dict[str, Any]:
        """The outcome of each case as plain data: measures, units, errors, and input values."""
        from jointplay.simulation.analysis import deviation, has_tool_error
        from jointplay.simulation.values import values
        from jointplay.study.measures import measure, rests_of, shipped

        answers = {}
        for name, result in self.results.items():
            measures = {}
            if len(result.time) > 1:
                rests = rests_of(result.simulation.motion, float(result.time[-1]))
                error = deviation(result) if has_tool_error(result) else None
                measures = measure(result, error, result.joints, rests)
            units = {key: unit for key, (unit, _) in shipped(result.joints).items()}
            certificate = result.certificate
            figures = certificate.headline if certificate else []
            answers[name] = {
                "answer": self.lines[name][0],
                "further": self.lines[name][1:],
                "status": result.message,
                "file": str(self.cases[name].path),
                "measures": {
                    key: {"value": value, "unit": units[key]}
                    for key, value in measures.items()
                    if key in units
                },
                "figures": [vars(figure) for figure in figures],
                "warnings": result.audit.warnings,
                "values": values(result.simulation, self.scenario.origins(name), merged=False),
            }
        return {"cases": answers, "notes": [*self.scenario.assumptions, *self.scenario.notes]}


def _length_and_size(run: Run) -> list[str]:
    """Notes on a run that goes on after its motion has ended, or whose records fill the disk."""
    simulation, lines = run.simulation, []
    length = run.total_steps * simulation.step
    end = math.inf if simulation.motion is None else simulation.motion.still_from
    if length - end > max(IDLE * length, IDLE_S):
        lines.append(
            f"the motion ends at {end:g} s: for the other {length - end:.4g} s of the duration "
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


def _reference_motion(simulation: Simulation, path: Path) -> Motion:
    """The motion of a file; joints that it leaves out stay where the run's motion begins."""
    from jointplay.scenario.build import motion_from_file

    if simulation.motion is None:
        raise JointplayError("--beside is for a machine that follows a motion")
    motion, run = motion_from_file(path, None), simulation.motion
    start = dict(zip(run.joints, run.waypoints[1][0].tolist(), strict=True))
    held_joints = {name: position for name, position in start.items() if name not in motion.joints}
    reference = replace(simulation, motion=motion, state={**simulation.state, **held_joints}).motion
    assert reference is not None
    return reference


def check_not_interrupted(out: Path, names: Iterable[str]) -> None:
    """Refuse a folder with an interrupted run, which would be lost.

    Raises:
        JointplayError: there is one, or a file of another program where its files would be.
    """
    for name in names:
        check_own(out / name)
        checkpoint = working_paths(out / name)[1]
        if checkpoint.exists():
            raise JointplayError(
                f"{str(out)!r} holds an interrupted run ({checkpoint.name}); --resume continues "
                "it, or choose another folder"
            )


def check_output_folder(out: Path, names: Sequence[str], figures: Iterable[str] = ()) -> None:
    """Refuse a folder that holds results; if a run was interrupted, say how to continue it."""
    try:
        refuse_present(out, [*names, *figures])
    except JointplayError:
        check_not_interrupted(out, names)
        raise


def _is_judged(path: Path, simulation: Simulation) -> bool | None:
    """Whether a result's file has a certificate of its errors; None: there is no complete result.

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
        stored = json.loads(dataset.attrs["simulation"])
        judged = result.certificate is not None
    require_same(path, stored, simulation)
    if result.status == Status.INTERRUPTED:
        raise JointplayError(
            f"{str(path)!r} was interrupted and has no checkpoint; delete it to start again, or "
            "choose another folder"
        )
    return judged
