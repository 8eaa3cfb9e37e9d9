"""Sweeps: many cases of a scenario on all cores or a cluster, in one store that loses nothing.

Modules are loaded when a name is first used: workers need neither the store nor statistics.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
