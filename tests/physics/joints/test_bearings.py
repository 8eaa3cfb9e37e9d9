"""Rolling bearings: catalogue, geometry, law, free set, life, and what is refused."""

import importlib.util
import math
import subprocess
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from warm import JOINTPLAY

import jointplay as jp
from jointplay.accuracy.error_budget import budget
from jointplay.base.errors import JointplayError, MissingName
from jointplay.physics.joints.bearings import (
    bearing_kind,
    catalogue,
    is_designation,
    point_contact_stiffness,
)
from jointplay.simulation.loads.drive import Prescribed

DEEP = jp.BallBearing(designation="6010/C3")
PAIR = jp.BallBearing(designation="7206 B DB", preload=120.0)
CROSSED = jp.CrossedRollerBearing(designation="RB5013 C0")
BEARINGS = {"deep groove": DEEP, "preloaded pair": PAIR, "crossed rollers": CROSSED}
every = pytest.mark.parametrize("bearing", BEARINGS.values(), ids=BEARINGS)
SEVEN = {
    "bore": 20e-3, "outside_diameter": 67e-3, "elements": 7, "element_diameter": 11.5e-3,
    "pitch_diameter": 43.5e-3, "inner_groove": 0.52, "outer_groove": 0.53,
    "dynamic_rating": 23400.0,
}  # fmt: skip


@pytest.fixture(scope="module")
def benchmark():
    """The benchmark of bearings, as a module."""
    return importlib.import_module("truth.bearings")


# The reference numbers, as the benchmark has them.


@pytest.mark.parametrize(
    "part",
    [
        pytest.param("deflections", marks=pytest.mark.thorough),
        "distributions",
        pytest.param("free_sets", marks=pytest.mark.thorough),
        "energies",
        "varying_compliance",
    ],
)
def test_reference_numbers_are_met_within_their_limits(benchmark, part):
    cases = benchmark.Cases()
    getattr(benchmark, part)(cases)
    assert cases.rows
    assert cases.worst < 1.0, str(cases)


@pytest.mark.thorough
def test_what_turns_without_loss_keeps_its_energy_while_the_cage_goes_around(benchmark):
    cases = benchmark.Cases()
    benchmark.moving_cage(cases, 0.2)
    assert cases.worst < 1.0, str(cases)


# Hertz.


def test_a_sphere_on_a_plane_is_hertz_s_own():
    radius, modulus = 5e-3, 2.3e11
    stiffness, ratio = point_contact_stiffness(2.0 / radius, 0.0, modulus)
    assert ratio == 1.0
    # Both bodies are equal: 1/E* is twice that of one.
    assert stiffness == pytest.approx(4.0 / 3.0 * 0.5 * modulus * math.sqrt(radius), rel=1e-9)


def test_a_closer_groove_is_stiffer_and_the_inner_ring_softer():
    tight = jp.BallBearing(**{**SEVEN, "inner_groove": 0.51}, radial_clearance=0.0)
    wide = jp.BallBearing(**{**SEVEN, "inner_groove": 0.56}, radial_clearance=0.0)
    assert tight.stiffness_of_element > wide.stiffness_of_element
    even = jp.BallBearing(**{**SEVEN, "outer_groove": 0.52}, radial_clearance=0.0)
    assert even.race_contact(inner=True)[0] < even.race_contact(inner=False)[0]


# Geometry and catalogue.


def test_a_designation_gives_size_class_and_inner_geometry():
    assert (DEEP.d_bore, DEEP.d_outside, DEEP.row_width) == (0.05, 0.08, 0.016)
    assert (DEEP.count, DEEP.d_element) == (14, pytest.approx(8.73e-3))
    assert DEEP.cr == pytest.approx(13.5e-6)
    assert DEEP.class_range() == (pytest.approx(9e-6), pytest.approx(18e-6))
    assert DEEP.ratings() == (21800.0, 16600.0)
    assert PAIR.alpha == pytest.approx(math.radians(40.0))
    assert PAIR.pairing == "DB"
    assert CROSSED.d_pitch == pytest.approx(64e-3)


def test_shields_and_blanks_do_not_matter():
    assert jp.BallBearing(designation="6010-2RS C3").cr == DEEP.cr
    assert jp.BallBearing(designation="608ZZ").d_bore == 8e-3
    assert jp.BallBearing(designation="6010", clearance_class="c3").cr == DEEP.cr


