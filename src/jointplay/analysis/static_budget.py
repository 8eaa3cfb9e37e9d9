"""Error budget: how far play lets the tool be off, at many poses, and which joint is to blame.

No dynamics. Each joint's play is an exact set of small displacements (`statics`); through its
Jacobian it displaces the tool. What all joints can do together is the sum of these sets, whose
support function is the sum of theirs: the worst case along a direction is a sum over joints, and
each joint has its share. The drives hold the joints where the encoders say.
"""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jointplay.analysis import together
from jointplay.analysis.exact_loops import second_order_of_loops
from jointplay.analysis.levers import Part, configurations, sources, tool_place
from jointplay.mechanism.mechanism import Mechanism

DIRECTIONS = 180
"""Directions over half a sphere among which the worst one is sought, before it is refined."""
_REFINEMENTS = 6
AXES = ("x", "y", "z", "about x", "about y", "about z")
"""Components of the tool's error, in world axes [m, rad]."""


@dataclass(frozen=True)
class Budget:
    """Error of the tool at n poses, by j sources of play; lengths in m, angles in rad.

    `worst` is a bound that can be reached: no state of the journals without penetration is worse,
    up to `second_order`. `rest` and `rms` are states of rest without friction.
    """

    tool: str
    joints: tuple[str, ...]
    """Sources of play, gears last."""
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
    rest: np.ndarray
    """Error at rest under gravity and the tool's load, without friction, by joint, (n, j, 6)."""
    rms: np.ndarray
    """RMS distance, if a load on the tool that exceeds all others has a random direction, (n,)."""
    rms_parts: np.ndarray
    """What each joint adds to `rms`: its mean part along the error, shape (n, j)."""
    second_order: np.ndarray
    """What rotations of the second order can add to `worst` at most, shape (n,)."""
    search: float
    """Part by which the search over directions can have missed `worst`, at most."""
    excess: float
    """Part by which the plays' own second order widened the sets, at most."""
    sources: tuple[Part, ...]
    """What each joint's play is, and how it moves the tool."""
    loops: bool = False
    """Whether closed loops lead the play to the tool: then `second_order` is no bound, but by how
    much the loops, closed exactly with the journals of `worst`, put the tool elsewhere."""

    @property
    def worst_pose(self) -> int:
        """Index of the pose with the largest error."""
        return int(self.worst.argmax())

    @property
    def shares(self) -> np.ndarray:
        """Each joint's share of the worst case at the worst pose, sum one, shape (j,)."""
        parts = self.worst_parts[self.worst_pose]
        return np.asarray(parts / parts.sum()) if parts.sum() > 0.0 else parts

    @property
    def rest_error(self) -> np.ndarray:
        """Distance of the tool at rest from the ideal one, shape (n,) [m]."""
        return np.asarray(np.linalg.norm(self.rest.sum(axis=1)[:, :3], axis=1))

    def table(self, pose: int | None = None) -> str:
        """The budget at a pose, by default the worst one, as text [mm, mrad]."""
        at = self.worst_pose if pose is None else pose
        total = max(float(self.worst_parts[at].sum()), 1e-300)
        rows = [
            "joint                       worst case [mm]  share   at rest [mm]  rms [mm]  "
            "worst turn [mrad]"
        ]

        def row(name: str, values: Sequence[float], share: str) -> str:
            worst, rest, rms, turn = values
            return (
                f"{name:<27} {worst:>15.4f}  {share:>5}  {rest:>13.4f} {rms:>9.4f}  {turn:>17.4f}"
            )

        for j, name in enumerate(self.joints):
            values = (
                1e3 * self.worst_parts[at, j],
                1e3 * float(np.linalg.norm(self.rest[at, j, :3])),
                1e3 * self.rms_parts[at, j],
                1e3 * self.turn_parts[at, j],
            )
            rows.append(row(name, values, f"{100 * self.worst_parts[at, j] / total:.1f}%"))
        whole = (
            1e3 * self.worst[at],
            1e3 * self.rest_error[at],
            1e3 * self.rms[at],
            1e3 * self.worst_turn[at],
        )
        rows.append(row("all", whole, "100%" if self.worst[at] > 0.0 else "-"))
        axes = self.axis_worst[at].sum(axis=0)
        rows.append(
            "worst case along x, y, z: "
            + ", ".join(f"{1e3 * value:.4f}" for value in axes[:3])
            + " mm; about x, y, z: "
            + ", ".join(f"{1e3 * value:.4f}" for value in axes[3:])
            + " mrad"
        )
        return "\n".join(rows)

    @property
    def accuracy(self) -> str:
        """With which error the numbers are known, one line."""
        at = self.worst_pose
        more = f"{1e6 * self.second_order[at]:.3g} um"
        second = (
            f"loops closed exactly put the tool {more} elsewhere"
            if self.loops
            else f"rotations of second order up to {more}"
        )
        return (
            f"static, rigid contact; worst case missed by at most {100 * self.search:.2g} % "
            f"(directions), too large by at most {100 * self.excess:.2g} % (lean of the journals, "
            f"second order), {second}"
        )

    def csv(self) -> str:
        """A row for each pose: tool, errors, parts of each joint [m, rad]."""
        out = io.StringIO()
        head = ["pose", "tool_x_m", "tool_y_m", "tool_z_m", "worst_m", "worst_turn_rad", "rest_m"]
        head += ["rms_m", "second_order_m"]
        head += [
            f"worst_{axis.replace(' ', '_')}_{'m' if i < 3 else 'rad'}"
            for i, axis in enumerate(AXES)
        ]
        head += [f"worst_part_{name}_m" for name in self.joints]
        out.write(",".join(head) + "\n")
        rest, axes = self.rest_error, self.axis_worst.sum(axis=1)
        for i in range(len(self.worst)):
            row = [*self.positions[i], self.worst[i], self.worst_turn[i], rest[i], self.rms[i]]
            row += [self.second_order[i], *axes[i], *self.worst_parts[i]]
            out.write(f"{i}," + ",".join(f"{value:.9g}" for value in row) + "\n")
        return out.getvalue()


