"""Robots with play written for other simulators, and read by those simulators' readers."""

import json
import signal
import sys
import xml.etree.ElementTree as ElementTree

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from conftest import body, joint

from jointplay.base.errors import JointplayError
from jointplay.bridges import reduced_robot, reduction
from jointplay.bridges.reduced_files import reach, to_sdf, to_urdf
from jointplay.bridges.reduced_mjcf import compile_robot, find_play, find_reach
from jointplay.bridges.reduction import Reduction, reduce_all
from jointplay.cli import main
from jointplay.model.gear import Gear
from jointplay.model.mechanism import Mechanism
from jointplay.model.mjcf_whole import compile_text
from jointplay.physics.joints import RevoluteClearance
from jointplay.simulation.run import Run
from jointplay.study.runs import Runs

PLAYS = {"a": 6e-3, "b": 4e-3}
EVERY_FORMAT = pytest.mark.needs("mujoco", "pxr", "newton_usd_schemas", "urdf2webots")


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """Two hinges with gears, a slide, and a finger that follows another."""
    found = tmp_path_factory.mktemp("whole") / "arm.urdf"
    found.write_text(
        '<robot name="r"><link name="base"/>'
        + body("arm", mass=2.0, com="0.3 0 0", inertia=0.02)
        + body("fore", mass=1.0, com="0.2 0 0", inertia=0.01)
        + body("slider", mass=0.5, com="0 0 0")
        + joint("a", "base", "arm")
        + joint("b", "arm", "fore", axis="0 1 0", at="0.5 0 0")
        + '<joint name="c" type="prismatic"><parent link="fore"/><child link="slider"/>'
        '<origin xyz="0.4 0 0"/><axis xyz="1 0 0"/>'
        '<limit lower="0" upper="0.1" effort="10" velocity="1"/></joint>' + "</robot>"
    )
    return found


@pytest.fixture(scope="module")
def mechanism(path):
    gears = {n: Gear(x, 0.05, 2e3, 2.0) for n, x in PLAYS.items()}
    return Mechanism(path, {}, gears=gears)


@pytest.fixture(scope="module")
def reductions(mechanism):
    found, refused = reduce_all(mechanism, period=0.4)
    assert refused == {}
    return found


@pytest.mark.needs("mujoco")
def test_a_held_torque_moves_the_link_across_the_dead_band_and_no_further(mechanism, reductions):
    import mujoco

    model = mujoco.MjModel.from_xml_string(compile_robot(mechanism, reductions).mjcf(reductions))
    model.opt.gravity[:] = 0.0
    model.dof_armature[model.joint("a").dofadr] = 1e6
    data = mujoco.MjData(model)
    ends = []
    for torque in (1.0, -1.0):
        data.qfrc_applied[model.joint("a_play").dofadr] = torque
        for _ in range(20000):
            mujoco.mj_step(model, data)
        ends.append(float(data.qpos[model.joint("a_play").qposadr[0]]))
    one = next(one for one in reductions if one.joint == "a")
    assert ends[0] - ends[1] == pytest.approx(one.dead_band + 2.0 / one.stiffness, rel=1e-2)


@pytest.mark.needs("mujoco")
def test_mujocos_robot_has_the_masses_and_the_tool_of_the_urdf(mechanism, reductions):
    import mujoco

    model = mujoco.MjModel.from_xml_string(compile_robot(mechanism, reductions).mjcf(reductions))
    data = mujoco.MjData(model)
    pose = {"a": 0.4, "b": -0.7, "c": 0.05}
    for name, value in pose.items():
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_forward(model, data)
    ideal = mechanism.ideal()
    q = ideal.configuration(pose)
    pin.framesForwardKinematics(ideal.model, ideal.data, q)
    tool = ideal.data.oMf[ideal.tool_frame].translation
    assert data.site(f"{mechanism.tool}.tool").xpos == pytest.approx(tool, abs=1e-5)
    mass = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, mass)
    rows = [int(model.joint(name).dofadr[0]) for name in pose]
    rotors = np.diag(model.dof_armature[rows])
    assert np.diag(rotors) == pytest.approx([0.05, 0.05, 0.0])
    assert mass[np.ix_(rows, rows)] - rotors == pytest.approx(ideal.mass_matrix(q), abs=1e-5)


