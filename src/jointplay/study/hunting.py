"""Hunting: does a position servo with play in its gear oscillate at rest?

Of a servo one joint is looked at, the others held: a motor, its gear, the link's inertia as
Pinocchio has it at the pose, the torque of gravity, friction. Joints that controllers of the user's
own set move together, in the whole robot. The engine runs them from several starts aside, and the
same without play. A describing function of the play, the first harmonic of what a gap makes of a
sine, is the screen beside servos; it is derived here, and tested by integration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, require_a, require_known, require_positive, within
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Column, Table, counted, few
from jointplay.model import urdf
from jointplay.model.gear import Gearing
from jointplay.model.impact import tooth_duration
from jointplay.model.mechanism import Mechanism, loaded
from jointplay.physics.kernel import JOINT_FRICTION_SPEED, WELL_RESOLVED_STEPS, Status
from jointplay.simulation.checks import joint_friction
from jointplay.simulation.loads import Controller, Free, JointFriction, Prescribed, Servo, Wrench
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.slow_motion import slow_motion
from jointplay.study.study import Study

STARTS = (0.5, 2.0, 8.0)
"""How far joint and motor start from the goal, in plays of the gear."""

STEPPED_S = 60.0
"""So long the engine runs a joint under a servo; what is not clear then is too slow to be stepped,
and is asked of `slow_motion`. With 20 s one of 110 random joints, that swings fast but grows
slowly, is beyond that, too."""

HORIZON_S = 1e5
"""Longest motion under a servo: what would not come aside in a day is at rest (judged)."""

DIES = math.sqrt(10.0)
"""What comes no more times as far in the last nine tenths of a day as in nine tenths of the time
before dies out: it is 10 for what lasts, 1 for what slows down as 1/t."""

LONGEST_S, SEARCH_S, MAP_S = 300.0, 60.0, 12.0
"""Under controllers of the user's own, which only the engine can run, a run that does not end
before, because it is clear whether its swings last, lasts so long. One of the many that look for a
gain, or make a map, lasts less, and more of them are unclear."""

STEP_S, RECORD_S = 2e-4, 1e-3
"""Longest step, and interval of records."""

FIRST_LOOK_S, LOOKS = 0.7, 1.5
"""When a run is looked at first, and by how much later each time; it is a time of several swings
of what is fast."""

LEAST = 0.01
"""Half a swing, in plays of the gear, below which nothing is said to hunt. What at its pace, not
growing, would come no farther in a day, under controllers in `LONGEST_S`, is at rest."""

ROUNDING = 1e-3
"""What would not even come by this part of it need not slow down."""

STEADY, EVEN = 0.02, 2e-3
"""Swings of three spans of a run that differ by less than the first last: unless they shrink or
grow from each to the next by half as much again or more, as they do before they end, and by more
than the second in all."""

LASTS = 0.9
"""At the end of the longest run swings need be no steadier than that the last keep so much."""

UNITS = {"p_gain": "V/rad", "i_gain": "V/(rad*s)", "d_gain": "V*s/rad"}
"""Of a servo's gains."""

REACH = 6
"""A gain is doubled so many times until it hunts, and halved until it is quiet."""

BETWEEN = 7
"""Gains that are tried between the largest quiet and the smallest that hunts, twice."""


class Swing(NamedTuple):
    """What a joint does at rest."""

    hunts: bool
    amplitude: float
    """Half of the joint's way to and fro [rad or m]; 0 if it comes to rest, inf if it diverges."""
    frequency: float
    """[Hz]; 0 if it comes to rest."""
    twist: float = 0.0
    """Half of what the gear turns in itself to and fro [rad or m]."""
    unclear: bool = False
    """Whether it still moves at the end of the longest run, which does not tell how it goes on."""


QUIET = Swing(False, 0.0, 0.0)
DIVERGES = Swing(True, math.inf, 0.0)

FINER = 4
"""A run that diverges is made again with steps so many times shorter, which may be at fault."""


