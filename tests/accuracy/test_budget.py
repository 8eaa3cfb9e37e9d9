"""Error budgets, their poses and their command."""

import csv
import io
import re

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, tip

from jointplay import (
    BallBearing,
    Gear,
    JointplayError,
    Mechanism,
    Motion,
    PrismaticClearance,
    RevoluteClearance,
    Simulation,
    robot_scenario,
    shipped,
)
from jointplay.accuracy import poses, rest
from jointplay.accuracy.compensation import compensate
from jointplay.accuracy.error_budget import budget
from jointplay.cli import main
from jointplay.model.robots import robot_urdf
from jointplay.physics.contact import Coulomb
from jointplay.simulation.loads import (
    ComputedTorque,
    Prescribed,
    Servo,
    Spring,
    TorsionSpring,
    Wrench,
)
from jointplay.simulation.run import Run
from jointplay.study.corners import judge, trust_of

REACH = 0.5
"""Distance of the tool from the joint [m]."""
RIGID = 1e14
"""Stiffness of contacts that hardly give way [N/m^1.5]."""


@pytest.fixture
def arm(urdf):
    """One joint about z, its weight at the tool."""
    return urdf(body("arm", mass=3.0, com=f"{REACH} 0 0"), joint("j", "base", "arm"), tip("arm"))


@pytest.fixture
def two(urdf):
    """Two joints about z, half a metre each."""
    second = joint("b", "one", "two", at="0.5 0 0")
    return urdf(body("one"), body("two"), joint("a", "base", "one"), second, tip("two"))


def bearing(play=1e-4, **changes):
    return RevoluteClearance(**{"radial_clearance": play, "axial_clearance": play} | changes)


PUSHES = {
    "wrench": Wrench("two", force=(20.0, 5.0, -40.0), at=(0.2, 0.1, 0.0)),
    "spring": Spring("one", 500.0, 0.1, at=(0.1, 0.0, 0.1), other_at=(0.3, 0.0, 1.0)),
    "torsion": TorsionSpring("b", 30.0, rest=-0.2),
    "tool": Wrench("tool", force=(0.0, 0.0, -30.0)),
}


def test_loads_and_a_force_act_at_rest_as_where_a_run_begins(urdf):
    path = urdf(
        body("one", mass=2.0, com="0.2 0 0"), joint("a", "base", "one", axis="0 1 0"),
        body("two", mass=1.0, com="0.2 0 0"),
        joint("b", "one", "two", axis="0 1 0", at="0.5 0 0"), tip("two"),
    )  # fmt: skip
    plays = {"a": bearing(friction=Coulomb(0.0))}
    robot = Mechanism(path, plays, gears={"b": Gear(2e-3, 0.1, 1e4)})
    motion = Motion(["a", "b"], [0.0, 0.1], [[0.1, -0.3]] * 2)
    run = Run(Simulation(robot, motion, start="rest", loads=PUSHES))
    assert run.rest.solved
    others = {name: one for name, one in PUSHES.items() if name != "tool"}
    q = poses.at_pose(robot, {"a": 0.1, "b": -0.3})
    found = budget(robot, q, loads=others, force=(0.0, 0.0, -30.0))
    pin.framesForwardKinematics(robot.model, robot.data, run.rest.q)
    there = robot.data.oMf[robot.tool_frame].translation - found.positions[0]
    assert found.rest_tool[0, :3] == pytest.approx(there, abs=rest.AGREES_M)
    assert np.linalg.norm(there) == pytest.approx(found.rest_interval[0, 3], rel=0.05)
    without = budget(robot, q)
    assert found.rest_error[0] > 2.0 * without.rest_error[0]


@pytest.mark.parametrize(("axis", "axial", "left"), [("0 -1 0", 1e-6, 0.0), ("0 0 1", 1e-4, 1.0)])
def test_cures_of_play_are_told_beside_each_other(urdf, axis, axial, left):
    """A level joint lifts its arm as far as the journal sinks; an upright one cannot."""
    weight = body("arm", mass=3.0, com=f"{REACH} 0 0")
    path = urdf(weight, joint("j", "base", "arm", axis=axis), tip("arm"))
    own = bearing(friction=Coulomb(0.0), axial_clearance=axial)
    found = budget(Mechanism(path, {"j": own}), {})
    rest = np.linalg.norm(found.rest_positions.at(0).error[:3])
    assert found.compensated(0, 0.3) == pytest.approx((left + 0.3) * rest, abs=0.08 * rest)
    tighter = next(one for one in found.cures if one.action.startswith("half the play of j "))
    assert tighter.after == pytest.approx(found.worst[0] / 2.0, rel=1e-3)
    assert any("jointplay compensate" in one.action for one in found.cures) == (left == 0.0)


