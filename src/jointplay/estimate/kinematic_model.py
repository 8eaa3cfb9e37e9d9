"""Kinematics with errors of joints and placements, fitted to static poses by least squares.

Every error is a column: a coordinate or a placement of a joint errs by a feature of the pose times
an unknown coefficient, which has a prior: normal about zero with a width of its physical size. So
few poses cannot blow a coefficient up, and what the poses do not tell stays within its prior.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin
from scipy.spatial.transform import Rotation

from jointplay.base.errors import JointplayError, MissingName
from jointplay.estimate.least_squares import LeastSquares, minimum
from jointplay.estimate.static_poses import (
    StaticPoses,
    nearest_rotation,
    rotation_vectors,
    rotations_of,
)
from jointplay.estimate.unknowns import Unknown
from jointplay.model.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.model.payload import Payload

COORDINATE = 6
"""Number of a joint's own coordinate among what may err; 0 to 5: its placement, translations along
the axes of its frame, then rotations about them."""
_UNALIGNED = 1e-6
"""Of an axis' components, beyond which it is not one of its frame's."""
_STILL_N_M = 1e-6
"""Loads that count as none."""

TOGETHER = 0.7
"""Correlation from which two coefficients are said to act together."""
_TURN_WIDTH = 2.5
"""Prior width of a placement's angles over that of its lengths [rad/m]."""


@dataclass(frozen=True)
class Term:
    """A possible cause of errors, in some joints.

    Raises:
        JointplayError: a kind that does not exist; numbers that are not positive; a rail without
            the joint that it depends on.
    """

    kind: str
    joints: tuple[str, ...] = ()
    """Those that it concerns; if empty, all."""
    width: float | Mapping[str, float] | None = None
    """Standard deviation of the prior, of all joints or by joint; that of `KINDS` if None. Of a
    placement, that of its lengths [m]; angles have 2.5 rad/m times as much."""
    friction: float | None = None
    """Of play: what holds the joint against its load [N m]; sought if None."""
    transition: float | None = None
    """Of play: load over which the joint crosses half of its play [N m]; sought if None."""
    by: str = ""
    """Of a rail: the joint whose position it depends on."""
    axes: str = ""
    """Of a placement: which of the letters x, y, z (lengths) and a, b, c (angles about x, y, z);
    if empty, all but those that do what the joint's own offset does."""

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise MissingName("kind of term", self.kind, KINDS)
        widths = self.width.values() if isinstance(self.width, Mapping) else [self.width]
        for value in (*widths, self.transition):
            if value is not None and not (np.isfinite(value) and value > 0.0):
                raise JointplayError(
                    f"width and transition of {self.kind} must be positive, got {value!r}"
                )
        if self.friction is not None and not 0.0 <= self.friction < np.inf:
            raise JointplayError(f"friction of {self.kind} must not be negative: {self.friction!r}")
        if self.kind == "rail" and not self.by:
            raise JointplayError("a rail needs the joint that it depends on: 'rail ARM by LIFT'")
        if set(self.axes) - set("xyzabc"):
            raise JointplayError(f"axes of a placement are of x, y, z, a, b, c; got {self.axes!r}")

    @classmethod
    def parse(cls, text: str) -> Term:
        """Read ``KIND``, ``KIND JOINT,...``, ``rail JOINT by JOINT``, ``placement JOINT.z``."""
        head, _, by = text.strip().partition(" by ")
        kind, _, names = head.partition(" ")
        axes = ""
        if kind == "placement" and "," not in names and "." in names:
            names, _, axes = names.strip().rpartition(".")
        joints = tuple(one.strip() for one in names.split(",") if one.strip())
        return cls(kind, joints, by=by.strip(), axes=axes)

    def __str__(self) -> str:
        joints = ", ".join(self.joints) + (f".{self.axes}" if self.axes else "")
        return " ".join(filter(None, [self.kind, joints, f"by {self.by}" if self.by else ""]))

    @property
    def short(self) -> str:
        """For tables: of more than two joints only how many."""
        if len(self.joints) < 3:
            return str(self)
        return f"{self.kind} ({len(self.joints)} joints)" + (f" by {self.by}" if self.by else "")


