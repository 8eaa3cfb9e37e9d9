"""Measurements of a machine: signals over time, from a file or from a simulated run.

Columns of a file:

    time [s]                            always
    tool x, tool y, tool z              position of the tool frame, world axes
    JOINT motor, JOINT link             encoders before and after the play of the joint's gear
    JOINT torque                        of the drive on its joint, at the joint's side
    force x, force y, force z           on the tool, world axes
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from scipy.stats import median_abs_deviation

from jointplay.base.errors import JointplayError, require_known, require_positive
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Column, Table, counted, few
from jointplay.estimate import columns
from jointplay.estimate.columns import Key
from jointplay.estimate.unknowns import STEP_DEVIATION
from jointplay.simulation.loads.wrench import Wrench, WrenchOverTime
from jointplay.simulation.result.result import AXES, Result

TOOL_UNITS = {"tool": "m", "force": "N"}
"""Signals along x, y and z, and their units."""
JOINT_UNITS = {"motor": ("rad", "m"), "link": ("rad", "m"), "torque": ("N*m", "N")}
"""Signals of a joint, and their units for one that turns and one that slides."""
READINGS = ("tool", "link")
"""Kinds of signal that have instruments of their own, which drift, and may be late behind the
motors' encoders."""
SHOWN = {"tool": "m", "link": "rad", "torque": "N*m"}
"""Units of the signals whose means are compared."""
FEWEST_IN_VISIT = 3
"""Least number of records: fewer have no second difference, by which they scatter."""
_TIME: Key = ("time", "")


@known_keywords
@dataclass(frozen=True, repr=False)
class Measurement:
    """Signals over time, SI units.

    Raises:
        JointplayError: times that do not increase; too few records; lengths that differ.
    """

    time: np.ndarray
    """Shape (n,) [s]."""
    signals: Mapping[Key, np.ndarray]
    """Records by kind and axis or joint, shape (n,) each; nan where nothing was recorded."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a record by kind of signal, where known [SI]."""
    source: str = "the measurement"
    """Name of the measurement in texts, such as its file."""
    sliding: frozenset[str] = frozenset()
    """Joints that slide: their signals are in m and N, those of others in rad and N m."""
    lag: float = 0.0
    """Standard deviation of the time by which readings of the tool, and of links, may be late
    behind the motors' encoders [s]; ``inf``: nothing is known of it."""
    notes: tuple[str, ...] = ()
    """What was chosen or left out when it was read, a line each."""

    def __post_init__(self) -> None:
        time = np.asarray(self.time, float)
        object.__setattr__(self, "time", time)
        if len(time) < FEWEST_IN_VISIT:
            raise JointplayError(
                f"{self.source} has {len(time)} records; at least {FEWEST_IN_VISIT} are needed"
            )
        late = np.flatnonzero(~(np.diff(time) > 0.0))
        if late.size:
            was, now = time[late[0] : late[0] + 2]
            text = f"times must increase, but {was:g} s is followed by {now:g} s"
            raise JointplayError(f"{self.source}: {text} (record {late[0] + 2})")
        for kind, value in self.noise.items():
            require_known("signal that could have noise", kind, (*TOOL_UNITS, *JOINT_UNITS))
            require_positive(f"noise of {kind!r}", value, "SI")
        for key, values in self.signals.items():
            if np.shape(values) != time.shape:
                raise JointplayError(f"{self.source}: {' '.join(key)} is not as long as the times")

    def __repr__(self) -> str:
        kinds = dict.fromkeys(kind for kind, _ in self.signals)
        signals = "; ".join(f"{kind} of {few(self.has(kind))}" for kind in kinds)
        length = f"{counted(len(self.time), 'record')}, {self.time[0]:g} to {self.time[-1]:g} s"
        return f"<jointplay Measurement: {self.source}, {length}; {signals or 'no signals'}>"

    def has(self, kind: str) -> list[str]:
        """Axes or joints of which there is a signal of this kind."""
        return [name for present, name in self.signals if present == kind]

    @classmethod
    def from_csv(
        cls, path: str | Path, joints: Mapping[str, bool], noise: Mapping[str, float] | None = None
    ) -> Measurement:
        """Read a CSV file; lines beginning with # are comments, empty cells are no records.

        Args:
            path: the file.
            joints: the robot's joints, and whether each slides.
            noise: see the class.

        Raises:
            JointplayError: see `columns.read` and the class; no times.
        """
        path = Path(path)
        axes = {kind: dict.fromkeys(AXES, unit) for kind, unit in TOOL_UNITS.items()}

        def known(name: str) -> tuple[Key, str] | None:
            if name.lower() in ("time", "t"):
                return _TIME, "s"
            return columns.meaning(name, joints, JOINT_UNITS, axes)

        choices = (
            "time, tool x (y, z), force x (y, z), and JOINT (or JOINT motor, JOINT position), "
            f"JOINT link, JOINT torque, JOINT goal (not used) of the joints {', '.join(joints)}"
        )
        gaps = ("time", *TOOL_UNITS, *JOINT_UNITS)
        signals, _ = columns.read(path, "measurement", known, choices, gaps=gaps)
        time = signals.pop(_TIME, None)
        if time is None:
            raise JointplayError(f"{path} has no times: a column 'time [s]' is needed")
        if not signals:
            raise JointplayError(f"{path} contains only times: nothing was measured")
        if np.isnan(time).any():
            raise JointplayError(f"{path}: record {np.isnan(time).argmax() + 1} has no time")
        return cls(time, signals, noise or {}, str(path), sliding_of(joints))

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
        """The measurement that instruments would have made of a simulated run.

        Args:
            result: the run.
            rate: records a second [Hz].
            noise: standard deviation by kind of signal [SI]; none where not given.
            kinds: signals that are measured, of ``tool``, ``motor``, ``link``, ``torque`` and
                ``force`` (the wrenches that act on the tool frame).
            seed: of the noise.
            delay: time at the run's start that is left out [s].

        Raises:
            JointplayError: a kind of signal that runs do not have; see also the class.
        """
        require_positive("rate", rate, "Hz")
        random = np.random.default_rng(seed)
        time = np.arange(result.time[0] + delay, result.time[-1] + 0.5 / rate, 1.0 / rate)
        time = time[time <= result.time[-1]]
        signals: dict[Key, np.ndarray] = {}
        for kind in kinds:
            for name, values in histories(result, kind).items():
                clean, spread = np.interp(time, result.time, values), (noise or {}).get(kind, 0.0)
                signals[kind, name] = clean + spread * random.standard_normal(len(time))
        entries = result.simulation.mechanism.description.joints
        sliding = sliding_of({name: entry.slides for name, entry in entries.items()})
        return cls(time, signals, {}, "the simulated measurement", sliding)

    def csv(self) -> str:
        """Text of a file that `from_csv` reads, SI units."""
        head = ["time [s]"]
        for kind, name in self.signals:
            if kind in TOOL_UNITS:
                head.append(f"{kind} {name} [{TOOL_UNITS[kind]}]")
            else:
                head.append(f"{name} {kind} [{JOINT_UNITS[kind][name in self.sliding]}]")
        rows = zip(head, [self.time, *self.signals.values()], strict=True)
        return Table([Column(title, values, key=title) for title, values in rows]).csv()


