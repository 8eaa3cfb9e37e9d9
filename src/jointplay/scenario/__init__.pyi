from .load import Scenario as Scenario
