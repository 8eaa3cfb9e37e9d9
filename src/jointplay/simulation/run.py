"""A run: a simulation made ready to step, that one can hold, watch and continue."""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING

import pinocchio as pin
from tqdm import tqdm

from jointplay import kernel
from jointplay.errors import JointplayError, MissingName, require_positive
from jointplay.kernel import Status
from jointplay.kernel.integrators import DEFAULT, Integrator, integrator
from jointplay.kernel.workspace import Workspace
from jointplay.loads.drive import JointFriction, assign, tabulate
from jointplay.result.histories import Phase, histories
from jointplay.result.result import Result
from jointplay.simulation import ending, initial, limits
from jointplay.simulation.assemble import check_locks, check_step, contact_site
from jointplay.simulation.events import Events
from jointplay.simulation.loop import LOOP_CORRECTION, Adaptive, Loop, MultiRate, SingleRate
from jointplay.simulation.progress import Bar

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

_CHUNK = 2000
"""Steps between two looks at the clock and the keyboard."""


class Run:
    """A simulation made ready to step: its workspace, and the initial state in it."""

    def __init__(self, simulation: Simulation) -> None:
        """Check the numbers, place the journals, tabulate the drives."""
        self.simulation = simulation
        self.label = ""  # what the progress bar calls the run
        self.mechanism = mechanism = simulation.mechanism
        limits.check_names(mechanism)
        self.method: Integrator = integrator(simulation.integrator)
        step, duration = self._check_numbers()
        self.friction = self._friction()
        drives = assign(mechanism, simulation.motion, simulation.drive)
        followed = [name for name, drive in drives.items() if drive.follows]
        q, v = initial.initial_state(simulation, mechanism, followed)
        tables, armature = tabulate(
            mechanism, simulation.motion, drives, duration, self.friction, q
        )
        # The run's own, for payloads and prescribed motion change its inertias.
        self.model = mechanism.model.copy()
        for at, value in armature.items():
            self.model.armature[at] = value
        self.data = self.model.createData()
        self.workspace = Workspace(
            self.data,
            self.model.nv,
            [contact_site(mechanism, self.data, name, q) for name in mechanism.clearance],
            tables,
            step,
            simulation.record_every,
            self.steps // simulation.record_every + 2,
            own_acceleration=not self.method.single_rate,
        )
        self.workspace.q[:], self.workspace.v[:] = q, v
        self._events = Events(
            mechanism, self.model, simulation.payloads, step, simulation.record_every
        )
        check_locks(mechanism, q)
        check_step(mechanism, pin.computeTotalMass(self.model), step, q)
        self._loop = self._make_loop(mechanism.constraints(q, LOOP_CORRECTION / step))

    def _check_numbers(self) -> tuple[float, float]:
        """Refuse settings that make no sense; returns step and duration [s]."""
        simulation = self.simulation
        step = require_positive("step", simulation.step, "s")
        if simulation.macro_step is not None:
            require_positive("macro step", simulation.macro_step, "s")
        if simulation.tolerance is not None:
            require_positive("tolerance", simulation.tolerance, "")
        for option in ("macro_step", "tolerance"):
            value = getattr(simulation, option)
            if value is not None and self.method.single_rate:
                raise JointplayError(
                    f"{option} (got {value:g}) belongs to the integrator {DEFAULT!r}; "
                    f"{self.method.name!r} has a fixed step: leave it out, or take {DEFAULT!r}"
                )
        duration = self._duration()
        every = simulation.record_every
        limits.check_numbers(step, duration, every, simulation.seed)
        self.steps = round(duration / step)
        if self.steps < 1:
            raise JointplayError(f"duration {duration:g} s is shorter than the step {step:g} s")
        limits.check_memory(self.mechanism, duration, self.steps, every)
        return step, duration

    def _duration(self) -> float:
        duration, motion = self.simulation.duration, self.simulation.motion
        if duration is None:
            if motion is None:
                raise JointplayError("a simulation without motion needs a duration [s]")
            duration = motion.duration
        return require_positive("duration", duration, "s")

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

    def execute(self, progress: bool = False) -> Result:
        """Simulate; once only, for the workspace holds the state.

        Args:
            progress: show a bar with simulated time, speed and time left on standard error.

        Returns:
            The result. Interrupted by Ctrl-C, or stopped because the state ran away, it holds
            everything up to there and says so in `Result.status` and `Result.message`; a run that
            stopped also warns.
        """
        started = time.perf_counter()
        status = self.loop(progress)
        elapsed = time.perf_counter() - started
        message = self.message(status)
        if status not in (Status.COMPLETED, Status.INTERRUPTED):
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        return histories(
            self.mechanism,
            self.simulation.describe(),
            self.workspace,
            self.friction,
            self.phases,
            status,
            message,
            elapsed,
        )

    def loop(self, progress: bool = False) -> Status:
        """Step until the end, a failure, or Ctrl-C; returns why it stopped."""
        workspace = self.workspace
        if progress and not kernel.enter.signatures:
            note = "loading compiled kernels (the first start ever compiles them, ~20 s)"
            tqdm.write(note, file=sys.stderr)
        kernel.compiled()
        bar = Bar(self.steps * self.simulation.step, progress, self.label)
        try:
            self.begin()
            while workspace.steps < self.steps:
                if not self.stretch():
                    return workspace.status
                bar.update(workspace.time)
            self._loop.finish()
            return workspace.status
        except KeyboardInterrupt:
            return Status.INTERRUPTED
        finally:
            bar.close()

    def begin(self) -> None:
        """Evaluate forces and acceleration of the initial state, payloads picked at 0 in hand."""
        self._events.happen(self.workspace)
        self._loop.begin()

    def stretch(self, most: int = _CHUNK) -> bool:
        """Do some steps, up to `most`, then what is due; returns whether all is well."""
        w = self.workspace
        steps = min(most, self.steps - w.steps)
        due = self._events.next_step
        if due is not None:
            steps = min(steps, due - w.steps)
        if not self._loop.stretch(steps):
            return False
        if due is not None and due == w.steps:
            self._loop.settle()
            self._events.happen(w)
            self._loop.begin()
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
        return ending.message(self.mechanism, self.workspace, status)
