"""Mechanisms: a URDF, its joints with clearance, loops, gears and payloads as a Pinocchio model."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
