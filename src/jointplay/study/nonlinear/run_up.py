"""Run-up of a crank at constant acceleration, with order tracking.

Spectra are taken over the crank's angle, not over time, so that orders, the multiples of its speed,
stay where they are while the speed rises.
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np

from jointplay.base.errors import JointplayError, require_whole
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result
from jointplay.simulation.simulation import Simulation
from jointplay.study.nonlinear.observables import observe
from jointplay.study.nonlinear.steady_motion import check_turns, orders
from jointplay.study.study import run_to_the_end


@dataclass(frozen=True)
class RunUp:
    """A simulation in which the speed of all cranks rises at a constant rate."""

    simulation: Simulation
    joint: str
    """The fastest crank, by whose angle turns are counted."""
    leave_out: int
    """Turns at the first speed."""
    turns: int
    """Turns during which the speed rises."""
    records: int
    """Samples of a turn in the spectra."""

    @classmethod
    def of(
        cls, slow: Simulation, fast: Simulation, leave_out: int, turns: int, records: int
    ) -> RunUp:
        """The run-up from the speed of one simulation to that of another, which are else the same.

        Raises:
            JointplayError: they have no motion at constant speed, the same speed, or speeds of
                opposite direction; numbers of turns or records out of range.
        """
        check_turns(leave_out, turns, records)
        before, after = slow.motion, fast.motion
        if before is None or after is None or before.interpolation != "constant-speed":
            raise JointplayError("a run-up needs cranks at constant speed: give motion.speeds")
        first, last = (motion(np.zeros(1))[1][0] for motion in (before, after))
        crank = int(np.abs(np.stack([first, last])).max(axis=0).argmax())
        if np.array_equal(first, last) or first[crank] == 0.0 or first[crank] * last[crank] <= 0.0:
            raise JointplayError(
                f"a run-up needs two speeds of the same direction, got {first[crank]:g} and "
                f"{last[crank]:g} rad/s; --vary the crank's speed, such as "
                "motion.speeds.crank_pin=1000:6000:40 rpm"
            )
        # Steady turns at the first speed, then a ramp that takes `turns` turns of the crank.
        turn = 2.0 * math.pi
        steady = max(leave_out, 1) * turn / abs(first[crank])
        ramp = turns * turn / abs(0.5 * (first[crank] + last[crank]))
        start = before(np.zeros(1))[0][0]
        middle = start + steady * first
        positions = [start, middle, middle + 0.5 * ramp * (first + last)]
        # Records at equal times, of which a turn has enough even at the highest speed.
        interval = turn / max(abs(first[crank]), abs(last[crank])) / records
        stride = max(math.ceil(interval / slow.step - 1e-9), 1)
        changed = dataclasses.replace(
            slow,
            motion=Motion(before.joints, [0.0, steady, steady + ramp], positions, "speed-ramps"),
            duration=steady + ramp,
            step=interval / stride,
            record_every=stride,
            settle=None,
            judge_from=0.0,
        )
        return cls(changed, before.joints[crank], max(leave_out, 1), turns, records)

    def run(self) -> Result:
        """Simulate the run-up.

        Raises:
            JointplayError: the run stopped early.
        """
        return run_to_the_end(self.simulation, "the run-up")

    def over_angle(self, result: Result, name: str) -> np.ndarray:
        """A quantity at equal angles of the crank while the speed rises, (turns records,)."""
        angle = self._angle(result.time)
        turns = self.leave_out + np.arange(self.turns * self.records) / self.records
        return np.asarray(np.interp(turns, angle, observe(result, name)))

    def windows(self, number: int, window: int) -> np.ndarray:
        """First turns of `number` windows of `window` turns each, evenly over the run-up.

        Raises:
            JointplayError: a window longer than the run-up.
        """
        number = require_whole("number", number, 1)
        if not 1 <= require_whole("window", window) <= self.turns:
            raise JointplayError(
                f"a window of {window} turns does not fit into {self.turns} turns (--keep)"
            )
        return np.round(np.linspace(0, self.turns - window, number)).astype(int)

    def spectra(
        self, values: np.ndarray, number: int, window: int, highest: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Orders, and amplitudes in each of the windows, shape (number, orders).

        Args:
            values: the history that `over_angle` returns.
            number, window: see `windows`.
            highest: largest order wanted.
        """
        parts = [
            values[first * self.records : (first + window) * self.records]
            for first in self.windows(number, window)
        ]
        pairs = [orders(part, window, highest) for part in parts]
        return pairs[0][0], np.array([amplitudes for _, amplitudes in pairs])

    def speeds(self, number: int, window: int) -> np.ndarray:
        """Speed in the middle of each window, where half of its turns are over [rad/s]."""
        motion = self._motion
        time = np.linspace(0.0, motion.duration, 20001)
        angle = self._angle(time)
        middle = self.leave_out + self.windows(number, window) + 0.5 * window
        column = motion.joints.index(self.joint)
        return np.asarray(np.abs(motion(np.interp(middle, angle, time))[1][:, column]))

    @property
    def _motion(self) -> Motion:
        motion = self.simulation.motion
        assert motion is not None
        return motion

    def _angle(self, time: np.ndarray) -> np.ndarray:
        """Turns of the crank since the start."""
        column = self._motion.joints.index(self.joint)
        start = self._motion(np.zeros(1))[0][0, column]
        return np.asarray(np.abs(self._motion(time)[0][:, column] - start) / (2.0 * math.pi))
