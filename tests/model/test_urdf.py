"""What a URDF may say, and how it is refused."""

import pickle
import re
import subprocess
import sys

import numpy as np
import pytest
from conftest import body, joint

from jointplay import JointplayError, Mechanism, shipped
from jointplay.base.errors import MissingName
from jointplay.cli import main
from jointplay.model.design import parse
from jointplay.model.formats import read
from jointplay.model.inertias import impossible_inertias
from jointplay.model.robots import robot_urdf, robots
from jointplay.model.urdf import elements
from jointplay.scenario.robot import robot_scenario


def dynamics(attributes):
    return joint("j", "base", "l").replace("</joint>", f"<dynamics {attributes}/></joint>")


def tensor(ixx, iyy, izz, ixy=0.0):
    return body("l").replace(
        'ixx="0.01" iyy="0.01" izz="0.01" ixy="0"',
        f'ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="{ixy}"',
    )


def test_joints_are_listed_in_the_order_of_the_file():
    description = read(shipped("scara.urdf"))
    assert [j.kind for j in description.joints.values()][:4] == [
        "revolute",
        "revolute",
        "prismatic",
        "revolute",
    ]
    assert description.revolute == ["joint_a", "joint_b", "joint_c"]


@pytest.mark.parametrize(
    ("attributes", "friction", "damping"),
    [('friction="0.3" damping="2"', 0.3, 2.0), ('damping="2"', 0.0, 2.0), ("", 0.0, 0.0)],
)
def test_dynamics_are_read(urdf, attributes, friction, damping):
    entry = read(urdf(body("l"), dynamics(attributes))).joints["j"]
    assert (entry.friction, entry.damping) == (friction, damping)


@pytest.mark.parametrize("attributes", ['friction="much"', 'damping="inf"'])
def test_dynamics_that_are_no_numbers_are_named(urdf, attributes):
    value = attributes.split('"')[1]
    with pytest.raises(JointplayError, match=f"joint 'j'.*got '{value}'"):
        read(urdf(body("l"), dynamics(attributes)))


@pytest.mark.parametrize("frame", ['<link name="l"/>', body("l", mass=0.0, inertia=0.0)])
def test_frames_without_mass_are_no_bodies(urdf, frame):
    read(urdf(frame, joint("j", "base", "l", "fixed")))


@pytest.mark.parametrize(
    ("link", "hinge", "kind"), [("universe", "j", "link"), ("l", "universe", "joint")]
)
def test_what_is_called_like_the_ground_in_pinocchio_is_refused(urdf, link, hinge, kind):
    with pytest.raises(JointplayError, match=f"a {kind} of the URDF is called 'universe'"):
        read(urdf(body(link), joint(hinge, "base", link)))


def test_flat_plate_is_the_limit_of_what_can_be(urdf):
    read(urdf(tensor(1.0, 2.0, 3.0), joint("j", "base", "l")))
    with pytest.raises(JointplayError, match=r"no rigid body has 3\.01 > 1 \+ 2"):
        read(urdf(tensor(1.0, 2.0, 3.01), joint("j", "base", "l")))


def test_products_of_inertia_are_judged_by_principal_moments(urdf):
    # diag(2, 2, 2) with ixy has the principal moments 2 - ixy, 2, 2 + ixy: possible up to 2/2.
    read(urdf(tensor(2.0, 2.0, 2.0, 0.99), joint("j", "base", "l")))
    with pytest.raises(JointplayError, match=r"'l' has principal moments 0\.99, 2, 3\.01"):
        read(urdf(tensor(2.0, 2.0, 2.0, 1.01), joint("j", "base", "l")))


def test_both_shipped_robots_differ_in_inertia_only():
    robots = [read(shipped("scara.urdf"))]
    robots += [read(shipped("scara_as_printed.urdf"), allow_unphysical=["arm1"])]
    assert robots[0].joints == robots[1].joints
    for text in (robot.text for robot in robots):
        assert np.isclose(sum(float(part.split('"')[0]) for part in text.split('mass value="')[1:]),
                          5.78 + 4.35 + 3.03)  # fmt: skip


def test_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_bytes(b"\xff\xfe\x00robot")
    with pytest.raises(JointplayError, match=r"cannot read the robot .*robot\.urdf"):
        read(path)


def limited(kind, limit, more=""):
    """A joint with the attributes `limit`, or without any."""
    element = f"<limit {limit}/>" if limit else ""
    return (
        f'<joint name="j" type="{kind}"><parent link="base"/><child link="l"/>'
        f'<axis xyz="0 0 1"/>{element}{more}</joint>'
    )


