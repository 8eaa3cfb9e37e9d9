"""Friction with bristles: the surfaces hold each other by something that bends before it slides.

The bristles' deflection z is a vector in the plane of contact that lives as long as the contact:

    dz/dt = A v - r z,    F_t = -(k z + d dz/dt + c v), but no longer than a cap

with the sliding velocity v and numbers A, r, k, d, c, cap that the law gives. z is advanced over a
time step exactly for constant v, so that stiff bristles need no smaller step; it is turned into
the plane of contact as that turns, and is zero when the contact begins.
"""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

from jointplay.contact.compiled import MAX_PARAMETERS, compiled_law
from jointplay.contact.law import BRISTLE_NUMBERS, FrictionLaw, require_static
from jointplay.core.schema import quantity


class Bristles(NamedTuple):
    """What a law with bristles tells of a state; compiled functions return one."""

    bending: float
    """A: part of the sliding that bends the bristles."""
    release: float
    """r: rate at which they let go [1/s]."""
    stiffness: float
    """k [N/m]."""
    damping: float
    """d, of the bristles [N s/m]."""
    viscous: float
    """c, viscous friction [N s/m]."""
    cap: float
    """Largest force [N], or infinity."""
    dwell_target: float
    """What the dwell tends to."""
    dwell_rate: float
    """How fast [1/s]."""


@dataclass(frozen=True)
class BristleLaw(FrictionLaw):
    """Base of friction laws with bristles.

    The compiled `function(speed, normal, dwell, parameters)` has the sliding speed [m/s], the
    normal force [N], the dwell (a second state, 0 at the onset) and the law's parameters, and
    returns `Bristles`.
    """

    state = ("speed", "normal", "dwell")
    answers = BRISTLE_NUMBERS
    bristles: ClassVar[bool] = True

    def stiffness(self, normal: float) -> tuple[float, float]:
        """k [N/m] and d + c [N s/m] at rest under the normal force `normal` [N]."""
        out = (ctypes.c_double * BRISTLE_NUMBERS)()
        parameters = (ctypes.c_double * MAX_PARAMETERS)(*self.parameters())
        compiled_law(self).ctypes(0.0, normal, 0.0, parameters, out)
        return out[2], out[3] + out[4]


@dataclass(frozen=True)
class StribeckBristles(BristleLaw):
    """What laws have in common whose bristles let go at a coefficient that falls with the speed.

    Raises:
        JointplayError: a value out of range.
    """

    mu_d: float = quantity("", default=0.1, above=0.0)
    """Dynamic friction coefficient."""
    mu_s: float = quantity("", default=None, above=0.0)
    """Static friction coefficient, >= mu_d; 1.5 mu_d if not given."""
    v_s: float = quantity("m/s", default=1e-2, above=0.0)
    """Speed over which the friction falls from static to dynamic [m/s]."""
    sigma0: float = quantity("1/m", default=1e5, above=0.0)
    """Stiffness of the bristles per normal force [1/m]."""
    sigma1: float = quantity("s/m", default=10.0, least=0.0)
    """Their damping per normal force [s/m]."""
    sigma2: float = quantity("s/m", default=0.0, least=0.0)
    """Viscous friction per normal force [s/m]."""

    def __post_init__(self) -> None:
        """Check the parameters."""
        super().__post_init__()
        require_static(self)
