"""What reports are made of: blocks, and the parts in them; `page` and `pdf` show each kind of part.

A block is a function that yields its parts, with its title in `block` above it, and a docstring
whose first line says to readers what is inside. That is all of it: pages and PDFs follow.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from jointplay.base.tables import Column, Table, counted
from jointplay.show.plots.chart import Chart, Panel
from jointplay.show.reports.html import Html, text

SHOWN = 3  # rows of long tables, and points of long lists, that are not folded (judged)

Row = Mapping[str, Any]
"""By its head a value, or a value, its SI unit and, if it is as small as a clearance, True."""


@dataclass(frozen=True)
class Points:
    """A list."""

    rows: Sequence[str]


@dataclass(frozen=True)
class Grid:
    """A table."""

    head: Sequence[object]
    rows: Sequence[Sequence[object]]
    caption: str = ""
    name: str = ""  # by which style sheets and scripts know it
    left: int = 1  # columns that are flush left

    @classmethod
    def of_rows(
        cls, rows: Sequence[Row], worst: str = "", left: int | None = None, **fields: Any
    ) -> Grid:
        """A table of rows with the same heads; with `worst` those first whose figure of this name
        is largest. A column without a word in it is left out."""
        if worst:
            sizes = [-math.inf if v is None else float(v) for v in _column(worst, rows).values]
            rows = [rows[k] for k in sorted(range(len(rows)), key=lambda k: -sizes[k])]
        columns = (_column(head, rows) for head in rows[0])
        filled = [column for column in columns if any(v is None or text(v) for v in column.values)]
        return cls.of_table(Table(filled), left, **fields)

    @classmethod
    def of_table(cls, table: Table, left: int | None = None, **fields: Any) -> Grid:
        """`left`: None stands for the columns that come first and have no numbers."""
        if left is None:
            numbers = [any(map(_is_number, column.values)) for column in table.columns]
            left = [*numbers, True].index(True)
        head, *rows = zip(*map(_shown, table.columns), strict=True)
        return cls(head, rows, left=left, **fields)

    @classmethod
    def of_cases(
        cls, head: str, cases: Sequence[object], figures: Sequence[Row], **fields: Any
    ) -> Grid:
        """A table with a column for each case and a row for each figure that any of them has."""
        longest = sorted(figures, key=len, reverse=True)  # gives the order
        columns = (_column(name, figures) for name in dict.fromkeys(n for r in longest for n in r))
        rows = [_shown(column) for column in columns if any(v is not None for v in column.values)]
        return cls([head, *cases], rows, **fields)


@dataclass(frozen=True)
class Graph:
    """A chart of panels: those over time or frequency below each other, others side by side."""

    name: str
    title: str
    panels: Sequence[Panel]
    same: bool = False  # whether their y axes are the same

    @property
    def timed(self) -> bool:
        return self.panels[0].x.name == "time"

    @property
    def stacked(self) -> bool:
        return self.timed or self.panels[0].x.name == "frequency"


@dataclass(frozen=True)
class Drawing:
    """A chart that stays as it is, or a picture (PNG)."""

    title: str
    content: Chart | bytes


@dataclass(frozen=True)
class Fold:
    """Parts to unfold."""

    summary: str
    parts: Sequence[Part]


@dataclass(frozen=True)
class Beside:
    """Columns of parts, side by side where there is room."""

    columns: Sequence[Sequence[Part]]


Part = Html | Points | Grid | Graph | Drawing | Fold | Beside

Content = Callable[[Any], Iterable[Part]]
"""Gives the parts of what the report is about; a block that has none is left out."""


@dataclass(frozen=True)
class Block:
    """A part of a report with a title."""

    title: str
    parts: Content
    folded: bool = True

    @property
    def inside(self) -> str:
        """What is in it, in a line."""
        return (self.parts.__doc__ or "").partition("\n")[0]


def block(blocks: list[Block], title: str, folded: bool = True) -> Callable[[Content], Content]:
    """Put the function below it at the end of a report's blocks."""

    def add(parts: Content) -> Content:
        blocks.append(Block(title, parts, folded))
        return parts

    return add


def shortened(part: Points | Grid, noun: str, most: int = SHOWN) -> Iterator[Part]:
    """A list or a table, of which what follows the first `most` is folded if it is several."""
    whole: Any = part
    if len(others := whole.rows[most:]) < 2:
        yield whole
        return
    yield replace(whole, rows=whole.rows[:most])
    yield Fold(f"The other {counted(len(others), noun)}", [replace(whole, rows=others)])


def flat(parts: Iterable[Part], unfold: bool = False) -> Iterator[Part]:
    """Parts in their order, without columns; what is folded stays so unless told otherwise."""
    for part in parts:
        if isinstance(part, Beside):
            for side in part.columns:
                yield from flat(side, unfold)
        elif isinstance(part, Fold) and unfold:
            yield from flat(part.parts, unfold)
        else:
            yield part


def _column(head: str, rows: Sequence[Row]) -> Column:
    """The values of this name in all rows; None in those that have none."""
    cells = (row.get(head) for row in rows)
    known = [cell if isinstance(cell, tuple) else (cell, "") for cell in cells]
    _, unit, *fine = max(known, key=lambda cell: (len(cell), cell[1]))  # of a row that has it
    return Column(head, [value for value, *_ in known], unit, fine=any(fine))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(column: Column) -> list[Any]:
    """What a column is called and its values, in the unit in which they are shown."""
    factor, _ = column.shown
    scaled = (factor * v if factor != 1.0 and _is_number(v) else v for v in column.values)
    return [column.title, *scaled]
