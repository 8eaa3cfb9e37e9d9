"""Clearance, friction and play from measurements; what cannot be told; what to measure."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, tip
from hypothesis import given, settings
from hypothesis import strategies as st

from jointplay import (
    Gear,
    JointplayError,
    Mechanism,
    Motion,
    RevoluteClearance,
    Simulation,
    identify,
    loads,
)
from jointplay.base.progress import ProgressBar
from jointplay.cli import main
from jointplay.estimate import (
    Measurement,
    columns,
    least_squares,
    plan_measurement,
    planning,
)
from jointplay.estimate.known import widest
from jointplay.estimate.least_squares import Fit, LeastSquares, minimum
from jointplay.estimate.measurement import resolution, scatter
from jointplay.estimate.reasons import reason
from jointplay.estimate.unknowns import Unknown
from jointplay.estimate.visits import places, turns
from jointplay.model.collisions import SelfCollision
from jointplay.physics.contact import Ambrosio
from jointplay.scenario.presets import preset
from jointplay.simulation.loads import JointFriction

CLEARANCE, FRICTION, REACH, MASS = 1e-4, 0.2, 0.5, 3.0
PUSH = 2.0 * MASS * 9.81
NOISE = 5e-6


@pytest.fixture
def arm(urdf):
    """A joint about y, its weight at the tool."""
    return urdf(
        body("arm", mass=MASS, com=f"{REACH} 0 0"),
        joint("j", "base", "arm", axis="0 1 0"),
        tip("arm"),
    )


def about(one):
    """Value and half width of an estimate."""
    return one.value, one.half_width


def planar(play=CLEARANCE, friction=FRICTION):
    """A journal that does not lean; its friction is full at once, its contact stiff."""
    return RevoluteClearance.planar(
        radial_clearance=play, friction=Ambrosio(friction, v0=0.0, v1=1e-9), stiffness=1e15
    )


def course(stops=True, speed=0.2, rate=100.0, end=0.4, turns_back=True):
    """There and back; then the arm stands and is pushed up and down: time, angle, speed, force."""
    duration = 2.0 * end / speed
    t = np.arange(0.0, duration, 1.0 / rate)
    legs = [-end + speed * t] + ([end - speed * t, -end + speed * t] if turns_back else [])
    angle = np.concatenate(legs)
    force = np.zeros(len(angle))
    if stops:
        hold = int(0.8 * rate)
        for push in (0.0, PUSH, 2.0 * PUSH, 0.0, PUSH, 2.0 * PUSH):
            angle = np.append(angle, np.full(hold, angle[-1]))
            force = np.append(force, np.full(hold, push))
    way = np.gradient(angle)
    return np.arange(len(angle)) / rate, angle, np.sign(np.round(way, 9)), force


def seen(clearance=CLEARANCE, friction=FRICTION, noise=NOISE, seed=0, **options):
    """What a tracker sees of the arm about y: the journal lies opposite to its motion's drag.

    Known: with the load F, the journal's place is F's direction turned by atan(mu) against its
    rotation; about y, z turns to x.
    """
    time, angle, way, force = course(**options)
    random = np.random.default_rng(seed)
    side = np.sign(force - MASS * 9.81)
    turn = -way * math.atan(friction)
    x, z = clearance * side * np.sin(turn), clearance * side * np.cos(turn)
    tool = {
        ("tool", "x"): REACH * np.cos(angle) + x,
        ("tool", "y"): np.zeros(len(time)),
        ("tool", "z"): -REACH * np.sin(angle) + z,
    }
    bent = 2e-3 * np.sin(3.0 * angle)  # the robot's geometry is off, which nobody knows
    signals = {key: v + bent + noise * random.standard_normal(len(v)) for key, v in tool.items()}
    signals["motor", "j"] = angle
    signals["force", "z"] = force
    return Measurement(time, signals)


def test_clearance_and_friction_are_recovered_from_passing_and_pushing(arm):
    mechanism = Mechanism(arm, {"j": planar(5e-5, 0.1)})
    found = identify(mechanism, seen())
    for label, wanted in (("j radial clearance", CLEARANCE), ("j friction", FRICTION)):
        value, half = about(found[label])
        assert half < 0.25 * wanted  # a bush that may be there takes a part: see below
        assert abs(value - wanted) < 2.0 * half
    # A bush that gives way aside may be there, unless it is said that there is none.
    known = identify(mechanism, seen(), stiffness={"j bush": math.inf})
    assert known["j friction"].half_width < found["j friction"].half_width
    assert found.mechanism.clearance["j"].cr == pytest.approx(found["j radial clearance"].value)
    assert found.misfit < 1.5


def test_passing_alone_tells_the_product_and_says_so(arm):
    mechanism = Mechanism(arm, {"j": planar()})
    found = identify(mechanism, seen(stops=False))
    assert not any(one.known for one in found.estimates)
    text = str(found)
    assert "this measurement cannot tell" in text
    assert "j radial clearance: it acts only together with j friction" in text
    assert "would determine it" in text
    assert "N on the tool" in text or "push the tool" in text
    known = identify(mechanism, seen(stops=False), known=["friction"])
    value, half = about(known["j radial clearance"])
    assert abs(value - CLEARANCE) < 2.0 * half < 0.3 * CLEARANCE


def test_only_a_calibrated_robot_needs_no_reversal(arm):
    measured = seen(stops=False, turns_back=False, noise=1e-6)
    flat = 2e-3 * np.sin(3.0 * measured.signals["motor", "j"])
    signals = {key: v - flat if key[0] == "tool" else v for key, v in measured.signals.items()}
    mechanism = Mechanism(arm, {"j": planar(5e-5, 0.1)})
    found = identify(mechanism, Measurement(measured.time, signals), reference="ideal")
    assert found["j radial clearance"].value == pytest.approx(CLEARANCE, rel=0.01)
    assert found["j friction"].value == pytest.approx(FRICTION, rel=0.05)
    with pytest.raises(JointplayError, match="never reverses"):
        identify(mechanism, measured)


def test_too_much_noise_cannot_tell(arm):
    mechanism = Mechanism(arm, {"j": planar()})
    found = identify(mechanism, seen(noise=5e-3))
    assert not any(one.known for one in found.estimates[:2])
    assert "95 % interval would be" in str(found) or "noise" in str(found)


def test_a_joint_that_does_not_move_the_tool_cannot_be_told(urdf):
    path = urdf(
        body("arm", mass=MASS, com=f"{REACH} 0 0"),
        joint("j", "base", "arm", axis="0 1 0"),
        body("other"),
        joint("k", "base", "other", axis="0 1 0", at="0 1 0"),
        tip("arm"),
    )
    mechanism = Mechanism(path, {"j": planar(), "k": planar()}, tool="tool")
    found = identify(mechanism, seen())
    assert found["j radial clearance"].known
    assert not found["k radial clearance"].known
    assert "k radial clearance: not observable: the joint does not move the tool" in str(found)
    assert found.mechanism.clearance["k"] == planar()


@pytest.fixture
def geared(urdf):
    """A joint about z whose gear has play; gravity turns nothing."""
    path = urdf(body("arm", mass=2.0), joint("j", "base", "arm"), tip("arm"))
    return Mechanism(path, gears={"j": Gear(play=1e-3, rotor_inertia=0.1, stiffness=1e3)})


def lagging(play=2e-3, dry=0.5, stiffness=1e3, noise=2e-5, without=""):
    """Motor and link: the link trails by half the play and what the teeth give."""
    time, angle, _, _ = course(stops=False)
    random = np.random.default_rng(0)
    link, trail = angle.copy(), play / 2.0 + dry / stiffness
    for i in range(1, len(angle)):
        link[i] = min(max(link[i - 1], angle[i] - trail), angle[i] + trail)
    torque = np.clip((np.abs(angle - link) - play / 2.0) * stiffness, 0.0, None)
    torque *= np.sign(angle - link)
    signals = {
        ("motor", "j"): angle,
        ("link", "j"): link + noise * random.standard_normal(len(time)),
        ("torque", "j"): torque + 0.3 + 0.02 * random.standard_normal(len(time)),
    }
    return Measurement(time, {key: v for key, v in signals.items() if key[0] != without})


@pytest.mark.parametrize(
    ("options", "more"),
    [
        ({}, {"known": ["gear_compliance"]}),
        ({"play": 20e-3, "dry": 2.0, "without": "link"}, {"stiffness": {"j": 1e3}}),
    ],
)
def test_play_and_friction_of_a_gear_are_recovered(geared, options, more):
    """By an encoder on the link, or by the motor's torque alone."""
    found = identify(geared, lagging(**options), **more)
    wanted = {"play": 2e-3, "dry": 0.5} | options
    value, half = about(found["j gear play"])
    assert abs(value - wanted["play"]) < 2.0 * half < 0.2 * wanted["play"]
    value, half = about(found["j dry friction"])
    assert abs(value - wanted["dry"]) < 2.0 * half < 0.2 * wanted["dry"]


