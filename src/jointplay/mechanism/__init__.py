"""Mechanisms: a URDF, its joints with clearance, loops, gears and payloads as a Pinocchio model."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.mechanism.gravity import STANDARD_GRAVITY as STANDARD_GRAVITY
    from jointplay.mechanism.mechanism import Mechanism as Mechanism
    from jointplay.mechanism.mechanism import frame_index as frame_index

__all__ = ["STANDARD_GRAVITY", "Mechanism", "frame_index"]

__getattr__ = offering(__name__, dict.fromkeys(__all__, "mechanism"))
