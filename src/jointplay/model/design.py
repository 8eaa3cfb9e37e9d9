"""What a mechanism is made of: a robot's file and what is given besides, put together.

In this order: the robot is read and joints are held in it; what its file says beyond a URDF counts
where nothing else is given; flexible links are cut into pieces; the tool is chosen; joints in seats
get bushes; rules complete the gears. All that adds links does so in the URDF's text, so that the
`Description` stays the one account of the tree, of which `builder.build` makes Pinocchio's model.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pinocchio as pin

from jointplay.base.errors import (
    JointplayError,
    MissingName,
    require_known,
    require_names,
    require_table,
    require_vector,
    within,
)
from jointplay.model import formats, urdf
from jointplay.model.beams import FlexibleLink
from jointplay.model.builder import parse
from jointplay.model.fixing import with_fixed, without_floating_base
from jointplay.model.flexible import cut_links, end_of_tool
from jointplay.model.free_base import BASE, BASES, HELD
from jointplay.model.gear import GEARS, Gearing
from jointplay.model.gear_rules import Rule, completed, with_rotors
from jointplay.model.inertias import impossible_inertias, require_possible
from jointplay.model.loop import Loop, refuse_name
from jointplay.model.pinocchio_model import description_of_model
from jointplay.model.seats import SEAT, seat_of_joint, seat_of_loop
from jointplay.model.tool import choose_tool
from jointplay.model.urdf import GRAVITY, STANDARD_GRAVITY, Description
from jointplay.model.xacro import Value
from jointplay.physics.joints import (
    JOINT_WORDS,
    VIRTUAL_LINK,
    Clearance,
    Coordinate,
    parts_of_seat,
)


@dataclass(eq=False, repr=False)
class Design:
    """All that Pinocchio's model of a mechanism follows from."""

    description: Description
    """As given, with the bushes of seats, links ``JOINT_bush``, and the pieces of flexible links,
    ``LINK_2``, ...."""
    source: pin.Model
    """Pinocchio's reading of it, shared; fixed joints that have clearance float in it."""
    given_joints: dict[str, Any]
    """As given, ideal ones too, which say of what kind a loop's joint or a ball is. One with a seat
    stands here without it, and its mount ``JOINT_seat`` beside it; a flexible link as its hinges
    ``LINK_hinge_1``, ...."""
    loops: dict[str, Loop]
    gears: dict[str, Any]
    """As given, completed by rules."""
    rules: dict[tuple[str, str], Rule]
    """Numbers of gears that nobody gave, by joint and field, and by which rule."""
    flexible: dict[str, str]
    """What was made of each flexible link, in words; empty if the mechanism was built from another
    one, which has its pieces already."""
    gravity: tuple[float, float, float]
    """In world axes [m/s^2]."""
    base: str
    """``held`` or ``free``."""
    tool: str
    tool_reason: str
    """Why this tool, in words, if none was named; else empty."""
    allow_unphysical: tuple[str, ...]
    fix: Collection[str]

    def __post_init__(self) -> None:
        self.clearance = {name: one for name, one in self.given_joints.items() if not one.ideal}
        """Those of the given joints that have clearance."""

    @property
    def free_base(self) -> str | None:
        """Name of the free base's coordinates; None if the base is held."""
        return None if self.base == HELD else BASE

    @property
    def armature(self) -> dict[str, float]:
        """Inertia of rotors rigidly geared to joints, on their side, by joint [kg m^2 or kg]."""
        moving, armature = self.description.moving, self.description.beyond.armature
        return {name: armature[name] for name in armature if name in moving}

    def own_coordinate(self, joint: str) -> Coordinate:
        """The coordinate that `joint` has, or would have without clearance."""
        given = self.given_joints.get(joint)
        if given is not None and (joint in self.clearance or given.compound()):
            return Coordinate(joint, given.drive_coordinate or "")
        return Coordinate(joint)


