"""Figures of accuracy and repeatability: attained poses around the command, and the path."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from jointplay.analysis.iso9283 import Iso9283
from jointplay.plots.style import COLOURS, footnote, new_figure, style

MOST_POSES = 6
"""Stops that are drawn: the worst."""


def poses(performance: Iso9283) -> Figure:
    """Attained poses of each cycle about their barycentre, seen along z and y, by stop."""
    worst = sorted(performance.poses, key=lambda pose: -pose.ap.value)[:MOST_POSES]
    shown = sorted(worst, key=lambda pose: pose.time)
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    with style():
        figure = new_figure(1.4 + 2.4 * max(len(shown), 2), 5.6)
        axes: Any = figure.subplots(2, len(shown), squeeze=False)
        for column, pose in enumerate(shown):
            centre = pose.attained.mean(axis=0)
            points = 1e6 * (pose.attained - centre)
            circle = 1e6 * pose.rp.value * np.array([np.cos(angle), np.sin(angle)])
            towards = -centre / max(float(np.linalg.norm(centre)), 1e-300)
            arrow = 0.8e6 * pose.rp.value * towards
            for row, (i, j) in enumerate(((0, 1), (0, 2))):
                panel = axes[row, column]
                panel.plot(*points[:, [i, j]].T, "o", ms=2.5, color=COLOURS[0], label="attained")
                panel.plot(0.0, 0.0, "x", color=COLOURS[1], label="barycentre")
                panel.plot(*circle, color=COLOURS[1], lw=0.8, label="RP_l")
                panel.plot(
                    *([0.0, arrow[i]], [0.0, arrow[j]]),
                    color="0.6",
                    lw=0.8,
                    label="way to the command pose (length without meaning)",
                )
                panel.set(xlabel=f"{'xyz'[i]} [um]", ylabel=f"{'xyz'[j]} [um]")
                panel.set_aspect("equal", adjustable="datalim")
                panel.locator_params(nbins=5)
            axes[0, column].set_title(
                f"t = {pose.time:.4g} s\nAP_p {1e3 * pose.ap.value:.3g} mm, "
                f"RP_l {1e6 * pose.rp.value:.3g} um",
                fontsize=8,
            )
        figure.legend(*axes[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
        _note(figure, performance)
    return figure


def path(performance: Iso9283) -> Figure:
    """Accuracy and repeatability across the path, along it; AT and RT are their largest."""
    assert performance.at is not None
    assert performance.rt is not None
    with style():
        figure = new_figure(6.5, 3.4)
        axes: Any = figure.subplots()
        lines = (
            (performance.path_accuracy, performance.at, "AT_p", COLOURS[0]),
            (performance.path_repeatability, performance.rt, "RT_p", COLOURS[1]),
        )
        for values, one, name, colour in lines:
            label = f"{name} = {one.words(1e3, 'mm')}"
            axes.plot(
                performance.path_times, 1e3 * values, ".-", ms=3, lw=0.8, color=colour, label=label
            )
        axes.set(xlabel="time in the cycle [s]", ylabel="across the command path [mm]")
        axes.set_ylim(bottom=0.0)
        figure.legend(loc="outside upper center", ncols=2)
        _note(figure, performance)
    return figure


def _note(figure: Figure, performance: Iso9283) -> None:
    parts = performance.accuracy.split("; ")
    half = len(parts) // 2
    text = "; ".join(parts[:half]) + ";\n" + "; ".join(parts[half:])
    footnote(figure, text)
