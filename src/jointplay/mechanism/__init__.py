"""Mechanisms: a URDF, its joints with clearance, loops, gears and payloads as a Pinocchio model."""

from jointplay.mechanism.mechanism import STANDARD_GRAVITY, Mechanism, frame_index

__all__ = ["STANDARD_GRAVITY", "Mechanism", "frame_index"]
