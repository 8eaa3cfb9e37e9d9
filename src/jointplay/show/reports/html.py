"""Text of a page: markup that escapes its values, numbers as an engineer writes them.

Names come from files of others. `Html` is text that is HTML already; the only ways to it are
`markup`, `joined` and the template, which escape everything else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from markupsafe import Markup as Html
from markupsafe import escape

_MINUS = "\N{MINUS SIGN}"


def markup(pattern: str, *values: object) -> Html:
    """`pattern`, which is HTML, with `values` as of `text` in the place of each ``{}``."""
    return Html(pattern).format(*map(text, values))


def joined(texts: Iterable[str], between: str = "") -> Html:
    """Texts one after another; what is not `Html` is escaped."""
    return Html(between).join(texts)


def paragraph(content: str) -> Html:
    """A paragraph."""
    return markup("<p>{}</p>", content)


def text(value: object) -> Html:
    """A cell's HTML: text escaped, numbers by `number`, None as a dash."""
    if value is None:
        return Html("&ndash;")
    if isinstance(value, bool):
        return Html("yes") if value else Html("no")
    if isinstance(value, (int, float)):
        return number(value)
    return escape(value)


def number(value: float, digits: int = 3) -> Html:
    """`value` with `digits` significant digits; powers of ten only where zeros would mislead."""
    if isinstance(value, int):
        return escape(str(value).replace("-", _MINUS))
    if math.isnan(value):
        return Html("&ndash;")
    if math.isinf(value):
        return Html("&infin;") if value > 0 else Html(_MINUS + "&infin;")
    if value == 0.0:
        return Html("0")
    rounded = float(f"{value:.{digits - 1}e}")
    exponent = math.floor(math.log10(abs(rounded)))
    if -4 <= exponent < 6:
        shown = f"{rounded:.{max(0, digits - 1 - exponent)}f}"
        return escape(shown.replace("-", _MINUS))
    mantissa = f"{rounded / 10.0**exponent:.{digits - 1}f}".replace("-", _MINUS)
    return Html("{}&middot;10<sup>{}</sup>").format(mantissa, str(exponent).replace("-", _MINUS))
