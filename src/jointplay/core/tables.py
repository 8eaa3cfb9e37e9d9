"""Tables as text (aligned columns, CSV, Markdown, HTML), and what objects show of themselves."""

from __future__ import annotations

import csv
import html
import io
from abc import ABC, abstractmethod
from collections.abc import Iterable, Sequence
from typing import Any

_MOST_NAMES = 8
"""Names that a list of them shows."""


class Overview(ABC):
    """An object that shows a headline and a few facts: lines at a prompt, a table in a notebook."""

    @abstractmethod
    def facts(self) -> tuple[str, dict[str, str]]:
        """Headline, and facts by name."""

    def __repr__(self) -> str:
        """The headline and the facts, a line each."""
        headline, facts = self.facts()
        lines = [f"<jointplay {type(self).__name__}: {headline}>"]
        return "\n".join([*lines, *(f"  {name:<16} {text}" for name, text in facts.items())])

    def _repr_html_(self) -> str:
        """The same for notebooks."""
        headline, facts = self.facts()
        kind = type(self).__name__.lower()
        table = html_table(facts.items())
        return f"<div><p><b>jointplay {kind}</b>: {html.escape(headline)}</p>{table}</div>"


def html_table(facts: Iterable[tuple[str, str]]) -> str:
    """A table of two columns that needs no style sheet or script."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(text)}</td></tr>"
        for name, text in facts
    )
    return f"<table>{rows}</table>"


def few(names: list[str], most: int = _MOST_NAMES) -> str:
    """The first names of a list, and how many more there are."""
    text = ", ".join(names[:most])
    return f"{text} and {len(names) - most} more" if len(names) > most else text


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table of text cells, the first column flush left, the others flush right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            f"{cell:<{width}}" if place == 0 else f"{cell:>{width}}"
            for place, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        for row in rows
    ]


def csv_text(rows: Iterable[Iterable[Any]], digits: int) -> str:
    """Rows as comma-separated values, numbers that are not whole with so many digits."""
    text = io.StringIO(newline="")
    csv.writer(text, lineterminator="\n").writerows(
        [f"{cell:.{digits}g}" if isinstance(cell, float) else cell for cell in row] for row in rows
    )
    return text.getvalue()


def markdown(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table in Markdown, whose first row is its head."""
    lines = ["| " + " | ".join(cell.replace("|", "\\|") for cell in row) + " |" for row in rows]
    return [lines[0], "|" + " --- |" * len(rows[0]), *lines[1:]]
