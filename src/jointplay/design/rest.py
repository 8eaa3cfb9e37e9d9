"""Where a machine with play can rest: without friction a place, with friction a whole set.

Without friction a journal slides to where the potential energy is lowest. To the first order that
is the point at which the support function of its play is attained (`joints.play`), but the axial
torque of a load that leans the joint does work only through the product of two leans, as the
drive's coupling has it, and so do the weights of all that leans with it: where the first order
leaves the lean nearly open, the second decides. So `Standing.rest` asks `simulation.statics`, as a
run with start="rest" does.

With Coulomb friction a journal rests wherever its contacts, each pushing within its cone of
friction, can balance its load. For friction at given parts of the normal forces that is the state
without friction under a load that has this friction added; all such states, the parts going
through the cone's edge, bound the set (`_held`). The cones are taken as polygons around the round
ones; loads as they change with all leans, contacts as they give way: what is found is on the safe
side. Sets of several joints add up, so the tool's interval along a direction is the sum of theirs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
import pinocchio as pin

from jointplay.design import loop_play, loops
from jointplay.design.levers import GEAR, Part, tool_place
from jointplay.design.loop_play import displaced_configuration
from jointplay.joints import RELATIVE, Clearance
from jointplay.joints.play import Play, Pressed
from jointplay.loads.drive import Drive, Prescribed, assign
from jointplay.loads.tables import tabulate
from jointplay.loads.wrench import Wrench
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.simulation.loads import load_site
from jointplay.simulation.statics import StaticEquilibrium, StaticLoads, depths, weight_curvature

AGREES_M = 1e-6
"""Distance within which `Standing.rest` has the tool where a run with start="rest" begins [m]."""
STATES = 1296
"""Friction states of each joint that are tried, half of them at random."""
_INSTANT_S = 1e-3
"""How long the motion lasts that does not move, of which drives know gains and torques [s]."""
_ANGLES = np.arange(12) * np.pi / 6.0
_CORNERS = np.column_stack([np.cos(_ANGLES), np.sin(_ANGLES)]) / np.cos(np.pi / 12.0)
"""Of the polygon around a round cone of friction, at most 3.5 % wider; with 16 corners so many
states miss some ends."""
_BALANCED, _EXACT = 0.01, 1e-5
"""Part of a load that may be left in a state of rest, for states are not found exactly: per
coefficient of friction, and without any."""
_ROUNDS, _DAMPED = 10, 5
"""How often friction is found from normal forces and these from friction; from when on halved."""
_NOTHING = 1e-9
"""Load of a joint relative to the machine's weight and the tool's load that presses nothing."""
_OPEN = 1e-6
"""Part of a load that is added at random, so that all ends of what it leaves open are found."""
_SMALL = 1e-6
"""Displacement by which coordinates are found [m or rad]."""


@dataclass(frozen=True)
class Standing:
    """A machine with play that stands, at n poses.

    Args:
        mechanism: the machine.
        q: configurations, journals centred and loops closed, shape (n, nq).
        parts: sources of play there.
        force: on the tool, world axes, shape (3,) [N].
        driven: joints of loops that stand.
        friction: coefficient of all contacts; None: the largest of each joint's own law.
        drive: of all joints that stand.
        second_order: by how much the tool may be elsewhere than the levers say, shape (n,) [m].
    """

    mechanism: Mechanism
    q: np.ndarray
    parts: tuple[Part, ...]
    force: np.ndarray
    driven: tuple[str, ...] | None
    friction: float | None
    drive: Drive
    second_order: np.ndarray

    _rests: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, init=False)
    _intervals: dict[int, tuple[np.ndarray, np.ndarray]] = field(default_factory=dict, init=False)

    @property
    def coefficients(self) -> dict[str, float]:
        """Coefficient of friction by joint with clearance."""
        return {
            name: max(joint.friction.coefficients.values(), default=0.0)
            if self.friction is None
            else self.friction
            for name, joint in self.mechanism.clearance.items()
        }

    @property
    def unsearched(self) -> tuple[str, ...]:
        """Joints whose whole play the interval takes: in loops, or of a kind without contacts.

        In loops only if these hold the plays together, as plane ones do not.
        """
        looped = any(part.tie is not None for part in self.parts)
        return tuple(
            part.name
            for part in self.parts
            if part.name not in self._gears and (looped or type(part.play).pressed is Play.pressed)
        )

    def looked_at(self, pose: int) -> bool:
        """Whether both have been found for a pose."""
        return pose in self._rests and pose in self._intervals

    @property
    def words(self) -> str:
        """Which friction is assumed, for a line of text."""
        values = self.coefficients
        if self.friction is not None or len(set(values.values())) == 1:
            return f"friction ({next(iter(values.values()), 0.0):g} assumed)"
        each = ", ".join(f"{name} {value:g}" for name, value in values.items())
        return f"friction ({each or 'none'} assumed)"

    def unpressed(self, pose: int) -> np.ndarray:
        """Which sources of play bear no load at a pose, and rest anywhere, shape (j,)."""
        mass = pin.computeTotalMass(self.mechanism.model)
        whole = mass * np.linalg.norm(self.mechanism.gravity) + np.linalg.norm(self.force)
        loads = np.array([part.load[pose] for part in self.parts])
        arms = np.array([_arm(part.play) for part in self.parts])
        sizes = np.linalg.norm(loads[:, :3], axis=1) + np.linalg.norm(loads[:, 3:], axis=1) / arms
        return np.asarray(sizes <= _NOTHING * whole)

    def rest(self, pose: int) -> tuple[np.ndarray, np.ndarray]:
        """Where the machine rests without friction at a pose, as a run with start="rest" begins.

        Contacts, teeth and drives give way by their laws; not so the drives under a force on the
        tool, for those of a run do not know of it.

        Returns:
            The tool's error by source of play, by its lever, (j, 6); and of all, exactly, (6,)
            [m, rad]. NaN where no place of rest is found.
        """
        if pose not in self._rests:
            self._rests[pose] = self._rest(pose)
        return self._rests[pose]

    def _rest(self, pose: int) -> tuple[np.ndarray, np.ndarray]:
        mechanism, q = self.mechanism, self.q[pose]
        model = mechanism.model
        names = list(mechanism.joints)
        if mechanism.loops:
            driven = loops.driven_joints(mechanism, q, self.driven)
            passive = set(loops.passive_coordinates(mechanism, driven))
            names = [name for name in names if mechanism.coordinate(name) not in passive]
        at = [mechanism.coordinate(name) for name in names]
        motion = Motion(names, [0.0, _INSTANT_S], np.array([q[at], q[at]])) if names else None
        # A run's drives know nothing of a force on the tool and would sag, which is no play.
        drive = Prescribed() if self.force.any() else self.drive
        drives = assign(mechanism, motion, drive if names else {})
        tables, _, reference = tabulate(mechanism, motion, drives, _INSTANT_S, {}, q)
        loads = {}
        if self.force.any():
            x, y, z = map(float, self.force)
            loads = {"tool": Wrench(mechanism.tool, force=(x, y, z))}
        sites = [load_site(one, mechanism, {}) for one in loads.values()]
        balance = StaticEquilibrium(
            mechanism,
            model,
            q,
            np.zeros(model.nv),
            drives,
            tables.drives,
            reference.table[0],
            {},
            StaticLoads(loads, mechanism, sites),
            np.zeros(model.nv),
        )
        found = balance.settle(None if mechanism.loops else self._near(pose))
        if not found.solved:
            found = balance.settle()
        if not found.solved:
            return np.full((len(self.parts), 6), np.nan), np.full(6, np.nan)
        ideal, there = tool_place(mechanism, q), tool_place(mechanism, found.q)
        turn = ideal.rotation @ pin.log3(ideal.rotation.T @ there.rotation)
        whole = np.concatenate([there.translation - ideal.translation, turn])
        points = [self._displacement(part.name, pose, found.q) for part in self.parts]
        errors = [part.move[pose] @ xi for part, xi in zip(self.parts, points, strict=True)]
        return np.array(errors), whole

    def interval(self, pose: int) -> tuple[np.ndarray, np.ndarray]:
        """Where friction can hold the machine at a pose, to about 3 % of the width.

        `unsearched` joints may be anywhere within their play.

        Returns:
            Least and largest error of the tool along world x, y, z, and its least and largest
            distance from the ideal one, shape (4, 2) [m]; and the same of each source of play
            alone along x, y, z, shape (j, 3, 2).
        """
        if pose not in self._intervals:
            self._intervals[pose] = self._interval(pose)
        return self._intervals[pose]

    def _interval(self, pose: int) -> tuple[np.ndarray, np.ndarray]:
        clouds = self._clouds(pose)
        ends = np.array([[cloud.min(axis=0), cloud.max(axis=0)] for cloud in clouds])
        ends = ends.transpose(0, 2, 1)
        more = self.second_order[pose]
        axes = ends.sum(axis=0) + np.array([-more, more])
        ways = _ways()
        far = np.sum([(cloud @ ways.T).max(axis=0) for cloud in clouds], axis=0)
        near = np.sum([(cloud @ ways.T).min(axis=0) for cloud in clouds], axis=0)
        # The farthest point lies at most this angle beside a direction that is looked at.
        widest = 2.2 / np.sqrt(_DIRECTIONS)
        distance = max(near.max() - more, 0.0), far.max() / np.cos(widest) + more
        ends_of_all = np.vstack([axes, distance])
        place = self.rest(pose)[1][:3]  # no friction is a friction within the cone
        own = np.append(place, np.linalg.norm(place))
        ends_of_all[:, 0] = np.fmin(ends_of_all[:, 0], own)
        ends_of_all[:, 1] = np.fmax(ends_of_all[:, 1], own)
        return ends_of_all, ends

    def _near(self, pose: int) -> np.ndarray:
        """The configuration at rest by the first order, from where the search begins."""
        q = self.q[pose]
        one = loop_play.at_rest([_at(part, pose) for part in self.parts]).point[:, 0, 0]
        aside = {part.name: xi for part, xi in zip(self.parts, one, strict=True)}
        return displaced_configuration(
            self.mechanism, q, {n: xi for n, xi in aside.items() if n not in self._gears}
        )

    @property
    def _gears(self) -> set[str]:
        return {name + GEAR for name in self.mechanism.gears}

    def _displacement(self, name: str, pose: int, there: np.ndarray) -> np.ndarray:
        """Displacement of a source of play between a pose and `there` (nq,), as `Part` has it."""
        mechanism, q = self.mechanism, self.q[pose]
        xi = np.zeros(6)
        if name in self._gears:
            own = name.removesuffix(GEAR)
            xi[5] = there[mechanism.coordinate(own)] - there[mechanism.motor(own)]
            return xi
        if name not in mechanism.loops:
            columns = _coordinates(mechanism, q, name)
            found: np.ndarray = np.linalg.lstsq(columns, there - q, rcond=1e-9)[0]
            return found
        pin.forwardKinematics(mechanism.model, mechanism.data, there)
        moved = mechanism.journal_pose(name)
        xi = np.concatenate([moved.translation, pin.log3(moved.rotation)])
        joint = mechanism.clearance[name]
        return np.where([part in joint.ideal_freedoms for part in RELATIVE], 0.0, xi)

    def _clouds(self, pose: int) -> list[np.ndarray]:
        """The tool's errors in states in which friction holds, of each source of play (m, 3)."""
        parts = [_at(part, pose) for part in self.parts]
        errors: list[np.ndarray | None] = [None] * len(parts)
        anywhere: np.ndarray | None = None
        names = [part.name for part in parts]
        members = [j for j, name in enumerate(names) if name not in self._gears]
        held = any(part.tie is not None for part in parts)
        if not held:
            joints = [self.mechanism.clearance[names[j]] for j in members]
            rough = [self.coefficients[names[j]] for j in members]
            bend = self._bend(pose, [names[j] for j in members])
            found, pressed = _held([parts[j] for j in members], rough, bend)
            unpressed = self.unpressed(pose)
            for j, joint, points, contacts in zip(members, joints, found, pressed, strict=True):
                if contacts is None or unpressed[j]:
                    continue
                if not len(points):  # no friction, and one place of rest only
                    own = self.rest(pose)[0][j : j + 1, :3]
                    errors[j] = None if np.isnan(own).any() else own
                    continue
                points = points + _give(joint, contacts)
                errors[j] = points @ parts[j].move[0, :3].T
        torques = {}
        for j, name in enumerate(names):
            if name in self._gears:
                joint_name = name.removesuffix(GEAR)
                resists = 0.0
                if joint_name in names and not held:
                    i = names.index(joint_name)
                    contacts = pressed[members.index(i)]
                    radius = self.mechanism.clearance[joint_name].half_width
                    if contacts is not None:
                        force = contacts.force.sum(axis=1).max()
                        resists = self.coefficients[joint_name] * radius * float(force)
                torques[j] = resists
        for j, part in enumerate(parts):
            if j in torques:
                half = part.play.reach[1]
                gear = self.mechanism.gears[names[j].removesuffix(GEAR)]
                load = part.load[0, 5]
                ends = np.array([load - torques[j], load + torques[j]])
                angle = half * np.sign(ends) + ends / gear.stiffness
                if ends[0] <= 0.0 <= ends[1]:
                    angle = np.array([-half, half])
                errors[j] = np.outer(angle, part.move[0, :3, 5])
            elif errors[j] is None:  # loops, an own kind, or no load: anywhere within the play
                if anywhere is None:
                    ways = np.vstack([np.eye(3), -np.eye(3), _ways()])
                    anywhere = loop_play.along(parts, ways[None]).error[:, 0, :, :3]
                errors[j] = anywhere[j]
        return [one for one in errors if one is not None]

    def _bend(self, pose: int, names: Sequence[str]) -> np.ndarray:
        """How loads fall with displacements: the energy's curvature, shape (6 j, 6 j)."""
        mechanism, q = self.mechanism, self.q[pose]
        if mechanism.loops:
            return np.zeros((6 * len(names), 6 * len(names)))
        model, data = mechanism.model, mechanism.data
        whole = weight_curvature(model, data, q)
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
            whole = whole + weight_curvature(weight, weight.createData(), q)
        columns = np.hstack([_coordinates(mechanism, q, name) for name in names])
        return np.asarray(columns.T @ whole @ columns)


