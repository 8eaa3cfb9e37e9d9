"""Reduced models of play: their fit, and their files."""

import json
import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from conftest import ARM_WITH_HAND

from jointplay import Gear, JointplayError, Mechanism, Motion, RevoluteClearance, Simulation
from jointplay.bridges.reduced_files import to_json, to_urdf, to_yaml
from jointplay.bridges.reduced_mjcf import compile_robot, follow
from jointplay.bridges.reduced_robot import ReducedRobot
from jointplay.bridges.reduction import reduce
from jointplay.cli import main
from jointplay.model.mjcf import load_mujoco
from jointplay.model.mjcf_whole import compile_text
from jointplay.simulation.loads.drive import Prescribed, Servo

GEAR = Gear(play=4e-3, rotor_inertia=0.05, stiffness=2e3, damping=2.0)
GRAVITY = 9.81


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """An arm about a vertical axis: its weight tilts the journal, and turns nothing."""
    found = tmp_path_factory.mktemp("reduce") / "arm.urdf"
    found.write_text(ARM_WITH_HAND)
    return found


def bearing(**changes):
    return RevoluteClearance(**{"radial_clearance": 1e-4, "axial_clearance": 1e-4} | changes)


def to_mjcf(mechanism, found, tilt=False, **options):
    return compile_robot(mechanism, [found], found.pose, tilt).mjcf([found], **options)


@pytest.fixture(scope="module")
def geared(path):
    """The arm with play in bearing and gear, and its reduced model."""
    mechanism = Mechanism(path, {"j": bearing()}, gears={"j": GEAR})
    return mechanism, reduce(mechanism, "j", {"k": 0.3}, period=1.6)


@pytest.fixture(scope="module")
def plain(path):
    """The arm with play in its bearing only."""
    mechanism = Mechanism(path, {"j": bearing()})
    return mechanism, reduce(mechanism, "j", period=0.8)


def test_the_dead_band_is_the_gears_and_none_is_the_bearings(geared, plain):
    assert geared[1].dead_band == GEAR.play
    assert plain[1].dead_band == 0.0
    assert plain[1].angle_error == 0.0


def test_friction_is_that_of_the_rims_that_bear_the_moment(plain):
    mechanism, found = plain
    one = mechanism.clearance["j"]
    moment = GRAVITY * (2.0 * 0.3 + 0.5 * 0.5)
    # Both rims bear moment / length, and the weight rests on a rim at the end wall.
    wanted = 0.1 * one.rj * (2.0 * moment / one.lj + 2.5 * GRAVITY)
    assert found.friction == pytest.approx(wanted, rel=0.2)
    assert found.friction_range[0] < wanted * 1.1
    assert found.friction_error < 0.3 * wanted


def test_the_tilt_is_that_of_the_bearing(plain):
    mechanism, found = plain
    one = mechanism.clearance["j"]
    assert found.tilt == pytest.approx(2.0 * one.cr / one.lj)
    assert found.load[2] == pytest.approx(-2.5 * GRAVITY)
    # Hertz: force = k depth^1.5, so the chord at the load is k^(2/3) force^(1/3).
    push = np.hypot(*found.load[3:5]) / one.lj
    assert found.contact_stiffness == pytest.approx(
        one.hertz_stiffness ** (2 / 3) * push ** (1 / 3), rel=0.02
    )


def test_the_tilts_error_is_what_friction_and_contacts_do_to_it(plain):
    mechanism, found = plain
    one = mechanism.clearance["j"]
    tilt = found.history["tilt"]
    # The arm reverses about x: its weight tilts the journal outwards, friction drags it aside.
    size = np.linalg.norm(tilt, axis=1)
    assert size == pytest.approx(np.full(len(size), found.tilt), rel=0.05)
    dragged = found.tilt * 0.1  # its coefficient of friction
    assert 0.5 * dragged < found.tilt_rms < 1.5 * dragged
    assert found.tilt_rms < found.tilt_error < 0.6 * found.tilt
    assert "tilt, stated error" in str(found)
    assert json.loads(to_json([found], "motor", 0.3))
    flat = Mechanism(
        mechanism.description.path, {"j": RevoluteClearance.planar(radial_clearance=one.cr)}
    )
    none = reduce(flat, "j", period=0.4)
    assert (none.tilt, none.tilt_error, none.tilt_rms) == (0.0, 0.0, 0.0)
    assert "tilt" not in none.history


