"""Checks of the texts of a figure."""

import re
from itertools import combinations
from unittest.mock import patch

from matplotlib.figure import Figure
from matplotlib.text import Text

TOUCHING_PX = 1.5  # by which boxes of texts may overlap: the room of letters that hang below lines
PLAIN = re.compile(
    r"pose|turns?( after settling)?|turn|runs|loaded elements|order \(.*|found / scenario|"
    r"relative distance .*|\w+ - without unit|.*friction|impacts|tolerance|turns of .*"
)
"""Labels of quantities without a unit."""


def faults(figure: Figure) -> list[str]:
    """Texts that overlap or leave the figure, and axes of numbers without a unit."""
    drawn: list[tuple[str, object]] = []
    draw = Text.draw

    def record(self, renderer):
        if self.get_visible() and self.get_text().strip() and self.get_rotation() % 90.0 == 0.0:
            drawn.append((self.get_text(), Text.get_window_extent(self, renderer)))
        draw(self, renderer)

    figure.draw_without_rendering()  # lays it out
    with patch.object(Text, "draw", record):
        figure.draw_without_rendering()
    found = []
    for (text, box), (other_text, other) in combinations(drawn, 2):
        across = min(box.x1, other.x1) - max(box.x0, other.x0)
        up = min(box.y1, other.y1) - max(box.y0, other.y0)
        if min(across, up) > TOUCHING_PX:
            found.append(f"{text!r} covers {other_text!r}")
    for text, box in drawn:
        if min(box.x0, box.y0) < -1.0 or box.x1 > figure.bbox.x1 + 1 or box.y1 > figure.bbox.y1 + 1:
            found.append(f"{text!r} leaves the figure")
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            label = axis.label.get_text()
            if label and "[" not in label and not PLAIN.fullmatch(label):
                found.append(f"{label!r} has no unit")
    return found
