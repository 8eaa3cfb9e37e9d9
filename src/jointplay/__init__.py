"""jointplay: mechanisms whose joints have play.

    import jointplay as jp

    bearing = jp.ClearanceJoint(radial_clearance=0.2e-3, axial_clearance=0.2e-3)
    robot = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": bearing}, gravity=(0, 0, 0))
    motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
    result = jp.simulate(robot, motion)

Modules are loaded when a name is first used, so that `import jointplay` costs nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from jointplay.moved import install as _install

_install()

_HOMES = {
    "Ambrosio": "contact",
    "Anagnostopoulos": "contact",
    "Audit": "result.audit",
    "BengisuAkay": "contact",
    "BrownMcPhee": "contact",
    "CarvalhoMartins": "contact",
    "Certificate": "result.certificate",
    "ClearanceJoint": "joints",
    "CylindricalClearance": "joints",
    "ComputedTorque": "loads.drive",
    "Coulomb": "contact",
    "CustomBristle": "contact",
    "CustomFilm": "contact",
    "CustomFriction": "contact",
    "CustomNormalForce": "contact",
    "Dahl": "contact",
    "DubowskyFreudenstein": "contact",
    "Esdu78035": "contact",
    "Flores": "contact",
    "Form": "geometry",
    "Free": "loads.drive",
    "Gear": "mechanism.gear",
    "GharibHurmuzlu": "contact",
    "Goldsmith": "contact",
    "Gonthier": "contact",
    "GonthierFriction": "contact",
    "HerbertMcWhannell": "contact",
    "Hertz": "contact",
    "HuGuo": "contact",
    "HuntCrossley": "contact",
    "HuntCrossley1975": "contact",
    "Johnson": "contact",
    "JointFriction": "loads.drive",
    "JointplayError": "errors",
    "KelvinVoigt": "contact",
    "LankaraniNikravesh": "contact",
    "LeeWang": "contact",
    "LinearSpring": "contact",
    "Liu": "contact",
    "Loop": "mechanism.loop",
    "LuGre": "contact",
    "Material": "joints",
    "Measurement": "analysis.identify",
    "Mechanism": "mechanism",
    "Mode": "geometry",
    "Motion": "motion",
    "Payload": "mechanism.payload",
    "Pereira": "contact",
    "PinkusSternlicht": "contact",
    "Prescribed": "loads.drive",
    "PrismaticClearance": "joints",
    "PrismaticJoint": "joints",
    "Radzimovsky": "contact",
    "Result": "result",
    "RevoluteClearance": "joints",
    "Scenario": "scenario",
    "ShortBearing": "contact",
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
    "material": "joints.materials",
    "oil": "joints.materials",
    "open_sweep": "sweeps",
    "plan_measurement": "analysis.identify",
    "robot_scenario": "scenario.robot",
    "reduce_joint": "analysis.reduce",
    "shipped": "mechanism.urdf",
    "simulate": "simulation",
    "sweep": "sweeps",
    "wear_life": "analysis.wear",
    "worn_depth": "analysis.wear",
}

__all__ = sorted(_HOMES)

if TYPE_CHECKING:
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
    from jointplay.geometry import Form as Form
    from jointplay.geometry import Mode as Mode
    from jointplay.joints import ClearanceJoint as ClearanceJoint
    from jointplay.joints import CylindricalClearance as CylindricalClearance
    from jointplay.joints import Material as Material
    from jointplay.joints import PrismaticClearance as PrismaticClearance
    from jointplay.joints import PrismaticJoint as PrismaticJoint
    from jointplay.joints import RevoluteClearance as RevoluteClearance
    from jointplay.joints import SphericalClearance as SphericalClearance
    from jointplay.joints import SphericalJoint as SphericalJoint
    from jointplay.joints.materials import material as material
    from jointplay.joints.materials import oil as oil
    from jointplay.loads.drive import ComputedTorque as ComputedTorque
    from jointplay.loads.drive import Free as Free
    from jointplay.loads.drive import JointFriction as JointFriction
    from jointplay.loads.drive import Prescribed as Prescribed
    from jointplay.loads.drive import Torque as Torque
    from jointplay.mechanism import Mechanism as Mechanism
    from jointplay.mechanism.gear import Gear as Gear
    from jointplay.mechanism.loop import Loop as Loop
    from jointplay.mechanism.payload import Payload as Payload
    from jointplay.mechanism.urdf import shipped as shipped
    from jointplay.motion import Motion as Motion
    from jointplay.motion.cartesian import cartesian_motion as cartesian_motion
    from jointplay.result import Result as Result
    from jointplay.result.audit import Audit as Audit
    from jointplay.result.certificate import Certificate as Certificate
    from jointplay.scenario import Scenario as Scenario
    from jointplay.scenario.robot import robot_scenario as robot_scenario
    from jointplay.simulation import Simulation as Simulation
    from jointplay.simulation import simulate as simulate
    from jointplay.sweeps import open_sweep as open_sweep
    from jointplay.sweeps import sweep as sweep


def __getattr__(name: str) -> Any:
    if name == "loads":  # springs, wrenches and the like have their names there
        return importlib.import_module("jointplay.loads")
    if name not in _HOMES:
        raise AttributeError(f"module 'jointplay' has no attribute {name!r}")
    value = getattr(importlib.import_module(f"jointplay.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted(set(globals()) | set(_HOMES))
