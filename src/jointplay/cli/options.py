"""Options of commands: argparse with units, shared declarations, two sizes of help, short errors.

A command's module declares options in `declare`, by argparse's ``add_argument``; its docstring
heads its help. `--help` shows the options that are needed most often, `--help all` every option.
"""

import argparse
import copy
import csv
import re
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from jointplay.base.errors import JointplayError, closest, one_line
from jointplay.base.pairs import quantity

STOPPED, BAD_INPUT = 1, 2
ALL = "{} --help all shows every option, with more about each."
LONG_DEFAULT = 24
"""Longest default that the short help shows [letters] (judged: longer ones are explanations)."""


class Number:
    """Converts an option's text to a number in SI; the text is a number, or such as ``0.1 mm``."""

    def __init__(self, unit: str) -> None:
        self.unit = unit

    def __call__(self, text: str) -> float:
        try:
            return quantity(text, self.unit)
        except JointplayError as error:
            raise argparse.ArgumentTypeError(str(error)) from None


BY_UNIT = {"m": "LENGTH", "kg": "MASS", "s": "TIME", "rad": "ANGLE", "N": "FORCE"}
"""Placeholder of an option's value in the help, by unit."""
NUMBERS: list[dict[str, Any]] = [{"metavar": w, "type": Number(u)} for u, w in BY_UNIT.items()]
LENGTH, MASS, TIME, ANGLE, FORCE = NUMBERS


def listed(text: str) -> list[str]:
    """The names in a list joined by commas; a name with commas stands in double quotes.

    Raises:
        ArgumentTypeError: a quote that is not closed.
    """
    parts = re.sub(r'(^|,|")\s+(?=$|,|")', r"\1", text)  # blanks around quotes
    try:
        names = next(csv.reader([parts], skipinitialspace=True, strict=True), [])
    except csv.Error as error:
        raise argparse.ArgumentTypeError(f"{text!r}: {error}") from None
    return [name.strip() for name in names if name.strip()]


FLAG: dict[str, Any] = {"action": "store_true"}
REPEATED: dict[str, Any] = {"action": "append", "default": []}
LISTS: dict[str, Any] = {"metavar": "LIST", "type": listed, "action": "extend", "default": []}
"""Declarations of an option without a value, of one that can be repeated, and of one that takes a
list and can be repeated."""

SHARED: dict[str, dict[str, Any]] = {
    "--case": {"metavar": "NAME", "help": "case of the scenario (not needed if there is only one)"},
    "--jobs": {"type": int, "metavar": "N", "help": "processes (default: one per core)"},
    "--quiet": {**FLAG, "help": "do not show progress"},
    "--detail": {**FLAG, "help": "print all details, not only the answer"},
    "--json": {
        **FLAG, "help": "print the answer as JSON alone: numbers in SI, values with their origin"
    },
    "--xacro": {
        **REPEATED, "metavar": "NAME:=VALUE",
        "help": "argument of a robot that is written in xacro"
    },
    "--assumed": {
        **FLAG, "help": "list the assumed values: the rule behind each, and what another value "
        "would change"
    },
    "--write-preset": {
        "metavar": "FILE", "help": "write the robot's joints with the values found, for --preset "
        "FILE of every command"
    },
    "--port": {"metavar": "N", "type": int, "default": 7000, "help": "port to listen on"},
    "--no-browser": {**FLAG, "help": "do not open a browser"},
    "--pdf": {**FLAG, "help": "draw each figure as .pdf, too"},
    "--import": {
        **REPEATED, "metavar": "MODULE", "help": "import this module of your own, by name or file: "
        "a file that is read may name functions in it (none is imported otherwise)"
    },
}  # fmt: skip
"""Options that several commands share."""

FRONT = (
    *("out", "joint", "clearance", "preset", "gear", "friction", "motion", "duration", "pose"),
    *("workspace", "payload", "tool", "set", "case"),
)
"""Options that the short help of commands with input options shows first, in this order."""


def full_help(action: argparse.Action) -> str:
    """The help of an option with its unit, its default, and whether it can be repeated."""
    text = (action.help or "").replace("%", "%%")
    if isinstance(action.type, Number) and action.type.unit:
        text = re.sub(r"(?= \(default|$)", f" [{action.type.unit}]", text, count=1)
    if isinstance(action.default, int | float | str) and not isinstance(action.default, bool):
        text += f" (default {action.default})"
    if isinstance(action, argparse._AppendAction) or isinstance(action.default, list):
        text += " (repeatable)"
    return f"{text} (required)" if action.option_strings and action.required else text


def in_short(action: argparse.Action) -> argparse.Action:
    """A copy of an option for the short help: the help's first clause, unit and default."""
    text = full_help(action)
    short = re.sub(r"\s*\([^()]*\)", "", text)
    short = re.split(r"; |: |, such as |, by default ", short, maxsplit=1)[0]
    ends = re.findall(r"(?<= )\[[^]]+\](?= \(|: |$)", text)[: not short.endswith("]")]
    ends += re.findall(r"\((?:default|required)[^)]*\)", text)[:1]
    brief = copy.copy(action)
    brief.help = " ".join([short, *(end for end in ends if len(end) < LONG_DEFAULT)])
    return brief


