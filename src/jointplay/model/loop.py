"""Closed loops: the joints that close them, and how a mechanism with loops is assembled.

A URDF describes a tree. A loop adds one more joint, between two links of different branches. With
clearance nothing holds it but contact: the loop is cut there. Ideal, it is a constraint, which
Pinocchio enforces.

Whether loops are closed is told by the `openings` of all `closures`, the residual of the loop
equations, zero if each journal sits where its ideal joint would hold it. `assemble` finds a closed
configuration by least squares, for the first one of a run; `newton` follows loops from one that is
nearly closed; `consistent_velocity` does the same for speeds. A `Lock` stands for freedoms that a
loop's joint locks besides its contact.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, JointplayWarning
from jointplay.base.schema import Described, check_fields, quantity
from jointplay.model.frames import Frame, Frames, pose_between
from jointplay.physics.joints import RELATIVE, VIRTUAL_LINK

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

Vector = tuple[float, float, float]

ASSEMBLY_TOLERANCE_M = 1e-9
"""Gap that may remain in an assembled loop [m]; angles count on an arm of `ANGLE_ARM_M`."""
ANGLE_ARM_M = 0.1
"""Arm on which an angle counts as a length [m]: links are about as long (judged)."""

_IDEAL_WEIGHT = 1e3
"""Weight of loops without clearance, which must close, beside loops whose journal has room."""

_NEWTON_STEPS, _NEWTON_REACH, _NEWTON_CHANGE = 30, 0.3, 1e-12
"""`newton`: most steps; longest step, beyond which it gives up; step at which it has converged
[rad or m]."""
SINGULAR = 1e-9
"""Singular value, relative to the largest, up to which it counts as zero."""

NO_SPEED = 1e-9
"""Speed, relative to the fastest coordinate's, up to which it counts as zero: rounding."""

_CONTINUATION_STEP, _CONTINUATION_REACH = 0.1, 0.5
"""Steps in which given positions are approached from zero, and the farthest that other coordinates
may move in one of them [rad or m]."""

GUESS = 0.05
"""Largest correction of a given position where loops determine it [rad]; of a slider on an arm of
`ANGLE_ARM_M`.

Printed values are rounded, and read off drawings to some degrees; other branches are farther.
"""

_YAW = RELATIVE.index("yaw")

PROXIMAL = pin.ProximalSettings(1e-12, 1e-10, 10)
"""Accuracy, regularisation and iterations of Pinocchio's proximal solver, for constraints that may
be redundant."""


def refuse_name(name: str, joints: Collection[str]) -> None:
    """Raise if a loop has the name of one of the URDF's `joints`."""
    if name in joints:
        raise JointplayError(f"loop {name!r} has the name of a joint of the URDF")


@dataclass(frozen=True)
class Loop(Described):
    """A joint between two links that closes a loop, by the frames of its bearing and journal.

    z of both frames is the joint's axis (for a slider, the direction of sliding).

    Raises:
        JointplayError: a vector that is not three finite numbers, or one link named twice.
    """

    bearing_link: str
    journal_link: str
    bearing_xyz: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Bearing's centre in its link's frame [m]."""
    bearing_rpy: Vector = quantity("rad", default=(0.0, 0.0, 0.0))
    """Orientation of the bearing frame: roll, pitch, yaw as in URDF [rad]."""
    journal_xyz: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    journal_rpy: Vector = quantity("rad", default=(0.0, 0.0, 0.0))

    def __post_init__(self) -> None:
        if self.bearing_link == self.journal_link:
            raise JointplayError(
                f"a loop needs two links, got {self.bearing_link!r} for both bearing and journal"
            )
        check_fields(self)

    @property
    def bearing(self) -> pin.SE3:
        """Bearing frame in its link's frame."""
        return pin.SE3(pin.rpy.rpyToMatrix(*self.bearing_rpy), np.array(self.bearing_xyz))

    @property
    def journal(self) -> pin.SE3:
        """Journal frame in its link's frame."""
        return pin.SE3(pin.rpy.rpyToMatrix(*self.journal_rpy), np.array(self.journal_xyz))

    def frames(self, model: pin.Model) -> Frames:
        """Frames of bearing and journal in a model that has both links."""
        links = (self.bearing_link, self.bearing), (self.journal_link, self.journal)
        ends = []
        for link, place in links:
            frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
            ends.append((int(frame.parentJoint), frame.placement * place))
        return ends[0], ends[1]


