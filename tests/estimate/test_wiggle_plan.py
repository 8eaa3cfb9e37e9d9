"""The plan of a wiggle, the script that plays it on a LeRobot arm, and logs in three formats."""

import json
import math
import re
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pinocchio as pin
import pytest
from conftest import body, joint, tip

from jointplay import JointplayError, Mechanism, Motion, Recording
from jointplay.accuracy.poses import moving
from jointplay.bridges import lerobot_bus, trajectory
from jointplay.cli import main
from jointplay.estimate import wiggle_logs
from jointplay.estimate.unknowns import Estimate, Unknown
from jointplay.estimate.wiggle_logs import ServoSignals, identify_wiggled
from jointplay.estimate.wiggle_plan import FLOOR, SWING, plan_wiggle
from jointplay.model.gear import Gear
from jointplay.scenario.presets import preset
from jointplay.simulation.loads.drive import Servo
from jointplay.simulation.motion.cartesian import joint_limits

SERVO = Servo.of("STS3215", voltage=7.4, p_gain=38.6, resolution=math.tau / 4096, encoder="link")
MOTORS = {"a": (1, "sts3215", 1, 0.0), "b": (2, "sts3215", -1, 10.0)}
JOINTS = {"a": False, "b": False}


@pytest.fixture(scope="module")
def so101():
    robot = preset("so101").mechanism()
    return robot, dict.fromkeys(robot.gears, SERVO)


@pytest.fixture(scope="module")
def plan(so101):
    return plan_wiggle(*so101)


def test_each_joint_is_wiggled_alone_where_gravity_is_neutral(so101, plan):
    ideal = so101[0].ideal()
    assert [one.joint for one in plan.steps] == list(so101[0].gears)[:4]
    assert "link's inertia by the rotor's is outside" in plan.refused["wrist_roll"]
    for one in plan.steps:
        at, k = ideal.coordinate(one.joint), plan.joints.index(one.joint)
        q = ideal.configuration(dict(one.pose))
        assert abs(pin.computeGeneralizedGravity(ideal.model, ideal.data, q)[at]) < 5e-3
        inside = (plan.time >= one.begin) & (plan.time <= one.end)
        still = np.ptp(plan.position[inside], axis=0)
        assert np.radians(2.0) < still[k] <= np.radians(6.01)
        assert np.delete(still, k).max() == 0.0
        assert np.mean(plan.position[inside, k]) == pytest.approx(one.pose[one.joint], abs=0.02)


def test_the_motion_is_slow_within_limits_and_above_the_table(so101, plan):
    low, high = joint_limits(so101[0], plan.joints)
    assert (plan.position >= low).all()
    assert (plan.position <= high).all()
    for one in plan.steps:
        k = plan.joints.index(one.joint)
        assert low[k] + SWING - 1e-9 <= one.pose[one.joint] <= high[k] - SWING + 1e-9
    ideal, between = so101[0].ideal(), np.ones(len(plan.time) - 1, bool)
    for one in plan.steps:
        between &= (plan.time[1:] < one.begin) | (plan.time[:-1] > one.end)
    speed = np.abs(np.diff(plan.position, axis=0)).max(axis=1) / np.diff(plan.time)
    assert speed[between].max() < np.radians(16.0)
    for row in plan.position[::50]:
        q = ideal.configuration(dict(zip(plan.joints, row, strict=True)))
        pin.framesForwardKinematics(ideal.model, ideal.data, q)
        assert ideal.data.oMf[ideal.tool_frame].translation[2] > FLOOR - 1e-3


def geared(path):
    gear = Gear(play=5e-3, rotor_inertia=0.03, stiffness=100.0)
    return Mechanism(path, gears={"j": gear}, tool="tool")


def test_a_joint_that_gravity_always_loads_is_refused_with_its_load(urdf):
    robot = geared(
        urdf(
            body("arm", mass=5.0, com="0.1 0 0"),
            joint("j", "base", "arm", axis="0 1 0").replace("9", "0.8"),
            tip("arm"),
        )
    )
    with pytest.raises(JointplayError, match=r"j: gravity's 3\.\d N m leans on one side"):
        plan_wiggle(robot, {"j": SERVO})


