"""Stores of sweeps that are damaged or made by strangers: no wrong number, none of their code."""

import json
import os
import random
import re
import shutil
import threading
import tomllib
import zlib
from contextlib import contextmanager
from pathlib import Path

import google_crc32c
import numpy as np
import pytest
import xarray as xr
from numcodecs import Zstd
from sweep_scenario import SCENARIO

import jointplay as jp
from jointplay import JointplayError
from jointplay.study import plan_of, sealed
from jointplay.study import run as run_module
from jointplay.study.case import run_case
from jointplay.study.journal import Journal
from jointplay.study.store import Store

AXES = """
clearance = { key = "joints.joint_b.radial_clearance", values = ["0.1 mm", "1 nm", "0.2 mm"] }
mu = { key = "joints.joint_b.friction.mu_d", distribution = "uniform", from = 0.0, to = 0.1 }
rough = { variants = { no = {}, yes = { integration = { macro_step = "100 us" } } } }
"""
CASES = 12


class Here:
    """Cases are run in this process, and counted."""

    ran: list

    def __init__(self, job):
        self.job = job

    def run(self, cases):
        for key, case in cases:
            Here.ran.append(key)
            yield key, run_case(self.job, case)

    def close(self):
        pass


@pytest.fixture
def here(monkeypatch):
    Here.ran = []
    monkeypatch.setattr(run_module, "workers_for", lambda plan, *_: Here(run_module.job(plan)))
    return Here


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A scenario and its store: numbers, texts, histories, samples, and cases that failed."""
    folder = tmp_path_factory.mktemp("whole")
    path = folder / "study.toml"
    options = 'histories = ["tool_position"]\nsamples = 2'
    path.write_text(SCENARIO.format(axes=AXES, options=options, duration="2 ms"))
    with pytest.MonkeyPatch.context() as patched:
        Here.ran = []
        patched.setattr(run_module, "workers_for", lambda plan, *_: Here(run_module.job(plan)))
        jp.sweep(path, folder / "s")
    assert len(Here.ran) == CASES
    found = jp.open_sweep(folder / "s").load()
    assert set(np.unique(found["state"])) == {1, 2}
    return path, folder / "s", found


@contextmanager
def changed(path, content):
    before = path.read_bytes()
    path.write_bytes(content)
    try:
        yield
    finally:
        path.write_bytes(before)


def flipped(content, bit):
    data = bytearray(content)
    data[bit // 8] ^= 1 << bit % 8
    return bytes(data)


def kept(store):
    return [one for one in sorted(store.rglob("*")) if one.is_file() and one.stat().st_size]


def read(store):
    """All of a store, or the line that it is refused with."""
    try:
        return jp.open_sweep(store).load(), ""
    except JointplayError as error:
        return None, str(error)


def test_no_flipped_bit_of_a_store_gives_another_number(whole):
    """Each file in turn, at a random place; then at places anywhere, large files more often."""
    _, store, reference = whole
    rng = random.Random(5)
    files = kept(store)
    anywhere = rng.choices(files, [one.stat().st_size for one in files], k=30)
    refused = 0
    for path in [*files, *anywhere]:
        content = path.read_bytes()
        with changed(path, flipped(content, rng.randrange(8 * len(content)))):
            found, said = read(store)
        if found is not None:  # an array's own metadata: readers have those of the whole
            assert path.name == "zarr.json"
            xr.testing.assert_identical(found, reference)
            continue
        refused += 1
        assert re.fullmatch(
            r".* is damaged or not a sweep: .*; --resume (runs|writes) .*again", said
        )
        name, _, chunk = path.relative_to(store).as_posix().partition("/c/")
        if chunk:
            assert f"chunk {chunk.replace('/', '.')} of array {name!r}" in said
        else:
            assert "metadata of the whole" in said
    assert refused > 30


def test_a_file_of_a_store_copied_over_another_is_refused(whole):
    """Each chunk and each array's metadata in turn, which are whole and in the wrong place."""
    _, store, _ = whole
    chunks = [one for one in kept(store) if "/c/" in one.as_posix()]
    for path, other in zip(chunks, chunks[1:] + chunks[:1], strict=True):
        with changed(path, other.read_bytes()):
            found, said = read(store)
        assert found is None
        assert re.search(r"; --resume (runs|writes) .*again", said)
    same = [one for one in chunks if "tool_position_history/" in one.as_posix()]
    with changed(same[0], same[1].read_bytes()):
        assert "it was written in another place" in read(store)[1]
        key = same[0].relative_to(store).as_posix()
        assert list(sealed.survey(store)) == [("tool_position_history", key)]
    own = store / "peak_force" / "zarr.json"
    with changed(own, (store / "state" / "zarr.json").read_bytes()):
        assert list(sealed.survey(store)) == [("peak_force", None)]


