"""Hunting of position servos: limit cycles compared with theory, without play, without servos."""

import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint
from scipy.integrate import solve_ivp
from warm import JOINTPLAY

import jointplay as jp
from jointplay.cli import main
from jointplay.study import calm, hunting, swings
from jointplay.study.hunting import Axis, Trial, describing_function, predicted
from jointplay.study.slow_motion import slow_motion
from jointplay.study.swings import QUIET

GEAR = jp.Gear(play=8.7e-3, rotor_inertia=0.0284, stiffness=300.0, damping=1.0)


def axis(p_gain, rubs=None, **changes):
    servo = jp.loads.Servo.of(
        "STS3215", voltage=7.4, p_gain=p_gain, **({"encoder": "link"} | changes)
    )
    return Axis("a", False, 0.05, 0.0, GEAR, servo, rubs or jp.loads.JointFriction())


def at(one, play=True, start=2.0, **options):
    (found,) = hunting.swings(Trial(one, start, play, **options))
    return found


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
    """A heavy link swings at 0.65 Hz, which 1.5 s do not show."""
    slow = replace(axis(38.6), inertia=0.324)
    found = at(slow)
    assert found.frequency == pytest.approx(0.65, abs=0.02)
    assert found.amplitude > 0.5 * GEAR.play
    assert predicted(slow).hunts
    short = at(slow, longest=1.5)
    assert short.unclear
    assert not short.hunts
    assert not at(slow, play=False).unclear


SLOW = jp.Gear(2.96e-3, 0.0237, 87.9, 1.82)


def slowly(i_gain, presliding=0.0, **changes):
    """Link and motor creep through the play for seconds while an integral winds up."""
    servo = jp.loads.Servo(
        voltage=20.0, torque_constant=1.065, resistance=3.51, friction=0.0252, viscous=0.026,
        p_gain=64.3, i_gain=i_gain, encoder="link", presliding=presliding,
    )  # fmt: skip
    rubs = jp.loads.JointFriction(0.00765, viscous=0.002, presliding=presliding)
    return replace(Axis("a", False, 0.0878, 0.0, SLOW, servo, rubs), **changes)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("i_gain", "link", "period"),
    [(17.0, 0.340, 24.93), (8.0, 0.188, 44.93), (2.0, 0.05433, 147.95)],
)
def test_an_integral_that_winds_up_for_seconds_is_no_rest(i_gain, link, period):
    """It swings for ever, as by an independent integration; friction with bristles holds it."""
    for start in (0.5, 8.0):
        assert at(slowly(i_gain), start=start, longest=40.0).unclear
    found = at(slowly(i_gain))
    assert 1e3 * found.amplitude == pytest.approx(link, rel=0.02)
    assert 1.0 / found.frequency == pytest.approx(period, rel=0.02)
    assert at(slowly(i_gain, 5e-4)) == at(slowly(0.0)) == hunting.QUIET


def test_an_integral_within_a_dead_band_swings_or_dies_out():
    """With the encoder behind the play it swings, as by other code; before it, the motor creeps to
    and fro through the band, each time slower.
    """
    drive = replace(slowly(17.0).drive, dead_band=2e-4)
    found = at(slowly(17.0, drive=drive))
    assert 1e3 * found.amplitude == pytest.approx(0.5401, rel=0.01)
    assert 1.0 / found.frequency == pytest.approx(27.55, rel=0.01)
    assert at(slowly(17.0, drive=replace(drive, encoder="motor"))) == hunting.QUIET


@pytest.mark.parametrize(
    "gear",
    [
        jp.StrainWaveGear(
            ratio=100.0,
            stiffness_1=80.0,
            stiffness_2=120.0,
            torque_1=0.3,
            rated_torque=1.0,
            play=2e-3,
            damping=1.0,
            rotor_inertia=0.03,
            efficiency=0.7,
            no_load_torque=0.05,
            hysteresis=2e-3,
        ),
        SLOW,
    ],
    ids=lambda gear: gear.kind,
)
def test_the_equations_of_slow_motion_are_the_engines(gear):
    """Motion of link and motor, released aside, in the first second."""
    servo = replace(slowly(17.0).drive, d_gain=0.5, effort=2.0, resolution=1e-4)
    rubs = jp.loads.JointFriction(0.01, static=0.02, presliding=1e-3, presliding_damping=0.02)
    aside = slowly(17.0, gear=gear, drive=servo, friction=rubs, load=0.05)
    run = jp.Run(aside.simulation(1.0))
    robot = run.mechanism
    places = [robot.coordinate("a"), robot.motor("a")]
    run.workspace.q[places] += 0.02
    result = run.finish(check_step=False)
    ((time, motion),) = slow_motion(aside, 0.02, True, 1.0, 1.0, 2.0)
    for mine, there in zip(motion, result["q"].values[:, places].T, strict=True):
        assert mine == pytest.approx(np.interp(time, result.time, there), abs=4e-5)


