"""From the loads of a simulation to what the kernels know of them, and who samples when."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, cast

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError
from jointplay.kernel.sites import LoadSite
from jointplay.kernel.workspace import Workspace
from jointplay.loads.base import Load, Site, address
from jointplay.loads.controller import Controller, hold
from jointplay.mechanism.mechanism import Mechanism
from jointplay.mechanism.placed import signs_between
from jointplay.mechanism.urdf import MOST_LETTERS

LARGEST_STEP_TURN = 1.0
"""Step times natural frequency of springs above which it is refused: 6 steps a period [rad]."""

FINE_STEP_TURN = 0.2
"""The same that is advised: the period is then right to 0.2 % [rad]."""


def check(loads: Mapping[str, Load]) -> None:
    """Refuse what is no load."""
    if not isinstance(loads, Mapping):
        raise JointplayError(f"loads must be given by name, as {{'spring': ...}}, got {loads!r}")
    for name, load in loads.items():
        if not isinstance(name, str) or not name or not name.isprintable():
            raise JointplayError(f"the name of a load must be readable text, got {name!r}")
        if len(name) > MOST_LETTERS:
            raise JointplayError(
                f"the name of a load has {len(name)} letters; at most {MOST_LETTERS} are possible"
            )
        if not isinstance(load, Load):
            raise JointplayError(f"{name!r} must be a load such as jp.loads.Spring, got {load!r}")


def load_site(load: Load, mechanism: Mechanism, bounds: Mapping[str, float]) -> LoadSite:
    """What the kernels must know of a load.

    Args:
        load: what acts.
        mechanism: on what.
        bounds: largest efforts of actuators by joint, to which they are cut [N m or N].
    """
    site = load.site(mechanism)
    law, numbers = address(load), load.numbers(mechanism)
    if site.frames is None:
        largest = tuple(bounds.get(name, math.inf) for name in load.driven())
        cut = largest if any(math.isfinite(one) for one in largest) else ()
        return LoadSite(law, numbers, load.stores, load.implicit(), site.seen, site.pushed, cut)
    (i, _), (j, _) = site.frames
    return LoadSite(
        law,
        numbers,
        load.stores,
        load.implicit(),
        carriers=site.frames,
        signs=signs_between(mechanism.model, i, j),
    )


def check_step(loads: Mapping[str, Load], mechanism: Mechanism, step: float, q: np.ndarray) -> None:
    """Refuse a step too large for the loads' springs, all together.

    Raises:
        JointplayError: naming the stiffest one.
    """
    model, data = mechanism.model, mechanism.model.createData()
    inverse = pin.computeMinverse(model, data, q)
    inverse = np.triu(inverse) + np.triu(inverse, 1).T
    rows, names = [], []
    for name, load in loads.items():
        if load.steepest() > 0.0:
            names.append(name)
            rows.append(np.sqrt(load.steepest()) * _direction(load.site(mechanism), model, data, q))
    if not rows:
        return
    springs = np.array(rows)
    squares = springs @ inverse @ springs.T
    frequency = float(np.sqrt(max(np.linalg.eigvalsh(squares)[-1], 0.0)))
    if frequency * step > LARGEST_STEP_TURN:
        stiffest = names[int(np.argmax(np.diag(squares)))]
        raise JointplayError(
            f"step {step:g} s is too large for the load {stiffest!r}: the mechanism would swing on "
            f"its springs at {frequency / (2.0 * np.pi):.3g} Hz, so take at most "
            f"{FINE_STEP_TURN / frequency:.2g} s",
            where=("step",),
        )


def _direction(site: Site, model: pin.Model, data: pin.Data, q: np.ndarray) -> np.ndarray:
    """Rate at which a spring's length or angle changes per generalised velocity, shape (nv,)."""
    row = np.zeros(model.nv)
    if site.frames is None:
        row[list(site.pushed)] = 1.0
        return row
    (i, first), (j, second) = site.frames
    pin.computeJointJacobians(model, data, q)
    start = (data.oMi[i] * first).translation
    end = (data.oMi[j] * second).translation
    along = end - start
    size = float(np.linalg.norm(along))
    along = along / size if size > 0.0 else np.array([1.0, 0.0, 0.0])
    columns = data.J.reshape(6, model.nv) * signs_between(model, i, j)
    return along @ (columns[:3] + np.cross(columns[3:], end, axisa=0, axisc=0))


class Sampling:
    """The sampled controllers of a run, and when they are due.

    Args:
        loads: all loads, by name.
        sites: what the kernels know of them.
        workspace: of the run.

    Raises:
        JointplayError: a period that is no multiple of the step.
    """

    def __init__(
        self,
        loads: Mapping[str, Load],
        sites: Sequence[LoadSite],
        workspace: Workspace,
        step: float,
    ) -> None:
        """Make the samplers."""
        self._workspace = workspace
        self._members = []
        for (name, load), site in zip(loads.items(), sites, strict=True):
            if not isinstance(load, Controller) or load.period is None:
                continue
            steps = round(load.period / step)
            if steps < 1 or abs(load.period / step - steps) > 1e-6 * steps:
                raise JointplayError(
                    f"the period {load.period:g} s of the controller {name!r} must be a multiple "
                    f"of the step {step:g} s"
                )
            self._members.append((load, site, steps, load.sampler()))

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._members)

    def until_next(self, step: int) -> int | None:
        """Steps from `step` until a sample is due after it; None if none ever is."""
        return min((every - step % every for _, _, every, _ in self._members), default=None)

    def memory(self) -> list[Any]:
        """State of each controller that has one, by its own `memory`, for a checkpoint.

        Raises:
            JointplayError: a controller that has a state and does not say it.
        """
        return [load.remember(sampler) for load, _, _, sampler in self._members]

    def recall(self, memory: Sequence[Any]) -> None:
        """Let the controllers go on with these states."""
        for (_, _, _, sampler), state in zip(self._members, memory, strict=True):
            if state is not None:
                cast(Any, sampler).recall(state)

    def due(self, step: int) -> bool:
        """Whether a sample is due at `step`."""
        return any(step % every == 0 for _, _, every, _ in self._members)

    def sample(self, q: np.ndarray, v: np.ndarray, jumps: bool) -> None:
        """Call those controllers that are due at the present step.

        Args:
            q, v: the state now.
            jumps: whether the torques before count for half of the present instant.
        """
        w = self._workspace
        for load, site, every, sampler in self._members:
            if w.steps % every == 0:
                seen = list(site.seen)
                torques = load.torques(sampler, w.time, q[seen].copy(), v[seen].copy())
                hold(site.numbers, w.time, torques, jumps)
