"""What play, elasticity and drives each do to a tool: against twins that are made by hand."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from conftest import ARM_WITH_HAND, body, joint

import jointplay as jp
from jointplay import analysis
from jointplay.cli import main
from jointplay.physics.kernel import Status
from jointplay.simulation.analysis import twins
from jointplay.simulation.analysis.headline import headline

SERVO = jp.loads.Servo(voltage=12.0, p_gain=40.0, torque_constant=2.0, resistance=2.0)
GEAR = jp.Gear(play=4e-3, stiffness=400.0, rotor_inertia=0.05, damping=0.3)
QUIET = {"estimate": False, "check_step": False}


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """An arm that lifts 1 kg at 0.2 m, its tool at 0.4 m."""
    text = (
        '<robot name="arm"><link name="base"/>'
        + body("arm", 1.0, "0.2 0 0")
        + joint("lift", "base", "arm", axis="0 -1 0")
        + '<link name="tip"/><joint name="t" type="fixed"><parent link="arm"/>'
        '<child link="tip"/><origin xyz="0.4 0 0"/></joint></robot>'
    )
    path = tmp_path_factory.mktemp("arm") / "arm.urdf"
    path.write_text(text)
    return path


def lifted(arm, gear=GEAR, drive=SERVO, **more):
    mechanism = jp.Mechanism(arm, gears={"lift": gear}, tool="tip")
    motion = jp.Motion(["lift"], [0.0, 0.1, 0.2], [[0.0], [0.1], [0.0]])
    return jp.Simulation(mechanism, motion, drive=drive, **more)


@pytest.fixture(scope="module")
def servo(arm):
    return lifted(arm).run(**QUIET)


def tool(simulation):
    return simulation.run(**QUIET)["tool_position"].values


def test_parts_are_those_of_twins_made_by_hand_and_add_up(arm, servo):
    """The rigid one has its rotor: it is where one with a gear a thousand times as stiff is."""
    found = servo.tool_error.parts
    assert list(found) == ["drive", "elasticity", "play"]
    own = servo["tool_position"].values
    still = tool(lifted(arm, replace(GEAR, play=0.0)))
    np.testing.assert_allclose(found["play"].values, own - still, atol=1e-9)
    stiff = tool(lifted(arm, replace(GEAR, play=0.0, stiffness=4e5, damping=10.0)))
    assert np.abs(found["elasticity"].values - (still - stiff)).max() < 1e-5
    assert np.linalg.norm(found["elasticity"].values, axis=1).max() > 1e-3
    bare = tool(replace(lifted(arm), mechanism=lifted(arm).mechanism.ideal()))
    assert np.abs(bare - stiff).max() > 1e-4  # without the rotor it is another machine
    angle = servo.simulation.motion(servo.time)[0][:, 0]
    sent = 0.4 * np.stack([np.cos(angle), 0.0 * angle, np.sin(angle)], axis=1)
    np.testing.assert_allclose(sum(found.values()).values, own - sent, atol=1e-12)


def test_a_servo_is_told_apart_from_elasticity_and_play(servo):
    error = servo.tool_error
    line, (along, _) = str(error), error.further()
    assert line.startswith("The tool 'tip' is up to ")
    assert " mm from where it was sent (at t = " in line
    for name in ("servos", "elasticity", "play"):
        part = error.parts["drive" if name == "servos" else name]
        size = 1e3 * np.linalg.norm(part.values, axis=1)
        assert f"{name} {size.max():.3g} (RMS {np.sqrt((size**2).mean()):.3g})" in line
    whole = np.linalg.norm(sum(error.parts.values()).values, axis=1).max()
    shares = [float(word.split()[-1]) for word in along.partition(": ")[2].split(", ")]
    assert sum(shares) == pytest.approx(1e3 * whole, rel=0.01)
    assert servo.summary().splitlines()[0] == line


def test_what_a_rule_gave_is_said_and_left_out_of_the_figure(arm):
    made = lifted(arm, jp.Gear(play=4e-3), jp.loads.ComputedTorque()).run(**QUIET)
    line = str(made.tool_error)
    play = 1e3 * np.linalg.norm(made.tool_error.parts["play"].values, axis=1).max()
    assert line.startswith(
        f"Play of 4 mrad in the gear of lift puts the tool 'tip' up to {play:.3g}"
    )
    about = 1e3 * np.linalg.norm(made.tool_error.parts["elasticity"].values, axis=1).max()
    guess = (
        f"; elasticity about {about:.2g} mm by a guess of the gears' stiffness, --gear-stiffness"
    )
    assert f"{guess} (assumed; {about / 4:.2g} to {about * 4:.2g})" in line  # URDF without efforts
    assert line.endswith("; encoder on the motor, assumed")
    usual = arm.with_name("usual.urdf")
    limit = '<limit lower="-2" upper="2" effort="16" velocity="3"/>'
    usual.write_text(re.sub("<limit [^>]*/>", limit, arm.read_text()))
    made = lifted(usual, jp.Gear(play=4e-3), jp.loads.ComputedTorque()).run(**QUIET)
    about = 1e3 * np.linalg.norm(made.tool_error.parts["elasticity"].values, axis=1).max()
    assert (
        f"; elasticity about {about:.2g} mm if the gears are as stiff as usual (assumed; "
        in str(made.tool_error)
    )


def test_rigid_drives_are_not_told_and_what_was_given_has_its_error(arm):
    made = lifted(arm, drive=jp.loads.ComputedTorque()).run(**QUIET)
    made.certificate = jp.certify(made, strict=False)
    line = str(made.tool_error)
    peak = made.certificate["peak tool error"]
    assert line.startswith(f"The tool 'tip' is up to {peak} off (at t = ")
    assert ": play " in line
    assert ", elasticity " in line
    assert np.linalg.norm(made.tool_error.parts["drive"].values, axis=1).max() < 1e-7


def test_a_twin_has_the_same_rotors(arm, servo):
    ideal = twins.without(servo, "elasticity")
    assert analysis.is_twin(servo, ideal)
    assert not analysis.is_twin(lifted(arm, replace(GEAR, rotor_inertia=0.06)).run(**QUIET), ideal)
    bare = replace(lifted(arm), mechanism=lifted(arm).mechanism.ideal()).run(**QUIET)
    assert not analysis.is_twin(servo, bare)
    again = jp.Mechanism.from_fields(ideal.simulation.mechanism.describe())
    assert again.armature == {"lift": 0.05}
    assert again.model.armature.tolist() == [0.05]


def test_a_drive_that_acts_through_teeth_on_its_encoder_is_named_where_it_diverges(arm):
    drive = jp.loads.ComputedTorque(bandwidth=400.0, encoder="link")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        made = lifted(arm, drive=drive).run(**QUIET)
    assert made.status == Status.RUN_AWAY
    first = made.summary().splitlines()[0]
    assert "the drive of lift acts through the teeth of its gear" in first
    assert "--encoder motor" in first
    assert " off " not in made.summary()


def test_a_tool_that_stands_has_its_angle_said():
    case = jp.Scenario.load("jointplay:four_bar.toml")
    made = case.simulation("0.2 mm", {"integration": {"duration": "50 ms"}}).run(**QUIET)
    line = str(made.tool_error)
    assert line.startswith("Play of 0.2 mm in rocker_end turns 'rocker' by up to ")
    assert "and leaves its origin in place" in line


def test_a_tool_that_stands_because_only_its_own_joint_moves_has_its_distance_said(tmp_path):
    (path := tmp_path / "arm.urdf").write_text(ARM_WITH_HAND)
    loose = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    robot = jp.Mechanism(path, {"j": loose}, tool="hand")
    motion = jp.Motion(["k"], [0.0, 0.02], [[0.0], [0.1]])
    made = jp.simulate(robot, motion, drive="prescribed", duration=0.02, estimate=False)
    assert str(made.tool_error).startswith("Play of 0.1 mm in j puts the tool 'hand' up to ")


def test_a_tool_that_no_play_moves_is_said_so_and_the_output_proposed():
    case = jp.Scenario.load("jointplay:four_bar.toml")
    changes = {"integration": {"duration": "20 ms"}, "robot": {"tool": "crank"}}
    made = case.simulation("0.2 mm", changes).run(**QUIET)
    line = str(made.tool_error)
    assert line.startswith("Play of 0.2 mm in rocker_end does not move the tool 'crank'")
    assert "--tool rocker" in line
    assert " mm off" not in line


def test_a_corrected_motion_is_judged_by_the_one_that_was_meant(arm, tmp_path, capsys):
    """The correction of a hand that knows better: what is left is what it was made of."""
    lift = [[0.0], [0.1], [0.0]]
    times = [0.0, 0.1, 0.2]
    meant, moved = (jp.Motion(["lift"], times, np.array(lift) + more) for more in (0.0, 0.01))
    for name, one in (("meant", meant), ("moved", moved)):
        (tmp_path / f"{name}.csv").write_text(one.csv())
    run = ["run", str(arm), "--gear", "lift=4 mrad", "--gear-stiffness", "1e7", "--tool", "tip"]
    run += ["--rotor-inertia", "0.05", "--motion", str(tmp_path / "moved.csv"), "--quiet"]
    beside = ["--beside", str(tmp_path / "meant.csv"), "--out", str(tmp_path / "out")]
    assert main([*run, "--no-figures", "--no-error-estimate", *beside]) == 0
    said = capsys.readouterr().out
    result = jp.Result.load(tmp_path / "out" / "result.nc")
    off = result["tool_position"].values - tool(
        jp.Simulation(result.simulation.mechanism.ideal(), meant)
    )
    size = np.linalg.norm(off, axis=1).max()
    assert size > 3e-3  # 10 mrad less 2 at 0.4 m
    words = f"is up to {1e3 * size:.3g} mm from where the ideal mechanism's is on the motion as it "
    assert words in said
    assert words in result.summary()
    assert result.certificate is None


def test_blanks_between_the_numbers_of_a_file_make_no_other_robot(urdf):
    path = urdf(body("arm", com="0.3  0\t0"), joint("j", "base", "arm", axis="0  1 0"))
    gear = jp.Gear(play=1e-3, stiffness=1e4, rotor_inertia=0.1, damping=20.0)
    motion = jp.Motion(["j"], [0.0, 0.02], [[0.0], [0.01]])
    result = jp.simulate(jp.Mechanism(path, gears={"j": gear}), motion)
    assert twins.is_twin(result, twins.twin(result))


def test_servos_of_a_machine_without_play_are_told_from_where_the_motion_sends_the_tool():
    robot = jp.Mechanism("so101")
    servo = jp.loads.Servo.of("STS3215", voltage=7.4, p_gain=38.6)
    motion = jp.Motion(["elbow_flex"], [0.0, 0.05, 0.1], [[0.0], [0.02], [0.0]])
    result = jp.Simulation(robot, motion, drive=servo).run(**QUIET)
    motion = result.simulation.motion  # in which the other joints stand
    data, farthest = robot.model.createData(), 0.0
    for time, place in zip(result.time, result["tool_position"].values, strict=True):
        at = dict(zip(motion.joints, motion(np.array([time]))[0][0], strict=True))
        pin.framesForwardKinematics(robot.model, data, robot.configuration(at))
        sent = data.oMf[robot.tool_frame].translation
        farthest = max(farthest, float(np.linalg.norm(place - sent)))
    (line,) = headline(result, None)
    assert line.endswith(": servos")
    assert f"is up to {1e3 * farthest:.3g} mm from where it was sent" in line


def test_a_loose_pin_is_judged_beside_the_ideal_one_and_by_the_turn():
    """The ideal pin's force by Newton and Euler, written anew, of a slider-crank at 600 rpm."""
    r, rod, sliding, mass, speed, g = 0.05, 0.12, 0.14, 0.21, 20 * np.pi, 9.81
    linkage = jp.Linkage(
        points={"O": (0, 0), "A": (r, 0), "B": (r + rod, 0)},
        ground=["O"],
        links={
            "crank": jp.LinkageLink(["O", "A"], mass=0.3),
            "rod": jp.LinkageLink(["A", "B"], mass=mass, inertia=2.5e-4),
            "slider": jp.LinkageLink(["B"], mass=sliding),
        },
        sliders={"guide": jp.LinkageSlider("slider", (1, 0))},
    )
    pin = jp.RevoluteClearance.planar(radial_clearance=1e-4)
    turns = jp.Motion(["O"], [0, 0.2], [[0], [0.2 * speed]], "constant-speed")
    result = jp.simulate(
        jp.Mechanism(linkage, {"B": pin}), turns, drive={"O": jp.loads.Prescribed()}
    )
    time = np.linspace(0, 0.2, 8001)
    angle = speed * time
    place = r * np.cos(angle) + np.sqrt(rod**2 - (r * np.sin(angle)) ** 2)
    lean = np.arctan2(-r * np.sin(angle), place - r * np.cos(angle))

    def twice(values):
        return np.gradient(np.gradient(values, time, edge_order=2), time, edge_order=2)

    half = 0.5 * rod * np.array([np.cos(lean), np.sin(lean)])
    middle = r * np.array([np.cos(angle), np.sin(angle)]) + half
    push = mass * np.array([twice(middle[0]), twice(middle[1]) + g])
    along = -sliding * twice(place)
    moment = 2.5e-4 * twice(lean) + half[0] * push[1] - half[1] * push[0]
    across = (moment + 2.0 * half[1] * along) / (2.0 * half[0])
    ideal = np.hypot(along, across)[20:-20].max()
    line = result.summary()
    said = float(re.search(r"\(ideal ([\d.]+) N\)", line)[1])
    assert said == pytest.approx(ideal, rel=2e-3)
    assert result.rattle.turns == pytest.approx(2.0, rel=1e-2)
