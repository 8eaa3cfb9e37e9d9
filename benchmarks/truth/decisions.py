"""How far static budgets, allocations and reduced models can be trusted, and what they cost.

    python benchmarks decisions [--poses 30] [--jobs 2] [--parts times,reductions,poses]

Writes times.txt (CPU seconds of each command), reductions.txt (MuJoCo against the full model), and
poses.csv, poses.txt, poses.png (static bound and dynamic error at random poses, slow and fast).
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from common import COLOURS, command, folder_of, new_figure, require

import jointplay as jp
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.poses import along_motion, over_workspace
from jointplay.base.files import temporary
from jointplay.base.tables import Table
from jointplay.bridges.reduced_mjcf import compile_robot, follow
from jointplay.bridges.reduction import reduce
from jointplay.model.mjcf_whole import compile_text
from jointplay.model.robots import robot_urdf
from jointplay.study.courses import dynamic_error

PLAYS = ("shoulder_lift_joint", "elbow_joint", "wrist_2_joint")
CLEARANCE_M = 1e-4
MOVE_RAD = 0.15
DOCS = Path("docs/images/decisions")
SPEEDS = {"slow": 2.0, "fast": 0.25}
"""Duration of a movement of `MOVE_RAD` in every joint [s]."""


def robot() -> jp.Mechanism:
    bearing = jp.RevoluteClearance(
        bearing_radius=20e-3, radial_clearance=CLEARANCE_M, axial_clearance=CLEARANCE_M
    )
    return jp.Mechanism(robot_urdf("ur5"), dict.fromkeys(PLAYS, bearing), tool="tool0")


def one(number: int) -> dict[str, float]:
    """Static bound and dynamic errors about one random pose."""
    mechanism = robot()
    at = over_workspace(mechanism, 64, seed=7)[number]
    random = np.random.default_rng(number)
    joints = mechanism.joints
    begin = np.array([at[mechanism.coordinate(name)] for name in joints])
    end = begin + MOVE_RAD * random.choice([-1.0, 1.0], len(joints))
    row: dict[str, float] = {"pose": number}
    for name, duration in SPEEDS.items():
        times = np.array([0.0, 0.3, 0.3 + duration])
        motion = jp.Motion(joints, times, [begin, begin, end])
        # Limits do not matter here: a turn more or less is the same pose.
        t = np.linspace(0.0, times[-1], 40)
        named = [dict(zip(joints, row, strict=True)) for row in motion(t)[0]]
        q = np.array([mechanism.configuration(one) for one in named])
        found = budget(mechanism, q)
        simulation = jp.Simulation(mechanism, motion, limits="ignore")
        seen = dynamic_error(mechanism, motion, simulation, runs=1)
        row[f"{name}_bound"] = float((found.worst + found.second_order).max())
        row[f"{name}_rest"] = float(found.rest_error.max())
        row[f"{name}_peak"] = float(seen.peak.max())
        row[f"{name}_rms"] = float(seen.rms.mean())
        row[f"{name}_step"] = seen.step
    return row


def budget_time() -> float:
    """CPU seconds of a 7-joint arm's budget along a motion, start of Python not counted."""
    names = [f"panda_joint{i}" for i in range(1, 8)]
    bearing = jp.RevoluteClearance(radial_clearance=CLEARANCE_M, axial_clearance=CLEARANCE_M)
    mechanism = jp.Mechanism(
        robot_urdf("panda"), dict.fromkeys(names, bearing), tool="panda_hand_tcp"
    )
    home = np.array([0.0, -0.8, 0.0, -2.0, 0.0, 1.5, 0.7])
    motion = jp.Motion(names, [0.0, 1.0, 2.0], [home, home + 0.5, home])
    begun = time.process_time()
    budget(mechanism, along_motion(mechanism, motion))
    return time.process_time() - begun


def command_times(quick: bool) -> dict[str, float]:
    """CPU seconds of the commands, start of Python and all."""
    clearance = ["--clearance", "0.05 mm"]
    orders = {
        "budget panda, one pose": ["budget", "panda", *clearance],
        "budget panda, 500 poses": ["budget", "panda", *clearance, "--workspace", "500"],
        "budget slider-crank, 60 poses": [
            "budget", "jointplay:slider_crank.toml", "--case", "0.2 mm"
        ],
        "allocate panda, 60 poses": [
            "allocate", "panda", "--target", "1 mm", "--workspace", "60"
        ],
        "allocate panda, 99 %, 60 poses": [
            "allocate", "panda", "--target", "1 mm", "--workspace", "60", "--quantile", "0.99"
        ],
        "reduce ur5 elbow": [
            "export", "simulator", "ur5", "--joint", "elbow_joint", *clearance, "--gear",
            "elbow_joint=2 arcmin", "--gear-stiffness", "2e4", "--rotor-inertia", "0.5",
            "--gear-damping", "20", "--quiet", "--out", "{out}"
        ]
    }  # fmt: skip
    found: dict[str, float] = {}
    program = "import sys; from jointplay.cli import main; sys.exit(main())"
    for name, order in list(orders.items())[: 1 if quick else None]:
        with temporary("decisions") as folder:
            order = [part.format(out=f"{folder}/out") for part in order]
            begun = sum(os.times()[2:4])
            subprocess.run(
                [sys.executable, "-c", program, *order], check=True, stdout=subprocess.DEVNULL
            )
            found[name] = sum(os.times()[2:4]) - begun
    return found


