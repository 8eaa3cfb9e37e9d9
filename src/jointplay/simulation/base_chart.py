"""The chart of a free base: the rotation from which its yaw, pitch and roll are counted in a run.

These angles are singular at a pitch of 90 degrees. Before the pitch comes near, the run takes
another rotation to count from, and the angles of records are converted to the pose of the URDF.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import pinocchio as pin

from jointplay.base.errors import JointplayError
from jointplay.model.free_base import (
    ANGLES,
    STEEPEST_START,
    angles_of,
    chart_for,
    rates,
    rotation,
    turning,
)
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.time_loop import TimeLoop

if TYPE_CHECKING:
    from jointplay.simulation.run import Run

LOOK_S = 1e-3
"""Interval at which the pitch of a free base is looked at [s]."""
LARGEST_PITCH = 1.0
"""Pitch beyond which a base gets another chart [rad]: it would have to turn by more than half a
radian between two looks to come near a right angle."""


def check_start(mechanism: Mechanism, q: np.ndarray) -> None:
    """Refuse a pitch of a right angle at the start: yaw and roll turn the base about one axis."""
    if mechanism.free_base is not None and abs(np.cos(q[ANGLES][1])) < STEEPEST_START:
        pitch = f"{mechanism.free_base}.pitch"
        raise JointplayError(
            f"{pitch} = {q[ANGLES][1]:.6g} rad is a right angle, where yaw and roll turn the base "
            "about the same axis; give nearly the same pose, a thousandth of a radian away",
            ("state", pitch),
        )


class BaseChart:
    """The rotation from which a run counts the angles of its free base; a held base has none.

    The run's own model has it as the placement of the base's turning joint. In records, and in the
    state that is read, angles count from the pose of the URDF.
    """

    def __init__(self, run: Run) -> None:
        self._joint, self._model = run.mechanism.base_joint, run.model
        self._workspace = run.workspace
        self._interval = max(round(LOOK_S / run.simulation.step), 1)
        self._chart = np.eye(3)
        self._moved = False
        """Whether the chart has ever been replaced."""
        self._last: np.ndarray | None = None
        """Angles of the last record, from the pose of the URDF: those of the next go on there."""
        self._converted = 0
        """Number of records whose angles are from the pose of the URDF."""

    def __bool__(self) -> bool:
        return self._joint > 0

    def steps_until_next(self, step: int) -> int | None:
        """Steps from `step` until the next look at the pitch; None for a held base."""
        return self._interval - step % self._interval if self else None

    def replace_if_due(self, loop: TimeLoop) -> bool:
        """Replace the chart if the pitch is large; returns whether the loop must begin again."""
        w = self._workspace
        if not self or w.steps % self._interval or abs(w.q[ANGLES][1]) < LARGEST_PITCH:
            return False
        loop.synchronize()
        self.convert_records()
        angles = w.q[ANGLES].copy()
        spin = turning(angles, w.v[ANGLES])
        turn = self._chart @ rotation(angles)
        self._set(chart_for(turn, spin))
        w.q[ANGLES] = angles_of((self._chart.T @ turn)[None])[0]
        w.v[ANGLES] = rates(w.q[ANGLES], spin)
        return True

    def _set(self, chart: np.ndarray) -> None:
        """Let the model, and the kernels if they have the base's body, count from `chart`."""
        self._chart, self._moved = chart, True
        self._model.jointPlacements[self._joint] = pin.SE3(chart, np.zeros(3))
        self._workspace.turn_body(ANGLES.start, chart)

    def convert_records(self) -> None:
        """Convert the angles and speeds of all records so far to the pose of the URDF."""
        if not self:
            return
        w = self._workspace
        elsewhere = w.kept_elsewhere
        first = max(self._converted, elsewhere) - elsewhere
        angles, speeds = (w.recorded(name)[first:, ANGLES] for name in ("q", "v"))
        if len(angles):
            if self._moved:
                old = np.ascontiguousarray(angles)
                spin = turning(old, speeds)
                new = angles_of(self._chart @ rotation(old), self._last)
                angles[:], speeds[:] = new, rates(new, spin)
            self._last = angles[-1].copy()
        self._converted = w.rows

    def state(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """A copy of a state of the run, its angles from the pose of the URDF."""
        q, v = q.copy(), v.copy()
        if self._moved:
            self.convert_records()
            spin = turning(q[ANGLES], v[ANGLES])
            q[ANGLES] = angles_of((self._chart @ rotation(q[ANGLES]))[None], self._last)[0]
            v[ANGLES] = rates(q[ANGLES], spin)
        return q, v

    def memory(self) -> dict[str, Any] | None:
        if not self._moved:
            return None
        last = None if self._last is None else self._last.tolist()
        return {"chart": self._chart.tolist(), "last": last, "converted": self._converted}

    def recall(self, memory: Mapping[str, Any] | None) -> None:
        if memory is not None:
            self._set(np.array(memory["chart"], float))
            self._last = None if memory["last"] is None else np.array(memory["last"], float)
            self._converted = int(memory["converted"])
