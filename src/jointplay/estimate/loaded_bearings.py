"""Loaded bearings: where the journal of a joint with clearance lies at each visit, by statics.

A journal lies where its load pushes it, turned about the axis by the angle of friction against its
motion: with the load F and friction mu, the contact force balances F at the azimuth of F less
atan(mu) in the sense of rotation. Its displacement is the point at which the play's support
function is attained (`Play.support`), so that it is exact in the first order of the clearance;
contacts give way by what their law says of the load.

The inner ring of a rolling bearing comes to rest among its elements (`RollingBearing.rests`).

Not every load decides the place: friction holds a journal wherever the load falls short of it, and
a load that is nearly balanced says nothing of the side. `determined` says at which visits it does.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from jointplay.estimate.machine import KEPT_AT_STOPS
from jointplay.estimate.parts import SPRINGS, Elements, Journal, friction_of
from jointplay.estimate.unknowns import TINY
from jointplay.estimate.visits import Visits
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.physics.joints.play import BallPlay, JournalPlay
from jointplay.simulation.statics import depths

_LINE_CONTACT = 0.9
"""Exponent of the load by which contacts of lines give way (Palmgren's of rollers), those of points
by 2/3; the compliances here give way in proportion to it."""
_CAGES = 6
"""Number of places of a cage, between one element and the next, that are compared (judged: from 3
to 12 the same is told of 11 machines of benchmarks/truth/identify.py)."""
_AXIAL_FRICTION = 0.1
"""Coefficient of the friction along the axis that may hold a journal's lean where it is: of greased
steel and bronze (judged: from 0.05 to 0.15 the same is told of these 11 machines)."""
LOAD_ERROR, _MOMENT_ERROR = 0.015, 0.04
"""Part of a joint's largest load by which the model of its loads may be off, and of moments that
tilt a rolling bearing, which change while a place is passed: judged. With 0.02 for both, one of the
first three machines of benchmarks/truth/identify.py is not told its play."""
HELD_OFF_SHARE = 0.35
"""Part of the clearance by which rims may be held off the place where the load would push them, and
of the other rim's force below which a rim may lie anywhere (judged: with 0.3 of the force nothing
changes in 103 machines of benchmarks/truth/identify.py)."""


class LoadedBearing:
    """A joint with clearance at n visits.

    Args:
        name: of the joint.
        joint: its clearance as expected.
        levers: displacement of the tool by one of the journal, shape (n, 3, 6).
        load: force and moment on the journal in bearing axes, z the joint's, shape (n, 6) [N, N m].
        inertia: the part of the load that is inertia, shape (n, 6).
        visits: n of them.

    Attributes:
        determined: whether the load determines where the journal lies, shape (n,).
        rim_force: force across on a rim, mean of both, shape (n,) [N].
        has_end_walls: whether the journal can move along its axis, to end walls.
    """

    def __init__(
        self,
        name: str,
        joint: Clearance,
        levers: np.ndarray,
        load: np.ndarray,
        inertia: np.ndarray,
        visits: Visits,
    ) -> None:
        self.joint, self.levers, self.load, hinge = joint, levers, load, joint.hinge
        self._friction = friction_of(joint) or 0.0
        leaning = hinge if hinge is not None and hinge.tilts else None
        self.determined = _load_determines_place(joint, load, inertia)
        if leaning is None:
            self.rim_force = np.linalg.norm(load[:, :2], axis=1) / 2.0
            self._contact_force = 2.0 * self.rim_force
        else:
            rims = [np.linalg.norm(rim, axis=1) for rim in _rim_forces(load, leaning.length)]
            self._contact_force = self.rim_force = np.mean(rims, axis=0)
            # A rim with little force of its own may lie anywhere.
            self.determined &= np.min(rims, axis=0) >= HELD_OFF_SHARE * np.max(rims, axis=0)
        speed = way = np.zeros(len(visits))
        if name in visits.joints:
            column = visits.joints.index(name)
            speed, way = visits.speed[:, column], visits.direction[:, column]
        self.has_end_walls = hinge is not None and hinge.axial > 0.0
        part: np.ndarray | float = 1.0
        if self.has_end_walls and leaning is not None:
            part = _turn_that_walls_leave(load, self.rim_force, leaning.length)
        sliding = _part_of_friction(joint, speed) * np.sign(speed)
        # Part of the full friction, signed by the sense of rotation: at visits that move, and at
        # stops, where some of it stays from the way there.
        self._sliding = np.where(visits.stopped, 0.0, sliding) * part
        self._stopped = np.where(visits.stopped, way, 0.0) * part

    def point(self, values: Mapping[str, float], kept: float) -> np.ndarray:
        """Displacement of the journal, shape (n, 6) [m, rad].

        By values of the joint's unknowns, and the part of friction that is kept at stops.
        """
        sizes = {name: value for name, value in values.items() if name in self.joint.clearances}
        joint = Journal("", self.joint).holding(sizes)
        play = joint.play(second_order=False)
        point = play.support(self.load).point
        if isinstance(play, JournalPlay | BallPlay):
            deeper = 1.0 + depths(joint, 0, self._contact_force) / joint.radial_travel
            point[:, [*SPRINGS["radial"], *SPRINGS["tilt"]]] *= deeper[:, None]
        friction = values.get("friction", self._friction)
        angle = -np.arctan(friction * (self._sliding + kept * self._stopped))
        return _turned(point, -angle if self.joint.exchanged else angle)

    def drag(self) -> np.ndarray:
        """Torque about the axis by the expected friction, against the motion, shape (n,) [N m].

        It winds the joint up by 2 mu R_i / L of what a push with the lever L does, so that the
        expected value will do.
        """
        return self.torque(None) * (self._sliding + KEPT_AT_STOPS * self._stopped)

    def turned_load(self) -> np.ndarray:
        """Change of the load across where expected friction turns its direction, (n, 2) [N].

        A bush gives way along the contact's normal, which friction turns as it turns the journal's
        place: aside in proportion to the load, where the clearance alone does by the same at all.
        """
        angle = np.arctan(self._friction) * (self._sliding + KEPT_AT_STOPS * self._stopped)
        angle = angle if self.joint.exchanged else -angle
        return np.asarray(_turned(self.load, angle) - self.load)[:, :2]

    def softening(self) -> np.ndarray:
        """Compliance of a contact of lines over a constant one, one at the largest load, (n,)."""
        size = np.linalg.norm(self.load[:, :2], axis=1)
        part = size / max(float(size.max(initial=0.0)), TINY)
        return np.where(part > 0.0, np.maximum(part, TINY) ** (_LINE_CONTACT - 1.0), 0.0)

    def torque(self, friction: float | None) -> np.ndarray:
        """Torque of the rims' friction about the axis while sliding, shape (n,) [N m].

        By a coefficient of friction; None takes the expected one.
        """
        coefficient = self._friction if friction is None else friction
        radius = 0.0 if self.joint.hinge is None else self.joint.hinge.radius
        return np.asarray(2.0 * self.rim_force * radius * coefficient / np.hypot(1.0, coefficient))


class LoadedRollingBearing(LoadedBearing):
    """A rolling bearing at n visits: no friction across, and a little about its axis."""

    joint: RollingBearing

    def __init__(
        self,
        name: str,
        joint: RollingBearing,
        levers: np.ndarray,
        load: np.ndarray,
        inertia: np.ndarray,
        visits: Visits,
    ) -> None:
        self.joint, self.levers, self.load = joint, levers, load
        self._elements = Elements(name, replace(joint, seat=None))
        # It rests in axes of the outer ring: the link's displacement is the inner one's.
        self._side = -1.0 if joint.exchanged else 1.0
        turned = np.zeros(len(visits))
        if name in visits.joints:
            turned = visits.position[:, visits.joints.index(name)]
        self._cage_turn = self._side * joint.cage_ratio * turned
        self.rim_force = np.linalg.norm(load[:, :2], axis=1) / 2.0
        self.has_end_walls = joint.has_play and bool(joint.hinge.axial > 0.0)
        self._sliding = self._stopped = np.zeros(len(visits))
        self.determined = self._load_determines_place(inertia)

    def _load_determines_place(self, inertia: np.ndarray) -> np.ndarray:
        """Visits at which errors of the load, and inertia (n, 6), hardly move the ring, (n,)."""
        load, joint = self.load, self.joint
        undisturbed, determined = self._rests({}, load)
        across = np.linalg.norm(load[:, :3], axis=1)
        determined = determined & (across > 0.0)
        force = LOAD_ERROR * across.max(initial=0.0)
        moment = _MOMENT_ERROR * np.linalg.norm(load[:, 3:5], axis=1).max(initial=0.0)
        errors = np.diag([force, force, 0.0, moment, moment, 0.0])[[0, 1, 3, 4]]
        room = np.linalg.norm(undisturbed[:, [[0, 1], [3, 4]]], axis=2).max(axis=0, initial=0.0)
        free = np.array([joint.travel["x"] or np.inf, joint.travel["roll"] or np.inf])
        free = np.maximum(free, room)
        for disturbance in (*errors, inertia):
            for way in (1.0, -1.0):
                off = self._rests({}, load + way * disturbance)[0] - undisturbed
                by = np.linalg.norm(off[:, [[0, 1], [3, 4]]], axis=2)
                determined &= (by <= HELD_OFF_SHARE * free).all(axis=1)
        return determined

    def _rests(
        self, values: Mapping[str, float], load: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Displacements under loads (n, 6), and whether the loads determine them (n,)."""
        begin = values.get("cage_angle", self.joint.cage_angle)
        rested = self._elements.holding(values).rests(self._side * load, begin + self._cage_turn)
        return self._side * rested[0], rested[1]

    def point(self, values: Mapping[str, float], kept: float) -> np.ndarray:
        return self._rests(values, self.load)[0]

    def wander(self) -> np.ndarray:
        """Spread of the displacement over places of the cage, which slips, (n, 6) [m, rad]."""
        turns = self._elements.period * np.arange(_CAGES) / _CAGES
        points = [self._rests({"cage_angle": turn}, self.load)[0] for turn in turns]
        return np.std(points, axis=0)

    def torque(self, friction: float | None) -> np.ndarray:
        return np.full(len(self.load), self.joint.drag)

    def drag(self) -> np.ndarray:
        return np.zeros(len(self.load))


