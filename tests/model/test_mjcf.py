"""Robots described in MuJoCo's own format: read as MuJoCo reads them, and their play found."""

import os
import sys

import numpy as np
import pinocchio as pin
import pytest

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.cli import main
from jointplay.model.design import parse
from jointplay.model.formats import read
from jointplay.model.mjcf import load_spec
from jointplay.scenario import Scenario
from jointplay.scenario.reading import Setting
from jointplay.scenario.robot import robot_scenario

pytestmark = pytest.mark.needs("mujoco")

CUBE = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 3 1 4\n"

SHOULDER = """<mujoco model="shoulder">
<compiler angle="degree" eulerseq="zyx" inertiafromgeom="true"/>
<default>
  <joint damping="0.3"/><geom density="2700" rgba="0.2 0.4 0.6 1"/>
  <default class="tilted"><joint axis="1 2 0.5" range="-80 60" frictionloss="0.4"/></default>
</default>
<worldbody>
  <light pos="0 0 3"/><geom type="plane" size="1 1 0.1"/>
  <body name="foot" pos="0.1 0.2 0.3" euler="20 -70 40">
    <geom type="box" size="0.1 0.2 0.05"/>
    <body name="upper" pos="0.2 0 0.1" quat="0.3 -0.2 0.9 0.1" childclass="tilted">
      <joint name="a" pos="0.02 0.01 -0.03" ref="15"/>
      <joint name="b" axis="0 0 1" pos="-0.05 0 0.02"/>
      <joint name="slide" type="slide" axis="1 0 1" range="-0.1 0.3" ref="0.1"/>
      <geom type="capsule" fromto="0 0 0 0.3 0.1 0.2" size="0.04"/>
      <geom type="ellipsoid" pos="0.3 0 0" size="0.03 0.05 0.07" euler="10 20 30"/>
      <site name="grip" pos="0.3 0.1 0.2" axisangle="1 1 0 33"/>
      <body pos="0.3 0.1 0.2" xyaxes="0 1 0 0 0 1">
        <joint axis="0 1 0" limited="false"/>
        <geom type="cylinder" size="0.03 0.1" pos="0 0.02 0.1" mass="0.7"/>
        <geom type="sphere" size="0.05" pos="0.01 0.1 0" class="tilted"/>
      </body>
    </body>
  </body>
</worldbody></mujoco>"""

LEG = """<mujoco model="leg">
<compiler angle="radian"/><option gravity="1 2 -3"/>
<worldbody>
  <body name="trunk" pos="0 0 1" quat="0.9 0.1 0.3 0.2"><freejoint name="root"/>
    <inertial pos="0.1 0 0.02" mass="3" fullinertia="0.3 0.4 0.5 0.01 0.02 -0.03"/>
    <body name="thigh" pos="0 0.1 -0.1"><joint name="hip" axis="0 1 0" range="-1 1"/>
      <inertial pos="0 0.01 -0.2" mass="1.5" quat="0.5 0.5 0.1 0.7" diaginertia="0.03 0.02 0.04"/>
      <body name="point" pos="0 0 -0.3"><inertial pos="0.01 0 0" mass="0.2" diaginertia="0 0 0"/>
        <body name="shin" quat="0 1 1 0"><joint name="knee" axis="1 0 0" range="-2 0"/>
          <inertial pos="0 0 0.2" mass="0.8" diaginertia="0.01 0.01 0.004"/></body></body></body>
  </body>
  <body name="ball" pos="1 0 0"><freejoint/><geom size="0.1"/></body>
</worldbody></mujoco>"""

HINGE = '<joint name="{}" axis="0 0 1" {}/>'
ARM = """<mujoco model="arm"><compiler angle="radian" autolimits="true"/>
<option gravity="0 0 -9.81"><flag contact="disable"/></option>
<worldbody><body name="link"><joint name="j" axis="0 0 1" armature="0.02" damping="0.1"/>{second}
  <inertial pos="0.3 0 0" mass="2" diaginertia="0.01 0.02 0.03"/>
  <body name="tip" pos="0.5 0 0"><joint name="k" axis="0 1 0" stiffness="3" springref="0.2"/>
    <inertial pos="0 0 -0.1" mass="0.5" diaginertia="0.001 0.001 0.001"/></body></body>
</worldbody>{more}
<actuator><position name="servo" joint="j" kp="40" kv="2" forcerange="-5 5"/>
  <motor name="pull" joint="k"/></actuator>
<keyframe><key name="home" qpos="{qpos}"/></keyframe></mujoco>"""
PLAY = '<joint name="j_backlash" axis="0 0 1" range="-0.01 0.01" armature="0.01"/>'


