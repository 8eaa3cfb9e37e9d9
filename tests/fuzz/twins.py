"""The same physics said in another way gives the same numbers: what finds runs that are wrong in
silence.

A small machine is drawn from a seed: a chain of bodies, one joint of it with clearance. It is run
as it is, and again renamed, reordered, in other units, scaled, cut by a checkpoint; and its
histories are held against Pinocchio and against each other.
"""

import random
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.physics.kernel import Status
from jointplay.scenario import Scenario
from jointplay.scenario.reading import inline
from jointplay.simulation.result.audit import ENERGY_WARNING
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation

ROUNDING = 1e-9
"""Relative difference that passes for rounding, over runs of some hundred steps."""

UNITS = {
    "m": {"": 1.0, "m": 1.0, "mm": 1e-3, "um": 1e-6, "cm": 1e-2, "km": 1e3},
    "s": {"": 1.0, "s": 1.0, "ms": 1e-3, "us": 1e-6, "min": 60.0},
    "rad": {"": 1.0, "rad": 1.0, "mrad": 1e-3},
    "Pa": {"": 1.0, "Pa": 1.0, "GPa": 1e9, "MPa": 1e6, "N/mm^2": 1e6},
    "m/s": {"": 1.0, "m/s": 1.0, "mm/s": 1e-3, "m/min": 1.0 / 60.0},
    "rad/s": {"": 1.0, "rad/s": 1.0, "1/s": 1.0},
    "m/s^2": {"": 1.0, "m/s^2": 1.0, "mm/s^2": 1e-3},
}
"""Ways to write a quantity, and what one is in SI."""

ODD = (
    "a.b", "x.y.z", ".", "a.", ".a", "a=b", "a$b", "$x", "a b", "a:b", "a/b", "../a", "a[0]",
    "a{b}", "{0}", "%s", "a,b", "a;b", "'", "a'b", '"', 'a"b', "<a>", "&amp;", "#a", "-a", "--a",
    "1", "0", "nan", "None", "true", "é", "\N{GREEK SMALL LETTER MU}", "\N{PILE OF POO}", "\u202ea",
    "joint.x", "a.yaw", "x", "yaw", "world", "universe", "root_joint", "a" * 200, "a" * 201,
    "é" * 150, "a" * 10_000, "a\x1b[31mb", "a\x07", "a\x00b", "a\tb", "a\nb", " ", " a ", "\u00a0",
    "time", "q", "v", "joint", "contact", "a\\b", "a\\n", "`a`", "$(a)", "~", "*", "a|b", "\ufeff",
)  # fmt: skip
"""Names that links and joints should not have, and some do."""


@dataclass
class Machine:
    """A chain of bodies in SI units, and what is done with it."""

    bodies: list[dict[str, Any]]
    """Mass, centre, inertia, joint's type, place, axis, end of its motion."""
    clearance: int
    """Which joint has it."""
    sizes: dict[str, float]
    law: str
    friction: dict[str, Any]
    restitution: float
    young: float
    state: dict[str, list[float]]
    gravity: list[float]
    step: float
    duration: float
    times: list[float]
    bandwidth: float
    integrator: str
    macro_step: float
    links: list[str] = field(default_factory=list)
    joints: list[str] = field(default_factory=list)

    def __post_init__(self) -> None:
        """Plain names unless others are given."""
        n = len(self.bodies)
        self.links = self.links or [f"link{k}" for k in range(n + 1)]
        self.joints = self.joints or [f"joint{k}" for k in range(n)]


