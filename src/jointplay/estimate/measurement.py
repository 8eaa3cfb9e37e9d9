"""What was measured on a machine, read and cut into visits."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path

import numpy as np
import pinocchio as pin
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.stats import median_abs_deviation, norm

from jointplay.accuracy.poses import middle, moving
from jointplay.base.errors import JointplayError, MissingName, require_positive
from jointplay.base.schema import known_keywords
from jointplay.base.tables import Column, Table, counted, few
from jointplay.estimate import columns
from jointplay.estimate.columns import Key
from jointplay.estimate.unknowns import TINY, TWO_SIDED, UNIFORM
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.wrench import Wrench, WrenchOverTime
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import AXES, Result

# Columns of a file:
#
#     time [s]                            always
#     tool x, tool y, tool z              position of the tool frame, world axes
#     JOINT motor, JOINT link             encoders before and after the play of the joint's gear
#     JOINT torque                        of the drive on its joint, at the joint's side
#     force x, force y, force z           on the tool, world axes


TOOL_UNITS = {"tool": "m", "force": "N"}
"""Signals along x, y and z, and their units."""
JOINT_UNITS = {
    "motor": ("rad", "m"),
    "link": ("rad", "m"),
    "torque": ("N*m", "N"),
}
"""Signals of a joint, and their units for one that turns and one that slides."""
READINGS = ("tool", "link")
"""Kinds of signal of instruments of their own: they drift, and may be late behind the motors'
encoders."""
SHOWN = {"tool": "m", "link": "rad", "torque": "N*m"}
"""Units of the signals whose means are compared."""

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
    """By kind and axis or joint, shape (n,) each; nan where nothing was recorded."""
    noise: Mapping[str, float] = field(default_factory=dict)
    """Standard deviation of a record by kind of signal, where known [SI]."""
    source: str = "the measurement"
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
            if kind not in (kinds := (*TOOL_UNITS, *JOINT_UNITS)):
                raise MissingName("signal that could have noise", kind, kinds)
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
            "time, tool x (y, z), force x (y, z), and JOINT (or JOINT motor), JOINT link, JOINT "
            f"torque of the joints {', '.join(joints)}"
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
        """What instruments would have seen of a simulated run.

        Args:
            result: the run.
            rate: records a second [Hz].
            noise: standard deviation by kind of signal [SI]; none where not given.
            kinds: signals that are measured, of ``tool``, ``motor``, ``link``, ``torque`` and
                ``force`` (the wrenches that act on the tool frame).
            seed: of the noise.
            delay: what of the run's start is left out [s].

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
        """As a file that `from_csv` reads, SI units."""
        head = ["time [s]"]
        for kind, name in self.signals:
            if kind in TOOL_UNITS:
                head.append(f"{kind} {name} [{TOOL_UNITS[kind]}]")
            else:
                head.append(f"{name} {kind} [{JOINT_UNITS[kind][name in self.sliding]}]")
        rows = zip(head, [self.time, *self.signals.values()], strict=True)
        return Table([Column(title, values, key=title) for title, values in rows]).csv()


def sliding_of(joints: Mapping[str, bool]) -> frozenset[str]:
    """Those of the joints that slide."""
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


# From records to visits: short stretches in which the machine stood, or went one way slowly.
#
# A machine with play is compared with its model by the means over visits to the same place from
# different sides, under different loads; single records of an impact tell nothing. Directions are
# those between turning points; a place is a cell of the joint space.


CELLS = 20
"""Cells over a joint's range, in which what moves one way is taken together (measured: at 12 and 30
as many unknowns of machines 3 to 5 of benchmarks/truth/identify.py are told, and none wrongly)."""
PUSH_STEPS = 4.0
"""Parts of the strongest force by which forces on the tool are told apart: less may be friction's
and inertia's. Judged."""
_STOP_CELL = 0.2
"""Part of a cell within which stops are at the same place (judged: with 0.5, of 18 machines whose
stops lie apart by up to 0.6 cells one interval more misses the truth)."""
_TRAVEL = 0.5
"""Part of a cell that a joint must move in a visit (judged: with 0.3 nothing changes in 115
machines of benchmarks/truth/identify.py)."""
STOP_S = 0.15
"""Shortest stop that is looked at [s] (judged)."""
SETTLING = 0.4
"""Part of a stop that is left out at its beginning, while the machine calms down (judged: with 0.5,
of 115 machines three told values miss the truth, else one, and as many are told)."""
LARGEST_LAG_S = 0.03
"""For which readings whose lag is unknown leave records out, at both ends of a visit [s] (judged:
with a quarter of each visit the intervals of a late tracker are a fifth wider)."""
FEWEST_IN_VISIT = 3
"""Records: fewer have no second difference, by which they scatter."""
_INTERVAL_RECORDS = 8
"""Records over which the interval between records is taken: a whole number of rounds of up to four
instruments but three."""
MOST_PATH = 4000
"""Points to which the motors' paths are thinned, for the time that it takes (judged)."""
_SMALLEST_MOTION = 1e-6
"""Motion that counts [rad or m]: a turn in 6 million steps, as 22 bits resolve. Simulated machines,
whose records have no scatter, settle by less."""