FOLLOWER = '<mimic joint="{}" multiplier="-2" offset="0.1"/></joint>'


def follower(name, parent, child, leader, kind="revolute"):
    return joint(name, parent, child, kind).replace("</joint>", FOLLOWER.format(leader))


@pytest.mark.parametrize(
    ("kind", "limit", "found"),
    [
        ("revolute", 'lower="-1" upper="2" effort="3" velocity="4"', (-1.0, 2.0, 4.0, 3.0)),
        ("prismatic", 'upper="0.5" effort="0" velocity="0"', (0.0, 0.5, None, None)),
        ("revolute", 'lower="0" upper="0" effort="3" velocity="4"', (None, None, 4.0, 3.0)),
        ("continuous", 'effort="3" velocity="4"', (None, None, 4.0, 3.0)),
        ("continuous", "", (None, None, None, None)),
        ("fixed", 'lower="-1" upper="2" effort="3" velocity="4"', (None, None, None, None)),
        ("revolute", 'lower="-inf" upper="inf"', (-np.inf, np.inf, None, None)),
        ("revolute", 'lower="-1" upper="2" effort="-1" velocity="-1"', (-1.0, 2.0, None, None)),
    ],
)  # fmt: skip
def test_limits_are_read(urdf, kind, limit, found):
    entry = read(urdf(body("l"), limited(kind, limit))).joints["j"]
    assert (entry.lower, entry.upper, entry.speed, entry.effort) == found


def test_limits_that_are_no_numbers_are_named(urdf):
    with pytest.raises(JointplayError, match="joint 'j': limit upper must be a number, got 'far'"):
        read(urdf(body("l"), limited("revolute", 'lower="0" upper="far" effort="1" velocity="1"')))


def test_mimicry_is_read(urdf):
    bodies = body("l"), body("m"), joint("a", "base", "l"), follower("b", "l", "m", "a")
    description = read(urdf(*bodies))
    assert description.joints["a"].mimic is None
    assert description.joints["b"].mimic == ("a", -2.0, 0.1)
    assert pickle.loads(pickle.dumps(description)).joints["b"].mimic == ("a", -2.0, 0.1)


def test_joints_that_mimic_each_other_in_a_ring_are_refused(urdf):
    path = urdf(body("l"), body("m"), follower("a", "base", "l", "b"), follower("b", "l", "m", "a"))
    with pytest.raises(JointplayError, match="mimic each other in a cycle: a - b - a"):
        read(path)


def test_a_joint_that_mimics_what_is_not_there_mimics_nothing(urdf):
    entry = read(urdf(body("l"), follower("a", "base", "l", "z"))).joints["a"]
    assert entry.mimic is None


def test_a_run_says_which_joint_mimics_nothing(tmp_path):
    path = changed(tmp_path, "<axis", '<mimic joint="joint_x"/><axis')
    scenario = robot_scenario(str(path), ["joint_b"])
    scenario.simulation()
    assert scenario.notes[0] == (
        "joint_a mimics 'joint_x', which is no joint, and moves by itself; "
        'did you mean "joint_c"?'
    )


def test_transmissions_are_read(urdf):
    gear = (
        '<transmission name="t"><joint name="j"/><actuator name="m">'
        "<mechanicalReduction>160</mechanicalReduction></actuator></transmission>"
    )
    found = read(urdf(body("l"), joint("j", "base", "l"), gear)).reductions
    assert found == {"j": 160.0}


def test_pictures_are_not_looked_at(urdf):
    mesh = '<visual><geometry><mesh filename="not/there.dae"/></geometry></visual>'
    path = urdf(body("l").replace("</link>", f"{mesh}</link>"), joint("j", "base", "l"))
    assert read(path).joints["j"].upper == 9.0


