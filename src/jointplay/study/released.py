"""Machines for release tests: each joint under a servo alone, all others held at the pose.

A joint under a servo is reduced to a motor, its gear, the link's inertia as Pinocchio has it at the
pose, the torque of gravity, and friction. Joints under controllers of the user's own move together,
in the whole robot.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NoReturn
from xml.sax.saxutils import quoteattr

import pinocchio as pin

from jointplay.base.errors import JointplayError, require_a, require_known
from jointplay.model import urdf
from jointplay.model.gear import Gearing
from jointplay.model.impact import tooth_duration
from jointplay.model.mechanism import Mechanism, loaded
from jointplay.physics.kernel import WELL_RESOLVED_STEPS
from jointplay.simulation.loads import Controller, Free, JointFriction, Prescribed, Servo, Wrench
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.prepare import joint_friction
from jointplay.simulation.simulation import Simulation

STEP_S, RECORD_S = 2e-4, 1e-3
"""Longest step, which teeth or sampling shorten, and interval of records [s] (judged: ten records
in a period of 100 Hz)."""

UNITS = {"p_gain": "V/rad", "i_gain": "V/(rad*s)", "d_gain": "V*s/rad"}
"""Units of a servo's gains."""


@dataclass(frozen=True)
class Axis:
    """One joint of a robot at a pose, all others held; its position counts from the pose.

    Quantities of rotation stand for those of translation of a prismatic joint.
    """

    joint: str
    slides: bool
    inertia: float
    """Inertia that the joint moves, without the motor's [kg m^2]."""
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
        """Gains of the servo, by name."""
        return {name: getattr(self.drive, name) for name in UNITS}

    def with_gains(self, **gains: float) -> Axis:
        """The axis with other gains of its servo."""
        drive: Any = self.drive
        return replace(self, drive=replace(drive, **gains))

    def simulation(self, duration: float) -> Simulation:
        """Simulation of the servo holding the joint at zero for `duration` [s]."""
        # A robot of this one joint, without gravity: the weight is a load.
        j, kind = repr(self.inertia), "prismatic" if self.slides else "continuous"
        inertia = f'<inertia ixx="{j}" iyy="{j}" izz="{j}" ixy="0" ixz="0" iyz="0"/>'
        limit = '<limit effort="0" velocity="0"/>' if self.slides else ""
        text = (
            '<robot name="axis"><link name="base"/><link name="link"><inertial>'
            f'<mass value="{j}"/>{inertia}</inertial></link>'
            f"<joint name={quoteattr(self.joint)} type={quoteattr(kind)}>"
            f'<parent link="base"/><child link="link"/><axis xyz="0 0 1"/>{limit}</joint></robot>'
        )
        mechanism = Mechanism(
            urdf.parse(text, Path("-")), gears={self.joint: self.gear}, gravity=(0.0, 0.0, 0.0)
        )
        assert isinstance(self.drive, Servo)
        vector = (0.0, 0.0, self.load)
        push = Wrench("link", force=vector) if self.slides else Wrench("link", moment=vector)
        return Simulation(
            mechanism,
            Motion([self.joint], [0.0, 1e-2], [[0.0], [0.0]]),
            drive=self.drive,
            joint_friction={self.joint: self.friction},
            loads={} if self.load == 0.0 else {"gravity": push},
            **_at_rest(mechanism, [self.drive], duration),
        )


@dataclass(frozen=True)
class MultiAxis:
    """Joints under controllers of the user's own, moving together in the whole robot."""

    axes: tuple[Axis, ...]
    """The joints that are looked at."""
    base: Simulation
    """The robot, its other joints held."""

    @property
    def gains(self) -> dict[str, float]:
        """Parameters of the controllers by name; with several controllers ``LOAD.NAME``."""
        controllers = _controllers(self.base)
        return {
            gain if len(controllers) == 1 else f"{load}.{gain}": value
            for load, c in controllers.items()
            for gain, value in zip(c.names, c.parameters, strict=True)
        }

    def with_gains(self, **gains: float) -> MultiAxis:
        """The joints with other parameters of their controllers."""
        values, loads = iter((self.gains | gains).values()), dict(self.base.loads)
        for name, controller in _controllers(self.base).items():
            parameters = tuple(next(values) for _ in controller.parameters)
            loads[name] = replace(controller, parameters=parameters)
        return replace(self, base=replace(self.base, loads=loads))

    def simulation(self, duration: float) -> Simulation:
        """Simulation of the robot at the pose, under its controllers, for `duration` [s]."""
        drives = self.base.drive.values()  # type: ignore[union-attr]
        sampled = [*_controllers(self.base).values(), *drives]
        return replace(self.base, **_at_rest(self.base.mechanism, sampled, duration))


Released = Axis | MultiAxis
"""A group of joints that is released beside its goal."""


def _at_rest(mechanism: Mechanism, sampled: Sequence[Any], duration: float) -> dict[str, Any]:
    """Settings of a run of `duration` [s] whose step resolves contacts of the gears' teeth and
    divides the shortest sampling period of the drives.
    """
    q = mechanism.configuration({})
    step = min(tooth_duration(mechanism, name, q) for name in mechanism.gears) / WELL_RESOLVED_STEPS
    step = min(STEP_S, float(f"{step:.1e}"))
    periods = [period for d in sampled if (period := getattr(d, "period", None)) is not None]
    if periods:
        step = min(periods) / math.ceil(min(periods) / step - 1e-9)
    interval = max(round(RECORD_S / step), 1)
    options = {"start": "centred", "limits": "ignore"}
    return {"duration": duration, "step": step, "record_every": interval, **options}


