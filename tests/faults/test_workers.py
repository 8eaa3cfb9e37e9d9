"""Processes that work for another end with it, or when they are told to."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor

import pytest
from test_kills import gone, needs_proc

from jointplay.core import processes, signals


@needs_proc
def test_a_pool_that_is_abandoned_leaves_no_process():
    pool = ProcessPoolExecutor(2, initializer=processes.begin)
    for _ in range(4):
        pool.submit(time.sleep, 1e6)
    while not processes.processes(pool):
        time.sleep(0.01)
    left = [process.pid for process in processes.processes(pool)]
    processes.abandon(pool)
    gone(left)


PARENT = """
import os, sys, time
from concurrent.futures import ProcessPoolExecutor
from jointplay.core import processes
if sys.argv[1] == "watch":
    processes.end_with_parent = lambda number: None
if __name__ == "__main__":
    pool = ProcessPoolExecutor(1, initializer=processes.begin)
    print(pool.submit(os.getpid).result(), flush=True)
    pool.submit(time.sleep, 1e6)
    time.sleep(1e6)
"""


@needs_proc
@pytest.mark.parametrize("way", ["kernel", "watch"])
def test_a_worker_ends_with_its_parent_with_and_without_the_kernels_help(way):
    parent = subprocess.Popen(
        [sys.executable, "-c", PARENT, way], stdout=subprocess.PIPE, text=True
    )
    worker = int(parent.stdout.readline())
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
