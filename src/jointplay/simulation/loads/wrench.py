"""Wrenches: a given force and moment on a frame, constant, over time, or by a user's function."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError, require_increasing
from jointplay.base.schema import choice, quantity
from jointplay.physics.contact.functions import FunctionDescription, OfFunction
from jointplay.simulation.loads.base import WORLD, OnFrame, Series, Site, Vector, between, frame

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism


@dataclass(frozen=True, kw_only=True)
class LoadFunctionDescription(FunctionDescription):
    """How files describe a load by a user's function (`contact.functions`)."""

    parameters: tuple[float, ...] = quantity("", default=())
    """Numbers for the function, which it finds in an array."""


def check_arguments(function: Callable[..., Any], expected: tuple[str, ...]) -> None:
    """Refuse a function that takes another number of arguments than `expected`."""
    try:
        names = tuple(inspect.signature(function).parameters)
    except (TypeError, ValueError):
        names = ()
    if len(names) != len(expected):
        raise JointplayError(
            f"function {getattr(function, '__name__', function)!r} takes ({', '.join(names)}); "
            f"it must take ({', '.join(expected)})",
            where=("function",),
        )


AXES = ("world", "frame")
"""Axes in which a wrench is given."""

_COMPONENTS = ("fx", "fy", "fz", "mx", "my", "mz")


def _wrench_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: number of times, whether in the frame's axes, times, wrenches (6 each).

    Linear between the times, constant before and after.
    """
    # The interval of the present time, by bisection.
    n = int(p[0])
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if time < p[2 + middle]:
            high = middle
        else:
            low = middle
    part = 0.0
    if high > low:
        part = (time - p[2 + low]) / (p[2 + high] - p[2 + low])
        part = min(max(part, 0.0), 1.0)
    for k in range(6):
        a, b = p[2 + n + 6 * low + k], p[2 + n + 6 * high + k]
        out[k] = a + part * (b - a)
    if p[1] != 0.0:  # from the frame's axes to the world's
        for s in range(0, 6, 3):
            a, b, c = out[s], out[s + 1], out[s + 2]
            for k in range(3):
                out[s + k] = x[3 + 3 * k] * a + x[4 + 3 * k] * b + x[5 + 3 * k] * c


@dataclass(frozen=True)
class _WorldWrench(OnFrame):
    """A wrench of the world on a frame."""

    def site(self, mechanism: Mechanism) -> Site:
        return between(mechanism, frame(mechanism, WORLD), frame(mechanism, self.frame, self.at))

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        return [
            Series(name, answers[:, k], "N" if k < 3 else "N m")
            for k, name in enumerate(_COMPONENTS)
        ]


@dataclass(frozen=True)
class _GivenWrench(_WorldWrench):
    """A wrench given in the axes of the world or of its frame, by the law `_wrench_law`."""

    _: KW_ONLY
    axes: str = choice("axes for a wrench", AXES, default=AXES[0])
    """Axes of force and moment: ``world``, or ``frame``, with which they turn."""

    def law(self) -> Callable[..., None]:
        return _wrench_law


@dataclass(frozen=True)
class Wrench(_GivenWrench):
    """A constant force and moment on a frame."""

    kind: ClassVar[str] = "wrench"

    force: Vector = quantity("N", default=(0.0, 0.0, 0.0))
    """Force at the point [N]."""
    moment: Vector = quantity("N*m", default=(0.0, 0.0, 0.0))
    """Moment about the point [N m]."""

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        turns = self.axes == "frame"
        return np.array([1.0, turns, 0.0, *self.force, *self.moment], float)


@dataclass(frozen=True)
class WrenchOverTime(_GivenWrench):
    """A force and moment on a frame over time: linear between given times, constant outside."""

    kind: ClassVar[str] = "wrench-over-time"

    times: tuple[float, ...] = quantity("s", label="wrench times")
    """Times of forces and moments, increasing [s]."""
    forces: tuple[Vector, ...] = quantity("N", default=())
    """Force at each time [N]; none if not given."""
    moments: tuple[Vector, ...] = quantity("N*m", default=())
    """Moment at each time [N m]; none if not given."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_increasing("wrench times", self.times, "s", ("times",))
        for name, rows in (("forces", self.forces), ("moments", self.moments)):
            if rows and len(rows) != len(self.times):
                raise JointplayError(
                    f"a wrench over time has {len(self.times)} times but {len(rows)} {name}"
                )
        if not self.times or not (self.forces or self.moments):
            raise JointplayError("a wrench over time needs times, and forces or moments for each")

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        n = len(self.times)
        parts = [np.array(rows or np.zeros((n, 3)), float) for rows in (self.forces, self.moments)]
        table = np.hstack(parts).ravel()
        return np.array([n, self.axes == "frame", *self.times, *table], float)


@dataclass(frozen=True, kw_only=True)
class WrenchDescription(LoadFunctionDescription):
    """How files describe a wrench by a user's function."""

    frame: str
    """Link or frame that it acts on."""
    at: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Point in the frame's axes at which the force acts [m]."""


@dataclass(frozen=True)
class WrenchFunction(OfFunction, _WorldWrench):
    """A force and moment on a frame by a function of the user's own, compiled like a law.

    ``function(time, pose, twist, p, out)`` gets the time [s]; the point's position [m] and the
    frame's orientation row by row (12 numbers); its velocity [m/s] and angular velocity [rad/s]
    (6); and the parameters. It writes force [N] and moment [N m] about the point into out (6).
    Everything is in world axes. Velocities are extrapolated by half a step. A function that does
    not compile is refused when a run is prepared.
    """

    written = WrenchDescription

    kind: ClassVar[str] = "wrench-function"

    function: Callable[..., Any]
    """A function at module level of an importable file (files then name it as
    ``module:function``)."""
    parameters: tuple[float, ...] = quantity("", default=())
    """Numbers that the function finds in p."""

    def __post_init__(self) -> None:
        super().__post_init__()
        self._keep_function(self.function)

    def _check_arguments(self, function: Callable[..., Any]) -> None:
        check_arguments(function, ("time", "pose", "twist", "p", "out"))

    def law(self) -> Callable[..., None]:
        return self.function

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        return np.array([*self.parameters, 0.0])
