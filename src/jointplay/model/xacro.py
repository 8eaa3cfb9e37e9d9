"""xacro, ROS's macro language for robots: a file is expanded into a URDF by the library `xacro`.

Its expressions have no access to Python's own functions, but a file may read other files and the
environment, and name packages (`packages.find`). What the URDF says of folders here is said as
``package://NAME/...``, or relative to the file, so that it means the same elsewhere.
"""

from __future__ import annotations

import io
import re
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.imports import extra
from jointplay.base.tables import few
from jointplay.model import packages

Value = str | bool | int | float
"""Of an argument; text is taken as it is, as if typed."""
NAMESPACE = "xmlns:xacro"
_USED = re.compile(r"<xacro:(?:arg|include|property|macro|if|unless)\b|\$\{|\$\(")
_MACRO = re.compile(r"<xacro:macro\b[^>]*\bname\s*=\s*[\"']([^\"']+)")
_lock = threading.Lock()  # the library keeps what it does in global variables
_Key = tuple[Path, tuple[tuple[str, str], ...], tuple[Path, ...]]
_expanded: dict[_Key, tuple[dict[Path, tuple[int, int]], str]] = {}
"""Files that were read for it, with their times and sizes, and the URDF that was made."""
_MOST_EXPANDED = 32


def is_xacro(text: str, path: Path) -> bool:
    """Whether a file must be expanded: many a URDF declares xacro in vain, or has a call left."""
    if path.suffix.lower() == ".xacro":
        return True
    return NAMESPACE in text and bool(_USED.search(without_comments(text)))


def without_comments(text: str) -> str:
    """XML without its comments."""
    return re.sub("<!--.*?-->", "", text, flags=re.DOTALL)


def expand(text: str, path: Path, arguments: Mapping[str, Value], usual: Mapping[str, str]) -> str:
    """The URDF that a file makes of its arguments; made once as long as no file changes.

    Args:
        text, path: the file.
        arguments: given by the user; each must be one that the file asks for.
        usual: those that count where none are given.

    Raises:
        JointplayError: the library is missing, or the file, or one that it includes, is not as it
            should be; the message has both, and the macro.
    """
    given = {name: as_text(value) for name, value in arguments.items()}
    path = path.absolute()
    key = path, tuple(({**usual, **given}).items()), tuple(packages.search_path(path))
    with _lock:
        stamps, made = _expanded.get(key, ({}, ""))
        if not stamps or stamps != {file: _stamp(file) for file in stamps}:
            asked = _Arguments({**usual, **given})
            files, made = _expand(text, path, asked)
            for name in given:
                if name not in asked.asked:
                    raise MissingName(f"xacro argument of {path.name}:", name, sorted(asked.asked))
            while len(_expanded) >= _MOST_EXPANDED:
                del _expanded[next(iter(_expanded))]
            _expanded[key] = {file: _stamp(file) for file in files}, made
    return made


def as_text(value: Value) -> str:
    """An argument as it would be typed."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def _stamp(file: Path) -> tuple[int, int]:
    try:
        status = file.stat()
    except OSError:
        return 0, 0
    return status.st_mtime_ns, status.st_size


class _Arguments(dict[str, str]):
    """Arguments that remember which were asked for, and which of these was missing."""

    def __init__(self, given: Mapping[str, str]) -> None:
        super().__init__(given)
        self.asked: set[str] = set()
        self.missing = ""

    def __contains__(self, name: object) -> bool:
        self.asked.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.asked.add(name)
        return super().__getitem__(name)

    def __missing__(self, name: str) -> str:
        self.missing = name
        raise KeyError(name)


def _expand(text: str, path: Path, arguments: _Arguments) -> tuple[set[Path], str]:
    """Files that were read, and the URDF."""
    with extra("xacro", "xacro"):
        import xacro
    found: dict[str, Path] = {}
    xacro.all_includes.clear()
    quiet = io.StringIO()  # it warns of what is old, not of what is wrong
    try:
        with _finding(path, found), redirect_stdout(quiet), redirect_stderr(quiet):
            root = xacro.process_file(str(path), mappings=arguments).documentElement
    except Exception as error:  # noqa: BLE001 - expressions in files raise anything
        raise JointplayError(_fault(error, path, arguments, xacro)) from None
    if root.tagName == "robot" and not root.getElementsByTagName("link"):
        macros = ", ".join(_MACRO.findall(text))
        hint = f": it only defines {macros}; give the file that uses it" if macros else ""
        raise JointplayError(f"xacro {str(path)!r} makes no link{hint}")
    files = {path, *(Path(name).absolute() for name in xacro.all_includes)}
    return files, _portable(root.toxml(), path.parent, found)


@contextmanager
def _finding(path: Path, found: dict[str, Path]) -> Iterator[None]:
    """Have the library find packages as `packages.find` does, which writes them into `found`."""
    from xacro import substitution_args

    def find(name: str) -> str:
        folder = packages.find(name, path)
        if folder is None:
            above = path.resolve().parents[: packages.ABOVE]
            raise JointplayError(
                f"no package {name!r} in the folders from {above[0]} up to {above[-1]}, nor in "
                f"{' or '.join(packages.VARIABLES)}; put it beside the robot's package, or set "
                "ROS_PACKAGE_PATH to the folder that has it"
            )
        found[name] = folder
        return str(folder)

    before = substitution_args._eval_find
    substitution_args._eval_find = substitution_args._eval_dict["find"] = find
    try:
        yield
    finally:
        substitution_args._eval_find = substitution_args._eval_dict["find"] = before


def _fault(error: Exception, path: Path, arguments: _Arguments, xacro: Any) -> str:
    """What is wrong, and where: the file, the one that it includes, the macro."""
    cause: Any = error
    while isinstance(getattr(cause, "exc", None), Exception):
        cause = cause.exc
    name = arguments.missing
    if name and cause.args == (name,):
        words = f"argument {name!r} has no value: give it by --xacro {name}:=VALUE"
        words += f", or robot.xacro.{name} in a scenario"
    elif isinstance(cause, JointplayError | xacro.substitution_args.SubstitutionException):
        words = str(cause)
    elif isinstance(cause, OSError):
        words = f"cannot read {str(cause.filename)!r}: {cause.strerror}"
        if arguments:
            words += (
                f"; arguments are {few([f'{key}={value}' for key, value in arguments.items()])}"
            )
    elif isinstance(cause, RecursionError):
        words = "macros call each other without end"
    else:
        words = str(error) or repr(error)
    file = Path((xacro.filestack or [path])[-1] or path)
    macros = [one.body.getAttribute("name") for one in xacro.macrostack or ()]
    places = [f"file {str(file)!r}"] if file != path else []
    places += [f"macro {macros[-1]!r}"] if macros else []
    where = f" ({', '.join(places)})" if places else ""
    return f"xacro {str(path)!r}{where}: {words}"


def _portable(text: str, folder: Path, found: Mapping[str, Path]) -> str:
    """A URDF that names no folder of this machine, as far as its packages and its own one go."""
    names = {f"{place}/": f"package://{name}/" for name, place in found.items()}
    for place, name in ({f"{folder}/": ""} | names).items():
        # Some write file:///$(find NAME).
        text = re.sub(f"(?:file:///?)?{re.escape(place)}", name, text)
    return text
