"""What servos report while joints are wiggled: read, cut by joint, and what it tells of their play.

A log has goal and position of each joint at times of its own: a CSV with columns such as
``elbow goal [deg]`` and ``elbow position [deg]``, a ROS 2 bag, or a LeRobot dataset, whose action
is the goal. A joint's part is where its goal goes to and fro and no other moves.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.accuracy.poses import middle, moving
from jointplay.base import files
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.schema import shortest
from jointplay.base.tables import few
from jointplay.base.units import readable
from jointplay.estimate import columns
from jointplay.estimate.machine import OfJoints
from jointplay.estimate.recordings import Recording
from jointplay.estimate.unknowns import Estimate, Loop, Unknown
from jointplay.estimate.wiggle import (
    LARGEST,
    Known,
    ServoLog,
    Untold,
    change_by_family,
    check_joint,
    check_log,
    ends_by_family,
    outward,
    rounded,
    too_wide,
)
from jointplay.estimate.wiggle_plan import dial_note, known_of
from jointplay.estimate.wiggle_profile import Profile
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import Drive, Servo

QUANTITIES = {"gear_play": "rad", "servo_friction": "N*m", "gear_compliance": "rad/(N*m)"}
"""What is told of a joint, and its unit."""
FACTOR = 4.0
"""Between the ends of an interval of friction or compliance, above which it is not told."""
_PAUSE_S = 0.7
"""Longest time within a wiggle in which its goal stands, and how long a part lasts beyond it."""
_STILL = 1e-4
"""Change of a goal that is none [rad]."""
_TURNS = 2
"""Reversals of a goal from which on it is a wiggle."""
_SLOW = np.radians(10.0)
"""Speed of goals up to which a loop is drawn [rad/s]."""
_GAIN = re.compile(r"\b(?:P_Coefficient|Position_P_Gain) (\d+)\b")
_VOLTS = re.compile(r"\bPresent_(?:Input_)?Voltage (\d+)\b")
"""What the script for LeRobot's bus writes of a joint into comments: P gain, supply [0.1 V]."""


