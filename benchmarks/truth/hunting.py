"""Does `jointplay study hunting` agree with an independent integration of the same joint?

Fresh random joints under servos with P, PI and PID, or a catalogue's servo set by its registers;
encoder on either side, in counts or exact, sampled or continuous, friction that creeps or with
bristles, weight, heavy links that swing for seconds, integrals that wind up for minutes. The truth
is a plain Runge-Kutta of the two inertias, written here, with steps of 40 and 20 us, for 20 s, with
an integral for 240 s, of what is slow 900 s; a case counts where both agree. Agreement: both rest,
or both swing with amplitudes within 20 % and frequencies within 10 %, from the same start.

    python benchmarks hunting --cases 100
"""

from __future__ import annotations

import math
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from common import command
from numba import njit

import jointplay as jp
from jointplay.base.processes import cores
from jointplay.base.progress import ProgressBar
from jointplay.study import hunting
from jointplay.study.swings import LEAST_SWING, Swing

CLOSE, CLOSE_HZ = 0.2, 0.1
"""Relative difference of amplitudes, and of frequencies, that counts as the same."""

KINDS = ("P", "PI", "PID", "registers", "slow")
"""Of servos, one after the other."""


def draw(seed: int) -> hunting.Axis:
    """A random joint."""
    random = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return float(math.exp(random.uniform(math.log(low), math.log(high))))

    def sometimes(part: float, low: float, high: float) -> float:
        value = between(low, high)
        return value if random.random() < part else 0.0

    kind = KINDS[seed % len(KINDS)]
    slow = kind == "slow"
    gear = jp.Gear(
        between(2e-3, 2e-2), between(0.01, 0.06), between(50.0, 500.0), between(0.2, 2.0)
    )
    encoder = "link" if slow or random.random() < 0.7 else "motor"
    if kind == "registers":
        registers = {"P": int(random.integers(4, 128)), "I": 0}
        gains, _ = jp.loads.Servo.gains_of("STS3215", 7.4, registers)
        count = 2.0 * math.pi / 4096.0
        servo = jp.loads.Servo.of(
            "STS3215", voltage=7.4, encoder=encoder, resolution=count, dead_band_counts=1.0,
            **gains,
        )  # fmt: skip
    else:
        servo = jp.loads.Servo(
            voltage=between(6.0, 24.0),
            torque_constant=between(0.6, 2.0),
            resistance=between(1.0, 4.0),
            friction=between(0.01, 0.1),
            viscous=between(1e-3, 3e-2),
            p_gain=between(15.0, 400.0),
            i_gain=0.0 if kind == "P" else between(2.0, 20.0) if slow else between(5.0, 600.0),
            d_gain=between(0.1, 3.0) if kind == "PID" else 0.0,
            dead_band=sometimes(0.3, 2e-4, 2e-3),
            resolution=sometimes(0.3, 1e-5, 1e-3),
            encoder=encoder,
        )
        period = 0.0 if slow else sometimes(0.5, 1e-3, 8e-3)
        if period:
            speed = "difference" if random.random() < 0.5 else "exact"
            servo = replace(servo, period=round(period, 3), speed=speed)
    bends = not slow and random.random() < 0.5
    friction = jp.loads.JointFriction(
        between(0.01, 0.05), viscous=between(1e-3, 2e-2),
        presliding=between(2e-4, 2e-3) if bends else 0.0,
        presliding_damping=between(0.01, 0.05) if bends else 0.0,
    )  # fmt: skip
    load = float(random.uniform(0.02, 0.2)) if random.random() < 0.3 else 0.0
    inertia = between(0.01, 0.15) * (between(3.0, 20.0) if random.random() < 0.2 else 1.0)
    return hunting.Axis("a", False, inertia, load, gear, servo, friction)


