"""Measurements out of recordings: ROS 2 bags (MCAP) and LeRobot datasets.

Neither says which of its signals is which of a mechanism's, and a LeRobot dataset has no units:
`Recording` states both, and nothing is guessed. Signals keep the times of their own records; that
their instruments' clocks agree is not assumed.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, MissingName, require_a
from jointplay.base.imports import extra
from jointplay.base.progress import ProgressBar
from jointplay.simulation.motion import rosbag

if TYPE_CHECKING:
    from jointplay.estimate.measurement import Key, Measurement

_NANO = 1_000_000_000
_JOINT_FIELDS = {"motor": "position", "link": "position", "torque": "effort"}
"""Field of a JointState by kind of signal."""
_VECTORS = {
    "tool": {
        "geometry_msgs/msg/PoseStamped": "pose.position",
        "geometry_msgs/msg/PointStamped": "point",
        "geometry_msgs/msg/TransformStamped": "transform.translation",
    },
    "force": {
        "geometry_msgs/msg/WrenchStamped": "wrench.force",
        "geometry_msgs/msg/Vector3Stamped": "vector",
    },
    "acceleration": {
        "sensor_msgs/msg/Imu": "linear_acceleration",
        "geometry_msgs/msg/AccelStamped": "accel.linear",
        "geometry_msgs/msg/Vector3Stamped": "vector",
    },
    "reaction": {
        "geometry_msgs/msg/WrenchStamped": "wrench.force",
        "geometry_msgs/msg/Vector3Stamped": "vector",
    },
}
"""Vectors with x, y and z in messages: their fields by kind of signal and of message."""
_KINDS = (*_JOINT_FIELDS, *_VECTORS)
_IN_WORLD_AXES = ("tool", "force")
"""Kinds of signal whose directions count; of accelerations and reactions only sizes do."""
_INPUTS = ("motor", "link", "force")
"""Kinds of signal that must be known at the times of the others."""
_SUFFIXES = {"motor": ("pos", "position"), "link": ("pos", "position"), "torque": ("effort",)}
"""What LeRobot puts behind the name of a motor, by kind of signal."""
_EXAMPLES = {
    "motor": "deg", "link": "deg", "torque": "N*m", "tool": "mm", "force": "N",
    "acceleration": "m/s^2", "reaction": "N",
}  # fmt: skip
"""Units by kind of signal, for messages."""
_MAP = re.compile(r"(?:([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*\*\s*|(-)\s*)?(\S+)(?:\s+([-+])\s*(\S.*))?")
"""FACTOR * NAME + OFFSET: factor, sign, name, sign of the offset, offset."""
_LFS = b"version https://git-lfs"
"""How the text begins that Git puts in the place of a large file."""
_LAYOUTS = {
    2: "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    3: "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}
"""Where the episodes of a LeRobot dataset are, by the first number of its format."""


@dataclass(frozen=True)
class _Source:
    """What a signal is read from."""

    kind: str
    """Of the signal, one of `_KINDS`."""
    joint: str
    """The only joint that it is read for, or empty."""
    name: str
    """Topic of a bag, or feature of a dataset."""
    unit: str
    """Of the feature; empty for a topic."""


@dataclass(frozen=True)
class _Map:
    """A joint or axis as ``factor * name + offset`` of what was recorded."""

    factor: float
    name: str
    offset: str
    """With its unit; empty for none."""


@dataclass(frozen=True)
class _Series:
    """n records of one topic or feature."""

    time: np.ndarray
    """Shape (n,), integers [ns]."""
    values: Mapping[str, np.ndarray]
    """By the recorded name, shape (n,); nan where nothing was recorded."""


@dataclass(frozen=True)
class Recording:
    """A ROS 2 bag or a LeRobot dataset, and which signals are taken from it.

    Raises:
        JointplayError: it is neither; a source or map that cannot be understood.
    """

    path: str | Path
    """A bag (.mcap, or the folder that ``ros2 bag`` makes), or the folder of a dataset."""
    sources: Mapping[str, str]
    """Topic of a bag, or feature and unit of a dataset (``"observation.state [deg]"``), by signal:
    ``motor``, ``link`` or ``torque`` of all joints that it names, ``tool``, ``force`` or
    ``acceleration``, or one joint's: ``"elbow reaction"``, ``"elbow link"``."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Recorded name by joint (or axis x, y, z), where they differ; with a factor and an offset if
    zeros, directions or units differ: ``{"elbow": "-elbow_flex.pos + 90 deg"}``."""
    episode: int | None = None
    """Of a dataset; None takes the only one."""
    world: Sequence[str] = ()
    """Frames of a bag whose axes are the world's, besides ``world``."""

    def __post_init__(self) -> None:
        """Understand the sources and the maps before anything slow is loaded."""
        require_a("path", self.path, "str", "Path")
        if not is_recording(self.path):
            path = Path(self.path)
            if path.suffix in (".bag", ".db3"):
                raise JointplayError(
                    f"{str(path)!r} is not an MCAP file; `ros2 bag convert` (or, for ROS 1, "
                    "`rosbags-convert`) writes one"
                )
            if not path.exists():
                raise JointplayError(f"no recording {str(path)!r}")
            raise JointplayError(
                f"{str(path)!r} is neither a ROS 2 bag (.mcap) nor a LeRobot dataset (a folder "
                "with meta/info.json): sources, names, episode and world are only for those"
            )
        self._sources()
        self._maps()
        if self.is_dataset and self.world:
            raise JointplayError("a LeRobot dataset has no frames: leave out 'world'")
        if not self.is_dataset and self.episode is not None:
            raise JointplayError("a bag has no episodes: leave out 'episode'")

    @property
    def is_dataset(self) -> bool:
        """Whether it is a LeRobot dataset."""
        return files.is_file(Path(self.path) / "meta/info.json")

    def _sources(self) -> list[_Source]:
        """Sources, in their order."""
        found = []
        for signal, text in self.sources.items():
            joint, _, kind = signal.strip().rpartition(" ")
            if kind not in _KINDS:
                raise MissingName("signal", signal, _KINDS)
            if kind == "reaction" and not joint:
                raise JointplayError(
                    "say whose reaction: 'JOINT reaction', such as 'elbow reaction'"
                )
            if kind in (*_IN_WORLD_AXES, "acceleration") and joint:
                raise JointplayError(f"{kind} is of the tool, not of a joint, got {signal!r}")
            name, bracket, rest = text.strip().partition("[")
            name, unit = name.strip(), rest.rstrip("]").strip()
            if not name or (bracket and (not text.strip().endswith("]") or not unit)):
                raise JointplayError(
                    f"the source of {signal!r} must read TOPIC or 'FEATURE [unit]', got {text!r}"
                )
            if self.is_dataset and not unit:
                raise JointplayError(
                    f"a LeRobot dataset does not say its units: write that of {name!r} behind it, "
                    f"such as '{name} [{_EXAMPLES[kind]}]'"
                )
            if not self.is_dataset and unit:
                raise JointplayError(
                    f"messages of ROS are in SI units: write {name!r} without [{unit}]"
                )
            if self.is_dataset and name.split(".")[0] == "action":
                raise JointplayError(
                    f"{name!r} is what was commanded, not what was measured: its difference from "
                    "the measured position is the error of the drive, not play"
                )
            found.append(_Source(kind, joint, name, unit))
        return found

    def _maps(self) -> dict[str, _Map]:
        """Maps by joint or axis."""
        found = {}
        for target, text in self.names.items():
            match = _MAP.fullmatch(text.strip())
            try:
                if match is None or not target:
                    raise ValueError(text)
                factor = float(match[1] or f"{match[2] or ''}1")
                if not factor or not np.isfinite(factor):
                    raise ValueError(text)
            except ValueError:
                raise JointplayError(
                    "a recorded name must read NAME, -NAME or FACTOR*NAME, with an offset such as "
                    f"' + 90 deg' behind it, got {text!r} for {target!r}"
                ) from None
            offset = f"{match[4]}{match[5]}" if match[4] else ""
            found[target] = _Map(factor, match[3], offset)
        return found

    def measurement(
        self,
        joints: Mapping[str, bool],
        noise: Mapping[str, float] | None = None,
        progress: bool = False,
    ) -> Measurement:
        """Read the signals.

        Args:
            joints: the robot's joints, and whether each slides.
            noise: see `Measurement`.
            progress: whether to show a bar.

        Raises:
            JointplayError: a topic, feature, episode, joint or unit that does not exist or fit;
                topics that do not overlap in time; directions in axes other than the world's; a
                damaged file; a missing library; see also `Measurement`.
        """
        from jointplay.estimate.measurement import JOINT_UNITS, TOOL_UNITS, Measurement

        sources, maps = self._sources(), self._maps()
        read = self._dataset if self.is_dataset else self._bag
        series, notes = read(sources, progress)
        for target in maps:
            if target not in (*joints, *"xyz"):
                raise MissingName("joint or axis", target, [*joints, "x", "y", "z"])
        recorded = dict.fromkeys(name for one in series.values() for name in one.values)
        for one in maps.values():
            if one.name not in recorded:
                raise MissingName("recorded name", one.name, recorded)
        found: dict[Key, tuple[np.ndarray, np.ndarray]] = {}
        for source in sources:
            if source.joint and source.joint not in joints:
                raise MissingName("joint", source.joint, joints)
            signals = _Signals(self, source, series[source], joints, maps, notes)
            units = JOINT_UNITS.get(source.kind) or (TOOL_UNITS[source.kind],) * 2
            for key, values in signals.read(units).items():
                if key in found:
                    raise JointplayError(f"{self.path}: {' '.join(key)} has two sources")
                found[key] = (series[source].time, values)
        time, together = _together(str(self.path), found, notes)
        sliding = frozenset(name for name, slides in joints.items() if slides)
        return Measurement(
            time, together, noise or {}, str(self.path), sliding, math.inf, tuple(notes)
        )

    def _bag(
        self, sources: Iterable[_Source], progress: bool
    ) -> tuple[dict[_Source, _Series], list[str]]:
        """Records of a bag's topics."""
        path, notes, shown = _bag_file(Path(self.path)), [], sys.stderr
        with rosbag.opened(path) as bag:
            readable = {rosbag.STATE: ["motor", "link", "torque"]}
            for kind, messages in _VECTORS.items():
                for message in messages:
                    readable.setdefault(message, []).append(kind)
            held = [f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in bag.topics.items()]
            getters: dict[_Source, Callable[[Any], dict[str, float]]] = {}
            for source in sources:
                if source.name not in bag.topics:
                    raise MissingName("topic", source.name, held)
                message = bag.topics[source.name]
                if source.kind not in readable.get(message, ()):
                    fit = [one for one, kinds in readable.items() if source.kind in kinds]
                    raise JointplayError(
                        f"{path}: {source.kind} cannot be read from {source.name}, which has "
                        f"{message}; it is read from {', '.join(fit)}"
                    )
                getters[source] = _getter(source.kind, message)
            if not getters:
                raise JointplayError(
                    f"{path}: say which topic is which signal (--source motor=TOPIC, "
                    f"tool=TOPIC, ...); it holds {', '.join(held) or 'nothing'}"
                )
            topics = list(dict.fromkeys(source.name for source in getters))
            records: dict[_Source, list[tuple[int, int, dict[str, float]]]] = {
                source: [] for source in getters
            }
            frames: dict[str, set[str]] = {}
            total = sum(bag.messages.get(topic, 0) for topic in topics)
            with ProgressBar(
                desc=path.name, total=total or None, disable=not progress, unit="message",
                file=shown, delay=1.0,
            ) as bar:  # fmt: skip
                for _, channel, record, message in bag.decoded(topics):
                    stamp = message.header.stamp
                    nano = int(stamp.sec) * _NANO + int(stamp.nanosec)
                    frames.setdefault(channel.topic, set()).add(message.header.frame_id)
                    for source, get in getters.items():
                        if source.name == channel.topic:
                            records[source].append((nano, record.log_time, get(message)))
                    bar.update()
        for source, rows in records.items():
            if not rows:
                raise JointplayError(f"{path}: {source.name} has no message")
            self._check_frames(source, frames[source.name])
        logged = any(all(row[0] == 0 for row in rows) for rows in records.values())
        if logged:
            notes.append("note: messages without a time stamp: times are those of their recording")
        return {
            source: _series(
                [(log if logged else stamp, values) for stamp, log, values in rows],
                source.name,
                notes,
            )
            for source, rows in records.items()
        }, notes

    def _check_frames(self, source: _Source, frames: set[str]) -> None:
        """Refuse directions in axes of which nothing is known."""
        if source.kind not in _IN_WORLD_AXES:
            return
        foreign = sorted(frames - {"", "world", *self.world})
        if foreign:
            raise JointplayError(
                f"{self.path}: {source.name} is in the frame {foreign[0]!r}; {source.kind} is "
                "needed in world axes: if they are the same, say so by --world "
                f"{foreign[0]}; if not, transform it before"
            )

    def _dataset(
        self, sources: Iterable[_Source], progress: bool
    ) -> tuple[dict[_Source, _Series], list[str]]:
        """Records of a dataset's features in one episode."""
        root, notes = Path(self.path), []
        with extra("tables", "pyarrow"):
            from pyarrow import ArrowException, parquet
        try:
            info = json.loads(files.read_text(root / "meta/info.json", "LeRobot dataset"))
            features = {
                name: one for name, one in info["features"].items()
                if one["dtype"].startswith(("float", "int")) and name.startswith("observation")
            }  # fmt: skip
            for source in sources:
                if source.name not in features:
                    raise MissingName("feature", source.name, features)
            names = {source: _names(features[source.name]) for source in sources}
            if not names:
                raise JointplayError(
                    f"{root}: say which feature is which signal (--source "
                    f"'motor=observation.state [deg]', ...); it holds {', '.join(features)}"
                )
            columns = list(dict.fromkeys(source.name for source in names))
            file, episode = self._episode(root, info, parquet)
            table = parquet.read_table(
                file, columns=["timestamp", *columns],
                filters=[("episode_index", "=", episode)],
            )  # fmt: skip
            if not len(table):
                raise JointplayError(f"{file} has no frame of episode {episode}")
            seconds = np.array(table["timestamp"].to_pylist(), float).reshape(-1)
            if not np.isfinite(seconds).all():
                raise JointplayError(f"{file} has frames without a timestamp")
            time = np.round(seconds * _NANO).astype(np.int64)
            made = {}
            for source, known in names.items():
                rows = np.array(table[source.name].to_pylist(), float).reshape(len(time), -1)
                if rows.shape[1] != len(known):
                    raise JointplayError(
                        f"{root}: {source.name} has {rows.shape[1]} values, and {len(known)} names"
                    )
                made[source] = _Series(time, dict(zip(known, rows.T, strict=True)))
        except JointplayError:
            raise
        except (
            *(OSError, KeyError, TypeError, AttributeError, ValueError, RecursionError),
            ArrowException,
        ) as error:
            words = f"no {error}" if isinstance(error, KeyError) else str(error)
            raise JointplayError(
                f"cannot read the LeRobot dataset {str(root)!r}: {words or type(error).__name__}"
            ) from None
        notes.append(
            f"note: {root.name}, episode {episode}: times are those of frames at equal distances, "
            f"{info.get('fps')} a second; the dataset does not say when each was taken"
        )
        return made, notes

    def _episode(self, root: Path, info: Mapping[str, Any], parquet: Any) -> tuple[Path, int]:
        """The file that has the episode, and the episode."""
        version = str(info["codebase_version"])
        match = re.fullmatch(r"v([23])\.\d+", version)
        if match is None:
            raise JointplayError(
                f"{root} is a LeRobot dataset of format {version!r}; v2.0, v2.1 and v3.0 are read"
            )
        major, total = int(match[1]), int(info["total_episodes"])
        layout = info.get("data_path", _LAYOUTS[major])
        if layout != _LAYOUTS[major]:
            raise JointplayError(
                f"{root} has its data in {layout!r}; a dataset {version} is read from "
                f"{_LAYOUTS[major]!r}"
            )
        episode = 0 if self.episode is None and total == 1 else self.episode
        if episode is None or not 0 <= episode < total:
            given = "" if episode is None else f", got {episode}"
            raise JointplayError(
                f"{root} has {total} episodes: name one by --episode, 0 to {total - 1}{given}"
            )
        if major == 2:
            place = {"episode_chunk": episode // int(info["chunks_size"]), "episode_index": episode}
        else:
            place = _place(root, episode, parquet)
        file = root / layout.format(**place)
        if not files.is_file(file):
            raise files.missing(file, "file of the dataset")
        files.check_plain(file, rosbag.MOST_BYTES)
        if files.begins(file, _LFS):
            raise JointplayError(
                f"{file} stands for a file that was not downloaded; `git lfs pull` brings it"
            )
        return file, episode


def is_recording(path: str | Path) -> bool:
    """Whether a path is a ROS 2 bag or a LeRobot dataset, by its name or what the folder holds."""
    path = Path(path)
    if files.is_folder(path):
        return any(files.is_file(path / name) for name in ("meta/info.json", "metadata.yaml"))
    return path.suffix.lower() == ".mcap"


def _bag_file(path: Path) -> Path:
    """The file of a bag, which may be given by its folder."""
    if not files.is_folder(path):
        return path
    inside = sorted(path.glob("*.mcap"))
    if len(inside) != 1:
        held = ", ".join(one.name for one in inside) or "none"
        raise JointplayError(
            f"the bag {str(path)!r} must have one file .mcap, it has {held}; `ros2 bag convert` "
            "joins and converts them"
        )
    return inside[0]


def _getter(kind: str, message: str) -> Callable[[Any], dict[str, float]]:
    """What takes the values out of a message, by name."""
    if kind in _JOINT_FIELDS:
        part = _JOINT_FIELDS[kind]

        def values(state: Any) -> dict[str, float]:
            numbers = getattr(state, part)
            if numbers and len(numbers) != len(state.name):
                raise JointplayError(
                    f"a message has {len(numbers)} values of {part} for {len(state.name)} joints"
                )
            return dict(zip(state.name, numbers, strict=bool(numbers)))

        return values
    vector = attrgetter(_VECTORS[kind][message])
    return lambda one: {axis: getattr(vector(one), axis) for axis in "xyz"}


def _series(rows: list[tuple[int, dict[str, float]]], topic: str, notes: list[str]) -> _Series:
    """Records of a topic by their times."""
    names = dict.fromkeys(name for _, values in rows for name in values)
    time, first = np.unique(np.array([row[0] for row in rows], np.int64), return_index=True)
    if len(time) < len(rows):
        notes.append(
            f"note: {len(rows) - len(time)} of {len(rows)} messages of {topic} have the time of "
            "another: left out"
        )
    kept = [rows[i][1] for i in first]
    return _Series(time, {n: np.array([row.get(n, np.nan) for row in kept]) for n in names})


def _names(feature: Mapping[str, Any]) -> list[str]:
    """Names of a feature's values; numbers if it has none."""
    names = feature.get("names")
    while isinstance(names, dict):
        names = next(iter(names.values()), None)
    if names is None:
        return [str(number) for number in range(int(np.prod(feature["shape"])))]
    return [str(name) for name in names]


def _place(root: Path, episode: int, parquet: Any) -> dict[str, int]:
    """Numbers of the chunk and file that have an episode of a dataset v3."""
    columns = ["data/chunk_index", "data/file_index"]
    for file in sorted((root / "meta/episodes").glob("chunk-*/file-*.parquet")):
        files.check_plain(file, rosbag.MOST_BYTES)
        table = parquet.read_table(file, columns=columns, filters=[("episode_index", "=", episode)])
        if len(table):
            chunk, number = (int(table[name][0].as_py()) for name in columns)
            return {"chunk_index": chunk, "file_index": number}
    raise JointplayError(f"{root}: meta/episodes says nothing of episode {episode}")


@dataclass(frozen=True)
class _Signals:
    """What one source says of the joints or axes."""

    recording: Recording
    source: _Source
    series: _Series
    joints: Mapping[str, bool]
    maps: Mapping[str, _Map]
    notes: list[str]
    """To which is added what was left out."""

    def read(self, units: tuple[str, str]) -> dict[Key, np.ndarray]:
        """Signals in SI, of joints that turn and slide in these units."""
        kind, joint, name, unit = (
            getattr(self.source, f) for f in ("kind", "joint", "name", "unit")
        )
        found: dict[Key, np.ndarray] = {}
        if kind == "reaction":
            size = np.linalg.norm(np.column_stack(list(self.series.values.values())), axis=1)
            return self._checked({(kind, joint): size * self._factor(units[0])})
        targets = [joint] if joint else list(self.joints if kind in _JOINT_FIELDS else "xyz")
        for target in targets:
            one = self._map(target)
            if one is None:
                continue
            goal = units[self.joints.get(target, False)]
            other = units[not self.joints.get(target, False)]
            try:
                factor = self._factor(goal)
            except JointplayError:
                self._factor(other)  # of a joint of the other kind: a unit that fits neither raises
                self.notes.append(
                    f"note: {one.name} of {name} is left out: it is not in {unit}; give it a "
                    f"source of its own, '{target} {kind}={name} [{goal}]'"
                )
                continue
            values = self.series.values[one.name]
            if kind == "torque":  # power is the same in both coordinates
                found[kind, target] = factor * values / one.factor
            else:
                offset = _si(one.offset, goal, f"offset of {target!r}") if one.offset else 0.0
                found[kind, target] = one.factor * factor * values + offset
        if not found:
            wanted, named = "joint of the robot", f"{next(iter(targets), 'JOINT')}=NAME"
            if kind not in _JOINT_FIELDS:
                wanted, named = "axis", "x=NAME"
            raise JointplayError(
                f"{self._where}: none of its names is a {wanted}: {', '.join(self.series.values)}; "
                f"available: {', '.join(targets)}; --map {named} says which is which"
            )
        return self._checked(found)

    @property
    def _where(self) -> str:
        return f"{self.recording.path}, {self.source.name}"

    def _checked(self, found: dict[Key, np.ndarray]) -> dict[Key, np.ndarray]:
        """Signals that say something."""
        for (kind, target), values in found.items():
            if np.isnan(values).all():
                raise JointplayError(f"{self._where}: there is no {kind} of {target!r}")
            if np.isinf(values).any():
                raise JointplayError(f"{self._where}: {target!r} is infinite in a record")
        return found

    def _factor(self, goal: str) -> float:
        """SI units in a unit of the source; 1 for a topic."""
        unit = self.source.unit
        return _si(f"1 {unit}", goal, f"source {self.source.name!r}") if unit else 1.0

    def _map(self, target: str) -> _Map | None:
        """What is recorded of a joint or axis; None for nothing."""
        names, kind = self.series.values, self.source.kind
        if target in self.maps and self.maps[target].name in names:
            return self.maps[target]
        taken = {one.name for one in self.maps.values()}
        free = [name for name in names if name not in taken]
        if target in free:
            fit = [target]
        elif kind in _JOINT_FIELDS:
            fit = [name for name in free if name in [f"{target}.{s}" for s in _SUFFIXES[kind]]]
        else:
            fit = [name for name in free if name.rpartition(".")[2] == target]
        if len(fit) > 1:
            raise JointplayError(
                f"{self._where}: {', '.join(fit)} may all be "
                f"{target!r}; --map {target}=NAME says which"
            )
        if not fit:
            return None
        if self.recording.is_dataset and kind in ("motor", "link") and "gripper" in fit[0]:
            self.notes.append(
                f"note: {fit[0]} of {self.source.name} is left out: LeRobot records grippers in "
                f"per cent of their range; --map '{target}=FACTOR*{fit[0]}' reads it"
            )
            return None
        return _Map(1.0, fit[0], "")


def _si(text: str, goal: str, what: str) -> float:
    """Number in SI of a text with a unit.

    Raises:
        JointplayError: it does not fit; names `what` it is.
    """
    from jointplay.base.units import convert

    try:
        return float(convert(text, goal))
    except ValueError as error:
        raise JointplayError(f"{what}: {error}") from None


def _together(
    path: str, found: Mapping[Key, tuple[np.ndarray, np.ndarray]], notes: list[str]
) -> tuple[np.ndarray, dict[Key, np.ndarray]]:
    """All signals at all times of records, nan where they have none; times begin at zero.

    What is interpolated between its records (encoders, forces on the tool) must have some before
    and after: the rest is cut off.
    """
    spans = {
        key: (time[~np.isnan(values)][0], time[~np.isnan(values)][-1])
        for key, (time, values) in found.items()
    }
    inputs = [span for key, span in spans.items() if key[0] in _INPUTS] or list(spans.values())
    begin, end = max(first for first, _ in inputs), min(last for _, last in inputs)
    start = min(first for first, _ in spans.values())
    others = [span for key, span in spans.items() if key[0] not in _INPUTS] or inputs
    if begin >= end or not any(first <= end and last >= begin for first, last in others):
        said = dict.fromkeys(
            f"{' '.join(key)} {(span[0] - start) / _NANO:.6g} to {(span[1] - start) / _NANO:.6g} s"
            for key, span in spans.items()
        )
        raise JointplayError(
            f"{path}: the signals do not overlap in time (different clocks?): {', '.join(said)}"
        )
    every = np.unique(np.concatenate([time for time, _ in found.values()]))
    kept = every[(every >= begin) & (every <= end)]
    lost = (every[-1] - every[0] - (kept[-1] - kept[0])) / _NANO
    if lost > 0.1:
        notes.append(
            f"note: {lost:.3g} s at the ends are left out, in which not all encoders and forces "
            "have records"
        )
    signals = {}
    for key, (time, values) in found.items():
        signals[key] = np.full(len(kept), np.nan)
        inside = (time >= begin) & (time <= end)
        signals[key][np.searchsorted(kept, time[inside])] = values[inside]
    return (kept - kept[0]) / _NANO, signals
