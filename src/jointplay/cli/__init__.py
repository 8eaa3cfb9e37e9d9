"""The command line: a module for each command, and one line that says what is wrong."""

import argparse
import ast
import copy
import errno
import gc
import importlib
import inspect
import re
import sys
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any, NoReturn

from jointplay.base import signals, streams
from jointplay.base.errors import JointplayError, one_line
from jointplay.base.modules import import_module
from jointplay.base.signals import INTERRUPTED
from jointplay.cli.commands import (
    FRONT,
    GROUPS,
    KINDS,
    PLACE,
    SHARED,
    TYPES,
    UNITS,
    Entry,
    in_unit,
    inputs,
    listed,
    read_help,
)

BAD_INPUT = 2
STOPPED = 1


FIRST = 'jointplay run ar4 --gear joint_2="0.5 deg" --out ar4'
"""What a newcomer types, of a robot that ships."""

ENDING = """jointplay COMMAND --help shows what is needed most often, --help all everything.
Values are in SI units (m, s, kg, N, rad), or carry a unit, as in "0.1 mm"."""


ALL = "{} --help all shows every option, with more about each."


_UNIT, _DEFAULT = r"(?<= )\[[^]]+\](?= \(|$)", r"\((?:default|required)[^)]*\)"
_LONG_DEFAULT = 24
"""Characters; what is longer is only in the long help."""


def in_short(action: argparse.Action) -> argparse.Action:
    """An option with the beginning of its help, its unit and its default."""
    said = action.help or ""
    ends = [found[0] for end in (_UNIT, _DEFAULT) for found in [re.search(end, said)] if found]
    short = re.sub(r"\s*\([^()]*\)|\s*\[[^]]*\]", "", said)
    short = re.split(r"; |: |, such as |, by default ", short, maxsplit=1)[0]
    brief = copy.copy(action)
    brief.help = " ".join([short, *(end for end in ends if len(end) < _LONG_DEFAULT)])
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


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line, and takes -1e-4 and -1,0,0 for values, not for options."""

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options | {"add_help": False})
        self._negative_number_matcher = re.compile(r"-\.?\d")
        self.front = {"of_kind", "place"}
        """What the short help shows."""
        self.add_argument("-h", "--help", action=_Help, dest="help")

    def _get_values(self, action: argparse.Action, arg_strings: list[str]) -> Any:
        if action.option_strings and action.nargs is None and arg_strings == ["--"]:
            self.error(f"argument {'/'.join(action.option_strings)}: '--' is not a value")
        if action.option_strings and any(not text.strip() for text in arg_strings):
            self.error(f"argument {'/'.join(action.option_strings)}: the value is empty")
        return super()._get_values(action, arg_strings)  # type: ignore[misc]

    def parse_known_args(self, args: Any = None, namespace: Any = None) -> Any:
        """Also what has its place behind options: argparse takes all places at the first."""
        found, left = super().parse_known_args(args, namespace)
        for action in self._actions:
            empty = action.nargs == "?" and getattr(found, action.dest, None) is None
            if not action.option_strings and empty and left and not left[0].startswith("-"):
                setattr(found, action.dest, self._get_value(action, left.pop(0)))
        return found, left

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        if isinstance(action, argparse._SubParsersAction) and value not in action.choices:
            from jointplay.base.schema import one_of  # takes long to import

            self.error(one_of(str(action.metavar).lower(), value, action.choices))
        super()._check_value(action, value)

    def help_text(self, every: bool) -> str:
        """The help, with every option, or on one screen those that are most often needed."""
        if self.prog == "jointplay":
            return f"{overview()}\n"
        inputs.explain(self)
        if every:
            return self.format_help()
        formatter = argparse.HelpFormatter(self.prog, max_help_position=28)
        formatter.add_usage(self.usage, (), ())
        formatter.add_text(self.description)
        formatter.start_section(None)
        shown = [one for one in self._actions if one.dest in self.front]
        shown.sort(key=lambda one: (bool(one.option_strings), one.dest in inputs.INPUT_OPTIONS))
        formatter.add_arguments(map(in_short, shown))
        formatter.end_section()
        formatter.add_text(ALL.format(self.prog))
        return formatter.format_help()

    def error(self, message: str) -> NoReturn:
        message = one_line(message)
        self.exit(BAD_INPUT, f"{self.prog}: error: {message} (see {self.prog} --help)\n")


def parser(only: str | None = None) -> argparse.ArgumentParser:
    """The parser of the command line, of all commands or, which is sooner made, only of one."""
    made = _Parser(prog="jointplay", usage="jointplay COMMAND ...")
    made.add_argument("--version", action="store_true", help="print the version and exit")
    commands = made.add_subparsers(dest="command", metavar="COMMAND")
    for name in (name for names in GROUPS.values() for name in names):
        if only not in (None, name):
            commands.add_parser(name)
            continue
        command = _add_command(commands, (name,))
        if name in KINDS:
            kinds = command.add_subparsers(dest="of_kind", metavar="KIND", title="kinds")
            for kind in KINDS[name]:
                _add_command(kinds, (name, kind))
    return made


def _help_of(words: Sequence[str]) -> tuple[str, list[str], list[Entry]]:
    """Summary, further paragraphs and options of a command, from its module's docstring."""
    module = importlib.import_module(f"jointplay.cli.commands.{'.'.join(words)}")
    text = module.__doc__ or ast.get_docstring(ast.parse(inspect.getsource(module)), clean=False)
    (title, *prose), found = read_help(text or "")
    return title.partition(": ")[2].rstrip("."), prose, found


