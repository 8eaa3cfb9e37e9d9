"""The compiled part as a package: its size, its cache, and that nobody reaches its inside."""

import ast
import ctypes
import dataclasses
import importlib
import math
import multiprocessing
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from numba import njit

import jointplay as jp
from jointplay.base import compiler, linking, locks, objects, processes, progress, streams
from jointplay.base.compiler import compiled
from jointplay.base.objects import Unresolved

SOURCE = Path(jp.__file__).parent
HERE = Path(__file__).parents[2]


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


def test_an_object_is_of_the_files_in_which_its_code_is():
    """That is what `sources` hashes, all of physics, and the function's own file."""
    parts = compiler._parts()
    within = {path for part in parts for path in part.glob("*.py")}
    decorated = re.compile(r"^@(compiler\.)?(compiled|contracted|reordered)$", re.MULTILINE)
    found = [path for path in SOURCE.rglob("*.py") if decorated.search(path.read_text())]
    assert len(found) > 20
    for source in found:
        for node in ast.walk(ast.parse(source.read_text())):
            if not isinstance(node, ast.ImportFrom) or not node.module.startswith("jointplay"):
                continue
            module = importlib.import_module(node.module)
            for name in node.names:
                used = getattr(module, name.name)
                if isinstance(used, compiler.Compiled):
                    place = Path(used.py_func.__code__.co_filename)
                    assert place in within, f"{source.name} imports {name.name}"


def test_a_change_of_a_source_changes_the_fingerprint(tmp_path, monkeypatch):
    monkeypatch.setattr(compiler, "_parts", lambda: [tmp_path])
    marks = []
    for text in ("a", "a", "b"):
        (tmp_path / "source.py").write_text(text)
        compiler.sources.cache_clear()
        marks.append(compiler.sources())
    compiler.sources.cache_clear()
    assert marks[0] == marks[1] != marks[2]


@pytest.fixture
def kept(tmp_path, monkeypatch):
    """An object in a folder of its own, and its head."""
    monkeypatch.setattr(objects, "folder", lambda: tmp_path)
    target = objects.host()
    head = objects.Head("some.function", "d(d)", "print", target.system, target.features, "d")
    objects.keep(head, b"code", target.label)
    return head


def test_an_object_is_found_by_function_types_and_sources(kept):
    assert [*objects.find("some.function", "d(d)", "print")] == [(kept, b"code")]
    for other in (("one", "d(d)", "print"), ("some.function", "d(i)", "print"),
                  ("some.function", "d(d)", "other")):  # fmt: skip
        assert not [*objects.find(*other)]


@pytest.mark.parametrize("change", [{"features": ("flies",)}, {"system": "vax-vms"}])
def test_an_object_that_the_processor_cannot_run_is_not_loaded(change, kept):
    """It would end the process."""
    objects.keep(dataclasses.replace(kept, **change), b"code", objects.host().label)
    assert not [*objects.find("some.function", "d(d)", "print")]


def test_a_damaged_object_is_none(kept, tmp_path):
    (path,) = tmp_path.iterdir()
    content = path.read_bytes()
    for place in range(0, len(content), 7):
        changed = bytearray(content)
        changed[place] ^= 1
        path.write_bytes(changed)
        assert not [*objects.find("some.function", "d(d)", "print")]
    for end in (0, 10, len(content) - 1):
        path.write_bytes(content[:end])
        assert not [*objects.find("some.function", "d(d)", "print")]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows")
@pytest.mark.parametrize("which", ["folder", "file"])
@pytest.mark.parametrize("change", ["all", "group", "owner"])
def test_an_object_that_another_user_can_have_written_is_not_loaded(
    kept, tmp_path, which, change, monkeypatch
):
    (path,) = tmp_path.iterdir()
    place = path if which == "file" else tmp_path
    assert [*objects.find("some.function", "d(d)", "print")]
    if change == "owner":
        user = 1 + max(os.geteuid(), Path(objects.__file__).stat().st_uid)
        if os.geteuid() != 0:
            pytest.skip("only root gives files away")
        os.chown(place, user, user)
    elif change == "group":
        if os.geteuid() == 0:
            os.chown(place, 0, 12345)
        place.chmod(0o770)
        if place.stat().st_gid == os.geteuid():
            pytest.skip("a group of this user alone")
    else:
        place.chmod(0o707)
    assert not [*objects.find("some.function", "d(d)", "print")]


