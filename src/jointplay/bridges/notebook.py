"""Display of a result in a notebook: how the run ended, its figures, a small picture."""

from __future__ import annotations

import base64
import html
from contextlib import suppress
from dataclasses import replace

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import drawn
from jointplay.base.tables import few, html_table
from jointplay.base.units import readable
from jointplay.show.plots.chart import Axis, Chart, Curve, Panel
from jointplay.show.plots.draw import draw
from jointplay.show.plots.palette import CONTACT_COLOURS
from jointplay.simulation.analysis.headline import peak_force
from jointplay.simulation.analysis.vibration import rattle
from jointplay.simulation.result.result import Result

_WIDTH, _HEIGHT = 6.6, 2.2
"""Size of the picture [inches]."""


def page(result: Result) -> str:
    """Self-contained HTML of a result."""
    warnings = "".join(f"<li>{html.escape(text)}</li>" for text in result.audit.warnings)
    return (
        f"<div><p><b>jointplay result</b>: {html.escape(result.message)}</p>"
        + html_table(rows_of(result))
        + (f"<p>Warnings:</p><ul>{warnings}</ul>" if warnings else "")
        + _image(result)
        + "</div>"
    )


def rows_of(result: Result) -> list[tuple[str, str]]:
    """Name and value of each row of the table."""
    audit, time = result.audit, result.time
    span = f"{time[0]:g} to {time[-1]:g} s" if len(time) else "none"
    names = result["coordinate"].values.tolist()
    rows = [
        ("records", f"{len(time)}, {span}"),
        ("coordinates", f"{len(names)}: {few(names)}"),
        ("clearance in", few(result.joints) or "no joint"),
    ]
    start = result.judge_from
    since = f" from {start:g} s on" if start > 0.0 else ""
    for k, joint in enumerate(result.joints):
        forces = np.linalg.norm(result["joint_force_peak"].values[time >= start, k], axis=1)
        force = peak_force(result, joint, float(forces.max(initial=0.0)))
        rows.append((f"peak force in {joint}", f"{force}{since}"))
    if result.joints:
        with suppress(JointplayError):  # too few records
            rows.append(("rattle", f"{str(rattle(result)).removeprefix('rattle: ')}{since}"))
        rows.append(("largest penetration", readable(audit.largest_penetration, "m", 3)))
    percent = 100.0 * audit.relative_energy_residual
    rows.append(("energy residual", f"{audit.energy_residual:.3g} J, {percent:.2g} % of exchange"))
    if result.certificate is not None:
        further = (f for f in result.certificate.headline if not f.name.startswith("peak joint"))
        rows += [(figure.name, str(figure)) for figure in further]  # peak forces are above
        rows.append(("numerical errors", result.certificate.origin))
    return rows


def _image(result: Result) -> str:
    if len(result.time) < 2:
        return ""
    data = base64.b64encode(drawn(draw(_chart(result)), "png", dpi=100)).decode()
    text = "tool path and contact force" if result.joints else "tool path and drive efforts"
    return f'<img alt="{text}" src="data:image/png;base64,{data}"/>'


def _chart(result: Result) -> Chart:
    tool = result.plot.panel("displacement")
    tool = replace(tool, y=replace(tool.y, name="tool"), columns=0, legend="best")
    title, up = "drive efforts", Axis("effort [N m, N]")
    histories = dict(
        zip(result["coordinate"].values.tolist(), result["drive"].values.T, strict=True)
    )
    if result.joints:
        title, up = "joint force, peaks", Axis("force", "N")
        peaks = np.linalg.norm(result["joint_force_peak"].values, axis=2)
        histories = dict(zip(result.joints, peaks.T, strict=True))
    marks = [
        Curve(result.time, values, name, colour)
        for (name, values), colour in zip(histories.items(), CONTACT_COLOURS, strict=False)
    ]
    return Chart([[tool, Panel(tool.x, up, marks, title, legend="best")]], (_WIDTH, _HEIGHT))
