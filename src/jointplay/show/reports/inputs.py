"""Every input of the runs, motions and robots in full."""

from __future__ import annotations

import json
from collections.abc import Sequence
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
from jointplay.show.reports import html
from jointplay.show.reports.cases import Case, dark
from jointplay.simulation import analysis
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result

# The text of users' own laws, as results bring it: it is shown, and never run.


def own_laws(cases: Sequence[Case]) -> html.Html:
    """Each law once, and where it is used."""
    users: dict[tuple[str, str], list[str]] = {}
    for case in cases:
        for joint, fields in analysis.clearance_inputs(case.result).items():
            for law in fields.values():
                if isinstance(law, dict) and law.get("source"):
                    user = f"{case.label}, {joint}" if len(cases) > 1 else joint
                    known = users.setdefault((str(law["function"]), str(law["source"])), [])
                    known += [] if user in known else [user]
    return html.joined(
        html.details(f"Law {name} ({'; '.join(where)})", html.markup("<pre>{}</pre>", text))
        for (name, text), where in users.items()
    )


_WORDS = {
    "clearance": "clearance across x, each side",
    "clearance_y": "clearance across y, each side",
    "length": "length of the slider",
    "height": "height of the slider, along y",
    "radial_clearance": "radial clearance C_r",
    "axial_clearance": "axial clearance C_a, each side",
    "bearing_radius": "bearing radius R_i",
    "bearing_length": "bearing length L_i",
    "journal_radius": "journal radius R_j",
    "journal_length": "journal length L_j",
    "restitution": "restitution c_e",
    "stiffness": "stiffness k",
    "axial_stiffness": "stiffness k, axial",
    "spacing": "distance of the rows",
    "temperature_difference": "inner ring warmer by",
    "damping_time": "damping over stiffness",
    "cage_angle": "azimuth of the first element",
    "dynamic_rating": "basic dynamic load rating C",
    "static_rating": "basic static load rating C0",
    "drag_torque": "friction torque without load",
    "rolling_friction": "friction over load and half the bore",
    "inner_groove": "radius of the inner groove over D",
    "outer_groove": "radius of the outer groove over D",
}
"""What fields of joints are called that do not say it themselves."""


def _word(field: str) -> str:
    return _WORDS.get(field, field.replace("_", " "))


def parameters(cases: Sequence[Case]) -> html.Html:
    """Every input, a column for each case, then laws, motions and robots in full."""

    def symbols(name: str) -> html.Html:
        """C_r as a symbol with an index, units with exponents."""
        shown = html.markup("{}", name)
        for symbol in ("C_r", "C_a", "R_i", "L_i", "R_j", "L_j", "c_e"):
            shown = shown.replace(symbol, html.markup("<i>{}</i><sub>{}</sub>", *symbol.split("_")))
        for unit, power in (("m^1.5", "1.5"), ("s^2", "2")):
            shown = shown.replace(unit, html.markup("{}<sup>{}</sup>", unit[0], power))
        return shown

    figures: list[html.Row] = [
        {symbols(name): cell for name, cell in _parameters(case.result).items()} for case in cases
    ]
    parts = [html.by_case("parameter", [*map(dark, cases)], figures, left=1 + len(cases))]
    parts.append(own_laws(cases))
    for text, of, result in _grouped(cases, "motion"):
        if text == "null":
            continue
        motion = Motion.from_description(json.loads(text))
        rows = np.column_stack(motion.waypoints).tolist()[:500]
        robot = analysis.inputs(result)["mechanism"]  # its own laws may be such as nobody imports
        joints = parse(robot["urdf_text"], Path(robot["urdf"]), robot["allow_unphysical"]).joints
        units = {name: "m" if joint.slides else "rad" for name, joint in joints.items()}
        names = [f"{name} [{units.get(name, 'rad or m')}]" for name in motion.joints]
        made = Table.of([(head, "") for head in ("time [s]", *names)], rows)
        parts.append(html.details(f"Waypoints{of}", html.table(made, left=0)))
    for text, of, _ in _grouped(cases, "mechanism", "urdf_text"):
        source = json.loads(text)
        if source:
            parts.append(html.details(f"Robot (URDF){of}", html.markup("<pre>{}</pre>", source)))
    return html.joined(parts)


def _grouped(cases: Sequence[Case], *keys: str) -> list[tuple[str, str, Result]]:
    """An input by its different texts (JSON): " of" the cases that have it, and one of them."""
    groups: dict[str, list[Case]] = {}
    for case in cases:
        value: Any = analysis.inputs(case.result)
        for key in keys:
            value = value.get(key)
        groups.setdefault(json.dumps(value, sort_keys=True), []).append(case)
    several = len(groups) > 1
    return [
        (text, f" of {', '.join(one.label for one in those)}" if several else "", those[0].result)
        for text, those in groups.items()
    ]


