"""At which poses servos shake, and which P gain is calm at each.

A joint is put to several positions over its limits, the others held as they are: what differs is
the weight that presses its teeth to one side, and the inertia that it moves. Positions alike in
both are run once. Each is released as `hunting` does; where the verdict changes from one position
to the next, the edge between is sought.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from jointplay.base.errors import JointplayError, require_whole
from jointplay.base.progress import ProgressBar
from jointplay.base.tables import Column, Table
from jointplay.simulation.loads import Controller, Servo
from jointplay.simulation.simulation import Simulation
from jointplay.study.hunting import STARTS, UNITS, Search, store_in
from jointplay.study.released import Axis, released
from jointplay.study.swings import QUIET, Swing

LIKENESS = 0.02
"""Part of the weight's torque, or inertia, by which positions alike may differ (judged)."""

NO_LOAD = 1e-3
"""Torque of weight that is none [N m or N] (judged)."""

HALVINGS = 4
"""Of the interval between two positions: an edge is known to a sixteenth of it, with 7 over a turn
to 4 deg."""

FACTOR, TRIES, BETWEEN = 2.0, 3, 3
"""By what, and how often, a gain is raised or lowered until the verdict changes, from an eighth to
eight times; how often the factor between two is halved then: 2^(1/8), 9 %, is left."""


@dataclass
class Position:
    """A joint at one of its positions."""

    value: float
    """[rad or m]"""
    axis: Axis
    swing: Swing = QUIET
    """The largest of all starts."""
    control: Swing = QUIET
    """Likewise without play."""
    calm_gain: float | None = None
    """Largest P gain at which all starts came to rest [V/rad or V/m]; None: none of those tried."""
    shaking_gain: float | None = None
    """Smallest one tried above it at which it hunts or is unclear; None: none."""

    @property
    def verdict(self) -> str:
        if not self.swing.hunts:
            return "unclear" if self.swing.unclear else "calm"
        return "shakes: gains" if self.control.hunts else "shakes: play"


@dataclass
class Calm:
    """A joint over its positions, in their order."""

    joint: str
    positions: list[Position]
    edges: list[tuple[float, bool]] = field(default_factory=list)
    """Where it becomes calm (True) or no longer is, in order [rad or m]."""

    def _text(self, value: float) -> str:
        return f"{1e3 * value:.3g} mm" if self._slides else f"{math.degrees(value):.3g} deg"

    @property
    def _slides(self) -> bool:
        return self.positions[0].axis.slides

    @property
    def largest(self) -> float | None:
        """P gain that is calm at all positions; None: none of those tried is."""
        gains = [position.calm_gain for position in self.positions]
        return None if None in gains else min(gain for gain in gains if gain is not None)

    @property
    def sentence(self) -> str:
        kinds = {position.verdict.partition(":")[0] for position in self.positions}
        if kinds == {"calm"}:
            return f"{self.joint} is calm at every pose"
        if len(kinds) == 1:
            (kind,) = kinds
            return f"{self.joint} {'shakes' if kind == 'shakes' else 'is unclear'} at every pose"
        unclear = " (elsewhere a longer --time must tell)" * ("unclear" in kinds)
        begin, parts = "" if self.positions[0].verdict == "calm" else None, []
        for edge, calm in self.edges:
            if calm:
                begin = self._text(edge)
            elif begin is not None:
                parts.append(f"from {begin} to {self._text(edge)}" if begin else
                             f"below {self._text(edge)}")  # fmt: skip
                begin = None
        parts += [f"above {begin}"] if begin else []
        return f"{self.joint} is calm {' and '.join(parts) or 'nowhere'}{unclear}"

    @property
    def advice(self) -> str:
        """What to do, in a line."""
        servo, largest = self.positions[0].axis.drive, self.largest
        assert isinstance(servo, Servo)
        amplitude = max(position.swing.amplitude for position in self.positions)
        if all(position.verdict == "calm" for position in self.positions):
            bounded = any(position.shaking_gain is not None for position in self.positions)
            limit = self._gain_text(servo, largest) + " at least" * (not bounded)
            return f"{self.joint}: nothing to do; calm up to {limit}"
        if largest is not None:
            return f"{self.joint}: {self._gain_text(servo, largest)} is calm at every pose"
        integral = "set I to 0, or " * bool(servo.i_gain)
        encoder = "an encoder on the motor's side, " * (servo.encoder == "link")
        swing = f" (+-{1e3 * amplitude:.3g} {'mm' if self._slides else 'mrad'})"
        return (
            f"{self.joint}: no P down to an eighth calms every pose{swing * (amplitude > 0.0)}: "
            f"{integral}{encoder}friction or a spring that keeps the teeth on one side"
        )

    @staticmethod
    def _gain_text(servo: Servo, gain: float | None) -> str:
        assert gain is not None
        number = _register(servo, gain)
        return f"{'' if number is None else f'P={number}, '}{gain:.3g} V/rad"


