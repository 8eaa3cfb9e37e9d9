"""A run: a simulation made ready to step, that can be held, watched and continued.

`prepare` makes the tables and arrays, `statics` finds the equilibrium in which the run begins.
From there the run goes in stretches: a `TimeLoop` steps until something is due (a payload, a sample
of a controller, a new block of the reference table, a look at the contacts), what is due is done,
and the next stretch begins. Records are made into a `Result` at the end (`result.histories`).
"""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base import signals
from jointplay.base.errors import (
    JointplayError,
    JointplayWarning,
    require_a,
    require_known,
    require_positive,
    require_vector,
    require_whole,
)
from jointplay.base.progress import Simulated
from jointplay.base.schema import known_keywords
from jointplay.base.tables import counted, few
from jointplay.model.impact import tooth_duration
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import Coordinate
from jointplay.physics.kernel import Status
from jointplay.simulation import acting, checkpoint, initial, step_check, time_loop
from jointplay.simulation.acting import Events, LoadSchedule
from jointplay.simulation.base_chart import BaseChart
from jointplay.simulation.initial import named
from jointplay.simulation.judging import Judging
from jointplay.simulation.loads.drive import assign
from jointplay.simulation.prepare import CHUNK, Prepared, prepare
from jointplay.simulation.result.histories import compile_histories, histories
from jointplay.simulation.result.variables import Phase, Records
from jointplay.simulation.spool import DiskRecords, Overflow, PassedRecords
from jointplay.simulation.statics import Rest, StaticLoads

if TYPE_CHECKING:
    from jointplay.simulation.result.result import Result
    from jointplay.simulation.simulation import Simulation


