"""Steps that go by their own error: what they reach, where they are fine, what they leave out."""

import numpy as np
import pytest
from conftest import body, joint
from test_integrators import ELASTIC, observed_order

import jointplay as jp

TOLERANCES = np.array([1e-2, 1e-3, 1e-4, 1e-5])


@pytest.fixture
def bouncing(free_mass):
    """A mass that bounces between both rims of its bearing for ever: five impacts of 0.2 m/s."""

    def make(**options):
        case = {"offset": (0.0,) * 6, "velocity": (0, 0, 0.2, 0, 0, 0), "duration": 0.01}
        return free_mass(**(case | ELASTIC | {"step": 1e-5} | options))

    return make


def test_speeds_after_elastic_impacts_are_those_before_them_within_the_tolerance(bouncing):
    errors = []
    for tolerance in TOLERANCES:
        result = bouncing(tolerance=tolerance).finish()
        speed = np.abs(result["v"].values[:, 2])
        flying = (result["gap"].values[:, 0] > 0.0).all(axis=-1)
        assert np.count_nonzero(np.diff(np.sign(result["v"].values[:, 2]))) == 5
        errors.append(np.abs(speed[flying] / 0.2 - 1.0).max())
    assert (np.array(errors) < 10.0 * TOLERANCES).all()
    assert observed_order(errors, TOLERANCES) > 0.8


def test_the_peak_is_that_of_a_run_with_fine_steps(bouncing):
    peak = {
        tolerance: bouncing(tolerance=tolerance, step=step).finish()["normal_force_peak"].max()
        for tolerance, step in ((None, 1e-7), (1e-3, 1e-5))
    }
    assert float(peak[1e-3]) == pytest.approx(float(peak[None]), rel=5e-3)


def test_steps_are_taken_where_something_happens(bouncing):
    """Flight needs a step a macro step; an impact as many whatever its speed."""
    run = bouncing(tolerance=1e-3)
    run.finish()
    solves = int(run.workspace.run["solves"][0])
    assert solves < 5 * 60
    fine = bouncing(tolerance=1e-3, velocity=(0, 0, 2e-3, 0, 0, 0), duration=1.0)
    fine.finish()
    macros = fine.workspace.macro_steps
    assert int(fine.workspace.run["solves"][0]) < 2 * macros + 5 * 60


def test_records_are_at_their_times_and_hold_the_state_at_them(bouncing):
    """Between states they are interpolated: the work done and the energy there belong together."""
    exact = bouncing(step=1e-7, record_every=100).finish()
    result = bouncing(tolerance=1e-4, record_every=1).finish()
    assert np.array_equal(result.time, exact.time)
    for name, scale in (("q", 2e-4), ("v", 0.2)):
        assert np.abs(result[name].values - exact[name].values).max() < 5e-3 * scale
    force = np.abs(result["normal_force"].values - exact["normal_force"].values).max()
    assert force < 0.03 * float(exact["normal_force_peak"].max())
    assert result.audit.relative_energy_residual < 1e-3


def test_every_step_that_is_asked_for_is_recorded(bouncing):
    result = bouncing(tolerance=1e-3, record_every=7).finish()
    assert np.allclose(np.diff(result.time)[:-1], 7e-5)
    assert result.time[-1] == pytest.approx(0.01)


def test_a_step_that_met_something_unforeseen_is_done_again(urdf):
    """A stiff stop that no onset announces: a spring that begins to act at an angle."""
    path = urdf(body("arm", 2.0, "0 0 -0.2"), joint("swing", "base", "arm", axis="0 1 0"))

    def final(**options):
        return jp.simulate(
            jp.Mechanism(path),
            duration=0.5,
            state={"swing": 0.3},
            drive=jp.loads.Free(),
            joint_friction={},
            loads={"stop": jp.loads.Stop("swing", stiffness=5e4, lower=-0.1)},
            **options,
        )

    exact, found = final(step=1e-6, record_every=100), final(tolerance=1e-4)
    assert exact["q"].values.min() < -0.1
    assert np.abs(found["v"].values - exact["v"].values)[-1] < 1e-2 * np.abs(exact["v"].values).max()
    assert found.audit.relative_energy_residual < 1e-3
