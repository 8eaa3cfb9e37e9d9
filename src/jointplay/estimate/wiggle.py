"""Play of a joint from what its own servo reports while it is wiggled.

`wiggle_goal` is the motion, a `ServoLog` what was recorded, `Known` what is known of the joint
beforehand; logs and joints of which nothing can be told are refused. With the encoder on the output
features of the log that ignore the phase of hunting go through a small regression, trained on a
broad family of simulated joints (benchmarks/truth/wiggle.py --train); those of two logs of a joint
go through another, which tells by how much its play differs.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.simulation.loads.drive import Servo

DATA = Path(__file__).parent / "data" / "wiggle.npz"
"""Numbers of the regression; its SHA-256 stands beside it."""
TRIANGLES = {
    "link": ((3.0, 40.0, 3), (3.0, 20.0, 2), (2.0, 8.0, 1), (1.0, 8.0, 2), (0.4, 4.0, 2)),
    "motor": ((2.0, 60.0, 5), (1.0, 40.0, 6), (3.0, 30.0, 3), (3.0, 15.0, 1), (2.0, 8.0, 1)),
}
"""Amplitude [deg], speed [deg/s] and number of each series of triangles, by the encoder's side."""
SQUARES = {"link": (1.0, 100.0, 0.3, 3), "motor": (2.0, 100.0, 0.2, 3)}
"""Amplitude [deg], speed [deg/s], rest at each side [s] and number of the squares that follow."""
RATE_HZ, JITTER_S = 80.0, 4e-3
"""Least rate of records, and largest deviation of their intervals from the usual one."""
USUAL_S = 1e-3
"""Period of a servo that is not given."""
STIR = np.radians(0.5)
"""Largest motion of the other joints [rad]."""
REVERSES, LEAST_FRICTION = 2.0, 0.01
"""Gravity's torque by the motor's friction up to which a log is looked at; and what friction is at
least, by the torque at stall."""
HEAVY = 1.2
"""Least inertia of a link, by the rotor's, that an encoder on the motor feels."""
BIN = 0.05
"""Of play and its change [deg]."""
EDGES = {
    "gear_play": np.radians(np.arange(34) * BIN),
    "servo_friction": np.linspace(np.log(0.003), np.log(0.11), 26),
    "gear_compliance": np.linspace(np.log(1.5e-3), np.log(0.11), 30),
    "change": np.radians(np.arange(-32, 33) * BIN),
}
"""Of the bins in which is told how likely is: a play [rad], the logarithm of the motor's friction
by its torque at stall, that of how far the teeth wind up under this [rad], a play's change
[rad]."""
NETWORKS = {"value": ("gear_play", "servo_friction", "gear_compliance"), "change": ("change",)}
"""What each kind of network tells."""
LARGEST = float(EDGES["gear_play"][-1])
"""Play of the family [rad]."""
HALF, WIDEST = 0.5, 0.8
"""A band wider than `WIDEST` is told only if it is all on one side of `HALF` [deg]."""
KNOWN = (
    *("link's inertia by the rotor's", "P gain", "voltage", "back-EMF", "D gain", "dead band"),
    *("resolution", "period", "load"),
)
"""What the regression is told of a joint."""
_BEYOND, _FAR, _ODD = 0.1, 4.0, 12.0
"""How far beyond the family's what is known may be, and scaled features count at most."""
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


def wiggle_goal(encoder: str = "link") -> tuple[np.ndarray, np.ndarray]:
    """The motion about the pose: times [s] and goals [rad] of its corners, straight between.

    Triangles of 3 deg and less at several speeds, then small squares; it begins and ends at zero.
    With the encoder on the "motor" it is faster, for there the link's inertia tells.
    """
    time, goal = [0.0], [0.0]

    def to(where: float, speed: float) -> None:
        time.append(time[-1] + abs(where - goal[-1]) / speed)
        goal.append(where)

    for amplitude, speed, number in TRIANGLES[encoder]:
        for _ in range(number):
            to(amplitude, speed)
            to(-amplitude, speed)
        to(0.0, speed)
    amplitude, speed, rest, number = SQUARES[encoder]
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


