"""Hunting: does a position servo with play in its gear oscillate at rest?

Joints are released from several starts beside their goal (`released`), with play and without, and
their final motion is classified (`swings`): limit cycle, rest, or unclear. For servos a harmonic
balance also predicts the limit cycle, by the describing function of the play: the first harmonic of
a gap's response to a sine, derived here and tested by integration.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from jointplay.study.runs import Arrays, store_in
from jointplay.study.study import Memory, Study
from jointplay.study.swings import DIVERGES, LONGEST_S, QUIET, Swing, Trial, swings

STARTS = (0.5, 2.0, 8.0)
"""Distances from the goal at which joint and motor start, in plays of the gear (judged: a small
swing, one of the size that play sustains, and a large one)."""

SEARCH_S, MAP_S = 60.0, 12.0
"""Longest run under a controller in a search for a gain, and in a map [s]: these make many runs,
and leave more of them unclear than runs of `LONGEST_S` do."""

REACH = 6
"""Times that a gain is doubled at most until it hunts, and halved until it is quiet: a factor of 64
either way (judged: beyond it the joint has other faults)."""

BETWEEN = 7
"""Gains tried between the largest quiet and the smallest that hunts; done twice, which narrows a
factor of two to 2^(1/64), 1 %."""

# Prediction by the describing function.


def describing_function(ratio: np.ndarray | float) -> np.ndarray:
    """Describing function of a gap: N = 1 - 2/pi [asin r + r sqrt(1 - r^2)], the gain of its first
    harmonic for a sine; r is half the gap over the amplitude, any shape; 0 within the gap.
    """
    r = np.minimum(ratio, 1.0)
    return np.asarray(1.0 - 2.0 / math.pi * (np.arcsin(r) + r * np.sqrt(1.0 - r * r)))


COARSE = 500
"""Frequencies of a prediction that only has to say whether the joint hunts: 1 of 150 random joints
is judged otherwise than with 8000. The default number has the frequency within 0.5 %."""


def predicted(axis: Axis, frequencies: int = 2000) -> Swing:
    """Largest limit cycle by harmonic balance, with the describing function N of the play.

    1 + (K + i w d) N(A) G(i w) = 0, A being the amplitude of the gear's twist; G, the twist that a
    torque of the teeth causes, has the motor under its control and the link. The motor's dry
    friction F counts as a damper F/hypot(pi V/4, v_s) at its amplitude of speed V (within 4 % the
    first harmonic of F tanh(v/v_s)), sampling as a delay of half a period. Left out: load, dead
    band, counts, the supply's limit, friction with bristles. Worst with an I term (docs/drives.md).
    """
    servo, gear = axis.drive, axis.gear
    if not isinstance(servo, Servo):
        return QUIET
    s = 2j * math.pi * np.logspace(-2.0, 2.5, frequencies)
    w = s.imag
    control = servo.stall * (servo.p_gain + servo.i_gain / s + servo.d_gain * s)
    control = control * np.exp(-0.5 * s * (servo.period or 0.0))
    loss, spring = gear.losses, gear.steepest + s * gear.damping
    link = axis.inertia * s * s + axis.friction.viscous * s  # torque per motion of the link
    viscous = servo.braking + servo.viscous + loss.viscous
    dry, half = servo.friction + loss.running, 0.5 * gear.play
    least_speed = 1e-9 if servo.presliding else JOINT_FRICTION_SPEED
    # The friction's equivalent damper depends on the amplitude, and that on the damper: a fixed
    # point, found at every frequency at once by damped iteration.
    damper = np.zeros(frequencies)
    for _ in range(60):
        motor = gear.rotor_inertia * s * s + (viscous + damper) * s
        on_link = servo.encoder == "link"
        # Motion of the motor, then of the twist, per torque of the teeth: its inverse, over the
        # spring, is the gain that the gap must have for the loop to close.
        motor_motion = (1.0 + control / link) / motor if on_link else 1.0 / (motor + control)
        gain = -1.0 / (spring * (motor_motion + 1.0 / link))
        ratio = _ratio_of(np.clip(gain.real, 1e-9, 1.0 - 1e-9))
        speed = w * np.abs(half / ratio * motor_motion / (motor_motion + 1.0 / link))
        damper = 0.5 * (damper + dry / np.hypot(0.25 * math.pi * speed, least_speed))
    # N is real, between 0 and 1: the loop closes where the imaginary part changes its sign.
    crossings = np.flatnonzero((gain.imag[1:] > 0.0) != (gain.imag[:-1] > 0.0))
    crossings = crossings[(gain.real[crossings] > 1e-9) & (gain.real[crossings] < 1.0)]
    if not len(crossings):
        return QUIET
    best = crossings[np.argmax(half / ratio[crossings])]
    twist = half / ratio[best]
    link_share = np.abs((1.0 / link) / (motor_motion + 1.0 / link))[best]
    return Swing(True, float(twist * link_share), float(w[best] / (2.0 * math.pi)), float(twist))


def _ratio_of(gain: np.ndarray) -> np.ndarray:
    """Inverse of `describing_function`, for gains above 0 and below 1."""
    ratios = np.linspace(0.0, 1.0, 4001)
    # N falls with the ratio, and `interp` wants rising abscissae: hence the signs.
    return np.maximum(np.interp(-gain, -describing_function(ratios), ratios), 1e-9)


# Runs of the engine.


@dataclass(frozen=True)
class Hunting:
    """Verdict on one joint: whether it hunts at rest, and up to which gain it does not."""

    axis: Axis
    swing: Swing
    """The largest swing over all starts."""
    control: Swing
    """The largest swing over all starts without play."""
    screen: Swing
    """The limit cycle that the describing function predicts."""
    gain: float | None
    """Value of the gain that was varied; None: none was."""
    quiet: float | None
    """Largest value of that gain at which all starts came to rest, below the smallest that hunts;
    None: none. For a `MultiAxis` at rest means all of its joints that were looked at."""
    hunting: float | None
    """Smallest value tried at which a start hunts; None: none."""
    above: Swing
    """The largest swing without play at the gain `hunting`."""

    @property
    def verdict(self) -> str:
        if not self.swing.hunts:
            return "unclear" if self.swing.unclear else "quiet"
        return "gains, not play" if self.control.hunts else "play"


def _swing_rows(trial: Trial) -> Arrays:
    """Swings of a trial as the store keeps them: a row for each axis."""
    return {"swings": np.array(swings(trial), float)}


def _key(trial: Trial) -> str:
    """Key of a trial in the store: all that its swings depend on."""
    longest = "" if trial.longest is None else f"{trial.longest!r}"
    joints = ",".join(axis.joint for axis in trial.released.axes)
    inputs = run_key(trial.released.simulation(1.0))
    return f"{inputs} {joints} {trial.start!r} {trial.play} {longest}"


def _swings_of(arrays: Arrays) -> list[Swing]:
    return [
        Swing(bool(hunts), float(amplitude), float(frequency), float(twist), bool(unclear))
        for hunts, amplitude, frequency, twist, unclear in arrays["swings"]
    ]


@dataclass(frozen=True)
class Search:
    """Runs released joints from all starts, and keeps the largest swing of each."""

    starts: Sequence[float]
    longest: float | None
    jobs: int | None
    bar: ProgressBar
    store: Memory[Arrays]
    """The trials that were run."""

    def largest(
        self, groups: Sequence[Released], play: bool, controlled: float = SEARCH_S
    ) -> list[list[Swing]]:
        """Largest swing over all starts of each axis in each group; `controlled` is the longest run
        under controllers [s].
        """
        limits = (None if isinstance(group, Axis) else controlled for group in groups)
        trials = [
            Trial(group, start, play, self.longest or limit)
            for group, limit in zip(groups, limits, strict=True)
            for start in self.starts
        ]
        keys, n = [_key(trial) for trial in trials], len(self.starts)
        plan = dict(zip(keys, trials, strict=True))
        self.bar.update(len(keys) - sum(key not in self.store for key in plan))
        Study(plan, _swing_rows, self.store).run(self.jobs, self.bar)
        all_swings = [_swings_of(self.store[key]) for key in keys]
        return [
            [
                max(of_axis, key=lambda swing: (swing.hunts, swing.unclear, swing.amplitude))
                for of_axis in zip(*all_swings[k : k + n], strict=True)
            ]
            for k in range(0, len(trials), n)
        ]

    def axis_swings(self, axes: Sequence[Axis], play: bool) -> list[Swing]:
        """Largest swing over all starts of each axis, each released alone."""
        return [swing for (swing,) in self.largest(axes, play)]

    def skip(self, count: int) -> None:
        """Advance the bar past runs that were planned, from all starts, and are not needed."""
        self.bar.update(max(count, 0) * len(self.starts))

    def safe_gain(
        self, group: Released, gain: str, start_swings: Sequence[Swing]
    ) -> tuple[float | None, float | None]:
        """Bracket of the gain's stability limit: the largest value that is quiet below the smallest
        that hunts, and that smallest; None where there is none.

        The search begins at the present value, at which the group does `start_swings`: doubled
        until it hunts, halved until it is quiet, then refined between the two.
        """
        value = group.gains[gain]
        trials = {value: start_swings}

        def bracket() -> tuple[float | None, float | None]:
            hunt = [x for x, axes in trials.items() if any(swing.hunts for swing in axes)]
            lowest = min(hunt, default=math.inf)
            quiet = [x for x, axes in trials.items() if set(axes) == {QUIET} and x < lowest]
            return max(quiet, default=None), min(hunt, default=None)

        def add(values: Sequence[float]) -> None:
            axes = self.largest([group.with_gains(**{gain: x}) for x in values], True)
            trials.update(zip(values, axes, strict=True))

        for factor, end in ((2.0, 1), (0.5, 0)):
            for k in range(1, REACH + 1):
                if bracket()[end] is None:
                    add([value * factor**k])
        for _ in range(2):
            quiet, hunts = bracket()
            if quiet is not None and hunts is not None:
                add(np.geomspace(quiet, hunts, BETWEEN + 2)[1:-1].tolist())
        self.skip(REACH + 2 * BETWEEN + 1 - len(trials))
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
        gain: gain that is varied, of `UNITS`, or a parameter of the user's own controller; None:
            the P gain of servos, none of controllers.
        longest: longest motion, if whether swings last is not clear before [s]; None: `DAY_S` under
            servos; under controllers `LONGEST_S`, or `SEARCH_S` in the search for the gain.
        starts: distances from the goal at which runs begin, in plays of the gear.
        jobs: processes; None takes one for each core.
        keep: file in which each run is kept as soon as it is done; runs that are there are not
            made again.
        progress: show a bar.

    Raises:
        JointplayError: no such joint or gain; no joint has play, or a servo; a run that stops.
    """
    if longest is not None:
        require_positive("longest run", longest, "s")
    groups, answers = released(simulation, joints, pose), []
    for group in groups if gain is not None else ():
        _require_gain(group, gain := str(gain))
        if group.gains[gain] == 0.0:
            raise JointplayError(f"{gain} is 0: give a value that can be doubled and halved")
    # Each group runs from all starts with play and without; where a gain varies, so do the gains
    # that the search may try, and without play the one that hunts.
    varies = sum(gain is not None or isinstance(group, Axis) for group in groups)
    total = len(starts) * (2 * len(groups) + (1 + REACH + 2 * BETWEEN) * varies)
    with store_in(keep) as store, ProgressBar(disable=not progress, unit="run", total=total) as bar:
        search = Search(starts, longest, jobs, bar, store)
        for group in groups:
            ((loose,), (tight,)) = (search.largest([group], p, LONGEST_S) for p in (True, False))
            name = gain or ("p_gain" if isinstance(group, Axis) else None)
            quiet = hunts = value = None
            if name is not None:
                value, (quiet, hunts) = group.gains[name], search.safe_gain(group, name, loose)
            above = tight
            if name is not None and hunts is not None:
                (above,) = search.largest([group.with_gains(**{name: hunts})], False)
            elif name is not None:
                search.skip(1)
            gains = value, quiet, hunts
            for axis, swing, control, over in zip(group.axes, loose, tight, above, strict=True):
                answers.append(Hunting(axis, swing, control, predicted(axis), *gains, over))
    return answers