@pytest.mark.needs("mujoco")
def test_the_encoder_of_the_link_reads_motor_and_play(mechanism, reductions):
    import mujoco

    robot = compile_robot(mechanism, reductions)
    for encoder, wanted in (("motor", 0.3), ("link", 0.302)):
        model = mujoco.MjModel.from_xml_string(robot.mjcf(reductions, encoder=encoder))
        data = mujoco.MjData(model)
        data.qpos[model.joint("a").qposadr[0]] = 0.3
        data.qpos[model.joint("a_play").qposadr[0]] = 0.002
        mujoco.mj_forward(model, data)
        assert data.sensor("a.encoder").data[0] == pytest.approx(wanted)


@pytest.mark.needs("mujoco")
def test_mimicking_joints_follow_in_mujoco(tmp_path):
    import mujoco

    found = tmp_path / "gripper.urdf"
    follower = joint("g", "base", "right", axis="0 0 1")
    follower = follower.replace("</joint>", '<mimic joint="f" multiplier="-2"/></joint>')
    assert "mimic" in follower
    found.write_text(
        '<robot name="r"><link name="base"/>'
        + body("left", mass=1.0, inertia=0.02)
        + body("right", mass=1.0, inertia=0.02)
        + joint("f", "base", "left", axis="0 0 1")
        + follower
        + "</robot>"
    )
    one = Reduction("f", dead_band=1e-3, stiffness=100.0, damping=1.0, rotor_inertia=0.1)
    robot = compile_robot(Mechanism(found, {}, gears={"f": Gear(1e-3, 0.1, 100.0)}), [one])
    model = mujoco.MjModel.from_xml_string(robot.mjcf([one]))
    assert [model.actuator(i).name for i in range(model.nu)] == ["f"]
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.1
    for _ in range(1000):
        mujoco.mj_step(model, data)
    leader, follows = (float(data.qpos[model.joint(n).qposadr[0]]) for n in "fg")
    assert leader > 0.05
    assert follows == pytest.approx(-2.0 * leader, rel=0.02)


def test_the_urdf_has_play_and_ros2_controls_tags_and_is_read_by_others(
    mechanism, reductions, tmp_path
):
    written = tmp_path / "robot.urdf"
    written.write_text(to_urdf(mechanism, *reductions))
    robot = yourdfpy.URDF.load(str(written), load_meshes=False)
    model = pin.buildModelFromUrdf(str(written))
    assert {"a_play", "b_play"} <= set(robot.joint_map) & set(model.names)
    for name, play in PLAYS.items():
        limit = robot.joint_map[f"{name}_play"].limit
        assert limit.upper - limit.lower == pytest.approx(play)
    system = ElementTree.parse(written).getroot().find("ros2_control")
    joints = {one.get("name"): one for one in system.findall("joint")}
    assert list(joints) == ["a", "b", "c", "a_play", "b_play"]
    assert joints["a"].find("command_interface").get("name") == "effort"
    assert joints["a_play"].find("command_interface") is None
    assert [one.find("joint").get("name") for one in system.findall("transmission")] == list("abc")


def test_a_urdfs_own_tags_of_ros2_control_stay(path, reductions, tmp_path):
    own = tmp_path / "own.urdf"
    tags = '<ros2_control name="mine" type="system"><joint name="a"/></ros2_control></robot>'
    own.write_text(path.read_text().replace("</robot>", tags))
    gears = {n: Gear(x, 0.05, 2e3, 2.0) for n, x in PLAYS.items()}
    text = to_urdf(Mechanism(own, {}, gears=gears), *reductions)
    (system,) = ElementTree.fromstring(text).findall("ros2_control")
    assert system.get("name") == "mine"
    assert [one.get("name") for one in system.findall("joint")] == ["a", "a_play", "b_play"]


