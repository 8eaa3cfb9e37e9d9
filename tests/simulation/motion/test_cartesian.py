"""Cartesian motions: the tool where it was asked for, and one-line reasons where it cannot be."""

import json

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay import analysis
from jointplay.accuracy.poses import times_along
from jointplay.physics.joints import SphericalClearance
from jointplay.simulation.motion.cartesian import JUMP, SINGULAR_M, Arm, cartesian_motion
from jointplay.simulation.motion.completion import complete_motion
from jointplay.study.nonlinear.steady_motion import repeated

TIMES = [0.0, 0.4, 1.0]
SCARA_CONFIGURATIONS = np.array([[0.3, 0.8, -0.02, 0.1], [0.6, 0.9, -0.04, 0.4], [-0.3, 1.2, 0, 0]])
SIX_CONFIGURATIONS = np.array(
    [
        [0.3, -1.2, 1.4, -1.0, -1.3, 0.5],
        [0.8, -1.0, 1.1, -0.6, -1.1, 0.9],
        [0.5, -1.4, 1.6, -1.3, -1.6, -0.4],
    ]
)


@pytest.fixture
def scara():
    return jp.Mechanism(jp.shipped("scara.urdf"))


@pytest.fixture
def six_axes(urdf):
    """A robot with the proportions and axes of a UR5: offset wrist, six revolute joints."""
    chain = [
        ("pan", "base", "a", "0 0 1", "0 0 0.09"),
        ("lift", "a", "b", "0 1 0", "0 0.136 0"),
        ("elbow", "b", "c", "0 1 0", "0 -0.12 0.425"),
        ("wrist1", "c", "d", "0 1 0", "0 0 0.392"),
        ("wrist2", "d", "e", "0 0 1", "0 0.093 0"),
        ("wrist3", "e", "f", "0 1 0", "0 0 0.095"),
    ]
    elements = [body(child) + joint(*j[:3], axis=j[3], at=j[4]) for j in chain for child in [j[2]]]
    flange = '<link name="flange"/>' + joint("mount", "f", "flange", "fixed", at="0 0.082 0")
    return jp.Mechanism(urdf(*elements, flange), tool="flange")


def poses(mechanism, configurations, frame=None):
    """Positions (n, 3) and rotations (n, 3, 3) of a frame of the ideal robot."""
    robot = mechanism.ideal()
    found = []
    index = robot.model.getFrameId(frame or robot.tool)
    for q in np.asarray(configurations, float):
        pin.framesForwardKinematics(robot.model, robot.data, q)
        found.append(robot.data.oMf[index].copy())
    return np.array([f.translation for f in found]), np.array([f.rotation for f in found])


def angles(turns):
    return np.array([pin.rpy.matrixToRpy(turn) for turn in turns])


def turn_between(one, two):
    return max(np.linalg.norm(pin.log3(a.T @ b)) for a, b in zip(one, two, strict=True))


def named(values, mechanism):
    return dict(zip(mechanism.joints, values, strict=True))


@pytest.mark.parametrize("path", ["joint", "line"])
def test_tool_of_the_scara_is_where_it_was_asked_for(scara, path):
    places, _ = poses(scara, SCARA_CONFIGURATIONS)
    motion = cartesian_motion(scara, TIMES, places, path=path, start={"joint_b": 0.5})
    assert motion.joints == scara.joints
    q, v, _ = motion(np.array(TIMES))
    assert np.abs(poses(scara, q)[0] - places).max() < 1e-9
    assert np.abs(v).max() < 1e-4  # rests at each
    # The branch of `start`; nothing asks the last joint to turn, so it does not.
    assert q[:, :3] == pytest.approx(SCARA_CONFIGURATIONS[:, :3], abs=1e-7)
    assert np.abs(q[:, 3]).max() < 1e-9


@pytest.mark.parametrize("path", ["joint", "line"])
def test_six_axes_lead_position_and_orientation(six_axes, path):
    places, turns = poses(six_axes, SIX_CONFIGURATIONS)
    start = named(SIX_CONFIGURATIONS[0] + 0.1, six_axes)
    motion = cartesian_motion(six_axes, TIMES, places, angles(turns), path=path, start=start)
    q = motion(np.array(TIMES))[0]
    found, turned = poses(six_axes, q)
    assert np.abs(found - places).max() < 1e-9
    assert turn_between(turned, turns) < 1e-9
    assert q == pytest.approx(SIX_CONFIGURATIONS, abs=1e-6)