def test_compensated_motion_takes_back_a_servos_sag_and_a_stiffer_gain_half_of_it(arm):
    """15 N m on a P servo of 200 N m/rad: judged by runs of the motion that `compensate` gives."""
    servo = Servo(voltage=480.0, torque_constant=1.0, resistance=1.0, p_gain=200.0, encoder="motor")
    robot = Mechanism(arm, gears={"j": Gear(2e-3, 0.1, 1e4, 5.0)}, gravity=(0.0, -9.81, 0.0))
    found = budget(robot, {}, drive=servo)
    words = {one.action.split(",")[0].split(" (")[0]: one for one in found.cures}
    sag = 3.0 * 9.81 * REACH / 200.0
    half = words["twice the P gain"]
    assert half.before - half.after == pytest.approx(0.5 * sag * REACH, rel=0.05)
    assert words["compensated"].after < 0.05 * words["compensated"].before
    motion = Motion(["j"], [0.0, 0.5, 1.5], [[0.0], [0.02], [0.0]])
    judged = judge(compensate(Simulation(robot, motion, servo)), trust_of("exact", None))
    assert judged.nominal.before.rms == pytest.approx(found.rest_error[0], rel=0.1)
    assert judged.nominal.after.rms < 0.05 * judged.nominal.before.rms


def test_a_spring_holds_the_teeth_where_the_weight_changes_sides(arm):
    """3 kg at half a metre, tipped from upright to either side by 0.1 and 0.2 rad."""
    robot = Mechanism(arm, gears={"j": Gear(2e-3, 0.1, 1e4)}, gravity=(-9.81, 0.0, 0.0))
    q = np.concatenate([poses.at_pose(robot, {"j": x}) for x in (-0.1, 0.2)])
    found = budget(robot, q, drive=ComputedTorque(encoder="motor"))
    spring = next(one for one in found.cures if one.action.startswith("a spring"))
    needed = 3.0 * 9.81 * REACH * np.sin(0.1)
    assert f"of {needed:.3g} N m in j, which" in spring.action
    assert spring.after == pytest.approx(0.0, abs=1e-9)
    one_side = budget(robot, q[1:], drive=ComputedTorque(encoder="motor"))
    assert not any(one.action.startswith("a spring") for one in one_side.cures)


def test_a_planar_journal_displaces_the_tool_by_its_clearance(arm):
    found = budget(Mechanism(arm, {"j": RevoluteClearance.planar(radial_clearance=1e-4)}), {})
    assert found.worst[0] == pytest.approx(1e-4)
    assert found.axis_worst[0, 0] == pytest.approx([1e-4, 1e-4, 0, 0, 0, 0])
    assert found.worst_turn[0] == 0.0


def test_a_leaning_journal_lifts_the_tool_by_the_law_of_the_lever(arm):
    joint = bearing(lock_axial=True)
    found = budget(Mechanism(arm, {"j": joint}), {}, second_order=False)
    assert found.axis_worst[0, 0, 2] == pytest.approx(2.0 * 1e-4 / joint.lj * REACH)
    assert found.worst_turn[0] == pytest.approx(2.0 * 1e-4 / joint.lj)


def test_at_rest_the_tool_hangs_as_far_down_as_it_can(arm):
    joint = bearing(lock_axial=True, stiffness=RIGID)
    mechanism = Mechanism(arm, {"j": joint})
    found = budget(mechanism, {}, second_order=False)
    # Contacts deflect a little, and leaning widens the play a little.
    assert found.rest[0, 0, 2] == pytest.approx(-2.0 * 1e-4 / joint.lj * REACH, rel=2e-3)
    light = budget(mechanism, {}, second_order=False, force=(0.0, 0.0, 60.0))
    assert light.rest[0, 0, 2] == pytest.approx(2.0 * 1e-4 / joint.lj * REACH, rel=2e-3)
    soft = budget(Mechanism(arm, {"j": bearing(lock_axial=True, stiffness=1e8)}), {})
    assert soft.rest[0, 0, 2] < 1.5 * found.rest[0, 0, 2]
    assert "contacts and gears giving way" in soft.sentence
    assert "giving way" not in found.sentence


def test_gears_turn_the_tool_by_half_their_play(two):
    gears = {"a": Gear(1e-3, 0.1, 1e4), "b": Gear(2e-3, 0.1, 1e4)}
    found = budget(Mechanism(two, gears=gears), {})
    assert found.joints == ("a (gear)", "b (gear)")
    assert found.worst_parts[0] == pytest.approx([0.5e-3 * 1.0, 1e-3 * 0.5], rel=1e-6)
    assert found.worst[0] == pytest.approx(1e-3, rel=1e-6)
    assert found.shares == pytest.approx([0.5, 0.5])


