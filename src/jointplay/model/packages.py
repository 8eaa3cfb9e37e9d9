"""ROS packages: the folders that ``package://NAME/...`` and ``$(find NAME)`` mean."""

from __future__ import annotations

import os
import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

ABOVE = 6
"""Number of folders above a file that are searched."""
VARIABLES = {"ROS_PACKAGE_PATH": "", "AMENT_PREFIX_PATH": "share"}
"""Environment variables of ROS 1 and 2 that list folders, and where packages lie in these."""


def search_path(file: Path) -> list[Path]:
    """Folders in which packages are looked for, and in whose folders: those above `file` first."""
    folders = list(file.resolve().parents)[:ABOVE]
    for variable, inside in VARIABLES.items():
        entries = filter(None, os.environ.get(variable, "").split(os.pathsep))
        folders += [Path(entry).absolute() / inside for entry in entries]
    return folders


def find(name: str, file: Path) -> Path | None:
    """Folder of the package `name` that a robot's `file` uses; None if it is not found.

    A package has the name that its package.xml states; without one, that of its folder.
    """
    if not re.fullmatch(r"[\w-]+", name):
        return None
    for folder in search_path(file):
        called_so = (folder, folder / name, *sorted(folder.glob(f"*/{name}")))
        others = (f.parent for f in sorted(folder.glob("*/package.xml")))
        for candidate in (*called_so, *others):
            if candidate.is_dir() and _name(candidate) == name:
                return candidate
    return None


def _name(folder: Path) -> str:
    """Name of the package in a folder."""
    try:
        text = ElementTree.parse(folder / "package.xml").getroot().findtext("name", "")
    except (OSError, ElementTree.ParseError):
        return folder.name
    return text.strip()
