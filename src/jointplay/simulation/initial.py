"""The state in which a run begins: given positions and speeds, perturbation, start at rest.

`initial_state` takes what the motion and the user give, closes the loops and centres journals;
`InitialState.perturb` displaces them at random, `InitialState.move` finds velocities that fit, and
`find_rest` the static equilibrium (`statics`) from there.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, JointplayWarning, MissingName, require_finite
from jointplay.model import loop
from jointplay.model.frames import WORLD_FRAME
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import VIRTUAL_LINK, Coordinate
from jointplay.simulation import statics
from jointplay.simulation.loads.drive import ComputedTorque, Drive, assign
from jointplay.simulation.loads.gear_pair import GearPair
from jointplay.simulation.motion.ideal import IdealMotion

if TYPE_CHECKING:
    from jointplay.simulation.run import Run
    from jointplay.simulation.simulation import Simulation

PERTURBATION = 0.5
"""Largest displacement of a perturbed journal at the start, relative to its clearances.

Nobody knows where in its bearing a journal rests when the motion begins. Much smaller
displacements are often forgotten: a journal wedged by the first stroke starts afresh.
"""
_NOTICEABLE = 0.1
"""Speed of a journal in its bearing, relative to how pins move, above which a start is warned of:
judged; start speeds of two digits leave up to 0.05."""
_AHEAD_S = 1e-6
"""Time over which speeds are differentiated to the accelerations of loops [s]."""


def position_and_speed(name: str, value: Any) -> tuple[float | None, float | None]:
    """Position and speed given for a coordinate, checked; None where one is left open."""
    pair = list(value) if isinstance(value, list | tuple) else [value, None]
    if len(pair) != 2:
        raise JointplayError(
            f"state of {name!r} must be a position or a pair of position and speed, got {value!r}"
        )
    quantities = ("start of joint", "rad or m"), ("speed at the start of joint", "rad/s or m/s")
    position, speed = (
        None if number is None else require_finite(f"{quantity} {name!r}", number, unit)
        for number, (quantity, unit) in zip(pair, quantities, strict=True)
    )
    return position, speed


@dataclass
class InitialState:
    """The initial state, and which of its coordinates were given.

    Attributes:
        motion_speed: velocities as given, 0 elsewhere, (nv,).
        motion_acceleration: accelerations of the reference, 0 elsewhere, (nv,).
        q, v: positions and velocities, shapes (nq,) and (nv,).
        placed: coordinates of journals whose positions were given.
        held: all coordinates whose positions were given, but for those of the motion.
        led: coordinates that follow the motion.
        moving: coordinates whose speeds were given, by the motion too.
    """

    mechanism: Mechanism
    motion_speed: np.ndarray
    motion_acceleration: np.ndarray
    q: np.ndarray
    v: np.ndarray
    placed: list[int]
    held: list[int]
    led: list[int]
    moving: list[int]

    def perturb(self, seed: int, at_rest: bool, behind: Container[str]) -> None:
        """Displace each journal by a random vector of up to `PERTURBATION` times its clearances.

        The vector is from the centre. A journal `at_rest` goes the part `PERTURBATION` of the way
        from where it lies to there, and straightens by that part: between two places where it fits
        it fits as well, leaning included. Teeth of gears stand anywhere in their play, where
        friction may have left them: the joint is moved, or the motor where loops or an encoder
        `behind` the gear determine the joint.
        """
        mechanism = self.mechanism
        random = np.random.default_rng(seed)
        offsets: dict[str, np.ndarray] = {}
        pin.forwardKinematics(mechanism.model, mechanism.data, self.q)  # for `journal_pose`
        for name, joint in mechanism.clearance.items():
            push = PERTURBATION * random.uniform(-1.0, 1.0, 3)
            travels = np.array([joint.start_travels.get(part, 0.0) for part in VIRTUAL_LINK[:3]])
            if name in mechanism.loops:  # no coordinates of its own: an offset of the loop
                lies = mechanism.journal_pose(name).translation.copy() if at_rest else np.zeros(3)
                free = mechanism.relative_jacobian(name, self.q)[:3].any(axis=1)
                away = PERTURBATION * (push * travels - lies) if at_rest else push * travels
                offsets[name] = (lies + away) * free
                continue
            for part, target in zip(VIRTUAL_LINK[:3], push * travels, strict=True):
                if part in joint.freedoms:
                    i = mechanism.coordinates.index(Coordinate(name, part))
                    shift = target - self.q[i] if at_rest and i not in self.placed else target
                    if joint.start_travels.get(part, 0.0) > 0.0:
                        self.q[i] += PERTURBATION * shift if at_rest else shift
            if at_rest:
                for part in set(statics.limited_freedoms(joint)).intersection(VIRTUAL_LINK[3:]):
                    i = mechanism.coordinates.index(Coordinate(name, part))
                    self.q[i] -= PERTURBATION * self.q[i] if i not in self.placed else 0.0
        self.q = loop.assemble(mechanism, self.q, self.led, offsets)
        for name, gear in mechanism.gears.items():
            motor, link = mechanism.motor(name), mechanism.coordinate(name)
            twist = 0.5 * gear.play * random.uniform(-1.0, 1.0)
            if gear.play > 0.0:
                aside = twist - gear.twist(self.q[motor], self.q[link])
                turned = motor if mechanism.loops or name in behind else link
                self.q[turned] += aside if turned == link else -aside

    def move(self) -> None:
        """Find velocities with which loops stay closed, the given ones kept."""
        self.v = loop.consistent_velocity(
            self.mechanism, self.q, self.motion_speed, self.moving, self.led
        )

    def check_journals(self) -> None:
        """Refuse journals outside their bearings, and warn of those that loops set flying in them.

        A journal flies where speeds given for several joints do not fit together: it moves across
        its bearing at a speed that counts beside those at which pins turn, slide and are carried.
        """
        mechanism = self.mechanism
        left = left_bearing(mechanism, self.q)
        if left is not None:
            raise JointplayError(
                f"the journal of {left!r} begins outside its bearing, whose ends are open; start "
                "nearer to its middle, or make bearing or journal longer",
                where=("joints", left),
            )
        # `fastest`: speeds of pins as they turn in their bearings, are carried, and slide along.
        flying, fastest = {}, loop.NO_SPEED * float(np.abs(self.v).max(initial=0.0))
        for name, joint in mechanism.clearance.items() if mechanism.loops else ():
            bearing = mechanism.frames(name)[0]
            moved = mechanism.motion(mechanism.closing_frames(name), self.q) @ self.v
            turning = joint.arm(mechanism.journal_pose(name).translation) * moved[3:]
            carried = mechanism.motion((WORLD_FRAME, bearing), self.q)[:3] @ self.v
            along = moved[[row for row in range(3) if row not in joint.held()]]
            pins = (float(np.linalg.norm(velocity)) for velocity in (turning, carried, along))
            fastest = max(fastest, *pins)
            if not any(mechanism.coordinates[i].joint == name for i in self.moving):
                across = [row for row in joint.held() if row < 3]
                flying[name] = float(np.linalg.norm(moved[across]))
        for name, speed in flying.items():
            if speed > _NOTICEABLE * fastest:
                joints = {mechanism.coordinates[i].joint for i in self.moving}
                warnings.warn(
                    f"the journal of {name!r} starts at {speed:.3g} m/s in its bearing, while pins "
                    f"move at up to {fastest:.3g} m/s: the speeds given for "
                    f"{', '.join(sorted(joints))} do not fit together, and figures begin with that "
                    "impact",
                    JointplayWarning,
                    stacklevel=5,
                )

    def acceleration(self) -> np.ndarray:
        """Acceleration with which loops stay closed, journals at rest in their bearings, (nv,)."""
        along = self.motion_acceleration
        if not self.mechanism.loops or not (self.v.any() or along.any()):
            return along
        later = self.motion_speed + _AHEAD_S * along
        v = loop.consistent_velocity(
            self.mechanism, self.q + _AHEAD_S * self.v, later, self.moving, self.led
        )
        return (v - self.v) / _AHEAD_S


def left_bearing(mechanism: Mechanism, q: np.ndarray) -> str | None:
    """The first joint whose journal is outside its open-ended bearing; None if all are inside."""
    ends = {n: joint.engaged_within for n, joint in mechanism.clearance.items()}
    ends = {name: end for name, end in ends.items() if math.isfinite(end)}
    if not ends:
        return None
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    away = {name: abs(mechanism.journal_pose(name).translation[2]) for name in ends}
    return next((name for name in ends if not away[name] < ends[name]), None)


def named(mechanism: Mechanism, name: str) -> list[int]:
    """Coordinates that a name stands for: a joint's own and its motor's, or a single one."""
    if name in mechanism.joints:
        return [mechanism.coordinate(name), mechanism.motor(name)]
    if name in mechanism.coordinates:
        return [mechanism.coordinates.index(name)]
    parts = [c for c in mechanism.coordinates if c.part]
    raise MissingName("moving joint or coordinate", name, [*mechanism.joints, *parts])


def initial_state(simulation: Simulation, followed: Sequence[str]) -> InitialState:
    """The state with loops closed, and journals centred or where they were given.

    Raises:
        JointplayError: a position or speed of what does not exist or follows the motion, or that
            does not fit.
    """
    mechanism = simulation.mechanism
    q = np.zeros(mechanism.model.nq)
    v, a = np.zeros((2, mechanism.model.nv))
    held: list[int] = []
    moving: list[int] = []
    placed: list[int] = []
    for name, value in simulation.state.items():
        position, speed = position_and_speed(name, value)
        at = named(mechanism, name)
        for joint in followed:
            if set(named(mechanism, joint)) & set(at):
                raise JointplayError(
                    f"joint {joint!r} follows the motion from its start; give no other"
                )
        if position is not None:
            q[at] = position
            held += at
            placed += [i for i in at if mechanism.plays(i) and name not in mechanism.joints]
        if speed is not None:
            v[at] = speed
            moving += at
    led: list[int] = []
    if simulation.motion is not None:
        reference = simulation.motion(np.zeros(1))
        for name in followed:
            index = simulation.motion.joints.index(name)
            at = named(mechanism, name)
            q[at], v[at], a[at] = (values[0, index] for values in reference)
            led += at
    held += _mesh(simulation, q, held + led, positions=True)
    moving += _mesh(simulation, v, moving + led, positions=False)
    guessed = [i for i in held if i not in placed]
    q = loop.assemble(mechanism, q, held + led, guessed=guessed)
    return InitialState(mechanism, v, a, q, v, placed, held, led, moving + led)


def _mesh(
    simulation: Simulation, values: np.ndarray, known: Sequence[int], positions: bool
) -> list[int]:
    """Bring gears that mesh to where the known ones put them; returns the coordinates brought.

    A pair of which neither is known goes by its leader. `values` are changed: `positions` (nq,), or
    velocities (nv,).
    """
    mechanism, brought = simulation.mechanism, list[int]()
    pairs = [load for load in simulation.loads.values() if isinstance(load, GearPair)]
    meshes = [(load.joint, load.follows(mechanism)) for load in pairs]
    while meshes:  # a train of gears from its known end, or from its first pair
        settled = {*known, *brought}

        def is_known(name: str, settled: set[int] = settled) -> bool:
            return mechanism.coordinate(name) in settled

        near = (k for k, (name, to) in enumerate(meshes) if is_known(name) or is_known(to.leader))
        joint, mimic = meshes.pop(next(near, 0))
        if is_known(joint) and is_known(mimic.leader):
            continue
        offset = mimic.offset if positions else 0.0
        backwards = is_known(joint)
        at = named(mechanism, mimic.leader if backwards else joint)
        other = values[mechanism.coordinate(joint if backwards else mimic.leader)]
        if backwards:
            values[at] = (other - offset) / mimic.multiplier
        else:
            values[at] = mimic.multiplier * other + offset
        brought += at
    return brought


def settled_drives(simulation: Simulation) -> dict[str, Drive]:
    """The drive of every moving joint, those through teeth with the bandwidth that these allow."""
    mechanism, motion = simulation.mechanism, simulation.motion
    drives = assign(mechanism, motion, simulation.drive)
    through = [
        name
        for name, drive in drives.items()
        if name in mechanism.gears and isinstance(drive, ComputedTorque) and drive.encoder == "link"
    ]
    if motion is None or not through:
        return drives
    followed = [name for name, drive in drives.items() if drive.follows]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # the run says it
        start = initial_state(simulation, followed).q
    inertia = IdealMotion(mechanism, motion, followed, 0.0, start).inertia
    for name in through:
        drive, gear = drives[name], mechanism.gears[name]
        assert isinstance(drive, ComputedTorque)
        drives[name] = drive.through_teeth(inertia[followed.index(name)], gear)
    return drives


def behind_gears(drives: Mapping[str, Drive]) -> set[str]:
    """Joints whose encoder sits on the joint itself, behind its gear if it has one."""
    return {name for name, drive in drives.items() if getattr(drive, "encoder", None) == "link"}


def find_rest(
    run: Run,
    start: InitialState,
    drives: Mapping[str, Drive],
    loads: statics.StaticLoads,
    places: Mapping[str, np.ndarray],
) -> statics.Rest:
    """Find the static equilibrium of a run's start; `places`: see `StaticEquilibrium.settle`."""
    workspace, bodies = run.workspace, run.phases[-1].model
    mechanism = start.mechanism
    fixed = list(start.placed)
    gaps = loop.misfit(mechanism, start.q) if mechanism.loops else {}
    if any(np.abs(gap).max() > loop.ASSEMBLY_TOLERANCE_M for gap in gaps.values()):
        fixed += start.held  # given positions that put journals aside: these shall stay there
    balance = statics.StaticEquilibrium(
        mechanism, bodies, workspace.q, workspace.v, drives, workspace.drives, workspace.servos,
        workspace.reference[0], run.friction, loads, start.acceleration(), fixed,
    )  # fmt: skip
    return balance.settle(places=places)


