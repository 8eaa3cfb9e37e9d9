"""Springs between two points: known motions, energies, and what is refused."""

import numpy as np
import pytest
from conftest import body, joint
from hypothesis import given
from hypothesis import strategies as st
from machines import QUIET, arm, slider

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import CurveSpring, Spring


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_mass_on_a_spring_swings_as_it_must(urdf, integrator):
    spring = Spring("cart", stiffness=800.0, free_length=0.5, other_at=(-0.5, 0.0, 0.0))
    result = jp.simulate(
        slider(urdf),
        duration=0.5,
        state={"x": 0.05},
        loads={"spring": spring},
        integrator=integrator,
        **QUIET,
    )
    exact = 0.05 * np.cos(20.0 * result.time)
    limit = 1e-3 if integrator == "semi-implicit-euler" else 1e-6
    assert result["q"].values[:, 0] == pytest.approx(exact, abs=0.05 * limit)
    force = result["load_record"].sel(load_part="spring.force").values
    assert force == pytest.approx(800.0 * result["q"].values[:, 0], abs=1e-3)
    length = result["load_record"].sel(load_part="spring.length").values
    assert length == pytest.approx(0.5 + result["q"].values[:, 0], abs=1e-7)


def test_a_damper_takes_what_the_swing_loses(urdf):
    mass, k, c = 2.0, 800.0, 8.0
    spring = Spring("cart", k, 0.5, other_at=(-0.5, 0.0, 0.0), damping=c)
    loads = {"spring": spring}
    result = jp.simulate(slider(urdf, mass), duration=0.5, state={"x": 0.05}, loads=loads, **QUIET)
    decay = c / (2.0 * mass)
    w = np.sqrt(k / mass - decay**2)
    t = result.time
    exact = 0.05 * np.exp(-decay * t) * (np.cos(w * t) + decay / w * np.sin(w * t))
    assert np.abs(result["q"].values[:, 0] - exact).max() < 1e-7
    total = result["kinetic_energy"] + result["load_energy"].sum("load")
    lost = -result["load_work"].sel(load="spring")
    assert lost[-1] > 0.5
    assert (total + lost).values == pytest.approx(float(total[0]), rel=1e-6)


def test_a_spring_between_two_bodies_leaves_their_centre_of_mass_alone(urdf):
    path = urdf(
        body("one", 1.0),
        body("two", 3.0),
        joint("a", "base", "one", "prismatic", axis="1 0 0"),
        joint("b", "base", "two", "prismatic", axis="1 0 0"),
    )
    robot = jp.Mechanism(path, gravity=(0.0, 0.0, 0.0))
    spring = Spring("two", 500.0, 0.2, other="one", damping=1.0)
    start = {"a": -0.3, "b": 0.1}
    result = jp.simulate(robot, duration=0.3, state=start, loads={"s": spring}, **QUIET)
    q = result["q"].values
    assert q[:, 0] + 3.0 * q[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert np.ptp(q[:, 1] - q[:, 0]) > 0.1


def test_the_multi_rate_method_is_of_second_order_with_springs(urdf):
    robot = arm(urdf)
    loads = {"s": Spring("two", 900.0, 0.3, at=(0.2, 0, 0), other_at=(0.3, 0, 0.6), damping=3.0)}

    def end(step, **options):
        result = jp.simulate(
            robot, duration=0.128, step=step, loads=loads, state={"a": 0.3}, **QUIET, **options
        )
        return result["q"].values[-1]

    exact = end(4e-5, integrator="rk4")
    steps = (3.2e-4, 1.6e-4, 8e-5)
    errors = [np.abs(end(step, macro_step=4 * step) - exact).max() for step in steps]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert (orders > 1.8).all(), (errors, orders)


@given(
    st.lists(st.floats(0.01, 1.0), min_size=2, max_size=6, unique=True),
    st.data(),
    st.floats(0.0, 1.5),
)
def test_the_energy_of_a_curve_is_the_integral_of_its_force(nodes, data, length):
    lengths = np.cumsum(nodes)
    forces = [data.draw(st.floats(-100.0, 100.0)) for _ in lengths]
    spring = CurveSpring("tip", tuple(lengths), tuple(forces))
    grid = np.linspace(lengths[0], length, 20001)
    x = np.zeros((len(grid), 12))
    x[:, 0] = grid
    slopes = np.diff(forces) / np.diff(lengths)
    k = np.clip(np.searchsorted(lengths, grid, side="right") - 1, 0, len(slopes) - 1)
    force = np.array(forces)[k] + slopes[k] * (grid - lengths[k])
    summed = np.trapezoid(force, grid)
    found = spring.energy(x, spring.numbers(None))
    assert found[-1] - found[0] == pytest.approx(summed, abs=1e-5 * (1 + np.abs(force).max()))


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (lambda: Spring("cart", -1.0, 0.1), "spring stiffness must be greater than zero, got -1"),
        (lambda: Spring("cart", 1.0, 0.1, at=(0, 1)), "at must have three components"),
        (lambda: CurveSpring("cart", (0.2, 0.1), (0.0, 1.0)), "must increase: 0.2 m is followed"),
        (lambda: CurveSpring("cart", (0.1,), (0.0,)), "at least two, got 1 and 1"),
    ],
)
def test_impossible_springs_are_refused(load, words):
    with pytest.raises(jp.JointplayError, match=words):
        load()


def test_a_spring_says_which_frames_there_are(urdf):
    robot = slider(urdf)
    for load, words in (
        (Spring("carts", 1.0, 0.1), "no frame for a load 'carts'; did you mean \"cart\""),
        (Spring("base", 1.0, 0.1), "do not move against each other"),
        ("rubber", "loads.*is not a table; a load is a table"),
    ):
        with pytest.raises(jp.JointplayError, match=words):
            jp.simulate(robot, duration=0.1, loads={"s": load}, **QUIET)


def test_a_step_too_large_for_a_spring_is_refused(urdf):
    spring = Spring("cart", 8e6, 0.5, other_at=(-0.5, 0.0, 0.0))
    with pytest.raises(jp.JointplayError, match=r"too large for the load 'stiff'.* at 318 Hz"):
        jp.simulate(slider(urdf), duration=0.1, step=1e-3, loads={"stiff": spring}, **QUIET)


def test_the_chart_of_energies_shows_what_loads_store(urdf):
    loads = {"s": Spring("cart", 800.0, 0.5, other_at=(-0.5, 0.0, 0.0), damping=1.0)}
    result = jp.simulate(slider(urdf), duration=0.02, state={"x": 0.05}, loads=loads, **QUIET)
    labels = [line.get_label() for line in result.plot.energy().axes[0].lines]
    assert {"stored in loads", "work of loads"} <= set(labels)
