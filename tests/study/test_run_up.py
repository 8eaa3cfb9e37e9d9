"""Run-ups of cranks: the motion, and spectra over the crank angle."""

import dataclasses

import numpy as np
import pytest

import jointplay as jp
from jointplay.cli import main
from jointplay.study.nonlinear.run_up import RunUp


def test_speed_ramps_have_the_speeds_that_were_meant_and_go_on():
    motion = jp.Motion(["a"], [0.0, 1.0, 3.0], [[0.5], [2.5], [12.5]], "speed-ramps")
    time = np.array([-0.5, 0.0, 0.5, 1.0, 2.0, 3.0, 4.0])
    position, speed, acceleration = (values[:, 0] for values in motion(time))
    np.testing.assert_allclose(speed, [2.0, 2.0, 2.0, 2.0, 5.0, 8.0, 8.0], atol=1e-12)
    np.testing.assert_allclose(position, [-0.5, 0.5, 1.5, 2.5, 6.0, 12.5, 20.5], atol=1e-12)
    np.testing.assert_allclose(acceleration[[0, 2, 4, 6]], [0.0, 0.0, 3.0, 0.0], atol=1e-12)
    assert motion.still_from == np.inf
    assert jp.Motion.from_description(motion.describe()) == motion


def crank(rpm, **options):
    scenario = jp.Scenario.load("jointplay:slider_crank.toml")
    found = scenario.simulation("ideal", {"motion": {"speeds": {"crank_pin": f"{rpm} rpm"}}})
    return dataclasses.replace(found, step=1e-5, **options)


def test_a_run_up_rises_over_the_turns_that_were_asked_for():
    rising = RunUp.of(crank(1000), crank(3000), 2, 10, 100)
    motion = rising.simulation.motion
    end = motion.duration
    position, speed, _ = (values[:, 0] for values in motion(np.array([0.0, end])))
    assert abs(position[1] - position[0]) == pytest.approx(12 * 2.0 * np.pi)
    np.testing.assert_allclose(np.abs(speed), np.array([1000, 3000]) * 2.0 * np.pi / 60.0)
    found = rising.speeds(3, 2)
    assert (np.diff(found) > 0.0).all()
    # At constant acceleration the square of the speed rises evenly with the angle.
    low, high = (w * 2.0 * np.pi / 60.0 for w in (1000.0, 3000.0))
    expected = np.sqrt(low**2 + (high**2 - low**2) * np.array([1.0, 5.0, 9.0]) / 10.0)
    np.testing.assert_allclose(found, expected, rtol=1e-4)


def test_orders_stay_where_they_are_while_the_speed_rises():
    """The slider's position in an ideal slider-crank has the same orders at any speed."""
    rising = RunUp.of(crank(1000), crank(3000), 1, 12, 200)
    values = rising.over_angle(rising.run(), "guide.position")
    order, found = rising.spectra(values, 3, 4, 5.0)
    np.testing.assert_allclose(order, np.arange(21) / 4)
    arm, rod = 0.05, 0.12
    angle = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
    place = arm * np.cos(angle) + np.sqrt(rod**2 - (arm * np.sin(angle)) ** 2)
    expected = 2.0 * np.abs(np.fft.rfft(place))[1:6] / len(place)
    for row in found:
        np.testing.assert_allclose(row[[4, 8]], expected[[0, 1]], rtol=1e-3)
        assert row[[2, 10]].max() < 1e-2 * expected[1]  # nothing between whole orders


COMMAND = ["study", "dynamics", "jointplay:slider_crank.toml", "runup", "--case", "0.5 mm"]


@pytest.mark.parametrize(
    ("speeds", "more", "words"),
    [
        ("-1000:1000:2 rpm", (), "a run-up needs two speeds of the same direction"),
        ("1000:2000:3 rpm", ("--window", "9"), "a window of 9 turns does not fit into 4 turns"),
    ],
)
def test_a_run_up_that_cannot_be_is_refused(speeds, more, words, tmp_path, capsys):
    vary = ["--vary", f"motion.speeds.crank_pin={speeds}", "--out", str(tmp_path / "o")]
    assert main([*COMMAND, "--keep", "4", *vary, *more]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.usefixtures("checked_figures")
def test_the_command_draws_a_run_up(tmp_path, capsys):
    options = ["--keep", "6", "--leave-out", "1", "--records", "100", "--window", "2"]
    options += ["--orders", "10", "--quiet", "--jobs", "1"]
    vary = ["--vary", "motion.speeds.crank_pin=1000:3000:4 rpm", "--set", "integration.step=5 us"]
    assert main([*COMMAND, *options, *vary, "--out", str(tmp_path)]) == 0
    assert "4 windows of 2 turns, 1" in capsys.readouterr().out
    assert (tmp_path / "runup.png").read_bytes()[:4] == b"\x89PNG"