class Closure(NamedTuple):
    """Two frames that must meet for a loop to be closed: those of its joint, or of its lock."""

    name: str
    frames: Frames
    """Bearing and journal, or carriage and what is fixed to it."""
    rows: list[int]
    """Rows of the second frame's motion against the first (`RELATIVE`) that are constrained."""

    @property
    def weights(self) -> np.ndarray:
        """Lengths for a unit of each row: 1 for an offset, the arm `ANGLE_ARM_M` for an angle."""
        return np.where(np.array(self.rows, int) < 3, 1.0, ANGLE_ARM_M)

    def gap(self, data: pin.Data, aside: pin.SE3 | None) -> np.ndarray:
        """Opening of each row [m or rad], after `pin.forwardKinematics`; see `openings`."""
        pose = pose_between(data, self.frames)
        if aside is not None:
            pose = aside.actInv(pose)
        turn = pose.rotation
        yaws = _YAW in self.rows
        # If the joint is free to yaw, only its axis counts: the x and y of the journal's z.
        angles = pin.log3(turn) if yaws else np.array([-turn[1, 2], turn[0, 2], 0.0])
        return np.concatenate([pose.translation, angles])[self.rows]


def closures(mechanism: Mechanism, loops: Collection[str] | None = None) -> list[Closure]:
    """Closures of `loops` (None: all) and of all locks, after `pin.forwardKinematics`."""
    names = mechanism.loops if loops is None else loops
    kinds = {name: mechanism.loop_class(name).held() for name in names}
    held = [Closure(name, mechanism.closing_frames(name), rows) for name, rows in kinds.items()]
    rigid = [*range(6)]
    return held + [Closure(locked(n), pair, rigid) for n, pair in mechanism.locks.items()]


def misfit(mechanism: Mechanism, q: np.ndarray) -> dict[str, np.ndarray]:
    """Openings of each loop and lock (`locked`) in configuration q, by name, journals centred [m].

    They are those of `openings`, with angles on an arm of `ANGLE_ARM_M`.
    """
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    return {c.name: c.weights * c.gap(mechanism.data, None) for c in closures(mechanism)}


def locked(name: str) -> str:
    """Name of the lock of the loop `name`."""
    return f"{name} (lock)"


def assemble(
    mechanism: Mechanism,
    q: np.ndarray,
    held: Sequence[int],
    offsets: dict[str, np.ndarray] | None = None,
    guessed: Sequence[int] = (),
) -> np.ndarray:
    """Configuration (nq,) near q in which all loops are closed; q itself without loops.

    Coordinates that are `held` keep the positions of q; the others follow. The order of attempts:

    1. Where q gives positions to no others than `held`, these go there from the zero pose in steps
       that the loops follow: far from it, loops close in several ways. Journals stay where they are
       in their bearings, or at `offsets` (by loop, (3,) [m]), and only turn with them.
    2. Those of `held` that are `guessed` are corrected by at most `GUESS`, with a warning.
    3. Journals of the tree move too, as far as their clearance lets them.
    4. Journals that close a loop lie where the positions given for the others put them.

    Raises:
        JointplayError: the loops cannot be closed; the message has the gap that remains, and
            whether positions that were given are to blame.
    """
    if not mechanism.loops:
        return q.copy()
    offsets = offsets or {}
    free = _free(mechanism, held, journals=False)
    best = least_open(mechanism, _continued(mechanism, q, held, free), free, offsets)
    if _gap(mechanism, best, offsets) > ASSEMBLY_TOLERANCE_M:
        corrected = _corrected(mechanism, q, held, guessed)
        moved = least_open(mechanism, best, _free(mechanism, held, journals=True), offsets)
        if corrected is not None:
            best = corrected
        elif _fit(mechanism, moved):
            best = moved
        elif not _fit(mechanism, best):
            raise _assembly_error(mechanism, q, best, held, guessed)
    for name in mechanism.gears:  # motors turn with their joints, so that gears are unstrained
        if mechanism.motor(name) not in held:
            best[mechanism.motor(name)] = best[mechanism.coordinate(name)]
    return best


