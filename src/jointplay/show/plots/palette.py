"""The palette: one colour for each case, axis, contact and mode in figures, report and player."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import cycle
from typing import Any

from jointplay.simulation.analysis.twins import has_play
from jointplay.simulation.result.result import Result

COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#E69F00", "#009E73", "#56B4E9")
"""Colours of cases: the paper's red (ideal), blue (0.2 mm) and magenta (0.5 mm), and others, in
shades of Okabe and Ito's colour-blind safe palette (Color Universal Design, 2008), in the order in
which neighbours differ most."""
VERMILION, BLUE, PINK, ORANGE, GREEN, SKY = COLOURS

GREY, LINE = "#e0e0e0", "#808080"
"""Colours of time that is not judged, and of lines that are not data."""

AXIS_COLOURS = {"x": BLUE, "y": VERMILION, "z": GREEN, "total": "black"}
"""Colours of a vector's components and of its norm."""

CONTACT_COLOURS = (BLUE, GREEN, SKY, VERMILION, PINK, ORANGE, LINE)
"""Colours of a joint's contacts, of coordinates and of energy terms: neighbours differ most."""
_DASHES = ("-", "--", ":")  # tell apart curves of one colour: a slider has up to sixteen contacts

MODE_COLOURS = ("#B4BDC5", "#5AA5D0", "#34709F")
"""Colours of a journal's modes, `names.MODES`: the closer the contact, the deeper the blue."""

Cases = Mapping[str, Result]
"""Results by label, in drawing order; the first one without clearance is the reference."""


def reference(cases: Cases) -> Result | None:
    """The ideal mechanism among the cases, if there is one."""
    return next((result for result in cases.values() if not has_play(result)), None)


def colours(cases: Cases) -> list[str]:
    """The colour of each case. Red is kept for the ideal mechanism, whichever place it has."""
    ideal, others = reference(cases), cycle(COLOURS[1:])
    return [COLOURS[0] if result is ideal else next(others) for result in cases.values()]


def look_of(index: int) -> dict[str, Any]:
    """Colour and dashes of the curve at this index of many: dashes change once colours repeat."""
    cycles, at = divmod(index, len(CONTACT_COLOURS))
    return {"colour": CONTACT_COLOURS[at], "line": _DASHES[cycles % len(_DASHES)]}


def many(number: int) -> list[str]:
    """As many colours as asked for: beyond six, shades of viridis, light beside dark."""
    if number <= len(COLOURS):
        return list(COLOURS[:number])
    import numpy as np
    from matplotlib import colormaps  # pages need none of it
    from matplotlib.colors import to_hex

    shades = [to_hex(colour) for colour in colormaps["viridis"](np.linspace(0.0, 0.9, number))]
    half = (number + 1) // 2
    return [shades[k // 2 + k % 2 * half] for k in range(number)]
