"""Servos: voltage, back-EMF, dead band, counts and samples, with known answers."""

import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import Servo

QUIET = {"joint_friction": {}, "estimate": False}
SERVO = Servo.of("STS3215", voltage=7.4, p_gain=30.0, d_gain=0.5)
INERTIA = Servo.armature_of("STS3215")
GEAR = jp.Gear(play=math.radians(0.62), rotor_inertia=INERTIA, stiffness=300.0, damping=0.05)
ENGINES = [*({"integrator": name} for name in INTEGRATORS), {"tolerance": 1e-3}]
NAMES = [*INTEGRATORS, "tolerance"]


@pytest.fixture
def disc(urdf):
    path = urdf(body("disc", 1.0, "0 0 0", INERTIA), joint("a", "base", "disc", "continuous"))
    return lambda gear=None: jp.Mechanism(path, gears={"a": gear} if gear else {})


@pytest.fixture
def pendulum(urdf):
    path = urdf(body("bar", 0.3, "0.1 0 0"), joint("a", "base", "bar", axis="0 1 0"))
    return lambda gear=None: jp.Mechanism(path, gears={"a": gear} if gear else {})


def hold(angle, until=1.0):
    return jp.Motion(["a"], [0, until], [[angle], [angle]])


def test_numbers_of_the_catalogue_are_those_of_its_source():
    assert (SERVO.torque_constant, SERVO.resistance) == (1.21, 2.68)
    assert (SERVO.friction, SERVO.viscous, INERTIA) == (0.0524, 0.0591, 0.0284)
    assert SERVO.stall == pytest.approx(1.21 / 2.68)
    assert SERVO.braking == pytest.approx(1.21**2 / 2.68)


@pytest.mark.parametrize("options", ENGINES, ids=NAMES)
def test_a_motor_at_full_voltage_runs_up_to_the_speed_of_its_back_emf(disc, options):
    servo = replace(SERVO, p_gain=1e3, d_gain=0.0)
    far = jp.Motion(["a"], [0, 1e-4, 1.0], [[0.0], [50.0], [50.0]])  # ahead nearly at once
    result = jp.simulate(disc(), far, drive=servo, duration=0.3, **QUIET, **options)
    time, speed = result.time, result["v"].values[:, 0]
    fall = (servo.braking + servo.viscous) / INERTIA
    top = (servo.stall * 7.4 - servo.friction) / (servo.braking + servo.viscous)
    late = time > 0.01
    lag = 2e-4 * top * fall
    assert np.abs(speed - top * (1.0 - np.exp(-fall * time)))[late].max() < 2.0 * lag
    stalled = result["drive"].values[1:20, 0].max()
    assert stalled == pytest.approx(servo.stall * 7.4, rel=0.02)


@pytest.mark.parametrize("encoder", ["motor", "link"])
@pytest.mark.parametrize("options", ENGINES, ids=NAMES)
def test_a_start_at_rest_hangs_by_the_dead_band_and_the_gain(pendulum, options, encoder):
    servo = replace(SERVO, dead_band=0.01, encoder=encoder, d_gain=0.0)
    gear = replace(GEAR, damping=2.0)
    result = jp.simulate(
        pendulum(gear), hold(0.2), drive=servo, duration=0.05, start="rest", **QUIET, **options
    )
    q = result["q"].values
    assert np.abs(q - q[0]).max() < 1e-6
    seen = q[0, 0 if encoder == "link" else 1]
    weight = 0.3 * 9.81 * 0.1 * math.cos(q[0, 0])  # turns the bar down: angles grow
    assert seen - 0.2 == pytest.approx(0.01 + weight / (servo.stall * servo.p_gain), rel=1e-5)
    assert q[0, 0] - q[0, 1] == pytest.approx(GEAR.play / 2 + weight / 300.0, rel=1e-5)


