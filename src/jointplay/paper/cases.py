"""Cases of the paper's study: the SCARA, ideal and with two clearances, and how they are run."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import signals
from jointplay.model.robots import shipped
from jointplay.model.urdf import GRAVITY as GRAVITY
from jointplay.paper.outputs import FILES as FILES
from jointplay.paper.outputs import JOINT as JOINT
from jointplay.physics.kernel import Status
from jointplay.physics.kernel.constants import DEFAULT
from jointplay.scenario import Scenario
from jointplay.simulation.analysis.claims import Measures, measure
from jointplay.simulation.analysis.headline import headline_of
from jointplay.simulation.analysis.tool_error import ideal_tool, measured_against
from jointplay.simulation.result.result import Result
from jointplay.simulation.run import Run
from jointplay.simulation.saving import run_and_save
from jointplay.simulation.simulation import Simulation
from jointplay.study.certification import add_errors


@cache
def scenario() -> Scenario:
    """The scenario of the study, as shipped."""
    return Scenario.load(shipped("scara.toml"))


_JOINTS: dict[str, Any] = {case: scenario().model(case).joints[JOINT] for case in scenario().cases}
CASES = {
    case: None if joint.fields.get("ideal") else float(joint.fields["radial_clearance"])
    for case, joint in _JOINTS.items()
}
"""Clearance C_r = C_a of each case [m] (Table 4)."""
VARIANTS = {"consistent": ("scara.urdf", ()), "as printed": ("scara_as_printed.urdf", ("arm1",))}
"""URDF of each inertia variant, and its links whose printed inertia no rigid body can have."""

_RECORD_EVERY = 50
"""Steps from record to record in the perturbed runs."""

JUDGED_FROM_S = 0.15
"""Time from which figures of the study are taken [s]: before, journals that fall under their weight
bounce at restitution 0.9 (0.14 s at 0.2 mm, 0.2 s at 0.5 mm; `simulation.run`)."""

EARLY_S = 0.5
EARLY = f"peak joint force, first {EARLY_S:g} s"
"""End [s] and name of a figure of the first strokes, before impacts have magnified small
differences."""

METHODS: dict[str, dict[str, Any]] = {
    "multi-rate, 10 µs": {"integrator": "multi-rate", "step": 1e-5},
    "semi-implicit-euler, 10 µs": {"integrator": "semi-implicit-euler", "step": 1e-5},
    "tolerance 1e-7": {"integrator": "multi-rate", "tolerance": 1e-7, "duration": EARLY_S},
}
"""Methods that integrate the cases, for comparison: the package's default; an explicit one with the
paper's fixed step; the paper's integration tolerance (Table 3), for the first strokes only, as it
takes ten times as long."""


@dataclass(frozen=True)
class Condition:
    """Direction of gravity and inertia variant under which cases are run and claims are judged."""

    gravity: str
    variant: str

    def __str__(self) -> str:
        return f"{self.gravity}, {self.variant}"


CONDITIONS = tuple(Condition(gravity, variant) for gravity in GRAVITY for variant in VARIANTS)


def scara(
    clearance: float | None,
    condition: Condition = CONDITIONS[0],
    record_every: int = 10,
    seed: int | None = None,
    integrator: str = DEFAULT,
) -> Simulation:
    """Simulation of the paper's SCARA with clearances C_r = C_a [m]; None: the ideal robot."""
    urdf, unphysical = VARIANTS[condition.variant]
    robot = {"urdf": urdf, "gravity": condition.gravity, "allow_unphysical": list(unphysical)}
    changes: dict[str, Any] = {"robot": robot, "output": {"record_every": record_every}}
    changes["integration"] = {"integrator": integrator} | ({} if seed is None else {"seed": seed})
    if clearance is None:
        return scenario().simulation("ideal", changes)
    # Any case with clearance will do, as only the clearance differs between them.
    play = {"radial_clearance": clearance, "axial_clearance": clearance}
    return scenario().simulation("0.2 mm", changes | {"joints": {JOINT: play}})


def judged(simulation: Simulation) -> Simulation:
    """The simulation judged from `JUDGED_FROM_S` on, if it has play and lasts longer."""
    duration = simulation.duration or (simulation.motion.duration if simulation.motion else 0.0)
    if not simulation.mechanism.clearance or duration <= JUDGED_FROM_S:
        return simulation
    return replace(simulation, judge_from=JUDGED_FROM_S)


@cache
def _ideal(condition: Condition, integrator: str) -> Result:
    simulation = scara(None, condition, _RECORD_EVERY, integrator=integrator)
    return Run(simulation).finish()


def perturbed(condition: Condition, label: str, seed: int, integrator: str = DEFAULT) -> Measures:
    """Measures of one perturbed run of the case `label`."""
    simulation = judged(scara(CASES[label], condition, _RECORD_EVERY, seed, integrator))
    run = Run(simulation).finish().completed(f"{condition}, {label}, seed {seed}")
    return measure(measured_against(run, _ideal(condition, integrator)))


def length() -> float:
    """Duration of the study's motion [s]."""
    motion = scara(None).motion
    assert motion is not None
    return motion.duration


def run_case(
    label: str,
    out: Path,
    progress: bool,
    condition: Condition = CONDITIONS[0],
    integrator: str = DEFAULT,
) -> Result:
    """Simulate one of the three cases, save it, and certify it.

    Raises:
        KeyboardInterrupt: Ctrl-C; the case has been saved as far as it came.
    """
    simulation = judged(scara(CASES[label], condition, integrator=integrator))
    file = out / FILES[label]
    run = Run(simulation, progress)
    run.label = f"case {label} "
    _, result = run_and_save(run, file, progress, {"title": scenario().title, "case": label})
    assert result is not None  # only long runs are left in their file alone
    if result.status == Status.INTERRUPTED or signals.stop_requested():
        raise KeyboardInterrupt
    add_errors(result, file, simulation, progress, claims=True)
    if signals.stop_requested():
        raise KeyboardInterrupt
    return result


@dataclass(frozen=True)
class MethodFigures:
    """Figures of a case by one of the `METHODS`."""

    figures: dict[str, float]
    """Figures by their names in certificates, and `EARLY`."""
    warnings: tuple[str, ...]
    """Warnings of the run's audit."""


def early_peak(result: Result) -> float:
    """Largest force at the joint from the time the run is judged until `EARLY_S` [N]."""
    name, at = "joint_force_peak", {"joint": JOINT}
    if not result.joints:
        name, at = "reaction_force", {"moving_joint": JOINT}
    time = (result.time >= result.judge_from) & (result.time <= EARLY_S)
    return float(np.linalg.norm(result[name].sel(at).values[time], axis=1).max(initial=0.0))


def _with(clearance: float | None, method: str, condition: Condition) -> Result:
    return Run(judged(replace(scara(clearance, condition), **METHODS[method]))).finish()


@cache
def _ideal_with(method: str, condition: Condition) -> Result:
    return _with(None, method, condition)


def by_method(label: str, method: str, condition: Condition = CONDITIONS[0]) -> MethodFigures:
    """Figures of the case `label` by one of the `METHODS`, against its ideal twin by the same."""
    result = _with(CASES[label], method, condition).completed(f"{label}, {method}")
    values = {EARLY: early_peak(result)}
    if METHODS[method].get("duration", np.inf) > EARLY_S:
        if CASES[label] is not None:
            result = measured_against(result, _ideal_with(method, condition))
        figures = headline_of(result, ideal_tool(result), claims=True)
        values |= {name: figure.value for name, figure in figures.items()}
    return MethodFigures(values, tuple(result.audit.warnings))
