"""Clearances and friction from measurements: what was found, how well, and what cannot be told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from jointplay.analysis.identify import planning
from jointplay.analysis.identify.fit import (
    REFERENCES,
    Fit,
    Problem,
    offsets,
)
from jointplay.analysis.identify.ideal import tool_positions
from jointplay.analysis.identify.impacts import IMPACT_KINDS, channels
from jointplay.analysis.identify.model import StaticModel
from jointplay.analysis.identify.outcome import Identification
from jointplay.analysis.identify.parameters import (
    Parameter,
    unknowns,
    with_clearance,
)
from jointplay.analysis.identify.reading import Key, Measurement, TooLittle
from jointplay.analysis.identify.restitution import Restitution, by_flights, by_simulation
from jointplay.analysis.identify.search import search
from jointplay.analysis.identify.verdicts import advice, reason
from jointplay.analysis.identify.visits import Observed, Visits, no_visits, positions, visits
from jointplay.analysis.poses import moving
from jointplay.errors import JointplayError, MissingName
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.simulation.simulation import Simulation

__all__ = ["Identification", "identify"]
_NORMAL = 1.96
"""Half of a 95 % interval in standard deviations."""


def identify(
    machine: Simulation | Mechanism,
    measured: Measurement | str | Path,
    *,
    motion: Motion | None = None,
    reference: str = "place",
    noise: Mapping[str, float] | None = None,
    joint_friction: Mapping[str, JointFriction] | None = None,
    also: Sequence[str] = (),
    known: Sequence[str] = (),
    runs: int = 0,
    jobs: int = 1,
    progress: bool = False,
) -> Identification:
    """Clearances, friction, play of gears and restitution from measured signals.

    Means over stops and slow stretches are compared with the static model, impacts by their
    statistics, never single records.

    Args:
        machine: the scenario's simulation or the mechanism, with the play that is expected.
        measured: signals, or the file that has them.
        motion: reference, if the machine has none of its own; for joints without encoder.
        reference: what is known of the tool's ideal place, one of `fit.REFERENCES`: ``place``
            (nothing, but the same at each visit), ``frame`` (all but where the tracker's frame
            lies), ``ideal`` (all: the geometry is calibrated).
        noise: standard deviation of a record by kind of signal [SI]; else from the records.
        joint_friction: of joints besides their bearings'; None takes the simulation's or URDF's.
        also: of `parameters.ALSO`: ``compliance`` of the gears' teeth, ``friction`` behind them.
        known: labels or names of unknowns that are taken from the scenario.
        runs: simulations by which restitution is sought where flights do not tell it; 0: none.
        jobs: processes for them.
        progress: show a bar for them.

    Raises:
        JointplayError: bad data (see `Measurement`); loops, unless impacts show; nothing has play;
            a motion that never reverses; fewer means than unknowns; see also `by_simulation`.
    """
    mechanism, motion, friction = _inputs(machine, motion, joint_friction)
    if reference not in REFERENCES:
        raise MissingName("reference", reference, REFERENCES)
    measured = _read(measured, mechanism, noise)
    bounced = by_flights(mechanism, measured)
    try:
        found = _by_means(mechanism, measured, motion, reference, friction, also, known)
    except TooLittle as error:
        if not bounced or not any(measured.has(kind) for kind in IMPACT_KINDS):
            raise
        note = f"clearance and friction: this measurement cannot tell: {error}"
        found = _impacts_only(mechanism, measured, reference, note)
    if runs and channels(measured) and any(one.reason for one in bounced):
        if not isinstance(machine, Simulation):
            raise JointplayError(
                "restitution by simulated impacts needs the scenario (.toml) that was measured"
            )
        own = replace(machine, mechanism=found.mechanism, motion=motion)
        told = by_simulation(own, measured, spreads(found), runs=runs, jobs=jobs, progress=progress)
        pairs = zip(bounced, told, strict=True)
        bounced = tuple(other if one.reason else one for one, other in pairs)
    return replace(found, restitutions=bounced, mechanism=with_restitution(found, bounced))


def _by_means(
    mechanism: Mechanism,
    measured: Measurement,
    motion: Motion | None,
    reference: str,
    friction: Mapping[str, JointFriction],
    also: Sequence[str],
    known: Sequence[str],
) -> Identification:
    """Everything but restitution."""
    if mechanism.loops:
        raise TooLittle(
            f"loop {next(iter(mechanism.loops))!r}: identify is for robots without closed loops"
        )
    if not _shows_play(mechanism, measured):
        raise TooLittle(
            f"{measured.source} has nothing that play would show in: tool x (y, z), JOINT link of "
            "a gear with play, or JOINT torque is needed beside the motors' encoders"
        )
    made, seen = visits(mechanism, measured, motion)
    torqued = [name for kind, name in seen.keys if kind == "torque"]
    stops = bool(made.stopped.any()) and any(kind == "tool" for kind, _ in seen.keys)
    sought = unknowns(mechanism, friction, torqued, stops, also, known)
    model = StaticModel(mechanism, made, seen.keys, friction, sought)
    usable = np.isfinite(seen.mean) & model.certain[:, None]
    _check(measured, made, seen.keys, usable, reference)
    error = np.where(usable, _errors(seen), np.nan)
    problem = _problem(mechanism, model, made, seen, error, reference)
    problem, fit = _fitted(problem, seen, error, measured.source)
    reasons = tuple(reason(i, fit, sought, made, model) for i in range(len(sought)))
    words = advice(mechanism, friction, sought, fit, problem, seen, reasons)
    predicted = model.predict(fit.theta) + _offsets(problem, fit.theta, error)
    *_, unseen = positions(mechanism, measured, motion)
    return Identification(
        sought,
        fit.theta,
        fit.half_width,
        reasons,
        words,
        apply(mechanism, sought, fit.theta, reasons),
        made,
        seen,
        error,
        predicted,
        model.loose(),
        fit.misfit,
        reference,
        _notes(unseen),
        measured,
    )


def _shows_play(mechanism: Mechanism, measured: Measurement) -> bool:
    """Whether there is a signal of which the static model knows."""
    links = set(measured.has("link")) & set(mechanism.gears)
    return bool(measured.has("tool") or measured.has("torque") or links)


def spreads(found: Identification) -> dict[str, dict[str, float]]:
    """Standard deviations of the clearances and friction that are told, by joint and name."""
    known: dict[str, dict[str, float]] = {}
    for i, one in enumerate(found.unknowns):
        if one.joint in found.mechanism.clearance and not found.reasons[i]:
            known.setdefault(one.joint, {})[one.name] = float(found.half_width[i]) / _NORMAL
    return known


def with_restitution(found: Identification, told: Sequence[Restitution]) -> Mechanism:
    """The mechanism with the restitutions that are told and that its laws can deliver."""
    joints = dict(found.mechanism.clearance)
    for one in told:
        if not one.reason and np.isfinite(one.nominal):
            joints[one.joint] = replace(joints[one.joint], restitution=one.nominal)
    return found.mechanism.with_clearance(joints) if joints else found.mechanism


def _inputs(
    machine: Simulation | Mechanism,
    motion: Motion | None,
    joint_friction: Mapping[str, JointFriction] | None,
) -> tuple[Mechanism, Motion | None, dict[str, JointFriction]]:
    """Mechanism, reference, and friction of the joints besides their bearings'."""
    mechanism = machine.mechanism if isinstance(machine, Simulation) else machine
    friction = planning.urdf_friction(mechanism)
    if isinstance(machine, Simulation):
        motion = motion or machine.motion
        if machine.payloads:
            raise JointplayError(
                "payloads that are picked up are not known to identify; put them into the URDF"
            )
        friction |= dict(machine.joint_friction or {})
    return mechanism, motion, friction | dict(joint_friction or {})