def test_with_encoders_on_the_motors_light_links_are_refused_before_anybody_records(so101, urdf):
    robot, servos = so101
    motors = {name: replace(one, encoder="motor") for name, one in servos.items()}
    with pytest.raises(JointplayError, match=r"shoulder_pan: .* is below 1\.2 times the rotor's"):
        plan_wiggle(robot, motors)
    arm = body("arm", mass=5.0, com="0.1 0 0")
    heavy = geared(urdf(arm, joint("j", "base", "arm", axis="0 0 1"), tip("arm")))
    assert [one.joint for one in plan_wiggle(heavy, {"j": motors["shoulder_pan"]}).steps] == ["j"]


def test_ways_go_around_the_robot_itself(urdf):
    """A joint whose straight way to its only free pose would hit a post takes another."""
    from jointplay.estimate import wiggle_plan

    robot = preset("so101").mechanism()
    scene = wiggle_plan._Scene(robot)
    names = moving(robot)
    scene.blocked = lambda pose: 0.4 < pose["shoulder_pan"] < 0.6
    begin = dict.fromkeys(names, 0.0)
    assert scene.reaches(begin, {**begin, "shoulder_pan": 0.3})
    assert not scene.reaches(begin, {**begin, "shoulder_pan": 0.9})


# The script, on a bus that is no bus.


class Bus:
    """Servos that follow at once, with a clock that they advance."""

    def __init__(self, joints=MOTORS, low=0, high=4095):
        self.goal, self.now, self.reads, self.done = dict.fromkeys(joints, 2048), 0.0, 0, []
        self.held = SimpleNamespace(range_min=low, range_max=high)
        self.fails, self.runs_away, self.interrupt = (), None, None

    def read_calibration(self):
        return dict.fromkeys(self.goal, self.held)

    def read(self, name, motor, normalize):
        assert not normalize
        self.done.append(f"read {name}")
        return {"P_Coefficient": 16, "Present_Voltage": 121}.get(name, 0)

    def sync_write(self, name, values, normalize):
        assert (name, normalize) == ("Goal_Position", False)
        assert all(isinstance(value, int) for value in values.values())
        self.done.append("move")
        self.goal |= values

    def sync_read(self, name, normalize):
        assert (name, normalize) == ("Present_Position", False)
        self.reads, self.now = self.reads + 1, self.now + 2e-3
        if self.reads in self.fails:
            raise ConnectionError("no status packet")
        if self.interrupt == self.reads:
            raise KeyboardInterrupt
        seen = dict(self.goal)
        if self.runs_away is not None and self.reads > self.runs_away:
            seen["b"] += 5 * (self.reads - self.runs_away)
        return seen

    def enable_torque(self):
        self.done.append("on")

    def disable_torque(self, num_retry):
        self.done.append("off")

    def disconnect(self, disable_torque):
        assert not disable_torque
        self.done.append("gone")


@pytest.fixture
def played(tmp_path, monkeypatch):
    """What plays half a degree of `b` on a bus: status, lines of the log."""
    time = np.arange(0.0, 6.0, 0.01)
    table = np.column_stack([time, 0.0 * time, 0.05 + np.radians(3) * np.sin(2 * time)])
    motion, log = tmp_path / "m.csv", tmp_path / "log.csv"
    np.savetxt(motion, table, "%.6f", ",", header="time_s,a,b", comments="")
    order = ["x", "port", "--motion", str(motion), "--log", str(log), "--yes"]
    monkeypatch.setattr(sys, "argv", order)

    def play(bus):
        clock = SimpleNamespace(
            perf_counter=lambda: bus.now, sleep=lambda t: setattr(bus, "now", bus.now + t)
        )
        monkeypatch.setattr(lerobot_bus, "time", clock)
        monkeypatch.setattr(lerobot_bus.signal, "signal", lambda *_: None)
        monkeypatch.setattr(lerobot_bus, "connect", lambda *_: bus)
        status = lerobot_bus.main("feetech", MOTORS, [("b", 1.0, 5.0)])
        return status, log.read_text().splitlines() if log.exists() else []

    return play, motion, log