@dataclass(frozen=True)
class Axis:
    """One joint of a robot at a pose, all others held; its position counts from the pose.

    Quantities of rotation stand for those of translation of a prismatic joint.
    """

    joint: str
    slides: bool
    inertia: float
    """That the joint moves, the motor's not counted [kg m^2]."""
    load: float
    """Torque of gravity on the joint [N m]."""
    gear: Gearing
    drive: Servo | Controller
    friction: JointFriction

    @property
    def axes(self) -> tuple[Axis, ...]:
        return (self,)

    @property
    def gains(self) -> dict[str, float]:
        """Those of the servo, by name."""
        return {name: getattr(self.drive, name) for name in UNITS}

    def with_gains(self, **gains: float) -> Axis:
        """With other gains of the servo."""
        drive: Any = self.drive
        return replace(self, drive=replace(drive, **gains))

    def mechanism(self) -> Mechanism:
        """A robot of this one joint."""
        j, kind = repr(self.inertia), "prismatic" if self.slides else "continuous"
        inertia = f'<inertia ixx="{j}" iyy="{j}" izz="{j}" ixy="0" ixz="0" iyz="0"/>'
        limit = '<limit effort="0" velocity="0"/>' if self.slides else ""
        text = (
            '<robot name="axis"><link name="base"/><link name="link"><inertial>'
            f'<mass value="{j}"/>{inertia}</inertial></link>'
            f"<joint name={quoteattr(self.joint)} type={quoteattr(kind)}>"
            f'<parent link="base"/><child link="link"/><axis xyz="0 0 1"/>{limit}</joint></robot>'
        )
        return Mechanism(
            urdf.parse(text, Path("-")), gears={self.joint: self.gear}, gravity=(0.0, 0.0, 0.0)
        )

    def simulation(self, duration: float) -> Simulation:
        """Held at zero for so long [s]."""
        assert isinstance(self.drive, Servo)
        way = (0.0, 0.0, self.load)
        push = Wrench("link", force=way) if self.slides else Wrench("link", moment=way)
        return Simulation(
            self.mechanism(),
            Motion([self.joint], [0.0, 1e-2], [[0.0], [0.0]]),
            drive=self.drive,
            joint_friction={self.joint: self.friction},
            loads={} if self.load == 0.0 else {"gravity": push},
            **_at_rest(self.mechanism(), [self.drive], duration),
        )


@dataclass(frozen=True)
class MultiAxis:
    """Joints that controllers of the user's own set, all moving in the whole robot."""

    axes: tuple[Axis, ...]
    """Those that are looked at."""
    whole: Simulation
    """The robot, its other joints held."""

    @property
    def gains(self) -> dict[str, float]:
        """Parameters of the controllers by name; of several ones ``LOAD.NAME``."""
        own = _controllers(self.whole)
        return {
            gain if len(own) == 1 else f"{load}.{gain}": value
            for load, one in own.items()
            for gain, value in zip(one.names, one.parameters, strict=True)
        }

    def with_gains(self, **gains: float) -> MultiAxis:
        """With other parameters of the controllers."""
        values, loads = iter((self.gains | gains).values()), dict(self.whole.loads)
        for name, one in _controllers(self.whole).items():
            loads[name] = replace(one, parameters=tuple(next(values) for _ in one.parameters))
        return replace(self, whole=replace(self.whole, loads=loads))

    def simulation(self, duration: float) -> Simulation:
        """Held at the pose, or where the controllers lead, for so long [s]."""
        drives = self.whole.drive.values()  # type: ignore[union-attr]
        sampled = [*_controllers(self.whole).values(), *drives]
        return replace(self.whole, **_at_rest(self.whole.mechanism, sampled, duration))


Released = Axis | MultiAxis
"""What is released beside its goal."""


def _at_rest(mechanism: Mechanism, sampled: Sequence[Any], duration: float) -> dict[str, Any]:
    """How it is run for so long [s]: its gears resolved, and as drives are sampled."""
    q = mechanism.configuration({})
    step = min(tooth_duration(mechanism, name, q) for name in mechanism.gears) / WELL_RESOLVED_STEPS
    step = min(STEP_S, float(f"{step:.1e}"))
    periods = [period for one in sampled if (period := getattr(one, "period", None)) is not None]
    if periods:
        step = min(periods) / math.ceil(min(periods) / step - 1e-9)
    every = max(round(RECORD_S / step), 1)
    how = {"start": "centred", "limits": "ignore"}
    return {"duration": duration, "step": step, "record_every": every, **how}


def _controllers(simulation: Simulation) -> dict[str, Controller]:
    """Those of the user's own, by the name of the load."""
    return {name: one for name, one in simulation.loads.items() if isinstance(one, Controller)}


