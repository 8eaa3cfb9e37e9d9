"""Gears and screws of joints that slide: play in metres, with known answers."""

import math
import subprocess

import numpy as np
import pytest
from conftest import body, joint, tip
from scipy.integrate import solve_ivp
from warm import JOINTPLAY

import jointplay as jp
from jointplay.accuracy.error_budget import budget
from jointplay.base.units import WORDS
from jointplay.bridges.reduction import reduce
from jointplay.cli import main, parser
from jointplay.cli.commands.inputs import scenario_of
from jointplay.simulation.loads.drive import ComputedTorque, Free, Prescribed, Torque

GANTRY = "jointplay:gantry.urdf"
NUT = jp.Gear(play=2e-4, rotor_inertia=1.5, stiffness=4e5, damping=150.0)
MASS, G = 2.0, 9.81
QUIET = {"joint_friction": {}, "estimate": False}


@pytest.fixture
def slider(urdf):
    """A cart on a slide along world x."""
    cart = joint("x", "base", "cart", "prismatic", axis="1 0 0")
    return urdf(body("cart", MASS), cart, tip("cart"))


@pytest.fixture
def lift(slider):
    """The same where gravity acts against x."""
    return jp.Mechanism(slider, gears={"x": NUT}, gravity=(-G, 0, 0))