@dataclass(frozen=True)
class Moment:
    """State and contact forces of a run at one instant, as copies.

    Its methods raise `MissingName` for names that do not exist.
    """

    time: float
    """Simulated time [s]."""
    step: int
    """Number of steps done."""
    q: np.ndarray
    """Generalised coordinates, in the order of `coordinates`, shape (nq,) [rad or m]."""
    v: np.ndarray
    """Generalised velocities, shape (nv,) [rad/s or m/s]."""
    mechanism: Mechanism
    poses: np.ndarray
    """Pose of each journal in its bearing's frame: centre (3) [m], then orientation row by row (9);
    shape (nj, 12)."""
    wrenches: np.ndarray
    """Force on each journal [N] and moment about its centre [N m], bearing axes, (nj, 6)."""
    normal_forces: np.ndarray
    """Normal force of each joint's contacts, 0 where nothing touches, (nj, contacts) [N]."""

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        return tuple(self.mechanism.coordinates)

    def position(self, name: str) -> float:
        """Position of a joint or of a single coordinate such as ``joint.x`` [rad or m]."""
        return float(self.q[named(self.mechanism, name)[0]])

    def speed(self, name: str) -> float:
        """Speed of a joint or of a single coordinate [rad/s or m/s]."""
        return float(self.v[named(self.mechanism, name)[0]])

    def journal(self, joint: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre (3,) [m] and orientation (3, 3) of a journal in its bearing frame."""
        pose = self.poses[self._joint(joint)]
        return pose[:3], pose[3:].reshape(3, 3)

    def force(self, joint: str) -> np.ndarray:
        """Force on a journal in the axes of its bearing, shape (3,) [N]."""
        return self.wrenches[self._joint(joint), :3]

    def contacts(self, joint: str) -> dict[str, float]:
        """Normal force of each contact of a joint, by name [N]."""
        at = self._joint(joint)
        names = self.mechanism.clearance[joint].contacts
        return {name: float(self.normal_forces[at, k]) for k, name in enumerate(names)}

    def _joint(self, name: str) -> int:
        joints = list(self.mechanism.clearance)
        require_known("joint with clearance", name, joints)
        return joints.index(name)


FASTEST_SHOWN = 4
"""Number of coordinates that the message on a run that stopped shows, the fastest ones."""
SAME_PLACE = 1e-12
"""Distance below which a machine without play counts as resting where it was put [rad or m]."""
ENGAGED_S = 1e-3
"""Interval at which journals are checked to be in their open-ended bearings [s]."""


@contextmanager
def _refusing_overflow() -> Iterator[None]:
    try:
        yield
    except (ArithmeticError, np.linalg.LinAlgError) as error:
        raise JointplayError(
            f"a number is far too large or too small to compute with: {error}"
        ) from None


@known_keywords
class Run:
    """A simulation under way, initially at its start state.

    Args:
        simulation: the inputs of the run.
        progress: show a bar on standard error while a long motion is tabulated.
        records: where records go that memory has no room for: a file, of which `Simulation.run_to`
            makes a result, or a function that takes them portion by portion. None: all stay in
            memory.
        places: resting places of journals in another run (`Rest.places`), of joints that are the
            same and bear the same: the search for rest begins there, and ends where it would
            without.
        ahead: whether it is going to be stepped, so that a kernel that is not cached is compiled
            while the rest is made ready.

    Raises:
        JointplayError: a step, duration or record interval that makes no sense, a step too large
            for the contact stiffness, or a motion that does not fit the mechanism.
    """

    @_refusing_overflow()
    def __init__(
        self,
        simulation: Simulation,
        progress: bool = False,
        records: Path | Callable[[Records], None] | None = None,
        places: Mapping[str, np.ndarray] | None = None,
        ahead: bool = False,
    ) -> None:
        require_a("simulation", simulation, "Simulation")
        prepared = prepare(simulation, records is None, progress, ahead)
        self.simulation, self.mechanism = simulation, simulation.mechanism
        self.label = ""
        """Name of the run in its progress bar."""
        self.method, self.total_steps = prepared.method, prepared.total_steps
        self.model, self.data, self.workspace = prepared.model, prepared.data, prepared.workspace
        self.friction, self._reference = prepared.friction, prepared.reference
        self._compiles = prepared.compiles
        self._chart = BaseChart(self)
        self.overflow = None if records is None else self._overflow(records, prepared)
        """Where records go that memory has no room for."""
        self._load_schedule = LoadSchedule(self, prepared.sites)
        self._events = Events(self)
        self.rest: Rest | None = None
        """Where the search for the equilibrium ended; None if journals start centred."""
        if simulation.starts_at_rest:
            self._place(prepared, places or {})
        prepared.start.check_journals()
        self._open_ended = any(
            math.isfinite(joint.engaged_within) for joint in self.mechanism.clearance.values()
        )
        self.judging = Judging(self.mechanism, simulation.step, self.simulation.judged_from)
        self._begun = self._finished = False
        self._complete = True
        """Whether q and v of the workspace belong to one instant; a step may leave them apart."""
        self._left: tuple[bytes, bytes] | None = None
        """q and v as the run left them, by which changes from outside are noticed."""
        self._elapsed = 0.0
        """Wall time of the stretches that are over [s]."""
        self._since: float | None = None
        """Clock at the start of this stretch, less `_elapsed`; None between stretches [s]."""
        self._origin: tuple[np.ndarray, np.ndarray] | None = None
        """q and v at the start, for other runs from there."""
        self.stop_checks: list[Callable[[], bool]] = []
        """Functions called between stretches; the run stops if one returns True."""
        correction = time_loop.LOOP_CORRECTION / simulation.step
        constraints = self.mechanism.constraints(self.workspace.q, correction)
        self._loop: time_loop.TimeLoop = prepared.loop(self, constraints)

    def _overflow(self, records: Path | Callable[[Records], None], prepared: Prepared) -> Overflow:
        step, record_every = self.simulation.step, self.simulation.record_every
        stretch = CHUNK + math.ceil(prepared.longest_macro_step / step) + 2
        numbers = self.workspace, self.total_steps // record_every + 2, stretch
        keeps = PassedRecords if callable(records) else DiskRecords
        overflow: Overflow = keeps(records, *numbers)  # type: ignore[arg-type]
        overflow.before_writing = self._chart.convert_records
        return overflow

    @property
    def on_disk(self) -> DiskRecords | None:
        return self.overflow if isinstance(self.overflow, DiskRecords) else None

    def _place(self, prepared: Prepared, places: Mapping[str, np.ndarray]) -> None:
        """Let the run begin where the machine rests, if an equilibrium is found.

        This holds without play, too: drives give way, and loads bend the machine.
        """
        simulation, w, start = self.simulation, self.workspace, prepared.start
        self._events.apply_due_events(w)  # a payload that is picked up at 0 counts
        loads = StaticLoads(simulation.loads, self.mechanism, prepared.sites)
        rest = initial.find_rest(self, start, prepared.drives, loads, places)
        if not (self.mechanism.clearance or self.mechanism.gears):
            if rest.solved and np.abs(rest.q - w.q).max(initial=0.0) <= SAME_PLACE:
                return  # it stands where it begins anyway
            if not rest.solved and simulation.start != "rest":
                self.simulation = replace(simulation, start="centred")
                return  # nothing is centred in it: it begins where it was put, and moves
        self.rest = rest
        if not rest.solved and simulation.start == "rest":
            failure = (
                f"after {rest.trials} trials {rest.residual:.3g} N of {rest.load:.3g} N are "
                "not balanced"
                if rest.inside
                else "a journal would break out of its bearing"
            )
            raise JointplayError(
                f"no equilibrium was found: {failure}; start 'centred', or give a state in "
                "which the drives hold the machine"
            )
        # The result holds how it did start, so that it can be run again like this.
        self.simulation = replace(simulation, start="rest" if rest.solved else "centred")
        start.q = rest.q if rest.solved else start.q
        if simulation.seed is not None:
            behind = initial.behind_gears(prepared.drives)
            start.perturb(simulation.seed, at_rest=rest.solved, behind=behind)
        start.move()
        w.q[:], w.v[:] = start.q, start.v

    def highest_frequency(self) -> float:
        """Highest natural frequency on springs, gears and drives where the run begins [rad/s]."""
        mechanism, w = self.mechanism, self.workspace
        inverse = np.diag(pin.computeMinverse(self.model, self.data, w.q))
        frequencies = [acting.highest_frequency(self.simulation.loads, mechanism, w.q)[0]]
        frequencies += [math.pi / tooth_duration(mechanism, name, w.q) for name in mechanism.gears]
        for row in w.servos:
            mobility, stall = inverse[row["coordinate"]], float(row["stall"])
            frequencies.append(math.sqrt(row["p_gain"] * stall * mobility))
            frequencies.append(row["d_gain"] * stall * mobility)
        for row in w.drives[w.drives["armature"] == 0.0]:
            mobility = inverse[row["coordinate"]]
            frequencies.append(math.sqrt(max(row["kp"] * mobility, 0.0)))
            if not row["implicit"]:
                frequencies.append(row["kd"] * mobility)
        return float(max(frequencies))

    @property
    def phases(self) -> list[Phase]:
        """Intervals of constant inertia so far, between payload events."""
        return self._events.phases

    def displace(self, distance: Sequence[float]) -> None:
        """Move every journal aside before the run begins, by `distance` along x, y and z [m]."""
        distance = require_vector("distance", distance, "m")
        initial.displace_journals(self.mechanism, self.workspace.q, distance)

    def shorten_macro_steps(self, factor: float) -> None:
        """Divide macro steps by `factor` before the run begins; errors fall with its square."""
        if isinstance(self._loop, time_loop.MultiRate):
            self._loop.shorten_macro_steps(factor)

    def finish(
        self, progress: bool = False, check_step: bool = True, only: Sequence[str] | None = None
    ) -> Result:
        """Simulate to the end, from the start or from where the run stands; once only.

        Interrupted by Ctrl-C, or stopped because the state ran away, the result holds everything up
        to there and says so in `Result.status` and `Result.message`; a run that stopped also warns.

        Args:
            progress: show a bar with simulated time, speed and time left on standard error.
            check_step: where nothing else judges the step, estimate its error by a run with another
                step (`step_check`), which takes half as long as the run, in doubt two and a half
                times as long. A continued run is not checked.
            only: histories that are wanted; see `histories.histories`.

        Raises:
            JointplayError: the run is at its end already; see `result`.
        """
        self._check_unfinished()
        if self.on_disk is not None and self.on_disk.needed:
            raise JointplayError("the histories of this run go to a file: save it")
        status = self.run_to_end(progress)
        check_step = check_step and step_check.is_needed(self.simulation)
        if only is not None and check_step:
            only = [*dict.fromkeys([*only, *step_check.COMPARED])]
        result = self.result(status, only=only)
        completed, origin = status == Status.COMPLETED, self._origin
        if check_step and completed and origin is not None:
            error = step_check.step_error(self, result, origin, progress)
            if error is not None:
                result.amend(step_error=error[0], relative_step_error=error[1])
        return result

    def result(self, status: Status | None = None, only: Sequence[str] | None = None) -> Result:
        """Make a result of what was recorded so far.

        Args:
            status: how the run ended; None: as it did, at its end, by a failure, or interrupted
                here.
            only: see `histories.histories`.
        """
        if status is None:
            failed = self.workspace.status != Status.COMPLETED
            status = self.workspace.status if self._finished or failed else Status.INTERRUPTED
        self._chart.convert_records()
        return histories(self, status, only)

    def run_to_end(self, progress: bool = False) -> Status:
        """Step to the end, a failure, or Ctrl-C; returns which. A failure also warns."""
        self._check_unfinished()
        workspace = self.workspace
        if workspace.steps == 0:
            self._origin = workspace.q.copy(), workspace.v.copy()
        if self._compiles:
            compile_histories(self)
        self._loop.compile()
        bar = Simulated(
            self.total_steps * self.simulation.step, progress, self.label, workspace.time
        )
        self._since = time.perf_counter() - self._elapsed
        try:
            for now in self._stretches():
                bar.reach(now)
                requests = [asked_to_stop() for asked_to_stop in self.stop_checks]
                if any(requests):
                    return Status.INTERRUPTED
        except signals.GivenUp:
            raise
        except KeyboardInterrupt:
            if not workspace.rows:  # stopped before its first record
                raise
            return Status.INTERRUPTED
        finally:
            self._elapsed, self._since = self.elapsed, None
            bar.close()
        if workspace.status != Status.COMPLETED:
            warnings.warn(self.message(workspace.status), JointplayWarning, stacklevel=3)
        return workspace.status

    @property
    def elapsed(self) -> float:
        """Wall time of the run so far, in all processes together [s]."""
        return self._elapsed if self._since is None else time.perf_counter() - self._since

    def _stretches(self, pause: int = CHUNK) -> Iterator[float]:
        """Step to the end, or to a failure; yields the time [s] about every `pause` steps.

        The multi-rate method pauses at the end of the macro step that passes them.
        """
        self._check_unfinished()
        while self.workspace.steps < self.total_steps:
            if not self._advance_stretch(pause=self.workspace.steps + pause):
                return
            yield self.workspace.time
        self._loop.finish()
        self._finished = True

    def steps(self, every: float | None = None) -> Iterator[Moment]:
        """Step to the end, or to a failure, and yield moments between macro steps to be read.

        The first is that of the start. Looking changes nothing: the run is the same bit for bit.

        Args:
            every: interval of the moments [s]; each is at the end of the macro step that reaches a
                multiple of it. None: one after every macro step.
        """
        self._check_unfinished()
        if every is not None:
            require_positive("every", every, "s")
        self._loop.compile()
        yield self.moment()
        reached = 0 if every is None else math.floor(self.workspace.time / every + 1e-9)
        most = 1 if every is None else max(round(every / self.simulation.step), 1)
        for now in self._stretches(most):
            due = reached if every is None else math.floor(now / every + 1e-9)
            if every is None or due > reached:
                reached = due
                yield self.moment()

    def moment(self) -> Moment:
        """The present instant, to be read; the run goes on as if nobody had looked."""
        # To be read, the state is evaluated in place, and put back afterwards.
        self.begin()
        w = self.workspace
        saved = [array.copy() for array in w.state()]
        if not self.method.single_rate:  # whose q and v are not of one instant
            self._loop.synchronize()
        touching = w.contacts["touching"] > 0
        if not self.method.single_rate:
            touching &= (w.joints["touching"] > 0)[:, None]
        moment = Moment(
            w.time,
            w.steps,
            *self._chart.state(w.q, w.v),
            self.mechanism,
            w.joints["pose"].copy(),
            w.joints["wrench"].copy(),
            np.where(touching, w.contacts["normal_now"], 0.0),
        )
        for array, values in zip(w.state(), saved, strict=True):
            np.copyto(array, values)
        return moment

    def begin(self) -> None:
        """Evaluate forces and acceleration of the state, with payloads picked up at time 0 in hand.

        Methods that step or look call it themselves: before the first step, and after
        `synchronize`. If nothing has changed since, it does nothing.

        Raises:
            JointplayError: q or v of the workspace were changed between steps without
                `synchronize`: the method would not see it, or only half of it.
        """
        if self._begun and self._left == self._state():
            return
        if self._begun and not self._complete:
            raise JointplayError(
                f"q or v of the workspace were changed at t = {self.workspace.time:g} s while the "
                "method has parts of the state elsewhere: call synchronize() before you change them"
            )
        self._events.apply_due_events(self.workspace)
        self._load_schedule.start(self._loop)
        self.judging.begin(self.workspace)
        self._begun = True
        self._left = self._state()

    def synchronize(self) -> None:
        """Bring q and v of the workspace to one instant, to be changed; the next step begins there.

        Before the first step, and after another `synchronize`, it does nothing.
        """
        if not self._complete:
            self.begin()
            self._loop.synchronize()
            self._begun, self._complete = False, True

    def _state(self) -> tuple[bytes, bytes]:
        return self.workspace.q.tobytes(), self.workspace.v.tobytes()

    def _check_unfinished(self) -> None:
        """Refuse to go on with a run that has ended: its last state would be recorded twice."""
        if self._finished or self.workspace.status != Status.COMPLETED:
            raise JointplayError(
                f"this run ended at t = {self.workspace.time:g} s and cannot be run again: "
                "run.result() is its result, Run(simulation) makes another run"
            )

    def checkpoint(self, path: str | Path) -> Path:
        """Write the run as it stands; `Simulation.resume` continues it bit for bit.

        Call it between stretches or moments, or after Ctrl-C within them. An older checkpoint of
        that name is replaced, whole or not at all; any other file is refused.
        """
        return checkpoint.save(self, Path(path))

    def memory(self) -> dict[str, Any]:
        """State of the run beyond its workspace, as plain data and arrays; see `recall`."""
        return {
            "begun": self._begun,
            "whole": self._complete,
            "finished": self._finished,
            "elapsed": self.elapsed,
            "origin": None if self._origin is None else [x.tolist() for x in self._origin],
            "reference": self._reference.memory(),
            "events": self._events.memory(),
            "loop": self._loop.goes_on,
            "judging": self.judging.memory(),
            "unjudged": self.judging.unjudged,
            "watch": self._load_schedule.memory(),
            "chart": self._chart.memory(),
        }

    def recall(self, memory: Mapping[str, Any]) -> None:
        self._events.recall(memory["events"])
        self._loop.goes_on = bool(memory["loop"])
        self._complete, self._left = bool(memory["whole"]), self._state()
        self._begun, self._elapsed = bool(memory["begun"]), float(memory["elapsed"])
        self._finished = bool(memory["finished"])
        if memory["origin"] is not None:
            q, v = memory["origin"]
            self._origin = np.array(q, float), np.array(v, float)
        self._reference.recall(memory["reference"])
        self._set_reference_block()
        self.judging.recall(memory["judging"], memory["unjudged"])
        self._load_schedule.recall(memory["watch"])
        self._chart.recall(memory["chart"])

    def _advance_stretch(self, most: int = CHUNK, pause: int | None = None) -> bool:
        """Do at most `most` steps, then what is due; returns whether all is well.

        With `pause` it returns after the first macro step that ends at or after this step, if that
        is earlier; the run is the same with and without.
        """
        w = self.workspace
        self.begin()
        self._complete = False
        if w.time >= self._reference.until:
            self._set_reference_block()
        if self.overflow is not None:
            self.overflow.before_stretch()
        # Two ends of the stretch: after `steps` exactly, which may end a macro step early, where
        # something happens to the state; at the end of the macro step that passes `pause`, where
        # the state is only looked at, so that looking changes no step.
        steps = min(most, self.total_steps - w.steps)
        due = self._events.next_step
        if due is not None:
            steps = min(steps, due - w.steps)
        for changing in (self._load_schedule, self._chart):
            until_next = changing.steps_until_next(w.steps)
            if until_next is not None:
                steps = min(steps, until_next)
        look = max(round(ENGAGED_S / self.simulation.step), 1)
        soon = w.steps + (min(CHUNK, look) if self._open_ended else CHUNK)
        pause = soon if pause is None else min(pause, soon)
        pause = int(min(pause, self.judging.next_step(w.steps)))
        try:
            good = self._loop.stretch(steps, pause)
            if good:
                self._do_what_is_due(due)
                left = initial.left_bearing(self.mechanism, w.q) if self._open_ended else None
                if left is not None:
                    w.fail(Status.BROKE_OUT, list(self.mechanism.clearance).index(left))
                    good = False
        finally:  # a Ctrl-C comes between macro steps, and the run can go on
            self._left = self._state()
        return good

    def _do_what_is_due(self, due: int | None) -> None:
        """Look at the contacts; apply events at the step `due`, samples of loads, a new chart."""
        w = self.workspace
        self.judging.look(w)
        if due is not None and due == w.steps:
            self._loop.synchronize()
            self._events.apply_due_events(w)
            self._load_schedule.start(self._loop)
        elif self._load_schedule.is_due(w.steps):
            self._load_schedule.look(self._loop, last=w.steps >= self.total_steps)
        if self._chart.replace_if_due(self._loop):
            self._load_schedule.start(self._loop)

    def _set_reference_block(self) -> None:
        self._reference.go_to(self.workspace.time)
        self.workspace.set_reference_block(self._reference.table, self._reference.first)

    def share_reference(self, run: Run) -> None:
        """Use the reference tables of another run of the same motion: results are bit-identical."""
        self._reference = run._reference
        self._set_reference_block()

    def advance(self, steps: int) -> bool:
        """Do `steps` steps, or fewer if the run fails or ends; returns whether all is well."""
        end = min(self.workspace.steps + require_whole("steps", steps), self.total_steps)
        while self.workspace.steps < end:
            if not self._advance_stretch(end - self.workspace.steps):
                return False
        return True

    def message(self, status: Status) -> str:
        """How the run ended, in a line."""
        mechanism, workspace = self.mechanism, self.workspace
        at = f"at t = {workspace.time:.6g} s (step {workspace.steps})"
        if status == Status.COMPLETED:
            return f"completed {workspace.time:g} s in {workspace.steps} steps"
        if status == Status.INTERRUPTED:
            return f"interrupted {at}; {counted(workspace.rows, 'record')} kept"
        state = [
            f"{name} = {q:.6g} ({v:.4g}/s)"
            for name, q, v in zip(mechanism.coordinates, workspace.q, workspace.v, strict=True)
        ]
        fast = sorted(np.argsort(-np.abs(workspace.v), kind="stable")[:FASTEST_SHOWN])
        shown = ", ".join(state[k] for k in fast)
        if len(fast) < len(state):
            shown += f" (the fastest of {len(state)} coordinates)"
        failure, remedy = self._failure(status)
        return f"stopped {at}: {failure}; {remedy}. State: {shown}"

    def _failure(self, status: Status) -> tuple[str, str]:
        """Cause of a run's stop, and its remedy."""
        mechanism, workspace = self.mechanism, self.workspace
        index, contact = workspace.bad_contact
        if status == Status.BAD_LOAD:
            load = list(self.simulation.loads)[index]
            return f"the load {load!r} gave a non-finite value", "correct it"
        if status == Status.RUN_AWAY:
            drives = assign(mechanism, self.simulation.motion, self.simulation.drive)
            through = [
                name for name in mechanism.gears if getattr(drives[name], "encoder", "") == "link"
            ]
            remedy = "reduce the step or the drive's bandwidth"
            if through:
                remedy = f"the drive of {few(through)} acts through the teeth of its gear on what "
                remedy += "its encoder reads: put that on the motor (--encoder motor), or lower "
                remedy += "--bandwidth"
            return "the state diverged or is not a number", remedy
        name = list(mechanism.clearance)[index]
        joint = mechanism.clearance[name]
        journal, place = f"the journal of {name!r}", joint.contacts[contact]
        if status == Status.BROKE_OUT:
            if name == initial.left_bearing(mechanism, workspace.q):
                remedy = "hold it along the axis, or make bearing or journal longer"
                return f"{journal} left its bearing, whose ends are open", remedy
            remedy = "reduce the step or check stiffness and loads"
            return f"{journal} broke out of its bearing ({place})", remedy
        if status == Status.FILM_BROKE:
            remedy = "let the film be hybrid, or take a more viscous oil"
            return f"{journal} touched its bore through the film ({place})", remedy
        laws = [joint.normal, joint.friction] + ([joint.film[0]] if joint.film else [])
        named = " or ".join(repr(law.name) for law in laws)
        return f"law {named} of {name!r} returned a non-finite value ({place})", "correct the law"
