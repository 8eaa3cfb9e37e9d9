"""Static equilibrium: where all journals rest under gravity, drives and loads.

A machine rests where its potential energy is least (docs/statics.md has the formula, and says what
rest means where the start moves):

1. `ElasticJoint` gives energy, wrench and stiffness of one joint's contacts at a pose of its
   journal; `StaticLoads` those of springs and stops.
2. `StaticEquilibrium.potential` sums energy, gradient and curvature of gravity, drives (springs
   about their reference), gears, loads and contacts.
3. The search moves along `StaticEquilibrium.basis`, the directions that nothing but clearances and
   finite stiffnesses holds, scaled so that a step of length 1 crosses a clearance.
4. `StaticEquilibrium.settle` goes downhill by Newton's method in a trust region: each journal
   alone, then all together, at last without the soft spring that has led the search. Forces that
   are no potential (inertia, wrenches, dampers) are constant in between, and evaluated anew where
   the machine then rests, until they no longer change.

A run that begins at rest (`initial.find_rest`) and an error budget (`accuracy.rest`) both ask here.
"""

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

# The trust region's model and step: minimising a potential with corners in a few coordinates.


_ROUNDING = 1e-14
"""Relative rounding error of an energy."""


@dataclass(frozen=True)
class TrialState:
    """A state tried by the search; gradient and curvature are along the directions searched [J]."""

    q: np.ndarray
    energy: float
    gradient: np.ndarray
    curvature: np.ndarray
    load: float
    """Largest force of a joint [N]."""

    def gain(self, trial: TrialState, expected: float) -> float:
        """Fall of the energy to `trial`, relative to the expected one.

        Where the expected fall is below rounding: 1 if the gradient is smaller at `trial`, else 0.
        """
        if expected < _ROUNDING * max(abs(self.energy), expected):
            return float(np.linalg.norm(trial.gradient) < np.linalg.norm(self.gradient))
        return (self.energy - trial.energy) / expected


def minimize_in_ball(gradient: np.ndarray, curvature: np.ndarray, radius: float) -> np.ndarray:
    """Minimise a quadratic within a ball about the origin: the step of a trust region.

    The eigenvalues of the curvature are shifted until all are positive and the step is no longer
    than the radius; the shift is found by bisection.
    """
    # Eigen's, for on a busy machine the threads of numpy's wait for each other.
    spectrum = eigenpy.SelfAdjointEigenSolver(0.5 * (curvature + curvature.T))
    sizes, axes = spectrum.eigenvalues(), spectrum.eigenvectors()
    along = axes.T @ gradient
    least = 1e-13 * max(float(np.abs(sizes).max()), 1e-30)  # above rounding of the largest
    low = max(0.0, -float(sizes.min())) + least
    if sizes.min() > least and _length(along / sizes) <= radius:
        return -axes @ (along / sizes)  # Newton's step, unshifted
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


# Contacts of one joint at rest: their energy, wrench and stiffness.


_SHIFT_M = 1e-9
"""Displacement by which wrenches are differentiated [m]: of a force like depth^1.5 central
differences are then wrong by 1e-6 at 0.2 µm, and less where surfaces are pressed deeper."""
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
"""Gauss points and weights that integrate a law's force over the depth to its energy."""


@compiled
def _press(shape, dimensions, count, law, parameters, poses, nodes, weights, out):
    """Write wrench, energy and depth of the contacts of a joint at many poses into `out`.

    They stand where a law of a whole joint writes them (`contact.resultant`). `shape` is a `Shape`
    or the address of a touch, as for `geometry.touch`.
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
def _forces_at_depths(joint: Clearance, contact: int) -> tuple[np.ndarray, np.ndarray]:
    parameters = joint.normal.parameters(joint.contact_properties(contact))
    depths = np.geomspace(1e-10, joint.depth_limit, 600)  # from an atom on
    forces = np.gradient(elastic_energy(joint.normal, parameters, depths), depths)
    return np.maximum.accumulate(forces), depths


def depths(joint: Clearance, contact: int, force: np.ndarray) -> np.ndarray:
    """Depth of penetration of a joint's contact under normal forces [N], of their shape [m]."""
    return np.asarray(np.interp(force, *_forces_at_depths(joint, contact)))


