"""Flexible links cut into rigid pieces and elastic hinges, as links and joints of the URDF.

The link NAME becomes rigid pieces NAME, NAME_2, NAME_3, ...; the hinges between them are mounts
NAME_hinge_1, NAME_hinge_2, ... that give way in bending and torsion. In the URDF the hinges are
fixed joints, as they are in the ideal mechanism. The frame NAME_tip is at the end. Joints and loops
on the link move to the pieces that carry them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from copy import deepcopy
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, MissingName, require_known, within
from jointplay.base.tables import counted, few
from jointplay.base.units import readable
from jointplay.model.beams import FlexibleLink, section
from jointplay.model.elements import (
    Element,
    origin_of,
    place_of,
    put,
    put_inertial,
    put_joint,
    put_shape,
    set_end,
)
from jointplay.model.inertias import tensor_of
from jointplay.model.loop import Loop
from jointplay.model.urdf import Description, read_again
from jointplay.physics.joints import Clearance
from jointplay.physics.joints.compliance import hinge_of_beam

HINGE, TIP = "_hinge_", "_tip"
"""Appended to a link's name: its hinges, with a number behind, and the frame at its end."""

_SHORTEST_M = 1e-6
"""Length of the shortest beam."""


class Cut(NamedTuple):
    """A mechanism with flexible links cut into pieces."""

    description: Description
    loops: dict[str, Loop]
    hinges: dict[str, Clearance]
    """Hinges by name."""
    summaries: dict[str, str]
    """A line on each flexible link: section, mass, frequencies."""


def cut_links(
    description: Description, loops: Mapping[str, Loop], flexible: Mapping[str, FlexibleLink]
) -> Cut:
    """Cut the flexible links of a URDF, by name, and put its loops on the pieces.

    Raises:
        JointplayError: no such link, no end for a beam, or a name that is taken.
    """
    cut = Cut(description, dict(loops), {}, {})
    for name, link in flexible.items():
        with within("flexible", name):
            if not isinstance(link, FlexibleLink):
                raise JointplayError(f"link {name!r} needs a FlexibleLink, got {link!r}")
            require_known("link", name, description.links)
            cut = _cut(cut, name, link)
    return cut


def end_of_tool(tool: str, flexible: Mapping[str, FlexibleLink]) -> str:
    """The tool, or the frame at its end if it is a flexible link."""
    return f"{tool}{TIP}" if tool in flexible else tool


def _cut(cut: Cut, name: str, flexible: FlexibleLink) -> Cut:
    """Cut one more link, and its entry in the URDF, loops and hinges so far."""
    root = cut.description.elements()
    link = next(element for element in root.findall("link") if element.get("name") == name)
    entries = cut.description.joints
    carried = [j for j in root.findall("joint") if entries[j.get("name", "")].parent == name]
    last, end = _end(name, flexible, carried)
    start = np.array(flexible.start)
    length = float(np.linalg.norm(end - start))
    if length < _SHORTEST_M:
        at = ", ".join(f"{number:g}" for number in end)
        raise JointplayError(
            f"the beam of link {name!r} has no length: it begins and ends at {at} m; "
            "give start, tip or to"
        )
    along = (end - start) / length
    axes = _axes(along, flexible)
    places = flexible.hinges(length)
    # The first piece keeps the link's frame; each other has its own in the hinge before it.
    frames = [pin.SE3.Identity(), *(pin.SE3(axes, start + s * along) for s in places)]
    pieces = [name, *(f"{name}_{k + 2}" for k in range(flexible.segments))]
    hinges = [f"{name}{HINGE}{k + 1}" for k in range(flexible.segments)]

    def piece_at(point: np.ndarray) -> int:
        return int(np.count_nonzero(places < along @ (point - start)))

    # The pieces, with inertias and pictures in place of the link's.
    bounds = np.array([0.0, *places, length])
    inertias, masses = _inertias(link, flexible, frames, bounds, axes, start)
    colour = link.find("visual/material")
    for tag in ("visual", "collision", "inertial"):
        for element in link.findall(tag):
            link.remove(element)
    elements = [link, *(put(root, "link", name=piece) for piece in pieces[1:])]
    for k, element in enumerate(elements):
        put_inertial(element, inertias[k])
        middle = pin.SE3(axes, start + 0.5 * (bounds[k] + bounds[k + 1]) * along)
        seen = frames[k].actInv(middle)
        form, sizes = _solid(flexible, bounds[k + 1] - bounds[k])
        shape = put_shape(element, "visual", seen, form, **sizes)
        if colour is not None:
            shape.append(deepcopy(colour))
        put_shape(element, "collision", seen, form, **sizes)
    # Hinges and tip between them; then what the link carried, on its pieces.
    for k, hinge in enumerate(hinges):
        put_joint(root, hinge, pieces[k], pieces[k + 1], frames[k].actInv(frames[k + 1]))
    put(root, "link", name=f"{name}{TIP}")
    end_frame = frames[-1].actInv(pin.SE3(np.eye(3), end))
    put_joint(root, f"{name}{TIP}", pieces[-1], f"{name}{TIP}", end_frame)
    for joint in carried:
        place = place_of(joint)
        k = flexible.segments if joint is last else piece_at(place.translation)
        set_end(joint, "parent", pieces[k])
        origin = joint.find("origin")
        if origin is not None:
            joint.remove(origin)
        joint.insert(0, origin_of(frames[k].actInv(place)))
    loops = {key: _moved(loop, name, pieces, frames, piece_at) for key, loop in cut.loops.items()}
    stretch = length / flexible.segments
    names = (*pieces[1:], *hinges, f"{name}{TIP}")
    return Cut(
        read_again(cut.description, root, "flexible link", *names),
        loops,
        {**cut.hinges, **dict.fromkeys(hinges, _hinge(flexible, stretch, length))},
        {**cut.summaries, name: _summary(flexible, length, masses)},
    )


