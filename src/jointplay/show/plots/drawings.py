"""Drawings of a journal in its bearing, as the paper has them in Figures 1 to 5; not to scale."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Circle, Polygon

from jointplay.physics.geometry import Form
from jointplay.show.plots.names import MODE_TERMS, form_name
from jointplay.show.plots.palette import BLUE, VERMILION
from jointplay.show.plots.style import StyledFigure, footnote, new_figure, style

_RADIUS, _HALF = 0.7, 1.5  # radius and half length of the drawn journal
_ROOM = 0.16  # gap between the journal and a wall that it does not touch
_TILT = 0.09  # of the drawn journal [rad]
_SIDES = ("radial_A", "radial_B", "axial_A", "axial_B")

FORMS: Mapping[Form, tuple[float, tuple[str, ...]]] = {
    Form.RADIAL_BOTH_ENDS_OPPOSITE: (_TILT, ("radial_A", "radial_B")),
    Form.RADIAL_AXIAL_SAME_END: (_TILT, ("radial_A", "axial_A")),
    Form.RADIAL_AXIAL_OTHER_END: (_TILT, ("radial_A", "axial_B")),
    Form.AXIAL_BOTH_ENDS: (_TILT, ("axial_A", "axial_B")),
    Form.ONE_RADIAL: (_TILT, ("radial_A",)),
    Form.ONE_AXIAL: (_TILT, ("axial_A",)),
    Form.TWO_RADIAL_ONE_AXIAL: (_TILT, ("radial_A", "radial_B", "axial_A")),
    Form.ONE_RADIAL_TWO_AXIAL: (_TILT, ("radial_A", "axial_A", "axial_B")),
    Form.FOUR_POINTS: (_TILT, _SIDES),
    Form.SURFACE: (0.0, ("axial_A",)),
    Form.LINE: (0.0, ("radial_A", "radial_B")),
    Form.SURFACE_AND_LINE: (0.0, ("radial_A", "radial_B", "axial_A")),
}
"""Tilt of the drawn journal [rad] and what touches, for each form; end A is the right one."""


def _corners(tilt: float, x: float = 0.0, y: float = 0.0) -> np.ndarray:
    """Corners of the tilted journal's section: top right, top left, bottom left, bottom right."""
    c, s = math.cos(tilt), math.sin(tilt)
    box = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [_HALF, _RADIUS]
    return box @ np.array([[c, s], [-s, c]]) + [x, y]


def _bearing(panel: Axes, left: float, right: float, bottom: float, top: float) -> None:
    panel.plot([left, right, right, left, left], [top, top, bottom, bottom, top], "k", lw=1.6)


def _journal(panel: Axes, corners: np.ndarray) -> None:
    panel.add_patch(Polygon(corners, closed=True, fc="#D5E3EF", ec=BLUE, lw=1.0))


def _blank(panel: Axes, title: str = "") -> None:
    panel.set_aspect("equal")
    panel.set_axis_off()
    panel.set_title(title, fontsize=8)


def _form(panel: Axes, form: Form) -> None:
    tilt, touching = FORMS[form]
    corners = _corners(tilt)
    (left, bottom), (right, top) = corners.min(axis=0), corners.max(axis=0)
    line = tilt == 0.0
    gap = {side: 0.0 if side in touching else _ROOM for side in _SIDES}
    upper = 0.0 if line and "radial_A" in touching else gap["radial_A"]
    lower = _ROOM if line else gap["radial_B"]
    walls = (left - gap["axial_B"], right + gap["axial_A"], bottom - lower, top + upper)
    _bearing(panel, *walls)
    _journal(panel, corners)
    hit = dict(zip(_SIDES, corners[[0, 2, 3, 1]], strict=True))
    look: dict[str, Any] = {"color": VERMILION, "zorder": 4.0, "clip_on": False}
    if line:
        if "radial_A" in touching:
            panel.plot(*corners[:2].T, lw=3.0, **look)
        if "axial_A" in touching:
            panel.plot(*corners[[0, 3]].T, lw=3.0, **look)
    else:
        for side in touching:
            panel.plot(*hit[side], "o", ms=5.0, **look)
    _blank(panel, form_name(form))


def contact_forms() -> StyledFigure:
    """The twelve contact forms of Figure 2, sections through the bearing's axis."""
    with style():
        figure = new_figure(9.0, 4.6)
        axes = figure.subplots(3, 4)
        for panel, form in zip(axes.flat, FORMS, strict=True):
            _form(panel, form)
        footnote(
            figure,
            "Sections through the axis of the bearing (black), clearances not to scale. Red: where "
            "the journal touches. The letters a to d within their group are assumed.",
        )
    return figure


def _measure(panel: Axes, first: Any, last: Any, text: str, at: tuple[float, float]) -> None:
    arrow = {"arrowstyle": "<->", "lw": 0.8, "shrinkA": 0.0, "shrinkB": 0.0}
    panel.annotate("", first, last, arrowprops=arrow)
    panel.text(*at, text, fontsize=8, ha="center", va="center")


