"""Reference motions in joint space: waypoints or samples, and the curve through them."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from jointplay.base import files
from jointplay.base.errors import (
    JointplayError,
    require_a,
    require_increasing,
    require_known,
    require_numbers,
    require_positive,
)
from jointplay.base.schema import Described, quantity
from jointplay.base.tables import Column, Table, counted, few
from jointplay.base.units import convert, plain_number, titled

REFERENCE_NODE_S = 1e-4
"""Interval at which the reference is tabulated; between nodes it is linear [s].

At 30 rad/s^2 the tabulated position is within 4e-8 rad of the curve. Prescribed motion is
interpolated by cubics.
"""

INTERPOLATIONS = ("rest-to-rest", "spline", "constant-speed", "speed-ramps")

GOES_ON = INTERPOLATIONS[2:]
"""Interpolations that do not stand still after the last waypoint."""
ENOUGH_SAMPLES = 12
"""Number of points from which waypoints are rarely taken for samples: with waypoints drawn anywhere
one joint follows as closely by chance in 0.1 %, with each drawn about the last one in 8 % of all
cases. With fewer points the limit is in proportion to their number, which keeps these chances."""
SAMPLED_S = 0.025
"""Spacing below which points are samples [s]: no mechanism stops 40 times a second."""
RESTS = 0.01
"""Speed of a joint at an end, relative to its largest, below which it is at rest there (judged:
what noise and the spline's own error come to). Noise that changes speeds by less is none."""
NOISY = 0.25
"""Share of noise in the squares of accelerations from which on it is reported: half the root mean
square (judged). It is seen in fourth differences, whose squares are 70 / 6 times those of second
differences in white noise, and less than these in a sine sampled 6 times a period."""

_SAYS = re.compile(r"#\s*interpolation:\s*(\S+)")
"""The comment of a file that says how it is interpolated."""


def are_samples(times: np.ndarray, positions: np.ndarray) -> bool:
    """Whether points (n,) [s], (n, joints) are samples of a motion, not waypoints to stop at.

    Samples follow each other so closely that the speed changes less from one to the next than its
    own size (root mean squares over all joints, 1 m counting as 1 rad): a sine with more than six
    samples a period does, with fewer than `ENOUGH_SAMPLES` in all one with more. Speeds are taken
    by the times, or as if evenly spaced, since time stamps of a log scatter. Between waypoints
    joints turn back, or pause. Encoder counts at a high rate are recognised by their spacing in
    time alone (`SAMPLED_S`).
    """
    if len(times) < 6:  # what a spline of fifth order needs
        return False
    spans = np.diff(times)
    limit = min(len(times) / ENOUGH_SAMPLES, 1.0)
    steps = np.diff(positions, axis=0)
    smooth = any(
        (np.diff(speeds, axis=0) ** 2).sum() < limit * (speeds**2).sum()
        for speeds in (steps / spans[:, None], steps)
    )
    return bool(np.median(spans) < SAMPLED_S or smooth)


def _spline(times: np.ndarray, positions: np.ndarray) -> Any:
    """A quintic spline, through samples with free ends (not-a-knot), else at rest at both ends.

    At an end where samples are nearly at rest, speed and acceleration are set to zero.
    """
    from scipy.interpolate import make_interp_spline  # takes long to import

    ends = np.zeros((2, 2, positions.shape[1]))  # speeds and accelerations at both
    if are_samples(times, positions):
        free = make_interp_spline(times, positions, k=5)
        for order, values in enumerate(ends, 1):
            curve = free.derivative(order)
            values[:] = curve(times[[0, -1]])
            values[np.abs(values) < RESTS * np.abs(curve(times)).max(axis=0)] = 0.0
    bound = [[(order, ends[order - 1, end]) for order in (1, 2)] for end in (0, 1)]
    return make_interp_spline(times, positions, k=5, bc_type=tuple(bound))


@dataclass(frozen=True)
class _Polynomials:
    """Polynomials in pieces. SciPy, which has them, takes longer to import than a short run."""

    c: np.ndarray
    """Coefficients of each piece in the time since its beginning, the highest power first, shape
    (degree + 1, pieces, joints) [rad or m, by powers of s]."""
    ends: np.ndarray
    """Times at which pieces begin, and the last one ends, shape (pieces + 1,) [s]."""

    @classmethod
    def of_corners(cls, corners: Sequence[np.ndarray], ends: np.ndarray) -> _Polynomials:
        """From Bernstein coefficients of each degree, shape (pieces, joints) each [rad or m]."""
        degree, spans = len(corners) - 1, np.diff(ends)[:, None]
        c = np.zeros((len(corners), *corners[0].shape))
        for a, corner in enumerate(corners):
            factor = (-1) ** a * math.comb(degree, a) * corner
            for power in range(a, degree + 1):
                value = math.comb(degree - a, power - a) * (-1) ** power
                c[degree - power] += factor * value / spans**power
        return cls(c, ends)

    def derivative(self, order: int) -> _Polynomials:
        c = self.c
        for _ in range(order):
            c = np.polynomial.polynomial.polyder(c[::-1])[::-1]
        return _Polynomials(c, self.ends)

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Values at `times` (n,) [s], (n, joints); the first and the last piece go on."""
        piece = np.clip(np.searchsorted(self.ends, times, "right") - 1, 0, len(self.ends) - 2)
        since = (times - self.ends[piece])[:, None]
        values, power = np.zeros((len(times), self.c.shape[2])), 1.0
        for coefficients in self.c[::-1]:
            values, power = values + coefficients[piece] * power, power * since
        return values


def motion_csv(
    joints: Sequence[str], times: np.ndarray, positions: np.ndarray, interpolation: str
) -> str:
    """The text of a file that `Motion.from_csv` reads, its interpolation in a comment."""
    columns = zip(joints, positions.T, strict=True)
    table = Table([Column("time", times, "s"), *(Column(n, q, key=n) for n, q in columns)])
    return f"# interpolation: {interpolation}\n{table.csv(None)}"


def check_waypoints(values: Mapping[str, np.ndarray]) -> None:
    """Refuse values of waypoints, by name, that are not finite, and "times" that do not rise."""
    for name, rows in values.items():
        bad = np.flatnonzero(~np.isfinite(rows).reshape(len(rows), -1).all(axis=1))
        if bad.size:
            raise JointplayError(
                f"{name} must be finite; waypoint {bad[0] + 1} is not", (name, int(bad[0]))
            )
    require_increasing("waypoint times", values["times"].tolist(), "s", ("times",))


@dataclass(frozen=True)
class WrittenMotion:
    """A motion as it stands in files."""

    joints: tuple[str, ...]
    times: list[float] = quantity("s")
    positions: list[list[float]] = quantity("rad", "m")
    interpolation: str | None = None
    given: list[float] | None = quantity("s", default=None)


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Motion(Described):
    """A curve of joint positions through waypoints. Equal motions have the same waypoints.

    Raises:
        JointplayError: wrong shapes, non-finite numbers, times that do not increase, speeds that
            are not constant.
    """

    written = WrittenMotion

    joints: tuple[str, ...]
    """Names of the joints, one for each column of `positions`."""
    times: np.ndarray
    """Times of the points that the curve goes through, increasing, shape (n,), n >= 2 [s]."""
    positions: np.ndarray
    """Joint positions at them, shape (n, joints) [rad, or m for prismatic joints]."""
    interpolation: str
    """How joints move between waypoints.

    If not given, it follows from the points (`are_samples`): ``spline`` for samples, else
    ``rest-to-rest``. ``rest-to-rest`` stops at each waypoint, moving by quintics with zero velocity
    and acceleration at both ends; ``spline`` passes through them without stopping (quintic; samples
    keep their speed at both ends, waypoints begin and end at rest); ``constant-speed`` moves at the
    speed that joins the waypoints, which must be the same between all of them, and goes on with it
    after the last (a crank); ``speed-ramps`` begins at the speed that joins the first two waypoints
    and changes it evenly on the way to each of the others, without a jump; it goes on with its last
    speed (a crank that is run up).
    """
    given: np.ndarray | None
    """Times of the waypoints if other points were computed between them, as on a line of the tool:
    from the first point to the last, increasing, shape (m,), m >= 2 [s]; None: all are waypoints.
    """
    units: ClassVar[Mapping[str, str]] = {}
    """SI units of the joints for which the motion's file states one; not compared or written."""

    def __init__(
        self,
        joints: Sequence[str],
        times: Sequence[float] | np.ndarray,
        positions: Sequence[Sequence[float]] | np.ndarray,
        interpolation: str | None = None,
        given: Sequence[float] | np.ndarray | None = None,
    ) -> None:
        require_a("joints", joints, "Iterable")
        object.__setattr__(self, "joints", tuple(joints))
        object.__setattr__(self, "given", None)
        arrays = {"times": times, "positions": positions}
        for name, numbers in (arrays if given is None else {**arrays, "given": given}).items():
            values = require_numbers("waypoints", numbers, (name,))
            values.flags.writeable = False
            object.__setattr__(self, name, values)
        self._check()
        if interpolation is None:
            interpolation = INTERPOLATIONS[are_samples(self.times, self.positions)]
        require_known("interpolation", interpolation, INTERPOLATIONS, where=("interpolation",))
        object.__setattr__(self, "interpolation", interpolation)
        with np.errstate(all="ignore"):  # refused below
            curve = self._fit()
            curves = (curve, curve.derivative(1), curve.derivative(2))
        object.__setattr__(self, "_curves", curves)
        if not all(np.isfinite(polynomial.c).all() for polynomial in curves):
            raise JointplayError(
                "the motion's accelerations overflow: its waypoints are too far apart"
            )

    def _check(self) -> None:
        if len(set(self.joints)) != len(self.joints):
            raise JointplayError(f"a joint appears twice in the motion: {', '.join(self.joints)}")
        if self.times.ndim != 1 or self.positions.shape != (len(self.times), len(self.joints)):
            raise JointplayError(
                f"positions must have the shape (times, joints) = "
                f"({self.times.size}, {len(self.joints)}), got {self.positions.shape}"
            )
        if len(self.times) < 2:
            raise JointplayError(f"a motion needs at least 2 waypoints, got {len(self.times)}")
        check_waypoints({"times": self.times, "positions": self.positions})
        if self.given is not None:
            ends = self.times[[0, -1]]
            if self.given.ndim != 1 or not np.array_equal(self.given[[0, -1]], ends):
                needed = f"must be at times from {ends[0]:g} to {ends[1]:g} s"
                raise JointplayError(f"given waypoints {needed}, got {self.given}", ("given",))
            require_increasing("given waypoints", self.given.tolist(), "s", ("given",))

    def _fit(self) -> Any:
        if self.interpolation == "rest-to-rest":
            return _Polynomials.of_corners(
                [self.positions[:-1]] * 3 + [self.positions[1:]] * 3, self.times
            )
        if self.interpolation == "spline":
            return _spline(self.times, self.positions)
        spans = np.diff(self.times)[:, None]
        means = np.diff(self.positions, axis=0) / spans
        if self.interpolation == "constant-speed":
            if not np.allclose(means, means[0], rtol=1e-6, atol=1e-9):
                raise JointplayError(
                    "constant-speed needs the same speed between all waypoints, got "
                    f"{means[:, np.ptp(means, axis=0).argmax()]} rad/s or m/s"
                )
            return _Polynomials(np.stack([means[:1], self.positions[:1]]), self.times[[0, -1]])
        # Speed ramps: parabolas whose speeds meet; after them a straight line.
        speeds = [means[0]]
        for mean in means:
            speeds.append(2.0 * mean - speeds[-1])
        bends = np.diff(speeds, axis=0) / (2.0 * spans)
        pieces = [np.vstack([bends, 0.0 * means[:1]]), np.array(speeds), self.positions]
        ends = np.append(self.times, 2.0 * self.times[-1] - self.times[-2])
        return _Polynomials(np.stack(pieces), ends)

    @property
    def waypoints(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (m,) [s] and joint positions (m, joints) [rad or m] of the waypoints."""
        if self.given is None:
            return self.times, self.positions
        return self.given, self(self.given)[0]

    @property
    def summary(self) -> str:
        number = len(self.waypoints[0])
        through = f" through {len(self.times)} points" if number < len(self.times) else ""
        noun = "sample" if self.samples else "waypoint"
        return f"{counted(number, noun)}, {self.interpolation}{through}"

    @property
    def samples(self) -> bool:
        """Whether the points are samples, with a spline through them."""
        spline = self.given is None and self.interpolation == "spline"
        return spline and are_samples(self.times, self.positions)

    def cut_off(self, until: float) -> dict[str, float]:
        """Largest jump of each joint's speed in a run to `until` [s], of those that have one: where
        the motion begins after the run does, or ends before, at speed [rad/s or m/s].
        """
        if self.interpolation != "spline":
            return {}
        cut = [self.times[0] > 0.0, self.times[-1] < until]
        lost = np.abs(self(self.times[[0, -1]])[1][cut]).max(axis=0, initial=0.0)
        moves = lost > RESTS * np.abs(self(self.times)[1]).max(axis=0)
        return {self.joints[k]: float(lost[k]) for k in np.flatnonzero(moves)}

    @property
    def noise(self) -> dict[str, float]:
        """Largest acceleration of each joint whose speed jumps from sample to sample, by noise of
        positions or of time stamps, or at corners [rad/s^2 or m/s^2].
        """
        if not self.samples or len(self.times) < ENOUGH_SAMPLES:
            return {}
        speeds = np.diff(self.positions, axis=0) / np.diff(self.times)[:, None]
        turns = np.diff(speeds, axis=0)
        rough, turned, moved = (
            (differences**2).sum(axis=0)
            for differences in (np.diff(turns, 2, axis=0), turns, speeds)
        )
        noisy = (rough * 6.0 / 70.0 > NOISY * turned) & (turned > RESTS**2 * moved)
        most = np.abs(self(self.times)[2]).max(axis=0)
        return {self.joints[k]: float(most[k]) for k in np.flatnonzero(noisy)}

    @property
    def duration(self) -> float:
        """Time of the last waypoint [s]."""
        return float(self.times[-1])

    @property
    def still_from(self) -> float:
        """Time from which all joints stand still [s]; inf if they go on."""
        return math.inf if self.interpolation in GOES_ON else self.duration

    def __call__(self, time: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Position, velocity and acceleration at the times `time` (n,) [s], (n, joints) [rad or m]
        each.

        Before the first waypoint and after the last the joints stand still, but for constant speed
        and speed ramps, which go on.
        """
        time = np.asarray(time, float)
        position, speed, acceleration = vars(self)["_curves"]
        if self.interpolation in GOES_ON:
            return position(time), speed(time), acceleration(time)
        inside = (time >= self.times[0]) & (time <= self.times[-1])
        held = np.clip(time, self.times[0], self.times[-1])
        moving = inside[:, None]
        return (
            position(held),
            np.where(moving, speed(held), 0.0),
            np.where(moving, acceleration(held), 0.0),
        )

    def at_speed(self, factor: float) -> Motion:
        """The same path at `factor` times the speed; `factor` must be positive."""
        require_positive("factor of the speed", factor, "")
        given = None if self.given is None else self.given / factor
        return Motion(self.joints, self.times / factor, self.positions, self.interpolation, given)

    @classmethod
    def from_csv(cls, path: str | Path, interpolation: str | None = None) -> Motion:
        """Read points from a CSV file whose header is ``time_s,<joint>,<joint>,...``.

        Lines beginning with # are comments; one before the header such as ``# interpolation:
        spline`` counts if `interpolation` is None. Positions are in rad, or m for prismatic joints,
        or in the unit that the header names: ``time [s],elbow [deg]``.

        Raises:
            JointplayError: no such file, a wrong header, a cell that is not a number (with its line
                and column), or waypoints that make no motion.
        """
        path = Path(path)
        rows = files.csv_rows(path, "motion")
        header = [cell.strip() for cell in rows[0][1]]
        names, stated = zip(*map(titled, header), strict=True)
        timed = header[0] == "time_s" or (names[0] == "time" and stated[0])
        if not timed or len(header) < 2:
            raise JointplayError(
                f"{path}, line {rows[0][0]}: the header must be time_s,<joint>,..., or with units "
                f"time [s],<joint> [deg],..., got {','.join(header)!r}"
            )
        scales = np.ones(len(header))
        units: dict[str, str] = {}
        for column, unit in enumerate(stated):
            if unit:
                try:
                    scale = convert(f"1 {unit}", *(("rad", "m") if column else ("s",)))
                except ValueError as error:
                    where = f"{path}, line {rows[0][0]}, {header[column]!r}"
                    raise JointplayError(f"{where}: {error}") from None
                scales[column] = scale
                units |= {names[column]: scale.unit} if column else {}
        values = []
        for number, row in rows[1:]:
            cells = []
            for name, cell in zip(header, row, strict=True):
                try:
                    cells.append(plain_number(cell))
                except ValueError:
                    raise JointplayError(
                        f"{path}, line {number}: {name} must be a number, got {cell.strip()!r}"
                    ) from None
            values.append(cells)
        if not values:
            raise JointplayError(f"the motion {str(path)!r} has no waypoints")
        table = scales * np.array(values)
        if interpolation is None:
            above = files.read_text(path, "motion").splitlines()[: rows[0][0] - 1]
            named = [match[1] for line in above if (match := _SAYS.fullmatch(line.strip()))]
            interpolation = named[0] if named else None
        motion = cls(names[1:], table[:, 0], table[:, 1:], interpolation)
        object.__setattr__(motion, "units", units)
        return motion

    def csv(self) -> str:
        """The text of a file that `from_csv` reads, in which all points are waypoints."""
        return motion_csv(self.joints, self.times, self.positions, self.interpolation)

    @classmethod
    def from_mcap(
        cls, path: str | Path, topic: str | None = None, interpolation: str | None = None
    ) -> Motion:
        """Read a ROS 2 bag (MCAP) with JointTrajectory or JointState messages.

        Needs the extra ``ros``. The time of joint states begins with the first of them.

        Args:
            path: the file.
            topic: its topic; None takes the only one, and of several that with trajectories.
            interpolation: see the class.

        Raises:
            JointplayError: see `motion.rosbag.read`; also positions that make no motion.
        """
        from jointplay.simulation.motion import rosbag

        joints, times, positions = rosbag.read(path, topic)
        try:
            return cls(joints, times, positions, interpolation)
        except JointplayError as error:
            raise JointplayError(f"{path}: {error}") from None

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Motion) and self.describe() == other.describe()

    def __hash__(self) -> int:
        return hash((self.joints, self.times.tobytes(), self.positions.tobytes()))

    def __repr__(self) -> str:
        return (
            f"<jointplay Motion: {few(list(self.joints))}; {len(self.waypoints[0])} waypoints in "
            f"{self.duration:g} s, {self.interpolation}>"
        )
