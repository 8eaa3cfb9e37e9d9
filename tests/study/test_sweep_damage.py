"""Stores of sweeps that are damaged or made by strangers: no wrong number, none of their code."""

import copy
import json
import os
import random
import re
import shutil
import threading
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import xarray as xr
from numcodecs import Zstd
from sweep_scenario import SCENARIO

import jointplay as jp
from jointplay import JointplayError
from jointplay.study import journal, plan_of, sealed, sweeps
from jointplay.study import store as store_module
from jointplay.study.case import run_case
from jointplay.study.journal import DONE, History, Journal, Outcome, line
from jointplay.study.store import SweepStore

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
    monkeypatch.setattr(sweeps, "workers_for", lambda plan, *_: Here(sweeps.job(plan)))
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
        patched.setattr(sweeps, "workers_for", lambda plan, *_: Here(sweeps.job(plan)))
        patched.setattr(store_module, "CHUNK", 4)  # so that there are several
        patched.setattr(store_module, "HISTORY_CHUNK", 2 * 21 * 3)
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


def damaged(whole, folder, *names, at=None):
    """A copy of the store with a bit flipped in each of these files."""
    shutil.copytree(whole[1], folder / "s")
    for name in names:
        hurt = folder / "s" / name
        content = hurt.read_bytes()
        middle = content.find(b'"shape"') + 2 if b'"shape"' in content else len(content) // 2
        hurt.write_bytes(flipped(content, 8 * middle if at is None else at))
    return folder / "s"


def mended(whole, store):
    """Go on with the sweep: all is as it was."""
    path, _, reference = whole
    found = jp.sweep(path, store, resume=True).load()
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))
    assert not survey(store)


def number(store):
    return sealed.Contents.read(store).store


def survey(store):
    return list(sealed.Contents.read(store).survey())


def resealed(path, found):
    """Metadata of the whole as we seal them."""
    found["attributes"].pop("seal", None)
    mark = sealed.seal(found["attributes"]["store"], "zarr.json", sealed.encoded(found)).hex()
    found["attributes"]["seal"] = mark
    path.write_text(json.dumps(found))


def kept(store):
    return [one for one in sorted(store.rglob("*")) if one.is_file() and one.stat().st_size]


def read(store):
    """All of a store, or the line that it is refused with."""
    try:
        return jp.open_sweep(store).load(), ""
    except JointplayError as error:
        return None, str(error)


def test_no_flipped_bit_of_a_store_gives_another_number(whole):
    """Of files, at a random place; then at places anywhere, large files more often."""
    _, store, reference = whole
    rng = random.Random(5)
    files = kept(store)
    anywhere = rng.choices(files, [one.stat().st_size for one in files], k=10)
    refused = 0
    for path in [*rng.sample(files, 12), *anywhere]:
        content = path.read_bytes()
        with changed(path, flipped(content, rng.randrange(8 * len(content)))):
            found, said = read(store)
        if found is not None:  # an array's own metadata, or the copy: readers have another
            assert path.name == "copy.json" or path.relative_to(store).parts[1:] == ("zarr.json",)
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
    assert refused > 10


def test_a_chunk_copied_over_another_is_refused(whole):
    """Which are whole and in the wrong place."""
    _, store, _ = whole
    chunks = [one for one in kept(store) if "/c/" in one.as_posix()]
    chunks = random.Random(6).sample(chunks, 8)
    for path, other in zip(chunks, chunks[1:] + chunks[:1], strict=True):
        with changed(path, other.read_bytes()):
            found, said = read(store)
            name, _, chunk = path.relative_to(store).as_posix().partition("/c/")
            assert survey(store) == [(name, chunk)]
        assert found is None
        assert re.search(r"; --resume (runs|writes) .*again", said)
        assert "or written elsewhere" in said


