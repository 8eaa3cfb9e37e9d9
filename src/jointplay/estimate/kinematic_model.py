"""Kinematics of a robot whose joints and placements err, by causes that are features of the pose.

A cause is a `Term` of some joints (`TERM_KINDS`). In each joint it gives columns (`Column`): the
joint's coordinate or its placement errs by a feature of the pose times an unknown coefficient. The
coefficient has a normal prior about zero with a width of its physical size, so that few poses
cannot blow it up, and one that the poses do not tell stays within its prior.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, require_known
from jointplay.base.schema import known_keywords
from jointplay.base.tables import counted
from jointplay.estimate.parts import SPRINGS, WOUND, Elements, Springs, bearing_parts
from jointplay.estimate.static_poses import StaticPoses, rotations_of
from jointplay.estimate.unknowns import ROUNDING, TINY, Unknown
from jointplay.model.design import z_to
from jointplay.model.mechanism import Mechanism, frame_index
from jointplay.physics.joints import RollingBearing

if TYPE_CHECKING:
    from jointplay.model.payload import Payload

PLACEMENT = "xyzabc"
"""Components of a joint's placement that may err: translations along the axes of its frame, then
rotations about them."""
COORDINATE = len(PLACEMENT)
"""Number of a joint's own coordinate among the components that may err, behind its placement."""
_LOOSE_M = 2e-5
"""Large internal clearance of a rolling bearing: ISO 5753, class C3 at 30 mm [m]."""
FRICTIONS = tuple(step / 20.0 for step in range(15))
TRANSITIONS = (0.02, 0.03, 0.045, 0.07, 0.1, 0.15, 0.22, 0.33, 0.5, 0.7)
"""Frictions and transitions of play that are tried, as parts of the largest load of the joint:
equal steps, and factors of about 1.5; the best is then refined by `inference`. Steeper than the
first transition is a jump between two of fifty poses, wider than the last nearly a compliance
(judged). With tables half as fine 2 of 42 intervals of play missed instead of none of 43
(benchmarks/truth/calibrate.py, 40 robots)."""
_TURN_WIDTH = 2.5
"""Prior width of a placement's angles over that of its lengths: lengths over a reach of 0.4 m
[rad/m] (judged: with 5 three angles more are known of 6 robots of benchmarks/truth/calibrate.py,
and all intervals hold)."""


@known_keywords
@dataclass(frozen=True)
class Term:
    """A possible cause of errors, in some joints.

    Raises:
        JointplayError: a kind that does not exist; numbers that are not positive; a rail without
            the joint that it depends on.
    """

    kind: str
    """Key of `TERM_KINDS`."""
    joints: tuple[str, ...] = ()
    """Joints that it concerns; if empty, all."""
    width: float | Mapping[str, float] | None = None
    """Standard deviation of the prior, of all joints or by joint; that of `TERM_KINDS` if None. For
    a placement, that of its lengths [m]; angles have 2.5 rad/m times as much."""
    friction: float | None = None
    """For play: friction that holds the joint against its load [N m]; sought if None."""
    transition: float | None = None
    """For play: load over which the joint crosses half of its play [N m]; sought if None."""
    by: str = ""
    """For a rail: the joint whose position it depends on."""
    axes: str = ""
    """For a placement: some of the letters x, y, z (lengths) and a, b, c (angles about x, y, z);
    if empty, all except those that do what the joint's own offset does."""

    def __post_init__(self) -> None:
        require_known("kind of term", self.kind, TERM_KINDS)
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
        if set(self.axes) - set(PLACEMENT):
            raise JointplayError(f"axes of a placement are of x, y, z, a, b, c; got {self.axes!r}")

    @classmethod
    def parse(cls, text: str) -> Term:
        """Read ``KIND``, ``KIND JOINT,...``, ``rail JOINT by JOINT``, ``placement JOINT.z``."""
        head, _, by = text.strip().partition(" by ")
        kind, _, names = head.partition(" ")
        axes = ""
        if kind == "placement" and "," not in names and "." in names:
            names, _, axes = names.strip().rpartition(".")
        joints = tuple(name.strip() for name in names.split(",") if name.strip())
        return cls(kind, joints, by=by.strip(), axes=axes)

    def __str__(self) -> str:
        joints = ", ".join(self.joints) + (f".{self.axes}" if self.axes else "")
        return " ".join(filter(None, [self.kind, joints, f"by {self.by}" if self.by else ""]))

    @property
    def short(self) -> str:
        """Text for tables, which only counts more than two joints."""
        if len(self.joints) < 3:
            return str(self)
        return f"{self.kind} ({counted(len(self.joints), 'joint')})" + (
            f" by {self.by}" if self.by else ""
        )


