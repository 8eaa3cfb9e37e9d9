"""The command `jointplay study dynamics`: tiny runs of real mechanisms."""

import sqlite3
from contextlib import closing

import pytest

from jointplay import cli

QUICK = ["--leave-out", "1", "--keep", "3", "--records", "200", "--jobs", "1", "--quiet"]
CRANK = ["jointplay:slider_crank.toml", "--case", "0.5 mm", "--set", "integration.step=4 us"]


def dynamics(kind, out, *more, scenario=CRANK, quick=QUICK):
    return cli.main(
        ["study", "dynamics", scenario[0], kind, *scenario[1:], *quick, "--out", str(out), *more]
    )


SPEEDS = ["--vary", "motion.speeds.crank_pin=4000:5000:2 rpm"]


@pytest.mark.parametrize(
    ("kind", "more", "says"),
    [
        ("turns", [], "moment of crank_pin [N m]: largest"),
        ("bifurcation", SPEEDS, "of 2 values"),
        ("poincare", [], "the section"),
        ("lyapunov", [], "largest Lyapunov exponent"),
        ("lyapunov", SPEEDS, "2 of 2 runs computed now"),
        ("recurrence", [], "recurrence rate"),
        ("waterfall", SPEEDS, "2 of 2 runs computed now"),
        ("basin", ["--grid", "2"], "of the starts"),
    ],
)
@pytest.mark.usefixtures("checked_figures")
def test_each_kind_writes_its_table_and_figure(kind, more, says, tmp_path, capsys):
    assert dynamics(kind, tmp_path, *more) == 0
    assert says in capsys.readouterr().out
    head, *rows = (tmp_path / f"{kind}.csv").read_text().splitlines()
    assert head.startswith("value,message,")
    assert rows
    assert all(row.count(",") == head.count(",") for row in rows)
    assert (tmp_path / f"{kind}.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.thorough
def test_what_is_done_is_not_run_again_whoever_did_it_but_for_what_is_damaged(tmp_path, capsys):
    assert dynamics("bifurcation", tmp_path, *SPEEDS) == 0
    kept, table = tmp_path / "bifurcation.runs", tmp_path / "bifurcation.csv"
    rows = table.read_bytes()
    with closing(sqlite3.connect(kept)) as opened:  # other hands
        opened.execute("UPDATE cases SET found = replace(found, 'A', 'B') WHERE rowid = 2")
        opened.commit()
    assert dynamics("bifurcation", tmp_path, *SPEEDS, "--jobs", "2") == 0
    assert "1 of 2 runs computed now, 1 earlier" in capsys.readouterr().out
    assert table.read_bytes() == rows
    finer = ["--vary", "motion.speeds.crank_pin=4000:5000:3 rpm"]
    assert dynamics("bifurcation", tmp_path, *finer) == 0
    assert "1 of 3 runs computed now, 2 earlier" in capsys.readouterr().out
    assert dynamics("bifurcation", tmp_path, *SPEEDS, "--phase", "0.5") == 2
    assert "was made for something else (another phase)" in capsys.readouterr().err
    kept.write_text("mine")
    assert dynamics("bifurcation", tmp_path, *SPEEDS) == 2
    assert "is damaged or not a file of runs" in capsys.readouterr().err
    assert kept.read_text() == "mine"
    kept.unlink()
    assert dynamics("bifurcation", tmp_path, *SPEEDS) == 2
    assert "bifurcation.csv' is not of this analysis" in capsys.readouterr().err


def test_value_that_fails_is_kept_with_its_message_and_the_others_go_on(tmp_path, capsys):
    worst = ["--vary", "joints.piston_pin.radial_clearance=0.2:40:2 mm"]
    assert dynamics("bifurcation", tmp_path, *worst) == 0
    out = capsys.readouterr().out
    assert "failed at 40: " in out
    assert "of 1 values" in out


@pytest.mark.parametrize("name", ["four_bar", "scara"])
def test_other_mechanisms_have_sections_too(name, tmp_path, capsys):
    step = {"four_bar": "5 us", "scara": "15 us"}[name]
    scenario = [f"jointplay:{name}.toml", "--case", "0.2 mm", "--set", f"integration.step={step}"]
    quick = [*QUICK[:1], "0", "--keep", "1", *QUICK[4:]]
    assert dynamics("poincare", tmp_path, scenario=scenario, quick=quick) == 0
    assert "the section" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("kind", "more", "says"),
    [
        ("bifurcation", [], "bifurcation needs --vary KEY=FROM:TO:COUNT"),
        ("poincare", SPEEDS, "poincare takes no --vary"),
        ("bifurcation", ["--vary", "motion.speeds.crank_pin=1:2"], "--vary must read KEY="),
        ("poincare", ["--of", "guide.acceleraton", "--of", "guide.speed"], "guide.acceleration"),
        ("poincare", ["--phase", "1.5"], "--phase must be in [0, 1) turns, got 1.5"),
        ("turns", ["--keep", "0"], "keep must be a whole number >= 1, got 0"),
        ("basin", ["--joint", "guide"], "piston_pin"),
        ("bifurcation", ["--vary", "motion.speeds.crnk=1:2:3 rpm"], "crnk"),
        ("turns", ["--jobs", "0"], "jobs must be a whole number >= 1, got 0"),
    ],
)
def test_wrong_input_is_one_line(kind, more, says, tmp_path, capsys):
    assert dynamics(kind, tmp_path / "out", *more) == 2
    error = capsys.readouterr().err
    assert says in error
    assert error.count("\n") == 1
