"""Figures of ISO 9283: points with known figures, and small runs."""

import os
import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from conftest import body, joint, tip
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from jointplay import JointplayError, Mechanism, Motion, RevoluteClearance, Simulation
from jointplay.cli import main
from jointplay.study import courses as traces_module
from jointplay.study.courses import Trace, traces
from jointplay.study.iso9283 import (
    Cycles,
    accuracy,
    bootstrap,
    cube_motion,
    cube_poses,
    drift,
    figures,
    iso9283,
    largest,
    repeatability,
    what_drifts,
)

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
    assert first.figures["AP_p"].value == pytest.approx(5e-4)
    assert [first.figures[f"AP_{axis}"].value for axis in "xyz"] == pytest.approx(
        [3e-4, 0.0, 4e-4], abs=1e-12
    )
    assert first.figures["RP_l"].value == pytest.approx(
        np.sqrt(2.0) * 1e-4
    )  # all equally far: S_l is zero


def test_repeatability_is_the_mean_distance_and_three_standard_deviations():
    errors = 1e-4 * np.array([[1, 0, 0], [-1, 0, 0], [0, 3, 0], [0, -3, 0.0]])
    found = figures(cycles(errors), course(), there_and_back())
    spread = np.std([1.0, 1.0, 3.0, 3.0], ddof=1)
    assert found.poses[0].figures["RP_l"].value == pytest.approx(1e-4 * (2.0 + 3.0 * spread))
    assert found.poses[0].figures["AP_p"].value == pytest.approx(0.0, abs=1e-15)


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
    pose = found.poses[0].figures
    assert [pose[f"AP_{angle}"].value for angle in "abc"] == pytest.approx(
        [2e-3, 0.0, 5e-3], abs=1e-9
    )
    spread = 3e-3 * np.sqrt(2.0 / 3.0)
    assert [pose[f"RP_{angle}"].value for angle in "abc"] == pytest.approx(
        [spread, spread, 0.0], abs=1e-8
    )
    # As much everywhere on the path, where AT is the size of the largest.
    assert found.path["AT_c"].value == pytest.approx(5e-3)
    assert found.path["RT_a"].value == pytest.approx(spread)
    assert "AP_a" in str(found)
    assert "RP_c" in str(found)
    rows = found.table.csv(6).splitlines()
    assert any(row.startswith("AP_c,7.2.1,2,0.005,") and row.endswith(",rad") for row in rows)
    assert sum(row.startswith(("AT_", "RT_")) for row in rows) == 8


def test_cycles_whose_orientation_nobody_recorded_have_no_figures_of_it():
    found = figures(cycles(1e-4 * SQUARE), course(), there_and_back())
    assert "AP_a" not in found.poses[0].figures
    assert list(found.path) == ["AT_p", "RT_p"]
    assert "AP_a" not in found.table.csv(6)


def test_a_lag_along_the_path_is_no_error_of_the_path():
    errors = np.array([[2e-4, 0, 0], [3e-4, 0, 0], [4e-4, 0, 0]])
    found = figures(cycles(errors), course(), there_and_back())
    assert found.path["AT_p"].value == pytest.approx(0.0, abs=1e-15)
    assert found.path["RT_p"].value == pytest.approx(0.0, abs=1e-15)
    assert found.poses[0].figures["AP_p"].value == pytest.approx(3e-4)


def test_path_figures_are_the_largest_across_the_path():
    bump = 1e-4 * np.exp(-(((TIME - 0.5) / 0.1) ** 2))
    errors = 1e-5 * SQUARE[:, [2, 0, 1]]  # across, as the path is along x
    found = figures(cycles(errors, wobble=bump), course(), there_and_back())
    assert found.path["AT_p"].value == pytest.approx(1e-4, rel=1e-2)
    assert found.path["RT_p"].value == pytest.approx(np.sqrt(2.0) * 1e-5)
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
    assert one.figures["vAP_p"].value == pytest.approx(2e-4)


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


