"""What a robot's description is made of, and what is not as it should be."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.base.files import is_file
from jointplay.model.formats import urdf_text
from jointplay.model.inertias import ALL, impossible_inertias
from jointplay.model.massless import massless_links, massless_motions
from jointplay.model.mechanism import Mechanism
from jointplay.model.robots import PREFIX, SUFFIXES, source_of
from jointplay.model.urdf import doubts, elements, mimics, parse
from jointplay.model.xacro import Value


@dataclass(frozen=True)
class Survey:
    """What a robot is made of, and how far it can be simulated; found by loading it."""

    name: str
    path: Path
    moving: dict[str, str]
    """URDF type of each joint that is not fixed, by name, from the base outwards."""
    serial: bool = False
    """Its revolute joints lie on one path from the base: an arm."""
    unphysical: tuple[str, ...] = ()
    """Links whose inertia no rigid body has; to be allowed by name."""
    mimics: tuple[str, ...] = ()
    """Joints that follow others, unless a motion or drive says otherwise."""
    massless: tuple[str, ...] = ()
    """Joints that move no mass: nothing can be simulated unless they are fixed."""
    problem: str = ""
    """Why it cannot be loaded, or simulated, at all; empty if it can."""
    doubts: tuple[str, ...] = ()
    """What its file says that is not whole or not read, in words."""
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
        """What is not as it should be, in words."""
        remarks = (
            (self.massless, "cannot be simulated unless held: {} move links without mass"),
            (self.unphysical, "physically impossible inertia, must be allowed: {}"),
            (self.mimics, "joints that follow others: {}"),
        )
        lines = tuple(text.format(_list(names)) for names, text in remarks if names)
        lines += self.doubts
        if not self.moving:
            lines = ("has no joint that moves: nothing can be simulated", *lines)
        return (self.problem, *lines) if self.problem else lines


def survey(place: str | Path, xacro: Mapping[str, Value] | None = None) -> Survey:
    """Load a robot, with these arguments if it is a xacro, and look at what it is made of.

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
    try:
        mechanism = Mechanism(parse(text, path, [ALL]), allow_unphysical=[ALL])
    except JointplayError as error:
        why = str(error)
        return Survey(name, path, moving, False, unphysical, followers, (), why, doubtful)
    moving = {n: moving[n] for n in mechanism.coordinates}
    still = pin.neutral(mechanism.model)
    massless: tuple[str, ...] = ()
    problem = ""
    try:
        free = massless_motions(mechanism, still) if moving else np.zeros((0, 0))
        massless = tuple(massless_links(mechanism, still, free).values())
    except JointplayError as error:
        problem = str(error)
    serial = mechanism.description.serial
    return Survey(
        *(name, path, moving, serial, unphysical, followers, massless, problem, doubtful),
        mechanism,
    )


def _list(names: tuple[str, ...], most: int = 4) -> str:
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more