@pytest.mark.thorough
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


@pytest.mark.thorough
def test_the_safe_gain_lies_between_one_that_is_quiet_and_one_that_hunts(urdf):
    path = urdf(body("disc", 1.0, "0 0 0", 0.05), joint("a", "base", "disc", "continuous"))
    robot = jp.Mechanism(path, gears={"a": GEAR})
    motion = jp.Motion(["a"], [0, 1.0], [[0.0], [0.1]])
    servo = replace(axis(100.0).drive, dead_band=3e-3)
    rubs = {"a": jp.loads.JointFriction(0.1)}  # without, dead band and play let it float for ever
    simulation = jp.Simulation(robot, motion, drive=servo, joint_friction=rubs)
    (found,) = hunting.hunting(simulation, starts=(2.0,), jobs=1)
    assert found.axis.inertia == pytest.approx(0.05)
    assert found.quiet < found.hunting < 1.05 * found.quiet
    assert not at(replace(found.axis, drive=replace(servo, p_gain=found.quiet))).hunts
    assert at(replace(found.axis, drive=replace(servo, p_gain=found.hunting))).hunts
    assert "a" in str(hunting.table([found]))


def push(time, q, v, p, out):
    for k in range(2):
        out[k] = p[0] * (p[2 + k] - q[k]) - p[1] * v[k]


class Sampled:
    """A PID controller of two joints held at goals; with both encoders its D term is of motors."""

    def __init__(self, kp, ki, kd, *goals):
        self.gains, self.goals, self.sum = (kp, ki, kd), np.array(goals), 0.0

    def __call__(self, time, q, v):
        kp, ki, kd = self.gains
        error = self.goals - q[:2]
        self.sum = self.sum + 1e-3 * ki * error
        return kp * error + self.sum - kd * v[-2:]


ARM = ("joint_a", "joint_b")
POSE = dict(zip(ARM, (0.3, 0.7), strict=True))
RUBS = {"encoder": "both", "rubs": jp.loads.JointFriction(0.2, viscous=0.5)}
STIFF = jp.Gear(play=5e-3, rotor_inertia=0.1, stiffness=2000.0, damping=2.0)


def arm(kp, ki=0.0, kd=3.0, encoder="link", function=Sampled, rubs=None):
    """The SCARA, two joints behind gears under one controller, at a pose that is not zero."""
    numbers = (kp, ki, kd) if function is Sampled else (kp, kd)
    own = jp.loads.Controller(
        ARM, function, (*numbers, *POSE.values()), period=1e-3 if function is Sampled else None,
        encoder=encoder,
    )  # fmt: skip
    robot = jp.Mechanism(
        jp.shipped("scara.urdf"), gears=dict.fromkeys(ARM, STIFF), gravity=(0.0, 0.0, 0.0)
    )
    friction = dict.fromkeys(ARM, rubs or jp.loads.JointFriction())
    return jp.Simulation(robot, drive={}, loads={"own": own}, joint_friction=friction)


def under_servos(own, kp, ki, kd):
    """The same robot with a servo of these gains on each joint, whose motor has no back-EMF."""
    servo = jp.loads.Servo(
        voltage=1e6, p_gain=kp, i_gain=ki, d_gain=kd, torque_constant=1e-6, resistance=1e-6,
        encoder="link", period=1e-3,
    )  # fmt: skip
    joints = own.base.mechanism.joints
    place = [POSE.get(name, 0.0) for name in joints]
    drives = {name: servo if name in ARM else jp.loads.Prescribed() for name in joints}
    motion = jp.Motion(joints, [0.0, 1e-2], [place, place])
    return replace(own, base=replace(own.base, loads={}, drive=drives, motion=motion, state={}))