def test_a_chunk_of_another_store_is_refused(whole, tmp_path):
    """Of the same sweep, array and place; and so is the metadata of that store over its chunks."""
    store = damaged(whole, tmp_path)
    other = SweepStore(tmp_path / "other", plan_of(whole[0]))
    other.keep((0, 0, 0), Outcome((0, 0, 0), DONE, {"peak_force": 7.0}))
    other.close()
    name = "peak_force/c/0/0/0"
    with changed(store / name, (tmp_path / "other" / name).read_bytes()):
        assert survey(store) == [("peak_force", "0/0/0")]
        assert "chunk 0.0.0 of array 'peak_force': does not match" in read(store)[1]
    with changed(store / "zarr.json", (tmp_path / "other/zarr.json").read_bytes()):
        assert "does not match" in read(store)[1]


DAMAGES = {
    "peak_force/c/2/0/0": 4,
    "tool_position_history/c/2/1/0/0/0": 2,
    "state/c/0/0/0": 4,
    "error/c/1/0/0": 4,
    "clearance/c/0": 0,
    "mu/c/0": 0,
    "rough/c/0": 0,
    "time/c/0": CASES,
    "zarr.json": 0,
    "copy.json": 0,
    "peak_force/zarr.json": 0,
    "state/zarr.json": 0,
    "axis/zarr.json": 0,
}
"""Files of a store, and how many cases run again if they are damaged."""


@pytest.mark.parametrize(("name", "again"), DAMAGES.items())
def test_what_is_damaged_runs_again_and_gives_what_it_was(name, again, whole, here, tmp_path):
    store = damaged(whole, tmp_path, name)
    mended(whole, store)
    assert len(here.ran) == again
    if "/c/" not in name:
        assert (store / name).read_bytes() == (whole[1] / name).read_bytes()


@pytest.mark.parametrize(
    ("name", "again"),
    [*((name, DAMAGES[name]) for name in ("state/c/0/0/0", "mu/c/0", "time/c/0")),
     ("tool_position_history/c/2/1/0/0/0", 2), ("peak_force", 8)],  # the others failed
)  # fmt: skip
def test_what_is_gone_is_missed_and_its_cases_run_again(name, again, whole, here, tmp_path):
    store = damaged(whole, tmp_path)
    (shutil.rmtree if name == "peak_force" else Path.unlink)(store / name)
    array, _, chunk = name.partition("/c/")
    place = f"chunk {chunk.replace('/', '.')} " if chunk else ""
    assert f"{place}of array {array!r}: it is gone; --resume" in read(store)[1]
    mended(whole, store)
    assert len(here.ran) == again


def unsized(content):
    """A frame of Zstandard that does not say its size: one block, stored."""
    return sealed._ZSTD + b"\x00\x58" + (len(content) << 3 | 1).to_bytes(3, "little") + content


@pytest.mark.parametrize(
    ("name", "content", "reason"),
    [
        ("peak_force", Zstd().encode(bytes(1 << 28)), "it unpacks to 268435456 bytes, not to"),
        ("peak_force", Zstd().encode(bytes(8)), "it unpacks to 8 bytes, not to"),
        ("peak_force", unsized(bytes(96)), "its uncompressed size is missing"),
        ("peak_force", bytes(100), "its uncompressed size is missing"),
        ("error", Zstd().encode(bytes(1 << 28)), "it unpacks to 268435456 bytes, more than"),
    ],
)
def test_a_chunk_of_another_size_is_not_unpacked(name, content, reason, whole):
    """Sealed as we seal it."""
    _, store, _ = whole
    chunk = "1/0/0" if name == "error" else "2/0/0"
    key = f"{name}/c/{chunk}"
    seal = sealed._SKIPPED + sealed.seal(number(store), key, content)
    with changed(store / key, content + seal):
        _, said = read(store)
    assert f"chunk {chunk.replace('/', '.')} of array {name!r}: {reason}" in said


def test_several_damages_run_their_cases_again_together(whole, here, tmp_path):
    store = damaged(
        whole, tmp_path, "tool_position_history/c/0/0/0/0/0", "tool_position_history/c/2/1/0/0/0",
        "clearance/c/0", "zarr.json", at=80,
    )  # fmt: skip
    mended(whole, store)
    assert here.ran == [(0, 0, 0), (0, 0, 1), (2, 1, 0), (2, 1, 1)]