def _drives(simulation: Simulation) -> dict[str, Servo | Controller]:
    """What moves each joint: a controller of the user's own, or else its servo."""
    drive, joints = simulation.drive, simulation.mechanism.joints
    given = drive if isinstance(drive, Mapping) else dict.fromkeys(joints, drive)
    own = {name: one for one in _controllers(simulation).values() for name in one.joints}
    return {name: one for name, one in given.items() if isinstance(one, Servo)} | own


def servo_of(joint: str) -> str:
    """The option that gives a joint a servo, with all that it must have."""
    table = 'kind="servo", voltage="12 V", p_gain="20 V/rad"'
    table += ', torque_constant="1.2 N*m/A", resistance="2.7 ohm"'
    return f"--set 'drives.{joint}={{{table}}}' with its numbers"


def released(
    simulation: Simulation, joints: Sequence[str] = (), pose: Mapping[str, float] | None = None
) -> list[Released]:
    """Joints as a simulation has them: servos' each alone, those of own controllers together.

    Args:
        simulation: a robot with its gears, drives, friction, payloads held from the start, and
            controllers among its loads.
        joints: with a gear that has play, and a servo or a controller; none: all of these.
        pose: positions of joints [rad or m]; others are where the motion begins, or at zero.

    Raises:
        JointplayError: what lacks, and what to give.
    """
    require_a("simulation", simulation, "Simulation")
    robot, drives = simulation.mechanism, _drives(simulation)
    loose = [name for name, gear in robot.gears.items() if gear.play > 0.0]
    for name in (*joints, *(pose or {})):
        require_known("moving joint", name, robot.joints)
    able = [name for name in loose if name in drives]
    for name in joints or able or [*loose, *robot.joints][:1]:
        if name not in loose:
            raise JointplayError(
                f'{name!r} has no gear with play: give --preset, or --gear {name}="10 arcmin" '
                f"--set gears.{name}.rotor_inertia=... --set gears.{name}.stiffness=..."
            )
        if name not in drives:
            raise JointplayError(
                f"{name!r} has neither a servo nor a controller of its own: give {servo_of(name)}"
            )
    if robot.loops:
        raise JointplayError("the other joints of a closed loop cannot be held: open it")
    motion = simulation.motion
    begin = {} if motion is None else dict(zip(motion.joints, motion.positions[0], strict=True))
    entries = robot.description.joints
    at = (
        {name: entries[name].neutral for name in robot.joints if name in entries}
        | begin
        | dict(pose or {})
    )
    axes = [_axis(simulation, name, at) for name in dict.fromkeys(joints or able)]
    found: list[Released] = [one for one in axes if isinstance(one.drive, Servo)]
    own = tuple(one for one in axes if isinstance(one.drive, Controller))
    return [*found, MultiAxis(own, _with_others_held(simulation, at))] if own else found


def _axis(simulation: Simulation, joint: str, at: Mapping[str, float]) -> Axis:
    """A joint at a pose."""
    robot = simulation.mechanism
    alone = robot.with_clearance({}, robot.gears)
    bodies = loaded(alone.model, simulation.payloads, 0.0)
    q, k, data = alone.configuration(at), alone.coordinate(joint), bodies.createData()
    inertia = float(pin.crba(bodies, data, q)[k, k])
    load = 0.0 - float(pin.computeGeneralizedGravity(bodies, data, q)[k])
    friction = joint_friction(simulation).get(joint, JointFriction())
    slides, drive = robot.description.joints[joint].slides, _drives(simulation)[joint]
    return Axis(joint, slides, inertia, load, robot.gears[joint], drive, friction)


def _with_others_held(simulation: Simulation, at: Mapping[str, float]) -> Simulation:
    """The robot at a pose, with all joints held that no controller of the user's own sets."""
    robot, drive = simulation.mechanism, simulation.drive
    free = {name for one in _controllers(simulation).values() for name in one.joints}
    servos = drive if isinstance(drive, Mapping) else dict.fromkeys(free, drive)
    drives = {name: servos.get(name, Free()) if name in free else Prescribed() for name in at}
    held = [name for name, one in drives.items() if one.follows]
    place = [at[name] for name in held]
    gears = {name: gear for name, gear in robot.gears.items() if name in free}
    payloads = (replace(one, release=None) for one in simulation.payloads if one.pick == 0.0)
    return Simulation(
        robot.with_clearance({}, gears),
        Motion(held, [0.0, 1e-2], [place, place]) if held else None,
        drive=drives,
        joint_friction=joint_friction(simulation),
        payloads=tuple(payloads),
        loads=simulation.loads,
        state={name: at[name] for name in at if name not in held},
    )


