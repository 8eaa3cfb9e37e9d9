"""Measures: the numbers that a sweep keeps of every case."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.physics.contact.functions import function_at
from jointplay.physics.geometry import Mode
from jointplay.simulation.analysis.bearings import bearing_life
from jointplay.simulation.analysis.tool_error import (
    COMPONENTS,
    error_at,
    error_statistics,
    stops,
)
from jointplay.simulation.analysis.twins import rolls
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.variables import LOSSES

if TYPE_CHECKING:
    import xarray as xr

    from jointplay.simulation.simulation import Simulation

COST = "cost"
"""Name of the only measure that differs between equal runs: processor time [s]."""
USER = "user"
"""Origin of the measures that a user's own functions return."""
NUMERICAL_ERROR = "numerical_error_"
"""Prefix of the measures that give the numerical error of a certified figure."""
BEARING = {
    "largest_element_load": ("N", "largest load of a rolling element"),
    "loaded_elements": ("1", "most rolling elements that bore load at a time"),
    "bearing_life": ("1", "L10 in revolutions, at the loads of the motion"),
    "bearing_life_hours": ("h", "L10 in hours of repeating the motion"),
}
"""Measures of joints with a rolling bearing, with unit and meaning; `analysis.BearingLife`."""
_JOINT_FORCE = {"peak": "joint_force_peak", "rms": "joint_force"}
"""History from which each statistic of the joint forces is taken."""


def shipped(joints: Sequence[str]) -> dict[str, tuple[str, str]]:
    """Unit and meaning by name of all measures that `measure` can return, but `NUMERICAL_ERROR`."""
    meanings = {COST: ("s", "processor time of the case, its checks and its measures included")}

    def add(name: str, unit: str, text: str, where: str) -> None:
        meanings[name] = unit, text
        meanings.update({f"{name}_{j}": (unit, f"{text}{where} {j}") for j in joints})

    for part in COMPONENTS:
        along = "all axes" if part == "total" else part
        off = f"distance from the ideal mechanism's tool along {along}"
        meanings[f"tool_error_peak_{part}"] = "m", f"largest {off}"
        meanings[f"tool_error_rms_{part}"] = "m", f"RMS {off}"
        rests = f"largest tool error along {along} where the reference stands still"
        meanings[f"tool_error_stops_{part}"] = "m", rests
    add("peak_force", "N", "largest joint force", " at")
    add("rms_force", "N", "RMS joint force", " at")
    for mode in (mode.name.lower() for mode in Mode):
        add(f"share_{mode}", "1", f"share of the time in mode {mode.replace('_', ' ')}", ", at")
    for name, (unit, text) in BEARING.items():
        add(name, unit, text, ", at")
    return meanings | {
        "impacts": ("1", "contacts that began"),
        "impulse": ("N s", "normal impulse of all contacts"),
        "dissipated_energy": ("J", "lost in contacts, films, joints, gears and loads"),
        **{name: ("J", name.replace("_", " ")) for name in LOSSES},
        "penetration": ("m", "deepest penetration"),
        "energy_error": ("1", "error of the energy balance over the energy exchanged"),
        "under_resolved": ("1", "share of the normal impulse in contacts of too few steps"),
        "warnings": ("1", "warnings of the run's audit"),
    }


def measure(
    result: Result, error: xr.DataArray | None, joints: Sequence[str], rests: Sequence[float] = ()
) -> dict[str, float]:
    """Measures of a run, by name; `shipped` has their units.

    Only the time from `Result.judge_from` on counts, except in the measures of the run's quality
    (energy error, resolution, warnings).

    Args:
        result: the run, completed.
        error: the tool's `deviation`; None: none is wanted.
        joints: joints that have clearance in some case; the forces of each are wanted.
        rests: times at which the reference stands still [s].
    """
    measures: dict[str, float] = {}
    start = result.judge_from
    if error is not None:
        measures |= dict(_tool_error(error, start, rests))
    judged = result.time >= start
    measures |= dict(_forces(result, joints, judged))
    audit = result.audit
    measures["impacts"] = float(audit.judged_impacts)
    measures["impulse"] = audit.judged_impulse
    # Energy lost between the first judged record and the last.
    recorded = result.dataset.variables
    losses = {name: float(_since(result, name, judged)) for name in LOSSES if name in recorded}
    measures["dissipated_energy"] = sum(losses.values())
    if "load_work" in recorded:
        absorbed = -_since(result, "load_work", judged)
        measures["dissipated_energy"] += float(np.maximum(absorbed, 0.0).sum())
    measures |= losses
    for k, joint in enumerate(result.joints):
        suffix = f"_{joint}" if len(joints) > 1 else ""
        modes = np.bincount(_values(result, "mode")[judged, k], minlength=len(Mode))
        for mode in Mode:
            share = float(modes[mode] / max(judged.sum(), 1))
            measures[f"share_{mode.name.lower()}{suffix}"] = share
    measures |= dict(_bearings(result, joints, judged))
    # The audit knows the deepest penetration of all steps, the histories that of records.
    whole_run = bool(judged.all())
    measures["penetration"] = audit.largest_penetration if whole_run else _deepest(result, judged)
    measures["energy_error"] = audit.relative_energy_residual
    measures["under_resolved"] = audit.under_resolved_impulse
    measures["warnings"] = float(len(audit.warnings))
    if result.certificate is not None:
        for figure in result.certificate.headline:
            name, _, joint = figure.name.partition(", ")
            name = f"{NUMERICAL_ERROR}{name.lower().replace(' ', '_')}"
            measures[f"{name}_{joint}" if joint else name] = figure.error
    return measures


