"""Inertias of a URDF's links: those that no rigid body has, and which of them matter.

A rigid body's principal moments are positive, and none exceeds the sum of the other two. Links that
are fixed to each other move as one body, so that only the sum of their inertias matters.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Collection, Mapping
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.tables import few
from jointplay.model.vocabulary import MIRRORED, as_option, numbers

if TYPE_CHECKING:
    import pinocchio as pin

ALL = "all"
"""Word for the names of all links whose inertia no rigid body has."""
LARGEST = 1e6
"""Largest length [m] or angle [rad]: a float there still tells 0.1 nm and 0.1 nrad apart."""
TOLERANCE = 1e-6
"""Violation of the triangle inequality up to which it is rounding, relative to the sum."""


def impossible_inertias(
    root: ElementTree.Element, free_base: bool = False, loose: Collection[str] = ()
) -> dict[str, str]:
    """Faults of inertias that no rigid body has and on which the motion depends, by link.

    Where links fixed to each other have a possible inertia together, those of the single links do
    not matter. Nor does the inertia of the base, unless it is free. Fixed joints that are `loose`
    have clearance: their links are two bodies.

    Raises:
        JointplayError: numbers of an inertia are missing or none; a mass is negative.
    """
    inertias = _inertias(root)
    faults = _faults(inertias)
    if not faults:
        return {}
    bodies = _bodies(root, loose)
    ground = next(iter(bodies))
    wrong = {
        first
        for first, places in bodies.items()
        if (free_base or first != ground)
        and not faults.keys().isdisjoint(places)
        and _fault(first, *_united(root, places, inertias))
    }
    return {
        name: fault for name, fault in faults.items() if any(name in bodies[body] for body in wrong)
    }


def require_possible(faults: Mapping[str, str], allowed: Collection[str]) -> None:
    """Refuse faults of links that are not allowed by name, or all by ``"all"``."""
    wrong = [] if ALL in allowed else [name for name in faults if name not in allowed]
    if wrong:
        flag = f"--allow-unphysical {ALL}"
        others = f" (impossible too: {', '.join(wrong[1:])}; all: {flag})" if wrong[1:] else ""
        raise JointplayError(faults[wrong[0]] + others)


def harmless_inertias(root: ElementTree.Element) -> str:
    """A line on inertias that no rigid body has and on which no motion depends; empty if none."""
    matter = impossible_inertias(root)
    names = [name for name in inertia_faults(root) if name not in matter]
    if not names:
        return ""
    return (
        f"inertias that no rigid body has, of links whose bodies have possible ones or stand "
        f"still: {few(names)}"
    )


def inertia_faults(root: ElementTree.Element) -> dict[str, str]:
    """Faults of the links' inertias, each link by itself; see `impossible_inertias`."""
    return _faults(_inertias(root))


def _faults(inertias: Mapping[str, tuple[float, np.ndarray]]) -> dict[str, str]:
    faults = {name: _fault(name, *inertia) for name, inertia in inertias.items()}
    return {name: fault for name, fault in faults.items() if fault}


def tensor_of(inertial: ElementTree.Element, owner: str) -> np.ndarray:
    """Inertia tensor about the centre of mass, in the axes of an <inertial>, (3, 3) [kg m2].

    `owner`: the link, as messages name it.
    """
    element = inertial.find("inertia")
    xx, yy, zz, xy, xz, yz = (
        numbers(element, f"i{axes}", f"{owner}: inertia i{axes}", 1)[0]
        for axes in ("xx", "yy", "zz", "xy", "xz", "yz")
    )
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _inertias(root: ElementTree.Element) -> dict[str, tuple[float, np.ndarray]]:
    """Mass [kg] and inertia tensor about its centre, axes of the <inertial> [kg m2], by link."""
    inertias = {}
    for link in root.findall("link"):
        inertial = link.find("inertial")
        if inertial is None:
            continue
        name = link.get("name", "")
        owner = f"link {name!r}"
        (mass,) = numbers(inertial.find("mass"), "value", f"{owner}: mass value", 1)
        if mass < 0.0:
            raise JointplayError(f"{owner} has the mass {mass:g} kg; it must be positive")
        element = inertial.find("inertia")
        for key, same in MIRRORED.items():
            if element is not None and key in element.attrib:
                (value,) = numbers(element, key, f"{owner}: inertia {key}", 1)
                (mirrored,) = numbers(element, same, f"{owner}: inertia {same}", 1)
                if value != mirrored:
                    raise JointplayError(
                        f"{owner}: inertia has {same} {mirrored:g} and {key} {value:g}, which must "
                        f"be equal; leave out {key}"
                    )
        inertias[name] = mass, tensor_of(inertial, owner)
    return inertias


