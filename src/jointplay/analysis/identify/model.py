"""The quasi-static model: where play lets the tool be, and what the drives feel, at each visit.

A journal lies where its load pushes it, turned about the axis by the angle of friction against its
motion: with the load F and friction mu, the contact force balances F at the azimuth of F less
atan(mu) in the sense of rotation. Its displacement is the point at which the play's support
function is attained (`statics`), so that it is exact in the first order of the clearance; contacts
give way by what their law says of the load. A gear's link is held by friction until its teeth push
harder: the play operator of M. A. Krasnosel'skii and A. V. Pokrovskii, Systems with Hysteresis
(1989), with the load's torque. Inertia counts as a load. All is linear algebra: no time loop.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pinocchio as pin

from jointplay.analysis.identify.ideal import configurations
from jointplay.analysis.identify.parameters import (
    Parameter,
    friction_of,
    with_clearance,
)
from jointplay.analysis.identify.reading import Key
from jointplay.analysis.identify.visits import Visits
from jointplay.analysis.levers import GEAR, place, sources
from jointplay.joints import Clearance
from jointplay.joints.play import BallPlay, JournalPlay
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.impact import elastic_energy
from jointplay.mechanism.mechanism import Mechanism
from jointplay.result.result import AXES

_LATERAL = [0, 1, 3, 4]
_REMEMBERED = 100
"""Displacements of bearings that are kept: differences move one joint at a time."""
_FAINT_LOAD = 0.02
"""Part of the rims' forces below which a load along the axis moves nothing in time."""
_STIFFEST = 1e-12
"""Smallest compliance [rad/(N m)]."""
_LIGHT = 0.3
"""Part of the other rim's force below which a rim may lie anywhere."""
_UNSURE = 3.0
"""Plays by which a gear must have been crossed before its side is certain."""


