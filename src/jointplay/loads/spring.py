"""A spring and damper between two points of a mechanism, or between one and the ground."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.errors import (
    JointplayError,
    require_finite,
    require_non_negative,
    require_positive,
    require_vector,
)
from jointplay.fields import quantity
from jointplay.kernel.words import ALWAYS, NEVER
from jointplay.loads.base import (
    WORLD,
    OnFrame,
    Series,
    Site,
    Vector,
    between,
    frame,
    require_increasing,
)

if TYPE_CHECKING:
    from jointplay.mechanism.mechanism import Mechanism

_POINT_M = 1e-12
"""Length at which a spring has no direction."""


def _linear(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, free length."""
    length = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    for k in range(6):
        out[k] = 0.0
    if length > 1e-12:
        rate = (x[0] * dx[0] + x[1] * dx[1] + x[2] * dx[2]) / length
        pull = p[0] * (length - p[2]) + p[1] * rate
        for k in range(3):
            out[k] = -pull * x[k] / length


def _curve(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: number of points, damping, lengths, forces."""
    length = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    for k in range(6):
        out[k] = 0.0
    if length > 1e-12:
        n = int(p[0])
        low, high = 0, n - 1
        while high - low > 1:
            middle = (low + high) // 2
            if length < p[2 + middle]:
                high = middle
            else:
                low = middle
        slope = (p[2 + n + high] - p[2 + n + low]) / (p[2 + high] - p[2 + low])
        rate = (x[0] * dx[0] + x[1] * dx[1] + x[2] * dx[2]) / length
        pull = p[2 + n + low] + slope * (length - p[2 + low]) + p[1] * rate
        for k in range(3):
            out[k] = -pull * x[k] / length


@dataclass(frozen=True)
class _Between(OnFrame):
    """What all springs between two points have in common."""

    stores: ClassVar[bool] = True

    _: KW_ONLY
    other: str = WORLD
    """Link or frame at its other end; ``world`` is the ground."""
    other_at: Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Point in the axes of `other` [m]."""
    damping: float = quantity("N*s/m", default=0.0)
    """[N s/m]."""

    def __post_init__(self) -> None:
        """Check points and damping."""
        super().__post_init__()
        other = require_vector("other_at", self.other_at, "m", ("other_at",))
        object.__setattr__(self, "other_at", other)
        require_non_negative("spring damping", self.damping, "N s/m", ("damping",))

    def site(self, mechanism: Mechanism) -> Site:
        """Between both points."""
        return between(
            mechanism,
            frame(mechanism, self.other, self.other_at),
            frame(mechanism, self.frame, self.at),
        )

    def implicit(self) -> int:
        """With a damper."""
        return ALWAYS if self.damping > 0.0 else NEVER

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        """Length, and force: positive where it pulls the points together."""
        length = np.linalg.norm(x[:, :3], axis=1)
        along = np.einsum("nk,nk->n", x[:, :3], answers[:, :3])
        force = -along / np.maximum(length, _POINT_M)
        return Series("length", length, "m"), Series("force", force, "N")


@dataclass(frozen=True)
class Spring(_Between):
    """A linear spring and damper between two points: force = stiffness (length - free_length) + ...

    ... damping times the rate of the length; positive, it pulls the points together.

    Raises:
        JointplayError: stiffness, damping or length negative, or a number not finite.
    """

    kind: ClassVar[str] = "spring"

    stiffness: float = quantity("N/m")
    """[N/m]."""
    free_length: float = quantity("m")
    """Length at which it does not pull [m]."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        super().__post_init__()
        require_positive("spring stiffness", self.stiffness, "N/m", ("stiffness",))
        require_non_negative("free length", self.free_length, "m", ("free_length",))

    def law(self) -> Callable[..., None]:
        """Force along the line between the points."""
        return _linear

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        """Numbers of `_linear`."""
        return np.array([self.stiffness, self.damping, self.free_length])

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """k (length - free length)^2 / 2."""
        stretch = np.linalg.norm(x[:, :3], axis=1) - self.free_length
        return 0.5 * self.stiffness * stretch**2

    def steepest(self) -> float:
        """Slope of the force."""
        return self.stiffness


@dataclass(frozen=True)
class CurveSpring(_Between):
    """A spring whose force over its length is given by points, with a linear damper.

    Linear between the points; beyond them as between the last two. Positive forces pull the points
    together.

    Raises:
        JointplayError: fewer than two points, lists of different lengths, lengths that do not
            increase, a number that is not finite.
    """

    kind: ClassVar[str] = "curve-spring"

    lengths: tuple[float, ...] = quantity("m")
    """Increasing [m]."""
    forces: tuple[float, ...] = quantity("N")
    """Force at each length [N]."""

    def __post_init__(self) -> None:
        """Check the points."""
        super().__post_init__()
        lengths = require_increasing("spring lengths", self.lengths, "m", ("lengths",))
        forces = tuple(
            require_finite("spring forces", one, "N", ("forces",)) for one in self.forces
        )
        if len(lengths) != len(forces) or len(lengths) < 2:
            raise JointplayError(
                "a spring's curve needs as many lengths as forces and at least two, got "
                f"{len(lengths)} and {len(forces)}"
            )
        object.__setattr__(self, "lengths", lengths)
        object.__setattr__(self, "forces", forces)

    def law(self) -> Callable[..., None]:
        """Force along the line between the points."""
        return _curve

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        """Numbers of `_curve`."""
        return np.array([len(self.lengths), self.damping, *self.lengths, *self.forces])

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """Integral of the force from the first length."""
        nodes, forces = np.array(self.lengths), np.array(self.forces)
        slopes = np.diff(forces) / np.diff(nodes)
        areas = 0.5 * (forces[1:] + forces[:-1]) * np.diff(nodes)
        before = np.concatenate([[0.0], np.cumsum(areas)])
        length = np.linalg.norm(x[:, :3], axis=1)
        k = np.clip(np.searchsorted(nodes, length, side="right") - 1, 0, len(slopes) - 1)
        on = length - nodes[k]
        return before[k] + on * (forces[k] + 0.5 * slopes[k] * on)

    def steepest(self) -> float:
        """Largest slope of the curve."""
        return float(np.abs(np.diff(self.forces) / np.diff(self.lengths)).max())
