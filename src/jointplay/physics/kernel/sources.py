"""One cache stamp for all compiled code of the time loop.

numba keeps compiled code beside its source and compiles again when the file of the function
changed - that file only, not those of the functions that it calls. Each entry of the
kernel is therefore stamped with all sources that go into it.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from jointplay.base import compiler

_PACKAGE = Path(__file__).parent
_PLAIN = ("integrators.py", "sites.py", "workspace.py")
"""Modules of the package without compiled code."""

SOURCES = (
    *sorted(path for path in _PACKAGE.glob("*.py") if path.name not in _PLAIN),
    _PACKAGE.parents[1] / "base" / "compiler.py",
    _PACKAGE.parents[1] / "base" / "numba_inside.py",
    *sorted((_PACKAGE.parent / "geometry").glob("*.py")),
    _PACKAGE.parent / "contact" / "bristle.py",
    _PACKAGE.parent / "contact" / "calls.py",
    _PACKAGE.parent / "contact" / "compiled.py",
    _PACKAGE.parent / "contact" / "film.py",
    _PACKAGE.parent / "contact" / "law.py",
    _PACKAGE.parent / "contact" / "elastic.py",
    _PACKAGE.parent / "contact" / "resultant.py",
    _PACKAGE.parent / "contact" / "rolling.py",
)
"""Files whose change must compile the kernel again."""


def fingerprint() -> str:
    """Hash of all `SOURCES`."""
    return compiler.fingerprint(SOURCES)


def stamp(dispatcher: Any, *more: Path) -> None:
    """Let numba's cache of a compiled function be valid for exactly these sources, and `more`."""
    compiler.stamp(dispatcher, (*SOURCES, *more))