def test_the_loop_of_a_joint_shows_what_was_measured_on_both_ways_and_the_fit(geared, arm):
    found = identify(geared, lagging(), known=["gear_compliance"])
    (loop,) = found.loops
    assert (loop.x_name, loop.unit) == ("position", "rad")  # the torque is the same all along
    step = [np.median(loop.measured[loop.branch == way]) for way in (-1, 1)]
    assert step[0] - step[1] == pytest.approx(2e-3 + 2.0 * 0.5 / 1e3, rel=0.05)
    off = loop.measured - loop.fitted
    assert np.sqrt(np.mean(off**2)) < 2e-5
    # A journal's, by the tool alone: it lies on the bore's other side while it is pushed up.
    (loop,) = identify(Mechanism(arm, {"j": planar(5e-5, 0.1)}), seen()).loops
    assert loop.unit == "m"
    assert np.ptp(loop.measured) == pytest.approx(2.0 * CLEARANCE, rel=0.1)
    assert np.abs(loop.measured - loop.fitted).max() < 1e-5


def test_what_is_identified_is_a_preset_for_other_commands(geared, tmp_path, capsys):
    data, own = tmp_path / "seen.csv", tmp_path / "my.toml"
    data.write_text(lagging().csv())
    robot, gear = str(geared.description.path), ["--gear", "j=1e-3"]
    order = ["identify", robot, str(data), "--tool", "tool", "--known-stiffness", "j=1e3", *gear]
    assert main([*order, "--write-preset", str(own)]) == 0
    assert f"every command takes it as --preset {own}" in capsys.readouterr().out
    one = preset(own)
    assert one.mechanism(tool="tool").gears["j"].play == pytest.approx(2e-3, rel=0.1)
    tables = one.tables(geared.description)
    assert tables["joint_friction"]["j"]["coulomb"] == pytest.approx(0.5, rel=0.1)
    assert tables["drives"]["j"]["encoder"] == "motor"
    origin = {one.key: one for one in one.origins}["j.gear.play"]
    assert origin.origin == "measured"
    assert str(data) in origin.source
    run = ["run", robot, "--preset", str(own), "--rotor-inertia", "0.1", "--tool", "tool"]
    short = ["--duration", "0.01", "--no-figures", "--quiet", "--out", str(tmp_path / "out")]
    assert main([*run, *short]) == 0, capsys.readouterr().err
    assert main([*order, "--write-preset", str(own)]) == 2
    assert "already exists" in capsys.readouterr().err