def parsers() -> dict[str, argparse.ArgumentParser]:
    """The parser of every command, by the words that are typed for it, such as ``study sweep``."""
    found = _choices(parser())
    for name in KINDS:
        group = found.pop(name)
        found |= {f"{name} {kind}": one for kind, one in _choices(group).items()}
    return found


def _choices(parser: argparse.ArgumentParser) -> dict[str, Any]:
    (action,) = (one for one in parser._actions if isinstance(one, argparse._SubParsersAction))
    return dict(action.choices)


def overview() -> str:
    """What `jointplay` alone prints: the commands by what they are for, and where to begin."""
    lines = [
        "jointplay simulates robots and linkages whose joints have play: each journal flies, hits,",
        "slides and tilts in its bearing, and the tool loses accuracy.",
        "",
        f"begin with:  {FIRST}",
        "",
    ]
    for group, names in GROUPS.items():
        front = [name for name in names if name in FRONT] or list(names)
        rows = [f"{name:<10}{_help_of((name,))[0]}" for name in front]
        if others := [name for name in names if name not in front]:
            rows.append(f"also {', '.join(others)}")
        lines += [f"  {title:<11}{row}" for title, row in zip_longest((group,), rows, fillvalue="")]
    return "\n".join([*lines, "", ENDING])


def _add_command(commands: Any, words: tuple[str, ...]) -> argparse.ArgumentParser:
    """Add the parser of the command of a module, made from its docstring."""
    summary, prose, found = _help_of(words)
    form = [one for one, about, _ in found if one[0] != "-" or about.endswith("(required)")]
    form += ["KIND"] if words[0] in KINDS and len(words) == 1 else []
    parser: argparse.ArgumentParser = commands.add_parser(
        words[-1],
        prog=" ".join(["jointplay", *words]),
        usage=" ".join(["jointplay", *words, *form, "[options]"]),
        help=summary.replace("%", "%%"),
        description=(prose or [f"{summary[0].upper()}{summary[1:]}."])[0],
        epilog=" ".join(prose[1:]),
    )
    parser.set_defaults(path=words)
    groups: dict[str, Any] = {"": parser}
    own = {typed.partition(" ")[0] for typed, *_ in found}
    for typed, about, group in found:
        if PLACE in typed:
            parser.add_argument(
                "place", nargs="?" if typed[0] == "[" else None, metavar=PLACE, help=inputs.ABOUT
            )
            for one in inputs.entries(parser, about):
                if one[0].partition(" ")[0] not in own:
                    _add_entry(parser, groups, *one)
        else:
            _add_entry(parser, groups, typed, about, group)
    return parser


def _add_entry(parser: Any, groups: dict[str, Any], words: str, about: str, group: str) -> None:
    """Add an option, or what stands at its place without a name."""
    if group not in groups:
        groups[group] = parser.add_argument_group(group)
    several, words = words.endswith(" ..."), words.removesuffix(" ...")
    name, _, form = words.partition(" ")
    more: dict[str, Any] = {}
    if not name.startswith("-"):  # its name is the form
        form = words.strip("[]")
        name = form.lower()
        more["nargs"] = "+" if several else "?" if words[0] == "[" else None
        several = False
    elif not form:
        more["action"] = "store_true"
    elif form.startswith("["):
        form, _, more["const"] = form.strip("[]").partition("=")
        more["nargs"] = "?"
    if form.startswith("{"):
        more["choices"] = form.strip("{}").split(",")
    elif form:
        more["metavar"] = form
    if form in UNITS:
        more["type"] = in_unit(UNITS[form])
        if unit := UNITS[form]:
            about = re.sub(r"(?= \((?:default|required)|$)", f" [{unit}]", about, count=1)
    elif form in TYPES:
        more["type"] = TYPES[form]
    if several:
        more |= {"action": "extend" if more.get("type") is listed else "append", "default": []}
        about += " (repeatable)"
    elif default := re.search(r"\(default ([^)]+)\)", about):
        more["default"] = default[1]
    if name.startswith("-") and about.endswith("(required)"):
        more["required"] = True
    if "const" in more and "type" in more:
        more["const"] = more["type"](more["const"])
    action = groups[group].add_argument(*name.split(","), help=about.replace("%", "%%"), **more)
    if name in inputs.FRONT_OPTIONS or not (group or name in SHARED):
        parser.front.add(action.dest)


