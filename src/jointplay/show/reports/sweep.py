"""The report of a sweep: one HTML page without scripts or network, and a PDF of its figures."""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.backends.backend_pdf import PdfPages
from matplotlib.figure import Figure

from jointplay.base.errors import JointplayError
from jointplay.base.files import write as write_file
from jointplay.base.tables import Table, counted
from jointplay.show.plots import sweep as draw
from jointplay.show.plots.style import style
from jointplay.show.reports import html
from jointplay.show.reports.cases import Say
from jointplay.show.reports.html import Cell, Html, by_case, joined, markup, paragraph, table
from jointplay.simulation.analysis.uncertainty import IntervalEstimate
from jointplay.study import open_sweep, sweep_table
from jointplay.study.outcome import DONE, FAILED, NOT_RUN
from jointplay.study.sweep_plan import SAMPLE

ROWS, MOST_FIRST = 20, 2  # points of the grid, and figures, that are not folded
MOST_ROWS = 400  # points of the grid, and failed cases, that the tables show

PRECISION = 0.05  # relative half width of a confidence interval that the page calls enough

Drawn = tuple[str, Figure]  # title and figure


def write(
    store: str | Path,
    path: str | Path,
    *,
    title: str | None = None,
    pdf: bool = True,
    say: Say = lambda _: None,
) -> list[Path]:
    """Write a report on a sweep; returns the files written. Existing ones are refused."""
    store = Path(store)
    dataset = open_sweep(store).dataset()
    if not (dataset["status"].values != NOT_RUN).any():
        raise JointplayError(f"no case of the sweep {str(store)!r} was run yet")
    written = html.targets(path, pdf)
    say("drawing the figures")
    lines, maps, samples = list(_lines(dataset)), list(_maps(dataset)), list(_samples(dataset))
    say("writing the page")
    note = "Means; the bands are 95 % confidence intervals of the mean over the runs of a point."
    drawn = [*lines, *samples][:MOST_FIRST]
    first = joined(map(_picture, drawn)) + (paragraph(note) if lines else Html(""))
    sections = {"At a glance": _glance(dataset) + first, "Cases": _cases(dataset)}
    if left := lines[len(drawn) :]:
        sections["Lines"] = joined(map(_picture, left)) + paragraph(note)
    if maps:
        sections["Heat maps"] = joined(map(_picture, maps))
    if samples:  # what they say, and Sobol indices where the design gives them
        said = [sweep_table.uncertainty(dataset, name, PRECISION) for name in _known(dataset)]
        words = joined(markup("<pre>{}</pre>", text) for text in said)
        sections["Distributions"] = joined(map(_picture, samples[len(drawn) :])) + words
    sections["Failed cases"] = _failed(dataset)
    sections["What was run"] = _inputs(dataset)
    sizes = " x ".join(f"{name} {size}" for name, size in dataset.attrs["sizes"].items())
    cases = f"{sizes} = {dataset['status'].size} cases"
    title = title or f"Sweep {store.name}"
    page = html.page(title, cases, dataset.attrs["versions"], sections, open=2)
    contents = [page.encode()]
    figures = [*lines, *maps, *samples]
    if pdf and figures:
        content = io.BytesIO()
        with style("screen"), PdfPages(content) as pages:
            for heading, figure in figures:
                figure.suptitle(heading, fontsize=9)
                pages.savefig(figure)
        contents.append(content.getvalue())
    for target, made in zip(written, contents, strict=False):
        write_file(target, made)
    return written[: len(contents)]


def _glance(dataset: xr.Dataset) -> Html:
    """From where to where the first measures go, and at which points; how many cases ran."""
    dims, over = sweep_table.grid(dataset)
    said: list[Html | str] = []
    for name, unit, factor in sweep_table.columns_of(dataset):
        means = (factor * dataset[name]).mean([*over], skipna=True).transpose(*dims)
        if np.isfinite(means.values).any():
            ends = [_extreme(dataset, means, find, unit) for find in (np.nanargmin, np.nanargmax)]
            said.append(f"{name.replace('_', ' ')}: {' to '.join(dict.fromkeys(ends))}")
    status = dataset["status"].values
    figures: dict[str, html.Quantity] = {
        "cases": int(status.size),
        "done": int((status == DONE).sum()),
        "failed": int((status == FAILED).sum()),
        "not run": int((status == NOT_RUN).sum()),
        "processor time": (float(np.nansum(dataset.get("cost", 0.0))), "s"),
    }
    if "warnings" in dataset:
        figures["runs with warnings"] = int((dataset["warnings"].values > 0).sum())
    return html.folded(said, "figures") + by_case("", [Html("")], [figures])


def _extreme(
    dataset: xr.Dataset, means: xr.DataArray, find: Callable[[np.ndarray], Any], unit: str
) -> str:
    """The mean that `find` finds, and at which point of the grid."""
    place = np.unravel_index(int(find(means.values)), means.shape)
    where = [
        f"{d.replace('_', ' ')} {sweep_table.coordinate_text(dataset, d, int(k))} "
        f"{sweep_table.scale(dataset, d)[1]}"
        for d, k in zip(map(str, means.dims), place, strict=True)
        if means.sizes[d] > 1
    ]
    at = f" (at {', '.join(one.rstrip() for one in where)})" if where else ""
    return f"{float(means.values[place]):.4g} {unit.removesuffix('1')}".rstrip() + at


