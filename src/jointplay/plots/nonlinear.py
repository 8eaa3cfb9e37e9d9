"""Figures of nonlinear dynamics, as the literature draws them."""

from __future__ import annotations

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from jointplay.nonlinear.lyapunov import Exponent
from jointplay.plots.palette import COLOURS
from jointplay.plots.style import Decades, footnote, panels

_WIDE_PT = 480.0
"""Width of a bifurcation diagram between its axes, about [points]."""
_POINTS_PT = (2.0, 5.0)
"""Smallest and largest diameter of its dots: half as large, they are not seen in print [points]."""


def turns(
    angle: np.ndarray,
    values: np.ndarray,
    ideal: np.ndarray,
    labels: Sequence[str],
    title: str = "",
) -> Figure:
    """Quantities over the crank's angle, with clearance and without.

    Args:
        angle: in turns, shape (n,).
        values, ideal: shape (n, quantities).
        labels: of the quantities.
        title: of the figure.
    """
    height = 0.6 + 2.2 * len(labels)
    with panels(7.0, height, len(labels), sharex=True, squeeze=False) as (figure, axes):
        column = axes[:, 0]
        for panel, label, history, plain in zip(column, labels, values.T, ideal.T, strict=True):
            panel.plot(angle, history, color=COLOURS[1], lw=0.7, label="with clearance")
            panel.plot(angle, plain, color=COLOURS[0], lw=1.0, ls="--", label="ideal")
            panel.set_ylabel(label)
        column[0].legend(loc="upper right")
        column[0].set_title(title)
        column[-1].set(xlabel="turn", xlim=(angle[0], angle[-1]))
    return figure


def bifurcation(
    values: np.ndarray,
    samples: np.ndarray,
    across: str,
    up: str,
    title: str = "",
    caption: str = "",
) -> Figure:
    """Samples once a turn over a parameter.

    Args:
        values: of the parameter, shape (n,).
        samples: for each, shape (n, turns); rows that are no numbers failed.
        across, up: labels.
        title: of the figure.
        caption: beneath it: how samples were taken.
    """
    size = float(np.clip(_WIDE_PT / max(len(values), 1), *_POINTS_PT))
    with panels(8.0, 4.6) as (figure, axes):
        at = np.repeat(values, samples.shape[1])
        look = {"color": COLOURS[1], "ms": size, "mew": 0, "alpha": 0.7, "rasterized": True}
        axes.plot(at, samples.ravel(), "o", **look)
        axes.set(xlabel=across, ylabel=up, title=title)
        axes.margins(x=0.01)
        footnote(figure, caption)
    return figure


def poincare(points: np.ndarray, labels: Sequence[str], title: str = "") -> Figure:
    """A section: two quantities once a turn, shape (turns, 2), coloured in order."""
    with panels(5.2, 4.4) as (figure, axes):
        drawn = axes.scatter(*points.T, c=np.arange(len(points)), s=7, cmap="viridis", linewidths=0)
        figure.colorbar(drawn, ax=axes, label="turn after settling")
        axes.set(xlabel=labels[0], ylabel=labels[1], title=title)
    return figure


def exponent(growths: np.ndarray, estimate: Exponent, turn: float, title: str = "") -> Figure:
    """How the exponent settles with the turns averaged over, and its interval of confidence.

    Args:
        growths: mean growth in each turn [1/s].
        estimate: what follows from them.
        turn: time of one [s].
        title: of the figure.
    """
    number = np.arange(1, len(growths) + 1)
    with panels(6.4, 3.6) as (figure, axes):
        axes.plot(number, growths, ".", color="0.7", ms=3, label="growth in a turn")
        axes.plot(number, np.cumsum(growths) / number, color=COLOURS[1], label="mean so far")
        label = f"{100 * estimate.confidence:g} % interval: {estimate.verdict}"
        axes.axhspan(estimate.low, estimate.high, color=COLOURS[0], alpha=0.25, lw=0, label=label)
        axes.axhline(0.0, color="0.4", lw=0.6)
        axes.set(xlabel=f"turns of {1e3 * turn:.4g} ms", ylabel="growth [1/s]", title=title)
        axes.legend(fontsize=7)
    return figure