def _fitted(
    problem: Problem, seen: Observed, error: np.ndarray, source: str
) -> tuple[Problem, Fit]:
    """The search from the scenario's values; writes the errors that it ends with into `error`."""
    start = np.array([one.nominal or 0.5 * one.scale for one in problem.unknowns])
    names = [kind for kind, _ in seen.keys]
    numbers = np.broadcast_to([names.index(kind) for kind in names], error.shape)
    problem, fit = search(problem, start, numbers[np.isfinite(error)])
    error[np.isfinite(error)] = problem.error
    if fit.freedom < 1:
        raise TooLittle(
            f"{source}: {len(problem.seen)} means at {len(error)} visits are too few for "
            f"{len(start)} unknowns and {problem.offsets} offsets; visit places more often, from "
            "both sides"
        )
    return problem, fit


def _impacts_only(
    mechanism: Mechanism, measured: Measurement, reference: str, note: str
) -> Identification:
    """Where means say nothing."""
    made, seen = no_visits()
    none, nothing = np.zeros((0, 0)), np.zeros(0)
    return Identification(
        (), nothing, nothing, (), (), mechanism, made, seen, none, none, none[..., None], np.nan,
        reference, (note,), measured,
    )  # fmt: skip


def _read(
    measured: Measurement | str | Path, mechanism: Mechanism, noise: Mapping[str, float] | None
) -> Measurement:
    if not isinstance(measured, Measurement):
        entries = mechanism.description.joints
        slides = {name: entries[name].slides for name in moving(mechanism)}
        slides = dict.fromkeys(mechanism.clearance, False) | slides
        return Measurement.from_csv(measured, slides, noise)
    return replace(measured, noise={**measured.noise, **(noise or {})})


