"""Reports as PDFs: the answer on one page."""

from __future__ import annotations

import io
import math
import textwrap
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.transforms import Bbox

from jointplay.show.plots.chart import Chart, Rule, in_rows
from jointplay.show.plots.draw import draw_panel, key
from jointplay.show.plots.palette import GREY
from jointplay.show.plots.style import new_figure, style
from jointplay.show.reports.html import Html, text
from jointplay.show.reports.parts import (
    Beside,
    Block,
    Drawing,
    Fold,
    Graph,
    Grid,
    Part,
    Points,
    flat,
)

_A4_IN = (8.27, 11.69)
_LINE_IN, _ROW_IN, _MAIN_IN, _PICTURE_IN = 0.165, 0.21, 2.4, 2.0
"""Heights of a line of 8.5 pt, of a table's row, and least ones of chart and picture (judged)."""
_LETTERS, _ASIDE, _TITLE = 122, 56, 64
"""Letters in a line across the page, in a line beside the picture, in a title (judged)."""
_MARGIN_IN = 0.5  # margin of the page: what printers leave blank, and more (judged)
_LETTERS_AN_INCH = 13  # letters an inch in a title of 9 pt (judged)
_COLUMNS, _NAMES = 3, 4  # most panels side by side; columns of a legend
_ROWS = 20  # most rows of a table on the page (judged)
_APART = 3  # letters between the columns of a table; fewer, and a dash reads like a minus (judged)
_DIGITS_PT = 820.0  # size of type [pt] times the digits that then fill the page's width


def pdf(title: str, blocks: Sequence[tuple[Block, Sequence[Part]]], start: float = 0.0) -> bytes:
    """A report's PDF, one page; time before `start` [s], which is not judged, is grey."""
    content = io.BytesIO()
    with style("screen"):
        page = _answer(title, blocks[0][1], start)
        page.savefig(content, format="pdf", metadata={"Title": title})
    return content.getvalue()


def _main_chart(parts: Sequence[Part], start: float) -> Chart | None:
    """The first chart of the parts, time before `start` shaded."""
    for part in flat(parts):
        if isinstance(part, Graph):
            shaded = start and part.timed
            marks = [Rule(0.0, "x", colour=GREY, width=0.0, end=start)] if shaded else []
            panels = [replace(panel, columns=0).with_marks(*marks) for panel in part.panels]
            rows = in_rows(panels, 1 if part.stacked else min(len(panels), _COLUMNS))
            return Chart(rows, _A4_IN, part.title, key=_NAMES)
        if isinstance(part, Drawing) and isinstance(part.content, Chart):
            return replace(part.content, title=part.title)
    return None


def _answer(title: str, parts: Sequence[Part], start: float) -> Figure:
    """The page, an A4 sheet.

    Five bands, from above: title and sentences; the assumptions, with the picture beside them; the
    main chart, which takes most of the room that is left; the tables; the remaining lines, as many
    as there is room for.
    """
    first = next((k for k, part in enumerate(parts) if isinstance(part, Beside)), len(parts))
    titles = textwrap.wrap(title, _TITLE)
    above = _lines(parts[:first], _LETTERS)
    aside = _lines(flat(parts[first : first + 1]), _ASIDE)
    below = _lines(parts[first + 1 :], _LETTERS)
    grids = [part for part in flat(parts) if isinstance(part, Grid)]
    images = [part.content for part in flat(parts) if isinstance(part, Drawing)]
    pictures = [image for image in images if isinstance(image, bytes)]
    chart = _main_chart(parts, start)
    tables = [_cells(grid) for grid in grids]
    rows = max(map(len, tables), default=0)
    size = np.array(_A4_IN)
    heights = [
        0.3 + 0.25 * len(titles) + _LINE_IN * len(above),
        max(_PICTURE_IN if pictures else 0.1, _LINE_IN * (len(aside) + 1)),
        _MAIN_IN if chart else 0.1,
        _ROW_IN * rows + 0.1,
        _LINE_IN * (len(below) + 1),
    ]
    left = size[1] - 2.0 * _MARGIN_IN - sum(heights)
    if left < 0.0:
        kept = max(len(below) - math.ceil(-left / _LINE_IN) - 1, 0)
        below, left = [*below[:kept], "More: in the page"], 0.0
    picture_in = min(0.3 * left, 1.0) if pictures else 0.0
    heights[1:3] = heights[1] + picture_in, heights[2] + left - picture_in
    heights[4] = _LINE_IN * (len(below) + 1)
    figure = new_figure(*size)
    edge = _MARGIN_IN / size
    figure.get_layout_engine().set(rect=(*edge, *(1.0 - 2.0 * edge)))
    rooms: Any = figure.subfigures(5, 1, height_ratios=np.maximum(heights, 0.1))
    rooms[0].text(0.0, 1.0, "\n".join(titles), fontsize=13, weight="bold", va="top")
    _write(rooms[0], above, heights[0], 0.15 + 0.25 * len(titles))
    beside, seen = rooms[1].subfigures(1, 2)
    _write(beside, aside, heights[1], 0.1)
    for axes, picture in zip(_blank(seen, [1.0] * len(pictures)), pictures, strict=True):
        axes.imshow(imread(io.BytesIO(picture)))
    if chart:
        _place(rooms[2], chart)
    widths = [sum(_widths(cells)) for cells in tables]
    for axes, grid, cells in zip(_blank(rooms[3], widths), grids, tables, strict=True):
        _write_table(axes, grid, cells, sum(widths), len(cells) * _ROW_IN / heights[3])
    _write(rooms[4], below, heights[4], 0.15)
    return figure