def machine(rng: random.Random) -> Machine:
    """One that can be simulated."""
    n = rng.randint(1, 4)
    at = rng.randrange(n)
    bodies = []
    for k in range(n):
        size = rng.uniform(0.05, 0.4)
        mass = 10.0 ** rng.uniform(-1.0, 1.0)
        moments = [mass * size**2 * rng.uniform(0.1, 0.2) for _ in range(3)]
        kind = "revolute" if k == at or rng.random() < 0.7 else "prismatic"
        axis = rng.choice(([0, 0, 1], [0, 1, 0], [1, 0, 0], [0.6, 0, 0.8]))
        bodies.append(
            {
                "mass": mass,
                "centre": [rng.uniform(-size, size) / 2 for _ in range(3)],
                "moments": moments,
                "kind": kind,
                "place": [0.0, 0.0, 0.0] if k == 0 else [rng.uniform(-size, size), size, 0.0],
                "axis": axis,
                "end": rng.uniform(-0.5, 0.5) * (1.0 if kind == "revolute" else 0.1),
            }
        )
    room = 10.0 ** rng.uniform(-5.0, -3.5)
    radius = rng.uniform(4e-3, 2e-2)
    aside = rng.uniform(0.0, 0.95) * room
    state = {"x": [aside, rng.uniform(-0.1, 0.3)], "y": [0.0, rng.uniform(-0.1, 0.1)]}
    frictions = (
        {"law": "ambrosio", "mu_d": rng.uniform(0.0, 0.3), "v0": 1e-4, "v1": 1e-3},
        {"law": "ambrosio", "mu_d": rng.uniform(0.0, 0.3), "v0": 1e-3, "v1": 1e-2},
    )
    step = rng.choice((5e-6, 1e-5))
    return Machine(
        bodies=bodies,
        clearance=at,
        sizes={
            "bearing_radius": radius,
            "bearing_length": rng.uniform(1.0, 3.0) * radius,
            "radial_clearance": room,
            "axial_clearance": room * rng.uniform(0.5, 2.0),
        },
        law=rng.choice(("lankarani-nikravesh", "hertz", "hunt-crossley", "flores")),
        friction=rng.choice(frictions),
        restitution=rng.uniform(0.5, 0.95),
        young=10.0 ** rng.uniform(9.5, 11.3),
        state=state,
        gravity=rng.choice(([0.0, 0.0, 0.0], [0.0, 0.0, -9.81], [1.0, -9.81, 2.0])),
        step=step,
        duration=step * rng.randint(50, 300),
        times=[0.0, rng.uniform(0.02, 0.2)],
        bandwidth=rng.uniform(20.0, 200.0),
        integrator=rng.choice(("multi-rate", "multi-rate", "semi-implicit-euler", "rk4")),
        macro_step=step * rng.choice((1, 5, 20)),
    )


Say = Callable[[float, str], Any]
"""How a quantity is written in a scenario: value in SI and its unit to a TOML value."""


def plainly(value: float, unit: str) -> Any:
    """The number in SI."""
    return value


def in_units(rng: random.Random) -> Say:
    """Each quantity in a unit of its own, as people write them."""

    def say(value: float, unit: str) -> Any:
        word, size = rng.choice(sorted(UNITS[unit].items()))
        number = rng.choice(("{:.17g}", "{!r}", "{:.17e}")).format(value / size)
        if not word:
            return value
        return rng.choice(("{} {}", "{} {} ", " {} {}")).format(number, word)

    return say


def urdf(made: Machine, order: random.Random | None = None) -> str:
    """The robot; `order` shuffles the elements, which say the same in any order."""
    elements = [f"<link name={quoteattr(made.links[0])}/>"]
    for k, body in enumerate(made.bodies):
        centre = " ".join(map(repr, body["centre"]))
        moments = " ".join(
            f'{name}="{value!r}"'
            for name, value in zip(("ixx", "iyy", "izz"), body["moments"], strict=True)
        )
        elements.append(
            f"<link name={quoteattr(made.links[k + 1])}><inertial>"
            f'<origin xyz="{centre}"/><mass value="{body["mass"]!r}"/>'
            f'<inertia {moments} ixy="0" ixz="0" iyz="0"/></inertial></link>'
        )
        elements.append(
            f'<joint name={quoteattr(made.joints[k])} type="{body["kind"]}">'
            f"<parent link={quoteattr(made.links[k])}/>"
            f"<child link={quoteattr(made.links[k + 1])}/>"
            f'<origin xyz="{" ".join(map(repr, body["place"]))}"/>'
            f'<axis xyz="{" ".join(map(repr, body["axis"]))}"/>'
            '<limit lower="-1e3" upper="1e3" effort="1e30" velocity="1e30"/></joint>'
        )
    if order is not None:
        order.shuffle(elements)
    return f'<robot name="r">{"".join(elements)}</robot>'