def test_the_sdf_stands_where_the_robot_stands_and_has_all_play(mechanism, reductions):
    model = ElementTree.fromstring(to_sdf(mechanism, *reductions)).find("model")
    joints = {one.get("name"): one for one in model.findall("joint")}
    links = {one.get("name"): one for one in model.findall("link")}
    assert set(joints) == {"base_fixed", "a", "a_play", "b", "b_play", "c"}
    ideal = mechanism.ideal()
    pin.forwardKinematics(ideal.model, ideal.data, np.zeros(3))
    for name, index in (("a", 1), ("b", 2), ("c", 3)):
        link = mechanism.description.joints[name].child
        pose = [float(x) for x in links[link].find("pose").text.split()]
        place = ideal.data.oMi[index]
        assert pose[:3] == pytest.approx(place.translation)
        assert pin.rpy.rpyToMatrix(*pose[3:]) == pytest.approx(place.rotation)
    assert sum(float(m.text) for m in model.iter("mass")) == pytest.approx(3.5, abs=2e-3)
    for one in reductions:
        limit = joints[f"{one.joint}_play"].find("axis/limit")
        width = float(limit.find("upper").text) - float(limit.find("lower").text)
        assert (width, float(limit.find("stiffness").text)) == (one.dead_band, one.stiffness)
        motor = joints[f"{one.joint}_play"].find("parent").text
        assert joints[one.joint].find("child").text == motor
    assert {one.find("child").text for one in joints.values()} == set(links)
    assert {one.find("parent").text for one in joints.values()} <= {*links, "world"}


def test_the_sdf_keeps_links_and_limits_and_publishes_what_the_encoder_reads(tmp_path):
    path = tmp_path / "leg.urdf"
    path.write_text(
        '<robot name="leg"><link name="trunk"/>'
        + body("thigh") + body("calf") + '<link name="foot"/>'
        + joint("hip", "trunk", "thigh") + joint("knee", "thigh", "calf", at="0 0 -0.2")
        + '<joint name="sole" type="fixed"><parent link="calf"/><child link="foot"/>'
        '<origin xyz="0 0 -0.3"/></joint></robot>'
    )  # fmt: skip
    path.write_text(path.read_text().replace('effort="1000"', 'effort="36"'))
    leg = Mechanism(path, gears={"knee": Gear(0.02, 0.05, 2e3, 2.0)})
    play = Reduction("knee", dead_band=0.02, stiffness=2e3, damping=2.0, rotor_inertia=0.05)
    published = {}
    for encoder in ("motor", "link"):
        model = ElementTree.fromstring(to_sdf(leg, play, encoder=encoder)).find("model")
        assert {one.get("name") for one in model.findall("link")} == {
            *("trunk", "thigh", "calf", "knee_motor"),
        }
        (foot,) = model.findall("frame")
        assert (foot.get("name"), foot.get("attached_to")) == ("foot", "calf")
        limits = {one.get("name"): one.find("axis/limit") for one in model.findall("joint")[1:]}
        entry = leg.description.joints["knee"]
        for tag, value in (("effort", entry.effort), ("velocity", entry.speed)):
            assert float(limits["knee"].find(tag).text) == value
        assert limits["knee_play"].find("effort") is None
        published[encoder] = [one.text for one in model.findall("plugin/joint_name")]
    assert published == {"motor": ["hip", "knee"], "link": ["hip", "knee", "knee_play"]}


