"""Settings of a run that are tables of a scenario too: declared here once, light to import."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.core.schema import choice, quantity
from jointplay.kernel.integrators import DEFAULT, INTEGRATORS
from jointplay.loads.limits import LIMITS

STARTS = ("rest", "centred")
"""Where journals begin: where they lie under load, or in the middle of their bearings."""

START_UP = 0.15
"""Start of a run that is not judged, while released journals fall into their bearings [s]."""


@dataclass(frozen=True, kw_only=True)
class Integration:
    """Time integration, and the start."""

    step: float = quantity("s", default=1e-5)
    """Time step."""
    integrator: str = choice("integrator", INTEGRATORS, default=DEFAULT)
    """Method."""
    macro_step: float | None = quantity("s", default=None)
    """Interval at which `multi-rate` asks Pinocchio for the arm's inertia; an error estimate's
    choice if not given."""
    tolerance: float | None = quantity("", default=None)
    """Error of a macro step relative to the momentum that contacts and inertia move in it, by which
    `multi-rate` chooses its micro steps; if not given they are all as long as the step, which
    otherwise sets the times of records only."""
    duration: float | None = quantity("s", default=None)
    """Simulated time; the motion's if not given."""
    seed: int | None = None
    """Displaces each journal at the start by a random vector of up to half its clearances."""
    start: str | None = choice("start", STARTS, default=None)
    """Where journals begin: ``rest``, where they lie under gravity and drives, or ``centred``, in
    the middle of their bearings. If not given: at rest where gravity acts or the reference moves
    from the first, if there is a place of rest; centred where a film that is not hybrid must not
    break."""
    settle: float | str | None = quantity("s", default=None)
    """Time at the start in which the motion settles and is not judged, or ``"2 turns"``: until a
    driven joint has turned so often."""
    judge_from: float | None = quantity("s", default=None)
    """When figures begin to be judged; when the run has settled if not given."""


@dataclass(frozen=True, kw_only=True)
class Recording:
    """What is kept."""

    record_every: int = 10
    """Steps between two records; peaks in between are held."""


@dataclass(frozen=True, kw_only=True)
class Limited:
    """What becomes of the URDF's limits."""

    limits: str = choice("way with limits", LIMITS, default=LIMITS[0])
    """The URDF's limits of joints: ``report`` refuses motions beyond a position and reports speeds
    and efforts, ``cut`` also cuts the efforts of drives and controllers, ``ignore`` checks nothing.
    """
