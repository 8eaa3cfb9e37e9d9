"""Sweeps that are run: the content of their stores, and what they refuse."""

import importlib
import shutil
import sqlite3
import subprocess
from contextlib import closing
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from sweep_scenario import ARM, GRID, SCENARIO
from warm import PYTHON

import jointplay as jp
from jointplay import JointplayError
from jointplay.cli import main
from jointplay.study import plan_of
from jointplay.study.case import Bench, job
from jointplay.study.store import DONE, Outcome, SweepStore
from jointplay.study.sweep_table import columns_of, measured, table

VARYING = "cost"


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    """A small sweep that was run once: its store and the scenario."""
    folder = tmp_path_factory.mktemp("sweep")
    path = folder / "study.toml"
    (folder / "own.py").write_text(
        "def longest(result):\n    return {'reach': abs(result['tool_position'].values).max()}\n"
    )
    options = 'measures = ["own:longest"]\nresults = true\nrepeats = 2'
    path.write_text(SCENARIO.format(axes=GRID, options=options, duration="0.02 s"))
    jp.import_module(folder / "own.py")
    jp.sweep(path, folder / "store")
    return folder / "store", path


def test_a_store_is_one_dataset_over_the_dimensions_of_the_sweep(done):
    found = jp.open_sweep(done[0]).dataset()
    assert dict(found["peak_force"].sizes) == {"clearance": 3, "friction": 2, "repeat": 2}
    np.testing.assert_array_equal(found["clearance"], [0.0, 1e-4, 2e-4])
    assert (found["clearance"].attrs["units"], found["peak_force"].attrs["units"]) == ("m", "N")
    assert (found["status"] == "done").all()
    assert sorted(one.name for one in done[0].iterdir()) == ["cases.sqlite", "results"]


def test_other_tools_read_the_cases(done):
    """By Python's own sqlite3, and pandas: a row for each case, in the order of completion."""
    found = jp.open_sweep(done[0])
    with closing(sqlite3.connect(done[0] / "cases.sqlite")) as opened:
        plain = pd.read_sql("SELECT * FROM cases", opened)
    assert len(plain) == 12
    assert set(plain["status"]) == {"done"}
    table = found.table()
    assert table.index.tolist() == list(range(12))
    assert table.attrs["units"]["peak_force"] == "N"
    order = ["clearance", "friction", "repeat"]
    plain, table = (one.sort_values(order).reset_index(drop=True) for one in (plain, table))
    pd.testing.assert_frame_equal(plain[table.columns], table)
    grid = found.dataset()["peak_force"].values.ravel()
    np.testing.assert_array_equal(found.table()["peak_force"], grid)


def test_cases_are_those_that_single_runs_give(done):
    store, path = done
    found = jp.open_sweep(store).dataset().isel(clearance=2, friction=1, repeat=1)
    changes = {
        "joints": {"joint_b": {"radial_clearance": "0.2 mm", "friction": {"mu_d": 0.1}}},
        "integration": {"seed": 1},
    }
    result = jp.Scenario.load(path).simulation(changes=changes).run()
    from jointplay.simulation.analysis import deviation, error_statistics, time_fractions

    error = error_statistics(deviation(result))
    assert float(found["tool_error_rms_total"]) == pytest.approx(error.rms[3], rel=1e-12)
    assert float(found["tool_error_peak_x"]) == pytest.approx(error.peak[0], rel=1e-12)
    peak = np.linalg.norm(result["joint_force_peak"].values, axis=2).max()
    assert float(found["peak_force"]) == pytest.approx(peak, rel=1e-12)
    assert float(found["impacts"]) == result.audit.impacts > 0
    for mode, share in time_fractions(result, "joint_b").items():
        assert float(found[f"share_{mode}"]) == pytest.approx(share)
    case = np.ravel_multi_index((2, 1, 1), (3, 2, 2))
    kept = jp.open_sweep(store).result(int(case))
    xr.testing.assert_equal(kept.dataset, result.dataset)
    file = store / "results" / "2-1-1.nc"  # an ordinary result, which every reader takes
    xr.testing.assert_identical(jp.Result.load(file).dataset, kept.dataset)
    assert float(found["reach"]) == np.abs(result["tool_position"].values).max()


