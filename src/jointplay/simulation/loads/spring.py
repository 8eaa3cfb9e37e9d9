"""Springs with dampers: between two points of a mechanism, or at a joint; stops of joints."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError, require_increasing
from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.physics.kernel.constants import ALWAYS, IF_PRESSED, NEVER
from jointplay.simulation.loads import base

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism


# Springs between two points of a mechanism, of which one may be on the ground.


_POINT_M = 1e-12
"""Length up to which a spring has no direction, and does not pull [m]."""


def _linear_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, free length."""
    length = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    for k in range(6):
        out[k] = 0.0
    if length > _POINT_M:
        rate = (x[0] * dx[0] + x[1] * dx[1] + x[2] * dx[2]) / length
        pull = p[0] * (length - p[2]) + p[1] * rate
        for k in range(3):
            out[k] = -pull * x[k] / length


def _curve_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: number of points, damping, lengths, forces."""
    length = math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])
    for k in range(6):
        out[k] = 0.0
    if length > _POINT_M:
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
class _Between(base.OnFrame):
    """A spring between two points: its other end, and its damper."""

    stores: ClassVar[bool] = True

    _: KW_ONLY
    other: str = base.WORLD
    """Link or frame at the other end; ``world`` is the ground."""
    other_at: base.Vector = quantity("m", default=(0.0, 0.0, 0.0))
    """Point of the other end in the axes of `other` [m]."""
    damping: Quantity = quantity("N*s/m", default=0.0, least=0.0, label="spring damping")
    """Damping along the spring [N s/m]."""

    def site(self, mechanism: Mechanism) -> base.Site:
        return base.between(
            mechanism,
            base.frame(mechanism, self.other, self.other_at),
            base.frame(mechanism, self.frame, self.at),
        )

    def implicit(self) -> int:
        return ALWAYS if self.damping > 0.0 else NEVER

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[base.Series]:
        """Length, and force: positive where it pulls the points together."""
        length = np.linalg.norm(x[:, :3], axis=1)
        along = np.einsum("nk,nk->n", x[:, :3], answers[:, :3])
        force = -along / np.maximum(length, _POINT_M)
        return base.Series("length", length, "m"), base.Series("force", force, "N")


@dataclass(frozen=True)
class Spring(_Between):
    """A linear spring and damper between two points.

    Force = stiffness (length - free_length) + damping d(length)/dt; positive, it pulls the points
    together.
    """

    kind: ClassVar[str] = "spring"

    stiffness: Quantity = quantity("N/m", above=0.0, label="spring stiffness")
    """Stiffness along the spring [N/m]."""
    free_length: Quantity = quantity("m", least=0.0, label="free length")
    """Length at which it does not pull [m]."""

    def law(self) -> Callable[..., None]:
        return _linear_law

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        return np.array([self.stiffness, self.damping, self.free_length])

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        stretch = np.linalg.norm(x[:, :3], axis=1) - self.free_length
        return 0.5 * self.stiffness * stretch**2

    def steepest(self) -> float:
        return self.stiffness


@dataclass(frozen=True)
class CurveSpring(_Between):
    """A spring whose force over its length is given by at least two points, with a linear damper.

    Linear between the points; beyond them as between the last two. Positive forces pull the points
    together.
    """

    kind: ClassVar[str] = "curve-spring"

    lengths: tuple[float, ...] = quantity("m", label="spring lengths")
    """Lengths of the points of its curve, increasing [m]."""
    forces: tuple[float, ...] = quantity("N", label="spring forces")
    """Force at each length [N]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        require_increasing("spring lengths", self.lengths, "m", ("lengths",))
        if len(self.lengths) != len(self.forces) or len(self.lengths) < 2:
            raise JointplayError(
                "a spring's curve needs as many lengths as forces and at least two, got "
                f"{len(self.lengths)} and {len(self.forces)}"
            )

    def law(self) -> Callable[..., None]:
        return _curve_law

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        return np.array([len(self.lengths), self.damping, *self.lengths, *self.forces])

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        nodes, forces = np.array(self.lengths), np.array(self.forces)
        slopes = np.diff(forces) / np.diff(nodes)
        areas = 0.5 * (forces[1:] + forces[:-1]) * np.diff(nodes)
        before = np.concatenate([[0.0], np.cumsum(areas)])
        length = np.linalg.norm(x[:, :3], axis=1)
        k = np.clip(np.searchsorted(nodes, length, side="right") - 1, 0, len(slopes) - 1)
        on = length - nodes[k]
        return before[k] + on * (forces[k] + 0.5 * slopes[k] * on)

    def steepest(self) -> float:
        return float(np.abs(np.diff(self.forces) / np.diff(self.lengths)).max())


