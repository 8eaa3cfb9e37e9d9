"""Results: histories of a run, its audit, and the file that holds both."""

from jointplay.result.audit import Audit
from jointplay.result.certificate import Certificate
from jointplay.result.result import AXES, FORMAT, Result

__all__ = ["AXES", "FORMAT", "Audit", "Certificate", "Result"]