def written(folder, text, name="robot.xml"):
    path = folder / name
    path.write_text(text)
    return path


@pytest.fixture
def loose(tmp_path):
    return written(tmp_path, ARM.format(second=PLAY, more="", qpos="0 0 0"), "arm.xml")


def moved(model, data, names, rng):
    """MuJoCo at a random state of these joints, the rest at zero; positions and speeds."""
    import mujoco

    q, v = rng.uniform(-1.0, 1.0, (2, len(names)))
    mujoco.mj_resetData(model, data)
    for name, position, speed in zip(names, q, v, strict=True):
        joint = model.joint(name)
        data.qpos[joint.qposadr[0]], data.qvel[joint.dofadr[0]] = position, speed
    mujoco.mj_forward(model, data)
    return q, v


@pytest.mark.parametrize("text", [SHOULDER, LEG, ARM.format(second="", more="", qpos="0 0")])
def test_places_masses_and_forces_are_mujocos(tmp_path, text):
    import mujoco

    path = written(tmp_path, text)
    model = load_spec(path).compile()  # which has names for all
    data = mujoco.MjData(model)
    ours = parse(read(path)).copy()
    ours.gravity.linear = model.opt.gravity.copy()
    names = [str(name) for name in ours.names][1:]
    assert len(names) == len([k for k in model.jnt_type if k != mujoco.mjtJoint.mjJNT_FREE])
    dofs = [int(model.joint(name).dofadr[0]) for name in names]
    rng = np.random.default_rng(5)
    for _ in range(10):
        position, v = moved(model, data, names, rng)
        q, there = pin.neutral(ours), ours.createData()
        for name, value in zip(names, position, strict=True):
            joint = ours.joints[ours.getJointId(name)]
            q[joint.idx_q : joint.idx_q + joint.nq] = (
                value if joint.nq == 1 else (np.cos(value), np.sin(value))
            )
        pin.framesForwardKinematics(ours, there, q)
        for index in range(1, model.nbody):
            name = model.body(index).name
            if name == "ball":
                assert not ours.existFrame(name)
                continue
            frame = there.oMf[ours.getFrameId(name, pin.FrameType.BODY)]
            assert frame.translation == pytest.approx(data.xpos[index], abs=1e-12)
            assert frame.rotation.ravel() == pytest.approx(data.xmat[index], abs=1e-12)
        mass = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, mass)
        wanted = (mass - np.diag(model.dof_armature))[np.ix_(dofs, dofs)]
        found = np.triu(pin.crba(ours, there, q).reshape(ours.nv, ours.nv))
        found = found + np.triu(found, 1).T
        assert found == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max())
        bias = pin.nonLinearEffects(ours, there, q, v)
        wanted = data.qfrc_bias[dofs]
        assert bias == pytest.approx(wanted, rel=1e-9, abs=1e-9 * np.abs(wanted).max())


def test_limits_losses_and_frames_are_in_the_description(tmp_path):
    found = read(written(tmp_path, SHOULDER))
    assert list(found.joints)[:2] == ["foot_fixed", "a"]
    joint = found.joints["a"]
    assert (joint.lower, joint.upper) == pytest.approx((np.radians(-80.0), np.radians(60.0)))
    assert (joint.friction, joint.damping) == (0.4, 0.3)
    assert found.joints["slide"].kind == "prismatic"
    assert found.joints["body3_joint"].kind == "continuous"
    assert {"upper", "body3", "grip"} <= set(found.links)
    assert found.root == "world"


def test_shapes_of_all_kinds_that_a_urdf_has_are_in_the_description(tmp_path):
    root = read(written(tmp_path, SHOULDER)).elements()
    for role in ("visual", "collision"):  # a capsule is a cylinder and two spheres
        shapes = [one.tag for one in root.iterfind(f".//{role}/geometry/*")]
        assert sorted(shapes) == ["box", "cylinder", "cylinder", "sphere", "sphere", "sphere"]


