"""Verdict on a released joint's motion: it comes to rest, swings for ever, diverges, or is unclear.

Link and motor are followed for as long as it takes. From time to time the motion so far is judged;
its first quarter is left out, and the rest cut into three thirds:

1. Rest: at the pace of the last third, if that is no faster than the third before, neither link nor
   motor would get anywhere in a day.
2. Swinging: whichever of the two goes farther passes its middle upwards several times; these
   periods, in three groups one after the other, are alike in size and duration.
3. Rest, under a servo without an integral: swings at the edge of a count that do not grow, and are
   too small to be called hunting.
4. Rest, at the end of the time: a motion that leads one way and slows down, with no integral that
   winds up meanwhile, ends where forces balance; so does one that goes ever slower for a day.

The engine runs a joint under a servo for a minute; if that does not tell, an implicit solver of the
same equations runs it again from the start (`slow_motion`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from jointplay.base.errors import within
from jointplay.physics.kernel import Status
from jointplay.simulation.loads import Servo
from jointplay.simulation.run import Run
from jointplay.study.released import STEP_S, Axis, Released
from jointplay.study.slow_motion import slow_motion

STEPPED_S = 60.0
"""Time for which the engine runs a joint under a servo [s]. With 20 s one of 110 random joints is
lost: its swings are fast but grow slowly, which takes the solver more steps than it may make."""

CHATTERS_S = 15.0
"""Time from which chatter between two counts can be told from swings that grow [s]: it is equally
large from one quarter to the next, but for the moments at which it was recorded (`STEADY`;
judged)."""

DAY_S = 1e5
"""Longest motion under a servo, a day [s] (judged: with 1e4 to 1e7 at most one of nine slow joints
is unclear, and none is judged otherwise)."""

LONGEST_S = 300.0
"""Longest run under controllers of the user's own, which only the engine can run; there it stands
for the day [s]."""

FINER = 4
"""A run that diverges is repeated with steps so many times shorter, as the step may be at fault."""

FIRST_LOOK_S, LATER = 0.7, 1.5
"""Time at which a motion is first judged, after several fast swings [s], and the factor from each
time to the next (judged: they cost computing time only)."""

LEAST_SWING = 0.01
"""Least amplitude of hunting, in plays of the gear (judged)."""

ROUNDING = 1e-3
"""Relative rounding of travels; what goes less than this part of the least swing in a day is at
rest even if it does not slow down."""

STEADY, EVEN = 0.02, 2e-3
"""Before the end of the time, swings last if their sizes differ by less than `STEADY` from group to
group; and, if the second change has the sign of the first and more than half its size, as in swings
that die out or settle, by less than `EVEN` in all (judged)."""

SUSTAINED = 0.9
"""Least size of the last swings, relative to those before, at the end of the time; and always least
ratio of the first group's duration to the last one's, for what creeps in a dead band turns ever
later: if its turning times grow in proportion, the last third of them takes 4^(2/3) = 2.5 times as
long as the first."""

DECAY = math.sqrt(10.0)
"""A motion dies out that travels less from a tenth to the end of a day than this multiple of its
travel from a hundredth to a tenth: 10 for a motion that lasts, 1 for one that slows down as 1/t."""


class Swing(NamedTuple):
    """What a released joint does in the end."""

    hunts: bool
    amplitude: float
    """Amplitude of the link [rad or m]; 0 if it comes to rest, inf if it diverges."""
    frequency: float
    """Frequency [Hz]; 0 if it comes to rest."""
    twist: float = 0.0
    """Amplitude of the gear's twist, motor against link [rad or m]."""
    unclear: bool = False
    """Whether it still moves at the end of the time in a way that does not tell how it goes on."""


QUIET = Swing(False, 0.0, 0.0)
UNCLEAR = QUIET._replace(unclear=True)
DIVERGES = Swing(True, math.inf, 0.0)


@dataclass(frozen=True)
class Trial:
    """One release: of which joints, from where, with play or without, for how long."""

    released: Released
    start: float
    """Distance from the goal at which joints and motors begin, in plays of their gears."""
    play: bool = True
    """Whether gears have their play."""
    longest: float | None = None
    """Longest motion [s]; None: `DAY_S` under a servo, else `LONGEST_S`."""


def swings(trial: Trial) -> list[Swing]:
    """Run a trial, and judge what each of its axes does in the end.

    Raises:
        JointplayError: a run that stops.
    """
    axis = trial.released if isinstance(trial.released, Axis) else None
    longest = trial.longest or (LONGEST_S if axis is None else DAY_S)
    stepped = longest if axis is None else min(STEPPED_S, longest)
    names = ", ".join(axis.joint for axis in trial.released.axes)
    with within(names):
        simulation = trial.released.simulation(stepped)
        for division in (1, FINER):
            run = Run(replace(
                simulation, step=simulation.step / division,
                record_every=simulation.record_every * division,
            ))  # fmt: skip
            if steady := _stepped(run, trial, last=stepped == longest):
                return steady
            result = run.result(only=("q",))
            if result.status != Status.RUN_AWAY:
                result.completed(names)
                assert axis is not None
                return [_solved(axis, trial, longest)]
    return [DIVERGES] * len(trial.released.axes)


