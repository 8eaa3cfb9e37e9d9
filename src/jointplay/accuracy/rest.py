"""Where a machine with play can rest: at one place without friction, in a whole set with it.

Without friction a journal slides to the least potential energy. To first order that is the point
at which the support function of its play is attained (`joints.play`). But where the first order
leaves a tilt nearly open, the second decides: an axial torque does work through the product of two
tilts (docs/static_play.md), and so do the weights of all bodies that tilt with the joint. So
`RestPositions.at` asks `simulation.statics`, as a run with start="rest" does.

With Coulomb friction a journal rests wherever its contacts, each pushing within its friction cone,
can balance its load. Friction forces that are given fractions of the normal forces can be added to
the load: the journal then rests where it would without friction under that sum. All such states,
with the fractions going around the cone's edge, bound the set (`_held_states`):

1. draw fractions of friction for each contact, and a first position of each journal;
2. alternate the loads (which change with all displacements), the frictionless positions under load
   and friction, and the normal forces there, until they agree;
3. keep the states whose contacts can balance the actual load within their cones;
4. add the deflection of the contacts, and map the displacements to the tool.

Each round cone is replaced by a polygon around it, so what is found is on the safe side. Sets of
several joints add up: the tool's interval along a direction is the sum of theirs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.accuracy import loop_play
from jointplay.accuracy.error_model import ErrorModel, half_sphere
from jointplay.accuracy.jacobians import (
    GEAR,
    displaced_configuration,
    jacobians,
    static_loads,
    tool_place,
)
from jointplay.model.closed_loops import ClosedLoops
from jointplay.model.frames import pose_between
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import RELATIVE, Clearance
from jointplay.physics.joints.bearings import RollingBearing
from jointplay.physics.joints.play import Play, Pressed
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import Drive, JointFriction, Servo, assign
from jointplay.simulation.loads.drive_tables import tabulate
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.statics import StaticEquilibrium, depths, weight_curvature

AGREES_M = 1e-6
"""Largest distance between the tool of `RestPositions` and that of a run that begins at rest,
start="rest" [m]."""
STATES = 1296
"""Friction states tried for each joint, half of them random."""
_INSTANT_S = 1e-3
"""Duration of the motion at standstill from which drives get their gains and torques [s]."""
_STIFFER_BY_I_TERM = 1e3
"""Factor on the stiffness of a servo with an I term, which in the end is infinitely stiff: its sag
becomes a thousandth, less than gears and contacts give way (judged)."""
_ANGLES = np.arange(12) * np.pi / 6.0
_CORNERS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)]) / np.cos(np.pi / 12.0)
"""Corners of the polygon around a round friction cone, at most 3.5 % wider; with 16 corners
`STATES` states miss some ends of the set."""
_UNBALANCED, _UNBALANCED_DRY = 0.01, 1e-5
"""Part of a load that a state of rest may leave unbalanced, as states are not found exactly: per
coefficient of friction, and without friction. The first widens the cones by a percent, less than
their polygons do (judged)."""
_ROUNDS, _DAMPED = 10, 5
"""Rounds that alternate between friction and normal forces, each of which shrinks the error by the
coefficient of friction; and the round from which loads are averaged with the last ones, so that
they do not oscillate (judged)."""
_SETTLED = 1e-7
"""Relative change of a load that moves nothing: below `_LOAD_NOISE`."""
_UNPRESSED = 1e-9
"""Load of a joint, relative to the machine's weight and the largest load, that is rounding: sums of
many forces, each known to 1e-16 of the largest."""
_LOAD_NOISE = 1e-6
"""Random part added to a load, so that all ends of a freedom that it leaves open are found: far
above rounding, far below what moves a journal that the load holds (judged)."""
_DIRECTIONS = half_sphere(180, full=True)
"""Directions along which the farthest tool is sought, (180, 3)."""
_STEP = 1e-6
"""Displacement of difference quotients [m or rad]: the second order of a position, 1e-12, and its
rounding, 1e-16, are both small beside it."""


class RestPlace(NamedTuple):
    """Where a machine rests without friction; NaN where no equilibrium is found."""

    parts: np.ndarray
    """The tool's error by source of play, shape (j, 6) [m, rad]; NaN where loops tie plays to each
    other, since none moves the tool alone."""
    error: np.ndarray
    """The tool's whole error by the exact kinematics, shape (6,) [m, rad]."""
    loads: np.ndarray
    """Load on each source of play: force and moment of the contacts on the journal about its
    centre, bearing axes; torque of a gear's teeth about its axis, or force along it, shape (j, 6)
    [N, N m]."""
    sag: np.ndarray
    """The part of `error` that is due to drives giving way, shape (6,) [m, rad]."""


