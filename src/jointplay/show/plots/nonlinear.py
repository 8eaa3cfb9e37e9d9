"""Figures of nonlinear dynamics, as the literature draws them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from jointplay.show.plots.chart import Area, Axis, Chart, Curve, Dots, Map, Panel, Rule
from jointplay.show.plots.draw import draw
from jointplay.show.plots.palette import COLOURS, LINE, VERMILION, many
from jointplay.study.nonlinear.analyses import Findings
from jointplay.study.nonlinear.lyapunov import Exponent

_WIDE_PT = 480.0  # approximate width of a bifurcation diagram's axes [points]
_POINTS_PT = (2.0, 5.0)
"""Smallest and largest diameter of its dots [points]; half as large, they vanish in print."""


def turns(
    angle: np.ndarray, values: np.ndarray, ideal: np.ndarray, labels: Sequence[str], title: str = ""
) -> Figure:
    """Time histories (n, quantities) over the crank's angle in turns (n,), with and without
    clearance."""
    x = Axis("turn", low=float(angle[0]), high=float(angle[-1]))
    rows: list[list[Panel | None]] = []
    for label, history, plain in zip(labels, values.T, ideal.T, strict=True):
        marks = [
            Curve(angle, history, "with clearance", width=0.7),
            Curve(angle, plain, "ideal", VERMILION, "--", 1.0),
        ]
        first = not rows
        legend = "upper right" if first else ""
        rows.append([Panel(x, Axis(label), marks, title if first else "", legend=legend)])
    return draw(Chart(rows, (7.0, 0.6 + 2.2 * len(labels)), same_x=True))


def bifurcation(
    values: np.ndarray,
    samples: np.ndarray,
    across: str,
    up: str,
    title: str = "",
    caption: str = "",
) -> Figure:
    """Bifurcation diagram: samples once a turn (n, turns) over a parameter (n,); nan where a run
    failed."""
    size = float(np.clip(_WIDE_PT / max(len(values), 1), *_POINTS_PT))
    at = np.repeat(values, samples.shape[1])
    dots = Curve(at, samples.ravel(), line="", marker="o", size=size, opacity=0.7)
    panel = Panel(Axis(across), Axis(up), [dots], title)
    return draw(Chart([[panel]], (8.0, 4.6), note=caption))


def poincare(points: np.ndarray, labels: Sequence[str], title: str = "") -> Figure:
    """Poincaré section: two quantities once a turn, shape (turns, 2), coloured in order."""
    x, y = points.T
    dots = Dots(x, y, np.arange(len(points)), Axis("turn after settling"), size=7.0)
    panel = Panel(Axis(labels[0]), Axis(labels[1]), [dots], title)
    return draw(Chart([[panel]], (5.2, 4.4)))


def exponent(growths: np.ndarray, estimate: Exponent, turn: float, title: str = "") -> Figure:
    """Convergence of the largest Lyapunov exponent with the turns, and its confidence interval.

    `growths`: mean growth in each turn [1/s]; `turn`: time of one [s].
    """
    number = np.arange(1, len(growths) + 1)
    label = f"{100 * estimate.confidence:g} % interval: {estimate.verdict}"
    marks: list[Curve | Rule] = [
        Curve(number, growths, "growth in a turn", LINE, "", marker="o", size=2.5),
        Curve(number, np.cumsum(growths) / number, "mean so far"),
        Rule(estimate.low, "y", label, VERMILION, end=estimate.high, opacity=0.25),
        Rule(0.0, colour=LINE),
    ]
    panel = Panel(
        Axis(f"turns of {1e3 * turn:.4g} ms"), Axis("growth [1/s]"), marks, title, legend="best"
    )
    return draw(Chart([[panel]], (6.4, 3.6)))


def exponents(
    values: np.ndarray, estimates: Sequence[Exponent | None], across: str, title: str = ""
) -> Figure:
    """Largest Lyapunov exponents over a parameter, with intervals; None where a run failed."""
    marks: list[Curve | Rule] = [Rule(0.0, colour=LINE)]
    for verdict, colour in zip(("chaotic", "undecided", "regular"), COLOURS, strict=False):
        points = [
            (value, estimate.value, estimate.low, estimate.high)
            for value, estimate in zip(values, estimates, strict=True)
            if estimate is not None and estimate.verdict == verdict
        ]
        if points:
            at, mean, low, high = np.array(points).T
            marks.append(Curve(at, mean, verdict, colour, "", marker="o", low=low, high=high))
    panel = Panel(
        Axis(across), Axis("largest Lyapunov exponent [1/s]"), marks, title, legend="best"
    )
    return draw(Chart([[panel]], (7.0, 3.6)))


def recurrence(near: np.ndarray, span: float, title: str = "") -> Figure:
    """Recurrence plot: `near` (n, n) tells which instants are close in state, over `span` turns."""
    places = Map(near, palette="binary", extent=(0.0, span, 0.0, span))
    return draw(Chart([[Panel(Axis("turn"), Axis("turn"), [places], title)]], (5.0, 5.2)))


def waterfall(
    values: np.ndarray, order: np.ndarray, amplitudes: np.ndarray, across: str, up: str,
    title: str = "",
) -> Figure:  # fmt: skip
    """Spectra over a parameter: a waterfall of up to 25 of them, and all as a map.

    `amplitudes` (n, m) are those of the parameter's `values` (n,), nan where a run failed, over
    `order` (m,), the frequency in multiples of the turning speed.
    """
    good = np.isfinite(amplitudes).all(axis=1)
    values, amplitudes = values[good], amplitudes[good]
    top = float(amplitudes.max(initial=1e-300))
    chosen = np.unique(np.linspace(0, len(values) - 1, min(len(values), 25)).astype(int))
    apart = np.median(np.diff(values[chosen])) if len(chosen) > 1 else 1.0
    lines: list[Area | Curve] = []
    for k in chosen[::-1]:
        height = values[k] + 3.0 * apart * amplitudes[k] / top
        below = np.full(len(order), values[k])
        lines.append(Area(order, below, height, colour="white", opacity=1.0, order=-k))
        lines.append(Curve(order, height, width=0.6, order=-k))
    unit = up[up.rfind("[") + 1 : -1] if up.endswith("]") else ""
    x, y = Axis("order (frequency over turning speed)"), Axis(across)
    scale = Axis(f"amplitude: {up}", log=True)
    seen = Map(np.maximum(amplitudes, 1e-4 * top), scale, order, values, palette="viridis")
    tallest = f"tallest peak: {top:.3g} {unit}".rstrip()
    return draw(Chart([[Panel(x, y, lines, tallest), Panel(x, y, [seen])]], (9.0, 4.4), title))


def basin(
    places: np.ndarray, labels: np.ndarray, periods: Sequence[int], joint: str, title: str = ""
) -> Figure:
    """Basins of attraction: the orbit on which a journal ends, over where it starts (n, 2) [m].

    `labels`: index of that orbit, -1 where the motion does not repeat itself, -2 where the run
    failed; `periods` of the orbits [turns].
    """
    names = {-1: "does not repeat itself", -2: "failed"}
    colours = {-1: "#595959", -2: "#d9d9d9"}
    marks = []
    for label in np.unique(labels):
        at = places[labels == label]
        word = names.get(label) or f"orbit {label + 1}, period {periods[label]}"
        colour = colours.get(label) or many(len(periods))[label]
        name = f"{word}: {len(at)}"
        marks.append(Curve(at[:, 0], at[:, 1], name, colour, "", marker="s", size=5.0))
    x, y = Axis(f"start of the journal of {joint}, x", "m"), Axis("y", "m")
    panel = Panel(x, y, marks, title, equal="box", legend="beside")
    return draw(Chart([[panel]], (6.4, 4.6)))


_DRAWN = {
    drawing.__name__: drawing
    for drawing in (turns, bifurcation, poincare, exponent, exponents, recurrence, waterfall, basin)
}


def figure(findings: Findings) -> Figure:
    """The figure of an analysis of nonlinear dynamics."""
    drawn: Figure = _DRAWN[findings.figure](**findings.data)  # type: ignore[operator]
    return drawn
