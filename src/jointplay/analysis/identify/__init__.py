"""Clearances, friction and play of gears from measurements of a real machine; what to measure."""

from jointplay.analysis.identify.identification import Identification, identify
from jointplay.analysis.identify.planning import Experiment, Plan, plan_measurement
from jointplay.analysis.identify.reading import Measurement

__all__ = ["Experiment", "Identification", "Measurement", "Plan", "identify", "plan_measurement"]
