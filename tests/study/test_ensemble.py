"""Ensembles in several processes: results in order, bit for bit, and errors that say where."""

import dataclasses
import multiprocessing
import os
import signal
import time
import warnings
from contextlib import closing

import numpy as np
import pytest
from sweep_scenario import ARM
from threadpoolctl import threadpool_info, threadpool_limits

import jointplay as jp
import jointplay.study.ensemble as module
from jointplay.base import processes, signals
from jointplay.base.processes import Pool, cores, number_of


@pytest.fixture(scope="module")
def simulations(tmp_path_factory):
    """Perturbed starts of one arm, of different lengths: the first takes longest."""
    path = tmp_path_factory.mktemp("arm") / "arm.toml"
    one = jp.Scenario(ARM, path).simulation()
    return [
        dataclasses.replace(one, seed=seed, duration=2e-3 * (6 - seed), judge_from=0.0)
        for seed in range(5)
    ]


def content(result):
    """All arrays of a result."""
    return {name: one.values.tobytes() for name, one in result.dataset.variables.items()}


def test_results_come_in_the_order_given_and_bit_for_bit_whatever_the_jobs(simulations):
    alone = [one.run() for one in simulations]
    assert jp.ensemble([]) == []
    for jobs in (1, 3):
        found = jp.ensemble(iter(simulations), jobs=jobs)
        assert [content(one) for one in found] == [content(one) for one in alone]


def pid_and_end(result):
    return os.getpid(), float(result.time[-1])


def test_what_is_kept_is_found_where_the_simulation_ran(simulations):
    found = jp.ensemble(simulations, jobs=2, keep=pid_and_end)
    assert os.getpid() not in {pid for pid, _ in found}
    assert len({pid for pid, _ in found}) == 2
    assert [end for _, end in found] == pytest.approx([one.duration for one in simulations])
    assert {pid for pid, _ in jp.ensemble(simulations, jobs=1, keep=pid_and_end)} == {os.getpid()}


@pytest.mark.parametrize("jobs", [1, 2])
def test_an_error_says_of_which_simulation_it_is(jobs, simulations):
    wrong = [*simulations[:2], dataclasses.replace(simulations[2], step=-1.0)]
    with pytest.raises(jp.JointplayError, match=r"^simulations\[2\]: step must be") as caught:
        jp.ensemble(wrong, jobs=jobs)
    assert caught.value.where == ("simulations", 2, "step")
    with pytest.raises(KeyError, match="nonsense") as own:
        jp.ensemble(simulations[:1] * 2, jobs=jobs, keep=no_such_history)
    # Side by side, either may fail first.
    assert own.value.__notes__[-1] in ("simulations[0]", "simulations[1]")[:jobs]


def no_such_history(result):
    return result["nonsense"]


def warn(result):
    warnings.warn("mind this", RuntimeWarning, stacklevel=1)


@pytest.mark.parametrize("jobs", [1, 2])
def test_warnings_come_from_where_the_simulation_ran(jobs, simulations):
    with pytest.warns(RuntimeWarning, match=r"simulations\[[01]\]: mind this") as caught:
        jp.ensemble(simulations[:2], jobs=jobs, keep=warn)
    assert len(caught) == 2


def die(result):
    if result.simulation.seed == 1:
        os.kill(os.getpid(), signal.SIGKILL)


def test_a_process_that_is_killed_is_an_error_of_one_line(simulations):
    said = r"^simulations\[1\]: .*ended from outside"
    with pytest.raises(jp.JointplayError, match=said) as caught:
        jp.ensemble(simulations, jobs=2, keep=die)
    assert caught.value.where == ("simulations", 1)


def test_what_cannot_be_sent_is_an_error_that_says_so(simulations):
    with pytest.raises(jp.JointplayError, match=r"^simulations\[0\]: it cannot be sent"):
        jp.ensemble([lambda: None, *simulations], jobs=2)


def interrupt(result):
    """A measure that interrupts the calling process when the last simulation but one is run."""
    if result.simulation.seed == 3:
        worker = multiprocessing.parent_process() is not None
        os.kill(os.getppid() if worker else os.getpid(), signal.SIGINT)
        time.sleep(1e6 if worker else 0.0)
    return result.simulation.seed


