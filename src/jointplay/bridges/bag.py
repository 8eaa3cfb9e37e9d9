"""Results as ROS 2 bags: MCAP files, which PlotJuggler, Foxglove and ``ros2 bag`` read.

Topics: ``/joint_states``, ``/joint_trajectory`` (one message), ``/tool_pose`` and ``/tool_twist``,
and for each joint with clearance ``/clearance/<joint>/force`` and ``.../journal_centre``. Time
begins at zero. Written by the library ``mcap-ros2-support``.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from jointplay.base.imports import extra
from jointplay.base.progress import ProgressBar
from jointplay.bridges import trajectory
from jointplay.simulation.motion.rosbag import definition
from jointplay.simulation.result.result import AXES, Result

Message = tuple[str, str, float, dict[str, Any]]
"""Topic, kind, time [s] and content."""
_STATE = ("position", "velocity", "effort")


def mcap(result: Result, suffix: str, progress: bool) -> bytes:
    """Content of a bag with a result."""
    return written(_messages(result), progress)


def of_trajectory(motion: trajectory.Trajectory) -> bytes:
    """Content of a bag with one message, a trajectory, which `Motion.from_mcap` reads."""
    return written([("/joint_trajectory", trajectory.MESSAGE, 0.0, trajectory.message(motion))])


def written(messages: Iterable[Message], progress: bool = False) -> bytes:
    """Content of a bag with these messages, which are ordered by time."""
    with extra("ros", "mcap-ros2-support"):
        from mcap_ros2.writer import Writer
    sink = io.BytesIO()
    schemas: dict[str, Any] = {}
    with Writer(sink) as writer:
        steps = ProgressBar(messages, "bag", disable=not progress, unit="message")
        for topic, kind, time, content in steps:
            if kind not in schemas:
                schemas[kind] = writer.register_msgdef(kind, definition(kind))
            nano = round(time * 1_000_000_000)
            writer.write_message(topic, schemas[kind], content, nano, nano)
    return sink.getvalue()


def _messages(result: Result) -> Iterator[Message]:
    """Yield all messages of a result, ordered by time."""
    topics = _topics(result)
    motion = trajectory.joint_trajectory(result) if trajectory.encoders(result) else None
    names = list(motion.joints) if motion is not None else []
    if motion is not None:
        yield "/joint_trajectory", trajectory.MESSAGE, 0.0, trajectory.message(motion)
    for i, time in enumerate(result.time.tolist()):
        if motion is not None:
            state = {key: getattr(motion, key)[i].tolist() for key in _STATE}
            content = {"header": _header(time, ""), "name": names} | state
            yield "/joint_states", "sensor_msgs/msg/JointState", time, content
        for topic, kind, frame, key, values in topics:
            yield topic, kind, time, {"header": _header(time, frame), key: _nested(values, i)}


def _topics(result: Result) -> list[tuple[str, str, str, str, Any]]:
    """Topic, type, frame and field of the stamped messages, and the field's values by record."""
    pose = {
        "position": _vector(result["tool_position"].values),
        "orientation": _vector(result["tool_orientation"].values, "wxyz"),
    }
    twist = {
        "linear": _vector(result["tool_velocity"].values),
        "angular": _vector(result["tool_angular_velocity"].values),
    }
    topics: list[tuple[str, str, str, str, Any]] = [
        ("/tool_pose", "geometry_msgs/msg/PoseStamped", "world", "pose", pose),
        ("/tool_twist", "geometry_msgs/msg/TwistStamped", "world", "twist", twist),
    ]
    kind = "geometry_msgs/msg/Vector3Stamped"
    for joint in result.joints:
        prefix = f"/clearance/{re.sub(r'[^A-Za-z0-9_]', '_', joint)}"
        force = _vector(result["joint_force"].sel(joint=joint).values)
        centre = _vector(result["journal_centre"].sel(joint=joint).values)
        topics.append((f"{prefix}/force", kind, "world", "vector", force))
        topics.append((f"{prefix}/journal_centre", kind, f"{joint}_bearing", "vector", centre))
    return topics


def _vector(values: np.ndarray, names: tuple[str, ...] | str = AXES) -> dict[str, list[float]]:
    """Columns of an array (n, k) by name."""
    return {name: values[:, k].tolist() for k, name in enumerate(names)}


def _nested(values: dict[str, Any], i: int) -> dict[str, Any]:
    """The i-th record of nested columns."""
    return {
        name: _nested(inner, i) if isinstance(inner, dict) else inner[i]
        for name, inner in values.items()
    }


def _header(time: float, frame: str) -> dict[str, Any]:
    return {"stamp": trajectory.stamp(time), "frame_id": frame}