def test_the_script_plays_the_motion_and_logs_it(played, capsys):
    play, motion, log = played
    bus = Bus()
    status, lines = play(bus)
    assert status == 0
    assert lines[0].startswith("# a: P_Coefficient 16, I_Coefficient 0")
    assert lines[2] == "time [s],a goal [deg],a position [deg],b goal [deg],b position [deg]"
    assert len(lines) > 1000
    first_move = bus.done.index("move")
    assert all(f"read {name}" in bus.done[:first_move] for name in lerobot_bus.REGISTERS["feetech"])
    assert bus.done[first_move : first_move + 2] == ["move", "on"]
    assert bus.done[-2:] == ["off", "gone"]
    assert bus.goal == {"a": 2048, "b": 2048}  # back where it was
    table = np.loadtxt(log, delimiter=",", skiprows=3)
    wanted = Motion.from_csv(motion)
    want = np.degrees(np.interp(table[:, 0], wanted.times, wanted.positions[:, 1]))
    assert np.abs(table[:, 3] - want).max() < 0.3  # a count, and the time of an answer
    assert "records, 200 a second" in capsys.readouterr().out


def test_a_log_of_the_script_is_read_with_its_gains(played):
    play, _, log = played
    play(Bus())
    read = ServoSignals.read(log, JOINTS)
    assert read.gains == {"a": (16.0, pytest.approx(12.1)), "b": (16.0, pytest.approx(12.1))}
    ((name, (part, pose)),) = read.logs().items()
    assert name == "b"
    assert part.others.max() == 0.0
    assert np.ptp(part.goal) == pytest.approx(np.radians(6.0), rel=0.05)
    assert pose["b"] == pytest.approx(0.05, abs=0.03)


@pytest.mark.parametrize("gain", [16, 32])
def test_gains_of_firmware_are_volts_per_rad(gain):
    servo = SERVO.with_gain(gain, 7.4)
    assert servo.p_gain == pytest.approx(38.6 * gain / 32, rel=0.03)
    arm = preset("koch").named["joint_1"]["drive"]
    named = {key: arm[key] for key in ("catalogue", "resolution")}
    assert Servo(**named | {"resolution": 1e-3}, voltage=12.0, p_gain=1.0).with_gain(
        640, 12.0
    ).p_gain == pytest.approx(arm["p_gain"], rel=0.01)


def test_the_trip_switches_the_torque_off_and_keeps_the_log(played, capsys):
    bus = Bus()
    bus.runs_away = 700
    status, lines = played[0](bus)
    assert status == 1
    assert "stopped: b was -5.3 deg from its goal" in capsys.readouterr().err
    assert len(lines) > 300
    assert bus.done[-2:] == ["off", "gone"]
    reads = bus.reads
    assert reads - 700 <= 13  # 5 deg at 0.44 deg a reading


def test_what_an_encoder_is_always_off_is_no_reason_to_trip(played):
    bus = Bus()
    read = bus.sync_read
    bus.sync_read = lambda *a, **k: {n: x + 100 * (n == "b") for n, x in read(*a, **k).items()}
    assert played[0](bus)[0] == 0


@pytest.mark.parametrize(
    ("fails", "interrupt", "status", "said"),
    [
        (range(700, 9999), None, 1, "stopped: the bus failed: no status packet"),
        ((700, 701), None, 0, ""),
        ((), 700, 130, "stopped by Ctrl-C"),
    ],
)
def test_a_failing_bus_and_ctrl_c_switch_the_torque_off(
    played, capsys, fails, interrupt, status, said
):
    bus = Bus()
    bus.fails, bus.interrupt = fails, interrupt
    got, lines = played[0](bus)
    assert got == status
    assert said in capsys.readouterr().err
    assert len(lines) > 300
    assert "off" in bus.done


def test_a_torque_that_does_not_go_off_is_said(played, capsys):
    bus = Bus()
    bus.disable_torque = bus.read_nothing = lambda num_retry: 1 / 0
    assert played[0](bus)[0] == 0
    assert "THE TORQUE MAY STILL BE ON" in capsys.readouterr().err