def test_a_load_beyond_the_voltage_sinks_to_where_it_weighs_less(pendulum):
    weak = replace(SERVO, voltage=0.5)
    stall, weight = weak.stall * weak.voltage, 0.3 * 9.81 * 0.1
    assert stall < weight
    gear = replace(GEAR, damping=2.0)
    result = jp.simulate(
        pendulum(gear), hold(0.0), drive=weak, duration=0.02, start="rest", **QUIET
    )
    q = result["q"].values
    assert math.cos(q[0, 0]) == pytest.approx(stall / weight, rel=1e-6)
    assert np.abs(q - q[0]).max() < 1e-6


def test_without_load_the_dead_band_is_where_it_rests(disc):
    servo = replace(SERVO, dead_band=0.02)
    for begin in (-0.015, 0.0, 0.015):
        motion = hold(0.0)
        run = jp.Run(
            jp.Simulation(
                disc(GEAR), motion, drive=servo, duration=0.05, joint_friction={}, start="centred"
            )
        )
        run.workspace.q[:] = begin
        result = run.finish()
        assert np.abs(result["q"].values - begin).max() == 0.0
        assert (result["drive"].values == 0.0).all()


@pytest.mark.parametrize("options", ENGINES, ids=NAMES)
def test_samples_hold_the_voltage_as_a_discrete_controller_does(disc, options):
    period = 5e-3
    servo = replace(SERVO, friction=0.0, viscous=0.0, period=period)
    motion = jp.Motion(["a"], [0, 0.1, 1.0], [[0.0], [0.1], [0.1]])
    result = jp.simulate(disc(), motion, drive=servo, duration=0.3, **QUIET, **options)
    damping, push = servo.braking / INERTIA, servo.stall / INERTIA
    system = np.array([[0.0, 1.0, 0.0], [0.0, -damping, push], [0.0, 0.0, 0.0]])
    step = expm(system * period)
    state, states = np.zeros(2), []
    for k in range(60):
        states.append(state)
        q, v, _ = (values[0, 0] for values in motion(np.array([k * period])))
        voltage = servo.p_gain * (q - state[0]) + servo.d_gain * (v - state[1])
        state = (step @ [*state, np.clip(voltage, -7.4, 7.4)])[:2]
    at = np.arange(60) * round(period / result.time[1])
    found = result["q"].values[at, 0]
    assert np.abs(found - np.array(states)[:, 0]).max() < 2e-3 * np.ptp(found)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_step_is_answered_as_the_law_with_an_integral_says(disc, integrator):
    """Against Radau: the supply's limit, the integral's, and the approach to the goal."""
    servo = replace(SERVO, friction=0.0, i_gain=400.0, d_gain=0.2, voltage=4.0)
    simulation = jp.Simulation(
        disc(), hold(0.0), drive=servo, duration=0.4, step=1e-5, integrator=integrator,
        record_every=1000, joint_friction={},
    )  # fmt: skip
    run = jp.Run(simulation)
    run.workspace.q[:] = -0.5
    result = run.finish()
    damping = servo.braking + servo.viscous

    def law(time, state):
        q, v, w = state
        w = np.clip(w, -4.0, 4.0)
        asked = servo.p_gain * -q + w - servo.d_gain * v
        push = servo.stall * np.clip(asked, -4.0, 4.0) - damping * v
        gain = servo.i_gain * -q
        return [v, push / INERTIA, 0.0 if abs(w) >= 4.0 and gain * w > 0.0 else gain]

    options = {"method": "Radau", "rtol": 1e-10, "atol": 1e-12, "max_step": 1e-3}
    exact = solve_ivp(law, (0, 0.4), [-0.5, 0.0, 0.0], t_eval=result.time, **options).y
    assert exact[2].max() >= 4.0
    assert exact[0].max() > 0.05  # it overshoots, for the integral must unwind
    limit = 1e-6 if integrator != "semi-implicit-euler" else 2e-4
    assert np.abs(result["q"].values[:, 0] - exact[0]).max() < limit