def test_the_ideal_joint_has_no_tool_error_and_the_force_of_its_reaction(done):
    store, path = done
    found = jp.open_sweep(store).dataset().isel(clearance=0, friction=0, repeat=0)
    assert float(found["tool_error_peak_total"]) == 0.0
    changes = {"joints": {"joint_b": {"ideal": True}}}
    result = jp.Scenario.load(path).simulation(changes=changes).run()
    force = result["reaction_force"].sel(moving_joint="joint_b").values
    assert float(found["peak_force"]) == pytest.approx(np.linalg.norm(force, axis=1).max())
    assert "joint_force" not in jp.open_sweep(store).result(0).dataset


def test_resuming_a_finished_sweep_runs_nothing(done, monkeypatch):
    before = jp.open_sweep(done[0]).dataset()
    sweeps = importlib.import_module("jointplay.study.sweeps")
    monkeypatch.setattr(sweeps, "workers_for", lambda *_: pytest.fail("nothing is left"))
    after = jp.sweep(done[1], done[0], resume=True).dataset()
    xr.testing.assert_identical(after, before)


def test_a_store_of_another_sweep_is_refused_with_the_difference(done, tmp_path):
    store, path = done
    with pytest.raises(JointplayError, match="exists; continue it with --resume"):
        jp.sweep(path, store)
    (tmp_path / "precious.txt").write_text("x")
    with pytest.raises(JointplayError, match="a folder that holds other files"):
        jp.sweep(path, tmp_path)
    other, own = path.with_name("changed.toml"), path.with_name("own.py")
    other.write_text(path.read_text().replace('gravity = "loaded"', 'gravity = "balanced"'))
    for way in ("resume", "extend"):
        said = 'robot.gravity is "balanced" instead of "loaded"'
        with pytest.raises(JointplayError, match=said):
            jp.sweep(other, store, **{way: True})
    text = own.read_text()
    own.write_text(text + "# other\n")
    try:
        with pytest.raises(JointplayError, match=r"file own.py has changed"):
            jp.sweep(path, store, resume=True)
    finally:
        own.write_text(text)


def test_the_table_has_a_row_for_every_point_and_own_measures(done):
    text = table(jp.open_sweep(done[0]).dataset())
    assert "clearance [mm]" in text
    assert "reach" in text
    assert "means over 2 runs of each point" in text
    assert len([line for line in text.splitlines() if line.strip()[:1].isdigit()]) >= 6


