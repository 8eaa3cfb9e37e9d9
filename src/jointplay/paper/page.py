"""``paper.md``: the study on one page, its figures and numbers beside what the paper says.

The paper: Y. Wang, R. Li, J. Liu, Z. Jia, H. Liang, Appl. Sci. 2023, 13(4), 2211. What it says is
told in words of this project, after its Sections 2 to 6; what is found is filled in from the runs.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from jointplay.base import files
from jointplay.base.tables import Table
from jointplay.paper.cases import CASES, JOINT, scara
from jointplay.paper.ensembles import made_with
from jointplay.paper.outputs import DRAWINGS, PAGE
from jointplay.physics.geometry import Form, Mode
from jointplay.simulation import analysis
from jointplay.simulation.result.result import AXES, Result
from jointplay.simulation.result.settings import START_UP

if TYPE_CHECKING:
    from jointplay.paper.run import Findings

PRINTED_PEAKS = {"x": (1.6, 2.5), "y": (0.2, 1.8), "z": (2.1, 2.5)}
"""Times of the force peaks in the paper, along world axes (Section 5, Figures 13-15) [s]."""
PEAKS_APART_S = 0.1
"""Peaks that are nearer to each other count as one."""

EQUATIONS: tuple[tuple[str, str, str], ...] = (
    ("1", "C_r = R_i - R_j", "physics/joints/base.py, RoundClearance.cr"),
    ("2, 3", "C_a = (L_i - L_j)/2", "physics/joints/revolute.py, RevoluteClearance.dimensions"),
    (
        "4, 7",
        "radial gap of a tilted, of a parallel journal",
        "physics/geometry/cylinder.py, radial_gap",
    ),
    (
        "5, 6",
        "axial gap of a tilted, of a parallel journal",
        "physics/geometry/cylinder.py, axial_gap",
    ),
    ("8, 9", "gap > 0, = 0, < 0; Table 1", "physics/geometry/contacts.py, classify_mode"),
    ("10", "F_n = k δ^n + b δ^p δ'^q", "physics/contact/hertzian.py, HuntCrossley"),
    ("11", "k of two spheres", "physics/joints/base.py, SlidingClearance.hertz"),
    ("12", "σ = (1 - ν²)/(π E)", "physics/joints/base.py, Material.compliance"),
    ("13", "R = R_i R_j/(R_i - R_j)", "physics/joints/base.py, RoundClearance.hertz_stiffness"),
    ("14", "b, with the approach speed", "physics/kernel/contact.py, _normal_force"),
    ("15", "Hertz", "physics/contact/hertzian.py, Hertz"),
    ("16", "linear spring", "physics/contact/linear.py, LinearSpring"),
    ("17", "Kelvin-Voigt", "physics/contact/linear.py, KelvinVoigt"),
    ("18, 19", "Lankarani-Nikravesh", "physics/contact/hertzian.py, LankaraniNikravesh"),
    ("20", "friction against the sliding", "physics/kernel/contact.py, add_contact_forces"),
    ("21", "coefficient over speed", "physics/contact/friction.py, Ambrosio"),
    ("22", "M, C, G of the arm", "simulation/loop.py; model/mechanism.py, mass_matrix"),
    ("23", "with F_C on the right", "physics/kernel/multirate.py; physics/kernel/singlerate.py"),
)
"""Number, what it says, and where it stands under src/jointplay."""

READINGS: tuple[tuple[str, str, str], ...] = (
    (
        "fig09",
        "Figure 9: displacement of the end effector",
        "Section 5 reads more fluctuation about the ideal robot's displacement at 0.5 mm than at "
        "0.2 mm.",
    ),
    (
        "fig10",
        "Figure 10: velocity of the end effector",
        "Section 5 reads the same for the velocity, with peaks where the journal strikes.",
    ),
    (
        "fig11",
        "Figure 11: path in the XOY plane",
        "Section 5 reads a larger deviation from the ideal path at 0.5 mm.",
    ),
    (
        "fig12",
        "Figure 12: the journal in the clearance circle",
        "Section 5 reads all three modes in both cases: inside the circle free flight, on it "
        "continuous contact, outside it pseudo-penetration.",
    ),
    ("fig13", "Figure 13: contact force along x", "Peaks near 1.6 s and 2.5 s, larger at 0.5 mm."),
    ("fig14", "Figure 14: contact force along y", "Peaks near 0.2 s and 1.8 s, larger at 0.5 mm."),
    ("fig15", "Figure 15: contact force along z", "Peaks near 2.1 s and 2.5 s, larger at 0.5 mm."),
)
"""File, title, and what the paper reads in each figure."""

CONTRADICTIONS = (
    "Section 5 has less fluctuation with less clearance, and a rate of rejects that rises with it; "
    "Section 6 has more frequent fluctuation with less clearance, of smaller amplitude. Claims 1 "
    "to 3 are the first, claim 6 is the second: both hold here, for they are about different "
    "things.",
    "The last branch of eq. 21 prints 1 where the coefficient of friction belongs.",
    "Arm 1's inertia in Table 2 is one that no rigid body has (docs/assumptions.md).",
    "Figure 12 read for the centre of the journal's middle fails: the journal tilts, and its "
    "middle stays inside the circle while a rim is pressed against the bore. Read for the rims, it "
    "holds.",
    "G(q) stands in eq. 22, but with gravity the overhanging arms wedge the journal for good, and "
    "there are no orbits as in Figure 12.",
)


def largest_peaks(result: Result, axis: str) -> list[tuple[float, float]]:
    """Times [s] and sizes [N] of the two largest peaks of the force at joint B, in time."""
    judged = result.time >= result.judge_from
    time = result.time[judged]
    left = np.abs(result["joint_force_peak"].sel(joint=JOINT, axis=axis).values[judged])
    found = []
    for _ in range(2):
        at = int(left.argmax())
        found.append((float(time[at]), float(left[at])))
        left = np.where(np.abs(time - time[at]) < PEAKS_APART_S, -1.0, left)
    return sorted(found)


def rim_reading(result: Result) -> dict[Mode, tuple[float, float, float]]:
    """Figure 12 read for the rims, from when the run is judged, by mode.

    Returns:
        Share of the time; of this the share in which a rim's centre is at or beyond the clearance
        circle; and the share in which the centre of the journal's middle is.
    """
    judged = result.time >= result.judge_from
    outline = analysis.clearance_outline(result, JOINT)
    assert outline is not None  # the joint's journal is round
    clearance = float(outline.max())
    rims = np.hypot(*analysis.rim_centres(result, JOINT)[:, judged, :2].T).max(axis=1)
    middle = np.hypot(*result["journal_centre"].sel(joint=JOINT).values[judged, :2].T)
    mode = result["mode"].sel(joint=JOINT).values[judged]
    found = {}
    for one in Mode:
        here = mode == one
        count = max(int(here.sum()), 1)
        rim, centre = (float((at[here] >= clearance).sum()) / count for at in (rims, middle))
        found[one] = (float(here.mean()), rim, centre)
    return found


def _played(cases: Mapping[str, Result]) -> dict[str, Result]:
    return {label: result for label, result in cases.items() if result.joints}


def forms_table(cases: Mapping[str, Result]) -> list[tuple[str, ...]]:
    """Contact forms of Figure 2 and the share of the time that each case spends in them."""
    shares = {
        label: analysis.shares(result, JOINT, "form") for label, result in _played(cases).items()
    }
    rows: list[tuple[str, ...]] = [("form", "contacts", *shares)]
    for form in Form:
        if form != Form.NONE:
            cells = [f"{100.0 * one[form.name.lower()]:.2f} %" for one in shares.values()]
            words = form.name.lower().replace("_", " ")
            rows.append((form.letter, words, *(c if c != "0.00 %" else "never" for c in cells)))
    return rows


def peaks_table(cases: Mapping[str, Result]) -> list[tuple[str, ...]]:
    """The paper's times of force peaks beside the two largest of each case."""
    played = _played(cases)
    rows: list[tuple[str, ...]] = [("force along", "in the paper", *played)]
    for axis in AXES:
        cells = [
            ", ".join(f"{time:.2f} s ({size:.0f} N)" for time, size in largest_peaks(result, axis))
            for result in played.values()
        ]
        rows.append((axis, ", ".join(f"{at:g} s" for at in PRINTED_PEAKS[axis]), *cells))
    return rows


