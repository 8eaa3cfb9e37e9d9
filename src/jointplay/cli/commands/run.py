"""`jointplay run`: simulate one robot, or the cases of a scenario file.

Simulate all cases of a scenario file, or one robot with clearance in the joints named, and draw
figures that compare the cases, or an overview of one. Without FILE or ROBOT: the SCARA arm under
gravity, 0.2 mm in joint B, 3 s. Options override FILE.

DIR receives result.nc, or a .nc for each case (read it with jointplay.Result.load or any NetCDF
reader), and the figures as .png.
"""

from __future__ import annotations

import argparse
import json
import math
import shlex
import sys
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jointplay.base import processes, signals, streams
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.files import claim, holds, names_for, refuse_present
from jointplay.base.imports import spare_other_arrays
from jointplay.base.progress import current, overall, printing
from jointplay.base.signals import INTERRUPTED
from jointplay.base.tables import Table, counted, few
from jointplay.cli.commands import MORE, first_notes, inputs, print_json
from jointplay.cli.commands.inputs import is_scenario, scenario_of
from jointplay.cli.options import FLAG, REPEATED, Parser
from jointplay.simulation.working_files import check_own, working_paths

if TYPE_CHECKING:
    from jointplay.scenario import Scenario
    from jointplay.simulation.motion.reference import Motion
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation


STOPPED = 1
SHARED_S = 0.3
"""Runs that take longer [s] have their further runs made by several processes (judged: to start
some takes about as long)."""
IDLE, IDLE_S = 0.2, 1.0
"""More than this part of a run, and more than this [s], without motion is told of (judged: less is
a rest to settle in)."""


# fmt: off
def declare(parser: Parser) -> None:
    inputs.declare(parser)
    add = parser.add_argument
    add("--out", metavar="DIR", required=True, help="folder for the results")
    add("--case", metavar="NAME", **REPEATED, help="run only this case of FILE")
    add("--beside", metavar="FILE", help="the motion as it was meant, where the one that is run "
        "was corrected: the tool's error is its distance from the ideal mechanism's on that")
    add = parser.add_argument_group("integration and output").add_argument
    add("--certify", **FLAG, help="repeat the run with finer steps to give the headline figures "
        "numerical error bounds; takes about two and a half times as long")
    add("--no-error-estimate", **FLAG, help="leave out the further runs that estimate the "
        "numerical errors of the headline figures")
    add("--resume", **FLAG, help="continue the interrupted runs in DIR, bit for bit; finished ones "
        "are kept")
    add("--figures", **FLAG, help="draw all figures of a single case, too: the tool's motion and "
        "path, orbits, forces")
    add("--no-figures", **FLAG, help="do not draw figures")
    add("--pdf", **FLAG, help="draw each figure as .pdf, too")
    add("--assumed", **FLAG, help="list what nobody gave: values, by which rule, and what another "
        "would change")
    parser.share("--json", "--jobs", "--detail", "--quiet")
# fmt: on


def run(options: argparse.Namespace) -> int:
    """Make all cases ready, say what was assumed, run what is not done, draw, say what came out."""
    from jointplay.scenario.robot import LABEL

    if options.figures and options.no_figures:
        raise JointplayError("--figures and --no-figures exclude each other: give one")
    if not options.resume and not is_scenario(options):
        check_output_folder(Path(options.out), [f"{LABEL}.nc"])
    cases = Cases(scenario_of(options), options)
    cases.make_ready()
    cases.say_assumptions()
    cases.claim_folder()
    streams.release()
    stopped = cases.run()
    cases.draw()
    if options.json:
        print_json(options, cases.data())
    print(cases.ending())
    return cases.status(stopped)


@dataclass
class Case:
    """A case that is to be run."""

    path: Path
    """Of its result."""
    errors: str
    """How numerical errors are found: ``certify``, ``estimate`` or not at all."""
    simulation: Simulation
    """What is run, once it has been made ready."""
    meant: str = ""
    """The motion of --beside, as files have it."""
    length_s: float = 0.0
    """Of its runs: simulated, with those for its errors."""
    twins_s: float = 0.0
    """Of those beside which it is put: the ideal mechanism's, and that without play."""
    finished: bool = False
    """Whether its result is there, and only its errors are missing."""
    done: bool = False
    """Whether nothing is missing."""

    @property
    def gives(self) -> bool:
        """Whether there is play, so that it is compared with the ideal mechanism."""
        return bool(self.simulation.mechanism.clearance or self.simulation.mechanism.gears)


