"""A run: a simulation made ready to step, that one can hold, watch and continue."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from tqdm import tqdm

from jointplay.errors import JointplayError, require_positive
from jointplay.host import stopping
from jointplay.kernel import Status
from jointplay.result.audit import Judgement
from jointplay.result.histories import histories
from jointplay.result.variables import Phase
from jointplay.simulation import checkpoint, ending, initial, step_check
from jointplay.simulation.moment import Moment, moment_of
from jointplay.simulation.prepare import CHUNK, Prepared
from jointplay.simulation.progress import Bar

if TYPE_CHECKING:
    from jointplay.result.result import Result


class Run(Prepared):
    """A simulation made ready to step: its workspace, and the initial state in it."""

    @property
    def phases(self) -> list[Phase]:
        """The stretches so far in which the bodies keep their inertias."""
        return self._events.phases

    def displace(self, distance: float) -> None:
        """Move every journal aside by `distance` along each axis [m], before the run begins."""
        initial.displace(self.mechanism, self.workspace.q, distance)

    def execute(self, progress: bool = False, check_step: bool = True) -> Result:
        """Simulate to the end, from the start or from where the run stands; once only.

        Args:
            progress: show a bar with simulated time, speed and time left on standard error.
            check_step: where nothing else judges the step, run again with another one: see
                `step_check`. Takes about half of the run's time, in doubt two and a half times
                the run's. Not for a run that was continued.

        Returns:
            The result. Interrupted by Ctrl-C, or stopped because the state ran away, it holds
            everything up to there and says so in `Result.status` and `Result.message`; a run that
            stopped also warns.
        """
        if self.on_disk is not None and self.on_disk.needed:
            raise JointplayError("the histories of this run go to a file: save it")
        status, message = self.complete(progress)
        result = self.result(status, message)
        check_step = check_step and self._origin is not None and step_check.wanted(self.simulation)
        if check_step and status == Status.COMPLETED:
            assert self._origin is not None
            error = step_check.step_error(self, result, self._origin, progress)
            if error is not None:
                result.amend(step_error=error.tool, relative_step_error=error.relative)
        return result

    def complete(self, progress: bool = False) -> tuple[Status, str]:
        """Step to the end; returns how it ended, in one line. Warns if the run failed.

        Args:
            progress: see `execute`.
        """
        if not self._begun:
            self._origin = self.workspace.q.copy(), self.workspace.v.copy()
        status = self.loop(progress)
        message = self.message(status)
        if status not in (Status.COMPLETED, Status.INTERRUPTED):
            warnings.warn(message, RuntimeWarning, stacklevel=3)
        return status, message

    def guard(self, other: Run) -> Run:
        """Make a run that is part of this one stop as this one does; returns it."""
        other.guards += self.guards
        other.between += self.between
        return other

    def result(
        self,
        status: Status | None = None,
        message: str | None = None,
        reactions: bool = True,
        only: Sequence[str] | None = None,
    ) -> Result:
        """What was recorded so far, as a result.

        Args:
            status, message: how the run ended; if not given, as interrupted here.
            reactions: whether a mechanism without clearance gets the forces in its joints; who
                asks only where it goes can do without.
            only: histories that are wanted; None: all.
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
            only,
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
        if progress and not self._loop.compiled:
            note = "loading compiled kernels (the first start ever compiles them, half a minute)"
            tqdm.write(note, file=sys.stderr)
        self._loop.compile()
        bar = Bar(self.steps * self.simulation.step, progress, self.label, workspace.time)
        self._since = time.perf_counter() - self._elapsed
        with ExitStack() as stack:
            stack.callback(bar.close)
            stack.callback(self._stand_still)
            for guard in self.guards:
                stack.enter_context(guard())
            try:
                for now in self.stretches():
                    bar.update(now)
                    if [told for told in self.between if told()]:
                        return Status.INTERRUPTED
            except stopping.GivenUp:
                raise
            except KeyboardInterrupt:
                return Status.INTERRUPTED
            return workspace.status

    def _stand_still(self) -> None:
        self._elapsed, self._since = self.elapsed, None

    @property
    def elapsed(self) -> float:
        """What the run took so far, in all processes together [s]."""
        return self._elapsed if self._since is None else time.perf_counter() - self._since

    def stretches(self, pause: int = CHUNK) -> Iterator[float]:
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
        self._loop.compile()
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
        return moment_of(self.workspace, self._loop, self.mechanism, self.method.single_rate)

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
            "elapsed": self.elapsed,
            "origin": None if self._origin is None else [x.tolist() for x in self._origin],
            "reference": self._reference.memory(),
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
        if memory["origin"] is not None:
            q, v = memory["origin"]
            self._origin = np.array(q, float), np.array(v, float)
        self._reference.recall(memory["reference"])
        self._refer()
        self.workspace.unresolved = int(memory["unresolved"])
        self._unjudged = memory["unjudged"]
        self._watch.recall(memory["watch"])

    def stretch(self, most: int = CHUNK, pause: int | None = None) -> bool:
        """Do some steps, then what is due; returns whether all is well.

        Args:
            most: this many at most.
            pause: return after the first macro step that ends at or after this step, if earlier;
                the run is the same with and without.
        """
        w = self.workspace
        if w.time >= self._reference.until:
            self._refer()
        if self.on_disk is not None:
            self.on_disk.before_stretch()
        steps = min(most, self.steps - w.steps)
        soon = w.steps + CHUNK
        pause = soon if pause is None else min(pause, soon)
        due = self._events.next_step
        if due is not None:
            steps = min(steps, due - w.steps)
        judged = round(self.judged_from / self.simulation.step)
        watched = self._watch.until_next(w.steps)
        if watched is not None:
            steps = min(steps, watched)
        if w.steps < judged:
            pause = min(pause, judged)
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

    def _refer(self) -> None:
        """Let the drives go by the part of the reference that holds the present time."""
        if self._reference.go_to(self.workspace.time):
            self.workspace.refer(self._reference.table, self._reference.first)

    def follow_same(self, other: Run) -> None:
        """Go by the reference of a run of the same motion, to the last bit."""
        self._reference = other._reference
        self._reference.go_to(self.workspace.time)
        self.workspace.refer(self._reference.table, self._reference.first)

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
