"""Where each joint is to be wiggled, and the motion that does it.

A servo's own position tells play only where the torque on its teeth reverses: in a pose in which
gravity does not load the joint. Gravity's torque on a joint that turns is a cos q + b sin q in the
joint's own angle q, so that its two neutral angles are known from two values. Of poses with such
an angle that is taken in which the joint is loaded least over its wiggle. Joints are wiggled one
after the other by `wiggle.wiggle_goal`, the others stand; between them all move slowly.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from jointplay.accuracy.poses import middle, moving
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.tables import Table, few
from jointplay.base.units import readable
from jointplay.estimate.planning import free_poses
from jointplay.estimate.wiggle import HEAVY, Known, Untold, check_joint, wiggle_goal
from jointplay.model.collisions import SelfCollision
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import Drive, Servo
from jointplay.simulation.motion.cartesian import joint_limits

SWING = np.radians(8.0)
"""Room for a wiggle on both sides: its 3 deg, and the 5 deg within which a trip lets it hunt
[rad]."""
FLOOR = 0.02
"""Height above the base's plane below which joints and tool do not go, unless they are there with
all joints at zero, as where the arm hangs [m]."""
PERIOD_S = 1e-3
"""Of the loop of a servo of which nobody says it."""
RATE, _ON_WAY = 100.0, 20.0
"""Points of a wiggle, and of the way to it [1/s]."""
SPEED, REST_S = np.radians(15.0), 1.0
"""Of the way from one pose to the next, and how long all stand before and after a wiggle [rad/s,
s]."""
_WIGGLE = np.radians(3.0)
_FAINT, _LIGHT = 1.0, 0.1
"""Gravity's torque over a wiggle, by the motor's friction, that counts as none; and the link's
inertia, by the rotor's, below which a pose in which it is larger is preferred (with the encoder on
the motor half as much again as is needed)."""
_HOLDS = 10.0
"""Gravity's torque on another joint, by the motor's friction, from which on more is no better."""
_CHECKED = 24
"""Points of a way at which self-collision is looked for."""
RECORD = (
    "Record goal and position of every joint, 100 times a second or more, each with the time at "
    "which it was read (to 2 ms), and the servos' gains. Nothing may touch the arm."
)


def dial_note(joints: list[str]) -> str:
    """The other way to measure joints whose encoder is on the output."""
    return (
        f"note: the encoder of {few(joints)} turns with the output, and is a dial gauge, which "
        "tells more often than a wiggle: with the torque off, push softly to both sides, and give "
        "its angles to --plan dial's table"
    )


def known_of(mechanism: Mechanism, servo: Servo, joint: str, pose: Mapping[str, float]) -> Known:
    """What the robot's model says of a joint in a pose [rad or m by joint]; others at zero."""
    ideal = mechanism.ideal()
    at, q = ideal.coordinate(joint), ideal.configuration(pose)
    data = ideal.model.createData()
    inertia = float(pin.crba(ideal.model, data, q)[at, at])
    load = float(pin.computeGeneralizedGravity(ideal.model, data, q)[at])
    servo = replace(servo, period=servo.period or PERIOD_S)
    return Known(servo, mechanism.gears[joint].rotor_inertia, inertia, load)


@dataclass(frozen=True)
class Step:
    """The wiggle of one joint."""

    joint: str
    pose: Mapping[str, float]
    """Of all joints that move [rad or m]."""
    known: Known
    begin: float
    end: float
    """When it is wiggled [s]."""


@dataclass(frozen=True)
class WigglePlan:
    """A motion that wiggles joints one after the other."""

    joints: tuple[str, ...]
    time: np.ndarray
    """Shape (n,) [s]."""
    position: np.ndarray
    """Shape (n, joints) [rad or m]."""
    steps: tuple[Step, ...]
    refused: Mapping[str, str]
    """Why, by joint that is not wiggled."""
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        rows = [("joint", "gravity", "at [s]", "pose [deg]")]
        for one in self.steps:
            degrees = {name: round(np.degrees(x)) for name, x in one.pose.items()}
            angles = ", ".join(f"{name} {x}" for name, x in degrees.items() if x)
            load = "none" if abs(one.known.load) < 1e-3 else readable(abs(one.known.load), "N*m", 2)
            rows.append((one.joint, load, f"{one.begin:.1f} to {one.end:.1f}", angles or "zero"))
        left = [f"{name} is left out: {why}" for name, why in self.refused.items()]
        return "\n".join([*self.notes, str(Table.of_texts(rows)), *left, RECORD])


