from .allocation import allocate as allocate
from .error_budget import budget as budget
