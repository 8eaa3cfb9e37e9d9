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
    "SphericalJoint": "joints",
    "Threlfall": "contact",
    "Torque": "loads.drive",
    "ZhangSharf": "contact",
    "ZhiyingQishao": "contact",
    "allocate": "analysis.allocate",
    "budget": "analysis.budget",
    "cartesian_motion": "motion.cartesian",
    "identify": "analysis.identify",
    "Status": "kernel",
    "material": "joints.materials",
    "oil": "joints.materials",
    "open_sweep": "sweeps",
    "plan_measurement": "analysis.identify",
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
    from jointplay.analysis.allocate import allocate as allocate
    from jointplay.analysis.budget import budget as budget
    from jointplay.analysis.identify import Measurement as Measurement
    from jointplay.analysis.identify import identify as identify
    from jointplay.analysis.identify import plan_measurement as plan_measurement
    from jointplay.analysis.reduce import reduce_joint as reduce_joint
    from jointplay.analysis.wear import wear_life as wear_life
    from jointplay.analysis.wear import worn_depth as worn_depth
    from jointplay.contact import Ambrosio as Ambrosio
    from jointplay.contact import Anagnostopoulos as Anagnostopoulos
    from jointplay.contact import BengisuAkay as BengisuAkay
    from jointplay.contact import BrownMcPhee as BrownMcPhee
    from jointplay.contact import CarvalhoMartins as CarvalhoMartins
    from jointplay.contact import Coulomb as Coulomb
    from jointplay.contact import CustomBristle as CustomBristle
    from jointplay.contact import CustomFilm as CustomFilm
    from jointplay.contact import CustomFriction as CustomFriction
    from jointplay.contact import CustomNormalForce as CustomNormalForce
    from jointplay.contact import Dahl as Dahl
    from jointplay.contact import DubowskyFreudenstein as DubowskyFreudenstein
    from jointplay.contact import Esdu78035 as Esdu78035
    from jointplay.contact import Flores as Flores
    from jointplay.contact import GharibHurmuzlu as GharibHurmuzlu
    from jointplay.contact import Goldsmith as Goldsmith
    from jointplay.contact import Gonthier as Gonthier
    from jointplay.contact import GonthierFriction as GonthierFriction
    from jointplay.contact import HerbertMcWhannell as HerbertMcWhannell
    from jointplay.contact import Hertz as Hertz
    from jointplay.contact import HuGuo as HuGuo
    from jointplay.contact import HuntCrossley as HuntCrossley
    from jointplay.contact import HuntCrossley1975 as HuntCrossley1975
    from jointplay.contact import Johnson as Johnson
    from jointplay.contact import KelvinVoigt as KelvinVoigt
    from jointplay.contact import LankaraniNikravesh as LankaraniNikravesh
    from jointplay.contact import LeeWang as LeeWang
    from jointplay.contact import LinearSpring as LinearSpring
    from jointplay.contact import Liu as Liu
    from jointplay.contact import LuGre as LuGre
    from jointplay.contact import Pereira as Pereira
    from jointplay.contact import PinkusSternlicht as PinkusSternlicht
    from jointplay.contact import Radzimovsky as Radzimovsky
    from jointplay.contact import ShortBearing as ShortBearing
    from jointplay.contact import Threlfall as Threlfall
    from jointplay.contact import ZhangSharf as ZhangSharf
    from jointplay.contact import ZhiyingQishao as ZhiyingQishao
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
