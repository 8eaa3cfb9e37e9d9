"""A reduced model of a joint's play as SDF, as URDF with YAML, and as JSON."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.analysis.bodies import Body, bodies
from jointplay.analysis.reduce import Reduction
from jointplay.analysis.reduced_mjcf import ENCODERS
from jointplay.errors import JointplayError, MissingName, require_non_negative
from jointplay.mechanism.mechanism import Mechanism

SPREAD = 0.3
"""Half width of ranges for randomisation, relative, of what is not measured: an assumption."""


def to_sdf(mechanism: Mechanism, reduction: Reduction) -> str:
    """The robot as SDF 1.9; play is a hinge in series, `J_play`, behind the motor's link.

    The bearing's friction acts on the motor's side of the play, for SDF has no joint beside
    another.
    """
    root = ElementTree.Element("sdf", version="1.9")
    model = ElementTree.SubElement(root, "model", name=mechanism.description.path.stem)
    base = _link(model, "base", pin.SE3.Identity(), None)
    fixed = ElementTree.SubElement(model, "joint", name="base_fixed", type="fixed")
    _texts(fixed, parent="world", child="base")
    assert base is not None
    places: dict[str, pin.SE3] = {"": pin.SE3.Identity()}
    for body in bodies(mechanism):
        place = places[body.name] = places[body.parent] * body.placement
        parent = f"{body.parent}_link" if body.parent else "base"
        mine = body.name == reduction.joint
        friction = reduction.friction if mine else body.friction
        damping = reduction.viscous if mine else body.damping
        if mine and reduction.dead_band > 0.0:
            rotor = pin.Inertia(1e-6, np.zeros(3), _rotor(body.axis, reduction.rotor_inertia))
            _link(model, f"{body.name}_motor", place, rotor)
            _sdf_joint(model, body, body.name, parent, f"{body.name}_motor", friction, damping)
            half = 0.5 * reduction.dead_band
            stop = reduction.stiffness, reduction.damping
            _sdf_joint(
                model,
                body,
                f"{body.name}_play",
                f"{body.name}_motor",
                f"{body.name}_link",
                0.0,
                reduction.damping,
                (-half, half),
                stop,
            )
        else:
            _sdf_joint(model, body, body.name, parent, f"{body.name}_link", friction, damping)
        _link(model, f"{body.name}_link", place, body.inertia)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def _sdf_joint(
    model: ElementTree.Element,
    body: Body,
    name: str,
    parent: str,
    child: str,
    friction: float,
    damping: float,
    limits: tuple[float, float] | None = None,
    stop: tuple[float, float] | None = None,
) -> None:
    kind = "prismatic" if body.slides else "revolute"
    joint = ElementTree.SubElement(model, "joint", name=name, type=kind)
    _texts(joint, parent=parent, child=child)
    axis = ElementTree.SubElement(joint, "axis")
    _texts(axis, xyz=_numbers(body.axis))
    low, high = limits or body.limits
    limit = ElementTree.SubElement(axis, "limit")
    if np.isfinite([low, high]).all():
        _texts(limit, lower=f"{low:.17g}", upper=f"{high:.17g}")
    if stop is not None:
        _texts(limit, stiffness=f"{stop[0]:.17g}", dissipation=f"{stop[1]:.17g}")
    dynamics = ElementTree.SubElement(axis, "dynamics")
    _texts(dynamics, damping=f"{damping:.17g}", friction=f"{friction:.17g}")


def _link(
    model: ElementTree.Element, name: str, place: pin.SE3, inertia: pin.Inertia | None
) -> ElementTree.Element:
    link = ElementTree.SubElement(model, "link", name=name)
    angles = pin.rpy.matrixToRpy(place.rotation)
    _texts(link, pose=_numbers([*place.translation, *angles]))
    inertial = ElementTree.SubElement(link, "inertial")
    mass, lever, matrix = 1e-3, np.zeros(3), 1e-6 * np.eye(3)
    if inertia is not None and inertia.mass > 0.0:
        mass, lever, matrix = inertia.mass, inertia.lever, inertia.inertia
    _texts(inertial, pose=_numbers([*lever, 0.0, 0.0, 0.0]), mass=f"{mass:.17g}")
    tensor = ElementTree.SubElement(inertial, "inertia")
    _texts(
        tensor,
        **{
            f"i{a}{b}": f"{matrix['xyz'.index(a), 'xyz'.index(b)]:.17g}"
            for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
        },
    )
    return link


def to_urdf(mechanism: Mechanism, reduction: Reduction) -> str:
    """The robot's own URDF with the reduced joint in it.

    Without play in a gear only the joint's <dynamics> change. With it, the joint moves a link that
    is the motor's rotor, which moves the old child by `J_play`, whose limits are the dead band.
    """
    root = ElementTree.fromstring(mechanism.description.text)
    joint = next(j for j in root.findall("joint") if j.get("name") == reduction.joint)
    for old in joint.findall("dynamics"):
        joint.remove(old)
    ElementTree.SubElement(
        joint,
        "dynamics",
        friction=f"{reduction.friction:.17g}",
        damping=f"{reduction.viscous:.17g}",
    )
    if reduction.dead_band > 0.0:
        names = {one.get("name") for one in (*root.findall("joint"), *root.findall("link"))}
        motor, between = f"{reduction.joint}_motor", f"{reduction.joint}_play"
        for name in (motor, between):
            if name in names:
                raise JointplayError(f"the URDF already has a {name!r}")
        child = joint.find("child")
        written = joint.find("axis")
        assert child is not None
        axis = "1 0 0" if written is None else written.get("xyz", "1 0 0")
        link = ElementTree.SubElement(root, "link", name=motor)
        inertial = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(inertial, "mass", value="1e-06")
        vector = np.array([float(x) for x in axis.split()])
        matrix = _rotor(vector / np.linalg.norm(vector), reduction.rotor_inertia)
        ElementTree.SubElement(
            inertial,
            "inertia",
            {
                f"i{a}{b}": f"{matrix['xyz'.index(a), 'xyz'.index(b)]:.17g}"
                for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
            },
        )
        play = ElementTree.SubElement(root, "joint", name=between, type="revolute")
        ElementTree.SubElement(play, "parent", link=motor)
        ElementTree.SubElement(play, "child", link=child.get("link", ""))
        ElementTree.SubElement(play, "axis", xyz=axis)
        half = f"{0.5 * reduction.dead_band:.17g}"
        ElementTree.SubElement(
            play, "limit", lower=f"-{half}", upper=half, effort="0", velocity="100"
        )
        ElementTree.SubElement(play, "dynamics", damping=f"{reduction.damping:.17g}", friction="0")
        child.set("link", motor)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


def to_yaml(reduction: Reduction, encoder: str = "motor") -> str:
    """What a URDF cannot say, for a node to read: flat YAML, SI units."""
    data = parameters(reduction, encoder)
    lines = ["# Reduced model of a joint with play; SI units. See docs/decisions.md of jointplay."]
    for key, value in data.items():
        if isinstance(value, dict):
            lines.append(f"{key}:")
            lines += [f"  {name}: {json.dumps(one)}" for name, one in value.items()]
        else:
            lines.append(f"{key}: {json.dumps(value)}")
    return "\n".join(lines) + "\n"


def to_json(reduction: Reduction, encoder: str = "motor", spread: float = SPREAD) -> str:
    """All parameters with ranges for domain randomisation, as JSON.

    Args:
        reduction: the joint.
        encoder: ``motor`` (before the play) or ``link`` (after).
        spread: half width of the ranges of what is not measured, relative; an assumption. The
            friction's range is that of the full model's run.
    """
    require_non_negative("spread", spread, "")
    data = parameters(reduction, encoder)
    ranges: dict[str, Any] = {}
    for name in ("dead_band", "stiffness", "damping", "viscous", "tilt", "lateral", "axial"):
        value = getattr(reduction, name)
        if value > 0.0:
            ranges[name] = [value * max(1.0 - spread, 0.0), value * (1.0 + spread)]
    if reduction.friction > 0.0:
        low, high = reduction.friction_range
        ranges["friction"] = [min(low, reduction.friction), max(high, reduction.friction)]
    data["ranges"] = ranges
    data["ranges_note"] = (
        f"friction: 5 % to 95 % of the full model's run; all others: +-{100 * spread:g} %, assumed"
    )
    return json.dumps(data, indent=2) + "\n"


def parameters(reduction: Reduction, encoder: str) -> dict[str, Any]:
    """The reduction and where the encoder sits, as plain data.

    Raises:
        MissingName: no such place for an encoder.
    """
    if encoder not in ENCODERS:
        raise MissingName("place for the encoder", encoder, ENCODERS)
    return {**reduction.describe(), "encoder": encoder}


def _rotor(axis: np.ndarray, inertia: float) -> np.ndarray:
    """Inertia of a rotor about its axis, and a little more than half of it across, (3, 3)."""
    along = np.outer(axis, axis)
    return np.asarray(inertia * along + 0.5001 * inertia * (np.eye(3) - along))


def _texts(element: ElementTree.Element, /, **values: str) -> None:
    for tag, text in values.items():
        ElementTree.SubElement(element, tag).text = text


def _numbers(values: Any) -> str:
    return " ".join(f"{x + 0.0:.17g}" for x in np.ravel(values))
