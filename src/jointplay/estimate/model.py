"""The quasi-static model: where play lets the tool be, and what the drives feel, at each visit.

There is no time loop: inertia counts as a load. At each visit

1. loads and levers of all joints follow from gravity, inertia and the force on the tool
   (`_statics`);
2. each journal lies where its load pushes it (`loaded_bearings`);
3. each joint with a gear, or with dry friction, winds up, by the way it came there (`windup`);
4. springs and seats give way by their load;
5. the tool moves by the sum of all, through the levers; drives feel the load and the friction.

Joints, links and the structure at the tool are elastic: the tool moves by what they give way in
proportion to their load, too. Those compliances enter linearly and are nuisances beside the model
(`Elastic`), unless they are given. Compliances of springs, seats and gears are unknowns with an
expected value.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin
from scipy.ndimage import uniform_filter1d

from jointplay.accuracy.error_model import play_model
from jointplay.accuracy.jacobians import place, tool_place
from jointplay.accuracy.poses import moving
from jointplay.estimate.columns import Key
from jointplay.estimate.loaded_bearings import (
    HELD_OFF_SHARE,
    LOAD_ERROR,
    LoadedBearing,
    LoadedRollingBearing,
)
from jointplay.estimate.machine import TOOL, Machine
from jointplay.estimate.parts import NEGLIGIBLE, SPRINGS, WOUND, Teeth, friction_of
from jointplay.estimate.unknowns import EXPECTATION_FACTOR, MINOR, MODEL_ERROR, Unknown
from jointplay.estimate.visits import (
    STOP_S,
    Visits,
    configurations,
    signal_effect,
    stacked,
    tool_effect,
)
from jointplay.estimate.windup import TwistLaw, wound_up
from jointplay.model.gear import Curve, Gear
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import RollingBearing
from jointplay.simulation.loads.drive import JointFriction
from jointplay.simulation.result.result import AXES

_AXES = {way: list(at) for way, at in SPRINGS.items()}
_AXES |= {"link": _AXES["torsional"], "bush": _AXES["radial"]}
"""Components of a joint's load and displacement in bearing axes, by the way in which it gives way
(`machine.WAYS`)."""
_CAGE_WANDER = 0.1
"""Part of the difference between places of a cage that is left, for cages slip: judged. From 0.05
to 0.2 the same is told of 11 machines of benchmarks/truth/identify.py."""
_FRICTION_FACTOR, _STICTION_RATIO = 2.5, 1.4
"""Factor by which friction behind a gear may be wrong, and static by dynamic friction: judged. With
a factor of 3, 24 of 115 machines of benchmarks/truth/identify.py lose visits: two values fewer are
told, and two miss the truth, else one. With a ratio from 1.2 to 1.6 the same is told of 11."""


@dataclass(frozen=True)
class Elastic:
    """Effect of compliances of one label, which enter linearly, on the signals."""

    label: str
    """``elbow torsional``, ``tool``."""
    unknown: Unknown
    effect: np.ndarray
    """Change of the signals by a compliance of one, shape (n, keys, c): c is one for a joint, six
    for the structure at the tool (a symmetric matrix in its axes)."""


class StaticModel:
    """Predictions of the signals of a mechanism with play at visits.

    Args:
        machine: a tree, and what is known of its friction and compliances.
        visits: n of them.
        keys: signals that are predicted.
        unknowns: parameters of `predict`.

    Attributes:
        certain: visits at which the sides of all gears, and of all rims, are known, shape (n,).
        elastic: compliances that are not given exactly; what is given of them is in `predict`.
        softening: factors of compliance under the load of each bearing, by its joint's name, see
            `LoadedBearing.softening`, (n,).
        levers: displacement of the tool by one of a joint, by its name, (n, 3, 6).
        wander: standard deviation of the signals by cages that slip, (n, keys).

    Raises:
        JointplayError: loops; see `error_model.play_model`.
    """

    def __init__(
        self, machine: Machine, visits: Visits, keys: tuple[Key, ...], unknowns: tuple[Unknown, ...]
    ) -> None:
        self.machine, self.mechanism = machine, machine.mechanism
        self.visits, self.keys, self.unknowns = visits, keys, unknowns
        mechanism = self.mechanism
        q = configurations(mechanism, visits.joints, visits.position)
        play_model(mechanism, q[:0], second_order=False)  # refuses what this model does not know
        slides = {name: mechanism.description.joints[name].slides for name in moving(mechanism)}
        names = dict.fromkeys([*mechanism.clearance, *mechanism.gears, *slides])
        rates = visits.speed, visits.acceleration
        unpushed, inertia, self.levers, tool = _statics(mechanism, visits.joints, q, rates, names)
        loads = {
            name: unpushed[name] + np.einsum("nki,nk->ni", lever, visits.force)
            for name, lever in self.levers.items()
        }
        self._bearings: dict[str, LoadedBearing] = {}
        for name, joint in mechanism.clearance.items():
            rolling = isinstance(joint, RollingBearing)
            kind: type[LoadedBearing] = LoadedRollingBearing if rolling else LoadedBearing
            levers, load = self.levers[name], loads[name]
            self._bearings[name] = kind(name, joint, levers, load, inertia[name], visits)
        # Differences move one joint at a time: the others' displacements and lags stay.
        self._point = lru_cache(lambda name, kept, *v: self._bearings[name].point(dict(v), kept))
        self._lag = lru_cache(lambda name, *values: self._wound(name, dict(values)))
        self._springs = {
            name: {
                way: np.einsum("nki,ni->nk", self.levers[name], moved) / part.compliances[way]
                for way, moved in part.sunk(loads[name]).items()
            }
            for name, part in machine.springs.items()
        }
        """Displacement of the tool by a compliance of one of springs, by joint and way, (n, 3)."""
        self._gives: dict[str, float] = {}
        """Compliance of each joint that winds up, unless it is unknown [rad/(N m)]."""
        for name in machine.wound:
            gear = mechanism.gears.get(name)
            usual = 0.0 if gear is None else 1.0 / Teeth(name, gear).stiffness[0]
            self._gives[name] = self._stated(f"{name} torsional", usual)
        driven = dict.fromkeys([*machine.wound, *(name for kind, name in keys if kind == "torque")])
        about = {name: 2 if slides.get(name, False) else 5 for name in driven}
        self._inertia = {name: -inertia[name][:, axis] for name, axis in about.items()}
        self._hold = {name: -unpushed[name][:, axis] for name, axis in about.items()}
        """Torque that holds weight and inertia, without forces on the tool, (n,) [N m or N]."""
        self._arms = {name: self.levers[name][:, :, axis] for name, axis in about.items()}
        """Displacement of the tool by a turn of the joint, arm of forces on it, (n, 3)."""
        self.wander = np.zeros((len(visits), len(keys)))
        for bearing in self._bearings.values():
            if isinstance(bearing, LoadedRollingBearing):
                moved = np.einsum("nij,nj->ni", bearing.levers**2, bearing.wander() ** 2)
                self.wander = np.hypot(
                    self.wander, tool_effect(keys, _CAGE_WANDER * np.sqrt(moved))
                )
        sought = {unknown.joint for unknown in unknowns if unknown.name == "hysteresis"}
        remembers = [
            name for name, gear in mechanism.gears.items()
            if name in sought or gear.bristles[0] > 0.0
        ]  # fmt: skip
        self._path_hold = self._on_the_path(remembers)
        self.softening = {name: bearing.softening() for name, bearing in self._bearings.items()}
        elastic = self._elastic(loads, tool)
        self._given = np.zeros((len(visits), len(keys)))
        """Effect of given compliances on the signals."""
        for soft in elastic:
            if soft.unknown.nominal:  # the structure's: the same in all directions
                self._given += soft.unknown.nominal * soft.effect[:, :, :3].sum(axis=2)
        self.elastic = tuple(soft for soft in elastic if soft.unknown.spread > 0.0)
        self.certain = self._sides(
            np.array(
                [
                    (EXPECTATION_FACTOR if u.name == "gear_play" else 1.0) * u.nominal
                    for u in unknowns
                ]
            )
        )

    def _stated(self, label: str, usual: float) -> float:
        """The given compliance of a label; the scenario's `usual` one where none is given."""
        stated = self.machine.compliance(label)
        return usual if math.isinf(stated.spread) else stated.nominal

    def _on_the_path(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Torque that the load asks of gears along the whole path, (m,) [N m].

        Bristles remember how far loads went between visits.
        """
        if not names:
            return {}
        visits = self.visits
        speed = acceleration = np.zeros_like(visits.path)
        if visits.path_time is not None:
            time, width = visits.path_time, STOP_S / float(np.median(np.diff(visits.path_time)))
            smooth = visits.path
            for _ in range(2):  # twice: encoders have steps
                smooth = uniform_filter1d(smooth, max(int(width), 1), axis=0, mode="nearest")
            speed = np.gradient(smooth, time, axis=0)
            acceleration = np.gradient(speed, time, axis=0)
        q = configurations(self.mechanism, visits.joints, visits.path)
        unpushed, _, levers, _ = _statics(
            self.mechanism, visits.joints, q, (speed, acceleration), dict.fromkeys(names)
        )
        return {
            name: -unpushed[name][:, 5]
            - np.einsum("mk,mk->m", levers[name][:, :, 5], visits.path_force)
            for name in names
        }

    def _elastic(self, loads: Mapping[str, np.ndarray], tool: np.ndarray) -> list[Elastic]:
        """Compliances of each joint, and of the structure at the tool (rotations (n, 3, 3))."""
        elastic = []
        for name, load in loads.items():
            for way, axes in _AXES.items():
                if (way == "link") != (name in self._gives) and axes == [5]:
                    continue  # a joint that winds up has "link", any other "torsional"
                if way in self._springs.get(name, ()):
                    continue  # an unknown
                part = load[:, axes]
                if way == "bush":
                    if name not in self._bearings or not friction_of(self._bearings[name].joint):
                        continue
                    part = self._bearings[name].turned_load()
                if way == "torsional" and name in self._bearings:
                    part = part - self._bearings[name].drag()[:, None]
                moved = np.einsum("nki,ni->nk", self.levers[name][:, :, axes], part)
                label, effect = f"{name} {way}", tool_effect(self.keys, moved)[:, :, None]
                elastic.append(Elastic(label, self.machine.compliance(label), effect))
        # The structure at the tool: a symmetric matrix C in its axes moves it by C times the force.
        force = np.einsum("nki,nk->ni", tool, self.visits.force)
        columns = []
        for i, k in ((0, 0), (1, 1), (2, 2), (0, 1), (1, 2), (2, 0)):
            part = np.zeros_like(force)
            part[:, i] += force[:, k]
            if i != k:
                part[:, k] += force[:, i]
            columns.append(tool_effect(self.keys, np.einsum("nki,ni->nk", tool, part)))
        elastic.append(Elastic(TOOL, self.machine.compliance(TOOL), np.stack(columns, axis=2)))
        return elastic

    def predict(self, theta: np.ndarray) -> np.ndarray:
        """Means of the signals at all visits, shape (n, keys) [m, rad, N m]."""
        values, kept = self._values(theta)
        means = self._given.copy()
        tool = np.zeros((len(self.visits), 3))
        for name, bearing in self._bearings.items():
            point = self._point(name, kept, *values.get(name, {}).items())
            tool += np.einsum("nij,nj->ni", bearing.levers, point)
        for name, ways in self._springs.items():
            for way, moved in ways.items():
                usual = self._stated(f"{name} {way}", self.machine.springs[name].compliances[way])
                tool += values.get(name, {}).get(f"{way}_compliance", usual) * moved
        lags = {name: self._lag(name, *values.get(name, {}).items()) for name in self._gives}
        for name, (twist, _, _) in lags.items():
            tool += self._arms[name] * twist[:, None]
        for column, (kind, name) in enumerate(self.keys):
            if kind == "tool":
                means[:, column] += tool[:, AXES.index(name)]
            elif kind == "link":
                means[:, column] = lags[name][0]
            elif name in lags:
                means[:, column] = lags[name][1]
            else:  # of a drive without gear on a joint that moves
                at, viscous = self.visits.joints.index(name), self._friction(name).viscous
                torque = self._hold[name] - np.einsum(
                    "nk,nk->n", self._arms[name], self.visits.force
                )
                dry = self._dry(name, values.get(name, {}))
                torque = torque + dry * self.visits.direction[:, at]
                means[:, column] = torque + viscous * self.visits.speed[:, at]
        return means

    def turned(
        self, joint: str, theta: np.ndarray
    ) -> tuple[np.ndarray, str, tuple[np.ndarray, str, str], np.ndarray]:
        """Deviation of one joint with play, for its `Loop`.

        Returns:
            Its twist or, of a bearing alone, its displacement of the tool along the way it mostly
            goes, shape (n,), and the unit; what that is drawn over, its torque or position, with
            name and unit; change of the signals by a deviation of one, shape (n, keys).
        """
        values, kept = self._values(theta)
        parameters, entry = values.get(joint, {}), self.mechanism.description.joints.get(joint)
        slides = entry is not None and entry.slides
        over = np.zeros(len(self.visits)), "position", "m" if slides else "rad"
        if joint in self.visits.joints:
            column = self.visits.joints.index(joint)
            over = self.visits.position[:, column], *over[1:]
        if joint in self._gives:
            twist, torque, _ = self._lag(joint, *parameters.items())
            effect = tool_effect(self.keys, self._arms[joint])
            if ("link", joint) in self.keys:
                effect += signal_effect(self.keys, ("link", joint), np.ones(len(twist)))
            # Where pushes, not only the direction of motion, decide the torque, it shows the loop.
            directions = self.visits.direction[:, column]
            alike = max(np.ptp(torque[directions == axis]) for axis in np.unique(directions))
            if alike > MINOR * np.ptp(torque) or not np.ptp(over[0]):
                over = torque, "torque", "N" if slides else "N*m"
            return twist, "m" if slides else "rad", over, effect
        bearing, point = self._bearings[joint], self._point(joint, kept, *parameters.items())
        moved = np.einsum("nij,nj->ni", bearing.levers, point)
        axis = np.linalg.svd(moved, full_matrices=False)[2][0]
        effect = tool_effect(self.keys, np.tile(axis, (len(moved), 1)))
        return moved @ axis, "m", over, effect

    def loose(self) -> np.ndarray:
        """Displacements that friction may hold anywhere, as nuisances, (n, keys, columns).

        A journal that does not turn stays along its axis where friction holds it, and one that
        turns creeps along it as fast as the load along the axis is large beside those across: the
        place along each axis with end walls is a column at each stop, unless the load along the
        axis exceeds all others, and at each other visit, if it is less than `MODEL_ERROR` of them.
        """
        columns = []
        for bearing in self._bearings.values():
            if not bearing.has_end_walls:
                continue
            enough = np.where(self.visits.stopped, 1.0, MODEL_ERROR) * 2.0 * bearing.rim_force
            for i in np.flatnonzero(np.abs(bearing.load[:, 2]) <= enough):
                moved = np.zeros((len(self.visits), 3))
                moved[i] = bearing.levers[i, :, 2]
                columns.append(tool_effect(self.keys, moved))
        return stacked(columns, len(self.visits), self.keys)

    def reverses(self, joint: str) -> bool:
        """Whether a bearing's load across, or its tilting moment, reverses at some place."""
        load = self._bearings[joint].load
        for loads in (load[:, :2], load[:, 3:5]):
            size = np.linalg.norm(loads, axis=1)
            strong = size > HELD_OFF_SHARE * size.max(initial=0.0)
            for cell in np.unique(self.visits.cell[strong]):
                at_place = loads[strong & (self.visits.cell == cell)]
                if (at_place @ at_place.T < 0.0).any():
                    return True
        return False

    def most_torque(self, joint: str) -> float:
        """Largest torque that a joint which winds up transmits, without friction [N m]."""
        pushed = np.einsum("nk,nk->n", self._arms[joint], self.visits.force)
        return float(np.abs(self._hold[joint] - pushed).max(initial=0.0))

    def _values(self, theta: np.ndarray) -> tuple[dict[str, dict[str, float]], float]:
        """Values of the unknowns by joint and name, and the part of friction kept at stops."""
        values: dict[str, dict[str, float]] = {}
        kept = 0.0
        for unknown, value in zip(self.unknowns, theta, strict=True):
            if unknown.joint:
                values.setdefault(unknown.joint, {})[unknown.name] = float(value)
            else:
                kept = float(value)
        return values, kept

    def _dry(self, name: str, parameters: Mapping[str, float]) -> np.ndarray:
        """Friction about a joint's axis while it slides, (n,) [N m]."""
        dry = parameters.get("dry_friction", self._friction(name).coulomb)
        friction = np.full(len(self.visits), float(dry))
        if name in self._bearings:
            friction += self._bearings[name].torque(parameters.get("friction"))
        return friction

    def _friction(self, name: str) -> JointFriction:
        return self.machine.friction.get(name, JointFriction())

    def _wound(
        self,
        name: str,
        parameters: Mapping[str, float],
        extra: np.ndarray | float = 0.0,
        rigid: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Wind-up of a joint (`windup.wound_up`), as means over the visits.

        Args:
            name: of the joint.
            parameters: values of the joint's unknowns, by name.
            extra: torque that is added to the load, shape (n,) [N m].
            rigid: whether there is nothing but play.

        Returns:
            Twist, link less motor [rad]; torque of the gear [N m]; part of the visit in which both
            are known; (n,) each.
        """
        visits, gear = self.visits, self.mechanism.gears.get(name)
        near, column, friction = visits.path_near, visits.joints.index(name), self._friction(name)
        dry = self._dry(name, parameters)[near]
        if name in self._path_hold:
            hold = self._path_hold[name] + (extra + np.zeros(len(visits)))[near]
        else:
            external = np.einsum("mk,mk->m", self._arms[name][near], visits.path_force)
            hold = (self._hold[name] + extra)[near] - external
        hold = hold + friction.viscous * visits.speed[near, column]
        motor = visits.path[:, column]
        error = 0.0 if gear is None else gear.kinematic_error(motor)[0]
        expected = 1.0 + friction.excess / friction.coulomb if friction.coulomb else 1.0
        stiction = max(parameters.get("stiction", expected), 1.0)
        halts = np.diff(visits.stopped[near].astype(int), prepend=0) > 0
        law = self._law(name, parameters, rigid)
        twist, torque, sure = wound_up(motor, error, hold, dry, stiction, law, halts)
        return visits_mean(visits, twist), visits_mean(visits, torque), visits_mean(visits, sure)

    def _law(self, name: str, parameters: Mapping[str, float], rigid: bool) -> TwistLaw:
        """Torque of a joint that winds up by its twist, at values of its unknowns."""
        gear = self.mechanism.gears.get(name)
        give = next(
            (parameters[compliance] for compliance in WOUND if compliance in parameters),
            self._gives[name],
        )
        if gear is None or rigid:
            half = 0.0 if gear is None else 0.5 * parameters.get("gear_play", gear.play)
            give = NEGLIGIBLE if rigid else max(give, NEGLIGIBLE)
            return TwistLaw(half, Curve.of([(1.0 / give, math.inf)]))
        teeth = Teeth(name, gear).holding({"gear_compliance": self._gives[name], **parameters})
        return TwistLaw(0.5 * teeth.play, teeth.curve(), *teeth.bristles)

    def _sides(self, theta: np.ndarray) -> np.ndarray:
        """Visits at which it is known on which side all journals and teeth lie, (n,)."""
        values, _ = self._values(theta)
        determined = (bearing.determined for bearing in self._bearings.values())
        sure = np.all([np.ones(len(self.visits)), *determined], 0)
        for name in self._gives:
            parameters = values.get(name, {})
            sure &= self._wound(name, parameters)[2] == 1.0
            gear = self.mechanism.gears.get(name)
            if gear is not None and (gear.play or isinstance(gear, Gear)):
                sure &= self._one_side(name, parameters)
        return sure

    def _one_side(self, name: str, values: Mapping[str, float]) -> np.ndarray:
        """Visits at which it is known on which side the teeth of a gear lie, (n,).

        Whatever the friction is, within a factor, and whether or not inertia and what a load may be
        off count: the twist of a gear with nothing but play must be the same.
        """
        parameters = dict(values)
        half = parameters["gear_play"] = self.mechanism.gears[name].play or NEGLIGIBLE
        hold, twists = self._hold[name], []
        torque = hold - np.einsum("nk,nk->n", self._arms[name], self.visits.force)
        off = LOAD_ERROR * np.abs(torque).max(initial=0.0) * np.ones(len(hold))
        friction = parameters.get("dry_friction", self._friction(name).coulomb)
        for extra in (0.0 * off, off, -off, -self._inertia[name]):
            for factor in (1.0, _FRICTION_FACTOR, 1.0 / _FRICTION_FACTOR):
                for ratio in (1.0, _STICTION_RATIO):
                    parameters |= {"dry_friction": factor * friction, "stiction": ratio}
                    twists.append(self._wound(name, parameters, extra, rigid=True)[0])
        return np.ptp(twists, axis=0) <= MODEL_ERROR * half


def visits_mean(visits: Visits, values: np.ndarray) -> np.ndarray:
    """Means over the points of the path that belong to each visit, shape (n,)."""
    within = visits.path_visit >= 0
    at = visits.path_visit[within]
    count = np.bincount(at, minlength=len(visits))
    total = np.bincount(at, np.asarray(values, float)[within], minlength=len(visits))
    return np.asarray(total / np.maximum(count, 1))


def _statics(
    mechanism: Mechanism,
    moved: Sequence[str],
    q: np.ndarray,
    rates: tuple[np.ndarray, np.ndarray],
    names: Mapping[str, None],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Loads and levers of joints in bearing axes about their centres, z their axes.

    Args:
        mechanism: whose.
        moved: joints that move, j of them.
        q: n configurations, shape (n, nq).
        rates: speeds and accelerations of the moving joints, shape (n, j) each.
        names: joints that are asked for.

    Returns:
        Loads of gravity and inertia by joint, (n, 6) [N, N m]; of these the part of inertia;
        displacement of the tool in world axes by one of the joint, (n, 3, 6); rotations of the
        tool's axes, (n, 3, 3).
    """
    model, data = mechanism.model, mechanism.data
    at = [mechanism.coordinate(name) for name in moved]
    loads = {name: np.zeros((len(q), 6)) for name in names}
    still = {name: np.zeros((len(q), 6)) for name in names}
    levers = {name: np.zeros((len(q), 3, 6)) for name in names}
    tools = np.zeros((len(q), 3, 3))
    carried = model.supports[model.frames[mechanism.tool_frame].parentJoint]
    for i, row in enumerate(q):
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        pin.computeJointJacobians(model, data, row)
        tool = tool_place(mechanism, row)
        tools[i] = tool.rotation
        joints = {name: place(mechanism, name) for name in names}
        for table in (still, loads):  # at rest first, then with speeds and accelerations
            pin.rnea(model, data, row, v, a)
            for name, (index, axes) in joints.items():
                back = -axes.rotation.T @ data.oMi[index].rotation
                wrench = data.f[index]
                table[name][i, :3], table[name][i, 3:] = back @ wrench.linear, back @ wrench.angular
            v[at], a[at] = rates[0][i], rates[1][i]
        for name, (index, axes) in joints.items():
            if index in carried:
                levers[name][i, :, :3] = axes.rotation
                arm = tool.translation - axes.translation
                levers[name][i, :, 3:] = np.cross(axes.rotation.T, arm).T
    inertia = {name: loads[name] - still[name] for name in names}
    return loads, inertia, levers, tools
