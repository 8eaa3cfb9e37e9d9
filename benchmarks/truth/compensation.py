"""How much corrected motions reduce the tool's error, also where the model is wrong.

Machines with play in all joints are run with a motion as it is and as `compensate` corrects it: a
UR5 with journals (pick and place, 6 s, 1.5 kg), the same with gears and encoders on the motors, the
presets of the SO-101 and of the AR4 (steppers behind gears), a two-axis gantry (belt and screw, dry
friction, two passes learned from own runs), and the paper's SCARA. Each several times, journals
displaced at the start, and play, payload and stiffness off by up to 5 %; and at the corners of play
30 %, payload 20 %, stiffness 30 %. Errors are from the ideal twin of the motion as it was; nothing
here says anything about hardware.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from common import command
from truth.hunting import agreement

import jointplay as jp
from jointplay.base.processes import cores
from jointplay.base.tables import Table
from jointplay.model.robots import robot_urdf
from jointplay.scenario.presets import preset
from jointplay.simulation.loads import ComputedTorque, JointFriction
from jointplay.study.corners import ToolErrors, judge, learn, tool_errors, varied

TRUST = {"play": 0.3, "payload": 0.2, "stiffness": 0.3}
OFF = 0.05
UR5 = (
    *("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint"),
    *("wrist_1_joint", "wrist_2_joint", "wrist_3_joint"),
)
PICK_AND_PLACE = np.array([
    [0.0, -1.2, 1.5, -1.9, -1.57, 0.0],
    [0.8, -1.0, 1.6, -2.2, -1.57, 0.4],
    [0.8, -0.8, 1.6, -2.4, -1.57, 0.4],
    [-0.6, -1.3, 1.4, -1.7, -1.4, -0.5],
    [-0.6, -1.1, 1.5, -2.0, -1.4, -0.5],
    [0.0, -1.2, 1.5, -1.9, -1.57, 0.0],
])  # fmt: skip
TIMES = np.array([0.0, 1.3, 2.0, 3.7, 4.4, 6.0])


def ur5(mechanism: jp.Mechanism, encoder: str) -> jp.Simulation:
    motion = jp.Motion(UR5, TIMES, PICK_AND_PLACE)
    payload = jp.Payload(mechanism.tool, 1.5)
    return jp.Simulation(
        mechanism, motion, ComputedTorque(encoder=encoder), payloads=(payload,), record_every=100
    )


def journals() -> jp.Simulation:
    bearing = jp.RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    return ur5(jp.Mechanism(robot_urdf("ur5"), dict.fromkeys(UR5, bearing)), "link")


def gears() -> jp.Simulation:
    gear = jp.Gear(play=1e-3, rotor_inertia=0.5, stiffness=1.5e4, damping=20.0)
    return ur5(jp.Mechanism(robot_urdf("ur5"), gears=dict.fromkeys(UR5, gear)), "motor")


def so101() -> jp.Simulation:
    known = preset("so101")
    mechanism = known.mechanism()
    names = ["shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll"]
    places = np.array([
        [0.0, -0.4, 0.6, 0.6, 0.0], [0.5, 0.0, 0.4, 0.7, 0.3], [0.5, 0.2, 0.3, 0.7, 0.3],
        [-0.4, -0.3, 0.5, 0.6, -0.3], [-0.4, -0.3, 0.5, 0.6, -0.3],
    ])  # fmt: skip
    motion = jp.Motion(
        [*names, "gripper"], [0.0, 1.5, 2.3, 4.0, 4.5], np.hstack([places, np.zeros((5, 1))])
    )
    drives = {"gripper": ComputedTorque(), **known.drives(mechanism.description)}
    return jp.Simulation(mechanism, motion, drives, tolerance=1e-3, record_every=20)


def ar4() -> jp.Simulation:
    known = preset("ar4")
    mechanism = known.mechanism()
    places = np.array([
        [0.0, 0.2, 0.0, 0.0, 0.4, 0.0], [0.5, 0.6, -0.3, 0.3, 0.7, 0.4],
        [0.5, 0.75, -0.35, 0.3, 0.75, 0.4], [-0.4, 0.4, 0.1, -0.4, 0.3, -0.5],
        [-0.4, 0.55, 0.05, -0.4, 0.35, -0.5], [0.0, 0.2, 0.0, 0.0, 0.4, 0.0],
    ])  # fmt: skip
    motion = jp.Motion(mechanism.joints, TIMES, places)
    payload = jp.Payload(mechanism.tool, 0.5)
    drives = known.drives(mechanism.description)
    return jp.Simulation(
        mechanism, motion, drives, payloads=(payload,), tolerance=1e-3, record_every=20
    )


def scara() -> jp.Simulation:
    bearing = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
    mechanism = jp.Mechanism(
        jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0.0, 0.0, -9.81)
    )
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    return jp.Simulation(mechanism, motion, record_every=100)


def gantry() -> jp.Simulation:
    belt = jp.Gear(play=1e-4, rotor_inertia=4.0, stiffness=2e6, damping=1500.0)
    screw = jp.Gear(play=5e-5, rotor_inertia=16.0, stiffness=2e7, damping=5000.0)
    mechanism = jp.Mechanism(
        jp.shipped("gantry.urdf"), gears={"x": belt, "z": screw}, tool="gripper"
    )
    places = np.array([
        [0.1, 0.0], [0.25, -0.03], [0.25, -0.06], [0.05, -0.06], [0.05, -0.02], [0.1, 0.0]
    ])  # fmt: skip
    motion = jp.Motion(("x", "z"), [0.0, 0.5, 0.8, 1.4, 1.7, 2.3], places)
    friction = {"x": JointFriction(coulomb=5.0), "z": JointFriction(coulomb=3.0)}
    drive = ComputedTorque(encoder="motor")
    return jp.Simulation(mechanism, motion, drive, joint_friction=friction, record_every=20)


MACHINES: dict[str, Callable[[], jp.Simulation]] = {
    "UR5, six journals": journals,
    "UR5, six gears": gears,
    "SO-101": so101,
    "AR4": ar4,
    "gantry": gantry,
    "SCARA": scara,
}
PASSES = {"gantry": 2}
"""Passes learned from own runs."""


def _one(run: tuple[jp.accuracy.Compensation, int | None, str]) -> ToolErrors:
    found, seed, when = run
    random = np.random.default_rng(seed)
    factors = {name: 1.0 + OFF * random.uniform(-1.0, 1.0) for name in TRUST}
    plant = replace(varied(found.simulation, factors), seed=seed)
    moved = replace(plant, motion=found.motion) if when == "after" else plant
    return tool_errors(moved, replace(plant, seed=None))


def main() -> int:
    options = command(
        __doc__,
        "two machines, one start, no corners",
        jobs=(cores(), "processes"),
        starts=(20, "of each machine"),
        cases=(40, "servos that may hunt"),
        machine=("", "only machines with this in their name"),
    ).parse_args()
    names = [name for name in MACHINES if options.machine.lower() in name.lower()]
    names = names[1:2] if options.quick else names
    starts = 1 if options.quick else options.starts
    rows, downs, worsts = [], [], []
    for name in names:
        found, _ = learn(jp.compensate(MACHINES[name]()), PASSES.get(name, 0))
        plan = [(found, seed, when) for seed in range(starts) for when in ("before", "after")]
        errors = jp.Study(plan, _one).run(options.jobs, progress=True, desc=name)
        before = np.array([[one.rms, one.largest] for one in errors[::2]])
        after = np.array([[one.rms, one.largest] for one in errors[1::2]])
        ratio = before / after
        judged = judge(found, {} if options.quick else TRUST, jobs=options.jobs, progress=True)
        worst = judged.least_gain
        rule = judged.firmware.rms if judged.firmware is not None else np.nan
        downs.append(float(np.median(ratio[:, 0])))
        worsts.append(worst.before.rms / worst.after.rms)
        told = [np.median(before[:, 0]), np.median(after[:, 0]), rule]
        rows.append([
            name, *(f"{1e3 * x:.3g}" for x in told), f"{downs[-1]:.3g}",
            f"{ratio[:, 0].min():.3g}", f"{np.median(ratio[:, 1]):.3g}", f"{worsts[-1]:.3g}",
            worst.label,
        ])  # fmt: skip
    head = [
        *("machine", "RMS before [mm]", "after [mm]", "firmware's rule [mm]", "down, median"),
        *("least of the starts", "largest error down", "worst corner down", "worst corner"),
    ]
    print(Table.of_texts([head, *rows]).markdown())
    agree, cases, _ = agreement(1 if options.quick else options.cases, jobs=options.jobs)
    print(
        f"machines {len(rows)}, RMS error down {np.median(downs):.3g} times median, worst corner "
        f"{min(worsts):.3g} times, hunting agrees in {agree} of {cases}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
