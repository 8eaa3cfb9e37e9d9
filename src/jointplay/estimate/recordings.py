"""Measurements from recordings: ROS 2 bags (MCAP) and LeRobot datasets.

Neither says which of its signals is which of a mechanism's, and a LeRobot dataset has no units:
`Recording` states both, and nothing is guessed. Signals keep the times of their own records; that
their instruments' clocks agree is not assumed.

1. Records of each source are read, of a bag (`_bag`) or a dataset (`_dataset`).
2. Recorded names are mapped to joints and axes, numbers to SI (`_signals`).
3. All signals are put on one axis of time, without interpolation (`_together`).
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError, MissingName, require_a, require_known
from jointplay.base.imports import extra
from jointplay.base.progress import ProgressBar
from jointplay.base.schema import known_keywords
from jointplay.base.units import convert
from jointplay.estimate.columns import Key
from jointplay.estimate.measurement import JOINT_UNITS, TOOL_UNITS, Measurement, sliding_of
from jointplay.simulation.motion import rosbag

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
}
"""Fields of vectors with x, y and z, by kind of signal and type of message."""
_READ_FROM = {kind: [rosbag.STATE] for kind in _JOINT_FIELDS} | {
    kind: list(messages) for kind, messages in _VECTORS.items()
}
"""Types of message from which each kind of signal is read."""
_INPUTS = ("motor", "link", "force")
"""Kinds of signal that are interpolated, as they must be known at the times of the others."""
_SUFFIXES = {
    kind: ("effort",) if kind == "torque" else ("pos", "position") for kind in _JOINT_FIELDS
}
"""Suffixes of LeRobot behind the name of a motor, by kind of signal."""
_EXAMPLES = {"motor": "deg", "link": "deg", "torque": "N*m", "tool": "mm", "force": "N"}
"""Units by kind of signal, for examples in messages."""
_MAP = re.compile(r"(?:([-+]?[\d.]+(?:[eE][-+]?\d+)?)\s*\*\s*|(-)\s*)?(\S+)(?:\s+([-+])\s*(\S.*))?")
"""FACTOR * NAME + OFFSET: factor, sign, name, sign of the offset, offset."""
_LFS = b"version https://git-lfs"
"""Begin of the text that Git puts in the place of a large file."""
_LAYOUTS = {
    2: "data/chunk-{episode_chunk:03d}/episode_{episode_index:06d}.parquet",
    3: "data/chunk-{chunk_index:03d}/file-{file_index:03d}.parquet",
}
"""Paths of the episodes of a LeRobot dataset, by the first number of its format."""


class _Source(NamedTuple):
    """A topic or feature from which signals of one kind are read."""

    kind: str
    joint: str
    """The only joint that it is read for, or empty."""
    name: str
    """Name of the topic or feature."""
    unit: str
    """Unit of the feature; empty for a topic."""


class _Map(NamedTuple):
    """A joint or axis as ``factor * name + offset`` of what was recorded."""

    factor: float
    name: str
    offset: str = ""
    """Text of the offset with its unit."""


_Series = tuple[np.ndarray, dict[str, np.ndarray]]
"""Times of n records, integers (n,) [ns]; values by the recorded name, (n,), nan for none."""


@known_keywords
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
    ``motor``, ``link`` or ``torque`` of all joints that it names, ``tool`` or ``force``, or one
    joint's: ``"elbow link"``."""
    names: Mapping[str, str] = field(default_factory=dict)
    """Recorded name by joint (or axis x, y, z), where they differ; with a factor and an offset if
    zeros, directions or units differ: ``{"elbow": "-elbow_flex.pos + 90 deg"}``."""
    episode: int | None = None
    """Number of the episode of a dataset; None takes the only one."""
    world: Sequence[str] = ()
    """Frames of a bag whose axes are the world's, besides ``world``."""

    def __post_init__(self) -> None:
        require_a("path", self.path, "str", "Path")
        if not is_recording(self.path):
            path = Path(self.path)
            if path.suffix in (".bag", ".db3"):
                raise JointplayError(
                    f"{str(path)!r} is not MCAP; `ros2 bag convert` or `rosbags-convert` makes it"
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
        return files.is_file(Path(self.path) / "meta/info.json")

    def _sources(self) -> list[_Source]:
        """The sources, read from their texts."""
        sources = []
        for signal, text in self.sources.items():
            joint, _, kind = signal.strip().rpartition(" ")
            if kind not in _EXAMPLES:
                raise MissingName("signal", signal, _EXAMPLES)
            name, bracket, tail = text.strip().partition("[")
            name, unit = name.strip(), tail.rstrip("]").strip()
            wrong = ""
            if kind in _VECTORS and joint:
                wrong = f"{kind} is of the tool, not of a joint, got {signal!r}"
            elif not name or (bracket and not (unit and tail.endswith("]"))):
                wrong = f"the source of {signal!r} must read TOPIC or 'FEATURE [unit]', got "
                wrong += repr(text)
            elif self.is_dataset and not unit:
                wrong = f"a LeRobot dataset does not say its units: write that of {name!r} behind "
                wrong += f"it, such as '{name} [{_EXAMPLES[kind]}]'"
            elif not self.is_dataset and unit:
                wrong = f"messages of ROS are in SI units: write {name!r} without [{unit}]"
            elif self.is_dataset and name.split(".")[0] == "action":
                wrong = f"{name!r} is what was commanded, not what was measured: its difference "
                wrong += "from the measured position is the error of the drive, not play"
            if wrong:
                raise JointplayError(wrong)
            sources.append(_Source(kind, joint, name, unit))
        return sources

    def _maps(self) -> dict[str, _Map]:
        """The maps of recorded names, read from their texts, by joint or axis."""
        maps = {}
        for target, text in self.names.items():
            match = _MAP.fullmatch(text.strip())
            try:
                factor = float(match[1] or f"{match[2] or ''}1") if match and target else 0.0
            except ValueError:
                factor = 0.0
            if match is None or not factor or not math.isfinite(factor):
                raise JointplayError(
                    "a recorded name must read NAME, -NAME or FACTOR*NAME, with an offset such as "
                    f"' + 90 deg' behind it, got {text!r} for {target!r}"
                )
            maps[target] = _Map(factor, match[3], f"{match[4]}{match[5]}" if match[4] else "")
        return maps

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
            JointplayError: what does not exist, fit or overlap in time; directions in other axes
                than the world's; a damaged file; a missing library; see also `Measurement`.
        """
        sources, maps = self._sources(), self._maps()
        series, notes = self._dataset(sources) if self.is_dataset else self._bag(sources, progress)
        for target in maps:
            require_known("joint or axis", target, [*joints, "x", "y", "z"])
        recorded = dict.fromkeys(name for _, values in series.values() for name in values)
        for mapping in maps.values():
            require_known("recorded name", mapping.name, recorded)
        # Times of each signal's records, integers [ns], and values [SI].
        signals: dict[Key, tuple[np.ndarray, np.ndarray]] = {}
        for source in sources:
            if source.joint:
                require_known("joint", source.joint, joints)
            time, values = series[source]
            for key, numbers in self._signals(source, values, joints, maps, notes).items():
                where = f"{self.path}, {source.name}"
                if np.isnan(numbers).all():
                    raise JointplayError(f"{where}: there is no {key[0]} of {key[1]!r}")
                if np.isinf(numbers).any():
                    raise JointplayError(f"{where}: {key[1]!r} is infinite in a record")
                if key in signals:
                    raise JointplayError(f"{self.path}: {' '.join(key)} has two sources")
                signals[key] = time, numbers
        seconds, together = _together(str(self.path), signals, notes)
        return Measurement(
            seconds, together, noise or {}, str(self.path), sliding_of(joints), math.inf,
            tuple(notes),
        )  # fmt: skip

    def _bag(
        self, sources: Sequence[_Source], progress: bool
    ) -> tuple[dict[_Source, _Series], list[str]]:
        """Records of a bag's topics, and notes."""
        path, notes = _bag_file(Path(self.path)), []
        with rosbag.opened(path) as bag:
            held = [f"{topic} ({kind.rpartition('/')[2]})" for topic, kind in bag.topics.items()]
            getters: dict[_Source, Callable[[Any], dict[str, float]]] = {}
            for source in sources:
                if source.name not in bag.topics:
                    raise MissingName("topic", source.name, held)
                message, fit = bag.topics[source.name], _READ_FROM[source.kind]
                if message not in fit:
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
            rows: dict[_Source, list[tuple[int, int, dict[str, float]]]] = {s: [] for s in getters}
            frames: dict[str, set[str]] = {topic: set() for topic in topics}
            total = sum(bag.messages.get(topic, 0) for topic in topics)
            with ProgressBar(
                desc=path.name, total=total or None, disable=not progress, unit="message",
                file=sys.stderr, delay=1.0,
            ) as bar:  # fmt: skip
                for _, channel, record, message in bag.decoded(topics):
                    stamp = message.header.stamp
                    nano = int(stamp.sec) * _NANO + int(stamp.nanosec)
                    frames[channel.topic].add(message.header.frame_id)
                    for source, get in getters.items():
                        if source.name == channel.topic:
                            rows[source].append((nano, record.log_time, get(message)))
                    bar.update()
        for source, messages in rows.items():
            if not messages:
                raise JointplayError(f"{path}: {source.name} has no message")
            foreign = sorted(frames[source.name] - {"", "world", *self.world})
            if foreign and source.kind in _VECTORS:
                raise JointplayError(
                    f"{self.path}: {source.name} is in the frame {foreign[0]!r}; {source.kind} is "
                    f"needed in world axes: transform it, or say --world {foreign[0]} if they are"
                )
        logged = any(not any(row[0] for row in messages) for messages in rows.values())
        if logged:
            notes.append("note: messages without a time stamp: times are those of their recording")
        series = {}
        for source, messages in rows.items():
            times = np.array([row[int(logged)] for row in messages], np.int64)
            time, first = np.unique(times, return_index=True)
            if len(time) < len(messages):
                notes.append(
                    f"note: {len(messages) - len(time)} of {len(messages)} messages of "
                    f"{source.name} have the time of another: left out"
                )
            records = [messages[i][2] for i in first]
            names = dict.fromkeys(name for row in records for name in row)
            columns = {n: np.array([row.get(n, np.nan) for row in records]) for n in names}
            series[source] = time, columns
        return series, notes

    def _dataset(self, sources: Sequence[_Source]) -> tuple[dict[_Source, _Series], list[str]]:
        """Records of a dataset's features in one episode, and notes."""
        root = Path(self.path)
        with extra("tables", "pyarrow"):
            from pyarrow import ArrowException, parquet
        try:
            info = json.loads(files.read_text(root / "meta/info.json", "LeRobot dataset"))
            features = {
                name: feature for name, feature in info["features"].items()
                if feature["dtype"].startswith(("float", "int"))
                and name.startswith("observation")
            }  # fmt: skip
            for source in sources:
                require_known("feature", source.name, features)
            if not sources:
                raise JointplayError(
                    f"{root}: say which feature is which signal (--source "
                    f"'motor=observation.state [deg]', ...); it holds {', '.join(features)}"
                )
            names = {source.name: _names(features[source.name]) for source in sources}
            file, episode = self._episode(root, info, parquet)
            chosen = [("episode_index", "=", episode)]
            table = parquet.read_table(file, columns=["timestamp", *names], filters=chosen)
            if not len(table):
                raise JointplayError(f"{file} has no frame of episode {episode}")
            seconds = np.array(table["timestamp"].to_pylist(), float).reshape(-1)
            if not np.isfinite(seconds).all():
                raise JointplayError(f"{file} has frames without a timestamp")
            time, series = np.round(seconds * _NANO).astype(np.int64), {}
            for source in sources:
                known = names[source.name]
                rows = np.array(table[source.name].to_pylist(), float).reshape(len(time), -1)
                if rows.shape[1] != len(known):
                    raise JointplayError(
                        f"{root}: {source.name} has {rows.shape[1]} values, and {len(known)} names"
                    )
                series[source] = time, dict(zip(known, rows.T, strict=True))
        except JointplayError:
            raise
        except (
            *(OSError, KeyError, TypeError, AttributeError, ValueError, RecursionError),
            ArrowException,
        ) as error:
            text = f"no {error}" if isinstance(error, KeyError) else str(error)
            raise JointplayError(
                f"cannot read the LeRobot dataset {str(root)!r}: {text or type(error).__name__}"
            ) from None
        return series, [
            f"note: {root.name}, episode {episode}: times are those of frames at equal distances, "
            f"{info.get('fps')} a second; the dataset does not say when each was taken"
        ]

    def _episode(self, root: Path, info: Mapping[str, Any], parquet: Any) -> tuple[Path, int]:
        """File that holds the chosen episode of a dataset, and the episode's number."""
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
                f"{root} has its data in {layout!r}; {version} is read from {_LAYOUTS[major]!r}"
            )
        episode = 0 if self.episode is None and total == 1 else self.episode
        if episode is None or not 0 <= episode < total:
            request = "" if episode is None else f", got {episode}"
            raise JointplayError(
                f"{root} has {total} episodes: name one by --episode, 0 to {total - 1}{request}"
            )
        if major == 2:
            place = {"episode_chunk": episode // int(info["chunks_size"]), "episode_index": episode}
        else:
            place = _place(root, episode, parquet)
        file = root / layout.format(**place)
        files.require_file(file, "file of the dataset")
        files.check_plain(file, rosbag.MOST_BYTES)
        if files.begins(file, _LFS):
            raise JointplayError(
                f"{file} stands for a file that was not downloaded; `git lfs pull` brings it"
            )
        return file, episode

    def _signals(
        self,
        source: _Source,
        recorded: Mapping[str, np.ndarray],
        joints: Mapping[str, bool],
        maps: Mapping[str, _Map],
        notes: list[str],
    ) -> dict[Key, np.ndarray]:
        """Signals of joints or axes from one source [SI]; `notes` grow by what is left out."""
        kind, joint, name, unit = source
        units = JOINT_UNITS.get(kind) or (TOOL_UNITS[kind],) * 2

        def factor(goal: str) -> float:
            """SI units in a unit of the source; 1 for a topic."""
            return _si(f"1 {unit}", goal, f"source {name!r}") if unit else 1.0

        targets = [joint] if joint else list(joints if kind in _JOINT_FIELDS else "xyz")
        signals: dict[Key, np.ndarray] = {}
        for target in targets:
            mapped = self._map(source, target, recorded, maps, notes)
            if mapped is None:
                continue
            slides = joints.get(target, False)
            goal = units[slides]
            try:
                values = factor(goal) * recorded[mapped.name]
            except JointplayError:
                factor(units[not slides])  # of a joint of the other kind: what fits neither raises
                notes.append(
                    f"note: {mapped.name} of {name} is left out: it is not in {unit}; give it a "
                    f"source of its own, '{target} {kind}={name} [{goal}]'"
                )
                continue
            if kind == "torque":  # power is the same in both coordinates
                signals[kind, target] = values / mapped.factor
            else:
                offset = _si(mapped.offset, goal, f"offset of {target!r}") if mapped.offset else 0.0
                signals[kind, target] = mapped.factor * values + offset
        if not signals:
            item, named = "axis", "x=NAME"
            if kind in _JOINT_FIELDS:
                item, named = "joint of the robot", f"{next(iter(targets), 'JOINT')}=NAME"
            raise JointplayError(
                f"{self.path}, {name}: none of its names is a {item}: {', '.join(recorded)}; "
                f"available: {', '.join(targets)}; --map {named} says which is which"
            )
        return signals

    def _map(
        self,
        source: _Source,
        target: str,
        recorded: Mapping[str, np.ndarray],
        maps: Mapping[str, _Map],
        notes: list[str],
    ) -> _Map | None:
        """Map of a joint or axis: the given one, else by its name; None if nothing is recorded."""
        if target in maps and maps[target].name in recorded:
            return maps[target]
        named = {mapping.name for mapping in maps.values()}
        free = [name for name in recorded if name not in named]
        if target in free:
            fit = [target]
        elif source.kind in _JOINT_FIELDS:
            fit = [n for n in free if n in [f"{target}.{s}" for s in _SUFFIXES[source.kind]]]
        else:
            fit = [name for name in free if name.rpartition(".")[2] == target]
        if len(fit) > 1:
            raise JointplayError(
                f"{self.path}, {source.name}: {', '.join(fit)} may all be {target!r}; "
                f"--map {target}=NAME says which"
            )
        if not fit:
            return None
        if self.is_dataset and _JOINT_FIELDS.get(source.kind) == "position" and "gripper" in fit[0]:
            notes.append(
                f"note: {fit[0]} of {source.name} is left out: LeRobot records grippers in "
                f"per cent of their range; --map '{target}=FACTOR*{fit[0]}' reads it"
            )
            return None
        return _Map(1.0, fit[0])


def is_recording(path: str | Path) -> bool:
    """Whether a path is a ROS 2 bag or a LeRobot dataset, by its name or what the folder holds."""
    path = Path(path)
    if files.is_folder(path):
        return any(files.is_file(path / name) for name in ("meta/info.json", "metadata.yaml"))
    return path.suffix.lower() == ".mcap"


def _bag_file(path: Path) -> Path:
    """The MCAP file of a bag, which may be a folder."""
    if not files.is_folder(path):
        return path
    inside = sorted(path.glob("*.mcap"))
    if len(inside) != 1:
        held = ", ".join(file.name for file in inside) or "none"
        text = f"must have one file .mcap, it has {held}; `ros2 bag convert` joins them"
        raise JointplayError(f"the bag {str(path)!r} {text}")
    return inside[0]


def _getter(kind: str, message: str) -> Callable[[Any], dict[str, float]]:
    """Function from a message to values by recorded name, for a kind of signal and of message."""
    if kind not in _JOINT_FIELDS:
        vector = attrgetter(_VECTORS[kind][message])
        return lambda record: {axis: getattr(vector(record), axis) for axis in "xyz"}
    part = _JOINT_FIELDS[kind]

    def values(state: Any) -> dict[str, float]:
        numbers = getattr(state, part)
        if numbers and len(numbers) != len(state.name):
            raise JointplayError(
                f"a message has {len(numbers)} values of {part} for {len(state.name)} joints"
            )
        return dict(zip(state.name, numbers, strict=bool(numbers)))

    return values


def _names(feature: Mapping[str, Any]) -> list[str]:
    """Names of a feature's values; numbers if it has none."""
    names = feature.get("names")
    while isinstance(names, dict):
        names = next(iter(names.values()), None)
    if names is None:
        names = range(int(np.prod(feature["shape"])))
    return [str(name) for name in names]


def _place(root: Path, episode: int, parquet: Any) -> dict[str, int]:
    """Numbers of chunk and file of an episode in a dataset of format 3."""
    columns = ["data/chunk_index", "data/file_index"]
    for file in sorted((root / "meta/episodes").glob("chunk-*/file-*.parquet")):
        files.check_plain(file, rosbag.MOST_BYTES)
        table = parquet.read_table(file, columns=columns, filters=[("episode_index", "=", episode)])
        if len(table):
            chunk, number = (int(table[name][0].as_py()) for name in columns)
            return {"chunk_index": chunk, "file_index": number}
    raise JointplayError(f"{root}: meta/episodes says nothing of episode {episode}")


def _si(text: str, goal: str, name: str) -> float:
    """Number of a text with a unit, in the SI unit `goal`; errors begin with `name`."""
    try:
        return float(convert(text, goal))
    except ValueError as error:
        raise JointplayError(f"{name}: {error}") from None


def _together(
    path: str, records: Mapping[Key, tuple[np.ndarray, np.ndarray]], notes: list[str]
) -> tuple[np.ndarray, dict[Key, np.ndarray]]:
    """All signals at all times of records, nan where they have none; times begin at zero.

    What is interpolated between its records (encoders, forces on the tool) must have some before
    and after: the rest is cut off.
    """
    spans = {key: time[~np.isnan(values)][[0, -1]] for key, (time, values) in records.items()}
    inputs = [span for key, span in spans.items() if key[0] in _INPUTS] or list(spans.values())
    begin, end = max(first for first, _ in inputs), min(last for _, last in inputs)
    windows = [span for key, span in spans.items() if key[0] not in _INPUTS] or inputs
    if begin >= end or not any(first <= end and last >= begin for first, last in windows):
        start = min(first for first, _ in spans.values())
        ranges = dict.fromkeys(
            f"{' '.join(key)} {(first - start) / _NANO:.6g} to {(last - start) / _NANO:.6g} s"
            for key, (first, last) in spans.items()
        )
        raise JointplayError(
            f"{path}: the signals do not overlap in time (different clocks?): {', '.join(ranges)}"
        )
    times = np.unique(np.concatenate([time for time, _ in records.values()]))
    common = times[(times >= begin) & (times <= end)]
    lost = (times[-1] - times[0] - (common[-1] - common[0])) / _NANO
    if (shown := f"{lost:.1f}") != "0.0":
        notes.append(
            f"note: {shown} s at the ends are left out, in which not all encoders and forces "
            "have records"
        )
    signals = {}
    for key, (time, values) in records.items():
        signals[key] = np.full(len(common), np.nan)
        inside = (time >= begin) & (time <= end)
        signals[key][np.searchsorted(common, time[inside])] = values[inside]
    return (common - common[0]) / _NANO, signals