def sliding_of(joints: Mapping[str, bool]) -> frozenset[str]:
    """Names of the joints that slide, by whether each does."""
    return frozenset(name for name, slides in joints.items() if slides)


def histories(result: Result, kind: str) -> dict[str, np.ndarray]:
    """A kind of signal over a run, by axis or joint."""
    if kind in TOOL_UNITS:
        values = result["tool_position"].values if kind == "tool" else _wrenches(result)
        return dict(zip(AXES, values.T, strict=True))
    if kind not in JOINT_UNITS:
        raise JointplayError(f"no signal {kind!r} of runs: tool, {', '.join(JOINT_UNITS)}")
    mechanism = result.simulation.mechanism
    coordinate = mechanism.coordinate if kind == "link" else mechanism.motor
    values = result["drive" if kind == "torque" else "q"].values
    joints = [name for name in mechanism.joints if name in mechanism.description.joints]
    return {name: values[:, coordinate(name)] for name in joints}


def _wrenches(result: Result) -> np.ndarray:
    """Sum of the given forces on the tool frame over time, world axes, shape (n, 3) [N]."""
    simulation = result.simulation
    total = np.zeros((len(result.time), 3))
    for load in simulation.loads.values():
        if isinstance(load, Wrench | WrenchOverTime) and load.frame == simulation.mechanism.tool:
            if load.axes != "world" or any(load.at):
                raise JointplayError("forces of a run are known only at the tool, in world axes")
            if isinstance(load, Wrench):
                total += np.array(load.force)
            elif load.forces:
                rows = np.array(load.forces)
                total += np.column_stack(
                    [np.interp(result.time, load.times, rows[:, i]) for i in range(3)]
                )
    return total


def scatter(values: np.ndarray) -> float:
    """Standard deviation of single records about a smooth course, by their second differences.

    Robust: by the median of these, whose variance is 1 + 4 + 1 times that of a record.
    """
    bends = np.diff(values[~np.isnan(values)], 2)
    return float(median_abs_deviation(bends, scale="normal") / 6**0.5) if len(bends) else 0.0


def resolution(values: np.ndarray) -> float:
    """Smallest step between records, if they take few values as an encoder's do; else 0.

    Few: at most half as many as there are records, so that values come twice on average.
    """
    good = values[~np.isnan(values)]
    steps = np.diff(np.unique(good))
    return float(steps.min()) if 0 < len(steps) <= 0.5 * len(good) else 0.0


def quantisation(values: np.ndarray) -> float:
    """Standard deviation of an encoder's rounding, which is uniform within one of its steps."""
    return STEP_DEVIATION * resolution(values)
