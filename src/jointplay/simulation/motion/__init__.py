"""Motions to follow: waypoints, paths of the tool, and how an ideal mechanism moves."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
