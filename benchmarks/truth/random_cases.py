"""Configurations drawn afresh at random, at default settings: which errors no run tells of.

Mechanisms in turn: SCARA, UR5, Panda, Kinova, Z1, slider-crank, four-bar, a slider in a guide, arms
of 3 m and 4 m links, gears with play, payloads; one or two joints with clearance of 0.02 to 1 mm;
every normal-force and friction law. Each runs as a user would run it, and is compared with
converged runs: small steps, from the same start and from starts 1, 10 and 100 nm aside, and one
with twice that step. The truth of a figure is the interval of these. Steps are halved until the
step moves no figure by more than a quarter of its target, or by no more than the starts do; a
figure for which that does not succeed is not judged. `--rk4` takes another method for them, whose
first step is as long; `--methods` has the runs themselves by all integrators in turn (semi-implicit
Euler, with a tolerance, rk4).

A figure is outside if it is further from the interval than its target: 2 % of peak forces, 0.5 % of
all else. It is silent if the run said nothing: no error that covers it, and no warning of the audit
that the run was integrated badly. The number of impacts is judged in certificates only. A
certificate is judged if the runs of different step agree to a tenth of a per cent or to the stated
error, and covers a figure that is no further from the interval than that.

The same seed draws the same cases, however many: `--only NUMBER` shows one of them with all its
figures. The last line counts cases, silent figures, and the share of figures that certificates
cover.
"""

import time
import warnings
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache, partial
from pathlib import Path
from typing import NamedTuple

import numpy as np
from common import Benchmark

import jointplay as jp
from jointplay import analysis
from jointplay.base.processes import cores
from jointplay.model import urdf
from jointplay.model.impact import effective_mass
from jointplay.physics.contact import FRICTION_LAWS, NORMAL_LAWS, FrictionLaw, NormalForceLaw
from jointplay.physics.kernel.integrators import DEFAULT
from jointplay.simulation.analysis.certification import certify, figures
from jointplay.simulation.loads.drive import ComputedTorque
from jointplay.simulation.result.audit import Audit
from jointplay.simulation.result.certificate import COUNTS, HEADLINE

TARGETS = {name: 0.02 if name == "peak joint force" else 0.005 for name in HEADLINE}
"""Largest error that a run may have without saying so, relative."""
FLOORS = {"N": 1e-3, "m": 1e-8, "rad": 1e-8, "J": 1e-7, "": 0.0}
"""Errors that nobody asks about, by unit."""
CALM = 0.25
"""A figure is calm if converged draws agree within this part of its target."""
OPEN = 1.5
"""If the step moves a figure by more than so many times what starts aside do, it is too long."""
AGREE = 1e-3
"""Relative difference up to which draws of different step agree, for certificates."""

STEP = 1e-6
"""Step of the first converged runs [s]; at most a quarter of the run's own."""
MACRO = 20
"""Steps in a macro step of converged runs."""
HALVINGS = 3
"""How often the step is halved at most."""
ASIDES = ((0.8e-9, 0.5e-9, -0.3e-9), (-5e-9, 8e-9, 3e-9), (3e-8, -8e-8, 5e-8))
"""Journals at the start of the other converged runs [m]; 1, 10 and 100 nm aside."""
ATTEMPTS = 200
"""A case that is refused so often is a mistake in the draw."""

METHODS = ({}, {"integrator": "semi-implicit-euler"}, {"tolerance": 1e-3}, {"integrator": "rk4"})
QUINTIC = 1.875
"""Largest over mean speed of a way from rest to rest."""

Vector = tuple[float, float, float]


# ---- The draw -----------------------------------------------------------------------------------


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
        return f"{robot}, {', '.join(play)}, {self.normal}, {self.friction}"


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
    for joint, one in mechanism.clearance.items():
        mass = 1.0 if q is None else effective_mass(mechanism, joint, q)
        joints[joint] = replace(one, normal=drawn_normal(random, name, mass))
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
    path = urdf_of_long_arm(random) if robot == "long arm" else arm.path
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


BODY = """
  <link name="{name}"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>
    <inertia ixx="{across}" iyy="{along}" izz="{along}" ixy="0" ixz="0" iyz="0"/>
    </inertial></link>"""
