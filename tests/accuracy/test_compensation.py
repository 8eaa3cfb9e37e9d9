"""Compensation of play: sides, shifts, limits, judgement by runs, files, the command."""

import csv
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, tip
from hypothesis import given, settings
from hypothesis import strategies as st
from warm import JOINTPLAY

from jointplay import (
    Compensator,
    Gear,
    JointplayError,
    Mechanism,
    Motion,
    RevoluteClearance,
    Simulation,
    compensate,
    shipped,
)
from jointplay.accuracy import compensation as module
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.jacobians import taken_up
from jointplay.bridges import backlash, bag
from jointplay.bridges.trajectory import content, of_motion
from jointplay.cli import main
from jointplay.model.gear import GearStage, GearTrain
from jointplay.model.payload import Payload
from jointplay.physics.contact import Coulomb
from jointplay.scenario.presets import preset
from jointplay.show.plots.design import before_and_after
from jointplay.simulation.loads import ComputedTorque, Servo, Wrench
from jointplay.simulation.loads.drive import JointFriction
from jointplay.study.corners import judge, learn, tool_errors, trust_of, varied

PLAY, STIFFNESS, MASS, ARM, REACH = 4e-3, 800.0, 2.0, 0.3, 0.5
WEIGHT = 9.81 * MASS * ARM
"""Torque of the arm's weight when the arm is level [N m]."""


@pytest.fixture
def level(urdf):
    """One joint about -y, which its weight presses one way."""
    arm = body("arm", mass=MASS, com=f"{ARM} 0 0")
    return urdf(arm, joint("j", "base", "arm", axis="0 -1 0"), tip("arm"))


@pytest.fixture
def upright(urdf):
    """One joint about z, which no weight presses."""
    arm = body("arm", mass=MASS, com=f"{ARM} 0 0")
    return urdf(arm, joint("j", "base", "arm", axis="0 0 1"), tip("arm"))


def machine(place, gravity=(0.0, 0.0, -9.81), **gear):
    given = {"play": PLAY, "stiffness": STIFFNESS, "rotor_inertia": 0.05, "damping": 2.0} | gear
    return Mechanism(place, gears={"j": Gear(**given)}, gravity=gravity)


def simulated(mechanism, to=0.05, end=0.8, **more):
    motion = Motion(["j"], [0.0, 0.5 * end, end], [[0.0], [to], [0.0]])
    given = {"drive": ComputedTorque(encoder="motor"), "step": "20 us", "record_every": 50}
    return Simulation(mechanism, motion, **given | more)


def test_a_level_gear_is_shifted_by_half_its_play_and_its_wind_up(level):
    found = compensate(simulated(machine(level), to=1e-6))
    assert found.torque[:, 0] == pytest.approx(WEIGHT, rel=1e-4)
    assert found.shift[:, 0] == pytest.approx(PLAY / 2.0 + WEIGHT / STIFFNESS, rel=1e-4)
    assert (found.side == 1.0).all()
    assert not found.undecided.any()
    assert found.crossings == [0]


def test_what_a_payload_weighs_winds_the_gear_up_while_it_is_held(level):
    own = simulated(machine(level), to=1e-6)
    held = replace(own, payloads=(Payload("tool", 1.0, release=0.4),))
    before, after = compensate(own).torque[:, 0], compensate(held).torque[:, 0]
    more = after - before
    assert more[0] == pytest.approx(9.81 * REACH)
    assert more[-1] == 0.0


def test_teeth_cross_where_inertia_turns_round(upright):
    found = compensate(simulated(machine(upright, play=1e-4), to=0.5))
    assert found.crossings[0] == 2  # drive, brake and drive back, brake
    assert found.shift.max() > 0.0 > found.shift.min()
    assert found.undecided[[0, -1]].all()  # it stands, and nothing presses


def test_friction_of_a_joint_that_stands_leaves_its_side_open(level):
    with_friction = {"j": JointFriction(coulomb=1.2 * WEIGHT)}
    found = compensate(simulated(machine(level), joint_friction=with_friction))
    still = np.abs(found.simulation.motion(found.times)[1][:, 0]) < module.STILL
    assert found.undecided[still].all()
    assert found.undecided_stops[0] == (0.0, ("j",))
    assert any("stops with an undecided side" in line for line in found.notes)
    # On the way back friction, which exceeds the weight, presses the other flank.
    assert found.crossings[0] == 1
    kept = found.shift[-1, 0]
    assert kept < 0.0


def test_torques_that_cease_at_once_do_not_change_sides():
    torque = np.array([[5.0, 5.0, -0.1, 5.0, -5.0, -5.0]]).T
    fall = np.abs(torque) / 10.0  # parts of the play in a node's time squared
    side, undecided = module._sides(torque, np.zeros_like(torque), fall, 0.0)
    assert side[:, 0].tolist() == [1, 1, 1, 1, -1, -1]
    assert undecided[:, 0].tolist() == [False, False, True, False, False, False]


