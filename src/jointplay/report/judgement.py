"""The runs' judgement of themselves, and their numerical errors."""

from __future__ import annotations

import math
from collections.abc import Sequence

from jointplay.report.cases import Case
from jointplay.report.html import Cell, Html, bullets, joined, markup, paragraph, table
from jointplay.report.naming import dark
from jointplay.result.certificate import CertifiedFigure

_OF_CONTACTS = (
    "contacts begun",
    "shortest contact [steps]",
    "contacts under 10 steps",
    "normal impulse [N s]",
    "largest penetration [µm]",
    "penetration [% of the clearance]",
    "step that friction needs [µs]",
)


def audits(cases: Sequence[Case]) -> Html:
    """The runs' judgement of themselves."""
    given = [_judged(case) for case in cases]
    rows: list[list[Cell]] = [
        [name, *(one[name] for one in given)]
        for name in given[0]
        if any(one[name] is not None for one in given)
    ]
    warnings = [
        markup('{} <strong class="warn">Warning:</strong> {}.', dark(case), warning)
        for case in cases
        for warning in case.result.audit.warnings
    ]
    return joined(
        [
            table(["of the run", *map(dark, cases)], rows, name="audit-table"),
            bullets(warnings) or paragraph("No run has anything to warn of."),
        ]
    )


def _judged(case: Case) -> dict[str, Cell]:
    """What a run says of itself, by name; None where it has no such thing."""
    audit, attributes = case.result.audit, case.result.dataset.attrs
    contact: dict[str, Cell] = dict.fromkeys(_OF_CONTACTS)
    if case.joints:
        limit = audit.friction_step_limit
        values: list[Cell] = [
            audit.impacts,
            audit.shortest_contact_steps or None,
            audit.under_resolved,
            audit.normal_impulse,
            1e6 * audit.largest_penetration,
            100.0 * audit.penetration_over_clearance,
            1e6 * limit if math.isfinite(limit) else None,
        ]
        contact = dict(zip(_OF_CONTACTS, values, strict=True))
    drift = 1e6 * audit.loop_drift if "loop_drift" in case.result.dataset else None
    return {
        "ended": case.result.message,
        "energy residual [J]": audit.energy_residual,
        "energy exchanged [J]": audit.energy_exchanged,
        "residual [% of exchanged]": 100.0 * audit.relative_energy_residual,
        **contact,
        "step [µs]": 1e6 * audit.step,
        "error by the step [µm]": None if audit.step_error is None else 1e6 * audit.step_error,
        "drift of ideal loops [µm]": drift,
        "computed in [s]": float(attributes["wall_time_s"])
        if "wall_time_s" in attributes
        else None,
    }


def certificates(cases: Sequence[Case]) -> Html:
    """Headline figures with their numerical errors; nothing if no run was certified."""
    known = [(case, case.result.certificate) for case in cases]
    given = [(case, certificate) for case, certificate in known if certificate is not None]
    if not given:
        return Html("")
    names = dict.fromkeys(
        figure.name for _, certificate in given for figure in certificate.headline
    )
    rows: list[list[Cell]] = []
    for name in names:
        row: list[Cell] = [name]
        for _, certificate in given:
            figure = next((one for one in certificate.figures if one.name == name), None)
            row.append(None if figure is None else _certified(figure))
        rows.append(row)
    head: list[Cell] = ["figure", *(dark(case) for case, _ in given)]
    points: list[str] = [
        markup("{} of the claims' measures above 5 %: {}.", dark(case), ", ".join(others))
        for case, certificate in given
        if (others := [one.name for one in certificate.marked if one not in certificate.headline])
    ]
    points += [
        markup("{} {}.", dark(case), certificate.note)
        for case, certificate in given
        if certificate.note
    ]
    points += [
        markup("{} further runs: {}.", dark(case), "; ".join(certificate.runs))
        for case, certificate in given
        if certificate.runs
    ]
    return joined(
        [
            Html("<h3>Numerical errors</h3>"),
            paragraph(
                "Figures of the runs and how far they may be from what the model says, found by "
                "running again more finely; those with errors above 5 % are marked."
            ),
            table(head, rows, left=1, name="certificates"),
            bullets(points),
        ]
    )


def _certified(figure: CertifiedFigure) -> Cell:
    shown = str(figure)
    return markup('<strong class="warn">{} (!)</strong>', shown) if figure.marked else shown
