"""How a journal leans in the full model, and how the reduced model has it lean.

The reduced model knows a dead band: the axis leans, as far as both rims on opposite sides of the
bore let it, to where the load's moment turns it. The full model's contacts give way, walls hold the
journal more upright, friction drags it aside, and a side force may press both rims to one side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.analysis.levers import place, sources
from jointplay.analysis.statics import play
from jointplay.mechanism.mechanism import Mechanism

_MOST = 400
"""Records that are compared."""


@dataclass(frozen=True)
class Leaning:
    """A journal's lean in a run, and how the reduced model differs."""

    full: np.ndarray
    """Where the journal's axis points beside the bearing's, world axes, shape (n, 3) [rad]."""
    largest: float
    """Largest difference of the reduced model's lean, a vector, from it [rad]."""
    rms: float
    """[rad]."""


def leaning(mechanism: Mechanism, joint: str, q: np.ndarray) -> Leaning | None:
    """Compare leans in the configurations q (n, nq) of a run; None if the joint cannot lean.

    Args:
        mechanism: with clearance in this joint.
        joint: its name.
        q: of the run's records.
    """
    clearance = mechanism.clearance.get(joint)
    if clearance is None or clearance.hinge is None or not clearance.hinge.leans:
        return None
    model, data = mechanism.model, mechanism.data
    full, axes = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for i, row in enumerate(q):
        pin.forwardKinematics(model, data, row)
        _, seat = place(mechanism, joint)
        (b, bearing), (j, journal) = mechanism.bearing_frame(joint), mechanism.journal_frame(joint)
        axis = (data.oMi[b] * bearing).rotation[:, 2]
        full[i] = (data.oMi[j] * journal).rotation[:, 2] - axis
        axes[i] = seat.rotation
    some = np.unique(np.linspace(0, len(q) - 1, min(_MOST, len(q))).astype(int))
    upright = q[some].copy()
    for part in clearance.freedoms:
        if part not in clearance.ideal_freedoms:
            upright[:, mechanism.coordinates.index(f"{joint}.{part}")] = 0.0
    source = next(one for one in sources(mechanism, upright) if one.name == joint)
    moment = source.load[:, 3:5]
    size = np.linalg.norm(moment, axis=1, keepdims=True)
    unit = np.divide(moment, size, out=np.zeros_like(moment), where=size > 0.0)
    _, tilt = play(clearance, second_order=False).reach
    # The body turns about its moment; its axis goes across it.
    sign = -1.0 if clearance.exchanged else 1.0
    lean = sign * tilt * np.column_stack([unit[:, 1], -unit[:, 0], np.zeros(len(unit))])
    there = np.einsum("nij,nj->ni", axes[some], lean)
    away = np.linalg.norm(full[some] - there, axis=1)
    return Leaning(full, float(away.max()), float(np.sqrt(np.mean(away**2))))
