from .initial import PERTURBATION as PERTURBATION
from .run import Run as Run
from .simulation import Simulation as Simulation
from .simulation import simulate as simulate
