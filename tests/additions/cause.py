"""A cause of error of one's own: each joint's mounting face is out of flat."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

from jointplay.accuracy.causes import Cause, JointAt
from jointplay.accuracy.error_model import Box, Contribution


@dataclass(frozen=True)
class Flatness(Cause):
    """Tilts the axis either way, in both directions."""

    name: ClassVar[str] = "flatness"
    tilt: float
    """[rad]."""

    def at(self, joint: JointAt) -> Iterator[Contribution]:
        """The same at each joint."""
        tilted = Box((0.0, 0.0, 0.0, self.tilt, self.tilt, 0.0))
        yield Contribution(joint.name, self.name, tilted, origin="given: drawing")
