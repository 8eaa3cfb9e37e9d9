"""The cases of docs/validation.md: each compares a run with what is known from elsewhere.

A section is a module; `case` registers a function of it. What a case is compared with is computed
in the case, from the literature or an independent integration, never taken from the package.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field

from matplotlib.figure import Figure

SECTIONS = (
    "theory", "impacts", "oil", "numerics", "literature", "outside", "public", "reproducibility"
)  # fmt: skip
"""Modules with cases, in the order of the page."""
ORIGINS = (
    "theory", "integrator", "literature", "engine", "commercial code", "experiment", "itself"
)  # fmt: skip
"""Where what a case is compared with comes from: a closed form or a statement of mechanics; an
integration written out in the case or of scipy; what a publication says in words; another engine;
one that is sold; a measurement; a run of this package with other settings."""


@dataclass(frozen=True)
class Outcome:
    """What a case found."""

    error: float
    """The one number by which the case is judged; what it is says `Case.measures`."""
    limit: float
    """It passes if the error is no larger."""
    table: Sequence[Sequence[str]] = ()
    """Header and rows of a table, if there is one."""
    figure: Figure | None = None
    notes: Sequence[str] = field(default_factory=tuple)
    """Paragraphs: what was found, and what is not understood."""

    @property
    def passed(self) -> bool:
        return self.error <= self.limit  # false for NaN


class Rows:
    """Rows of a table, and the errors by which its case is judged.

    Heads say how numbers are shown, behind a bar: ``"period [ms]|.4f"``; with none they are text.
    """

    def __init__(self, *heads: str) -> None:
        parts = [head.partition("|") for head in heads]
        self.table, self.forms = [[name for name, _, _ in parts]], [form for _, _, form in parts]
        self.errors: list[float] = []

    def add(self, *cells: float | str, errors: Iterable[float] = ()) -> None:
        pairs = zip(cells, self.forms, strict=True)
        self.table.append([one if isinstance(one, str) else format(one, f) for one, f in pairs])
        self.errors += errors

    def outcome(self, limit: float, figure: Figure | None = None, *notes: str) -> Outcome:
        """Judged by the largest error."""
        return Outcome(float(max(self.errors)), limit, self.table, figure, notes)


def off(found: float, theory: float) -> float:
    """Relative error."""
    return abs(found / theory - 1.0)


@dataclass(frozen=True)
class Case:
    """A comparison."""

    section: str
    name: str
    title: str
    origin: str
    """One of `ORIGINS`."""
    compared: str
    """What is compared with what, and where that is from."""
    measures: str
    """What the error is, with its unit."""
    wrong: str
    """The deliberate mistake that `run(..., wrong=True)` makes in what is compared with."""
    run: Callable[..., Outcome]
    """run(quick, wrong): `quick` is the short form of the tests."""


CASES: dict[str, Case] = {}


def case(
    origin: str, title: str, compared: str, measures: str, wrong: str
) -> Callable[..., Callable]:
    """Register a function ``name(quick, wrong) -> Outcome`` as a case; see `Case`."""

    def register(function: Callable[..., Outcome]) -> Callable[..., Outcome]:
        section = function.__module__.rpartition(".")[2]
        name = function.__name__
        if name in CASES:
            raise ValueError(f"two cases are called {name}")
        if origin not in ORIGINS:
            raise ValueError(f"{origin!r} is none of {', '.join(ORIGINS)}")
        CASES[name] = Case(section, name, title, origin, compared, measures, wrong, function)
        return function

    return register


def load() -> dict[str, Case]:
    """All cases by name, in the order of the page."""
    for section in SECTIONS:
        importlib.import_module(f"truth.validation.{section}")
    return CASES
