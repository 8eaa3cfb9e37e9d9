"""What a time step costs on other mechanisms: more joints with clearance, closed loops.

Each mechanism goes through its motion. After every 200 steps of the real loop the bare `pin.aba`
call on the same model, in all its forms, and what else a macro step asks of Pinocchio are
timed alone in the state just reached, so that all meet the same machine. The table gives medians of
CPU times. The ratio divides the whole step by the bare call; the last columns say what is left for
the kernel, and what a further joint with clearance added to that, over the bare call on the model
with this joint: it stays a small part of a call however cheap the first joint is. `--check` bounds
the largest ratio, and this part.

The SCARA has clearance of 0.2 mm in B, or in A and B; an arm of five links in none to four of its
joints; the slider-crank, cut at its piston pin, 0.5 mm at 5000 rpm, at 10 µs as the others and at
the step of its own scenario. The UR5 has 0.1 mm in one, two, four and all six of its joints, the
Panda in seven, Talos in the fourteen of its left arm, gripper and leg, its pelvis held; these two
go by the step of 2 µs that their stiff contacts need.
"""

import sys
from itertools import pairwise

import numpy as np
from common import COLOURS, Benchmark, new_figure
from cost.step_cost import CHUNK, Stepper, bare_calls
from robots import UR5_WAYPOINTS, body, joint, loosened, urdf

import jointplay as jp
from jointplay.base.progress import ProgressBar
from jointplay.model.survey import survey

SHIPPED_STEP = 1e-6
"""Step of the slider-crank's own scenario [s]: at 10 µs its impacts last few steps."""

SPEED = 5000 * 2 * np.pi / 60
PLAY = {"radial_clearance": 0.2e-3, "axial_clearance": 0.2e-3}


def scara(*joints):
    clearance = {joint: jp.RevoluteClearance(**PLAY) for joint in joints}
    robot = jp.Mechanism(jp.shipped("scara.urdf"), clearance, gravity=(0, 0, 0), tool="suction_cup")
    return robot, jp.Motion.from_csv(jp.shipped("scara_motion.csv")), {}


JOINTS = 5


def arm_of(number, loose):
    """An arm of so many links, these of its joints with clearance."""
    parts = []
    for i in range(number):
        at = f"{0.2 if i else 0} 0 0"
        parts.append(body(f"l{i}", 2.0, "0.1 0 0", (0.002, 0.01, 0.01)))
        parts.append(joint(f"j{i}", f"l{i - 1}" if i else "base", f"l{i}", "continuous", at=at))
    clearance = {f"j{i}": jp.RevoluteClearance(**PLAY) for i in loose}
    return jp.Mechanism(urdf(*parts), clearance, gravity=(0, 0, 0))


def arm(worn):
    """An arm of `JOINTS` links swinging slowly, the first `worn` joints but one with clearance."""
    robot = arm_of(JOINTS, range(1, worn + 1))
    still, swung = np.zeros(JOINTS), np.full(JOINTS, 0.3)
    motion = jp.Motion(robot.joints, [0, 0.5, 1.0], [still, swung, still])
    return robot, motion, {}


def slider_crank(joint, step=1e-5):
    mechanism = jp.Mechanism(
        jp.shipped("slider_crank.urdf"),
        {"piston_pin": joint} if joint else {},
        loops={"piston_pin": jp.Loop("rod", "slider", bearing_xyz=(0.12, 0.0, 0.0))},
        gravity=(0, 0, 0),
        tool="slider",
    )
    motion = jp.Motion(["crank_pin"], [0, 1], [[0], [SPEED]], "constant-speed")
    return (
        mechanism,
        motion,
        {
            "drive": {"crank_pin": jp.loads.Prescribed()},
            "state": {"guide": 0.17},
            "step": step,
            "start": "centred",
        },
    )


