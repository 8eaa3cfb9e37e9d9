"""The paper's claims as judged, in tables."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from pathlib import Path

from jointplay.analysis.claims import ISOLATED, START_UP, Verdict
from jointplay.host import files
from jointplay.result.provenance import versions
from jointplay.scenario.model import GRAVITY
from jointplay.simulation.simulation import PERTURBATION
from jointplay.study.cases import CONDITIONS, VARIANTS
from jointplay.study.ensembles import Ensembles

HEADER = ("claim", "statement", "condition", "holds", "0.2 mm → 0.5 mm")


def write_claims(verdicts: Sequence[Verdict], ensembles: Ensembles, out: Path) -> None:
    """Write ``claims.csv`` and ``claims.md``."""
    table = io.StringIO(newline="")
    csv.writer(table).writerows([HEADER, *(verdict.row() for verdict in verdicts)])
    files.write(out / "claims.csv", table.getvalue())
    done, planned = len(ensembles.measures), len(ensembles.plan)
    made_with = ", ".join(f"{name} {version}" for name, version in versions().items())
    lines = [
        "# The paper's claims",
        "",
        "Wang et al., Appl. Sci. 2023, 13(4), 2211, Section 5: joint B with "
        "C_r = C_a = 0.2 mm and 0.5 mm.",
        "",
        f"Each row compares {ensembles.runs} runs at either clearance, the journal starting up to "
        f"{100 * PERTURBATION:.0f} % of its clearance off centre; mean ± standard deviation. A "
        "comparison holds (yes) if the 95 % confidence interval of the difference (Welch) lies on "
        "its side of zero, fails (no) if it lies on the other, and is undecided otherwise; claim 4 "
        "holds if every run visits every mode; peaks are isolated if they fill less than "
        f"{100 * ISOLATED:.0f} % of the time. The first "
        f"{START_UP:g} s, in which the journal falls into its bearing, are not judged. *Balanced* "
        "is without gravity, *loaded* with it; *consistent* and *as printed* are the two inertia "
        "variants (docs/assumptions.md). Numerical errors of the numbers, of one run: errors.md.",
        "",
        *([f"**Incomplete: {done} of {planned} runs.**", ""] if done < planned else []),
        "| " + " | ".join(HEADER) + " |",
        "|" + " --- |" * len(HEADER),
        *("| " + " | ".join(cell.replace("|", "\\|") for cell in v.row()) + " |" for v in verdicts),
        "",
        f"Made with {made_with}.",
        "",
    ]
    files.write(out / "claims.md", "\n".join(lines))


def summary(verdicts: Sequence[Verdict]) -> str:
    """Claims against conditions, for the terminal."""
    lines = [
        " " * 16 + "".join(f"{gravity:<24}" for gravity in GRAVITY),
        " " * 16 + "".join(f"{variant:<12}" for _ in GRAVITY for variant in VARIANTS),
    ]
    for number, subject in sorted({(v.claim, v.subject) for v in verdicts}):
        answers = {v.condition: v.holds for v in verdicts if v.claim == number}
        cells = "".join(f"{answers.get(str(condition), '-'):<12}" for condition in CONDITIONS)
        lines.append(f"{number} {subject:<14}{cells}")
    return "\n".join(line.rstrip() for line in lines)
