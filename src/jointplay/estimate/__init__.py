"""What measurements say of a machine: play, friction, elasticity, geometry, impacts.

Also which measurement would say more. Nothing here draws, or knows of a command line.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
