"""Charts drawn with matplotlib: axes, then marks by kind, then legends and colour bars."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.legend import Legend
from matplotlib.ticker import MaxNLocator

from jointplay.show.plots.chart import (
    Area,
    Axis,
    Bars,
    Chart,
    Curve,
    Dots,
    Label,
    Map,
    Panel,
    Rule,
    Spans,
)
from jointplay.show.plots.style import (
    LETTER,
    SIZES,
    Decades,
    StyledFigure,
    figure_of,
    footnote,
    listed,
    logarithmic,
    new_figure,
    style,
    wrapped,
)

_MANY_POINTS = 20_000
"""Points of a curve beyond which they are rasterised, also in vector graphics: files would grow
with their number (judged)."""
_MOST_WRITTEN = 120
"""Most cells of a map that show their numbers, in 7 pt: about 12 columns by 10 rows are legible
(judged)."""
_HANDLE = 4.0
"""Width of a legend's line with the room about it, relative to the size of type."""
_TITLE_PT, _LINE_IN = 10.0, 0.17  # size of a figure's title, and height of each of its lines
_ACROSS = 0.9  # part of the figure's width that a legend may take
_BESIDE = 0.05  # gap between panels that share an axis, relative to their width (judged)
_TEXT_ROOM = 0.25  # room right of bars for texts, relative to the longest: ten letters (judged)
_ABOVE_PT = 4.0  # between a point and a text above it: clear of the marker [points]
_MOST_NAMED = 9  # most columns or rows of a map that are named, with some eight letters (judged)


def draw(chart: Chart, look: str = "screen") -> StyledFigure:
    """A figure of a chart, in a style of `style.STYLES`."""
    with style(look):
        width, height = chart.size
        title = wrapped(chart.title, SIZES[look] * width, _TITLE_PT)
        more = _LINE_IN / SIZES[look] * title.count("\n")
        figure = new_figure(width, height + more, look)
        share: dict[str, Any] = {"sharex": chart.same_x, "sharey": chart.same_y}
        shape = len(chart.rows), len(chart.rows[0])
        axes = figure.subplots(*shape, squeeze=False, width_ratios=chart.wide, **share)
        drawn: list[tuple[Panel, Axes]] = []
        for row, places in zip(chart.rows, axes, strict=True):
            for panel, place in zip(row, places, strict=True):
                if panel is None:
                    place.set_axis_off()
                else:
                    draw_panel(panel, place)
                    drawn.append((panel, place))
        if chart.same_x and len(chart.rows) > 1:
            for place in axes[:-1].flat:
                place.set_xlabel("")
        if chart.same_y:
            figure.get_layout_engine().set(wspace=_BESIDE)  # end ticks' numbers must not touch
            for place in axes[:, 1:].flat if chart.same_y is True else ():
                place.set_ylabel("")
        # One colour bar for all panels with the same scale, beside them.
        scaled: dict[Axis, list[tuple[Axes, Any]]] = {}
        for panel, place in drawn:
            for mark in panel.marks:
                if isinstance(mark, Dots | Map) and mark.scale is not None:
                    image = [*place.collections, *place.images][-1]
                    scaled.setdefault(mark.scale, []).append((place, image))
        for scale, images in scaled.items():
            form, beside = Decades() if scale.log else None, [place for place, _ in images]
            figure.colorbar(images[-1][1], ax=beside, label=scale.label, format=form)
        if chart.title:
            figure.suptitle(title, color="black", fontsize=_TITLE_PT)
        if chart.key:
            shared = [place for panel, place in drawn if not panel.legend]
            key(figure, shared, chart.key, chart.key_at)
        if chart.note:
            footnote(figure, chart.note)
    return figure