@pytest.mark.thorough
@pytest.mark.parametrize("stop", range(6))
def test_killed_while_it_mends_a_store_it_mends_it_the_next_time(
    stop, whole, here, tmp_path, monkeypatch
):
    """Whatever of the disk it had come to: the stop-th file that it deletes or replaces."""
    names = ("tool_position_history/c/0/0/0/0/0", "error/c/1/0/0", "peak_force/c/2/0/0")
    store = damaged(whole, tmp_path, *names, at=80)
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
            SweepStore(store, plan_of(whole[0]), resume=True)
    mended(whole, store)


def test_what_is_damaged_and_in_the_journal_is_filled_in_again(whole, here, tmp_path):
    """Measures and histories."""
    path, _, reference = whole
    names = ("tool_position_history/c/0/0/0/0/0", "tool_position_history/c/2/0/0/0/0")
    store = damaged(whole, tmp_path, *names, at=80)
    lines = Journal(store / "journal", number(store))
    for index in [(0, 0, 0), (0, 0, 1)]:
        at = dict(zip(reference["state"].dims, index, strict=True))
        values = {
            str(name): float(reference[name][at])
            for name in reference.data_vars
            if reference[name].dtype.kind == "f" and reference[name].ndim == 3
        }
        kept = {"tool_position": History.of(reference["tool_position_history"][at])}
        lines.add(Outcome(index, DONE, values, "", kept).entry)
    lines.close()
    SweepStore(store, plan_of(path), resume=True).close(whole=False)  # and is killed then
    mended(whole, store)
    assert here.ran == [(2, 0, 0), (2, 0, 1)]


def test_a_changed_line_of_a_journal_costs_its_case_alone(tmp_path):
    lines = Journal(tmp_path / "j", "0")
    for k in range(4):
        lines.add({"i": [k]})
    lines.close()
    content = (tmp_path / "j").read_bytes()
    (tmp_path / "j").write_bytes(flipped(content, 8 * content.find(b"[1]") + 8))
    again = Journal(tmp_path / "j", "0")
    assert [entry["i"] for entry in again.found] == [[0], [2], [3]]
    again.close()
    with (tmp_path / "other").open("w") as other:  # with the number that the journal had
        again.close()
        other.write("x")


def test_a_damaged_store_is_not_taken_for_that_of_another_sweep(whole, here, tmp_path):
    other, store = tmp_path / "other.toml", damaged(whole, tmp_path)
    other.write_text(whole[0].read_text().replace('"2 ms"', '"1 ms"'))
    for name, said in {"zarr.json": "belongs to another", "copy.json": "so has their copy"}.items():
        (store / name).write_bytes(flipped((store / name).read_bytes(), 800))
        with pytest.raises(JointplayError, match=said):
            jp.sweep(other, store, resume=True)
    assert here.ran == []


def test_a_sweep_that_doubled_its_samples_goes_on_from_damaged_metadata(here, tmp_path):
    path, store = tmp_path / "study.toml", tmp_path / "s"
    until = '{ measure = "peak_force", statistic = "mean", precision = 1e-9, most = 8 }'
    axes = (
        'cr = { key = "joints.joint_b.radial_clearance", distribution = "uniform", '
        'from = "0.1 mm", to = "0.3 mm" }'
    )
    options = f"samples = 2\nuntil = {until}"
    path.write_text(SCENARIO.format(axes=axes, options=options, duration="2 ms"))
    first = jp.sweep(path, store).load()
    assert first.sizes["sample"] == 8
    (store / "zarr.json").write_bytes(flipped((store / "zarr.json").read_bytes(), 800))
    here.ran.clear()
    xr.testing.assert_identical(jp.sweep(path, store, resume=True).load(), first)
    assert here.ran == []