@dataclass(frozen=True)
class Visits:
    """n visits of a machine with j joints; SI units."""

    joints: tuple[str, ...]
    """Moving joints, in the order of the columns below."""
    time: np.ndarray
    """Their beginnings and ends, shape (n, 2) [s]."""
    position: np.ndarray
    """Of the joints, motors where geared, means, shape (n, j) [rad or m]."""
    speed: np.ndarray
    """Means, shape (n, j)."""
    acceleration: np.ndarray
    """Means, shape (n, j)."""
    direction: np.ndarray
    """-1 or 1: which way each joint moves or came from; 0 if it never moved, shape (n, j)."""
    stopped: np.ndarray
    """Whether the machine stood, shape (n,)."""
    force: np.ndarray
    """On the tool, world axes, shape (n, 3) [N]."""
    cell: np.ndarray
    """Number of the place, shape (n,)."""
    path: np.ndarray
    """Positions of the motors on the way through all visits, shape (m, j)."""
    path_visit: np.ndarray
    """Visit that a point of the path belongs to, -1 for none, shape (m,)."""
    path_near: np.ndarray
    """Visit whose loads hold at a point of the path, shape (m,)."""
    path_force: np.ndarray
    """On the tool along the path, world axes, shape (m, 3) [N]."""
    path_time: np.ndarray | None = None
    """Of the points of the path, shape (m,) [s]; None: all of it is slow."""
    without_encoder: tuple[str, ...] = ()
    """Joints that were taken where the reference says, or at rest."""

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Observed:
    """What was measured at visits: means and their standard errors, nan where nothing."""

    keys: tuple[Key, ...]
    mean: np.ndarray
    """Tool: its distance from where the ideal mechanism would be; link: from its motor; torque:
    as it is. Shape (n, keys) [m, rad, N m]."""
    error: np.ndarray
    """Standard errors of the means from the records' own scatter, shape (n, keys)."""
    noise: tuple[float, ...]
    """Spread of single records [SI]."""
    rate: np.ndarray
    """How fast the readings themselves change, 0 at stops, shape (n, keys) [m/s, rad/s]."""


def departures(
    mechanism: Mechanism, joints: Sequence[str], q: np.ndarray, signals: Mapping[Key, np.ndarray]
) -> dict[Key, np.ndarray]:
    """What models predict of signals (n,) where joints are at q (n, j), as `Observed.mean` says."""
    tools = any(kind == "tool" for kind, _ in signals)
    ideal = tool_positions(mechanism, joints, q if tools else q[:0])
    expected = dict(signals)
    for kind, name in signals:
        if kind == "tool":
            expected[kind, name] = signals[kind, name] - ideal[:, AXES.index(name)]
        elif kind == "link":
            expected[kind, name] = signals[kind, name] - q[:, list(joints).index(name)]
    return expected


def signal_effect(keys: Sequence[Key], key: Key, values: np.ndarray) -> np.ndarray:
    """Values (n,) as what one signal of `keys` shows, shape (n, keys)."""
    effect = np.zeros((len(values), len(keys)))
    effect[:, list(keys).index(key)] = values
    return effect


def tool_effect(keys: Sequence[Key], moved: np.ndarray) -> np.ndarray:
    """What a displacement of the tool (n, 3) [m] does to the signals, shape (n, keys)."""
    effect = np.zeros((len(moved), len(keys)))
    for column, (kind, axis) in enumerate(keys):
        if kind == "tool":
            effect[:, column] = moved[:, AXES.index(axis)]
    return effect


def stacked(effects: Sequence[np.ndarray], n: int, keys: Sequence[Key]) -> np.ndarray:
    """Effects (n, keys) as columns of one array, which may have none, shape (n, keys, columns)."""
    return np.stack(effects, axis=2) if effects else np.zeros((n, len(keys), 0))


