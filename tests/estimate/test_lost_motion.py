"""Moves forth and back under a dial: the motion that is lost, and what hides it."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jointplay import JointplayError, Mechanism, shipped
from jointplay.bridges import backlash
from jointplay.cli import main
from jointplay.estimate.lost_motion import (
    Stairs,
    identify_lost_motion,
    links,
    plan_lost_motion,
)
from jointplay.model.gear import Gear

GANTRY = "jointplay:gantry.urdf"


@pytest.fixture(scope="module")
def gantry():
    return Mechanism(shipped("gantry.urdf"))


def measured(gantry, lost, scale=1.0, drift=0.0, scatter=0.0, joint="x", seed=0):
    """Readings of the plan's moves by the play operator itself."""
    moves = plan_lost_motion(gantry, [joint]).moves(joint)
    motor = np.array([place for place, _ in moves])
    n = len(motor)
    reading = 0.3e-3 + scale * links(motor, lost, -1.0) + np.linspace(0.0, drift, n)
    reading += scatter * np.random.default_rng(seed).normal(size=n)
    reading[[not read for _, read in moves]] = np.nan
    return Stairs((joint,) * n, ("",) * n, motor, reading)


@settings(max_examples=15, deadline=None)
@given(lost=st.floats(2e-5, 3e-4), scale=st.floats(0.95, 1.05), drift=st.floats(-5e-5, 5e-5))
def test_lost_motion_is_told_apart_from_scale_and_drift(gantry, lost, scale, drift):
    found = identify_lost_motion(gantry, measured(gantry, lost, scale, drift, 1e-6))
    (one,) = found.estimates
    assert one.known
    assert one.low <= lost <= one.high
    assert one.value == pytest.approx(lost, abs=5e-6)


def test_no_lost_motion_has_a_bound_and_no_interval(gantry):
    (one,) = identify_lost_motion(gantry, measured(gantry, 0.0, scatter=2e-6)).estimates
    assert one.bounded
    assert one.upper < 1e-5


def test_a_slip_of_the_pen_is_left_out_and_said(gantry):
    stairs = measured(gantry, 1e-4, scatter=1e-6)
    stairs.reading[4] += 5e-4
    found = identify_lost_motion(gantry, stairs)
    assert found.estimates[0].value == pytest.approx(1e-4, abs=5e-6)
    assert "left out: move 5" in found.notes[0]


def test_a_machine_that_warms_up_within_its_first_moves_has_its_first_readings_kept(gantry):
    stairs = measured(gantry, 8e-5, scatter=1e-6)
    warm = 1e-4 * np.exp(-np.arange(len(stairs.motor)) / 1.5)
    found = identify_lost_motion(gantry, replace(stairs, reading=stairs.reading + warm, step=1e-6))
    (one,) = found.estimates
    assert one.low <= 8e-5 <= one.high
    assert one.high - one.low < 1e-5
    assert not any("left out" in note for note in found.notes)


def test_a_coarse_dial_read_twice_at_a_place_tells_no_more_than_once(gantry):
    one = measured(gantry, 8e-5)
    reading = 1e-5 * np.round(one.reading / 1e-5)
    step, no_step = (
        identify_lost_motion(gantry, replace(one, reading=reading, step=size), scatter=3e-6)
        for size in (1e-5, 0.0)
    )
    assert step.estimates[0].half_width > 1.2 * no_step.estimates[0].half_width


def test_weight_beyond_friction_hides_play_and_says_on_which_side(gantry):
    """The lift weighs 29 N, its file's friction is 2 N: without lost motion nothing is told."""
    stairs = measured(gantry, 0.0, scatter=1e-6, joint="z")
    found = identify_lost_motion(gantry, stairs, pose={"x": 0.1})
    assert "gravity loads it by 29.4 N towards minus" in found.estimates[0].reason
    assert "balance the weight" in found.estimates[0].advice
    assert not found.plays


