"""Survey of a robot: its joints and frames, and what stands in the way of a simulation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.files import is_file
from jointplay.base.tables import aligned, few, wrapped
from jointplay.model.formats import urdf_text
from jointplay.model.inertias import ALL, impossible_inertias
from jointplay.model.massless import massless_links, massless_motions
from jointplay.model.mechanism import Mechanism
from jointplay.model.robots import PREFIX, SUFFIXES, source_of
from jointplay.model.tool import choose_tool
from jointplay.model.urdf import Description, doubts, elements, mimics, parse
from jointplay.model.vocabulary import as_option
from jointplay.model.xacro import Value


@dataclass(frozen=True)
class Survey:
    """A robot's joints and frames, and how far it can be simulated; found by loading it."""

    name: str
    path: Path
    moving: dict[str, str]
    """URDF type of each joint that is not fixed, by name, from the base outwards."""
    serial: bool = False
    """Whether the revolute joints lie on one path from the base: an arm."""
    unphysical: tuple[str, ...] = ()
    """Links whose inertia no rigid body has; to be allowed by name."""
    mimics: tuple[str, ...] = ()
    """Joints that follow others, unless a motion or drive says otherwise."""
    massless: tuple[str, ...] = ()
    """Joints that move no mass: nothing can be simulated unless they are fixed."""
    problem: str = ""
    """Why the robot cannot be loaded, or simulated, at all; empty if it can."""
    doubts: tuple[str, ...] = ()
    """Lines on what in its file is not whole or not read (`urdf.doubts`)."""
    mechanism: Mechanism | None = None
    """The ideal robot, if it can be loaded."""

    @property
    def bare(self) -> tuple[str, ...]:
        """Links that joints move and that have no mass of their own."""
        if self.mechanism is None:
            return ()
        model, entries = self.mechanism.model, self.mechanism.description.joints
        moved = {name: int(model.getJointId(name)) for name in self.moving}
        return tuple(
            entries[name].child for name, at in moved.items() if not model.inertias[at].mass > 0.0
        )

    @property
    def remarks(self) -> tuple[str, ...]:
        """Lines on what is not as it should be."""
        remarks = (
            (self.massless, "cannot be simulated unless held: {} move links without mass"),
            (self.unphysical, "physically impossible inertia, must be allowed: {}"),
            (self.mimics, "joints that follow others: {}"),
        )
        lines = tuple(text.format(few(list(names), 4)) for names, text in remarks if names)
        lines += self.doubts
        if not self.moving:
            lines = ("has no joint that moves: nothing can be simulated", *lines)
        return (self.problem, *lines) if self.problem else lines

    @property
    def brief(self) -> str:
        """A short text: the robot's name, its joints by kind, and the remarks."""
        lines = [self.name]
        for kind in dict.fromkeys(self.moving.values()):
            joints = [joint for joint, joint_kind in self.moving.items() if joint_kind == kind]
            lines.append(wrapped(f"{len(joints)} {kind}: {', '.join(joints)}"))
        return "\n".join([*lines, *(wrapped(f"! {remark}") for remark in self.remarks)])

    def __str__(self) -> str:
        """The full text: joints with their limits, frames, tool, remarks, and options that help."""
        lines = [f"{self.name}: {self.path}"]
        if self.mechanism is None:
            lines += [f"    {joint}  {kind}" for joint, kind in self.moving.items()]
        else:
            description = self.mechanism.description
            tool, reason = choose_tool(description)
            lines += [f"    {line}" for line in aligned(_joints(description, self.moving))]
            lines.append(wrapped(f"frames: {', '.join(description.links)}"))
            lines.append(wrapped(f"tool, if none is named: {tool} ({reason})"))
            if description.held:
                lines.append(wrapped(f"! {description.held}; --base free lets go of it"))
        lines += [wrapped(f"! {remark}") for remark in self.remarks]
        if self.bare:
            lines.append(wrapped(
                f"! links without mass: {', '.join(self.bare)}; their joints cannot have clearance "
                "until the URDF gives the links an <inertial>; budgets need none"
            ))  # fmt: skip
        lines += ["    option: --allow-unphysical all"] * bool(self.unphysical)
        if self.massless and len(self.massless) < len(self.moving):
            lines.append(f"    option: --fix {as_option(self.massless)}")
        return "\n".join(lines)


def survey(place: str | Path, xacro: Mapping[str, Value] | None = None) -> Survey:
    """Load a robot, with arguments if it is a xacro, and survey it.

    Raises:
        JointplayError, MissingName: no such robot, or no well-formed URDF.
    """
    source = source_of(place)
    path = source.path
    is_path = is_file(Path(place)) or str(place).endswith(SUFFIXES)
    name = path.stem if is_path else str(place).removeprefix(PREFIX)
    text = urdf_text(source, xacro or {})
    root = elements(text, path)
    joints = {joint.get("name", ""): joint for joint in root.findall("joint")}
    moving = {n: joint.get("type", "") for n, joint in joints.items()}
    moving = {n: kind for n, kind in moving.items() if kind != "fixed"}
    following, _ = mimics(root)
    followers = tuple(n for n in moving if n in following)
    doubtful = tuple(doubts(root))
    unphysical = tuple(impossible_inertias(root))
    mechanism, serial, problem = None, False, ""
    massless: tuple[str, ...] = ()
    try:
        mechanism = Mechanism(parse(text, path, [ALL]), allow_unphysical=[ALL])
        serial = mechanism.description.serial
        moving = {n: moving[n] for n in mechanism.coordinates}
        still = pin.neutral(mechanism.model)
        free = massless_motions(mechanism, still) if moving else np.zeros((0, 0))
        massless = tuple(massless_links(mechanism, still, free).values())
    except JointplayError as error:
        problem = str(error)
    return Survey(
        *(name, path, moving, serial, unphysical, followers, massless, problem, doubtful), mechanism
    )


def described(description: Description) -> dict[str, Any]:
    """Joints and links as data: limits in rad or m, speeds and efforts in SI."""
    keys = ("name", "kind", "parent", "child", "lower", "upper", "speed", "effort")
    joints = [description.joints[name] for name in description.moving]
    return {
        "joints": [{key: getattr(e, key) for key in keys} | {"unit": e.unit} for e in joints],
        "frames": list(description.links),
    }


def _joints(description: Description, names: Iterable[str]) -> list[tuple[str, ...]]:
    """Table of joints with a row of headings."""
    rows: list[tuple[str, ...]] = [
        ("joint", "kind", "parent", "child", "position", "speed", "effort", "")
    ]
    for name in names:
        entry = description.joints[name]
        unit, force = ("m", "N") if entry.slides else ("rad", "N m")
        position = "" if entry.lower is None else f"{entry.lower:.4g} to {entry.upper:.4g} {unit}"
        speed = "" if entry.speed is None else f"{entry.speed:.4g} {unit}/s"
        effort = "" if entry.effort is None else f"{entry.effort:.4g} {force}"
        more = [] if entry.mimic is None else [f"follows {entry.mimic.formula()}"]
        if name in description.reductions:
            more.append(f"geared {description.reductions[name]:g} : 1")
        ends = (entry.kind, entry.parent, entry.child)
        rows.append((name, *ends, position, speed, effort, "; ".join(more)))
    return rows
