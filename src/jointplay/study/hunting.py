"""Hunting: does a position servo with play in its gear oscillate at rest?

One joint is looked at, the others held: a motor, its gear, the link's inertia as Pinocchio has it
at the pose, the torque of gravity, friction, and the servo or a controller of the user's own. The
engine runs it from several starts aside, and the same without play. A describing function of the
play, the first harmonic of what a gap makes of a sine, is the screen beside it; it is derived here,
and tested by integration.
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

from jointplay.base.errors import JointplayError, require_a, require_known, require_positive, within
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Column, Table, counted, few
from jointplay.model import urdf
from jointplay.model.gear import Gearing
from jointplay.model.impact import tooth_duration
from jointplay.model.mechanism import Mechanism
from jointplay.physics.kernel import JOINT_FRICTION_SPEED, WELL_RESOLVED_STEPS
from jointplay.simulation.checks import joint_friction
from jointplay.simulation.loads import Controller, Free, JointFriction, Servo, Wrench
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study

STARTS = (0.5, 2.0, 8.0)
"""How far joint and motor start from the goal, in plays of the gear."""

LONGEST_S, PERIODS, MOST_S = 12.0, 12.0, 60.0
"""A run that does not end before, because it is clear whether its swings last, lasts so long, or
so many of the predicted periods, up to the third."""

STEP_S, RECORD_S = 2e-4, 1e-3
"""Longest step, and interval of records."""

FIRST_LOOK_S, LOOKS = 0.7, 1.5
"""When a run is looked at first, and by how much later each time; it is a time of several swings
of what is fast."""

STEADY, LASTS, ENDS = 0.02, 0.9, 0.5
"""Speed in the later half of a run's last swings over that in the earlier. One that differs from 1
by less than the first stays as it is; at the end of the longest run swings that keep more than the
second last, and what keeps less than the third comes to rest; in between it is unclear."""

ONE_WAY = 0.98
"""Part of a motion that leads one way, so that it is no swing: it comes to rest, if slowly."""

LEAST_RAD = 2e-5
"""Half a swing below which nothing is said to hunt."""

GAINS = ("p_gain", "i_gain", "d_gain")

REACH = 6
"""Largest gain that is tried is so many times doubled, the smallest so many times halved."""

BETWEEN = 7
"""Gains that are tried between the largest quiet and the smallest that hunts, twice."""


class Swing(NamedTuple):
    """What a joint does at rest."""

    hunts: bool
    amplitude: float
    """Half of the joint's way to and fro [rad or m]; 0 if it comes to rest."""
    frequency: float
    """[Hz]; 0 if it comes to rest."""
    twist: float = 0.0
    """Half of what the gear turns in itself to and fro [rad or m]."""
    unclear: bool = False
    """Whether it still moves at the end of the longest run, but has not swung often enough."""


