"""Text of a page: markup that escapes its values, numbers with three digits.

Labels and names come from files of unknown origin, so nothing is put into a page unescaped. `Html`
is text that is HTML already; `markup`, `Html.join` and the template escape everything else.
"""

from __future__ import annotations

import math
from typing import TypeGuard

from markupsafe import Markup as Html
from markupsafe import escape

from jointplay.simulation.result.certificate import alone


def markup(pattern: str, *values: object) -> Html:
    """The HTML `pattern` with each ``{}`` replaced by a value, formatted and escaped by `text`."""
    return Html(pattern).format(*map(text, values))


def paragraph(content: str) -> Html:
    """A paragraph."""
    return markup("<p>{}</p>", content)


def text(value: object) -> Html:
    """A value as HTML: text escaped, numbers rounded as in sentences, a missing value as a dash."""
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return Html("&ndash;")
    if is_number(value):
        shown = str(value) if isinstance(value, int) else alone(value)
        return escape(shown.replace("-", "\N{MINUS SIGN}"))
    return escape(value)


def is_number(value: object) -> TypeGuard[int | float]:
    """Whether a value is a number, which a bool is not."""
    return isinstance(value, int | float) and not isinstance(value, bool)
