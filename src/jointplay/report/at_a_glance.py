"""The first table: one row for each case with the figures that matter most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from jointplay import analysis
from jointplay.report.cases import Case
from jointplay.report.html import Cell, Html, table
from jointplay.report.naming import dark
from jointplay.report.tool import stops


def glance(cases: Sequence[Case], start: float) -> Html:
    """One row for each case with the figures that matter most."""
    head = [
        "case",
        "ended",
        "tool error, RMS [mm]",
        "tool error, peak [mm]",
        "error at stops, largest [mm]",
        "contacts begun [1/s]",
        "force at the joint, peak [N]",
        "penetration, largest [µm]",
        "energy residual [% of exchanged]",
        "warnings",
    ]
    rows: list[list[Cell]] = []
    for case in cases:
        audit = case.result.audit
        row: list[Cell] = [dark(case), case.result.status.name.lower().replace("_", " ")]
        if case.error is None or float(case.error["time"][-1]) < start:
            row += [None, None, None]
        else:
            accuracy = analysis.accuracy(case.error, start)
            row += [1e3 * accuracy.rms[3], 1e3 * accuracy.peak[3], None]
            ends = [
                1e3 * float(analysis.error_at(case.error, stop.end)[3])
                for stop in stops(case)
                if stop.at_rest and stop.end > 0.0
            ]
            row[-1] = max(ends) if ends else None
        if case.joints:
            late = case.result.time >= start
            force = np.linalg.norm(case.result["joint_force_peak"].values[late], axis=2).max()
            since = case.result.judge_from
            begun = audit.judged_impacts
            rate = (
                audit.impacts / case.duration
                if begun is None
                else begun / max(case.duration - since, 1e-12)
            )
            row += [rate, float(force), 1e6 * audit.largest_penetration]
        else:
            row += [None, None, None]
        rows.append([*row, 100.0 * audit.relative_energy_residual, len(audit.warnings)])
    return table(head, rows, left=2)
