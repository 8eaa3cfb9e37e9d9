from .allocation import allocate as allocate
from .compensation import Compensation as Compensation
from .compensation import compensate as compensate
from .compensator import Compensator as Compensator
from .error_budget import budget as budget
