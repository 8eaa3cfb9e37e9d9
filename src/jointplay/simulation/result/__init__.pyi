from .audit import Audit as Audit
from .certificate import Certificate as Certificate
from .result import AXES as AXES
from .result import FORMAT as FORMAT
from .result import Result as Result
