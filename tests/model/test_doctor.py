"""What is impossible in a robot's file, and whether what is called right is."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
import trimesh

from jointplay import Mechanism
from jointplay.cli import main
from jointplay.model.elements import place_of

BAD = '<inertia ixx="-1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'
SIZE = np.array([0.3, 0.1, 0.05])


@pytest.fixture
def written(tmp_path):
    """Write a robot of two links, the second of a box's mesh."""

    def write(inertial="", scale="", joint="", more="", mesh_size=1.0):
        box = trimesh.creation.box(SIZE * mesh_size)
        box.apply_translation([0.15 * mesh_size, 0.0, 0.0])
        box.export(tmp_path / "box.stl")
        path = tmp_path / "my.urdf"
        path.write_text(f"""<?xml version="1.0"?>
<!-- who made it -->
<robot name="r">
 <link name="base"/>
 <!-- kept -->
 <link name="arm">{inertial}
  <visual><geometry><mesh filename="box.stl" {scale}/></geometry></visual></link>
 <joint name="j" type="revolute"><origin xyz="0 0 0.2"/><parent link="base"/><child link="arm"/>
  {joint or '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="3" velocity="2"/>'}</joint>
 {more}
</robot>""")
        return path

    return write


def checked(capsys, path, *more):
    code = main(["check", str(path), "--no-picture", *map(str, more)])
    return code, capsys.readouterr().out


def test_right_inertia_is_that_of_the_mesh_about_the_centre_in_the_inertial_s_axes(
    written, tmp_path, capsys
):
    turn, mass = "0.3 -0.2 0.5", 2.0
    inertial = (
        f'<inertial><origin xyz="0.16 0 0" rpy="{turn}"/><mass value="{mass}"/>{BAD}</inertial>'
    )
    out = tmp_path / "other" / "fixed.urdf"
    out.parent.mkdir()
    code, said = checked(capsys, written(inertial), "--write", out)
    assert code == 1
    assert said.startswith("my.urdf: 1 impossible (link 'arm'); --write fixed.urdf mends 1 of 1\n")
    assert "line 6, link 'arm': principal moments -1, 1, 1 kg m2: not positive definite" in said
    assert "that of its mesh box.stl at 2 kg" in said
    x, y, z = SIZE
    box = mass / 12.0 * np.diag([y * y + z * z, x * x + z * z, x * x + y * y])
    link = ElementTree.parse(out).find("link[@name='arm']")
    place = place_of(link.find("inertial"))
    np.testing.assert_allclose(place.translation, [0.16, 0.0, 0.0])
    entries = {key: float(x) for key, x in link.find("inertial/inertia").attrib.items()}
    own = np.array([[entries[f"i{min(a, b)}{max(a, b)}"] for a in "xyz"] for b in "xyz"])
    np.testing.assert_allclose(place.rotation @ own @ place.rotation.T, box, atol=1e-6)
    assert Mechanism(out).model.inertias[1].mass == mass
    assert "<!-- kept -->" in out.read_text()
    assert link.find("visual/geometry/mesh").get("filename") == "../box.stl"
    assert checked(capsys, out)[0] == 0
    assert main(["check", str(written(inertial)), "--write", str(out)]) == 2  # nothing overwritten


def test_pasted_element_is_the_one_that_is_written(written, tmp_path, capsys):
    path = written(f'<inertial><mass value="2"/>{BAD}</inertial>')
    _, said = checked(capsys, path)
    element = re.search(r"<inertial>.*</inertial>", said, re.DOTALL)[0]
    text = path.read_text()
    path.write_text(re.sub(r"<inertial>.*</inertial>", element, text, flags=re.DOTALL))
    assert checked(capsys, path)[0] == 0
    assert pin.buildModelFromUrdf(str(path)).inertias[1].mass == 2.0


