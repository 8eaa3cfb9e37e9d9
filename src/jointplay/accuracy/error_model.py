"""The tool's error as a sum of contributions, each a set of small displacements at a joint.

What play, an encoder or a tolerance does to the child's body against its parent's is a displacement
xi = (c, phi), the centre's way c [m] and a rotation vector phi [rad] in the joint's axes, that may
be anywhere in a convex set. The Jacobian J of the joint makes it the tool's error J xi. What a load
(F, M) can reach in the set is its support function

    h(F, M) = max (F . c + M . phi)

Sums of sets have the sum of the support functions, so the worst case along a direction d is a sum
over the contributions, of h(J^T d). Displacements at random add by their variances. What loads and
heat displace is a shift, of which a part is uncertain.

In a closed loop the displacements of several joints may hold each other (`loop_play`).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from jointplay.accuracy import jacobians, loop_play
from jointplay.base.errors import JointplayError, NothingHasPlay, require_whole
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints.fits import Fit
from jointplay.physics.joints.play import DRAWS, Cone, Cones, JournalPlay, Play, Support
from jointplay.simulation.loads import Load

DIRECTIONS = 180
"""Directions over half a sphere among which the worst one is sought, before it is refined."""
_DIRECTIONS_SHIFTED = 400
"""The same where loads or heat shift the tool: then nearly as bad ones lie far apart."""
_REFINEMENTS = 12
"""Most steps by which a worst direction is refined: each can only make it worse (judged)."""
_SETTLED = 1e-12
"""Change of a unit vector that is rounding."""
_ROUNDING = 1e-10
"""Part of a matrix's largest eigenvalue that is rounding of the products it is made of."""
_FITS = 1e-9
"""Part of what the plays could open that may stay open: rounding, far below any play (judged)."""
_AT_ONCE = 200_000
"""Loads on joints that are looked at together, which fit into a processor's cache."""


@dataclass(frozen=True)
class Line(Play):
    """A displacement either way along and about a line, such as a gear's backlash."""

    amplitude: tuple[float, ...]
    """Along and about x, y, z, six [m, rad]."""
    wave: bool = False
    """Whether it goes up and down with a phase that nobody knows; else it is at either end."""

    @property
    def reach(self) -> tuple[float, float]:
        return math.hypot(*self.amplitude[:3]), math.hypot(*self.amplitude[3:])

    @property
    def cones(self) -> Cones:
        return Cones(np.array(self.amplitude)[:, None], (Cone(np.eye(1), np.zeros(1), 1.0),))

    def support(self, loads: np.ndarray) -> Support:
        along = np.asarray(loads, float).reshape(-1, 6) @ self.amplitude
        return Support(np.abs(along), np.sign(along)[:, None] * np.array(self.amplitude))

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        part = np.sin(random.uniform(0.0, 2.0 * np.pi, count))
        part = part if self.wave else np.sign(part)
        return np.asarray(part[:, None] * np.array(self.amplitude))

    @property
    def covariance(self) -> np.ndarray:
        """That of a sine is half of its amplitude's square."""
        return (0.5 if self.wave else 1.0) * np.outer(self.amplitude, self.amplitude)


@dataclass(frozen=True)
class Box(Play):
    """Displacements and rotations between bounds, each independent of the others."""

    half: tuple[float, ...]
    """Along and about x, y, z, either way, six [m, rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        return math.hypot(*self.half[:3]), math.hypot(*self.half[3:])

    @property
    def cones(self) -> Cones:
        axes = np.diag(self.half)[:, np.array(self.half) > 0.0]
        rows = np.eye(axes.shape[1])
        return Cones(axes, tuple(Cone(row[None], np.zeros(len(rows)), 1.0) for row in rows))

    def support(self, loads: np.ndarray) -> Support:
        loads = np.asarray(loads, float).reshape(-1, 6)
        return Support(np.abs(loads) @ self.half, np.array(self.half) * np.sign(loads))

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return random.uniform(-1.0, 1.0, (count, 6)) * self.half

    @property
    def covariance(self) -> np.ndarray:
        """A third of each half's square."""
        return np.diag(np.array(self.half) ** 2) / 3.0