_GARBAGE = (50_000, 20, 50)
"""When garbage is collected: by Python's own thresholds it takes a tenth of a short run."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line; returns the exit status.

    0: done, also if told to stop when all was computed: then it is saved. 1: the simulation
    stopped early (kept as far as it came). 2: wrong input. 3: an alarm of `identify`. 130: told
    to stop by Ctrl-C, SIGTERM or SIGHUP before all was computed (likewise kept).
    """
    with streams.forgiving():
        try:
            words = sys.argv[1:] if arguments is None else arguments
            if arguments is None:  # a process of our own
                gc.set_threshold(*_GARBAGE)
            made = parser(next((one for one in words if not one.startswith("-")), ""))
            options = made.parse_args(words)
            with signals.listening():
                status = _command(made, options)
            sys.stdout.flush()  # what cannot be written must show here
            return status
        except BrokenPipeError:  # the reader, such as `head`, has seen enough
            streams.silence(sys.stdout)
            return STOPPED
        except OSError as error:  # of a file that has a name, else standard output on a full disk
            # Files of ours say their name; what is left of a full disk is standard output.
            full = error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
            what = "cannot print" if full or streams.full(sys.stdout) else "the system reports"
            if error.filename:
                what = f"cannot use {str(error.filename)!r}"
            streams.silence(sys.stdout)
            print(f"jointplay: error: {what}: {one_line(error.strerror or error)}", file=sys.stderr)
            return STOPPED
        except KeyboardInterrupt:  # once more, while ending
            return INTERRUPTED


def _command(parser: argparse.ArgumentParser, options: argparse.Namespace) -> int:
    """Do what the options say; errors are one line."""
    if options.version:
        from importlib.metadata import version

        print(f"jointplay {version('jointplay')}")
        return 0
    if options.command is None:
        print(overview())
        return 0
    if options.command in KINDS and options.of_kind is None:
        print(_choices(parser)[options.command].help_text(False), end="")
        return 0
    try:
        with streams.noting(getattr(options, "quiet", False)):
            for module in getattr(options, "import", ()):
                import_module(module)
            module = ".".join(options.path)
            return int(importlib.import_module(f"jointplay.cli.commands.{module}").run(options))
    except JointplayError as error:
        return _refuse(options, str(error))
    except KeyboardInterrupt as error:
        return _interrupted(str(error))
    except (ArithmeticError, ValueError) as error:
        # Converters written in C, such as matplotlib's, report the interrupt as a wrong value.
        if signals.stop_requested():
            return _interrupted("")
        numpy = sys.modules.get("numpy")
        linear = () if numpy is None else (numpy.linalg.LinAlgError,)
        if not isinstance(error, (ArithmeticError, *linear)):
            raise
        reason = f"one of them is far too large or too small ({error})"
        return _refuse(options, f"these numbers cannot be computed with: {reason}")
    except MemoryError:
        less = "record less often, or simulate a shorter time"
        return _refuse(options, f"this machine has too little memory for it; {less}")


def _interrupted(lost: str) -> int:
    """Say what was given up, and what is there."""
    from jointplay.base import files

    parts = [lost] if lost else []
    if files.written:
        names = ", ".join(path.name for path in files.written)
        parts.append(f"{files.written[0].parent} contains {names}")
    kept = "; ".join(parts or ["nothing was written"])
    print(f"\ninterrupted; {kept}", file=sys.stderr)
    return INTERRUPTED


def _refuse(options: argparse.Namespace, reason: str) -> int:
    """Say why there are no results, and remove the folders that were made for them."""
    from jointplay.base import files

    files.remove_made_folders()
    print(f"jointplay {' '.join(options.path)}: error: {reason}", file=sys.stderr)
    return BAD_INPUT
