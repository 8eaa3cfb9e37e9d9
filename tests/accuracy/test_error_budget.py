"""The whole error of a tool: sets add, variances add, loads shift; against the exact kinematics."""

import numpy as np
import pytest

import jointplay as jp
from jointplay import cli
from jointplay.accuracy.causes import CAUSES
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.robot_errors import JointErrors, RobotErrors
from jointplay.base.errors import JointplayError, MissingName
from jointplay.physics.joints.play import Play
from jointplay.show.plots.design import cause_bars
from jointplay.simulation.loads.drive import Prescribed

JOINTS = {
    "elbow_joint": jp.BallBearing(designation="7010 C DB", preload=200.0),
    "wrist_1_joint": jp.CrossedRollerBearing(designation="RB2008"),
    "wrist_2_joint": jp.RevoluteClearance(radial_clearance=2e-5, axial_clearance=2e-5),
}
POSE = {"shoulder_lift_joint": -0.7, "elbow_joint": 0.9, "wrist_1_joint": 0.3}


@pytest.fixture(scope="module")
def robot():
    """A UR5 with bearings of three kinds."""
    return jp.Mechanism("example-robot-data:ur5", JOINTS)


@pytest.fixture(scope="module")
def whole(robot):
    """Its budget with all causes."""
    return budget(robot, POSE, kind="industrial", causes=CAUSES)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["calibrated-industrial", "industrial"])
def test_worst_case_and_variance_against_random_states_of_the_exact_kinematics(robot, kind):
    found = budget(robot, POSE, kind=kind, force=(20.0, 0.0, -50.0), causes=CAUSES)
    drawn = found.sample(20_000)
    distance = np.linalg.norm(drawn, axis=1)
    assert distance.max() <= found.worst[0]
    assert found.reached == pytest.approx(found.worst[0], rel=0.02)
    assert np.sqrt((distance**2).mean()) == pytest.approx(found.rms[0], rel=0.02)
    spread = np.cov(drawn.T)
    # The force makes drives sag by 1.4 mm, whose second order changes the smallest component.
    assert np.diag(spread) == pytest.approx(np.diag(found.covariance[0]), rel=0.04)
    assert drawn.mean(axis=0) == pytest.approx(found.mean[0], abs=0.02 * found.rms[0])


def test_causes_seen_from_a_body_against_the_exact_kinematics(robot):
    found = budget(
        robot, POSE, kind="calibrated-industrial", causes=CAUSES, relative_to="forearm_link"
    )
    assert found.reached == pytest.approx(found.worst[0], rel=1e-3)
    moving = {one.joint for one in found.model.contributions}
    assert moving == {"wrist_1_joint", "wrist_2_joint", "wrist_3_joint"}


def test_parts_sum_to_the_worst_case_and_shares_of_variance_to_one(whole):
    assert whole.worst_parts.sum(axis=1) == pytest.approx(whole.worst)
    for what in ("joint", "cause"):
        parts = whole.by(what)
        assert sum(worst for worst, _ in parts.values()) == pytest.approx(whole.worst[0])
        assert sum(share for _, share in parts.values()) == pytest.approx(1.0)
    assert set(whole.by("cause")) == {*CAUSES} - {"sag"}  # of computed torque under its weight


def test_states_of_a_joint_are_drawn_once_however_many_parts_are_halved(robot, monkeypatch):
    drawn = []
    draw = Play.draw
    monkeypatch.setattr(Play, "draw", lambda self, *about: drawn.append(self) or draw(self, *about))
    found = budget(robot, POSE, kind="industrial", causes=CAUSES)
    for k in range(len(found.model.contributions)):
        found.halved(k)
    found.data()
    assert len(drawn) == len({id(one) for one in drawn}) > 0


