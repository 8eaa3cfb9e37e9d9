"""The tool's error as a sum of contributions, each a set of small displacements at a joint.

Play, an encoder's step or a tolerance lets the child's body be displaced against its parent's by
xi = (c, phi), the displacement c [m] of the joint's centre and a rotation vector phi [rad], both in
the joint's axes, anywhere in a convex set. The joint's Jacobian J turns that into the tool's error
J xi. How far a load (F, M) can push within the set is the set's support function

    h(F, M) = max (F . c + M . phi)

A sum of sets has the sum of their support functions, so the worst case along a direction d is the
sum of h(J^T d) over the contributions. Random displacements add by their variances. Loads and heat
do not open a set but shift it, by an amount known up to a relative uncertainty.

In a closed loop the displacements of several joints may constrain each other (`loop_play`).
"""

from __future__ import annotations

import copy
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from jointplay.accuracy import jacobians, loop_play
from jointplay.base.errors import JointplayError, NothingHasPlay, require_whole
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints.fits import Fit
from jointplay.physics.joints.play import DRAWS, FAR, Cone, Cones, JournalPlay, Play, Support
from jointplay.simulation.loads import Load

DIRECTIONS = 180
"""Directions over half a sphere among which the worst one is sought, before it is refined."""
_DIRECTIONS_SHIFTED = 400
"""Directions over half a sphere where loads or heat shift the tool: the set is then no longer
symmetric, and directions that are nearly as bad lie far apart."""
_REFINEMENTS = 12
"""Most steps that refine a worst direction; none can lose distance (judged)."""
_SETTLED = 1e-12
"""Change of a unit vector below which it is only rounding."""
_ROUNDING = 1e-10
"""Eigenvalues below this part of the largest are rounding of the products in the matrix."""
_OPEN = 1e-9
"""Opening of a loop, relative to the most that its plays could open it, that counts as closed:
rounding, far below any play (judged)."""
_BATCH = 200_000
"""Loads on joints evaluated at once, few enough for a processor's cache."""


@dataclass(frozen=True)
class Line(Play):
    """A displacement along one line in the space of displacements, such as a gear's backlash."""

    amplitude: tuple[float, ...]
    """Largest displacement, to either side: along and about x, y, z, six numbers [m, rad]."""
    wave: bool = False
    """Whether it is a sine of unknown phase; otherwise it rests at one of its two ends."""

    @property
    def reach(self) -> tuple[float, float]:
        return math.hypot(*self.amplitude[:3]), math.hypot(*self.amplitude[3:])

    @property
    def cones(self) -> Cones:
        return Cones(np.array(self.amplitude)[:, None], (Cone(np.eye(1), np.zeros(1), 1.0),))

    def support(self, loads: np.ndarray) -> Support:
        along = loads @ self.amplitude
        return Support(np.abs(along), np.sign(along)[:, None] * np.array(self.amplitude))

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        part = np.sin(random.uniform(0.0, 2.0 * np.pi, count))
        part = part if self.wave else np.sign(part)
        return np.asarray(part[:, None] * np.array(self.amplitude))

    @property
    def covariance(self) -> np.ndarray:
        """Covariance about zero, shape (6, 6): a sine's variance is half its amplitude squared."""
        return (0.5 if self.wave else 1.0) * np.outer(self.amplitude, self.amplitude)


@dataclass(frozen=True)
class Box(Play):
    """Displacements and rotations between bounds, each independent of the others."""

    half: tuple[float, ...]
    """Bounds along and about x, y, z, to either side, six numbers [m, rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        return math.hypot(*self.half[:3]), math.hypot(*self.half[3:])

    @property
    def cones(self) -> Cones:
        axes = np.diag(self.half)[:, np.array(self.half) > 0.0]
        rows = np.eye(axes.shape[1])
        return Cones(axes, tuple(Cone(row[None], np.zeros(len(rows)), 1.0) for row in rows))

    def support(self, loads: np.ndarray) -> Support:
        return Support(np.abs(loads) @ self.half, np.array(self.half) * np.sign(loads))

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        return random.uniform(-1.0, 1.0, (count, 6)) * self.half

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of uniform distributions, shape (6, 6): a third of each bound squared."""
        return np.diag(np.array(self.half) ** 2) / 3.0


