"""Where what a scenario names comes from: files, and ways to give a motion."""

from __future__ import annotations

from pathlib import Path

from jointplay.mechanism.robots import PREFIX, robot_urdf
from jointplay.mechanism.urdf import shipped

SHIPPED = "jointplay:"
"""Prefixes of files that are no paths."""

MOTION_SOURCES = {
    "file": ("interpolation", "faster"),
    "joints": ("times", "interpolation", "faster"),
    "speeds": (),
    "tool_position": ("times", "tool_rpy", "frame", "path", "faster"),
}
"""Keys of [motion] of which there is one, and those that go with it."""


def locate(place: str, folder: Path) -> Path:
    """Path of a file that a scenario in `folder` names.

    Raises:
        JointplayError: nothing of that name ships with the package, or with example-robot-data.
    """
    if place.startswith(SHIPPED):
        return shipped(place.removeprefix(SHIPPED))
    if place.startswith(PREFIX):
        return robot_urdf(place.removeprefix(PREFIX))
    return folder / place
