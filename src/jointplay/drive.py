"""How joints are driven: the forces F(t) of eq. 22."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay import kernel
from jointplay.errors import JointplayError, require_non_negative, require_positive
from jointplay.mechanism import Mechanism
from jointplay.motion import Motion

REFERENCE_NODE_S = 1e-4
"""Interval at which the reference is tabulated; between nodes it is linear [s].

At 30 rad/s^2 the tabulated position is within 4e-8 rad of the curve.
"""


@dataclass(frozen=True)
class JointFriction:
    """Friction Q(qd) of a joint and its gear: coulomb tanh(qd / 1 mrad/s) + viscous qd.

    With clearance it acts on the yaw coordinate, beside the contact's own friction.

    Raises:
        JointplayError: a negative or non-finite value.
    """

    coulomb: float = 0.0
    """Dry friction [N m, or N for prismatic joints]."""
    viscous: float = 0.0
    """[N m s/rad, or N s/m]."""

    def __post_init__(self) -> None:
        """Check both values."""
        require_non_negative("Coulomb joint friction", self.coulomb, "N m")
        require_non_negative("viscous joint friction", self.viscous, "N m s/rad")

    def torque(self, speed: np.ndarray) -> np.ndarray:
        """Q at the speeds `speed` [rad/s or m/s], any shape: [N m or N]."""
        dry = self.coulomb * np.tanh(speed / kernel.JOINT_FRICTION_SPEED)
        return dry + self.viscous * speed


@dataclass(frozen=True)
class ComputedTorque:
    """Computed torque of the ideal robot along the reference, plus PD on the encoders.

    F = tau_ideal(q_r, qd_r, qdd_r) + kp (q_r - q) + kd (qd_r - qd) for every joint of the motion.
    The encoder of a clearance joint sees the rotation about the bearing's axis (the yaw
    coordinate). The gains follow from the inertia that the ideal robot's joint carries at the
    start of the motion: kp = bandwidth^2 M_ii, kd = 2 damping_ratio bandwidth M_ii. The torque
    includes that for the joints' friction.

    Raises:
        JointplayError: bandwidth or damping ratio negative or not finite.
    """

    bandwidth: float = 100.0
    """Closed-loop natural frequency of each axis [rad/s]."""
    damping_ratio: float = 1.0

    def __post_init__(self) -> None:
        """Check both values."""
        require_positive("bandwidth", self.bandwidth, "rad/s")
        require_non_negative("damping ratio", self.damping_ratio, "")

    def tabulate(
        self,
        mechanism: Mechanism,
        motion: Motion,
        duration: float,
        friction: Mapping[str, JointFriction],
    ) -> tuple[np.ndarray, np.ndarray]:
        """Coordinate rows and reference table for `kernel.Workspace`.

        Args:
            mechanism: what is driven.
            motion: reference of every moving joint.
            duration: until when the table must reach [s].
            friction: friction by joint.

        Returns:
            rows (5, nv) and table (nodes, 3 nu), at intervals of `REFERENCE_NODE_S`.

        Raises:
            JointplayError: the motion does not name exactly the moving joints.
        """
        ideal = mechanism.ideal()
        joints = ideal.joints
        missing = [joint for joint in joints if joint not in motion.joints]
        unknown = [joint for joint in motion.joints if joint not in joints]
        if missing or unknown:
            wrong = [f"lacks {', '.join(missing)}"] if missing else []
            wrong += [f"names {', '.join(unknown)}"] if unknown else []
            raise JointplayError(
                f"the motion {' and '.join(wrong)}; the moving joints are: {', '.join(joints)}"
            )
        nodes = math.ceil(duration / REFERENCE_NODE_S - 1e-9) + 1
        order = [motion.joints.index(joint) for joint in joints]
        times = np.arange(max(nodes, 2)) * REFERENCE_NODE_S
        q, v, a = (np.ascontiguousarray(values[:, order]) for values in motion(times))
        model, data = ideal.model, ideal.data
        effort = np.array([pin.rnea(model, data, *state) for state in zip(q, v, a, strict=True)])
        inertia = pin.crba(model, data, q[0]).reshape(model.nv, model.nv).diagonal()

        rows = kernel.coordinate_rows(mechanism.model.nv)
        for index, joint in enumerate(joints):
            at = mechanism.coordinate(joint)
            losses = friction.get(joint, JointFriction())
            effort[:, index] += losses.torque(v[:, index])
            kp = self.bandwidth**2 * inertia[index]
            kd = 2.0 * self.damping_ratio * self.bandwidth * inertia[index]
            rows[:, at] = index, kp, kd, losses.coulomb, losses.viscous
        return rows, np.hstack([q, v, effort])

    def describe(self) -> dict[str, Any]:
        """Fields of the drive."""
        return asdict(self)
