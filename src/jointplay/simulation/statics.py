"""Where a machine stands: the equilibrium of all journals under gravity, drives and loads."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import eigenpy
import numpy as np
import pinocchio as pin

from jointplay.base.compiler import compiled, pointer
from jointplay.model.frames import motion_between, pose_between
from jointplay.model.impact import elastic_energy
from jointplay.model.loop import closing_rows, newton_step
from jointplay.model.mechanism import Mechanism
from jointplay.physics.contact import elastic, resultant
from jointplay.physics.contact.calls import call_normal
from jointplay.physics.contact.machine_code import MAX_PARAMETERS, address
from jointplay.physics.contact.resultant import DEEPEST, ENERGY
from jointplay.physics.geometry import touch
from jointplay.physics.joints import VIRTUAL_LINK, Clearance, Coordinate
from jointplay.physics.kernel.layout import Carriers, LoadSite
from jointplay.simulation.loads.base import Load, compiled_law
from jointplay.simulation.loads.drive import Drive, JointFriction

# Downhill in a few coordinates: where a potential with corners is lowest.


_ROUNDING = 1e-14
"""Part of an energy that rounding blurs."""


@dataclass(frozen=True)
class TrialState:
    """A state that was tried, in the coordinates of the search."""

    q: np.ndarray
    height: float
    slope: np.ndarray
    bend: np.ndarray
    load: float

    def gain(self, trial: TrialState, expected: float) -> float:
        """Part of the expected gain that another place brings; where the gain drowns in rounding, 1
        if it is less steep there, else 0.
        """
        if expected < _ROUNDING * max(abs(self.height), expected):
            return float(np.linalg.norm(trial.slope) < np.linalg.norm(self.slope))
        return (self.height - trial.height) / expected


def minimize_in_ball(slope: np.ndarray, bend: np.ndarray, radius: float) -> np.ndarray:
    """Where a quadratic is lowest within a ball about the origin.

    Its curvature is shifted until it is positive and the step no longer than the radius; how far is
    found by bisection.
    """
    # Eigen's, for on a busy machine the threads of numpy's wait for each other.
    spectrum = eigenpy.SelfAdjointEigenSolver(0.5 * (bend + bend.T))
    sizes, axes = spectrum.eigenvalues(), spectrum.eigenvectors()
    along = axes.T @ slope
    least = 1e-13 * max(float(np.abs(sizes).max()), 1e-30)  # above rounding of the largest
    low = max(0.0, -float(sizes.min())) + least
    if sizes.min() > least and _length(along / sizes) <= radius:
        return -axes @ (along / sizes)
    if _length(along / (sizes + low)) <= radius:
        return -axes @ (along / (sizes + low))
    high = low + _length(along) / radius
    for _ in range(100):
        middle = math.sqrt(low * high)
        if _length(along / (sizes + middle)) > radius:
            low = middle
        else:
            high = middle
        if high < 1.01 * low:  # right to 1 %, enough for a trust radius
            break
    return -axes @ (along / (sizes + high))


def _length(vector: np.ndarray) -> float:
    return math.sqrt(vector @ vector)


# Contact of one joint at rest: what its surfaces store, push with, and how stiff they are.


_SHIFT_M = 1e-9
"""Displacement by which wrenches are differentiated [m]: of a force like depth^1.5 central
differences are then wrong by 1e-6 at 0.2 µm, and less where surfaces are pressed deeper."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
"""By which a law's force is integrated over the depth to the energy: 12 of Gauss's points."""


@compiled
def _press(shape, dimensions, count, law, parameters, poses, nodes, weights, out):
    """Answers of elastic contacts at many poses, in the places that a law of a whole joint has.

    `shape` is a `Shape` or the address of a touch, as for `geometry.touch`.
    """
    for i in range(poses.shape[0]):
        pose, answer = poses[i], out[i]
        answer[DEEPEST] = -np.inf
        for k in range(count):
            gap, rx, ry, rz, nx, ny, nz = touch(
                shape, dimensions, 0, k, pose[0], pose[1], pose[2], pose, 3
            )
            answer[DEEPEST] = max(answer[DEEPEST], -gap)
            if gap >= 0.0:
                continue
            law_numbers = pointer(parameters[k].ctypes.data)
            force = max(call_normal(law, (-gap, 0.0, 1.0, law_numbers)), 0.0)
            fx, fy, fz = force * nx, force * ny, force * nz
            answer[0] += fx
            answer[1] += fy
            answer[2] += fz
            answer[3] += ry * fz - rz * fy
            answer[4] += rz * fx - rx * fz
            answer[5] += rx * fy - ry * fx
            for n in range(nodes.size):
                at = 0.5 * -gap * (1.0 + nodes[n])
                force = call_normal(law, (at, 0.0, 1.0, law_numbers))
                answer[ENERGY] += 0.5 * -gap * weights[n] * force


@lru_cache(maxsize=256)
def _springs(joint: Clearance, contact: int) -> tuple[np.ndarray, np.ndarray]:
    parameters = joint.normal.parameters(joint.contact_properties(contact))
    depths = np.geomspace(1e-10, joint.depth_limit, 600)  # from an atom on
    forces = np.gradient(elastic_energy(joint.normal, parameters, depths), depths)
    return np.maximum.accumulate(forces), depths


