"""Joint trajectories with the URDF's joint names, as robots' controllers take them.

A joint with clearance has up to six coordinates; its encoder reads the one that the ideal joint
would have, which has the joint's name here. Ball joints have no such coordinate and are left out,
as are motors before gears.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from jointplay import bridges
from jointplay.base.errors import JointplayError
from jointplay.base.imports import extra
from jointplay.model.free_base import BASE, FREE
from jointplay.physics.joints import MOTOR, Coordinate, class_of
from jointplay.simulation.analysis.twins import inputs
from jointplay.simulation.motion.reference import Motion, motion_csv
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.stored import stored_coordinates

POINT_S = 0.01
"""Interval between the points of a motion that is written [s]."""
MESSAGE = "trajectory_msgs/msg/JointTrajectory"
"""ROS 2 type of the message."""
_NANO = 1_000_000_000
_BLOCK = 500
"""Points written between updates of the progress bar."""


@dataclass(frozen=True)
class Trajectory:
    """Motion of the joints, by record."""

    time: np.ndarray
    """Times (n,) [s]."""
    joints: tuple[str, ...]
    position: np.ndarray
    """Positions (n, joints) [rad, or m for prismatic joints]."""
    velocity: np.ndarray
    """Velocities (n, joints) [rad/s or m/s]."""
    effort: np.ndarray
    """Efforts of the drives (n, joints) [N m or N]; (n, 0) if unknown."""


def encoders(result: Result) -> dict[str, int]:
    """Joints that have a single coordinate, each with its index in q; ball joints have none."""
    description = inputs(result)["mechanism"]
    coordinates, free_base = stored_coordinates(description), description.get("base") == FREE
    indices: dict[str, int] = {}
    for index, name in enumerate(result["coordinate"].values.tolist()):
        coordinate = coordinates.get(name, Coordinate(name))
        joint, part = coordinate.joint, coordinate.part
        if part == MOTOR or (free_base and joint == BASE):
            continue
        kind = class_of(description["clearance"][joint]) if part else None
        if kind is None or kind.ideal_freedoms == (part,):
            indices[joint] = index
    return indices


def joint_trajectory(result: Result) -> Trajectory:
    """Positions, velocities and drive efforts of a result's joints, as their encoders read them."""
    indices = encoders(result)
    if not indices:
        raise JointplayError("no joint of this result has one coordinate: there is no trajectory")
    columns = list(indices.values())
    position, velocity, effort = (result[name].values[:, columns] for name in ("q", "v", "drive"))
    return Trajectory(result.time, tuple(indices), position, velocity, effort)


def stamp(time: float) -> dict[str, int]:
    """A time [s] as ROS has it: seconds and nanoseconds, rounded to these."""
    seconds, nanoseconds = divmod(round(float(time) * _NANO), _NANO)
    return {"sec": seconds, "nanosec": nanoseconds}


def message(motion: Trajectory) -> dict[str, Any]:
    """A ROS 2 ``trajectory_msgs/msg/JointTrajectory`` as plain data."""
    rows = zip(motion.time, motion.position, motion.velocity, motion.effort, strict=True)
    return {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "joint_names": list(motion.joints),
        "points": [
            {
                "positions": position.tolist(),
                "velocities": velocity.tolist(),
                "accelerations": [],
                "effort": effort.tolist(),
                "time_from_start": stamp(time),
            }
            for time, position, velocity, effort in rows
        ],
    }


def of_motion(motion: Motion) -> Trajectory:
    """Trajectory of a reference motion at points `POINT_S` apart, without efforts."""
    count = max(round((motion.duration - motion.times[0]) / POINT_S), 1) + 1
    time = np.linspace(float(motion.times[0]), motion.duration, count)
    position, velocity, _ = motion(time)
    return Trajectory(time, motion.joints, position, velocity, np.zeros((count, 0)))


def trajectory(result: Result, suffix: str, progress: bool) -> bytes:
    """YAML as ``ros2 topic pub`` takes it, or a CSV file that `Motion.from_csv` reads."""
    return content(joint_trajectory(result), suffix, progress)


def content(motion: Trajectory, suffix: str, progress: bool = False) -> bytes:
    """Content of a file with any trajectory, YAML or CSV by its suffix.

    Raises:
        JointplayError: a library of the extra ``ros`` is missing.
    """
    if suffix == ".csv":
        return motion_csv(motion.joints, motion.time, motion.position, "spline").encode()
    with extra("ros", "PyYAML"):
        import yaml
    dumper = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
    options = {"sort_keys": False, "default_flow_style": None, "width": 10_000}
    document = message(motion)
    points = document.pop("points")
    parts = [yaml.dump(document, Dumper=dumper, **options), "points:\n"]
    for block in bridges.in_blocks(len(points), _BLOCK, "points", progress):
        parts.append(yaml.dump(points[block], Dumper=dumper, **options))
    return "".join(parts).encode()