@dataclass(frozen=True)
class ServoSignals:
    """Goals and positions of servos [rad], at n times."""

    time: np.ndarray
    """At which positions were read, (n,) [s]."""
    goal: Mapping[str, np.ndarray]
    """By joint, as sent before those times, (n,)."""
    position: Mapping[str, np.ndarray]
    """By joint, (n,)."""
    source: str
    gains: Mapping[str, tuple[float, float]]
    """P gain in the firmware's numbers and supply [V] by joint, as far as the log has them."""
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        late = np.flatnonzero(~(np.diff(self.time) > 0.0))
        if late.size:
            raise JointplayError(f"{self.source}: times must increase (record {late[0] + 2})")
        lacking = [name for name in self.goal if name not in self.position]
        if lacking or not self.goal:
            raise JointplayError(
                f"{self.source}: goal and position of a joint are needed; "
                + (f"{lacking[0]} has no position" if lacking else "there is no goal")
            )

    @classmethod
    def read(cls, log: str | Path | Recording, joints: Mapping[str, bool]) -> ServoSignals:
        """Read a log: the path of a CSV, or a recording with sources ``goal`` and ``position``.

        `joints` are the robot's, and whether each slides.

        Raises:
            JointplayError: see `columns.read`, `Recording.signals` and the class.
        """
        if isinstance(log, Recording):
            return cls._of_recording(log, joints)
        path = Path(log)

        def known(name: str) -> tuple[columns.Key, str] | None:
            if name.lower() in ("time", "t"):
                return ("time", ""), "s"
            return columns.meaning(name, joints, columns.SERVO_UNITS, {})

        words = f"time, JOINT goal, JOINT position of the joints {', '.join(joints)}"
        numbers, _ = columns.read(path, "log", known, words)
        if ("time", "") not in numbers:
            raise JointplayError(f"{path}: column 'time [s]' is missing")
        goal, position = (
            {name: x for (kind, name), x in numbers.items() if kind == one}
            for one in columns.SERVO_UNITS
        )
        return cls(numbers["time", ""], goal, position, str(path), _gains(path))

    @classmethod
    def of(cls, log: ServoSignals | str | Path | Recording, mechanism: Mechanism) -> ServoSignals:
        """A log of a robot, read if it is not yet; see `read`."""
        if isinstance(log, ServoSignals):
            return log
        entries = mechanism.description.joints
        return cls.read(log, {name: entries[name].slides for name in moving(mechanism)})

    @classmethod
    def _of_recording(cls, log: Recording, joints: Mapping[str, bool]) -> ServoSignals:
        found, notes = log.signals(joints)
        goals = {name: one for (kind, name), one in found.items() if kind == "goal"}
        seen = {name: one for (kind, name), one in found.items() if kind == "position"}
        if not goals or not seen:
            raise JointplayError(f"{log.path}: a wiggle needs the sources goal and position")
        time = np.unique(np.concatenate([one[0] for one in seen.values()]))
        begin = max(one[0][0] for one in (*goals.values(), *seen.values()))
        time = time[time >= begin]
        if not len(time):
            raise JointplayError(f"{log.path}: goals and positions do not overlap in time")
        # A goal holds until the next; positions of topics of their own are between their records.
        goal = {n: x[np.searchsorted(t, time, side="right") - 1] for n, (t, x) in goals.items()}
        position = {n: np.interp(time, t, x) for n, (t, x) in seen.items()}
        seconds = (time - time[0]) / 1e9
        return cls(seconds, goal, position, str(log.path), {}, tuple(notes))

    def logs(self) -> dict[str, tuple[ServoLog, dict[str, float]]]:
        """Of each joint that is wiggled its part of the log, and the pose [rad]."""
        found = {}
        for joint in self.goal:
            if (part := self._part(joint)) is not None:
                rest = [x[part] for name, x in self.position.items() if name != joint]
                others = np.max([np.abs(x - x[0]) for x in rest], axis=0) if rest else None
                time = self.time[part]
                pose = {name: float(np.median(x[part])) for name, x in self.position.items()}
                found[joint] = (
                    ServoLog(
                        joint, time - time[0], self.goal[joint][part], self.position[joint][part],
                        others,
                    ),
                    pose,
                )  # fmt: skip
        return found

    def _part(self, joint: str) -> slice | None:
        """The longest time in which a joint's goal goes to and fro and all others stand."""
        goal = self.goal[joint]
        own = np.flatnonzero(np.diff(goal) != 0.0) + 1
        stir = [
            np.flatnonzero(np.abs(np.diff(x)) > _STILL) for n, x in self.goal.items() if n != joint
        ]
        foreign = np.unique(np.concatenate([*stir, np.array([], int)]))
        best: tuple[float, slice] | None = None
        cuts = np.flatnonzero(
            (np.diff(self.time[own]) > _PAUSE_S)
            | (np.searchsorted(foreign, own[1:]) > np.searchsorted(foreign, own[:-1]))
        )
        for run in np.split(own, cuts + 1):
            ways = np.sign(np.diff(goal[run])) if len(run) else np.array([])
            if np.count_nonzero(np.diff(ways[ways != 0.0])) < _TURNS:
                continue
            begin, end = self.time[run[0]] - _PAUSE_S, self.time[run[-1]] + _PAUSE_S
            k = int(np.searchsorted(foreign, run[0]))
            first = foreign[k - 1] + 1 if k else 0
            last = foreign[k] if k < len(foreign) else len(self.time) - 1
            first = max(first, int(np.searchsorted(self.time, begin)))
            last = min(last, int(np.searchsorted(self.time, end, side="right")) - 1)
            long = float(self.time[run[-1]] - self.time[run[0]])
            if best is None or long > best[0]:
                best = long, slice(first, last + 1)
        return None if best is None else best[1]


def _gains(path: Path) -> dict[str, tuple[float, float]]:
    found = {}
    for line in files.read_text(path, "log").splitlines():
        name, colon, said = line.removeprefix("#").partition(":")
        gain, volts = _GAIN.search(said), _VOLTS.search(said)
        if line.startswith("#") and colon and gain and volts:
            found[name.strip()] = float(gain[1]), 0.1 * float(volts[1])
    return found