ZARR_2 = {
    "zarr_format": 2, "node_type": "array", "shape": [3, 2, 2], "chunks": [3, 2, 2], "dtype": "|O",
    "fill_value": None, "order": "C", "compressor": None, "filters": [{"id": "pickle"}],
    "attributes": {}, "dimension_names": ["a", "b", "c"],
}  # fmt: skip
"""What numcodecs 0.16.5 ran."""
STRANGE = [
    ((), ZARR_2, "no metadata of an array"),
    (("zarr_format",), 2, "unlike ours, zarr_format 2"),
    (("codecs", 0), {"name": "numcodecs.pickle", "configuration": {}}, "codecs .*numcodecs.pickle"),
    (("codecs", 1), {"name": "blosc", "configuration": {}}, "unlike ours, codecs .*blosc"),
    (("codecs", 1, "configuration", "level"), {"a": 1}, "unlike ours, codecs"),
    (("codecs",), [{"name": "sharding_indexed", "configuration": {}}], "codecs .*sharding_indexed"),
    (("storage_transformers",), [{"name": "x"}], "unlike ours, storage_transformers"),
    (("more",), {"must_understand": False}, "unlike ours, more"),
    (("data_type",), {"name": "null_terminated_bytes"}, "no metadata of an array"),
    (("data_type",), "object", "the type 'object' is none of"),
    (("chunk_key_encoding", "configuration", "separator"), "../", "ours, chunk_key_encoding"),
    (("chunk_grid", "name"), "rectangular", "unlike ours, chunk_grid .*rectangular"),
    (("chunk_grid", "configuration", "chunk_shape"), [10**6, 10**6, 2], "are larger than"),
    (("shape", 0), -1, "the shape"),
    (("attributes", "scale_factor"), "2", "the dimensions .*scale_factor"),
]  # fmt: skip


def edited(array, keys, value):
    """Metadata of an array with another value at these keys."""
    if not keys:
        return value
    array = copy.deepcopy(array)
    here = array
    for key in keys[:-1]:
        here = here[key]
    here[keys[-1]] = value
    return array


@pytest.mark.parametrize(("keys", "value", "said"), STRANGE, ids=repr)
def test_metadata_that_are_not_ours_are_refused_before_zarr_sees_them(
    keys, value, said, whole, tmp_path, monkeypatch
):
    """In the metadata of the whole, sealed as we seal them; an array's own are not looked at."""
    _, store, reference = whole
    shutil.copytree(store, tmp_path / "s")
    root = tmp_path / "s" / "zarr.json"
    found = json.loads(root.read_bytes())
    arrays = found["consolidated_metadata"]["metadata"]
    arrays["peak_force"] = edited(arrays["peak_force"], keys, value)
    resealed(root, found)
    with monkeypatch.context() as patched:
        patched.setattr("zarr.core.group.GroupMetadata.from_dict", lambda *_: pytest.fail("seen"))
        with pytest.raises(JointplayError, match=f"array 'peak_force': .*{said}") as error:
            jp.open_sweep(tmp_path / "s")
    assert "\n" not in str(error.value)
    shutil.copy(store / "zarr.json", root)
    own = tmp_path / "s" / "peak_force" / "zarr.json"
    own.write_text(json.dumps(edited(json.loads(own.read_bytes()), keys, value)))
    xr.testing.assert_identical(jp.open_sweep(tmp_path / "s").load(), reference)


@pytest.mark.parametrize("name", ["../x", "a/b", ".hidden", ""])
def test_arrays_have_plain_names(name, whole, tmp_path):
    shutil.copytree(whole[1], tmp_path / "s")
    root = tmp_path / "s" / "zarr.json"
    found = json.loads(root.read_bytes())
    arrays = found["consolidated_metadata"]["metadata"]
    arrays[name] = arrays["peak_force"]
    resealed(root, found)
    with pytest.raises(JointplayError, match="an array is called"):
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


@pytest.mark.thorough
@pytest.mark.parametrize("stop", range(0, 12, 2))
def test_a_full_disk_at_any_write_of_the_arrays_loses_nothing(stop, here, tmp_path, monkeypatch):
    """The second case is longer; the disk is full at a file, and nothing is written after it."""
    path = tmp_path / "study.toml"
    axes = 't = { key = "integration.duration", values = ["1 ms", "2 ms"] }'
    path.write_text(
        SCENARIO.format(axes=axes, options='histories = ["tool_position"]', duration="1 ms")
    )
    reference = jp.sweep(path, tmp_path / "whole").load()
    count, write_whole = 0, sealed.write_whole
    with monkeypatch.context() as patched:
        patched.setattr(store_module, "FLUSH_S", 0.0)  # after each case

        def full(path, content):
            nonlocal count
            count += 1
            if count > 8 * stop:
                raise OSError(28, "No space left on device")
            write_whole(path, content)

        patched.setattr(sealed, "write_whole", full)
        with pytest.raises(JointplayError, match="No space left on device"):
            jp.sweep(path, tmp_path / "s")
    ran = len(here.ran)
    found = jp.sweep(path, tmp_path / "s", resume=True).load()
    assert len(here.ran) - ran < 2 or stop < 2
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