def test_start_selects_the_branch(scara):
    places, _ = poses(scara, SCARA_CONFIGURATIONS)
    left, right = (
        cartesian_motion(scara, TIMES, places, start={"joint_b": elbow}).positions
        for elbow in (0.5, -0.5)
    )
    assert right[:, 1] == pytest.approx(-left[:, 1], abs=1e-7)
    assert poses(scara, right)[0] == pytest.approx(poses(scara, left)[0], abs=1e-9)


def test_frame_may_be_any(scara):
    places, _ = poses(scara, SCARA_CONFIGURATIONS, "arm2")
    assert np.ptp(places[:, 2]) == 0.0  # it cannot leave its plane
    places[:, 2] += 0.1
    with pytest.raises(jp.JointplayError, match=r"waypoint 1 .* is out of reach: 0\.1 m and 0 rad"):
        cartesian_motion(scara, TIMES, places, frame="arm2")
    tool = poses(scara, SCARA_CONFIGURATIONS, "arm3")[0]
    motion = cartesian_motion(scara, TIMES, tool, frame="arm3", start={"joint_b": 1.0})
    assert np.abs(poses(scara, motion.positions, "arm3")[0] - tool).max() < 1e-9


def along(motion, robot):
    """Finely in time on the first line: place, rotation, and share of the way by the quintic."""
    t = np.linspace(TIMES[0], TIMES[1], 331)
    s = (t - TIMES[0]) / (TIMES[1] - TIMES[0])
    return *poses(robot, motion(t)[0]), s**3 * (10 - 15 * s + 6 * s**2)


def test_lines_are_straight_and_timed_by_the_quintic(six_axes):
    places, turns = poses(six_axes, SIX_CONFIGURATIONS)
    start = named(SIX_CONFIGURATIONS[0], six_axes)
    line = cartesian_motion(six_axes, TIMES, places, angles(turns), path="line", start=start)
    place, turn, law = along(line, six_axes)
    wanted = places[0] + law[:, None] * (places[1] - places[0])
    assert np.abs(place - wanted).max() < 2e-8  # between the samples; at them 1e-11
    axis = pin.log3(turns[0].T @ turns[1])
    assert np.linalg.norm(axis) > 0.3
    assert turn_between(turn, [turns[0] @ pin.exp3(part * axis) for part in law]) < 2e-7
    bent = cartesian_motion(six_axes, TIMES, places, angles(turns), start=start)
    assert np.abs(along(bent, six_axes)[0] - wanted).max() > 1e-3  # the check sees a curve


def test_a_line_lists_the_waypoints_that_were_given_and_rests_at_each(scara):
    """Not the points between them, of which there are hundreds."""
    places = poses(scara, SCARA_CONFIGURATIONS)[0][[0, 1, 1, 2]]
    times = [0.0, 0.4, 0.5, 1.0]
    line = cartesian_motion(scara, times, places, path="line", start={"joint_b": 0.5})
    again = jp.Motion.from_description(json.loads(json.dumps(line.describe())))
    led = complete_motion(
        scara, jp.Motion(line.joints[:2], line.times, line.positions[:, :2], "spline", line.given)
    ).motion
    for motion in (line, again, led):
        found, positions = motion.waypoints
        assert found.tolist() == times
        assert np.abs(positions[:, :2] - line(np.array(times))[0][:, :2]).max() < 1e-9
        assert motion.summary == f"4 waypoints, spline through {len(line.times)} points"
        ends = [(stop.start, stop.end, stop.at_rest) for stop in analysis.stops(motion, 1.0)]
        assert ends == [(0.0, 0.0, True), (0.4, 0.5, True), (1.0, 1.0, True)]
    assert "4 waypoints in 1 s" in repr(line)
    assert line.at_speed(2.0).waypoints[0].tolist() == [0.0, 0.2, 0.25, 0.5]
    twice = repeated(line, 2)
    assert twice.waypoints[0].tolist() == [0.0, 0.4, 0.5, 1.0, 1.4, 1.5, 2.0]
    assert set(times) <= set(times_along(line, 9))
    assert len(times_along(line, 9)) < 13


def test_the_reference_rests_at_the_ends_of_the_coarsest_lines(scara):
    places = poses(scara, [[0.3, 0.8, 0, 0], [0.302, 0.8, -0.002, 0], [0.302, 0.803, 0, 0]])[0]
    line = cartesian_motion(scara, [0, 0.02, 0.04], places, path="line", start={"joint_b": 0.5})
    assert len(line.times) == 21  # ten to each line
    assert [stop.kind for stop in analysis.stops(line, 0.04)] == ["stop"] * 3


