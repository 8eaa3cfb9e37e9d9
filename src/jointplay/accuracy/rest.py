"""Where a machine with play can rest: without friction a place, with friction a whole set.

Without friction a journal slides to where the potential energy is lowest. To the first order that
is the point at which the support function of its play is attained (`joints.play`), but the axial
torque of a load that tilts the joint does work only through the product of two tilts, as the
drive's coupling has it, and so do the weights of all that tilts with it: where the first order
leaves the tilt nearly open, the second decides. So `RestPositions.at` asks `simulation.statics`, as
a run with start="rest" does.

With Coulomb friction a journal rests wherever its contacts, each pushing within its cone of
friction, can balance its load. For friction at given parts of the normal forces that is the state
without friction under a load that has this friction added; all such states, the parts going through
the cone's edge, bound the set (`_held_states`). The cones are taken as polygons around the round
ones; loads as they change with all tilts, contacts as they deflect: what is found is on the safe
side. Sets of several joints add up, so the tool's interval along a direction is the sum of theirs.
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
"""Distance within which `RestPositions` have the tool where a run with start="rest" begins [m]."""
STATES = 1296
"""Friction states of each joint that are tried, half of them at random."""
_INSTANT_S = 1e-3
"""How long the motion lasts that does not move, of which drives know gains and torques [s]."""
_STIFFER_BY_I_TERM = 1e3
"""By how much stiffer a servo is in the end that has an I term: without end, in truth; so its sag
is a thousandth of what it was, less than gears and contacts give way (judged)."""
_ANGLES = np.arange(12) * np.pi / 6.0
_CORNERS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)]) / np.cos(np.pi / 12.0)
"""Of the polygon around a round cone of friction, at most 3.5 % wider; with 16 corners so many
states miss some ends."""
_UNBALANCED, _UNBALANCED_DRY = 0.01, 1e-5
"""Part of a load that may be left in a state of rest, for states are not found exactly: per
coefficient of friction, and without any. The first widens the cones by a percent, less than their
polygons do (judged)."""
_ROUNDS, _DAMPED = 10, 5
"""How often friction is found from normal forces and these from friction, each time off by the
coefficient of friction; from when on halved, lest loads swing between two ends (judged)."""
_SETTLED = 1e-7
"""Change of a load, relative to it, that moves nothing: below `_LOAD_NOISE`."""
_UNPRESSED = 1e-9
"""Load of a joint relative to the machine's weight and the tool's load that is rounding: of sums of
many forces, each to 1e-16 of the largest."""
_LOAD_NOISE = 1e-6
"""Part of a load that is added at random, so that all ends of what it leaves open are found: far
above rounding, far below what moves a journal that the load holds (judged)."""
_DIRECTIONS = half_sphere(180, full=True)
"""In which the farthest tool is sought, (180, 3)."""
_STEP = 1e-6
"""Displacement of difference quotients [m or rad]: the second order of a place, 1e-12, and its
rounding, 1e-16, both are small beside it."""


class RestPlace(NamedTuple):
    """Where a machine rests without friction; NaN where no equilibrium is found."""

    parts: np.ndarray
    """The tool's error by source of play, shape (j, 6) [m, rad]; NaN where plays hold each other,
    for none moves the tool alone."""
    error: np.ndarray
    """The tool's error of all, exactly, shape (6,) [m, rad]."""
    loads: np.ndarray
    """What each source of play bears: force and moment of the contacts on the journal about its
    centre, bearing axes; torque of a gear's teeth about its axis, or force along it, shape (j, 6)
    [N, N m]."""
    sag: np.ndarray
    """The tool's error by drives that give way, which is in `error`, shape (6,) [m, rad]."""


