"""Runs whose histories go to disk: the same to the last bit, in bounded memory, and continued."""

import dataclasses
import json
import os
import re
import signal
import subprocess
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from conftest import checkpoint_arrays, save_checkpoint
from warm import PYTHON, end, start, until

import jointplay as jp
from jointplay import cli
from jointplay.paper import scara
from jointplay.physics.kernel import Status
from jointplay.simulation import spool
from jointplay.simulation.analysis import headline
from jointplay.simulation.loads import ComputedTorque, drive_tables
from jointplay.simulation.result import audit, netcdf
from jointplay.simulation.result.result import COMPARED
from jointplay.simulation.working_files import working_paths
from jointplay.study import cases


@pytest.fixture
def small_portions(monkeypatch):
    """So little memory for records that a short run needs several portions."""
    monkeypatch.setattr(audit, "PORTION", 1024)
    monkeypatch.setattr(spool, "PORTION", 1024)
    monkeypatch.setattr(spool, "PORTION_BYTES", 1)
    monkeypatch.setattr(spool, "RECORD_BYTES", 1)
    monkeypatch.setattr(spool, "MOST_BYTES", 1)


def simulation(**options):
    made = scara(2e-4)
    return jp.Simulation(made.mechanism, made.motion, record_every=1, **options)


def crank(clearance, **options):
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    found = scenario.simulation("0.5 mm" if clearance else "ideal")
    return dataclasses.replace(found, record_every=1, settle=None, **options)


def same(one, other, interpolated=()):
    """Whether two results are equal in every bit but the cost; what was interpolated, nearly."""
    assert one.time.size == other.time.size
    for name in other.dataset.variables:
        found, expected = one.dataset[name].values, other.dataset[name].values
        if name in interpolated:
            np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-8, err_msg=name)
            continue
        floats = found.dtype.kind == "f"
        assert np.array_equal(found, expected, equal_nan=floats), name
    assert one.audit == other.audit
    assert (one.status, one.message) == (other.status, other.message)
    for name in ("simulation", "versions"):
        assert json.loads(one.dataset.attrs[name]) == json.loads(other.dataset.attrs[name])


CASES = {
    "clearance": lambda: simulation(duration=0.025, judge_from=0.012, start="centred"),
    "seed": lambda: simulation(duration=0.025, seed=3),
    "loop": lambda: crank(True, duration=0.006),
    "ideal loop": lambda: crank(False, duration=0.006),
    "payload": lambda: simulation(
        duration=0.025, payloads=[jp.Payload("suction_cup", 0.5, pick=0.011, release=0.023)]
    ),
    "fixed step": lambda: simulation(duration=0.025, integrator="rk4"),
    "tolerance": lambda: simulation(duration=0.025, tolerance=1e-3),
}


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("clearance", "tolerance") else pytest.mark.thorough)
        for name in CASES
    ],
)
def test_histories_on_disk_are_those_in_memory_bit_for_bit(name, small_portions, tmp_path):
    one = CASES[name]()
    found = one.run_to(tmp_path / "long.nc")
    assert [path.name for path in tmp_path.iterdir()] == ["long.nc"]
    same(found, one.run(check_step=False))


FINE = """
[robot]
urdf = "jointplay:scara.urdf"
gravity = [0, 0, 0]
[motion]
file = "jointplay:scara_motion.csv"
[joints.joint_b]
radial_clearance = "0.2 mm"
axial_clearance = "0.2 mm"
[integration]
duration = "0.3 s"
[output]
record_every = 1
figures = false
"""


@pytest.mark.thorough
def test_errors_of_a_run_on_disk_are_those_of_one_in_memory(tmp_path, monkeypatch, capsys):
    """In portions: sums are added in another order, so to the last digits only."""
    (tmp_path / "long.toml").write_text(FINE)
    found = {}
    for where in ("memory", "disk"):
        if where == "disk":
            for name, size in (("PORTION_BYTES", 1), ("RECORD_BYTES", 1), ("MOST_BYTES", 1)):
                monkeypatch.setattr(spool, name, size)
            monkeypatch.setattr(headline, "AT_ONCE", 4096)
            # What lies between the ideal mechanism's records is interpolated.
            monkeypatch.setattr("jointplay.study.certification.SUMMARY_RECORDS", 1000)
        command = ["run", str(tmp_path / "long.toml"), "--out", str(tmp_path / where)]
        assert cli.main([*command, "--quiet", "--detail", "--jobs", "1"]) == 0
        found[where] = jp.Result.load(next((tmp_path / where).glob("*.nc")))
        assert "numerical errors, estimated from" in capsys.readouterr().out
    same(found["disk"], found["memory"], COMPARED)
    memory, disk = (found[where].certificate for where in ("memory", "disk"))
    assert [one.name for one in disk.figures] == [one.name for one in memory.figures]
    for one, other in zip(disk.figures, memory.figures, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-6), one.name
        assert one.error == pytest.approx(other.error, rel=1e-2), one.name


