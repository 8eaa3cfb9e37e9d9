"""xacro, ROS's macro language for robots: a file is expanded into a URDF by the library `xacro`.

A process of its own expands it (`model.xacro_expansion`), and reads only what it is given here:
files of the robot's own folder and package, and of packages that it names (`packages.find`). Paths
of this machine in the URDF become ``package://NAME/...``, or relative to the file, so that they
mean the same elsewhere.
"""

from __future__ import annotations

import glob
import json
import os
import re
from collections.abc import Iterable, Mapping, Sequence
from html import escape
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from jointplay.base import confined
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.files import read_text
from jointplay.base.imports import extra
from jointplay.base.pairs import misread
from jointplay.model import packages
from jointplay.model.vocabulary import BEYOND

Value = str | bool | int | float
"""Value of an argument; text is taken as it is, as if typed."""
NAMESPACE = "xmlns:xacro"
SUFFIX = ".xacro"
"""Suffix of files that are expanded; others are only if they are given an argument."""

TIME_S = 10.0
"""Longest processor time that expanding a robot may take [s]; large ones take 1 s."""

ROOM = 1e9
"""Most memory that expanding a robot may take [bytes]; large ones take a tenth."""

_USED = re.compile(r"<xacro:(?:arg|include|property|macro|if|unless)\b|\$\{|\$\(")
_Key = tuple[Path, tuple[tuple[str, str], ...], tuple[Path, ...]]
_expanded: dict[_Key, tuple[dict[Path, tuple[int, int]], str]] = {}
"""Robots that were expanded: stamps of the files that were read, and the URDF."""
_MOST_EXPANDED = 32
"""Most robots kept: enough for a study with several, each of some 100 kB (judged)."""


def uses_xacro(text: str) -> bool:
    """Whether a URDF uses xacro; many declare it in vain."""
    return NAMESPACE in text and bool(_USED.search(without_comments(text)))


def without_comments(text: str) -> str:
    """XML without its comments."""
    parts, end = [], 0
    while (start := text.find("<!--", end)) >= 0 and (close := text.find("-->", start)) >= 0:
        parts.append(text[end:start])
        end = close + 3
    return "".join([*parts, text[end:]])


def expand(text: str, path: Path, arguments: Mapping[str, Value], usual: Mapping[str, str]) -> str:
    """Expand a file with arguments into a URDF; once as long as no file changes.

    Args:
        text, path: the file.
        arguments: given by the user; the file must ask for each.
        usual: default values of arguments.

    Raises:
        JointplayError: the library is missing, or the file, or one that it includes, is not as it
            should be; the message has both, and the macro.
    """
    values = {name: as_text(value) for name, value in arguments.items()}
    path = path.absolute()
    key = path, tuple(({**usual, **values}).items()), tuple(packages.search_path(path))
    stamps, urdf = _expanded.get(key, ({}, ""))
    if not stamps or stamps != {file: _stamp(file) for file in stamps}:
        files = _Files(path)
        urdf, asked = _expand(files, {**usual, **values})
        for name in values:
            if name not in asked:
                raise MissingName(f"xacro argument of {path.name}:", name, asked)
        while len(_expanded) >= _MOST_EXPANDED:
            _expanded.pop(next(iter(_expanded)), None)
        _expanded[key] = {file: _stamp(file) for file in files.read}, urdf
    return urdf


