"""Reports as PDFs: the first block on one page, and a page for each graph of the others."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure
from matplotlib.image import imread

from jointplay.show.plots.chart import Chart, Panel, Rule
from jointplay.show.plots.draw import draw, draw_panel, key
from jointplay.show.plots.palette import GREY
from jointplay.show.plots.style import new_figure, style
from jointplay.show.reports.html import Html, text
from jointplay.show.reports.parts import Block, Drawing, Fold, Graph, Grid, Part, Points, flat

_A4_IN = (8.27, 11.69)
_LINE_IN, _LETTERS, _TITLE = 0.165, 122, 75
"""Height of a line of 9 pt, and letters of one and of a title (judged)."""
_COLUMNS, _NAMES = 3, 3  # of panels side by side, and of legends
_SIDE_IN, _STRIP_IN, _ROW_IN = 2.5, 1.4, 0.21
"""Heights of a panel that shows a place, of one over time, and of a row of a table (judged: so that
the first page of a run of six joints is one of A4)."""


def pdf(title: str, blocks: Sequence[tuple[Block, Sequence[Part]]], start: float = 0.0) -> bytes:
    """A report's PDF, of vector graphics; what is before `start` [s] is grey."""
    content = io.BytesIO()
    (_, answer), *others = blocks
    with style("screen"), PdfPages(content) as pages:  # which embeds typefaces when it is closed
        pages.infodict()["Title"] = title
        pages.savefig(_first_page(title, answer, start))
        for block, parts in others:
            for part in flat(parts):
                if isinstance(part, Graph):
                    pages.savefig(_graph_page(part, start))
                elif isinstance(part, Drawing):
                    part.figure.suptitle(f"{block.title}: {part.title}", fontsize=9)
                    pages.savefig(part.figure)
    return content.getvalue()


def _first_page(title: str, parts: Sequence[Part], start: float) -> Figure:
    """Sentences, the table beside the picture, the graphs."""
    titles = textwrap.wrap(title, _TITLE)
    lines = [line for sentence in _sentences(parts) for line in textwrap.wrap(sentence, _LETTERS)]
    grids = [part for part in flat(parts) if isinstance(part, Grid)]
    drawings = [part for part in flat(parts) if isinstance(part, Drawing)]
    graphs = [_shaded(part, start) for part in flat(parts) if isinstance(part, Graph)]
    rows = max((len(grid.rows) + 1 for grid in grids), default=0)
    beside = max(_ROW_IN * rows, _SIDE_IN if drawings else 0.0)
    above = 0.25 + 0.25 * len(titles)
    heights = [above + _LINE_IN * len(lines), beside]
    heights += [0.3 + (_STRIP_IN if graph.stacked else _SIDE_IN) for graph, _ in graphs]
    left = max(_A4_IN[1] - sum(heights), 0.1)
    figure = new_figure(_A4_IN[0], sum(heights) + left)
    rooms: Any = figure.subfigures(len(heights) + 1, 1, height_ratios=[*heights, left])
    top, middle, *places, _ = rooms
    heading: Any = {"fontsize": 13, "weight": "bold", "va": "top"}
    top.text(0.03, 1.0 - 0.15 / heights[0], "\n".join(titles), **heading)
    for k, line in enumerate(lines):
        top.text(0.03, 1.0 - (above + _LINE_IN * k) / heights[0], line, va="top")
    widths = [1.0 + 0.9 * (len(grid.head) - 2) for grid in grids] + [1.0 for _ in drawings]
    across = middle.subplots(1, len(widths), squeeze=False, width_ratios=widths)
    for axes in across.flat:
        axes.set_axis_off()
    for axes, grid in zip(across.flat, grids, strict=False):
        _write_table(axes, grid, rows * _ROW_IN / beside)
    for axes, drawing in zip(across.flat[len(grids) :], drawings, strict=True):
        image = io.BytesIO()
        drawing.figure.savefig(image, format="png", dpi=150)
        axes.imshow(imread(io.BytesIO(image.getvalue())))
    for place, (graph, panels) in zip(places, graphs, strict=True):
        place.suptitle(graph.title, fontsize=9)
        across = place.subplots(1, len(panels), squeeze=False)
        for panel, axes in zip(panels, across.flat, strict=True):
            draw_panel(panel, axes)
            axes.title.set_fontsize(7)
    if graphs:
        every = [axes for place in places for axes in place.axes]
        key(figure, every, 2 * _NAMES, "outside lower center")
    return figure


def _sentences(parts: Sequence[Part]) -> Iterator[str]:
    for part in flat(parts):
        if isinstance(part, Points):
            yield from (text(item).striptags() for item in part.items)
        elif isinstance(part, Fold | Html):
            yield text(part.summary if isinstance(part, Fold) else part).striptags()


def _write_table(axes: Any, grid: Grid, high: float) -> None:
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


def _shaded(graph: Graph, start: float) -> tuple[Graph, list[Panel]]:
    """A graph, and its panels, in which what is not judged is grey; one key names all curves."""
    grey = [Rule(0.0, "x", colour=GREY, width=0.0, end=start)] if start else []
    marks = grey if graph.across == "time" else []
    return graph, [replace(panel, columns=0).with_marks(*marks) for panel in graph.panels]


def _graph_page(graph: Graph, start: float) -> Figure:
    _, panels = _shaded(graph, start)
    across = 1 if graph.stacked else min(len(panels), _COLUMNS)
    rows = [
        [*panels[k : k + across], *[None] * (across - len(panels[k : k + across]))]
        for k in range(0, len(panels), across)
    ]
    size = (7.0, 1.3 + 1.6 * len(rows)) if graph.stacked else (4.3 * across, 0.8 + 4.1 * len(rows))
    same: Any = "col" if graph.same else False
    look: Any = {"key": _NAMES, "key_at": "outside lower center", "same_y": same}
    return draw(Chart(rows, size, graph.title, same_x=graph.stacked, **look))
