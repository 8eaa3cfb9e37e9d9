"""Figures of ISO 9283: points with known figures, and small runs."""

import os
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint, tip
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from jointplay import JointplayError, Mechanism, Motion, RevoluteClearance, Simulation
from jointplay.analysis import traces as traces_module
from jointplay.analysis.iso9283 import figures, iso9283
from jointplay.analysis.scatter import accuracy, estimate, largest, repeatability
from jointplay.analysis.traces import Trace, traces
from jointplay.cli import main

TIME = np.linspace(0.0, 3.0, 3001)
SQUARE = np.array([[1, 1, 0], [1, -1, 0], [-1, 1, 0], [-1, -1, 0.0]])
"""Distance sqrt(2) from the barycentre, each."""


def there_and_back():
    """One metre along x in a second, a second's dwell, and back."""
    return Motion(["a"], [0.0, 1.0, 2.0, 3.0], [[0.0], [1.0], [1.0], [0.0]])


def course(error=(0.0, 0.0, 0.0), motion=None, wobble=0.0, turn=None):
    """A tool that follows the joint along x but for a constant error."""
    place, speed, _ = (motion or there_and_back())(TIME)
    position = np.zeros((len(TIME), 3))
    velocity = np.zeros((len(TIME), 3))
    position[:, 0], velocity[:, 0] = place[:, 0], speed[:, 0]
    position += np.asarray(error)
    position[:, 1] += wobble
    if turn is not None:
        position, velocity = position @ turn.T, velocity @ turn.T
    return Trace(TIME, position, velocity)


def cycles(errors, **options):
    return [course(error, **options) for error in errors]


def test_accuracy_and_repeatability_of_a_square_are_those_of_its_points():
    errors = 1e-4 * SQUARE + [3e-4, 0.0, 4e-4]
    found = figures(cycles(errors), course(), there_and_back())
    first = found.poses[0]
    assert first.ap.value == pytest.approx(5e-4)
    assert [one.value for one in first.axes] == pytest.approx([3e-4, 0.0, 4e-4], abs=1e-12)
    assert first.rp.value == pytest.approx(np.sqrt(2.0) * 1e-4)  # all equally far: S_l is zero


def test_repeatability_is_the_mean_distance_and_three_standard_deviations():
    errors = 1e-4 * np.array([[1, 0, 0], [-1, 0, 0], [0, 3, 0], [0, -3, 0.0]])
    found = figures(cycles(errors), course(), there_and_back())
    spread = np.std([1.0, 1.0, 3.0, 3.0], ddof=1)
    assert found.poses[0].rp.value == pytest.approx(1e-4 * (2.0 + 3.0 * spread))
    assert found.poses[0].ap.value == pytest.approx(0.0, abs=1e-15)


def turned(angles, motion=None):
    """A cycle whose tool is turned by a rotation vector in world axes [rad]."""
    plain = course(motion=motion)
    quaternion = Rotation.from_rotvec(angles).as_quat()[[3, 0, 1, 2]]
    return replace(plain, orientation=np.tile(quaternion, (len(TIME), 1)))


def test_orientation_figures_are_means_and_three_standard_deviations():
    # The commanded tool is turned itself; play turns it further.
    command = Rotation.from_euler("z", 0.8)
    errors = 1e-3 * np.array([[1, 0, 5], [3, 0, 5], [2, 1, 5], [2, -1, 5.0]])
    runs = [turned((Rotation.from_rotvec(error) * command).as_rotvec()) for error in errors]
    found = figures(runs, turned(command.as_rotvec()), there_and_back())
    pose = found.poses[0].orientation
    assert [one.value for one in pose.accuracy] == pytest.approx([2e-3, 0.0, 5e-3], abs=1e-9)
    spread = 3e-3 * np.sqrt(2.0 / 3.0)
    assert [one.value for one in pose.repeatability] == pytest.approx(
        [spread, spread, 0.0], abs=1e-8
    )
    # As much everywhere on the path, where AT is the size of the largest.
    path = found.path_orientation
    assert path.accuracy[2].value == pytest.approx(5e-3)
    assert path.repeatability[0].value == pytest.approx(spread)
    assert "AP_a" in str(found)
    assert "RP_c" in str(found)
    rows = found.csv().splitlines()
    assert any(row.startswith("AP_c,7.2.1,2,0.005,") and row.endswith(",rad") for row in rows)
    assert sum(row.startswith(("AT_", "RT_")) for row in rows) == 8


def test_cycles_whose_orientation_nobody_recorded_have_no_figures_of_it():
    found = figures(cycles(1e-4 * SQUARE), course(), there_and_back())
    assert found.poses[0].orientation is None
    assert found.path_orientation is None
    assert "AP_a" not in found.csv()


