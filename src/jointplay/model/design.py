"""From a robot's file, and what is given besides, to the Pinocchio model that is simulated.

`design` collects the parts of a mechanism, in this order: the robot is read and joints are held in
it; what its file says beyond a URDF counts where nothing else is given; flexible links are cut into
pieces; the tool is chosen; joints in seats get bushes; rules complete the gears. Every step that
adds links does so in the URDF's text, so that the `Description` stays the one account of the tree.

`build` then makes Pinocchio's model of it: it copies the model that Pinocchio reads from this URDF,
with a virtual link in place of each joint with clearance, and adds motors, a free base and locks.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
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
from jointplay.base.files import temporary
from jointplay.base.streams import caught_stderr
from jointplay.model import elements, formats, urdf
from jointplay.model.beams import FlexibleLink
from jointplay.model.fixing import with_fixed, without_floating_base
from jointplay.model.flexible import cut_links, end_of_tool
from jointplay.model.frames import Frames, motion_between, signs_between, single_axis
from jointplay.model.free_base import BASE, BASES, HELD
from jointplay.model.gear import GEARS, Gearing
from jointplay.model.gear_rules import Rule, completed, with_rotors
from jointplay.model.inertias import impossible_inertias, require_possible
from jointplay.model.linkage import Linkage
from jointplay.model.linkage_tree import tree_of
from jointplay.model.loop import Lock, Loop, refuse_name
from jointplay.model.pinocchio_model import description_of_model
from jointplay.model.tool import choose_tool
from jointplay.model.urdf import (
    GRAVITY,
    LIMITED,
    NO_AXIS,
    STANDARD_GRAVITY,
    Description,
    read_again,
)
from jointplay.model.vocabulary import WORDS, numbers
from jointplay.model.xacro import Value
from jointplay.physics.joints import (
    JOINT_WORDS,
    MOTOR,
    RELATIVE,
    VIRTUAL_LINK,
    Clearance,
    Coordinate,
    SeatParts,
    parts_of_seat,
    replacing,
)


@dataclass(eq=False, repr=False)
class Design:
    """The parts of a mechanism, from which its Pinocchio model follows (`build`)."""

    description: Description
    """The robot as given, with the bushes of seats, links ``JOINT_bush``, and the pieces of
    flexible links, ``LINK_2``, ...."""
    source: pin.Model
    """Pinocchio's own reading of `description`, shared; fixed joints with clearance float in it."""
    given_joints: dict[str, Any]
    """Joints as given, by name: those with clearance, and ideal ones, which give the kind of a
    loop's joint or of a ball. A joint in a seat is listed without the seat, and its mount as
    ``JOINT_seat``; a flexible link as its hinges ``LINK_hinge_1``, ...."""
    loops: dict[str, Loop]
    gears: dict[str, Any]
    """Gears by joint, as given, completed by rules."""
    rules: dict[tuple[str, str], Rule]
    """Numbers of gears that nobody gave, with the rule that gave them, by joint and field."""
    flexible: dict[str, str]
    """A line on each flexible link and its pieces; empty if the mechanism was built from another
    one, which has its pieces already."""
    gravity: tuple[float, float, float]
    """Acceleration of gravity in world axes [m/s^2]."""
    base: str
    """``held`` or ``free``."""
    tool: str
    tool_reason: str
    """Why this frame is the tool, if none was named; else empty."""
    allow_unphysical: tuple[str, ...]
    fix: Collection[str]

    def __post_init__(self) -> None:
        self.clearance = {n: joint for n, joint in self.given_joints.items() if not joint.ideal}
        """Given joints that have clearance."""

    @property
    def free_base(self) -> str | None:
        """Name of the joint that a free base's coordinates form; None if the base is held."""
        return None if self.base == HELD else BASE

    @property
    def armature(self) -> dict[str, float]:
        """Inertia of rotors rigidly geared to joints, at the joint's side [kg m^2 or kg]."""
        moving, armature = self.description.moving, self.description.beyond.armature
        return {name: armature[name] for name in armature if name in moving}

    def ideal_coordinate(self, joint: str) -> Coordinate:
        """The coordinate on which an ungeared drive of `joint` acts: that of the ideal joint."""
        stated = self.given_joints.get(joint)
        if stated is not None and (joint in self.clearance or stated.compound()):
            return Coordinate(joint, stated.drive_coordinate or "")
        return Coordinate(joint)


