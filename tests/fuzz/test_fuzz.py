"""Whatever commands are given, they do their work or say in one line why they cannot."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import generators
import pytest
import twins
from generators import Case, judge
from robustness import fuzz
from warm import PYTHON

from jointplay import cli

FUZZ = [Path(__file__).parents[2] / "benchmarks", "fuzz"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("options", "cases"),
    [(["--quick"], fuzz.QUICK), (["--first", fuzz.QUICK, "--cases", 60], 60)],
    ids=["quick form", "those after it"],
)
def test_no_input_brings_a_traceback_or_is_taken_in_silence(options, cases, tmp_path):
    """The first cases of `benchmarks/robustness/fuzz.py`."""
    command = [PYTHON, *FUZZ, *options, "--kept", tmp_path / "kept"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr[-2000:]
    last = done.stdout.splitlines()[-1]
    assert last == f"cases {cases} traceback 0 hang 0 crash 0 silent 0"


def test_every_command_is_called(tmp_path):
    assert set(generators._base_calls(tmp_path)) == set(cli.parsers())


def test_a_command_that_serves_is_called_and_told_to_stop(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    case = Case(0, "commands", ["live", *generators._base_calls(tmp_path)["live"]])
    assert judge(case, tmp_path) == ""
    assert not case.refused


def prints_escapes(arguments):
    print("\x1b[31mred")
    return 0


def leaves_a_file(arguments):
    Path("left").write_text("")
    print("jointplay: error: no", file=sys.stderr)
    return 2


def changes_what_it_reads(arguments):
    Path("read").write_text("changed")
    return 0


def reads_what_it_was_not_given(arguments):
    Path("written").write_text(Path("secret.txt").read_text())
    return 0


def says_several_lines(arguments):
    print("jointplay: error: no\nnor this", file=sys.stderr)
    return 2


def prints_before_it_refuses(arguments):
    print("a plan")
    print("jointplay: error: no", file=sys.stderr)
    return 2


def raises(arguments):
    raise KeyError("a")


def takes_anything(arguments):
    return 0


@pytest.mark.parametrize(
    ("main", "word"),
    [
        (prints_escapes, "silent: prints the control character"),
        (leaves_a_file, "silent: refuses, and leaves 'left'"),
        (changes_what_it_reads, "silent: changes 'read'"),
        (reads_what_it_was_not_given, "silent: reads a file that it was not given"),
        (says_several_lines, "silent: status 2, 2 lines"),
        (prints_before_it_refuses, "silent: prints before it refuses"),
        (raises, "traceback KeyError"),
        (takes_anything, "silent: taken, although it must be refused"),
    ],
)
def test_what_a_command_must_not_do_is_noticed(main, word, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(cli, "main", main)
    (tmp_path / "read").write_text("as it was")
    (tmp_path / "secret.txt").write_text(generators.SECRET)
    assert judge(Case(0, "options", [], bad=main is takes_anything), tmp_path).startswith(word)


def crashes(case, folder):
    os.kill(os.getpid(), signal.SIGSEGV)


def hangs(case, folder):
    time.sleep(1e6)


def leaves_a_process(case, folder):
    subprocess.Popen(["sleep", "1000000"], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    return ""


def takes_all_memory(case, folder):
    os.environ["A"] = "a" * (1 << 40)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("does", "word"),
    [
        (crashes, "crash: signal 11"),
        (hangs, "hang: no end within"),
        (leaves_a_process, "silent: leaves a process"),
        (takes_all_memory, "crash: the generator: MemoryError"),
    ],
)
def test_what_ends_or_holds_up_its_process_is_noticed(does, word, tmp_path, monkeypatch):
    monkeypatch.setattr(fuzz, "LIMIT_S", 5.0)
    monkeypatch.setattr(generators, "judge", does)
    monkeypatch.setattr(generators, "make", lambda seed, folder: Case(seed, "a", ["b"]))
    found = fuzz.judge(7, str(tmp_path))
    assert found["outcome"].startswith(word)
    assert found["kind"] == "a"
    assert (tmp_path / "7" / "CASE.json").is_file()


def test_a_copy_that_cannot_judge_ends_and_does_not_go_on_as_its_parent(monkeypatch):
    monkeypatch.setattr(fuzz, "end_with_parent", lambda: 1 / 0)
    found = fuzz.judge(7, "")
    assert found["outcome"].startswith("crash: exit 1")
    assert "ZeroDivisionError" in found["outcome"]


@pytest.mark.parametrize("way", twins.WAYS)
def test_a_run_that_differs_from_its_twin_is_noticed(way, tmp_path, monkeypatch):
    seed = next(seed for seed in range(100) if completes(seed, tmp_path / str(seed)))
    assert way(random.Random(seed), tmp_path) == ""
    true, calls = twins.numbers, []

    def numbers(result):
        calls.append(1)
        found = true(result)
        return found if len(calls) == 1 else {**found, "q": found["q"] * (1.0 + 1e-5)}

    monkeypatch.setattr(twins, "numbers", numbers)
    assert "q differs by" in way(random.Random(seed), tmp_path)


def completes(seed, folder):
    """Whether the machine of a seed can be run to the end, under plain names."""
    folder.mkdir()
    rng = random.Random(seed)
    try:
        twins.first_run(rng, folder)
    except ValueError:
        return False
    return rng.random() < 0.5
