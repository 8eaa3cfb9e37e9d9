"""Does what a joint's own servo reports tell its play, with the bands stated?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from jointplay.estimate.servo_joint import RECORD_S, ServoJoint
from jointplay.estimate.wiggle import Known, ServoLog, features, wiggle_goal, Untold
from jointplay.simulation.loads.drive import Servo

LEAD_S = 0.4
"""How long the joint stands before and after the wiggle [s]."""


def among(random: np.random.Generator, low: float, high: float) -> float:
    """Evenly drawn in the logarithm."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def some_play(random: np.random.Generator) -> float:
    """[rad]; none in one of twelve."""
    return 0.0 if random.random() < 1 / 12 else float(np.radians(1.6 * random.random() ** 1.3))


def member(random: np.random.Generator, encoder: str = "link") -> tuple[ServoJoint, Known]:
    """A joint of the family, and what its owner believes of it."""
    rotor = among(random, 6e-4, 0.05)
    link = rotor * among(random, 0.05, 8.0)
    most = rotor * among(random, 50.0, 600.0)
    voltage = 12.0
    constant = voltage / random.uniform(3.0, 15.0)
    stall = most / voltage
    p_gain = voltage / among(random, 0.03, 0.5)
    d_gain = 0.0 if random.random() < 0.5 else p_gain * among(random, 2e-3, 0.03)
    count = 2.0 * np.pi / 4096.0 if random.random() < 0.7 else among(random, 1e-4, 1.5e-3)
    servo = Servo(
        voltage=voltage, p_gain=p_gain, d_gain=d_gain, torque_constant=constant,
        resistance=constant / stall, resolution=count, encoder=encoder,
        dead_band_counts=float(random.choice([0, 0, 1, 1, 2, 3])),
        period=among(random, 5e-4, 5e-3), friction=most * among(random, 0.004, 0.08),
    )  # fmt: skip
    stiffness = most / among(random, 2e-3, 0.08)
    reduced = rotor * link / (rotor + link)
    damping = 2.0 * among(random, 0.02, 0.7) * np.sqrt(stiffness * reduced)
    dry = servo.friction * among(random, 0.03, 1.5)
    load = 0.0 if random.random() < 0.4 else random.uniform(-1.5, 1.5) * servo.friction
    true = replace(
        ServoJoint.of(
            servo, rotor, link, play=some_play(random), stiffness=stiffness, damping=damping,
            link_friction=dry, load=load,
        ),
        excess=random.uniform(0.0, 0.8), stribeck_speed=among(random, 0.02, 0.5),
        viscous=servo.braking * random.uniform(0.0, 0.4),
    )  # fmt: skip
    off = lambda size: float(np.exp(size * random.normal()))  # noqa: E731
    believed = replace(servo, p_gain=p_gain * off(0.04), resistance=servo.resistance * off(0.04))
    load = load * off(0.1) + 0.1 * servo.friction * random.normal()
    return true, Known(believed, rotor * off(0.1), link * off(0.15), load)


def sent(random: np.random.Generator, rate: float) -> np.ndarray:
    """Goals as the servo gets them, a goal each `RECORD_S` [rad]."""
    time, goal = wiggle_goal()
    n = round((time[-1] + 2.0 * LEAD_S) / RECORD_S)
    now = np.arange(n) * RECORD_S
    held = np.floor(now * rate) / rate if random.random() < 0.7 else now
    return np.interp(held - LEAD_S - random.uniform(0.0, 8e-3), time, goal)


def recorded(
    random: np.random.Generator, rate: float, joint: ServoJoint, angle: np.ndarray,
    jitter: float = 1e-3,
) -> ServoLog:  # fmt: skip
    """The log of a joint whose encoder turned so."""
    time, goal = wiggle_goal()
    now = np.arange(len(angle)) * RECORD_S
    read = np.arange(0.0, now[-1] - 0.01, 1.0 / rate) + random.uniform(0.0, 5e-3)
    stamp = read + jitter * random.uniform(-1.0, 1.0, len(read)) * random.random()
    seen = np.interp(read, now, angle)
    if joint.resolution:
        seen = np.round(seen / joint.resolution) * joint.resolution
    return ServoLog("j", stamp, np.interp(stamp - LEAD_S, time, goal), seen)


def of_family(seed: int) -> tuple[float, np.ndarray] | None:
    """Play and features of a member."""
    random = np.random.default_rng([44, seed])
    joint, known = member(random)
    rate = among(random, 80.0, 250.0)
    motor, link = joint.move(sent(random, rate), random.uniform(-1.0, 1.0))
    try:
        found = features(recorded(random, rate, joint, link), known)
    except Untold:
        return None
    return joint.play, found