def test_other_readers_of_zarr_pass_over_the_places_of_chunks(whole):
    _, store, reference = whole
    found = xr.open_zarr(store, zarr_format=3).load()
    np.testing.assert_array_equal(found["peak_force"], reference["peak_force"])


DAMAGES = {
    "peak_force/c/0/0/0": CASES,
    "tool_position_history/c/2/1/0/0/0": 1,
    "state/c/0/0/0": CASES,
    "error/c/0/0/0": CASES,
    "clearance/c/0": 0,
    "mu/c/0": 0,
    "rough/c/0": 0,
    "time/c/0": CASES,
    "zarr.json": 0,
    "peak_force/zarr.json": 0,
    "tool_position_history/zarr.json": 0,
    "state/zarr.json": 0,
    "axis/zarr.json": CASES,
}
"""Files of a store, and how many cases run again if they are damaged."""


@pytest.mark.parametrize(("name", "again"), DAMAGES.items())
def test_what_is_damaged_runs_again_and_gives_what_it_was(name, again, whole, here, tmp_path):
    path, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    hurt = tmp_path / "s" / name
    content = hurt.read_bytes()
    at = content.find(b'"shape"') + 2 if b'"shape"' in content else len(content) // 2
    hurt.write_bytes(flipped(content, 8 * at))
    jp.sweep(path, tmp_path / "s", resume=True)
    assert len(here.ran) == again
    found = jp.open_sweep(tmp_path / "s").load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))
    assert not list(sealed.survey(tmp_path / "s"))


@pytest.mark.parametrize(("name", "again"), [item for item in DAMAGES.items() if "/c/" in item[0]])
def test_a_chunk_that_is_gone_is_missed_and_its_cases_run_again(name, again, whole, here, tmp_path):
    path, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    (tmp_path / "s" / name).unlink()
    _, said = read(tmp_path / "s")
    array, _, chunk = name.partition("/c/")
    place = f"chunk {chunk.replace('/', '.')} of array {array!r}: it is gone; --resume"
    assert place in said, said
    jp.sweep(path, tmp_path / "s", resume=True)
    assert len(here.ran) == again
    found = jp.open_sweep(tmp_path / "s").load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


def test_an_array_that_is_gone_is_missed(whole, here, tmp_path):
    path, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    shutil.rmtree(tmp_path / "s" / "peak_force")
    assert "of array 'peak_force': it is gone; --resume runs" in read(tmp_path / "s")[1]
    jp.sweep(path, tmp_path / "s", resume=True)
    assert len(here.ran) == CASES
    found = jp.open_sweep(tmp_path / "s").load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


def crc(content):
    return content + google_crc32c.value(content).to_bytes(4, "little")