def tool_positions(
    mechanism: Mechanism, joints: Sequence[str], positions: np.ndarray
) -> np.ndarray:
    """Position of the ideal tool in world axes at joint positions (n, j), shape (n, 3) [m]."""
    q = configurations(mechanism, joints, positions)
    tool = np.zeros((len(q), 3))
    for i, row in enumerate(q):
        pin.framesForwardKinematics(mechanism.model, mechanism.data, row)
        tool[i] = mechanism.data.oMf[mechanism.tool_frame].translation
    return tool


def configurations(
    mechanism: Mechanism, joints: Sequence[str], positions: np.ndarray
) -> np.ndarray:
    """Configurations with journals centred and motors before their joints, shape (n, nq)."""
    q = np.zeros((len(positions), mechanism.model.nq))
    for column, name in enumerate(joints):
        q[:, mechanism.coordinate(name)] = positions[:, column]
        q[:, mechanism.motor(name)] = positions[:, column]
    return q


def positions(
    mechanism: Mechanism, measured: Measurement, motion: Motion | None
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, tuple[str, ...]]:
    """Where the joints are: from encoders, or the reference.

    Returns:
        The joints' names; positions (n, j); motion that counts, more than an encoder's noise, (j,)
        [rad or m]; joints without encoder.
    """
    names, still = tuple(moving(mechanism)), middle(mechanism)
    q = np.tile([still[name] for name in names], (len(measured.time), 1))
    reference = None if motion is None else motion(measured.time)[0]
    without_encoder, limits = [], np.full(len(names), _SMALLEST_MOTION)
    for column, name in enumerate(names):
        kinds = ("motor",) if name in mechanism.gears else ("motor", "link")
        kind = next((kind for kind in kinds if (kind, name) in measured.signals), None)
        if kind is not None:
            records = measured.signals[kind, name]
            q[:, column] = _filled(records, measured.time, f"{name} {kind}")
            # By which no two of the records would differ by chance.
            farthest = math.sqrt(2.0) * norm.isf((1.0 - TWO_SIDED) / len(records))
            spread = max(farthest * scatter(records), 2.0 * resolution(records))
            limits[column] = max(spread, _SMALLEST_MOTION)
            continue
        without_encoder.append(name)
        if motion is not None and reference is not None and name in motion.joints:
            q[:, column] = reference[:, motion.joints.index(name)]
    return names, q, limits, tuple(without_encoder)


def _filled(values: np.ndarray, time: np.ndarray, name: str) -> np.ndarray:
    """Positions or forces (n,), gaps interpolated."""
    good = ~np.isnan(values)
    if good.sum() < FEWEST_IN_VISIT:
        raise JointplayError(f"{name} has {good.sum()} records only")
    return np.asarray(np.interp(time, time[good], values[good]))


def scatter(values: np.ndarray) -> float:
    """Spread of single records about a smooth course, of their second differences; robust."""
    bends = np.diff(values[~np.isnan(values)], 2)
    # Of 1, -2, 1 records.
    return float(median_abs_deviation(bends, scale="normal") / 6**0.5) if len(bends) else 0.0


def resolution(values: np.ndarray) -> float:
    """Smallest step between records, if they take few values as an encoder's do; else 0."""
    good = values[~np.isnan(values)]
    steps = np.diff(np.unique(good))
    return float(steps.min()) if 0 < len(steps) <= 0.5 * len(good) else 0.0


def quantisation(values: np.ndarray) -> float:
    """Standard deviation of what an encoder's steps leave out, which is uniform within one."""
    return UNIFORM * resolution(values)


def pushes(force: np.ndarray) -> np.ndarray:
    """Whole numbers by which forces on the tool (n, 3) differ, in parts of the strongest."""
    strongest = max(float(np.abs(force).max(initial=0.0)), TINY)
    return np.asarray(np.round(PUSH_STEPS * force / strongest)).astype(int)


def turns(values: np.ndarray, threshold: float) -> np.ndarray:
    """Which way a position goes at each record: -1 or 1, 0 before it has moved; (n,).

    It has turned when it has come back by `threshold` from its farthest point; what has passed
    since that point counts to the new direction.
    """
    way = np.zeros(len(values), int)
    now, begin, far = 0, 0, 0
    low = high = values[0]
    for i, value in enumerate(values):
        if now == 0:
            low, high = min(low, value), max(high, value)
            if high - low > threshold:
                now = 1 if value >= high else -1
                far = i
            continue
        if (value - values[far]) * now >= 0.0:
            far = i
        elif abs(value - values[far]) > threshold:
            way[begin : far + 1] = now
            begin, far, now = far + 1, i, -now
    way[begin:] = now
    return way


