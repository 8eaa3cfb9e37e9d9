"""Motions to follow: waypoints, paths of the tool, and how an ideal mechanism moves."""

from jointplay.motion.reference import INTERPOLATIONS, Motion

__all__ = ["INTERPOLATIONS", "Motion"]
