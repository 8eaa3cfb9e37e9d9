"""Mutation testing: each deliberate mistake in geometry, laws, solver and audit must fail a test.

    python benchmarks mutation                     every mutant of every target (hours)
    python benchmarks mutation --target geometry --sample 60

One operator or number of a module is changed at a time; the tests of that module run on the changed
copy of the package, uncompiled where they can be (numba's JIT off, its cache elsewhere). A mutant
that no test notices survives. Survivors known to change nothing are in mutation_survivors.toml,
each with its reason. Fails if fewer than 90 % die, or a survivor is not explained.

What is changed: + - * / **, comparisons (to their opposite), signs, and/or, sin/cos, min/max, each
number (doubled; 0 to 1, integers plus 1), each augmented assignment (left out). What is not: texts,
annotations, default arguments, errors raised, tolerances (numbers below 1e-6) and counts of
iterations.
"""

import ast
import contextlib
import copy
import os
import random
import shutil
import signal
import sys
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from common import ROOT, command

from jointplay.base.files import temporary

PACKAGE = ROOT / "src" / "jointplay"
EXPLAINED = Path(__file__).with_name("mutation_survivors.toml")

LAWS = (
    "tests/physics/contact/test_restitution.py",
    "tests/physics/contact/test_line_contact.py",
    "tests/physics/contact/test_contact_laws.py",
    "tests/physics/contact/test_validity.py",
)
QUICK = "geometry"
TARGETS: dict[str, tuple[tuple[str, ...], tuple[str, ...]]] = {
    "geometry": (
        ("physics/geometry/cylinder.py", "physics/geometry/contacts.py"),
        (
            "tests/physics/geometry/test_geometry.py",
            "tests/physics/geometry/test_geometry_properties.py",
        ),
    ),
    "laws": (
        (
            "physics/contact/hertzian.py",
            "physics/contact/line_contact.py",
            "physics/contact/linear.py",
        ),
        LAWS,
    ),
    "friction": (
        ("physics/contact/friction.py", "physics/contact/bristle.py"),
        (
            "tests/physics/contact/test_contact_laws.py",
            "tests/physics/contact/test_friction.py",
            "tests/physics/test_bristles.py",
        ),
    ),
    "film": (("physics/contact/film.py",), ("tests/physics/contact/test_film.py",)),
    "audit": (
        ("simulation/result/audit.py",),
        ("tests/simulation/result/test_audit_figures.py", "tests/simulation/result/test_audit.py"),
    ),
    "solver": (
        ("physics/kernel/solve.py",),
        (
            "tests/physics/kernel/test_multi_rate.py",
            "tests/physics/test_oil.py",
            "tests/simulation/loads/test_loads_together.py",
        ),
    ),
}
"""Modules, and the tests that must notice."""

COMPILED = ("film", "audit", "solver")
"""Targets whose functions call compiled ones: their tests run with numba's JIT on. Code that a
mutant leaves as it is may be kept, for the kernel's cache is stamped by all that it is made of; one
of the solver compiles anew all the same, half a minute."""

WANTED = 0.9
TIMEOUT_S = 300
TOLERANCE = 1e-6

SWAPS = {ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
         ast.Pow: ast.Mult, ast.Mod: ast.Add}  # fmt: skip
OPPOSITES = {ast.Lt: ast.GtE, ast.GtE: ast.Lt, ast.Gt: ast.LtE, ast.LtE: ast.Gt,
             ast.Eq: ast.NotEq, ast.NotEq: ast.Eq}  # fmt: skip
NAMES = {"sin": "cos", "cos": "sin", "min": "max", "max": "min", "tanh": "sin", "atan2": "hypot"}


@dataclass(frozen=True)
class Mutant:
    """One change of a module."""

    module: str
    line: int
    source: str
    """The line as it is."""
    change: str
    """What becomes of what."""
    text: str
    """The module with it."""

    def __str__(self) -> str:
        return f"{self.module}:{self.line}: {self.change}  in: {self.source}"


