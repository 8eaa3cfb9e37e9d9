from .identification import Identification as Identification
from .identification import identify as identify
from .measurement import Measurement as Measurement
from .planning import Experiment as Experiment
from .planning import MeasurementPlan as MeasurementPlan
from .planning import plan_measurement as plan_measurement
