"""Other engines, short: the same free flight and the same single impact, or skipped.

A deliberately wrong mass or inertia must be noticed, else the comparison compares nothing.
"""

import functools

import numpy as np
import pinocchio as pin
import pytest
from truth import peers
from truth.peer_engines import common, pinocchio_engine
from truth.peer_engines.common import missing, slider_crank
from truth.peer_engines.jointplay_engine import run_jointplay
from truth.peer_engines.trace import Trace, impacts, offset

import jointplay as jp

pytestmark = pytest.mark.thorough
STEP, SHORT = 5e-7, 2.2e-4
"""Of single impacts: the first is over at 0.2 ms [s]."""
RESTITUTION = 0.9


def engine(name):
    reason = missing(name)
    if reason:
        pytest.skip(reason)
    return __import__(f"truth.peer_engines.{name}_engine", fromlist=["run_free"])


FLIGHTS = {"scara": (peers.flying_scara, 6), "slider_crank": (peers.flying_slider_crank, 1)}


@pytest.mark.parametrize("mechanism", FLIGHTS)
@pytest.mark.parametrize("name", ["mujoco", "exudyn"])
def test_free_flight_is_the_same_and_a_wrong_mass_is_noticed(name, mechanism):
    other = engine(name)
    make, link = FLIGHTS[mechanism]
    task, step, duration = make(), 1e-5, 2e-3
    ours = run_jointplay(task, step, duration, 4, "rk4")
    assert not ours.force.any()

    def apart(given):
        return peers.difference(ours, other.run_free(given, step, duration, 4), duration)

    right = task.links[link]
    assert apart(task) < 1e-9
    assert apart(task.with_links(link, mass=1.01 * right.mass)) > 1e-8
    turned = tuple(1.01 * x for x in right.inertia)
    assert apart(task.with_links(link, inertia=turned)) > 1e-8


def test_free_flight_of_siconos_converges_with_second_order_and_not_to_a_wrong_mass():
    other = engine("siconos")
    task, duration = peers.flying_slider_crank(), 2e-3
    ours = run_jointplay(task, 5e-6, duration, 4, "rk4")

    def apart(given, step):
        return peers.difference(ours, other.run(given, step, duration, 1, 1.0), duration)

    coarse, fine = apart(task, 8e-6), apart(task, 4e-6)
    assert coarse / fine == pytest.approx(4.0, rel=0.1)
    assert apart(task.with_links(1, mass=1.01 * task.links[1].mass), 4e-6) > 100.0 * fine


def first(trace, task, rigid=False):
    return impacts(trace, task, rigid)[0]


@pytest.mark.parametrize(
    ("name", "run", "scheme", "same"),
    [("mujoco", "run_law", "semi-implicit-euler", 1e-8), ("exudyn", "run_own", "rk4", 1e-4)],
)
def test_first_impact_of_the_same_law_is_the_same(name, run, scheme, same):
    other = engine(name)
    task = slider_crank() if name == "mujoco" else slider_crank(mu=0.0, restitution=1.0)
    ours = first(run_jointplay(task, STEP, SHORT, 1, scheme), task)

    def impulse(given):
        return first(getattr(other, run)(given, STEP, SHORT), task).impulse

    assert impulse(task) == pytest.approx(ours.impulse, rel=same)
    heavy = task.with_links(2, mass=1.01 * task.links[2].mass)
    assert impulse(heavy) != pytest.approx(ours.impulse, rel=1e-3)


def rigid_impulse(task, trace):
    """(1 + e) v m along the normal just before the impact, with this package's masses [N s]."""
    model = task.simulation.mechanism.model
    data = model.createData()
    k = int(np.flatnonzero(trace.force > 0.0)[0]) - 1
    q, v = trace.q[k], trace.v[k]
    away = offset(task, q[None])[0, :2]
    push = 1e-7 * np.eye(3)
    slope = np.array(
        [np.subtract(*offset(task, np.array([q + d, q - d]))[:, :2]) / 2e-7 for d in push]
    ).T
    along = away / np.linalg.norm(away) @ slope
    # The crank's motion is prescribed: it has no part in the mass.
    inverse = np.linalg.inv(pin.crba(model, data, q)[1:, 1:])
    mass = 1.0 / (along[1:] @ inverse @ along[1:])
    return (1.0 + RESTITUTION) * mass * (along @ v)


@pytest.mark.parametrize("name", ["siconos", "ADMM", "PGS"])
def test_first_impact_of_rigid_engines_has_the_impulse_of_rigid_bodies(name):
    task = slider_crank(mu=0.0)
    if name == "siconos":
        run = engine("siconos").run
    else:
        run = functools.partial(pinocchio_engine.run, solver=name)

    def expected_and_found(given):
        trace = run(given, STEP, SHORT, 1, RESTITUTION)
        return rigid_impulse(task, trace), first(trace, task, True).impulse

    expected, found = expected_and_found(task)
    assert found == pytest.approx(expected, rel=2e-3)
    expected, found = expected_and_found(task.with_links(2, mass=1.05 * task.links[2].mass))
    assert found != pytest.approx(expected, rel=5e-3)


@pytest.mark.parametrize("kind", ["implicitfast", "discrete"])
def test_newer_integrators_of_mujoco_find_the_same_first_impact(kind):
    other, task = engine("mujoco"), slider_crank(mu=0.0)
    if kind not in other.INTEGRATORS:
        pytest.skip(f"this MuJoCo has no {kind}")
    limit = other.matched_limit(49e-6, RESTITUTION)
    euler, newer = (
        first(other.run_own(task, 1e-7, SHORT, 1, limit, name), task) for name in ("Euler", kind)
    )
    assert newer.time == pytest.approx(euler.time, abs=2e-7)
    assert newer.impulse == pytest.approx(euler.impulse, rel=1e-2)


