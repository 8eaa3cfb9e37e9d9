"""What the encoders before and behind a joint's gear differ by: play, compliance, or their errors.

With both encoders a joint tells of itself, without any instrument outside: their difference over
many static poses is compared with features of the joint's angle, of its load and of the way it
came. A cause is kept only if it predicts poses better that the fit has not seen.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base.errors import JointplayError, require_a
from jointplay.base.tables import Table
from jointplay.estimate.calibration import TRANSITIONS
from jointplay.estimate.kinematic_model import Poses, Term
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
_EXCLUSIVE = (
    {"eccentricity", "two harmonics", "gain and jump"},
    {"play", "play with friction"},
    {"approach", "play with friction"},  # which has the approach in it
)
"""Causes of which a model has one at most."""


@dataclass(frozen=True)
class EncoderDifference:
    """What explains the difference of a joint's two encoders, link less motor; SI units."""

    joint: str
    spread: float
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
        words = " and ".join(CAUSES[name].split(",")[0] for name in self.kept)
        text = words or "nothing here predicts it"
        if self.play.reason:
            text += f"; play cannot be told: {self.play.reason}"
        elif not any("play" in name for name in self.kept):
            upper = max(abs(self.play.low), abs(self.play.high))
            text += f"; half-play at most {self.play.unknown.shown(upper)}"
        return text

    def __str__(self) -> str:
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
    joints = [_Joint(all_poses, name) for name in all_poses.known]
    told = [one for one in joints if one.count > 4 and one.spread > 0.0]
    if not told:
        raise JointplayError(
            f"{poses.source}: no joint has encoders on both sides of its gear in five poses"
        )
    return tuple(one.explained() for one in told)


def table(found: Sequence[EncoderDifference]) -> Table:
    """Leave-one-out errors of all models, coefficients of the kept ones and bounds of play [SI]."""
    rows = []
    for one in found:
        for name, left in one.table.items():
            note = one.verdict if left == one.left else ""
            error = Unknown(
                one.joint, f"left by leaving one out: {name}", one.play.unknown.unit, np.nan
            )
            rows.append(Estimate(error, left, note=note))
        rows += one.causes if one.play in one.causes else (*one.causes, one.play)
    return data(rows)


@dataclass(frozen=True)
class _Tried:
    """Causes, and how far off they predict each pose by the others."""

    names: tuple[str, ...]
    loss: np.ndarray

    @property
    def rms(self) -> float:
        return float(np.sqrt(np.mean(self.loss)))


Choices = list[tuple[tuple[float, ...], np.ndarray]]
"""Ways in which what a cause leaves to choose can be chosen, and its columns (n, k) by each."""