@pytest.mark.thorough
@pytest.mark.usefixtures("checked_figures")
def test_a_clearance_that_is_identified_goes_into_the_urdf(arm, tmp_path, capsys):
    data, out = tmp_path / "seen.csv", tmp_path / "worn.urdf"
    data.write_text(seen().csv())
    order = ["identify", str(arm), str(data), "--tool", "tool", "--joint", "j=0.05 mm", "--quiet"]
    assert main([*order, "--urdf", str(out), "--out", str(tmp_path / "found")]) == 0
    assert (tmp_path / "found" / "identified.png").is_file()
    assert f"written: {out}" in capsys.readouterr().out
    worn = Mechanism(out)
    assert {"j.x", "j.y", "j.z", "j"} <= set(worn.joints)


def test_play_and_compliance_are_not_told_apart_without_another_load(geared):
    measured, friction = lagging(without="torque"), {"j": JointFriction(0.5)}
    found = identify(geared, measured, joint_friction=friction)
    assert not any(one.known for one in found.sought)
    assert "acts only together with" in found.estimates[0].reason
    known = ["gear_compliance", "dry_friction"]
    found = identify(geared, measured, joint_friction=friction, known=known)
    assert found.estimates[0].known


@pytest.mark.thorough
def test_gravity_that_keeps_the_teeth_on_one_side_hides_the_play(arm):
    gear = Gear(play=1e-3, rotor_inertia=0.1, stiffness=1e5)
    found = identify(Mechanism(arm, {"j": planar()}, gears={"j": gear}), seen(stops=False))
    assert "j gear play: not observable: the load keeps the gear's teeth on one side" in str(found)


