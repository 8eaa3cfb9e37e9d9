"""Differences between the encoders before and behind a joint's gear: play, compliance, errors.

With both encoders a joint is measured without any instrument outside: their difference over many
static poses is fitted by features of the joint's angle, of its load and of the way it came. As in
`calibration`, a cause is kept only if it predicts held-back poses better, and play is known if its
interval excludes zero, too (`known`). The problem is linear.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError, require_a
from jointplay.base.schema import known_keywords
from jointplay.estimate.calibrated import Calibration
from jointplay.estimate.inference import infer
from jointplay.estimate.inference import notes as notes_on
from jointplay.estimate.kinematic_model import Poses, Term
from jointplay.estimate.least_squares import LeastSquares
from jointplay.estimate.pose_problem import Problem
from jointplay.estimate.selection import Selection, held_back
from jointplay.estimate.static_poses import FEWEST, StaticPoses
from jointplay.estimate.unknowns import TINY, Unknown
from jointplay.model.mechanism import Mechanism

if TYPE_CHECKING:
    from jointplay.model.payload import Payload

CAUSES: tuple[tuple[str, ...], ...] = (
    ("ratio",), ("eccentricity",), ("eccentricity", "second-harmonic"), ("sawtooth",),
    ("compliance",), ("play",), ("hysteresis",),
)  # fmt: skip
"""Candidates: kinds of terms that are tried together."""
_EXCLUSIVE = (
    ({"eccentricity", "second-harmonic"}, {"sawtooth"}),
    ({"ratio"}, {"sawtooth"}),  # which has a gain of its own
    ({"play"}, {"hysteresis"}),  # play with friction has the other in it
)
"""Kinds of terms that are not in one model together."""
_WIDE = 100.0
"""Prior widths of effects, in standard deviations of the difference: so many that they say
nothing."""
_OTHER_RATIO = 0.5
"""Part to which a wrong ratio must lower the held-back errors to be taken (judged: a right one
leaves all of them, a wrong one a hundredth)."""
_OF_ANGLES = ("eccentricity", "sawtooth")
"""First kinds of the candidates that only joints which turn have."""
_WORDS = {"compliance": "compliance (sag under its load)"}
"""Texts of kinds whose names say too little."""


@dataclass(frozen=True)
class Difference(Problem):
    """Difference of a joint's encoders, link less motor, in n static poses."""

    linear: ClassVar[bool] = True

    joint: str = ""

    @cached_property
    def off(self) -> np.ndarray:
        """Link less motor, reduced by full turns, shape (n,) [rad or m]."""
        j = self.poses.names.index(self.joint)
        off = self.poses.link[:, j] - self.poses.q[:, j]
        if self.poses.turns[j]:
            off = off - 2.0 * np.pi * np.round(off / (2.0 * np.pi))
        return np.asarray(off)

    @property
    def unit(self) -> str:
        return "rad" if self.poses.turns[self.poses.names.index(self.joint)] else "m"

    @property
    def kinds(self) -> dict[str, tuple[str, tuple[str, ...]]]:
        return {"difference": (self.unit, ("link less motor",))}

    @property
    def frame(self) -> tuple[Unknown, ...]:
        unknown = Unknown(self.joint, "difference", self.unit, least=-np.inf, sought=False)
        return (replace(unknown, model_error=0.0),)

    def at(self, rows: np.ndarray) -> LeastSquares:
        slope = np.column_stack([np.ones(len(rows)), self.features[rows]])
        return LeastSquares(
            self.unknowns, lambda theta: slope @ theta, self.off[rows],
            np.full(len(rows), self.error[0]), groups=(self.grouped(rows),),
            jacobian=lambda theta: slope, weights=True, safety=1.0,
        )  # fmt: skip


@known_keywords
def encoder_differences(
    mechanism: Mechanism,
    poses: StaticPoses,
    payloads: Sequence[Payload] = (),
    terms: Sequence[Term] | None = None,
) -> tuple[Calibration, ...]:
    """Tell play, compliance and encoder errors apart by the two encoders of each joint.

    As `calibrate`, but the measured numbers are the differences of a joint's encoders, and each
    pose is held back; one result for each joint that has both.

    Args:
        mechanism: its gravity loads the joints.
        poses: static poses with encoders on both sides, in the order of approach.
        payloads: bodies that the mechanism carried.
        terms: candidates; kinds that encoders do not show are ignored; None: all of `CAUSES`.

    Raises:
        JointplayError: no encoder on the links' side; see also `Poses`.
    """
    require_a("mechanism", mechanism, "Mechanism")
    require_a("poses", poses, "StaticPoses")
    all_poses = Poses(mechanism, poses, payloads)
    answers = [_compared(all_poses, name, terms) for name in all_poses.known]
    calibrations = tuple(answer for answer in answers if answer is not None)
    if not calibrations:
        raise JointplayError(
            f"{poses.source}: no joint has encoders on both sides of its gear in {FEWEST} poses"
        )
    return calibrations