JOINT = """
  <joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>
    <origin xyz="{place}"/><axis xyz="{axis}"/>
    <limit lower="{lower}" upper="{upper}" effort="1e5" velocity="20"/></joint>"""


def body(name: str, length: float, mass: float, width: float) -> str:
    """A bar along x from its joint on; lengths in m, mass in kg."""
    across, along = mass * width**2 / 6.0, mass * (length**2 + width**2) / 12.0
    return BODY.format(name=name, x=length / 2.0, mass=mass, across=across, along=along)


def joint(
    name: str, parent: str, child: str, place: str, axis: str, limit: float, kind: str = "revolute"
) -> str:
    return JOINT.format(
        name=name, kind=kind, parent=parent, child=child, place=place, axis=axis,
        lower=-limit, upper=limit,
    )  # fmt: skip


def read(name: str, *parts: str) -> urdf.Description:
    """The robot made of these links and joints."""
    return urdf.parse(f'<robot name="{name}">{"".join(parts)}\n</robot>', Path(f"{name}.urdf"))


def urdf_of_long_arm(random: Random) -> urdf.Description:
    """Links of 3 m and 4 m, in the plane of gravity or across it."""
    axis = random.one(("0 1 0", "0 0 1"))
    return read(
        "long_arm",
        '<link name="base"/>',
        body("column", 0.3, random.log(10.0, 50.0), 0.3),
        body("upper", 3.0, random.log(15.0, 60.0), 0.15),
        body("fore", 4.0, random.log(10.0, 40.0), 0.1),
        joint("yaw", "base", "column", "0 0 0", "0 0 1", 3.0),
        joint("shoulder", "column", "upper", "0.3 0 0", axis, 1.5),
        joint("elbow", "upper", "fore", "3 0 0", axis, 2.5),
    )