def design(
    path: str | Path | Description | Linkage | pin.Model,
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
    """Collect the parts of a mechanism; arguments and errors are those of `Mechanism`.

    A `Description` as `path` comes from another mechanism: what its file says beyond a URDF is
    already among the arguments.
    """
    allowed = require_names(
        "allow_unphysical", allow_unphysical, "names of links", ("allow_unphysical",)
    )
    fix = require_names("fix", fix, "names of joints", ("fix",))
    tables: Mapping[str, Mapping[str, Any]] = {}
    # The tree of links and joints.
    if isinstance(path, Linkage):
        play = require_table("clearance", clearance, "of joints by name", ("clearance",))
        linkage = path
        path, closing, balls = tree_of(linkage, play)
        loops = closing | require_table("loops", loops, "of loops by name", ("loops",))
        clearance = balls | play
        tool = linkage.tool if tool is None else tool
    if not isinstance(path, Description):
        path = _read(path, allowed, xacro)
        tables = path.beyond.tables
    description = with_fixed(path, fix)

    # What is given; where nothing is, what the file says beyond a URDF.
    robot = tables.get("robot", {})
    gravity = robot.get("gravity", STANDARD_GRAVITY) if gravity is None else gravity
    base = robot.get("base", HELD) if base is None else base
    stated = require_table("clearance", clearance, "of joints by name", ("clearance",))
    description = without_floating_base(description, stated)
    joints: dict[str, Clearance] = dict(_filed(description, tables.get("joints", {}), JOINT_WORDS))
    joints |= {str(name): joint for name, joint in stated.items()}  # NumPy's print as np.str_(...)
    loops = require_table("loops", loops, "of loops by name", ("loops",))
    geared = dict(_filed(description, tables.get("gears", {}), GEARS))
    geared |= require_table("gears", gears, "of gears by joint", ("gears",))
    armature = description.beyond.armature
    geared = with_rotors(geared, armature)
    direct = {name: armature[name] for name in armature if name not in geared}
    if direct != armature:  # the gears have the rotors of their joints
        description = urdf.with_armature(description, direct)
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
    # Fixed joints with clearance do not make one body of two links: each needs its own inertia.
    fixed = {name for name, entry in description.joints.items() if entry.kind == "fixed"}
    loose = sorted(name for name in fixed.intersection(joints) if not joints[name].ideal)
    faults = impossible_inertias(description.parsed, base != HELD, loose)
    require_possible(faults, allowed)
    source = parse(description, tuple(loose))
    geared, rules = completed(geared, description, source, tool)
    return Design(
        description, source, joints, loops, geared, rules, cut.summaries, gravity, base, tool,
        reason, tuple(allowed), fix,
    )  # fmt: skip


def _read(
    path: str | Path | pin.Model, allowed: Collection[str], xacro: Mapping[str, Value] | None
) -> Description:
    """Description of a robot from its file, or from a Pinocchio model."""
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
    """Joints or gears that the robot's file has beyond a URDF, by name, for joints that move."""
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
    if joint.ideal and not joint.runs_ideal:
        raise JointplayError(
            f"a {joint.kind} joint without clearance can only close a loop, and {name!r} is "
            "a joint of the tree: give it clearance, or make it a loop",
            where=("joints", name),
        )
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
        able = [joint.name for joint in entries if joint.turns or joint.slides]
        raise MissingName("joint for a gear", name, able)
    if entry.slides and not gear.linear:
        able = [word for word, kind in GEARS.items() if kind.linear]
        raise JointplayError(
            f"joint {name!r} slides, and a {gear.kind} gear turns its joint; kinds of gear for "
            f"joints that slide: {', '.join(able)}",
            ("kind",),
        )


def _seated(
    description: Description, loops: Mapping[str, Loop], stated: Mapping[str, Clearance]
) -> tuple[Description, dict[str, Loop], dict[str, Clearance]]:
    """Put a bush and its elastic mount between the two links of each joint in a seat."""
    loops, joints = dict(loops), {}
    for name, joint in stated.items():
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


# From a URDF to the Pinocchio model that is simulated.

_FLOATING = "JointModelFreeFlyer"

_SAME_MASS = 1e-9
"""Relative difference of masses up to which they agree: rounding."""

_NO_MOTION = 1e-9
"""Motion of a locked freedom per unit speed of a coordinate up to which it is none: rounding
[1, m, 1/m]."""

_SINGLE = {
    "x": pin.JointModelPX,
    "y": pin.JointModelPY,
    "z": pin.JointModelPZ,
    "yaw": pin.JointModelRZ,
    "pitch": pin.JointModelRY,
    "roll": pin.JointModelRX,
}
"""Pinocchio's joint for a single freedom of a virtual link."""


def parse(description: Description, released: Collection[str] = ()) -> pin.Model:
    """The model that Pinocchio reads from a URDF; shared, and not to be changed.

    Fixed joints in `released` are read as floating ones, for Pinocchio would make one body of the
    two links. The same text is read once, from a file, because Pinocchio's reader of text names no
    errors.

    Raises:
        JointplayError: Pinocchio cannot read it.
    """
    root = description.elements()
    for joint in root.findall("joint"):
        if joint.get("name") in released:
            joint.set("type", "floating")
        limit = joint.find("limit")
        if limit is None and joint.get("type") not in LIMITED:
            continue
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit")
        # Pinocchio refuses a limit that lacks a number, has one that is not finite, or an effort of
        # -1. `Description` has the true limits: nobody asks Pinocchio's model for them.
        for key in WORDS["limit"].attributes:
            value = float(limit.get(key, "nan"))
            if not np.isfinite(value) or (value < 0.0 and key in ("effort", "velocity")):
                limit.set(key, "0")
    model = _parsed(ElementTree.tostring(root, encoding="unicode"), str(description.path))
    _check_masses(model, root)
    return model


def _check_masses(model: pin.Model, root: ElementTree.Element) -> None:
    """Refuse masses other than the URDF's: Pinocchio leaves out an <inertial> it cannot read."""
    carrier = {
        frame.name: frame.parentJoint for frame in model.frames if frame.type == pin.FrameType.BODY
    }
    masses = np.zeros(model.njoints)
    links: dict[int, list[str]] = {}
    for link in root.findall("link"):
        name, mass = link.get("name", ""), link.find("inertial/mass")
        if mass is not None:
            body = carrier[name]
            masses[body] += float(mass.get("value", "0"))
            links.setdefault(body, []).append(name)
    for body, names in links.items():
        mass_read = model.inertias[body].mass
        if not np.isclose(mass_read, masses[body], rtol=_SAME_MASS, atol=0.0):
            raise JointplayError(
                f"Pinocchio reads {mass_read:g} kg where the URDF has {masses[body]:g} kg "
                f"({', '.join(names)}): see their <inertial>"
            )


@lru_cache(maxsize=32)
def _parsed(text: str, path: str) -> pin.Model:
    with temporary("urdf") as folder:
        file = Path(folder) / "robot.urdf"
        noise: list[str] = []
        try:
            file.write_text(text, encoding="utf-8")
            with caught_stderr(noise):
                return pin.buildModelFromUrdf(str(file))
        except (ValueError, RuntimeError) as error:
            lines = [*str(error).splitlines(), *noise]
            reason = next((line.strip() for line in lines if line.strip()), "no reason given")
            reason = reason.replace(str(file), Path(path).name)
            raise JointplayError(f"Pinocchio cannot read the URDF {path!r}: {reason}") from None


def build(design: Design) -> tuple[pin.Model, tuple[Coordinate, ...], dict[str, Frames]]:
    """Build Pinocchio's model of a mechanism.

    A model without locks shows which loops need them; if any do, it is built again with them.

    Returns:
        `model`, `coordinates` and `locks` of `Mechanism`.

    Raises:
        JointplayError: a joint of a kind that has no single coordinate, or two coordinates of one
            name; a free base without inertia; a loop between links that do not exist or that do
            not move against each other, or that cannot be locked.
    """
    model, coordinates = _assembled(design, {})
    if design.free_base is not None:
        _check_free_base(design, model)
    for name, loop in design.loops.items():
        with within("loops", name):
            _check_loop(name, loop, model, design.description)
    needed = dict(_needed_locks(design, model))
    if needed:
        model, coordinates = _assembled(design, needed)
    model.gravity.linear = np.array(design.gravity)
    for name, inertia in design.armature.items():
        model.armature[coordinates.index(design.ideal_coordinate(name))] = inertia
    locks = {}
    for name, lock in needed.items():
        carriage = int(model.getJointId(name))
        held = lock.share(model, carriage)
        locks[name] = (carriage, pin.SE3.Identity()), held
    return model, coordinates, locks


def _check_free_base(design: Design, model: pin.Model) -> None:
    """Refuse a free base without mass or inertia, whose motion no force would determine."""
    body = model.inertias[model.getJointId(design.free_base)]
    least = float(np.linalg.eigvalsh(body.inertia).min())
    if not body.mass > 0.0 or not least > 0.0:
        raise JointplayError(
            f"a free base needs mass and moments of inertia, and {design.description.root!r} with "
            f"what is fixed to it has {body.mass:g} kg and a least principal moment of "
            f"{least:.4g} kg m2: give it an <inertial> in the URDF, or hold the base",
            where=("base",),
        )


def _check_loop(name: str, loop: Loop, model: pin.Model, description: Description) -> None:
    for link in (loop.bearing_link, loop.journal_link):
        if not model.existFrame(link, pin.FrameType.BODY):
            raise MissingName(f"link for loop {name!r}:", link, description.links)
    (i, _), (j, _) = loop.frames(model)
    if i == j:
        raise JointplayError(
            f"loop {name!r} joins {loop.bearing_link!r} and {loop.journal_link!r}, which do not "
            "move against each other"
        )


def _needed_locks(design: Design, model: pin.Model) -> Iterator[tuple[str, Lock]]:
    """Locks by loop, for loops whose joint locks a freedom that the rest of the loop leaves free.

    A lock is needed if some coordinate moves the journal against the bearing in a locked direction;
    this is tested at three configurations, as a direction may be at rest in one by chance.
    """
    data = model.createData()
    for name, loop in design.loops.items():
        joint = design.clearance.get(name)
        if joint is None or joint.freedoms == VIRTUAL_LINK:
            continue
        ends = loop.frames(model)
        bearing, journal = ends[::-1] if joint.exchanged else ends
        signs = signs_between(model, bearing[0], journal[0])
        locked = [row for row, part in enumerate(RELATIVE) if part not in joint.freedoms]
        for q in np.random.default_rng(0).uniform(-1.0, 1.0, (3, model.nq)):
            pin.computeJointJacobians(model, data, q)
            columns = data.J.reshape(6, model.nv) * signs
            moves = motion_between(data, (bearing, journal), columns)[locked]
            if np.abs(moves).max() > _NO_MOTION:
                yield name, Lock.between(name, joint.freedoms, model, bearing, journal)
                break


def _assembled(
    design: Design, locks: Mapping[str, Lock]
) -> tuple[pin.Model, tuple[Coordinate, ...]]:
    """Copy the source joint by joint, with virtual links for joints with clearance; add motors.

    A bearing frame is turned so that its z is the joint's axis. The bodies, frames and joints
    beyond are turned back, so that at zero yaw everything stands where it stood.
    Continuous joints become ordinary revolute ones: one coordinate, which may exceed a turn.
    Carriages of `locks` come straight after the body that carries them: Pinocchio needs the joints
    of a branch side by side. A free base comes first: six coordinates that nothing holds, which
    carry all that is fixed to the URDF's root.

    Returns:
        The model, and the names of its coordinates.
    """
    source, base = design.source, design.free_base
    model = pin.Model()
    model.name, names = source.name, [*source.names]
    data = source.createData()
    pin.computeJointJacobians(source, data, pin.neutral(source))
    moved = {0: 0}  # joint of the source -> its index in the new model
    turned = {0: pin.SE3.Identity()}  # old joint frame as seen from the new one
    coordinates: list[Coordinate] = []

    def carriages(carrier: int) -> None:
        for loop, lock in locks.items():
            if lock.carrier == model.names[carrier]:
                _virtual_link(model, carrier, lock.placement, loop, lock.freedoms, names)
                coordinates.extend(Coordinate(loop, freedom) for freedom in lock.freedoms)

    if base is not None:
        moved[0] = _virtual_link(model, 0, pin.SE3.Identity(), base, VIRTUAL_LINK, names)
        coordinates.extend(Coordinate(base, part) for part in VIRTUAL_LINK)
        model.appendBodyToJoint(moved[0], source.inertias[0], pin.SE3.Identity())
    carriages(0)
    for old in range(1, source.njoints):
        name = source.names[old]
        stated = design.given_joints.get(name)
        parent = moved[source.parents[old]]
        placement = turned[source.parents[old]] * source.jointPlacements[old]
        axis, slides = _axis(source, data, old, stated)
        turned[old] = pin.SE3.Identity()
        if stated is not None and (stated.compound() or not stated.ideal):
            turn = pin.SE3(z_to(axis), np.zeros(3))
            freedoms = stated.ideal_freedoms if stated.ideal else stated.freedoms
            new = _virtual_link(model, parent, placement * turn, name, freedoms, names)
            coordinates += [Coordinate(name, freedom) for freedom in freedoms]
            turned[old] = turn.inverse()
        else:
            single = pin.JointModelPrismaticUnaligned(axis) if slides else _revolute(axis)
            new = model.addJoint(parent, single, placement, name)
            coordinates.append(Coordinate(name))
        moved[old] = new
        model.appendBodyToJoint(new, turned[old].act(source.inertias[old]), pin.SE3.Identity())
        model.addJointFrame(new)
        carriages(new)
    for frame in source.frames:  # links; joints have got theirs
        if frame.type == pin.FrameType.JOINT or frame.name == "universe":
            continue
        placement = turned[frame.parentJoint] * frame.placement
        model.addFrame(
            pin.Frame(frame.name, moved[frame.parentJoint], 0, placement, frame.type), False
        )
    for name, gear in design.gears.items():
        # The motor of a joint that slides turns in the model, too: its coordinate counts in metres,
        # and a rotor without mass feels no gravity.
        rotor = pin.Inertia(0.0, np.zeros(3), np.diag([0.0, 0.0, gear.rotor_inertia]))
        called = _free(names, f"{name}.{MOTOR}")
        motor = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), called)
        model.appendBodyToJoint(motor, rotor, pin.SE3.Identity())
        coordinates.append(Coordinate(name, MOTOR))
    _check_names(coordinates)
    return model, tuple(coordinates)