class Cases:
    """The cases of a scenario, what is run of them, and their results, which are kept as files.

    What came out of each is printed as soon as the ideal mechanism is there that it is put beside.
    """

    def __init__(self, scenario: Scenario, options: argparse.Namespace) -> None:
        from jointplay.show.plots.names import file_names, is_paper_robot

        self.scenario, self.options, self.progress = scenario, options, not options.quiet
        for name in options.case:
            require_known("case", name, scenario.cases)
        names = [name for name in scenario.cases if not options.case or name in options.case]
        self.jobs = processes.number_of(options.jobs, names)
        self.out = Path(options.out)
        self.files = dict(zip(names, names_for(names, ".nc"), strict=True))
        self.figures: list[str] = []
        """Names of the figures that are drawn."""
        if scenario.figures and not options.no_figures:
            robots = (scenario.model(name).robot.urdf for name in names)
            self.figures = file_names(all(map(is_paper_robot, robots)), pdf=options.pdf)
        if not options.resume:
            check_output_folder(self.out, [*self.files.values()], self.figures)
        self.cases: dict[str, Case] = {}
        self.remarks: dict[str, list[str]] = {}
        """Cases by what is said of them."""
        self.ready: Run | None = None
        """The only case, which need not be made ready twice."""
        self.computed: dict[str, Result] = {}
        """Results that this process has computed; of others there is the file alone."""
        self.results: dict[str, Result] = {}
        """Of the cases that are there, in the order of the scenario once all are."""
        self.ideals: dict[str, Result | None] = {}
        """The ideal mechanism's run that each is measured against."""
        self.recovery = f"completed results are in {str(self.out)!r}"
        self._printed: set[str] = set()
        self._rows: dict[str, dict[str, str]] = {}
        """Figures of each case, by what they are called."""
        self._lines: dict[str, list[str]] = {}
        """What came out of each."""

    def __getstate__(self) -> dict[str, Any]:
        """For a process that runs a case, where it is no copy of this one."""
        return {**vars(self), "ready": None, "computed": {}, "results": {}, "ideals": {}}

    def make_ready(self) -> None:
        """Build each case as it is run: what cannot be is said before anything is written."""
        for name, file in self.files.items():
            path = self.out / file
            run = self.scenario.ready_run(name, self.progress, working_paths(path)[0], ahead=True)
            # What takes long to import is so while another process compiles, if one does.
            from jointplay.simulation.analysis.parts import has_both
            from jointplay.study.certification import number_of_runs

            simulation = run.simulation
            case = Case(path, self._errors(name), simulation)
            if self.options.beside is not None:
                meant = _meant(simulation, Path(self.options.beside))
                case.meant = json.dumps(meant.describe())
            length = run.total_steps * simulation.step
            runs = 1 + (number_of_runs(simulation) if case.errors else 0)
            case.length_s = runs * length
            # What gives is compared with the ideal mechanism, if no case is it, and without play.
            ideal = case.gives and (len(self.files) > 1 or not case.errors)
            case.twins_s = length * (ideal + has_both(simulation.mechanism))
            for line in _length_and_size(run):
                self.remarks.setdefault(line, []).append(name)
            self.cases[name] = case
            self.ready = run if len(self.files) == 1 else None
            del run  # and its arrays
        spare_other_arrays()

    def _errors(self, name: str) -> str:
        integration, options = self.scenario.model(name).integration, self.options
        if options.certify or integration.certify:
            return "certify"
        return "estimate" if integration.estimate_errors and not options.no_error_estimate else ""

    def say_assumptions(self) -> None:
        from jointplay.scenario.assumptions import decisive

        simulations = {name: case.simulation for name, case in self.cases.items()}
        lines = first_notes(decisive(self.scenario, simulations), self.options.detail)
        for line in [*lines, *self.scenario.notes]:
            streams.note(line)
        for line, of in self.remarks.items():
            streams.note(line if of == [*self.cases] else f"case {few(of)}: {line}")
        if self.options.assumed:
            from jointplay.simulation.values import assumed_table

            origins = self.scenario.origins
            for name, simulation in simulations.items():
                print(f"{name}: assumed\n{assumed_table(simulation, origins(name))}\n")

    def claim_folder(self) -> None:
        """Make sure that results can be written; with --resume, find out which are there."""
        from jointplay.show.plots.names import MARK

        if not self.options.resume:
            check_not_interrupted(self.out, self.files.values())
            claim(self.out, [*self.files.values(), *self.figures])
            return
        claim(self.out, ())
        for case in self.cases.values():
            judged = is_judged(case.path, case.simulation)
            case.finished = judged is not None
            case.done = case.finished and (bool(judged) or not case.errors)
        for path in (self.out / name for name in self.figures):
            if path.exists() and not holds(path, MARK):
                raise JointplayError(
                    f"{str(path)!r} is not a figure of a run; choose another folder"
                )

    def run(self) -> bool:
        """Run what is not done, several cases at a time; returns whether it was told to stop."""
        from jointplay.study import Study

        left = [name for name, case in self.cases.items() if not case.done]
        total = sum(self.cases[name].length_s for name in left)
        if all(case.gives for case in self.cases.values()):
            total += sum(case.twins_s for case in self.cases.values())
        stopped = False
        with overall(total, self.progress):
            for name in self.cases:
                if name not in left:
                    self.keep(name)
            study = Study(dict(zip(left, left, strict=True)), self.execute, self, early=True)
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
            self._print()
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
        from jointplay.study.certification import add_certificate

        scenario, progress, case = self.scenario, self.progress, self.cases[name]
        records, kept = working_paths(case.path)
        run, self.ready = self.ready, None
        run = run or scenario.ready_run(name, progress, records)
        notes = {"scenario": scenario.text, "scenario_file": scenario.path.name}
        notes |= {"title": scenario.title, "case": name}
        notes["values"] = to_text(values(run.simulation, scenario.origins(name)))
        if case.meant:
            notes["beside"] = case.meant
        if scenario.settings:
            notes["settings"] = "\n".join(setting_texts(scenario.settings))
        status, result = Status.COMPLETED, None
        if not case.finished:
            run.label = f"case {name} "
            if resumed := kept.exists():
                check_replaceable(case.path)
                continue_run(run, kept)
            status, result = run_and_save(run, case.path, progress, notes, overwrite=resumed)
        if result is not None:
            self.computed[name] = result
        if case.errors:
            jobs = self.options.jobs if run.elapsed > SHARED_S else 1
            add_certificate(
                result, case.path, run.simulation, progress, case.errors == "certify",
                name=name, jobs=jobs,
            )  # fmt: skip
        if status == Status.INTERRUPTED or signals.stop_requested():
            raise KeyboardInterrupt

    # Results as they come: the store of the study.

    def __contains__(self, name: object) -> bool:
        return name in self.results

    def keep(self, name: str, _: None = None) -> None:
        """It is done. Those are printed whose ideal mechanism is there or is no case's."""
        self._load(name)
        if {name for name, case in self.cases.items() if not case.gives} <= set(self.results):
            self._print()
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
        result = self.computed.pop(name, None)
        if path.stat().st_size < thinning.LARGE_FILE:
            result = result or Result.load(path)
        else:
            # A long run's histories fill memory; where nothing is drawn, few of them are looked at.
            only = None if self.figures else HISTORIES
            result = Result.load(path, most=thinning.SUMMARY_RECORDS, only=only)
        # What was run, rather than built once more from the file, recorded as seldom as this is.
        every = json.loads(result.dataset.attrs["simulation"])["record_every"]
        result.simulation = replace(self.cases[name].simulation, record_every=every)
        self.results[name] = result

    def _print(self) -> None:
        for name, result in self.results.items():
            if name not in self._printed:
                self._printed.add(name)
                text = self._answer(name, result)
                with printing():
                    print(text, flush=True)

    def _answer(self, name: str, result: Result) -> str:
        """What came out of a case: of several the first line of each, and warnings."""
        from jointplay.physics.kernel import Status
        from jointplay.simulation.analysis import is_twin
        from jointplay.simulation.analysis.headline import headline, headline_texts, reference

        detail = self.options.detail
        ideal = next((other for other in self.results.values() if is_twin(result, other)), None)
        ideal = self.ideals[name] = ideal or reference(result, self.progress)
        lines = headline(result, ideal, detail)
        self._lines[name] = lines or [result.message]
        if not self.cases[name].gives or not lines:  # there is no error to begin with
            lines = [result.message, *lines]
        elif result.message not in lines and (detail or result.status != Status.COMPLETED):
            lines.append(result.message)
        if detail:
            judged = result.judgement
        else:
            judged = "\n".join(f"  warning: {text}" for text in result.audit.warnings)
            if len(self.cases) > 1:
                lines = lines[:1] if result.status == Status.COMPLETED else lines
                self._rows[name] = headline_texts(result, ideal)
        answers = "\n  ".join(lines)
        return f"\n{name}: {answers}\n{judged}".rstrip("\n")

    def draw(self) -> None:
        from jointplay.show import plots

        drawable = {n: result for n, result in self.results.items() if len(result.time) > 1}
        if self.figures and drawable:
            short = len(self.cases) == 1 and not self.options.figures
            plots.save(drawable, self.out, self.options.pdf, self.ideals, short)

    def data(self) -> dict[str, Any]:
        """What came out of each case, for JSON: its measures, their units, errors and inputs."""
        from jointplay.simulation.values import values
        from jointplay.study.measures import measure, rests_of, shipped

        answers = {}
        for name, result in self.results.items():
            measures = {}
            if len(result.time) > 1:
                rests = rests_of(result.simulation.motion, float(result.time[-1]))
                ideal = self.ideals[name] if self.cases[name].gives else None
                measures = measure(result, ideal, result.joints, rests)
            units = {key: unit for key, (unit, _) in shipped(result.joints).items()}
            certificate = result.certificate
            figures = certificate.headline if certificate else []
            answers[name] = {
                "answer": self._lines[name][0],
                "further": self._lines[name][1:],
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

    def ending(self) -> str:
        """A table of several cases, where the results are, and what to do with them."""
        lines = [""]
        if rows := {name: row for name, row in self._rows.items() if row}:
            heads = list(dict.fromkeys(head for row in rows.values() for head in row))
            texts = [[name, *(row.get(head, "") for head in heads)] for name, row in rows.items()]
            lines += [str(Table.of_texts([["case", *heads], *texts])), ""]
        lines.append(f"results in {self.out}")
        if self.results:
            loose = (name for name in self.results if self.cases[name].gives)
            path = self.cases[next(loose, next(iter(self.results)))].path
            more = "" if self.options.detail else f" {MORE}"
            opened = shlex.join(["jointplay", "play", str(path)])
            report = shlex.join(["jointplay", "report", str(self.out)])
            lines.append(f"next: {opened}; {report}{more}")
        return "\n".join(lines)

    def status(self, stopped: bool) -> int:
        """The exit status; says what is missing."""
        from jointplay.physics.kernel import Status

        results = self.results
        missing = [name for name in self.cases if name not in results]
        unjudged = [
            name
            for name, result in results.items()
            if self.cases[name].errors
            and result.status == Status.COMPLETED
            and not result.certificate
        ]
        bare = [name for name in unjudged if self.cases[name].errors == "certify"]
        interrupted = any(result.status == Status.INTERRUPTED for result in results.values())
        if interrupted or (stopped and missing + bare):
            there = ", ".join(self.cases[name].path.name for name in results)
            note = f"; there is {there}" if there else ""
            note += f"; without numerical errors: {', '.join(unjudged)}" if unjudged else ""
            note = f"; no result of: {', '.join(missing)}" if missing else note
            print(f"interrupted{note}; the same command with --resume continues", file=sys.stderr)
            return INTERRUPTED
        if stopped:
            print(signals.SAVED, file=sys.stderr)
            if unjudged:
                print(
                    f"without numerical errors: {', '.join(unjudged)}; the same command with "
                    "--resume finds them",
                    file=sys.stderr,
                )
        return 0 if all(r.status == Status.COMPLETED for r in results.values()) else STOPPED


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
