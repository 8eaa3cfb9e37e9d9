"""What has changed between two measurements of the same machine."""

import importlib
import json
import math
import shlex
from dataclasses import replace

import numpy as np
import pytest

from jointplay import Gear, JointplayError, Mechanism
from jointplay.base.progress import ProgressBar
from jointplay.cli import main
from jointplay.estimate import least_squares
from jointplay.estimate.changes import changes
from jointplay.estimate.gauge import Readings, gauge_problems, identify_gauged
from jointplay.estimate.identification import identify_problem
from jointplay.estimate.measurement import Measurement

FORCES, ARM = np.array([0.0, 8.0, -8.0, 2.0, -2.0]), 0.1
JOINTS = ("shoulder_pan", "elbow_flex")
BEFORE, GROWN = (8e-3, 5e-3), (10e-3, 5e-3)
"""Plays of these joints [rad]."""


def read(plays, seed=0, stiffness=100.0):
    """Readings of joints whose teeth stiffen under load."""
    random, turned = np.random.default_rng(seed), []
    push = np.tile(ARM * FORCES, len(plays))
    for play in plays:
        bent = np.sign(FORCES) * (ARM * abs(FORCES) / stiffness) ** 0.9
        zero, noise = random.normal(), 1e-4 * random.normal(size=5)
        turned.append(zero + np.sign(FORCES) * play / 2.0 + bent + noise)
    names = tuple(name for name in JOINTS[: len(plays)] for _ in FORCES)
    n = len(push)
    return Readings(names, ("",) * n, push, np.ravel(turned), np.full(n, 1e-4))


def problems(plays, seed=0, **about):
    return gauge_problems(Mechanism("so101"), read(plays, seed, **about))


def test_a_change_is_told_where_values_are_not_yet_apart():
    found = changes(problems(BEFORE), problems(GROWN, seed=1))
    grown, still = (found[f"{name} gear play change"] for name in JOINTS)
    assert grown.low <= 2e-3 <= grown.high
    assert grown.low > 0.0
    assert still.low <= 0.0 <= still.high
    ends = [
        identify_gauged(Mechanism("so101"), read(plays, seed=k)).estimates[0]
        for k, plays in enumerate((BEFORE, GROWN))
    ]
    assert ends[0].high > ends[1].low  # by values nobody could tell
    assert ends[0].half_width > 3.0 * grown.half_width
    assert found["shoulder_pan gear play"].low <= 10e-3 <= found["shoulder_pan gear play"].high
    assert found.sentence.startswith("Play has grown in shoulder_pan by ")
    assert found.sentence.endswith("may be as it was in 1 of 2 joints")
    back = changes(problems(GROWN, seed=1), problems(BEFORE))
    assert back["shoulder_pan gear play change"].value == pytest.approx(-grown.value, rel=1e-3)
    less = changes(problems((14e-3, 5e-3), seed=1), problems(BEFORE))
    assert less.sentence.startswith("Play has become less in shoulder_pan by -")


def test_what_differs_from_one_measurement_to_the_other_is_not_taken_for_play():
    """Softer by a tenth, as is assumed: the interval holds no change."""
    found = changes(problems([5e-3]), problems([5e-3], seed=1, stiffness=90.0))
    (_, change) = found.estimates
    assert change.low <= 0.0 <= change.high
    assert found.sentence == "Play may be as it was in 1 of 1 joint"
    assert "compliances differ by 10 %" in str(found)


@pytest.mark.thorough
def test_intervals_hold_changes_of_joints_by_another_model_and_tell_growth_of_few_that_have_none():
    made = importlib.import_module("truth.gauge")
    robot, random = Mechanism("so101"), np.random.default_rng(77)
    held, told = 0, [0, 0]
    for k in range(100):
        plays, seen = made.joint(random, grown=made.GROWN * (k % 2))
        (_, change) = changes(*(gauge_problems(robot, one) for one in seen)).estimates
        held += change.low <= plays[1] - plays[0] <= change.high
        told[k % 2] += change.low > 0.0
    assert held >= 90
    assert told[0] <= 4
    assert told[1] >= 15