def test_a_robot_that_floats_is_the_largest_and_its_base_is_free(tmp_path, capsys):
    path = written(tmp_path, LEG)
    found = read(path).beyond
    assert found.tables["robot"] == {"base": "free", "gravity": [1.0, 2.0, -3.0]}
    scenario = robot_scenario(str(path), ["hip"], moves=False)
    mechanism = scenario.mechanism()
    assert mechanism.free_base
    assert mechanism.gravity == (1.0, 2.0, -3.0)
    assert "left out, for they float freely: ball" in scenario.assumptions
    assert main(["robots", str(path)]) == 0
    assert "hip" in capsys.readouterr().out


def test_a_second_hinge_is_play_and_the_command_says_so(loose, capsys):
    found = read(loose)
    assert list(found.joints) == ["j", "k"]
    gear = found.beyond.tables["gears"]["j"]
    assert gear["play"] == pytest.approx(0.02)
    assert gear["rotor_inertia"] == 0.02
    assert main(["budget", str(loose), "--tool", "tip"]) == 0
    out = capsys.readouterr().out
    assert "note: the MJCF has backlash, here of gears as stiff as its stops: 1.15 deg in j" in out
    assert (
        "note: not read of the MJCF: keyframes, armature of hinges of play, actuators with" in out
    )
    assert "out position gains (pull)" in out
    assert "up to 5 mm off" in out  # 0.01 rad either way at 0.5 m
    assert main(["budget", str(loose), "--tool", "tip", "--gear", "j=0.01"]) == 0
    assert "up to 2.5 mm off" in capsys.readouterr().out


def test_a_urdf_of_it_has_only_what_a_urdf_says(tmp_path):
    path, out = written(tmp_path, ARM.format(second="", more="", qpos="0 0")), tmp_path / "arm.urdf"
    assert read(path).beyond.tables
    sizes = ["--clearance", "1e-4", "--axial-clearance", "1e-4"]
    assert main(["export", "urdf", str(path), "--joint", "j", *sizes, "--out", str(out)]) == 0
    assert read(out).beyond.tables == {}


def test_a_mechanism_and_a_scenario_have_what_the_file_says(loose, capsys):
    file = loose.with_suffix(".toml")
    file.write_text(
        '[robot]\nurdf = "arm.xml"\n[joints.k]\nradial_clearance = "0.1 mm"\n'
        "[integration]\nduration = 0.1\n"
    )
    assert main(["check", str(file)]) == 0, capsys.readouterr().err
    assert "the MJCF has backlash" in capsys.readouterr().out
    loose.write_text(loose.read_text().replace("0 0 -9.81", "0 0 -1.62"))
    motion = "[motion]\ntimes = [0.0, 0.1]\njoints = { j = [0.0, 0.1] }\n"
    file.write_text(file.read_text() + motion)
    scenario = Scenario.load(file)
    ways = robot_scenario(str(loose)).mechanism(), scenario.mechanism(), jp.Mechanism(loose)
    for mechanism in ways:
        assert mechanism.gravity == (0.0, 0.0, -1.62)
        assert mechanism.gears["j"].play == pytest.approx(0.02)
        assert mechanism.gears["j"].rotor_inertia == 0.02
    assert scenario.simulation().drive["j"].effort == 5.0
    assert "k_spring" in scenario.simulation().loads
    there = jp.Motion(["j", "k"], [0.0, 0.1], [[0.0, 0.0], [0.1, 0.0]])
    by_hand, by_name = jp.Simulation(jp.Mechanism(loose), there), scenario.simulation()
    assert by_hand.drive == by_name.drive
    assert by_hand.loads == by_name.loads
    own = jp.Simulation(jp.Mechanism(loose), there, jp.loads.Prescribed(), loads={})
    assert (own.drive, own.loads) == (jp.loads.Prescribed(), {})
    assert jp.Simulation(jp.Mechanism(loose), duration=1.0).drive == jp.loads.ComputedTorque()
    assert jp.Mechanism(loose, gravity="balanced").gravity == (0.0, 0.0, 0.0)
    file.write_text(file.read_text() + "[gears.j]\nplay = 0.005\n")
    assert Scenario.load(file).mechanism().gears["j"].play == 0.005


