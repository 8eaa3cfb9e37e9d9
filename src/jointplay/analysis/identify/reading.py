"""What was measured on a machine: columns with their units and times.

A column is called ``tool x [mm]``: what it is, and its unit in brackets (or ``tool_x_mm``).

    time [s]                            always
    tool x, tool y, tool z              position of the tool frame, world axes
    JOINT motor, JOINT link             encoders before and after the play of the joint's gear
    JOINT torque                        of the drive on its joint, at the joint's side
    force x, force y, force z           on the tool, world axes
    acceleration x, ... y, ... z        of the tool
    JOINT reaction                      force between bearing and journal, its size
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from jointplay.errors import JointplayError, require_positive
from jointplay.loads.wrench import Wrench, WrenchOverTime
from jointplay.result.result import AXES, Result
from jointplay.units import convert

TOOL_UNITS = {"tool": "m", "force": "N", "acceleration": "m/s^2"}
"""Signals along x, y and z, and their units."""
JOINT_UNITS = {
    "motor": ("rad", "m"),
    "link": ("rad", "m"),
    "torque": ("N*m", "N"),
    "reaction": ("N", "N"),
}
"""Signals of a joint, and their units for one that turns and one that slides."""
FEWEST = 20
"""Records that a measurement must have."""
_BRACKETS = re.compile(r"^(.*?)\s*[\[(](.*)[\])]\s*$")
_SHOWN = 60

Key = tuple[str, str]
"""``("tool", "x")``, ``("link", "elbow")``: kind of a signal, then its axis or joint."""


class TooLittle(JointplayError):
    """Means of a measurement that say nothing of clearance and friction; impacts still may."""


@dataclass(frozen=True)
class Measurement:
    """Signals over time, SI units.

    Raises:
        JointplayError: times that do not increase; too few records; lengths that differ.
    """

    time: np.ndarray
    """Shape (n,) [s]."""
    signals: Mapping[Key, np.ndarray]
    """By kind and axis or joint, shape (n,) each; nan where nothing was recorded."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a record by kind of signal, where known [SI]."""
    source: str = "the measurement"
    """Where it came from, for messages."""

    def __post_init__(self) -> None:
        """Check shapes and times."""
        time = np.asarray(self.time, float)
        object.__setattr__(self, "time", time)
        if len(time) < FEWEST:
            raise JointplayError(
                f"{self.source} has {len(time)} records; at least {FEWEST} are needed"
            )
        late = np.flatnonzero(~(np.diff(time) > 0.0))
        if late.size:
            raise JointplayError(
                f"{self.source}: times must increase, but {time[late[0]]:g} s is followed by "
                f"{time[late[0] + 1]:g} s (record {late[0] + 2})"
            )
        for kind, value in self.noise.items():
            if kind not in (*TOOL_UNITS, *JOINT_UNITS):
                choices = ", ".join((*TOOL_UNITS, *JOINT_UNITS))
                raise JointplayError(f"no signal {kind!r} to have noise; there are: {choices}")
            require_positive(f"noise of {kind!r}", value, "SI")
        for key, values in self.signals.items():
            if np.shape(values) != time.shape:
                raise JointplayError(f"{self.source}: {' '.join(key)} is not as long as the times")

    def has(self, kind: str) -> list[str]:
        """Axes or joints of which there is a signal of this kind."""
        return [name for one, name in self.signals if one == kind]

    @classmethod
    def from_csv(
        cls,
        path: str | Path,
        joints: Mapping[str, bool],
        noise: Mapping[str, float] | None = None,
    ) -> Measurement:
        """Read a CSV file; lines beginning with # are comments, empty cells are no records.

        Args:
            path: the file.
            joints: the robot's joints, and whether each slides.
            noise: see the class.

        Raises:
            JointplayError: no such file; no time; a column without unit, of an unknown name or
                given twice; a cell that is no number (with its line); see also the class.
        """
        path = Path(path)
        header, table = _table(path)
        time, signals = None, {}
        for column, title in enumerate(header):
            name, unit = _split(title, path)
            key, goal = _meaning(name, joints, title, path)
            try:
                factor = float(convert(f"1 {unit}", goal))
            except ValueError as error:
                raise JointplayError(f"{path}, column {title!r}: {error}") from None
            values = factor * table[:, column]
            if key is None:
                time = values
            elif key in signals:
                raise JointplayError(f"{path}: {name!r} is there twice")
            else:
                signals[key] = values
        if time is None:
            raise JointplayError(
                f"{path} has no times: a column such as 'time [s]' is needed; there are: "
                + ", ".join(header)
            )
        if not signals:
            raise JointplayError(f"{path} has times only: nothing was measured")
        if np.isnan(time).any():
            raise JointplayError(f"{path}: record {np.isnan(time).argmax() + 1} has no time")
        return cls(time, signals, noise or {}, str(path))

    @classmethod
    def from_result(
        cls,
        result: Result,
        *,
        rate: float = 100.0,
        noise: Mapping[str, float] | None = None,
        kinds: Sequence[str] = ("tool", "motor"),
        seed: int = 0,
        delay: float = 0.0,
    ) -> Measurement:
        """What instruments would have seen of a simulated run.

        Args:
            result: the run.
            rate: records a second [Hz].
            noise: standard deviation by kind of signal [SI]; none where not given.
            kinds: signals that are measured, of ``tool``, ``motor``, ``link``, ``torque``,
                ``acceleration`` (of the tool), ``reaction`` (between bearing and journal; both
                means over the interval between records) and ``force`` (the wrenches that act on
                the tool frame).
            seed: of the noise.
            delay: what of the run's start is left out [s].

        Raises:
            JointplayError: a kind of signal that runs do not have; see also the class.
        """
        require_positive("rate", rate, "Hz")
        random = np.random.default_rng(seed)
        time = np.arange(result.time[0] + delay, result.time[-1] + 0.5 / rate, 1.0 / rate)
        time = time[time <= result.time[-1]]
        seen = _seen(result, kinds)
        spread = dict(noise or {})
        clean = {key: np.interp(time, result.time, values) for key, values in seen.items()}
        if "acceleration" in kinds:
            clean |= _accelerations(result, time, 1.0 / rate)
        if "reaction" in kinds:
            clean |= _reactions(result, time, 1.0 / rate)
        signals = {
            key: values + spread.get(key[0], 0.0) * random.standard_normal(len(time))
            for key, values in clean.items()
        }
        return cls(time, signals, {}, "the simulated measurement")

    def csv(self) -> str:
        """As a file that `from_csv` reads, SI units."""
        units = {**TOOL_UNITS, **{kind: units[0] for kind, units in JOINT_UNITS.items()}}
        head = ["time [s]"]
        for kind, name in self.signals:
            words = f"{kind} {name}" if kind in TOOL_UNITS else f"{name} {kind}"
            head.append(f"{words} [{units[kind]}]")
        table = np.column_stack([self.time, *self.signals.values()])
        rows = [",".join("" if np.isnan(x) else f"{x:.9g}" for x in row) for row in table]
        return "\n".join([",".join(head), *rows]) + "\n"


