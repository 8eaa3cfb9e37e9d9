"""Measures of a user's own: functions of a result, named ``module:function``."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Collection
from pathlib import Path
from typing import Any

from jointplay.contact.trust import imported
from jointplay.errors import JointplayError
from jointplay.host.files import is_file


def measure_function(name: str, folder: Path, trust: Collection[str]) -> Any:
    """The function that ``module:function`` names: beside the scenario, or of a trusted module.

    Raises:
        JointplayError: it is neither, or cannot be imported.
    """
    module, _, function = name.partition(":")
    beside = folder / f"{module}.py"
    if is_file(beside):
        return getattr(_fresh(module, beside, name), function)
    ways = {".".join(module.split(".")[:n]) for n in range(1, module.count(".") + 2)}
    if ways.isdisjoint(trust):
        raise JointplayError(
            f"the measure {name!r} is no module beside the scenario; if you trust it: "
            f"--trust {module}, or trust=[{module!r}] in Python"
        )
    try:
        return imported(name)
    except JointplayError as error:
        raise JointplayError(str(error).replace("the law", "the measure")) from None


def _fresh(module: str, path: Path, name: str) -> Any:
    """The module of a file as it is now: a worker of a cluster lives longer than a file."""
    place = str(path.parent.resolve())
    sys.path.insert(0, place)
    try:
        spec = importlib.util.spec_from_file_location(module, path)
        assert spec is not None
        assert spec.loader is not None
        made = importlib.util.module_from_spec(spec)
        sys.modules[module] = made
        spec.loader.exec_module(made)
        getattr(made, name.partition(":")[2])
    except Exception as error:  # a module of the user's own can raise anything
        words = " ".join(str(error).split())
        raise JointplayError(f"the measure {name!r} cannot be imported: {words}") from None
    finally:
        sys.path.remove(place)
    return made