@dataclass(frozen=True, kw_only=True)
class Wiggled(OfJoints):
    """What servos' logs tell of the play of their joints; SI units."""

    logs: Mapping[str, ServoLog]
    """By joint."""
    servos: Mapping[str, Servo]
    """As they were taken to be, by joint."""

    @property
    def loops(self) -> tuple[Loop, ...]:
        """How far each joint was from its goal, about the middle, over the goal."""
        return tuple(map(_loop, self.logs.values()))

    @property
    def _tables(self) -> Mapping[str, Mapping[str, Any]]:
        servos = dict(self.servos)
        for one in self.estimates:
            if one.unknown.name == "servo_friction" and one.identified:
                servos[one.joint] = replace(servos[one.joint], friction=one.value)
        return {"drive": {name: shortest(Drive, one) for name, one in servos.items()}}


def _loop(log: ServoLog) -> Loop:
    speed = np.gradient(log.goal, log.time)
    slow = (speed != 0.0) & (np.abs(speed) <= _SLOW)
    slow = slow if slow.any() else np.full(len(speed), True)
    goal, off = log.goal[slow], (log.position - log.goal)[slow]
    goal, off, nothing = goal - np.mean(goal), off - np.median(off), np.full(len(off), np.nan)
    branch = np.sign(speed[slow]).astype(int)
    return Loop(log.joint, goal, "goal", "rad", off, nothing, "rad", branch)


@dataclass(frozen=True)
class Wiggle:
    """One joint's part of a log, and what is known of the joint."""

    log: ServoLog
    known: Known | None = None
    """None: nothing of its servo."""

    def checked(self) -> tuple[ServoLog, Known]:
        """Both, unless nothing can be told of them.

        Raises:
            Untold: with the reason.
            JointplayError: the numbers of the regression are damaged.
        """
        if self.known is None:
            raise Untold("no servo with gains, motor and rotor is known of it")
        check_log(self.log)
        check_joint(self.known)
        return self.log, self.known


def told_of(one: Wiggle) -> tuple[Estimate, ...]:
    """What a log of its wiggle tells of a joint: the play of its gear [rad] and, with the encoder
    on the output, the motor's friction [N m] and the gear's compliance [rad/(N m)].

    The play's interval is a band in tenths of a degree, rounded outward; a band that begins at zero
    is an upper bound (not `found`), one of a play beyond the family's largest has no upper end; and
    there is a reason where the log cannot tell, of friction and compliance beyond a factor.
    """
    joint = one.log.joint
    play = unknown_of(joint)
    try:
        ends = ends_by(one)
    except Untold as error:
        return (Estimate(play, reason=str(error)),)
    low, high = ends.pop("gear_play")
    middle = 0.5 * (low + high) if np.isfinite(high) else low
    found = Estimate(play, middle, ends=(low, high), upper=high, found=low > 0.0)
    if too_wide(low, high):
        words = f"{np.degrees(low):.1f} to {np.degrees(min(high, LARGEST)):.1f} deg"
        found = replace(found, reason=f"plays from {words} would look alike in this log")
    return found, *(_factor(joint, name, *both) for name, both in ends.items())


def unknown_of(joint: str, name: str = "gear_play") -> Unknown:
    """What is sought of a joint."""
    return Unknown(
        joint, name, QUANTITIES[name], np.nan, fine=False, in_degrees=name == "gear_play"
    )


def _factor(joint: str, name: str, low: float, high: float) -> Estimate:
    """A positive quantity by the ends of its interval, unless these are too far apart."""
    unknown, reason = unknown_of(joint, name), ""
    if high > FACTOR * low:
        words = f"{unknown.shown(low)} to {unknown.shown(high)}"
        reason = f"{words} would look alike in this log, a factor of more than {FACTOR:g}"
    middle = float(f"{np.sqrt(low * high):.2g}")
    return Estimate(unknown, middle, ends=(low, high), reason=reason)


def ends_by(one: Wiggle) -> dict[str, tuple[float, float]]:
    """Ends of the intervals of what a log tells [SI], however wide, by `QUANTITIES`.

    They are rounded outward, those of play to tenths of a degree, else to two digits; the upper one
    of play is infinite where it reaches the family's largest.

    Raises:
        Untold: the log or the joint is refused.
        JointplayError: the numbers of the regression are damaged.
    """
    log, known = one.checked()
    motor = known.servo.encoder == "motor"
    ends = {"gear_play": Profile(log, known).ends()} if motor else ends_by_family(log, known)
    play = rounded(*ends.pop("gear_play"))
    return {"gear_play": play} | {
        name: outward(both, 10.0 ** (np.floor(np.log10(both)) - 1.0)) for name, both in ends.items()
    }