@pytest.mark.thorough
def test_a_controller_of_several_joints_hunts_as_servos_of_its_gains_do():
    (own,) = hunting.released(arm(2000.0, 300.0), pose=POSE)
    assert own.gains == {"kp": 2000.0, "ki": 300.0, "kd": 3.0, "p3": 0.3, "p4": 0.7}
    for play in (True, False):
        mine = hunting.swings(Trial(own, 2.0, play))
        servos = hunting.swings(Trial(under_servos(own, 2000.0, 300.0, 3.0), 2.0, play))
        for one, other in zip(mine, servos, strict=True):
            assert one.hunts == other.hunts == play
            assert one.amplitude == pytest.approx(other.amplitude, rel=0.01)
            assert one.frequency == pytest.approx(other.frequency, rel=0.01)


@pytest.mark.nightly
def test_a_controller_of_several_joints_has_a_safe_gain_by_name():
    quick = {"starts": (2.0,), "jobs": 1}
    found = hunting.hunting(arm(400.0, kd=20.0, **RUBS), pose=POSE, gain="kp", **quick)
    assert [one.axis.joint for one in found] == list(ARM)
    quiet, hunts = found[0].quiet, found[0].hunting
    assert 500.0 < quiet < hunts < 1.5 * quiet
    assert hunts < 1000.0
    for gain, any_hunts in ((quiet, False), (hunts, True)):
        (own,) = hunting.released(arm(gain, kd=20.0, **RUBS), pose=POSE)
        assert any(one.hunts for one in hunting.swings(Trial(own, 2.0, longest=60.0))) == any_hunts
    assert f"{quiet:.3g}" in str(hunting.table(found, "kp"))
    assert found[0].above == hunting.QUIET  # by play, not by gains


@pytest.mark.thorough
def test_compiled_or_sampled_a_controller_hunts_alike_unless_its_encoders_are_on_motors():
    (compiled,) = hunting.released(arm(2000.0, function=push), pose=POSE)
    (sampled,) = hunting.released(arm(2000.0), pose=POSE)
    assert compiled.gains == {"p0": 2000.0, "p1": 3.0, "p2": 0.3, "p3": 0.7}
    mine, other = (hunting.swings(Trial(one, 2.0)) for one in (compiled, sampled))
    assert [one.frequency for one in mine] == pytest.approx([x.frequency for x in other], rel=0.05)
    (motors,) = hunting.released(arm(2000.0, kd=40.0, encoder="motor"), pose=POSE)
    assert hunting.swings(Trial(motors, 2.0)) == [hunting.QUIET] * 2


def test_what_diverges_with_and_without_play_is_said_to_be_by_gains():
    found = hunting.hunting(arm(8000.0, kd=100.0), ("joint_b",), POSE, starts=(2.0,), jobs=1)
    assert [one.verdict for one in found] == ["gains, not play"]
    assert "joint_b grows without bound" in hunting.sentence(found)


def test_joints_that_no_controller_sets_are_held_where_they_are_asked_to_be():
    (own,) = hunting.released(arm(100.0), pose=POSE | {"joint_c": 0.02})
    result = own.simulation(0.05).run(estimate=False)
    q, robot = result["q"].values, own.base.mechanism
    assert q[:, robot.coordinate("joint_c")] == pytest.approx(0.02, abs=1e-9)
    assert [q[0, robot.coordinate(name)] for name in ARM] == pytest.approx([0.3, 0.7])


def test_a_payload_in_hand_counts_from_the_start(urdf):
    disc = urdf(body("disc", 1.0, "0 0 0", 0.05), joint("a", "base", "disc", "continuous"))
    robot = jp.Mechanism(disc, gears={"a": GEAR})
    held = jp.Payload("disc", 1.0, inertia=(0.02, 0.02, 0.02))
    later = replace(held, pick=0.5)
    drive = {"a": axis(100.0).drive}
    simulation = jp.Simulation(
        robot, jp.Motion(["a"], [0, 1.0], [[0.0], [0.1]]), drive, payloads=(held, later)
    )
    assert hunting.released(simulation)[0].inertia == pytest.approx(0.07)


