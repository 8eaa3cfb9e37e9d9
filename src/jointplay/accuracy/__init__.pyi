from .allocation import allocate as allocate
from .compensation import Compensation as Compensation
from .compensation import Compensator as Compensator
from .compensation import compensate as compensate
from .error_budget import budget as budget