@dataclass(frozen=True)
class _Bearing:
    """A joint with clearance at n visits."""

    joint: Clearance
    move: np.ndarray
    """(n, 6, 6), see `levers.Part`."""
    load: np.ndarray
    """(n, 6)."""
    push: np.ndarray
    """Force of a rim, mean of both, (n,) [N]."""
    rim: np.ndarray
    """Force of a radial contact (n,) [N]."""
    slides: np.ndarray
    """Part of the full friction by sliding speed, signed, moving visits only (n,)."""
    kept: np.ndarray
    """Sense of rotation before the stop, stopped visits only (n,)."""
    slips: bool
    """Whether the journal can move along its axis, to end walls."""
    sure: np.ndarray
    """Whether both rims are pressed firmly enough that it is known where they lie, (n,)."""

    def point(self, values: Mapping[str, float], held: float) -> np.ndarray:
        """Displacement of the journal at each visit, (n, 6) [m, rad]."""
        mine = self.joint.clearances
        sizes = {name: value for name, value in values.items() if name in mine}
        joint = with_clearance(self.joint, sizes)
        play = joint.play(second_order=False)
        point = play.support(self.load).point
        if isinstance(play, JournalPlay | BallPlay):
            depth = _depths(joint, self.rim)
            point[:, _LATERAL] *= (1.0 + depth / joint.radial_room)[:, None]
        friction = values.get("friction")
        if friction is None:
            friction = friction_of(self.joint) or 0.0
        angle = -np.arctan(friction * (self.slides + held * self.kept))
        return _turned(point, -angle if self.joint.exchanged else angle)

    def torque(self, friction: float | None) -> np.ndarray:
        """Of the rims' friction about the axis, its size while sliding, (n,) [N m]."""
        coefficient = friction_of(self.joint) or 0.0 if friction is None else friction
        radius = 0.0 if self.joint.hinge is None else self.joint.hinge.radius
        return np.asarray(2.0 * self.push * radius * coefficient / np.hypot(1.0, coefficient))


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
        mechanism: a tree.
        visits: n of them.
        keys: signals that are predicted.
        friction: of the joints besides their bearings'.
        unknowns: what `predict` is given.

    Attributes:
        certain: visits at which the sides of all gears, and of all rims, are known, shape (n,).

    Raises:
        JointplayError: loops; see `levers.sources`.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        visits: Visits,
        keys: tuple[Key, ...],
        friction: Mapping[str, JointFriction],
        unknowns: tuple[Parameter, ...],
    ) -> None:
        """Find levers and loads at each visit, once for all."""
        self.mechanism, self.visits, self.keys = mechanism, visits, keys
        self.unknowns, self._friction = unknowns, friction
        self._points: dict[tuple[object, ...], np.ndarray] = {}
        q = configurations(mechanism, visits.joints, visits.position)
        parts = {part.name: part for part in sources(mechanism, q, second_order=False)}
        names = [*mechanism.clearance, *mechanism.gears]
        self._torqued = [name for kind, name in keys if kind == "torque"]
        loads = _loads(mechanism, visits, q, dict.fromkeys([*names, *self._torqued]))
        self._bearings = {}
        for name, joint in mechanism.clearance.items():
            move = parts[name].move
            load = loads[name] + np.einsum("nki,nk->ni", move[:, :3], visits.force)
            self._bearings[name] = _bearing(name, joint, move, load, visits)
        self._gears = {name: parts[name + GEAR].move for name in mechanism.gears}
        self._hold = {name: -load[:, 5] for name, load in loads.items()}
        pushed = {name: parts[name + GEAR].move[:, :3, 5] for name in mechanism.gears}
        for name in self._torqued:
            if name not in pushed:
                pushed[name] = _lever_about(mechanism, q, name)
        self._pushed = pushed
        self.certain = self._sides(
            np.array(
                [(_UNSURE if one.name == "gear_play" else 1.0) * one.nominal for one in unknowns]
            )
        )

    def predict(self, theta: np.ndarray) -> np.ndarray:
        """Means of the signals at all visits, shape (n, keys) [m, rad, N m]."""
        values, held = self._values(theta)
        means = np.zeros((len(self.visits), len(self.keys)))
        tool = np.zeros((len(self.visits), 3))
        for name, bearing in self._bearings.items():
            key = (name, held, *values.get(name, {}).items())
            if key not in self._points:
                if len(self._points) > _REMEMBERED:
                    self._points.clear()
                self._points[key] = bearing.point(values.get(name, {}), held)
            point = self._points[key]
            tool += np.einsum("nij,nj->ni", bearing.move[:, :3], point)
        twists, torques = {}, {}
        for name, move in self._gears.items():
            twists[name], torques[name], _ = self._gear(name, values)
            tool += move[:, :3, 5] * twists[name][:, None]
        for column, (kind, name) in enumerate(self.keys):
            if kind == "tool":
                means[:, column] = tool[:, AXES.index(name)]
            elif kind == "link":
                means[:, column] = twists[name]
            elif name in torques:
                means[:, column] = torques[name]
            else:
                means[:, column] = self._torque(name, values)
        return means

    def loose(self) -> np.ndarray:
        """How the tool moves with what friction may hold anywhere, shape (n, keys, columns).

        A journal that does not turn stays along its axis where friction holds it, and one that
        turns creeps along it as fast as the load along the axis is large beside those across: the
        place along each axis with end walls is a column at each stop, unless the load along the
        axis exceeds all others, and at each other visit, if it is less than `_FAINT_LOAD` of them.
        """
        columns = []
        for bearing in self._bearings.values():
            if not bearing.slips:
                continue
            enough = np.where(self.visits.stopped, 1.0, _FAINT_LOAD) * 2.0 * bearing.push
            for i in np.flatnonzero(np.abs(bearing.load[:, 2]) <= enough):
                made = np.zeros((len(self.visits), len(self.keys)))
                for k, (kind, axis) in enumerate(self.keys):
                    if kind == "tool":
                        made[i, k] = bearing.move[i, AXES.index(axis), 2]
                columns.append(made)
        if not columns:
            return np.zeros((len(self.visits), len(self.keys), 0))
        return np.stack(columns, axis=2)

    def lever(self, name: str) -> np.ndarray | None:
        """How the play of a joint moves the tool, (n, 6, 6); None if it has none."""
        if name in self._bearings:
            return self._bearings[name].move
        return self._gears.get(name)

    def _values(self, theta: np.ndarray) -> tuple[dict[str, dict[str, float]], float]:
        """Values by joint and name, and which part of the friction stays at stops."""
        values: dict[str, dict[str, float]] = {}
        held = 0.0
        for one, value in zip(self.unknowns, theta, strict=True):
            if one.joint:
                values.setdefault(one.joint, {})[one.name] = float(value)
            else:
                held = float(value)
        return values, held

    def _dry(self, name: str, values: Mapping[str, Mapping[str, float]]) -> np.ndarray:
        """Friction about a joint's axis while it slides, (n,) [N m]."""
        own = self._friction.get(name, JointFriction())
        mine = values.get(name, {})
        dry = mine.get("dry_friction", own.coulomb)
        friction = np.full(len(self.visits), float(dry))
        if name in self._bearings:
            friction += self._bearings[name].torque(mine.get("friction"))
        return friction

    def _torque(self, name: str, values: Mapping[str, Mapping[str, float]]) -> np.ndarray:
        """Of a drive without gear on a joint that moves, (n,)."""
        column = self.visits.joints.index(name)
        own = self._friction.get(name, JointFriction())
        external = np.einsum("nk,nk->n", self._pushed[name], self.visits.force)
        torque = self._hold[name] - external
        torque = torque + self._dry(name, values) * self.visits.direction[:, column]
        return np.asarray(torque + own.viscous * self.visits.speed[:, column])

    def _gear(
        self, name: str, values: Mapping[str, Mapping[str, float]]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Link less motor (n,) [rad], torque of the teeth (n,) [N m], and whether both are known.

        Along the whole way, for the side on which the teeth lie remembers the last turn.
        """
        visits, gear = self.visits, self.mechanism.gears[name]
        mine = values.get(name, {})
        half = 0.5 * mine.get("gear_play", gear.play)
        give = max(mine.get("gear_compliance", 1.0 / gear.stiffness), _STIFFEST)
        dry = self._dry(name, values)[visits.path_near]
        near = visits.path_near
        external = np.einsum("mk,mk->m", self._pushed[name][near], visits.path_force)
        column = visits.joints.index(name)
        speed = visits.speed[near, column]
        hold = self._hold[name][near] - external
        hold = hold + self._friction.get(name, JointFriction()).viscous * speed
        motor = visits.path[:, column]
        low = (motor + _twist(hold + dry, half, give, -1.0)).tolist()
        high = (motor + _twist(hold - dry, half, give, 1.0)).tolist()
        link = 0.5 * (low[0] + high[0])
        angles, sure, known = np.zeros(len(motor)), np.zeros(len(motor), bool), False
        for i, (lowest, highest) in enumerate(zip(low, high, strict=True)):
            if link <= lowest:
                link, known = lowest, True
            elif link >= highest:
                link, known = highest, True
            angles[i], sure[i] = link, known
        twist = angles - motor
        beyond = np.maximum(np.abs(twist) - half, 0.0)
        torque = -np.sign(twist) * beyond / give
        return visits_mean(visits, twist), visits_mean(visits, torque), visits_mean(visits, sure)

    def _sides(self, theta: np.ndarray) -> np.ndarray:
        values, _ = self._values(theta)
        sure = np.all([np.ones(len(self.visits)), *(b.sure for b in self._bearings.values())], 0)
        for name in self._gears:
            sure &= self._gear(name, values)[2] > 1.0 - 1e-9
        return sure


def visits_mean(visits: Visits, values: np.ndarray) -> np.ndarray:
    """Means over the points of the path that belong to each visit, shape (n,)."""
    mine = visits.path_visit >= 0
    at = visits.path_visit[mine]
    count = np.bincount(at, minlength=len(visits))
    total = np.bincount(at, np.asarray(values, float)[mine], minlength=len(visits))
    return np.asarray(total / np.maximum(count, 1))


def _twist(torque: np.ndarray, half: float, give: float, middle: float) -> np.ndarray:
    """Link less motor while the teeth carry a torque; without one, the end `middle` of the play."""
    side = np.where(torque > 0.0, -1.0, np.where(torque < 0.0, 1.0, middle))
    return side * half - give * torque


def _loads(
    mechanism: Mechanism, visits: Visits, q: np.ndarray, names: Mapping[str, None]
) -> dict[str, np.ndarray]:
    """Gravity and inertia on each joint about its centre, bearing axes, (n, 6) [N, N m]."""
    model, data = mechanism.model, mechanism.data
    at = [mechanism.coordinate(name) for name in visits.joints]
    loads = {name: np.zeros((len(q), 6)) for name in names}
    for i, row in enumerate(q):
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[at], a[at] = visits.speed[i], visits.acceleration[i]
        pin.rnea(model, data, row, v, a)
        pin.computeJointJacobians(model, data, row)
        for name in names:
            index, axes = place(mechanism, name)
            back = -axes.rotation.T @ data.oMi[index].rotation
            wrench = data.f[index]
            loads[name][i, :3], loads[name][i, 3:] = back @ wrench.linear, back @ wrench.angular
    return loads


def _lever_about(mechanism: Mechanism, q: np.ndarray, name: str) -> np.ndarray:
    """How the tool moves with a joint, (n, 3) [m/rad or 1]."""
    levers = np.zeros((len(q), 3))
    at = mechanism.coordinate(name)
    for i, row in enumerate(q):
        jacobian = pin.computeFrameJacobian(
            mechanism.model,
            mechanism.data,
            row,
            mechanism.tool_frame,
            pin.ReferenceFrame.LOCAL_WORLD_ALIGNED,
        )
        levers[i] = jacobian[:3, at]
    return levers


def _bearing(
    name: str, joint: Clearance, move: np.ndarray, load: np.ndarray, visits: Visits
) -> _Bearing:
    hinge = joint.hinge
    leaning = hinge if hinge is not None and hinge.leans else None
    if leaning is not None:
        bend = np.column_stack([load[:, 4], -load[:, 3]]) / leaning.length
        rims = [np.linalg.norm(load[:, :2] / 2.0 + side * bend, axis=1) for side in (1.0, -1.0)]
        push = np.mean(rims, axis=0)
        sure = np.min(rims, axis=0) >= _LIGHT * np.max(rims, axis=0)
    else:
        push = np.linalg.norm(load[:, :2], axis=1) / 2.0
        sure = np.ones(len(load), bool)
    whole = 2.0 * push if leaning is None else push
    speed = visits.speed[:, visits.joints.index(name)] if name in visits.joints else 0.0 * push
    way = visits.direction[:, visits.joints.index(name)] if name in visits.joints else 0 * push
    slides = np.where(visits.stopped, 0.0, _sliding_part(joint, speed) * np.sign(speed))
    kept = np.where(visits.stopped, way, 0.0)
    walls = hinge is not None and hinge.axial > 0.0
    if walls and leaning is not None:
        part = _against(load, push, leaning.length)
        slides, kept = slides * part, kept * part
    return _Bearing(joint, move, load, push, whole, slides, kept, walls, sure)


def _against(load: np.ndarray, push: np.ndarray, length: float) -> np.ndarray:
    """Part of the rims' turn that friction on an end wall leaves, (n,).

    A leaning journal touches the wall opposite to where that end's rim touches the bore, so that
    the wall's friction pushes the rim back: by |F_z| / push of the angle of friction, and the mean
    of both rims by half of that. Where no moment leans the journal, nothing is known of it.
    """
    bend = np.linalg.norm(load[:, 3:5], axis=1) / length
    whole = bend + np.linalg.norm(load[:, :2], axis=1) / 2.0
    lean = np.divide(bend, whole, out=np.zeros_like(bend), where=whole > 0.0)
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


def _depths(joint: Clearance, force: np.ndarray) -> np.ndarray:
    """How far a radial contact gives way to forces [N], shape (n,) [m]."""
    return np.asarray(np.interp(force, *_springs(joint)))


@lru_cache(maxsize=256)
def _springs(joint: Clearance) -> tuple[np.ndarray, np.ndarray]:
    """Forces [N] and depths [m] of a radial contact."""
    parameters = joint.normal.parameters(joint.contact_properties(0))
    depths = np.geomspace(1e-10, joint.depth_limit, 600)
    forces = np.gradient(elastic_energy(joint.normal, parameters, depths), depths)
    return np.maximum.accumulate(forces), depths