@pytest.mark.parametrize(
    ("limits", "middle", "stroke"), [((-0.05, 2.0), 0.05, 0.1), ((-0.02, 0.04), 0.01, 0.03)]
)
def test_a_joint_reverses_within_its_limits(path, tmp_path, limits, middle, stroke):
    text = path.read_text()
    assert text.count('lower="-9" upper="9"') >= 1
    place = tmp_path / "limited.urdf"
    place.write_text(text.replace('lower="-9" upper="9"', 'lower="{}" upper="{}"'.format(*limits)))
    found = reduce(Mechanism(place, gears={"j": GEAR}), "j", period=0.4)
    assert found.pose["j"] == pytest.approx(middle)
    motor = found.history["motor"]
    assert motor.max() == pytest.approx(middle + stroke, abs=1e-6)
    assert motor.min() == pytest.approx(middle - stroke, abs=1e-6)


def test_a_journal_that_no_load_tilts_says_so(tmp_path, path, capsys):
    # Its axis is level: the weight, a little aside, presses both rims down.
    text = path.read_text().replace('xyz="0 0 1"', 'xyz="0 1 0"')
    text = text.replace('xyz="0.3 0 0"', 'xyz="0.3 0.003 0"')
    level = tmp_path / "level.urdf"
    level.write_text(text)
    order = [
        "export",
        "simulator",
        str(level),
        "--joint",
        "j",
        "--clearance",
        "0.1 mm",
        "--period",
        "0.4",
    ]
    order.append("--tilt")
    assert main([*order, "--quiet", "--out", str(tmp_path / "out")]) == 0
    assert "leave --tilt out" in capsys.readouterr().out


@pytest.mark.needs("mujoco")
def test_mujocos_axis_tilts_as_the_full_model_within_the_stated_error(plain, geared):
    for mechanism, found in (plain, geared):
        seen = follow(compile_text(to_mjcf(mechanism, found, tilt=True)), found)
        assert 0.0 < seen.tilt_error <= found.tilt_error
        assert seen.error <= found.angle_error + 1e-9
        assert follow(compile_text(to_mjcf(mechanism, found)), found).tilt_error is None


@pytest.mark.needs("mujoco")
def test_mujoco_follows_the_link_through_reversals_within_the_stated_error(geared):
    mechanism, found = geared
    seen = follow(compile_text(to_mjcf(mechanism, found)), found)
    # The link changes flanks: the error is small against the play that it crosses.
    lag = found.history["motor"] - found.history["full"]
    assert lag.max() - lag.min() > GEAR.play
    assert seen.error <= found.angle_error
    assert seen.rms < 0.25 * GEAR.play


@pytest.mark.needs("mujoco")
def test_mjcf_has_no_further_freedom_without_play_about_the_axis(plain, geared):
    import mujoco

    cases = (plain, False, 2), (geared, False, 3), (plain, True, 4), (geared, True, 5)
    for (mechanism, found), tilt, freedoms in cases:
        model = mujoco.MjModel.from_xml_string(to_mjcf(mechanism, found, tilt=tilt))
        assert model.nv == freedoms
        if not found.dead_band:
            assert model.dof_frictionloss[0] == pytest.approx(found.friction)


def test_the_urdf_has_the_play_as_a_joint_behind_the_motors_link(geared, tmp_path):
    mechanism, found = geared
    file = tmp_path / "r.urdf"
    file.write_text(to_urdf(mechanism, found))
    model = pin.buildModelFromUrdf(str(file))
    assert [*model.names][1:] == ["j", "j_play", "k"]
    at = model.joints[model.getJointId("j_play")].idx_q
    assert model.upperPositionLimit[at] - model.lowerPositionLimit[at] == pytest.approx(GEAR.play)
    # A body moved by motor and play alike stands where the joint alone would put it.
    ideal = mechanism.ideal()
    data, own = model.createData(), ideal.data
    pin.framesForwardKinematics(model, data, np.array([0.5, 1e-3, 0.2]))
    pin.framesForwardKinematics(ideal.model, own, np.array([0.501, 0.2]))
    hand = data.oMf[model.getFrameId("hand")].homogeneous
    assert hand == pytest.approx(own.oMf[ideal.model.getFrameId("hand")].homogeneous)
    # No inertia is lost or doubled: the links' is the arm's, the rotor's comes on top.
    mass = pin.crba(model, data, np.zeros(3)).reshape(3, 3)
    still = pin.crba(ideal.model, own, np.zeros(2)).reshape(2, 2)
    assert mass[1, 1] == pytest.approx(still[0, 0])
    assert mass[0, 0] == pytest.approx(still[0, 0] + GEAR.rotor_inertia)


def test_without_play_about_the_axis_the_urdf_gets_friction_only(plain, tmp_path):
    mechanism, found = plain
    root = ElementTree.fromstring(to_urdf(mechanism, found))
    assert len(root.findall("joint")) == 2
    dynamics = root.find("joint[@name='j']/dynamics")
    assert float(dynamics.get("friction")) == found.friction


