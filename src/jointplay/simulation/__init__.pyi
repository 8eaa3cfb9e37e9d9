from .simulation import PERTURBATION as PERTURBATION
from .simulation import Run as Run
from .simulation import Simulation as Simulation
from .simulation import simulate as simulate
