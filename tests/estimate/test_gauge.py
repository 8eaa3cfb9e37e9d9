"""A dial gauge and five pushes: play of single joints, or why it cannot be told."""

import csv
import importlib
import json
import math
import re
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint, tip
from hypothesis import given, settings
from hypothesis import strategies as st

import jointplay as jp
from jointplay import JointplayError, Mechanism
from jointplay.cli import main
from jointplay.estimate.gauge import Readings, identify_gauged, plan_gauge
from jointplay.estimate.visits import tool_positions
from jointplay.model.gear import Gear
from jointplay.scenario.presets import preset
from jointplay.show.plots.design import reversal_loops

ARM, HALF_DEGREE = 0.1, math.radians(0.5)
FORCES = (0.0, 8.0, -8.0, 2.0, -2.0)
THREE = (*FORCES, 0.8, -0.8)


@pytest.fixture
def arm(urdf):
    """A joint about z, which gravity does not load, and one that slides."""
    return Mechanism(
        urdf(
            body("arm", mass=1.0, com="0.1 0 0"),
            joint("j", "base", "arm"),
            body("slide", mass=1.0),
            joint("x", "arm", "slide", kind="prismatic", axis="1 0 0", at="0.2 0 0"),
            tip("slide"),
        )
    )


def read(play=HALF_DEGREE, stiffness=100.0, forces=FORCES, name="j", noise=0.0):
    push = ARM * np.array(forces)
    turned = 0.02 + np.sign(push) * play / 2.0 + push / stiffness
    turned = turned + noise * np.random.default_rng(0).normal(size=len(push))
    n = len(push)
    return Readings((name,) * n, ("",) * n, push, turned, np.full(n, 1e-4))


def table(path, head="joint,force [N],arm [mm],reading [mm],gauge arm [mm]", readings=None):
    one = read() if readings is None else readings
    rows = [
        f"{name},{push / ARM:.6g},100,{1e3 * 0.05 * turned:.6f},50"
        for name, push, turned in zip(one.joint, one.push, one.turned, strict=True)
    ]
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


@settings(max_examples=25, deadline=None)
@given(play=st.floats(1e-3, 3e-2), stiffness=st.floats(50.0, 1e4), zero=st.floats(-1.0, 1.0))
def test_five_exact_readings_hold_the_truth(play, stiffness, zero):
    robot = Mechanism("so101")
    one = read(play, stiffness, name="shoulder_pan")
    one = Readings(one.joint, one.setup, one.push, one.turned + zero, one.error)
    found, soft = identify_gauged(robot, one).estimates
    low, high = (0.0, found.upper) if found.bounded else found.interval
    assert low <= play <= high
    assert soft.low <= 1.0 / stiffness <= soft.high


def test_play_of_the_full_model_is_read_off_its_motion(arm):
    """The engine's own gear, servo-held, pushed at the tool; the gauge sees the link."""
    gear = Gear(play=8e-3, rotor_inertia=0.05, stiffness=4000.0, damping=5.0)
    robot = Mechanism(arm.description.path, gears={"j": gear}, tool="tool")
    times, forces = [0.0], [(0.0, 0.0, 0.0)]
    for number, force in enumerate(THREE):
        times += [number + 0.2, number + 1.0]
        forces += [(0.0, force, 0.0)] * 2
    push = jp.loads.WrenchOverTime(frame="tool", times=tuple(times), forces=tuple(forces))
    motion = jp.Motion(["j", "x"], [0.0, 7.0], [[0.0, 0.0]] * 2)
    result = jp.simulate(
        robot, motion=motion, drive=jp.loads.ComputedTorque(encoder="motor"), loads={"push": push}
    )
    at = np.searchsorted(result.time, np.arange(1.0, 7.5) - 0.01)
    q = result["q"].values[at]
    turned = q[:, robot.coordinate("j")] - q[:, robot.motor("j")]
    n, lever = len(THREE), tool_positions(robot, ["j"], np.zeros((1, 1)))[0, 0]
    one = Readings(("j",) * n, ("",) * n, lever * np.array(THREE), turned, np.full(n, 1e-5))
    found = identify_gauged(robot, one)
    assert found["j gear play"].low <= 8e-3 <= found["j gear play"].high
    assert found["j gear play"].half_width < 2e-3
    assert found["j gear compliance"].value == pytest.approx(1.0 / 4000.0, rel=0.1)