def depths(joint: Clearance, contact: int, force: np.ndarray) -> np.ndarray:
    """How far a contact of a joint gives way to normal forces [N], their shape [m]."""
    return np.asarray(np.interp(force, *_springs(joint, contact)))


class ElasticJoint:
    """The elastic contacts of one joint, without friction and damping.

    Those of its surfaces; or the elements of a rolling bearing, its cage where it starts; or
    springs.
    """

    def __init__(self, joint: Clearance) -> None:
        self._joint = joint
        self.reach = float(np.linalg.norm(joint.outline.size))
        """Farthest point of the journal from its centre [m]."""
        self._holds = joint.law in resultant.HOLDING
        self._shift = np.array([_SHIFT_M] * 3 + [_SHIFT_M / self.reach] * 3)
        self._last = b"", np.zeros((0, 0))
        if joint.resultant is None:
            count = len(joint.contacts)
            parameters = np.zeros((count, MAX_PARAMETERS))
            for k in range(count):
                values = joint.normal.parameters(joint.contact_properties(k))
                parameters[k, : len(values)] = values
            dimensions = np.array([*joint.dimensions, *(0.0,) * 4])
            law = address(joint.normal)
            self._of = int(joint.shape), dimensions, count, law, parameters

    def _look(self, poses: np.ndarray) -> np.ndarray:
        """Answers at poses (n, 12) of the journal in its bearing, see `elastic.answers`."""
        numbers = self._joint.resultant
        if numbers is not None:
            return elastic.answers(self._joint.law, numbers, poses, numbers[resultant.CAGE])
        answers = np.zeros((len(poses), resultant.ANSWERS))
        _press(*self._of, poses, _NODES, _WEIGHTS, answers)
        return answers

    def _at(self, pose: np.ndarray) -> np.ndarray:
        """Answers at a pose (12,), then at those around it, (13, ...): the last ones are known."""
        key = pose.tobytes()
        if key != self._last[0]:
            poses = np.concatenate([pose[None], _around(pose, self._shift)])
            self._last = key, self._look(poses)
        return self._last[1]

    def energy(self, pose: np.ndarray) -> float:
        """Energy stored at a pose (12,) of the journal in its bearing [J]."""
        return float(self._at(pose)[0, ENERGY])

    def smallest_gap(self, pose: np.ndarray) -> float:
        """At a pose (12,) of the journal in its bearing; negative in penetration [m]."""
        return -float(self._at(pose)[0, DEEPEST])

    def wrench(self, pose: np.ndarray) -> np.ndarray:
        """Force on the journal and moment about its centre, bearing axes, (6,) [N, N m].

        Of a rolling bearing no moment about the axis: its cage may go.
        """
        wrench = self._at(pose)[0, :6].copy()
        if self._joint.resultant is not None and not self._holds:
            axis = pose[[5, 8, 11]]
            wrench[3:] -= (wrench[3:] @ axis) * axis
        return wrench

    def inner_load(self, pose: np.ndarray) -> float:
        """With what its contacts press against each other; the wrench does not show it [N].

        The sum of all element loads, or springs' moment at hand: the load of a mount that gives way
        in rotations only.
        """
        answer = self._at(pose)[0]
        moment = float(np.linalg.norm(answer[3:6])) / self.reach if self._holds else 0.0
        return max(float(answer[resultant.SUM]), moment)

    def stiffness(self, pose: np.ndarray) -> np.ndarray:
        """Fall of the wrench per displacement [m] and turn [rad] of the journal, (6, 6).

        By central differences: the error of one-sided ones exceeds what says where a journal rests
        whose load leaves that nearly open.
        """
        ends = self._at(pose)[1:, :6]
        return np.asarray(((ends[::2] - ends[1::2]) / (2.0 * self._shift[:, None])).T)


# Poses about a pose lie one after the other in one array of 12 x 12 numbers: back and forth along
# x, y, z, then back and forth about them. Where each of them differs is known beforehand, so that
# all are written at once: this is asked for at every state that is tried.

_BACK_AND_FORTH = np.array([-1.0, 1.0] * 6)
_SHIFTED = 12 * np.arange(6) + np.arange(6) // 2
"""Places of the coordinate along which each of the first six poses is moved."""
_TURNED_ROWS = 3 + np.arange(3) + 3 * np.array([[1, 1, 2, 2, 0, 0], [2, 2, 0, 0, 1, 1]])[:, :, None]
"""Places within a pose of the two rows of its rotation that a turn about each axis turns into each
other, (2, 6, 3)."""
_TURNED = _TURNED_ROWS + 12 * np.arange(6, 12)[:, None]
"""The same among all poses."""


