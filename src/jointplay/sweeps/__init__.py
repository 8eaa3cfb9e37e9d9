"""Sweeps: many cases of a scenario on all cores or a cluster, in one store that loses nothing.

Modules are loaded when a name is first used: workers need neither the store nor statistics.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.sweeps.opened import open_sweep as open_sweep
    from jointplay.sweeps.plan import Plan as Plan
    from jointplay.sweeps.run import run_plan as run_plan
    from jointplay.sweeps.run import sweep as sweep
    from jointplay.sweeps.table_read import plan_of as plan_of

_HOMES = {
    "Plan": "plan",
    "open_sweep": "opened",
    "plan_of": "table_read",
    "run_plan": "run",
    "sweep": "run",
}

__all__ = sorted(_HOMES)

__getattr__ = offering(__name__, _HOMES)
