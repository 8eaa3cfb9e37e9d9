"""What the samples of a sweep say of a measure, in words."""

from __future__ import annotations

import numpy as np
import xarray as xr

from jointplay.errors import JointplayError
from jointplay.sweeps.plan import REPEAT, SAMPLE
from jointplay.sweeps.table import measured, scale
from jointplay.sweeps.uncertainty import (
    Estimate,
    SobolIndices,
    convergence,
    enough,
    estimate,
    sobol_indices,
)

QUANTILES = (0.05, 0.5, 0.95, 0.99)


def samples_of(dataset: xr.Dataset, measure: str) -> tuple[np.ndarray, int]:
    """Values of a measure in the order of the samples, and how many of them are independent.

    Of a saltelli design only the base sample's points are; repeats are averaged, for runs of the
    same point are not independent samples.

    Raises:
        JointplayError: no such measure, or nothing is sampled; a grid besides the samples.
    """
    values = measured(dataset, measure)
    grid = [d for d in values.dims if d not in (SAMPLE, REPEAT)]
    if any(values.sizes[d] > 1 for d in grid):
        raise JointplayError(
            f"the sweep has a grid as well ({', '.join(map(str, grid))}); take one point of it "
            "with jointplay.open_sweep(...).isel(...)"
        )
    if SAMPLE not in values.dims and REPEAT not in values.dims:
        raise JointplayError("nothing is sampled in this sweep, and nothing repeated")
    if SAMPLE in values.dims and REPEAT in values.dims:
        values = values.mean(REPEAT)
    flat = values.values.ravel()
    if dataset.attrs["sampling"] == "saltelli" and dataset.attrs["sampled"]:
        block = len(dataset.attrs["sampled"]) + 2
        return flat.reshape(-1, block)[:, [0, -1]].ravel(), len(flat)
    return flat, len(flat)


def indices_of(dataset: xr.Dataset, measure: str) -> SobolIndices | None:
    """Sobol indices of a measure; None where the design is not one for them.

    Raises:
        JointplayError: a case has no value, or SALib is not installed.
    """
    if dataset.attrs["sampling"] != "saltelli" or not dataset.attrs["sampled"]:
        return None
    values = measured(dataset, measure)
    if REPEAT in values.dims:
        values = values.mean(REPEAT)
    return sobol_indices(values.values.ravel(), tuple(dataset.attrs["sampled"]))


def statements(dataset: xr.Dataset, measure: str, precision: float) -> str:
    """Mean, standard deviation, quantiles, how many runs are enough, Sobol indices: in lines.

    Args:
        dataset: of `open_sweep`.
        measure: its name.
        precision: relative half width of a confidence interval that is enough.

    Raises:
        JointplayError: see `samples_of`, `indices_of`.
    """
    if not 0.0 < precision < 1.0:
        raise JointplayError(f"precision must lie between 0 and 1, got {precision:g}")
    values, _ = samples_of(dataset, measure)
    factor, unit = scale(dataset, measure)
    known = int(np.isfinite(values).sum())
    lines = [f"{measure}: {known} samples" + (f", {len(values) - known} without a value"
             if known < len(values) else "")]  # fmt: skip
    lines += [_line(estimate(values, name), factor, unit) for name in ("mean", "std")]
    lines += [_line(estimate(values, "quantile", p), factor, unit) for p in QUANTILES]
    for name, probability in (("mean", 0.5), ("quantile", 0.95)):
        runs = enough(convergence(values, name, probability), precision)
        what = "mean" if name == "mean" else f"{100 * probability:g} % quantile"
        lines.append(
            f"  {what} within {100 * precision:g} %: "
            + (f"{runs} runs were enough" if runs else f"{known} runs are not enough")
        )
    indices = indices_of(dataset, measure)
    if indices is not None:
        lines.append("  Sobol indices (share of the variance): alone, with all others")
        for k, name in enumerate(indices.names):
            alone = f"{indices.first[k]:.2f} ± {indices.first_confidence[k]:.2f}"
            total = f"{indices.total[k]:.2f} ± {indices.total_confidence[k]:.2f}"
            lines.append(f"    {name:<24} {alone}   {total}")
    return "\n".join(lines)


def _line(statistic: Estimate, factor: float, unit: str) -> str:
    low, high = (f"{factor * end:.4g}" if np.isfinite(end) else "unknown"
                 for end in (statistic.low, statistic.high))  # fmt: skip
    unit = "" if unit == "1" else unit
    text = f"  {statistic.name:<5} {factor * statistic.value:.4g} {unit} (95 %: {low} to {high})"
    return text.rstrip()
