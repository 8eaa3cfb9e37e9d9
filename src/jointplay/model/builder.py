"""From a URDF to the Pinocchio model that is simulated: virtual links in, motors added."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Iterator, Mapping, Sequence
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, MissingName, within
from jointplay.base.files import temporary
from jointplay.base.streams import caught_stderr
from jointplay.model.frames import Frames, motion_between, motions, signs_between
from jointplay.model.loop import Lock, Loop
from jointplay.model.urdf import LIMITED, Description
from jointplay.model.vocabulary import WORDS
from jointplay.physics.joints import (
    MOTOR,
    RELATIVE,
    VIRTUAL_LINK,
    Clearance,
    Coordinate,
    replacing,
)

if TYPE_CHECKING:
    from jointplay.model.design import Design

_REVOLUTE = ("JointModelR", "JointModelRevolute")
_PRISMATIC = ("JointModelP", "JointModelPrismatic")
_FLOATING = "JointModelFreeFlyer"
_URDF_FLOATING, _URDF_FIXED = "floating", "fixed"

_SAME_MASS = 1e-9
"""Relative difference of masses that passes for rounding."""

_NO_MOTION = 1e-9
"""Motion of a locked freedom per unit speed of a coordinate that passes for rounding [1, m, 1/m].
"""

_SINGLE = {
    "x": pin.JointModelPX,
    "y": pin.JointModelPY,
    "z": pin.JointModelPZ,
    "yaw": pin.JointModelRZ,
    "pitch": pin.JointModelRY,
    "roll": pin.JointModelRX,
}


def parse(description: Description, released: Collection[str] = ()) -> pin.Model:
    """Pinocchio's own reading of the URDF, from a file because its text reader names no errors.

    Fixed joints in `released` are read as floating ones, for Pinocchio would make one body of the
    two links. The same text is read once: what is returned is shared, and must not be changed.

    Raises:
        JointplayError: Pinocchio cannot read it.
    """
    root = description.elements()
    for joint in root.findall("joint"):
        if joint.get("name") in released:
            joint.set("type", _URDF_FLOATING)
        limit = joint.find("limit")
        if limit is None and joint.get("type") not in LIMITED:
            continue
        if limit is None:
            limit = ElementTree.SubElement(joint, "limit")
        # Pinocchio wants all of them, finite, and no effort of -1; nobody asks it for them.
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
        found = model.inertias[body].mass
        if not np.isclose(found, masses[body], rtol=_SAME_MASS, atol=0.0):
            raise JointplayError(
                f"Pinocchio reads {found:g} kg where the URDF has {masses[body]:g} kg "
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
            said = [*str(error).splitlines(), *noise]
            reason = next((line.strip() for line in said if line.strip()), "no reason given")
            reason = reason.replace(str(file), Path(path).name)
            raise JointplayError(f"Pinocchio cannot read the URDF {path!r}: {reason}") from None


class Built(NamedTuple):
    """Pinocchio's model of a mechanism."""

    model: pin.Model
    coordinates: tuple[Coordinate, ...]
    """Names of the generalised coordinates, in the order of q and v."""
    locks: dict[str, Frames]
    """Carriage and what is fixed to it, by loop; see `Mechanism`."""


