from . import presets as presets
from .reading import Scenario as Scenario
