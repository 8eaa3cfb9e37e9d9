"""What the step does to runs without clearance: estimated, and warned of where it is large."""

import math

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.impact import tooth_duration
from jointplay.model.robots import shipped
from jointplay.paper import scara
from jointplay.physics.kernel import Status
from jointplay.simulation import step_check
from jointplay.simulation.loads.drive import ComputedTorque, Free

RATTLING = jp.Gear(play=2e-3, rotor_inertia=0.5, stiffness=2e5, damping=5.0)
"""Controlled by what the joint does, the motor rattles in its play."""


G = 9.81
PIN = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)


@pytest.fixture(autouse=True, scope="module")
def checked():
    """Steps are checked where no other test asks for it."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(jp.Simulation.run, "__defaults__", (False, False, True, False, None))
        patch.setattr(jp.Run.finish, "__defaults__", (False, True, None))
        yield


def geared(gear, step, integrator):
    robot = jp.Mechanism(shipped("scara.urdf"), gears={"joint_a": gear})
    every = round(1e-3 / step)
    return jp.simulate(
        robot,
        scara(None).motion,
        drive=ComputedTorque(encoder="link", bandwidth=100.0),
        duration=1.0,
        step=step,
        record_every=every,
        integrator=integrator,
        limits="ignore",
    )


def tool_error(result, truth):
    apart = result["tool_position"].values - truth["tool_position"].values
    return float(np.linalg.norm(apart, axis=1).max())


@pytest.fixture(scope="module")
def truth():
    """The rattling robot, with an error of 1e-5 m."""
    return geared(RATTLING, 1e-5, "rk4")


@pytest.fixture(scope="module")
def way(truth):
    """How far its tool moves."""
    start = truth["tool_position"].values[0]
    return float(np.linalg.norm(truth["tool_position"].values - start, axis=1).max())


@pytest.mark.parametrize(
    ("integrator", "step"),
    [
        pytest.param("semi-implicit-euler", 1e-5, marks=pytest.mark.thorough),
        *(("rk4", 5e-4), ("multi-rate", 1e-4)),
        pytest.param("multi-rate", 2.5e-4, marks=pytest.mark.thorough),
    ],
)
def test_an_error_that_energy_does_not_tell_is_warned_of(integrator, step, truth, way):
    result = geared(RATTLING, step, integrator)
    error = tool_error(result, truth)
    assert error > 0.02 * way
    assert result.audit.relative_energy_residual < 0.01
    assert len(result.audit.warnings) == 1
    assert "half the step gives different results" in result.audit.warnings[0]
    assert 0.5 * error < result.audit.step_error < 2.0 * error


@pytest.mark.parametrize(
    ("integrator", "step"),
    [("rk4", 5e-5), pytest.param("multi-rate", 1e-5, marks=pytest.mark.thorough)],
)
def test_a_step_that_is_small_enough_is_not_blamed(integrator, step, truth, way):
    result = geared(RATTLING, step, integrator)
    assert tool_error(result, truth) < 0.005 * way
    assert result.audit.warnings == []
    assert 0.0 < result.audit.relative_step_error < 0.005


def falling(urdf, step=1e-3, duration=0.5, **options):
    path = urdf(body("mass"), joint("slide", "base", "mass", kind="prismatic"))
    return jp.Simulation(
        jp.Mechanism(path), drive={"slide": Free()}, step=step, duration=duration, **options
    )


@pytest.mark.parametrize(("every", "duration"), [(10, 0.5), (7, 0.5), (1, 0.501), (9, 0.499)])
def test_semi_implicit_euler_falls_too_far_by_half_a_step_of_its_speed(every, duration, urdf):
    options = {"integrator": "semi-implicit-euler", "record_every": every, "duration": duration}
    result = falling(urdf, **options).run()
    time = result.time[-1]
    fallen = -result["q"].values[-1, 0]
    assert fallen - 0.5 * G * time**2 == pytest.approx(0.5 * G * time * 1e-3, rel=1e-6)
    found = 0.1 if every == 9 else 0.01  # the end is no multiple of twice the step
    assert result.audit.step_error == pytest.approx(0.5 * G * time * 1e-3, rel=found)
    assert result.audit.relative_step_error == pytest.approx(1e-3 / time, rel=found)


def test_a_run_changed_by_hand_is_checked_as_it_is(urdf):
    run = jp.Run(falling(urdf, integrator="semi-implicit-euler"))
    run.workspace.v[:] = 100.0
    audit = run.finish().audit
    assert audit.step_error == pytest.approx(0.5 * G * 0.5 * 1e-3, rel=1e-3)
    assert audit.relative_step_error < 1e-4


@pytest.mark.filterwarnings("ignore:stopped at")
def test_twice_the_step_may_fail_where_the_step_is_good():
    robot, motion = jp.Mechanism(shipped("scara.urdf")), scara(None).motion
    results = [
        jp.simulate(robot, motion, duration=1.0, step=step, record_every=1, integrator="rk4")
        for step in (2.5e-3, 1e-2)
    ]
    assert results[0].audit.warnings == []
    assert 0.0 < results[0].audit.step_error < 1e-5
    assert results[1].audit.warnings or results[1].status != Status.COMPLETED


def test_what_is_judged_otherwise_is_not_run_again(urdf):
    assert falling(urdf, integrator="multi-rate", step=1e-4).run().audit.step_error is None
    assert falling(urdf, integrator="multi-rate", step=1e-3).run().audit.step_error is not None
    assert falling(urdf, step=1e-4, macro_step=1e-3).run().audit.step_error is not None
    path = urdf(body("arm"), joint("pin", "base", "arm"))
    mechanism = jp.Mechanism(path, {"pin": PIN})
    options = {"duration": 1e-3, "drive": {"pin": Free()}, "integrator": "rk4"}
    assert jp.simulate(mechanism, **options).audit.step_error is None


def test_ctrl_c_while_the_step_is_checked_keeps_the_run(urdf, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr(step_check, "_difference", interrupted)
    result = falling(urdf, integrator="rk4").run()
    assert result.status == Status.COMPLETED
    assert result.audit.step_error is None


def two_bodies(urdf, gear, clearance=None):
    path = urdf(
        body("arm", inertia=0.1),
        joint("pin", "base", "arm"),
        body("hand", com="0.1 0 0"),
        joint("wrist", "arm", "hand", at="0.2 0 0"),
    )
    return jp.Mechanism(path, clearance or {}, gears={"wrist": gear})


def test_teeth_of_a_rotor_as_heavy_as_its_joint_meet_for_pi_root_half(urdf):
    inertia = 1e-2 + 2.0 * 0.1**2
    gear = jp.Gear(1e-3, inertia, 5e4)
    path = urdf(body("arm", com="0.1 0 0"), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, gears={"pin": gear})
    expected = math.pi * math.sqrt(0.5 * inertia / 5e4)
    assert tooth_duration(robot, "pin", np.zeros(2)) == pytest.approx(expected)


def test_steps_too_large_for_teeth_are_refused_and_few_are_warned_of(urdf):
    gear = jp.Gear(1e-3, 1e-2, 1e4)
    robot = two_bodies(urdf, gear, {"pin": PIN})
    options = {"duration": 0.02, "drive": {"wrist": jp.loads.Torque((0.0,), (5.0,))}}
    lasts = tooth_duration(robot, "wrist", np.zeros(robot.model.nq))
    with pytest.raises(jp.JointplayError, match="too large for the stiffness of the gear at 'wris"):
        jp.simulate(two_bodies(urdf, gear), step=lasts / 3.9, **options)
    stiff = jp.Gear(1e-3, 1e-2, 1e4 * (lasts / 8e-5) ** 2)
    robot = two_bodies(urdf, stiff, {"pin": PIN})
    steps = [jp.simulate(robot, step=step, **options).audit for step in (1e-5, 5e-6)]
    assert [audit.tooth_steps for audit in steps] == pytest.approx([8.0, 16.0], rel=1e-6)
    assert any("gear teeth last 8 steps" in text for text in steps[0].warnings)
    assert not any("gear teeth" in text for text in steps[1].warnings)
