"""Processes that work for another end with it, or when they are told to."""

import subprocess
import sys
import time

import pytest
from test_kills import gone, needs_proc
from warm import PYTHON

from jointplay.base import processes


@needs_proc
def test_a_pool_that_is_closed_leaves_no_process():
    pool = processes.Pool(time.sleep, 2)
    pool.start(enumerate([1e6] * 4))
    left = [process.pid for process in pool.processes.values()]
    pool.close()
    gone(left)


PARENT = """
import os, sys, time
from jointplay.base import processes
if sys.argv[1] == "watch":
    processes.end_with_parent = lambda number: None
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
