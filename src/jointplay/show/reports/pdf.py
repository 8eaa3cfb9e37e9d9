"""Reports as PDFs: the answer on one page, and a page for each further graph."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.image import imread

from jointplay.show.plots.chart import Chart, Rule, in_rows
from jointplay.show.plots.draw import draw, draw_panel, key
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
_LINE_IN, _ROW_IN, _MAIN_IN, _PICTURE_IN = 0.165, 0.21, 3.2, 2.4
"""Heights of a line of 8.5 pt, of a table's row, of the main chart and of a picture (judged)."""
_LETTERS, _ASIDE, _TITLE = 122, 38, 64
"""Letters in a line across the page, in a line beside the main chart, in a title (judged)."""
_MARGIN_IN = 0.5  # margin of the page: what printers leave blank, and more (judged)
_FURTHER, _FURTHER_IN = 2, 2.2
"""Most panels of further charts on the first page, and the height that they need (judged)."""
_LETTERS_AN_INCH = 13  # letters an inch in a title of 9 pt (judged)
_COLUMNS, _NAMES = 3, 3  # most panels side by side; columns of a legend


def pdf(title: str, blocks: Sequence[tuple[Block, Sequence[Part]]], start: float = 0.0) -> bytes:
    """A report's PDF in vector graphics; time before `start` [s], which is not judged, is grey."""
    content = io.BytesIO()
    with style("screen"), PdfPages(content) as pages:  # typefaces are embedded as it closes
        pages.infodict()["Title"] = title
        answer, shown = _answer(title, blocks[0][1], start)
        pages.savefig(answer)
        for block, parts in blocks:
            for chart in _charts(parts, start):
                if chart.title not in shown or block is not blocks[0][0]:
                    pages.savefig(draw(replace(chart, title=f"{block.title}: {chart.title}")))
    return content.getvalue()


def _charts(parts: Sequence[Part], start: float) -> Iterator[Chart]:
    for part in flat(parts):
        if isinstance(part, Graph):
            yield _chart(part, start)
        elif isinstance(part, Drawing) and isinstance(part.content, Chart):
            yield replace(part.content, title=part.title)


def _chart(graph: Graph, start: float) -> Chart:
    """A graph as a chart, its time before `start` shaded, with one legend for all panels."""
    shaded = start and graph.timed
    marks = [Rule(0.0, "x", colour=GREY, width=0.0, end=start)] if shaded else []
    panels = [replace(panel, columns=0).with_marks(*marks) for panel in graph.panels]
    across = 1 if graph.stacked else min(len(panels), _COLUMNS)
    rows = in_rows(panels, across)
    size = (7.0, 1.3 + 1.6 * len(rows)) if graph.stacked else (4.3 * across, 0.8 + 4.1 * len(rows))
    chart = Chart(rows, size, graph.title, key=_NAMES, key_at="outside lower center")
    return replace(chart, same_x=graph.stacked, same_y="col" if graph.same else False)