def test_the_slow_reader_comes_with_the_first_question_only():
    code = (
        "import sys; from jointplay import shipped; from jointplay.model.formats import read; "
        "d = read(shipped('scara.urdf')); early = 'yourdfpy' in sys.modules; "
        "d.declared; print(early, 'yourdfpy' in sys.modules)"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.split() == ["False", "True"]


SCARA = shipped("scara.urdf").read_text()


def changed(tmp_path, old, new):
    """The SCARA with its first `old` replaced."""
    assert old in SCARA
    path = tmp_path / "robot.urdf"
    path.write_text(SCARA.replace(old, new, 1), encoding="utf-8")
    return path


@pytest.mark.parametrize("number", ["\u00a04.35", "\uff14.35", "4_35", "0x4", "4,35", "inf"])
def test_numbers_that_pinocchio_reads_as_nothing_are_refused(tmp_path, number):
    path = changed(tmp_path, "4.35", number)
    with pytest.raises(JointplayError, match="link 'arm2': mass value must be a finite number"):
        read(path)


@pytest.mark.parametrize("number", ["4.35 ", "4.35\n", "&#9;4.35&#10;", "+4.350e0"])
def test_white_space_about_a_number_changes_nothing(tmp_path, number):
    model = parse(read(changed(tmp_path, "4.35", number)))
    assert model.inertias[2].mass == 4.35
    vector = parse(read(changed(tmp_path, "0.1645 0 0", "0.1645&#9;0\n0")))
    assert vector.inertias[1].lever.tolist() == [0.1645, 0.0, 0.0]


def test_masses_are_those_that_the_urdf_gives(monkeypatch):
    description = read(shipped("scara.urdf"))
    masses = [link.find("mass") for link in description.parsed.iter("inertial")]
    assert len(masses) == 3
    monkeypatch.setitem(masses[1].attrib, "value", "4_35")  # as if it had not been checked
    with pytest.raises(JointplayError, match=r"Pinocchio reads 0 kg where .* 435 kg \(arm2\)"):
        parse(description)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<origin xyz", "<orgin xyz", "link 'base': <visual> has <orgin>.*mean \"origin\""),
        ("xyz=", "xy=", '<origin> has "xy".*mean "xyz"'),
        ("<axis", "<axes", "joint 'joint_a' has <axes>.*mean \"axis\""),
        ("<axis xyz=", "<axis xzy=", '<axis> has "xzy".*mean "xyz"'),
        ("lower=", "low=", '<limit> has "low".*mean "lower"'),
        ("lower=", "min=", '<limit> has "min".*mean "lower"'),
        ("upper=", "max=", '<limit> has "max".*mean "upper"'),
        ("<mass value=", "<mass kg=", '<mass> has "kg".*mean "value"'),
        ("</robot>", '<jiont name="j"/></robot>', 'the robot has <jiont>.*mean "joint"'),
        (
            'type="revolute"',
            'type="revolut"',
            'no type of joint "revolut"; did you mean "revolute"',
        ),
        ("</link>", '<mass value="1"/></link>', "<mass>, where it is not read.* in <inertial>"),
        ("<axis", '<origin xyz="0 0 1"/><axis', "joint 'joint_a' has 2 elements <origin>"),
        ("<axis", '<axis xyz="0 1 0"/><axis', "has 2 elements <axis>"),
        ("<mass", '<mass value="1"/><mass', "link 'arm1': <inertial> has 2 elements <mass>"),
        ("<inertial>", "<inertial/><inertial>", "link 'arm1' has 2 elements <inertial>"),
        ('lower="-2.3"', 'lower="23"', "'joint_a' has the lower limit 23 above the upper one 2.3"),
        ('velocity="10"', 'velocity="-10"', "limit velocity must not be negative, got -10"),
        ("<axis", '<dynamics damping="-1"/><axis', "'joint_a': damping must not be negative"),
        ('velocity="10"', 'velocity="1e-400"', "velocity must be a number, got '1e-400'"),
        ('upper="2.3"', 'upper="1e999"', "upper must be a number, got '1e999'"),
        ('value="5.78"', 'value="1e-200"', "no body of 1e-200 kg reaches so far"),
    ],
)
def test_slips_of_the_pen_are_refused(tmp_path, old, new, said):
    with pytest.raises(JointplayError, match=said):
        read(changed(tmp_path, old, new))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<axis", '<dynamics damping="1"><friction>4</friction></dynamics><axis', "<friction> in"),
        ("<axis", '<dynamics damping="1">0.4</dynamics><axis', "the text '0.4' in joint 'joint_a'"),
        ("</joint>", "</joint> left over", "the text 'left over' in the robot"),
        ("<axis", '<physics><limit effort="9"/></physics><axis', "<physics> in joint 'joint_a'"),
        ("<visual>", '<visual xyz="0 0 1">', '"xyz" in link'),
        ("<limit ", '<limit friction="0.3" ', "\"friction\" in joint 'joint_a': <limit>"),
        ("</link>", '<origin xyz="0 0 1"/></link>', "<origin> in link"),
        ('xyz="0 0 1"', 'xyz="0 0 2"', "only its direction counts: joint_a"),
        ('<material name="blue">', '<material name="bleu">', "without a colour in the URDF: blue"),
        ("</robot>", '<transmission name="t"><joint name="J"/></transmission></robot>', ": t"),
    ],
)
def test_what_nobody_reads_is_said(tmp_path, old, new, said, capsys):
    assert not read(shipped("scara.urdf")).doubts
    path = changed(tmp_path, old, new)
    assert main(["robots", str(path)]) == 0
    assert said in " ".join(capsys.readouterr().out.split())
    scenario = robot_scenario(str(path), ["joint_b"])
    scenario.simulation()
    assert any(said in line for line in scenario.notes)


