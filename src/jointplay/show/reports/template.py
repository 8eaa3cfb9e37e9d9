"""Reports as HTML pages: one template for all of them, `page/page.html`."""

from __future__ import annotations

import base64
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined

from jointplay.base.tables import counted
from jointplay.show.player.pages import as_data, as_script, policy, static
from jointplay.show.plots.style import style
from jointplay.show.reports.charts import Charts, Times
from jointplay.show.reports.html import Html, text
from jointplay.show.reports.parts import Block, Drawing, Graph, Part, flat


def page(
    title: str,
    subject: str,
    versions: Mapping[str, str],
    blocks: Sequence[tuple[Block, Sequence[Part]]],
    times: Sequence[Times] = (),
    start: float = 0.0,
    end: float = 0.0,
) -> str:
    """A report's page; `subject` is the line below the title.

    Its graphs are of these `times`, and begin at `start` [s].
    """
    charts = Charts(times)
    graphs = [
        charts.described(part) for _, parts in blocks for part in flat(parts, unfold=True)
        if isinstance(part, Graph)
    ]  # fmt: skip
    data, scripts = Html(""), []
    if graphs:
        contents = {"charts": graphs, "layout": charts.pack.layout, "start": start, "end": end}
        data = as_data(json.dumps(contents, separators=(",", ":"), allow_nan=False))
        sources = (static("page.js"), static("chart.js"), _file("report.js"))
        scripts = [as_script("\n".join(sources))]
    return _environment().get_template("page.html").render(
        policy=policy(scripts),
        title=title,
        look=as_script(f"{_file('report.css')}\n{static('chart.css')}"),
        subject=subject,
        versions=", ".join(f"{name} {version}" for name, version in versions.items()),
        blocks=blocks,
        start=f"{start:g}" if start else "",
        series=charts.pack.block(),
        data=data,
        scripts=scripts,
    )  # fmt: skip


def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("jointplay.show.reports", "page"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters |= {
        "cell": text,
        "kind": lambda part: type(part).__name__,
        "anchor": lambda title: title.lower().replace(" ", "-"),
        "counted": counted,
        "unnamed": lambda grid: replace(grid, name="", caption=""),
        "spoken": _spoken,
        "source": _source,
    }
    return environment


def _file(name: str) -> str:
    return (files("jointplay.show.reports") / "page" / name).read_text("utf-8")


def _spoken(graph: Graph) -> str:
    """What a graph shows, for who cannot see it."""
    shown = dict.fromkeys(panel.title or panel.y.name for panel in graph.panels)
    names = dict.fromkeys(
        getattr(mark, "name", "") for panel in graph.panels for mark in panel.marks
    )
    of = ", ".join(filter(None, names))
    return f"{graph.title}: {', '.join(shown)}{f' of {of}' if of else ''}"


def _source(drawing: Drawing) -> str:
    """The address of a drawing that is in the page itself."""
    content, kind = io.BytesIO(), drawing.kind
    with style("screen"):
        more: dict[str, Any] = {"metadata": {"Date": None}}  # the same run, the same page
        if kind == "png":
            more = {"dpi": 150, "bbox_inches": "tight", "pad_inches": 0.05}
        drawing.figure.savefig(content, format=kind, **more)
    mime = "svg+xml" if kind == "svg" else kind
    return f"data:image/{mime};base64,{base64.b64encode(content.getvalue()).decode()}"
