"""Hunting: does a position servo with play in its gear oscillate at rest?

Joints are released from several starts aside (`released`), with play and without, and what becomes
of them is judged (`swings`). A describing function of the play, the first harmonic of what a gap
makes of a sine, is the screen beside servos; it is derived here, and tested by integration.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError, require_known, require_positive
from jointplay.base.pairs import misread, pair
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Column, Table, counted, few
from jointplay.physics.kernel import JOINT_FRICTION_SPEED
from jointplay.simulation.loads import Controller, Servo
from jointplay.simulation.simulation import Simulation
from jointplay.study.courses import run_key
from jointplay.study.released import UNITS, Axis, Released, released
from jointplay.study.runs import Arrays, Runs
from jointplay.study.study import Memory, Study
from jointplay.study.swings import DIVERGES, LONGEST_S, QUIET, Swing, Trial, swings

STARTS = (0.5, 2.0, 8.0)
"""How far joint and motor start from the goal, in plays of the gear."""

SEARCH_S, MAP_S = 60.0, 12.0
"""How long a run under a controller lasts at most that looks for a gain, or makes a map: there are
many, and more of them are unclear than of those that last `LONGEST_S`."""

REACH = 6
"""A gain is doubled so many times until it hunts, and halved until it is quiet."""

BETWEEN = 7
"""Gains that are tried between the largest quiet and the smallest that hunts, twice."""

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
    swing: Swing
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
        if not self.swing.hunts:
            return "unclear" if self.swing.unclear else "quiet"
        return "gains, not play" if self.control.hunts else "play"


def _kept_swings(trial: Trial) -> Arrays:
    """Swings of a trial as a store keeps them: a row for each axis."""
    return {"swings": np.array(swings(trial), float)}


def _key(trial: Trial) -> str:
    """All that the swings of a trial depend on."""
    lasts = "" if trial.longest is None else f"{trial.longest!r}"
    joints = ",".join(axis.joint for axis in trial.released.axes)
    inputs = run_key(trial.released.simulation(1.0))
    return f"{inputs} {joints} {trial.start!r} {trial.play} {lasts}"


def _swings_of(kept: Arrays) -> list[Swing]:
    return [
        Swing(bool(hunts), float(amplitude), float(frequency), float(twist), bool(unclear))
        for hunts, amplitude, frequency, twist, unclear in kept["swings"]
    ]


@contextmanager
def store_in(path: Path | None) -> Iterator[Memory[Arrays]]:
    """What keeps trials: a file, of which those that are there are not run again, or memory."""
    if path is None:
        yield Memory[Arrays]()
        return
    with closing(Runs(path, {})) as store:
        yield store


@dataclass(frozen=True)
class Search:
    """Runs from several starts."""

    starts: Sequence[float]
    longest: float | None
    jobs: int | None
    bar: ProgressBar
    store: Memory[Arrays] = field(default_factory=Memory)
    """Has the trials that were run."""

    def largest(
        self, these: Sequence[Released], play: bool, controlled: float = SEARCH_S
    ) -> list[list[Swing]]:
        """The largest swing of each axis of each that is released; `controlled` is how long a run
        under controllers lasts [s].
        """
        trials = [
            Trial(one, start, play, self.longest or (None if isinstance(one, Axis) else controlled))
            for one in these
            for start in self.starts
        ]
        keys, n = [_key(trial) for trial in trials], len(self.starts)
        plan = dict(zip(keys, trials, strict=True))
        self.bar.update(len(keys) - sum(key not in self.store for key in plan))
        Study(plan, _kept_swings, self.store).run(self.jobs, self.bar)
        all_swings = [_swings_of(self.store[key]) for key in keys]
        return [
            [
                max(of_axis, key=lambda swing: (swing.hunts, swing.unclear, swing.amplitude))
                for of_axis in zip(*all_swings[k : k + n], strict=True)
            ]
            for k in range(0, len(trials), n)
        ]

    def each(self, axes: Sequence[Axis], play: bool) -> list[Swing]:
        """The largest swing of each axis."""
        return [swing for (swing,) in self.largest(axes, play)]

    def skip(self, count: int) -> None:
        """So many that were planned need not be run."""
        self.bar.update(max(count, 0) * len(self.starts))

    def safe_gain(
        self, one: Released, gain: str, given: Sequence[Swing]
    ) -> tuple[float | None, float | None]:
        """The largest value that is quiet below the smallest that hunts, and that.

        From the one that it has, and what it does with that: up until it hunts, down until it is
        quiet, and between the two.
        """
        value, tried = one.gains[gain], {one.gains[gain]: given}

        def bracket() -> tuple[float | None, float | None]:
            hunt = [x for x, axes in tried.items() if any(swing.hunts for swing in axes)]
            least = min(hunt, default=math.inf)
            rest = [x for x, axes in tried.items() if set(axes) == {QUIET} and x < least]
            return max(rest, default=None), min(hunt, default=None)

        def add(values: Sequence[float]) -> None:
            axes = self.largest([one.with_gains(**{gain: x}) for x in values], True)
            tried.update(zip(values, axes, strict=True))

        for factor, end in ((2.0, 1), (0.5, 0)):
            for k in range(1, REACH + 1):
                if bracket()[end] is None:
                    add([value * factor**k])
        for _ in range(2):
            quiet, hunts = bracket()
            if quiet is not None and hunts is not None:
                add(np.geomspace(quiet, hunts, BETWEEN + 2)[1:-1].tolist())
        self.skip(REACH + 2 * BETWEEN + 1 - len(tried))
        return bracket()


@known_keywords
def hunting(
    simulation: Simulation,
    joints: Sequence[str] = (),
    pose: Mapping[str, float] | None = None,
    *,
    gain: str | None = None,
    longest: float | None = None,
    starts: Sequence[float] = STARTS,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> list[Hunting]:
    """Find which joints hunt at rest, and up to which gain they do not.

    Args:
        simulation, joints, pose: see `released`.
        gain: that is varied, of `UNITS` or a parameter of an own controller; None: the P gain of
            servos, none of controllers.
        longest: motion, if it is not clear before whether swings last [s]; None: `DAY_S` under
            servos, under controllers `LONGEST_S`, or `SEARCH_S` to look for the gain.
        starts: how far aside runs begin, in plays of the gear.
        jobs: processes; None takes one for each core.
        keep: file in which each run is kept as soon as it is done; those that are there are not
            done again.
        progress: show a bar.

    Raises:
        JointplayError: no such joint or gain; none has play, or a servo; a run that stops.
    """
    if longest is not None:
        require_positive("longest run", longest, "s")
    these, answers = released(simulation, joints, pose), []
    for one in these if gain is not None else ():
        _require_gain(one, gain := str(gain))
        if one.gains[gain] == 0.0:
            raise JointplayError(f"{gain} is 0: give a value that can be doubled and halved")
    varies = sum(gain is not None or isinstance(one, Axis) for one in these)
    most = len(starts) * (2 * len(these) + (1 + REACH + 2 * BETWEEN) * varies)
    with store_in(keep) as store, ProgressBar(disable=not progress, unit="run", total=most) as bar:
        search = Search(starts, longest, jobs, bar, store)
        for one in these:
            (loose,), (tight,) = (search.largest([one], play, LONGEST_S) for play in (True, False))
            name = gain or ("p_gain" if isinstance(one, Axis) else None)
            quiet = hunts = varied = None
            if name is not None:
                varied, (quiet, hunts) = one.gains[name], search.safe_gain(one, name, loose)
            above = tight
            if name is not None and hunts is not None:
                (above,) = search.largest([one.with_gains(**{name: hunts})], False)
            elif name is not None:
                search.skip(1)
            for axis, swing, control, there in zip(one.axes, loose, tight, above, strict=True):
                screen = predicted(axis)
                answers.append(Hunting(axis, swing, control, screen, varied, quiet, hunts, there))
    return answers


def _require_gain(one: Released, gain: str) -> None:
    if not one.gains:
        named = ", ".join(axis.joint for axis in one.axes)
        raise JointplayError(f"the controller of {named} has no parameters that could be varied")
    require_known("gain", gain, one.gains)


Span = tuple[str, np.ndarray]


def read_span(text: str) -> Span:
    """A gain and its values of ``p_gain=10:400:20``, evenly by factors unless from 0."""
    words = "--map GAIN=FROM:TO:COUNT, such as p_gain=10:400:20"
    gain, ends = pair(text, words)
    try:
        first, last, number = ends.split(":")
        low, high, count = float(first), float(last), int(number)
    except ValueError:
        raise misread(text, words) from None
    if not (0.0 <= low < high < math.inf and 2 <= count <= 1000):
        raise misread(text, words)
    even = np.geomspace if low > 0.0 else np.linspace
    return gain, even(low, high, count)


"""A gain and its values."""


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
    """Whether its motion does not tell."""

    @property
    def sentence(self) -> str:
        hunts = self.amplitude > 0.0
        by_play = int((hunts & ~self.control).sum())
        text = f"{self.axis.joint} hunts at {int(hunts.sum())} of {hunts.size} pairs of gains"
        text += f", at {by_play} of them by its play" if hunts.any() else ""
        unclear = int(self.unclear.sum())
        return f"{text}; at {unclear} a longer --time must tell" if unclear else text

    @property
    def table(self) -> Table:
        first, second = np.meshgrid(self.first[1], self.second[1])
        length = "m" if self.axis.slides else "rad"
        kinds = {"without play": self.control, "screen": self.screen, "unclear": self.unclear}
        return Table(
            (
                Column(self.first[0], first.ravel(), UNITS.get(self.first[0], "")),
                Column(self.second[0], second.ravel(), UNITS.get(self.second[0], "")),
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
    keep: Path | None = None,
    progress: bool = False,
) -> GainMap:
    """Run a joint at all pairs of two gains, with play and without, once each from one start.

    No motion is longer than `longest` [s]; None: `DAY_S` under a servo, else `MAP_S`. Of `keep` see
    `hunting`.

    Raises:
        JointplayError: no such gain, twice the same, or several joints.
    """
    if longest is not None:
        require_positive("longest run", longest, "s")
    (x, xs), (y, ys) = first, second
    for gain in (x, y):
        _require_gain(one, gain)
    if x == y:
        raise JointplayError(f"a map is over two gains, got {x!r} twice")
    if len(one.axes) > 1:
        raise JointplayError(f"a map is of one joint, got {', '.join(a.joint for a in one.axes)}")
    pairs = [one.with_gains(**{x: float(a), y: float(b)}) for b in ys for a in xs]
    total = 2 * len(pairs)
    with store_in(keep) as store, ProgressBar(disable=not progress, unit="run", total=total) as bar:
        search = Search([start], longest, jobs, bar, store)
        loose, tight = (
            [swing for (swing,) in search.largest(pairs, play, MAP_S)] for play in (True, False)
        )
    screen = [predicted(pair.axes[0], COARSE).hunts for pair in pairs]
    maps = (
        np.array(values).reshape(len(ys), len(xs))
        for values in (
            [swing.amplitude for swing in loose], [swing.frequency for swing in loose],
            [swing.hunts for swing in tight], screen, [swing.unclear for swing in loose],
        )
    )  # fmt: skip
    return GainMap(one.axes[0], first, second, *maps)


def table(answers: Sequence[Hunting], gain: str | None = None) -> Table:
    """A row for each joint; `gain` is the one that was varied, None: the P gain of servos."""
    axes = [one.axis for one in answers]
    name, unit = ("P gain", UNITS["p_gain"]) if gain is None else (gain, UNITS.get(gain, ""))
    return Table(
        (
            Column("joint", [axis.joint for axis in axes]),
            Column("play", [one.gear.play for one in axes], "rad", digits=3),
            Column("inertia", [one.inertia for one in axes], "kg*m^2", digits=3),
            Column("load", [one.load for one in axes], "N*m", digits=3),
            Column("encoder", [one.drive.encoder for one in axes]),
            Column("hunts by", [one.verdict for one in answers]),
            Column("amplitude", [one.swing.amplitude or None for one in answers], "rad", digits=3),
            Column("frequency", [one.swing.frequency or None for one in answers], "Hz", digits=3),
            Column("predicted", [one.screen.frequency or None for one in answers], "Hz", digits=3),
            Column(name, [one.gain for one in answers], unit, digits=3),
            Column("quiet up to", [one.quiet for one in answers], unit, digits=3),
            Column("hunts from", [one.hunting for one in answers], unit, digits=3),
            Column(
                "without play there", ["hunts" if one.above.hunts else "quiet" for one in answers]
            ),
        )
    )


def sentence(answers: Sequence[Hunting]) -> str:
    """What came out, in a line."""
    said = []
    for one in answers:
        if one.swing.hunts:
            unit = "mm" if one.axis.slides else "mrad"
            too = "; without play as well: gains, not play" if one.control.hunts else ""
            how = f"+-{1e3 * one.swing.amplitude:.3g} {unit} at {one.swing.frequency:.3g} Hz"
            how = "without bounds" if one.swing == DIVERGES else how
            said.append(f"{one.axis.joint} {how}{too}")
    slow = [one.axis.joint for one in answers if one.verdict == "unclear"]
    more = f"; a longer --time must tell of {few(slow)}" if slow else ""
    if not said:
        return f"{counted(len(answers), 'joint')} at rest: none hunts{more}"
    hunts = "hunts" if len(said) == 1 else "hunt"
    return (
        f"{len(said)} of {counted(len(answers), 'joint')} {hunts} at rest: {', '.join(said)}{more}"
    )


def notes(answers: Sequence[Hunting]) -> list[str]:
    """What was assumed, a line each."""
    loaded = [one.axis.joint for one in answers if one.axis.load]
    own = [one.axis.joint for one in answers if isinstance(one.axis.drive, Controller)]
    lines = [
        "others held; the largest swing of all starts; predicted: by the describing function, "
        "without load, dead band, counts and limit of the supply"
    ]
    if own:
        lines.append(f"moving together under controllers of your own: {few(own)}")
    if loaded:
        lines.append("a load that presses the teeth to one side calms: other poses may hunt")
    return lines