def plan_wiggle(
    mechanism: Mechanism, drives: Mapping[str, Drive], joints: Sequence[str] = ()
) -> WigglePlan:
    """Poses and a motion in which joints' own servos tell their play.

    Args:
        mechanism: the robot, with the gears of the joints.
        drives: by joint; those that are servos can be wiggled.
        joints: those to wiggle; none: all with a servo.

    Raises:
        MissingName: no such joint.
        JointplayError: nothing can be told of any of them, with the reasons; see `free_poses`.
    """
    names = moving(mechanism)
    for name in joints:
        if name not in names:
            raise MissingName("joint that moves", name, names)
    begin, (poses, notes) = middle(mechanism), free_poses(mechanism.ideal(), None, 0)
    able = [name for name in names if isinstance(drives.get(name), Servo)]
    at = [mechanism.ideal().coordinate(name) for name in able]
    spread = [begin | dict(zip(able, map(float, q), strict=True)) for q in poses[:, at]]
    spread.insert(0, begin)
    scene, refused, steps = _Scene(mechanism), dict[str, str](), list[Step]()
    motion = _Motion(names)
    for name in joints or able:
        servo = drives.get(name)
        if not isinstance(servo, Servo) or name not in mechanism.gears:
            refused[name] = "no servo with gains, motor and rotor is known of it"
            continue
        options = scene.neutral(name, servo, spread, motion.last or begin)
        free = (one for one in options if scene.reaches(motion.last, one[1]))
        known, pose = next(free, (None, begin))
        if known is None:
            refused[name] = "no pose within limits that the arm gets to without hitting itself"
            continue
        try:
            check_joint(known)
        except Untold as reason:
            refused[name] = str(reason)
        else:
            steps.append(Step(name, pose, known, *motion.wiggle(name, pose, servo.encoder)))
    if not steps:
        whom = "; ".join(f"{name}: {why}" for name, why in refused.items())
        raise JointplayError(f"a wiggle tells no joint's play: {whom or 'no joint has a servo'}")
    time, position = motion.points()
    servos = [(name, drives.get(name)) for name in joints or able]
    if on := [n for n, one in servos if isinstance(one, Servo) and one.encoder == "link"]:
        notes = [*notes, dial_note(on)]
    return WigglePlan(tuple(names), time, position, tuple(steps), refused, tuple(notes))


