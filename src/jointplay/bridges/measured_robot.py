"""Files of a measured robot: its URDF or MJCF with identified play, or with calibrated joints."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.tables import counted, few
from jointplay.bridges.edited_mjcf import corrected_mjcf
from jointplay.bridges.reduced_robot import ReducedRobot, refuse_without_play
from jointplay.bridges.reduction import from_mjcf_file, reduce_all
from jointplay.bridges.urdf import to_urdf
from jointplay.estimate.pose_problem import CONSTANT
from jointplay.model.mechanism import Mechanism
from jointplay.model.meshes import write_meshes

if TYPE_CHECKING:
    from jointplay.estimate import Calibration


def write_play_urdf(mechanism: Mechanism, path: Path) -> str:
    """Write a URDF with bearings' clearance as chains of joints; returns a clause on what it lacks.

    Raises:
        JointplayError: no bearing has clearance.
    """
    if not mechanism.clearance:
        raise JointplayError(
            "--urdf: no bearing has clearance, and a URDF cannot say a gear's play: --mjcf and "
            "--write-preset can"
        )
    files.write(path, to_urdf(mechanism.with_clearance(mechanism.clearance, {})))
    gears = few(list(mechanism.gears))
    return f"; not in it: play of gears ({gears})" if gears else ""


def write_play_mjcf(mechanism: Mechanism, path: Path, progress: bool = False) -> str:
    """Write an MJCF with play as dead bands and tilts, and its meshes; returns a clause on what it
    has and lacks.

    Raises:
        JointplayError: the MJCF would have no play.
    """
    tilt = bool(mechanism.clearance) and not from_mjcf_file(mechanism.description)
    refuse_without_play(mechanism, [*mechanism.clearance, *mechanism.gears], ["mjcf"], tilt)
    reductions, refused = reduce_all(mechanism, progress=progress)
    robot = ReducedRobot(mechanism, reductions, {}, ["mjcf"], tilt)
    (text,) = robot.files(path.stem).values()
    files.write(path, text)
    write_meshes(path.parent, robot.meshes)
    lacks = f"; not in it: {'; '.join(refused.values())}" if refused else ""
    return f": play of {few([reduction.joint for reduction in reductions])}{lacks}"


def write_corrected(fit: Calibration, path: Path, mjcf: bool) -> str:
    """Write a URDF or MJCF with joints where a calibration found them; returns a clause on what it
    has and lacks.

    Raises:
        JointplayError: the calibration corrected no joint.
    """
    corrections = fit.corrections()
    if not corrections:
        raise JointplayError(
            "no joint to correct: neither offset nor placement was kept (--always offset has the "
            "offset in every model)"
        )
    if mjcf:
        text, meshes = corrected_mjcf(fit.mechanism, corrections)
        files.write(path, text)
        write_meshes(path.parent, meshes)
    else:
        files.write(path, to_urdf(fit.mechanism.ideal(), corrections))
    varying = [str(term) for term in fit.kept if term.kind not in CONSTANT]
    lacks = f"; not in it, as they vary with pose or load: {', '.join(varying)}" if varying else ""
    return f": {counted(len(corrections), 'joint')} corrected{lacks}"
