"""Drives with known answers: prescribed motion, given torques, gears with play, friction."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint
from scipy.integrate import solve_ivp

import jointplay as jp
from jointplay.model.gear import Gear
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads.drive import (
    ComputedTorque,
    JointFriction,
    Prescribed,
    Servo,
    Torque,
)
from jointplay.simulation.time_loop import LONGEST_MACRO_STEP_S

FLAT = {"gravity": (0.0, 0.0, 0.0)}
QUIET = {"joint_friction": {}}


def rotor(urdf, inertia=0.02, **options):
    """One body, on its axis z."""
    path = urdf(body("disc", 1.0, "0 0 0", inertia), joint("a", "base", "disc", "continuous"))
    return jp.Mechanism(path, **(FLAT | options))


def arm(urdf, clearance=None, **options):
    path = urdf(
        body("one", 3.0, "0.15 0.02 0"),
        body("two", 2.0, "0.1 0 0.03"),
        joint("a", "base", "one", axis="0 1 0"),
        joint("b", "one", "two", axis="0 1 0", at="0.3 0 0"),
    )
    return jp.Mechanism(path, clearance, **options)


# Prescribed motion

MOVE = jp.Motion(["a", "b"], [0, 0.1, 0.2], [[0, 0], [0.5, -0.8], [0.2, 0.3]])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_prescribed_joints_move_exactly_and_need_the_inverse_dynamics(urdf, integrator):
    robot = arm(urdf)
    result = jp.simulate(robot, MOVE, drive=Prescribed(), integrator=integrator, **QUIET)
    q, v, a = MOVE(result.time)
    assert np.abs(result["q"].values - q).max() < 1e-9
    assert np.abs(result["v"].values - v).max() < 1e-9 * np.abs(v).max()
    torque = np.array([pin.rnea(robot.model, robot.data, *s) for s in zip(q, v, a, strict=True)])
    size = np.abs(torque).max()
    limit, line = 1e-5 * size, 0.0
    if integrator == "multi-rate":
        # Inertia and bias lie on a line through two middles of macro steps, half a step beyond.
        bend = [
            sum(
                weight * pin.rnea(robot.model, robot.data, q[i + k], v[i + k], a[i])
                for k, weight in ((-1, 1.0), (0, -2.0), (1, 1.0))
            )
            for i in range(1, len(q) - 1)
        ]
        curvature = np.abs(bend).max() / result.time[1] ** 2
        line = 3.0 / 8.0 * LONGEST_MACRO_STEP_S**2 * curvature
        assert line < 1e-3 * size
    assert np.abs(result["drive"].values - torque).max() < limit + line
    work = result["drive_work"].values
    energy = result["kinetic_energy"].values + result["potential_energy"].values
    travelled = np.abs(np.diff(q, axis=0)).sum()
    assert np.abs(energy - energy[0] - work).max() < 1e-6 * np.ptp(work) + line * travelled
    assert np.ptp(result["kinetic_energy"].values) > 1.0  # and no armature in it
    kinetic = [
        pin.computeKineticEnergy(robot.model, robot.data, *s) for s in zip(q, v, strict=True)
    ]
    assert result["kinetic_energy"].values == pytest.approx(kinetic, rel=1e-6, abs=1e-9)


def test_torque_of_prescribed_motion_converges_with_the_macro_step_cubed(urdf):
    robot, errors = arm(urdf), []
    macro_steps = np.array([6.4e-3, 3.2e-3, 1.6e-3])
    for macro_step in macro_steps:
        result = jp.simulate(robot, MOVE, drive=Prescribed(), macro_step=macro_step, **QUIET)
        torque = [
            pin.rnea(robot.model, robot.data, *state)
            for state in zip(*MOVE(result.time), strict=True)
        ]
        errors.append(np.abs(result["drive"].values - torque).max())
    assert np.polyfit(np.log(macro_steps), np.log(errors), 1)[0] == pytest.approx(3.0, abs=0.25)


def test_prescribed_joint_beside_a_worn_one_is_exact_and_balances_the_energy(urdf):
    worn = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
    robot = arm(urdf, {"b": worn})
    drives = {"a": Prescribed(), "b": ComputedTorque()}
    result = jp.simulate(robot, MOVE, drive=drives, step=5e-6, **QUIET)
    q, v, _ = MOVE(result.time)
    assert np.abs(result["q"].values[:, 0] - q[:, 0]).max() < 1e-9
    assert np.abs(result["v"].values[:, 0] - v[:, 0]).max() < 1e-9 * np.abs(v).max()
    assert result.audit.impacts > 0
    assert result.audit.relative_energy_residual < 5e-3
    ideal = jp.simulate(robot.ideal(), MOVE, drive=Prescribed(), **QUIET)
    driven = result["drive_work"].values[-1]
    lost = result["normal_dissipation"].values[-1] + result["friction_dissipation"].values[-1]
    assert driven - lost == pytest.approx(ideal["drive_work"].values[-1], abs=0.02)


@pytest.mark.parametrize("yaw", ["worn", "ideal"])
def test_prescribed_crank_at_constant_speed_never_lags(urdf, yaw):
    worn = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
    robot = rotor(urdf, clearance={"a": worn} if yaw == "worn" else None)
    motion = jp.Motion(["a"], [0, 1], [[0], [300.0]], "constant-speed")
    result = jp.simulate(robot, motion, drive=Prescribed(), duration=0.05)
    at = robot.coordinate("a")
    assert np.abs(result["q"].values[:, at] - 300.0 * result.time).max() < 1e-9
    assert np.abs(result["v"].values[:, at] / 300.0 - 1.0).max() < 1e-9


@pytest.mark.parametrize("options", [{}, {"tolerance": 0.01}, {"integrator": "rk4"}], ids=str)
def test_prescribed_crank_turns_on_where_the_last_step_ends_after_the_duration(urdf, options):
    motion = jp.Motion(["a"], [0, 1], [[0], [300.0]], "constant-speed")
    result = jp.simulate(
        rotor(urdf), motion, drive=Prescribed(), duration=6e-4, step=1.6e-5, **options
    )
    assert result.time[-1] == pytest.approx(6.08e-4)
    assert np.abs(result["q"].values[:, 0] - 300.0 * result.time).max() < 1e-9
    assert np.abs(result["v"].values[:, 0] - 300.0).max() < 1e-6


# Given torques, and none


def test_torque_is_linear_between_its_points_and_constant_outside(urdf):
    times, values = (0.05, 0.1, 0.15), (0.2, -0.4, 0.1)
    result = jp.simulate(
        rotor(urdf), drive=Torque(times, values), duration=0.2, integrator="rk4", **QUIET
    )
    exact = np.interp(result.time, times, values)
    assert result["drive"].values[:, 0] == pytest.approx(exact, abs=1e-9)
    speed = [np.trapezoid(np.interp(t, times, values), t) / 0.02 for t in
             (np.unique([*np.linspace(0, end, 2001), *[x for x in times if x < end]])
              for end in result.time[::200])]  # fmt: skip
    assert result["v"].values[::200, 0] == pytest.approx(speed, abs=1e-6)


# Gears

GEAR = Gear(play=0.02, rotor_inertia=0.01, stiffness=2000.0, damping=0.5)


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_gear_passes_no_torque_before_its_play_is_taken_up(urdf, integrator):
    """The motor turns alone by half the play, and exactly so far."""
    torque = 0.5
    robot = rotor(urdf, gears={"a": GEAR})
    result = jp.simulate(
        robot, drive={"a": Torque((0.0,), (torque,))}, duration=0.05, integrator=integrator,
        record_every=1, **QUIET,
    )  # fmt: skip
    motor, link = result["q"].values[:, robot.motor("a")], result["q"].values[:, 0]
    crossed = np.sqrt(2.0 * 0.01 * GEAR.rotor_inertia / torque)  # half the play is 0.01 rad
    before = result.time < crossed
    assert before.sum() > 100
    assert not link[before].any()
    assert motor[before] == pytest.approx(0.5 * torque / 0.01 * result.time[before] ** 2, abs=1e-12)
    moving = result.time[np.flatnonzero(link)[0]]
    assert moving == pytest.approx(crossed, abs=3e-5)


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_gear_balances_energy_and_momentum(urdf, integrator):
    robot = rotor(urdf, gears={"a": GEAR})
    run = jp.Run(jp.Simulation(robot, drive={}, duration=0.2, integrator=integrator, record_every=1,
                        **QUIET))  # fmt: skip
    run.workspace.v[robot.motor("a")] = 3.0
    result = run.finish()
    v = result["v"].values
    spin = 0.02 * v[:, 0] + 0.01 * v[:, 1]
    assert spin == pytest.approx(0.03, rel=1e-9)  # nothing turns the pair as a whole
    kinetic = 0.5 * (0.02 * v[:, 0] ** 2 + 0.01 * v[:, 1] ** 2)
    assert result["kinetic_energy"].values == pytest.approx(kinetic)
    twist = np.abs(result["q"].values[:, 1] - result["q"].values[:, 0])
    stored = 0.5 * GEAR.stiffness * np.maximum(twist - GEAR.play / 2, 0.0) ** 2
    assert result["gear_elastic_energy"].values == pytest.approx(stored, abs=1e-12)
    lost = result["gear_dissipation"].values
    assert np.diff(lost).min() >= -1e-15
    assert lost[-1] > 0.1 * kinetic[0]
    assert kinetic + stored + lost == pytest.approx(kinetic[0], rel=1e-5)
    assert stored.max() > 0.1 * kinetic[0]
    # In the end both turn together: what is left is the spin's share.
    assert kinetic[-1] > 0.5 * 0.03**2 / 0.03 * 0.999


def test_undamped_gear_without_play_is_a_torsional_oscillator(urdf):
    """Frequency sqrt(c (1/J1 + 1/J2))."""
    gear = Gear(play=0.0, rotor_inertia=0.01, stiffness=500.0)
    robot = rotor(urdf, gears={"a": gear})
    run = jp.Run(jp.Simulation(robot, drive={}, duration=0.1, integrator="rk4", **QUIET))
    run.workspace.v[robot.motor("a")] = 1.0
    result = run.finish()
    omega = np.sqrt(500.0 * (1 / 0.01 + 1 / 0.02))
    twist = result["q"].values[:, 1] - result["q"].values[:, 0]
    assert twist == pytest.approx(np.sin(omega * result.time) / omega, abs=1e-6 / omega)


def led_through_play(urdf, play, encoder):
    """Errors of link and motor at the target, from 0.7 s after it should have been reached."""
    gear = Gear(play=play, rotor_inertia=0.01, stiffness=5000.0, damping=2.0)
    robot = rotor(urdf, gears={"a": gear})
    motion = jp.Motion(["a"], [0.0, 0.3], [[0.0], [1.0]])
    drive = ComputedTorque(bandwidth=40.0, encoder=encoder)
    result = jp.simulate(robot, motion, drive=drive, duration=1.3, **QUIET)
    return result["q"].values[result.time > 1.0].T - 1.0


def test_encoder_on_the_motor_lets_the_link_float(urdf):
    link, motor = led_through_play(urdf, 0.02, "motor")
    assert np.abs(motor).max() < 0.02 * 0.01
    assert np.abs(link).max() < 1.02 * 0.01
    # Braked, the link ran ahead, and nothing has brought it back.
    assert np.abs(link).max() > 0.5 * 0.01


def test_encoder_on_the_link_hunts_in_proportion_to_the_play(urdf):
    """All is linear but the play, so the limit cycle scales with it."""
    sizes = []
    for play in (0.02, 0.005):
        link, motor = led_through_play(urdf, play, "link")
        sizes.append([np.ptp(link) / play, np.ptp(motor - link) / play])
        assert abs(link.mean()) < 0.01 * play
        assert 0.1 < sizes[-1][0] < 1.0
        assert sizes[-1][1] > 1.0  # the motor strikes either flank
    assert sizes[0] == pytest.approx(sizes[1], rel=0.01)


def test_feed_forward_of_a_geared_joint_turns_its_rotor_too(urdf):
    """A stiff gear without play tracks as the joint with the rotor's inertia on it would."""
    gear = Gear(play=0.0, rotor_inertia=0.05, stiffness=2e5, damping=20.0)
    robot = rotor(urdf, gears={"a": gear})
    motion = jp.Motion(["a"], [0.0, 0.3], [[0.0], [1.0]])
    result = jp.simulate(robot, motion, **QUIET)
    q, _, a = motion(result.time)
    assert np.abs(result["q"].values - q).max() < 1e-4
    inner = slice(50, -50)
    torque = result["drive"].values[inner, robot.motor("a")]
    assert torque == pytest.approx(0.07 * a[inner, 0], abs=0.02 * np.abs(0.07 * a).max())


