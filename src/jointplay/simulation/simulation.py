"""The time loop (eqs 22, 23)."""

from __future__ import annotations

import math
import sys
import time
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin
from tqdm import tqdm

from jointplay import kernel
from jointplay.contact.compiled import address, check_parameters
from jointplay.errors import JointplayError, MissingName, require_finite, require_positive
from jointplay.host.late import late
from jointplay.joints import VIRTUAL_LINK
from jointplay.kernel import Status
from jointplay.kernel.integrators import DEFAULT, Integrator, integrator
from jointplay.kernel.workspace import ContactSite, FilmSite, Workspace
from jointplay.loads.drive import (
    ComputedTorque,
    Drive,
    JointFriction,
    assign,
    drive_from_description,
    table_nodes,
    tabulate,
)
from jointplay.mechanism.impact import (
    REFERENCE_SPEED,
    contact_duration,
    effective_mass,
    tooth_duration,
)
from jointplay.mechanism.loop import assemble, closing_rows, consistent_velocity
from jointplay.mechanism.mechanism import Mechanism, frame_index
from jointplay.mechanism.payload import Payload, velocity_after_pick
from jointplay.motion.reference import Motion
from jointplay.result.histories import Phase, histories
from jointplay.result.result import Result
from jointplay.simulation import limits, step_check
from jointplay.simulation.loop import LOOP_CORRECTION, Adaptive, Loop, MultiRate, SingleRate

MIN_CONTACT_STEPS = 4.0
"""Fewer steps in an impact than this and the step is refused.

At 4 steps the restitution of an impact scatters by 0.03 (0.07 at c_e = 0.5), at 2 an impact can
gain energy (docs/validation.md).
"""

PERTURBATION = 0.5
"""Largest displacement of a perturbed journal at the start, relative to its clearances.

Nobody knows where in its bearing a journal rests when the motion begins. Much smaller
displacements are often forgotten: a journal wedged by the first stroke starts afresh.
"""

NO_MASS = 1e-9
"""Part of the mechanism's mass below which what a contact meets counts as no mass."""

FILM_LAG = 0.5
"""Part of the effective mass that a film's lag reckons with: it may fall on the way."""

_CHUNK = 2000
"""Steps between two looks at the clock and the keyboard."""


