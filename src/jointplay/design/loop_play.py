"""How far plays that a closed loop ties to each other can go, and how true the first order is."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin

from jointplay.core.errors import JointplayError
from jointplay.design import loops
from jointplay.design.levers import GEAR, Part, place, tool_place
from jointplay.joints import Coordinate
from jointplay.joints.play import Cones, JournalPlay, Play
from jointplay.mechanism.mechanism import Mechanism

# How far plays can go that hold each other: those of the joints of a closed loop.
#
# A loop stays closed: what the plays of its joints open, its other coordinates must close again.
# What these cannot close (a plane linkage whose pins lean) the plays must not open. So the
# farthest displacements along loads a_i are
#
#     max sum_i a_i . xi_i    for xi_i in P_i with sum_i T_i xi_i = 0
#     = min over l of sum_i h_i(a_i + T_i^T l)
#
# with the support functions h_i of the plays P_i (duality: Rockafellar, Convex Analysis, 1970,
# section 31). Any l gives an upper bound, so the values returned are bounds whatever the
# numerics; each joint's term is also what the value gains by its clearance, c dh/dc.
#
# Where the farthest states without ties fit together already, they are taken: no search.
# Otherwise a barrier method (Boyd, Vandenberghe, Convex Optimization, 2004, chapter 11) follows
# the central path of all problems at once, the cones of each play (`Play.cones`) being its walls.


_FITS = 1e-9
"""Part of what the plays could open that may stay open."""
_EXACT = 1e-4
"""Part of the sum without ties by which points may fall short of the farthest."""
_STAGE, _STEPS, _SHORTER = 10.0, 30, 30
"""Factor of the objective from stage to stage; most Newton steps in one, and halvings of a step."""
_NEAR, _THERE = 0.5, 1e-2
"""What a step may gain when a stage ends, and the last one."""
_ROUNDING = 1e-10
"""Part of a matrix's largest eigenvalue that is taken for zero."""
_FAR = 100.0
"""Clearances across that stand for no end at all."""


@dataclass(frozen=True)
class States:
    """Farthest states of j parts at n poses along m directions."""

    value: np.ndarray
    """By part, their sum being a bound, shape (j, n, m) [m or rad]."""
    point: np.ndarray
    """Displacements of the joints, which attain it, shape (j, n, m, 6)."""
    error: np.ndarray
    """The tool's error there, by part, shape (j, n, m, 6)."""


def along(
    parts: Sequence[Part],
    directions: np.ndarray,
    turn: bool = False,
    scale: np.ndarray | None = None,
) -> States:
    """Farthest displacements of the tool that all plays together allow, along directions.

    Args:
        parts: sources of play, at n poses.
        directions: unit vectors in world axes, shape (n, m, 3).
        turn: rotations of the tool instead of displacements.
        scale: what the clearances of each part are multiplied by, shape (j,).
    """
    rows = [part.move[:, 3:] if turn else part.move[:, :3] for part in parts]
    loads = np.stack([np.einsum("nmk,nkj->nmj", directions, one) for one in rows])
    return _farthest(parts, loads, scale)


def at_rest(parts: Sequence[Part]) -> States:
    """Where gravity and the tool's load put the journals, without friction; m is one."""
    return _farthest(parts, np.stack([part.load[:, None] for part in parts]))


def _farthest(parts: Sequence[Part], loads: np.ndarray, scale: np.ndarray | None = None) -> States:
    """See `along`; loads (j, n, m, 6) of any unit."""
    j, n, m, _ = loads.shape
    scale = np.ones(j) if scale is None else scale
    plays = [ended(part.play) if part.tie is not None else part.play for part in parts]
    flat = loads.reshape(j, n * m, 6)
    found = [play.support(flat[i]) for i, play in enumerate(plays)]
    value = np.stack([scale[i] * one.value for i, one in enumerate(found)])
    point = np.stack([scale[i] * one.point for i, one in enumerate(found)])
    if any(part.tie is not None for part in parts):
        size = max((0 if part.tie is None else part.tie.shape[1]) for part in parts)
        ties = np.zeros((j, n, size, 6))
        for i, part in enumerate(parts):
            if part.tie is not None:
                ties[i] = scale[i] * part.tie
        ties = np.repeat(ties, m, axis=1)
        whole = scale[:, None, None] * flat
        left = np.abs(np.einsum("jnri,jni->nr", ties, point / scale[:, None, None])).max(axis=1)
        able = sum(_opens(play, ties[i]) for i, play in enumerate(plays))
        (some,) = np.nonzero(left > _FITS * able)
        if len(some):
            value[:, some], inner = _held(plays, whole[:, some], ties[:, some])
            point[:, some] = scale[:, None, None] * inner
    point = point.reshape(j, n, m, 6)
    error = np.einsum("jnik,jnmk->jnmi", np.stack([part.move for part in parts]), point)
    _check_ends(parts, point, error)
    return States(value.reshape(j, n, m), point, error)


