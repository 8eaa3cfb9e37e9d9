"""At which poses servos shake, and which P gain is calm at each.

A joint is put to several places over its limits, the others held as they are: what differs is the
weight that presses its teeth to one side, and the inertia that it moves. Places alike in both are
run once. Each is released as `hunting` does; where the verdict changes from one place to the next,
the place between is sought.
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

ALIKE = 0.02
"""Part of the weight's torque, or inertia, by which places alike may differ (judged)."""

NO_LOAD = 1e-3
"""Torque of weight that is none [N m or N] (judged)."""

HALVINGS = 4
"""Of the way between two places."""

FACTOR, TRIES, BETWEEN = 2.0, 3, 3
"""By what, and how often, a gain is raised or lowered until the verdict changes; how often the
factor between two is halved then."""


@dataclass
class Place:
    """A joint at one of its places."""

    at: float
    """[rad or m]"""
    axis: Axis
    swing: Swing = QUIET
    """The largest of all starts."""
    control: Swing = QUIET
    """Likewise without play."""
    calm: float | None = None
    """Largest P gain at which all starts came to rest [V/rad or V/m]; None: none of those tried."""
    shakes: float | None = None
    """Smallest one tried above it at which it hunts or is unclear; None: none."""

    @property
    def verdict(self) -> str:
        if not self.swing.hunts:
            return "unclear" if self.swing.unclear else "calm"
        return "shakes: gains" if self.control.hunts else "shakes: play"


@dataclass
class Calm:
    """A joint over its places, in their order."""

    joint: str
    places: list[Place]
    edges: list[tuple[float, bool]] = field(default_factory=list)
    """Where it becomes calm (True) or no longer is, in order [rad or m]."""

    def _text(self, value: float) -> str:
        return f"{1e3 * value:.3g} mm" if self._slides else f"{math.degrees(value):.3g} deg"

    @property
    def _slides(self) -> bool:
        return self.places[0].axis.slides

    @property
    def largest(self) -> float | None:
        """P gain that is calm at all places; None: none of those tried is."""
        gains = [one.calm for one in self.places]
        return None if None in gains else min(gain for gain in gains if gain is not None)

    @property
    def sentence(self) -> str:
        kinds = {one.verdict.partition(":")[0] for one in self.places}
        if kinds == {"calm"}:
            return f"{self.joint} is calm at every pose"
        if len(kinds) == 1:
            (kind,) = kinds
            return f"{self.joint} {'shakes' if kind == 'shakes' else 'is unclear'} at every pose"
        unclear = " (elsewhere a longer --time must tell)" * ("unclear" in kinds)
        begin, parts = "" if self.places[0].verdict == "calm" else None, []
        for at, calm in self.edges:
            if calm:
                begin = self._text(at)
            elif begin is not None:
                parts.append(f"from {begin} to {self._text(at)}" if begin else
                             f"below {self._text(at)}")  # fmt: skip
                begin = None
        parts += [f"above {begin}"] if begin else []
        return f"{self.joint} is calm {' and '.join(parts) or 'nowhere'}{unclear}"

    @property
    def advice(self) -> str:
        """What to do, in a line."""
        servo, largest = self.places[0].axis.drive, self.largest
        assert isinstance(servo, Servo)
        worst = max((one.swing for one in self.places), key=lambda swing: swing.amplitude)
        if all(one.verdict == "calm" for one in self.places):
            more = "" if any(one.shakes is not None for one in self.places) else " at least"
            return f"{self.joint}: nothing to do; calm up to {self._gain(servo, largest)}{more}"
        if largest is not None:
            return f"{self.joint}: {self._gain(servo, largest)} is calm at every pose"
        other = "set I to 0, or " * bool(servo.i_gain)
        side = "an encoder on the motor's side, " * (servo.encoder == "link")
        how = f" (+-{1e3 * worst.amplitude:.3g} {'mm' if self._slides else 'mrad'})"
        return (
            f"{self.joint}: no P down to an eighth calms every pose{how * worst.hunts}: {other}"
            f"{side}friction or a spring that keeps the teeth on one side"
        )

    @staticmethod
    def _gain(servo: Servo, gain: float | None) -> str:
        assert gain is not None
        number = _register(servo, gain)
        return f"{'' if number is None else f'P={number}, '}{gain:.3g} V/rad"


