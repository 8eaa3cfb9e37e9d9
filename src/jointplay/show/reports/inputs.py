"""The block with every input of the runs, and motions, laws and robots in full."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.schema import family_of, fields_of
from jointplay.base.tables import Table
from jointplay.base.units import displayed, readable
from jointplay.model.free_base import FREE
from jointplay.model.gear import Gearing
from jointplay.model.urdf import parse
from jointplay.physics.contact.film import FilmLaw
from jointplay.physics.contact.law import FrictionLaw, NormalForceLaw
from jointplay.physics.joints import Clearance, RollingBearing
from jointplay.physics.joints.base import Material
from jointplay.show.reports.cases import Case, Runs
from jointplay.show.reports.html import Html, markup
from jointplay.show.reports.parts import Cell, Fold, Grid, Part
from jointplay.simulation import analysis
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result

_SYMBOLS = {
    "radial_clearance": "radial clearance C_r",
    "axial_clearance": "axial clearance C_a, each side",
    "bearing_radius": "bearing radius R_i",
    "bearing_length": "bearing length L_i",
    "journal_radius": "journal radius R_j",
    "journal_length": "journal length L_j",
    "restitution": "restitution c_e",
    "clearance": "clearance across x, each side",
    "clearance_y": "clearance across y, each side",
    "temperature_difference": "inner ring warmer by",
    "damping_time": "damping over stiffness",
    "drag_torque": "friction torque without load",
    "rolling_friction": "friction over load and half the bore",
    "inner_groove": "radius of the inner groove over D",
    "outer_groove": "radius of the outer groove over D",
}
"""Names of joints' fields that do not say it themselves, with the paper's symbols."""


def parameters(runs: Runs) -> Iterator[Part]:
    """Every input of each case, its laws, the motion, the robot."""

    def symbols(name: str) -> Html:
        """C_r as a symbol with an index, units with exponents."""
        shown = markup("{}", name)
        for symbol in ("C_r", "C_a", "R_i", "L_i", "R_j", "L_j", "c_e"):
            shown = shown.replace(symbol, markup("<i>{}</i><sub>{}</sub>", *symbol.split("_")))
        for unit, power in (("m^1.5", "1.5"), ("s^2", "2")):
            shown = shown.replace(unit, markup("{}<sup>{}</sup>", unit[0], power))
        return shown

    yield runs.by_case(
        lambda case: {symbols(name): cell for name, cell in _parameters(case.result).items()},
        head="parameter",
        left=1 + len(runs.cases),
    )
    yield from _laws(runs)
    for text, of, result in _by_text(runs, "motion"):
        if text == "null":
            continue
        motion = Motion.from_description(json.loads(text))
        rows = np.column_stack(motion.waypoints).tolist()[:500]
        robot = analysis.inputs(result)["mechanism"]  # its own laws may be such as nobody imports
        joints = parse(robot["urdf_text"], Path(robot["urdf"]), robot["allow_unphysical"]).joints
        units = {name: "m" if joint.slides else "rad" for name, joint in joints.items()}
        names = [f"{name} [{units.get(name, 'rad or m')}]" for name in motion.joints]
        table = Table.of([(head, "") for head in ("time [s]", *names)], rows)
        yield Fold(f"Waypoints{of}", [Grid.of_table(table, 0)])
    for text, of, _ in _by_text(runs, "mechanism", "urdf_text"):
        if source := json.loads(text):
            yield Fold(f"Robot (URDF){of}", [markup("<pre>{}</pre>", source)])


def _laws(runs: Runs) -> Iterator[Part]:
    """The text of users' own laws, which is shown, and never run: each once, and where it is."""
    users: dict[tuple[str, str], dict[str, None]] = {}
    for case in runs.cases:
        for joint, fields in analysis.clearance_inputs(case.result).items():
            for law in fields.values():
                if isinstance(law, dict) and law.get("source"):
                    user = joint if case.alone else f"{case.label}, {joint}"
                    users.setdefault((str(law["function"]), str(law["source"])), {})[user] = None
    for (name, text), where in users.items():
        yield Fold(f"Law {name} ({'; '.join(where)})", [markup("<pre>{}</pre>", text)])


def _by_text(runs: Runs, *keys: str) -> list[tuple[str, str, Result]]:
    """An input by its different texts (JSON): " of" the cases that have it, and one of them."""
    groups: dict[str, list[Case]] = {}
    for case in runs.cases:
        value: Any = analysis.inputs(case.result)
        for key in keys:
            value = value.get(key)
        groups.setdefault(json.dumps(value, sort_keys=True), []).append(case)
    of = " of {}" if len(groups) > 1 else ""
    return [
        (text, of.format(", ".join(case.label for case in cases)), cases[0].result)
        for text, cases in groups.items()
    ]


