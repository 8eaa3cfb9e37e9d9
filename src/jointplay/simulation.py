"""The time loop (eqs 22, 23)."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from typing import Any

import numba
import numpy as np
import pinocchio as pin
from tqdm import tqdm

from jointplay import kernel
from jointplay.contact.law import address, check_parameters
from jointplay.drive import REFERENCE_NODE_S, ComputedTorque, JointFriction
from jointplay.errors import JointplayError, MissingName, require_positive
from jointplay.geometry import CONTACTS
from jointplay.histories import assemble
from jointplay.impact import REFERENCE_SPEED, contact_duration
from jointplay.integrators import DEFAULT, Integrator, integrator
from jointplay.kernel import Status, Workspace
from jointplay.mechanism import Mechanism
from jointplay.motion import Motion
from jointplay.result import Result

MIN_CONTACT_STEPS = 4.0
"""Fewer steps in an impact than this and the step is refused.

At 4 steps the restitution of an impact scatters by 0.03, at 2 an impact can gain energy.
"""

PERTURBATION = 0.5
"""Largest displacement of a perturbed journal at the start, relative to its clearances.

Nobody knows where in its bearing a journal rests when the motion begins. Much smaller
displacements are often forgotten: a journal wedged by the first stroke starts afresh.
"""

_TABLE = (numba.int64[::1],)
"""Signature of all kernels."""

_CHUNK = 2000
"""Steps between two looks at the clock and the keyboard."""


@dataclass(frozen=True)
class Simulation:
    """Everything that defines a run. Equal simulations give bit-identical results on one machine.

    Raises:
        JointplayError: on anything that cannot be simulated; see `prepare`.
    """

    mechanism: Mechanism
    motion: Motion
    drive: ComputedTorque = field(default_factory=ComputedTorque)
    duration: float | None = None
    """Simulated time [s]; None takes the motion's."""
    step: float = 1e-5
    """Time step [s]."""
    integrator: str = DEFAULT
    record_every: int = 10
    """Steps between two records; peaks in between are held."""
    joint_friction: Mapping[str, JointFriction] | None = None
    """Friction by joint; None takes the URDF's <dynamics> entries."""
    seed: int | None = None
    """Displaces each journal at the start by a random vector of up to half its clearances."""

    def describe(self) -> dict[str, Any]:
        """All inputs as plain data; `from_description` reads it back."""
        return {
            "mechanism": self.mechanism.describe(),
            "motion": self.motion.describe(),
            "drive": self.drive.describe(),
            "duration": self.duration,
            "step": self.step,
            "integrator": self.integrator,
            "record_every": self.record_every,
            "joint_friction": None
            if self.joint_friction is None
            else {name: asdict(value) for name, value in self.joint_friction.items()},
            "seed": self.seed,
        }

    @classmethod
    def from_description(cls, description: Mapping[str, Any]) -> Simulation:
        """Build the simulation that `describe` described."""
        fields = dict(description)
        fields["mechanism"] = Mechanism.from_description(fields["mechanism"])
        fields["motion"] = Motion.from_description(fields["motion"])
        fields["drive"] = ComputedTorque(**fields["drive"])
        if fields["joint_friction"] is not None:
            fields["joint_friction"] = {
                name: JointFriction(**value) for name, value in fields["joint_friction"].items()
            }
        return cls(**fields)

    def prepare(self) -> Run:
        """Check everything and make ready to step.

        Raises:
            JointplayError: a step, duration or record interval that makes no sense, a step too
                large for the contact stiffness, or a motion that does not fit the mechanism.
        """
        return Run(self)

    def run(self, progress: bool = False) -> Result:
        """`prepare`, then `Run.execute`."""
        return self.prepare().execute(progress)


def simulate(
    mechanism: Mechanism, motion: Motion, *, progress: bool = False, **options: Any
) -> Result:
    """Simulate `mechanism` following `motion`; `options` are the fields of `Simulation`."""
    return Simulation(mechanism, motion, **options).run(progress)