def test_distance_figures_are_the_mean_excess_and_three_standard_deviations():
    # Two stops a metre apart along x; the first is attained exactly, the second off along x.
    motion, ideal = there_and_back(), course()
    excess = 1e-4 * np.array([1.0, 2.0, 3.0, 6.0])
    runs = []
    for x in excess:
        off = np.where(TIME > 0.5, x, 0.0)  # at 1 m until 2 s, and back at the start at 3 s
        off = np.where(TIME > 2.5, 0.0, off)
        runs.append(Trace(TIME, ideal.position + off[:, None] * [1, 0, 0], ideal.velocity))
    (one,) = figures(runs, ideal, motion).distances
    assert one.command == pytest.approx(1.0)
    # From 1 m (+ excess) back to 0: the distance is 1 + excess, its x component -1 - excess.
    assert one.figures["AD_p"].value == pytest.approx(3e-4)
    spread = 3.0 * np.std(excess, ddof=1)
    assert one.figures["RD_p"].value == pytest.approx(spread)
    assert one.figures["AD_x"].value == pytest.approx(-3e-4)
    assert one.figures["RD_x"].value == pytest.approx(spread)
    assert one.figures["AD_y"].value == pytest.approx(0.0, abs=1e-15)
    rows = figures(runs, ideal, motion).table.csv(6).splitlines()
    assert any(row.startswith("AD_p,7.3,2 3,0.0003,") for row in rows)
    assert re.search("AD_p +distance accuracy +0.3 mm", str(figures(runs, ideal, motion)))


def test_a_common_displacement_is_no_error_of_a_distance():
    found = figures(cycles(1e-4 * SQUARE + [3e-4, 1e-4, 0]), course(), there_and_back())
    (one,) = found.distances
    assert one.figures["AD_p"].value == pytest.approx(0.0, abs=1e-12)
    assert one.figures["RD_p"].value == pytest.approx(0.0, abs=1e-12)


def around_a_corner():
    """One metre along x in a second, at once one metre along y; its joints, and its tool."""
    motion = Motion(["a", "b"], [0.0, 1.0, 2.0], [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0]])
    place, speed, _ = motion(TIME)
    still = np.zeros((len(TIME), 1))
    return motion, Trace(TIME, np.hstack([place, still]), np.hstack([speed, still]))


def test_a_rounded_corner_is_missed_by_what_its_arc_leaves_out():
    motion, ideal = around_a_corner()
    radius = 0.01
    position = ideal.position.copy()
    middle = np.array([1.0 - radius, radius, 0.0])
    inside = (position[:, 0] > 1.0 - radius) & (position[:, 1] < radius)
    towards = position[inside] - middle
    # Points of the corner are drawn to the arc of a circle about `middle`.
    arc = middle + radius * towards / np.linalg.norm(towards, axis=1, keepdims=True)
    position[inside] = arc
    (corner,) = figures([Trace(TIME, position, ideal.velocity)] * 3, ideal, motion).corners
    assert corner.time == pytest.approx(1.0)
    assert corner.angle == pytest.approx(np.pi / 2)
    assert corner.figures["CR"].value == pytest.approx(radius * (np.sqrt(2.0) - 1.0), rel=1e-3)
    assert corner.figures["CO"].value == pytest.approx(
        0.0, abs=1e-9
    )  # an arc inside is no overshoot


def test_a_tool_that_goes_on_after_a_corner_overshoots_by_as_much():
    motion, ideal = around_a_corner()
    after = np.clip(TIME - 1.0, 0.0, None)
    runs = []
    for size in (1e-4, 3e-4, 2e-4):
        on = size * np.exp(-0.5 * ((after - 0.3) / 0.05) ** 2) * (TIME > 1.0)
        back = -5e-4 * np.exp(-0.5 * ((after - 0.7) / 0.05) ** 2)  # on the inner side
        wave = (on + back * (TIME > 1.0))[:, None] * [1, 0, 0]
        runs.append(Trace(TIME, ideal.position + wave, ideal.velocity))
    found = figures(runs, ideal, motion)
    (corner,) = found.corners
    assert corner.overshoot == pytest.approx([1e-4, 3e-4, 2e-4], rel=1e-3)
    assert corner.figures["CO"].value == pytest.approx(3e-4, rel=1e-3)
    assert corner.figures["CR"].value == pytest.approx(0.0, abs=1e-9)
    assert re.search("CO +cornering overshoot +0.3 mm", str(found))