_DIRECTIONS = 180
"""In which the farthest tool is sought."""


def _ways() -> np.ndarray:
    """Directions evenly over a sphere (Fibonacci lattice), shape (180, 3)."""
    i = np.arange(_DIRECTIONS) + 0.5
    z, phi = 1.0 - 2.0 * i / _DIRECTIONS, i * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - z * z)
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def _at(part: Part, pose: int) -> Part:
    tie = None if part.tie is None else part.tie[pose : pose + 1]
    return replace(part, move=part.move[pose : pose + 1], load=part.load[pose : pose + 1], tie=tie)


def _coordinates(mechanism: Mechanism, q: np.ndarray, name: str) -> np.ndarray:
    """What the displacement of a journal of the tree adds to q, shape (nq, 6)."""
    moved = [displaced_configuration(mechanism, q, {name: _SMALL * xi}) - q for xi in np.eye(6)]
    columns = np.array(moved).T / _SMALL
    columns[np.abs(columns) < 10.0 * _SMALL] = 0.0
    joint = mechanism.clearance[name]
    for k, part in enumerate(RELATIVE):
        if part in joint.ideal_freedoms or part not in joint.freedoms:
            columns[:, k] = 0.0
    return columns


def _held(
    parts: Sequence[Part], rough: Sequence[float], bend: np.ndarray
) -> tuple[list[np.ndarray], list[Pressed | None]]:
    """Displacements (m, 6) of each journal in states in which friction holds it, and contacts.

    Args:
        parts: j sources of play at one pose.
        rough: coefficient of friction of each.
        bend: how their loads fall with their displacements, shape (6 j, 6 j).
    """
    random = np.random.default_rng(0)
    plays = [loop_play.ended(part.play) for part in parts]
    given, points, begun, contacts, rubbing = [], [], [], [], []
    for part, play in zip(parts, plays, strict=True):
        arm = _arm(play)
        size = np.linalg.norm(part.load[0, :3]) + np.linalg.norm(part.load[0, 3:5]) / arm
        noise = random.normal(size=(STATES, 6)) * np.array([1.0] * 3 + [arm] * 3)
        load = part.load + _OPEN * size * noise
        given.append(load)
        begun.append(play.support(noise).point)
        points.append(begun[-1])
        contacts.append(play.pressed(load, play.support(load).point))
        k = 0 if contacts[-1] is None else len(contacts[-1].contact)
        rubbing.append(_directions(k, random))
    loads = [load.copy() for load in given]
    # Half of them follow the load as it turns with the lean, which does not find the states that
    # this leads away from; the others, of loads as they are anywhere, are sorted out below.
    follows = np.arange(STATES) % 2 == 0
    for turn in range(_ROUNDS):
        falls = np.concatenate(points, axis=1) @ bend
        if turn == 0:
            stays = falls
        falls = np.where(follows[:, None], falls, stays)
        for j, play in enumerate(plays):
            now = contacts[j]
            if now is None:
                continue
            load = given[j] - falls[:, 6 * j : 6 * j + 6]
            load += rough[j] * np.einsum("nk,nki,nkid->nd", now.force, rubbing[j], now.across)
            loads[j] = load if turn < _DAMPED else 0.5 * (loads[j] + load)
            points[j] = play.support(loads[j]).point
            contacts[j] = play.pressed(loads[j], points[j])
    falls = np.concatenate(points, axis=1) @ bend
    found: list[Pressed | None] = []
    for j, (part, play) in enumerate(zip(parts, plays, strict=True)):
        now = contacts[j]
        if now is not None:
            kept = _balanced(part.load - falls[:, 6 * j : 6 * j + 6], now, rough[j], _arm(play))
            # None is left if a lean swings between two ends of what is nearly open.
            if not kept.any() and rough[j] > 0.0:
                kept[follows] = True
            points[j] = points[j][kept]
            now = now._replace(force=now.force[kept], normal=now.normal[kept])
        found.append(now)
    return points, found