def _pieces(
    time: np.ndarray,
    q: np.ndarray,
    directions: np.ndarray,
    stands: np.ndarray,
    size: np.ndarray,
    force: np.ndarray,
) -> list[slice]:
    """Stretches of n records that belong together.

    By times (n,), positions and directions (n, j), whether the machine stands (n,), the sizes of
    cells (j,), infinite where a joint does not move, and the force on the tool (n, 3).
    """
    with np.errstate(invalid="ignore"):
        cells = np.floor((q - q.min(axis=0)) / size).astype(int)
    cells[stands] = -1
    labels = np.column_stack([directions, stands[:, None], cells, pushes(force)])
    cuts = np.flatnonzero((np.diff(labels, axis=0) != 0).any(axis=1)) + 1
    pieces = []
    for first, last in pairwise([0, *cuts, len(time)]):
        if stands[first]:
            long = time[last - 1] - time[first]
            if long < STOP_S:
                continue
            calm = int(np.searchsorted(time, time[first] + SETTLING * long))
            first = max(first, min(calm, last - FEWEST_IN_VISIT))
        elif not (np.ptp(q[first:last], axis=0) > _TRAVEL * size).any():
            continue  # a drive that gives way to a push: the journals hardly turn
        if last - first >= FEWEST_IN_VISIT:
            pieces.append(slice(int(first), int(last)))
    return pieces


def _rates(time: np.ndarray, q: np.ndarray, directions: np.ndarray, piece: slice) -> np.ndarray:
    """Mean speed and acceleration, (2, j): of a parabola through the piece and its neighbours."""
    margin = (piece.stop - piece.start) // 2
    first, last, way = piece.start, piece.stop, directions[piece.start]
    while first > max(piece.start - margin, 0) and (directions[first - 1] == way).all():
        first -= 1
    end = min(piece.stop + margin, len(time))
    while last < end and (directions[last] == way).all():
        last += 1
    t = time[first:last] - 0.5 * (time[piece.start] + time[piece.stop - 1])
    shape = np.column_stack([np.ones(len(t)), t, 0.5 * t * t])
    return np.asarray(np.linalg.lstsq(shape, q[first:last], rcond=None)[0][1:])