def calm(
    simulation: Simulation,
    joints: Sequence[str] = (),
    pose: Mapping[str, float] | None = None,
    *,
    places: int = 7,
    longest: float | None = None,
    jobs: int | None = None,
    keep: Path | None = None,
    progress: bool = False,
) -> list[Calm]:
    """Find at which poses joints under servos are calm, and up to which P gain at each.

    Args:
        simulation, joints, pose, longest, jobs, keep, progress: see `hunting`.
        places: of each joint, evenly over its limits, over a turn if it has none.

    Raises:
        JointplayError: see `hunting`; a joint that slides without limits, no servo.
    """
    require_whole("places", places, 2, 200)
    these = [one for one in released(simulation, joints, pose) if isinstance(one, Axis)]
    if not these:
        raise JointplayError("poses are of servos; controllers of your own are looked at as posed")
    answers = []
    for one in these:
        entry = simulation.mechanism.description.joints[one.joint]
        low, high = entry.lower, entry.upper
        if low is None or high is None:
            if one.slides:
                raise JointplayError(f"{one.joint!r} has no limits: give them in the URDF")
            low, high = -math.pi, math.pi
        found = [
            Place(at, _put(simulation, one.joint, pose, at))
            for at in np.linspace(low, high, places).tolist()
        ]
        answers.append(Calm(one.joint, found))
    with store_in(keep) as store:
        search = partial(Search, STARTS, longest, jobs, store=store)
        _judge([one for each in answers for one in each.places], search, progress)
        _edges(simulation, pose, answers, search, progress)
    return answers


def _put(simulation: Simulation, joint: str, pose: Mapping[str, float] | None, at: float) -> Axis:
    (axis,) = released(simulation, [joint], dict(pose or {}) | {joint: at})
    assert isinstance(axis, Axis)
    return axis


def _kinds(places: Sequence[Place]) -> list[list[Place]]:
    """Places of joints whose servos and gears are the same, with like inertia and weight."""
    kinds: list[list[Place]] = []
    for one in places:
        for kind in kinds:
            a, b = one.axis, kind[0].axis
            if (a.gear, a.drive, a.friction) != (b.gear, b.drive, b.friction):
                continue
            loads = abs(abs(a.load) - abs(b.load))
            if (
                loads <= max(ALIKE * abs(b.load), NO_LOAD)
                and a.slides == b.slides
                and (abs(a.inertia - b.inertia) <= ALIKE * b.inertia)
            ):
                kind.append(one)
                break
        else:
            kinds.append([one])
    return kinds


class _Gains:
    """Verdicts of axes, and the largest P gain at which each is calm."""

    def __init__(self, axes: Sequence[Axis], search: Search) -> None:
        self.axes, self.search = axes, search
        self.loose = search.each(axes, True)
        tight = search.each(axes, False)
        self.tight = [QUIET if one == QUIET else two
                      for one, two in zip(self.loose, tight, strict=True)]  # fmt: skip
        gains = [one.gains["p_gain"] for one in axes]
        self.calm = [g if one == QUIET else None for g, one in zip(gains, self.loose, strict=True)]
        self.shakes = [None if one == QUIET else g
                       for g, one in zip(gains, self.loose, strict=True)]  # fmt: skip
        for _ in range(TRIES):
            self._try(list(map(_outward, self.calm, self.shakes, axes)))
        for _ in range(BETWEEN):
            both = zip(self.calm, self.shakes, strict=True)
            self._try([None if q is None or s is None else math.sqrt(q * s) for q, s in both])

    def _try(self, gains: Sequence[float | None]) -> None:
        """One gain of each axis, or none."""
        wanted = {k: gain for k, gain in enumerate(gains) if gain is not None}
        these = [self.axes[k].with_gains(p_gain=gain) for k, gain in wanted.items()]
        found = self.search.each(these, True)
        self.search.skip(len(gains) - len(these))
        for (k, gain), swing in zip(wanted.items(), found, strict=True):
            (self.calm if swing == QUIET else self.shakes)[k] = gain

    @staticmethod
    def runs(axes: int) -> int:
        """Most gains of axes that are tried."""
        return axes * (2 + TRIES + BETWEEN)


