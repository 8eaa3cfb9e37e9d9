from .allocation import allocate as allocate
from .cause_allocation import allocate_causes as allocate_causes
from .reduction import reduce as reduce
from .static_budget import budget as budget
