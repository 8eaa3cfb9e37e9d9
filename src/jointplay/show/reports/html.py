"""Pieces of HTML: templates that escape what they are given, numbers as an engineer writes them.

Names come from files of others. `Html` is text that is HTML already; the only ways to it are
`markup`, `joined` and the templates, which escape everything else.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup as Html
from markupsafe import escape

from jointplay.base.errors import JointplayError
from jointplay.base.files import check_new
from jointplay.base.tables import Column, Table
from jointplay.show.player.pages import as_script, policy, static

_MINUS = "\N{MINUS SIGN}"

WORST = 3  # rows of long tables, and points of long lists, that are not folded

Cell = str | float | int | None

Quantity = Cell | tuple[Cell, str] | tuple[Cell, str, bool]
"""A value; where it has one its SI unit, and whether it is as small as a clearance."""

Row = Mapping[str, Quantity]
"""Quantities by what they are called: a row of a table of cases, places or joints, or a column of a
table of figures."""


@cache
def _templates() -> Environment:
    made = Environment(
        loader=PackageLoader("jointplay.show.reports", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.filters["cell"] = text
    made.filters["anchor"] = lambda name: name.lower().replace(" ", "-")
    return made


def render(template: str, **values: object) -> Html:
    """A template of the folder `page`, filled in; text in `values` is escaped, `Html` is not."""
    return Html(_templates().get_template(template).render(**values))


def page(
    title: str,
    cases: object,
    made: Mapping[str, str],
    sections: Mapping[str, Html],
    open: int = 1,
    **more: Any,
) -> Html:
    """A report.

    Args:
        title: of the page.
        cases: the line below it.
        made: versions by program.
        sections: their contents by name.
        open: how many of them are not folded; of the others ``notes.toml`` says what is inside.
        more: what interactive charts need: their series, layout and scripts.
    """
    scripts = more.get("scripts", [])
    return render(
        "page.html",
        policy=policy(scripts),
        title=title,
        look=as_script(f"{own('report.css')}\n{static('chart.css')}"),
        cases=cases,
        made=", ".join(f"{name} {version}" for name, version in made.items()),
        sections=sections,
        inside={name: _notes()["inside"][name] for name in [*sections][open:]},
        **{"block": "", "data": "", "judged": "", "scripts": scripts} | more,
    )


def targets(path: str | Path, pdf: bool) -> list[Path]:
    """The files of a report, checked before any work is done: the page, and the PDF beside it."""
    path = Path(path)
    if path.suffix != ".html":
        raise JointplayError(f"the report is a page: {str(path)!r} must end in .html")
    return [check_new(one) for one in ([path, path.with_suffix(".pdf")] if pdf else [path])]


def markup(pattern: str, *values: object) -> Html:
    """`pattern`, which is HTML, with `values` as of `text` in the place of each ``{}``."""
    return Html(pattern).format(*map(text, values))


def own(name: str) -> str:
    """The text of a file of the folder `page`."""
    return (files("jointplay.show.reports") / "page" / name).read_text("utf-8")


@cache
def _notes() -> dict[str, Any]:
    return tomllib.loads(own("notes.toml"))


def note(name: str, *values: object) -> Html:
    """What the page says of something, from ``notes.toml``, with these values."""
    return markup(_notes()[name], *values)


def joined(parts: Iterable[Html], between: str = "") -> Html:
    """Parts of a page one after another; what is not `Html` is escaped."""
    return Html(between).join(parts)


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


def table(
    made: Table | Sequence[Row], caption: str = "", name: str = "", left: int | None = None
) -> Html:
    """A table; what is no number may be `Html`.

    Args:
        made: names, units and values of its columns; or rows, all of the same heads.
        caption: above it.
        name: by which style sheets and scripts know it.
        left: how many columns are flush left; None: those that come first and have no numbers.
    """
    columns = made.columns if isinstance(made, Table) else [_column(head, made) for head in made[0]]
    head, *rows = zip(*map(_shown, columns), strict=True)
    if left is None:
        left = [*(any(map(_is_number, one.values)) for one in columns), True].index(True)
    return render("table.html", head=head, rows=rows, caption=caption, left=left, name=name)


def by_case(
    head: str,
    cases: Sequence[Html],
    figures: Sequence[Row],
    caption: str = "",
    name: str = "",
    left: int = 1,
) -> Html:
    """A table with a column for each case and a row for each figure that any of them has."""
    longest = sorted(figures, key=len, reverse=True)  # gives the order
    columns = [
        _column(key, figures) for key in dict.fromkeys(key for one in longest for key in one)
    ]
    rows = [_shown(one) for one in columns if any(value is not None for value in one.values)]
    heads = [head, *cases]
    return render("table.html", head=heads, rows=rows, caption=caption, left=left, name=name)


def _column(head: str, rows: Sequence[Row]) -> Column:
    """The values of this name in all rows; None in those that have none."""
    cells = (row.get(head) for row in rows)
    known = [one if isinstance(one, tuple) else (one, "") for one in cells]
    _, unit, *fine = max(known, key=lambda one: (len(one), one[1]))  # of a row that has it
    return Column(head, [value for value, *_ in known], unit, fine=any(fine))


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _shown(column: Column) -> list[Any]:
    """What a column is called and its values, in the unit in which they are shown."""
    factor, _ = column.shown
    scaled = (factor * v if factor != 1.0 and _is_number(v) else v for v in column.values)
    return [column.title, *scaled]


def paragraph(content: str) -> Html:
    """A paragraph."""
    return markup("<p>{}</p>", content)


def bullets(items: Sequence[str]) -> Html:
    """A list of points; nothing for none."""
    if not items:
        return Html("")
    return markup("<ul>{}</ul>", joined(markup("<li>{}</li>", item) for item in items))


def details(summary: str, content: str) -> Html:
    """Something to unfold."""
    return markup("<details><summary>{}</summary>{}</details>", summary, content)


def worst_first(rows: Sequence[Row], by: str, what: str, name: str = "") -> Html:
    """A table of the `WORST` rows with the largest numbers `by` name, the others folded."""
    if len(rows) <= WORST + 1:
        return table(rows, name=name, left=1)
    sizes = [-math.inf if value is None else float(value) for value in _column(by, rows).values]
    ranked = [rows[k] for k in sorted(range(len(rows)), key=lambda k: -sizes[k])]
    others = details(f"The other {len(rows) - WORST} {what}", table(ranked[WORST:], left=1))
    return table(ranked[:WORST], name=name, left=1) + others


def folded(items: Sequence[str], what: str) -> Html:
    """A list of points, of which those after the first `WORST` are folded, if they are several."""
    if len(items) <= WORST + 1:
        return bullets(items)
    more = details(f"The other {len(items) - WORST} {what}", bullets(items[WORST:]))
    return bullets(items[:WORST]) + more
