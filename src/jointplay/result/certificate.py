"""Headline figures of a run with their numerical errors.

`analysis.estimate` finds them for every run, `analysis.certify` more strictly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from jointplay.core.errors import MissingName, require_non_negative
from jointplay.core.schema import Described, quantity

MARKED = 0.05
"""A figure whose relative error exceeds this is marked where it stands."""

HEADLINE = (
    "peak joint force",
    "RMS joint force",
    "peak tool error",
    "RMS tool error",
    "impacts",
    "dissipated energy",
)
"""Beginnings of the names of the figures that are printed."""

COUNTS = ("impacts",)
"""Figures that are whole numbers, and so are their errors."""


@dataclass(frozen=True, kw_only=True)
class WrittenFigure:
    """A figure as files have it."""

    name: str
    value: float = quantity("", finite=False)
    """In its own unit, as its error."""
    error: float | None = quantity("")
    """None if unknown."""
    unit: str


@dataclass(frozen=True)
class CertifiedFigure(Described):
    """A figure of a run, and how far it may be from what the model says."""

    written: ClassVar[type | None] = WrittenFigure

    name: str
    value: float
    error: float
    """Numerical error, as large as it is expected to be in 9 of 10 cases; inf if unknown."""
    unit: str

    def describe(self) -> dict[str, Any]:
        """All as plain data; an unknown error is None."""
        return super().describe() | ({} if math.isfinite(self.error) else {"error": None})

    @classmethod
    def from_fields(cls, fields: dict[str, Any]) -> Self:
        """Build the figure that `describe` described.

        Raises:
            JointplayError: a negative error.
        """
        error = fields["error"]
        if error is not None:
            error = require_non_negative("an error", error, "", ("error",))
        return cls(**fields | {"error": math.inf if error is None else error})

    @property
    def relative(self) -> float:
        """Error over magnitude; 0 without error."""
        if self.error == 0.0:
            return 0.0
        return self.error / abs(self.value) if self.value else math.inf

    @property
    def marked(self) -> bool:
        """Whether the error exceeds 5 %, and of a count one."""
        return not (self.relative <= MARKED or (self.name in COUNTS and self.error <= 1.0))

    def __str__(self) -> str:
        """Value ± error and unit, the value with no more digits than the error allows."""
        if self.name in COUNTS and math.isfinite(self.error):
            return f"{self.value:.0f} ± {self.error:.0f}"
        return f"{plus_minus(self.value, self.error)} {self.unit}".rstrip()


def plus_minus(value: float, error: float, most: int = 6) -> str:
    """``677.1 ± 0.3``: the error with one digit (two if it begins with 1), the value as many.

    The value has three to `most` digits; a smaller error is rounded up to the last of them.
    """
    if not math.isfinite(error):
        return f"{value:.4g} ± unknown"
    if error == 0.0:
        return f"{value:.6g} ± 0"
    size = math.floor(math.log10(error))
    digits = 1 - size if error < 2.0 * 10.0**size else -size
    top = math.floor(math.log10(abs(value))) if value else size
    digits = max(min(digits, most - 1 - top), 2 - top)
    if -4 <= top < 6:
        places = max(digits, 0)
        shown = math.ceil(error * 10.0**digits - 1e-9) / 10.0**digits
        return f"{round(value, digits):.{places}f} ± {shown:.{places}f}"
    scale = 10.0**top
    places = max(digits + top, 0)
    shown = math.ceil(error / scale * 10.0**places - 1e-9) / 10.0**places
    return f"({value / scale:.{places}f} ± {shown:.{places}f})e{top:d}"


@dataclass(frozen=True)
class Certificate(Described):
    """The figures of a run with their errors, and the runs from which these come."""

    figures: tuple[CertifiedFigure, ...]
    runs: tuple[str, ...] = ()
    """The further runs, in words."""
    note: str = ""
    """What else the reader must know."""
    strict: bool = True
    """Whether several finer runs found the errors; else one further run estimated them."""

    def __getitem__(self, name: str) -> CertifiedFigure:
        """The figure `name`."""
        for figure in self.figures:
            if figure.name == name:
                return figure
        raise MissingName("certified figure", name, [figure.name for figure in self.figures])

    @property
    def origin(self) -> str:
        """How the errors were found, in words."""
        how = "certified by" if self.strict else "estimated from"
        return f"{how} {len(self.runs)} further runs"

    @property
    def headline(self) -> list[CertifiedFigure]:
        """The figures that are printed; the others are those that the claims use."""
        return [figure for figure in self.figures if figure.name.startswith(HEADLINE)]

    @property
    def marked(self) -> list[CertifiedFigure]:
        """Figures whose error exceeds 5 %."""
        return [figure for figure in self.figures if figure.marked]

    def __str__(self) -> str:
        """One figure a line."""
        lines = [f"  numerical errors, {self.origin}:"] if self.runs else []
        width = max((len(figure.name) for figure in self.headline), default=0)
        for figure in self.headline:
            mark = "  <- error above 5 %" if figure.marked else ""
            lines.append(f"    {figure.name:<{width}}  {figure}{mark}")
        others = [figure for figure in self.marked if figure not in self.headline]
        if others:
            names = ", ".join(figure.name for figure in others)
            lines.append(f"    of the claims' measures above 5 %: {names}")
        if self.note:
            lines.append(f"  {'certificate' if self.strict else 'estimate'}: {self.note}")
        return "\n".join(lines)
