"""How cases are named, and from when on they are judged."""

from __future__ import annotations

from collections.abc import Sequence

from jointplay.report.cases import Case
from jointplay.report.html import Html, markup


def dark(case: Case) -> Html:
    """The case's name with a swatch of its colour."""
    return markup('<span class="case" style="--c:{}">{}</span>', case.colour, case.label)


def settled(cases: Sequence[Case]) -> float:
    """From when on statistics are taken [s]: not while journals fall into their bearings."""
    latest = max(case.result.judge_from for case in cases)
    return latest if min(case.duration for case in cases) > latest else 0.0


def place_of(case: Case, joint: str, contact: str) -> Html:
    """The case and one of a joint's contacts."""
    return markup("{}, {}, {}", dark(case), joint, contact.replace("_", " "))