def test_a_dial_shows_gears_play_twice_from_side_to_side(two, capsys):
    geared = budget(Mechanism(two, gears={"a": Gear(1e-3, 0.1, 1e4)}), {})
    assert "twice as much: 1 mm" in geared.from_side_to_side  # 1 mrad, 1 m away
    assert not budget(Mechanism(two, {"a": bearing()}), {}).from_side_to_side
    assert main(["budget", str(two), "--gear", "a=1 mrad", "--pose", "b=1"]) == 0
    said = capsys.readouterr().out
    assert "pushed from side to side, a dial shows twice as much: " in said
    assert "at: pose a 0, b 1 rad" in said  # what a number without a unit was taken for


def test_folding_the_arm_takes_the_shoulders_gear_out_of_the_error(two):
    found = budget(Mechanism(two, gears={"a": Gear(1e-3, 0.1, 1e4)}), {"b": np.pi})
    assert found.unit == "rad"  # the tool is in the shoulder's axis, and turns with it
    assert found.worst[0] == pytest.approx(0.5e-3, rel=1e-9)


def test_parts_sum_to_the_whole_and_no_axis_is_worse(two):
    mechanism = Mechanism(two, {"a": bearing(), "b": bearing(2e-4)})
    found = budget(mechanism, poses.over_workspace(mechanism, 8))
    assert np.allclose(found.worst_parts.sum(axis=1), found.worst)
    assert np.allclose(found.turns.parts.sum(axis=0), found.worst_turn)
    assert np.allclose(found.rms_parts.sum(axis=1), found.rms)
    assert np.all(found.axis_worst.sum(axis=1)[:, :3].max(axis=1) <= found.worst * (1 + 1e-6))
    assert np.all(found.rms <= found.worst)
    assert np.all(found.rest_error <= found.worst * 1.1)  # contacts give way


def test_no_direction_is_worse_than_the_worst(two):
    mechanism = Mechanism(two, {"a": bearing(), "b": bearing(2e-4)})
    found = budget(mechanism, {"b": 0.7})
    random = np.random.default_rng(0).normal(size=(1, 4000, 3))
    random /= np.linalg.norm(random, axis=2, keepdims=True)
    total = found.model.along(random).value.sum(axis=0)
    assert total.max() <= found.worst[0] * (1.0 + 1e-6)
    assert total.max() >= found.worst[0] * 0.99


def test_the_exact_tool_stays_within_bound_and_second_order(two):
    mechanism = Mechanism(two, {"a": bearing(5e-4), "b": bearing(5e-4)})
    found = budget(mechanism, {"a": 0.3, "b": 0.9})
    random = np.random.default_rng(1)
    q0 = mechanism.configuration({"a": 0.3, "b": 0.9})
    ideal = found.positions[0]
    largest = 0.0
    for _ in range(300):
        q = q0.copy()
        for name, play in zip(found.joints, found.model.plays, strict=True):
            point = play.support(random.normal(size=(1, 6)) * [1, 1, 1, 0.02, 0.02, 0])
            at = mechanism.virtual_link(name)
            yaw = q0[mechanism.coordinate(name)]
            move = point.point[0]
            q[at : at + 3] += move[:3]
            # Pitch and roll turn about axes that follow the yaw.
            q[at + 4] += -np.sin(yaw) * move[3] + np.cos(yaw) * move[4]
            q[at + 5] += np.cos(yaw) * move[3] + np.sin(yaw) * move[4]
        pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
        tool = mechanism.data.oMf[mechanism.tool_frame].translation
        largest = max(largest, float(np.linalg.norm(tool - ideal)))
    assert largest <= found.worst[0] + found.second_order[0]
    assert largest > 0.6 * found.worst[0]


def test_the_order_of_bearing_and_journal_does_not_matter(two):
    plain = budget(Mechanism(two, {"a": bearing(), "b": bearing()}), {"b": 0.5})
    turned = budget(
        Mechanism(two, {"a": bearing(exchanged=True), "b": bearing(exchanged=True)}), {"b": 0.5}
    )
    assert turned.worst == pytest.approx(plain.worst, rel=1e-9)
    assert turned.rest_error == pytest.approx(plain.rest_error, rel=1e-5)  # second order


def test_a_slider_has_its_play_across(urdf):
    path = urdf(body("car"), joint("s", "base", "car", "prismatic", "1 0 0"), tip("car", "0 0 0"))
    mechanism = Mechanism(path, {"s": PrismaticClearance(clearance=1e-4, lock_tilt=True)})
    found = budget(mechanism, {"s": 0.2})
    assert found.axis_worst[0, 0, :3] == pytest.approx([0.0, 1e-4, 1e-4], abs=1e-15)