def build(design: Design) -> Built:
    """The model of a mechanism.

    Which loops need locks shows only in a model without: where there are some it is made again.

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
        model.armature[coordinates.index(design.own_coordinate(name))] = inertia
    locks = {}
    for name, lock in needed.items():
        carriage = int(model.getJointId(name))
        held = lock.share(model, carriage)
        locks[name] = (carriage, pin.SE3.Identity()), held
    return Built(model, coordinates, locks)


def _check_free_base(design: Design, model: pin.Model) -> None:
    """Refuse a free base that nothing but forces without inertia would move."""
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
    """Locks of the loops whose joints lock what the other joints of the loop leave free.

    Found at some configurations, since what is free in all of them is free.
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
    """Copy the source joint by joint, those with clearance as virtual links; append the motors.

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
    moved = {0: 0}
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
        given = design.given_joints.get(name)
        parent = moved[source.parents[old]]
        placement = turned[source.parents[old]] * source.jointPlacements[old]
        axis, slides = _axis(source, data, old, given)
        turned[old] = pin.SE3.Identity()
        if given is not None and (given.compound() or not given.ideal):
            turn = pin.SE3(z_to(axis), np.zeros(3))
            freedoms = given.ideal_freedoms if given.ideal else given.freedoms
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
    for frame in source.frames:
        if frame.type == pin.FrameType.JOINT or frame.name == "universe":
            continue
        placement = turned[frame.parentJoint] * frame.placement
        model.addFrame(
            pin.Frame(frame.name, moved[frame.parentJoint], 0, placement, frame.type), False
        )
    for name, gear in design.gears.items():
        # Of a joint that slides, too: its coordinate is in metres, and gravity does not act on it.
        rotor = pin.Inertia(0.0, np.zeros(3), np.diag([0.0, 0.0, gear.rotor_inertia]))
        called = _free(names, f"{name}.{MOTOR}")
        motor = model.addJoint(0, pin.JointModelRZ(), pin.SE3.Identity(), called)
        model.appendBodyToJoint(motor, rotor, pin.SE3.Identity())
        coordinates.append(Coordinate(name, MOTOR))
    _check_names(coordinates)
    return model, tuple(coordinates)


def _check_names(coordinates: Sequence[Coordinate]) -> None:
    """Refuse a joint that is called like a coordinate of another, for results name them so."""
    seen: dict[str, Coordinate] = {}
    for one in coordinates:
        other = seen.setdefault(one, one)
        if other is not one:
            plain, part = (other, one) if not other.part else (one, other)
            raise JointplayError(
                f"the joint {plain.joint!r} has the same name as the coordinate {part.part!r} of "
                f"the joint {part.joint!r}; give one of them another name"
            )


def _axis(
    source: pin.Model, data: pin.Data, index: int, given: Clearance | None
) -> tuple[np.ndarray, bool]:
    """Axis of a joint in its own frame, and whether it slides along it."""
    name, joint = source.names[index], source.joints[index]
    kind = joint.shortname()
    if (
        kind == _FLOATING
        and given is not None
        and {_URDF_FLOATING, _URDF_FIXED} & {*given.replaces}
    ):
        return np.array([0.0, 0.0, 1.0]), False
    if not kind.startswith(_REVOLUTE + _PRISMATIC) or joint.nv != 1:
        remedy = (
            f"a floating joint can only be {' or '.join(replacing(_URDF_FLOATING))}, with clearance"
            if kind == _FLOATING
            else "only revolute, continuous and prismatic joints are supported"
        )
        raise JointplayError(
            f"joint {name!r} is of the kind {kind.removeprefix('JointModel')}; {remedy}"
        )
    (way,), slides = motions(source, data, index), kind.startswith(_PRISMATIC)
    return (way[:3] if slides else way[3:]), slides


def _virtual_link(
    model: pin.Model,
    parent: int,
    placement: pin.SE3,
    name: str,
    freedoms: tuple[str, ...],
    taken: Collection[str],
) -> int:
    """Append the joints of a virtual link; the last has the plain `name`, others none `taken`."""
    parts: list[Any] = []
    for group, whole in (
        (VIRTUAL_LINK[:3], pin.JointModelTranslation),
        (VIRTUAL_LINK[3:], pin.JointModelSphericalZYX),
    ):
        free = [freedom for freedom in group if freedom in freedoms]
        parts += [whole()] if len(free) == 3 else [_SINGLE[freedom]() for freedom in free]
    for position, joint in enumerate(parts):
        last = position == len(parts) - 1
        called = name if last else _free(taken, f"{name}.{position}")
        parent = model.addJoint(parent, joint, placement, called)
        placement = pin.SE3.Identity()
    return int(parent)


def _free(taken: Collection[str], name: str) -> str:
    """A name for a joint that nobody looks up, which none of the robot has."""
    while name in taken:
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