def test_a_lag_along_the_path_is_no_error_of_the_path():
    errors = np.array([[2e-4, 0, 0], [3e-4, 0, 0], [4e-4, 0, 0]])
    found = figures(cycles(errors), course(), there_and_back())
    assert found.at.value == pytest.approx(0.0, abs=1e-15)
    assert found.rt.value == pytest.approx(0.0, abs=1e-15)
    assert found.poses[0].ap.value == pytest.approx(3e-4)


def test_path_figures_are_the_largest_across_the_path():
    bump = 1e-4 * np.exp(-(((TIME - 0.5) / 0.1) ** 2))
    errors = 1e-5 * SQUARE[:, [2, 0, 1]]  # across, as the path is along x
    found = figures(cycles(errors, wobble=bump), course(), there_and_back())
    assert found.at.value == pytest.approx(1e-4, rel=1e-2)
    assert found.rt.value == pytest.approx(np.sqrt(2.0) * 1e-5)
    at = found.path_times[found.path_accuracy.argmax()]
    assert at == pytest.approx(0.5, abs=0.02)


def test_one_pose_from_two_directions_has_a_variation():
    motion = Motion(["a"], [0.0, 1.0, 2.0, 3.0], [[0.0], [1.0], [2.0], [1.0]])
    ideal = course(motion=motion)

    def backlash(scatter):
        error = np.where(TIME < 2.0, -1e-4, 1e-4) + scatter
        return Trace(TIME, ideal.position + error[:, None] * [1, 0, 0], ideal.velocity)

    found = figures([backlash(s) for s in (-1e-6, 0.0, 1e-6)], ideal, motion)
    (one,) = found.variations
    assert one.times == pytest.approx((1.0, 3.0))
    assert one.vap.value == pytest.approx(2e-4)


def test_a_pose_reached_from_one_side_only_has_no_variation():
    motion = Motion(["a"], [0.0, 0.5, 1.0, 2.0, 3.0], [[0.0], [1.0], [0.0], [1.0], [1.0]])
    found = figures(cycles(1e-4 * SQUARE, motion=motion), course(motion=motion), motion)
    assert found.variations == ()


def test_a_ringing_tool_settles_when_its_envelope_is_within_the_band():
    motion = there_and_back()
    ideal = course(motion=motion)
    after = np.clip(TIME - 1.0, 0.0, None)
    ring = np.where(TIME >= 1.0, 1e-3 * np.exp(-after / 0.05) * np.sin(2 * np.pi * 40 * after), 0)
    runs = [Trace(TIME, ideal.position + ring[:, None] * [1, 0, 0], ideal.velocity)] * 3
    found = figures(runs, ideal, motion, band=1e-4).poses[0].settling
    # From the first crossing of the band on; the envelope is within it after 0.05 ln 10.
    place = motion(TIME)[0][:, 0]
    crossing = TIME[np.flatnonzero(np.abs(place - 1.0) <= 1e-4)[0]]
    assert crossing + found.time == pytest.approx(1.0 + 0.05 * np.log(10.0), abs=0.0125)
    assert found.overshoot == pytest.approx(np.abs(ring).max(), rel=1e-6)
    assert found.settled == 3


def test_a_tool_that_comes_to_rest_without_ringing_has_no_overshoot():
    found = figures([course()] * 3, course(), there_and_back(), band=1e-4).poses[0].settling
    assert found.overshoot == 0.0
    assert found.time == 0.0


@given(
    shift=st.floats(-1.0, 1.0), size=st.floats(1e-6, 1e-2), seed=st.integers(0, 1000)
)  # fmt: skip
def test_repeatability_knows_no_place_and_scales_with_the_scatter(shift, size, seed):
    points = np.random.default_rng(seed).normal(size=(8, 2, 3))
    plain = repeatability(points)
    assert repeatability(size * points + shift) == pytest.approx(size * plain, rel=1e-6)
    aside = np.array([0.0, 0.0, shift])
    assert accuracy(points + aside) == pytest.approx(
        np.linalg.norm(points.mean(axis=0) + aside, axis=-1)
    )


def test_the_interval_covers_the_true_accuracy_about_as_often_as_it_says():
    random = np.random.default_rng(4)
    true = np.array([1e-3, 2e-3, -1e-3])
    inside = 0
    for _ in range(40):
        points = true + 1e-4 * random.normal(size=(30, 1, 3))
        one = estimate(points, largest(accuracy))
        inside += one.low <= np.linalg.norm(true) <= one.high
    assert 33 <= inside <= 40