def scenario(made: Machine, say: Say = plainly) -> str:
    """The scenario with all its quantities as `say` writes them."""
    joint = made.joints[made.clearance]
    friction = {**made.friction}
    for name in ("v0", "v1"):
        friction[name] = say(friction[name], "m/s")
    material = {"young": say(made.young, "Pa"), "poisson": 0.3}
    tables: dict[str, Any] = {
        "robot": {
            "urdf": "r.urdf",
            "tool": made.links[-1],
            "gravity": [say(g, "m/s^2") for g in made.gravity],
        },
        "joints": {
            joint: {
                **{name: say(value, "m") for name, value in made.sizes.items()},
                "restitution": made.restitution,
                "normal": made.law,
                "friction": friction,
                "bearing_material": material,
                "journal_material": material,
            }
        },
        "motion": {
            "times": [say(t, "s") for t in made.times],
            "joints": {
                name: [0.0, say(body["end"], "rad" if body["kind"] == "revolute" else "m")]
                for name, body in zip(made.joints, made.bodies, strict=True)
            },
        },
        "drive": {"kind": "computed-torque", "bandwidth": say(made.bandwidth, "rad/s")},
        "integration": {
            "step": say(made.step, "s"),
            "duration": say(made.duration, "s"),
            "integrator": made.integrator,
            "start": "centred",
        },
        "start": {f"{joint}.{part}": say(at, "m") for part, (at, _) in made.state.items()},
        "start_speed": {
            f"{joint}.{part}": say(speed, "m/s") for part, (_, speed) in made.state.items()
        },
        "output": {"record_every": 1, "figures": False},
    }
    if made.integrator == "multi-rate":
        tables["integration"]["macro_step"] = say(made.macro_step, "s")
    text = "\n".join(f"{name} = {inline(table)}" for name, table in tables.items()) + "\n"
    return text.replace("\x7f", "\\u007f")


def write(folder: Path, text: str, robot: str) -> Path:
    """Scenario and robot as files; returns the scenario's."""
    folder.mkdir(exist_ok=True)
    (folder / "r.urdf").write_text(robot, encoding="utf-8")
    (folder / "s.toml").write_text(text, encoding="utf-8")
    return folder / "s.toml"


def simulation(path: Path) -> Simulation:
    """What the scenario says."""
    loaded = Scenario.load(path)
    return loaded.simulation(loaded.cases[0])


def run(what: Path | Simulation) -> Any:
    """Its result, with no word on standard error."""
    given = simulation(what) if isinstance(what, Path) else what
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        return given.run(check_step=False)


def numbers(result: Any) -> dict[str, np.ndarray]:
    """All histories of a result."""
    dataset = result.dataset
    return {
        str(name): dataset[name].values
        for name in ("time", *dataset.data_vars)
        if dataset[name].dtype.kind in "fi"
    }


def differing(
    one: Mapping[str, np.ndarray],
    other: Mapping[str, np.ndarray],
    tolerance: float = 0.0,
    scales: Mapping[str, float] | None = None,
) -> str:
    """Which history differs most by more than `tolerance` of its largest value; "" if none.

    Args:
        one, other: histories by name.
        tolerance: 0 asks for equal bits.
        scales: what values of `other` are multiplied with before.
    """
    if one.keys() != other.keys():
        return f"histories {sorted(one.keys() ^ other.keys())}"
    for name, first in one.items():
        second = other[name]
        if first.shape != second.shape:
            return f"{name} has shape {first.shape}, and {second.shape}"
        if scales and name in scales:
            second = second * scales[name]
        if tolerance == 0.0:
            if not np.array_equal(first, second, equal_nan=True):
                return f"{name} differs by {np.nanmax(np.abs(first - second)):.3g}"
            continue
        size = float(np.nanmax(np.abs(first), initial=0.0))
        off = np.abs(first - second)[~(np.isnan(first) & np.isnan(second))]
        if not off.max(initial=0.0) <= tolerance * size + 1e-300:
            return f"{name} differs by {off.max():.3g} of {size:.3g}"
    return ""