class Numbers(NamedTuple):
    """Of the equations; SI units."""

    inertia: float
    rotor: float
    half: float
    spring: float
    damper: float
    load: float
    stall: float
    brake: float
    dry: float
    viscous: float
    p: float
    i: float
    d: float
    band: float
    most: float
    count: float
    on_link: bool
    period: float
    differences: bool
    link_dry: float
    link_viscous: float
    bend: float
    bend_damper: float

    @classmethod
    def of(cls, axis: hunting.Axis) -> Numbers:
        gear, servo, rubs = axis.gear, axis.drive, axis.friction
        return cls(
            axis.inertia, gear.rotor_inertia, 0.5 * gear.play, gear.stiffness, gear.damping,
            axis.load, servo.torque_constant / servo.resistance,
            servo.torque_constant**2 / servo.resistance, servo.friction, servo.viscous,
            servo.p_gain, servo.i_gain, servo.d_gain,
            servo.dead_band or servo.dead_band_counts * servo.resolution, servo.voltage,
            servo.resolution, servo.encoder == "link", servo.period or 0.0,
            servo.speed == "difference", rubs.coulomb, rubs.viscous, rubs.presliding,
            rubs.presliding_damping,
        )  # fmt: skip


@njit(cache=False)
def _error(n, y):
    """What the servo reads, and its error beyond the dead band."""
    read = y[0] if n.on_link else y[1]
    if n.count > 0.0:
        read = n.count * math.floor(read / n.count + 0.5)
    return read, -math.copysign(max(abs(read) - n.band, 0.0), read)


@njit(cache=False)
def _rates(y, n, held, sampled, d):
    """Of link, motor, their speeds, integral and bristles."""
    link, motor, v, w, integral, z = y
    twist = motor - link
    torque = 0.0
    if abs(twist) > n.half:
        side = math.copysign(1.0, twist)
        torque = side * max(n.spring * (abs(twist) - n.half) + n.damper * side * (w - v), 0.0)
    volts, rise = held, 0.0
    if not sampled:
        _, error = _error(n, y)
        integral = min(max(integral, -n.most), n.most)
        volts = n.p * error + integral - n.d * (v if n.on_link else w)
        volts = min(max(volts, -n.most), n.most)
        rise = n.i * error
        if abs(integral) >= n.most and rise * integral > 0.0:
            rise = 0.0
    bent = 0.0
    if n.bend > 0.0:
        bent = v - abs(v) * z / n.bend
        friction = n.link_dry / n.bend * z + n.bend_damper * bent + n.link_viscous * v
    else:
        friction = n.link_dry * math.tanh(v / 1e-3) + n.link_viscous * v
    rubs = n.dry * math.tanh(w / 1e-3) + n.viscous * w
    d[0], d[1] = v, w
    d[2] = (torque + n.load - friction) / n.inertia
    d[3] = (n.stall * volts - n.brake * w - rubs - torque) / n.rotor
    d[4], d[5] = rise, bent


@njit(cache=False)
def _ahead(y, step, rates, out):
    for j in range(6):
        out[j] = y[j] + step * rates[j]