def budget(
    mechanism: Mechanism,
    poses: np.ndarray | Mapping[str, float],
    *,
    force: Sequence[float] = (0.0, 0.0, 0.0),
    second_order: bool = True,
    driven: Sequence[str] | None = None,
) -> Budget:
    """How far the play of all joints and gears lets the tool be off, without dynamics.

    In closed loops the driven joints stand and the others follow, to the first order; joints
    outside the loops stand.

    Args:
        mechanism: with clearance in some joints, or gears with play.
        poses: joint positions by name [rad or m], the rest zero; or configurations, (n, nq). Loops
            that are open there are closed by the joints that are not driven.
        force: on the tool, besides gravity, in world axes, shape (3,) [N].
        second_order: widen the sets so that they contain all poses without penetration; without,
            all errors are proportional to the clearances.
        driven: joints of loops that stand; None: the first that determine the others.

    Raises:
        JointplayError: nothing has play; a pose of the wrong shape; a force that is no vector; an
            axis without limit that the tool feels; loops that cannot be closed, or near a singular
            position, where the first order does not hold.
        MissingName: no such joint.
    """
    q = configurations(mechanism, poses, driven)
    parts = sources(mechanism, q, force=force, second_order=second_order, driven=driven, loops=True)
    n = len(parts[0].move)
    positions = np.array([tool_place(mechanism, row).translation for row in q])
    axes = np.broadcast_to(np.eye(3), (n, 3, 3))
    both = [together.along(parts, axes, turn).value for turn in (False, True)]
    axis_worst = np.concatenate(both, axis=2).transpose(1, 0, 2)
    worst, direction, worst_parts, errors = _farthest(parts, n, turn=False)
    worst_turn, _, turn_parts, _ = _farthest(parts, n, turn=True)
    # The states that a load of random direction brings about are those just found.
    total = errors.sum(axis=0)
    mean = (total**2).sum(axis=2).mean(axis=1)
    rms = np.sqrt(mean)
    share = np.einsum("jnmk,nmk->nj", errors, total) / total.shape[1]
    rms_parts = np.divide(share, rms[:, None], out=np.zeros_like(share), where=rms[:, None] > 0.0)
    rest = together.at_rest(parts).error[:, :, 0].transpose(1, 0, 2)
    if mechanism.loops:
        more = second_order_of_loops(mechanism, q, parts, direction, driven)
    else:
        more = _second_order(parts)
    return Budget(
        mechanism.tool,
        tuple(part.name for part in parts),
        positions,
        axis_worst,
        worst,
        direction,
        worst_parts,
        worst_turn,
        turn_parts,
        rest,
        rms,
        rms_parts,
        more,
        1.0 / np.cos(_covering()) - 1.0,
        max(part.play.excess for part in parts),
        parts,
        bool(mechanism.loops),
    )