def _parameters(result: Result) -> dict[str, html.Cell]:
    inputs = analysis.inputs(result)
    robot = inputs["mechanism"]
    known = {"mechanism", "motion", "drive", "duration", "step", "integrator", "record_every"}
    cells: dict[str, html.Cell] = {
        "robot (URDF)": robot.get("urdf"),
        "tool (frame)": robot.get("tool"),
        "gravity, world axes [m/s^2]": ", ".join(f"{g:g}" for g in robot.get("gravity", ())),
    }
    loops = (robot.get("loops") or {}).items()
    said = {
        "base": "free: nothing holds it" if robot.get("base") == FREE else "",
        "links with an impossible inertia": ", ".join(robot.get("allow_unphysical") or ()),
        "held joints": ", ".join(robot.get("fix") or ()),
        "closed loops": "; ".join(
            f"{name}: {loop.get('bearing_link')} - {loop.get('journal_link')}"
            for name, loop in loops
        ),
    }
    cells |= {name: text for name, text in said.items() if text}
    for name, gear in robot.get("gears", {}).items():
        notes = Gearing.from_description(gear).notes
        given = {key: value for key, value in gear.items() if value is not None}
        cells[f"gear of {name}"] = "; ".join(filter(None, (_plain(given), notes)))
    motion, drives = inputs["motion"], inputs["drive"]
    cells["motion"] = "none" if motion is None else Motion.from_description(motion).summary
    shared = isinstance(drives.get("kind"), str)
    for name, drive in ({"all joints": drives} if shared else drives).items():
        fields = []
        for key, value in drive.items():
            many = isinstance(value, list) and len(value) > 6
            unit = " [rad/s]" if key == "bandwidth" else ""
            text = f"{len(value)} values" if many else _plain(value)
            fields += [f"{key}{unit} {text}"] if value is not None else []
        cells[f"drive of {name}"] = ", ".join(fields)
    if inputs.get("joint_friction") is not None:
        cells["joint friction"] = _plain(inputs["joint_friction"])
    cells["time step"] = readable(float(inputs["step"]), "s")
    cells["integrator"] = inputs["integrator"]
    cells["simulated [s]"] = float(result.time[-1])
    cells["steps between records"] = int(inputs["record_every"])
    for name, value in inputs.items():
        if name not in known | {"joint_friction"} and value not in (None, [], {}):
            cells[name.replace("_", " ")] = _plain(value)
    joints, not_built = {}, ""
    try:
        joints = result.simulation.mechanism.clearance
    except JointplayError as error:
        not_built = f", not computed: {error}"
    family = family_of(Clearance)
    assert family is not None
    for joint, fields_given in analysis.clearance_inputs(result).items():
        stiffness: html.Cell = f"from eq. 11{not_built}"
        if joint in joints:
            derived = joints[joint].contact_properties(0).stiffness
            stiffness = html.markup("{} (eq. 11)", derived)
        not_given = {"stiffness": stiffness, "axial_stiffness": "as radial"}
        kind = fields_given["kind"]
        units = fields_of(family.member(kind).kind) if kind in family.members else {}
        for name, value in fields_given.items():
            has_unit = name in units and not isinstance(value, list)
            unit = units[name].units[0] if has_unit else ""
            scale, shown = displayed(unit, name.endswith("interference"))
            label = f"{joint}: {_word(name)}{f' [{shown}]' if unit else ''}"
            if value is None:
                cells[label] = not_given.get(name)
            elif isinstance(value, bool):
                cells[label] = "yes" if value else None
            elif isinstance(value, (int, float)):
                cells[label] = float(value) * scale
            else:
                cells[label] = _law(value) if isinstance(value, dict) else value
        bearing = joints.get(joint)
        for name, text in bearing.estimates.items() if isinstance(bearing, RollingBearing) else ():
            cells[f"{joint}: {_word(name)} (estimated)"] = text
    versions = json.loads(result.dataset.attrs.get("versions", "{}"))
    cells["made with"] = ", ".join(f"{name} {value}" for name, value in versions.items())
    return cells


def _plain(value: Any) -> str:
    if isinstance(value, dict):
        return ", ".join(f"{name.replace('_', ' ')} {_plain(v)}" for name, v in value.items())
    if isinstance(value, (list, tuple)):
        return ", ".join(_plain(v) for v in value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def _law(fields: dict[str, Any]) -> str:
    """A law or a material in one line: its name first, numbers in the units of its fields."""
    rest = {key: value for key, value in fields.items() if value is not None and key != "source"}
    kind: type | None = Material if "young" in rest else None
    for family in filter(None, map(family_of, (NormalForceLaw, FrictionLaw, FilmLaw))):
        if kind is None and str(rest.get("law")) in family.members:
            kind = family.member(str(rest["law"])).kind
    known = {} if kind is None else fields_of(kind)
    name = next((str(rest.pop(key)) for key in ("law", "name") if key in rest), "")
    parts = []
    for key, value in rest.items():
        unit = known[key].units[0] if key in known else ""
        shown = readable(value, unit) if unit and isinstance(value, float) else _plain(value)
        parts.append(f"{key.replace('_', ' ')} {shown}")
    return " ".join(part for part in (name, parts and f"({', '.join(parts)})") if part)
