"""How a scenario was understood, in a few lines."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from jointplay.accuracy.robot_errors import RobotErrors
from jointplay.base.schema import fields_of
from jointplay.base.tables import counted, fact_lines
from jointplay.base.units import readable
from jointplay.model.gear import Gear
from jointplay.model.impact import contact_duration
from jointplay.model.mechanism import Mechanism
from jointplay.physics.contact.law import Law
from jointplay.physics.joints import RollingBearing
from jointplay.scenario.build import errors_of
from jointplay.scenario.reading import Scenario
from jointplay.simulation.initial import settled_drives
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import BANDWIDTH, ComputedTorque
from jointplay.simulation.loads.limits import LIMITS
from jointplay.simulation.run import Run


def summary(scenario: Scenario, runs: Mapping[str, Run]) -> str:
    """What all cases have in common, then what is each case's own."""
    facts = {
        case: _facts(run)
        | _known_errors(errors_of(scenario.model(case), run.mechanism), run.mechanism)
        for case, run in runs.items()
    }
    every = list(facts.values())
    common = {
        what: text
        for what, text in every[0].items()
        if all(other.get(what) == text for other in every)
    }
    lines = [f"{scenario.path}: {scenario.title}", *fact_lines(common)]
    if len(facts) > 1:
        for case, own in facts.items():
            rest = {what: text for what, text in own.items() if what not in common}
            lines += [f"case {case}", *fact_lines(rest)]
    return "\n".join([*lines, *(f"  {note}" for note in scenario.notes)])


def _known_errors(errors: RobotErrors | None, mechanism: Mechanism) -> dict[str, str]:
    """What is known of causes besides play, which `jointplay budget --whole` counts."""
    if errors is None:
        return {}
    own = {
        f"errors of {name}": _fields(one, joint=mechanism.description.joints[name])
        for name, one in errors.joints.items()
    }
    return {"errors": _fields(replace(errors, joints={}))} | own


def _facts(run: Run) -> dict[str, str]:
    simulation, mechanism = run.simulation, run.mechanism
    facts = {
        "robot": f"{mechanism.description.path}, tool {mechanism.tool}",
        "gravity": mechanism.facts()[1]["gravity"],
    }
    for name, loop in mechanism.loops.items():
        facts[f"loop {name}"] = (
            f"{mechanism.loop_class(name).kind}, {loop.bearing_link} - {loop.journal_link}"
        )
    facts |= {f"link {name}": words for name, words in mechanism.flexible.items()}
    hinges = {name for its in mechanism.hinges.values() for name in its}
    step = simulation.step
    for name, joint in mechanism.clearance.items():
        if name in hinges:
            continue
        steps = contact_duration(mechanism, name, run.workspace.q) / step
        words = f"{joint.kind}: {_fields(joint)}"
        if isinstance(joint, RollingBearing):
            words = f"{joint.summary}: {_fields(joint, zeros=False)}"
            guessed = "; ".join(
                f"{field.replace('_', ' ')} {text}" for field, text in joint.estimates.items()
            )
            words += f"; estimated: {guessed}" if guessed else ""
        hits = f"; {counted(f'{steps:.0f}', 'step')} in an impact" if joint.springs is None else ""
        facts[f"joint {name}"] = words + hits
    if not mechanism.clearance:
        facts["joints"] = "all ideal"
    for name, gear in mechanism.gears.items():
        kind = "" if gear.kind == Gear.kind else f"{gear.kind}: "
        notes = f"; {gear.notes}" if gear.notes else ""
        words = _fields(gear, joint=mechanism.description.joints[name])
        facts[f"gear {name}"] = f"{kind}{words}{notes}"
    if simulation.motion is not None:
        joints = ", ".join(simulation.motion.joints)
        facts["motion"] = f"{joints}: {simulation.motion.summary}"
    drives: dict[str, list[str]] = {}
    for name, drive in settled_drives(simulation).items():
        if isinstance(drive, ComputedTorque):
            drive = replace(drive, bandwidth=drive.bandwidth or BANDWIDTH)
        words = _fields(drive, joint=mechanism.description.joints[name])
        drives.setdefault(f"{drive.kind}{f' ({words})' if words else ''}", []).append(name)
    facts["drives"] = "; ".join(f"{', '.join(names)}: {words}" for words, names in drives.items())
    for name, losses in run.friction.items():
        if losses.coulomb or losses.viscous or losses.static:
            facts[f"friction {name}"] = _fields(losses, joint=mechanism.description.joints[name])
    for number, payload in enumerate(simulation.payloads, 1):
        facts[f"payload {number}"] = f"at {payload.frame}: {_fields(payload)}"
    for name, load in simulation.loads.items():
        facts[f"load {name}"] = f"{load.kind}: {_load_fields(load, mechanism)}"
    if simulation.limits != LIMITS[0]:
        facts["limits"] = simulation.limits
    units = {name: entry.unit for name, entry in mechanism.description.joints.items()}
    facts["start"] = ", ".join(
        f"{name} {readable(_place(run.workspace.q[mechanism.coordinate(name)]), units[name])}"
        for name in mechanism.joints
    )
    facts["integration"] = (
        f"{simulation.integrator}, {readable(run.total_steps * step, 's')} in "
        f"{counted(run.total_steps, 'step')} of {readable(step, 's')}, "
        f"a record every {simulation.record_every}"
        + _or_none(", macro step ", simulation.macro_step, "s")
        + _or_none(", tolerance ", simulation.tolerance, "")
        + ("" if simulation.seed is None else f", seed {simulation.seed}")
    )
    return facts