def scaled(made: Machine, mass: float = 1.0, length: float = 1.0, time: float = 1.0) -> Machine:
    """The same machine in other units of mass, length and time: powers of 2, so that no bit is
    lost.
    """
    speed = length / time
    bodies = []
    for body in made.bodies:
        turns = body["kind"] == "revolute"
        bodies.append(
            {
                **body,
                "mass": mass * body["mass"],
                "centre": [length * x for x in body["centre"]],
                "moments": [mass * length**2 * x for x in body["moments"]],
                "place": [length * x for x in body["place"]],
                "end": body["end"] * (1.0 if turns else length),
            }
        )
    friction = {
        **made.friction,
        "v0": speed * made.friction["v0"],
        "v1": speed * made.friction["v1"],
    }
    return replace(
        made,
        bodies=bodies,
        sizes={name: length * value for name, value in made.sizes.items()},
        friction=friction,
        young=made.young * mass / (length * time**2),
        state={part: [length * at, speed * pace] for part, (at, pace) in made.state.items()},
        gravity=[g * length / time**2 for g in made.gravity],
        step=time * made.step,
        duration=time * made.duration,
        times=[time * t for t in made.times],
        bandwidth=made.bandwidth / time,
        macro_step=time * made.macro_step,
    )


# ---- Checks: each draws a machine, and returns what is wrong, "" if nothing ---------------------


def first_run(rng: random.Random, folder: Path) -> tuple[Machine, dict[str, np.ndarray], Any]:
    """A machine, its histories and its result.

    Raises:
        JointplayError: it cannot be simulated, or not to the end, such as with too large a step.
    """
    made = machine(rng)
    result = run(write(folder / "first", scenario(made), urdf(made)))
    if result.status != Status.COMPLETED:
        raise JointplayError(" ".join(result.message.split()))
    return made, numbers(result), result


def energy(rng: random.Random, folder: Path) -> str:
    """Histories are finite, energies are Pinocchio's, and the balance holds or the run warns."""
    made = stressed(machine(rng), rng)
    path = write(folder / "first", scenario(made), urdf(made))
    given = simulation(path)
    result = run(given)
    if result.status != Status.COMPLETED:
        return ""  # it says so
    found, audit, model = numbers(result), result.audit, given.mechanism.model
    for name in ("q", "v", "drive", "tool_position", "kinetic_energy", "joint_force"):
        if not np.isfinite(found[name]).all():
            return f"a completed run has {name} that is not finite"
    data = model.createData()
    lowest = np.zeros(len(found["q"]))
    for k, (q, v) in enumerate(zip(found["q"], found["v"], strict=True)):
        lowest[k] = pin.computeKineticEnergy(model, data, q, v)
    off = np.abs(lowest - found["kinetic_energy"]).max()
    if not off <= 1e-9 * np.abs(lowest).max() + 1e-15:
        return f"kinetic energy is off by {off:.3g} J"
    heights = np.array([pin.computePotentialEnergy(model, data, q) for q in found["q"]])
    change = heights - heights[0] - found["potential_energy"] + found["potential_energy"][0]
    size = np.abs(heights).max() + np.abs(found["potential_energy"]).max()
    if not np.abs(change).max() <= 1e-9 * size + 1e-15:
        return f"potential energy is off by {np.abs(change).max():.3g} J"
    residual = np.abs(found["energy_residual"]).max()
    if not residual <= audit.energy_residual * (1.0 + 1e-9) + 1e-15:
        return f"the audit says {audit.energy_residual:.3g} J, the histories {residual:.3g} J"
    worried = any("energy balance" in text for text in audit.warnings)
    if audit.relative_energy_residual > ENERGY_WARNING and not worried:
        return f"energy is off by {audit.relative_energy_residual:.3g}, with no warning"
    return _power_balance(made, found, audit)


def _power_balance(made: Machine, found: Mapping[str, np.ndarray], audit: Any) -> str:
    """Without contact the drives' work, by the trapezium rule over the records, is what energy
    grows by.
    """
    if audit.impacts or audit.warnings or (found["gap_min"] <= 0.0).any():
        return ""
    power = (found["drive"] * found["v"]).sum(axis=1)
    work = float((0.5 * (power[1:] + power[:-1]) * np.diff(found["time"])).sum())
    total = found["kinetic_energy"] + found["potential_energy"]
    grown = float(total[-1] - total[0])
    size = float(np.abs(np.diff(found["kinetic_energy"])).sum()) + abs(work)
    if not abs(grown - work) <= 0.02 * size + 1e-12:
        return f"energy grows by {grown:.6g} J, and the drives work {work:.6g} J"
    return ""


