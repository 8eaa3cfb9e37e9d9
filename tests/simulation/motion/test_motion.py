"""Reference motions."""

import numpy as np
import pytest

from jointplay import JointplayError, Motion, shipped


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


def test_bad_arguments_are_named():
    with pytest.raises(JointplayError, match=r"none\.csv"):
        Motion.from_csv("none.csv")
    with pytest.raises(JointplayError, match=r"\(2, 1\), got \(1, 1\)"):
        Motion(["j"], [0, 1], [[0]])
    with pytest.raises(JointplayError, match="rest-to-rest, spline"):
        Motion(["j"], [0, 1], [[0], [1]], "cubic")
