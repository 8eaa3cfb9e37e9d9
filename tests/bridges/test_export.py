import re
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from jointplay import BallBearing, JointplayError, Mechanism, RevoluteClearance, shipped
from jointplay.bridges.urdf import LIMIT_FACTOR, to_urdf
from jointplay.cli import main
from jointplay.model import robots
from jointplay.model.gear import Gear
from jointplay.model.loop import Loop
from jointplay.physics.joints import PrismaticClearance, SphericalClearance

BEARING = RevoluteClearance(radial_clearance=1e-4, axial_clearance=3e-4)
ARM = """<?xml version="1.0" encoding="utf-8"?>
<!-- an arm - mit Umlaut: ä -->
<robot name="arm" xmlns:xacro="http://www.ros.org/wiki/xacro">
  <material name="blue"><color rgba="0 0 1 1"/></material>
  <link name="base"/>
  <link name="upper"><visual><geometry><mesh filename="upper.stl"/></geometry>
    <material name="blue"/></visual>
    <inertial><origin xyz="0.1 0.02 0.03"/><mass value="2"/>
    <inertia ixx="0.01" iyy="0.02" izz="0.015" ixy="0.001" ixz="0" iyz="0"/></inertial></link>
  <link name="fore"><inertial><origin xyz="0.05 -0.02 0.1"/><mass value="1"/>
    <inertia ixx="0.005" iyy="0.006" izz="0.004" ixy="0" ixz="0.0005" iyz="0"/></inertial></link>
  <link name="slider"><inertial><origin xyz="0 0.01 0"/><mass value="0.5"/>
    <inertia ixx="0.001" iyy="0.001" izz="0.001" ixy="0" ixz="0" iyz="0"/></inertial></link>
  <joint name="shoulder" type="revolute">
    <parent link="base"/><child link="upper"/>
    <origin xyz="0.1 0.2 0.3" rpy="0.4 -0.5 0.6"/>
    <axis xyz="0.6 0 0.8"/>
    <limit lower="-2" upper="1.5" effort="30" velocity="3"/>
    <dynamics friction="0.5" damping="0.1"/>
    <safety_controller k_velocity="10" soft_lower_limit="-1.9"/>
  </joint>
  <joint name="elbow" type="continuous">
    <parent link="upper"/><child link="fore"/>
    <origin xyz="0.3 0 0"/>
    <axis xyz="0 0 -1"/>
  </joint>
  <joint name="stroke" type="prismatic">
    <parent link="fore"/><child link="slider"/>
    <origin xyz="0.1 0 0.2" rpy="0 1 0"/>
    <axis xyz="0 1 0"/>
    <limit lower="0" upper="0.2" effort="30" velocity="3"/>
  </joint>
  <transmission name="t1"><type>SimpleTransmission</type>
    <joint name="shoulder"><hardwareInterface>Effort</hardwareInterface></joint></transmission>
  <gazebo reference="upper"><selfCollide>true</selfCollide></gazebo>
</robot>
"""


