"""Formats of files with reduced joints: which can be written, and why others cannot."""

from __future__ import annotations

import importlib.util
from collections.abc import Sequence

from jointplay.base.errors import JointplayError
from jointplay.base.imports import how_to_install

FORMATS = {
    "mjcf": (".xml",),
    "sdf": (".sdf",),
    "urdf": (".urdf", ".yaml"),
    "json": (".json",),
    "usd": (".usda",),
}
"""Endings of the files of each format."""
PARAMETERS = (".yaml", ".json")
"""Those that random copies have not: their table has the numbers."""
_NEEDS = {
    "mjcf": ("mujoco", "MuJoCo compiles the URDF"),
    "usd": ("newton_usd_schemas", "Newton's schemas and OpenUSD write USD"),
}
"""Packages that formats need, and for what."""
_TILTED = ("mjcf", "json")
"""Formats that can hold the tilt of an axis."""


def choose(asked: Sequence[str], tilt: bool) -> tuple[list[str], list[str]]:
    """Formats to write: those asked for, or all that can be; and why others are left out.

    Raises:
        JointplayError: one that was asked for cannot hold the tilt of an axis (`tilt`), or needs a
            package that is missing.
    """
    chosen, notes = list(dict.fromkeys(asked or FORMATS)), []
    upright = [one for one in chosen if tilt and one not in _TILTED]
    if upright:
        can = f"the tilt of an axis, which --tilt writes, is held by {' and '.join(_TILTED)} only"
        if asked:
            raise JointplayError(f"--format {upright[0]} with --tilt: {can}")
        chosen = [one for one in chosen if one in _TILTED]
        notes.append(f"no {', '.join(upright)}: {can}")
    for name, (package, use) in _NEEDS.items():
        if name not in chosen or importlib.util.find_spec(package) is not None:
            continue
        text = f"{use}, and the package {package} is missing: {how_to_install('simulators')}"
        if asked:
            raise JointplayError(text)
        chosen.remove(name)
        notes.append(f"no {name}: {text}")
    return chosen, notes
