"""The paper's study: its cases, its figures and its claims."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.study.asked import FILES as FILES
    from jointplay.study.asked import JOINT as JOINT
    from jointplay.study.asked import output_names as output_names
    from jointplay.study.cases import CASES as CASES
    from jointplay.study.cases import CONDITIONS as CONDITIONS
    from jointplay.study.cases import DIFFERS as DIFFERS
    from jointplay.study.cases import EXPLICIT as EXPLICIT
    from jointplay.study.cases import GRAVITY as GRAVITY
    from jointplay.study.cases import Condition as Condition
    from jointplay.study.cases import explicit as explicit
    from jointplay.study.cases import perturbed as perturbed
    from jointplay.study.cases import run_case as run_case
    from jointplay.study.cases import scara as scara
    from jointplay.study.ensembles import Ensembles as Ensembles
    from jointplay.study.error_tables import errors_table as errors_table
    from jointplay.study.error_tables import errors_text as errors_text
    from jointplay.study.error_tables import measures_table as measures_table
    from jointplay.study.error_tables import write_errors as write_errors
    from jointplay.study.study import run_study as run_study
    from jointplay.study.verdicts import summary as summary
    from jointplay.study.verdicts import write_claims as write_claims

_HOMES = {
    "asked": "FILES JOINT output_names",
    "cases": "CASES CONDITIONS DIFFERS EXPLICIT GRAVITY Condition explicit perturbed run_case "
    "scara",
    "ensembles": "Ensembles",
    "error_tables": "errors_table errors_text measures_table write_errors",
    "study": "run_study",
    "verdicts": "summary write_claims",
}

__getattr__ = offering(
    __name__, {name: module for module, names in _HOMES.items() for name in names.split()}
)

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