@dataclass(frozen=True)
class Tilt(Play):
    """A tilt of the axis alone, in a disc: what reduced models know of a journal's play."""

    size: float
    """Either way [rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        return 0.0, self.size

    def support(self, loads: np.ndarray) -> Support:
        moment = np.asarray(loads, float).reshape(-1, 6)[:, 3:5]
        point = np.zeros((len(moment), 6))
        point[:, 3:5] = self.size * toward(moment, np.zeros_like(moment))
        return Support(self.size * np.linalg.norm(moment, axis=1), point)


@dataclass(frozen=True)
class Contribution:
    """What one cause does at one joint: anywhere in a set, and a shift in any case."""

    joint: str
    cause: str
    """Name of the cause: sums, parts and prices are told by it."""
    set: Play | None = None
    """Where the displacement may be; None: only where `shift` says."""
    shift: np.ndarray | None = None
    """Displacement in any case at n poses, shape (n, 6) [m, rad]; None: none."""
    spread: float = 0.0
    """Relative uncertainty of `shift`, either way."""
    origin: str = ""
    """What its numbers are those of, in words, such as ``its gear``."""
    numbers: tuple[tuple[str, str], ...] = ()
    """Numbers in words, and whether each is ``given``, of a ``class`` or by a ``rule``."""
    proportional: bool = True
    """Whether it is proportional to a size that can be chosen; the play of a rolling bearing or of
    a fit is not."""
    middle: Play | None = None
    """`set` in the middle of the fit's tolerances, where `set` is with the loosest parts."""
    fit: Fit | None = None
    part: str = ""
    """Which part of the joint it is, if not the joint itself: `GEAR`, or `LINK`, whose first
    component is by how much it grows, relatively."""

    @property
    def name(self) -> str:
        return self.joint + self.part

    @property
    def by_origin(self) -> dict[str, str]:
        """What of `numbers` is of each origin."""
        grouped: dict[str, list[str]] = {}
        for text, origin in self.numbers:
            grouped.setdefault(origin, []).append(text)
        return {origin: ", ".join(texts) for origin, texts in grouped.items()}

    @property
    def source(self) -> str:
        """Where all its numbers are from, in words."""
        parts = [f"{origin}: {texts}" for origin, texts in self.by_origin.items()]
        return "; ".join([*parts, *filter(None, [self.origin])])

    @property
    def gear(self) -> bool:
        return self.part == jacobians.GEAR

    @property
    def looseness(self) -> float:
        """Standard deviation from `middle`, as a part of what `set` differs from it."""
        return self.fit.deviation / (self.fit.most - self.fit.middle) if self.fit else 0.0

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Displacements of `set` at random, shape (count, 6), of a fit with parts at random."""
        if self.set is None:
            return np.zeros((count, 6))
        if self.fit is None or self.middle is None:
            return self.set.draw(random, count)
        middle, loose = self.middle.draw(copy.deepcopy(random), count), self.set.draw(random, count)
        sizes = self.fit.quantile(random.uniform(size=count))
        part = (sizes - self.fit.middle) / (self.fit.most - self.fit.middle)
        return np.asarray(middle + part[:, None] * (loose - middle))

    @cached_property
    def covariance(self) -> np.ndarray:
        """Of `draw`, about zero, shape (6, 6)."""
        if self.set is None:
            return np.zeros((6, 6))
        if self.middle is None:
            return self.set.covariance
        states = self.draw(np.random.default_rng(0), DRAWS)
        return np.asarray(states.T @ states / DRAWS)


class States(NamedTuple):
    """Farthest states of k contributions at n poses along m directions."""

    value: np.ndarray
    """By contribution, their sum being a bound, shape (k, n, m) [m or rad]."""
    point: np.ndarray
    """Displacements of the joints, which attain it, shape (k, n, m, 6)."""
    error: np.ndarray
    """The tool's error there, by contribution, shape (k, n, m, 6)."""


class Farthest(NamedTuple):
    """How far the tool can be off at n poses."""

    size: np.ndarray
    """Shape (n,) [m or rad]."""
    direction: np.ndarray
    """Where to, unit vectors in world axes, shape (n, 3)."""
    parts: np.ndarray
    """What each contribution adds, shape (k, n)."""