PARTS = {
    "play": "gear_play",
    "compliance": "gear_compliance",
    "gear compliance": "gear_compliance",
    **{f"gear compliance {k}": name for k, name in enumerate(WOUND[:3], 1)},
    "bearing clearance": "radial_clearance",
    **{f"seat {way} compliance": f"{way}_compliance" for way in SPRINGS},
}
"""Names of coefficients that are the unknown of a part, as `identify` calls it (`parts`)."""


@dataclass(frozen=True)
class Column:
    """A coefficient, and how one component of a joint errs by it in n poses."""

    term: Term
    unknown: Unknown
    """The coefficient, with its prior."""
    index: int
    """Number of the joint in the chain."""
    target: int
    """Component that errs: 0 to 5 of the joint's placement, or `COORDINATE`."""
    feature: np.ndarray
    """Error by a coefficient of one, shape (n,); zero as long as it has to be chosen."""
    choices: Sequence[tuple[float, ...]] = ()
    """Parameters of which the feature depends, k sets, if it has to be chosen."""
    options: np.ndarray | None = None
    """Features by these, shape (n, k)."""
    moves: np.ndarray | None = None
    """Error of the placement by a coefficient of one, in place of `target`, (n, 6) [m, rad]."""

    @property
    def joint(self) -> str:
        return self.unknown.joint


