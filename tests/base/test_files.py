"""Files that are whole or not there, and results that are what was written."""

import errno
import fcntl
import json
import os
import re
import subprocess
import tempfile
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr
from warm import PYTHON

import jointplay as jp
from jointplay import JointplayError
from jointplay.base import confined, files, hdf5, schema
from jointplay.cli import main
from jointplay.paper import scara
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS, KelvinVoigt
from jointplay.physics.joints import Clearance
from jointplay.show.plots.style import new_figure
from jointplay.simulation.result import netcdf


@pytest.fixture(scope="module")
def result():
    made = scara(2e-4)
    return jp.simulate(made.mechanism, made.motion, duration=2e-3)


@pytest.fixture(scope="module")
def saved(result, tmp_path_factory):
    return result.save(tmp_path_factory.mktemp("saved") / "r.nc")


@pytest.mark.parametrize("function", ["fsync", "link"])
def test_a_file_that_cannot_be_finished_is_not_there(function, tmp_path, monkeypatch):
    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, function, full)
    with pytest.raises(JointplayError, match=r"cannot write .* No space left on device"):
        files.write(tmp_path / "a.txt", "text")
    assert list(tmp_path.iterdir()) == []


def test_a_file_of_someone_else_is_never_replaced_unless_asked(tmp_path, monkeypatch):
    path = tmp_path / "a.txt"
    # It comes into being between the look and the naming.
    monkeypatch.setattr(os.path, "lexists", lambda _: False)
    path.write_text("precious")
    with pytest.raises(JointplayError, match="already exists; choose another name"):
        files.write(path, "mine")
    assert path.read_text() == "precious"
    assert [file.name for file in tmp_path.iterdir()] == ["a.txt"]
    files.write(path, "mine", overwrite=True)
    assert path.read_text() == "mine"


def test_file_systems_without_hard_links_will_do(tmp_path, monkeypatch):
    def none(*_):
        raise OSError(errno.EPERM, "Operation not permitted")

    monkeypatch.setattr(os, "link", none)
    assert files.write(tmp_path / "a.txt", "text").read_text() == "text"
    with pytest.raises(JointplayError, match="exists"):
        files.write(tmp_path / "a.txt", "other")
    assert len(list(tmp_path.iterdir())) == 1


@pytest.mark.parametrize("name", ["a\0b", "a" * 300, "", ".", "none/a"])
def test_names_that_no_file_can_have_are_refused_in_words(name, tmp_path):
    with pytest.raises(JointplayError):
        files.write(tmp_path / name, "text")
    with pytest.raises(JointplayError):
        files.check_new(tmp_path / name)


def test_a_folder_is_claimed_by_one_process(tmp_path):
    files.claim(tmp_path / "o", ["r.nc"])
    code = "import sys; from jointplay.base import files; files.claim(sys.argv[1], ['r.nc'])"
    other = [PYTHON, "-c", code, str(tmp_path / "o")]
    done = subprocess.run(other, capture_output=True, text=True, check=False)
    assert "another process is writing to" in done.stderr
    (tmp_path / "o" / "r.nc").write_text("mine")
    with pytest.raises(JointplayError, match="already holds results"):
        files.claim(tmp_path / "o", ["r.nc"])