@pytest.mark.needs("pxr", "newton_usd_schemas")
def test_usd_has_the_play_in_newtons_attributes(mechanism, reductions):
    from jointplay.bridges.usd import load_usd, to_usd

    _, _, _, usd, geom, physics = load_usd()
    stage = usd.Stage.CreateInMemory()
    stage.GetRootLayer().ImportFromString(to_usd(mechanism, *reductions))
    assert geom.GetStageMetersPerUnit(stage) == 1.0
    for one in reductions:
        prim = stage.GetPrimAtPath(f"/arm/{one.joint}_play")
        play = physics.RevoluteJoint(prim)
        width = play.GetUpperLimitAttr().Get() - play.GetLowerLimitAttr().Get()
        assert np.deg2rad(width) == pytest.approx(one.dead_band, rel=1e-5)
        assert "NewtonJointAPI" in prim.GetAppliedSchemas()
        assert prim.HasAPI("NewtonJointAPI")  # the schema is registered, not a mere name
        stiffness = prim.GetAttribute("newton:limitStiffness").Get()
        assert np.rad2deg(stiffness) == pytest.approx(one.stiffness, rel=1e-5)
    bodies = [p for p in stage.Traverse() if p.HasAPI(physics.RigidBodyAPI)]
    names = ["base", "a_link", "a_motor", "b_link", "b_motor", "c_link"]
    assert sorted(one.GetName() for one in bodies) == sorted(names)
    # Both frames of each joint are at the same place.
    cache = geom.XformCache()
    for prim in stage.Traverse():
        if not prim.IsA(physics.Joint) or prim.IsA(physics.FixedJoint):
            continue
        made = physics.Joint(prim)
        ends, first = [], (made.GetBody0Rel(), made.GetLocalPos0Attr())
        for end, at in (first, (made.GetBody1Rel(), made.GetLocalPos1Attr())):
            (target,) = end.GetTargets()
            matrix = cache.GetLocalToWorldTransform(stage.GetPrimAtPath(target))
            ends.append(np.array(matrix.Transform(at.Get()), float))
        assert ends[0] == pytest.approx(ends[1], abs=1e-6)


OPTIONS = ["--gear", "a=6 mrad", "--gear", "b=4 mrad", "--gear-stiffness", "2000"]
OPTIONS += ["--rotor-inertia", "0.05", "--gear-damping", "2", "--period", "0.4", "--quiet"]


@pytest.mark.needs("mujoco")
def test_the_command_writes_the_whole_robot(path, tmp_path, capsys):
    out = tmp_path / "out"
    order = ["export", "simulator", str(path), "--all", *OPTIONS, "--check"]
    order += ["--spread", "20%", "--out", str(out)]
    assert main(order) == 0
    said = capsys.readouterr().out
    assert "a turns freely by 6 mrad (written: 6)" in said
    robot = yourdfpy.URDF.load(str(out / "robot.urdf"), load_meshes=False)
    assert robot.joint_map["a_play"].limit.upper == pytest.approx(3e-3)
    written = json.loads((out / "robot.json").read_text())["joints"]
    assert [one["joint"] for one in written] == ["a", "b"]
    assert main(order) == 2
    assert "robot.xml" in capsys.readouterr().err


@pytest.mark.needs("mujoco")
def test_the_tilt_of_the_axes_moves_mujocos_tool_as_far_as_the_budget_says(path):
    import mujoco

    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    mechanism = Mechanism(path, {"a": bearing, "b": bearing}, tool="slider")
    pose, tilting = {"a": 0.3, "b": -0.4, "c": 0.05}, ("a", "b")
    tilt, arm = bearing.play(second_order=False).reach[1], bearing.hinge.length / 2.0
    made = [Reduction(name, tilt=tilt, half_length=arm) for name in tilting]
    text = compile_robot(mechanism, made, pose, tilt=True).mjcf(made)
    written, own = reach(mechanism, made, pose, tilting)
    assert reach(mechanism, made, pose)[0] == 0.0
    # What is missing is at most the travel aside and along of two journals.
    assert 0.0 < own.worst[0] - written < 2 * np.hypot(1e-4, 1e-4)
    assert written > 0.9 * own.worst[0]
    found = find_reach(compile_text(text), "slider", pose, own.direction[0])
    assert found == pytest.approx(written, rel=0.02)
    model = mujoco.MjModel.from_xml_string(text)
    for name in tilting:
        assert model.tendon_range[model.tendon(f"{name}.rim").id, 1] == pytest.approx(arm * tilt)