def reductions(quick: bool) -> list[list[str]]:
    """MuJoCo with the reduced model against the full model, in reversals other than the fit's."""
    rows = [
        [
            *("joint", "reversals", "stated [µrad]", "MuJoCo, largest", "MuJoCo, RMS"),
            *("tilt: stated [mrad]", "MuJoCo's tilt, largest", "µs a step", "s per s simulated"),
            "full model, s per s",
        ]
    ]
    pose = {"shoulder_lift_joint": -1.0, "elbow_joint": 1.0}
    for joint in ("shoulder_pan_joint", "elbow_joint"):
        bearing = jp.RevoluteClearance(radial_clearance=5e-5, axial_clearance=5e-5)
        mechanism = jp.Mechanism(
            robot_urdf("ur5"),
            {joint: bearing},
            gears={joint: jp.Gear(1e-3, 0.5, 2e4, 20.0)},
            tool="tool0",
        )
        fitted = reduce(mechanism, joint, pose)
        for amplitude, period in ((0.1, 2.0), (0.05, 3.0), (0.15, 2.0)):
            begun = time.process_time()
            other = reduce(mechanism, joint, pose, amplitude=amplitude, period=period)
            spent = time.process_time() - begun
            past = replace(fitted, history=other.history)
            stiff, tilting = (
                compile_robot(mechanism, [fitted], pose, tilt) for tilt in (False, True)
            )
            seen = follow(compile_text(stiff.mjcf([fitted]), stiff.meshes), past)
            tilt = follow(compile_text(tilting.mjcf([fitted]), tilting.meshes), past).tilt_error
            angles = (fitted.angle_error, seen.error, seen.rms)
            tilts = (fitted.tilt_error, tilt)
            rows.append(
                [
                    *(joint, f"{amplitude:g} rad, {period:g} s"),
                    *(f"{1e6 * one:.0f}" for one in angles),
                    *(f"{1e3 * one:.2f}" for one in tilts),
                    *(f"{1e6 * seen.step_seconds:.0f}", f"{seen.step_seconds / seen.step:.3f}"),
                    f"{spent / (2.0 * period):.2f}",
                ]
            )
            print(*rows[-1], sep=", ", flush=True)
            if quick:
                return rows
    return rows


def figure(rows: list[dict[str, float]], path: Path) -> None:
    drawn, ((axes,),) = new_figure(1, 1, 5.5, 4.2)
    top = 0.0
    for (name, duration), colour, marker in zip(SPEEDS.items(), COLOURS, "os", strict=False):
        x, y = ([1e3 * row[f"{name}_{kind}"] for row in rows] for kind in ("bound", "peak"))
        axes.plot(x, y, marker, color=colour, ms=4, label=f"{MOVE_RAD} rad in {duration:g} s")
        top = max(top, *x, *y)
    axes.plot([0, top], [0, top], color="0.5", lw=0.8, label="dynamic = static bound")
    axes.set(xlabel="static worst case [mm]", ylabel="peak error in a run [mm]")
    axes.legend()
    drawn.savefig(path)


def write_poses(rows: list[dict[str, float]], out: Path) -> None:
    head, lines = list(rows[0]), []
    for name in SPEEDS:
        part = np.array([row[f"{name}_peak"] / row[f"{name}_bound"] for row in rows])
        rest = np.array([row[f"{name}_rms"] / row[f"{name}_rest"] for row in rows])
        lines.append(
            f"- {name}: peak / bound {part.min():.2f} to {part.max():.2f}, median "
            f"{np.median(part):.2f}; {int((part > 1.0).sum())} of {len(rows)} beyond the bound; "
            f"RMS / error at rest {np.median(rest):.2f} (median)"
        )
    text = [",".join(head)] + [",".join(f"{row[key]:.6g}" for key in head) for row in rows]
    (out / "poses.csv").write_text("\n".join(text) + "\n")
    (out / "poses.txt").write_text("\n".join(lines) + "\n")
    figure(rows, out / "poses.png")


def main() -> None:
    options = command(
        __doc__,
        "of each part the first line",
        f"{DOCS}; --quick: results/benchmarks",
        poses=(30, "at random"),
        jobs=(2, "processes"),
        parts=("times,reductions,poses", "which, with commas between"),
    ).parse_args()
    quick, parts = options.quick, options.parts.split(",")
    if "reductions" in parts:
        require(quick, mujoco="pip install 'jointplay[simulators]'")
    out, poses = folder_of(options, "decisions", DOCS), 1 if quick else options.poses
    if "times" in parts:
        lines = [f"- budget of a 7-joint arm along a motion, in Python: {budget_time():.2f} s"]
        lines += [f"- `{name}`: {spent:.1f} s" for name, spent in command_times(quick).items()]
        (out / "times.txt").write_text("\n".join(lines) + "\n")
        print("\n".join(lines), flush=True)
    if "reductions" in parts:
        (out / "reductions.txt").write_text(Table.of_texts(reductions(quick)).markdown() + "\n")
    if "poses" in parts:
        study = jp.Study(range(poses), one)
        for _, row in study.outcomes(options.jobs):
            print({key: float(f"{value:.4g}") for key, value in row.items()}, flush=True)
            write_poses([study.store[k] for k in range(poses) if k in study.store], out)
