"""Figure of an identification: what was found beside the scenario, and how the means agree."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.analysis.identify import Identification
from jointplay.plots.style import COLOURS, new_figure, style

_SCALES = {
    "tool": (1e6, "tool off ideal [µm]"),
    "link": (1e3, "link - motor [mrad]"),
}


def identification(fit: Identification) -> Figure:
    """Intervals relative to the scenario's values, and predicted means over measured ones."""
    kinds = list(dict.fromkeys(kind for kind, _ in fit.observed.keys))
    with style():
        shown = [i for i, one in enumerate(fit.unknowns) if one.sought]
        figure = new_figure(4.6 + 3.0 * len(kinds), max(2.0 + 0.3 * len(shown), 3.2))
        axes: Any = figure.subplots(1, 1 + len(kinds), squeeze=False)[0]
        _intervals(axes[0], fit, shown)
        for panel, kind in zip(axes[1:], kinds, strict=True):
            _agreement(panel, fit, kind)
        figure.supxlabel(
            f"statistical, static model; bars: 95 % intervals; left over {fit.misfit:.2g} "
            "standard errors (RMS)",
            fontsize=6,
        )
    return figure


def _intervals(panel: Any, fit: Identification, shown: list[int]) -> None:
    """What was found, over the scenario's value; names of what cannot be told stay empty."""
    place = np.arange(len(shown))
    for row, i in enumerate(shown):
        one = fit.unknowns[i]
        if fit.reasons[i]:
            panel.text(1.0, row, "cannot tell", va="center", ha="center", color="0.4", fontsize=7)
            continue
        low, high = (value / one.scale for value in fit.interval(i))
        panel.plot([low, high], [row, row], color=COLOURS[1], lw=2.0)
        panel.plot(fit.value[i] / one.scale, row, "o", ms=4, color=COLOURS[1])
    panel.axvline(1.0, color="0.5", lw=0.8, ls=":")
    panel.set_yticks(place, [fit.unknowns[i].label for i in shown])
    panel.set_ylim(len(shown) - 0.5, -0.5)
    panel.set_xlim(left=0.0)
    panel.set_xlabel("found / scenario")


def _agreement(panel: Any, fit: Identification, kind: str) -> None:
    """Means by the model over measured ones, offsets included."""
    factor, label = _SCALES.get(kind, (1.0, "torque [N m]"))
    ends = []
    for column, (own, name) in enumerate(fit.observed.keys):
        use = np.isfinite(fit.error[:, column])
        if own != kind or not use.any():
            continue
        x = factor * fit.observed.mean[use, column]
        y = factor * fit.predicted[use, column]
        ends += [x.min(), x.max()]
        colour = COLOURS[column % len(COLOURS)]
        bars = factor * fit.error[use, column]
        panel.errorbar(x, y, xerr=bars, fmt=".", ms=3, lw=0.5, color=colour, label=name)
    if ends:
        panel.plot([min(ends), max(ends)], [min(ends), max(ends)], color="0.5", lw=0.7)
        panel.legend(fontsize=6)
    panel.set_xlabel(f"measured: {label}")
    panel.set_ylabel("static model")
