"""Reference motions."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.interpolate import BPoly, PPoly

from jointplay import JointplayError, Mechanism, Motion, shipped
from jointplay.simulation.loads import ComputedTorque
from jointplay.simulation.loads.drive import assign
from jointplay.simulation.motion.reference import INTERPOLATIONS


def test_quintics_rest_at_each_waypoint():
    motion = Motion.from_csv(shipped("scara_motion.csv"))
    q, v, a = motion(motion.times)
    assert np.allclose(q, motion.positions, atol=1e-12)
    assert np.allclose(v, 0.0, atol=1e-9)
    assert np.allclose(a, 0.0, atol=1e-7)
    assert motion.duration == 3.0


def test_quintic_peaks_are_the_known_ones():
    motion = Motion(["j"], [0.0, 0.5], [[0.0], [2.0]])
    _, v, a = motion(np.linspace(0.0, 0.5, 100001))
    assert v.max() == pytest.approx(15 / 8 * 2.0 / 0.5, rel=1e-6)
    assert a.max() == pytest.approx(10 / np.sqrt(3) * 2.0 / 0.5**2, rel=1e-6)


@pytest.mark.parametrize("interpolation", ["rest-to-rest", "spline"])
def test_derivatives_belong_to_the_position(interpolation):
    motion = Motion(["a", "b"], [0.0, 0.3, 0.7, 1.0], np.eye(4)[:, :2], interpolation)
    t = np.linspace(0.01, 0.99, 50)
    h = 1e-6
    q0, v0, _ = motion(t - h)
    q1, v1, _ = motion(t + h)
    _, v, a = motion(t)
    assert np.allclose((q1 - q0) / (2 * h), v, atol=1e-6)
    assert np.allclose((v1 - v0) / (2 * h), a, atol=1e-4)


@given(st.integers(0, 2**32 - 1), st.integers(2, 8))
def test_polynomials_are_those_of_scipy_to_the_last_bit(seed, number):
    rng = np.random.default_rng(seed)
    times, places = np.cumsum(rng.uniform(0.05, 2.0, number)), rng.normal(size=(number, 3))
    corners = np.stack([places[:-1]] * 3 + [places[1:]] * 3)
    known = PPoly.from_bernstein_basis(BPoly(corners, times))
    at = np.concatenate([times, rng.uniform(times[0], times[-1], 50)])
    motion = Motion(["a", "b", "c"], times, places, "rest-to-rest")(at)
    for values, order in zip(motion, range(3), strict=True):
        assert np.array_equal(values, known.derivative(order)(at))


def test_joints_stand_still_outside_the_motion():
    motion = Motion(["j"], [1.0, 2.0], [[0.0], [1.0]], "spline")
    q, v, a = motion(np.array([0.0, 5.0]))
    assert np.allclose(q[:, 0], [0.0, 1.0])
    assert not v.any()
    assert not a.any()


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("t,j\n0,0\n1,1\n", "line 1: the header"),
        ("time [deg],j\n0,0\n1,1\n", "line 1, 'time [deg]': \"1 deg\" is not a time"),
        ("time [s],j [kg]\n0,0\n1,1\n", "'j [kg]': \"1 kg\" is not an angle or a length"),
        ("# c\n\ntime_s,j\n0,0\n1,x\n", "line 5: j must be a number, got 'x'"),
        ("time_s,j\n0,0\n1\n", "line 3: 2 cells expected, got 1"),
        ("time_s,j\n0,0\n", "at least 2 waypoints"),
        ("time_s,j\n0,0\n1,nan\n", "positions must be finite; waypoint 2 is not"),
        ("time_s,j\n0,0\n1,1\n1,2\n", "1 s is followed by 1 s (number 3)"),
        ("time_s,j,j\n0,0,0\n1,1,1\n", "appears twice"),
        ("time_s,j\n", "no waypoints"),
        ("", "is empty"),
    ],
)
def test_bad_files_name_line_and_value(tmp_path, text, named):
    path = tmp_path / "m.csv"
    path.write_text(text)
    with pytest.raises(JointplayError) as caught:
        Motion.from_csv(path)
    assert named in str(caught.value)


def test_units_of_a_file_are_read_and_must_be_those_of_its_joints(tmp_path):
    """As measured tables have them; a joint that turns has no positions in mm."""
    path = tmp_path / "m.csv"
    path.write_text("time [ms],joint_a [deg],stroke (mm),joint_b\n0,0,0,0\n500,90,-20,0.1\n")
    motion = Motion.from_csv(path)
    assert motion.joints == ("joint_a", "stroke", "joint_b")
    assert motion.times[-1] == 0.5
    assert motion.positions[-1] == pytest.approx([np.pi / 2.0, -0.02, 0.1])
    robot = Mechanism(shipped("scara.urdf"))
    servo = {name: ComputedTorque() for name in motion.joints}
    assert set(motion.joints) < set(assign(robot, motion, servo))
    path.write_text(path.read_text().replace("(mm)", "[deg]"))
    with pytest.raises(JointplayError, match=r"'stroke' has positions in m, .* in rad"):
        assign(robot, Motion.from_csv(path), servo)


def test_bad_arguments_are_named():
    with pytest.raises(JointplayError, match=r"none\.csv"):
        Motion.from_csv("none.csv")
    with pytest.raises(JointplayError, match=r"\(2, 1\), got \(1, 1\)"):
        Motion(["j"], [0, 1], [[0]])
    with pytest.raises(JointplayError, match="rest-to-rest, spline"):
        Motion(["j"], [0, 1], [[0], [1]], "cubic")


def recorded(rate, seconds=10.0):
    """Two joints led by hand, as encoders of 4096 counts and a little noise show them."""
    t = np.arange(0.0, seconds, 1.0 / rate)
    random = np.random.default_rng(0)
    hand = 0.2 * np.sin(2.0 * np.pi * 1.3 * t) * (t > 3.0)
    q = np.stack([0.5 * np.sin(0.7 * t) + hand, 0.5 * np.cos(0.7 * t) - hand], axis=1)
    count = 2.0 * np.pi / 4096
    return t, np.round((q + 3e-4 * random.normal(size=q.shape)) / count) * count


def trapezoid():
    """2 s at 50 Hz, 0.3 s of them to speed up and as many to brake."""
    t = np.linspace(0.0, 2.0, 101)
    up, down = np.minimum(t, 0.3), np.maximum(t - 1.7, 0.0)
    return t, (up**2 / 0.6 + t - up - down**2 / 0.6)[:, None]


def sampled(number, end=1.0, periods=1.0, scatter=0.0):
    """A sine by `number` samples in a time, whose time stamps scatter by a part of the interval."""
    t = np.linspace(0.0, end, number)
    stamps = t + scatter * t[1] * np.random.default_rng(3).normal(size=number)
    return np.maximum.accumulate(stamps) + 1e-6 * t, np.sin(periods * 2 * np.pi * t / end)[:, None]


ROW = np.arange(5.0)[:, None]
PICK = np.tile([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]], (10, 1))


@pytest.mark.parametrize(
    ("points", "interpolation"),
    [
        ((np.linspace(0.0, 0.1, 101), np.linspace(0.0, 6.28, 101)[:, None]), "spline"),
        (recorded(100), "spline"),
        (recorded(30), "spline"),
        (trapezoid(), "spline"),
        ((np.arange(2000) / 1e3, np.round(np.arange(2000) / 30)[:, None]), "spline"),  # counts
        ((0.2 * np.arange(11), 62.8 * 0.2 * np.arange(11)[:, None]), "spline"),
        ((0.2 * np.arange(6), 62.8 * 0.2 * np.arange(6)[:, None]), "spline"),
        (sampled(6, periods=0.25), "spline"),
        (sampled(10), "spline"),
        (sampled(101, 10.0, 10.0, scatter=0.3), "spline"),  # stamps all but meet
        (sampled(6), "rest-to-rest"),  # each a quarter turn from the next
        ((np.arange(7.0), 3.0 - np.abs(3.0 - np.arange(7.0))[:, None]), "rest-to-rest"),
        ((0.5 * ROW[:, 0], ROW), "rest-to-rest"),
        ((0.01 * ROW[:, 0], ROW), "rest-to-rest"),
        ((np.arange(14) / 2, np.repeat(np.arange(7.0), 2)[:, None]), "rest-to-rest"),  # pauses
        ((0.05 * np.arange(40), PICK), "rest-to-rest"),
        ((np.arange(200.0), np.random.default_rng(1).random((200, 2))), "rest-to-rest"),
    ],
)
def test_samples_are_passed_and_waypoints_stopped_at(points, interpolation):
    t, q = points
    names = [f"j{k}" for k in range(q.shape[1])]
    assert Motion(names, t, q).interpolation == interpolation


@pytest.mark.parametrize(
    ("points", "noisy"),
    [
        (recorded(100), True),
        (sampled(91, 3.0, 3.0, scatter=0.1), True),
        (sampled(91, 3.0, 3.0), False),
        (sampled(12), False),
        (trapezoid(), False),
        ((np.linspace(0.0, 0.1, 101), np.round(62.83 * np.linspace(0.0, 0.1, 101), 6)), False),
    ],
)
def test_a_spline_that_follows_noise_of_samples_is_told(points, noisy):
    t, q = points
    names = [f"j{k}" for k in range(q.reshape(len(t), -1).shape[1])]
    motion = Motion(names, t, q.reshape(len(t), -1))
    assert set(motion.noise) == (set(names) if noisy else set())
    for k, name in enumerate(motion.noise):  # of these motions at most 40 rad/s^2 are their own
        most = np.abs(motion(t)[2][:, k]).max()
        assert motion.noise[name] == pytest.approx(most)
        assert most > 100.0


def test_a_turning_crank_keeps_its_speed_at_both_ends(tmp_path):
    file = tmp_path / "crank.csv"
    rows = [f"{t!r},{62.83185 * t!r}" for t in np.linspace(0.0, 0.1, 101).tolist()]
    file.write_text("\n".join(["time_s,crank", *rows]) + "\n")
    for interpolation in (None, "spline"):
        motion = Motion.from_csv(file, interpolation)
        _, v, a = motion(np.linspace(0.0, 0.1, 5001))
        assert np.abs(v - 62.83185).max() < 1e-8
        assert np.abs(a).max() < 1e-3
        assert motion.summary == "101 samples, spline"
    assert motion.cut_off(0.1) == {}
    assert motion.cut_off(0.2) == {"crank": pytest.approx(62.83185)}


def test_a_spline_follows_a_sampled_trapezoid_and_rests_at_its_ends():
    motion = Motion(["j"], *trapezoid())
    t = np.linspace(0.0, 2.0, 2001)
    speed = np.minimum(np.minimum(t, 2.0 - t) / 0.3, 1.0)
    assert np.abs(motion(t)[1][:, 0] - speed).max() < 0.01
    assert np.abs(motion(np.array([0.0, 2.0]))[1]).max() < 1e-12
    assert motion.cut_off(3.0) == {}


@pytest.mark.parametrize("interpolation", INTERPOLATIONS)
def test_a_motion_is_read_as_it_was_written(tmp_path, interpolation):
    file = tmp_path / "m.csv"
    motion = Motion(
        ["a", "b"], [0.0, 0.1, 0.3], [[0.0, 0.3], [0.1, 0.2], [0.3, 0.0]], interpolation
    )
    file.write_text(motion.csv())
    assert Motion.from_csv(file) == motion
    other = "spline" if interpolation == "rest-to-rest" else "rest-to-rest"
    assert Motion.from_csv(file, other).interpolation == other


def test_a_comment_that_names_no_interpolation_is_refused(tmp_path):
    file = tmp_path / "m.csv"
    file.write_text("# interpolation: cubic\ntime_s,j\n0,0\n1,1\n")
    with pytest.raises(JointplayError, match="'cubic'"):
        Motion.from_csv(file)