@dataclass(frozen=True)
class RestPositions:
    """A machine with play in static equilibrium, at n poses."""

    mechanism: Mechanism
    """With what it carries in hand."""
    q: np.ndarray
    """Configurations, journals centred and loops closed, shape (n, nq)."""
    model: ErrorModel
    force: np.ndarray
    """On the tool, world axes, shape (3,) [N]."""
    loads: Mapping[str, Load]
    """All that acts beside gravity and drives, the force on the tool too, by name."""
    driven: Sequence[str] | None
    friction: float | None
    """Coefficient of all contacts; None: the largest of each joint's own law."""
    drives: Mapping[str, Drive]
    """Of all joints."""
    joint_friction: Mapping[str, JointFriction]
    """Of joints, which may hold the teeth of their gears on either side."""
    second_order: np.ndarray
    """By how much the tool at rest may be elsewhere than the Jacobians say, shape (n,) [m]."""
    relative_to: str | None = None
    """Body from which the tool is seen; None: the world."""

    _rests: dict[int, RestPlace] = field(default_factory=dict, init=False)
    _intervals: dict[int, np.ndarray] = field(default_factory=dict, init=False)

    @property
    def coefficients(self) -> dict[str, float]:
        if self.friction is not None:
            return dict.fromkeys(self.mechanism.clearance, self.friction)
        joints = self.mechanism.clearance.items()
        return {n: max(joint.friction.coefficients.values(), default=0.0) for n, joint in joints}

    @property
    def unsearched(self) -> tuple[str, ...]:
        """Joints whose whole play the interval takes: in loops, or of a kind without contacts.

        In loops only if these hold the plays together, as plane ones do not.
        """
        return tuple(
            name
            for name, play in zip(self.model.names, self.model.plays, strict=True)
            if name not in self._gears and (self.model.tied or type(play).pressed is Play.pressed)
        )

    def is_known(self, pose: int) -> bool:
        return pose in self._rests and pose in self._intervals

    @property
    def friction_text(self) -> str:
        values = self.coefficients
        if self.friction is not None or len(set(values.values())) == 1:
            return f"friction {next(iter(values.values()), 0.0):g}"
        text = ", ".join(f"{name} {value:g}" for name, value in values.items())
        return f"friction ({text or 'none'})"

    def unpressed(self, pose: int) -> np.ndarray:
        """Which sources of play bear no load at a pose, and rest anywhere, shape (j,).

        By the statics of all together: a journal that moves nothing alone, as one of two hinges of
        a door, may bear as much as the others.
        """
        mass = pin.computeTotalMass(self.mechanism.model)
        loads = self.at(pose).loads
        arms = np.array([_arm(play) for play in self.model.plays])
        sizes = np.linalg.norm(loads[:, :3], axis=1) + np.linalg.norm(loads[:, 3:], axis=1) / arms
        scale = mass * np.linalg.norm(self.mechanism.gravity) + sizes.max(initial=0.0)
        return np.asarray(sizes <= _UNPRESSED * scale)

    def at(self, pose: int) -> RestPlace:
        """Where the machine rests without friction at a pose, as a run with start="rest" begins.

        Contacts, teeth and drives deflect by their laws.
        """
        if pose not in self._rests:
            self._rests[pose] = self._find_rest(pose)
        return self._rests[pose]

    def _find_rest(self, pose: int) -> RestPlace:
        mechanism, q = self.mechanism, self.q[pose]
        names = standing_joints(mechanism, q, self.driven)
        balance = held(mechanism, q, {name: self.drives[name] for name in names}, self.loads)
        equilibrium = balance.settle(None if mechanism.loops else self._near(pose))
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
        """The tool's error by what drives hold being elsewhere than commanded, (6,) [m, rad]."""
        mechanism, q, sag = self.mechanism, self.q[pose], np.zeros(6)
        bent = {name: q_rest[i] - q[i] for name in names if (i := self._encoder(name)) is not None}
        seen = self.driven, self.relative_to
        move = jacobians(mechanism, q[None], list(bent), {}, *seen).tool
        for columns, (name, deflection) in zip(move[:, 0], bent.items(), strict=True):
            sag += columns[:, mechanism.description.joints[name].component] * deflection
        return sag

    def _encoder(self, name: str) -> int | None:
        """Coordinate that a joint's drive holds; None where it is prescribed."""
        encoder = getattr(self.drives[name], "encoder", None)
        if encoder is None or name not in self.mechanism.description.joints:
            return None
        at = self.mechanism.coordinate if encoder == "link" else self.mechanism.motor
        return at(name)

    @property
    def regulated(self) -> frozenset[str]:
        """Joints with gears whose drives hold the link, which their encoders see, where it is."""
        gears = self.mechanism.gears
        return frozenset(n for n in gears if getattr(self.drives[n], "encoder", "") == "link")

    def unregulated(self, model: ErrorModel) -> ErrorModel:
        """A model without the gears whose links drives hold where they are."""
        parts = model.contributions
        return model.subset([not c.gear or c.joint not in self.regulated for c in parts])

    def interval(self, pose: int) -> np.ndarray:
        """Between which errors friction can hold the tool at a pose, to about 3 % of the width.

        Least and largest along world x, y, z, and its distance from the ideal one, (4, 2) [m].
        `unsearched` joints may be anywhere within their play.
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
        # The farthest point lies at most this angle beside a direction that is looked at.
        widest = 2.2 / np.sqrt(len(directions))
        away = (far + directions @ sag).max() / np.cos(widest)
        away = min(away, np.linalg.norm(sag) + far.max() / np.cos(widest))
        nearest, farthest = max(near.max() - more, 0.0), away + more
        ends = np.array([np.append(least, nearest), np.append(most, farthest)]).T
        place = rest.error[:3]  # no friction is a friction within the cone
        frictionless = np.append(place, np.linalg.norm(place))
        ends[:, 0] = np.fmin(ends[:, 0], frictionless)
        ends[:, 1] = np.fmax(ends[:, 1], frictionless)
        return ends

    def _near(self, pose: int) -> np.ndarray:
        """The configuration at rest by the first order, from where the search begins."""
        points = self.model.subset(poses=[pose]).at_rest().point[:, 0, 0]
        aside = dict(zip(self.model.names, points, strict=True))
        displacements = {name: xi for name, xi in aside.items() if name not in self._gears}
        return displaced_configuration(self.mechanism, self.q[pose], displacements)

    @property
    def _gears(self) -> set[str]:
        return {name + GEAR for name in self.mechanism.gears}

    def _component(self, gear: str) -> int:
        """Component in which a gear's joint moves."""
        return self.mechanism.description.joints[gear.removesuffix(GEAR)].component

    def _displacement(self, name: str, pose: int, q_rest: np.ndarray) -> np.ndarray:
        """Displacement of a source of play, as its set has it, from a pose to `q_rest` (nq,)."""
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
        """The tool's errors in states in which friction holds, of each source of play (m, 3)."""
        plays = self.model.subset(poses=[pose])
        move = plays.jacobian[:, 0, :3]
        errors: dict[str, np.ndarray] = {}
        grip: dict[str, float] = {}
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
                held = gear.bristles[0] * np.array([-1.0, 1.0])
                angle = gear.wound_up(ends + held)
                if ends[0] <= 0.0 <= ends[1]:
                    angle = np.array([-half, half])
                errors[name] = np.outer(angle, move[j][:, component])
        if len(errors) < len(plays.names):  # loops, an own kind, no load: anywhere within the play
            directions = np.vstack([np.eye(3), -np.eye(3), _DIRECTIONS])
            anywhere = plays.along(directions[None]).error[:, 0, :, :3]
            errors = {**dict(zip(plays.names, anywhere, strict=True)), **errors}
        return [errors[name] for name in plays.names]

    def _curvature(self, pose: int, names: Sequence[str]) -> np.ndarray:
        """How loads fall with displacements: the energy's curvature, shape (6 j, 6 j)."""
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
    """Joints that drives hold: all but those that follow in closed loops."""
    names = list(mechanism.joints)
    if mechanism.loops:
        passive = set(ClosedLoops(mechanism, q, driven).passive)
        names = [name for name in names if mechanism.coordinate(name) not in passive]
    return names


