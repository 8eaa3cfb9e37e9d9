"""Play of single joints from readings of a dial gauge, while the link is pushed to both sides.

The motor holds the joint, its link is pushed with known torques tau, and the gauge reads how far it
turns. Play gives way fully under the smallest push, elasticity by the push:

    reading = zero + s (p / 2 + c T ((|tau| - F) / T)^x),      s = sign(tau),

with the play p, the compliance c under the largest push T, and friction F on the joint's side
(`_bent`). Teeth stiffen under load, by an exponent x between about 0.4 and 1.1: two forces do not
tell this from play, which widens its interval; a third one does. Laws that are no power stray from
it a little (`_LAW_SPREAD`). Readings without a push lie anywhere within the play, and only serve as
a check.

A play is known if its interval excludes zero (`known`), unless gravity, which may hold the teeth to
one side all the time, exceeds the smallest push.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.accuracy.poses import moving, over_workspace
from jointplay.base import files
from jointplay.base.errors import JointplayError, require_known, require_positive
from jointplay.base.pairs import name_and_number
from jointplay.base.schema import known_keywords
from jointplay.base.tables import counted, few
from jointplay.base.units import NUMBER, convert, readable, rounded
from jointplay.estimate import columns
from jointplay.estimate.known import excludes_zero, narrow
from jointplay.estimate.least_squares import Fit, LeastSquares, search
from jointplay.estimate.machine import preset_found
from jointplay.estimate.measurement import quantisation
from jointplay.estimate.planning import POSES, PUSH_N, free_poses
from jointplay.estimate.unknowns import (
    FARTHEST_M,
    MINOR,
    MODEL_ERROR,
    TINY,
    Answer,
    Estimate,
    Loop,
    Unknown,
)
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import urdf_friction

if TYPE_CHECKING:
    from jointplay.estimate.lost_motion import Stairs
    from jointplay.scenario.presets import Preset

GAUGE_M, ANGLE = 10e-6, 1e-3
"""Standard deviations of a reading of a gauge, and of an angle, where none is given [m, rad]
(judged: a gauge's division, and of the order of a count of a servo's encoder)."""
SIZES = (1.0, 0.4, 0.15)
"""Pushes of a plan, as parts of the largest (judged)."""
RECIPE = (
    "needed are five readings: not pushed, and pushed to each side with two forces, the smaller at "
    "most two thirds of the larger"
)
_EFFORT_SHARE = 0.02
"""Largest push of a plan, as a part of a joint's limit of effort, unless gravity and friction need
more (judged)."""
_FORCE_RATIO = 1.5
"""Least ratio of two forces that count as different: that of `RECIPE`."""
_SCATTER_RESIDUALS = 10.0
"""Number of residuals that the stated scatter of readings is worth: it is then known to a quarter,
1/sqrt(2 n) (judged: from 5 to 20 the same plays of 60 joints of benchmarks/truth/gauge.py are
known, and all intervals hold)."""
_EXPONENT, _EXPONENT_SPREAD, _LEAST_EXPONENT = 0.75, 0.2, 0.3
"""Exponent by which teeth wind up: expected, its prior deviation, and the least. Hertz's contact of
balls has 2/3, straight teeth nearly 1, strain wave gears and worn teeth 0.5 (judged: a deviation of
0.15 narrows intervals of these 60 joints by 8 %, 0.3 widens them by 20 %; all hold)."""
_LAW_SPREAD = 0.1
"""Standard deviation by which the wind-up strays from a power of the push half way to the largest,
as a part of its largest: a gear whose stiffness has steps (judged: 0.05 narrows these intervals by
14 %, 0.2 widens them by 40 %; all hold)."""
_FRICTION = 0.1
"""Expected friction on the joint's side, as a part of the smallest push, where the robot's file
says nothing (judged: from 0.05 to 0.2 the same plays are known)."""
_BAR_M, _SHORT_M = 0.1, 0.02
"""Length of a bar that is clamped to a link, and length below which a link needs one [m] (judged:
it only writes the plan)."""
_GAUGE_RANGE_RAD = math.sqrt(6.0 * MODEL_ERROR)
"""Largest angle between readings that a gauge follows, for its stem is straight: a sine is less
than this angle by `MODEL_ERROR` [rad]."""
_OUTLIER = 4.0
"""Standard deviations beyond both sides from which on a reading is said to be wrong: chance makes
one of 16,000."""
_HOW = (
    "For each joint: hold the motors, set the gauge, and write down what it reads without a push "
    "and under each push; a push is positive if it makes the reading grow. Weights on a string or "
    "a spring balance will do. Write down the motor's own position as well, if you can."
)
_COLUMNS = (
    "joint, setup (names), force [N], arm [mm], reading [mm], gauge arm [mm], or torque [N*m], "
    "angle [deg], motor [deg], and pose (JOINT=X,... in rad or m)"
)


@known_keywords
@dataclass(frozen=True)
class Readings:
    """n turns of links under pushes; SI units, of joints that slide forces and lengths."""

    joint: tuple[str, ...]
    """Joint of each reading."""
    setup: tuple[str, ...]
    """Setup of each reading; each setup has a zero of its own."""
    push: np.ndarray
    """Torque about the joint's axis, shape (n,) [N m or N]."""
    turned: np.ndarray
    """Turn of the link from its motor, positive as a positive push, (n,) [rad or m]."""
    error: np.ndarray
    """Standard deviations of the turns, shape (n,)."""
    source: str = "the readings"
    """Name of the readings in texts, such as their file."""
    pose: tuple[str, ...] = ()
    """Pose of each reading, as ``JOINT=X,...`` [rad or m]; empty: unknown."""

    @classmethod
    def from_csv(
        cls, path: str | Path, joints: Mapping[str, bool], noise: Mapping[str, float] | None = None
    ) -> Readings:
        """Read a CSV file, a row for each reading (docs/identify.md).

        Args:
            path: the file.
            joints: the robot's joints, and whether each slides.
            noise: standard deviations of readings, ``tool``, and of angles, ``link`` [m, rad].

        Raises:
            JointplayError: see `columns.read`; a joint that the robot has not, or a row without
                force or reading.
        """
        path = Path(path)
        names, slides_all = joints_of_table(path, joints, RECIPE)
        unit = "m" if slides_all else "rad"
        units = {"force": "N", "arm": "m", "reading": "m", "gauge arm": "m", "torque": "N*m"}
        units |= {"angle": unit, "motor": unit}
        cells, all_setups, pose = cells_of_table(path, names, units, _COLUMNS)
        n, deviations = len(names), dict(noise or {})
        for name in ("arm", "gauge arm"):
            if (far := float(np.nanmax(cells[name], initial=0.0))) > FARTHEST_M:
                raise JointplayError(
                    f"{path}: the {name} is {readable(far, 'm', 3)} long, longer than any robot: "
                    "is it in the unit of its title?"
                )
        if slides_all:
            push, turned = cells["force"], cells["reading"]
            error = np.full(n, deviations.get("tool", GAUGE_M))
        else:
            push = np.where(
                np.isfinite(cells["torque"]), cells["torque"], cells["force"] * cells["arm"]
            )
            push = np.where(cells["force"] == 0.0, 0.0, push)
            by_gauge = cells["reading"] / cells["gauge arm"]
            turned = np.where(np.isfinite(cells["angle"]), cells["angle"], by_gauge)
            error = np.where(
                np.isfinite(cells["angle"]),
                deviations.get("link", ANGLE),
                deviations.get("tool", GAUGE_M) / cells["gauge arm"],
            )
        for quantity, values in (
            ("force and arm, or torque", push), ("reading and gauge arm, or angle", turned),
        ):  # fmt: skip
            if (bad := np.flatnonzero(~np.isfinite(values))).size:
                needed = quantity if not slides_all else quantity.partition(" and")[0]
                raise JointplayError(f"{path}: reading {bad[0] + 1} has no {needed}")
        setups = np.array(all_setups)
        for name in np.unique(setups) if not slides_all else ():
            by_this = by_gauge[setups == name]  # NaN of angles, which may be large
            if (apart := float(np.ptp(by_this))) > _GAUGE_RANGE_RAD:
                raise JointplayError(
                    f"{path}: by these readings {names[int(np.argmax(setups == name))]} turns by "
                    f"{readable(apart, 'rad', 3)}, which no gauge follows: are reading and gauge "
                    "arm in the units of their titles?"
                )
        motor = cells["motor"]
        if np.isfinite(motor).any():
            if (bad := np.flatnonzero(~np.isfinite(motor))).size:
                raise JointplayError(f"{path}: reading {bad[0] + 1} has no motor position")
            for name in np.unique(setups):  # the motor gives way to a push: this says its sign
                of_setup = setups == name
                side = float(np.sign(motor[of_setup] @ (push[of_setup] - push[of_setup].mean())))
                turned[of_setup] -= side * (motor[of_setup] - motor[of_setup].mean())
                error[of_setup] = np.hypot(error[of_setup], quantisation(np.sort(motor[of_setup])))
        return cls(tuple(names), all_setups, push, turned, error, str(path), pose)


