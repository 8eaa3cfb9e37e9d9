"""Stores that are damaged or made by strangers: no wrong number is read, no code of theirs runs."""

import json
import os
import random
import re
import shutil
import sqlite3
from contextlib import closing, contextmanager

import numpy as np
import pytest
import xarray as xr
from sweep_scenario import SCENARIO

import jointplay as jp
from jointplay import JointplayError
from jointplay.study import database, plan_of, sweeps
from jointplay.study.case import run_case
from jointplay.study.database import FILE, Column, Rows
from jointplay.study.runs import Runs
from jointplay.study.store import DONE, Outcome, SweepStore

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
    """A scenario and its store: numbers, texts, results, samples, and cases that failed."""
    folder = tmp_path_factory.mktemp("whole")
    path = folder / "study.toml"
    path.write_text(SCENARIO.format(axes=AXES, options="results = true\nsamples = 2",
                                    duration="2 ms"))  # fmt: skip
    with pytest.MonkeyPatch.context() as patched:
        Here.ran = []
        patched.setattr(sweeps, "workers_for", lambda plan, *_: Here(sweeps.job(plan)))
        jp.sweep(path, folder / "s")
    assert len(Here.ran) == CASES
    found = jp.open_sweep(folder / "s").dataset()
    assert set(np.unique(found["status"])) == {"done", "failed"}
    return path, folder / "s", found


@pytest.fixture
def store(whole, tmp_path):
    """A copy of that store."""
    return shutil.copytree(whole[1], tmp_path / "s")


