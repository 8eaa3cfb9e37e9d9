"""A load of one's own: a spring at a joint that hardens with the cube of its twist."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jointplay.base.schema import add, quantity
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.base import OnJoint


def hardened(time, x, dx, p, out):
    out[0] = -p[0] * x[0] ** 3


@dataclass(frozen=True)
class CubicSpring(OnJoint):
    """torque = -stiffness q^3."""

    kind: ClassVar[str] = "cubic-spring"
    stores: ClassVar[bool] = True

    stiffness: float = quantity("N*m", above=0.0)
    """[N m/rad^3]."""

    def law(self):
        return hardened

    def numbers(self, mechanism):
        return np.array([self.stiffness])

    def energy(self, x, numbers):
        return 0.25 * self.stiffness * x[:, 0] ** 4


add(Load, CubicSpring)
