"""Outputs of the study, and checks of its arguments; importing this simulates and loads nothing."""

from __future__ import annotations

from pathlib import Path

from jointplay.base import files
from jointplay.base.errors import JointplayError, require_whole
from jointplay.base.processes import number_of
from jointplay.show.plots.names import file_names

JOINT = "joint_b"
FILES = {"ideal": "ideal.nc", "0.2 mm": "case1_0.2mm.nc", "0.5 mm": "case2_0.5mm.nc"}
"""File of the result of each case."""

PAGE = "paper.md"
"""Page that shows the whole study."""
DRAWINGS = ("fig01_joint.png", "fig02_forms.png")
MOST_RUNS = 1000
"""Most runs for each clearance and condition: days of computing."""


def output_names(pdf: bool) -> list[str]:
    """Names of all files that the study writes."""
    drawn = file_names(paper=True, rolling=False, pdf=pdf)
    tables = ("errors.md", "ensemble.csv", "claims.csv", "claims.md")
    return [*FILES.values(), *drawn, *DRAWINGS, *tables, PAGE]


def folder(out: str | Path, runs: int, jobs: int | None, pdf: bool) -> Path:
    """Check the arguments of `run_study`, and claim the study's folder; errors as there."""
    if require_whole("runs", runs) == 1:
        raise JointplayError(f"the claims need at least 2 runs (0 leaves them out), got {runs}")
    if runs > MOST_RUNS:
        raise JointplayError(f"at most {MOST_RUNS} runs for each clearance, got {runs}")
    number_of(jobs)
    return files.claim(out, output_names(pdf))