def joints_of_table(path: Path, joints: Mapping[str, bool], needed: str) -> tuple[list[str], bool]:
    """The joint of each row of a table, and whether they slide; `needed` is the recipe."""
    (_, head), *rows = files.csv_rows(path, "readings")
    titles = [cell.strip() for cell in head]
    if "joint" not in titles:
        raise JointplayError(f"{path} has no column 'joint'; columns are: {_COLUMNS}")
    names = [row[titles.index("joint")].strip() for _, row in rows]
    if not names:
        raise JointplayError(f"{path} has no readings: {needed}")
    for name in names:
        require_known("joint", name, joints)
    slides = {joints[name] for name in names}
    if len(slides) > 1:
        raise JointplayError(f"{path}: joints that slide need a file of their own")
    return names, slides.pop()


def cells_of_table(
    path: Path, joints: Sequence[str], units: Mapping[str, str], choices: str
) -> tuple[dict[str, np.ndarray], tuple[str, ...], tuple[str, ...]]:
    """Numbers by column of `units`, nan where empty, (n,) each [SI]; setup and pose of each row."""

    def known(title: str) -> tuple[columns.Key, str] | None:
        title = title.replace("_", " ")
        return ((title, ""), units[title]) if title in units else None

    labels = ("joint", "setup", "pose")
    numbers, texts = columns.read(path, "readings", known, choices, labels, units)
    cells = {name: numbers.get((name, ""), np.full(len(joints), np.nan)) for name in units}
    setup = texts.get("setup", ("",) * len(joints))
    setups = tuple(f"{a}, {b}" for a, b in zip(joints, setup, strict=True))
    return cells, setups, texts.get("pose", ())


