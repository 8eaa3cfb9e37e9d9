"""Forces on a mechanism besides contact: drives, joint friction, and loads of any kind."""

from __future__ import annotations

from jointplay.base.schema import Family, register
from jointplay.simulation.loads.base import WORLD, Load
from jointplay.simulation.loads.controller import Controller
from jointplay.simulation.loads.drive import (
    ComputedTorque,
    Drive,
    Free,
    JointFriction,
    Prescribed,
    Servo,
    Torque,
)
from jointplay.simulation.loads.gear_pair import GearPair
from jointplay.simulation.loads.joint_friction import LoadedFriction
from jointplay.simulation.loads.spring import CurveSpring, Spring, Stop, TorsionSpring
from jointplay.simulation.loads.wrench import Wrench, WrenchFunction, WrenchOverTime

_KINDS = (
    *(Spring, CurveSpring, Wrench, WrenchOverTime, WrenchFunction, TorsionSpring, Stop),
    *(GearPair, Controller, LoadedFriction),
)
LOADS: dict[str, type[Load]] = {load.kind: load for load in _KINDS}
"""Kinds of load, by the word that selects each."""


register(Load, Family("kind", "load", LOADS, bare=False))


__all__ = [
    "LOADS",
    "WORLD",
    "ComputedTorque",
    "Controller",
    "CurveSpring",
    "Drive",
    "Free",
    "GearPair",
    "JointFriction",
    "Load",
    "LoadedFriction",
    "Prescribed",
    "Servo",
    "Spring",
    "Stop",
    "Torque",
    "TorsionSpring",
    "Wrench",
    "WrenchFunction",
    "WrenchOverTime",
]