def _continued(
    mechanism: Mechanism, q: np.ndarray, held: Sequence[int], free: np.ndarray
) -> np.ndarray:
    """q with its `free` coordinates found by continuation from the zero pose.

    q as it is if it gives positions to `free` ones, or if the loops cannot be followed.
    """
    goal = np.zeros_like(q)
    goal[held] = q[held]
    steps = math.ceil(np.abs(goal).max(initial=0.0) / _CONTINUATION_STEP)
    if q[free].any() or steps < 2:
        return q
    led = np.zeros_like(q)
    for step in range(steps + 1):
        trial = led.copy()
        trial[held] = goal[held] * step / steps
        led = least_open(mechanism, trial, free, {})
        moved = np.abs(led - trial).max()
        if moved > _CONTINUATION_REACH or _gap(mechanism, led, {}) > ASSEMBLY_TOLERANCE_M:
            return q
    continued = q.copy()
    continued[free] = led[free]
    return continued


def follow(mechanism: Mechanism, q: np.ndarray, held: Sequence[int]) -> np.ndarray:
    """`assemble` for a mechanism without clearance whose loops are nearly closed in q.

    Newton's method, tried first, takes a few tenths of the time.
    """
    free = np.setdiff1d(np.arange(mechanism.model.nv), held)
    moved = newton(mechanism, q, np.eye(mechanism.model.nv)[:, free])
    if moved is not None and np.abs(openings(mechanism, moved)).max(initial=0.0) < _NEWTON_CHANGE:
        return moved
    return assemble(mechanism, q, held)


def newton(
    mechanism: Mechanism,
    q: np.ndarray,
    directions: np.ndarray,
    weight: np.ndarray | float = 1.0,
    aside: Mapping[str, pin.SE3] | None = None,
) -> np.ndarray | None:
    """q (nq,) moved along `directions` (nv, k) to the least openings; None without convergence.

    Gauss-Newton steps: where not all `openings` can become zero, their weighted squares are least.
    `weight` is that of each row, `aside` as for `openings`.
    """
    moved = q
    for _ in range(_NEWTON_STEPS):
        change = newton_step(mechanism, moved, directions, weight, aside)
        size = float(np.abs(change).max(initial=0.0))
        if not size < _NEWTON_REACH:
            return None
        moved = moved + directions @ change
        if size < _NEWTON_CHANGE:
            return moved
    return None


def newton_step(
    mechanism: Mechanism,
    q: np.ndarray,
    directions: np.ndarray,
    weight: np.ndarray | float = 1.0,
    aside: Mapping[str, pin.SE3] | None = None,
    loops: Collection[str] | None = None,
) -> np.ndarray:
    """One step of `newton` from q, by its length along each direction (k,), for `loops`."""
    residual = weight * openings(mechanism, q, aside, loops)
    rows = (np.reshape(weight, (-1, 1)) * closing_rows(mechanism, q, loops)) @ directions
    change: np.ndarray = np.linalg.lstsq(rows, -residual, rcond=SINGULAR)[0]
    return change


def openings(
    mechanism: Mechanism,
    q: np.ndarray,
    aside: Mapping[str, pin.SE3] | None = None,
    loops: Collection[str] | None = None,
) -> np.ndarray:
    """Openings of `loops` (None: all) and of all locks, in the order of `closing_rows` [m, rad].

    They count from the poses `aside` of journals in their bearings, by loop; from the centred pose
    if not given.
    """
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    places = aside or {}
    parts = [c.gap(mechanism.data, places.get(c.name)) for c in closures(mechanism, loops)]
    return np.concatenate([np.zeros(0), *parts])


def _free(mechanism: Mechanism, held: Sequence[int], journals: bool) -> np.ndarray:
    """Coordinates that are not `held`; without `journals` only those of the ideal mechanism."""
    coordinates = range(mechanism.model.nv) if journals else ideal_coordinates(mechanism)
    return np.array([i for i in coordinates if i not in held], int)


def ideal_coordinates(mechanism: Mechanism) -> list[int]:
    """Coordinates that the ideal mechanism has, too, with the carriages of locks."""
    indices = []
    for index, coordinate in enumerate(mechanism.coordinates):
        name, part = coordinate.joint, coordinate.part
        joint = mechanism.clearance.get(name)
        plain = joint is None or name in mechanism.loops or part not in VIRTUAL_LINK
        if plain or (joint is not None and part in joint.ideal_freedoms):
            indices.append(index)
    return indices