def test_a_joint_that_does_not_move_the_tool_adds_nothing(urdf):
    ends = joint("a", "base", "one"), joint("b", "base", "two")
    path = urdf(body("one"), body("two"), *ends, tip("one"))
    found = budget(Mechanism(path, {"a": bearing(), "b": bearing()}, tool="tool"), {})
    assert found.worst_parts[0, 1] == 0.0
    assert found.worst_parts[0, 0] > 0.0


def test_budgets_refuse_what_they_cannot_do(two):
    with pytest.raises(JointplayError, match=r"nothing has play.*joints: a, b"):
        budget(Mechanism(two), {})
    mechanism = Mechanism(two, {"a": bearing()})
    with pytest.raises(JointplayError, match="shape"):
        budget(mechanism, np.zeros((1, 2)))
    with pytest.raises(JointplayError, match="three components"):
        budget(mechanism, {}, force=(1.0, 2.0))


def test_poses_outside_the_limits_are_refused_with_the_limits(two):
    mechanism = Mechanism(two, {"a": bearing()})
    with pytest.raises(JointplayError, match="'a' at 10 is outside its limits -9 to 9"):
        poses.at_pose(mechanism, {"a": 10.0})
    with pytest.raises(JointplayError, match=r"no moving joint 'x'; available: a, b"):
        poses.at_pose(mechanism, {"x": 0.0})
    motion = Motion(["a"], [0.0, 1.0], [[0.0], [12.0]])
    with pytest.raises(JointplayError, match="outside its limits"):
        poses.along_motion(mechanism, motion)


def test_poses_along_a_motion_are_on_it(two):
    mechanism = Mechanism(two, {"a": bearing()})
    motion = Motion(["b"], [0.0, 0.37, 1.0], [[0.0], [1.0], [0.5]])
    q = poses.along_motion(mechanism, motion, 11)
    times = poses.times_along(motion, 11)
    assert len(q) == len(times) == 12
    assert q[:, mechanism.coordinate("b")] == pytest.approx(motion(times)[0][:, 0])


def test_the_workspace_is_covered_evenly_within_limits(two):
    mechanism = Mechanism(two, {"a": bearing()})
    values = poses.over_workspace(mechanism, 64)[:, mechanism.coordinate("a")]
    assert np.abs(values).max() <= np.pi  # a turn, though the limits are wider
    counts, _ = np.histogram(values, 8, (-np.pi, np.pi))
    assert counts.tolist() == [8] * 8


def test_rows_of_the_table_have_the_names_of_their_poses(two):
    mechanism = Mechanism(two, {"a": bearing()})
    table = budget(mechanism, poses.over_workspace(mechanism, 2)).data(("home", "reach")).csv()
    assert [row["pose"] for row in csv.DictReader(io.StringIO(table))] == ["home", "reach"]


@pytest.mark.usefixtures("checked_figures")
def test_the_command_prints_the_table_and_writes_the_files(two, tmp_path, capsys):
    out = tmp_path / "out"
    order = ["budget", str(two), "--clearance", "0.1 mm", "--workspace", "9", "--detail"]
    order += ["--out", str(out)]
    assert main(order) == 0
    text = capsys.readouterr().out
    assert "tool: 'tool'" in text
    assert "free travel with rigid contacts, to which" in text
    rows = list(csv.DictReader(io.StringIO((out / "budget.csv").read_text())))
    assert len(rows) == 9
    found = float(rows[0]["worst_m"])
    assert found == pytest.approx(
        sum(float(rows[0][f"worst_part_{name}_m"]) for name in "ab"), rel=1e-6
    )
    looked_at = [row for row in rows if row["rest_x_m"]]
    assert [float(row["worst_m"]) for row in looked_at] == [
        max(float(row["worst_m"]) for row in rows)
    ]
    (place,) = looked_at
    for way in ("x", "y", "z", "distance"):
        least, rest, largest = (
            float(place[f"rest_{way}{end}_m"]) for end in ("_least", "", "_largest")
        )
        assert least <= rest <= largest
    assert "with friction 0.1 the tool may rest anywhere within x " in text
    for name in ("bars", "robot", "reach", "map"):
        assert (out / f"{name}.png").stat().st_size > 5000


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--joint", "c=1 mm"], '--joint: no joint "c"; available: a, b'),
        (["--clearance", "1 N"], "--clearance: .*length"),
        (["--clearance", "1 mm", "--pose", "a=99 rad"], "outside its limits"),
        (["--clearance", "1 mm", "--pose", "a"], "--pose must read"),
        (["--clearance", "1 mm", "--tool", "hand"], "no frame 'hand'"),
        (["--clearance", "1 mm", "--force", "1,2"], "--force must be three numbers"),
        ([], "nothing has play"),
    ],
)
def test_the_command_says_in_one_line_what_is_wrong(two, capsys, options, message):
    try:
        status = main(["budget", str(two), *options])
    except SystemExit as ended:  # of the parser, which reads quantities
        status = ended.code
    assert status == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(message, error)


