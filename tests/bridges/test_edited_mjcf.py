"""The calibrated robot as MJCF: bodies where the calibration found them, all else unchanged."""

import re
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.bridges import edited_mjcf
from jointplay.bridges.edited_mjcf import corrected_mjcf
from jointplay.bridges.urdf import to_urdf
from jointplay.cli import main
from jointplay.model.formats import read
from jointplay.model.urdf import parse

pytestmark = pytest.mark.needs("mujoco")

ARM = """<mujoco model="arm"><compiler angle="degree"/>
<!-- a comment that stays -->
<worldbody><body name="a" pos="0 0 .1" euler="10 20 30">
<joint name="j1" axis="0 1 0" pos=".02 0 0" ref="15" range="-90 90"/>
<geom type="box" size=".1 .02 .02" pos=".1 0 0"/>
<body name="b" pos=".2 0 0" axisangle="0 0 1 40"><joint name="j2" axis="0 .6 .8"/>
<geom type="box" size=".1 .02 .02" pos=".1 0 0"/>
<body name="c" pos=".2 0 0"><joint name="s" type="slide" axis="1 0 0" ref="0.05" range="-.1 .1"/>
<geom type="box" size=".02 .02 .02" mass=".3"/><site name="tip" pos=".03 0 .01"/>
</body></body></body></worldbody><actuator><position joint="j2" kp="20"/></actuator></mujoco>"""


def apart(robot, corrections):
    """Largest difference between MuJoCo's bodies and those of the corrected URDF."""
    import mujoco

    text, meshes = corrected_mjcf(robot, corrections)
    assets = {f"meshes/{name}": content for name, content in meshes.items()}
    model = mujoco.MjModel.from_xml_string(text, assets)
    data, most = mujoco.MjData(model), 0.0
    urdf = to_urdf(robot.ideal(), corrections)
    new = jp.Mechanism(parse(urdf, robot.description.path, robot.allow_unphysical), tool=robot.tool)
    names = {model.body(i).name for i in range(1, model.nbody)}
    for q in np.random.default_rng(1).uniform(-0.1, 0.1, (5, len(robot.joints))):
        for name, value in zip(robot.joints, q, strict=True):
            data.qpos[model.joint(name).qposadr[0]] = value
        mujoco.mj_kinematics(model, data)
        full = new.configuration(dict(zip(robot.joints, q, strict=True)))
        pin.framesForwardKinematics(new.model, new.data, full)
        for name in filter(new.model.existFrame, names):
            place = new.data.oMf[new.model.getFrameId(name)]
            off = place.translation - data.body(name).xpos
            turned = place.rotation - data.body(name).xmat.reshape(3, 3)
            most = max(most, np.abs(off).max(), np.abs(turned).max())
    return most, text


def corrections_of(robot, seed=0):
    random = np.random.default_rng(seed)
    return {
        name: pin.SE3(pin.exp3(1e-2 * random.normal(size=3)), 1e-3 * random.normal(size=3))
        for name in robot.joints
    }


@pytest.mark.parametrize("name", ["arm.xml", "ur5", "so101"])
def test_the_corrected_mjcf_stands_where_the_corrected_urdf_does(name, tmp_path):
    (tmp_path / "arm.xml").write_text(ARM)
    robot = jp.Mechanism(tmp_path / name if name.endswith(".xml") else name)
    most, text = apart(robot, corrections_of(robot))
    assert most < 1e-12
    if name == "arm.xml":
        assert "a comment that stays" in text
        assert '<position joint="j2" kp="20"' in text
        assert 'ref="15"' in text


def test_a_body_with_several_joints_is_refused(tmp_path):
    path = tmp_path / "arm.xml"
    path.write_text(
        ARM.replace('<joint name="j2"', '<joint name="x" axis="1 0 0"/><joint name="j2"')
    )
    robot = jp.Mechanism(path)
    with pytest.raises(JointplayError, match=r"'j2' cannot be written: its body has several"):
        corrected_mjcf(robot, {"j2": pin.SE3.Identity()})


def test_calibrate_writes_it(tmp_path, capsys):
    import mujoco

    path = tmp_path / "arm.xml"
    path.write_text(ARM)
    robot = jp.Mechanism(path)
    random = np.random.default_rng(2)
    motor = random.uniform(-0.09, 0.09, (40, 3)) + random.uniform(-1, 1, (40, 3)) * [1, 1, 0]
    rows = []
    for q in motor:
        pin.framesForwardKinematics(robot.model, robot.data, q + np.array([0.02, -0.01, 0.0]))
        place = robot.data.oMf[robot.tool_frame].translation + 1e-5 * random.normal(size=3)
        rows.append(",".join(f"{x:.8f}" for x in (*q, *place)))
    head = "j1 motor [rad],j2 motor [rad],s motor [m],tool x [m],tool y [m],tool z [m]"
    (tmp_path / "p.csv").write_text("\n".join([head, *rows]) + "\n")
    out = tmp_path / "corrected.xml"
    order = ["calibrate", str(path), str(tmp_path / "p.csv"), "--always", "offset", "--quiet"]
    assert main([*order, "--mjcf", str(out)]) == 0
    assert f"written: {out}: 3 joints corrected" in capsys.readouterr().out
    model = mujoco.MjModel.from_xml_path(str(out))
    assert not np.allclose(
        model.body("b").quat, mujoco.MjModel.from_xml_path(str(path)).body("b").quat
    )