def _blank(room: Any, widths: Sequence[float]) -> list[Axes]:
    """Axes without frames, side by side."""
    places = room.subplots(1, len(widths), squeeze=False, width_ratios=widths) if widths else None
    blank = [] if places is None else list(places.flat)
    for axes in blank:
        axes.set_axis_off()
    return blank


def _place(room: Any, chart: Chart) -> None:
    """Draw a chart into a part of the page."""
    letters = int(_LETTERS_AN_INCH * room.bbox.width / room.dpi)
    room.suptitle(textwrap.fill(chart.title, letters), fontsize=9)
    grid = room.subplots(len(chart.rows), len(chart.rows[0]), squeeze=False)
    for panel, axes in zip(chart.panels, grid.flat, strict=False):
        draw_panel(panel, axes)
    if chart.key:  # else the panel has its own legend
        key(room, grid, _NAMES, "outside lower center")


def _lines(parts: Iterable[Part], letters: int) -> list[str]:
    """The text of parts, wrapped to lines of `letters`; folded tables are left to the HTML page."""
    lines = []
    for part in parts:
        if isinstance(part, Fold):
            tables = any(isinstance(inner, Grid) for inner in part.parts)
            summary = f"{part.summary}: in the page" if tables else part.summary
            lines += _lines([Points([summary]), *part.parts], letters)
        items = part.rows if isinstance(part, Points) else [part] if isinstance(part, Html) else []
        for item in items:
            lines += textwrap.wrap(text(item).striptags(), letters, subsequent_indent="  ")
    return lines


def _write(room: Any, lines: Sequence[str], high: float, above: float) -> None:
    """Write lines into a band of height `high`, beginning `above` below its top [inches]."""
    for k, line in enumerate(lines):
        room.text(0.0, 1.0 - (above + _LINE_IN * k) / high, line, va="top", fontsize=8.5)


def _cells(grid: Grid) -> list[list[str]]:
    """The texts of a table, as many rows as there is room for."""
    cells = [[text(cell).striptags() for cell in row] for row in (grid.head, *grid.rows)]
    return (cells if any(cells[0]) else cells[1:])[: _ROWS + 1]


def _widths(cells: Sequence[Sequence[str]]) -> list[int]:
    """Widths of a table's columns [letters]."""
    return [max(map(len, column)) + _APART for column in zip(*cells, strict=True)]


def _write_table(
    axes: Axes, grid: Grid, cells: list[list[str]], letters: float, high: float
) -> None:
    """Draw a table at the top of `axes`, over the part `high` of their height.

    `letters` are those of all tables across the page.
    """
    wide = min(10.0 * letters / _DIGITS_PT, 1.0)  # rows of two columns stay easy to follow
    box = Bbox.from_bounds(0.0, 1.0 - high, wide, high)
    widths = [width / sum(_widths(cells)) for width in _widths(cells)]
    table = axes.table(cells, loc="upper left", bbox=box, edges="horizontal", colWidths=widths)
    table.auto_set_font_size(False)
    table.set_fontsize(min(8.0, _DIGITS_PT / letters))
    for (_, column), cell in table.get_celld().items():
        cell.PAD = 0.0  # else a part of the width
        cell.set_edgecolor("0.85")
        cell.set_text_props(ha="left" if column < grid.left else "right")
