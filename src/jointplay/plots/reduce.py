"""Figure of a reduced joint: motor against link through reversals, full model and reduced."""

from __future__ import annotations

from typing import Any

from matplotlib.figure import Figure

from jointplay.analysis.reduce import Reduction
from jointplay.plots.style import COLOURS, footnote, new_figure, style


def reversals(reduction: Reduction) -> Figure:
    """The lag of the link behind the motor in time, and over the motor's angle (hysteresis)."""
    past = reduction.history
    with style():
        figure = new_figure(8.5, 3.4)
        axes: Any = figure.subplots(1, 2)
        for name, colour, line in (("full", COLOURS[0], "-"), ("reduced", COLOURS[1], "--")):
            lag = 1e3 * (past["motor"] - past[name])
            axes[0].plot(past["time"], lag, line, color=colour, label=f"{name} model")
            axes[1].plot(past["motor"], lag, line, color=colour)
        half = 0.5e3 * reduction.dead_band
        for panel in axes:
            for side in (-half, half):
                panel.axhline(side, color="0.6", lw=0.7, ls=":")
            panel.set_ylabel("motor - link [mrad]")
        axes[1].locator_params(axis="x", nbins=5)
        axes[0].set_xlabel("time [s]")
        axes[1].set_xlabel(f"motor of {reduction.joint} [rad]")
        figure.legend(loc="outside upper center", ncols=2)
        footnote(
            figure,
            f"simulated; stated error of the link's angle {1e6 * reduction.angle_error:.3g} urad, "
            f"RMS difference {1e6 * reduction.angle_rms:.3g} urad; dotted: the dead band",
        )
    return figure
