"""The numbers that a sweep keeps of every case."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from jointplay.analysis.tool_error import COMPONENTS, deviation, stops
from jointplay.geometry import Mode
from jointplay.loads.terms import LOSSES
from jointplay.motion.reference import Motion
from jointplay.result.result import Result

COST = "cost"
"""Name of the measure that no two runs share: seconds of processor time."""

ABOUT: dict[str, tuple[str, str]] = {
    "tool_error_peak": ("m", "largest distance from the ideal mechanism's tool along {part}"),
    "tool_error_rms": ("m", "RMS distance from the ideal mechanism's tool along {part}"),
    "tool_error_stops": ("m", "largest tool error along {part} where the reference stands still"),
    "peak_force": ("N", "largest joint force{part}"),
    "rms_force": ("N", "RMS joint force{part}"),
    "impacts": ("1", "contacts that began"),
    "impulse": ("N s", "normal impulse of all contacts"),
    "dissipated_energy": ("J", "lost in contacts, films, joints, gears and loads"),
    **{name: ("J", name.replace("_", " ")) for name in LOSSES},
    "share": ("1", "share of the time in mode {part}"),
    "penetration": ("m", "deepest penetration"),
    "energy_error": ("1", "error of the energy balance over the energy exchanged"),
    "under_resolved": ("1", "share of the normal impulse in contacts of too few steps"),
    "warnings": ("1", "warnings of the run's audit"),
    "numerical_error": ("", "numerical error of the {part}, from refined runs"),
    COST: ("s", "processor time of the case, its checks and its measures included"),
}
"""Unit and meaning of the measures, by what their names begin with."""

_JOINT_FORCE = {"peak": "joint_force_peak", "rms": "joint_force"}


def about(name: str) -> tuple[str, str]:
    """Unit and meaning of a measure; of a user's own, nothing is known but its name."""
    for begin in sorted(ABOUT, key=len, reverse=True):
        if name == begin or name.startswith(f"{begin}_"):
            unit, text = ABOUT[begin]
            part = name[len(begin) + 1 :].replace("_", " ")
            if begin.endswith("_force"):
                part = f" at {name[len(begin) + 1 :]}" if part else ""
            if begin.startswith("tool_error"):
                part = "all axes" if part == "total" else part
            return unit, text.format(part=part)
    return "", name.replace("_", " ")


def measure(
    result: Result,
    ideal: Result | None,
    joints: Sequence[str],
    rests: Sequence[float] = (),
) -> dict[str, float]:
    """Measures of a run, by name; `ABOUT` has their units.

    What is before `Result.judge_from` is left out, but of what the run says of its own quality.

    Args:
        result: the run, completed.
        ideal: the ideal mechanism's run of the same work, or the run itself if it is ideal; None if
            the tool error is not wanted.
        joints: the joints that have clearance in some case, whose forces are wanted.
        rests: times at which the reference stands still [s].
    """
    measures: dict[str, float] = {}
    start = result.judge_from
    if ideal is not None:
        measures |= dict(_tool_error(result, ideal, start, rests))
    kept = result.time >= start
    measures |= dict(_forces(result, joints, kept))
    audit = result.audit
    measures["impacts"] = float(audit.judged_impacts or 0)
    measures["impulse"] = audit.judged_impulse or 0.0
    losses = {n: _lost(result, n, kept) for n in LOSSES if n in result.dataset.variables}
    measures["dissipated_energy"] = sum(losses.values())
    if "load_work" in result.dataset.variables:
        taken = -_since(_values(result, "load_work"), kept)
        measures["dissipated_energy"] += float(np.maximum(taken, 0.0).sum())
    measures |= losses
    for k, joint in enumerate(result.joints):
        at = f"_{joint}" if len(joints) > 1 else ""
        modes = np.bincount(_values(result, "mode")[kept, k], minlength=len(Mode))
        for mode in Mode:
            measures[f"share_{mode.name.lower()}{at}"] = float(modes[mode] / max(kept.sum(), 1))
    measures["penetration"] = audit.largest_penetration if kept.all() else _deepest(result, kept)
    measures["energy_error"] = audit.relative_energy_residual
    measures["under_resolved"] = audit.under_resolved_impulse
    measures["warnings"] = float(len(audit.warnings))
    if result.certificate is not None:
        for figure in result.certificate.headline:
            name = re.sub(r"\W+", "_", figure.name.lower()).strip("_")
            measures[f"numerical_error_{name}"] = figure.error
    return measures