def test_folders_of_objects_are_this_users_alone(tmp_path, monkeypatch):
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path))
    made = objects.folder.__wrapped__()
    assert made.is_relative_to(tmp_path)
    if hasattr(os, "geteuid"):
        assert made.stat().st_mode & 0o777 == 0o700
        made.chmod(0o777)
        with pytest.warns(RuntimeWarning, match="by this user alone"):
            assert not objects.folder.__wrapped__().is_relative_to(tmp_path)


def test_a_stopped_process_that_holds_the_lock_is_waited_for_with_a_word_and_a_limit(
    tmp_path, monkeypatch, caplog
):
    monkeypatch.setattr(objects, "folder", lambda: tmp_path)
    monkeypatch.setattr(objects, "_TELLS_S", 0.1)
    monkeypatch.setattr(objects, "_MOST_WAIT_S", 0.3)
    held = locks.opened(tmp_path)
    locks.lock(held)
    with objects.alone():
        said = caplog.text
    os.close(held)
    assert said.count("waiting for another process") == 1
    assert "compiling without waiting" in said
    caplog.clear()
    with objects.alone():
        assert caplog.text == ""


def test_who_waits_for_the_compiler_is_told_once_unless_to_be_quiet(monkeypatch, capsys):
    monkeypatch.setattr(streams, "_LONG_S", 0.0)
    monkeypatch.setattr(streams, "announced", set())
    for quiet, said in ((True, ""), (False, f"{compiler.COMPILES}\n"), (False, "")):
        kept_nowhere = {}
        exec("def twice(x): return 2.0 * x", kept_nowhere)
        with streams.noting(quiet):
            assert compiler.compiled(kept_nowhere["twice"])(2.0) == 4.0
        assert capsys.readouterr() == ("", said)


def test_an_object_that_cannot_be_written_is_done_without(kept, monkeypatch, tmp_path):
    monkeypatch.setattr(objects, "folder", lambda: tmp_path / "gone")
    objects.keep(kept, b"code", objects.host().label)
    assert not [*objects.find("some.function", "d(d)", "print")]


def test_what_comes_with_a_wheel_serves_where_nothing_was_compiled(kept, monkeypatch, tmp_path):
    (path,) = tmp_path.iterdir()
    path.unlink()
    for target in objects.RELEASED:
        head = dataclasses.replace(kept, system=target.system, features=target.features)
        objects.keep(head, target.label.encode(), target.label)
    here, both = objects.host(), [{"avx512f"}, set()]
    for target in objects.RELEASED:
        for more in both:
            features = tuple({*target.features, *more})
            own = here._replace(system=target.system, features=features, label="none")
            monkeypatch.setattr(objects, "host", lambda own=own: own)
            best = next(objects.find("some.function", "d(d)", "print"))
            assert best[1] == target.label.encode()


def some_sine(x):
    return math.sin(x) * x + 1.0


def test_objects_are_made_for_what_is_released(tmp_path, monkeypatch):
    """Those of this system are run, too; of the others it is seen that they are theirs."""
    machines = {
        "x86_64-linux": b"\x7fELF",
        "aarch64-linux": b"\x7fELF",
        "arm64-darwin": b"\xcf\xfa",
    }
    monkeypatch.setattr(objects, "folder", lambda: tmp_path)
    monkeypatch.setattr(compiler, "targets", [*objects.RELEASED])
    if objects.host().system != objects.RELEASED[0].system:
        pytest.skip("the first is run")
    assert compiler.Compiled(some_sine)(2.0) == some_sine(2.0)
    assert len([*tmp_path.glob("*.o")]) == len(objects.RELEASED)
    for target in objects.RELEASED:
        (path,) = tmp_path.glob(f"*.{target.label}.o")
        head, code = objects._read(path)
        assert (head.system, head.features) == (target.system, target.features)
        assert code.startswith(machines[target.system])
        if target.system == objects.host().system:
            address = objects.load(code)
            room = ctypes.c_double()
            call = ctypes.PYFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)(address)
            assert call(ctypes.addressof(room), 2.0) == 0
            assert room.value == some_sine(2.0)


