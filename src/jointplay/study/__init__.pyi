from .dataset import open_sweep as open_sweep
from .plan import Plan as Plan
from .plan import plan_of as plan_of
from .run import run_plan as run_plan
from .run import sweep as sweep