class _Help(argparse.Action):
    """``--help``: one screen; ``--help all``: everything."""

    def __init__(self, option_strings: Sequence[str], dest: str) -> None:
        about = "show this help; with all, every option"
        super().__init__(option_strings, dest, nargs="?", metavar="all", help=about)

    def __call__(self, parser: Any, _: Any, values: Any, option: str | None = None) -> None:
        if values not in (None, "all"):
            parser.error(f"{option} takes nothing, or all, got {values!r}")
        print(parser.help_text(values == "all"), end="")
        parser.exit()


class _Formatter(argparse.HelpFormatter):
    def _get_help_string(self, action: argparse.Action) -> str:
        return full_help(action)


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, and which takes -1e-4 and -1,0,0 for values."""

    def __init__(self, *args: Any, **options: Any) -> None:
        options |= {"add_help": False, "allow_abbrev": False, "conflict_handler": "resolve"}
        super().__init__(*args, **options | {"formatter_class": _Formatter})
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self.explained: dict[str, Callable[[], tuple[str, str]]] = {}
        """Functions that return help and placeholder of options for which that takes long."""
        self.behind = {self.add_argument("-h", "--help", action=_Help, dest="help").dest}
        """Options without a group that only the long help shows."""

    def share(self, *names: str, group: str = "") -> None:
        """Add options of `SHARED`, to a group of the help if one is named."""
        for name in names:
            place = self.add_argument_group(group) if group else self
            action = place.add_argument(name, **SHARED[name])
            self.behind |= {action.dest} & {"case", "jobs", "quiet", "json", "import"}

    def add_argument_group(self, title: Any = None, *args: Any, **about: Any) -> Any:
        """The group with this title, which is made if there is none yet."""
        known = (group for group in self._action_groups if group.title == title)
        return next(known, None) or super().add_argument_group(title, *args, **about)

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        if action.option_strings and action.nargs is None and arg_strings == ["--"]:
            self.error(f"argument {'/'.join(action.option_strings)}: '--' is not a value")
        if action.option_strings and any(not text.strip() for text in arg_strings):
            self.error(f"argument {'/'.join(action.option_strings)}: the value is empty")
        return super()._get_values(action, arg_strings)  # type: ignore[misc]

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Parse, also optional positionals behind options: argparse fills all of them, with nothing
        if need be, at the first positional."""
        options, left = super().parse_known_args(args, namespace)
        for action in self._actions:
            empty = action.nargs == "?" and getattr(options, action.dest, None) is None
            if not action.option_strings and empty and left and not left[0].startswith("-"):
                setattr(options, action.dest, self._get_value(action, left.pop(0)))
        if left and self._subparsers is None:  # else the command's own parser has reported it
            begun = [name for name in self._option_string_actions if name.startswith(left[0])]
            hint = closest(left[0], begun or self._option_string_actions, 0.5 if begun else 0.75)
            message = "; ".join(filter(None, (" ".join(left), hint.strip())))
            self.error(f"unrecognized arguments: {message}")
        return options, left

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if action.choices is not None and value not in action.choices:
            from jointplay.base.schema import one_of  # takes long to import

            name = next(iter(action.option_strings), str(action.metavar).lower())
            self.error(one_of(name, value, action.choices))

    def explain(self) -> None:
        """Fill in the help that takes long to find (`explained`)."""
        for action in self._actions:
            if action.dest in self.explained:
                action.help, action.metavar = self.explained[action.dest]()

    def help_text(self, every: bool) -> str:
        """The help with every option, or on one screen the options needed most often."""
        self.explain()
        required = []  # what the usage line shows: positional and required arguments
        for action in self._actions:
            if action.option_strings and not action.required:
                continue
            value = str(action.metavar or f"{{{','.join(map(str, action.choices or ()))}}}")
            if action.nargs in ("+", "?"):
                value = f"{value} ..." if action.nargs == "+" else f"[{value}]"
            required.append(" ".join([*action.option_strings[:1], value]))
        self.usage = " ".join([self.prog, *required, "[options]"])
        if every:
            return self.format_help()
        formatter = argparse.HelpFormatter(self.prog, max_help_position=28)
        formatter.add_usage(self.usage, (), ())
        formatter.add_text(self.description)
        formatter.start_section(None)
        order = {dest: n for n, dest in enumerate(FRONT, -len(FRONT)) if "set" in self.behind}
        shown = [
            action
            for action in self._actions
            if action.dest in order
            or not action.option_strings
            or action.required
            or (action.container is self._optionals and action.dest not in self.behind)  # type: ignore[attr-defined]
        ]
        shown.sort(key=lambda a: (bool(a.option_strings), not a.required, order.get(a.dest, 0)))
        formatter.add_arguments(map(in_short, shown))
        formatter.end_section()
        formatter.add_text(ALL.format(self.prog))
        return formatter.format_help()

    def error(self, message: str) -> NoReturn:
        message = one_line(message)
        self.exit(BAD_INPUT, f"{self.prog}: error: {message} (see {self.prog} --help)\n")

    def choices(self) -> dict[str, "Parser"]:
        """The parsers of its commands, or of a command's kinds, by name."""
        (action,) = (a for a in self._actions if isinstance(a, argparse._SubParsersAction))
        return dict(action.choices)