MOON = """<mujoco><compiler angle="radian"/><option gravity="0 0 -1.62"/><worldbody>
<body name="m" pos="0 0 .5"><joint name="motor" axis="0 1 0" damping=".1" armature=".05"/>
<joint name="motor_play" axis="0 1 0" range="-.01 .01" solreflimit=".004 1"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1" contype="0" conaffinity="0"/>
<body name="n" pos=".3 0 0"><joint name="second" axis="0 1 0" armature=".02" frictionloss=".1"/>
<geom type="capsule" fromto="0 0 0 .2 0 0" size=".02" mass=".4" contype="0" conaffinity="0"/>
</body></body></worldbody><actuator><position joint="motor" kp="200" kv="20" forcerange="-20 20"/>
<position joint="second" kp="90" kv="6"/></actuator></mujoco>"""


def test_every_way_in_obeys_gravity_armature_play_and_drives(tmp_path, capsys):
    path = written(tmp_path, MOON, "moon.xml")
    goals = {"motor": [0.0, 0.3], "second": [0.0, -0.2]}
    step, joints = "20 us", ", ".join(f"{name} = {at}" for name, at in goals.items())
    file = tmp_path / "file.toml"
    file.write_text(
        f'[robot]\nurdf = "moon.xml"\n[motion]\ntimes = [0.0, 0.05]\njoints = {{{joints}}}\n'
        f'[integration]\nduration = 0.05\nstep = "{step}"\n'
    )
    sets = [
        f"motion={{times=[0.0, 0.05], joints={{{joints}}}}}",
        "integration.duration=0.05", f"integration.step={step}",
    ]  # fmt: skip
    motion = jp.Motion([*goals], [0.0, 0.05], np.array([*goals.values()]).T)
    wanted = jp.simulate(jp.Mechanism(path), motion, duration=0.05, step=step)
    assert wanted.simulation.mechanism.gravity == (0.0, 0.0, -1.62)
    assert wanted.simulation.mechanism.armature == {"second": 0.02}
    assert wanted.simulation.mechanism.gears["motor"].rotor_inertia == 0.05
    assert {one.kind for one in wanted.simulation.drive.values()} == {"servo"}
    ways = [
        Scenario.load(file).simulation().run(),
        robot_scenario(str(path), settings=sets).simulation().run(),
    ]
    for command in (["run", str(file)], ["run", str(path)]):
        out = tmp_path / f"o{len(ways)}"
        more = [part for one in sets for part in ("--set", one)] * (command[1] == str(path))
        assert main([*command, *more, "--no-figures", "--quiet", "--out", str(out)]) == 0
        ways.append(jp.Result.load(next(out.glob("*.nc"))))
    for way in ways:
        assert way.simulation.mechanism == wanted.simulation.mechanism
        assert way.simulation.drive == wanted.simulation.drive
        assert np.array_equal(way["q"].values, wanted["q"].values)


def test_what_hinges_of_play_and_a_free_base_have_besides_is_named(tmp_path):
    more = 'damping="3" stiffness="4" range="-.01 .01" solreflimit=".004 1"'
    path = written(tmp_path, MOON.replace('range="-.01 .01" solreflimit=".004 1"', more))
    (note,) = (one for one in read(path).beyond.notes if "not read" in one)
    assert "damping of hinges of play, springs of hinges of play" in note
    assert "limits of hinges" not in note
    base = '<body name="m" pos="0 0 .5"><joint type="free" damping="1"/><geom size=".1"/></body>'
    text = f"<mujoco><worldbody>{base.replace('</body>', LIMB)}</worldbody></mujoco>"
    assert "damping of the free base" in " ".join(read(written(tmp_path, text)).beyond.notes)
    behind = MOON.replace('<position joint="motor" kp="200" kv="20" forcerange="-20 20"/>', "")
    notes = read(written(tmp_path, behind)).beyond.notes
    assert "springs and friction stand before the play" in " ".join(notes)


LIMB = '<body name="l"><joint name="hip"/><geom size=".1"/></body></body>'


