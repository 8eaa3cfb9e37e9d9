from .allocation import allocate as allocate
from .error_budget import budget as budget
from .reduction import reduce as reduce
