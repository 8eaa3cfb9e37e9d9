"""Clearances and friction from measurements: what was found, how well, and what was not."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from jointplay.accuracy.poses import moving
from jointplay.base.errors import JointplayError, require_a, require_known
from jointplay.base.pairs import misread, pair, quantity
from jointplay.base.schema import known_keywords, shortest
from jointplay.base.tables import Table, few
from jointplay.base.units import rounded
from jointplay.estimate import planning
from jointplay.estimate.known import LARGEST_SHARE, narrow, widest
from jointplay.estimate.least_squares import NULL, Fit, LeastSquares, basis, information, search
from jointplay.estimate.machine import TOOL, Given, Machine, apply, compliances, preset_found
from jointplay.estimate.measurement import READINGS, SHOWN, Measurement
from jointplay.estimate.model import StaticModel
from jointplay.estimate.nuisances import DEGREE, REFERENCES, nuisances
from jointplay.estimate.parts import WOUND, Teeth, friction_of
from jointplay.estimate.recordings import Recording, is_recording
from jointplay.estimate.unknowns import (
    PLAYS,
    ROUNDING,
    Estimate,
    Loop,
    Unknown,
    by_label,
    data,
    listed,
)
from jointplay.estimate.visits import Observed, Visits, cut_into_visits, pushes
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import RollingBearing
from jointplay.simulation.loads.drive import Drive, JointFriction, urdf_friction
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

if TYPE_CHECKING:
    from jointplay.scenario.presets import Preset

_LARGE = 3.0
"""Times the records' scatter from which on residuals are said to be large (judged: of 38 arms of
benchmarks/truth/identify.py with parts an interval misses the truth in 4 of 12 with more, and in 2
of 26 with less)."""
_FINEST = 1e-9
"""Error of a mean below which none is taken, far below what instruments resolve: records of a
simulation have none at all [m, rad, N m]."""
_VAGUE = "its interval is wider than half of its value"

# Why an unknown cannot be identified, and what would help: in words; how the machine gives way.


def elasticity(fit: Fit, model: StaticModel) -> tuple[Estimate, ...]:
    """Each joint's compliances with what was found; the structure's at the tool is not a number."""
    problem = fit.least
    effect, residual = problem.effects(fit.theta), -problem.off(fit.theta)
    nuisance, estimates = problem.nuisance, []
    assert nuisance is not None
    for soft in model.elastic:
        if soft.label == TOOL or soft.label.endswith(" bush") or not soft.effect.any():
            continue
        reduced, k = problem.without([soft.label]), int(problem.elastic[soft.label][0])
        # Beside the unknowns it is one more, with what was known of it before.
        scaled = problem.rows(nuisance[:, k])
        column = np.append(reduced.project(scaled), 1.0 / soft.unknown.spread)
        span = basis(np.vstack([reduced.project(effect), np.zeros(effect.shape[1])]))
        alone = column - span @ (span.T @ column)
        size, value, half = float(alone @ alone), soft.unknown.nominal, np.inf
        if size > ROUNDING * float(scaled @ scaled):
            value += float(alone[: len(residual)] @ residual) / size
            half = fit.wide(1.0 / np.sqrt(size), soft.unknown.model_error * value)
        dark = half > LARGEST_SHARE * abs(value)
        estimates.append(Estimate(soft.unknown, value, half, _VAGUE if dark else ""))
    return tuple(estimates)


def reason(i: int, fit: Fit, model: StaticModel) -> str:
    """Why an unknown cannot be identified; empty if it can."""
    if fit.known(i):
        return _held_by_friction(i, fit)
    if never := _never_loaded(fit.least.unknowns[i], model):
        return never
    if soft := _explained(i, fit, model.visits):
        return soft
    unknown = fit.least.unknowns[i]
    plain = fit.shows(i) or unknown.name in WOUND
    return fit.why_not(i) if plain else _without_effect(unknown, model)


def _never_loaded(unknown: Unknown, model: StaticModel) -> str:
    """That its load is not of a kind which would show an unknown, if so."""
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


def _held_by_friction(i: int, fit: Fit) -> str:
    """That an interval which begins at zero may be due to friction, if this is not identified.

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


