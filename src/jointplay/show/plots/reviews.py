"""Charts for a paper's reviewers: convergence, contact laws, the spread of perturbed starts."""

from __future__ import annotations

from typing import Any

import numpy as np

from jointplay.show.plots.chart import Area, Axis, Chart, Curve, Mark, Panel
from jointplay.show.plots.draw import draw
from jointplay.show.plots.palette import BLUE, many
from jointplay.show.plots.style import StyledFigure
from jointplay.simulation.simulation import Simulation
from jointplay.study import reviews
from jointplay.study.reviews import BAND, Convergence, LawComparison, Spread

_WIDTH = 6.0
"""Width of a figure on screen [inches]; on paper it fills a column of 88 mm."""


def review(
    kind: str, simulation: Simulation, asked: Any, **how: Any
) -> tuple[Convergence | LawComparison | Spread, StyledFigure]:
    """One of the studies that reviewers ask for, and its figure for print.

    Args:
        kind: ``converge``, ``laws`` or ``ensemble``.
        simulation: the run.
        asked: names of the laws, or number of perturbed starts.
        how: jobs and progress, as for the functions of `study.reviews`.

    Raises:
        JointplayError: as those functions do.
    """
    if kind == "converge":
        steps = reviews.convergence(simulation, **how)
        return steps, draw(convergence(steps), "paper")
    if kind == "laws":
        compared = reviews.laws(simulation, asked, **how)
        return compared, draw(laws(compared), "paper")
    starts = reviews.spread(simulation, asked, **how)
    return starts, draw(spread(starts), "paper")


def convergence(of: Convergence) -> Chart:
    """Relative distance of each figure from the finest run, over step or tolerance, with the error
    that the chosen run states."""
    names = [name for name in of.values if np.nanmax(of.distance(name), initial=0.0) > 0.0]
    marks: list[Mark] = []
    for name, colour in zip(names, many(len(names)), strict=True):
        distance = of.distance(name)
        seen = distance > 0.0
        sizes = np.array(of.sizes)
        marks.append(Curve(sizes[seen], distance[seen], name, colour, marker="o", size=4.0))
        stated = of.stated.get(name, np.nan) / abs(of.truth[name])
        if np.isfinite(stated) and stated > 0.0:
            dash: dict[str, Any] = {"marker": "_", "size": 12.0, "hollow": True, "order": 3.0}
            marks.append(Curve([of.chosen], [stated], "", colour, "", **dash))
    unit = "s" if of.of == "step" else ""
    ends = np.log10([min(of.sizes), max(of.sizes)])  # whole decades, whose labels have room
    low, high = 10.0 ** np.floor(ends[0]), 10.0 ** np.ceil(ends[1])
    across = Axis(of.of, unit, log=True, low=float(low), high=float(high))
    up = Axis("relative distance from the finest run", log=True)
    note = (
        f"Dashes: the errors that the run with {of.of} {of.chosen:g} {unit}".rstrip() + " states."
    )
    return Chart([[Panel(across, up, marks)]], (_WIDTH, 4.2), note=note, key=2)


def laws(of: LawComparison) -> Chart:
    """The force of a joint over time, by contact law."""
    tones = many(len(of.curves))
    marks: list[Mark] = [
        Curve(*curve, law, colour, width=0.8)
        for (law, curve), colour in zip(of.curves.items(), tones, strict=True)
    ]
    panel = Panel(Axis("time", "s"), Axis(f"force in {of.joint}", "N", low=0.0), marks)
    return Chart([[panel]], (_WIDTH, 3.2), key=3)


def spread(of: Spread) -> Chart:
    """For each quantity over time, the band of the perturbed starts and their mean."""
    rows: list[list[Panel | None]] = []
    for k, (name, curves) in enumerate(of.curves.items()):
        low, high = np.percentile(curves, BAND, axis=0)
        first = k == 0
        band = f"{BAND[0]:g} to {BAND[1]:g} % of {len(curves)} starts" if first else ""
        marks: list[Mark] = [
            Area(of.times, low, high, band, BLUE, opacity=0.3),
            Curve(of.times, curves.mean(axis=0), "mean" if first else "", BLUE, width=0.8),
        ]
        up = Axis(name, of.curve_units[name], low=0.0)
        rows.append([Panel(Axis("time", "s"), up, marks)])
    return Chart(rows, (_WIDTH, 1.0 + 1.7 * len(rows)), key=2, same_x=True)