def unsized(content):
    """A frame of Zstandard that does not say its size: one block, stored."""
    head = sealed._ZSTD + b"\x00\x58" + (len(content) << 3 | 1).to_bytes(3, "little")
    return crc(head + content)


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("peak_force", crc(Zstd().encode(bytes(1 << 28))), "it unpacks to 268435456 bytes, not to"),
        ("peak_force", crc(Zstd().encode(bytes(8))), "it unpacks to 8 bytes, not to"),
        ("peak_force", unsized(bytes(96)), "its uncompressed size is missing"),
        ("peak_force", crc(bytes(100)), "its uncompressed size is missing"),
        ("error", crc(Zstd().encode(bytes(1 << 28))), "it unpacks to 268435456 bytes, more than"),
    ],
)
def test_a_chunk_of_another_size_is_not_unpacked(name, content, reason, whole):
    _, store, _ = whole
    with changed(store / name / "c/0/0/0", content):
        _, said = read(store)
    assert f"chunk 0.0.0 of array {name!r}: {reason}" in said


def test_several_damages_run_their_cases_again_together(whole, here, tmp_path):
    path, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    for name in ("tool_position_history/c/0/0/0/0/0", "tool_position_history/c/2/1/1/0/0",
                 "clearance/c/0", "zarr.json"):  # fmt: skip
        hurt = tmp_path / "s" / name
        hurt.write_bytes(flipped(hurt.read_bytes(), 80))
    jp.sweep(path, tmp_path / "s", resume=True)
    assert here.ran == [(0, 0, 0), (2, 1, 1)]
    found = jp.open_sweep(tmp_path / "s").load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


@pytest.mark.parametrize("stop", range(6))
def test_killed_while_it_mends_a_store_it_mends_it_the_next_time(
    stop, whole, here, tmp_path, monkeypatch
):
    """Whatever of the disk it had come to: the stop-th file that it deletes or replaces."""
    path, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    for name in ("tool_position_history/c/0/0/0/0/0", "error/c/0/0/0", "peak_force/c/0/0/0"):
        hurt = tmp_path / "s" / name
        hurt.write_bytes(flipped(hurt.read_bytes(), 80))
    count = 0

    def counted(function):
        def call(*arguments, **options):
            nonlocal count
            count += threading.current_thread() is threading.main_thread()  # zarr has others
            if count > stop:
                raise KeyboardInterrupt
            return function(*arguments, **options)

        return call

    with monkeypatch.context() as patched:
        patched.setattr(os, "sync", counted(os.sync))
        patched.setattr(Path, "unlink", counted(Path.unlink))
        with pytest.raises(KeyboardInterrupt):
            Store(tmp_path / "s", plan_of(path), resume=True)
    jp.sweep(path, tmp_path / "s", resume=True)
    found = jp.open_sweep(tmp_path / "s").load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


def test_cases_of_the_journal_that_are_damaged_elsewhere_run_again(whole, here, tmp_path):
    """Their histories are not in the journal."""
    path, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    journal = Journal(tmp_path / "s" / "journal")
    for index in np.ndindex(3, 2, 2):
        at = dict(zip(reference["state"].dims, index, strict=True))
        values = {
            str(name): float(reference[name][at])
            for name in reference.data_vars
            if reference[name].dtype.kind == "f" and reference[name].ndim == 3
        }
        state, text = int(reference["state"][at]), str(reference["error"][at].values)
        journal.add({"i": list(index), "s": state, "v": values, "e": text})
    journal.close()
    hurt = tmp_path / "s" / "tool_position_history/c/0/0/0/0/0"
    hurt.write_bytes(flipped(hurt.read_bytes(), 80))
    Store(tmp_path / "s", plan_of(path), resume=True).close(whole=False)  # and is killed then
    jp.sweep(path, tmp_path / "s", resume=True)
    assert here.ran == [(0, 0, 0)]
    found = jp.open_sweep(tmp_path / "s").load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