def needed(simulation: Simulation) -> list[str] | None:
    """Histories of a run that `measure` reads; None: all.

    The life of rolling bearings, and a tool observed from a free base, need most of them.
    """
    mechanism = simulation.mechanism
    rolling = any(joint.resultant is not None for joint in mechanism.clearance.values())
    if rolling or mechanism.free_base is not None:
        return None
    forces = [*_JOINT_FORCE.values(), "mode", "gap_min"]
    if not mechanism.clearance:
        forces = ["reaction_force"]
    return ["tool_position", *forces, *LOSSES, "load_work"]


def _bearings(
    result: Result, joints: Sequence[str], judged: np.ndarray
) -> Iterator[tuple[str, float]]:
    """Yield loads and life of rolling bearings by name; nothing from a single record."""
    if judged.sum() < 2:
        return
    for joint in result.joints:
        if not rolls(result, joint):
            continue
        life = bearing_life(result, joint)
        values = (life.largest_load, life.most_loaded, life.revolutions, life.hours)
        for name, value in zip(BEARING, values, strict=True):
            yield f"{name}_{joint}" if len(joints) > 1 else name, float(value)


def _since(result: Result, name: str, judged: np.ndarray) -> np.ndarray:
    """Growth of a cumulative history over the judged records."""
    values = _values(result, name)
    return np.asarray(values[-1] - values[int(judged.argmax())])


def _deepest(result: Result, judged: np.ndarray) -> float:
    """Deepest penetration in the judged records; 0 if nothing touched [m]."""
    if "gap_min" not in result.dataset.variables:
        return 0.0
    gaps = _values(result, "gap_min")[judged]
    return float(np.fmax.reduce(-gaps, axis=None, initial=0.0))


def _values(result: Result, name: str) -> np.ndarray:
    values: np.ndarray = result.dataset.variables[name].values
    return values


def _tool_error(
    error: xr.DataArray, start: float, rests: Sequence[float]
) -> Iterator[tuple[str, float]]:
    """Yield peak and RMS of the tool's error, and the largest where the reference rests, by name
    and axis; see `analysis.error_statistics`.
    """
    last = error["time"].values[-1]
    stop_errors = [error_at(error, rest) for rest in rests if start <= rest <= last]
    statistics = {"stops": np.abs(stop_errors).max(axis=0)} if stop_errors else {}
    if last >= start:
        errors = error_statistics(error, start)
        statistics |= {"peak": errors.peak, "rms": errors.rms}
    for name, values in statistics.items():
        for part, value in zip(COMPONENTS, values, strict=True):
            yield f"tool_error_{name}_{part}", float(value)


@lru_cache(maxsize=1)  # the cases of a sweep mostly have the same motion
def rests_of(motion: Motion | None, end: float) -> tuple[float, ...]:
    """Times up to `end` at which the reference stands still, without the start [s]."""
    if motion is None:
        return ()
    return tuple(stop.end for stop in stops(motion, end) if stop.at_rest and stop.start > 0.0)


def _forces(
    result: Result, joints: Sequence[str], judged: np.ndarray
) -> Iterator[tuple[str, float]]:
    """Yield peak and RMS of the joint forces by name; in an ideal mechanism of the reactions."""
    dimension = "joint" if result.joints else "moving_joint"
    labels = [str(label) for label in _values(result, dimension)]
    indices = [k for k, label in enumerate(labels) if label in joints] or range(len(labels))
    for statistic, name in _JOINT_FORCE.items():
        values = _values(result, name if result.joints else "reaction_force")[judged]
        squares = np.einsum("njk,njk->nj", values, values)
        sums = squares.max(axis=0) if statistic == "peak" else squares.mean(axis=0)
        forces = {labels[k]: float(np.sqrt(sums[k])) for k in indices}
        yield f"{statistic}_force", max(forces.values())
        if len(joints) > 1:
            for label, value in forces.items():
                yield f"{statistic}_force_{label}", value


# Measures of a user's own: functions of a result, named ``module:function``.


def measure_function(name: str) -> Any:
    """The function that ``module:function`` names, in a module that has been imported.

    Raises:
        JointplayError: the module has not been imported, or has no such function.
    """
    try:
        return function_at(name)
    except JointplayError as error:
        raise JointplayError(str(error).replace("law", "measure", 1)) from None