def _explained(i: int, fit: Fit, visits: Visits) -> str:
    """That elasticity explains what shows of an unknown as well, if it does."""
    problem, unknown = fit.least, fit.least.unknowns[i]
    if unknown.name in WOUND:
        return ""
    labels = [
        *(candidate.label for candidate in problem.unknowns if candidate.name in WOUND),
        *problem.elastic,
    ]
    effect = problem.effects(fit.theta)

    def known(rigid: Collection[str]) -> bool:
        columns = [
            k for k, candidate in enumerate(problem.unknowns) if candidate.label not in rigid
        ]
        stiff = problem.without([label for label in rigid if label in problem.elastic])
        covariance, null, _ = information(stiff.project(effect[:, columns]))
        k = columns.index(i)
        half = fit.wide(float(np.sqrt(covariance[k, k])) * unknown.scale)
        return bool(null[k, k] <= NULL and narrow(unknown, fit.theta[i], half))

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
    fit: Fit,
    observed: Observed,
    use: np.ndarray,
    model: StaticModel,
    reasons: Sequence[str],
) -> tuple[str, ...]:
    """Which further experiment or signal would identify what cannot be identified."""
    problem, unknowns = fit.least, fit.least.unknowns
    if not any(why and unknown.sought for why, unknown in zip(reasons, unknowns, strict=True)):
        return ("",) * len(unknowns)
    gives = [give.unknown.scale * problem.rows(give.effect[use]) for give in model.elastic]
    rigid = problem.without(problem.elastic)
    effect = rigid.project(np.column_stack([problem.effects(fit.theta), *gives]))
    before = effect.T @ effect / max(fit.misfit, 1.0) ** 2 + planning.prior(unknowns, model)[0]
    noise = dict(planning.NOISE)
    for (kind, _), spread in zip(model.keys, observed.noise, strict=True):
        noise[kind] = max(spread, _FINEST)
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
        if best <= limit:
            lines.append(f"would determine it, to +- {unknown.shown(best)}: {experiment}")
        elif best < 0.5 * fit.half_width[i] and best < 4.0 * limit:
            times = int(np.ceil((best / limit) ** 2))
            lines.append(f"would determine it if done about {times} times: {experiment}")
        else:
            lines.append("")
    return tuple(lines)


