"""What the encoders before and behind a joint's gear differ by: play, compliance, or their errors.

With both encoders a joint tells of itself, without any instrument outside: their difference over
many static poses is compared with features of the joint's angle, of its load and of the way it
came. A cause is kept only if it predicts poses better that the fit has not seen.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base.errors import JointplayError, require_a
from jointplay.base.tables import Table
from jointplay.estimate.calibration import TRANSITIONS
from jointplay.estimate.kinematic_model import Column, Poses, Term
from jointplay.estimate.selection import Gain, grown, one_sided
from jointplay.estimate.static_poses import StaticPoses
from jointplay.estimate.unknowns import Estimate, Unknown, data, listed
from jointplay.model.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.model.payload import Payload

FINE_FRICTIONS = tuple(np.linspace(0.0, 0.9, 19))
"""Over the largest load; without other unknowns a fine grid costs nothing."""
FINE_TRANSITIONS = (*TRANSITIONS, 0.45, 0.8)
STEEP = 0.15
"""Transitions over the largest load up to which play is told from compliance beside it."""
CAUSES = {
    "eccentricity": "periodic error of an encoder, once a turn",
    "two harmonics": "periodic error of an encoder, once and twice a turn",
    "gain and jump": "encoder with a wrong gain that jumps at one angle (sawtooth)",
    "compliance": "joint gives way in proportion to its load",
    "play": "joint leans to the side of its load",
    "play with friction": "joint leans to the side of its load, less friction against its way",
    "approach": "joint stays where it came from (hysteresis)",
}
"""Causes that are compared, in words."""
_TERMS = {
    "eccentricity": ("eccentricity",),
    "two harmonics": ("eccentricity", "second-harmonic"),
    "compliance": ("compliance",),
}
"""Kinds of calibration's terms that a cause consists of."""
_EXCLUSIVE = ({"eccentricity", "two harmonics", "gain and jump"}, {"play", "play with friction"})
"""Causes of which a model has one at most."""


@dataclass(frozen=True)
class EncoderDifference:
    """What explains the difference of a joint's two encoders, link less motor; SI units."""

    joint: str
    unit: str
    spread: float
    """Standard deviation of the difference."""
    table: dict[str, float]
    """RMS of leave-one-out predictions by model, as causes joined by `` + ``."""
    kept: tuple[str, ...]
    causes: tuple[Estimate, ...]
    """Coefficients of what was kept, harmonics by amplitude."""
    friction: float
    transition: float
    """Of play, if kept [N m]; nan otherwise."""
    play: Estimate
    """Half-play by the side of the load beside what was kept."""

    @property
    def left(self) -> float:
        """RMS of the leave-one-out predictions' errors of what was kept."""
        return self.table[" + ".join(self.kept) or "constant"]

    @property
    def verdict(self) -> str:
        """In words."""
        words = " and ".join(CAUSES[name].split(",")[0] for name in self.kept)
        text = words or "nothing here predicts it"
        if self.play.reason:
            text += f"; play cannot be told: {self.play.reason}"
        elif not any("play" in name for name in self.kept):
            upper = max(abs(self.play.low), abs(self.play.high))
            text += f"; half-play at most {self.play.unknown.shown(upper)}"
        return text

    def __str__(self) -> str:
        """A line, and the causes."""
        shown = self.play.unknown.shown
        head = (
            f"{self.joint}: differs by {shown(self.spread)} (standard deviation), "
            f"{shown(self.left)} left when predicted: {self.verdict}"
        )
        return "\n".join([head, *([listed(self.causes, "cause")] if self.causes else [])])


def encoder_differences(
    mechanism: Mechanism, poses: StaticPoses, payloads: Sequence[Payload] = ()
) -> tuple[EncoderDifference, ...]:
    """Tell play, compliance and encoder errors apart by the two encoders of each joint.

    Forward selection by leave-one-out predictions, with `calibrate`'s rule against chance; what a
    cause needs besides coefficients (friction, transition, the angle of a jump) is chosen again
    without each pose left out. Intervals are of least squares with Student's t, of play over all
    frictions and transitions that are not significantly worse.

    Args:
        mechanism: its gravity loads the joints.
        poses: with encoders on both sides, in the order of approach.
        payloads: bodies that the mechanism carried.

    Raises:
        JointplayError: no encoder on the links' side; see also `Poses`.
    """
    require_a("mechanism", mechanism, "Mechanism")
    require_a("poses", poses, "StaticPoses")
    all_poses = Poses(mechanism, poses, payloads)
    names = [
        name
        for name in all_poses.known
        if np.isfinite(_difference(all_poses, name)).sum() > 4
        and np.nanstd(_difference(all_poses, name)) > 0.0
    ]
    if not names:
        raise JointplayError(
            f"{poses.source}: no joint has encoders on both sides of its gear in five poses"
        )
    return tuple(_Joint(all_poses, name).explained() for name in names)