def _since(values: np.ndarray, kept: np.ndarray) -> np.ndarray:
    """What was added to a sum in the records that are kept, the last ones of the run."""
    added: np.ndarray = values[-1] - values[int(kept.argmax())]
    return added


def _lost(result: Result, name: str, kept: np.ndarray) -> float:
    return float(_since(_values(result, name), kept))


def _deepest(result: Result, kept: np.ndarray) -> float:
    """The deepest penetration in the records that are kept; 0 if nothing touched [m]."""
    if "gap_min" not in result.dataset.variables:
        return 0.0
    gaps = _values(result, "gap_min")[kept]
    return float(np.fmax.reduce(-gaps, axis=None, initial=0.0))


def _values(result: Result, name: str) -> np.ndarray:
    """A variable without its labels, which cost more than the reckoning."""
    values: np.ndarray = result.dataset.variables[name].values
    return values


def _tool_error(
    result: Result, ideal: Result, start: float, rests: Sequence[float]
) -> Iterator[tuple[str, float]]:
    """Peak, RMS and largest error at rest of the tool: those of `analysis.accuracy`."""
    time = result.time
    if np.array_equal(ideal.time, time):
        error = _values(result, "tool_position") - _values(ideal, "tool_position")
    else:
        error = deviation(result, ideal).values
        time = time[: len(error)]
    error = np.column_stack([error, np.linalg.norm(error, axis=1)])
    kept = error[time >= start]
    at = [int(np.abs(time - rest).argmin()) for rest in rests if start <= rest <= time[-1]]
    for k, part in enumerate(COMPONENTS):
        if len(kept):
            yield f"tool_error_peak_{part}", float(np.abs(kept[:, k]).max())
            yield f"tool_error_rms_{part}", float(np.sqrt(np.mean(kept[:, k] ** 2)))
        if at:
            yield f"tool_error_stops_{part}", float(np.abs(error[at, k]).max())


def rests_of(motion: Motion | None, end: float) -> tuple[float, ...]:
    """Times up to `end` at which the reference stands still, the start aside [s]."""
    if motion is None:
        return ()
    return tuple(stop.end for stop in stops(motion, end) if stop.at_rest and stop.start > 0.0)


def _forces(result: Result, joints: Sequence[str], kept: np.ndarray) -> Iterator[tuple[str, float]]:
    """Peak and RMS of the joints' forces, of an ideal mechanism too: there they are reactions."""
    dimension = "joint" if result.joints else "moving_joint"
    labels = [str(label) for label in _values(result, dimension)]
    wanted = [k for k, label in enumerate(labels) if label in joints] or range(len(labels))
    for how, name in _JOINT_FORCE.items():
        values = _values(result, name if result.joints else "reaction_force")[kept]
        squares = np.einsum("njk,njk->nj", values, values)
        sums = squares.max(axis=0) if how == "peak" else squares.mean(axis=0)
        forces = {labels[k]: float(np.sqrt(sums[k])) for k in wanted}
        yield f"{how}_force", max(forces.values())
        if len(joints) > 1:
            for label, value in forces.items():
                yield f"{how}_force_{label}", value


def own(name: str, returned: Any) -> dict[str, float]:
    """Numbers that a user's measure returned, by name.

    Args:
        name: ``module:function``.
        returned: a number, or several by name.

    Raises:
        TypeError: it is neither.
    """
    function = name.rpartition(":")[2]
    several = returned if isinstance(returned, dict) else {function: returned}
    return {str(key): float(value) for key, value in several.items()}