def test_a_tendon_without_an_arm_is_no_play(loose):
    fixed = '<fixed limited="true" range="0 1"><joint joint="j_backlash" coef="0"/></fixed>'
    tendon = f"<tendon>{fixed}</tendon></mujoco>"
    loose.write_text(loose.read_text().replace("</mujoco>", tendon))
    assert read(loose).beyond.hinges == {"j": "j_backlash"}


def test_a_tendons_dead_band_is_play_too(tmp_path):
    second = HINGE.format("j_play", 'armature="0.001"')
    tendon = (
        '<tendon><fixed springlength="-0.004 0.002" stiffness="900" damping="3">'
        '<joint joint="j_play" coef="2"/></fixed></tendon>'
    )
    path = written(tmp_path, ARM.format(second=second, more=tendon, qpos="0 0 0"))
    gear = read(path).beyond.tables["gears"]["j"]
    wanted = {"play": 0.003, "stiffness": 3600.0, "damping": 12.0, "rotor_inertia": 0.02}
    assert {key: gear[key] for key in wanted} == pytest.approx(wanted)
    stops = tendon.replace('springlength="-0.004 0.002" stiffness="900" damping="3"', 'range="0 1"')
    path = written(tmp_path, ARM.format(second=second, more=stops, qpos="0 0 0"))
    assert read(path).beyond.tables["gears"]["j"]["play"] == pytest.approx(0.5)


def test_position_actuators_armature_and_springs_are_the_joints(loose, tmp_path):
    tables = read(loose).beyond.tables
    drive = tables["drives"]["j"]
    servo = jp.loads.Servo(**{key: value for key, value in drive.items() if key != "kind"})
    assert servo.stall * servo.p_gain == pytest.approx(40.0)
    assert servo.braking == pytest.approx(2.0)
    assert servo.effort == 5.0
    assert servo.viscous == 0.1  # the motor's, which is before the play
    assert read(loose).joints["j"].damping == 0.0
    assert list(tables["drives"]) == ["j"]
    assert tables["loads"]["k_spring"] == {
        "kind": "torsion-spring", "joint": "k", "stiffness": 3.0, "rest": pytest.approx(0.2)
    }  # fmt: skip
    firm = read(written(tmp_path, ARM.format(second="", more="", qpos="0 0"), "firm.xml"))
    assert "gears" not in firm.beyond.tables
    assert firm.beyond.armature == {"j": 0.02}
    assert firm.joints["j"].damping == 0.1


def test_armature_is_inertia_of_its_joint_or_the_rotor_of_a_gear_that_one_gives(tmp_path):
    import mujoco

    path = written(tmp_path, ARM.format(second="", more="", qpos="0 0"))
    model = mujoco.MjModel.from_xml_path(str(path))
    data, wanted = mujoco.MjData(model), np.zeros((2, 2))
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, wanted)
    robot = jp.Mechanism(path)
    at = [robot.coordinate(name) for name in ("j", "k")]
    mass = robot.mass_matrix(robot.configuration({}))[np.ix_(at, at)]
    assert mass == pytest.approx(wanted, rel=1e-9)
    file = tmp_path / "geared.toml"
    gear = 'play = "1 deg"\nstiffness = 1000'
    file.write_text(f'[robot]\nurdf = "robot.xml"\n[gears.j]\n{gear}\n')
    geared = Scenario.load(file).mechanism()
    assert geared.gears["j"].rotor_inertia == 0.02
    for one in (geared, geared.ideal()):
        assert not one.model.armature.any()


@pytest.mark.parametrize(("second", "most"), [("", 2e-5), (PLAY, 5e-3)])
def test_a_driven_arm_moves_as_in_mujoco(tmp_path, second, most):
    """Its stops, soft in MuJoCo, are springs here."""
    import mujoco

    zeros = "0 0 0" if second else "0 0"
    text = ARM.format(second=second, more="", qpos=zeros).replace('axis="0 1 0"', 'axis="1 0 0"')
    path = written(tmp_path, text.replace("-5 5", "-50 50"))
    model = mujoco.MjModel.from_xml_path(str(path))
    model.opt.timestep = 1e-5
    data = mujoco.MjData(model)
    while data.time < 0.3:
        part = data.time / 0.3
        data.ctrl[0] = 0.2 * part**3 * (10.0 - 15.0 * part + 6.0 * part**2)
        mujoco.mj_step(model, data)
    motion = {"times": [0.0, 0.3], "joints": {"j": [0.0, 0.2]}}
    settings = [
        Setting(("motion",), motion, "test"),
        Setting(("drives", "k", "kind"), "free", "test"),
        Setting(("integration", "duration"), 0.3, "test"),
    ]
    scenario = robot_scenario(str(path), ideal=not second, settings=settings)
    result = scenario.simulation().run()
    for name in ("j", "k"):
        wanted = data.qpos[model.joint(name).qposadr[0]]
        if second and name == "j":
            wanted += data.qpos[1]
        assert result["q"].sel(coordinate=name).values[-1] == pytest.approx(wanted, abs=most)