@pytest.mark.parametrize("options", ENGINES, ids=NAMES)
@pytest.mark.parametrize("speed", ["exact", "difference"])
def test_a_sampled_pid_is_that_of_firmware(disc, options, speed):
    """Against exact steps of motor and inertia under readings in whole counts."""
    period, count = 5e-3, 2 * math.pi / 4096
    servo = replace(
        SERVO, friction=0.0, viscous=0.0, period=period, resolution=count, i_gain=100.0,
        speed=speed, p_gain=20.0,
    )  # fmt: skip
    goal = 0.1003
    simulation = jp.Simulation(
        disc(), hold(goal), drive=servo, duration=0.3, joint_friction={}, **options
    )
    run = jp.Run(simulation)
    run.workspace.q[:] = 0.0
    result = run.finish()
    damping, push = servo.braking / INERTIA, servo.stall / INERTIA
    system = np.array([[0.0, 1.0, 0.0], [0.0, -damping, push], [0.0, 0.0, 0.0]])
    step = expm(system * period)
    state, states, integral, before = np.zeros(2), [], 0.0, 0.0
    for _ in range(60):
        states.append(state)
        reading = count * math.floor(state[0] / count + 0.5)
        integral = np.clip(integral + 100.0 * period * (goal - reading), -7.4, 7.4)
        seen = (reading - before) / period if speed == "difference" else state[1]
        before = reading
        voltage = np.clip(20.0 * (goal - reading) + integral - servo.d_gain * seen, -7.4, 7.4)
        state = (step @ [*state, voltage])[:2]
    at = np.arange(60) * round(period / result.time[1])
    found, exact = result["q"].values[at, 0], np.array(states)[:, 0]
    assert np.abs(found - exact)[:8].max() < 2e-3 * np.ptp(exact)
    assert np.abs(found - exact).max() < 6 * count  # a count may fall otherwise


def test_counts_of_the_encoder_limit_where_it_stops(disc):
    count = 2 * math.pi / 4096
    servo = replace(SERVO, resolution=count, p_gain=200.0, friction=0.0)
    motion = jp.Motion(["a"], [0, 0.2, 1.0], [[0.0], [0.1 * 7 / 3], [0.1 * 7 / 3]])
    result = jp.simulate(disc(), motion, drive=servo, duration=0.6, **QUIET)
    off = result["q"].values[result.time > 0.5, 0] - 0.1 * 7 / 3
    assert np.abs(off).max() < count
    assert np.abs(result["energy_residual"].values).max() < 1e-3 * result.audit.energy_exchanged


@pytest.mark.parametrize("options", ENGINES, ids=NAMES)
def test_energy_balances_with_gear_and_servo(pendulum, options):
    train = jp.GearTrain(
        stages=(jp.GearStage(ratio=5, backlash=0.02, efficiency=0.9), jp.GearStage(ratio=4)),
        stiffness=300.0, damping=0.1, rotor_inertia=INERTIA, no_load_torque=0.02
    )  # fmt: skip
    servo = replace(SERVO, dead_band=0.002, period=1e-3)
    motion = jp.Motion(["a"], [0, 0.25, 0.5], [[0.0], [0.6], [-0.2]])
    result = jp.simulate(pendulum(train), motion, drive=servo, duration=0.6, **QUIET, **options)
    assert result.completed("the run") is result
    order = 2e-2 if options.get("integrator") == "semi-implicit-euler" else 1e-3
    assert result.audit.energy_residual < order * result.audit.energy_exchanged
    assert np.ptp(result["q"].values[:, 0]) > 0.3


