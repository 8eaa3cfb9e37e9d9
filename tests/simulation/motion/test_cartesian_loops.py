"""Cartesian motions of closed loops: against closed forms, along the way, and where they cannot."""

import math

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.closed_loops import ClosedLoops, followed_mimics
from jointplay.model.loop import Loop, assemble, closing_rows, openings
from jointplay.simulation.motion.cartesian import cartesian_motion, cartesian_path, reachable
from jointplay.simulation.motion.completion import complete_motion
from jointplay.simulation.motion.ideal import driven_map
from jointplay.study.iso9283 import cube_motion

ARMS = ("arm_1", "arm_2", "arm_3")
MOTORS = ("motor_1", "motor_2", "motor_3")


@pytest.fixture(scope="module")
def delta():
    return jp.Scenario.load("jointplay:delta.toml").simulation("ideal").mechanism.ideal()


@pytest.fixture(scope="module")
def three_rrr():
    return jp.Scenario.load("jointplay:three_rrr.toml").simulation("ideal").mechanism.ideal()


CRANK, ROD, BASE = 0.2, 0.3, 0.15


def five_bar_parts(mimic=""):
    """Two cranks on the ground, two rods, the tool where the rods meet; zero pose: see START."""
    right = joint("right", "base", "right_crank", "continuous", at=f"{BASE} 0 0")
    if mimic:
        right = right.replace("</joint>", f"{mimic}</joint>")
    return [
        body("left_crank") + joint("left", "base", "left_crank", "continuous", at=f"-{BASE} 0 0"),
        body("right_crank") + right,
        body("left_rod")
        + joint("left_elbow", "left_crank", "left_rod", "continuous", at=f"{CRANK} 0 0"),
        body("right_rod")
        + joint("right_elbow", "right_crank", "right_rod", "continuous", at=f"{CRANK} 0 0"),
        '<link name="tool"/>' + joint("tip", "left_rod", "tool", "fixed", at=f"{ROD} 0 0"),
    ]


def legs(x, y, left=1.0, right=-1.0):
    """Crank angles and angles of the elbows of the five-bar, in closed form."""
    found = []
    for base, side in ((-BASE, left), (BASE, right)):
        way, reach = math.atan2(y, x - base), math.hypot(x - base, y)
        at_base = math.acos((CRANK**2 + reach**2 - ROD**2) / (2 * CRANK * reach))
        crank = way + side * at_base
        rod = math.atan2(y - CRANK * math.sin(crank), x - base - CRANK * math.cos(crank))
        found += [crank, (rod - crank + math.pi) % (2 * math.pi) - math.pi]
    left_crank, left_elbow, right_crank, right_elbow = found
    return {
        "left": left_crank,
        "left_elbow": left_elbow,
        "right": right_crank,
        "right_elbow": right_elbow,
    }


HOME = (0.0, 0.35)
END = {"end": Loop("left_rod", "right_rod", bearing_xyz=(ROD, 0, 0), journal_xyz=(ROD, 0, 0))}


@pytest.fixture
def five_bar(urdf):
    return jp.Mechanism(urdf(*five_bar_parts()), loops=END, tool="tool", gravity=(0, 0, 0))


def refused(mechanism, positions, orientations=None, **options):
    times = np.arange(len(positions), dtype=float)
    with pytest.raises(jp.JointplayError) as caught:
        cartesian_motion(mechanism, times, positions, orientations, **options)
    return str(caught.value)


def prescribed(robot, found):
    options = {"integrator": "rk4", "step": 1e-4, "estimate": False, "state": found.start}
    return jp.simulate(robot, found.motion, drive=jp.loads.Prescribed(), **options)


def arms_of_the_delta(place):
    """Angles of its arms in closed form (Williams 2015), lower branch of three [rad]."""
    base, platform, upper, rod = 0.567 * 3**0.5 / 6, 0.076 * 3**0.5 / 3, 0.524, 1.244
    found = []
    for turn in np.deg2rad([-90.0, 30.0, 150.0]):
        x = place[0] * math.cos(turn) + place[1] * math.sin(turn) + platform - base
        y = -place[0] * math.sin(turn) + place[1] * math.cos(turn)
        e, f = -2.0 * x * upper, 2.0 * place[2] * upper
        g = x**2 + y**2 + place[2] ** 2 + upper**2 - rod**2
        found.append(2.0 * math.atan((-f - math.sqrt(e**2 + f**2 - g**2)) / (g - e)))
    return found


