"""Does `jointplay study hunting` say what an independent integration of the same joint says?

Fresh random joints: inertia, play, stiffness, damping, friction (bristles on the link), servo with
P, I, D, dead band, encoder on either side. The truth is a plain Runge-Kutta of the two inertias,
written here, with steps of 20 and 10 us; a case counts where both agree. Agreement: both quiet, or
both oscillate with amplitudes within 20 %, from the same start.

    python benchmarks hunting --cases 60
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor

import numpy as np
from common import command
from numba import njit

import jointplay as jp
from jointplay.base.processes import cores
from jointplay.base.progress import ProgressBar
from jointplay.study import hunting
from jointplay.study.swings import LEAST

CLOSE = 0.2
"""Relative difference of amplitudes that counts as the same."""


def draw(seed: int) -> hunting.Axis:
    """A random joint."""
    rng = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return float(math.exp(rng.uniform(math.log(low), math.log(high))))

    gear = jp.Gear(
        between(2e-3, 2e-2), between(0.01, 0.06), between(50.0, 500.0), between(0.2, 2.0)
    )
    servo = jp.loads.Servo.of(
        "STS3215",
        voltage=7.4,
        p_gain=between(15.0, 400.0),
        i_gain=between(20.0, 600.0) if rng.random() < 0.3 else 0.0,
        d_gain=between(0.1, 3.0) if rng.random() < 0.3 else 0.0,
        dead_band=between(2e-4, 2e-3) if rng.random() < 0.3 else 0.0,
        encoder="link" if rng.random() < 0.7 else "motor",
    )
    stick = between(0.01, 0.05)
    friction = jp.loads.JointFriction(
        stick, viscous=between(1e-3, 2e-2), presliding=between(2e-4, 2e-3),
        presliding_damping=between(0.01, 0.05),
    )  # fmt: skip
    load = float(rng.uniform(0.02, 0.2)) if rng.random() < 0.3 else 0.0
    return hunting.Axis("a", False, between(0.01, 0.15), load, gear, servo, friction)


@njit(cache=False)
def _rates(y, n, d):
    """Of link, motor, their speeds, integral and bristles."""
    (inertia, rotor, half, spring, damper, load, stall, brake, dry, viscous, p, i, dd, band, most,
     stick, rub, bend, bend_damper) = n[:19]  # fmt: skip
    link, motor, v, w, integral, z = y
    twist = motor - link
    torque = 0.0
    if abs(twist) > half:
        side = math.copysign(1.0, twist)
        torque = side * max(spring * (abs(twist) - half) + damper * side * (w - v), 0.0)
    seen, speed = (link, v) if n[19] > 0.0 else (motor, w)
    error = math.copysign(max(abs(seen) - band, 0.0), -seen)
    integral = min(max(integral, -most), most)
    asked = min(max(p * error + integral - dd * speed, -most), most)
    rise = i * error
    if abs(integral) >= most and rise * integral > 0.0:
        rise = 0.0
    rate = v - abs(v) * z / bend
    friction = stick / bend * z + bend_damper * rate + rub * v
    own = dry * math.tanh(w / 1e-3) + viscous * w
    d[0], d[1] = v, w
    d[2] = (torque + load - friction) / inertia
    d[3] = (stall * asked - brake * w - own - torque) / rotor
    d[4], d[5] = rise, rate


@njit(cache=False)
def _integrate(n, start, step, count, every, out):
    y = np.array([start, start, 0.0, 0.0, 0.0, 0.0])
    k1, k2, k3, k4 = np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6)
    for k in range(count):
        if k % every == 0:
            out[k // every] = y[:3]
        _rates(y, n, k1)
        _rates(y + 0.5 * step * k1, n, k2)
        _rates(y + 0.5 * step * k2, n, k3)
        _rates(y + step * k3, n, k4)
        y += step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def truth(axis: hunting.Axis, start: float, duration: float, step: float) -> tuple[bool, float]:
    """Whether it oscillates in the last third, and how far."""
    gear, servo, rubs = axis.gear, axis.drive, axis.friction
    numbers = np.array([
        axis.inertia, gear.rotor_inertia, gear.play / 2, gear.stiffness, gear.damping, axis.load,
        servo.stall, servo.braking, servo.friction, servo.viscous, servo.p_gain, servo.i_gain,
        servo.d_gain, servo.band, servo.voltage, rubs.coulomb, rubs.viscous, rubs.presliding,
        rubs.presliding_damping, float(servo.encoder == "link"),
    ])  # fmt: skip
    every = round(1e-3 / step)
    count = round(duration / step)
    out = np.zeros((-(-count // every), 3))
    _integrate(numbers, start, step, count, every, out)
    third = len(out) // 3
    link, speed = out[-third:, 0], out[:, 2]
    before, after = np.std(speed[third:-third]), np.std(speed[-third:])
    away = link - 0.5 * (link.max() + link.min())
    turns = np.count_nonzero(np.diff(np.sign(away[np.abs(away) > 0.25 * np.abs(away).max()])) > 0)
    amplitude = 0.5 * float(np.ptp(link))
    lasts = amplitude > LEAST * gear.play and after > 0.9 * before and turns >= 3
    return lasts, amplitude if lasts else 0.0


def one(seed: int) -> tuple[str, float, float]:
    """How a case came out: agrees, differs or open; amplitudes of study and truth."""
    axis = draw(seed)
    start = 2.0 * axis.gear.play
    (found,) = hunting.swings(hunting.Trial(axis, 2.0))
    fine, finer = (truth(axis, start, 12.0, step) for step in (2e-5, 1e-5))
    if fine[0] != finer[0] or abs(fine[1] - finer[1]) > 0.25 * CLOSE * finer[1]:
        return "open", found.amplitude, finer[1]
    same = found.hunts == finer[0] and abs(found.amplitude - finer[1]) <= CLOSE * finer[1]
    return ("agrees" if same else "differs"), found.amplitude, finer[1]


def agreement(cases: int, seed: int = 0, jobs: int = 1) -> tuple[int, int, int]:
    """Cases that agree, that were decided by the truth, and of these those that hunt."""
    seeds = range(1000 + seed, 1000 + seed + cases)
    with ProcessPoolExecutor(jobs) as pool, ProgressBar(total=cases, unit="case") as bar:
        found = []
        for place, (word, mine, true) in zip(seeds, pool.map(one, seeds), strict=True):
            found.append((word, true))
            bar.update()
            if word == "differs":
                print(f"case {place}: study {1e3 * mine:.3g} mrad, truth {1e3 * true:.3g} mrad")
    decided = [(word, true) for word, true in found if word != "open"]
    return sum(w == "agrees" for w, _ in decided), len(decided), sum(t > 0 for _, t in decided)


def main() -> None:
    options = command(
        __doc__,
        "eight cases",
        cases=(60, "joints that are drawn"),
        seed=(0, "of them"),
        jobs=(cores(), "processes"),
    ).parse_args()
    number = 8 if options.quick else options.cases
    good, decided, hunts = agreement(number, options.seed, options.jobs)
    print(f"{hunts} of {decided} oscillate by the truth")
    print(f"hunting agrees in {good} of {decided}")