def outward(ends: tuple[float, float], step: float | np.ndarray) -> tuple[float, float]:
    """An interval rounded outward to multiples of a step, or of one for each end."""
    low, high = np.array(ends) / step
    low, high = step * np.array([np.floor(low + 1e-9), np.ceil(high - 1e-9)])
    return float(low), float(high)


def rounded(low: float, high: float) -> tuple[float, float]:
    """An interval of play in tenths of a degree, rounded outward [rad]."""
    tenth = np.radians(0.1)
    return outward((low, np.inf if high > LARGEST - tenth else high), tenth)


def too_wide(low: float, high: float) -> bool:
    """Whether a band is too wide to be told, and on both sides of `HALF`."""
    half, hair = np.radians(HALF), 1e-9
    wide = min(high, LARGEST) - low > np.radians(WIDEST) + hair
    return bool(wide and low < half - hair and high > half + hair)


def check_log(log: ServoLog) -> None:
    """Refuse logs of which nothing can be told.

    Raises:
        Untold: with the reason.
    """
    size = len(log.time)
    arrays = [log.time, log.goal, log.position]
    if size < 10 or any(len(x) != size or not np.isfinite(x).all() for x in arrays):
        raise Untold("a log needs times, goals and positions, as many of each and all finite")
    between = np.diff(log.time)
    if (between < 0.0).any():
        raise Untold("the times of the log do not increase")
    middle = float(np.median(between))
    if middle * RATE_HZ > 1.0:
        raise Untold(
            f"the log has {1.0 / middle:.3g} records a second, and at least {RATE_HZ:g} are needed"
        )
    off = float(np.quantile(np.abs(between - middle), 0.95))
    if off > JITTER_S:
        raise Untold(
            f"its records are up to {1e3 * off:.2g} ms off their rhythm, more than "
            f"{1e3 * JITTER_S:g} ms"
        )
    if log.others is not None and (stir := float(np.max(log.others))) > STIR:
        raise Untold(
            f"other joints moved by {np.degrees(stir):.2g} deg, more than {np.degrees(STIR):.2g}"
        )


def check_load(known: Known) -> None:
    """Refuse joints that gravity may hold to one side.

    Raises:
        Untold: with the reason.
    """
    servo = known.servo
    least = max(servo.friction, LEAST_FRICTION * servo.stall * servo.voltage)
    if abs(known.load) > REVERSES * least:
        raise Untold(
            f"gravity's {abs(known.load):.2g} N m leans on one side: no reversal of torque is "
            f"sure with friction of {least:.2g} N m"
        )


def check_joint(known: Known) -> None:
    """Refuse joints of which no log can tell anything.

    Raises:
        Untold: with the reason.
        JointplayError: the numbers of the regression are damaged.
    """
    check_load(known)
    if known.servo.encoder == "motor":
        if known.link_inertia < HEAVY * known.rotor_inertia:
            raise Untold(
                f"the encoder is on the motor, and the link's inertia of {known.link_inertia:.2g} "
                f"kg m^2 is below {HEAVY:g} times the rotor's: it does not feel the play"
            )
        return
    numbers = regression()
    within = inside(_known_features(known), numbers)
    if not within.all():
        what = KNOWN[int(np.argmin(within))]
        raise Untold(f"its {what} is outside those of the simulated family")


# ---- Encoder on the output: a regression ---------------------------------------------------------


@cache
def regression() -> dict[str, np.ndarray]:
    """Numbers of the regression and its family, as benchmarks/truth/wiggle.py wrote them.

    Raises:
        JointplayError: they are not those that were written.
    """
    content = DATA.read_bytes()
    wanted = DATA.with_suffix(".sha256").read_text().split()[0]
    if hashlib.sha256(content).hexdigest() != wanted:
        raise JointplayError(f"{DATA} is damaged: its SHA-256 is not {wanted}; install it again")
    with np.load(io.BytesIO(content)) as file:
        return dict(file)