@dataclass(frozen=True, kw_only=True)
class Gauged(Answer):
    """Estimates of the play and the compliance of joints from readings; SI units."""

    mechanism: Mechanism
    readings: Readings
    fits: Mapping[str, Fit]
    """Fit of each joint."""

    @property
    def sentence(self) -> str:
        """The answer in one sentence."""
        plays = [estimate for estimate in self.estimates if estimate.unknown.name == "gear_play"]
        known = [f"{estimate.joint} {estimate.span}" for estimate in plays if not estimate.reason]
        of = f"{len(known)} of {counted(len(plays), 'joint')}"
        return f"The readings tell the play of {of}{f': {few(known)}' if known else ''}"

    def describe(self) -> dict[str, Any]:
        return {**super().describe(), "source": self.readings.source}

    def preset(self, robot: str | Path | None = None) -> Preset:
        """A preset of the robot's joints with the estimates; see `Identification.preset`."""
        turning = [
            estimate for estimate in self.estimates if estimate.unknown.unit.startswith("rad")
        ]
        return preset_found(self.mechanism, turning, self.readings.source, robot)

    @property
    def loops(self) -> tuple[Loop, ...]:
        """Loops of the joints: turn of the link over the push, from the zero of its setup."""
        return tuple(self._loop(joint, fitted) for joint, fitted in self.fits.items())

    def _loop(self, joint: str, fitted: Fit) -> Loop:
        of_joint = np.array([name == joint for name in self.readings.joint])
        setup, push = np.array(self.readings.setup)[of_joint], self.readings.push[of_joint]
        largest = float(np.abs(push).max())
        turned, bent = self.readings.turned[of_joint].copy(), _bent(push, largest, *fitted.theta)
        bent[push == 0.0] = np.nan  # anywhere within the play
        for name in np.unique(setup):
            turned[setup == name] -= np.nanmean((turned - bent)[setup == name])
        none = np.array([-TINY, TINY])  # where the branches begin
        unit = fitted.least.unknowns[0].unit
        return Loop(
            joint, np.append(push, none), "push", "N" if unit == "m" else "N*m",
            np.append(turned, [np.nan] * 2), np.append(bent, _bent(none, largest, *fitted.theta)),
            unit,
            np.sign(np.append(push, none)).astype(int),
        )  # fmt: skip