class _Scene:
    """Gravity on joints, their limits, and what is in the way."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism, self.ideal = mechanism, mechanism.ideal()
        self.names, self.shapes = moving(mechanism), SelfCollision(mechanism)
        self.low, self.high = joint_limits(mechanism, self.names)
        gravity = self.ideal.model.gravity.linear
        self.up = -gravity / max(float(np.linalg.norm(gravity)), 1e-9)
        self.floor = -np.inf
        if self.lowest(middle(mechanism)) > FLOOR:
            self.floor = FLOOR

    def lowest(self, pose: Mapping[str, float]) -> float:
        """Height of the lowest of what the second joint on carry, above the base [m]."""
        model, data = self.ideal.model, self.ideal.data
        pin.framesForwardKinematics(model, data, self.ideal.configuration(pose))
        places = [data.oMi[k].translation for k in range(2, model.njoints)]
        places.append(data.oMf[self.ideal.tool_frame].translation)
        return float((np.array(places) @ self.up).min())

    def blocked(self, pose: Mapping[str, float]) -> bool:
        """Whether the robot hits itself, or the table that its base stands on."""
        return self.lowest(pose) < self.floor or self.shapes.hits(pose)

    def gravity(self, joint: str, pose: Mapping[str, float]) -> float:
        q = self.ideal.configuration(pose)
        every = pin.computeGeneralizedGravity(self.ideal.model, self.ideal.data, q)
        return float(every[self.ideal.coordinate(joint)])

    def neutral(
        self, joint: str, servo: Servo, poses: Sequence[dict[str, float]], near: Mapping[str, float]
    ) -> list[tuple[Known, dict[str, float]]]:
        """Poses with room for a wiggle: those of little gravity first, then those that give the
        link inertia, in which gravity holds the other joints in their play, and near a pose."""
        least = _FAINT * servo.friction
        enough = 1.5 * HEAVY if servo.encoder == "motor" else _LIGHT
        others = [name for name in self.mechanism.gears if name != joint]

        def rank(one: tuple[Known, dict[str, float]]) -> tuple[float, ...]:
            known, pose = one
            sides = ({**pose, joint: pose[joint] + side * _WIGGLE} for side in (-1.0, 1.0))
            most = max(abs(self.gravity(joint, side)) for side in sides)
            heavy = min(known.link_inertia / (enough * known.rotor_inertia), 1.0)
            far = max(abs(pose[name] - near[name]) for name in self.names)
            held = (min(abs(self.gravity(name, pose)), _HOLDS * servo.friction) for name in others)
            return (
                max(abs(known.load), 0.05 * least),
                max(most, least),
                -round(3.0 * heavy),
                -sum(held),
                far,
            )

        found = self._options(joint, poses, 0.05 * least)
        return sorted(((known_of(self.mechanism, servo, joint, q), q) for q in found), key=rank)

    def _options(
        self, joint: str, poses: Sequence[dict[str, float]], least: float
    ) -> Iterator[dict[str, float]]:
        """Poses with another angle of one joint, neutral if its limits allow, and room there."""
        k = self.names.index(joint)
        low, high = self.low[k] + SWING, self.high[k] - SWING
        if self.mechanism.description.joints[joint].slides or low > high:
            return
        for pose in poses:
            a, b = (self.gravity(joint, {**pose, joint: q}) for q in (0.0, np.pi / 2.0))
            angles = [pose[joint]]
            if np.hypot(a, b) > least:
                first = float(np.arctan2(-a, b))
                angles = [first + turn * np.pi for turn in range(-3, 4)]
                angles = [q for q in angles if low <= q <= high] or [low, high]
            for angle in map(float, np.clip(angles, low, high)):
                room = ({**pose, joint: angle + side * SWING} for side in (-1.0, 0.0, 1.0))
                if not any(map(self.blocked, room)):
                    yield {**pose, joint: angle}

    def reaches(self, begin: Mapping[str, float] | None, end: Mapping[str, float]) -> bool:
        """Whether the straight way in the joints' angles hits nothing."""
        if begin is None:
            return True
        parts = np.linspace(0.0, 1.0, _CHECKED)
        between = ({n: begin[n] + x * (end[n] - begin[n]) for n in self.names} for x in parts)
        return not any(map(self.blocked, between))


class _Motion:
    """Points of a motion, one part after the other."""

    def __init__(self, names: Sequence[str]) -> None:
        self.names = list(names)
        self.last: dict[str, float] | None = None
        self._parts: list[tuple[np.ndarray, np.ndarray]] = []
        self._now = 0.0

    def _add(self, time: np.ndarray, position: np.ndarray) -> None:
        """A part whose times begin at zero, where the one before ends."""
        new = slice(1 if self._parts else 0, None)
        self._parts.append((self._now + time[new], position[new]))
        self._now += float(time[-1])

    def wiggle(self, joint: str, pose: dict[str, float], encoder: str) -> tuple[float, float]:
        """Go to a pose, stand, wiggle a joint about it, stand; when the wiggle begins and ends."""
        end = np.array([pose[name] for name in self.names])
        if self.last is not None:
            begin = np.array([self.last[name] for name in self.names])
            long = 1.5 * float(np.abs(end - begin).max()) / SPEED
            if long > 0.0:
                part = np.linspace(0.0, 1.0, int(np.ceil(long * _ON_WAY)) + 1)
                way = (3.0 * part**2 - 2.0 * part**3)[:, None]
                self._add(long * part, begin + way * (end - begin))
        rest = np.array([0.0, REST_S]), np.tile(end, (2, 1))
        self._add(*rest)
        first = self._now
        corners, goal = wiggle_goal(encoder)
        time = np.union1d(np.arange(0.0, corners[-1], 1.0 / RATE).round(6), corners.round(6))
        moved = np.tile(end, (len(time), 1))
        moved[:, self.names.index(joint)] += np.interp(time, corners, goal)
        self._add(time, moved)
        last = self._now
        self._add(*rest)
        self.last = pose
        return first, last

    def points(self) -> tuple[np.ndarray, np.ndarray]:
        time, position = (np.concatenate(one) for one in zip(*self._parts, strict=True))
        return time.round(6), position.round(6)
