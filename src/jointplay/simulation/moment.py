"""A run at one instant, to be read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.base.errors import require_known
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import Coordinate
from jointplay.simulation.initial import named


@dataclass(frozen=True)
class Moment:
    """State and contact forces at one instant; arrays are copies, the run goes on without them.

    Names that do not exist are a `MissingName`.
    """

    time: float
    """[s]."""
    step: int
    q: np.ndarray
    """Generalised coordinates, in the order of `coordinates`, shape (nq,) [rad or m]."""
    v: np.ndarray
    """Their velocities, shape (nv,)."""
    mechanism: Mechanism
    poses: np.ndarray
    """By joint with clearance: centre of the journal (3) [m], then its orientation row by row (9),
    in the bearing frame; shape (nj, 12)."""
    wrenches: np.ndarray
    """Force on the journal (3) [N] and moment about its centre (3) [N m], bearing axes, (nj, 6)."""
    normal_forces: np.ndarray
    """By joint and contact, 0 where nothing touches, shape (nj, contacts) [N]."""

    @property
    def coordinates(self) -> tuple[Coordinate, ...]:
        return tuple(self.mechanism.coordinates)

    def position(self, name: str) -> float:
        """Of a joint or of a single coordinate such as ``joint.x`` [rad or m]."""
        return float(self.q[named(self.mechanism, name)[0]])

    def speed(self, name: str) -> float:
        """Of a joint or of a single coordinate [rad/s or m/s]."""
        return float(self.v[named(self.mechanism, name)[0]])

    def journal(self, joint: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre (3,) [m] and orientation (3, 3) of a journal in its bearing frame."""
        pose = self.poses[self._joint(joint)]
        return pose[:3], pose[3:].reshape(3, 3)

    def force(self, joint: str) -> np.ndarray:
        """Force on a journal in the axes of its bearing, shape (3,) [N]."""
        return self.wrenches[self._joint(joint), :3]

    def contacts(self, joint: str) -> dict[str, float]:
        """Normal force by the name of the contact [N]."""
        at = self._joint(joint)
        names = self.mechanism.clearance[joint].contacts
        return {name: float(self.normal_forces[at, k]) for k, name in enumerate(names)}

    def _joint(self, name: str) -> int:
        joints = list(self.mechanism.clearance)
        require_known("joint with clearance", name, joints)
        return joints.index(name)
