"""Loads during a run: how the kernels have them, and what is updated between steps.

The kernels evaluate the laws of loads themselves. Three things are updated from the state between
steps: payloads that are picked up and released (`Events`), controllers that sample and hold, and
friction that grows with the force that a joint transmits (both by `LoadSchedule`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, MissingName
from jointplay.model.frames import motions, signs_between
from jointplay.model.loop import closing_rows
from jointplay.model.mechanism import Mechanism, frame_index
from jointplay.model.payload import Payload, velocity_after_pick
from jointplay.physics.kernel.layout import LoadSite
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation.loads.base import Load, Site, compiled_law
from jointplay.simulation.loads.controller import Controller, held, hold
from jointplay.simulation.loads.joint_friction import LEVEL, RATE, TIME, LoadedFriction
from jointplay.simulation.result.variables import Phase
from jointplay.simulation.statics import relative_motion, relative_pose
from jointplay.simulation.time_loop import TimeLoop

if TYPE_CHECKING:
    from jointplay.simulation.run import Run

LARGEST_STEP_TURN = 1.0
"""Step times natural frequency of springs above which the step is refused: 6 steps a period [rad].
"""
FINE_STEP_TURN = 0.2
"""Step times natural frequency that is advised: the period is then right to 0.2 % [rad]."""


def load_site(load: Load, mechanism: Mechanism, bounds: Mapping[str, float]) -> LoadSite:
    """A load as the kernels have it.

    `bounds`: efforts at which actuators saturate, by joint [N m or N].
    """
    site = load.site(mechanism)
    law, numbers = int(compiled_law(load).address), load.numbers(mechanism)
    if site.frames is None:
        largest = tuple(bounds.get(name, math.inf) for name in load.driven())
        cut = largest if any(math.isfinite(effort) for effort in largest) else ()
        return LoadSite(law, numbers, load.stores, load.implicit(), site.inputs, site.outputs, cut)
    (i, _), (j, _) = site.frames
    signs = signs_between(mechanism.model, i, j)
    return LoadSite(law, numbers, load.stores, load.implicit(), carriers=site.frames, signs=signs)


def highest_frequency(
    loads: Mapping[str, Load], mechanism: Mechanism, q: np.ndarray
) -> tuple[float, str]:
    """Highest natural frequency on the loads' springs together [rad/s], 0 without springs; and the
    name of the load that is stiffest for its mass.
    """
    # The squared frequencies are the eigenvalues of S M^-1 S^T, a row of S for each spring: the
    # root of its stiffness times its direction.
    model, data, inverse = mechanism.model, mechanism.data, mechanism.inverse_mass_matrix(q)
    rows, names = [], []
    for name, load in loads.items():
        if load.steepest() > 0.0:
            names.append(name)
            rows.append(np.sqrt(load.steepest()) * _direction(load.site(mechanism), model, data, q))
    if not rows:
        return 0.0, ""
    springs = np.array(rows)
    squares = springs @ inverse @ springs.T
    frequency = float(np.sqrt(max(np.linalg.eigvalsh(squares)[-1], 0.0)))
    return frequency, names[int(np.argmax(np.diag(squares)))]


def check_step(loads: Mapping[str, Load], mechanism: Mechanism, step: float, q: np.ndarray) -> None:
    """Refuse a step too large for the loads' springs, all together, naming the stiffest one."""
    frequency, stiffest = highest_frequency(loads, mechanism, q)
    if frequency * step > LARGEST_STEP_TURN:
        swing = f"a swing on its springs at {frequency / (2.0 * np.pi):.3g} Hz"
        most = f"take at most {FINE_STEP_TURN / frequency:.2g} s"
        advice = f"step {step:g} s is too large for the load {stiffest!r}, {swing}: {most}"
        raise JointplayError(advice, ("step",))