def orbit_table(cases: Mapping[str, Result]) -> list[tuple[str, ...]]:
    """`rim_reading` of the cases."""
    rows: list[tuple[str, ...]] = [
        ("case", "mode", "of the time", "a rim at or beyond C_r", "the middle at or beyond C_r")
    ]
    for label, result in _played(cases).items():
        for mode, shares in rim_reading(result).items():
            words = mode.name.lower().replace("_", " ")
            rows.append((label, words, *(f"{100.0 * share:.2f} %" for share in shares)))
    return rows


def _inertia_table() -> list[tuple[str, ...]]:
    """Table 2 as the shipped model has it."""
    mechanism = scara(None).mechanism
    rows: list[tuple[str, ...]] = [
        ("link", "mass [kg]", "Jxx, Jyy, Jzz [kg m²]", "Jxy, Jxz, Jyz [kg m²]")
    ]
    for name, joint in (("arm1", "joint_a"), ("arm2", "joint_b"), ("arm3", "joint_c")):
        inertial = mechanism.model.inertias[mechanism.model.getJointId(joint)]
        j = inertial.inertia
        diagonal = ", ".join(f"{j[k, k]:.4g}" for k in range(3))
        mixed = ", ".join(f"{j[a, b]:.4g}" for a, b in ((0, 1), (0, 2), (1, 2)))
        rows.append((name, f"{inertial.mass:g}", diagonal, mixed))
    return rows


