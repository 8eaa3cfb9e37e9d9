"""Sweeps: many cases of a scenario on all cores or a cluster, in one store that loses nothing."""

from jointplay.sweeps.opened import open_sweep as open_sweep
from jointplay.sweeps.plan import Plan as Plan
from jointplay.sweeps.run import run_plan as run_plan
from jointplay.sweeps.run import sweep as sweep
from jointplay.sweeps.table_read import plan as plan
