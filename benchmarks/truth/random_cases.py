"""Random configurations for `accuracy.py`: the same for the same seed and number.

Mechanisms in turn: SCARA, UR5, Panda, Kinova, Z1, slider-crank, four-bar, a slider in a guide, arms
of 3 m and 4 m links, gears with play, payloads; one or two joints with clearance of 0.02 to 1 mm;
every normal-force and friction law.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import NamedTuple

import numpy as np
from robots import body, joint, urdf

import jointplay as jp
from jointplay.model.impact import effective_mass
from jointplay.model.urdf import Description
from jointplay.physics.contact import FRICTION_LAWS, NORMAL_LAWS, FrictionLaw, NormalForceLaw
from jointplay.simulation.loads.drive import ComputedTorque

ATTEMPTS = 200
"""A case that is refused so often is a mistake in the draw."""
QUINTIC = 1.875
"""Largest over mean speed of a way from rest to rest."""

Vector = tuple[float, float, float]


class Random:
    """Random numbers of one attempt to draw one case."""

    def __init__(self, *seed: int) -> None:
        self.rng = np.random.default_rng(seed)

    def between(self, low: float, high: float) -> float:
        return float(self.rng.uniform(low, high))

    def log(self, low: float, high: float) -> float:
        """Every decade as likely as any other."""
        return float(np.exp(self.rng.uniform(np.log(low), np.log(high))))

    def chance(self, probability: float) -> bool:
        return bool(self.rng.random() < probability)

    def one(self, choices: Sequence[str]) -> str:
        return choices[int(self.rng.integers(len(choices)))]

    def some(self, choices: Sequence[str], number: int) -> list[str]:
        """Several different ones, in their order."""
        picked = self.rng.choice(len(choices), min(number, len(choices)), replace=False)
        return [choices[k] for k in sorted(picked)]


@dataclass(frozen=True)
class Arm:
    """What is drawn of a robot; lengths in m, speeds in rad/s, masses in kg."""

    path: str
    joints: tuple[str, ...]
    """Those that move."""
    radius: float
    """Of the bearings near the base; those of the outer half of the joints are smaller."""
    payload: float
    """The heaviest."""
    speed: tuple[float, float] = (0.3, 3.0)
    """Range of the joints' mean speeds, as far as their limits allow."""
    massless: tuple[str, ...] = ()
    """Joints that cannot have clearance, for the link before them has no mass."""


ARMS = {
    "SCARA": Arm(
        "jointplay:scara.urdf", ("joint_a", "joint_b", "stroke", "joint_c"), 12e-3, 2.0,
        massless=("joint_c",),
    ),
    "UR5": Arm(
        "ur5", ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                *(f"wrist_{k}_joint" for k in (1, 2, 3))), 30e-3, 5.0,
    ),
    "Panda": Arm("panda", tuple(f"panda_joint{k}" for k in range(1, 8)), 30e-3, 3.0),
    "Kinova": Arm("kinova", tuple(f"j2s6s200_joint_{k}" for k in range(1, 7)), 20e-3, 2.0),
    "Z1": Arm("z1", tuple(f"joint{k}" for k in range(1, 7)), 18e-3, 2.0),
    "long arm": Arm("", ("yaw", "shoulder", "elbow"), 80e-3, 20.0, (0.03, 0.4)),
}  # fmt: skip
ROBOTS = ("SCARA", "UR5", "Panda", "Kinova", "Z1")

LINKAGES = {
    "slider-crank": ("slider_crank", "0.1 mm", "piston_pin", (300.0, 5000.0)),
    "four-bar": ("four_bar", "0.2 mm", "rocker_end", (120.0, 600.0)),
}
"""Scenario, case, joint with clearance, speeds of the crank [rpm]."""

KINDS = (*ROBOTS, *LINKAGES, "slider", "long arm", "gear", "payload")
"""Mechanisms, each drawn as often as any other."""


@dataclass(frozen=True)
class Case:
    """One configuration; the same for the same seed and number."""

    seed: int
    number: int
    kind: str
    robot: str
    normal: str
    friction: str
    simulation: jp.Simulation

    @property
    def label(self) -> str:
        mechanism = self.simulation.mechanism
        play = [
            f"{name} {'/'.join(f'{1e3 * c:.3g}' for c in one.clearances.values())} mm"
            for name, one in mechanism.clearance.items()
        ]
        play += [f"gear {name} {one.play:.2g} rad" for name, one in mechanism.gears.items()]
        robot = self.kind if self.kind == self.robot else f"{self.kind} ({self.robot})"
        loaded = ", loaded" if np.any(mechanism.gravity) else ""
        return f"{robot}, {', '.join(play)}, {self.normal}, {self.friction}{loaded}"


