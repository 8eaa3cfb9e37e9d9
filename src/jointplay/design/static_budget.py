"""Error budget: how far play lets the tool be off, at many poses, and which joint is to blame.

No dynamics. Each joint's play is an exact set of small displacements; through its Jacobian it
displaces the tool (`levers`). What all joints can do together is the sum of these sets, whose
support function is the sum of theirs: the worst case along a direction is a sum over joints, and
each joint has its share. The drives hold the joints where the encoders say.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from jointplay.core.errors import JointplayError, require_a, require_finite, require_whole
from jointplay.core.tables import Column, Table
from jointplay.design.levers import (
    PlaySources,
    TurnPlay,
    configurations,
    displaced,
    sources,
    tool_place,
)
from jointplay.design.rest import AGREES_M, Standing
from jointplay.loads.drive import ComputedTorque, Drive
from jointplay.mechanism.closed_loops import ClosedLoops
from jointplay.mechanism.mechanism import Mechanism, frame_index

DIRECTIONS = 180
"""Directions over half a sphere among which the worst one is sought, before it is refined."""
_REFINEMENTS = 6
_BEYOND = 0.01
"""Part of a joint's largest error by which an error at rest exceeds its bound to be mentioned."""
_DECIDES = 0.5
"""Part of the error at rest by which friction decides it, if it can shift the tool so far."""
_PLACES = ("first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth")
_TRUE = 0.25
"""Part of the error by which loops closed exactly may put the tool elsewhere than linear ones."""
FOLLOW = ComputedTorque()
"""Drives of a run that says nothing of them."""
AXES = ("x", "y", "z", "about x", "about y", "about z")
"""Components of the tool's error, in world axes [m, rad]."""