def ends_by_family(log: ServoLog, known: Known) -> dict[str, tuple[float, float]]:
    """Ends of intervals by the regression: of play, friction and compliance [SI].

    Raises:
        Untold: no joint of the family moves so, or see `on_grid`.
        JointplayError: the numbers of the regression are damaged.
    """
    numbers, most = regression(), known.servo.stall * known.servo.voltage
    likely = shares(seen_of(log, known), numbers)
    ends = {name: ends_of(name, one, numbers["tails"]) for name, one in likely.items()}
    (first, last), (soft, softer) = (np.exp(ends[k]) for k in NETWORKS["value"][1:])
    return ends | {
        "servo_friction": (most * first, most * last),
        "gear_compliance": (soft / most, softer / most),
    }


def change_by_family(
    both: Sequence[tuple[ServoLog, Known]], part: float = 1.0
) -> tuple[float, float, float]:
    """Of how much larger a joint's play is in the second of two logs: ends of its interval, rounded
    outward to the bins', and what it surely is at least [rad].

    That there is growth is told earlier than how much: of joints whose play stays as it is one of
    forty is told to have grown by something.

    Args:
        both: of the same joint, with what is known of it at each.
        part: of these false alarms.

    Raises:
        Untold: no joint of the family moves so, or see `on_grid`.
        JointplayError: the numbers of the regression are damaged.
    """
    numbers = regression()
    seen = np.array([seen_of(*one) for one in both])
    likely = change_shares(seen, numbers)
    below = np.concatenate([[0.0], np.cumsum(likely)])
    least = float(np.interp(part * numbers["alarm"], below, EDGES["change"]))
    return *outward(ends_of("change", likely, numbers["tails"]), np.radians(BIN)), least


def seen_of(log: ServoLog, known: Known) -> np.ndarray:
    """Features of a log that is like those of the family, shape (n,).

    Raises:
        Untold: it is not, or see `on_grid`.
    """
    seen, numbers = features(log, known), regression()
    if strangeness(seen, numbers) > numbers["strange"]:
        raise Untold(
            "no simulated joint moves as this log does (one of 100 of the family is refused so)"
        )
    return seen


