"""Certificates: headline figures of a run with their numerical errors, found by `certify`."""

from __future__ import annotations

import math
from dataclasses import dataclass

from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.schema import Described, Quantity, quantity
from jointplay.base.tables import aligned
from jointplay.base.units import displayed

MARKED = 0.05
"""Relative error above which a figure is marked."""

HEADLINE = (
    "peak joint force",
    "RMS joint force",
    "peak tool error",
    "RMS tool error",
    "peak tool turn",
    "RMS tool turn",
    "impacts",
    "dissipated energy",
)
"""Beginnings of the names of the figures that are printed."""

COUNTS = ("impacts",)
"""Figures that are whole numbers, as their errors are."""


@dataclass(frozen=True)
class CertifiedFigure(Described):
    """A figure of a run with its numerical error against the exact solution of the model."""

    name: str
    value: Quantity = quantity("", finite=False)
    """Value in its own `unit`."""
    error: Quantity = quantity("", finite=False)
    """Bound of the numerical error that is expected to hold in 9 of 10 cases; inf if unknown."""
    unit: str  # type: ignore[misc]  # those before have no default either
    """SI unit of both."""

    def __post_init__(self) -> None:
        if not self.error >= 0.0:
            raise JointplayError(f"an error must not be negative, got {self.error!r}", ("error",))

    @property
    def relative(self) -> float:
        """Error over magnitude; 0 without error."""
        if self.error == 0.0:
            return 0.0
        return self.error / abs(self.value) if self.value else math.inf

    @property
    def marked(self) -> bool:
        """Whether the error exceeds 5 %, and for a count also one."""
        return not (self.relative <= MARKED or (self.name in COUNTS and self.error <= 1.0))

    @property
    def number(self) -> str:
        """Value ± error in the unit of `displayed`."""
        factor, _ = displayed(self.unit)
        return plus_minus(factor * self.value, factor * self.error, self.name in COUNTS)

    def __str__(self) -> str:
        return f"{self.number} {displayed(self.unit)[1]}".rstrip()


def plus_minus(value: float, error: float, is_count: bool = False) -> str:
    """Format as ``677.1 ± 0.3``: the error with one digit (two if it begins with 1), the value with
    as many decimals.

    The value has three to six digits; a smaller error is rounded up to the last of them. If the
    error is as large as the value, only an upper bound of the size is given; if it is zero, the
    value alone. `is_count`: both are whole numbers.
    """
    if not math.isfinite(error):
        return f"{value:.4g} ± unknown"
    if error == 0.0:
        return f"{value:.6g}"
    if error >= abs(value):
        bound = abs(value) + error
        if is_count:
            return f"at most {math.ceil(bound - 1e-9)}"
        step = 10.0 ** (math.floor(math.log10(bound)) - 1)
        return f"at most {_with_digits(math.ceil(bound / step - 1e-9) * step, 2)}"
    if is_count:
        return f"{value:.0f} ± {error:.0f}"
    size = math.floor(math.log10(error))  # `digits` count from the point
    digits = 1 - size if error < 2.0 * 10.0**size else -size
    top = math.floor(math.log10(abs(value)))
    digits = max(min(digits, 5 - top), 2 - top)
    if -4 <= top < 6:
        places = max(digits, 0)
        shown = math.ceil(error * 10.0**digits - 1e-9) / 10.0**digits
        return f"{round(value, digits):.{places}f} ± {shown:.{places}f}"
    scale = 10.0**top
    places = max(digits + top, 0)
    shown = math.ceil(error / scale * 10.0**places - 1e-9) / 10.0**places
    return f"({value / scale:.{places}f} ± {shown:.{places}f})e{top:d}"


UNKNOWN_DIGITS = 3
"""Significant digits of a figure whose error is unknown."""


def alone(value: float, uncertain: float = 0.0) -> str:
    """Format a value whose own error is unknown, with three digits.

    If it is `uncertain` by as much as its size, it is given as a bound; see `plus_minus`.
    """
    if 0.0 < abs(value) <= uncertain < math.inf:
        return plus_minus(value, uncertain)
    return _with_digits(value, UNKNOWN_DIGITS)


def _with_digits(value: float, digits: int) -> str:
    """Format a value with so many significant digits, without a power of ten up to a million."""
    rounded = float(f"{value:.{digits}g}")
    if rounded == 0.0 or not math.isfinite(rounded):
        return f"{rounded:g}"
    before = math.floor(math.log10(abs(rounded))) + 1
    return f"{rounded:#.{max(digits, before) if before <= 6 else digits}g}".rstrip(".")


def shown(certificate: Certificate | None, name: str, value: float, unit: str) -> str:
    """Format a figure: from the certificate, with its error, if that has one of its name."""
    for figure in certificate.headline if certificate else ():
        if figure.name == name and math.isfinite(figure.error):
            return str(figure)
    factor, symbol = displayed(unit)
    return f"{alone(factor * value)} {symbol}".rstrip()


@dataclass(frozen=True)
class Certificate(Described):
    """The figures of a run with their errors, and the further runs that gave these."""

    figures: tuple[CertifiedFigure, ...]
    runs: tuple[str, ...] = ()
    """Descriptions of the further runs."""
    note: str = ""
    """A remark for the reader."""
    strict: bool = True
    """Whether the errors are from several finer runs, or estimated from two, in doubt three."""

    def __getitem__(self, name: str) -> CertifiedFigure:
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
        """The figures that are printed; the others are measures of the paper's claims."""
        return [figure for figure in self.figures if figure.name.startswith(HEADLINE)]

    @property
    def marked(self) -> list[CertifiedFigure]:
        return [figure for figure in self.figures if figure.marked]

    def __str__(self) -> str:
        lines = [f"  numerical errors, {self.origin}:"] if self.runs else []
        marks = {True: "<- error above 5 %", False: ""}
        rows = [(figure.name, str(figure), marks[figure.marked]) for figure in self.headline]
        lines += [f"    {line}" for line in aligned(rows)]
        others = [figure for figure in self.marked if figure not in self.headline]
        if others:
            names = ", ".join(figure.name for figure in others)
            lines.append(f"    of the claims' measures above 5 %: {names}")
        if self.note:
            lines.append(f"  {'certificate' if self.strict else 'estimate'}: {self.note}")
        return "\n".join(lines)
