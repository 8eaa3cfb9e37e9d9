"""Constants of the kernels that other modules use too; importing them needs no compiler."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from jointplay.base.errors import MissingName


class Status(IntEnum):
    """Why the time loop stopped."""

    COMPLETED = 0
    INTERRUPTED = 1
    RUN_AWAY = 2
    BROKE_OUT = 3
    BAD_FORCE = 4
    FILM_BROKE = 5
    BAD_LOAD = 6


class Command(IntEnum):
    """What an entry shall do."""

    ADVANCE = 0
    PLAN = 1
    RESTART = 2
    START_HALF_STEP = 3
    SYNCHRONIZE = 4
    RECORD_LAST_STATE = 5
    BEGIN = 6
    REFRESH = 7
    EVALUATE_FORCES = 8
    COMPLETE_STEP = 9
    RECORD = 10
    SEMI_IMPLICIT_EULER = 11
    RUNGE_KUTTA_4 = 12
    CHECK_PREDICTION = 13
    ADVANCE_ADAPTIVELY = 14


REACHED = -1
"""Returned by an entry where a run has reached the step up to which it was asked to go."""

POWERS = (
    "drive",
    "normal_dissipation",
    "friction_dissipation",
    "joint_friction",
    "gear_dissipation",
    "film_dissipation",
)

AZIMUTHS = 72
"""Places around the bore at which sliding work is counted, the first on the bearing's x axis."""
JOINT_FRICTION_SPEED = 1e-3
"""Speed over which dry joint friction changes its sign [rad/s or m/s]."""
GEAR_BENDS, GEAR_ORDERS = 3, 4
"""Bends that a gear's elastic curve can have, and orders of its kinematic error."""
WELL_RESOLVED_STEPS = 10
"""A contact of fewer steps than this is not resolved."""
NEVER, ALWAYS, IF_PRESSED = range(3)
"""When a load depends on velocity; IF_PRESSED: where its force at rest is not zero."""


# Integrators of eqs 22 and 23: what they are called, and the loop that each goes through.


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