def test_elements_may_not_be_nested_without_end(tmp_path):
    for depth, said in ((150, "no link"), (900, "nests elements more than 200 deep")):
        path = tmp_path / f"{depth}.urdf"
        path.write_text(f"<robot name='r'>{'<a>' * depth}{'</a>' * depth}</robot>")
        with pytest.raises(JointplayError, match=said):
            read(path)


def test_what_other_programs_put_into_a_urdf_stays_allowed(tmp_path):
    more = (
        '<gazebo reference="arm1"/><gazebo/><ros2_control name="c"/><transmission name="t"/>'
        '<loop_joint name="l"/><drake:joint xmlns:drake="drake" name="d"/></robot>'
    )
    text = SCARA.replace("</robot>", more).replace("<limit ", '<limit current="3" jerk="2" ')
    path = tmp_path / "robot.urdf"
    path.write_text(text.replace("<inertial>", "<contact/><self_collide/><inertial>"))
    parse(read(path))


@pytest.mark.parametrize(
    "limit",
    [
        'lower="-inf" upper="inf" effort="1" velocity="1"',
        'lower="0" upper="1" effort="-1" velocity="-1"',
        'lower="0" upper="1"',
    ],
)
def test_limits_that_say_nothing_reach_no_reader_that_cannot_have_them(urdf, limit):
    assert parse(read(urdf(body("l"), limited("revolute", limit)))).nq == 1


@pytest.mark.thorough
def test_every_robot_is_read_with_all_its_words():
    for name in robots():
        path = robot_urdf(name)
        description = read(path, impossible_inertias(elements(path.read_text(), path)))
        assert description.links, name


def test_what_others_left_in_a_urdf_is_no_reason_to_refuse_it(tmp_path):
    links = read(shipped("scara.urdf")).links
    camera = '<gazebo><sensor:camera name="c"/></gazebo>'
    assert read(changed(tmp_path, "</robot>", f"{camera}</robot>")).links == links
    declared = '<robot name="scara" xmlns:xacro="http://www.ros.org/wiki/xacro">'
    path = changed(tmp_path, '<robot name="scara">', declared)
    path.write_text(path.read_text().replace("</robot>", "<xacro:sensors_of_others/></robot>"))
    assert read(path).links == links
    shape, colours = '<geometry><sphere radius="1"/></geometry>', '<material name="a"/>' * 2
    visual = f"<visual>{shape}{colours}</visual>"
    assert read(changed(tmp_path, "</link>", f"{visual}</link>")).links == links
    unlimited = read(changed(tmp_path, 'velocity="10"', 'velocity="-1"'))
    assert unlimited.joints["joint_a"].speed is None
    assert parse(unlimited).njoints == len(unlimited.moving) + 1


@pytest.mark.parametrize("name", ["/etc/passwd", "../pyproject.toml", "..", "", "x/../scara.urdf"])
def test_a_shipped_file_is_named_not_a_path(name):
    with pytest.raises(MissingName, match="no shipped file"):
        read(f"jointplay:{name}")


def test_an_axis_next_to_nothing_has_no_direction(tmp_path):
    text = (
        '<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="continuous">'
        '<parent link="a"/><child link="b"/><axis xyz="0 1e-300 0"/></joint></robot>'
    )
    path = tmp_path / "r.urdf"
    path.write_text(text)
    with pytest.raises(JointplayError, match="which has no direction"):
        read(path)
    path.write_text(text.replace("1e-300", "1e300"))
    with pytest.raises(JointplayError, match=r"axis must be no larger than 1e\+06"):
        read(path)


HALF = """<robot name="r"><link name="a"/><link name="b"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
<joint name="j" type="revolute"><parent link="a"/><child link="b"/>{}</joint></robot>"""