def test_nothing_moves_beyond_the_calibration_or_over_another_log(played, capsys):
    play, _, log = played
    bus = Bus(low=2040, high=2060)
    assert play(bus)[0] == 1
    assert "its calibration has" in capsys.readouterr().err
    assert "move" not in bus.done
    log.write_text("mine")
    bus = Bus()
    assert play(bus) == (1, ["mine"])
    assert "move" not in bus.done


LEROBOT = """
import sys
class MotorNormMode:
    DEGREES = "degrees"
class Motor:
    def __init__(self, id, model, norm_mode):
        self.id, self.model = id, model
"""
FEETECH = """
from types import SimpleNamespace
class FeetechMotorsBus:
    def __init__(self, port, motors):
        assert {one.model for one in motors.values()} == {"sts3215"}
        self.goal = dict.fromkeys(motors, 2048)
    def connect(self): pass
    def set_timeout(self, timeout_ms): pass
    def read_calibration(self):
        return dict.fromkeys(self.goal, SimpleNamespace(range_min=0, range_max=4095))
    def read(self, data_name, motor, *, normalize=True, num_retry=0): return 32
    def sync_write(self, data_name, values, *, normalize=True, num_retry=0):
        self.goal |= values
    def sync_read(self, data_name, motors=None, *, normalize=True, num_retry=0):
        return dict(self.goal)
    def enable_torque(self, motors=None, num_retry=0): print("on")
    def disable_torque(self, motors=None, num_retry=0): print("off")
    def disconnect(self, disable_torque=True): pass
"""


def test_the_script_that_is_written_stands_alone(plan, so101, tmp_path):
    """In a process of its own that finds no jointplay, on a bus called as LeRobot's is."""
    home = tmp_path / "lerobot" / "motors"
    home.mkdir(parents=True)
    (tmp_path / "lerobot" / "__init__.py").touch()
    (home / "__init__.py").write_text(LEROBOT)
    (home / "feetech.py").write_text(FEETECH)
    (tmp_path / "wiggle_lerobot.py").write_text(trajectory.lerobot_script(so101[1], plan.steps))
    joints = [name for name in plan.joints if name in so101[1]]
    rows = [",".join(["time_s", *joints]), *(f"{0.1 * k:g},0,0,0,0,0" for k in range(4))]
    (tmp_path / "wiggle.csv").write_text("\n".join(rows) + "\n")
    order = [sys.executable, "-S", "wiggle_lerobot.py", "/dev/null", "--yes"]
    done = subprocess.run(order, cwd=tmp_path, capture_output=True, text=True, env={}, timeout=120)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines().count("on") == done.stdout.splitlines().count("off") == 1
    assert "shoulder_lift position [deg]" in (tmp_path / "wiggle_log.csv").read_text()


def test_arms_of_unknown_servos_get_no_script(plan):
    own = Servo(voltage=7.4, p_gain=30.0, torque_constant=1.0, resistance=2.0)
    assert trajectory.lerobot_script({"shoulder_pan": own}, plan.steps) == ""


# Logs.


def signals(rate=200.0):
    """Two joints, first a then b to and fro, with a slow move of both between."""
    time = np.arange(0.0, 17.0, 1.0 / rate)
    wave = np.radians(3.0) * np.arcsin(np.sin(2.0 * time)) / (np.pi / 2)
    move = 0.4 * np.clip((time - 8.0) / 1.0, 0.0, 1.0)
    a = np.where((time > 1.0) & (time < 7.0), wave, 0.0) + move
    b = np.where((time > 10.0) & (time < 16.0), wave, 0.0) - move
    goal = {"a": np.round(a, 5), "b": np.round(b, 5)}
    position = {name: np.round(0.01 + 0.97 * np.roll(x, 3), 5) for name, x in goal.items()}
    return time, goal, position


def as_csv(path, time, goal, position):
    heads = ["time [s]", *(f"{n} {w} [rad]" for n in goal for w in ("goal", "position"))]
    table = np.column_stack([time, *(x for n in goal for x in (goal[n], position[n]))])
    np.savetxt(path, table, "%.6f", ",", header=",".join(heads), comments="")
    return path


