"""Tables as text (aligned columns, CSV, Markdown, HTML), and the display of objects."""

from __future__ import annotations

import csv
import html
import io
import math
import re
import textwrap
from abc import ABC, abstractmethod
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, Self

from jointplay.base.units import displayed

if TYPE_CHECKING:
    import numpy as np

_MOST_NAMES = 8
"""Most names that a list shows before it says how many more there are."""


class Overview(ABC):
    """An object shown by a headline and facts: lines at a prompt, a table in a notebook."""

    @abstractmethod
    def facts(self) -> tuple[str, dict[str, str]]:
        """Headline, and the facts by name."""

    def __repr__(self) -> str:
        headline, facts = self.facts()
        return "\n".join([f"<jointplay {type(self).__name__}: {headline}>", *fact_lines(facts)])

    def _repr_html_(self) -> str:
        headline, facts = self.facts()
        kind = type(self).__name__.lower()
        table = html_table(facts.items())
        return f"<div><p><b>jointplay {kind}</b>: {html.escape(headline)}</p>{table}</div>"


def fact_lines(facts: Mapping[str, str]) -> list[str]:
    """Format facts, a line each, the name in front."""
    return [f"  {name:<16} {text}" for name, text in facts.items()]


def wrapped(text: str) -> str:
    """Wrap a paragraph below a heading."""
    return textwrap.fill(
        text, 100, initial_indent="    ", subsequent_indent="      ", break_on_hyphens=False
    )


