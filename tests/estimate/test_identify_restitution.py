"""Restitution from impacts, by flights and by simulations; and whether what was found agrees."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import body, joint, tip
from hypothesis import given, settings
from hypothesis import strategies as st
from robots import serial
from truth.restitution import arm

from jointplay import JointplayError, RevoluteClearance, identify, shipped
from jointplay.cli import main
from jointplay.estimate import Measurement
from jointplay.estimate.machine import delivered, nominal_of
from jointplay.estimate.restitution import (
    by_likelihood,
    by_simulation,
    channels,
    design,
    flights,
    impacts,
    record_noise,
)
from jointplay.estimate.verification import verify
from jointplay.physics.contact import LankaraniNikravesh, ZhangSharf
from jointplay.scenario import Scenario

RATE = 10e3
LOAD = 10.0
"""Acceleration at which the journal falls back [m/s^2]."""


def bounces(e, drops=6, first=0.05, rate=RATE, noise=0.0, seed=0, hit=1.0, kind="acceleration"):
    """What an accelerometer feels of a journal that is dropped: spikes after 2 v / a each.

    Known: flights and impulses are geometric series with the ratio e.
    """
    random = np.random.default_rng(seed)
    times, sizes = [], []
    apart = first / (1.0 - e) + 0.1
    for drop in range(drops):
        t, v = apart * drop + 0.05, 0.5 * LOAD * first
        while v > 1e-3 * LOAD:
            times.append(t)
            sizes.append(hit * v)
            t, v = t + 2.0 * v / LOAD, e * v
    time = np.arange(0.0, apart * drops, 1.0 / rate)
    felt = np.zeros(len(time))
    for t, size in zip(times, sizes, strict=True):
        i = t * rate
        low = int(i)
        felt[low] += size * rate * (1.0 - i + low)  # impulse at its time
        felt[low + 1] += size * rate * (i - low)
    felt += noise * random.standard_normal(len(time))
    key = ("acceleration", "z") if kind == "acceleration" else ("reaction", "j")
    return Measurement(time, {key: felt})


def told(measured):
    (channel,) = channels(measured)
    return flights(channel)


@pytest.mark.parametrize("e", [0.4, 0.6, 0.8, 0.9])
@pytest.mark.parametrize("kind", ["acceleration", "reaction"])
def test_flights_tell_the_restitution_of_bounces(e, kind):
    found = told(bounces(e, noise=5.0, kind=kind))
    assert found.reason == ""
    assert found.half_width < 0.1 * e
    assert abs(found.value - e) <= found.half_width


@settings(max_examples=25)
@given(st.floats(0.35, 0.92), st.floats(0.02, 0.1), st.integers(0, 1000), st.floats(0.1, 30.0))
def test_intervals_of_flights_hold_the_truth_or_nothing_is_told(e, first, seed, noise):
    found = told(bounces(e, first=first, noise=noise, seed=seed))
    assert found.reason or abs(found.value - e) <= found.half_width


@pytest.mark.parametrize(
    ("measured", "words"),
    [
        (bounces(0.7, noise=5e4), "no impact exceeds the noise"),
        (bounces(0.7, hit=0.0, noise=1.0), "no impact exceeds the noise"),
        (bounces(0.7, drops=1, first=4e-3, noise=1e-3), "4 are needed"),
        (bounces(0.5, rate=250.0, noise=1e-2), "4 are needed; at 250 records a second flights are"),
    ],
)
def test_drowned_absent_few_and_unresolved_impacts_tell_nothing(measured, words):
    found = told(measured)
    assert words in found.reason
    assert not math.isfinite(found.half_width)


def test_impacts_at_random_are_no_bounces():
    random = np.random.default_rng(3)
    time = np.arange(0.0, 3.0, 1.0 / RATE)
    felt = random.standard_normal(len(time))
    felt[random.choice(len(time), 150, replace=False)] += 1e3
    assert told(Measurement(time, {("acceleration", "x"): felt})).reason


def test_flights_under_a_load_that_changes_are_refused():
    (channel,) = channels(bounces(0.7, noise=1.0))
    size = channel.size.copy()
    for t in impacts(channel)[0]:  # all impacts alike, though flights shrink
        i = round(t * RATE)
        size[i - 2 : i + 3] *= 1e3 / size[i - 2 : i + 3].sum()
    assert "the load is not constant" in flights(replace(channel, size=size)).reason


def test_the_noise_of_records_is_found_beside_impacts():
    measured = bounces(0.8, noise=3.0)
    noise = record_noise(measured.signals["acceleration", "z"][:, None])
    assert noise == pytest.approx(3.0, rel=0.05)


def test_values_are_told_by_statistics_and_strange_measurements_are_seen():
    random = np.random.default_rng(0)
    low, high = np.array([0.0]), np.array([1.0])
    values = design(40, low, high, seed=1)

    def seen(value):
        clean = np.array([2.0 * value, value**2, 0.0])
        return clean + [0.1, 0.1, 1.0] * random.standard_normal(3)

    table = np.array([seen(value) for (value,) in values])
    misses = 0
    for truth in np.linspace(0.1, 0.9, 4):
        found = by_likelihood(values, table, seen(truth), low, high)
        assert not found.strange
        assert 0.02 < found.half_width[0] < 0.25
        misses += abs(found.value[0] - truth) > found.half_width[0]
    assert misses <= 1  # of 4 at 95 %: more happen once in 70 times
    assert by_likelihood(values, table, np.array([1.0, -3.0, 0.0]), low, high).strange


@pytest.mark.parametrize("law", [LankaraniNikravesh(), ZhangSharf()])
def test_the_nominal_restitution_is_that_with_which_the_law_delivers_the_value(law):
    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4, normal=law)
    nominal = nominal_of(bearing, 0.8)
    assert delivered(bearing, nominal) == pytest.approx(0.8, abs=1e-5)
    weakest = delivered(bearing, 1e-3)
    assert math.isnan(nominal_of(bearing, 0.5 * weakest))


def hanging(e, angle=math.pi / 2, end=1.0):
    """An arm whose load turns round; it hangs, so that nothing turns when it bounces."""
    bearing = RevoluteClearance.planar(radial_clearance=1e-4, restitution=e, normal=ZhangSharf())
    return replace(arm(angle, bearing, end), record_every=2, seed=7)


def felt(simulation, kinds=("acceleration",), noise=1.0, rate=2e4, seed=3):
    result = simulation.run(check_step=False)
    noises = dict.fromkeys(kinds, noise)
    return Measurement.from_result(result, rate=rate, noise=noises, kinds=kinds, seed=seed)


@pytest.mark.parametrize("e", [0.6, 0.85])
def test_a_simulated_hanging_arm_tells_its_restitution_by_flights(e):
    simulation = hanging(e)
    guess = replace(simulation, mechanism=hanging(0.3).mechanism)
    for kind in ("acceleration", "reaction"):
        found = identify(guess, felt(simulation, (kind,)))
        (one,) = found.restitutions
        assert one.reason == ""
        assert abs(one.value - e) <= one.half_width < 0.06
        assert found.mechanism.clearance["j"].restitution == pytest.approx(one.value, abs=1e-4)
        assert "clearance and friction: this measurement cannot tell" in str(found)


def test_an_arm_that_is_held_level_does_not_bounce_freely_and_simulations_tell():
    simulation = hanging(0.5, angle=0.0, end=0.5)
    measured = felt(simulation)
    guess = hanging(0.9, angle=0.0, end=0.5)
    (one,) = identify(guess, measured).restitutions
    assert one.reason
    assert "j restitution" in str(one)
    (one,) = identify(guess, measured, runs=20).restitutions
    assert one.reason == ""
    assert abs(one.value - 0.5) <= one.half_width < 0.15


@pytest.mark.thorough
def test_noise_as_large_as_the_impacts_or_another_load_tells_nothing_by_simulations():
    simulation = hanging(0.5, angle=0.0, end=0.5)
    measured = felt(simulation)
    for factor, noise, words in (
        (1.0, 1e3, "impacts exceed the noise"),
        (0.0, 1.0, "0 impacts"),
        (5.0, 1.0, "do not match any simulated machine"),
    ):
        random = np.random.default_rng(0)
        more = np.hypot(noise, 1.0) - 1.0
        signals = {
            key: factor * values + more * random.standard_normal(len(values))
            for key, values in measured.signals.items()
        }
        seen = replace(measured, signals=signals, noise={"acceleration": noise})
        (one,) = by_simulation(simulation, seen, runs=20)
        assert words in one.reason


def test_what_was_found_agrees_with_the_measurement_and_something_else_does_not():
    simulation = hanging(0.7)
    found = identify(replace(simulation, seed=None), felt(simulation))
    checked = verify(replace(simulation, seed=None), found, runs=4)
    assert len(checked.checks) >= 8
    assert checked.agrees, str(checked)
    assert "the identified machine reproduces the measurement" in str(checked)
    joints = {"j": replace(found.mechanism.clearance["j"], restitution=0.3)}
    other = replace(found, mechanism=found.mechanism.with_clearance(joints), restitutions=())
    checked = verify(replace(simulation, seed=None), other, runs=4)
    assert not checked.agrees
    assert "DISAGREES" in str(checked)
    assert json.loads(json.dumps(checked.describe()))["agrees"] is False


def test_verification_refuses_too_few_runs_and_nothing_to_compare():
    simulation = hanging(0.7)
    found = identify(simulation, felt(simulation))
    with pytest.raises(JointplayError, match="at least 3 runs"):
        verify(simulation, found, runs=2)
    blind = replace(found, measured=Measurement(found.measured.time, {}))
    with pytest.raises(JointplayError, match="nothing to compare"):
        verify(simulation, blind)


def test_without_a_signal_of_impacts_the_signal_and_its_rate_are_named():
    mechanism = hanging(0.7).mechanism
    time = np.arange(0.0, 4.0, 0.01)
    angle = 0.4 * np.abs((time % 2.0) - 1.0)
    signals = {
        ("motor", "j"): angle,
        ("tool", "x"): 0.3 * np.cos(angle),
        ("tool", "z"): -0.3 * np.sin(angle),
    }
    text = str(identify(mechanism, Measurement(time, signals)))
    assert "an accelerometer on the tool or 'j reaction' would, with 3.8e+03 records" in text
    few = Measurement(np.arange(24) * 0.02, {("acceleration", "z"): np.ones(24)})
    (one,) = identify(mechanism, few, runs=20).restitutions
    assert "24 records are too few" in one.reason


def test_two_joints_hit_and_an_accelerometer_does_not_say_which():
    bearing = RevoluteClearance.planar(radial_clearance=1e-4)
    links = [("a", "0 1 0", (0, 0, 0), 2.0, (0, 0, 0)), ("b", "0 1 0", (0.3, 0, 0), 2.0, (0, 0, 0))]
    mechanism = serial(links, (0.3, 0, 0), {"a": bearing, "b": bearing})
    shaken = bounces(0.6, noise=1.0)
    found = identify(mechanism, shaken)
    assert all("an impact may belong to any of a, b" in one.reason for one in found.restitutions)
    force = bounces(0.6, noise=1.0, kind="reaction").signals["reaction", "j"]
    both = replace(shaken, signals={**shaken.signals, ("reaction", "b"): force})
    first, second = identify(mechanism, both).restitutions
    assert first.reason
    assert abs(second.value - 0.6) <= second.half_width
    with pytest.raises(JointplayError, match="needs the scenario"):
        identify(mechanism, shaken, runs=40)


@pytest.mark.thorough
def test_a_ur5_whose_rims_strike_in_turn_tells_by_simulations():
    path = Path(__file__).parents[2] / "docs" / "gallery" / "ur5_elbow.toml"
    made = Scenario.load(str(path)).simulation("0.1 mm")
    (name,) = made.mechanism.clearance

    def with_restitution(e):
        bearing = replace(made.mechanism.clearance[name], restitution=e, normal=ZhangSharf())
        mechanism = made.mechanism.with_clearance({name: bearing})
        return replace(made, mechanism=mechanism, duration=0.4, record_every=5, seed=5)

    measured = felt(with_restitution(0.5), noise=0.1, rate=1e4)
    (one,) = identify(with_restitution(0.9), measured, runs=20).restitutions
    assert one.reason == ""
    assert abs(one.value - 0.5) <= one.half_width


def test_loops_tell_restitution_only_and_short_records_cannot():
    made = Scenario.load(str(shipped("slider_crank.toml"))).simulation("0.1 mm")
    short = replace(made, duration=0.012, record_every=10, seed=2)
    measured = felt(short, noise=30.0, rate=5e4)
    found = identify(made, measured, runs=20)
    (one,) = found.restitutions
    assert "95 % interval would be" in one.reason
    assert "loop 'piston_pin'" in str(found)


SCENARIO = """
[robot]
urdf = "robot.urdf"
tool = "tool"