def held(
    mechanism: Mechanism, q: np.ndarray, drives: Mapping[str, Drive], loads: Mapping[str, Load]
) -> StaticEquilibrium:
    """A machine that drives hold by name, in configuration q (nq,), under loads.

    What the I term of a servo does in the end is done.
    """
    at, nothing = [mechanism.coordinate(name) for name in drives], np.zeros(mechanism.model.nv)
    names = list(drives)
    motion = Motion(names, [0.0, _INSTANT_S], np.array([q[at], q[at]])) if names else None
    final = {name: _in_the_end(drive) for name, drive in drives.items()}
    holding = assign(mechanism, motion, final)
    tables, _, reference = tabulate(mechanism, motion, holding, _INSTANT_S, {}, q)
    return StaticEquilibrium(
        mechanism, mechanism.model, q, nothing, holding, tables.drives, tables.servos,
        reference.table[0], {}, static_loads(mechanism, loads), nothing.copy(),
    )  # fmt: skip


def _in_the_end(drive: Drive) -> Drive:
    """A servo whose I term has taken back all beyond the dead band."""
    if not (isinstance(drive, Servo) and drive.i_gain):
        return drive
    return replace(drive, p_gain=_STIFFER_BY_I_TERM * drive.p_gain, i_gain=0.0)