def still(time, q, v, p, out):
    out[0] = -100.0 * q[0]


def test_gains_of_several_controllers_have_the_names_of_their_loads():
    simulation = arm(100.0)
    one = jp.loads.Controller(ARM[:1], push, (7.0, 1.0))
    two = jp.loads.Controller(ARM[1:], Sampled, (5.0, 0.0, 1.0, 0.7), period=1e-3)
    (own,) = hunting.released(replace(simulation, loads={"one": one, "two": two}))
    assert list(own.gains) == ["one.p0", "one.p1", "two.kp", "two.ki", "two.kd", "two.p3"]
    other = own.with_gains(**{"two.kp": 9.0}).base.loads
    assert other["one"].parameters == one.parameters
    assert other["two"].parameters == (9.0, 0.0, 1.0, 0.7)
    bare = replace(simulation, loads={"own": jp.loads.Controller(ARM[:1], still)})
    with pytest.raises(jp.JointplayError, match="controller of joint_a has no parameters"):
        hunting.hunting(bare, gain="kp")


@pytest.mark.parametrize(("gain", "words"), [("kv", "no gain 'kv'"), ("ki", "ki is 0: give a")])
def test_a_gain_that_is_not_there_is_refused(gain, words):
    with pytest.raises(jp.JointplayError, match=words):
        hunting.hunting(arm(100.0), gain=gain)


@pytest.mark.thorough
def test_a_map_is_over_parameters_of_a_controller_too():
    (own,) = hunting.released(arm(100.0, **RUBS), ("joint_b",), POSE)
    kp, kd = ("kp", np.array([200.0, 1000.0])), ("kd", np.array([20.0, 60.0]))
    found = hunting.gain_map(own, kp, kd, longest=30.0, jobs=1)
    assert (found.amplitude > 0.0).tolist() == [[False, True], [False, False]]  # dies out after 6 s
    assert not found.unclear.any()
    assert not found.control.any()
    (both,) = hunting.released(arm(100.0), pose=POSE)
    with pytest.raises(jp.JointplayError, match="a map is of one joint, got joint_a, joint_b"):
        hunting.gain_map(both, kp, kd)


@pytest.mark.thorough
@pytest.mark.usefixtures("checked_figures")
def test_a_map_shows_where_play_hunts_and_where_gains_do(tmp_path):
    found = hunting.gain_map(
        axis(100.0), ("p_gain", np.array([20.0, 300.0])), ("d_gain", np.array([0.0, 8.0])),
        jobs=1,
    )  # fmt: skip
    assert found.amplitude[0, 1] > 5e-3
    assert found.screen[0, 1]
    assert not found.control.any()
    assert found.frequency[0, 1] == pytest.approx(7.3, rel=0.05)
    from jointplay.show.plots.design import gains

    found.amplitude[1, 1] = np.inf  # as if it diverged
    gains(found).savefig(tmp_path / "gains.png")
    with pytest.raises(jp.JointplayError, match="over two gains"):
        hunting.gain_map(axis(1.0), ("p_gain", np.ones(2)), ("p_gain", np.ones(2)))


def command(*options):
    line = [JOINTPLAY, "study", "hunting", *options]
    return subprocess.run(line, capture_output=True, text=True, check=False)


BAD = [
    (
        ["ur5"],
        "gear with play under a servo, none is given: add --gear JOINT=PLAY and --set 'drives",
    ),
    (["so101", "--gear", "elbow_flex=1 deg"], "add --preset, which has the servos of so101"),
    (["ar4", "--preset"], "'joint_1' has neither a servo nor a controller of its own: give --set"),
    (["so101", "--preset", "--of", "elbow"], "no moving joint 'elbow'"),
    (["so101", "--preset", "--map", "p_gain=1:2"], "--map must read GAIN=FROM:TO:COUNT"),
    (["so101", "--preset", "--map", "p_gain=1:2:3"], "give --map twice, got 1"),
    (["so101", "--preset", "--gain", "kp"], "no gain 'kp'; available: p_gain, i_gain, d_gain"),
]


@pytest.mark.parametrize(("options", "words"), BAD)
def test_what_cannot_be_asked_is_refused_in_a_line(options, words):
    done = command(*options)
    assert done.returncode == 2
    assert done.stderr.count("\n") <= 1 + len(options)  # the assumptions, and the refusal
    assert words in done.stderr