def half_sphere(count: int = DIRECTIONS) -> np.ndarray:
    """Directions evenly over half a sphere (Fibonacci lattice), shape (count, 3)."""
    i = np.arange(count)
    z = 1.0 - (i + 0.5) / count
    r, phi = np.sqrt(1.0 - z * z), i * np.pi * (3.0 - np.sqrt(5.0))
    return np.column_stack([r * np.cos(phi), r * np.sin(phi), z])


def _covering() -> float:
    """Largest angle between any direction and the nearest of `half_sphere` or its mirror [rad]."""
    fine = half_sphere(20 * DIRECTIONS)
    return float(np.arccos(np.abs(fine @ half_sphere().T).max(axis=1).min()))


def _farthest(
    parts: Sequence[Part], n: int, turn: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Largest displacement (or rotation) at each pose: (n,), where to (n, 3), by part (n, j).

    From the best of many directions on, d is replaced by the direction of the point that is
    farthest along d; each time it is no less far. Also the errors of each part along all
    directions, (j, n, directions, 3).
    """
    wanted = slice(3, 6) if turn else slice(0, 3)
    directions = np.broadcast_to(half_sphere(), (n, DIRECTIONS, 3))
    found = together.along(parts, directions, turn)
    errors = found.error[..., wanted]
    best = found.value.sum(axis=0).argmax(axis=1)
    d = directions[np.arange(n), best]
    for _ in range(_REFINEMENTS):
        total = together.along(parts, d[:, None], turn).error.sum(axis=0)[:, 0, wanted]
        size = np.linalg.norm(total, axis=1, keepdims=True)
        d = np.where(size > 0.0, total / np.where(size > 0.0, size, 1.0), d)
    shares = together.along(parts, d[:, None], turn).value[:, :, 0].T
    return shares.sum(axis=1), d, shares, errors


def _second_order(parts: Sequence[Part]) -> np.ndarray:
    """What products of small rotations can add to the tool's displacement, at most, (n,) [m].

    A rotation by theta about a centre at the distance r adds theta^2 r / 2 to its linear part; one
    nearer to the base turns what the others have displaced.
    """
    total = np.zeros(len(parts[0].move))
    turned = np.zeros_like(total)
    for part in parts:
        aside, angle = part.play.reach
        arms = np.linalg.norm(part.move[:, :3, 3:], axis=(1, 2)) / np.sqrt(2.0)
        felt = np.abs(part.move).max(axis=(1, 2)) > 0.0
        moved = np.where(felt, aside + angle * arms, 0.0)
        total += np.where(felt, 0.5 * angle**2 * arms, 0.0) + turned * moved
        turned += np.where(felt, angle, 0.0)
    return total