def test_the_command_takes_a_scenario_with_its_motion_and_clearance(capsys):
    assert main(["budget", "jointplay:scara.toml", "--case", "0.2 mm"]) == 0
    text = capsys.readouterr().out
    assert "along the motion" in text
    assert "joint_b" in text


def test_a_folder_called_like_a_robot_is_not_taken_for_it(tmp_path, monkeypatch, capsys):
    (tmp_path / "ur5").mkdir()
    monkeypatch.chdir(tmp_path)
    assert main(["budget", "ur5", "--clearance", "0.1 mm"]) == 0
    assert "tool: 'tool0'" in capsys.readouterr().out


def hung(urdf, **changes):
    """A heavy body in a planar bearing with a horizontal axis, its weight on the axis."""
    path = urdf(body("arm", mass=3.0, com="0 0 0"), joint("j", "base", "arm", axis="0 1 0"))
    path = path.with_name(path.name)
    planar = RevoluteClearance.planar(radial_clearance=1e-4, stiffness=RIGID, **changes)
    return Mechanism(path, {"j": planar}, tool="arm")


@pytest.mark.parametrize("mu", [0.0, 0.1, 0.3])
def test_friction_holds_a_journal_up_to_its_angle_of_friction_in_the_bore(urdf, mu):
    found = budget(hung(urdf), {}, friction=mu)
    (x, y, z, distance) = found.rest_interval[0]
    # A polygon around the cone is at most 1 / cos(pi/8) as wide.
    low, high = (1e-4 * np.sin(np.arctan(mu * more)) for more in (1.0, 1.0 / np.cos(np.pi / 8)))
    # States that balance to 0.3 % count.
    assert low - 1e-9 <= x[1] <= high + 6e-7
    assert low - 1e-9 <= -x[0] <= high + 6e-7
    assert z[0] == pytest.approx(-1e-4, rel=3e-3)
    assert z[1] == pytest.approx(-1e-4 * np.cos(np.arctan(mu)), abs=4e-6 * mu + 1e-6)
    assert y == pytest.approx([0.0, 0.0], abs=1e-9)
    # Distances are those of the set's convex hull, on the safe side of 180 directions.
    assert 0.94 * 1e-4 * np.cos(np.arctan(mu)) <= distance[0] <= 1.0001e-4
    assert 0.999e-4 <= distance[1] <= 1.02e-4


def test_the_friction_of_its_law_is_assumed_and_said(urdf):
    law = budget(hung(urdf, friction=Coulomb(mu_d=0.25)), {})
    assert "with friction 0.25 the tool may rest" in str(law.table())
    assert law.rest_interval == pytest.approx(budget(hung(urdf), {}, friction=0.25).rest_interval)
    with pytest.raises(JointplayError, match=r"friction coefficient must be >= 0, got -0\.1"):
        budget(hung(urdf), {}, friction=-0.1)


def test_a_journal_that_stands_on_its_face_is_held_anywhere_across_by_enough_friction(urdf):
    # The face bears the weight, and its friction of 0.1 holds a side force of 0.05 of that.
    path = urdf(body("arm", mass=2.0, com="0 0 0"), joint("j", "base", "arm"))
    mechanism = Mechanism(path, {"j": bearing(stiffness=RIGID)}, tool="arm")
    side = (2.0 * 9.81 / 20.0, 0.0, 0.0)
    rough, smooth = (budget(mechanism, {}, force=side, friction=mu) for mu in (0.1, 0.0))
    assert rough.rest_interval[0, :2] == pytest.approx(np.array([[-1e-4, 1e-4]] * 2), rel=0.02)
    assert smooth.rest_interval[0, 0] == pytest.approx([1e-4, 1e-4], rel=0.02)
    assert smooth.rest_interval[0, 1] == pytest.approx([0.0, 0.0], abs=5e-6)


@pytest.mark.parametrize("name", [pytest.param("ur5", marks=pytest.mark.thorough), "scara"])
def test_budgets_rest_is_where_a_run_at_rest_begins_and_friction_can_hold_it_there(name):
    path = robot_urdf("ur5") if name == "ur5" else shipped("scara.urdf")
    plain = Mechanism(path)
    loose = bearing(bearing_radius=30e-3, bearing_length=50e-3)
    turning = [j for j in plain.joints if plain.description.joints[j].kind != "prismatic"]
    sets = [turning, turning[2:3]] if name == "ur5" else [turning[:2]]
    for names in sets:
        mechanism = Mechanism(path, dict.fromkeys(names, loose), gravity=(0.0, 0.0, -9.81))
        q = poses.over_workspace(mechanism, 4, seed=11)[1:]
        found = budget(mechanism, q, friction=0.1)
        for i, row in enumerate(q):
            values = np.array([row[[mechanism.coordinate(n) for n in mechanism.joints]]] * 2)
            motion = Motion(list(mechanism.joints), [0.0, 1.0], values)
            run = Run(Simulation(mechanism, motion, duration=1e-3, start="rest", limits="ignore"))
            pin.framesForwardKinematics(mechanism.model, mechanism.data, run.rest.q)
            there = mechanism.data.oMf[mechanism.tool_frame].translation - found.positions[i]
            assert found.rest_tool[i, :3] == pytest.approx(there, abs=1e-6)
            ends = found.rest_interval[i, :3]
            assert (there >= ends[:, 0] - 1e-6).all()
            assert (there <= ends[:, 1] + 1e-6).all()