@dataclass(frozen=True)
class Budget:
    """Error of the tool at n poses, by j sources of play; lengths in m, angles in rad.

    `worst` is a bound that can be reached: no state of the journals without penetration is worse,
    up to `second_order`. `rms` is of states without friction. Where the machine rests is found when
    it is asked for (`rest`, `rest_interval`); contacts give way there, so that it may be a little
    beyond `worst`.
    """

    standing: Standing
    """The machine at these poses: its sources of play, and where it rests."""
    positions: np.ndarray
    """Of the ideal tool, world axes, shape (n, 3)."""
    axis_worst: np.ndarray
    """Largest error along and about each world axis, by joint, shape (n, j, 6)."""
    worst: np.ndarray
    """Largest distance of the tool from the ideal one, shape (n,)."""
    direction: np.ndarray
    """Where to, unit vectors in world axes, shape (n, 3)."""
    worst_parts: np.ndarray
    """What each joint adds to `worst`, shape (n, j)."""
    worst_turn: np.ndarray
    """Largest rotation of the tool, shape (n,)."""
    turn_parts: np.ndarray
    """What each joint adds to `worst_turn`, shape (n, j)."""
    rms: np.ndarray
    """RMS distance, if a load on the tool that exceeds all others has a random direction, (n,)."""
    rms_parts: np.ndarray
    """What each joint adds to `rms`: its mean part along the error, shape (n, j)."""

    @property
    def tool(self) -> str:
        """Frame whose error this is."""
        return self.standing.mechanism.tool

    @property
    def relative_to(self) -> str | None:
        """Body from which it is seen; None: the world."""
        return self.standing.relative_to

    @property
    def sources(self) -> PlaySources:
        """What each joint's play is, and how it moves the tool."""
        return self.standing.sources

    @property
    def joints(self) -> tuple[str, ...]:
        """Sources of play, gears last."""
        return self.sources.names

    @property
    def second_order(self) -> np.ndarray:
        """What rotations of the second order can add to `worst` at most, shape (n,).

        In closed loops no bound, but by how much the loops, closed exactly with the journals of
        `worst`, put the tool elsewhere.
        """
        return self.standing.second_order

    @property
    def loops(self) -> bool:
        """Whether closed loops lead the play to the tool."""
        return bool(self.standing.mechanism.loops)

    @property
    def worst_pose(self) -> int:
        """Index of the pose with the largest error."""
        return int(self.worst.argmax())

    @property
    def shares(self) -> np.ndarray:
        """Each joint's share of the worst case at the worst pose, sum one, shape (j,)."""
        parts = self.worst_parts[self.worst_pose]
        return np.asarray(parts / parts.sum()) if parts.sum() > 0.0 else parts

    @cached_property
    def alone(self) -> np.ndarray:
        """Largest distance of the tool if only this joint had play, shape (n, j) [m].

        In its own worst direction; `worst_parts` is along the one that is worst for all together.
        """
        plays = self.sources
        n, j = self.worst_parts.shape
        found = plays.along(np.broadcast_to(half_sphere(), (n, DIRECTIONS, 3))).value
        d = half_sphere()[found.argmax(axis=2)].swapaxes(0, 1)  # (n, j, 3)
        each = np.arange(j)
        for _ in range(_REFINEMENTS):
            reached = plays.along(d).error[each, :, each, :3].swapaxes(0, 1)
            size = np.linalg.norm(reached, axis=2, keepdims=True)
            d = np.where(size > 0.0, reached / np.where(size > 0.0, size, 1.0), d)
        return np.asarray(plays.along(d).value[each, :, each].T)

    @property
    def ranking(self) -> str:
        """The joints by their share of the worst case, one line; over several poses its range."""
        total = self.worst_parts.sum(axis=1, keepdims=True)
        shares = self.worst_parts / np.maximum(total, 1e-300)
        mean = 100.0 * shares.mean(axis=0)
        low, high = 100.0 * shares.min(axis=0), 100.0 * shares.max(axis=0)
        words = []
        for place, i in enumerate(np.argsort(-mean, kind="stable")):
            name = _PLACES[place] if place < len(_PLACES) else f"{place + 1}th"
            spread = f" ({low[i]:.0f} to {high[i]:.0f})" if len(shares) > 1 else ""
            words.append(f"{self.joints[i]}: {name}, {mean[i]:.0f} %{spread}")
        return f"shares of the worst case: {'; '.join(words)}"

    def by_pose(self, names: Sequence[str]) -> Table:
        """A row for each pose: error in the worst case, and the share of each joint in it.

        Args:
            names: of the poses, (n,).
        """
        total = np.maximum(self.worst_parts.sum(axis=1, keepdims=True), 1e-300)
        shares = (self.worst_parts / total).T
        return Table(
            (
                Column("pose", names),
                Column("worst case", self.worst, "m"),
                Column("rms", self.rms, "m"),
                *(
                    Column(name, share, "1", digits=3)
                    for name, share in zip(self.joints, shares, strict=True)
                ),
            )
        )

    @property
    def rest(self) -> np.ndarray:
        """Error at rest under gravity and the tool's load, without friction, by joint, (n, j, 6).

        By each joint's lever [m, rad]; NaN where no place of rest is found, or plays of a loop hold
        each other.
        """
        return np.array([self.standing.rest(i).parts for i in range(len(self.worst))])

    @property
    def rest_tool(self) -> np.ndarray:
        """Error of the tool there, of all joints, exactly, shape (n, 6) [m, rad]."""
        return np.array([self.standing.rest(i).whole for i in range(len(self.worst))])

    @property
    def rest_loads(self) -> np.ndarray:
        """What each source of play bears there, bearing axes, shape (n, j, 6) [N, N m].

        Force and moment of its contacts about the journal's centre; of a gear the torque of its
        teeth about its axis, last.
        """
        return np.array([self.standing.rest(i).loads for i in range(len(self.worst))])

    @property
    def rest_error(self) -> np.ndarray:
        """Distance of the tool at rest from the ideal one, shape (n,) [m]."""
        return np.asarray(np.linalg.norm(self.rest_tool[:, :3], axis=1))

    @property
    def rest_interval(self) -> np.ndarray:
        """Where friction can hold the machine: least and largest error, shape (n, 4, 2) [m].

        Along world x, y, z, and the distance from the ideal tool; on the safe side. In closed loops
        all joints, and those of a kind that does not say where it presses, may be anywhere within
        their play.
        """
        return np.array([self.standing.interval(i) for i in range(len(self.worst))])

    def table(self, pose: int | None = None) -> Table:
        """The budget at a pose, by default the worst one."""
        at = self.worst_pose if pose is None else pose
        total = max(float(self.worst_parts[at].sum()), 1e-300)
        rests, whole, _ = self.standing.rest(at)
        parts = self.worst_parts[at]
        worst = float(self.worst[at])
        sums = (worst, worst, 1.0 if worst > 0.0 else None, np.linalg.norm(whole[:3]))
        return Table(
            (
                Column("joint", self.joints),
                Column("alone", self.alone[at], "m"),
                Column("part of worst case", parts, "m"),
                Column("share", parts / total, "1", digits=4),
                Column("at rest", np.linalg.norm(rests[:, :3], axis=1), "m"),
                Column("rms", self.rms_parts[at], "m"),
                Column("worst turn", self.turn_parts[at], "rad"),
            ),
            totals=[("all", *sums, self.rms[at], self.worst_turn[at])],
            notes=self._notes(at),
        )

    def _notes(self, at: int) -> list[str]:
        """What stands below the budget of a pose."""
        rests, whole, loads = self.standing.rest(at)
        axes = [f"{1e3 * value:.4f}" for value in self.axis_worst[at].sum(axis=0)]
        lines = [
            f"worst case along x, y, z: {', '.join(axes[:3])} mm; "
            f"about x, y, z: {', '.join(axes[3:])} mrad"
        ]
        begins = "" if self.standing.force.any() else " (the start of a run with start=rest)"
        place = ", ".join(f"{1e3 * value:.4f}" for value in whole[:3])
        lines.append(
            "at rest without friction: no equilibrium was found"
            if np.isnan(whole).any()
            else f"at rest without friction, along x, y, z: {place} mm{begins}"
        )
        if not np.isnan(loads).any():
            lines.append(f"the joints bear there: {self._loads(loads)}")
        beyond = 1e3 * (np.linalg.norm(rests[:, :3], axis=1) - self.alone[at])
        given = [
            f"{name} {more:.4f} mm"
            for name, more in zip(self.joints, beyond, strict=True)
            if more > _BEYOND * 1e3 * self.alone[at].max()
        ]
        if given:
            lines.append(
                "the worst case takes contacts as rigid; at rest they give way under the load, "
                f"beyond the joint's worst case alone: {', '.join(given)}"
            )
        return [*lines, *self._held(at)]

    def _loads(self, loads: np.ndarray) -> str:
        """What each source of play bears, (j, 6), as text."""
        words = []
        for name, play, load in zip(self.joints, self.sources.plays, loads, strict=True):
            turns = isinstance(play, TurnPlay)
            size = float(np.linalg.norm(load[3:] if turns else load[:3]))
            words.append(f"{name} {size:.4g} {'N m' if turns else 'N'}")
        return ", ".join(words)

    def _held(self, at: int) -> list[str]:
        """Where the tool rests with friction, and how much that matters, lines of text."""
        place, ends = self.standing.rest(at).whole[:3], self.standing.interval(at)
        box = [
            f"{axis} {1e3 * low:.4f} to {1e3 * high:.4f}"
            for axis, (low, high) in zip("xyz", ends[:3], strict=True)
        ]
        least, largest = 1e3 * ends[3]
        free = [
            name
            for name, none in zip(self.joints, self.standing.unpressed(at), strict=True)
            if none
        ]
        lines = []
        if free:
            names = "any joint" if len(free) == len(self.joints) else ", ".join(free)
            lines.append(f"no force acts on {names}: the journals may rest anywhere in their play")
        whole = self.standing.unsearched
        if whole:
            all_joints = len(whole) == len(self.standing.coefficients)
            names = "all joints" if all_joints else ", ".join(whole)
            lines.append(
                f"how far friction can hold {names} is not known (closed loops, or a kind without "
                "contacts): their entire play is assumed"
            )
        lines.append(
            f"with {self.standing.words} the tool may rest anywhere within {', '.join(box)} mm; "
            f"{least:.4f} to {largest:.4f} mm from the ideal one"
        )
        away = 1e3 * float(np.linalg.norm(np.abs(ends[:3] - place[:, None]).max(axis=1)))
        own = 1e3 * float(np.linalg.norm(place))
        if len(free) < len(self.joints) and not whole and np.isfinite(away):
            part = f", {100 * away / own:.0f} % of the error there" if own > 0.0 else ""
            lines.append(
                f"friction determines where it rests: up to {away:.4f} mm from the place "
                f"without{part}"
                if away > _DECIDES * own
                else f"friction shifts the place of rest by up to {away:.4f} mm{part}"
            )
        return lines

    @property
    def accuracy(self) -> str:
        """With which error the numbers are known, one line."""
        search = 1.0 / np.cos(_covering()) - 1.0
        excess = max(play.excess for play in self.sources.plays)
        more = f"{1e6 * self.second_order[self.worst_pose]:.3g} um"
        second = (
            f"loops closed exactly put the tool {more} elsewhere"
            if self.loops
            else f"rotations of second order up to {more}"
        )
        at_rest = (
            "at rest, with drives assumed rigid under the force on the tool"
            if self.standing.force.any()
            else f"at rest within {1e6 * AGREES_M:g} um of where a run begins"
        )
        return (
            "free travel with rigid contacts, to which contacts and drives that give way add; "
            f"worst case missed by at most {100 * search:.2g} % "
            f"(directions), too large by at most {100 * excess:.2g} % (lean of the journals, "
            f"second order), {second}; {at_rest}"
        )

    def data(self, names: Sequence[str] = ()) -> Table:
        """A row for each pose: tool, errors, parts of each joint.

        Args:
            names: of the poses, (n,); without, they are numbered.

        Where the machine rests stands only at poses for which it has been found: ask for `rest`
        and `rest_interval` before, and it stands everywhere.
        """
        columns = [Column("pose", names or range(len(self.worst)))]
        columns += [Column(f"tool {x}", self.positions[:, k], "m") for k, x in enumerate("xyz")]
        columns += [
            Column("worst", self.worst, "m"),
            Column("worst turn", self.worst_turn, "rad"),
            Column("rms", self.rms, "m"),
            Column("second order", self.second_order, "m"),
        ]
        whole = self.axis_worst.sum(axis=1)
        columns += [
            Column(f"worst {axis}", whole[:, k], "m" if k < 3 else "rad")
            for k, axis in enumerate(AXES)
        ]
        for what, values in (("worst part", self.worst_parts), ("worst alone", self.alone)):
            for k, name in enumerate(self.joints):
                key = f"{what.replace(' ', '_')}_{name}_m"
                columns.append(Column(f"{what} {name}", values[:, k], "m", key))
        rests = [self._rests(i) for i in range(len(self.worst))]
        ways = ("x", "y", "z", "distance")
        ends = [f"rest {way} {end}" for way in ways for end in ("least", "largest")]
        for k, head in enumerate([*(f"rest {way}" for way in ways), *ends]):
            columns.append(Column(head, [row[k] for row in rests], "m"))
        return Table(columns)

    def _rests(self, pose: int) -> Sequence[float | None]:
        """Where the machine rests, and between what, if that has been found; (12,) [m]."""
        if not self.standing.is_known(pose):
            return [None] * 12
        whole, ends = self.standing.rest(pose).whole[:3], self.standing.interval(pose)
        return [*whole, float(np.linalg.norm(whole)), *ends.ravel()]


