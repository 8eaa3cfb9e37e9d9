"""The compiled part as a package: its size, its cache, and that nobody reaches its inside."""

import ast
import importlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit

from jointplay.base import compiler, numba_inside
from jointplay.base.compiler import internal
from jointplay.base.numba_inside import PartLibrary
from jointplay.physics.kernel.entry import ENTRIES

stamp = importlib.import_module("jointplay.physics.kernel.sources")
PACKAGE = Path(stamp.__file__).parent
SOURCE = PACKAGE.parents[1]
MODULES = [path for path in stamp.SOURCES if path.parent == PACKAGE]
HERE = Path(__file__).parent


def test_tests_and_benchmarks_reach_no_private_name_of_the_engine():
    private = re.compile(r"(?<![.\w])(kernel|layout|workspace|run|loop|w)\._(?!_)\w+")
    scripts = [*HERE.rglob("*.py"), *(HERE.parent / "benchmarks").rglob("*.py")]
    found = {
        path.name: private.findall(text)
        for path in scripts
        if private.search(text := path.read_text())
    }
    assert len(scripts) > 50
    assert not found


def test_the_kernel_is_stamped_with_all_its_sources():
    stamps = {entry._cache._cache_file._source_stamp for entry in ENTRIES}
    assert stamps == {stamp.fingerprint()}
    compiled = re.compile(r"\b(njit|internal|inlined)\b")
    assert {p for p in PACKAGE.glob("*.py") if compiled.search(p.read_text())} <= set(stamp.SOURCES)
    assert len(MODULES) > 10


def test_no_compiled_code_of_the_kernel_lies_outside_the_stamped_sources():
    """What a stamped file imports from this package is stamped as well, or is not compiled."""
    for source in stamp.SOURCES:
        for node in ast.walk(ast.parse(source.read_text())):
            if not isinstance(node, ast.ImportFrom) or not node.module.startswith("jointplay"):
                continue
            place = SOURCE.joinpath(*node.module.split(".")[1:])
            file = place / "__init__.py" if place.is_dir() else place.with_suffix(".py")
            compiled = re.search(r"\b(njit|internal|inlined)\b", file.read_text())
            assert file in stamp.SOURCES or not compiled, f"{source.name} imports {node.module}"


def test_touching_any_source_changes_the_stamp(tmp_path, monkeypatch):
    copies = [tmp_path / f"{k}_{source.name}" for k, source in enumerate(stamp.SOURCES)]
    for source, copy in zip(stamp.SOURCES, copies, strict=True):
        shutil.copy(source, copy)
    monkeypatch.setattr(stamp, "SOURCES", tuple(copies))
    stamps = [stamp.fingerprint(), stamp.fingerprint()]
    assert stamps[0] == stamps[1]
    for copy in copies:
        copy.write_text(copy.read_text() + "\n")
        stamps.append(stamp.fingerprint())
    assert len(set(stamps)) == len(copies) + 1


HELPER = """
from numba import njit

@njit
def helper():
    return {}
"""
CALLER = """
import sys
sys.path.insert(0, {folder!r})
from numba import njit
from helper_of_stamp import helper

@njit(cache=True)
def answer():
    return helper()
"""


def test_numba_honours_the_stamp(tmp_path, monkeypatch):
    """A helper in another file changes: the same stamp gives the old code, the new one new code."""
    helper, caller = tmp_path / "helper_of_stamp.py", tmp_path / "caller_of_stamp.py"
    caller.write_text(CALLER.format(folder=str(tmp_path)))
    monkeypatch.setattr("sys.path", ["", *sys.path])

    def answer(value, sources):
        helper.write_text(HELPER.format(value))
        monkeypatch.delitem(sys.modules, "helper_of_stamp", raising=False)
        spec = importlib.util.spec_from_file_location("caller_of_stamp", caller)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        monkeypatch.setattr(stamp, "SOURCES", sources)
        stamp.stamp(module.answer)
        found = module.answer()
        return found, sum(module.answer.stats.cache_hits.values())

    assert answer(1, (caller,)) == (1, 0)
    assert answer(1, (caller,)) == (1, 1)
    assert answer(22, (caller,)) == (1, 1)  # stale: the stamp does not know of the helper
    assert answer(22, (caller, helper)) == (22, 0)
    assert answer(333, (caller, helper)) == (333, 0)
    assert answer(333, (caller, helper)) == (333, 1)


