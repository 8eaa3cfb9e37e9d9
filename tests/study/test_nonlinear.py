"""Sections, exponents, recurrence and spectra of motions for which they are known."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import jointplay as jp
from jointplay import cli
from jointplay.scenario import Scenario
from jointplay.show.plots import nonlinear as plots
from jointplay.study.nonlinear import lyapunov, poincare, steady_motion
from jointplay.study.nonlinear.poincare import attractors, once_per_turn, repeats_after
from jointplay.study.nonlinear.rows import Varied


def logistic(r, number, start=0.3, settle=2000):
    found = []
    x = start
    for k in range(settle + number):
        x = r * x * (1.0 - x)
        if k >= settle:
            found.append(x)
    return np.array(found)


def duffing(force, turns, start=(0.1, 0.0), settle=0, per_turn=1):
    """x'' + 0.3 x' - x + x^3 = force cos(1.2 t): a classic double well."""
    period = 2.0 * math.pi / 1.2
    times = np.arange(settle * per_turn, (settle + turns) * per_turn) * period / per_turn
    found = solve_ivp(
        lambda t, y: (y[1], y[0] - y[0] ** 3 - 0.3 * y[1] + force * math.cos(1.2 * t)),
        (0.0, times[-1] + 1e-9), start, "DOP853", t_eval=times, rtol=1e-9,
        atol=1e-11,
    )  # fmt: skip
    return found.y.T


@pytest.mark.parametrize(
    ("r", "period"),
    [(2.8, 1), (2.99, 1), (3.01, 2), (3.5, 4), (3.83, 3), (3.55, 8), (3.7, None), (4.0, None)],
)
def test_logistic_map_repeats_after_the_turns_of_its_window_or_not_at_all(r, period):
    settle = 20000 if abs(r - 3.0) < 0.1 else 2000
    assert repeats_after(logistic(r, 60, settle=settle), 1e-6 if period else 1e-3) == period


@pytest.mark.parametrize(
    ("advance", "start", "known"),
    [
        (lambda x: 4.0 * x * (1.0 - x), [0.3], math.log(2.0)),
        (lambda x: 2.5 * x * (1.0 - x), [0.3], math.log(0.5)),  # |f'| = |2 - r| at the fixed point
        (lambda s: np.array([1.0 - 1.4 * s[0] ** 2 + s[1], 0.3 * s[0]]), [0.1, 0.1], 0.419),
    ],
    ids=["logistic, 4", "logistic, 2.5", "Henon (Sprott, 2003)"],
)
def test_exponents_of_maps_are_those_that_are_known(advance, start, known):
    grown = lyapunov.growths(advance, np.array(start), 20000, 1e-8)[200:]
    found = lyapunov.exponent(grown, 1.0)
    assert found.value == pytest.approx(known, abs=0.01)
    assert found.low - 1e-3 <= known <= found.high + 1e-3
    assert found.verdict == ("chaotic" if known > 0.0 else "regular")


def test_interval_of_confidence_holds_the_truth_as_often_as_it_says():
    random = np.random.default_rng(1)
    found = [lyapunov.exponent(random.normal(size=100), 1.0, 0.9) for _ in range(500)]
    assert 0.86 < np.mean([one.low <= 0.0 <= one.high for one in found]) < 0.94


@pytest.mark.thorough
def test_a_weakly_driven_duffing_ends_in_two_wells_and_a_strongly_driven_one_nowhere():
    starts = [(1.0, 0.0), (-1.0, 0.0), (1.2, 0.1), (-0.8, 0.1)]
    sections = [duffing(0.1, 12, start, settle=60) for start in starts]
    chaos = duffing(0.5, 60, settle=40)
    assert repeats_after(chaos, 1e-2) is None
    labels, orbits = attractors([*sections, chaos], 1e-3)
    assert labels.tolist() == [0, 1, 0, 1, -1]
    assert [len(orbit) for orbit in orbits] == [1, 1]