def test_a_way_back_on_itself_has_no_corner():
    found = figures([course()] * 3, course(), there_and_back())
    assert found.corners == ()
    assert "no corner" in str(found)


def test_drift_is_the_change_of_accuracy_and_repeatability():
    square = 1e-4 * SQUARE
    attained = np.stack([np.add(square, [3e-4, 0, 4e-4]), np.add(2 * square, [0, 0, 1e-4])])
    found = drift([0.0, 8 * 3600.0], attained)
    assert found.ap == pytest.approx([5e-4, 1e-4])
    scatter = np.sqrt(2.0) * 1e-4
    assert [one.value for one in found.figures.values()] == pytest.approx(
        [4e-4, scatter, 3e-4, 0.0, 3e-4]
    )
    assert list(found.figures) == ["dAP_p", "dRP_l", "dAP_x", "dAP_y", "dAP_z"]


@pytest.mark.parametrize(
    ("times", "shape", "says"),
    [
        ([0.0], (1, 4, 3), "at least two increasing times"),
        ([0.0, 0.0], (2, 4, 3), "at least two increasing times"),
        ([0.0, 1.0], (3, 4, 3), r"shape \(2, cycles, 3\)"),
        ([0.0, 1.0], (2, 2, 3), "at least 3 cycles"),
    ],
)
def test_a_drift_of_nothing_is_refused(times, shape, says):
    with pytest.raises(JointplayError, match=says):
        drift(times, np.zeros(shape))


def test_the_standard_asks_for_other_cycles_for_each_kind_of_figure():
    asked = Cycles()
    assert (asked.pose, asked.path, asked.settling, asked.cornering) == (30, 10, 3, 3)
    assert Cycles.up_to(40) == Cycles(40, 10, 3, 3)
    assert Cycles.up_to(5) == Cycles(5, 5, 3, 3)
    assert asked.fewer == []
    assert Cycles.up_to(5).fewer == ["30 for pose", "10 for path"]
    with pytest.raises(JointplayError, match="settling = 0"):
        Cycles(settling=0)


def test_each_figure_is_of_its_own_number_of_cycles():
    # Later cycles are worse; path and settling figures look at the first ones only.
    sizes = 1e-4 * np.arange(1, 7)
    motion, ideal = there_and_back(), course()
    after = np.clip(TIME - 1.0, 0.0, None)
    ring = np.where(TIME >= 1.0, np.exp(-after / 0.05) * np.sin(2 * np.pi * 40 * after), 0)
    runs = [
        Trace(TIME, ideal.position + np.outer(ring, [s, 0, 0]) + [0, 0, s], ideal.velocity)
        for s in sizes
    ]
    found = figures(runs, ideal, motion, band=1e-6, cycles=Cycles(6, 4, 2, 1))
    assert found.poses[0].attained.shape == (6, 3)
    assert found.poses[0].figures["AP_p"].value == pytest.approx(sizes.mean())
    assert found.path["AT_p"].value == pytest.approx(sizes[:4].mean())
    assert found.poses[0].settling.overshoot == pytest.approx(
        sizes[1] * np.abs(ring).max(), rel=1e-6
    )
    assert "6 for poses and distances, 4 for the path, 2 for" in str(found)
    with pytest.raises(JointplayError, match="6 cycles are requested, but there are only 3"):
        figures(runs[:3], ideal, motion, cycles=Cycles(6, 3, 1, 1))