def _check(
    measured: Measurement,
    made: Visits,
    keys: Sequence[Key],
    usable: np.ndarray,
    reference: str,
) -> None:
    """Raise if no place is visited in two ways."""
    at = usable.any(axis=1)
    if not at.any():
        raise TooLittle(
            f"{measured.source}: no visit counts: each gear must cross its play before, by a "
            "reversal or a push"
        )
    if reference != "place":
        return
    ways = np.column_stack([made.cell, made.direction, np.round(made.force, 3)])[at]
    places = np.unique(ways, axis=0)[:, 0]
    if len(np.unique(places)) == len(places) and not {k for k, _ in keys} & {"torque"}:
        raise TooLittle(
            f"{measured.source}: the motion never reverses: no place is visited from two sides or "
            "under two forces, so that no play shows; measure the way back, too (if the robot's "
            "geometry is calibrated, say so with the reference 'ideal')"
        )


def _errors(seen: Observed) -> np.ndarray:
    """Standard errors of the means by the records' scatter; none is zero."""
    smallest = np.array([1e-12 + 1e-9 * np.nanmax(np.abs(row), initial=0.0) for row in seen.mean.T])
    return np.maximum(seen.error, smallest)


def _problem(
    mechanism: Mechanism,
    model: StaticModel,
    made: Visits,
    seen: Observed,
    error: np.ndarray,
    reference: str,
) -> Problem:
    use = np.isfinite(error).ravel()
    tool = tool_positions(mechanism, made.joints, made.position)
    free = offsets(seen.keys, made.cell, made.position, tool, reference)
    free = np.concatenate([free, model.loose()], axis=2)
    every = np.arange(len(seen.keys))
    number = made.cell[:, None] * len(seen.keys) + every
    strength = max(float(np.abs(made.force).max()), 1e-12)
    loads = np.column_stack([made.direction, made.stopped, np.round(2.0 * made.force / strength)])
    _, load = np.unique(loads, axis=0, return_inverse=True)
    states = np.ravel(load)[:, None] * len(seen.keys) + every
    return Problem(
        model.unknowns,
        lambda theta: model.predict(theta).ravel()[use],
        seen.mean.ravel()[use],
        error.ravel()[use],
        free.reshape(use.size, free.shape[2])[use],
        (number.ravel()[use], states.ravel()[use]),
    )


def _offsets(problem: Problem, theta: np.ndarray, error: np.ndarray) -> np.ndarray:
    """What the offsets are that nobody knew, shape (n, keys); zero where nothing counted."""
    left = (problem.seen - problem.predict(theta)) / problem.error
    fitted = np.linalg.lstsq(problem.free / problem.error[:, None], left, rcond=1e-9)[0]
    shifts = np.zeros(error.size)
    shifts[np.isfinite(error).ravel()] = problem.free @ fitted
    return shifts.reshape(error.shape)


def apply(
    mechanism: Mechanism,
    sought: Sequence[Parameter],
    theta: np.ndarray,
    reasons: Sequence[str],
) -> Mechanism:
    """The mechanism with those values that are told."""
    joints, gears = dict(mechanism.clearance), dict(mechanism.gears)
    for one, value, why_not in zip(sought, theta, reasons, strict=True):
        if why_not or not one.joint:
            continue
        if one.name == "gear_play":
            gears[one.joint] = replace(gears[one.joint], play=float(value))
        elif one.name == "gear_compliance":
            gears[one.joint] = replace(gears[one.joint], stiffness=1.0 / max(float(value), 1e-12))
        elif one.name != "dry_friction":
            joints[one.joint] = with_clearance(joints[one.joint], {one.name: float(value)})
    return mechanism._with(joints, gears)


def _notes(unseen: Sequence[str]) -> tuple[str, ...]:
    lines = []
    if unseen:
        lines.append(
            f"note: no encoder of {', '.join(unseen)}: taken where the reference says (or at rest)"
            "; what the drives lag counts as play"
        )
    return tuple(lines)
