"""An SO-101 in MuJoCo whose servos are wiggled: is its play told, by another simulator's log?

Each joint is a motor and a link with play between them, which MuJoCo's soft limits keep; its servo
sees the link's angle in whole counts, with `--encoder motor` the motor's, of lighter rotors, in a
fiftieth of them. With --log the log of one plan is all that is made.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import Benchmark

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.estimate.wiggle_logs import ServoSignals, identify_wiggled
from jointplay.estimate.wiggle_plan import plan_wiggle
from jointplay.scenario.presets import preset
from jointplay.simulation.loads.drive import Servo

PLAY = {"shoulder_lift": 0.9, "elbow_flex": 0.2}
"""Of the tutorial's arm; other joints have 0.4 [deg]."""
ROTOR = {"link": 0.0284, "motor": 0.008}
RECORD_S, LOOP_S, STEP_S = 5e-3, 1e-3, 5e-4
SERVO = Servo.of(
    "STS3215", voltage=7.4, p_gain=38.6, dead_band_counts=1, resolution=2.0 * np.pi / 4096,
    encoder="link",
)  # fmt: skip


def model_of(play: Mapping[str, float], friction: float, rotor_inertia: float):
    """The arm with this play by joint [rad]; its model, joints, and places of links and motors."""
    import mujoco

    spec = mujoco.MjSpec.from_file(str(jp.shipped("so101.urdf")))
    names = [joint.name for joint in spec.joints if joint.name in play]
    spec.option.timestep = STEP_S
    for name in names:
        rotor = spec.worldbody.add_body(mass=1e-3, inertia=[1e-6] * 3, explicitinertial=True)
        motor = f"{name}_motor"
        rotor.add_joint(name=motor, armature=rotor_inertia, frictionloss=SERVO.friction)
        link, half = spec.joint(name), play[name] / 2.0
        link.limited, link.frictionloss, link.armature = False, friction, 1e-4
        teeth = spec.add_tendon(limited=True, range=[-half, half], solref_limit=[0.01, 0.4])
        teeth.wrap_joint(motor, 1)
        teeth.wrap_joint(name, -1)
    model = spec.compile()
    places = [[int(model.joint(f"{n}{end}").qposadr[0]) for n in names] for end in ("", "_motor")]
    return model, names, *places


def log_of(
    time: np.ndarray, goals: Mapping[str, np.ndarray], play: Mapping[str, float],
    friction: float = 0.02, servo: Servo = SERVO,
) -> ServoSignals:  # fmt: skip
    """What the servos log while they play a motion (n,) of goals by joint [rad]."""
    import mujoco

    model, names, link, motor = model_of(play, friction, ROTOR[servo.encoder])
    data, count = mujoco.MjData(model), servo.resolution
    read = motor if servo.encoder == "motor" else link
    data.qpos[link] = data.qpos[motor] = [goals[name][0] for name in names]
    stamps = np.arange(0.0, time[-1], RECORD_S)
    sent = np.column_stack([np.interp(stamps, time, goals[name]) for name in names])
    sent, seen = np.round(sent / count) * count, np.empty((len(stamps), len(names)))
    for row, goal in enumerate(sent):
        seen[row] = np.round(data.qpos[read] / count) * count
        for _ in range(round(RECORD_S / LOOP_S)):
            error = goal - np.round(data.qpos[read] / count) * count
            error = np.sign(error) * np.maximum(np.abs(error) - servo.band, 0.0)
            volts = np.clip(servo.p_gain * error, -servo.voltage, servo.voltage)
            speed = data.qvel[motor]
            torque = servo.stall * volts - (servo.braking + servo.viscous) * speed
            data.qfrc_applied[motor] = torque
            mujoco.mj_step(model, data, round(LOOP_S / STEP_S))
    table = [dict(zip(names, x.T, strict=True)) for x in (sent, seen)]
    return ServoSignals(stamps, *table, "MuJoCo", {})


def write(log: ServoSignals, path: Path) -> None:
    heads = ["time [s]", *(f"{n} {what} [deg]" for n in log.goal for what in ("goal", "position"))]
    columns = [np.degrees(x) for n in log.goal for x in (log.goal[n], log.position[n])]
    table = np.column_stack([log.time, *columns])
    np.savetxt(path, table, "%.5f", ",", header=",".join(heads), comments="")


def main() -> None:
    benchmark = Benchmark(
        "wiggled_arm", __doc__, runs=0, arms=(8, "that are drawn"), seed=(1, "of them"),
        plan=("", "CSV of --plan wiggle that is played"), log=("", "file for its log"),
        encoder=("link", "its side: link or motor"),
    )  # fmt: skip
    args = benchmark.parse()
    try:
        import mujoco  # noqa: F401 - it is needed further down
    except ImportError:
        print("MuJoCo is not installed: pip install '.[simulators]'")
        return
    robot = preset("so101").mechanism()
    if args.log:
        motion = jp.Motion.from_csv(args.plan)
        goals = dict(zip(motion.joints, motion.waypoints[1].T, strict=True))
        play = {name: np.radians(PLAY.get(name, 0.4)) for name in robot.gears}
        write(log_of(motion.waypoints[0], goals, play), Path(args.log))
        print(f"written: {args.log}")
        return
    servo = SERVO
    if args.encoder == "motor":
        servo = replace(SERVO, encoder="motor", resolution=SERVO.resolution / 50.0)
        rotor = ROTOR["motor"]
        gears = {name: replace(one, rotor_inertia=rotor) for name, one in robot.gears.items()}
        robot = jp.Mechanism("so101", gears=gears)
    drives = dict.fromkeys(robot.gears, servo)
    plan, random, rows = plan_wiggle(robot, drives), np.random.default_rng(args.seed), []
    goals = dict(zip(plan.joints, plan.position.T, strict=True))
    for _ in ProgressBar(range(1 if args.quick else args.arms), "arms", unit="arm"):
        play = {name: np.radians(1.4 * random.random()) for name in robot.gears}
        log = log_of(plan.time, goals, play, float(random.uniform(0.005, 0.05)), servo)
        for one in identify_wiggled(robot, log, drives).estimates:
            true = {"gear_play": play[one.joint], "servo_friction": servo.friction}.get(
                one.unknown.name
            )
            if true is None:  # how soft limits give way in MuJoCo is no stiffness
                continue
            low, high = one.interval if one.found else (0.0, one.upper)
            rows.append(
                {
                    "joint": one.label, "true": one.unknown.shown(true), "told": one.identified,
                    "held": bool(low <= true <= high), "interval": one.words()[1],
                    "reason": one.reason,
                }
            )  # fmt: skip
    told = [row for row in rows if row["told"]]
    shown = [[r["joint"], r["true"], r["interval"], r["reason"]] for r in rows]
    benchmark.finish(["joint", "true", "told", "why not"], shown, rows)
    held = sum(row["held"] for row in told)
    print(f"unknowns {len(rows)} told {len(told)} held {held}")


if __name__ == "__main__":
    main()
