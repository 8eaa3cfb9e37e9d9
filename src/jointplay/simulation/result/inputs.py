"""The inputs of a run, declared once: files, scenarios, options and help are made of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import KW_ONLY, dataclass, field
from types import MappingProxyType

from jointplay.base.schema import Described, quantity
from jointplay.model.mechanism import Mechanism
from jointplay.model.payload import Payload
from jointplay.simulation.loads import Load
from jointplay.simulation.loads.drive import ComputedTorque, Drive, JointFriction
from jointplay.simulation.motion.reference import Motion
from jointplay.simulation.result.settings import Integration, LimitSettings, RecordSettings

FILES_DRIVES = ComputedTorque()
"""Stands for drives that nobody gave: those of the robot's file, else this one."""
FILES_LOADS: Mapping[str, Load] = MappingProxyType({})
"""Stands likewise for loads."""


@dataclass(frozen=True)
class Inputs(Integration, RecordSettings, LimitSettings, Described):
    """All inputs of a run."""

    mechanism: Mechanism
    """What moves."""
    motion: Motion | None = None
    """Reference of the joints whose drives follow one; other joints of an open tree are held where
    they start, unless there are drives by joint or their speed is given."""
    drive: Drive | Mapping[str, Drive] = FILES_DRIVES
    """One for all joints of the motion, or by joint; joints that are not named are then free. If
    none is given, those of an MJCF, and computed torque of all other joints of the motion."""
    _: KW_ONLY
    joint_friction: Mapping[str, JointFriction] | None = None
    """Friction by joint; None uses the URDF's <dynamics> entries."""
    payloads: tuple[Payload, ...] = ()
    """Bodies that frames pick up and release."""
    state: Mapping[str, float | tuple[float | None, float | None]] = quantity(
        "", default_factory=dict
    )
    """Position [rad or m], or position and speed, at the start, by name of a joint without
    reference or of any coordinate: ``joint.x`` and so on are the journal's own. None leaves
    one of the two open. In loops, what is not given follows."""
    loads: Mapping[str, Load] = field(default_factory=lambda: FILES_LOADS)
    """Other loads, each under a name of your choice: springs, wrenches, stops, controllers. If none
    are given, those of an MJCF."""
