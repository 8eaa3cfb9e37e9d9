"""Does what a joint's own servo reports of a wiggle tell its play, with the bands stated?

600 joints by *another* model than those of the estimators (`peer_engines/servo.py`): friction by
LuGre, cogging, a belt, a cable's drag, teeth that stiffen, a base that others shake, a supply that
sags, counts that give the D part, loads and gains that are off, stamps that jitter.

The last line counts: of the joints that are not refused the share whose 95 % interval holds the
play; of all joints the share that was told a band which does not hold it; and the share that is
told to be above or below 0.5 deg, of those whose torque reverses (link's friction above the load),
with `--encoder motor` of those not refused. `--changes` wiggles each joint at two dates, and counts
what is told of its change. `--train` draws the family, trains, and writes the numbers for encoders
on the output into the package; they are the same where BLAS and numpy round as on older x86-64
processors (tried with numpy 2.4).
"""

from __future__ import annotations

import hashlib
import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from common import Benchmark

from jointplay.base.progress import ProgressBar
from jointplay.estimate import wiggle
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint
from jointplay.estimate.watch import SAME
from jointplay.estimate.wiggle import (
    LARGEST,
    Known,
    ServoLog,
    Untold,
    features,
    wiggle_goal,
)
from jointplay.estimate.wiggle_logs import FACTOR, Wiggle, change_of, ends_by
from jointplay.simulation.loads.drive import Servo

MEMBERS = 16_000
"""Of the family, from which the shipped numbers are; each has logs of two dates."""
LEAD_S = 0.4
"""How long the joint stands before and after the wiggle [s]."""


def among(random: np.random.Generator, low: float, high: float) -> float:
    """Evenly drawn in the logarithm."""
    return plain(np.exp(random.uniform(np.log(low), np.log(high))))


def near(random: np.random.Generator, size: float) -> float:
    """A factor near one, of such a standard deviation of its logarithm."""
    return plain(np.exp(size * random.normal()))


def plain(x: float) -> float:
    """Six digits: the same number on machines whose libraries round otherwise."""
    return float(f"{x:.6g}")


def some_play(random: np.random.Generator) -> float:
    """[rad]; none in one of twelve."""
    return 0.0 if random.random() < 1 / 12 else plain(np.radians(1.6 * random.random() ** 1.3))


def member(
    random: np.random.Generator, encoder: str = "link", unseen: float = 0.4
) -> tuple[ServoJoint, Known]:
    """A joint of the family, and what its owner believes of it.

    Args:
        random: draws it.
        encoder: where it sits.
        unseen: share of joints with a load that the owner does not know of, such as a cable's.
    """
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
    dry = servo.friction * among(random, 0.05, 1.5)
    load = 0.0 if random.random() < 0.4 else random.uniform(-1.5, 1.5) * servo.friction
    true = replace(
        ServoJoint.of(
            servo, rotor, link, play=some_play(random), stiffness=stiffness, damping=damping,
            link_friction=dry, load=load,
        ),
        excess=random.uniform(0.0, 0.8), stribeck_speed=among(random, 0.02, 0.5),
        viscous=servo.braking * random.uniform(0.0, 0.4),
    )  # fmt: skip
    believed = replace(
        servo, p_gain=p_gain * near(random, 0.04),
        resistance=servo.resistance * near(random, 0.04),
    )  # fmt: skip
    if random.random() < unseen:
        true = replace(true, load=true.load + servo.friction * random.uniform(-1.0, 1.0))
    load = load * near(random, 0.1) + 0.1 * servo.friction * random.normal()
    inertias = rotor * near(random, 0.1), link * near(random, 0.15)
    return true, Known(believed, *inertias, load)


def sent(
    random: np.random.Generator, rate: float, lag: float = 0.0, encoder: str = "link"
) -> np.ndarray:
    """Goals as the servo gets them, a goal each `RECORD_S` [rad], after a lag [s]."""
    time, goal = wiggle_goal(encoder)
    n = round((time[-1] + 2.0 * LEAD_S) / RECORD_S)
    now = np.arange(n) * RECORD_S
    held = np.floor(now * rate) / rate if random.random() < 0.7 else now
    found = np.interp(held - LEAD_S - random.uniform(0.0, 8e-3), time, goal)
    return smoothed(found, lag) if lag else found