def _check_names(coordinates: Sequence[Coordinate]) -> None:
    """Refuse a joint called like a coordinate of another: results name coordinates like this."""
    seen: dict[str, Coordinate] = {}
    for coordinate in coordinates:
        first = seen.setdefault(coordinate, coordinate)
        if first is not coordinate:
            plain, part = (first, coordinate) if not first.part else (coordinate, first)
            raise JointplayError(
                f"the joint {plain.joint!r} has the same name as the coordinate {part.part!r} of "
                f"the joint {part.joint!r}; give one of them another name"
            )


def _axis(
    source: pin.Model, data: pin.Data, index: int, stated: Clearance | None
) -> tuple[np.ndarray, bool]:
    """Axis of a joint in its own frame, and whether the joint slides along it.

    Raises:
        JointplayError: the joint has no single axis, and no kind of clearance stands for it.
    """
    name, kind = source.names[index], source.joints[index].shortname()
    if (  # floating in the URDF, or fixed and released: z by definition
        kind == _FLOATING and stated is not None and {"floating", "fixed"} & {*stated.replaces}
    ):
        return np.array([0.0, 0.0, 1.0]), False
    axis = single_axis(source, data, index)
    if axis is None:
        remedy = (
            f"a floating joint can only be {' or '.join(replacing('floating'))}, with clearance"
            if kind == _FLOATING
            else "only revolute, continuous and prismatic joints are supported"
        )
        raise JointplayError(
            f"joint {name!r} is of the kind {kind.removeprefix('JointModel')}; {remedy}"
        )
    return axis