@pytest.mark.parametrize("how", [{"step": 2e-7}, {"accuracy": 1e-9}])
def test_first_impact_in_drake_is_about_the_same_and_a_wrong_mass_is_noticed(how):
    other, task = engine("drake"), slider_crank(mu=0.0)
    fine = run_jointplay(task, 1e-7, SHORT)
    ours, speed = first(fine, task), peers.touch_speed(fine, task)

    def found(given):
        return first(other.run(given, SHORT, speed, **how), task)

    same = found(task)
    assert same.time == pytest.approx(ours.time, abs=2e-7)
    # The walls reached add up to Hertz's exponent for small penetrations; deep ones are softer.
    assert same.duration == pytest.approx(ours.duration, rel=0.08)
    heavy = task.with_links(2, mass=1.2 * task.links[2].mass)
    assert found(heavy).duration > 1.02 * same.duration


def test_cost_is_that_of_the_cheapest_setting_with_all_finer_ones_good():
    errors, costs = np.array([0.005, 0.5, 0.009, 0.001]), np.array([1.0, 2.0, 8.0, 4.0])
    work = peers.Work(errors, costs, "abcd", np.nan, 0.0)
    assert work.cost(0.01) == (4.0, "d")
    assert work.cost(1.0) == (1.0, "a")
    assert np.isnan(work.cost(1e-4)[0])


def test_the_error_of_a_setting_is_that_of_its_worst_start():
    """By an engine whose journal stands still, off by the setting where its start is displaced."""
    starts = tuple(peers.displaced(slider_crank(mu=0.0), 3))
    assert [one.start[0][2] < starts[1].start[0][2] for one in starts] == [True, False, False]

    def run(task, setting, duration, every):
        q = starts[1].start[0].copy()
        q[2] += setting * task.clearance * (task is starts[2])
        time = np.linspace(0.0, duration, 3)
        return Trace(time, np.tile(q, (3, 1)), np.zeros((3, 3)), np.zeros(3), 1.0, 2)

    ladder = peers.Ladder(run, (0.5, 0.25), ("half", "quarter"), 0.0, steps=False)
    work = peers.work_precision({"still": ladder}, starts, 1e-3, 1e-3)["still"]
    assert work.errors == pytest.approx([0.5, 0.25])
    assert work.cost(0.3)[1] == "quarter"


def test_mujoco_has_the_torques_of_the_ideal_robot():
    engine("mujoco")
    assert peers.ideal_torques() < 1e-9


@pytest.mark.parametrize("restitution", [0.95, 0.7])
def test_matched_limit_has_the_duration_and_restitution_asked(restitution):
    other = engine("mujoco")
    stiffness, damping = other.matched_limit(5e-5, restitution)
    x, v, t, h = 0.0, 1.0, 0.0, 1e-9
    while t == 0.0 or stiffness * x + damping * v > 0.0:
        v -= h * (stiffness * x + damping * v)
        x += h * v
        t += h
    assert t == pytest.approx(5e-5, rel=1e-3)
    assert -v == pytest.approx(restitution, rel=1e-3)


@pytest.mark.parametrize("name", peers.ENGINES)
def test_missing_engine_is_named_with_its_remedy(name, monkeypatch):
    monkeypatch.setattr(common.importlib.util, "find_spec", lambda _: None)
    monkeypatch.setattr(common, "siconos_python", lambda: "")
    reason = missing(name)
    assert name in reason
    assert "install" in reason
    assert "\n" not in reason


def test_impacts_of_a_trace_with_a_known_impulse():
    task = slider_crank(mu=0.0, restitution=1.0)
    time = np.linspace(0.0, 1e-3, 1001)
    depth = 1e-5 * np.sin(np.pi * (time - 3e-4) / 1e-4)
    inside = (time > 3e-4) & (time < 4e-4)
    q = np.zeros((1001, 3))
    q[:, 2] = 0.17 + np.where(inside, task.clearance + depth, task.clearance - 1e-6)
    trace = Trace(time, q, 0.0 * q, np.where(inside, 100.0 * depth / 1e-5, 0.0), 0.0, 1000)
    (one,) = impacts(trace, task)
    assert one.time == pytest.approx(3e-4, abs=1e-6)
    assert one.duration == pytest.approx(1e-4, abs=2e-6)
    assert one.impulse == pytest.approx(100.0 * 1e-4 * 2.0 / np.pi, rel=1e-3)


@pytest.mark.parametrize(
    ("scenario", "task"), [("slider_crank.toml", slider_crank), ("scara.toml", common.scara)]
)
def test_joint_is_the_shipped_one(scenario, task):
    shipped = jp.Scenario.load(jp.shipped(scenario)).simulation("0.2 mm").mechanism.clearance
    ours = task().simulation.mechanism.clearance
    assert list(shipped) == list(ours)
    for name, joint in shipped.items():
        for field in ("ri", "rj", "li", "lj", "restitution", "hertz_stiffness", "lock_tilt"):
            assert getattr(ours[name], field) == getattr(joint, field)
        assert type(ours[name].normal) is type(joint.normal)
        assert ours[name].friction.mu_d == joint.friction.mu_d
