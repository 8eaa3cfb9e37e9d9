"""Robots written in xacro: expanded wherever a URDF is taken, and what is wrong said in a line."""

import json
import os
import xml.etree.ElementTree as ElementTree

import pytest
from conftest import still
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp
from jointplay import JointplayError, Mechanism
from jointplay.base.errors import MissingName
from jointplay.cli import main
from jointplay.model import formats, xacro
from jointplay.model.robots import Source
from jointplay.model.visuals import find_mesh, mesh_folders

pytestmark = pytest.mark.needs("xacro")

NAMESPACE = 'xmlns:xacro="http://www.ros.org/wiki/xacro"'
MACROS = f"""<robot {NAMESPACE}>
<xacro:macro name="arm" params="name parent length mass:=1">
  <link name="${{name}}">
    <inertial><origin xyz="${{length / 2}} 0 0"/><mass value="${{mass}}"/>
      <inertia ixx="0.01" iyy="0.01" izz="0.01" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><geometry><mesh filename="package://xacro_parts/meshes/arm.stl"/></geometry></visual>
    <collision><geometry>
      <mesh filename="file://$(find xacro_parts)/meshes/arm.stl"/>
    </geometry></collision>
    <collision><geometry>
      <mesh filename="file:///$(find xacro_parts)/meshes/arm.stl"/>
    </geometry></collision>
  </link>
  <joint name="${{name}}_joint" type="revolute">
    <parent link="${{parent}}"/><child link="${{name}}"/><axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
</xacro:macro>
</robot>"""
ROBOT = f"""<robot name="robot" {NAMESPACE}>
<xacro:arg name="length" default="0.4"/>
<xacro:arg name="heavy" default="false"/>
<xacro:include filename="$(find xacro_parts)/urdf/macros.xacro"/>
<link name="base"/>
<xacro:arm name="arm" parent="base" length="$(arg length)"
  mass="${{2 if xacro.arg('heavy') == 'true' else 1}}"/>
</robot>"""
BARE = f"""<robot name="bare" {NAMESPACE}><link name="base"/>%s</robot>"""


def package(folder, name, files, called=None):
    """A ROS package, whose folder may be called otherwise."""
    folder = folder / (called or name)
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    (folder / "package.xml").write_text(f"<package><name>{name}</name></package>")
    return folder


@pytest.fixture(autouse=True)
def _no_ros(monkeypatch):
    for variable in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(variable, raising=False)


@pytest.fixture
def robot(tmp_path):
    """A xacro in one package that includes macros of another."""
    source = tmp_path / "ws" / "src"
    package(
        source, "xacro_parts", {"urdf/macros.xacro": MACROS, "meshes/arm.stl": "solid"}, "its-parts"
    )
    return package(source, "robot", {"urdf/robot.xacro": ROBOT}) / "urdf" / "robot.xacro"


def bare(tmp_path, inside, name="bare.xacro"):
    path = tmp_path / name
    path.write_text(BARE % inside)
    return path


def centre(mechanism):
    return mechanism.model.inertias[1].lever[0]


def test_arguments_count_in_python_scenario_and_commands(robot, tmp_path, capsys):
    assert centre(Mechanism(robot)) == 0.2
    heavy = Mechanism(robot, xacro={"length": 0.6, "heavy": True})
    assert (centre(heavy), heavy.model.inertias[1].mass) == (0.3, 2.0)
    scenario = tmp_path / "arm.toml"
    scenario.write_text(
        f"[robot]\nurdf = {json.dumps(str(robot))}\nxacro = {{ length = 0.6, heavy = true }}\n"
        "[joints.arm_joint]\nradial_clearance = 1e-4\n[motion]\ntimes = [0, 1]\n"
        "[motion.joints]\narm_joint = [0, 0.1]\n"
    )
    assert jp.Scenario.load(scenario).mechanism().description.text == heavy.description.text
    assert main(["check", str(scenario), "--no-picture", "--xacro", "length:=0.8"]) == 0
    options = ["--joint", "arm_joint=0.1mm", "--xacro", "length:=0.6", "--xacro", "heavy:=true"]
    assert main(["budget", str(robot), *options]) == 0
    run = ["run", str(robot), *options, "--duration", "0.002", "--no-figures", "--out"]
    assert main([*run, str(tmp_path / "out")]) == 0
    result = jp.Result.load(tmp_path / "out" / "result.nc")
    assert result.simulation.mechanism.description.text == heavy.description.text
    capsys.readouterr()
    assert main(["robots", str(robot), "--xacro", "length:=0.6"]) == 0
    assert "arm_joint  revolute" in capsys.readouterr().out