def _controllers(simulation: Simulation) -> dict[str, Controller]:
    """Controllers of the user's own, by the name of the load."""
    return {name: load for name, load in simulation.loads.items() if isinstance(load, Controller)}


def _drives(simulation: Simulation) -> dict[str, Servo | Controller]:
    """Drive of each joint that has one: a controller of the user's own, or else a servo."""
    drive, joints = simulation.drive, simulation.mechanism.joints
    drives = drive if isinstance(drive, Mapping) else dict.fromkeys(joints, drive)
    controlled = {name: c for c in _controllers(simulation).values() for name in c.joints}
    return {name: d for name, d in drives.items() if isinstance(d, Servo)} | controlled


def servo_of(joint: str) -> str:
    """Command-line option that gives a joint a servo, with all entries that a servo needs."""
    table = 'kind="servo", voltage="12 V", p_gain="20 V/rad"'
    table += ', torque_constant="1.2 N*m/A", resistance="2.7 ohm"'
    return f"--set 'drives.{joint}={{{table}}}' with its numbers"


def refuse_without_servo(joint: str | None, drives: Iterable[object], robot: str) -> NoReturn:
    """Raise an error that says what a robot without servos lacks to hunt, and how to give it.

    Args:
        joint: a joint with a gear; None: no joint has one.
        drives: drives of the robot's preset.
        robot: its name.
    """
    name = joint or "JOINT"
    add = servo_of(name) if joint else f"--gear {name}=PLAY and {servo_of(name)}"
    if any(isinstance(drive, Servo) for drive in drives):
        add = f"--preset, which has the servos of {robot}"
    raise JointplayError(f"hunting needs a gear with play under a servo, none is given: add {add}")


def released(
    simulation: Simulation, joints: Sequence[str] = (), pose: Mapping[str, float] | None = None
) -> list[Released]:
    """Groups of a simulation's joints to release: each under a servo alone, those under the user's
    own controllers together.

    Args:
        simulation: a robot with its gears, drives, friction, payloads held from the start, and
            controllers among its loads.
        joints: joints with play in their gear, and a servo or a controller; none: all of these.
        pose: positions of joints [rad or m]; others are where the motion begins, or at zero.

    Raises:
        JointplayError: what is missing, and what to give.
    """
    require_a("simulation", simulation, "Simulation")
    robot, drives = simulation.mechanism, _drives(simulation)
    loose = [name for name, gear in robot.gears.items() if gear.play > 0.0]
    for name in (*joints, *(pose or {})):
        require_known("moving joint", name, robot.joints)
    # Where no joint can be released, the error is about the first with play, or else the first.
    driven = [name for name in loose if name in drives]
    for name in joints or driven or [*loose, *robot.joints][:1]:
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
    start = {} if motion is None else dict(zip(motion.joints, motion.positions[0], strict=True))
    entries = robot.description.joints
    positions = (
        {name: entries[name].neutral for name in robot.joints if name in entries}
        | start
        | dict(pose or {})
    )
    axes = [_axis(simulation, name, positions) for name in dict.fromkeys(joints or driven)]
    single: list[Released] = [axis for axis in axes if isinstance(axis.drive, Servo)]
    controlled = tuple(axis for axis in axes if isinstance(axis.drive, Controller))
    multi = [MultiAxis(controlled, _with_others_held(simulation, positions))] if controlled else []
    return [*single, *multi]


def _axis(simulation: Simulation, joint: str, positions: Mapping[str, float]) -> Axis:
    """A joint at a pose, with the inertia and the gravity torque that it has there."""
    robot = simulation.mechanism
    rigid = robot.with_clearance({}, robot.gears)
    bodies = loaded(rigid.model, simulation.payloads, 0.0)
    q, k, data = rigid.configuration(positions), rigid.coordinate(joint), bodies.createData()
    inertia = float(pin.crba(bodies, data, q)[k, k])
    load = 0.0 - float(pin.computeGeneralizedGravity(bodies, data, q)[k])
    friction = joint_friction(simulation).get(joint, JointFriction())
    slides, drive = robot.description.joints[joint].slides, _drives(simulation)[joint]
    return Axis(joint, slides, inertia, load, robot.gears[joint], drive, friction)


def _with_others_held(simulation: Simulation, pose: Mapping[str, float]) -> Simulation:
    """The robot at a pose, with all joints held that are under no controller of the user's own."""
    robot, drive = simulation.mechanism, simulation.drive
    free = {name for c in _controllers(simulation).values() for name in c.joints}
    servos = drive if isinstance(drive, Mapping) else dict.fromkeys(free, drive)
    drives = {name: servos.get(name, Free()) if name in free else Prescribed() for name in pose}
    locked = [name for name, d in drives.items() if d.follows]
    q = [pose[name] for name in locked]
    gears = {name: gear for name, gear in robot.gears.items() if name in free}
    payloads = (replace(p, release=None) for p in simulation.payloads if p.pick == 0.0)
    return Simulation(
        robot.with_clearance({}, gears),
        Motion(locked, [0.0, 1e-2], [q, q]) if locked else None,
        drive=drives,
        joint_friction=joint_friction(simulation),
        payloads=tuple(payloads),
        loads=simulation.loads,
        state={name: pose[name] for name in pose if name not in locked},
    )