def test_json_and_yaml_say_the_same_and_ranges_hold_the_values(geared):
    yaml = pytest.importorskip("yaml")
    _, found = geared
    small = replace(found, lateral=5e-5)  # 5e-05 is text to readers of YAML 1.1
    (data,) = json.loads(to_json([small], spread=0.5))["joints"]
    for name, (low, high) in data["ranges"].items():
        assert low <= data[name] <= high
    assert "assumed" in data["ranges_note"]
    assert data["encoder"] == "motor"
    assert '"encoder": "link"' in to_json([found], "link")
    with pytest.raises(JointplayError, match="no place for the encoder 'gear'"):
        to_json([found], "gear")
    flat = yaml.safe_load(to_yaml([small]))["j"]
    assert flat == {key: data[key] for key in flat}
    assert set(data) - set(flat) == {"ranges", "ranges_note"}


def test_what_a_rule_has_in_place_of_a_gears_number_ranges_as_gears_do(geared):
    mechanism, found = geared
    assumed = mechanism.with_clearance({}, {"j": Gear(0.02)})
    assert ("j", "stiffness") in assumed.rules
    robot = ReducedRobot(assumed, [found], {}, ["json"])
    (data,) = json.loads(robot.files("r")["r.json"])["joints"]
    for name, (low, high) in {"stiffness": (0.25, 4.0), "rotor_inertia": (0.2, 4.5)}.items():
        assert data["ranges"][name] == pytest.approx([low * data[name], high * data[name]])
    assert data["ranges"]["dead_band"][0] == pytest.approx(0.7 * data["dead_band"])
    assert "stiffness: 0.25 to 4 times what a rule has" in data["ranges_note"]
    (given,) = json.loads(to_json([found]))["joints"]
    assert "rotor_inertia" not in given["ranges"]
    assert given["ranges"]["stiffness"][1] == pytest.approx(1.3 * data["stiffness"])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"joint": "x"}, "no joint with play 'x'; available: j"),
        ({"joint": "j", "amplitude": 0.0}, "amplitude must be greater than zero"),
        ({"joint": "j", "pose": {"z": 1.0}}, "no moving joint 'z'; available: j, k"),
    ],
)
def test_reductions_refuse_what_cannot_be(path, options, message):
    mechanism = Mechanism(path, {"j": bearing()})
    with pytest.raises(JointplayError, match=message):
        reduce(mechanism, **options)


@pytest.mark.needs("mujoco", "pxr", "newton_usd_schemas", "urdf2webots")
def test_the_command_writes_all_formats(path, tmp_path, capsys):
    out = tmp_path / "out"
    options = ["--joint", "j", "--clearance", "0.1 mm", "--gear", "j=0.2 deg"]
    options += ["--gear-stiffness", "2000", "--rotor-inertia", "0.05", "--gear-damping", "2"]
    options += ["--period", "0.8", "--check", "--quiet", "--out", str(out)]
    assert main(["export", "simulator", str(path), *options]) == 0
    text = capsys.readouterr().out
    assert "stated error" in text
    assert "MuJoCo: j: link's angle off by up to" in text
    assert "within the stated" in text
    assert "j turns freely by 3.49" in text
    formats = {one.suffix for one in out.iterdir()}
    assert formats == {".xml", ".sdf", ".urdf", ".yaml", ".json", ".png", ".usda", ".py", ".proto"}
    assert "j by its actuator: link's angle off by up to" in text


def test_the_command_takes_what_a_gear_needs_from_rules_and_the_encoder_from_its_drive(
    path, tmp_path, capsys
):
    options = ["--joint", "j", "--gear", "j=0.2 deg", "--out", str(tmp_path / "o")]
    order = ["export", "simulator", str(path), *options, "--format", "json", "--detail"]
    assert main(order) == 0
    shown = capsys.readouterr().out
    assert "gears: stiffness of j" in shown
    assert "gears: rotor inertia of j" in shown
    (entry,) = json.loads((tmp_path / "o" / "j.json").read_text())["joints"]
    assert entry["encoder"] == "motor"
    drive = ["--set", "drive.kind=computed-torque", "--set", "drive.encoder=link"]
    assert main([*order[:-4], str(tmp_path / "q"), *order[-3:], *drive]) == 0
    (entry,) = json.loads((tmp_path / "q" / "j.json").read_text())["joints"]
    assert entry["encoder"] == "link"
    capsys.readouterr()
    assert (
        main(["export", "simulator", str(path), "--joint", "j", "--out", str(tmp_path / "p")]) == 2
    )
    assert "add --tilt" in capsys.readouterr().err  # its clearance is assumed


