"""The cases of a scenario run into a folder: all made ready first, then several at a time."""

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
"""Runs that take longer [s] have their further runs made by several processes (judged: to start
some takes about as long)."""
IDLE, IDLE_S = 0.2, 1.0
"""More than this part of a run, and more than this [s], without motion is told of (judged: less is
a rest to settle in)."""


@dataclass
class Case:
    """A case that is to be run."""

    path: Path
    """Of its result."""
    errors: str
    """How numerical errors are found: ``certify``, ``estimate`` or not at all."""
    simulation: Simulation
    """What is run."""
    reference: str = ""
    """The motion beside which the tool is put, as files have it."""
    length_s: float = 0.0
    """Of its runs: simulated, with those for its errors."""
    twins_s: float = 0.0
    """Of those with which it is compared: the ideal mechanism's, and that without play."""
    finished: bool = False
    """Whether its result is there, and only its errors are missing."""
    done: bool = False
    """Whether nothing is missing."""

    @property
    def has_play(self) -> bool:
        """Whether there is play, so that it is compared with the ideal mechanism."""
        return bool(self.simulation.mechanism.clearance or self.simulation.mechanism.gears)


class Cases:
    """The cases of a scenario, and their results, which are kept as files.

    Attributes:
        cases: what is run, by label.
        remarks: cases by what is said of them.
        results: of the cases that are there, in the order of the scenario once all are.
        lines: what came out of each, in sentences.
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
        """Build each case as it is run: what cannot be is said before anything is written.

        Args:
            scenario, names: what is run: all cases, or those named.
            out: folder for the results.
            figures, mark: names of figures that will be drawn into it, and the mark of those that
                may be replaced.
            certify, estimate: whether numerical errors are bounded, or estimated.
            beside: file of the motion as it was meant, where that which is run was corrected.
            resume: continue the interrupted runs in the folder, and keep finished ones.
            jobs: processes; None: one per core.
            detail: whether `lines` have everything that is known.
            progress: show bars on standard error.
            say: called with label and result of each case as it is done.

        Raises:
            JointplayError: no such case, a case that cannot be, or a folder that holds one of the
                files already; of an interrupted run it says how to go on.
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
        """The only case, which need not be made ready twice."""
        self._computed: dict[str, Result] = {}
        """Results that this process has computed; of others there is the file alone."""
        self.results: dict[str, Result] = {}
        self.lines: dict[str, list[str]] = {}
        self.recovery = f"completed results are in {str(self.out)!r}"
        for name in names:
            self._make_ready(name, certify, estimate, beside)
        spare_other_arrays()

    def __getstate__(self) -> dict[str, Any]:
        """For a process that runs a case, where it is no copy of this one."""
        empty: dict[str, Any] = {
            "_ready": None,
            "_computed": {},
            "results": {},
            "_say": None,
        }
        return {**vars(self), **empty}

    def _make_ready(
        self, name: str, certify: bool, estimate: bool, beside: str | Path | None
    ) -> None:
        path = self.out / self._files[name]
        run = self.scenario.ready_run(name, self.progress, working_paths(path)[0], ahead=True)
        # What takes long to import is so while another process compiles, if one does.
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
        # What gives is compared with the ideal mechanism, for errors too, and without play.
        case.twins_s = length * ((case.has_play and not errors) + has_both(simulation.mechanism))
        for line in _length_and_size(run):
            self.remarks.setdefault(line, []).append(name)
        self.cases[name] = case
        self._ready = run if len(self._files) == 1 else None

    @property
    def notes(self) -> list[str]:
        """What to know of runs whose length or size may surprise."""
        labels = [*self.cases]
        return [
            line if cases == labels else f"case {few(cases)}: {line}"
            for line, cases in self.remarks.items()
        ]

    def claim_folder(self) -> None:
        """Make sure that results can be written; to resume, find out which are there."""
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
        """Run what is not done, several cases at a time; returns whether it was told to stop."""
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
        """Run a case, save it with its scenario, find its errors; in another process, maybe.

        Raises:
            KeyboardInterrupt: told to stop; it is saved as far as it came.
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

    # Results as they come: the store of the study.

    def __contains__(self, name: object) -> bool:
        return name in self.results

    def keep(self, name: str, _: None = None) -> None:
        self._load(name)
        self._say_lines()
        if (bar := current()) is not None:
            bar.say(f"{len(self.results)} of {len(self.cases)} cases done")
            bar.update()

    def _load(self, name: str) -> None:
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
            # A long run's histories fill memory; where nothing is drawn, few of them are looked at.
            only = None if self.figures else HISTORIES
            result = Result.load(path, most=thinning.SUMMARY_RECORDS, only=only)
        # What was run, rather than built once more from the file, recorded as seldom as this is.
        interval = json.loads(result.dataset.attrs["simulation"])["record_every"]
        result.simulation = replace(self.cases[name].simulation, record_every=interval)
        self.results[name] = result

    def _say_lines(self) -> None:
        from jointplay.simulation.analysis.headline import headline

        for name, result in self.results.items():
            if name in self.lines:
                continue
            self.lines[name] = headline(result, self._detail) or [result.message]
            if self._say is not None:
                self._say(name, result)

    def data(self) -> dict[str, Any]:
        """What came out of each case: its measures, their units, errors and inputs."""
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
    """What is said of a run that goes on without moving, or whose records fill the disk."""
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
    """The motion of a file, with the joints that it leaves out where the run's motion begins."""
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
        JointplayError: there is one, or another file where one would be kept.
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
    """Refuse a folder that holds results of a run; of an interrupted one it says how to go on."""
    try:
        refuse_present(out, [*names, *figures])
    except JointplayError:
        check_not_interrupted(out, names)
        raise


def _is_judged(path: Path, simulation: Simulation) -> bool | None:
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
        stored = json.loads(dataset.attrs["simulation"])
        judged = result.certificate is not None
    require_same(path, stored, simulation)
    if result.status == Status.INTERRUPTED:
        raise JointplayError(
            f"{str(path)!r} was interrupted and has no checkpoint; delete it to start again, or "
            "choose another folder"
        )
    return judged