def test_a_journal_that_bears_nothing_rests_anywhere_in_its_play_and_the_table_says_so(arm):
    weightless = Mechanism(arm, {"j": bearing()}, gravity=(0.0, 0.0, 0.0), tool="tip")
    for mu in (0.0, 0.1):
        found = budget(weightless, {}, friction=mu)
        reach = found.axis_worst[0].sum(axis=0)[:3] + found.second_order[0]
        assert found.rest_interval[0, :3, 1] == pytest.approx(reach, rel=1e-6)
        assert found.rest_interval[0, :3, 0] == pytest.approx(-reach, rel=1e-6)
        assert found.rest_interval[0, 3, 0] == 0.0
        assert found.rest_interval[0, 3, 1] >= found.worst[0]
        assert "no force acts on any joint: the journals may rest anywhere" in str(found.table())
    heavy = budget(Mechanism(arm, {"j": bearing()}, tool="tip"), {})
    assert "no force acts on" not in str(heavy.table())


def test_the_table_says_whether_friction_decides_where_the_tool_rests(urdf):
    shifts = str(budget(hung(urdf), {}, friction=0.1).table())
    assert "friction shifts the place of rest by up to 0.01" in shifts
    decides = str(budget(hung(urdf), {}, friction=1.0).table())
    assert "friction determines where it rests: up to 0.0" in decides


def loose_joints(name):
    """A case of benchmarks/truth/statics.py, with the search for states of its journals."""
    from truth import statics as brute

    case = (brute.CASES | brute.PAIRS)[name]
    mechanism, q = case.build()
    return brute, mechanism, q, [brute.Journal(mechanism, q, joint) for joint in case.joints]


@pytest.mark.thorough
@pytest.mark.parametrize("mu", [0.1, 0.0])
@pytest.mark.parametrize("name", ["ur5 elbow", "scara a, vertical axis"])
def test_frictions_interval_holds_what_a_search_of_all_contacts_finds_and_little_more(name, mu):
    brute, mechanism, q, (journal,) = loose_joints(name)
    states = brute.search(journal, mu, states=600, tries=8000)[0] if mu else brute.flat(journal)
    assert len(states) >= (300 if mu else 1)
    found = budget(mechanism, q[None], friction=mu, drive=Prescribed())
    (low, high), ends = (states.min(axis=0), states.max(axis=0)), found.rest_interval[0, :3]
    less, more = 0.01 * (high - low) + 1e-6, 0.15 * (high - low) + 6e-6
    if not mu:
        # States within 1e-7 of the least energy: where it is flat the ends are known to 3 um.
        play = found.axis_worst[0].sum(axis=0)[:3]
        less, more = 4e-3 * play, 1e-2 * play
    more += found.second_order[0]
    assert ((ends[:, 0] <= low + less) & (ends[:, 0] >= low - more)).all()
    assert ((ends[:, 1] >= high - less) & (ends[:, 1] <= high + more)).all()


@pytest.mark.thorough
def test_frictions_interval_of_two_loose_joints_holds_what_a_search_of_both_at_once_finds():
    brute, mechanism, q, journals = loose_joints("ur5 elbow and wrist 1")
    states = brute.search_together(journals, 0.1, states=200, climbs=1, steps=300)
    found = budget(mechanism, q[None], friction=0.1, drive=Prescribed())
    (low, high), ends = (states.min(axis=0), states.max(axis=0)), found.rest_interval[0, :3]
    width = high - low
    assert (width > 0.1 * (ends[:, 1] - ends[:, 0])).all()
    assert (ends[:, 0] <= low + 0.03 * width).all()
    assert (ends[:, 1] >= high - 0.03 * width).all()


def test_a_link_and_a_joint_may_have_the_name_of_the_tool(urdf, capsys):
    robot = urdf(body("hinge"), joint("hinge", "base", "hinge"))
    assert main(["budget", str(robot), "--clearance", "1e-4", "--tool", "hinge"]) == 0
    assert "hinge" in capsys.readouterr().out