def _cases(dataset: xr.Dataset) -> Html:
    """Means with half the width of their confidence intervals, at each point of the grid.

    More than `ROWS` points are folded, but for the first ones.
    """
    dims, over = sweep_table.grid(dataset)

    def with_error(mean: IntervalEstimate) -> Cell:
        half = 0.5 * (mean.high - mean.low)
        error = f"\u00a0±\u00a0{half:.2g}" if math.isfinite(half) else ""
        return f"{mean.value:.4g}{error}" if math.isfinite(mean.value) else None

    made = sweep_table.points(dataset, MOST_ROWS, with_error if over else lambda mean: mean.value)
    caption = ""
    if over:
        runs = math.prod(dataset.sizes[d] for d in over)
        caption = f"Means over {runs} runs of each point, ± half the 95 % confidence interval."
    left = math.prod(dataset.sizes[d] for d in dims) - MOST_ROWS
    first, others = (
        Table([replace(one, values=one.values[rows]) for one in made.columns])
        for rows in (slice(ROWS), slice(ROWS, None))
    )
    shown = table(first, caption, left=len(dims))
    if further := len(others.columns[0].values):
        folded = table(others, left=len(dims)) + _more(left, "points ")
        shown += html.details(f"The other {counted(further, 'point')}", folded)
    return shown


def _more(left: int, what: str = "") -> Html:
    return paragraph(f"{left} more {what}are in the store.") if left > 0 else Html("")


def _varied(dataset: xr.Dataset) -> list[str]:
    """Dimensions of the grid with more than one value, the longest first."""
    dims = [d for d in sweep_table.grid(dataset)[0] if dataset.sizes[d] > 1]
    return sorted(dims, key=lambda d: -dataset.sizes[d])


def _known(dataset: xr.Dataset) -> dict[str, str]:
    """Measures that have values, and what they are called."""
    names = (name for name, _, _ in sweep_table.columns_of(dataset))
    return {n: n.replace("_", " ") for n in names if np.isfinite(dataset[n].values).any()}


def _lines(dataset: xr.Dataset) -> Iterator[Drawn]:
    """Each measure over each dimension, with lines for another that has few values."""
    dims = _varied(dataset)
    for x in dims[:2]:
        others = (d for d in dims if d != x and dataset.sizes[d] <= draw.MOST_LINES)
        hue = next(others, None)
        for name, words in _known(dataset).items():
            yield f"{words} over {x}", draw.draw(dataset, x, name, hue)


def _maps(dataset: xr.Dataset) -> Iterator[Drawn]:
    dims = _varied(dataset)
    for name, words in _known(dataset).items() if len(dims) > 1 else ():
        x, y, *_ = dims
        yield f"{words} over {x} and {y}", draw.draw(dataset, x, y, z=name)


def _samples(dataset: xr.Dataset) -> Iterator[Drawn]:
    if not sweep_table.grid(dataset)[1] or _varied(
        dataset
    ):  # a grid besides: the convergence of which point?
        return
    for name, words in _known(dataset).items():
        for x in dataset.attrs["sampled"]:
            yield f"{words} over {x}", draw.draw(dataset, x, name)
        text = f"{words}: how it settles with the number of runs"
        yield text, draw.draw_convergence(dataset, name, PRECISION)


def _picture(drawn: Drawn) -> Html:
    title, figure = drawn
    content = io.BytesIO()
    with style("screen"):
        figure.savefig(content, format="svg", metadata={"Date": None})
    data = base64.b64encode(content.getvalue()).decode()
    image = markup('<img alt="{}" src="data:image/svg+xml;base64,{}">', title, data)
    return markup('<figure class="plot"><figcaption>{}</figcaption>{}</figure>', title, image)


def _failed(dataset: xr.Dataset) -> Html:
    places = np.argwhere(dataset["status"].values == FAILED)
    if not len(places):
        return paragraph("None.")
    dims = list(dataset.attrs["sizes"])
    drawn = list(dataset.attrs["sampled"])
    errors = dataset["error"].values
    rows = []
    for place in places[:MOST_ROWS]:
        at = dict(zip(dims, map(int, place), strict=True))
        row = [sweep_table.coordinate_text(dataset, d, k) for d, k in at.items()]
        for name in drawn:
            factor = sweep_table.scale(dataset, name)[0]
            row.append(f"{factor * float(dataset[name].values[at[SAMPLE]]):.4g}")
        rows.append([*row, str(errors[tuple(place)])])
    head = [*(sweep_table.label(dataset, d) for d in (*dims, *drawn)), "error"]
    caption = f"{len(places)} of {errors.size} cases"
    made = table(Table.of_texts([head, *rows]), caption, left=len(head))
    return made + _more(len(places) - len(rows))


def _inputs(dataset: xr.Dataset) -> Html:
    def plain(text: str) -> str:
        """A value as scenario files write it."""
        with suppress(ValueError):
            value = json.loads(text)
            return value if isinstance(value, str) else text
        return text

    identity: dict[str, Any] = dict(dataset.attrs["identity"])
    sweep = {k: v for k, v in identity.items() if k.startswith("sweep.")}
    base = {k: v for k, v in identity.items() if k not in sweep}
    keys, scenario = (
        table(
            Table.of_texts([["key", "value"], *([k, plain(v)] for k, v in those.items())]), left=2
        )
        for those in (sweep, base)
    )
    return keys + html.details("The scenario that is changed", scenario)
