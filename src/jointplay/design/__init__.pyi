from .allocation import allocate as allocate
from .cause_allocation import allocate_causes as allocate_causes
from .reduction import reduce as reduce
from .shares import sensitivity as sensitivity
from .static_budget import budget as budget
from .wear import worn_depth as worn_depth