def _end(
    name: str, flexible: FlexibleLink, carried: list[Element]
) -> tuple[Element | None, np.ndarray]:
    """Joint at which the beam ends, if it ends at one, and the point in the link's frame [m]."""
    if flexible.tip is not None:
        return None, np.array(flexible.tip)
    by_name = {joint.get("name", ""): joint for joint in carried}
    if flexible.to is not None:
        if flexible.to not in by_name:
            noun = f"joint that link {name!r} carries"
            raise MissingName(noun, flexible.to, by_name, where=("to",))
        last = by_name[flexible.to]
        return last, place_of(last).translation
    moving = [joint for joint in carried if joint.get("type") != "fixed"] or carried
    if len(moving) != 1:
        if not moving:
            raise JointplayError(
                f"link {name!r} carries no joint at which its beam could end: give tip, the point "
                'in the link\'s frame, such as [0, 0, "300 mm"]'
            )
        raise JointplayError(
            f"link {name!r} carries several joints: give to, one of {', '.join(by_name)}, or tip"
        )
    return moving[0], place_of(moving[0]).translation


def _axes(along: np.ndarray, flexible: FlexibleLink) -> np.ndarray:
    """Axes of the section in the link's frame, (3, 3): x along its width, y height, z the beam."""
    direction = flexible.height_along
    if direction is None:
        direction = (0.0, 1.0, 0.0) if abs(along[2]) > 0.9 else (0.0, 0.0, 1.0)
    height = np.array(direction) - along * (along @ np.array(direction))
    size = float(np.linalg.norm(height))
    if size < 1e-6 * float(np.linalg.norm(direction)):
        raise JointplayError("height_along lies along the beam", where=("height_along",))
    height /= size
    return np.column_stack([np.cross(height, along), height, along])


def _inertias(
    link: Element,
    flexible: FlexibleLink,
    frames: list[pin.SE3],
    bounds: np.ndarray,
    axes: np.ndarray,
    start: np.ndarray,
) -> tuple[list[pin.Inertia], tuple[float, float]]:
    """Inertia of each piece in its frame; the mass of the URDF's link, and the part that is kept.

    What the URDF's link weighs beyond the beam stays, as a rigid body on the piece at its centre of
    mass.
    """
    beam, inertias = flexible.beam, []
    for frame, low, high in zip(frames, bounds[:-1], bounds[1:], strict=True):
        size = high - low
        across = beam.mass * size**3 / 12.0
        x, y = (size * density for density in beam.turning)
        piece = pin.Inertia(beam.mass * size, np.zeros(3), np.diag([x + across, y + across, x + y]))
        middle = pin.SE3(axes, start + 0.5 * (low + high) * axes[:, 2])
        inertias.append(frame.actInv(middle).act(piece))
    stated = _given_inertia(link)
    remainder = 0.0 if stated is None else stated.mass - beam.mass * bounds[-1]
    if stated is None or remainder <= 0.0:
        return inertias, (0.0 if stated is None else stated.mass, 0.0)
    rigid = pin.Inertia(remainder, stated.lever, stated.inertia * (remainder / stated.mass))
    k = int(np.count_nonzero(bounds[1:-1] < axes[:, 2] @ (stated.lever - start)))
    inertias[k] = inertias[k] + frames[k].actInv(rigid)
    return inertias, (stated.mass, remainder)