def test_a_long_journal_is_emptied_when_the_arrays_have_it(here, tmp_path, monkeypatch, whole):
    path, _, reference = whole
    monkeypatch.setattr(store_module, "FLUSH_BYTES", 4000)
    sizes, add = [], Journal.add
    monkeypatch.setattr(Journal, "add", lambda s, e: (add(s, e), sizes.append(s.size))[0])
    found = jp.sweep(path, tmp_path / "s").load()
    assert max(sizes) < 8000 < sum(np.diff(sizes, prepend=0).clip(min=0))
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


OTHERS = [
    None, [], {"i": [0.5, 0, 0]}, {"i": [99, 99, 99]}, {"i": [0, 0]}, {"i": [-1, 0, 0]},
    {"i": [True, 0, 0]}, {"i": [0, 0, 0], "s": 3}, {"s": True}, {"s": "1"},
    {"v": {"state": 0.5}}, {"v": {"clearance": 0.5}}, {"v": {"tool_position_history": 0.5}},
    {"v": {"peak_force": "much"}}, {"v": {"peak_force": 10**400}}, {"v": [1.0]}, {"e": 1}, {"x": 1},
    {"h": []}, {"h": {"tool_position": 1}}, {"h": {"tool_position": [{}, "AAAA", "", ""]}},
    {"h": {"tool_position": [{"time": "AAAAAAAAAAA="}, "AAAAAAAAAAA=", "", ""]}},
    {"h": {"tool_position": [{"clearance": "AAAAAAAAAAA="}, "AAAAAAAAAAA=", "", ""]}},
    {"h": {"tool_position": [{"time": [[0.0]], "axis": ["x"]}, "AAAAAAAAAAA=", "", ""]}},
    {"h": {"tool_position": [{"time": [0.0], "axis": ["x"]}, "AAAAAAAAAAA=", "", 1]}},
    {"h": {"../x": [{"time": "AAAAAAAAAAA="}, "AAAAAAAAAAA=", "", ""]}},
]  # fmt: skip


@pytest.mark.parametrize("other", OTHERS, ids=repr)
def test_lines_of_a_journal_that_are_no_cases_are_as_good_as_changed(other, whole, tmp_path):
    """Their checksums are right: a stranger can reckon them too."""
    path, store, before = whole
    shutil.copytree(store, tmp_path / "s")
    lines = Journal(tmp_path / "s" / "journal", number(store))
    good = {"i": [0, 0, 0], "s": 1, "v": {"peak_force": 1.0}}
    lines.add(good | other if isinstance(other, dict) else other)
    values = {
        str(name): float(before[name][0, 1, 0])
        for name in before.data_vars
        if before[name].dtype.kind == "f" and before[name].ndim == 3
    }
    lines.add({"i": [0, 1, 0], "s": 1, "v": values | {"peak_force": 7.0}})
    lines.close()
    SweepStore(tmp_path / "s", plan_of(path), resume=True).close()
    found = jp.open_sweep(tmp_path / "s").load()
    assert found["peak_force"].values[0, 1, 0] == 7.0
    found["peak_force"].values[0, 1, 0] = before["peak_force"].values[0, 1, 0]
    xr.testing.assert_identical(found, before)


def test_lines_of_a_journal_that_are_no_text_or_of_another_store_are_passed_over(tmp_path):
    lines = [b"no json", b"[" * 100_000, b'{"i":[1]}']
    content = b"".join(b"%s %s\n" % (journal._hash(text, "0"), text) for text in lines)
    (tmp_path / "j").write_bytes(content + line({"i": [0]}, "1") + line({"i": [2]}, "0"))
    assert Journal(tmp_path / "j", "0").found == [None, None, {"i": [1]}, {"i": [2]}]