def test_equal_cycles_have_an_interval_of_no_width():
    found = figures([course((1e-4, 0, 0))] * 3, course(), there_and_back()).poses[0]
    assert (found.ap.low, found.ap.high) == pytest.approx((1e-4, 1e-4))
    assert found.rp.value == pytest.approx(0.0, abs=1e-15)


def test_cycles_recorded_at_other_times_are_refused():
    other = Trace(TIME + 1e-3, course().position, course().velocity)
    with pytest.raises(JointplayError, match="same times"):
        figures([other] * 3, course(), there_and_back())


@pytest.fixture
def arm(urdf):
    """A pendulum about y whose tool is half a metre away."""
    return urdf(
        body("one", com="0.2 0 0"),
        joint("a", "base", "one", axis="0 1 0"),
        tip("one"),
    )


PLAY = 1e-4


def pendulum(arm, clearance=True, **options):
    play = {"a": RevoluteClearance.planar(radial_clearance=PLAY)} if clearance else {}
    motion = Motion(["a"], [0.0, 0.15, 0.3], [[0.0], [0.1], [0.1]])
    return Simulation(Mechanism(arm, play, tool="tool"), motion, **({"record_every": 50} | options))


def test_a_pendulum_hangs_in_its_bearing_by_its_clearance(arm):
    found = iso9283(pendulum(arm), 3)
    stop = found.poses[-1]
    # At rest the journal lies on the bore: down by the clearance, a little deeper as it gives way.
    assert stop.axes[2].value == pytest.approx(-PLAY, rel=0.15)
    assert stop.ap.value == pytest.approx(PLAY, rel=0.15)
    assert stop.rp.value < 0.5 * PLAY
    # Its axis cannot lean, and the drive holds its angle.
    assert [one.value for one in stop.orientation.accuracy] == pytest.approx([0.0] * 3, abs=1e-4)
    assert "simulated cycles" in str(found)
    assert "asks for 30" in str(found)


def test_runs_that_are_kept_are_not_done_again(arm, tmp_path, monkeypatch):
    simulation = pendulum(arm, duration=0.02)
    first = traces([simulation], keep=tmp_path)
    monkeypatch.setattr(traces_module, "_run", lambda _: pytest.fail("run again"))
    again = traces([simulation], keep=tmp_path)
    assert np.array_equal(first[0].position, again[0].position)


def test_a_damaged_kept_run_is_done_again(arm, tmp_path):
    simulation = pendulum(arm, duration=0.02)
    first = traces([simulation], keep=tmp_path)
    (kept,) = tmp_path.glob("*.npz")
    kept.write_bytes(kept.read_bytes()[:100])
    assert np.array_equal(traces([simulation], keep=tmp_path)[0].position, first[0].position)


def test_processes_find_what_one_finds(arm):
    runs = [pendulum(arm, duration=0.02, seed=seed) for seed in (1, 2)]
    for one, other in zip(traces(runs), traces(runs, jobs=2), strict=True):
        assert np.array_equal(one.position, other.position)


@pytest.mark.parametrize(
    ("make", "count", "says"),
    [
        (pendulum, 2, "at least 3 cycles"),
        (pendulum, 2.5, "at least 3 cycles"),
        (lambda arm: pendulum(arm, clearance=False), 3, "has play"),
        (lambda arm: Simulation(pendulum(arm).mechanism, duration=0.1), 3, "has none"),
    ],
)
def test_what_has_no_such_figures_is_refused(arm, make, count, says):
    with pytest.raises(JointplayError, match=says):
        iso9283(make(arm), count)


def test_the_command_writes_table_figures_and_goes_on(arm, tmp_path, capsys):
    motion = tmp_path / "motion.csv"
    motion.write_text("time_s,a\n0,0\n0.05,0.02\n0.1,0.02\n")
    out = tmp_path / "out"
    order = ["iso9283", str(arm), "--joint", "a", "--motion", str(motion), "--cycles", "3"]
    order += ["--out", str(out), "--jobs", "1", "--quiet", "--tool", "tool"]
    assert main(order) == 0
    assert "RP_l" in capsys.readouterr().out
    names = sorted(os.listdir(out))
    assert names == ["cycles", "iso9283.csv", "path.png", "poses.png"]
    assert len(list((out / "cycles").glob("*.npz"))) == 4
    rows = (out / "iso9283.csv").read_text().splitlines()
    assert rows[0] == "figure,clause,time_s,value,low,high,unit"
    assert any(row.startswith("RT_p,8.3") for row in rows)
    assert any(row.startswith("RP_b,7.2.2") for row in rows)


def test_the_command_says_in_one_line_what_is_wrong(arm, capsys):
    assert main(["iso9283", str(arm), "--joint", "a", "--cycles", "1", "--quiet"]) == 2
    assert "at least 3 cycles" in capsys.readouterr().err
