"""What the paper claims, and what these runs say of it."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from jointplay.analysis.claims import measure
from jointplay.errors import JointplayError
from jointplay.report.cases import Case
from jointplay.report.html import Cell, Html, joined, markup, paragraph, table
from jointplay.report.naming import dark
from jointplay.result.judging import START_UP

CLAIM_COLUMNS = ["claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm"]
"""Header of the claims table that `jointplay scara` writes."""


_MEASURES = {
    "deviation_mm": "tool deviation about its mean, RMS [mm]",
    "speed_mm_s": "velocity deviation, RMS [mm/s]",
    "path_mm": "distance from the ideal path in the XOY plane, RMS [mm]",
    "free": "free flight [share of time]",
    "continuous": "continuous contact [share of time]",
    "penetration": "pseudo-penetration [share of time]",
    "fx": "largest |Fx| [N]",
    "fy": "largest |Fy| [N]",
    "fz": "largest |Fz| [N]",
    "busy": "force above 20 % of its peak [share of time]",
    "crossings": "turning points of the tool's deviation [1/s]",
    "swing_mm": "mean excursion between them [mm]",
}


def claim_rows(source: Path | None) -> list[list[str]]:
    """Rows of a claims table, its header first; nothing for no file.

    Raises:
        JointplayError: it cannot be read, or is no such table.
    """
    if source is None:
        return []
    try:
        with source.open(newline="", encoding="utf-8") as file:
            lines = list(csv.reader(file))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        reason = getattr(error, "strerror", None) or error
        raise JointplayError(f"cannot read the claims {str(source)!r}: {reason}") from None
    if not lines or lines[0] != CLAIM_COLUMNS or any(len(line) != 5 for line in lines):
        raise JointplayError(
            f"{str(source)!r} is not a claims table of jointplay scara; its header must be "
            f"{','.join(CLAIM_COLUMNS)}"
        )
    return lines


def claims(cases: Sequence[Case], source: Path | None) -> Html:
    """Verdicts of an ensemble, if there are any, and the measures of the runs themselves."""
    parts = []
    lines = claim_rows(source)
    if source is not None and lines:
        verdicts = {"yes": "good", "no": "bad"}
        rows = [
            [a, b, c, markup('<span class="{}">{}</span>', verdicts.get(d, "open"), d), e]
            for a, b, c, d, e in lines[1:]
        ]
        parts.append(table(lines[0], rows, f"Ensembles of perturbed runs ({source.name})", 5))
    columns = {}
    for case in cases:
        reference = case.ideal
        if case.error is None or reference is None or len(case.joints) != 1:
            continue
        same = np.array_equal(case.result.time, reference.time)
        if same and case.duration > 2.0 * START_UP:
            columns[case.label] = (dark(case), measure(case.result, reference))
    if columns:
        measures: list[list[Cell]] = [
            [label, *(float(column[key]) for _, column in columns.values())]
            for key, label in _MEASURES.items()
        ]
        parts.append(
            table(
                ["measure", *(name for name, _ in columns.values())],
                measures,
                "What the claims are about, in these single runs",
            )
        )
        parts.append(
            paragraph(
                "No claim is decided on single runs: impacts magnify small differences. Ensembles "
                "are judged by the command jointplay scara."
            )
        )
    return joined(parts) or paragraph(
        "There is nothing to judge: no claims table was given, "
        f"and no run with clearance is longer than {2.0 * START_UP:g} s."
    )
