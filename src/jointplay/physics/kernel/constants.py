"""Constants of the kernels that other modules use, too; importing them needs no compiler."""

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
    """Task of an entry (`entry.enter`, `entry.enter_single`)."""

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
"""Status returned by an entry when a run has reached the step `RUN.until`."""

POWERS = (
    "drive",
    "normal_dissipation",
    "friction_dissipation",
    "joint_friction",
    "gear_dissipation",
    "film_dissipation",
)
"""Powers whose works are integrated over time for the audit of energy."""

AZIMUTHS = 72
"""Points around the bore at which sliding work is counted, the first on the bearing's x axis."""
JOINT_FRICTION_SPEED = 1e-3
"""Speed over which dry joint friction changes its sign, as tanh(v/speed) [rad/s or m/s]."""
GEAR_BENDS, GEAR_ORDERS = 3, 4
"""Most changes of slope of a gear's elastic curve, and most orders of its kinematic error."""
WELL_RESOLVED_STEPS = 10
"""Fewest steps of a contact that is resolved."""
NEVER, ALWAYS, IF_PRESSED = range(3)
"""When a load depends on velocity; IF_PRESSED: where its force at rest is not zero."""


# Integrators of eqs 22 and 23.


@dataclass(frozen=True)
class Integrator:
    """A fixed-step method."""

    name: str
    order: int
    """Order of convergence in smooth motion."""
    stages: int
    """Evaluations of the acceleration by Pinocchio per step; 0: one in many steps."""
    command: Command
    """Command to the kernels for each evaluation."""

    @property
    def single_rate(self) -> bool:
        """Whether the arm is evaluated as often as the contact."""
        return self.stages > 0


MULTI_RATE = Integrator("multi-rate", 2, 0, Command.ADVANCE)
"""Leapfrog with slowly varying inertia, implicit in velocity; see `kernel.multirate`."""
SEMI_IMPLICIT_EULER = Integrator("semi-implicit-euler", 1, 1, Command.SEMI_IMPLICIT_EULER)
"""Explicit: v += a dt, then q += v dt."""
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