def test_the_poses_of_the_test_lie_on_the_diagonals_of_a_diagonal_plane():
    centre, edge = np.array([1.0, 2.0, 3.0]), 0.5
    places = cube_poses(centre, edge)
    assert places[0] == pytest.approx(centre)
    assert np.linalg.norm(places[1:] - centre, axis=1) == pytest.approx(0.4 * np.sqrt(3.0) * edge)
    assert np.abs(places - centre).max() < 0.5 * edge
    assert (places[:, 0] - centre[0]) == pytest.approx(places[:, 2] - centre[2])  # one plane
    # P2 and P4, P3 and P5 are opposite ends of diagonals.
    assert places[1] + places[3] == pytest.approx(2 * centre)
    assert places[2] + places[4] == pytest.approx(2 * centre)


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
        one = bootstrap(points, largest(accuracy))
        inside += one.low <= np.linalg.norm(true) <= one.high
    assert 33 <= inside <= 40


def test_equal_cycles_have_an_interval_of_no_width():
    found = figures([course((1e-4, 0, 0))] * 3, course(), there_and_back()).poses[0]
    assert (found.figures["AP_p"].low, found.figures["AP_p"].high) == pytest.approx((1e-4, 1e-4))
    assert found.figures["RP_l"].value == pytest.approx(0.0, abs=1e-15)


def test_cycles_recorded_at_other_times_are_refused():
    other = Trace(TIME + 1e-3, course().position, course().velocity)
    with pytest.raises(JointplayError, match="recorded at the times of"):
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
    (stop,) = found.poses  # the rest from 0.15 to 0.3 s is one stop
    # At rest the journal lies on the bore: down by the clearance, a little deeper as it gives way.
    assert stop.figures["AP_z"].value == pytest.approx(-PLAY, rel=0.15)
    assert stop.figures["AP_p"].value == pytest.approx(PLAY, rel=0.15)
    assert stop.figures["RP_l"].value < 0.5 * PLAY
    # Its axis cannot lean, and the drive holds its angle.
    assert [stop.figures[f"AP_{angle}"].value for angle in "abc"] == pytest.approx(
        [0.0] * 3, abs=1e-4
    )
    assert "simulated cycles" in str(found)
    assert "asks for 30 for pose, 10 for path" in str(found)
    assert "conditions: load: none" in str(found)
    assert "nothing in this model drifts" in str(found)


def test_speed_and_load_are_conditions_of_the_test(arm):
    found = iso9283(pendulum(arm, clearance=True), 3, speed=0.5, load=2.0)
    assert [pose.time for pose in found.poses] == pytest.approx([0.6])  # twice as late
    words = str(found.conditions)
    assert "2 kg at 'tool' (taken for 100 %)" in words
    assert "speed: 50 %" in words


@pytest.mark.thorough
def test_a_bore_that_wears_lets_the_pose_drift(arm):
    play = RevoluteClearance.planar(radial_clearance=PLAY, wear_rate=1e-12)
    motion = Motion(["a"], [0.0, 0.15, 0.3], [[0.0], [0.1], [0.1]])
    simulation = Simulation(Mechanism(arm, {"a": play}, tool="tool"), motion, record_every=50)
    assert "wear of 'a'" in what_drifts(simulation)
    found = iso9283(simulation, 3, drift_time=3600.0)
    course = found.drifts[-1]
    # It hangs in its bearing: worn, the bore lets it hang lower, and ever lower.
    assert (np.diff(course.axes[:, 2]) < 0.0).all()
    change = {symbol: one.value for symbol, one in course.figures.items()}
    assert (
        1e-7
        < change["dAP_p"]
        <= np.hypot(np.hypot(change["dAP_x"], change["dAP_y"]), change["dAP_z"])
    )
    assert "dAP_p" in str(found)
    with pytest.raises(JointplayError, match="nothing in this model drifts"):
        iso9283(pendulum(arm), 3, drift_time=3600.0)
    with pytest.raises(JointplayError, match=r"at most 3\.2e"):
        iso9283(pendulum(arm), 3, drift_time=1e20)