def test_a_motion_of_milliseconds_is_compensated_as_a_long_one(level):
    short, long = (compensate(simulated(machine(level), to=1e-6, end=end)) for end in (2e-3, 0.8))
    assert short.shift[:, 0] == pytest.approx(long.shift[0, 0], rel=0.05)
    figure = before_and_after(judge(short, jobs=1))
    assert figure.axes[0].get_xlabel() == "time [ms]"


def test_the_command_crosses_the_play_as_long_as_teeth_hardly_leave(upright):
    found = compensate(simulated(machine(upright, play=0.02), to=0.05, end=4.0))
    slow = (np.abs(found.shift[:, 0]) < 0.008).sum()
    found = compensate(simulated(machine(upright, play=0.02), to=0.5, end=1.0))
    fast = (np.abs(found.shift[:, 0]) < 0.008).sum()
    assert slow >= 2 * fast > 0


SERVO = Servo(voltage=24.0, p_gain=300.0, torque_constant=4.0, resistance=2.0, friction=0.3)


@pytest.mark.parametrize(
    ("drive", "more", "lag"),
    [
        (SERVO, {}, WEIGHT / (SERVO.stall * SERVO.p_gain)),
        (replace(SERVO, i_gain=1e6), {}, 0.0),
        (ComputedTorque(50.0), {"payloads": (Payload("tool", 1.0),)}, 9.81 * REACH),
        (ComputedTorque(50.0), {"loads": {"push": Wrench("tool", (0, 0, -5.0))}}, 5.0 * REACH),
    ],
)
def test_what_drives_give_way_is_taken_back_without_any_play(level, drive, more, lag):
    robot = Mechanism(level)
    if isinstance(drive, ComputedTorque):
        lag /= 50.0**2 * robot.mass_matrix(np.zeros(1))[0, 0]
    own = simulated(robot, to=0.3, drive=drive, **more)
    found = compensate(replace(own, motion=Motion(["j"], [0.0, 0.8], [[0.0], [1e-6]])))
    assert found.shift[-1, 0] == pytest.approx(lag, rel=0.1, abs=1e-6)  # a servo's friction
    moved = judge(compensate(own), jobs=1).nominal
    assert moved.after.rms < 0.3 * moved.before.rms or lag == 0.0


def test_without_play_and_lag_there_is_nothing_to_compensate(level):
    with pytest.raises(JointplayError, match="there is nothing to compensate"):
        compensate(simulated(Mechanism(level)))


@pytest.mark.thorough
def test_stops_approached_from_one_side_do_not_ask_how_large_friction_is(upright):
    """Braking exceeds the friction of the model but not that of the joint, or the reverse."""
    motion = Motion(["j"], [0.0, 0.4, 1.2, 1.6, 2.4], [[0.0], [0.1], [0.1], [0.0], [0.0]])
    friction = {"j": JointFriction(coulomb=0.5)}
    own = replace(simulated(machine(upright)), motion=motion, joint_friction=friction)
    kept, approached = compensate(own), compensate(own, approach=True)
    assert [time for time, _ in kept.undecided_stops] == [0.0, 0.4, 1.6]
    assert approached.approached == ((0.4, "j"), (1.6, "j"))
    assert [time for time, _ in approached.undecided_stops] == [0.0]
    assert any("approached from one side: 0.4 s (j), 1.6 s (j)" in n for n in approached.notes)
    left = []
    for found in (kept, approached):
        corners = judge(found, {"friction": 0.5}, jobs=1).corners
        left.append(max(one.after.at_stops for one in corners))
    assert left[0] > 0.5 * PLAY * REACH
    assert left[1] < 0.2 * left[0]
    short = replace(own, motion=Motion(["j"], [0.0, 0.4, 0.5, 0.9], [[0.0], [0.1], [0.1], [0.0]]))
    assert compensate(short, approach=True).approached == ()
    places = [[0.0], [0.1], [0.1], [0.12], [0.12]]
    soon = replace(own, motion=Motion(["j"], [0.0, 0.6, 1.2, 1.3, 2.3], places))
    assert compensate(soon, approach=True).approached == ((0.6, "j"),)


def test_one_approach_is_for_all_stops_until_the_joint_moves_again():
    """The gantry's x stands while z goes and stops twice."""
    play = 1e-4
    belt = Gear(play=play, rotor_inertia=4.0, stiffness=2e6, damping=1500.0)
    mechanism = Mechanism(shipped("gantry.urdf"), gears={"x": belt}, tool="gripper")
    places = [[0.1, 0.0], [0.2, 0.0], [0.2, -0.02], [0.2, -0.02], [0.2, 0.0], [0.2, 0.0]]
    motion = Motion(["x", "z"], [0.0, 0.5, 0.9, 1.2, 1.6, 2.0], places)
    own = Simulation(
        mechanism,
        motion,
        ComputedTorque(encoder="motor"),
        joint_friction={"x": JointFriction(50.0)},
    )
    kept, found = compensate(own), compensate(own, approach=True)
    assert [time for time, _ in found.approached] == [0.9, 1.6]
    aside = np.abs(found.shift - kept.shift)[:, 0].max()
    assert play < aside < 2.5 * play
    last = found.times > 0.9
    assert np.ptp(found.shift[last, 0]) < 1e-9