def design(
    path: str | Path | Description | pin.Model,
    clearance: Mapping[str, Clearance] | None,
    *,
    loops: Mapping[str, Loop] | None,
    gears: Mapping[str, Gearing] | None,
    flexible: Mapping[str, FlexibleLink] | None,
    gravity: Sequence[float] | str | None,
    tool: str | None,
    allow_unphysical: Collection[str],
    fix: Collection[str],
    base: str | None,
    xacro: Mapping[str, Value] | None,
) -> Design:
    """Put a mechanism together; arguments and errors are those of `Mechanism`.

    A `Description` is one of a mechanism before: what its file says beyond a URDF is in what is
    given already.
    """
    allowed = require_names(
        "allow_unphysical", allow_unphysical, "names of links", ("allow_unphysical",)
    )
    fix = require_names("fix", fix, "names of joints", ("fix",))
    tables: Mapping[str, Mapping[str, Any]] = {}
    if not isinstance(path, Description):
        path = _read(path, allowed, xacro)
        tables = path.beyond.tables
    description = with_fixed(path, fix)

    robot = tables.get("robot", {})
    gravity = robot.get("gravity", STANDARD_GRAVITY) if gravity is None else gravity
    base = robot.get("base", HELD) if base is None else base
    given = require_table("clearance", clearance, "of joints by name", ("clearance",))
    description = without_floating_base(description, given)
    joints: dict[str, Clearance] = dict(_filed(description, tables.get("joints", {}), JOINT_WORDS))
    joints |= {str(name): joint for name, joint in given.items()}  # NumPy's print as np.str_(...)
    loops = require_table("loops", loops, "of loops by name", ("loops",))
    geared = dict(_filed(description, tables.get("gears", {}), GEARS))
    geared |= require_table("gears", gears, "of gears by joint", ("gears",))
    geared = with_rotors(geared, description.beyond.armature)
    description = urdf.with_geared(description, geared)
    flexible = require_table("flexible", flexible, "of flexible links by name", ("flexible",))
    _check_base(base, loops, description)
    if isinstance(gravity, str):
        require_known("gravity", gravity, GRAVITY, where=("gravity",))
        gravity = GRAVITY[gravity]
    gravity = require_vector("gravity", gravity, "m/s^2", ("gravity",))
    for name in loops:
        with within("loops", name):
            refuse_name(name, description.joints)

    cut = cut_links(description, loops, flexible)
    description, loops = cut.description, cut.loops
    for name, joint in joints.items():
        with within("clearance", name):
            _check_joint(name, joint, description, loops)
    for name, gear in geared.items():
        with within("gears", name):
            _check_gear(name, gear, description)

    reason = ""
    if tool is None:
        tool, reason = choose_tool(description, {*joints, *geared})
        tool = end_of_tool(tool, flexible)
    if not isinstance(tool, str):
        raise JointplayError(f"tool must be the name of a frame, got {tool!r}", ("tool",))

    description, loops, joints = _seated(description, loops, joints | cut.hinges)
    fixed = {name for name, one in description.joints.items() if one.kind == "fixed"}
    loose = sorted(name for name in fixed.intersection(joints) if not joints[name].ideal)
    faults = impossible_inertias(description.parsed, base != HELD, loose)
    require_possible(faults, allowed)
    source = parse(description, tuple(loose))
    geared, rules = completed(geared, description, source, tool)
    return Design(
        description, source, joints, loops, geared, rules, cut.words, gravity, base, tool, reason,
        tuple(allowed), fix,
    )  # fmt: skip


def _read(
    path: str | Path | pin.Model, allowed: Collection[str], xacro: Mapping[str, Value] | None
) -> Description:
    """The robot's file, or that of a Pinocchio model."""
    if isinstance(path, pin.Model):
        return description_of_model(path, tuple(allowed))
    if not isinstance(path, str | Path):
        raise JointplayError(
            f"a mechanism needs the path of a URDF, a robot's name or a pinocchio.Model, got "
            f"{path!r:.60}"
        )
    arguments = require_table("xacro", xacro, "of arguments by name", ("xacro",))
    return formats.read(path, allowed, arguments=arguments)