def sites(tree: ast.AST) -> Iterator[ast.AST]:
    """Nodes that may be changed, in order."""
    skipped: set[int] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
            parts += node.decorator_list
            if isinstance(node, ast.FunctionDef):
                parts += [node.returns, *(a.annotation for a in node.args.args)]
                parts += [*node.args.defaults, *node.args.kw_defaults]
        if isinstance(node, ast.AnnAssign):
            parts.append(node.annotation)
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert):
            parts.append(node)
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "range":
            parts += node.args
        if isinstance(node, ast.BinOp) and isinstance(node.op, ast.BitOr):
            parts.append(node)
        for part in parts:
            if part is not None:
                skipped.update(id(child) for child in ast.walk(part))
    return (node for node in ast.walk(tree) if id(node) not in skipped)


def changes(node: ast.AST) -> Iterator[tuple[str, ast.AST]]:
    """What a node may become, with words for it."""
    if isinstance(node, ast.BinOp | ast.AugAssign) and type(node.op) in SWAPS:
        new = copy.deepcopy(node)
        new.op = SWAPS[type(node.op)]()
        yield f"{type(node.op).__name__} to {type(new.op).__name__}", new
    if isinstance(node, ast.AugAssign):
        yield "left out", ast.Pass()
    if isinstance(node, ast.Compare) and type(node.ops[0]) in OPPOSITES:
        new = copy.deepcopy(node)
        new.ops[0] = OPPOSITES[type(node.ops[0])]()
        yield f"{type(node.ops[0]).__name__} to {type(new.ops[0]).__name__}", new
    if isinstance(node, ast.BoolOp):
        new = copy.deepcopy(node)
        new.op = ast.Or() if isinstance(node.op, ast.And) else ast.And()
        yield "and/or exchanged", new
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not):
        yield f"{type(node.op).__name__} left out", node.operand
    if isinstance(node, ast.Constant) and type(node.value) in (int, float):
        value = node.value
        if value == 0 or abs(value) >= TOLERANCE:
            other = value + 1 if isinstance(value, int) or value == 0 else 2.0 * value
            yield f"{value!r} to {other!r}", ast.Constant(other)
    if isinstance(node, ast.Call):
        function = node.func
        name = getattr(function, "attr", getattr(function, "id", ""))
        if name in NAMES:
            new = copy.deepcopy(node)
            if isinstance(function, ast.Attribute):
                new.func.attr = NAMES[name]
            else:
                new.func.id = NAMES[name]
            yield f"{name} to {NAMES[name]}", new


class _Put(ast.NodeTransformer):
    """Puts a node in another's place."""

    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self.old, self.new = old, new

    def visit(self, node: ast.AST) -> ast.AST:
        return self.new if node is self.old else self.generic_visit(node)


def mutants(module: str, text: str) -> list[Mutant]:
    """All mutants of a module's text."""
    lines, tree, found = text.splitlines(), ast.parse(text), []
    for node in list(sites(tree)):
        for what, new in changes(node):
            changed = ast.fix_missing_locations(_Put(node, new).visit(tree))
            line = getattr(node, "lineno", 0)
            found.append(Mutant(module, line, lines[line - 1].strip(), what, ast.unparse(changed)))
            _Put(new, node).visit(tree)
    return found


def survives(mutant: Mutant, tests: Sequence[str], where: Path, compiled: bool = False) -> bool:
    """Whether all tests pass on the mutant; it runs in a process of its own."""
    path = where / "jointplay" / mutant.module
    original = path.read_text(encoding="utf-8")
    path.write_text(mutant.text, encoding="utf-8")
    status = _apart(["-x", *tests], where, compiled)
    path.write_text(original, encoding="utf-8")
    return status == 0


def unusable(tests: Sequence[str], where: Path, compiled: bool) -> list[str]:
    """Tests that fail without any change: they need compiled kernels, which are off here."""
    with temporary("mutation") as folder:
        file = Path(folder) / "failures.txt"
        file.touch()
        _apart(list(tests), where, compiled, str(file))
        return file.read_text(encoding="utf-8").split("\n")[:-1]


def _apart(arguments: Sequence[str], where: Path, compiled: bool, failures: str = "") -> int:
    """Exit status of a pytest in a process of its own, on the package in `where`."""
    cache = str(where / "cache")
    child = os.fork()
    if child == 0:  # pragma: no cover
        code = 3
        try:
            signal.alarm(TIMEOUT_S)
            with open(os.devnull, "w") as nothing:
                os.dup2(nothing.fileno(), 1)
                os.dup2(nothing.fileno(), 2)
            code = _run_tests(arguments, where, cache, compiled, failures)
        finally:
            os._exit(code)
    _, status = os.waitpid(child, 0)
    return status


