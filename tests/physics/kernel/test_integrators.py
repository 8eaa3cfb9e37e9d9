"""Order of convergence: smooth motion, lasting contact, an impact."""

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, release, still
from scipy.integrate import solve_ivp

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS

ELASTIC = {"normal": jp.contact.Hertz(), "restitution": 1.0, "friction": jp.contact.Ambrosio(0.0)}
METHODS = pytest.mark.parametrize("method", INTEGRATORS.values(), ids=INTEGRATORS.keys())


def observed_order(errors, steps):
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


@METHODS
def test_swinging_robot_converges_to_an_independent_integration(urdf, method):
    path = urdf(
        body("one", 3.0, "0.15 0 0"),
        body("two", 2.0, "0.1 0.02 0"),
        joint("a", "base", "one", axis="0 1 0"),
        joint("b", "one", "two", axis="0 0.6 0.8", at="0.3 0 0"),
    )
    robot = jp.Mechanism(path)
    start, duration = np.array([0.5, -0.3]), 0.64

    def slope(_, y):
        return np.concatenate([y[2:], pin.aba(robot.model, robot.data, y[:2], y[2:], np.zeros(2))])

    exact = solve_ivp(
        slope, (0.0, duration), [*start, 0.0, 0.0], method="DOP853", rtol=1e-12, atol=1e-13
    ).y[:2, -1]
    steps = duration / np.array([160, 320, 640])
    errors = []
    for step in steps:
        simulation = jp.Simulation(robot, still(robot, duration), step=step, integrator=method.name)
        run = release(jp.Run(simulation))
        run.workspace.q[:] = start
        errors.append(np.abs(run.finish()["q"].values[-1] - exact).max())
    found = observed_order(errors, steps)
    if method.single_rate:
        assert found == pytest.approx(method.order, abs=0.15)
    else:  # two clocks: where macro steps shrink with the steps, their higher order shows
        assert method.order - 0.15 < found < method.order + 1.0


def errors_of_speed(free_mass, method, counts, height, speed, gravity, duration):
    """Largest errors of the speed at 16 common instants for each number of steps, and the gaps.

    Not of the position: semi-implicit Euler's positions through an elastic impact are those of the
    leapfrog method, of second order.
    """

    def speeds(name, count):
        run = free_mass(
            offset=(0, 0, height, 0, 0, 0),
            velocity=(0, 0, speed, 0, 0, 0),
            gravity=(0, 0, gravity),
            integrator=name,
            step=duration / count,
            duration=duration,
            record_every=int(count) // 16,
            **ELASTIC,
        )
        result = run.finish()
        return result["v"].values[:, 2], result["gap"].values[:, 0, 2]

    exact, gap = speeds("rk4", 16 * max(counts))
    found = [np.abs(speeds(method.name, count)[0] - exact).max() for count in counts]
    return found, gap


@METHODS
def test_order_holds_in_lasting_elastic_contact(free_mass, method):
    """A mass on a Hertz spring, pressed so that it never leaves: the force is smooth."""
    counts = np.array([64, 128, 256, 512])
    case = (2e-4 + 4.5e-6, 0.01, 500.0, 2.56e-3)
    errors, gap = errors_of_speed(free_mass, method, counts, *case)
    assert (gap < 0.0).all()
    assert observed_order(errors, 1.0 / counts) == pytest.approx(method.order, abs=0.2)


@METHODS
def test_order_through_an_impact_is_limited_by_its_onset(free_mass, method):
    """delta^1.5 has no second derivative at the onset: at most dt^2.5, whatever the method."""
    counts = 16 * np.array([3, 4, 6, 8, 11, 16, 23])
    errors, gap = errors_of_speed(free_mass, method, counts, 1.9e-4, 0.2, 0.0, 6.4e-4)
    assert gap[0] > 0.0 > gap.min()
    assert gap[-1] > 0.0
    order = observed_order(errors, 1.0 / counts)
    if method.order == 1:
        assert order == pytest.approx(1.0, abs=0.2)
    else:
        assert 1.8 < order < 3.5