UR5_JOINTS = ("elbow", "shoulder_lift", "wrist_1", "shoulder_pan", "wrist_2", "wrist_3")
UR5_LOOSE = (1, 2, 4, 6)
"""So many of these joints have clearance."""
PANDA_LOOSE, PANDA_STEP = 7, 2e-6
PANDA_WAYPOINTS = (
    (0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.7, 0.0, 0.0),
    (0.8, 0.2, 0.3, -1.5, 0.4, 2.2, 1.0, 0.0, 0.0),
    (0.0, -0.5, 0.0, -2.0, 0.0, 1.8, 0.7, 0.0, 0.0),
)
"""At rest at 0, 1 and 2 s [rad; fingers: m]."""
TALOS_JOINTS = (
    *(f"arm_left_{number}_joint" for number in range(1, 8)),
    "gripper_left_joint",
    *(f"leg_left_{number}_joint" for number in range(1, 7)),
)
TALOS_STEP = 2e-6
TALOS_POSTURE = {
    "arm_left_1_joint": 0.2, "arm_left_2_joint": 0.4, "arm_left_4_joint": -1.2,
    "arm_left_6_joint": 0.1, "gripper_left_joint": -0.4, "arm_right_2_joint": -0.3,
    "arm_right_4_joint": -0.5, "leg_left_3_joint": -0.4, "leg_left_4_joint": 0.8,
    "leg_left_5_joint": -0.4,
}  # fmt: skip
"""Where it stands at 0 and 2 s, its pelvis held [rad]; the other joints are at zero."""
TALOS_SWING = 0.2
"""How far the joints of the loose arm and leg are turned at 1 s [rad]."""


def robot(name, joints, waypoints, **options):
    """Such a robot on its way through three waypoints."""
    arm = loosened(name, joints)
    return arm, jp.Motion(list(arm.joints), [0.0, 1.0, 2.0], waypoints), options


def talos():
    """Talos, its left arm and its left leg loose."""
    body = loosened("talos_reduced", TALOS_JOINTS, survey("talos_reduced").unphysical)
    still = np.array([TALOS_POSTURE.get(joint, 0.0) for joint in body.joints])
    swing = np.array(
        [joint in TALOS_JOINTS and joint != "gripper_left_joint" for joint in body.joints]
    )
    turned = still + TALOS_SWING * swing
    return (
        body,
        jp.Motion(list(body.joints), [0.0, 1.0, 2.0], [still, turned, still]),
        {"step": TALOS_STEP},
    )


def many_joints():
    """Robots whose joints have clearance, one to all of them."""
    return {
        **{
            f"UR5, {loose} with clearance": robot(
                "ur5", [f"{joint}_joint" for joint in UR5_JOINTS[:loose]], UR5_WAYPOINTS
            )
            for loose in UR5_LOOSE
        },
        f"Panda, {PANDA_LOOSE} with clearance": robot(
            "panda",
            [f"panda_joint{number}" for number in range(1, PANDA_LOOSE + 1)],
            PANDA_WAYPOINTS,
            step=PANDA_STEP,
        ),
    }


def mechanisms():
    """Every mechanism by name."""
    planar = jp.RevoluteClearance.planar(radial_clearance=0.5e-3)
    spatial = jp.RevoluteClearance(radial_clearance=0.5e-3, axial_clearance=0.5e-3)
    return {
        "SCARA, ideal": scara(),
        "SCARA, B": scara("joint_b"),
        "SCARA, A and B": scara("joint_a", "joint_b"),
        **{f"arm, {worn} with clearance": arm(worn) for worn in range(JOINTS)},
        **{
            f"slider-crank, {name}{text}": slider_crank(joint, step)
            for step, text in ((1e-5, ""), (SHIPPED_STEP, ", 1 µs"))
            for name, joint in (("ideal", None), ("planar", planar), ("3D", spatial))
        },
        **many_joints(),
        f"Talos, {len(TALOS_JOINTS)} with clearance": talos(),
    }


ADDED = {"SCARA, A and B": ("SCARA, B", 1)}
ADDED |= {
    f"arm, {worn} with clearance": (f"arm, {worn - 1} with clearance", 1)
    for worn in range(2, JOINTS)
}
ADDED |= {
    f"UR5, {loose} with clearance": (f"UR5, {fewer} with clearance", loose - fewer)
    for fewer, loose in pairwise(UR5_LOOSE)
}
"""Mechanisms with further joints: those without these, and how many they are."""
LIMIT_ADDED = 0.6
"""A further joint must add less than this to the kernel, in bare calls on the same model."""