def visits(
    mechanism: Mechanism, measured: Measurement, motion: Motion | None
) -> tuple[Visits, Observed]:
    """Cut a measurement into visits, and take the means of its signals.

    Raises:
        JointplayError: see `positions`; nothing that stands or moves slowly enough.
    """
    names, q, limit, without_encoder = positions(mechanism, measured, motion)
    time = measured.time
    ranges = np.ptp(q, axis=0)
    directions = np.zeros(q.shape, int)
    for column in np.flatnonzero(ranges > 2.0 * limit):
        directions[:, column] = turns(q[:, column], limit[column])
    size = np.where(ranges > 4.0 * limit, ranges / CELLS, np.inf)
    force = np.zeros((len(time), 3))
    for axis, name in enumerate(AXES):
        if not np.isnan(records := measured.signals.get(("force", name), force[:, axis])).all():
            force[:, axis] = _filled(records, time, f"force {name}")
    stands = _standing(time, q, limit)
    pieces = _pieces(time, q, directions, stands, size, force)
    if not pieces:
        raise JointplayError(
            f"{measured.source}: no stop of {STOP_S:g} s and no stretch in one direction with "
            f"{FEWEST_IN_VISIT} records in a cell; measure slower, or with more records a second"
        )
    means = np.array([q[piece].mean(axis=0) for piece in pieces])
    stopped = stands[[piece.start for piece in pieces]]
    rates = np.zeros((2, *means.shape))
    owner = np.full(len(time), -1)
    for i, piece in enumerate(pieces):
        owner[piece] = i
        if not stopped[i]:
            rates[:, i] = _rates(time, q, directions, piece)
    # The way between visits matters to hysteresis: thinned, but for the turning points.
    keep = np.zeros(len(time), bool)
    keep[:: max(len(time) // MOST_PATH, 1)] = True
    turning = np.flatnonzero((np.diff(directions, axis=0) != 0).any(axis=1))
    keep[turning] = keep[np.minimum(turning + 1, len(time) - 1)] = True
    keep[[(piece.start + piece.stop) // 2 for piece in pieces]] = True
    ends = np.array([(time[piece.start], time[piece.stop - 1]) for piece in pieces])
    at = np.array([0.5 * (begin + end) for begin, end in ends])
    near = np.abs(time[keep, None] - at[None, :]).argmin(axis=1)
    near = np.where(owner[keep] >= 0, owner[keep], near)  # a short neighbour's middle may be nearer
    averaged = Visits(
        names,
        ends,
        means,
        speed=rates[0],
        acceleration=rates[1],
        direction=np.array([directions[piece.stop - 1] for piece in pieces]),
        stopped=stopped,
        force=np.array([force[piece].mean(axis=0) for piece in pieces]),
        cell=places(means, stopped, size),
        path=q[keep],
        path_visit=owner[keep],
        path_near=near,
        path_force=force[keep],
        path_time=time[keep],
        without_encoder=without_encoder,
    )
    return averaged, _observe(mechanism, measured, averaged, q, pieces)


def _standing(time: np.ndarray, q: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Whether a record belongs to a while in which all joints stay within their limits, (n,)."""
    # Over several records: signals of different instruments come in pairs, and recordings pause.
    apart = min(_INTERVAL_RECORDS, len(time) - 1)
    interval = float(np.median(time[apart:] - time[:-apart])) / apart
    width = max(int(np.ceil(STOP_S / interval)), 2)
    ranges = maximum_filter1d(q, width, axis=0) - minimum_filter1d(q, width, axis=0)
    still = (ranges <= limit).all(axis=1)
    # `still` marks the middles of such whiles: all records within one belong to it. Windows of even
    # width reach farther back, and the way back to the records farther on.
    return np.asarray(maximum_filter1d(still, width, origin=-1 if width % 2 == 0 else 0))


def places(middles: np.ndarray, stopped: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Number of the place of each visit: those within half a cell of its first visitor; (n,).

    Stops have places of their own, and a smaller reach.
    """
    numbers = np.zeros(len(middles), int)
    firsts: list[int] = []
    for i, row in enumerate(middles):
        reach = (_STOP_CELL if stopped[i] else 0.5) * size
        for number, first in enumerate(firsts):
            near = (np.abs(row - middles[first]) <= reach).all()
            if stopped[first] == stopped[i] and near:
                numbers[i] = number
                break
        else:
            numbers[i] = len(firsts)
            firsts.append(i)
    return numbers


def _observe(
    mechanism: Mechanism,
    measured: Measurement,
    visits: Visits,
    q: np.ndarray,
    pieces: Sequence[slice],
) -> Observed:
    """Means over the visits of what the model predicts."""
    signals = {
        (kind, name): values
        for (kind, name), values in measured.signals.items()
        if kind in ("tool", "torque") or (kind == "link" and name in mechanism.gears)
    }
    keys = tuple(signals)
    mean = np.full((len(pieces), len(keys)), np.nan)
    error, rate, noise = mean.copy(), np.zeros(mean.shape), []
    inner = [_inner(measured, piece) for piece in pieces]
    off = departures(mechanism, visits.joints, q, signals)
    for column, (key, records) in enumerate(signals.items()):
        values, kind = off[key], key[0]
        spread = measured.noise.get(kind) or scatter(values)
        floor = quantisation(records)
        noise.append(max(spread, floor))
        for i, piece in enumerate(inner if kind in READINGS else pieces):
            good = ~np.isnan(values[piece])
            known = values[piece][good]
            if len(known) >= FEWEST_IN_VISIT and not (kind == "torque" and visits.stopped[i]):
                mean[i, column] = known.mean()
                error[i, column] = np.hypot(noise[-1] / np.sqrt(len(known)), floor)
                if not visits.stopped[i]:
                    at = measured.time[piece][good]
                    slope, _ = np.polyfit(at - at.mean(), records[piece][good], 1)
                    rate[i, column] = slope
    return Observed(keys, mean, error, tuple(noise), rate)


def _inner(measured: Measurement, piece: slice) -> slice:
    """Records of a visit that belong to it even if they are late, where enough are left.

    Within them speed and loads are steady: what is late is moved, and nothing else.
    """
    if not measured.lag:
        return piece
    time, margin = measured.time, min(2.0 * measured.lag, LARGEST_LAG_S)
    first = int(np.searchsorted(time, time[piece.start] + margin))
    last = int(np.searchsorted(time, time[piece.stop - 1] - margin, "right"))
    return slice(first, last) if last - first >= FEWEST_IN_VISIT else piece