def key(figure: Figure, axes: Any, columns: int, place: Any = "outside upper center") -> None:
    """A legend of everything that is named in the axes, each name once, in rows."""
    named: dict[str, Any] = {}
    for panel in np.ravel(axes):
        for handle, name in zip(*panel.get_legend_handles_labels(), strict=True):
            named.setdefault(name, handle)
    if not named:
        return
    columns = _fitting(columns, list(named), figure)
    # matplotlib fills a legend by columns; cases are read by rows.
    names = [name for column in range(columns) for name in list(named)[column::columns]]
    _enlarge(figure.legend([named[name] for name in names], names, loc=place, ncols=columns))


def _enlarge(legend: Legend) -> None:
    """Thicken a legend's lines and points, so that they are visible however thin in the axes."""
    for line in legend.get_lines():
        line.set_linewidth(max(line.get_linewidth(), 2.0))
        line.set_markersize(max(line.get_markersize(), 4.0))


def _fitting(columns: int, names: Sequence[str], figure: Figure) -> int:
    """Columns that a legend can have: at most `columns`, fewer where names are long or few."""
    size = mpl.rcParams["font.size"]
    column = size * (LETTER * max(map(len, names)) + _HANDLE)
    across = _ACROSS * 72.0 * figure.bbox.width / figure.dpi  # [points], also in a subfigure
    return max(1, min(columns, len(names), int(across / column)))


def draw_panel(panel: Panel, axes: Axes, **options: Any) -> None:
    """Draw a panel into axes, in their style.

    `options` are matplotlib's, for the marks that are data: ``color``, ``lw``, ``label`` ...
    """
    for mark in panel.marks:
        framed = isinstance(mark, Curve) and mark.frame
        _DRAWN[type(mark)](axes, mark, panel, {} if framed else options)
    _set_axis(axes, "x", panel.x, panel)
    _set_axis(axes, "y", panel.y, panel)
    if any(isinstance(mark, Spans | Bars) for mark in panel.marks):
        axes.grid(axis="y", visible=False)
        axes.tick_params(axis="y", length=0)
    if panel.equal:
        axes.set_aspect("equal", adjustable="box" if panel.equal == "box" else "datalim")
    if panel.title:
        look: Any = {"color": panel.colour, "loc": "left"} if panel.colour else {}
        axes.set_title(panel.title, fontsize=9, **look)
    if not axes.get_legend_handles_labels()[0]:
        return
    if panel.legend:
        outside: dict[str, dict[str, Any]] = {
            "beside": {"bbox_to_anchor": (1.02, 1.0), "loc": "upper left"},
            "below": {"bbox_to_anchor": (0.5, -0.18), "loc": "upper center", "ncols": 2},
        }
        at: Any = outside.get(panel.legend, {"loc": panel.legend})
        _enlarge(axes.legend(title=panel.legend_title or None, fontsize=7, **at))
    elif panel.columns:  # above the axes, in fewer columns on a narrow figure
        names = axes.get_legend_handles_labels()[1]
        columns = _fitting(panel.columns, names, figure_of(axes))
        at = {"loc": "lower left", "bbox_to_anchor": (0.0, 1.0), "borderaxespad": 0.2}
        _enlarge(axes.legend(ncols=columns, handlelength=1.3, columnspacing=1.2, **at))


class _Ticks(MaxNLocator):
    """Ticks so few that their numbers do not touch: matplotlib reckons with three letters each."""

    def __init__(self) -> None:
        super().__init__("auto", steps=[1, 2, 5, 10])  # steps of 2.5 would give longer numbers

    def tick_values(self, low: float, high: float) -> Sequence[float]:
        axis: Any = self.axis
        ticks = super().tick_values(low, high)
        letters = max(len(f"{tick:.6g}") for tick in ticks)
        # A letter is 0.64 of the font's size wide, a gap 0.8; a tick space is three sizes.
        count = int(axis.get_tick_space() * 3.0 / (0.64 * letters + 0.8))
        if len(ticks) > count + 1:
            ticks = MaxNLocator(max(count, 2), steps=[1, 2, 5, 10]).tick_values(low, high)
        return ticks


