"""Rules for the numbers of a gear of which only the play is known.

The effort T for which a joint's drive is made gives them, by rules fitted to some twenty gears and
servos (docs/data/drives.csv, which says what is second hand):

- stiffness 25 T^1.5 N m/rad, at most 300 T: for one size of gear the twist at full torque falls
  with size, from 40 mrad at 1 N m to 3.3 mrad from 144 N m on;
- the rotor's inertia 20 ms T / (largest speed): in that time T alone brings it to full speed;
- damping 5 % of critical, of the rotor against its joint on this stiffness.

The gears listed have a stiffness within a factor of 4 of the rule, and a time of the rotor within 5
(4 to 90 ms). The effect of play on the tool depends on neither (its RMS changes by at most 6 % over
these ranges, on AR4, UR5, SO-101 and Panda); that of elasticity is as uncertain as the stiffness.

T is the effort in the robot's file where that is plausible beside the robot's weight; else it
follows from the weight and an assumed payload (`rated_efforts`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.model.gear import Gearing
from jointplay.model.urdf import STANDARD_GRAVITY, Description, JointEntry

STIFFNESS, STIFFEST = 25.0, 300.0
"""Stiffness per effort^1.5 [1/(rad sqrt(N m))], and largest stiffness per effort [1/rad]: fitted to
the table."""
SPREAD = 4.0
"""Factor by which a gear of the table may be softer or stiffer than the rule."""
SLIDE_STIFFNESS = 1e7
"""Stiffness of a screw or belt [N/m]: judged; a steel screw of 20 mm and 1 m alone has 6e7."""
START_S = 0.02
"""Time in which a drive's effort brings its rotor alone to full speed [s]: the table's middle."""
DAMPING = 0.05
"""Damping relative to critical damping: judged; the effect of play changes by less than 4 % from a
fifth to four times of it."""
BRACKETS = {
    "stiffness": (1.0 / SPREAD, SPREAD), "rotor_inertia": (0.2, 4.5), "damping": (0.2, 4.0),
}  # fmt: skip
"""Range of the true number relative to the rule's: over the gears of the table; for damping as
judged above."""
SPEED = {"rad": 3.0, "m": 0.5}
"""Largest speed of a joint whose file has none [rad/s, m/s]: judged, as arms of the table have."""
POSES = 64
"""Number of poses, over the limits of all joints, at which weights are found."""
ENOUGH, LEAST, PLAUSIBLE = 1.5, 0.5, 10.0
"""A drive needs `ENOUGH` times the largest weight at its joint. Efforts of a file that are between
`LEAST` and `PLAUSIBLE` times that need are taken as they are: judged; UR5, UR10, Panda, xArm7, Z1
and SO-101 have 1.1 to 8.0 times."""
PLACEHOLDER = 3.0
"""Times the need to which larger efforts, which are placeholders, are scaled (PAROL6: 300 N m
each)."""
PAYLOAD = 0.1
"""Payload relative to the robot's mass, where no efforts are known: judged."""
UNSTATED = 4.5
"""Effort relative to the largest weight, payload included, where no efforts are known: 3 times
`ENOUGH`."""
SHORTEST_ARM = 0.1
"""Least arm, relative to the reach, at which a drive holds the payload: wrists turn what they
carry."""
SMALLEST = 1.0
"""Least effort of a drive that turns a joint whose file has no efforts [N m]: that of hobby servos;
weights say nothing of joints about the vertical."""
SMALLEST_KNOWN = 12.0
"""Least effort of the drives to which the stiffness was fitted [N m]: hobby servos are several
times softer."""
ROUNDING = 1e-9
"""Weight at a joint, relative to the largest, up to which it is rounding: joints about the
vertical."""
_WIDEST = np.pi
"""Farthest position of a joint, limits or none, in the poses at which weights are found [rad]."""


@dataclass(frozen=True)
class Rule:
    """A number that a rule gave."""

    value: float
    """The number, in SI units."""
    name: str
    """Name of the rule, such as ``gear stiffness``."""
    reason: str
    """What the number follows from, in words."""
    guess: bool = False
    """Whether the rule was fitted to no gear like this one."""