def parts_alike(one, other):
    for name, (part, pose) in one.logs().items():
        twin, at = other.logs()[name]
        for field in ("time", "goal", "position", "others"):
            assert getattr(part, field) == pytest.approx(getattr(twin, field), abs=2e-5)
        assert pose == pytest.approx(at, abs=2e-5)


def test_a_log_is_cut_into_the_joints_that_move_alone(tmp_path):
    time, goal, position = signals()
    logs = ServoSignals.read(as_csv(tmp_path / "log.csv", time, goal, position), JOINTS).logs()
    assert list(logs) == ["a", "b"]
    for (part, pose), begin in zip(logs.values(), (1.0, 10.0), strict=True):
        assert part.time[0] == 0.0
        assert 6.0 <= part.time[-1] <= 8.0
        assert part.others.max() < np.radians(0.1) + 1e-3
        k = int(np.searchsorted(time, begin - 0.6))
        assert pose[part.joint] == pytest.approx(position[part.joint][k], abs=0.03)


@pytest.mark.needs("pyarrow", "rosbags")
def test_three_formats_give_the_same_log(tmp_path):
    import pyarrow as pa
    import test_recordings
    from pyarrow import parquet

    time, goal, position = signals(100.0)
    read = ServoSignals.read(as_csv(tmp_path / "log.csv", time, goal, position), JOINTS)
    assert len(read.logs()) == 2
    bag = test_recordings.bag(
        tmp_path / "bag",
        {
            "/goals": test_recordings.states(time - 1e-3, **goal),
            "/joint_states": test_recordings.states(time, **position),
        },
    )
    topics = {"goal": "/goals", "position": "/joint_states"}
    parts_alike(read, ServoSignals.read(Recording(bag, topics), JOINTS))
    folder = tmp_path / "set"
    names = ["a.pos", "b.pos"]
    kind = {"dtype": "float32", "shape": [2], "names": names}
    info = {
        "codebase_version": "v2.1", "fps": 100, "total_episodes": 1, "chunks_size": 1000,
        "features": {"action": kind, "observation.state": kind},
    }  # fmt: skip
    (folder / "meta").mkdir(parents=True)
    (folder / "meta/info.json").write_text(json.dumps(info))
    (folder / "data/chunk-000").mkdir(parents=True)
    columns = {
        "action": np.degrees(np.column_stack(list(goal.values()))).tolist(),
        "observation.state": np.degrees(np.column_stack(list(position.values()))).tolist(),
        "timestamp": list(time),
        "episode_index": [0] * len(time),
    }
    parquet.write_table(pa.table(columns), folder / "data/chunk-000/episode_000000.parquet")
    features = {"goal": "action [deg]", "position": "observation.state [deg]"}
    parts_alike(read, ServoSignals.read(Recording(folder, features), JOINTS))
    with pytest.raises(JointplayError, match="is what was commanded, not what was measured"):
        Recording(folder, {"position": "action [deg]"})
    with pytest.raises(JointplayError, match="'goal' is a signal of servos alone"):
        Recording(folder, features).measurement(JOINTS)


@pytest.mark.needs("rosbags")
@pytest.mark.parametrize("unstamped", [True, False])
def test_goals_are_those_of_a_trajectory_until_another_ends_it(unstamped, tmp_path):
    """Sent as a whole at once, with its corners only, and ended by another before its end."""
    import test_recordings

    time, goal, position = signals(200.0)
    kind, end = "trajectory_msgs/msg/JointTrajectory", np.searchsorted(time, 9.0)
    points = {name: np.append(x[:end:10], 1.0) for name, x in goal.items()}
    later = {name: x[end::10] for name, x in goal.items()}
    rows = [
        (kind, 0.0, {"times": np.append(time[:end:10], 20.0), "goal": points}),
        (kind, 9.0, {"times": time[end::10] - 9.0, "goal": later}),
    ]
    rows = [(kind, at, {**fields, "unstamped": unstamped}) for kind, at, fields in rows]
    topics = {"/sent": rows, "/joint_states": test_recordings.states(time, **position)}
    bag = test_recordings.bag(tmp_path / "bag", topics)
    log = Recording(bag, {"goal": "/sent", "position": "/joint_states"})
    read = ServoSignals.read(log, JOINTS)
    for name, x in goal.items():
        off = abs(read.goal[name] - np.interp(read.time, time, x))
        assert np.quantile(off, 0.98) < 1e-3  # not where the goals of this log jump
    assert list(read.logs()) == ["a", "b"]