def call(*arguments):
    command = [JOINTPLAY, *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.thorough
def test_a_slider_moves_as_another_method_says(lift):
    times, forces = (0.0, 0.05, 0.1, 0.15), (0.0, 90.0, -60.0, 20.0)

    def fall(time, y):
        motor, link, motor_speed, speed = y
        twist, rate = motor - link, motor_speed - speed
        depth = abs(twist) - NUT.play / 2.0
        pressed = NUT.stiffness * depth + NUT.damping * math.copysign(1.0, twist) * rate
        force = math.copysign(max(pressed, 0.0), twist) if depth > 0.0 else 0.0
        drive = np.interp(time, times, forces)
        return motor_speed, speed, (drive - force) / NUT.rotor_inertia, force / MASS - G

    at = np.linspace(0.0, 0.15, 31)
    exact = solve_ivp(
        fall, (0.0, 0.15), np.zeros(4), "Radau", at, rtol=1e-9, atol=1e-12, max_step=2e-5
    ).y
    drive = {"x": Torque(times, forces)}
    result = jp.simulate(lift, drive=drive, duration=0.15, step=1e-6, start="centred", **QUIET)
    for name, own in (("x.motor", exact[0]), ("x", exact[1])):
        found = np.interp(at, result.time, result["q"].sel(coordinate=name).values)
        assert found == pytest.approx(own, abs=1e-6)
    assert np.ptp(exact[1]) > 0.01
    assert len(np.flatnonzero(np.diff(np.sign(exact[0] - exact[1])))) > 1  # from side to side
    assert result.audit.energy_residual < 1e-4 * result.audit.energy_exchanged


def test_gravity_does_not_pull_on_the_rotor(slider):
    robot = jp.Mechanism(slider, gears={"x": NUT}, gravity=(-G, 0, 0))
    result = jp.simulate(robot, drive=Free(), duration=0.004, start="centred", **QUIET)
    ends = dict(zip(robot.coordinates, result["q"].values[-1], strict=True))
    assert ends["x"] == pytest.approx(-0.5 * G * result.time[-1] ** 2, rel=1e-3)
    assert ends["x.motor"] == 0.0  # the play is not yet used up


def test_a_budget_moves_the_tool_by_half_the_play_along_the_axis(urdf):
    turned = 0.4
    robot = urdf(
        body("arm"),
        body("rod"),
        joint("a", "base", "arm"),
        joint("x", "arm", "rod", "prismatic", axis="1 0 0", at="0.3 0 0"),
        tip("rod", at="0.2 0 0"),
    )
    gears = {"a": jp.Gear(1e-3, 0.1, 1e4), "x": NUT}
    found = budget(jp.Mechanism(robot, gears=gears), {"a": turned, "x": 0.1})
    assert found.joints == ("a (gear)", "x (gear)")
    along = np.array([math.cos(turned), math.sin(turned)])
    slid, across = np.abs(along) * 1e-4, np.abs(along[::-1]) * 0.6 * 5e-4
    assert found.axis_worst[0, 0] == pytest.approx([*across, 0, 0, 0, 5e-4], abs=1e-9)
    assert found.axis_worst[0, 1] == pytest.approx([*slid, 0, 0, 0, 0], abs=1e-12)
    assert found.alone[0, 1] == pytest.approx(1e-4)
    # At right angles to each other, and the turn's second order is small.
    assert found.worst[0] == pytest.approx(math.hypot(1e-4, 3e-4), rel=1e-3)


@pytest.mark.parametrize(("encoder", "hangs"), [("link", 0.0), ("motor", 1.0)])
def test_at_rest_a_nut_hangs_by_half_its_play_and_its_elasticity(lift, encoder, hangs):
    sag = hangs * (NUT.play / 2.0 + MASS * G / NUT.stiffness)
    drive = ComputedTorque(encoder=encoder)
    found = budget(lift, {}, drive=drive)
    assert found.rest_tool[0] == pytest.approx([-sag, 0, 0, 0, 0, 0], abs=1e-9)
    assert found.rest[0, 0, 0] == pytest.approx(-sag, abs=1e-9)
    assert found.rest_interval[0, 0] == pytest.approx([-sag, -sag], abs=1e-8)
    assert found.rest_positions.at(0).loads[0] == pytest.approx([0, 0, -MASS * G, 0, 0, 0])
    assert f"x (gear) {MASS * G:.4g} N" in str(found.table())
    motion = jp.Motion(["x"], [0, 0.01], [[0.0], [0.0]])
    result = jp.simulate(lift, motion, drive=drive, duration=1e-3, start="rest", **QUIET)
    assert result["q"].sel(coordinate="x").values == pytest.approx(-sag, abs=1e-7)
    assert result["gear_torque"].values == pytest.approx(MASS * G, rel=1e-3)
    assert result["gear_torque"].attrs["units"] == "N"


def test_what_a_stiff_nut_lets_the_tool_turn_is_nothing_that_is_divided_by(lift, recwarn):
    found = budget(lift, {}, drive=ComputedTorque(encoder="motor"))
    assert "contacts and gears giving way 0.049" in found.sentence
    assert str(found.table())
    assert not recwarn.list


def test_friction_along_a_slide_holds_a_nut_within_its_play(slider):
    box = jp.PrismaticClearance(clearance=1e-5)
    gears = {"x": jp.Gear(2e-4, 1.5, 1e9)}
    ends = []
    for friction in (0.0, 0.3):
        robot = jp.Mechanism(slider, {"x": box}, gears=gears, gravity=(-1.0, 0.0, -9.0))
        found = budget(robot, {}, friction=friction, drive=ComputedTorque(encoder="motor"))
        ends.append(found.rest_interval[0, 0])
    # 2 N pull along the slide, and 0.3 x 18 N hold: only with friction is the other side reached.
    assert ends[0] == pytest.approx([-1e-4, -1e-4], rel=0.02)
    assert ends[1] == pytest.approx([-1e-4, 1e-4], rel=0.02)


def test_a_servo_of_a_slide_hangs_by_its_dead_band_and_its_gain(lift):
    servo = jp.loads.Servo(
        voltage="24 V", p_gain="2e4 V/m", torque_constant="50 N/A", resistance="2 ohm",
        dead_band="20 um",
    )  # fmt: skip
    motion = jp.Motion(["x"], [0, 0.01], [[0.0], [0.0]])
    result = jp.simulate(lift, motion, drive={"x": servo}, duration=1e-3, start="rest", **QUIET)
    sag = 2e-5 + MASS * G / (25.0 * 2e4)
    ends = dict(zip(lift.coordinates, result["q"].values[-1], strict=True))
    assert ends["x.motor"] == pytest.approx(-sag, abs=1e-8)
    assert ends["x"] == pytest.approx(-sag - NUT.play / 2 - MASS * G / NUT.stiffness, abs=1e-8)
    own = jp.loads.Servo.of("STS3215", voltage=7.4, p_gain=38.6)
    with pytest.raises(jp.JointplayError, match="joint 'x' slides, but the servo STS3215 turns"):
        jp.simulate(lift, motion, drive={"x": own}, **QUIET)


def test_a_prescribed_motor_of_a_slide_carries_its_cart(lift):
    motion = jp.Motion(["x"], [0, 0.1], [[0.0], [0.001]])
    result = jp.simulate(lift, motion, drive=Prescribed(), start="rest", **QUIET)
    q = result["q"].sel(coordinate="x.motor").values
    assert q == pytest.approx(motion(result.time)[0][:, 0], abs=1e-9)
    twist = q - result["q"].sel(coordinate="x").values
    assert twist[-1] == pytest.approx(NUT.play / 2 + MASS * G / NUT.stiffness, rel=0.05)


def test_the_shipped_gantry_runs_and_its_result_is_in_si(tmp_path):
    (tmp_path / "g.toml").write_text(
        jp.shipped("gantry.toml").read_text().replace("gantry.urdf", GANTRY)
    )
    short = ("--set", "integration.duration=20 ms", "--no-error-estimate")
    done = call("run", tmp_path / "g.toml", *short, "--out", tmp_path / "out")
    assert done.returncode == 0, done.stderr
    assert "of 0.1 mm in the gear of x and of 0.05 mm in the gear of z" in done.stdout
    result = jp.Result.load(tmp_path / "out" / "g.nc")
    force = result["gear_torque"]
    assert force.attrs["units"] == "N"
    assert force.sel(gear="z").values[0] == pytest.approx(3.0 * 9.80665, rel=1e-3)
    gear = result.simulation.mechanism.gears["x"]
    assert gear == jp.Gear(1e-4, 4.0, 2e6, 1500.0)
    facts = call("check", tmp_path / "g.toml", "--no-picture").stdout
    assert "play 0.1 mm, rotor inertia 4 kg, stiffness 2e+06 N/m, damping 1500 N s/m" in facts


def test_a_robot_with_gears_of_both_kinds_says_both_units():
    robot = jp.Mechanism(
        jp.shipped("scara.urdf"), gears={"joint_a": jp.Gear(1e-3, 0.1, 1e4), "stroke": NUT}
    )
    still = jp.Motion(list(robot.joints), [0, 0.01], np.zeros((2, 4)))
    result = jp.simulate(robot, still, duration=1e-3, **QUIET)
    assert result["gear_torque"].attrs["units"] == "N m for rad, N for m"
    assert dict(robot.facts()[1])["gear stroke"] == "play 0.2 mm"
    assert dict(robot.facts()[1])["gear joint_a"] == "play 1 mrad"


def test_an_option_gives_a_slide_its_play(capsys):
    assert main(["budget", GANTRY, "--gear", "x=0.2 mm"]) == 0
    said = capsys.readouterr().out
    assert "up to 0.1 mm off" in said
    assert "gears: stiffness of x 1e+07 N/m by the 400 N that its drive" in said
    assert "to a factor of 4 (assumed); see --gear-stiffness" in said
    words = ["budget", GANTRY, "--gear", "x=0.2 mm", "--gear-stiffness", "3e6 N/m"]
    gear = scenario_of(parser().parse_args(words), moves=False).mechanism().gears["x"]
    assert (gear.play, gear.stiffness, gear.rotor_inertia) == (
        2e-4,
        3e6,
        pytest.approx(0.02 * 400.0),
    )
    assert main(words) == 0
    assert "gears: stiffness of" not in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--gear", "x=0.2 deg"], '--gear x: "0.2 deg" is not a length'),
        (["--gear", "y=0.2 mm"], "--gear must read JOINT=PLAY with one of x, z, got 'y=0.2 mm'"),
        (
            ["--gear", "x=0.2 mm", "--gear-stiffness", "1e4 N*m/rad"],
            "is not a stiffness, but joint 'x' is prismatic",
        ),
        (
            ["--gear", "x=0.2 mm", "--rotor-inertia", "0.1 kg*m^2"],
            "is not a mass, but joint 'x' is prismatic",
        ),
        (
            ["--set", "gears.x={kind='train', rotor_inertia=1, stages=[{ratio=2}], stiffness=1e6}"],
            "joint 'x' slides, and a train gear turns its joint; kinds of gear for joints that "
            "slide: backlash",
        ),
    ],
)
def test_what_does_not_fit_a_slide_is_named(capsys, words, said):
    assert main(["budget", GANTRY, *words]) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_a_length_does_not_fit_a_gear_that_turns(capsys):
    assert main(["budget", "jointplay:scara.urdf", "--gear", "joint_a=0.2 mm"]) == 2
    assert '"0.2 mm" is not an angle' in capsys.readouterr().err


