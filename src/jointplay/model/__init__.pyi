from .mechanism import Mechanism as Mechanism
from .mechanism import frame_index as frame_index
from .urdf import STANDARD_GRAVITY as STANDARD_GRAVITY
