"""Why an unknown cannot be told, and what would tell it: in words."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from jointplay.analysis.identify import planning
from jointplay.analysis.identify.fit import BLIND, FAINT, Fit, Problem
from jointplay.analysis.identify.model import StaticModel
from jointplay.analysis.identify.parameters import Parameter
from jointplay.analysis.identify.visits import Observed, Visits
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.mechanism import Mechanism


def reason(i: int, fit: Fit, sought: Sequence[Parameter], made: Visits, model: StaticModel) -> str:
    """Why an unknown cannot be told; empty if it can."""
    one = sought[i]
    half = fit.half_width[i]
    if half <= planning.enough(one, fit.theta[i]):
        return ""
    if fit.felt[i] < FAINT:
        return _unfelt(one, made, model)
    partners = [sought[k].label for k in fit.partners(i)]
    if fit.blind[i, i] > BLIND and partners:
        return f"it acts only together with {', '.join(partners)}"
    return (
        f"its 95 % interval would be +- {one.shown(half)}, more than half of it"
        if np.isfinite(half)
        else "next to nothing of it shows above the noise"
    )


def _unfelt(one: Parameter, made: Visits, model: StaticModel) -> str:
    """Why nothing moves with an unknown."""
    if one.joint in made.joints and one.name in ("friction", "gear_play", "dry_friction"):
        ways = set(made.direction[:, made.joints.index(one.joint)].tolist()) - {0}
        if len(ways) < 2:
            return "nothing shows: the joint never reverses"
        if one.name == "gear_play":
            return "nothing shows: the load keeps the gear's teeth on one side"
    move = model.lever(one.joint)
    if move is not None and not np.abs(move).max() > 0.0:
        return "nothing shows: the joint does not move the tool"
    return "nothing shows: its load pushes the journal the same way at every visit of a place"


def advice(
    mechanism: Mechanism,
    friction: Mapping[str, JointFriction],
    sought: tuple[Parameter, ...],
    fit: Fit,
    problem: Problem,
    seen: Observed,
    reasons: Sequence[str],
) -> tuple[str, ...]:
    """Which further experiment or signal would tell what cannot be told."""
    if not any(reason and one.sought for reason, one in zip(reasons, sought, strict=True)):
        return ("",) * len(sought)
    effect = problem.sensitivity(fit.theta)
    before = effect.T @ effect / max(fit.misfit, 1.0) ** 2
    noise = dict(planning.NOISE)
    for (kind, _), spread in zip(seen.keys, seen.noise, strict=True):
        noise[kind] = max(spread, 1e-9)
    offers = planning.offers(mechanism, friction, sought, seen.keys, noise, fit.theta)
    lines = []
    for i, (one, reason) in enumerate(zip(sought, reasons, strict=True)):
        best, words = np.inf, ""
        for gain, text in offers if reason and one.sought else ():
            half = planning.half_widths(sought, before + gain)[i]
            if half < 0.8 * best:  # the simpler comes first
                best, words = half, text
        limit = planning.enough(one, fit.theta[i])
        if best <= limit:
            lines.append(f"would tell, to +- {one.shown(best)}: {words}")
        elif words and best < 0.5 * fit.half_width[i] and best < 4.0 * limit:
            times = int(np.ceil((best / limit) ** 2))
            lines.append(f"would tell if done about {times} times: {words}")
        else:
            lines.append("")
    return tuple(lines)
