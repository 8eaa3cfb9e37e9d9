"""A quantity of one's own that results record: the distance of a point from the ground's origin."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jointplay.base.schema import add
from jointplay.simulation.loads import WORLD, Load
from jointplay.simulation.loads.base import OnFrame, Series, between, frame


def nothing(time, x, dx, p, out):
    for k in range(6):
        out[k] = 0.0


@dataclass(frozen=True)
class Distance(OnFrame):
    """Pushes nothing; looks where the point `at` of `frame` is."""

    kind: ClassVar[str] = "distance"

    def site(self, mechanism):
        return between(mechanism, frame(mechanism, WORLD), frame(mechanism, self.frame, self.at))

    def law(self):
        return nothing

    def numbers(self, mechanism):
        return np.zeros(0)

    def record(self, x, answers):
        return (Series("distance", np.linalg.norm(x[:, :3], axis=1), "m"),)


add(Load, Distance)
