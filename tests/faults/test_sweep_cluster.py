"""Sweeps on a real Dask scheduler with worker processes, on loopback; and what becomes of them."""

import re
import signal
import subprocess
from types import SimpleNamespace

import pytest
import xarray as xr
from conftest import needed
from sweep_scenario import SCENARIO
from test_kills import gone, needs_proc
from test_sweep_kills import AXES, CASES, descendants, grown, resume, same
from warm import PYTHON, Process, end, start

import jointplay as jp
from jointplay.study import plan_of
from jointplay.study.case import job
from jointplay.study.cluster import TRIES, ClusterWorkers
from jointplay.study.store import DONE, Outcome, SweepStore

pytestmark = needed("distributed")

LISTENS = re.compile(r"Scheduler at: +(tcp://[\d.:]+)")


class Cluster:
    """A scheduler and workers, processes of their own."""

    def __init__(self, folder):
        self.folder = folder
        command = ["distributed.cli.dask_scheduler", "--host", "127.0.0.1", "--port", "0"]
        self.scheduler = self.spawn(*command, "--no-dashboard")
        self.workers = []
        said = ""
        while not LISTENS.search(said):
            line = self.scheduler.stderr.readline()
            assert line, said
            said += line
        self.address = LISTENS.search(said)[1]

    def spawn(self, *command):
        return Process(
            [PYTHON, "-m", *command],
            cwd=self.folder,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.PIPE,
            text=True,
        )

    def add(self, number=1):
        """Start workers and wait until they are registered."""
        options = ["--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"]
        for _ in range(number):
            worker = self.spawn("distributed.cli.dask_worker", self.address, *options)
            said = ""
            while "Registered to" not in said:
                line = worker.stderr.readline()
                assert line, said
                said += line
            self.workers.append(worker)
        return self

    def sweep(self, path, store):
        """A command that sweeps here, some cases of it finished."""
        own = ("--import", path.parent / "own.py", "--scheduler", self.address)
        process = start("study", "sweep", path, "--out", store, "--quiet", *own)
        grown(store, 3)
        return process

    def close(self):
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.communicate()


@pytest.fixture
def cluster(tmp_path):
    folder = tmp_path / "cluster"
    folder.mkdir()
    made = Cluster(folder)
    yield made
    made.close()


@pytest.fixture(scope="module")
def reference(tmp_path_factory):
    """A scenario with files of its own, and its sweep by local processes."""
    folder = tmp_path_factory.mktemp("reference")
    (folder / "arm.urdf").write_text(jp.shipped("scara.urdf").read_text())
    (folder / "own.py").write_text("def rows(result):\n    return len(result.time)\n")
    jp.import_module(folder / "own.py")
    path = folder / "study.toml"
    options = 'measures = ["own:rows"]\nresults = true'
    text = SCENARIO.format(axes=AXES, options=options, duration="0.03 s")
    path.write_text(text.replace("jointplay:scara.urdf", "arm.urdf"))
    return path, jp.sweep(path, folder / "s", jobs=2).dataset()


def test_a_cluster_gives_what_local_processes_give(cluster, reference, tmp_path):
    path, whole = reference
    cluster.add(2)
    swept = jp.sweep(path, tmp_path / "s", scheduler=cluster.address)
    found, here = swept.dataset(), jp.open_sweep(path.with_name("s"))
    xr.testing.assert_identical(found.drop_vars("cost"), whole.drop_vars("cost"))
    xr.testing.assert_equal(swept.result(0).dataset, here.result(0).dataset)
    assert (found["status"] == "done").sum() == 2 * CASES // 3
    assert "too large for the contact stiffness" in str(found["error"].values[0, 2])


@needs_proc
@pytest.mark.thorough
def test_a_worker_of_a_cluster_that_is_killed_is_of_no_consequence(cluster, reference, tmp_path):
    path, whole = reference
    cluster.add(2)
    process = cluster.sweep(path, tmp_path / "s")
    cluster.workers[0].send_signal(signal.SIGKILL)
    _, err, status = end(process)
    assert status == 0, err
    same(tmp_path / "s", whole)


@needs_proc
@pytest.mark.thorough
def test_a_scheduler_that_is_killed_loses_nothing_that_was_finished(cluster, reference, tmp_path):
    path, whole = reference
    cluster.add(1)
    process = cluster.sweep(path, tmp_path / "s")
    pids = descendants(process.copy)
    cluster.scheduler.kill()
    _, err, status = end(process)
    if status:
        assert status == 2, err
        assert "was lost" in err
        assert "--resume continues" in err
        assert "Traceback" not in err
    gone(pids)
    own = ("--import", path.parent / "own.py")
    resume(path, tmp_path / "s", *own)  # by local processes: the store does not mind
    same(tmp_path / "s", whole)


