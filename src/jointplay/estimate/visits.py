"""Visits: short stretches of a measurement in which the machine stood, or went one way slowly.

A machine with play is compared with its model by the means over visits to the same place from
different sides, under different loads; single records of an impact tell nothing.

1. The joints' positions come from encoders or the reference (`_positions`); their directions are
   those between turning points (`turns`), their places cells of the joint space.
2. Records are cut wherever a direction, a place or the force on the tool changes, or the machine
   comes to a stop (`_pieces`). Beginnings of stops are left out, and stretches that are too short.
3. Each piece is a visit (`Visits`), with the means of its signals (`Observed`) as deviations from
   the ideal machine. The path between visits is kept, thinned, for hysteresis.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pinocchio as pin
from scipy.ndimage import maximum_filter1d, minimum_filter1d
from scipy.stats import norm

from jointplay.accuracy.poses import middle, moving
from jointplay.base.errors import JointplayError
from jointplay.estimate.columns import Key
from jointplay.estimate.measurement import (
    FEWEST_IN_VISIT,
    READINGS,
    Measurement,
    quantisation,
    resolution,
    scatter,
)
from jointplay.estimate.unknowns import TINY, TWO_SIDED
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import AXES

CELLS = 20
"""Number of cells over a joint's range; records in one cell belong to one place (measured: at 12
and 30 as many unknowns of machines 3 to 5 of benchmarks/truth/identify.py are told, and none
wrongly)."""
PUSH_STEPS = 4.0
"""Number of steps, up to the strongest force on the tool, by which forces are told apart: less may
be friction's and inertia's. Judged: with 6 the same is told of 11 machines of
benchmarks/truth/identify.py."""
_STOP_CELL = 0.2
"""Part of a cell within which stops are at the same place (judged: with 0.5, of 18 machines whose
stops lie apart by up to 0.6 cells one interval more misses the truth)."""
_TRAVEL = 0.5
"""Part of a cell that a joint must move in a visit (judged: with 0.3 nothing changes in 115
machines of benchmarks/truth/identify.py)."""
STOP_S = 0.15
"""Duration of the shortest stop that counts [s] (judged: with 0.1 s the same is told of these 11
machines)."""
SETTLING_SHARE = 0.4
"""Part of a stop that is left out at its beginning, while the machine calms down (judged: with 0.5,
of 115 machines three told values miss the truth, else one, and as many are told)."""
LARGEST_LAG_S = 0.03
"""Longest time that is left out at both ends of a visit for readings that may be late [s] (judged:
with a quarter of each visit the intervals of a late tracker are a fifth wider)."""
_INTERVAL_RECORDS = 8
"""Records over which the interval between records is taken: a whole number of rounds of one, two or
four instruments."""
MOST_PATH = 4000
"""Number of points to which the motors' paths are thinned, for the time that it takes (judged: with
8000 nothing changes for these 11 machines; with 2000 one hysteresis is not told)."""
_SMALLEST_MOTION = 1e-6
"""Smallest motion that counts [rad or m]: a turn in 6 million steps, as 22 bits resolve. Simulated
machines, whose records have no scatter, settle by less."""
_HAS_DIRECTION, _HAS_CELLS = 2.0, 4.0
"""Range of a joint, in motions that count, from which on it has directions, and from which on cells
divide it (judged: with both twice as large the same is told of these 11 machines)."""


@dataclass(frozen=True)
class Visits:
    """n visits of a machine with j joints; SI units."""

    joints: tuple[str, ...]
    """Moving joints, in the order of the columns below."""
    time: np.ndarray
    """Beginnings and ends, shape (n, 2) [s]."""
    position: np.ndarray
    """Mean positions of the joints, of their motors where geared, shape (n, j) [rad or m]."""
    speed: np.ndarray
    """Mean speeds, shape (n, j) [rad/s or m/s]."""
    acceleration: np.ndarray
    """Mean accelerations, shape (n, j) [rad/s^2 or m/s^2]."""
    direction: np.ndarray
    """Which way each joint moves or came from, -1 or 1; 0 if it never moved, shape (n, j)."""
    stopped: np.ndarray
    """Whether the machine stood, shape (n,)."""
    force: np.ndarray
    """Mean force on the tool, world axes, shape (n, 3) [N]."""
    cell: np.ndarray
    """Number of the place, shape (n,)."""
    path: np.ndarray
    """Positions of the motors at m points of the path through all visits, shape (m, j)."""
    path_visit: np.ndarray
    """Visit that each point of the path belongs to, -1 for none, shape (m,)."""
    path_near: np.ndarray
    """Visit whose loads hold at each point of the path, shape (m,)."""
    path_force: np.ndarray
    """Force on the tool along the path, world axes, shape (m, 3) [N]."""
    path_time: np.ndarray | None = None
    """Time of each point of the path, shape (m,) [s]; None: all of the path is slow."""
    without_encoder: tuple[str, ...] = ()
    """Joints without encoder, whose positions are the reference's, or those at rest."""

    def __len__(self) -> int:
        return len(self.time)