@known_keywords
def identify_gauged(
    mechanism: Mechanism,
    readings: Readings | str | Path,
    *,
    noise: Mapping[str, float] | None = None,
    pose: Mapping[str, float] | None = None,
    progress: bool = False,
) -> Gauged:
    """Identify play and compliance of single joints from readings of a dial gauge.

    Args:
        mechanism: the robot.
        readings: readings, or the path of their CSV file.
        noise: see `Readings.from_csv`.
        pose: joint positions at which was measured, for the load of gravity [rad or m]; None:
            unknown.
        progress: show a bar where a joint takes longer than 2 s.

    Raises:
        JointplayError: see `Readings.from_csv`; readings of a joint that can tell nothing.
    """
    ideal, readings = mechanism.ideal(), _read(mechanism, readings, noise)
    friction, estimates, fits, notes = urdf_friction(ideal), list[Estimate](), dict[str, Fit](), []
    for joint, of_joint, slides in _by_joint(mechanism, readings):
        smallest, unit = _smallest(readings, of_joint), "N" if slides else "N*m"
        weight, posed = gravity_load(ideal, readings, joint, of_joint, pose)
        _require_yielding(readings, joint, of_joint)
        problem = _problem(readings, joint, of_joint, friction[joint].coulomb, slides)
        scale, expected = problem.scale, [unknown.nominal for unknown in problem.unknowns]
        start = np.array([0.5 * scale[0], scale[1], *expected[2:]])
        fitted = fits[joint] = search(problem, start, progress)
        play, compliance, *_ = fitted.estimates()
        # Gravity that exceeds a push may have held the teeth to one side all the time.
        shows = excludes_zero(play.value - play.half_width)
        reason = ""
        if weight >= smallest:
            loads = (
                f"{readable(weight, unit, 3)}, more than the smallest push, "
                f"{readable(smallest, unit, 3)}"
            )
            if posed:
                reason = f"gravity loads it by {loads}: push harder, or measure in another pose"
            elif not shows:
                reason = (
                    f"gravity may load it by {loads}: say in which pose it was (--pose, or a "
                    "column pose as --plan dial writes it)"
                )
            else:
                notes.append(
                    f"note: gravity may load {joint} by {loads}: it counts only if the pose is one "
                    "in which gravity does not (give it by --pose, or in a column pose)"
                )
        if reason:
            play = replace(play, reason=reason)
        else:
            upper = play.value + play.half_width
            play = replace(play, reason="", bounded=not shows, upper=upper)
        estimates += [play, compliance]
        # Notes on what would tell more, and on what cannot be right.
        vague = not narrow(play.unknown, play.value, play.half_width)
        if vague and _forces(readings, of_joint) == 2:
            notes.append(
                f"note: two forces do not tell the play of {joint} from teeth that stiffen: push "
                f"with a third one, as far below {readable(smallest, unit, 2)} as friction and "
                "gravity allow"
            )
        most = mechanism.description.joints[joint].effort
        largest = float(np.abs(readings.push[of_joint]).max())
        if most and largest > most:
            notes.append(
                f"warning: a push on {joint} is {readable(largest, unit, 3)}, beyond its limit of "
                f"effort, {readable(most, unit, 3)}: is it in the unit of its title?"
            )
        if not slides and play.value > _GAUGE_RANGE_RAD:
            notes.append(
                f"warning: no gear has so much play as {joint}: are angles in the unit of their "
                "title?"
            )
        notes += _outside(readings, joint, of_joint, fitted)
    return Gauged(
        estimates=tuple(estimates), mechanism=mechanism, readings=readings, fits=fits,
        notes=tuple(notes),
    )  # fmt: skip