def lagging(path, play, seed):
    """Motor, link and torque of a joint whose link trails."""
    time = np.arange(0.0, 12.0, 0.01)
    angle = 0.4 - np.abs((0.2 * time) % 1.6 - 0.8)
    link, trail = angle.copy(), play / 2.0 + 0.5 / 1e3
    for i in range(1, len(angle)):
        link[i] = min(max(link[i - 1], angle[i] - trail), angle[i] + trail)
    random = np.random.default_rng(seed)
    torque = np.sign(angle - link) * np.clip(abs(angle - link) * 1e3 - play / 2.0 * 1e3, 0.0, None)
    signals = {
        ("motor", "shoulder_pan"): angle,
        ("link", "shoulder_pan"): link + random.normal() + 2e-5 * random.normal(size=len(time)),
        ("torque", "shoulder_pan"): torque + 0.02 * random.normal(size=len(time)),
    }
    path.write_text(Measurement(time, signals).csv())
    return path


def test_motions_are_compared_like_readings(tmp_path):
    robot = Mechanism("so101", gears={"shoulder_pan": Gear(1e-3, 0.1, 1e3)})
    both = [
        [identify_problem(robot, path, known=["gear_compliance"])]
        for path in (
            lagging(tmp_path / f"{k}.csv", 2e-3 + 1e-4 * k, seed=k) for k in range(2)
        )
    ]  # fmt: skip
    change = changes(*both)["shoulder_pan gear play change"]
    assert change.low <= 1e-4 <= change.high
    assert change.half_width < 1e-4


def table(path, plays, seed=0):
    one = read(plays, seed)
    rows = zip(one.joint, one.push / ARM, one.turned, strict=True)
    lines = ["joint,force [N],arm [mm],angle [deg]"]
    lines += [f"{name},{force:g},100,{math.degrees(turn):.6f}" for name, force, turn in rows]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_the_command_compares_two_measurements_in_either_order_of_its_words(tmp_path, capsys):
    old, new = table(tmp_path / "old.csv", BEFORE), table(tmp_path / "new.csv", GROWN, seed=1)
    order, out = ["identify", "so101", "--noise", "link=1e-4"], tmp_path / "out"
    assert main([*order, "--against", str(old), str(new), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert said.startswith("Play has grown in shoulder_pan by")
    rows = json.loads((out / "changes.json").read_text())["unknowns"]
    assert [one["quantity"] for one in rows] == 2 * ["gear_play", "gear_play change"]
    assert 0.0 < rows[1]["low"] <= 2e-3 <= rows[1]["high"]
    assert {one.name for one in out.iterdir()} == {"changes.csv", "changes.json"}
    assert main([*order, str(new), "--against", str(old)]) == 0
    assert capsys.readouterr().out == said.rpartition("written to")[0]


def test_the_command_shows_how_far_its_searches_are(tmp_path, monkeypatch, capsys):
    class AtOnce(ProgressBar):
        def __init__(self, *given, **shown):
            super().__init__(*given, **shown | {"delay": 0.0})

    monkeypatch.setenv("JOINTPLAY_PROGRESS_S", "0")
    monkeypatch.setattr(least_squares, "ProgressBar", AtOnce)
    old, new = (table(tmp_path / f"{k}.csv", [5e-3], seed=k) for k in range(2))
    order = ["identify", "so101", "--noise", "link=1e-4", "--against", str(old), str(new)]
    assert main(order) == 0
    said = capsys.readouterr().err
    assert said.count("least squares 100%") == 2  # both together, and the second
    assert main([*order, "--quiet"]) == 0
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ("--against {old}", "give a measurement"),
        ("--against {old} {folder}/none.csv", "there is no file"),
        ("--against {old} {moving}", "is a table of a dial gauge, and"),
        ("--against {old} {old} --write-preset {folder}/my.toml", "--write-preset is of one"),
        ("--against {old} --plan dial", "--plan is for a measurement to come"),
        ("--against {old} {old} --lag 0", "--lag is not for a dial gauge"),
        ("{old} {old} {old}", "unrecognized arguments"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(tmp_path, capsys, options, said):
    places = {"folder": tmp_path, "old": table(tmp_path / "old.csv", BEFORE)}
    places["moving"] = lagging(tmp_path / "moving.csv", 2e-3, 0)
    try:
        status = main(["identify", "so101", *shlex.split(options.format(**places))])
    except SystemExit as refused:
        status = refused.code
    err = capsys.readouterr().err
    assert status == 2
    assert said in err
    assert err.count("\n") == 1


def test_measurements_of_different_things_are_not_compared():
    one, both = problems([8e-3]), problems(BEFORE)
    with pytest.raises(JointplayError, match="no play was measured both times"):
        changes(one, both[1:])
    found = changes(one, both)
    assert "elbow_flex" in found.notes[0]
    assert "measured once" in found.notes[0]
    other = [replace(both[0], labels=("other", "labels"))]
    with pytest.raises(JointplayError, match="compare likes"):
        changes(one, other)