def test_the_servo_that_the_refusal_names_is_one(capsys):
    gear = ["ar4", "--gear", "joint_2=1 deg", "--time", "1", "--jobs", "1", "--quiet"]
    assert main(["study", "hunting", *gear]) == 2
    option, table = re.search(r"add (--set) '(.*)' with", capsys.readouterr().err).groups()
    assert main(["study", "hunting", *gear, option, table]) == 0
    assert "joint_2" in capsys.readouterr().out


def test_others_stand_where_their_limits_let_them(urdf):
    links = [body("one", com="0.2 0 0"), body("two", com="0.2 0 0")]
    first = joint("a", "base", "one", axis="0 1 0")
    second = joint("b", "one", "two", axis="0 1 0", at="0.4 0 0")
    limits = '<limit lower="1" upper="2" effort="9" velocity="9"/></joint>'
    limited = re.sub("<limit.*", limits, second)
    robot = jp.Mechanism(urdf(*links, first, limited), gears={"a": GEAR})
    whole = jp.Simulation(robot, drive={"a": axis(20.0).drive})
    inertias = [
        hunting.released(whole, ["a"], pose)[0].inertia for pose in (None, {"b": 1.5}, {"b": 0.0})
    ]
    assert inertias[0] == inertias[1] != pytest.approx(inertias[2])


def bowing(urdf, encoder):
    """An arm about y, upright at 0, whose weight presses its teeth the farther it bows."""
    arm = urdf(body("one", com="0 0 0.2", mass=0.2, inertia=0.01), joint("a", "base", "one",
               axis="0 1 0"))  # fmt: skip
    servo = jp.loads.Servo.of("STS3215", voltage=7.4, p_gain=100.0, encoder=encoder, friction=0.01)
    return jp.Simulation(jp.Mechanism(arm, gears={"a": GEAR}), drive={"a": servo})


def independent(one, start, lasts=20.0):
    """Amplitude of the link in the last fifth, by integrating equations written independently."""
    gear, servo, half = one.gear, one.drive, 0.5 * one.gear.play
    stall = servo.torque_constant / servo.resistance

    def rates(_, y):
        link, motor, v, w = y
        twist = motor - link
        deep = max(abs(twist) - half, 0.0)
        side = np.sign(twist)
        teeth = side * max(gear.stiffness * deep + gear.damping * side * (w - v), 0.0) * (deep > 0)
        volts = np.clip(-servo.p_gain * (link if servo.encoder == "link" else motor), -7.4, 7.4)
        pull = stall * (volts - servo.torque_constant * w)
        rubs = servo.friction * np.tanh(w / 1e-3) + servo.viscous * w
        return [v, w, (teeth + one.load) / one.inertia, (pull - rubs - teeth) / gear.rotor_inertia]

    done = solve_ivp(rates, (0.0, lasts), [start, start, 0.0, 0.0], "LSODA", max_step=2e-3,
                     rtol=1e-7, atol=1e-9)  # fmt: skip
    return 0.5 * np.ptp(done.y[0][done.t > 0.8 * lasts])


@pytest.mark.thorough
def test_an_arm_that_shakes_upright_is_calm_where_it_bows_as_integrated_anew(urdf):
    (found,) = calm.calm(bowing(urdf, "link"), positions=5, jobs=1)
    upright = found.positions[2]
    assert upright.verdict == "shakes: play"
    assert upright.swing.amplitude == pytest.approx(
        independent(upright.axis, 2.0 * GEAR.play), rel=0.05
    )
    verdicts = [one.verdict for one in found.positions]
    assert "calm" in verdicts
    assert " is calm " in found.sentence
    for position in found.positions[2:]:
        largest = max(independent(position.axis, start * GEAR.play) for start in (0.5, 2.0, 8.0))
        assert (largest > 0.01 * GEAR.play) == (position.verdict != "calm")
        if position.calm_gain is not None and position.verdict != "calm":
            at_ease = position.axis.with_gains(p_gain=position.calm_gain)
            assert independent(at_ease, 2.0 * GEAR.play, 60.0) < 0.01 * GEAR.play