def _simulation_table() -> list[tuple[str, ...]]:
    """Tables 3 and 4."""
    clearances = ", ".join(label for label, clearance in CASES.items() if clearance is not None)
    return [
        ("quantity", "value"),
        ("friction coefficient μ_d", "0.1"),
        ("step", "10 µs"),
        ("E, ν", "207 GPa, 0.3"),
        ("integration tolerance", "1e-7 (of modes, and as an error tolerance in errors.md)"),
        ("restitution c_e", "0.9"),
        ("C_r = C_a (Table 4)", f"ideal; {clearances}"),
    ]


def _found(study: Findings, claims: Sequence[int], axis: str) -> list[str]:
    """What the ensembles say of some claims, a line each; of forces, those along the axis."""
    lines = []
    for verdict in study.verdicts:
        if verdict.claim in claims:
            parts = verdict.numbers.split("; ")
            numbers = "; ".join(part for part in parts if "|F" not in part or axis in part)
            what = f"claim {verdict.claim}, {verdict.condition}"
            lines.append(f"- {what}: **{verdict.holds}**; {numbers}")
    return lines


_CLAIMS = {
    "fig09": ((1, 6), ""),
    "fig10": ((2,), ""),
    "fig11": ((3,), ""),
    "fig12": ((4,), ""),
    "fig13": ((5,), "|Fx|"),
    "fig14": ((5,), "|Fy|"),
    "fig15": ((5,), "|Fz|"),
}
"""Claims that a figure shows, and the force in it."""