def _balanced(loads: np.ndarray, contacts: Pressed, rough: float, arm: float) -> np.ndarray:
    """Whether contacts within their cones of friction can balance loads (n, 6), shape (n,)."""
    from scipy.optimize import nnls  # takes long to import

    rows = list(contacts.borne)
    weight = np.array([1.0] * 3 + [1.0 / arm] * 3)[rows]
    cones = contacts.normal[:, :, None] + rough * np.einsum(
        "ci,nkid->nkcd", _CORNERS if rough > 0.0 else np.zeros((1, 2)), contacts.across
    )
    right = loads[:, rows] * weight
    size = np.maximum(np.linalg.norm(right, axis=1), 1e-300)
    good = np.zeros(len(loads), bool)
    for i, touching in enumerate(contacts.touching):
        if not touching.any():
            continue
        columns = cones[i, touching]
        patches = contacts.patch[i, touching]
        if patches.any():
            # Anywhere within a square around the face.
            places = np.sqrt(2.0) * np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
            spread = np.repeat(columns[:, None], len(places), axis=1)
            shifted = np.cross(
                patches[:, None, None] * places, contacts.normal[i, touching, None, :3]
            )
            spread[..., 3:] += shifted[:, :, None]
            columns = spread
        matrix = -(columns.reshape(-1, 6)[:, rows] * weight).T
        good[i] = nnls(matrix, right[i])[1] <= (_BALANCED * rough + _EXACT) * size[i]
    return good


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


def _give(joint: Clearance, contacts: Pressed) -> np.ndarray:
    """How far journals go on because their contacts give way, (m, 6)."""
    deep = np.zeros_like(contacts.force)
    for k, contact in enumerate(contacts.contact):
        if contact < len(joint.contacts):
            deep[:, k] = depths(joint, contact, contacts.force[:, k])
    rows = np.where((contacts.force > 0.0)[:, :, None], -contacts.normal, 0.0)
    reach = joint.half_width
    weight = np.array([1.0] * 3 + [1.0 / reach] * 3)
    inverse = np.linalg.pinv(rows * weight, rcond=1e-6)
    given: np.ndarray = (inverse @ deep[..., None])[..., 0] * weight
    return given
