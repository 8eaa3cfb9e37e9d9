"""Friction with bristles: the surfaces hold each other by something that bends before it slides.

The bristles' deflection z is a vector in the plane of contact that lives as long as the contact:

    dz/dt = A v - r z,    F_t = -(k z + d dz/dt + c v), but no longer than a cap

with the sliding velocity v and numbers A, r, k, d, c, cap that the law gives. z is advanced over a
time step exactly for constant v, so that stiff bristles need no smaller step; it is turned into
the plane of contact as that turns, and is zero when the contact begins.
"""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from typing import Any, ClassVar

from jointplay.contact.law import (
    BRISTLE_NUMBERS,
    MAX_PARAMETERS,
    FrictionLaw,
    check_parameters,
    compiled_law,
    describe_custom,
    named,
    plain,
    restored,
)


class BristleLaw(FrictionLaw):
    """Base of friction laws with bristles.

    The compiled `function(speed, normal, dwell, p, out)` has the sliding speed [m/s], the normal
    force [N], the dwell (a second state, 0 at the onset) and the law's parameters, and writes

        out[0]  A                 part of the sliding that bends the bristles
        out[1]  r [1/s]           rate at which they let go
        out[2]  k [N/m]           stiffness
        out[3]  d [N s/m]         damping of the bristles
        out[4]  c [N s/m]         viscous friction
        out[5]  cap [N]           largest force, or infinity
        out[6]  target            what the dwell tends to
        out[7]  rate [1/s]        how fast
    """

    bristles: ClassVar[bool] = True

    def stiffness(self, normal: float) -> tuple[float, float]:
        """k [N/m] and d + c [N s/m] at rest under the normal force `normal` [N]."""
        out = (ctypes.c_double * BRISTLE_NUMBERS)()
        parameters = (ctypes.c_double * MAX_PARAMETERS)(*self.parameters())
        compiled_law(self).ctypes(0.0, normal, 0.0, parameters, out)
        return out[2], out[3] + out[4]


class CustomBristle(BristleLaw):
    """A user's own friction law ``f(speed, normal, dwell, p, out)`` with bristles.

    Args:
        function: writes the eight numbers of `BristleLaw` into `out`; at module level of an
            importable file (a result file then names it as ``module:function``).
        parameters: numbers the function finds in p, at most `MAX_PARAMETERS`.

    Raises:
        JointplayError: the function takes other arguments, or a parameter is not finite.
    """

    name = "custom-bristle"
    formula = (
        r"\dot{\mathbf z} = A\mathbf v_t-r\mathbf z,\quad "
        r"\mathbf F_t = -(k\mathbf z+d\,\dot{\mathbf z}+c\,\mathbf v_t)"
    )
    reference = "the user"
    validity = "what its author says"

    def __init__(self, function: Callable[..., None], parameters: tuple[float, ...] = ()) -> None:
        """Check the function's signature and keep its parameters."""
        self.function = plain(function, ("speed", "normal", "dwell", "p", "out"))
        self.values = tuple(float(value) for value in parameters)
        check_parameters(self.values, self.function.__name__)

    def parameters(self) -> tuple[float, ...]:
        """Return the user's own numbers."""
        return self.values

    def describe(self) -> dict[str, Any]:
        """Import path of the function, and its parameters."""
        return describe_custom(self.name, self.function, self.values)

    def __reduce__(self) -> tuple[Any, ...]:
        """Go to another process by name, as to a file."""
        return restored, (type(self), named(self.function), self.values)