def test_a_ball_is_a_spherical_joint_without_clearance(tmp_path):
    text = LEG.replace('<joint name="knee" axis="1 0 0" range="-2 0"/>',
                       '<joint name="knee" type="ball"/>')  # fmt: skip
    path = written(tmp_path, text)
    mechanism = robot_scenario(str(path), ["hip"], moves=False).mechanism()
    assert {"knee.yaw", "knee.pitch"} <= {str(one) for one in mechanism.coordinates}


def test_a_coupled_joint_mimics(tmp_path):
    more = '<equality><joint joint1="k" joint2="j" polycoef="0.1 -2 0 0 0"/></equality>'
    found = read(written(tmp_path, ARM.format(second="", more=more, qpos="0 0"))).joints["k"]
    assert found.mimic == ("j", -2.0, pytest.approx(0.1))


def test_what_only_is_seen_may_be_missing_what_gives_inertia_may_not(tmp_path, capsys):
    assets = (
        '<asset><mesh name="part" file="part.obj"/><texture name="t" type="2d" file="t.png"/>'
        '<material name="m" texture="t"/></asset>'
    )
    shown = ARM.replace("<worldbody>", f"{assets}<worldbody>").replace(
        '<body name="tip"', '<geom type="mesh" mesh="part" material="m"/><body name="tip"'
    )
    text = shown.format(second="", more="", qpos="0 0")
    path = written(tmp_path, text)
    assert 'filename="part.obj"' in read(path).text
    needed = written(tmp_path, text.replace('<inertial pos="0.3 0 0"', '<inertial pos="0 0 0"'))
    assert read(needed).links
    bare = text.replace('<inertial pos="0.3 0 0" mass="2" diaginertia="0.01 0.02 0.03"/>', "")
    path = written(tmp_path, bare)
    with pytest.raises(JointplayError, match=r"body 'link' takes its inertia from the mesh"):
        read(path)
    (tmp_path / "part.obj").write_text(CUBE)
    found = read(path)
    places = [one for one in found.parsed.iter("visual")]
    assert places
    # MuJoCo moves a mesh to its centre of mass; the picture stands where the file has it.
    (link,) = [one for one in found.declared.links if one.name == "link"]
    assert link.visuals[0].origin == pytest.approx(np.eye(4), abs=1e-9)
    assert link.inertial.origin[:3, 3] == pytest.approx(np.full(3, 0.25), abs=1e-6)


def test_what_mujoco_refuses_is_told_in_its_words(tmp_path, capsys):
    path = written(tmp_path, ARM.format(second="<joimt/>", more="", qpos="0 0"))
    assert main(["budget", str(path), "--joint", "j=0.1mm"]) == 2
    assert "MuJoCo cannot read the MJCF" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("<worldbody>", "<worldbody>mass 3", "no text between elements: 'mass 3' in <worldbody>"),
        ("<joint ", '<joint ref="" ', "takes what is empty as not given: ref in <joint>"),
        ("<option ", '<option gravity="0 0 0"/><option ', "the last holds: gravity in <option>"),
        ("</mujoco>", "</mujoco><worldbody/>", "no well-formed XML, and MuJoCo read what it could"),
    ],
)
def test_what_mujoco_passes_over_is_said(tmp_path, old, new, said):
    path = tmp_path / "leg.xml"
    path.write_text(LEG)
    assert not any("MuJoCo" in line for line in read(path).beyond.notes)
    path.write_text(LEG.replace(old, new, 1))
    assert any(said in line for line in read(path).beyond.notes)