def test_loops_are_refused(tmp_path, capsys):
    path = tmp_path / "seen.csv"
    rows = [f"{0.01 * k:g},{k},0" for k in range(30)]
    path.write_text("\n".join(["time [s],crank_pin motor [deg],tool x [mm]", *rows]) + "\n")
    assert main(["identify", "jointplay:slider_crank.toml", str(path), "--case", "0.1 mm"]) == 2
    assert "identify is for robots without closed loops" in capsys.readouterr().err


@pytest.mark.thorough
def test_a_simulated_machine_is_identified_from_what_instruments_see(arm):
    bearing = RevoluteClearance(
        radial_clearance=8e-5, axial_clearance=8e-5, lock_axial=True, restitution=0.5
    )
    there = [0.0, 0.1, 1.3, 1.4, 2.6, 2.9, 4.1, 4.2, 5.4]
    low, high = [-0.3], [0.3]
    motion = Motion(["j"], there, [low, low, high, high, low, low, high, high, low])
    up = loads.WrenchOverTime(
        frame="tool", times=(2.6, 2.7), forces=((0.0, 0.0, 0.0), (0.0, 0.0, 60.0))
    )
    simulation = Simulation(
        Mechanism(arm, {"j": bearing}), motion, loads={"push": up}, record_every=100
    )
    result = simulation.run()
    kinds = ("tool", "motor", "force")
    measured = Measurement.from_result(result, noise={"tool": 1e-5}, kinds=kinds, seed=1)
    nominal = replace(bearing, radial_clearance=2e-4, journal_radius=None)
    machine = replace(simulation, mechanism=Mechanism(arm, {"j": nominal}))
    found = identify(machine, measured, stiffness={"all": math.inf}, drift=0)
    value, half = about(found["j radial clearance"])
    assert abs(value - 8e-5) < max(half, 0.03 * 8e-5)
    assert half < 0.3 * 8e-5


JOINTS = {"j": False}


def written(tmp_path, text):
    path = tmp_path / "data.csv"
    path.write_text(text)
    return path


def rows(header, count=30):
    width = header.count(",")
    return header + "\n" + "\n".join(f"{i}" + f",{i}" * width for i in range(count)) + "\n"


@pytest.mark.parametrize("name", ["[j]", "a(b)", "(j", "j)", "é [x] 1"])
def test_joints_may_have_brackets_in_their_names(name):
    for unit in ("[rad]", "(rad)", " [rad] "):
        found = columns.split_title(f"{name} motor {unit}")
        assert found == (f"{name} motor", "rad")


def test_units_of_columns_are_read_in_brackets_and_behind_underscores(tmp_path):
    path = written(tmp_path, "# a note\n" + rows("time [ms],tool x [mm],j motor [deg],j_link_mrad"))
    found = Measurement.from_csv(path, JOINTS)
    assert found.time[1] == pytest.approx(1e-3)
    assert found.signals["tool", "x"][1] == pytest.approx(1e-3)
    assert found.signals["motor", "j"][1] == pytest.approx(math.pi / 180.0)
    assert found.signals["link", "j"][1] == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (rows("tool x [mm],j motor [deg]"), "has no times"),
        (rows("time [s],tool x"), "column 'tool x' has no unit"),
        (rows("time [s],tool x [kg]"), "column 'tool x [kg]'"),
        (rows("time [s],nose x [m]"), "is unknown; there are"),
        (rows("time [s],k motor [rad]"), "is unknown; there are"),
        (rows("time [s],tool x [m],tool_x_mm"), "appears twice"),
        (rows("time [s]"), "only times"),
        (rows("time [s],tool x [m]", 2), "2 records"),
        ("time [s],tool x [m]\n" + "0,1\n" * 30, "times must increase"),
        ("time [s],tool x [m]\n0,1\n1,soft\n", "line 3: 'tool x [m]' must be a number"),
        ("time [s],tool x [m]\n0,1,2\n", "line 2: 2 cells expected, got 3"),
        ("time [s],tool x [m]\n0,inf\n", "line 2: 'tool x [m]' is at most 1e+12 in SI, got inf"),
        ("", "is empty"),
    ],
)
def test_bad_data_are_refused_in_one_line(tmp_path, text, words):
    with pytest.raises(JointplayError) as raised:
        Measurement.from_csv(written(tmp_path, text), JOINTS)
    assert words in str(raised.value)
    assert "\n" not in str(raised.value)