class Among(NamedTuple):
    """What cases are drawn from."""

    kinds: tuple[str, ...] = KINDS
    frictions: tuple[str, ...] = tuple(FRICTION_LAWS)


ALL = Among()


def drawn(seed: int, number: int, among: Among = ALL) -> Case:
    """The case of that number: the first draw that can be run."""
    for attempt in range(ATTEMPTS):
        try:
            case = attempted(seed, number, attempt, among)
            jp.Run(case.simulation)
        except jp.JointplayError as error:
            refused = error
        else:
            return case
    raise RuntimeError(f"case {number} of seed {seed} is refused: {refused}")


def attempted(seed: int, number: int, attempt: int, among: Among) -> Case:
    """One draw.

    Raises:
        JointplayError: a dimension or number that cannot be.
    """
    random = Random(seed, number, attempt)
    kind, normal, friction = (
        in_turn(choices, seed, number, which)
        for which, choices in enumerate((among.kinds, tuple(NORMAL_LAWS), among.frictions))
    )
    if kind == "slider" and NORMAL_LAWS[normal].line:  # for journals only
        normal = random.one([name for name, law in NORMAL_LAWS.items() if not law.line])
    friction_law = drawn_friction(random, friction)
    if kind in LINKAGES:
        robot, simulation = kind, drawn_linkage(random, kind, friction_law)
    elif kind == "slider":
        robot, simulation = kind, drawn_slider(random, friction_law)
    else:
        robot = random.one(ROBOTS) if kind in ("gear", "payload") else kind
        simulation = drawn_arm(random, kind, robot, friction_law)
    simulation = with_normal_law(random, simulation, normal)
    if not simulation.mechanism.clearance:
        normal = friction = "-"
    return Case(seed, number, kind, robot, normal, friction, simulation)


def in_turn(choices: Sequence[str], seed: int, number: int, which: int) -> str:
    """Each choice once, in a random order, then again in another one."""
    block, place = divmod(number, len(choices))
    return choices[np.random.default_rng([seed, block, which, 1]).permutation(len(choices))[place]]


def drawn_friction(random: Random, name: str) -> FrictionLaw:
    """A friction law with all its numbers drawn."""
    mu_d, slow = random.log(0.02, 0.3), random.log(2e-5, 1e-3)
    values = {
        "mu_d": mu_d,
        "mu_s": mu_d * random.between(1.0, 1.6),
        "v0": slow if name == "ambrosio" else random.log(1e-4, 1e-2),
        "v1": slow * random.log(3.0, 20.0),
        "v_t": random.log(1e-4, 1e-2),
        "v_r": random.log(1e-4, 1e-2),
        "v_s": random.log(1e-3, 1e-2),
        "xi": random.log(10.0, 300.0),
        "sigma0": random.log(3e4, 3e5),
        "sigma1": random.log(3.0, 30.0),
        "sigma2": random.between(0.0, 0.1),
        "dwell_time": random.log(0.03, 0.3),
    }
    law = FRICTION_LAWS[name]
    return law(**{one.name: values[one.name] for one in fields(law)})


def drawn_normal(random: Random, name: str, mass: float) -> NormalForceLaw:
    """A normal-force law with all its numbers drawn, for an impact of `mass` [kg]."""
    values = {
        "damping": random.log(100.0, 3000.0),
        "mass": mass * random.log(0.5, 2.0),
        "stiffness": None,
        "n": random.between(1.45, 1.6),
        "p": random.between(1.2, 1.5),
        "q": 1.0,
    }
    law = NORMAL_LAWS[name]
    return law(**{one.name: values[one.name] for one in fields(law)})


def with_normal_law(random: Random, simulation: jp.Simulation, name: str) -> jp.Simulation:
    """The same with a normal-force law drawn for each joint."""
    mechanism = simulation.mechanism
    if not mechanism.clearance:
        return simulation
    q = jp.Run(simulation).workspace.q if name == "anagnostopoulos" else None
    joints = dict(mechanism.given_joints)
    for at, one in mechanism.clearance.items():
        mass = 1.0 if q is None else effective_mass(mechanism, at, q)
        joints[at] = replace(one, normal=drawn_normal(random, name, mass))
    return replace(simulation, mechanism=mechanism.with_clearance(joints))


