"""Sweeps whose processes are killed, whose disk is full, whose scheduler goes: nothing is lost.

Nothing here waits for a time but where a moment is chosen at random.
"""

import itertools
import os
import random
import re
import shutil
import signal
import subprocess
import time
from contextlib import suppress
from pathlib import Path

import pytest
import xarray as xr
from sweep_scenario import SCENARIO
from test_kills import alive, begin, children, gone, needs_proc, small_disk
from warm import JOINTPLAY, PATIENCE_S, PYTHON, end, start

import jointplay as jp
from jointplay.study import plan_of
from jointplay.study.database import FILE
from jointplay.study.store import SweepStore

__all__ = ["small_disk"]

AXES = """
mu = { key = "joints.joint_b.friction.mu_d", from = 0.0, to = 0.2, number = 10 }
cr = { key = "joints.joint_b.radial_clearance", values = [0, "0.2 mm", "1 nm"] }
"""
CASES = 30
REAL = {**os.environ, "REAL_PYTHON": ""}
"""For a command whose workers are to be its children."""


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A scenario, and its sweep as it is if nothing is killed."""
    folder = tmp_path_factory.mktemp("whole")
    path = folder / "study.toml"
    path.write_text(SCENARIO.format(axes=AXES, options="", duration="0.03 s"))
    began = time.monotonic()
    out, err, status = end(
        start("study", "sweep", path, "--out", folder / "s", "--quiet", "--jobs", 2)
    )
    assert status == 0, (out, err)
    return path, jp.open_sweep(folder / "s").dataset(), time.monotonic() - began


def same(store, reference):
    """Whether a store holds exactly what an uninterrupted sweep gives."""
    found = jp.open_sweep(store).dataset()
    assert (found["status"] != "not run").all()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


def finished(store):
    """Costs of the cases that are finished: what a case that ran again would change."""
    there = (Path(store) / FILE).exists()
    return dict(jp.open_sweep(store).table().get("cost", {})) if there else {}


def resume(path, store, *more):
    """Go on, and see that no finished case runs again."""
    before = finished(store) if Path(store).is_dir() else {}
    words = ("study", "sweep", path, "--out", store, "--resume", "--quiet", "--jobs", 2, *more)
    out, err, status = end(start(*words))
    assert status == 0, (out, err)
    assert before.items() <= finished(store).items()
    return len(before)


def grown(store, cases):
    """Wait until so many cases are finished."""
    deadline = time.monotonic() + PATIENCE_S
    while len(finished(store)) < cases:
        assert time.monotonic() < deadline
        time.sleep(0.01)


def descendants(pid):
    try:
        found = children(pid)
    except OSError:  # it has ended meanwhile
        return []
    return found + [other for child in found for other in descendants(child)]


def wait_for_a_moment(process, store, rng, duration):
    """Wait for a random time, or for some more cases and a little; whether it still runs then."""
    if rng.random() < 0.3:
        end_of_wait, more = time.monotonic() + rng.uniform(0.0, duration), CASES + 1
    else:
        end_of_wait, more = time.monotonic() + PATIENCE_S, rng.randint(1, 12)
    first = None
    while process.poll() is None and time.monotonic() < end_of_wait:
        found = len(finished(store))
        first = found if first is None else first
        if found >= first + more:
            end_of_wait, more = time.monotonic() + rng.uniform(0.0, 0.1), CASES + 1
        time.sleep(0.002)
    return process.poll() is None


def kill_at_random(folder, times, seed, path, reference, duration):
    """Kill a sweep's driver or one of its workers, go on, kill again; stores that are whole are
    compared, and begun anew. Returns how many cases were finished before the kills.
    """
    rng = random.Random(seed)
    kept, number, kills = 0, 0, 0
    before: dict = {}
    while True:
        store = folder / f"s{number}"
        command = ("study", "sweep", path, "--out", store, "--resume", "--quiet", "--jobs", 2)
        process = start(*command, env=REAL)
        if kills < times and wait_for_a_moment(process, store, rng, duration):
            kills += 1
            pids = descendants(process.copy)
            victim = rng.choice([process.copy, process.copy, *pids])
            with suppress(ProcessLookupError):
                os.kill(victim, signal.SIGKILL)
            if victim == process.copy:
                end(process)
                gone(pids)
                after = finished(store) if store.is_dir() else {}
                assert before.items() <= after.items()  # none ran again, none is lost
                before = after
                kept += len(after)
                continue
        _, err, status = end(process)  # a worker that is killed the sweep itself makes good
        assert status == 0, err
        assert before.items() <= finished(store).items()
        same(store, reference)
        shutil.rmtree(store)
        number, before = number + 1, {}
        if kills >= times:
            return kept


@needs_proc
@pytest.mark.thorough
@pytest.mark.parametrize("kills", [3, pytest.param(100, marks=pytest.mark.nightly)])
def test_killed_at_random_moments_a_sweep_gives_what_it_would_have(kills, whole, tmp_path):
    assert kill_at_random(tmp_path, kills, kills, *whole) > (kills if kills > 3 else 0) - 1


@needs_proc
def test_a_driver_that_is_killed_takes_its_workers_along_and_loses_nothing(whole, tmp_path):
    path, reference, _ = whole
    process = begin("study", "sweep", path, "--out", tmp_path / "s", "--quiet", "--jobs", 2)
    grown(tmp_path / "s", 5)
    pids = descendants(process.pid)
    process.kill()
    end(process)
    gone(pids)
    assert resume(path, tmp_path / "s") >= 5
    same(tmp_path / "s", reference)


def test_a_case_that_kills_its_worker_every_time_has_failed_and_the_rest_goes_on(tmp_path):
    (tmp_path / "deadly.py").write_text(
        "import os, signal\n\ndef bite(result):\n"
        "    if result.joints and result.time[-1] < 1e-3:\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n    return 1.0\n"
    )
    jp.import_module(tmp_path / "deadly.py")
    path = tmp_path / "study.toml"
    axes = 't = { key = "integration.duration", values = ["0.1 ms", "10 ms", "20 ms"] }'
    options = 'measures = ["deadly:bite"]'
    path.write_text(SCENARIO.format(axes=axes, options=options, duration="1 ms"))
    found = jp.sweep(path, tmp_path / "s", jobs=2).dataset()
    assert found["status"].values.tolist() == ["failed", "done", "done"]
    assert "3 worker processes ended while running this case" in str(found["error"].values[0])


@pytest.mark.parametrize(
    "number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.thorough)]
)
def test_told_to_stop_a_sweep_keeps_what_is_finished_and_says_how_to_go_on(number, whole, tmp_path):
    path, reference, _ = whole
    process = start("study", "sweep", path, "--out", tmp_path / "s", "--quiet", "--jobs", 2)
    grown(tmp_path / "s", 3)
    process.send_signal(number)
    _, err, status = end(process)
    assert status in (0, 130), err
    if status == 130:
        assert re.search(rf"\d+ of {CASES} cases are kept; --resume continues", err)
    assert "Traceback" not in err
    resume(path, tmp_path / "s")
    same(tmp_path / "s", reference)


@pytest.mark.parametrize("there", [False, pytest.param(True, marks=pytest.mark.thorough)])
def test_two_writers_to_one_store_are_refused(there, whole, tmp_path):
    """One that makes the store, or goes on with one, and is at work as long as this test wants."""
    path, reference, _ = whole
    if there:
        SweepStore(tmp_path / "s", plan_of(path)).close()
    first = SweepStore(tmp_path / "s", plan_of(path), resume=there)
    for option in ("--resume", "--extend", "--quiet"):
        _, err, status = end(
            start("study", "sweep", path, "--out", tmp_path / "s", "--quiet", option)
        )
        assert status == 2
        assert option == "--quiet" or "another process is writing to" in err
    first.close()
    resume(path, tmp_path / "s")
    same(tmp_path / "s", reference)


@pytest.mark.thorough
def test_a_full_disk_loses_nothing_that_was_finished(whole, small_disk):
    path, reference, _ = whole
    filler = small_disk / "filler"
    store = small_disk / "s"
    process = start("study", "sweep", path, "--out", store, "--quiet", "--jobs", 2)
    grown(store, 2)
    with suppress(OSError), filler.open("wb") as file:  # all that is left
        for size in (65536, 1024, 1):
            with suppress(OSError):
                for _ in itertools.count():
                    file.write(bytes(size))
                    file.flush()
    _, err, status = end(process)
    if status != 0:
        assert status == 2, err
        assert "No space left" in err
        assert "--resume continues" in err
        assert err.count("\n") == 1
    filler.unlink(missing_ok=True)
    resume(path, store)
    same(store, reference)


@pytest.mark.parametrize(
    ("small_disk", "beside"),
    [("size=60k", False), ("size=150k", True), ("nr_inodes=20", False), ("nr_inodes=20", True)],
    indirect=["small_disk"],
)
@pytest.mark.thorough
def test_a_disk_without_room_or_inodes_is_said_in_a_line(small_disk, beside, tmp_path):
    """Standard output and error are on that disk, or elsewhere; each case has a file of its own."""
    place = small_disk if beside else tmp_path
    path = tmp_path / "study.toml"
    path.write_text(SCENARIO.format(axes=AXES, options="results = true", duration="0.03 s"))
    command = ["study", "sweep", path, "--out", small_disk / "s", "--quiet", "--jobs", "1"]
    with (place / "out").open("w") as out, (place / "err").open("w") as err:
        status = subprocess.run(
            [JOINTPLAY, *map(str, command)], stdout=out, stderr=err, check=False
        ).returncode
    said = (place / "err").read_text()
    assert status == 2, said
    line = (
        r"jointplay study sweep: error: cannot write '.*': No space left on device; "
        rf"\d+ of {CASES} cases are kept; --resume continues\n"
    )
    assert re.fullmatch(line, said) or (beside and not said)


def test_sweeps_leave_no_processes(whole, tmp_path):
    if not Path("/proc/self/task").is_dir():
        pytest.skip("needs Linux's /proc")
    script = (
        "import sys, os, jointplay as jp\n"
        f"jp.sweep({str(whole[0])!r}, {str(tmp_path / 's')!r}, jobs=2)\n"
        "print(open(f'/proc/{os.getpid()}/task/{os.getpid()}/children').read().strip() or 'none')"
    )
    done = subprocess.run([PYTHON, "-c", script], capture_output=True, text=True, check=False)
    assert done.stdout.strip() == "none", (done.stdout, done.stderr)
    assert alive(os.getpid())
