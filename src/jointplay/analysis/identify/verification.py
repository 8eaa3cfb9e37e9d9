"""Whether the full model moves as was measured, with what was identified: means over visits."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from jointplay.analysis.identify.fit import offsets
from jointplay.analysis.identify.ideal import tool_positions
from jointplay.analysis.identify.identification import Identification
from jointplay.errors import JointplayError
from jointplay.kernel import Status
from jointplay.result.result import AXES, Result
from jointplay.simulation.simulation import Simulation


@dataclass(frozen=True)
class Verification:
    """RMS of what models leave of the measured means, offsets taken out, by kind of signal [SI]."""

    measured: dict[str, float]
    """Of the means themselves: what a model without play leaves."""
    static: dict[str, float]
    """Of the static model with what was identified."""
    dynamic: dict[str, float]
    """Of a run of the full model with it."""
    error: dict[str, float]
    """Standard error of the means."""

    def __str__(self) -> str:
        """A line for each kind of signal."""
        lines = []
        for kind in self.measured:
            factor, unit = {"tool": (1e6, "um"), "link": (1e6, "urad")}.get(kind, (1.0, "N m"))
            parts = (self.measured, self.static, self.dynamic, self.error)
            no, static, dynamic, noise = (factor * part[kind] for part in parts)
            lines.append(
                f"{kind}: RMS left over [{unit}] without play {no:.4g}, static model {static:.4g}, "
                f"simulated {dynamic:.4g}; standard error of the means {noise:.4g}"
            )
        return "\n".join(lines)


def verify(
    simulation: Simulation, identification: Identification, progress: bool = False
) -> Verification:
    """Run the motion with what was identified, and compare means over the same visits.

    Args:
        simulation: of the motion and the loads that were measured, times alike.
        identification: what was identified.
        progress: show a bar.

    Raises:
        JointplayError: a scenario without motion; a measurement that begins later or ends earlier
            than all motion; a run that fails.
    """
    if simulation.motion is None:
        raise JointplayError("to verify, the scenario must have the motion that was measured")
    end = float(identification.visits.time.max())
    own = replace(simulation, mechanism=identification.mechanism, duration=end)
    result = own.run(progress=progress)
    if result.status != Status.COMPLETED:
        raise JointplayError(f"the run with what was identified failed: {result.message}")
    means = _means(result, identification)
    tool = tool_positions(
        identification.mechanism, identification.visits.joints, identification.visits.position
    )
    made = identification.visits
    free = offsets(
        identification.observed.keys, made.cell, made.position, tool, identification.reference
    )
    free = np.concatenate([free, identification.loose], axis=2)
    use = np.isfinite(identification.error) & np.isfinite(means)
    weights = np.where(use, 1.0 / identification.error, 0.0).ravel()
    design = free.reshape(use.size, free.shape[2]) * weights[:, None]
    basis, sizes, _ = np.linalg.svd(design, full_matrices=False)
    basis = basis[:, sizes > 1e-9 * sizes.max(initial=1e-300)]

    def left(values: np.ndarray) -> np.ndarray:
        scaled = np.where(use, values, 0.0).ravel() * weights
        rest = (scaled - basis @ (basis.T @ scaled)).reshape(use.shape)
        return np.where(use, rest * identification.error, np.nan)

    def rms(values: np.ndarray) -> dict[str, float]:
        kinds = [kind for kind, _ in identification.observed.keys]
        return {
            kind: float(np.sqrt(np.nanmean(values[:, [k == kind for k in kinds]] ** 2)))
            for kind in dict.fromkeys(kinds)
            if use[:, [k == kind for k in kinds]].any()
        }

    seen = identification.observed.mean
    return Verification(
        rms(left(seen)),
        rms(left(seen - identification.predicted)),
        rms(left(seen - means)),
        rms(np.where(use, identification.error, np.nan)),
    )


def _means(result: Result, identification: Identification) -> np.ndarray:
    """What a run shows at the visits, shape (n, keys)."""
    mechanism, joints = identification.mechanism, identification.visits.joints
    motors = result["q"].values[:, [mechanism.motor(name) for name in joints]]
    ideal = tool_positions(mechanism, joints, motors)
    values = []
    for kind, name in identification.observed.keys:
        if kind == "tool":
            i = AXES.index(name)
            values.append(result["tool_position"].values[:, i] - ideal[:, i])
        elif kind == "link":
            link = result["q"].values[:, mechanism.coordinate(name)]
            values.append(link - motors[:, joints.index(name)])
        else:
            values.append(result["drive"].values[:, mechanism.motor(name)])
    table = np.column_stack(values)
    means = np.full((len(identification.visits), len(values)), np.nan)
    for i, (begin, end) in enumerate(identification.visits.time):
        inside = (result.time >= begin) & (result.time <= end)
        if inside.any():
            means[i] = table[inside].mean(axis=0)
    return means
