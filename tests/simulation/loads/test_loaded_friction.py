"""Friction that grows with the force that a joint transmits, against closed forms."""

import numpy as np
import pytest
from conftest import body, joint
from machines import QUIET, slider
from scipy.integrate import solve_ivp

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import LoadedFriction, Wrench

WEIGHT = (0.0, 0.0, -9.81)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_sled_is_braked_by_its_weight(urdf, integrator):
    loads = {"rub": LoadedFriction("x", 0.2)}
    result = jp.simulate(
        slider(urdf, gravity=WEIGHT),
        duration=0.4,
        state={"x": (0.0, 1.0)},
        loads=loads,
        integrator=integrator,
        **QUIET,
    )
    limit = 2e-5 if integrator == "semi-implicit-euler" else 1e-6
    exact = 1.0 - 0.2 * 9.81 * result.time
    assert result["v"].values[:, 0] == pytest.approx(exact, abs=limit)
    lost = -float(result["load_work"][-1, 0])
    assert lost == pytest.approx(0.5 * 2.0 * (1.0 - exact[-1] ** 2), rel=1e-4)
    assert result.audit.relative_energy_residual < 1e-4


def test_a_wrench_presses_the_sled_down(urdf):
    robot = slider(urdf)
    loads = {"press": Wrench("cart", force=(0, 6.0, -8.0)), "rub": LoadedFriction("x", 0.3)}
    result = jp.simulate(robot, duration=0.2, state={"x": (0.0, 1.0)}, loads=loads, **QUIET)
    assert float(result["v"][-1, 0]) == pytest.approx(1.0 - 0.3 * 10.0 / 2.0 * 0.2, abs=1e-4)


def pendulum(urdf, **options):
    path = urdf(body("bob", 2.0, "0 0 -0.5", 0.01), joint("a", "base", "bob", axis="0 1 0"))
    return jp.Mechanism(path, **options)


@pytest.mark.parametrize("integrator", ["multi-rate", "rk4"])
def test_a_pendulum_is_braked_by_what_its_pin_carries(urdf, integrator):
    mu, radius, m, length, inertia, g = 0.2, 0.03, 2.0, 0.5, 0.01 + 2.0 * 0.25, 9.81

    def motion(_, state):
        """The reaction from Newton's law of the bob; the friction in it by iteration."""
        angle, speed = state
        friction = 0.0
        for _ in range(50):
            a = (-m * g * length * np.sin(angle) - friction) / inertia
            along = m * (length * speed**2 + g * np.cos(angle))
            across = m * (length * a + g * np.sin(angle))
            friction = mu * radius * np.hypot(along, across) * np.tanh(speed / 1e-3)
        return [speed, (-m * g * length * np.sin(angle) - friction) / inertia]

    loads = {"rub": LoadedFriction("a", mu, radius)}
    result = jp.simulate(
        pendulum(urdf),
        duration=0.3,
        state={"a": (0.0, 4.0)},
        loads=loads,
        integrator=integrator,
        record_every=100,
        **QUIET,
    )
    exact = solve_ivp(motion, (0, 0.301), [0, 4.0], t_eval=result.time, rtol=1e-10, atol=1e-12).y[0]
    unbraked = jp.simulate(pendulum(urdf), duration=0.3, state={"a": (0.0, 4.0)}, **QUIET)
    effect = abs(float(unbraked["q"][-1, 0]) - exact[-1])
    assert np.abs(result["q"].values[:, 0] - exact).max() < 1e-3 * effect
    assert result.audit.relative_energy_residual < 1e-6


def test_the_force_along_the_axis_rubs_on_its_own_radius(urdf):
    path = urdf(body("disc", 3.0, "0 0 0", 0.02), joint("a", "base", "disc"))
    loads = {"rub": LoadedFriction("a", 0.1, axial_radius=0.02)}
    result = jp.simulate(
        jp.Mechanism(path), duration=0.1, state={"a": (0.0, 5.0)}, loads=loads, **QUIET
    )
    assert float(result["v"][-1, 0]) == pytest.approx(
        5.0 - 0.1 * 0.02 * 3 * 9.81 / 0.02 * 0.1, 1e-5
    )


def test_what_cannot_be_is_refused(urdf):
    with pytest.raises(jp.JointplayError, match="coefficient of friction must not be negative"):
        LoadedFriction("a", -0.1)
    with pytest.raises(jp.JointplayError, match="needs the radius of its bearing"):
        LoadedFriction("a", 0.1).site(pendulum(urdf))
    with pytest.raises(jp.JointplayError, match=r"'x' slides: its friction needs no radius"):
        LoadedFriction("x", 0.1, 0.02).site(slider(urdf))
    loop = jp.Scenario.load(jp.shipped("four_bar.toml"))
    mechanism = loop.simulation(next(iter(loop.cases))).mechanism
    name = mechanism.joints[0]
    with pytest.raises(jp.JointplayError, match="in a mechanism with loops"):
        LoadedFriction(name, 0.1, 0.02).site(mechanism)
