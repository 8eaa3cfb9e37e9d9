"""Processes that work for another end with it, or when they are told to."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import pytest
from test_kills import gone, needs_proc

from jointplay.core import processes, signals


@needs_proc
def test_a_pool_that_is_closed_leaves_no_process():
    pool = processes.Pool(time.sleep, 2)
    pool.start([1e6] * 4)
    left = [process.pid for process in pool.processes.values()]
    pool.close()
    gone(left)


PARENT = """
import os, sys, time
from jointplay.core import processes
if sys.argv[1] == "watch":
    processes.end_with_parent = lambda number: None
if __name__ == "__main__":
    pool = processes.Pool(time.sleep, 1)
    print(*(process.pid for process in pool.processes.values()), flush=True)
    for _ in pool.run([0.0, 1e6]):
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


def listen(say, ignored):
    if ignored:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)
    with signals.listening():
        try:
            os.kill(os.getpid(), signal.SIGHUP)
            say.put("went on")
        except KeyboardInterrupt:
            say.put("stopped")


@pytest.mark.parametrize(("ignored", "word"), [(True, "went on"), (False, "stopped")])
def test_a_signal_that_is_ignored_stays_ignored(ignored, word):
    """Such as by nohup."""
    context = multiprocessing.get_context("spawn")
    say = context.Queue()
    process = context.Process(target=listen, args=(say, ignored))
    process.start()
    assert say.get() == word
    process.join()