def test_runs_that_are_kept_are_not_done_again(arm, tmp_path, monkeypatch):
    simulation = pendulum(arm, duration=0.02)
    first = traces([simulation], keep=tmp_path)
    monkeypatch.setattr(traces_module, "_course", lambda _: pytest.fail("run again"))
    again = traces([simulation], keep=tmp_path)
    assert np.array_equal(first[0].position, again[0].position)


def test_a_damaged_kept_run_is_done_again(arm, tmp_path):
    simulation = pendulum(arm, duration=0.02)
    first = traces([simulation], keep=tmp_path)
    kept = tmp_path / "runs"
    whole = kept.read_bytes()
    for damaged in (whole[:-100], whole[:-200] + bytes(50) + whole[-150:]):
        kept.write_bytes(damaged)
        again = traces([simulation], keep=tmp_path)
        assert np.array_equal(again[0].position, first[0].position)
        assert kept.read_bytes() == whole
    kept.write_bytes(b"none")
    with pytest.raises(JointplayError, match="damaged, or no runs of jointplay"):
        traces([simulation], keep=tmp_path)


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
    assert main([*order, "--speed", "100", "--speed", "50"]) == 0
    said = capsys.readouterr().out
    assert "RP_l" in said
    assert "speed: 50 %" in said
    parts = ["iso9283_50.csv", "path_50.png", "poses_50.png"]
    assert set(os.listdir(out)) == {"cycles", "iso9283.csv", "path.png", "poses.png", *parts}
    assert os.listdir(out / "cycles") == ["runs"]
    assert "speed,6.7,,0.5,,," in (out / "iso9283_50.csv").read_text().splitlines()
    rows = (out / "iso9283.csv").read_text().splitlines()
    assert rows[0] == "figure,clause,time_s,value,low,high,unit"
    assert any(row.startswith("RT_p,8.3") for row in rows)
    assert any(row.startswith("RP_b,7.2.2") for row in rows)


ROBOT = (
    body("one", com="0.2 0 0"),
    joint("a", "base", "one", axis="0 0 1", at="0 0 0.5"),
    body("two", com="0.2 0 0"),
    joint("b", "one", "two", axis="0 0 1", at="0.4 0 0"),
    body("three", com="0 0 0"),
    joint("c", "two", "three", kind="prismatic", axis="0 0 1", at="0.4 0 0"),
    tip("three", at="0 0 0"),
)


def test_the_robot_of_a_cube_is_driven_to_the_limit_of_its_speed(urdf):
    slow = [part.replace('velocity="1e3"', 'velocity="2"') for part in ROBOT]
    mechanism = Mechanism(urdf(*slow), tool="tool")
    motion = cube_motion(mechanism, (0.5, 0.0, 0.5), 0.2, start={"b": 1.0})
    spans = [np.linspace(a, b, 201) for a, b in pairwise(motion.times)]
    fastest = np.abs(motion(np.concatenate(spans))[1]).max(axis=0)
    limits = [mechanism.description.joints[name].speed for name in motion.joints]
    assert (fastest <= np.array(limits) * 1.0001).all()
    assert (fastest / limits).max() == pytest.approx(1.0, rel=1e-3)
    assert motion.positions[0] == pytest.approx(motion.positions[-1])


@pytest.mark.parametrize(
    ("more", "says"),
    [
        (["--cube", "0.1 m"], "go together"),
        (["--speed", "0"], "--speed must be greater than zero"),
        (["--payload", "-1"], "--payload must not be negative"),
        (["--path-cycles", "2"], "path = 2"),
        (["--cycles", "1"], "at least 3 cycles"),
        (["--drift-time", "8 h"], "nothing in this model drifts"),
        (["--cube", "0.1 m", "--cube-centre", "1,2"], "three numbers"),
    ],
)
def test_the_command_refuses_conditions_that_cannot_be(arm, capsys, more, says):
    order = ["iso9283", str(arm), "--joint", "a", "--cycles", "3", "--quiet", "--duration", "0.1"]
    assert main([*order, *more]) == 2
    assert says in capsys.readouterr().err
