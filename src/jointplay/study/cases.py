"""Cases of the paper's study: the SCARA with and without clearance, balanced and loaded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

from jointplay.analysis.certification import add_certificate, figures
from jointplay.analysis.claims import Measures, measure
from jointplay.core import signals
from jointplay.kernel import Status
from jointplay.mechanism.urdf import GRAVITY as GRAVITY
from jointplay.mechanism.urdf import shipped
from jointplay.result.result import Result
from jointplay.scenario import Scenario
from jointplay.simulation.run import Run
from jointplay.simulation.saving import run_and_save
from jointplay.simulation.simulation import Simulation
from jointplay.study.outputs import FILES as FILES
from jointplay.study.outputs import JOINT as JOINT


@cache
def scenario() -> Scenario:
    """The study as a scenario file."""
    return Scenario.load(shipped("scara.toml"))


def _clearance(case: str) -> float | None:
    table: Any = scenario().model(case).joints[JOINT]
    given = table.fields
    return None if given.get("ideal") else float(given["radial_clearance"])


CASES = {case: _clearance(case) for case in scenario().cases}
"""Clearance C_r = C_a of each case [m] (Table 4)."""
VARIANTS = {"consistent": ("scara.urdf", ()), "as printed": ("scara_as_printed.urdf", ("arm1",))}
"""URDF and the links whose inertia no rigid body has, used because they were printed."""

ENSEMBLE_RECORD_EVERY = 50

EXPLICIT, EXPLICIT_STEP_S = "semi-implicit-euler", 1e-5
"""The explicit integration with a fixed step that the cases are run with for comparison."""
BESIDE = ("peak joint force", "RMS joint force", "dissipated energy")
"""Figures of it that are shown."""
DIFFERS = 0.01
"""A figure differs if it does by more than this part, and by more than its error."""


@dataclass(frozen=True)
class Condition:
    """Gravity and inertia variant under which the claims are judged."""

    gravity: str
    variant: str

    def __str__(self) -> str:
        """Name in tables."""
        return f"{self.gravity}, {self.variant}"


CONDITIONS = tuple(Condition(gravity, variant) for gravity in GRAVITY for variant in VARIANTS)


def scara(
    clearance: float | None,
    condition: Condition = CONDITIONS[0],
    record_every: int = 10,
    seed: int | None = None,
) -> Simulation:
    """Set up one run of the paper's SCARA.

    Args:
        clearance: C_r = C_a [m], None for the ideal robot.
        condition: gravity and inertia variant.
        record_every: steps between records.
        seed: perturbs the journal's initial position; see `Simulation`.
    """
    urdf, unphysical = VARIANTS[condition.variant]
    robot = {"urdf": urdf, "gravity": condition.gravity, "allow_unphysical": list(unphysical)}
    changes: dict[str, Any] = {"robot": robot, "output": {"record_every": record_every}}
    if seed is not None:
        changes["integration"] = {"seed": seed}
    if clearance is None:
        return scenario().simulation("ideal", changes)
    # Any case with clearance will do: the clearance is all in which they differ.
    play = {"radial_clearance": clearance, "axial_clearance": clearance}
    return scenario().simulation("0.2 mm", changes | {"joints": {JOINT: play}})


@cache
def _ideal(condition: Condition) -> Result:
    return scara(None, condition, ENSEMBLE_RECORD_EVERY).run(estimate=False)


def perturbed(condition: Condition, label: str, seed: int) -> Measures:
    """Measures of one perturbed run of the case `label`."""
    run = scara(CASES[label], condition, ENSEMBLE_RECORD_EVERY, seed).run(estimate=False)
    return measure(run.completed(f"{condition}, {label}, seed {seed}"), _ideal(condition))


def length() -> float:
    """What a run simulates [s]."""
    motion = scara(None).motion
    assert motion is not None
    return motion.duration


def run_case(label: str, out: Path, progress: bool) -> Result:
    """Simulate one of the three cases, save it, and certify it.

    Raises:
        KeyboardInterrupt: after Ctrl-C, when the case has been saved as far as it came.
    """
    simulation = scara(CASES[label])
    run = Run(simulation, progress)
    run.label = f"case {label} "
    notes = {"title": scenario().title, "case": label}
    _, result = run_and_save(run, out / FILES[label], progress, notes)
    assert result is not None  # it is no long run
    if result.status == Status.INTERRUPTED or signals.stop_requested():
        raise KeyboardInterrupt
    add_certificate(result, out / FILES[label], simulation, progress, claims=True)
    if signals.stop_requested():
        raise KeyboardInterrupt
    return result


def explicit(label: str) -> dict[str, float]:
    """Figures of the case `label` by the explicit method with the paper's fixed step."""
    simulation = replace(scara(CASES[label]), integrator=EXPLICIT, step=EXPLICIT_STEP_S)
    result = simulation.run(estimate=False).completed(f"{label}, {EXPLICIT}")
    return {name: value for name, (value, _) in figures(result, None).items()}
