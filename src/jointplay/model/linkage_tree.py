"""From a linkage to the tree of a URDF, and the loops that the tree leaves open.

Joints are the edges of a graph whose nodes are the links and the ground. A spanning tree of it
(Kruskal) becomes the URDF; the edges left over close loops. Sliders enter the tree first, for an
ideal one cannot close a loop, then joints on the ground, among which are the drives; joints with
play come last, so that their loops are cut where only contact acts.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.model import urdf
from jointplay.model.beams import section
from jointplay.model.elements import Element, document, put, put_inertial, put_joint, put_shape
from jointplay.model.linkage import (
    BALL,
    DRAWN,
    GROUND,
    PIN,
    PLANES,
    SLIDE,
    Edge,
    Linkage,
    LinkageLink,
)
from jointplay.model.loop import Loop, Vector
from jointplay.physics.joints import IDEAL_BALL, Clearance

_DIGITS = 15
"""Decimals to which differences of places are rounded [m], so that 0.17 - 0.05 is 0.12."""
_REACH = 10.0
"""Limits of sliders relative to the drawing's size: farther than a linkage of this size goes."""
_LINE, _PIVOT = 0.02, 0.04
"""Radius in pictures of a link's lines, and of pivots on the ground, relative to the drawing's
size."""


class LinkageTree(NamedTuple):
    """A linkage as a URDF and its loops."""

    description: urdf.Description
    loops: dict[str, Loop]
    balls: dict[str, Clearance]
    """Ideal balls, by joint."""


def tree_of(linkage: Linkage, play: Collection[str] = ()) -> LinkageTree:
    """Make a URDF and loops of a linkage.

    Args:
        play: names of joints with clearance, at which loops are cut if possible.

    Raises:
        JointplayError: links that nothing holds.
    """
    rank = {SLIDE: 0, PIN: 2, BALL: 3}

    def order(edge: Edge) -> int:
        on_ground = edge.bearing == GROUND and edge.kind == PIN
        return rank[edge.kind] - on_ground + 4 * (edge.name in play and edge.kind != SLIDE)

    # Kruskal: an edge between two parts unites them; one within a part closes a loop.
    part = {name: name for name in (GROUND, *linkage.links)}
    held, loops = [], {}
    for edge in sorted(linkage.edges, key=order):
        group, joined = part[edge.bearing], part[edge.journal]
        if group == joined:
            loops[edge.name] = edge
            continue
        held.append(edge)
        part = {name: group if mine == joined else mine for name, mine in part.items()}
    loose = [name for name in linkage.links if part[name] != part[GROUND]]
    if loose:
        raise JointplayError(
            f"link {loose[0]!r} is not connected to the ground: it shares no point with a link "
            f"that is, and slides on none",
            ("links", loose[0]),
        )
    slides = next((edge for edge in loops.values() if edge.kind == SLIDE), None)
    if slides is not None:
        raise JointplayError(
            f"slider {slides.name!r} closes a loop of sliders alone", ("sliders", slides.name)
        )
    # The origin of each link is the point of the joint that holds it.
    origins = {GROUND: np.zeros(3)}
    root = Element("robot", name="linkage")
    put(root, "link", name="world")
    axes = PLANES["horizontal" if linkage.spatial else linkage.plane]
    put_joint(root, "drawing", "world", GROUND, pin.SE3(axes, np.zeros(3)))
    ground = put(root, "link", name=GROUND)
    for edge in _from_ground(held):
        origins[edge.journal] = linkage.place(edge.point)
        place = linkage.place(edge.point) - origins[edge.bearing]
        at = pin.SE3(np.eye(3), place.round(_DIGITS))
        joint = put_joint(root, edge.name, edge.bearing, edge.journal, at, edge.kind)
        if edge.kind == SLIDE:  # for which a URDF demands limits
            reach = _REACH * linkage.size
            put(joint, "limit", lower=-reach, upper=reach, effort=0.0, velocity=0.0)
        put(joint, "axis", xyz=edge.axis / np.linalg.norm(edge.axis))
    for name, link in linkage.links.items():
        _put_link(linkage, root, name, link, origins[name])
    # Pictures of the pivots on the ground, and frames for points that move.
    for point in linkage.ground:
        at = pin.SE3(np.eye(3), linkage.place(point))
        put_shape(ground, "visual", at, "sphere", radius=_PIVOT * linkage.size)
    for point, carrier in linkage.carried.items():
        put(root, "link", name=point)
        at = pin.SE3(np.eye(3), (linkage.place(point) - origins[carrier]).round(_DIGITS))
        put_joint(root, f"{point}_of_{carrier}", carrier, point, at)
    path = Path(DRAWN)
    balls = [edge.name for edge in linkage.edges if edge.kind == BALL]
    return LinkageTree(
        urdf.parse(document(root), path),
        {name: _loop(linkage, edge, origins) for name, edge in loops.items()},
        {name: IDEAL_BALL for name in balls if name not in play},
    )