@dataclass(frozen=True)
class Trial:
    """A run of what is released."""

    released: Released
    start: float
    """How far joints and motors begin aside, in plays of their gears."""
    play: bool = True
    """Whether gears have their play."""
    longest: float | None = None
    """[s]; None: `HORIZON_S` under a servo, else `LONGEST_S`."""


def swings(trial: Trial) -> list[Swing]:
    """What each axis does in the end: run until its swings last or are over."""
    axes, alone = trial.released.axes, isinstance(trial.released, Axis)
    longest = trial.longest or (HORIZON_S if alone else LONGEST_S)
    with within(", ".join(axis.joint for axis in axes)):
        simulation = trial.released.simulation(min(STEPPED_S, longest) if alone else longest)
        for finer in (1, FINER):
            run = Run(replace(
                simulation, step=simulation.step / finer,
                record_every=simulation.record_every * finer,
            ))  # fmt: skip
            if (found := _watched(run, trial, longest)) is not None:
                return found
    return [DIVERGES] * len(axes)


def _watched(run: Run, trial: Trial, longest: float) -> list[Swing] | None:
    """What each axis does; None if it diverges."""
    look, robot = FIRST_LOOK_S, run.mechanism
    for name, gear in robot.gears.items():
        run.workspace.q[[robot.coordinate(name), robot.motor(name)]] += trial.start * gear.play
    if not trial.play:
        run.workspace.gears["half_play"] = 0.0
    for moment in run.steps(0.25 * FIRST_LOOK_S):
        if moment.time >= look:
            look *= LOOKS
            if all(found := _seen(run, trial, last=False)):
                return [one for one in found if one]
    result = run.result(only=("q",))
    if result.status == Status.RUN_AWAY:
        return None
    result.completed(", ".join(axis.joint for axis in trial.released.axes))
    if isinstance(trial.released, Axis) and longest > STEPPED_S:
        return [_solved(trial.released, trial, longest)]
    return [one for one in _seen(run, trial, last=True) if one]


def _solved(axis: Axis, trial: Trial, longest: float) -> Swing:
    """What an axis does in the end that is too slow to be stepped."""
    start = trial.start * axis.gear.play
    for time, places in slow_motion(axis, start, trial.play, longest, STEPPED_S, LOOKS):
        if swing := _swing(time, places, axis, last=time[-1] >= longest):
            return swing
    return QUIET._replace(unclear=True)


def _seen(run: Run, trial: Trial, last: bool) -> list[Swing | None]:
    """What a run shows of each axis; None before its end if not clear yet."""
    result, robot, axes = run.result(only=("q",)), run.mechanism, trial.released.axes
    time, q = result.time, result["q"].values
    places = [q[:, [robot.coordinate(axis.joint), robot.motor(axis.joint)]].T for axis in axes]
    return [_swing(time, at, axis, last) for axis, at in zip(axes, places, strict=True)]