def budget(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    *,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    second_order: bool = True,
    driven: Sequence[str] | None = None,
    friction: float | None = None,
    drive: Drive = FOLLOW,
    relative_to: str | None = None,
) -> Budget:
    """How far the play of all joints and gears lets the tool be off, without dynamics.

    In closed loops the driven joints stand and the others follow, to the first order; joints
    outside the loops stand.

    Args:
        mechanism: with play.
        poses: joint positions by name [rad or m], the rest zero; or configurations, (n, nq). Loops
            that are open there are closed by the joints that are not driven.
        force: on the tool, besides gravity, in world axes, shape (3,) [N].
        second_order: widen the sets so that they contain all poses without penetration; without,
            all errors are proportional to the clearances.
        driven: joints of loops that stand; None: the first that determine the others.
        friction: coefficient of all contacts, with which a machine may rest elsewhere than without;
            None: the largest that the law of each joint has.
        drive: of all joints that stand, as in a run: where they rest, drives of finite stiffness
            give way a little, unless a force acts on the tool. `Prescribed` does not.
        relative_to: link or frame whose own motion does not count, such as a palm or a trunk:
            errors, directions and positions are those seen from it, in its axes. The base stays
            held, for loads. None: the world.

    Raises:
        JointplayError: a friction coefficient that is negative or not finite; nothing has play; a
            pose of the wrong shape; a force that is no vector; an axis without limit that the tool
            feels; loops that cannot be closed, or near a singular position, where the first order
            does not hold.
        MissingName: no such joint or body.
    """
    require_a("mechanism", mechanism, "Mechanism")
    if friction is not None and require_finite("friction coefficient", friction, "") < 0.0:
        raise JointplayError(f"the friction coefficient must be >= 0, got {friction:g}")
    if not drive.follows:
        raise JointplayError(
            f"a {drive.kind} drive holds no position: the budget's drives must follow a motion, "
            "such as ComputedTorque() or Prescribed()"
        )
    if any(gear.error_terms for gear in mechanism.gears.values()):  # which is no play
        exact = {name: gear.without_error() for name, gear in mechanism.gears.items()}
        mechanism = mechanism.with_clearance(mechanism.given_joints, exact)
    q = configurations(mechanism, poses, driven)
    plays = sources(
        mechanism,
        q,
        force=force,
        second_order=second_order,
        driven=driven,
        loops=True,
        relative_to=relative_to,
    )
    n = len(q)
    positions = np.array([tool_place(mechanism, row, relative_to).translation for row in q])
    axes = np.broadcast_to(np.eye(3), (n, 3, 3))
    both = [plays.along(axes, turn).value for turn in (False, True)]
    worst, direction, worst_parts, errors = farthest(plays, turn=False)
    worst_turn, _, turn_parts, _ = farthest(plays, turn=True)
    # The states that a load of random direction brings about are those just found.
    total = errors.sum(axis=0)
    rms = np.sqrt((total**2).sum(axis=2).mean(axis=1))
    share = np.einsum("jnmk,nmk->nj", errors, total) / total.shape[1]
    rms_parts = np.divide(share, rms[:, None], out=np.zeros_like(share), where=rms[:, None] > 0.0)
    if mechanism.loops:
        more = _second_order_of_loops(mechanism, q, plays, direction, driven)
    else:
        more = _second_order(plays, relative_to is None or _carries(mechanism, relative_to))
    push = np.array(force, float)
    return Budget(
        Standing(mechanism, q, plays, push, driven, friction, drive, more, relative_to),
        positions,
        np.concatenate(both, axis=2).transpose(1, 0, 2),
        worst,
        direction,
        worst_parts,
        worst_turn,
        turn_parts,
        rms,
        rms_parts,
    )