def drawn_slider(random: Random, friction: FrictionLaw) -> jp.Simulation:
    """A carriage with play in its guide, which carries an arm."""
    robot = read(
        "slider",
        '<link name="base"/>',
        body("carriage", 0.1, random.log(0.5, 8.0), 0.06),
        body("arm", 0.3, random.log(0.2, 3.0), 0.04),
        joint(
            "guide", "base", "carriage", "0 0 0", random.one(("1 0 0", "0 0 1")), 0.6, "prismatic"
        ),
        joint("pin", "carriage", "arm", "0.05 0 0.05", random.one(("0 1 0", "0 0 1")), 2.5),
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


# ---- The truth ----------------------------------------------------------------------------------


class NoTruthError(Exception):
    """A converged run did not complete."""


def finer(simulation: jp.Simulation, times: int, integrator: str = DEFAULT) -> jp.Simulation:
    """The same with a step so many times smaller, and records at the same times."""
    step = simulation.step / times
    return replace(
        simulation,
        integrator=integrator,
        step=step,
        macro_step=MACRO * step if integrator == DEFAULT else None,
        tolerance=None,
        record_every=simulation.record_every * times,
    )


def converged(simulation: jp.Simulation, aside: Vector | None = None) -> jp.Result:
    """Run with the journals, or the motors of gears, so far aside.

    Raises:
        NoTruthError: the run did not complete, or was refused.
    """
    try:
        run = jp.Run(simulation)
    except jp.JointplayError as error:
        raise NoTruthError(str(error)) from None
    mechanism = simulation.mechanism
    if aside is not None and mechanism.clearance:
        run.displace(aside)
    elif aside is not None:
        for name in mechanism.gears:
            run.workspace.q[mechanism.motor(name)] += aside[0]
    result = run.finish(check_step=False)
    if result.status != jp.Status.COMPLETED:
        raise NoTruthError(result.message)
    return result


@dataclass(frozen=True)
class Truth:
    """One figure of converged runs."""

    draws: tuple[float, ...]
    """From starts ever further aside; the first from the start itself."""
    coarser: float
    """From the start itself, with twice the step."""
    unit: str
    target: float
    """Relative."""

    @property
    def interval(self) -> tuple[float, float]:
        every = (*self.draws, self.coarser)
        return min(every), max(every)

    @property
    def mean(self) -> float:
        return float(np.mean((*self.draws, self.coarser)))

    @property
    def allowed(self) -> float:
        """Error that is within the target, in the figure's unit."""
        return max(self.target * abs(self.mean), FLOORS[self.unit])

    @property
    def moved(self) -> float:
        """What halving the step changed."""
        return abs(self.draws[0] - self.coarser)

    @property
    def state(self) -> str:
        """Whether the motion is calm or sensitive, or the step still too long."""
        low, high = self.interval
        if high - low <= CALM * self.allowed:
            return "calm"
        by_starts = OPEN * float(np.ptp(self.draws))
        return "sensitive" if self.moved <= max(CALM * self.allowed, by_starts) else "open"

    def away(self, value: float) -> float:
        """Distance of a value from the interval."""
        low, high = self.interval
        return max(low - value, value - high, 0.0)

    def verdict(self, value: float, stated: float, warned: bool) -> str:
        """``outside`` the target, and ``silent`` if no stated error or warning told of it, or none.

        `stated` is the error as the run states it; not a number if it states none.
        """
        away = self.away(value)
        if self.state == "open" or away <= self.allowed:
            return ""
        return "outside" if warned or away <= stated else "silent"


def headline(found: dict[str, tuple[float, str]]) -> dict[str, tuple[float, str]]:
    return {name: of for name, of in found.items() if name.startswith(HEADLINE)}


def kind_of(figure: str) -> str:
    """The figure without its joint."""
    return figure.split(",")[0]


def truth(simulation: jp.Simulation, by: str = DEFAULT) -> tuple[dict[str, Truth], float]:
    """What converged runs by a method say of each headline figure, and their step [s].

    Raises:
        NoTruthError: one of them did not complete.
    """
    times = max(round(simulation.step / STEP), 4)
    ideal = converged(analysis.ideal_simulation(finer(simulation, times // 2)))

    def found(times: int, aside: Vector | None = None) -> dict[str, tuple[float, str]]:
        return headline(figures(converged(finer(simulation, times, by), aside), ideal))

    coarser = found(times // 2)
    for halving in range(HALVINGS + 1):
        own = found(times)
        draws = [own, *(found(times, aside) for aside in ASIDES)]
        known = {
            name: Truth(
                tuple(draw[name][0] for draw in draws),
                coarser[name][0],
                unit,
                TARGETS[kind_of(name)],
            )
            for name, (_, unit) in own.items()
        }
        judged = [one for name, one in known.items() if kind_of(name) not in COUNTS]
        if all(one.state != "open" for one in judged):
            break
        if halving < HALVINGS:
            coarser, times = own, 2 * times
    return known, simulation.step / times


# ---- The judgement ------------------------------------------------------------------------------


def stated_errors(result: jp.Result) -> dict[str, float]:
    """Error of each figure as the run itself states it, by name."""
    if result.certificate is None:
        return {}
    return {figure.name: figure.error for figure in result.certificate.figures}


def warnings_of_the_step(audit: Audit) -> list[str]:
    """What the audit says of how well the run was integrated, and not of laws, loads and limits."""
    model = {"law_warnings": (), "limit_warnings": ()}
    return replace(audit, **model, penetration_over_clearance=0.0, friction_fed=0.0).warnings


@dataclass(frozen=True)
class Outcome:
    """What became of a case: a row for every figure."""

    case: dict[str, object]
    rows: list[dict[str, object]]
    note: str = ""
    """Why there are none."""
    cpu: float = 0.0
    """[s]."""


def judge(
    seed: int,
    number: int,
    certified: bool = True,
    methods: bool = False,
    among: Among = ALL,
    by: str = DEFAULT,
) -> Outcome:
    """Draw a case, run it, find the truth, compare.

    Args:
        seed, number: of the case.
        certified: whether certificates are judged too.
        methods: whether the case runs by the integrators in turn.
        among: what the case is drawn from.
        by: method of the converged runs.
    """
    warnings.simplefilter("ignore", RuntimeWarning)
    started = time.process_time()
    case = drawn(seed, number, among)
    own_method = METHODS[number % len(METHODS)] if methods else {}
    simulation = replace(case.simulation, **own_method)
    about: dict[str, object] = {
        name: getattr(case, name)
        for name in ("seed", "number", "kind", "robot", "normal", "friction")
    }
    about |= {"case": case.label, "integrator": simulation.integrator, "step": simulation.step}

    def outcome(rows: list[dict[str, object]], note: str = "") -> Outcome:
        return Outcome(about, rows, note, time.process_time() - started)

    once = time.process_time()
    try:
        result = simulation.run()
    except jp.JointplayError as error:
        return outcome([], f"refused: {error}")
    once = time.process_time() - once
    if result.status != jp.Status.COMPLETED:
        return outcome([], f"the run {result.message}")
    own = headline(figures(result, converged(analysis.ideal_simulation(result))))
    try:
        known, step = truth(case.simulation, by)
    except NoTruthError as error:
        return outcome([], f"no truth: {error}")
    said, warned = stated_errors(result), warnings_of_the_step(result.audit)
    errors: dict[str, float] = {}
    if certified:
        cost = time.process_time()
        certificate = certify(result, simulation=simulation)
        about["cost_in_runs"] = (time.process_time() - cost) / once
        errors = {figure.name: figure.error for figure in certificate.headline}
    rows = []
    for name, (value, unit) in own.items():
        if name not in known:
            continue
        true = known[name]
        away = true.away(value)
        stated = said.get(name, np.nan)
        verdict = "" if kind_of(name) in COUNTS else true.verdict(value, stated, bool(warned))
        row: dict[str, object] = about | {
            "figure": name, "unit": unit, "value": value, "low": true.interval[0],
            "high": true.interval[1], "mean": true.mean, "finest": true.draws[0],
            "coarser": true.coarser, "finest_step": step, "state": true.state, "away": away,
            "stated_error": stated, "warned": "; ".join(warned), "verdict": verdict,
        }  # fmt: skip
        if name in errors:
            row |= {
                "certified_error": errors[name],
                "agreed": true.moved <= max(AGREE * abs(true.draws[0]), errors[name]),
                "covered": away <= errors[name],
            }
        rows.append(row)
    return outcome(rows)


def _judge(seed: int, options: tuple, number: int) -> Outcome:
    warnings.simplefilter("ignore", RuntimeWarning)
    return judge(seed, number, *options)


def named(row: dict) -> str:
    """A figure of a case, its value and the truth, in a line."""
    low, high = row["low"], row["high"]
    true = f"{low:.6g}" if low == high else f"{low:.6g} to {high:.6g}"
    error = "none" if np.isnan(row["stated_error"]) else f"{row['stated_error']:.2g}"
    line = (
        f"{row['figure']}: {row['value']:.6g}, truth {true} {row['unit']} ({row['state']}, "
        f"{100 * row['away'] / (abs(row['mean']) or 1.0):+.2g} %), stated error {error}"
    )
    if "certified_error" in row:
        line += f", certified {row['certified_error']:.2g}"
    return line


def tell(outcome: Outcome) -> None:
    """Say what was missed in silence, or why nothing is known."""
    number, label = outcome.case["number"], outcome.case["case"]
    if outcome.note:
        print(f"case {number}: {outcome.note} ({label})")
    for row in outcome.rows:
        uncovered = row.get("agreed") and not row["covered"]
        verdict = "not covered" if uncovered else row["verdict"]
        if verdict in ("silent", "not covered"):
            print(f"{verdict}: case {number}: {named(row)} ({label}, {row['integrator']})")


HEADER = (
    "", "cases", "stopped", "figures", "calm", "sensitive", "not converged", "outside target",
    "stated", "silent", "certified", "true error, median [%]", "certified, median [%]",
)  # fmt: skip


def line(name: str, outcomes: Sequence[Outcome], figure: str = "") -> list[str]:
    """One row of the table: of all figures of these cases, or of one of them."""
    rows = [
        row
        for outcome in outcomes
        for row in outcome.rows
        if kind_of(row["figure"]).startswith(figure)
    ]
    judged = [row for row in rows if kind_of(row["figure"]) not in COUNTS]
    states = Counter(row["state"] for row in judged)
    verdicts = Counter(row["verdict"] for row in rows)
    agreed = [row for row in rows if row.get("agreed")]
    covered = f"{sum(row['covered'] for row in agreed)} of {len(agreed)}" if agreed else "-"
    counts = (
        len(outcomes), sum(not outcome.rows for outcome in outcomes), len(judged), states["calm"],
        states["sensitive"], states["open"], verdicts["outside"] + verdicts["silent"],
        verdicts["outside"], verdicts["silent"],
    )  # fmt: skip
    sizes = [
        100.0
        * float(np.median([row[key] / abs(row["mean"]) for row in agreed if row["mean"]] or [0]))
        for key in ("away", "certified_error")
    ]
    return [name, *map(str, counts), covered, *(f"{size:.2g}" for size in sizes)]


def table(outcomes: Sequence[Outcome]) -> list[list[str]]:
    """By mechanism and by figure."""
    lines = []
    for kind in KINDS:
        those = [outcome for outcome in outcomes if outcome.case["kind"] == kind]
        if those:
            lines.append(line(kind, those))
    lines += [line(figure, outcomes, figure) for figure in HEADLINE]
    return [*lines, line("all", outcomes)]


def main() -> None:
    made = Benchmark("random_cases", __doc__, runs=0)
    add = made.parser.add_argument
    add("--cases", type=int, default=100, metavar="N", help="how many (default: %(default)s)")
    add("--seed", type=int, metavar="N", help="of the draw (default: drawn, and printed)")
    add("--jobs", type=int, default=cores(), metavar="N", help="processes")
    add("--only", type=int, metavar="NUMBER", help="this case alone, with all its figures")
    add("--no-certify", action="store_true", help="judge no certificates")
    add("--methods", action="store_true", help="run cases by all integrators in turn")
    add("--rk4", action="store_true", help="converged runs by rk4, throughout")
    for name, choices in (("kind", KINDS), ("friction", tuple(FRICTION_LAWS))):
        add(f"--{name}", action="append", choices=choices, help="draw these only (repeatable)")
    args = made.parse()
    if args.cases < 1 or args.jobs < 1:
        made.parser.error("--cases and --jobs must be at least 1")
    cases = min(args.cases, 3) if args.quick else args.cases
    seed = time.time_ns() // 1_000_000 % 1_000_000_000 if args.seed is None else args.seed
    print(f"seed {seed}", flush=True)
    among = Among(tuple(args.kind or KINDS), tuple(args.friction or FRICTION_LAWS))
    options = (not args.no_certify, args.methods, among, "rk4" if args.rk4 else DEFAULT)
    if args.only is not None:
        outcomes = [judge(seed, args.only, *options)]
        for name, value in outcomes[0].case.items():
            print(f"  {name}: {value}")
        print(f"  {outcomes[0].note}")
        rows = outcomes[0].rows
        for row in rows:
            print(f"{row['verdict']:8s}{named(row)}")
    else:
        study = jp.Study(
            {number: number for number in range(cases)}, partial(_judge, seed, options)
        )
        for _, outcome in study.outcomes(args.jobs, progress=True, unit="case"):
            tell(outcome)
        outcomes = [study.store[number] for number in range(cases)]
        rows = [row | {"cpu_s": one.cpu} for one in outcomes for row in one.rows]
        names = dict.fromkeys(name for row in rows for name in row)
        rows = [dict.fromkeys(names, "") | row for row in rows]
        made.finish(HEADER, table(outcomes), rows)
        footnotes(outcomes)
    agreed = [row for row in rows if row.get("agreed")]
    share = f"{100 * np.mean([row['covered'] for row in agreed]):.1f} %" if agreed else "-"
    silent = sum(row["verdict"] == "silent" for row in rows)
    known = [row for row in rows if row["state"] != "open" and kind_of(row["figure"]) not in COUNTS]
    within = sum(row["away"] <= row["stated_error"] for row in known)
    print(f"within the error that the run stated: {within} of {len(known)} figures")
    print(f"cases {len(outcomes)} silent {silent} certified {share}")


def footnotes(outcomes: Sequence[Outcome]) -> None:
    """Cases without figures, cost."""
    without = Counter(one.note.split(":")[0].split(" at ")[0] for one in outcomes if one.note)
    print(f"cases without figures: {sum(without.values())}"
          + "".join(f"; {count} x {text}" for text, count in without.items()))  # fmt: skip
    times = [one.cpu for one in outcomes]
    print(f"CPU time of a case {np.mean(times):.1f} s in the mean, {max(times):.0f} s at most")
    costs = [one.case["cost_in_runs"] for one in outcomes if "cost_in_runs" in one.case]
    if costs:
        print(f"certificates cost {np.median(costs):.0f} times the run, in the middle")