def test_result_is_read_again_without_xacro(robot, tmp_path, monkeypatch):
    result = tmp_path / "result.nc"
    mechanism = Mechanism(robot, xacro={"length": 0.6})
    jp.simulate(mechanism, still(mechanism, 0.001)).save(result)
    robot.unlink()
    monkeypatch.setitem(__import__("sys").modules, "xacro", None)
    text = jp.Result.load(result).simulation.mechanism.description.text
    assert text == mechanism.description.text


def test_text_names_no_folder_of_this_machine_and_meshes_are_found(robot, tmp_path):
    mechanism = Mechanism(robot)
    names = [one.get("filename") for one in mechanism.description.elements().iter("mesh")]
    assert names == ["package://xacro_parts/meshes/arm.stl"] * 3
    assert str(tmp_path) not in mechanism.description.text
    found = find_mesh(names[0], mesh_folders(mechanism))
    assert found == tmp_path / "ws" / "src" / "its-parts" / "meshes" / "arm.stl"


def test_meshes_beside_the_file_stay_relative(tmp_path):
    visual = '<visual><geometry><mesh filename="%s"/></geometry></visual>'
    places = "${xacro.abs_filename('m/base.stl')}", "file://${xacro.abs_filename('../m/base.stl')}"
    link = f'<link name="more">{"".join(visual % place for place in places)}</link>'
    fixed = '<joint name="j" type="fixed"><parent link="base"/><child link="more"/></joint>'
    text = formats.read(bare(tmp_path, link + fixed)).text
    names = [one.get("filename") for one in ElementTree.fromstring(text).iter("mesh")]
    assert names == ["m/base.stl", "../m/base.stl"]


@pytest.mark.parametrize("variable", ["ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"])
def test_packages_are_found_where_ros_looks(variable, robot, tmp_path, monkeypatch):
    away = tmp_path / "away" / "share"
    away.mkdir(parents=True)
    os.rename(robot.parents[2] / "its-parts", away / "xacro_parts")
    with pytest.raises(
        JointplayError, match=r"xacro .*robot\.xacro'.*no package 'xacro_parts'.* set ROS_"
    ):
        formats.read(robot)
    monkeypatch.setenv(variable, str(away if variable.startswith("ROS") else away.parent))
    assert formats.read(robot).moving == ["arm_joint"]


def test_change_of_an_included_file_counts(robot):
    before = formats.read(robot)
    assert formats.read(robot) is before  # made once
    macros = robot.parents[2] / "its-parts" / "urdf" / "macros.xacro"
    macros.write_text(MACROS.replace('upper="1"', 'upper="1.5"'))
    assert formats.read(robot).joints["arm_joint"].upper == 1.5


def test_urdf_that_declares_xacro_in_vain_needs_no_library(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "xacro", None)
    assert formats.read(bare(tmp_path, "", "bare.urdf")).links == ("base",)
    path = bare(tmp_path, '<xacro:property name="a" value="1"/>', "used.xacro")
    with pytest.raises(JointplayError, match=r"needs xacro .*pip install"):
        formats.read(path)
    monkeypatch.undo()
    assert formats.read(path).links == ("base",)


def test_xacro_is_expanded_only_if_it_is_named_so_or_asked_for(tmp_path):
    path = bare(tmp_path, '<xacro:arg name="a" default="1"/><link name="l$(arg a)"/>', "used.urdf")
    with pytest.raises(JointplayError, match=r"written in xacro.*name it \.xacro, or give"):
        formats.urdf_text(Source(path, {}), {})
    assert 'name="l2"' in formats.urdf_text(Source(path, {}), {"a": 2})


SYSTEM = (
    "[c for c in ().__class__.__base__.__subclasses__() if c.__name__ == '_wrap_close']"
    "[0].__init__.__globals__['system']('touch PWNED')"
)


@pytest.mark.parametrize(
    "expression",
    [
        f"${{[{SYSTEM} for i in [1]]}}",
        f"${{(lambda: {SYSTEM})()}}",
        f"${{list(map(lambda i: {SYSTEM}, [1]))}}",
        "${[x.__class__ for x in [1]]}",
        "${[x.\uff3f\uff3fclass\uff3f\uff3f for x in [1]]}",  # which Python reads as __class__
        "${(i for i in [1]).gi_frame}",
        "${(lambda: 0).__globals__}",
        "${xacro.load_yaml.__globals__}",
        "${'{0.__class__\\x7d'.format(1)}",
        "${'{x.__class__\\x7d'.format_map(dict(x=1))}",
        "${python.vars(str)}",
        "${python.type(python.type(1))('x', (), {})}",
        "${python['vars'](str)}",
        "${xacro['load_yaml']('/etc/passwd')}",
        "${xacro.load_yaml('/etc/passwd')}",
        "${xacro.load_yaml('../outside.yaml')}",
        "${xacro.load_yaml('link.yaml')}",
        "${xacro.load_yaml('pipe.yaml')}",
        "$(eval open('PWNED', 'w'${'\\x29'})",  # the library gives it all of Python's functions
        "$(eval open)",
        "$(env HOME)",
        '<xacro:include filename="/etc/*.conf"/><link name="${no}"/>',
        '<xacro:include filename="/etc/passwd"/>',
    ],
)
def test_nothing_of_a_file_is_run_or_read_from_elsewhere(expression, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "outside.yaml").write_text("a: 1")
    folder = tmp_path / "robot"
    folder.mkdir()
    (folder / "link.yaml").symlink_to(tmp_path / "outside.yaml")
    os.mkfifo(folder / "pipe.yaml")
    inside = expression if expression.startswith("<") else f"<a>{expression}</a>"
    for name in ("evil.xacro", "evil.urdf"):
        path = bare(folder, inside, name)
        with pytest.raises(JointplayError) as caught:
            formats.read(path)
        assert "\n" not in str(caught.value)
    assert {one.name for one in tmp_path.rglob("*")} == {
        "robot", "outside.yaml", "link.yaml", "pipe.yaml", "evil.xacro", "evil.urdf"
    }  # fmt: skip