def calm(
    simulation: Simulation,
    joints: Sequence[str] = (),
    pose: Mapping[str, float] | None = None,
    *,
    positions: int = 7,
    longest: float | None = None,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> list[Calm]:
    """Find at which poses joints under servos are calm, and up to which P gain at each.

    Args:
        simulation, joints, pose, longest, jobs, keep, progress: see `hunting`.
        positions: of each joint, evenly over its limits, over a turn if it has none.

    Raises:
        JointplayError: see `hunting`; a joint that slides without limits, no servo.
    """
    require_whole("poses", positions, 2, 200)
    axes = [axis for axis in released(simulation, joints, pose) if isinstance(axis, Axis)]
    if not axes:
        raise JointplayError("poses are of servos; controllers of your own are looked at as posed")
    results = []
    for axis in axes:
        entry = simulation.mechanism.description.joints[axis.joint]
        low, high = entry.lower, entry.upper
        if low is None or high is None:
            if axis.slides:
                raise JointplayError(f"{axis.joint!r} has no limits: give them in the URDF")
            low, high = -math.pi, math.pi
        postures = [
            Position(value, _axis(simulation, axis.joint, pose, value))
            for value in np.linspace(low, high, positions).tolist()
        ]
        results.append(Calm(axis.joint, postures))
    with store_in(keep) as store:
        search = partial(Search, STARTS, longest, jobs, store=store)
        _judge([p for result in results for p in result.positions], search, progress)
        _edges(simulation, pose, results, search, progress)
    return results


def _axis(simulation: Simulation, joint: str, pose: Mapping[str, float] | None, q: float) -> Axis:
    (axis,) = released(simulation, [joint], dict(pose or {}) | {joint: q})
    assert isinstance(axis, Axis)
    return axis


def _kinds(positions: Sequence[Position]) -> list[list[Position]]:
    """Positions of joints whose servos and gears are the same, with like inertia and weight."""
    kinds: list[list[Position]] = []
    for position in positions:
        for kind in kinds:
            a, b = position.axis, kind[0].axis
            if (a.gear, a.drive, a.friction) != (b.gear, b.drive, b.friction):
                continue
            loads = abs(abs(a.load) - abs(b.load))
            if (
                loads <= max(LIKENESS * abs(b.load), NO_LOAD)
                and a.slides == b.slides
                and (abs(a.inertia - b.inertia) <= LIKENESS * b.inertia)
            ):
                kind.append(position)
                break
        else:
            kinds.append([position])
    return kinds


class _Gains:
    """Verdicts of axes, and the largest P gain at which each is calm."""

    def __init__(self, axes: Sequence[Axis], search: Search) -> None:
        self.axes, self.search = axes, search
        self.loose = search.axis_swings(axes, True)
        tight = search.axis_swings(axes, False)
        self.tight = [QUIET if swing == QUIET else control
                      for swing, control in zip(self.loose, tight, strict=True)]  # fmt: skip
        gains = [(axis.gains["p_gain"], s) for axis, s in zip(axes, self.loose, strict=True)]
        self.calm_gains = [gain if swing == QUIET else None for gain, swing in gains]
        self.shaking_gains = [None if swing == QUIET else gain for gain, swing in gains]
        for _ in range(TRIES):
            self._try(list(map(_outward, self.calm_gains, self.shaking_gains, axes)))
        for _ in range(BETWEEN):
            both = zip(self.calm_gains, self.shaking_gains, strict=True)
            self._try([None if q is None or s is None else math.sqrt(q * s) for q, s in both])

    def _try(self, gains: Sequence[float | None]) -> None:
        """One gain of each axis, or none."""
        gain_by_index = {k: gain for k, gain in enumerate(gains) if gain is not None}
        axes = [self.axes[k].with_gains(p_gain=gain) for k, gain in gain_by_index.items()]
        swings = self.search.axis_swings(axes, True)
        self.search.skip(len(gains) - len(axes))
        for (k, gain), swing in zip(gain_by_index.items(), swings, strict=True):
            (self.calm_gains if swing == QUIET else self.shaking_gains)[k] = gain


def _judge(
    positions: Sequence[Position], search: Callable[[ProgressBar], Search], progress: bool
) -> None:
    """Verdicts of all positions, and their largest calm gain."""
    kinds = _kinds(positions)
    # With play, without it, and the gains that `_Gains` tries at most.
    total = len(STARTS) * len(kinds) * (2 + TRIES + BETWEEN)
    with ProgressBar(disable=not progress, unit="run", total=total) as bar:
        gains = _Gains([kind[0].axis for kind in kinds], search(bar))
    for k, kind in enumerate(kinds):
        for p in kind:
            p.swing, p.control = gains.loose[k], gains.tight[k]
            p.calm_gain, p.shaking_gain = gains.calm_gains[k], gains.shaking_gains[k]


def _outward(calm_gain: float | None, shaking_gain: float | None, axis: Axis) -> float | None:
    """The next gain to be tried, up from one that is quiet, or down from one that is not."""
    if calm_gain is not None and shaking_gain is not None:
        return None
    servo = axis.drive
    assert isinstance(servo, Servo)
    if calm_gain is None:
        assert shaking_gain is not None
        return shaking_gain / FACTOR
    largest = math.inf if servo.register is None else servo.register[0] * servo.register[1]
    return min(calm_gain * FACTOR, largest) if calm_gain < largest else None


def _edges(
    simulation: Simulation, pose: Mapping[str, float] | None, results: Sequence[Calm],
    search: Callable[[ProgressBar], Search], progress: bool,
) -> None:  # fmt: skip
    """Where verdicts change, by halving between two positions; the calm end is taken."""
    brackets = [
        (joint, [a.value, b.value], a.verdict == "calm")
        for joint in results
        for a, b in pairwise(joint.positions)
        if (a.verdict == "calm") != (b.verdict == "calm")
    ]
    if not brackets:
        return
    total = len(STARTS) * HALVINGS * len(brackets)
    with ProgressBar(disable=not progress, unit="run", total=total) as bar:
        halving = search(bar)
        for _ in range(HALVINGS):
            middles = [0.5 * sum(bracket) for _, bracket, _ in brackets]
            axes = [_axis(simulation, joint.joint, pose, middle)
                    for (joint, _, _), middle in zip(brackets, middles, strict=True)]  # fmt: skip
            swings = halving.axis_swings(axes, True)
            for (_, bracket, calm), middle, swing in zip(brackets, middles, swings, strict=True):
                bracket[0 if (swing == QUIET) == calm else 1] = middle
    for joint, bracket, calm in brackets:
        joint.edges.append((bracket[0] if calm else bracket[1], not calm))


def _register(drive: Servo | Controller, gain: float | None) -> int | None:
    """Value of the P register that is no more than a gain; None: its unit is not known."""
    unit = drive.register if isinstance(drive, Servo) else None
    return None if unit is None or gain is None else max(math.floor(gain / unit[0] + 1e-6), 1)


def table(results: Sequence[Calm]) -> Table:
    """A row for each joint and position."""
    joints = [result.joint for result in results for _ in result.positions]
    positions = [position for result in results for position in result.positions]
    unit = UNITS["p_gain"]
    return Table(
        (
            Column("joint", joints),
            Column("at", [p.value for p in positions], "rad", digits=4),
            Column("load", [p.axis.load for p in positions], "N*m", digits=3),
            Column("verdict", [p.verdict for p in positions]),
            Column("amplitude", [p.swing.amplitude or None for p in positions], "rad", digits=3),
            Column("frequency", [p.swing.frequency or None for p in positions], "Hz", digits=3),
            Column("calm up to P gain", [p.calm_gain for p in positions], unit, digits=3),
            Column("register P", [_register(p.axis.drive, p.calm_gain) for p in positions]),
            Column("not calm at", [p.shaking_gain for p in positions], unit, digits=3),
        )
    )
