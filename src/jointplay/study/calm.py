"""Calm poses: where servos shake, and the largest P gain that is calm at each pose.

A joint is put at several positions over its limits, the others held as they are: what differs is
the weight that presses its teeth to one side, and the inertia that it moves. Positions alike in
both are run once. At each, the joint is released as in `hunting`; where the verdict changes from
one position to the next, the edge between them is found by halving.
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
from jointplay.study.hunting import STARTS, UNITS, Search
from jointplay.study.released import Axis, released
from jointplay.study.runs import store_in
from jointplay.study.swings import QUIET, Swing

LIKENESS = 0.02
"""Relative difference of the weight's torque, or of inertia, up to which positions count as alike
(judged)."""

NO_LOAD = 1e-3
"""Difference of the weight's torque that is always negligible [N m or N] (judged)."""

HALVINGS = 4
"""Halvings of the interval between two positions: an edge is known to a sixteenth of it, which is
4 deg with 7 positions over a turn."""

FACTOR, TRIES, BETWEEN = 2.0, 3, 3
"""Search for the calm gain: factor by which a gain is raised or lowered until the verdict changes,
how often at most (from an eighth to eight times), and how often the interval that is left is then
halved, geometrically: to a factor of 2^(1/8), 9 %."""


@dataclass
class Position:
    """A joint at one of its positions."""

    value: float
    """Position of the joint [rad or m]."""
    axis: Axis
    swing: Swing = QUIET
    """The largest swing over all starts."""
    control: Swing = QUIET
    """The largest swing over all starts without play."""
    calm_gain: float | None = None
    """Largest P gain at which all starts came to rest [V/rad or V/m]; None: none of those tried."""
    shaking_gain: float | None = None
    """Smallest P gain tried above it at which the joint hunts or is unclear; None: none."""

    @property
    def verdict(self) -> str:
        if not self.swing.hunts:
            return "unclear" if self.swing.unclear else "calm"
        return "shakes: gains" if self.control.hunts else "shakes: play"


@dataclass
class Calm:
    """Verdicts on one joint over its positions, in ascending order."""

    joint: str
    positions: list[Position]
    edges: list[tuple[float, bool]] = field(default_factory=list)
    """Positions at which it becomes calm (True) or ceases to be (False), in order [rad or m]."""

    def _text(self, value: float) -> str:
        return f"{1e3 * value:.3g} mm" if self._slides else f"{math.degrees(value):.3g} deg"

    @property
    def _slides(self) -> bool:
        return self.positions[0].axis.slides

    @property
    def largest(self) -> float | None:
        """Largest P gain that is calm at all positions; None: none of those tried is."""
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
        unclear = " (elsewhere unclear: try a longer --time)" * ("unclear" in kinds)
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
        """What to do about it, in one line: a P gain, or other remedies."""
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
        positions: number of positions of each joint, evenly over its limits, or over a turn if it
            has none.

    Raises:
        JointplayError: see `hunting`; a sliding joint without limits; no servo.
    """
    require_whole("poses", positions, 2, 200)
    axes = [axis for axis in released(simulation, joints, pose) if isinstance(axis, Axis)]
    if not axes:
        raise JointplayError("poses are varied for servos; own controllers run at one pose only")
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
    """Groups of positions with the same gear, servo and friction, and like inertia and weight.

    The sign of the weight does not matter, by symmetry.
    """
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


def _judge(
    positions: Sequence[Position], search: Callable[[ProgressBar], Search], progress: bool
) -> None:
    """Set the verdict and the calm gain of all positions, by one search for each group of like
    ones; all groups are searched at once.
    """
    kinds = _kinds(positions)
    axes = [kind[0].axis for kind in kinds]
    # Runs with play, without it, and with the gains that are tried at most.
    total = len(STARTS) * len(kinds) * (2 + TRIES + BETWEEN)
    with ProgressBar(disable=not progress, unit="run", total=total) as bar:
        runs = search(bar)
        loose, tight = (runs.axis_swings(axes, play) for play in (True, False))
        gains = [(axis.gains["p_gain"], s) for axis, s in zip(axes, loose, strict=True)]
        calm_gains = [gain if swing == QUIET else None for gain, swing in gains]
        shaking_gains = [None if swing == QUIET else gain for gain, swing in gains]

        def narrow(trials: Sequence[float | None]) -> None:
            """Run each axis with its gain, unless that is None, and narrow the axis' bracket."""
            gain_by_index = {k: gain for k, gain in enumerate(trials) if gain is not None}
            changed = [axes[k].with_gains(p_gain=gain) for k, gain in gain_by_index.items()]
            swings = runs.axis_swings(changed, True)
            runs.skip(len(axes) - len(changed))
            for (k, gain), swing in zip(gain_by_index.items(), swings, strict=True):
                (calm_gains if swing == QUIET else shaking_gains)[k] = gain

        # Away from the present gain until calm and shaking enclose the limit, then between them.
        for _ in range(TRIES):
            narrow(list(map(_outward, calm_gains, shaking_gains, axes)))
        for _ in range(BETWEEN):
            both = zip(calm_gains, shaking_gains, strict=True)
            narrow([None if q is None or s is None else math.sqrt(q * s) for q, s in both])
    for k, kind in enumerate(kinds):
        for p in kind:
            p.swing, p.control = loose[k], QUIET if loose[k] == QUIET else tight[k]
            p.calm_gain, p.shaking_gain = calm_gains[k], shaking_gains[k]


def _outward(calm_gain: float | None, shaking_gain: float | None, axis: Axis) -> float | None:
    """The next gain to try: up from a calm one, down from a shaking one; None: nothing to try."""
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
    """Find the edges between calm and other positions by halving; takes the calm end of each."""
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
    """Largest value of the P register, at least 1, whose gain is no more than `gain`; None: its
    unit is unknown.
    """
    unit = drive.register if isinstance(drive, Servo) else None
    return None if unit is None or gain is None else max(math.floor(gain / unit[0] + 1e-6), 1)


def table(results: Sequence[Calm]) -> Table:
    """Table with a row for each joint and position."""
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