def ended(play: Play) -> Play:
    """The play with ends along its axis, if it has none."""
    if isinstance(play, JournalPlay) and math.isinf(play.along):
        return replace(play, along=_FAR * play.across)
    return play


def _check_ends(parts: Sequence[Part], point: np.ndarray, error: np.ndarray) -> None:
    """Raise if a journal without end walls went to the end it has not, and the tool feels it."""
    for part, states, errors in zip(parts, point, error, strict=True):
        play = part.play
        if part.tie is None or not isinstance(play, JournalPlay) or not math.isinf(play.along):
            continue
        far = np.abs(states[..., 2]) > 0.5 * _FAR * play.across
        if (far & (np.abs(errors[..., :3]).max(axis=-1) > play.across)).any():
            raise JointplayError(
                f"nothing limits the journal of {part.name!r} along its axis, and the tool feels "
                "it: give the joint end walls (an axial clearance), or lock_axial"
            )


def _opens(play: Play, ties: np.ndarray) -> np.ndarray:
    """How far a play could open its loops at most, for ties (n, r, 6): shape (n,)."""
    aside, angle = play.reach
    most = aside * np.abs(ties[..., :3]).sum(axis=-1) + angle * np.abs(ties[..., 3:]).sum(axis=-1)
    return np.asarray(most.max(axis=-1))