def test_what_is_estimated_is_said():
    bare = jp.BallBearing(bore=50e-3, outside_diameter=80e-3)
    assert {"element_diameter", "elements", "pitch_diameter", "radial_clearance"} <= set(
        bare.estimates
    )
    assert "middle of CN" in bare.estimates["radial_clearance"]
    assert "element_diameter" not in DEEP.estimates
    assert bare.d_element == pytest.approx(DEEP.d_element, rel=0.02)
    assert bare.ratings()[1] == pytest.approx(DEEP.ratings()[1], rel=0.1)


@pytest.mark.parametrize("section", ["deep_groove", "angular_contact", "crossed_roller"])
def test_every_line_of_the_catalogue_is_a_bearing_near_its_own_ratings(section):
    kind = jp.CrossedRollerBearing if section == "crossed_roller" else jp.BallBearing
    for name, line in catalogue()[section].items():
        bearing = kind(designation=name)
        dynamic, static = bearing._estimated_ratings()
        assert 0.35 < static / line["static"] < 2.2, name
        if section != "crossed_roller":
            assert 0.5 < dynamic / line["dynamic"] < 2.0, name
        assert bearing.stiffness_of_element > 0.0
        assert bearing_kind(name) == kind.kind


def test_fits_and_heat_take_clearance_away():
    fitted = jp.BallBearing(
        designation="6010/C3", shaft_interference=10e-6, housing_interference=4e-6,
        temperature_difference=10.0,
    )  # fmt: skip
    race_i, race_o = 65e-3 - 8.73e-3, 65e-3 + 8.73e-3
    taken = 10e-6 * 50e-3 / race_i + 4e-6 * race_o / 80e-3 + 0.012e-6 * 10.0 * 65.0
    assert fitted.cr == pytest.approx(DEEP.cr - taken / 2.0, rel=1e-12)


def test_a_preload_is_the_force_with_which_the_rows_press():
    state = PAIR.load(np.zeros(6))
    assert PAIR.preloaded
    assert PAIR.play().support(np.eye(6)).value.max() == 0.0
    assert state.wrench == pytest.approx(np.zeros(6), abs=1e-6)
    up = state.loads * np.sin(state.contact_angles)
    assert up[: PAIR.count].sum() == pytest.approx(-120.0, rel=1e-9)
    assert up[PAIR.count :].sum() == pytest.approx(120.0, rel=1e-9)


def test_back_to_back_is_stiffer_in_tilt_than_face_to_face():
    tilts = {
        word: jp.BallBearing(designation="7206 B", arrangement=word, preload=120.0)
        .deflection(moment=(0.0, 2.0, 0.0))[4]
        for word in ("DB", "DF")
    }  # fmt: skip
    assert 0.0 < tilts["DB"] < 0.5 * tilts["DF"]


def test_a_single_angular_contact_bearing_bears_load_one_way_only():
    single = jp.BallBearing(designation="7206 B", radial_clearance=0.0)
    play = single.play(second_order=False)
    assert play.support(np.eye(6)[2:3]).value[0] == pytest.approx(0.0, abs=1e-9)
    back = play.support(-np.eye(6)[2:3]).value[0]
    assert back == pytest.approx(2.0 * single.distance * math.sin(single.alpha), rel=1e-5)


def test_axial_and_tilt_play_grow_as_the_root_of_the_clearance():
    def play(clearance):
        bearing = jp.BallBearing(designation="6010", radial_clearance=clearance)
        return bearing.play(second_order=False).support(np.eye(6)[[0, 2, 4]]).value

    narrow, wide = play(5e-6), play(20e-6)
    assert wide[0] / narrow[0] == pytest.approx(4.0, rel=1e-5)
    assert wide[1:] / narrow[1:] == pytest.approx([2.0, 2.0], rel=0.03)


# The law.


@every
@settings(max_examples=25, deadline=None)
@given(
    force=st.tuples(*[st.floats(-2000.0, 2000.0)] * 3),
    moment=st.tuples(*[st.floats(-20.0, 20.0)] * 2),
    cage=st.floats(0.0, 6.0),
)
def test_a_ring_at_rest_is_in_equilibrium(bearing, force, moment, cage):
    load = np.array([*force, *moment, 0.0])
    load[np.abs(load) < 1e-2] = 0.0
    found = bearing.deflection(load[:3], load[3:], cage=cage)
    wrench = bearing.load(found, cage=cage).wrench
    left = (wrench + load)[:5] * [1, 1, 1, 2 / bearing.d_pitch, 2 / bearing.d_pitch]
    assert np.linalg.norm(left) <= 1e-6 * max(np.linalg.norm(load), 1e-3)