def drawn_bearing(random: Random, radius: float, friction: FrictionLaw) -> jp.RevoluteClearance:
    """A joint with clearance whose bearing's radius is about that [m]."""
    radius *= random.between(0.7, 1.3)
    return jp.RevoluteClearance(
        bearing_radius=radius,
        bearing_length=radius * random.between(1.5, 4.0),
        radial_clearance=random.log(0.02e-3, 1e-3),
        axial_clearance=random.log(0.02e-3, 1e-3),
        restitution=random.between(0.4, 0.95),
        friction=friction,
    )


def drawn_motion(
    random: Random, mechanism: jp.Mechanism, joints: Sequence[str], speed: tuple[float, float]
) -> jp.Motion:
    """From rest to rest, one or two ways within the limits."""
    duration, ways, mean = random.log(0.4, 1.0), 1 + random.chance(0.5), random.log(*speed)
    times = np.round(np.linspace(0.0, duration, ways + 1), 3)
    low, high = [], []
    for name in joints:
        entry = mechanism.description.joints[name]
        reach = 2.0 if entry.turns else 0.3
        low.append(-reach if entry.lower is None else max(entry.lower, -2.0 * reach))
        high.append(reach if entry.upper is None else min(entry.upper, 2.0 * reach))
    middle, half = 0.5 * np.add(high, low), 0.45 * np.subtract(high, low)
    positions = [middle + half * random.rng.uniform(-1.0, 1.0, len(joints))]
    speeds = []
    for name in joints:
        entry = mechanism.description.joints[name]
        limit = entry.speed or np.inf
        speeds.append(min(mean if entry.turns else 0.1 * mean, limit / QUINTIC))
    for _ in range(ways):
        way = np.array(speeds) * duration / ways * random.rng.uniform(-1.0, 1.0, len(joints))
        positions.append(np.clip(positions[-1] + way, middle - half, middle + half))
    return jp.Motion(joints, times, positions)


def drawn_arm(random: Random, kind: str, robot: str, friction: FrictionLaw) -> jp.Simulation:
    """A robot with play in one or two of its joints."""
    arm = ARMS[robot]
    path = long_arm(random) if robot == "long arm" else arm.path
    ideal = jp.Mechanism(path)
    entries = ideal.description.joints
    turning = [name for name in arm.joints if entries[name].turns and name not in arm.massless]
    clearance = {}
    if kind != "gear" or random.chance(0.5):
        for name in random.some(turning, 1 + random.chance(0.35)):
            outer = turning.index(name) >= len(turning) / 2
            clearance[name] = drawn_bearing(random, arm.radius * (0.6 if outer else 1.0), friction)
    loaded = random.chance(0.5 if robot == "SCARA" else 0.85)
    motion = drawn_motion(random, ideal, arm.joints, arm.speed)
    gears = {}
    if kind == "gear":
        name = random.one(turning)
        gears[name] = drawn_gear(random, ideal, name, motion)
    payloads = (drawn_payload(random, ideal.tool, arm, motion),) if kind == "payload" else ()
    mechanism = jp.Mechanism(
        path, clearance, gears=gears, gravity="loaded" if loaded else "balanced"
    )
    # With the drives of small arms, links so long are unstable at the default step.
    bandwidth = random.log(5.0, 20.0) if robot == "long arm" else ComputedTorque.bandwidth
    return jp.Simulation(mechanism, motion, ComputedTorque(bandwidth), payloads=payloads)


def drawn_gear(random: Random, ideal: jp.Mechanism, name: str, motion: jp.Motion) -> jp.Gear:
    """One whose rotor weighs about as much as what the joint moves."""
    import pinocchio as pin

    q = ideal.configuration(dict(zip(motion.joints, motion.positions[0], strict=True)))
    at = ideal.coordinate(name)
    inertia = float(pin.crba(ideal.model, ideal.data, q)[at, at])
    rotor = inertia * random.log(0.1, 1.0)
    reduced = rotor * inertia / (rotor + inertia)
    # Softer or less damped, the drive, of 100 rad/s, makes the arm swing ever wider.
    frequency = random.log(1e3, 6e3)
    damping = 2.0 * random.log(0.05, 0.3) * frequency * reduced
    return jp.Gear(random.log(1e-4, 1e-2), rotor, frequency**2 * reduced, damping)