def test_orbits_that_begin_in_another_turn_are_the_same():
    swap = np.array([[0.0], [1.0]] * 6)
    labels, orbits = attractors([swap, swap[1:], np.zeros((9, 1))], 1e-6)
    assert labels.tolist() == [0, 0, 1]
    assert [len(orbit) for orbit in orbits] == [2, 1]


@given(
    per_turn=st.integers(4, 60), turns=st.integers(9, 20), phase=st.floats(0.0, 0.999),
    period=st.integers(1, 3),
)  # fmt: skip
def test_a_section_has_as_many_points_as_the_motion_has_turns(per_turn, turns, phase, period):
    time = np.arange(per_turn * turns) / per_turn
    points = once_per_turn(np.sin(2.0 * np.pi * time / period + 0.3), per_turn, phase)
    assert len(points) == turns
    assert repeats_after(points, 1e-6) == period


def test_periodic_motion_recurs_along_diagonals_a_period_apart():
    angle = 2.0 * np.pi * np.arange(200) / 40
    near = poincare.recurrence(np.stack([np.cos(angle), np.sin(angle)], 1), 0.01)
    gaps = {int(k) for k in np.flatnonzero(near[0])}
    assert gaps == {0, 40, 80, 120, 160}
    assert poincare.determinism(near) == 1.0
    assert poincare.rate(near) == pytest.approx(2 * (160 + 120 + 80 + 40) / (200 * 199))


def test_noise_is_less_deterministic_than_a_circle_and_chaos_between():
    random = np.random.default_rng(0)
    noise = poincare.recurrence(random.uniform(size=400), 0.03)
    chaos = poincare.recurrence(logistic(3.9, 400), 0.03)
    assert poincare.determinism(noise) < poincare.determinism(chaos) < 1.0


@given(
    order=st.integers(1, 15), amplitude=st.floats(1e-6, 1e6), mean=st.floats(-1e3, 1e3),
    shift=st.floats(0.0, 6.0),
)  # fmt: skip
def test_harmonic_shows_its_amplitude_at_its_order(order, amplitude, mean, shift):
    time = np.arange(8 * 64) / 64
    values = amplitude * np.cos(2.0 * np.pi * order * time + shift)
    at, found = steady_motion.orders(values + mean * amplitude, 8, 20.0)
    assert at[-1] == 20.0
    assert found[at == order] == pytest.approx(amplitude, rel=1e-6)
    assert at[found.argmax()] == order
    far = np.abs(at - order) > 0.2
    assert found[far].max() < 1e-6 * amplitude


def crank(**changes):
    scenario = Scenario.load("jointplay:slider_crank.toml")
    return scenario.simulation("0.2 mm", {"integration": {"step": 2e-6}, **changes})


def test_a_turn_has_a_whole_number_of_steps_not_longer_than_asked():
    turning = steady_motion.Turning.of(crank(), 2, 3, records=700)
    simulation = turning.simulation
    every = simulation.record_every
    assert simulation.step <= 2e-6
    assert turning.turn == pytest.approx(60.0 / 5000.0, rel=1e-12)
    assert 700 * every * simulation.step == pytest.approx(turning.turn, rel=1e-12)
    assert simulation.duration == pytest.approx(5 * turning.turn)


def test_repeated_motion_goes_through_its_waypoints_each_time():
    motion = jp.Motion(["a"], [0.0, 1.0, 3.0], [[0.0], [2.0], [0.0]])
    twice = steady_motion.repeated(motion, 2)
    assert twice.duration == 6.0
    at = np.linspace(0.0, 3.0, 50)
    assert twice(at + 3.0)[0] == pytest.approx(motion(at)[0], abs=1e-12)
    turning = crank().motion
    assert steady_motion.repeated(turning, 9) is turning