@dataclass(frozen=True)
class RestPositions:
    """A machine with play in static equilibrium, at n poses."""

    mechanism: Mechanism
    """The machine, with its payloads in hand."""
    q: np.ndarray
    """Configurations, journals centred and loops closed, shape (n, nq)."""
    model: ErrorModel
    """The error by play, fits in the middle of their tolerances."""
    force: np.ndarray
    """Force on the tool, world axes, shape (3,) [N]."""
    loads: Mapping[str, Load]
    """All loads besides gravity and drives, by name; the force on the tool is one of them."""
    driven: Sequence[str] | None
    """Joints of loops that stand; None: the first that determine the others."""
    friction: float | None
    """Coefficient of friction of all contacts; None: the largest of each joint's own law."""
    drives: Mapping[str, Drive]
    """Drive of each joint, by name."""
    joint_friction: Mapping[str, JointFriction]
    """Friction of joints, which may hold the teeth of their gears on either side."""
    second_order: np.ndarray
    """Bound on the distance of the tool at rest from where the Jacobians have it, (n,) [m]."""
    relative_to: str | None = None
    """Body from which the tool is seen; None: the world."""

    _rests: dict[int, RestPlace] = field(default_factory=dict, init=False)
    _intervals: dict[int, np.ndarray] = field(default_factory=dict, init=False)

    @property
    def coefficients(self) -> dict[str, float]:
        """Coefficient of friction of each joint with clearance."""
        if self.friction is not None:
            return dict.fromkeys(self.mechanism.clearance, self.friction)
        joints = self.mechanism.clearance.items()
        return {n: max(joint.friction.coefficients.values(), default=0.0) for n, joint in joints}

    @property
    def unsearched(self) -> tuple[str, ...]:
        """Joints that may be anywhere in their play in `interval`, as no states of rest are sought.

        These are joints of a kind without contacts, and all of loops that tie plays to each other
        (plane loops do not).
        """
        return tuple(
            name
            for name, play in zip(self.model.names, self.model.plays, strict=True)
            if name not in self._gears and (self.model.tied or type(play).pressed is Play.pressed)
        )

    def is_known(self, pose: int) -> bool:
        """Whether rest and interval of a pose have been computed already."""
        return pose in self._rests and pose in self._intervals

    @property
    def friction_text(self) -> str:
        values = self.coefficients
        if self.friction is not None or len(set(values.values())) == 1:
            return f"friction {next(iter(values.values()), 0.0):g}"
        text = ", ".join(f"{name} {value:g}" for name, value in values.items())
        return f"friction ({text or 'none'})"

    def unpressed(self, pose: int) -> np.ndarray:
        """Which sources of play bear no load at a pose and so rest anywhere, shape (j,).

        The loads are those of the whole machine's equilibrium: a journal that moves nothing alone,
        such as one of a door's two hinges, may bear as much as the others.
        """
        mass = pin.computeTotalMass(self.mechanism.model)
        loads = self.at(pose).loads
        arms = np.array([_arm(play) for play in self.model.plays])
        sizes = np.linalg.norm(loads[:, :3], axis=1) + np.linalg.norm(loads[:, 3:], axis=1) / arms
        scale = mass * np.linalg.norm(self.mechanism.gravity) + sizes.max(initial=0.0)
        return np.asarray(sizes <= _UNPRESSED * scale)

    def at(self, pose: int) -> RestPlace:
        """Where the machine rests without friction at a pose: where a run with start="rest" begins.

        Contacts, teeth and drives deflect by their laws.
        """
        if pose not in self._rests:
            self._rests[pose] = self._find_rest(pose)
        return self._rests[pose]

    def _find_rest(self, pose: int) -> RestPlace:
        mechanism, q = self.mechanism, self.q[pose]
        names = standing_joints(mechanism, q, self.driven)
        balance = held(mechanism, q, {name: self.drives[name] for name in names}, self.loads)
        near = None
        if not mechanism.loops:  # the search begins at the rest that the first order predicts
            points = self.model.subset(poses=[pose]).at_rest().point[:, 0, 0]
            aside = dict(zip(self.model.names, points, strict=True))
            journals = {name: xi for name, xi in aside.items() if name not in self._gears}
            near = displaced_configuration(mechanism, q, journals)
        equilibrium = balance.settle(near)
        if not equilibrium.solved:
            equilibrium = balance.settle()
        if not equilibrium.solved:
            unknown = np.full((len(self.model.names), 6), np.nan)
            return RestPlace(unknown, np.full(6, np.nan), unknown, np.full(6, np.nan))
        ideal, actual = (tool_place(mechanism, row, self.relative_to) for row in (q, equilibrium.q))
        turn = ideal.rotation @ pin.log3(ideal.rotation.T @ actual.rotation)
        error = np.concatenate([actual.translation - ideal.translation, turn])
        q_rest, sources = equilibrium.q, self.model.names
        points = np.array([self._displacement(name, pose, q_rest) for name in sources])
        parts = np.einsum("jik,jk->ji", self.model.jacobian[:, pose], points)
        if self.model.tied:
            parts = np.full_like(parts, np.nan)
        borne = balance.wrenches(equilibrium.q)
        own_loads = zip(self.model.names, self.model.load[:, pose], strict=True)
        bearing = [
            np.eye(6)[self._component(name)] * wrench if name in self._gears else borne[name]
            for name, wrench in own_loads
        ]
        return RestPlace(parts, error, np.array(bearing), self._sag(pose, names, equilibrium.q))

    def _sag(self, pose: int, names: Sequence[str], q_rest: np.ndarray) -> np.ndarray:
        """The tool's error by drives that hold their coordinate beside the command, (6,)."""
        mechanism, q, sag = self.mechanism, self.q[pose], np.zeros(6)
        bent = {}
        for name in names:
            encoder = getattr(self.drives[name], "encoder", None)
            if encoder is None or name not in mechanism.description.joints:
                continue  # prescribed
            at = mechanism.coordinate(name) if encoder == "link" else mechanism.motor(name)
            bent[name] = q_rest[at] - q[at]
        seen = self.driven, self.relative_to
        move = jacobians(mechanism, q[None], list(bent), {}, *seen).tool
        for columns, (name, deflection) in zip(move[:, 0], bent.items(), strict=True):
            sag += columns[:, mechanism.description.joints[name].component] * deflection
        return sag

    @property
    def regulated(self) -> frozenset[str]:
        """Geared joints whose encoders see the link, which their drives hold whatever the gear."""
        gears = self.mechanism.gears
        return frozenset(n for n in gears if getattr(self.drives[n], "encoder", "") == "link")

    def unregulated(self, model: ErrorModel) -> ErrorModel:
        """A model without the gears of `regulated` joints."""
        parts = model.contributions
        return model.subset([not c.gear or c.joint not in self.regulated for c in parts])

    def interval(self, pose: int) -> np.ndarray:
        """The interval of errors in which friction can hold the tool, to about 3 % of its width.

        Least and largest error along world x, y, z, and least and largest distance from the ideal
        tool, (4, 2) [m]. `unsearched` joints may be anywhere within their play.
        """
        if pose not in self._intervals:
            self._intervals[pose] = self._interval(pose)
        return self._intervals[pose]

    def _interval(self, pose: int) -> np.ndarray:
        clouds = self._clouds(pose)
        more, directions = self.second_order[pose], _DIRECTIONS
        least = np.sum([cloud.min(axis=0) for cloud in clouds], axis=0) - more
        most = np.sum([cloud.max(axis=0) for cloud in clouds], axis=0) + more
        far = np.sum([(cloud @ directions.T).max(axis=0) for cloud in clouds], axis=0)
        near = np.sum([(cloud @ directions.T).min(axis=0) for cloud in clouds], axis=0)
        rest = self.at(pose)
        sag = np.nan_to_num(rest.sag[:3])
        least, most, near = least + sag, most + sag, near + directions @ sag
        # The farthest point lies at most this angle beside one of the directions [rad].
        widest = 2.2 / np.sqrt(len(directions))
        away = (far + directions @ sag).max() / np.cos(widest)
        away = min(away, np.linalg.norm(sag) + far.max() / np.cos(widest))
        nearest, farthest = max(near.max() - more, 0.0), away + more
        ends = np.array([np.append(least, nearest), np.append(most, farthest)]).T
        place = rest.error[:3]  # zero friction lies within the cones, too
        frictionless = np.append(place, np.linalg.norm(place))
        ends[:, 0] = np.fmin(ends[:, 0], frictionless)
        ends[:, 1] = np.fmax(ends[:, 1], frictionless)
        return ends

    @property
    def _gears(self) -> set[str]:
        """Names of the sources of play that are gears."""
        return {name + GEAR for name in self.mechanism.gears}

    def _component(self, gear: str) -> int:
        """Component of a displacement along which a gear's joint moves."""
        return self.mechanism.description.joints[gear.removesuffix(GEAR)].component

    def _displacement(self, name: str, pose: int, q_rest: np.ndarray) -> np.ndarray:
        """Displacement of a source of play from a pose to `q_rest` (nq,), shape (6,) [m, rad]."""
        mechanism, q = self.mechanism, self.q[pose]
        xi = np.zeros(6)
        if name in self._gears:
            geared = name.removesuffix(GEAR)
            if geared in self.regulated:  # the motor moves within the play, not the link
                return xi
            motor, link = q_rest[mechanism.motor(geared)], q_rest[mechanism.coordinate(geared)]
            xi[self._component(name)] = -mechanism.gears[geared].twist(motor, link)
            return xi
        if name not in mechanism.loops:
            columns = _coordinates(mechanism, q, name)
            solution: np.ndarray = np.linalg.lstsq(columns, q_rest - q, rcond=1e-9)[0]
            return solution
        pin.forwardKinematics(mechanism.model, mechanism.data, q_rest)
        moved = pose_between(mechanism.data, mechanism.closing_frames(name))
        xi = np.concatenate([moved.translation, pin.log3(moved.rotation)])
        joint = mechanism.clearance[name]
        return np.where([part in joint.ideal_freedoms for part in RELATIVE], 0.0, xi)

    def _clouds(self, pose: int) -> list[np.ndarray]:
        """The tool's errors in the states of rest of each source of play, (m, 3) each [m]."""
        plays = self.model.subset(poses=[pose])
        move = plays.jacobian[:, 0, :3]
        errors: dict[str, np.ndarray] = {}
        grip: dict[str, float] = {}  # friction of a journal about, or along, its joint's axis
        if not plays.tied:
            unpressed = dict(zip(plays.names, self.unpressed(pose), strict=True))
            names = [name for name in plays.names if name not in self._gears]
            friction = [self.coefficients[name] for name in names]
            points: list[np.ndarray] = []
            pressed: list[Pressed | None] = []
            loads: list[np.ndarray] = []
            if names:
                points, pressed, loads = _held_states(
                    plays.subset(slice(len(names))), friction, self._curvature(pose, names)
                )
            for j, name in enumerate(names):
                contacts, joint = pressed[j], self.mechanism.clearance[name]
                if contacts is None:
                    continue
                force = float(contacts.force.sum(axis=1).max(initial=0.0))
                entry = self.mechanism.description.joints.get(name)
                slides = entry is not None and entry.slides
                arm = 1.0 if slides else joint.half_width
                grip[name] = friction[j] * arm * force
                if unpressed[name]:
                    continue
                if len(points[j]):
                    errors[name] = deflected(joint, loads[j], points[j], contacts) @ move[j].T
                else:  # no friction, and one place of rest only
                    place = self.at(pose).parts[j : j + 1, :3]
                    if not np.isnan(place).any():
                        errors[name] = place
        # The teeth of a gear bear the load, more or less by what friction takes of it: they are
        # wound up to one side, or lie anywhere in the backlash if friction can balance the load.
        for j, name in enumerate(plays.names):
            if name in self._gears:
                joint_name = name.removesuffix(GEAR)
                if joint_name in self.regulated:
                    errors[name] = np.zeros((1, 3))
                    continue
                component = self._component(name)
                half, load = max(plays.plays[j].reach), plays.load[j, 0, component]
                losses = self.joint_friction.get(joint_name, JointFriction())
                resists = grip.get(joint_name, 0.0) + losses.coulomb + losses.excess
                ends = np.array([load - resists, load + resists])
                gear = self.mechanism.gears[joint_name]
                bristles = gear.bristles[0] * np.array([-1.0, 1.0])
                angle = gear.wound_up(ends + bristles)
                if ends[0] <= 0.0 <= ends[1]:
                    angle = np.array([-half, half])
                errors[name] = np.outer(angle, move[j][:, component])
        # The others (tied by loops, of a kind without contacts, without load) rest anywhere.
        if len(errors) < len(plays.names):
            directions = np.vstack([np.eye(3), -np.eye(3), _DIRECTIONS])
            anywhere = plays.along(directions[None]).error[:, 0, :, :3]
            errors = {**dict(zip(plays.names, anywhere, strict=True)), **errors}
        return [errors[name] for name in plays.names]

    def _curvature(self, pose: int, names: Sequence[str]) -> np.ndarray:
        """Curvature of the potential energy by displacements of the journals, (6 j, 6 j): what
        their loads lose per displacement. Zero with loops.
        """
        mechanism, q = self.mechanism, self.q[pose]
        if mechanism.loops:
            return np.zeros((6 * len(names), 6 * len(names)))
        model, data = mechanism.model, mechanism.data
        curvature = weight_curvature(model, data, q)
        if self.force.any():
            # A force is the weight of a point mass at the tool in a field of its own.
            tool = model.frames[mechanism.tool_frame]
            weight = model.copy()
            for i in range(weight.njoints):
                weight.inertias[i] = pin.Inertia.Zero()
            centre = tool.placement.translation
            weight.inertias[tool.parentJoint] = pin.Inertia(1.0, centre, np.zeros((3, 3)))
            weight.gravity.linear = self.force
            weight.gravity.angular = np.zeros(3)
            curvature = curvature + weight_curvature(weight, weight.createData(), q)
        if self.loads:
            pin.computeJointJacobians(model, data, q)
            curvature = curvature + static_loads(mechanism, self.loads).slopes(data, q)[1]
        columns = np.hstack([_coordinates(mechanism, q, name) for name in names])
        return np.asarray(columns.T @ curvature @ columns)