def test_what_is_given_counts_and_is_not_called_assumed(robot):
    exact = {name: JointErrors(axis_offset=0.0, axis_tilt=0.0) for name in robot.joints}
    about = {"causes": ["geometry", "encoder"], "kind": "industrial"}
    found = budget(robot, POSE, errors=RobotErrors(joints=exact), **about)
    assert found.by("cause")["geometry"] == (0.0, 0.0)
    assert not any("geometry" in line for line in found.assumed)
    assert any("encoder" in line for line in found.assumed)
    fine = {name: JointErrors(encoder=0.0, zero_offset=0.0) for name in robot.joints}
    none = budget(robot, POSE, errors=RobotErrors(joints=fine), causes=["encoder"])
    assert none.worst[0] == 0.0


def test_an_encoder_alone_is_half_of_its_step_times_the_lever(robot):
    step = {"shoulder_pan_joint": JointErrors(encoder=1e-3, zero_offset=0.0)}
    rest = {
        name: JointErrors(encoder=0.0, zero_offset=0.0)
        for name in robot.joints
        if name != "shoulder_pan_joint"
    }
    found = budget(robot, POSE, errors=RobotErrors(joints={**rest, **step}), causes=["encoder"])
    position = np.array(robot.data.oMf[robot.tool_frame].translation)
    lever = np.linalg.norm(position[:2])
    assert found.worst[0] == pytest.approx(0.5e-3 * lever, rel=1e-6)
    assert found.rms[0] == pytest.approx(1e-3 / np.sqrt(12.0) * lever, rel=1e-6)


def test_halving_buys_about_half_of_what_a_cause_adds(whole):
    index = int(whole.worst_parts[0].argmax())
    worst, rms = whole.halved(index)
    assert worst == pytest.approx(0.5 * whole.worst_parts[0, index], rel=0.1)
    assert 0.0 < rms < whole.rms[0]


def test_an_elastic_joint_sags_as_its_stiffness_says():
    soft = jp.CompliantJoint(elasticity=jp.Elasticity(radial=1e7, axial=1e7, tilt=1e4))
    robot = jp.Mechanism("example-robot-data:ur5", {"elbow_joint": soft})
    hard = jp.Elasticity(radial=1e14, axial=1e14, tilt=1e12)
    rigid = JointErrors(torsional_stiffness=1e12, elasticity=hard)
    stiff = dict.fromkeys(robot.joints, rigid)
    stiff["elbow_joint"] = JointErrors(torsional_stiffness=1e12)
    known = RobotErrors(joints=stiff, stiffness_spread=0.0)
    found = budget(robot, POSE, errors=known, causes=["elasticity"])
    rest = budget(robot, POSE, drive=Prescribed())
    assert found.mean[0] == pytest.approx(rest.rest_tool[0, :3], rel=5e-3, abs=1e-7)


def test_a_class_that_does_not_fit_is_said(robot, whole):
    soft = RobotErrors(torsional_stiffness=60.0)
    text = str(budget(robot, POSE, errors=soft, kind="printed", causes=CAUSES).table())
    assert "too far for Jacobians" in text
    assert "too far" not in str(whole.table())


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"kind": "industrail"}, "industrial"),
        ({"causes": ["wear"]}, "elasticity"),
        ({"errors": RobotErrors(joints={"elbow": JointErrors()})}, "elbow_joint"),
        ({"force": (1.0, 2.0)}, "three components"),
    ],
)
def test_wrong_input_is_refused_with_the_choices(robot, options, says):
    with pytest.raises((JointplayError, MissingName), match=says):
        budget(robot, POSE, **{"causes": CAUSES, **options})


def test_bars_show_parts_that_sum_to_the_worst_case_and_the_variance(robot):
    at = {"shoulder_lift_joint": -1.0}
    found = budget(robot, at, kind="industrial", force=(0.0, 0.0, -50.0), causes=CAUSES)
    figure = cause_bars(found)
    worst, variance = (
        sum(bar.get_width() for bars in panel.containers for bar in bars) for panel in figure.axes
    )
    assert worst == pytest.approx(1e3 * found.worst[0], rel=1e-9)
    assert variance == pytest.approx(100.0, rel=1e-9)
    named = {text.get_text() for text in figure.legends[0].get_texts()}
    assert named == set(found.by("cause"))


