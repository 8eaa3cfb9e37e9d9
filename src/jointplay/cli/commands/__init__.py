"""The commands, a module each, and what they share: answers, notes, JSON, output files.

A command's docstring heads its help: summary, description, epilog. Its `declare` adds options to
its parser; its `run` does the work and returns the exit status, and imports there what takes long
to import.
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
    "export": ("export",),
    "look up": ("robots",),
    "the paper": ("scara",),
}
"""Commands by purpose, in the order of the help; each is a module."""

KINDS = {
    "study": ("sweep", "iso9283", "uncertainty", "wear", "dynamics", "hunting"),
    "export": ("result", "simulator", "urdf"),
}
"""Commands with several kinds: packages with a module for each kind."""

FRONT = ("run", "study", "budget", "identify", "play", "live", "report", "export")
"""Commands that the overview explains; it only names the others."""

MEASURED = ("write_preset", "urdf", "mjcf")
"""Options that write files of a measured robot."""
MOST_NOTES = 3
"""Most notes that are printed without ``--detail`` (judged: tool, sizes and motion decide most)."""
MORE = "(more with --detail)"


def first_notes(lines: Iterable[str], detail: bool) -> list[str]:
    """The first `MOST_NOTES` lines on choices and assumptions, and every "note:" and warning.

    `detail`: all lines.
    """
    shown, left = list[str](), MOST_NOTES
    for line in lines:
        always = detail or line.startswith(("note:", "warning:"))
        if always or left:
            shown.append(line)
            left -= not always
    return shown


def print_answer(
    sentence: str,
    body: object,
    notes: Iterable[str],
    options: argparse.Namespace,
    more: bool = False,
    data: Callable[[], Mapping[str, Any]] = dict,
) -> None:
    """Print an answer: a sentence, its tables, and the `first_notes`; or all of it as JSON.

    Args:
        sentence, body, notes: the answer, its tables, and further remarks.
        options: of the command; ``--detail`` prints all notes, ``--json`` prints JSON instead.
        more: whether ``--detail`` would show more of the tables.
        data: returns the tables and numbers of the answer, for JSON.
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
    """Print an answer as JSON: SI units, null for numbers that are not finite.

    Keys of tables end with the unit; values have their origin (`base.origins`).
    """
    text = json.dumps(for_json(answer), indent=1, ensure_ascii=False, allow_nan=False)
    print(text, file=options.json)


def given(options: argparse.Namespace, *names: str) -> dict[str, Any]:
    """Values of the options among `names` that were given, by name."""
    values = {name: getattr(options, name) for name in names}
    return {name: value for name, value in values.items() if value is not None}


def typed(options: argparse.Namespace, names: Iterable[str]) -> list[str]:
    """The options among `names` that were given, as they are typed."""
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
        """Write texts, bytes and figures by name, each whole or not at all, and print their names
        in a line that ends with `further`."""
        if self.folder is None:
            return
        for name, content in contents.items():
            put = files.write if isinstance(content, str | bytes) else files.picture
            put(Path(self.folder) / name, content)
        print(f"written to {self.folder}: {', '.join(contents)}{further}")


def describe(name: str, answer: Any) -> dict[str, str]:
    """An answer's files: its table as CSV, everything as JSON."""
    text = json.dumps(answer.describe(), indent=1) + "\n"
    return {f"{name}.csv": answer.data.csv(), f"{name}.json": text}


def check_measured(options: argparse.Namespace, need: str) -> None:
    """Refuse files of a measured robot that exist, or with --plan, which lacks what they `need`."""
    for option in typed(options, MEASURED):
        if options.plan:
            raise JointplayError(f"{option} needs {need}, not --plan")
        files.check_new(Path(getattr(options, option.strip("-").replace("-", "_"))))


def write_preset(path: str, preset: Any) -> None:
    """Write a preset with a robot's joints, and print how to use it."""
    files.write(Path(path), preset.text)
    print(f"written: {path}; every command takes it as --preset {path}")