def _seen(result: Result, kinds: Sequence[str]) -> dict[Key, np.ndarray]:
    """Histories of a run by kind of signal."""
    mechanism = result.simulation.mechanism
    joints = [name for name in mechanism.joints if name in mechanism.description.joints]
    histories: dict[Key, np.ndarray] = {}
    for kind in kinds:
        if kind == "tool":
            for i, axis in enumerate(AXES):
                histories[kind, axis] = result["tool_position"].values[:, i]
            continue
        if kind in ("acceleration", "reaction"):
            continue  # means between records
        if kind == "force":
            given = _wrenches(result)
            histories |= {(kind, axis): given[:, i] for i, axis in enumerate(AXES)}
            continue
        if kind not in JOINT_UNITS:
            raise JointplayError(f"no signal {kind!r} of runs: tool, {', '.join(JOINT_UNITS)}")
        for name in joints:
            at = mechanism.coordinate(name) if kind == "link" else mechanism.motor(name)
            histories[kind, name] = result["drive" if kind == "torque" else "q"].values[:, at]
    return histories


def _accelerations(result: Result, time: np.ndarray, interval: float) -> dict[Key, np.ndarray]:
    """Of the tool, means over intervals about the times [m/s^2]."""
    speed = result["tool_velocity"].values
    means: dict[Key, np.ndarray] = {}
    for i, axis in enumerate(AXES):
        means["acceleration", axis] = _mean_rate(result.time, speed[:, i], time, interval)
    return means


