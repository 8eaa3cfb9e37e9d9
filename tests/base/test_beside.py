"""Work beside this process comes back whole, or says why it does not."""

import multiprocessing
import os
import signal
import sys
import time

import pytest

from jointplay.base import processes as module
from jointplay.base.errors import JointplayError
from jointplay.base.processes import in_parallel

forked = pytest.mark.skipif(sys.platform != "linux", reason="only Linux forks safely")


@pytest.fixture
def two_cores(monkeypatch):
    monkeypatch.setattr(module, "cores", lambda: 2)


@forked
@pytest.mark.usefixtures("two_cores")
def test_work_is_done_by_another_process_and_comes_back():
    local = [1.0, "what this process has, the other has too"]
    with in_parallel(lambda: (os.getpid(), local)) as made:
        other, value = made()
    assert other != os.getpid()
    assert value == local


def test_without_forks_work_is_done_when_it_is_asked_for(monkeypatch):
    monkeypatch.setattr(module, "_FORKS", False)
    done = []
    with in_parallel(lambda: done.append(os.getpid())) as made:
        assert not done
        made()
    assert done == [os.getpid()]


@pytest.mark.usefixtures("two_cores")
def test_errors_come_back():
    def wrong():
        raise JointplayError("no such figure")

    with in_parallel(wrong) as made, pytest.raises(JointplayError, match="no such figure"):
        made()


@forked
@pytest.mark.usefixtures("two_cores")
def test_a_process_that_is_killed_is_an_error_of_one_line():
    work = in_parallel(lambda: os.kill(os.getpid(), signal.SIGKILL))
    with work as made, pytest.raises(JointplayError, match="ended from outside"):
        made()


@forked
@pytest.mark.usefixtures("two_cores")
def test_work_ends_with_the_block():
    before = set(multiprocessing.active_children())
    with pytest.raises(KeyboardInterrupt), in_parallel(lambda: time.sleep(600)):
        raise KeyboardInterrupt
    assert set(multiprocessing.active_children()) <= before