def test_a_changed_line_of_a_journal_costs_its_case_alone(tmp_path):
    journal = Journal(tmp_path / "j")
    for k in range(4):
        journal.add({"i": [k]})
    journal.close()
    content = (tmp_path / "j").read_bytes()
    (tmp_path / "j").write_bytes(flipped(content, 8 * content.find(b"[1]") + 8))
    again = Journal(tmp_path / "j")
    assert [entry["i"] for entry in again.found] == [[0], [2], [3]]
    again.close()
    with (tmp_path / "other").open("w") as other:  # with the number that the journal had
        again.close()
        other.write("x")


def test_a_damaged_store_is_not_taken_for_that_of_another_sweep(whole, here, tmp_path):
    path, store, _ = whole
    shutil.copytree(store, tmp_path / "s")
    root = tmp_path / "s" / "zarr.json"
    root.write_bytes(flipped(root.read_bytes(), 800))
    other = tmp_path / "other.toml"
    other.write_text(path.read_text().replace('"2 ms"', '"1 ms"'))
    with pytest.raises(JointplayError, match="states belong to this sweep"):
        jp.sweep(other, tmp_path / "s", resume=True)
    assert here.ran == []


def test_a_sweep_that_doubled_its_samples_goes_on_from_damaged_metadata(here, tmp_path):
    path = tmp_path / "study.toml"
    options = (
        'samples = 2\nuntil = { measure = "peak_force", statistic = "mean", precision = 1e-9, '
        "most = 8 }"
    )
    axes = (
        'cr = { key = "joints.joint_b.radial_clearance", distribution = "uniform", '
        'from = "0.1 mm", to = "0.3 mm" }'
    )
    path.write_text(SCENARIO.format(axes=axes, options=options, duration="2 ms"))
    first = jp.sweep(path, tmp_path / "s").load()
    assert first.sizes["sample"] == 8
    root = tmp_path / "s" / "zarr.json"
    root.write_bytes(flipped(root.read_bytes(), 800))
    here.ran.clear()
    xr.testing.assert_identical(jp.sweep(path, tmp_path / "s", resume=True).load(), first)
    assert here.ran == []


def array_of_zarr_2(array):
    array["zarr_format"] = 2


def pickled(array):
    """What numcodecs 0.16.5 ran."""
    array.clear()
    array |= {
        "zarr_format": 2, "node_type": "array", "shape": [3, 2, 2], "chunks": [3, 2, 2],
        "dtype": "|O", "fill_value": None, "order": "C", "compressor": None,
        "filters": [{"id": "pickle"}], "attributes": {}, "dimension_names": ["a", "b", "c"],
    }  # fmt: skip


def with_numcodecs(array):
    array["codecs"].insert(0, {"name": "numcodecs.pickle", "configuration": {}})


def another_compressor(array):
    array["codecs"][1] = {"name": "blosc", "configuration": {}}


def without_checksum(array):
    array["codecs"].pop()


def configured_otherwise(array):
    array["codecs"][1]["configuration"]["level"] = {"a": 1}


def with_shards(array):
    array["codecs"] = [{"name": "sharding_indexed", "configuration": {"codecs": array["codecs"]}}]


def with_transformers(array):
    array["storage_transformers"] = [{"name": "x"}]


def with_more(array):
    array["more"] = {"must_understand": False}


def of_objects(array):
    array["data_type"] = {"name": "null_terminated_bytes", "configuration": {"length_bytes": 8}}


def elsewhere(array):
    array["chunk_key_encoding"] = {"name": "default", "configuration": {"separator": "../"}}


def gridded_otherwise(array):
    array["chunk_grid"] = {"name": "rectangular", "configuration": {"chunk_shape": [3, 2, 2]}}


def in_immense_chunks(array):
    array["chunk_grid"]["configuration"]["chunk_shape"] = [10**6, 10**6, 2]


def negative(array):
    array["shape"][0] = -1


def scaled(array):
    array["attributes"]["scale_factor"] = "2"