@njit(cache=False)
def _integrate(n, start, step, count, every, out):
    y = np.array([start, start, 0.0, 0.0, 0.0, 0.0])
    k1, k2, k3, k4, at = (np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6), np.zeros(6))
    sampled = n.period > 0.0
    each = max(round(n.period / step), 1)
    held = before = integral = 0.0
    for k in range(count):
        if k % every == 0:
            out[k // every] = y[:2]
        if sampled and k % each == 0:
            read, error = _error(n, y)
            if k:
                integral = min(max(integral + n.i * n.period * error, -n.most), n.most)
            speed = y[2] if n.on_link else y[3]
            if n.differences:
                speed = (read - before) / n.period if k else 0.0
            before = read
            held = min(max(n.p * error + integral - n.d * speed, -n.most), n.most)
        _rates(y, n, held, sampled, k1)
        _ahead(y, 0.5 * step, k1, at)
        _rates(at, n, held, sampled, k2)
        _ahead(y, 0.5 * step, k2, at)
        _rates(at, n, held, sampled, k3)
        _ahead(y, step, k3, at)
        _rates(at, n, held, sampled, k4)
        for j in range(6):
            y[j] += step / 6.0 * (k1[j] + 2.0 * k2[j] + 2.0 * k3[j] + k4[j])


def truth(axis: hunting.Axis, start: float, duration: float, step: float) -> Swing:
    """What it does in the last third: rests, swings, or still moves otherwise (unclear)."""
    every, count = round(1e-3 / step), round(duration / step)
    out = np.zeros((-(-count // every), 2))
    _integrate(Numbers.of(axis), start, step, count, every, out)
    third = len(out) // 3
    before, after = (np.ptp(part, axis=0) for part in (out[third : 2 * third], out[-third:]))
    least = 2.0 * LEAST_SWING * axis.gear.play
    place = out[-third:, int(np.argmax(after))]
    away = place - 0.5 * (place.max() + place.min())
    side = np.sign(away[np.abs(away) > 0.25 * np.abs(away).max()])
    rises = np.count_nonzero(np.diff(side) > 0)
    if after.max() < least:
        return hunting.QUIET
    if rises < 3 or after.max() < 0.9 * before.max():
        return hunting.QUIET._replace(unclear=True)
    return Swing(True, 0.5 * float(after[0]), rises / (third * 1e-3))


def judged(seed: int) -> tuple[str, Swing, Swing]:
    """How a case came out: agrees, differs or open; the study's swing and the truth's."""
    axis = draw(seed)
    (swing,) = hunting.swings(hunting.Trial(axis, 2.0))
    slow = KINDS[seed % len(KINDS)] == "slow"
    duration = 900.0 if slow else 240.0 if axis.drive.i_gain else 20.0
    fine, finer = (truth(axis, 2.0 * axis.gear.play, duration, step) for step in (4e-5, 2e-5))
    if fine.unclear or finer.unclear or not _alike(fine, finer, 0.25 * CLOSE):
        return "open", swing, finer
    return (
        "agrees" if _alike(swing, finer, CLOSE) and not swing.unclear else "differs",
        swing,
        finer,
    )


def _alike(one: Swing, other: Swing, part: float) -> bool:
    if one.hunts != other.hunts:
        return False
    near = abs(one.frequency - other.frequency) <= CLOSE_HZ * other.frequency + 0.02
    return near and abs(one.amplitude - other.amplitude) <= part * other.amplitude


def agreement(cases: int, seed: int = 0, jobs: int = 1) -> tuple[int, int, int]:
    """Cases that agree, that were decided by the truth, and of these those that hunt."""
    seeds = range(1000 + seed, 1000 + seed + cases)
    with ProcessPoolExecutor(jobs) as pool, ProgressBar(total=cases, unit="case") as bar:
        rows = []
        for place, (verdict, swing, true) in zip(seeds, pool.map(judged, seeds), strict=True):
            rows.append((verdict, true.hunts))
            bar.update()
            if verdict == "differs":
                kind = KINDS[place % len(KINDS)]
                print(f"case {place - 1000} ({kind}): study {_told(swing)}, truth {_told(true)}")
    decided = [(verdict, hunts) for verdict, hunts in rows if verdict != "open"]
    return sum(v == "agrees" for v, _ in decided), len(decided), sum(h for _, h in decided)


def _told(swing: Swing) -> str:
    if not swing.hunts:
        return "unclear" if swing.unclear else "rests"
    return f"{1e3 * swing.amplitude:.3g} mrad at {swing.frequency:.3g} Hz"


def main() -> None:
    options = command(
        __doc__,
        "three cases",
        cases=(100, "joints that are drawn"),
        seed=(0, "of them"),
        jobs=(cores(), "processes"),
    ).parse_args()
    number = 3 if options.quick else options.cases
    good, decided, hunts = agreement(number, options.seed, options.jobs)
    print(f"{hunts} of {decided} oscillate by the truth")
    print(f"hunting agrees in {good} of {decided}")


if __name__ == "__main__":
    main()
