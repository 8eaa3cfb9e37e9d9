"""How true the first order is in closed loops: the loops closed again with displaced journals."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from jointplay.analysis import closing, together
from jointplay.analysis.levers import GEAR, Part, place, tool_place
from jointplay.errors import JointplayError
from jointplay.mechanism.mechanism import Mechanism

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
    drives = closing.driven_joints(mechanism, q[0], driven)
    passive = closing.passive_coordinates(mechanism, drives)
    states = together.along(parts, direction[:, None])
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
    moved, loops = q.copy(), {}
    for name, xi in aside.items():
        turn = pin.exp3(xi[3:])
        if name in mechanism.loops:
            loops[name] = pin.SE3(turn, xi[:3])
        elif name.endswith(GEAR):
            moved[mechanism.coordinate(name.removesuffix(GEAR))] += xi[5]
        else:
            _push(mechanism, q, moved, name, xi)
    closed = closing.solved(mechanism, moved, passive, loops or None, closed=False)
    return None if closed is None else tool_place(mechanism, closed)


def _push(
    mechanism: Mechanism, q: np.ndarray, moved: np.ndarray, name: str, xi: np.ndarray
) -> None:
    """Displace a journal of the tree by its coordinates in `moved`."""
    model, data = mechanism.model, mechanism.data
    pin.forwardKinematics(model, data, q)
    index, axes = place(mechanism, name)
    first = index
    while model.names[model.parents[first]].split(".")[0] == name:
        first = model.parents[first]
    seat = data.oMi[model.parents[first]] * model.jointPlacements[first]
    seen = seat.rotation.T @ axes.rotation
    arm = seat.rotation.T @ (data.oMi[index].translation - axes.translation)
    turn = pin.exp3(seen @ xi[3:])
    shift = seen @ xi[:3] + turn @ arm - arm
    at = {
        part: mechanism.coordinates.index(f"{name}.{part}")
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