@pytest.mark.parametrize("given", [[0.0], [0.0, 2.0], [0.0, 0.7, 0.3, 1.0]])
def test_waypoints_outside_a_motion_are_refused(given):
    with pytest.raises(jp.JointplayError, match="given waypoints"):
        jp.Motion(["j"], [0.0, 0.5, 1.0], [[0.0], [0.1], [0.3]], given=given)


def test_redundant_joints_take_the_nearest_configuration(urdf):
    """Three parallel links for two coordinates: against a minimisation over the free angle."""
    path = urdf(
        *(body(name) for name in "abc"),
        '<link name="tip"/>',
        joint("one", "base", "a"),
        joint("two", "a", "b", at="0.3 0 0"),
        joint("three", "b", "c", at="0.3 0 0"),
        joint("end", "c", "tip", "fixed", at="0.2 0 0"),
    )
    robot = jp.Mechanism(path)
    begin = np.array([0.2, 0.5, 0.7])
    places, _ = poses(robot, [begin, [0.5, 0.8, 0.2]])
    start = named(begin, robot)
    found = cartesian_motion(robot, [0, 1], places, start=start).positions
    assert found[0] == pytest.approx(begin, abs=1e-9)
    assert np.abs(poses(robot, found)[0] - places).max() < 1e-9

    def solutions(direction):
        """All configurations whose last link points in `direction`."""
        x, y = places[1, :2] - 0.2 * np.array([np.cos(direction), np.sin(direction)])
        cosine = (x * x + y * y - 0.18) / 0.18
        for elbow in (np.arccos(cosine), -np.arccos(cosine)) if abs(cosine) < 1 else ():
            first = np.arctan2(y, x) - np.arctan2(0.3 * np.sin(elbow), 0.3 + 0.3 * np.cos(elbow))
            yield np.array([first, elbow, direction - first - elbow])

    every = [q for phi in np.linspace(0, 3, 30001) for q in solutions(phi)]
    nearest = min(np.linalg.norm(q - begin) for q in every)
    assert np.linalg.norm(found[1] - begin) == pytest.approx(nearest, abs=1e-7)


