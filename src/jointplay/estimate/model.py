"""The quasi-static model: where play lets the tool be, and what the drives feel, at each visit.

A journal lies where its load pushes it, turned about the axis by the angle of friction against its
motion: with the load F and friction mu, the contact force balances F at the azimuth of F less
atan(mu) in the sense of rotation. Its displacement is the point at which the play's support
function is attained (`Play.support`), so that it is exact in the first order of the clearance;
contacts give way by what their law says of the load. A gear's link is held by friction until its
teeth push harder: the play operator of M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with
Hysteresis (1989), with the load's torque, and the bristles of gears with hysteresis remember the
twists they came by (`kernel.gear`). The inner ring of a rolling bearing comes to rest among its
elements (`RollingBearing.rests`). Inertia counts as a load. There is no time loop.

Joints and the structure at the tool are elastic: by what they give way in proportion to their load
the tool moves, too. Those compliances enter linearly and are columns (`elastic`) beside the
model, unless they are given. Those of springs and seats are unknowns with an expected value. A
joint with dry friction winds up: the operator without play.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
import pinocchio as pin
from scipy.ndimage import uniform_filter1d

from jointplay.accuracy.error_model import play_model
from jointplay.accuracy.jacobians import place, tool_place
from jointplay.accuracy.poses import moving
from jointplay.base.compiler import compiled
from jointplay.estimate.machine import TOOL, Machine
from jointplay.estimate.measurement import (
    STOP_S,
    Key,
    Visits,
    configurations,
    signal_effect,
    stacked,
    tool_effect,
)
from jointplay.estimate.parts import (
    NONE,
    SPRINGS,
    WOUND,
    Elements,
    Journal,
    Teeth,
    friction_of,
)
from jointplay.estimate.unknowns import MINOR, MISJUDGED, MODEL_ERROR, TINY, Unknown
from jointplay.model.gear import Curve, Gear
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.physics.joints.play import BallPlay, JournalPlay
from jointplay.simulation.loads.drive import JointFriction
from jointplay.simulation.result.result import AXES
from jointplay.simulation.statics import depths

_AXES = {way: list(at) for way, at in SPRINGS.items()}
_AXES |= {"link": _AXES["torsional"], "bush": _AXES["radial"]}
"""Components of a joint's load and displacement in bearing axes."""
_LINE_CONTACT = 0.9
"""Exponent of the load by which contacts of lines give way (Palmgren's of rollers), those of points
by 2/3; the compliances here give way in proportion to it."""
_FORGOTTEN = 0.05
"""Part of what bristles were bent by in the beginning that may be left where they count as known:
after three of their angles, exp(-3) (judged: with 0.02 fewer visits count in 6 of 53 machines with
parts of benchmarks/truth/identify.py; one value fewer is told)."""
_CAGES = 6
"""Places of a cage between one element and the next that are looked at."""
_CAGE_WANDER = 0.1
"""Part of what these differ by that is left, for cages slip: judged."""
_HALVINGS = int(np.finfo(float).nmant)
"""In which the twist of a gear with bristles is found: bits of a number."""
_AXIAL_FRICTION = 0.1
"""Coefficient of the friction along the axis that may hold a journal's lean where it is: of greased
steel and bronze."""
_LOAD_ERROR, _MOMENT_ERROR = 0.015, 0.04
"""Part of a joint's largest load by which the model of its loads may be off, and of moments that
tilt a rolling bearing, which change while a place is passed: judged. With 0.02 for both, one of the
first three machines of benchmarks/truth/identify.py is not told its play."""
_HELD_OFF = 0.35
"""Part of the clearance by which rims may be held off the place where the load would push them, and
of the other rim's force below which a rim may lie anywhere (judged: with 0.3 of the force nothing
changes in 103 machines of benchmarks/truth/identify.py)."""
_FRICTION_FACTOR, _STICTION_RATIO = 2.5, 1.4
"""Factor by which friction behind a gear may be wrong, and static by dynamic friction: judged. With
a factor of 3, 24 of 115 machines of benchmarks/truth/identify.py lose visits: two values fewer are
told, and two miss the truth, else one."""


@dataclass(frozen=True)
class Elastic:
    """How signals answer to compliances of one label that nobody knows exactly."""

    label: str
    """``elbow torsional``, ``tool``."""
    unknown: Unknown
    effect: np.ndarray
    """By a compliance of one, shape (n, keys, c): one for a joint, six for the structure at the
    tool (a symmetric matrix in its axes)."""


