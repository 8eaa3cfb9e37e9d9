"""Clearances, friction and play of gears from measurements of a real machine; what to measure."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
