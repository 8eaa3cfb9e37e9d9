"""One look and one palette for every figure, on screen and in print."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from jointplay.errors import MissingName
from jointplay.plots.palette import AXIS_COLOURS, COLOURS, MODE_COLOURS

__all__ = [
    "AXIS_COLOURS",
    "COLOURS",
    "MODE_COLOURS",
    "SIZES",
    "STYLES",
    "StyledFigure",
    "footnote",
    "new_figure",
    "style",
]

_SMALL_PRINT, _LETTERS_AN_INCH = 5.5, 24
"""Size of footnotes [pt], and how many of their letters stand side by side."""

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
    "axes.formatter.useoffset": False,
}

STYLES: dict[str, dict[str, Any]] = {
    "screen": _SCREEN,
    "paper": _SCREEN
    | {
        "font.family": "serif",
        "font.serif": ["STIXGeneral", "DejaVu Serif"],
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
"""``screen``, and ``paper``: serif type, 88 mm wide, embedded TrueType fonts."""

SIZES = {"screen": 1.0, "paper": 0.58}
"""Width of a figure relative to its width on screen: 6 inches become 88 mm."""


@contextmanager
def style(name: str = "screen") -> Iterator[None]:
    """Use this package's look, leaving the user's own settings alone.

    Raises:
        MissingName: no such style.
    """
    if name not in STYLES:
        raise MissingName("style", name, STYLES)
    with mpl.rc_context(STYLES[name]):  # type: ignore[arg-type]
        yield


class StyledFigure(Figure):
    """A figure that keeps its style whenever it is drawn, and shows itself once in a notebook.

    matplotlib takes some settings (fonts of tick labels, font embedding, resolution) when a figure
    is drawn, not when it is made.
    """

    def __init__(self, *args: Any, look: str = "screen", **options: Any) -> None:
        """Make a figure in the style `look`."""
        self._placed = False
        super().__init__(*args, **options)
        self.look = look

    def draw(self, renderer: Any) -> None:
        """Draw in the figure's style."""
        with style(self.look):
            super().draw(renderer)

    def savefig(self, fname: Any, **options: Any) -> None:  # type: ignore[override]
        """Write in the figure's style; options as `matplotlib.figure.Figure.savefig`."""
        with style(self.look), self._laid_out(options):
            super().savefig(fname, **options)

    def get_layout_engine(self) -> Any:
        """None once all has its place."""
        return None if self._placed else super().get_layout_engine()

    @contextmanager
    def _laid_out(self, options: dict[str, Any]) -> Iterator[None]:
        """All put in its place once, for the time of the block.

        matplotlib itself draws a figure twice to lay it out.
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


def new_figure(width: float, height: float, look: str = "screen") -> StyledFigure:
    """An empty figure, its size [inches] being that on screen; call it within `style`."""
    return StyledFigure(figsize=(width * SIZES[look], height * SIZES[look]), look=look)


def footnote(figure: Figure, text: str) -> None:
    """Put small print below a figure, in as many lines as its width needs."""
    across = int(_LETTERS_AN_INCH * figure.get_figwidth())
    lines = [textwrap.fill(line, across) for line in text.splitlines()]
    figure.supxlabel("\n".join(lines), fontsize=_SMALL_PRINT, x=0.01, ha="left")
