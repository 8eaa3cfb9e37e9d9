"""Where bearing and journal of joints are, how they move, and what holds loops together."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from jointplay.joints import UNNAMED_KIND, Clearance
from jointplay.mechanism.loop import Loop

_AXIS_ARM_M = 0.05
"""Distance of the two points that hold the axis of an ideal revolute joint in a loop."""

Frame = tuple[int, pin.SE3]
"""A Pinocchio joint, and a frame's placement in it."""


def signs_between(model: pin.Model, first: int, second: int) -> np.ndarray:
    """+1 for coordinates that move the second joint only, -1 the first only, 0 else, (nv,)."""
    signs = np.zeros(model.nv)
    for index, sign in ((second, 1.0), (first, -1.0)):
        while index > 0:
            member = model.joints[index]
            signs[member.idx_v : member.idx_v + member.nv] += sign
            index = model.parents[index]
    return signs


class Placed:
    """What a `Mechanism` says of the frames of its joints, loops and locks.

    Attributes:
        model, data, clearance, loops, locks: see `Mechanism`.
    """

    model: pin.Model
    data: pin.Data
    clearance: Mapping[str, Clearance]
    loops: Mapping[str, Loop]
    locks: dict[str, tuple[Frame, Frame]]
    _joints: Mapping[str, Clearance]

    def loop_kind(self, name: str) -> str:
        """Kind of joint that closes the loop `name`."""
        return self.loop_class(name).kind

    def loop_class(self, name: str) -> type[Clearance]:
        """Class of the joint that closes the loop `name`."""
        return type(self._joints[name]) if name in self._joints else UNNAMED_KIND

    def bearing_frame(self, joint: str) -> Frame:
        """Pinocchio joint that carries the bearing, and the bearing frame's placement in it."""
        return self._frames(joint)[0]

    def journal_frame(self, joint: str) -> Frame:
        """Pinocchio joint that carries the journal, and the journal frame's placement in it."""
        return self._frames(joint)[1]

    def _frames(self, name: str) -> tuple[Frame, Frame]:
        model = self.model
        if name in self.loops:
            loop = self.loops[name]
            sides = []
            for link, placement in (
                (loop.bearing_link, loop.bearing),
                (loop.journal_link, loop.journal),
            ):
                frame = model.frames[model.getFrameId(link, pin.FrameType.BODY)]
                sides.append((int(frame.parentJoint), frame.placement * placement))
            bearing, journal = sides
        else:
            last = int(model.getJointId(name))
            first = last
            while model.names[model.parents[first]].split(".")[0] == name:
                first = model.parents[first]
            bearing = (int(model.parents[first]), model.jointPlacements[first])
            journal = (last, pin.SE3.Identity())
        given = self._joints.get(name)
        return (journal, bearing) if given is not None and given.exchanged else (bearing, journal)

    def journal_pose(self, joint: str) -> pin.SE3:
        """Journal frame in the bearing frame, after `pin.forwardKinematics`."""
        (i, bearing), (j, journal) = self._frames(joint)
        return (self.data.oMi[i] * bearing).actInv(self.data.oMi[j] * journal)

    def lock_pose(self, joint: str) -> pin.SE3:
        """What a lock holds in its carriage's frame, after `pin.forwardKinematics`."""
        (i, carriage), (j, held) = self.locks[joint]
        return (self.data.oMi[i] * carriage).actInv(self.data.oMi[j] * held)

    def signs(self, joint: str) -> np.ndarray:
        """+1 for coordinates that move the journal only, -1 the bearing only, 0 else, (nv,)."""
        return self._signs(*self._frames(joint))

    def _signs(self, first: Frame, second: Frame) -> np.ndarray:
        """The same for any two frames, the second in the journal's place."""
        return signs_between(self.model, first[0], second[0])

    def relative_jacobian(self, joint: str, q: np.ndarray) -> np.ndarray:
        """Motion of the journal relative to the bearing, shape (6, nv).

        Velocity of the journal's centre and angular velocity, both in the bearing frame, per
        generalised velocity in configuration q.
        """
        return self._relative(*self._frames(joint), q)

    def lock_jacobian(self, joint: str, q: np.ndarray) -> np.ndarray:
        """Motion of what a lock holds relative to its carriage, shape (6, nv); none is allowed."""
        return self._relative(*self.locks[joint], q)

    def _relative(self, first: Frame, second: Frame, q: np.ndarray) -> np.ndarray:
        """`relative_jacobian` of any two frames."""
        pin.computeJointJacobians(self.model, self.data, q)
        (i, bearing), (j, journal) = first, second
        turn = (self.data.oMi[i] * bearing).rotation
        centre = (self.data.oMi[j] * journal).translation
        columns = self.data.J.reshape(6, self.model.nv) * self._signs(first, second)
        linear = columns[:3] + np.cross(columns[3:], centre, axisa=0, axisc=0)
        return np.concatenate([turn.T @ linear, turn.T @ columns[3:]])

    def constraints(self, q: np.ndarray, frequency: float) -> list[pin.RigidConstraintModel]:
        """Pinocchio's constraints for the loops without clearance, and for locks.

        A ball needs its centre held; a revolute joint a second point on its axis, unless the
        mechanism keeps the axes parallel by itself (as planar ones do).

        Args:
            q: an assembled configuration, shape (nq,).
            frequency: of Baumgarte's stabilisation, critically damped [rad/s].
        """
        constraints = []
        for name in self.loops:
            if name in self.clearance:
                continue
            (i, bearing), (j, journal) = self._frames(name)
            points = [0.0]
            if self.loop_class(name).holds_axis():
                jacobian = self.relative_jacobian(name, q)
                held = [np.linalg.matrix_rank(jacobian[:n], tol=1e-9) for n in (3, 5)]
                points += [_AXIS_ARM_M] if held[1] > held[0] else []
            for height in points:
                point = np.array([0.0, 0.0, height])
                constraints.append(self._pinned(name, (j, journal), (i, bearing), point, frequency))
        for name, ((i, carriage), (j, held)) in self.locks.items():
            for point in (np.zeros(3), *(_AXIS_ARM_M * np.eye(3)[:2])):  # three hold a frame
                constraints.append(self._pinned(name, (j, held), (i, carriage), point, frequency))
        return constraints

    def _pinned(
        self,
        name: str,
        first: Frame,
        second: Frame,
        point: np.ndarray,
        frequency: float,
    ) -> pin.RigidConstraintModel:
        """Constraint that holds a point of two frames together; see `constraints`."""
        at = pin.SE3(np.eye(3), point)
        (i, one), (j, other) = first, second
        constraint = pin.RigidConstraintModel(
            pin.ContactType.CONTACT_3D,
            self.model,
            i,
            one * at,
            j,
            other * at,
            pin.ReferenceFrame.LOCAL,
        )
        constraint.name = name
        constraint.m_baumgarte_parameters.Kp = frequency**2
        constraint.m_baumgarte_parameters.Kd = 2.0 * frequency
        return constraint