def test_a_measurement_survives_its_file_a_slider_in_metres_and_newtons(tmp_path):
    time = np.arange(30.0)
    names = [("motor", "z"), ("torque", "z"), ("motor", "j"), ("tool", "x"), ("force", "y")]
    signals = {key: (k + 1.0) / 3.0 * time for k, key in enumerate(names)}
    measured = Measurement(time, signals, sliding=frozenset({"z"}))
    path = written(tmp_path, measured.csv())
    head = "time [s],z motor [m],z torque [N],j motor [rad],tool x [m],force y [N]"
    assert path.read_text().splitlines()[0] == head
    back = Measurement.from_csv(path, {"z": True, "j": False})
    assert back.sliding == {"z"}
    assert list(back.signals) == names
    for key, values in signals.items():
        assert back.signals[key] == pytest.approx(values)


def test_what_shows_no_play_is_refused(arm):
    measured = seen()
    signals = {key: v for key, v in measured.signals.items() if key[0] == "motor"}
    with pytest.raises(JointplayError, match="no signal in which play would show"):
        identify(Mechanism(arm, {"j": planar()}), Measurement(measured.time, signals))
    with pytest.raises(JointplayError, match="nothing has play"):
        identify(Mechanism(arm), measured)
    with pytest.raises(JointplayError, match="no reference"):
        identify(Mechanism(arm, {"j": planar()}), measured, reference="there")
    with pytest.raises(JointplayError, match="no unknown 'mass'"):
        identify(Mechanism(arm, {"j": planar()}), measured, known=["mass"])


@settings(max_examples=50)
@given(
    st.lists(st.floats(-1.0, 1.0), min_size=2, max_size=6),
    st.floats(1e-6, 1e-3),
    st.integers(0, 1000),
)
def test_turning_points_are_found_through_noise(corners, noise, seed):
    ends = [0.0]
    for value in corners:
        ends.append(ends[-1] + (0.2 + abs(value)) * (-1.0 if len(ends) % 2 else 1.0))
    legs = [np.linspace(a, b, 200, endpoint=False) for a, b in pairwise(ends)]
    clean = np.concatenate(legs)
    random = np.random.default_rng(seed)
    way = turns(clean + noise * random.uniform(-1.0, 1.0, len(clean)), 4.0 * noise)
    wanted = np.concatenate([np.full(200, np.sign(b - a)) for a, b in pairwise(ends)])
    middle = (np.arange(len(clean)) % 200 > 20) & (np.arange(len(clean)) % 200 < 180)
    assert (way[middle] == wanted[middle]).all()


def test_the_scatter_of_records_is_that_of_their_noise():
    random = np.random.default_rng(0)
    t = np.linspace(0.0, 3.0, 2000)
    assert scatter(np.sin(t) + 1e-3 * random.standard_normal(2000)) == pytest.approx(1e-3, rel=0.1)
    assert resolution(np.round(np.sin(t), 2)) == pytest.approx(0.01)
    assert resolution(np.sin(t)) == 0.0


def test_a_plan_pushes_where_passing_tells_the_product_only(arm):
    mechanism = Mechanism(arm, {"j": planar()})
    passing = plan_measurement(mechanism, push=0.0, count=3)
    assert "cannot tell: acts only together with j friction" in str(passing)
    pushing = plan_measurement(mechanism, push=60.0, count=3)
    assert "cannot tell" not in str(pushing)
    assert any(one.force is not None for one in pushing.experiments)
    assert (np.diff(pushing.half_width, axis=0) <= 1e-15).all()


def test_a_plan_refuses_what_cannot_be(arm, geared):
    mechanism = Mechanism(arm, {"j": planar()})
    for options, words in (
        ({"count": 0}, "at least one experiment"),
        ({"signals": ["smell"]}, "no signal 'smell'"),
        ({"signals": ["link"]}, "link encoders"),
    ):
        with pytest.raises(JointplayError, match=words):
            plan_measurement(mechanism, **options)
    assert "j gear play" in str(plan_measurement(geared, signals=["link"]))