def test_friction_is_said_to_wind_the_gear_up():
    gear = Gear(1e-4, 1.0, 1e6, 10.0)
    robot = Mechanism(shipped("gantry.urdf"), gears={"x": gear})
    found = identify_lost_motion(robot, measured(robot, 1.08e-4, scatter=1e-6))
    assert any("of this, 8 µm is the gear of x giving way" in note for note in found.notes)


def test_all_from_one_side_is_refused(gantry):
    motor = np.linspace(0.0, 1e-3, 8)
    stairs = Stairs(("x",) * 8, ("",) * 8, motor, motor.copy())
    with pytest.raises(JointplayError, match="each come to from both sides"):
        identify_lost_motion(gantry, stairs)


def test_firmware_gets_what_was_measured(gantry):
    reversals = backlash.Reversals.of(gantry, {"x": 3.6e-5, "z": 1.2e-4})
    texts = {
        name: backlash.tables(reversals, name) for name in backlash.FORMATS if name != "fluidnc"
    }
    assert texts["marlin"]["marlin.gcode"].endswith("M425 F1.0 X0.0360 Z0.1200\n")
    assert texts["linuxcnc"]["linuxcnc.ini"].startswith("[JOINT_0]\nBACKLASH = 0.0360\n[JOINT_2]")
    assert texts["grblhal"]["grblhal.txt"] == "$160=0.0360\n$162=0.1200\n"
    assert "gamma_backlash_mm 0.1200" in texts["smoothieware"]["smoothieware.txt"]
    assert "x_backlash: 0.0360" in texts["klipper"]["klipper.cfg"]


def test_from_the_plan_to_firmware_and_preset(tmp_path, capsys):
    plan, out = tmp_path / "plan", tmp_path / "out"
    assert main(["identify", GANTRY, "--plan", "lost-motion", "--gear", "x=0.1 mm",
                 "--out", str(plan)]) == 0  # fmt: skip
    assert "M0 ; x" in (plan / "lost_motion.gcode").read_text()
    head, note, *rows = (plan / "lost_motion.csv").read_text().splitlines()
    assert note.startswith("# rows 1, 7, 13, 19, 25 of x only turn back")
    motor = np.array([float(row.split(",")[1]) for row in rows])
    read = links(motor, 0.08, -1.0)
    table = tmp_path / "read.csv"
    table.write_text("\n".join([head, *(f"{r}{x:.3f}" for r, x in zip(rows, read, strict=True))]))
    preset = tmp_path / "mine.toml"
    command = ["identify", GANTRY, str(table), "--formats", "marlin,fluidnc", "--json"]
    assert main([*command, "--write-preset", str(preset), "--out", str(out)]) == 0
    said, _ = capsys.readouterr()
    answer = json.loads(said[said.index("{") :])
    (one,) = answer["unknowns"]
    assert one["low"] <= 8e-5 <= one["high"]
    assert any("no file for fluidnc" in note for note in answer["notes"])
    sent = float((out / "marlin.gcode").read_text().split("X")[-1])
    assert sent == pytest.approx(0.08, abs=1e-3)
    assert main(["budget", GANTRY, "--preset", str(preset)]) == 0
    assert re.search(r"up to 0\.(0399|04) mm off .* all of it by x", capsys.readouterr().out)