def _virtual_link(
    model: pin.Model,
    parent: int,
    placement: pin.SE3,
    name: str,
    freedoms: tuple[str, ...],
    names: Collection[str],
) -> int:
    """Append the joints of a virtual link; the index of the last, which alone has the `name`.

    Pinocchio has one joint for all three translations, and one for all three ZYX angles; where some
    are locked, each of the others is a joint of its own. `names` are taken.
    """
    parts: list[Any] = []
    for group, complete in (
        (VIRTUAL_LINK[:3], pin.JointModelTranslation),
        (VIRTUAL_LINK[3:], pin.JointModelSphericalZYX),
    ):
        free = [freedom for freedom in group if freedom in freedoms]
        parts += [complete()] if len(free) == 3 else [_SINGLE[freedom]() for freedom in free]
    for position, joint in enumerate(parts):
        last = position == len(parts) - 1
        called = name if last else _free(names, f"{name}.{position}")
        parent = model.addJoint(parent, joint, placement, called)
        placement = pin.SE3.Identity()
    return int(parent)


def _free(names: Collection[str], name: str) -> str:
    """A name that is not among `names`, for a joint that nobody looks up by name."""
    while name in names:
        name += "'"
    return name


def _revolute(axis: np.ndarray) -> Any:
    """The cheapest Pinocchio joint about `axis`."""
    for index, aligned in enumerate((pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)):
        if axis[index] == 1.0:
            return aligned()
    return pin.JointModelRevoluteUnaligned(axis)