def test_a_joints_own_worst_case_is_that_of_the_joint_alone(two):
    bearing = RevoluteClearance(radial_clearance=1e-4, bearing_length=0.03)
    for pose in ({"a": 0.3, "b": -1.0}, {"a": 1.2, "b": 0.4}):
        both = budget(Mechanism(two, {"a": bearing, "b": bearing}, tool="tool"), pose)
        for column, name in enumerate("ab"):
            single = budget(Mechanism(two, {name: bearing}, tool="tool"), pose)
            assert both.alone[:, column] == pytest.approx(single.worst, rel=1e-6)
        assert (both.alone >= both.worst_parts * (1.0 - 1e-9)).all()
        assert "alone [mm]  part of worst case [mm]  share" in str(both.table())


def test_several_poses_are_a_table_of_poses_and_joints(two, tmp_path, capsys):
    order = ["budget", str(two), "--clearance", "0.1 mm"]
    assert main([*order, "--pose", "a=0.5,b=1", "--pose", "a=-1"]) == 0
    typed = capsys.readouterr().out
    lines = typed.splitlines()
    head = next(i for i, line in enumerate(lines) if line.startswith("pose  "))
    assert [line.split()[0] for line in lines[head + 1 : head + 3]] == ["a=0.5,b=1", "a=-1"]
    file = tmp_path / "poses.csv"
    file.write_text("name,a,b\n# a comment\nhere,0.5,1\nthere,-1 rad,0\n")
    assert main([*order, "--poses", str(file)]) == 0
    read = capsys.readouterr().out
    for name, line in zip(("here", "there"), lines[head + 1 :], strict=False):
        assert line.split()[1:] == next(
            one.split()[1:] for one in read.splitlines() if one.startswith(f"{name} ")
        )
    assert "shares of the worst case: a " in read
    assert re.search(r", b \d+ % \(\d+ to \d+\)", read)
    assert "(pose h" in read or "(pose t" in read


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("name,a\n", "has no poses"),
        ("a,c\n0,0\n", "pose 1: no moving joint 'c'; available: a, b"),
        ("a\n0\nfar\n", "line 3, a: "),
        ("name,a\nx,0\nx,1\n", "line 3: there are two poses 'x'"),
        ("name,a,b,a\nx,0,0,1\n", "column 'a' appears twice"),
    ],
)
def test_a_file_of_poses_that_cannot_be_is_refused(two, tmp_path, capsys, text, message):
    file = tmp_path / "poses.csv"
    file.write_text(text)
    assert main(["budget", str(two), "--clearance", "0.1 mm", "--poses", str(file)]) == 2
    assert message in capsys.readouterr().err


def test_a_joint_that_gives_way_beyond_its_play_is_named_in_the_answer():
    """The elastic tilt of a single ball bearing is a third of the tilt in its play."""
    found = budget(Mechanism("ur5", {"elbow_joint": BallBearing(designation="6204")}), {})
    turned = np.linalg.norm(found.rest_positions.at(0).error[3:])
    assert turned > 1.2 * found.worst_turn[0]
    assert "contacts and gears giving way 0.238" in found.sentence


@pytest.mark.parametrize(("encoder", "at_rest"), [("link", 0.0), ("motor", 5e-4 * REACH)])
def test_where_a_gears_play_shows_at_rest_depends_on_the_encoder(arm, encoder, at_rest):
    """With an encoder on the link the drive corrects the link; table and sentence agree."""
    mechanism = Mechanism(arm, gears={"j": Gear(1e-3, 0.1, 1e7)}, gravity=(0.0, -9.81, 0.0))
    found = budget(mechanism, {}, drive=ComputedTorque(encoder=encoder))
    (row,) = np.linalg.norm(found.rest[0, :, :3], axis=1)
    assert row == pytest.approx(found.rest_error[0], rel=1e-2, abs=1e-9)
    assert row == pytest.approx(at_rest, rel=1e-2, abs=1e-9)
    assert found.rest_interval[0, 3] == pytest.approx([at_rest] * 2, rel=2e-2, abs=1e-6)
    assert ("encoders behind their gears hold j" in found.sentence) == (encoder == "link")


def test_a_budget_says_what_its_columns_mean(arm):
    text = str(budget(Mechanism(arm, gears={"j": Gear(1e-3, 0.1, 1e4)}), {}).table())
    assert "alone: with play in this joint only" in text
    assert "at rest: under gravity" in text