# Friction


def test_stribeck_curve_is_that_of_the_formula():
    losses = JointFriction(coulomb=2.0, viscous=0.5, static=3.0, stribeck_speed=0.05)
    speed = np.array([-1.0, -0.05, 0.0, 0.05, 0.1, 1.0])
    by_hand = [-2.5, -(2 + np.exp(-1) + 0.025), 0, 2 + np.exp(-1) + 0.025,
               2 + np.exp(-4) + 0.05, 2.5]  # fmt: skip
    assert losses.torque(speed) == pytest.approx(by_hand, abs=1e-12)


@pytest.mark.parametrize("torque", [2.9, 3.1])
def test_breakaway_needs_the_static_friction(urdf, torque):
    losses = {"a": JointFriction(coulomb=2.0, static=3.0, stribeck_speed=0.05)}
    result = jp.simulate(
        rotor(urdf), drive=Torque((0.0,), (torque,)), duration=0.3, joint_friction=losses
    )
    speed = result["v"].values[-1, 0]
    if torque < 3.0:
        # It creeps on the ramp of the dry friction: some mrad/s.
        assert 0.0 < speed < 5e-3
    else:
        assert speed > (torque - 3.0) / 0.02 * 0.3
    taken = result["joint_friction_loss"].values
    assert np.diff(taken).min() >= 0.0
    assert result.audit.relative_energy_residual < 1e-3