def stressed(made: Machine, rng: random.Random) -> Machine:
    """A quantity or two of the machine far from what is sensible."""
    for _ in range(rng.randint(0, 2)):
        factor = 10.0 ** rng.uniform(-4.0, 4.0)
        name = rng.choice(("young", "step", "bandwidth", "restitution", "mass", "state", "room"))
        if name == "mass":
            body = rng.choice(made.bodies)
            body["mass"] *= factor
            body["moments"] = [factor * moment for moment in body["moments"]]
        elif name == "state":
            made.state["x"][1] *= factor
        elif name == "room":
            made.sizes["radial_clearance"] *= factor
        elif name == "restitution":
            made.restitution = rng.choice((1.0, 1e-3, 0.05))
        elif name == "step":  # so that a run has the steps it had
            made = replace(made, step=made.step * factor, duration=made.duration * factor,
                           macro_step=made.macro_step * factor)  # fmt: skip
        else:
            made = replace(made, **{name: getattr(made, name) * factor})
    return made


def renamed(rng: random.Random, folder: Path) -> str:
    """Other names, odd ones too: the same bits, or a refusal in one line of odd names."""
    made, before, _ = first_run(rng, folder)
    plain = rng.random() < 0.5
    pool = [f"{letter}{k}" for k, letter in enumerate("zyxwvutsrqponm")] if plain else list(ODD)
    names = rng.sample(pool, len(made.links) + len(made.joints))
    other = replace(made, links=names[: len(made.links)], joints=names[len(made.links) :])
    try:
        after = run(write(folder / "other", scenario(other), urdf(other)))
    except JointplayError as error:
        return f"refused: {error}" if plain or "\n" in str(error) else ""
    wrong = differing(before, numbers(after))
    return f"renamed, {wrong}" if wrong else ""


def reordered(rng: random.Random, folder: Path) -> str:
    """Links and joints declared in another order."""
    made, before, _ = first_run(rng, folder)
    after = run(write(folder / "other", scenario(made), urdf(made, rng)))
    wrong = differing(before, numbers(after), ROUNDING)
    return f"declared in another order, {wrong}" if wrong else ""


def rewritten(rng: random.Random, folder: Path) -> str:
    """The same quantities in other units.

    Histories may part after impacts, which magnify the last digit; positions do not.
    """
    made, before, _ = first_run(rng, folder)
    after = numbers(run(write(folder / "other", scenario(made, in_units(rng)), urdf(made))))
    wrong = differing({"q": before["q"]}, {"q": after["q"]}, 1e3 * ROUNDING)
    return f"in other units, {wrong}" if wrong else ""


def heavier(rng: random.Random, folder: Path) -> str:
    """All masses and moduli twice, or a quarter, as large: the same motion.

    To the tolerance of the velocity solve. Lengths and times do not scale so: edges are rounded
    over 0.1 um, and references are tabulated every 0.1 ms, whatever the machine.
    """
    made, before, _ = first_run(rng, folder)
    factor = rng.choice((0.25, 2.0, 1024.0))
    other = scaled(made, mass=factor)
    after = numbers(run(write(folder / "other", scenario(other), urdf(other))))
    scales = dict.fromkeys(("drive", "joint_force", "kinetic_energy"), 1.0 / factor)
    some = ("q", "v", "tool_position", "gap", *scales)
    wrong = differing(
        {name: before[name] for name in some}, {name: after[name] for name in some},
        1e3 * ROUNDING, scales,
    )  # fmt: skip
    return f"{factor:g} times as heavy, {wrong}" if wrong else ""


def stop(going: Any, cut: int) -> None:
    """Step until a step is reached, and stop there as one stops who is told to."""
    if cut > going.workspace.steps:
        next(moment for moment in going.steps() if moment.step >= cut)


def resumed(rng: random.Random, folder: Path) -> str:
    """Cut by a checkpoint, or by several, and gone on with: the same bits."""
    made, before, _ = first_run(rng, folder)
    steps = round(made.duration / made.step)
    cuts = sorted(rng.sample(range(1, steps), min(rng.randint(1, 3), steps - 1)))
    going = Run(simulation(folder / "first" / "s.toml"))
    for cut in cuts:
        stop(going, cut)
        going = Simulation.resume(going.checkpoint(folder / f"{cut}.checkpoint"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)
        after = going.finish(check_step=False)
    wrong = differing(before, numbers(after))
    return f"resumed at {cuts} of {steps}, {wrong}" if wrong else ""


WAYS: Sequence[Callable[[random.Random, Path], str]] = (
    renamed, reordered, rewritten, heavier, resumed,
)  # fmt: skip
"""What is compared with a run as it is."""