def standing_joints(mechanism: Mechanism, q: np.ndarray, driven: Sequence[str] | None) -> list[str]:
    """Joints that drives hold: all but those that follow in closed loops, by name."""
    names = list(mechanism.joints)
    if mechanism.loops:
        passive = set(ClosedLoops(mechanism, q, driven).passive)
        names = [name for name in names if mechanism.coordinate(name) not in passive]
    return names


def held(
    mechanism: Mechanism, q: np.ndarray, drives: Mapping[str, Drive], loads: Mapping[str, Load]
) -> StaticEquilibrium:
    """The static equilibrium of a machine whose `drives`, by joint, hold it at q (nq,) under loads.

    Servos with an I term are as stiff as that makes them in the end.
    """
    at, nothing = [mechanism.coordinate(name) for name in drives], np.zeros(mechanism.model.nv)
    names = list(drives)
    motion = Motion(names, [0.0, _INSTANT_S], np.array([q[at], q[at]])) if names else None
    final = {
        name: replace(drive, p_gain=_STIFFER_BY_I_TERM * drive.p_gain, i_gain=0.0)
        if isinstance(drive, Servo) and drive.i_gain
        else drive
        for name, drive in drives.items()
    }
    holding = assign(mechanism, motion, final)
    tables, reference = tabulate(mechanism, motion, holding, _INSTANT_S, {}, q)
    return StaticEquilibrium(
        mechanism, mechanism.model, q, nothing, holding, tables.drives, tables.servos,
        reference.table[0], {}, static_loads(mechanism, loads), nothing.copy(),
    )  # fmt: skip