DRIVEN = """<mujoco model="m"><compiler angle="degree"/>
<option gravity="0 0 -9.81" timestep="0.002"/><worldbody><body name="a">
<joint name="j" axis="0 1 0" damping="0.3" frictionloss="0.01"
  armature="0.02"/>{}<geom type="capsule" fromto="0 0 0 0.25 0 0.1" size="0.02" mass="0.9"/></body>
</worldbody>{}<actuator><position joint="j" kp="300" kv="10"/></actuator></mujoco>"""
GEAR = ["--gear", "j=1 deg", "--gear-stiffness", "3000", "--gear-damping", "2"]


def test_friction_that_stays_before_the_play_damps_no_teeth(tmp_path, capsys):
    path, out = tmp_path / "m.xml", tmp_path / "out"
    path.write_text(DRIVEN.format("", ""))
    said = ["export", "simulator", str(path), "--joint", "j", *GEAR, "--for", "mujoco", "--check"]
    assert main([*said, "--out", str(out)]) == 0
    text, told = (out / "j.xml").read_text(), capsys.readouterr().out
    assert "link's angle off" in told
    assert ", beyond" not in told
    (teeth,) = re.findall(r'name="j\.play"[^>]* damping="([^"]*)"', text)
    assert float(teeth) > 1.0
    assert text.count("<option") == 1
    assert "meshdir" not in text
    assert "meshes" not in told
    assert "note: the step of the MJCF is now" in told


def test_the_stated_error_is_that_of_the_file_as_written(tmp_path, capsys, monkeypatch):
    path = tmp_path / "m.xml"
    path.write_text(DRIVEN.format("", ""))
    said = ["export", "simulator", str(path), "--joint", "j", *GEAR, "--for", "mujoco", "--out"]

    def stated(out):
        assert main([*said, str(tmp_path / out)]) == 0
        told = capsys.readouterr().out
        assert "the written MJCF's, run in MuJoCo" in told
        return float(re.findall(r"link's angle, stated error +([0-9.e-]+) mrad", told)[0])

    fine, whole = stated("fine"), edited_mjcf._put_tendons
    monkeypatch.setattr(  # a writer that loses half of the play, 1 degree
        edited_mjcf,
        "_put_tendons",
        lambda to, one, *more: whole(to, replace(one, dead_band=0.5 * one.dead_band), *more),
    )
    assert fine < 0.1
    assert stated("half") > 1e3 * np.radians(0.25)  # mrad: half of what is lost, either way
    assert main([*said, str(tmp_path / "checked"), "--check"]) == 1


def test_what_reading_leaves_out_is_compiled_within_limits_before_an_export(tmp_path, capsys):
    """A picture of 4.8 GB, which no link's inertia needs."""
    path = tmp_path / "m.xml"
    size = 'width="40000" height="40000"'
    sky = f'<asset><texture name="t" type="2d" builtin="flat" {size}/></asset>'
    text = DRIVEN.format("", "").replace("<worldbody>", f"{sky}<worldbody>")
    path.write_text(text)
    assert read(path).joints
    said = ["export", "simulator", str(path), "--joint", "j", *GEAR, "--for", "mujoco"]
    assert main([*said, "--out", str(tmp_path / "out")]) == 2
    assert "Could not allocate memory for texture" in capsys.readouterr().err


def test_an_equality_that_shuts_the_play_is_left_out_and_a_check_that_fails_exits_1(
    tmp_path, capsys, monkeypatch
):
    hinge = '<joint name="j_b" axis="0 1 0" range="-2 2"/>'
    equality = '<equality><joint joint1="j_b"/></equality>'
    path = tmp_path / "m.xml"
    path.write_text(DRIVEN.format(hinge, equality))
    said = ["export", "simulator", str(path), "--all", "--for", "mujoco", "--check"]
    assert main([*said, "--out", str(tmp_path / "out")]) == 0
    told = capsys.readouterr().out
    assert "holds j_b and so shuts the play of j in MuJoCo" in told
    assert "the equality of j_b, which would hold the play shut, is left out" in told
    assert "<equality" not in (tmp_path / "out" / "robot.xml").read_text()
    monkeypatch.setattr("jointplay.bridges.edited_mjcf._equalities", lambda *_: iter(()))
    assert main([*said, "--out", str(tmp_path / "shut")]) == 1
    assert "beyond" in capsys.readouterr().out