@pytest.mark.thorough
def test_no_damage_is_sealed_with_a_certificate(tmp_path):
    path = tmp_path / "r.nc"
    simulation(duration=0.005).run_to(path).dataset.close()
    netcdf.add(path, {"title": "x" * 100_000})
    assert jp.Result.load(path).dataset.attrs["title"] == "x" * 100_000
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(jp.JointplayError, match="checksum"):
        netcdf.add(path, {"title": "y"})
    assert path.read_bytes() == content
    assert names(tmp_path) == ["r.nc"]


@pytest.mark.thorough
@pytest.mark.parametrize("on_disk", [False, True])
def test_errors_whose_search_was_interrupted_are_found_by_resuming(
    on_disk, monkeypatch, tmp_path, capsys
):
    """In the last of the further runs; what was computed before stays, bit for bit."""
    command = ["run", "--duration", "0.05", "--record-every", "1", "--no-figures"]
    command += ["--out", str(tmp_path / "o")]
    if on_disk:
        for name in ("PORTION_BYTES", "RECORD_BYTES", "MOST_BYTES"):
            monkeypatch.setattr(spool, name, 1)
    begun = []

    class Stopped(jp.Run):
        def run_to_end(self, progress=False):
            begun.append(self)
            if len(begun) == 2:
                stepped(self, 0.02)
                signal.raise_signal(signal.SIGINT)
            return super().run_to_end(progress)

    with monkeypatch.context() as patched:
        patched.setattr("jointplay.study.certification.Run", Stopped)
        assert cli.main(command) == 130
    err = capsys.readouterr().err
    assert "without numerical errors: result; the same command with --resume continues" in err
    assert names(tmp_path / "o") == ["result.nc"]
    kept = jp.Result.load(tmp_path / "o" / "result.nc")
    assert (kept.status, kept.certificate) == (Status.COMPLETED, None)
    assert cli.main([*command, "--resume", "--detail"]) == 0
    assert re.search(r"numerical errors, estimated from [23] further runs", capsys.readouterr().out)
    found = jp.Result.load(tmp_path / "o" / "result.nc")
    same(found, kept)
    assert found.dataset.attrs["wall_time_s"] == kept.dataset.attrs["wall_time_s"]
    assert found.certificate["peak joint force"].error > 0.0


@pytest.mark.thorough
def test_size_and_idle_time_are_said_before_a_run(tmp_path, monkeypatch, capsys):
    (tmp_path / "move.csv").write_text("time_s,joint_a,joint_b\n0,0,0\n0.05,0.1,0.1\n")
    text = FINE.replace("jointplay:scara_motion.csv", "move.csv")
    (tmp_path / "long.toml").write_text(text)
    command = ["run", str(tmp_path / "long.toml"), "--no-error-estimate", "--out"]
    assert cli.main([*command, str(tmp_path / "short")]) == 0
    said = capsys.readouterr().err
    assert "stands still" not in said  # a quarter of a second
    assert "GB on disk" not in said
    monkeypatch.setattr(spool, "MOST_BYTES", 1 << 20)
    monkeypatch.setattr(cases, "IDLE_S", 0.1)
    assert cli.main([*command, str(tmp_path / "long")]) == 0
    said = capsys.readouterr().err
    assert (
        "the motion ends at 0.05 s: for the other 0.25 s of the duration the machine stands still"
        in said
    )
    records, every, size = re.search(
        r"(\d+) records, one every (\S+) µs, take (\S+) GB", said
    ).groups()
    assert (records, every) == ("30001", "10")
    record = jp.Run(jp.Scenario.load(tmp_path / "long.toml").simulation("long")).workspace.record
    assert float(size) == pytest.approx(30001 * record.strides[0] / 1e9, rel=0.1)


def stepped(run, until):
    for moment in run.steps(1e-3):
        if moment.time >= until:
            return run
    raise AssertionError("the run is shorter")