def test_a_delta_agrees_with_its_closed_form_everywhere(delta):
    """Which gives the examples of R. L. Williams, The Delta Parallel Robot, 2015."""
    published = np.deg2rad([[-20.5] * 3, [47.5, -11.6, 21.4]])
    for place, angles in zip([[0.0, 0.0, -0.9], [0.3, 0.5, -1.1]], published, strict=True):
        assert arms_of_the_delta(place) == pytest.approx(angles, abs=1e-3)
    random = np.random.default_rng(3)
    places = np.column_stack([random.uniform(-0.4, 0.4, (12, 2)), random.uniform(-1.2, -0.95, 12)])
    motion = cartesian_motion(delta, np.arange(12.0), places)
    assert motion.joints == ARMS
    wanted = [arms_of_the_delta(place) for place in places]
    assert motion.positions == pytest.approx(np.array(wanted), abs=1e-7)


@pytest.mark.parametrize("path", ["joint", "line"])
def test_a_five_bar_keeps_its_branch(five_bar, path):
    places = [(*HOME, 0.0), (0.1, 0.4, 0.0), (-0.12, 0.38, 0.0)]
    for sides in ((1, -1), (1, 1)):
        path_found = cartesian_path(
            five_bar, [0, 1, 2], places, path=path, start=legs(*HOME, *sides)
        )
        motion = path_found.motion
        assert motion.joints == ("left", "right")
        for time, place in zip([0, 1, 2], places, strict=True):
            wanted = legs(place[0], place[1], *sides)
            turns = motion(np.array([float(time)]))[0][0] - [wanted["left"], wanted["right"]]
            assert np.abs(np.sin(turns / 2)).max() < 1e-8


def test_a_run_begins_as_the_path_is_assembled(five_bar):
    """Where the driven joints alone would be assembled otherwise, the path says how."""
    places = [(*HOME, 0.0), (0.1, 0.4, 0.0)]
    for sides in ((1, -1), (1, 1), (-1, 1)):
        found = cartesian_path(five_bar, [0, 0.2], places, start=legs(*HOME, *sides))
        result = prescribed(five_bar, found)
        tool = result["tool_position"].values
        assert tool[0] == pytest.approx(places[0], abs=1e-8)
        assert tool[-1] == pytest.approx(places[1], abs=1e-6)


@pytest.mark.thorough
def test_joints_that_follow_keep_the_loops_closed_in_speed(delta):
    """Along a line: closed by Newton at each time, differentiated by differences."""
    places = [[-0.2, 0.1, -1.05], [0.2, -0.05, -1.15]]
    motion = cartesian_motion(delta, [0.0, 0.5], places, path="line")
    at = [delta.coordinate(name) for name in motion.joints]
    pace = 1e-3
    times = np.arange(0.0, 0.5 + pace / 2, pace)
    driven, speeds, _ = motion(times)
    q = np.zeros(delta.model.nq)
    q[at] = driven[0]
    begin = assemble(delta, q, at)
    rows = np.tile(begin, (len(times), 1))
    rows[:, at] = driven
    whole = ClosedLoops(delta, begin, motion.joints).closed(rows, begin)
    assert max(np.abs(openings(delta, row)).max() for row in whole) < 1e-11
    speed = (whole[2:] - whole[:-2]) / (2 * pace)
    assert np.abs(speed).max() > 0.5
    for k in range(10, len(times) - 12, 25):
        matrix = driven_map(delta, whole[k + 1], at)
        assert matrix @ speeds[k + 1] == pytest.approx(speed[k], abs=1e-4)
        assert np.abs(closing_rows(delta, whole[k + 1]) @ speed[k]).max() < 1e-4


def test_the_platform_is_turned_as_asked(three_rrr):
    places, turns = [[0.03, 0.03, 0], [-0.03, 0.02, 0]], [[0, 0, 0.2], [0, 0, -0.1]]
    motion = cartesian_motion(three_rrr, [0, 1], places, turns)
    for row, place, turn in zip(motion.positions, places, turns, strict=True):
        for angle, start in zip(
            (math.pi / 2, math.pi * 7 / 6, -math.pi / 6), range(3), strict=True
        ):
            motor = 0.25 * np.array([math.cos(angle), math.sin(angle)])
            pin = np.array(place[:2]) + 0.06 * np.array(
                [math.cos(angle + turn[2]), math.sin(angle + turn[2])]
            )
            way = pin - motor
            reach = np.hypot(*way)
            crank = math.atan2(way[1], way[0]) + math.acos(
                (0.16**2 + reach**2 - 0.18**2) / (2 * 0.16 * reach)
            )
            home = three_rrr.model.jointPlacements[three_rrr.model.getJointId(MOTORS[start])]
            zero = math.atan2(home.rotation[1, 0], home.rotation[0, 0])
            assert math.sin((row[start] + zero - crank) / 2) == pytest.approx(0, abs=1e-8)