def _stepped(run: Run, trial: Trial, last: bool) -> list[Swing]:
    """Verdicts on all axes by a run of the engine, as soon as all are clear; empty if they are not.

    At the end of the run every axis gets a verdict, unclear at worst, if this is the `last` run.
    """
    robot, axes, next_look = run.mechanism, trial.released.axes, FIRST_LOOK_S

    def judge(end: bool) -> list[Swing]:
        result = run.result(only=("q",))
        if end and result.status != Status.COMPLETED:
            return []
        motions = (
            result["q"].values[:, [robot.coordinate(axis.joint), robot.motor(axis.joint)]].T
            for axis in axes
        )
        verdicts = (_judge(result.time, *pair, end) for pair in zip(motions, axes, strict=True))
        clear = [swing for swing in verdicts if swing is not None]
        return clear if len(clear) == len(axes) else []

    for name, gear in robot.gears.items():
        run.workspace.q[[robot.coordinate(name), robot.motor(name)]] += trial.start * gear.play
    if not trial.play:
        run.workspace.gears["half_play"] = 0.0
    for moment in run.steps(0.25 * FIRST_LOOK_S):
        if moment.time >= next_look:
            next_look *= LATER
            if clear := judge(end=False):
                return clear
    return judge(end=last)


def _solved(axis: Axis, trial: Trial, longest: float) -> Swing:
    """Verdict on an axis by the implicit solver, where the engine's run did not tell."""
    start = trial.start * axis.gear.play
    for time, positions in slow_motion(axis, start, trial.play, longest, STEPPED_S, LATER):
        if swing := _judge(time, positions, axis, last=time[-1] >= longest):
            return swing
    return UNCLEAR


def _judge(time: np.ndarray, positions: np.ndarray, axis: Axis, last: bool) -> Swing | None:
    """Verdict on a motion of link and motor, at evenly spaced times (n,), positions (2, n); None if
    it does not tell yet and is not the `last`. The rules are in the module's docstring.
    """
    servo = axis.drive if isinstance(axis.drive, Servo) else None
    least_span = 2.0 * LEAST_SWING * axis.gear.play
    # 1. Extrapolated to a day, the last quarter leads nowhere.
    quarter = (len(time) - 1) // 4
    late = len(time) - 1 - 3 * quarter
    later = positions[:, late:]
    travels = [np.ptp(later[:, k * quarter :][:, : quarter + 1], axis=1) for k in range(3)]
    day = DAY_S if servo else LONGEST_S
    day_travels = travels[2] * day / float(time[-1] - time[-1 - quarter])
    at_rest = day_travels < least_span * np.where(travels[2] <= travels[1], 1.0, ROUNDING)
    if at_rest.all() or (last and at_rest[1]):
        return QUIET  # in the end a link may float in its play, beside a motor that stands
    # 2. Periods of whichever goes farther, in three groups of `count`, are alike.
    spans = np.ptp(later, axis=1)
    body = int(np.argmax(spans))  # the motor may swing within the play of a link that stands
    rises = late + _rises(later[body])
    count = (len(rises) - 1) // 3
    if count >= (1 if last else 2) and spans[body] > least_span:
        cut = rises[[-1 - 3 * count, -1 - 2 * count, -1 - count, -1]]
        sizes = [float(np.ptp(positions[body, i:j])) for i, j in pairwise(cut)]
        durations = np.diff(time[cut])
        if _are_sustained(sizes, last) and durations[2] < durations[0] / SUSTAINED:
            link, motor = positions[:, cut[1] : cut[3]]
            frequency = 2.0 * count / float(time[cut[3]] - time[cut[1]])
            return Swing(
                True, 0.5 * float(np.ptp(link)), frequency, 0.5 * float(np.ptp(motor - link))
            )
    # 3. Beside the edge of a count it chatters where it came to rest, as nothing winds up.
    counts = servo is not None and servo.resolution > 0.0
    if servo and servo.i_gain == 0.0 and time[-1] >= (CHATTERS_S if counts else STEPPED_S - STEP_S):
        tail = later[:, quarter:]
        chatters = len(_rises(tail[body])) > 6 and np.ptp(tail, axis=1).max() < least_span
        grows = travels[2] > (1.0 + (STEADY if counts else EVEN)) * travels[1]
        if chatters and not (grows[body] if counts else grows.any()):
            return QUIET
    if not last:
        return None
    # 4. Both bodies settle: at rest, monotonic and slowing down, or dying out over a day.
    settling = at_rest
    if servo and servo.i_gain == 0.0:
        monotonic = np.abs(later[:, -1] - later[:, 0]) >= (1.0 - ROUNDING) * spans
        settling = settling | monotonic & (travels[2] <= (1.0 + ROUNDING) * travels[1])
    if time[-1] >= DAY_S:
        tenth = (len(time) - 1) // 10
        travel = np.cumsum(np.abs(np.diff(positions, axis=1)), axis=1)
        earlier, latest = np.diff(travel[:, [tenth // 10, tenth, -1]], axis=1).T
        settling = settling | (latest < DECAY * earlier)
    return QUIET if settling.all() else UNCLEAR


def _are_sustained(sizes: Sequence[float], last: bool) -> bool:
    """Whether swings of these three sizes, one after the other, go on for ever."""
    first, second, third = sizes
    before, after = second - first, third - second
    drifting = before * after > 0.0 and abs(after) > 0.5 * abs(before)
    drifting = drifting and abs(before + after) > EVEN * third
    if last:
        return third > SUSTAINED * max(first, second) and not (drifting and after < 0.0)
    return max(abs(before), abs(after)) < STEADY * third and not drifting


def _rises(values: np.ndarray) -> np.ndarray:
    """Indices at which values pass their middle upwards, with a hysteresis of an eighth of their
    range either way.
    """
    low, high = values.min(), values.max()
    deviation = values - 0.5 * (low + high)
    side = np.sign(np.where(np.abs(deviation) > 0.125 * (high - low), deviation, 0.0))
    records = np.flatnonzero(side)
    return records[1:][(side[records[1:]] > 0.0) & (side[records[:-1]] < 0.0)]