class Poses:
    """n static poses of the chain of j joints that carries the tool, with loads and approaches.

    Pinocchio gives placements and axes; products along the chain are taken for all n poses at once,
    because placements that depend on the pose (rail, suspension) are no part of a Pinocchio model.

    Attributes:
        names: joints of the chain; `known` those whose positions were measured.
        q: coordinates, shape (n, j) [rad or m].
        load, wrench: torque of gravity along each joint's axis, (n, j), or the given one, and force
            and moment on it in the frame of its placement, (n, j, 6) [N m, N].
        approach: direction from which each joint came, -1, 0 (unknown) or 1, (n, j).
        link: positions by encoders behind the gears, nan where there is none, (n, j).

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
            state = model.joints[i].createData()
            model.joints[i].calc(state, np.zeros(1), np.zeros(1))
            motions.append(np.ravel(state.S))
        space = np.array(motions)
        self.turns = np.linalg.norm(space[:, 3:], axis=1) > 0.5
        self.axis = np.where(self.turns[:, None], space[:, 3:], space[:, :3])
        self.tool = frame.placement
        for name in poses.joints:
            ideal.coordinate(name)  # says which there are
        self.known = tuple(name for name in self.names if name in poses.joints)
        if not self.known:
            measured, movable = ", ".join(poses.joints), ", ".join(self.names)
            raise JointplayError(f"none of {measured} moves the tool {ideal.tool!r}; {movable} do")
        full = np.tile(ideal.configuration({}), (len(poses), 1))
        for column, name in enumerate(poses.joints):
            full[:, ideal.coordinate(name)] = poses.motor[:, column]
        self.q = full[:, [model.joints[i].idx_q for i in ids]]
        loaded = model.copy()
        for payload in payloads:
            held = model.frames[frame_index(model, payload.frame)]
            inertia = pin.Inertia(payload.mass, np.array(payload.centre), np.diag(payload.inertia))
            loaded.appendBodyToJoint(held.parentJoint, inertia, held.placement)
        self.load, self.wrench = _loads(loaded, full, ids)
        self.mechanism = mechanism
        self.approach, self.link = np.zeros(self.q.shape), np.full(self.q.shape, np.nan)
        at = [poses.joints.index(name) for name in self.known]
        numbers = [self.names.index(name) for name in self.known]
        self.approach[:, numbers] = poses.approach()[:, at]
        if poses.link is not None:
            self.link[:, numbers] = poses.link[:, at]
        if poses.load is not None:
            self.load[:, numbers] = poses.load[:, at]

    def forward(
        self, q: np.ndarray, shift: np.ndarray | None
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Forward kinematics with errors of placements.

        Args:
            q: the chain's coordinates, shape (n, j).
            shift: errors of placements in the joints' frames, translations and rotation vectors,
                shape (n, j, 6) [m, rad].

        Returns:
            Rotations (n, 3, 3) and origins (n, 3) of the last body; axes (j, n, 3) and origins
            (j, n, 3) of the joints; frames before the joints turn (j, n, 3, 3).
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
        """Columns of a term in the joints that it concerns.

        Raises:
            JointplayError: a joint that does not move the tool, or lacks what the term needs.
        """
        kind, columns = TERM_KINDS[term.kind], []
        joints = self.known if term.kind not in ("placement", "suspension") else self.names
        for joint in term.joints or joints:
            require_known("joint that moves the tool", joint, self.names)
            j = self.names.index(joint)
            idle = kind.by_load and not self.loaded(joint) and not term.joints
            features = [] if idle else kind.features(self, term, j)
            if not features and term.joints and kind.absent:
                others = ""
                if kind.part:
                    numbers = {name: self.names.index(name) for name in joints}
                    has = [n for n, at in numbers.items() if kind.features(self, term, at)]
                    others = f"; joints that have {kind.part}: {', '.join(has) or 'none'}"
                raise JointplayError(f"{joint} {kind.absent}{others}")
            stated = term.width.get(joint) if isinstance(term.width, Mapping) else term.width
            size = kind.width if stated is None else float(stated)
            unit_of_joint = "rad" if self.turns[j] else "m"
            units = {"own": unit_of_joint, "soft": "rad/(N*m)" if self.turns[j] else "m/N"}
            for feature, label, unit, target, choices, expected, moves in features:
                # Angles of a placement are as wide as its lengths over a reach.
                wide = _TURN_WIDTH if term.kind == "placement" and target > 2 else expected
                width = size * wide
                name = f"{term.kind} {label}".rstrip()
                name = PARTS.get(name, name)
                unknown = Unknown(
                    joint, name, units.get(unit, unit), 0.0, width,
                    spread=width, least=-np.inf, fine=False, model_error=0.0,
                )  # fmt: skip
                column = Column(term, unknown, j, target, feature, moves=moves)
                if choices:
                    zero = np.zeros(len(self))
                    column = replace(column, feature=zero, choices=choices, options=feature)
                columns.append(column)
        if not columns and kind.part:
            raise JointplayError(
                f"no joint that moves the tool has {kind.part} in the scenario, which "
                f"{term.kind!r} needs; joints: {', '.join(self.names)}"
            )
        return columns

    def rows(self, keep: np.ndarray) -> Poses:
        """Some of the poses, approached as they were."""
        subset = copy(self)
        subset.measured = self.measured.rows(keep)
        for name in ("q", "load", "wrench", "approach", "link"):
            setattr(subset, name, getattr(self, name)[keep])
        return subset

    def loaded(self, joint: str) -> bool:
        """Whether anything loads a joint in any pose."""
        most = np.abs(self.load).max(axis=0)
        return bool(most[self.names.index(joint)] > ROUNDING * most.max())

    def leaning(
        self, joint: str, friction: float | np.ndarray, transition: float | np.ndarray
    ) -> np.ndarray:
        """Side to which a joint with play and friction leans, -1 to 1, shape (n,).

        The load pushes it to one side; friction holds it back against the way it came. For k
        frictions and transitions the shape is (n, k).
        """
        j, width = self.names.index(joint), np.maximum(transition, TINY)
        held = np.multiply.outer(self.approach[:, j], friction)
        push = np.add.outer(self.load[:, j], np.zeros_like(width)) - held
        return np.asarray(np.clip(push / width, -1.0, 1.0))


class Feature(NamedTuple):
    """A feature of n poses, by which a component of a joint errs; a `Column` without its term."""

    values: np.ndarray
    """Error by a coefficient of one, shape (n,), or (n, k) for k choices."""
    coefficient: str = ""
    """Name of the coefficient, where its term has several."""
    unit: str = "own"
    """Unit of the coefficient, SI; ``own``: of the joint, ``soft``: of its compliance."""
    target: int = COORDINATE
    """Component that errs: 0 to 5 of the joint's placement, or `COORDINATE`."""
    choices: Sequence[tuple[float, ...]] = ()
    """Parameters of the k choices: of play friction and transition [N m], of a jump its place."""
    expected: float = 1.0
    """Factor of the kind's width: the expected value, where the coefficient is a part's [SI]."""
    moves: np.ndarray | None = None
    """Error of the placement, see `Column`."""


