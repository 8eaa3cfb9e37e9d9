"""Accuracy of the tool by statics: causes of error, budgets, tolerances, compensation.

Nothing here steps through time, and nothing knows of files.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
