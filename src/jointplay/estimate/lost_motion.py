"""Lost motion of single joints: moved back and forth under a dial gauge, without forces.

Where friction alone holds the link, it stays where it was left until the teeth of the other side
take it along (the play operator), and a dial reads where it is:

    link_i = min(max(link_{i-1}, motor_i - L/2), motor_i + L/2)
    reading_i = zero + scale link_i + drift (t_i) + scatter

with the total lost motion L: the play, and what gears give way to friction both ways. Given L, all
else is linear, except the side on which the link began. So L's interval is that of its profile
(`_Profile`): values whose sum of squares exceeds the least by no more than Student's t allows.

Lost motion is known if its interval excludes zero (`known`). Weight that exceeds friction holds the
link to one side, and nothing is lost: then this test tells nothing.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.sax.saxutils import quoteattr

import numpy as np
import pinocchio as pin
from scipy.stats import median_abs_deviation
from scipy.stats import t as student

from jointplay.accuracy.poses import moving
from jointplay.base import files
from jointplay.base.errors import JointplayError, require_known
from jointplay.base.schema import known_keywords
from jointplay.base.tables import counted, few
from jointplay.base.units import readable
from jointplay.estimate.gauge import cells_of_table, gravity_load, joints_of_table
from jointplay.estimate.known import excludes_zero
from jointplay.estimate.machine import preset_found
from jointplay.estimate.unknowns import (
    ROUNDING,
    STEP_DEVIATION,
    TWO_SIDED,
    Answer,
    Estimate,
    Loop,
    Unknown,
)
from jointplay.model import urdf
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import urdf_friction

if TYPE_CHECKING:
    from jointplay.scenario.presets import Preset

SCALE = 0.05
"""Relative standard deviation of a motor's scale and a dial's lever: screws are true to 0.1 %,
belts to 1 %, a lever that is measured by a ruler to 5 % (judged; from 0.02 to 0.2 as many of 150
axes are right)."""
LEAST_READINGS = 6
"""Least number of readings of a joint in one setup: zero, scale, drift, lost motion and a side
leave one to judge by."""
WARMS_MOVES = (0.7, 1.5, 3.0, 6.0)
"""Numbers of moves in which a machine may warm up (judged: the profile between two differs little;
slower warming is a parabola as well)."""
STARTS = np.array([-1.0, 0.0, 1.0])
"""Sides on which a link may have begun, which decide its first readings (measured: of 80 tables
without a run-up 99 % are right, with 21 sides 95 %; of tables by the plan as many)."""
_GRID = np.linspace(0.0, 1.0, 121)
"""Lost motions that are tried, as parts of the whole travel, and twice more about the best of them
(measured: twice as many change no answer of benchmarks/truth/lost_motion.py)."""
_PLACES = 5
"""Number of places of a plan, each come to from both sides, twice: 20 readings (judged)."""
_STRIDE = {True: 5e-4, False: math.radians(2.5)}
"""Distance of a plan's places by whether the joint slides [m, rad], unless twice the gear's play is
more (judged: several times what is usually lost, so that it is lost within one)."""
_COLUMNS = (
    "joint, setup (names), motor [mm or deg] as it was sent, in the order of the moves, reading "
    "[mm or deg] (empty: only passed), gauge arm [mm] where a joint turns and is read in mm, and "
    "pose (JOINT=X,... in rad or m)"
)


@known_keywords
@dataclass(frozen=True)
class Stairs:
    """n moves of joints back and forth, with a dial's readings; SI units."""

    joint: tuple[str, ...]
    """Joint of each move, in their order."""
    setup: tuple[str, ...]
    """Setup of each move; each setup has a zero of its own."""
    motor: np.ndarray
    """Place to which the joint was sent, shape (n,) [rad or m]."""
    reading: np.ndarray
    """Reading of the link, shape (n,) [rad or m]; nan where none was taken."""
    source: str = "the readings"
    """Name of the moves in texts, such as their file."""
    pose: tuple[str, ...] = ()
    """See `gauge.Readings`."""
    step: float = 0.0
    """Step to which the dial was read [rad or m]; zero: unknown."""

    @classmethod
    def from_csv(cls, path: str | Path, joints: Mapping[str, bool]) -> Stairs:
        """Read a CSV file, a row for each move (docs/identify.md).

        Args:
            path: the file.
            joints: the robot's joints, and whether each slides.

        Raises:
            JointplayError: see `columns.read`; a joint that the robot has not, a move without a
                place, or a joint that turns read in mm without a gauge arm.
        """
        path = Path(path)
        (_, head), *_ = files.csv_rows(path, "readings")
        names, slide = joints_of_table(path, joints, _RECIPE)
        titles = (cell.strip() for cell in head)
        angular = not slide and any(
            title.startswith("reading") and title.endswith(("deg]", "rad]")) for title in titles
        )
        way = "m" if slide else "rad"
        units = {"motor": way, "reading": "rad" if angular else "m", "gauge arm": "m"}
        cells, setups, pose = cells_of_table(path, names, units, _COLUMNS)
        motor, reading, arm = cells["motor"], cells["reading"], cells["gauge arm"]
        if (bad := np.flatnonzero(~np.isfinite(motor))).size:
            raise JointplayError(f"{path}: move {bad[0] + 1} has no motor position")
        if not np.isfinite(reading).any():
            raise JointplayError(f"{path}: no reading is filled in")
        if not slide and not angular:
            if (bad := np.flatnonzero(np.isfinite(reading) & ~(arm > 0.0))).size:
                raise JointplayError(
                    f"{path}: reading {bad[0] + 1} in mm needs a gauge arm [mm], the distance of "
                    "the dial from the axis"
                )
            step, reading = _dial_step(reading, 1e-3), reading / arm
            step /= float(np.nanmean(arm))
        else:
            step = _dial_step(reading, math.radians(1.0) if angular else 1e-3)
        return cls(tuple(names), setups, motor, reading, str(path), pose, step)