@pytest.mark.parametrize(
    "words",
    [
        ["x=clearance", "y=peak_force", "hue=friction"],
        ["x=clearance", "y=peak_force", "friction=0.1"],
        ["x=clearance", "y=friction", "z=tool_error_rms_total"],
    ],
)
@pytest.mark.usefixtures("checked_figures")
def test_figures_of_sweeps_are_drawn(words, done, tmp_path, capsys):
    out = tmp_path / "f.png"
    assert main(["plot", str(done[0]), *words, "--out", str(out)]) == 0
    assert out.read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["x=clearence", "y=peak_force"], "no dimension 'clearence'"),
        (["x=clearance", "y=peek_force"], "no measure 'peek_force'"),
        (["x=clearance"], "y=NAME is missing"),
        (["clearance", "y=peak_force"], "WORDS must read x=NAME"),
        (["x=clearance", "y=peak_force", "hue=clearance"], "no dimension for hue"),
        (["x=clearance", "y=peak_force", "speed=1"], "no dimension 'speed'"),
    ],
)
def test_what_cannot_be_drawn_is_said_in_a_line(words, said, done, tmp_path, capsys):
    assert main(["plot", str(done[0]), *words, "--out", str(tmp_path / "f.png")]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


CR = 'key = "joints.joint_b.radial_clearance", values = ["0.1 mm"]'


@pytest.mark.parametrize(
    ("axes", "options", "said"),
    [
        (None, 'results = "tool"', r"sweep\.results.*true or false"),
        (None, 'measures = ["statistics:mean"]', "--import statistics"),
        (f"c = {{ {CR.replace('joint_b', 'joint_d')} }}", "",
         r'no joint "joint_d".*did you mean "joint_'),
        (f"peak_force = {{ {CR} }}", "", "an axis cannot be called 'peak_force'"),
    ],
)  # fmt: skip
def test_what_no_sweep_can_do_is_refused_before_anything_runs(axes, options, said, swept, tmp_path):
    path = swept(options=options) if axes is None else swept(axes, options)
    with pytest.raises(JointplayError, match=said):
        jp.sweep(path, tmp_path / "s")
    assert not (tmp_path / "s").exists()


def test_a_failed_case_is_kept_with_its_error_and_the_rest_goes_on(swept, tmp_path):
    path = swept(
        'c = { key = "joints.joint_b.radial_clearance", values = ["0.1 mm", "1 nm", "0.2 mm"] }'
    )
    found = jp.sweep(path, tmp_path / "s", jobs=1).dataset()
    assert found["status"].values.tolist() == ["done", "failed", "done"]
    assert "is too large for the contact stiffness at" in str(found["error"].values[1])
    assert np.isfinite(found["peak_force"].values).tolist() == [True, False, True]
    assert "1 of 3 cases failed" in table(found)


def test_a_measure_that_raises_fails_its_case_only(swept, tmp_path):
    (tmp_path / "mine.py").write_text("def bad(result):\n    return 1.0 / result.audit.impacts\n")
    jp.import_module(tmp_path / "mine.py")
    path = swept('c = { key = "joints.joint_b.radial_clearance", values = [0, "0.2 mm"] }',
                    'measures = ["mine:bad"]', "1 ms")  # fmt: skip
    found = jp.sweep(path, tmp_path / "s", jobs=1).dataset()
    assert found["status"].values[0] == "failed"
    assert str(found["error"].values[0]) == "ZeroDivisionError: float division by zero"


def test_a_million_cases_are_asked_about(swept, tmp_path, capsys):
    path = swept(
        'c = { key = "joints.joint_b.radial_clearance", from = 1e-4, to = 2e-4, number = 10 }\n'
        'd = { key = "joints.joint_b.friction.mu_d", from = 0, to = 0.1, number = 10 }',
        "repeats = 10000",
    )
    assert main(["study", "sweep", str(path), "--out", str(tmp_path / "s"), "--quiet"]) == 2
    said = capsys.readouterr().err
    assert "c 10 x d 10 x repeat 10000 = 1000000 cases: about" in said
    assert "use --yes to run it" in said
    assert not (tmp_path / "s").exists()


def test_more_values_samples_and_repeats_are_added_to_a_store(swept, tmp_path):
    axes = 'mu = {{ key = "joints.joint_b.friction.mu_d", values = [{}] }}'
    options = "repeats = 2"
    path = swept(axes.format("0.0, 0.1"), options, "2 ms")
    first = jp.sweep(path, tmp_path / "s", jobs=1).dataset()
    path = swept(axes.format("0.0, 0.1, 0.2"), "repeats = 3", "2 ms")
    with pytest.raises(jp.JointplayError, match="--extend adds the new cases"):
        jp.sweep(path, tmp_path / "s", resume=True)
    more = jp.sweep(path, tmp_path / "s", jobs=1, extend=True).dataset()
    whole = jp.sweep(path, tmp_path / "w", jobs=1).dataset()
    assert dict(more["status"].sizes) == {"mu": 3, "repeat": 3}
    assert (more["status"] == "done").all()
    np.testing.assert_array_equal(more["cost"][:2, :2], first["cost"])  # not run again
    xr.testing.assert_identical(more.drop_vars(VARYING), whole.drop_vars(VARYING))


def test_an_axis_that_is_extended_by_values_of_another_kind_keeps_its_cases(swept, tmp_path):
    """An axis of integers that gets other numbers: the file is rebuilt, its column holds both."""
    axis = 'seed = {{ key = "integration.seed", values = [{}] }}'
    store = SweepStore(tmp_path / "s", plan_of(swept(axis.format("1, 2"))))
    store.keep((1,), Outcome((1,), DONE, {"impacts": 7.0}))
    store.close()
    assert jp.open_sweep(tmp_path / "s").table()["seed"].tolist() == [2]
    made = plan_of(swept(axis.format("1, 2, 3")))
    seed = replace(made.axes[0], coordinate=np.array([1.0, 2.0, 3.5]))
    store = SweepStore(tmp_path / "s", replace(made, axes=(seed,)), extend=True)
    assert store.ran.tolist() == [False, True, False]
    store.keep((2,), Outcome((2,), DONE, {"impacts": 8.0}))
    store.close()
    found = jp.open_sweep(tmp_path / "s").table()
    assert found["seed"].tolist() == [2.0, 3.5]
    assert found["impacts"].tolist() == [7.0, 8.0]


SAMPLED = """
mu = { key = "joints.joint_b.friction.mu_d", distribution = "uniform", from = 0.05, to = 0.15 }
cr = { key = "joints.joint_b.radial_clearance", distribution = "normal", mean = "0.2 mm", std = "0.02 mm" }
"""  # noqa: E501


def test_a_sweep_stops_by_itself_when_the_precision_is_reached(swept, tmp_path):
    options = (
        "samples = 4\nuntil = { measure = 'tool_error_rms_total', precision = 0.06, most = 512 }"
    )
    path = swept(SAMPLED, options, "20 ms")
    found = jp.sweep(path, tmp_path / "s").dataset()
    number = found.sizes["sample"]
    assert 4 < number < 512
    from jointplay.simulation.analysis.uncertainty import interval_estimate

    values = found["tool_error_rms_total"].values
    assert interval_estimate(values).relative <= 0.06
    assert interval_estimate(values[: number // 2]).relative > 0.06
    again = jp.sweep(path, tmp_path / "s", resume=True).dataset()
    assert again.sizes["sample"] == number


@pytest.mark.usefixtures("checked_figures")
def test_sobol_indices_are_printed_of_a_saltelli_design(swept, tmp_path, capsys):
    pytest.importorskip("SALib")
    path = swept(SAMPLED, 'samples = 8\nsampling = "saltelli"', "20 ms")
    store = tmp_path / "s"
    assert jp.sweep(path, store).sizes == {"sample": 32}
    out = tmp_path / "c.png"
    assert (
        main(["study", "uncertainty", str(store), "tool_error_rms_total", "--out", str(out)]) == 0
    )
    said = capsys.readouterr().out
    assert "Sobol indices" in said
    assert "mu" in said
    assert out.read_bytes().startswith(b"\x89PNG")


def test_files_travel_with_the_job(swept, tmp_path):

    urdf = jp.shipped("scara.urdf").read_text()
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "arm.urdf").write_text(urdf)
    path = swept()
    path.write_text(path.read_text().replace("jointplay:scara.urdf", "here/arm.urdf"))
    made = plan_of(path)
    work = job(made, send_files=True)
    here = Bench(job(made)).run((2, 1), made.changes((2, 1)))
    (tmp_path / "here" / "arm.urdf").unlink()
    there = Bench(work).run((2, 1), made.changes((2, 1)))
    assert there.status == "done", there.error
    del here.values[VARYING], there.values[VARYING]
    assert here.values == there.values


@pytest.mark.thorough
def test_a_script_needs_no_guard_to_run_a_sweep(swept, tmp_path):
    path = swept(duration="1 ms")
    script = tmp_path / "script.py"
    script.write_text(
        f"import jointplay as jp\nd = jp.sweep({str(path)!r}, {str(tmp_path / 's')!r}, "
        "{'joints.joint_b.friction.mu_d': [0.0, 0.1]}, jobs=2)\nprint(d.sizes['mu_d'])\n"
    )
    done = subprocess.run([PYTHON, str(script)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "2\n"


@pytest.mark.parametrize("why", ["store", "jobs"])
def test_a_sweep_that_is_refused_prints_no_plan(why, swept, tmp_path, capsys):
    out = tmp_path / "out"
    if why == "store":
        out.write_text("a file")
    more = ["--jobs", "0"] if why == "jobs" else []
    assert main(["study", "sweep", str(swept(duration="1 ms")), "--out", str(out), *more]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1


def test_going_on_empties_no_store_of_someone_else(swept, tmp_path, capsys):
    path = tmp_path / "mine"
    path.mkdir()
    with closing(sqlite3.connect(path / "cases.sqlite")) as mine:
        mine.execute("CREATE TABLE cases (precious REAL)")
        mine.execute("INSERT INTO cases VALUES (7.0)")
        mine.commit()
    before = (path / "cases.sqlite").read_bytes()
    assert main(["study", "sweep", str(swept()), "--out", str(path), "--resume", "--quiet"]) == 2
    assert "is damaged or not a sweep" in capsys.readouterr().err
    assert (path / "cases.sqlite").read_bytes() == before


def test_a_damaged_store_is_one_line_to_every_command(done, tmp_path, capsys):
    path = tmp_path / "s"
    shutil.copytree(done[0], path)
    (path / "cases.sqlite").write_text("{")
    for command in (
        ["plot", path, "x=clearance", "y=peak_force", "--out", tmp_path / "x.png"],
        ["report", path, "-o", tmp_path / "x.html", "--no-pdf", "--quiet"],
    ):
        assert main([str(word) for word in command]) == 2, command
        error = capsys.readouterr().err
        assert error.count("\n") == 1, error
        assert "is damaged" in error
    assert not list(tmp_path.glob("x.*"))


def test_results_of_cases_may_differ_in_length_and_those_that_failed_have_none(swept, tmp_path):
    axis = 'long = { key = "integration.duration", values = ["2 ms", "1 ns", "3.05 ms"] }'
    found = jp.sweep(swept(axis, "results = true"), tmp_path / "store", jobs=1)
    assert found.table()["status"].tolist() == ["done", "failed", "done"]
    assert [found.result(case).time[-1] for case in (0, 2)] == pytest.approx([2e-3, 3.05e-3])
    with pytest.raises(JointplayError, match=r"no result of case 1 .* it failed"):
        found.result(1)
    for case in (-1, 3, 1.5):
        with pytest.raises(JointplayError, match="case must be a whole number"):
            found.result(case)


NAMES = (
    "a/b",
    "_[c] <&>",
    "..",
    "né '\"; DROP TABLE cases; --",
    "Impacts",
    "place",
    "Checksum",
    "%s ?",
)


@pytest.mark.thorough
def test_measures_and_axes_may_have_any_name(swept, tmp_path):
    """Joints have names with slashes, and measures are named after joints."""
    lines = "\n".join(f"        {name!r}: {k}.5," for k, name in enumerate(NAMES))
    (tmp_path / "named.py").write_text(f"def own(result):\n    return {{\n{lines}\n    }}\n")
    jp.import_module(tmp_path / "named.py")
    axes = """
"x/y" = { key = "joints.joint_b.radial_clearance", values = ["0.1 mm", "0.2 mm"] }
"_<z>" = { key = "joints.joint_b.friction.mu_d", values = [0.0, 0.1] }
"""
    options = 'measures = ["named:own"]'
    jp.sweep(swept(axes, options, "2 ms"), tmp_path / "s", jobs=1)
    axes = axes.replace('"0.2 mm"]', '"0.2 mm", "0.3 mm"]')
    found = jp.sweep(swept(axes, options, "2 ms"), tmp_path / "s", jobs=1, extend=True).dataset()
    assert found["x/y"].values.tolist() == [1e-4, 2e-4, 3e-4]
    for k, name in enumerate(NAMES):
        assert (found[name].values == k + 0.5).all()
    assert found["Impacts"].dims == ("x/y", "_<z>")
    assert not found["impacts"].equals(found["Impacts"])  # they are the same name to SQLite
    assert main(["report", str(tmp_path / "s"), "--out", str(tmp_path / "r.html"), "--no-pdf"]) == 0
    page = (tmp_path / "r.html").read_text()
    assert all(name in page for name in ("a/b", "_&lt;z&gt;"))
    assert "<z>" not in page


def test_a_measure_of_the_users_own_takes_nothing_of_those_shipped(swept, tmp_path):
    """Neither the unit and meaning of a similar name, nor their columns."""
    names = ("impacts_of_mine", "status", "impulse")
    text = "".join(f"def {name}(result):\n    return 1.0\n" for name in names)
    (tmp_path / "named.py").write_text(text)
    jp.import_module(tmp_path / "named.py")
    for name in names:
        path = swept(f"clearance = {{ {CR} }}", f'measures = ["named:{name}"]', "2 ms")
        found = jp.sweep(path, tmp_path / name, jobs=1).dataset()
        own = name == "impacts_of_mine"
        assert found["status"].values.tolist() == ["done" if own else "failed"]
        assert own or name in str(found["error"].values[0])
        assert not own or (name, "", 1.0) in columns_of(found)


def test_a_sweep_of_bearings_has_loads_and_life_as_columns(tmp_path):
    """A rolling bearing in one of two joints; the other has a journal bearing."""
    text = ARM.replace(
        '[joints.joint_b]\nradial_clearance = "0.2 mm"\naxial_clearance = "0.2 mm"\n'
        'friction = { law = "ambrosio", mu_d = 0.1 }',
        '[joints.joint_b]\nkind = "ball-bearing"\ndesignation = "6010/C3"\n'
        '[joints.joint_a]\nradial_clearance = "0.1 mm"\naxial_clearance = "0.1 mm"',
    )
    assert "6010" in text
    path = tmp_path / "bearings.toml"
    path.write_text(
        text + '[integration]\nduration = "10 ms"\n[sweep]\ntool_error = false\n[sweep.axes]\n'
        'kind = { key = "joints.joint_b.designation", values = ["6010/C2", "6010/C4"] }\n'
    )
    data = jp.sweep(path, tmp_path / "store").dataset()
    changes = {"joints": {"joint_b": {"designation": "6010/C4"}}}
    result = jp.Scenario.load(path).simulation(changes=changes).run(estimate=False)
    life = jp.analysis.bearing_life(result, "joint_b")
    for name, value in {
        "largest_element_load": life.largest_load,
        "loaded_elements": life.most_loaded,
        "bearing_life": life.revolutions,
        "bearing_life_hours": life.hours,
    }.items():
        assert float(data.isel(kind=-1)[f"{name}_joint_b"]) == pytest.approx(value, rel=1e-12)
    assert data["largest_element_load_joint_b"].attrs["units"] == "N"
    assert "largest_element_load_joint_a" not in data
    with pytest.raises(JointplayError, match=r"this sweep has .*bearing_life_h"):
        measured(data, "bearing_life_joint_a")


def test_a_sweep_without_rolling_elements_says_that_it_has_no_lives(done):
    with pytest.raises(jp.JointplayError, match="this sweep has none"):
        measured(jp.open_sweep(done[0]).dataset(), "bearing_life")


def test_the_command_warns_of_an_arm_that_falls(tmp_path, capsys):
    path = tmp_path / "falls.toml"
    path.write_text(
        '[robot]\nurdf = "example-robot-data:ur5"\n[joints.elbow_joint]\nradial_clearance = 1e-4\n'
        '[integration]\nduration = "1 ms"\n[sweep.axes]\n'
        '"joints.elbow_joint.radial_clearance" = [0, 1e-4]\n'
    )
    assert main(["study", "sweep", str(path), "--out", str(tmp_path / "s"), "--jobs", "1"]) == 0
    first, warning, *_ = capsys.readouterr().out.splitlines()
    assert "2 cases" in first
    assert warning.startswith("warning: no motion and no drive: the arm falls (shoulder_lift")


@pytest.mark.parametrize(
    ("where", "said"),
    [
        ("jointplay.study.sweeps._enough", "12 of 12 cases are kept"),
        ("jointplay.study.open_sweep", "contains cases.sqlite"),
    ],
)
def test_interrupted_when_all_cases_are_stored_it_says_what_is_there(
    done, tmp_path, monkeypatch, capsys, where, said
):
    def interrupt(*_):
        raise KeyboardInterrupt

    store = tmp_path / "s"
    shutil.copytree(done[0], store)
    monkeypatch.setattr("jointplay.base.files.written", [])
    monkeypatch.setattr(where, interrupt)
    told = ["study", "sweep", str(done[1]), "--out", str(store), "--resume", "--quiet"]
    assert main(told) == 130
    words = capsys.readouterr().err
    assert said in words
    assert "nothing was written" not in words