@pytest.mark.parametrize(
    ("expression", "words"),
    [
        ("${[0 for i in range(10**9)]}", "more memory|processor time"),
        ("${'a' * 10**12}", "more memory"),
        ("${math.factorial(10**8)}", "did not end within 1 s of processor time"),
        ("${" + "-" * 20_000 + "1}", "nested too deeply|crashed"),
    ],
)
def test_what_never_ends_is_ended(expression, words, tmp_path, monkeypatch):
    monkeypatch.setattr(xacro, "TIME_S", 1.0)
    with pytest.raises(JointplayError, match=words):
        formats.read(bare(tmp_path, f"<a>{expression}</a>"))


def test_expressions_have_data_with_their_methods(tmp_path):
    (tmp_path / "c.yaml").write_text(
        "joint: {x: 0.5, items: 1, list: [{a: 3}]}\nangle: !degrees 180"
    )
    values = {
        "${c.joint.x * 2}": 1.0,
        "${c['joint']['x']}": 0.5,
        "${c.joint.list[0].a}": 3,
        "${c.joint.get('y', 7)}": 7,
        "${round(c.angle, 2)}": 3.14,
        "${'a__b'.split('__')[1].upper() + '{:.1f\\x7d'.format(1.26)}": "B1.3",
        "${[k for k, v in c.joint.items() if v == 0.5][0]}": "x",
        "${(lambda y: y + math.sqrt(4))(1)}": 3.0,
        "${python.sum([1, 2]) + len('abc')}": 6,
        "${python.type(1) == int}": True,
        "$(eval 2 * arg('n'${'\\x29'} + n)": 6,
        "$(optenv HOME nowhere)": "nowhere",
    }
    inside = '<xacro:arg name="n" default="2"/>'
    inside += "<xacro:property name='c' value=\"${xacro.load_yaml('c.yaml')}\"/>"
    inside += "".join(f'<a b="{one}"/>' for one in values)
    text = formats.urdf_text(Source(bare(tmp_path, inside), {}), {})
    made = [one.get("b") for one in ElementTree.fromstring(text).iter("a")]
    assert made == [str(value) for value in values.values()]


def test_comments_without_end_take_no_time():
    text = "<!--" * 200_000
    assert xacro.without_comments(text) == text
    assert xacro.without_comments("a<!-- b -->c<!---->d<!-- e") == "acd<!-- e"


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ('<link name="$(arg side)"/>', r"argument 'side' has no value: give it by --xacro side:="),
        ("<link name=\"${xacro.arg('side')}\"/>", r"argument 'side' has no value"),
        ('<link name="${L / 2}"/>', r"name 'L' is not defined when evaluating expression 'L / 2'"),
        ("<xacro:leg/>", r"unknown macro name: xacro:leg"),
        ('<xacro:include filename="no.xacro"/>', r"cannot read '.*no\.xacro': No such file"),
        ("<xacro:property name='a' value=\"${xacro.load_yaml('no.yaml')}\"/>${a}", r"no\.yaml"),
        ("<xacro:m>", r"mismatched tag|not well-formed"),
        ('<xacro:property name="a" value="${b}"/><xacro:property name="b" value="${a}"/>${a}',
         r"circular variable definition"),
        ("$(find no_such)", r"no package 'no_such' in the folders from"),
        ("$(dirname)", r": Cannot substitute .*(information available.)$"),
        ("$(find ../up)", r"no package '\.\./up'"),
        ('<link name="${().__class__}"/>', r"invalid name"),
        ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', r"without end"),
        ('<xacro:macro name="m" params="a"><link name="${a}"/></xacro:macro><xacro:m/>',
         r"macro 'm'\): Undefined parameters \[a\]"),
    ],
)  # fmt: skip
def test_what_is_wrong_names_file_and_place_in_a_line(inside, words, tmp_path):
    path = bare(tmp_path, inside)
    with pytest.raises(JointplayError, match=words) as caught:
        formats.read(path)
    assert str(caught.value).startswith(f"xacro {str(path)!r}")
    assert "\n" not in str(caught.value)