def test_the_command_plans_and_refuses_in_one_line(arm, tmp_path, capsys):
    play = ["--joint", "j=0.1 mm", "--tool", "tool"]
    assert main(["identify", str(arm), "--plan", "--count", "2", *play]) == 0
    assert "expected 95 % interval" in capsys.readouterr().out
    for order, words in (
        (["identify", str(arm), *play], "give a measurement"),
        (["identify", str(arm), "--preset", "x.csv", *play], "--preset took 'x.csv'"),
        (["identify", str(arm), "x.csv", "--plan", *play], "not both"),
        (["identify", str(arm), str(tmp_path / "none.csv"), *play], "cannot read the measurement"),
        (["identify", str(arm), "--plan", "--noise", "tool", *play], "--noise must read"),
    ):
        assert main(order) == 2
        said = capsys.readouterr().err
        assert words in said
        assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("clearance", "friction_half_width", "told"),
    [(1.5e-7, 0.9, False), (1.5e-7, 0.01, True), (5e-5, 0.9, True)],
)
def test_next_to_no_play_is_not_told_beside_friction_that_is_not(
    clearance, friction_half_width, told
):
    """Friction that may be anything holds a journal in wide play as still as no play does."""
    unknowns = (
        Unknown("j", "radial_clearance", "m", 5e-5, 1e-5, 1e-3),
        Unknown("j", "friction", "", 0.1, 0.1, 2.0),
    )
    least = LeastSquares(unknowns, lambda theta: theta, np.zeros(2), np.ones(2))
    half_width = np.array([2e-7, friction_half_width])
    fit = Fit(least=least, theta=np.array([clearance, 0.1]), widened=half_width)
    said = reason(0, fit, None)
    assert (said == "") is told
    assert told or "j friction, which cannot be determined, may hold the journal" in said


@pytest.mark.parametrize(
    ("robot", "name"),
    [("scara", "joint_b"), pytest.param("ur5", "elbow_joint", marks=pytest.mark.thorough)],
)
def test_a_plan_has_different_experiments_that_can_be_done(robot, name):
    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    tool = "suction_cup" if robot == "scara" else "tool0"
    mechanism = Mechanism(robot, {name: bearing}, tool=tool)
    plan = plan_measurement(mechanism, count=8)
    apart = planning.distances(mechanism, plan.experiments)
    assert apart[~np.eye(8, dtype=bool)].min() >= planning.APART
    ideal, shapes = mechanism.ideal(), SelfCollision(mechanism)
    assert bool(shapes.notes) == (robot == "scara")
    assert all(note in str(plan) for note in shapes.notes)
    for one in plan.experiments:
        at = dict(zip(plan.joints, one.positions, strict=True))
        assert not shapes.hits(at)
        for moved, place in at.items():
            entry = mechanism.description.joints[moved]
            assert entry.lower is None or entry.lower < place < entry.upper
        weight = pin.computeGeneralizedGravity(ideal.model, ideal.data, ideal.configuration(at))
        most = [mechanism.description.joints[name].effort or np.inf for name in plan.joints]
        assert (np.abs(weight) <= most).all()
    assert (plan.gains >= 1.0).all()
    assert f"information x {plan.gains[7]:.3g} (its determinant)" in str(plan)
    assert f"most about {name}" in plan.reason(0)
    assert (np.diff(plan.half_width, axis=0) <= 1e-12).all()


def test_stops_are_at_the_same_place_only_close_together():
    """Else what the geometry errs by between them would be the tool's scatter."""
    at, stopped = np.array([[0.0], [0.3], [0.0], [0.3]]), np.array([True, True, False, False])
    assert places(at, stopped, np.ones(1)).tolist() == [0, 1, 2, 2]


def test_small_values_are_told_with_an_interval_up_to_an_eighth_of_their_scale():
    clearance = Unknown("j", "radial_clearance", "m", 4e-5, 4e-5, 1e-3)
    assert widest(clearance, 0.0) == widest(clearance, 1e-5) == pytest.approx(5e-6)
    assert widest(clearance, 2e-5) == pytest.approx(1e-5)


@pytest.mark.thorough
def test_a_plan_does_not_refine_what_is_known_as_well_as_the_model_at_the_cost_of_the_rest():
    play = RevoluteClearance(radial_clearance=5e-5, axial_clearance=5e-5, bearing_radius=20e-3)
    worn = {name: play for name in ("shoulder_lift", "elbow_flex")}
    plan = plan_measurement(Mechanism("so101", worn), count=4)
    wide = [half / x.scale for half, x in zip(plan.half_width[-1], plan.unknowns, strict=True)]
    sought = [half for half, x in zip(wide, plan.unknowns, strict=True) if x.sought]
    assert max(sought) < 0.28


