"""The paper's study: its cases, its figures and its claims."""

from jointplay.study.cases import (
    CASES,
    CONDITIONS,
    DIFFERS,
    EXPLICIT,
    FILES,
    GRAVITY,
    JOINT,
    Condition,
    explicit,
    perturbed,
    run_case,
    scara,
)
from jointplay.study.ensembles import Ensembles
from jointplay.study.error_tables import errors_table, errors_text, measures_table, write_errors
from jointplay.study.study import output_names, run_study
from jointplay.study.verdicts import summary, write_claims

__all__ = [
    "CASES",
    "CONDITIONS",
    "DIFFERS",
    "EXPLICIT",
    "FILES",
    "GRAVITY",
    "JOINT",
    "Condition",
    "Ensembles",
    "errors_table",
    "errors_text",
    "explicit",
    "measures_table",
    "output_names",
    "perturbed",
    "run_case",
    "run_study",
    "scara",
    "summary",
    "write_claims",
    "write_errors",
]