def test_friction_of_journals_holds_teeth_as_that_of_the_joint_does(upright):
    """Friction of both rims, which bear the arm's moment, and of the face that bears its weight."""
    radius, length, mu = 0.02, 0.1, 0.2
    bearing = RevoluteClearance(
        radial_clearance=1e-4, axial_clearance=1e-4, bearing_radius=radius, bearing_length=length,
        friction=Coulomb(mu_d=mu),
    )  # fmt: skip
    mechanism = machine(upright).with_clearance({"j": bearing})
    own = simulated(mechanism, to=1e-3)
    _, friction = module._journals(own, np.linspace(0.0, 0.8, 5), False)
    hinge = mechanism.clearance["j"].hinge
    expected = hinge.radius * mu * (2.0 * WEIGHT / hinge.length + 9.81 * MASS)
    assert friction["j"][1] == pytest.approx(expected, rel=1e-3)
    both = compensate(own)
    moving = np.abs(own.motion(both.times)[1][:, 0]) > module.STILL
    assert both.undecided[~moving].all()
    bare = compensate(simulated(machine(upright), to=0.05)).torque
    assert both.torque[moving][:20, 0] == pytest.approx(expected, rel=0.1)
    assert np.abs(bare).max() < expected


def test_a_journal_that_turns_rests_where_its_friction_lets_it_climb(level):
    """It rests atan(mu) beside the load, as in a run; the drive lags by the axial friction."""
    mu, left = 0.3, {}
    motion = Motion(["j"], [0.0, 0.2, 1.0, 1.2], [[0.0], [0.02], [0.42], [0.44]])
    for law in (Coulomb(mu_d=mu), Coulomb(mu_d=0.0)):
        bearing = RevoluteClearance(radial_clearance=2e-4, axial_clearance=1e-4, friction=law)
        own = Simulation(Mechanism(level, {"j": bearing}), motion, step="5 us", record_every=50)
        found = compensate(own)
        errors = tool_errors(own, own)
        middle = (errors.times > 0.4) & (errors.times < 0.9)
        node = (found.times > 0.4) & (found.times < 0.9)
        left[law.mu_d] = (
            errors.values[middle, :3].mean(axis=0),
            found.displacement[node, :3].mean(axis=0),
        )
    (run, rest), (plain_run, plain) = left[mu], left[0.0]
    assert rest[0] == pytest.approx(-2e-4 * np.sin(np.arctan(mu)), rel=0.02)
    assert run[0] == pytest.approx(rest[0], rel=0.1)
    assert plain_run == pytest.approx(plain, abs=2e-6)


@settings(max_examples=25, deadline=None)
@given(
    play=st.floats(1e-4, 1e-2),
    stiffness=st.floats(100.0, 1e5),
    torque=st.floats(0.01, 50.0),
    side=st.sampled_from([-1.0, 1.0]),
)
def test_a_compensator_shifts_as_far_as_the_gear_twists(play, stiffness, torque, side):
    gear = Gear(play=play, stiffness=stiffness, rotor_inertia=1.0)
    one = Compensator.of(["j"], {"j": gear}, {})
    shift = one.update(np.zeros(1), np.zeros(1), np.array([side * torque]))
    assert shift[0] == pytest.approx(gear.wound_up(side * torque), rel=1e-12)


def test_a_compensator_keeps_the_side_that_friction_holds():
    one = Compensator([0.01], [np.inf], [2.0])
    zero = np.zeros(1)
    assert one.update(zero, np.array([0.1]), zero) == [0.005]  # friction presses as it moves
    assert one.update(zero, zero, np.array([-1.0])) == [0.005]
    assert one.update(zero, zero, np.array([-3.0])) == [-0.005]