@every
def test_the_stiffness_is_the_fall_of_the_wrench(bearing):
    place = bearing.deflection((300.0, 100.0, 200.0), (1.0, -2.0, 0.0))
    found, steps = bearing.load(place).stiffness, [1e-9] * 3 + [1e-8] * 3
    ends = [
        [bearing.load(_moved(place, k, way * step)).wrench for way in (1.0, -1.0)]
        for k, step in enumerate(steps)
    ]
    whole = np.array([(b - a) / (2 * s) for (a, b), s in zip(ends, steps, strict=True)]).T
    # The part by loads that turn with their contacts is small.
    for part in (np.s_[:3, :3], np.s_[3:5, 3:5]):
        size = np.abs(whole[part]).max()
        assert found[part] == pytest.approx(whole[part], abs=0.1 * size)
    assert np.linalg.eigvalsh(found[:5, :5]).min() > 0.0


@every
@pytest.mark.parametrize("seat", [None, jp.Elasticity(radial=2e8, axial=1e8, tilt=4e4)])
def test_the_compliance_is_the_change_of_the_place_of_rest_with_the_load(bearing, seat):
    bearing = replace(bearing, seat=seat)
    load, arm = np.array([300.0, 100.0, 200.0, 1.0, -2.0, 0.0]), 0.5 * bearing.d_pitch
    steps = 1e-3 * np.array([1.0, 1.0, 1.0, arm, arm])
    ends = [
        [bearing.deflection(*np.split(load + way * step * np.eye(6)[k], 2)) for way in (1, -1)]
        for k, step in enumerate(steps)
    ]
    expected = np.array([(a - b) / (2.0 * s) for (a, b), s in zip(ends, steps, strict=True)]).T
    found = bearing.rest(load[:3], load[3:]).compliance[:, :5]
    scale = np.outer([1.0, 1.0, 1.0, arm, arm, arm], [1.0, 1.0, 1.0, 1.0 / arm, 1.0 / arm])
    # The compliance in a seat neglects the second order of its lean.
    near = (1e-7 if seat is None else 1e-4) * np.abs(expected * scale).max()
    assert found * scale == pytest.approx(expected * scale, abs=near)


@pytest.mark.parametrize("seed", [11, pytest.param(12, marks=pytest.mark.thorough)])
def test_bearings_of_the_catalogue_come_to_rest_under_any_load(seed):
    drawn = importlib.import_module("cost.bearing_rest")
    for k in range(60 if seed == 11 else 600):
        random = np.random.default_rng([seed, k])
        bearing = drawn.bearing(random)
        load, cage = drawn.load(bearing, random), random.uniform(0.0, 2.0 * math.pi)
        place = bearing.deflection(load[:3], load[3:], cage)
        left = np.linalg.norm(drawn.left(bearing, place, load, cage))
        assert left <= drawn.UNBALANCED * np.linalg.norm(load * drawn.weights(bearing))


def test_bearings_in_tandem_come_to_rest_under_a_faint_moment_alone():
    tandem = jp.BallBearing(designation="7206 B DT")
    moment = np.array([0.0, -5.935794486578955e-05, 0.0])
    place = tandem.deflection(moment=moment, cage=1.5999089580849375)
    wrench = tandem.load(place, cage=1.5999089580849375).wrench
    arm = 0.5 * tandem.d_pitch
    assert wrench[:3] * arm == pytest.approx(np.zeros(3), abs=1e-7 * np.abs(moment).max())
    assert wrench[3:5] == pytest.approx(-moment[:2], abs=1e-7 * np.abs(moment).max())


def test_a_ring_comes_to_rest_where_one_ball_bears_all():
    """Across that ball the ring is free until it touches the next one."""
    bearing = jp.BallBearing(designation="6204", radial_clearance=1.722158226579152e-05)
    force = np.array([-9.247746569215293, 42.03221606347193, 0.0])
    loads = np.zeros((2000, 6))
    loads[:, :3] = force
    loads[1:, :2] = 43.0 * np.array([(math.cos(a), math.sin(a)) for a in range(1999)])
    cages = np.append(0.21655624569700405, np.linspace(0.0, 1.0, 1999))
    places, _ = bearing.rests(loads, cages)
    assert (places[:, 2:] == 0.0).all()
    state = bearing.load(places[0], cage=cages[0])
    assert state.wrench[:3] == pytest.approx(-force, abs=1e-6)