def _coordinates(mechanism: Mechanism, q: np.ndarray, name: str) -> np.ndarray:
    """What the displacement of a journal of the tree adds to q, shape (nq, 6)."""
    moved = [displaced_configuration(mechanism, q, {name: _STEP * xi}) - q for xi in np.eye(6)]
    columns = np.array(moved).T / _STEP
    columns[np.abs(columns) < 10.0 * _STEP] = 0.0
    joint = mechanism.clearance[name]
    for k, part in enumerate(RELATIVE):
        if part in joint.ideal_freedoms or part not in joint.freedoms:
            columns[:, k] = 0.0
    return columns


def _held_states(
    plays: ErrorModel, friction: Sequence[float], curvature: np.ndarray
) -> tuple[list[np.ndarray], list[Pressed | None], list[np.ndarray]]:
    """Displacements (m, 6) of each journal in states in which friction holds it, contacts, and the
    loads (m, 6) that these bear without their friction.

    Of journals at one pose, which do not hold each other; by their loads' fall with their
    displacements, (6 j, 6 j).
    """
    random = np.random.default_rng(0)
    sets = [loop_play.ended(play) for play in plays.plays]
    bare = plays.load[:, 0]
    disturbed, points, contacts, rubs = [], [], [], []
    for play, alone, coefficient in zip(sets, bare, friction, strict=True):
        arm = _arm(play)
        size = np.linalg.norm(alone[:3]) + np.linalg.norm(alone[3:5]) / arm
        noise = random.normal(size=(STATES, 6)) * np.array([1.0] * 3 + [arm] * 3)
        load = alone + _LOAD_NOISE * size * noise
        disturbed.append(load)
        points.append(play.support(noise).point)
        contacts.append(play.pressed(load, play.support(load).point))
        k = 0 if contacts[-1] is None else len(contacts[-1].contact)
        rubs.append(coefficient * _directions(k, random))
    loads = [load.copy() for load in disturbed]
    # Half of them follow the load as it turns with the tilt, which does not find the states that
    # this leads away from; the others, of loads as they are anywhere, are sorted out below.
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
            load = disturbed[j] - falls[:, 6 * j : 6 * j + 6] + _rubbing(now, rubs[j])
            load = load if turn < _DAMPED else 0.5 * (loads[j] + load)
            scale = np.array([1.0] * 3 + [1.0 / _arm(play)] * 3)
            away = np.linalg.norm((load - loads[j]) * scale, axis=1)
            moves = away > _SETTLED * np.linalg.norm(load * scale, axis=1)
            moves |= turn == 0  # from points that no load led to
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
            balanced = _balanced(load, now, rubs[j], friction[j], _arm(play))
            # None is left if a tilt swings between two ends of what is nearly open.
            if not balanced.any() and friction[j] > 0.0:
                balanced[follows] = True
            points[j], loads[j] = points[j][balanced], loads[j][balanced]
            now = now.subset(balanced)
        results.append(now)
    return points, results, loads


def _rubbing(contacts: Pressed, rubs: np.ndarray) -> np.ndarray:
    """What friction of parts `rubs` (n, k, 2) of the normal forces exerts, shape (n, 6)."""
    n = len(rubs)
    parts = (contacts.force[:, :, None] * rubs).reshape(n, 1, -1)
    return np.asarray((parts @ contacts.across.reshape(n, -1, 6))[:, 0])