@dataclass(frozen=True)
class Simulation:
    """Everything that defines a run. Equal simulations give bit-identical results on one machine.

    Raises:
        JointplayError: on anything that cannot be simulated; see `prepare`.
    """

    mechanism: Mechanism
    motion: Motion | None = None
    """Reference of the joints whose drives follow one."""
    drive: Drive | Mapping[str, Drive] = field(default_factory=ComputedTorque)
    """One for all joints of the motion, or by joint; joints that are not named are then free."""
    duration: float | None = None
    """Simulated time [s]; None takes the motion's."""
    step: float = 1e-5
    """Time step [s]."""
    integrator: str = DEFAULT
    macro_step: float | None = None
    """Interval at which the multi-rate method asks Pinocchio for the arm's inertia [s]; None lets
    an error estimate choose it."""
    tolerance: float | None = None
    """Error of a macro step relative to the momentum that contacts and inertia move in it, by which
    the multi-rate method chooses its micro steps; None: all as long as `step`, which otherwise
    sets the times of records only."""
    record_every: int = 10
    """Steps between two records; peaks in between are held."""
    joint_friction: Mapping[str, JointFriction] | None = None
    """Friction by joint; None takes the URDF's <dynamics> entries."""
    seed: int | None = None
    """Displaces each journal at the start by a random vector of up to half its clearances."""
    payloads: Sequence[Payload] = ()
    start: Mapping[str, float] = field(default_factory=dict)
    """Where joints without reference begin [rad or m]; in loops, if not given, they follow."""
    start_speed: Mapping[str, float] = field(default_factory=dict)
    """How fast [rad/s or m/s]."""

    def describe(self) -> dict[str, Any]:
        """All inputs as plain data; `from_description` reads it back."""
        return {
            "mechanism": self.mechanism.describe(),
            "motion": None if self.motion is None else self.motion.describe(),
            "drive": {name: drive.describe() for name, drive in self.drive.items()}
            if isinstance(self.drive, Mapping)
            else [self.drive.describe()],
            "duration": self.duration,
            "step": self.step,
            "integrator": self.integrator,
            "macro_step": self.macro_step,
            "tolerance": self.tolerance,
            "record_every": self.record_every,
            "joint_friction": None
            if self.joint_friction is None
            else {name: asdict(value) for name, value in self.joint_friction.items()},
            "seed": self.seed,
            "payloads": [payload.describe() for payload in self.payloads],
            "start": dict(self.start),
            "start_speed": dict(self.start_speed),
        }

    @classmethod
    def from_description(cls, description: Mapping[str, Any]) -> Simulation:
        """Build the simulation that `describe` described."""
        fields = dict(description)
        fields["mechanism"] = Mechanism.from_description(fields["mechanism"])
        if fields["motion"] is not None:
            fields["motion"] = Motion.from_description(fields["motion"])
        drive = fields["drive"]
        if isinstance(drive, Mapping):
            fields["drive"] = {name: drive_from_description(one) for name, one in drive.items()}
        else:
            fields["drive"] = drive_from_description(drive[0])
        fields["payloads"] = tuple(Payload.from_description(one) for one in fields["payloads"])
        if fields["joint_friction"] is not None:
            fields["joint_friction"] = {
                name: JointFriction(**value) for name, value in fields["joint_friction"].items()
            }
        return cls(**fields)

    def prepare(self, progress: bool = False) -> Run:
        """Check everything and make ready to step.

        Args:
            progress: show a bar on standard error while a long motion is tabulated.

        Raises:
            JointplayError: a step, duration or record interval that makes no sense, a step too
                large for the contact stiffness, or a motion that does not fit the mechanism.
        """
        try:
            return Run(self, progress)
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise JointplayError(
                f"these numbers cannot be computed with, one is far too large or small: {error}"
            ) from None

    def run(self, progress: bool = False, certify: bool = False, check_step: bool = True) -> Result:
        """`prepare`, then `Run.execute`.

        Args:
            progress: see `Run.execute`.
            certify: run again more finely, and put the numerical errors of the headline figures
                into `Result.certificate`.
            check_step: see `Run.execute`.
        """
        result = self.prepare(progress).execute(progress, check_step)
        if certify:
            find_errors = late("analysis.certify:certify")
            try:
                result.certificate = find_errors(result, simulation=self, progress=progress)
            except KeyboardInterrupt:
                text = "interrupted while certifying: the result is whole, but not certified"
                warnings.warn(text, RuntimeWarning, stacklevel=2)
        return result


def simulate(
    mechanism: Mechanism,
    motion: Motion | None = None,
    *,
    progress: bool = False,
    certify: bool = False,
    **options: Any,
) -> Result:
    """Simulate `mechanism` following `motion`; `options` are the fields of `Simulation`.

    See `Simulation.run` for `progress` and `certify`.
    """
    return Simulation(mechanism, motion, **options).run(progress, certify)


