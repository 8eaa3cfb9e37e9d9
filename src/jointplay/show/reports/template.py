"""Reports as HTML pages, by the template `page/page.html`."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping, Sequence
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined

from jointplay.show.player.pages import as_data, as_script, policy, static
from jointplay.show.plots.draw import draw
from jointplay.show.reports.charts import Charts, Times
from jointplay.show.reports.html import Html, text
from jointplay.show.reports.parts import Block, Drawing, Graph, Part, flat

_PAGE = files("jointplay.show.reports") / "page"


def page(
    title: str,
    subject: str,
    versions: Mapping[str, str],
    blocks: Sequence[tuple[Block, Sequence[Part]]],
    times: Sequence[Times] = (),
    start: float = 0.0,
    end: float = 0.0,
) -> str:
    """A report's page; `subject` is the line below its title.

    Graphs over time have the cases' `times`, and open with the view from `start` to `end` [s].
    """
    charts = Charts(times)
    graphs = [
        charts.described(part) for _, parts in blocks for part in flat(parts, unfold=True)
        if isinstance(part, Graph)
    ]  # fmt: skip
    data, scripts = Html(""), []
    if graphs:
        contents = {"charts": graphs, "start": start, "end": end}
        data = as_data(json.dumps(contents, separators=(",", ":"), allow_nan=False))
        sources = (*map(static, ("page.js", "tracks.js", "chart.js")), static("report.js", _PAGE))
        scripts = [as_script("\n".join(sources))]
    environment = Environment(
        loader=PackageLoader("jointplay.show.reports", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {"cell": text, "source": _source}
    return environment.get_template("page.html").render(
        policy=policy(scripts),
        title=title,
        look=as_script(f"{static('report.css', _PAGE)}\n{static('chart.css')}"),
        subject=subject,
        versions=", ".join(f"{name} {version}" for name, version in versions.items()),
        blocks=blocks,
        start=f"{start:g}" if start else "",
        series=charts.block,
        data=data,
        scripts=scripts,
    )


_DARK = {"#000000": "#000, #e2e6ea", "#e6e6e6": "#e6e6e6, #2d343b"}
"""Colours of a figure's ink and grid, each with its pair on light and dark pages (`report.css`)."""


def _source(drawing: Drawing) -> str:
    """A drawing as a data URL."""
    if isinstance(drawing.content, bytes):
        return f"data:image/png;base64,{base64.b64encode(drawing.content).decode()}"
    drawn = io.BytesIO()
    # Without a date, the same run gives the same page.
    draw(drawing.content).savefig(drawn, format="svg", metadata={"Date": None}, transparent=True)
    svg = drawn.getvalue().decode()
    for light, both in _DARK.items():
        svg = svg.replace(light, f"light-dark({both})")
    ink = "<style>:root { color-scheme: light dark; fill: light-dark(#000, #e2e6ea); }</style>"
    svg = svg.replace("<defs>", f"{ink}<defs>", 1)
    return f"data:image/svg+xml;base64,{base64.b64encode(svg.encode()).decode()}"