def _run_tests(
    arguments: Sequence[str], where: Path, cache: str, compiled: bool, failures: str
) -> int:
    import numba
    import pytest

    class Failed:
        """Writes down what fails."""

        def pytest_runtest_logreport(self, report: object) -> None:
            if failures and report.failed:
                with open(failures, "a", encoding="utf-8") as file:
                    file.write(f"{report.nodeid}\n")

    for name in list(sys.modules):  # what the parent has loaded is not the mutant
        if name.split(".")[0] in ("jointplay", "conftest") or name.startswith("test_"):
            del sys.modules[name]
    sys.dont_write_bytecode = True
    sys.path.insert(0, str(where))
    numba.config.DISABLE_JIT = not compiled
    numba.config.CACHE_DIR = cache
    os.chdir(ROOT)
    options = ["-q", "-n", "0", "-p", "no:cacheprovider", "-W", "ignore"]
    return int(pytest.main([*options, *arguments], plugins=[Failed()]))


def explanations() -> dict[tuple[str, str, str], str]:
    """Reasons by module, line and change."""
    if not EXPLAINED.exists():
        return {}
    table = tomllib.loads(EXPLAINED.read_text(encoding="utf-8"))
    return {
        (entry["module"], line, change): entry["reason"]
        for entry in table.get("survivor", [])
        for line in entry["lines"]
        for change in entry["changes"]
    }


@contextlib.contextmanager
def copied() -> Iterator[Path]:
    """A copy of the package to change."""
    with temporary("mutation") as folder:
        where = Path(folder)
        ignored = shutil.ignore_patterns("__pycache__", "*.min.js")
        shutil.copytree(PACKAGE, where / "jointplay", ignore=ignored)
        shutil.copytree(ROOT / "urdf", where / "jointplay" / "shipped")
        yield where


def main(arguments: Sequence[str] | None = None) -> int:
    own = {"sample": (0, "so many mutants of each target; 0: all"), "seed": (0, "of the sample")}
    parser = command(__doc__, f"one mutant of {QUICK}", **own)
    parser.add_argument("--target", action="append", choices=list(TARGETS), help="repeatable")
    options = parser.parse_args(arguments)
    if options.quick:
        options.target, options.sample = options.target or [QUICK], 1
    known, good = explanations(), True
    import numba  # loaded once, before the processes of the mutants  # noqa: F401
    import numpy  # noqa: F401
    import scipy.optimize  # noqa: F401

    for target in options.target or TARGETS:
        modules, tests = TARGETS[target]
        every = [m for name in modules for m in mutants(name, (PACKAGE / name).read_text("utf-8"))]
        total = len(every)
        if options.sample and options.sample < total:
            every = random.Random(options.seed).sample(every, options.sample)
        left, excused = [], 0
        with copied() as where:
            compiled = target in COMPILED
            off = unusable(tests, where, compiled)
            arguments = [*tests, *(f"--deselect={name}" for name in off)]
            text = (PACKAGE / modules[0]).read_text("utf-8")
            itself = Mutant(modules[0], 0, "", "nothing", ast.unparse(ast.parse(text)))
            if not survives(itself, arguments, where, compiled):
                print(f"{target}: its tests fail without a change; nothing is learnt from mutants")
                return 2
            for n, mutant in enumerate(every, 1):
                if survives(mutant, arguments, where, compiled):
                    reason = known.get((mutant.module, mutant.source, mutant.change))
                    excused += reason is not None
                    if reason is None:
                        left.append(mutant)
                        print(f"survives: {mutant}", flush=True)
                if sys.stderr.isatty():
                    print(f"\r{target}: {n}/{len(every)}", end="", file=sys.stderr)
        killed = len(every) - len(left) - excused
        # An explained survivor is the same program: no test can tell it.
        share = killed / max(len(every) - excused, 1)
        print(
            f"{target}: {killed} of {len(every)} mutants killed ({total} in all), {excused} "
            f"survivors explained, {len(left)} not: {100 * share:.1f} % of those that can be; "
            f"{len(off)} tests that need compiled kernels left out"
        )
        good = good and share >= WANTED and not left
    return 0 if good or options.quick else 1
