"""Play as an actuator model, and the formats that simulators for learning take."""

import subprocess
import sys

import numpy as np
import pytest
from conftest import ARM_WITH_HAND

from jointplay import Gear, Mechanism
from jointplay.base.errors import JointplayError
from jointplay.bridges.dead_band import DeadBand, for_mujoco
from jointplay.bridges.reduced_files import actuator, actuator_step, to_python
from jointplay.bridges.reduced_formats import FORMATS, SIMULATORS, choose
from jointplay.bridges.reduced_mjcf import follow
from jointplay.bridges.reduced_robot import ReducedRobot
from jointplay.bridges.reduction import Reduction, reduce
from jointplay.cli import main
from jointplay.model.mjcf_whole import compile_text

GEAR = Gear(play=4e-3, rotor_inertia=0.05, stiffness=2e3, damping=2.0)
PLAY = DeadBand(*np.array([[2e-3, 1e-3], [2e3, 500.0], [2.0, 0.0], [0.05, 0.01], [0, 0], [0, 0]]))


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """An arm about a vertical axis, with a hand."""
    found = tmp_path_factory.mktemp("dead_band") / "arm.urdf"
    found.write_text(ARM_WITH_HAND)
    return found


@pytest.fixture(scope="module")
def robot(path):
    """The arm, and the reduced model of its gear's play."""
    mechanism = Mechanism(path, {}, gears={"j": GEAR})
    return ReducedRobot(mechanism, [reduce(mechanism, "j", period=0.8)], {}, ["mjcf", "py"])


def test_the_torque_is_none_in_the_dead_band_and_the_teeths_beyond():
    zero = np.zeros(2)
    assert PLAY.torque(np.array([1.9e-3, -0.9e-3]), zero, zero, zero) == pytest.approx(zero)
    beyond = PLAY.torque(np.array([3e-3, -3e-3]), zero, zero, zero)
    assert beyond == pytest.approx([2e3 * 1e-3, -500.0 * 2e-3])
    assert PLAY.torque(zero, np.array([0.5, 0.5]), zero, zero) == pytest.approx([1.0, 0.0])
    copies = PLAY.torque(np.full((3, 2), 3e-3), zero, zero, zero)
    assert copies.shape == (3, 2)


def test_a_motor_at_rest_in_its_play_is_pushed_by_its_torque_alone():
    """The momentum that the motor loses is what the link gains."""
    zero, drive = np.zeros(2), np.array([0.1, 0.2])
    torque, motor, speed = PLAY.step(drive, zero, zero, zero, zero, 1e-3)
    assert PLAY.rotor * speed == pytest.approx(1e-3 * (drive - torque))
    assert motor == pytest.approx(1e-3 * speed)
    torque, _, speed = PLAY.step(drive, zero + 5e-3, zero + 1.0, zero, zero, 1e-3)
    assert PLAY.rotor * (speed - 1.0) == pytest.approx(1e-3 * (drive - torque))


def test_a_light_motor_stays_calm_in_long_steps():
    light = PLAY._replace(rotor=np.array([1e-6, 1e-6]))
    zero = np.zeros(2)
    motor, speed = zero, zero
    for _ in range(2000):
        _, motor, speed = light.step(np.array([1.0, -1.0]), motor, speed, zero, zero, 1e-3)
    assert motor == pytest.approx([2e-3 + 1 / 2e3, -1e-3 - 1 / 500.0], rel=1e-3)


@pytest.mark.needs("mujoco")
def test_mujocos_link_follows_the_full_model_by_the_actuator(robot):
    (one,) = robot.reductions
    _, play = actuator([one])
    seen = follow(compile_text(robot.without_play(), robot.meshes), one, play)
    assert seen.error < one.angle_error
    stiff = play._replace(half=np.zeros(1))
    assert (
        follow(compile_text(robot.without_play(), robot.meshes), one, stiff).error > 1e-3
    )  # half the play


@pytest.mark.needs("mujoco")
def test_driven_by_a_torque_it_moves_as_the_play_in_the_mjcf(robot):
    import mujoco

    joints, play = actuator(robot.reductions)
    with_play = mujoco.MjModel.from_xml_string(robot.files("r")["r.xml"])
    without = mujoco.MjModel.from_xml_string(robot.without_play())
    step = with_play.opt.timestep = 1e-4
    rows = for_mujoco(without, play, joints, step)
    one, other = mujoco.MjData(with_play), mujoco.MjData(without)
    motor = speed = np.zeros(1)
    apart, turned = [], []
    while one.time < 1.0:
        drive = 0.5 * np.sin(2.0 * np.pi * one.time)
        one.ctrl[0] = drive
        link, link_speed = other.qpos[rows.angles], other.qvel[rows.speeds]
        torque, motor, speed = play.step(drive, motor, speed, link, link_speed, step)
        other.qfrc_applied[rows.speeds] = torque
        for model, data in ((with_play, one), (without, other)):
            mujoco.mj_step(model, data)
        apart.append([one.qpos[0] - motor[0], one.qpos[:2].sum() - other.qpos[0]])
        turned.append(one.qpos[0])
    assert np.ptp(turned) > 0.05
    assert np.abs(apart).max() < 2e-4