def _require_gain(group: Released, gain: str) -> None:
    if not group.gains:
        joints = ", ".join(axis.joint for axis in group.axes)
        raise JointplayError(f"the controller of {joints} has no parameters that could be varied")
    require_known("gain", gain, group.gains)


Span = tuple[str, np.ndarray]
"""Name of a gain, and the values that it takes in a map."""


def read_span(text: str) -> Span:
    """Read ``p_gain=10:400:20``: a gain and its values, evenly spaced by factors unless from 0."""
    usage = "--map GAIN=FROM:TO:COUNT, such as p_gain=10:400:20"
    gain, bounds = pair(text, usage)
    try:
        first, last, number = bounds.split(":")
        low, high, count = float(first), float(last), int(number)
    except ValueError:
        raise misread(text, usage) from None
    if not (0.0 <= low < high < math.inf and 2 <= count <= 1000):
        raise misread(text, usage)
    spacing = np.geomspace if low > 0.0 else np.linspace
    return gain, spacing(low, high, count)


@dataclass(frozen=True)
class GainMap:
    """Swings of a joint over two gains; arrays have shape (second, first)."""

    axis: Axis
    first: Span
    second: Span
    amplitude: np.ndarray
    """Amplitude of the joint; 0 where it is quiet [rad or m]."""
    frequency: np.ndarray
    """Frequency of the swing; 0 where it is quiet [Hz]."""
    control: np.ndarray
    """Whether it hunts without play."""
    screen: np.ndarray
    """Whether it hunts by the describing function."""
    unclear: np.ndarray
    """Whether the motion ended before it told."""

    @property
    def sentence(self) -> str:
        hunts = self.amplitude > 0.0
        by_play = int((hunts & ~self.control).sum())
        text = f"{self.axis.joint} hunts at {int(hunts.sum())} of {hunts.size} pairs of gains"
        text += f", at {by_play} of them by its play" if hunts.any() else ""
        unclear = int(self.unclear.sum())
        return f"{text}; unclear at {unclear}: try a longer --time" if unclear else text

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
                *(Column(name, flags.ravel().astype(int)) for name, flags in kinds.items()),
            )
        )


