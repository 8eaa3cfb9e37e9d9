"""Charts as data: axes with units, and marks (curves, bars, maps ...) between them.

Nothing here draws: `plots.draw` turns a chart into a matplotlib figure, `reports.charts` into what
a page draws. Values are SI; an axis knows the unit in which they are shown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jointplay.base.units import displayed, typeset
from jointplay.show.plots.palette import BLUE

_SHORT_S = 0.02
"""An axis of time that ends before this is in milliseconds: its ticks' numbers in seconds would
touch [s]."""


@dataclass(frozen=True)
class Axis:
    """The quantity along an axis, its unit and limits."""

    name: str = ""  # the quantity in words
    unit: str = ""  # the SI unit of the numbers
    size: str = ""  # "fine" for clearances and the like, "large" for paths: `units.displayed`
    log: bool = False
    low: float | None = None  # lower limit; None: where the data begin
    high: float | None = None
    rows: Sequence[str] | None = None  # labels at 0, 1, ...; on a y axis the first is at the top
    ticks: int | None = None
    """Most intervals between ticks; symmetric about 0 unless the limits are not."""
    whole: bool = False  # whether it counts things, so that ticks are integers

    @property
    def shown(self) -> tuple[float, str]:
        """Factor and unit in which numbers are shown."""
        if self.size == "large":
            return 1.0, typeset(self.unit)
        if self.unit == "s" and self.high is not None and self.high < _SHORT_S:
            return 1e3, "ms"
        return displayed(self.unit, self.size == "fine")

    @property
    def label(self) -> str:
        unit = self.shown[1]
        return f"{self.name} [{unit}]" if unit else self.name


@dataclass(frozen=True)
class Curve:
    """A line through points, or the points alone."""

    x: np.ndarray | Sequence[float]
    y: np.ndarray | Sequence[float]
    name: str = ""  # in the legend, which leaves out curves without one
    colour: str = BLUE
    line: str = "-"  # matplotlib's -, --, :, -. or, for points alone, nothing
    width: float | None = None
    marker: str = ""
    size: float = 3.0
    hollow: bool = False
    opacity: float = 1.0
    low: np.ndarray | None = None
    """Lower end, with `high` as upper end, of a line's error band or of the points' error bars; nan
    where no error is known."""
    high: np.ndarray | None = None
    aside: np.ndarray | None = None  # half lengths of error bars along x
    at: np.ndarray | None = None  # time of each point, for a curve in a plane [s]
    steps: bool = False  # whether the curve jumps from one value to the next
    frame: bool = False  # whether it is not data but the outline of a clearance, or a reference
    order: float = 2.0  # marks of higher order are drawn over those of lower order


@dataclass(frozen=True)
class Bars:
    """Horizontal bars, one in each row."""

    values: np.ndarray | Sequence[float]
    name: str = ""
    colour: str = BLUE
    left: np.ndarray | float = 0.0
    shift: float = 0.0  # of the bars from the middle of their rows
    height: float = 0.6
    opacity: float = 1.0
    rows: np.ndarray | Sequence[int] | None = None  # row of each bar; None: 0, 1, ...
    texts: Sequence[str] = ()  # labels at the ends of the bars


@dataclass(frozen=True)
class Spans:
    """Intervals in which a row of a timeline is filled."""

    begin: np.ndarray
    end: np.ndarray
    row: int
    name: str = ""
    colour: str = BLUE


@dataclass(frozen=True)
class Rule:
    """A straight line across a panel, or with an `end` a band."""

    at: float
    along: str = "y"  # the axis on which `at` lies: "y" gives a horizontal line
    name: str = ""
    colour: str = "black"
    line: str = "-"
    width: float = 0.6
    end: float | None = None
    opacity: float = 1.0


@dataclass(frozen=True)
class Area:
    """The area between two curves over x."""

    x: np.ndarray
    low: np.ndarray
    high: np.ndarray
    name: str = ""
    colour: Any = BLUE
    opacity: float = 0.75
    order: float = 1.0


@dataclass(frozen=True)
class Dots:
    """Points coloured by a value."""

    x: np.ndarray
    y: np.ndarray
    values: np.ndarray
    scale: Axis
    size: float = 14.0


@dataclass(frozen=True)
class Map:
    """A heat map: values on a grid, by colour; its cells are equal unless `x` and `y` are given."""

    values: np.ndarray  # (rows, columns), the first row at the bottom
    scale: Axis | None = None
    x: np.ndarray | None = None
    y: np.ndarray | None = None
    extent: tuple[float, float, float, float] | None = None
    palette: str = "cividis"
    written: bool = False  # whether each cell shows its number


@dataclass(frozen=True)
class Label:
    """A text at a point, or above it."""

    x: float
    y: float
    text: str
    above: str = ""
    """Part of the text that stands above the point: ``"left"``, ``"center"`` or ``"right"``."""


Mark = Curve | Bars | Spans | Rule | Area | Dots | Map | Label


@dataclass(frozen=True)
class Panel:
    """A pair of axes and the marks between them."""

    x: Axis
    y: Axis
    marks: Sequence[Mark] = ()
    title: str = ""
    colour: str = ""  # colour of a title that names a case, which stands at the left
    equal: str = ""
    """For one scale on both axes: ``"box"`` shrinks the panel to the data, ``"data"`` extends the
    axes' limits."""
    columns: int = 0  # columns of a legend above the panel; 0: none there
    legend: str = ""  # another place for the legend: a `loc` of matplotlib, "beside" or "below"
    legend_title: str = ""

    def styled(self, **fields: Any) -> Panel:
        """The panel with these fields set in all marks that are data and have them."""
        marks = []
        for mark in self.marks:
            framed = isinstance(mark, Rule | Label) or (isinstance(mark, Curve) and mark.frame)
            known = {name: value for name, value in fields.items() if hasattr(mark, name)}
            marks.append(mark if framed else replace(mark, **known))
        return replace(self, marks=marks)

    def with_marks(self, *marks: Mark) -> Panel:
        return replace(self, marks=[*self.marks, *marks])

    def renamed(self, name: str) -> Panel:
        return replace(self, y=replace(self.y, name=name))


def overlaid(panels: Iterable[Panel]) -> Panel:
    """One panel with the marks of all, and the axes and title of the first."""
    first, *others = panels
    return first.with_marks(*(mark for panel in others for mark in panel.marks))


@dataclass(frozen=True)
class Chart:
    """Panels in rows, with a title, a common legend and a note around them."""

    rows: Sequence[Sequence[Panel | None]]
    size: tuple[float, float]  # width and height on screen [inches]
    title: str = ""
    note: str = ""  # small print below
    key: int = 0  # columns of the common legend; 0: none
    key_at: str = "outside upper center"  # its place, as matplotlib's `loc`
    same_x: bool | str = False  # whether all panels share the x axis, or "col": those of a column
    same_y: bool | str = False
    wide: Sequence[float] | None = None  # relative widths of the columns

    @property
    def panels(self) -> list[Panel]:
        return [panel for row in self.rows for panel in row if panel is not None]


def in_rows(panels: Sequence[Panel | None], across: int) -> list[list[Panel | None]]:
    """Rows of a chart with so many panels each; the last is filled up with None."""
    filled = [*panels, *[None] * (-len(panels) % across)]
    return [filled[k : k + across] for k in range(0, len(filled), across)]


def outline(x: np.ndarray, y: np.ndarray) -> Curve:
    """The outline of a clearance, a curve that is not data."""
    return Curve(x, y, colour="black", width=1.0, frame=True)
