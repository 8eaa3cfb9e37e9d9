"""Integrators of eqs 22 and 23: what they are called, and the loop that each goes through.

docs/integrators.md has the measurement behind the default.
"""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.base.errors import MissingName
from jointplay.physics.kernel import Command


@dataclass(frozen=True)
class Integrator:
    """A fixed-step method."""

    name: str
    order: int
    """Order of convergence in smooth motion."""
    stages: int
    """Evaluations of the acceleration by Pinocchio in a step; 0: once in many steps."""
    command: Command
    """What the kernels do for each evaluation."""

    @property
    def single_rate(self) -> bool:
        """Whether the arm is evaluated as often as the contact."""
        return self.stages > 0


MULTI_RATE = Integrator("multi-rate", 2, 0, Command.ADVANCE)
"""Leapfrog on an inertia that changes slowly; implicit in velocity: see `kernel.multirate`."""

SEMI_IMPLICIT_EULER = Integrator("semi-implicit-euler", 1, 1, Command.SEMI_IMPLICIT_EULER)
"""Explicit: v += a dt, then q += v dt: one evaluation."""

RUNGE_KUTTA_4 = Integrator("rk4", 4, 4, Command.RUNGE_KUTTA_4)
"""Explicit: classical Runge-Kutta. Hairer, Norsett, Wanner, Solving ODEs I, Table II.1.2."""

INTEGRATORS = {m.name: m for m in (MULTI_RATE, SEMI_IMPLICIT_EULER, RUNGE_KUTTA_4)}
DEFAULT = MULTI_RATE.name


def integrator(name: str) -> Integrator:
    """Look an integrator up.

    Raises:
        MissingName: no integrator of that name.
    """
    if name not in INTEGRATORS:
        raise MissingName("integrator", name, INTEGRATORS)
    return INTEGRATORS[name]