def gauge_problems(
    mechanism: Mechanism,
    readings: Readings | str | Path,
    *,
    noise: Mapping[str, float] | None = None,
    pose: Mapping[str, float] | None = None,
) -> list[LeastSquares]:
    """Least squares of each joint whose smallest push exceeds gravity's known load, see `changes`.

    Arguments are those of `identify_gauged`.
    """
    ideal = mechanism.ideal()
    readings = _read(mechanism, readings, noise)
    return [
        _problem(readings, joint, of_joint, urdf_friction(ideal)[joint].coulomb, slides)
        for joint, of_joint, slides in _by_joint(mechanism, readings)
        if not (gravity := gravity_load(ideal, readings, joint, of_joint, pose))[1]
        or gravity[0] < _smallest(readings, of_joint)
    ]


def _read(
    mechanism: Mechanism, readings: Readings | str | Path, noise: Mapping[str, float] | None
) -> Readings:
    if isinstance(readings, Readings):
        return readings
    entries = mechanism.description.joints
    slides = {name: entries[name].slides for name in moving(mechanism.ideal())}
    return Readings.from_csv(readings, slides, noise)


def _by_joint(mechanism: Mechanism, readings: Readings) -> Iterator[tuple[str, np.ndarray, bool]]:
    """Each joint, which readings are of it, (n,), and whether it slides; refuses too few of one."""
    for joint in dict.fromkeys(readings.joint):
        of_joint = np.array([name == joint for name in readings.joint])
        sizes = []
        for setup in dict.fromkeys(np.array(readings.setup)[of_joint]):
            push = readings.push[of_joint & (np.array(readings.setup) == setup)]
            if push.min() < 0.0 < push.max():
                sizes += [abs(force) for force in push if force]
        if len(sizes) < 4 or max(sizes) < _FORCE_RATIO * min(sizes):
            raise JointplayError(f"{readings.source}: {joint}: {RECIPE}; got {int(of_joint.sum())}")
        yield joint, of_joint, mechanism.description.joints[joint].slides


def _smallest(readings: Readings, of_joint: np.ndarray) -> float:
    """Smallest push of these readings [N m or N]."""
    return float(np.abs(readings.push[of_joint & (readings.push != 0.0)]).min())


def _forces(readings: Readings, of_joint: np.ndarray) -> int:
    """Number of pushes of different size."""
    last, count = 0.0, 0
    for force in np.sort(np.abs(readings.push[of_joint & (readings.push != 0.0)])):
        if force >= _FORCE_RATIO * last:
            last, count = float(force), count + 1
    return count


def _require_yielding(readings: Readings, joint: str, of_joint: np.ndarray) -> None:
    """Refuse readings that fall while the push grows: no link turns against what pushes it."""
    setups = np.array(readings.setup)
    for setup in dict.fromkeys(setups[of_joint]):
        rows = np.flatnonzero(of_joint & (setups == setup) & (readings.push != 0.0))
        push, turned, error = (
            values[rows] for values in (readings.push, readings.turned, readings.error)
        )
        back = turned[:, None] - turned - _OUTLIER * np.hypot(error[:, None], error)
        back[push[:, None] >= push] = -np.inf
        i, k = np.unravel_index(int(back.argmax()), back.shape)
        if back[i, k] > 0.0:
            raise JointplayError(
                f"{readings.source}: {joint}: reading {rows[k] + 1} is less than reading "
                f"{rows[i] + 1} though the push is larger: a push is positive if it makes the "
                "reading grow; has one of them the wrong sign?"
            )