def test_without_mujoco_it_is_said_how_to_get_it(loose, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(JointplayError, match=r"pip install '\.\[simulators\]'"):
        read(loose)


OWN = """<mujoco model="own">
<compiler angle="degree" meshdir="parts"/>
<option timestep="0.002" integrator="implicitfast"/>
<default><joint damping="0.4" armature="0.03" range="-170 170"/><position kp="60" kv="4"/></default>
<asset><mesh name="part" file="part.obj" scale="0.1 0.1 0.1"/></asset>
<worldbody>
  <!-- the arm -->
  <body name="upper"><joint name="shoulder" axis="0 0 1"/>
    <joint name="swing" axis="0.123456789 1 0" range="-90 90"/>
    <geom name="rod" type="capsule" fromto="0 0 0 0.123456789 0 0.3" size="0.03"/>
    <include file="hand.xml"/>
  </body>
  <body name="cube" pos="2 0 0"><freejoint name="float"/>
    <geom type="box" size="0.1 0.1 0.1"/></body>
</worldbody>
<actuator><position name="turn" joint="shoulder"/><position name="bend" joint="elbow"/></actuator>
<sensor><jointpos name="seen" joint="elbow"/></sensor>
<keyframe><key name="home" qpos="0.1 0.2 0.3 2 0 0 1 0 0 0" ctrl="0.1 0.3"/></keyframe>
</mujoco>"""
HAND = """<mujoco><body name="hand" pos="0.123456789 0 0.3"><joint name="elbow" axis="0 1 0.3"/>
  <geom type="mesh" mesh="part"/><site name="grip"/></body></mujoco>"""


@pytest.fixture
def own(tmp_path):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "part.obj").write_text(CUBE)
    written(tmp_path, HAND, "hand.xml")
    return written(tmp_path, OWN, "own.xml")


def swung(model, seconds=0.5):
    """Angles of its elbow and shoulder while its position actuators turn it from its keyframe."""
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    way = []
    while data.time < seconds:
        data.ctrl[:] = 0.5 * np.sin(6.0 * data.time), -0.4
        mujoco.mj_step(model, data)
        way.append([data.joint(name).qpos[0] for name in ("elbow", "shoulder", "swing")])
    return np.array(way)


def exported(own, folder, *options):
    command = ["export", "simulator", str(own), "--joint", "elbow", "--format", "mjcf", "--quiet"]
    assert main([*command, "--out", str(folder), *options]) == 0
    return folder / "elbow.xml"


def test_play_goes_into_ones_own_file_and_all_else_stays(own, tmp_path, capsys):
    import mujoco

    teeth = ["--gear", "elbow=0.5 deg", "--gear-stiffness", "900", "--gear-damping", "0.5"]
    path = exported(own, tmp_path / "out", *teeth, "--check")
    out = capsys.readouterr().out
    assert "MuJoCo: elbow turns freely by 8.7266 mrad (written: 8.7266), then 900 N m/rad" in out
    model = mujoco.MjModel.from_xml_path(str(path))
    plain = mujoco.MjModel.from_xml_path(str(own))
    assert "<!-- the arm -->" in path.read_text()
    assert (model.nq, model.nv) == (plain.nq + 1, plain.nv + 1)
    assert model.jnt_bodyid[model.joint("elbow_play").id] == model.body("hand").id
    assert model.key("home").qpos.tolist() == [0.1, 0.2, 0.3, 0.0, 2.0, 0.0, 0.0, 1, 0, 0, 0]
    assert model.dof_damping.ravel()[model.joint("elbow_play").dofadr[0]] == 0.0
    assert model.dof_armature[model.joint("elbow").dofadr[0]] == 0.03
    assert model.opt.timestep <= plain.opt.timestep
    for kind in ("body", "geom", "site", "actuator", "sensor", "mesh"):
        for index in range(
            getattr(plain, f"n{ {'actuator': 'u'}.get(kind, kind) }".replace(" ", ""))
        ):
            assert getattr(model, kind)(index).name == getattr(plain, kind)(index).name