STRANGE = {
    array_of_zarr_2: "zarr_format is 2, not 3",
    pickled: "zarr_format is 2, not 3",
    with_numcodecs: r"its codecs \(numcodecs.pickle, bytes, zstd, crc32c\) are not ours",
    another_compressor: r"its codecs \(bytes, blosc, crc32c\) are not ours",
    without_checksum: r"its codecs \(bytes, zstd\) are not ours \(bytes, zstd, crc32c\)",
    configured_otherwise: "are not ours",
    with_shards: "are not ours",
    with_transformers: "storage_transformers is",
    with_more: "unknown keys: more",
    of_objects: "the type .* is none of",
    elsewhere: "chunk_key_encoding is",
    gridded_otherwise: "chunk_grid is .*, not .*'regular'",
    in_immense_chunks: "are larger than",
    negative: "the shape",
    scaled: "the attributes",
}


@pytest.mark.parametrize("edit", STRANGE, ids=lambda edit: edit.__name__)
def test_metadata_that_are_not_ours_are_refused_before_zarr_sees_them(
    edit, whole, tmp_path, monkeypatch
):
    """In the metadata of the whole, and in an array's own; sealed as we seal them."""
    _, store, _ = whole
    shutil.copytree(store, tmp_path / "s")
    root = tmp_path / "s" / "zarr.json"
    found = json.loads(root.read_bytes())
    edit(found["consolidated_metadata"]["metadata"]["peak_force"])
    root.write_bytes(sealed.write_metadata(found, sealed.ROOT))
    monkeypatch.setattr("zarr.core.group.GroupMetadata.from_dict", lambda *_: pytest.fail("seen"))
    with pytest.raises(JointplayError, match=f"array 'peak_force': .*{STRANGE[edit]}") as error:
        jp.open_sweep(tmp_path / "s")
    assert "\n" not in str(error.value)
    shutil.copy(store / "zarr.json", root)
    own = tmp_path / "s" / "peak_force" / "zarr.json"
    found = json.loads(own.read_bytes())
    edit(found)
    own.write_bytes(sealed.write_metadata(found, "peak_force"))
    assert ("peak_force", None) in list(sealed.survey(tmp_path / "s"))


@pytest.mark.parametrize("name", ["../x", "a/b", ".hidden", ""])
def test_arrays_have_plain_names(name, whole, tmp_path):
    shutil.copytree(whole[1], tmp_path / "s")
    root = tmp_path / "s" / "zarr.json"
    found = json.loads(root.read_bytes())
    arrays = found["consolidated_metadata"]["metadata"]
    arrays[name] = arrays["peak_force"]
    root.write_bytes(sealed.write_metadata(found, sealed.ROOT))
    with pytest.raises(JointplayError, match="an array is called"):
        jp.open_sweep(tmp_path / "s")


def test_a_store_of_zarr_2_is_no_sweep(whole, tmp_path):
    shutil.copytree(whole[1], tmp_path / "s")
    (tmp_path / "s" / ".zgroup").write_text('{"zarr_format": 2}')
    (tmp_path / "s" / ".zattrs").write_text('{"units": "wrong"}')
    (tmp_path / "s" / "peak_force" / ".zarray").write_text('{"zarr_format": 2}')
    xr.testing.assert_identical(jp.open_sweep(tmp_path / "s").load(), whole[2])  # passed over
    (tmp_path / "s" / "zarr.json").unlink()
    with pytest.raises(JointplayError, match="no sweep"):
        jp.open_sweep(tmp_path / "s")


@pytest.mark.parametrize("way", ["link", "link to a folder", "pipe", "folder"])
def test_a_chunk_is_a_file_of_the_store_or_it_is_not_read(way, whole, tmp_path):
    shutil.copytree(whole[1], tmp_path / "s")
    chunk = tmp_path / "s" / "peak_force" / "c" / "0" / "0" / "0"
    secret = tmp_path / "secret"
    if way == "link to a folder":
        chunk.parent.rename(secret)
        chunk.parent.symlink_to(secret)
    else:
        chunk.rename(secret)
    if way == "link":
        chunk.symlink_to(secret)
    elif way == "pipe":
        os.mkfifo(chunk)
    elif way == "folder":
        chunk.mkdir()
    with pytest.raises(JointplayError, match=r"chunk 0.0.0 of array 'peak_force': no file of"):
        jp.open_sweep(tmp_path / "s").load()


