"""Steady motion under a periodic drive: turns that settle, then turns that are observed.

A turn is that of a crank at constant speed; for other motions it is the whole motion, which is then
repeated and must end where it began.
"""

from __future__ import annotations

import dataclasses
import math
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError, require_known, require_whole
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.nonlinear.observables import observe

Prepare = Callable[[Run], None]
"""Function that changes the state of a run before it begins."""
RECORDS = 1000
"""Records in a turn, by default."""
_CLOSED = 1e-9
"""Largest distance between beginning and end of a motion that can be repeated [rad or m]."""


def turn(motion: Motion | None) -> float:
    """Time of one turn of a motion [s].

    Raises:
        JointplayError: no motion, one that cannot be repeated, or cranks whose speeds differ.
    """
    if motion is None:
        raise JointplayError("without a motion there are no turns; give [motion]")
    if motion.interpolation != "constant-speed":
        gap = np.abs(motion.positions[-1] - motion.positions[0])
        if gap.max() > _CLOSED:
            name = motion.joints[int(gap.argmax())]
            raise JointplayError(
                f"the motion cannot be repeated: {name!r} ends {gap.max():.3g} rad or m from where "
                "it began; let its last waypoint be the first"
            )
        return motion.duration
    speeds = motion(np.zeros(1))[1][0]
    moving = np.abs(speeds[speeds != 0.0])
    if not len(moving) or not np.allclose(moving, moving[0], rtol=1e-9):
        joints = zip(motion.joints, speeds, strict=True)
        text = ", ".join(f"{name} {speed:g}" for name, speed in joints)
        raise JointplayError(
            f"turns need the same speed of all rotating joints, got {text} [rad/s]"
        )
    return float(2.0 * math.pi / moving[0])


def check_turns(leave_out: int, keep: int, records: int) -> None:
    """Raise a JointplayError if a number of turns, or of records in a turn, is out of range."""
    require_whole("leave-out", leave_out, 0)
    require_whole("keep", keep, 1)
    require_whole("records", records, 4)


def check_base(mechanism: Mechanism) -> None:
    """Raise a JointplayError if the base is free, so that no motion repeats itself."""
    if mechanism.free_base is not None:
        raise JointplayError(
            "nonlinear dynamics is analysed for motions that can repeat, and a free base drifts "
            'away: take the mechanism with base = "held"'
        )


@dataclass(frozen=True)
class Turning:
    """A simulation over a number of turns, in which a turn has a whole number of records."""

    simulation: Simulation
    turn: float
    """Duration of a turn [s]."""
    leave_out: int
    """Settling turns at the start, which are not observed."""
    keep: int
    """Observed turns."""
    records: int
    """Records in a turn."""

    @classmethod
    def of(
        cls, simulation: Simulation, leave_out: int, keep: int, records: int = RECORDS
    ) -> Turning:
        """Repeat the motion of a simulation, whose step is shortened until it divides the turn.

        Raises:
            JointplayError: see `turn`; or numbers of turns or records out of range.
        """
        check_turns(leave_out, keep, records)
        check_base(simulation.mechanism)
        period = turn(simulation.motion)
        turns = leave_out + keep
        stride = max(math.ceil(period / records / simulation.step - 1e-9), 1)
        changed = dataclasses.replace(
            simulation,
            motion=repeated(simulation.motion, turns),
            duration=turns * period,
            step=period / (records * stride),
            record_every=stride,
            settle=leave_out * period if leave_out else None,
            judge_from=None if leave_out else 0.0,
        )
        return cls(changed, period, leave_out, keep, records)

    def run(self, prepare: Prepare | None = None) -> Result:
        """Simulate to the end; `prepare` changes the state before the run begins.

        Raises:
            JointplayError: the run stopped early.
        """
        run = Run(self.simulation)
        if prepare is not None:
            prepare(run)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            result = run.finish(check_step=False)
        return result.completed()

    def observed(self, result: Result, names: Sequence[str]) -> np.ndarray:
        """Quantities in the observed turns, shape (keep records + 1, names)."""
        columns = [observe(result, name) for name in names]
        return np.stack(columns, axis=1)[self.leave_out * self.records :]


def repeated(motion: Motion | None, turns: int) -> Motion | None:
    """The motion repeated `turns` times in a row; constant speed goes on by itself."""
    turns = require_whole("turns", turns, 1)
    if motion is None or motion.interpolation == "constant-speed" or turns == 1:
        return motion

    def repeat(times: np.ndarray) -> np.ndarray:
        parts = [times[:-1] + k * motion.duration for k in range(turns)]
        return np.append(parts, turns * times[-1])

    return Motion(
        motion.joints,
        repeat(motion.times),
        np.vstack([np.tile(motion.positions[:-1], (turns, 1)), motion.positions[-1:]]),
        motion.interpolation,
        None if motion.given is None else repeat(motion.given),
    )


def orders(values: np.ndarray, turns: int, highest: float) -> tuple[np.ndarray, np.ndarray]:
    """Order spectrum: amplitudes over the multiples of the turning speed.

    With a Hann window over all turns; a harmonic at a whole order shows its amplitude.

    Args:
        values: records of whole turns, shape (n,).
        turns: number of turns.
        highest: largest order wanted; the spectrum ends at half the records of a turn.

    Returns:
        Orders in steps of 1/turns, and amplitudes in the unit of the values.
    """
    values = np.asarray(values, float)
    window = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(len(values)) / len(values))
    amplitudes = 2.0 * np.abs(np.fft.rfft((values - values.mean()) * window)) / window.sum()
    order = np.arange(len(amplitudes)) / turns
    return order[order <= highest + 1e-9], amplitudes[order <= highest + 1e-9]


def start_travel(simulation: Simulation, joint: str) -> tuple[float, float]:
    """Largest displacement of a joint's journal at the start along x and along y [m].

    Raises:
        JointplayError: no such joint with clearance, or one that cannot move in both directions.
    """
    clearance = simulation.mechanism.clearance
    require_known("joint with clearance", joint, clearance)
    rooms = clearance[joint].start_travels
    x, y = rooms.get("x", 0.0), rooms.get("y", 0.0)
    if not (x > 0.0 and y > 0.0):
        raise JointplayError(f"the journal of {joint!r} cannot move in both x and y")
    return float(x), float(y)


def place(joint: str, x: float, y: float, run: Run) -> None:
    """Put the journal of a joint at (x, y) in its bearing before a run begins [m].

    In a loop the coordinates that are not driven move for it.
    """
    mechanism, q = run.mechanism, run.workspace.q
    coordinates = enumerate(mechanism.coordinates)
    offsets = [k for k, c in coordinates if c.joint == joint and c.part in ("x", "y")]
    motion = run.simulation.motion
    driven = [] if motion is None else [mechanism.coordinate(name) for name in motion.joints]
    free = offsets or [k for k in range(len(q)) if k not in driven]
    for _ in range(3):  # Newton steps: the position depends almost linearly on coordinates
        pin.forwardKinematics(mechanism.model, mechanism.data, q)
        centre = mechanism.journal_pose(joint).translation[:2]
        moves = mechanism.relative_jacobian(joint, q)[:2, free]
        q[free] += np.linalg.pinv(moves) @ (np.array([x, y]) - centre)