def test_a_budget_with_servos_rests_where_a_run_begins(pendulum):
    """By its sag, its dead band, the play and the wind-up of the gear."""
    servo = replace(SERVO, dead_band=0.01)
    found = jp.budget(pendulum(GEAR), {"a": 0.0}, drive=servo)
    rest = found.rest_positions.at(0).error
    weight = 0.3 * 9.81 * 0.1
    sag = weight / (servo.p_gain * servo.stall) + servo.dead_band
    expected = sag + GEAR.play / 2 + weight / 300.0
    assert np.linalg.norm(rest[3:]) == pytest.approx(expected, rel=1e-2)
    assert np.linalg.norm(found.rest_positions.at(0).sag[3:]) == pytest.approx(sag, rel=1e-2)
    assert "servos' sag" in found.sentence
    patient = jp.budget(pendulum(GEAR), {"a": 0.0}, drive=replace(servo, i_gain=1.0))
    left = np.linalg.norm(patient.rest_positions.at(0).sag[3:])
    assert left == pytest.approx(servo.dead_band, rel=1e-2)  # the I term takes back the rest
    whole = jp.budget(pendulum(GEAR), {"a": 0.0}, drive=servo, causes=["sag"])
    assert whole.model.farthest(turn=True).size[0] == pytest.approx(sag, rel=1e-2)
    motion = jp.Motion(["a"], [0, 0.1], [[0.0], [0.0]])
    run = jp.simulate(pendulum(GEAR), motion, drive=servo, duration=1e-3, **QUIET)
    turned = 2.0 * np.arcsin(np.linalg.norm(run["tool_orientation"].values[0, 1:]))
    assert turned == pytest.approx(expected, rel=3e-2)


def test_reactions_of_a_geared_arm_are_those_of_its_motion(pendulum):
    motion = jp.Motion(["a"], [0, 0.25], [[0.0], [0.6]])
    drive = jp.loads.ComputedTorque(encoder="motor")
    for gear in (
        replace(GEAR, damping=3.0),
        jp.StrainWaveGear(
            ratio=50.0, stiffness_1=300.0, hysteresis=1e-3, rotor_inertia=INERTIA, damping=3.0
        ),
    ):
        result = jp.simulate(pendulum(gear), motion, drive=drive, **QUIET)
        q, v = result["q"].values[:, 0], result["v"].values[:, 0]
        a = np.gradient(v, result.time)
        # The bar's centre: 0.1 (cos q, 0, -sin q); force = m (acceleration - gravity).
        x = -0.1 * (np.sin(q) * a + np.cos(q) * v**2)
        z = -0.1 * (np.cos(q) * a - np.sin(q) * v**2)
        expected = 0.3 * np.stack([x, z + 9.81], axis=1)
        found = result["reaction_force"].values[:, 0][:, [0, 2]]
        inner = slice(5, -5)
        # Where teeth part the acceleration jumps, and differences of records do not follow.
        off = np.abs(found - expected)[inner].max(axis=1)
        assert np.quantile(off, 0.95) < 1e-3 * np.abs(expected).max()


BAD = [
    (lambda: Servo.of("STS3125", voltage=7.4, p_gain=10.0), 'did you mean "STS3215"'),
    (lambda: Servo(voltage=7.4, p_gain=10.0), "needs torque_constant, resistance"),
    (lambda: replace(SERVO, dead_band=-1e-3), "dead band must not be negative"),
    (lambda: replace(SERVO, dead_band_counts=2.0), "in counts needs the encoder's resolution"),
    (lambda: replace(SERVO, speed="difference"), "a speed by differences needs a period"),
    (lambda: replace(SERVO, i_gain=-1.0), "I gain must not be negative"),
]


@pytest.mark.parametrize(("make", "message"), BAD)
def test_impossible_servos_are_refused(make, message):
    with pytest.raises(jp.JointplayError, match=message):
        make()


def test_a_period_is_a_multiple_of_the_step(disc):
    servo = replace(SERVO, period=1.234e-5)
    with pytest.raises(jp.JointplayError, match="of a servo must be a multiple of the step"):
        jp.simulate(disc(GEAR), hold(0.0), drive=servo, duration=0.01, **QUIET)


def test_a_dead_band_can_be_given_in_counts():
    servo = replace(SERVO, dead_band_counts=3.0, resolution=2e-3)
    assert servo.band == pytest.approx(6e-3)
    assert replace(SERVO, dead_band=0.01).band == 0.01