SERVO = {"voltage": 9.0, "p_gain": 40.0, "torque_constant": 1.2, "resistance": 2.7}


def servo_runs(path, servo, gear, goal, end):
    """Angles of the link after the same steps, in MuJoCo by the file's servo and here [rad]."""
    import mujoco

    times = np.linspace(0.0, end, 41)
    goals = goal(times)
    motion = Motion(["j", "k"], times, np.column_stack([goals, np.zeros(41)]), "rest-to-rest")
    mechanism = Mechanism(path, {}, gears={"j": gear})
    drive = {"j": servo, "k": Prescribed()}
    run = Simulation(mechanism, motion, drive=drive, step=2e-5, record_every=50)
    result = run.run(progress=False).completed()
    model = replace(reduce(mechanism, "j", period=0.4), stiffness=gear.stiffness)
    text = to_mjcf(mechanism, model, servos={"j": servo})
    loaded = mujoco.MjModel.from_xml_string(text)
    loaded.opt.timestep = 2e-5
    data = mujoco.MjData(loaded)
    part = servo.d_gain / (servo.d_gain + servo.torque_constant)
    position, speed = motion(np.arange(0.0, end, 2e-5))[:2]
    angles = []
    loaded.dof_armature[loaded.joint("k").dofadr] = 1e6
    motor = result["q"].values[0, mechanism.motor("j")]
    link = [int(loaded.joint(name).qposadr[0]) for name in ("j", "j_play")]
    data.qpos[link] = motor, result["q"].values[0, mechanism.coordinate("j")] - motor
    at = loaded.actuator("j").id
    first = int(loaded.actuator_ctrladr[at])
    for here, rate in zip(position[:, 0], speed[:, 0], strict=True):
        data.ctrl[first] = here
        if servo.d_gain > 0.0:
            data.ctrl[first + 1] = part * rate
        mujoco.mj_step(loaded, data)
        angles.append((data.time, data.qpos[link].sum()))
    at, angle = np.array(angles).T
    return np.interp(result.time, at, angle), result["q"].values[:, mechanism.coordinate("j")]


@pytest.mark.needs("mujoco")
@pytest.mark.parametrize(
    ("changes", "goal"),
    [
        pytest.param(
            {"friction": 0.05, "viscous": 0.02},
            lambda t: 0.5 * np.sin(6.0 * t) ** 3,
            marks=pytest.mark.thorough,
        ),
        pytest.param(
            {"d_gain": 0.8, "friction": 0.05},
            lambda t: 0.5 * np.sin(6.0 * t) ** 3,
            marks=pytest.mark.thorough,
        ),
        ({"voltage": 2.0}, lambda t: 0.9 * np.sin(8.0 * t)),
    ],
)
def test_mujocos_motor_turns_the_link_as_the_servo_does_also_short_of_voltage(path, changes, goal):
    gear = Gear(play=4e-3, rotor_inertia=0.03, stiffness=300.0, damping=0.5)
    there, here = servo_runs(path, Servo(**SERVO | changes), gear, goal, 1.0)
    assert (np.ptp(here) < 0.8 * np.ptp(goal(np.linspace(0.0, 1.0, 99)))) == ("voltage" in changes)
    assert np.ptp(here) > 0.2
    assert np.abs(there - here).max() < 2e-3 * np.ptp(here)


@pytest.mark.needs("mujoco")
def test_the_file_says_what_of_a_servo_it_leaves_out(geared):
    mechanism, found = geared
    servo = Servo(**SERVO, resolution=1.5e-3, dead_band_counts=2.0, period=1e-3)
    text = to_mjcf(mechanism, found, servos={"j": servo})
    assert (
        "not represented: dead band 0.003 rad, counts of 0.0015 rad, sampling every 0.001" in text
    )
    for wrong, message in (
        ({"j": Servo(**SERVO, encoder="link")}, "encoder on the link"),
        ({"jj": servo}, "moving joint"),
    ):
        with pytest.raises(JointplayError, match=message):
            to_mjcf(mechanism, found, servos=wrong)


@pytest.mark.needs("mujoco")
def test_what_mujoco_warns_of_leaves_no_file_behind(tmp_path, monkeypatch, caplog):
    mujoco = load_mujoco()
    monkeypatch.chdir(tmp_path)
    model = mujoco.MjModel.from_xml_string(
        '<mujoco><worldbody><body><freejoint/><geom size="1" mass="1"/></body></worldbody></mujoco>'
    )
    data = mujoco.MjData(model)
    data.qvel[:] = 1e300
    mujoco.mj_step(model, data)
    assert "MuJoCo: " in caplog.text
    assert not list(tmp_path.iterdir())