def table(found: Sequence[EncoderDifference]) -> Table:
    """Leave-one-out errors of all models, coefficients of the kept ones and bounds of play [SI]."""
    rows = []
    for one in found:
        for name, left in one.table.items():
            note = one.verdict if left == one.left else ""
            error = Unknown(one.joint, f"left by leaving one out: {name}", one.unit, np.nan)
            rows.append(Estimate(error, left, note=note))
        rows += one.causes if one.play in one.causes else (*one.causes, one.play)
    return data(rows)


def _difference(poses: Poses, joint: str) -> np.ndarray:
    """Link less motor, of full turns the nearest, shape (n,)."""
    j = poses.chain.names.index(joint)
    off = poses.link[:, j] - poses.q[:, j]
    if poses.chain.turns[j]:
        off = off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))
    return np.asarray(off)


@dataclass(frozen=True)
class _Tried:
    """Causes, and how far off they predict each pose by the others."""

    names: tuple[str, ...]
    error: np.ndarray
    """Shape (n,)."""

    @property
    def loss(self) -> np.ndarray:
        """Squared, shape (n,)."""
        return np.asarray(self.error**2)

    @property
    def size(self) -> float:
        """RMS."""
        return float(np.sqrt(np.mean(self.loss)))


class _Joint:
    """One joint's difference and the features that may explain it."""

    def __init__(self, poses: Poses, joint: str) -> None:
        """Take the poses in which it can be said where the joint came from."""
        self.poses, self.joint = poses, joint
        self.j = poses.chain.names.index(joint)
        self.turns = bool(poses.chain.turns[self.j])
        self.unit = "rad" if self.turns else "m"
        difference = _difference(poses, joint)
        # A pose that was approached from nowhere says nothing of friction: left out of everything,
        # so that all models are compared on the same poses.
        came = poses.approach[:, self.j] != 0.0
        self.ordered = poses.measured.ordered
        self.rows = np.flatnonzero(np.isfinite(difference) & (came | (not self.ordered)))
        self.y = difference[self.rows]
        self.angle = poses.q[self.rows, self.j]
        self.load = poses.load[self.rows, self.j]
        self.approach = poses.approach[self.rows, self.j]
        self.largest = float(np.abs(self.load).max(initial=0.0))

    def _names(self) -> list[str]:
        """Causes that can be here."""
        names = ["eccentricity", "two harmonics", "gain and jump"] if self.turns else []
        if self.poses.loaded(self.joint):
            names += ["compliance", "play"]
        if self.ordered:
            names += ["play with friction"] if self.poses.loaded(self.joint) else []
            names += ["approach"]
        return names

    def _columns(self, name: str) -> list[Column]:
        """Of a cause that calibration knows, too."""
        terms = [Term(kind, (self.joint,)) for kind in _TERMS[name]]
        return [column for term in terms for column in self.poses.columns(term)]

    def _variants(
        self, name: str, widest: float = 1.0
    ) -> list[tuple[tuple[float, ...], np.ndarray]]:
        """What a cause leaves to choose, and its columns (n, k), each way."""
        q = self.angle
        if name in _TERMS:
            features = [column.feature[self.rows] for column in self._columns(name)]
            return [((), np.column_stack(features))]
        if name == "gain and jump":
            order = np.sort(q)
            middles = 0.5 * (order[1:] + order[:-1])[1:-1]
            return [((float(m),), np.column_stack([q, np.where(q > m, 1.0, 0.0)])) for m in middles]
        if name == "approach":
            return [((), self.approach[:, None])]
        frictions = FINE_FRICTIONS if name == "play with friction" else (0.0,)
        pairs = product(frictions, [one for one in FINE_TRANSITIONS if one <= widest])
        sizes = [(f * self.largest, t * self.largest) for f, t in pairs]
        leaning = self.poses.leaning(self.joint, *np.transpose(sizes))[self.rows]
        return [(size, leaning[:, k, None]) for k, size in enumerate(sizes)]

    def _unknowns(self, name: str) -> list[Unknown]:
        """Of a cause's columns."""
        if name in _TERMS:
            return [column.unknown for column in self._columns(name)]
        own = {
            "gain and jump": [("gain", "rad/rad"), ("jump", self.unit)],
            "approach": [("by approach", self.unit)],
        }
        return [self._unknown(*one) for one in own.get(name, [("half-play", self.unit)])]

    def _designs(
        self, names: Sequence[str], widest: float = 1.0
    ) -> list[tuple[dict[str, tuple[float, ...]], np.ndarray]]:
        """Design matrices of a model, with a constant, for all that it leaves to choose."""
        made = []
        for chosen in product(*(self._variants(name, widest) for name in names)):
            columns = [np.ones((len(self.y), 1)), *(one[1] for one in chosen)]
            choice = {name: one[0] for name, one in zip(names, chosen, strict=True)}
            made.append((choice, np.column_stack(columns)))
        return made

    def _left_out(self, names: Sequence[str]) -> np.ndarray:
        """Leave-one-out errors (n,): the choice is the best for the others, so is the fit."""
        best = np.full(len(self.y), np.inf)
        error = np.zeros(len(self.y))
        for _, design in self._designs(names):
            hat = design @ np.linalg.pinv(design)
            off = self.y - hat @ self.y
            lever = np.clip(1.0 - np.diag(hat), 1e-6, None)
            # Sum of squares without a row, from the fit with it.
            cost = off @ off - off**2 / lever
            better = cost < best
            best[better], error[better] = cost[better], (off / lever)[better]
        return error

    def _extended(self, now: _Tried, name: str) -> _Tried | None:
        """A model with one more cause; None where it has another of the kind, or poses are few."""
        names = (*now.names, name)
        rivals = {other for group in _EXCLUSIVE if name in group for other in group}
        count = sum(4 if one == "two harmonics" else 2 for one in names) + 2
        if rivals & set(now.names) or count > len(self.y):
            return None
        return _Tried(names, self._left_out(names))

    def explained(self) -> EncoderDifference:
        """Forward selection and intervals."""
        first = _Tried((), self._left_out(()))
        table = {"constant": first.size}

        def tried(made: _Tried, name: str, gain: Gain, kept: bool) -> None:
            table[" + ".join(made.names)] = made.size

        units = np.arange(len(self.y))
        kept = grown(first, self._names(), self._extended, units, tried).names
        causes, friction, transition = self._coefficients(kept)
        spread = float(np.std(self.y))
        return EncoderDifference(
            self.joint, self.unit, spread, table, kept, causes, friction, transition,
            self._play(kept),
        )  # fmt: skip

    def _unknown(self, name: str, unit: str) -> Unknown:
        return Unknown(self.joint, name, unit, np.nan, least=-np.inf, fine=False)

    def _fits(
        self, names: Sequence[str], widest: float
    ) -> list[tuple[float, Any, np.ndarray, np.ndarray]]:
        """Cost, choice, coefficients and their standard errors over residuals, of all choices."""
        made = []
        for choice, design in self._designs(names, widest):
            inverse = np.linalg.pinv(design.T @ design)
            c = inverse @ design.T @ self.y
            off = self.y - design @ c
            made.append((float(off @ off), choice, c, np.sqrt(np.diag(inverse))))
        return made

    def _coefficients(
        self, names: Sequence[str], widest: float = 1.0
    ) -> tuple[tuple[Estimate, ...], float, float]:
        """With intervals that hold for all choices that are not significantly worse."""
        from scipy.stats import t

        fits = self._fits(names, widest)
        best = min(fits, key=lambda one: one[0])
        free = max(len(self.y) - len(best[2]), 1)
        noise = best[0] / free
        near = [one for one in fits if one[0] <= best[0] + 3.84 * noise]
        half = t.ppf(0.975, free) * np.sqrt(noise) * best[3]
        low = np.min([one[2] for one in near], axis=0) - half
        high = np.max([one[2] for one in near], axis=0) + half
        unknowns = [one for name in names for one in self._unknowns(name)]
        causes = tuple(
            Estimate(one, float(value), ends=(float(begin), float(end)))
            for one, value, begin, end in zip(unknowns, best[2][1:], low[1:], high[1:], strict=True)
        )
        lean = next((v for k, v in best[1].items() if k.startswith("play")), (np.nan, np.nan))
        return causes, *lean

    def _play(self, kept: Sequence[str]) -> Estimate:
        """Half-play beside what was kept, or why it cannot be told."""
        dark = Estimate(self._unknown("half-play", self.unit))
        if not self.poses.loaded(self.joint):
            return replace(dark, reason="gravity does not load this joint")
        side = np.sign(self.load) * (np.abs(self.load) > 0.05 * self.largest)
        if said := one_sided(side):
            return replace(dark, reason=said)
        widest = 1.0
        if not any(name.startswith("play") for name in kept):
            kept, widest = (*kept, "play"), STEEP
        causes = self._coefficients(kept, widest)[0]
        found = next(one for one in causes if one.unknown.name == "half-play")
        if 0.5 * (found.high - found.low) > max(abs(found.value), float(np.std(self.y))):
            reason = "its load is too small, or goes together with the joint's angle"
            return replace(dark, reason=reason)
        return found