@pytest.mark.needs("mujoco")
def test_shapes_go_with_the_mjcf(path, tmp_path):
    import mujoco
    import trimesh

    trimesh.creation.icosphere(radius=0.05).export(tmp_path / "ball.stl")
    shape = '<geometry><mesh filename="ball.stl"/></geometry>'
    shapes = f"<visual>{shape}</visual><collision>{shape}</collision>"
    lost = '<visual><geometry><mesh filename="lost.stl"/></geometry></visual>'
    text = path.read_text().replace("</inertial>", f"</inertial>{shapes}", 1)
    at = text.rindex("</inertial>") + len("</inertial>")
    shaped = tmp_path / "shaped.urdf"
    shaped.write_text(text[:at] + lost + text[at:])
    out = tmp_path / "out"
    options = ["--format", "mjcf", "--out", str(out)]
    assert main(["export", "simulator", str(shaped), "--all", *OPTIONS, *options]) == 0
    assert [one.name for one in (out / "meshes").iterdir()] == ["ball.stl"]
    assert mujoco.MjModel.from_xml_path(str(out / "robot.xml")).ngeom == 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--all"], "in Python clearance or gears; joints: a, b, c"),
        (["--all", *OPTIONS, "--gear", "zz=1 mrad"], "zz"),
        (["--all", *OPTIONS, "--tilt", "--format", "sdf"], "--format sdf with --tilt"),
        pytest.param(
            ["--all", "--joint", "a=0.1 mm"],
            "mjcf, sdf, urdf, usd, proto, py would have no play",
            marks=EVERY_FORMAT,
        ),
        pytest.param(
            ["--all", "--joint", "a=0.1 mm", "--format", "mjcf"],
            "--tilt",
            marks=pytest.mark.needs("mujoco"),
        ),
        pytest.param(
            ["--joint", "a=0.1 mm"],
            "mjcf, sdf, urdf, usd, proto, py would have no play: the clearance of a",
            marks=EVERY_FORMAT,
        ),
        (["--clearance", "0.1 mm"], "got none; --all reduces every one"),
        (["--all", "--joint", "c=0.1 mm"], "cannot be represented by a hinge"),
    ],
)
def test_the_command_refuses_what_cannot_be(path, tmp_path, capsys, options, message):
    assert main(["export", "simulator", str(path), *options, "--out", str(tmp_path / "o")]) == 2
    assert message in capsys.readouterr().err


def test_a_missing_package_leaves_its_format_out_and_says_how_to_get_it(
    path, tmp_path, capsys, monkeypatch
):
    import importlib.util

    real = importlib.util.find_spec
    hidden = ("mujoco", "newton_usd_schemas", "urdf2webots")
    monkeypatch.setattr(
        importlib.util, "find_spec", lambda name, *a: None if name in hidden else real(name, *a)
    )
    order = ["export", "simulator", str(path), "--all", *OPTIONS]
    assert main([*order, "--out", str(tmp_path / "o")]) == 0
    said = capsys.readouterr().out
    assert said.count("pip install '.[simulators]'") == 3
    names = {one.name for one in (tmp_path / "o").iterdir()}
    parts = {f"robot.{ending}" for ending in ("sdf", "urdf", "yaml", "json")}
    assert names == {*parts, "robot_dead_band.py"}
    assert main([*order, "--format", "mjcf", "--out", str(tmp_path / "p")]) == 2
    assert "package mujoco is missing" in capsys.readouterr().err
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(JointplayError, match="pip install"):
        compile_text("<mujoco/>")