def gravity_load(
    ideal: Mechanism,
    readings: Readings | Stairs,
    joint: str,
    of_joint: np.ndarray,
    pose: Mapping[str, float] | None,
) -> tuple[float, bool]:
    """Largest load of gravity on a joint [N m or N], and whether the pose is known.

    In the poses of the readings, or else in `pose`; where neither is known, in random poses.
    """
    at, data = ideal.coordinate(joint), ideal.model.createData()
    texts = (
        dict.fromkeys(readings.pose[i] for i in np.flatnonzero(of_joint)) if readings.pose else {}
    )
    poses = [_pose(ideal, text, readings.source) for text in texts if text]
    if pose is not None and (not poses or "" in texts):
        poses.append(dict(pose))
    rows = [ideal.configuration(position) for position in poses]
    known = bool(rows)
    loads = [
        abs(pin.computeGeneralizedGravity(ideal.model, data, q)[at])
        for q in (rows if known else over_workspace(ideal, POSES))
    ]
    return float(max(loads)), known


def _pose(ideal: Mechanism, text: str, source: str) -> dict[str, float]:
    """Positions of joints [rad or m] in text such as ``JOINT=X,JOINT=X``."""
    positions, known = {}, moving(ideal)
    for part in text.split(","):
        name, value = name_and_number(part.strip(), known)
        require_known("joint", name, known)
        unit = "m" if ideal.description.joints[name].slides else "rad"
        value = value or ""
        try:
            positions[name] = float(value if NUMBER.fullmatch(value) else convert(value, unit))
        except ValueError as error:
            raise JointplayError(f"{source}, pose of {name}: {error}") from None
    return positions


def _bent(
    push: np.ndarray, largest: float, play: float, give: float, rubs: float, exponent: float
) -> np.ndarray:
    """Turn of the link from the zero under pushes: the equation on top, (n,) [rad or m]."""
    pressed = np.maximum(np.abs(push) - rubs, 0.0) / largest
    return np.asarray(np.sign(push) * (play / 2.0 + give * largest * pressed**exponent))


def _problem(
    readings: Readings, joint: str, of_joint: np.ndarray, friction: float, slides: bool
) -> LeastSquares:
    """Least squares of a joint's readings; unknowns are the last four arguments of `_bent`.

    Nuisances are the zeros of setups, and a parabola by which the wind-up strays from a power.
    """
    use = np.flatnonzero(of_joint & (readings.push != 0.0))
    push, turned = readings.push[use], readings.turned[use]
    setups = np.array(readings.setup)[use]
    zeros = np.column_stack([setups == name for name in dict.fromkeys(setups)]).astype(float)
    side, largest = np.sign(push), float(np.abs(push).max())
    # A first fit without friction, with constant compliance, gives the scales.
    rough = np.linalg.lstsq(np.column_stack([zeros, side, push]), turned, rcond=None)[0]
    span = max(float(np.ptp(turned)), float(readings.error[use].max()))
    give = max(float(rough[-1]), MINOR * span / largest)
    part = np.abs(push) / largest
    strays = side * give * largest * 4.0 * part * (1.0 - part)
    nuisance = np.column_stack([zeros, strays])
    spread = np.append(np.full(zeros.shape[1], np.inf), _LAW_SPREAD)
    unit, soft = ("m", "m/N") if slides else ("rad", "rad/(N*m)")
    # The file's friction may be off by half of it, and some there is (judged).
    rub = max(0.5 * friction, _FRICTION * float(np.abs(push).min()))
    unknowns = (
        Unknown(joint, "gear_play", unit, np.nan, span, fine=slides),
        Unknown(
            joint, "gear_compliance", soft, np.nan, give, fine=slides,
            model_error=2.0 * MODEL_ERROR,  # by its angle and by its torque
        ),
        Unknown(
            joint, "friction", "N" if slides else "N*m", friction, rub, sought=False, spread=rub,
            model_error=0.0,
        ),
        Unknown(  # with a scale of its value itself, intervals of changes are wider by a third
            joint, "stiffening", "", _EXPONENT, 0.1, sought=False, spread=_EXPONENT_SPREAD,
            least=_LEAST_EXPONENT, model_error=0.0,
        ),
    )  # fmt: skip
    return LeastSquares(
        unknowns,
        lambda theta: _bent(push, largest, *theta),
        turned,
        readings.error[use],
        nuisance,
        (f"{joint} strays",),
        spread=spread,
        safety=1.0,
        assured=_SCATTER_RESIDUALS,
    )


