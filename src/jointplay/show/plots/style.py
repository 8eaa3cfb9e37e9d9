"""The style of all figures: settings of matplotlib, typefaces, sizes, logarithmic axes."""

from __future__ import annotations

import io
import math
import os
import re
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib import font_manager
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogFormatterSciNotation

from jointplay.base import files
from jointplay.base.errors import require_known

_SMALL_PRINT = 6.5  # size of footnotes [pt]
LETTER = 0.55
"""Mean width of a letter of DejaVu Sans, relative to the size of type."""

_SCREEN = {
    "font.size": 9,
    "axes.grid": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "lines.linewidth": 0.9,
    "legend.frameon": False,
    "savefig.dpi": 160,
    "pdf.fonttype": 42,
    "figure.constrained_layout.use": True,
    "axes.formatter.offset_threshold": 5,  # ticks that share so many digits show them once, aside
    "text.parse_math": False,  # names of joints and cases stand as they are, $ and all
}

STYLES: dict[str, dict[str, Any]] = {
    "screen": _SCREEN,
    "paper": _SCREEN
    | {
        # By name: of a generic family matplotlib takes one typeface for all letters, no fallbacks.
        "font.family": ["STIXGeneral", "DejaVu Serif"],
        "mathtext.fontset": "stix",
        "font.size": 8,
        "axes.titlesize": 8,
        "legend.fontsize": 7,
        "axes.linewidth": 0.6,
        "lines.linewidth": 0.7,
        "axes.unicode_minus": True,
        "savefig.dpi": 600,
    },
}
"""matplotlib's settings for ``screen``, and for ``paper``: serif type, 88 mm wide."""

FALLBACKS = (
    *("Noto Sans CJK SC", "Noto Sans CJK JP", "Noto Sans CJK KR", "Source Han Sans"),
    *("PingFang SC", "Hiragino Sans", "Apple SD Gothic Neo", "WenQuanYi Micro Hei"),
    *("Noto Sans Arabic", "Noto Sans Devanagari", "Arial Unicode MS"),
)
"""Typefaces for letters that matplotlib's own lacks; those that are installed are used."""

SIZES = {"screen": 1.0, "paper": 0.58}
"""Width of a figure relative to its width on screen: 6 inches become 88 mm."""


@contextmanager
def style(name: str = "screen") -> Iterator[None]:
    """Use this package's style within the block, and leave the user's own settings alone."""
    require_known("style", name, STYLES)
    chosen = STYLES[name]
    families = chosen.get("font.family", ["sans-serif"])
    settings: Any = {**chosen, "font.family": [*families, *_fallbacks()]}
    with mpl.rc_context(settings):
        yield


@cache
def _fallbacks() -> tuple[str, ...]:
    """The installed ones of `FALLBACKS`: matplotlib warns of those that are not."""
    installed = set(font_manager.get_font_names())
    return tuple(name for name in FALLBACKS if name in installed)


class StyledFigure(Figure):
    """A figure that keeps its style whenever it is drawn, and displays itself in a notebook.

    matplotlib takes some settings (fonts of tick labels, font embedding, resolution) when a figure
    is drawn, not when it is made.
    """

    def __init__(self, *args: Any, look: str = "screen", **options: Any) -> None:
        self._placed = False
        super().__init__(*args, **options)
        self.look = look

    def draw(self, renderer: Any) -> None:
        with style(self.look):
            super().draw(renderer)

    def savefig(self, fname: Any, **options: Any) -> None:  # type: ignore[override]
        """Write in the figure's style; options as `matplotlib.figure.Figure.savefig`.

        A file is written whole or not at all; as matplotlib's, it replaces an older one.
        """
        if isinstance(fname, str | os.PathLike):
            path, drawn = Path(fname), io.BytesIO()
            kind = options.pop("format", None) or path.suffix[1:] or mpl.rcParams["savefig.format"]
            self.savefig(drawn, format=kind, **options)
            whole = path if path.suffix else path.with_name(f"{path.name}.{kind}")
            files.write(whole, drawn.getvalue(), overwrite=True)
            return
        with style(self.look), self._laid_out(options):
            super().savefig(fname, **options)

    def get_layout_engine(self) -> Any:
        return None if self._placed else super().get_layout_engine()

    @contextmanager
    def _laid_out(self, options: dict[str, Any]) -> Iterator[None]:
        """Lay the figure out once, and keep that layout within the block.

        matplotlib would lay out by drawing the figure twice.
        """
        engine = self.get_layout_engine()
        if engine is not None and "bbox_inches" not in options:
            engine.execute(self)
            self._placed = True
        try:
            yield
        finally:
            self._placed = False
            if engine is not None:
                self.set_layout_engine(engine)

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        with style(self.look):
            super().savefig(buffer, format="png", dpi=110)
        return buffer.getvalue()


_NEAR = 2.5  # ratio of an axis's ends up to which all of its digits get numbers


class Decades(LogFormatterSciNotation):
    """Tick labels of a logarithmic axis in plain text, 10⁻³: figures here parse no formulas."""

    def __call__(self, x: float, pos: int | None = None) -> str:
        axis: Any = self.axis
        low, high = axis.get_view_interval()
        if high > _NEAR * low and f"{x:.0e}"[0] not in "125":  # labels of 3 and 4 would touch
            return ""
        formula = super().__call__(x, pos)
        raised = re.sub(r"\^\{(.*?)\}", lambda power: power[1].translate(_RAISED), formula)
        return re.sub(r"\$|\\mathdefault|[{}]", "", raised).replace(r"\times", "·")


_RAISED = str.maketrans("-−0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def logarithmic(panel: Axes, name: str) -> None:
    """Make the axis ``x`` or ``y`` of a panel logarithmic."""
    getattr(panel, f"set_{name}scale")("log")
    axis = getattr(panel, f"{name}axis")
    axis.set_major_formatter(Decades())
    axis.set_minor_formatter(Decades(minor_thresholds=(1.0, math.log10(_NEAR))))


def literal(panel: Axes) -> None:
    """Show the texts of axes literally, $ and all; the axes may be the user's own."""
    texts = [panel.title, panel.xaxis.label, panel.yaxis.label, *panel.texts]
    legend = panel.get_legend()
    for text in texts + ([] if legend is None else legend.get_texts()):
        text.set_parse_math(False)


def listed(name: str) -> str:
    """A user's name for a legend: matplotlib would leave out one that begins with _."""
    return f" {name}" if name.startswith("_") else name


def new_figure(width: float, height: float, look: str = "screen") -> StyledFigure:
    """An empty figure of a size on screen [inches], on paper scaled by `SIZES` to a journal's
    column; call it within `style`."""
    factor = SIZES[look]
    return StyledFigure(figsize=(width * factor, height * factor), look=look)


def footnote(figure: Figure, text: str) -> None:
    """Put small print below a figure, wrapped to its width."""
    text = wrapped(text, figure.get_figwidth(), _SMALL_PRINT)
    figure.supxlabel(text, fontsize=_SMALL_PRINT, x=0.01, ha="left")


def wrapped(text: str, width: float, size: float) -> str:
    """Text of a size of type [pt] in lines no longer than a width [inches]."""
    across = int(72.0 * width / (LETTER * size))
    text = re.sub(r"(?<=\d) (?=\S)", "\xa0", text)  # keeps numbers with their units
    lines = [textwrap.fill(line, across) for line in text.splitlines()]
    return "\n".join(lines).replace("\xa0", " ")


def figure_of(panel: Axes) -> Figure:
    """The figure that axes belong to."""
    figure = panel.get_figure(root=True)
    assert isinstance(figure, Figure)
    return figure