def _answer(title: str, parts: Sequence[Part], start: float) -> tuple[Figure, list[str]]:
    """The first page, and the titles of the charts on it.

    Five bands, from above: title and sentences; the main chart, with the assumptions beside it; the
    tables and pictures; the remaining lines; further charts, as many as there is room for.
    """
    first = next((k for k, part in enumerate(parts) if isinstance(part, Beside)), len(parts))
    titles = textwrap.wrap(title, _TITLE)
    above = _lines(parts[:first], _LETTERS)
    aside = _lines(flat(parts[first : first + 1]), _ASIDE)
    below = _lines(parts[first + 1 :], _LETTERS)
    grids = [part for part in flat(parts) if isinstance(part, Grid)]
    images = [part.content for part in flat(parts) if isinstance(part, Drawing)]
    pictures = [image for image in images if isinstance(image, bytes)]
    charts = list(_charts(parts, start))
    rows = max((len(grid.rows) + 1 for grid in grids), default=0)
    heights = [
        0.3 + 0.25 * len(titles) + _LINE_IN * len(above),
        max(_MAIN_IN if charts else 0.1, _LINE_IN * (len(aside) + 1)),
        max(_ROW_IN * rows, _PICTURE_IN if pictures else 0.1),
        _LINE_IN * (len(below) + 2),
    ]
    left = max(_A4_IN[1] - 2.0 * _MARGIN_IN - sum(heights), 0.1)  # of a sheet's height
    further: list[Chart] = []
    for chart in charts[1:] if left >= _FURTHER_IN else ():
        if len(chart.rows) == 1 and sum(len(c.panels) for c in [*further, chart]) <= _FURTHER:
            further.append(chart)
    growing = [4] if further else [1, 2] if pictures else [1]  # bands that share what is left
    heights = [h + (k in growing) * left / len(growing) for k, h in enumerate([*heights, 0.0])]
    size = np.array([_A4_IN[0], sum(heights) + 2.0 * _MARGIN_IN])
    figure = new_figure(*size)
    edge = _MARGIN_IN / size
    figure.get_layout_engine().set(rect=(*edge, *(1.0 - 2.0 * edge)))
    rooms: Any = figure.subfigures(5, 1, height_ratios=np.maximum(heights, 0.1))
    rooms[0].text(0.0, 1.0, "\n".join(titles), fontsize=13, weight="bold", va="top")
    _write(rooms[0], above, heights[0], 0.15 + 0.25 * len(titles))
    main, beside = rooms[1].subfigures(1, 2, width_ratios=[1.9, 1.0])
    if charts:
        _place(main, charts[0])
    _write(beside, aside, heights[1], 0.1)
    widths = [1.0 + 0.9 * (len(grid.head) - 2) for grid in grids] + [1.0 for _ in pictures or (0,)]
    places = rooms[2].subplots(1, len(widths), squeeze=False, width_ratios=widths)
    for axes in places.flat:
        axes.set_axis_off()
    for axes, grid in zip(places.flat, grids, strict=False):
        _write_table(axes, grid, rows * _ROW_IN / heights[2])
    for axes, picture in zip(places.flat[len(grids) :], pictures, strict=False):
        axes.imshow(imread(io.BytesIO(picture)))
        axes.set_anchor("N")
    _write(rooms[3], below, heights[3], 0.15)
    across = [len(chart.panels) for chart in further] or [1]
    parts_below = np.ravel(rooms[4].subfigures(1, len(across), width_ratios=across))
    for room, chart in zip(parts_below, further, strict=False):
        _place(room, chart)
    return figure, [chart.title for chart in (*charts[:1], *further)]


def _place(room: Any, chart: Chart) -> None:
    """Draw a chart into a part of the page."""
    letters = int(_LETTERS_AN_INCH * room.bbox.width / room.dpi)
    room.suptitle(textwrap.fill(chart.title, letters), fontsize=9)
    grid = room.subplots(len(chart.rows), len(chart.rows[0]), squeeze=False)
    for panel, axes in zip(chart.panels, grid.flat, strict=False):
        draw_panel(panel, axes)
    if chart.key:  # else the panel has its own legend
        key(room, grid, 2, "outside lower center")


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


def _write_table(axes: Any, grid: Grid, high: float) -> None:
    """Draw a table at the top of `axes`, over the part `high` of their height."""
    cells = [[text(cell).striptags() for cell in row] for row in (grid.head, *grid.rows)]
    cells = cells if any(cells[0]) else cells[1:]
    box = (0.0, 1.0 - high, 1.0, high)
    table = axes.table(cells, loc="upper left", bbox=box, edges="horizontal")
    table.auto_set_font_size(False)
    table.set_fontsize(6 if len(grid.head) > _NAMES else 8)
    table.auto_set_column_width(range(len(grid.head)))
    for (_, column), cell in table.get_celld().items():
        cell.set_edgecolor("0.85")
        cell.set_text_props(ha="left" if column < grid.left else "right")
