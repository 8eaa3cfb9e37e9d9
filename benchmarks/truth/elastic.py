"""Elastic arms with play, pushed and moved slowly: a separate static solver for `identify.py`.

Planar arms (in a vertical plane under gravity, or in a horizontal one) whose journals lie in their
bores, whose joints, gears, links and tool give way, and whose joints stick. Nothing here is
jointplay's: forces and moments come from equilibrium in the displaced position, found by repeated
substitution (an arm is statically determinate), each part gives way by its own law, and friction
is followed from record to record. `energy` is the potential that frictionless machines minimise:
tests compare both.

Laws: a journal touches its bore where the load pushes it, turned against its rotation by the angle
of friction, and sinks in by a F^0.9 (line contact); a joint twists by its moment; teeth do beyond
their play; a link bends as a cantilever; the structure at the tool gives way by a symmetric matrix.
A stuck joint holds until the static friction is exceeded, then slides until the dynamic one is in
equilibrium.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

HERTZ = 0.9
"""Exponent of the contact's sinking in."""


@dataclass(frozen=True)
class Joint:
    """A joint of an arm and the link that it carries; SI units."""

    length: float
    mass: float
    centre: float
    """Of the link's mass, from the joint [m]."""
    inertia: float = 0.0
    """Of the link about its mass centre [kg m^2]."""
    clearance: float = 0.0
    friction: float = 0.0
    """Coefficient of the journal."""
    radius: float = 0.01
    """Of the journal [m]."""
    sinks: float = 0.0
    """Depth of the contact at 100 N [m]."""
    radial: float = 0.0
    """Compliance of the bearing [m/N]."""
    torsional: float = 0.0
    """Compliance about the axis, of the gear if it has one [rad/(N m)]."""
    play: float = 0.0
    """Of the gear, whole [rad]."""
    dry: float = 0.0
    """Dynamic friction on the link's side [N m]."""
    sticks: float = 1.0
    """Static friction by the dynamic one."""
    bends: float = 0.0
    """Deflection of the link's end by a force there [m/N]."""


@dataclass(frozen=True)
class Arm:
    """A planar arm: in x and z under gravity (joints about +y), or in x and y (about +z)."""

    joints: tuple[Joint, ...]
    vertical: bool
    tool: np.ndarray = field(default_factory=lambda: np.zeros((2, 2)))
    """Compliance of the structure at the tool in its axes [m/N]."""

    @property
    def sense(self) -> float:
        """About +y, z turns to x."""
        return -1.0 if self.vertical else 1.0


def _turn(angle: np.ndarray, vectors: np.ndarray) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    x, y = vectors[..., 0], vectors[..., 1]
    return np.stack([c * x - s * y, s * x + c * y], axis=-1)


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])


@dataclass(frozen=True)
class Shape:
    """How an arm with j joints is deformed at n records."""

    journal: np.ndarray
    """Displacement in the plane, (n, j, 2) [m]."""
    twist: np.ndarray
    """Link less motor, in the plane's sense, (n, j) [rad]."""
    tip: np.ndarray
    """Deflection of each link's end across it, (n, j) [m]."""
    slope: np.ndarray
    """Rotation of each link's end, (n, j) [rad]."""
    tool: np.ndarray
    """Of the structure at the tool in its axes, (n, 2) [m]."""

    @classmethod
    def none(cls, n: int, j: int) -> Shape:
        return cls(np.zeros((n, j, 2)), *(np.zeros((n, j)) for _ in range(3)), np.zeros((n, 2)))