def _dial_step(readings: np.ndarray, unit: float) -> float:
    """Step of a dial: the largest 1, 2 or 5 times a power of ten `unit` that divides all readings.

    A dial resolves more steps than there are readings, else places at round numbers would look like
    a coarse dial; 0 if there is no such step.
    """
    values = readings[np.isfinite(readings)] / unit
    for power in range(0, -6, -1):
        for digit in (5.0, 2.0, 1.0):
            step = digit * 10.0**power
            even = np.abs(values / step - np.round(values / step)).max(initial=0.0) < 1e-6
            if even and len(values) * step <= np.ptp(values):
                return step * unit
    return 0.0


WEIGHTLESS = (
    "note: without a robot weight is left out: where it exceeds friction, as of an axis without "
    "counterweight, it holds the teeth to one side and no play shows"
)


def axes_of_table(path: str | Path) -> Mechanism:
    """A machine without weight that has the axes of a table, where there is no URDF.

    Axes slide if their column `motor` is in a length, else they turn.

    Raises:
        JointplayError: no column `joint` or `motor`, or no row; see `columns.read`.
    """
    path = Path(path)
    (_, head), *rows = files.csv_rows(path, "readings")
    titles = [cell.strip() for cell in head]
    names = dict.fromkeys(row[titles.index("joint")].strip() for _, row in rows)
    slides = any(t.startswith("motor") and t.endswith("m]") for t in titles)
    parts, above = ['<link name="base"/>'], "base"
    for number, name in enumerate(names):
        kind, link = "prismatic" if slides else "continuous", f"link {number}"
        limit = '<limit effort="0" velocity="0"/>' if slides else ""
        parts.append(
            f'<link name="{link}"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" '
            f'ixy="0" ixz="0" iyz="0"/></inertial></link><joint name={quoteattr(name)} '
            f'type="{kind}"><parent link="{above}"/><child link="{link}"/><axis xyz="0 0 1"/>'
            f"{limit}</joint>"
        )
        above = link
    text = f'<robot name="axes">{"".join(parts)}</robot>'
    return Mechanism(urdf.parse(text, path), gravity=(0.0, 0.0, 0.0))


_RECIPE = (
    f"a joint needs {LEAST_READINGS} readings at two places at least, each come to from both "
    "sides; --plan lost-motion writes the moves"
)