HELD = 0.05
"""Stiffness, relative to the largest, above which contacts hold a journal in a direction: judged.
"""
HELD_ASIDE_M = 1e-9
"""Largest displacement of a journal into contacts that hold it [m]."""


def displace_journals(mechanism: Mechanism, q: np.ndarray, distance: Sequence[float]) -> None:
    """Move every journal aside by `distance` along x, y and z of its bearing [m].

    In directions in which contacts hold it, it moves by no more than `HELD_ASIDE_M`: pressed
    further into them, a machine at rest would ring, which is another start rather than the same one
    a little aside.
    """
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    aside = {}
    for name, joint in mechanism.clearance.items():
        frames = mechanism.frames(name)
        pose = statics.relative_pose(mechanism.data, frames)
        stiff = statics.ElasticJoint(joint).stiffness(pose)[:3, :3]
        stiffness, directions = np.linalg.eigh(0.5 * (stiff + stiff.T))
        parts = directions.T @ np.asarray(distance)
        held = stiffness > HELD * max(stiffness[-1], 0.0)
        parts[held] = np.clip(parts[held], -HELD_ASIDE_M, HELD_ASIDE_M)
        aside[name] = directions @ parts
    for name, joint in mechanism.clearance.items():
        if mechanism.has_virtual_link(name):
            for part, away in zip(VIRTUAL_LINK[:3], aside[name], strict=True):
                if part in joint.freedoms:
                    q[mechanism.coordinates.index(Coordinate(name, part))] += away
        else:
            moves = mechanism.relative_jacobian(name, q)[:3]
            ideal = set(mechanism.loops) - set(mechanism.clearance)
            strict = loop.closing_rows(mechanism, q, ideal)
            offsets = np.concatenate([aside[name], np.zeros(len(strict))])
            q += np.linalg.pinv(np.concatenate([moves, strict])) @ offsets