def test_wrong_included_file_is_named(robot):
    macros = robot.parents[2] / "its-parts" / "urdf" / "macros.xacro"
    macros.write_text(MACROS.replace("${mass}", "${weight}"))
    with pytest.raises(JointplayError, match=r"\(macro 'arm'\): name 'weight' is not defined"):
        formats.read(robot)
    macros.write_text(MACROS[:-10])
    with pytest.raises(JointplayError, match=r"xacro .*robot\.xacro' \(file '.*macros\.xacro'\)"):
        formats.read(robot)
    macros.write_text(MACROS)
    with pytest.raises(JointplayError, match=r"makes no link: it only defines arm; give the file"):
        formats.read(macros)


@pytest.mark.parametrize(
    ("inside", "said"),
    [
        ('<xacro:property name="r" value="2" unit="mm"/>', "unknown attribute(s): unit"),
        ('<xacro:property name="r" value="1"/><xacro:property name="r" value="2"/>', "'r' stands"),
        ('<xacro:arg name="r" default="1"/><xacro:arg name="r" default="2"/>', "'r' stands there"),
        ('<xacro:arg name="r" default="1">mass 3</xacro:arg>', "'r' has the text 'mass 3'"),
        ('<xacro:property name="r" value="1"><axis/></xacro:property>', "'r' has <axis> in it"),
        ('<xacro:macro name="r"/><xacro:macro name="r"><link/></xacro:macro>', "'r' stands there"),
        ('<xacro:property name="r" value="1_0"/>', "value='1_0' is no number as other programs"),
        ('<xacro:property name="r" value="1e-400"/>', "value='1e-400' is no number as other"),
    ],
)
def test_what_the_library_takes_otherwise_than_it_stands_is_said(inside, said, tmp_path):
    path = tmp_path / "bare.xacro"
    for fine in ("", '<xacro:property name="r"><origin/></xacro:property><xacro:if value="1"/>'):
        path.write_text(BARE % fine)
        assert not formats.read(path).doubts
    path.write_text(BARE % inside)
    (doubt,) = formats.read(path).doubts
    assert doubt.startswith("bare.xacro: ")
    assert said in doubt


def test_arguments_that_nothing_asks_for_are_refused(robot, urdf, capsys):
    with pytest.raises(MissingName, match=r"no xacro argument .*'lenght'; did you mean \"length\""):
        formats.read(robot, arguments={"lenght": 1.0})
    path = urdf('<link name="arm"/>')
    with pytest.raises(JointplayError, match=r"is no xacro: it takes no argument 'length'"):
        Mechanism(path, xacro={"length": 1.0})
    assert main(["robots", str(robot), "--xacro", "length=1"]) != 0
    assert "--xacro must read NAME:=VALUE" in capsys.readouterr().err


def test_another_robot_has_none_of_the_arguments(robot, tmp_path):
    scenario = tmp_path / "two.toml"
    scenario.write_text(
        f"[robot]\nurdf = {json.dumps(str(robot))}\nxacro.length = 0.6\n"
        '[cases.a]\nrobot.xacro.length = "0.8"\n[cases.b.robot]\nurdf = "jointplay:scara.urdf"\n'
    )
    loaded = jp.Scenario.load(scenario)
    assert loaded.model("a").robot.xacro == {"length": "0.8"}
    assert loaded.model("b").robot.xacro == {}


def test_sweep_goes_over_an_argument(robot, tmp_path):
    from jointplay.study import plan_of

    scenario = tmp_path / "sweep.toml"
    scenario.write_text(
        f"[robot]\nurdf = {json.dumps(str(robot))}\n[joints.arm_joint]\nradial_clearance = 1e-4\n"
        "[motion]\nspeeds = { arm_joint = 1.0 }\n[integration]\nduration = 0.001\n"
        '[sweep.axes]\nlength = { key = "robot.xacro.length", values = [0.4, 0.6] }\n'
    )
    plan = plan_of(scenario)
    (text,) = plan.inputs.values()
    assert text == formats.read(robot).text  # all that its includes say
    lengths = [
        centre(plan.scenario.simulation(None, plan.changes((k,))).mechanism.ideal())
        for k in range(2)
    ]
    assert lengths == [0.2, 0.3]


@given(st.one_of(st.booleans(), st.integers(), st.floats(allow_nan=False), st.text(max_size=9)))
def test_arguments_are_text_as_typed(value):
    text = xacro.as_text(value)
    assert text in ("true", "false") if isinstance(value, bool) else type(value)(text) == value