def _reactions(result: Result, time: np.ndarray, interval: float) -> dict[Key, np.ndarray]:
    """Size of the forces between bearings and journals, means over intervals [N]."""
    means: dict[Key, np.ndarray] = {}
    for name in result.joints:
        force = np.linalg.norm(result["joint_force"].sel(joint=name).values, axis=1)
        impulse = cumulative_trapezoid(force, result.time, initial=0.0)
        means["reaction", name] = _mean_rate(result.time, impulse, time, interval)
    return means


def _mean_rate(
    known: np.ndarray, values: np.ndarray, time: np.ndarray, interval: float
) -> np.ndarray:
    """Mean rate of change of values, which are known at some times, over intervals about others."""
    ends = [np.clip(time + side * interval / 2.0, known[0], known[-1]) for side in (-1, 1)]
    before, after = (np.interp(end, known, values) for end in ends)
    return np.asarray((after - before) / np.maximum(ends[1] - ends[0], 1e-12))


def _wrenches(result: Result) -> np.ndarray:
    """Sum of the given forces on the tool frame over time, world axes, shape (n, 3) [N]."""
    simulation = result.simulation
    total = np.zeros((len(result.time), 3))
    for load in simulation.loads.values():
        if isinstance(load, Wrench | WrenchOverTime) and load.frame == simulation.mechanism.tool:
            if load.axes != "world" or any(load.at):
                raise JointplayError("forces of a run are known in world axes at the tool only")
            if isinstance(load, Wrench):
                total += np.array(load.force)
            elif load.forces:
                rows = np.array(load.forces)
                total += np.column_stack(
                    [np.interp(result.time, load.times, rows[:, i]) for i in range(3)]
                )
    return total


def _table(path: Path) -> tuple[list[str], np.ndarray]:
    """Titles of the columns, and their numbers (n, columns)."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise JointplayError(f"cannot read the measurement {str(path)!r}: {reason}") from None
    lines = [
        (number, line)
        for number, line in enumerate(text.splitlines(), 1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if not lines:
        raise JointplayError(f"the measurement {str(path)!r} is empty")
    rows = [row for _, row in zip(lines, csv.reader(line for _, line in lines), strict=True)]
    header = [cell.strip() for cell in rows[0]]
    table = np.full((len(rows) - 1, len(header)), np.nan)
    for i, ((number, _), row) in enumerate(zip(lines[1:], rows[1:], strict=True)):
        if len(row) != len(header):
            raise JointplayError(
                f"{path}, line {number}: {len(header)} cells expected, got {len(row)}"
            )
        for column, cell in enumerate(row):
            if cell.strip():
                try:
                    table[i, column] = float(cell)
                except ValueError:
                    raise JointplayError(
                        f"{path}, line {number}: {header[column]!r} must be a number, got "
                        f"{cell.strip()[:_SHOWN]!r}"
                    ) from None
    if np.isinf(table).any():
        row, column = np.argwhere(np.isinf(table))[0]
        raise JointplayError(f"{path}: {header[column]!r} is infinite in record {row + 1}")
    return header, table


def _split(title: str, path: Path) -> tuple[str, str]:
    """A column's name and unit, of ``tool x [mm]`` or ``tool_x_mm``."""
    match = _BRACKETS.match(title)
    if match:
        return match[1].strip(), match[2].strip()
    name, _, unit = title.rpartition("_")
    try:
        convert(f"1 {unit}", *{u for u in ("s", "m", "rad", "N", "N*m", "m/s^2")})
    except ValueError:
        name = ""
    if not name:
        raise JointplayError(
            f"{path}: column {title!r} has no unit; write it behind the name, such as "
            "'time [s]', 'tool x [mm]' or 'elbow motor [deg]'"
        )
    return name.strip(), unit


def _meaning(
    name: str, joints: Mapping[str, bool], title: str, path: Path
) -> tuple[Key | None, str]:
    """Which signal a column is (None: the times), and the unit that it must fit."""
    if name.lower() in ("time", "t"):
        return None, "s"
    for mark in (" ", "_", "."):
        first, _, last = name.partition(mark)
        if first in TOOL_UNITS and last in AXES:
            return (first, last), TOOL_UNITS[first]
        first, _, last = name.rpartition(mark)
        if last in JOINT_UNITS and first in joints:
            return (last, first), JOINT_UNITS[last][joints[first]]
    raise JointplayError(
        f"{path}: column {title!r} is no signal; there are: time, tool x (y, z), force x, "
        f"acceleration x, and JOINT motor, JOINT link, JOINT torque, JOINT reaction of the joints "
        f"{', '.join(joints)}"
    )