KEPT = """
import os, sys
from pathlib import Path
from numba import types
from jointplay.base.compiler import cfunc, njit

@njit(cache=True, error_model="numpy")
def summed(x):
    total = 0.0
    for k in range(100):
        total += x / (k + 1.0)
    return total

def doubled(x):
    return 2.0 * x

def tripled(x):
    return 3.0 * x

def answers():
    signature = types.float64(types.float64)
    found = [cfunc(signature)(one).ctypes(2.0) for one in (doubled, tripled)]
    return [round(summed(1.0), 6), *found]

def in_a_child():
    if not (child := os.fork()):
        os._exit(0 if answers() == [5.187378, 4.0, 6.0] else 1)
    return os.waitpid(child, 0)[1]

assert in_a_child() == 0
files = {path: path.read_bytes() for path in sorted(Path(sys.argv[1]).rglob("*.nb[ic]"))}
ends = []
for path, content in files.items():
    for k in range(4):
        changed = bytearray(content)
        changed[(2 * k + 1) * len(content) // 8] ^= 1 << k
        path.write_bytes(changed)
        ends.append(in_a_child())
    path.write_bytes(content)
    ends.append(in_a_child())
codes = [path for path in files if path.suffix == ".nbc"]
for path, other in zip(codes, codes[1:] + codes[:1], strict=True):  # code of another function
    path.write_bytes(files[other])
ends.append(in_a_child())
print(len(files), {end for end in ends})
"""


@pytest.mark.thorough
def test_a_bit_that_flips_in_kept_code_has_it_compiled_again(tmp_path):
    """By itself numba runs such code: it crashes, or computes something else."""
    program = tmp_path / "kept.py"
    program.write_text(KEPT)
    done = subprocess.run(
        [sys.executable, str(program), str(tmp_path / "cache")],
        env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "6 {0}\n"), done.stderr


BOUNDED = """
from dataclasses import replace
import jointplay as jp
from jointplay.physics.kernel import Command
from jointplay.physics.kernel.integrators import INTEGRATORS

def run(name, duration, **changes):
    scenario = jp.Scenario.load(jp.shipped(name + ".toml"))
    simulation = scenario.simulation(list(scenario.cases)[-1])
    run = jp.Run(replace(simulation, duration=duration, settle=0.0, **changes))
    run.begin()
    assert run.advance(run.total_steps), run.message(run.workspace.status)
    return run

spring = {"spring": jp.loads.TorsionSpring(joint="joint_a", stiffness=1.0, damping=0.1)}
for method in INTEGRATORS:
    run("scara", 1e-3, integrator=method, tolerance=None, step=1e-5, loads=spring)
for name in ("scara", "four_bar", "delta"):
    last = run(name, 5e-3)
last.workspace.run["width"] = 0
try:
    last.workspace.execute(Command.RECORD_LAST_STATE)
except IndexError:
    print("checked")
"""


WITH_BOUNDS = ("conservation", "bristles", "oil")
"""Physics that is tested once more with the bounds of arrays checked."""


@pytest.mark.thorough  # compiles all, which takes a minute
def test_no_array_of_the_kernels_is_left_where_bounds_are_checked(tmp_path):
    """Each is opened with the shape that `layout` declares; a wrong one is not left unnoticed."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    env |= {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_BOUNDSCHECK": "1"}
    done = subprocess.run(
        [sys.executable, "-c", BOUNDED], env=env, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "checked\n"), done.stderr
    physics = [Path(__file__).parent / "physics" / f"test_{name}.py" for name in WITH_BOUNDS]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", *map(str, physics)],
        env=env, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


@internal
def doubled(x):
    return 2.0 * x


@internal
def doubled_and_one(x):
    return doubled(x) + 1.0


@njit
def called(x):
    return doubled_and_one(x) if x > 0.0 else doubled(x)


def test_parts_of_a_kernel_are_translated_to_machine_code_with_their_entry_only():
    """Optimised and translated one by one, they make a first start take half as long again."""
    assert (called(3.0), called(-3.0)) == (7.0, -6.0)
    for part in (doubled, doubled_and_one):
        (one,) = part.overloads.values()
        assert isinstance(one.library, PartLibrary)
        assert one.library.get_pointer_to_function(one.fndesc.llvm_func_name) == 0
    (entry,) = called.overloads.values()
    assert not isinstance(entry.library, PartLibrary)


MOVED = {
    "a class": "import numba.core.codegen as c\ndel c.JITCodeLibrary\n",
    "an attribute": "import numba.core.compiler as c\ndel c.CompilerBase.define_pipelines\n",
}
"""Programs after which numba has other internals, as a later release may."""


def without_insides(what, code, folder):
    """Run a program where numba has moved something, with a cache of its own in `folder`."""
    return subprocess.run(
        [sys.executable, "-c", MOVED[what] + code],
        env=os.environ | {"NUMBA_CACHE_DIR": str(folder)},
        capture_output=True, text=True, check=False,
    )  # fmt: skip


@pytest.mark.parametrize("what", MOVED)
def test_where_numba_is_another_inside_the_same_is_compiled_plainly(what, tmp_path):
    code = """
