"""Hunting of position servos: swings at rest beside theory, without play, and beside no servo."""

import subprocess
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint
from warm import JOINTPLAY

import jointplay as jp
from jointplay.study import hunting
from jointplay.study.hunting import Axis, Span, Trial, describing_function, predicted, swing

GEAR = jp.Gear(play=8.7e-3, rotor_inertia=0.0284, stiffness=300.0, damping=1.0)


def axis(p_gain, rubs=None, **changes):
    servo = jp.loads.Servo.of(
        "STS3215", voltage=7.4, p_gain=p_gain, **({"encoder": "link"} | changes)
    )
    return Axis("a", False, 0.05, 0.0, GEAR, servo, rubs or jp.loads.JointFriction())


def at(one, play=True, start=2.0, **options):
    return swing(Trial(one, start * GEAR.play, play, **options))


def test_the_describing_function_is_the_first_harmonic_of_a_gap():
    angle = np.linspace(0.0, 2.0 * np.pi, 200_001)[:-1]
    for ratio in (0.1, 0.5, 0.9):
        sine = np.sin(angle)
        out = np.sign(sine) * np.maximum(np.abs(sine) - ratio, 0.0)
        assert describing_function(ratio) == pytest.approx(2.0 * np.mean(out * sine), abs=1e-8)
    assert describing_function(1.5) == 0.0


@pytest.mark.parametrize("p_gain", [77.0, 150.0, 300.0])
def test_play_makes_a_servo_hunt_whose_encoder_is_on_the_link(p_gain):
    one = axis(p_gain)
    found = [at(one, start=start) for start in (0.5, 8.0)]
    assert all(swing.hunts for swing in found)
    assert found[0].amplitude == pytest.approx(found[1].amplitude, rel=0.02)  # whatever the start
    assert found[0].frequency == pytest.approx(predicted(one).frequency, rel=0.2)
    assert found[0].twist == pytest.approx(predicted(one).twist, rel=0.25)
    assert not at(one, play=False).hunts


def test_slow_swings_are_waited_for():
    """A heavy link swings at 0.65 Hz: in 1.5 s nothing of that is seen."""
    slow = replace(axis(38.6), inertia=0.324)
    found = at(slow)
    assert found.frequency == pytest.approx(0.65, abs=0.02)
    assert found.amplitude > 0.5 * GEAR.play
    assert predicted(slow).hunts
    short = at(slow, longest=1.5)
    assert short.unclear
    assert not short.hunts
    assert not at(slow, play=False).unclear


def test_what_sinks_slowly_onto_its_load_is_no_swing():
    sinks = replace(axis(0.6), load=0.06)
    assert at(sinks) == hunting.QUIET


def test_the_screens_friction_is_the_first_harmonic_of_one_that_creeps():
    angle = np.linspace(0.0, 2.0 * np.pi, 10_001)[:-1]
    for speed in (0.1, 1.0, 3.0, 10.0):
        first = 2.0 * np.mean(np.tanh(speed * np.sin(angle)) * np.sin(angle)) / speed
        assert first == pytest.approx(1.0 / np.hypot(0.25 * np.pi * speed, 1.0), rel=0.04)


def test_on_the_motors_side_it_is_quiet():
    one = axis(150.0, encoder="motor")
    assert not at(one).hunts
    assert not predicted(one).hunts


def test_an_integral_hunts_without_play_as_well():
    one = axis(38.6, i_gain=5e3, encoder="motor")
    assert at(one).hunts
    assert at(one, play=False).hunts


def test_stiction_and_an_integral_hunt_where_friction_that_creeps_does_not():
    """The motor sticks, the integral grows until it slips: slowly, and without play."""
    how = {"i_gain": 100.0, "encoder": "motor", "friction": 0.0}
    sticks = jp.loads.JointFriction(
        0.05, static=0.2, stribeck_speed=0.02, presliding=1e-3, presliding_damping=0.05
    )
    long = {"longest": 24.0}
    found = at(axis(20.0, sticks, **how), play=False, **long)
    assert found.hunts
    assert found.frequency < 2.0
    assert not at(axis(20.0, jp.loads.JointFriction(viscous=0.1), **how), play=False, **long).hunts


def test_the_safe_gain_lies_between_one_that_is_quiet_and_one_that_hunts(urdf):
    path = urdf(body("disc", 1.0, "0 0 0", 0.05), joint("a", "base", "disc", "continuous"))
    robot = jp.Mechanism(path, gears={"a": GEAR})
    motion = jp.Motion(["a"], [0, 1.0], [[0.0], [0.1]])
    servo = replace(axis(100.0).drive, dead_band=3e-3)
    simulation = jp.Simulation(robot, motion, drive=servo, joint_friction={})
    (found,) = hunting.hunting(simulation, starts=(2.0,), jobs=1)
    assert found.axis.inertia == pytest.approx(0.05)
    assert found.quiet < found.hunting < 1.05 * found.quiet
    assert not at(replace(found.axis, drive=replace(servo, p_gain=found.quiet))).hunts
    assert at(replace(found.axis, drive=replace(servo, p_gain=found.hunting))).hunts
    assert "a" in str(hunting.table([found]))