def _given_inertia(link: Element) -> pin.Inertia | None:
    """Inertia of a link in its frame; None if it has no <inertial>."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass = inertial.find("mass")
    assert mass is not None  # checked when the URDF was read
    tensor = tensor_of(inertial, f"link {link.get('name')!r}")
    inertia = pin.Inertia(float(mass.get("value", "0")), np.zeros(3), tensor)
    return place_of(inertial).act(inertia)


def _solid(flexible: FlexibleLink, length: float) -> tuple[str, dict[str, Any]]:
    """Form and sizes of a piece as URDF has them: its section, filled."""
    if flexible.section is None:
        radius = math.sqrt(2.0) * (flexible.gyration_radius or 0.0)
        form, width, height = "rod", 2.0 * radius, 2.0 * radius
    else:
        profile = section(flexible.section)
        form, (width, height) = profile.form, profile.size
    if form in ("tube", "rod"):
        return "cylinder", {"radius": 0.5 * width, "length": length}
    return "box", {"size": (width, height, length)}


def _hinge(flexible: FlexibleLink, stretch: float, length: float) -> Clearance:
    """Hinge with the stiffness and damping of one stretch of the beam, z along it.

    Where shear stiffness is not known, translations get that of a beam in bending (12 EI / h^3).
    """
    beam = flexible.beam
    across = beam.shear or tuple(12.0 * x / stretch**2 for x in beam.bending)
    stiffness = np.array([*across, beam.axial, *beam.bending, beam.torsion]) / stretch
    locked = ("z",) if flexible.shear else ("x", "y", "z")
    locked = locked if flexible.torsion else (*locked, "yaw")
    damping_time = flexible.damping_time(length)
    return hinge_of_beam(stiffness, damping_time, locked)


def _moved(
    loop: Loop,
    name: str,
    pieces: list[str],
    frames: list[pin.SE3],
    piece_at: Callable[[np.ndarray], int],
) -> Loop:
    """A loop with its ends on the pieces that carry them."""
    for side in ("bearing", "journal"):
        if getattr(loop, f"{side}_link") != name:
            continue
        place = getattr(loop, side)
        k = piece_at(place.translation)
        moved = frames[k].actInv(place)
        rpy = tuple(map(float, pin.rpy.matrixToRpy(moved.rotation)))
        xyz = tuple(map(float, moved.translation))
        changes = {f"{side}_link": pieces[k], f"{side}_xyz": xyz, f"{side}_rpy": rpy}
        loop = replace(loop, **changes)  # type: ignore[arg-type]
    return loop


def _summary(flexible: FlexibleLink, length: float, masses: tuple[float, float]) -> str:
    """A line on a flexible link; `masses` are those of the URDF's link and of what is kept."""
    beam, (stated, remainder) = flexible.beam, masses
    label = flexible.section or "given stiffness"
    if flexible.material is not None:
        label += f", {flexible.material.name or 'given material'}"
    mass = f"beam {beam.mass * length:.3g} kg"
    if remainder > 0.0:
        mass += f" of the URDF's {stated:.3g} kg, the rest rigid at its centre of mass"
    elif stated > 0.0:
        mass += f" instead of the URDF's {stated:.3g} kg"
    motions = ["bending", *(["torsion"] if flexible.torsion else [])]
    motions += ["shear"] if flexible.shear else []
    first = ", ".join(f"{frequency:.4g}" for frequency in beam.frequencies(length))
    parts = [
        f"flexible, {label}, {readable(length, 'm')} long, {counted(flexible.segments, 'segment')}",
        mass,
        f"{few(motions)}, rigid otherwise",
        f"alone, clamped and free, {first} Hz in theory",
        f"damping ratio {flexible.damping_ratio:g} at the first of them",
    ]
    share = beam.shear_share(length)
    if not flexible.shear and share > 0.01:
        parts.append(f"shear, left out, would add {100.0 * share:.2g} % to its sag under a force")
    return "; ".join(parts)
