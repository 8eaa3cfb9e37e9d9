"""Charts as data: axes with their units, and what is drawn between them; nothing here draws.

`plots.draw` makes figures of them with matplotlib, `reports.charts` what pages show. Values are SI;
axes say in which unit they are shown.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from jointplay.base.units import displayed, typeset
from jointplay.show.plots.palette import BLUE

_SHORT_S = 0.02
"""Time up to which an axis counts milliseconds: in seconds its ticks' numbers would touch [s]."""


@dataclass(frozen=True)
class Axis:
    """What an axis shows, and from where to where."""

    name: str = ""  # in words
    unit: str = ""  # the SI unit of the numbers
    size: str = ""  # "fine" of clearances and the like, "large" of paths: `units.displayed`
    log: bool = False
    low: float | None = None  # where it begins; None: at the data
    high: float | None = None
    rows: Sequence[str] | None = None  # words at 0, 1, ...; up an axis the first stands at the top
    ticks: int | None = None
    """Intervals between ticks, at most; as many on both sides of 0 unless it has limits."""
    whole: bool = False  # whether it counts

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
    """A line through points, or the points."""

    x: np.ndarray | Sequence[float]
    y: np.ndarray | Sequence[float]
    name: str = ""  # in the legend; without one it is not there
    colour: str = BLUE
    line: str = "-"  # -, --, :, -. or, of points alone, nothing
    width: float | None = None
    marker: str = ""
    size: float = 3.0
    hollow: bool = False
    opacity: float = 1.0
    low: np.ndarray | None = None
    """Of the error band of a line, or of the bars of points, with `high`; numbers that are none
    have no error."""
    high: np.ndarray | None = None
    aside: np.ndarray | None = None  # errors along x
    at: np.ndarray | None = None  # time of each point of a curve in a plane [s]
    steps: bool = False  # whether it jumps from one value to the next
    frame: bool = False  # whether it is no data: the outline of a clearance, a reference
    order: float = 2.0  # what is drawn above what


@dataclass(frozen=True)
class Bars:
    """Bars from the left, one in each row."""

    values: np.ndarray | Sequence[float]
    name: str = ""
    colour: str = BLUE
    left: np.ndarray | float = 0.0
    shift: float = 0.0  # of the bars from their rows
    height: float = 0.6
    opacity: float = 1.0
    error: np.ndarray | None = None
    rows: np.ndarray | Sequence[int] | None = None  # None: every one
    texts: Sequence[str] = ()  # at the ends of the bars


@dataclass(frozen=True)
class Spans:
    """When a row of a timeline is filled."""

    begin: np.ndarray
    end: np.ndarray
    row: int
    name: str = ""
    colour: str = BLUE


@dataclass(frozen=True)
class Rule:
    """A line across all of a chart, or with an end a band."""

    at: float
    along: str = "y"  # the axis that has this value: of y the line is level
    name: str = ""
    colour: str = "black"
    line: str = "-"
    width: float = 0.6
    end: float | None = None
    opacity: float = 1.0


@dataclass(frozen=True)
class Area:
    """Between two curves."""

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
    """A value, by its colour, at the places of a grid; all places are as wide without `x`, `y`."""

    values: np.ndarray  # rows from below
    scale: Axis | None = None
    x: np.ndarray | None = None
    y: np.ndarray | None = None
    extent: tuple[float, float, float, float] | None = None
    palette: str = "cividis"
    written: bool = False  # whether the numbers stand in it


@dataclass(frozen=True)
class Words:
    """Words at a place, or above it."""

    x: float
    y: float
    text: str
    above: str = ""
    """What of the words is above the place: their ``"left"``, ``"center"`` or ``"right"``."""


Mark = Curve | Bars | Spans | Rule | Area | Dots | Map | Words


@dataclass(frozen=True)
class Panel:
    """A pair of axes and what is drawn between them."""

    x: Axis
    y: Axis
    marks: Sequence[Mark] = ()
    title: str = ""
    colour: str = ""  # of a title that names a case, which stands at the left
    equal: str = ""
    """Whether x and y have the same scale: ``"box"`` fits the panel to what is shown, ``"data"``
    shows more."""
    columns: int = 0  # of its own legend, above it; 0: it has none
    legend: str = ""  # where its own legend is otherwise: as matplotlib has it, beside or below
    legend_title: str = ""

    def styled(self, **fields: Any) -> Panel:
        """The same with these fields in all marks that are data."""
        marks = []
        for mark in self.marks:
            framed = isinstance(mark, Rule | Words) or (isinstance(mark, Curve) and mark.frame)
            known = {name: value for name, value in fields.items() if hasattr(mark, name)}
            marks.append(mark if framed else replace(mark, **known))
        return replace(self, marks=marks)

    def with_marks(self, *marks: Mark) -> Panel:
        return replace(self, marks=[*self.marks, *marks])

    def renamed(self, name: str) -> Panel:
        return replace(self, y=replace(self.y, name=name))


def overlaid(panels: Iterable[Panel]) -> Panel:
    """Panels over each other, with the axes and the title of the first."""
    first, *others = panels
    return first.with_marks(*(mark for panel in others for mark in panel.marks))


@dataclass(frozen=True)
class Chart:
    """Panels in rows, and what stands around them."""

    rows: Sequence[Sequence[Panel | None]]
    size: tuple[float, float]  # width and height [inches]
    title: str = ""
    colour: str = "black"  # of the title
    note: str = ""  # in small print below
    key: int = 0  # columns of the legend of all panels, above them; 0: there is none
    key_at: str = "outside upper center"
    same_x: bool | str = False  # whether panels share the x axis; "col": those of a column
    same_y: bool | str = False
    wide: Sequence[float] | None = None  # widths of columns relative to each other
    high: Sequence[float] | None = None

    @property
    def panels(self) -> list[Panel]:
        return [panel for row in self.rows for panel in row if panel is not None]


def outline(x: np.ndarray, y: np.ndarray, width: float = 1.0) -> Curve:
    """The edge of a clearance."""
    return Curve(x, y, colour="black", width=width, frame=True)
