"""Runs that are stopped, killed, or find the disk full: nothing is lost that could be kept.

Nothing here waits for a time: processes are watched until they have said or done something.
"""

import logging
import os
import random
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from warm import PATIENCE_S, PYTHON, Process, end, start, until

import jointplay as jp
from jointplay.base import signals
from jointplay.physics.kernel import Status

pytestmark = pytest.mark.thorough

needs_proc = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="needs Linux's /proc")


def begin(*arguments):
    """A command as users begin it."""
    command = [Path(sys.executable).with_name("jointplay"), *map(str, arguments)]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def scenario(folder, duration="100 s"):
    """A scenario with three cases, in a new file."""
    done = start("init", "study", cwd=folder)
    assert end(done)[2] == 0
    path = folder / "study.toml"
    text = path.read_text(encoding="utf-8").replace("# duration = ", f'duration = "{duration}" # ')
    path.write_text(text, encoding="utf-8")
    return path


def children(pid):
    return [int(p) for p in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def alive(pid):
    try:
        state = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0]
    except OSError:
        return False
    return state != "Z"


def gone(pids):
    deadline = time.monotonic() + PATIENCE_S
    while any(map(alive, pids)):
        assert time.monotonic() < deadline, pids
        time.sleep(0.05)


def kept(folder):
    """The results in a folder, each of which must be whole."""
    return [jp.Result.load(path) for path in folder.glob("*.nc")]


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_any_signal_that_ends_a_run_keeps_it(number, tmp_path):
    call = begin if number == signal.SIGTERM else start
    process = call("run", "--duration", "100", "--no-figures", "--out", tmp_path / "o")
    until(process)
    process.send_signal(number)
    out, err, status = end(process)
    assert status == 130, err
    assert "Traceback" not in err
    assert "stopping; saving" in err
    (result,) = kept(tmp_path / "o")
    assert result.status == Status.INTERRUPTED
    assert "interrupted at" in out


@pytest.mark.parametrize(
    "number", [signal.SIGTERM, pytest.param(signal.SIGHUP, marks=pytest.mark.nightly)]
)
def test_signals_end_all_processes_of_a_scenario_and_keep_their_runs(number, tmp_path):
    path = scenario(tmp_path)
    process = start("run", path, "--no-figures", "--out", tmp_path / "o", "--jobs", 2)
    until(process)
    pids = children(process.copy) if Path("/proc/self/task").is_dir() else []
    process.send_signal(number)
    _, err, status = end(process)
    assert status == 130, err
    assert "Traceback" not in err, err
    gone(pids)
    assert all(result.status == Status.INTERRUPTED for result in kept(tmp_path / "o"))


def test_runs_are_kept_that_were_being_certified_when_told_to_stop(tmp_path):
    path = scenario(tmp_path, "8 s")  # certified for seconds more
    process = start("run", path, "--certify", "--no-figures", "--out", tmp_path / "o", "--jobs", 2)
    until(process, "errors of 0")  # a case with clearance
    process.send_signal(signal.SIGINT)
    _, err, status = end(process)
    assert status == 130, err
    assert "Traceback" not in err
    done = [result for result in kept(tmp_path / "o") if result.status == Status.COMPLETED]
    assert any(result.certificate is None for result in done)


@needs_proc
def test_workers_end_with_a_parent_that_is_killed_and_save_their_runs(tmp_path):
    path = scenario(tmp_path)
    process = start("run", path, "--no-figures", "--out", tmp_path / "o", "--jobs", 2)
    until(process)
    pids = children(process.copy)
    assert pids
    process.kill()
    end(process)
    gone(pids)
    results = kept(tmp_path / "o")
    assert 1 <= len(results) <= 2
    assert all(result.status == Status.INTERRUPTED for result in results)
    assert not list((tmp_path / "o").glob(".*"))


@needs_proc
def test_workers_of_the_study_end_with_a_parent_that_is_killed(tmp_path):
    process = start("scara", "--runs", 2, "--jobs", 2, "--out", tmp_path / "o")
    until(process, "case 0.2 mm")  # the ensembles run beside it
    pids = children(process.copy)
    assert pids
    process.kill()
    end(process)
    gone(pids)
    # How many cases were done by then depends on the machine.
    assert {result.status for result in kept(tmp_path / "o")} == {Status.COMPLETED}


SLOW = """
import sys
from jointplay import cli
from jointplay.simulation.result import netcdf
pack = netcdf.pack
def slowly(dataset):
    print("packing", flush=True)
    sys.stdin.readline()
    return pack(dataset)
netcdf.pack = slowly
sys.exit(cli.main(sys.argv[1:]))
"""


def saving(folder, duration="0.01"):
    """A run that has come to saving its result, and waits there for a line."""
    command = [PYTHON, "-c", SLOW, "run", "--duration", duration]
    command += ["--no-figures", "--no-error-estimate", "--out", str(folder), "--quiet"]
    pipe = subprocess.PIPE
    process = Process(command, stdin=pipe, stdout=pipe, stderr=pipe, text=True)
    assert process.stdout.readline() == "packing\n"
    return process


def test_ctrl_c_while_a_result_is_saved_lets_it_be_saved(tmp_path):
    process = saving(tmp_path / "o")
    process.send_signal(signal.SIGINT)
    until(process, "interrupt again to discard it")
    process.stdin.write("\n")
    process.stdin.flush()
    _, err, status = end(process)
    assert status == 0
    assert "stop requested after the computation had ended" in err
    (result,) = kept(tmp_path / "o")
    assert result.status == Status.COMPLETED