def test_every_flipped_bit_is_noticed(saved, tmp_path):
    content = saved.read_bytes()
    path = tmp_path / "r.nc"
    for at in range(0, len(content) - netcdf._SEALED, len(content) // 40):
        damaged = bytearray(content)
        damaged[at] ^= 4
        path.write_bytes(damaged)
        with pytest.raises(JointplayError, match="its checksum does not match"):
            jp.Result.load(path)


def test_other_programs_read_a_sealed_file(saved, result):
    assert saved.read_bytes().startswith(b"\x89HDF")
    with xr.open_dataset(saved, engine="h5netcdf") as dataset:
        assert dataset["q"].shape == result["q"].shape


@pytest.mark.parametrize("cut", [1, 2, 65, 81, 82, 83, 300])
def test_a_file_that_was_cut_is_refused_wherever_it_was_cut(saved, tmp_path, cut):
    """Its checksum is the end of it: a file without one is not taken for another program's."""
    path = tmp_path / "cut.nc"
    path.write_bytes(saved.read_bytes()[:-cut])
    for read in (jp.Result.load, jp.Result.open):
        with pytest.raises(JointplayError, match="does not end with its checksum"):
            read(path)


SPINS = """
import sys, time
sys.path.append(sys.argv[1])
from jointplay.base import confined, hdf5
def check(*_):
    while True:
        pass
hdf5._check = check
confined._serve(*sys.argv[2:])
"""
WAITS = SPINS.replace("while True", "if True").replace("pass", "time.sleep(5.0)")


@pytest.mark.parametrize("read", [jp.Result.load, jp.Result.open])
@pytest.mark.parametrize(
    ("program", "allowed", "words"),
    [
        ("import time; time.sleep(1e6)", 0.01, r"reading it did not end within \d s"),
        (SPINS, 0.5, "within 1 s of processor time"),
        ("import os; os.abort()", 900.0, r"reading it crashed \(-6\)"),
    ],
)
def test_a_file_that_hangs_or_crashes_hdf5_does_so_in_another_process(
    program, allowed, words, read, saved, monkeypatch
):
    monkeypatch.setattr(confined, "_BEGIN", program)
    monkeypatch.setattr(hdf5, "TIME_S", allowed)
    with pytest.raises(JointplayError, match=words):
        read(saved)


@pytest.mark.thorough
def test_a_file_is_read_however_busy_the_machine_is(saved, monkeypatch):
    """What counts is processor time."""
    monkeypatch.setattr(confined, "_BEGIN", WAITS)
    monkeypatch.setattr(hdf5, "TIME_S", 4.0)
    assert jp.Result.load(saved).message


def test_without_a_process_to_look_at_it_a_file_is_not_read(saved, monkeypatch):
    monkeypatch.setattr(confined, "sys", SimpleNamespace(executable="/nowhere/python"))
    with pytest.raises(
        JointplayError, match="the process that would check it cannot be started: No such"
    ):
        jp.Result.load(saved)


def test_a_result_larger_than_the_memory_is_refused(saved, monkeypatch):
    monkeypatch.setattr(netcdf, "memory", lambda: 1e3)
    with pytest.raises(JointplayError, match=r"more than the .* GB that this machine has"):
        jp.Result.load(saved)


def without(text, key):
    """A JSON table with one key less."""
    table = json.loads(text)
    del table[key]
    return json.dumps(table)


EDITS = {
    "no audit": lambda d: d.attrs.pop("audit"),
    "audit of another kind": lambda d: d.attrs.update(audit="[]"),
    "audit of words": lambda d: d.attrs.update(audit=d.attrs["audit"].replace("0.0", '"a"', 1)),
    "unknown status": lambda d: d.attrs.update(status="splendid"),
    "no JSON": lambda d: d.attrs.update(simulation="{"),
    "deep JSON": lambda d: d.attrs.update(simulation="[" * 100_000),
    "versions": lambda d: d.attrs.update(versions="[]"),
    "wall time": lambda d: d.attrs.update(wall_time_s="long"),
    "message": lambda d: d.attrs.update(message=3),
    "no state": lambda d: d.attrs.update(simulation=without(d.attrs["simulation"], "state")),
    "format": lambda d: d.attrs.update(jointplay_format=[1, 2]),
    "units": lambda d: d["tool_position"].attrs.pop("units"),
}


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_attributes_that_no_run_wrote_are_refused_on_load(edit, result, saved):
    dataset = result.dataset.copy(deep=True)
    edit(dataset)
    with pytest.raises(JointplayError, match="is damaged") as caught:
        jp.Result.read(saved, lambda _: dataset)
    assert "\n" not in str(caught.value)


def _paths(content, path=()):
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _paths(value, (*path, key))
    else:
        yield path


def test_every_input_of_another_kind_is_refused_on_load_or_when_built(result, saved):
    given = json.loads(result.dataset.attrs["simulation"])
    for path in _paths(given):
        content = json.loads(result.dataset.attrs["simulation"])
        table = content
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = {"no": ["one", "asked"]}
        dataset = result.dataset.copy()
        dataset.attrs["simulation"] = json.dumps(content)
        with pytest.raises(JointplayError):
            jp.Run(jp.Result.read(saved, lambda _, edited=dataset: edited).simulation)


REQUIRED = {"kelvin-voigt": {"damping": 100.0}, "anagnostopoulos": {"mass": 1.0}}


def test_what_every_law_and_joint_describes_is_taken_on_load():
    sizes = {"radial_clearance": 1e-4, "axial_clearance": 1e-4}
    joints = [
        jp.RevoluteClearance(normal=law(**REQUIRED.get(name, {})), **sizes)
        for name, law in NORMAL_LAWS.items()
    ]
    joints += [jp.RevoluteClearance(friction=law(), **sizes) for law in FRICTION_LAWS.values()]
    joints += [jp.RevoluteClearance(lubricant=law(0.1), **sizes) for law in FILM_LAWS.values()]
    joints += [
        jp.RevoluteClearance(worn=[1e-6] * 16, wear_rate=1e-14, lock_tilt=True, **sizes),
        jp.RevoluteClearance.planar(radial_clearance=1e-4),
        jp.SphericalClearance(radial_clearance=1e-4),
        jp.PrismaticClearance(clearance=1e-4, length=0.05, width=0.02, height=0.02),
        jp.RevoluteClearance(
            normal=KelvinVoigt(10.0), journal_material=jp.Material(name="steel"), **sizes
        ),
    ]
    for joint in joints:
        assert schema.read(Clearance, json.loads(json.dumps(joint.describe()))) == joint
        assert eval(repr(joint), vars(jp) | vars(jp.contact) | vars(jp.physics.joints)) == joint


LEAVE = """
import os, signal
from jointplay.base.files import temporary
made = temporary("test")
print(made.name, flush=True)
os.kill(os.getpid(), signal.SIGKILL)
"""


@pytest.fixture
def left(tmp_path, monkeypatch):
    """The folder of temporary files, with what a killed process has left there."""
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    monkeypatch.setattr(files, "_swept", set())
    done = subprocess.run([PYTHON, "-c", LEAVE], capture_output=True, text=True, check=False)
    folder = Path(done.stdout.strip())
    assert folder.parent == tmp_path
    aged(folder)
    return folder


def aged(folder, seconds=2 * files.LEFT_S):
    then = time.time() - seconds
    os.utime(folder / files.MARK, (then, then))


HELD = []


def held(folder):
    """Hold the lock of the folder's owner, as the owner does while it lives."""
    HELD.append((folder / files.MARK).open())
    fcntl.flock(HELD[-1], fcntl.LOCK_EX)


def test_what_a_killed_process_left_the_next_one_deletes(left):
    with files.temporary() as folder:
        assert not left.exists()
        assert Path(folder).is_dir()
    assert not Path(folder).exists()


STAYS = {
    "younger than a day": lambda folder: aged(folder, files.LEFT_S / 2),
    "not marked": lambda folder: (folder / files.MARK).unlink(),
    "the owner lives": held,
    "of another machine or container": lambda folder: (folder / files.MARK).write_text("elsewhere"),
    "a mark that says nothing": lambda folder: (folder / files.MARK).write_bytes(b"\xff"),
}


@pytest.mark.parametrize("reason", STAYS)
def test_other_folders_stay(reason, left):
    STAYS[reason](left)
    if (left / files.MARK).exists() and "younger" not in reason:
        aged(left)
    with files.temporary():
        assert left.is_dir()


def test_a_folder_outlasts_a_day_while_its_process_lives(monkeypatch, tmp_path):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    with files.temporary() as folder:
        aged(Path(folder))
        monkeypatch.setattr(files, "_swept", set())
        with files.temporary():
            assert Path(folder).is_dir()


def test_where_nothing_can_be_locked_folders_are_not_marked(monkeypatch):
    def no_locks(*_):
        raise OSError(errno.ENOLCK, "No locks available")

    monkeypatch.setattr(files.locks.fcntl, "flock", no_locks)
    with files.temporary() as folder:
        assert not list(Path(folder).iterdir())


def test_a_link_to_a_marked_folder_is_left_alone(left, tmp_path):
    elsewhere = tmp_path / "elsewhere"
    left.rename(elsewhere)
    left.symlink_to(elsewhere)
    with files.temporary():
        assert (elsewhere / files.MARK).exists()


def test_all_temporary_folders_are_marked():
    """Otherwise are made: a result that found no other place, which is to outlast the process, and
    the folder of a viewer, which its server deletes when the process ends or is killed."""
    root = Path(__file__).parents[2]
    others = {
        path.name
        for folder in (root / "src", root / "benchmarks")
        for path in folder.rglob("*.py")
        if re.search(r"mkdtemp|TemporaryDirectory\(|mkstemp", path.read_text(encoding="utf-8"))
    }
    assert others == {"files.py", "saving.py", "viewer.py"}


WRITERS = re.compile(
    r"\.(savefig|imsave|imwrite|write_text|write_bytes|write_html|write_image|to_csv|to_netcdf"
    r"|to_parquet|savetxt|savez\w*|tofile|rename|unlink|rmtree|rmdir|copyfile|f?truncate|fdopen|dump)\("
    r"|h5py\.File\([^)]*['\"]w|os\.open\(|\bopen\([^)]*['\"][rbt]*[wax+]"
)
"""Calls that can write, or delete, a file."""

ELSEWHERE = {
    "in memory": "bridges/table show/plots/style "
    "show/reports/template show/reports/pdf simulation/result/netcdf simulation/checkpoint "
    "simulation/result/result show/reports/runs",
    "text, or standard output": "bridges/trajectory cli/commands/check base/streams",
    "in temporary folders and the user's cache": "model/viewer model/meshes model/design "
    "model/mjcf_whole "
    "show/player/movie study/case base/locks",
    "pieces whose checksums tell what is whole": "base/objects simulation/spool study/database",
    "a file without runs, deleted as it is closed": "study/runs",
    "joints that are done, deleted once all are": "bridges/reduction cli/commands/export/simulator",
}
"""Modules that write without `files`, by why that loses nothing."""


def test_every_output_is_written_by_one_module():
    """So that none is there by half, and none replaces a file that is not ours."""
    source = Path(jp.__file__).parent
    writers = {
        path.relative_to(source).with_suffix("").as_posix()
        for path in source.rglob("*.py")
        if WRITERS.search(path.read_text(encoding="utf-8"))
    }
    assert writers - {"base/files"} == set(" ".join(ELSEWHERE.values()).split())


LIMITED = """
import resource, signal, sys
from jointplay import cli
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000))  # a table fits, no picture
sys.exit(cli.main(sys.argv[1:]))
"""


def test_pictures_on_a_full_disk_are_not_there_and_the_refusal_names_one(tmp_path):
    out = tmp_path / "o"

    call = [PYTHON, "-c", LIMITED, "budget", "jointplay:scara.urdf", "--joint", "joint_b=0.0002"]
    done = subprocess.run([*call, "--out", out], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "cannot write " in done.stderr
    assert "bars.png': File too large" in done.stderr
    assert [path.name for path in out.iterdir()] == ["budget.csv"]


def test_pictures_of_a_kind_that_is_not_drawn_are_refused(tmp_path):
    with pytest.raises(JointplayError, match=r"'x\.foo' must end in \.png, \.pdf, \.svg"):
        files.check_picture(tmp_path / "x.foo")
    figure = new_figure(1.0, 1.0)
    for name in ("x.foo", "x"):
        with pytest.raises(JointplayError, match="must end in"):
            files.picture(tmp_path / name, figure)
    with pytest.raises(ValueError, match="foo"):
        figure.savefig(tmp_path / "x.foo")
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("kind", files.PICTURES)
def test_only_pictures_with_our_mark_are_replaced(kind, tmp_path):
    figure, path = new_figure(1.0, 1.0), tmp_path / f"a.{kind}"
    path.write_text("precious")
    with pytest.raises(JointplayError, match="exists"):
        files.picture(path, figure, mark="ours")
    assert path.read_text() == "precious"
    path.unlink()
    first = files.picture(path, figure, mark="ours").stat().st_ino
    assert files.picture(path, figure, mark="ours").stat().st_ino != first
    with pytest.raises(JointplayError, match="exists"):
        files.picture(path, figure, mark="another's")
    figure.savefig(path)  # as matplotlib's own, but whole
    assert len(list(tmp_path.iterdir())) == 1


@pytest.fixture(scope="module")
def ideal():
    made = scara(None)
    return jp.simulate(made.mechanism, made.motion, duration=2e-3)


def rewritten(result, path, change):
    """A result as another program might have left it, with the checksum of that."""
    dataset = change(result.dataset)
    dataset.attrs |= result.dataset.attrs
    content = dataset.to_netcdf(None, engine="h5netcdf", invalid_netcdf=True)
    path.write_bytes(netcdf.seal(bytes(content)))
    return path


def with_times(*times):
    return lambda d: d.isel(time=slice(0, len(times))).assign_coords(time=list(times))


@pytest.mark.parametrize(
    ("command", "change", "said"),
    [
        ("play", with_times(0.0, 2e-4, 1e-4), "record 3 of 3 is at 0.0001 s behind 0.0002 s"),
        ("report", with_times(0.0, 1e-4, 1e-4), "record 3 of 3 is at 0.0001 s behind 0.0001 s"),
        ("export result", with_times(0.0, float("nan"), 1e-4), "record 2 of 3 is at nan s"),
        ("report", with_times(0.0, 1e-4, float("inf")), "record 3 of 3 is at inf s"),
        ("play", lambda d: d.assign(q=d["q"] * 1j), "is not a dataset"),
        ("report", lambda d: d.assign(own=d["time"] * 1j), "is not a dataset"),
    ],
)
def test_results_whose_times_or_numbers_are_none_are_refused_by_each_command(
    command, change, said, ideal, tmp_path, capsys
):
    path = rewritten(ideal, tmp_path / "r.nc", change)
    out = tmp_path / "out"
    arguments = {
        "report": ["report", path, "-o", out],
        "play": ["play", path, "--html", out],
        "export result": ["export", "result", path, "--out", tmp_path / "out.csv"],
    }
    assert main([str(one) for one in arguments[command]]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"jointplay {command}: error: ")
    assert error.count("\n") == 1
    assert said in error
    assert [one.name for one in tmp_path.iterdir()] == ["r.nc"]


@pytest.mark.parametrize("name", ["reaction_force", "moving_joint", "coordinate_unit"])
def test_results_of_ideal_runs_are_whole(name, ideal, tmp_path, capsys):
    path = rewritten(ideal, tmp_path / "r.nc", lambda d: d.drop_vars(name))
    assert main(["report", str(path), "--quiet"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "is damaged or not a result: it has no" in error


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_damaged_arrays_are_a_value_error_whatever_is_damaged(tmp_path, save):
    path = tmp_path / "arrays.npz"
    save(path, one=np.arange(40.0) / 7.0, other=np.zeros((5, 2), int))
    whole = path.read_bytes()
    assert set(files.arrays(path)) == {"one", "other"}
    wrong = set()
    for at in range(len(whole)):
        flip = (1, 8, 128)[at % 3]
        path.write_bytes(whole[:at] + bytes([whole[at] ^ flip]) + whole[at + 1 :])
        try:
            files.arrays(path)
        except (ValueError, OSError) as error:
            wrong.add(str(error)[:40])
    assert len(wrong) > 5
    with pytest.raises(OSError, match="No such file"):
        files.arrays(tmp_path / "none")


@pytest.mark.parametrize(
    ("start", "said"),
    [
        (b"#ROSBAG V2.0\n", "a bag of ROS 1; rosbags-convert"),
        (
            b"SQLite format 3\0\xff",
            "a database of SQLite, as bags of ROS 2 can be",
        ),
        (b"PK\x03\x04", "save the table as CSV"),
        (b"\xff\xfe", "UTF-16"),
    ],
)
def test_a_file_that_is_no_text_is_called_what_it_is(tmp_path, start, said):
    path = tmp_path / "a.csv"
    path.write_bytes(start + b"\xff\xbb\x00")
    with pytest.raises(JointplayError, match=re.escape(said)):
        files.read_text(path, "table")