def _set_axis(axes: Axes, which: str, axis: Axis, panel: Panel) -> None:
    factor, _ = axis.shown
    drawn_axis = getattr(axes, f"{which}axis")
    getattr(axes, f"set_{which}label")(axis.label)
    if axis.rows is not None:
        count = len(axis.rows)
        at = list(range(count))
        if any(isinstance(mark, Map) for mark in panel.marks) and count > _MOST_NAMED:
            at = sorted({round(row) for row in np.linspace(0, count - 1, _MOST_NAMED)})
        drawn_axis.set_ticks(at, [axis.rows[k] for k in at])
        if which == "y" and not any(isinstance(mark, Map) for mark in panel.marks):
            axes.set_ylim(len(axis.rows) - 0.5, -0.5)
        return
    limits = [None if limit is None else factor * limit for limit in (axis.low, axis.high)]
    if limits != [None, None]:
        getattr(axes, f"set_{which}lim")(*limits)
    # An axis without positive data stays linear: on a logarithmic one nothing has a place.
    if axis.log and np.isfinite(getattr(axes.dataLim, f"minpos{which}")):
        logarithmic(axes, which)
    if axis.ticks is not None:
        drawn_axis.set_major_locator(
            MaxNLocator(axis.ticks, symmetric=-(axis.low or 0.0) == (axis.high or 0.0))
        )
    elif which == "x" and not axis.log:
        drawn_axis.set_major_locator(_Ticks())
    if axis.whole:
        drawn_axis.set_major_locator(MaxNLocator(integer=True))


def _name(mark: Any) -> dict[str, str]:
    return {"label": listed(mark.name) if mark.name else "_"}


def _curve(axes: Axes, mark: Curve, panel: Panel, options: Mapping[str, Any]) -> None:
    across, up = panel.x.shown[0], panel.y.shown[0]
    x, y = across * np.asarray(mark.x), up * np.asarray(mark.y)
    look: dict[str, Any] = {"color": mark.colour, "alpha": mark.opacity, **_name(mark)}
    low = None if mark.low is None else up * np.asarray(mark.low)
    high = None if mark.high is None else up * np.asarray(mark.high)
    if mark.aside is not None or (low is not None and not mark.line):
        bars = None if low is None else np.abs(np.array([low, high]) - y)
        aside = None if mark.aside is None else across * mark.aside
        look |= {"fmt": f"{mark.marker}{mark.line}", "ms": mark.size, "lw": mark.width or 0.8}
        axes.errorbar(x, y, bars, aside, **look | dict(options))
        return
    look |= {"ls": mark.line or "none", "zorder": mark.order}
    if mark.marker:
        look |= {"marker": mark.marker, "ms": mark.size, "mew": 0.0}
        if mark.hollow or mark.marker in "+x":
            look |= {"mew": 1.0, "mfc": "none"}
    if mark.width is not None:
        look["lw"] = mark.width
    if mark.steps:
        look["drawstyle"] = "steps-mid"
    if not mark.line and len(x) > _MANY_POINTS:
        look["rasterized"] = True
    (line,) = axes.plot(x, y, **look | dict(options))
    if low is not None and high is not None:
        known = np.isfinite(low) & np.isfinite(high)
        if known.any():
            axes.fill_between(x, low, high, where=known, color=line.get_color(), alpha=0.2, lw=0)


def _bars(axes: Axes, mark: Bars, panel: Panel, options: Mapping[str, Any]) -> None:
    factor = panel.x.shown[0]
    values = factor * np.asarray(mark.values)
    rows = np.arange(len(values)) if mark.rows is None else np.asarray(mark.rows)
    look: dict[str, Any] = {"color": mark.colour, "alpha": mark.opacity, **_name(mark)}
    left = factor * np.asarray(mark.left)
    drawn = axes.barh(rows + mark.shift, values, mark.height, left, **look | dict(options))
    if mark.texts:
        axes.bar_label(drawn, mark.texts, padding=3.0, fontsize=7)
        axes.margins(x=_TEXT_ROOM)
    if np.any(left):  # matplotlib leaves no margin where bars begin at the ends of others
        low, high = axes.dataLim.intervalx
        axes.set_xlim(1.03 * min(low, 0.0), 1.03 * high)


