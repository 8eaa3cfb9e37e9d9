"""The motion that a scenario gives: of a file, of joints, of the tool."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.codec import unknown_key
from jointplay.errors import JointplayError, require_positive, within
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.cartesian import cartesian_motion
from jointplay.motion.reference import INTERPOLATIONS, Motion
from jointplay.scenario.fitting import fit
from jointplay.scenario.model import ANGLE, ANGULAR_SPEED, PATHS, Model
from jointplay.scenario.sources import MOTION_SOURCES, locate


@contextmanager
def _renamed(**names: str) -> Iterator[None]:
    """Say of errors in the block at one of these arguments that they are at its key."""
    try:
        yield
    except JointplayError as error:
        error.where = tuple(names.get(str(part), part) for part in error.where)
        raise


def motion_of(
    model: Model, mechanism: Mechanism, folder: Path, start: dict[str, float]
) -> Motion | None:
    """The reference; takes out of `start` what it uses."""
    if model.motion is None:
        return None
    motion = _as_given(model, model.motion, mechanism, folder, start)
    if model.motion.faster is None:
        return motion
    with within("motion", "faster"):
        faster = require_positive("faster", model.motion.faster, "")
        return Motion(motion.joints, motion.times / faster, motion.positions, motion.interpolation)


def _as_given(
    model: Model, table: Any, mechanism: Mechanism, folder: Path, start: dict[str, float]
) -> Motion:
    """The reference at the speed that the scenario gives it."""
    given = table.given()
    interpolation = table.interpolation or INTERPOLATIONS[0]
    sources = [key for key in MOTION_SOURCES if key in given]
    if len(sources) != 1:
        raise JointplayError(
            f"the motion needs one of {', '.join(MOTION_SOURCES)}; "
            f"got {' and '.join(sources) or 'none'}",
            where=("motion", *sources[1:2]),
        )
    (source,) = sources
    for key in given:
        if key not in (source, *MOTION_SOURCES[source]):
            keys = (source, *MOTION_SOURCES[source])
            raise JointplayError(
                unknown_key(key, keys) + f" (with {source})", where=("motion", key)
            )
    if source == "file":
        with within("motion", "file"):
            return _from_file(locate(given["file"], folder), table.interpolation)
    if source == "speeds":
        return _turning(model, mechanism, start)
    if table.times is None:
        raise JointplayError(f"the key times is missing; {source} needs it", where=("motion",))
    if source == "tool_position":
        return _cartesian(table, mechanism, start)
    columns = []
    for name, values in given["joints"].items():
        path = ("motion", "joints", name)
        if len(values) != len(table.times):
            raise JointplayError(
                f"{len(values)} positions for {len(table.times)} times; give one for each",
                where=path,
            )
        columns.append([fit(mechanism, name, value, ANGLE, path) for value in values])
    with within("motion"):
        positions = np.array(columns).reshape(len(columns), len(table.times)).T
        return Motion(list(given["joints"]), table.times, positions, interpolation)


def _from_file(path: Path, interpolation: str | None) -> Motion:
    """Motion of a file, which is read again only once it has changed."""
    try:
        stamp = path.stat()
    except (OSError, ValueError):  # which those who read put into words
        return _read(path, interpolation)
    return _read_once(path, interpolation, (stamp.st_mtime_ns, stamp.st_size, stamp.st_ino))


@lru_cache(maxsize=16)
def _read_once(path: Path, interpolation: str | None, stamp: tuple[int, ...]) -> Motion:
    return _read(path, interpolation)


def _read(path: Path, interpolation: str | None) -> Motion:
    if path.suffix.lower() == ".mcap":  # recorded, and dense
        return Motion.from_mcap(path, interpolation=interpolation or "spline")
    return Motion.from_csv(path, interpolation or INTERPOLATIONS[0])


def _turning(model: Model, mechanism: Mechanism, start: dict[str, float]) -> Motion:
    """Joints at constant speed."""
    assert model.motion is not None
    assert model.motion.speeds is not None
    duration = model.integration.duration
    if duration is None:
        raise JointplayError(
            "constant speeds have no end; give duration in [integration]",
            where=("motion", "speeds"),
        )
    names = list(model.motion.speeds)
    speeds = [
        fit(mechanism, name, speed, ANGULAR_SPEED, ("motion", "speeds", name))
        for name, speed in model.motion.speeds.items()
    ]
    begin = np.array([start.pop(name, 0.0) for name in names])
    with within("motion", "speeds"):
        positions = [begin, begin + np.array(speeds) * duration]
        return Motion(names, [0.0, duration], np.array(positions), "constant-speed")


def _cartesian(table: Any, mechanism: Mechanism, start: dict[str, float]) -> Motion:
    """Joints that move a frame as asked."""
    for key in ("tool_position", "tool_rpy"):
        rows = getattr(table, key)
        if rows is not None and len(rows) != len(table.times):
            raise JointplayError(
                f"{len(rows)} waypoints for {len(table.times)} times; give one for each",
                where=("motion", key),
            )
    with _renamed(positions="tool_position", orientations="tool_rpy"), within("motion"):
        motion: Motion = cartesian_motion(
            mechanism.ideal(),
            np.array(table.times),
            np.array(table.tool_position).reshape(-1, 3),
            None if table.tool_rpy is None else np.array(table.tool_rpy).reshape(-1, 3),
            frame=table.frame,
            path=table.path or PATHS[0],
            start=dict(start) or None,
        )
    for name in motion.joints:
        start.pop(name, None)
    return motion
