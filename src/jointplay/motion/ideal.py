"""The ideal mechanism along a reference motion: what a computed-torque drive knows of it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pinocchio as pin
from tqdm import tqdm

from jointplay.errors import JointplayError
from jointplay.mechanism.loop import assemble, closing_rows, follow
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion

LOOP_NODE_S = 1e-3
"""Interval at which loops are closed along the motion; between, a quintic spline [s]."""

_PORTION = 20_000
"""Times at which a tree's motion is held in memory at once."""

_PATIENCE_S = 1.0
"""What takes longer has a bar [s]."""


def ideal_motion(
    mechanism: Mechanism,
    motion: Motion,
    driven: Sequence[str],
    times: np.ndarray,
    start: np.ndarray,
    progress: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Inverse dynamics of the ideal mechanism along `motion`.

    In a tree, joints that are not driven stand where they start. In a mechanism with loops they
    follow; their inertia and weight appear at the driven joints.

    Args:
        mechanism: with its clearance, which is left out.
        motion: reference of the driven joints.
        driven: names of the joints that follow it.
        times: where it is wanted, at equal intervals, shape (n,) [s].
        start: configuration of `mechanism` at the start, shape (nq,).
        progress: show a bar on standard error if it takes longer than `_PATIENCE_S`.

    Returns:
        Efforts of the ideal mechanism's drives, shape (n, driven) [N m or N], and the inertia that
        each driven joint carries at the start, shape (driven,) [kg m^2 or kg].

    Raises:
        JointplayError: loops that cannot be closed along the motion, or a configuration in which
            the driven joints do not determine the others.
    """
    ideal = mechanism.ideal()
    order = [motion.joints.index(name) for name in driven]
    at = [ideal.coordinate(name) for name in driven]
    base = _ideal_configuration(mechanism, ideal, start)
    if ideal.loops:
        return _with_loops(ideal, motion, order, at, times, base, progress)
    model, data = ideal.model, ideal.data
    effort = np.empty((len(times), len(at)))
    for first in _shown(range(0, len(times), _PORTION), progress):
        portion = times[first : first + _PORTION]
        q, v, a = (np.zeros((len(portion), model.nv)) for _ in range(3))
        q[:] = base
        q[:, at], v[:, at], a[:, at] = (values[:, order] for values in motion(portion))
        for i, state in enumerate(zip(q, v, a, strict=True), first):
            effort[i] = pin.rnea(model, data, *state)[at]
    q = base.copy()
    q[at] = motion(times[:1])[0][0, order]
    inertia = pin.crba(model, data, q).reshape(model.nv, model.nv).diagonal()
    return effort, inertia[at]


def _shown(things: Sequence[int], progress: bool) -> Iterable[int]:
    """`things`, with a bar of how many have been taken if that takes long."""
    bar: Iterable[int] = tqdm(
        things,
        "tabulating the motion",
        disable=not progress,
        delay=_PATIENCE_S,
        leave=False,
        bar_format="{desc} {percentage:3.0f}%|{bar}| {remaining} left",
    )
    return bar


def _ideal_configuration(mechanism: Mechanism, ideal: Mechanism, q: np.ndarray) -> np.ndarray:
    """Configuration of the ideal mechanism whose joints stand as those of `mechanism` do."""
    found = np.zeros(ideal.model.nq)
    for name in ideal.joints:
        if name in ideal.coordinates:
            found[ideal.coordinates.index(name)] = q[mechanism.coordinate(name)]
        else:  # a ball
            for part in ("yaw", "pitch", "roll"):
                coordinate = f"{name}.{part}"
                found[ideal.coordinates.index(coordinate)] = q[
                    mechanism.coordinates.index(coordinate)
                ]
    return found


def _with_loops(
    ideal: Mechanism,
    motion: Motion,
    order: list[int],
    at: list[int],
    times: np.ndarray,
    base: np.ndarray,
    progress: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """Efforts (n, driven) and inertia (driven,) by projection on the driven joints.

    With q' = G q_driven' the loops' constraint forces do no work, and tau_driven = G^T rnea(q, q',
    q''); Nikravesh, Computer-Aided Analysis of Mechanical Systems, 1988, calls it the joint
    coordinate method.
    """
    end = max(times[-1], LOOP_NODE_S)
    nodes = np.linspace(0.0, end, max(round(end / LOOP_NODE_S), 6) + 1)
    positions = motion(nodes)[0][:, order]
    q = np.empty((len(nodes), ideal.model.nq))
    maps = np.empty((len(nodes), ideal.model.nv, len(at)))
    guess = base
    for i in _shown(range(len(nodes)), progress):
        if i:
            guess = guess + maps[i - 1] @ (positions[i] - guess[at])
            guess[at] = positions[i]
            guess = follow(ideal, guess, at)
        else:
            guess = guess.copy()
            guess[at] = positions[0]
            guess = assemble(ideal, guess, at)
        q[i], maps[i] = guess, driven_map(ideal, guess, at)
    from scipy.interpolate import make_interp_spline

    curve = make_interp_spline(nodes, q, k=5)
    model, data = ideal.model, ideal.data
    states = (curve(nodes), curve(nodes, 1), curve(nodes, 2))
    full = np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])
    effort = np.einsum("nvd,nv->nd", maps, full)
    mass = pin.crba(model, data, q[0]).reshape(model.nv, model.nv)
    mass = np.triu(mass) + np.triu(mass, 1).T
    inertia = np.einsum("vd,vw,wd->d", maps[0], mass, maps[0])
    return make_interp_spline(nodes, effort, k=3)(np.minimum(times, end)), inertia


def driven_map(mechanism: Mechanism, q: np.ndarray, at: Sequence[int]) -> np.ndarray:
    """Velocities of all coordinates per velocity of the driven ones, shape (nv, driven).

    Raises:
        JointplayError: the driven coordinates do not determine the others (a singular
            configuration, or too few drives).
    """
    rows = closing_rows(mechanism, q)
    rest = np.setdiff1d(np.arange(mechanism.model.nv), at)
    block = rows[:, rest]
    values = np.linalg.svd(block, compute_uv=False)
    if len(rest) and (len(values) < len(rest) or values[-1] < 1e-8 * values[0]):
        raise JointplayError(
            "the driven joints do not determine the loops' other joints here (a singular "
            "configuration, or too few driven joints)"
        )
    found = np.zeros((mechanism.model.nv, len(at)))
    found[at, np.arange(len(at))] = 1.0
    if len(rest):  # none: a door on two hinges
        found[rest] = -np.linalg.lstsq(block, rows[:, at], rcond=None)[0]
    return found