def test_logs_without_a_wiggle_are_refused(so101, tmp_path):
    time, goal, position = signals()
    both = {name: goal["a"] + goal["b"] for name in goal}
    robot = so101[0]
    with pytest.raises(JointplayError, match="no joint that moves 'a'"):
        identify_wiggled(robot, ServoSignals(time, goal, position, "x", {}), so101[1])
    names = dict(zip(goal, ("shoulder_pan", "shoulder_lift"), strict=True))
    together = ServoSignals(
        time, {names[n]: x for n, x in both.items()},
        {names[n]: x for n, x in position.items()}, "x", {},
    )  # fmt: skip
    with pytest.raises(JointplayError, match="no joint's goal goes to and fro while the others"):
        identify_wiggled(robot, together, so101[1])
    with pytest.raises(JointplayError, match="a has no position"):
        ServoSignals(time, goal, {"b": position["b"]}, "x", {})


# The command.


def chain(urdf, names):
    parts, before = [], "base"
    for k, name in enumerate(names):
        axis = "0 0 1" if k == 0 else "0 1 0"
        parts += [
            body(f"l{k}", mass=0.1, com="0.05 0 0"),
            joint(name, before, f"l{k}", axis=axis, at="0.1 0 0" if k else "0 0 0.1"),
        ]
        before = f"l{k}"
    return urdf(*parts, tip(before))


def test_the_command_asks_for_the_encoders_side_where_sources_contradict(capsys):
    assert main(["identify", "so101", "--plan", "wiggle"]) == 2
    said = capsys.readouterr().err
    assert "on which side of its gear shoulder_pan's encoder sits nobody says" in said
    assert "--encoder output or --encoder motor" in said
    assert main(["identify", "so101", "--plan", "wiggle", "--encoder", "motor"]) == 2
    said = capsys.readouterr().err
    assert "a wiggle tells no joint's play" in said
    assert "the encoder is on the motor" in said


def test_the_command_writes_the_plan(tmp_path, capsys):
    order = ["identify", "so101", "--plan", "wiggle", "--encoder", "output", "--quiet"]
    out = tmp_path / "plan"
    assert main([*order, "--gear", "elbow_flex=0.5 deg", "--out", str(out)]) == 0
    said = capsys.readouterr().out
    assert "Record goal and position of every joint" in said
    assert "the encoder of elbow_flex turns with the output, and is a dial gauge" in said
    motion = Motion.from_csv(out / "wiggle.csv")
    assert "elbow_flex" in motion.joints
    assert '"XL' not in (out / "wiggle_lerobot.py").read_text()
    compile((out / "wiggle_lerobot.py").read_text(), "wiggle_lerobot.py", "exec")


@pytest.mark.needs("yaml")
def test_the_trajectory_is_that_of_ros(tmp_path):
    import yaml

    order = ["identify", "so101", "--plan", "wiggle", "--encoder", "output", "--quiet"]
    out = tmp_path / "plan"
    assert main([*order, "--gear", "wrist_flex=0.5 deg", "--out", str(out)]) == 0
    whole = yaml.load((out / "wiggle.yaml").read_text(), getattr(yaml, "CSafeLoader", yaml.Loader))
    motion = Motion.from_csv(out / "wiggle.csv")
    assert whole["joint_names"] == list(motion.joints)
    assert len(whole["points"]) == len(motion.times)
    assert whole["points"][7]["effort"] == []


def test_a_koch_arm_says_its_encoders_side_itself(urdf, tmp_path, capsys):
    robot = chain(urdf, list(preset("koch").named))
    order = ["identify", str(robot), "--preset", "koch", "--plan", "wiggle", "--tool", "tool"]
    order += ["--gear", "joint_5=15 arcmin"]
    assert main([*order, "--out", str(tmp_path / "plan")]) == 0
    text = (tmp_path / "plan" / "wiggle_lerobot.py").read_text()
    assert "'joint_1': (1, 'xl430-w250', 1, 0.0)" in text
    assert "main('dynamixel', MOTORS, STEPS)" in text


