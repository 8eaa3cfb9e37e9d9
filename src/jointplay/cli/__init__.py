"""The command line: finds and runs the module of a command, and reports errors.

Each command is a module in `commands`. An error is one line, and an exit status (`main`).
"""

import argparse
import ast
import errno
import gc
import importlib
import inspect
import io
import os
import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from itertools import zip_longest
from types import ModuleType
from typing import Any

from jointplay.base import files, signals, streams
from jointplay.base.errors import JointplayError, NothingHasPlay, one_line
from jointplay.base.imports import extra
from jointplay.base.modules import import_module
from jointplay.base.signals import INTERRUPTED
from jointplay.cli.commands import FRONT, GROUPS, KINDS
from jointplay.cli.options import BAD_INPUT, FLAG, STOPPED, Parser

SHELLS = ("bash", "zsh", "fish", "tcsh")
"""Shells for which there is a `completion`."""

FIRST = 'jointplay run ar4 --gear joint_2="0.5 deg" --out ar4'
"""A first command for newcomers, with a robot that ships."""

ENDING = """jointplay COMMAND --help shows what is needed most often, --help all shows every option.
Values are in SI units (m, s, kg, N, rad), or carry a unit, as in "0.1 mm"."""


class _Whole(Parser):
    """The parser before a command is named."""

    def help_text(self, every: bool) -> str:
        return f"{overview()}\n"


def parser(only: str | None = None) -> Parser:
    """The parser of the command line; with options of all commands, or faster of `only` one."""
    whole = _Whole(prog="jointplay")
    whole.set_defaults(path=())
    whole.add_argument("--version", **FLAG, help="print the version and exit")
    whole.add_argument("--completion", choices=SHELLS, help="print what has this shell complete "
                      "commands and options, and exit")  # fmt: skip
    commands = whole.add_subparsers(dest="command", metavar="COMMAND", parser_class=Parser)
    for name in (name for names in GROUPS.values() for name in names):
        if only not in (None, name):
            commands.add_parser(name)
            continue
        command = _add_command(commands, (name,))
        if name in KINDS:
            kinds = command.add_subparsers(dest="of_kind", metavar="KIND", title="kinds")
            for kind in KINDS[name]:
                _add_command(kinds, (name, kind))
    return whole


def _module(path: Sequence[str]) -> tuple[ModuleType, str, list[str]]:
    """The module of a command, and from its docstring the summary and the further paragraphs."""
    module = importlib.import_module(f"jointplay.cli.commands.{'.'.join(path)}")
    # Under python -OO there are no docstrings: it is read from the source.
    text = module.__doc__ or ast.get_docstring(ast.parse(inspect.getsource(module)), clean=False)
    title, *prose = (" ".join(part.split()) for part in (text or "").strip().split("\n\n"))
    return module, title.partition(": ")[2].rstrip("."), prose


def parsers() -> dict[str, Parser]:
    """The parser of every command by its words, such as ``study sweep``."""
    commands = parser().choices()
    for name in KINDS:
        group = commands.pop(name)
        commands |= {f"{name} {kind}": command for kind, command in group.choices().items()}
    return commands


def completion(shell: str) -> str:
    """A script that lets a shell complete commands, options, choices and files.

    Raises:
        JointplayError: shtab, which writes it, is not installed.
    """
    with extra("completion", "shtab"):
        import shtab
    whole = parser()
    pending = [whole]
    for command in pending:  # which grows by the commands of each
        command.explain()
        for action in command._actions:
            if isinstance(action, argparse._SubParsersAction):
                pending += action.choices.values()
            elif any(word in str(action.metavar) for word in ("FILE", "RESULT", "CSV", "DATA")):
                action.complete = shtab.FILE  # type: ignore[attr-defined]
            elif action.metavar in ("DIR", "STORE"):
                action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]
    return str(shtab.complete(whole, shell=shell))


def overview() -> str:
    """The text of `jointplay` without a command: the commands by purpose, and where to begin."""
    lines = [
        "jointplay simulates robots and linkages whose joints have play: each journal flies, hits,",
        "slides and tilts in its bearing, and the tool loses accuracy.",
        "",
        f"begin with:  {FIRST}",
        "",
    ]
    for group, names in GROUPS.items():
        front = [name for name in names if name in FRONT] or list(names)
        rows = [f"{name:<10}{_module((name,))[1]}" for name in front]
        if others := [name for name in names if name not in front]:
            rows.append(f"also {', '.join(others)}")
        lines += [f"  {title:<11}{row}" for title, row in zip_longest((group,), rows, fillvalue="")]
    return "\n".join([*lines, "", ENDING])