def places(
    arm: Arm, motor: np.ndarray, shape: Shape
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Joints' centres (n, j, 2), links' angles (n, j), masses' and ends' places (n, j, 2), tool."""
    n, j = motor.shape
    centres, angles = np.zeros((n, j, 2)), np.zeros((n, j))
    masses, ends = np.zeros((n, j, 2)), np.zeros((n, j, 2))
    at, angle = np.zeros((n, 2)), np.zeros(n)
    for k, joint in enumerate(arm.joints):
        at = at + shape.journal[:, k]
        angle = angle + arm.sense * motor[:, k] + shape.twist[:, k]
        centres[:, k], angles[:, k] = at, angle
        masses[:, k] = at + _turn(angle, np.array([joint.centre, 0.0]))
        own = np.stack([np.full(n, joint.length), shape.tip[:, k]], axis=1)
        at = at + _turn(angle, own)
        angle = angle + shape.slope[:, k]
        ends[:, k] = at
    return centres, angles, masses, ends, at + _turn(angle, shape.tool)


def statics(
    arm: Arm, motor: np.ndarray, force: np.ndarray, way: np.ndarray, time: np.ndarray
) -> tuple:
    """Tool (n, 2) [m] and link less motor (n, j) [rad], joint sense, along a slow motion.

    Inertia is that of the undeformed arm.

    Args:
        arm: the machine.
        time: of the records, (n,) [s].
        motor: positions, (n, j) [rad].
        force: on the tool, in the plane, (n, 2) [N].
        way: part of the angle of friction by which each journal is turned, with the sign of its
            rotation, (n, j): 1 while it moves, what is left of it at a stop.
    """
    shape = Shape.none(*motor.shape)
    weight = np.array([0.0, -9.81 if arm.vertical else 0.0])
    _, angles, masses, _, _ = places(arm, motor, shape)
    falls, spins = np.zeros_like(masses) + weight, np.zeros_like(angles)
    if len(time) > 2:
        falls -= np.gradient(np.gradient(masses, time, axis=0), time, axis=0)
        spins = np.gradient(np.gradient(angles, time, axis=0), time, axis=0)
    for _ in range(6):
        centres, angles, masses, ends, _ = places(arm, motor, shape)
        parts = [np.zeros_like(shape.journal), *(np.zeros_like(shape.twist) for _ in range(3))]
        for k, joint in enumerate(arm.joints):
            behind = list(enumerate(arm.joints))[k:]
            loads = [(one.mass * falls[:, i], masses[:, i]) for i, one in behind]
            loads.append((force, ends[:, -1]))
            turns = [-one.inertia * spins[:, i] for i, one in behind]
            push = sum(f for f, _ in loads)
            moment = sum(_cross(at - centres[:, k], f) for f, at in loads) + sum(turns)
            size = np.linalg.norm(push, axis=1)
            unit = push / np.maximum(size, 1e-300)[:, None]
            sense = arm.sense * way[:, k]
            lean = -np.arctan(joint.friction * sense)
            sunk = joint.sinks * (size / 100.0) ** HERTZ
            reach = joint.clearance + (sunk if joint.clearance else 0.0)
            parts[0][:, k] = _turn(lean, unit) * np.reshape(reach, (-1, 1)) + joint.radial * push
            drag = size * joint.radius * np.sin(np.arctan(joint.friction)) * sense
            parts[1][:, k] = _twist(joint, arm.sense * motor[:, k], moment - drag)
            axis = np.stack([np.cos(angles[:, k]), np.sin(angles[:, k])], axis=1)
            own = loads[-1:] + loads[1:-1]  # all but the link's own weight act at its end
            across = _cross(axis, sum(f for f, _ in own))
            bend = sum(_cross(at - ends[:, k], f) for f, at in own) + sum(turns[1:])
            parts[2][:, k] = joint.bends * (across + 1.5 * bend / joint.length)
            parts[3][:, k] = joint.bends * (1.5 * across + 3.0 * bend / joint.length) / joint.length
        last = angles[:, -1] + shape.slope[:, -1]
        shape = Shape(*parts, _turn(-last, force) @ arm.tool.T)
    return places(arm, motor, shape)[-1], arm.sense * shape.twist


def _twist(joint: Joint, motor: np.ndarray, moment: np.ndarray) -> np.ndarray:
    """Link less motor of a joint along a motion, (n,) [rad]."""
    half, give = 0.5 * joint.play, joint.torsional
    if not joint.dry:
        side = np.sign(moment)
        return np.asarray(side * half + give * moment)
    if not give:
        raise ValueError("a joint with dry friction must give way")
    dynamic, static = joint.dry, joint.dry * joint.sticks
    link, sliding = motor[0] + np.sign(moment[0]) * half + give * moment[0], 0.0
    twist = np.zeros(len(motor))
    for i in range(len(motor)):
        for _ in range(3):
            off = link - motor[i]
            spring = -np.sign(off) * max(abs(off) - half, 0.0) / give
            net = spring + moment[i]
            if abs(net) <= (dynamic if sliding == np.sign(net) else static):
                sliding = sliding if abs(net) > 0.98 * dynamic else 0.0
                break
            sliding = np.sign(net)
            rest = moment[i] - sliding * dynamic  # what the spring must carry
            link = motor[i] + np.sign(rest) * half + give * rest
        twist[i] = link - motor[i]
    return twist


def energy(arm: Arm, motor: np.ndarray, force: np.ndarray, x: np.ndarray) -> float:
    """Potential energy [J] of a frictionless arm at one record, x its deformation (6 j + 2).

    x has, joint by joint, the journal's displacement, the twist, the bending's tip and slope, and
    at last the structure's at the tool [m, rad]. A journal's contact is a spring beyond its
    clearance, in series with the bearing.
    """
    j = len(arm.joints)
    own, tool = x[: 5 * j].reshape(j, 5), x[5 * j :]
    shape = Shape(own[None, :, :2], own[None, :, 2], own[None, :, 3], own[None, :, 4], tool[None])
    _, _, masses, _, last = places(arm, motor[None], shape)
    total = -float(force @ last[0])
    for k, joint in enumerate(arm.joints):
        total += (9.81 if arm.vertical else 0.0) * joint.mass * float(masses[0, k, 1])
        beyond = max(float(np.linalg.norm(own[k, :2])) - joint.clearance, 0.0)
        total += 0.5 * beyond**2 / joint.radial
        total += 0.5 * max(abs(own[k, 2]) - 0.5 * joint.play, 0.0) ** 2 / joint.torsional
        bend = (
            joint.bends
            / joint.length**2
            * np.array([[joint.length**2, 1.5 * joint.length], [1.5 * joint.length, 3.0]])
        )
        total += 0.5 * float(own[k, 3:] @ np.linalg.solve(bend, own[k, 3:]))
    return total + 0.5 * float(tool @ np.linalg.solve(arm.tool, tool))
