"""What every reader of a report must know, from `assumptions.toml`, and which of it holds when.

The same texts stand in docs/assumptions.md, written there by `python docs/site/assumptions.py`.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files

from jointplay import analysis
from jointplay.joints import JOINT_KINDS
from jointplay.report.cases import Case
from jointplay.report.html import Html, bullets, markup
from jointplay.report.naming import dark


@dataclass(frozen=True)
class Assumption:
    """A sentence or two."""

    when: str
    """In which runs it is made: a key of `conditions`."""
    text: str


@cache
def known() -> tuple[Assumption, ...]:
    """All of them, in the order in which reports have them."""
    text = (files("jointplay.report") / "assumptions.toml").read_text(encoding="utf-8")
    return tuple(Assumption(**one) for one in tomllib.loads(text)["assumption"])


def made(cases: Sequence[Case]) -> list[str]:
    """Texts of those that are made in these runs."""
    holds = conditions(cases)
    return [one.text for one in known() if holds[one.when]]


def conditions(cases: Sequence[Case]) -> dict[str, bool]:
    """Whether each thing that assumptions are about occurs in these runs."""
    inputs = [analysis.inputs(case.result) for case in cases]
    moving = [given for case, given in zip(cases, inputs, strict=True) if case.joints]
    bearings = [
        joint for case in cases for joint in analysis.clearance_inputs(case.result).values()
    ]
    kinds = {joint["kind"] for joint in bearings}
    return {
        "always": True,
        "clearance": bool(moving),
        "dry": any(not joint.get("lubricant") for joint in bearings),
        "oil": any(joint.get("lubricant") for joint in bearings),
        "worn": any(joint.get("worn") for joint in bearings),
        "wearing": any(joint.get("wear_rate") for joint in bearings),
        **{kind: kind in kinds for kind in JOINT_KINDS},
        "loops": any(given["mechanism"].get("loops") for given in inputs),
        "gears": any(given["mechanism"].get("gears") for given in inputs),
        "computed torque": any("computed-torque" in json.dumps(given["drive"]) for given in inputs),
        "prescribed": any("prescribed" in json.dumps(given["drive"]) for given in inputs),
        "payloads": any(given.get("payloads") for given in inputs),
        "loads": any(given.get("loads") for given in inputs),
        "cut": any(given.get("limits") == "cut" for given in inputs),
        "derived stiffness": any(
            joint.get("stiffness", 0.0) is None
            for given in moving
            for joint in given["mechanism"]["clearance"].values()
            if not joint.get("ideal")
        ),
        "centred": any(
            given.get("seed") is None and given.get("start") != "rest" for given in moving
        ),
        "rest": any(given.get("start") == "rest" for given in moving),
        "seeded": any(given.get("seed") is not None for given in moving),
        "balanced": any(not any(given["mechanism"].get("gravity", (1,))) for given in inputs),
        "unphysical": any(given["mechanism"].get("allow_unphysical") for given in inputs),
    }


def assumed(cases: Sequence[Case], start: float) -> Html:
    """What is assumed in these runs and in their evaluation."""
    points = made(cases)
    if start:
        points.append(
            f"Tool accuracy, peak force, contact statistics, shares of time and spectra are judged "
            f"from {start:g} s on; penetration and audit are those of whole runs."
        )
    points += [
        markup("{}: {}.", dark(case), case.result.audit.headline) for case in cases if case.joints
    ]
    for case in cases:
        points += [markup("{} {}", dark(case), note) for note in case.notes]
    return bullets(points)


def page_section() -> str:
    """The table that docs/assumptions.md has of them."""
    rows = [f"| {one.when} | {one.text} |" for one in known()]
    return "\n".join(["| runs with | assumed |", "| --- | --- |", *rows]) + "\n"
