"""Journals at rest: peak forces, cost of the search, and whether budget and run agree.

    python benchmarks statics
    python benchmarks statics --robots ur5 --poses 5 --no-peaks

UR5: play in the shoulder lift joint; UR5 and Panda: in every revolute joint; the shipped
slider-crank at 5000 rpm, the shipped four-bar at 600 rpm, and the SCARA with its weight.

Then random poses of UR5, Panda and SCARA, 0.1 mm of play in bearings of 60 x 50 mm, in one joint
and in all: where `budget` says that they rest, where a run with start="rest" begins, and whether
that lies where the budget says that friction can hold them; and where runs with friction end whose
journals are released from random places. The last line has the largest disagreement.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pinocchio as pin
from common import command
from truth.friction_at_rest import Case

import jointplay as jp
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.rest import AGREES_M
from jointplay.base.tables import Table
from jointplay.model.robots import robot_urdf

BEARING = {
    "bearing_radius": 25e-3, "bearing_length": 50e-3,
    "radial_clearance": 5e-5, "axial_clearance": 5e-5,
}  # fmt: skip
POSES = {
    "ur5": [0.0, -1.2, 1.4, -0.2, 0.3, 0.0],
    "panda": [0.0, -0.5, 0.0, -2.0, 0.0, 1.6, 0.7, 0.02, 0.02],
}
TURN, LASTS = 0.3, 0.5
"""Every revolute joint turns by so much [rad] in so long [s], from rest to rest."""


def arm(name: str, *joints: str) -> jp.Simulation:
    """A robot that moves all its joints, with play in some of them; none named: in all."""
    robot = jp.Mechanism(robot_urdf(name))
    turning = [j for j in robot.joints if robot.description.joints[j].kind != "prismatic"]
    start = np.array(POSES[name])
    end = start + TURN * np.array([joint in turning for joint in robot.joints])
    motion = jp.Motion(list(robot.joints), [0.0, LASTS], np.array([start, end]))
    play = {joint: jp.RevoluteClearance(**BEARING) for joint in joints or turning}
    return jp.Simulation(robot.with_clearance(play), motion, step=1e-5 if joints else 2e-6)


def simulations() -> dict[str, jp.Simulation]:
    found = {
        "UR5, shoulder lift": arm("ur5", "shoulder_lift_joint"),
        "UR5, all six": arm("ur5"),
        "Panda, all seven": arm("panda"),
    }
    for name, file, changes in (
        ("slider-crank, 0.2 mm", "slider_crank", {}),
        ("four-bar, 0.2 mm", "four_bar", {}),
        ("SCARA with its weight, 0.2 mm", "scara", {"robot": {"gravity": "loaded"}}),
    ):
        found[name] = jp.Scenario.load(f"jointplay:{file}.toml").simulation("0.2 mm", changes)
    return found


def peaks(lasts: float) -> Table:
    """Peak joint forces of runs from both starts, and what the search for rest costs."""
    heads = [
        *(("run", ""), ("centred: first 50 ms", "N"), ("then", "N"), ("at rest: first 50 ms", "N")),
        *(("then", "N"), ("pressed at rest", "N"), ("unbalanced", "N"), ("states tried", "")),
        ("time of the search", "s"),
    ]
    rows = []
    for name, simulation in simulations().items():
        duration = min(lasts, simulation.duration or lasts)
        jp.Run(replace(simulation, duration=duration))
        spent, forces = [], []
        for start in ("centred", "rest"):
            begun = replace(simulation, duration=duration, start=start, judge_from=0.0)
            began = time.process_time()
            rest = jp.Run(begun).rest
            spent.append(time.process_time() - began)
            result = begun.run(progress=True)
            force = np.linalg.norm(result["joint_force_peak"].values, axis=2).max(axis=1)
            early = result.time < min(0.05, 0.5 * duration)
            forces += [float(force[early].max()), float(force[~early].max())]
        found = rest.load, rest.residual, rest.trials, spent[1] - spent[0]
        rows.append((name, *forces, *found))
    return Table.of(heads, rows)


JOINTS = {
    "ur5": ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
            "wrist_2_joint", "wrist_3_joint"],
    "panda": [f"panda_joint{i}" for i in range(1, 8)],
    "scara": ["joint_a", "joint_b"],
}  # fmt: skip
FRICTION = 0.1


def standing(robot: jp.Mechanism, row: np.ndarray, **options: object) -> jp.Simulation:
    at = row[[robot.coordinate(name) for name in robot.joints]]
    motion = jp.Motion(list(robot.joints), [0.0, 1.0], np.array([at, at]))
    return jp.Simulation(robot, motion, limits="ignore", step=2e-6, **options)


def tool(robot: jp.Mechanism, q: np.ndarray) -> np.ndarray:
    pin.framesForwardKinematics(robot.model, robot.data, q)
    return robot.data.oMf[robot.tool_frame].translation.copy()


def agree(name: str, count: int, seed: int, released: int) -> tuple[float, int, int, int]:
    """Largest disagreement [m]; starts, starts outside the interval, and ends of runs outside."""
    random = np.random.default_rng(seed)
    worst, looked, outside, away = 0.0, 0, 0, 0
    for k in range(count):
        names = JOINTS[name] if k % 2 else [str(random.choice(JOINTS[name]))]
        case = Case(name, tuple(names), int(random.integers(2**31)), None)
        robot, pose = case.build()
        q = pose[None]
        places = [budget(robot, q, friction=mu) for mu in (0.0, FRICTION)]
        run = jp.Run(standing(robot, q[0], duration=1e-3, start="rest"))
        there = tool(robot, run.rest.q) - places[0].positions[0]
        differ = max(np.linalg.norm(there - one.rest_tool[0, :3]) for one in places)
        looked += 1
        ends = places[1].rest_interval[0, :3]
        out = np.maximum(ends[:, 0] - there, there - ends[:, 1]).max()
        outside += out > AGREES_M
        worst = max(worst, float(differ))
        print(f"{name} {k} {len(names)} loose: differ {1e6 * differ:.3g} µm", flush=True)
        if len(names) == 1 and released > 0:
            released -= 1
            fall = standing(robot, q[0], duration=0.3, start="centred", seed=k).run()
            last = fall["q"].values[fall.time > 0.28].mean(axis=0)
            end = tool(robot, last) - places[0].positions[0]
            out = np.maximum(ends[:, 0] - end, end - ends[:, 1]).max()
            away += out > AGREES_M
            print(f"{name} {k}: released, ends {1e6 * out:.3g} µm beyond the interval "
                  f"(negative: inside)", flush=True)  # fmt: skip
    return worst, looked, outside, away


def main() -> None:
    options = command(
        __doc__,
        "two poses and a run of the SCARA",
        lasts=(0.3, "simulated time [s]"),
        no_peaks=(False, "leave the table out"),
        poses=(30, "random poses of each robot"),
        released=(3, "runs of each robot that end"),
        robots=(",".join(JOINTS), "which, with commas between"),
        seed=(1, "of the poses"),
    ).parse_args()
    if options.quick:
        options.no_peaks, options.robots = True, "scara"
        options.poses, options.released = 2, 1
    if not options.no_peaks:
        print(peaks(options.lasts).markdown())
    worst, looked, outside, away = 0.0, 0, 0, 0
    for name in options.robots.split(","):
        one = agree(name, options.poses, options.seed, options.released)
        worst, looked = max(worst, one[0]), looked + one[1]
        outside, away = outside + one[2], away + one[3]
    print(f"seed {options.seed}: worst disagreement of budget and start=\"rest\" {1e6 * worst:.3g} "
          f"µm at {looked} poses, stated {1e6 * AGREES_M:g} µm; {outside} starts, {away} ends of "
          f"runs with friction outside the interval")  # fmt: skip
