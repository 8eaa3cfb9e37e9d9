"""Results: histories of a run, its audit, and the file that holds both."""

from typing import TYPE_CHECKING

from jointplay.host.late import lazily

if TYPE_CHECKING:
    from jointplay.result.result import AXES as AXES
    from jointplay.result.result import FORMAT as FORMAT
    from jointplay.result.result import Result as Result

__all__ = ["AXES", "FORMAT", "Result"]

__getattr__ = lazily(__name__, dict.fromkeys(__all__, "result"))