@dataclass(frozen=True)
class Tilt(Play):
    """A tilt of the axis alone, anywhere in a disc: a journal's play as reduced models keep it."""

    size: float
    """Largest tilt in any direction [rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        return 0.0, self.size

    def support(self, loads: np.ndarray) -> Support:
        moment = loads[:, 3:5]
        point = np.zeros((len(moment), 6))
        point[:, 3:5] = self.size * toward(moment, np.zeros_like(moment))
        return Support(self.size * np.linalg.norm(moment, axis=1), point)


@dataclass(frozen=True)
class Contribution:
    """The displacements of one joint by one cause: a known shift, plus anywhere in a set."""

    joint: str
    cause: str
    """Name of the cause, by which sums, remaining parts and prices refer to it."""
    set: Play | None = None
    """Set in which the displacement may be anywhere; None: the displacement is `shift` alone."""
    shift: np.ndarray | None = None
    """Displacement that is always there, at n poses, shape (n, 6) [m, rad]; None: zero."""
    spread: float = 0.0
    """Relative uncertainty of `shift`, to either side."""
    origin: str = ""
    """Source of its numbers in words, such as ``its gear``."""
    numbers: Mapping[str, str] = field(default_factory=dict, hash=False)
    """Each number as text, and its origin: ``given``, a ``class`` of robots or a ``rule``."""
    proportional: bool = True
    """Whether it is proportional to a size that can be chosen; the play of a rolling bearing or of
    a fit is not."""
    middle: Play | None = None
    """The set at the middle of the fit's tolerances; `set` is that of the loosest parts."""
    fit: Fit | None = None
    part: str = ""
    """Part of the joint that is displaced, if not the joint itself: `GEAR`, or `LINK`, where the
    first component of the displacement is the link's relative growth."""

    @property
    def name(self) -> str:
        return self.joint + self.part

    @property
    def by_origin(self) -> dict[str, str]:
        """The texts of `numbers`, joined, by their origin."""
        grouped: dict[str, list[str]] = {}
        for text, origin in self.numbers.items():
            grouped.setdefault(origin, []).append(text)
        return {origin: ", ".join(texts) for origin, texts in grouped.items()}

    @property
    def source(self) -> str:
        """The origins of all its numbers, in words."""
        parts = [f"{origin}: {texts}" for origin, texts in self.by_origin.items()]
        return "; ".join([*parts, *filter(None, [self.origin])])

    @property
    def gear(self) -> bool:
        """Whether it is a displacement of the joint's gear."""
        return self.part == jacobians.GEAR

    @property
    def looseness(self) -> float:
        """Standard deviation of a fit's clearance, relative to the way from `middle` to `set`."""
        return self.fit.deviation / (self.fit.most - self.fit.middle) if self.fit else 0.0

    def draw(self, random: np.random.Generator, count: int) -> np.ndarray:
        """Random displacements in the set, shape (count, 6); a fit's clearance is random, too."""
        if self.set is None:
            return np.zeros((count, 6))
        if self.fit is None or self.middle is None:
            return self.set.draw(random, count)
        # The same random loads push both journals, so that states between them are interpolated.
        middle, loose = self.middle.draw(copy.deepcopy(random), count), self.set.draw(random, count)
        sizes = self.fit.quantile(random.uniform(size=count))
        part = (sizes - self.fit.middle) / (self.fit.most - self.fit.middle)
        return np.asarray(middle + part[:, None] * (loose - middle))

    @cached_property
    def covariance(self) -> np.ndarray:
        """Second moments of the displacements that `draw` returns, shape (6, 6)."""
        if self.set is None:
            return np.zeros((6, 6))
        if self.middle is None:
            return self.set.covariance
        states = self.draw(np.random.default_rng(0), DRAWS)
        return np.asarray(states.T @ states / DRAWS)