@dataclass(frozen=True)
class TermKind:
    """A kind of term: a cause of errors, and its features in a joint."""

    meaning: str
    width: float
    """Width of the prior [SI: rad, m, rad/(N m), ...]."""
    features: Callable[[Poses, Term, int], list[Feature]]
    """Features of a joint, by its number in the chain."""
    by_load: bool = False
    """Whether only joints that gravity loads have it, unless others are asked for."""
    absent: str = ""
    """Why a joint that was asked for has none, as a text behind its name."""
    part: str = ""
    """Name of the scenario's part that a joint needs for it."""


def _waves(turns: float) -> Callable[[Poses, Term, int], list[Feature]]:
    """Sine and cosine of a multiple of a joint's angle."""

    def features(poses: Poses, term: Term, j: int) -> list[Feature]:
        angle = turns * poses.q[:, j]
        waves = [Feature(np.sin(angle), "sin"), Feature(np.cos(angle), "cos")]
        return waves if poses.turns[j] else []

    return features


def _sawtooth(poses: Poses, term: Term, j: int) -> list[Feature]:
    """A gain, and a jump at one place between two poses."""
    q = poses.q[:, j]
    order = np.sort(q)
    places = [(float(place),) for place in (0.5 * (order[1:] + order[:-1]))[1:-1]]
    behind = (q[:, None] > np.ravel(places)).astype(float)
    gain = Feature(q, "gain", "rad/rad")
    return [gain, Feature(behind, "jump", choices=places)] if poses.turns[j] else []


