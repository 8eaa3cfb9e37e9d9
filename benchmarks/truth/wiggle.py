"""Does what a joint's own servo reports tell its play, with the bands stated?"""

from __future__ import annotations

from dataclasses import dataclass, replace

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
    stamp = np.maximum.accumulate(stamp)
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


# ---- Joints by another model ---------------------------------------------------------------------


@dataclass(frozen=True)
class Fresh:
    """A joint of the benchmark: its truth, what its owner has."""

    play: float
    reverses: bool
    """Whether the link's friction is above its load."""
    known: Known
    log: ServoLog


def fresh(seed: int, encoder: str = "link") -> Fresh:
    """A joint by the model of `peer_engines.servo`, wiggled as real firmware does it."""
    from truth.peer_engines import servo as other

    random = np.random.default_rng([2026, seed])
    base, known = member(random, encoder)
    if encoder == "motor":
        base = replace(base, link_inertia=base.rotor_inertia * among(random, 0.3, 10.0))
        known = replace(known, link_inertia=base.link_inertia * float(np.exp(0.1 * random.normal())))
    some = lambda share, low, high: among(random, low, high) * (random.random() < share)  # noqa: E731
    most, dry = base.stall * base.voltage, base.friction
    outer = base.link_inertia * random.uniform(0.1, 0.6)
    belt = base.stiffness * among(random, 1.0, 20.0)
    numbers = {
        "rotor": base.rotor_inertia, "link": base.link_inertia - outer, "outer": outer,
        "belt": belt, "belt_damping": 2.0 * among(random, 0.02, 0.2) * np.sqrt(belt * outer),
        "half": 0.5 * base.play, "stiffness": base.stiffness,
        "hardening": some(0.5, 0.5, 10.0), "damping": base.damping, "dry": dry,
        "excess": base.excess, "stribeck": base.stribeck_speed,
        "bristle": dry / among(random, 2e-4, 3e-3), "viscous": base.viscous,
        "link_dry": base.link_friction, "link_viscous": 0.05 * base.viscous,
        "load": base.load, "stall": base.stall, "braking": base.braking,
        "voltage": base.voltage, "sag": some(0.5, 0.5, 4.0), "p_gain": base.p_gain,
        "d_gain": base.d_gain, "band": base.band, "count": base.resolution,
        "period": base.period, "filter": among(random, 1e-3, 1e-2), "on_motor": base.on_motor,
        "cogging": some(0.5, 0.05, 0.6) * dry, "cogging_turns": random.uniform(40.0, 400.0),
        "cogging_phase": random.uniform(0.0, 2.0 * np.pi),
        "cable": some(0.4, 0.01, 0.5) * most, "cable_at": 0.02 * random.normal(),
        "shake": some(0.3, 0.02, 0.3) * base.link_friction, "shake_hz": random.uniform(0.5, 6.0),
    }  # fmt: skip
    rate = among(random, 90.0, 220.0)
    goal = sent(random, rate)
    if random.random() < 0.5:
        goal = limited(goal, among(random, 10.0, 200.0), among(random, 1.5, 8.0))
    p = np.array([numbers[name] for name in other.PARTS])
    angles = other.run(p, goal, RECORD_S, random.uniform(-1.0, 1.0))
    log = recorded(random, rate, base, angles[0 if base.on_motor else 1], 4e-3)
    return Fresh(base.play, abs(base.load) < base.link_friction, known, log)


def limited(goal: np.ndarray, most: float, fastest: float) -> np.ndarray:
    """A goal as firmware passes it on, of limited acceleration and speed [rad/s^2, rad/s]."""
    found, at, speed = np.empty_like(goal), goal[0], 0.0
    for i, one in enumerate(goal):
        away = one - at
        wanted = np.sign(away) * min(np.sqrt(2.0 * most * abs(away)), fastest)
        wanted = np.clip(wanted, -abs(away) / RECORD_S, abs(away) / RECORD_S)
        speed += float(np.clip(wanted - speed, -most * RECORD_S, most * RECORD_S))
        at += speed * RECORD_S
        found[i] = at
    return found
