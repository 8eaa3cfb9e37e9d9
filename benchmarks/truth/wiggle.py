"""Does what a joint's own servo reports of a wiggle tell its play, with the bands stated?

600 joints by *another* model than those of the estimators (`peer_engines/servo.py`): friction by
LuGre, cogging, a belt, a cable's drag, teeth that stiffen, a base that others shake, a supply that
sags, counts that give the D part, loads and gains that are off, stamps that jitter.

The last line counts: of the joints that are not refused the share whose 95 % interval holds the
play; of all joints the share that was told a band which does not hold it; and the share that is
told to be above or below 0.5 deg, of those whose torque reverses (link's friction above the load),
with `--encoder motor` of those not refused. `--train` draws the family, trains, and writes the
numbers for encoders on the output into the package.
"""

from __future__ import annotations

import hashlib
import io
from collections import Counter
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from common import Benchmark

from jointplay.base.progress import ProgressBar
from jointplay.estimate import wiggle
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint
from jointplay.estimate.wiggle import EDGES, Known, ServoLog, Untold, features, wiggle_goal
from jointplay.estimate.wiggle_logs import band
from jointplay.simulation.loads.drive import Servo

MEMBERS = 26_000
"""Of the family, from which the shipped numbers are."""
LEAD_S = 0.4
"""How long the joint stands before and after the wiggle [s]."""


