"""Motions to follow: waypoints, paths of the tool, and how an ideal mechanism moves."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering
from jointplay.motion.reference import INTERPOLATIONS, Motion

if TYPE_CHECKING:
    from jointplay.motion.cartesian import cartesian_motion as cartesian_motion

__all__ = ["INTERPOLATIONS", "Motion", "cartesian_motion"]

__getattr__ = offering(__name__, {"cartesian_motion": "cartesian"})
