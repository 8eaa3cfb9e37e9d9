"""Sweeps: many cases of a scenario on all cores or a cluster, in one store that loses nothing."""

from jointplay.sweep.plan import Plan as Plan
from jointplay.sweep.plan import plan as plan
from jointplay.sweep.run import run_plan as run_plan
from jointplay.sweep.run import sweep as sweep
from jointplay.sweep.store import open_sweep as open_sweep