@pytest.mark.parametrize(
    "encoder",
    [
        pytest.param(False, id="gauge"),
        pytest.param(True, id="the servo's own encoder", marks=pytest.mark.thorough),
    ],
)
def test_the_benchmarks_joints_are_held_by_their_intervals(encoder):
    made = importlib.import_module("truth.gauge")
    robot, random, held = Mechanism("so101"), np.random.default_rng(99), 0
    for _ in range(40):
        (play,), (one,) = made.joint(random, encoder)
        told = identify_gauged(robot, one).estimates[0]
        low, high = (0.0, told.upper) if told.bounded else told.interval
        held += low <= play <= high
    assert held >= 36


def test_readings_that_are_all_one_count_bound_the_play(arm, tmp_path):
    table = tmp_path / "counts.csv"
    rows = [f"j,{push},0.088" for push in (0.0, 0.2, 0.08, -0.2, -0.08)]
    table.write_text("\n".join(["joint,torque [N*m],angle [deg]", *rows]) + "\n")
    found = identify_gauged(arm, table)["j gear play"]
    assert found.bounded
    assert 1e-4 < found.upper < np.radians(0.5)


def test_a_joint_without_play_is_told_to_have_little(arm):
    found = identify_gauged(arm, read(0.0, noise=1e-4))["j gear play"]
    assert found.bounded
    assert found.upper < 6e-3  # beside a wind-up of 8 mrad
    assert "none told; at most" in found.cells()[1]


@pytest.mark.parametrize(
    "forces", [FORCES[:3], (0.0, 8.0, 2.0, 4.0, 6.0), (0.0, 8.0, -8.0, 7.0, -7.0)]
)
def test_too_little_says_the_least_recipe(arm, forces):
    with pytest.raises(JointplayError, match=r"j: needed are five readings.*two forces"):
        identify_gauged(arm, read(forces=forces))


def test_a_table_without_a_column_of_joints_is_refused(tmp_path):
    path = table(tmp_path / "readings.csv", "Joint,force [N],arm [mm],reading [mm],gauge arm [mm]")
    with pytest.raises(JointplayError, match="has no column 'joint'; columns are: joint, setup"):
        Readings.from_csv(path, {"j": False})


def test_gravity_that_holds_the_joint_is_said(urdf):
    robot = Mechanism(
        urdf(
            body("arm", mass=20.0, com="0.1 0 0"),
            joint("j", "base", "arm", axis="0 1 0"),
            tip("arm"),
        )
    )
    told = identify_gauged(robot, read(), pose={"j": 0.0})
    assert "gravity loads it by 19.6 N m, more than the smallest push, 0.2 N m" in str(told)
    assert told["j gear play"].reason
    # Nobody says in which pose: what play shows is told, that none shows is not.
    told = identify_gauged(robot, read(stiffness=1e3))
    assert not told["j gear play"].reason
    assert "note: gravity may load j by" in str(told)
    told = identify_gauged(robot, read(0.0))
    assert told["j gear play"].reason
    assert "say in which pose it was" in str(told)
    assert not identify_gauged(robot, read(), pose={"j": math.pi / 2})["j gear play"].reason


def test_a_gauge_that_slipped_is_said(arm):
    one = read()
    one.turned[0] += 0.02
    assert "reading 1, which is not pushed, lies beyond both sides of j" in str(
        identify_gauged(arm, one)
    )


def test_what_the_motor_gives_way_is_taken_off(arm, tmp_path):
    one = read()
    head = "joint,force [N],arm [mm],angle [deg],motor [deg]"
    rows = []
    for push, turned in zip(one.push, one.turned, strict=True):
        link, motor = np.degrees([turned + 0.01 * push, -0.01 * push])
        rows.append(f"j,{push / ARM:g},100,{link:.6f},{motor:.6f}")
    path = tmp_path / "d.csv"
    path.write_text("\n".join([head, *rows]) + "\n")
    found = Readings.from_csv(path, {"j": False}, {"link": 1e-4})
    assert np.diff(found.turned) == pytest.approx(np.diff(one.turned), abs=1e-7)


