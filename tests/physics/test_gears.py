"""Strain-wave and cycloidal gears and gear trains, with known answers."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import body, joint
from hypothesis import given, settings
from hypothesis import strategies as st

import jointplay as jp
from jointplay.model.gear import GEARS, Gear, Gearing
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads.drive import ComputedTorque, Free, Prescribed

ARCMIN = math.pi / 10800.0
QUIET = {"joint_friction": {}, "estimate": False}
CATALOGUE = {"rotor_inertia": 0.05, "rated_torque": 16.0}
WAVE = jp.StrainWaveGear.of("CSF-17-50", hysteresis=2e-4, **CATALOGUE)
SAID = replace(WAVE, stated_lost_motion=2e-4)
CYCLOIDAL = jp.CycloidalGear.of(
    "RV-42N", rotor_inertia=1.0, rated_torque=400.0, hysteresis=5e-5, play=5e-5
)
STAGES = (
    jp.GearStage(ratio=4.0, backlash=0.02, efficiency=0.95),
    jp.GearStage(ratio=5.0, backlash=0.01, efficiency=0.9),
)
TRAIN = jp.GearTrain(stages=STAGES, stiffness=400.0, rotor_inertia=0.03, rated_torque=3.0)


@pytest.fixture
def disc(urdf):
    """One body on its axis z, without weight about it."""
    path = urdf(body("disc", 1.0, "0 0 0", 0.02), joint("a", "base", "disc", "continuous"))
    return lambda gear: jp.Mechanism(path, gears={"a": gear}, gravity=(0, 0, 0))


@pytest.fixture
def pendulum(urdf):
    path = urdf(body("bar", 2.0, "0.3 0 0"), joint("a", "base", "bar", axis="0 1 0"))
    return lambda gear: jp.Mechanism(path, gears={"a": gear})


def loop(gear, top, n=400):
    """Torques and angles once around a closed loop to +-`top`, down first."""
    way = np.linspace(1.0, -1.0, n)
    torques = top * np.concatenate([[1.0, -1.0, 1.0], way, way[::-1]])
    angles = gear.torsion(torques)
    return torques[3:], angles[3:]


# What catalogues measure


def test_the_torsion_curve_has_the_catalogues_stiffnesses_between_its_torques():
    torques, angles = loop(WAVE, 16.0, 2000)
    up = slice(2000, None)
    slope = np.gradient(torques[up], angles[up])
    grip, _ = WAVE.bristles
    for low, high, expected in ((0.5, 3.9, 8.1e3), (3.9, 12.0, 1.1e4), (12.0, 15.0, 1.3e4)):
        # On the branch that is loaded friction adds its torque to the elastic one.
        inside = (torques[up] > low + 1.2 * grip) & (torques[up] < high + 0.8 * grip)
        assert inside.sum() > 20
        assert slope[inside] == pytest.approx(np.full(inside.sum(), expected), rel=0.01)


def test_the_middle_of_the_loop_is_the_curve():
    torques, angles = loop(WAVE, 16.0, 4000)
    down, up = slice(0, 4000), slice(4000, None)
    there = np.linspace(-6e-4, 6e-4, 50)
    middle = 0.5 * (
        np.interp(there, angles[down][::-1], torques[down][::-1])
        + np.interp(there, angles[up], torques[up])
    )
    assert middle == pytest.approx(np.sign(there) * WAVE.curve().torque(np.abs(there)), abs=2e-3)


@pytest.mark.parametrize(
    ("gear", "stated"), [(SAID, 2e-4), (CYCLOIDAL, ARCMIN)], ids=["strain-wave", "cycloidal"]
)
def test_lost_motion_and_hysteresis_come_out_as_stated(gear, stated):
    assert gear.lost_motion() == pytest.approx(stated, rel=1e-3)
    assert gear.hysteresis_loss() == pytest.approx(gear.play + gear.hysteresis, rel=1e-3)
    assert gear.unloaded_range == pytest.approx(gear.play + gear.hysteresis, rel=1e-6)


def test_lost_motion_of_a_gear_without_hysteresis_is_play_and_windup():
    bare = jp.StrainWaveGear.of("CSF-17-50", play=1e-4, **CATALOGUE)
    assert bare.lost_motion() == pytest.approx(1e-4 + 2 * 0.04 * 16.0 / 8.1e3, rel=1e-9)
    turns = TRAIN.lost_motion(0.5)
    assert turns == pytest.approx(TRAIN.play + 2 * 0.5 * 3.0 / 400.0, rel=1e-9)
    assert TRAIN.hysteresis_loss() == pytest.approx(TRAIN.play, rel=1e-9)


def test_backlash_of_a_train_counts_by_the_ratios_behind_it():
    assert TRAIN.play == pytest.approx(0.02 / 5.0 + 0.01)
    assert TRAIN.ratio == 20.0
    assert TRAIN.losses.driving == pytest.approx(1.0 / (0.95 * 0.9) - 1.0)
    assert TRAIN.losses.driven == pytest.approx(1.0 - (2 - 1 / 0.95) * (2 - 1 / 0.9))


@pytest.mark.parametrize("gear", [WAVE, SAID, CYCLOIDAL])
def test_area_of_a_closed_loop_is_what_bristles_lose(gear):
    top = 0.6 * gear.rated_torque
    torques, angles = loop(gear, top, 20000)
    area = np.sum(0.5 * (torques[1:] + torques[:-1]) * np.diff(angles))
    grip, bend = gear.bristles
    half = 0.5 * np.ptp(angles)
    # Around the loop z goes between -+z_1: 4 times grip (half - bend atanh-like) in closed form.
    end = math.tanh(half / bend)
    lost = 4.0 * grip * (half - bend * end)
    assert area == pytest.approx(lost, rel=1e-3)


def test_a_first_load_is_the_derivative_of_its_work():
    for twist in (3e-5, -2e-4, 9e-4, -3e-3):
        work, torque, stiffness = SAID.first_load(twist)
        ahead, behind = SAID.first_load(twist + 1e-8), SAID.first_load(twist - 1e-8)
        assert (ahead[0] - behind[0]) / 2e-8 == pytest.approx(torque, rel=1e-5)
        assert (ahead[1] - behind[1]) / 2e-8 == pytest.approx(stiffness, rel=1e-3)
        assert SAID.first_twist(torque) == pytest.approx(twist, rel=1e-6)
        assert work > 0.0


# Limits


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_with_one_stiffness_and_no_losses_it_is_a_gear_with_backlash(disc, integrator):
    plain = Gear(play=2e-3, rotor_inertia=0.05, stiffness=8e3, damping=2.0)
    same = [
        jp.StrainWaveGear(
            ratio=50.0, play=2e-3, rotor_inertia=0.05, damping=2.0, stiffness_1=8e3,
            stiffness_2=8e3, torque_1=4.0, stiffness_3=8e3, torque_2=12.0,
        ),
        jp.CycloidalGear(play=2e-3, rotor_inertia=0.05, damping=2.0, stiffness=8e3),
        # With friction of no size to speak of, which acts within the play, too.
        jp.CycloidalGear(
            play=2e-3, rotor_inertia=0.05, damping=2.0, stiffness=8e3, viscous=1e-300
        ),
    ]  # fmt: skip
    given = {"a": (0.0, 0.3), "a.motor": (1e-2, 0.0)}

    def run(gear):
        return jp.simulate(
            disc(gear), drive=Free(), state=given, duration=0.05, integrator=integrator,
            start="centred", **QUIET,
        )  # fmt: skip

    expected = run(plain)["q"].values
    for gear in same:
        assert np.abs(run(gear)["q"].values - expected).max() < 1e-13


# Runs


MOTION = jp.Motion(["a"], [0, 0.3, 0.6, 1.0], [[0], [0.5], [-0.3], [0.4]])


@pytest.mark.parametrize(
    "options",
    [*({"integrator": name} for name in INTEGRATORS), {"tolerance": 1e-3}],
    ids=[*INTEGRATORS, "tolerance"],
)
def test_energy_balances_over_a_second_of_motion(pendulum, options):
    gear = replace(
        SAID, error_amplitude=1e-4, efficiency=0.7, no_load_torque=0.5, viscous=0.2, damping=2.0
    )
    result = jp.simulate(
        pendulum(gear), MOTION, drive=ComputedTorque(encoder="motor"), **QUIET, **options
    )
    lost = result["gear_dissipation"].values
    assert lost[-1] > 1.0
    assert (np.diff(lost) >= 0.0).all()
    residual = np.abs(result["energy_residual"].values).max()
    order = 1e-3 if options.get("integrator") == "semi-implicit-euler" else 1e-5
    assert residual < order * lost[-1]
    assert np.abs(result["gear_hysteresis"].values).max() <= gear.bristles[0]
    text = result["gear_torque"].attrs["units"]
    assert text == "N m"


def test_hysteresis_loses_the_area_of_its_loop_in_a_run(disc):
    gear = jp.StrainWaveGear(
        ratio=50.0, stiffness_1=1e4, hysteresis=4e-4, rotor_inertia=0.05, rated_torque=16.0
    )
    swing = 2e-3
    start = {"a": (0.0, 0.0), "a.motor": (swing, 0.0)}
    result = jp.simulate(
        disc(gear),
        drive=Free(),
        state=start,
        duration=0.2,
        start="centred",
        tolerance=1e-4,
        **QUIET,
    )
    q = result["q"].values
    twist = np.abs(q[:, 1] - q[:, 0])
    # What was stored, all but what bristles hold, is lost: the gear comes to rest aside of zero.
    assert twist[-1] < 2.0 * gear.hysteresis
    first = float(gear.stored_energy(np.array([swing]), result["gear_hysteresis"].values[0])[0])
    assert result["gear_dissipation"].values[-1] == pytest.approx(first, rel=0.05)
    assert np.abs(result["energy_residual"].values).max() < 1e-3 * first


@pytest.mark.parametrize(("efficiency", "driven"), [(0.7, None), (0.5, 0.0), (1.0, 0.6)])
def test_motor_torque_is_that_of_the_efficiency(pendulum, efficiency, driven):
    """Lifting takes torque over efficiency; lowering gives back the other part of it."""
    gear = jp.CycloidalGear(
        stiffness=5e4, rotor_inertia=1e-3, damping=20.0, efficiency=efficiency,
        back_driving_efficiency=driven,
    )  # fmt: skip
    driven = 2.0 - 1.0 / efficiency if driven is None else driven
    for way, factor in ((-1.0, 1.0 / efficiency), (1.0, driven)):
        slow = jp.Motion(["a"], [0, 2.0], [[0.0], [0.02 * way]], "constant-speed")
        result = jp.simulate(pendulum(gear), slow, drive=Prescribed(), duration=1.0, **QUIET)
        late = result.time > 0.5
        held = result["gear_torque"].values[late, 0]
        effort = result["drive"].values[late, 1]
        expected = factor * held
        # Friction turns its sign over 1 mrad/s.
        assert effort == pytest.approx(expected, rel=1e-3, abs=1e-3 * np.abs(held).max())


def test_kinematic_error_is_seen_twice_in_a_turn_of_the_wave_generator(disc):
    amplitude, ratio, speed = 1.5e-4, 50.0, 0.2
    gear = jp.StrainWaveGear(
        ratio=ratio, stiffness_1=2e4, rotor_inertia=0.05, damping=20.0, error_amplitude=amplitude
    )
    turn = jp.Motion(["a"], [0, 4.0], [[0.0], [4.0 * speed]], "constant-speed")
    result = jp.simulate(
        disc(gear), turn, drive=Prescribed(), duration=3.0, record_every=100, **QUIET
    )
    late = result.time > 0.5
    time, q = result.time[late], result["q"].values[late]
    off = q[:, 0] - q[:, 1]
    order = 2.0 * ratio * speed
    shape = np.column_stack([np.sin(order * time), np.cos(order * time), np.ones(len(time))])
    found, *_ = np.linalg.lstsq(shape, off, rcond=None)
    # At 20 rad/s, far below the joint's 1000 rad/s, the joint follows the error.
    assert np.hypot(found[0], found[1]) == pytest.approx(amplitude, rel=2e-3)
    assert np.abs(shape @ found - off).max() < 0.01 * amplitude


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("gear", [WAVE, SAID, TRAIN, replace(WAVE, error_amplitude=1e-3)])
def test_a_start_at_rest_stays_at_rest(pendulum, gear, encoder):
    hold = jp.Motion(["a"], [0, 1.0], [[0.2], [0.2]])
    result = jp.simulate(
        pendulum(replace(gear, damping=10.0)), hold, drive=ComputedTorque(encoder=encoder),
        duration=0.1, start="rest", **QUIET,
    )  # fmt: skip
    q = result["q"].values
    assert np.abs(q - q[0]).max() < 1e-7
    torque = 2.0 * 9.81 * 0.3 * math.cos(q[0, 0])
    twist = gear.twist(q[0, 1], q[0, 0])
    assert gear.first_load(twist)[1] == pytest.approx(-torque, rel=1e-5)


def test_a_checkpoint_goes_on_bit_for_bit(pendulum, tmp_path):
    gear = replace(SAID, error_amplitude=1e-4, efficiency=0.8)
    options = {"drive": ComputedTorque(encoder="motor"), "duration": 0.2, "joint_friction": {}}
    simulation = jp.Simulation(pendulum(gear), MOTION, **options)
    whole = jp.Run(simulation)
    whole.advance(5000)
    other = jp.Simulation.resume(whole.checkpoint(tmp_path / "kept"))
    for run in (whole, other):
        run.advance(2000)
    assert np.array_equal(whole.workspace.q, other.workspace.q)
    assert np.array_equal(whole.workspace.gears, other.workspace.gears)


# Statics of play


def test_a_budget_counts_play_and_hysteresis(pendulum):
    for gear in (WAVE, TRAIN, replace(WAVE, error_amplitude=1e-3)):
        found = jp.budget(pendulum(gear), {"a": 0.3})
        arm = np.linalg.norm(found.positions[0]) or 1.0
        assert found.worst_turn[0] == pytest.approx(gear.unloaded_range / 2.0, rel=1e-6)
        rest, interval = found.rest_positions.at(0).error, found.rest_positions.interval(0)
        assert (interval[:3, 0] <= rest[:3] + 1e-12 * arm).all()
        assert (rest[:3] <= interval[:3, 1] + 1e-12 * arm).all()


@pytest.mark.thorough
def test_reduce_takes_every_kind(pendulum):
    damped = replace(WAVE, damping=5.0)
    for gear in (damped, replace(TRAIN, damping=1.0)):
        reduction = jp.reduce(pendulum(gear), "a")
        # The weight never turns its sign, so hysteresis is no dead band here.
        assert reduction.dead_band == pytest.approx(gear.play)
        assert reduction.angle_rms < 5e-5


# Descriptions


@pytest.mark.parametrize("gear", [SAID, CYCLOIDAL, TRAIN, Gear(1e-3, 0.1, 1e4)])
def test_descriptions_give_the_gear_back(gear):
    data = gear.describe()
    assert data["kind"] == gear.kind
    assert Gearing.from_description(data) == gear


def test_numbers_of_a_catalogue_keep_their_origin():
    origins = WAVE.origins()
    assert origins["torque_1"].startswith("memory")
    assert origins["stiffness_1"].startswith("second hand")
    assert "from memory, to be checked: ratio, torque_1, torque_2" in WAVE.notes
    assert "torque_1" not in replace(WAVE, torque_1=4.0).origins()
    assert TRAIN.notes == ""


BAD = [
    (lambda: jp.StrainWaveGear.of("CSF-17-5", **CATALOGUE), 'did you mean "CSF-17-50"'),
    (lambda: jp.StrainWaveGear.of("CSF-17-100", **CATALOGUE), "needs stiffness_1; .* stiffness_3"),
    (lambda: jp.CycloidalGear(rotor_inertia=1.0), "a cycloidal gear needs stiffness"),
    (lambda: replace(WAVE, torque_2=3.0), "T2 must be above T1 = 3.9 N m, got 3"),
    (lambda: replace(WAVE, hysteresis=-1e-4), "hysteresis must not be negative"),
    (lambda: replace(WAVE, hysteresis=1e-2), "not below the rated torque"),
    (lambda: replace(WAVE, stated_lost_motion=1e-5), "lost motion at 4 % .* got 1e-05"),
    (lambda: replace(WAVE, efficiency=1.2), "efficiency must be above 0 and at most 1, got 1.2"),
    (lambda: replace(WAVE, back_driving_efficiency=-0.1), "from 0 to 1"),
    (lambda: replace(WAVE, rotor_inertia=0.0), "rotor inertia must be greater than zero"),
    (lambda: replace(WAVE, torque_1=None, catalogue=None), "begins at torque_1"),
    (lambda: replace(CYCLOIDAL, error_orders=(1.0,)), "1 orders, 0 amplitudes"),
    (
        lambda: replace(CYCLOIDAL, error_orders=(1.0,) * 5, error_amplitudes=(1e-5,) * 5),
        "at most 4 orders",
    ),
    (lambda: replace(TRAIN, stages=()), "at least one stage"),
    (lambda: jp.GearStage(ratio=0.0), "ratio of a stage must be greater than zero"),
    (lambda: jp.CycloidalGear.of("RV-42N", rotor_inertia=1.0), "give rated_torque"),
    (lambda: Gear(1e-3, 0.1, 1e4).lost_motion(), "this backlash gear has none"),
    (lambda: WAVE.lost_motion(1.5), "above 0 and at most 1, got 1.5"),
    (lambda: WAVE.torsion([float("nan")]), "finite"),
]


@pytest.mark.parametrize(("make", "message"), BAD)
def test_impossible_gears_are_refused(make, message):
    with pytest.raises(jp.JointplayError, match=message):
        make()


def test_no_other_kind_stands_in_a_file():
    with pytest.raises(jp.JointplayError, match='did you mean "strain-wave"'):
        Gearing.from_description({"kind": "strain-wav", "rotor_inertia": 0.1})
    assert list(GEARS) == ["backlash", "strain-wave", "cycloidal", "train"]


# Properties


gears = st.builds(
    jp.StrainWaveGear,
    ratio=st.floats(10, 200),
    rotor_inertia=st.just(0.05),
    play=st.floats(0, 1e-3),
    stiffness_1=st.floats(1e3, 1e5),
    stiffness_2=st.floats(1e3, 1e5),
    stiffness_3=st.floats(1e3, 1e5),
    torque_1=st.floats(0.1, 5.0),
    torque_2=st.floats(5.5, 20.0),
    hysteresis=st.floats(0, 1e-3),
    presliding=st.floats(1e-5, 1e-3),
)


@settings(max_examples=60, deadline=None)
@given(gears, st.lists(st.floats(-30, 30), min_size=1, max_size=8))
def test_a_gear_never_gives_more_than_it_took(gear, torques):
    """Along any path work is what is stored and what bristles lose, which is never negative."""
    fine = np.concatenate([[0.0], *(np.linspace(a, b, 1000) for a, b in pairwise([0.0, *torques]))])
    angles = gear.torsion(fine)
    work = np.cumsum(0.5 * (fine[1:] + fine[:-1]) * np.diff(angles))
    scale = np.abs(fine).max() * np.abs(angles).max() + 1e-12
    stored = gear.curve().energy(np.maximum(np.abs(angles[1:]) - gear.play / 2, 0.0))
    assert (work - stored >= -2e-3 * scale).all()


@settings(max_examples=60, deadline=None)
@given(gears, st.floats(0.1, 30.0))
def test_torsion_is_odd_and_the_unloaded_joint_stays_in_its_range(gear, top):
    torques = [top, 0.0, -0.5 * top, 0.0, top]
    angles = gear.torsion(torques)
    assert gear.torsion([-one for one in torques]) == pytest.approx(-angles, abs=1e-15)
    assert abs(angles[1]) <= gear.unloaded_range / 2 * (1 + 1e-9) + 1e-12
    assert angles[0] == pytest.approx(gear.first_twist(top))
