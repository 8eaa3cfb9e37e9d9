"""Processes that work for another end with it, or when they are told to."""

import os
import signal
import subprocess
import sys
import time

import pytest
from test_kills import gone, needs_proc
from warm import PYTHON

from jointplay.base import processes, signals


@needs_proc
def test_a_pool_that_is_closed_leaves_no_process():
    pool = processes.Pool(time.sleep, 2)
    pool.start(enumerate([1e6] * 4))
    left = [process.pid for process in pool.processes.values()]
    pool.close()
    gone(left)


def endless(path):
    """Work that can end early."""
    with signals.keeping("it"):
        path.write_text("begun")
        while not signals.stop_requested():
            time.sleep(0.01)
        path.write_text("saved")


def begun(path):
    """A pool that is at such work."""
    pool = processes.Pool(endless, 1, early=True)
    pool.start([("one", path)])
    while not path.exists() or not path.read_text():
        time.sleep(0.01)
    return pool


@needs_proc
def test_work_that_can_end_early_is_saved_where_its_pool_is_closed(tmp_path):
    begun(tmp_path / "it").close()
    assert (tmp_path / "it").read_text() == "saved"


@needs_proc
def test_told_to_stop_once_more_a_pool_gives_up_its_work_and_says_which(tmp_path, monkeypatch):
    pool = begun(tmp_path / "it")
    (process,) = pool.processes.values()
    monkeypatch.setattr(process, "terminate", lambda: os.kill(os.getpid(), signal.SIGINT))
    with pytest.raises(signals.GivenUp, match="discarded without saving: one"):
        pool.close()
    gone([process.pid])
    assert (tmp_path / "it").read_text() == "begun"


PARENT = """
import os, sys, time
from jointplay.base import processes, signals
if sys.argv[1] == "watch":
    processes.end_with_parent = lambda: None
if __name__ == "__main__":
    pool = processes.Pool(time.sleep, 1)
    print(*(process.pid for process in pool.processes.values()), flush=True)
    for _ in pool.run(enumerate([0.0, 1e6])):
        print("begun", flush=True)
"""


@needs_proc
@pytest.mark.parametrize("way", ["kernel", "watch"])
def test_a_worker_ends_with_its_parent_with_and_without_the_kernels_help(way):
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, way], stdout=subprocess.PIPE, text=True
    )
    worker = int(parent.stdout.readline())
    parent.stdout.readline()
    parent.kill()
    parent.wait()
    gone([worker])


LISTENS = """
import os, signal, sys
from jointplay.base import signals
signal.signal(signal.SIGHUP, getattr(signal, sys.argv[1]))
with signals.listening():
    try:
        os.kill(os.getpid(), signal.SIGHUP)
        print("went on")
    except KeyboardInterrupt:
        print("stopped")
"""


@pytest.mark.parametrize(("how", "word"), [("SIG_IGN", "went on"), ("SIG_DFL", "stopped")])
def test_a_signal_that_is_ignored_stays_ignored(how, word):
    """Such as by nohup."""
    done = subprocess.run([PYTHON, "-c", LISTENS, how], capture_output=True, text=True, check=True)
    assert done.stdout == f"{word}\n"