def _outside(readings: Readings, joint: str, of_joint: np.ndarray, fitted: Fit) -> list[str]:
    """Notes on readings that do not fit: pushed ones far off, and others beyond both sides."""
    notes, setups = [], np.array(readings.setup)
    theta, largest = fitted.theta, float(np.abs(readings.push[of_joint]).max())
    for setup in dict.fromkeys(setups[of_joint]):
        rows = np.flatnonzero(of_joint & (setups == setup) & (readings.push != 0.0))
        off = readings.turned[rows] - _bent(readings.push[rows], largest, *theta)
        away = np.abs(off - np.median(off)) - 2.0 * _LAW_SPREAD * theta[1] * largest
        if away.max() > 2.0 * _OUTLIER * readings.error[rows].max():
            notes.append(
                f"warning: readings of {joint} do not agree by {1e3 * away.max():.3g} "
                f"m{fitted.least.unknowns[0].unit}: has a push the wrong sign, or has the gauge "
                "slipped?"
            )
    for number in np.flatnonzero(of_joint & (readings.push == 0.0)):
        of_setup = of_joint & (setups == setups[number]) & (readings.push != 0.0)
        off = readings.turned[of_setup] - _bent(readings.push[of_setup], largest, *theta)
        away = (
            abs(float(readings.turned[number] - off.mean())) - theta[0] / 2.0 - theta[1] * theta[2]
        )
        if away > _OUTLIER * max(fitted.stretch, 1.0) * float(readings.error[number]):
            notes.append(
                f"note: reading {number + 1}, which is not pushed, lies beyond both sides of "
                f"{joint}: has the gauge slipped, the motor moved, or does gravity push?"
            )
    return notes


@dataclass(frozen=True)
class GaugePlan:
    """A plan to measure single joints with a dial gauge, and what it would tell."""

    steps: tuple[Step, ...]
    notes: tuple[str, ...] = ()

    def __str__(self) -> str:
        steps = [f"{number:>2}. {step}" for number, step in enumerate(self.steps, 1)]
        return "\n".join([*self.notes, *steps, _HOW])

    def csv(self) -> str:
        """Text of a table to fill in."""
        head = "joint,force [N],arm [mm],reading [mm],gauge arm [mm],motor [deg],pose"
        rows = [
            f'{step.joint},{force:g},{1e3 * step.arm:.3g},,{1e3 * step.arm:.3g},,"{step.pose}"'
            for step in self.steps
            for force in step.forces
        ]
        return "\n".join([head, *rows]) + "\n"


@dataclass(frozen=True)
class Step:
    """The readings of one joint in a plan."""

    joint: str
    arm: float
    """Distance from the axis at which is pushed and read; 0 for a joint that slides [m]."""
    forces: tuple[float, ...]
    """Push of each reading [N]."""
    pose: str
    """Pose of the robot, as ``JOINT=X,...``."""
    half_width: str
    """Text of the expected half width of the play's interval."""
    bar: bool
    """Whether the link is too short, so that a bar must be clamped to it."""
    gravity: str
    """Text of gravity's load in the pose."""

    def __str__(self) -> str:
        forces = ", ".join(f"{force:+g} N" if force else "0" for force in self.forces)
        where = f"{1e3 * self.arm:.0f} mm from its axis" if self.arm else "along its way"
        bar = " (clamp a bar to the link)" if self.bar else ""
        return (
            f"{self.joint}: gauge and push {where}{bar}; forces {forces}; tells play to "
            f"{self.half_width}\n    at {self.pose} ({self.gravity})"
        )