@dataclass(frozen=True)
class Efforts:
    """Efforts for which the drives of a robot are made, by joint."""

    by_joint: Mapping[str, float]
    """Efforts [N m or N]."""
    reason: str
    """How they were found, in words."""
    stated: bool
    """Whether they follow from efforts in the robot's file."""


def rated_efforts(description: Description, source: pin.Model, tool: str) -> Efforts:
    """Efforts for which the drives of a robot are made, from its file or its weight.

    Efforts in its file are judged for the robot as a whole, by the joint whose effort is least
    beside its weight: those of a single joint may be far above its weight and right.

    Args:
        description: the robot.
        source: Pinocchio's reading of it (`design.parse`).
        tool: frame that holds the payload.
    """
    entries = description.joints
    joints = {
        source.names[index]: index
        for index in range(1, source.njoints)
        if source.joints[index].nv == 1 and source.names[index] in entries
    }
    rows = {name: source.joints[index].idx_v for name, index in joints.items()}
    at = np.array(list(rows.values()), int)
    poses = _poses(description, source, rows)
    weight = _weights(source, poses)[at]
    stated = np.array([entries[name].effort or 0.0 for name in rows])
    pressed = weight > ROUNDING * weight.max(initial=0.0)
    # The file's efforts, if it has them for all joints and they suit the weight.
    if stated.all() and len(stated):
        ratio = min(stated[pressed] / (ENOUGH * weight[pressed]), default=1.0)
        if ratio > PLAUSIBLE:
            scaled = dict(zip(rows, (stated * PLACEHOLDER / ratio).tolist(), strict=True))
            text = f"its file's efforts, {ratio:.3g} times what its weight asks for, scaled"
            return Efforts(scaled, text, True)
        if ratio >= LEAST:
            by_joint = dict(zip(rows, stated.tolist(), strict=True))
            return Efforts(by_joint, "its file's efforts", True)
    # Else the weight with a payload at the tool, and at least the payload on a short arm.
    carried = PAYLOAD * pin.computeTotalMass(source)
    loaded = source.copy()
    frame = loaded.frames[loaded.getFrameId(tool)] if loaded.existFrame(tool) else None
    if frame is not None and frame.parentJoint:
        body = pin.Inertia(carried, np.zeros(3), np.zeros((3, 3)))
        loaded.inertias[frame.parentJoint] += frame.placement.act(body)
    heavier = _weights(loaded, poses)[at]
    reach = _reach(source, poses, frame)
    turning = np.array([not entries[name].slides for name in rows])
    held = UNSTATED * carried * -STANDARD_GRAVITY[2]
    least = np.where(turning, np.maximum(held * SHORTEST_ARM * reach, SMALLEST), held)
    efforts = dict(zip(rows, np.maximum(UNSTATED * heavier, least).tolist(), strict=True))
    # No joint is weaker than one of its kind farther out, which it carries; those come later.
    for name, index in reversed(joints.items()):
        for above in source.supports[index].tolist()[1:-1]:
            inner = source.names[above]
            if inner in efforts and entries[inner].slides == entries[name].slides:
                efforts[inner] = max(efforts[inner], efforts[name])
    text = "its weight and a payload of a tenth of it, as its file has no efforts of drives"
    return Efforts(efforts, text, False)


def completed(
    gears: Mapping[str, Gearing], description: Description, source: pin.Model, tool: str
) -> tuple[dict[str, Gearing], dict[tuple[str, str], Rule]]:
    """Gears completed by the rules; and the rules that gave a number, by joint and field."""
    complete: dict[str, Gearing] = {}
    rules: dict[tuple[str, str], Rule] = {}
    efforts: Efforts | None = None
    for name, gear in gears.items():
        missing = gear.missing
        if missing and name in description.joints:
            efforts = efforts or rated_efforts(description, source, tool)
            ruled = _numbers(name, gear, description, efforts)
            rules |= {(name, field): ruled[field] for field in missing}
            changes: dict[str, Any] = {field: ruled[field].value for field in missing}
            gear = replace(gear, **changes)  # type: ignore[type-var]
        complete[name] = gear
    return complete, rules