@pytest.mark.needs("mujoco")
@pytest.mark.thorough
def test_the_so101_of_the_preset_stands_in_mujoco_with_its_servos_and_play(tmp_path):
    import mujoco

    out = tmp_path / "out"
    order = [
        "export",
        "simulator",
        "so101",
        "--preset",
        "--all",
        "--format",
        "mjcf",
        "--period",
        "0.4",
    ]
    assert main([*order, "--quiet", "--out", str(out)]) == 0
    text = (out / "robot.xml").read_text()
    found = find_play(compile_text(text))
    arm = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
    assert list(found) == arm
    for one in found.values():
        assert np.rad2deg(one.dead_band) == pytest.approx(0.5, rel=1e-3)
        assert one.stiffness == pytest.approx(25.3, rel=1e-3)
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    goal = 0.5
    at = int(model.actuator_ctrladr[model.actuator("shoulder_pan").id])
    data.ctrl[at] = goal
    while data.time < 3.0:
        mujoco.mj_step(model, data)
    assert np.isfinite(data.qpos).all()
    motors = {one.get("name"): one for one in ElementTree.fromstring(text).iter("dcmotor")}
    assert float(motors["wrist_flex"].get("motorconst")) == 1.21
    assert "gripper" not in motors
    motor, play = (
        float(data.qpos[model.joint(n).qposadr[0]]) for n in ("shoulder_pan", "shoulder_pan_play")
    )
    assert motor == pytest.approx(goal, abs=0.05)
    assert abs(play) < np.deg2rad(0.25) + 0.02


@pytest.mark.needs("mujoco")
@pytest.mark.thorough
def test_meshes_of_more_triangles_than_an_stl_may_have_are_written(tmp_path):
    """The trunk of a Go1 has such a mesh."""
    import trimesh

    trimesh.creation.icosphere(subdivisions=7).export(tmp_path / "ball.stl")
    shape = '<visual><geometry><mesh filename="ball.stl"/></geometry></visual></link>'
    path = tmp_path / "arm.urdf"
    links = '<link name="base"/>' + body("arm").replace("</link>", shape)
    path.write_text(f'<robot name="r">{links}{joint("a", "base", "arm")}</robot>')
    robot = compile_robot(Mechanism(path), ())
    assert [*robot.meshes] == ["ball.obj"]
    assert compile_text(robot.mjcf(()), robot.meshes).nmeshface == 20 * 4**7


def test_all_takes_joints_that_do_not_move_the_tool_and_keeps_those_that_are_done(
    tmp_path, capsys, monkeypatch
):
    from jointplay.bridges import reduction

    path = tmp_path / "two.urdf"
    legs = body("left") + body("right") + joint("l", "base", "left") + joint("r", "base", "right")
    path.write_text(f'<robot name="two"><link name="base"/>{legs}</robot>')
    command = ["export", "simulator", str(path), "--all", "--gear", "all=1 deg", "--quiet"]
    command += ["--format", "json", "--period", "0.4"]
    assert main([*command, "--out", str(tmp_path / "both")]) == 0
    said = json.loads((tmp_path / "both" / "robot.json").read_text())
    assert [one["joint"] for one in said["joints"]] == ["l", "r"]
    full = reduction._full_run

    def failing(mechanism, name, *others):
        if name == "r":
            raise JointplayError("it diverges")
        return full(mechanism, name, *others)

    monkeypatch.setattr(reduction, "_full_run", failing)
    capsys.readouterr()
    assert main([*command, "--out", str(tmp_path / "one")]) == 0
    assert "not reduced: joint 'r': it diverges" in capsys.readouterr().out
    said = json.loads((tmp_path / "one" / "robot.json").read_text())
    assert [one["joint"] for one in said["joints"]] == ["l"]


@pytest.mark.needs("mujoco")
def test_play_is_found_of_a_joint_whose_limits_exclude_zero(tmp_path):
    """Limits without zero, like a knee's: at zero MuJoCo pushes the joint towards them."""
    path = tmp_path / "knee.urdf"
    limits = 'lower="-9" upper="9"'
    path.write_text(
        '<robot name="leg"><link name="base"/>'
        + body("thigh", mass=0.6, com="0 0 -0.1", inertia=3e-3)
        + body("calf", mass=0.15, com="0 0 -0.1", inertia=8e-4)
        + joint("hip", "base", "thigh", axis="0 1 0")
        + joint("knee", "thigh", "calf", axis="0 1 0", at="0 0 -0.213").replace(
            limits, 'lower="-2.7" upper="-0.84"'
        )
        + "</robot>"
    )
    knee = Mechanism(path, gears={"knee": Gear(0.0175, 0.00679, 442.0, 0.1)})
    play = Reduction("knee", dead_band=0.0175, stiffness=442.0, damping=0.1, rotor_inertia=0.00679)
    robot = compile_robot(knee, [play])
    found = find_play(compile_text(robot.mjcf([play]), robot.meshes))["knee"]
    assert found.dead_band == pytest.approx(0.0175, rel=1e-2)
    assert found.stiffness == pytest.approx(442.0, rel=1e-2)


