"""Controllers of the user's own: compiled and sampled ones, what they see, and what they may do."""

from typing import ClassVar

import numpy as np
import pytest
from machines import QUIET, rotor
from scipy.linalg import expm

import jointplay as jp
from jointplay.physics.kernel.constants import INTEGRATORS
from jointplay.simulation.loads import Controller

INERTIA, KP, KD = 0.02, 8.0, 0.2


def pd(time, q, v, p, out):
    out[0] = -p[0] * q[0] - p[1] * v[0]


def sampled_pd(time, q, v, p):
    return [-p[0] * q[0] - p[1] * v[0]]


class Counting:
    """Holds its gain, and remembers how often it was asked."""

    times: ClassVar[list[float]] = []

    def __init__(self, gain):
        self.gain, self.calls = gain, 0
        Counting.times = []

    def __call__(self, time, q, v):
        self.calls += 1
        Counting.times.append(time)
        return [self.gain * self.calls]


def failing(time, q, v, p):
    raise ZeroDivisionError("no gain")


def too_many(time, q, v, p):
    return [0.0, np.nan]


def seen(time, q, v, p):
    seen.what.append((time, q, v))
    return [0.0]


def damped(times):
    """Swing of the disc under kp and kd, from 0.3 rad at rest."""
    a = np.array([[0.0, 1.0], [-KP / INERTIA, -KD / INERTIA]])
    return np.array([(expm(a * t) @ [0.3, 0.0])[0] for t in times])


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_compiled_controller_is_the_spring_and_damper_that_it_says(urdf, integrator):
    loads = {"pd": Controller(("a",), pd, (KP, KD))}
    result = jp.simulate(
        rotor(urdf), duration=0.3, state={"a": 0.3}, loads=loads, integrator=integrator, **QUIET
    )
    at = slice(None, None, 100)
    limit = 1e-4 if integrator == "semi-implicit-euler" else 1e-7
    assert result["q"].values[at, 0] == pytest.approx(damped(result.time[at]), abs=limit)
    assert result.audit.relative_energy_residual < 10 * limit
    work = float(result["load_work"][-1, 0])
    energy = float(result["kinetic_energy"][-1] - result["kinetic_energy"][0])
    assert work == pytest.approx(energy, abs=10 * limit)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_sampled_controller_holds_its_torque(urdf, integrator):
    """Against the exact map of a double integrator from sample to sample."""
    period, n = 4e-3, 50
    loads = {"pd": Controller(("a",), sampled_pd, (KP, KD), period=period)}
    result = jp.simulate(
        rotor(urdf),
        duration=n * period,
        state={"a": 0.3},
        loads=loads,
        integrator=integrator,
        record_every=100,
        **QUIET,
    )
    state, exact = np.array([0.3, 0.0]), []
    for _ in range(n + 1):
        exact.append(state[0])
        a = -(KP * state[0] + KD * state[1]) / INERTIA
        state = np.array(
            [state[0] + period * state[1] + 0.5 * period**2 * a, state[1] + period * a]
        )
    limit = {"multi-rate": 1e-9, "rk4": 1e-12, "semi-implicit-euler": 1e-3}[integrator]
    assert result["q"].values[::4, 0] == pytest.approx(np.array(exact), abs=limit)
    assert result.audit.relative_energy_residual < (1e-2 if limit > 1e-4 else 1e-7)


def test_a_controller_with_a_memory_starts_afresh_in_each_run(urdf):
    loads = {"c": Controller(("a",), Counting, (0.5,), period=2e-3)}
    simulation = jp.Simulation(rotor(urdf), duration=0.01, loads=loads, **QUIET)
    one = simulation.run()
    assert Counting.times == pytest.approx([0.0, 2e-3, 4e-3, 6e-3, 8e-3])
    torque = one["load_record"].sel(load_part="c.torque.a").values
    assert torque[[5, 25, 45, 65, 85]] == pytest.approx([0.5, 1.0, 1.5, 2.0, 2.5])
    assert np.array_equal(simulation.run()["q"].values, one["q"].values)


@pytest.mark.parametrize("encoder", ["link", "motor", "both"])
def test_encoders_sit_where_they_are_said_to(urdf, encoder):
    gears = {"a": jp.Gear(play=0.02, rotor_inertia=0.01, stiffness=1e3)}
    loads = {"c": Controller(("a",), seen, period=1e-3, encoder=encoder)}
    seen.what = []
    result = jp.simulate(
        rotor(urdf, gears=gears), duration=0.02, state={"a": (None, 1.0)}, loads=loads, **QUIET
    )
    at = {"link": ["a"], "motor": ["a.motor"], "both": ["a", "a.motor"]}[encoder]
    for k in (3, 10, 19):
        time, q, v = seen.what[k]
        now = result.dataset.sel(time=time, method="nearest")
        assert q == pytest.approx(now["q"].sel(coordinate=at).values, abs=1e-12)
        assert v == pytest.approx(now["v"].sel(coordinate=at).values, abs=1e-6)


def test_a_torque_acts_on_the_motor(urdf):
    gears = {"a": jp.Gear(play=0.5, rotor_inertia=0.01, stiffness=1e3)}
    loads = {"c": Controller(("a",), Counting, (0.0,), period=0.01)}
    result = jp.simulate(rotor(urdf, gears=gears), duration=0.02, loads=loads, **QUIET)
    assert not result["q"].values.any()
    loads = {"c": Controller(("a",), Counting, (0.1,), period=1.0)}
    result = jp.simulate(rotor(urdf, gears=gears), duration=0.02, loads=loads, **QUIET)
    motor = result["v"].sel(coordinate="a.motor").values
    assert motor[-1] == pytest.approx(0.1 / 0.01 * 0.02, rel=1e-9)
    assert not result["q"].sel(coordinate="a").values.any()


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (lambda: Controller((), pd), "needs the names of its joints"),
        (lambda: Controller(("a", "a"), pd), "has a joint twice: a, a"),
        (
            lambda: Controller(("a",), pd, encoder="tool"),
            "no encoder 'tool'; available: motor, link",
        ),
        (lambda: Controller(("a",), pd, period=0.0), "period of a controller must be greater"),
        (lambda: Controller(("a",), sampled_pd), r"it must take \(time, q, v, p, out\)"),
    ],
)
def test_impossible_controllers_are_refused(load, words):
    with pytest.raises(jp.JointplayError, match=words):
        load()


@pytest.mark.parametrize(
    ("load", "words"),
    [
        (Controller(("b",), pd), "no moving joint 'b'; available: a"),
        (Controller(("a",), sampled_pd, (1, 1), 1.5e-5), "must be a multiple of the step 1e-05 s"),
        (Controller(("a",), failing, period=1e-3), r"failed at t = 0 s: ZeroDivisionError"),
        (
            Controller(("a",), too_many, period=1e-3),
            r"gave \[0.0, nan\] at t = 0 s; it must give 1",
        ),
        (Controller(("a",), Counting, period=1e-3), "cannot be made of the parameters"),
    ],
)
def test_what_a_run_cannot_do_is_said_in_a_line(urdf, load, words):
    with pytest.raises(jp.JointplayError, match=words) as caught:
        jp.simulate(rotor(urdf), duration=0.01, loads={"c": load}, **QUIET)
    assert "\n" not in str(caught.value)