@dataclass(frozen=True, kw_only=True)
class LostMotion(Answer):
    """Estimates of joints' lost motion from moves back and forth; SI units."""

    mechanism: Mechanism
    stairs: Stairs
    loops: tuple[Loop, ...]
    """Lag of each link behind its motor, over the motor's place."""

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        known = [f"{x.joint} {x.span}" for x in self.estimates if not x.reason]
        of = f"{len(known)} of {counted(len(self.estimates), 'joint')}"
        return f"The moves tell the lost motion of {of}{f': {few(known)}' if known else ''}"

    def describe(self) -> dict[str, Any]:
        return {**super().describe(), "source": self.stairs.source}

    @property
    def plays(self) -> dict[str, float]:
        """Total lost motion of the joints where it is known [rad or m]."""
        return {x.joint: x.value for x in self.estimates if x.known}

    def preset(self, robot: str | Path | None = None) -> Preset:
        """A preset of the robot's joints with the estimates; see `Identification.preset`."""
        return preset_found(self.mechanism, self.estimates, self.stairs.source, robot)


@known_keywords
def identify_lost_motion(
    mechanism: Mechanism,
    stairs: Stairs | str | Path,
    *,
    scatter: float | None = None,
    pose: Mapping[str, float] | None = None,
) -> LostMotion:
    """Identify the total lost motion of single joints from moves back and forth.

    Args:
        mechanism: the robot.
        stairs: the moves, or the path of their CSV file.
        scatter: least standard deviation of a reading [rad or m]; None: that of rounding to the
            dial's steps.
        pose: joint positions at which was measured, for the load of gravity [rad or m]; None:
            unknown.

    Raises:
        JointplayError: see `Stairs.from_csv`; too few readings of a joint, or all from one side.
    """
    ideal = mechanism.ideal()
    entries = mechanism.description.joints
    if not isinstance(stairs, Stairs):
        stairs = Stairs.from_csv(stairs, {n: entries[n].slides for n in moving(ideal)})
    friction, estimates, loops, notes = urdf_friction(ideal), [], [], []
    for joint in dict.fromkeys(stairs.joint):
        moves = np.array([name == joint for name in stairs.joint])
        slides = entries[joint].slides
        estimate, left_out, loop = _Profile(stairs, joint, moves, slides, scatter).estimate()
        notes += left_out
        loops.append(loop)
        weight, known = gravity_load(ideal, stairs, joint, moves, pose)
        rubs, unit = friction[joint].coulomb, "N" if slides else "N*m"
        if known and weight > rubs:
            place = {joint: float(stairs.motor[moves].mean()), **(pose or {})}
            q = ideal.configuration(place)
            load = pin.computeGeneralizedGravity(ideal.model, ideal.model.createData(), q)
            side = "minus" if load[ideal.coordinate(joint)] > 0.0 else "plus"
            held = (
                f"gravity loads it by {readable(weight, unit, 3)} towards {side}, friction by "
                f"{readable(rubs, unit, 3)} by its file: its teeth lie on one side"
            )
            if estimate.bounded:
                estimate = replace(
                    estimate,
                    reason=f"{held}, and no move shows its play",
                    advice="balance the weight, measure in another pose, or push (--plan dial)",
                )
            else:
                notes.append(f"note: {joint}: {held}, unless friction is more; yet motion is lost")
        elif weight > rubs:
            notes.append(
                f"note: gravity may load {joint} by {readable(weight, unit, 3)}, more than "
                "friction by its file: if so its teeth lie on one side and no move shows its play "
                "(give the pose by --pose)"
            )
        gear = mechanism.gears.get(joint)
        if rubs and gear is not None and not estimate.bounded:
            wound = 2.0 * float(gear.wound_up(rubs) - gear.play / 2.0)
            part = readable(wound, "m" if slides else "rad", 3)
            notes.append(f"note: of this, {part} is the gear of {joint} giving way to friction")
        estimates.append(estimate)
    return LostMotion(
        estimates=tuple(estimates), mechanism=mechanism, stairs=stairs, loops=tuple(loops),
        notes=tuple(notes),
    )  # fmt: skip


def links(motor: np.ndarray, lost: float | np.ndarray, start: float | np.ndarray) -> np.ndarray:
    """Places of the link after each move, (n,): the play operator of width `lost`.

    It begins at ``motor[0] + start lost / 2``, with `start` from -1 to 1. For arrays of `lost` and
    `start` the shape is theirs, broadcast, and n.
    """
    place, behind = motor[0] + 0.5 * lost * np.asarray(start, float), []
    for target in motor:
        place = np.clip(place, target - 0.5 * lost, target + 0.5 * lost)
        behind.append(place)
    return np.stack(behind, axis=-1)


