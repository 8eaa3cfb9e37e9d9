"""The values on which a run's figures depend, each with its origin: the user, a file or a rule.

A value that nobody gave is assumed: by a rule, or as the default of its field. Who reads the list
sees what was taken for granted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

from jointplay.base.origins import (
    ASSUMED,
    FILE,
    GIVEN,
    GUESSED,
    SEEN,
    Key,
    Origins,
    Value,
    value_table,
)
from jointplay.base.schema import fields_of
from jointplay.base.tables import Table, few
from jointplay.base.units import readable
from jointplay.model.linkage import DRAWN
from jointplay.physics.contact import LankaraniNikravesh
from jointplay.physics.joints import Clearance, SlidingClearance
from jointplay.simulation.initial import settled_drives
from jointplay.simulation.loads.drive import BANDWIDTH, ComputedTorque, assign

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation


def values(
    simulation: Simulation, origins: Origins | None = None, merged: bool = True
) -> list[Value]:
    """The values of a run with their origins.

    Args:
        simulation: the run's inputs.
        origins: origins that are known; other values count as given if they differ from the default
            of their field, else as assumed.
        merged: whether values that are alike in several joints stand in one row.
    """
    alike: dict[tuple[str, ...], list[str]] = {}
    origins = origins or {}
    for key, text, default in _list(simulation, origins):
        origin, source = _origin(key, origins, default)
        table, name, field = (key[0], "", key[1]) if len(key) == 2 else (*key, "", "")[:3]
        separate = () if merged else (name,)
        alike.setdefault((table, field, text, origin, source, *separate), []).append(name)
    listed = []
    for (table, field, text, origin, source, *_), names in alike.items():
        key_text = ".".join(filter(None, [table, few(names, 2) if any(names) else "", field]))
        listed.append(Value(key_text, text, origin, source))
    return listed


def assumed_table(simulation: Simulation, origins: Origins) -> Table:
    """Table of the assumed `values`, for readers."""
    return value_table([value for value in values(simulation, origins) if value.assumed])


def _origin(key: Key, origins: Origins, default: tuple[str, str]) -> tuple[str, str]:
    """Origin of the value at a key: its own, or of the narrowest table that it is in, or of the
    first entry below it. The drive of a joint has that of the drive for all if none of its own.
    """
    if key[0] == "drives" and key[:2] not in {at[:2] for at in origins}:
        key = ("drive", *key[2:])
    for size in range(len(key), 0, -1):
        if key[:size] in origins:
            return origins[key[:size]]
    within = (origin for at, origin in origins.items() if at[: len(key)] == key)
    return next(within, default)


def of_joint(joint: Clearance, known_fields: Collection[str]) -> Iterator[tuple[str, str, bool]]:
    """Values that decide a joint's contacts: field, text, and whether it is in `known_fields`.

    For joints whose surfaces do not slide, their summary stands for all.
    """
    if not isinstance(joint, SlidingClearance):
        yield "kind", joint.summary, True
        return
    known = {*known_fields}
    if joint.fitted is not None:
        yield "fit", f"{joint.fitted}: {joint.fitted.range} radially", True
        if joint.fit_size is not None:
            known |= {joint.fit_size[0], next(iter(joint.clearance_fields))}
    for name, field in fields_of(joint.__class__).items():
        value = getattr(joint, name)
        derived = name.startswith("journal_") and name not in known
        if field.units[0] == "m" and isinstance(value, float) and value != 0.0 and not derived:
            yield name, readable(value, "m"), bool({name, joint.clearance_fields.get(name)} & known)
    if joint.normal != LankaraniNikravesh():
        yield "normal", joint.normal.name, True
    contact = joint.contact_properties(0)
    softer = contact._replace(restitution=0.5 * contact.restitution)  # does the law look at it?
    if joint.normal.parameters(contact) != joint.normal.parameters(softer):
        yield "restitution", f"{joint.restitution:g}", "restitution" in known
    # A friction law with its first parameter, the coefficient.
    text, name = joint.friction.name, next(iter(fields_of(joint.friction.__class__)), "")
    if isinstance(coefficient := getattr(joint.friction, name, None), float):
        text += f" {name} {coefficient:g}"
    yield "friction", text, "friction" in known


def _list(simulation: Simulation, origins: Origins) -> Iterator[tuple[Key, str, tuple[str, str]]]:
    """Key and text of each value, and its origin unless another is known."""
    mechanism = simulation.mechanism
    usual, given = (ASSUMED, "nobody said otherwise"), (GIVEN, "in Python")
    units = {name: entry.unit for name, entry in mechanism.description.joints.items()}
    # The robot.
    chosen = mechanism.tool_reason
    named = origins.get(("linkage", "output"), given)
    yield ("robot", "tool"), mechanism.tool, (ASSUMED, chosen) if chosen else named
    weight = "none"
    if any(mechanism.gravity):
        weight = " ".join(f"{g:g}" for g in mechanism.gravity) + " m/s²"
    yield ("robot", "gravity"), weight, usual
    # Joints with clearance, and gears.
    hinges = {name for its in mechanism.hinges.values() for name in its}
    for name, joint in mechanism.clearance.items():
        if name not in hinges:
            known = [at[2] for at in origins if at[:2] == ("joints", name) and len(at) > 2]
            changed = [f.name for f in fields(joint) if getattr(joint, f.name) != f.default]
            for field, text, is_given in of_joint(joint, known or changed):
                yield ("joints", name, field), text, given if is_given else usual
    for name, gear in mechanism.gears.items():
        for field, text, is_default in _fields_of(gear, units.get(name, "rad")):
            rule = mechanism.rules.get((name, field))
            by_rule = None
            if rule is not None:
                origin = GUESSED if rule.guess else ASSUMED
                by_rule = (origin, f"rule {rule.name}: {rule.reason}")
            sources = gear.origins()
            of_catalogue = (SEEN, sources[field]) if field in sources else given
            yield ("gears", name, field), text, by_rule or (usual if is_default else of_catalogue)
    # Motion and drives.
    motion = simulation.motion
    if motion is not None:
        yield ("motion",), f"{few(list(motion.joints), 2)}: {motion.summary}", given
    if motion is None and isinstance(simulation.drive, Mapping):  # it stands
        drives = settled = dict(simulation.drive)
    else:
        drives = assign(mechanism, motion, simulation.drive)
        settled = settled_drives(simulation)
    for name, drive in ((name, drives[name]) for name in mechanism.joints if name in drives):
        if drive.kind == "free":
            continue
        yield ("drives", name, "kind"), drive.kind, usual
        by = settled[name]
        if isinstance(by, ComputedTorque) and by.bandwidth is None:
            yield ("drives", name, "bandwidth"), readable(BANDWIDTH, "rad/s"), usual
        elif isinstance(by, ComputedTorque) and by != drive:
            why = "rule drive bandwidth: half of what is stable through its gear's teeth"
            bandwidth = readable(by.bandwidth or BANDWIDTH, "rad/s", 3)
            yield ("drives", name, "bandwidth"), bandwidth, (ASSUMED, why)
        for field, text, is_default in _fields_of(drive, units.get(name, "rad")):
            if field != "encoder" or name in mechanism.gears:
                sources = drive.origins()
                of_catalogue = (SEEN, sources[field]) if field in sources else given
                yield ("drives", name, field), text, usual if is_default else of_catalogue
    # Joint friction, payloads and the start.
    friction = simulation.joint_friction
    by_robot = usual if mechanism.description.path.name == DRAWN else (FILE, "the URDF")
    for name in mechanism.joints:
        entry = mechanism.description.joints.get(name)
        dry = entry.friction if friction is None and entry is not None else None
        dry = friction[name].coulomb if friction is not None and name in friction else dry
        if dry is not None:
            unit = "N" if units.get(name) == "m" else "N*m"
            yield ("joint_friction", name, "coulomb"), readable(dry, unit), by_robot
    for number, payload in enumerate(simulation.payloads, 1):
        yield ("payloads", str(number)), f"{readable(payload.mass, 'kg')} at {payload.frame}", given
    start = "at rest" if simulation.starts_at_rest else "centred"
    yield ("integration", "start"), start, usual


def _fields_of(described: Any, unit: str) -> Iterator[tuple[str, str, bool]]:
    """Numbers and words of an object: field, text, and whether it is the field's default.

    `unit` is that of the joint's position, which chooses between the two units of a field.
    """
    declared = fields_of(described.__class__)
    for field in fields(described):
        value, about = getattr(described, field.name), declared.get(field.name)
        if about is None or isinstance(value, bool):
            continue
        same = value == field.default
        if isinstance(value, str):
            yield field.name, value, same
        elif isinstance(value, float | int) and not (value == 0.0 and same):
            choice = about.units[-1 if unit == "m" and len(about.units) > 1 else 0]
            yield field.name, readable(float(value), choice), same
