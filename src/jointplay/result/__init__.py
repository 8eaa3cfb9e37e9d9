"""Results: histories of a run, its audit, and the file that holds both."""

from typing import TYPE_CHECKING

from jointplay.host.late import offering

if TYPE_CHECKING:
    from jointplay.result.audit import Audit as Audit
    from jointplay.result.certificate import Certificate as Certificate
    from jointplay.result.result import AXES as AXES
    from jointplay.result.result import FORMAT as FORMAT
    from jointplay.result.result import Result as Result

__all__ = ["AXES", "FORMAT", "Audit", "Certificate", "Result"]

__getattr__ = offering(
    __name__,
    {
        "AXES": "result",
        "FORMAT": "result",
        "Audit": "audit",
        "Certificate": "certificate",
        "Result": "result",
    },
)