class _Bearing:
    """A joint with clearance at n visits."""

    def __init__(
        self,
        name: str,
        joint: Clearance,
        move: np.ndarray,
        load: np.ndarray,
        inertia: np.ndarray,
        visits: Visits,
    ) -> None:
        """How displacements move the tool (n, 3, 6), the load (n, 6) and its inertial part."""
        self.joint, self.move, self.load, hinge = joint, move, load, joint.hinge
        leaning = hinge if hinge is not None and hinge.tilts else None
        self.sure = _determined(joint, load, inertia)
        """Whether the load determines where the journal lies, (n,)."""
        if leaning is None:
            self.push = np.linalg.norm(load[:, :2], axis=1) / 2.0
            """Force of a rim, mean of both, (n,) [N]."""
            self.rim = 2.0 * self.push
            """Force of a radial contact (n,) [N]."""
        else:
            rims = [np.linalg.norm(rim, axis=1) for rim in _rims(load, leaning.length)]
            self.rim = self.push = np.mean(rims, axis=0)
            self.sure &= np.min(rims, axis=0) >= _HELD_OFF * np.max(rims, axis=0)
        speed = way = np.zeros(len(visits))
        if name in visits.joints:
            column = visits.joints.index(name)
            speed, way = visits.speed[:, column], visits.direction[:, column]
        self.slips = hinge is not None and hinge.axial > 0.0
        """Whether the journal can move along its axis, to end walls."""
        part: np.ndarray | float = 1.0
        if self.slips and leaning is not None:
            part = _against(load, self.push, leaning.length)
        sliding = _sliding_part(joint, speed) * np.sign(speed)
        self.slides = np.where(visits.stopped, 0.0, sliding) * part
        """Part of the full friction by sliding speed, signed, moving visits only (n,)."""
        self.stuck = np.where(visits.stopped, way, 0.0) * part
        """Sense of rotation before the stop, stopped visits only (n,)."""

    def point(self, values: Mapping[str, float], held: float) -> np.ndarray:
        """Displacement of the journal at each visit, (n, 6) [m, rad]."""
        sizes = {name: value for name, value in values.items() if name in self.joint.clearances}
        joint = Journal("", self.joint).holding(sizes)
        play = joint.play(second_order=False)
        point = play.support(self.load).point
        if isinstance(play, JournalPlay | BallPlay):
            deeper = 1.0 + depths(joint, 0, self.rim) / joint.radial_travel
            point[:, _AXES["radial"] + _AXES["tilt"]] *= deeper[:, None]
        friction = values.get("friction")
        if friction is None:
            friction = friction_of(self.joint) or 0.0
        angle = -np.arctan(friction * (self.slides + held * self.stuck))
        return _turned(point, -angle if self.joint.exchanged else angle)

    def drag(self) -> np.ndarray:
        """Torque about the axis by the expected friction, against the motion, (n,) [N m].

        At stops half of it stays. It winds the joint up by 2 mu R_i / L of what a push with the
        lever L does, so that the expected value will do.
        """
        return self.torque(None) * (self.slides + 0.5 * self.stuck)

    def aside(self) -> np.ndarray:
        """Load that friction turns out of its direction, by the expected friction, (n, 2) [N].

        A bush gives way along the contact's normal, which friction turns as it turns the journal's
        place: aside in proportion to the load, where the clearance alone does by the same at all.
        """
        angle = np.arctan(friction_of(self.joint) or 0.0) * (self.slides + 0.5 * self.stuck)
        angle = angle if self.joint.exchanged else -angle
        return np.asarray(_turned(self.load, angle) - self.load)[:, :2]

    def softening(self) -> np.ndarray:
        """How a contact of lines gives way beside one that gives way in proportion to its load,
        as a factor, one at the largest load, (n,)."""
        size = np.linalg.norm(self.load[:, :2], axis=1)
        part = size / max(float(size.max(initial=0.0)), TINY)
        return np.where(part > 0.0, np.maximum(part, TINY) ** (_LINE_CONTACT - 1.0), 0.0)

    def torque(self, friction: float | None) -> np.ndarray:
        """Of the rims' friction about the axis, its size while sliding, (n,) [N m]."""
        coefficient = friction_of(self.joint) or 0.0 if friction is None else friction
        radius = 0.0 if self.joint.hinge is None else self.joint.hinge.radius
        return np.asarray(2.0 * self.push * radius * coefficient / np.hypot(1.0, coefficient))


