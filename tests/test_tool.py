"""Which frame is the tool, where nobody says so."""

import pytest
from conftest import body, joint

from jointplay import Mechanism, shipped
from jointplay.mechanism import urdf as reader
from jointplay.mechanism.robots import robot_urdf
from jointplay.mechanism.tool import choose_tool


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
    return choose_tool(reader.read(path))[0]


def test_a_frame_with_a_tools_name_at_the_end_of_the_chain_is_the_tool(urdf):
    assert chosen(urdf(*ARM, fixed("my_tcp", "four"), fixed("imu_link", "four"))) == "my_tcp"


def test_an_imu_or_a_camera_is_never_the_tool(urdf):
    path = urdf(*ARM, fixed("imu_tool", "four"), fixed("camera_tool0", "four"))
    assert chosen(path) == "four"


def test_fingers_are_not_the_tool(urdf):
    fingers = (
        body("left"),
        body("right"),
        joint("left_slide", "four", "left", "prismatic"),
        joint("right_slide", "four", "right", "prismatic"),
    )
    assert chosen(urdf(*ARM, *fingers)) == "four"
    jaw = (body("left"), joint("gripper_jaw", "four", "left"))
    assert chosen(urdf(*ARM, *jaw)) == "four"


def test_the_reason_names_the_last_joint(urdf):
    assert "'d'" in choose_tool(reader.read(urdf(*ARM)))[1]


def test_a_robot_that_is_all_fingers_has_a_tool_nevertheless(urdf):
    path = urdf(
        body("one"), body("two"), joint("finger_1", "base", "one"), joint("finger_2", "one", "two")
    )
    assert chosen(path) == "two"


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