@pytest.mark.usefixtures("checked_figures")
def test_the_command_line_prints_and_writes_it(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["budget", "ur5", "--joint", "elbow_joint=6010/C3", "--whole", "industrial"]
    assert cli.main([*options, "--payload", "5 kg", "--detail", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "elasticity" in shown
    assert "assumed: geometry: offset 0.0003 m, tilt 0.0003 rad (class 'industrial')" in shown
    assert "by cause:" in shown
    text = (out / "errors.csv").read_text()
    assert "elbow_joint,play" in text
    assert (out / "errors.png").read_bytes().startswith(b"\x89PNG")
    assert cli.main([*options, "--causes", "play,wear"]) == 2
    assert "wear" in capsys.readouterr().err


def test_causes_without_the_whole_budget_are_refused(capsys):
    assert cli.main(["budget", "ur5", "--clearance", "1e-4", "--causes", "play"]) == 2
    assert "--causes play selects causes of the whole error" in capsys.readouterr().err


def test_a_gear_gives_way_as_much_whether_or_not_its_play_is_given():
    whole = {"causes": ["elasticity"], "kind": "industrial"}
    plain = budget(jp.Mechanism("ur5"), POSE, **whole)
    geared = budget(jp.Mechanism("ur5", gears={"elbow_joint": jp.Gear(1e-3)}), POSE, **whole)
    parts = [one.by("joint")["elbow_joint"][0] for one in (plain, geared)]
    assert parts[1] == pytest.approx(parts[0], rel=1e-3)
    assert "gears' stiffness by rule, to a factor of 4" in plain.sentence
    given = jp.Gear(1e-3, 0.1, 4.5e4)
    known = budget(jp.Mechanism("ur5", gears=dict.fromkeys(JOINTS, given)), POSE, **whole)
    assert known.by("joint")["elbow_joint"][0] < 0.5 * parts[0]  # no factor of 4


def test_drives_sag_under_what_they_do_not_know_and_servos_under_all():
    """Computed torque has kp = (100 rad/s)^2 M; the statics of a budget of play find the sag."""
    load = jp.Payload("tool0", 5.0)
    robot = jp.Mechanism("ur5", gears={"elbow_joint": jp.Gear(1e-9, 0.1, 1e12)})
    rest = budget(robot, POSE, payloads=[load]).rest_positions.at(0)
    whole = budget(robot, POSE, payloads=[load], causes=["sag"])
    assert whole.mean[0] == pytest.approx(rest.sag[:3], rel=0.02, abs=2e-5)
    with pytest.raises(JointplayError, match="no cause is counted"):
        budget(jp.Mechanism("ur5"), POSE, causes=["sag"])
    servo = jp.loads.Servo(voltage=24.0, p_gain=1e3, torque_constant=1.0, resistance=1.0)
    with pytest.raises(JointplayError, match="servo of joint 'shoulder_lift_joint' cannot hold"):
        budget(jp.Mechanism("ur5"), POSE, drive=servo, payloads=[load], causes=["sag"])
    strong = jp.loads.Servo(voltage=48.0, p_gain=1e3, torque_constant=50.0, resistance=1.0)
    sagged = budget(robot, POSE, drive=strong, payloads=[load]).rest_positions.at(0)
    own = budget(robot, POSE, drive=strong, payloads=[load], causes=["sag"])
    assert own.mean[0] == pytest.approx(sagged.sag[:3], rel=0.01, abs=1e-5)


def test_numbers_that_nobody_gave_are_asked_for_in_python_as_by_the_command():
    with pytest.raises(JointplayError, match=r"nobody gave the axis offset .*--whole CLASS"):
        budget(jp.Mechanism("ur5"), POSE, causes=["geometry"])
