from . import contact as contact
from . import geometry as geometry
from . import joints as joints
from . import kernel as kernel
