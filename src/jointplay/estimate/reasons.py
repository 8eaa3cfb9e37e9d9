"""Reasons why a recording does not tell an unknown, and advice which measurement would.

An unknown whose interval is narrow is known (`known.narrow`), unless friction may hold the journal
(`_held_by_friction`). For any other the first of these reasons holds that applies:

1. its load never is of the kind that would show it (`_never_loaded`);
2. elasticity explains the data as well (`_explained_by_elasticity`);
3. nothing that was measured depends on it (`_without_effect`);
4. it acts together with other unknowns, or hardly shows above the noise (`Fit.why_not`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np

from jointplay.base.tables import few
from jointplay.estimate import planning
from jointplay.estimate.known import narrow, widest
from jointplay.estimate.least_squares import NULL_SHARE, Fit, information
from jointplay.estimate.model import StaticModel
from jointplay.estimate.parts import WOUND
from jointplay.estimate.unknowns import Unknown
from jointplay.estimate.visits import Observed, Visits, pushes
from jointplay.physics.joints import RollingBearing

LEAST_ERROR = 1e-9
"""Least standard error of a mean, far below what instruments resolve: records of a simulation have
none at all [m, rad, N m]."""
_WORTHWHILE = 0.5
"""Part of its half width to which repeating an experiment must narrow an interval at first, to be
advised (judged: it chooses words only)."""
_MOST_REPEATS = 16
"""Largest number of repetitions that are advised (judged: it chooses words only)."""


def reason(i: int, fit: Fit, model: StaticModel) -> str:
    """Why the i-th unknown is not known; empty if it is."""
    if fit.known(i):
        return _held_by_friction(i, fit)
    unknown = fit.least.unknowns[i]
    if never := _never_loaded(unknown, model):
        return never
    if elastic := _explained_by_elasticity(i, fit, model.visits):
        return elastic
    if fit.shows(i) or unknown.name in WOUND:
        return fit.why_not(i)
    return _without_effect(unknown, model)


def _held_by_friction(i: int, fit: Fit) -> str:
    """That an interval which begins at zero may be due to friction, if this is not known.

    A journal that friction holds does not move in wide play either: no play, and any play with
    enough friction, leave the same means.
    """
    unknown = fit.least.unknowns[i]
    if not unknown.name.endswith("clearance") or fit.theta[i] > fit.half_width[i]:
        return ""
    for k, friction in enumerate(fit.least.unknowns):
        rubs = friction.joint == unknown.joint and friction.name == "friction" and friction.sought
        if rubs and not fit.known(k):
            return (
                f"its interval begins at zero, and {friction.label}, which cannot be determined, "
                "may hold the journal wherever it is: pass the places slowly, in both directions"
            )
    return ""


def _never_loaded(unknown: Unknown, model: StaticModel) -> str:
    """That the load never reverses, or never reaches the piece of a curve, where this shows it."""
    bearing = model.mechanism.clearance.get(unknown.joint)
    if unknown.name == "radial_clearance" and isinstance(bearing, RollingBearing):
        if not model.reverses(unknown.joint):
            return (
                "not observable: its load never reverses at a place, so that its rings are pressed "
                "together the same way; push the tool the other way, too"
            )
    elif unknown.name in WOUND[1:3]:
        begins = model.mechanism.gears[unknown.joint].curve().torques[WOUND.index(unknown.name) - 1]
        most = model.most_torque(unknown.joint)
        if most < begins:
            return (
                f"not observable: its torque, at most {most:.3g} N m, does not reach the "
                f"{begins:.3g} N m from which this stiffness holds"
            )
    return ""


def _explained_by_elasticity(i: int, fit: Fit, visits: Visits) -> str:
    """That the i-th unknown would be known if the machine were rigid, and in which ways."""
    problem, unknown = fit.least, fit.least.unknowns[i]
    if unknown.name in WOUND:
        return ""
    labels = [
        *(candidate.label for candidate in problem.unknowns if candidate.name in WOUND),
        *problem.elastic,
    ]
    effect = problem.effects(fit.theta)

    def known(rigid: Collection[str]) -> bool:
        """Whether it would be known without these compliances."""
        columns = [
            k for k, candidate in enumerate(problem.unknowns) if candidate.label not in rigid
        ]
        stiff = problem.without([label for label in rigid if label in problem.elastic])
        covariance, null, _ = information(stiff.project(effect[:, columns]))
        k = columns.index(i)
        half = fit.wide(float(np.sqrt(covariance[k, k])) * unknown.scale)
        return bool(null[k, k] <= NULL_SHARE and narrow(unknown, fit.theta[i], half))

    if not labels or not known(labels):
        return ""
    which = [label for label in labels if known([label])]
    sizes = np.unique(pushes(visits.force), axis=0)
    count = len(np.unique(np.round(np.linalg.norm(sizes, axis=1)))) - 1
    text = few(which) if which else "of several parts at once"
    return (
        f"elasticity ({text}) explains the data equally well: pushes of {max(count, 0)} "
        f"size{'s' * (count != 1)} are not enough here; push with others, or give the stiffness "
        f"(--known-stiffness{f' of {which[0]}' if which else ''})"
    )


def _without_effect(unknown: Unknown, model: StaticModel) -> str:
    """Why nothing that was measured depends on an unknown."""
    visits = model.visits
    if unknown.joint in visits.joints and unknown.name in ("friction", "gear_play", "dry_friction"):
        directions = set(visits.direction[:, visits.joints.index(unknown.joint)].tolist()) - {0}
        if len(directions) < 2:
            return "not observable: the joint never reverses"
        if unknown.name == "gear_play":
            return "not observable: the load keeps the gear's teeth on one side"
    if unknown.joint in model.levers and not model.levers[unknown.joint].any():
        return "not observable: the joint does not move the tool"
    if unknown.name in ("hysteresis", "lost_motion"):
        return "not observable: its torque never rises and falls again at a place"
    if unknown.name.endswith("compliance"):
        return "not observable: nothing loads it in this direction, or always alike"
    return "not observable: its load pushes the journal the same way at every visit of a place"


def advice(
    fit: Fit, observed: Observed, use: np.ndarray, model: StaticModel, reasons: Sequence[str]
) -> tuple[str, ...]:
    """Experiment or signal by which each unknown that has a reason against it would be known.

    By the Fisher information of what could be measured besides (`planning.offers`), added to that
    of the measurement. Compliances count as unknowns, since new pushes tell them, too.
    """
    problem, unknowns = fit.least, fit.least.unknowns
    if not any(why and unknown.sought for why, unknown in zip(reasons, unknowns, strict=True)):
        return ("",) * len(unknowns)
    gives = [give.unknown.scale * problem.rows(give.effect[use]) for give in model.elastic]
    rigid = problem.without(problem.elastic)
    effect = rigid.project(np.column_stack([problem.effects(fit.theta), *gives]))
    before = effect.T @ effect / max(fit.misfit, 1.0) ** 2 + planning.prior(unknowns, model)[0]
    noise = dict(planning.NOISE)
    for (kind, _), spread in zip(model.keys, observed.noise, strict=True):
        noise[kind] = max(spread, LEAST_ERROR)
    offers = planning.offers(model.machine, unknowns, model.keys, noise, fit.theta)
    lines = []
    widths = [[planning.half_widths(unknowns, before + x) for x in gains] for gains, _ in offers]
    for i, (unknown, why) in enumerate(zip(unknowns, reasons, strict=True)):
        if not why or not unknown.sought:
            lines.append("")
            continue
        limit = widest(unknown, fit.theta[i])
        # The best of the simplest kind that determines it, else of all.
        least = [
            min(zip((half[i] for half in halves), texts, strict=True))
            for halves, (_, texts) in zip(widths, offers, strict=True)
        ]
        best, experiment = next((offer for offer in least if offer[0] <= limit), min(least))
        times = (best / limit) ** 2  # intervals shrink with the root of the number of repetitions
        if best <= limit:
            lines.append(f"would determine it, to +- {unknown.shown(best)}: {experiment}")
        elif best < _WORTHWHILE * fit.half_width[i] and times < _MOST_REPEATS:
            lines.append(
                f"would determine it if done about {int(np.ceil(times))} times: {experiment}"
            )
        else:
            lines.append("")
    return tuple(lines)