@pytest.mark.parametrize(
    ("table", "said"),
    [
        ('[gears.x]\nplay = "1 mrad"\nrotor_inertia = 1\nstiffness = 1e6', "gears.x.play"),
        ('[drive]\nkind = "servo"\nvoltage = 24\np_gain = "50 V/rad"\ntorque_constant = 1\n'
         "resistance = 1", "drive.p_gain"),
    ],
)  # fmt: skip
def test_a_scenario_names_the_key_whose_unit_does_not_fit(tmp_path, table, said):
    file = tmp_path / "g.toml"
    file.write_text(
        f'[robot]\nurdf = "{GANTRY}"\n[motion]\ntimes = [0, 0.1]\njoints.x = [0, 0.01]\n'
        f"joints.z = [0, 0]\n{table}\n"
    )
    done = call("check", file)
    assert done.returncode == 2
    assert said in done.stderr
    assert "but joint 'x' is prismatic" in done.stderr


def test_what_does_not_know_sliding_gears_says_so(lift, capsys):
    with pytest.raises(jp.JointplayError, match="'x' slides, which cannot be represented by a hin"):
        reduce(lift, "x")
    words = ["--gear", "x=0.2 mm", "--plan"]
    assert main(["identify", GANTRY, *words]) == 2
    assert "gears of joints that slide (x) are not identified" in capsys.readouterr().err


def test_numbers_of_the_docs(tmp_path):
    """docs/drives.md: what a screw's rotor counts at the joint."""
    assert 1e-5 * (2.0 * math.pi / 5e-3) ** 2 == pytest.approx(16.0, rel=0.02)
    assert {"V/m", "N/A", "V*s/m"} <= set(WORDS)
