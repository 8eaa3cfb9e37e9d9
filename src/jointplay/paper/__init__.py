"""Reproduction of the paper's study: its cases, its figures and its claims.

Only the command line imports it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
