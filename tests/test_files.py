"""Files that are whole or not there, and results that are what was written."""

import errno
import json
import os
import subprocess
import sys

import pytest
import xarray as xr

import jointplay as jp
from jointplay import JointplayError, codec
from jointplay.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS, KelvinVoigt
from jointplay.host import files
from jointplay.joints import Clearance
from jointplay.result import netcdf
from jointplay.study import scara


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
    with pytest.raises(JointplayError, match="exists; choose another name"):
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
    code = "import sys; from jointplay import files; files.claim(sys.argv[1], ['r.nc'])"
    other = [sys.executable, "-c", code, str(tmp_path / "o")]
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


def test_files_without_checksum_still_load(result, tmp_path):
    """Those of earlier versions, and of other programs."""
    path = tmp_path / "old.nc"
    result.dataset.to_netcdf(path, engine="h5netcdf")
    assert jp.Result.load(path).audit == result.audit


def test_a_file_without_checksum_that_hangs_its_reader_does_not_hang_us(
    result, tmp_path, monkeypatch
):
    path = tmp_path / "old.nc"
    result.dataset.to_netcdf(path, engine="h5netcdf")
    monkeypatch.setattr(netcdf, "_GUARD", "import time; time.sleep(1e6)")
    monkeypatch.setattr(netcdf, "GUARD_S", 0.1)
    with pytest.raises(JointplayError, match="reading it did not end within"):
        jp.Result.load(path)
    monkeypatch.setattr(netcdf, "_GUARD", "import os; os.abort()")
    monkeypatch.setattr(netcdf, "GUARD_S", 900.0)
    with pytest.raises(JointplayError, match="the reader crashed"):
        jp.Result.load(path)


def test_a_result_larger_than_the_memory_is_refused(saved, monkeypatch):
    monkeypatch.setattr(netcdf, "memory", lambda: 1e3)
    with pytest.raises(JointplayError, match=r"more than the .* GB that this machine has"):
        jp.Result.load(saved)


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
}


@pytest.mark.parametrize("edit", EDITS.values(), ids=EDITS)
def test_attributes_that_no_run_wrote_are_refused_on_load(edit, result, tmp_path):
    dataset = result.dataset.copy(deep=True)
    edit(dataset)
    path = files.write(tmp_path / "r.nc", netcdf.pack(dataset))
    with pytest.raises(JointplayError, match="is damaged or not a result") as caught:
        jp.Result.load(path)
    assert "\n" not in str(caught.value)


def _paths(content, path=()):
    if isinstance(content, dict):
        for key, value in content.items():
            yield from _paths(value, (*path, key))
    else:
        yield path


def test_every_input_of_another_kind_is_refused_on_load_or_when_built(result, tmp_path):
    given = json.loads(result.dataset.attrs["simulation"])
    for path in _paths(given):
        content = json.loads(result.dataset.attrs["simulation"])
        table = content
        for key in path[:-1]:
            table = table[key]
        table[path[-1]] = {"no": ["one", "asked"]}
        dataset = result.dataset.copy()
        dataset.attrs["simulation"] = json.dumps(content)
        file = files.write(tmp_path / "r.nc", netcdf.pack(dataset), overwrite=True)
        with pytest.raises(JointplayError):
            jp.Result.load(file).simulation.prepare()


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
        assert codec.read(Clearance, json.loads(json.dumps(joint.describe()))) == joint
        assert eval(repr(joint), vars(jp) | vars(jp.contact) | vars(jp.joints)) == joint