[joints.j]
kind = "planar"
radial_clearance = "0.1 mm"
restitution = {e}
normal = "zhang-sharf"

[motion]
times = [0, "0.3 s"]

[motion.joints]
j = ["90 deg", "90 deg"]

[integration]
start = "centred"
"""


def test_the_command_tells_restitution_verifies_and_writes_both(urdf, tmp_path, capsys):
    urdf(
        body("arm", mass=3.0, com="0.2 0 0"),
        joint("j", "base", "arm", axis="0 1 0"),
        tip("arm", "0.3 0 0"),
    )
    path = tmp_path / "hanging.toml"
    path.write_text(SCENARIO.format(e=0.85))
    made = Scenario.load(str(path)).simulation(None)
    data = tmp_path / "data.csv"
    data.write_text(felt(replace(made, record_every=2), noise=0.1).csv())
    path.write_text(SCENARIO.format(e=0.5))
    order = ["identify", str(path), str(data), "--verify", "4", "--quiet"]
    assert main([*order, "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().out
    assert "j restitution" in said
    assert "the identified machine reproduces the measurement" in said
    kept = json.loads((tmp_path / "out/identified.json").read_text())
    (one,) = kept["unknowns"]
    assert one["low"] <= 0.85 <= one["high"]
    assert kept["verification"]["agrees"] is True
    assert (tmp_path / "out/identified.png").stat().st_size > 5000
    robot = str(tmp_path / "robot.urdf")
    assert main(["identify", robot, str(data), "--joint", "j=0.1 mm", "--verify"]) == 2
    assert "--verify needs a scenario" in capsys.readouterr().err