@pytest.mark.thorough
def test_a_run_is_continued_bit_for_bit_wherever_it_was_stopped(small_portions, tmp_path):
    one = simulation(duration=0.06, judge_from=0.02, seed=1)
    whole = one.run_to(tmp_path / "whole.nc")
    path = tmp_path / "parts.nc"
    records, kept = working_paths(path)
    run = jp.Run(one, records=records)
    for stop in (0.013, 0.041):
        stepped(run, stop).checkpoint(kept)
        run = jp.Simulation.resume(kept)
    with records.open("ab") as file:
        file.write(b"what a killed process left")
    same(one.run_to(path, resume=True), whole)
    assert sorted(name.name for name in tmp_path.iterdir()) == ["parts.nc", "whole.nc"]


def test_records_that_are_missing_are_said(small_portions, tmp_path):
    one = simulation(duration=0.06)
    records, kept = working_paths(tmp_path / "r.nc")
    stepped(jp.Run(one, records=records), 0.03).checkpoint(kept)
    os.truncate(records, 1000)
    with pytest.raises(
        jp.JointplayError, match="is missing records of the run: it holds 1000 bytes"
    ):
        one.run_to(tmp_path / "r.nc", resume=True)


def test_a_checkpoint_of_another_run_is_refused_with_the_difference(tmp_path):
    kept = working_paths(tmp_path / "r.nc")[1]
    stepped(jp.Run(simulation(duration=0.02)), 0.01).checkpoint(kept)
    with pytest.raises(
        jp.JointplayError, match=r"to another run: duration is 0.03 instead of 0.02"
    ):
        simulation(duration=0.03).run_to(tmp_path / "r.nc", resume=True)
    with pytest.raises(jp.JointplayError, match="exists"):
        simulation(duration=0.02).run_to(tmp_path / "r.nc")


@pytest.mark.parametrize("loops", [pytest.param(True, marks=pytest.mark.thorough), False])
def test_a_motion_in_blocks_drives_as_a_whole_table_does(loops, monkeypatch, tmp_path):
    one = simulation(duration=0.13)
    if loops:
        one = crank(False, duration=0.13, drive=ComputedTorque(), step=1e-5)
    whole = jp.Run(one).workspace.reference
    monkeypatch.setattr(drive_tables, "BLOCK_NODES", 1)
    table = jp.Run(one)._reference
    found = [table.table]
    while table.until < 0.13:
        first = table.first + len(table.table)
        table.go_to(table.until)
        found.append(table.table[first - table.first :])
    assert len(found) > 2
    np.testing.assert_allclose(np.concatenate(found), whole, rtol=1e-9, atol=1e-9)
    run = stepped(jp.Run(one), 0.1)
    again = jp.Simulation.resume(run.checkpoint(tmp_path / "run.npz"))
    same(again.finish(check_step=False), one.run(check_step=False))


@pytest.mark.thorough
def test_a_file_is_read_as_if_it_had_been_recorded_less_often(tmp_path):
    one = simulation(duration=0.05, seed=2)
    one.run_to(tmp_path / "r.nc")
    seldom = dataclasses.replace(one, record_every=50).run(check_step=False)
    found = jp.Result.load(tmp_path / "r.nc", every=50)
    np.testing.assert_array_equal(found.q, seldom.q)
    for name in ("q", "joint_force_peak", "gap_min", "normal_force_peak"):
        np.testing.assert_allclose(found[name].values, seldom[name].values, rtol=1e-4, atol=1e-12)
    assert found.simulation == seldom.simulation


def test_a_lazily_opened_file_keeps_nothing_in_memory_and_is_checked(tmp_path):
    path = tmp_path / "r.nc"
    simulation(duration=0.01).run_to(path)
    found = jp.Result.open(path)
    assert not any(v.variable._in_memory for v in found.dataset.data_vars.values())
    assert found["q"].isel(time=slice(3, 5)).values.shape[0] == 2
    found.dataset.close()
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(jp.JointplayError, match="checksum"):
        jp.Result.open(path)


RUN = """
import sys
from pathlib import Path
from jointplay import cli
from jointplay.simulation.result import thinning

thinning.SUMMARY_RECORDS = 5_000
command = ["run", "--no-figures", "--quiet", "--duration", sys.argv[1], "--out", sys.argv[2]]
status = cli.main([*command, "--record-every", "1"])
lines = Path("/proc/self/status").read_text().splitlines()
(peak,) = (line for line in lines if line.startswith("VmHWM:"))
print("PEAK", status, 1024 * int(peak.split()[1]))
"""