@dataclass(frozen=True)
class Column:
    """One coefficient: what of a joint errs, by which feature of the poses."""

    term: Term
    unknown: Unknown
    index: int
    target: int
    """0 to 5 of its placement, or `COORDINATE`."""
    feature: np.ndarray
    """Shape (n,)."""

    @property
    def joint(self) -> str:
        return self.unknown.joint


class Poses:
    """Static poses of the joints that carry a tool, with what the terms need of them.

    Pinocchio gives placements and axes; products along the chain are taken for all n poses at once,
    because placements that depend on the pose (rail, suspension) are no part of a Pinocchio model.

    Raises:
        JointplayError: a mechanism with loops; a joint with several coordinates; none of the joints
            of the poses moves the tool.
    """

    def __init__(
        self, mechanism: Mechanism, poses: StaticPoses, payloads: Sequence[Payload] = ()
    ) -> None:
        if mechanism.loops:
            raise JointplayError("calibration needs an open chain; this mechanism has loops")
        self.measured, ideal = poses, mechanism.ideal()
        model = ideal.model
        frame = model.frames[ideal.tool_frame]
        ids = [i for i in model.supports[frame.parentJoint] if i > 0]
        self.names = tuple(model.names[i] for i in ids)
        if not ids:
            raise JointplayError(f"no joint moves the tool {ideal.tool!r}")
        for i in ids:
            if model.joints[i].nv != 1 or model.joints[i].nq != 1:
                raise JointplayError(f"joint {model.names[i]!r} has several coordinates")
        self._rotation = np.array([model.jointPlacements[i].rotation for i in ids])
        self._translation = np.array([model.jointPlacements[i].translation for i in ids])
        motions = []
        for i in ids:
            one = model.joints[i].createData()
            model.joints[i].calc(one, np.zeros(1), np.zeros(1))
            motions.append(np.ravel(one.S))
        space = np.array(motions)
        self.turns = np.linalg.norm(space[:, 3:], axis=1) > 0.5
        self.axis = np.where(self.turns[:, None], space[:, 3:], space[:, :3])
        self.tool = frame.placement
        for name in poses.joints:
            ideal.coordinate(name)  # says which there are
        self.known = tuple(name for name in self.names if name in poses.joints)
        if not self.known:
            given, these = ", ".join(poses.joints), ", ".join(self.names)
            raise JointplayError(f"none of {given} moves the tool {ideal.tool!r}; {these} do")
        full = np.tile(ideal.configuration({}), (len(poses), 1))
        for column, name in enumerate(poses.joints):
            full[:, ideal.coordinate(name)] = poses.motor[:, column]
        self.q = full[:, [model.joints[i].idx_q for i in ids]]
        self.load, self.moment = _loads(_with_payloads(model, payloads), full, ids)
        self.approach, self.link = np.zeros(self.q.shape), np.full(self.q.shape, np.nan)
        at = [poses.joints.index(name) for name in self.known]
        here = [self.names.index(name) for name in self.known]
        self.approach[:, here] = poses.approach()[:, at]
        if poses.link is not None:
            self.link[:, here] = poses.link[:, at]
        if poses.load is not None:
            self.load[:, here] = poses.load[:, at]

    def forward(
        self, q: np.ndarray, shift: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Where the last joint's body is.

        Args:
            q: the chain's coordinates, shape (n, j).
            shift: errors of placements in the joints' frames, translations and rotation vectors,
                shape (n, j, 6) [m, rad].

        Returns:
            Rotations (n, 3, 3) and origins (n, 3) of the body; axes (j, n, 3) and origins (j, n, 3)
            of the joints; frames before the joints turn (j, n, 3, 3).
        """
        n = len(q)
        rotation, place = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
        axes, origins, frames = [], [], []
        for j in range(len(self.names)):
            place = place + rotation @ self._translation[j]
            rotation = rotation @ self._rotation[j]
            if shift is not None and shift[:, j].any():
                place = place + np.einsum("nab,nb->na", rotation, shift[:, j, :3])
                rotation = rotation @ rotations_of(shift[:, j, 3:])
            frames.append(rotation)
            axis = rotation @ self.axis[j]
            if self.turns[j]:
                rotation = rotation @ rotations_of(q[:, j, None] * self.axis[j])
            else:
                place = place + axis * q[:, j, None]
            axes.append(axis)
            origins.append(place)
        return rotation, place, np.array(axes), np.array(origins), np.array(frames)

    def __len__(self) -> int:
        return len(self.q)

    def columns(self, term: Term) -> list[Column]:
        """The coefficients of a term; of play whose friction or transition is sought, with none of
        the one and a tenth of the largest load as the other."""
        kind, made = KINDS[term.kind], []
        every = self.known if term.kind not in ("placement", "suspension") else self.names
        for joint in term.joints or every:
            if joint not in self.names:
                raise MissingName("joint that moves the tool", joint, self.names)
            j, asked = self.names.index(joint), bool(term.joints)
            idle = kind.by_load and not self.loaded(joint) and not asked
            features = [] if idle else kind.features(self, term, j, asked)
            if not features and asked and kind.absent:
                raise JointplayError(f"{joint} {kind.absent}")
            given = term.width.get(joint) if isinstance(term.width, Mapping) else term.width
            size = kind.width if given is None else float(given)
            units = {"own": "rad", "soft": "rad/(N*m)"}
            units = units if self.turns[j] else {"own": "m", "soft": "m/N"}
            for what, unit, target, feature in features:
                # Angles of a placement are as wide as its lengths over a reach.
                width = size * (_TURN_WIDTH if term.kind == "placement" and target > 2 else 1.0)
                name = f"{'half-play' if term.kind == 'play' else term.kind} {what}".rstrip()
                unknown = Unknown(
                    joint, name, units.get(unit, unit), 0.0, width,
                    spread=width, least=-np.inf, fine=False,
                )  # fmt: skip
                made.append(Column(term, unknown, j, target, feature))
        return made

    def loaded(self, joint: str) -> bool:
        """Whether anything loads a joint in any pose."""
        return bool(np.abs(self.load[:, self.names.index(joint)]).max() > _STILL_N_M)

    def leaning(
        self, joint: str, friction: float | np.ndarray, transition: float | np.ndarray
    ) -> np.ndarray:
        """Side on which a joint with play and friction leans, -1 to 1, shape (n,).

        The load pushes it to one side; friction holds it back against the way it came. Of k
        frictions and transitions the shape is (n, k).
        """
        j, width = self.names.index(joint), np.maximum(transition, 1e-12)
        held = np.multiply.outer(self.approach[:, j], friction)
        push = np.add.outer(self.load[:, j], np.zeros_like(width)) - held
        return np.asarray(np.clip(push / width, -1.0, 1.0))


Features = list[tuple[str, str, int, np.ndarray]]
"""Of a joint's coefficients: which it is, its unit (``own``: of the joint, ``soft``: of its
compliance), what of the joint errs (0 to 5 of its placement, or `COORDINATE`), by which feature of
the poses, shape (n,)."""


@dataclass(frozen=True)
class Kind:
    """A kind of terms: what of a joint errs, by which features of the poses."""

    meaning: str
    width: float
    """Of the prior [SI: rad, m, rad/(N m), ...]."""
    features: Callable[[Poses, Term, int, bool], Features]
    """Of a joint, by its number in the chain, and whether it was asked for by its name."""
    by_load: bool = False
    """Whether only joints that gravity loads have it, unless others are asked for."""
    absent: str = ""
    """Why a joint that was asked for has none, behind its name."""


def _waves(turns: float) -> Callable[[Poses, Term, int, bool], Features]:
    def features(poses: Poses, term: Term, j: int, asked: bool) -> Features:
        angle = turns * poses.q[:, j]
        waves = [("sin", np.sin(angle)), ("cos", np.cos(angle))]
        return [(n, "own", COORDINATE, w) for n, w in waves if poses.turns[j]]

    return features


def _leaning(poses: Poses, term: Term, j: int, asked: bool) -> Features:
    tenth = 0.1 * float(np.abs(poses.load[:, j]).max())
    transition = tenth if term.transition is None else term.transition
    lean = poses.leaning(poses.names[j], term.friction or 0.0, transition)
    return [("", "own", COORDINATE, lean)]


def _difference(poses: Poses, term: Term, j: int, asked: bool) -> Features:
    off = poses.link[:, j] - poses.q[:, j]
    return [] if np.isnan(off).any() or not off.any() else [("", "", COORDINATE, off)]


def _rail(poses: Poses, term: Term, j: int, asked: bool) -> Features:
    joints = poses.measured.joints
    if term.by not in joints:
        raise MissingName("joint", term.by, joints)
    place = poses.measured.motor[:, joints.index(term.by)]
    turns = term.by in poses.names and poses.turns[poses.names.index(term.by)]
    unit, off = "rad/rad" if turns else "rad/m", place - place.mean()
    return [(f"about {axis}", unit, 3 + k, off) for k, axis in enumerate("xyz")]


def _suspension(poses: Poses, term: Term, j: int, asked: bool) -> Features:
    moments = zip("xyz", poses.moment[:, j].T, strict=True)
    return [(f"about {axis}", "rad/(N*m)", 3 + k, m) for k, (axis, m) in enumerate(moments)]


def _placement(poses: Poses, term: Term, j: int, asked: bool) -> Features:
    """Errors of a joint's place; of the first joint they are the base's."""
    if j == 0 and not asked:
        return []
    letters, size = term.axes or "xyzabc", np.abs(poses.axis[j])
    if not term.axes and np.sort(size)[1] < _UNALIGNED:  # what the joint's own offset does
        letters = letters.replace(("abc" if poses.turns[j] else "xyz")[int(size.argmax())], "")
    places = [(letter, "xyzabc".index(letter)) for letter in letters]
    return [
        (f"along {letter}" if k < 3 else f"about {'xyz'[k - 3]}", "m" if k < 3 else "rad", k,
         np.ones(len(poses)))
        for letter, k in places
    ]  # fmt: skip


KINDS: Mapping[str, Kind] = {
    "offset": Kind(
        "zero of the joint's encoder", 0.1,
        lambda poses, term, j, asked: [("", "own", COORDINATE, np.ones(len(poses)))],
    ),
    "placement": Kind(
        "errors of the joint's place in its link (lengths, angles)", 2e-3, _placement
    ),
    "compliance": Kind(
        "joint gives way in proportion to its load", 1e-3,
        lambda poses, term, j, asked: [("", "soft", COORDINATE, poses.load[:, j])],
        by_load=True,
    ),
    "play": Kind(
        "half-play: joint leans to the side of its load, less friction", 1e-2, _leaning,
        by_load=True,
    ),
    "eccentricity": Kind(
        "encoder errs by the sine and cosine of the joint's angle", 1e-2, _waves(1.0),
        absent="slides: it has no eccentricity",
    ),
    "second-harmonic": Kind(
        "encoder errs by the sine and cosine of twice the angle", 5e-3, _waves(2.0),
        absent="slides: it has no second-harmonic",
    ),
    "link-encoder": Kind(
        "share of the link encoder's reading in what is true", 1.0, _difference,
        absent="has no encoder on the link's side of its own",
    ),
    "rail": Kind("joint's place turns with another joint's position", 5e-2, _rail),
    "suspension": Kind(
        "joint's place turns with the moment of the weight beyond it", 1e-3, _suspension
    ),
}  # fmt: skip
"""Kinds of terms; a new one is a function of the poses."""


def _with_payloads(model: pin.Model, payloads: Sequence[Payload]) -> pin.Model:
    from jointplay.model.mechanism import frame_index

    model = model.copy()
    for one in payloads:
        frame = model.frames[frame_index(model, one.frame)]
        inertia = pin.Inertia(one.mass, np.array(one.centre), np.diag(one.inertia))
        model.appendBodyToJoint(frame.parentJoint, inertia, frame.placement)
    return model


def _loads(model: pin.Model, q: np.ndarray, ids: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """What gravity does to the chain's joints: along their axes (n, j), moments (n, j, 3) in the
    frames of their placements [N m, N]."""
    data, still = model.createData(), np.zeros(model.nv)
    load, moment = np.zeros((len(q), len(ids))), np.zeros((len(q), len(ids), 3))
    for i, row in enumerate(q):
        torque = pin.rnea(model, data, row, still, still)
        for j, joint in enumerate(ids):
            load[i, j] = -torque[model.joints[joint].idx_v]
            turned = model.jointPlacements[joint].rotation.T @ data.liMi[joint].rotation
            moment[i, j] = -turned @ data.f[joint].angular
    return load, moment


@dataclass(frozen=True)
class State:
    """Unknowns: where base and tool are, and the coefficients of the columns."""

    base: tuple[np.ndarray, np.ndarray]
    """Rotation and translation of the mechanism's base in the instrument's axes [m]."""
    tool: tuple[np.ndarray, np.ndarray]
    """Rotation and translation of what was measured in the tool frame's body [m]."""
    c: np.ndarray


