from . import presets as presets
from .load import Scenario as Scenario
