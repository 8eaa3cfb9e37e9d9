"""Motions from ROS bags: MCAP files with JointTrajectory or JointState messages.

Read by the library ``mcap-ros2-support``, which runs nothing that a file says.
"""

from __future__ import annotations

import io
import re
import zlib
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, redirect_stderr
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.imports import extra

_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
STATE = "sensor_msgs/msg/JointState"

MOST_BYTES = 1 << 32
"""Largest bag that is read [bytes]."""


_TIME = "int32 sec\nuint32 nanosec"
_VECTOR = "float64 x\nfloat64 y\nfloat64 z"
_PARTS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
    "builtin_interfaces/Time": _TIME,
    "builtin_interfaces/Duration": _TIME,
    "geometry_msgs/Vector3": _VECTOR,
    "geometry_msgs/Point": _VECTOR,
    "geometry_msgs/Quaternion": f"{_VECTOR}\nfloat64 w",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\n"
    "geometry_msgs/Quaternion rotation",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque",
    "trajectory_msgs/JointTrajectoryPoint": "float64[] positions\nfloat64[] velocities\n"
    "float64[] accelerations\nfloat64[] effort\nbuiltin_interfaces/Duration time_from_start",
}
"""Definitions of the messages' parts, from ROS 2's common_interfaces."""
_MESSAGES = {
    STATE: "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort",
    _TRAJECTORY: "string[] joint_names\ntrajectory_msgs/JointTrajectoryPoint[] points",
    "geometry_msgs/msg/PoseStamped": "geometry_msgs/Pose pose",
    "geometry_msgs/msg/TwistStamped": "geometry_msgs/Twist twist",
    "geometry_msgs/msg/Vector3Stamped": "geometry_msgs/Vector3 vector",
    "geometry_msgs/msg/PointStamped": "geometry_msgs/Point point",
    "geometry_msgs/msg/TransformStamped": "string child_frame_id\n"
    "geometry_msgs/Transform transform",
    "geometry_msgs/msg/WrenchStamped": "geometry_msgs/Wrench wrench",
}
"""Definitions of the messages, the header they all begin with left out."""


def definition(kind: str) -> str:
    """Definition of a message with those of all its parts, in MCAP's format."""
    definitions = {"": f"std_msgs/Header header\n{_MESSAGES[kind]}"}
    waiting = list(definitions.values())
    while waiting:
        for part in re.findall(r"^(\w+/\w+)", waiting.pop(), re.MULTILINE):
            if part not in definitions:
                definitions[part] = _PARTS[part]
                waiting.append(_PARTS[part])
    rule = "=" * 80
    return "".join(f"{rule}\nMSG: {n}\n{t}\n" if n else f"{t}\n" for n, t in definitions.items())


def _blocks(text: str) -> dict[str, list[str]]:
    """Fields of a message and of its parts, by their names, without comments and spacing."""
    name, blocks = "", {"": []}  # type: tuple[str, dict[str, list[str]]]
    for line in text.splitlines():
        field = " ".join(line.partition("#")[0].split())
        if field.startswith("MSG:"):
            name = field[4:].strip().replace("/msg/", "/")
            blocks[name] = []
        elif field and set(field) != {"="}:
            blocks[name].append(field.replace("/msg/", "/"))
    return blocks


def read(path: str | Path, topic: str | None = None) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Read joint positions from a bag; the arguments are those of `Motion.from_mcap`.

    Returns:
        Joints; times (n,) [s], for joint states from the first message's stamp on; positions (n,
        joints) [rad or m]. Of several trajectories in a topic the last one counts.

    Raises:
        JointplayError: no such file or topic, several to choose from, no bag, or messages that make
            no motion.
    """
    path = Path(path)
    with opened(path) as bag:
        kind, chosen = _choose(bag.topics, path, topic)
        messages = [message[3] for message in bag.decoded([chosen])]
        where = f"{path}, topic {chosen}"
        if not messages:
            raise JointplayError(f"{where}: there is no message")
        return _points(messages[-1], where) if kind == _TRAJECTORY else _states(messages, where)


@dataclass(frozen=True)
class Bag:
    """An open bag."""

    reader: Any
    topics: dict[str, str]
    """Kind of the messages of each topic, such as ``sensor_msgs/msg/JointState``."""
    messages: dict[str, int]
    """Number of messages of each topic, as far as the bag's statistics have it."""

    def decoded(self, topics: list[str]) -> Iterator[Any]:
        """Schema, channel, record and decoded content of each message of some topics, by time.

        Raises:
            JointplayError: they are not as many as the bag says.
        """
        counts = dict.fromkeys(topics, 0)
        for message in self.reader.iter_decoded_messages(topics):
            counts[message[1].topic] += 1
            yield message
        for topic, number in counts.items():
            if topic in self.messages and number != self.messages[topic]:
                raise JointplayError(
                    f"the bag is damaged: of topic {topic} there are {number} messages, and "
                    f"{self.messages[topic]} by its statistics"
                )


