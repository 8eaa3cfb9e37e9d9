"""The whole error of a tool: which joint, which cause, and what halving it would buy.

Beside play an arm gives way under its weight, its payload and a force; encoders have a resolution
and a zero, gears an error of their own; links and axes are not where the drawing has them, and all
of it grows with heat. Each of these displaces the body beyond a joint by a small twist. Twists that
can be anywhere in a set add as sets, so that a worst case is a sum of their support functions;
twists at random add by their variances; what loads displace is a shift that both share.

What is not given of a robot is taken from a class of robots (``data/error_classes.toml``), and said
to be assumed.
"""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError, MissingName, require_finite
from jointplay.core.schema import Described, quantity
from jointplay.core.tables import columns, csv_text
from jointplay.design.levers import (
    GEAR,
    TurnPlay,
    configurations,
    lever,
    place,
    tool_place,
)
from jointplay.design.rest import compliance_shift
from jointplay.design.static_budget import half_sphere
from jointplay.joints import Elasticity, RollingBearing
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


@cache
def error_classes() -> dict[str, dict[str, Any]]:
    """What ``data/error_classes.toml`` says, by name."""
    with (Path(__file__).parent / "data" / "error_classes.toml").open("rb") as file:
        return tomllib.load(file)


@dataclass(frozen=True, kw_only=True)
class JointErrors(Described):
    """Errors of one joint besides its play; None: those of the class.

    Raises:
        JointplayError: a value that is negative or not finite.
    """

    encoder: float | None = quantity("rad", "m", default=None, least=0.0, words="resolution")
    """Resolution of the encoder, at the joint [rad or m]."""
    zero_offset: float | None = quantity("rad", "m", default=None, least=0.0, words="zero offset")
    """How far the encoder's zero may be off, either way [rad or m]."""
    gear_error: float | None = quantity("rad", "m", default=None, least=0.0, words="gear error")
    """Amplitude of the gear's own error [rad or m]."""
    axis_offset: float | None = quantity("m", default=None, least=0.0, words="axis offset")
    """How far the axis may be off along each of x, y, z, either way [m]."""
    axis_tilt: float | None = quantity("rad", default=None, least=0.0, words="axis tilt")
    """How far it may lean about x and y, either way [rad]."""
    torsional_stiffness: float | None = quantity("N*m/rad", "N/m", default=None, above=0.0)
    """About (along) the axis, of gear, shaft and drive [N m/rad or N/m]; a gear's own counts."""
    elasticity: Elasticity | None = None
    """Of housings and links at the joint, besides its bearing's; None: a tilt stiffness of the
    class, where the joint has no bearing of its own."""


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

    @cached_property
    def worst(self) -> np.ndarray:
        """Largest distance of the tool from where it should be, (n,) [m]."""
        return self._worst(self.contributions)[0]

    @cached_property
    def direction(self) -> np.ndarray:
        """Where to, unit vectors, (n, 3)."""
        return self._worst(self.contributions)[1]

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

    def halved(self, index: int) -> tuple[float, float]:
        """By how much `worst` and `rms` fall at the worst pose by half of one contribution [m]."""
        at = self.worst_pose
        own = self.contributions
        other = [replace(one, factor=0.5) if i == index else one for i, one in enumerate(own)]
        rest = ErrorBudget(tuple(_at(one, at) for one in other), self.q[at : at + 1],
                           self.mechanism, self.force, ())  # fmt: skip
        found = rest._worst(rest.contributions, self.direction[at : at + 1])[0][0]
        return float(self.worst[at] - found), float(self.rms[at] - rest.rms[0])

    def csv(self) -> str:
        """A row for each contribution at the worst pose [m]."""
        at = self.worst_pose
        means = [f"mean_{axis}_m" for axis in "xyz"]
        rows: list[list] = [["joint", "cause", "worst_m", "rms_m", *means, "origin"]]
        for i, one in enumerate(self.contributions):
            mean = one.mean()[at]
            own = _rms(mean[None], one.variance()[at][None])[0]
            rows.append([one.joint, one.cause, self.parts[i, at], own, *mean, one.origin])
        return csv_text(rows, 9)

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

    def _worst(
        self, contributions: Sequence[Contribution], start: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Worst distances and their directions."""
        n = len(self.q)
        if start is None:
            half = half_sphere(_DIRECTIONS)
            sphere = np.vstack([half, -half])
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
        return self._displaced([_at(one, at).draw(random, count) for one in self.contributions])

    @property
    def reached(self) -> float:
        """Distance by the exact kinematics where all twists are those of `worst` [m]."""
        at = self.worst_pose
        twists = [_at(one, at).twist(self.direction[at]) for one in self.contributions]
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

    def table(self) -> str:
        """At the worst pose: each joint and cause, shares, and what halving buys [mm]."""
        at = self.worst_pose
        head = ("joint", "cause", "worst case [mm]", "share", "rms [mm]", "halved: worst, rms [mm]")
        rows: list[tuple[str, ...]] = [head]
        order = np.argsort(-self.parts[:, at])
        for i in order:
            one = self.contributions[i]
            if self.parts[i, at] <= _LISTED * self.worst[at]:
                continue
            own = _rms(one.mean()[at][None], one.variance()[at][None])[0]
            gain, less = self.halved(int(i))
            rows.append((
                one.joint, one.cause, f"{1e3 * self.parts[i, at]:.4f}",
                f"{100 * self.parts[i, at] / self.worst[at]:.1f}%", f"{1e3 * own:.4f}",
                f"-{1e3 * gain:.4f}, -{1e3 * less:.4f}",
            ))  # fmt: skip
        small = self.parts[:, at] <= _LISTED * self.worst[at]
        if small.any():
            rest = 1e3 * float(self.parts[small, at].sum())
            rows.append((f"{int(small.sum())} more", "", f"{rest:.4f}", "", "", ""))
        rows.append(
            ("all", "", f"{1e3 * self.worst[at]:.4f}", "100%", f"{1e3 * self.rms[at]:.4f}", "")
        )
        lines = columns(rows)
        shares = ", ".join(
            f"{cause} {100 * worst / self.worst[at]:.0f} % (variance {100 * share:.0f} %)"
            for cause, (worst, share) in self.by("cause").items()
        )
        mean = ", ".join(f"{1e3 * x:.4f}" for x in self.mean[at])
        lines.append(f"by cause: {shares}")
        lines.append(f"loads and heat displace the tool by {mean} mm along x, y, z in any case")
        off = self.reached / self.worst[at] - 1.0
        fits = "" if abs(off) < _FITS else ": too far for levers; is the class right?"
        lines.append(
            f"by the exact kinematics the worst case is {1e3 * self.reached:.4f} mm "
            f"({100 * off:+.2f} %{fits})"
        )
        lines += [f"assumed: {line}" for line in self.assumed]
        return "\n".join(lines)


def _at(one: Contribution, pose: int) -> Contribution:
    some = slice(pose, pose + 1)
    return replace(one, shift=one.shift[some], move=one.move[some])


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
    errors: Mapping[str, JointErrors] | None = None,
    kind: str = "industrial",
    causes: Collection[str] = CAUSES,
) -> ErrorBudget:
    """The whole error of the tool, by joint and by cause.

    Args:
        mechanism: a tree, with or without play.
        poses: joint positions by name [rad or m], the rest zero; or configurations, (n, nq).
        force: on the tool, besides gravity, world axes [N].
        errors: what is known of joints.
        kind: class of robots from which all else is taken: one of `error_classes`.
        causes: those that count, of `CAUSES`.

    Raises:
        JointplayError: loops; a force that is no vector.
        MissingName: no such joint, class or cause.
    """
    if mechanism.loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: a whole error budget is for robots without "
            "closed loops; budget() has the play of those with loops"
        )
    for cause in causes:
        if cause not in CAUSES:
            raise MissingName("cause of errors", cause, CAUSES)
    known, given = error_classes(), dict(errors or {})
    if kind not in known:
        raise MissingName("class of errors", kind, known)
    for name in given:
        if name not in mechanism.joints:
            raise MissingName("joint", name, mechanism.joints)
    assumed = known[kind]
    q = configurations(mechanism, poses)
    push = np.array([require_finite("force on the tool", one, "N") for one in force])
    if push.shape != (3,):
        raise JointplayError(f"the force on the tool must have three components, got {force!r}")
    moves, loads, arms = _levers(mechanism, q, push)
    found: list[Contribution] = []
    for name in mechanism.joints:
        if not moves[name].any():
            continue
        own = given.get(name, JointErrors())
        at = moves[name], loads[name], arms[name]
        found += _of_joint(mechanism, name, own, assumed, kind, *at)
    for name in mechanism.mounts:
        if moves[name].any():
            given_way = mechanism.clearance[name].springs.displacements(loads[name])
            spread = float(assumed["stiffness_spread"])
            found.append(Contribution(name, "elasticity", None, given_way, spread,
                                      np.zeros((6, 6)), moves[name], "its springs"))  # fmt: skip
    kept = tuple(one for one in found if one.cause in causes)
    if not kept:
        raise JointplayError("nothing moves the tool, or no cause is counted")
    lines = dict.fromkeys(
        f"{one.cause}: {one.origin}" for one in kept if one.origin.startswith("class")
    )
    return ErrorBudget(kept, q, mechanism, push, tuple(lines))


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
    own: JointErrors,
    assumed: Mapping[str, Any],
    kind: str,
    move: np.ndarray,
    load: np.ndarray,
    arm: np.ndarray,
) -> list[Contribution]:
    """All contributions of a joint."""
    n = len(move)
    slides = mechanism.description.joints[name].slides
    about = 2 if slides else 5
    none, nothing = np.zeros((n, 6)), np.zeros((6, 6))
    origins = {one.name: f"class {kind!r}, assumed" for one in fields(own)}
    origins |= {one.name: "given" for one in fields(own) if getattr(own, one.name) is not None}

    def value(key: str) -> float:
        given = getattr(own, key)
        if given is not None:
            return float(given)
        # Classes have angles; a slider's resolution is that of a pinion of 10 mm.
        return float(assumed[key]) * (0.01 if slides and key in _AXIAL else 1.0)

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
            found.append(Contribution(name, "play", play, none, 0.0, spread, move, words))
    shift, words = _elastic(mechanism, name, own, assumed, kind, load, about)
    found.append(
        Contribution(name, "elasticity", None, shift, float(assumed["stiffness_spread"]), nothing,
                     move, words)
    )  # fmt: skip
    for key, part in (("encoder", 0.5), ("zero_offset", 1.0)):
        size = along(part * value(key))
        box, cov = BoxPlay(size), variance(size) / 3.0
        found.append(Contribution(name, "encoder", box, none, 0.0, cov, move, origins[key]))
    wave = SinePlay(along(value("gear_error")))
    if gear is not None and gear.error_terms and own.gear_error is None:
        wave = SinePlay(along(sum(abs(amplitude) for _, amplitude, _ in gear.error_terms)))
        origins["gear_error"] = "its gear"
    found.append(
        Contribution(name, "gear error", wave, none, 0.0, variance(wave.amplitude) / 2.0, move,
                     origins["gear_error"])
    )  # fmt: skip
    offset, tilt = value("axis_offset"), value("axis_tilt")
    halves = (offset, offset, offset, tilt, tilt, 0.0)
    found.append(
        Contribution(name, "geometry", BoxPlay(halves), none, 0.0, variance(halves) / 3.0, move,
                     origins["axis_offset"])
    )  # fmt: skip
    growth = 0.5 * float(assumed["heating"]) * float(assumed["expansion"])
    grown = np.concatenate([growth * arm, np.zeros((n, 3))], axis=1)
    found.append(
        Contribution(name, "heat", None, grown, 1.0, nothing, move,
                     f"class {kind!r}, assumed: up to {assumed['heating']:g} K, "
                     f"{1e6 * assumed['expansion']:.3g} um/(m K)")
    )  # fmt: skip
    return [one for one in found if one.set is not None or one.shift.any()]


_AXIAL = ("encoder", "zero_offset", "gear_error")


def _elastic(
    mechanism: Mechanism,
    name: str,
    own: JointErrors,
    assumed: Mapping[str, Any],
    kind: str,
    load: np.ndarray,
    about: int,
) -> tuple[np.ndarray, str]:
    """How a joint gives way under its loads (n, 6), and by which stiffness."""
    shift, words = np.zeros((len(load), 6)), []
    joint, gear = mechanism.clearance.get(name), mechanism.gears.get(name)
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
        words.append("given")
    elif joint is None:
        shift[:, 3:5] += carried[:, 3:5] / float(assumed["tilt_stiffness"])
        words.append(f"class {kind!r}, assumed: {assumed['tilt_stiffness']:g} N m/rad in tilt")
    if own.torsional_stiffness is None and gear is not None:
        torque = load[:, about]
        shift[:, about] += np.sign(torque) * gear.curve().depth(np.abs(torque))
        words.append("its gear")
    elif own.torsional_stiffness is not None:
        shift[:, about] += load[:, about] / own.torsional_stiffness
        words.append("given")
    elif about == 5:
        stiffness = float(assumed["torsional_stiffness"])
        shift[:, about] += load[:, about] / stiffness
        words.append(f"class {kind!r}, assumed: {stiffness:g} N m/rad in torsion")
    words.sort(key=lambda text: not text.startswith("class"))
    return shift, "; ".join(dict.fromkeys(words))