def _held(
    plays: Sequence[Play], loads: np.ndarray, ties: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Values (j, n) and points (j, n, 6) of problems whose ties (j, n, r, 6) hold."""
    sets = [play.cones for play in plays]
    aims = [loads[i] @ one.spread for i, one in enumerate(sets)]
    rows = [ties[i] @ one.spread for i, one in enumerate(sets)]
    alone = np.stack([play.support(loads[i]).value for i, play in enumerate(plays)])
    size = np.maximum(alone.sum(axis=0), 1e-300)
    wide = np.maximum(np.max([np.abs(row).max(axis=(1, 2)) for row in rows], axis=0), 1e-300)
    aims = [aim / size[:, None] for aim in aims]
    rows = [row / wide[:, None, None] for row in rows]
    path = _Path(sets, aims, rows)
    places, price = path.follow()
    price = price * (size / wide)[:, None]
    value = np.stack(
        [
            play.support(loads[i] + np.einsum("nri,nr->ni", ties[i], price)).value
            for i, play in enumerate(plays)
        ]
    )
    value = np.where(value.sum(axis=0) < alone.sum(axis=0), value, alone)
    point = [at @ one.spread.T for at, one in zip(places, sets, strict=True)]
    return value, np.stack(point)


class _Path:
    """The central path of n problems: maximise aims . y within the cones, rows . y = 0."""

    def __init__(
        self, sets: Sequence[Cones], aims: Sequence[np.ndarray], rows: Sequence[np.ndarray]
    ) -> None:
        self._sets, self._aims, self._rows = sets, aims, rows
        self._count = 2 * sum(len(one.walls) for one in sets)

    def follow(self) -> tuple[list[np.ndarray], np.ndarray]:
        """Coordinates of each set, (n, m), and the price of each tie, (n, r)."""
        y = [np.zeros_like(aim) for aim in self._aims]
        price = np.zeros(self._rows[0].shape[:2])
        weight, last = float(self._count), self._count / _EXACT
        while True:
            near = _NEAR if weight < last else _THERE
            left = np.arange(len(price))
            for _ in range(_STEPS):
                step, price[left], gain = self._newton(y, weight, left)
                self._move(y, step, gain, weight, left)
                left = left[gain >= near]
                if not len(left):
                    break
            if weight >= last:
                return y, -price / weight
            weight = min(_STAGE * weight, last)

    def _newton(
        self, y: list[np.ndarray], weight: float, some: np.ndarray
    ) -> tuple[list[np.ndarray], np.ndarray, np.ndarray]:
        """Newton's steps of some problems, multipliers of ties (some, r), gains (some,)."""
        slopes, solved = [], []
        ties = self._rows[0].shape[1]
        inner, outer = np.zeros((len(some), ties, ties)), np.zeros((len(some), ties))
        for point, one, aims, rows in zip(y, self._sets, self._aims, self._rows, strict=True):
            slope, bend = _barrier(one, point[some])
            slope = slope - weight * aims[some]
            row = rows[some]
            right = np.concatenate([slope[..., None], row.transpose(0, 2, 1)], axis=2)
            both = np.linalg.solve(bend, right)
            inner += row @ both[..., 1:]
            outer += np.einsum("nri,ni->nr", row, both[..., 0])
            slopes.append(slope)
            solved.append(both)
        inverse = np.linalg.pinv(inner, rcond=_ROUNDING, hermitian=True)
        price = -np.einsum("nrs,ns->nr", inverse, outer)
        step = [-both[..., 0] - np.einsum("nir,nr->ni", both[..., 1:], price) for both in solved]
        pairs = zip(slopes, step, strict=True)
        gain = -sum(np.einsum("ni,ni->n", slope, way) for slope, way in pairs)
        return step, price, np.asarray(gain)

    def _move(
        self,
        y: list[np.ndarray],
        step: list[np.ndarray],
        gain: np.ndarray,
        weight: float,
        some: np.ndarray,
    ) -> None:
        """Take steps, each halved until it stays inside and goes down; or none."""
        before = self._height(y, weight, some)
        part, left = 1.0, np.arange(len(some))
        for _ in range(_SHORTER):
            at = some[left]
            trial = [place[at] + part * way[left] for place, way in zip(y, step, strict=True)]
            after = self._height(trial, weight, at, taken=True)
            good = after <= before[left] - 0.1 * part * gain[left] + 1e-9
            for point, moved in zip(y, trial, strict=True):
                point[at[good]] = moved[good]
            left, part = left[~good], 0.5 * part
            if not len(left):
                return

    def _height(
        self, y: list[np.ndarray], weight: float, some: np.ndarray, taken: bool = False
    ) -> np.ndarray:
        """Barrier less the weighted aim, infinite outside, of some problems, shape (some,)."""
        total = np.zeros(len(some))
        for places, one, aim in zip(y, self._sets, self._aims, strict=True):
            place = places if taken else places[some]
            total -= weight * np.einsum("ni,ni->n", aim[some], place)
            for wall in one.walls:
                left = wall.room - place @ wall.along
                inside = left**2 - ((place @ wall.across.T) ** 2).sum(axis=1)
                good = (left > 0.0) & (inside > 0.0)
                total -= np.where(good, np.log(np.where(good, inside, 1.0)), -np.inf)
        return total


def _barrier(cones: Cones, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slope (n, m) and curvature (n, m, m) of -sum log((room - along . y)^2 - |across @ y|^2)."""
    slope, bend = np.zeros_like(y), np.zeros((*y.shape, y.shape[1]))
    for wall in cones.walls:
        aside = y @ wall.across.T
        left = wall.room - y @ wall.along
        inside = left**2 - (aside**2).sum(axis=1)
        own = 2.0 * (left[:, None] * wall.along + aside @ wall.across) / inside[:, None]
        curve = 2.0 * (wall.across.T @ wall.across - np.outer(wall.along, wall.along))
        slope += own
        bend += curve / inside[:, None, None] + own[:, :, None] * own[:, None, :]
    return slope, bend


# How true the first order is in closed loops: the loops closed again with displaced journals.


_TRUE = 0.25
"""Part of the error by which the exact tool may be elsewhere than the linear one."""


def second_order_of_loops(
    mechanism: Mechanism,
    q: np.ndarray,
    parts: Sequence[Part],
    direction: np.ndarray,
    driven: Sequence[str] | None = None,
) -> np.ndarray:
    """Distance between the tool and its first order, journals being in their worst place, (n,) [m].

    Args:
        mechanism: with loops.
        q: closed configurations, shape (n, nq).
        parts: sources of play there.
        direction: in which the worst place is the farthest, shape (n, 3).
        driven: see `static_budget.budget`.

    Raises:
        JointplayError: near a singular position the loops go elsewhere, or cannot be closed.
    """
    drives = loops.driven_joints(mechanism, q[0], driven)
    passive = loops.passive_coordinates(mechanism, drives)
    states = along(parts, direction[:, None])
    away = np.zeros(len(q))
    for i, row in enumerate(q):
        aside = {part.name: states.point[j, i, 0] for j, part in enumerate(parts)}
        linear = states.error[:, i, 0, :3].sum(axis=0)
        here = tool_place(mechanism, row).translation
        exact = displaced(mechanism, row, passive, aside)
        largest = max(part.play.reach[0] for part in parts)
        size = max(float(np.linalg.norm(linear)), largest)
        if exact is not None:
            away[i] = float(np.linalg.norm(exact.translation - here - linear))
        if exact is None or away[i] > _TRUE * size:
            at = ", ".join(f"{name} {row[mechanism.coordinate(name)]:.6g}" for name in drives)
            pose = f" (pose {i + 1} of {len(q)})" if len(q) > 1 else ""
            what = (
                "the loops cannot be closed with the journals aside"
                if exact is None
                else f"they put the tool {1e3 * away[i]:.4g} mm from where the first order does"
            )
            raise JointplayError(
                f"near a singular position at {at}{pose}: {what}; leave this pose out, or simulate "
                "(jointplay run)"
            )
    return away


def displaced(
    mechanism: Mechanism, q: np.ndarray, passive: np.ndarray, aside: dict[str, np.ndarray]
) -> pin.SE3 | None:
    """Where the tool is, exactly, with journals displaced; None if the loops cannot be closed.

    Args:
        mechanism: with loops.
        q: a closed configuration, journals centred, shape (nq,).
        passive: coordinates that follow.
        aside: displacement and rotation vector of the child's body in bearing axes, by source of
            play, shape (6,) [m, rad].
    """
    own = {name: xi for name, xi in aside.items() if name not in mechanism.loops}
    moved = displaced_configuration(mechanism, q, own)
    at_loops = {
        name: pin.SE3(pin.exp3(xi[3:]), xi[:3])
        for name, xi in aside.items()
        if name in mechanism.loops
    }
    closed = loops.close_loops(mechanism, moved, passive, at_loops or None, closed=False)
    return None if closed is None else tool_place(mechanism, closed)


def displaced_configuration(
    mechanism: Mechanism, q: np.ndarray, aside: Mapping[str, np.ndarray]
) -> np.ndarray:
    """The configuration with journals of the tree and teeth displaced, shape (nq,).

    Args:
        mechanism: the machine.
        q: journals centred, shape (nq,).
        aside: see `displaced`; no joint that closes a loop.
    """
    moved = q.copy()
    gears = {name + GEAR: name for name in mechanism.gears}
    for name, xi in aside.items():
        if name in gears:
            moved[mechanism.coordinate(gears[name])] += xi[5]
        else:
            _push(mechanism, q, moved, name, xi)
    return moved


def _push(
    mechanism: Mechanism, q: np.ndarray, moved: np.ndarray, name: str, xi: np.ndarray
) -> None:
    """Displace a journal of the tree by its coordinates in `moved`."""
    model, data = mechanism.model, mechanism.data
    pin.forwardKinematics(model, data, q)
    index, axes = place(mechanism, name)
    first = index
    while mechanism.owner(model.parents[first]) == name:
        first = model.parents[first]
    seat = data.oMi[model.parents[first]] * model.jointPlacements[first]
    seen = seat.rotation.T @ axes.rotation
    arm = seat.rotation.T @ (data.oMi[index].translation - axes.translation)
    turn = pin.exp3(seen @ xi[3:])
    shift = seen @ xi[:3] + turn @ arm - arm
    at = {
        part: mechanism.coordinates.index(Coordinate(name, part))
        for part in mechanism.clearance[name].freedoms
    }
    for part, value in zip("xyz", shift, strict=True):
        if part in at:
            moved[at[part]] += value
    angles = [q[at[part]] if part in at else 0.0 for part in ("roll", "pitch", "yaw")]
    turned = pin.rpy.matrixToRpy(turn @ pin.rpy.rpyToMatrix(*angles))
    for part, value in zip(("roll", "pitch", "yaw"), turned, strict=True):
        if part in at:
            # The same turn, not one more.
            moved[at[part]] = value + 2.0 * np.pi * round((q[at[part]] - value) / (2.0 * np.pi))
