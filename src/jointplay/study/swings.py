"""What a released joint does in the end: it rests, swings for ever, diverges, or does not tell.

Link and motor are followed as long as it takes, and looked at from time to time, without the first
quarter of their motion, which is cut into three:

1. At its pace in the last third, and if that is no faster than before, neither would come aside in
   a day: it rests.
2. Whichever of the two goes farther passes its middle upwards several times; the ways between these
   passes, in three groups one after the other, are alike and take as long: it swings.
3. Under a servo without an integral, swings at the edge of a count that do not grow, and are too
   small to be said to hunt, are rest.
4. At the end of the time a motion that leads one way and slows down, without an integral that winds
   up meanwhile, ends where forces balance; so does one that goes ever slower for a day.

A joint under a servo is run by the engine for a minute, then, from the start, by an implicit
solver of the same equations (`slow_motion`).
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
"""How long the engine runs a joint under a servo. With 20 s one of 110 random joints is lost, that
swings fast but grows slowly, which costs the solver more steps than it may take."""

CHATTERS_S = 15.0
"""From when on chatter between two counts is known from swings that grow: it is as large from one
quarter to the next, but for the moments at which it was recorded (`STEADY`; judged)."""

DAY_S = 1e5
"""Longest motion under a servo (judged: with 1e4 to 1e7 at most one of nine slow joints is unclear,
and none is judged otherwise)."""

LONGEST_S = 300.0
"""Longest run under controllers of the user's own, which only the engine can run, and there what
counts as a day."""

FINER = 4
"""A run that diverges is made again with steps so many times shorter, which may be at fault."""

FIRST_LOOK_S, LATER = 0.7, 1.5
"""When a motion is looked at first, after several swings of what is fast, and by how much later
each time (judged: they cost time only)."""

LEAST_SWING = 0.01
"""Half a swing, in plays of the gear, below which nothing is said to hunt (judged)."""

ROUNDING = 1e-3
"""Part of a way that is noise: slower than by this part of what would rest need not slow down."""

STEADY, EVEN = 0.02, 2e-3
"""Before the end swings last that differ by less than the first from group to group; and if they
shrink or grow from each to the next by half as much again or more, as they do before they end or
settle, by less than the second in all (judged)."""

SUSTAINED = 0.9
"""At the end of the time the last swings need only be so large, compared with those before; and
always so quick, for in a dead band what creeps turns ever later: if the times until then grow in
proportion, the last third of its turns takes 4^(2/3) = 2.5 times as long as the first."""

DECAY = math.sqrt(10.0)
"""What comes less times as far in the last nine tenths of a day as in nine tenths of the time
before dies out: it is 10 times for what lasts, once for what slows down as 1/t."""


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
    """Whether it still moves at the end of the time, which does not tell how it goes on."""


QUIET = Swing(False, 0.0, 0.0)
UNCLEAR = QUIET._replace(unclear=True)
DIVERGES = Swing(True, math.inf, 0.0)


@dataclass(frozen=True)
class Trial:
    """A run of what is released."""

    released: Released
    start: float
    """How far joints and motors begin aside, in plays of their gears."""
    play: bool = True
    """Whether gears have their play."""
    longest: float | None = None
    """[s]; None: `DAY_S` under a servo, else `LONGEST_S`."""


def swings(trial: Trial) -> list[Swing]:
    """What each axis does in the end.

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
    """What each axis does in a run, at the end of which it is said if it is the `last` one; none if
    not all are clear.
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
    """What an axis does that the engine does not tell."""
    start = trial.start * axis.gear.play
    for time, positions in slow_motion(axis, start, trial.play, longest, STEPPED_S, LATER):
        if swing := _judge(time, positions, axis, last=time[-1] >= longest):
            return swing
    return UNCLEAR


def _judge(time: np.ndarray, positions: np.ndarray, axis: Axis, last: bool) -> Swing | None:
    """What a motion of link and motor shows, times evenly apart (n,) and positions (2, n); None if
    it does not tell yet, and there is more.
    """
    servo = axis.drive if isinstance(axis.drive, Servo) else None
    least_span = 2.0 * LEAST_SWING * axis.gear.play
    quarter = (len(time) - 1) // 4
    late = len(time) - 1 - 3 * quarter
    later = positions[:, late:]
    travels = [np.ptp(later[:, k * quarter :][:, : quarter + 1], axis=1) for k in range(3)]
    day = DAY_S if servo else LONGEST_S
    day_travels = travels[2] * day / float(time[-1] - time[-1 - quarter])
    at_rest = day_travels < least_span * np.where(travels[2] <= travels[1], 1.0, ROUNDING)
    if at_rest.all() or (last and at_rest[1]):
        return QUIET  # in the end a link may float in its play, beside a motor that stands
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
    counts = servo is not None and servo.resolution > 0.0
    if servo and servo.i_gain == 0.0 and time[-1] >= (CHATTERS_S if counts else STEPPED_S - STEP_S):
        # Beside the edge of a count it chatters where it came to rest, as nothing winds up.
        tail = later[:, quarter:]
        chatters = len(_rises(tail[body])) > 6 and np.ptp(tail, axis=1).max() < least_span
        grows = travels[2] > (1.0 + (STEADY if counts else EVEN)) * travels[1]
        if chatters and not (grows[body] if counts else grows.any()):
            return QUIET
    if not last:
        return None
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
    """Whether swings of these three sizes, one after the other, go on so."""
    first, second, third = sizes
    before, after = second - first, third - second
    drifting = before * after > 0.0 and abs(after) > 0.5 * abs(before)
    drifting = drifting and abs(before + after) > EVEN * third
    if last:
        return third > SUSTAINED * max(first, second) and not (drifting and after < 0.0)
    return max(abs(before), abs(after)) < STEADY * third and not drifting


def _rises(values: np.ndarray) -> np.ndarray:
    """Where values pass their middle upwards, an eighth of their range either way left out."""
    low, high = values.min(), values.max()
    deviation = values - 0.5 * (low + high)
    side = np.sign(np.where(np.abs(deviation) > 0.125 * (high - low), deviation, 0.0))
    records = np.flatnonzero(side)
    return records[1:][(side[records[1:]] > 0.0) & (side[records[:-1]] < 0.0)]