@contextmanager
def opened(path: Path) -> Iterator[Bag]:
    """Open a bag; whatever its libraries raise in the block becomes one kind of error.

    Raises:
        JointplayError: no such file, no bag, a bag without summary, a missing library.
    """
    with extra("ros", "mcap-ros2-support"):
        from mcap.reader import make_reader
        from mcap_ros2.decoder import DecoderFactory
    files.require_file(path, "bag")
    try:
        files.check_plain(path, MOST_BYTES)
        with path.open("rb") as file, redirect_stderr(io.StringIO()):  # which the parser prints to
            reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
            summary = reader.get_summary()
            if summary is None:
                raise JointplayError(
                    f"the bag {str(path)!r} has no summary; `mcap recover` creates one"
                )
            if not _is_sealed(file):
                _check_schemas(summary.schemas.values())
            kinds = {
                channel.topic: summary.schemas[channel.schema_id].name
                for channel in summary.channels.values()
                if channel.schema_id in summary.schemas
            }
            numbers: dict[str, int] = {}
            if summary.statistics:
                counts = summary.statistics.channel_message_counts
                for number, channel in summary.channels.items():  # a topic can have several
                    numbers[channel.topic] = numbers.get(channel.topic, 0) + counts.get(number, 0)
            yield Bag(reader, kinds, numbers)
    except JointplayError:
        raise
    except Exception as error:  # noqa: BLE001 - its libraries raise whatever they stumble over
        reason = " ".join(str(error).split()) or type(error).__name__
        raise JointplayError(f"cannot read the bag {str(path)!r}: {reason}") from None


_FOOTER = 8 + 8 + 4
"""Bytes in the last record of an MCAP file: positions of the summary and its index, checksum."""
_ENDING = _FOOTER + 8
"""Bytes of that record and of the mark that ends the file."""


def _is_sealed(file: BinaryIO) -> bool:
    """Whether the summary (topics, types, counts, positions of the blocks) has a checksum.

    One that does not match is refused here, for the library mcap checks the blocks only. It is of
    all from the summary's begin up to its own position; 0 means that there is none.
    """
    end = file.seek(-_ENDING, io.SEEK_END)
    footer = file.read(_FOOTER)
    checksum = int.from_bytes(footer[16:], "little")
    begin = int.from_bytes(footer[:8], "little")
    if not checksum or not begin:
        return False
    file.seek(begin)
    if zlib.crc32(file.read(end + 16 - begin)) != checksum:
        raise JointplayError("the bag is damaged: its summary does not match its checksum")
    return True


def _check_schemas(schemas: Iterable[Any]) -> None:
    """Refuse changed definitions of ROS's own messages, for these say what the numbers mean."""
    for schema in schemas:
        if schema.encoding != "ros2msg" or schema.name not in _MESSAGES:
            continue
        if _blocks(schema.data.decode(errors="replace")) != _blocks(definition(schema.name)):
            raise JointplayError(
                f"the bag is damaged: it has no checksum, and its definition of {schema.name} is "
                "not that of ROS 2"
            )


def _choose(topics: Mapping[str, str], path: Path, topic: str | None) -> tuple[str, str]:
    """Message type and name of the topic to read."""
    fit = {name: kind for name, kind in topics.items() if kind in (_TRAJECTORY, STATE)}
    if topic is not None:
        require_known("topic of joint positions", topic, fit)
        return fit[topic], topic
    for kind in (_TRAJECTORY, STATE):
        named = [name for name, its_kind in fit.items() if its_kind == kind]
        if len(named) > 1:
            raise JointplayError(f"{path}: name one of the topics {', '.join(named)}")
        if named:
            return kind, named[0]
    held = ", ".join(sorted(set(topics.values()))) or "nothing"
    raise JointplayError(f"{path}: neither a JointTrajectory nor a JointState; it holds {held}")


def _points(message: Any, where: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Joints, times (n,) from its start [s] and positions (n, joints) of a JointTrajectory."""
    joints, points = list(message.joint_names), message.points
    for number, point in enumerate(points, 1):
        if len(point.positions) != len(joints):
            raise JointplayError(
                f"{where}: point {number} has {len(point.positions)} positions for "
                f"{len(joints)} joints"
            )
    starts = [point.time_from_start for point in points]
    times = np.array([float(start.sec) + 1e-9 * float(start.nanosec) for start in starts])
    positions = np.array([list(point.positions) for point in points], float)
    return joints, times, positions.reshape(len(points), len(joints))


def _states(messages: Iterable[Any], where: str) -> tuple[list[str], np.ndarray, np.ndarray]:
    """Joints, times and positions of JointState messages, of the joints that all of them name."""
    rows = []
    for number, state in enumerate(messages, 1):
        if len(state.position) != len(state.name):
            raise JointplayError(
                f"{where}: message {number} has {len(state.position)} positions for "
                f"{len(state.name)} joints"
            )
        rows.append((state.header.stamp, dict(zip(state.name, state.position, strict=True))))
    joints = [name for name in rows[0][1] if all(name in row for _, row in rows)]
    if not joints:
        raise JointplayError(f"{where}: no joint is in all messages")
    first = rows[0][0]
    times = np.array(
        [(s.sec - first.sec) + 1e-9 * (s.nanosec - first.nanosec) for s, _ in rows], float
    )
    return joints, times, np.array([[row[name] for name in joints] for _, row in rows], float)