def change_of(first: Wiggle, last: Wiggle, part: float = 1.0) -> tuple[float, float, float]:
    """See `change_by_family`; with the encoder on the motor the interval is as wide as both bands.

    Raises:
        Untold: a log or the joint is refused, or a play may be beyond the family's largest.
        JointplayError: the numbers of the regression are damaged.
    """
    both = first.checked(), last.checked()
    if both[0][1].servo.encoder == "link":
        return change_by_family(both, part)
    (low, high), (least, most) = (ends_by(one)["gear_play"] for one in (first, last))
    if np.isinf([high, most]).any():
        raise Untold(f"a play may be beyond {np.degrees(LARGEST):.3g} deg, and so any change")
    return least - high, most - low, least - high


def wiggles(
    mechanism: Mechanism, log: ServoSignals, drives: Mapping[str, Drive]
) -> tuple[dict[str, Wiggle], list[str]]:
    """The wiggle of each joint that a log has one of, and notes on what was assumed.

    Raises:
        JointplayError: no joint is wiggled alone.
        MissingName: a joint that the robot has not.
    """
    names = moving(mechanism)
    for name in log.goal:
        if name not in names:
            raise MissingName("joint that moves", name, names)
    parts = log.logs()
    if not parts:
        raise JointplayError(
            f"{log.source}: no joint's goal goes to and fro while the others stand: "
            f"{few(list(log.goal))}; --plan wiggle writes such a motion"
        )
    found, assumed = dict[str, Wiggle](), list[str]()
    for joint, (part, pose) in parts.items():
        servo, known = drives.get(joint), None
        if isinstance(servo, Servo) and joint in mechanism.gears:
            if joint in log.gains and servo.catalogue is not None:
                servo = servo.with_gain(*log.gains[joint])
            else:
                assumed.append(f"{joint} {readable(servo.p_gain, 'V/rad', 3)}")
            known = known_of(mechanism, servo, joint, {**middle(mechanism), **pose})
        found[joint] = Wiggle(part, known)
    notes = list(log.notes)
    if assumed:
        notes.append(
            f"note: the log says no gains; taken are {few(assumed)}: --set drives.JOINT.p_gain=... "
            "says others (LeRobot halves the P gain of an SO-101)"
        )
    return found, notes


def identify_wiggled(
    mechanism: Mechanism, log: ServoSignals | str | Path | Recording, drives: Mapping[str, Drive]
) -> Wiggled:
    """What is told of single joints by what their servos report while they are wiggled.

    Args:
        mechanism: the robot, with the gears of the joints.
        log: or what `ServoSignals.read` reads.
        drives: by joint; the side of a servo's encoder counts, its gain if the log has none.

    Raises:
        JointplayError: no joint is wiggled alone; see `ServoSignals.read`.
        MissingName: a joint that the robot has not.
    """
    signals = ServoSignals.of(log, mechanism)
    parts, notes = wiggles(mechanism, signals, drives)
    found, servos, mute, soft = list[Estimate](), dict[str, Servo](), list[str](), list[str]()
    for joint, one in parts.items():
        told = told_of(one)
        # Stiffness is told so seldom that its reasons would be all one reads.
        kept = [x for x in told if x.identified or x.unknown.name != "gear_compliance"]
        soft += [joint] * (len(told) - len(kept))
        found += kept
        if one.known is not None:
            servos[joint] = one.known.servo
            if told[0].reason and one.known.servo.encoder == "link":
                mute.append(joint)
    if soft:
        notes.append(
            f"note: the log does not tell the stiffness of {few(soft)} to a factor of {FACTOR:g}"
        )
    if mute:
        notes.append(dial_note(mute))
    return Wiggled(
        estimates=tuple(found), mechanism=mechanism, source=signals.source, notes=tuple(notes),
        logs={name: one.log for name, one in parts.items()}, servos=servos,
    )  # fmt: skip
