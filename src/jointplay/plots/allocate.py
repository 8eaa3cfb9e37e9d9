"""Figure of an allocation: which clearance each joint gets, and what it adds to the error."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.analysis.allocation import Allocation
from jointplay.plots.style import COLOURS, new_figure, style


def allocation(allotment: Allocation) -> Figure:
    """Clearances, what they add to the error, and what another micrometre of each would save."""
    place = np.arange(len(allotment.joints))
    panels = (
        (1e6 * allotment.clearance, "clearance [µm]", COLOURS[1]),
        (1e6 * allotment.gain * allotment.clearance, "adds to the error [µm]", COLOURS[0]),
        (allotment.price, f"saves by one µm more\n[cost, {allotment.cost}]", COLOURS[3]),
    )
    with style():
        figure = new_figure(9.0, 1.6 + 0.35 * len(place))
        axes: Any = figure.subplots(1, 3, sharey=True)
        for panel, (values, label, colour) in zip(axes, panels, strict=True):
            panel.barh(place, values, 0.6, color=colour)
            panel.set_xlabel(label)
        axes[0].set_yticks(place, allotment.joints)
        axes[0].invert_yaxis()
        figure.suptitle(
            f"{allotment.kind} {1e6 * allotment.error:.4g} µm, "
            f"target {1e6 * allotment.target:.4g} µm",
            fontsize=9,
        )
    return figure