def test_a_plan_says_when_no_more_experiments_differ(arm):
    mechanism = Mechanism(arm, {"j": planar()})
    poses = np.tile(mechanism.configuration({}), (5, 1))
    plan = plan_measurement(mechanism, poses=poses, count=9)
    assert len(plan.experiments) == 7  # passed, or passed or pushed at along each axis
    assert "9 were asked for, but no more than 7 differ" in str(plan)


def test_loads_beyond_the_limits_of_effort_are_not_proposed(arm):
    plan = plan_measurement(Mechanism(arm, {"j": planar()}), push=1e5, count=2)
    assert "their loads exceed a joint's limit of effort" in str(plan)
    assert all(one.force is None or one.force[1] for one in plan.experiments)  # along the axis


@pytest.mark.thorough
def test_a_robot_that_hits_itself_is_told_and_links_that_always_touch_are_left_out():
    arm = SelfCollision(Mechanism("ur5"))
    assert not arm.hits({})
    bent = {"shoulder_lift_joint": -1.57}
    assert any(arm.hits(bent | {"elbow_joint": angle}) for angle in (2.9, 3.0, 3.14))
    assert "for they touch at zero" in SelfCollision(Mechanism("kinova")).notes[0]


def test_a_search_moves_its_bar_to_the_end(monkeypatch):
    bars = []

    class Bar(ProgressBar):
        def __init__(self, *given, **shown):
            super().__init__(*given, **shown)
            bars.append(self)

    monkeypatch.setattr(least_squares, "ProgressBar", Bar)
    unknowns = tuple(Unknown("j", name, "m", 1e-4, 1e-4, 1e-2) for name in ("gear_play", "offset"))
    measured, rows = np.array([2e-4, 5e-4, 3e-4]), np.array([[1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    problem = LeastSquares(unknowns, lambda x: rows @ x, measured, np.full(3, 1e-6))
    fitted = least_squares.search(problem, progress=True)
    assert fitted.theta == pytest.approx([2e-4, 3e-4], rel=1e-3)
    (bar,) = bars
    assert bar.n == bar.total > 0


@pytest.mark.parametrize(("spread", "freedom"), [(1e3, 12.0), (1e-3, 17.0)])
def test_a_prior_that_says_nothing_takes_as_much_of_the_data_as_none(spread, freedom):
    """Five nuisances beside three unknowns of twenty numbers: the scatter is found as it is."""
    random, unknowns = np.random.default_rng(1), [Unknown("", f"u{i}") for i in range(3)]
    slope, nuisance = random.standard_normal((20, 3)), random.standard_normal((20, 5))
    noise, sizes = random.standard_normal((400, 20)), []
    for measured in noise + spread * random.standard_normal((400, 5)) @ nuisance.T:
        least = LeastSquares(
            tuple(replace(one, least=-np.inf) for one in unknowns), lambda x: slope @ x, measured,
            np.ones(20), nuisance, spread=np.full(5, spread), jacobian=lambda x: slope,
        )  # fmt: skip
        fit = Fit(least=least, theta=minimum(least, np.zeros(3)))
        assert fit.freedom == pytest.approx(freedom, abs=1e-3)
        sizes.append(fit.misfit**2)
    assert np.mean(sizes) == pytest.approx(1.0, abs=0.06)


def test_all_wrong_columns_are_named_at_once_with_what_to_write(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("timestamp,k.goal,k.pos,nose [m]\n0,0,0,0\n")
    with pytest.raises(JointplayError) as error:
        Measurement.from_csv(path, {"k": False})
    for said in (
        "write 'time [s]'",
        "write 'k goal [deg]'",
        "write 'k [deg]'",
        "'nose [m]' is unk",
    ):
        assert said in str(error.value)


def test_a_joint_alone_is_its_motor_and_where_it_was_sent_is_left_out(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time [s],k goal [deg],k [deg]\n" + "".join(f"{t},9,{t}\n" for t in range(40)))
    signals = Measurement.from_csv(path, {"k": False}).signals
    assert list(signals) == [("motor", "k")]
    assert signals["motor", "k"][3] == pytest.approx(np.radians(3.0))