def as_text(value: Value) -> str:
    """Text of an argument as it would be typed."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _stamp(file: Path) -> tuple[int, int]:
    """Time of the last change [ns] and size [bytes] of a file; zeros if it is gone."""
    try:
        status = file.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


class _Files:
    """Files that a xacro may read: of its own folder and package, and of packages it names."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.read = {path}
        """Files that were read."""
        self.folders: dict[str, Path] = {}
        """Folders of packages, by name."""
        real = path.resolve()
        self._roots = {path.parent.resolve(), real.parent}
        home = next((folder for folder in real.parents[: packages.ABOVE] if _package(folder)), None)
        if home is not None:
            self._roots.add(home)

    def give(self, request: str, subject: str) -> Any:
        """Answer to a request of the other process.

        ``find`` gives the folder of a package, ``match`` names of files by a pattern, and ``read``
        the text of a file.

        Raises:
            JointplayError: the xacro may not read that.
            OSError: there is no such file.
        """
        if request == "find":
            return str(self._find(subject))
        path = Path(os.path.normpath(self.path.parent / subject))
        if request == "match":
            fixed, *_ = re.split(r"[*?[]", subject, maxsplit=1)
            self._require(Path(fixed if fixed.endswith(os.sep) else os.path.dirname(fixed)))
            return [name for name in sorted(glob.glob(subject)) if self._has(Path(name))]
        self._require(path)
        self.read.add(Path(subject))
        path.stat()
        return read_text(path, "file")

    def _has(self, path: Path) -> bool:
        real = path.resolve()
        return any(real.is_relative_to(root) for root in self._roots)

    def _require(self, path: Path) -> None:
        if not self._has(path):
            raise JointplayError(
                f"{str(path)!r} is neither in the robot's folder or package nor in a package that "
                "it names; what makes a folder a package is a package.xml"
            )

    def _find(self, name: str) -> Path:
        folder = packages.find(name, self.path)
        if folder is None:
            above = self.path.resolve().parents[: packages.ABOVE]
            raise JointplayError(
                f"no package {name!r} in the folders from {above[0]} up to {above[-1]}, nor in "
                f"{' or '.join(packages.VARIABLES)}; put it beside the robot's package, or set "
                "ROS_PACKAGE_PATH to the folder that has it"
            )
        self.folders[name] = folder
        self._roots |= _package(folder)
        return folder


def _package(folder: Path) -> set[Path]:
    """Folder of a package, and the one that an installation links to; empty if it is none."""
    described = folder / "package.xml"
    real = described.resolve()
    if not real.is_file() or real.name != described.name:
        return set()
    return {folder.resolve(), real.parent}


def _expand(files: _Files, arguments: Mapping[str, str]) -> tuple[str, list[str]]:
    """Have a process expand the file: the URDF, and the arguments that were asked for."""
    with extra("xacro", "xacro"):
        if find_spec("xacro") is None:
            raise ImportError("it is not installed")
    subject = f"xacro {str(files.path)!r}"
    with confined.process("jointplay.model.xacro_expansion", files.path, TIME_S, ROOM) as process:
        assert process.stdin
        assert process.stdout
        while line := process.stdout.readline():
            message = json.loads(line)
            if "fault" in message:
                raise JointplayError(f"{subject}{message['fault']}")
            if "text" in message:
                urdf = _portable(message["text"], files.path.parent, files.folders)
                notes = [f"{files.path.name}: {note}" for note in message["said"]]
                return _saying(urdf, notes), message["asked"]
            answer = _answer(files, arguments, message["ask"], message["of"])
            try:
                process.stdin.write(json.dumps(answer).encode() + b"\n")
                process.stdin.flush()
            except BrokenPipeError:
                break
        raise JointplayError(f"{subject}: expanding it {confined.ended(process, TIME_S)}")


def _answer(
    files: _Files, arguments: Mapping[str, str], request: str, subject: str
) -> dict[str, Any]:
    """Message that answers a request: what it gives, or how it failed or was refused."""
    if request == "begin":
        return {"gives": dict(arguments)}
    try:
        return {"gives": files.give(request, subject)}
    except OSError as error:
        return {"failed": [error.errno, error.strerror, subject]}
    except (JointplayError, ValueError) as error:
        return {"refused": str(error)}


def _saying(text: str, notes: Sequence[str]) -> str:
    """A URDF's text with notes that join its doubts (`urdf.doubts`)."""
    if not notes:
        return text
    inside = escape(json.dumps({"doubts": notes}), quote=False)
    head, end, tail = text.rpartition("</robot>")
    return f"{head}<{BEYOND}>{inside}</{BEYOND}>{end}{tail}" if end else text


def _portable(text: str, folder: Path, folders: Mapping[str, Path]) -> str:
    """A URDF's text without this machine's paths of its own folder and of packages."""
    names = {f"{place}/": f"package://{name}/" for name, place in folders.items()}
    for place, name in ({f"{folder}/": ""} | names).items():
        # Some write file:///$(find NAME).
        text = re.sub(f"(?:file:///?)?{re.escape(place)}", name, text)
    return text


def read_arguments(texts: Iterable[str]) -> dict[str, str]:
    """Arguments written as ``NAME:=VALUE``, by name."""
    arguments = {}
    for text in texts:
        name, sign, value = text.partition(":=")
        if not (sign and name.strip()):
            raise misread(text, "--xacro NAME:=VALUE")
        arguments[name.strip()] = value
    return arguments