def drawn_payload(random: Random, tool: str, arm: Arm, motion: jp.Motion) -> jp.Payload:
    """There from the start, or picked up where the tool stands or passes by."""
    end = float(motion.times[-1])
    pick = 0.0 if random.chance(0.5) else round(end * random.between(0.2, 0.6), 3)
    release = round(end * random.between(0.7, 0.9), 3) if random.chance(0.4) else None
    return jp.Payload(tool, arm.payload * random.log(0.05, 1.0), pick, release)


def drawn_linkage(random: Random, kind: str, friction: FrictionLaw) -> jp.Simulation:
    """A shipped scenario with another pin and speed, with its own step or the default one."""
    name, case, pin, speeds = LINKAGES[kind]
    speed = random.log(*speeds)
    simulation = scenario(name).simulation(
        case,
        {
            "motion": {"speeds": {"crank_pin": f"{speed:.6g} rpm"}},
            "joints": {pin: {"radial_clearance": random.log(0.02e-3, 1e-3)}},
        },
    )
    joint = replace(
        simulation.mechanism.clearance[pin],
        friction=friction,
        restitution=random.between(0.4, 0.95),
    )
    step = simulation.step if random.chance(0.5) else jp.Simulation.step
    turn = 60.0 / speed
    duration = min(random.between(1.0, 3.0) * turn, 1.0)
    every = jp.Simulation.record_every * step
    return replace(
        simulation,
        mechanism=simulation.mechanism.with_clearance({pin: joint}),
        step=step,
        duration=max(round(duration / every), 1) * every,
    )


@cache
def scenario(name: str) -> jp.Scenario:
    return jp.Scenario.load(f"jointplay:{name}.toml")


def bar(name: str, length: float, mass: float, width: float) -> str:
    """A bar along x from its joint on; lengths in m, mass in kg."""
    across, along = mass * width**2 / 6.0, mass * (length**2 + width**2) / 12.0
    return body(name, mass, f"{length / 2.0} 0 0", (across, along, along))


def long_arm(random: Random) -> Description:
    """Links of 3 m and 4 m, in the plane of gravity or across it."""
    axis = random.one(("0 1 0", "0 0 1"))
    return urdf(
        bar("column", 0.3, random.log(10.0, 50.0), 0.3),
        bar("upper", 3.0, random.log(15.0, 60.0), 0.15),
        bar("fore", 4.0, random.log(10.0, 40.0), 0.1),
        joint("yaw", "base", "column", limit=3.0, speed=20),
        joint("shoulder", "column", "upper", axis=axis, at="0.3 0 0", limit=1.5, speed=20),
        joint("elbow", "upper", "fore", axis=axis, at="3 0 0", limit=2.5, speed=20),
    )


def drawn_slider(random: Random, friction: FrictionLaw) -> jp.Simulation:
    """A carriage with play in its guide, which carries an arm."""
    heavy, light = random.log(0.5, 8.0), random.log(0.2, 3.0)
    way, axis = random.one(("1 0 0", "0 0 1")), random.one(("0 1 0", "0 0 1"))
    robot = urdf(
        bar("carriage", 0.1, heavy, 0.06),
        bar("arm", 0.3, light, 0.04),
        joint("guide", "base", "carriage", "prismatic", way, limit=0.6, speed=20),
        joint("pin", "carriage", "arm", axis=axis, at="0.05 0 0.05", limit=2.5, speed=20),
    )
    clearance: dict[str, jp.PrismaticClearance | jp.RevoluteClearance] = {
        "guide": jp.PrismaticClearance(
            length=random.between(60e-3, 150e-3),
            width=random.between(30e-3, 60e-3),
            height=random.between(30e-3, 60e-3),
            clearance=random.log(0.02e-3, 1e-3),
            clearance_y=random.log(0.02e-3, 1e-3),
            corner_radius=random.log(0.5e-3, 5e-3),
            restitution=random.between(0.4, 0.95),
            friction=friction,
        )
    }
    if random.chance(0.3):
        clearance["pin"] = drawn_bearing(random, 10e-3, friction)
    gravity = "loaded" if random.chance(0.7) else "balanced"
    mechanism = jp.Mechanism(robot, clearance, gravity=gravity)
    motion = drawn_motion(random, mechanism.ideal(), ("guide", "pin"), (0.3, 3.0))
    return jp.Simulation(mechanism, motion)