@pytest.mark.needs("mujoco")
def test_for_mujoco_takes_the_joints_own_actuators_out(robot):
    import mujoco

    model = mujoco.MjModel.from_xml_string(robot.without_play())
    joints, play = actuator(robot.reductions)
    rows = for_mujoco(model, play._replace(friction=np.array([0.3])), joints)
    data = mujoco.MjData(model)
    data.ctrl[:] = 1.0
    mujoco.mj_forward(model, data)
    assert data.qfrc_actuator[rows.speeds] == 0.0
    assert data.qfrc_actuator[1] == 1.0
    assert model.dof_frictionloss[rows.speeds] == 0.3


@pytest.mark.needs("mujoco")
def test_the_file_runs_without_jointplay(robot, tmp_path):
    files = robot.files("j")
    (tmp_path / "j_dead_band.py").write_text(files["j_dead_band.py"])
    (tmp_path / "robot.xml").write_text(robot.without_play())
    assert "jointplay" not in files["j_dead_band.py"].split('"""', 2)[2]
    line = [sys.executable, "-I", tmp_path / "j_dead_band.py", tmp_path / "robot.xml"]
    done = subprocess.run(line, capture_output=True, text=True)
    assert not done.stderr
    far = float(done.stdout.split("up to ")[1].split()[0])
    assert 2.0 < far < 4.0
    assert "2 free" in done.stdout


def test_the_file_has_joints_with_a_dead_band_only(robot):
    numbers = {"stiffness": 1e3, "rotor_inertia": 0.1, "damping": 1.0}
    ones = [Reduction("j", dead_band=1e-3, **numbers), Reduction("k", friction=0.1)]
    space = {"__name__": "made"}
    exec(to_python(robot.mechanism, ones, {}), space)
    assert space["JOINTS"] == ("j",)
    assert space["PLAY"].half == pytest.approx([5e-4])
    assert space["STEP"] == pytest.approx(actuator_step(robot.mechanism, ones, {}), rel=1e-3)


def test_the_step_resolves_what_the_teeth_swing_and_what_damping_stops(robot):
    stiff = Reduction("j", dead_band=1e-3, stiffness=1e7, rotor_inertia=0.1)
    slow = Reduction("j", dead_band=1e-3, stiffness=1.0, rotor_inertia=0.1, damping=1e4)
    for one in (stiff, slow):
        assert actuator_step(robot.mechanism, [one], {}) < 1e-4
    assert actuator_step(robot.mechanism, [], {}) == 1e-3


def test_each_simulator_gets_formats_that_are_there_and_is_told_what_it_loses():
    for name, one in SIMULATORS.items():
        assert set(one.formats) <= set(FORMATS)
        assert [line.split()[1] for line in one.notes(name)] == ["takes", "has", "lacks"]


def test_a_simulator_and_formats_exclude_each_other():
    with pytest.raises(JointplayError, match=r"--for isaac chooses the formats \(usd, py\)"):
        choose(["sdf"], False, "isaac")
    with pytest.raises(JointplayError, match="--for genesis with --tilt: the tilt of an axis"):
        choose([], True, "genesis")


OPTIONS = [
    *("--joint", "j", "--gear", "j=0.2 deg", "--gear-stiffness", "2000", "--rotor-inertia"),
    *("0.05", "--gear-damping", "2", "--period", "0.8", "--quiet"),
]


def test_the_command_writes_for_genesis_what_it_takes(path, tmp_path, capsys):
    out = tmp_path / "out"
    assert (
        main(["export", "simulator", str(path), *OPTIONS, "--for", "genesis", "--out", str(out)])
        == 0
    )
    assert {one.name for one in out.iterdir()} == {
        *("j.urdf", "j.yaml", "j_dead_band.py", "reversals.png")
    }  # fmt: skip
    text = capsys.readouterr().out
    assert "genesis: lacks the teeth's stiffness" in text
    assert "genesis: *_dead_band.py has motor" in text


@pytest.mark.thorough
@pytest.mark.needs("pxr", "newton_usd_schemas")
def test_isaacs_usd_has_friction_by_physxs_schema(path, tmp_path):
    out = tmp_path / "out"
    assert (
        main(["export", "simulator", str(path), *OPTIONS, "--for", "isaac", "--out", str(out)]) == 0
    )
    text = (out / "j.usda").read_text()
    assert '"PhysxJointAxisAPI:angular"' in text
    assert "float physxJointAxis:angular:dynamicFrictionEffort" in text


def test_the_command_names_the_simulators_it_knows(path, tmp_path, capsys):
    with pytest.raises(SystemExit):
        main(["export", "simulator", str(path), *OPTIONS, "--for", "unity", "--out", str(tmp_path)])
    told = capsys.readouterr().err
    assert '"unity"' in told
    assert "mujoco, newton, genesis, gazebo, webots, isaac" in told