def test_a_load_through_one_ball_leaves_the_ridge_between_the_places_beside_it():
    """By symmetry only rounding takes the search off that ridge, which is too slow."""
    bearing = jp.BallBearing(
        designation="6204", radial_clearance=1.1944264879221976e-05,
        element_stiffness=9803940001.88117, ring_material="bearing-steel",
    )  # fmt: skip
    load = np.array([[-2.031045196529608e-15, 12.34974731453957, 0.0, 0.0, 0.0, 0.0]])
    angles = 0.7853981785846457 + np.array([0.0, 1e-6])
    (ridge, beside), found = bearing.rests(np.repeat(load, 2, axis=0), angles)
    assert found.all()
    assert ridge == pytest.approx(beside, abs=1e-9)


def _moved(place, k, way):
    """A displacement with a little more along or about an axis of the outer ring."""
    move = way * np.eye(6)[k]
    return np.concatenate(
        [place[:3] + move[:3], pin.log3(pin.exp3(move[3:]) @ pin.exp3(place[3:]))]
    )


@settings(max_examples=40, deadline=None)
@given(
    clearance=st.floats(1e-6, 40e-6),
    way=st.tuples(*[st.floats(-1.0, 1.0)] * 5).filter(lambda w: np.linalg.norm(w) > 0.1),
    part=st.floats(0.0, 0.98),
)
def test_nothing_bears_load_within_the_free_set_and_something_beyond(clearance, way, part):
    bearing = jp.BallBearing(designation="6010", radial_clearance=clearance)
    play = bearing.play(second_order=False)
    arm = bearing.d_pitch / 2
    load = np.array([*way[:3], way[3] * arm, way[4] * arm, 0.0])
    point = play.support(load[None]).point[0]
    assert bearing.load(part * point).loads.max() == 0.0
    # The second order of a lean widens the play a little.
    assert bearing.load(1.06 * point).loads.max() > 0.0


@pytest.mark.parametrize("bearing", [DEEP, CROSSED])
def test_elements_that_hold_a_ring_at_rest_balance_the_load(bearing):
    play = bearing.play()
    assert replace(bearing).play() is play  # what is found of it is found once
    loads = np.random.default_rng(1).normal(size=(50, 6)) * ([1.0] * 3 + [0.02] * 3)
    loads[:, 5] = 0.0
    found = play.pressed(loads, play.support(loads).point)
    left = loads + np.einsum("nk,nkd->nd", found.force, found.normal)
    size = np.linalg.norm(loads * [1, 1, 1, 50, 50, 50], axis=1)
    assert (np.abs(left * [1, 1, 1, 50, 50, 50]).max(axis=1) < 1e-4 * size).all()
    assert (found.force >= 0.0).all()


# Life and friction.


def test_life_falls_with_the_cube_of_the_load():
    lives = []
    for factor in (1.0, 2.0):
        loads = DEEP.load(DEEP.deflection((1000.0, 0, 0))).loads * factor
        lives.append(DEEP.life(loads))
    assert lives[0] / lives[1] == pytest.approx(8.0, rel=1e-9)
    assert DEEP.life(np.zeros(14)) == math.inf


def test_at_its_dynamic_rating_a_bearing_turns_about_a_million_times():
    free = jp.BallBearing(designation="6010", radial_clearance=0.0)
    loads = free.load(free.deflection((free.ratings()[0], 0.0, 0.0))).loads
    assert free.life(loads) == pytest.approx(1e6, rel=0.2)


def test_friction_without_load_and_with_it(benchmark):
    bearing = jp.BallBearing(designation="6010/C3", drag_torque=0.02, rolling_friction=0.0)
    run = {"duration": 0.2, "drive": "free", "state": {"shaft": (0.0, 20.0)}, "estimate": False}
    robot = jp.Mechanism(benchmark.ROTOR, {"shaft": bearing}, gravity=(0, 0, 0))
    result = jp.simulate(robot, None, start="centred", **run)
    lost = float(result["friction_dissipation"][-1])
    turned = float(result["q"].sel(coordinate="shaft.yaw")[-1])
    assert lost == pytest.approx(0.02 * turned, rel=1e-3)
    loaded = jp.BallBearing(designation="6010/C3", drag_torque=0.0, rolling_friction=0.01)
    robot = jp.Mechanism(benchmark.ROTOR, {"shaft": loaded})
    result = jp.simulate(robot, None, start="rest", **run)
    assert result.audit.relative_energy_residual < 1e-5
    mean = float(result["friction_dissipation"][-1] / result["q"].sel(coordinate="shaft.yaw")[-1])
    # 2 kg hang on a few balls, which bear 1.0 to 1.5 times the weight in sum.
    assert 1.0 < mean / (0.01 * 0.025 * 2.0 * 9.81) < 1.5


