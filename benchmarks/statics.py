"""Peak joint force with journals that start centred and at rest, and what the search costs.

    python benchmarks/statics.py

UR5: play in the shoulder lift joint; UR5 and Panda: in every revolute joint; the shipped
slider-crank at 5000 rpm, the shipped four-bar at 600 rpm, and the SCARA with its weight.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np

import jointplay as jp
from jointplay.mechanism.robots import robot_urdf

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
    """By name."""
    shipped = {
        "slider-crank, 0.2 mm": ("slider_crank", "0.2 mm", {}),
        "four-bar, 0.2 mm": ("four_bar", "0.2 mm", {}),
        "SCARA with its weight, 0.2 mm": ("scara", "0.2 mm", {"robot": {"gravity": "loaded"}}),
    }
    found = {
        "UR5, shoulder lift": arm("ur5", "shoulder_lift_joint"),
        "UR5, all six": arm("ur5"),
        "Panda, all seven": arm("panda"),
    }
    for name, (file, case, changes) in shipped.items():
        found[name] = jp.Scenario.load(f"jointplay:{file}.toml").simulation(case, changes)
    return found


def peak(simulation: jp.Simulation, start: str, lasts: float) -> tuple[float, float, jp.Result]:
    """Largest joint force in the first 50 ms and in the rest of the time [N]."""
    simulation = replace(simulation, start=start, duration=lasts, judge_from=0.0)
    result = simulation.run(progress=True)
    force = np.linalg.norm(result["joint_force_peak"].values, axis=2).max(axis=1)
    early = result.time < min(0.05, 0.5 * lasts)
    return float(force[early].max()), float(force[~early].max()), result


def main() -> None:
    """Print a table in Markdown."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lasts", type=float, default=0.3, help="simulated time [s]")
    lasts = parser.parse_args().lasts
    head = [
        "run", "centred: first 50 ms, then [N]", "at rest: first 50 ms, then [N]",
        "pressed at rest [N]", "unbalanced [N]", "states tried", "time of the search [s]",
    ]  # fmt: skip
    print("| " + " | ".join(head) + " |\n|" + " --- |" * len(head))
    for name, simulation in simulations().items():
        duration = min(lasts, simulation.duration or lasts)
        replace(simulation, duration=duration).prepare()
        spent = {}
        for start in ("centred", "rest"):
            began = time.process_time()
            run = replace(simulation, duration=duration, start=start, judge_from=0.0).prepare()
            spent[start] = time.process_time() - began
        rest = run.rest
        before, after = (peak(simulation, start, duration) for start in ("centred", "rest"))
        row = [name, f"{before[0]:.4g}, {before[1]:.4g}", f"{after[0]:.4g}, {after[1]:.4g}",
               f"{rest.load:.4g}", f"{rest.residual:.1g}", f"{rest.trials}",
               f"{spent['rest'] - spent['centred']:.2f}"]  # fmt: skip
        print("| " + " | ".join(row) + " |", flush=True)


if __name__ == "__main__":
    main()