KEPT = """
import os, sys
from pathlib import Path
from jointplay.base.compiler import Compiled, compiled

@compiled
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
    found = [Compiled(one).native("d(d)").ctypes(2.0) for one in (doubled, tripled)]
    return [round(summed(1.0), 6), *found]

def in_a_child():
    if not (child := os.fork()):
        os._exit(0 if answers() == [5.187378, 4.0, 6.0] else 1)
    return os.waitpid(child, 0)[1]

assert in_a_child() == 0
files = {path: path.read_bytes() for path in sorted(Path(sys.argv[1]).rglob("*.o"))}
ends = []
for path, content in files.items():
    for k in range(4):
        changed = bytearray(content)
        changed[(2 * k + 1) * len(content) // 8] ^= 1 << k
        path.write_bytes(changed)
        ends.append(in_a_child())
        assert path.read_bytes() == content
for path, other in zip(files, [*files][1:] + [*files][:1], strict=True):  # of another function
    path.write_bytes(files[other])
ends.append(in_a_child())
assert "numba" not in sys.modules
print(len(files), {end for end in ends})
"""


@pytest.mark.thorough
def test_what_is_damaged_is_compiled_again_and_what_is_kept_needs_no_numba(tmp_path):
    program = tmp_path / "kept.py"
    program.write_text(KEPT)
    # Without variables that earlier tests have had set: the first function is compiled as others.
    plain = {name: value for name, value in os.environ.items() if not name.startswith("NUMBA_")}
    done = subprocess.run(
        [sys.executable, str(program), str(tmp_path / "cache")],
        env=plain | {"NUMBA_CACHE_DIR": str(tmp_path / "cache")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (0, "3 {0}\n"), done.stderr


BOUNDED = """
from dataclasses import replace
import jointplay as jp
from jointplay.physics.kernel import Command
from jointplay.physics.kernel.constants import INTEGRATORS

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


@pytest.mark.nightly  # compiles all, which takes a minute and more
def test_no_array_of_the_kernels_is_left_where_bounds_are_checked(tmp_path):
    """Each is opened with the shape that `layout` declares; a wrong one is not left unnoticed."""
    env = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    env |= {"NUMBA_CACHE_DIR": str(tmp_path), "NUMBA_BOUNDSCHECK": "1"}
    done = subprocess.run(
        [sys.executable, "-c", BOUNDED], env=env, capture_output=True, text=True, check=False
    )
    assert (done.returncode, done.stdout) == (0, "checked\n"), done.stderr
    physics = [HERE / "physics" / f"test_{name}.py" for name in WITH_BOUNDS]
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-n", "0", *map(str, physics)],
        env=env, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout


@compiled
def doubled(x):
    return 2.0 * x


@compiled
def doubled_and_more(x, values, names):
    made = np.zeros(values.shape)
    for i in range(values.shape[0]):
        for k in range(values.shape[1]):
            made[i, k] = doubled(values[i, k])
    values[0, 0] = made[-1, -1] + names.first[1]
    return made[0, 0] + x, values.size, x > 1.0


class Names(NamedTuple):
    first: np.ndarray
    second: float


def test_numbers_arrays_and_named_tuples_are_taken_and_numbers_returned():
    values = np.arange(6.0).reshape(2, 3)
    for given in (values, np.asfortranarray(values), np.arange(24.0).reshape(4, 6)[::2, ::2]):
        last = given[-1, -1]
        first = 2.0 * given[0, 0] + 3.0
        found = doubled_and_more(3.0, given, Names(np.array([1, 2]), 0.5))
        assert found == (first, 6, 1)
        assert given[0, 0] == 2.0 * last + 2.0
    assert doubled(2.0) == 4.0
    assert doubled(2) == 4


def test_while_something_is_compiled_time_stands_still_for_bars(monkeypatch):
    entered = []

    @contextmanager
    def aside():
        entered.append(True)
        yield

    monkeypatch.setattr(progress, "aside", aside)
    made = {"__name__": __name__}
    exec("def tripled(x):\n    return 3.0 * x\n", made)  # of no file: never kept
    assert compiled(made["tripled"])(2.0) == 6.0
    assert entered == [True]


@compiled
def says(x):
    print(x)


def test_code_that_needs_numbas_own_libraries_is_no_object():
    """One symbol that is not found would leave an object without addresses."""
    with pytest.raises(Unresolved):
        says(2.0)


@njit
def called(x):
    return doubled(x) if x > 0.0 else -1.0


def test_numbas_own_functions_may_call_what_is_compiled_here():
    assert (called(3.0), called(-3.0)) == (6.0, -1.0)


USERS_OWN = """
import numba
from jointplay.physics.geometry import classify_mode, touch
@numba.njit(cache=True)
def gap(d, r, x):
    return touch(0, d, 0, 0, x, 0.0, 0.0, r, 0)[0]
if __name__ == "__main__":
    import numpy as np
    print(gap(np.array([2.0, 1.0, 1.0, 1.0]), np.eye(3).ravel(), 0.25), len(gap.stats.cache_hits))
"""


def test_numbas_own_functions_that_are_kept_may_call_what_is_compiled_here(tmp_path):
    (tmp_path / "users.py").write_text(USERS_OWN)
    command = [sys.executable, "users.py"]
    said = [subprocess.check_output(command, cwd=tmp_path, text=True) for _ in range(2)]
    assert said == ["0.75 0\n", "0.75 1\n"]


@compiled
def _sum_of_lent(values, least):
    total = 0.0
    for value in values[1:]:
        total += 2.0 * value if value > least else value
    return total


@compiled
def _sum_of_made(n):
    values = np.ones(n)
    values[1] = 3.0
    return _sum_of_lent(values, 2.0)


def test_what_makes_arrays_hands_them_on():
    assert _sum_of_made(4) == 8.0


@compiled
def _ended_elsewhere(x):
    return 2.0 * x + 1.0


@compiled
def _meanwhile(x):
    return 3.0 * x + 1.0


@pytest.fixture
def slow_llvm(tmp_path, monkeypatch):
    """LLVM ends when the file is there that this gives; the place where objects are kept is new."""
    gate, build = tmp_path / "gate", linking.build

    def gated(part, *rest):
        translate, returns = build(part, *rest)

        def end():
            while part is _ended_elsewhere.part and not gate.exists():
                time.sleep(0.01)
            return translate()

        return end, returns

    monkeypatch.setattr(linking, "build", gated)
    monkeypatch.setattr(objects, "folder", lambda: tmp_path)
    monkeypatch.setattr(processes, "cores", lambda: 2)
    monkeypatch.setattr(compiler, "_beside", None)
    for function in (_ended_elsewhere, _meanwhile):
        monkeypatch.setattr(function, "_natives", {})
    return gate


@pytest.mark.skipif(sys.platform != "linux", reason="processes cannot be copied")
@pytest.mark.parametrize("killed", [False, True])
def test_what_another_process_ends_is_waited_for_and_others_are_compiled_meanwhile(
    killed, slow_llvm
):
    assert _ended_elsewhere.ahead("d(d)")
    (other,) = multiprocessing.active_children()
    assert _meanwhile.native("d(d)").ctypes(2.0) == 7.0
    assert other.is_alive()
    if killed:
        other.kill()
        other.join()
    slow_llvm.touch()
    assert _ended_elsewhere.native("d(d)").ctypes(2.0) == 5.0
    other.join(60.0)
    assert other.exitcode == (-signal.SIGKILL if killed else 0)
    assert not _ended_elsewhere.ahead("d(d)")


def test_where_there_is_one_core_what_is_begun_ahead_is_ended_at_once(slow_llvm, monkeypatch):
    monkeypatch.setattr(processes, "cores", lambda: 1)
    slow_llvm.touch()
    assert not _ended_elsewhere.ahead("d(d)")
    assert len([*slow_llvm.parent.glob("*_ended_elsewhere*.o")]) == 1


def test_numba_is_known_to_four_modules_and_changed_by_none():
    inside = re.compile(r"\bnumba\.core\b|\bllvmlite\b|\bnumba\.extending\b")
    paths = [p for p in SOURCE.rglob("*.py") if inside.search(p.read_text(encoding="utf-8"))]
    assert {path.name for path in paths} == {
        *("compiler.py", "intrinsics.py", "linking.py", "objects.py")
    }
    code = (
        "import numba, numba.core.lowering, numba.np.arrayobj, sys\n"
        "owners = [m for n, m in sys.modules.items() if n.split('.')[0] == 'numba']\n"
        "owners += [c for m in owners for c in vars(m).values() if isinstance(c, type)"
        " and c.__module__.startswith('numba')]\n"
        "before = [(o, n, v) for o in owners for n, v in [*vars(o).items()] if callable(v)]\n"
        "from jointplay.base.compiler import compiled\n"
        "@compiled\n"
        "def third(x):\n"
        "    return x / 3.0\n"
        "assert third(6.0) == 2.0\n"
        "changed = [n for o, n, v in before if vars(o).get(n) is not v]\n"
        "print(len(before) > 1000, changed)\n"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True) == "True []\n"


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