@dataclass(frozen=True)
class ErrorModel:
    """The error of a tool at n poses: k contributions, and what each does to the tool."""

    contributions: tuple[Contribution, ...]
    jacobian: np.ndarray
    """The tool's displacement and rotation in world axes per the joint's own, (k, n, 6, 6)."""
    load: np.ndarray
    """Gravity and the tool's load on the joint, about its centre, its axes, (k, n, 6) [N, N m]."""
    tie: np.ndarray
    """By how much each displacement opens loops that nothing else can close, (k, n, r, 6), zero in
    sum over all contributions; r is zero if no loops hold them. See `loop_play`."""
    scale: np.ndarray
    """What each contribution is multiplied by, (k,)."""

    @classmethod
    def of(
        cls,
        contributions: Sequence[Contribution],
        joints: Sequence[str],
        effects: jacobians.Jacobians,
        scale: Sequence[float] | None = None,
    ) -> ErrorModel:
        at = [list(joints).index(c.joint) for c in contributions]
        move, tie = effects.tool[at], effects.tie[at]
        for i, (k, contribution) in enumerate(zip(at, contributions, strict=True)):
            if contribution.part == jacobians.LINK:
                move[i], tie[i] = 0.0, 0.0
                move[i, :, :, 0], tie[i, :, :, 0] = effects.growth[k], effects.growth_tie[k]
        for rows, c in zip(tie, contributions, strict=True):
            if c.shift is None:
                continue
            opened = np.abs(np.einsum("nri,ni->nr", rows, c.shift)).max(initial=0.0)
            if opened > jacobians.FELT * np.abs(c.shift).max():
                raise JointplayError(
                    f"{c.cause} of {c.joint!r} is statically indeterminate: joints of closed loops "
                    "hold each other against it; leave this cause out, or give the loops joints "
                    "that do not (kind 'planar', balls)"
                )
        holds = any(
            np.abs(rows @ c.set.cones.spread).max(initial=0.0) > jacobians.FELT * max(c.set.reach)
            for rows, c in zip(tie, contributions, strict=True)
            if tie.shape[2] and c.set is not None
        )
        factor = np.ones(len(at)) if scale is None else np.array(scale, float)
        tie = tie if holds else tie[:, :, :0]
        return cls(tuple(contributions), move, effects.load[at], tie, factor)

    @classmethod
    def join(cls, models: Sequence[ErrorModel]) -> ErrorModel:
        if len(models) == 1:
            return models[0]
        contributions = tuple(c for model in models for c in model.contributions)
        names = ("jacobian", "load", "tie", "scale")
        arrays = (np.concatenate([getattr(m, name) for m in models]) for name in names)
        return cls(contributions, *arrays)

    @property
    def poses(self) -> int:
        return self.jacobian.shape[1]

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(c.name for c in self.contributions)

    @property
    def plays(self) -> tuple[Play, ...]:
        return tuple(c.set for c in self.contributions if c.set is not None)

    @property
    def tied(self) -> bool:
        """Whether contributions hold each other."""
        return self.tie.shape[2] > 0

    @property
    def middle(self) -> ErrorModel:
        """With fits in the middle of their tolerances."""
        centred = (c if c.middle is None else replace(c, set=c.middle) for c in self.contributions)
        return replace(self, contributions=tuple(centred))

    @property
    def turning(self) -> ErrorModel:
        """With the tool's rotation for its displacement, and the other way round."""
        swapped = self.jacobian[:, :, 3:], self.jacobian[:, :, :3]
        return replace(self, jacobian=np.concatenate(swapped, axis=2))

    def scaled(self, scale: np.ndarray) -> ErrorModel:
        """With contributions so many times as large, (k,)."""
        return replace(self, scale=scale)

    def subset(self, contributions: Any = slice(None), poses: Any = slice(None)) -> ErrorModel:
        at = np.arange(len(self.contributions))[contributions]
        some = tuple(
            c if c.shift is None else replace(c, shift=c.shift[poses])
            for c in (self.contributions[i] for i in at)
        )
        jacobian, load, tie = (
            array[at][:, poses] for array in (self.jacobian, self.load, self.tie)
        )
        return ErrorModel(some, jacobian, load, tie, self.scale[at])

    # Sets: worst cases.

    def along(self, directions: np.ndarray, turn: bool = False) -> States:
        """Farthest displacements (rotations) of the tool along directions (n, m, 3), world axes."""
        return self._states(self._pulls(directions, turn))

    def _pulls(self, directions: np.ndarray, turn: bool) -> np.ndarray:
        """What unit forces (moments) along directions (n, m, 3) do at the joints, (k, n, m, 6)."""
        rows = self.jacobian[:, :, 3:] if turn else self.jacobian[:, :, :3]
        return np.einsum("nmk,jnki->jnmi", directions, rows)

    def at_rest(self) -> States:
        """Where gravity and the tool's load put the journals, without friction; m is one."""
        return self._states(self.load[:, :, None])

    @cached_property
    def sphere(self) -> np.ndarray:
        """Directions among which the worst one is sought, (m, 3)."""
        if all(c.shift is None for c in self.contributions):
            return half_sphere()  # the other half has the same
        half = half_sphere(_DIRECTIONS_SHIFTED)
        return np.vstack([half, -half])

    def values(self, directions: np.ndarray, turn: bool = False) -> np.ndarray:
        """How far each goes along directions (m, 3) at all poses, (k, n, m) [m or rad]."""
        batch = max(_AT_ONCE // (len(self.contributions) * len(directions)), 1)
        parts = [np.zeros((len(self.contributions), 0, len(directions)))]
        for first in range(0, self.poses, batch):
            some = self.subset(poses=slice(first, first + batch))
            everywhere = np.broadcast_to(directions, (some.poses, *directions.shape))
            parts.append(some._reached(some._pulls(everywhere, turn))[0])
        return np.concatenate(parts, axis=1)

    def farthest(self, turn: bool = False, start: np.ndarray | None = None) -> Farthest:
        """Largest displacement (rotation) of the tool, sought from `start` (n, 3) or `sphere`."""
        if start is None:
            start = self.sphere[self.values(self.sphere, turn).sum(axis=0).argmax(axis=1)]
        d = self.climb(start, turn)
        parts = self.along(d[:, None], turn).value[:, :, 0]
        return Farthest(parts.sum(axis=0), d, parts)

    @cached_property
    def turned(self) -> Farthest:
        """Largest rotation of the tool."""
        return self.farthest(turn=True)

    def climb(self, d: np.ndarray, turn: bool = False) -> np.ndarray:
        """Directions (n, 3) in which the tool gets no less far than along directions `d`.

        In each step d is replaced by the direction of the point that is farthest along d.
        """
        rows = slice(3, 6) if turn else slice(0, 3)
        for _ in range(_REFINEMENTS):
            before = d
            d = toward(self.along(d[:, None], turn).error.sum(axis=0)[:, 0, rows], d)
            if np.abs(d - before).max(initial=0.0) < _SETTLED:
                break
        return d

    @cached_property
    def alone(self) -> np.ndarray:
        """Largest distance of the tool by each contribution alone, shape (k, n) [m]."""
        sizes = [self.subset([k]).farthest().size for k in range(len(self.contributions))]
        return np.array(sizes)

    def _states(self, loads: np.ndarray) -> States:
        """States farthest along loads (k, n, m, 6) of any unit."""
        value, point = self._reached(loads)
        error = np.einsum("jnik,jnmk->jnmi", self.jacobian, point)
        if self.tied:
            self._check_ends(point, error)
        return States(value, point, error)

    def _reached(self, loads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Values (k, n, m) and points (k, n, m, 6) farthest along loads (k, n, m, 6)."""
        k, n, m, _ = loads.shape
        flat = loads.reshape(k, n * m, 6)
        value, point = np.zeros(flat.shape[:2]), np.zeros(flat.shape)
        sets = [c.set for c in self.contributions]
        if self.tied:
            sets = [None if play is None else loop_play.ended(play) for play in sets]
        for play in dict.fromkeys(sets):  # alike ones together: many at once cost little more
            if play is None:
                continue
            alike = [number for number, item in enumerate(sets) if item == play]
            reached = play.support(flat[alike].reshape(-1, 6))
            value[alike] = reached.value.reshape(len(alike), -1)
            point[alike] = reached.point.reshape(len(alike), -1, 6)
        for number, contribution in enumerate(self.contributions):
            if contribution.shift is not None:
                shift = np.repeat(contribution.shift, m, axis=0)
                along = (flat[number] * shift).sum(axis=1)
                value[number] += along + contribution.spread * np.abs(along)
                point[number] += shift * (1.0 + contribution.spread * np.sign(along))[:, None]
        factor = self.scale[:, None]
        value, point = factor * value, factor[:, :, None] * point
        if self.tied:
            self._tie(flat, value, point, m)
        return value.reshape(k, n, m), point.reshape(k, n, m, 6)

    def _tie(self, flat: np.ndarray, value: np.ndarray, point: np.ndarray, m: int) -> None:
        """Put right, in place, what loops forbid of values (k, n m) and points along loads."""
        all_plays = [loop_play.ended(c.set) if c.set else None for c in self.contributions]
        sets = [k for k, play in enumerate(all_plays) if play is not None and max(play.reach) > 0.0]
        plays = [play for play in all_plays if play is not None and max(play.reach) > 0.0]
        factor = self.scale[sets, None, None]
        ties = np.repeat(factor[..., None] * self.tie[sets], m, axis=1)
        opened = np.abs(np.einsum("jnri,jni->nr", ties, point[sets] / factor)).max(axis=1)
        able = sum(loop_play.opening(*pair) for pair in zip(plays, ties, strict=True))
        (some,) = np.nonzero(opened > _FITS * able)
        if len(some):
            loads, at = (factor * flat[sets])[:, some], np.ix_(np.array(sets), some)
            value[at], inner = loop_play.farthest(plays, loads, ties[:, some])
            point[at] = factor * inner

    def _check_ends(self, point: np.ndarray, error: np.ndarray) -> None:
        """Refuse a journal without end walls at an end that it has not, if the tool feels it."""
        for contribution, at, errors in zip(self.contributions, point, error, strict=True):
            play = contribution.set
            if not isinstance(play, JournalPlay) or not math.isinf(play.along):
                continue
            far = np.abs(at[..., 2]) > 0.5 * loop_play.FAR * play.across
            if (far & (np.abs(errors[..., :3]).max(axis=-1) > play.across)).any():
                raise JointplayError(
                    f"nothing limits the journal of {contribution.name!r} along its axis, and the "
                    "tool feels it: give the joint end walls (an axial clearance), or lock_axial"
                )

    # Means and variances.

    @cached_property
    def means(self) -> np.ndarray:
        """The tool's displacement by each contribution in any case, (k, n, 3) [m]."""
        displacement = np.zeros((len(self.contributions), self.poses, 3))
        for k, contribution in enumerate(self.contributions):
            if contribution.shift is not None:
                rows = self.jacobian[k, :, :3]
                displacement[k] = np.einsum("nik,nk->ni", rows, contribution.shift)
        return self.scale[:, None, None] * displacement

    @cached_property
    def _own_covariances(self) -> np.ndarray:
        """Of the joints' displacements in their sets, (k, 6, 6)."""
        covariances_ = np.array([c.covariance for c in self.contributions])
        return self.scale[:, None, None] ** 2 * covariances_

    @cached_property
    def _yielding(self) -> np.ndarray:
        """By how much displacements give way to what ties are opened by at random, (k, n, 6, r).

        As the variances allow: so each joint's has the variance that it has, given that loops are
        closed.
        """
        crossed = self._own_covariances[:, None] @ self.tie.transpose(0, 1, 3, 2)
        opened = np.linalg.pinv((self.tie @ crossed).sum(axis=0), rcond=_ROUNDING, hermitian=True)
        return np.asarray(crossed @ opened)

    @cached_property
    def covariances(self) -> np.ndarray:
        """Covariance of the tool's displacement by each contribution, (k, n, 3, 3) [m^2].

        Of those that hold each other, of each and all together, which makes a sum, too.
        """
        rows = self.jacobian[:, :, :3]
        joint = self._own_covariances
        covariance = np.einsum("jnik,jkl,jnml->jnim", rows, joint, rows)
        if self.tied:
            opened = (self.tie @ joint[:, None] @ rows.transpose(0, 1, 3, 2)).sum(axis=0)
            less = rows @ self._yielding @ opened
            covariance = covariance - 0.5 * (less + less.transpose(0, 1, 3, 2))
        spread = np.array([c.spread for c in self.contributions]) / np.sqrt(3.0)
        shift = spread[:, None, None] * self.means
        return np.asarray(covariance + shift[..., :, None] * shift[..., None, :])

    @property
    def rms(self) -> np.ndarray:
        """Root mean square distance of the tool, (n,) [m]."""
        mean, covariance = self.means.sum(axis=0), self.covariances.sum(axis=0)
        square = (mean**2).sum(axis=1) + np.trace(covariance, axis1=1, axis2=2)
        return np.asarray(np.sqrt(square))

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Displacements at random at the first pose, as the variances suppose, (count, k, 6)."""
        sets = np.zeros((count, len(self.contributions), 6))
        shifts = np.zeros_like(sets)
        for k, contribution in enumerate(self.contributions):
            if contribution.shift is not None:
                part = 1.0 + contribution.spread * random.uniform(-1.0, 1.0, count)
                shifts[:, k] = self.scale[k] * part[:, None] * contribution.shift[0]
            sets[:, k] = self.scale[k] * contribution.draw(random, count)
        if self.tied:
            opened = np.einsum("kri,mki->mr", self.tie[:, 0], sets)
            sets -= np.einsum("kir,mr->mki", self._yielding[:, 0], opened)
        return sets + shifts


def toward(points: np.ndarray, otherwise: np.ndarray) -> np.ndarray:
    """Unit vectors along points (..., k); those of `otherwise` where these are zero."""
    size = np.linalg.norm(points, axis=-1, keepdims=True)
    return np.where(size > 0.0, points / np.where(size > 0.0, size, 1.0), otherwise)


def half_sphere(count: int = DIRECTIONS, full: bool = False) -> np.ndarray:
    """Directions evenly over half a sphere or the whole one (Fibonacci lattice), (count, 3)."""
    i = np.arange(require_whole("count", count, 1))
    z = 1.0 - (1 + full) * (i + 0.5) / count
    r, phi = np.sqrt(1.0 - z * z), (i + 0.5 * full) * np.pi * (3.0 - np.sqrt(5.0))
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def covering() -> float:
    """Largest angle between any direction and the nearest of `half_sphere` or its mirror [rad]."""
    fine = half_sphere(20 * DIRECTIONS)
    return float(np.arccos(np.abs(fine @ half_sphere().T).max(axis=1).min()))


def play_model(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    *,
    loads: Mapping[str, Load] | None = None,
    second_order: bool = True,
    driven: Sequence[str] | None = None,
    loops: bool = False,
    relative_to: str | None = None,
) -> ErrorModel:
    """The error by play alone, of joints with clearance and then of gears; arguments of `budget`.

    With `loops` mechanisms with loops are taken, too, whose plays may be tied to each other.
    """
    if relative_to is not None:
        jacobians.check_body(mechanism, relative_to)
    if mechanism.loops and not loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: this works only for robots without closed "
            "loops; jointplay budget, allocate and run accept them"
        )
    if not mechanism.clearance and not mechanism.gears:
        raise NothingHasPlay([*mechanism.joints, *mechanism.loops])
    q = jacobians.configurations(mechanism, poses, driven)
    for name in {name + jacobians.GEAR for name in mechanism.gears} & set(mechanism.clearance):
        raise JointplayError(f"the joint {name!r} has the same name as the gear of another joint")
    contributions = [play_of_joint(mechanism, name, second_order) for name in mechanism.clearance]
    contributions += [play_of_gear(mechanism, name) for name in mechanism.gears]
    joints = list(dict.fromkeys([*mechanism.clearance, *mechanism.gears]))
    effects = jacobians.jacobians(mechanism, q, joints, loads or {}, driven, relative_to)
    return ErrorModel.of(contributions, joints, effects)


def play_of_joint(mechanism: Mechanism, name: str, second_order: bool = True) -> Contribution:
    """What the clearance of a joint lets it do."""
    joint = mechanism.clearance[name]
    middle_, origin, fit = joint.play(second_order), "the joint's clearance", joint.fitted
    if fit is not None:
        loose = joint.at_clearance(fit.most).play(second_order)
        origin = f"its fit {fit}, {fit.range}"
        return Contribution(
            name, "play", loose, origin=origin, proportional=False, middle=middle_, fit=fit
        )
    proportional = bool(joint.clearances) and joint.resultant is None
    return Contribution(name, "play", middle_, origin=origin, proportional=proportional)


def play_of_gear(mechanism: Mechanism, name: str) -> Contribution:
    """The backlash and hysteresis of a gear: the joint moves by its axis, the motor stands."""
    half, axis = (
        mechanism.gears[name].unloaded_range / 2.0,
        mechanism.description.joints[name].component,
    )
    backlash = Line(tuple(half if k == axis else 0.0 for k in range(6)))
    return Contribution(name, "play", backlash, origin=f"its{jacobians.GEAR}", part=jacobians.GEAR)
