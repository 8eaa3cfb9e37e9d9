"""Summary of a scenario as it was understood: the inputs of its runs, with units."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from jointplay.accuracy.robot_errors import RobotErrors
from jointplay.base.schema import fields_of
from jointplay.base.tables import counted, fact_lines, few
from jointplay.base.units import readable
from jointplay.model.gear import Gear
from jointplay.model.impact import contact_duration
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.physics.contact.functions import OfFunction
from jointplay.physics.contact.law import Law
from jointplay.physics.joints import RollingBearing
from jointplay.scenario.build import errors_of
from jointplay.scenario.reading import Scenario
from jointplay.simulation.initial import settled_drives
from jointplay.simulation.loads.drive import BANDWIDTH, ComputedTorque
from jointplay.simulation.loads.limits import LIMITS
from jointplay.simulation.run import Run


def summary(scenario: Scenario, runs: Mapping[str, Run]) -> str:
    """Text of a scenario's inputs: what all cases have in common, then each case's own."""
    by_case = {
        case: facts(run)
        | _known_errors(errors_of(scenario.model(case), run.mechanism), run.mechanism)
        for case, run in runs.items()
    }
    cases = list(by_case.values())
    common = {
        label: text
        for label, text in cases[0].items()
        if all(further.get(label) == text for further in cases)
    }
    lines = [f"{scenario.path}: {scenario.title}", *fact_lines(common)]
    if len(by_case) > 1:
        for case, of_case in by_case.items():
            rest = {label: text for label, text in of_case.items() if label not in common}
            lines += [f"case {case}", *fact_lines(rest)]
    return "\n".join([*lines, *(f"  {note}" for note in scenario.notes)])


def _known_errors(errors: RobotErrors | None, mechanism: Mechanism) -> dict[str, str]:
    """Errors besides play, which `jointplay budget --whole` counts, as facts."""
    if errors is None:
        return {}
    by_joint = {
        f"errors of {name}": _fields(joint_errors, joint=mechanism.description.joints[name])
        for name, joint_errors in errors.joints.items()
    }
    return {"errors": _fields(replace(errors, joints={}))} | by_joint


def facts(run: Run) -> dict[str, str]:
    """The inputs of a run with their units, by label; inputs that are not set are left out."""
    simulation, mechanism = run.simulation, run.mechanism
    facts = {"robot": f"{mechanism.description.path}, tool {mechanism.tool}"}
    known = mechanism.facts()[1]
    facts |= {name: known[name] for name in ("gravity", "base", "held joints") if name in known}
    if mechanism.allow_unphysical:
        facts["impossible inertias"] = few(list(mechanism.allow_unphysical))
    facts |= {f"loop {name}": known[f"loop {name}"] for name in mechanism.loops}
    facts |= {f"link {name}": details for name, details in mechanism.flexible.items()}
    hinges = {name for names in mechanism.hinges.values() for name in names}
    step = simulation.step
    for name, joint in mechanism.clearance.items():
        if name in hinges:
            continue
        steps = contact_duration(mechanism, name, run.workspace.q) / step
        details = f"{joint.kind}: {_fields(joint)}"
        if isinstance(joint, RollingBearing):
            details = f"{joint.summary}: {_fields(joint, zeros=False)}"
            guessed = "; ".join(
                f"{field.replace('_', ' ')} {text}" for field, text in joint.estimates.items()
            )
            details += f"; estimated: {guessed}" if guessed else ""
        hits = f"; {counted(f'{steps:.0f}', 'step')} in an impact" if joint.springs is None else ""
        facts[f"joint {name}"] = details + hits
    if not mechanism.clearance:
        facts["joints"] = "all ideal"
    for name, gear in mechanism.gears.items():
        kind = "" if gear.kind == Gear.kind else f"{gear.kind}: "
        notes = f"; {gear.notes}" if gear.notes else ""
        details = _fields(gear, joint=mechanism.description.joints[name])
        facts[f"gear {name}"] = f"{kind}{details}{notes}"
    if simulation.motion is not None:
        joints = ", ".join(simulation.motion.joints)
        facts["motion"] = f"{joints}: {simulation.motion.summary}"
    drives: dict[str, list[str]] = {}
    for name, drive in settled_drives(simulation).items():
        if isinstance(drive, ComputedTorque):
            drive = replace(drive, bandwidth=drive.bandwidth or BANDWIDTH)
        details = _fields(drive, joint=mechanism.description.joints[name])
        drives.setdefault(f"{drive.kind}{f' ({details})' if details else ''}", []).append(name)
    facts["drives"] = "; ".join(
        f"{', '.join(names)}: {details}" for details, names in drives.items()
    )
    for name, losses in run.friction.items():
        if losses.coulomb or losses.viscous or losses.static:
            facts[f"friction {name}"] = _fields(losses, joint=mechanism.description.joints[name])
    for number, payload in enumerate(simulation.payloads, 1):
        facts[f"payload {number}"] = f"at {payload.frame}: {_fields(payload)}"
    for name, load in simulation.loads.items():
        entry = mechanism.description.joints.get(getattr(load, "joint", ""))
        facts[f"load {name}"] = f"{load.kind}: {_fields(load, entry, zeros=False)}"
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
    """A coordinate rounded to 1e-9 rad or m, without -0."""
    return round(float(coordinate), 9) + 0.0


def _or_none(name: str, value: float | None, unit: str) -> str:
    return "" if value is None else f"{name}{readable(value, unit)}"


def _part(value: Any, unit: str) -> str:
    """Text of an entry of a list: a number with its unit, a word, a list, or a value's fields."""
    if isinstance(value, tuple | list):
        return f"({', '.join(_part(inner, unit) for inner in value)})"
    if isinstance(value, str):
        return value
    return readable(value, unit) if isinstance(value, float | int) else f"[{_fields(value)}]"


def _fields(described: Any, joint: Any = None, zeros: bool = True) -> str:
    """Fields of a value with units, without those not set, nor empty or zero unless `zeros`."""
    parts = []
    kind: Any = type(described)
    # A user's function has a name and numbers only as files describe it.
    texts = described.describe() if isinstance(described, OfFunction) else None
    for name, field in fields_of(kind).items():
        value = getattr(described, name, None) if texts is None else texts.get(name)
        slides = len(field.units) > 1 and joint is not None and joint.slides
        unit = field.units[slides]
        name = name.replace("_", " ")
        unset = value is None or value is False
        unset = unset or (isinstance(value, Mapping | list | tuple) and not value)
        zero = not any(value) if isinstance(value, list | tuple) else not value
        label = name == "frame" and isinstance(described, Payload)  # the fact begins with it
        if unset or label or name == "source" or (zero and not zeros):
            continue
        if value is True:
            parts.append(name)
        elif isinstance(value, float | int):
            parts.append(f"{name} {readable(value, unit)}")
        elif isinstance(value, list | tuple):
            parts.append(f"{name} ({', '.join(_part(item, unit) for item in value)})")
        elif isinstance(value, str):
            parts.append(f"{name} {value}")
        elif isinstance(value, Law):
            inside = _fields(value)
            parts.append(f"{name} {value.name}{f' ({inside})' if inside else ''}")
        else:
            parts.append(f"{name} ({_fields(value)})")
    return ", ".join(parts)
