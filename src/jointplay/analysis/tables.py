"""Answers as tables: columns to read, comma-separated values, Markdown."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Sequence
from typing import Any


def columns(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of rows of cells, the first column flush left, the others flush right."""
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