def _add_command(commands: Any, path: tuple[str, ...]) -> Parser:
    """Add the parser of a command, with the options that its module declares."""
    module, summary, prose = _module(path)
    parser: Parser = commands.add_parser(
        path[-1],
        prog=" ".join(["jointplay", *path]),
        help=summary.replace("%", "%%"),
        description=(prose or [f"{summary[0].upper()}{summary[1:]}."])[0],
        epilog=" ".join(prose[1:]),
    )
    parser.set_defaults(path=path)
    if hasattr(module, "declare"):
        module.declare(parser)
    return parser


_GARBAGE = (50_000, 20, 50)
"""Thresholds of garbage collection: with Python's own it takes a tenth of a short run."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return the exit status.

    0: done, also if interrupted once all was computed, which is then saved. 1: the simulation
    stopped early; what was done is kept. 2: wrong input. 3: an alarm of `identify`. 130:
    interrupted by Ctrl-C, SIGTERM or SIGHUP before all was computed; what was done is kept.
    """
    with streams.forgiving() as output:
        try:
            typed = sys.argv[1:] if arguments is None else arguments
            if arguments is None:  # this process runs nothing else
                gc.set_threshold(*_GARBAGE)
                # On matrices as small as a machine's, numpy's threads only wait for each other.
                os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
            command = parser(next((word for word in typed if not word.startswith("-")), ""))
            options = command.parse_args(typed)
            with signals.listening(), files.removing_empty_folders():
                status = _command(command, options)
            output.finish()  # so that a failure to print raises here
            return status
        except OSError as error:  # about the file it names, or else standard output on a full disk
            full = error.errno in (errno.ENOSPC, errno.EFBIG, errno.EDQUOT)
            what = "cannot print" if full or error is output.failure else "the system reports"
            if error.filename:
                what = f"cannot use {str(error.filename)!r}"
            print(f"jointplay: error: {what}: {one_line(error.strerror or error)}", file=sys.stderr)
            return STOPPED
        except KeyboardInterrupt:  # a second interrupt, while the first is handled
            return INTERRUPTED


def _command(parser: Parser, options: argparse.Namespace) -> int:
    """Run the command that the options name; an error is reported in one line."""
    if options.version:
        from importlib.metadata import version

        print(f"jointplay {version('jointplay')}")
        return 0
    if options.command is None and options.completion is None:
        print(overview())
        return 0
    if options.command in KINDS and options.of_kind is None:
        print(parser.choices()[options.command].help_text(False), end="")
        return 0
    try:
        with streams.noting(getattr(options, "quiet", False)):
            for module in getattr(options, "import", ()):
                import_module(module)
            if options.completion:
                print(completion(options.completion))
                return 0
            module = importlib.import_module(f"jointplay.cli.commands.{'.'.join(options.path)}")
            if not getattr(options, "json", False):
                return int(module.run(options))
            options.json = sys.stdout  # nothing but JSON may be printed there
            with redirect_stdout(io.StringIO()):
                return int(module.run(options))
    except NothingHasPlay as error:
        from jointplay.cli.commands.inputs import own_preset

        needed = NothingHasPlay(error.joints, own_preset(options), hasattr(options, "clearance"))
        return _refuse(options, str(needed))
    except JointplayError as error:
        return _refuse(options, str(error))
    except KeyboardInterrupt as error:
        return _interrupted(str(error))
    except (ArithmeticError, ValueError, RuntimeError) as error:
        # An interrupt inside a converter written in C raises ValueError, and in Python 3.11 one
        # during the creation of a class raises RuntimeError.
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
    """Report an interrupt: what was given up (`lost`), and which files exist."""
    parts = [lost] if lost else []
    if there := [path for path in files.written if path.exists()]:
        names = ", ".join(path.name for path in there)
        parts.append(f"{there[0].parent} contains {names}")
    kept = "; ".join(parts or ["nothing was written"])
    print(f"\ninterrupted; {kept}", file=sys.stderr)
    return INTERRUPTED


def _refuse(options: argparse.Namespace, reason: str) -> int:
    """Report why there are no results."""
    print(f"{' '.join(['jointplay', *options.path])}: error: {reason}", file=sys.stderr)
    return BAD_INPUT