@dataclass(frozen=True)
class Identification:
    """What a measurement says of its unknowns; SI units."""

    estimates: tuple[Estimate, ...]
    """Of all unknowns but compliances, those that are not sought too."""
    mechanism: Mechanism
    """With what was found; unknowns that cannot be identified as in the scenario."""
    visits: Visits
    observed: Observed
    error: np.ndarray
    """Standard errors of the means that counted, nan where none did, (n, keys) [SI]."""
    predicted: np.ndarray
    """By the static model with what was found, offsets included, shape (n, keys) [SI]."""
    nuisances: np.ndarray
    """Effect of what is not sought, see `nuisances`, shape (n, keys, columns)."""
    misfit: float
    """RMS of the residuals, in standard errors, which are as large as the residuals demand."""
    reference: str
    notes: tuple[str, ...]
    measured: Measurement
    excess: float
    """RMS of the residuals, by the scatter of the records alone."""
    elasticity: tuple[Estimate, ...] = ()
    """Compliances of the joints that were accounted for."""
    loops: tuple[Loop, ...] = ()
    """Of the joints whose play is sought and shows in a signal, by the visits that counted."""

    @property
    def sought(self) -> tuple[Estimate, ...]:
        return tuple(estimate for estimate in self.estimates if estimate.unknown.sought)

    def __getitem__(self, label: str) -> Estimate:
        return by_label(self.estimates, label)

    def preset(
        self, robot: str | Path | None = None, simulation: Simulation | None = None
    ) -> Preset:
        """The robot's joints with what was identified, for every command's ``--preset``.

        Args:
            robot: name or path of the robot; None: the file of its URDF.
            simulation: whose drives and friction it has, too.
        """
        known = urdf_friction(self.mechanism)
        friction, tables = dict[str, JointFriction](), dict[str, Mapping[str, Any]]()
        if simulation is not None:
            known = friction = dict(simulation.joint_friction or {})
            drives = simulation.drive
            if isinstance(drives, Drive):
                drives = dict.fromkeys(self.mechanism.gears, drives)
            tables["drive"] = {name: shortest(Drive, drive) for name, drive in drives.items()}
        for estimate in self.estimates:
            if estimate.unknown.name == "dry_friction" and estimate.known:
                law = known.get(estimate.joint, JointFriction())
                friction[estimate.joint] = replace(law, coulomb=estimate.value, static=None)
        tables["friction"] = {
            name: shortest(JointFriction, entry) for name, entry in friction.items()
        }
        return preset_found(self.mechanism, self.sought, self.measured.source, robot, tables)

    @property
    def sentence(self) -> str:
        known = [
            f"{estimate.label} {estimate.cells()[0]}" for estimate in self.sought if estimate.known
        ]
        values = f": {few(known)}" if known else ""
        return f"The measurement determines {len(known)} of {len(self.sought)} unknowns{values}"

    def __str__(self) -> str:
        soft = [estimate for estimate in self.elasticity if estimate.known]
        lines = [*self.notes, listed([*self.sought, *soft], expected=True)]
        vague = [estimate.label for estimate in self.elasticity if not estimate.known]
        if vague:
            lines.append(f"accounted for, but not determined: {', '.join(vague)}, tool compliance")
        used = np.isfinite(self.error)
        at = used.any(axis=1)
        lines.append(
            f"statistical, static model; {int(at.sum())} visits "
            f"({int((self.visits.stopped & at).sum())} stops) of "
            f"{len(np.unique(self.visits.cell[at]))} places, {int(used.sum())} means; residual: "
            f"{self.excess:.2g} times what the records' scatter explains (RMS); errors and "
            "intervals are enlarged by what is over 1"
        )
        if self.excess > _LARGE:
            lines.append("note: the model does not explain all of it")
        return "\n".join(lines)

    @property
    def data(self) -> Table:
        return data(self.sought)

    def describe(self) -> dict[str, Any]:
        return {
            "unknowns": [estimate.describe() for estimate in self.sought],
            "compliances": [estimate.describe() for estimate in self.elasticity],
            "misfit": float(self.misfit),
            "excess": float(self.excess),
            "notes": list(self.notes),
        }