def with_rotors(gears: Mapping[str, Gearing], armature: Mapping[str, float]) -> dict[str, Gearing]:
    """Gears with the rotor inertia, if not given, that the robot's file has as armature."""
    complete = dict(gears)
    for name, gear in gears.items():
        if isinstance(gear, Gearing) and "rotor_inertia" in gear.missing and name in armature:
            complete[name] = replace(gear, rotor_inertia=armature[name])  # type: ignore[type-var, call-arg]
    return complete


def stiffness_rule(name: str, entry: JointEntry, efforts: Efforts) -> Rule:
    """Stiffness of a joint's gear, by the effort of its drive."""
    effort, reason = _effort(name, entry, efforts)
    fitted = efforts.stated and efforts.by_joint.get(name, 0.0) >= SMALLEST_KNOWN
    guess = not (entry.slides or fitted)
    value = min(STIFFNESS * effort**1.5, STIFFEST * effort)
    return Rule(
        _rounded(SLIDE_STIFFNESS if entry.slides else value), "gear stiffness", reason, guess
    )


def _effort(name: str, entry: JointEntry, efforts: Efforts) -> tuple[float, str]:
    """Effort for which the drive of a joint is made [N m or N], and the reason in words."""
    effort = max(efforts.by_joint.get(name, 0.0), 1e-3)  # a joint that bears nothing has a motor
    unit = "N" if entry.slides else "N m"
    return effort, f"by the {effort:.3g} {unit} that its drive is made for ({efforts.reason})"


def _numbers(
    name: str, gear: Gearing, description: Description, efforts: Efforts
) -> dict[str, Rule]:
    """Numbers of a joint's gear by the rules, by field."""
    entry = description.joints[name]
    effort, reason = _effort(name, entry, efforts)
    fastest = entry.speed or SPEED[entry.unit]
    rotor, stiff = START_S * effort / fastest, stiffness_rule(name, entry, efforts)
    inertia = rotor if gear.rotor_inertia is None else gear.rotor_inertia
    return {
        "stiffness": stiff,
        "rotor_inertia": Rule(
            _rounded(rotor), "rotor inertia", f"{reason} and {fastest:.3g} {entry.unit}/s"
        ),
        "damping": Rule(
            _rounded(2.0 * DAMPING * float(np.sqrt(stiff.value * inertia))),
            "gear damping",
            f"{DAMPING:.0%} of critical",
        ),
    }


def _rounded(value: float) -> float:
    """A number with three digits, as exact as a rule is."""
    return float(f"{value:.3g}")


def _poses(
    description: Description, source: pin.Model, rows: Mapping[str, int]
) -> list[np.ndarray]:
    """Configurations at random over the limits of all joints, the same for the same robot."""
    poses = []
    for part in np.random.default_rng(0).random((POSES, len(rows))):
        displacement = np.zeros(source.nv)
        for (name, row), share in zip(rows.items(), part, strict=True):
            entry = description.joints[name]
            low = -_WIDEST if entry.lower is None else max(entry.lower, -_WIDEST)
            high = _WIDEST if entry.upper is None else min(entry.upper, _WIDEST)
            if entry.slides and (entry.lower is None or entry.upper is None):
                low = high = 0.0
            displacement[row] = low + share * (high - low)
        poses.append(pin.integrate(source, pin.neutral(source), displacement))
    return poses


def _weights(model: pin.Model, poses: list[np.ndarray]) -> np.ndarray:
    """Largest effort of gravity at each coordinate over poses, (nv,) [N m or N]."""
    data = model.createData()
    efforts = [pin.computeGeneralizedGravity(model, data, q).copy() for q in poses]
    return np.abs(efforts).max(axis=0, initial=0.0)


def _reach(source: pin.Model, poses: list[np.ndarray], frame: pin.Frame | None) -> float:
    """Largest distance of the tool from the robot's first joint over poses [m]."""
    if frame is None or source.njoints < 2:
        return 0.0
    data, farthest = source.createData(), 0.0
    for q in poses:
        pin.forwardKinematics(source, data, q)
        place = data.oMi[frame.parentJoint] * frame.placement
        farthest = max(farthest, float(np.linalg.norm(place.translation - data.oMi[1].translation)))
    return farthest
