"""What decides the numbers of a run, and who said it: the user, or nobody."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from jointplay.base.schema import fields_of
from jointplay.base.units import readable
from jointplay.physics.contact.law import FrictionLaw
from jointplay.physics.joints import Clearance, SlidingClearance

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.load import Scenario
    from jointplay.simulation.simulation import Simulation

ASSUMED = "(assumed)"


def decisive(scenario: Scenario, simulations: Mapping[str, Simulation]) -> list[str]:
    """Tool and why, sizes and clearances of bearings, restitution and friction, a line each.

    What nobody gave is marked. Lines that hold for all cases come first, then each case's own.

    Args:
        scenario: what was given.
        simulations: of its cases, by label.
    """
    every = {
        case: [*_robot(simulation.mechanism), *_joints(simulation.mechanism, scenario.given(case))]
        for case, simulation in simulations.items()
    }
    first = next(iter(every.values()), [])
    common = [line for line in first if all(line in lines for lines in every.values())]
    own = [
        f"case {case}: {line}"
        for case, lines in every.items()
        for line in lines
        if line not in common
    ]
    return [*common, *own, *scenario.assumptions]


def _robot(mechanism: Mechanism) -> list[str]:
    why = f" (chosen: {mechanism.tool_reason}; --tool FRAME selects another)"
    lines = [f"tool: {mechanism.tool}{why if mechanism.tool_reason else ''}"]
    lines += [f"link {name}: {words}" for name, words in mechanism.flexible.items()]
    loose = [*mechanism.clearance, *mechanism.gears]
    if loose and not mechanism.moves_tool(loose):
        lines.append(
            f"note: no joint with play moves the tool {mechanism.tool!r}: play in "
            f"{', '.join(loose)} shows in it only through the drives; --tool selects another frame"
        )
    return lines


def _joints(mechanism: Mechanism, given: Mapping[str, Any]) -> list[str]:
    tables = given.get("joints", {})
    hinges = {name for its in mechanism.hinges.values() for name in its}
    return [
        f"{name}: {', '.join(_parts(joint, tables.get(name, {})))}"
        for name, joint in mechanism.clearance.items()
        if name not in hinges
    ]


def _parts(joint: Clearance, given: Mapping[str, Any]) -> list[str]:
    if not isinstance(joint, SlidingClearance):
        return [joint.words]
    parts = []
    said = set(given)
    for name, field in fields_of(type(joint)).items():
        value = getattr(joint, name)
        instead = joint.clearance_fields.get(name)
        derived = name.startswith("journal_") and name not in said
        if field.units[0] != "m" or not isinstance(value, float) or derived or value == 0.0:
            continue
        known = name in said or instead in said
        parts.append(f"{name.replace('_', ' ')} {readable(value, 'm')}{_mark(known)}")
    parts.append(f"restitution {joint.restitution:g}{_mark('restitution' in said)}")
    parts.append(f"{_friction(joint.friction)}{_mark('friction' in said)}")
    return parts


def _mark(known: bool) -> str:
    return "" if known else f" {ASSUMED}"


def _friction(law: FrictionLaw) -> str:
    """Name of a law, and its first number, which is the coefficient."""
    name = next(iter(fields_of(type(law))), "")
    return f"friction {law.name}" + (f" {name} {getattr(law, name):g}" if name else "")
