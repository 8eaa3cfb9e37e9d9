"""A robot with play as a PROTO of Webots, converted by urdf2webots from the URDF with play.

That converter gives every hinge a motor, with the hinge's limits. Hinges of play are made passive
here, with stops, as in Webots' own HingeJointWithBacklash, whose gear has no inertia.
"""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from collections.abc import Iterable
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pinocchio as pin

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.imports import extra
from jointplay.bridges.reduced_files import check_encoder, to_urdf
from jointplay.bridges.reduced_mjcf import take_meshes
from jointplay.bridges.reduction import Reduction
from jointplay.model.elements import Element, moments
from jointplay.model.mechanism import Mechanism
from jointplay.model.meshes import FOLDER

NAME = "Robot"
"""Provisional name of the PROTO; Webots requires the name of its file."""


def to_proto(
    mechanism: Mechanism, reductions: Iterable[Reduction], encoder: str = "motor"
) -> tuple[str, dict[str, bytes]]:
    """The robot as a PROTO, and its meshes by file name, for `FOLDER`.

    Each joint J has a RotationalMotor `J` and a PositionSensor `J_sensor`. With encoders on the
    link there is also a `J_play_sensor`; the sum of both is the link's angle.

    Raises:
        MissingName: no such place for an encoder.
        JointplayError: urdf2webots is missing, fails, or leaves a joint out.
    """
    check_encoder(encoder)
    with extra("simulators", "urdf2webots"):
        from urdf2webots.importer import convertUrdfContent
    reductions = list(reductions)
    root = ElementTree.fromstring(to_urdf(mechanism, *reductions))
    meshes, _ = take_meshes(mechanism, root)
    for mesh in root.iter("mesh"):
        mesh.set("filename", f"{FOLDER}/{mesh.get('filename')}")
    for inertial in root.iter("inertial"):
        _turn_upright(inertial)
    urdf, log = ElementTree.tostring(root, encoding="unicode"), StringIO()
    with files.temporary() as folder, redirect_stdout(log), redirect_stderr(log):
        path = Path(folder) / f"{NAME}.proto"
        try:
            convertUrdfContent(urdf, output=str(path), relativePathPrefix=folder, normal=True)
        except (SystemExit, Exception) as error:  # it may call exit, or fail in any way
            reason = " ".join(str(error).split())
            raise JointplayError(f"urdf2webots cannot convert the robot: {reason}") from error
        text = path.read_text()
    missing = [name for name in mechanism.joints if f'name "{name}_sensor"' not in text]
    if missing:
        raise JointplayError(
            f"urdf2webots leaves out {', '.join(missing)}: it takes out links without mass"
        )
    for reduction in reductions:
        if reduction.dead_band > 0.0:
            text = _passive(text, reduction, encoder == "link")
    return text, meshes


def _turn_upright(inertial: Element) -> None:
    """Express a link's moments of inertia in its own axes, as urdf2webots turns them wrongly."""
    origin, inertia = inertial.find("origin"), inertial.find("inertia")
    if origin is None or inertia is None or "rpy" not in origin.attrib:
        return
    turn = pin.rpy.rpyToMatrix(np.array(origin.attrib.pop("rpy").split(), float))
    xx, xy, xz, yy, yz, zz = (
        float(inertia.get(key, 0.0)) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    for key, value in moments(turn @ matrix @ turn.T).items():
        inertia.set(key, f"{value:.17g}")


def _passive(text: str, reduction: Reduction, sensor: bool) -> str:
    """The PROTO with stops in place of the motor in the hinge of a joint's play."""
    play, half = f"{reduction.joint}_play", 0.5 * reduction.dead_band
    motor = text.find(f'name "{play}"\n')
    if motor < 0:
        raise JointplayError(f"urdf2webots leaves out {play}, the play of {reduction.joint}")
    opening = "HingeJointParameters {\n"
    stops = text.rindex(opening, 0, motor) + len(opening)
    device = text.rindex("device [", 0, motor)
    end = text.index("]\n", motor) + 2
    device_text = f'device [ PositionSensor {{ name "{play}_sensor" }} ]\n' if sensor else "\n"
    limits = f"minStop {-half:.9g}\nmaxStop {half:.9g}\n"
    return text[:stops] + limits + text[stops:device] + device_text + text[end:]
