"""Clearances and friction from measurements: what was found, how well, and what cannot be told."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from jointplay.analysis.identify import planning
from jointplay.analysis.identify.bounces import Restitution, restitutions
from jointplay.analysis.identify.fit import (
    REFERENCES,
    Fit,
    Problem,
    offsets,
)
from jointplay.analysis.identify.ideal import tool_positions
from jointplay.analysis.identify.model import StaticModel
from jointplay.analysis.identify.parameters import (
    Parameter,
    unknowns,
    with_clearance,
)
from jointplay.analysis.identify.reading import Key, Measurement
from jointplay.analysis.identify.search import search
from jointplay.analysis.identify.verdicts import advice, reason
from jointplay.analysis.identify.visits import Observed, Visits, positions, visits
from jointplay.analysis.poses import moving
from jointplay.errors import JointplayError, MissingName
from jointplay.loads.drive import JointFriction
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.simulation.simulation import Simulation


@dataclass(frozen=True)
class Identification:
    """What a measurement says of p unknowns; SI units."""

    unknowns: tuple[Parameter, ...]
    value: np.ndarray
    """Shape (p,)."""
    half_width: np.ndarray
    """Of the 95 % intervals; infinite where nothing is told, shape (p,)."""
    reasons: tuple[str, ...]
    """Why an unknown cannot be told, empty where it can."""
    advice: tuple[str, ...]
    """Which measurement would tell it, empty where none is needed or known."""
    mechanism: Mechanism
    """With what was found; unknowns that cannot be told as in the scenario."""
    visits: Visits
    observed: Observed
    error: np.ndarray
    """Standard errors of the means that counted, nan where none did, (n, keys) [SI]."""
    predicted: np.ndarray
    """By the static model with what was found, offsets included, shape (n, keys) [SI]."""
    loose: np.ndarray
    """What friction may hold anywhere at stops, see `StaticModel.loose`."""
    misfit: float
    """RMS of what the model leaves, in standard errors."""
    reference: str
    notes: tuple[str, ...]
    restitutions: tuple[Restitution, ...] = ()
    """Of the joints' impacts, where there is an accelerometer."""

    @property
    def told(self) -> np.ndarray:
        """Which unknowns can be told, shape (p,)."""
        return np.array([not reason for reason in self.reasons])

    def __getitem__(self, label: str) -> tuple[float, float]:
        """Value and half width by label, such as ``"elbow radial clearance"``."""
        for i, one in enumerate(self.unknowns):
            if one.label == label:
                return float(self.value[i]), float(self.half_width[i])
        raise MissingName("unknown", label, [one.label for one in self.unknowns])

    def interval(self, i: int) -> tuple[float, float]:
        """95 % interval of the i-th unknown within what can be."""
        value, half = self.value[i], self.half_width[i]
        return max(value - half, 0.0), min(value + half, self.unknowns[i].most)

    def __str__(self) -> str:
        """The table, and why what cannot be told cannot."""
        lines = [f"{'unknown':<34} {'scenario':>12} {'found':>12}  95 % interval"]
        for i, one in enumerate(self.unknowns):
            if not one.sought:
                continue
            head = f"{one.label:<34} {one.shown(one.nominal):>12}"
            if self.reasons[i]:
                lines.append(f"{head} {'-':>12}  this measurement cannot tell")
            else:
                low, high = self.interval(i)
                interval = f"{one.shown(low)} to {one.shown(high)}"
                lines.append(f"{head} {one.shown(self.value[i]):>12}  {interval}")
        lines += [str(one) for one in self.restitutions]
        if not self.unknowns:
            return "\n".join([*self.notes, *lines])
        for i, one in enumerate(self.unknowns):
            if one.sought and self.reasons[i]:
                lines.append(f"{one.label}: {self.reasons[i]}")
                if self.advice[i]:
                    lines.append(f"  {self.advice[i]}")
        used = np.isfinite(self.error)
        at = used.any(axis=1)
        lines.append(
            f"statistical, static model; {int(at.sum())} visits "
            f"({int((self.visits.stopped & at).sum())} stops) of "
            f"{len(np.unique(self.visits.cell[at]))} places, {int(used.sum())} means; "
            f"left over: {self.misfit:.2g} standard errors (RMS; 1 is what noise explains)"
        )
        return "\n".join([*self.notes, *lines])

    def csv(self) -> str:
        """A row for each unknown [SI]."""
        out = io.StringIO()
        writer = csv.writer(out, lineterminator="\n")
        writer.writerow(["joint", "unknown", "unit", "scenario", "found", "low", "high", "why_not"])
        for i, one in enumerate(self.unknowns):
            if one.sought:
                low, high = self.interval(i)
                numbers = [one.nominal, *(("", "", "") if self.reasons[i] else ())]
                if not self.reasons[i]:
                    numbers += [f"{x:.9g}" for x in (self.value[i], low, high)]
                writer.writerow([one.joint, one.name, one.unit, *numbers, self.reasons[i]])
        for other in self.restitutions:
            ends = [other.value, other.value - other.half_width, other.value + other.half_width]
            numbers = ["", "", ""] if other.reason else [f"{x:.9g}" for x in ends]
            writer.writerow([other.joint, "restitution", "", "", *numbers, other.reason])
        return out.getvalue()


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
) -> Identification:
    """Clearances, friction and play of gears from measured signals.

    Means over stops and slow stretches are compared with the static model, never single records.

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

    Raises:
        JointplayError: bad data (see `Measurement`); loops; nothing has play; a motion that never
            reverses; fewer means than unknowns.
    """
    mechanism, motion, friction = _inputs(machine, motion, joint_friction)
    if reference not in REFERENCES:
        raise MissingName("reference", reference, REFERENCES)
    if mechanism.loops:
        raise JointplayError(
            f"loop {next(iter(mechanism.loops))!r}: identify is for robots without closed loops"
        )
    measured = _read(measured, mechanism, noise)
    bounced = restitutions(mechanism, measured)
    made, seen = visits(mechanism, measured, motion)
    if not seen.keys and bounced:
        return _bounces_only(mechanism, made, seen, reference, bounced)
    if not seen.keys:
        raise JointplayError(
            f"{measured.source} has nothing that play would show in: tool x (y, z), JOINT link of "
            "a gear with play, or JOINT torque is needed beside the motors' encoders"
        )
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
        bounced,
    )


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
        raise JointplayError(
            f"{source}: {len(problem.seen)} means at {len(error)} visits are too few for "
            f"{len(start)} unknowns and {problem.offsets} offsets; visit places more often, from "
            "both sides"
        )
    return problem, fit


def _bounces_only(
    mechanism: Mechanism,
    made: Visits,
    seen: Observed,
    reference: str,
    bounced: tuple[Restitution, ...],
) -> Identification:
    """What an accelerometer alone says."""
    none = np.zeros((len(made), 0))
    nothing = np.zeros(0)
    return Identification(
        (), nothing, nothing, (), (), mechanism, made, seen, none, none, none[..., None],
        np.nan, reference, (),
        bounced,
    )  # fmt: skip


def _read(
    measured: Measurement | str | Path, mechanism: Mechanism, noise: Mapping[str, float] | None
) -> Measurement:
    if not isinstance(measured, Measurement):
        entries = mechanism.description.joints
        slides = {name: entries[name].slides for name in moving(mechanism)}
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
        raise JointplayError(
            f"{measured.source}: no visit counts: each gear must cross its play before, by a "
            "reversal or a push"
        )
    if reference != "place":
        return
    ways = np.column_stack([made.cell, made.direction, np.round(made.force, 3)])[at]
    places = np.unique(ways, axis=0)[:, 0]
    if len(np.unique(places)) == len(places) and not {k for k, _ in keys} & {"torque"}:
        raise JointplayError(
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