@dataclass(frozen=True)
class Problem:
    """Least squares of static poses with the columns of some terms."""

    poses: Poses
    columns: tuple[Column, ...]
    error: tuple[float, float]
    """Standard deviations of positions [m] and orientations [rad] about the model."""
    point: np.ndarray
    """Nominal place of the tool's point in the tool frame, shape (3,) [m]."""
    point_width: float
    """Of its prior [m]."""

    @property
    def closure(self) -> bool:
        """Whether only points were the same, at unknown places."""
        return self.poses.measured.point is not None

    @property
    def turned(self) -> bool:
        """Whether orientations were measured."""
        return not self.closure and self.poses.measured.orientation is not None

    @cached_property
    def free(self) -> np.ndarray:
        """Numbers of what is unknown among the base's place and turn, the tool's point and turn
        (12 in all), and the coefficients."""
        sizes = [6, 3, 3, len(self.columns)]
        return np.flatnonzero(np.repeat([not self.closure, True, self.turned, True], sizes))

    @property
    def first(self) -> int:
        """Number of the first coefficient among the unknowns: base and tool come before."""
        return len(self.free) - len(self.columns)

    @property
    def nominal(self) -> np.ndarray:
        """The tool's point in the last body's frame [m]."""
        placement = self.poses.tool
        return np.asarray(placement.rotation @ self.point + placement.translation)

    @property
    def priors(self) -> np.ndarray:
        """Standard deviations of the priors, shape (unknowns,)."""
        width = [column.unknown.spread for column in self.columns]
        return np.array([*[1e2] * 6, *[self.point_width] * 3, *[1e2] * 3, *width])[self.free]

    @cached_property
    def _features(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Features (n, k), joints (k,) and targets (k,) of the columns."""
        made = [column.feature for column in self.columns]
        features = np.stack(made, axis=1) if made else np.zeros((len(self.poses), 0))
        joints = np.array([column.index for column in self.columns], int)
        return features, joints, np.array([column.target for column in self.columns], int)

    def place(
        self, state: State, rows: np.ndarray, jacobian: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Rotations (n, 3, 3) and points (n, 3) of the tool, and their derivatives by the unknowns,
        each of shape (n, 3, unknowns); rotations as small rotation vectors from the left."""
        features, joints, targets = self._features
        poses, (base, at), (grip, reach) = self.poses, state.base, state.tool
        moved = features[rows] * state.c
        q = poses.q[rows].copy()
        own = targets == COORDINATE
        np.add.at(q.T, joints[own], moved[:, own].T)
        shift = None
        if not own.all():
            shift = np.zeros((len(rows), len(poses.names), 6))
            np.add.at(shift.transpose(1, 2, 0), (joints[~own], targets[~own]), moved[:, ~own].T)
        body, origin, axes, origins, frames = poses.forward(q, shift)
        tip = origin + body @ reach
        rotations, points = base @ body @ grip, at + tip @ base.T
        if not jacobian:
            none = np.zeros((0, 3, len(self.free)))
            return rotations, points, none, none
        lines = np.where(own[:, None, None], axes[joints], frames[joints, :, :, targets % 3])
        turning = np.where(own, poses.turns[joints], targets >= 3)[:, None, None]
        turn = np.where(turning, lines, 0.0)
        move = np.where(turning, np.cross(lines, tip - origins[joints]), lines)
        scale = features[rows].T[:, :, None]
        moves = (scale * move @ base.T).transpose(1, 2, 0)
        turns = (scale * turn @ base.T).transpose(1, 2, 0)
        eye, none = np.tile(np.eye(3), (len(rows), 1, 1)), np.zeros((len(rows), 3, 3))
        about = np.cross((tip @ base.T)[:, None], np.eye(3))
        moves = np.concatenate([eye, about, base @ body, none, moves], axis=2)
        turns = np.concatenate([none, eye, none, rotations, turns], axis=2)
        return rotations, points, moves[:, :, self.free], turns[:, :, self.free]

    def errors(
        self, state: State, rows: np.ndarray, jacobian: bool = False
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Measured less modelled points (n, 3) [m] and rotations (n, 3) [rad], and derivatives of
        what is modelled by the unknowns; in closure, means of the points less each of their rows.
        """
        rotations, points, moves, turns = self.place(state, rows, jacobian)
        measured, turned = self.poses.measured, np.zeros((len(rows), 3))
        if measured.position is None:
            slopes = moves - self._means(moves, rows)[0] if jacobian else moves
            return self._means(points, rows)[0] - points, turned, slopes, turns
        if measured.orientation is not None:
            turned = rotation_vectors(measured.orientation[rows] @ np.swapaxes(rotations, 1, 2))
        return measured.position[rows] - points, turned, moves, turns

    def _means(
        self, values: np.ndarray, rows: np.ndarray
    ) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Means of the rows of each point: for each row, and by point."""
        names = np.array(self.poses.measured.point)[rows]
        means = {str(name): values[names == name].mean(axis=0) for name in dict.fromkeys(names)}
        each = [means[str(name)] for name in names]
        return np.asarray(each), means

    def residual(
        self, state: State, rows: np.ndarray, jacobian: bool = False
    ) -> tuple[np.ndarray, np.ndarray]:
        """Weighted residuals (m,) and their derivatives (m, unknowns), with the opposite sign."""
        position, turned, moves, turns = self.errors(state, rows, jacobian)
        (sp, so), unknowns = self.error, len(self.free)
        parts, slopes = [position.ravel() / sp], [moves.reshape(-1, unknowns) / sp]
        if self.turned:
            parts.append(turned.ravel() / so)
            slopes.append(turns.reshape(-1, unknowns) / so)
        if self.closure and self.poses.measured.distances:
            _, points, moves, _ = self.place(state, rows, jacobian)
            means = self._means(points, rows)[1]
            slope = self._means(moves, rows)[1] if jacobian else {}
            for (one, other), (length, deviation) in self.poses.measured.distances.items():
                if one not in means or other not in means:
                    continue
                apart = means[one] - means[other]
                size = float(np.linalg.norm(apart))
                parts.append(np.array([(length - size) / deviation]))
                if jacobian:
                    way = apart / max(size, 1e-12) / deviation
                    slopes.append((way @ (slope[one] - slope[other]))[None])
        return np.concatenate(parts), np.concatenate(slopes)

    def moved(self, state: State, step: np.ndarray) -> State:
        """A state after a step of the unknowns: rotations turn by their rotation vectors."""
        every = np.zeros(12 + len(self.columns))
        every[self.free] = step
        (base, at), (grip, reach) = state.base, state.tool
        return State(
            (rotations_of(every[3:6]) @ base, at + every[:3]),
            (grip @ rotations_of(every[9:12]), reach + every[6:9]),
            state.c + every[12:],
        )

    def about(self, state: State, rows: np.ndarray) -> LeastSquares:
        """The measurement at some rows, by steps of the unknowns from a state."""
        nominal = -self.from_priors(state)
        frame = [
            Unknown("", "base or tool", "", value, 1.0, spread=width, least=-np.inf)
            for value, width in zip(nominal, self.priors[: self.first], strict=False)
        ]
        columns = [
            replace(one.unknown, nominal=-c) for one, c in zip(self.columns, state.c, strict=True)
        ]

        def slopes(step: np.ndarray) -> np.ndarray:
            _, slope = self.residual(self.moved(state, step), rows, jacobian=True)
            # Steps of rotations do not add: what one more step does, by a change of the whole.
            every, more = np.zeros(12), np.eye(12 + len(self.columns))
            every[self.free[: self.first]] = step[: self.first]
            more[3:6, 3:6], more[9:12, 9:12] = pin.Jexp3(-every[3:6]), pin.Jexp3(every[9:12])
            return np.asarray(slope @ more[np.ix_(self.free, self.free)])

        def predicted(step: np.ndarray) -> np.ndarray:
            return -self.residual(self.moved(state, step), rows)[0]

        none = np.zeros(len(predicted(np.zeros(len(nominal)))))
        return LeastSquares((*frame, *columns), predicted, none, none + 1.0, jacobian=slopes)

    def from_priors(self, state: State) -> np.ndarray:
        """Unknowns that have a prior, from its middle, shape (unknowns,)."""
        off = [np.zeros(6), state.tool[1] - self.nominal, np.zeros(3), state.c]
        return np.asarray(np.concatenate(off)[self.free])

    def start(self, rows: np.ndarray) -> State:
        """Base and tool without any errors of the chain, from whatever frames."""
        none, eye = np.zeros(len(self.columns)), np.eye(3)
        if self.closure:
            return State((eye, np.zeros(3)), (eye, self.nominal), none)
        body, origin, *_ = self.poses.forward(self.poses.q[rows], None)
        measured = self.poses.measured
        assert measured.position is not None
        position, n = measured.position[rows], len(rows)
        centred = position - position.mean(axis=0)
        seen = None if measured.orientation is None else measured.orientation[rows]
        back = np.swapaxes(body, 1, 2)
        found = []
        for base in _grid():
            grip = eye
            # Without orientations the base turns to where the points are; else the grid is enough
            # for what follows.
            for _ in range(1 if seen is not None else 4):
                mixed = base @ body.sum(axis=0)
                matrix = np.block([[n * eye, mixed], [mixed.T, n * eye]]) + 1e-9 * np.eye(6)
                goal = position - origin @ base.T
                inner = np.einsum("nab,nb->a", back, goal @ base)
                solved = np.linalg.solve(matrix, np.concatenate([goal.sum(axis=0), inner]))
                at, reach = solved[:3], solved[3:]
                tip = origin + body @ reach
                if seen is None:
                    base = nearest_rotation(centred.T @ (tip - tip.mean(axis=0)))
                    at = position.mean(axis=0) - base @ tip.mean(axis=0)
            cost = float(np.sum((position - at - tip @ base.T) ** 2)) / self.error[0] ** 2
            if seen is not None:
                own = back @ base.T @ seen
                grip = nearest_rotation(own.sum(axis=0))
                # Half of the Frobenius norm's square is the angle's, where that is small.
                cost += 0.5 * float(np.sum((own - grip) ** 2)) / self.error[1] ** 2
            found.append((cost, State((base, at), (grip, reach), none)))
        return min(found, key=lambda one: one[0])[1]

    def fit(self, rows: np.ndarray, start: State | None = None) -> Fitted:
        """Least squares of some rows, from a state or from wherever base and tool roughly are."""
        state = self.start(rows) if start is None else start
        if len(state.c) != len(self.columns):
            state = replace(state, c=np.zeros(len(self.columns)))
        step = minimum(self.about(state, rows), np.zeros(len(self.free)))
        state = self.moved(state, step)
        return Fitted(self, state, rows, *self.residual(state, rows, jacobian=True))


@dataclass(frozen=True)
class Fitted:
    """Where least squares ended."""

    problem: Problem
    state: State
    rows: np.ndarray
    residual: np.ndarray
    """Weighted, shape (m,)."""
    jacobian: np.ndarray
    """Of the weighted residuals, shape (m, unknowns)."""

    @cached_property
    def covariance(self) -> np.ndarray:
        precision = np.diag(self.problem.priors**-2.0)
        return np.asarray(np.linalg.inv(self.jacobian.T @ self.jacobian + precision))

    @cached_property
    def freedom(self) -> float:
        """Residuals less, of each unknown, what the poses determine."""
        free = len(self.residual) - float(np.sum((self.jacobian @ self.covariance) * self.jacobian))
        if self.problem.closure:
            points = self.problem.poses.measured.point or ()
            free -= 3.0 * len({points[i] for i in self.rows})
        return max(free, 3.0)

    @property
    def stretch(self) -> float:
        """The residuals' mean square, in the weights' units."""
        return float(self.residual @ self.residual) / self.freedom

    def informed(self, i: int) -> tuple[float, float, str]:
        """Part of the i-th coefficient's prior variance that the poses took away; its largest
        correlation with another coefficient, and that one's label if it is large."""
        first, covariance = self.problem.first, self.covariance
        k, spread = first + i, np.sqrt(np.diag(covariance))
        told = 1.0 - covariance[k, k] / self.problem.priors[k] ** 2
        together = np.abs(covariance[k] / spread[k] / spread)
        together[k] = 0.0
        most = float(together[first:].max(initial=0.0))
        other = self.problem.columns[int(together[first:].argmax())].unknown.label
        return told, most, other if most >= TOGETHER else ""


@cache
def _grid() -> list[np.ndarray]:
    """Rotations no more than some 40 degrees apart: those of a cube, each with four yaws."""
    yaws = Rotation.from_rotvec(np.outer(np.arange(4) * np.pi / 8.0, [0.0, 0.0, 1.0]))
    return [(one * yaw).as_matrix() for one in Rotation.create_group("O") for yaw in yaws]
