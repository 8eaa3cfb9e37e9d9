"""What an object shows of itself: a few lines at a prompt, a table in a notebook."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Iterable

_MOST_NAMES = 8
"""Names that a list of them shows."""


class Overview(ABC):
    """An object that can be told in a headline and a few facts."""

    @abstractmethod
    def facts(self) -> tuple[str, dict[str, str]]:
        """Headline, and what there is to know by its name."""

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
    """A table of two columns that needs nothing from elsewhere."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(text)}</td></tr>"
        for name, text in facts
    )
    return f"<table>{rows}</table>"


def few(names: list[str], most: int = _MOST_NAMES) -> str:
    """Names in a row, the last of many left out."""
    text = ", ".join(names[:most])
    return f"{text} and {len(names) - most} more" if len(names) > most else text