def test_a_numcodecs_that_runs_no_pickles_is_required():
    from importlib.metadata import version

    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    assert "numcodecs>=0.16.6" in project["project"]["dependencies"]
    assert tuple(map(int, version("numcodecs").split(".")[:3])) >= (0, 16, 6)


@pytest.mark.parametrize("stop", range(4))
def test_labels_of_histories_that_found_no_room_are_written_the_next_time(
    stop, here, tmp_path, monkeypatch
):
    """The second case is longer; the disk is full at the stop-th thing that is written of time."""
    from jointplay.study.sealed import SealedStore

    path = tmp_path / "study.toml"
    axes = 't = { key = "integration.duration", values = ["1 ms", "2 ms"] }'
    path.write_text(
        SCENARIO.format(axes=axes, options='histories = ["tool_position"]', duration="1 ms")
    )
    reference = jp.sweep(path, tmp_path / "whole").load()
    count, put = 0, SealedStore.set

    async def full(self, key, value):
        nonlocal count
        count += key.startswith("time/")
        if count > stop + 1:  # the first case writes two
            raise OSError(28, "No space left on device")
        await put(self, key, value)

    with monkeypatch.context() as patched:
        patched.setattr(SealedStore, "set", full)
        with pytest.raises(JointplayError, match="No space left on device"):
            jp.sweep(path, tmp_path / "s")
    found = jp.sweep(path, tmp_path / "s", resume=True).load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


OTHERS = [
    None, [], {"i": [0.5, 0, 0]}, {"i": [99, 99, 99]}, {"i": [0, 0]}, {"i": [-1, 0, 0]},
    {"i": [True, 0, 0]}, {"i": [0, 0, 0], "s": 3}, {"s": True}, {"s": "1"},
    {"v": {"state": 0.5}}, {"v": {"clearance": 0.5}}, {"v": {"tool_position_history": 0.5}},
    {"v": {"peak_force": "much"}}, {"v": {"peak_force": 10**400}}, {"v": [1.0]}, {"e": 1}, {"x": 1},
]  # fmt: skip


@pytest.mark.parametrize("other", OTHERS, ids=repr)
def test_lines_of_a_journal_that_are_no_cases_are_as_good_as_changed(other, whole, tmp_path):
    """Their checksums are right: a stranger can reckon them too."""
    path, store, before = whole
    shutil.copytree(store, tmp_path / "s")
    journal = Journal(tmp_path / "s" / "journal")
    good = {"i": [0, 0, 0], "s": 1, "v": {"peak_force": 1.0}}
    journal.add(good | other if isinstance(other, dict) else other)
    journal.add({"i": [0, 1, 0], "s": 1, "v": {"peak_force": 7.0}})
    journal.close()
    Store(tmp_path / "s", plan_of(path), resume=True).close()
    found = jp.open_sweep(tmp_path / "s").load()
    assert found["peak_force"].values[0, 1, 0] == 7.0
    found["peak_force"].values[0, 1, 0] = before["peak_force"].values[0, 1, 0]
    xr.testing.assert_identical(found, before)


def test_lines_of_a_journal_that_are_no_text_are_passed_over(tmp_path):
    lines = [b"no json", b"[" * 100_000, b'{"i":[1]}']
    content = b"".join(b"%08x %s\n" % (zlib.crc32(text), text) for text in lines)
    (tmp_path / "j").write_bytes(content)
    assert Journal(tmp_path / "j").found == [None, None, {"i": [1]}]
