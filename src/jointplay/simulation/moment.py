"""One instant of a run, to be read."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.errors import MissingName
from jointplay.kernel.workspace import Workspace
from jointplay.mechanism.mechanism import Mechanism
from jointplay.simulation.loop import Loop


@dataclass(frozen=True)
class Moment:
    """State and contact forces at one instant; arrays are copies, the run goes on without them."""

    time: float
    """[s]."""
    step: int
    """Steps done."""
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
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates."""
        return tuple(self.mechanism.coordinates)

    def position(self, name: str) -> float:
        """Of a joint or of a single coordinate such as ``joint.x`` [rad or m].

        Raises:
            MissingName: no such joint or coordinate.
        """
        return float(self.q[self._index(name)])

    def speed(self, name: str) -> float:
        """Of a joint or of a single coordinate [rad/s or m/s].

        Raises:
            MissingName: no such joint or coordinate.
        """
        return float(self.v[self._index(name)])

    def journal(self, joint: str) -> tuple[np.ndarray, np.ndarray]:
        """Centre (3,) [m] and orientation (3, 3) of a journal in its bearing frame.

        Raises:
            MissingName: no such joint with clearance.
        """
        pose = self.poses[self._joint(joint)]
        return pose[:3], pose[3:].reshape(3, 3)

    def force(self, joint: str) -> np.ndarray:
        """Force on a journal in the axes of its bearing, shape (3,) [N].

        Raises:
            MissingName: no such joint with clearance.
        """
        return self.wrenches[self._joint(joint), :3]

    def contacts(self, joint: str) -> dict[str, float]:
        """Normal force by the name of the contact [N].

        Raises:
            MissingName: no such joint with clearance.
        """
        at = self._joint(joint)
        names = self.mechanism.clearance[joint].contacts
        return {name: float(self.normal_forces[at, k]) for k, name in enumerate(names)}

    def _index(self, name: str) -> int:
        if name in self.mechanism.joints:
            return self.mechanism.coordinate(name)
        if name not in self.mechanism.coordinates:
            choices = [*self.mechanism.joints, *(c for c in self.coordinates if "." in c)]
            raise MissingName("moving joint or coordinate", name, choices)
        return self.mechanism.coordinates.index(name)

    def _joint(self, name: str) -> int:
        joints = list(self.mechanism.clearance)
        if name not in joints:
            raise MissingName("joint with clearance", name, joints)
        return joints.index(name)


def moment_of(workspace: Workspace, loop: Loop, mechanism: Mechanism, single_rate: bool) -> Moment:
    """The present instant of a run, which goes on as if nobody had looked."""
    kept = [array.copy() for array in workspace.state()]
    loop.look()
    touching = workspace.contacts["touching"] > 0
    if not single_rate:
        touching &= (workspace.joints["touching"] > 0)[:, None]
    moment = Moment(
        workspace.time,
        workspace.steps,
        workspace.q.copy(),
        workspace.v.copy(),
        mechanism,
        workspace.joints["pose"].copy(),
        workspace.joints["wrench"].copy(),
        np.where(touching, workspace.contacts["normal_now"], 0.0),
    )
    for array, values in zip(workspace.state(), kept, strict=True):
        np.copyto(array, values)
    return moment
