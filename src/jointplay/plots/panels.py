"""Panels: axes to draw into, their legends and timelines, and what is drawn of vectors."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from jointplay.errors import JointplayError, MissingName
from jointplay.plots.style import AXIS_COLOURS, COLOURS, new_figure, style
from jointplay.result.result import AXES, Result

COMPONENTS = (*AXES, "total")

MODE_NAMES = ("free flight", "continuous contact", "pseudo-penetration")
CONTACT_COLOURS = (COLOURS[1], COLOURS[5], COLOURS[0], COLOURS[4], COLOURS[3], COLOURS[2], "0.5")
_DASHES = ("-", "--", ":")
"""Tell contacts apart that share a colour: a slider has up to sixteen."""
MARKERS = "o^sDvP*"


class Drawing(ABC):
    """What all plots of a result have in common.

    `available` says which it has.
    """

    def __init__(self, result: Result) -> None:
        """Draw `result`."""
        self.result = result

    @contextmanager
    def _axes(
        self, ax: Axes | None, look: str, width: float = 6.0, height: float = 3.2
    ) -> Iterator[Axes]:
        if ax is not None:
            yield ax
            return
        with style(look):
            yield new_figure(width, height, look).subplots()

    def _joint(self, plot: str, joint: str | None) -> str:
        joints = self.result.joints
        if not joints:
            raise JointplayError(
                f"plot {plot!r} needs a clearance joint, and this run has none; it can plot "
                f"{', '.join(self.available)}"
            )
        if joint is None:
            return joints[0]
        if joint not in joints:
            raise MissingName("clearance joint", joint, joints)
        return joint

    def _components(
        self,
        ax: Axes,
        time: np.ndarray,
        vectors: np.ndarray,
        axis: str | None,
        symbol: str,
        unit: str,
        options: dict[str, Any],
    ) -> None:
        """One component of vectors (n, 3), or all three of them in the colours of the axes."""
        if axis is not None and axis not in COMPONENTS:
            raise MissingName("axis", axis, COMPONENTS)
        for name in AXES if axis is None else (axis,):
            values = (
                np.linalg.norm(vectors, axis=1) if name == "total" else vectors[:, AXES.index(name)]
            )
            line = {"color": AXIS_COLOURS[name], **({"label": name} if axis is None else {})}
            ax.plot(time, values, **(line | options))
        if axis is None:
            legend(ax, 3)
        part = {None: "", "total": ", total"}.get(axis, f" {axis}")
        ax.set_ylabel(f"{symbol}{part} [{unit}]")
        ax.set_xlabel("time [s]")

    @property
    @abstractmethod
    def available(self) -> tuple[str, ...]:
        """Names of the plots that have a meaning for this result."""


def figure_of(panel: Axes) -> Figure:
    """The figure that axes belong to."""
    figure = panel.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure


def contact_line(index: int) -> dict[str, Any]:
    """Colour and dashes of a joint's contact."""
    round_, at = divmod(index, len(CONTACT_COLOURS))
    return {"color": CONTACT_COLOURS[at], "ls": _DASHES[round_ % len(_DASHES)]}


def narrow(panel: Axes) -> bool:
    """Whether the figure is as wide as a column of a journal, or less."""
    return bool(figure_of(panel).get_figwidth() < 4.5)


def legend(panel: Axes, columns: int) -> None:
    """Above the axes, in fewer columns on a narrow figure."""
    if narrow(panel) and columns > 3:
        columns = 2
    made = panel.legend(
        loc="lower left",
        bbox_to_anchor=(0.0, 1.0),
        ncols=columns,
        borderaxespad=0.2,
        handlelength=1.3,
        columnspacing=1.2,
    )
    for line in made.get_lines():
        line.set_linewidth(max(line.get_linewidth(), 1.6))


def timeline(
    panel: Axes,
    time: np.ndarray,
    values: np.ndarray,
    members: Sequence[int],
    rows: Sequence[str],
    colours: Sequence[str],
    options: dict[str, Any],
) -> None:
    """A row for each of `members`, filled while `values` equals it."""
    ends = np.append(time[1:], time[-1])
    for row, (member, colour) in enumerate(zip(members, colours, strict=False)):
        edges = np.diff(np.concatenate([[False], values == member, [False]]).astype(int))
        first, last = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
        spans = np.column_stack([time[first], ends[last] - time[first]])
        drawn: dict[str, Any] = {"facecolors": colour, "linewidth": 0.0} | options
        panel.broken_barh(spans.tolist(), (row - 0.4, 0.8), **drawn)
    panel.set_yticks(range(len(rows)), rows)
    panel.set_ylim(len(rows) - 0.5, -0.5)
    panel.set_xlim(time[0], time[-1])
    panel.grid(axis="y", visible=False)
    panel.tick_params(axis="y", length=0)
    panel.set_xlabel("time [s]")
