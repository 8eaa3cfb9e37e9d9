"""Robots of the package robot_descriptions: git clones at pinned commits, in the user's cache.

The package's modules clone what is missing as soon as they are imported. Here nothing is
downloaded: an error says what is missing, and the package's command that downloads it.
"""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.imports import how_to_install

PACKAGE = "robot_descriptions"
PREFIX = f"{PACKAGE}:"
"""Marks a robot's name where a path could stand, as in ``robot_descriptions:ur10e_description``."""
_SUFFIX = "_description"
_URDF = ("URDF_PATH", "XACRO_PATH", "MJCF_PATH")
_MJCF = ("MJCF_PATH", "URDF_PATH", "XACRO_PATH")


class _MissingError(Exception):
    """A clone is missing in the cache."""


def names() -> tuple[str, ...]:
    """Names of all robots of the package; none if it is not installed."""
    try:
        return tuple(import_module(PACKAGE).DESCRIPTIONS)
    except ImportError:
        return ()


def full_name(name: str) -> str | None:
    """Name in the package of a robot, given with or without ``_description``; None without it."""
    normalized = name.lower().replace("-", "_")
    return next((n for n in (normalized, normalized + _SUFFIX) if n in names()), None)


def find(name: str) -> tuple[Path, dict[str, str]]:
    """File of a robot, a URDF, xacro or MJCF, and the default arguments of a xacro.

    Raises:
        JointplayError: the package is not installed, or the cache does not have the robot's files.
        MissingName: no such robot.
    """
    known = names()
    if not known:
        raise JointplayError(
            f"{PREFIX}{name} is of the package {PACKAGE}, which is not installed; install it with: "
            f"{how_to_install('robots')}"
        )
    full = full_name(name)
    if full is None:
        similar = [description for description in known if name.lower() in description]
        raise MissingName(f"robot of {PACKAGE}", name, similar or known)
    module = _imported(full)
    for attribute in _MJCF if "_mj_" in full else _URDF:
        if hasattr(module, attribute):
            usual = getattr(module, "XACRO_ARGS", {}) if attribute == "XACRO_PATH" else {}
            return Path(getattr(module, attribute)), {key: str(usual[key]) for key in usual}
    raise JointplayError(f"{PREFIX}{full} has no URDF, xacro or MJCF")


def _imported(name: str) -> ModuleType:
    """Module of a robot, imported so that it clones nothing."""
    module = f"{PACKAGE}.{name}"
    if module in sys.modules:
        return sys.modules[module]
    try:
        import git

        cache: Any = import_module(f"{PACKAGE}._cache")
        clone = cache.clone_to_directory
    except (ImportError, AttributeError) as error:  # GitPython needs git itself
        raise JointplayError(f"{PACKAGE} cannot be used here: {error}") from None

    def from_cache(url: str, folder: str, commit: str | None = None) -> Any:
        try:
            git.Repo(folder).commit(commit)
        except (git.GitError, ValueError, OSError):
            raise _MissingError(f"{url}, commit {commit}, in {folder}") from None
        return clone(url, folder, commit)

    cache.clone_to_directory = from_cache
    try:
        with warnings.catch_warnings(action="ignore"):  # announcements of a later release
            return import_module(module)
    except _MissingError as error:
        raise JointplayError(
            f"the files of {name} are not in the cache of {PACKAGE} ({error}); download them with: "
            f"python -m {PACKAGE} pull {name}"
        ) from None
    except Exception as error:  # noqa: BLE001 - others' modules, which edit files
        raise JointplayError(f"{PREFIX}{name} cannot be used: {error}") from None
    finally:
        cache.clone_to_directory = clone