class _Profile:
    """Profile of a joint's lost motion: least sum of squares of its readings for each value."""

    def __init__(
        self, stairs: Stairs, joint: str, of_joint: np.ndarray, slides: bool, scatter: float | None
    ) -> None:
        self.joint, self.slides, self.step = joint, slides, stairs.step
        self.setups: list[tuple[np.ndarray, np.ndarray]] = []
        """Moves and readings of each setup; readings are nan where there are none."""
        names = np.array(stairs.setup)
        for name in dict.fromkeys(names[of_joint]):
            rows = np.flatnonzero(of_joint & (names == name))
            motor, reading = stairs.motor[rows], stairs.reading[rows]
            read = np.isfinite(reading)
            ways = np.sign(np.diff(motor, prepend=motor[0]))[read]
            if read.sum() < LEAST_READINGS or not (ways > 0).any() or not (ways < 0).any():
                raise JointplayError(f"{stairs.source}: {joint}: {_RECIPE}; got {int(read.sum())}")
            self.setups.append((motor, reading))
        span = max(float(np.ptp(reading[np.isfinite(reading)])) for _, reading in self.setups)
        if span == 0.0:
            raise JointplayError(
                f"{stairs.source}: {joint}: all readings are the same: the dial does not follow it"
            )
        floor = max(STEP_DEVIATION * stairs.step, ROUNDING * span)
        self.scatter = floor if scatter is None else scatter
        """Least standard deviation of a reading [rad or m]."""

    def fit(self, lost: np.ndarray, sigma: float) -> tuple[np.ndarray, list[tuple[Any, ...]]]:
        """Fit all else at lost motions (k,), for a standard deviation `sigma` of readings.

        The drift is projected out, which leaves a linear problem of the scale alone: for each side
        on which the link may have begun, and each shape of drift; the best of these is taken.

        Returns:
            Sums of squares, the scale's prior included, (k,); link, drift and scale of each setup
            at the best lost motion.
        """
        weight, total, candidates = (sigma / SCALE) ** 2, np.zeros(len(lost)), []
        for (motor, reading), drifts in zip(self.setups, self._drifts, strict=True):
            read = np.isfinite(reading)
            link = links(motor, lost[:, None], STARTS)
            tried: list[tuple[np.ndarray, np.ndarray]] = []
            for drift in drifts:
                span = np.linalg.qr(drift[read])[0]
                x, y = link[..., read], reading[read]
                x, y = x - x @ span @ span.T, y - span @ (span.T @ y)
                scale = (x @ y + weight) / (np.square(x).sum(axis=-1) + weight)
                misfit = np.square(y - scale[..., None] * x).sum(axis=-1)
                tried.append((scale, misfit + weight * np.square(scale - 1.0)))
            scales, squares = (np.array(sums) for sums in zip(*tried, strict=True))
            total += np.min(squares, axis=(0, 2))
            candidates.append((link, scales, squares))
        best, parts = int(total.argmin()), []
        for (_, reading), drifts, (link, scales, squares) in zip(
            self.setups, self._drifts, candidates, strict=True
        ):
            read = np.isfinite(reading)
            at, side = divmod(int(squares[:, best].argmin()), len(STARTS))
            place, scale, drift = link[best, side], scales[at, best, side], drifts[at]
            shift = np.linalg.lstsq(drift[read], (reading - scale * place)[read], rcond=None)[0]
            parts.append((place, drift @ shift, scale))
        return total, parts

    @property
    def _drifts(self) -> list[list[np.ndarray]]:
        """Shapes of drift that are tried in each setup, each as columns over its moves.

        A line and, with enough readings, a bend: a parabola, or an exponential, as a machine warms
        up within its first moves.
        """
        drifts = []
        for motor, reading in self.setups:
            time, moves = np.linspace(-1.0, 1.0, len(motor)), np.arange(len(motor))
            line = [np.ones(len(motor)), time]
            bends = [time**2, *(np.exp(-moves / warms) for warms in WARMS_MOVES)]
            enough = np.isfinite(reading).sum() > LEAST_READINGS
            shapes = [[*line, bend] for bend in bends] if enough else [line]
            drifts.append([np.column_stack(shape) for shape in shapes])
        return drifts

    @property
    def most(self) -> float:
        """Largest lost motion that can show: the whole travel [rad or m]."""
        return max(float(np.ptp(motor)) for motor, _ in self.setups)

    @property
    def freedom(self) -> int:
        """Degrees of freedom: lost motion is common, all else is each setup's own."""
        count = sum(int(np.isfinite(reading).sum()) for _, reading in self.setups)
        return max(count - 1 - len(self.setups) * (LEAST_READINGS - 1), 1)

    def profile(self, sigma: float) -> tuple[np.ndarray, np.ndarray]:
        """Lost motions, increasing and closer about the best, and their sums of squares."""
        grid = self.most * _GRID
        for _ in range(2):
            best = int(self.fit(grid, sigma)[0].argmin())
            low, high = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
            grid = np.unique(np.concatenate([grid, low + (high - low) * _GRID]))
        return grid, self.fit(grid, sigma)[0]

    def estimate(self) -> tuple[Estimate, list[str], Loop]:
        """Lost motion with its interval, notes, and the loop to draw."""
        notes, sigma, free = self._without_outliers(), self.scatter, self.freedom
        for _ in range(2):  # the scale's prior weighs by the scatter, which follows from the fit
            grid, squares = self.profile(sigma)
            sigma = max(math.sqrt(squares.min() / free), self.scatter)
        bound = (float(student.ppf(TWO_SIDED, free)) * sigma) ** 2 * self._alike(sigma)
        limit, value = squares.min() + bound, float(grid[squares.argmin()])
        first, last = np.flatnonzero(squares <= limit)[[0, -1]]
        # Between two points of the grid the profile is taken as linear.
        ends = [first, max(first - 1, 0)], [last, min(last + 1, len(grid) - 1)]
        low, high = (float(np.interp(limit, squares[end], grid[end])) for end in ends)
        unit = "m" if self.slides else "rad"
        unknown = Unknown(self.joint, "gear_play", unit, math.nan, self.most, most=self.most)
        estimate = Estimate(
            unknown, value, max(value - low, high - value), ends=(low, high), upper=high,
            bounded=not excludes_zero(low), note=f"one side repeats to {readable(sigma, unit, 2)}",
        )  # fmt: skip
        if high >= self.most:
            estimate = replace(
                estimate, reason="no move is longer than what may be lost", advice="move farther"
            )
        return estimate, notes, self._loop(self.fit(np.array([value]), sigma)[1], unit)

    def _alike(self, sigma: float) -> float:
        """Number of readings for each that tells something new.

        A dial that is read in steps wider than readings scatter is off by the same part of a step
        whenever it comes to the same place from the same side.
        """
        if sigma > self.step:
            return 1.0
        stops = [
            (number, place, way)
            for number, (motor, reading) in enumerate(self.setups)
            for place, way, at in zip(
                motor.tolist(), np.sign(np.diff(motor, prepend=motor[0])), reading, strict=True
            )
            if math.isfinite(at)
        ]
        return len(stops) / len(set(stops))

    def _without_outliers(self) -> list[str]:
        """Leave out readings farther off than any of normal scatter would be; notes name them."""
        grid, squares = self.profile(self.scatter)
        _, parts = self.fit(grid[[squares.argmin()]], self.scatter)
        notes = []
        for (_, reading), (link, drift, scale) in zip(self.setups, parts, strict=True):
            off = reading - drift - scale * link
            deviation = median_abs_deviation(off, scale="normal", nan_policy="omit")
            chance = (1.0 - TWO_SIDED) / np.isfinite(reading).sum()
            farthest = student.isf(chance, self.freedom) * max(deviation, self.scatter)
            if (away := np.abs(off) > farthest).any():
                reading[away] = np.nan
                moves = few([str(i + 1) for i in np.flatnonzero(away)])
                notes.append(
                    f"note: {self.joint}: readings far off the rest are left out: move {moves}"
                )
        return notes

    def _loop(self, parts: list[tuple[Any, ...]], unit: str) -> Loop:
        rows = []
        for (motor, reading), (link, drift, scale) in zip(self.setups, parts, strict=True):
            way = np.sign(np.diff(motor, prepend=motor[0]))
            rows.append((motor, (reading - drift) / scale - motor, link - motor, way))
        motors, lags, fits, ways = map(np.concatenate, zip(*rows, strict=True))
        return Loop(self.joint, motors, "motor", unit, lags, fits, unit, ways.astype(int))


