"""Identification of play, friction and compliance from recordings (`identify`).

1. The measurement is read, and cut into visits to places (`visits`).
2. The machine's unknowns (`machine`) and the static model of the visits' means (`model`) are made;
   nuisances are offsets, drift, lateness and compliances (`nuisances`).
3. Least squares of the means gives values and intervals (`least_squares.search`).
4. Each unknown is known, or there is a reason why not and perhaps advice (`known`, `reasons`).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.accuracy.poses import moving
from jointplay.base.errors import JointplayError, require_a, require_known
from jointplay.base.pairs import misread, pair, quantity
from jointplay.base.schema import known_keywords, shortest
from jointplay.base.tables import Table, few
from jointplay.base.units import rounded
from jointplay.estimate.known import LARGEST_SHARE
from jointplay.estimate.least_squares import Fit, LeastSquares, basis, search
from jointplay.estimate.machine import TOOL, Given, Machine, apply, compliances, preset_found
from jointplay.estimate.measurement import READINGS, SHOWN, Measurement
from jointplay.estimate.model import StaticModel
from jointplay.estimate.nuisances import POLYNOMIAL_DEGREE, REFERENCES, nuisances
from jointplay.estimate.parts import WOUND, Teeth, friction_of
from jointplay.estimate.reasons import LEAST_ERROR, advice, reason
from jointplay.estimate.recordings import Recording, is_recording
from jointplay.estimate.unknowns import PLAYS, ROUNDING, Answer, Estimate, Loop, data, listed
from jointplay.estimate.visits import Observed, Visits, cut_into_visits, pushes
from jointplay.model.mechanism import Mechanism
from jointplay.simulation.loads.drive import Drive, JointFriction, urdf_friction
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

if TYPE_CHECKING:
    from jointplay.scenario.presets import Preset

_LARGE_EXCESS = 3.0
"""RMS of residuals, by the records' scatter, from which on a note says that the model does not
explain all (judged: of 38 arms of benchmarks/truth/identify.py with parts an interval misses the
truth in 4 of 12 with more, and in 2 of 26 with less)."""
_VAGUE = "its interval is wider than half of its value"


def _elasticity(fit: Fit, model: StaticModel) -> tuple[Estimate, ...]:
    """Estimates of each joint's compliances that are nuisances; that of the tool is a matrix.

    Each is known if half of its interval is at most `LARGEST_SHARE` of its value.
    """
    problem = fit.least
    effect, residual = problem.effects(fit.theta), -problem.off(fit.theta)
    nuisance, estimates = problem.nuisance, []
    assert nuisance is not None
    for soft in model.elastic:
        if soft.label == TOOL or soft.label.endswith(" bush") or not soft.effect.any():
            continue
        reduced, k = problem.without([soft.label]), int(problem.elastic[soft.label][0])
        # Taken as one more unknown with its prior: the part of its effect that neither the other
        # nuisances nor the unknowns make (theorem of Frisch, Waugh and Lovell).
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


@dataclass(frozen=True, kw_only=True)
class Identification(Answer):
    """Estimates from a recording, and how well the static model explains it; SI units.

    `estimates` has all unknowns except compliances, also those that are not sought; `notes` has the
    assumptions, a line each.
    """

    mechanism: Mechanism
    """The mechanism with the values that are known, the others as in the scenario."""
    visits: Visits
    observed: Observed
    error: np.ndarray
    """Standard errors of the means that counted, nan where none did, (n, keys) [SI]."""
    predicted: np.ndarray
    """Means by the static model with the estimates, offsets included, shape (n, keys) [SI]."""
    misfit: float
    """RMS of the residuals in standard errors, which are as large as the residuals demand."""
    measured: Measurement
    excess: float
    """RMS of the residuals over the scatter of the records alone."""
    elasticity: tuple[Estimate, ...] = ()
    """Compliances of joints that are nuisances."""
    loops: tuple[Loop, ...] = ()
    """Loops of joints whose play is sought and shows in a signal, by the visits that counted."""

    @property
    def sought(self) -> tuple[Estimate, ...]:
        """Estimates of the unknowns that are asked for."""
        return tuple(estimate for estimate in self.estimates if estimate.unknown.sought)

    def preset(
        self, robot: str | Path | None = None, simulation: Simulation | None = None
    ) -> Preset:
        """A preset of the robot's joints with the estimates, for every command's ``--preset``.

        Args:
            robot: name or path of the robot; None: the file of its URDF.
            simulation: a simulation whose drives and friction the preset has, too.
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
        """The answer in one sentence."""
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
        if self.excess > _LARGE_EXCESS:
            lines.append("note: the model does not explain all of it")
        return "\n".join(lines)

    @property
    def data(self) -> Table:
        """Table with a row for each unknown that is sought [SI]."""
        return data(self.sought)

    def describe(self) -> dict[str, Any]:
        """The answer as plain data [SI]."""
        return {
            "unknowns": [estimate.describe() for estimate in self.sought],
            "compliances": [estimate.describe() for estimate in self.elasticity],
            "misfit": float(self.misfit),
            "excess": float(self.excess),
            "notes": list(self.notes),
        }


