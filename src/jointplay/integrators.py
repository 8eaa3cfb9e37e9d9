"""Fixed-step integrators of eqs 22 and 23.

Each is a kernel of `jointplay.kernel` that prepares the next evaluation of the acceleration, and
the number of evaluations that make a step. docs/integrators.md has the measurement behind the
default.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from jointplay import kernel
from jointplay.errors import MissingName


@dataclass(frozen=True)
class Integrator:
    """A fixed-step method."""

    name: str
    order: int
    """Order of convergence in smooth motion."""
    stages: int
    """Evaluations of the acceleration in a step."""
    advance: Any
    """Kernel called before each evaluation, with the table of a `workspace.Workspace`."""


SEMI_IMPLICIT_EULER = Integrator("semi-implicit-euler", 1, 1, kernel.semi_implicit_euler)
"""v += a dt, then q += v dt: one evaluation."""

RUNGE_KUTTA_4 = Integrator("rk4", 4, 4, kernel.runge_kutta_4)
"""Classical Runge-Kutta. Reference: Hairer, Norsett, Wanner, Solving ODEs I, Table II.1.2."""

INTEGRATORS = {method.name: method for method in (SEMI_IMPLICIT_EULER, RUNGE_KUTTA_4)}
DEFAULT = SEMI_IMPLICIT_EULER.name


def integrator(name: str) -> Integrator:
    """Look an integrator up.

    Raises:
        MissingName: no integrator of that name.
    """
    if name not in INTEGRATORS:
        raise MissingName("integrator", name, INTEGRATORS)
    return INTEGRATORS[name]