def _judge(
    places: Sequence[Place], search: Callable[[ProgressBar], Search], progress: bool
) -> None:
    """Verdicts of all places, and their largest calm gain."""
    kinds = _kinds(places)
    total = len(STARTS) * _Gains.runs(len(kinds))
    with ProgressBar(disable=not progress, unit="run", total=total) as bar:
        found = _Gains([kind[0].axis for kind in kinds], search(bar))
    told = zip(found.loose, found.tight, found.calm, found.shakes, strict=True)
    for kind, (swing, control, quiet, shakes) in zip(kinds, told, strict=True):
        for place in kind:
            place.swing, place.control, place.calm, place.shakes = swing, control, quiet, shakes


def _outward(quiet: float | None, shake: float | None, axis: Axis) -> float | None:
    """The next gain to be tried, up from one that is quiet, or down from one that is not."""
    if quiet is not None and shake is not None:
        return None
    servo = axis.drive
    assert isinstance(servo, Servo)
    if quiet is None:
        assert shake is not None
        return shake / FACTOR
    most = math.inf if servo.register is None else servo.register[0] * servo.register[1]
    return min(quiet * FACTOR, most) if quiet < most else None


def _edges(
    simulation: Simulation, pose: Mapping[str, float] | None, answers: Sequence[Calm],
    search: Callable[[ProgressBar], Search], progress: bool,
) -> None:  # fmt: skip
    """Where verdicts change, by halving the way between two places; the calm end is taken."""
    between = [
        (one, [a.at, b.at], a.verdict == "calm")
        for one in answers
        for a, b in pairwise(one.places)
        if (a.verdict == "calm") != (b.verdict == "calm")
    ]
    if not between:
        return
    total = len(STARTS) * HALVINGS * len(between)
    with ProgressBar(disable=not progress, unit="run", total=total) as bar:
        halving = search(bar)
        for _ in range(HALVINGS):
            middles = [0.5 * sum(ends) for _, ends, _ in between]
            axes = [_put(simulation, one.joint, pose, at)
                    for (one, _, _), at in zip(between, middles, strict=True)]  # fmt: skip
            found = halving.each(axes, True)
            for (_, ends, first), at, swing in zip(between, middles, found, strict=True):
                ends[0 if (swing == QUIET) == first else 1] = at
    for one, ends, first in between:
        one.edges.append((ends[0] if first else ends[1], not first))


def _register(drive: Servo | Controller, gain: float | None) -> int | None:
    """Value of the P register that is no more than a gain; None: its unit is not known."""
    unit = drive.register if isinstance(drive, Servo) else None
    return None if unit is None or gain is None else max(math.floor(gain / unit[0] + 1e-6), 1)


def table(answers: Sequence[Calm]) -> Table:
    """A row for each joint and place."""
    rows = [(one, place) for one in answers for place in one.places]
    places = [place for _, place in rows]
    return Table(
        (
            Column("joint", [one.joint for one, _ in rows]),
            Column("at", [place.at for place in places], "rad", digits=4),
            Column("load", [place.axis.load for place in places], "N*m", digits=3),
            Column("verdict", [place.verdict for place in places]),
            Column("amplitude", [p.swing.amplitude or None for p in places], "rad", digits=3),
            Column("frequency", [p.swing.frequency or None for p in places], "Hz", digits=3),
            Column("calm up to P gain", [p.calm for p in places], UNITS["p_gain"], digits=3),
            Column("register P", [_register(p.axis.drive, p.calm) for p in places]),
            Column("not calm at", [p.shakes for p in places], UNITS["p_gain"], digits=3),
        )
    )