def z_to(axis: np.ndarray) -> np.ndarray:
    """Rotation matrix that turns e_z into the unit vector `axis` by the shortest way."""
    x, y, z = axis
    if z < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    skew = np.array([[0.0, 0.0, x], [0.0, 0.0, y], [-x, -y, 0.0]])
    return np.eye(3) + skew + skew @ skew / (1.0 + z)


# Bushes in elastic seats, as links of the URDF.
#
# The bush carries the bearing. A fixed joint, which becomes its elastic mount, holds it in the link
# that would carry the bearing without a seat.

BUSH, SEAT, _BED = "_bush", "_seat", "_bed"
"""Appended to a joint's name: the bush, its mount, and a link that turns axes back."""


def seat_of_joint(
    description: Description, name: str, joint: Clearance, parts: SeatParts
) -> Description:
    """The URDF with a bush between the links of the joint `name`.

    The mount's z is the joint's axis. Where the child carries the bearing (`Clearance.exchanged`),
    a link without mass turns its axes back to the child's.

    Raises:
        JointplayError: a name is taken.
    """
    root = description.elements()
    element = next(e for e in root.findall("joint") if e.get("name") == name)
    axis = np.array([0.0, 0.0, 1.0])
    if element.get("type") not in NO_AXIS:
        axis = np.array(numbers(element.find("axis"), "xyz", "axis", 3, "1 0 0"))
        axis /= np.linalg.norm(axis)
    turn = pin.SE3(z_to(axis), np.zeros(3))
    bush, mount, bed = (f"{name}{part}" for part in (BUSH, SEAT, _BED))
    entry = description.joints[name]
    if joint.exchanged:
        elements.set_end(element, "child", bush)
        _put_bush(root, bush, parts, turn)
        elements.put(root, "link", name=bed)
        elements.put_joint(root, mount, bush, bed, turn)
        elements.put_joint(root, f"{name}{SEAT}{_BED}", bed, entry.child, turn.inverse())
    else:
        place = elements.place_of(element)
        for origin in element.findall("origin"):
            element.remove(origin)
        _put_bush(root, bush, parts)
        elements.put_joint(root, mount, entry.parent, bush, place * turn)
        elements.set_end(element, "parent", bush)
        element.append(elements.origin_of(turn.inverse()))
    return read_again(description, root, "seat", bush, mount, bed)


def seat_of_loop(
    description: Description, name: str, loop: Loop, joint: Clearance, parts: SeatParts
) -> tuple[Description, Loop]:
    """The URDF with a bush for the joint that closes the loop `name`, and the loop on the bush.

    Raises:
        JointplayError: a name is taken.
    """
    root = description.elements()
    bush, mount = f"{name}{BUSH}", f"{name}{SEAT}"
    side = "journal" if joint.exchanged else "bearing"
    link, place = getattr(loop, f"{side}_link"), getattr(loop, side)
    _put_bush(root, bush, parts)
    elements.put_joint(root, mount, link, bush, place)
    zero = (0.0, 0.0, 0.0)
    changes: dict[str, Any] = {f"{side}_link": bush, f"{side}_xyz": zero, f"{side}_rpy": zero}
    return read_again(description, root, "seat", bush, mount), replace(loop, **changes)


def _put_bush(
    root: elements.Element, name: str, parts: SeatParts, axes: pin.SE3 | None = None
) -> None:
    inertia = pin.Inertia(parts.mass, np.zeros(3), np.diag(parts.moments))
    elements.put_inertial(elements.put(root, "link", name=name), inertia, axes)
