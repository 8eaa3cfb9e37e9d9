"""XML elements of URDF and other robot formats, with numbers that read back the same."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pinocchio as pin

Element = ElementTree.Element


def put(parent: Element, tag: str, **values: Any) -> Element:
    """Append an element with attributes: text, numbers, or arrays of numbers."""
    texts = {name: written(value) for name, value in values.items()}
    return ElementTree.SubElement(parent, tag, texts)


def written(value: Any) -> str:
    """An attribute's text: text as it is, numbers so that they read back the same."""
    if isinstance(value, str):
        return value
    return " ".join(_shortest(float(x) + 0.0) for x in np.ravel(value))


def _shortest(number: float) -> str:
    """Fifteen digits where they read back the same, as of 1.6e-6, else seventeen."""
    text = f"{number:.15g}"
    return text if float(text) == number else f"{number:.17g}"


def document(root: Element) -> str:
    """The text of an XML file, indented."""
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def put_inertial(link: Element, inertia: pin.Inertia, axes: pin.SE3 | None = None) -> None:
    """Append a link's <inertial>: `inertia` in the link's frame, or about the origin of `axes`."""
    inertial = put(link, "inertial")
    place = pin.SE3(np.eye(3), inertia.lever) if axes is None else axes
    if not place.isIdentity(0.0):
        inertial.append(origin_of(place))
    put(inertial, "mass", value=inertia.mass)
    put(inertial, "inertia", **moments(inertia.inertia))


def moments(matrix: np.ndarray) -> dict[str, float]:
    """The entries of an inertia (3, 3) by their names, ixx to izz."""
    pairs = [("xyz"[i], "xyz"[k], matrix[i, k]) for i in range(3) for k in range(i, 3)]
    return {f"i{a}{b}": float(value) for a, b, value in pairs}


def put_joint(
    root: Element, name: str, parent: str, child: str, place: pin.SE3, kind: str = "fixed"
) -> Element:
    """Append a joint with the child at `place` in the parent."""
    joint = put(root, "joint", name=name, type=kind)
    joint.append(origin_of(place))
    put(joint, "parent", link=parent)
    put(joint, "child", link=child)
    return joint


def put_shape(link: Element, role: str, place: pin.SE3, form: str, **sizes: Any) -> Element:
    """Append a shape to a link, as its ``visual`` or ``collision`` (`role`)."""
    shape = put(link, role)
    shape.append(origin_of(place))
    put(put(shape, "geometry"), form, **sizes)
    return shape


def set_end(joint: Element, end: str, link: str) -> None:
    """Set the link at an end (``parent`` or ``child``) of a joint."""
    for element in joint.findall(end):
        element.set("link", link)


def place_of(element: Element) -> pin.SE3:
    """Pose that the <origin> of a joint, an <inertial> or a shape states."""
    origin = element.find("origin")
    if origin is None:
        return pin.SE3.Identity()
    xyz, rpy = ([float(x) for x in origin.get(key, "0 0 0").split()] for key in ("xyz", "rpy"))
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))


def origin_of(place: pin.SE3) -> Element:
    """An <origin> element that states a pose."""
    xyz, rpy = place.translation, pin.rpy.matrixToRpy(place.rotation)
    return Element("origin", {"xyz": written(xyz), "rpy": written(rpy)})
