"""The numbers that a sweep keeps of every case."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from jointplay.analysis.contact_statistics import shares
from jointplay.analysis.tool_error import COMPONENTS, accuracy, deviation, error_at, stops
from jointplay.motion.reference import Motion
from jointplay.result.result import Result

LOSSES = (
    "normal_dissipation",
    "friction_dissipation",
    "joint_friction_loss",
    "gear_dissipation",
    "film_dissipation",
)

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
    "dissipated_energy": ("J", "lost in contacts, films, joints and gears"),
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
    result: Result, ideal: Result | None, joints: Sequence[str], start: float, motion: Motion | None
) -> dict[str, float]:
    """Measures of a run, by name; `ABOUT` has their units.

    Args:
        result: the run, completed.
        ideal: the ideal mechanism's run of the same work, if the tool error is wanted and the run
            is not itself ideal.
        joints: the joints that have clearance in some case, whose forces are wanted.
        start: what is before is left out of errors, forces and shares [s].
        motion: the reference, for the tool error at its stops.
    """
    found: dict[str, float] = {}
    if ideal is not None:
        found |= _tool_error(result, ideal, start, motion)
    found |= dict(_forces(result, joints, result.time >= start))
    audit = result.audit
    found["impacts"] = float(audit.impacts)
    found["impulse"] = audit.normal_impulse
    losses = {n: float(result[n].values[-1]) for n in LOSSES if n in result.dataset}
    found["dissipated_energy"] = sum(losses.values())
    found |= losses
    for joint in result.joints:
        at = f"_{joint}" if len(joints) > 1 else ""
        for mode, share in shares(result, joint, start=start).items():
            found[f"share_{mode}{at}"] = share
    found["penetration"] = audit.largest_penetration
    found["energy_error"] = audit.relative_energy_residual
    found["under_resolved"] = audit.under_resolved_impulse
    found["warnings"] = float(len(audit.warnings))
    if result.certificate is not None:
        for figure in result.certificate.headline:
            name = re.sub(r"\W+", "_", figure.name.lower()).strip("_")
            found[f"numerical_error_{name}"] = figure.error
    return found


def _tool_error(
    result: Result, ideal: Result, start: float, motion: Motion | None
) -> dict[str, float]:
    error = deviation(result, ideal)
    found: dict[str, float] = {}
    whole = accuracy(error, start)
    for k, part in enumerate(COMPONENTS):
        found[f"tool_error_peak_{part}"] = float(whole.peak[k])
        found[f"tool_error_rms_{part}"] = float(whole.rms[k])
    if motion is not None:
        ends = [s.end for s in stops(motion, float(result.time[-1])) if s.at_rest and s.start > 0]
        ends = [end for end in ends if end >= start]
        if ends:
            largest = np.abs([error_at(error, end) for end in ends]).max(axis=0)
            for k, part in enumerate(COMPONENTS):
                found[f"tool_error_stops_{part}"] = float(largest[k])
    return found


def _forces(result: Result, joints: Sequence[str], kept: np.ndarray) -> Iterator[tuple[str, float]]:
    """Peak and RMS of the joints' forces, of an ideal mechanism too: there they are reactions."""
    for how, name in _JOINT_FORCE.items():
        dimension = "joint" if result.joints else "moving_joint"
        forces = result[name if result.joints else "reaction_force"]
        labels = [str(label) for label in forces[dimension].values]
        wanted = [k for k, label in enumerate(labels) if label in joints] or range(len(labels))
        values = forces.values[kept]
        sizes = np.sqrt(np.einsum("njk,njk->nj", values, values))
        found = {
            labels[k]: float(
                sizes[:, k].max() if how == "peak" else np.sqrt(np.mean(sizes[:, k] ** 2))
            )
            for k in wanted
        }
        yield f"{how}_force", max(found.values())
        if len(joints) > 1:
            for label, value in found.items():
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
