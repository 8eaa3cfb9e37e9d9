"""Commands of the command line, one module each, and what they have in common.

The docstring of a module is the head of its help: summary, description, epilog. `declare` adds its
options to its parser; `run` does the work and returns the exit status; what takes long to import is
imported there.
"""

import argparse
import json
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.tables import for_json

GROUPS = {
    "simulate": ("run", "study", "check", "init"),
    "decide": ("budget", "allocate", "compensate"),
    "measure": ("identify", "calibrate"),
    "look": ("play", "live", "report", "compare", "plot"),
    "hand on": ("export",),
    "know": ("robots",),
    "the paper": ("scara",),
}
"""Commands by what they are for, each a module, in the order of the help."""

KINDS = {
    "study": ("sweep", "iso9283", "uncertainty", "wear", "dynamics", "hunting"),
    "export": ("result", "simulator", "urdf"),
}
"""Commands of several kinds: packages with a module for each."""

FRONT = ("run", "study", "budget", "identify", "play", "live", "report", "export")
"""What a newcomer is shown first."""

MEASURED = ("write_preset", "urdf", "mjcf")
"""Options for files of a robot that was measured."""
MOST_NOTES = 3
"""Lines about what was chosen and assumed that are printed without ``--detail`` (judged:
tool, sizes and motion are those that decide most)."""
MORE = "(more with --detail)"


def first_notes(lines: Iterable[str], detail: bool) -> list[str]:
    """The first lines of those that say what was chosen and assumed, and every "note:" and warning.

    `detail`: all of them.
    """
    shown: list[str] = []
    left = MOST_NOTES
    for line in lines:
        heard = line.startswith(("note:", "warning:"))
        if detail or heard or left:
            shown.append(line)
            left -= not (detail or heard)
    return shown


def print_answer(
    sentence: str,
    body: object,
    notes: Iterable[str],
    options: argparse.Namespace,
    more: bool = False,
    data: Callable[[], Mapping[str, Any]] = dict,
) -> None:
    """Print an answer in a sentence, its tables, and of the notes the `first_notes`.

    Args:
        sentence, body, notes: the answer, its tables and what else to know, for readers.
        options: of the command; ``--detail`` prints all notes, ``--json`` JSON instead.
        more: whether the tables have more in detail.
        data: gives the tables and numbers of the answer, for JSON.
    """
    notes, detail = list(dict.fromkeys(notes)), options.detail
    if getattr(options, "json", None):
        print_json(options, {"answer": sentence, **data(), "notes": notes})
        return
    shown = first_notes(notes, detail)
    more = len(shown) < len(notes) or (more and not detail)
    lines = [sentence, str(body), *shown, *([MORE] if more else [])]
    print("\n".join(filter(None, lines)))


def print_json(options: argparse.Namespace, answer: Mapping[str, Any]) -> None:
    """Print an answer as JSON: SI units, null for what is no finite number.

    Keys of tables end with the unit; values have the origin that they have in `base.origins`.
    """
    text = json.dumps(for_json(answer), indent=1, ensure_ascii=False, allow_nan=False)
    print(text, file=options.json)


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Values of those options that were given, by name."""
    values = {name: getattr(options, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def typed(options: argparse.Namespace, names: Iterable[str]) -> list[str]:
    """Those options that were given, as they are typed."""
    values = {name: getattr(options, name, None) for name in names}
    names_given = [name for name, value in values.items() if value not in (None, [], False)]
    return [f"--{name.replace('_', '-')}" for name in names_given]


class Outputs:
    """The files that a command writes into the folder of ``--out``; without the option, none.

    Raises:
        JointplayError: the folder holds one of them, known before anything slow is loaded.
    """

    def __init__(self, folder: str | None, names: Iterable[str]) -> None:
        self.folder, self.names = folder, list(names)
        if folder:
            files.refuse_present(folder, self.names)

    def claim(self) -> Path | None:
        """Make the folder, sure that the files can be written there (`files.claim`)."""
        return files.claim(self.folder, self.names) if self.folder else None

    def write(self, contents: Mapping[str, Any], further: str = "") -> None:
        """Write texts, bytes and figures by name, each whole or not at all, and print their names.

        `further` is what else the line says.
        """
        if self.folder is None:
            return
        for name, content in contents.items():
            put = files.write if isinstance(content, str | bytes) else files.picture
            put(Path(self.folder) / name, content)
        print(f"written to {self.folder}: {', '.join(contents)}{further}")


def describe(name: str, answer: Any) -> dict[str, str]:
    """Contents of files with the table and all else of an answer."""
    text = json.dumps(answer.describe(), indent=1) + "\n"
    return {f"{name}.csv": answer.data.csv(), f"{name}.json": text}


def check_measured(options: argparse.Namespace, need: str) -> None:
    """Refuse files of what is measured that exist, or for which `need` is lacking."""
    for option in typed(options, MEASURED):
        if options.plan:
            raise JointplayError(f"{option} needs {need}, not --plan")
        files.check_new(Path(getattr(options, option.strip("-").replace("-", "_"))))


def write_preset(path: str, preset: Any) -> None:
    """Write a preset of one's own, and say how to use it."""
    files.write(Path(path), preset.text)
    print(f"written: {path}; every command takes it as --preset {path}")