def _direction(site: Site, model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
    """Jacobian of a spring's length or angle, shape (nv,)."""
    if site.frames is None:
        row = np.zeros(model.nv)
        row[list(site.outputs)] = site.levers or 1.0
        return row
    pin.computeJointJacobians(model, data, q)
    along = relative_pose(data, site.frames)[:3]
    size = float(np.linalg.norm(along))
    along = along / size if size > 0.0 else np.array([1.0, 0.0, 0.0])
    (i, _), (j, _) = site.frames
    return along @ relative_motion(data, site.frames, signs_between(model, i, j))[:3]


def _steps_in(period: float, step: float, whose: str) -> int:
    """Steps in a sampling period [s], which must be a multiple of the step."""
    steps = round(period / step)
    if steps < 1 or abs(period / step - steps) > 1e-6 * steps:
        raise JointplayError(
            f"the period {period:g} s of {whose} must be a multiple of the step {step:g} s"
        )
    return steps


class Events:
    """Payloads picked up and released in a run, in the order of the steps at which that happens.

    Attributes:
        phases: stretches so far in which the bodies keep their inertias.

    Raises:
        MissingName: a payload at a frame that does not exist.
    """

    def __init__(self, run: Run) -> None:
        simulation, step = run.simulation, run.simulation.step
        self._mechanism, self._model = run.mechanism, run.model
        self._record_every = simulation.record_every
        self.phases = [Phase(0, run.mechanism.model.copy())]
        planned: list[tuple[int, Payload, bool]] = []
        for payload in simulation.payloads:
            if not run.model.existFrame(payload.frame):
                names = [frame.name for frame in run.model.frames if frame.name != "universe"]
                raise MissingName("frame for a payload", payload.frame, names)
            for time, picked in ((payload.pick, True), (payload.release, False)):
                if time is not None:
                    planned.append((round(time / step), payload, picked))
        self._planned = sorted(planned, key=lambda event: event[0], reverse=True)

    @property
    def next_step(self) -> int | None:
        """Step before which something happens; None if nothing will."""
        return self._planned[-1][0] if self._planned else None

    def apply_due_events(self, w: Workspace) -> None:
        """Pick up and release what is due.

        The mechanism moves on with a body that it picks up as the momentum of both demands
        (`velocity_after_pick`). The rise of the bodies' energy counts as brought in by the payload.
        """
        while self._planned and self._planned[-1][0] <= w.steps:
            _, payload, picked = self._planned.pop()
            last, driven, speed = self.phases[-1], self._model.copy(), w.v.copy()
            bodies = self._change(payload, picked)
            brought = last.energy
            if w.steps > 0:
                if picked:
                    ideal = set(self._mechanism.loops) - set(self._mechanism.clearance)
                    rows = closing_rows(self._mechanism, w.q, ideal)
                    w.v[:] = velocity_after_pick(driven, self._model, w.q, speed, rows)
                before, now = last.model.copy(), bodies.copy()
                base = self._mechanism.base_joint
                for model in (before, now):  # the free base turns from the chart of the run
                    model.jointPlacements[base] = self._model.jointPlacements[base]
                brought += _energy(now, w.q, w.v) - _energy(before, w.q, speed)
            row = -(-w.steps // self._record_every)
            self.phases.append(Phase(row, bodies, brought))

    def memory(self) -> list[tuple[int, float]]:
        return [(phase.row, phase.energy) for phase in self.phases]

    def recall(self, memory: Sequence[Sequence[float]]) -> None:
        for row, energy in list(memory)[len(self.phases) :]:
            _, payload, picked = self._planned.pop()
            bodies = self._change(payload, picked)
            self.phases.append(Phase(int(row), bodies, float(energy)))

    def _change(self, payload: Payload, picked: bool) -> pin.Model:
        """Change the inertias of the run's model; returns the model of the bodies alone."""
        bodies = self.phases[-1].model.copy()  # without the armature of prescribed motion
        frame = bodies.frames[frame_index(bodies, payload.frame)]
        body = frame.placement.act(payload.body)
        for model in (self._model, bodies):
            held = model.inertias[frame.parentJoint]
            model.inertias[frame.parentJoint] = held + body if picked else held - body
        return bodies


def _energy(model: pin.Model, q: np.ndarray, v: np.ndarray) -> float:
    data = model.createData()
    kinetic = pin.computeKineticEnergy(model, data, q, v)
    return float(kinetic + pin.computePotentialEnergy(model, data, q))


REACTION_S = 2e-4
"""Interval over which the force that a joint transmits is averaged, for its friction [s]: that of
the longest macro steps, between which Pinocchio knows no forces."""


class ReactionLoads:
    """Friction of joints that follows the force which they transmit, updated between steps.

    Forces follow by inverse dynamics from the mean motion over the last interval; friction goes on
    from its value in the middle of that along a line through the value before.
    """

    def __init__(self, run: Run, sites: Sequence[LoadSite]) -> None:
        self._workspace, self._model, mechanism = run.workspace, run.model, run.mechanism
        self.members = [
            (load, site.numbers, *_axis(mechanism, load.joint))
            for load, site in zip(run.simulation.loads.values(), sites, strict=True)
            if isinstance(load, LoadedFriction)
        ]
        """Load, numbers of its law, Pinocchio joint, axis, and whether the joint slides."""
        self._between_frames = [
            (index, site.carriers) for index, site in enumerate(sites) if site.carriers is not None
        ]
        self._data: pin.Data | None = None
        self._before: tuple[float, np.ndarray, np.ndarray] | None = None
        """Time [s], q and v of the last update."""

    def memory(self) -> list[Any] | None:
        if self._before is None:
            return None
        time, q, v = self._before
        return [time, q.tolist(), v.tolist()]

    def recall(self, memory: Sequence[Any] | None) -> None:
        if memory is not None:
            time, q, v = memory
            self._before = float(time), np.array(q, float), np.array(v, float)

    def begin(self, v: np.ndarray, acceleration: np.ndarray) -> None:
        """Set friction by the forces of the first instant, which no friction has changed yet."""
        w = self._workspace
        levels = self._friction(w.q, v, acceleration)
        for (_, numbers, *_place), level in zip(self.members, levels, strict=True):
            numbers[TIME], numbers[LEVEL], numbers[RATE] = w.time, level, 0.0
        self._before = (w.time, w.q.copy(), v.copy())

    def update(self, v: np.ndarray) -> None:
        """Set friction by the mean forces since the last update, extrapolated along a line."""
        w = self._workspace
        assert self._before is not None
        time, q, speed = self._before
        span = w.time - time
        if span <= 0.0:
            return
        middle = 0.5 * (w.q + q), (w.q - q) / span, (v - speed) / span
        levels = self._friction(*middle)
        for (_, numbers, *_place), level in zip(self.members, levels, strict=True):
            now = time + 0.5 * span
            apart = now - numbers[TIME]
            rate = (level - numbers[LEVEL]) / apart if apart > 0.0 else 0.0
            numbers[TIME], numbers[LEVEL], numbers[RATE] = now, level, rate
        self._before = (w.time, w.q.copy(), v.copy())

    def _friction(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> list[float]:
        """Friction of each member [N m or N] by the forces that joints transmit in this motion."""
        model = self._model
        data = self._data = self._data or model.createData()
        # Wrenches of loads between frames, on the bodies, each in its joint's frame.
        forces = pin.StdVec_Force()
        forces.extend([pin.Force.Zero()] * model.njoints)
        if self._between_frames:
            pin.forwardKinematics(model, data, q)
        for index, ((i, first), (j, second)) in self._between_frames:
            wrench = self._workspace.loads["wrench"][index]
            turn = (data.oMi[i] * first).rotation
            at = (data.oMi[j] * second).translation
            on_second = pin.SE3(np.eye(3), at).act(pin.Force(turn @ wrench[:3], turn @ wrench[3:]))
            forces[j] = forces[j] + data.oMi[j].actInv(on_second)
            forces[i] = forces[i] - data.oMi[i].actInv(on_second)
        pin.rnea(model, data, q, v, a, forces)
        return [
            load.friction(data.f[joint].linear, axis, slides)
            for load, _, joint, axis, slides in self.members
        ]


def _axis(mechanism: Mechanism, name: str) -> tuple[int, np.ndarray, bool]:
    """Index of a Pinocchio joint, its axis in its own frame, and whether it slides."""
    model = mechanism.model
    index = int(model.getJointId(name))
    slides = mechanism.description.joints[name].slides
    if name in mechanism.clearance:
        return index, np.array([0.0, 0.0, 1.0]), slides
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    (column,) = motions(model, data, index)
    return index, column[:3] if slides else column[3:], slides


class LoadSchedule:
    """When loads are updated from the state of a run: sampled controllers, loaded friction.

    Raises:
        JointplayError: a period of a controller or servo that is no multiple of the step.
    """

    def __init__(self, run: Run, sites: Sequence[LoadSite]) -> None:
        self._workspace, step = run.workspace, run.simulation.step
        self._reactions = ReactionLoads(run, sites)
        self._controllers = [
            (load, site, _steps_in(load.period, step, f"the controller {name!r}"), load.sampler())
            for (name, load), site in zip(run.simulation.loads.items(), sites, strict=True)
            if isinstance(load, Controller) and load.period is not None
        ]
        self._last_step = -1
        """Step at which controllers sampled last."""
        reactions = [max(round(REACTION_S / step), 1)] if self._reactions.members else []
        self._looks = [*(interval for _, _, interval, _ in self._controllers), *reactions]
        """Intervals at which something is updated here [steps]."""
        # Servos sample in compiled code, at the ends of stretches.
        periods = map(float, self._workspace.servos["period"])
        servos = [_steps_in(period, step, "a servo") for period in periods if period > 0.0]
        self._stops = [*self._looks, *servos]
        """Intervals at which a stretch must end [steps]."""
        self._reactions_every = reactions[0] if reactions else None

    def steps_until_next(self, step: int) -> int | None:
        """Steps from `step` until a stretch must end; None if never."""
        return min((interval - step % interval for interval in self._stops), default=None)

    def is_due(self, step: int) -> bool:
        return any(step % interval == 0 for interval in self._looks)

    def start(self, loop: TimeLoop) -> None:
        """Let a loop begin, and once more when the forces that joints transmit are known."""
        w = self._workspace
        self._sample(w.v, jumps=False)
        loop.begin()
        if self._reactions.members:
            self._reactions.begin(w.v, w.acceleration)
            loop.begin()

    def look(self, loop: TimeLoop, last: bool) -> None:
        """Update what is due by the present state; no controller samples the last one."""
        w = self._workspace
        if self._reactions_every and w.steps % self._reactions_every == 0:
            self._reactions.update(loop.velocity())
        if last or all(w.steps % interval for _, _, interval, _ in self._controllers):
            return
        if loop.method.single_rate:
            loop.synchronize()
            self._sample(w.v, jumps=False)
            loop.begin()
        else:
            self._sample(loop.velocity(), jumps=True)

    def _sample(self, v: np.ndarray, jumps: bool) -> None:
        """Sample the controllers that are due at the present step.

        They may integrate, so that each is called once at an instant: if the loop begins again
        there, it holds the same torques. With `jumps` the torques before count for half of the
        present instant.
        """
        w = self._workspace
        for load, site, interval, sampler in self._controllers:
            if w.steps % interval == 0:
                inputs = list(site.inputs)
                if self._last_step == w.steps:
                    torques = held(site.numbers)
                else:
                    torques = load.torques(sampler, w.time, w.q[inputs].copy(), v[inputs].copy())
                hold(site.numbers, w.time, torques, jumps)
        self._last_step = w.steps

    def memory(self) -> dict[str, Any]:
        """State for a checkpoint; the numbers of the loads are in the workspace's.

        Raises:
            JointplayError: a controller that cannot say its state.
        """
        states = [load.remember(sampler) for load, _, _, sampler in self._controllers]
        return {"step": self._last_step, "states": states, "reactions": self._reactions.memory()}

    def recall(self, memory: Mapping[str, Any]) -> None:
        self._last_step = int(memory["step"])
        for (_, _, _, sampler), state in zip(self._controllers, memory["states"], strict=True):
            if state is not None:
                cast(Any, sampler).recall(state)
        self._reactions.recall(memory["reactions"])