QUIET = Swing(False, 0.0, 0.0)


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
    drive: Servo | Free
    friction: JointFriction
    controller: Controller | None = None

    @classmethod
    def of(cls, simulation: Simulation, joint: str, pose: Mapping[str, float]) -> Axis:
        """The joint as a simulation has it.

        Args:
            simulation: a robot with its gears, drives, friction, and controllers among its loads.
            joint: one with a gear that has play, and a servo or a controller.
            pose: positions of joints [rad or m]; others are where the motion begins, or at zero.

        Raises:
            JointplayError: what lacks, and what to give.
        """
        robot = simulation.mechanism
        require_known("moving joint", joint, robot.joints)
        for other in pose:
            require_known("moving joint", other, robot.joints)
        gear, drive, controller = robot.gears.get(joint), *_control(simulation, joint)
        if gear is None or not gear.play > 0.0:
            raise JointplayError(
                f'{joint!r} has no gear with play: give --preset, or --gear {joint}="10 arcmin" '
                f"--set gears.{joint}.rotor_inertia=... --set gears.{joint}.stiffness=..."
            )
        if drive is None and controller is None:
            raise JointplayError(
                f"{joint!r} has neither a servo nor a controller of its own: give --preset, or "
                f"--set 'drives.{joint}.kind=\"servo\"' and its numbers"
            )
        if robot.loops:
            raise JointplayError("the other joints of a closed loop cannot be held: open it")
        alone = robot.with_clearance({}, robot.gears)
        q = np.zeros(alone.model.nq)
        motion = simulation.motion
        begin = {} if motion is None else dict(zip(motion.joints, motion.positions[0], strict=True))
        for name, position in (begin | dict(pose)).items():
            q[alone.coordinate(name)] = position
        at = alone.coordinate(joint)
        return cls(
            joint,
            robot.description.joints[joint].slides,
            float(alone.mass_matrix(q)[at, at]),
            -float(alone.gravity_forces(q)[at]),
            gear,
            Free() if drive is None else drive,
            joint_friction(simulation).get(joint, JointFriction()),
            controller,
        )

    def with_gains(self, **gains: float) -> Axis:
        """With other gains of the servo."""
        drive: Any = self.drive
        return replace(self, drive=replace(drive, **gains))

    @property
    def encoder(self) -> str:
        one = self.drive if self.controller is None else self.controller
        return str(one.encoder)  # type: ignore[union-attr]

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
        mechanism = self.mechanism()
        step = tooth_duration(mechanism, self.joint, np.zeros(2)) / WELL_RESOLVED_STEPS
        step = min(STEP_S, float(f"{step:.1e}"))
        one = self.drive if self.controller is None else self.controller
        period = getattr(one, "period", None)
        if period is not None:
            step = period / math.ceil(period / step - 1e-9)
        held = isinstance(self.drive, Servo)
        way = (0.0, 0.0, self.load)
        push = Wrench("link", force=way) if self.slides else Wrench("link", moment=way)
        loads = {} if self.load == 0.0 else {"gravity": push}
        return Simulation(
            mechanism,
            Motion([self.joint], [0.0, 1e-2], [[0.0], [0.0]]) if held else None,
            drive=self.drive,
            duration=duration,
            step=step,
            record_every=max(round(RECORD_S / step), 1),
            joint_friction={self.joint: self.friction},
            loads=loads if self.controller is None else loads | {"own": self.controller},
            start="centred",
            limits="ignore",
        )


def _control(simulation: Simulation, joint: str) -> tuple[Servo | None, Controller | None]:
    drive = simulation.drive
    given = drive.get(joint) if isinstance(drive, Mapping) else drive
    servo = given if isinstance(given, Servo) else None
    for one in simulation.loads.values():
        if isinstance(one, Controller) and joint in one.joints:
            if one.joints != (joint,):
                raise JointplayError(
                    f"the controller of {joint!r} sets {', '.join(one.joints)}: give each joint one"
                )
            return servo, one
    return servo, None


@dataclass(frozen=True)
class Trial:
    """A run of one joint."""

    axis: Axis
    start: float
    """How far joint and motor begin aside [rad or m]."""
    play: bool = True
    """Whether the gear has its play."""
    longest: float | None = None
    """[s]; None: by the screen."""


def swing(trial: Trial) -> Swing:
    """What a joint does in the end: it is run until its swings last or are over."""
    axis, look, longest = trial.axis, FIRST_LOOK_S, trial.longest
    if longest is None:
        slow = predicted(axis, COARSE).frequency
        longest = min(max(LONGEST_S, PERIODS / slow), MOST_S) if slow else LONGEST_S
    with within(axis.joint):
        run = Run(axis.simulation(longest))
        run.workspace.q[:] = trial.start
        if not trial.play:
            run.workspace.gears["half_play"] = 0.0
        for moment in run.steps(0.25 * FIRST_LOOK_S):
            if moment.time >= look and (found := _seen(run, last=False)) is not None:
                return found
            look *= LOOKS if moment.time >= look else 1.0
        found = _seen(run, last=True)
    assert found is not None
    return found


def _seen(run: Run, last: bool) -> Swing | None:
    """What the last two thirds of a run show; None before its end if that is not clear yet."""
    result = run.result(only=("q", "v"))
    if last:
        result.completed(run.mechanism.joints[0])
    third = len(result.time) // 3
    time, speed = result.time[third:], result["v"].values[third:].T
    link, motor = places = result["q"].values[third:].T
    spans = np.ptp(places[:, third:], axis=1)
    if spans[int(last) :].max() < 2.0 * LEAST_RAD:
        return QUIET  # in the end a link may float in its play, beside a motor that stands
    own = int(np.argmax(spans))  # the motor may swing within the play of a link that stands
    rises = _rises(places[own], third)
    half = (len(rises) - 1) // 2
    cut = [0, third, len(time) - 1] if half < 1 else [*rises[-1 - 2 * half :: half]]
    before, after = (np.sqrt(np.mean(speed[own, i:j] ** 2)) for i, j in pairwise(cut))
    kept = float(after / before) if before > 0.0 else 0.0
    if not last and not (half > 2 and abs(kept - 1.0) < STEADY):
        return None
    if half < 1 or kept <= LASTS:
        one_way = abs(places[own, -1] - places[own, 0]) > ONE_WAY * np.ptp(places[own])
        slow = np.sqrt(np.mean(speed[1, third:] ** 2)) < JOINT_FRICTION_SPEED  # friction would hold
        rests = half < 1 and (one_way or slow)
        return QUIET._replace(unclear=kept >= ENDS and not rests)
    at = slice(*cut[1:])
    frequency = half / float(time[cut[2]] - time[cut[1]])
    amplitude, twist = (0.5 * float(np.ptp(one[at])) for one in (link, motor - link))
    return Swing(True, amplitude, frequency, twist)