def _compared(poses: Poses, joint: str, terms: Sequence[Term] | None) -> Calibration | None:
    """Causes of a joint's difference; None where there is no difference, or too few poses."""
    j = poses.names.index(joint)
    # A pose that was approached from nowhere says nothing of friction: left out of everything, so
    # that all models are compared on the same poses.
    came = poses.approach[:, j] != 0.0
    rows = np.flatnonzero(np.isfinite(poses.link[:, j]) & (came | (not came.any())))
    if len(rows) < FEWEST:
        return None
    poses = poses.rows(rows)
    base = Difference(poses, (1.0,), joint=joint)
    size = float(np.std(base.off))
    if size == 0.0:
        return None
    n, largest = len(rows), {"compliance": poses.load[:, j], "ratio": poses.q[:, j]}
    widths = {
        kind: _WIDE * size / max(float(np.abs(by).max()), TINY) for kind, by in largest.items()
    }
    requested = {term.kind for term in terms or () if not term.joints or joint in term.joints}
    causes = CAUSES
    if terms is not None:
        named = (tuple(kind for kind in kinds if kind in requested) for kinds in CAUSES)
        causes = tuple(filter(None, dict.fromkeys(named)))
    candidates = [
        [Term(kind, (joint,), widths.get(kind, _WIDE * size)) for kind in kinds]
        for kinds in causes
        if (poses.turns[j] or kinds[0] not in _OF_ANGLES)
        and (poses.loaded(joint) or kinds[0] not in ("compliance", "play"))
        and (came.any() or kinds[0] != "hysteresis")
    ]

    def may_be(now: Sequence[Term], added: Sequence[Term]) -> bool:
        """Whether terms go together, and leave three poses more than coefficients."""
        terms = [*now, *added]
        kinds = {term.kind for term in terms}
        both = any(kinds & term and kinds & excluded for term, excluded in _EXCLUSIVE)
        return not both and sum(len(poses.columns(term)) for term in terms) + 3 <= n

    folds, held = held_back(poses.measured, "rows")
    base = replace(base, error=(size,))
    fits = Selection(base, folds, np.zeros(1), (joint,))
    step = fits.run("constant", (), candidates, may_be)
    ratio, begin = Term("ratio", (joint,), widths["ratio"]), len(fits.steps)
    if terms is not None and not {"ratio", "sawtooth"} & {term.kind for term in step.terms}:
        # Nobody asked for a wrong ratio, but beside one nothing else could be told.
        error = fits.tried([*step.terms, ratio]).held_back[0]
        if error < _OTHER_RATIO * step.held_back[0]:
            step = fits.run("constant, ratio", (ratio,), candidates, may_be)
            del fits.steps[:begin]
    if step.held_back[0] > 0.0:  # what priors are weighed against
        fits.base = replace(base, error=(step.held_back[0],))
    play = [term for combination in candidates for term in combination if term.kind == "play"]
    known = infer(fits, step, play if may_be(step.terms, play) else ())
    unknown = Unknown(joint, "difference", base.unit, fine=False)
    explained = " + ".join(_WORDS.get(term.kind, term.kind) for term in step.terms)
    head = (
        f"{joint}: differs by {unknown.shown(size)} (standard deviation), "
        f"{unknown.shown(step.held_back[0])} left when predicted by {explained or 'nothing here'}"
    )
    notes = [head, *notes_on(fits, step)]
    for coefficient in known.coefficients:
        if coefficient.unknown.name == "ratio error":
            factor = f"{1.0 + coefficient.value:.4g} +- {coefficient.half_width:.1g}"
            notes.append(f"{joint}: its link turns {factor} as far as the motor")
    return Calibration(
        poses.measured, tuple(fits.steps), known.coefficients, known.play, folds=held,
        notes=tuple(notes), full=known.full,
    )  # fmt: skip