def _coordinates(mechanism: Mechanism, q: np.ndarray, name: str) -> np.ndarray:
    """Change of q per displacement of a journal of the tree, by differences, shape (nq, 6)."""
    moved = [displaced_configuration(mechanism, q, {name: _STEP * xi}) - q for xi in np.eye(6)]
    columns = np.array(moved).T / _STEP
    columns[np.abs(columns) < 10.0 * _STEP] = 0.0  # the second order of the differences
    joint = mechanism.clearance[name]
    for k, part in enumerate(RELATIVE):
        if part in joint.ideal_freedoms or part not in joint.freedoms:
            columns[:, k] = 0.0
    return columns


def _held_states(
    plays: ErrorModel, friction: Sequence[float], curvature: np.ndarray
) -> tuple[list[np.ndarray], list[Pressed | None], list[np.ndarray]]:
    """States in which friction holds journals at one pose that no loop ties to each other.

    `curvature` is what loads lose per displacement, (6 j, 6 j).

    Returns:
        Of each journal its displacements (m, 6), its contacts, and the loads (m, 6) under which the
        contacts would hold it there without friction.
    """
    random = np.random.default_rng(0)
    sets = [loop_play.ended(play) for play in plays.plays]
    bare = plays.load[:, 0]
    disturbed, points, contacts, fractions = [], [], [], []
    for play, alone, coefficient in zip(sets, bare, friction, strict=True):
        arm = _arm(play)
        size = np.linalg.norm(alone[:3]) + np.linalg.norm(alone[3:5]) / arm
        noise = random.normal(size=(STATES, 6)) * np.array([1.0] * 3 + [arm] * 3)
        load = alone + _LOAD_NOISE * size * noise
        disturbed.append(load)
        points.append(play.support(noise).point)
        contacts.append(play.pressed(load, play.support(load).point))
        k = 0 if contacts[-1] is None else len(contacts[-1].contact)
        fractions.append(coefficient * _cone_points(k, random))
    loads = [load.copy() for load in disturbed]
    # Half of the states follow their load as it turns with the tilt, which diverges from some
    # equilibria. The others keep the load of their first, random position; those that do not
    # balance the load where they end are discarded below.
    follows = np.arange(STATES) % 2 == 0
    for turn in range(_ROUNDS):
        falls = np.concatenate(points, axis=1) @ curvature
        if turn == 0:
            stays = falls
        falls = np.where(follows[:, None], falls, stays)
        for j, play in enumerate(sets):
            now = contacts[j]
            if now is None:
                continue
            load = disturbed[j] - falls[:, 6 * j : 6 * j + 6] + _friction(now, fractions[j])
            load = load if turn < _DAMPED else 0.5 * (loads[j] + load)
            scale = np.array([1.0] * 3 + [1.0 / _arm(play)] * 3)
            away = np.linalg.norm((load - loads[j]) * scale, axis=1)
            moves = away > _SETTLED * np.linalg.norm(load * scale, axis=1)
            moves |= turn == 0  # the first points are random, not those of any load
            if not moves.any():
                continue
            loads[j][moves] = load[moves]
            points[j][moves] = play.support(load[moves]).point
            if moved := play.pressed(load[moves], points[j][moves]):
                contacts[j] = now.replaced(moves, moved)
    falls = np.concatenate(points, axis=1) @ curvature
    results: list[Pressed | None] = []
    for j, play in enumerate(sets):
        now = contacts[j]
        if now is not None:
            load = bare[j] - falls[:, 6 * j : 6 * j + 6]
            balanced = _balanced(load, now, fractions[j], friction[j], _arm(play))
            # None balances if a tilt swings between two ends of a freedom that is nearly open.
            if not balanced.any() and friction[j] > 0.0:
                balanced[follows] = True
            points[j], loads[j] = points[j][balanced], loads[j][balanced]
            now = now.subset(balanced)
        results.append(now)
    return points, results, loads