def _swing(time: np.ndarray, places: np.ndarray, axis: Axis, last: bool) -> Swing | None:
    """Likewise of one, from link and motor, (2, n), without the first quarter of the run."""
    least = LEAST * axis.gear.play
    horizon = HORIZON_S if isinstance(axis.drive, Servo) else LONGEST_S
    quarter = (len(time) - 1) // 4
    late = len(time) - 1 - 3 * quarter
    ways = [np.ptp(places[:, late + k * quarter :][:, : quarter + 1], axis=1) for k in range(3)]
    pace = ways[2] * horizon / float(time[-1] - time[-1 - quarter])
    rests = pace < 2.0 * least * np.where(ways[2] <= ways[1], 1.0, ROUNDING)
    if rests.all() or (last and rests[1]):
        return QUIET  # in the end a link may float in its play, beside a motor that stands
    later = places[:, late:]
    spans = np.ptp(later, axis=1)
    own = int(np.argmax(spans))  # the motor may swing within the play of a link that stands
    rises = late + _rises(later[own])
    each = (len(rises) - 1) // 3
    if each >= (1 if last else 2) and spans[own] > 2.0 * least:
        cut = rises[[-1 - 3 * each, -1 - 2 * each, -1 - each, -1]]
        sizes = [float(np.ptp(places[own, i:j])) for i, j in pairwise(cut)]
        times = np.diff(time[cut])  # in a dead band what creeps may turn ever later
        if _lasts(sizes, last) and times[2] < times[0] / LASTS:
            at = slice(cut[1], cut[3])
            frequency = 2.0 * each / float(time[cut[3]] - time[cut[1]])
            amplitude, twist = (
                0.5 * float(np.ptp(one[at])) for one in (places[0], places[1] - places[0])
            )
            return Swing(True, amplitude, frequency, twist)
    if not last:
        return None
    quiet = rests
    if isinstance(axis.drive, Servo) and axis.drive.i_gain == 0.0:
        one_way = np.abs(later[:, -1] - later[:, 0]) >= (1.0 - ROUNDING) * spans
        quiet |= one_way & (ways[2] <= (1.0 + ROUNDING) * ways[1])
    if time[-1] >= HORIZON_S:
        tenth = (len(time) - 1) // 10
        way = np.cumsum(np.abs(np.diff(places, axis=1)), axis=1)[:, [tenth // 10, tenth, -1]]
        before, after = np.diff(way, axis=1).T
        quiet |= after < DIES * before
    return QUIET._replace(unclear=not quiet.all())


def _lasts(sizes: Sequence[float], last: bool) -> bool:
    """Whether swings of these three sizes, one after the other, go on so."""
    first, second, third = sizes
    before, after = second - first, third - second
    drifts = before * after > 0.0 and abs(after) > 0.5 * abs(before)
    drifts = drifts and abs(before + after) > EVEN * third
    if last:
        return third > LASTS * max(first, second) and not (drifts and after < 0.0)
    return max(abs(before), abs(after)) < STEADY * third and not drifts


def _rises(values: np.ndarray) -> np.ndarray:
    """Where values pass their middle upwards, noise left out."""
    low, high = values.min(), values.max()
    away = values - 0.5 * (low + high)
    side = np.sign(np.where(np.abs(away) > 0.125 * (high - low), away, 0.0))
    at = np.flatnonzero(side)
    return at[1:][(side[at[1:]] > 0.0) & (side[at[:-1]] < 0.0)]


# The screen.


def describing_function(ratio: np.ndarray | float) -> np.ndarray:
    """Gain of a gap for a sine: N = 1 - 2/pi [asin r + r sqrt(1 - r^2)], r half the gap over the
    amplitude, any shape; 0 within the gap.
    """
    r = np.minimum(ratio, 1.0)
    return np.asarray(1.0 - 2.0 / math.pi * (np.arcsin(r) + r * np.sqrt(1.0 - r * r)))


COARSE = 500
"""Frequencies of a prediction that is not printed."""


def predicted(axis: Axis, motions: int = 2000) -> Swing:
    """The largest swing for which play, taken by its describing function, closes the loop.

    1 + (K + i w d) N(A) G(i w) = 0 with the twist's amplitude A; the motor's dry friction F counts
    as a damper F/hypot(pi V/4, v_s) at its amplitude of speed V (within 4 % the first harmonic of
    F tanh(v/v_s)), sampling as a delay of half a period. No load, dead band, counts, limit of the
    supply or friction with bristles is in it. Worst with an I term (docs/drives.md).
    """
    servo, gear = axis.drive, axis.gear
    if not isinstance(servo, Servo):
        return QUIET
    s = 2j * math.pi * np.logspace(-2.0, 2.5, motions)
    w = s.imag
    control = servo.stall * (servo.p_gain + servo.i_gain / s + servo.d_gain * s)
    control = control * np.exp(-0.5 * s * (servo.period or 0.0))
    loss, spring = gear.losses, gear.steepest + s * gear.damping
    link = axis.inertia * s * s + axis.friction.viscous * s
    viscous = servo.braking + servo.viscous + loss.viscous
    dry, half = servo.friction + loss.running, 0.5 * gear.play
    creeps = 1e-9 if servo.presliding else JOINT_FRICTION_SPEED
    damper = np.zeros(motions)
    for _ in range(60):
        motor = gear.rotor_inertia * s * s + (viscous + damper) * s
        on_link = servo.encoder == "link"
        per_torque = (1.0 + control / link) / motor if on_link else 1.0 / (motor + control)
        gain = -1.0 / (spring * (per_torque + 1.0 / link))
        ratio = _ratio_of(np.clip(gain.real, 1e-9, 1.0 - 1e-9))
        speed = w * np.abs(half / ratio * per_torque / (per_torque + 1.0 / link))
        damper = 0.5 * (damper + dry / np.hypot(0.25 * math.pi * speed, creeps))
    at = np.flatnonzero((gain.imag[1:] > 0.0) != (gain.imag[:-1] > 0.0))
    at = at[(gain.real[at] > 1e-9) & (gain.real[at] < 1.0)]
    if not len(at):
        return QUIET
    best = at[np.argmax(half / ratio[at])]
    twist = half / ratio[best]
    share = np.abs((1.0 / link) / (per_torque + 1.0 / link))[best]
    return Swing(True, float(twist * share), float(w[best] / (2.0 * math.pi)), float(twist))


def _ratio_of(gain: np.ndarray) -> np.ndarray:
    """Half the gap over the amplitude at which a gap has this gain, above 0 and below 1."""
    ratios = np.linspace(0.0, 1.0, 4001)
    return np.maximum(np.interp(-gain, -describing_function(ratios), ratios), 1e-9)


# What is asked of the engine.


@dataclass(frozen=True)
class Hunting:
    """Whether a joint hunts."""

    axis: Axis
    found: Swing
    """The largest of all starts."""
    control: Swing
    """Likewise without play."""
    screen: Swing
    gain: float | None
    """The one that was varied; None: none."""
    quiet: float | None
    """Largest value of it at which all starts came to rest, below the smallest that hunts; None:
    none. Of a `MultiAxis` all joints that were looked at."""
    hunting: float | None
    """Smallest one of those tried at which a start hunts; None: none."""
    above: Swing = QUIET
    """Without play at `hunting`."""

    @property
    def verdict(self) -> str:
        if not self.found.hunts:
            return "unclear" if self.found.unclear else "quiet"
        return "gains, not play" if self.control.hunts else "play"


@dataclass(frozen=True)
class _Search:
    """Runs from several starts."""

    starts: Sequence[float]
    longest: float | None
    jobs: int | None
    bar: ProgressBar

    def largest(
        self, these: Sequence[Released], play: bool, controlled: float = SEARCH_S
    ) -> list[list[Swing]]:
        """The largest swing of each axis of each that is released; `controlled` is how long a run
        under controllers lasts [s].
        """
        trials = []
        for one in these:
            own = self.longest or (None if isinstance(one, Axis) else controlled)
            trials += [Trial(one, start, play, own) for start in self.starts]
        self.bar.total = (self.bar.total or 0) + len(trials)
        found = Study(trials, swings).run(self.jobs, self.bar)
        n = len(self.starts)
        each = (zip(*found[k : k + n], strict=True) for k in range(0, len(found), n))
        return [[max(own, key=_size) for own in axes] for axes in each]

    def safe_gain(
        self, one: Released, gain: str, given: Sequence[Swing]
    ) -> tuple[float | None, float | None]:
        """The largest value that is quiet below the smallest that hunts, and that.

        From the one that it has, and what it does with that: up until it hunts, down until it is
        quiet, and between the two.
        """
        value = one.gains[gain]
        found = {value: given}

        def ends() -> tuple[float | None, float | None]:
            hunts = min(
                (x for x, axes in found.items() if any(y.hunts for y in axes)), default=None
            )
            calm = (x for x, axes in found.items() if not any(y.hunts or y.unclear for y in axes))
            return max((x for x in calm if hunts is None or x < hunts), default=None), hunts

        def look(values: Sequence[float]) -> None:
            axes = self.largest([one.with_gains(**{gain: x}) for x in values], True)
            found.update(zip(values, axes, strict=True))

        for factor, end in ((2.0, 1), (0.5, 0)):
            for k in range(1, REACH + 1):
                if ends()[end] is None:
                    look([value * factor**k])
        for _ in range(2):
            quiet, hunts = ends()
            if quiet is not None and hunts is not None:
                look([float(x) for x in np.geomspace(quiet, hunts, BETWEEN + 2)[1:-1]])
        return ends()


def _size(one: Swing) -> tuple[bool, bool, float]:
    return one.hunts, one.unclear, one.amplitude


def hunting(
    simulation: Simulation,
    joints: Sequence[str] = (),
    pose: Mapping[str, float] | None = None,
    *,
    gain: str | None = None,
    longest: float | None = None,
    starts: Sequence[float] = STARTS,
    jobs: int | None = None,
    progress: bool = False,
) -> list[Hunting]:
    """Find which joints hunt at rest, and up to which gain they do not.

    Args:
        simulation, joints, pose: see `released`.
        gain: that is varied, of `UNITS` or a parameter of an own controller; None: the P gain of
            servos, none of controllers.
        longest: motion, if it is not clear before whether swings last [s]; None: `HORIZON_S` under
            servos, under controllers `LONGEST_S`, or `SEARCH_S` to look for the gain.
        starts: how far aside runs begin, in plays of the gear.
        jobs: processes; None takes one for each core.
        progress: show a bar.

    Raises:
        JointplayError: no such joint or gain; none has play, or a servo; a run that stops.
    """
    if longest is not None:
        require_positive("longest run", longest, "s")
    these, found = released(simulation, joints, pose), []
    for one in these if gain is not None else ():
        _require_gain(one, gain := str(gain))
        if one.gains[gain] == 0.0:
            raise JointplayError(f"{gain} is 0: give a value that can be doubled and halved")
    with ProgressBar(disable=not progress, unit="run", total=0) as bar:
        search = _Search(starts, longest, jobs, bar)
        for one in these:
            (loose,), (tight,) = (search.largest([one], play, LONGEST_S) for play in (True, False))
            name, quiet, hunts, above = gain, None, None, tight
            if name is None and isinstance(one, Axis):
                name = "p_gain"
            if name is not None:
                quiet, hunts = search.safe_gain(one, name, loose)
            if name is not None and hunts is not None:
                (above,) = search.largest([one.with_gains(**{name: hunts})], False)
            varied = None if name is None else one.gains[name]
            for axis, own, control, there in zip(one.axes, loose, tight, above, strict=True):
                screen = predicted(axis)
                found.append(Hunting(axis, own, control, screen, varied, quiet, hunts, there))
    return found


def _require_gain(one: Released, gain: str) -> None:
    if not one.gains:
        named = ", ".join(axis.joint for axis in one.axes)
        raise JointplayError(f"the controller of {named} has no parameters that could be varied")
    require_known("gain", gain, one.gains)


class Span(NamedTuple):
    """Values of a gain."""

    gain: str
    values: np.ndarray


@dataclass(frozen=True)
class GainMap:
    """Swings of a joint over two gains: arrays (second, first)."""

    axis: Axis
    first: Span
    second: Span
    amplitude: np.ndarray
    """Of the joint; 0 where it is quiet [rad or m]."""
    frequency: np.ndarray
    control: np.ndarray
    """Whether it hunts without play."""
    screen: np.ndarray
    """Whether the describing function says so."""
    unclear: np.ndarray
    """Whether it was not to be told in the longest run."""

    @property
    def sentence(self) -> str:
        hunts = self.amplitude > 0.0
        own = int((hunts & ~self.control).sum())
        text = f"{self.axis.joint} hunts at {int(hunts.sum())} of {hunts.size} pairs of gains"
        text += f", at {own} of them by its play" if hunts.any() else ""
        unclear = int(self.unclear.sum())
        return f"{text}; at {unclear} a longer --time must tell" if unclear else text

    @property
    def table(self) -> Table:
        first, second = np.meshgrid(self.first.values, self.second.values)
        length = "m" if self.axis.slides else "rad"
        kinds = {"without play": self.control, "screen": self.screen, "unclear": self.unclear}
        return Table(
            (
                Column(self.first.gain, first.ravel(), UNITS.get(self.first.gain, "")),
                Column(self.second.gain, second.ravel(), UNITS.get(self.second.gain, "")),
                Column("amplitude", self.amplitude.ravel(), length),
                Column("frequency", self.frequency.ravel(), "Hz"),
                *(Column(name, which.ravel().astype(int)) for name, which in kinds.items()),
            )
        )


def gain_map(
    one: Released,
    first: Span,
    second: Span,
    *,
    longest: float | None = None,
    start: float = STARTS[1],
    jobs: int | None = None,
    progress: bool = False,
) -> GainMap:
    """Run a joint at all pairs of two gains, with play and without, once each from one start.

    No motion is longer than `longest` [s]; None: `HORIZON_S` under a servo, else `MAP_S`.

    Raises:
        JointplayError: no such gain, twice the same, or several joints.
    """
    if longest is not None:
        require_positive("longest run", longest, "s")
    for gain, _ in (first, second):
        _require_gain(one, gain)
    if first.gain == second.gain:
        raise JointplayError(f"a map is over two gains, got {first.gain!r} twice")
    if len(one.axes) > 1:
        raise JointplayError(f"a map is of one joint, got {', '.join(a.joint for a in one.axes)}")
    all_of_them = [
        one.with_gains(**{first.gain: float(a), second.gain: float(b)})
        for b in second.values
        for a in first.values
    ]
    with ProgressBar(disable=not progress, unit="run", total=0) as bar:
        search = _Search([start], longest, jobs, bar)
        loose, tight = (
            [each for (each,) in search.largest(all_of_them, play, MAP_S)] for play in (True, False)
        )
    maps = (
        [each.amplitude for each in loose],
        [each.frequency for each in loose],
        [each.hunts for each in tight],
        [predicted(each.axes[0], COARSE).hunts for each in all_of_them],
        [each.unclear for each in loose],
    )
    shape = len(second.values), len(first.values)
    return GainMap(one.axes[0], first, second, *(np.array(each).reshape(shape) for each in maps))


def table(found: Sequence[Hunting], gain: str | None = None) -> Table:
    """A row for each joint; `gain` is the one that was varied, None: the P gain of servos."""
    axes = [one.axis for one in found]
    name, unit = ("P gain", UNITS["p_gain"]) if gain is None else (gain, UNITS.get(gain, ""))
    return Table(
        (
            Column("joint", [one.joint for one in axes]),
            Column("play", [one.gear.play for one in axes], "rad", digits=3),
            Column("inertia", [one.inertia for one in axes], "kg*m^2", digits=3),
            Column("load", [one.load for one in axes], "N*m", digits=3),
            Column("encoder", [one.drive.encoder for one in axes]),
            Column("hunts by", [one.verdict for one in found]),
            Column("amplitude", [one.found.amplitude or None for one in found], "rad", digits=3),
            Column("frequency", [one.found.frequency or None for one in found], "Hz", digits=3),
            Column("predicted", [one.screen.frequency or None for one in found], "Hz", digits=3),
            Column(name, [one.gain for one in found], unit, digits=3),
            Column("quiet up to", [one.quiet for one in found], unit, digits=3),
            Column("hunts from", [one.hunting for one in found], unit, digits=3),
            Column(
                "without play there", ["hunts" if one.above.hunts else "quiet" for one in found]
            ),
        )
    )


def sentence(found: Sequence[Hunting]) -> str:
    """What came out, in a line."""
    said = []
    for one in found:
        if one.found.hunts:
            unit = "mm" if one.axis.slides else "mrad"
            too = "; without play as well: gains, not play" if one.control.hunts else ""
            how = f"+-{1e3 * one.found.amplitude:.3g} {unit} at {one.found.frequency:.3g} Hz"
            how = "without bounds" if one.found == DIVERGES else how
            said.append(f"{one.axis.joint} {how}{too}")
    slow = [one.axis.joint for one in found if one.verdict == "unclear"]
    more = f"; a longer --time must tell of {few(slow)}" if slow else ""
    if not said:
        return f"{counted(len(found), 'joint')} at rest: none hunts{more}"
    hunts = "hunts" if len(said) == 1 else "hunt"
    return f"{len(said)} of {counted(len(found), 'joint')} {hunts} at rest: {', '.join(said)}{more}"


def notes(found: Sequence[Hunting]) -> list[str]:
    """What was assumed, a line each."""
    loaded = [one.axis.joint for one in found if one.axis.load]
    own = [one.axis.joint for one in found if isinstance(one.axis.drive, Controller)]
    lines = [
        "others held; the largest swing of all starts; predicted: by the describing function, "
        "without load, dead band, counts and limit of the supply"
    ]
    if own:
        lines.append(f"moving together under controllers of your own: {few(own)}")
    if loaded:
        lines.append("a load that presses the teeth to one side calms: other poses may hunt")
    return lines
