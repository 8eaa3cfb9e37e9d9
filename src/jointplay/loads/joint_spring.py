"""Springs at a joint: a torsion spring, and stops with stiffness and damping."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.errors import (
    JointplayError,
    require_finite,
    require_non_negative,
    require_positive,
)
from jointplay.fields import quantity
from jointplay.kernel.words import ALWAYS, IF_PRESSED, NEVER
from jointplay.loads.base import Load, Series, Site, joint_site

if TYPE_CHECKING:
    from jointplay.mechanism.mechanism import Mechanism

STIFFNESS = ("N*m/rad", "N/m")
DAMPING = ("N*m*s/rad", "N*s/m")
ANGLE = ("rad", "m")


def _twisted(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, rest."""
    out[0] = -p[0] * (x[0] - p[2]) - p[1] * dx[0]


def _stopped(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, lower and upper stop. A stop never pulls."""
    out[0] = 0.0
    if x[0] < p[2]:
        out[0] = max(p[0] * (p[2] - x[0]) - p[1] * dx[0], 0.0)
    elif x[0] > p[3]:
        out[0] = min(p[0] * (p[3] - x[0]) - p[1] * dx[0], 0.0)


@dataclass(frozen=True)
class _AtJoint(Load):
    """What springs at a joint have in common."""

    stores: ClassVar[bool] = True

    joint: str
    """Joint at which it acts."""
    stiffness: float = quantity(*STIFFNESS)
    """[N m/rad, or N/m for prismatic joints]."""
    damping: float = quantity(*DAMPING, default=0.0)
    """[N m s/rad or N s/m]."""

    def site(self, mechanism: Mechanism) -> Site:
        """The joint's coordinate: yaw, or z of a slider, if it has clearance."""
        return joint_site(mechanism, self.joint)

    def steepest(self) -> float:
        """Its stiffness."""
        return self.stiffness

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[Series]:
        """The torque on the joint's child."""
        return (Series("torque", answers[:, 0], "N m or N"),)

    def _check(self, name: str) -> None:
        require_positive(f"stiffness of a {name}", self.stiffness, "N m/rad", ("stiffness",))
        require_non_negative(f"damping of a {name}", self.damping, "N m s/rad", ("damping",))


@dataclass(frozen=True)
class TorsionSpring(_AtJoint):
    """A linear spring and damper at a joint: torque = -stiffness (q - rest) - damping dq/dt.

    Raises:
        JointplayError: stiffness or damping negative, or a number not finite.
    """

    kind: ClassVar[str] = "torsion-spring"

    rest: float = quantity(*ANGLE, default=0.0)
    """Position at which it does not push [rad or m]."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        self._check("torsion spring")
        require_finite("rest of a torsion spring", self.rest, "rad", ("rest",))

    def law(self) -> Callable[..., None]:
        """Linear."""
        return _twisted

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        """Numbers of `_twisted`."""
        return np.array([self.stiffness, self.damping, self.rest], float)

    def implicit(self) -> int:
        """With a damper."""
        return ALWAYS if self.damping > 0.0 else NEVER

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """k (q - rest)^2 / 2."""
        return 0.5 * self.stiffness * (x[:, 0] - self.rest) ** 2


@dataclass(frozen=True)
class Stop(_AtJoint):
    """Stops of a joint: beyond each a linear spring and a damper that never pull.

    Raises:
        JointplayError: stiffness or damping negative, a number not finite, the lower stop not below
            the upper one; when bound: neither is given and the URDF has no limits either.
    """

    kind: ClassVar[str] = "stop"

    lower: float | None = quantity(*ANGLE, default=None)
    """Where the lower one begins; the URDF's limit if not given [rad or m]."""
    upper: float | None = quantity(*ANGLE, default=None)
    """The upper one."""

    def __post_init__(self) -> None:
        """Check the numbers."""
        self._check("stop")
        ends = [
            require_finite(f"{name} stop", value, "rad", (name,))
            for name, value in (("lower", self.lower), ("upper", self.upper))
            if value is not None
        ]
        if len(ends) == 2 and not ends[0] < ends[1]:
            raise JointplayError(
                f"the lower stop must be below the upper one, got {ends[0]:g} and {ends[1]:g}"
            )

    def law(self) -> Callable[..., None]:
        """Nothing between the stops."""
        return _stopped

    def ends(self, mechanism: Mechanism) -> tuple[float, float]:
        """Where both begin, infinite for none [rad or m].

        Raises:
            JointplayError: nothing says where.
        """
        entry = mechanism.description.joints.get(self.joint)
        lower = self.lower if self.lower is not None else getattr(entry, "lower", None)
        upper = self.upper if self.upper is not None else getattr(entry, "upper", None)
        low = -np.inf if lower is None else lower
        high = np.inf if upper is None else upper
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
        """Numbers of `_stopped`."""
        return np.array([self.stiffness, self.damping, *self.ends(mechanism)])

    def implicit(self) -> int:
        """With a damper, while it is pressed."""
        return IF_PRESSED if self.damping > 0.0 else NEVER

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        """k depth^2 / 2."""
        lower, upper = numbers[2:4]
        depth = np.maximum(np.maximum(lower - x[:, 0], x[:, 0] - upper), 0.0)
        return 0.5 * self.stiffness * depth**2
