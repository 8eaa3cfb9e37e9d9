"""Quantities of a run by name, such as ``guide.acceleration`` or ``crank_pin.moment``."""

from __future__ import annotations

import numpy as np

from jointplay.base.errors import JointplayError, require_known
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.result.result import AXES, Result

TOOL = "tool"
_OF_TOOL = dict.fromkeys(AXES, "m") | {"speed": "m/s", "acceleration": "m/s²"}
_OF_JOURNALS = dict.fromkeys(AXES, "m") | {"eccentricity": "m", "force": "N"}
_OF_JOINTS = ("position", "speed", "acceleration", "moment")
"""Quantities of the tool, journals and joints, with units where the kind of joint decides none."""


def names(mechanism: Mechanism) -> list[str]:
    """Names of all quantities of a mechanism: ``JOINT.QUANTITY`` or ``tool.QUANTITY``."""
    observables = [
        f"{joint}.{quantity}" for joint in mechanism.clearance for quantity in _OF_JOURNALS
    ]
    observables += [f"{joint}.{quantity}" for joint in mechanism.joints for quantity in _OF_JOINTS]
    return [*observables, *(f"{TOOL}.{quantity}" for quantity in _OF_TOOL)]


def check(name: str, mechanism: Mechanism) -> None:
    """Raise an error if a name is not that of exactly one quantity.

    Raises:
        MissingName: there is no such quantity.
        JointplayError: it could be of the tool or of a joint named like it.
    """
    quantities = names(mechanism)
    require_known("quantity", name, quantities)
    if quantities.count(name) > 1:
        raise JointplayError(
            f"{name!r} is a quantity of the tool and of the joint {TOOL!r}; rename the joint"
        )


def unit(name: str, mechanism: Mechanism) -> str:
    """Unit of a quantity of `names`."""
    subject, _, quantity = name.rpartition(".")
    if subject == TOOL and quantity in _OF_TOOL:
        return _OF_TOOL[quantity]
    if quantity in _OF_JOURNALS and subject in mechanism.clearance:
        return _OF_JOURNALS[quantity]
    slides = mechanism.description.joints[subject].slides
    base = "m" if slides else "rad"
    moment = "N" if slides else "N m"
    return dict(zip(_OF_JOINTS, (base, f"{base}/s", f"{base}/s²", moment), strict=True))[quantity]


def label(name: str, mechanism: Mechanism) -> str:
    """Label of a quantity on an axis of a figure."""
    subject, _, quantity = name.rpartition(".")
    return f"{quantity} of {subject} [{unit(name, mechanism)}]"


def usual(mechanism: Mechanism) -> str:
    """Default quantity: the acceleration of the only slider in a mechanism with loops, else the
    eccentricity of the first journal, else the tool's speed.
    """
    sliders = [name for name in mechanism.joints if mechanism.description.joints[name].slides]
    if len(sliders) == 1 and mechanism.loops:
        return f"{sliders[0]}.acceleration"
    if mechanism.clearance:
        return f"{next(iter(mechanism.clearance))}.eccentricity"
    return "tool.speed"


def observe(result: Result, name: str) -> np.ndarray:
    """History of a quantity in a run, shape (n,); for its unit see `unit`.

    ``JOINT.x``, ``y``, ``z`` and ``eccentricity`` are those of the journal's centre in its bearing,
    ``JOINT.force`` is the magnitude of the joint's force; ``position``, ``speed``, ``acceleration``
    and ``moment`` (the drive's moment or force) are those of a moving joint; ``tool.x`` and so on
    are the tool's position, ``tool.speed`` and ``tool.acceleration`` magnitudes. An acceleration is
    the central difference of recorded speeds, and so a mean over two record intervals.

    Raises:
        MissingName: no such quantity.
        JointplayError: it could be of the tool or of a joint named like it.
    """
    mechanism = result.simulation.mechanism
    check(name, mechanism)
    subject, _, quantity = name.rpartition(".")
    if subject == TOOL and quantity in _OF_TOOL:
        if quantity in AXES:
            return np.asarray(result["tool_position"].values[:, AXES.index(quantity)])
        velocity = result["tool_velocity"].values
        if quantity == "acceleration":
            velocity = np.gradient(velocity, result.time, axis=0, edge_order=2)
        return np.asarray(np.linalg.norm(velocity, axis=1))
    if quantity in _OF_JOURNALS and subject in result.joints:
        index = result.joints.index(subject)
        if quantity == "force":
            return np.asarray(np.linalg.norm(result["joint_force"].values[:, index], axis=1))
        centre = result["journal_centre"].values[:, index]
        if quantity == "eccentricity":
            return np.asarray(np.hypot(*centre[:, :2].T))
        return np.asarray(centre[:, AXES.index(quantity)])
    column = mechanism.coordinate(subject)
    if quantity == "moment":
        return np.asarray(result["drive"].values[:, mechanism.motor(subject)])
    history = np.asarray(result["q" if quantity == "position" else "v"].values[:, column])
    if quantity == "acceleration":
        history = np.gradient(history, result.time, edge_order=2)
    return history
