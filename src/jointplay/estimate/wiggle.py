"""Play of a joint from what its own servo reports while it is wiggled.

`wiggle_goal` is the motion, a `ServoLog` what was recorded, `Known` what is known of the joint
beforehand. `play_of` answers with a band or a bound, or says why the log cannot tell. With the
encoder on the output, features of the log that ignore phase go through a small regression, trained
on a broad family of simulated joints (benchmarks/truth/wiggle.py --train); with the encoder on the
motor, the two-inertia joint of `servo_joint` is fitted with each of a series of plays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.estimate.unknowns import Estimate
from jointplay.simulation.loads.drive import Servo

TRIANGLES = ((3.0, 40.0, 3), (3.0, 20.0, 2), (2.0, 8.0, 1), (1.0, 8.0, 2), (0.4, 4.0, 2))
"""Amplitude [deg], speed [deg/s] and number of each series of triangles."""
SQUARES = (1.0, 100.0, 0.3, 3)
"""Amplitude [deg], speed [deg/s], rest at each side [s] and number of the squares that follow."""
_UNLIKE = np.radians(0.35)
"""Root mean square of the goals beside those of the test up to which they are the same [rad]."""


@dataclass(frozen=True)
class Known:
    """What is known of one joint; SI, referred to the joint."""

    servo: Servo
    """With the side of its encoder and its gains; friction and viscous need not be right."""
    rotor_inertia: float
    """Of the motor behind the gear [kg m^2]."""
    link_inertia: float
    """About the joint, the others held [kg m^2]."""
    load: float = 0.0
    """Gravity's torque on the joint in the pose [N m]."""


@dataclass(frozen=True)
class ServoLog:
    """What one joint's servo reported during a wiggle, arrays of one length."""

    joint: str
    time: np.ndarray
    """Increasing [s]."""
    goal: np.ndarray
    """As it was sent [rad]."""
    position: np.ndarray
    """As the encoder reads it, referred to the joint [rad]."""
    others: np.ndarray | None = None
    """Largest motion of the other joints at each time [rad]; None: not recorded."""


def wiggle_goal() -> tuple[np.ndarray, np.ndarray]:
    """The motion about the pose: times [s] and goals [rad] of its corners, straight between.

    Triangles of 3 deg and less at several speeds, then small squares; it begins and ends at zero.
    """
    time, goal = [0.0], [0.0]

    def to(where: float, speed: float) -> None:
        time.append(time[-1] + abs(where - goal[-1]) / speed)
        goal.append(where)

    for amplitude, speed, number in TRIANGLES:
        for _ in range(number):
            to(amplitude, speed)
            to(-amplitude, speed)
        to(0.0, speed)
    amplitude, speed, rest, number = SQUARES
    for where in number * (amplitude, -amplitude):
        to(where, speed)
        time.append(time[-1] + rest)
        goal.append(where)
    to(0.0, speed)
    time.append(time[-1] + rest)
    goal.append(0.0)
    return np.array(time), np.radians(goal)


class Untold(Exception):
    """Why a log cannot tell, in words."""


def play_of(log: ServoLog, known: Known) -> Estimate:
    """The play of a joint's gear by a log of its wiggle [rad].

    Its interval is a band in tenths of a degree, rounded outward; one without low end is an upper
    bound (not `found`); and there is a reason where the log cannot tell.
    """
    raise NotImplementedError


# ---- Features ------------------------------------------------------------------------------------

GRID_HZ = 100.0
"""Of the samples that features are of."""
BANDS_HZ = (1.5, 3.0, 5.0, 8.0, 13.0, 20.0, 30.0, 50.0)
_QUANTILES = (0.1, 0.25, 0.5, 0.75, 0.9, 0.99)
_FLOOR = 2e-4
"""Angles below it are alike [rad]."""


def _segments() -> list[tuple[float, float, float]]:
    """Begin, end and period of each series of triangles and of the squares [s]."""
    found, begin = [], 0.0
    for amplitude, speed, number in TRIANGLES:
        length = 4.0 * amplitude / speed
        found.append((begin, begin + number * length, length))
        begin += number * length
    amplitude, speed, rest, number = SQUARES
    length = 2.0 * (rest + 2.0 * amplitude / speed)
    return [*found, (begin, begin + number * length, length)]


def _about(angle: np.ndarray) -> np.ndarray:
    """Logarithms of angles, for which those below the floor are alike."""
    found: np.ndarray = np.log(np.abs(angle) + _FLOOR)
    return found


