"""One colour for each case, wherever it is drawn: figures, report, player."""

from __future__ import annotations

from collections.abc import Mapping

from jointplay.analysis.twins import has_play
from jointplay.result.result import Result

COLOURS = ("#D55E00", "#0072B2", "#CC79A7", "#009E73", "#E69F00", "#56B4E9")
"""For cases. The paper's red (ideal), blue (0.2 mm) and magenta (0.5 mm), and further ones, in the
shades of Okabe and Ito's colour-blind safe palette (Color Universal Design, 2008)."""

AXIS_COLOURS = {"x": COLOURS[1], "y": COLOURS[0], "z": COLOURS[3], "total": "black"}
"""For components along axes."""

MODE_COLOURS = ("#56B4E9", "#E69F00", "#D55E00")
"""Free flight, continuous contact, pseudo-penetration."""

Cases = Mapping[str, Result]
"""Results by label, in drawing order; the first one without clearance is the reference."""


def reference(cases: Cases) -> Result | None:
    """The ideal mechanism among the cases, if there is one."""
    return next((result for result in cases.values() if not has_play(result)), None)


def colours(cases: Cases) -> list[str]:
    """The colour of each case, wherever it is drawn: figures, report, player."""
    # Without an ideal case the first colour stays free: red means ideal.
    shift = 0 if reference(cases) is not None else 1
    return [COLOURS[(index + shift) % len(COLOURS)] for index in range(len(cases))]
