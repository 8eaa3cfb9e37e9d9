from .cartesian import cartesian_motion as cartesian_motion
from .reference import INTERPOLATIONS as INTERPOLATIONS
from .reference import Motion as Motion