def among(random: np.random.Generator, low: float, high: float) -> float:
    """Evenly drawn in the logarithm."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def some_play(random: np.random.Generator) -> float:
    """[rad]; none in one of twelve."""
    return 0.0 if random.random() < 1 / 12 else float(np.radians(1.6 * random.random() ** 1.3))


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
    off = lambda size: float(np.exp(size * random.normal()))  # noqa: E731
    believed = replace(servo, p_gain=p_gain * off(0.04), resistance=servo.resistance * off(0.04))
    if random.random() < unseen:
        true = replace(true, load=true.load + servo.friction * random.uniform(-1.0, 1.0))
    load = load * off(0.1) + 0.1 * servo.friction * random.normal()
    return true, Known(believed, rotor * off(0.1), link * off(0.15), load)


def sent(
    random: np.random.Generator, rate: float, smooth: float = 0.5, encoder: str = "link"
) -> np.ndarray:
    """Goals as the servo gets them, a goal each `RECORD_S` [rad]."""
    time, goal = wiggle_goal(encoder)
    n = round((time[-1] + 2.0 * LEAD_S) / RECORD_S)
    now = np.arange(n) * RECORD_S
    held = np.floor(now * rate) / rate if random.random() < 0.7 else now
    found = np.interp(held - LEAD_S - random.uniform(0.0, 8e-3), time, goal)
    return smoothed(found, among(random, 3e-3, 6e-2)) if random.random() < smooth else found


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


def of_family(seed: int) -> tuple[float, np.ndarray] | None:
    """Play and features of a member."""
    random = np.random.default_rng([44, seed])
    joint, known = member(random)
    rate = among(random, 80.0, 250.0)
    _, link = joint.move(sent(random, rate), random.uniform(-1.0, 1.0))
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
    base, known = member(random, encoder, unseen=0.0)
    if encoder == "motor":
        link, turns = base.rotor_inertia * among(random, 0.3, 10.0), among(random, 10.0, 300.0)
        count = base.resolution / turns  # of an encoder that turns so often as the joint does
        base = replace(base, link_inertia=link, resolution=count, band=base.band / turns)
        known = replace(
            known, link_inertia=link * float(np.exp(0.1 * random.normal())),
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
    rate = among(random, 90.0, 220.0)
    goal = sent(random, rate, 0.0, encoder)
    if random.random() < 0.5:
        goal = limited(goal, among(random, 10.0, 200.0), among(random, 1.5, 8.0))
    p = np.array([numbers[name] for name in other.PARTS])
    angles = other.run(p, goal, RECORD_S, random.uniform(-1.0, 1.0))
    log = recorded(random, rate, base, angles[0 if base.on_motor else 1], 3e-3)
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


# ---- Training ------------------------------------------------------------------------------------

HIDDEN, EPOCHS, RATE, BATCH, NOISE, DROPPED, NETWORKS = (128, 64), 60, 2e-3, 128, 0.2, 0.2, 2
"""Of the networks and their training by Adam: noise on scaled features, share of dropped units."""
FIRST_MEMBER = 10_000
"""Seed of the first member."""
WIDENERS = range(600)
"""Seeds of the fresh joints by which intervals are widened; no figure is of these."""
TAIL = 0.03
"""Likelihood left below an interval; above it as much of these as holds the aims."""
TAILS = (0.05, 0.04, 0.03, 0.02, 0.015, 0.01, 0.007, 0.005, 0.003, 0.002, 0.001, 0.0005)


def fitted(seen: np.ndarray, plays: np.ndarray, seed: int) -> list[np.ndarray]:
    """Weights and offsets of a network: cross entropy of the bins, a little smeared, by Adam."""
    random = np.random.default_rng(seed)
    middle = 0.5 * (EDGES[1:] + EDGES[:-1])
    wanted = np.exp(-0.5 * ((plays[:, None] - middle) / np.radians(0.075)) ** 2)
    wanted = (wanted / wanted.sum(axis=1, keepdims=True)).astype(np.float32)
    sizes = (seen.shape[1], *HIDDEN, len(middle))
    weights = [random.normal(size=(a, b)) * np.sqrt(2.0 / a) for a, b in pairwise(sizes)]
    weights[-1] *= 0.1
    all_of = [x.astype(np.float32) for x in (*weights, *(np.zeros(b) for b in sizes[1:]))]
    first, second = ([np.zeros_like(x) for x in all_of] for _ in range(2))
    count, total = 0, EPOCHS * (len(plays) // BATCH)
    for _ in range(EPOCHS):
        order = random.permutation(len(plays))
        for k in range(len(plays) // BATCH):
            at = order[k * BATCH : (k + 1) * BATCH]
            x = seen[at] + NOISE * random.standard_normal((BATCH, sizes[0]), dtype=np.float32)
            slopes = slopes_of(all_of, x, wanted[at], random)
            count += 1
            pace = 0.5 * RATE * (1.0 + np.cos(np.pi * count / total)) + 1e-5
            for one, slope, m, v in zip(all_of, slopes, first, second, strict=True):
                m += 0.1 * (slope - m)
                v += 1e-3 * (slope**2 - v)
                even = np.sqrt(v / (1.0 - 0.999**count)) + 1e-8
                one -= (pace / (1.0 - 0.9**count) * m / even).astype(np.float32)
    return all_of


def slopes_of(
    all_of: list[np.ndarray], x: np.ndarray, wanted: np.ndarray, random: np.random.Generator
) -> list[np.ndarray]:
    """Slopes of the mean cross entropy by weights and offsets."""
    n = len(all_of) // 2
    weights, offsets = all_of[:n], all_of[n:]
    inputs, masks = [x], []
    for weight, offset in zip(weights[:-1], offsets[:-1], strict=True):
        sums = inputs[-1] @ weight + offset
        kept = (random.random(sums.shape, dtype=np.float32) > DROPPED) / np.float32(1.0 - DROPPED)
        masks.append((np.where(sums > 0.0, 1.0, 0.1) * kept).astype(np.float32))
        inputs.append(sums * masks[-1])
    sums = inputs[-1] @ weights[-1] + offsets[-1]
    likely = np.exp(sums - sums.max(axis=1, keepdims=True))
    back = (likely / likely.sum(axis=1, keepdims=True) - wanted) / np.float32(len(x))
    by_weight, by_offset = [], []
    for layer in range(n - 1, -1, -1):
        by_weight.append(inputs[layer].T @ back + 1e-4 * weights[layer])
        by_offset.append(back.sum(axis=0))
        if layer:
            back = (back @ weights[layer].T) * masks[layer - 1]
    return by_weight[::-1] + by_offset[::-1]


def trained(plays: np.ndarray, seen: np.ndarray) -> dict[str, np.ndarray]:
    """The numbers of `wiggle.regression`; a fifth of the members is for the intervals alone."""
    cut = len(plays) * 4 // 5
    own = seen[:cut]
    known = len(wiggle.KNOWN)
    numbers = {
        "mean": own.mean(axis=0), "spread": own.std(axis=0) + 1e-3,
        "least": own[:, -known:].min(axis=0), "most": own[:, -known:].max(axis=0),
        "networks": np.array(NETWORKS),
    }  # fmt: skip
    scaled = (own - numbers["mean"]) / numbers["spread"]
    near = np.clip(scaled, -wiggle._FAR, wiggle._FAR).astype(np.float32)
    for k in ProgressBar(range(NETWORKS), "networks", unit="network"):
        found = fitted(near, plays[:cut], k)
        for layer in range(3):
            numbers[f"weight_{k}_{layer}"] = found[layer].astype(np.float16)
            numbers[f"offset_{k}_{layer}"] = found[3 + layer]
    odd = np.clip(scaled, -wiggle._ODD, wiggle._ODD)
    values, axes = np.linalg.eigh(odd.T @ odd / len(odd))
    numbers["axes"] = axes[:, -30:].astype(np.float32)
    numbers["along"], numbers["left"] = np.sqrt(values[-30:]), values[:-30].mean()
    numbers = {name: np.asarray(x) for name, x in numbers.items()}
    numbers["strange"] = np.quantile(wiggle.strangeness(seen[cut:], numbers), 0.99)
    joints = [fresh(seed) for seed in ProgressBar(WIDENERS, "fresh joints", unit="joint")]
    aside = [(one.play, found) for one in joints if (found := usable(one)) is not None]
    fresh_plays, fresh_seen = (np.array(x) for x in zip(*aside, strict=True))
    usual = wiggle.inside(fresh_seen[:, -known:], numbers).all(axis=1)
    usual &= wiggle.strangeness(fresh_seen, numbers) <= numbers["strange"]
    for above in TAILS:  # stiffness, belts and cables hide play: what is missed is more of it
        numbers["tails"] = np.array([TAIL, above])
        held, _ = judged(plays[cut:], seen[cut:], numbers)
        there, missed = judged(fresh_plays[usual], fresh_seen[usual], numbers)
        print(
            f"tail {above:g}: family holds {held:.3f}, fresh {there:.3f}, told wrong {missed:.4f}"
        )
        if min(held, there) >= 0.95 and missed <= 0.008:
            break
    return numbers


def usable(one: Fresh) -> np.ndarray | None:
    try:
        wiggle.check_log(one.log)
        wiggle.check_load(one.known)
        return features(one.log, one.known)
    except Untold:
        return None


def judged(
    plays: np.ndarray, seen: np.ndarray, numbers: dict[str, np.ndarray]
) -> tuple[float, float]:
    """Share whose interval holds, and share that is told one that does not."""
    held, missed = 0, 0
    for play, likely in zip(plays, wiggle.shares(seen, numbers), strict=True):
        ends = wiggle.rounded(*wiggle.ends_of(likely, numbers["tails"]))
        right = ends[0] <= play + 1e-9 and play <= ends[1] + 1e-9
        held += right
        missed += not right and not wiggle.too_wide(*ends)
    return held / len(plays), missed / len(plays)


def write(numbers: dict[str, np.ndarray]) -> None:
    """Put the numbers into the package, with their hash."""
    content = io.BytesIO()
    np.savez_compressed(content, **numbers)
    path = wiggle.DATA
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(content.getvalue())
    digest = hashlib.sha256(content.getvalue()).hexdigest()
    path.with_suffix(".sha256").write_text(f"{digest}  {path.name}\n")
    print(f"{path}: {len(content.getvalue())} bytes, {digest}")


def train(number: int) -> None:
    seeds = range(FIRST_MEMBER, FIRST_MEMBER + number)
    found = [of_family(seed) for seed in ProgressBar(seeds, "members of the family", unit="joint")]
    plays, seen = zip(*(one for one in found if one is not None), strict=True)
    write(trained(np.array(plays), np.array(seen)))


# ---- The benchmark -------------------------------------------------------------------------------


def main() -> None:
    benchmark = Benchmark(
        "wiggle", __doc__, runs=0, joints=(600, "that are drawn"),
        seed=(2_000_000, "of the first joint"), train=(False, "the regression anew, and write it"),
        members=(MEMBERS, "of the family, with --train"),
        encoder=("link", "its side: link, or motor, where the link is heavy"),
    )  # fmt: skip
    args = benchmark.parse()
    if args.train:
        return train(args.members)
    number = min(args.joints, 12) if args.quick else args.joints
    rows, why, half = [], Counter(), np.radians(wiggle.HALF)
    for seed in ProgressBar(range(args.seed, args.seed + number), "joints", unit="joint"):
        one = fresh(seed, args.encoder)
        low, high, reason = np.nan, np.nan, ""
        try:
            low, high = band(one.log, one.known)
        except Untold as error:
            reason = str(error)
        refused = bool(reason)
        if not refused and wiggle.too_wide(low, high):
            reason = "plays would look alike"
        holds = low <= one.play + 1e-9 and one.play <= high + 1e-9
        decided = not reason and (low >= half - 1e-9 or high <= half + 1e-9)
        why[" ".join(reason.split()[:4])] += bool(reason)
        rows.append(
            {
                "play_deg": np.degrees(one.play), "low_deg": np.degrees(low),
                "high_deg": np.degrees(high), "refused": int(refused), "told": int(not reason),
                "holds": int(holds), "reverses": int(one.reverses), "decided": int(decided),
                "wrong": int(decided and (low >= half - 1e-9) != (one.play >= half)),
            }
        )  # fmt: skip
    table = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    for words, count in why.most_common():
        if count:
            print(f"{count} cannot be told: {words} ...")
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


if __name__ == "__main__":
    main()