def test_a_joint_that_slides_is_read_along_its_way(arm, tmp_path):
    push = np.array(FORCES)
    way = 1e-3 + np.sign(push) * 2.5e-5 + push / 1e6
    rows = [f"x,{f:g},{1e3 * y:.6f}" for f, y in zip(push, way, strict=True)]
    path = tmp_path / "x.csv"
    path.write_text("\n".join(["joint,force [N],reading [mm]", *rows]) + "\n")
    found = identify_gauged(arm, path, noise={"tool": 1e-6})["x gear play"]
    assert found.low <= 5e-5 <= found.high
    assert "µm" in found.cells()[0]


@pytest.mark.usefixtures("checked_figures")
def test_the_command_plans_reads_writes_and_hands_on(arm, tmp_path, capsys):
    robot, out = str(arm.description.path), tmp_path / "plan"
    order = ["identify", robot, "--tool", "tool"]
    assert main([*order, "--plan", "dial", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "forces 0, +20 N, -20 N, +8 N, -8 N, +3 N, -3 N" in said
    assert "2. x: gauge and push along its way" in said
    assert (out / "dial.csv").read_text().count("\nj,") == 7
    path = table(tmp_path / "dial.csv", readings=read(stiffness=200.0, forces=THREE))
    own, found = tmp_path / "my.toml", tmp_path / "found"
    more = ["--write-preset", str(own), "--out", str(found)]
    assert main([*order[:2], str(path), *order[2:], *more]) == 0
    said = capsys.readouterr().out
    assert said.startswith("The readings tell the play of 1 of 1 joint: j")
    assert preset(own).mechanism(tool="tool").gears["j"].play == pytest.approx(HALF_DEGREE, rel=0.2)
    rows = json.loads((found / "identified.json").read_text())["unknowns"]
    assert rows[0]["low"] < HALF_DEGREE < rows[0]["high"]
    assert {one.name for one in found.iterdir()} == {
        "identified.csv", "identified.json", "loops.png"
    }  # fmt: skip
    low, high = preset(own).intervals["j", "gear_play"]
    assert (low, high) == pytest.approx((rows[0]["low"], rows[0]["high"]))
    soft = preset(own).intervals["j", "gear_compliance"]
    assert soft == pytest.approx((rows[1]["low"], rows[1]["high"]))
    # What it leads to keeps the interval: the budget is told at both ends.
    budget = ["budget", robot, "--tool", "tool", "--pose", "j=0"]
    assert main([*budget, "--preset", str(own)]) == 0
    said = capsys.readouterr().out
    assert "j (gear)" in said
    ends = re.search(r"at the ends of their 95 % intervals: worst case (.*) to (.*) mm", said)
    for play, end in zip((low, high), ends.groups(), strict=True):
        assert main([*budget, "--gear", f"j={play!r} rad"]) == 0
        assert f"{float(end):.3g}" in capsys.readouterr().out


def test_the_reversal_loop_has_all_readings_and_the_play_as_its_step(arm):
    first, other = read(stiffness=400.0), read(1e-3, stiffness=400.0)
    both = [np.concatenate([getattr(one, k) for one in (first, other)]) for k in ("push", "error")]
    turned = np.concatenate([first.turned, first.turned + 0.3])
    setups = ("a",) * 5 + ("b",) * 5
    found = identify_gauged(arm, Readings(("j",) * 10, setups, both[0], turned, both[1]))
    (loop,) = found.loops
    seen = np.isfinite(loop.measured)
    assert seen.sum() == 10
    pushed = seen & (loop.branch != 0)
    assert loop.measured[pushed] == pytest.approx(loop.fitted[pushed], abs=1e-6)
    assert np.isnan(loop.fitted[loop.branch == 0]).all()
    assert loop.measured[loop.branch == 0] == pytest.approx(0.0, abs=1e-6)
    step = loop.fitted[~seen] @ loop.branch[~seen]
    assert step == pytest.approx(found["j gear play"].value, rel=1e-3)
    figure = reversal_loops(found.loops * 4, found.estimates)
    first_axes, *_, last = figure.axes
    dots = sum(len(line.get_xdata()) for line in first_axes.lines if line.get_marker() == "o")
    assert dots == 10
    assert "mrad" in first_axes.get_title()
    assert not last.axison  # four in two rows of three


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("arm [mm]", "arm"), "has no unit"),
        (("arm [mm]", "arms [mm]"), "'arms [mm]' is unknown"),
        (("\nj,", "\nk,"), "no joint 'k'"),
        (("\nj,8,100,", "\nj,8,,"), "reading 2 has no force and arm, or torque"),
        (("\nj,0,100", "\nj,zero,100"), "line 2: 'force [N]' must be a number, got 'zero'"),
        (("\nj,0,", "\nx,0,"), "joints that slide need a file of their own"),
    ],
)
def test_tables_that_cannot_be_are_refused(arm, tmp_path, capsys, change, said):
    path = table(tmp_path / "dial.csv")
    path.write_text(path.read_text().replace(*change))
    assert main(["identify", str(arm.description.path), str(path), "--tool", "tool"]) == 2
    err = capsys.readouterr().err
    assert said in err
    assert err.count("\n") == 1