def refused(*args, **options):
    with pytest.raises(jp.JointplayError) as caught:
        cartesian_motion(*args, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


HERE = [0.439, 0.342, -0.23]


def test_waypoint_out_of_reach_is_named_with_what_remains(scara):
    message = refused(scara, [0, 1], [HERE, [0.8, 0.0, -0.23]])
    left = 0.8 - (0.329 + 0.275)
    assert message.startswith("waypoint 2 at (0.8, 0, -0.23) m is out of reach: ")
    assert f"{left:.4g} m and 0 rad remain" in message
    tilted = refused(scara, [0, 1], [HERE, HERE], [[0, 0, 0], [0.2, 0, 0]])
    distance, angle = (float(tilted.split(": ")[1].split(" ")[i]) for i in (0, 3))
    assert tilted.startswith("waypoint 2 at")
    # 0.2 rad of roll cannot be turned away; nor does it pay to leave the point for it.
    assert angle == pytest.approx(0.2, abs=1e-3)
    assert distance < 1e-6


def test_no_pose_is_beyond_the_sphere_of_all_lengths(scara, six_axes):
    """It says how near the tool comes at best, and never refuses what can be reached."""
    message = refused(scara, [0, 1], [HERE, [800.0, 0.0, -0.23]], path="line")
    assert message.startswith("waypoint 2 at (800, 0, -0.23) m is out of reach: the tool comes no")
    random = np.random.default_rng(0)
    for robot in (scara, six_axes):
        arm = Arm(robot, None, {}, None, False)
        away = [
            float(np.linalg.norm(arm.pose(arm.anywhere(random)).translation - arm.origin))
            for _ in range(200)
        ]
        assert 0.5 * arm.reach < max(away) < arm.reach


def test_orientation_that_fits_four_axes_is_not_called_singular(scara):
    motion = cartesian_motion(scara, [0, 1], [HERE, HERE], [[0, 0, 0], [0, 0, 0.7]])
    _, turns = poses(scara, motion.positions)
    assert angles(turns)[:, 2] == pytest.approx([0.0, 0.7], abs=1e-9)
    assert np.abs(np.diff(motion.positions, axis=0))[0] == pytest.approx([0, 0, 0, 0.7], abs=1e-8)


def test_stretched_arm_is_singular(scara):
    edge = 0.329 + 0.275
    message = refused(scara, [0, 1], [HERE, [edge, 0.0, -0.23]])
    assert message.startswith("waypoint 2 at (0.604, 0, -0.23) m is singular")
    assert f"at least {SINGULAR_M:g} m" in message
    # A tenth of a millimetre inside, it is well.
    motion = cartesian_motion(scara, [0, 1], [HERE, [edge - 1e-4, 0.0, -0.23]])
    assert abs(motion.positions[1, 1]) < 0.1


def test_aligned_wrist_is_singular_with_orientation_only(six_axes):
    q = SIX_CONFIGURATIONS[:2].copy()
    q[1, 4] = 0.0  # the axes of wrist 1 and 3 coincide
    places, turns = poses(six_axes, q)
    start = named(q[0], six_axes)
    message = refused(six_axes, [0, 1], places, angles(turns), start=start)
    assert message.startswith("waypoint 2 at")
    assert "is singular" in message
    cartesian_motion(six_axes, [0, 1], places, start=start)


def test_joint_limits_are_named(scara):
    message = refused(scara, [0, 1], [HERE, [0.439, 0.342, 0.0]])
    assert "waypoint 2" in message
    assert "violates the limits of joint 'stroke'" in message
    assert "allowed is -0.13 to 0.01" in message
    assert "would have to be at 0.21" in message
    start = refused(scara, [0, 1], [HERE, HERE], start={"joint_a": 3.0})
    assert "start of joint 'joint_a' at 3 violates its limits -2.3 to 2.3" in start


def test_other_branch_is_named_where_limits_end_this_one(scara):
    places = [[-0.3, 0.2, -0.23], [-0.3, -0.2, -0.23]]
    start = {"joint_a": 2.0, "joint_b": 1.0}
    for path in ("line", "joint"):
        message = refused(scara, [0, 1], places, path=path, start=start)
        assert "violates the limits of joint 'joint_a'" in message
        assert "another branch reaches it, such as joint_a = -" in message


def test_jump_on_a_line_is_refused(urdf):
    """Close past its own axis a two-link arm of equal links would have to flip by half a turn."""
    path = urdf(
        *(body(name) for name in "ab"),
        '<link name="tip"/>',
        joint("one", "base", "a"),
        joint("two", "a", "b", at="0.3 0 0"),
        joint("end", "b", "tip", "fixed", at="0.3 0 0"),
    )
    robot = jp.Mechanism(path)
    # In the plane only: no z to lead, so z is a direction that is never commanded.
    start = {"one": -0.5, "two": 1.5}
    message = refused(robot, [0, 1], [[0.3, 2e-3, 0], [-0.3, 2e-3, 0]], path="line", start=start)
    assert "would jump by" in message
    assert "on the line to waypoint 2, near (" in message
    assert float(message.split("jump by ")[1].split(",")[0]) > JUMP
    wide = cartesian_motion(
        robot, [0, 1], [[0.3, 0.2, 0], [-0.3, 0.2, 0]], path="line", start=start
    )
    assert np.abs(np.diff(wide.positions, axis=0)).max() < JUMP


@pytest.mark.parametrize(
    ("arguments", "options", "text"),
    [
        (([0, 1], [HERE]), {}, "positions must have the shape (times, 3) = (2, 3), got (1, 3)"),
        (([0, 1], [HERE, HERE], [[0, 0, 0]]), {}, "orientations must have the shape"),
        (([0], [HERE]), {}, "at least 2 times"),
        (([0, 0], [HERE, HERE]), {}, "0 s is followed by 0 s (number 2)"),
        (([0, 1], [HERE, [0, np.nan, 0]]), {}, "positions must be finite; waypoint 2"),
        (([0, 1], [HERE, "here"]), {}, "positions must be numbers"),
        (([0, 1], [HERE, HERE]), {"path": "arc"}, "no path 'arc'; available: joint, line"),
        (([0, 1], [HERE, HERE]), {"frame": "hand"}, "no frame 'hand'; available: joint_a"),
        (([0, 1], [HERE, HERE]), {"start": {"elbow": 0}}, "no moving joint 'elbow'"),
        (([0, 1], [HERE, HERE]), {"start": {"joint_a": np.nan}}, "start of joint 'joint_a'"),
    ],
)
def test_wrong_arguments_are_named(scara, arguments, options, text):
    assert text in refused(scara, *arguments, **options)


def test_robots_that_cannot_be_led_are_refused(urdf):
    ball = joint("ball", "base", "arm", "floating")
    path = urdf(body("arm"), ball, body("end"), joint("hinge", "arm", "end"))
    robot = jp.Mechanism(path, {"ball": SphericalClearance(radial_clearance=1e-4)})
    assert "cannot move the ball joint 'ball'" in refused(robot, [0, 1], [HERE, HERE])
    fixed = jp.Mechanism(urdf('<link name="rock"/>', joint("nail", "base", "rock", "fixed")))
    assert "has none" in refused(fixed, [0, 1], [HERE, HERE])