class ElasticJoint:
    """The elastic contacts of one joint, without friction and damping.

    These are its surfaces, or the elements of a rolling bearing with the cage where it starts, or
    springs. Poses are of the journal in its bearing: centre [m], then rotation row by row, (12,).
    """

    def __init__(self, joint: Clearance) -> None:
        self._joint = joint
        self.reach = float(np.linalg.norm(joint.outline.size))
        """Farthest point of the journal from its centre [m]."""
        self._holds = joint.law in resultant.HOLDING
        self._shift = np.array([_SHIFT_M] * 3 + [_SHIFT_M / self.reach] * 3)
        self._last = b"", np.zeros((0, 0))
        """The last pose that was asked for, as bytes, and the answers there."""
        if joint.resultant is None:
            count = len(joint.contacts)
            parameters = np.zeros((count, MAX_PARAMETERS))
            for k in range(count):
                values = joint.normal.parameters(joint.contact_properties(k))
                parameters[k, : len(values)] = values
            dimensions = np.array([*joint.dimensions, *(0.0,) * 4])
            law = address(joint.normal)
            self._surfaces = int(joint.shape), dimensions, count, law, parameters

    def _answers(self, pose: np.ndarray) -> np.ndarray:
        """Answers at a pose and at the twelve around it (`_around`), as of `elastic.answers`."""
        key = pose.tobytes()
        if key != self._last[0]:
            poses = np.concatenate([pose[None], _around(pose, self._shift)])
            numbers = self._joint.resultant
            if numbers is not None:
                answers = elastic.answers(self._joint.law, numbers, poses, numbers[resultant.CAGE])
            else:
                answers = np.zeros((len(poses), resultant.ANSWERS))
                _press(*self._surfaces, poses, _NODES, _WEIGHTS, answers)
            self._last = key, answers
        return self._last[1]

    def energy(self, pose: np.ndarray) -> float:
        """Energy stored at a pose [J]."""
        return float(self._answers(pose)[0, ENERGY])

    def smallest_gap(self, pose: np.ndarray) -> float:
        """Smallest gap of all contacts at a pose, negative in penetration [m]."""
        return -float(self._answers(pose)[0, DEEPEST])

    def wrench(self, pose: np.ndarray) -> np.ndarray:
        """Force on the journal and moment about its centre, bearing axes, (6,) [N, N m].

        A rolling bearing gives no moment about its axis, for its cage is free to turn.
        """
        wrench = self._answers(pose)[0, :6].copy()
        if self._joint.resultant is not None and not self._holds:
            axis = pose[[5, 8, 11]]
            wrench[3:] -= (wrench[3:] @ axis) * axis
        return wrench

    def inner_load(self, pose: np.ndarray) -> float:
        """Load within the joint that its force does not show, as contacts press on each other [N].

        This is the sum of all element loads, or the moment of springs over the journal's reach: the
        load of a mount that gives way in rotations only.
        """
        answer = self._answers(pose)[0]
        moment = float(np.linalg.norm(answer[3:6])) / self.reach if self._holds else 0.0
        return max(float(answer[resultant.SUM]), moment)

    def stiffness(self, pose: np.ndarray) -> np.ndarray:
        """Fall of the wrench per displacement [m] and rotation [rad] of the journal, (6, 6).

        By central differences: the error of one-sided ones would exceed the small stiffness that
        says where a journal rests whose load leaves that nearly open.
        """
        ends = self._answers(pose)[1:, :6]
        return np.asarray(((ends[::2] - ends[1::2]) / (2.0 * self._shift[:, None])).T)


# The twelve poses around a pose, for differences: back and forth along x, y, z, then back and forth
# about them, one after the other in an array of 12 x 12 numbers. Which numbers differ from the
# pose's own is known beforehand, so that all are written at once: every trial state needs them.