@dataclass(frozen=True)
class Observed:
    """Signals at n visits: means and their standard errors, nan where nothing was measured."""

    keys: tuple[Key, ...]
    """Kind and axis or joint of each signal."""
    mean: np.ndarray
    """Means of deviations, shape (n, keys) [m, rad, N m]: of the tool from where the ideal
    mechanism would have it, of a link from its motor; torques as they are."""
    error: np.ndarray
    """Standard errors of the means by the records' own scatter, shape (n, keys)."""
    noise: tuple[float, ...]
    """Standard deviation of single records of each signal [SI]."""
    rate: np.ndarray
    """How fast the readings themselves change, 0 at stops, shape (n, keys) [m/s, rad/s]."""


def signal_effect(keys: Sequence[Key], key: Key, values: np.ndarray) -> np.ndarray:
    """Effect of values (n,) that one signal shows on all signals, shape (n, keys)."""
    effect = np.zeros((len(values), len(keys)))
    effect[:, list(keys).index(key)] = values
    return effect


def tool_effect(keys: Sequence[Key], moved: np.ndarray) -> np.ndarray:
    """Effect of a displacement of the tool (n, 3) [m] on all signals, shape (n, keys)."""
    effect = np.zeros((len(moved), len(keys)))
    for column, (kind, axis) in enumerate(keys):
        if kind == "tool":
            effect[:, column] = moved[:, AXES.index(axis)]
    return effect


def stacked(effects: Sequence[np.ndarray], n: int, keys: Sequence[Key]) -> np.ndarray:
    """Effects (n, keys) as columns of one array, shape (n, keys, columns); there may be none."""
    return np.stack(effects, axis=2) if effects else np.zeros((n, len(keys), 0))


def tool_positions(
    mechanism: Mechanism, joints: Sequence[str], positions: np.ndarray
) -> np.ndarray:
    """Positions of the ideal tool in world axes at joint positions (n, j), shape (n, 3) [m]."""
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


