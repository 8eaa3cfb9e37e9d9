"""Gravity, unless told otherwise."""

STANDARD_GRAVITY = (0.0, 0.0, -9.81)
"""In world axes [m/s^2]."""