from jointplay.base.compiler import NumbaError, internal, njit, stamp
@internal
def doubled(x):
    return 2.0 * x
@njit(cache=True, error_model="numpy")
def called(x):
    return doubled(x) / (x - x)
stamp(called, [])
from jointplay.physics.geometry import radial_gap
print(called(3.0), NumbaError)
"""
    done = without_insides(what, code, tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "inf <class 'Exception'>\n"
    assert done.stderr.count("has internals that this package does not know") == 1
    assert not [*tmp_path.rglob("*.nb[ic]")]


@pytest.mark.nightly  # compiles all, which takes a minute
@pytest.mark.parametrize("what", MOVED)
def test_where_numba_is_another_inside_results_are_the_same(what, tmp_path):
    code = """
import hashlib, jointplay as jp
from jointplay.paper import scara
made = scara(2e-4)
found = jp.simulate(made.mechanism, made.motion, duration=0.05).dataset
numbers = [v.values.tobytes() for v in found.variables.values() if v.dtype.kind == "f"]
print(len(numbers), hashlib.sha256(b"".join(numbers)).hexdigest())
"""
    done = without_insides(what, code, tmp_path)
    usual = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == usual.stdout != ""


def test_what_is_used_inside_numba_is_there_and_used_in_one_module():
    """A release of numba that moves it fails here: mend `numba_inside`, then raise the bound."""
    assert compiler._part is numba_inside.part
    for kind, names in numba_inside.USED.items():
        assert [name for name in names if not hasattr(kind, name)] == []
    called(3.0)
    (one,) = doubled.overloads.values()
    codegen = one.library._codegen
    assert codegen._data_layout
    assert codegen.set_env
    assert Path(ENTRIES[0]._cache._cache_file._index_path).suffix == ".nbi"
    inside = re.compile(r"\bnumba\.core\b(?!\.typing\.templates)|\b_cache_file\b")
    lowest = re.compile(r"\bllvmlite\b|\bnumba\.(extending|core\.typing)\b")
    for found, only in ((inside, "numba_inside.py"), (lowest, "compiler.py")):
        paths = [p for p in SOURCE.rglob("*.py") if found.search(p.read_text(encoding="utf-8"))]
        assert [path.name for path in paths] == [only]


def test_compiled_functions_that_call_other_files_are_stamped_with_them():
    from jointplay import geometry
    from jointplay.model import tree
    from jointplay.physics.kernel import frames
    from jointplay.simulation import statics

    own = (*sorted(Path(geometry.__file__).parent.glob("*.py")), Path(compiler.__file__))
    for function in (geometry.touch, geometry.classify_many, geometry.worn_gap):
        assert function._cache._cache_file._source_stamp == compiler.fingerprint(own)
    trees = compiler.fingerprint((Path(tree.__file__), Path(frames.__file__)))
    assert tree.react._cache._cache_file._source_stamp == trees
    whole = compiler.fingerprint((*stamp.SOURCES, Path(statics.__file__)))
    assert statics._press._cache._cache_file._source_stamp == whole


def test_uncompiled_the_package_still_works():
    """NUMBA_DISABLE_JIT, for debuggers and mutation tests: slow, the same numbers, no kernel."""
    code = (
        "from jointplay.physics.geometry import radial_gap, touch_cylinder\n"
        "import jointplay as jp, jointplay.physics.kernel.entry, jointplay.simulation.statics\n"
        "print(jp.contact.Hertz(), radial_gap.__module__, hasattr(touch_cylinder, 'py_func'))\n"
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1"}
    out = subprocess.run(
        [sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False
    )
    assert out.returncode == 0, out.stderr
    assert out.stdout == "Hertz() jointplay.physics.geometry.cylinder False\n"