def smoothed(goal: np.ndarray, lag: float) -> np.ndarray:
    """A goal after a lag of the first order [s]."""
    from scipy.signal import lfilter

    part = RECORD_S / (lag + RECORD_S)
    found: np.ndarray = lfilter([part], [1.0, part - 1.0], goal)
    return found


def recorded(
    random: np.random.Generator, rate: float, joint: ServoJoint, angle: np.ndarray,
    jitter: float = 2.5e-3,
) -> ServoLog:  # fmt: skip
    """The log of a joint whose encoder turned so."""
    time, goal = wiggle_goal("motor" if joint.on_motor else "link")
    now = np.arange(len(angle)) * RECORD_S
    read = np.arange(0.0, now[-1] - 0.01, 1.0 / rate) + random.uniform(0.0, 5e-3)
    stamp = read + jitter * random.uniform(-1.0, 1.0, len(read)) * random.random()
    stamp = np.maximum.accumulate(stamp)
    seen = np.interp(read, now, angle)
    if joint.resolution:
        seen = np.round(seen / joint.resolution) * joint.resolution
    return ServoLog("j", stamp, np.interp(stamp - LEAD_S, time, goal), seen)


def another_play(random: np.random.Generator, play: float) -> float:
    """That of the same joint at another date [rad]."""
    kind = random.random()
    if kind < 0.25:
        return play
    if kind < 0.75:
        return float(np.clip(play + np.radians(random.uniform(-0.8, 0.8)), 0.0, LARGEST))
    return some_play(random)


def later(random: np.random.Generator, joint: ServoJoint) -> ServoJoint:
    """The same joint at another date: with another play, and what else differs by `SAME`."""
    sizes = {"friction": SAME["friction"], "link_friction": SAME["friction"]}
    sizes |= {"viscous": SAME["friction"], "stiffness": SAME[""], "damping": SAME[""]}
    changed = {name: getattr(joint, name) * near(random, size) for name, size in sizes.items()}
    load = joint.load + SAME[""] * joint.friction * random.normal()
    return replace(joint, play=another_play(random, joint.play), load=load, **changed)


def truth(joint: ServoJoint, known: Known) -> np.ndarray:
    """What is told of a joint, by `wiggle.NETWORKS`, in the terms of `wiggle.EDGES`."""
    most = known.servo.stall * known.servo.voltage
    return np.array([joint.play, np.log(joint.friction / most), np.log(most / joint.stiffness)])


def of_family(seed: int) -> tuple[np.ndarray, np.ndarray] | None:
    """What is true of a member at two dates, and the features of its logs."""
    random = np.random.default_rng([44, seed])
    joint, known = member(random)
    rate = among(random, 80.0, 250.0)
    smooth = among(random, 3e-3, 6e-2) if random.random() < 0.5 else 0.0
    dates = joint, later(random, joint)
    seen = []
    for one in dates:
        _, link = one.move(sent(random, rate, smooth), random.uniform(-1.0, 1.0))
        try:
            seen.append(features(recorded(random, rate, one, link), known))
        except Untold:
            return None
    return np.array([truth(one, known) for one in dates]), exact(np.array(seen), INPUT)


# ---- Joints by another model ---------------------------------------------------------------------


@dataclass(frozen=True)
class Fresh:
    """A joint of the benchmark at one or two dates: its truth, what its owner has."""

    true: np.ndarray
    """By date, see `truth`."""
    reverses: bool
    """Whether the link's friction is above its load."""
    known: Known
    logs: tuple[ServoLog, ...]
    """By date."""


