"""Joints that a motion does not name: held, following, or left alone."""

import numpy as np
import pytest
from conftest import body, joint

from jointplay import Mechanism, Motion, robot_scenario
from jointplay.base.errors import JointplayError
from jointplay.scenario import Scenario
from jointplay.scenario.build import complete
from jointplay.scenario.reading import parse
from jointplay.simulation.loads.controller import Controller
from jointplay.simulation.motion.completion import complete_motion


def mimicking(name, parent, child, leader, multiplier=1.0, offset=0.0):
    mimic = f'<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/></joint>'
    return joint(name, parent, child).replace("</joint>", mimic)


def bodies():
    return (body(name) for name in ("one", "two", "three", "four"))


@pytest.fixture
def arm(urdf):
    """Two joints, and two that follow: c = -2 b + 0.1 and d = 3 c - 0.2, each after its leader."""
    return urdf(
        *bodies(),
        mimicking("d", "three", "four", "c", 3.0, -0.2),
        joint("a", "base", "one"),
        joint("b", "one", "two").replace('lower="-9"', 'lower="0.4"'),
        mimicking("c", "two", "three", "b", -2.0, 0.1),
    )


def scenario(path, *settings, motion='times=[0, "20 ms"]\njoints.a=[0, 0.1]'):
    text = f'[robot]\nurdf="{path}"\ngravity="balanced"\n[motion]\n{motion}\n'
    return Scenario(text, path.parent / "s.toml", [parse(text) for text in settings])


@pytest.mark.parametrize("interpolation", ["rest-to-rest", "spline", "constant-speed"])
def test_followers_follow_at_every_time(arm, interpolation):
    motion = Motion(["a", "b"], [0.0, 1.0, 2.0], [[0, 0.5], [1, 1], [2, 1.5]], interpolation)
    found = complete_motion(Mechanism(arm), motion)
    position, speed, acceleration = (
        dict(zip(found.motion.joints, values.T, strict=True))
        for values in found.motion(np.linspace(0.0, 2.0, 101))
    )
    assert position["c"] == pytest.approx(-2.0 * position["b"] + 0.1, abs=1e-9)
    assert position["d"] == pytest.approx(3.0 * position["c"] - 0.2, abs=1e-9)
    assert speed["d"] == pytest.approx(-6.0 * speed["b"], abs=1e-9)
    assert acceleration["d"] == pytest.approx(-6.0 * acceleration["b"], abs=1e-8)
    assert not found.held
    assert "c = -2 b + 0.1" in found.notes()[0]
    assert "d = 3 c - 0.2" in found.notes()[0]


def test_what_is_not_named_is_held_at_zero_or_between_limits_that_exclude_it(arm):
    found = complete_motion(Mechanism(arm), Motion(["d"], [0.0, 1.0], [[0.0], [0.3]]))
    assert found.held == {"a": 0.0, "b": 4.7}  # midway between 0.4 and 9
    assert set(found.following) == {"c"}  # d is named, and does as it is told
    assert "a at 0; b at 4.7" in found.notes()[0]
    assert found.motion(np.array([0.5]))[0][0, found.motion.joints.index("c")] == pytest.approx(
        -2.0 * 4.7 + 0.1
    )


def test_a_motion_of_all_joints_is_not_touched(arm):
    motion = Motion(["a", "b", "c", "d"], [0.0, 1.0], np.zeros((2, 4)))
    found = complete_motion(Mechanism(arm), motion)
    assert found.motion is motion
    assert not found.notes()


def test_joints_that_are_left_alone_are_followed_by_none(arm):
    found = complete_motion(Mechanism(arm), Motion(["a"], [0.0, 1.0], [[0.0], [1.0]]), alone={"b"})
    assert found.motion.joints == ("a",)


def test_a_scenario_runs_with_one_joint_of_its_motion(arm):
    found = scenario(arm, "start.b=0.7")
    result = found.simulation().run(check_step=False)
    last = result["q"].isel(time=-1)
    at = {str(c): float(last.sel(coordinate=c)) for c in last["coordinate"].values}
    assert at == pytest.approx({"a": 0.1, "b": 0.7, "c": -1.3, "d": -4.1}, abs=1e-5)
    assert len(found.notes) == 2
    found.simulation()
    assert len(found.notes) == 2  # said once


def test_joints_with_drives_of_their_own_are_not_held(arm):
    free = scenario(arm, "drives.b=free").simulation()
    assert set(free.motion.joints) == {"a"}
    assert {name for name, drive in free.drive.items() if drive.follows} == {"a"}
    led = scenario(arm, "drives.c=prescribed").simulation()
    assert led.drive["c"].kind == "prescribed"
    assert led.drive["b"].kind == "computed-torque"


def test_where_drives_are_given_what_starts_somewhere_moves(arm):
    found = scenario(arm, "drives.c=free", "drives.d=free", "start.b=0.7").simulation()
    assert found.motion.joints == ("a",)
    assert found.state == {"b": (0.7, None)}


def test_a_joint_with_a_speed_at_the_start_is_not_held(arm):
    with pytest.raises(JointplayError, match="lacks b"):
        scenario(arm, "start_speed.b=1").ready_run()


def idle(time, q, v, p):
    return [0.0]


def test_a_joint_with_a_controller_is_not_held(arm):
    model = scenario(arm).model("s")
    motion = Motion(["a"], [0.0, 1.0], [[0.0], [1.0]])
    loads = {"pid": Controller(("b",), idle, period=1e-3)}
    whole, _ = complete(model, Mechanism(arm), motion, {}, loads)
    assert whole.joints == ("a",)


@pytest.mark.parametrize("name", ["slider_crank", "four_bar"])
def test_linkages_are_left_alone(name):
    found = Scenario.load(f"jointplay:{name}.toml")
    for case in found.cases:
        assert len(found.simulation(case).motion.joints) == 1
    assert not found.notes


def test_a_bare_robot_has_its_tool_chosen_and_its_followers_follow(arm):
    found = robot_scenario(str(arm), ideal=True)
    motion = found.simulation().motion
    ends = dict(zip(motion.joints, motion.positions[1], strict=True))
    assert ends["c"] == pytest.approx(-2.0 * ends["b"] + 0.1)
    assert any("mimic others follow their references" in note for note in found.notes)
    assert found.simulation().mechanism.tool == "four"


def test_a_tool_that_is_named_is_taken(arm):
    found = robot_scenario(str(arm), settings=[parse("robot.tool=two")], ideal=True)
    assert found.simulation().mechanism.tool == "two"
    assert not any("tool:" in line for line in found.assumptions)