def _place(coordinate: float) -> float:
    """A coordinate less what is rounding: below 1e-9 rad or m it is 0."""
    return round(float(coordinate), 9) + 0.0


def _load_fields(load: Load, mechanism: Mechanism) -> str:
    words = []
    entry = mechanism.description.joints.get(getattr(load, "joint", ""))
    slides = entry is not None and entry.slides
    description = load.describe()
    for name, field in fields_of(type(load)).items():
        value = description.get(name)
        numbers = value if isinstance(value, list) else [value]
        if name == "source" or value is None or not any(numbers):
            continue
        unit = field.units[slides and len(field.units) > 1]
        words.append(f"{name.replace('_', ' ')} {_part(value, unit)}")
    return ", ".join(words)


def _or_none(name: str, value: float | None, unit: str) -> str:
    return "" if value is None else f"{name}{readable(value, unit)}"


def _part(one: Any, unit: str) -> str:
    """An entry of a list: a number with its unit, a word, a list, or a value with fields."""
    if isinstance(one, tuple | list):
        return f"({', '.join(_part(inner, unit) for inner in one)})"
    if isinstance(one, str):
        return one
    return readable(one, unit) if isinstance(one, float | int) else f"[{_fields(one)}]"


def _fields(thing: Any, joint: Any = None, zeros: bool = True) -> str:
    """Fields of a value, with units; those not set left out, and without `zeros` those of zero."""
    words = []
    kind: Any = type(thing)
    for name, field in fields_of(kind).items():
        value = getattr(thing, name, None)
        slides = len(field.units) > 1 and joint is not None and joint.slides
        unit = field.units[slides]
        name = name.replace("_", " ")
        unset = value is None or value is False
        unset = unset or (isinstance(value, Mapping | tuple) and not value)
        if unset or name == "frame" or (value == 0 and not zeros):
            continue
        if value is True:
            words.append(name)
        elif isinstance(value, float | int):
            words.append(f"{name} {readable(value, unit)}")
        elif isinstance(value, tuple):
            words.append(f"{name} ({', '.join(_part(one, unit) for one in value)})")
        elif isinstance(value, str):
            words.append(f"{name} {value}")
        elif isinstance(value, Law):
            inside = _fields(value)
            words.append(f"{name} {value.name}{f' ({inside})' if inside else ''}")
        else:
            words.append(f"{name} ({_fields(value)})")
    return ", ".join(words)