def _friction(contacts: Pressed, fractions: np.ndarray) -> np.ndarray:
    """Wrench of friction forces that are fractions (n, k, 2) of the normal forces, (n, 6)."""
    n = len(fractions)
    forces = (contacts.force[:, :, None] * fractions).reshape(n, 1, -1)
    return np.asarray((forces @ contacts.across.reshape(n, -1, 6))[:, 0])


def _balanced(
    loads: np.ndarray, contacts: Pressed, fractions: np.ndarray, friction: float, arm: float
) -> np.ndarray:
    """Whether contacts within their friction cones can balance loads (n, 6), shape (n,).

    The forces already known, with friction of `fractions` (n, k, 2), are tried first; where they
    do not balance, the distance of the load from all cones together is found.
    """
    rows = list(contacts.borne)
    weight = np.array([1.0] * 3 + [1.0 / arm] * 3)[rows]
    right = loads[:, rows] * weight
    size = np.maximum(np.linalg.norm(right, axis=1), 1e-300)
    most = (_UNBALANCED * friction + _UNBALANCED_DRY) * size
    exerted = (contacts.force[:, None] @ contacts.normal)[:, 0] + _friction(contacts, fractions)
    near = np.linalg.norm(right + exerted[:, rows] * weight, axis=1) <= most
    unsure = np.flatnonzero(~near)
    if len(unsure) and len(contacts.contact):
        edges = -_cone_edges(contacts.subset(unsure), friction)[:, :, rows] * weight
        from scipy.optimize import nnls  # takes long to import

        for i, spanned in zip(unsure, edges, strict=True):
            near[i] = nnls(spanned.T, right[i])[1] <= most[i]
    return np.asarray(near & contacts.touching.any(axis=1))