@pytest.mark.parametrize("option", ["--known friction", "--known-stiffness all=inf", "--lag 0"])
def test_options_of_motions_are_refused(arm, tmp_path, capsys, option):
    path = table(tmp_path / "dial.csv")
    order = ["identify", str(arm.description.path), str(path), "--tool", "tool"]
    assert main([*order, *option.split()]) == 2
    assert f"{option.split()[0]} is not for a dial gauge" in capsys.readouterr().err


def test_plans_of_arms_that_people_have():
    for name in ("so101", "ur5", "scara"):
        steps = plan_gauge(Mechanism(name)).steps
        assert len(steps) == len(Mechanism(name).joints)
        assert all(max(one.forces) > 0.0 for one in steps)
    with pytest.raises(JointplayError, match="no joint that moves 'knee'"):
        plan_gauge(Mechanism("so101"), ["knee"])


@pytest.mark.thorough
@pytest.mark.needs("mujoco")
def test_the_play_found_is_a_dead_band_in_mujoco(tmp_path, capsys):
    import mujoco

    one, path, out = (
        read(name="shoulder_lift", forces=THREE),
        tmp_path / "dial.csv",
        tmp_path / "found.xml",
    )
    table(path, readings=one)
    order = ["identify", "so101", str(path), "--quiet"]
    assert main([*order, "--mjcf", str(out)]) == 0
    assert f"written: {out}: play of shoulder_lift" in capsys.readouterr().out
    model = mujoco.MjModel.from_xml_path(str(out))
    band = model.tendon_lengthspring[model.tendon("shoulder_lift.play").id]
    assert band[1] - band[0] == pytest.approx(HALF_DEGREE, rel=0.2)
    assert main([*order, "--urdf", str(tmp_path / "found.urdf")]) == 2
    assert "a URDF cannot say a gear's play: --mjcf" in capsys.readouterr().err
    assert main(["identify", "so101", "--plan", "dial", "--mjcf", str(tmp_path / "n.xml")]) == 2
    assert "--mjcf needs a measurement, not --plan" in capsys.readouterr().err


def drawn(random, law, forces):
    """Readings of teeth whose wind-up, up to four times the play, is no power but for the first."""
    play = random.uniform(1e-3, 1.5e-2)
    part = np.abs(forces) / np.abs(forces).max()
    if law == "power":
        wound = part ** random.uniform(0.5, 0.8)
    elif law == "steps":
        knee, later = random.uniform(0.1, 0.5), random.uniform(0.3, 1.0)
        wound = np.minimum(part, knee) + later * np.maximum(part - knee, 0.0)
        wound /= knee + later * (1.0 - knee)
    else:
        wound = np.log1p(random.uniform(1.0, 8.0) * part)
        wound /= wound.max()
    side, n = np.sign(forces), len(forces)
    turned = side * (play / 2.0 + play * random.uniform(0.3, 4.0) * wound)
    turned += 1e-4 * random.normal(size=n)
    push = ARM * np.array(forces)
    return play, Readings(("j",) * n, ("",) * n, push, turned, np.full(n, 1e-4))