class _Joint:
    """One joint's difference of link less motor, and the features that may explain it."""

    def __init__(self, poses: Poses, joint: str) -> None:
        self.poses, self.joint = poses, joint
        j = poses.names.index(joint)
        self.turns, self.ordered = bool(poses.turns[j]), poses.measured.ordered
        self.unit = "rad" if self.turns else "m"
        off = poses.link[:, j] - poses.q[:, j]
        if self.turns:  # of full turns the nearest
            off = off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))
        good = np.isfinite(off)
        self.count, self.spread = int(good.sum()), float(np.std(off[good])) if good.any() else 0.0
        # A pose that was approached from nowhere says nothing of friction: left out of everything,
        # so that all models are compared on the same poses.
        came = poses.approach[:, j] != 0.0
        self.rows = np.flatnonzero(good & (came | (not self.ordered)))
        self.y = off[self.rows]
        self.angle, self.load = poses.q[self.rows, j], poses.load[self.rows, j]
        self.approach = poses.approach[self.rows, j]
        self.largest = float(np.abs(self.load).max(initial=0.0))

    def _unknown(self, name: str, unit: str) -> Unknown:
        return Unknown(self.joint, name, unit, np.nan, least=-np.inf, fine=False)

    def _cause(self, name: str, widest: float = 1.0) -> tuple[list[Unknown], Choices]:
        """What is unknown of a cause, and all ways in which the rest of it can be chosen."""
        if name in _TERMS:  # calibration knows it, too
            terms = [Term(kind, (self.joint,)) for kind in _TERMS[name]]
            columns = [column for term in terms for column in self.poses.columns(term)]
            features = np.column_stack([column.feature[self.rows] for column in columns])
            return [column.unknown for column in columns], [((), features)]
        if name == "gain and jump":
            order, q = np.sort(self.angle), self.angle
            middles = 0.5 * (order[1:] + order[:-1])[1:-1]
            return [self._unknown("gain", "rad/rad"), self._unknown("jump", self.unit)], [
                ((float(m),), np.column_stack([q, np.where(q > m, 1.0, 0.0)])) for m in middles
            ]
        if name == "approach":
            return [self._unknown("by approach", self.unit)], [((), self.approach[:, None])]
        frictions = FINE_FRICTIONS if name == "play with friction" else (0.0,)
        pairs = product(frictions, [one for one in FINE_TRANSITIONS if one <= widest])
        sizes = [(f * self.largest, t * self.largest) for f, t in pairs]
        leaning = self.poses.leaning(self.joint, *np.transpose(sizes))[self.rows]
        choices: Choices = [(size, leaning[:, k, None]) for k, size in enumerate(sizes)]
        return [self._unknown("half-play", self.unit)], choices

    def _designs(
        self, names: Sequence[str], widest: float = 1.0
    ) -> Iterator[tuple[dict[str, tuple[float, ...]], np.ndarray]]:
        """Design matrices of a model, with a constant, for all that it leaves to choose."""
        for chosen in product(*(self._cause(name, widest)[1] for name in names)):
            columns = [np.ones((len(self.y), 1)), *(one[1] for one in chosen)]
            choice = {name: one[0] for name, one in zip(names, chosen, strict=True)}
            yield choice, np.column_stack(columns)

    def _tried(self, names: tuple[str, ...]) -> _Tried:
        """Leave-one-out errors: the choice is the best for the others, so is the fit.

        Where the others do not tell choices apart (a jump on either side of the pose left out), it
        is the best of them for all: rounding would choose otherwise.
        """
        best, error = np.full(len(self.y), np.inf), np.zeros(len(self.y))
        whole = best.copy()
        for _, design in self._designs(names):
            hat = design @ np.linalg.pinv(design)
            off = self.y - hat @ self.y
            lever = np.clip(1.0 - np.diag(hat), 1e-6, None)
            # Sum of squares without a row, from the fit with it.
            cost = off @ off - off**2 / lever
            equal = np.isclose(cost, best, rtol=1e-9, atol=0.0)
            better = np.where(equal, off @ off < whole, cost < best)
            best[better], error[better] = cost[better], (off / lever)[better]
            whole[better] = off @ off
        return _Tried(names, error**2)

    def _extended(self, now: _Tried, name: str) -> _Tried | None:
        """A model with one more cause; None where it has another of the kind, or poses are few."""
        names = (*now.names, name)
        rivals = {other for group in _EXCLUSIVE if name in group for other in group}
        count = sum(4 if one == "two harmonics" else 2 for one in names) + 2
        return None if rivals & set(now.names) or count > len(self.y) else self._tried(names)

    def explained(self) -> EncoderDifference:
        loaded, first = self.poses.loaded(self.joint), self._tried(())
        names = ["eccentricity", "two harmonics", "gain and jump"] if self.turns else []
        names += ["compliance", "play"] if loaded else []
        names += ["play with friction"] if loaded and self.ordered else []
        names += ["approach"] if self.ordered else []
        table = {"constant": first.rms}

        def tried(made: _Tried, name: str, gain: Gain, kept: bool) -> None:
            table[" + ".join(made.names)] = made.rms

        units = np.arange(len(self.y))
        kept = grown(first, names, self._extended, units, tried).names
        causes, friction, transition = self._coefficients(kept)
        spread = float(np.std(self.y))
        return EncoderDifference(
            self.joint, spread, table, kept, causes, friction, transition, self._play(kept)
        )

    def _coefficients(
        self, names: Sequence[str], widest: float = 1.0
    ) -> tuple[tuple[Estimate, ...], float, float]:
        """With intervals that hold for all choices that are not significantly worse."""
        from scipy.stats import t

        fits = []
        for choice, design in self._designs(names, widest):
            inverse = np.linalg.pinv(design.T @ design)
            c = inverse @ design.T @ self.y
            fits.append((np.square(self.y - design @ c).sum(), choice, c, inverse))
        cost, choice, value, inverse = min(fits, key=lambda one: float(one[0]))
        free = max(len(self.y) - len(value), 1)
        near = [one[2] for one in fits if one[0] <= cost * (1.0 + 3.84 / free)]
        half = t.ppf(0.975, free) * np.sqrt(cost / free * np.diag(inverse))
        low, high = np.min(near, axis=0) - half, np.max(near, axis=0) + half
        unknowns = [one for name in names for one in self._cause(name)[0]]
        causes = tuple(
            Estimate(one, float(value[k]), ends=(float(low[k]), float(high[k])))
            for k, one in enumerate(unknowns, 1)
        )
        lean = next((v for k, v in choice.items() if k.startswith("play")), (np.nan, np.nan))
        return causes, lean[0], lean[1]

    def _play(self, kept: Sequence[str]) -> Estimate:
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
