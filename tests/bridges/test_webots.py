"""Robots with play as PROTOs of Webots, checked with a parser of the format."""

import importlib.util
import re

import numpy as np
import pinocchio as pin
import pytest
import trimesh
from conftest import body, joint

from jointplay.base.errors import JointplayError
from jointplay.bridges.reduction import Reduction
from jointplay.bridges.webots import to_proto
from jointplay.cli import main
from jointplay.model.gear import Gear
from jointplay.model.mechanism import Mechanism

OPTIONS = ["--all", "--gear", "a=6 mrad", "--gear-stiffness", "2000", "--rotor-inertia", "0.05"]
OPTIONS += ["--gear-damping", "2", "--period", "0.4", "--quiet", "--for", "webots"]
TURN = (0.3, 0.2, 0.9)


class Node(dict):
    """Fields of a node by name; `kind` is its type."""

    def __init__(self, kind):
        self.kind = kind

    def every(self, kind):
        for value in self.values():
            for one in value if isinstance(value, list) else [value]:
                if isinstance(one, Node):
                    yield from [one] if one.kind == kind else []
                    yield from one.every(kind)


def parsed(text):
    """The node in the braces of a PROTO: VRML97 without scripts."""
    found = re.findall(r'"[^"]*"|#[^\n]*|[{}\[\]]|[^\s{}\[\]"#]+', text[text.index("\n{") :])
    tokens = [one for one in found if not one.startswith("#")]
    assert tokens.pop(0) == "{"

    def node(kind):
        made = Node(kind)
        assert tokens.pop(0) == "{"
        while tokens[0] != "}":
            name = tokens.pop(0)
            assert re.fullmatch(r"[A-Za-z]\w*", name), name
            assert name not in made, name
            made[name] = value()
        tokens.pop(0)
        return made

    def value():
        if tokens[0] in ("DEF", "IS", "USE"):
            word, name = tokens.pop(0), tokens.pop(0)
            return value() if word == "DEF" else f"{word} {name}"
        if tokens[0] == "[":
            tokens.pop(0)
            many = []
            while tokens[0] != "]":
                many.append(value())
            tokens.pop(0)
            return many
        if tokens[1] == "{":
            return node(tokens.pop(0))
        if not re.match(r"[-+.\d]", tokens[0]):
            return tokens.pop(0).strip('"')
        numbers = []
        while re.match(r"[-+.\d]", tokens[0]):
            numbers.append(float(tokens.pop(0)))
        return np.array(numbers)

    robot = node(tokens.pop(0))
    assert tokens == ["}"]
    return robot


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Two hinges and a slide; the moments of inertia of a link are given in axes turned to it."""
    folder = tmp_path_factory.mktemp("webots")
    trimesh.creation.icosphere(radius=0.05).export(folder / "ball.stl")
    arm = body("arm", mass=2.0, com="0.3 0 0", inertia=0.02)
    upright = re.search(r"<inertia [^>]*/>", arm)[0]
    turned = '<inertia ixx="0.01" iyy="0.02" izz="0.029" ixy="0.001" ixz="0" iyz="0"/>'
    arm = arm.replace(upright, turned).replace(
        'xyz="0.3 0 0"', 'xyz="0.3 0 0" rpy="{} {} {}"'.format(*TURN)
    )
    shape = '<visual><geometry><mesh filename="ball.stl"/></geometry></visual>'
    found = folder / "arm.urdf"
    found.write_text(
        '<robot name="r">'
        + body("base", mass=5.0, com="0 0 0", inertia=0.1)
        + arm.replace("</inertial>", f"</inertial>{shape}")
        + body("fore", mass=1.0, com="0.2 0 0", inertia=0.01)
        + body("slider", mass=0.5, com="0 0 0")
        + joint("a", "base", "arm")
        + joint("b", "arm", "fore", axis="0 1 0", at="0.5 0 0")
        + '<joint name="c" type="prismatic"><parent link="fore"/><child link="slider"/>'
        '<axis xyz="1 0 0"/><limit lower="0" upper="0.1" effort="10" velocity="1"/></joint></robot>'
    )
    return found


def hinges(robot):
    """Joints, by the name of their first sensor, or of what they carry."""
    every = [*robot.every("HingeJoint"), *robot.every("SliderJoint")]
    named = {}
    for one in every:
        sensors = [d["name"] for d in one.get("device", []) if d.kind == "PositionSensor"]
        named[sensors[0] if sensors else one["endPoint"]["name"]] = one
    return named


@pytest.mark.needs("urdf2webots")
@pytest.mark.parametrize("encoder", ["motor", "link"])
def test_webots_gets_names_limits_play_and_sensors(path, tmp_path, encoder):
    out = tmp_path / "out"
    order = ["export", "simulator", str(path), *OPTIONS, "--encoder", encoder]
    assert main([*order, "--out", str(out)]) == 0
    assert {one.name for one in out.iterdir()} == {"robot.proto", "meshes"}
    text = (out / "robot.proto").read_text()
    assert "\nPROTO robot [" in text
    robot = parsed(text)
    found = hinges(robot)
    play = "a_play_sensor" if encoder == "link" else "arm"
    assert list(found) == ["a_sensor", play, "b_sensor", "c_sensor"]
    motors = {one["name"]: one for one in robot.every("RotationalMotor")}
    assert list(motors) == ["a", "b"]
    limits = Mechanism(path).description.joints["a"]
    assert motors["a"]["minPosition"] == pytest.approx(limits.lower)
    assert motors["a"]["maxPosition"] == pytest.approx(limits.upper)
    stops = found[play]["jointParameters"]
    assert (stops["minStop"], stops["maxStop"]) == (pytest.approx(-3e-3), pytest.approx(3e-3))
    axes = (found[name]["jointParameters"].get("axis", [1, 0, 0]) for name in ("a_sensor", play))
    assert np.array_equal(*axes)
    assert [one.kind for one in found[play].get("device", [])] == ["PositionSensor"] * (
        encoder == "link"
    )
    rotor = found["a_sensor"]["endPoint"]
    assert rotor["name"] == "a_motor"
    assert max(rotor["physics"]["inertiaMatrix"][0]) == pytest.approx(0.05)
    shapes = [one["url"] for one in robot.every("Mesh")]
    assert shapes == ["meshes/ball.stl"]
    assert (out / "meshes" / "ball.stl").is_file()


@pytest.mark.needs("urdf2webots")
def test_webots_links_have_the_inertia_of_the_urdf(path):
    robot = parsed(to_proto(Mechanism(path), [])[0])
    arm = next(one for one in robot.every("Solid") if one["name"] == "arm")
    xx, yy, zz, xy, xz, yz = arm["physics"]["inertiaMatrix"][0]
    turn = pin.rpy.rpyToMatrix(np.array(TURN))
    own = turn @ np.array([[0.01, 0.001, 0], [0.001, 0.02, 0], [0, 0, 0.029]]) @ turn.T
    assert np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) == pytest.approx(own, abs=1e-7)


@pytest.mark.needs("urdf2webots")
def test_a_joint_that_urdf2webots_takes_out_is_named(tmp_path):
    found = tmp_path / "arm.urdf"
    bare = '<link name="bare"/>'
    found.write_text(
        f'<robot name="r">{body("base", mass=5.0, com="0 0 0", inertia=0.1)}{bare}'
        + body("arm", mass=1.0, com="0 0 0", inertia=0.1)
        + joint("a", "base", "bare")
        + joint("b", "bare", "arm", axis="0 1 0")
        + "</robot>"
    )
    mechanism = Mechanism(found, gears={"a": Gear(4e-3, 0.05, 2e3, 2.0)})
    one = Reduction("a", 4e-3, 2e3, 2.0, 0.05)
    with pytest.raises(JointplayError, match="urdf2webots leaves out"):
        to_proto(mechanism, [one])


def test_without_urdf2webots_the_command_says_how_to_get_it(path, tmp_path, capsys, monkeypatch):
    real = importlib.util.find_spec
    monkeypatch.setattr(
        importlib.util,
        "find_spec",
        lambda name, *a: None if name == "urdf2webots" else real(name, *a),
    )
    order = ["export", "simulator", str(path), *OPTIONS, "--out", str(tmp_path / "o")]
    assert main(order) == 2
    assert "package urdf2webots is missing: pip install" in capsys.readouterr().err
