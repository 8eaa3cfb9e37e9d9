"""Steps that go by their own error: what they reach, where they are fine, what they leave out."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint
from test_integrators import ELASTIC

import jointplay as jp
from jointplay.paper import scara
from jointplay.simulation.time_loop import LONGEST_ADAPTIVE_MACRO_STEP_S

TOLERANCES = np.array([1e-2, 1e-3, 1e-4, 1e-5])


@pytest.fixture
def bouncing(free_mass):
    """A mass that bounces between both rims of its bearing for ever: four impacts of 0.2 m/s."""

    def make(**options):
        case = {"offset": (0.0,) * 6, "velocity": (0, 0, 0.2, 0, 0, 0), "duration": 0.0095}
        return free_mass(**(case | ELASTIC | {"step": 1e-5} | options))

    return make


def largest_force(result):
    return float(result["normal_force_peak"].max())


def test_speeds_after_elastic_impacts_are_those_before_them_within_the_tolerance(bouncing):
    errors = []
    for tolerance in TOLERANCES:
        result = bouncing(tolerance=tolerance).finish()
        speed = result["v"].values[:, 2]
        flying = (result["gap"].values[:, 0] > 0.0).all(axis=-1)
        assert np.count_nonzero(np.diff(np.sign(speed[flying]))) == 4
        errors.append(np.abs(np.abs(speed[flying]) / 0.2 - 1.0).max())
    assert (np.array(errors) < 20.0 * TOLERANCES).all()
    assert errors[-1] < errors[0] / 30.0


def test_the_peak_is_that_of_a_run_with_fine_steps(bouncing):
    exact = largest_force(bouncing(step=1e-7, duration=2e-3).finish())
    found = largest_force(bouncing(tolerance=1e-3, duration=2e-3).finish())
    assert found == pytest.approx(exact, rel=5e-3)


def test_steps_are_taken_where_something_happens(bouncing):
    """Flight takes a step or two for each call of Pinocchio, an impact some dozens."""
    run = bouncing(tolerance=1e-3, velocity=(0, 0, 2e-3, 0, 0, 0), duration=0.95)
    run.finish()
    evaluations = int(run.workspace.run["solves"][0])
    assert 4 * 10 < evaluations < 4 * 100
    assert run.workspace.macro_steps < 1.1 * 0.95 / LONGEST_ADAPTIVE_MACRO_STEP_S


def test_records_hold_the_state_at_their_time(bouncing):
    """Between states they are interpolated: work and energy there belong together."""
    options = {"duration": 2e-3, "record_every": 1}
    exact = bouncing(step=1e-7, **options | {"record_every": 100}).finish()
    result = bouncing(tolerance=1e-4, **options).finish()
    assert result.time == pytest.approx(exact.time, abs=1e-12)
    for name, scale in (("q", 2e-4), ("v", 0.2)):
        assert np.abs(result[name].values - exact[name].values).max() < 5e-3 * scale
    off = np.abs(result["normal_force"].values - exact["normal_force"].values).max()
    assert off < 0.03 * largest_force(exact)
    assert result.audit.relative_energy_residual < 1e-3


def test_a_step_that_met_something_unforeseen_is_done_again(urdf):
    """A stiff stop that no onset announces: a spring that begins to act at an angle."""
    path = urdf(body("arm", 2.0, "0 0 -0.2"), joint("swing", "base", "arm", axis="0 1 0"))

    def swing(**options):
        return jp.simulate(
            jp.Mechanism(path),
            duration=0.5,
            state={"swing": 0.3},
            drive=jp.loads.Free(),
            joint_friction={},
            loads={"stop": jp.loads.Stop("swing", stiffness=5e4, lower=-0.1)},
            **options,
        )

    exact, found = swing(step=4e-6, record_every=25), swing(tolerance=1e-4)
    fastest = np.abs(exact["v"].values).max()
    assert exact["q"].values.min() < -0.1
    assert found["v"].values[-1] == pytest.approx(exact["v"].values[-1], abs=1e-2 * fastest)
    assert found.audit.relative_energy_residual < 1e-3


LOADED_JOINTS = ("shoulder_lift_joint", "shoulder_pan_joint")


@pytest.mark.parametrize("tolerance", [1e-2, 2.5e-4])
def test_journals_that_lie_do_not_begin_to_swing(tolerance):
    """The error of a step is nothing where nothing swings: only the stiffness bounds it there.

    Without that bound a journal pressed into its bearing began to swing in every long step, and its
    force grew a thousandfold before the error told.
    """
    bearing = jp.RevoluteClearance(
        radial_clearance=0.8e-3, axial_clearance=0.8e-3, bearing_radius=0.02, bearing_length=0.04
    )
    arm = jp.Mechanism("ur5", dict.fromkeys(LOADED_JOINTS, bearing))
    places = [(0.0, -1.0, 1.0, 0.2, -1.0, 0.3), (0.3, -0.7, 0.7, 0.5, -0.7, 0.0)]
    motion = jp.Motion(list(arm.joints), [0.0, 0.4], places)
    fixed, chosen = (
        jp.simulate(arm, motion, duration=0.2, **options)
        for options in ({}, {"tolerance": tolerance})
    )
    assert fixed.audit.impacts < 20  # it lies
    peaks = [
        np.linalg.norm(one["joint_force_peak"].values, axis=2).max(axis=0)
        for one in (fixed, chosen)
    ]
    assert peaks[1] == pytest.approx(peaks[0], rel=1e-2)
    assert chosen.audit.relative_energy_residual < 1e-4


def test_springs_and_gears_bound_the_step(urdf):
    """At rest on a stiff spring, as long as anybody waits."""
    path = urdf(body("arm", 2.0, "0 0 -0.2"), joint("swing", "base", "arm", axis="0 1 0"))
    spring = jp.loads.TorsionSpring("swing", stiffness=2e7)
    options = {"drive": {}, "state": {"swing": (0.0, 1e-6)}, "loads": {"spring": spring}}
    result = jp.simulate(jp.Mechanism(path), duration=0.2, tolerance=1e-2, **options)
    speed = np.abs(result["v"].values[:, 0])
    assert speed.max() < 1.05e-6


def test_a_smaller_tolerance_also_shortens_macro_steps():
    """Their error would remain: 0.9 % of this peak, however small the tolerance."""
    run = {
        tolerance: jp.Run(replace(scara(2e-4), duration=0.3, tolerance=tolerance))
        for tolerance in (1e-2, 1e-3, 1e-5)
    }
    longest = {tolerance: int(one.workspace.run["longest"][0]) for tolerance, one in run.items()}
    assert longest[1e-2] == longest[1e-3] == 30
    assert longest[1e-5] == round(30 / 100**0.25)
    allowed = [float(one.workspace.run["tolerance"][0]) for one in run.values()]
    assert allowed[2] == pytest.approx(allowed[1] / 100)
    given = jp.Run(replace(scara(2e-4), duration=0.3, tolerance=1e-5, macro_step=2e-4))
    assert int(given.workspace.run["longest"][0]) == 20