def _cone_edges(contacts: Pressed, friction: float) -> np.ndarray:
    """Edges of the friction cones of all contacts, zero for those that do not touch, (n, m, 6)."""
    cones = contacts.normal[:, :, None] + friction * np.einsum(
        "ci,nkid->nkcd", _CORNERS if friction > 0.0 else np.zeros((1, 2)), contacts.across
    )
    edges = []
    for k in range(cones.shape[1]):
        columns = np.where(contacts.touching[:, k, None, None], cones[:, k], 0.0)
        if contacts.patch[:, k].any():
            # A flat face may push anywhere within its circle; a square around it has four corners.
            places = np.sqrt(2.0) * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
            arms = contacts.patch[:, k, None, None] * places
            columns = np.repeat(columns[:, None], len(places), axis=1)
            moments = np.cross(arms, contacts.normal[:, k, None, :3])
            columns[..., 3:] += (moments * contacts.touching[:, k, None, None])[:, :, None]
        edges.append(columns.reshape(len(cones), -1, 6))
    return np.concatenate(edges, axis=1)


def _arm(play: Play) -> float:
    """Length that makes the angles of a play comparable with its displacements [m]."""
    aside, angle = play.reach
    return max(aside / angle, 1e-9) if angle > 0.0 else 1.0


def _cone_points(count: int, random: np.random.Generator) -> np.ndarray:
    """Friction of `count` contacts along two tangents, as parts of the full one, (m, k, 2).

    The first half of the states goes through the corners of the cones, the second is drawn inside.
    """
    if count == 0:
        return np.zeros((STATES, 0, 2))
    corners = np.vstack([np.zeros(2), _CORNERS])
    choice = random.integers(0, len(corners), (STATES, count))
    # Every pair of corners of the first two contacts, which in a journal are its rims.
    pairs = np.array(list(product(range(len(corners)), repeat=min(count, 2))))
    choice[:, : pairs.shape[1]] = np.resize(pairs, (STATES, pairs.shape[1]))
    chosen = corners[choice]
    size = np.sqrt(random.uniform(0.0, 1.0, (STATES // 2, count, 1)))
    angle = random.uniform(0.0, 2.0 * np.pi, (STATES // 2, count, 1))
    chosen[STATES // 2 :] = size * np.concatenate([np.cos(angle), np.sin(angle)], axis=2)
    return np.asarray(chosen)


def deflected(
    joint: Clearance, loads: np.ndarray, points: np.ndarray, contacts: Pressed | None
) -> np.ndarray:
    """Positions (m, 6) of journals, given those at the ends of their play, as contacts deflect.

    In a rolling bearing several elements share a load by how they give way, so that forces of rigid
    ones say nothing about a lean: its own law finds the position.
    """
    if isinstance(joint, RollingBearing):
        side = -1.0 if joint.exchanged else 1.0
        return side * joint.rests(side * loads)[0]
    if contacts is None:
        return points
    deep = np.zeros_like(contacts.force)
    for k, contact in enumerate(contacts.contact):
        if contact < len(joint.contacts):
            deep[:, k] = depths(joint, contact, contacts.force[:, k])
    # The least displacement, angles weighed by the joint's size, by which each contact deflects.
    rows = np.where((contacts.force > 0.0)[:, :, None], -contacts.normal, 0.0)
    weight = np.array([1.0] * 3 + [1.0 / joint.half_width] * 3)
    inverse = np.linalg.pinv(rows * weight, rcond=1e-6)
    shifts: np.ndarray = (inverse @ deep[..., None])[..., 0] * weight
    return points + shifts