def _loop(linkage: Linkage, edge: Edge, origins: Mapping[str, np.ndarray]) -> Loop:
    """The loop that an edge closes; `origins` of the links in the drawing."""
    place = linkage.place(edge.point)
    turned = np.eye(3)
    if edge.kind == PIN:  # z along the axis
        turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), edge.axis).matrix()
    rpy = _vector_of(pin.rpy.matrixToRpy(turned))
    bearing, journal = (
        _vector_of((place - origins[link]).round(_DIGITS)) for link in (edge.bearing, edge.journal)
    )
    return Loop(edge.bearing, edge.journal, bearing, rpy, journal, rpy)


def _put_link(
    linkage: Linkage, root: Element, name: str, link: LinkageLink, origin: np.ndarray
) -> None:
    """Append a link with its inertia, and a picture of its lines."""
    element = put(root, "link", name=name)
    body = inertia_of(linkage, name)
    put_inertial(element, pin.Inertia(body.mass, body.lever - origin, body.inertia))
    for ends in linkage.lines(link):
        start, end = (point - origin for point in ends)
        line = end - start
        turned = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), line).matrix()
        middle = pin.SE3(turned, 0.5 * (start + end))
        sizes = {"radius": _LINE * linkage.size, "length": float(np.linalg.norm(line))}
        put_shape(element, "visual", middle, "cylinder", **sizes)
    if len(link.points) == 1:
        middle = pin.SE3(np.eye(3), linkage.place(link.points[0]) - origin)
        put_shape(element, "visual", middle, "box", size=[2.0 * _PIVOT * linkage.size] * 3)


def inertia_of(linkage: Linkage, link: str) -> pin.Inertia:
    """Inertia of a link in the drawing's axes, as `LinkageLink` describes it."""
    given = linkage.links[link]
    density = given.material.density
    assert density is not None
    lines = linkage.lines(given)
    length = sum(float(np.linalg.norm(end - start)) for start, end in lines)
    mass = given.mass or density * section(str(given.section)).area * length
    place = linkage.place(given.points[0])
    if not lines:
        side = (mass / density) ** (1.0 / 3.0)
        body = pin.Inertia(mass, place, mass * side**2 / 6.0 * np.eye(3))
    else:
        body = pin.Inertia.Zero()
        for start, end in lines:
            part = mass * float(np.linalg.norm(end - start)) / length
            body += _rod(part, start, end, mass / (density * length))
    centre = body.lever if given.centre is None else linkage.vector(given.centre)
    moments = body.inertia
    if given.inertia is not None:
        largest = np.linalg.eigvalsh(moments)[-1] if linkage.spatial else moments[2, 2]
        moments = moments * (given.inertia / largest)
    return pin.Inertia(mass, centre, moments)


def _vector_of(values: np.ndarray) -> Vector:
    x, y, z = map(float, values)
    return x, y, z


def _from_ground(joints: Sequence[Edge]) -> Iterator[Edge]:
    """The joints of a tree, parents first, each with its bearing on the side of the ground."""
    reached, open_joints = {GROUND}, list(joints)
    while open_joints:
        edge = next(joint for joint in open_joints if reached & {joint.bearing, joint.journal})
        open_joints.remove(edge)
        if edge.bearing not in reached:
            axis = -edge.axis if edge.kind == SLIDE else edge.axis
            edge = edge._replace(bearing=edge.journal, journal=edge.bearing, axis=axis)
        reached.add(edge.journal)
        yield edge


def _rod(mass: float, start: np.ndarray, end: np.ndarray, area: float) -> pin.Inertia:
    """Inertia of a uniform round rod with a cross-section of `area` [m^2]."""
    line = end - start
    length = float(np.linalg.norm(line))
    along = np.outer(line, line) / length**2
    radius_squared = area / np.pi
    across = length**2 / 12.0 + radius_squared / 4.0
    moments = across * (np.eye(3) - along) + 0.5 * radius_squared * along
    return pin.Inertia(mass, 0.5 * (start + end), mass * moments)