def _leaning(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Side to which play leans, by half of it; friction and transition are chosen if not given."""
    largest = float(np.abs(poses.load[:, j]).max())
    frictions = [f * largest for f in FRICTIONS] if poses.measured.ordered else [0.0]
    frictions = frictions if term.friction is None else [term.friction]
    transitions = [t * largest for t in TRANSITIONS]
    transitions = transitions if term.transition is None else [term.transition]
    pairs = list(product(frictions, transitions))
    lean = 0.5 * poses.leaning(poses.names[j], *np.transpose(pairs))
    return [Feature(lean, choices=pairs) if len(pairs) > 1 else Feature(lean[:, 0])]


def _difference(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Link encoder less motor's."""
    off = poses.link[:, j] - poses.q[:, j]
    return [] if np.isnan(off).any() or not off.any() else [Feature(off, unit="")]


def _rail(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Turns of the joint's place by another joint's position."""
    joints = poses.measured.joints
    require_known("joint", term.by, joints)
    place = poses.measured.motor[:, joints.index(term.by)]
    turns = term.by in poses.names and poses.turns[poses.names.index(term.by)]
    unit, off = "rad/rad" if turns else "rad/m", place - place.mean()
    return [Feature(off, f"about {axis}", unit, 3 + k) for k, axis in enumerate("xyz")]


def _suspension(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Turns of the joint's place by the moment of the weight beyond it."""
    moments = zip("xyz", poses.wrench[:, j, 3:].T, strict=True)
    return [Feature(m, f"about {a}", "rad/(N*m)", 3 + k) for k, (a, m) in enumerate(moments)]


def _bearing_load(poses: Poses, j: int) -> tuple[np.ndarray, np.ndarray]:
    """Force and moment on a joint in its bearing's axes, (n, 6), and these in its frame, (6, 6)."""
    turn = np.kron(np.eye(2), z_to(poses.axis[j]))
    return poses.wrench[:, j] @ turn, turn


def _gear(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Twist of a gear by the compliance of each piece of its curve."""
    gear, load = poses.mechanism.gears.get(poses.names[j]), poses.load[:, j]
    if gear is None:
        return []
    curve = gear.curve()
    ends = np.concatenate([[0.0], curve.torques, [np.inf]])
    features = []
    for k, slope in enumerate(curve.slopes):
        part = np.clip(np.abs(load) - ends[k], 0.0, ends[k + 1] - ends[k])
        number = f" {k + 1}" if len(curve.slopes) > 1 else ""
        twist = np.sign(load) * part
        features.append(Feature(twist, f"compliance{number}", "soft", expected=1.0 / float(slope)))
    return features


def _bearing(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Displacement of a rolling bearing by its clearance, and deflection of its elements."""
    bearing = poses.mechanism.clearance.get(poses.names[j])
    if not isinstance(bearing, RollingBearing):
        return []
    loads, turn = _bearing_load(poses, j)
    side = -1.0 if bearing.exchanged else 1.0
    cage = bearing.cage_angle + side * bearing.cage_ratio * poses.q[:, j]
    elements = Elements("", replace(bearing, seat=None))

    def at(values: Mapping[str, float]) -> np.ndarray:
        return np.asarray(side * elements.holding(values).rests(side * loads, cage)[0] @ turn.T)

    ones, features = np.ones(len(poses)), []
    none = {} if getattr(bearing, "preload", None) is not None else {"radial_clearance": 0.0}
    tight = at(none)
    if none:
        size = max(bearing.bought_clearance, _LOOSE_M)
        moves = (at({"radial_clearance": size}) - tight) / size
        features.append(Feature(ones, "clearance", "m", expected=_LOOSE_M, moves=moves))
    return [*features, Feature(ones, "deflection", "", moves=tight)]


def _seat(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Displacement of springs, or of a bearing's seat, by the compliance of each way."""
    name, (loads, turn) = poses.names[j], _bearing_load(poses, j)
    bearing = poses.mechanism.clearance.get(name)
    ones, features = np.ones(len(poses)), []
    for part in () if bearing is None else bearing_parts(name, bearing):
        if not isinstance(part, Springs):
            continue
        for way, moved in part.sunk(loads).items():
            size = part.compliances[way]
            unit = "rad/(N*m)" if way in ("tilt", "torsional") else "m/N"
            moves = moved @ turn.T / size
            features.append(Feature(ones, f"{way} compliance", unit, expected=size, moves=moves))
    return features


def _placement(poses: Poses, term: Term, j: int) -> list[Feature]:
    """Errors of a joint's placement; that of the first joint is the base's, which is unknown."""
    if j == 0 and not term.joints:
        return []
    letters, size = term.axes or PLACEMENT, np.abs(poses.axis[j])
    if not term.axes and np.isclose(size.max(), 1.0):  # what the joint's own offset does
        letters = letters.replace(("abc" if poses.turns[j] else "xyz")[int(size.argmax())], "")
    labels = [f"along {axis}" for axis in "xyz"] + [f"about {axis}" for axis in "xyz"]
    numbers, ones = map(PLACEMENT.index, letters), np.ones(len(poses))
    return [Feature(ones, labels[k], "m" if k < 3 else "rad", k) for k in numbers]


TERM_KINDS: Mapping[str, TermKind] = {
    "offset": TermKind(
        "zero of the joint's encoder", 0.1,
        lambda poses, term, j: [Feature(np.ones(len(poses)))],
    ),
    "placement": TermKind(
        "errors of the joint's place in its link (lengths, angles)", 2e-3, _placement
    ),
    "compliance": TermKind(
        "joint gives way in proportion to its load", 1e-3,
        lambda poses, term, j: [Feature(poses.load[:, j], unit="soft")],
        by_load=True,
    ),
    "play": TermKind(
        "joint leans to the side of its load, less friction, by half its play", 2e-2, _leaning,
        by_load=True,
    ),
    "eccentricity": TermKind(
        "encoder errs by the sine and cosine of the joint's angle", 1e-2, _waves(1.0),
        absent="slides: it has no eccentricity",
    ),
    "second-harmonic": TermKind(
        "encoder errs by the sine and cosine of twice the angle", 5e-3, _waves(2.0),
        absent="slides: it has no second-harmonic",
    ),
    "sawtooth": TermKind(
        "encoder with a wrong gain that jumps at one angle", 0.1, _sawtooth,
        absent="slides: it has no sawtooth",
    ),
    "ratio": TermKind(
        "joint moves by a constant part more than its encoder says", 0.1,
        lambda poses, term, j: [Feature(poses.q[:, j], "error", "")],
    ),
    "hysteresis": TermKind(
        "joint stays where it came from", 5e-3,
        lambda poses, term, j: [Feature(poses.approach[:, j])],
    ),
    "link-encoder": TermKind(
        "share of the link encoder's reading in what is true", 1.0, _difference,
        absent="has no encoder on the link's side of its own",
    ),
    "rail": TermKind("joint's place turns with another joint's position", 5e-2, _rail),
    "suspension": TermKind(
        "joint's place turns with the moment of the weight beyond it", 1e-3, _suspension
    ),
    "gear": TermKind(
        "gear winds up by the compliance of each piece of its curve", 2.0, _gear,
        absent="has no gear in the scenario", part="a gear",
    ),
    "bearing": TermKind(
        "rolling bearing's clearance, and its deflection over the catalogue's", 2.0, _bearing,
        absent="has no rolling bearing in the scenario", part="a rolling bearing",
    ),
    "seat": TermKind(
        "springs or a bearing's seat give way in proportion to their load", 2.0, _seat,
        absent="has neither springs nor a bearing in a seat in the scenario",
        part="springs or a bearing in a seat",
    ),
}  # fmt: skip
"""Kinds of terms; a new one is a function of the poses. Widths of priors are judged: with all twice
as wide 3 of 112 estimates of these 6 robots are left out, and intervals are a fifth wider
(median)."""


def _loads(model: pin.Model, q: np.ndarray, ids: Sequence[int]) -> tuple[np.ndarray, np.ndarray]:
    """Load of gravity on the chain's joints: torques along their axes (n, j), and force and moment
    in the frames of their placements (n, j, 6) [N m, N]."""
    data, still = model.createData(), np.zeros(model.nv)
    load, wrench = np.zeros((len(q), len(ids))), np.zeros((len(q), len(ids), 6))
    for i, row in enumerate(q):
        torque = pin.rnea(model, data, row, still, still)
        for j, joint in enumerate(ids):
            load[i, j] = -torque[model.joints[joint].idx_v]
            turned = model.jointPlacements[joint].rotation.T @ data.liMi[joint].rotation
            wrench[i, j, :3] = -turned @ data.f[joint].linear
            wrench[i, j, 3:] = -turned @ data.f[joint].angular
    return load, wrench