def _balanced(
    loads: np.ndarray, contacts: Pressed, rubs: np.ndarray, friction: float, arm: float
) -> np.ndarray:
    """Whether contacts within their cones of friction can balance loads (n, 6), shape (n,).

    Where their own forces with the friction of parts `rubs` (n, k, 2) do not.
    """
    rows = list(contacts.borne)
    weight = np.array([1.0] * 3 + [1.0 / arm] * 3)[rows]
    right = loads[:, rows] * weight
    size = np.maximum(np.linalg.norm(right, axis=1), 1e-300)
    most = (_UNBALANCED * friction + _UNBALANCED_DRY) * size
    exerted = (contacts.force[:, None] @ contacts.normal)[:, 0] + _rubbing(contacts, rubs)
    near = np.linalg.norm(right + exerted[:, rows] * weight, axis=1) <= most
    unsure = np.flatnonzero(~near)
    if len(unsure) and len(contacts.contact):
        edges = -_cone_edges(contacts.subset(unsure), friction)[:, :, rows] * weight
        from scipy.optimize import nnls  # takes long to import

        for i, spanned in zip(unsure, edges, strict=True):  # how far it is from the cones
            near[i] = nnls(spanned.T, right[i])[1] <= most[i]
    return np.asarray(near & contacts.touching.any(axis=1))


def _cone_edges(contacts: Pressed, friction: float) -> np.ndarray:
    """Edges of the cones of friction of all contacts, zero of those that do not touch (n, m, 6)."""
    cones = contacts.normal[:, :, None] + friction * np.einsum(
        "ci,nkid->nkcd", _CORNERS if friction > 0.0 else np.zeros((1, 2)), contacts.across
    )
    edges = []
    for k in range(cones.shape[1]):
        columns = np.where(contacts.touching[:, k, None, None], cones[:, k], 0.0)
        if contacts.patch[:, k].any():
            # Anywhere within a square around the face.
            places = np.sqrt(2.0) * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
            arms = contacts.patch[:, k, None, None] * places
            columns = np.repeat(columns[:, None], len(places), axis=1)
            moments = np.cross(arms, contacts.normal[:, k, None, :3])
            columns[..., 3:] += (moments * contacts.touching[:, k, None, None])[:, :, None]
        edges.append(columns.reshape(len(cones), -1, 6))
    return np.concatenate(edges, axis=1)


def _arm(play: Play) -> float:
    """A length by which angles of a play compare with its displacements [m]."""
    aside, angle = play.reach
    return max(aside / angle, 1e-9) if angle > 0.0 else 1.0


def _directions(count: int, random: np.random.Generator) -> np.ndarray:
    """Parts of the full friction of each contact along two tangents, shape (m, k, 2)."""
    some = np.vstack([np.zeros(2), _CORNERS])
    if count == 0:
        return np.zeros((STATES, 0, 2))
    choice = random.integers(0, len(some), (STATES, count))
    # Every pair of the first two, which in a journal are its rims.
    pairs = np.array(list(product(range(len(some)), repeat=min(count, 2))))
    choice[:, : pairs.shape[1]] = np.resize(pairs, (STATES, pairs.shape[1]))
    chosen = some[choice]
    size = np.sqrt(random.uniform(0.0, 1.0, (STATES // 2, count, 1)))
    angle = random.uniform(0.0, 2.0 * np.pi, (STATES // 2, count, 1))
    chosen[STATES // 2 :] = size * np.concatenate([np.cos(angle), np.sin(angle)], axis=2)
    return np.asarray(chosen)


def deflected(
    joint: Clearance, loads: np.ndarray, points: np.ndarray, contacts: Pressed | None
) -> np.ndarray:
    """Where journals at the ends of their play, (m, 6), are when what holds them deflects.

    In a rolling bearing several elements share a load by how they give way, so that forces of rigid
    ones say nothing about a lean: its own law finds the place.
    """
    if isinstance(joint, RollingBearing):
        side = -1.0 if joint.exchanged else 1.0
        return side * joint.rests(side * loads)[0]
    return points if contacts is None else points + _compliance_shift(joint, contacts)


def _compliance_shift(joint: Clearance, contacts: Pressed) -> np.ndarray:
    """Displacements of journals by the deflection of their contacts, (m, 6)."""
    deep = np.zeros_like(contacts.force)
    for k, contact in enumerate(contacts.contact):
        if contact < len(joint.contacts):
            deep[:, k] = depths(joint, contact, contacts.force[:, k])
    rows = np.where((contacts.force > 0.0)[:, :, None], -contacts.normal, 0.0)
    reach = joint.half_width
    weight = np.array([1.0] * 3 + [1.0 / reach] * 3)
    inverse = np.linalg.pinv(rows * weight, rcond=1e-6)
    shifts: np.ndarray = (inverse @ deep[..., None])[..., 0] * weight
    return shifts