_BACK_AND_FORTH = np.array([-1.0, 1.0] * 6)
_SHIFTED = 12 * np.arange(6) + np.arange(6) // 2
"""Index of the coordinate along which each of the first six poses is moved."""
_TURNED_ROWS = 3 + np.arange(3) + 3 * np.array([[1, 1, 2, 2, 0, 0], [2, 2, 0, 0, 1, 1]])[:, :, None]
"""Indices within a pose of the two rows of its rotation that a rotation about each axis mixes,
(2, 6, 3)."""
_TURNED = _TURNED_ROWS + 12 * np.arange(6, 12)[:, None]
"""The same indices in the array of all poses."""


def _around(pose: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Poses moved from a pose (12,) back and forth along and about each axis by `size` (6,),
    shape (12, 12).
    """
    shifts = size.repeat(2) * _BACK_AND_FORTH
    angles = shifts[6:].tolist()
    cosine, sine = (np.array([*map(of, angles)])[:, None] for of in (math.cos, math.sin))
    first, second = pose[_TURNED_ROWS]
    poses = pose[None].repeat(12, axis=0).ravel()
    poses[_SHIFTED] += shifts[:6]
    poses[_TURNED[0]] = cosine * first - sine * second
    poses[_TURNED[1]] = sine * first + cosine * second
    return poses.reshape(12, 12)


# Loads on a machine that stands: potentials of springs and stops, and given forces.


_MOTION = 1e-6
"""Displacement by which laws of loads are differentiated [m or rad]."""

_NUMBERS = ctypes.POINTER(ctypes.c_double)


def relative_pose(data: pin.Data, frames: Carriers) -> np.ndarray:
    """Pose of the second frame in the first: origin [m], then rotation row by row, (12,)."""
    pose = pose_between(data, frames)
    return np.concatenate([pose.translation, pose.rotation.ravel()])


def relative_motion(data: pin.Data, frames: Carriers, signs: np.ndarray) -> np.ndarray:
    """Jacobian of the second frame's motion relative to the first, axes of the first, (6, nv)."""
    return motion_between(data, frames, data.J.reshape(6, -1) * signs)


class StaticLoads:
    """The loads of a machine at time 0.

    Springs and stops have a potential; anything else, such as a wrench, a damper at a moving start
    or a compiled controller, is a given force. Sampled controllers, whose efforts are not known
    yet, and friction that grows with a joint's load are left out.
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
        """Generalised forces that have no potential, (nv,)."""
        pin.computeJointJacobians(model, data, q)
        forces = np.zeros(model.nv)
        for member in self._members:
            x, jacobian = member.place(data, q), member.jacobian(data)
            force = member.force(x, jacobian @ v)
            if member.load.stores:  # only its damping
                force = force - member.force(x, np.zeros(len(jacobian)))
            finite = np.nan_to_num(force, posinf=0.0, neginf=0.0)
            forces += member.force_jacobian(data).T @ finite
        return forces

    def wrenches(self, mechanism: Mechanism, q: np.ndarray) -> list[tuple[int, np.ndarray]]:
        """Wrenches of the loads on the bodies of a machine that stands.

        Each is the index of the Pinocchio joint that carries the body, with force and moment about
        the world's origin, world axes, (6,) [N, N m]. Call `pin.computeJointJacobians` before.
        """
        data, wrenches = mechanism.data, []
        for member in self._members:
            x, site = member.place(data, q), member.site
            answer = np.nan_to_num(member.force(x, np.zeros(len(x))), posinf=0.0, neginf=0.0)
            pushes: list[tuple[Any, ...]] = []  # bodies; force and moment on the second, at a point
            if site.carriers:
                (i, first), (j, second) = site.carriers
                turn, centre = (data.oMi[i] * first).rotation, (data.oMi[j] * second).translation
                pushes.append((i, j, turn @ answer[:3], turn @ answer[3:], centre))
            else:
                for at, effort in zip(site.outputs, answer, strict=True):
                    name, none = mechanism.coordinates[at].joint, np.zeros(3)
                    i, j = sorted(index for index, _ in mechanism.frames(name))  # parent, child
                    axis, slides = data.J[:, at], mechanism.description.joints[name].slides
                    force = effort * axis[:3] if slides else none
                    moment = none if slides else effort * axis[3:]
                    pushes.append((i, j, force, moment, data.oMi[j].translation))
            for i, j, force, moment, point in pushes:
                wrench = np.concatenate([force, moment + np.cross(point, force)])
                wrenches += [(j, wrench), (i, -wrench)]
        return wrenches

    def energy(self, data: pin.Data, q: np.ndarray) -> float:
        """Energy stored in springs and stops [J]; `data` has the bodies' poses."""
        stores = [member for member in self._members if member.load.stores]
        return float(sum(m.load.energy(m.place(data, q)[None], m.site.numbers)[0] for m in stores))

    def slopes(self, data: pin.Data, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Gradient (nv,) and curvature (nv, nv) of `energy`; `data` has the joints' Jacobians."""
        gradient, curvature = np.zeros(len(q)), np.zeros((len(q), len(q)))
        for member in self._members:
            if member.load.stores:
                x, moves = member.place(data, q), member.jacobian(data)
                pushes = member.force_jacobian(data)
                gradient -= pushes.T @ member.force(x, np.zeros(len(moves)))
                curvature += pushes.T @ member.stiffness(x) @ moves
        return gradient, curvature


class _StaticLoad:
    """One load: the position x that its law sees, the force it answers with, and their Jacobians.

    A load on coordinates has those as x; one between frames has their relative pose (12,).
    """

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
        """Fall of the force at rest with x (of a pose: with its six motions), by differences."""
        if self.site.carriers:
            rate, places = np.zeros(6), _around(x, np.full(6, _MOTION))
        else:
            rate, steps = np.zeros(len(x)), _MOTION * np.eye(len(x))
            places = np.concatenate([[x - step, x + step] for step in steps])
        ends = np.array([self.force(place, rate) for place in places])
        return ((ends[::2] - ends[1::2]) / (2.0 * _MOTION)).T


# The equilibrium of a whole machine.


TOLERANCE = 1e-4
"""Unbalanced force, relative to the largest force of a joint, below which a state is at rest."""
SOLVED = 1e-10
"""Unbalanced force, likewise relative, at which a descent ends."""
BALANCED = 1e-7
"""Unbalanced force, likewise relative, below which no further descent begins: judged, far below
`TOLERANCE` and far above rounding."""
MOST_TRIALS = 100
"""States tried with all joints together, before the search goes on joint by joint or is given up:
judged, as `MOST_LOCAL` and `MOST_ROUNDS` are; the shipped scenarios take 2 to 60 in all, the 3-RRR
1,100."""
MOST_LOCAL = 150
"""States tried with one joint alone."""
MOST_ROUNDS = 10
"""Times that forces without potential are evaluated anew where the machine then rests."""
TOWARDS_MIDDLE = 1e-5
"""Stiffness of the soft spring towards the start, relative to the weight per clearance: judged; a
tenth of `TOLERANCE`."""
_LEAST_GAIN, _GOOD_GAIN = 0.1, 0.5
"""Parts of the fall of energy that the quadratic model promises: a step with less than the first is
rejected, one with more than the second may be followed by a longer one (judged, as usual in trust
regions)."""
_LEAST_RADIUS = 1e-12
"""Trust radius in clearances below which a descent ends: steps of it are rounding."""
_ERROR_ROUNDS = 12
"""Fixed-point iterations for a motor behind the kinematic error of its gear, whose slope is far
below one."""
_ANGLE = 1e-3
"""Displacement that shows which motions the ideal twin of a joint would follow [m or rad]."""


@dataclass(frozen=True)
class Rest:
    """An equilibrium, or where the search for it ended."""

    q: np.ndarray
    """Configuration, shape (nq,)."""
    residual: float
    """Largest unbalanced force: slope of the energy along a motion, per metre of clearance crossed
    [N]."""
    load: float
    """Largest elastic force of a joint, or the weight if none is pressed [N]."""
    trials: int
    """Number of states tried."""
    inside: bool
    """Whether no journal has broken out of its bearing, deeper than its `depth_limit`."""
    places: Mapping[str, np.ndarray]
    """Coordinates of each journal that the search first moves by itself, by joint."""

    @property
    def solved(self) -> bool:
        """Whether the unbalanced force is small beside the load, less than friction would hold."""
        return bool(self.inside and self.residual <= TOLERANCE * self.load)


def limited_freedoms(joint: Clearance) -> list[str]:
    """Freedoms of a joint, of `VIRTUAL_LINK`, that nothing but its clearance limits.

    These are the motions that the ideal joint would not follow.
    """
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
    """Curvature of gravity's potential, shape (nv, nv), for a model of joints with one coordinate.

    Above the diagonal Pinocchio 4.1 gives other numbers than differences of its own gravity
    (`tests/physics/test_rest.py`), so those below are taken for both.
    """
    slopes = pin.computeGeneralizedGravityDerivatives(model, data, q).reshape(model.nv, model.nv)
    return np.where(np.tri(model.nv, dtype=bool), slopes, slopes.T)


def _least_size(sizes: np.ndarray) -> float:
    """Singular value of a loops' Jacobian up to which it is rounding [m per rad or m]."""
    return 1e-9 * max(float(sizes.max(initial=0.0)), 1e-9)


class StaticEquilibrium:
    """Potential energy of a machine at rest, with its derivatives, and the search for its minimum.

    Args:
        mechanism, drives, friction, loads: what stands, and what acts on it.
        bodies: its model, payloads in hand.
        q, v: state at the start, journals centred or where they are given, (nq,) and (nv,).
        rows, servos: the drives' rows of the kernels' tables (`layout`); a joint that follows the
            motion without one of finite stiffness is held where `q` has it.
        reference: positions, speeds and torques of the drives' columns at time 0.
        acceleration: acceleration of the reference, journals at rest in their bearings, (nv,).
        fixed: coordinates that stay where they are.

    Attributes:
        basis: directions in which the machine can come to rest, shape (nv, n).
        scale: length along each of them that crosses a clearance, shape (n,).
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
        # Drives are springs on the coordinates that their encoders see. A motor whose encoder sees
        # the link trails: it is no unknown of the search, but is placed behind its teeth at the end
        # (`align_motors`), and its drive acts on the link directly.
        self._stiffness, self._constant = np.zeros(nv), np.zeros(nv)
        """Stiffness of the drives' springs [N m/rad or N/m], and constant efforts [N m or N]."""
        self._unbent = self._start.copy()
        """Positions at which the springs are unbent [rad or m]."""
        self._dead_bands, self._most_bent = np.zeros(nv), np.full(nv, np.inf)
        """Deflection without an effort, and the largest beyond it [rad or m]."""
        self._gears = [
            (mechanism.motor(name), mechanism.coordinate(name), gear)
            for name, gear in mechanism.gears.items()
        ]
        self._trailing: dict[int, int] = {}
        """Coordinate of the link behind each trailing motor."""
        self._through: dict[int, tuple[float, float, float]] = {}
        """Stiffness, torque and lever with which a trailing motor's drive acts on the link now."""
        sprung = self._make_springs(servos, rows, reference, drives)
        for name, losses in friction.items():
            at = mechanism.coordinate(name)
            self._constant[at] -= float(losses.torque(self._speed[at : at + 1])[0])
        self._ideal = sorted(set(mechanism.loops) - set(mechanism.clearance))
        self._inertia, self._load_forces = np.zeros(nv), np.zeros(nv)
        self.refresh(self._start)
        self.basis = self._find_basis(sprung, drives, set(fixed))
        self.scale, self._crossed = self._scales()
        self._centring = np.zeros(0)
        """Stiffness of the soft spring towards the start along `basis`, in units of `scale` [J]."""
        weightless = np.abs(self._inertia) + np.abs(self._load_forces) + np.abs(self._constant)
        self._least_load = self.weight() or float(weightless.max(initial=0.0))
        """Force to which residuals are relative where nothing touches [N]."""

    def _make_springs(
        self,
        servos: np.ndarray | Sequence[np.void],
        rows: np.ndarray | Sequence[np.void],
        reference: np.ndarray,
        drives: Mapping[str, Drive],
    ) -> set[int]:
        """Make springs of the drives, with a dead band of servos; returns coordinates they hold.

        Friction and I terms of servos, counts of their encoders and samples are left out.
        """
        mechanism, nu = self._mechanism, len(reference) // 3
        sprung: set[int] = set()
        followed = {mechanism.motor(n): n for n, drive in drives.items() if drive.follows}

        def speed_error(row: np.void) -> float:
            return float(reference[nu + int(row["column"])] - self._speed[int(row["encoder"])])

        def hold(row: np.void, stiffness: float, torque: float) -> None:
            at, encoder = int(row["coordinate"]), int(row["encoder"])
            self._stiffness[encoder] += stiffness
            self._unbent[encoder] = reference[int(row["column"])]
            self._constant[encoder] += torque
            if encoder != at:
                self._trailing[at], self._through[at] = encoder, (stiffness, torque, 1.0)
            sprung.update((encoder, mechanism.coordinate(followed[at])))

        for row in servos:
            encoder, stall = int(row["encoder"]), row["stall"]
            self._dead_bands[encoder] = row["dead_band"]
            self._most_bent[encoder] = min(row["voltage"], row["limit"] / stall) / row["p_gain"]
            hold(row, float(stall * row["p_gain"]), float(stall * row["d_gain"] * speed_error(row)))
        for row in rows:
            at = int(row["coordinate"])
            if at not in followed or row["armature"] > 0.0:  # does not follow, or prescribed
                continue
            torque = float(reference[2 * nu + int(row["column"])] + row["kd"] * speed_error(row))
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
        """Deflection of a drive under an effort on its coordinate, and its dead band [rad or m].

        The deflection is infinite where the drive cannot hold the effort, and both are zero where
        nothing of finite stiffness holds the coordinate.
        """
        stiffness = float(self._stiffness[coordinate])
        if stiffness == 0.0:
            return 0.0, 0.0
        bent = (effort + float(self._constant[coordinate])) / stiffness
        if abs(bent) > self._most_bent[coordinate]:
            bent = math.copysign(math.inf, bent)
        return bent, float(self._dead_bands[coordinate])

    def _bends(self, q: np.ndarray) -> np.ndarray:
        """Deflections of the drives' springs (nv,), beyond dead bands and up to their limits."""
        away = self._unbent - q
        bent = np.minimum(np.maximum(np.abs(away) - self._dead_bands, 0.0), self._most_bent)
        return np.asarray(np.copysign(bent, away))

    def _find_basis(
        self, sprung: set[int], drives: Mapping[str, Drive], fixed: set[int]
    ) -> np.ndarray:
        """Directions in which the machine can come to rest, shape (nv, n).

        They are the coordinates that only clearances limit, those that springs of drives hold, and
        the motions in which joints without a drive follow the loops; of the span of all these, the
        part that keeps ideal loops closed.
        """
        mechanism, nv = self._mechanism, self._model.nv
        # Coordinates of journals: those that clearances limit, by joint, unless a film bears it.
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
        # A journal can be searched alone unless its coordinates have to close an ideal loop.
        self._blocks = {} if self._ideal else {n: sorted(at) for n, at in blocks.items() if at}
        # Undriven joints stand where they are, but for the row space of the loops' Jacobian.
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
        """Directions in which `close` moves, before loops narrow them to `basis`."""
        if self._ideal and basis.shape[1]:  # the null space of the ideal loops' Jacobian
            rows = closing_rows(mechanism, self._start, self._ideal) @ basis
            _, sizes, right = np.linalg.svd(rows)
            basis = basis @ right[int(np.sum(sizes > _least_size(sizes))) :].T
        return basis

    def _scales(self) -> tuple[np.ndarray, np.ndarray]:
        """Length along each direction that crosses a clearance, and that clearance [m], (n,) each.

        Clearances of one mechanism may differ by orders of magnitude, such as a journal's and the
        deflection of springs.
        """
        joints = self._mechanism.clearance
        pin.computeJointJacobians(self._model, self._data, self._start)
        scale, crossed = np.full((2, self.basis.shape[1]), np.inf)
        # Springs are as far from their middle as the weight bends them.
        bent = max(self.weight(), 1.0)
        clearances = {
            name: joint.search_radius * (1.0 if joint.springs is None else bent)
            for name, joint in joints.items()
        }
        for name, clearance in clearances.items():
            moves = self._jacobian(name) @ self.basis
            motion = np.linalg.norm(moves[:3], axis=0)
            motion += self._elastic[name].reach * np.linalg.norm(moves[3:], axis=0)
            with np.errstate(divide="ignore"):
                crossing = clearance / motion
            crossed = np.where(crossing < scale, clearance, crossed)
            scale = np.minimum(scale, crossing)
        # What moves no journal: as if by the smallest clearance, or half the play of a gear.
        plays = [gear.play / 2.0 for _, _, gear in self._gears]
        usual = min(clearances.values(), default=min(plays, default=1e-4) or 1e-4)
        finite = np.isfinite(scale), np.isfinite(crossed)
        return np.where(finite[0], scale, usual), np.where(finite[1], crossed, usual)

    def refresh(self, q: np.ndarray) -> None:
        """Evaluate the forces without potential anew in configuration q, constant from then on.

        They are the inertia forces of a moving start, given loads, and the efforts on links of
        motors that trail behind their teeth, whose lever changes with the gear's kinematic error.
        """
        for m, k, gear in self._gears:
            if m in self._through and gear.error_terms:
                stiffness, torque, lever = self._through[m]
                now = 1.0 + float(gear.kinematic_error(self.align_motors(q)[m])[1])
                change = 1.0 / now - 1.0 / lever
                self._stiffness[k] += change * stiffness
                self._constant[k] += change * torque
                self._through[m] = stiffness, torque, now
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
        """Contact wrench on each journal by joint; see `ElasticJoint.wrench`."""
        pin.forwardKinematics(self._model, self._data, q)
        return {name: contacts.wrench(self._pose(name)) for name, contacts in self._elastic.items()}

    def potential(
        self, q: np.ndarray, names: Collection[str]
    ) -> tuple[float, np.ndarray, np.ndarray, float]:
        """Potential energy [J], its gradient (nv,) and curvature (nv, nv), and the largest joint
        force [N], with the contacts of the joints `names`. Infinite energy: a law fails there.
        """
        model, data, away = self._model, self._data, q - self._start
        # Gravity.
        curvature = weight_curvature(model, data, q)
        gradient = pin.computeGeneralizedGravity(model, data, q).copy()
        pin.computeJointJacobians(model, data, q)
        energy = pin.computePotentialEnergy(model, data)
        # Springs of drives: 0 in the dead band, a parabola beyond, straight from the limit on.
        bends, far = self._bends(q), np.abs(self._unbent - q) - self._dead_bands
        bent = np.abs(bends)
        yields = ((self._dead_bands == 0.0) | (bends != 0.0)) & (bent < self._most_bent)
        curvature += np.diag(np.where(yields, self._stiffness, 0.0))
        gradient += self._inertia - self._constant - self._stiffness * bends
        energy += float(self._stiffness @ (bent * (np.maximum(far, 0.0) - 0.5 * bent)))
        # Efforts and inertia forces that are constant, and loads.
        energy -= float(self._constant @ away)
        energy += float((self._inertia - self._load_forces) @ away) + self._loads.energy(data, q)
        slope, bend = self._loads.slopes(data, q)
        gradient, curvature = gradient + (slope - self._load_forces), curvature + bend
        # Contacts.
        load = 0.0
        for name in names:
            contacts, pose, moves = self._elastic[name], self._pose(name), self._jacobian(name)
            wrench = contacts.wrench(pose)
            energy += contacts.energy(pose)
            gradient -= moves.T @ wrench
            curvature += moves.T @ contacts.stiffness(pose) @ moves
            load = max(load, float(np.linalg.norm(wrench[:3])), contacts.inner_load(pose))
        # Teeth of gears, but for those of trailing motors, which only follow.
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
        if self._centring.any():  # the soft spring towards the start (`settle`)
            parts = self.basis / self.scale
            moved = away @ parts
            energy += 0.5 * float(self._centring @ moved**2)
            gradient += parts @ (self._centring * moved)
            curvature += self._centring * parts @ parts.T
        return float(energy) if np.isfinite(energy) else np.inf, gradient, curvature, load

    def close(self, q: np.ndarray) -> np.ndarray:
        """Close the ideal loops of q again, which finite displacements open a little."""
        for _ in range(2 if self._ideal else 0):
            q = q + self._movable @ newton_step(
                self._mechanism, q, self._movable, loops=self._ideal
            )
        return q

    def align_motors(self, q: np.ndarray) -> np.ndarray:
        """Place trailing motors behind the teeth that transmit their torque, in a copy of q."""
        q = q.copy()
        for m, k, gear in self._gears:
            if m in self._trailing:
                torque = self._stiffness[k] * self._bends(q)[k] + self._constant[k]
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
        bore by a moment alone), a whole set of states is in equilibrium; a soft spring towards the
        start, taken away in the end, leads to the one nearest to the start whatever the way.

        Args:
            near: a configuration (nq,) near the equilibrium. All joints are searched together from
                there first, and joint by joint only if that does not balance them.
            places: resting places of journals from another search (`Rest.places`), for joints
                under about the same load; these are not searched alone.
        """
        places = places or {}
        self.refresh(self._start)
        self._centring = TOWARDS_MIDDLE * self.weight() * self._crossed
        q, trials, residual, load = self._start, 0, np.inf, 1.0
        if near is not None:
            q, residual, load, trials = self._newton_descent(near, MOST_TRIALS)
        if residual > BALANCED * load:
            # Journal by journal: what the others do to a joint's load is of second order.
            for name in places.keys() & self._blocks.keys():
                q[self._blocks[name]] = places[name]
            for name, at in self._blocks.items():
                if name not in places:
                    q, *_ = self._newton_descent(q, MOST_LOCAL, {name}, at)
            q, _, _, tried = self._newton_descent(q, MOST_TRIALS)
            trials += tried
        # Without the soft spring, until the forces without potential are those of the rest found.
        self._centring = np.zeros(0)
        for _ in range(MOST_ROUNDS):
            q, residual, load, tried = self._newton_descent(q, MOST_TRIALS)
            trials += tried
            self.refresh(q)
            slope = self.potential(q, self._elastic)[1] @ self.basis * self.scale
            residual = float(np.abs(slope / self._crossed).max(initial=0.0))
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
        """Go downhill from q by Newton's method in a trust region.

        Steps are along `basis` in units of `scale`: a length of 1 crosses a clearance. One that
        lowers the energy by enough of what the quadratic model promises is taken; others make the
        region smaller.

        Args:
            q: where the descent begins, (nq,).
            most: states to try.
            names: joints whose contacts count; None: all.
            at: coordinates; only directions that move one of them are searched. None given: all.

        Returns:
            Where it ends, the residual and the load there [N], and the number of states tried.
        """
        names = self._elastic if names is None else names
        directions, crossed = self.basis * self.scale, self._crossed
        if at:
            active = np.abs(directions[list(at)]).any(axis=0)
            directions, crossed = directions[:, active], crossed[active]
        radius, trials = 1.0, 0
        state = self._evaluate(q, directions, names)
        while True:
            residual = float(np.abs(state.gradient / crossed).max(initial=0.0))
            load = state.load
            if (
                residual <= SOLVED * (load or self._least_load)
                or trials >= most
                or radius < _LEAST_RADIUS
            ):
                return state.q, residual, load, trials
            step = minimize_in_ball(state.gradient, state.curvature, radius)
            expected = -float(state.gradient @ step + 0.5 * step @ state.curvature @ step)
            size = float(np.linalg.norm(step))
            trial = self._evaluate(self.close(state.q + directions @ step), directions, names)
            trials += 1
            straight = state.gain(trial, expected)
            if straight <= _LEAST_GAIN and trials < most:
                # Second-order correction: along curved walls, and where a wall is met, a second
                # step leads back to it.
                step = minimize_in_ball(trial.gradient, trial.curvature, size)
                trial = self._evaluate(self.close(trial.q + directions @ step), directions, names)
                trials += 1
            gain = state.gain(trial, expected)
            if not gain > _LEAST_GAIN:
                radius = 0.25 * size
                continue
            if gain > _GOOD_GAIN or straight <= _LEAST_GAIN:
                radius = max(radius, 2.0 * size)
            state = trial

    def _evaluate(
        self, q: np.ndarray, directions: np.ndarray, names: Collection[str]
    ) -> TrialState:
        energy, gradient, curvature, load = self.potential(q, names)
        along = directions.T @ curvature @ directions
        return TrialState(q, energy, directions.T @ gradient, along, load)