@pytest.mark.thorough
def test_workspace_of_the_3_rrr_is_that_of_three_rings(three_rrr):
    """With the platform not turned, it is where three rings overlap (Merlet, Gosselin and Mouly,
    Workspaces of planar parallel manipulators, 1998): radii |l1 - l2| and l1 + l2 about the motors,
    moved by the platform's radius."""
    angles = np.array([math.pi / 2, math.pi * 7 / 6, -math.pi / 6])
    centres = 0.19 * np.column_stack([np.cos(angles), np.sin(angles)])
    grid = np.linspace(-0.25, 0.25, 11)
    points = np.array([[x, y, 0.0] for y in grid for x in grid])
    away = np.linalg.norm(points[:, None, :2] - centres, axis=2)
    rim = np.minimum(np.abs(away - 0.34), np.abs(away - 0.02)).min(axis=1)
    clear = rim > 2e-3
    wanted = ((away < 0.34) & (away > 0.02)).all(axis=1)
    points, wanted = points[clear], wanted[clear]
    order = np.argsort(np.linalg.norm(points, axis=1))
    found = reachable(three_rrr, points[order], np.zeros((len(points), 3)), driven=MOTORS)
    assert 20 < wanted.sum() < len(wanted) - 20
    # Inside, the platform may be where it moves although the motors stand: that is no workspace.
    assert not (found & ~wanted[order]).any()
    assert (found == wanted[order]).mean() > 0.95


def test_the_lack_of_reach_is_the_distance_that_remains(five_bar):
    """Straight ahead both legs are stretched at the height y; the tool stays 0.3 m below."""
    highest = math.sqrt((CRANK + ROD) ** 2 - BASE**2)
    message = refused(five_bar, [(*HOME, 0), (0, highest + 0.3, 0)], start=legs(*HOME))
    assert message.startswith("waypoint 2 at (0, 0.776")
    assert "out of reach: 0.3 m and 0 rad remain" in message
    assert "the tool can be led along x, y; its z stays 0 m" in message


@pytest.mark.parametrize("path", ["joint", "line"])
def test_a_waypoint_beyond_all_lengths_is_refused_at_once(delta, path, monkeypatch):
    monkeypatch.setattr("jointplay.simulation.motion.cartesian._solve", None)  # nothing is searched
    good = [-0.1525, 0.0, -1.1]
    for positions in ([good, [-0.1525, 0.0, -1075.0]], [[-0.1525, 0.0, -1075.0], good]):
        message = refused(delta, positions, path=path)
        number = 1 + positions[1][2:].count(-1075.0)
        assert message.startswith(f"waypoint {number} at (-0.1525, 0, -1075) m is out of reach: ")
        assert "the tool comes no nearer to it than 1073 m" in message


@pytest.mark.thorough
def test_components_that_cannot_be_led_are_named(five_bar, delta):
    start = legs(*HOME)
    assert "its z stays 0 m" in refused(five_bar, [(*HOME, 0.1), (*HOME, 0)], start=start)
    turned = [[0, 0, 0.3], [0, 0, 0.5]]
    message = refused(five_bar, [(*HOME, 0), (0.1, 0.4, 0)], turned, start=start)
    assert "its orientation follows from its position: leave the orientation out" in message
    message = refused(delta, [[0, 0, -1.0], [0, 0, -1.1]], [[0, 0, 0.1], [0, 0, 0.1]])
    assert "waypoint 1" in message
    assert "0.1 rad remain; turn it less: " in message
    assert "it does not turn (rpy stays 0, 0, 0 rad)" in message
    level = cartesian_motion(delta, [0, 1], [[0, 0, -1.0], [0, 0, -1.1]], np.zeros((2, 3)))
    assert level.positions[0] == pytest.approx(arms_of_the_delta([0, 0, -1.0]), abs=1e-6)