class _Rolling(_Bearing):
    """A rolling bearing at n visits: no friction across, and a little about its axis."""

    joint: RollingBearing

    def __init__(
        self,
        name: str,
        joint: RollingBearing,
        move: np.ndarray,
        load: np.ndarray,
        inertia: np.ndarray,
        visits: Visits,
    ) -> None:
        self.joint, self.move, self.load = joint, move, load
        self.elements = Elements(name, replace(joint, seat=None))
        self.side = -1.0 if joint.exchanged else 1.0
        """Of the outer ring, in whose axes it rests: the link's displacement is the inner one's."""
        turned = np.zeros(len(visits))
        if name in visits.joints:
            turned = visits.position[:, visits.joints.index(name)]
        self.cage = self.side * joint.cage_ratio * turned
        self.push = self.rim = np.linalg.norm(load[:, :2], axis=1) / 2.0
        self.slips = joint.has_play and bool(joint.hinge.axial > 0.0)
        self.slides = self.stuck = np.zeros(len(visits))
        undisturbed, determined = self._rests({}, load)
        across = np.linalg.norm(load[:, :3], axis=1)
        self.sure = determined & (across > 0.0)
        force = _LOAD_ERROR * across.max(initial=0.0)
        moment = _MOMENT_ERROR * np.linalg.norm(load[:, 3:5], axis=1).max(initial=0.0)
        small = np.array([force, force, 0.0, moment, moment, 0.0])
        room = np.linalg.norm(undisturbed[:, [[0, 1], [3, 4]]], axis=2).max(axis=0, initial=0.0)
        free = np.array([joint.travel["x"] or np.inf, joint.travel["roll"] or np.inf])
        free = np.maximum(free, room)
        for disturbance in (*np.diag(small)[[0, 1, 3, 4]], inertia):
            for way in (1.0, -1.0):
                off = self._rests({}, load + way * disturbance)[0] - undisturbed
                by = np.linalg.norm(off[:, [[0, 1], [3, 4]]], axis=2)
                self.sure &= (by <= _HELD_OFF * free).all(axis=1)

    def _rests(
        self, values: Mapping[str, float], load: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Displacements under loads (n, 6), and whether they are told (n,)."""
        begin = values.get("cage_angle", self.joint.cage_angle)
        rested = self.elements.holding(values).rests(self.side * load, begin + self.cage)
        return self.side * rested[0], rested[1]

    def point(self, values: Mapping[str, float], held: float) -> np.ndarray:
        return self._rests(values, self.load)[0]

    def wander(self) -> np.ndarray:
        """Spread of the displacement over places of the cage, which slips, (n, 6) [m, rad]."""
        turns = self.elements.period * np.arange(_CAGES) / _CAGES
        points = [self._rests({"cage_angle": turn}, self.load)[0] for turn in turns]
        return np.std(points, axis=0)

    def torque(self, friction: float | None) -> np.ndarray:
        return np.full(len(self.load), self.joint.drag)

    def drag(self) -> np.ndarray:
        return np.zeros(len(self.load))


def _turned(points: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Displacements and leans turned about z, (n, 6)."""
    c, s = np.cos(angle), np.sin(angle)
    rotated = points.copy()
    for x, y in ((0, 1), (3, 4)):
        rotated[:, x] = c * points[:, x] - s * points[:, y]
        rotated[:, y] = s * points[:, x] + c * points[:, y]
    return rotated


class StaticModel:
    """What a mechanism with play shows at visits.

    Args:
        machine: a tree, and what is known of its friction and compliances.
        visits: n of them.
        keys: signals that are predicted.
        unknowns: what `predict` is given.

    Attributes:
        certain: visits at which the sides of all gears, and of all rims, are known, shape (n,).
        elastic: effects of compliances; what is given of them is in `predict`.
        softening: of each bearing, see `_Bearing.softening`, by its joint's name, (n,).
        levers: how displacements of a joint move the tool, by its name, (n, 3, 6).
        wander: by how much cages that slip move the tool, as a standard deviation, (n, keys).

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
        gravity, inertia, self.levers, tool = _statics(mechanism, visits.joints, q, rates, names)
        loads = {
            name: gravity[name] + np.einsum("nki,nk->ni", lever, visits.force)
            for name, lever in self.levers.items()
        }
        self._bearings = {
            name: (_Rolling if isinstance(joint, RollingBearing) else _Bearing)(
                name,
                joint,
                self.levers[name],
                loads[name],
                inertia[name],
                visits,  # type: ignore[arg-type]
            )
            for name, joint in mechanism.clearance.items()
        }
        # Differences move one joint at a time: the others' displacements and lags stay.
        self._point = lru_cache(lambda name, held, *v: self._bearings[name].point(dict(v), held))
        self._lag = lru_cache(lambda name, *values: self._wound(name, dict(values)))
        self._springs = {
            name: {
                way: np.einsum("nki,ni->nk", self.levers[name], moved) / part.compliances[way]
                for way, moved in part.sunk(loads[name]).items()
            }
            for name, part in machine.springs.items()
        }
        self._gives = {name: self._give(name) for name in machine.wound}
        driven = dict.fromkeys([*machine.wound, *(name for kind, name in keys if kind == "torque")])
        about = {name: 2 if slides.get(name, False) else 5 for name in driven}
        self._inertia = {name: -inertia[name][:, axis] for name, axis in about.items()}
        self._hold = {name: -gravity[name][:, axis] for name, axis in about.items()}
        self._pushed = {name: self.levers[name][:, :, axis] for name, axis in about.items()}
        self.wander = np.zeros((len(visits), len(keys)))
        for bearing in self._bearings.values():
            if isinstance(bearing, _Rolling):
                moved = np.einsum("nij,nj->ni", bearing.move**2, bearing.wander() ** 2)
                self.wander = np.hypot(
                    self.wander, tool_effect(keys, _CAGE_WANDER * np.sqrt(moved))
                )
        self._way = self._on_the_way([name for name in driven if self._remembers(name)])
        self.softening = {name: bearing.softening() for name, bearing in self._bearings.items()}
        elastic = self._elastic(loads, tool)
        self._known = np.zeros((len(visits), len(keys)))
        for soft in elastic:
            if soft.unknown.nominal:  # the structure's: the same in all directions
                self._known += soft.unknown.nominal * soft.effect[:, :, :3].sum(axis=2)
        self.elastic = tuple(soft for soft in elastic if soft.unknown.spread > 0.0)
        self.certain = self._sides(
            np.array([(MISJUDGED if u.name == "gear_play" else 1.0) * u.nominal for u in unknowns])
        )

    def _give(self, name: str) -> float:
        """Compliance of a joint that winds up, unless it is unknown [rad/(N m)]."""
        stated = self.machine.compliance(f"{name} torsional")
        gear = self.mechanism.gears.get(name)
        if gear is None or not math.isinf(stated.spread):
            return stated.nominal
        return 1.0 / Teeth(name, gear).stiffness[0]

    def _remembers(self, name: str) -> bool:
        """Whether a joint's gear has hysteresis, or may have some."""
        gear = self.mechanism.gears.get(name)
        sought = any(
            (unknown.joint, unknown.name) == (name, "hysteresis") for unknown in self.unknowns
        )
        return sought or (gear is not None and gear.bristles[0] > 0.0)

    def _on_the_way(self, names: Sequence[str]) -> dict[str, np.ndarray]:
        """Torque that the load asks of gears on the whole way, (m,) [N m].

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
        gravity, _, levers, _ = _statics(
            self.mechanism, visits.joints, q, (speed, acceleration), dict.fromkeys(names)
        )
        return {
            name: -gravity[name][:, 5]
            - np.einsum("mk,mk->m", levers[name][:, :, 5], visits.path_force)
            for name in names
        }

    def _sprung(self, name: str, way: str, parameters: Mapping[str, float]) -> float:
        """Compliance of springs or of a seat: found, given, or the scenario's."""
        stated = self.machine.compliance(f"{name} {way}")
        usual = self.machine.springs[name].compliances[way]
        return parameters.get(
            f"{way}_compliance", usual if math.isinf(stated.spread) else stated.nominal
        )

    def _elastic(self, loads: Mapping[str, np.ndarray], tool: np.ndarray) -> list[Elastic]:
        """Of each joint and of the structure at the tool (rotations (n, 3, 3))."""
        elastic = []
        for name, load in loads.items():
            for way, axes in _AXES.items():
                if (way == "link") != (name in self._gives) and axes == [5]:
                    continue  # of one that winds up, the torsional one is no column
                if way in self._springs.get(name, ()):
                    continue
                part = load[:, axes]
                if way == "bush":
                    if name not in self._bearings or not friction_of(self._bearings[name].joint):
                        continue
                    part = self._bearings[name].aside()
                if way == "torsional" and name in self._bearings:
                    part = part - self._bearings[name].drag()[:, None]
                moved = np.einsum("nki,ni->nk", self.levers[name][:, :, axes], part)
                label, effect = f"{name} {way}", tool_effect(self.keys, moved)[:, :, None]
                elastic.append(Elastic(label, self.machine.compliance(label), effect))
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
        values, held = self._values(theta)
        means = self._known.copy()
        tool = np.zeros((len(self.visits), 3))
        for name, bearing in self._bearings.items():
            point = self._point(name, held, *values.get(name, {}).items())
            tool += np.einsum("nij,nj->ni", bearing.move, point)
        for name, ways in self._springs.items():
            for way, moved in ways.items():
                tool += self._sprung(name, way, values.get(name, {})) * moved
        lags = {name: self._lag(name, *values.get(name, {}).items()) for name in self._gives}
        for name, (twist, _, _) in lags.items():
            tool += self._pushed[name] * twist[:, None]
        for column, (kind, name) in enumerate(self.keys):
            if kind == "tool":
                means[:, column] += tool[:, AXES.index(name)]
            elif kind == "link":
                means[:, column] = lags[name][0]
            elif name in lags:
                means[:, column] = lags[name][1]
            else:
                means[:, column] = self._torque(name, values.get(name, {}))
        return means

    def turned(
        self, joint: str, theta: np.ndarray
    ) -> tuple[np.ndarray, str, tuple[np.ndarray, str, str], np.ndarray]:
        """How far one joint with play is off (n,), by its twist or, of a bearing alone, along the
        way it mostly goes, and the unit; over what that shows, its torque or position (`Loop.x`,
        name and unit); and the effect of one more on the signals, shape (n, keys)."""
        values, held = self._values(theta)
        parameters, entry = values.get(joint, {}), self.mechanism.description.joints.get(joint)
        slides = entry is not None and entry.slides
        place = np.zeros(len(self.visits)), "position", "m" if slides else "rad"
        if joint in self.visits.joints:
            column = self.visits.joints.index(joint)
            place = self.visits.position[:, column], *place[1:]
        if joint in self._gives:
            twist, torque, _ = self._lag(joint, *parameters.items())
            effect = tool_effect(self.keys, self._pushed[joint])
            if ("link", joint) in self.keys:
                effect += signal_effect(self.keys, ("link", joint), np.ones(len(twist)))
            directions = self.visits.direction[:, column]
            alike = max(np.ptp(torque[directions == axis]) for axis in np.unique(directions))
            if alike > MINOR * np.ptp(torque) or not np.ptp(place[0]):
                place = torque, "torque", "N" if slides else "N*m"
            return twist, "m" if slides else "rad", place, effect
        bearing = self._bearings[joint]
        moved = np.einsum("nij,nj->ni", bearing.move, self._point(joint, held, *parameters.items()))
        axis = np.linalg.svd(moved, full_matrices=False)[2][0]
        effect = tool_effect(self.keys, np.tile(axis, (len(moved), 1)))
        return moved @ axis, "m", place, effect

    def loose(self) -> np.ndarray:
        """How the tool moves with what friction may hold anywhere, shape (n, keys, columns).

        A journal that does not turn stays along its axis where friction holds it, and one that
        turns creeps along it as fast as the load along the axis is large beside those across: the
        place along each axis with end walls is a column at each stop, unless the load along the
        axis exceeds all others, and at each other visit, if it is less than `MODEL_ERROR` of them.
        """
        columns = []
        for bearing in self._bearings.values():
            if not bearing.slips:
                continue
            enough = np.where(self.visits.stopped, 1.0, MODEL_ERROR) * 2.0 * bearing.push
            for i in np.flatnonzero(np.abs(bearing.load[:, 2]) <= enough):
                moved = np.zeros((len(self.visits), 3))
                moved[i] = bearing.move[i, :, 2]
                columns.append(tool_effect(self.keys, moved))
        return stacked(columns, len(self.visits), self.keys)

    def reverses(self, joint: str) -> bool:
        """Whether what a bearing bears across, or in tilt, turns round at some place."""
        load = self._bearings[joint].load
        for loads in (load[:, :2], load[:, 3:5]):
            size = np.linalg.norm(loads, axis=1)
            strong = size > _HELD_OFF * size.max(initial=0.0)
            for cell in np.unique(self.visits.cell[strong]):
                at_place = loads[strong & (self.visits.cell == cell)]
                if (at_place @ at_place.T < 0.0).any():
                    return True
        return False

    def most_torque(self, joint: str) -> float:
        """Largest torque that a joint which winds up transmits, without friction [N m]."""
        pushed = np.einsum("nk,nk->n", self._pushed[joint], self.visits.force)
        return float(np.abs(self._hold[joint] - pushed).max(initial=0.0))

    def _values(self, theta: np.ndarray) -> tuple[dict[str, dict[str, float]], float]:
        values: dict[str, dict[str, float]] = {}
        held = 0.0
        for unknown, value in zip(self.unknowns, theta, strict=True):
            if unknown.joint:
                values.setdefault(unknown.joint, {})[unknown.name] = float(value)
            else:
                held = float(value)
        return values, held

    def _dry(self, name: str, parameters: Mapping[str, float]) -> np.ndarray:
        """Friction about a joint's axis while it slides, (n,) [N m]."""
        dry = parameters.get("dry_friction", self._friction(name).coulomb)
        friction = np.full(len(self.visits), float(dry))
        if name in self._bearings:
            friction += self._bearings[name].torque(parameters.get("friction"))
        return friction

    def _friction(self, name: str) -> JointFriction:
        return self.machine.friction.get(name, JointFriction())

    def _torque(self, name: str, parameters: Mapping[str, float]) -> np.ndarray:
        """Of a drive without gear on a joint that moves, (n,)."""
        column = self.visits.joints.index(name)
        external = np.einsum("nk,nk->n", self._pushed[name], self.visits.force)
        torque = self._hold[name] - external
        torque = torque + self._dry(name, parameters) * self.visits.direction[:, column]
        viscous = self._friction(name).viscous
        return np.asarray(torque + viscous * self.visits.speed[:, column])

    def _wound(
        self,
        name: str,
        parameters: Mapping[str, float],
        extra: np.ndarray | float = 0.0,
        rigid: bool = False,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Link less motor (n,) [rad], torque between them (n,) [N m], and whether both are known.

        Along the whole way, for the side on which teeth lie, and what friction holds wound up,
        remembers the last turn. `parameters` are values of the joint's unknowns; `extra` is added
        to the load (n,) [N m]; with `rigid` there is nothing but play.
        """
        visits, gear = self.visits, self.mechanism.gears.get(name)
        near, column, law = visits.path_near, visits.joints.index(name), self._friction(name)
        dry = self._dry(name, parameters)[near]
        if name in self._way:
            hold = self._way[name] + (extra + np.zeros(len(visits)))[near]
        else:
            external = np.einsum("mk,mk->m", self._pushed[name][near], visits.path_force)
            hold = (self._hold[name] + extra)[near] - external
        hold = hold + law.viscous * visits.speed[near, column]
        motor = visits.path[:, column]
        error = 0.0 if gear is None else gear.kinematic_error(motor)[0]
        ratio = max(
            parameters.get("stiction", 1.0 + law.excess / law.coulomb if law.coulomb else 1.0), 1.0
        )
        half, curve, (grip, bend) = self._law(name, parameters, rigid)
        halts = np.diff(visits.stopped[near].astype(int), prepend=0) > 0
        angles, sure = np.empty(len(motor)), np.empty(len(motor), np.bool_)
        if grip > 0.0:
            torque = np.empty(len(motor))
            numbers = np.array([half, grip, bend]), *curve
            frictions = np.stack([dry, ratio * dry], axis=1)
            _follow_bristles(*numbers, motor + error, hold, frictions, halts, angles, torque, sure)
            twist = angles - motor
        else:
            ends = ((dry, -1.0), (-dry, 1.0), (ratio * dry, -1.0), (-ratio * dry, 1.0))
            low, high, first, last = (
                motor + error + _twist(hold + held, half, curve, side) for held, side in ends
            )
            _follow(low, high, first, last, halts, angles, sure)
            twist = angles - motor
            off = twist - error
            torque = -np.sign(off) * curve.torque(np.maximum(np.abs(off) - half, 0.0))
        return visits_mean(visits, twist), visits_mean(visits, torque), visits_mean(visits, sure)

    def _law(
        self, name: str, parameters: Mapping[str, float], rigid: bool
    ) -> tuple[float, Curve, tuple[float, float]]:
        """Half of the play of a joint that winds up, its torque over the twist, its bristles."""
        gear = self.mechanism.gears.get(name)
        give = next(
            (parameters[compliance] for compliance in WOUND if compliance in parameters),
            self._gives[name],
        )
        if gear is None or rigid:
            half = 0.0 if gear is None else 0.5 * parameters.get("gear_play", gear.play)
            give = NONE if rigid else max(give, NONE)
            return half, Curve.of([(1.0 / give, math.inf)]), (0.0, 1.0)
        teeth = Teeth(name, gear).holding({"gear_compliance": self._gives[name], **parameters})
        return 0.5 * teeth.play, teeth.curve(), teeth.bristles

    def _sides(self, theta: np.ndarray) -> np.ndarray:
        """Visits at which all sides are known, (n,)."""
        values, _ = self._values(theta)
        sure = np.all([np.ones(len(self.visits)), *(b.sure for b in self._bearings.values())], 0)
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
        off count.
        """
        parameters = dict(values)
        half = parameters["gear_play"] = self.mechanism.gears[name].play or NONE
        hold, twists = self._hold[name], []
        torque = hold - np.einsum("nk,nk->n", self._pushed[name], self.visits.force)
        off = _LOAD_ERROR * np.abs(torque).max(initial=0.0) * np.ones(len(hold))
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


@compiled
def _follow(
    low: np.ndarray,
    high: np.ndarray,
    first: np.ndarray,
    last: np.ndarray,
    halts: np.ndarray,
    angles: np.ndarray,
    sure: np.ndarray,
) -> None:
    """Write angles of a link that friction holds, and whether they are known, each (n,).

    Args:
        low, high: between which it lies while it slides up or down, (n,) [rad].
        first, last: beyond which it does not stick, (n,) [rad].
        halts: where the machine comes to a stop, (n,): how it calms down decides what friction then
            holds, until a push makes the link slide.
    """
    link, known, side = 0.5 * (low[0] + high[0]), False, 0
    for i in range(len(low)):
        known &= not halts[i]
        if link <= (low[i] if side > 0 else first[i]):
            link, known, side = low[i], True, 1
        elif link >= (high[i] if side < 0 else last[i]):
            link, known, side = high[i], True, -1
        elif low[i] < link < high[i]:
            side = 0
        angles[i], sure[i] = link, known


@compiled
def _follow_bristles(
    law: np.ndarray,
    slopes: np.ndarray,
    twists: np.ndarray,
    torques: np.ndarray,
    motor: np.ndarray,
    hold: np.ndarray,
    dry: np.ndarray,
    halts: np.ndarray,
    angles: np.ndarray,
    torque: np.ndarray,
    sure: np.ndarray,
) -> None:
    """As `_follow`, of a gear whose bristles remember; the motor's angle is with the gear's error.

    Args:
        law: half of the play, largest torque of bristles, and the angle in which they let go.
        slopes, twists, torques: of a `Curve`.
        motor, hold: angle [rad] and torque that the load asks of the gear [N m], (n,).
        dry: dynamic and static friction, (n, 2) [N m].
        halts: as of `_follow`.
        angles, torque, sure: of the link [rad], of the gear [N m], whether they are known, (n,).
    """
    last = bent = 0.0
    memory, known, way = 1.0, False, 0
    link = motor[0]
    for i in range(len(motor)):
        known &= not halts[i]
        twist = motor[i] - link
        held, _ = _bristled(law, slopes, twists, torques, last, bent, twist)
        slides = 0
        if held >= hold[i] + (dry[i, 0] if way > 0 else dry[i, 1]):
            slides = 1
        elif held <= hold[i] - (dry[i, 0] if way < 0 else dry[i, 1]):
            slides = -1
        if slides != 0:
            goal = hold[i] + slides * dry[i, 0]
            start, _ = _bristled(law, slopes, twists, torques, last, bent, last)
            side = 1.0 if goal > start else -1.0
            near, far = 0.0, math.pi  # no gear winds up by more
            for _ in range(_HALVINGS):
                middle = 0.5 * (near + far)
                reached, _ = _bristled(
                    law, slopes, twists, torques, last, bent, last + side * middle
                )
                if side * (reached - goal) < 0.0:
                    near = middle
                else:
                    far = middle
            twist, known, way = last + side * far, True, slides
            if dry[i, 0] == 0.0:
                way = 0
        elif abs(held - hold[i]) < dry[i, 0]:
            way = 0
        torque[i], bent = _bristled(law, slopes, twists, torques, last, bent, twist)
        memory *= math.exp(-abs(twist - last) / law[2])
        last, link = twist, motor[i] - twist
        angles[i], sure[i] = link, known and memory <= _FORGOTTEN


@compiled
def _bristled(
    law: np.ndarray,
    slopes: np.ndarray,
    twists: np.ndarray,
    torques: np.ndarray,
    last: float,
    bent: float,
    twist: float,
) -> tuple[float, float]:
    """Torque of a gear at a twist, and of its bristles, from where both were; see `kernel.gear`."""
    depth, elastic = abs(twist) - law[0], 0.0
    if depth > 0.0:
        start = begin = 0.0
        k = 0
        while k < len(twists) and depth > twists[k]:
            start, begin = twists[k], torques[k]
            k += 1
        elastic = math.copysign(begin + slopes[k] * (depth - start), twist)
    limit = math.copysign(law[1], twist - last)
    bent = limit + (bent - limit) * math.exp(-abs(twist - last) / law[2])
    return elastic + bent, bent


def _twist(torque: np.ndarray, half: float, curve: Curve, middle: float) -> np.ndarray:
    """Link less motor while the teeth carry a torque; without one, the end `middle` of the play."""
    side = np.where(torque > 0.0, -1.0, np.where(torque < 0.0, 1.0, middle))
    return np.asarray(side * half - np.sign(torque) * curve.depth(np.abs(torque)))


def _statics(
    mechanism: Mechanism,
    moved: Sequence[str],
    q: np.ndarray,
    rates: tuple[np.ndarray, np.ndarray],
    names: Mapping[str, None],
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray], np.ndarray]:
    """Loads and levers of joints in bearing axes about their centres, z their axes.

    At n configurations (n, nq) with these speeds and accelerations of the moving joints (n, j).

    Returns:
        Gravity and inertia (n, 6) [N, N m]; the latter's part; displacements of the tool in world
        axes by those of the joint, (n, 3, 6); rotation of the tool's axes, (n, 3, 3).
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
        for table in (still, loads):
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


def _rims(load: np.ndarray, length: float) -> list[np.ndarray]:
    """Forces across on both rims of a leaning journal by its load (n, 6), (n, 2) each."""
    bend = np.column_stack([load[:, 4], -load[:, 3]]) / length
    return [load[:, :2] / 2.0 + side * bend for side in (1.0, -1.0)]


def _determined(joint: Clearance, load: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Whether a load (n, 6), a part of it inertia, determines where the journal lies, (n,).

    Friction holds a journal wherever the load falls short of it, and a load that is nearly balanced
    says nothing of the side: along and across, all that inertia and friction may add (in a hinge:
    along rims and walls, with the moments that they make) must not move rims by more than a part of
    the clearance.
    """
    hinge, friction = joint.hinge, _AXIAL_FRICTION
    across = np.linalg.norm(load[:, :2], axis=1)
    pressed = across
    faint = _LOAD_ERROR * np.full(len(load), np.linalg.norm(load[:, :3], axis=1).max(initial=0.0))
    axes = np.eye(6)
    added = [faint[:, None] * axes[0], faint[:, None] * axes[1], inertia]
    arm = 0.0
    if hinge is not None:
        if hinge.tilts:
            arm = hinge.length / 2.0
            pressed = np.sum([np.linalg.norm(r, axis=1) for r in _rims(load, hinge.length)], axis=0)
        if hinge.axial > 0.0:
            added.append((friction * pressed)[:, None] * axes[2])
        if hinge.tilts:
            moment = friction * (pressed * hinge.radius + np.abs(load[:, 2]) * arm)
            added += [moment[:, None] * axes[3], moment[:, None] * axes[4]]
    sure = np.ones(len(load), bool)
    play = joint.play(second_order=False)
    undisturbed = play.support(load).point
    for disturbance in added:
        for side in (1.0, -1.0):
            off = play.support(load + side * disturbance).point - undisturbed
            lean = arm * np.linalg.norm(off[:, 3:5], axis=1)
            off_by = np.hypot(np.linalg.norm(off[:, :2], axis=1), lean)
            sure &= off_by <= _HELD_OFF * joint.radial_travel
    return sure & (across + np.abs(load[:, 2]) > 0.0)


def _against(load: np.ndarray, push: np.ndarray, length: float) -> np.ndarray:
    """Part of the rims' turn that friction on an end wall leaves, (n,).

    A leaning journal touches the wall opposite to where that end's rim touches the bore, so that
    the wall's friction pushes the rim back: by |F_z| / push of the angle of friction, and the mean
    of both rims by half of that. Where no moment leans the journal, nothing is known of it.
    """
    bend = np.linalg.norm(load[:, 3:5], axis=1) / length
    total = bend + np.linalg.norm(load[:, :2], axis=1) / 2.0
    lean = np.divide(bend, total, out=np.zeros_like(bend), where=total > 0.0)
    wall = np.divide(np.abs(load[:, 2]), push, out=np.zeros_like(push), where=push > 0.0)
    return np.asarray(np.clip(1.0 - 0.5 * lean * wall, 0.0, 1.0))


def _sliding_part(joint: Clearance, speed: np.ndarray) -> np.ndarray:
    """Part of the full friction that the law has at these joint speeds [rad/s], (n,)."""
    law, hinge = joint.friction, joint.hinge
    full = getattr(law, "mu_d", 0.0)
    if not full or law.bristles or hinge is None:
        return np.ones(len(speed))
    function, numbers = type(law).function, law.parameters()
    parts = [function(float(v), *numbers) / full for v in np.abs(speed) * hinge.radius]
    return np.clip(parts, 0.0, 1.0)