def test_a_second_ctrl_c_gives_up_and_says_what(tmp_path):
    process = saving(tmp_path / "o")
    process.send_signal(signal.SIGINT)
    until(process, "interrupt again to discard it")
    process.send_signal(signal.SIGINT)
    _, err, status = end(process)
    assert status == 130
    assert "interrupted" in err
    assert f"gave up {tmp_path / 'o' / 'result.nc'}" in err
    assert "what was computed is in" not in err
    assert "Traceback" not in err
    assert not (tmp_path / "o").exists()


def test_of_two_processes_with_one_folder_the_second_learns_it_at_once(tmp_path):
    first = saving(tmp_path / "o")
    _, err, status = end(
        start("run", "--duration", "0.01", "--no-figures", "--out", tmp_path / "o")
    )
    assert status == 2
    assert "another process is writing to" in err
    first.stdin.write("\n")
    first.stdin.flush()
    assert end(first)[2] == 0
    assert len(kept(tmp_path / "o")) == 1


def kill_at_random(folder, runs, seed):
    """Runs that are killed at random moments of their lives: results are whole or not there."""
    command = ["run", "--duration", "0.05", "--quiet", "--out"]
    started = time.monotonic()
    out, err, status = end(start(*command, folder / "whole"))
    whole = time.monotonic() - started
    assert status == 0, err
    rng = random.Random(seed)
    for number in range(runs):
        out = folder / f"r{number}"
        process = start(*command, out)
        try:
            process.communicate(timeout=rng.uniform(0.0, 1.2 * whole))
        except subprocess.TimeoutExpired:
            process.kill()
            end(process)
        kept(out)
        assert all(file.stat().st_size for file in out.glob("fig*"))


@pytest.mark.parametrize("runs", [2, pytest.param(100, marks=pytest.mark.nightly)])
def test_results_of_killed_runs_are_whole_or_not_there(runs, tmp_path):
    kill_at_random(tmp_path, runs, seed=runs)


LIMITED = """
import resource, runpy, sys
from jointplay import cli
size = int(sys.argv[1])
resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))
sys.exit(cli.main(sys.argv[2:]))
"""


def test_a_result_too_large_for_the_disk_is_an_error_of_one_line(tmp_path):
    command = [PYTHON, "-c", LIMITED, "10000", "run", "--duration", "0.05", "--no-figures"]
    command += ["--quiet", "--out", str(tmp_path / "o")]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 2, done.stderr
    assert done.stderr.count("\n") == 1
    assert "cannot write" in done.stderr
    assert "it could not be saved elsewhere either" in done.stderr
    assert list(tmp_path.glob("o/*")) == []


@pytest.fixture
def small_disk(tmp_path, request):
    """A file system of 1 MB, or of what else a test asks for."""
    place = tmp_path / "small"
    place.mkdir()
    size = getattr(request, "param", "size=1m")
    command = ["mount", "-t", "tmpfs", "-o", size, "tmpfs", str(place)]
    if os.name != "posix" or os.getuid() or subprocess.run(command, capture_output=True).returncode:
        pytest.skip("only root can mount a small disk")
    yield place
    subprocess.run(["umount", "-l", str(place)], check=True)  # processes may be ending still


def test_what_a_full_disk_cannot_take_is_kept_elsewhere(small_disk, tmp_path):
    (small_disk / "filler").write_bytes(bytes(1_000_000))
    command = ["run", "--duration", "0.3", "--no-figures", "--quiet", "--out", small_disk / "o"]
    out, err, status = end(start(*command, env={**os.environ, "TMPDIR": str(tmp_path)}))
    assert status == 2, out
    assert err.count("\n") == 1
    assert "No space left" in err
    other = re.search(r"the result is in '(.*)' instead", err)[1]
    assert jp.Result.load(other).status == Status.COMPLETED
    assert list(small_disk.glob("o/*")) == []


def test_a_result_that_cannot_be_saved_is_still_there_in_python(tmp_path):
    from jointplay.paper import scara

    result = jp.simulate(scara(2e-4).mechanism, scara(2e-4).motion, duration=1e-3)
    with pytest.raises(jp.JointplayError, match="cannot write"):
        result.save(tmp_path / "none" / "r.nc")
    result.save(tmp_path / "r.nc")
    assert len(jp.Result.load(tmp_path / "r.nc").time) == len(result.time)


@pytest.mark.parametrize(
    ("left", "word"), [(b"", "empty"), (b"\x89HDF\r\n\x1a\n" + bytes(50), "broken")]
)
def test_the_rest_of_a_killed_run_is_called_that(left, word, tmp_path):
    (tmp_path / "result.nc").write_bytes(left)
    _, err, status = end(start("run", "--out", tmp_path, "--no-figures"))
    assert status == 2
    assert f"is {word}, left by a run that was killed" in err
    assert "delete it, or choose another folder" in err


def test_a_signal_in_the_midst_of_a_write_is_answered_all_the_same(monkeypatch, capfd):
    class Busy:
        def write(self, text):
            raise RuntimeError("reentrant call inside <_io.BufferedWriter name='<stderr>'>")

        flush = write

    monkeypatch.setattr(sys, "stderr", Busy())
    monkeypatch.setattr(logging.Logger, "hasHandlers", lambda self: False)  # pytest listens
    signals.say("stopping")
    assert capfd.readouterr().err == "\nstopping\n"