def test_singular_configurations_are_told_apart(five_bar):
    """Stretched legs lose a direction (type 1); rods in one line hold nothing (type 2)."""
    highest = math.sqrt((CRANK + ROD) ** 2 - BASE**2)
    message = refused(five_bar, [(*HOME, 0), (0, highest, 0)], start=legs(*HOME))
    assert "waypoint 2" in message
    assert "singular (type 1)" in message
    # Both rods level: the tool between the elbows, cranks leaning outwards.
    height = math.sqrt(CRANK**2 - (ROD - BASE) ** 2)
    message = refused(five_bar, [(*HOME, 0), (0, height, 0)], path="line", start=legs(*HOME))
    assert "type 2" in message
    assert "(left, right) stand" in message
    through = [(*HOME, 0), (0, height - 0.05, 0)]
    message = refused(five_bar, through, path="line", start=legs(*HOME))
    assert "on the line to waypoint 2" in message
    assert "type 2" in message
    message = refused(five_bar, through, start=legs(*HOME))
    assert "on the way to waypoint 2" in message
    assert "type 2" in message


def test_what_nothing_determines_is_named(five_bar, urdf, delta):
    places, start = [(*HOME, 0), (0.1, 0.4, 0)], legs(*HOME)
    message = refused(five_bar, places, start=start, driven=["left"])
    assert "nothing determines 'left_elbow', 'right', 'right_elbow'" in message
    message = refused(five_bar, places, start=start, driven=["left", "right", "left_elbow"])
    assert "leave them 2 of 3 freedoms; name 2, such as left, right" in message
    message = refused(five_bar, places, start=start, driven=["motor"])
    assert "no joint to drive 'motor'; available: left, left_elbow" in message
    assert "no joint to drive 'ball_1a'" in refused(delta, [[0, 0, -1]] * 2, driven=["ball_1a"])
    open_arm = jp.Mechanism(jp.shipped("scara.urdf"))
    assert "all its joints are driven" in refused(open_arm, [[0.4, 0, 0]] * 2, driven=["joint_a"])


def test_a_wrist_beside_the_loops_is_named_or_driven(urdf):
    """No loop leads it: inverse kinematics drives it, and a drive that needs it says so."""
    wrist = body("hand") + joint("wrist", "left_rod", "hand", "continuous", at=f"{ROD} 0 0")
    path = urdf(*five_bar_parts(), wrist)
    robot = jp.Mechanism(path, loops=END, tool="tool", gravity=(0, 0, 0))
    places = [(*HOME, 0), (0.1, 0.4, 0)]
    found = cartesian_path(robot, [0, 0.2], places, start=legs(*HOME))
    assert found.motion.joints == ("left", "right", "wrist")
    message = refused(robot, places, start=legs(*HOME), driven=["left", "right"])
    assert "nothing determines 'wrist'" in message
    two = jp.Motion(["left", "right"], [0, 0.2], found.motion.positions[:, :2])
    with pytest.raises(jp.JointplayError, match="nothing determines 'wrist': no loop leads it"):
        jp.simulate(robot, two, state=found.start, step=1e-4)


@pytest.mark.thorough
def test_limits_hold_in_loops_too(delta):
    """The arms of the delta end at 80 degrees: straight down it comes no lower."""
    upper, rod = 0.524, 1.244
    out = 0.567 * 3**0.5 / 6 - 0.076 * 3**0.5 / 3 + upper * math.cos(math.radians(80))
    lowest = -upper * math.sin(math.radians(80)) - math.sqrt(rod**2 - out**2)
    found = reachable(delta, [[0, 0, -1.1], [0, 0, lowest + 1e-3], [0, 0, lowest - 1e-3]])
    assert found.tolist() == [True, True, False]
    message = refused(delta, [[0, 0, -1.1], [0, 0, lowest - 5e-3]])
    assert "violates the limits of joint 'arm_" in message