def _filed(
    description: Description, table: Mapping[str, Any], kinds: Mapping[str, Any]
) -> Iterator[tuple[str, Any]]:
    """Joints or gears that the robot's file has beyond a URDF, of joints that move."""
    for name, row in table.items():
        if name in description.moving:
            yield name, kinds[row["kind"]](**{key: row[key] for key in row if key != "kind"})


def _check_base(base: str, loops: Collection[str], description: Description) -> None:
    require_known("base", base, BASES, where=("base",))
    if base == HELD:
        return
    if loops:
        raise JointplayError(
            "a mechanism with loops cannot have a free base yet: the base must be held; loops: "
            f"{', '.join(loops)}",
            where=("base",),
        )
    if BASE in description.joints:
        raise JointplayError(
            f"the URDF has a joint called {BASE!r}, as the coordinates of a free base are; give it "
            "another name, or hold the base",
            where=("base",),
        )


def _check_joint(
    name: str, joint: Clearance, description: Description, loops: Collection[str]
) -> None:
    if not isinstance(joint, Clearance):
        raise JointplayError(
            f"joint {name!r} needs a joint with clearance, such as a RevoluteClearance, got "
            f"{joint!r}"
        )
    if name in loops:
        if joint.ideal and joint.slides():
            raise JointplayError(
                f"loop {name!r} cannot be closed by an ideal slider; cut the loop at another joint "
                "and leave the slider in the URDF"
            )
        return
    choices = [j.name for j in description.joints.values() if j.kind in joint.replaces]
    entry = description.joints.get(name)
    kinds = " or ".join(joint.replaces)
    if entry is None:
        raise MissingName("joint", name, [*choices, *loops], f" (the {kinds} joints)")
    if entry.kind not in joint.replaces:
        raise JointplayError(
            f"joint {name!r} is {entry.kind}, not {kinds}; {kinds} joints: "
            f"{', '.join(choices) or 'none'}"
        )


def _check_gear(name: str, gear: Gearing, description: Description) -> None:
    if not isinstance(gear, Gearing):
        raise JointplayError(f"joint {name!r} needs a Gear, got {gear!r}")
    entry = description.joints.get(name)
    entries = description.joints.values()
    if entry is None or not (entry.turns or entry.slides):
        able = [one.name for one in entries if one.turns or one.slides]
        raise MissingName("joint for a gear", name, able)
    if entry.slides and not gear.linear:
        able = [word for word, kind in GEARS.items() if kind.linear]
        raise JointplayError(
            f"joint {name!r} slides, and a {gear.kind} gear turns its joint; kinds of gear for "
            f"joints that slide: {', '.join(able)}",
            ("kind",),
        )


def _seated(
    description: Description, loops: Mapping[str, Loop], given: Mapping[str, Clearance]
) -> tuple[Description, dict[str, Loop], dict[str, Clearance]]:
    """Put a bush and its mount between the two links of each joint in a seat."""
    loops, joints = dict(loops), {}
    for name, joint in given.items():
        parts = parts_of_seat(joint)
        if parts is None:
            joints[name] = joint
            continue
        with within("clearance", name, "seat"):
            locked = [part for part in VIRTUAL_LINK if part not in joint.freedoms]
            if name in loops and locked:
                raise JointplayError(
                    f"loop {name!r} has a seat and locks {', '.join(locked)}: its bush gives way "
                    "in these directions, too; leave out the locks or the seat"
                )
            if name in loops:
                description, loops[name] = seat_of_loop(
                    description, name, loops[name], joint, parts
                )
            else:
                description = seat_of_joint(description, name, joint, parts)
        joints[name], joints[f"{name}{SEAT}"] = parts.joint, parts.mount
    return description, loops, joints