def aligned(rows: Sequence[Sequence[str]], others: str = "<") -> list[str]:
    """Align rows in columns: the first flush left, the others flush left (or right)."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    forms = [f"{'<' if place == 0 else others}{width}" for place, width in enumerate(widths)]
    lines = [zip(line, forms, strict=True) for line in rows]
    return ["  ".join(format(cell, form) for cell, form in line).rstrip() for line in lines]


def html_table(facts: Iterable[tuple[str, str]]) -> str:
    """HTML table of two columns, without style sheet or script."""
    rows = "".join(
        f"<tr><th style='text-align:left'>{html.escape(name)}</th>"
        f"<td style='text-align:left'>{html.escape(text)}</td></tr>"
        for name, text in facts
    )
    return f"<table>{rows}</table>"


def counted(number: float | str, noun: str, plural: str = "") -> str:
    """Format a number and what it counts: ``1 block``, ``3 blocks``; the plural adds an s."""
    return f"{number} {noun if str(number) == '1' else plural or f'{noun}s'}"


def few(names: list[str], most: int = _MOST_NAMES) -> str:
    """List the first names, and say how many more there are."""
    text = ", ".join(names[:most])
    return f"{text} and {len(names) - most} more" if len(names) > most else text


def for_json(value: Any) -> Any:
    """Convert tables, arrays and named tuples to plain data; floats that are not finite to null."""
    if isinstance(value, Table):
        value = value.records()
    elif hasattr(value, "_asdict"):
        value = value._asdict()
    elif hasattr(value, "tolist"):  # numpy's
        value = value.tolist()
    if isinstance(value, Mapping):
        return {str(key): for_json(entry) for key, entry in value.items()}
    if isinstance(value, list | tuple | range):
        return [for_json(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value if isinstance(value, int | str | None) else str(value)


@dataclass(frozen=True)
class Column:
    """A column of a `Table`: heading, values and unit."""

    head: str
    """Heading."""
    values: Sequence[Any] | np.ndarray
    """Numbers in SI, or text; None, and a number that is not finite, where there is no value."""
    unit: str = ""
    """SI unit of the numbers; ``"1"`` for fractions, which are shown in per cent."""
    key: str = ""
    """Name in data; by default the heading with the unit."""
    fine: bool = False
    """Whether lengths are clearances, which are shown in µm."""
    digits: int = 5
    """Digits of the largest number in text; the others have as many decimals."""
    only: str = ""
    """``"text"`` or ``"data"`` if the column appears in one of them only."""
    errors: Sequence[Any] | np.ndarray = ()
    """Errors of the values, if known, shown behind ``+-`` in text."""

    @property
    def shown(self) -> tuple[float, str]:
        """Factor from SI to the unit shown, and this unit."""
        return (100.0, "%") if self.unit == "1" else displayed(self.unit, self.fine)

    @property
    def title(self) -> str:
        """Heading with the unit shown."""
        unit = self.shown[1]
        return f"{self.head} [{unit}]" if unit else self.head

    @property
    def name(self) -> str:
        """Name of the column in data."""
        unit = re.sub(r"\W+", "_", self.unit.removesuffix("1")).strip("_")
        plain = re.sub(r"\W+", "_", self.head).strip("_").lower()
        return self.key or "_".join(filter(None, (plain, unit)))

    def texts(self, further: Sequence[Any] = ()) -> list[str]:
        """Format the values, and those of further rows, with common decimals."""
        values = [*self.values, *further]
        factor, _ = self.shown
        sizes = [abs(factor * value) for value in values if _is_number(value) and value]
        integral = all(isinstance(value, Integral) for value in values if _is_number(value))
        top = math.floor(math.log10(max(sizes))) if sizes else 0
        places = self.digits - 1 - top
        form = f".{max(places, 0)}f" if -_ZEROS <= places <= _PLACES else f".{self.digits}g"
        if integral and factor == 1.0:
            form = "d"
        elif not sizes:
            form = ".0f"
        # Only zeros and rounding errors may be shown as zero.
        least = 0.5 * 10.0 ** -max(places, 0)
        noise = _NOISE * max(sizes, default=0.0)

        def text(value: Any) -> str:
            if value is None:
                return ""
            if not _is_number(value):
                return "-" if isinstance(value, float) else str(value)
            number = value if form == "d" else factor * value
            return f"{number:.1g}" if noise < abs(number) < least else format(number, form)

        shown = [text(value) for value in values]
        for k, error in enumerate(self.errors):
            if _is_number(error):
                shown[k] += f" +- {text(error)}"
        return shown


_NOISE = 1e-9
"""Magnitude, relative to the largest number, below which one is shown as zero: rounding of sums of
a thousand terms is 1e-13."""

_PLACES, _ZEROS = 9, 3
"""Most decimals, and most digits beyond those asked for; numbers that need more get an exponent."""


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


Head = tuple[str, str] | tuple[str, str, bool]
"""Heading and unit of a column, and whether its lengths are clearances."""


class Answer(ABC):
    """An object shown by a sentence at a prompt; notebooks and `print` add its table."""

    @property
    @abstractmethod
    def sentence(self) -> str:
        """The answer in a sentence."""

    @abstractmethod
    def table(self) -> Table:
        """The numbers behind it."""

    def __repr__(self) -> str:
        return f"<jointplay {type(self).__name__}: {self.sentence}>"

    def __str__(self) -> str:
        return f"{self.sentence}\n{self.table()}"

    def _repr_html_(self) -> str:
        return f"<div><p>{html.escape(self.sentence)}</p>{self.table()._repr_html_()}</div>"


@dataclass(frozen=True)
class Table:
    """Columns with headings and units: shown as text, Markdown or HTML, and written as data.

    Text is in handy units; data (CSV, records) are SI, in full precision or rounded.
    """

    columns: Sequence[Column]
    totals: Sequence[Sequence[Any]] = ()
    """Further rows in text, such as sums: a value for each column shown."""
    notes: Sequence[str] = ()
    """Lines shown below the table."""

    @classmethod
    def of(cls, heads: Sequence[Head], rows: Sequence[Sequence[Any]]) -> Self:
        """Make a table from the heads of its columns and its rows."""
        values = list(zip(*rows, strict=True)) or [() for _ in heads]
        pairs = zip(heads, values, strict=True)
        return cls([Column(head, x, unit, fine=any(fine)) for (head, unit, *fine), x in pairs])

    @classmethod
    def of_texts(cls, rows: Sequence[Sequence[str]]) -> Self:
        """Make a table of text from its rows, the first of which has the headings."""
        head, *others = rows
        return cls.of([(text, "") for text in head], others)

    def _shown(self) -> tuple[list[str], list[list[str]]]:
        """Headings and rows of the table as text."""
        shown = [column for column in self.columns if column.only != "data"]
        columns = [column.texts([row[k] for row in self.totals]) for k, column in enumerate(shown)]
        return [column.title for column in shown], [list(row) for row in zip(*columns, strict=True)]

    def __str__(self) -> str:
        head, rows = self._shown()
        return "\n".join([*aligned([head, *rows], ">"), *self.notes])

    def markdown(self) -> str:
        head, rows = self._shown()
        lines = [" | ".join(cell.replace("|", "\\|") for cell in row) for row in (head, *rows)]
        first, *others = [f"| {line} |" for line in lines]
        return "\n".join([first, "|" + " --- |" * len(head), *others])

    def _repr_html_(self) -> str:
        head, rows = self._shown()

        def line(cells: Sequence[str], tag: str) -> str:
            inner = "".join(f"<{tag}>{html.escape(cell)}</{tag}>" for cell in cells)
            return f"<tr>{inner}</tr>"

        notes = "".join(f"<p>{html.escape(note)}</p>" for note in self.notes)
        body = "".join(line(row, "td") for row in rows)
        return f"<table>{line(head, 'th')}{body}</table>{notes}"

    def _data(self) -> dict[str, Sequence[Any] | np.ndarray]:
        """Values by the columns' names in data, each followed by its errors, if any."""
        shown = [column for column in self.columns if column.only != "text"]
        data: dict[str, Sequence[Any] | np.ndarray] = {}
        for column in shown:
            data[column.name] = column.values
            if len(column.errors):
                data[f"{column.name}_error"] = column.errors
        return data

    def records(self) -> list[dict[str, Any]]:
        """Rows as dictionaries by the columns' names in data, in SI units."""
        data = self._data()
        return [dict(zip(data, row, strict=True)) for row in zip(*data.values(), strict=True)]

    def csv(self, digits: int | None = 9) -> str:
        """Write the table as CSV in SI units, numbers with so many digits.

        None writes all digits, so that numbers read back exactly.
        """
        data, text = self._data(), io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(data)
        rows = zip(*data.values(), strict=True)
        writer.writerows([_cell(value, digits) for value in row] for row in rows)
        return text.getvalue()


def _cell(value: Any, digits: int | None) -> Any:
    if not isinstance(value, float):
        return value
    if math.isnan(value):
        return ""
    return repr(float(value)) if digits is None else f"{value:.{digits}g}"
