"""The modelling assumptions of a report, from `assumptions.toml`, and the runs they hold for."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

from jointplay.model.gear import Gear
from jointplay.physics.joints import JOINT_KINDS
from jointplay.show.reports.cases import Case
from jointplay.simulation import analysis


@cache
def all_assumptions() -> tuple[tuple[str, str], ...]:
    """Each assumption's condition (a key of `conditions`) and sentence, in the reports' order."""
    text = (files("jointplay.show.reports") / "assumptions.toml").read_text(encoding="utf-8")
    by_condition = tomllib.loads(text).items()
    return tuple((when, sentence) for when, sentences in by_condition for sentence in sentences)


def conditions(cases: Sequence[Case]) -> dict[str, bool]:
    """By condition, whether any of these runs meets it."""
    runs = [analysis.inputs(case.result) for case in cases]
    machines = [run["mechanism"] for run in runs]
    loose = [run for case, run in zip(cases, runs, strict=True) if case.result.joints]
    joints = [joint for case in cases for joint in analysis.clearance_inputs(case.result).values()]
    gears = [gear for machine in machines for gear in (machine.get("gears") or {}).values()]
    kinds = {joint["kind"] for joint in joints}
    sliding = [joint for joint in joints if joint["kind"] in analysis.SLIDING_KINDS]
    drives = json.dumps([run["drive"] for run in runs])
    contacts = [j for run in loose for j in run["mechanism"]["clearance"].values()]
    return {
        "always": True,
        "clearance": bool(loose),
        "sliding": bool(sliding),
        "rolling": bool(kinds & analysis.ROLLING_KINDS),
        "dry": any(not joint.get("lubricant") for joint in sliding),
        "oil": any(joint.get("lubricant") for joint in joints),
        "worn": any(joint.get("worn") for joint in joints),
        "wearing": any(j.get("wear_rate") or j.get("journal_wear_rate") for j in joints),
        **{kind: kind in kinds for kind in JOINT_KINDS},
        "loops": any(machine.get("loops") for machine in machines),
        "gears": bool(gears),
        "refined gears": any(gear.get("kind", Gear.kind) != Gear.kind for gear in gears),
        "computed torque": "computed-torque" in drives,
        "prescribed": "prescribed" in drives,
        "payloads": any(run.get("payloads") for run in runs),
        "loads": any(run.get("loads") for run in runs),
        "cut": any(run.get("limits") == "cut" for run in runs),
        "derived stiffness": any(
            j.get("stiffness", 0.0) is None and not j.get("ideal") for j in contacts
        ),
        "centred": any(run.get("seed") is None and run.get("start") != "rest" for run in loose),
        "rest": any(run.get("start") == "rest" for run in loose),
        "seeded": any(run.get("seed") is not None for run in loose),
        "balanced": any(not any(machine.get("gravity", (1,))) for machine in machines),
        "unphysical": any(machine.get("allow_unphysical") for machine in machines),
    }