# In a simulation.


def scara(bearing, duration=0.1, **options):
    """The SCARA with a bearing in joint B."""
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
    return jp.simulate(robot, motion, duration=duration, estimate=False, start="rest", **options)


@pytest.fixture(scope="module")
def fine():
    return scara(jp.BallBearing(designation="6004/C3"), integrator="rk4", step=4e-6)


@pytest.mark.parametrize(
    "options", [{"tolerance": 1e-3}, {"step": 5e-6}], ids=["tolerance", "5 us"]
)
def test_all_methods_agree_with_rk4(options, fine):
    bearing = jp.BallBearing(designation="6004/C3")
    found = scara(bearing, **options)
    for name in ("tool_position", "joint_force", "joint_moment", "normal_force"):
        one, other = (np.nan_to_num(r[name].values) for r in (fine, found))
        times = [np.searchsorted(r.time, 0.09) for r in (fine, found)]
        size = np.abs(one).max()
        assert other[times[1]] == pytest.approx(one[times[0]], abs=0.02 * size), name
    assert found.audit.relative_energy_residual < 1e-5
    assert not found.audit.warnings
    assert float(found["loaded_elements"].max()) <= bearing.count


def test_histories_say_what_elements_bear():
    bearing = jp.BallBearing(designation="6004/C3")
    result = scara(bearing, 0.4)
    at = int(result["normal_force"].values[:, 0, 0].argmax())
    place = result["journal_centre"].values[at, 0]
    assert result["gap"].values[at, 0, 0] < 0.0
    assert result["loaded_elements"].values[at, 0] >= 1.0
    assert (
        result["normal_force"].values[at, 0, 0] <= np.linalg.norm(result["joint_force"][at, 0]) * 12
    )
    assert np.hypot(*place[:2]) < bearing.cr + 60e-6


def test_a_run_goes_on_from_its_checkpoint_bit_for_bit(tmp_path):
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    robot = jp.Mechanism(
        jp.shipped("scara.urdf"), {"joint_b": jp.BallBearing(designation="6004/C3")}
    )
    simulation = jp.Simulation(robot, motion, duration=0.1)
    whole = jp.Run(simulation)
    whole.advance(5000)
    other = jp.Simulation.resume(whole.checkpoint(tmp_path / "kept"))
    first, second = (run.finish(check_step=False) for run in (whole, other))
    assert np.array_equal(first["cage_angle"].values, second["cage_angle"].values)
    assert np.array_equal(first["q"].values, second["q"].values)


def test_statics_and_dynamics_agree_where_an_arm_rests():
    joints = {"elbow_joint": jp.BallBearing(designation="7010 C DB", preload=200.0)}
    robot = jp.Mechanism("example-robot-data:ur5", joints)
    found = budget(robot, {"shoulder_lift_joint": -0.5}, drive=Prescribed())
    assert found.worst[0] == 0.0
    assert 1e-6 < found.rest_error[0] < 1e-3  # it gives way although nothing is loose
    drive = "prescribed"
    pose = {name: (-0.5 if name == "shoulder_lift_joint" else 0.0) for name in robot.joints}
    motion = jp.Motion(list(pose), [0.0, 1.0], [list(pose.values())] * 2)
    stands = jp.simulate(
        robot, motion, drive=drive, duration=0.02, start="rest", step=5e-6, estimate=False
    )
    ideal = jp.simulate(robot.ideal(), motion, drive=drive, duration=0.02, estimate=False)
    away = np.linalg.norm(stands["tool_position"][-1] - ideal["tool_position"][-1])
    assert away == pytest.approx(found.rest_error[0], rel=1e-3)


# What is refused.