def push(time, q, v, p, out):
    out[0] = -p[0] * q[0]


def test_a_controller_of_ones_own_hunts_as_the_servo_does(urdf):
    path = urdf(body("disc", 1.0, "0 0 0", 0.05), joint("a", "base", "disc", "continuous"))
    servo = axis(150.0).drive
    one = jp.loads.Controller(("a",), push, (servo.stall * 150.0,))
    robot = jp.Mechanism(path, gears={"a": replace(GEAR, damping=1.0)})
    simulation = jp.Simulation(robot, drive={}, loads={"own": one}, joint_friction={}, duration=1.0)
    own = Axis.of(simulation, "a", {})
    assert own.encoder == "link"
    assert at(own).hunts
    assert predicted(own) == hunting.QUIET


class Sampled:
    """A PD controller in Python, with a memory."""

    def __init__(self, kp, kd):
        self.kp, self.kd, self.calls = kp, kd, 0

    def __call__(self, time, q, v):
        self.calls += 1
        return [-self.kp * q[0] - self.kd * v[0]]


def held_by(disc, numbers, encoder="link"):
    one = jp.loads.Controller(("a",), Sampled, numbers, period=1e-3, encoder=encoder)
    robot = jp.Mechanism(disc, gears={"a": GEAR})
    return jp.Simulation(robot, drive={}, loads={"own": one}, joint_friction={}, duration=1.0)


def test_a_controller_in_python_hunts_by_its_play_and_has_no_gain_that_is_known(urdf):
    disc = urdf(body("disc", 1.0, "0 0 0", 0.05), joint("a", "base", "disc", "continuous"))
    (found,) = hunting.hunting(held_by(disc, (70.0, 0.5)), starts=(2.0,), jobs=1)
    assert found.verdict == "play"
    assert found.quiet is None
    assert found.hunting is None
    assert "hunts at rest: a +-" in hunting.sentence([found])
    (quiet,) = hunting.hunting(held_by(disc, (70.0, 5.0), "motor"), starts=(2.0,), jobs=1)
    assert quiet.verdict == "quiet"
    with pytest.raises(jp.JointplayError, match="no servo whose gains"):
        hunting.gain_map(found.axis, Span("p_gain", np.ones(2)), Span("d_gain", np.ones(2)))


def test_a_map_shows_where_play_hunts_and_where_gains_do(tmp_path):
    found = hunting.gain_map(
        axis(100.0), Span("p_gain", np.array([20.0, 300.0])), Span("d_gain", np.array([0.0, 8.0])),
        jobs=1,
    )  # fmt: skip
    assert found.amplitude[0, 1] > 5e-3
    assert found.screen[0, 1]
    assert not found.control.any()
    assert found.frequency[0, 1] == pytest.approx(7.3, rel=0.05)
    from jointplay.show.plots.design import gains

    gains(found).savefig(tmp_path / "gains.png")
    with pytest.raises(jp.JointplayError, match="over two gains"):
        hunting.gain_map(axis(1.0), Span("p_gain", np.ones(2)), Span("p_gain", np.ones(2)))


def command(*options):
    line = [JOINTPLAY, "study", "hunting", *options]
    return subprocess.run(line, capture_output=True, text=True, check=False)


BAD = [
    (["ur5"], "hunting is of gears with play under servos: give a scenario or --preset, or --gear"),
    (["so101", "--preset", "--of", "elbow"], "no moving joint 'elbow'"),
    (["so101", "--preset", "--map", "p_gain=1:2"], "--map must read GAIN=FROM:TO:COUNT"),
    (["so101", "--preset", "--map", "p_gain=1:2:3"], "give --map twice, got 1"),
]


@pytest.mark.parametrize(("options", "words"), BAD)
def test_what_cannot_be_asked_is_refused_in_a_line(options, words):
    done = command(*options)
    assert done.returncode == 2
    assert done.stderr.count("\n") <= 1 + len(options)  # what was chosen, and the refusal
    assert words in done.stderr


def test_the_command_says_whether_a_robot_hunts(tmp_path):
    options = ["--of", "wrist_roll", "--preset", "--quiet", "--jobs", "1", "--out", str(tmp_path)]
    done = command("so101", *options)
    assert "at rest" in done.stdout
    assert "wrist_roll" in (tmp_path / "hunting.csv").read_text()