def axis_letters(sliding: Sequence[str]) -> dict[str, str]:
    """Letters X, Y, Z of axes that slide: their own names, else the next that are free."""
    letters = {name: name.upper() for name in sliding if name.upper() in ("X", "Y", "Z")}
    free = [letter for letter in "XYZ" if letter not in letters.values()]
    return letters | dict(zip([n for n in sliding if n not in letters], free, strict=False))


@dataclass(frozen=True)
class LostMotionPlan:
    """A plan of moves back and forth, and a table to fill in."""

    joints: Mapping[str, tuple[bool, float, float]]
    """Whether each joint slides, where it begins, and its stride [rad or m]."""
    notes: tuple[str, ...] = ()

    def moves(self, joint: str) -> list[tuple[float, bool]]:
        """Places of a joint in their order [rad or m], and whether the dial is read at each."""
        _, begin, stride = self.joints[joint]
        places = [begin + k * stride for k in range(1, _PLACES + 1)]
        rounds = [(begin, False)]
        for _ in range(2):
            rounds += [(x, True) for x in places]
            rounds += [(places[-1] + stride, False), *((x, True) for x in reversed(places))]
            rounds.append((begin, False))
        return rounds

    def csv(self) -> str:
        """Text of a table to fill in."""
        lines: list[str] = []
        for joint, (slides, *_) in self.joints.items():
            way, size = ("mm", 1e3) if slides else ("deg", math.degrees(1.0))
            lines += [] if lines else [f"joint,motor [{way}],reading [{way}]"]
            turns = [i for i, (_, read) in enumerate(self.moves(joint), 1) if not read]
            rows = ", ".join(map(str, turns))
            lines.append(f"# rows {rows} of {joint} only turn back: leave their readings empty")
            lines += [f"{joint},{size * x:.6g}," for x, _ in self.moves(joint)]
        return "\n".join(lines) + "\n"

    def gcode(self) -> str:
        """G-code of the moves of axes that slide; each stop at which the dial is read waits."""
        sliding = [joint for joint, (slides, *_) in self.joints.items() if slides]
        lines = ["; lost motion: read the dial at each M0", "G21", "G90"]
        for joint, letter in axis_letters(sliding).items():
            for x, read in self.moves(joint):
                lines.append(f"G1 {letter}{1e3 * x:.4f} F300")
                lines += [f"M0 ; {joint}"] * read
        return "\n".join(lines) + "\n"

    def __str__(self) -> str:
        rows = [
            f"{number}. {joint}: {_PLACES} places from both sides, twice, "
            f"{_shown(stride, slides)} apart from {_shown(begin, slides)} on"
            for number, (joint, (slides, begin, stride)) in enumerate(self.joints.items(), 1)
        ]
        how = (
            "Set a dial on what the joint moves, send it to each place, and write down the reading."
        )
        return "\n".join([*self.notes, *rows, how])


