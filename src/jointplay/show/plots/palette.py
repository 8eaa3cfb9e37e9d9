"""One colour for each case, wherever it is drawn: figures, report, player."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jointplay.simulation.analysis.twins import has_play
from jointplay.simulation.result.result import Result

COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#E69F00", "#009E73", "#56B4E9")
"""For cases. The paper's red (ideal), blue (0.2 mm) and magenta (0.5 mm), and further ones, in the
shades of Okabe and Ito's colour-blind safe palette (Color Universal Design, 2008), in the order in
which neighbours differ most."""
VERMILION, BLUE, PINK, ORANGE, GREEN, SKY = COLOURS

GREY, LINE = "#e0e0e0", "#808080"
"""Of what is not judged, and of lines that are no data."""

AXIS_COLOURS = {"x": BLUE, "y": VERMILION, "z": GREEN, "total": "black"}
"""For components along axes."""

CONTACT_COLOURS = (BLUE, GREEN, SKY, VERMILION, PINK, ORANGE, LINE)
"""For the contacts of a joint, its coordinates, and terms of the energy: neighbours differ most."""
_DASHES = ("-", "--", ":")  # tell curves apart that share a colour: a slider has up to sixteen

MODE_COLOURS = ("#B4BDC5", "#5AA5D0", "#34709F")
"""For the modes of a journal, `names.MODES`: the closer the contact, the deeper the blue."""

Cases = Mapping[str, Result]
"""Results by label, in drawing order; the first one without clearance is the reference."""


def reference(cases: Cases) -> Result | None:
    """The ideal mechanism among the cases, if there is one."""
    return next((result for result in cases.values() if not has_play(result)), None)


def colours(cases: Cases) -> list[str]:
    """The colour of each case, wherever it is drawn: figures, report, player."""
    ideal, used, chosen = reference(cases), 0, []
    for result in cases.values():
        if result is ideal:  # red means ideal, wherever it stands; without one red stays free
            chosen.append(COLOURS[0])
            continue
        used += 1
        chosen.append(COLOURS[1 + (used - 1) % (len(COLOURS) - 1)])
    return chosen


def look_of(index: int) -> dict[str, Any]:
    """Colour and dashes of one of many curves."""
    round_, at = divmod(index, len(CONTACT_COLOURS))
    return {"colour": CONTACT_COLOURS[at], "line": _DASHES[round_ % len(_DASHES)]}


def many(number: int) -> list[str]:
    """So many colours: beyond six, shades of viridis, each light one beside a dark one."""
    if number <= len(COLOURS):
        return list(COLOURS[:number])
    import numpy as np
    from matplotlib import colormaps  # pages need none of it
    from matplotlib.colors import to_hex

    shades = [to_hex(colour) for colour in colormaps["viridis"](np.linspace(0.0, 0.9, number))]
    half = (number + 1) // 2
    return [shades[k // 2 + k % 2 * half] for k in range(number)]