@pytest.mark.parametrize(("unit", "size"), [("mm", 8e-5), ("deg", np.radians(0.08))])
def test_axes_without_a_robot_have_all_but_weight(tmp_path, capsys, unit, size):
    motor = np.array([*range(6), *range(4, -1, -1), *range(1, 6), *range(4, -1, -1)], float)
    rows = [f"e,{m:g},{x:.3f}" for m, x in zip(motor, links(motor, 0.08, -1.0), strict=True)]
    table, out = tmp_path / "stairs.csv", tmp_path / "out"
    table.write_text("\n".join([f"joint,motor [{unit}],reading [{unit}]", *rows]))
    assert main(["identify", str(table), "--formats", "linuxcnc", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "tell the lost motion of 1 of 1 joint: e " in said
    assert "note: without a robot weight is left out" in said
    assert "0.08" in (out / "linuxcnc.ini").read_text()
    (one,) = json.loads((out / "identified.json").read_text())["unknowns"]
    assert one["low"] <= size <= one["high"]
    for option in (["--gear", "e=0.1 mm"], ["--pose", "e=1"], ["--write-preset", "mine.toml"]):
        assert main(["identify", str(table), *option]) == 2
        assert f"{option[0]} is of a robot" in capsys.readouterr().err
    table.write_text("joint,force [N],reading [mm]\ne,0,0\n")
    assert main(["identify", str(table)]) == 2
    assert "name the robot before it" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ("joint,motor [mm],reading [mm]\ny,0,0\n", "no joint 'y'"),
        ("joint,motor [mm],reading [mm]\nx,,0\n", "move 1 has no motor position"),
        ("joint,motor [mm],reading [mm]\nx,0,0\n", "needs 6 readings at two places"),
        ("joint,motor [mm],reading [mm]\nx,0,\nx,1,\n", "no reading is filled in"),
        (
            "joint,motor [mm],reading [mm]\n" + "x,0,5\nx,1,5\nx,2,5\nx,1,5\n" * 2,
            "x: all readings are the same",
        ),
        ("joint,motor [mm],dial [mm]\nx,0,0\n", "column 'dial [mm]' is unknown"),
    ],
)
def test_wrong_tables_are_refused_in_a_line(tmp_path, capsys, table, said):
    path = tmp_path / "a.csv"
    path.write_text(table)
    assert main(["identify", GANTRY, str(path)]) == 2
    assert said in capsys.readouterr().err


def test_a_turning_joint_is_read_in_mm_at_an_arm_or_in_degrees(tmp_path, capsys):
    motor = np.array([0, 1, 2, 3, 4, 3, 2, 1, 0, 1, 2, 3, 4, 3, 2, 1], float)
    pairs = [*zip(motor, links(motor, 0.5, -1.0), strict=True)]
    rows = [f"joint_1,{m:g},{1e2 * np.radians(x):.4f},100" for m, x in pairs]
    path = tmp_path / "arm.csv"
    path.write_text("\n".join(["joint,motor [deg],reading [mm],gauge arm [mm]", *rows]))
    assert main(["identify", "ar4", str(path)]) == 0
    by_arm = capsys.readouterr().out
    rows = [f"joint_1,{m:g},{x:.4f}" for m, x in pairs]
    path.write_text("\n".join(["joint,motor [deg],reading [deg]", *rows]))
    assert main(["identify", "ar4", str(path)]) == 0
    for said in (by_arm, capsys.readouterr().out):
        assert "tell the lost motion of 1 of 1 joint: joint_1 8." in said


def test_a_fine_dial_on_long_moves_has_an_interval_that_is_no_step_of_the_search(gantry):
    """6 mm of travel, a dial of 1 µm: the profile must be found finer than the interval is wide."""
    held = 0
    for seed in range(12):
        stairs = measured(gantry, 1e-4)
        motor = stairs.motor * 2.0
        lost = 1e-4 + 3.7e-7 * seed
        reading = 0.3e-3 + links(motor, lost, -1.0)
        reading += 3e-7 * np.random.default_rng(seed).normal(size=len(motor))
        reading = 1e-6 * np.round(reading / 1e-6)
        reading[np.isnan(stairs.reading)] = np.nan
        fine = Stairs(stairs.joint, stairs.setup, motor, reading, step=1e-6)
        (one,) = identify_lost_motion(gantry, fine).estimates
        held += one.low <= lost <= one.high
    assert held >= 11


def test_joints_that_turn_and_joints_that_slide_are_named():
    scara = Mechanism("scara", {})
    with pytest.raises(JointplayError) as refusal:
        plan_lost_motion(scara, [])
    text = str(refusal.value)
    assert "turn (joint_a, joint_b, joint_c) or slide (stroke), not both" in text
    assert "--gear NAME" in text
