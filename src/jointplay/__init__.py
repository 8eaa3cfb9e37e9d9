"""jointplay: mechanisms whose joints have play.

    import jointplay as jp

    bearing = jp.RevoluteClearance(radial_clearance=0.2e-3, axial_clearance=0.2e-3)
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    result = jp.simulate(robot, motion)

Here are the nouns of a simulation and what makes them. What acts is in `jp.loads`, laws of contact,
friction and films are in `jp.contact`, what results and mechanisms tell in `jp.analysis`. Modules
are loaded when a name is first used, so that `import jointplay` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from jointplay import moved as _moved

_moved.install()

_HOMES = {
    "CylindricalClearance": "joints",
    "Gear": "mechanism.gear",
    "JointplayError": "errors",
    "Loop": "mechanism.loop",
    "Material": "joints",
    "Measurement": "analysis.identify",
    "Mechanism": "mechanism",
    "Motion": "motion",
    "Payload": "mechanism.payload",
    "PrismaticClearance": "joints",
    "Result": "result",
    "RevoluteClearance": "joints",
    "Scenario": "scenario",
    "Simulation": "simulation",
    "SphericalClearance": "joints",
    "Status": "kernel",
    "identify": "analysis.identify",
    "material": "joints.materials",
    "oil": "joints.materials",
    "open_sweep": "sweeps",
    "robot_scenario": "scenario.robot",
    "shipped": "mechanism.urdf",
    "simulate": "simulation",
    "sweep": "sweeps",
}

_SHOWN = ("analysis", "contact", "loads")
_PACKAGES = (*_SHOWN, "geometry", "joints", "mechanism", "motion", "result", "scenario")

__all__ = sorted([*_HOMES, *_SHOWN])

if TYPE_CHECKING:
    from jointplay import analysis as analysis
    from jointplay import contact as contact
    from jointplay import loads as loads
    from jointplay.analysis.identify import Measurement as Measurement
    from jointplay.analysis.identify import identify as identify
    from jointplay.errors import JointplayError as JointplayError
    from jointplay.joints import CylindricalClearance as CylindricalClearance
    from jointplay.joints import Material as Material
    from jointplay.joints import PrismaticClearance as PrismaticClearance
    from jointplay.joints import RevoluteClearance as RevoluteClearance
    from jointplay.joints import SphericalClearance as SphericalClearance
    from jointplay.joints.materials import material as material
    from jointplay.joints.materials import oil as oil
    from jointplay.kernel import Status as Status
    from jointplay.mechanism import Mechanism as Mechanism
    from jointplay.mechanism.gear import Gear as Gear
    from jointplay.mechanism.loop import Loop as Loop
    from jointplay.mechanism.payload import Payload as Payload
    from jointplay.mechanism.urdf import shipped as shipped
    from jointplay.motion import Motion as Motion
    from jointplay.result import Result as Result
    from jointplay.scenario import Scenario as Scenario
    from jointplay.scenario.robot import robot_scenario as robot_scenario
    from jointplay.simulation import Simulation as Simulation
    from jointplay.simulation import simulate as simulate
    from jointplay.sweeps import open_sweep as open_sweep
    from jointplay.sweeps import sweep as sweep


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return importlib.import_module(f"jointplay.{name}")
    if name == "__version__":
        from importlib.metadata import version  # takes longer than all the rest of this

        return version("jointplay")
    if name in _moved.NAMES:
        return _moved.found("jointplay", name)
    if name not in _HOMES:
        raise AttributeError(f"module 'jointplay' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"jointplay.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, *(name for name in globals() if name.startswith("__"))]