def fresh(seed: int, encoder: str = "link", dates: int = 1) -> Fresh:
    """A joint by the model of `peer_engines.servo`, wiggled as real firmware does it."""
    from truth.peer_engines import servo as other

    random = np.random.default_rng([2026, seed])
    base, known = member(random, encoder, unseen=0.0)
    if encoder == "motor":
        link, turns = base.rotor_inertia * among(random, 0.3, 10.0), among(random, 10.0, 300.0)
        count = base.resolution / turns  # of an encoder that turns so often as the joint does
        base = replace(base, link_inertia=link, resolution=count, band=base.band / turns)
        known = replace(
            known, link_inertia=link * near(random, 0.1),
            servo=replace(known.servo, resolution=count),
        )  # fmt: skip
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
    rate, held = among(random, 90.0, 220.0), random.random() < 0.5
    most, fastest = among(random, 10.0, 200.0), among(random, 1.5, 8.0)
    dates = [base] if dates == 1 else [base, later(random, base)]
    logs = []
    for one in dates:
        drift = {
            "half": 0.5 * one.play, "stiffness": one.stiffness, "damping": one.damping,
            "dry": one.friction, "link_dry": one.link_friction, "viscous": one.viscous,
            "load": one.load, "shake_hz": random.uniform(0.5, 6.0),
            "cable_at": numbers["cable_at"] + 2e-3 * random.normal(),
        }  # fmt: skip
        goal = sent(random, rate, 0.0, encoder)
        goal = limited(goal, most, fastest) if held else goal
        p = np.array([(numbers | drift)[name] for name in other.PARTS])
        angles = other.run(p, goal, RECORD_S, random.uniform(-1.0, 1.0))
        logs.append(recorded(random, rate, one, angles[0 if one.on_motor else 1], 3e-3))
    true = np.array([truth(one, known) for one in dates])
    return Fresh(true, abs(base.load) < base.link_friction, known, tuple(logs))


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


# ---- Training ------------------------------------------------------------------------------------

HIDDEN, EPOCHS, RATE, BATCH, NOISE, DROPPED, NETWORKS = (128, 64), 15, 2e-3, 128, 0.35, 0.2, 2
"""Of the networks and their training by Adam: largest noise on scaled features, share of dropped
units."""
INPUT, WEIGHT, OUTPUT = 12, 16, 20
"""Bits after the point of what is multiplied in training, so few that sums of products are exact in
any order, on any machine."""
SMEARED = {"gear_play": 0.075, "servo_friction": 0.15, "gear_compliance": 0.15, "change": 0.05}
"""Standard deviations by which what is true is smeared over bins [deg, or of logarithms]."""
FIRST_MEMBER = 10_000
"""Seed of the first member."""
WIDENERS = range(600)
"""Seeds of the fresh joints by which intervals are widened; no figure is of these."""
INNER = 0.05
"""Likelihood left below a play's interval."""
TAILS = (
    *(0.15, 0.1, 0.08, 0.06, 0.05, 0.04, 0.03, 0.025, 0.02, 0.015, 0.01, 0.007, 0.005),
    *(0.003, 0.002, 0.001, 0.0005),
)
"""Likelihood left else on a side, or for no growth: as much as holds the aims."""
HELD, MISSED, FALSE = 0.96, 0.008, 0.025
"""Aims of family and fresh: share of intervals that hold, of those that are told and do not, and of
plays that are the same and told to have grown."""


def exact(x: np.ndarray, bits: int) -> np.ndarray:
    """With so many bits after the point."""
    return np.round(x * 2.0**bits) * 2.0**-bits


def smeared(true: np.ndarray, name: str) -> np.ndarray:
    """What is wanted of a network, shape (n, bins), by what is true (n,)."""
    size = SMEARED[name]
    size = np.radians(size) if name in ("gear_play", "change") else size
    edges = wiggle.EDGES[name]
    found = np.exp(-0.5 * ((true[:, None] - 0.5 * (edges[1:] + edges[:-1])) / size) ** 2)
    return exact(found / found.sum(axis=1, keepdims=True), OUTPUT)


