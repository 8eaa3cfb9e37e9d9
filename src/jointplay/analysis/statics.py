"""How far the journals of a joint can move in their bearing, without forces: exact, in closed form.

A joint's play is a set of small displacements of the child's body against the parent's: the
journal's centre c [m] and rotation vector phi [rad], in bearing axes. What a load can reach in that
set is its support function

    h(F, M) = max (F . c + M . phi)

for a load F [N], M [N m] about the bearing's centre. The displacement at which the maximum is
attained is where the journal rests under this load, if nothing rubs. Sums of such sets have the sum
of the support functions, so a robot's budget is a sum over its joints (`budget`).

The sets follow from the gaps of docs/theory.md. In the first order of the clearance they are
convex: for a journal of length L with its rims' centres p = c + L/2 s and q = c - L/2 s, where s is
the lean of its axis,

    |p| <= C_r,  |q| <= C_r,  |c_z| + R_j |s| <= C_a

In the second order a leaning journal has a little more room, R_j |s|^2 / 2 across and L |s|^2 / 4
along: the true set is not quite convex. Here both clearances are widened by what the largest lean
gives, so that h is never too small; `excess` says by which part it may be too large.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.joints import Clearance
from jointplay.joints.play import (
    BallPlay,
    BlockPlay,
    Cone,
    Cones,
    JournalPlay,
    Play,
    Support,
)

__all__ = ["BallPlay", "BlockPlay", "JournalPlay", "Play", "Support", "TurnPlay", "play"]


@dataclass(frozen=True)
class TurnPlay(Play):
    """A gear's backlash: the joint turns about its axis while the motor stands."""

    half: float
    """Half of the whole play [rad]."""

    @property
    def reach(self) -> tuple[float, float]:
        """No displacement, half of the play."""
        return 0.0, self.half

    @property
    def cones(self) -> Cones:
        """As far either way."""
        return Cones(self.half * np.eye(6)[:, 5:], (Cone(np.eye(1), np.zeros(1), 1.0),))

    def support(self, loads: np.ndarray) -> Support:
        """See `Play.support`."""
        loads = np.asarray(loads, float).reshape(-1, 6)
        point = np.zeros((len(loads), 6))
        point[:, 5] = self.half * np.sign(loads[:, 5])
        return Support(np.abs(loads[:, 5]) * self.half, point)


def play(joint: Clearance, second_order: bool = True) -> Play:
    """The set of displacements that a joint with clearance allows.

    The drive holds the joint's own coordinate. A worn bore counts as a round one, as wide as its
    deepest place.

    Args:
        joint: of any kind.
        second_order: widen the set so that it contains all poses without penetration; without, it
            is proportional to the clearances.
    """
    return joint.play(second_order)
