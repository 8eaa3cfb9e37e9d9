"""Results: histories of a run, its audit, and the file that holds both."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