def _segment_features(goal: np.ndarray, seen: np.ndarray, period: float) -> np.ndarray:
    """Of one segment, on the grid."""
    lag = goal - seen
    mean = lag.mean()
    lag = lag - mean
    moved, turn = np.diff(seen), np.diff(goal)
    still = np.abs(moved) < _FLOOR
    speeds = np.quantile(np.abs(moved), _QUANTILES)
    rising, falling = lag[1:][turn > 0.0], lag[1:][turn < 0.0]
    up, down = (x.mean() if len(x) else 0.0 for x in (rising, falling))
    wave = np.exp(2j * np.pi / (period * GRID_HZ) * np.outer((1.0, 3.0), np.arange(len(goal))))
    first, third = wave @ (seen - seen.mean()) / len(goal)
    own = wave[0] @ (goal - goal.mean()) / len(goal)
    ratio = first / own
    rest = lag - 2.0 * np.real((own - first).conjugate() * wave[0])
    power = np.abs(np.fft.rfft(rest - rest.mean(), 512)) ** 2 / len(goal)
    at = np.searchsorted(np.fft.rfftfreq(512, 1.0 / GRID_HZ), BANDS_HZ)
    bands = np.sqrt(np.add.reduceat(power, at[:-1]) / 256.0)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still, [0]])))
    runs = edges[1::2] - edges[::2]
    angles = [
        mean, lag.std(), np.abs(lag).mean(), *np.quantile(np.abs(lag), (0.5, 0.9, 1.0)),
        np.ptp(seen), np.subtract(*np.quantile(seen, (0.95, 0.05))), up - down,
        rising.std() if len(rising) else 0.0, falling.std() if len(falling) else 0.0,
        np.diff(moved).std(), np.abs(third), *bands, *speeds,
    ]  # fmt: skip
    turns = np.count_nonzero(np.diff(np.sign(moved[~still])))
    plain = [
        ratio.real, ratio.imag, still.mean(), np.log1p(turns),
        np.log1p(runs.max() if len(runs) else 0.0), np.log1p(len(runs)),
    ]  # fmt: skip
    return np.concatenate([_about(np.array(angles)), plain])


def _known_features(known: Known) -> np.ndarray:
    """What is known, without dimensions as far as it goes."""
    servo, rotor = known.servo, known.rotor_inertia
    spring = servo.stall * servo.p_gain
    logs = np.log(
        [
            known.link_inertia / rotor, spring / rotor, servo.stall * servo.voltage / rotor,
            servo.braking / rotor, servo.d_gain / servo.p_gain + 1e-3, servo.band + _FLOOR,
            servo.resolution + _FLOOR, (servo.period or 0.0) + 1e-3,
        ]
    )  # fmt: skip
    return np.append(logs, _about(np.array([known.load / spring])))


def features(log: ServoLog, known: Known) -> np.ndarray:
    """What the regression sees of a log: shape (n,); the phase of fast motion is not in it.

    Raises:
        Untold: the goal is not that of `wiggle_goal`, or was not followed.
    """
    time, goal = wiggle_goal()
    begin = _begin(log)
    even = np.arange(0.0, time[-1], 1.0 / GRID_HZ)
    if log.time[-1] < begin + time[-1] - 0.3 or log.time[0] > begin + 0.1:
        raise Untold(f"the log has not the whole wiggle of {time[-1]:.1f} s")
    sent = np.interp(begin + even, log.time, log.goal - log.goal[0])
    seen = np.interp(begin + even, log.time, log.position - log.goal[0])
    if np.sqrt(np.mean((sent - np.interp(even, time, goal)) ** 2)) > _UNLIKE:
        raise Untold("its goals are not those of the wiggle test")
    if np.ptp(seen) < 0.2 * np.ptp(goal):
        raise Untold(f"the joint hardly followed: {np.degrees(np.ptp(seen)):.2g} deg in all")
    parts = [
        _segment_features(sent[at], seen[at], period)
        for first, last, period in _segments()
        for at in (slice(round(first * GRID_HZ), round(last * GRID_HZ)),)
    ]
    return np.concatenate([*parts, _known_features(known)])


def _begin(log: ServoLog) -> float:
    """When the wiggle begins in the log's time, by its goals [s]."""
    time, goal = wiggle_goal()
    away = np.abs(log.goal - log.goal[0]) > np.radians(0.3)
    if not away.any():
        raise Untold("its goals do not move")
    rough = float(log.time[np.argmax(away)])
    even = np.arange(0.0, 3.0, 0.01)
    wanted = np.interp(even, time, goal)
    tries = rough + np.arange(-0.06, 0.061, 0.002)
    off = [
        np.sum((np.interp(one + even, log.time, log.goal - log.goal[0]) - wanted) ** 2)
        for one in tries
    ]
    return float(tries[int(np.argmin(off))])
