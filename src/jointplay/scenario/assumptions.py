"""The settings that decide a run's numbers, and where each came from (the user or a default)."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

from jointplay.base.origins import Origins, given
from jointplay.base.schema import fields_of
from jointplay.base.tables import few
from jointplay.base.units import readable
from jointplay.model.gear import Gear
from jointplay.model.gear_rules import SPREAD
from jointplay.model.inertias import impossible_inertias
from jointplay.physics.joints.base import SlidingClearance
from jointplay.simulation.loads.drive import BANDWIDTH
from jointplay.simulation.values import of_joint

if TYPE_CHECKING:
    from jointplay.accuracy.poses import Poses
    from jointplay.model.mechanism import Mechanism
    from jointplay.scenario.reading import Scenario
    from jointplay.simulation.simulation import Simulation

ASSUMED = "(assumed)"
"""Mark of a value that nobody gave."""
_LABELS = {"kind": "", "normal": "normal force"}
"""Labels of fields that are not called by their names."""


def decisive(scenario: Scenario, simulations: Mapping[str, Simulation]) -> list[str]:
    """Lines on a scenario's tool, sizes, restitution and friction of joints, motion, and choices.

    Values that nobody gave are marked. Lines that hold for all cases come first, then each case's
    own.

    Args:
        scenario: the scenario, with its assumptions.
        simulations: simulations of its cases, by label.
    """
    by_case = {
        case: [
            *_robot(simulation.mechanism, tool_reason(scenario)),
            *_joints(simulation.mechanism, scenario.origins(case)),
            *_motion(simulation, scenario.origins(case)),
        ]
        for case, simulation in simulations.items()
    }
    first = next(iter(by_case.values()), [])
    common = [line for line in first if all(line in lines for lines in by_case.values())]
    of_cases = [
        f"note: case {case}: {line[6:]}" if line.startswith("note: ") else f"case {case}: {line}"
        for case, lines in by_case.items()
        for line in lines
        if line not in common
    ]
    # That a motion was not given matters more than how its points are taken: that comes last.
    motions = (
        [line for line in common if line.startswith("motion: ")] if scenario.assumptions else []
    )
    return [
        *(line for line in common if line not in motions),
        *of_cases,
        *scenario.assumptions,
        *motions,
    ]


def notes_at_poses(
    scenario: Scenario,
    case: str,
    poses: Poses,
    *,
    named: Collection[str] = (),
    play: bool = True,
    relative_to: str | None = None,
) -> list[str]:
    """Lines on what was chosen, and what does not count, for a robot that stands at poses.

    Args:
        scenario, case: the scenario, and the label of its case.
        poses: the machine and the poses at which it stands.
        named: joints whose play was asked for; a line says if one does not move the tool.
        play: whether the play of all joints is told.
        relative_to: see `budget`.
    """
    mechanism = scenario.mechanism(case)
    lines = [mechanism.held] if mechanism.held else []
    lines += mechanism.description.doubts
    if wrong := impossible_inertias(mechanism.description.parsed):
        lines.append(
            f"inertias that no rigid body has, without effect where nothing moves: "
            f"{few(list(wrong))}; jointplay run needs right ones"
        )
    if mechanism.free_base is not None:
        root = mechanism.description.root
        lines.append(
            f"the base {root!r} is free in the scenario; here it is held, as if bolted to the "
            "ground"
        )
    if reason := mechanism.tool_reason or tool_reason(scenario):
        lines.append(f"tool: {mechanism.tool!r} (chosen: {reason}; see --tool)")
    movers = mechanism.movers(relative_to)
    seen = "" if relative_to is None else f" as seen from {relative_to!r}"
    for name in named:
        if name not in movers:
            tool = f"{mechanism.tool!r}{seen}"
            lines.append(f"note: {name} does not move {tool}, so it adds nothing to the error")
    if play and mechanism.clearance:
        sizes = _joints(mechanism, scenario.origins(case), moves=False)
        lines += [f"play: {size}" for size in sizes]
    lines += by_rule(mechanism, "stiffness")
    if bodies := poses.machine.payloads:
        mass = " and ".join(f"{body.mass:g} kg" for body in bodies)
        lines.append(f"payload: {mass}, in hand at all poses")
    effects: dict[str, list[str]] = {}
    for name, load in poses.machine.loads.items():
        reason = load.left_out()
        effects.setdefault(f"are left out: {reason}" if reason else "act as at time 0", []).append(
            name
        )
    for effect, names in effects.items():
        lines.append(f"loads: {few(names)} {effect}")
    lines += [*scenario.notes, *scenario.assumptions]
    return [*dict.fromkeys(lines), *([poses.loops] if poses.loops else [])]


def tool_reason(scenario: Scenario) -> str:
    """Why a tool was chosen before the joints with play were known; empty if none was."""
    chosen = (
        setting
        for setting in scenario.settings
        if setting.assumed and setting.key == ("robot", "tool")
    )
    return next((setting.source for setting in chosen), "")


def by_rule(mechanism: Mechanism, quantity: str) -> list[str]:
    """Lines on the numbers that rules gave for a `quantity` of gears, one for each number."""
    by_text: dict[str, list[str]] = {}
    for (name, field), rule in mechanism.rules.items():
        if field == quantity:
            unit = fields_of(Gear)[quantity].units[mechanism.description.joints[name].slides]
            by_text.setdefault(
                f"{readable(rule.value, unit, 3)} {rule.reason}{'; a guess' * rule.guess}", []
            ).append(name)
    factor = f", to a factor of {SPREAD:g}" if quantity == "stiffness" else ""
    option = (quantity if quantity.startswith("rotor") else f"gear-{quantity}").replace("_", "-")
    return [
        f"gears: {quantity.replace('_', ' ')} of {few(names)} {rule}{factor} {ASSUMED}; see "
        f"--{option}"
        for rule, names in by_text.items()
    ]


def assumed(causes: Collection[str]) -> str:
    """A clause on assumed values, which ends a sentence; empty without any."""
    return f"; assumed: {', '.join(causes)}" if causes else ""


def assumed_clearances(scenario: Scenario, case: str, mechanism: Mechanism) -> list[str]:
    """Clearances that nobody gave, to which the error is proportional, a few words each."""
    origins, causes = scenario.origins(case), list[str]()
    for name, joint in mechanism.clearance.items():
        if joint.has_play and isinstance(joint, SlidingClearance) and joint.fitted is None:
            across, instead = next(iter(joint.clearance_fields.items()))
            if not {across, instead} & given(origins, "joints", name):
                causes.append(f"clearance of {readable(getattr(joint, across), 'm')}")
    return list(dict.fromkeys(causes))


def assumed_bearings(scenario: Scenario, case: str, mechanism: Mechanism) -> list[str]:
    """Sizes of bearings that nobody gave, which decide how far journals tilt, a few words each."""
    origins, causes = scenario.origins(case), list[str]()
    for name, joint in mechanism.clearance.items():
        sizes = [key for key in ("bearing_radius", "bearing_length") if hasattr(joint, key)]
        known = given(origins, "joints", name) | ({sizes[0]} if joint.fitted and sizes else set())
        if len(sizes) == 2 and not known.issuperset(sizes):
            diameter, length = 2e3 * getattr(joint, sizes[0]), 1e3 * getattr(joint, sizes[1])
            if sizes[0] in known:
                causes.append(f"bearings {length:g} mm long")
            elif sizes[1] in known:
                causes.append(f"bearings of {diameter:g} mm")
            else:
                causes.append(f"bearings of {diameter:g} x {length:g} mm")
    return list(dict.fromkeys(causes))


def undecided_at_rest(
    scenario: Scenario, case: str, mechanism: Mechanism, loaded: bool
) -> list[str]:
    """Values that nobody gave and that decide where a machine rests, a few words each.

    `loaded`: whether it bears loads that its drives do not know.
    """
    origins, causes = scenario.origins(case), assumed_clearances(scenario, case, mechanism)
    causes += assumed_bearings(scenario, case, mechanism)
    if any(quantity == "stiffness" for _, quantity in mechanism.rules):
        causes.append(f"gears' stiffness by rule, to a factor of {SPREAD:g}")
    geared = set(mechanism.gears) - given(origins, "drives")
    if geared and "encoder" not in given(origins, "drive"):
        causes.append("encoders on the motors")
    driven = "drive" in given(origins)
    if loaded and not driven and set(mechanism.joints) - given(origins, "drives"):
        causes.append(f"drives of {BANDWIDTH:g} rad/s")
    return list(dict.fromkeys(causes))


def _robot(mechanism: Mechanism, reason: str) -> list[str]:
    """Lines on the tool and flexible links."""
    reason = mechanism.tool_reason or reason
    why = f" (chosen: {reason}; --tool FRAME selects another)"
    lines = [f"tool: {mechanism.tool}{why if reason else ''}"]
    lines += [f"link {name}: {text}" for name, text in mechanism.flexible.items()]
    loose = [*mechanism.clearance, *mechanism.gears]
    if loose and set(loose).isdisjoint(mechanism.movers()):
        lines.append(
            f"note: no joint with play moves the tool {mechanism.tool!r}: play in "
            f"{', '.join(loose)} shows in it only through the drives; --tool selects another frame"
        )
    return lines


def _joints(mechanism: Mechanism, origins: Origins, moves: bool = True) -> list[str]:
    """A line on the joints with clearance, alike ones together; restitution only if it `moves`."""
    hinges = {name for names in mechanism.hinges.values() for name in names}
    alike: dict[str, list[str]] = {}
    for name, joint in mechanism.clearance.items():
        if name not in hinges:
            parts = []
            for field, text, known in of_joint(joint, given(origins, "joints", name)):
                label = _LABELS.get(field, field.replace("_", " "))
                if moves or field != "restitution":
                    parts.append(f"{label} {text}{'' if known else f' {ASSUMED}'}".strip())
            alike.setdefault(", ".join(parts), []).append(name)
    lines = [f"{', '.join(names)}: {parts}" for parts, names in alike.items()]
    return ["; ".join(lines)] if lines else []


def _motion(simulation: Simulation, origins: Origins) -> list[str]:
    """Lines on how a motion's points are interpolated, if not given, and on jumps in its speed."""
    motion, table = simulation.motion, given(origins, "motion")
    if motion is None or not {"file", "joints"} & table:
        return []
    lines = []
    if "interpolation" not in table:
        lines.append(f"motion: {motion.summary} (--interpolation selects)")
    if cut := motion.cut_off(simulation.duration or motion.duration):
        lines.append(
            "note: the motion stands still beyond its points: lost there is "
            f"{_of_joints(simulation, cut, '/s')}"
        )
    if noise := motion.noise:
        lines.append(
            "note: speeds jump from sample to sample, and the spline through them accelerates by "
            f"up to {_of_joints(simulation, noise, '/s²')}: smooth noise of positions or times"
        )
    return lines


def _of_joints(simulation: Simulation, values: Mapping[str, float], rate: str) -> str:
    """Values by joint as text, in the unit of the joint's position per `rate`."""
    joints = simulation.mechanism.description.joints
    return few([f"{n} {readable(x, joints[n].unit + rate, 4)}" for n, x in values.items()])
