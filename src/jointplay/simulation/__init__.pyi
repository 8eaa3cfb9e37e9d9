from . import analysis as analysis
from . import loads as loads
from . import motion as motion
from . import result as result
from .initial import PERTURBATION as PERTURBATION
from .run import Run as Run
from .simulation import Simulation as Simulation
from .simulation import simulate as simulate