def _positions(
    mechanism: Mechanism, measured: Measurement, motion: Motion | None
) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, tuple[str, ...]]:
    """Positions of the joints from their encoders, or from the reference.

    Returns:
        The joints' names; positions (n, j); smallest motion that counts, more than an encoder's
        noise, (j,) [rad or m]; joints without encoder.
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
            # No two of the records differ by so much by chance.
            farthest = math.sqrt(2.0) * norm.isf((1.0 - TWO_SIDED) / len(records))
            spread = max(farthest * scatter(records), 2.0 * resolution(records))
            limits[column] = max(spread, _SMALLEST_MOTION)
            continue
        without_encoder.append(name)
        if motion is not None and reference is not None and name in motion.joints:
            q[:, column] = reference[:, motion.joints.index(name)]
    return names, q, limits, tuple(without_encoder)


def _filled(values: np.ndarray, time: np.ndarray, name: str) -> np.ndarray:
    """Records (n,) with their gaps interpolated."""
    good = ~np.isnan(values)
    if good.sum() < FEWEST_IN_VISIT:
        raise JointplayError(f"{name} has {good.sum()} records only")
    return np.asarray(np.interp(time, time[good], values[good]))


def pushes(force: np.ndarray) -> np.ndarray:
    """Forces on the tool (n, 3) as whole numbers of `PUSH_STEPS`, which differ if forces do."""
    strongest = max(float(np.abs(force).max(initial=0.0)), TINY)
    return np.asarray(np.round(PUSH_STEPS * force / strongest)).astype(int)


def turns(values: np.ndarray, threshold: float) -> np.ndarray:
    """Direction in which a position goes at each record: -1 or 1, 0 before it has moved; (n,).

    It has turned when it has come back by `threshold` from its farthest point; records since that
    point have the new direction.
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
    """Cut n records into stretches that belong together, and leave out what is too short.

    Args:
        time: shape (n,) [s].
        q: positions, shape (n, j).
        directions: shape (n, j).
        stands: whether the machine stands, shape (n,).
        size: sizes of cells, shape (j,); infinite where a joint does not move.
        force: on the tool, shape (n, 3) [N].
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
            calm = int(np.searchsorted(time, time[first] + SETTLING_SHARE * long))
            first = max(first, min(calm, last - FEWEST_IN_VISIT))
        elif not (np.ptp(q[first:last], axis=0) > _TRAVEL * size).any():
            continue  # a drive that gives way to a push: the journals hardly turn
        if last - first >= FEWEST_IN_VISIT:
            pieces.append(slice(int(first), int(last)))
    return pieces


def _rates(time: np.ndarray, q: np.ndarray, directions: np.ndarray, piece: slice) -> np.ndarray:
    """Mean speed and acceleration of a piece, (2, j), by a parabola.

    Fitted also to neighbouring records of the same direction, up to half the piece at each end.
    """
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


def cut_into_visits(
    mechanism: Mechanism, measured: Measurement, motion: Motion | None
) -> tuple[Visits, Observed]:
    """Cut a measurement into visits, and take the means of its signals.

    Raises:
        JointplayError: too few records of an encoder or a force; nothing that stands or moves
            slowly enough.
    """
    names, q, limit, without_encoder = _positions(mechanism, measured, motion)
    time = measured.time
    ranges = np.ptp(q, axis=0)
    directions = np.zeros(q.shape, int)
    for column in np.flatnonzero(ranges > _HAS_DIRECTION * limit):
        directions[:, column] = turns(q[:, column], limit[column])
    size = np.where(ranges > _HAS_CELLS * limit, ranges / CELLS, np.inf)
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
    # The path between visits matters to hysteresis: thinned, with all turning points and middles.
    keep = np.zeros(len(time), bool)
    keep[:: max(len(time) // MOST_PATH, 1)] = True
    turning = np.flatnonzero((np.diff(directions, axis=0) != 0).any(axis=1))
    keep[turning] = keep[np.minimum(turning + 1, len(time) - 1)] = True
    keep[[(piece.start + piece.stop) // 2 for piece in pieces]] = True
    ends = np.array([(time[piece.start], time[piece.stop - 1]) for piece in pieces])
    at = np.array([0.5 * (begin + end) for begin, end in ends])
    near = np.abs(time[keep, None] - at[None, :]).argmin(axis=1)
    near = np.where(owner[keep] >= 0, owner[keep], near)  # a short neighbour's middle may be nearer
    cut = Visits(
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
    return cut, _observe(mechanism, measured, cut, q, pieces)


def _standing(time: np.ndarray, q: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Whether each record belongs to a stop: no joint moves for `STOP_S` at least; shape (n,)."""
    # Over several records: signals of different instruments come in pairs, and recordings pause.
    apart = min(_INTERVAL_RECORDS, len(time) - 1)
    interval = float(np.median(time[apart:] - time[:-apart])) / apart
    width = max(int(np.ceil(STOP_S / interval)), 2)
    ranges = maximum_filter1d(q, width, axis=0) - minimum_filter1d(q, width, axis=0)
    still = (ranges <= limit).all(axis=1)
    # `still` marks the middles of windows without motion: all records within one belong to the
    # stop. Windows of even width reach farther back, and the way back to the records farther on.
    return np.asarray(maximum_filter1d(still, width, origin=-1 if width % 2 == 0 else 0))


def places(middles: np.ndarray, stopped: np.ndarray, size: np.ndarray) -> np.ndarray:
    """Number of each visit's place, (n,): visits within half a cell of the first one there.

    Stops have places of their own, with a smaller reach.
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
    """Means over the visits of the signals that the model predicts, see `Observed.mean`."""
    signals = {
        (kind, name): values
        for (kind, name), values in measured.signals.items()
        if kind in ("tool", "torque") or (kind == "link" and name in mechanism.gears)
    }
    keys = tuple(signals)
    mean = np.full((len(pieces), len(keys)), np.nan)
    error, rate, noise = mean.copy(), np.zeros(mean.shape), []
    inner = [_inner(measured, piece) for piece in pieces]
    tracked = any(kind == "tool" for kind, _ in keys)
    ideal = tool_positions(mechanism, visits.joints, q if tracked else q[:0])
    for column, ((kind, name), records) in enumerate(signals.items()):
        values = records
        if kind == "tool":
            values = records - ideal[:, AXES.index(name)]
        elif kind == "link":
            values = records - q[:, visits.joints.index(name)]
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

    Within them speed and loads are steady, so that lateness only moves the readings. Left out are
    two standard deviations of the lag at both ends.
    """
    if not measured.lag:
        return piece
    time, margin = measured.time, min(2.0 * measured.lag, LARGEST_LAG_S)
    first = int(np.searchsorted(time, time[piece.start] + margin))
    last = int(np.searchsorted(time, time[piece.stop - 1] - margin, "right"))
    return slice(first, last) if last - first >= FEWEST_IN_VISIT else piece