def _around(pose: np.ndarray, size: np.ndarray) -> np.ndarray:
    """A pose (12,) moved back and forth along and about each axis by `size` (6,), (12, 12)."""
    shifts = size.repeat(2) * _BACK_AND_FORTH
    angles = shifts[6:].tolist()
    cosine, sine = (np.array([*map(of, angles)])[:, None] for of in (math.cos, math.sin))
    first, second = pose[_TURNED_ROWS]
    poses = pose[None].repeat(12, axis=0).ravel()
    poses[_SHIFTED] += shifts[:6]
    poses[_TURNED[0]] = cosine * first - sine * second
    poses[_TURNED[1]] = sine * first + cosine * second
    return poses.reshape(12, 12)


# What loads do to a machine that stands: energies of springs and stops, and given forces.


_MOTION = 1e-6
"""Displacement by which stiffnesses are found [m or rad]."""

_NUMBERS = ctypes.POINTER(ctypes.c_double)


def relative_pose(data: pin.Data, frames: Carriers) -> np.ndarray:
    """Pose of the second frame in the first: origin, then rotation row by row, (12,)."""
    pose = pose_between(data, frames)
    return np.concatenate([pose.translation, pose.rotation.ravel()])


def relative_motion(data: pin.Data, frames: Carriers, signs: np.ndarray) -> np.ndarray:
    """Motion of the second frame's origin in axes of the first, per velocity, (6, nv)."""
    return motion_between(data, frames, data.J.reshape(6, -1) * signs)