GROWTH = 25e6
"""What two and a half times the length may add to the memory of the whole command [bytes]: a run
and its ideal one, and of the finest further run its own."""


@pytest.mark.thorough
@pytest.mark.skipif(not Path("/proc/self/status").is_file(), reason="needs Linux's /proc")
def test_memory_of_the_command_does_not_grow_with_the_length_of_a_run(tmp_path):
    """From the first import to the last line, the summary and the ideal mechanism's run in it."""
    simulation(duration=1e-3).run()  # a first start compiles, which takes memory of its own
    peaks = []
    for duration in ("0.8", "2.0"):
        command = [PYTHON, "-c", RUN, duration, str(tmp_path / duration)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        word, status, peak = done.stdout.split()[-3:]
        assert (word, status) == ("PEAK", "0"), done.stderr
        assert "puts the tool" in done.stdout
        peaks.append(int(peak))
    with jp.Result.open(tmp_path / "2.0" / "result.nc").dataset as dataset:
        assert dataset.nbytes > 5.0 * GROWTH
    assert peaks[1] - peaks[0] < GROWTH


def names(folder):
    return sorted(path.name for path in folder.iterdir())


LONG = ("--duration", "2", "--no-figures", "--no-error-estimate")


@pytest.mark.thorough
def test_sigterm_writes_a_checkpoint_says_so_and_resume_gives_the_same_bits(tmp_path):
    out = tmp_path / "o"
    process = start("run", *LONG, "--out", out)
    until(process)
    process.send_signal(signal.SIGTERM)
    said, err, status = end(process)
    assert status == 130, err
    assert "checkpoint at t = " in err
    assert "the same command with --resume continues" in err
    assert "interrupted at" in said
    assert {"result.checkpoint", "result.nc"} <= set(names(out))
    part = jp.Result.load(out / "result.nc")
    assert part.status == Status.INTERRUPTED
    _, err, status = end(start("run", *LONG, "--out", out))
    assert (status, "--resume continues it" in err) == (2, True)
    _, err, status = end(start("run", *LONG, "--step", "8e-6", "--out", out, "--resume"))
    assert (status, "step is 8e-06 instead of 1e-05" in err) == (2, True)
    _, err, status = end(start("run", *LONG, "--out", out, "--resume"))
    assert status == 0, err
    assert names(out) == ["result.nc"]
    _, err, status = end(start("run", *LONG, "--out", tmp_path / "whole", "--quiet"))
    assert status == 0, err
    found = jp.Result.load(out / "result.nc")
    same(found, jp.Result.load(tmp_path / "whole" / "result.nc"))
    assert len(part.time) < len(found.time)


@pytest.mark.thorough
def test_resume_goes_on_after_a_kill_and_leaves_what_is_done(tmp_path):
    """Of two cases one is done, of the other a checkpoint is left."""
    _, err, status = end(start("init", tmp_path / "study"))
    assert status == 0, err
    path = tmp_path / "study.toml"
    text = path.read_text(encoding="utf-8").replace("# duration = ", 'duration = "0.1 s" # ')
    path.write_text(text, encoding="utf-8")
    scenario = jp.Scenario.load(path)
    first, second = scenario.cases[:2]
    chosen = ("--case", first, "--case", second, "--no-error-estimate", "--no-figures", "--quiet")
    _, err, status = end(start("run", path, *chosen, "--out", tmp_path / "whole"))
    assert status == 0, err
    out = tmp_path / "o"
    _, err, status = end(start("run", path, *chosen[:2], *chosen[4:], "--out", out))
    assert status == 0, err
    (done,) = out.iterdir()
    before = done.stat().st_mtime_ns
    (other,) = set(names(tmp_path / "whole")) - {done.name}
    records, kept = working_paths(out / other)
    stepped(scenario.ready_run(second, records=records), 0.05).checkpoint(kept)
    _, err, status = end(start("run", path, *chosen, "--out", out, "--resume"))
    assert status == 0, err
    assert done.stat().st_mtime_ns == before
    assert names(out) == names(tmp_path / "whole")
    same(jp.Result.load(out / other), jp.Result.load(tmp_path / "whole" / other))


def test_files_of_ones_own_beside_a_result_stay_and_the_run_is_refused_before_it_begins(tmp_path):
    for suffix, what in ((".records", "file of records"), (".checkpoint", "checkpoint")):
        out = tmp_path / suffix[1:]
        out.mkdir()
        mine = out / f"result{suffix}"
        mine.write_text("precious")
        for more in ((), ("--resume",)):
            short = ("--duration", "0.02", "--no-figures", "--quiet")
            said, err, status = end(start("run", *short, "--out", out, *more))
            assert (status, said) == (2, ""), err
            assert f"result{suffix}' is not a {what} of jointplay" in err
            with pytest.raises(jp.JointplayError, match=f"is not a {what} of jointplay"):
                simulation(duration=0.02).run_to(out / "result.nc", resume=bool(more))
            assert (names(out), mine.read_text()) == ([mine.name], "precious")


def test_a_checkpoint_replaces_checkpoints_only(tmp_path):
    run = stepped(jp.Run(simulation(duration=0.02)), 0.01)
    mine = tmp_path / "mine.dat"
    mine.write_text("precious")
    with pytest.raises(jp.JointplayError, match="is not a checkpoint of jointplay"):
        run.checkpoint(mine)
    assert mine.read_text() == "precious"
    kept = run.checkpoint(tmp_path / "run.checkpoint")
    assert jp.Simulation.resume(run.checkpoint(kept)).workspace.time == run.workspace.time


def renamed(kept, name):
    """A checkpoint that has its records in a file of another name."""
    arrays = checkpoint_arrays(kept)
    head = json.loads(arrays["head"].tobytes())
    head["records"]["file"] = name
    return save_checkpoint(kept, arrays, head)


def test_no_file_is_touched_because_a_checkpoint_names_it(small_portions, tmp_path):
    one = simulation(duration=0.06)
    records, kept = working_paths(tmp_path / "r.nc")
    stepped(jp.Run(one, records=records), 0.03).checkpoint(kept)
    content = records.read_bytes()
    mine = tmp_path / "precious.dat"
    mine.write_bytes(b"precious" * len(content))
    before = mine.read_bytes()
    with pytest.raises(jp.JointplayError, match=r"precious\.dat' is not a file of records"):
        jp.Simulation.resume(renamed(kept, mine.name))
    assert mine.read_bytes() == before
    for outside in ("../precious.dat", "/etc/hostname", ""):
        with pytest.raises(jp.JointplayError, match="damaged or not a checkpoint"):
            jp.Simulation.resume(renamed(kept, outside))
    other, its = working_paths(tmp_path / "other.nc")
    stepped(jp.Run(one, records=other), 0.04).checkpoint(its)
    before = other.read_bytes()
    with pytest.raises(jp.JointplayError, match=r"other\.records' holds records of another run"):
        jp.Simulation.resume(renamed(kept, other.name))
    assert other.read_bytes() == before
    again = jp.Simulation.resume(renamed(kept, records.name))
    assert again.workspace.time == pytest.approx(0.03)


def test_a_result_that_is_no_interrupted_run_is_not_replaced_by_resuming(small_portions, tmp_path):
    one = simulation(duration=0.03)
    path = tmp_path / "r.nc"
    records, kept = working_paths(path)
    stepped(jp.Run(one, records=records), 0.01).checkpoint(kept)
    path.write_text("precious")
    with pytest.raises(jp.JointplayError, match="is not the result of an interrupted run"):
        one.run_to(path, resume=True)
    assert path.read_text() == "precious"
    path.unlink()
    assert one.run_to(path, resume=True).status == Status.COMPLETED
    assert names(tmp_path) == ["r.nc"]


def test_histories_are_added_to_a_growing_file_portion_by_portion(tmp_path):
    def part(begin, end, name):
        values = np.arange(begin, end, dtype=float)
        return xr.Dataset({name: ("time", values, {"units": "m"})}, {"time": values})

    path = tmp_path / "r.nc"
    with (
        path.open("w+b") as file,
        closing(netcdf.GrowingDataset(file, part(0, 5000, "q"))) as growing,
    ):
        growing.append(part(5000, 9000, "q"))
        growing.finish({"case": "a"}, {})
    parts = [part(begin, end, "tool_error") for begin, end in ((0, 4000), (4000, 9000))]
    netcdf.add(path, {"certificate": "b"}, parts)
    read = netcdf.load(path)
    assert read["tool_error"].attrs["units"] == "m"
    assert np.array_equal(read["tool_error"], read["q"])
    assert (read.attrs["case"], read.attrs["certificate"]) == ("a", "b")