def least_open(
    mechanism: Mechanism, q: np.ndarray, free: np.ndarray, offsets: Mapping[str, np.ndarray]
) -> np.ndarray:
    """q with its `free` coordinates at the least openings, by least squares that start from afar.

    Journals of loops count from `offsets` (by loop, (3,) [m]).
    """
    moved = q.copy()
    if not len(free):
        return moved
    strict = set(mechanism.loops) - set(mechanism.clearance) | set(map(locked, mechanism.locks))
    mixed = strict and len(mechanism.clearance.keys() & mechanism.loops.keys()) > 0

    def error(values: np.ndarray) -> np.ndarray:
        trial = q.copy()
        trial[free] = values
        # A loop without clearance must be closed, whatever the others then have to bear.
        parts = _residuals(mechanism, trial, offsets)
        if mixed:
            parts |= {name: _IDEAL_WEIGHT * parts[name] for name in strict}
        return np.concatenate(list(parts.values()))

    from scipy.optimize import least_squares  # takes long to import

    solution = least_squares(error, q[free], xtol=1e-15, ftol=1e-15, gtol=1e-15, x_scale="jac")
    moved[free] = solution.x
    return moved


def _residuals(
    mechanism: Mechanism, q: np.ndarray, offsets: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """`misfit` with journals of loops at `offsets` in their bearings."""
    parts = misfit(mechanism, q)
    for name, offset in offsets.items():
        across = [row for row in mechanism.loop_class(name).held() if row < 3]
        parts[name][: len(across)] -= offset[across]
    return parts


def _gap(mechanism: Mechanism, q: np.ndarray, offsets: dict[str, np.ndarray]) -> float:
    """Largest residual of all loops [m]."""
    return max(float(np.abs(part).max()) for part in _residuals(mechanism, q, offsets).values())


def _fit(mechanism: Mechanism, q: np.ndarray) -> bool:
    """Whether ideal loops are closed and no journal touches its bearing, to be on the safe side."""
    open_by = misfit(mechanism, q)
    for name, part in open_by.items():
        if name not in mechanism.clearance and np.abs(part).max() > ASSEMBLY_TOLERANCE_M:
            return False
    for name, joint in mechanism.clearance.items():
        pose = mechanism.journal_pose(name)
        turn, centre = joint.ideal_part(pose.rotation, pose.translation)
        if not abs(pose.translation[2]) < joint.engaged_within:
            return False
        lean = 0.0
        if name in mechanism.loops:  # in a tree journals only move aside
            tilt = float(np.abs(pin.log3(pose.rotation @ turn.T)).max())
            lean = tilt * joint.arm(pose.translation)
        if not joint.fits(pose.translation - centre, lean, ASSEMBLY_TOLERANCE_M):
            return False
    return True


def _corrected(
    mechanism: Mechanism, q: np.ndarray, held: Sequence[int], guessed: Sequence[int]
) -> np.ndarray | None:
    """q with loops closed by changing `guessed` positions, too, with a warning.

    None if that takes more than `GUESS`, or does not close them.
    """
    indices = _joints_at(mechanism, guessed)
    if not indices:
        return None
    facts = [i for i in held if i not in guessed]
    freed = least_open(mechanism, q, _free(mechanism, facts, journals=False), {})
    moved = {name: i for name, i in indices.items() if freed[i] != q[i]}
    for name, i in moved.items():
        slides = mechanism.description.joints[name].slides
        if abs(freed[i] - q[i]) > GUESS * (ANGLE_ARM_M if slides else 1.0):
            return None
    if not moved or _gap(mechanism, freed, {}) > ASSEMBLY_TOLERANCE_M:
        return None
    changes = ", ".join(f"{name} {q[i]:.8g} to {freed[i]:.8g}" for name, i in moved.items())
    text = f"start corrected, for loops determine it: {changes} [rad or m]"
    warnings.warn(text, JointplayWarning, stacklevel=2)
    for name in moved.keys() & mechanism.gears.keys():
        freed[mechanism.motor(name)] += freed[moved[name]] - q[moved[name]]
    return freed


def _joints_at(mechanism: Mechanism, held: Sequence[int]) -> dict[str, int]:
    """Joints whose ideal coordinate is `held`, with its index."""
    indices = {name: mechanism.coordinate(name) for name in mechanism.joints}
    return {name: i for name, i in indices.items() if i in held}


def _assembly_error(
    mechanism: Mechanism,
    q: np.ndarray,
    best: np.ndarray,
    held: Sequence[int],
    guessed: Sequence[int],
) -> JointplayError:
    """Error that names the loop that stays open the most in `best`, and a remedy.

    Where the loops close with fewer positions given, the message has the positions they then take.
    """
    gaps = {name: float(np.abs(part).max()) for name, part in misfit(mechanism, best).items()}
    worst = max(gaps, key=lambda name: gaps[name])
    fault = f"the mechanism cannot be assembled: loop {worst!r} stays open by {gaps[worst]:.4g} m; "
    joints, facts = _joints_at(mechanism, held), [i for i in held if i not in guessed]
    remedy = "check lengths and frames, or start from other joint positions"
    for fixed in (facts, []) if joints else ():
        freed = least_open(mechanism, q, _free(mechanism, fixed, journals=False), {})
        if _gap(mechanism, freed, {}) < ASSEMBLY_TOLERANCE_M:
            near = ", ".join(f"{name} = {freed[i]:.6g}" for name, i in joints.items())
            remedy = (
                f"the positions given for {', '.join(joints)} contradict each other: it closes at "
                f"{near} [rad or m]; give fewer of them, or these"
            )
            break
    return JointplayError(f"{fault}{remedy}", where=("loops", worst))


def closing_rows(
    mechanism: Mechanism, q: np.ndarray, loops: Collection[str] | None = None
) -> np.ndarray:
    """Jacobian of the closures of `loops` (None: all) and of all locks in configuration q.

    Shape (rows, nv). Rows: constrained velocities of journals against bearings, zero while the
    loops stay closed and journals rest in their bearings.
    """
    pin.forwardKinematics(mechanism.model, mechanism.data, q)
    rows = [mechanism.motion(c.frames, q)[c.rows] for c in closures(mechanism, loops)]
    return np.concatenate([np.zeros((0, mechanism.model.nv)), *rows])


def consistent_velocity(
    mechanism: Mechanism,
    q: np.ndarray,
    v: np.ndarray,
    held: Sequence[int],
    led: Sequence[int],
) -> np.ndarray:
    """Velocity nearest to v with which all loops stay closed, journals resting in their bearings.

    Coordinates that are `held` keep their speeds in v. Where no velocity satisfies all closures, as
    where journals lean or speeds are given for too many coordinates, journals move as little as
    needed: bearings hold them by contact only. The `led` among `held` follow a reference.

    Raises:
        JointplayError: the given speeds would tear apart a loop without clearance, or references
            alone any loop.
    """
    if not mechanism.loops:
        return v.copy()
    mass = mechanism.mass_matrix(q)
    limit = NO_SPEED * max(1.0, float(np.abs(v).max(initial=0.0)))

    def moving(rows: np.ndarray, fixed: Sequence[int]) -> tuple[np.ndarray, float]:
        """The velocity with `fixed` speeds, and the largest speed that `rows` still forbid."""
        resting = _nearest(mass, v, rows, _free(mechanism, fixed, journals=False))
        moved = _nearest(mass, resting, rows, _free(mechanism, fixed, journals=True))
        for name in mechanism.gears:
            if mechanism.motor(name) not in fixed:
                moved[mechanism.motor(name)] = moved[mechanism.coordinate(name)]
        return moved, float(np.abs(rows @ moved).max(initial=0.0))

    all_rows = closing_rows(mechanism, q)
    moved, gap_rate = moving(all_rows, held)
    if gap_rate <= limit:
        return moved
    torn = f"the initial speeds would tear a loop apart at {gap_rate:.3g} m/s: "
    if moving(all_rows, led)[1] > limit:
        raise JointplayError(f"{torn}the driven joints cannot move like this in this configuration")
    ideal = set(mechanism.loops) - set(mechanism.clearance)
    moved, gap_rate = moving(closing_rows(mechanism, q, ideal), held)
    if gap_rate > limit:
        names = [name for name in mechanism.joints if mechanism.coordinate(name) in held]
        raise JointplayError(
            f"the initial speeds would tear a loop apart at {gap_rate:.3g} m/s: those given for "
            f"{', '.join(names)} contradict each other; give fewer of them"
        )
    return moved


def _nearest(mass: np.ndarray, v: np.ndarray, rows: np.ndarray, free: np.ndarray) -> np.ndarray:
    """Velocity nearest to v that `rows` (k, nv) allow, with `free` coordinates changed.

    If they allow none, the velocity with the least |rows v|. Near is measured by the kinetic energy
    of the change, for a norm of m/s and rad/s together would be none: with M = L L^T of the free
    coordinates, the change is L^-T y, its energy |y|^2 / 2.
    """
    from scipy.linalg import solve_triangular  # takes long to import

    moved = v.copy()
    if len(free) and len(rows):
        root = np.linalg.cholesky(mass[np.ix_(free, free)])
        scaled = solve_triangular(root, rows[:, free].T, lower=True).T
        change = np.linalg.lstsq(scaled, -rows @ v, rcond=SINGULAR)[0]
        moved[free] += solve_triangular(root, change, lower=True, trans="T")
    return moved


# Locks: freedoms that the joint of a loop locks, and that nothing else in the loop does.
#
# Pinocchio's constraints hold points or whole frames, not single freedoms. So the bearing carries
# one more body, a carriage, which has the freedoms that the joint leaves; three points fix the
# journal to it. The carriage takes part of the inertia of the journal's link: fixed to each
# other, the two move exactly as that link did.


SHARE = 0.1
"""Part of the inertia of the journal's link that the carriage takes."""

_CLOSED = {
    frozenset[str](): frozenset[str](),
    frozenset({"yaw"}): frozenset("xy"),
    frozenset({"pitch"}): frozenset("xz"),
    frozenset({"yaw", "pitch", "roll"}): frozenset("xyz"),
}
"""Sets of free rotations that stay free seen from the journal, and the translations that must then
be free, too: with these the inverse motion has the same freedoms."""


@dataclass(frozen=True)
class Lock:
    """A carriage and the body fixed to it, by names that outlast a new build of the model."""

    carrier: str
    """Pinocchio joint whose body carries the carriage; ``universe`` for the ground."""
    placement: pin.SE3
    """Pose of the carriage's axes in that joint's frame."""
    freedoms: tuple[str, ...]
    """Freedoms of the carriage."""
    held: str
    """Pinocchio joint whose body is fixed to the carriage."""
    frame: pin.SE3
    """Pose, in that joint's frame, of the frame that coincides with the carriage."""

    @classmethod
    def between(
        cls, name: str, freedoms: tuple[str, ...], model: pin.Model, bearing: Frame, journal: Frame
    ) -> Lock:
        """Lock of the loop `name`, whose joint leaves `freedoms`, between two frames of `model`.

        Raises:
            JointplayError: the journal belongs to the ground, and freedoms are not the same seen
                from there; or its link has no mass.
        """
        carrier, held = bearing, journal
        if journal[0] == 0:  # the ground has no inertia to share: exchange the two
            turns = frozenset(freedoms) - frozenset("xyz")
            if turns not in _CLOSED or not _CLOSED[turns] <= frozenset(freedoms):
                raise JointplayError(
                    f"loop {name!r} locks freedoms against a journal that belongs to the ground; "
                    "exchange bearing_link and journal_link"
                )
            carrier, held = journal, bearing
        if not model.inertias[held[0]].mass > 0.0:
            raise JointplayError(
                f"loop {name!r} locks freedoms of a link without mass; give it some"
            )
        return cls(model.names[carrier[0]], carrier[1], freedoms, model.names[held[0]], held[1])

    def share(self, model: pin.Model, carriage: int) -> Frame:
        """Move part of the held body's inertia to the carriage; return the held frame."""
        at = int(model.getJointId(self.held))
        inertia = model.inertias[at].copy()  # what Pinocchio gives changes with the model
        model.inertias[at] = _scaled(inertia, 1.0 - SHARE)
        model.inertias[carriage] = self.frame.actInv(_scaled(inertia, SHARE))
        return at, self.frame


def _scaled(inertia: pin.Inertia, factor: float) -> pin.Inertia:
    return pin.Inertia(factor * inertia.mass, inertia.lever, factor * inertia.inertia)
