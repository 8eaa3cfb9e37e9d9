"""Which frame is the tool, where nobody says so."""

import pytest
from conftest import body, joint

from jointplay import Mechanism, shipped
from jointplay.model.formats import read
from jointplay.model.robots import robot_urdf
from jointplay.model.tool import choose_tool


def fixed(name, parent):
    return (
        f'<link name="{name}"/><joint name="to_{name}" type="fixed"><parent link="{parent}"/>'
        f'<child link="{name}"/></joint>'
    )


ARM = (
    body("one"),
    body("two"),
    body("three"),
    body("four"),
    joint("a", "base", "one"),
    joint("b", "one", "two"),
    joint("c", "two", "three"),
    joint("d", "three", "four"),
)


def chosen(path):
    return choose_tool(read(path))[0]


FINGERS = [
    *(body("left"), joint("left_slide", "four", "left", "prismatic")),
    *(body("right"), joint("right_slide", "four", "right", "prismatic")),
]


@pytest.mark.parametrize(
    ("more", "tool"),
    [
        ([fixed("my_tcp", "four"), fixed("imu_link", "four")], "my_tcp"),
        ([fixed("imu_tool", "four"), fixed("camera_tool0", "four")], "four"),
        (FINGERS, "four"),
        ([body("left"), joint("gripper_jaw", "four", "left")], "four"),
    ],
)
def test_the_tool_is_named_like_one_and_is_no_sensor_and_no_finger(more, tool, urdf):
    assert chosen(urdf(*ARM, *more)) == tool


def test_the_reason_names_the_last_joint(urdf):
    assert "'d'" in choose_tool(read(urdf(*ARM)))[1]


def test_a_robot_that_is_all_fingers_has_a_tool_nevertheless(urdf):
    path = urdf(
        body("one"), body("two"), joint("finger_1", "base", "one"), joint("finger_2", "one", "two")
    )
    assert chosen(path) == "two"


TWO_ARMS = (
    *(body(name) for name in ("left_1", "left_2", "left_hand", "right_1", "right_2", "right_hand")),
    joint("left_a", "base", "left_1"),
    joint("left_b", "left_1", "left_2"),
    joint("left_jaw", "left_2", "left_hand"),
    joint("right_a", "base", "right_1"),
    joint("right_b", "right_1", "right_2"),
    joint("right_finger", "right_2", "right_hand"),
)


def test_the_tool_is_one_that_the_joint_with_play_moves(urdf):
    path = urdf(*TWO_ARMS)
    for side in ("left", "right"):
        link, reason = choose_tool(read(path), [f"{side}_a"])
        assert link == f"{side}_2"
        assert reason == (
            f"the end of the chain of moving joints with play in '{side}_a', after '{side}_b'"
        )
    assert choose_tool(read(path), ["right_finger"])[0] == "right_hand"
    both = choose_tool(read(path), ["left_a", "right_a", "right_b"])[0]
    assert both == "right_2"


def test_python_scenarios_and_the_command_line_choose_the_same_tool(urdf):
    from jointplay.cli import parser
    from jointplay.cli.commands.inputs import posed_machine, scenario_of
    from jointplay.physics.joints import RevoluteClearance

    path = str(urdf(*TWO_ARMS))
    made = Mechanism(path, {"right_a": RevoluteClearance(radial_clearance=1e-4)})
    line = ["run", path, "--joint", "right_a", "--out", "o"]
    run = scenario_of(parser().parse_args(line)).simulation().mechanism
    ideal = scenario_of(parser().parse_args([*line, "--ideal"])).simulation().mechanism
    line = ["budget", path, "--joint", "right_a=0.1 mm"]
    budget = posed_machine(parser().parse_args(line)).mechanism
    assert {one.tool for one in (made, run, ideal, budget)} == {"right_2"}
    assert made.tool_reason == run.tool_reason != ""


def test_a_tool_that_no_loose_joint_moves_is_said(urdf):
    from jointplay.cli import parser
    from jointplay.cli.commands.inputs import scenario_of
    from jointplay.scenario.assumptions import decisive

    line = ["run", str(urdf(*TWO_ARMS)), "--joint", "left_a", "--tool", "right_2", "--out", "o"]
    scenario = scenario_of(parser().parse_args(line))
    tool, note, *_ = decisive(scenario, {"result": scenario.simulation()})
    assert tool == "tool: right_2"
    assert "no joint with play moves the tool 'right_2': play in left_a shows in it only" in note


def test_the_scaras_tool_is_what_its_mechanism_takes():
    assert chosen(shipped("scara.urdf")) == Mechanism(shipped("scara.urdf")).tool


@pytest.mark.parametrize(
    ("robot", "tool"),
    [
        ("ur5", "tool0"),
        ("panda", "panda_hand_tcp"),
        ("xarm7", "link_eef"),
        ("z1", "link06"),
        ("kinova", "j2s6s200_end_effector"),
    ],
)
def test_known_arms_get_the_frame_that_people_mean(robot, tool):
    assert chosen(robot_urdf(robot)) == tool
