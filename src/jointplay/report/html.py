"""Pieces of HTML: escaped text, numbers as an engineer writes them, tables."""

from __future__ import annotations

import html
import math
from collections.abc import Sequence

_MINUS = "\N{MINUS SIGN}"


class Html(str):
    """Text that is HTML already; any other text is escaped."""


Cell = str | float | int | None


def text(value: Cell) -> str:
    """A cell's HTML: text escaped, numbers by `number`, None as a dash."""
    if isinstance(value, Html):
        return str(value)
    if value is None:
        return "&ndash;"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, (int, float)):
        return number(value)
    return html.escape(str(value))


def number(value: float, digits: int = 3) -> str:
    """`value` with `digits` significant digits; powers of ten only where zeros would mislead."""
    if isinstance(value, int):
        return str(value).replace("-", _MINUS)
    if math.isnan(value):
        return "&ndash;"
    if math.isinf(value):
        return "&infin;" if value > 0 else _MINUS + "&infin;"
    if value == 0.0:
        return "0"
    rounded = float(f"{value:.{digits - 1}e}")
    exponent = math.floor(math.log10(abs(rounded)))
    if -4 <= exponent < 6:
        shown = f"{rounded:.{max(0, digits - 1 - exponent)}f}"
        return shown.replace("-", _MINUS)
    mantissa = f"{rounded / 10.0**exponent:.{digits - 1}f}".replace("-", _MINUS)
    return f"{mantissa}&middot;10<sup>{str(exponent).replace('-', _MINUS)}</sup>"


def table(
    head: Sequence[Cell],
    rows: Sequence[Sequence[Cell]],
    caption: str = "",
    left: int = 1,
    name: str = "",
) -> Html:
    """A table whose first `left` columns are text, the others numbers."""
    parts = [f'<div class="scroll"><table{f" id={name!r}" if name else ""}>']
    if caption:
        parts.append(f"<caption>{text(caption)}</caption>")
    parts.append("<thead><tr>")
    parts += [f'<th scope="col"{_class(i, left)}>{text(cell)}</th>' for i, cell in enumerate(head)]
    parts.append("</tr></thead><tbody>")
    for row in rows:
        parts.append("<tr>")
        for i, cell in enumerate(row):
            tag = 'th scope="row"' if i == 0 else "td"
            parts.append(f"<{tag}{_class(i, left)}>{text(cell)}</{tag.split()[0]}>")
        parts.append("</tr>")
    parts.append("</tbody></table></div>")
    return Html("".join(parts))


def _class(column: int, left: int) -> str:
    return "" if column < left else ' class="n"'


def paragraph(content: str) -> Html:
    """A paragraph."""
    return Html(f"<p>{text(content)}</p>")


def bullets(items: Sequence[str]) -> Html:
    """A list of points; nothing for none."""
    if not items:
        return Html("")
    return Html("<ul>" + "".join(f"<li>{text(item)}</li>" for item in items) + "</ul>")


def details(summary: str, content: str) -> Html:
    """Something to unfold."""
    return Html(f"<details><summary>{text(summary)}</summary>{content}</details>")
