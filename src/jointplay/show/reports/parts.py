"""The parts of reports: titled blocks of lists, tables, charts; `page` and `pdf` show each kind.

A block is a function that yields parts, decorated with `block` and its title. Readers see the first
line of its docstring as a summary while the block is folded.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from jointplay.base.tables import Column, Table, counted
from jointplay.show.plots.chart import Chart, Panel
from jointplay.show.reports.html import Html, is_number, text

SHOWN = 3  # rows of a long table, or points of a long list, that stand unfolded (judged)

Row = Mapping[str, Any]
"""By column head, a value, or (value, SI unit), or (value, SI unit, True) to show lengths and the
like in the small units of clearances."""


@dataclass(frozen=True)
class Points:
    """A bullet list."""

    rows: Sequence[str]


@dataclass(frozen=True)
class Grid:
    """A table."""

    head: Sequence[object]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    name: str = ""  # its id in the page, for style sheets and scripts
    left: int = 1  # number of leading columns that are flush left

    @classmethod
    def of_rows(
        cls, rows: Sequence[Row], worst: str = "", left: int | None = None, **fields: Any
    ) -> Grid:
        """A table of rows with the same heads, those largest under the head `worst` first; columns
        of empty text are left out."""
        if worst:
            sizes = [-math.inf if v is None else float(v) for v in _column(worst, rows).values]
            rows = [rows[k] for k in sorted(range(len(rows)), key=lambda k: -sizes[k])]
        columns = (_column(head, rows) for head in rows[0])
        filled = [column for column in columns if any(v is None or text(v) for v in column.values)]
        return cls.of_table(Table(filled), left, **fields)

    @classmethod
    def of_table(cls, table: Table, left: int | None = None, **fields: Any) -> Grid:
        """A table in display units; by default, columns before the first numbers are flush left."""
        if left is None:
            numbers = [any(map(is_number, column.values)) for column in table.columns]
            left = [*numbers, True].index(True)
        head, *rows = zip(*map(_shown, table.columns), strict=True)
        return cls(head, rows, left=left, **fields)

    @classmethod
    def of_cases(
        cls, head: str, cases: Sequence[object], figures: Sequence[Row], **fields: Any
    ) -> Grid:
        """A table with a column for each case and a row for each figure that any case has."""
        longest = sorted(figures, key=len, reverse=True)  # the fullest case gives the rows' order
        columns = (_column(name, figures) for name in dict.fromkeys(n for r in longest for n in r))
        rows = [_shown(column) for column in columns if any(v is not None for v in column.values)]
        return cls([head, *cases], rows, **fields)


@dataclass(frozen=True)
class Graph:
    """A chart that zooms: panels over time or frequency are stacked, others stand side by side."""

    name: str
    title: str
    panels: Sequence[Panel]
    same: bool = False  # whether the panels share their y axis

    @property
    def timed(self) -> bool:
        return self.panels[0].x.name == "time"

    @property
    def stacked(self) -> bool:
        return self.timed or self.panels[0].x.name == "frequency"


@dataclass(frozen=True)
class Drawing:
    """A chart that stays as drawn (SVG), or a picture (PNG)."""

    title: str
    content: Chart | bytes


@dataclass(frozen=True)
class Fold:
    """Parts that are hidden until the reader unfolds them."""

    summary: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Beside:
    """Columns of parts, side by side where there is room."""

    columns: Sequence[Sequence[Part]]


Part = Html | Points | Grid | Graph | Drawing | Fold | Beside

Content = Callable[[Any], Iterable[Part]]
"""Yields a block's parts from the report's subject; a block without parts is left out."""


@dataclass(frozen=True)
class Block:
    """A section of a report."""

    title: str
    parts: Content
    folded: bool = True

    @property
    def inside(self) -> str:
        """A line that summarises the section."""
        return (self.parts.__doc__ or "").partition("\n")[0]


def block(blocks: list[Block], title: str, folded: bool = True) -> Callable[[Content], Content]:
    """A decorator that appends a function to a report's blocks."""

    def add(parts: Content) -> Content:
        blocks.append(Block(title, parts, folded))
        return parts

    return add


def shortened(part: Points | Grid, noun: str, most: int = SHOWN) -> Iterator[Part]:
    """A list or a table, with the rows after the first `most` folded if they are two or more."""
    whole: Any = part
    if len(others := whole.rows[most:]) < 2:
        yield whole
        return
    yield replace(whole, rows=whole.rows[:most])
    yield Fold(f"The other {counted(len(others), noun)}", [replace(whole, rows=others)])


def flat(parts: Iterable[Part], unfold: bool = False) -> Iterator[Part]:
    """All parts in order: those of columns, and with `unfold` also those of folds."""
    for part in parts:
        if isinstance(part, Beside):
            for side in part.columns:
                yield from flat(side, unfold)
        elif isinstance(part, Fold) and unfold:
            yield from flat(part.parts, unfold)
        else:
            yield part


def _column(head: str, rows: Sequence[Row]) -> Column:
    """The values under a head in all rows, None where a row lacks it."""
    cells = (row.get(head) for row in rows)
    known = [cell if isinstance(cell, tuple) else (cell, "") for cell in cells]
    _, unit, *fine = max(known, key=lambda cell: (len(cell), cell[1]))  # a row that has the value
    return Column(head, [value for value, *_ in known], unit, fine=any(fine))


def _shown(column: Column) -> list[Any]:
    """A column's title and its values in the unit in which they are shown."""
    factor, _ = column.shown
    scaled = (factor * v if factor != 1.0 and is_number(v) else v for v in column.values)
    return [column.title, *scaled]