def test_sliding_rotor_slows_by_the_stribeck_torque(urdf):
    """Speed against a quadrature of J dw/dt = -Q(w) by small steps."""
    losses = JointFriction(coulomb=0.2, viscous=0.01, static=0.3, stribeck_speed=1.0)
    result = jp.simulate(
        rotor(urdf), drive={}, duration=0.1, state={"a": (None, 3.0)}, integrator="rk4",
        joint_friction={"a": losses},
    )  # fmt: skip

    def slope(_, w):
        return -(0.2 + 0.1 * np.exp(-(w**2)) + 0.01 * w) / 0.02

    exact = solve_ivp(slope, (0, 0.1), [3.0], rtol=1e-10, atol=1e-12, t_eval=result.time).y[0]
    assert exact[-1] > 0.5
    assert result["v"].values[:, 0] == pytest.approx(exact, abs=1e-7)
    lost = 0.5 * 0.02 * (9.0 - exact**2)
    assert result["joint_friction_loss"].values == pytest.approx(lost, abs=1e-7)


STICKS = JointFriction(0.2, static=0.3, stribeck_speed=0.05, presliding=1e-3)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_bristles_hold_a_load_below_breakaway(urdf, integrator):
    """They give way as far as Dahl's curve says, and then by nothing; without them it creeps."""
    held = {}
    for presliding in (0.0, 1e-3):
        losses = replace(STICKS, presliding=presliding, presliding_damping=0.5, viscous=0.3)
        method = integrator if presliding else "multi-rate"
        held[presliding] = jp.simulate(
            rotor(urdf), drive={"a": Torque((0.0, 0.5), (0.0, 0.25))}, duration=10.0,
            integrator=method, step=1e-3 if method == "multi-rate" else 2e-4, record_every=100,
            joint_friction={"a": losses}, estimate=False,
        )["q"].values[:, 0]  # fmt: skip
    assert held[0.0][-1] > 5e-3
    slowly = -1e-3 * np.log(1.0 - 0.25 / 0.3)
    assert slowly < held[1e-3][-1] < 1.2 * slowly  # it has swung a little
    assert np.ptp(held[1e-3][len(held[1e-3]) // 4 :]) < 1e-6


@pytest.mark.parametrize(
    "integrator",
    [pytest.param(name, marks=() if name == "multi-rate" else pytest.mark.thorough)
     for name in INTEGRATORS],
)  # fmt: skip
def test_what_is_pulled_slowly_by_a_spring_sticks_and_slips(urdf, integrator):
    """Times of the slips against Radau of the same law (LuGre)."""
    pull = Servo(voltage=1e3, p_gain=8.0, torque_constant=1e-2, resistance=1e-2)
    motion = jp.Motion(["a"], [0, 3.0], [[0.0], [0.1]], interpolation="constant-speed")
    losses = replace(STICKS, presliding_damping=0.05, viscous=0.05)
    result = jp.simulate(
        rotor(urdf), motion, drive=pull, joint_friction={"a": losses}, step=1e-4,
        integrator=integrator, estimate=False,
    )  # fmt: skip
    stiffness = 0.3 / 1e-3

    def law(time, state):
        q, v, z = state
        most = (0.2 + 0.1 * np.exp(-((v / 0.05) ** 2))) / stiffness
        rate = v - abs(v) * z / most
        friction = stiffness * z + 0.05 * rate + 0.05 * v
        push = 8.0 * (motion(np.array([time]))[0][0, 0] - q) - 1e-2 * v
        return [v, (push - friction) / 0.02, rate]

    options = {"method": "Radau", "rtol": 1e-8, "atol": 1e-10, "max_step": 2e-3}
    start = [*result["q"].values[0], *result["v"].values[0], 0.0]
    exact = solve_ivp(law, (0, 3.0), start, t_eval=result.time, **options).y

    def slips(speed):
        return result.time[1:][(speed[1:] > 0.1) & (speed[:-1] <= 0.1)]

    expected, found = slips(exact[1]), slips(result["v"].values[:, 0])
    assert len(expected) >= 2
    assert len(found) == len(expected)
    assert np.abs(found - expected).max() < 2e-3 * np.diff(expected).min()
    assert result.audit.relative_energy_residual < 1e-3


def test_a_drive_that_carries_far_more_than_its_journal_stays_stable():
    """Z1, play in joint 1: joint 2 drives a link of 0.7 kg that carries the arm when all is rigid.

    While it flies its damping would turn its speed round in a step of 10 us; taken explicitly, the
    run ended after a millisecond.
    """
    bearing = jp.RevoluteClearance(
        radial_clearance=1e-4, axial_clearance=1e-4, bearing_radius=0.02, bearing_length=0.04
    )
    arm = jp.Mechanism("z1", {"joint1": bearing})
    start = (0.0, 1.5, -1.4, 0.0, 0.0, 0.0, -0.8)
    motion = jp.Motion(list(arm.joints), [0.0, 0.3], [start, [place + 0.1 for place in start]])
    peaks = []
    for options in ({}, {"step": 1e-6, "record_every": 100}, {"tolerance": 1e-3}):
        run = jp.Run(jp.Simulation(arm, motion, duration=0.1, **options))
        result = run.finish()
        assert result.status == jp.physics.kernel.Status.COMPLETED
        assert result.audit.relative_energy_residual < 1e-4
        peaks.append(np.linalg.norm(result["joint_force_peak"].values[:, 0], axis=1).max())
        if not options:
            assert run.workspace.drives["implicit"].any()
    assert peaks[1:] == pytest.approx([peaks[0]] * 2, rel=1e-2)