def fitted(seen: np.ndarray, wanted: np.ndarray, kind: str, seed: int) -> list[np.ndarray]:
    """Weights and offsets of a network: cross entropy of the bins, a little smeared, by Adam."""
    random = np.random.default_rng(seed)
    sizes = (seen.shape[1], *HIDDEN, wanted.shape[1])
    weights = [random.normal(size=(a, b)) * np.sqrt(2.0 / a) for a, b in pairwise(sizes)]
    weights[-1] *= 0.1
    all_of = [exact(x, OUTPUT) for x in (*weights, *(np.zeros(b) for b in sizes[1:]))]
    first, second = ([np.zeros_like(x) for x in all_of] for _ in range(2))
    left, total, one_less, other_less = 1.0, EPOCHS * (len(seen) // BATCH), 1.0, 1.0
    for _ in range(EPOCHS):
        order = random.permutation(len(seen))
        for k in range(len(seen) // BATCH):
            at = order[k * BATCH : (k + 1) * BATCH]
            noise = NOISE * (2.0 * random.random((BATCH, sizes[0]), dtype=np.float32) - 1.0)
            slopes = slopes_of(all_of, exact(seen[at] + noise, INPUT), wanted[at], kind, random)
            one_less, other_less, left = 0.9 * one_less, 0.999 * other_less, left - 1.0 / total
            pace = RATE * left / (1.0 - one_less)
            for one, slope, m, v in zip(all_of, slopes, first, second, strict=True):
                m += 0.1 * (slope - m)
                v += 1e-3 * (slope * slope - v)
                one -= pace * m / (np.sqrt(v / (1.0 - other_less)) + 1e-8)
    return all_of


def slopes_of(
    all_of: list[np.ndarray], x: np.ndarray, wanted: np.ndarray, kind: str,
    random: np.random.Generator,
) -> list[np.ndarray]:  # fmt: skip
    """Slopes of the mean cross entropy by weights and offsets."""
    n = len(all_of) // 2
    weights, offsets = [exact(one, WEIGHT) for one in all_of[:n]], all_of[n:]
    inputs, masks = [x], []
    for weight, offset in zip(weights[:-1], offsets[:-1], strict=True):
        sums = inputs[-1] @ weight + offset
        kept = (random.random(sums.shape, dtype=np.float32) > DROPPED) / (1.0 - DROPPED)
        masks.append(np.where(sums > 0.0, 1.0, 0.1) * kept)
        inputs.append(exact(sums * masks[-1], INPUT))
    sums = inputs[-1] @ weights[-1] + offsets[-1]
    likely = [wiggle.softmax(one) for one in np.split(sums, wiggle.cuts(kind), axis=1)]
    back = exact(np.concatenate(likely, axis=1) - wanted, OUTPUT)
    by_weight, by_offset = [], []
    for layer in range(n - 1, -1, -1):
        by_weight.append(inputs[layer].T @ back / len(x) + 1e-4 * all_of[layer])
        by_offset.append(back.sum(axis=0) / len(x))
        if layer:
            back = exact((back @ weights[layer].T) * masks[layer - 1], OUTPUT)
    return by_weight[::-1] + by_offset[::-1]


def trained(true: np.ndarray, seen: np.ndarray) -> dict[str, np.ndarray]:
    """The numbers of `wiggle.regression`; a fifth of the members is for the intervals alone.

    Args:
        true: of each member at two dates, shape (n, 2, quantities), see `truth`.
        seen: features, shape (n, 2, features).
    """
    cut, known = len(true) * 4 // 5, len(wiggle.KNOWN)
    own, values = seen[:cut].reshape(-1, seen.shape[2]), true[:cut].reshape(-1, true.shape[2])
    numbers = {
        "mean": exact(own.mean(axis=0), INPUT), "spread": exact(own.std(axis=0), INPUT) + 2.0**-10,
        "least": own[:, -known:].min(axis=0), "most": own[:, -known:].max(axis=0),
        "networks": np.array(NETWORKS),
    }  # fmt: skip
    numbers |= principal(own, numbers)
    numbers["strange"] = np.quantile(wiggle.strangeness(seen[cut:, 0], numbers), 0.99).round(3)
    wanted = [smeared(x, name) for x, name in zip(values.T, wiggle.NETWORKS["value"], strict=True)]
    both = np.concatenate([seen[:cut], seen[:cut, ::-1]])
    change = np.diff(np.concatenate([true[:cut, :, 0], true[:cut, ::-1, 0]]), axis=1)[:, 0]
    for kind, x, aim in (
        ("value", wiggle.scaled(own, numbers), np.concatenate(wanted, axis=1)),
        ("change", wiggle.paired(both, numbers), smeared(change, "change")),
    ):
        for k in ProgressBar(range(NETWORKS), f"networks of {kind}", unit="network"):
            found = fitted(x, aim, kind, k)
            for layer in range(3):
                numbers[f"{kind}_weight_{k}_{layer}"] = found[layer].astype(np.float16)
                numbers[f"{kind}_offset_{k}_{layer}"] = found[3 + layer].astype(np.float16)
    joints = [fresh(seed, dates=2) for seed in ProgressBar(WIDENERS, "fresh joints", unit="joint")]
    aside = [(one.true, found) for one in joints if (found := usable(one, numbers)) is not None]
    others = tuple(np.array(x) for x in zip(*aside, strict=True))
    return calibrated(numbers, ((true[cut:], seen[cut:]), others))


def calibrated(
    numbers: dict[str, np.ndarray], parts: Sequence[tuple[np.ndarray, np.ndarray]]
) -> dict[str, np.ndarray]:
    """With tails by which intervals hold, and raise few alarms, for family and fresh."""
    numbers["tails"] = np.full((len(wiggle.EDGES), 2), INNER)
    for k, name in enumerate(wiggle.EDGES):
        tails = numbers["tails"][k]
        for tail in TAILS:  # stiffness, belts and cables hide play: what is missed is more of it
            tails[int(name == "gear_play") :] = tail
            held, missed = zip(*(judged(name, *part, numbers) for part in parts), strict=True)
            if min(held) >= HELD and max(missed) <= MISSED:
                break
        print(f"{name}, tail {tail:g}: holds {np.round(held, 3)}, told wrong {np.round(missed, 4)}")
    for tail in TAILS:
        alarms = [false_alarms(*part, numbers, tail) for part in parts]
        if max(alarms) <= FALSE:
            break
    print(f"growth, tail {tail:g}: seen where there is none in {np.round(alarms, 3)}")
    numbers["alarm"] = np.array(tail)
    return numbers


def principal(seen: np.ndarray, numbers: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Principal components of the family's features."""
    odd = np.clip((seen - numbers["mean"]) / numbers["spread"], -wiggle._ODD, wiggle._ODD)
    odd = exact(odd, INPUT)
    values, axes = np.linalg.eigh(odd.T @ odd / len(odd))
    axes = axes[:, -30:]
    axes = axes * np.sign(axes[np.abs(axes).argmax(axis=0), range(30)])
    along, left = np.sqrt(values[-30:]), values[:-30].mean()
    return {"axes": exact(axes, INPUT).astype(np.float32), "along": along.round(6),
            "left": left.round(6)}  # fmt: skip


def usable(one: Fresh, numbers: dict[str, np.ndarray]) -> np.ndarray | None:
    """Features of a joint's logs, unless one is refused."""
    try:
        wiggle.check_load(one.known)
        for log in one.logs:
            wiggle.check_log(log)
        seen = np.array([features(log, one.known) for log in one.logs])
    except Untold:
        return None
    usual = wiggle.inside(seen[:, -len(wiggle.KNOWN) :], numbers).all()
    return (
        seen if usual and (wiggle.strangeness(seen, numbers) <= numbers["strange"]).all() else None
    )


def inferred(
    name: str, true: np.ndarray, seen: np.ndarray, numbers: dict[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """What is true (n,), and the ends of intervals (n, 2)."""
    if name == "change":
        aims, likely = true[:, 1, 0] - true[:, 0, 0], wiggle.change_shares(seen, numbers)
    else:
        aims = true[:, 0, wiggle.NETWORKS["value"].index(name)]
        likely = wiggle.shares(seen[:, 0], numbers)[name]
    ends = [wiggle.ends_of(name, one, numbers["tails"]) for one in likely]
    return aims, np.array([wiggle.rounded(*x) for x in ends] if name == "gear_play" else ends)


def judged(
    name: str, true: np.ndarray, seen: np.ndarray, numbers: dict[str, np.ndarray]
) -> tuple[float, float]:
    """Share whose interval holds, and share that is told a band of play which does not."""
    aims, ends = inferred(name, true, seen, numbers)
    right = (ends[:, 0] <= aims + 1e-9) & (aims <= ends[:, 1] + 1e-9)
    told = [name == "gear_play" and not wiggle.too_wide(*both) for both in ends]
    return float(right.mean()), float(np.mean(~right & told))


def false_alarms(
    true: np.ndarray, seen: np.ndarray, numbers: dict[str, np.ndarray], tail: float
) -> float:
    """Share of joints whose play is the same, and is told to have grown; either log is first."""
    likely = wiggle.change_shares(seen[true[:, 1, 0] == true[:, 0, 0]], numbers)
    less = likely[:, : likely.shape[1] // 2].sum(axis=1)
    return 0.5 * float(np.mean(less < tail) + np.mean(less > 1.0 - tail))


def write(numbers: dict[str, np.ndarray]) -> None:
    """Put the numbers into the package, with their hash."""
    content = io.BytesIO()
    np.savez(content, **numbers)  # not compressed: libraries differ in how
    path = wiggle.DATA
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content.getvalue())
    digest = hashlib.sha256(content.getvalue()).hexdigest()
    path.with_suffix(".sha256").write_text(f"{digest}  {path.name}\n")
    print(f"{path}: {len(content.getvalue())} bytes, {digest}")


def train(number: int) -> None:
    seeds = range(FIRST_MEMBER, FIRST_MEMBER + number)
    found = [of_family(seed) for seed in ProgressBar(seeds, "members of the family", unit="joint")]
    true, seen = zip(*(one for one in found if one is not None), strict=True)
    write(trained(np.array(true), np.array(seen)))


# ---- The benchmark -------------------------------------------------------------------------------


def main() -> None:
    benchmark = Benchmark(
        "wiggle", __doc__, runs=0, joints=(600, "that are drawn"),
        seed=(2_000_000, "of the first joint"), train=(False, "the regression anew, and write it"),
        members=(MEMBERS, "of the family, with --train"),
        encoder=("link", "its side: link, or motor, where the link is heavy"),
        changes=(False, "of play between two logs of each joint, in the place of plays"),
    )  # fmt: skip
    args = benchmark.parse()
    if args.train:
        return train(args.members)
    number = min(args.joints, 12) if args.quick else args.joints
    seeds = range(args.seed, args.seed + number)
    if args.changes:
        return changes(benchmark, seeds, args.encoder)
    rows, why, half = [], Counter(), np.radians(wiggle.HALF)
    for seed in ProgressBar(seeds, "joints", unit="joint"):
        one = fresh(seed, args.encoder)
        play, friction, wind_up = one.true[0]
        most = one.known.servo.stall * one.known.servo.voltage
        others = {
            "servo_friction": most * np.exp(friction),
            "gear_compliance": np.exp(wind_up) / most,
        }
        ends, reason = {"gear_play": (np.nan, np.nan)}, ""
        try:
            ends = ends_by(Wiggle(one.logs[0], one.known))
        except Untold as error:
            reason = str(error)
        low, high = ends["gear_play"]
        refused = bool(reason)
        if not refused and wiggle.too_wide(low, high):
            reason = "plays would look alike"
        holds = low <= play + 1e-9 and play <= high + 1e-9
        decided = not reason and (low >= half - 1e-9 or high <= half + 1e-9)
        why[" ".join(reason.split()[:4])] += bool(reason)
        row = {
            "play_deg": np.degrees(play), "low_deg": np.degrees(low),
            "high_deg": np.degrees(high), "refused": int(refused), "told": int(not reason),
            "holds": int(holds), "reverses": int(one.reverses), "decided": int(decided),
            "wrong": int(decided and (low >= half - 1e-9) != (play >= half)),
        }  # fmt: skip
        for name, true in others.items():
            low, high = ends.get(name, (np.nan, np.nan))
            row |= {name: true, f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    for words, count in why.most_common():
        if count:
            print(f"{count} cannot be told: {words} ...")
    for name in others:
        low, high, true = (table[f"{name}{end}"] for end in ("_low", "_high", ""))
        known = np.isfinite(low)
        if known.any():
            low, high, true = low[known], high[known], true[known]
            holds, wide, away = (low <= true) & (true <= high), high / low, low * high / true**2
            told = wide <= FACTOR
            print(
                f"{name}: {holds.mean():.1%} of {known.sum()} hold; ends a factor "
                f"{np.median(wide):.2g} apart (median), the middle off by "
                f"{np.exp(0.5 * np.median(np.abs(np.log(away)))):.2g}; told of {told.sum()}, of "
                f"which {holds[told].sum()} hold"
            )
    shown = []
    for name, use in (
        ("all", table["refused"] >= 0), ("torque reverses", table["reverses"] == 1),
        ("it does not", table["reverses"] == 0), ("not refused", table["refused"] == 0),
    ):  # fmt: skip
        part = {name: x[use] for name, x in table.items()}
        looked = part["refused"] == 0
        shares = [
            part["refused"].mean(), part["holds"][looked].mean() if looked.any() else np.nan,
            part["told"].mean(), (part["told"] & ~part["holds"] & 1).mean(),
            part["decided"].mean(), part["wrong"].mean(),
        ]  # fmt: skip
        shown.append([name, str(use.sum()), *(f"{100.0 * share:.1f} %" for share in shares)])
    heads = ["joints", "number", "refused", "interval holds", "told", "told wrong"]
    benchmark.finish([*heads, "above or below 0.5 deg", "of these wrong"], shown, rows)
    held, missed = shown[0][3], shown[0][5]
    decided = shown[1 if args.encoder == "link" else 3][6]
    print(f"joints {number} held {held} misses {missed} decided {decided}")


BANDS_DEG = (-2.0, -0.2, 0.2, 0.4, 0.6, 0.8, 2.0)
"""Ends of the bands of changes that are counted."""


def changes(benchmark: Benchmark, seeds: range, encoder: str) -> None:
    """Count what is told of changes by two logs of each joint."""
    rows = []
    for seed in ProgressBar(seeds, "joints", unit="joint"):
        one, told, refused = fresh(seed, encoder, 2), (np.nan,) * 3, False
        try:
            told = change_of(*(Wiggle(log, one.known) for log in one.logs))
        except Untold:
            refused = True
        angles = one.true[1, 0] - one.true[0, 0], one.true[0, 0], *told
        names = ("change_deg", "play_deg", "low_deg", "high_deg", "least_deg")
        rows.append(dict(zip(names, np.degrees(angles), strict=True)) | {"refused": refused})
    use = [row for row in rows if not row["refused"]]
    change, low, high, least = (
        np.array([row[f"{name}_deg"] for row in use]) for name in ("change", "low", "high", "least")
    )
    shown = []
    for first, last in pairwise(BANDS_DEG):
        mine = (change >= first) & (change < last)
        seen = f"{np.mean(least[mine] > 0.0):.0%}" if mine.any() else "-"
        wide = f"{np.median((high - low)[mine]):.2f} deg" if mine.any() else "-"
        shown.append([f"{first:g} to {last:g} deg", str(mine.sum()), seen, wide])
    benchmark.name = "wiggle_changes"
    benchmark.finish(["change", "joints", "growth is told of", "width"], shown, rows)
    still, held = change == 0.0, np.mean((low <= change) & (change <= high))
    print(
        f"changes {len(rows)} refused {len(rows) - len(use)} held {held:.1%} false alarms "
        f"{np.sum(least[still] > 0.0)} of {still.sum()}"
    )


if __name__ == "__main__":
    main()