class States(NamedTuple):
    """The farthest states of k contributions at n poses along m directions."""

    value: np.ndarray
    """Each contribution's share of the distance, shape (k, n, m) [m or rad]; the sum is a bound."""
    point: np.ndarray
    """Displacements of the joints that attain it, shape (k, n, m, 6) [m, rad]."""
    error: np.ndarray
    """Each contribution's part of the tool's error there, shape (k, n, m, 6) [m, rad]."""


class Farthest(NamedTuple):
    """How far the tool can be off at n poses."""

    size: np.ndarray
    """Distance or angle of the tool, shape (n,) [m or rad]."""
    direction: np.ndarray
    """Direction of that error, unit vectors in world axes, shape (n, 3)."""
    parts: np.ndarray
    """Share of each contribution in `size`, shape (k, n)."""


@dataclass(frozen=True)
class ErrorModel:
    """The error of a tool at n poses: k contributions, and how each moves the tool."""

    contributions: tuple[Contribution, ...]
    jacobian: np.ndarray
    """The tool's displacement and rotation, world axes, per displacement of each contribution's
    joint, (k, n, 6, 6)."""
    load: np.ndarray
    """Load on the joint by gravity and at the tool, about the joint's centre in its axes, (k, n, 6)
    [N, N m]."""
    tie: np.ndarray
    """Opening of the loops, as far as no other coordinate can close them, per displacement, (k, n,
    r, 6): summed over all contributions it must be zero. r is 0 without such loops. See
    `loop_play`."""
    scale: np.ndarray
    """Factor by which each contribution is multiplied, (k,)."""

    @classmethod
    def of(
        cls,
        contributions: Sequence[Contribution],
        joints: Sequence[str],
        effects: jacobians.Jacobians,
        scale: Sequence[float] | None = None,
    ) -> ErrorModel:
        """The model of contributions at `joints`, of which `effects` holds the Jacobians.

        Raises:
            JointplayError: a shift that a closed loop resists, which is statically indeterminate.
        """
        at = [list(joints).index(c.joint) for c in contributions]
        move, tie = effects.tool[at], effects.tie[at]
        for i, (k, contribution) in enumerate(zip(at, contributions, strict=True)):
            if contribution.part == jacobians.LINK:  # its first component is a relative growth
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
        tied = any(
            np.abs(rows @ c.set.cones.spread).max(initial=0.0) > jacobians.FELT * max(c.set.reach)
            for rows, c in zip(tie, contributions, strict=True)
            if tie.shape[2] and c.set is not None
        )
        factor = np.ones(len(at)) if scale is None else np.array(scale, float)
        tie = tie if tied else tie[:, :, :0]
        return cls(tuple(contributions), move, effects.load[at], tie, factor)

    @classmethod
    def join(cls, models: Sequence[ErrorModel]) -> ErrorModel:
        """One model of the contributions of several, at the same poses."""
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
        """Whether closed loops make contributions constrain each other."""
        return self.tie.shape[2] > 0

    @property
    def middle(self) -> ErrorModel:
        """The model with all fits in the middle of their tolerances."""
        centred = (c if c.middle is None else replace(c, set=c.middle) for c in self.contributions)
        return replace(self, contributions=tuple(centred))

    @property
    def turning(self) -> ErrorModel:
        """The model with the tool's rotation and displacement exchanged, to ask for angles."""
        swapped = self.jacobian[:, :, 3:], self.jacobian[:, :, :3]
        return replace(self, jacobian=np.concatenate(swapped, axis=2))

    def scaled(self, scale: np.ndarray) -> ErrorModel:
        """The model with its contributions multiplied by factors (k,)."""
        return replace(self, scale=scale)

    def subset(self, contributions: Any = slice(None), poses: Any = slice(None)) -> ErrorModel:
        """The model of some contributions at some poses, by index, slice or mask."""
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
        """Loads on the joints of unit forces (moments) at the tool along directions (n, m, 3).

        These are J^T d, shape (k, n, m, 6).
        """
        rows = self.jacobian[:, :, 3:] if turn else self.jacobian[:, :, :3]
        return np.einsum("nmk,jnki->jnmi", directions, rows)

    def at_rest(self) -> States:
        """States into which gravity and the tool's load push frictionless joints; m is 1."""
        return self._states(self.load[:, :, None])

    @cached_property
    def sphere(self) -> np.ndarray:
        """Directions among which the worst one is sought, (m, 3)."""
        if all(c.shift is None for c in self.contributions):
            return half_sphere()  # the sets are symmetric: the other half gives the same
        half = half_sphere(_DIRECTIONS_SHIFTED)
        return np.vstack([half, -half])

    def values(self, directions: np.ndarray, turn: bool = False) -> np.ndarray:
        """Reach of each contribution along directions (m, 3) at all poses, (k, n, m) [m or rad]."""
        batch = max(_BATCH // (len(self.contributions) * len(directions)), 1)
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
        """Directions (n, 3) along which the tool gets at least as far as along `d`.

        Each step replaces d by the direction of the point that is farthest along d: that point lies
        at least as far away as along d.
        """
        rows = slice(3, 6) if turn else slice(0, 3)
        for _ in range(_REFINEMENTS):
            before = d
            d = toward(self.along(d[:, None], turn).error.sum(axis=0)[:, 0, rows], d)
            if np.abs(d - before).max(initial=0.0) < _SETTLED:
                break
        return d

    def _states(self, loads: np.ndarray) -> States:
        """The states farthest along loads (k, n, m, 6) of any unit."""
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
        for play in dict.fromkeys(sets):  # equal sets together: one call costs little more
            if play is None:
                continue
            equal = [number for number, item in enumerate(sets) if item == play]
            reached = play.support(flat[equal].reshape(-1, 6))
            value[equal] = reached.value.reshape(len(equal), -1)
            point[equal] = reached.point.reshape(len(equal), -1, 6)
        # Shifts, with the end of their uncertainty that lies farther along the load.
        for number, contribution in enumerate(self.contributions):
            if contribution.shift is not None:
                shift = np.repeat(contribution.shift, m, axis=0)
                along = (flat[number] * shift).sum(axis=1)
                value[number] += along + contribution.spread * np.abs(along)
                point[number] += shift * (1.0 + contribution.spread * np.sign(along))[:, None]
        factor = self.scale[:, None]
        value, point = factor * value, factor[:, :, None] * point
        if self.tied:
            self._close_loops(flat, value, point, m)
        return value.reshape(k, n, m), point.reshape(k, n, m, 6)

    def _close_loops(self, flat: np.ndarray, value: np.ndarray, point: np.ndarray, m: int) -> None:
        """Correct values (k, n m) and points (k, n m, 6) in place where they open loops."""
        bounded = {
            k: loop_play.ended(c.set)
            for k, c in enumerate(self.contributions)
            if c.set is not None and max(c.set.reach) > 0.0
        }
        sets, plays = list(bounded), list(bounded.values())
        factor = self.scale[sets, None, None]
        ties = np.repeat(factor[..., None] * self.tie[sets], m, axis=1)
        opened = np.abs(np.einsum("jnri,jni->nr", ties, point[sets] / factor)).max(axis=1)
        most = sum(loop_play.opening(*pair) for pair in zip(plays, ties, strict=True))
        (some,) = np.nonzero(opened > _OPEN * most)
        if len(some):
            loads, at = (factor * flat[sets])[:, some], np.ix_(np.array(sets), some)
            value[at], inner = loop_play.farthest(plays, loads, ties[:, some])
            point[at] = factor * inner

    def _check_ends(self, point: np.ndarray, error: np.ndarray) -> None:
        """Refuse a journal without end walls that slides to its stand-in end, if the tool moves."""
        for contribution, at, errors in zip(self.contributions, point, error, strict=True):
            play = contribution.set
            if not isinstance(play, JournalPlay) or not math.isinf(play.along):
                continue
            far = np.abs(at[..., 2]) > 0.5 * FAR * play.across
            if (far & (np.abs(errors[..., :3]).max(axis=-1) > play.across)).any():
                raise JointplayError(
                    f"nothing limits the journal of {contribution.name!r} along its axis, and the "
                    "tool feels it: give the joint end walls (an axial clearance), or lock_axial"
                )

    # Means and variances.

    @cached_property
    def means(self) -> np.ndarray:
        """Mean displacement of the tool by each contribution, which is its shift, (k, n, 3) [m]."""
        displacement = np.zeros((len(self.contributions), self.poses, 3))
        for k, contribution in enumerate(self.contributions):
            if contribution.shift is not None:
                rows = self.jacobian[k, :, :3]
                displacement[k] = np.einsum("nik,nk->ni", rows, contribution.shift)
        return self.scale[:, None, None] * displacement

    @cached_property
    def _set_covariances(self) -> np.ndarray:
        """Covariance of each joint's displacement in its set, loops aside, (k, 6, 6)."""
        covariances_ = np.array([c.covariance for c in self.contributions])
        return self.scale[:, None, None] ** 2 * covariances_

    @cached_property
    def _closing_gain(self) -> np.ndarray:
        """Gain K by which displacements yield to random openings of the loops, (k, n, 6, r).

        With covariances S and ties T, K_i = S_i T_i^T (sum_j T_j S_j T_j^T)^-1: displacements less
        K times the opening leave the loops closed, with the covariances of normal variables under
        that condition.
        """
        crossed = self._set_covariances[:, None] @ self.tie.transpose(0, 1, 3, 2)
        inverse = np.linalg.pinv((self.tie @ crossed).sum(axis=0), rcond=_ROUNDING, hermitian=True)
        return np.asarray(crossed @ inverse)

    @cached_property
    def covariances(self) -> np.ndarray:
        """Covariance of the tool's displacement by each contribution, (k, n, 3, 3) [m^2].

        Contributions that loops tie to each other are correlated: theirs is the covariance of each
        with the sum, so that these add up to the covariance of the sum.
        """
        rows = self.jacobian[:, :, :3]
        joint = self._set_covariances
        covariance = np.einsum("jnik,jkl,jnml->jnim", rows, joint, rows)
        if self.tied:
            opened = (self.tie @ joint[:, None] @ rows.transpose(0, 1, 3, 2)).sum(axis=0)
            less = rows @ self._closing_gain @ opened
            covariance = covariance - 0.5 * (less + less.transpose(0, 1, 3, 2))
        # A shift is uniform within its uncertainty, of which the deviation is 1 / sqrt(3).
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
        """Random displacements at the first pose, of the variances of `covariances`, (count, k, 6)
        [m, rad].
        """
        sets = np.zeros((count, len(self.contributions), 6))
        shifts = np.zeros_like(sets)
        for k, contribution in enumerate(self.contributions):
            if contribution.shift is not None:
                part = 1.0 + contribution.spread * random.uniform(-1.0, 1.0, count)
                shifts[:, k] = self.scale[k] * part[:, None] * contribution.shift[0]
            sets[:, k] = self.scale[k] * contribution.draw(random, count)
        if self.tied:
            opened = np.einsum("kri,mki->mr", self.tie[:, 0], sets)
            sets -= np.einsum("kir,mr->mki", self._closing_gain[:, 0], opened)
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
    """The error by play alone: of joints with clearance, then of gears.

    The arguments are those of `budget`. Mechanisms with closed loops, whose plays may constrain
    each other, are accepted only with `loops`.
    """
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
    """The displacements that the clearance of a joint allows, a fit at its loosest."""
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
    """Backlash and hysteresis of a gear: the joint moves along its freedom, the motor stands."""
    half = mechanism.gears[name].unloaded_range / 2.0
    axis = mechanism.description.joints[name].component
    backlash = Line(tuple(half if k == axis else 0.0 for k in range(6)))
    return Contribution(name, "play", backlash, origin=f"its{jacobians.GEAR}", part=jacobians.GEAR)
