"""One colour for each case, wherever it is drawn: figures, report, player."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from jointplay.simulation.analysis.twins import has_play
from jointplay.simulation.result.result import Result

COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#009E73", "#E69F00", "#56B4E9")
"""For cases. The paper's red (ideal), blue (0.2 mm) and magenta (0.5 mm), and further ones, in the
shades of Okabe and Ito's colour-blind safe palette (Color Universal Design, 2008)."""

GREY, LINE = "#e0e0e0", "#808080"
"""Of what is not judged, and of lines that are no data."""

_MANY = (
    *("#1f77b4", "#aec7e8", "#ff7f0e", "#ffbb78", "#2ca02c", "#98df8a", "#d62728", "#ff9896"),
    *("#9467bd", "#c5b0d5", "#8c564b", "#c49c94", "#e377c2", "#f7b6d2", "#7f7f7f", "#c7c7c7"),
    *("#bcbd22", "#dbdb8d", "#17becf", "#9edae5"),
)
"""Where six are too few: Tableau's twenty."""

AXIS_COLOURS = {"x": COLOURS[1], "y": COLOURS[0], "z": COLOURS[3], "total": "black"}
"""For components along axes."""

CONTACT_COLOURS = (
    *(COLOURS[1], COLOURS[5], COLOURS[0], COLOURS[4], COLOURS[3], COLOURS[2]),
    "#808080",
)
"""For the contacts of a joint, and its coordinates."""
_DASHES = ("-", "--", ":")  # tell contacts apart that share a colour: a slider has up to sixteen

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


def contact_look(index: int) -> dict[str, Any]:
    """Colour and dashes of a joint's contact."""
    round_, at = divmod(index, len(CONTACT_COLOURS))
    return {"colour": CONTACT_COLOURS[at], "line": _DASHES[round_ % len(_DASHES)]}


def many(number: int) -> list[str]:
    """So many colours; beyond twenty they repeat."""
    palette = COLOURS if number <= len(COLOURS) else _MANY
    return [palette[k % len(palette)] for k in range(number)]