def measure(setup, pieces, samples, bar):
    mechanism, motion, options = setup
    duration = pieces * CHUNK * options.get("step", 1e-5)
    main = Stepper(jp.Simulation(mechanism, motion, duration=duration, **options))
    for _ in range(main.run.total_steps // CHUNK):
        step = main.advance(CHUNK)
        bare, own = min(bare_calls(main.run).values()), main.pinocchio()
        for part, seconds in (("step", step), ("aba", bare), ("kernel", step - own)):
            samples.setdefault(part, []).append(seconds)
        bar.update()


def samples_of(setups, pieces):
    """Seconds of a step, of its kernel and of the bare call, piece by piece."""
    found = {}
    with ProgressBar(total=len(setups) * pieces, unit="piece") as bar:
        for name, setup in setups.items():
            measure(setup, pieces, found.setdefault(name, {}), bar)
    return found


def medians(found):
    """Microseconds by mechanism and part."""
    return {
        name: {part: 1e6 * float(np.median(values)) for part, values in parts.items()}
        for name, parts in found.items()
    }


def print_many(ratios):
    """Print steps over bare calls of `many_joints`."""
    ur5 = [f"{ratios[f'UR5, {loose} with clearance']:.2f}" for loose in UR5_LOOSE]
    print(f"joints {' '.join(map(str, UR5_LOOSE))}: {' '.join(ur5)}")
    print(f"panda {PANDA_LOOSE}: {ratios[f'Panda, {PANDA_LOOSE} with clearance']:.2f}")


def main():
    words = "exit with status 1 if a ratio is above"
    benchmark = Benchmark("mechanism_cost", __doc__, runs=0, check=(np.inf, words))
    args = benchmark.parse()
    pieces = 20 if args.quick else 600
    found = samples_of(mechanisms(), pieces)
    middle = medians(found)
    added = {
        name: (middle[name]["kernel"] - middle[before]["kernel"]) / count / middle[name]["aba"]
        for name, (before, count) in ADDED.items()
    }
    ratios = {name: parts["step"] / parts["aba"] for name, parts in middle.items()}
    rows = [
        [
            name,
            *(f"{parts[part]:.2f}" for part in ("step", "aba")),
            f"{ratios[name]:.2f}",
            f"{parts['kernel']:.2f}",
            f"{added[name]:.2f}" if name in added else "",
        ]
        for name, parts in middle.items()
    ]
    data = [
        {"mechanism": name, "part": part, "cost_us": 1e6 * value}
        for name, parts in found.items()
        for part, values in parts.items()
        for value in values
    ]
    figure, axes = new_figure(1, 1, 8.0, 3.8)
    panel = axes[0, 0]
    names = list(middle)[::-1]
    for k, part in enumerate(("step", "aba", "kernel")):
        place = np.arange(len(names)) + 0.27 * (1 - k)
        label = {"step": "whole step", "aba": "bare aba", "kernel": "compiled part"}[part]
        panel.barh(
            place, [middle[n][part] for n in names], height=0.25, color=COLOURS[k], label=label
        )
    panel.set_yticks(range(len(names)), names)
    panel.set_xlabel("cost of a step [µs], median")
    panel.legend(fontsize=8)
    panel.grid(False, axis="y")
    benchmark.finish(
        [
            "mechanism",
            "step [µs]",
            "bare aba [µs]",
            "step / aba",
            "kernel [µs]",
            "further joint / aba",
        ],
        rows,
        data,
        figure,
    )
    worst = max(ratios, key=lambda name: ratios[name])
    body = ratios[f"Talos, {len(TALOS_JOINTS)} with clearance"]
    print_many(ratios)
    print(f"talos {len(TALOS_JOINTS)}: {body:.2f}")
    print(f"largest ratio {ratios[worst]:.2f} ({worst}); further joint {max(added.values()):.2f}")
    wrong = ratios[worst] > args.check or max(added.values()) > LIMIT_ADDED
    if np.isfinite(args.check) and wrong:
        sys.exit(1)