def test_all_is_found_at_once_each_with_its_line(written, tmp_path, capsys):
    limits = '<axis xyz="0 3 0"/><limit lower="1" upper="-1" effort="0" velocity="2"/>'
    more = """<joint name="k" type="revolute"><parent link="arm"/><child link="tip"/>
  <axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="3" velocity="2"/>
  <mimic joint="jj"/></joint>
 <link name="tip"><inertial><mass value="-0.1"/>
  <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
 <link name="tip"><visual><geometry><mesh filename="gone.stl"/></geometry></visual></link>"""
    path = written(f'<inertial><mass value="2"/>{BAD}</inertial>', joint=limits, more=more)
    code, said = checked(capsys, path)
    assert code == 1
    for line in (
        "line 6, link 'arm': principal moments",
        "line 8, joint 'j': the lower limit 1 above the upper one -1",
        '<limit lower="-1" upper="1" effort="0" velocity="2" />',
        "line 13, link 'tip': the mass -0.1 kg; it must be positive",
        "line 15, link 'tip': there is another, in line 13",
        "note: line 8, joint 'j': axis of length 3",
        "note: line 8, joint 'j': limit effort 0",
        "note: line 10, joint 'k': mimics 'jj', which is no joint",
        '<mimic joint="j" />',
        "note: line 15, meshes: not found or not readable: gone.stl",
    ):
        assert line in said, line


def test_meshes_in_millimetres_and_inertias_in_other_units_are_called_so(written, tmp_path, capsys):
    good = '<inertia ixx="0.0021" ixy="0" ixz="0" iyy="0.0155" iyz="0" izz="0.0167"/>'
    inertial = '<inertial><origin xyz="0.15 0 0"/><mass value="2"/>{}</inertial>'
    out = tmp_path / "fixed.urdf"
    code, said = checked(capsys, written(inertial.format(good), mesh_size=1e3), "--write", out)
    assert code == 0
    assert "meshes of 300 m on a robot of 200 mm" in said
    assert "they are in millimetres" in said
    assert 'scale="0.001 0.001 0.001"' in out.read_text()
    assert "nothing impossible was found" in checked(capsys, out)[1]
    scaled = re.sub(r'i(..)="([\d.]+)"', lambda m: f'i{m[1]}="{float(m[2]) * 1e6}"', good)
    _, said = checked(capsys, written(inertial.format(scaled)))
    assert "kg m2; 2 kg within its shapes have" in said
    assert "written in kg mm2?" in said
    aside = inertial.format(good).replace("0.15", "150")
    _, said = checked(capsys, written(aside))
    assert "outside its shapes: written in millimetres?" in said


def test_a_link_without_mass_gets_water_and_a_doubt_is_not_written(written, tmp_path, capsys):
    out = tmp_path / "fixed.urdf"
    code, said = checked(capsys, written(), "--write", out)
    assert code == 0
    assert "has no mass, and a joint moves it" in said
    assert "as heavy as water (weigh it)" in said
    assert Mechanism(out).model.inertias[1].mass == pytest.approx(1e3 * SIZE.prod(), rel=1e-6)
    small = '<inertia ixx="1e-6" ixy="0" ixz="0" iyy="1e-6" iyz="0" izz="1e-6"/>'
    path = written(f'<inertial><origin xyz="0.15 0 0"/><mass value="2"/>{small}</inertial>')
    other = tmp_path / "other.urdf"
    _, said = checked(capsys, path, "--write", other)
    assert "a placeholder? that of its shapes is 0.0167" in said
    assert 'ixx="1e-6"' in other.read_text()


def test_a_scenario_is_not_mended(tmp_path, capsys):
    assert main(["check", "jointplay:slider_crank.toml", "--write", str(tmp_path / "a.urdf")]) == 2
    assert "--write mends a robot's file" in capsys.readouterr().err


@pytest.mark.needs("mujoco")
def test_an_mjcf_which_has_no_such_limits_is_not_doubted_for_them(tmp_path, capsys):
    path = tmp_path / "arm.xml"
    path.write_text(
        '<mujoco><worldbody><body name="m"><joint name="j" axis="0 1 0" range="-1 1"/>'
        '<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/></body></worldbody>'
        "</mujoco>"
    )
    code, said = checked(capsys, path)
    assert code == 0
    assert "doubtful" not in said


@pytest.mark.needs("mujoco")
def test_mujoco_compiles_what_is_mended(written, tmp_path, capsys):
    import mujoco

    bad = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="3"/>'
    path = written(f'<inertial><mass value="2"/>{bad}</inertial>')
    out = tmp_path / "fixed.urdf"
    with pytest.raises(ValueError, match="must satisfy A \\+ B >= C"):
        mujoco.MjModel.from_xml_path(str(path))
    checked(capsys, path, "--write", out)
    model = mujoco.MjModel.from_xml_path(str(out))
    x, y, z = SIZE
    both = [y * y + z * z, x * x + z * z, x * x + y * y]
    np.testing.assert_allclose(
        np.sort(model.body_inertia[-1]), np.sort(2.0 / 12.0 * np.array(both)), rtol=1e-4
    )