def read_stiffness(texts: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Stiffness by label and its relative standard deviation [SI], as `identify` takes them.

    `texts`: each as ``elbow=1e5 N*m/rad``, ``elbow radial=2e8 N/m +- 20 %``, ``tool=inf``.

    Raises:
        JointplayError: one that does not read so, or has a unit of another kind.
    """
    usage = '--known-stiffness PART=X or "PART=X +- Y %", such as "elbow=1e5 N*m/rad"'
    stiffness = {}
    for text in texts:
        label, value = pair(text, usage)
        value, plus, part = (side.strip() for side in value.partition("+-"))
        if plus and not part.endswith("%"):
            raise misread(text, usage)
        try:
            deviation = float(part.removesuffix("%")) / 100.0 if plus else 0.0
        except ValueError:
            raise misread(text, usage) from None
        lengthwise = label.endswith((" radial", " axial")) or label == "tool"
        unit, option = "N/m" if lengthwise else "N*m/rad", f"--known-stiffness {label}"
        known = math.inf if value == "inf" else quantity(value, unit, option)
        stiffness[label] = known, deviation
    return stiffness


@known_keywords
def identify(
    machine: Simulation | Mechanism,
    measured: Measurement | Recording | str | Path,
    *,
    motion: Motion | None = None,
    reference: str = "place",
    noise: Mapping[str, float] | None = None,
    joint_friction: Mapping[str, JointFriction] | None = None,
    also: Sequence[str] = (),
    known: Sequence[str] = (),
    stiffness: Given | None = None,
    drift: int = DEGREE,
    lag: float | None = None,
    progress: bool = False,
) -> Identification:
    """Clearances, friction and play of gears from measured signals.

    Means over stops and slow stretches are compared with the static model, never single records.

    Args:
        machine: the scenario's simulation or the mechanism, with the play that is expected.
        measured: signals, or the file that has them (CSV); of a bag or dataset, a `Recording`.
        motion: reference, if the machine has none of its own; for joints without encoder.
        reference: what is known of the tool's ideal place, one of `REFERENCES`: ``place``
            (nothing, but the same at each visit), ``frame`` (all but where the tracker's frame
            lies), ``ideal`` (all: the geometry is calibrated).
        noise: standard deviation of a record by kind of signal [SI]; else from the records.
        joint_friction: of joints besides their bearings'; None takes the simulation's or URDF's.
        also: of `parts.ALSO`: dry ``friction`` behind all gears, not only those with some;
            ``hysteresis`` likewise; ``stiffness`` of rolling elements, by that of their geometry,
            and of each piece of a gear's curve.
        known: labels or names of unknowns that are taken from the scenario.
        stiffness: what is known of the machine's stiffness, by label: ``"elbow torsional"`` (of its
            gear, if it has one), ``"elbow tilt"`` [N m/rad], ``"elbow radial"``, ``"elbow axial"``,
            ``"tool"`` [N/m], alone or with its relative standard deviation; ``inf`` is rigid, and
            ``{"all": inf}`` are all but gears. What is not said is unknown.
        drift: degree of the polynomial in time by which readings may drift; 0: they do not.
        lag: standard deviation of the time by which readings of the tool, and of links, may be late
            behind the motors' encoders [s]; 0: they are simultaneous; ``inf``: nothing is known.
            None takes the measurement's: 0, but ``inf`` of a `Recording`.
        progress: show bars for reading and for what takes longer than 2 s.

    Raises:
        JointplayError: bad data (see `Measurement`); loops; nothing has play; a motion that never
            reverses; fewer means than unknowns.
    """
    problem, model, measured, observed, use, records, nuisance = _compared(
        machine, measured, motion=motion, reference=reference, noise=noise,
        joint_friction=joint_friction, also=also, known=known, stiffness=stiffness, drift=drift,
        lag=lag, progress=progress,
    )  # fmt: skip
    visits, unknowns = model.visits, model.unknowns
    fit = search(problem, progress=progress)
    problem = fit.least
    if fit.freedom < 1:
        raise JointplayError(
            f"{measured.source}: {use.sum()} means at {len(visits)} visits are too few for "
            f"{len(unknowns)} unknowns and {problem.projected.shape[1]} offsets, drifts, lags and "
            "compliances; visit places more often, from both sides"
        )
    error = records.copy()
    error[use] = problem.error
    reasons = [reason(i, fit, model) for i in range(len(unknowns))]
    estimates = fit.estimates(reasons, advice(fit, observed, use, model, reasons))
    # With what the best nuisances do, where anything counted.
    predicted = model.predict(fit.theta)
    off, span = problem.off(fit.theta), problem.projected
    shift = -problem.error * (span @ (span[: len(off)].T @ off))[: len(problem.error)]
    predicted[use] += shift
    residual = (observed.mean - predicted)[use] / records[use]
    return Identification(
        estimates,
        apply(model.mechanism, estimates),
        visits,
        observed,
        error,
        predicted,
        nuisance,
        fit.misfit,
        reference,
        tuple(_assumptions(model, measured, observed, reference, drift)),
        measured,
        excess=float(np.sqrt(np.square(residual).sum() / fit.freedom)),
        elasticity=elasticity(fit, model),
        loops=tuple(_loops(model, fit.theta, error, observed.mean - predicted)),
    )


def identify_problem(
    machine: Simulation | Mechanism, measured: Measurement | Recording | str | Path, **options: Any
) -> LeastSquares:
    """The least squares by which `identify`, with the same options, finds play; see `changes`."""
    return _compared(machine, measured, **options).problem


class _Compared(NamedTuple):
    """Means of a measurement and the static model of them."""

    problem: LeastSquares
    model: StaticModel
    measured: Measurement
    observed: Observed
    use: np.ndarray
    """Which means count, shape (n, keys)."""
    records: np.ndarray
    """Standard errors by the records, nan where none counts, (n, keys)."""
    nuisance: np.ndarray


def _compared(
    machine: Simulation | Mechanism,
    measured: Measurement | Recording | str | Path,
    *,
    motion: Motion | None = None,
    reference: str = "place",
    noise: Mapping[str, float] | None = None,
    joint_friction: Mapping[str, JointFriction] | None = None,
    also: Sequence[str] = (),
    known: Sequence[str] = (),
    stiffness: Given | None = None,
    drift: int = DEGREE,
    lag: float | None = None,
    progress: bool = False,
) -> _Compared:
    require_a("machine", machine, "Simulation", "Mechanism")
    if motion is not None:
        require_a("motion", motion, "Motion")
    for name, table in {"noise": noise, "joint_friction": joint_friction}.items():
        require_a(name, table or {}, "Mapping")
    for name, names in {"also": also, "known": known}.items():
        require_a(name, names, "Iterable")
    mechanism = machine.mechanism if isinstance(machine, Simulation) else machine
    friction = urdf_friction(mechanism)
    if isinstance(machine, Simulation):
        motion = motion or machine.motion
        if machine.payloads:
            raise JointplayError(
                "identify does not support payloads that are picked up; put them into the URDF"
            )
        friction |= dict(machine.joint_friction or {})
    friction |= dict(joint_friction or {})
    require_known("reference", reference, REFERENCES)
    measured = _read(measured, mechanism, noise, progress)
    if drift < 0:
        raise JointplayError(f"the degree of the drift must not be negative, got {drift}")
    if lag is not None:
        if not lag >= 0.0:
            raise JointplayError(f"the lag must not be negative, got {lag:g} s")
        measured = replace(measured, lag=lag)
    if mechanism.loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: identify is for robots without closed loops"
        )
    links = set(measured.has("link")) & set(mechanism.gears)
    if not (measured.has("tool") or measured.has("torque") or links):
        raise JointplayError(
            f"{measured.source} has no signal in which play would show: tool x (y, z), JOINT link "
            "of a gear with play, or JOINT torque is needed in addition to the motors' encoders"
        )
    prior = Machine(mechanism, friction, compliances(mechanism, stiffness or {}))
    visits, observed = cut_into_visits(mechanism, measured, motion)
    kinds = [kind for kind, _ in observed.keys]
    torqued = [name for kind, name in observed.keys if kind == "torque"]
    stops = bool(visits.stopped.any()) and "tool" in kinds
    unknowns = prior.unknowns(torqued, stops, also, known, links)
    model = StaticModel(prior, visits, observed.keys, unknowns)
    use = np.isfinite(observed.mean) & model.certain[:, None]
    _check(measured, model, use, reference)
    smallest = [_FINEST + ROUNDING * np.nanmax(np.abs(row), initial=0.0) for row in observed.mean.T]
    records = np.where(use, np.maximum(observed.error, smallest), np.nan)
    records = np.hypot(records, model.wander)
    nuisance, labels = nuisances(model, observed, reference, drift, measured.lag > 0.0)
    problem = _problem(model, observed.mean, records, nuisance, labels, measured.lag)
    return _Compared(problem, model, measured, observed, use, records, nuisance)


def _loops(
    model: StaticModel, theta: np.ndarray, error: np.ndarray, residual: np.ndarray
) -> Iterator[Loop]:
    """Of each joint whose play is sought, by standard errors and what is left, (n, keys) each."""
    counted, visits = np.isfinite(error), model.visits
    size = np.where(counted, error, np.inf)
    at, residual = counted.any(axis=1), np.where(counted, residual, 0.0) / size
    for joint in dict.fromkeys(
        unknown.joint for unknown in model.unknowns if unknown.name in PLAYS
    ):
        turned, unit, (x, name, its), effect = model.turned(joint, theta)
        effect, branch = effect / size, np.zeros(len(turned), int)
        if joint in visits.joints:
            branch = visits.direction[:, visits.joints.index(joint)]
        if effect.any():
            rows = turned[at], unit, branch[at], effect[at], residual[at]
            yield Loop.beside(joint, (x[at], name, its), *rows)


def _read(
    measured: Measurement | Recording | str | Path,
    mechanism: Mechanism,
    noise: Mapping[str, float] | None,
    progress: bool,
) -> Measurement:
    """The measurement, of a file if it is one, with the noise that is given."""
    require_a("measured", measured, "Measurement", "Recording", "str", "Path")
    if not isinstance(measured, Measurement):
        entries = mechanism.description.joints
        slides = {name: entries[name].slides for name in moving(mechanism)}
        slides = dict.fromkeys(mechanism.clearance, False) | slides
        if not isinstance(measured, Recording):
            if not is_recording(measured):
                return Measurement.from_csv(measured, slides, noise)
            measured = Recording(measured, {})
        return measured.measurement(slides, noise, progress)
    return replace(measured, noise={**measured.noise, **(noise or {})})


def _check(measured: Measurement, model: StaticModel, use: np.ndarray, reference: str) -> None:
    """Raise if no place is visited in two ways."""
    at, visits = use.any(axis=1), model.visits
    if not at.any():
        raise JointplayError(
            f"{measured.source}: it is never known on which side teeth and journals lie: each gear "
            "must cross its play, by a reversal or a push, and each bearing be pressed"
        )
    if reference != "place" or any(kind == "torque" for kind, _ in model.keys):
        return
    visited = np.column_stack([visits.cell, visits.direction, np.round(visits.force, 3)])[at]
    if len(np.unique(visited, axis=0)) == len(np.unique(visits.cell[at])):
        raise JointplayError(
            f"{measured.source}: the motion never reverses, nor does a force: measure the way back,"
            " too (if the robot's geometry is calibrated, use the reference 'ideal')"
        )


def _problem(
    model: StaticModel,
    mean: np.ndarray,
    error: np.ndarray,
    nuisance: np.ndarray,
    labels: Sequence[str],
    lag: float,
) -> LeastSquares:
    """Least squares of the means that have an error, and of what was known before."""
    visits, use = model.visits, np.isfinite(error)
    known = np.full(nuisance.shape[2], np.inf)
    known[len(known) - len(labels) :] = [
        soft.unknown.spread for soft in model.elastic for _ in range(soft.effect.shape[2])
    ]
    if lag:
        known[: len({kind for kind, _ in model.keys if kind in READINGS})] = lag
    kinds = [kind for kind, _ in model.keys]
    loads = np.column_stack([visits.direction, visits.stopped, pushes(visits.force)])
    _, load = np.unique(loads, axis=0, return_inverse=True)
    groups = [
        n[:, None] * len(kinds) + np.arange(len(kinds)) for n in (visits.cell, np.ravel(load))
    ]
    return LeastSquares(
        model.unknowns,
        lambda theta: model.predict(theta)[use],
        mean[use],
        error[use],
        nuisance[use],
        tuple(labels),
        known,
        tuple(group[use] for group in groups),
        np.broadcast_to([kinds.index(kind) for kind in kinds], use.shape)[use],
        softening={
            name: np.broadcast_to(factor[:, None], use.shape)[use]
            for name, factor in model.softening.items()
        },
    )


_IDEAL = {
    "place": "the tool's ideal place is the same at each visit of a place",
    "frame": "the tool's ideal place is known except for the tracker's frame",
    "ideal": "the tool's ideal place is known",
}


def _assumptions(
    model: StaticModel, measured: Measurement, observed: Observed, reference: str, drift: int
) -> list[str]:
    """All that was taken for granted, a line each."""
    machine = model.machine
    stated, weak = [], []
    sought = {unknown.label for unknown in model.elastic if unknown.label.endswith(" bush")}
    for label, unknown in machine.compliances.items():
        unit = "N*m/rad" if unknown.unit == "rad/(N*m)" else "N/m"
        if unknown.nominal:
            part = f" +- {100.0 * unknown.spread / unknown.nominal:.3g} %" if unknown.spread else ""
            stated.append(f"{label} {1.0 / unknown.nominal:.4g} {unit}{part}")
        elif not unknown.spread:
            stated.append(f"{label} rigid")
        elif label.removesuffix(" link") in machine.wound or label in sought:
            weak.append(f"{label} 0 +- {unknown.shown(unknown.spread)}")
    if all(word.endswith(" rigid") for word in stated) and "tool rigid" in stated:
        stated = ["everything rigid but gears"]
    lines = [
        *measured.notes,
        f"assumed (--reference {reference}): {_IDEAL[reference]}",
        f"assumed (--known-stiffness): {', '.join(stated) or 'nothing'}; other compliances are "
        "unknown",
    ]
    softest = [
        f"{unknown.label} at most {unknown.shown(unknown.most)}"
        for unknown in model.unknowns
        if unknown.name in WOUND
    ]
    if weak or softest:
        lines.append(f"assumed (--known-stiffness) of compliances: {', '.join([*softest, *weak])}")
    text = f"like a polynomial in time of degree {drift}" if drift else "not at all"
    lines.append(f"assumed (--drift {drift}): readings drift {text}")
    lag = measured.lag
    text = f"late by some {1e3 * lag:.4g} ms" if np.isfinite(lag) else "late by an unknown time"
    text = f"{text} behind the motors' encoders" if lag else "simultaneous with motors' encoders"
    lines.append(f"assumed (--lag {lag:g}): readings of tool and links are {text}")
    deviations = []
    for (kind, name), spread in zip(observed.keys, observed.noise, strict=True):
        unit = SHOWN[kind]
        source = "given" if kind in measured.noise else "of the records"
        deviations.append(f"{kind} {name} {rounded(spread, unit, 3, True)} ({source})")
    lines.append(f"noise of a record (--noise): {', '.join(deviations)}")
    if expected := _expectations(
        machine, {(unknown.joint, unknown.name) for unknown in model.unknowns}
    ):
        lines.append(f"taken from the scenario: {', '.join(expected)}")
    if machine.mechanism.clearance:
        lines.append(
            "assumed: contacts deform by the scenario's law, in addition to the compliances"
        )
    if missing := model.visits.without_encoder:
        lines.append(
            f"note: no encoder of {', '.join(missing)}: taken from the reference (or at rest), so "
            "tracking errors of the drives count as play"
        )
    return lines


def _expectations(machine: Machine, sought: Collection[tuple[str, str]]) -> list[str]:
    mechanism = machine.mechanism
    rows: list[tuple[str, str, str]] = []
    for joint, bearing in mechanism.clearance.items():
        if bearing.resultant is not None:
            continue
        value = friction_of(bearing)
        text = "no law of friction known" if value is None else f"{value:g}"
        rows.append((joint, "friction", f"bearing {text}"))
        for name, size in bearing.clearances.items():
            rows.append((joint, name, f"{name.replace('_', ' ')} {rounded(size, 'm', fine=True)}"))
    for joint in mechanism.joints:
        law = machine.friction.get(joint, JointFriction())
        rows.append((joint, "dry_friction", f"dry friction {law.coulomb:g} N m"))
        if law.viscous:
            rows.append((joint, "", f"viscous friction {law.viscous:g} N m s/rad"))
    for joint, gear in mechanism.gears.items():
        rows.append((joint, "gear_play", f"gear play {rounded(gear.play, 'rad')}"))
        if f"{joint} torsional" not in machine.compliances:
            text = f"gear stiffness {Teeth(joint, gear).stiffness[0]:.4g} N m/rad"
            rows.append((joint, "gear_compliance", text))
    return [f"{joint} {text}" for joint, name, text in rows if (joint, name) not in sought]