@known_keywords
def plan_gauge(
    mechanism: Mechanism,
    joints: Sequence[str] = (),
    *,
    push: float = PUSH_N,
    noise: Mapping[str, float] | None = None,
    play: float = 5e-3,
) -> GaugePlan:
    """Plan where to set a dial gauge, and how to push, for each joint.

    Args:
        mechanism: the robot.
        joints: joints to measure; none: all that move.
        push: largest force [N]; at most half of a joint's limit of effort, where it is known.
        noise: see `Readings.from_csv`.
        play: expected play of joints that turn [rad]; of those that slide it is 0.1 mm.

    Raises:
        MissingName: no such joint.
        JointplayError: a push that is not positive; see `free_poses`.
    """
    require_positive("push", push, "N")
    ideal = mechanism.ideal()
    model, data = ideal.model, ideal.model.createData()
    known = moving(ideal)
    for name in joints:
        require_known("joint that moves", name, known)
    poses, notes = free_poses(ideal, None, 0)
    weights = np.array([np.abs(pin.computeGeneralizedGravity(model, data, q)) for q in poses])
    steps = []
    for name in joints or known:
        entry, at = mechanism.description.joints[name], ideal.coordinate(name)
        arm = 0.0 if entry.slides else _reach(ideal, name)
        bar = not entry.slides and arm < _SHORT_M
        arm = _BAR_M if bar else float(f"{arm:.2g}")
        lever = arm or 1.0
        best = int(np.argmin(weights[:, at]))
        weight = float(weights[best, at])
        # As softly as gravity and friction allow, which the smallest push must exceed: how far the
        # link gives way hides its play.
        against = _FORCE_RATIO / SIZES[-1] * (weight + entry.friction)
        enough = max(_EFFORT_SHARE * (entry.effort or np.inf), against)
        most = min(push, min(enough, 0.5 * (entry.effort or np.inf)) / lever)
        forces = (0.0, *(float(f"{side * part * most:.2g}") for part in SIZES for side in (1, -1)))
        unit = "N" if entry.slides else "N*m"
        gravity = f"gravity loads it by {readable(weight, unit, 2)}"
        if weight >= SIZES[-1] * most * lever:
            gravity += ", beyond the smaller push: push harder (--push)"
        elif weight < 1e-3 * most * lever:
            gravity = "gravity does not load it"
        turned = 1e-4 if entry.slides else play
        wide = _expected(name, entry.slides, np.array(forces) * lever, lever, turned, noise or {})
        numbers = zip(known, poses[best][[ideal.coordinate(joint) for joint in known]], strict=True)
        pose = ",".join(f"{joint}={x:.3g}" for joint, x in numbers)
        half = f"+- {rounded(wide, 'm' if entry.slides else 'rad', 2, entry.slides)}"
        steps.append(Step(name, arm, forces, pose, half, bar, gravity))
    return GaugePlan(tuple(steps), tuple(notes))


def _reach(ideal: Mechanism, joint: str) -> float:
    """Largest distance of a frame of a joint's link from its axis [m]."""
    model = ideal.model
    number = model.getJointId(joint)
    state = model.joints[number].createData()
    model.joints[number].calc(state, np.zeros(model.joints[number].nq), np.zeros(1))
    axis = np.ravel(state.S)[3:]
    places = [
        model.jointPlacements[k].translation
        for k in range(1, model.njoints)
        if model.parents[k] == number
    ]
    places += [frame.placement.translation for frame in model.frames if frame.parentJoint == number]
    return max((float(np.linalg.norm(np.cross(axis, place))) for place in places), default=0.0)


def _expected(
    joint: str,
    slides: bool,
    push: np.ndarray,
    lever: float,
    play: float,
    noise: Mapping[str, float],
) -> float:
    """Expected half width of the play's interval, of a link that gives way as much as it plays."""
    largest = float(np.abs(push).max())
    give = play / largest
    n = len(push)
    error = np.full(n, noise.get("tool", GAUGE_M) / lever)
    readings = Readings(
        (joint,) * n, ("",) * n, push, _bent(push, largest, play, give, 0.0, 1.0), error
    )
    problem = _problem(readings, joint, np.ones(n, bool), 0.0, slides)
    fitted = Fit(least=problem, theta=np.array([play, give, 0.0, 1.0]))
    return float(fitted.half_width[0])
