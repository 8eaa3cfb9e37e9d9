from .allocation import allocate as allocate
from .reduction import reduce_joint as reduce_joint
from .shares import dynamic_budget as dynamic_budget
from .shares import sensitivity as sensitivity
from .static_budget import budget as budget
from .wear import wear_life as wear_life
from .wear import worn_depth as worn_depth
