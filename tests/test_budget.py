"""Error budgets, their poses, their command."""

import csv
import io

import numpy as np
import pytest
from conftest import body, joint, tip

from jointplay import (
    Gear,
    JointplayError,
    Mechanism,
    Motion,
    PrismaticClearance,
    RevoluteClearance,
)
from jointplay.analysis import poses
from jointplay.analysis.static_budget import budget
from jointplay.cli import main
from jointplay.plots import budget as plots

REACH = 0.5
"""Distance of the tool from the joint [m]."""


@pytest.fixture
def arm(urdf):
    """One joint about z, its weight at the tool."""
    return urdf(body("arm", mass=3.0, com=f"{REACH} 0 0"), joint("j", "base", "arm"), tip("arm"))


@pytest.fixture
def two(urdf):
    """Two joints about z, half a metre each."""
    return urdf(
        body("one"),
        body("two"),
        joint("a", "base", "one"),
        joint("b", "one", "two", at="0.5 0 0"),
        tip("two"),
    )


def bearing(play=1e-4, **changes):
    return RevoluteClearance(**{"radial_clearance": play, "axial_clearance": play} | changes)


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
    joint = bearing(lock_axial=True)
    mechanism = Mechanism(arm, {"j": joint})
    found = budget(mechanism, {}, second_order=False)
    assert found.rest[0, 0, 2] == pytest.approx(-2.0 * 1e-4 / joint.lj * REACH)
    light = budget(mechanism, {}, second_order=False, force=(0.0, 0.0, 60.0))
    assert light.rest[0, 0, 2] == pytest.approx(2.0 * 1e-4 / joint.lj * REACH)


def test_the_weight_of_what_hangs_beyond_counts_with_its_lever(urdf):
    # The body's centre is on the other side of the joint from the tool: it lifts the tool.
    path = urdf(body("arm", com="-0.2 0 0"), joint("j", "base", "arm"), tip("arm"))
    found = budget(Mechanism(path, {"j": bearing(lock_axial=True)}), {})
    assert found.rest[0, 0, 2] > 0.0


def test_gears_turn_the_tool_by_half_their_play(two):
    gears = {"a": Gear(1e-3, 0.1, 1e4), "b": Gear(2e-3, 0.1, 1e4)}
    found = budget(Mechanism(two, gears=gears), {})
    assert found.joints == ("a (gear)", "b (gear)")
    assert found.worst_parts[0] == pytest.approx([0.5e-3 * 1.0, 1e-3 * 0.5], rel=1e-6)
    assert found.worst[0] == pytest.approx(1e-3, rel=1e-6)
    assert found.shares == pytest.approx([0.5, 0.5])


def test_folding_the_arm_takes_the_shoulders_gear_out_of_the_error(two):
    found = budget(Mechanism(two, gears={"a": Gear(1e-3, 0.1, 1e4)}), {"b": np.pi})
    assert found.worst[0] == pytest.approx(0.0, abs=1e-12)


def test_parts_sum_to_the_whole_and_no_axis_is_worse(two):
    mechanism = Mechanism(two, {"a": bearing(), "b": bearing(2e-4)})
    found = budget(mechanism, poses.over_workspace(mechanism, 8))
    assert np.allclose(found.worst_parts.sum(axis=1), found.worst)
    assert np.allclose(found.turn_parts.sum(axis=1), found.worst_turn)
    assert np.allclose(found.rms_parts.sum(axis=1), found.rms)
    assert np.all(found.axis_worst.sum(axis=1)[:, :3].max(axis=1) <= found.worst * (1 + 1e-6))
    assert np.all(found.rms <= found.worst)
    assert np.all(found.rest_error <= found.worst)


def test_no_direction_is_worse_than_the_worst(two):
    mechanism = Mechanism(two, {"a": bearing(), "b": bearing(2e-4)})
    found = budget(mechanism, {"b": 0.7})
    random = np.random.default_rng(0).normal(size=(1, 4000, 3))
    random /= np.linalg.norm(random, axis=2, keepdims=True)
    total = sum(part.along(random)[0] for part in found.sources)
    assert total.max() <= found.worst[0] * (1.0 + 1e-6)
    assert total.max() >= found.worst[0] * 0.99