def test_a_palletiser_keeps_its_wrist_level(urdf):
    """A turning column, an arm, a forearm driven by a rod from a second crank on the column."""
    arm, forearm, crank = 0.6, 0.5, 0.2
    path = urdf(
        body("column") + joint("turn", "base", "column", "continuous", at="0 0 0.4"),
        body("upper") + joint("shoulder", "column", "upper", "continuous", axis="0 1 0"),
        body("lever") + joint("lift", "column", "lever", "continuous", axis="0 1 0"),
        body("fore") + joint("elbow", "upper", "fore", "continuous", "0 1 0", f"0 0 {arm}"),
        body("link") + joint("pin", "lever", "link", "continuous", "0 1 0", f"-{crank} 0 0"),
        '<link name="tool"/>' + joint("tip", "fore", "tool", "fixed", at=f"{forearm} 0 0"),
    )
    along = (-math.pi / 2, 0, 0)  # z of a loop's frames is the axis of its hinge
    rod = Loop("link", "fore", (0, 0, arm), along, (-crank, 0, 0), along)
    robot = jp.Mechanism(path, loops={"rod_end": rod}, tool="tool")
    places = np.array([[0.6, 0.1, 0.7], [0.3, 0.6, 0.9], [0.5, -0.3, 0.5]])
    motion = cartesian_motion(robot, [0, 1, 2], places)
    assert motion.joints == ("turn", "lift", "shoulder")
    for (turn, lift, shoulder), (x, y, z) in zip(motion.positions, places, strict=True):
        out = arm * math.sin(shoulder) + forearm * math.cos(lift)
        high = 0.4 + arm * math.cos(shoulder) - forearm * math.sin(lift)
        assert math.sin(turn - math.atan2(y, x)) == pytest.approx(0.0, abs=1e-8)
        assert [abs(out), high] == pytest.approx([math.hypot(x, y), z], abs=1e-8)


GEARED = '<mimic joint="left" multiplier="-1" offset="3.141592653589793"/>'


def geared(urdf, *more):
    return jp.Mechanism(
        urdf(*five_bar_parts(GEARED), *more), loops=END, tool="tool", gravity=(0, 0, 0)
    )


def test_cranks_geared_to_each_other_lead_the_tool_up_and_down(urdf):
    """right = pi - left: the tool stays in the middle, and one drive is enough."""
    robot = geared(urdf)
    motion = cartesian_motion(robot, [0, 1], [(*HOME, 0), (0, 0.4, 0)], start=legs(*HOME))
    assert motion.joints == ("left",)
    for row, y in zip(motion.positions, (0.35, 0.4), strict=True):
        assert math.sin((row[0] - legs(0, y)["left"]) / 2) == pytest.approx(0, abs=1e-8)
    whole = complete_motion(robot, motion, {})
    assert whole.following["right"].multiplier == -1
    q = whole.motion(np.linspace(0, 1, 7))[0]
    names = whole.motion.joints
    turned = q[:, names.index("left")] + q[:, names.index("right")]
    assert turned == pytest.approx(np.full(7, math.pi), abs=1e-12)
    message = refused(robot, [(*HOME, 0), (0.05, 0.4, 0)], start=legs(*HOME))
    assert "waypoint 2" in message
    assert "the tool can be led along y; its x stays 0 m; its z stays 0 m" in message


def test_a_joint_that_mimics_one_that_follows_from_loops_follows(urdf):
    """A pointer beside the loops turns twice as far as an elbow, and 0.1 rad further."""
    pointer = joint("pointer", "base", "needle", "continuous", at="0 0 0.1")
    mimic = '<mimic joint="left_elbow" multiplier="2" offset="0.1"/>'
    needle = body("needle") + pointer.replace("</joint>", f"{mimic}</joint>")
    robot = jp.Mechanism(urdf(*five_bar_parts(), needle), loops=END, tool="tool", gravity=(0, 0, 0))
    found = cartesian_path(robot, [0, 0.2], [(*HOME, 0), (0.1, 0.4, 0)], start=legs(*HOME))
    assert found.motion.joints == ("left", "right")
    result = prescribed(robot, found)
    q = result["q"].values
    names = list(robot.ideal().coordinates)
    elbow, turned = q[:, names.index("left_elbow")], q[:, names.index("pointer")]
    assert np.ptp(elbow) > 0.1
    assert turned == pytest.approx(2 * elbow + 0.1, abs=1e-6)


def test_a_mimic_that_stands_for_a_loop_leaves_it_to_the_loop(urdf):
    """A parallelogram whose URDF lets the follower mimic the crank, as grippers have it."""
    mimic = '<mimic joint="crank" multiplier="1"/>'
    follower = joint("rocker", "base", "rocker_link", "continuous", at="0.3 0 0")
    path = urdf(
        body("crank_link") + joint("crank", "base", "crank_link", "continuous"),
        body("rocker_link") + follower.replace("</joint>", f"{mimic}</joint>"),
        body("bar") + joint("knee", "crank_link", "bar", "continuous", at="0 0.1 0"),
    )
    ends = Loop("bar", "rocker_link", bearing_xyz=(0.3, 0, 0), journal_xyz=(0, 0.1, 0))
    robot = jp.Mechanism(path, loops={"end": ends}, gravity=(0, 0, 0))
    assert followed_mimics(robot, np.zeros(robot.model.nq)) == {}
    motion = jp.Motion(["crank"], [0, 1], [[0.0], [0.5]])
    assert complete_motion(robot, motion).motion.joints == ("crank",)