@pytest.mark.parametrize(
    ("limit", "words"),
    [
        ('<limit upper="1"/>', "no limit lower, effort, velocity in the URDF, and lower counts"),
        ('<limit lower="-1" upper="1" velocity="2"/>', "no limit effort in the URDF: j"),
        ("", "no limit lower, upper, effort, velocity in the URDF: j"),
    ],
)
def test_limits_that_are_not_whole_are_said(tmp_path, limit, words, capsys):
    path = tmp_path / "r.urdf"
    path.write_text(HALF.format(limit))
    assert main(["robots", str(path)]) == 0
    assert words in capsys.readouterr().out
    assert main(["check", str(path), "--joint", "j", "--no-picture"]) == 0
    assert words in capsys.readouterr().out
    path.write_text(HALF.format('<limit lower="-1" upper="1" velocity="2" effort="0"/>'))
    assert main(["robots", str(path)]) == 0
    assert "no limit" not in capsys.readouterr().out
    path.write_text(HALF.format('<limit lower="0.5"/>'))
    with pytest.raises(JointplayError, match=r"the upper one is missing, which means 0: give it"):
        read(path)


CAMERA = body("camera").replace(
    '<inertia ixx="0.01" iyy="0.01" izz="0.01"', '<inertia ixx="0" iyy="0" izz="1e-5"'
)


def test_what_is_fixed_to_a_body_counts_in_the_sum(urdf, capsys):
    """Pinocchio adds both, and has what is not positive definite alone in what is."""
    weld = joint("weld", "l", "camera", kind="fixed")
    path = urdf(body("l"), CAMERA, joint("j", "base", "l"), weld)
    mechanism = Mechanism(path)
    assert "no rigid body has" in mechanism.description.doubts[0]
    assert "camera" in mechanism.description.doubts[0]
    assert mechanism.model.inertias[1].mass == pytest.approx(4.0)
    loose = joint("weld", "l", "camera")
    with pytest.raises(JointplayError, match="link 'camera' has principal moments"):
        Mechanism(urdf(body("l"), CAMERA, joint("j", "base", "l"), loose))


def test_the_base_needs_an_inertia_only_if_it_is_free(urdf):
    path = urdf(body("l"), joint("j", "base", "l"))
    text = path.read_text()
    heavy = '<link name="base"><inertial><mass value="3"/><inertia ixx="-1" ixy="0" ixz="0" '
    heavy += 'iyy="1" iyz="0" izz="1"/></inertial></link>'
    path.write_text(re.sub('<link name="base" */>', heavy, text))
    assert "base" in Mechanism(path).description.doubts[0]
    with pytest.raises(JointplayError, match="link 'base' has principal moments"):
        Mechanism(path, base="free")


def test_a_budget_needs_no_inertia_and_says_which_is_impossible(urdf, capsys):
    path = urdf(tensor(1.0, 0.1, 0.1), joint("j", "base", "l"))
    command = [str(path), "--joint", "j", "--clearance", "0.1 mm"]
    assert main(["budget", *command]) == 0
    assert "without effect where nothing moves: l;" in capsys.readouterr().out
    assert main(["run", *command, "--out", str(path.parent / "out")]) == 2
    assert "no rigid body has 1 > 0.1 + 0.1" in capsys.readouterr().err


def test_entries_of_an_inertia_that_are_given_twice_must_be_equal(urdf):
    path = urdf(body("l"), joint("j", "base", "l"))
    text = path.read_text().replace('ixy="0"', 'ixy="0.001" iyx="0.001"', 1)
    path.write_text(text)
    assert any("iyx" in line for line in Mechanism(path).description.doubts)
    path.write_text(text.replace('iyx="0.001"', 'iyx="0.002"'))
    with pytest.raises(JointplayError, match=r"ixy 0.001 and iyx 0.002, which must be equal"):
        Mechanism(path)


def test_the_world_that_no_link_is_called_is_the_ground(urdf):
    path = urdf(body("l"), joint("weld", "world", "base", kind="fixed"), joint("j", "base", "l"))
    description = Mechanism(path).description
    assert description.root == "world"
    assert "the ground" in description.doubts[0]
    with pytest.raises(MissingName, match="'earth'"):
        Mechanism(urdf(body("l"), joint("weld", "earth", "base"), joint("j", "base", "l")))


def test_a_floating_joint_to_the_ground_is_a_base_that_is_held_or_free(urdf, capsys, tmp_path):
    floats = joint("float", "base", "trunk", kind="floating")
    path = urdf(body("trunk"), body("l"), floats, joint("j", "trunk", "l"))
    assert Mechanism(path).model.nv == 1
    assert Mechanism(path, base="free").model.nv == 7
    command = [str(path), "--joint", "j", "--clearance", "0.1 mm"]
    assert main(["budget", *command]) == 0
    assert "'float' to the ground: --base free, or held (default)" in capsys.readouterr().out
    short = ["--set", "integration.duration=0.01", "--no-figures", "--out", str(tmp_path / "o")]
    assert main(["run", *command, *short, "--base", "free"]) == 0