def gain_map(
    group: Released,
    first: Span,
    second: Span,
    *,
    longest: float | None = None,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> GainMap:
    """Run a joint at all pairs of two gains, with play and without, once each from `STARTS[1]`.

    No motion is longer than `longest` [s]; None: `DAY_S` under a servo, else `MAP_S`. For `keep`
    see `hunting`.

    Raises:
        JointplayError: no such gain, twice the same gain, or several joints.
    """
    if longest is not None:
        require_positive("longest run", longest, "s")
    (x, xs), (y, ys) = first, second
    for gain in (x, y):
        _require_gain(group, gain)
    if x == y:
        raise JointplayError(f"a map is over two gains, got {x!r} twice")
    if len(group.axes) > 1:
        raise JointplayError(f"a map is of one joint, got {', '.join(a.joint for a in group.axes)}")
    pairs = [group.with_gains(**{x: float(a), y: float(b)}) for b in ys for a in xs]
    total = 2 * len(pairs)
    with store_in(keep) as store, ProgressBar(disable=not progress, unit="run", total=total) as bar:
        search = Search([STARTS[1]], longest, jobs, bar, store)
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
    return GainMap(group.axes[0], first, second, *maps)


def table(answers: Sequence[Hunting], gain: str | None = None) -> Table:
    """Table with a row for each joint; `gain` is the varied one, None: the P gain of servos."""
    axes = [answer.axis for answer in answers]
    name, unit = ("P gain", UNITS["p_gain"]) if gain is None else (gain, UNITS.get(gain, ""))
    return Table(
        (
            Column("joint", [axis.joint for axis in axes]),
            Column("play", [axis.gear.play for axis in axes], "rad", digits=3),
            Column("inertia", [axis.inertia for axis in axes], "kg*m^2", digits=3),
            Column("load", [axis.load for axis in axes], "N*m", digits=3),
            Column("encoder", [axis.drive.encoder for axis in axes]),
            Column("hunts by", [a.verdict for a in answers]),
            Column("amplitude", [a.swing.amplitude or None for a in answers], "rad", digits=3),
            Column("frequency", [a.swing.frequency or None for a in answers], "Hz", digits=3),
            Column("predicted", [a.screen.frequency or None for a in answers], "Hz", digits=3),
            Column(name, [a.gain for a in answers], unit, digits=3),
            Column("quiet up to", [a.quiet for a in answers], unit, digits=3),
            Column("hunts from", [a.hunting for a in answers], unit, digits=3),
            Column("without play there", ["hunts" if a.above.hunts else "quiet" for a in answers]),
        )
    )


def sentence(answers: Sequence[Hunting]) -> str:
    """The result in one line: which joints hunt, with amplitude and frequency."""
    phrases = []
    for answer in answers:
        if answer.swing.hunts:
            swing, unit = answer.swing, "mm" if answer.axis.slides else "mrad"
            remark = "; without play as well: gains, not play" if answer.control.hunts else ""
            motion = f"+-{1e3 * swing.amplitude:.3g} {unit} at {swing.frequency:.3g} Hz"
            motion = "grows without bound" if swing == DIVERGES else motion
            phrases.append(f"{answer.axis.joint} {motion}{remark}")
    slow = [answer.axis.joint for answer in answers if answer.verdict == "unclear"]
    unclear = f"; unclear for {few(slow)}: try a longer --time" if slow else ""
    if not phrases:
        return f"{counted(len(answers), 'joint')} at rest: none hunts{unclear}"
    hunts = "hunts" if len(phrases) == 1 else "hunt"
    joints = f"{len(phrases)} of {counted(len(answers), 'joint')}"
    return f"{joints} {hunts} at rest: {', '.join(phrases)}{unclear}"


def notes(answers: Sequence[Hunting]) -> list[str]:
    """The assumptions behind the result, a line each."""
    loaded = [a.axis.joint for a in answers if a.axis.load]
    controlled = [a.axis.joint for a in answers if isinstance(a.axis.drive, Controller)]
    lines = [
        "all other joints are held; shown is the largest swing over all starts; predicted: by the "
        "describing function, without load, dead band, counts and limit of the supply"
    ]
    if controlled:
        lines.append(f"moved together by controllers of your own: {few(controlled)}")
    if loaded:
        lines.append("a load that presses the teeth to one side prevents hunting: try other poses")
    return lines
