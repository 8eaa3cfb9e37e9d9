"""Orientation figures of ISO 9283: the tool's rotations a, b, c about x, y, z in many cycles.

- 7.2.1 AP_a = mean(a) - a_c, likewise b and c;
- 7.2.2 RP_a = +-3 S_a, S_a being the standard deviation over the cycles with n - 1;
- 8.2 AT_a = max |mean(a) - a_c| and 8.3 RT_a = max 3 S_a over the path.

a, b, c are components in world axes of the rotation vector that turns the commanded tool into the
attained one: rotations by play are so small that it does not matter in which order angles of the
standard would be counted.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jointplay.analysis.scatter import Estimate, estimate
from jointplay.analysis.traces import Trace

ANGLES = ("a", "b", "c")
"""Rotations about x, y and z."""
Three = tuple[Estimate, Estimate, Estimate]


@dataclass(frozen=True)
class Orientation:
    """How truly and how repeatably the tool is turned, about x, y and z [rad]."""

    accuracy: Three
    """AP_a, AP_b, AP_c with sign; along a path the largest size."""
    repeatability: Three
    """RP_a, RP_b, RP_c, each to be read as +-; along a path the largest."""

    def words(self, kind: str) -> list[str]:
        """Lines of text [mrad]; `kind` is P for a pose, T for a path."""
        lines = []
        for sort, sign, three in (("A", "", self.accuracy), ("R", "+-", self.repeatability)):
            for angle, one in zip(ANGLES, three, strict=True):
                name = f"{sort}{kind}_{angle}"
                lines.append(f"  {name:<24}  {sign}{one.words(1e3, 'mrad')}")
        return lines

    def rows(self, kind: str, clauses: tuple[str, str], time: str) -> list[str]:
        """Rows of the table of figures."""
        both = (("A", clauses[0], self.accuracy), ("R", clauses[1], self.repeatability))
        return [
            f"{sort}{kind}_{angle},{clause},{time},{one.value:.6g},{one.low:.6g},{one.high:.6g},rad"
            for sort, clause, three in both
            for angle, one in zip(ANGLES, three, strict=True)
        ]


def turns_of(runs: Sequence[Trace], ideal: Trace) -> np.ndarray | None:
    """Rotations of the tool from where it was to be, (cycles, records, 3) [rad].

    None if the orientation was not recorded.
    """
    from scipy.spatial.transform import Rotation

    if ideal.orientation is None:
        return None
    back = Rotation.from_quat(ideal.orientation[:, [1, 2, 3, 0]]).inv()
    found = []
    for run in runs:
        if run.orientation is None:
            return None
        found.append((Rotation.from_quat(run.orientation[:, [1, 2, 3, 0]]) * back).as_rotvec())
    return np.stack(found)


def at_pose(turns: np.ndarray | None) -> Orientation | None:
    """Figures of a pose: rotations (cycles, 3)."""
    if turns is None:
        return None

    def each(axis: int) -> tuple[Estimate, Estimate]:
        points = turns[:, axis]
        return (
            estimate(points, lambda some: np.asarray(some.mean(axis=-1))),
            estimate(points, lambda some: 3.0 * np.asarray(some.std(axis=-1, ddof=1))),
        )

    return _both([each(axis) for axis in range(3)])


def along_path(turns: np.ndarray | None) -> Orientation | None:
    """Figures of a path: rotations at its points (cycles, points, 3)."""
    if turns is None or not turns.shape[1]:
        return None

    def each(axis: int) -> tuple[Estimate, Estimate]:
        points = turns[:, :, axis]
        return (
            estimate(points, lambda some: np.abs(some.mean(axis=-2)).max(axis=-1)),
            estimate(points, lambda some: 3.0 * some.std(axis=-2, ddof=1).max(axis=-1)),
        )

    return _both([each(axis) for axis in range(3)])


def _both(pairs: list[tuple[Estimate, Estimate]]) -> Orientation:
    (a, ra), (b, rb), (c, rc) = pairs
    return Orientation((a, b, c), (ra, rb, rc))
