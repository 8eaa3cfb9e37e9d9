"""Mechanisms: a description (URDF) and its joints with clearance as a Pinocchio model.

A joint with clearance becomes a virtual link of six coordinates, a closed loop is cut where it
meets again; gears, flexible links and payloads are added. Nothing here knows of time: of
motions, drives, runs or results.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