@pytest.mark.parametrize("bearing", ["plain", "rolling"])
def test_states_that_have_settled_are_those_of_a_search_of_all(bearing, monkeypatch):
    """The journals lean by gravity, so that their loads change with the state."""
    made = {
        "plain": RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4),
        "rolling": BallBearing(designation="6002", radial_clearance=2e-5),
    }[bearing]
    arm = Mechanism(robot_urdf("ur5"), {"elbow_joint": made, "wrist_1_joint": made})
    found = budget(arm, {}, friction=0.3).rest_interval
    monkeypatch.setattr(rest, "_SETTLED", 0.0)
    assert found == pytest.approx(budget(arm, {}, friction=0.3).rest_interval, abs=1e-9)


def test_rolling_bearings_rest_where_their_elements_balance_the_load():
    """The interval of frictionless rings holds their one position of rest, and little more.

    A run of the three bearings, which begins at the statics of all joints together, stays at
    1.3737 mm for 0.6 s.
    """
    names = [f"wrist_{i}_joint" for i in (1, 2, 3)]
    machine = Mechanism("ur5", {name: BallBearing(designation="6204") for name in names})
    pose = {"shoulder_lift_joint": -1.0, "elbow_joint": 1.2, "wrist_1_joint": -0.7}
    for friction in (None, 0.0):
        found = budget(machine, pose, friction=friction)
        least, most = found.rest_interval[0, 3]
        assert least < 1.37365e-3 < most
        assert most - least < 0.05 * found.rest_error[0]


@pytest.mark.parametrize("encoder", ["link", "motor"])
def test_play_about_an_axis_through_the_tool_moves_it_nowhere(encoder):
    """20 degrees of play, about an axis found through six joints."""
    machine = Mechanism("ur5", gears={"wrist_3_joint": Gear(np.radians(20.0), 0.1, 1e4)})
    pose = dict.fromkeys(("shoulder_pan_joint", "elbow_joint", "wrist_1_joint"), 0.7)
    found = budget(machine, pose, drive=ComputedTorque(encoder=encoder))
    assert found.unit == "rad"
    assert found.worst[0] == pytest.approx(np.radians(10.0))
    assert found.second_order[0] == 0.0
    assert found.rest_interval[0, 3].tolist() == pytest.approx([0.0, 0.0], abs=1e-15)


def test_a_gear_held_by_its_links_encoder_adds_no_second_order_at_rest(arm):
    mechanism = Mechanism(arm, gears={"j": Gear(np.radians(20.0), 0.1, 1e7)})
    found = budget(mechanism, {}, drive=ComputedTorque(encoder="link"))
    assert found.rest_interval[0, 3].max() < 1e-9
    angle = np.radians(10.0)
    assert found.second_order[0] >= REACH * (1.0 - np.cos(angle))
    assert "move the tool on arcs" in found.sentence


def test_a_corrected_motion_leaves_a_part_of_the_play_not_of_the_wind_up(arm):
    """The gear winds up by ten times its play: 3 kg at half a metre are 14.7 N m."""
    play, stiffness = 1e-3, 3.0 * 9.81 * REACH / 5e-3
    mechanism = Mechanism(arm, gears={"j": Gear(play, 0.1, stiffness)}, gravity=(0.0, -9.81, 0.0))
    found = budget(mechanism, {}, drive=ComputedTorque(encoder="motor"))
    assert found.rest_error[0] == pytest.approx((play / 2.0 + 5e-3) * REACH, rel=0.05)
    assert found.compensated(0, 0.3) == pytest.approx(0.3 * play / 2.0 * REACH, abs=1e-5)
    assert any("instead of 2.7" in str(one) for one in found.cures)


def test_the_worst_turn_in_the_answer_is_that_of_all_poses():
    """Rotations by two gears add up where their axes are parallel, but the arm is short there."""
    machine = Mechanism("ur5", gears={n: Gear(1e-2, 0.1, 1e4) for n in
                                      ("shoulder_pan_joint", "wrist_1_joint")})  # fmt: skip
    q = np.zeros((2, machine.model.nq))
    q[1, machine.coordinate("shoulder_lift_joint")] = -np.pi / 2.0
    q[1, machine.coordinate("elbow_joint")] = np.pi / 2.0
    q[1, machine.coordinate("wrist_2_joint")] = np.pi / 2.0
    both = machine.with_clearance({}, {n: Gear(1e-2, 0.1, 1e4) for n in
                                       ("shoulder_pan_joint", "wrist_3_joint")})  # fmt: skip
    found = budget(both, q)
    assert found.worst_turn.argmax() != found.worst_pose
    assert f"turn by up to {1e3 * found.worst_turn.max():.3g} mrad" in found.sentence


def test_without_a_pose_it_is_that_of_the_command(capsys):
    order = ["budget", "ur5", "--joint", "elbow_joint"]
    assert main(order) == 0
    robot = robot_scenario("ur5", ["elbow_joint"]).simulation().mechanism
    known = budget(robot)
    assert np.array_equal(known.q, poses.poses_of(robot).q)
    assert known.sentence in capsys.readouterr().out