def test_a_compensator_takes_nothing_but_numpy():
    code = (
        "import sys, numpy; from jointplay.accuracy.compensator import Compensator; "
        "print(Compensator([1.0], [1.0], [0.0]).update(*3 * [numpy.ones(1)]), "
        "[one for one in ('pinocchio', 'numba', 'scipy', 'matplotlib') if one in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["[2.5]", "[]"]


@pytest.mark.parametrize("kind", [pytest.param("gear", marks=pytest.mark.thorough), "journal"])
def test_the_engine_finds_the_tool_nearer_by_the_corrected_motion(level, kind):
    own = simulated(machine(level))
    if kind == "journal":
        bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
        arm = Mechanism(level, {"j": bearing})
        own = replace(own, mechanism=arm, drive=ComputedTorque(), step="5 us")
    if kind == "journal":  # one joint lifts the tool, and cannot do more
        found = judge(compensate(own), jobs=1).nominal
        lift = np.abs(found.after.values[:, 2]).mean(), np.abs(found.before.values[:, 2]).mean()
        assert lift[0] < 0.2 * lift[1]
        return
    judged = judge(compensate(own), {"play": 0.3, "stiffness": 0.3, "friction": 0.5}, jobs=1)
    assert judged.nominal.before.rms > 10.0 * judged.nominal.after.rms
    assert judged.left_out == ("friction",)
    assert len(judged.corners) == 5
    assert judged.most_left.label == "play +30 %, stiffness -30 %"
    assert not judged.worse
    # On a level arm the teeth never cross: a shift by the sign of the speed is wrong.
    assert judged.firmware.rms > judged.nominal.after.rms


def test_least_gain_and_largest_rest_are_named_of_all_corners(level):
    """The gain is least where play and wind-up are small; most is left where they are large."""
    own = simulated(machine(level), to=1e-6)
    judged = judge(compensate(own), {"play": 0.3, "stiffness": 0.2}, jobs=1)
    off = {}
    for play in (0.7, 1.3):
        for soft in (0.8, 1.2):
            was = 0.5 * play * PLAY + WEIGHT / STIFFNESS / soft
            off[play, soft] = was, abs(was - 0.5 * PLAY - WEIGHT / STIFFNESS)
    for one, (was, left) in zip(judged.corners[1:], off.values(), strict=True):
        assert one.before.rms == pytest.approx(was * REACH, rel=0.02)
        assert one.after.rms == pytest.approx(left * REACH, rel=0.02)
    assert judged.least_gain.label == "play -30 %, stiffness +20 %"
    assert judged.most_left.label == "play +30 %, stiffness -20 %"
    said = judged.sentence
    assert "gains least (play -30 %, stiffness +20 %)" in said
    assert "most is left (play +30 %, stiffness -20 %)" in said


def _plane_moves(pose):
    """Jacobian of two joints about y, of links of 0.4 and 0.3 m along x: x, z and rotation."""
    first, second = pose["j1"], pose["j1"] + pose["j2"]
    x = np.array([0.4 * np.cos(first) + 0.3 * np.cos(second), 0.3 * np.cos(second)])
    z = -np.array([0.4 * np.sin(first) + 0.3 * np.sin(second), 0.3 * np.sin(second)])
    return np.array([z, -x, [1.0, 1.0]])


def test_the_position_comes_before_the_turn_unless_a_size_weighs_them(urdf):
    """Two joints of a plane arm set the position exactly; a third turns the tool in place."""
    arm = [
        *(body(name, mass=1.0, com="0.2 0 0") for name in ("a", "b")),
        joint("j1", "base", "a", axis="0 1 0"),
        joint("j2", "a", "b", axis="0 1 0", at="0.4 0 0"),
    ]
    away = np.array([2e-4, 0.0, -1e-4, 0.0, 3e-3, 0.0])
    two = Mechanism(urdf(*arm, tip("b", at="0.3 0 0")))
    pose = {"j1": -0.6, "j2": 0.5}
    ways, left = taken_up(two, pose, away)
    assert np.abs(left[:3]).max() < 1e-12
    assert abs(left[4]) > 1e-3
    by_hand = np.linalg.lstsq(
        0.2 ** np.array([[0], [0], [1]]) * _plane_moves(pose), away[[0, 2, 4]] * [1, 1, 0.2]
    )[0]
    weighed, left = taken_up(two, pose, away, size=0.2)
    assert weighed == pytest.approx(by_hand)
    assert 1e-6 < np.abs(left[:3]).max() < 1e-3
    wrist = joint("j3", "b", "c", axis="0 1 0", at="0.3 0 0"), body("c", mass=0.1, com="0.1 0 0")
    three = Mechanism(urdf(*arm, *wrist, tip("c", at="0 0 0")))
    more, left = taken_up(three, {"j1": -0.6, "j2": 0.5, "j3": 0.2}, away)
    assert np.abs(left).max() < 1e-12
    assert more[:2] == pytest.approx(ways)


@pytest.mark.thorough
def test_the_error_left_is_that_of_the_models_mistake(level):
    """The error of half the play is left, at the arm's end."""
    own = simulated(machine(level), to=1e-6)
    found = judge(compensate(own), {"play": 0.3}, jobs=1)
    for one in found.corners[1:]:
        assert one.after.rms == pytest.approx(0.3 * PLAY / 2.0 * REACH, rel=0.1)


def test_passes_that_do_not_improve_are_not_kept(level):
    found = compensate(simulated(machine(level)))
    best, tried = learn(found, 3)
    kept = best.learned
    assert tried[kept] == min(tried)
    assert len(tried) <= kept + 2


def test_factors_change_what_they_name(level):
    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    own = simulated(machine(level), payloads=(Payload("tool", 1.0),))
    own = replace(own, mechanism=own.mechanism.with_clearance({"j": bearing}))
    own = replace(own, joint_friction={"j": JointFriction(2.0, 1.0)})
    new = varied(own, {"play": 2.0, "friction": 3.0, "payload": 4.0, "stiffness": 5.0})
    gear = new.mechanism.gears["j"]
    assert (gear.play, gear.stiffness) == (2.0 * PLAY, 5.0 * STIFFNESS)
    assert new.mechanism.clearance["j"].radial_clearance == 2e-4
    assert (new.joint_friction["j"].coulomb, new.payloads[0].mass) == (6.0, 4.0)


def test_the_play_of_a_train_of_gears_is_varied_in_proportion(level):
    stages = (GearStage(ratio=5.0, backlash=1e-3), GearStage(ratio=4.0, backlash=2e-3))
    train = GearTrain(rotor_inertia=0.05, stages=stages, stiffness=STIFFNESS)
    simulation = simulated(Mechanism(level, gears={"j": train}))
    for changes in ({"play": 1.3}, {"j.gear.play": 1.3 * train.play}):
        gear = varied(simulation, changes).mechanism.gears["j"]
        assert gear.play == pytest.approx(1.3 * train.play)
        assert gear.stages[0].backlash == pytest.approx(1.3e-3)
    assert varied(simulation, {"stiffness": 0.5}).mechanism.gears["j"].stiffness == STIFFNESS / 2.0


def test_what_cannot_be_compensated_is_refused_in_a_line(level, upright):
    own = simulated(machine(level))
    wrong = {
        "is nothing to compensate": replace(own, mechanism=own.mechanism.ideal()),
        "encoders on the links": replace(own, drive=ComputedTorque(encoder="link")),
        "no torque decides": simulated(machine(upright), to=1e-5),
        "goes on after its end": replace(
            own, motion=Motion(["j"], [0.0, 1.0], [[0.0], [0.1]], "constant-speed")
        ),
        "a motion is needed": replace(own, motion=None, duration=1.0),
    }
    for words, simulation in wrong.items():
        with pytest.raises(JointplayError, match=words) as error:
            compensate(simulation)
        assert "\n" not in str(error.value)
    for text in ("play 30", "play x %", "play 100 %", "plya 3 %"):
        with pytest.raises(JointplayError):
            trust_of(text)
    assert trust_of("play 30 %, payload 20%") == {"play": 0.3, "payload": 0.2}


def test_a_motion_that_goes_on_is_refused_before_anything_is_announced(tmp_path, capsys):
    path = str(tmp_path / "crank.toml")
    assert main(["init", "--linkage", "slider-crank", path]) == 0
    capsys.readouterr()
    assert main(["compensate", path]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("jointplay compensate: error: a motion that goes on after its end")


def test_joints_do_not_go_far_for_little_near_singular_poses():
    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    arm = Mechanism("scara", {"joint_b": bearing})
    motion = Motion(["joint_a", "joint_b"], [0.0, 1.0], [[0.0, 1e-3], [0.1, 1e-3]])
    own = Simulation(arm, motion, joint_friction={})
    away = np.zeros((2, 6))
    away[:, 0] = 1e-4  # the arm lies along x, stretched
    moved = module.through_jacobian(own, np.array([0.0, 1.0]), away, None)
    assert np.abs(moved).max() < 0.06
    aside = np.zeros((2, 6))
    aside[:, 1] = 1e-4
    turned = module.through_jacobian(own, np.array([0.0, 1.0]), aside, None)
    assert 0.0 < np.abs(turned).max() < 1e-3


def test_a_corrected_motion_begins_and_ends_at_rest(level):
    own = simulated(machine(level))
    times = np.linspace(0.0, own.motion.duration, 41)
    moved, _ = module.corrected_motion(own, times, 0.01 * times[:, None])
    speed = moved(np.array([0.0, own.motion.duration]))[1]
    assert np.abs(speed).max() < 1e-4  # the shift grows by 0.01 rad/s
    middle = moved(np.array([0.4]))[0] - own.motion(np.array([0.4]))[0]
    assert middle == pytest.approx(0.004, abs=1e-6)


def test_a_correction_stays_within_limits(level, tmp_path):
    place = tmp_path / "limited.urdf"
    text = level.read_text()
    assert text.count('lower="-9" upper="9"') == 1
    place.write_text(text.replace('upper="9"', 'upper="0.051"'))
    found = compensate(simulated(machine(place)))
    assert found.clipped == ("j",)
    assert found.motion.positions.max() <= 0.051
    assert any("held at limits of position: j" in line for line in found.notes)
    slow = simulated(machine(place), to=0.04, end=2.0)
    assert compensate(slow).clipped == ()


def test_motions_are_written_as_they_are_read(level, tmp_path):
    found = compensate(simulated(machine(level)))
    file = tmp_path / "motion.csv"
    file.write_text(found.motion.csv())
    assert Motion.from_csv(file) == found.motion
    text = content(of_motion(found.motion), ".yaml").decode()
    assert text.startswith("header:")
    assert text.count("time_from_start") == 81


@pytest.mark.needs("mcap_ros2")
def test_a_bag_of_a_motion_is_read_again(level, tmp_path):
    found = compensate(simulated(machine(level)))
    file = tmp_path / "motion.mcap"
    file.write_bytes(bag.of_trajectory(of_motion(found.motion)))
    again = Motion.from_mcap(file)
    assert again.positions[:, 0] == pytest.approx(found.motion(again.times)[0][:, 0], abs=1e-9)


def test_linuxcnc_gets_what_the_joint_does_each_way(upright):
    found = compensate(simulated(machine(upright, play=1e-4), to=0.5))
    ((name, text),) = backlash.tables(backlash.corrected(found), "linuxcnc").items()
    rows = np.array([[float(x) for x in line.split()] for line in text.splitlines()])
    assert name == "j.comp"
    assert len(rows) <= 256
    assert (np.diff(rows[:, 0]) > 0.0).all()
    assert np.abs(rows[:, 1:] - rows[:, :1]).max() <= np.degrees(np.abs(found.shift).max()) + 1e-6
    assert (
        backlash.tables(backlash.corrected(found), "grblhal")["grblhal.txt"]
        == f"$160={np.degrees(1e-4):.4f}\n"
    )
    for other in ("fluidnc", "marlin"):
        with pytest.raises(JointplayError):
            backlash.tables(backlash.corrected(found), other)


def test_no_name_of_a_joint_leads_out_of_the_folder(urdf):
    evil = "../../evil"
    arm = body("arm", mass=MASS, com=f"{ARM} 0 0")
    place = urdf(arm, joint(evil, "base", "arm", axis="0 0 1"), tip("arm"))
    gear = Gear(play=1e-4, stiffness=STIFFNESS, rotor_inertia=0.05, damping=2.0)
    motion = Motion([evil], [0.0, 0.4, 0.8], [[0.0], [0.5], [0.0]])
    drive = ComputedTorque(encoder="motor")
    robot = Mechanism(place, gears={evil: gear}, gravity=(0, 0, 0))
    found = compensate(Simulation(robot, motion, drive=drive, step="20 us", record_every=50))
    assert list(backlash.tables(backlash.corrected(found), "linuxcnc")) == ["evil.comp"]


def test_firmware_gets_nothing_for_a_joint_that_never_crosses(level):
    with pytest.raises(JointplayError, match="no gear's teeth change sides"):
        backlash.tables(backlash.corrected(compensate(simulated(machine(level)))), "linuxcnc")


@pytest.mark.usefixtures("checked_figures")
def test_the_command_writes_what_improves_and_refuses_what_it_cannot_do(level, tmp_path):
    motion = tmp_path / "m.csv"
    motion.write_text("time_s,j\n0,0\n0.4,0.05\n0.8,0\n")
    given = ["--gear", "j=0.2 deg", "--gear-stiffness", "800", "--rotor-inertia", "0.05"]
    given += [
        "--gear-damping",
        "2",
        "--set",
        "drive.kind=computed-torque",
        "--set",
        "drive.encoder=motor",
        "--motion",
        motion,
    ]

    def run(*more):
        command = [JOINTPLAY, "compensate", level, *given, "--jobs", "1", "--quiet", *more]
        return subprocess.run(list(map(str, command)), capture_output=True, text=True)

    out = tmp_path / "out"
    done = run("--out", out, "--trust", "play 30 %", "--formats", "yaml,table")
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("In simulation the corrected motion takes the RMS error")
    beside = f"--motion {out / 'motion.csv'} --beside {out / 'original.csv'} --out DIR"
    assert beside in done.stdout
    assert "next, in ROS 2: ros2 topic pub --once" in done.stdout
    assert {one.name for one in out.iterdir()} == {
        *("motion.csv", "original.csv", "compensation.csv", "corners.csv", "error.png"),
        *("motion.yaml", "table.csv"),
    }
    assert Motion.from_csv(out / "motion.csv").summary == "81 samples, spline"
    rows = list(csv.DictReader((out / "corners.csv").open()))
    assert [one["corner"] for one in rows] == ["as modelled", "play -30 %", "play +30 %"]
    far = tmp_path / "far.csv"
    far.write_text("time_s,k\n0,0\n1,1\n")
    for more, words in (
        (["--trust", "play"], "as in 'play 30 %'"),
        (["--motion", far], "the motion names k"),
        (["--formats", "g-code"], "no format 'g-code'"),
    ):
        done = run("--out", tmp_path / "other", *more)
        assert done.returncode != 0
        assert words in done.stderr.strip().splitlines()[-1]
        assert not (tmp_path / "other" / "motion.csv").exists()


@pytest.mark.thorough
def test_what_makes_the_error_larger_is_said_and_not_written(level, tmp_path, monkeypatch, capsys):
    from jointplay.cli import main

    motion = tmp_path / "m.csv"
    motion.write_text("time_s,j\n0,0\n0.4,0.05\n0.8,0\n")
    monkeypatch.setattr(Gear, "wound_up", lambda self, torque: -np.sign(torque) * self.play)
    given = ["--gear", "j=0.2 deg", "--gear-stiffness", "800", "--rotor-inertia", "0.05"]
    given += [
        "--gear-damping",
        "2",
        "--set",
        "drive.kind=computed-torque",
        "--set",
        "drive.encoder=motor",
        "--motion",
        str(motion),
    ]
    command = ["compensate", str(level), *given, "--jobs", "1", "--quiet", "--out"]
    assert main([*command, str(tmp_path / "a")]) != 0
    assert not (tmp_path / "a" / "motion.csv").exists()
    assert main([*command, str(tmp_path / "b"), "--write-anyway"]) == 0
    assert "next, for ROS 2: --formats yaml" in capsys.readouterr().out
    assert (tmp_path / "b" / "motion.csv").exists()


@pytest.mark.thorough
def test_corners_are_the_ends_of_a_presets_intervals(level, tmp_path):
    held = f"play = {PLAY}\nstiffness = {STIFFNESS}\nrotor_inertia = 0.05\ndamping = 2.0\n"
    text = f"[joint.j.gear]\nkind = 'backlash'\n{held}"
    for key, low, high in (("gear.play", 3e-3, 4.5e-3), ("gear.stiffness", 700.0, 900.0)):
        text += f"[[origin]]\nkey = 'j.{key}'\nvalue = ''\norigin = 'measured'\nsource = 'a dial'\n"
        text += f"interval = [{low}, {high}]\n"
    path = tmp_path / "mine.toml"
    path.write_text(text)
    trust = trust_of("identified, friction 50 %", preset(path))
    assert trust == {
        "play": {"j.gear.play": (3e-3, 4.5e-3)},
        "stiffness": {"j.gear.stiffness": (700.0, 900.0)},
        "friction": 0.5,
    }
    own = simulated(machine(level), to=1e-6)
    judged = judge(compensate(own), trust, jobs=1)
    ends = [f"play at its {one} ends, stiffness at its" for one in ("lower", "upper")]
    assert [one.label for one in judged.corners[1:]] == [
        f"{play} {one} ends" for play in ends for one in ("lower", "upper")
    ]
    assert judged.least_gain.label == "play at its lower ends, stiffness at its upper ends"
    # The errors of half the play and of the wind-up are left.
    off = 0.5 * (PLAY - 3e-3) + WEIGHT / STIFFNESS - WEIGHT / 900.0
    assert judged.least_gain.after.rms == pytest.approx(off * REACH, rel=0.02)
    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    loose = replace(own, mechanism=own.mechanism.with_clearance({"j": bearing}))
    new = varied(loose, {"j.bearing.radial_clearance": 2e-4, "j.friction.coulomb": 1.0})
    assert new.mechanism.clearance["j"].radial_clearance == 2e-4
    with pytest.raises(JointplayError, match="there are no intervals"):
        trust_of("identified", preset("so101"))
    assert trust_of("exact") == {}


@pytest.mark.thorough
def test_the_command_takes_intervals_unless_told_otherwise(level, tmp_path):
    motion, mine = tmp_path / "m.csv", tmp_path / "mine.toml"
    motion.write_text("time_s,j\n0,0\n0.4,0.05\n0.8,0\n")
    held = f"play = {PLAY}\nstiffness = {STIFFNESS}\nrotor_inertia = 0.05\ndamping = 2.0\n"
    mine.write_text(
        f"[joint.j.gear]\nkind = 'backlash'\n{held}[joint.j.drive]\nkind = 'prescribed'\n"
        "[[origin]]\nkey = 'j.gear.play'\nvalue = ''\norigin = 'measured'\nsource = 'a dial'\n"
        "interval = [3e-3, 4.5e-3]\n"
    )
    for more, corners in (([], 3), (["--trust", "exact"], 1)):
        command = [JOINTPLAY, "compensate", level, "--preset", mine, "--motion", motion, "--quiet"]
        command += ["--jobs", "1", "--out", tmp_path / f"out{corners}", *more]
        done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
        rows = (tmp_path / f"out{corners}" / "corners.csv").read_text().splitlines()
        assert len(rows) == 1 + corners


def test_a_clearance_alone_is_for_all_joints_as_in_a_budget(level, tmp_path):
    motion = tmp_path / "m.csv"
    motion.write_text("time_s,j\n0,0\n0.1,0.01\n")
    command = [JOINTPLAY, "compensate", level, "--clearance", "0.1 mm", "--motion", motion]
    command += ["--jobs", "1", "--quiet", "--detail", "--approach", "--write-anyway"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("In simulation the corrected motion")


def test_a_format_that_knows_no_such_axis_stops_no_other(upright, tmp_path):
    """A rule judged without friction, which nobody gave, says so."""
    motion, out = tmp_path / "m.csv", tmp_path / "out"
    motion.write_text("time_s,j\n0,0\n0.4,0.5\n0.8,0\n")
    command = [JOINTPLAY, "compensate", upright, "--gear", "j=0.1 mrad", "--motion", motion]
    command += ["--gear-stiffness=800", "--gear-damping=2", "--rotor-inertia=0.05", "--jobs=1"]
    command += ["--set", "drive.kind=computed-torque", "--set", "drive.encoder=motor"]
    command += ["--write-anyway"]
    command += ["--detail", "--formats", "marlin,linuxcnc,grblhal", "--out", out]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    said = done.stdout + done.stderr
    assert "no file for marlin: marlin knows axes X, Y" in said
    assert "that is without dry friction in j" in said
    assert {"motion.csv", "j.comp", "grblhal.txt"} < {one.name for one in out.iterdir()}


@pytest.mark.thorough
def test_a_motion_of_some_joints_leaves_the_others_where_they_start(tmp_path):
    """Servos that the motion does not name hold their goals, as joints without drives do."""
    motion, out = tmp_path / "motion.csv", tmp_path / "out"
    motion.write_text("time_s,elbow_flex\n0,0.2\n0.3,0.25\n")
    given = ["so101", "--preset", "--motion", motion, "--set", "start.wrist_flex=0.5", "--quiet"]
    command = [
        JOINTPLAY,
        "compensate",
        *map(str, given),
        "--write-anyway",
        "--jobs=1",
        "--out",
        str(out),
    ]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    corrected = Motion.from_csv(out / "motion.csv")
    assert len(corrected.joints) == 6
    at = dict(zip(corrected.joints, corrected.positions.T, strict=True))
    assert np.abs(at["wrist_flex"] - 0.5).max() < 0.02
    assert np.abs(at["shoulder_pan"]).max() < 0.02


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "more"), [("so101", 0.06), ("ar4", 0.02)])
def test_what_the_budget_says_compensation_leaves_is_what_its_motion_does(name, more):
    """Preset robots stop at a pose with play 30 % larger than was corrected for."""
    known = preset(name)
    robot = known.mechanism()
    target = np.array({
        "so101": [0.0, 0.5, 0.0, 0.4, 0.7, 0.3], "ar4": [0.5, 0.6, -0.3, 0.3, 0.7, 0.4],
    }[name])  # fmt: skip
    drives = dict.fromkeys(robot.joints, ComputedTorque()) | known.drives(robot.description)
    there = dict(zip(robot.joints, target.tolist(), strict=True))
    told = budget(robot, there, drive=drives)
    motion = Motion(robot.joints, [0.0, 1.2, 2.4], np.vstack([target + 0.25, target, target]))
    simulation = Simulation(robot, motion, drives, tolerance=1e-3, record_every=20)
    corrected = compensate(simulation).motion
    looser = {n: replace(gear, play=1.3 * gear.play) for n, gear in robot.gears.items()}
    run = replace(
        simulation, mechanism=robot.with_clearance({}, looser), motion=corrected
    ).run(check_step=False, estimate=False)  # fmt: skip
    ideal, data = robot.ideal(), robot.ideal().model.createData()
    pin.framesForwardKinematics(ideal.model, data, ideal.configuration(there))
    place = data.oMf[ideal.model.getFrameId(ideal.tool)].translation
    left = float(np.linalg.norm(run["tool_position"].values[-1] - place))
    without_friction = told.compensated(0, 0.3, friction=-1.0)
    assert 0.5 * without_friction < left < (1.0 + more) * told.compensated(0, 0.3)


def test_a_motion_without_stops_is_told_nothing_of_them(level):
    """And large ratios are given to two digits."""
    judged = judge(compensate(simulated(machine(level))), jobs=1)
    judged = replace(judged, firmware=replace(judged.firmware, at_stops=np.nan))
    (rule,) = [note for note in judged.notes if "firmware's rule" in note]
    assert "at stops" not in rule
    many = replace(judged.nominal.before, rms=950.0 * judged.nominal.after.rms)
    judged = replace(judged, corners=(replace(judged.nominal, before=many),))
    assert "(950 times)" in judged.sentence