def inside(own: np.ndarray, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
    """Which of what is known, shape (..., n), is within the family."""
    near = (own >= numbers["least"] - _BEYOND) & (own <= numbers["most"] + _BEYOND)
    return np.asarray(near)


def scaled(seen: np.ndarray, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
    """Features by the family's mean and spread, near it."""
    return np.asarray(np.clip((seen - numbers["mean"]) / numbers["spread"], -_FAR, _FAR))


def shares(
    seen: np.ndarray, numbers: Mapping[str, np.ndarray], kind: str = "value"
) -> dict[str, np.ndarray]:
    """How likely each bin is of what a kind of networks tells: shape (..., bins).

    The mean of several networks with leaking rectifiers, with softmax over the bins of each.

    Args:
        seen: features, shape (..., n); for "change" see `paired`.
        numbers: of `regression`.
        kind: of `NETWORKS`.
    """
    found = []
    for k in range(int(numbers["networks"])):
        x = scaled(seen, numbers) if kind == "value" else seen
        for layer in range(3):
            x = x @ numbers[f"{kind}_weight_{k}_{layer}"] + numbers[f"{kind}_offset_{k}_{layer}"]
            x = np.maximum(x, 0.1 * x) if layer < 2 else x
        found.append([softmax(part) for part in np.split(x, cuts(kind), axis=-1)])
    means = (np.mean(one, axis=0) for one in zip(*found, strict=True))
    return dict(zip(NETWORKS[kind], means, strict=True))


def cuts(kind: str) -> np.ndarray:
    """Where a network's outputs of the next of what it tells begin."""
    return np.cumsum([len(EDGES[name]) - 1 for name in NETWORKS[kind]])[:-1]


def softmax(x: np.ndarray) -> np.ndarray:
    """Likelihoods (..., bins) by the networks' outputs."""
    found = np.exp(x - x.max(axis=-1, keepdims=True))
    return np.asarray(found / found.sum(axis=-1, keepdims=True))


def paired(seen: np.ndarray, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
    """Of two logs' features, shape (..., 2, n), their mean and, of logs, their difference."""
    first, last = seen[..., 0, :], seen[..., 1, :]
    differ = np.clip(2.0 * (last - first) / numbers["spread"], -_FAR, _FAR)
    mean = 0.5 * (scaled(first, numbers) + scaled(last, numbers))
    return np.concatenate([mean, differ[..., : -len(KNOWN)]], axis=-1)


def change_shares(seen: np.ndarray, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
    """How likely each change of play is by two logs' features (..., 2, n), in both orders."""
    there, back = (
        shares(paired(one, numbers), numbers, "change")["change"]
        for one in (seen, seen[..., ::-1, :])
    )
    return np.asarray(0.5 * (there + back[..., ::-1]))


def ends_of(name: str, likely: np.ndarray, tails: np.ndarray) -> tuple[float, float]:
    """Ends of an interval that leaves so much of the likelihood below and above.

    Args:
        name: of what is told, of `EDGES`.
        likely: by bin.
        tails: below and above, a row for each of `EDGES`.
    """
    below = np.concatenate([[0.0], np.cumsum(likely)])
    least, most = tails[list(EDGES).index(name)]
    low, high = np.interp([least, below[-1] - most], below, EDGES[name])
    return float(low), float(high)


def strangeness(seen: np.ndarray, numbers: Mapping[str, np.ndarray]) -> np.ndarray:
    """How far features are from the family's, by their principal components; shape (...)."""
    scaled = np.clip((seen - numbers["mean"]) / numbers["spread"], -_ODD, _ODD)
    along = scaled @ numbers["axes"]
    left = np.sum(scaled**2, axis=-1) - np.sum(along**2, axis=-1)
    inside = np.sum((along / numbers["along"]) ** 2, axis=-1)
    return np.asarray(inside + left / numbers["left"])


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
    for amplitude, speed, number in TRIANGLES["link"]:
        length = 4.0 * amplitude / speed
        found.append((begin, begin + number * length, length))
        begin += number * length
    amplitude, speed, rest, number = SQUARES["link"]
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
            servo.resolution + _FLOOR, (servo.period or USUAL_S) + 1e-3,
        ]
    )  # fmt: skip
    return np.append(logs, _about(np.array([known.load / spring])))


def features(log: ServoLog, known: Known) -> np.ndarray:
    """What the regression sees of a log: shape (n,); the phase of fast motion is not in it.

    Raises:
        Untold: see `on_grid`.
    """
    sent, seen = on_grid(log)
    parts = [
        _segment_features(sent[at], seen[at], period)
        for first, last, period in _segments()
        for at in (slice(round(first * GRID_HZ), round(last * GRID_HZ)),)
    ]
    return np.concatenate([*parts, _known_features(known)])


def on_grid(log: ServoLog, encoder: str = "link") -> tuple[np.ndarray, np.ndarray]:
    """Goals and positions about the first goal during the wiggle, at `GRID_HZ` [rad].

    Raises:
        Untold: the goal is not that of `wiggle_goal`, or was not followed.
    """
    time, goal = wiggle_goal(encoder)
    begin = begin_of(log, encoder)
    even = np.arange(0.0, time[-1], 1.0 / GRID_HZ)
    if log.time[-1] < begin + time[-1] - 0.3 or log.time[0] > begin + 0.1:
        raise Untold(f"the log has not the whole wiggle of {time[-1]:.1f} s")
    sent = np.interp(begin + even, log.time, log.goal - log.goal[0])
    seen = np.interp(begin + even, log.time, log.position - log.goal[0])
    if np.sqrt(np.mean((sent - np.interp(even, time, goal)) ** 2)) > _UNLIKE:
        raise Untold("its goals are not those of the wiggle test")
    if np.ptp(seen) < 0.2 * np.ptp(goal):
        raise Untold(f"the joint hardly followed: {np.degrees(np.ptp(seen)):.2g} deg in all")
    return sent, seen


def begin_of(log: ServoLog, encoder: str = "link") -> float:
    """When the wiggle begins in the log's time, by its goals [s]."""
    time, goal = wiggle_goal(encoder)
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
