"""Figure of a dynamic budget: each joint alone, all together, and the shares."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.analysis.dynamic_budget import DynamicBudget
from jointplay.plots.style import COLOURS, footnote, new_figure, style


def bars(budget: DynamicBudget) -> Figure:
    """Errors of each source alone and of all together; shares with the interaction."""
    names = [*budget.joints, "all together"]
    rms = [*budget.alone_rms.mean(axis=0), budget.rms.mean()]
    peak = [*budget.alone_peak.max(axis=0), budget.peak.max()]
    parts = np.column_stack([budget.parts, budget.interaction])
    place = np.arange(len(names))
    several = len(parts) > 1
    known = 100 * parts.std(axis=0, ddof=1) / math.sqrt(len(parts)) if several else None
    with style():
        figure = new_figure(8.5, 1.8 + 0.45 * len(names))
        axes: Any = figure.subplots(1, 2)
        axes[0].barh(place - 0.2, 1e3 * np.array(peak), 0.38, color=COLOURS[1], label="peak")
        axes[0].barh(place + 0.2, 1e3 * np.array(rms), 0.38, color=COLOURS[0], label="RMS")
        axes[0].set_yticks(place, names)
        axes[0].set_xlabel("error of the tool [mm]")
        axes[0].legend(fontsize=7)
        axes[1].barh(place, 100 * parts.mean(axis=0), 0.6, xerr=known, color=COLOURS[0])
        axes[1].set_yticks(place, [*budget.joints, "interaction"])
        axes[1].set_xlabel("share of the mean square of the error [%]")
        for panel in axes:
            panel.invert_yaxis()
            panel.axvline(0.0, color="black", lw=0.6)
        footnote(figure, budget.accuracy)
    return figure