def _turned(points: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Displacements and leans, or forces and moments, turned about z, shape (n, 6)."""
    c, s = np.cos(angle), np.sin(angle)
    rotated = points.copy()
    for x, y in ((0, 1), (3, 4)):
        rotated[:, x] = c * points[:, x] - s * points[:, y]
        rotated[:, y] = s * points[:, x] + c * points[:, y]
    return rotated


def _rim_forces(load: np.ndarray, length: float) -> list[np.ndarray]:
    """Forces across on both rims of a leaning journal by its load (n, 6), (n, 2) each."""
    bend = np.column_stack([load[:, 4], -load[:, 3]]) / length
    return [load[:, :2] / 2.0 + side * bend for side in (1.0, -1.0)]


def _load_determines_place(joint: Clearance, load: np.ndarray, inertia: np.ndarray) -> np.ndarray:
    """Visits at which a load (n, 6), a part of it inertia, determines where a journal lies, (n,).

    All that errors of the load, inertia and friction may add (in a hinge: along rims and walls,
    with the moments that they make) must not move rims by more than a part of the clearance.
    """
    hinge, friction = joint.hinge, _AXIAL_FRICTION
    across = np.linalg.norm(load[:, :2], axis=1)
    pressed = across
    error = LOAD_ERROR * np.full(len(load), np.linalg.norm(load[:, :3], axis=1).max(initial=0.0))
    axes = np.eye(6)
    added = [error[:, None] * axes[0], error[:, None] * axes[1], inertia]
    arm = 0.0
    if hinge is not None:
        if hinge.tilts:
            arm = hinge.length / 2.0
            rims = _rim_forces(load, hinge.length)
            pressed = np.sum([np.linalg.norm(rim, axis=1) for rim in rims], axis=0)
        if hinge.axial > 0.0:
            added.append((friction * pressed)[:, None] * axes[2])
        if hinge.tilts:
            moment = friction * (pressed * hinge.radius + np.abs(load[:, 2]) * arm)
            added += [moment[:, None] * axes[3], moment[:, None] * axes[4]]
    determined = np.ones(len(load), bool)
    play = joint.play(second_order=False)
    undisturbed = play.support(load).point
    for disturbance in added:
        for side in (1.0, -1.0):
            off = play.support(load + side * disturbance).point - undisturbed
            lean = arm * np.linalg.norm(off[:, 3:5], axis=1)
            off_by = np.hypot(np.linalg.norm(off[:, :2], axis=1), lean)
            determined &= off_by <= HELD_OFF_SHARE * joint.radial_travel
    return determined & (across + np.abs(load[:, 2]) > 0.0)


def _turn_that_walls_leave(load: np.ndarray, rim_force: np.ndarray, length: float) -> np.ndarray:
    """Part of the turn by the rims' friction that friction on an end wall leaves, (n,).

    A leaning journal touches the wall opposite to where that end's rim touches the bore, so that
    the wall's friction pushes the rim back: by |F_z| / rim force of the angle of friction, and the
    mean of both rims by half of that. Where no moment leans the journal, nothing is known of it.
    """
    bend = np.linalg.norm(load[:, 3:5], axis=1) / length
    total = bend + np.linalg.norm(load[:, :2], axis=1) / 2.0
    lean = np.divide(bend, total, out=np.zeros_like(bend), where=total > 0.0)
    wall = np.abs(load[:, 2])
    wall = np.divide(wall, rim_force, out=np.zeros_like(rim_force), where=rim_force > 0.0)
    return np.asarray(np.clip(1.0 - 0.5 * lean * wall, 0.0, 1.0))


def _part_of_friction(joint: Clearance, speed: np.ndarray) -> np.ndarray:
    """Part of the full friction that the law has at these joint speeds [rad/s], (n,)."""
    law, hinge = joint.friction, joint.hinge
    full = getattr(law, "mu_d", 0.0)
    if not full or law.bristles or hinge is None:
        return np.ones(len(speed))
    function, numbers = type(law).function, law.parameters()
    parts = [function(float(v), *numbers) / full for v in np.abs(speed) * hinge.radius]
    return np.clip(parts, 0.0, 1.0)