@pytest.mark.parametrize(
    ("kind", "given", "says"),
    [
        (jp.BallBearing, {"designation": "6011X"}, "6011"),
        (jp.BallBearing, {"designation": "6010", "clearance_class": "C7"}, "C3"),
        (jp.BallBearing, {}, "bore"),
        (jp.BallBearing, {"bore": 0.05, "outside_diameter": 0.04}, "must exceed the bore"),
        (jp.BallBearing, {"bore": 0.05, "outside_diameter": 0.08, "elements": 40}, "do not fit"),
        (jp.BallBearing, {"designation": "6010", "element_diameter": 0.02}, "do not fit"),
        (jp.BallBearing, {"designation": "6010", "inner_groove": 0.5}, "between 0.5 and 1"),
        (jp.BallBearing, {"designation": "6010", "radial_clearance": 3e-4}, "too large"),
        (jp.BallBearing, {"designation": "6010", "preload": 100.0}, "pair"),
        (jp.BallBearing, {"designation": "7206 B DT", "preload": 100.0}, "tandem"),
        (jp.BallBearing, {"designation": "7206 B DX"}, "7206 B"),
        (jp.CrossedRollerBearing, {"designation": "RB5013", "elements": 29}, "even"),
        (jp.CrossedRollerBearing, {"designation": "RB9999"}, "RB"),
        (jp.BallBearing, {"designation": "6010", "rolling_friction": -1.0}, "rolling_friction"),
    ],
)
def test_what_cannot_be_is_refused_by_name(kind, given, says):
    with pytest.raises((JointplayError, MissingName), match=says):
        kind(**given)


def test_a_moment_about_the_axis_is_refused():
    with pytest.raises(JointplayError, match="about its axis"):
        DEEP.deflection(moment=(0.0, 0.0, 1.0))


def test_loads_beyond_the_static_rating_are_warned_of():
    law = DEEP.normal
    contact = DEEP.contact_properties(0)
    depth = (2.0 * DEEP.rated_load / DEEP.stiffness_of_element) ** (2.0 / 3.0)
    (line,) = law.warnings(contact, max_depth=depth, max_speed=0.01)
    assert "static rating" in line
    assert not law.warnings(contact, max_depth=0.3 * depth, max_speed=0.01)


def test_a_step_too_large_for_a_preloaded_bearing_is_refused():
    pair = jp.BallBearing(designation="7206 B DB", preload=8000.0)
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": pair})
    with pytest.raises(JointplayError, match="stiffness of 'joint_b'"):
        jp.simulate(robot, motion, duration=0.01, step=1e-4, estimate=False)


@pytest.mark.parametrize(
    ("text", "near"),
    [("6999", "6909"), ("7206 BECBP", "7206 B"), ("NU205", "6205"), ("6206/C9", "6206"),
     ("nu205", "6205"), ("32005X", "RE20025"), ("zz", None), ("0.2 mm", None),
     ("500 um", None), ("1000 mm", None)],
)  # fmt: skip
def test_a_designation_that_nobody_knows_is_no_length(text, near):
    if near is None:
        assert not is_designation(text)
        assert bearing_kind(text) is None
        return
    assert is_designation(text)
    with pytest.raises(JointplayError, match=rf"unknown bearing '{text}'; did you mean .*{near}.*"):
        bearing_kind(text)


def test_every_command_says_that_a_bearing_is_unknown(tmp_path):
    for command, robot, more in (
        ("run", ["ur5"], ["--out", str(tmp_path / "r.nc")]),
        ("budget", ["ur5"], []),
        ("export simulator", ["ur5"], ["--out", str(tmp_path / "r")]),
        ("export urdf", ["example-robot-data:ur5"], ["--out", str(tmp_path / "r.urdf")]),
    ):
        done = subprocess.run(
            [JOINTPLAY, *command.split(), *robot, "--joint", "elbow_joint=NU205", *more],
            capture_output=True,
            text=True,
        )
        assert done.returncode == 2, command
        assert "unknown bearing 'NU205'; did you mean 6205?" in done.stderr, command


@pytest.mark.parametrize(
    ("name", "clearance", "stiffness", "load", "cage"),
    [
        (
            "16007",
            10.4e-6,
            (1.13e7, 2.66e4),
            [-652.96, 313.34, -997.13, -33.959, 24.566],
            3.624,
        ),
        ("6904", 6.25e-6, (1.88e7, 1.527e4), [1003.9, 569.1, 1553.7, -5.45, 35.654], 2.0768),
    ],
)
def test_a_bearing_that_leans_in_a_soft_seat_balances_its_load(
    name, clearance, stiffness, load, cage
):
    (along, tilt), given = stiffness, np.append(load, 0.0)
    seat = jp.Elasticity(radial=along, axial=along, tilt=tilt)
    one = jp.BallBearing(designation=name, radial_clearance=clearance, seat=seat)
    place = one.deflection(given[:3], given[3:], cage)
    left = one.load(place, cage).wrench + given
    assert np.abs(left[:5]).max() < 1e-9 * np.abs(given).max()
