"""Text of a page: markup that escapes its values, numbers with three digits.

Names come from files of others. `Html` is text that is HTML already; the only ways to it are
`markup`, `joined` and the template, which escape everything else.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from markupsafe import Markup as Html
from markupsafe import escape

from jointplay.simulation.result.certificate import alone


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
    """A cell's HTML: text escaped, numbers as sentences have them, nothing as a dash."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return Html("&ndash;")
    if isinstance(value, int | float) and not isinstance(value, bool):
        shown = str(value) if isinstance(value, int) else alone(value)
        return escape(shown.replace("-", "\N{MINUS SIGN}"))
    return escape(value)
