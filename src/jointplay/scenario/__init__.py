"""Scenario files: what to simulate, in TOML, with units.

A scenario is read, its cases merged and checked, and built into simulations; presets and bare
robots become scenarios, too. Nothing here runs anything.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