def _parameters(result: Result) -> dict[str, Cell]:
    inputs = analysis.inputs(result)
    robot = inputs["mechanism"]
    loops = (robot.get("loops") or {}).items()
    cells: dict[str, Cell] = {
        "robot (URDF)": robot.get("urdf"),
        "tool (frame)": robot.get("tool"),
        "gravity, world axes [m/s^2]": _plain(robot.get("gravity", ())),
        "base": "free: nothing holds it" if robot.get("base") == FREE else None,
        "links with an impossible inertia": _plain(robot.get("allow_unphysical") or ()) or None,
        "held joints": _plain(robot.get("fix") or ()) or None,
        "closed loops": "; ".join(
            f"{name}: {loop.get('bearing_link')} - {loop.get('journal_link')}"
            for name, loop in loops
        )
        or None,
    }
    gears = {
        name: "; ".join(filter(None, (_plain(gear), Gearing.from_description(gear).notes)))
        for name, gear in robot.get("gears", {}).items()
    }
    cells |= {f"gear of {names}": gear for names, gear in _alike(gears).items()}
    motion, drives = inputs["motion"], inputs["drive"]
    cells["motion"] = "none" if motion is None else Motion.from_description(motion).summary
    drives = {"all joints": drives} if isinstance(drives.get("kind"), str) else drives
    plain = {name: _plain(drive) for name, drive in drives.items()}
    cells |= {f"drive of {names}": drive for names, drive in _alike(plain).items()}
    cells["time step"] = readable(float(inputs["step"]), "s")
    cells["integrator"] = inputs["integrator"]
    cells["simulated [s]"] = float(result.time[-1])
    cells["steps between records"] = int(inputs["record_every"])
    shown = {"mechanism", "motion", "drive", "duration", "step", "integrator", "record_every"}
    for name, value in inputs.items():
        if name not in shown and value not in (None, [], {}):
            cells[name.replace("_", " ")] = _plain(value)
    cells |= _clearances(result)
    versions = json.loads(result.dataset.attrs.get("versions", "{}"))
    cells["made with"] = ", ".join(f"{name} {value}" for name, value in versions.items())
    return cells


def _clearances(result: Result) -> dict[str, Cell]:
    """Fields of the joints with clearance; of joints that have the same ones, once."""
    joints, reason = {}, ""
    try:
        joints = result.simulation.mechanism.clearance
    except JointplayError as error:
        reason = f", not computed: {error}"
    described = {
        joint: _fields(fields, joints.get(joint), reason)
        for joint, fields in analysis.clearance_inputs(result).items()
    }
    return {
        f"{names}: {label}": cell
        for names, cells in _alike(described).items()
        for label, cell in cells.items()
    }


def _alike(described: dict[str, Any]) -> dict[str, Any]:
    """What is the same of several joints, once, by their names."""
    names: dict[str, list[str]] = {}
    for name, description in described.items():
        names.setdefault(str(description), []).append(name)
    return {", ".join(joints): described[joints[0]] for joints in names.values()}


def _fields(fields: dict[str, Any], bearing: Clearance | None, reason: str) -> dict[str, Cell]:
    family = family_of(Clearance)
    assert family is not None
    stiffness: Cell = f"from eq. 11{reason}"
    if bearing is not None:
        stiffness = markup("{} (eq. 11)", bearing.contact_properties(0).stiffness)
    derived = {"stiffness": stiffness, "axial_stiffness": "as radial"}
    kind = fields["kind"]
    units = fields_of(family.member(kind).kind) if kind in family.members else {}
    cells: dict[str, Cell] = {}
    for name, value in fields.items():
        unit = units[name].units[0] if name in units and not isinstance(value, list) else ""
        factor, shown = displayed(unit, name.endswith("interference"))
        label = f"{_label(name)}{f' [{shown}]' if unit else ''}"
        if value is None:
            cells[label] = derived.get(name)
        elif isinstance(value, bool):
            cells[label] = "yes" if value else None
        elif isinstance(value, (int, float)):
            cells[label] = float(value) * factor
        else:
            cells[label] = _law(value) if isinstance(value, dict) else value
    if isinstance(bearing, RollingBearing):
        estimates = bearing.estimates.items()
        cells |= {f"{_label(name)} (estimated)": text for name, text in estimates}
    return cells


def _label(field: str) -> str:
    return _SYMBOLS.get(field, field.replace("_", " "))


_MOST_VALUES = 20  # of a list that is shown (judged)


def _plain(value: Any) -> str:
    """A value in a line; of fields those that have one."""
    if isinstance(value, dict):
        fields = {name: _plain(v) for name, v in value.items() if v is not None}
        units = {"bandwidth": " [rad/s]"}
        return ", ".join(
            f"{name.replace('_', ' ')}{units.get(name, '')} {v}" for name, v in fields.items()
        )
    if isinstance(value, (list, tuple)):
        if len(value) > _MOST_VALUES:
            return f"{len(value)} values"
        return ", ".join(_plain(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _law(fields: dict[str, Any]) -> str:
    """A law or a material in one line: its name first, numbers in the units of its fields."""
    known = {key: value for key, value in fields.items() if value is not None and key != "source"}
    kind: type | None = Material if "young" in known else None
    for family in filter(None, map(family_of, (NormalForceLaw, FrictionLaw, FilmLaw))):
        if kind is None and str(known.get("law")) in family.members:
            kind = family.member(str(known["law"])).kind
    units = {} if kind is None else fields_of(kind)
    name = next((str(known.pop(key)) for key in ("law", "name") if key in known), "")
    shown = []
    for key, value in known.items():
        unit = units[key].units[0] if key in units else ""
        text = readable(value, unit) if unit and isinstance(value, float) else _plain(value)
        shown.append(f"{key.replace('_', ' ')} {text}")
    return " ".join(part for part in (name, shown and f"({', '.join(shown)})") if part)