def read_stiffness(texts: Iterable[str]) -> dict[str, tuple[float, float]]:
    """Read stiffness by label with its relative standard deviation [SI], as `identify` takes them.

    Args:
        texts: each such as ``elbow=1e5 N*m/rad``, ``elbow radial=2e8 N/m +- 20 %``, ``tool=inf``.

    Raises:
        JointplayError: a text that does not read so, or has a unit of another kind.
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
    drift: int = POLYNOMIAL_DEGREE,
    lag: float | None = None,
    progress: bool = False,
) -> Identification:
    """Identify clearances, friction and play of gears from measured signals.

    Means over stops and slow stretches are compared with the static model, never single records.

    Args:
        machine: the scenario's simulation or the mechanism, with the play that is expected.
        measured: signals, or the file that has them (CSV); of a bag or dataset, a `Recording`.
        motion: reference, if the machine has none of its own; for joints without encoder.
        reference: what is known of the tool's ideal place, one of `REFERENCES`: ``place``
            (nothing, but the same at each visit), ``frame`` (all but where the tracker's frame
            lies), ``ideal`` (all: the geometry is calibrated).
        noise: standard deviation of a record by kind of signal [SI]; else from the records.
        joint_friction: friction of joints besides that of their bearings; None takes the
            simulation's or URDF's.
        also: further unknowns, of `parts.ALSO`: dry ``friction`` behind all gears, not only those
            with some; ``hysteresis`` likewise; ``stiffness`` of rolling elements, as a factor of
            that by their geometry, and of each piece of a gear's curve.
        known: labels or names of unknowns that are taken from the scenario.
        stiffness: what is known of the machine's stiffness, by label: ``"elbow torsional"`` (of its
            gear, if it has one), ``"elbow tilt"`` [N m/rad], ``"elbow radial"``, ``"elbow axial"``,
            ``"tool"`` [N/m], alone or with its relative standard deviation; ``inf`` is rigid, and
            ``{"all": inf}`` makes all but gears rigid. What is not given is unknown.
        drift: degree of the polynomial in time by which readings may drift; 0: they do not.
        lag: standard deviation of the time by which readings of the tool, and of links, may be late
            behind the motors' encoders [s]; 0: they are simultaneous; ``inf``: nothing is known.
            None takes the measurement's: 0, but ``inf`` of a `Recording`.
        progress: show bars for reading and for what takes longer than 2 s.

    Raises:
        JointplayError: bad data (see `Measurement`); loops; nothing has play; a motion that never
            reverses; fewer means than unknowns.
    """
    problem, model, measured, observed, records = _comparison(
        machine, measured, motion=motion, reference=reference, noise=noise,
        joint_friction=joint_friction, also=also, known=known, stiffness=stiffness, drift=drift,
        lag=lag, progress=progress,
    )  # fmt: skip
    visits, unknowns, use = model.visits, model.unknowns, np.isfinite(records)
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
        estimates=estimates,
        mechanism=apply(model.mechanism, estimates),
        visits=visits,
        observed=observed,
        error=error,
        predicted=predicted,
        misfit=fit.misfit,
        notes=tuple(_assumptions(model, measured, observed, reference, drift)),
        measured=measured,
        excess=float(np.sqrt(np.square(residual).sum() / fit.freedom)),
        elasticity=_elasticity(fit, model),
        loops=tuple(_loops(model, fit.theta, error, observed.mean - predicted)),
    )


def identify_problem(
    machine: Simulation | Mechanism, measured: Measurement | Recording | str | Path, **options: Any
) -> LeastSquares:
    """The least squares that `identify`, with the same options, solves; see `changes`."""
    return _comparison(machine, measured, **options)[0]


def _comparison(
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
    drift: int = POLYNOMIAL_DEGREE,
    lag: float | None = None,
    progress: bool = False,
) -> tuple[LeastSquares, StaticModel, Measurement, Observed, np.ndarray]:
    """Check the arguments of `identify`, read the measurement and state its least squares.

    Returns:
        The least squares; the static model of the means; the measurement; its means; their standard
        errors by the records, nan where a mean does not count, (n, keys).
    """
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
    _require_two_ways(measured, model, use, reference)
    smallest = [
        LEAST_ERROR + ROUNDING * np.nanmax(np.abs(row), initial=0.0) for row in observed.mean.T
    ]
    records = np.where(use, np.maximum(observed.error, smallest), np.nan)
    records = np.hypot(records, model.wander)
    problem = _problem(model, observed, records, reference, drift, measured.lag)
    return problem, model, measured, observed, records


def _loops(
    model: StaticModel, theta: np.ndarray, error: np.ndarray, residual: np.ndarray
) -> Iterator[Loop]:
    """Loops of joints whose play is sought, by standard errors and residuals, (n, keys) each."""
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
    """The measurement, read if it is a file or recording, with the noise that is given."""
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


def _require_two_ways(
    measured: Measurement, model: StaticModel, use: np.ndarray, reference: str
) -> None:
    """Refuse a measurement in which no place is visited in two ways, so that no play shows."""
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
    model: StaticModel, means: Observed, error: np.ndarray, reference: str, drift: int, lag: float
) -> LeastSquares:
    """Least squares of the means that have an error, with the priors of the nuisances."""
    visits, use = model.visits, np.isfinite(error)
    nuisance, labels = nuisances(model, means, reference, drift, lag > 0.0)
    # Columns are in the order of `nuisances`: lateness of each kind of reading, offsets and drift,
    # of which nothing is known, and the compliances.
    spread = np.full(nuisance.shape[2], np.inf)
    spread[len(spread) - len(labels) :] = [
        soft.unknown.spread for soft in model.elastic for _ in range(soft.effect.shape[2])
    ]
    if lag:
        spread[: len({kind for kind, _ in model.keys if kind in READINGS})] = lag
    kinds = [kind for kind, _ in model.keys]
    # Means of a place, or of a way of loading, may be wrong together.
    loads = np.column_stack([visits.direction, visits.stopped, pushes(visits.force)])
    _, load = np.unique(loads, axis=0, return_inverse=True)
    groups = [
        n[:, None] * len(kinds) + np.arange(len(kinds)) for n in (visits.cell, np.ravel(load))
    ]
    return LeastSquares(
        model.unknowns,
        lambda theta: model.predict(theta)[use],
        means.mean[use],
        error[use],
        nuisance[use],
        tuple(labels),
        spread,
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
    """Assumptions and notes of an identification, a line each."""
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
    """Texts of values that are taken from the scenario, all but those that are sought."""
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