def exponents(
    values: np.ndarray, estimates: Sequence[Exponent | None], across: str, title: str = ""
) -> Figure:
    """Largest exponents over a parameter, with intervals; None where a run failed."""
    known = [(value, one) for value, one in zip(values, estimates, strict=True) if one is not None]
    with panels(7.0, 3.6) as (figure, axes):
        for verdict, colour in zip(("chaotic", "undecided", "regular"), COLOURS, strict=False):
            of = [(value, one) for value, one in known if one.verdict == verdict]
            if of:
                at, mean = [v for v, _ in of], np.array([e.value for _, e in of])
                sides = [mean - [e.low for _, e in of], [e.high for _, e in of] - mean]
                axes.errorbar(
                    at, mean, sides, fmt="o", ms=3, lw=0.8, color=colour, label=verdict
                )  # fmt: skip
        axes.axhline(0.0, color="0.4", lw=0.6)
        axes.set(xlabel=across, ylabel="largest Lyapunov exponent [1/s]", title=title)
        if known:
            axes.legend()
    return figure


def recurrence(near: np.ndarray, span: float, title: str = "") -> Figure:
    """A recurrence plot over a number of turns."""
    with panels(5.0, 5.2) as (figure, axes):
        axes.imshow(near, origin="lower", cmap="binary", extent=(0.0, span, 0.0, span))
        axes.grid(visible=False)
        axes.set(xlabel="turn", ylabel="turn", title=title)
    return figure


def waterfall(
    values: np.ndarray, order: np.ndarray, amplitudes: np.ndarray, across: str, up: str,
    title: str = "",
) -> Figure:  # fmt: skip
    """Spectra over a parameter: a line for each of some of the values, and all as a map.

    Args:
        values: of the parameter, shape (n,).
        order: multiples of the turning speed, shape (m,).
        amplitudes: shape (n, m); rows that are no numbers failed.
        across: label of the parameter.
        up: label of the amplitudes.
        title: of the figure.
    """
    good = np.isfinite(amplitudes).all(axis=1)
    values, amplitudes = values[good], amplitudes[good]
    top = float(amplitudes.max(initial=1e-300))
    with panels(9.0, 4.4, 1, 2) as (figure, (lines, panel)):
        chosen = np.unique(np.linspace(0, len(values) - 1, min(len(values), 25)).astype(int))
        apart = np.median(np.diff(values[chosen])) if len(chosen) > 1 else 1.0
        for k in chosen[::-1]:
            height = values[k] + 3.0 * apart * amplitudes[k] / top
            lines.fill_between(order, values[k], height, color="white", zorder=-k)
            lines.plot(order, height, color=COLOURS[1], lw=0.6, zorder=-k)
        lines.set(xlabel="order (frequency over turning speed)", ylabel=across)
        unit = up[up.rfind("[") + 1 : -1] if up.endswith("]") else ""
        lines.set_title(f"tallest peak: {top:.3g} {unit}".rstrip(), fontsize=8)
        drawn = panel.pcolormesh(
            order, values, np.maximum(amplitudes, 1e-4 * top), norm=LogNorm(1e-4 * top, top),
            shading="nearest", rasterized=True,
        )  # fmt: skip
        panel.set(xlabel="order (frequency over turning speed)", ylabel=across)
        figure.colorbar(drawn, ax=panel, label=f"amplitude: {up}", format=Decades())
        figure.suptitle(title, fontsize=9)
    return figure


def basin(
    places: np.ndarray, labels: np.ndarray, periods: Sequence[int], joint: str, title: str = ""
) -> Figure:
    """Where a journal's motion ends, over where it starts.

    Args:
        places: starts, shape (n, 2) [m].
        labels: index of the orbit, -1 where the motion does not repeat itself, -2 where it failed.
        periods: of the orbits [turns].
        joint: whose journal it is.
        title: of the figure.
    """
    words = {-1: "does not repeat itself", -2: "failed"}
    colours = {-1: "0.35", -2: "0.85"}
    with panels(6.4, 4.6) as (figure, axes):
        for label in np.unique(labels):
            at = 1e3 * places[labels == label]
            word = words.get(label) or f"orbit {label + 1}, period {periods[label]}"
            many = mpl.colormaps["tab20"](label % 20) if len(periods) > len(COLOURS) else None
            colour = colours.get(label) or many or COLOURS[label]
            axes.plot(*at.T, "s", ms=5, mew=0, color=colour, label=f"{word}: {len(at)}")
        axes.set_aspect("equal")
        axes.set(xlabel=f"start of the journal of {joint}, x [mm]", ylabel="y [mm]", title=title)
        axes.legend(bbox_to_anchor=(1.02, 1.0), loc="upper left", fontsize=7)
    return figure