def flipped(content, bit):
    data = bytearray(content)
    data[bit // 8] ^= 1 << bit % 8
    return bytes(data)


@contextmanager
def changed(path, content):
    before = path.read_bytes()
    path.write_bytes(content)
    try:
        yield
    finally:
        path.write_bytes(before)


def rewrite(store, *statements):
    """Change the file directly, through sqlite3."""
    with closing(sqlite3.connect(store / FILE)) as opened:
        for statement in statements:
            opened.execute(*([statement] if isinstance(statement, str) else statement))
        opened.commit()


def resealed(store, change):
    """Replace the description of the file, with a correct checksum."""
    with closing(sqlite3.connect(store / FILE)) as opened:
        about = json.loads(opened.execute("SELECT content FROM about").fetchone()[0])
        about = change(about)
        text = json.dumps(about)
        opened.execute("UPDATE about SET content = ?, checksum = ?",
                       (text, database._checksum(text)))  # fmt: skip
        opened.commit()


def mended(whole, store):
    """Resume the sweep, and check that all is as it was."""
    path, _, reference = whole
    found = jp.sweep(path, store, resume=True)
    xr.testing.assert_identical(found.dataset().drop_vars("cost"), reference.drop_vars("cost"))
    for case in found.table().query("status == 'done'").index:
        assert len(found.result(case).time) == 21


def read(store):
    """The whole content of a store, or the message with which it is refused."""
    try:
        return jp.open_sweep(store).dataset(), ""
    except JointplayError as error:
        return None, str(error)


def test_what_sqlite_says_of_bytes_that_are_no_text_is_one_line(store):
    path = store / FILE
    content = path.read_bytes()
    for name in (b"CREATE TABLE about", b"CREATE TABLE cases"):
        for way in (b"\xef", b"C\xef"):
            path.write_bytes(content.replace(name, way + name[len(way) :]))
            found, said = read(store)
            assert found is None
            assert "is damaged or not a sweep: " in said
            assert "\n" not in said


@pytest.mark.parametrize(
    "flips",
    [
        100,
        pytest.param(300, marks=pytest.mark.thorough),
        pytest.param(20_000, marks=pytest.mark.nightly),
    ],
)
def test_no_flipped_bit_gives_another_number(flips, whole):
    """What cannot be read is said in a line. SQLite may hide rows behind a flipped bit of its own;
    then they are missing, as if they had not been run.
    """
    _, store, reference = whole
    rng, path = random.Random(flips), store / FILE
    content = path.read_bytes()
    rows = range(row_of(content, store, "2 1 1"), row_of(content, store, "0 0 0"))
    used = [k for k, byte in enumerate(content) if byte]  # most of a page can be empty
    refused = missing = 0
    for number in range(flips):
        place = rng.choice(used if number % 3 == 0 else rows)
        with changed(path, flipped(content, 8 * place + rng.randrange(8))):
            found, said = read(store)
        if found is None:
            refused += 1
            assert "\n" not in said
            assert re.search("is damaged or not a sweep: |cannot read |is locked", said), said
            continue
        ran = found["status"] != "not run"
        for name, values in found.data_vars.items():
            was = reference[name]
            assert ((values == was) | (values.isnull() & was.isnull()) | ~ran).all(), name
        missing += not ran.all()
    assert refused > 0.6 * flips  # most others hit one of the two copies of the description
    assert missing < 0.02 * flips


def row_of(content, store, place):
    """Offset of a case's row in a file, found by its place, which its checksum follows."""
    with closing(sqlite3.connect(store / FILE)) as opened:
        seal = opened.execute("SELECT checksum FROM cases WHERE place = ?", (place,)).fetchone()[0]
    return content.index(place.encode() + seal)


def test_each_bit_of_a_row_is_under_its_checksum(whole):
    """Every bit of its values, texts and checksum counts, none of which SQLite itself notices."""
    _, store, _ = whole
    path = store / FILE
    content = path.read_bytes()
    begin = row_of(content, store, "2 1 0")
    with closing(sqlite3.connect(path)) as opened:
        assert opened.execute("PRAGMA integrity_check").fetchall() == [("ok",)]
    for bit in range(8 * begin, 8 * (begin + 200)):  # it is some 230 bytes long
        with changed(path, flipped(content, bit)):
            _, said = read(store)
        assert "is damaged or not a sweep" in said, bit
        assert said.endswith("; --resume runs what is damaged again"), bit


@pytest.mark.parametrize(
    "places", [pytest.param(["2 1 0"], marks=pytest.mark.thorough), ["0 0 0", "2 1 1"]]
)
def test_what_is_damaged_runs_again_and_gives_what_it_was(places, whole, here, store):
    for place in places:
        content = (store / FILE).read_bytes()
        bit = 8 * (row_of(content, store, place) + 60)
        (store / FILE).write_bytes(flipped(content, bit))
    mended(whole, store)
    assert [" ".join(map(str, index)) for index in here.ran] == places


@pytest.mark.parametrize(
    ("statement", "again"),
    [
        ("UPDATE cases SET peak_force = peak_force + 1e-9 WHERE place = '0 0 0'", 1),
        ("UPDATE cases SET status = 'done', error = '' WHERE status = 'failed'", 4),
        ("DELETE FROM cases WHERE place = '0 0 0'", 1),
        *(
            pytest.param(*one, marks=pytest.mark.nightly)
            for one in [
                ("UPDATE about SET checksum = NULL WHERE rowid = 2", 0),
                ("UPDATE cases SET clearance = 3e-4 WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET rough = 'yes' WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET peak_force = NULL WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET peak_force = 'much' WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET peak_force = x'00' WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET error = CAST(x'ff' AS TEXT) WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET place = '0 0 1' WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET place = NULL, checksum = NULL WHERE place = '0 0 0'", 1),
                ("UPDATE cases SET peak_force = 1e999 WHERE place = '0 0 0'", 1),
                ("INSERT INTO cases SELECT * FROM cases WHERE place = '0 0 0'", 0),
                ("UPDATE about SET content = '{}' WHERE rowid = 1", 0),
                ("DELETE FROM about WHERE rowid = 1", 0),
            ]
        ),
    ],
)
def test_a_row_that_another_hand_has_changed_runs_again(statement, again, whole, here, store):
    rewrite(store, statement)
    found, said = read(store)
    if "about" in statement:  # there are two copies
        xr.testing.assert_identical(found, whole[2])
    elif not statement.startswith("DELETE"):
        assert found is None
        assert "--resume runs what is damaged again" in said
    mended(whole, store)
    assert len(here.ran) == again


def test_a_row_of_another_sweep_is_refused(whole, here, store, tmp_path):
    """A row of the same case and columns, whose checksum is right in its own file."""
    other = SweepStore(tmp_path / "other", plan_of(whole[0]))
    values = {name: 7.0 for name, x in whole[2].data_vars.items() if x.dtype.kind == "f"}
    other.keep((0, 0, 0), Outcome((0, 0, 0), DONE, values))
    other.close()
    rewrite(store, "DELETE FROM cases WHERE place = '0 0 0'",
            ("ATTACH ? AS other", (str(tmp_path / "other" / FILE),)))  # fmt: skip
    with closing(sqlite3.connect(store / FILE)) as opened:
        opened.execute("ATTACH ? AS other", (str(tmp_path / "other" / FILE),))
        opened.execute("INSERT INTO cases SELECT * FROM other.cases")
        opened.commit()
    assert "--resume" in read(store)[1]
    mended(whole, store)
    assert here.ran == [(0, 0, 0)]


@pytest.mark.parametrize("where", ["rows", "above them"])
def test_a_page_that_sqlite_cannot_read_costs_its_rows_alone(where, tmp_path):
    """A page filled with noise: the rows of the others are rescued into a new file."""
    path = tmp_path / "rows"
    rows = Rows.make(path, {}, [Column(f"x{k}") for k in range(20)])
    for k in range(200):
        rows.add(str(k), {f"x{n}": 0.1 * (k + n) for n in range(20)})
    rows.close()
    content = bytearray(path.read_bytes())
    with closing(sqlite3.connect(path)) as opened:
        (seal,) = opened.execute("SELECT checksum FROM cases WHERE place = '100'").fetchone()
    page = content.index(b"100" + seal) // 4096
    page = page if where == "rows" else 2  # the root, which lists all pages
    content[page * 4096 : (page + 1) * 4096] = random.Random(3).randbytes(4096)
    path.write_bytes(content)
    with (
        closing(Rows(path)) as opened,
        pytest.raises(JointplayError, match="is damaged or not a sweep"),
    ):
        list(opened.blocks(200))
    rows = Rows(path, write=True)
    found = {place: values["x3"][k] for places, values in rows.blocks(200)
             for k, place in enumerate(places)}  # fmt: skip
    assert not rows.intact
    assert 170 < len(found) < 200 if where == "rows" else not found
    rows.rebuild({}, rows.columns, ((place, {"x3": x}) for place, x in found.items()))
    assert rows.intact
    rows.add("more", {})
    rows.close()
    ((places, values),) = Rows(path).blocks(200)
    assert places == [*found, "more"]
    assert values["x3"][:-1].tolist() == [0.1 * (int(place) + 3) for place in found]
    with closing(sqlite3.connect(path)) as opened:
        assert opened.execute("PRAGMA integrity_check").fetchall() == [("ok",)]


@pytest.mark.parametrize(
    "way",
    [
        "flipped",
        *(
            pytest.param(way, marks=pytest.mark.thorough)
            for way in ("gone", "that of another case", "a link", "cut short")
        ),
    ],
)
def test_a_result_that_is_not_what_its_row_says_runs_again(way, whole, here, store, tmp_path):
    path, other = store / "results" / "0-0-0.nc", store / "results" / "2-1-1.nc"
    content = path.read_bytes()
    if way == "flipped":
        path.write_bytes(flipped(content, 4 * len(content)))
    elif way == "that of another case":
        shutil.copy(other, path)
    elif way == "cut short":
        path.write_bytes(content[:-70])
    else:
        path.unlink()
    if way == "a link":
        path.symlink_to(tmp_path / "nothing")
    with pytest.raises(JointplayError, match=r"0-0-0\.nc"):
        jp.open_sweep(store).result(0)
    assert len(jp.open_sweep(store).result(CASES - 1).time) == 21
    mended(whole, store)
    assert here.ran == [(0, 0, 0)]


def test_a_file_too_damaged_to_open_is_refused_in_a_line_and_stays(whole, here, store):
    content = (store / FILE).read_bytes()
    size = 4096
    for damage in (content[: len(content) // 2], b"", b"x" * 100, flipped(content, 1),
                   content[:size] + bytes(size) + content[2 * size :]):  # fmt: skip
        (store / FILE).write_bytes(damage)
        for how in (lambda: jp.open_sweep(store).dataset(),
                    lambda: jp.sweep(whole[0], store, resume=True)):  # fmt: skip
            if damage and len(damage) > 100 and how.__code__.co_names[1] == "sweep":
                continue
            with pytest.raises(JointplayError, match="is damaged or not a sweep") as error:
                how()
            assert "\n" not in str(error.value)
            assert (store / FILE).read_bytes() == damage
    assert here.ran == []


def test_a_sweep_that_doubled_its_samples_goes_on_from_damage(here, tmp_path):
    path, store = tmp_path / "study.toml", tmp_path / "s"
    until = '{ measure = "peak_force", statistic = "mean", precision = 1e-9, most = 8 }'
    axes = (
        'cr = { key = "joints.joint_b.radial_clearance", distribution = "uniform", '
        'from = "0.1 mm", to = "0.3 mm" }'
    )
    options = f"samples = 2\nuntil = {until}"
    path.write_text(SCENARIO.format(axes=axes, options=options, duration="2 ms"))
    first = jp.sweep(path, store).dataset()
    assert first.sizes["sample"] == 8
    rewrite(store, "UPDATE about SET checksum = '' WHERE rowid = 1",
            "UPDATE cases SET peak_force = 1.0 WHERE place = '5'")  # fmt: skip
    here.ran.clear()
    again = jp.sweep(path, store, resume=True).dataset()
    xr.testing.assert_identical(again.drop_vars("cost"), first.drop_vars("cost"))
    assert here.ran == [(5,)]


# ---- Strangers ----------------------------------------------------------------------------------

SCHEMAS = [
    "CREATE TABLE more (x)",
    "CREATE VIEW more AS SELECT * FROM cases",
    "CREATE TRIGGER more AFTER INSERT ON cases BEGIN DELETE FROM cases; END",
    "CREATE INDEX more ON cases (place)",
    "CREATE VIRTUAL TABLE more USING fts5(x)",
    "ALTER TABLE cases ADD COLUMN more AS (zeroblob(1000000000))",
    "ALTER TABLE cases ADD COLUMN more REAL DEFAULT 1.0",
    "ALTER TABLE cases RENAME COLUMN impacts TO bumps",
]


@pytest.mark.parametrize("schema", SCHEMAS)
def test_a_schema_that_is_not_ours_is_refused_before_a_row_is_read(schema, whole, store, here):
    """Its other tables are never queried, neither for reading nor for resuming."""
    rewrite(store, schema)
    before = (store / FILE).read_bytes()
    for way in (lambda: jp.open_sweep(store), lambda: jp.sweep(whole[0], store, resume=True)):
        with pytest.raises(JointplayError, match="its tables are not those of a sweep"):
            way()
    assert (store / FILE).read_bytes() == before
    assert here.ran == []


def test_a_view_in_the_place_of_the_cases_is_refused(store):
    with closing(sqlite3.connect(store / FILE)) as opened:
        opened.execute("ALTER TABLE cases RENAME TO others")
        opened.execute("CREATE VIEW cases AS SELECT * FROM others")
        opened.commit()
    assert "its tables are not those of a sweep" in read(store)[1]


def columns_with(index, value):
    def change(about):
        about["columns"][0][index] = value
        return about

    return change


STRANGE = [
    lambda about: [], lambda about: {}, lambda about: {"columns": 1},
    lambda about: about | {"format": 4}, lambda about: about | {"columns": [["a"] * 9]},
    lambda about: about | {"sizes": {}}, lambda about: about | {"sizes": {"clearance": -1}},
    lambda about: about | {"sizes": {"clearance": 10**30}},
    lambda about: about | {"sizes": about["sizes"] | {"more": 10**5}},
    lambda about: about | {"sizes": about["sizes"] | {"clearance": True}},
    lambda about: about | {"labels": {"clearance": [1]}},
    lambda about: about | {"labels": {"clearance": {"values": [[1], [1, 2], 3]}}},
    lambda about: about | {"labels": {"clearance": {"values": [10**400, 1, 2]}}},
    lambda about: about | {"labels": {"none": {"values": []}}},
    lambda about: about | {"sampled": ["none"]}, lambda about: about | {"sampled": [[]]},
    lambda about: about | {"identity": {"a": 1}}, lambda about: about | {"identity": None},
    lambda about: about | {"versions": []}, lambda about: about | {"case": 1},
    columns_with(0, "impacts"), columns_with(0, "\x1b[31m"), columns_with(1, "JSON"),
    columns_with(1, "TEXT, x REAL"), columns_with(2, "\x1b[31m"), columns_with(3, None),
]  # fmt: skip


@pytest.mark.parametrize("number", range(len(STRANGE)))
def test_what_a_stranger_has_a_file_say_of_itself_is_refused_in_a_line(number, whole, store):
    resealed(store, STRANGE[number])
    for way in (lambda: jp.open_sweep(store).dataset(),
                lambda: jp.sweep(whole[0], store, resume=True)):  # fmt: skip
        with pytest.raises(
            JointplayError, match=r"is damaged or not a sweep|more memory|another sw"
        ) as e:
            way()
        assert "\n" not in str(e.value)


@pytest.mark.parametrize("ending", ["", "-wal", "-shm", "-journal"])
@pytest.mark.parametrize("way", ["link", "pipe", "folder"])
def test_a_file_that_is_none_of_the_folder_is_not_opened(ending, way, store, tmp_path):
    path, secret = store / f"{FILE}{ending}", tmp_path / "secret"
    if ending == "":
        path.rename(secret)
    if way == "link":
        secret.touch()
        path.symlink_to(secret)
    elif way == "pipe":
        os.mkfifo(path)
    else:
        path.mkdir()
    found, said = read(store)
    assert found is None
    assert "no sweep" in said or "it is not a regular file" in said


def test_a_journal_that_names_another_file_has_sqlite_delete_nothing(whole, store, tmp_path):
    """A rollback journal may name a second one, which SQLite deletes when it has rolled back."""
    precious = tmp_path / "precious"
    precious.write_bytes(b"x\0")
    name = str(precious).encode()
    said = sum(name).to_bytes(4, "big")
    size = len(name).to_bytes(4, "big")
    with closing(sqlite3.connect(store / FILE)) as opened:
        pages, page = (
            opened.execute(f"PRAGMA {one}").fetchone()[0] for one in ("page_count", "page_size")
        )
    numbers = (0, 0, pages, 512, page)
    head = b"\xd9\xd5\x05\xf9\x20\xa1\x63\xd7" + b"".join(n.to_bytes(4, "big") for n in numbers)
    hot = head.ljust(512, b"\0") + bytes(4) + name + size + said + head[:8]
    control = tmp_path / "control.sqlite"
    shutil.copy(store / FILE, control)
    control.with_name("control.sqlite-journal").write_bytes(hot)
    with closing(sqlite3.connect(control)) as opened:  # as SQLite itself does it
        opened.execute("SELECT * FROM about").fetchone()
    assert not precious.exists()
    precious.write_bytes(b"x\0")
    (store / f"{FILE}-journal").write_bytes(hot)
    for way in (lambda: jp.open_sweep(store), lambda: jp.sweep(whole[0], store, resume=True)):
        with pytest.raises(JointplayError, match="it names another file"):
            way()
    assert precious.exists()


def test_what_a_killed_process_had_begun_to_change_is_rolled_back_by_who_reads(store, tmp_path):
    before, _ = read(store)
    other = tmp_path / "killed"
    with closing(sqlite3.connect(store / FILE, isolation_level=None)) as opened:
        opened.execute("PRAGMA journal_mode=DELETE")
        opened.execute("PRAGMA cache_size=1")
        opened.execute("BEGIN")
        for _ in range(12):  # so much that pages reach the file before the end
            opened.execute("INSERT INTO cases SELECT * FROM cases")
        shutil.copytree(store, other)  # the state when the process is killed
        opened.execute("ROLLBACK")
    assert (other / f"{FILE}-journal").stat().st_size > 0
    xr.testing.assert_identical(read(other)[0], before)


def test_a_file_that_another_program_holds_is_said(whole, store, monkeypatch):
    monkeypatch.setattr(database, "LOCKED_S", 0.1)
    with closing(sqlite3.connect(store / FILE, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        for way in (lambda: jp.open_sweep(store), lambda: jp.sweep(whole[0], store, resume=True)):
            with pytest.raises(JointplayError, match="is locked by another program"):
                way()


@pytest.mark.thorough
@pytest.mark.parametrize("stop", range(0, 60, 6))
def test_a_full_disk_at_any_moment_loses_nothing(stop, whole, here, tmp_path, monkeypatch):
    path, _, reference = whole
    count, add = 0, Rows.add

    def full(rows, *given):
        nonlocal count
        count += 1
        if count > stop // 6:
            limit = rows.connection.execute("PRAGMA page_count").fetchone()[0]
            rows.connection.execute(f"PRAGMA max_page_count = {limit}")
            while True:  # until there is no room in the last page either
                add(rows, f"{count} 9 9", given[1])
                count += 1
        add(rows, *given)

    with monkeypatch.context() as patched:
        patched.setattr(Rows, "add", full)
        with pytest.raises(JointplayError, match=r"No space left on device; \d+ of 12 cases are"):
            jp.sweep(path, tmp_path / "s")
    rewrite(tmp_path / "s", "DELETE FROM cases WHERE place LIKE '% 9 9'")
    ran = len(here.ran)
    found = jp.sweep(path, tmp_path / "s", resume=True).dataset()
    assert len(here.ran) - ran == CASES - stop // 6
    xr.testing.assert_identical(found.drop_vars("cost"), reference.drop_vars("cost"))


# ---- The rows alone -----------------------------------------------------------------------------


def test_values_come_back_bit_by_bit(tmp_path):
    columns = [Column("x"), Column("n", "INTEGER"), Column("b", "BOOLEAN"), Column("t", "TEXT")]
    numbers = [0.1, 5e-324, 1.7976931348623157e308, np.inf, -np.inf, np.nan, 3.0, 2.0**53 + 2]
    rows = Rows.make(tmp_path / "r", {}, columns)
    for k, x in enumerate(numbers):
        rows.add(str(k), {"x": x, "n": 2**62 + k, "b": k % 2 == 0, "t": f"é\0\n{k}"})
    rows.add_columns([Column("y")])
    rows.add("8", {"x": 1.0, "y": -0.0, "n": -1, "b": True, "t": "1"})
    rows.close()
    ((places, found),) = Rows(tmp_path / "r").blocks(9)
    assert places == [str(k) for k in range(9)]
    np.testing.assert_array_equal(found["x"], [*numbers, 1.0])
    assert found["n"].tolist() == [*(2**62 + k for k in range(8)), -1]
    assert found["b"].tolist() == [k % 2 == 0 for k in range(9)]
    assert found["t"].tolist() == [*(f"é\0\n{k}" for k in range(8)), "1"]
    assert np.isnan(found["y"][:8]).all()
    assert [one.name for one in tmp_path.iterdir()] == ["r"]


def test_runs_of_a_study_that_are_damaged_run_again(tmp_path):
    kept = Runs(tmp_path / "k" / "runs", {"a": 1})
    for k in range(4):
        kept.keep((0.5, k), {"row": np.arange(k + 1.0), "said": np.array("é")})
    kept.close()
    with closing(sqlite3.connect(tmp_path / "k" / "runs")) as opened:
        opened.execute("UPDATE cases SET found = replace(found, 'A', 'B') WHERE place = '[0.5, 1]'")
        opened.commit()
    again = Runs(tmp_path / "k" / "runs", {"a": 1})
    assert list(again) == [(0.5, 0), (0.5, 2), (0.5, 3)]
    np.testing.assert_array_equal(again[0.5, 3]["row"], np.arange(4.0))
    assert str(again[0.5, 3]["said"]) == "é"
    again.keep((0.5, 1), {"row": np.arange(2.0)})
    again.close()
    third = Runs(tmp_path / "k" / "runs", {"a": 1})
    assert len(third) == 4
    third.close()
    with pytest.raises(JointplayError, match=r"made for something else \(another a\)"):
        Runs(tmp_path / "k" / "runs", {"a": 2})