def test_without_play_ones_own_file_moves_as_before(own, tmp_path):
    import mujoco

    from jointplay.bridges.edited_mjcf import edited_robot
    from jointplay.bridges.reduction import Reduction

    mechanism = jp.Mechanism(own)
    plain = swung(mujoco.MjModel.from_xml_path(str(own)))
    assert np.ptp(plain, axis=0).min() > 0.01
    robot = edited_robot(mechanism, [], {}, tilt=False)
    text = robot.mjcf([Reduction("elbow", damping=0.0)])
    assert swung(mujoco.MjModel.from_xml_string(text)) == pytest.approx(plain, abs=1e-12)
    # And with a hinge whose teeth have next to none: as stiff as the step resolves.
    stiff = Reduction("swing", dead_band=1e-9, stiffness=4e7, damping=50.0, rotor_inertia=0.03)
    model = mujoco.MjModel.from_xml_string(robot.mjcf([stiff]))
    plain = mujoco.MjModel.from_xml_path(str(own))
    plain.opt.timestep = model.opt.timestep
    assert swung(model, 0.1) == pytest.approx(swung(plain, 0.1), abs=1e-6)


@pytest.mark.thorough
def test_play_that_is_there_is_changed_and_tilt_is_refused(loose, own, tmp_path, capsys):
    import mujoco

    command = ["export", "simulator", str(loose), "--format", "mjcf", "--joint", "j", "--quiet"]
    out = tmp_path / "out"
    assert main([*command, "--gear", "j=0.004", "--check", "--out", str(out)]) == 0
    assert "j turns freely by 4 mrad (written: 4)" in capsys.readouterr().out
    model = mujoco.MjModel.from_xml_path(str(out / "j.xml"))
    assert model.njnt == 3
    assert not model.jnt_limited[model.joint("j_backlash").id]
    again = ["export", "simulator", str(out / "j.xml"), "--format", "mjcf", "--joint", "j"]
    assert main([*again, "--gear", "j=0.006", "--check", "--out", str(tmp_path / "more")]) == 0
    assert "j turns freely by 6 mrad (written: 6)" in capsys.readouterr().out
    tilted = ["export", "simulator", str(own), "--joint", "elbow=0.1mm", "--tilt", "--format"]
    assert main([*tilted, "mjcf", "--out", str(tmp_path / "tilt")]) == 2
    assert "only the play about joints' own axes" in capsys.readouterr().err


@pytest.mark.parametrize(
    "equality",
    [
        '<connect body1="link" body2="tip" anchor="0 0 0"/>',
        '<weld body1="tip" body2="world"/>',
        '<joint joint1="k" polycoef="0.3 0 0 0 0"/>',
        '<joint joint1="k" joint2="j" polycoef="0 1 2 0 0"/>',
    ],
)
def test_an_equality_without_which_the_robot_is_another_is_refused(tmp_path, equality, capsys):
    more = f"<equality>{equality}</equality>"
    text = ARM.format(second="", more=more, qpos="0 0")
    path = written(tmp_path, text)
    with pytest.raises(JointplayError, match="which cannot be read"):
        jp.Mechanism(path)
    assert main(["robots", str(path)]) == 2
    assert "equality" in capsys.readouterr().err
    written(tmp_path, text.replace("/></eq", ' active="false"/></eq'))
    assert jp.Mechanism(path).joints


@pytest.mark.parametrize(
    ("inside", "words"),
    [
        ('<replicate count="300000"><body><joint/><geom size="1"/></body></replicate>', "did not"),
        ('<include file="pipe.xml"/>', "which is no file"),
    ],
)
def test_an_mjcf_without_end_is_ended(tmp_path, inside, words, monkeypatch):
    os.mkfifo(tmp_path / "pipe.xml")
    monkeypatch.setattr("jointplay.model.mjcf.TIME_S", 3.0)
    path = written(tmp_path, f"<mujoco><worldbody>{inside}</worldbody></mujoco>")
    with pytest.raises(JointplayError, match=words):
        read(path)


def test_an_included_file_that_changes_is_read_again(tmp_path):
    part = '<mujocoinclude><body name="{}"><joint/><geom size="1"/></body></mujocoinclude>'
    written(tmp_path, part.format("first"), "part.xml")
    text = '<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>'
    path = written(tmp_path, text)
    assert "first" in read(path).links
    written(tmp_path, part.format("another"), "part.xml")
    assert "another" in read(path).links
