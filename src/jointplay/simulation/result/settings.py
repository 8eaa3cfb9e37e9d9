"""Settings of a run that are also tables of a scenario; declared once, and quick to import."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.base.schema import OptionalQuantity, Quantity, choice, quantity
from jointplay.physics.kernel.constants import DEFAULT, INTEGRATORS
from jointplay.simulation.loads.limits import LIMITS

STARTS = ("rest", "centred")
"""Starts of journals: at rest under load, or in the middle of their bearings."""


@dataclass(frozen=True, kw_only=True)
class Integration:
    """Time integration, and the start."""

    step: Quantity = quantity("s", default=1e-5)
    """Time step."""
    integrator: str = choice("integrator", INTEGRATORS, default=DEFAULT)
    """Method."""
    macro_step: OptionalQuantity = quantity("s", default=None)
    """Interval at which `multi-rate` updates the arm's inertia with Pinocchio; if not given, it is
    chosen by an error estimate."""
    tolerance: OptionalQuantity = quantity("", default=None)
    """Error allowed in a macro step, relative to the momentum that contacts and inertia exchange in
    it; `multi-rate` chooses its micro steps accordingly. If not given, all micro steps are as long
    as the step; if given, the step sets only the times of records."""
    duration: OptionalQuantity = quantity("s", default=None)
    """Simulated time; if not given, the duration of the motion."""
    seed: int | None = None
    """Seed of random displacements: each journal starts displaced by up to half its clearances,
    and teeth of gears start anywhere in their play."""
    start: str | None = choice("start", STARTS, default=None)
    """Where journals start: ``rest``, at their equilibrium under gravity and drives, or
    ``centred``, in the middle of their bearings. If not given: at rest if gravity acts or the
    reference moves from the beginning, provided that there is an equilibrium; centred if a film
    that is not hybrid must not break."""
    settle: float | str | None = quantity("s", default=None)
    """Time at the start in which the motion settles and figures are not judged, or ``"2 turns"``:
    until a driven joint has made that many turns."""
    judge_from: OptionalQuantity = quantity("s", default=None)
    """Time from which figures are judged; if not given, when the start has died away."""


@dataclass(frozen=True, kw_only=True)
class RecordSettings:
    """How often a run records."""

    record_every: int = 10
    """Steps between two records; each record holds the peaks since the one before."""


@dataclass(frozen=True, kw_only=True)
class LimitSettings:
    """How limits of the URDF are treated."""

    limits: str = choice("treatment of limits", LIMITS, default=LIMITS[0])
    """How joint limits of the URDF are treated: ``report`` refuses motions beyond a position limit
    and reports speeds and efforts beyond theirs, ``cut`` also cuts the efforts of drives and
    controllers, ``ignore`` checks nothing.
    """