def test_the_exact_tool_stays_within_bound_and_second_order(two):
    import pinocchio as pin

    mechanism = Mechanism(two, {"a": bearing(5e-4), "b": bearing(5e-4)})
    found = budget(mechanism, {"a": 0.3, "b": 0.9})
    random = np.random.default_rng(1)
    q0 = mechanism.configuration({"a": 0.3, "b": 0.9})
    ideal = found.positions[0]
    largest = 0.0
    for _ in range(300):
        q = q0.copy()
        for part in found.sources:
            point = part.play.support(random.normal(size=(1, 6)) * [1, 1, 1, 0.02, 0.02, 0])
            at = mechanism.virtual_link(part.name)
            yaw = q0[mechanism.coordinate(part.name)]
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
    assert turned.rest_error == pytest.approx(plain.rest_error, rel=1e-9)


def test_a_slider_has_its_play_across(urdf):
    path = urdf(body("car"), joint("s", "base", "car", "prismatic", "1 0 0"), tip("car", "0 0 0"))
    mechanism = Mechanism(path, {"s": PrismaticClearance(clearance=1e-4, lock_tilt=True)})
    found = budget(mechanism, {"s": 0.2})
    assert found.axis_worst[0, 0, :3] == pytest.approx([0.0, 1e-4, 1e-4], abs=1e-15)


def test_a_joint_that_does_not_move_the_tool_adds_nothing(urdf):
    path = urdf(
        body("one"),
        body("two"),
        joint("a", "base", "one"),
        joint("b", "base", "two"),
        tip("one"),
    )
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


def test_the_command_prints_the_table_and_writes_the_files(two, tmp_path, capsys):
    out = tmp_path / "out"
    order = ["budget", str(two), "--clearance", "0.1 mm", "--workspace", "9", "--out", str(out)]
    assert main(order) == 0
    text = capsys.readouterr().out
    assert "tool: 'tool'" in text
    assert "static, rigid contact" in text
    rows = list(csv.DictReader(io.StringIO((out / "budget.csv").read_text())))
    assert len(rows) == 9
    found = float(rows[0]["worst_m"])
    assert found == pytest.approx(
        sum(float(rows[0][f"worst_part_{name}_m"]) for name in "ab"), rel=1e-6
    )
    for name in ("bars", "robot", "reach", "map"):
        assert (out / f"{name}.png").stat().st_size > 5000


def test_the_command_takes_a_joints_own_clearance(two, capsys):
    def worst(*options):
        assert main(["budget", str(two), *options]) == 0
        row = next(x for x in capsys.readouterr().out.splitlines() if x.startswith("all"))
        return float(row.split()[1])

    one = worst("--joint", "a=0.1 mm")
    assert one < worst("--joint", "a=0.1 mm", "--joint", "b=0.1 mm")
    assert worst("--clearance", "0.1 mm", "--joint", "a") == pytest.approx(one)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--joint", "c=1 mm"], "no joint 'c' that can have play; available: a, b"),
        (["--clearance", "1 N"], "--clearance: .*length"),
        (["--clearance", "1 mm", "--pose", "a=99"], "outside its limits"),
        (["--clearance", "1 mm", "--pose", "a"], "--pose must read"),
        (["--joint", "a"], "--clearance is missing"),
        (["--clearance", "1 mm", "--tool", "hand"], "no frame 'hand'"),
        (["--clearance", "1 mm", "--force", "1,2"], "--force must be three numbers"),
        ([], "nothing has play"),
    ],
)
def test_the_command_says_in_one_line_what_is_wrong(two, capsys, options, message):
    import re

    assert main(["budget", str(two), *options]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert re.search(message, error)


def test_the_command_takes_a_scenario_with_its_motion_and_clearance(capsys):
    assert main(["budget", "jointplay:scara.toml", "--case", "0.2 mm"]) == 0
    text = capsys.readouterr().out
    assert "along the motion" in text
    assert "joint_b" in text


def test_figures_state_what_they_show(two):
    mechanism = Mechanism(two, {"a": bearing(), "b": bearing()})
    q = poses.over_workspace(mechanism, 5)
    found = budget(mechanism, q)
    for figure in (plots.bars(found), plots.workspace_map(found), plots.course(found)):
        assert "static, rigid contact" in figure.get_supxlabel()
    assert "static" in plots.robot(mechanism, found, q).axes[0].get_title()


def test_a_folder_called_like_a_robot_is_not_taken_for_it(tmp_path, monkeypatch, capsys):
    (tmp_path / "ur5").mkdir()
    monkeypatch.chdir(tmp_path)
    assert main(["budget", "ur5", "--clearance", "0.1 mm"]) == 0
    assert "tool: 'tool0'" in capsys.readouterr().out
