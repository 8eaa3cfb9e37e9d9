from .dataset import open_sweep as open_sweep
from .declaration import plan_of as plan_of
from .plan import Plan as Plan
from .run import run_plan as run_plan
from .run import sweep as sweep
