from .cartesian import CartesianPath as CartesianPath
from .cartesian import cartesian_motion as cartesian_motion
from .cartesian import cartesian_path as cartesian_path
from .cartesian import reachable as reachable
from .reference import INTERPOLATIONS as INTERPOLATIONS
from .reference import Motion as Motion