def page(study: Findings, setting: str, pictures: str = "") -> str:
    """The text of the page.

    Args:
        study: what was found.
        setting: gravity, inertia and method of the cases, in words.
        pictures: folder of the pictures, as seen from the page, with its slash.
    """
    cases = study.cases
    lines = [
        "# The paper's study",
        "",
        "Wang, Li, Liu, Jia, Liang: *Dynamic Characteristics Analysis of an Assembly Robot for a "
        "Wine Box Base Considering Radial and Axial Clearances in a 3D Revolute Joint*, Appl. Sci. "
        "2023, 13(4), 2211, [doi 10.3390/app13042211](https://doi.org/10.3390/app13042211). "
        "`jointplay scara` wrote this page: what the paper says, in words of this project, beside "
        f"what is found here. Cases: {setting}.",
        "",
        "## The joint",
        "",
        f"![Bearing and journal, modes, gaps]({pictures}{DRAWINGS[0]})",
        "",
        "Joint B is replaced by a virtual link of six coordinates: the journal's centre in the "
        "bearing frame (x, y, z), then yaw, pitch and roll. z is the joint's axis, so the drive "
        "acts on yaw, and yaw is what an encoder sees. Nothing but the contact force F_C holds the "
        "two arms together. The arm of 4 coordinates then has 9. The drives follow the motion by "
        "the ideal robot's torques (computed torque) and a PD part of 100 rad/s.",
        "",
        f"![The twelve contact forms]({pictures}{DRAWINGS[1]})",
        "",
        f"How long each form lasts, from {START_UP:g} s on; which of the letters a to d is which "
        "within the group is an assumption:",
        "",
        Table.of_texts(forms_table(cases)).markdown(),
        "",
        "## Model and data",
        "",
        "Table 2, with the inertias that are possible (docs/assumptions.md; lengths 329, 275 and "
        "350 mm):",
        "",
        Table.of_texts(_inertia_table()).markdown(),
        "",
        "Tables 3 and 4:",
        "",
        Table.of_texts(_simulation_table()).markdown(),
        "",
        "Table 1, the modes by the gaps: free flight, both positive; continuous contact, none "
        "negative and at least one zero (within 0.1 µm); pseudo-penetration, at least one "
        "negative.",
        "",
        "## Figures 9 to 15",
        "",
    ]
    for name, title, said in READINGS:
        lines += [f"### {title}", "", f"![{title}]({pictures}{name}.png)", "", f"The paper: {said}"]
        found = _found(study, *_CLAIMS[name])
        lines += ["", *(["Found:", "", *found, ""] if found else [])]
        if name == "fig12":
            lines += [Table.of_texts(orbit_table(cases)).markdown(), ""]
    lines += [
        "### Times of the force peaks",
        "",
        "The two largest peaks of each case beside the times in the paper. The motion is sketched "
        "in the paper and assumed here, so the times need not agree. "
        "`python benchmarks peak_times` searches timings of the same motion that bring them "
        "nearer.",
        "",
        Table.of_texts(peaks_table(cases)).markdown(),
        "",
        "## The claims",
        "",
        Table.of_texts(
            [("claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm")]
            + [verdict.row() for verdict in study.verdicts]
        ).markdown(),
        "",
        "## The figures by several methods",
        "",
        "The paper integrates with a step of 10⁻⁵ s and does not name the method. The explicit "
        "method with this step is too high in the first strokes, for friction's ramp is stiffer "
        "than the step; the default method solves friction and damping implicitly.",
        "",
        Table.of_texts(study.rows).markdown(),
        "",
        *([*(f"- warning of {line}" for line in study.warnings), ""] if study.warnings else []),
        "## Equations",
        "",
        "Files under src/jointplay; docs/equation_of_motion.md computes eq. 23 term by term.",
        "",
        Table.of_texts([("eq.", "says", "file, function or law"), *EQUATIONS]).markdown(),
        "",
        "## The paper against itself",
        "",
        *(f"- {line}" for line in CONTRADICTIONS),
        "",
        made_with(),
        "",
    ]
    return "\n".join(lines)


def write_page(study: Findings, setting: str, out: Path) -> None:
    """Write ``paper.md`` and its drawings."""
    from jointplay.show.plots import drawings
    from jointplay.show.plots.names import MARK

    for name, draw in zip(DRAWINGS, (drawings.joint_drawings, drawings.contact_forms), strict=True):
        files.picture(out / name, draw(), mark=MARK)
    files.write(out / PAGE, page(study, setting))