@pytest.mark.thorough
def test_with_the_encoder_on_the_motor_the_same_arm_is_calm_at_every_pose(urdf):
    (found,) = calm.calm(bowing(urdf, "motor"), positions=3, jobs=1)
    assert found.sentence == "a is calm at every pose"
    assert "nothing to do; calm up to P=" in found.advice


def test_registers_are_gains_of_servos_as_their_sources_have_them(tmp_path):
    made, told = jp.loads.Servo.gains_of("STS3215", 7.4, {"P": 32, "D": 32, "I": 0})
    assert made == {"p_gain": pytest.approx(38.6, rel=0.01), "i_gain": 0.0}  # logs of a stand
    assert [line.startswith("note: STS3215 D=32 left out") for line in told] == [False, True]
    with pytest.raises(jp.JointplayError, match="P of STS3215 takes whole numbers from 1 to 254"):
        jp.loads.Servo.gains_of("STS3215", 7.4, {"P": 255})
    more = ["--of", "wrist_roll", "--preset", "--quiet", "--jobs", "1", "--time", "2 s"]
    more += ["--registers", "P=16,D=32,I=0", "--poses", "2", "--out", str(tmp_path)]
    said = command("so101", *more).stdout
    assert "is p_gain 19.3 V/rad: seen; 8/1000 a count at the maker's P = 32" in said
    assert "note: STS3215 D=32 left out, d_gain as it was" in said
    rows = (tmp_path / "hunting.csv").read_text().splitlines()
    assert len(rows) == 3


def test_chatter_beside_the_edge_of_a_count_is_rest():
    count = 2.0 * np.pi / 4096
    held = replace(axis(38.6, resolution=count, dead_band_counts=1), load=0.4, inertia=0.008)
    assert at(held) == QUIET


def test_chatter_of_uneven_records_is_rest_within_seconds():
    """Between two counts its largest way of each quarter differs by a part of a per cent with the
    moments of its records, and does not grow; without counts that may be a swing that does.
    """
    servo = axis(54.6, resolution=2.0 * np.pi / 4096, dead_band_counts=1)
    time = np.arange(0.0, 20.0, 1e-3)
    sizes = np.where(time > 15.0, 1.004, 1.0) * 0.5 * swings.LEAST_SWING * GEAR.play
    places = sizes * np.vstack([np.sin(11.0 * time), 0.1 * np.sin(11.0 * time)])
    assert swings._judge(time, places, servo, last=False) == QUIET
    assert swings._judge(time, places, axis(54.6), last=False) is None


def test_runs_that_were_done_are_not_done_again(tmp_path, monkeypatch, urdf):
    disc = urdf(body("disc", 1.0, "0 0 0", 0.05), joint("a", "base", "disc", "continuous"))
    motion = jp.Motion(["a"], [0, 1.0], [[0.0], [0.1]])
    rubs = {"a": jp.loads.JointFriction(0.1, presliding=1e-3, presliding_damping=0.05)}
    one = jp.Simulation(
        jp.Mechanism(disc, gears={"a": GEAR}), motion, drive=axis(20.0).drive, joint_friction=rubs
    )
    how = {"starts": (2.0,), "jobs": 1, "longest": 3.0, "keep": tmp_path / "runs"}
    real, done = hunting.swings, []

    def stopped(trial):
        if len(done) == 3:
            raise KeyboardInterrupt
        done.append(trial)
        return real(trial)

    monkeypatch.setattr(hunting, "swings", stopped)
    with pytest.raises(KeyboardInterrupt):
        hunting.hunting(one, **how)
    again = []
    monkeypatch.setattr(hunting, "swings", lambda trial: again.append(trial) or real(trial))
    (answer,) = hunting.hunting(one, **how)
    assert not any(trial in done for trial in again)
    monkeypatch.setattr(hunting, "swings", lambda trial: pytest.fail("was run again"))
    assert hunting.hunting(one, **how) == [answer]


def test_the_command_says_whether_a_robot_hunts(tmp_path):
    options = ["--of", "wrist_roll", "--preset", "--quiet", "--jobs", "1", "--out", str(tmp_path)]
    done = command("so101", *options, "--time", "5 s")
    assert "at rest" in done.stdout
    assert "wrist_roll" in (tmp_path / "hunting.csv").read_text()