@pytest.fixture
def arm(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(ARM, encoding="utf-8")
    return path


def exported(mechanism: Mechanism, folder: Path) -> tuple[Path, pin.Model]:
    path = folder / "played.urdf"
    path.write_text(to_urdf(mechanism), encoding="utf-8")
    return path, pin.buildModelFromUrdf(str(path))


def configuration(model, mechanism, q):
    """The same configuration and the order of its velocities, for the URDF as Pinocchio reads it.

    A drive's coordinate has the joint's plain name there.
    """
    there, order = pin.neutral(model), []
    for name, value in zip(mechanism.coordinates, q, strict=True):
        joint, _, part = name.partition(".")
        given = mechanism.clearance.get(joint)
        plain = given is not None and part == given.drive_coordinate
        index = model.getJointId(joint if plain else name)
        assert index < model.njoints, name
        at = model.joints[index]
        there[at.idx_q : at.idx_q + at.nq] = value if at.nq == 1 else (np.cos(value), np.sin(value))
        order.append(at.idx_v)
    return there, order


def compare(mechanism, model, rng):
    """Poses equal; the small links add what they must to the mass matrix, and no more."""
    scale = [
        1e-3 if c.rpartition(".")[2] in ("x", "y", "z") else 0.5 for c in mechanism.coordinates
    ]
    for q in [np.zeros(len(scale)), *(rng.uniform(-1, 1, len(scale)) * scale for _ in range(3))]:
        there, order = configuration(model, mechanism, q)
        assert sorted(order) == list(range(model.nv))
        data = model.createData()
        pin.framesForwardKinematics(model, data, there)
        pin.framesForwardKinematics(mechanism.model, mechanism.data, q)
        for link in mechanism.description.links:
            at = [
                d.oMf[m.getFrameId(link, pin.FrameType.BODY)]
                for m, d in ((model, data), (mechanism.model, mechanism.data))
            ]
            assert np.abs(at[0].homogeneous - at[1].homogeneous).max() < 1e-14
        full = pin.crba(model, data, there)[np.ix_(order, order)].copy()
        own = pin.crba(mechanism.model, mechanism.data, q).copy()
        added, own = (np.triu(m) + np.triu(m, 1).T for m in (full - own, own))
        factor = np.linalg.inv(np.linalg.cholesky(own))
        relative = np.linalg.eigvalsh(factor @ added @ factor.T)
        assert relative.min() > -1e-9
        assert 0.0 < relative.max() < 1e-4


@pytest.mark.parametrize(
    "clearance",
    [
        {"shoulder": BEARING},
        {"elbow": BEARING},
        {"shoulder": BEARING, "elbow": BEARING},
        {"shoulder": RevoluteClearance.planar(radial_clearance=1e-4)},
        {"stroke": PrismaticClearance(clearance=1e-4)},
        {"stroke": PrismaticClearance(clearance=1e-4, planar=True), "elbow": BEARING},
    ],
)
def test_kinematics_and_inertia_are_the_mechanisms(arm, tmp_path, clearance):
    mechanism = Mechanism(arm, clearance)
    _, model = exported(mechanism, tmp_path)
    compare(mechanism, model, np.random.default_rng(1))


def test_a_ball_in_a_socket(arm, tmp_path):
    text = ARM.replace('type="continuous"', 'type="floating"').replace('<axis xyz="0 0 -1"/>', "")
    arm.write_text(text, encoding="utf-8")
    mechanism = Mechanism(arm, {"elbow": SphericalClearance(radial_clearance=1e-4)})
    _, model = exported(mechanism, tmp_path)
    compare(mechanism, model, np.random.default_rng(2))


def test_all_else_stays_byte_for_byte(arm):
    text = to_urdf(Mechanism(arm, {"elbow": BEARING}))
    start = ARM.index('<joint name="elbow"')
    stop = ARM.index("</joint>", start) + len("</joint>")
    assert text.startswith(ARM[:start])
    assert text.endswith(ARM[stop:])


def test_the_driven_joint_keeps_its_name_limits_and_friction(arm):
    root = ElementTree.fromstring(to_urdf(Mechanism(arm, {"shoulder": BEARING})).encode())
    joints = {j.get("name"): j for j in root.findall("joint")}
    chain = [f"shoulder{part}" for part in (".x", ".y", ".z", "", ".pitch", ".roll")]
    assert list(joints)[:6] == chain
    assert joints["shoulder"].get("type") == "revolute"
    limit = {"lower": "-2", "upper": "1.5", "effort": "30", "velocity": "3"}
    assert joints["shoulder"].find("limit").attrib == limit
    assert joints["shoulder"].find("dynamics").get("friction") == "0.5"
    assert joints["shoulder"].find("safety_controller") is not None
    assert joints["shoulder"].find("axis").get("xyz") == "0.6 0 0.8"
    assert joints["shoulder.x"].find("origin").get("rpy") == "0.4 -0.5 0.6"
    assert all(joints[name].find("origin") is None for name in chain[1:])


def test_limits_are_about_twice_the_clearance(arm):
    root = ElementTree.fromstring(to_urdf(Mechanism(arm, {"shoulder": BEARING})).encode())
    found = {j.get("name"): j.find("limit") for j in root.findall("joint")}
    tilt = 2e-4 / BEARING.lj
    for part, room in {"x": 1e-4, "y": 1e-4, "z": 3e-4, "pitch": tilt, "roll": tilt}.items():
        limit = found[f"shoulder.{part}"]
        assert float(limit.get("upper")) == pytest.approx(LIMIT_FACTOR * room)
        assert float(limit.get("lower")) == -float(limit.get("upper"))


def test_what_a_urdf_cannot_express_is_refused(arm, tmp_path):
    loop = Loop("base", "slider")
    with pytest.raises(JointplayError, match="loop 'closed' cannot be written"):
        to_urdf(Mechanism(arm, {"elbow": BEARING}, loops={"closed": loop}))
    gear = Gear(play=1e-3, rotor_inertia=1e-2, stiffness=1e3)
    with pytest.raises(JointplayError, match="gear with play 'elbow' cannot be written"):
        to_urdf(Mechanism(arm, {"shoulder": BEARING}, gears={"elbow": gear}))
    arm.write_text(ARM.replace('"fore"', '"elbow.x_link"'), encoding="utf-8")
    with pytest.raises(JointplayError, match=r"already has a 'elbow\.x_link'"):
        to_urdf(Mechanism(arm, {"elbow": BEARING}))


def _robot(name):
    try:
        return robots.robot_urdf(name)
    except JointplayError as error:
        pytest.skip(str(error))


EXPORTS = [("scara", "joint_b"), ("ur5", "elbow_joint"), ("panda", "panda_joint4")]


def _exported(name, joint, folder):
    path = shipped("scara.urdf") if name == "scara" else _robot(name)
    mechanism = Mechanism(path, {joint: BEARING})
    return mechanism, exported(mechanism, folder)[0]


@pytest.mark.parametrize(("name", "joint"), EXPORTS)
def test_yourdfpy_loads_it(tmp_path, name, joint):
    yourdfpy = pytest.importorskip("yourdfpy")
    mechanism, path = _exported(name, joint, tmp_path)
    robot = yourdfpy.URDF.load(str(path), load_meshes=False, build_scene_graph=True)
    assert robot.validate()
    assert {f"{joint}.{part}" for part in ("x", "y", "z", "pitch", "roll")} <= set(robot.joint_map)
    q = {joint: 0.3, f"{joint}.x": 1e-4, f"{joint}.roll": -2e-3}
    robot.update_cfg(q)
    there = mechanism.configuration({joint: 0.3})
    there[mechanism.coordinates.index(f"{joint}.x")] = 1e-4
    there[mechanism.coordinates.index(f"{joint}.roll")] = -2e-3
    pin.framesForwardKinematics(mechanism.model, mechanism.data, there)
    child = mechanism.description.joints[joint].child
    own = mechanism.data.oMf[mechanism.model.getFrameId(child, pin.FrameType.BODY)]
    assert np.abs(robot.get_transform(child) - own.homogeneous).max() < 1e-12


@pytest.mark.needs("mujoco")
@pytest.mark.parametrize(("name", "joint"), EXPORTS)
def test_mujoco_loads_and_steps_it(tmp_path, name, joint):
    import mujoco

    mechanism, path = _exported(name, joint, tmp_path)
    # MuJoCo reads neither .dae nor package://; a robot without shapes has the same dynamics.
    shapes = re.compile(r"<(visual|collision)\b.*?</\1>", re.DOTALL)
    text = shapes.sub("", path.read_text(encoding="utf-8"))
    if name == "scara":  # its quill has no mass, also without play
        bound = '<mujoco><compiler boundmass="1e-6" boundinertia="1e-10"/></mujoco></robot>'
        text = text.replace("</robot>", bound)
    model = mujoco.MjModel.from_xml_string(text)
    names = {model.joint(i).name for i in range(model.njnt)}
    assert {f"{joint}.{part}" for part in ("x", "y", "z", "pitch", "roll")} | {joint} <= names
    total = sum(inertia.mass for inertia in list(mechanism.model.inertias)[1:])
    fixed = mechanism.model.inertias[0].mass
    assert model.body_mass.sum() == pytest.approx(total + fixed, rel=1e-5)
    data = mujoco.MjData(model)
    before = data.joint(joint).qpos.copy()
    for _ in range(200):
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    assert not np.array_equal(before, data.joint(joint).qpos)


def test_command(arm, tmp_path, capsys):
    out = tmp_path / "new" / "played.urdf"
    out.parent.mkdir()
    options = ["export", "urdf", str(arm), "--joint", "shoulder", "--joint", "elbow"]
    options += ["--clearance", "1e-4", "--axial-clearance", "3e-4", "--out", str(out)]
    assert main(options) == 0
    assert out.read_text(encoding="utf-8") == to_urdf(
        Mechanism(arm, {"shoulder": BEARING, "elbow": BEARING})
    )
    printed = capsys.readouterr().out
    assert "shoulder.x, shoulder.y, shoulder.z, shoulder (yaw)" in printed
    assert "mesh paths are relative" in printed
    assert main(options) == 2  # never overwrites
    assert "already exists; choose another name" in capsys.readouterr().err


def test_a_rolling_bearing_is_free_as_far_as_its_free_set(arm, tmp_path, capsys):
    out = tmp_path / "play.urdf"
    options = ["export", "urdf", str(arm), "--joint", "shoulder=6010/C3", "--joint", "elbow=50 um"]
    assert main([*options, "--out", str(out)]) == 0
    assert "shoulder.x" in capsys.readouterr().out
    joints = {one.get("name"): one for one in ElementTree.parse(out).getroot().findall("joint")}
    play = BallBearing(designation="6010/C3").play(second_order=False)
    for freedom, place in {"x": 0, "z": 2, "pitch": 4, "roll": 3}.items():
        upper = float(joints[f"shoulder.{freedom}"].find("limit").get("upper"))
        # Across and in tilt it is that along one axis; between two balls there is a little more.
        near = 0.03 if freedom == "roll" else 1e-9
        assert upper == pytest.approx(play.support(np.eye(6)[[place]]).value[0], rel=near)
    upper = float(joints["elbow.x"].find("limit").get("upper"))
    assert upper == pytest.approx(LIMIT_FACTOR * 50e-6)


def test_a_joint_without_play_is_refused(arm):
    pair = BallBearing(designation="7210 C DB", preload=200.0)
    with pytest.raises(
        JointplayError, match=r"'shoulder' has no play .*cannot say how it gives way"
    ):
        to_urdf(Mechanism(arm, {"shoulder": pair}))