def test_a_ur5_is_refused_with_what_it_lacks(capsys):
    assert main(["identify", "ur5", "--plan", "wiggle"]) == 2
    said = capsys.readouterr().err
    assert "ur5: a wiggle needs servos of which motor, gain and rotor are known" in said
    assert "--preset with one of koch, printed-servo, so101" in said
    assert main(["identify", "ur5", "--plan", "wiggle", "--preset", "ur-like"]) == 2
    assert "no [drives.JOINT] is of kind servo" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--known friction", "--lag 0", "--noise tool=1", "--verify"])
def test_options_of_other_measurements_are_refused(capsys, option):
    assert main(["identify", "so101", "--plan", "wiggle", *option.split()]) == 2
    assert f"{option.split()[0]} is not for a wiggle" in capsys.readouterr().err


def test_the_encoders_side_is_only_for_servos(tmp_path, capsys):
    assert main(["identify", "so101", "--plan", "dial", "--encoder", "output"]) == 2
    assert "--encoder is not for a dial gauge" in capsys.readouterr().err
    assert main(["identify", "ur5", "--plan", "--encoder", "output"]) == 2
    assert "--encoder is for --plan wiggle" in capsys.readouterr().err


def told(joint):
    unknown = Unknown(joint, "gear_play", "rad", np.nan, fine=False)
    if joint == "wrist_flex":
        return Estimate(unknown, reason="it jitters")
    return Estimate(unknown, 0.01, 0.005, found=joint != "shoulder_pan", upper=0.015)


def test_a_log_is_answered_in_a_table_with_figure_and_preset(
    so101, plan, tmp_path, capsys, monkeypatch
):
    """Whatever the estimator says of each joint."""
    k = [plan.joints.index(name) for name in so101[1]]
    goal = {name: plan.position[:, at] for name, at in zip(so101[1], k, strict=True)}
    seen = {name: 0.01 + np.roll(x, 5) for name, x in goal.items()}
    path, out, mine = as_csv(tmp_path / "log.csv", plan.time, goal, seen), tmp_path / "o", "my.toml"
    rubs = Estimate(Unknown("elbow_flex", "servo_friction", "N*m"), 0.04, ends=(0.03, 0.06))
    gives = Unknown("elbow_flex", "gear_compliance", "rad/(N*m)")

    def told_of(one):
        more = (rubs, Estimate(gives, 0.01, reason="all look alike"))
        return told(one.log.joint), *(more if one.log.joint == "elbow_flex" else ())

    monkeypatch.setattr(wiggle_logs, "told_of", told_of)
    order = ["identify", "so101", str(path), "--encoder", "output", "--out", str(out)]
    assert main([*order, "--write-preset", str(tmp_path / mine)]) == 0
    said = capsys.readouterr().out
    assert "The readings tell the play of 3 of 4 joints: shoulder_pan at most" in said
    assert "wrist_flex gear play: it jitters" in said
    assert re.search(r"^shoulder_lift +gear play +10 mrad +5 mrad to 15 mrad", said, re.M)
    assert "note: the log says no gains" in said
    assert re.search(r"^elbow_flex +servo friction +0.04 N m +0.03 N m to 0.06 N m", said, re.M)
    assert "does not tell the stiffness of elbow_flex" in said
    assert "compliance" not in said
    found = json.loads((out / "identified.json").read_text())
    assert {row["joint"] for row in found["unknowns"]} == set(so101[1]) - {"wrist_roll"}
    assert (out / "loops.png").stat().st_size > 10_000
    kept = preset(tmp_path / mine)
    assert kept.named["elbow_flex"]["drive"]["encoder"] == "link"
    assert kept.named["elbow_flex"]["drive"]["p_gain"] == pytest.approx(38.6)
    assert kept.named["elbow_flex"]["gear"]["play"] == pytest.approx(0.01)
    assert kept.named["elbow_flex"]["drive"]["friction"] == pytest.approx(0.04)
    assert kept.intervals["elbow_flex", "servo_friction"] == (0.03, 0.06)
    assert main(["budget", "so101", "--preset", str(tmp_path / mine)]) == 0
