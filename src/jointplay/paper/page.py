"""``paper.md``: the study on one page, its figures and numbers beside the paper's statements.

The paper: Y. Wang, R. Li, J. Liu, Z. Jia, H. Liang, Appl. Sci. 2023, 13(4), 2211. Its statements
(Sections 2 to 6) are in `pages/paper.md`, in this project's words; the study's results are filled
in.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base import files
from jointplay.paper.cases import CASES, JOINT, JUDGED_FROM_S, scara
from jointplay.paper.ensembles import claim_rows, filled
from jointplay.paper.outputs import DRAWINGS, PAGE
from jointplay.physics.geometry import Form, Mode
from jointplay.simulation import analysis
from jointplay.simulation.analysis.claims import ISOLATED
from jointplay.simulation.initial import PERTURBATION
from jointplay.simulation.result.result import AXES, Result

if TYPE_CHECKING:
    from jointplay.paper.study import Findings

PRINTED_PEAKS = {"x": (1.6, 2.5), "y": (0.2, 1.8), "z": (2.1, 2.5)}
"""Times of the force peaks in the paper, along world axes (Section 5, Figures 13-15) [s]."""
PEAKS_APART_S = 0.1
"""Peaks that are nearer to each other count as one [s]."""
Rows = list[tuple[str, ...]]
"""Rows of a table, its head first."""


def largest_peaks(result: Result, axis: str) -> list[tuple[float, float]]:
    """Times [s] and sizes [N] of the two largest peaks of the force at joint B, ordered by time."""
    judged = result.time >= result.judge_from
    time = result.time[judged]
    left = np.abs(result["joint_force_peak"].sel(joint=JOINT, axis=axis).values[judged])
    peaks = []
    for _ in range(2):
        at = int(left.argmax())
        peaks.append((float(time[at]), float(left[at])))
        left = np.where(np.abs(time - time[at]) < PEAKS_APART_S, -1.0, left)
    return sorted(peaks)


def rim_reading(result: Result) -> dict[Mode, tuple[float, float, float]]:
    """The paper's Figure 12 evaluated for the journal's rims, by mode, while the run is judged.

    Returns:
        Share of the time in the mode; of that, the share in which a rim's centre is at or beyond
        the clearance circle, and the share in which the centre of the journal's middle is.
    """
    judged = result.time >= result.judge_from
    outline = analysis.clearance_outline(result, JOINT)
    assert outline is not None  # the joint's journal is round
    rims = np.hypot(*analysis.rim_centres(result, JOINT)[:, judged, :2].T).max(axis=1)
    middle = np.hypot(*result["journal_centre"].sel(joint=JOINT).values[judged, :2].T)
    mode = result["mode"].sel(joint=JOINT).values[judged]
    shares = {}
    for kind in Mode:
        rows = mode == kind
        count = max(int(rows.sum()), 1)
        rim, centre = (float((at[rows] >= outline.max()).sum()) / count for at in (rims, middle))
        shares[kind] = (float(rows.mean()), rim, centre)
    return shares


def _played(cases: Mapping[str, Result]) -> dict[str, Result]:
    return {label: result for label, result in cases.items() if result.joints}


def _label(member: Form | Mode) -> str:
    return member.name.lower().replace("_", " ")


def forms_table(cases: Mapping[str, Result]) -> Rows:
    """Contact forms of Figure 2 and the share of the time that each case spends in them."""
    played = _played(cases)
    shares = [analysis.time_fractions(result, JOINT, "form") for result in played.values()]
    rows: Rows = [("form", "contacts", *played)]
    for form in filter(None, Form):
        cells = [f"{100.0 * fractions[form.name.lower()]:.2f} %" for fractions in shares]
        rows.append((form.letter, _label(form), *(c if c != "0.00 %" else "never" for c in cells)))
    return rows


def peaks_table(cases: Mapping[str, Result]) -> Rows:
    """The paper's times of force peaks beside the two largest peaks of each case."""
    played = _played(cases)
    rows: Rows = [("force along", "in the paper", *played)]
    for axis in AXES:
        cells = [
            ", ".join(f"{time:.2f} s ({size:.0f} N)" for time, size in largest_peaks(result, axis))
            for result in played.values()
        ]
        rows.append((axis, ", ".join(f"{at:g} s" for at in PRINTED_PEAKS[axis]), *cells))
    return rows


def _orbit_table(cases: Mapping[str, Result]) -> Rows:
    """The shares of `rim_reading` for each case and mode."""
    head = ("case", "mode", "of the time", "a rim at or beyond C_r", "the middle at or beyond C_r")
    return [
        head,
        *(
            (label, _label(mode), *(f"{100.0 * share:.2f} %" for share in shares))
            for label, result in _played(cases).items()
            for mode, shares in rim_reading(result).items()
        ),
    ]


def _inertia_table() -> Rows:
    """Masses and inertias of the paper's Table 2, as the shipped model has them."""
    model = scara(None).mechanism.model
    rows: Rows = [("link", "mass [kg]", "Jxx, Jyy, Jzz [kg m²]", "Jxy, Jxz, Jyz [kg m²]")]
    for name, joint in (("arm1", "joint_a"), ("arm2", "joint_b"), ("arm3", "joint_c")):
        inertial = model.inertias[model.getJointId(joint)]
        moments = [f"{moment:.4g}" for moment in inertial.inertia[np.triu_indices(3)]]
        xx, xy, xz, yy, yz, zz = moments
        rows.append((name, f"{inertial.mass:g}", f"{xx}, {yy}, {zz}", f"{xy}, {xz}, {yz}"))
    return rows


def page(study: Findings, setting: str) -> str:
    """Text of the page.

    Args:
        study: the study's results.
        setting: gravity, inertia and method of the cases, in words.
    """

    def holding(claims: Sequence[int]) -> str:
        """The conditions under which some claims hold, by the ensembles."""
        parts = []
        for claim in claims:
            where: dict[str, list[str]] = {}
            for verdict in study.verdicts:
                if verdict.claim == claim:
                    where.setdefault(verdict.holds, []).append(verdict.condition)
            verdicts = ", ".join(
                f"**{holds}** ({'; '.join(conditions) if len(where) > 1 else 'each condition'})"
                for holds, conditions in where.items()
            )
            if verdicts:
                parts.append(f"claim {claim}: {verdicts}")
        return "; ".join(parts)

    return filled(
        PAGE,
        study=study,
        setting=setting,
        found=holding,
        start=f"{JUDGED_FROM_S:g}",
        clearances="ideal; " + ", ".join(label for label, size in CASES.items() if size),
        printed=PRINTED_PEAKS,
        inertias=_inertia_table(),
        forms=forms_table(study.cases),
        orbits=_orbit_table(study.cases),
        peaks=peaks_table(study.cases),
        statements={verdict.claim: verdict.statement for verdict in study.verdicts},
        claims=[(claim, *rest) for claim, _, *rest in claim_rows(study.verdicts)],
        methods=[
            tuple("" if cell == "not computed" else cell for cell in row)
            for row in study.rows
            if row[0] != "ideal"
        ],
        displaced=f"{100 * PERTURBATION:.0f}",
        isolated=f"{100 * ISOLATED:.0f}",
    )


def write_page(study: Findings, setting: str, out: Path) -> None:
    """Write ``paper.md`` and its drawings."""
    from jointplay.show.plots import drawings
    from jointplay.show.plots.names import MARK

    for name, draw in zip(DRAWINGS, (drawings.joint_drawings, drawings.contact_forms), strict=True):
        files.picture(out / name, draw(), mark=MARK)
    files.write(out / PAGE, page(study, setting))