def _shown(value: float, slides: bool) -> str:
    """Text of a place in the unit of the table."""
    return f"{1e3 * value:.3g} mm" if slides else f"{math.degrees(value):.3g} deg"


@known_keywords
def plan_lost_motion(mechanism: Mechanism, joints: Sequence[str] = ()) -> LostMotionPlan:
    """Plan moves that tell the lost motion of joints; none named: of all that move.

    Raises:
        MissingName: no such joint.
        JointplayError: joints that turn and joints that slide: a table is of one kind.
    """
    ideal = mechanism.ideal()
    known, entries = moving(ideal), mechanism.description.joints
    for name in joints:
        require_known("joint that moves", name, known)
    names = list(joints) or known
    sliding = [name for name in names if entries[name].slides]
    if 0 < len(sliding) < len(names):
        turning = [name for name in names if name not in sliding]
        raise JointplayError(
            f"a table is of joints that turn ({few(turning)}) or slide ({few(sliding)}), not both: "
            "name those to measure, in Python by joints, in the command line by --gear NAME"
        )
    moves, notes = {}, []
    for name in names:
        slides = entries[name].slides
        gear = mechanism.gears.get(name)
        stride = max(_STRIDE[slides], 0.0 if gear is None else 2.0 * gear.play)
        neutral = entries[name].neutral
        lower, upper = entries[name].lower, entries[name].upper
        span = (_PLACES + 1) * stride
        if lower is not None and upper is not None:
            if upper - lower < span:
                stride, span = (upper - lower) / (_PLACES + 1), upper - lower
                notes.append(f"note: {name} has no room for more: its moves are short")
            neutral = min(max(neutral, lower), upper - span)
        moves[name] = slides, neutral, stride
    return LostMotionPlan(moves, tuple(notes))