def test_a_free_base_that_files_would_hold_is_refused(tmp_path, capsys):
    path = tmp_path / "walker.urdf"
    links = body("trunk") + body("leg") + joint("hip", "trunk", "leg")
    path.write_text(f'<robot name="walker">{links}</robot>')
    command = ["export", "simulator", str(path), "--all", "--gear", "hip=1 deg", "--base", "free"]
    assert main([*command, "--format", "json", "--out", str(tmp_path / "o")]) == 2
    assert "--base free: the files hold the base" in capsys.readouterr().err


def test_joints_that_are_done_are_kept_when_interrupted_and_not_done_again(
    path, tmp_path, capsys, monkeypatch
):
    out, keep, reduce, done = tmp_path / "deep" / "out", Runs.keep, reduction.reduce, []
    order = ["export", "simulator", str(path), "--all", *OPTIONS, "--jobs", "1"]
    order += ["--format", "sdf", "--format", "json", "--quiet"]

    def stopping(*given):
        keep(*given)
        signal.raise_signal(signal.SIGINT)

    def counted(mechanism, joint, *given, **named):
        done.append(joint)
        return reduce(mechanism, joint, *given, **named)

    with monkeypatch.context() as patch:
        patch.setattr(Runs, "keep", stopping)
        assert main([*order, "--out", str(out)]) == 130
    assert "1 of 2 joints are kept" in capsys.readouterr().err
    assert [one.name for one in out.iterdir()] == ["joints.runs"]
    assert main([*order, "--gear-stiffness", "3e3", "--out", str(out)]) == 2
    assert "another robot" in capsys.readouterr().err
    with monkeypatch.context() as patch:
        patch.setattr(reduction, "reduce", counted)
        assert main([*order, "--out", str(out)]) == 0
    assert done == ["b"]
    assert main([*order, "--out", str(tmp_path / "whole")]) == 0
    assert {one.name for one in out.iterdir()} == {"robot.sdf", "robot.json"}
    for one in out.iterdir():
        assert one.read_text() == (tmp_path / "whole" / one.name).read_text()


def test_what_was_interrupted_at_once_leaves_no_folder(path, tmp_path, monkeypatch):
    for module in (reduction, reduced_robot):
        monkeypatch.setattr(module, "reduce", lambda *_, **__: signal.raise_signal(signal.SIGINT))
    for choice in (["--all", "--jobs", "1", *OPTIONS], OPTIONS[2:]):
        order = ["export", "simulator", str(path), *choice, "--format", "sdf"]
        assert main([*order, "--out", str(tmp_path / "deep" / "out")]) == 130
        assert not (tmp_path / "deep").exists()


def test_a_joint_is_simulated_once(mechanism, monkeypatch):
    runs, begin = [], Run.__init__
    monkeypatch.setattr(Run, "__init__", lambda *given: (runs.append(0), begin(*given))[1])
    reduction.reduce(mechanism, "a", period=0.2)
    assert len(runs) == 1


def test_a_joint_with_a_link_that_weighs_next_to_nothing_is_reduced(tmp_path):
    light = body("hand", mass=1e-3, com="0 0 0", inertia=1e-7)
    found = tmp_path / "light.urdf"
    found.write_text(
        f'<robot name="r"><link name="base"/>{light}{joint("a", "base", "hand")}</robot>'
    )
    mechanism = Mechanism(found, gears={"a": Gear(4e-3, 0.05, 2e3, 2.0)})
    (one,), refused = reduce_all(mechanism, period=0.05)
    assert (one.dead_band, refused) == (4e-3, {})