def _spans(axes: Axes, mark: Spans, panel: Panel, options: Mapping[str, Any]) -> None:
    look: dict[str, Any] = {"facecolors": mark.colour, "linewidth": 0.0}
    bars = panel.x.shown[0] * np.column_stack([mark.begin, mark.end - mark.begin])
    axes.broken_barh(bars.tolist(), (mark.row - 0.4, 0.8), **look | dict(options))


def _rule(axes: Axes, mark: Rule, panel: Panel, options: Mapping[str, Any]) -> None:
    factor = (panel.x if mark.along == "x" else panel.y).shown[0]
    look: dict[str, Any] = {"color": mark.colour, "alpha": mark.opacity, **_name(mark)}
    if mark.end is not None:
        band = axes.axvspan if mark.along == "x" else axes.axhspan
        band(factor * mark.at, factor * mark.end, lw=0.0, zorder=0.0, **look)
        return
    line = axes.axvline if mark.along == "x" else axes.axhline
    line(factor * mark.at, lw=mark.width, ls=mark.line, **look)


def _area(axes: Axes, mark: Area, panel: Panel, options: Mapping[str, Any]) -> None:
    x, up = panel.x.shown[0] * mark.x, panel.y.shown[0]
    look: dict[str, Any] = {"color": mark.colour, "alpha": mark.opacity, "lw": 0.0, **_name(mark)}
    axes.fill_between(x, up * mark.low, up * mark.high, zorder=mark.order, **look | dict(options))


def _dots(axes: Axes, mark: Dots, panel: Panel, options: Mapping[str, Any]) -> None:
    look: dict[str, Any] = {"c": mark.scale.shown[0] * mark.values, "cmap": "viridis"}
    look |= {"s": mark.size, "linewidths": 0} | dict(options)
    axes.scatter(panel.x.shown[0] * mark.x, panel.y.shown[0] * mark.y, **look)


def _map(axes: Axes, mark: Map, panel: Panel, options: Mapping[str, Any]) -> None:
    axes.grid(visible=False)
    scale = mark.scale or Axis()
    values = scale.shown[0] * mark.values
    if mark.x is not None and mark.y is not None:
        norm: Any = LogNorm(values.min(), values.max()) if scale.log else None
        x, y = panel.x.shown[0] * mark.x, panel.y.shown[0] * mark.y
        look: dict[str, Any] = {"cmap": mark.palette, "norm": norm, "shading": "nearest"}
        axes.pcolormesh(x, y, values, rasterized=True, **look)
        return
    aspect: Any = "auto" if mark.extent is None else "equal"
    axes.imshow(values, cmap=mark.palette, origin="lower", aspect=aspect, extent=mark.extent)
    if mark.written and values.size <= _MOST_WRITTEN:
        middle = 0.5 * (np.nanmin(values) + np.nanmax(values))
        look = {"ha": "center", "va": "center", "fontsize": 7}
        for (row, column), value in np.ndenumerate(values):
            if np.isfinite(value):
                colour = "white" if value < middle else "0.1"  # not black: dark pages invert it
                axes.text(column, row, f"{value:.3g}", color=colour, **look)


def _label(axes: Axes, mark: Label, panel: Panel, options: Mapping[str, Any]) -> None:
    place = panel.x.shown[0] * mark.x, panel.y.shown[0] * mark.y
    look: dict[str, Any] = {"ha": mark.above or "center", "fontsize": 8 if mark.above else 7}
    look |= {"va": "bottom"} if mark.above else {"va": "center", "color": "0.4"}
    shift = 0.0, _ABOVE_PT if mark.above else 0.0
    axes.annotate(mark.text, place, shift, "data", "offset points", **look)


_DRAWN: dict[type, Any] = {
    Curve: _curve,
    Bars: _bars,
    Spans: _spans,
    Rule: _rule,
    Area: _area,
    Dots: _dots,
    Map: _map,
    Label: _label,
}