class Run:
    """A simulation made ready to step: its workspace, and the initial state in it."""

    def __init__(self, simulation: Simulation) -> None:
        """Check the numbers, tabulate the drive, place the journals."""
        self.simulation = simulation
        mechanism = simulation.mechanism
        self.mechanism = mechanism
        self.method: Integrator = integrator(simulation.integrator)
        step = require_positive("step", simulation.step, "s")
        duration = simulation.duration
        duration = simulation.motion.duration if duration is None else duration
        duration = require_positive("duration", duration, "s")
        every = simulation.record_every
        if not isinstance(every, int) or every < 1:
            raise JointplayError(f"record_every must be a whole number >= 1, got {every!r}")
        self.steps = round(duration / step)
        if self.steps < 1:
            raise JointplayError(f"duration {duration:g} s is shorter than the step {step:g} s")
        friction = simulation.joint_friction
        if friction is None:
            entries = mechanism.description.joints
            friction = {
                name: JointFriction(entries[name].friction, entries[name].damping)
                for name in mechanism.joints
            }
        for name in friction:
            if name not in mechanism.joints:
                raise MissingName("moving joint", name, mechanism.joints)
        self.friction = friction
        rows, reference = simulation.drive.tabulate(
            mechanism, simulation.motion, duration, friction
        )
        joints, laws = [], []
        for name, clearance in mechanism.clearance.items():
            law = clearance.normal
            radial, axial = (
                check_parameters(law.parameters(contact), law.name)
                for contact in (clearance.radial_contact, clearance.axial_contact)
            )
            joints.append(
                kernel.joint_row(
                    clearance.ri,
                    clearance.rj,
                    clearance.li,
                    clearance.lj,
                    mechanism.virtual_link(name),
                    radial,
                    axial,
                    check_parameters(clearance.friction.parameters(), clearance.friction.name),
                )
            )
            laws.append((address(law), address(clearance.friction)))
        self.workspace = Workspace(
            mechanism.data.ddq,
            np.array(joints),
            np.array(laws, np.int64).reshape(-1, 2),
            rows,
            reference,
            REFERENCE_NODE_S,
            step,
            every,
            self.steps // every + 2,
        )
        # What pin.aba is called with. Its Python binding tries the form with external forces first:
        # to give it none costs less than to leave them out.
        model, none = mechanism.model, pin.StdVec_Force()
        none.extend([pin.Force.Zero()] * model.njoints)
        q, v, tau = self.workspace.q, self.workspace.v, self.workspace.tau
        self._state = (model, mechanism.data, q, v, tau, none, pin.Convention.WORLD)
        position, velocity, _ = simulation.motion(np.zeros(1))
        for index, name in enumerate(simulation.motion.joints):
            at = mechanism.coordinate(name)
            q[at], v[at] = position[0, index], velocity[0, index]
        self._check_step(step)
        if simulation.seed is not None:
            self._perturb(simulation.seed)

    def _check_step(self, step: float) -> None:
        for name in self.mechanism.clearance:
            duration = contact_duration(self.mechanism, name, self.workspace.q)
            if duration < MIN_CONTACT_STEPS * step:
                raise JointplayError(
                    f"step {step:g} s is too large for the contact stiffness at {name!r}: an "
                    f"impact at {REFERENCE_SPEED:g} m/s lasts {duration:.2g} s, so take at most "
                    f"{duration / kernel.WELL_RESOLVED_STEPS:.2g} s"
                )

    def _perturb(self, seed: int) -> None:
        random = np.random.default_rng(seed)
        for name, clearance in self.mechanism.clearance.items():
            at = self.mechanism.virtual_link(name)
            room = np.array([clearance.cr, clearance.cr, clearance.ca])
            self.workspace.q[at : at + 3] += PERTURBATION * room * random.uniform(-1.0, 1.0, 3)

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
        description = self.simulation.describe()
        return assemble(
            self.mechanism, description, self.workspace, self.friction, status, message, elapsed
        )

    def loop(self, progress: bool = False) -> Status:
        """Step until the end, a failure, or Ctrl-C; returns why it stopped."""
        workspace = self.workspace
        if progress and not self.method.advance.signatures:
            note = "loading compiled kernels (the first start ever compiles them, ~20 s)"
            tqdm.write(note, file=sys.stderr)
        for function in (kernel.begin, kernel.record, self.method.advance):
            function.compile(_TABLE)
        bar = _Bar(self.steps * self.simulation.step, progress)
        try:
            self.begin()
            while workspace.steps < self.steps:
                if not self.advance(min(_CHUNK, self.steps - workspace.steps)):
                    return workspace.status
                bar.update(workspace.time)
            kernel.record(workspace.table)
            return workspace.status
        except KeyboardInterrupt:
            return Status.INTERRUPTED
        finally:
            bar.close()

    def begin(self) -> None:
        """Evaluate forces and acceleration of the initial state."""
        kernel.begin(self.workspace.table)
        pin.aba(*self._state)

    def advance(self, steps: int) -> bool:
        """Do `steps` steps, or fewer if the run fails; returns whether all is well."""
        table, advance, aba, state = self.workspace.table, self.method.advance, pin.aba, self._state
        for _ in range(steps * self.method.stages):
            if advance(table):
                return False
            aba(*state)
        return True

    def message(self, status: Status) -> str:
        """One line on how the run ended."""
        workspace = self.workspace
        at = f"at t = {workspace.time:.6g} s (step {workspace.steps})"
        if status == Status.COMPLETED:
            return f"completed {workspace.time:g} s in {workspace.steps} steps"
        if status == Status.INTERRUPTED:
            return f"interrupted {at}; {workspace.rows} records kept"
        state = ", ".join(
            f"{name} = {q:.6g} ({v:.4g}/s)"
            for name, q, v in zip(self.mechanism.coordinates, workspace.q, workspace.v, strict=True)
        )
        joint, contact = workspace.bad_contact
        if status == Status.RUN_AWAY:
            what = "the state ran away or is not a number"
            remedy = "reduce the step or the drive's bandwidth"
        else:
            name = list(self.mechanism.clearance)[joint]
            law = self.mechanism.clearance[name]
            if status == Status.BROKE_OUT:
                what = f"the journal of {name!r} broke out of its bearing ({CONTACTS[contact]})"
                remedy = "reduce the step or check stiffness and loads"
            else:
                what = (
                    f"law {law.normal.name!r} or {law.friction.name!r} of {name!r} "
                    f"returned a non-finite value ({CONTACTS[contact]})"
                )
                remedy = "correct the law"
        return f"stopped {at}: {what}; {remedy}. State: {state}"


class _Bar:
    """Progress by simulated time: speed relative to real time, and time left."""

    def __init__(self, total: float, show: bool) -> None:
        layout = (
            "{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, {remaining} left"
        )
        self._bar = tqdm(total=total, disable=not show, bar_format=layout, mininterval=0.2)
        self._started = time.perf_counter()

    def update(self, now: float) -> None:
        if self._bar.disable or not math.isfinite(now):
            return
        speed = now / max(time.perf_counter() - self._started, 1e-9)
        self._bar.set_postfix_str(f"{speed:.2f} x real time", refresh=False)
        self._bar.update(now - self._bar.n)

    def close(self) -> None:
        self._bar.close()
