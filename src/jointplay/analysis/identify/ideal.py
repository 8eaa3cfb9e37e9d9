"""Where the tool of the mechanism without play would be."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from jointplay.mechanism.mechanism import Mechanism


def tool_positions(
    mechanism: Mechanism, joints: Sequence[str], positions: np.ndarray
) -> np.ndarray:
    """Position of the ideal tool in world axes at joint positions (n, j), shape (n, 3) [m]."""
    q = configurations(mechanism, joints, positions)
    tool = np.zeros((len(q), 3))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(mechanism.model, mechanism.data, row)
        tool[i] = mechanism.data.oMf[mechanism.tool_frame].translation
    return tool


def configurations(
    mechanism: Mechanism, joints: Sequence[str], positions: np.ndarray
) -> np.ndarray:
    """Configurations with journals centred and motors before their joints, shape (n, nq)."""
    q = np.zeros((len(positions), mechanism.model.nq))
    for column, name in enumerate(joints):
        q[:, mechanism.coordinate(name)] = positions[:, column]
        q[:, mechanism.motor(name)] = positions[:, column]
    return q
