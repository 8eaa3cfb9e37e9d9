"""Inverse dynamics of the ideal mechanism along a reference: the feed-forward of computed torque.

Three kinds of mechanism, three ways. A tree: the recursive Newton-Euler algorithm (`pin.rnea`) at
each time. Closed loops: they are closed at nodes, splines through the nodes give velocities and
accelerations, and efforts are projected on the driven joints. A free base: its motion follows from
the momentum of the whole.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.progress import ProgressBar
from jointplay.model.free_base import ANGLES, rotation
from jointplay.model.loop import assemble, closing_rows, follow
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.motion.reference import REFERENCE_NODE_S, Motion

LOOP_NODE_S = 1e-3
"""Interval of the nodes at which loops are closed along the motion; a quintic spline lies between
[s]."""
_SPLINE_MARGIN = 60
"""Nodes beyond the times asked for: the effect of a spline's end falls to 0.43 or less a node."""
_BLOCKS_BEHIND = 3
"""Number of calls of `efforts` whose last closed configurations are kept."""
_PORTION = 20_000
"""Number of times at which a tree's motion is in memory at once."""
_BASE = slice(0, 6)
"""Coordinates of a free base."""
_PATIENCE_S = 1.0
"""Time after which work shows a bar [s]."""


class IdealMotion:
    """Inverse dynamics of the ideal mechanism along `motion`.

    In a tree, joints that are not driven stand where they start. In a mechanism with loops they
    follow; their inertia and weight appear at the driven joints. With q' = G q_driven' the loops'
    constraint forces do no work, and tau_driven = G^T rnea(q, q', q''); Nikravesh, Computer-Aided
    Analysis of Mechanical Systems, 1988, calls it the joint coordinate method.

    A free base moves as the momentum of the whole demands, which nothing but gravity changes here:
    from q'' of the joints its six equations give its acceleration, and this the efforts, by partial
    feedback linearisation (M. W. Spong, IROS 1994, 314-321). Wrenches on it are unknown to the
    drives, as all loads are.

    Args:
        mechanism: the mechanism, of which clearance is left out.
        motion, driven: a reference, and the joints that follow it.
        end: last time that will be asked for [s].
        start, speed: state of `mechanism` at the start, shapes (nq,) and (nv,); without a speed a
            free base is at rest.

    Attributes:
        inertia: inertia that each driven joint carries at the start, shape (driven,) [kg m^2 or
            kg]; with a free base the part that is left as the base gives way.

    Raises:
        JointplayError: loops that cannot be closed at the start, or a configuration in which the
            driven joints do not determine the others.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        motion: Motion,
        driven: Sequence[str],
        end: float,
        start: np.ndarray,
        speed: np.ndarray | None = None,
    ) -> None:
        self._ideal = ideal = mechanism.ideal()
        self._motion = motion
        self._order = [motion.joints.index(name) for name in driven]
        self._at = [ideal.coordinate(name) for name in driven]
        self._base = _ideal_configuration(mechanism, ideal, start)
        self._end = max(end, LOOP_NODE_S)
        self._nodes = max(round(self._end / LOOP_NODE_S), 6) + 1
        self._closed: dict[int, np.ndarray] = {}
        """Configurations, by node, from which loops are closed further on."""
        q = self._base.copy()
        q[self._at] = motion(np.zeros(1))[0][0, self._order]
        if ideal.loops:
            self._closed[0] = q = assemble(ideal, q, self._at)
        mass = ideal.mass_matrix(q)
        self.inertia = mass.diagonal()[self._at]
        if ideal.loops:
            ratios = driven_map(ideal, q, self._at)
            self.inertia = np.einsum("vd,vw,wd->d", ratios, mass, ratios)
        self._momentum = np.zeros(3)
        """Angular momentum about the centre of mass, axes of the base at the start [kg m^2/s]."""
        if ideal.free_base is not None:
            # The base gives way: of the inertia its Schur complement is left.
            moved = mass[_BASE, self._at]
            given_way = np.linalg.solve(mass[_BASE, _BASE], moved)
            self.inertia = self.inertia - np.einsum("bd,bd->d", moved, given_way)
            v = np.zeros_like(q)
            if speed is not None:
                v = _ideal_configuration(mechanism, ideal, speed)
            pin.ccrba(ideal.model, ideal.data, q, v)
            self._momentum = rotation(q[ANGLES]).T @ ideal.data.hg.angular
            self._base[_BASE] = 0.0

    def efforts(self, times: np.ndarray, progress: bool = False) -> np.ndarray:
        """Efforts of the ideal mechanism's drives, shape (n, driven) [N m or N].

        Args:
            times: nodes `REFERENCE_NODE_S` apart, one or more, shape (n,) [s]; those of a mechanism
                with loops go on where the last ones ended, or begin at 0.
            progress: show a bar on standard error if it takes longer than `_PATIENCE_S`.

        Raises:
            JointplayError: loops that cannot be closed along the motion.
        """
        if self._ideal.loops:
            return self._with_loops(times, progress)
        if self._ideal.free_base is not None:
            return self._with_free_base(times, progress)
        model, data, at = self._ideal.model, self._ideal.data, self._at
        effort = np.empty((len(times), len(at)))
        for first in _shown(range(0, len(times), _PORTION), progress):
            states = self._on_reference(times[first : first + _PORTION])
            for i, state in enumerate(zip(*states, strict=True), first):
                effort[i] = pin.rnea(model, data, *state)[at]
        return effort

    def alike(self) -> tuple[tuple[object, ...], pin.Model] | None:
        """All that efforts depend on besides motion and times; None: on earlier calls, in loops."""
        if self._ideal.loops:
            return None
        state = self._base.tobytes(), self._momentum.tobytes()
        return (*state, tuple(self._at), tuple(self._order)), self._ideal.model

    def states(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Configurations and velocities with the driven joints on their reference, (n, nv) each.

        `times` must rise; the base is held.

        Raises:
            JointplayError: loops that cannot be closed along the motion.
        """
        if self._ideal.loops:
            curve = self._closed_curve(times, False)[0]
            return curve(times), curve(times, 1)
        q, v, _ = self._on_reference(times)
        return q, v

    def _on_reference(self, times: np.ndarray) -> tuple[np.ndarray, ...]:
        """Configurations, velocities and accelerations with the driven joints on their reference
        and all others at rest where they start, (n, nv) each.
        """
        q, v, a = (np.zeros((len(times), self._ideal.model.nv)) for _ in range(3))
        q[:] = self._base
        for values, reference in zip((q, v, a), self._motion(times), strict=True):
            values[:, self._at] = reference[:, self._order]
        return q, v, a

    def memory(self) -> dict[str, list[float]]:
        """Closed configurations, for checkpoints: efforts then go on bit for bit."""
        return {str(node): q.tolist() for node, q in self._closed.items()}

    def recall(self, memory: Mapping[str, Sequence[float]]) -> None:
        self._closed = {int(node): np.array(q, float) for node, q in memory.items()}

    def _with_free_base(self, times: np.ndarray, progress: bool) -> np.ndarray:
        """Efforts with the motion of the base that keeps the angular momentum of the whole.

        They do not depend on where the base is, how it is turned, or how fast all moves along and
        falls together: at each instant the base stands at its origin, and only turns.
        """
        model, data, at = self._ideal.model, self._ideal.data, self._at
        effort = np.empty((len(times), len(at)))
        turn = np.eye(3)  # orientation of the base, from where it began
        for i in range(round(times[0] / REFERENCE_NODE_S) if self._momentum.any() else 0):
            turn = self._turned(i * REFERENCE_NODE_S, turn)
        for i in _shown(range(len(times)), progress):
            q, v, a = self._free_state(times[i], turn)
            # The base accelerates so that no wrench on it is needed.
            lacking = pin.rnea(model, data, q, v, a)[_BASE].copy()
            mass = self._ideal.mass_matrix(q)[_BASE, _BASE]
            a[_BASE] = -np.linalg.solve(mass, lacking)
            effort[i] = pin.rnea(model, data, q, v, a)[at]
            turn = self._turned(times[i], turn)
        return effort

    def _turned(self, time: float, turn: np.ndarray) -> np.ndarray:
        """Orientation of the base one node after `time` and `turn`, by Heun's method."""
        if not self._momentum.any():
            return turn
        span = REFERENCE_NODE_S
        # Rates of yaw, pitch and roll, at zero angles the angular velocity about z, y and x.
        now = self._free_state(time, turn)[1][ANGLES][::-1]
        later = self._free_state(time + span, turn @ pin.exp3(span * now))[1][ANGLES][::-1]
        turned: np.ndarray = turn @ pin.exp3(0.5 * span * (now + later))
        return turned

    def _free_state(
        self, time: float, turn: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Configuration, velocities, and accelerations of the joints, the base at its origin.

        The base, turned by `turn` since the start, moves so that the whole keeps its momentum.
        """
        q, v, a = (rows[0] for rows in self._on_reference(np.array([time])))
        data = self._ideal.data
        pin.ccrba(self._ideal.model, data, q, v)
        lacking = np.concatenate([-data.hg.linear, turn.T @ self._momentum - data.hg.angular])
        v[_BASE] = np.linalg.solve(data.Ag[:, _BASE], lacking)
        return q, v, a

    def _closed_curve(
        self, times: np.ndarray, progress: bool
    ) -> tuple[Any, np.ndarray, np.ndarray]:
        """Spline of configurations through nodes at which the loops are closed, times of the nodes,
        and the `driven_map` at each.

        The nodes go on beyond both ends of `times`, so that the curve does not depend on which
        times are asked for at once: the effect of a spline's end has fallen to rounding after
        `_SPLINE_MARGIN` nodes.
        """
        ideal, motion, at = self._ideal, self._motion, self._at
        interval = self._end / (self._nodes - 1)
        low = max(math.floor(times[0] / interval) - _SPLINE_MARGIN, 0)
        high = min(math.ceil(times[-1] / interval) + _SPLINE_MARGIN, self._nodes - 1)
        further = math.floor(times[-1] / interval) - _SPLINE_MARGIN
        begin = max(node for node in self._closed if node <= low)
        node_times = np.arange(begin, high + 1) * interval
        if high == self._nodes - 1:
            node_times[-1] = self._end
        nodes, places = node_times[low - begin :], motion(node_times)[0][:, self._order]
        q = np.empty((len(nodes), ideal.model.nq))
        maps = np.empty((len(nodes), ideal.model.nv, len(at)))
        # From node to node: predicted by the driven map, then closed.
        guess = self._closed[begin]
        last = driven_map(ideal, guess, at)
        for i in _shown(range(begin, high + 1), progress):
            if i > begin:
                place = places[i - begin]
                guess = guess + last @ (place - guess[at])
                guess[at] = place
                guess = follow(ideal, guess, at)
                last = driven_map(ideal, guess, at)
            if i == further:
                self._closed[i] = guess.copy()
                for old in sorted(self._closed)[1:-_BLOCKS_BEHIND]:
                    del self._closed[old]
            if i >= low:
                q[i - low], maps[i - low] = guess, last
        from scipy.interpolate import make_interp_spline  # takes long to import

        return make_interp_spline(nodes, q, k=5), nodes, maps

    def _with_loops(self, times: np.ndarray, progress: bool) -> np.ndarray:
        """Efforts at the nodes, tau_driven = G^T rnea, with a cubic spline through them."""
        from scipy.interpolate import make_interp_spline  # takes long to import

        ideal = self._ideal
        curve, nodes, maps = self._closed_curve(times, progress)
        states = (curve(nodes), curve(nodes, 1), curve(nodes, 2))
        model, data = ideal.model, ideal.data
        full = np.array([pin.rnea(model, data, *state) for state in zip(*states, strict=True)])
        effort = np.einsum("nvd,nv->nd", maps, full)
        efforts: np.ndarray = make_interp_spline(nodes, effort, k=3)(np.minimum(times, self._end))
        return efforts


def _shown(nodes: Sequence[int], progress: bool) -> Iterable[int]:
    """Nodes with a progress bar."""
    label = "tabulating the motion"
    return ProgressBar(nodes, label, disable=not progress, delay=_PATIENCE_S, leave=False)


def _ideal_configuration(mechanism: Mechanism, ideal: Mechanism, q: np.ndarray) -> np.ndarray:
    """Configuration of the ideal mechanism whose joints stand as those of `mechanism` do."""
    names = mechanism.coordinates
    places = [
        names.index(coordinate) if coordinate in names else mechanism.coordinate(coordinate.joint)
        for coordinate in ideal.coordinates
    ]
    return q[np.array(places, int)]


def driven_map(mechanism: Mechanism, q: np.ndarray, at: Sequence[int]) -> np.ndarray:
    """The map G from velocities of the driven coordinates to those of all, shape (nv, driven).

    Raises:
        JointplayError: the driven coordinates do not determine the others (a singular
            configuration, or too few drives).
    """
    rows = closing_rows(mechanism, q)
    led = np.setdiff1d(np.arange(mechanism.model.nv), at)
    block = rows[:, led]
    _, values, motions = np.linalg.svd(block)
    held = int(np.count_nonzero(values >= 1e-8 * values.max(initial=0.0)))
    if held < len(led):  # name what the null space of the loops' Jacobian moves
        sizes = np.abs(motions[held:]).max(axis=0)
        names, driven = (
            ", ".join(dict.fromkeys(repr(mechanism.coordinates[i].joint) for i in some))
            for some in (led[sizes > 1e-6], at)
        )
        outside = dict.fromkeys(
            repr(mechanism.coordinates[i].joint) for i in led if np.abs(rows[:, i]).max() < 1e-9
        )
        if outside:
            raise JointplayError(
                f"nothing determines {', '.join(outside)}: no loop leads it, nor the motion of "
                f"{driven or 'no joint'}; name it there, or take another drive than computed-torque"
            )
        raise JointplayError(
            f"the driven joints ({driven or 'none'}) do not determine these: {names} (too few, or "
            "a singular configuration); drive one of them, too, or begin in another configuration"
        )
    ratios = np.zeros((mechanism.model.nv, len(at)))
    ratios[at, np.arange(len(at))] = 1.0
    if len(led):  # none: a door on two hinges
        ratios[led] = -np.linalg.lstsq(block, rows[:, at], rcond=None)[0]
    return ratios
