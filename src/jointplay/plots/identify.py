"""Figure of an identification: what was found beside the scenario, restitution, agreement."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.analysis.identify import Identification
from jointplay.plots.style import COLOURS, footnote, new_figure, style

_SCALES = {
    "tool": (1e6, "tool off ideal [µm]"),
    "link": (1e3, "link - motor [mrad]"),
}


def identification(fit: Identification) -> Figure:
    """Intervals relative to the scenario's values, predicted means over measured, restitution."""
    kinds = list(dict.fromkeys(kind for kind, _ in fit.observed.keys))
    words = "statistical; bars: 95 % intervals"
    with style():
        shown = [i for i, one in enumerate(fit.unknowns) if one.sought]
        bounced = bool(fit.restitutions)
        count = bool(shown) + len(kinds) + bounced
        figure = new_figure(1.6 + 3.0 * count, max(2.0 + 0.3 * len(shown), 3.2))
        axes: Any = iter(figure.subplots(1, count, squeeze=False)[0])
        if shown:
            _intervals(next(axes), fit, shown)
            words += f"; static model, left over {fit.misfit:.2g} standard errors (RMS)"
        for kind in kinds:
            _agreement(next(axes), fit, kind)
        if bounced:
            _restitution(next(axes), fit)
        footnote(figure, words)
    return figure


def _restitution(panel: Any, fit: Identification) -> None:
    """Of each joint, of the range that there is."""
    for row, one in enumerate(fit.restitutions):
        if one.reason:
            panel.text(0.5, row, "cannot tell", va="center", ha="center", color="0.4", fontsize=7)
            continue
        panel.plot(one.interval, [row, row], color=COLOURS[1], lw=2.0)
        panel.plot(one.value, row, "o", ms=4, color=COLOURS[1])
    panel.set_yticks(range(len(fit.restitutions)), [one.joint for one in fit.restitutions])
    panel.set_ylim(len(fit.restitutions) - 0.5, -0.5)
    panel.set_xlim(0.0, 1.0)
    panel.set_xlabel("restitution")


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
