"""What acts on a mechanism besides contact: drives, joint friction, and loads of any kind."""

from __future__ import annotations

from jointplay.base.schema import Family, register
from jointplay.simulation.loads.base import WORLD as WORLD
from jointplay.simulation.loads.base import Load as Load
from jointplay.simulation.loads.controller import Controller as Controller
from jointplay.simulation.loads.drive import ComputedTorque as ComputedTorque
from jointplay.simulation.loads.drive import Drive as Drive
from jointplay.simulation.loads.drive import Free as Free
from jointplay.simulation.loads.drive import JointFriction as JointFriction
from jointplay.simulation.loads.drive import Prescribed as Prescribed
from jointplay.simulation.loads.drive import Servo as Servo
from jointplay.simulation.loads.drive import Torque as Torque
from jointplay.simulation.loads.friction import LoadedFriction as LoadedFriction
from jointplay.simulation.loads.spring import CurveSpring as CurveSpring
from jointplay.simulation.loads.spring import Spring as Spring
from jointplay.simulation.loads.spring import Stop as Stop
from jointplay.simulation.loads.spring import TorsionSpring as TorsionSpring
from jointplay.simulation.loads.wrench import Wrench as Wrench
from jointplay.simulation.loads.wrench import WrenchFunction as WrenchFunction
from jointplay.simulation.loads.wrench import WrenchOverTime as WrenchOverTime

_KINDS = (Spring, CurveSpring, Wrench, WrenchOverTime, WrenchFunction, TorsionSpring, Stop)
LOADS: dict[str, type[Load]] = {load.kind: load for load in (*_KINDS, Controller, LoadedFriction)}
"""Kinds of load by the word that selects them."""


register(Load, Family("kind", "load", LOADS, bare=False))