class StaticLoads:
    """The loads of a machine at time 0.

    What a load stores energy for has a potential; anything else, such as a wrench, a damper at a
    moving start or a compiled controller, is a given force. What sampled controllers will give is
    not known yet and not counted, nor is friction that grows with a joint's load.
    """

    def __init__(
        self, loads: Mapping[str, Load], mechanism: Mechanism, sites: Sequence[LoadSite]
    ) -> None:
        self._members = [
            _StaticLoad(load, site, mechanism.model.nv)
            for load, site in zip(loads.values(), sites, strict=True)
        ]

    def nonpotential_forces(
        self, model: pin.Model, data: pin.Data, q: np.ndarray, v: np.ndarray
    ) -> np.ndarray:
        """Generalised forces of what is no potential, (nv,)."""
        pin.computeJointJacobians(model, data, q)
        forces = np.zeros(model.nv)
        for member in self._members:
            x, jacobian = member.place(data, q), member.jacobian(data)
            force = member.force(x, jacobian @ v)
            if member.load.stores:
                force = force - member.force(x, np.zeros(len(jacobian)))
            finite = np.nan_to_num(force, posinf=0.0, neginf=0.0)
            forces += member.force_jacobian(data).T @ finite
        return forces

    def wrenches(self, mechanism: Mechanism, q: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """What pushes on which bodies where all stands: Pinocchio's joint that carries the body,
        force and moment about the world's origin (6,) [N, N m]; after `pin.computeJointJacobians`.
        """
        data, wrenches = mechanism.data, []
        for member in self._members:
            x, site = member.place(data, q), member.site
            answer = np.nan_to_num(member.force(x, np.zeros(len(x))), posinf=0.0, neginf=0.0)
            if site.carriers:
                (i, first), (j, second) = site.carriers
                turn, centre = (data.oMi[i] * first).rotation, (data.oMi[j] * second).translation
                pushes = [(i, j, turn @ answer[:3], turn @ answer[3:], centre)]
            else:
                pushes = [
                    self._on_joint(mechanism, at, effort)
                    for at, effort in zip(site.outputs, answer, strict=True)
                ]
            for i, j, force, moment, point in pushes:
                wrench = np.concatenate([force, moment + np.cross(point, force)])
                wrenches += [(j, wrench), (i, -wrench)]
        return wrenches

    @staticmethod
    def _on_joint(mechanism: Mechanism, at: int, effort: float) -> tuple[Any, ...]:
        """An effort on the coordinate of a joint: its parent, its child, force, moment, point."""
        name, nothing = mechanism.coordinates[at].joint, np.zeros(3)
        i, j = sorted(index for index, _ in mechanism.frames(name))
        column, point = mechanism.data.J[:, at], mechanism.data.oMi[j].translation
        if mechanism.description.joints[name].slides:
            return i, j, effort * column[:3], nothing, point
        return i, j, nothing, effort * column[3:], point

    def energy(self, data: pin.Data, q: np.ndarray) -> float:
        """Energy that they store [J]; data has the bodies' places."""
        stores = [member for member in self._members if member.load.stores]
        return float(sum(m.load.energy(m.place(data, q)[None], m.site.numbers)[0] for m in stores))

    def slopes(self, data: pin.Data, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (nv,) and curvature (nv, nv) of the energy; data has the joints' Jacobians."""
        gradient, curvature = np.zeros(len(q)), np.zeros((len(q), len(q)))
        for member in self._members:
            if member.load.stores:
                x, moves = member.place(data, q), member.jacobian(data)
                pushes = member.force_jacobian(data)
                gradient -= pushes.T @ member.force(x, np.zeros(len(moves)))
                curvature += pushes.T @ member.stiffness(x) @ moves
        return gradient, curvature


class _StaticLoad:
    """One load."""

    def __init__(self, load: Load, site: LoadSite, nv: int) -> None:
        self.load, self.site = load, site
        self._law = compiled_law(load).ctypes
        self._identity = np.eye(nv)

    def place(self, data: pin.Data, q: np.ndarray) -> np.ndarray:
        if self.site.carriers is None:
            return q[list(self.site.inputs)]
        return relative_pose(data, self.site.carriers)

    def jacobian(self, data: pin.Data) -> np.ndarray:
        if self.site.carriers is None:
            return self._identity[list(self.site.inputs)]
        assert self.site.signs is not None
        return relative_motion(data, self.site.carriers, self.site.signs)

    def force_jacobian(self, data: pin.Data) -> np.ndarray:
        if self.site.carriers is None:
            return self._identity[list(self.site.outputs)]
        return self.jacobian(data)

    def force(self, x: np.ndarray, rate: np.ndarray) -> np.ndarray:
        out = np.zeros(self.site.size)
        inputs = [np.ascontiguousarray(values, float) for values in (x, rate, self.site.numbers)]
        self._law(0.0, *(array.ctypes.data_as(_NUMBERS) for array in (*inputs, out)))
        if self.site.bounds:
            out = np.clip(out, -np.array(self.site.bounds), self.site.bounds)
        return out

    def stiffness(self, x: np.ndarray) -> np.ndarray:
        """How its answer at rest falls with what it sees, by differences."""
        if self.site.carriers:
            rate, places = np.zeros(6), _around(x, np.full(6, _MOTION))
        else:
            rate, steps = np.zeros(len(x)), _MOTION * np.eye(len(x))
            places = np.concatenate([[x - step, x + step] for step in steps])
        ends = np.array([self.force(place, rate) for place in places])
        return ((ends[::2] - ends[1::2]) / (2.0 * _MOTION)).T


# Where a machine stands: the equilibrium of all journals under gravity and drives.
#
# The potential energy of gravity, drives (springs about their reference), gears, loads and
# contacts is made as small as can be by Newton's method in a trust region; docs/statics.md says
# what is solved, and what rest means where the start moves. A run that begins at rest and an
# error budget (`accuracy.rest`) both ask here.


TOLERANCE = 1e-4
"""Unbalanced force, relative to the largest force of a joint, below which a state is at rest."""
SOLVED = 1e-10
"""The same at which the search ends."""
BALANCED = 1e-7
"""The same at which it is not begun anew: judged, far below `TOLERANCE` and far above rounding."""
MOST_TRIALS = 100
"""States tried of all joints together, before the search goes on joint by joint or is given up:
judged, as `MOST_LOCAL` and `MOST_ROUNDS` are; the shipped scenarios take 2 to 60 in all, the 3-RRR
1,100."""
MOST_LOCAL = 150
"""States tried of one joint."""
MOST_ROUNDS = 10
"""How often forces that are no potential are reckoned anew where the machine then rests."""
TOWARDS_MIDDLE = 1e-5
"""Stiffness towards the start in the first search, relative to the weight per clearance: judged; a
tenth of `TOLERANCE`."""
_LEAST_GAIN, _GOOD_GAIN = 0.1, 0.5
"""Parts of the gain that the quadratic promises: below the first a step is not taken, above the
second the next may be longer (judged, as usual in trust regions)."""
_LEAST_RADIUS = 1e-12
"""Trust radius in clearances below which the search ends: steps of it are rounding."""
_ERROR_ROUNDS = 12
"""How often a motor is moved for its gear's kinematic error, whose slope is far below one."""
_ANGLE = 1e-3
"""Displacement by which a joint is asked what its ideal twin would follow [m or rad]."""


@dataclass(frozen=True)
class Rest:
    """An equilibrium, or where the search for it ended."""

    q: np.ndarray
    """Configuration, shape (nq,)."""
    residual: float
    """Largest unbalanced force: work per way, for ways as long as the clearance [N]."""
    load: float
    """Largest elastic force of a joint, or the weight if none is pressed [N]."""
    trials: int
    inside: bool
    places: Mapping[str, np.ndarray]
    """By joint that the search took alone first, the coordinates of its journal."""

    @property
    def solved(self) -> bool:
        """Whether what is left unbalanced is little beside the load, less than friction holds."""
        return bool(self.inside and self.residual <= TOLERANCE * self.load)


def limited_freedoms(joint: Clearance) -> list[str]:
    """Those of a joint's freedoms that nothing but its clearance limits, of `VIRTUAL_LINK`."""
    freedoms = []
    for axis, part in enumerate(VIRTUAL_LINK[:3]):
        centre = _ANGLE * np.eye(3)[axis]
        held = joint.resultant is not None or joint.start_travels.get(part, 0.0) > 0.0
        if part in joint.freedoms and held:
            _, follows = joint.ideal_part(np.eye(3), centre)
            freedoms += [part] if abs(follows[axis]) < 0.5 * _ANGLE else []
    for axis, part in zip((2, 1, 0), VIRTUAL_LINK[3:], strict=True):
        turn = pin.exp3(_ANGLE * np.eye(3)[axis])
        if part in joint.freedoms:
            follows, _ = joint.ideal_part(turn, np.zeros(3))
            freedoms += [part] if np.linalg.norm(pin.log3(follows)) < 0.5 * _ANGLE else []
    return freedoms


def weight_curvature(model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
    """Second derivatives of gravity's potential, shape (nv, nv), of a model of simple joints.

    Above the diagonal Pinocchio 4.1 gives other numbers than differences of its own gravity
    (`tests/physics/test_rest.py`), so those below are taken for both.
    """
    slopes = pin.computeGeneralizedGravityDerivatives(model, data, q).reshape(model.nv, model.nv)
    return np.where(_below_diagonal(model.nv), slopes, slopes.T)


@lru_cache(maxsize=16)
def _below_diagonal(size: int) -> np.ndarray:
    return np.tri(size, dtype=bool)


def _least_size(sizes: np.ndarray) -> float:
    """Singular value of closed loops that is rounding, by the others [m per rad or m]."""
    return 1e-9 * max(float(sizes.max(initial=0.0)), 1e-9)


class StaticEquilibrium:
    """Potential energy of a machine that stands, and its slopes.

    Args:
        mechanism, drives, friction, loads: what stands, and what acts on it.
        bodies: its model, payloads in hand.
        q, v: of the start, journals centred or where they are given, shapes (nq,) and (nv,).
        rows, servos: what the kernels know of the drives; what follows a motion without one of
            finite stiffness is held where `q` has it.
        reference: positions, speeds and torques of the drives' columns at time 0.
        acceleration: of the reference, journals at rest in their bearings, shape (nv,).
        given: coordinates that stay where they are.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        bodies: pin.Model,
        q: np.ndarray,
        v: np.ndarray,
        drives: Mapping[str, Drive],
        rows: np.ndarray | Sequence[np.void],
        servos: np.ndarray | Sequence[np.void],
        reference: np.ndarray,
        friction: Mapping[str, JointFriction],
        loads: StaticLoads,
        acceleration: np.ndarray,
        fixed: Collection[int] = (),
    ) -> None:
        self._mechanism, self._model, self._data = mechanism, bodies, bodies.createData()
        self._start, self._speed = q.copy(), v.copy()
        self._acceleration, self._loads = acceleration, loads
        nv = bodies.nv
        self._elastic = {name: ElasticJoint(joint) for name, joint in mechanism.clearance.items()}
        self._frames = {name: mechanism.frames(name) for name in mechanism.clearance}
        self._signs = {name: mechanism.signs(name) for name in mechanism.clearance}
        self._springs, self._constant = np.zeros(nv), np.zeros(nv)
        self._unbent = self._start.copy()
        self._gears = [
            (mechanism.motor(name), mechanism.coordinate(name), gear)
            for name, gear in mechanism.gears.items()
        ]
        self._trailing: dict[int, int] = {}  # motors whose encoder sees the link
        self._through: dict[int, tuple[float, float, float]] = {}
        """Spring, torque and lever with which such a motor's drive acts on the link now."""
        self._pull = np.zeros(0)
        self._bands, self._reach = np.zeros(nv), np.full(nv, np.inf)
        """By which springs of drives give way at first, and what they are bent by at most."""
        sprung = self._drives(servos, rows, reference, drives)
        for name, losses in friction.items():
            at = mechanism.coordinate(name)
            self._constant[at] -= float(losses.torque(self._speed[at : at + 1])[0])
        self._ideal = sorted(set(mechanism.loops) - set(mechanism.clearance))
        self._inertia, self._load_forces = np.zeros(nv), np.zeros(nv)
        self.refresh(self._start)
        self.basis = self._find_basis(sprung, drives, set(fixed))
        self.scale, self._rooms = self._scales()
        weightless = np.abs(self._inertia) + np.abs(self._load_forces) + np.abs(self._constant)
        self._least_load = self.weight() or float(weightless.max(initial=0.0))
        """What residual forces are compared with where nothing touches."""

    def _drives(
        self,
        servos: np.ndarray | Sequence[np.void],
        rows: np.ndarray | Sequence[np.void],
        reference: np.ndarray,
        drives: Mapping[str, Drive],
    ) -> set[int]:
        """Make springs of drives, of servos with a dead band; returns coordinates that they hold.

        Friction and I terms of servos, counts of their encoders and samples are left out.
        """
        mechanism, nu = self._mechanism, len(reference) // 3
        sprung: set[int] = set()
        followed = {mechanism.motor(n): n for n, drive in drives.items() if drive.follows}

        def ahead(row: np.void) -> float:
            return float(reference[nu + int(row["column"])] - self._speed[int(row["encoder"])])

        def hold(row: np.void, spring: float, torque: float) -> None:
            at, encoder = int(row["coordinate"]), int(row["encoder"])
            self._springs[encoder] += spring
            self._unbent[encoder] = reference[int(row["column"])]
            self._constant[encoder] += torque
            if encoder != at:  # a motor whose encoder sees the link trails behind the play
                self._trailing[at], self._through[at] = encoder, (spring, torque, 1.0)
            sprung.update((encoder, mechanism.coordinate(followed[at])))

        for row in servos:
            encoder, stall = int(row["encoder"]), row["stall"]
            self._bands[encoder] = row["dead_band"]
            self._reach[encoder] = min(row["voltage"], row["limit"] / stall) / row["p_gain"]
            hold(row, float(stall * row["p_gain"]), float(stall * row["d_gain"] * ahead(row)))
        for row in rows:
            at = int(row["coordinate"])
            if at not in followed or row["armature"] > 0.0:
                continue
            torque = float(reference[2 * nu + int(row["column"])] + row["kd"] * ahead(row))
            if row["kp"] == 0.0:  # the back-EMF of a servo's motor, which may trail
                self._constant[self._trailing.get(at, at)] += torque
            else:
                hold(row, float(row["kp"]), torque)
        geared = {mechanism.motor(name) for name in mechanism.gears}
        # Links hang on the teeth of prescribed motors too.
        for at in geared & set(followed) - set(self._trailing):
            sprung.add(mechanism.coordinate(followed[at]))
        return sprung

    def gives_way(self, coordinate: int, effort: float) -> tuple[float, float]:
        """How far what holds a coordinate gives way to an effort, beyond a dead band and within it.

        Infinite where it cannot hold it, zero where nothing of finite stiffness holds [rad or m].
        """
        spring = float(self._springs[coordinate])
        if spring == 0.0:
            return 0.0, 0.0
        bent = (effort + float(self._constant[coordinate])) / spring
        if abs(bent) > self._reach[coordinate]:
            bent = math.copysign(math.inf, bent)
        return bent, float(self._bands[coordinate])

    def _pulls(self, q: np.ndarray) -> np.ndarray:
        """What the springs of drives are bent by (nv,), dead bands and limits counted."""
        away = self._unbent - q
        bent = np.minimum(np.maximum(np.abs(away) - self._bands, 0.0), self._reach)
        return np.asarray(np.copysign(bent, away))

    def _find_basis(
        self, sprung: set[int], drives: Mapping[str, Drive], fixed: set[int]
    ) -> np.ndarray:
        """Directions in which the machine can come to rest, shape (nv, n).

        Coordinates that only clearances limit, and those that springs of drives hold; joints that
        nothing drives, as far as loops lead them; of all that what keeps ideal loops closed.
        """
        mechanism, nv = self._mechanism, self._model.nv
        play, journals = set(), set()
        blocks: dict[str, set[int]] = {}
        for name, joint in mechanism.clearance.items():
            if name in mechanism.loops:
                continue
            members = {
                part: mechanism.coordinates.index(Coordinate(name, part)) for part in joint.freedoms
            }
            journals |= set(members.values())
            film = joint.film is not None and not joint.film[0].hybrid
            if not film and not fixed & set(members.values()):
                blocks[name] = {members[part] for part in limited_freedoms(joint)}
                play |= blocks[name]
        journals -= {mechanism.coordinate(n) for n in mechanism.joints if n in mechanism.clearance}
        identity = np.eye(nv)
        columns = [identity[:, sorted((play | sprung) - fixed)]]
        # What moves one journal only, unless it has to close an ideal loop.
        self._blocks = {} if self._ideal else {n: sorted(at) for n, at in blocks.items() if at}
        # Joints that no drive holds are held where they are, as far as loops leave them free.
        held = {mechanism.motor(n) for n, drive in drives.items() if drive.follows}
        held |= {mechanism.coordinate(n) for n, drive in drives.items() if drive.follows}
        held |= journals | play | sprung | fixed | set(map(int, self._trailing))
        held |= {mechanism.motor(n) for n in mechanism.gears}
        undriven = np.array([i for i in range(nv) if i not in held], int)
        if mechanism.loops and len(undriven):
            rows = closing_rows(mechanism, self._start)[:, undriven]
            _, sizes, right = np.linalg.svd(rows, full_matrices=False)
            columns.append(identity[:, undriven] @ right[sizes > _least_size(sizes)].T)
        basis = np.hstack(columns)
        self._movable = basis
        if self._ideal and basis.shape[1]:
            rows = closing_rows(mechanism, self._start, self._ideal) @ basis
            _, sizes, right = np.linalg.svd(rows)
            basis = basis @ right[int(np.sum(sizes > _least_size(sizes))) :].T
        return basis

    def _scales(self) -> tuple[np.ndarray, np.ndarray]:
        """How far each direction moves until a journal has crossed its clearance, and that [m].

        Clearances of one mechanism may differ by orders of magnitude: of a journal and of springs.
        """
        joints = self._mechanism.clearance
        pin.computeJointJacobians(self._model, self._data, self._start)
        scale, rooms = np.full((2, self.basis.shape[1]), np.inf)
        # Springs are as far from their middle as the weight bends them.
        bent = max(self.weight(), 1.0)
        least = {
            name: joint.search_radius * (1.0 if joint.springs is None else bent)
            for name, joint in joints.items()
        }
        for name in joints:
            moves = self._jacobian(name) @ self.basis
            motion = np.linalg.norm(moves[:3], axis=0)
            motion += self._elastic[name].reach * np.linalg.norm(moves[3:], axis=0)
            with np.errstate(divide="ignore"):
                crossing = least[name] / motion
            rooms = np.where(crossing < scale, least[name], rooms)
            scale = np.minimum(scale, crossing)
        plays = [gear.play / 2.0 for _, _, gear in self._gears]
        room = min(least.values(), default=min(plays, default=1e-4) or 1e-4)
        return np.where(np.isfinite(scale), scale, room), np.where(np.isfinite(rooms), rooms, room)

    def refresh(self, q: np.ndarray) -> None:
        """Reckon anew, in configuration q, what is no potential: inertia forces of a moving start,
        given loads, and what kinematic errors make of the torques of motors that trail behind their
        teeth.
        """
        for m, k, gear in self._gears:
            if m in self._through and gear.error_terms:
                spring, torque, lever = self._through[m]
                now = 1.0 + float(gear.kinematic_error(self.align_motors(q)[m])[1])
                change = 1.0 / now - 1.0 / lever
                self._springs[k] += change * spring
                self._constant[k] += change * torque
                self._through[m] = spring, torque, now
        if self._speed.any() or self._acceleration.any():
            effort = pin.rnea(self._model, self._data, q, self._speed, self._acceleration)
            weight = pin.computeGeneralizedGravity(self._model, self._data, q)
            self._inertia = effort - weight
        self._load_forces = self._loads.nonpotential_forces(self._model, self._data, q, self._speed)

    def _pose(self, name: str) -> np.ndarray:
        return relative_pose(self._data, self._frames[name])

    def _jacobian(self, name: str) -> np.ndarray:
        return relative_motion(self._data, self._frames[name], self._signs[name])

    def wrenches(self, q: np.ndarray) -> dict[str, np.ndarray]:
        pin.forwardKinematics(self._model, self._data, q)
        return {name: contacts.wrench(self._pose(name)) for name, contacts in self._elastic.items()}

    def potential(
        self, q: np.ndarray, names: Collection[str]
    ) -> tuple[float, np.ndarray, np.ndarray, float]:
        """Potential energy [J], of contacts of the joints `names`, its gradient (nv,) and curvature
        (nv, nv), and the largest joint force [N]. The energy is infinite where a law fails.
        """
        model, data, away = self._model, self._data, q - self._start
        # Gravity.
        curvature = weight_curvature(model, data, q)
        gradient = pin.computeGeneralizedGravity(model, data, q).copy()
        pin.computeJointJacobians(model, data, q)
        energy = pin.computePotentialEnergy(model, data)
        # Springs of drives with dead band and limit; efforts and inertia forces that are constant.
        pulls, far = self._pulls(q), np.abs(self._unbent - q) - self._bands
        bends = (self._bands == 0.0) | (pulls != 0.0)
        bent = np.abs(pulls)
        curvature += np.diag(np.where(bends & (bent < self._reach), self._springs, 0.0))
        gradient += self._inertia - self._constant - self._springs * pulls
        energy += float(self._springs @ (bent * (np.maximum(far, 0.0) - 0.5 * bent)))
        energy -= float(self._constant @ away)
        energy += float((self._inertia - self._load_forces) @ away) + self._loads.energy(data, q)
        slope, bend = self._loads.slopes(data, q)
        gradient, curvature = gradient + (slope - self._load_forces), curvature + bend
        load = 0.0  # contacts
        for name in names:
            contacts, pose, moves = self._elastic[name], self._pose(name), self._jacobian(name)
            wrench = contacts.wrench(pose)
            energy += contacts.energy(pose)
            gradient -= moves.T @ wrench
            curvature += moves.T @ contacts.stiffness(pose) @ moves
            load = max(load, float(np.linalg.norm(wrench[:3])), contacts.inner_load(pose))
        for m, k, gear in self._gears:
            if m in self._trailing:
                continue
            stored, torque, stiffness = gear.first_load(float(gear.twist(q[m], q[k])))
            _, rise, bend = gear.kinematic_error(float(q[m]))
            rates = np.zeros(len(q))
            rates[m], rates[k] = 1.0 + rise, -1.0
            energy += stored
            gradient += torque * rates
            curvature += stiffness * np.outer(rates, rates)
            curvature[m, m] += torque * bend
        if self._pull.any():  # the soft spring towards the start (`settle`)
            parts = self.basis / self.scale
            moved = away @ parts
            energy += 0.5 * float(self._pull @ moved**2)
            gradient += parts @ (self._pull * moved)
            curvature += self._pull * parts @ parts.T
        return float(energy) if np.isfinite(energy) else np.inf, gradient, curvature, load

    def close(self, q: np.ndarray) -> np.ndarray:
        """q with its ideal loops closed again, which displacements open a little."""
        for _ in range(2 if self._ideal else 0):
            q = q + self._movable @ newton_step(
                self._mechanism, q, self._movable, loops=self._ideal
            )
        return q

    def align_motors(self, q: np.ndarray) -> np.ndarray:
        """q with those motors behind their teeth whose encoders see the link."""
        q = q.copy()
        for m, k, gear in self._gears:
            if m in self._trailing:
                torque = self._springs[k] * self._pulls(q)[k] + self._constant[k]
                q[m] = q[k] + gear.first_twist(float(torque))
                for _ in range(_ERROR_ROUNDS):
                    q[m] -= gear.twist(q[m], q[k]) - gear.first_twist(float(torque))
        return q

    def weight(self) -> float:
        """Weight of all bodies [N]."""
        gravity = float(np.linalg.norm(self._model.gravity.linear))
        return gravity * float(pin.computeTotalMass(self._model))

    def settle(
        self, near: np.ndarray | None = None, places: Mapping[str, np.ndarray] | None = None
    ) -> Rest:
        """Search downhill for the equilibrium.

        Where loads leave open where a journal rests (one whose axis is vertical, pressed to its
        bore by a moment alone), all states of a whole set are equilibria; a soft spring towards the
        start, taken away in the end, leads to the one nearest to it whatever the way.

        `near`: a configuration (nq,) not far from it; from where the search of all joints ends
        there, or else from the start, it goes on joint by joint, for what the others do to a
        joint's load is of second order.
        `places`: of another search (`Rest.places`), those of joints that bear about the same.
        """
        places = places or {}
        self.refresh(self._start)
        self._pull = TOWARDS_MIDDLE * self.weight() * self._rooms
        q, trials, residual, load = self._start, 0, np.inf, 1.0
        if near is not None:
            q, residual, load, trials = self._newton_descent(near, MOST_TRIALS)
        if residual > BALANCED * load:
            for name in places.keys() & self._blocks.keys():
                q[self._blocks[name]] = places[name]
            for name, at in self._blocks.items():
                if name not in places:
                    q, *_ = self._newton_descent(q, MOST_LOCAL, {name}, at)
            q, _, _, tried = self._newton_descent(q, MOST_TRIALS)
            trials += tried
        self._pull = np.zeros(0)
        for _ in range(MOST_ROUNDS):
            q, residual, load, tried = self._newton_descent(q, MOST_TRIALS)
            trials += tried
            # Inertia and what is no potential, where the machine rests.
            self.refresh(q)
            slope = self.potential(q, self._elastic)[1] @ self.basis * self.scale
            residual = float(np.abs(slope / self._rooms).max(initial=0.0))
            if residual <= BALANCED * load:
                break
        q = self.close(q)
        places = {name: q[at] for name, at in self._blocks.items()}
        pin.forwardKinematics(self._model, self._data, q)
        inside = all(
            self._elastic[name].smallest_gap(self._pose(name)) > -joint.depth_limit
            for name, joint in self._mechanism.clearance.items()
        )
        load = load or self._least_load
        return Rest(self.align_motors(q), residual, load, trials, inside, places)

    def _newton_descent(
        self,
        q: np.ndarray,
        most: int,
        names: Collection[str] | None = None,
        at: Collection[int] = (),
    ) -> tuple[np.ndarray, float, float, int]:
        """Newton's method in a trust region, from q; returns where it ends, the residual and the
        load there [N], and how many states were tried.

        Steps are of `basis` in units of `scale`: a length of 1 crosses a clearance. One that gains
        enough of what the quadratic promises is taken; others make the region smaller.

        `most`: states to try; `names`: joints whose contacts count, None all; `at`: coordinates of
        which one must move with a direction for it to be searched, none: all directions.
        """
        names = self._elastic if names is None else names
        directions, rooms = self.basis * self.scale, self._rooms
        if at:
            active = np.abs(directions[list(at)]).any(axis=0)
            directions, rooms = directions[:, active], rooms[active]
        radius, trials = 1.0, 0
        state = self._look(q, directions, names)
        while True:
            residual = float(np.abs(state.slope / rooms).max(initial=0.0))
            load = state.load
            if (
                residual <= SOLVED * (load or self._least_load)
                or trials >= most
                or radius < _LEAST_RADIUS
            ):
                return state.q, residual, load, trials
            step = minimize_in_ball(state.slope, state.bend, radius)
            expected = -float(state.slope @ step + 0.5 * step @ state.bend @ step)
            size = float(np.linalg.norm(step))
            trial = self._look(self.close(state.q + directions @ step), directions, names)
            trials += 1
            straight = state.gain(trial, expected)
            if straight <= _LEAST_GAIN and trials < most:
                # Along curved walls, and where a wall is met: a second step leads back to it.
                step = minimize_in_ball(trial.slope, trial.bend, size)
                trial = self._look(self.close(trial.q + directions @ step), directions, names)
                trials += 1
            gain = state.gain(trial, expected)
            if not gain > _LEAST_GAIN:
                radius = 0.25 * size
                continue
            if gain > _GOOD_GAIN or straight <= _LEAST_GAIN:
                radius = max(radius, 2.0 * size)
            state = trial

    def _look(self, q: np.ndarray, directions: np.ndarray, names: Collection[str]) -> TrialState:
        height, gradient, curvature, load = self.potential(q, names)
        bend = directions.T @ curvature @ directions
        return TrialState(q, height, directions.T @ gradient, bend, load)
