"""Figure of wear: the tool's error and the joints' clearances over the cycles."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.analysis.maintenance import Maintenance
from jointplay.plots.style import COLOURS, footnote, new_figure, style


def course(estimate: Maintenance) -> Figure:
    """The tool's error up to its tolerance, and each joint's growth of clearance."""
    aside = np.sqrt(np.cumsum(np.nan_to_num(estimate.scatter) ** 2))
    with style():
        figure = new_figure(7.5, 3.4)
        axes: Any = figure.subplots(1, 2)
        axes[0].errorbar(
            estimate.cycles,
            1e3 * estimate.error,
            xerr=2.0 * aside,
            fmt="o-",
            ms=3,
            capsize=2,
            color=COLOURS[0],
            label="worst case, static",
        )
        axes[0].axhline(1e3 * estimate.target, color="black", ls="--", label="tolerance")
        axes[0].set(xlabel="cycles", ylabel="error of the tool [mm]")
        axes[0].set_ylim(bottom=0.0)
        axes[0].legend(fontsize=7)
        for name, depths in zip(estimate.joints, estimate.growth.T, strict=True):
            axes[1].plot(estimate.cycles, 1e6 * depths, "o-", ms=3, label=name)
        axes[1].set(xlabel="cycles", ylabel="growth of clearance, deepest [um]")
        axes[1].legend(fontsize=7)
        low, high = estimate.spread
        footnote(
            figure,
            "an estimate from simulated cycles; bars: two standard errors of the perturbed runs; "
            f"{low:.2g} to {high:.2g} cycles if wear rates are known to a factor of "
            f"{estimate.factor:g}",
        )
    return figure