def half_sphere(count: int = DIRECTIONS) -> np.ndarray:
    """Directions evenly over half a sphere (Fibonacci lattice), shape (count, 3)."""
    i = np.arange(require_whole("count", count, 1))
    z = 1.0 - (i + 0.5) / count
    r, phi = np.sqrt(1.0 - z * z), i * np.pi * (3.0 - np.sqrt(5.0))
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def _covering() -> float:
    """Largest angle between any direction and the nearest of `half_sphere` or its mirror [rad]."""
    fine = half_sphere(20 * DIRECTIONS)
    return float(np.arccos(np.abs(fine @ half_sphere().T).max(axis=1).min()))


def farthest(
    plays: PlaySources, turn: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Largest displacement (or rotation) at each pose: (n,), where to (n, 3), by part (n, j).

    Sought from the best of many directions on. Also the errors of each part along all of these,
    (j, n, directions, 3).
    """
    n = plays.move.shape[1]
    directions = np.broadcast_to(half_sphere(), (n, DIRECTIONS, 3))
    found = plays.along(directions, turn)
    best = found.value.sum(axis=0).argmax(axis=1)
    d = plays.climb(directions[np.arange(n), best], _REFINEMENTS, turn)
    shares = plays.along(d[:, None], turn).value[:, :, 0].T
    return shares.sum(axis=1), d, shares, found.error[..., 3:] if turn else found.error[..., :3]


def _carries(mechanism: Mechanism, body: str) -> bool:
    """Whether a body is on the way from the base to the tool, so that all lead from it outwards."""
    model = mechanism.model
    at, tool = (
        {*model.supports[model.frames[index].parentJoint]}
        for index in (frame_index(model, body), mechanism.tool_frame)
    )
    return at <= tool


def _second_order(plays: PlaySources, outwards: bool) -> np.ndarray:
    """What products of small rotations can add to the tool's displacement, at most, (n,) [m].

    A rotation by theta about a centre at the distance r adds theta^2 r / 2 to its linear part; one
    nearer to the base turns what the others have displaced. Unless the sources come from the base
    `outwards`, any may turn what any other has displaced.
    """
    whole = 0.0 if outwards else sum(play.reach[1] for play in plays.plays)
    total = np.zeros(plays.move.shape[1])
    turned = np.zeros_like(total)
    for play, move in zip(plays.plays, plays.move, strict=True):
        aside, angle = play.reach
        arms = np.linalg.norm(move[:, :3, 3:], axis=(1, 2)) / np.sqrt(2.0)
        felt = np.abs(move).max(axis=(1, 2)) > 0.0
        moved = np.where(felt, aside + angle * arms, 0.0)
        total += np.where(felt, 0.5 * angle**2 * arms, 0.0)
        total += turned * moved if outwards else (whole - angle) * moved
        turned += np.where(felt, angle, 0.0)
    return total


def _second_order_of_loops(
    mechanism: Mechanism,
    q: np.ndarray,
    plays: PlaySources,
    direction: np.ndarray,
    driven: Sequence[str] | None,
) -> np.ndarray:
    """Distance of the tool from its first order, journals farthest along directions, (n,) [m].

    Raises:
        JointplayError: near a singular position the loops go elsewhere, or cannot be closed.
    """
    closing = ClosedLoops(mechanism, q[0], driven)
    states = plays.along(direction[:, None])
    largest = max(play.reach[0] for play in plays.plays)
    away = np.zeros(len(q))
    for i, row in enumerate(q):
        linear = states.error[:, i, 0, :3].sum(axis=0)
        here = tool_place(mechanism, row).translation
        aside = dict(zip(plays.names, states.point[:, i, 0], strict=True))
        exact = displaced(closing, row, aside)
        if exact is not None:
            away[i] = float(np.linalg.norm(exact.translation - here - linear))
        if exact is None or away[i] > _TRUE * max(float(np.linalg.norm(linear)), largest):
            what = (
                "the loops cannot be closed with the journals aside"
                if exact is None
                else f"they put the tool {1e3 * away[i]:.4g} mm from where the first order does"
            )
            raise JointplayError(
                f"near a singular position at {closing.stands(row, i, len(q))}: "
                f"{what}; leave this pose out, or simulate (jointplay run)"
            )
    return away


# The static error set of the tool as an ellipsoid that encloses it, pose by pose.


_DIRECTIONS = 90
_ROUNDS = 4
_FLAT = 1e-3
"""Thickness of an ellipsoid whose set is flat, part of its largest half axis."""
_SMALLEST = 1e-12
"""Half axis of an ellipsoid whose set is a point [m]."""


@dataclass(frozen=True)
class Ellipsoids:
    """Ellipsoids about the tool without play, at n poses; world axes."""

    root: np.ndarray
    """The unit sphere's points, multiplied by this symmetric matrix, are the ellipsoid's: the set's
    support is nowhere larger than its own, sqrt(d . root root d), shape (n, 3, 3) [m]."""
    worst: np.ndarray
    """Largest distance in the set among the directions looked at, (n,) [m]."""
    rms: np.ndarray
    """RMS distance under loads of random direction, (n,) [m]."""


def ellipsoids(plays: PlaySources) -> Ellipsoids:
    """An ellipsoid close around the set, at each pose.

    The squared support of an ellipsoid is a quadratic form of the direction: it is fitted to the
    set's by least squares and widened until it is nowhere smaller; then again in axes in which the
    ellipsoid found is a sphere, so that thin sets are fitted as well as round ones.
    """
    n, sphere = plays.move.shape[1], half_sphere(_DIRECTIONS)
    evenly = np.broadcast_to(sphere, (n, *sphere.shape))
    found = plays.along(evenly)
    total = found.error.sum(axis=0)[..., :3]
    worst = found.value.sum(axis=0).max(axis=1)
    square = np.einsum("n,ij->nij", np.maximum(worst, _SMALLEST) ** 2, np.eye(3))
    for _ in range(_ROUNDS):
        root = _root(square)
        back = np.linalg.inv(root)
        d = np.einsum("nij,mj->nmi", back, sphere)
        size = np.linalg.norm(d, axis=2)
        support = plays.along(d / size[..., None]).value.sum(axis=0) * size
        square = _floored(root @ _fitted(sphere, support) @ root)
    rms = np.sqrt((total**2).sum(axis=2).mean(axis=1))
    return Ellipsoids(_root(square), worst, rms)


def _fitted(d: np.ndarray, support: np.ndarray) -> np.ndarray:
    """Forms (n, 3, 3) nowhere below the squares of supports (n, m) in directions (m, 3)."""
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    products = np.stack([d[:, i] * d[:, k] * (1.0 + (i != k)) for i, k in pairs], axis=1)
    numbers = np.linalg.lstsq(products, (support**2).T, rcond=None)[0].T
    square = np.empty((len(support), 3, 3))
    for column, (i, k) in enumerate(pairs):
        square[:, i, k] = square[:, k, i] = numbers[:, column]
    square = _floored(square)
    own = np.einsum("mi,nij,mj->nm", d, square, d)
    return square * (support**2 / own).max(axis=1)[:, None, None]


def _floored(square: np.ndarray) -> np.ndarray:
    """Forms (n, 3, 3) with no axis below a part of the largest."""
    sizes, axes = np.linalg.eigh(square)
    least = np.maximum(_FLAT**2 * sizes[:, -1:], _SMALLEST**2)
    return np.einsum("nik,nk,njk->nij", axes, np.maximum(sizes, least), axes)


def _root(square: np.ndarray) -> np.ndarray:
    """Symmetric roots of forms (n, 3, 3)."""
    sizes, axes = np.linalg.eigh(square)
    return np.einsum("nik,nk,njk->nij", axes, np.sqrt(sizes), axes)