@pytest.mark.parametrize("jobs", [1, 2])
def test_interrupted_it_hands_over_what_was_finished_and_leaves_no_process(jobs, simulations):
    before = set(multiprocessing.active_children())
    with pytest.raises(jp.EnsembleInterrupted, match="simulations were finished") as caught:
        jp.ensemble(simulations, jobs=jobs, keep=interrupt)
    found = caught.value.finished
    assert isinstance(caught.value, KeyboardInterrupt)
    assert len(found) >= 2
    assert set(found) <= {0, 1, 2, 4}
    assert all(place == seed for place, seed in found.items())
    assert set(multiprocessing.active_children()) <= before


def test_a_bar_is_shown_only_where_it_is_asked_for(simulations, capsys, monkeypatch):
    monkeypatch.setattr(module, "BAR_AFTER_S", 0.0)
    jp.ensemble(simulations, jobs=1, keep=pid_and_end)
    assert capsys.readouterr().err == ""
    jp.ensemble(simulations, jobs=1, keep=pid_and_end, progress=True)
    assert "5/5" in capsys.readouterr().err


def nested(result):
    inner = jp.ensemble([result.simulation] * 2, keep=pid_and_end)
    return {os.getpid()} == {pid for pid, _ in inner}


def test_an_ensemble_within_an_ensemble_has_one_core(simulations):
    assert jp.ensemble(simulations[3:], jobs=2, keep=nested) == [True, True]


def threads(_):
    return [one["num_threads"] for one in threadpool_info() if one["user_api"] == "blas"]


def test_numerical_libraries_have_one_thread_in_each_process():
    np.linalg.inv(np.eye(2))
    with threadpool_limits(2):
        assert set(threads(None)) == {2}
        for jobs in (1, 2):
            for found in jp.Study(range(2), threads).run(jobs):
                assert set(found) == {1}


@pytest.mark.parametrize(
    ("files", "number"),
    [
        ({}, 64),
        ({"sys/fs/cgroup/cpu.max": "max 100000"}, 64),
        ({"sys/fs/cgroup/cpu.max": "150000 100000"}, 2),
        ({"sys/fs/cgroup/a/cpu.max": "max 100000", "sys/fs/cgroup/cpu.max": "300000 100000"}, 3),
        ({"sys/fs/cgroup/a/b/cpu.max": "50000 100000"}, 1),
    ],
)
def test_cores_are_those_of_the_affinity_and_of_the_container(files, number, monkeypatch, tmp_path):
    monkeypatch.setattr(os, "sched_getaffinity", lambda _: set(range(64)), raising=False)
    monkeypatch.setattr(processes, "_ROOT", tmp_path)
    groups = "4:cpu,cpuacct:/x\n0::/a/b\n"
    for name, text in {**files, "proc/self/cgroup": groups}.items():
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    assert cores() == number


def test_jobs_are_whole_numbers_and_no_more_than_there_is_to_do():
    assert number_of(8, [1, 2]) == 2
    assert number_of(8, iter(())) == 8
    assert number_of(8, []) == 1
    for wrong in (0, -1, 1.5, True):
        with pytest.raises(jp.JointplayError, match="jobs must be a whole number >= 1"):
            number_of(wrong)


def test_a_process_that_dies_of_an_item_again_and_again_is_replaced():
    def bite(item):
        if item == 2:
            os.kill(os.getpid(), signal.SIGKILL)
        return 10 * item

    with closing(Pool(bite, 2, lost=lambda item: -item, small=True)) as pool:
        assert sorted(pool.run(enumerate(range(5)))) == [(0, 0), (1, 10), (2, -2), (3, 30), (4, 40)]


def test_a_process_told_to_end_before_it_is_set_up_says_nothing(capfd):
    def slowly():
        os.kill(os.getpid(), signal.SIGTERM)  # with the handlers of the process that it copies
        time.sleep(0.1)
        processes.begin()

    with signals.listening(), closing(Pool(abs, 1, begin=slowly, lost=lambda item: -item)) as pool:
        assert list(pool.run([(0, 5)])) == [(0, -5)]
    assert "Traceback" not in capfd.readouterr().err