def _rises(values: np.ndarray, late: int) -> np.ndarray:
    """Where values pass the middle of the later ones upwards, noise left out."""
    low, high = values[late:].min(), values[late:].max()
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
    if not isinstance(servo, Servo) or axis.controller is not None:
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
    quiet: float | None
    """Largest P gain at which no start of all gains tried up to it hunted [V/rad]; None: none."""
    hunting: float | None
    """Smallest one at which one did; None: none up to the largest tried."""
    above: Swing = QUIET
    """Without play at `hunting`."""

    @property
    def verdict(self) -> str:
        if not self.found.hunts:
            return "unclear" if self.found.unclear else "quiet"
        return "gains, not play" if self.control.hunts else "play"


def _of_starts(
    axes: Sequence[Axis],
    play: bool,
    longest: float | None,
    starts: Sequence[float],
    jobs: int | None,
    bar: ProgressBar,
) -> list[Swing]:
    """The largest swing of each axis."""
    trials = [
        Trial(axis, start * axis.gear.play, play, longest) for axis in axes for start in starts
    ]
    bar.total = (bar.total or 0) + len(trials)
    found = Study(trials, swing).run(jobs, bar)
    n = len(starts)
    each = (found[k : k + n] for k in range(0, len(found), n))
    return [max(own, key=lambda one: (one.hunts, one.unclear, one.amplitude)) for own in each]


def hunting(
    simulation: Simulation,
    joints: Sequence[str] = (),
    pose: Mapping[str, float] | None = None,
    *,
    longest: float | None = None,
    starts: Sequence[float] = STARTS,
    jobs: int | None = None,
    progress: bool = False,
) -> list[Hunting]:
    """Find which joints hunt at rest, and up to which P gain they do not.

    Args:
        simulation: see `Axis.of`.
        joints: which; none: all that have play and a servo or controller.
        pose: see `Axis.of`.
        longest: run, if it is not clear before whether swings last [s]; None: `LONGEST_S`, or more
            where slow swings are predicted.
        starts: how far aside runs begin, in plays of the gear.
        jobs: processes; None takes one for each core.
        progress: show a bar.

    Raises:
        JointplayError: no such joint; none has play, or a servo; a run that stops.
    """
    require_a("simulation", simulation, "Simulation")
    if longest is not None:
        require_positive("longest run", longest, "s")
    axes = [
        Axis.of(simulation, name, pose or {}) for name in dict.fromkeys(joints or able(simulation))
    ]
    found = []
    with ProgressBar(disable=not progress, unit="run", total=0) as bar:

        def largest(these: Sequence[Axis], play: bool) -> list[Swing]:
            return _of_starts(these, play, longest, starts, jobs, bar)

        for axis in axes:
            with_play, control = largest([axis], True)[0], largest([axis], False)[0]
            quiet = hunts = None
            above = control
            if isinstance(axis.drive, Servo) and axis.controller is None:
                quiet, hunts = _safe_gain(axis, largest)
                if hunts is not None:
                    above = largest([axis.with_gains(p_gain=hunts)], False)[0]
            screen = predicted(axis)
            found.append(Hunting(axis, with_play, control, screen, quiet, hunts, above))
    return found


def able(simulation: Simulation) -> list[str]:
    """Joints with play in their gear, and a servo or a controller.

    Raises:
        JointplayError: there is none.
    """
    robot = simulation.mechanism
    loose = [name for name, gear in robot.gears.items() if gear.play > 0.0]
    names = [name for name in loose if any(one is not None for one in _control(simulation, name))]
    if not names:
        Axis.of(simulation, [*loose, *robot.joints][0], {})  # says what lacks
    return names