@pytest.mark.thorough
def test_platform_on_a_ball_joint_with_play_is_assembled():
    """The ball that carries the platform turns about all axes, play or not."""
    mechanism = jp.Scenario.load("jointplay:delta.toml").simulation("0.1 mm").mechanism
    q = mechanism.configuration({name: 0.3 for name in ARMS})
    at = [mechanism.coordinate(name) for name in ARMS]
    closed = assemble(mechanism, q, at)
    assert np.abs(openings(mechanism, closed)).max() < 1e-9


def test_scenarios_name_the_place_of_what_is_wrong(tmp_path):
    text = (
        jp.shipped("three_rrr.toml")
        .read_text()
        .replace('urdf = "three_rrr.urdf"', f'urdf = "{jp.shipped("three_rrr.urdf")}"')
    )
    place = tmp_path / "wrong.toml"
    place.write_text(text.replace('"motor_3"]', '"motor_9"]'))
    with pytest.raises(jp.JointplayError, match=r"motion\.driven.*no joint to drive 'motor_9'"):
        jp.Scenario.load(place).simulation("ideal")
    place.write_text(text.replace('["30 mm", "-30 mm", 0]', '["900 mm", "-30 mm", 0]'))
    with pytest.raises(jp.JointplayError, match=r"tool_position.*waypoint 4"):
        jp.Scenario.load(place).simulation("ideal")


@pytest.mark.thorough
def test_iso_cube_of_a_delta_and_its_mirror_image(delta):
    """Its platform may hang below the arms or stand above: the drives alone lead to the first."""
    motion = cube_motion(delta, (0.0, 0.0, -1.1), 0.2)
    assert motion.joints == ARMS
    corner = np.array([0.0, 0.0, -1.1]) + 0.08 * np.array([-1, -1, -1])  # P5
    assert motion.positions[2] == pytest.approx(arms_of_the_delta(corner), abs=1e-7)
    above = {f"knee_{leg}{side}": 2.053 for leg in (1, 2, 3) for side in "ab"}
    with pytest.raises(jp.JointplayError, match="can be assembled in several ways"):
        cube_motion(delta, (0.0, 0.0, 1.06), 0.1, start=above)


@pytest.mark.parametrize("sides", [(1, -1), (1, 1), (-1, 1)])
@pytest.mark.parametrize("case", ["ideal", "0.1 mm"])
def test_start_of_a_scenario_selects_how_loops_are_assembled(urdf, tmp_path, sides, case):
    """Nearly where the joints stand is enough; with play, too, the tool begins where it shall."""
    near = {name: round(angle + 0.05, 2) for name, angle in legs(*HOME, *sides).items()}
    path = urdf(*five_bar_parts())
    place = tmp_path / "five_bar.toml"
    place.write_text(
        f"""[robot]
urdf = "{path}"
tool = "tool"
gravity = "balanced"
[loops.end]
bearing = {{ link = "left_rod", xyz = [{ROD}, 0, 0] }}
journal = {{ link = "right_rod", xyz = [{ROD}, 0, 0] }}
[joints.end]
kind = "planar"
bearing_radius = "5 mm"
bearing_length = "10 mm"
restitution = 0.8
[joints.left_elbow]
kind = "planar"
bearing_radius = "5 mm"
bearing_length = "10 mm"
restitution = 0.8
[start]
{chr(10).join(f"{name} = {angle}" for name, angle in near.items())}
[motion]
times = [0, 0.5]
tool_position = [[{HOME[0]}, {HOME[1]}, 0], [0.05, 0.38, 0]]
[integration]
duration = "0.02 s"
[cases.ideal]
joints.end.ideal = true
joints.left_elbow.ideal = true
[cases."0.1 mm"]
joints.end.radial_clearance = "0.1 mm"
joints.left_elbow.radial_clearance = "0.1 mm"
"""
    )
    simulation = jp.Scenario.load(place).simulation(case)
    assert simulation.motion.joints == ("left", "right")
    result = simulation.run(check_step=False, estimate=False)
    away = result["tool_position"].values[0] - [*HOME, 0.0]
    assert np.linalg.norm(away) < (1e-8 if case == "ideal" else 3e-4)