# Springs at a joint: a torsion spring, and stops with stiffness and damping.


def _torsion_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, rest."""
    out[0] = -p[0] * (x[0] - p[2]) - p[1] * dx[0]


def _stop_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, lower and upper stop. A stop never pulls."""
    out[0] = 0.0
    if x[0] < p[2]:
        out[0] = max(p[0] * (p[2] - x[0]) - p[1] * dx[0], 0.0)
    elif x[0] > p[3]:
        out[0] = min(p[0] * (p[3] - x[0]) - p[1] * dx[0], 0.0)


@dataclass(frozen=True)
class _AtJoint(base.OnJoint):
    """A spring at a joint: its stiffness and its damper."""

    stores: ClassVar[bool] = True

    stiffness: Quantity = quantity("N*m/rad", "N/m", above=0.0)
    """Stiffness [N m/rad, or N/m for prismatic joints]."""
    damping: Quantity = quantity("N*m*s/rad", "N*s/m", default=0.0, least=0.0)
    """Damping [N m s/rad or N s/m]."""

    def steepest(self) -> float:
        return self.stiffness


@dataclass(frozen=True)
class TorsionSpring(_AtJoint):
    """A linear spring and damper at a joint: torque = -stiffness (q - rest) - damping dq/dt."""

    kind: ClassVar[str] = "torsion-spring"

    rest: Quantity = quantity("rad", "m", default=0.0)
    """Position at which it does not push [rad or m]."""

    def law(self) -> Callable[..., None]:
        return _torsion_law

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        return np.array([self.stiffness, self.damping, self.rest], float)

    def implicit(self) -> int:
        return ALWAYS if self.damping > 0.0 else NEVER

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        return 0.5 * self.stiffness * (x[:, 0] - self.rest) ** 2


@dataclass(frozen=True)
class Stop(_AtJoint):
    """Stops of a joint: beyond each a linear spring and a damper that never pull."""

    kind: ClassVar[str] = "stop"

    lower: OptionalQuantity = quantity("rad", "m", default=None, label="lower stop")
    """Position at which the lower stop begins; the URDF's limit if not given [rad or m]."""
    upper: OptionalQuantity = quantity("rad", "m", default=None, label="upper stop")
    """Position at which the upper stop begins; the URDF's limit if not given [rad or m]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.lower is not None and self.upper is not None and not self.lower < self.upper:
            raise JointplayError(
                f"the lower stop must be below the upper one, got {self.lower:g} and {self.upper:g}"
            )

    def law(self) -> Callable[..., None]:
        return _stop_law

    def ends(self, mechanism: Mechanism) -> tuple[float, float]:
        """Positions at which the stops begin, infinite for none [rad or m]; one is needed."""
        entry = mechanism.description.joints.get(self.joint)
        lower = self.lower if self.lower is not None else getattr(entry, "lower", None)
        upper = self.upper if self.upper is not None else getattr(entry, "upper", None)
        low, high = -np.inf if lower is None else lower, np.inf if upper is None else upper
        if low == -np.inf and high == np.inf:
            raise JointplayError(
                f"a stop of joint {self.joint!r} needs lower or upper: the URDF gives no limits"
            )
        if not low < high:
            raise JointplayError(
                f"the lower stop of joint {self.joint!r} must be below the upper one, got {low:g} "
                f"and {high:g}"
            )
        return low, high

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        return np.array([self.stiffness, self.damping, *self.ends(mechanism)])

    def implicit(self) -> int:
        return IF_PRESSED if self.damping > 0.0 else NEVER

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        lower, upper = numbers[2:4]
        depth = np.maximum(np.maximum(lower - x[:, 0], x[:, 0] - upper), 0.0)
        return 0.5 * self.stiffness * depth**2