def _safe_gain(axis: Axis, largest: Any) -> tuple[float | None, float | None]:
    """Largest P gain up to which all that were tried are quiet, and the next, which hunts."""
    gains = [axis.drive.p_gain * 2.0**k for k in range(-REACH, REACH + 1)]  # type: ignore[union-attr]
    quiet: float | None = None
    hunts: float | None = None
    below, clear = gains[0], True
    for _ in range(3):
        swings = largest([axis.with_gains(p_gain=gain) for gain in gains], True)
        for gain, one in zip(gains, swings, strict=True):
            if one.hunts:
                hunts = gain
                break
            clear = clear and not one.unclear
            below, quiet = gain, gain if clear else quiet
        if hunts is None or hunts <= below:
            break
        gains = list(np.geomspace(below, hunts, BETWEEN + 2)[1:-1])
    return quiet, hunts


class Span(NamedTuple):
    """Values of a gain."""

    gain: str
    values: np.ndarray


@dataclass(frozen=True)
class GainMap:
    """Swings over two gains of a joint's servo: arrays (second, first)."""

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
        unit = {"p_gain": "V/rad", "i_gain": "V/(rad*s)", "d_gain": "V*s/rad"}
        length = "m" if self.axis.slides else "rad"
        kinds = {"without play": self.control, "screen": self.screen, "unclear": self.unclear}
        return Table(
            (
                Column(self.first.gain, first.ravel(), unit[self.first.gain]),
                Column(self.second.gain, second.ravel(), unit[self.second.gain]),
                Column("amplitude", self.amplitude.ravel(), length),
                Column("frequency", self.frequency.ravel(), "Hz"),
                *(Column(name, which.ravel().astype(int)) for name, which in kinds.items()),
            )
        )


def gain_map(
    axis: Axis,
    first: Span,
    second: Span,
    *,
    longest: float | None = None,
    start: float = STARTS[1],
    jobs: int | None = None,
    progress: bool = False,
) -> GainMap:
    """Run a servo at all pairs of two gains, with play and without, once each from one start.

    No run is longer than `longest`, `LONGEST_S` if that is None.

    Raises:
        JointplayError: no such gain, twice the same, or no servo.
    """
    longest = require_positive("longest run", LONGEST_S if longest is None else longest, "s")
    for gain, _ in (first, second):
        require_known("gain", gain, GAINS)
    if first.gain == second.gain:
        raise JointplayError(f"a map is over two gains, got {first.gain!r} twice")
    if not isinstance(axis.drive, Servo):
        raise JointplayError(f"{axis.joint!r} has no servo whose gains could be varied")
    axes = [
        axis.with_gains(**{first.gain: float(a), second.gain: float(b)})
        for b in second.values
        for a in first.values
    ]
    shape = len(second.values), len(first.values)
    with ProgressBar(disable=not progress, unit="run", total=0) as bar:
        loose, tight = (
            _of_starts(axes, play, longest, [start], jobs, bar) for play in (True, False)
        )
    maps = (
        [one.amplitude for one in loose],
        [one.frequency for one in loose],
        [one.hunts for one in tight],
        [predicted(one, COARSE).hunts for one in axes],
        [one.unclear for one in loose],
    )
    return GainMap(axis, first, second, *(np.array(one).reshape(shape) for one in maps))


def table(found: Sequence[Hunting]) -> Table:
    """A row for each joint."""
    axes = [one.axis for one in found]
    servos = [one.drive if isinstance(one.drive, Servo) else None for one in axes]
    return Table(
        (
            Column("joint", [one.joint for one in axes]),
            Column("play", [one.gear.play for one in axes], "rad", digits=3),
            Column("inertia", [one.inertia for one in axes], "kg*m^2", digits=3),
            Column("load", [one.load for one in axes], "N*m", digits=3),
            Column("encoder", [one.encoder for one in axes]),
            Column("hunts by", [one.verdict for one in found]),
            Column("amplitude", [one.found.amplitude or None for one in found], "rad", digits=3),
            Column("frequency", [one.found.frequency or None for one in found], "Hz", digits=3),
            Column("predicted", [one.screen.frequency or None for one in found], "Hz", digits=3),
            Column("P gain", [one and one.p_gain for one in servos], "V/rad", digits=3),
            Column("quiet up to", [one.quiet for one in found], "V/rad", digits=3),
            Column("hunts from", [one.hunting for one in found], "V/rad", digits=3),
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
    lines = [
        "others held; the largest swing of all starts; predicted: by the describing function, "
        "without load, dead band, counts and limit of the supply"
    ]
    if loaded:
        lines.append("a load that presses the teeth to one side calms: other poses may hunt")
    return lines