class Run:
    """A simulation made ready to step: its workspace, and the initial state in it."""

    def __init__(self, simulation: Simulation, progress: bool = False) -> None:
        """Check the numbers, place the journals, tabulate the drives."""
        self.simulation = simulation
        self.label = ""  # what the progress bar calls the run
        self.guard: Callable[[Run], Run] = lambda run: run
        """Makes a run that is part of this one stop as this one does; see `stopping`."""
        mechanism = simulation.mechanism
        self.mechanism = mechanism
        limits.check_names(mechanism)
        self.method: Integrator = integrator(simulation.integrator)
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
        drives = assign(mechanism, simulation.motion, simulation.drive)
        nodes = table_nodes(simulation.motion, drives, duration)
        limits.check_memory(mechanism, duration, self.steps, every, nodes)
        self.friction = self._friction()
        followed = [name for name, drive in drives.items() if drive.follows]
        q, v = self._initial_state(followed)
        tables, armature = tabulate(
            mechanism, simulation.motion, drives, duration, self.friction, q, progress
        )
        self.phases = [Phase(0, mechanism.model.copy())]
        # The run's own, for payloads and prescribed motion change its inertias.
        self.model = mechanism.model.copy()
        for at, value in armature.items():
            self.model.armature[at] = value
        self.data = self.model.createData()
        self.workspace = Workspace(
            self.data,
            self.model.nv,
            [self._site(name, q) for name in mechanism.clearance],
            tables,
            step,
            every,
            self.steps // every + 2,
            own_acceleration=not self.method.single_rate,
        )
        self.workspace.q[:], self.workspace.v[:] = q, v
        self._events = self._plan(step)
        self._check_step(step, q)
        constraints = mechanism.constraints(q, LOOP_CORRECTION / step)
        parts = (self.model, self.data, self.workspace, self.method, constraints)
        self._loop: Loop
        if self.method.single_rate:
            self._loop = SingleRate(*parts)
        elif simulation.tolerance is None:
            self._loop = MultiRate(*parts, macro_step=simulation.macro_step)
        else:
            self._loop = Adaptive(
                *parts, macro_step=simulation.macro_step, tolerance=simulation.tolerance
            )

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

    def _initial_state(self, followed: Sequence[str]) -> tuple[np.ndarray, np.ndarray]:
        """Loops closed, journals centred or perturbed, and speeds that fit."""
        simulation, mechanism = self.simulation, self.mechanism
        places, speeds = dict(simulation.start), dict(simulation.start_speed)
        for given, unit in ((places, "rad or m"), (speeds, "rad/s or m/s")):
            for name, value in given.items():
                if name not in mechanism.joints:
                    raise MissingName("moving joint", name, mechanism.joints)
                if name in followed:
                    raise JointplayError(
                        f"joint {name!r} follows the motion from its start; give no other"
                    )
                given[name] = require_finite(f"start of joint {name!r}", value, unit)
        if simulation.motion is not None:
            position, velocity, _ = simulation.motion(np.zeros(1))
            for name in followed:
                index = simulation.motion.joints.index(name)
                places[name], speeds[name] = position[0, index], velocity[0, index]
        q = mechanism.configuration(places)
        v = mechanism.configuration(speeds)
        held, moving = (
            [i for name in given for i in (mechanism.coordinate(name), mechanism.motor(name))]
            for given in (places, speeds)
        )
        q = assemble(mechanism, q, held)
        if simulation.seed is not None:
            # A displaced journal moves the loop's other joints, also those whose start is given.
            leading = [i for n in followed for i in (mechanism.coordinate(n), mechanism.motor(n))]
            q = self._perturbed(q, leading, simulation.seed)
        led = [i for n in followed for i in (mechanism.coordinate(n), mechanism.motor(n))]
        return q, consistent_velocity(mechanism, q, v, moving, led)

    def _perturbed(self, q: np.ndarray, held: Sequence[int], seed: int) -> np.ndarray:
        random = np.random.default_rng(seed)
        offsets = {}
        for name, joint in self.mechanism.clearance.items():
            push = PERTURBATION * random.uniform(-1.0, 1.0, 3)
            rooms = np.array([joint.room_to_start.get(part, 0.0) for part in VIRTUAL_LINK[:3]])
            if name in self.mechanism.loops:
                free = self.mechanism.relative_jacobian(name, q)[:3].any(axis=1)
                offsets[name] = push * rooms * free
            else:
                for part, shift in zip(VIRTUAL_LINK[:3], push * rooms, strict=True):
                    if part in joint.freedoms:
                        q[self.mechanism.coordinates.index(f"{name}.{part}")] += shift
        return assemble(self.mechanism, q, held, offsets)

    def _site(self, name: str, q: np.ndarray) -> ContactSite:
        """What the kernels must know of the joint with clearance `name`."""
        mechanism, joint = self.mechanism, self.mechanism.clearance[name]
        parameters = [
            check_parameters(
                joint.normal.parameters(joint.contact_properties(k)), joint.normal.name
            )
            for k in range(len(joint.contacts))
        ]
        rubbing = check_parameters(joint.friction.parameters(), joint.friction.name)
        first = mechanism.virtual_link(name) if mechanism.has_virtual_link(name) else None
        reach: dict[str, Any] = {}
        if first is None:
            reach = {
                "carriers": (mechanism.bearing_frame(name), mechanism.journal_frame(name)),
                "signs": mechanism.signs(name),
            }
        if joint.film is not None:
            law, properties = joint.film
            reach["film"] = FilmSite(
                address(law),
                properties.contacts,
                law.section * properties.length if properties.tilts else 0.0,
                properties.clearance,
                law.thickest(properties.clearance),
                law.transition,
                FILM_LAG * effective_mass(mechanism, name, q),
                check_parameters(law.parameters(properties), law.name),
            )
            reach["must_not_touch"] = 0 if law.hybrid else properties.contacts
        reach["wearing"] = len(joint.worn_widths) if joint.wears else 0
        return ContactSite(
            int(joint.shape),
            joint.dimensions,
            joint.depth_limit,
            address(joint.normal),
            address(joint.friction),
            joint.friction.bristles,
            parameters,
            rubbing,
            first,
            **reach,
        )

    def _plan(self, step: float) -> list[tuple[int, Payload, bool]]:
        """Picks (True) and releases by the step at which they happen, in order."""
        events = []
        for payload in self.simulation.payloads:
            if not self.model.existFrame(payload.frame):
                names = [frame.name for frame in self.model.frames if frame.name != "universe"]
                raise MissingName("frame for a payload", payload.frame, names)
            times = [(payload.pick, True)]
            times += [] if payload.release is None else [(payload.release, False)]
            events += [(round(time / step), payload, picked) for time, picked in times]
        return sorted(events, key=lambda event: event[0], reverse=True)

    def _check_step(self, step: float, q: np.ndarray) -> None:
        for name in self.mechanism.clearance:
            mass = effective_mass(self.mechanism, name, q)
            if not mass >= NO_MASS * pin.computeTotalMass(self.model):
                raise JointplayError(
                    f"a contact in joint {name!r} would meet a mass of {mass:.2g} kg only: a link "
                    "beside it has no mass or inertia of its own; give it some"
                )
            duration = contact_duration(self.mechanism, name, q)
            if duration < MIN_CONTACT_STEPS * step:
                raise JointplayError(
                    f"step {step:g} s is too large for the contact stiffness at {name!r}: an "
                    f"impact at {REFERENCE_SPEED:g} m/s lasts {duration:.2g} s, so take at most "
                    f"{duration / kernel.WELL_RESOLVED_STEPS:.2g} s",
                    where=("step",),
                )

        for name in self.mechanism.gears:
            duration = tooth_duration(self.mechanism, name, q)
            if duration < MIN_CONTACT_STEPS * step:
                raise JointplayError(
                    f"step {step:g} s is too large for the stiffness of the gear at {name!r}: an "
                    f"impact of its teeth lasts {duration:.2g} s, so take at most "
                    f"{duration / kernel.WELL_RESOLVED_STEPS:.2g} s",
                    where=("step",),
                )

    def displace(self, distance: float) -> None:
        """Move every journal aside by `distance` along each axis [m], before the run begins."""
        q = self.workspace.q
        for name, joint in self.mechanism.clearance.items():
            if self.mechanism.has_virtual_link(name):
                for part in VIRTUAL_LINK[:3]:
                    if part in joint.freedoms:
                        q[self.mechanism.coordinates.index(f"{name}.{part}")] += distance
            else:
                moves = self.mechanism.relative_jacobian(name, q)[:3]
                strict = closing_rows(self.mechanism, q, self._ideal_loops)
                aside = np.concatenate([np.full(3, distance), np.zeros(len(strict))])
                q += np.linalg.pinv(np.concatenate([moves, strict])) @ aside

    def execute(self, progress: bool = False, check_step: bool = True) -> Result:
        """Simulate; once only, for the workspace holds the state.

        Args:
            progress: show a bar with simulated time, speed and time left on standard error.
            check_step: where nothing else judges the step, run again with another one: see
                `step_check`. Takes about half of the run's time, in doubt two and a half times
                the run's.

        Returns:
            The result. Interrupted by Ctrl-C, or stopped because the state ran away, it holds
            everything up to there and says so in `Result.status` and `Result.message`; a run that
            stopped also warns.
        """
        started = time.perf_counter()
        start = self.workspace.q.copy(), self.workspace.v.copy()
        status = self.loop(progress)
        elapsed = time.perf_counter() - started
        message = self.message(status)
        if status not in (Status.COMPLETED, Status.INTERRUPTED):
            warnings.warn(message, RuntimeWarning, stacklevel=2)
        result = histories(
            self.mechanism,
            self.simulation.describe(),
            self.workspace,
            self.friction,
            self.phases,
            status,
            message,
            elapsed,
        )
        if check_step and status == Status.COMPLETED and step_check.wanted(self.simulation):
            error = step_check.step_error(self, result, start, progress)
            if error is not None:
                result.amend(step_error=error.tool, relative_step_error=error.relative)
        return result

    def loop(self, progress: bool = False) -> Status:
        """Step until the end, a failure, or Ctrl-C; returns why it stopped."""
        workspace = self.workspace
        if progress and not kernel.enter.signatures:
            note = "loading compiled kernels (the first start ever compiles them, ~20 s)"
            tqdm.write(note, file=sys.stderr)
        kernel.compiled()
        bar = _Bar(self.steps * self.simulation.step, progress, self.label)
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
        self._happen()
        self._loop.begin()

    def stretch(self, most: int = _CHUNK) -> bool:
        """Do some steps, up to `most`, then what is due; returns whether all is well."""
        w = self.workspace
        steps = min(most, self.steps - w.steps)
        if self._events:
            steps = min(steps, self._events[-1][0] - w.steps)
        if not self._loop.stretch(steps):
            return False
        if self._events and self._events[-1][0] == w.steps:
            self._loop.settle()
            self._happen()
            self._loop.begin()
        return True

    def advance(self, steps: int) -> bool:
        """Do `steps` steps, or fewer if the run fails; returns whether all is well."""
        end = self.workspace.steps + steps
        while self.workspace.steps < end:
            if not self.stretch(end - self.workspace.steps):
                return False
        return True

    @property
    def _ideal_loops(self) -> set[str]:
        """Loops without clearance."""
        return set(self.mechanism.loops) - set(self.mechanism.clearance)

    def _happen(self) -> None:
        """Pick and release what is due."""
        w = self.workspace
        while self._events and self._events[-1][0] <= w.steps:
            _, payload, picked = self._events.pop()
            last, driven, speed = self.phases[-1], self.model.copy(), w.v.copy()
            bodies = last.model.copy()  # without the armature of prescribed motion
            frame = bodies.frames[frame_index(bodies, payload.frame)]
            body = frame.placement.act(payload.body)
            for model in (self.model, bodies):
                held = model.inertias[frame.parentJoint]
                model.inertias[frame.parentJoint] = held + body if picked else held - body
            brought = last.energy
            if w.steps > 0:
                if picked:
                    rows = closing_rows(self.mechanism, w.q, self._ideal_loops)
                    w.v[:] = velocity_after_pick(driven, self.model, w.q, speed, rows)
                brought += _energy(bodies, w.q, w.v) - _energy(last.model, w.q, speed)
            row = -(-w.steps // self.simulation.record_every)
            self.phases.append(Phase(row, bodies, brought))

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
            place = law.contacts[contact]
            if status == Status.BROKE_OUT:
                what = f"the journal of {name!r} broke out of its bearing ({place})"
                remedy = "reduce the step or check stiffness and loads"
            elif status == Status.FILM_BROKE:
                what = f"the journal of {name!r} touched its bore through the film ({place})"
                remedy = "let the film be hybrid, or take a more viscous oil"
            else:
                laws = [law.normal, law.friction] + ([law.film[0]] if law.film else [])
                what = (
                    f"law {' or '.join(repr(one.name) for one in laws)} of {name!r} "
                    f"returned a non-finite value ({place})"
                )
                remedy = "correct the law"
        return f"stopped {at}: {what}; {remedy}. State: {state}"


def _energy(model: pin.Model, q: np.ndarray, v: np.ndarray) -> float:
    """Kinetic and potential energy [J]."""
    data = model.createData()
    kinetic = pin.computeKineticEnergy(model, data, q, v)
    return float(kinetic + pin.computePotentialEnergy(model, data, q))


class _Bar:
    """Progress by simulated time: speed relative to real time, and time left."""

    def __init__(self, total: float, show: bool, label: str = "") -> None:
        layout = (
            "{desc}{percentage:3.0f}%|{bar}| {n:.3f}/{total:.3f} s simulated{postfix}, "
            "{remaining} left"
        )
        self._bar = tqdm(
            total=total, disable=not show, bar_format=layout, mininterval=0.2, desc=label or None
        )
        self._started = time.perf_counter()

    def update(self, now: float) -> None:
        if self._bar.disable or not math.isfinite(now):
            return
        speed = now / max(time.perf_counter() - self._started, 1e-9)
        self._bar.set_postfix_str(f"{speed:.2f} x real time", refresh=False)
        self._bar.update(now - self._bar.n)

    def close(self) -> None:
        self._bar.close()