def _fault(name: str, mass: float, tensor: np.ndarray) -> str:
    """Message why no rigid body has the inertia of the link `name`; empty if one has."""
    owner = f"link {name!r}"
    if mass == 0.0 and not tensor.any():
        return ""  # a frame without mass
    if mass == 0.0:
        return f"{owner} has the mass {mass:g} kg; it must be positive"
    low, middle, high = np.linalg.eigvalsh(tensor)
    moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg m2"
    hint = f"; correct it, or allow this link by name (--allow-unphysical {as_option([name])})"
    if low <= 0.0:
        return f"{owner} has {moments}: not positive definite{hint}"
    if high > mass * LARGEST**2:
        return f"{owner} has {moments}: no body of {mass:g} kg reaches so far{hint}"
    if high > (low + middle) * (1.0 + TOLERANCE):
        return (
            f"{owner} has {moments}: no rigid body has {high:.4g} > {low:.4g} + {middle:.4g}{hint}"
        )
    return ""


def _bodies(root: ElementTree.Element, loose: Collection[str]) -> dict[str, dict[str, pin.SE3]]:
    """Bodies of links that fixed joints hold together, by their first link; the base's first.

    Each body has its links with their poses in the first link. Fixed joints that are `loose` do
    not hold.
    """
    import pinocchio as pin

    from jointplay.model.elements import place_of

    fixed: dict[str, list[tuple[str, pin.SE3]]] = {}
    moved, held = [], set()
    for joint in root.findall("joint"):
        parent, child = (
            end.get("link", "")
            for end in (joint.find("parent"), joint.find("child"))
            if end is not None
        )
        if joint.get("type") == "fixed" and joint.get("name") not in loose:
            fixed.setdefault(parent, []).append((child, place_of(joint)))
            held.add(child)
        else:
            moved.append(child)
    links = [link.get("name", "") for link in root.findall("link")]
    base = next(link for link in links if link not in held and link not in moved)
    bodies = {}
    for first in (base, *moved):
        places, new = {first: pin.SE3.Identity()}, [first]
        while new:
            parent = new.pop()
            for child, place in fixed.get(parent, ()):
                places[child] = places[parent] * place
                new.append(child)
        bodies[first] = places
    return bodies


def _united(
    root: ElementTree.Element,
    places: dict[str, pin.SE3],
    inertias: Mapping[str, tuple[float, np.ndarray]],
) -> tuple[float, np.ndarray]:
    """Mass [kg] and inertia tensor about its centre [kg m2] of a body of links at `places`.

    `inertias` are those of the single links. By hand, by parallel axes (Steiner), as Pinocchio
    refuses parts that no body has.
    """
    from jointplay.model.elements import place_of

    parts = []
    for link in root.findall("link"):
        name, inertial = link.get("name", ""), link.find("inertial")
        if name in places and inertial is not None:
            place, (mass, tensor) = places[name] * place_of(inertial), inertias[name]
            parts.append((mass, place.translation, place.rotation @ tensor @ place.rotation.T))
    total = sum(mass for mass, _, _ in parts)
    centre = sum(mass * place for mass, place, _ in parts) / (total or 1.0)
    away = [place - centre for _, place, _ in parts]
    return total, sum(
        tensor + mass * (d @ d * np.eye(3) - np.outer(d, d))
        for (mass, _, tensor), d in zip(parts, away, strict=True)
    )
