"""The whole error of a tool: which joint, which cause, and what halving it would buy.

Beside play an arm gives way under its weight, its payload and a force; encoders have a resolution
and a zero, gears an error of their own; links and axes are not where the drawing has them, and all
of it grows with heat. Each of these displaces the body beyond a joint by a small twist. Twists that
can be anywhere in a set add as sets, so that a worst case is a sum of their support functions;
twists at random add by their variances; what loads displace is a shift that both share.

What is not given of a robot is taken from a class of robots (`robot_errors`), and said to be
assumed.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from jointplay.core.errors import (
    JointplayError,
    MissingName,
    require_a,
    require_finite,
    require_positive,
)
from jointplay.core.tables import Column, Table
from jointplay.design.levers import (
    GEAR,
    TurnPlay,
    configurations,
    lever,
    place,
    tool_place,
)
from jointplay.design.rest import compliance_shift
from jointplay.design.robot_errors import (
    CLASSES,
    ERROR_CLASSES,
    JointErrors,
    RobotErrors,
    refuse_misfit,
)
from jointplay.design.static_budget import half_sphere
from jointplay.joints import RollingBearing
from jointplay.joints.play import Play, Support
from jointplay.mechanism.mechanism import Mechanism

CAUSES = ("play", "elasticity", "encoder", "gear error", "geometry", "heat")
"""What makes a tool miss its target."""

DRAWS = 4000
"""States by which the variance of a play is found."""
_LISTED = 2e-3
"""Part of the worst case below which a contribution has no line of its own."""
_FITS = 0.02
"""Part of the worst case by which the exact kinematics may put it elsewhere."""
_DIRECTIONS = 400
_CLIMBS = 12


@dataclass(frozen=True)
class BoxPlay(Play):
    """Displacements and rotations between bounds, each independent of the others."""

    half: tuple[float, ...]
    """Along and about x, y, z, either way, six [m, rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        """To a corner."""
        half = np.array(self.half)
        return float(np.linalg.norm(half[:3])), float(np.linalg.norm(half[3:]))

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        point = np.array(self.half) * np.sign(loads)
        return Support(np.abs(loads) @ np.array(self.half), point)


@dataclass(frozen=True)
class Contribution:
    """What one cause does at one joint, at n poses."""

    joint: str
    cause: str
    set: Play | None
    """Where the twist may be; None: only where `shift` says."""
    shift: np.ndarray
    """Twist in any case, bearing axes, shape (n, 6) [m, rad]."""
    spread: float
    """Relative uncertainty of `shift`, either way."""
    covariance: np.ndarray
    """Of the twist within its set, (6, 6)."""
    move: np.ndarray
    """The tool's displacement and rotation in world axes per twist, (n, 6, 6)."""
    origin: str
    """Where the numbers come from."""
    factor: float = 1.0
    """What all of it is multiplied by."""
    proportional: bool = True
    """Whether it is proportional to a size that can be chosen; the play of a rolling bearing is
    not."""

    def along(self, directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Farthest displacement along directions (n, m, 3) and where, (n, m) and (n, m, 3) [m]."""
        n, m, _ = directions.shape
        rows = self.move[:, :3]
        at = np.einsum("nik,nk->ni", rows, self.shift)
        along = np.einsum("nmi,ni->nm", directions, at)
        value = along + self.spread * np.abs(along)
        point = at[:, None] * (1.0 + self.spread * np.sign(along))[..., None]
        if self.set is not None:
            loads = np.einsum("nmi,nik->nmk", directions, rows).reshape(n * m, 6)
            found = self.set.support(loads)
            value = value + found.value.reshape(n, m)
            point = point + np.einsum("nik,nmk->nmi", rows, found.point.reshape(n, m, 6))
        return self.factor * value, self.factor * point

    def at(self, poses: Sequence[int] | np.ndarray) -> Contribution:
        """The same at some of the poses."""
        return replace(self, shift=self.shift[poses], move=self.move[poses])

    def variance(self) -> np.ndarray:
        """Covariance of the tool's displacement, (n, 3, 3) [m^2]."""
        rows = self.move[:, :3]
        at = self.spread / np.sqrt(3.0) * np.einsum("nik,nk->ni", rows, self.shift)
        whole = np.einsum("nik,kl,njl->nij", rows, self.covariance, rows)
        return self.factor**2 * (whole + at[:, :, None] * at[:, None, :])

    def mean(self) -> np.ndarray:
        """The tool's displacement in any case, (n, 3) [m]."""
        return self.factor * np.einsum("nik,nk->ni", self.move[:, :3], self.shift)

    def twist(self, direction: np.ndarray) -> np.ndarray:
        """The twist farthest along a direction at the first pose, (1, 6)."""
        load = direction @ self.move[0, :3]
        whole = self.shift[:1] * (1.0 + self.spread * np.sign(self.shift[0] @ load))
        if self.set is not None:
            whole = whole + self.set.support(load[None]).point
        return self.factor * whole

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Twists at random, at the first pose, (count, 6)."""
        part = 1.0 + self.spread * random.uniform(-1.0, 1.0, count)
        twist = part[:, None] * self.shift[0]
        if isinstance(self.set, BoxPlay):
            twist = twist + random.uniform(-1.0, 1.0, (count, 6)) * self.set.half
        elif isinstance(self.set, SinePlay):
            twist = twist + np.sin(random.uniform(0.0, 2.0 * np.pi, count))[:, None] * self.set.way
        elif self.set is not None:
            twist = twist + _pushed(self.set, random, count)
        return self.factor * twist


@dataclass(frozen=True)
class SinePlay(Play):
    """An error that goes up and down with a phase that nobody knows."""

    amplitude: tuple[float, ...]
    """Along and about x, y, z, six [m, rad]."""

    @property
    def way(self) -> np.ndarray:
        """The amplitude as an array."""
        return np.array(self.amplitude)

    @property
    def reach(self) -> tuple[float, float]:
        """The amplitude."""
        return float(np.linalg.norm(self.way[:3])), float(np.linalg.norm(self.way[3:]))

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        along = loads @ self.way
        return Support(np.abs(along), np.sign(along)[:, None] * self.way)


def _pushed(play: Play, random: np.random.Generator, count: int) -> np.ndarray:
    """Where loads of random direction push a journal, (count, 6)."""
    aside, angle = play.reach
    if aside == 0.0 and angle == 0.0:
        return np.zeros((count, 6))
    arm = aside / angle if angle > 0.0 and aside > 0.0 else 1.0
    loads = random.normal(size=(count, 6)) * ([1.0] * 3 + [arm] * 3)
    if not isinstance(play, TurnPlay):
        loads[:, 5] = 0.0
    return play.support(loads).point


@dataclass(frozen=True)
class ErrorBudget:
    """Errors of the tool at n poses by k contributions; lengths in m."""

    contributions: tuple[Contribution, ...]
    q: np.ndarray
    """Configurations, (n, nq)."""
    mechanism: Mechanism
    force: np.ndarray
    """On the tool, world axes [N]."""
    assumed: tuple[str, ...]
    """What was assumed, lines of text."""
    given: tuple[str, ...] = ()
    """What was given besides the mechanism, lines of text."""

    @cached_property
    def worst(self) -> np.ndarray:
        """Largest distance of the tool from where it should be, (n,) [m]."""
        return self.farthest(self.contributions)[0]

    @cached_property
    def direction(self) -> np.ndarray:
        """Where to, unit vectors, (n, 3)."""
        return self.farthest(self.contributions)[1]

    @cached_property
    def parts(self) -> np.ndarray:
        """What each contribution adds to `worst`, (k, n)."""
        d = self.direction[:, None]
        return np.stack([one.along(d)[0][:, 0] for one in self.contributions])

    @cached_property
    def mean(self) -> np.ndarray:
        """The tool's displacement that loads and heat bring in any case, (n, 3) [m]."""
        total: np.ndarray = sum(
            (one.mean() for one in self.contributions), start=np.zeros((len(self.q), 3))
        )
        return total

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of the rest, (n, 3, 3) [m^2]."""
        total: np.ndarray = sum(
            (one.variance() for one in self.contributions), start=np.zeros((len(self.q), 3, 3))
        )
        return total

    @property
    def rms(self) -> np.ndarray:
        """Root mean square distance, (n,) [m]."""
        return _rms(self.mean, self.covariance)

    @property
    def worst_pose(self) -> int:
        """Index of the pose with the largest error."""
        return int(self.worst.argmax())

    def halved(self, *indices: int) -> tuple[float, float]:
        """By how much `worst` and `rms` fall at the worst pose by half of contributions [m]."""
        at = self.worst_pose
        own = self.contributions
        other = [replace(one, factor=0.5) if i in indices else one for i, one in enumerate(own)]
        rest = ErrorBudget(tuple(one.at([at]) for one in other), self.q[at : at + 1],
                           self.mechanism, self.force, ())  # fmt: skip
        found = rest.farthest(rest.contributions, self.direction[at : at + 1])[0][0]
        return float(self.worst[at] - found), float(self.rms[at] - rest.rms[0])

    @property
    def data(self) -> Table:
        """A row for each contribution at the worst pose."""
        at = self.worst_pose
        means = np.array([one.mean()[at] for one in self.contributions])
        every = zip(means, self.contributions, strict=True)
        own = [_rms(mean[None], one.variance()[at][None])[0] for mean, one in every]
        return Table(
            (
                Column("joint", [one.joint for one in self.contributions]),
                Column("cause", [one.cause for one in self.contributions]),
                Column("worst", self.parts[:, at], "m"),
                Column("rms", own, "m"),
                *(Column(f"mean {axis}", means[:, k], "m") for k, axis in enumerate("xyz")),
                Column("origin", [one.origin for one in self.contributions]),
            )
        )

    def by(self, what: str) -> dict[str, tuple[float, float]]:
        """Parts of worst case and variance at the worst pose by ``"joint"`` or ``"cause"``."""
        at, found = self.worst_pose, dict[str, tuple[float, float]]()
        whole = float(np.trace(self.covariance[at])) or 1.0
        for i, one in enumerate(self.contributions):
            key = getattr(one, what)
            worst, share = found.get(key, (0.0, 0.0))
            own = float(np.trace(one.variance()[at])) / whole
            found[key] = worst + float(self.parts[i, at]), share + own
        return found

    @staticmethod
    def sphere() -> np.ndarray:
        """Directions among which the worst one is searched first, (m, 3)."""
        half = half_sphere(_DIRECTIONS)
        return np.vstack([half, -half])

    def farthest(
        self, contributions: Sequence[Contribution], start: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Worst distances (n,) [m] and their directions (n, 3), found from `start` on.

        Without a start the whole sphere is searched.
        """
        n = len(self.q) if start is None else len(start)
        if start is None:
            sphere = self.sphere()
            every = np.broadcast_to(sphere, (n, *sphere.shape))
            values = sum(one.along(every)[0] for one in contributions)
            start = sphere[np.asarray(values).argmax(axis=1)]
        d = start
        for _ in range(_CLIMBS):
            total = sum(one.along(d[:, None])[1][:, 0] for one in contributions)
            size = np.linalg.norm(total, axis=1, keepdims=True)
            d = np.where(size > 0.0, total / np.where(size > 0.0, size, 1.0), d)
        return np.asarray(sum(one.along(d[:, None])[0][:, 0] for one in contributions)), d

    def sample(self, count: int, seed: int = 0) -> np.ndarray:
        """Errors of the tool at the worst pose by the exact kinematics, at random, (count, 3) [m].

        Sets are drawn as their variances suppose.
        """
        random, at = np.random.default_rng(seed), self.worst_pose
        return self._displaced([one.at([at]).draw(random, count) for one in self.contributions])

    @property
    def reached(self) -> float:
        """Distance by the exact kinematics where all twists are those of `worst` [m]."""
        at = self.worst_pose
        twists = [one.at([at]).twist(self.direction[at]) for one in self.contributions]
        return float(np.linalg.norm(self._displaced(twists)[0]))

    def _displaced(self, twists: Sequence[np.ndarray]) -> np.ndarray:
        """Errors of the tool at the worst pose by twists of all contributions, each (m, 6)."""
        by_joint: dict[str, np.ndarray] = {}
        for one, twist in zip(self.contributions, twists, strict=True):
            by_joint[one.joint] = by_joint.get(one.joint, 0.0) + twist
        count, q = len(twists[0]), self.q[self.worst_pose]
        model, data = self.mechanism.model, self.mechanism.data
        tool = tool_place(self.mechanism, q)
        pin.computeJointJacobians(model, data, q)
        frame = model.frames[self.mechanism.tool_frame]
        supports = [int(i) for i in model.supports[frame.parentJoint] if i > 0]
        turn = np.broadcast_to(np.eye(3), (count, 3, 3)).copy()
        shift = np.zeros((count, 3))
        order = {name: place(self.mechanism, name) for name in by_joint}
        for index in supports:
            for name, (own, axes) in order.items():
                if own != index:
                    continue
                rows = axes.rotation
                centre = axes.translation
                own_turn = _rotations(by_joint[name][:, 3:] @ rows.T)
                moved = by_joint[name][:, :3] @ rows.T
                # x -> centre + R (x - centre) + moved, within what has been displaced before.
                shift = shift + np.einsum(
                    "nij,nj->ni", turn, centre + moved - np.einsum("nij,j->ni", own_turn, centre)
                )
                turn = np.einsum("nij,njk->nik", turn, own_turn)
        place_now = np.einsum("nij,j->ni", turn, tool.translation) + shift
        return np.asarray(place_now - tool.translation)

    @property
    def table(self) -> Table:
        """At the worst pose: each joint and cause, shares, and what halving buys."""
        at = self.worst_pose
        same: dict[tuple[str, str], list[int]] = {}
        for i, one in enumerate(self.contributions):
            same.setdefault((one.joint, one.cause), []).append(i)
        rows: list[tuple] = []
        small = []
        for (joint, cause), indices in sorted(
            same.items(), key=lambda item: -self.parts[item[1], at].sum()
        ):
            part = float(self.parts[indices, at].sum())
            if part <= _LISTED * self.worst[at]:
                small.append(part)
                continue
            ones = [self.contributions[i] for i in indices]
            mean, variance = (
                np.sum([getattr(one, name)()[at] for one in ones], axis=0)
                for name in ("mean", "variance")
            )
            gain, less = self.halved(*indices)
            rms = float(_rms(mean[None], variance[None])[0])
            rows.append((joint, cause, part, part / self.worst[at], rms, -gain, -less))
        heads = [("joint", ""), ("cause", ""), ("worst case", "m"), ("share", "1"), ("rms", "m")]
        heads += [("halved: worst", "m"), ("halved: rms", "m")]
        totals: list[tuple] = []
        if small:
            totals.append((f"{len(small)} more", None, sum(small), None, None, None, None))
        totals.append(("all", None, self.worst[at], 1.0, self.rms[at], None, None))
        return replace(Table.of(heads, rows), totals=totals, notes=self._notes())

    def _notes(self) -> list[str]:
        """By cause, what is displaced in any case, the exact kinematics, what was given."""
        at = self.worst_pose
        shares = ", ".join(
            f"{cause} {100 * worst / self.worst[at]:.0f} % (variance {100 * share:.0f} %)"
            for cause, (worst, share) in self.by("cause").items()
        )
        mean = ", ".join(f"{1e3 * x:.4f}" for x in self.mean[at])
        off = self.reached / self.worst[at] - 1.0
        fits = "" if abs(off) < _FITS else ": too far for levers; is the class right?"
        return [
            f"by cause: {shares}",
            f"loads and heat displace the tool by {mean} mm along x, y, z in any case",
            f"by the exact kinematics the worst case is {1e3 * self.reached:.4f} mm "
            f"({100 * off:+.2f} %{fits})",
            *(f"given: {line}" for line in self.given),
            *(f"assumed: {line}" for line in self.assumed),
        ]


def _rms(mean: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    square = (mean**2).sum(axis=1) + np.trace(covariance, axis1=1, axis2=2)
    return np.asarray(np.sqrt(square))


def _rotations(vectors: np.ndarray) -> np.ndarray:
    """Rotation matrices of rotation vectors, (n, 3) to (n, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(vectors).as_matrix())


def error_budget(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    *,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    errors: RobotErrors | None = None,
    kind: str | None = None,
    causes: Collection[str] = CAUSES,
    remaining: Mapping[tuple[str, str], float] | None = None,
) -> ErrorBudget:
    """The whole error of the tool, by joint and by cause.

    Args:
        mechanism: a tree, with or without play.
        poses: joint positions by name [rad or m], the rest zero; or configurations, (n, nq).
        force: on the tool, besides gravity, world axes [N].
        errors: what is known of the robot and of its joints.
        kind: class of robots from which all else is taken, of `ERROR_CLASSES`; None: that of
            `errors`, or ``industrial``.
        causes: those that count, of `CAUSES`.
        remaining: parts of single causes that remain, by joint and cause: clearances, plays of
            gears, deflections, amplitudes and tolerances are so many times as large; of a joint
            with a rolling bearing and a gear, the gear's play.

    Raises:
        JointplayError: loops; a force that is no vector; springs of another kind of joint; a part
            that is not positive, or of the play of a rolling bearing, which is not proportional
            to its clearance.
        MissingName: no such joint, class or cause.
    """
    require_a("mechanism", mechanism, "Mechanism")
    if mechanism.loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: a whole error budget is for robots without "
            "closed loops; budget() has the play of those with loops"
        )
    for cause in causes:
        if cause not in CAUSES:
            raise MissingName("cause of errors", cause, CAUSES)
    given = RobotErrors() if errors is None else errors
    kind = kind or given.assumed or "industrial"
    if kind not in ERROR_CLASSES:
        raise MissingName("class of errors", kind, CLASSES)
    refuse_misfit(given, mechanism)
    parts = _checked_parts(mechanism, remaining or {})
    smaller = {
        name: mechanism.clearance[name].scaled(own["play"])
        for name, own in parts.items()
        if "play" in own and is_proportional(mechanism, name)
    }
    if smaller:
        mechanism = mechanism.with_clearance({**mechanism.clearance, **smaller})
    q = configurations(mechanism, poses)
    push = np.array([require_finite("force on the tool", one, "N") for one in force])
    if push.shape != (3,):
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    moves, loads, arms = _levers(mechanism, q, push)
    found: list[Contribution] = []
    for name in mechanism.joints:
        if not moves[name].any():
            continue
        at = moves[name], loads[name], arms[name]
        found += _of_joint(mechanism, name, _Sizes(given, kind), parts.get(name, {}), *at)
    for name in mechanism.mounts:
        if moves[name].any():
            shift = mechanism.clearance[name].springs.displacements(loads[name])
            sizes = _Sizes(given, kind)
            spread, origin = sizes.of(name, "stiffness_spread")
            words = sizes.words({f"either way {100 * spread:g} %": origin}, ["its springs"])
            factor = parts.get(name, {}).get("elasticity", 1.0)
            found.append(
                Contribution(name, "elasticity", None, shift, spread, np.zeros((6, 6)), moves[name],
                             words, factor)
            )  # fmt: skip
    kept = tuple(one for one in found if one.cause in causes)
    if not kept:
        raise JointplayError("nothing moves the tool, or no cause is counted")
    assumed, stated = dict[str, None](), dict[str, list[str]]()
    for one in kept:
        head, mark, told = one.origin.partition("given: ")
        if mark:
            line = f"{one.cause}: {told.partition(';')[0]}"
            stated.setdefault(line, []).append(one.joint)
        if head.startswith("class"):
            told = head.partition(";")[0].partition("assumed: ")[2]
            assumed[f"{one.cause}: {told} (class {kind!r})"] = None
    moved = len({one.joint for one in kept})
    lines = (
        f"{line} ({'all joints' if len(names) == moved else ', '.join(names)})"
        for line, names in stated.items()
    )
    return ErrorBudget(kept, q, mechanism, push, tuple(assumed), tuple(lines))


def is_proportional(mechanism: Mechanism, joint: str) -> bool:
    """Whether a joint has a clearance to which its play is proportional, in the first order.

    The play of a rolling bearing along its axis and in tilt grows with the root of its clearance.
    """
    own = mechanism.clearance.get(joint)
    return own is not None and bool(own.clearances) and own.resultant is None


def _checked_parts(
    mechanism: Mechanism, remaining: Mapping[tuple[str, str], float]
) -> dict[str, dict[str, float]]:
    """What remains of causes, by joint."""
    parts: dict[str, dict[str, float]] = {}
    for (name, cause), part in remaining.items():
        if name not in (*mechanism.joints, *mechanism.mounts):
            raise MissingName("joint", name, [*mechanism.joints, *mechanism.mounts])
        if cause not in CAUSES:
            raise MissingName("cause of errors", cause, CAUSES)
        part = require_positive(f"part of {cause} of {name!r} that remains", part, "")
        if cause == "play" and not is_proportional(mechanism, name):
            own = mechanism.clearance.get(name)
            if own is not None and max(own.play().reach) > 0.0 and name not in mechanism.gears:
                raise JointplayError(
                    f"the play of joint {name!r} ({own.kind}) is not proportional to its "
                    "clearance; give the joint another class of bearing"
                )
        parts.setdefault(name, {})[cause] = part
    return parts


def _levers(
    mechanism: Mechanism, q: np.ndarray, push: np.ndarray
) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray], dict[str, np.ndarray]]:
    """Levers (n, 6, 6), loads (n, 6) and ways to the next joint or the tool (n, 3), by joint."""
    names, n = (*mechanism.joints, *mechanism.mounts), len(q)
    moves = {name: np.zeros((n, 6, 6)) for name in names}
    loads = {name: np.zeros((n, 6)) for name in names}
    arms = {name: np.zeros((n, 3)) for name in names}
    for i, row in enumerate(q):
        pin.computeJointJacobians(mechanism.model, mechanism.data, row)
        tool = tool_place(mechanism, row)
        pin.centerOfMass(mechanism.model, mechanism.data, row, True)
        centres = {}
        for name in names:
            moves[name][i], loads[name][i] = lever(mechanism, name, tool.translation, push)
            centres[name] = place(mechanism, name)
        chain = [name for name in names if moves[name][i].any()]
        chain.sort(key=lambda name: centres[name][0])
        for name, after in zip(chain, [*chain[1:], None], strict=True):
            to = tool.translation if after is None else centres[after][1].translation
            axes = centres[name][1]
            arms[name][i] = axes.rotation.T @ (to - axes.translation)
    return moves, loads, arms


def _of_joint(
    mechanism: Mechanism,
    name: str,
    sizes: _Sizes,
    remaining: Mapping[str, float],
    move: np.ndarray,
    load: np.ndarray,
    arm: np.ndarray,
) -> list[Contribution]:
    """All contributions of a joint; of each cause `remaining` remains."""
    n = len(move)
    slides = mechanism.description.joints[name].slides
    about = 2 if slides else 5
    unit = "m" if slides else "rad"
    none, nothing = np.zeros((n, 6)), np.zeros((6, 6))

    def along(size: float) -> tuple[float, ...]:
        return tuple(size if k == about else 0.0 for k in range(6))

    def variance(halves: Sequence[float]) -> np.ndarray:
        return np.diag(np.array(halves) ** 2)

    found = []
    joint, gear = mechanism.clearance.get(name), mechanism.gears.get(name)
    random = np.random.default_rng(0)
    for play, words in (
        (None if joint is None else joint.play(), "the joint's clearance"),
        (None if gear is None else TurnPlay(gear.unloaded_range / 2.0), f"its{GEAR}"),
    ):
        if play is not None and max(play.reach) > 0.0:
            states = _pushed(play, random, DRAWS)
            spread = states.T @ states / DRAWS
            # A clearance has been made smaller already.
            turns = isinstance(play, TurnPlay)
            factor = remaining.get("play", 1.0) if turns else 1.0
            chosen = turns or is_proportional(mechanism, name)
            found.append(
                Contribution(name, "play", play, none, 0.0, spread, move, words, factor, chosen)
            )
    shift, words, spread = _elastic(mechanism, name, sizes, load, about)
    found.append(Contribution(name, "elasticity", None, shift, spread, nothing, move, words))
    for key, part, word in (("encoder", 0.5, "resolution"), ("zero_offset", 1.0, "zero offset")):
        size, origin = sizes.of(name, key, slides)
        box, cov = BoxPlay(along(part * size)), variance(along(part * size)) / 3.0
        words = sizes.words({f"{word} {size:.4g} {unit}": origin})
        found.append(Contribution(name, "encoder", box, none, 0.0, cov, move, words))
    size, origin = sizes.of(name, "gear_error", slides)
    words = sizes.words({f"amplitude {size:.4g} {unit}": origin})
    own = sizes.given.joints.get(name)
    if gear is not None and gear.error_terms and (own is None or own.gear_error is None):
        size, words = sum(abs(amplitude) for _, amplitude, _ in gear.error_terms), "its gear"
    wave = SinePlay(along(size))
    found.append(
        Contribution(name, "gear error", wave, none, 0.0, variance(wave.amplitude) / 2.0, move,
                     words)
    )  # fmt: skip
    offset, offset_from = sizes.of(name, "axis_offset")
    tilt, tilt_from = sizes.of(name, "axis_tilt")
    words = sizes.words({f"offset {offset:.4g} m": offset_from, f"tilt {tilt:.4g} rad": tilt_from})
    halves = (offset, offset, offset, tilt, tilt, 0.0)
    found.append(
        Contribution(name, "geometry", BoxPlay(halves), none, 0.0, variance(halves) / 3.0, move,
                     words)
    )  # fmt: skip
    heating, heating_from = sizes.of(name, "heating")
    expansion, expansion_from = sizes.of(name, "expansion")
    grown = np.concatenate([0.5 * heating * expansion * arm, np.zeros((n, 3))], axis=1)
    words = sizes.words({
        f"up to {heating:g} K": heating_from, f"{1e6 * expansion:.3g} um/(m K)": expansion_from,
    })  # fmt: skip
    found.append(Contribution(name, "heat", None, grown, 1.0, nothing, move, words))
    return [
        one if one.cause == "play" else replace(one, factor=remaining.get(one.cause, 1.0))
        for one in found
        if one.set is not None or one.shift.any()
    ]


_TURNING = ("encoder", "zero_offset", "gear_error")
"""What robots and their classes have of joints that turn."""
_PINION = 0.01
"""Radius of the pinion by which a slider has what a class has of joints that turn [m]."""


@dataclass(frozen=True)
class _Sizes:
    """What is given of a robot, and what a class has where nothing is."""

    given: RobotErrors
    kind: str

    def of(self, joint: str, key: str, slides: bool = False) -> tuple[float, str]:
        """A number of a joint, and whether it is ``given`` or ``assumed``."""
        own = getattr(self.given.joints.get(joint), key, None)
        turns = slides and key in _TURNING
        if own is None and not turns:
            own = getattr(self.given, key)
        if own is not None:
            return float(own), "given"
        return getattr(ERROR_CLASSES[self.kind], key) * (_PINION if turns else 1.0), "assumed"

    def words(self, parts: Mapping[str, str], others: Sequence[str] = ()) -> str:
        """Where numbers come from, by their texts, those that are assumed first."""
        found = []
        for origin, head in (("assumed", f"class {self.kind!r}, assumed"), ("given", "given")):
            if any(own == origin for own in parts.values()):
                texts = [text for text, own in parts.items() if own == origin]
                found.append(f"{head}: {', '.join(texts)}")
        return "; ".join([*found, *others])


def _elastic(
    mechanism: Mechanism, name: str, sizes: _Sizes, load: np.ndarray, about: int
) -> tuple[np.ndarray, str, float]:
    """How a joint gives way under its loads (n, 6), by which stiffness, and its spread."""
    shift, words = np.zeros((len(load), 6)), []
    parts: dict[str, str] = {}
    joint, gear = mechanism.clearance.get(name), mechanism.gears.get(name)
    own = sizes.given.joints.get(name, JointErrors())
    carried = load.copy()
    carried[:, about] = 0.0
    if joint is not None and joint.springs is not None:
        shift += joint.springs.displacements(carried)
        words.append("its springs")
    elif isinstance(joint, RollingBearing):
        play = joint.play(second_order=False)
        for i, one in enumerate(carried):
            point = play.support(one[None]).point[0]
            shift[i] += joint.deflection(one[:3], one[3:]) - point
        words.append("its bearing")
    elif joint is not None:
        play = joint.play(second_order=False)
        point = play.support(carried).point
        pressed = play.pressed(carried, point)
        if pressed is not None:
            shift += compliance_shift(joint, pressed)
            words.append("its contacts")
    if own.elasticity is not None:
        shift += own.elasticity.displacements(carried)
        parts[own.elasticity.words] = "given"
    elif joint is None:
        stiffness, origin = sizes.of(name, "tilt_stiffness")
        shift[:, 3:5] += carried[:, 3:5] / stiffness
        parts[f"{stiffness:g} N m/rad in tilt"] = origin
    if own.torsional_stiffness is not None:
        shift[:, about] += load[:, about] / own.torsional_stiffness
        unit = "N m/rad in torsion" if about == 5 else "N/m along the axis"
        parts[f"{own.torsional_stiffness:g} {unit}"] = "given"
    elif gear is not None:
        torque = load[:, about]
        shift[:, about] += np.sign(torque) * gear.curve().depth(np.abs(torque))
        words.append("its gear")
    elif about == 5:
        stiffness, origin = sizes.of(name, "torsional_stiffness")
        shift[:, about] += load[:, about] / stiffness
        parts[f"{stiffness:g} N m/rad in torsion"] = origin
    spread, origin = sizes.of(name, "stiffness_spread")
    parts[f"either way {100 * spread:g} %"] = origin
    return shift, sizes.words(parts, words), spread