def test_each_joint_is_judged_in_the_pose_of_the_plan(tmp_path, capsys):
    """Gravity holds an SO-101's shoulder, without play that would show, but not in that pose."""
    assert main(["identify", "so101", "--plan", "dial", "--out", str(tmp_path / "plan")]) == 0
    rows = list(csv.DictReader((tmp_path / "plan" / "dial.csv").read_text().splitlines()))
    for row in rows:
        force = float(row["force [N]"])
        row["reading [mm]"] = f"{5.0 + 0.02 * force:.4f}"
    path = tmp_path / "dial.csv"
    for kept, said in ((list(rows[0]), "of 6 of 6 joints"), (list(rows[0])[:-1], "of 3 of 6")):
        with path.open("w") as file:
            writer = csv.DictWriter(file, kept, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)
        capsys.readouterr()
        assert main(["identify", "so101", str(path)]) == 0
        assert capsys.readouterr().out.startswith(f"The readings tell the play {said}")


def test_poses_pushes_and_angles_that_cannot_be_are_doubted(tmp_path, capsys):
    path, order = tmp_path / "dial.csv", ["identify", "so101", str(tmp_path / "dial.csv")]

    def told(angle="deg", torque=1.0, pose="gripper=10 deg"):
        pairs = ((0, 0), (torque, 1), (-torque, -1), (0.2, 0.6), (-0.2, -0.6))
        rows = [f"gripper,{push},{turned},{pose}" for push, turned in pairs]
        path.write_text("\n".join([f"joint,torque [N*m],angle [{angle}],pose", *rows]) + "\n")
        status, said = main(order), capsys.readouterr()
        return status, said.out + said.err

    assert "no joint 'knee'" in told(pose="knee=0")[1]
    assert '"5 mm" is not an angle' in told(pose="gripper=5 mm")[1]
    assert "warning" not in told()[1]
    assert "no gear has so much play as gripper" in told("rad")[1]
    assert "beyond its limit of effort" in told(torque=1000.0)[1]


@pytest.mark.parametrize("forces", [FORCES, THREE])
@pytest.mark.parametrize("law", ["power", "steps", "logarithm"])
def test_teeth_that_stiffen_by_laws_of_their_own_are_held_by_the_interval(arm, law, forces):
    random, missed = np.random.default_rng(3), []
    for _ in range(15):
        play, one = drawn(random, law, forces)
        told = identify_gauged(arm, one)["j gear play"]
        low, high = (0.0, told.upper) if told.bounded else told.interval
        if not low <= play <= high:
            missed.append(max(low - play, play - high) / (high - low))
    assert len(missed) <= 1
    assert max(missed, default=0.0) < 0.25


def test_two_forces_that_do_not_tell_ask_for_a_third(arm):
    third = "push with a third one, as far below 0.2 N m"
    assert third in str(identify_gauged(arm, read(stiffness=50.0)))
    assert third not in str(identify_gauged(arm, read(stiffness=50.0, forces=THREE)))
    assert third not in str(identify_gauged(arm, read(stiffness=1000.0)))


def test_a_push_of_the_wrong_sign_is_doubted(arm):
    with pytest.raises(JointplayError, match=r"has one of them the wrong sign"):
        identify_gauged(arm, replace(read(), push=-read().push))
    push = read().push
    push[-1] *= -1.0
    assert "has a push the wrong sign" in str(identify_gauged(arm, replace(read(), push=push)))


def test_readings_that_are_none_and_plans_that_are_none_are_refused(arm, tmp_path, capsys):
    order = ["identify", str(arm.description.path), "--tool", "tool"]
    path = table(tmp_path / "dial.csv")
    text = path.read_text()
    for changed, said in (
        (text.replace("reading [mm]", "reading [m]"), "which no gauge follows"),
        (text.replace(",arm [mm]", ",arm [m]"), "the arm is 100 m long, longer than any robot"),
        (text.replace("gauge arm [mm]", "gauge arm [m]"), "the gauge arm is 50 m long"),
        (text.splitlines()[0] + "\n", "has no readings: needed are five readings"),
    ):
        path.write_text(changed)
        assert main([*order, str(path)]) == 2
        assert said in capsys.readouterr().err
    with pytest.raises(SystemExit):
        main([*order, "--plan", "dail"])
    assert 'did you mean "dial"?' in capsys.readouterr().err