@pytest.mark.parametrize(
    ("ask", "says"),
    [
        (lambda: once_per_turn(np.zeros(10), 5, 1.0), r"phase must be in \[0, 1\) turns, got 1"),
        (lambda: poincare.recurrence(np.zeros(4001)), "takes 2 to 4000 points, got 4001"),
        (lambda: steady_motion.turn(jp.Motion(["a"], [0.0, 1.0], [[0.0], [2.0]])),
         "'a' ends 2 rad or m from where it began"),
    ],
)  # fmt: skip
def test_what_has_no_turns_or_recurrence_is_refused(ask, says):
    with pytest.raises(jp.JointplayError, match=says):
        ask()


@pytest.mark.parametrize("file", ["slider_crank", "scara"])
def test_journal_begins_where_it_was_put(file):
    scenario = Scenario.load(f"jointplay:{file}.toml")
    run = jp.Run(scenario.simulation("0.2 mm", {"integration": {"start": "centred"}}))
    joint = next(iter(run.mechanism.clearance))
    steady_motion.place(joint, 0.9e-4, -0.5e-4, run)
    run.begin()
    assert run.moment().journal(joint)[0][:2] == pytest.approx([0.9e-4, -0.5e-4], abs=1e-9)


def test_ideal_slider_crank_gives_one_point_and_the_closed_form():
    simulation = crank(joints={"piston_pin": {"ideal": True}}, integration={"integrator": "rk4"})
    turning = steady_motion.Turning.of(simulation, 1, 3, records=400)
    kept = turning.observed(turning.run(), ["guide.acceleration", "guide.position"])
    assert repeats_after(once_per_turn(kept[:-1], 400), 1e-3 * np.ptp(kept[:, 0])) == 1
    angle = 2.0 * np.pi * np.arange(len(kept)) / 400
    exact = 0.05 * np.cos(angle) + np.sqrt(0.12**2 - (0.05 * np.sin(angle)) ** 2)
    assert kept[:, 1] == pytest.approx(exact, abs=1e-8)


@pytest.mark.parametrize(
    ("text", "label"),
    [
        ("joints.piston_pin.radial_clearance=0.1:0.5:3 mm", "radial clearance of piston_pin [mm]"),
        ("motion.speeds.crank_pin=500:5000:3 rpm", "speed of crank_pin [rpm]"),
        ("joints.piston_pin.restitution=0.5:0.9:3", "restitution of piston_pin [SI unit]"),
    ],
)
def test_axes_of_figures_have_words_and_units(text, label):
    assert Varied.parse(text).label == label


def test_a_bifurcation_names_quantity_unit_and_turns(tmp_path, monkeypatch):
    drawn, made = [], plots.figure
    monkeypatch.setattr(plots, "figure", lambda found: drawn.append(made(found)) or drawn[-1])
    status = cli.main(
        ["study", "dynamics", "jointplay:slider_crank.toml", "bifurcation", "--case", "0.2 mm",
         "--leave-out", "1", "--keep", "2",
         "--vary", "joints.piston_pin.radial_clearance=0.1:0.2:2 mm", "--out",
         str(tmp_path / "out"), "--quiet", "--jobs", "1"]
    )  # fmt: skip
    assert status == 0
    (axes,) = drawn[0].axes
    assert axes.get_xlabel() == "radial clearance of piston_pin [mm]"
    assert axes.get_ylabel() == "acceleration of guide [m/s²], once a turn"
    caption = drawn[0]._supxlabel.get_text().replace("\n", " ")
    assert "turns 2 to 3 at each of 2 values" in caption


def test_decades_of_a_waterfalls_colours_are_plain_text():
    amplitudes = np.geomspace(1.0, 1e4, 30).reshape(3, 10)
    figure = plots.waterfall(
        np.arange(3.0), np.arange(10.0), amplitudes, "speed [rpm]", "force [N]"
    )
    figure.canvas.draw()
    labels = [text.get_text() for axes in figure.axes for text in axes.get_yticklabels()]
    assert "10⁴" in labels
    assert not any("$" in label for label in labels)
    assert figure.axes[0].get_title() == "tallest peak: 1e+04 N"
