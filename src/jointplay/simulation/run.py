"""A run: a simulation made ready to step, that one can hold, watch and continue."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin
from tqdm import tqdm

from jointplay import kernel
from jointplay.errors import JointplayError, MissingName, require_positive
from jointplay.kernel import Status
from jointplay.kernel.integrators import DEFAULT, Integrator, integrator
from jointplay.kernel.workspace import Workspace
from jointplay.loads import limits as limits_of_joints
from jointplay.loads.drive import JointFriction, assign
from jointplay.loads.tables import table_nodes, tabulate
from jointplay.mechanism.massless import require_inertia
from jointplay.result.audit import Judgement
from jointplay.result.histories import Phase, histories
from jointplay.simulation import checkpoint, ending, initial, limits, step_check
from jointplay.simulation import loads as acting
from jointplay.simulation.assemble import check_step, contact_site
from jointplay.simulation.events import Events
from jointplay.simulation.loop import LOOP_CORRECTION, Adaptive, Loop, MultiRate, SingleRate
from jointplay.simulation.moment import Moment
from jointplay.simulation.progress import Bar
from jointplay.simulation.standing import StandingLoads
from jointplay.simulation.watch import Watch

if TYPE_CHECKING:
    from jointplay.result.result import Result
    from jointplay.simulation.simulation import Simulation

_CHUNK = 2000
"""Steps between two looks at the clock and the keyboard."""


class Run:
    """A simulation made ready to step: its workspace, and the initial state in it."""

    def __init__(self, simulation: Simulation, progress: bool = False) -> None:
        """Check the numbers, place the journals, tabulate the drives."""
        self.simulation = simulation
        self.label = ""  # what the progress bar calls the run
        self.mechanism = mechanism = simulation.mechanism
        limits.check_names(mechanism)
        self.method: Integrator = integrator(simulation.integrator)
        step, duration = self._check_numbers()
        acting.check(simulation.loads)
        drives = assign(mechanism, simulation.motion, simulation.drive)
        nodes = table_nodes(simulation.motion, drives, duration)
        limits.check_memory(mechanism, duration, self.steps, simulation.record_every, nodes)
        self.friction = self._friction()
        followed = [name for name, drive in drives.items() if drive.follows]
        bounds = self._bounds(followed)
        start = initial.place(simulation, mechanism, followed)
        require_inertia(mechanism, start.q)
        if simulation.seed is not None and not simulation.stands:
            start.perturb(simulation.seed, at_rest=False)
        tables, armature = tabulate(
            mechanism,
            simulation.motion,
            drives,
            duration,
            self.friction,
            start.q,
            progress,
            bounds,
        )
        start.move()
        # The run's own, for payloads and prescribed motion change its inertias.
        self.model = mechanism.model.copy()
        for at, value in armature.items():
            self.model.armature[at] = value
        self.data = self.model.createData()
        sites = [acting.load_site(load, mechanism, bounds) for load in simulation.loads.values()]
        self.workspace = w = Workspace(
            self.data,
            self.model.nv,
            [contact_site(mechanism, name, start.q) for name in mechanism.clearance],
            tables,
            step,
            simulation.record_every,
            self.steps // simulation.record_every + 2,
            own_acceleration=not self.method.single_rate,
            loads=sites,
        )
        self._watch = Watch(simulation.loads, sites, mechanism, self.model, w, step)
        w.q[:], w.v[:] = start.q, start.v
        self._events = Events(
            mechanism, self.model, simulation.payloads, step, simulation.record_every
        )
        check_step(mechanism, pin.computeTotalMass(self.model), step, start.q)
        acting.check_step(simulation.loads, mechanism, step, start.q)
        self.rest: initial.Rest | None = None
        """Where the search for the place of rest ended; None if journals start centred."""
        if simulation.stands and (mechanism.clearance or mechanism.gears):
            self._events.happen(w)  # what is picked at 0 weighs from the first
            bodies = self.phases[-1].model
            pushing = StandingLoads(simulation.loads, mechanism, sites)
            self.rest = initial.rest(simulation, start, bodies, w, drives, self.friction, pushing)
            self._stand(start)
        self.judged_from = simulation.judged_from
        """When figures begin to be judged [s]."""
        self._unjudged: dict[str, np.ndarray] | None = None
        self._begun = False
        self._elapsed = 0.0
        self.guards: list[Callable[[], AbstractContextManager[object]]] = []
        """Contexts in which the time loop runs, such as one that takes signals."""
        self._loop = self._make_loop(mechanism.constraints(w.q, LOOP_CORRECTION / step))

    def _stand(self, start: initial.Start) -> None:
        """Let the journals begin where they rest, if they do."""
        rest, simulation = self.rest, self.simulation
        assert rest is not None
        if not rest.solved:
            if simulation.start == "rest":
                what = (
                    f"after {rest.trials} trials {rest.residual:.3g} N of {rest.load:.3g} N are "
                    "not balanced"
                    if rest.inside
                    else "a journal would break out of its bearing"
                )
                raise JointplayError(
                    f"no place of rest was found: {what}; start 'centred', or give a state in "
                    "which the drives hold the machine"
                )
            # As the result says: to run it again is to run it like this.
            self.simulation = replace(simulation, start="centred")
            if simulation.seed is not None:
                start.perturb(simulation.seed, at_rest=False)
        else:
            self.simulation = replace(simulation, start="rest")
            start.q = rest.q
            if simulation.seed is not None:
                start.perturb(simulation.seed, at_rest=True)
        start.move()
        self.workspace.q[:], self.workspace.v[:] = start.q, start.v

    def _check_numbers(self) -> tuple[float, float]:
        """Refuse settings that make no sense; returns step and duration [s]."""
        simulation = self.simulation
        step = require_positive("step", simulation.step, "s", ("step",))
        if simulation.macro_step is not None:
            require_positive("macro step", simulation.macro_step, "s", ("macro_step",))
        if simulation.tolerance is not None:
            require_positive("tolerance", simulation.tolerance, "", ("tolerance",))
        for option in ("macro_step", "tolerance"):
            value = getattr(simulation, option)
            if value is not None and self.method.single_rate:
                raise JointplayError(
                    f"{option} (got {value:g}) belongs to the integrator {DEFAULT!r}; "
                    f"{self.method.name!r} has a fixed step: leave it out, or take {DEFAULT!r}",
                    where=(option,),
                )
        duration = self._duration()
        every = simulation.record_every
        limits.check_numbers(step, duration, every, simulation.seed)
        self.steps = round(duration / step)
        if self.steps < 1:
            raise JointplayError(
                f"duration {duration:g} s is shorter than the step {step:g} s", where=("duration",)
            )
        return step, duration

    def _duration(self) -> float:
        duration, motion = self.simulation.duration, self.simulation.motion
        if duration is None:
            if motion is None:
                raise JointplayError(
                    "a simulation without motion needs a duration [s]", where=("duration",)
                )
            duration = motion.duration
        return require_positive("duration", duration, "s", ("duration",))

    def _friction(self) -> Mapping[str, JointFriction]:
        friction = self.simulation.joint_friction
        joints = self.mechanism.joints
        if friction is None:
            entries = self.mechanism.description.joints
            friction = {
                name: JointFriction(entries[name].friction, entries[name].damping)
                for name in joints
            }
        for name in friction:
            if name not in joints:
                raise MissingName("moving joint", name, joints)
        return friction

    def _bounds(self, followed: Sequence[str]) -> dict[str, float]:
        """Hold the motion against the URDF's limits; returns the efforts that are to be cut."""
        way = limits_of_joints.require_known(self.simulation.limits)
        if way == "ignore":
            return {}
        if followed:
            assert self.simulation.motion is not None
            found = limits_of_joints.check_motion(self.mechanism, self.simulation.motion, followed)
            for text in found:
                warnings.warn(text, RuntimeWarning, stacklevel=5)
        return limits_of_joints.bounds(self.mechanism) if way == "cut" else {}

    def _make_loop(self, constraints: list[pin.RigidConstraintModel]) -> Loop:
        simulation = self.simulation
        parts = (self.model, self.data, self.workspace, self.method, constraints)
        if self.method.single_rate:
            return SingleRate(*parts)
        if simulation.tolerance is None:
            return MultiRate(*parts, macro_step=simulation.macro_step)
        return Adaptive(*parts, macro_step=simulation.macro_step, tolerance=simulation.tolerance)

    @property
    def phases(self) -> list[Phase]:
        """The stretches so far in which the bodies keep their inertias."""
        return self._events.phases

    def displace(self, distance: float) -> None:
        """Move every journal aside by `distance` along each axis [m], before the run begins."""
        initial.displace(self.mechanism, self.workspace.q, distance)

    def execute(
        self, progress: bool = False, check_step: bool = True, reactions: bool = True
    ) -> Result:
        """Simulate to the end, from the start or from where the run stands; once only.

        Args:
            progress: show a bar with simulated time, speed and time left on standard error.
            check_step: where nothing else judges the step, run again with another one: see
                `step_check`. Takes about half of the run's time, in doubt two and a half times
                the run's. Not for a run that was continued.
            reactions: see `result`.

        Returns:
            The result. Interrupted by Ctrl-C, or stopped because the state ran away, it holds
            everything up to there and says so in `Result.status` and `Result.message`; a run that
            stopped also warns.
        """
        started = time.perf_counter()
        whole = not self._begun
        start = self.workspace.q.copy(), self.workspace.v.copy()
        status = self.loop(progress)
        self._elapsed += time.perf_counter() - started
        message = self.message(status)
        if status not in (Status.COMPLETED, Status.INTERRUPTED):
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        result = self.result(status, message, reactions)
        check_step = check_step and whole and step_check.wanted(self.simulation)
        if check_step and status == Status.COMPLETED:
            error = step_check.step_error(self, result, start, progress)
            if error is not None:
                result.amend(step_error=error.tool, relative_step_error=error.relative)
        return result

    def guard(self, other: Run) -> Run:
        """Make a run that is part of this one stop as this one does; returns it."""
        other.guards += self.guards
        return other

    def result(
        self, status: Status | None = None, message: str | None = None, reactions: bool = True
    ) -> Result:
        """What was recorded so far, as a result.

        Args:
            status, message: how the run ended; if not given, as interrupted here.
            reactions: whether a mechanism without clearance gets the forces in its joints; who
                asks only where it goes can do without.
        """
        status = Status.INTERRUPTED if status is None else status
        return histories(
            self.mechanism,
            self.simulation.describe(),
            self.workspace,
            self.friction,
            self.phases,
            status,
            self.message(status) if message is None else message,
            self._elapsed,
            self.judgement(),
            self.simulation.loads,
            reactions,
        )

    def judgement(self) -> Judgement:
        """How the run began, and what its contacts did before it was judged."""
        start = "centred" if self.rest is None or not self.rest.solved else "rest"
        return Judgement(
            start,
            self.judged_from,
            None if self.rest is None else self.rest.residual,
            None if self.rest is None else self.rest.load,
            self._unjudged,
        )

    def loop(self, progress: bool = False) -> Status:
        """Step until the end, a failure, or Ctrl-C; returns why it stopped."""
        workspace = self.workspace
        if progress and not kernel.enter.signatures:
            note = "loading compiled kernels (the first start ever compiles them, ~20 s)"
            tqdm.write(note, file=sys.stderr)
        kernel.compiled()
        bar = Bar(self.steps * self.simulation.step, progress, self.label)
        with ExitStack() as stack:
            stack.callback(bar.close)
            for guard in self.guards:
                stack.enter_context(guard())
            try:
                for now in self.stretches():
                    bar.update(now)
            except KeyboardInterrupt:
                return Status.INTERRUPTED
            return workspace.status

    def stretches(self, pause: int = _CHUNK) -> Iterator[float]:
        """Step to the end, or to a failure, and give the time after every stretch [s].

        Args:
            pause: steps of a stretch; the multi-rate method stops at the macro step that passes it.
        """
        if not self._begun:
            self.begin()
        while self.workspace.steps < self.steps:
            if not self.stretch(pause=self.workspace.steps + pause):
                return
            yield self.workspace.time
        self.finish()

    def moments(self, every: float | None = None) -> Iterator[Moment]:
        """Step to the end, or to a failure, and give a moment between macro steps to read.

        The first is that of the start. To look changes nothing: the run is the same bit for bit.

        Args:
            every: a moment at the first macro step that ends at or after each multiple of this
                [s]; None: one after every macro step.

        Raises:
            JointplayError: `every` is not positive.
        """
        if every is not None:
            require_positive("every", every, "s")
        kernel.compiled()
        if not self._begun:
            self.begin()
        yield self.moment()
        given = 0 if every is None else math.floor(self.workspace.time / every + 1e-9)
        most = 1 if every is None else max(round(every / self.simulation.step), 1)
        for now in self.stretches(most):
            due = given if every is None else math.floor(now / every + 1e-9)
            if every is None or due > given:
                given = due
                yield self.moment()

    def moment(self) -> Moment:
        """The present instant, to be read; the run must have begun."""
        w = self.workspace
        kept = [array.copy() for array in w.state()]
        self._loop.look()
        touching = (w.contacts["touching"] > 0) & (w.joints["touching"] > 0)[:, None]
        if self.method.single_rate:
            touching = w.contacts["touching"] > 0
        moment = Moment(
            w.time,
            w.steps,
            w.q.copy(),
            w.v.copy(),
            self.mechanism,
            w.joints["pose"].copy(),
            w.joints["wrench"].copy(),
            np.where(touching, w.contacts["normal_now"], 0.0),
        )
        for array, values in zip(w.state(), kept, strict=True):
            np.copyto(array, values)
        return moment

    def begin(self) -> None:
        """Evaluate forces and acceleration of the state, payloads picked at 0 in hand.

        Begin again whenever you have changed q or v of the workspace, after `settle`.
        """
        self._events.happen(self.workspace)
        self._watch.set_off(self._loop)
        self._begun = True

    def settle(self) -> None:
        """Make q and v of the workspace whole, to be changed; then `begin` again."""
        self._loop.settle()

    def finish(self) -> None:
        """Record the last state."""
        self._loop.finish()

    def checkpoint(self, path: str | Path) -> Path:
        """Write the run as it stands; `Simulation.resume` continues it bit for bit.

        Between stretches or moments, or after Ctrl-C within them. An older file of that name is
        replaced, at once or not at all.

        Raises:
            JointplayError: the file cannot be written.
        """
        return checkpoint.save(self, Path(path))

    def memory(self) -> dict[str, Any]:
        """What a checkpoint holds beside the workspace."""
        return {
            "begun": self._begun,
            "elapsed": self._elapsed,
            "unresolved": self.workspace.unresolved,
            "events": self._events.memory(),
            "loop": self._loop.memory(),
            "unjudged": self._unjudged,
            "watch": self._watch.memory(),
        }

    def recall(self, memory: Mapping[str, Any]) -> None:
        """Go on as the run that had this memory; its workspace has been restored."""
        self._events.recall(memory["events"])
        if memory["begun"]:
            self._loop.recall(memory["loop"])
        self._begun, self._elapsed = bool(memory["begun"]), float(memory["elapsed"])
        self.workspace.unresolved = int(memory["unresolved"])
        self._unjudged = memory["unjudged"]
        self._watch.recall(memory["watch"])

    def stretch(self, most: int = _CHUNK, pause: int | None = None) -> bool:
        """Do some steps, then what is due; returns whether all is well.

        Args:
            most: this many at most.
            pause: return after the first macro step that ends at or after this step, if earlier;
                the run is the same with and without.
        """
        w = self.workspace
        steps = min(most, self.steps - w.steps)
        due = self._events.next_step
        if due is not None:
            steps = min(steps, due - w.steps)
        judged = round(self.judged_from / self.simulation.step)
        watched = self._watch.until_next(w.steps)
        if watched is not None:
            steps = min(steps, watched)
        if w.steps < judged:
            pause = judged if pause is None else min(pause, judged)
        if not self._loop.stretch(steps, pause):
            return False
        if self._unjudged is None and w.steps >= judged > 0:
            self._unjudged = w.contact_statistics()
        if due is not None and due == w.steps:
            self._loop.settle()
            self._events.happen(w)
            self._watch.set_off(self._loop)
        elif self._watch.due(w.steps):
            self._watch.look(self._loop, last=w.steps >= self.steps)
        return True

    def advance(self, steps: int) -> bool:
        """Do `steps` steps, or fewer if the run fails; returns whether all is well."""
        end = self.workspace.steps + steps
        while self.workspace.steps < end:
            if not self.stretch(end - self.workspace.steps):
                return False
        return True

    def message(self, status: Status) -> str:
        """One line on how the run ended."""
        return ending.message(self.mechanism, self.workspace, status, list(self.simulation.loads))