def test_what_a_worker_that_is_at_fault_says_is_said():
    workers = object.__new__(ClusterWorkers)
    workers.address = "tcp://here"
    future = SimpleNamespace(
        status="error", exception=lambda timeout: ModuleNotFoundError("no module 'own'")
    )
    with pytest.raises(jp.JointplayError, match=r"was lost: ModuleNotFoundError: no module 'own'"):
        list(workers._outcomes(future, [], None))


@pytest.mark.parametrize("there", [False, True])
@pytest.mark.parametrize("address", ["tcp://127.0.0.1:9", "nonsense", "tcp://127.0.0.1:99999999"])
def test_without_a_scheduler_that_is_said_and_nothing_is_left_behind(
    address, there, reference, tmp_path, monkeypatch
):
    monkeypatch.setattr("jointplay.study.cluster.CONNECT_S", 1)
    store = tmp_path / "s"
    if there:
        store.mkdir()
    with pytest.raises(jp.JointplayError, match="no Dask scheduler answers at") as error:
        jp.sweep(reference[0], store, scheduler=address)
    assert "\n" not in str(error.value)
    assert "--resume" not in str(error.value)
    assert list(tmp_path.rglob("*")) == ([store] if there else [])


def test_without_workers_what_an_earlier_sweep_finished_stays(reference, tmp_path, monkeypatch):
    monkeypatch.setattr("jointplay.study.cluster.CONNECT_S", 1)
    store = SweepStore(tmp_path / "s", plan_of(reference[0]))
    store.keep((0, 1), Outcome((0, 1), DONE, {"impacts": 7.0}))
    store.close()
    with pytest.raises(jp.JointplayError, match=f"1 of {CASES} cases are kept; --resume continues"):
        jp.sweep(reference[0], tmp_path / "s", scheduler="tcp://127.0.0.1:9", resume=True)
    assert jp.open_sweep(tmp_path / "s").dataset()["impacts"].values[0, 1] == 7.0


class SlowClient:
    """A client on a machine so busy that its first event loops do not start in time."""

    begun = 0

    def __init__(self, address, **options):
        type(self).begun += 1
        assert self.begun > self.fail

    def nthreads(self):
        return {"one": 1}

    def run(self, function, **options):
        return {"one": function()}


@pytest.mark.parametrize("fail", [2, 1000])
def test_a_client_that_does_not_start_is_begun_again(fail, monkeypatch):
    monkeypatch.setattr(SlowClient, "begun", 0)
    monkeypatch.setattr(SlowClient, "fail", fail, raising=False)
    monkeypatch.setattr("distributed.Client", SlowClient)
    if fail == 2:
        assert ClusterWorkers(abs, "tcp://here", abs).number == 1
        assert SlowClient.begun == 3
        return
    with pytest.raises(jp.JointplayError, match="no Dask scheduler answers at 'tcp://here': ") as e:
        ClusterWorkers(abs, "tcp://here", abs)
    assert "could not start" in str(e.value)
    assert SlowClient.begun == TRIES


@pytest.mark.thorough
def test_a_scheduler_without_workers_is_said_in_a_line(cluster, reference, tmp_path, monkeypatch):
    check = ClusterWorkers._check

    def soon(workers):  # only once the scheduler has answered, however long that took
        monkeypatch.setattr("jointplay.study.cluster.CONNECT_S", 0.5)
        check(workers)

    monkeypatch.setattr(ClusterWorkers, "_check", soon)
    with pytest.raises(jp.JointplayError, match="has no workers"):
        jp.sweep(reference[0], tmp_path / "s", scheduler=cluster.address)


def test_workers_with_another_version_are_refused_with_both(cluster, monkeypatch):
    cluster.add(1)
    monkeypatch.setattr("jointplay.study.cluster.versions", lambda: {"jointplay": "99.0"})
    with pytest.raises(jp.JointplayError, match=r"worker .* has jointplay .*, here is 99.0"):
        ClusterWorkers(abs, cluster.address, abs)


def test_a_worker_that_joins_with_another_version_is_refused_as_well(reference):
    from jointplay.study.case import Bench

    work = job(plan_of(reference[0]))
    other = type(work)(**{**vars(work), "version": "99.0"})
    with pytest.raises(jp.JointplayError, match=r"started with 99.0; install the same"):
        Bench(other)
    assert Bench(work).job == work