def _sizes(panel: Axes) -> None:
    """Figure 1: bearing, journal and their clearances."""
    _bearing(panel, -1.75, 1.75, -0.95, 0.95)
    _journal(panel, _corners(0.0))
    panel.plot([-1.9, 1.9], [0.0, 0.0], "k-.", lw=0.6)
    _measure(panel, (-0.6, 0.0), (-0.6, 0.95), "R_i", (-0.75, 0.45))
    _measure(panel, (0.3, 0.0), (0.3, 0.7), "R_j", (0.47, 0.35))
    _measure(panel, (-1.75, -1.15), (1.75, -1.15), "L_i", (0.0, -1.27))
    _measure(panel, (-1.5, -0.45), (1.5, -0.45), "L_j", (0.0, -0.32))
    _measure(panel, (1.1, 0.7), (1.1, 0.95), "C_r = R_i - R_j", (0.42, 0.82))
    _measure(panel, (1.5, -0.2), (1.75, -0.2), "", (0.0, 0.0))
    panel.text(1.82, -0.2, "C_a = (L_i - L_j)/2", fontsize=8, va="center")
    panel.set(xlim=(-2.0, 3.2), ylim=(-1.4, 1.05))
    _blank(panel, "Figure 1: bearing i (black), journal j (blue); eqs 1 to 3")


def _modes(panel: Axes) -> None:
    """Figure 3: the modes, in sections across the axis."""
    for k, (name, away) in enumerate(zip(MODE_TERMS, (0.1, 0.3, 0.38), strict=True)):
        x = 2.3 * k
        panel.add_patch(Circle((x, 0.0), 1.0, fc="none", ec="black", lw=1.6))
        journal = Circle((x + away, 0.0), 0.7, fc="#D5E3EF", ec=BLUE, lw=1.0, zorder=0.5)
        panel.add_patch(journal)
        panel.text(x, -1.25, name, fontsize=8, ha="center")
        panel.text(x, -1.5, f"gap {('>', '=', '<')[k]} 0", fontsize=8, ha="center")
    panel.plot([1.04 + 4.6 + 0.04], [0.0], "o", color=VERMILION, ms=3.0)
    panel.set(xlim=(-1.1, 5.8), ylim=(-1.65, 1.1))
    _blank(panel, "Figure 3: the modes, by the gap (eqs 8, 9; Table 1)")


def _crossing(panel: Axes) -> None:
    """Figure 4: gaps where the axes of journal and bearing meet."""
    tilt = 0.12
    corners = _corners(tilt)
    _bearing(panel, -1.8, 1.8, -1.05, 1.05)
    _journal(panel, corners)
    panel.plot([-2.0, 2.0], [0.0, 0.0], "k-.", lw=0.6)
    ends = np.array([-2.0, 2.0])
    panel.plot(ends, ends * math.tan(tilt), "-.", color=BLUE, lw=0.8)
    panel.plot(0.0, 0.0, "ko", ms=3.0)
    panel.text(-0.1, -0.14, "M", fontsize=8)
    panel.text(0.75, 0.045, "θ", fontsize=8)
    top, low = corners[0], corners[3]
    _measure(panel, top, (top[0], 1.05), "δ_r", (top[0] - 0.2, 0.97))
    _measure(panel, low, (1.8, low[1]), "δ_a", (1.7, low[1] - 0.15))
    middle = 0.5 * (top + low)
    panel.plot(*middle, "o", color=BLUE, ms=3.0)
    panel.text(middle[0] - 0.2, middle[1] + 0.1, "A_j", fontsize=8)
    _blank(panel, "Figure 4: axes meet in M at θ; d = M A_j (eqs 4, 5)")


def _parallel(panel: Axes) -> None:
    """Figure 5: gaps where the axes are parallel."""
    at = np.array([0.12, 0.16])
    corners = _corners(0.0, *at)
    _bearing(panel, -1.8, 1.8, -1.05, 1.05)
    _journal(panel, corners)
    panel.plot([-2.0, 2.0], [0.0, 0.0], "k-.", lw=0.6)
    panel.plot([-2.0, 2.0], [at[1]] * 2, "-.", color=BLUE, lw=0.8)
    panel.plot(0.0, 0.0, "ko", ms=3.0)
    panel.plot(*at, "o", color=BLUE, ms=3.0)
    panel.text(-0.18, -0.16, "N_i", fontsize=8)
    panel.text(at[0] + 0.06, at[1] + 0.06, "N_j", fontsize=8)
    panel.plot([0.0, at[0]], [0.0, at[1]], "k", lw=0.8)
    panel.plot([0.0, 0.0], [0.0, 0.35], "k:", lw=0.6)
    panel.text(0.02, 0.38, "α", fontsize=8)
    top = corners[0]
    _measure(panel, (0.9, top[1]), (0.9, 1.05), "δ_r", (0.72, 0.95))
    _measure(panel, (top[0], -0.2), (1.8, -0.2), "δ_a", (1.71, -0.33))
    _blank(panel, "Figure 5: axes parallel, N_i N_j at α from the radial direction (eqs 6, 7)")


def joint_drawings() -> StyledFigure:
    """Figures 1, 3, 4 and 5: sizes, modes, and gaps of axes that meet or are parallel."""
    with style():
        figure = new_figure(9.5, 5.6)
        axes = figure.subplots(2, 2)
        for panel, draw in zip(axes.flat, (_sizes, _modes, _crossing, _parallel), strict=True):
            draw(panel)
        footnote(
            figure,
            "Redrawn, clearances not to scale. In three dimensions the axes are skew in general; "
            "their gaps are those of the two rims against bore and end walls.",
        )
    return figure
