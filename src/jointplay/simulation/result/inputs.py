"""The inputs of a run, declared once: files, scenarios, options and help are made from them."""

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
"""Default of the drives: those of the robot's file, or else this one."""
FILES_LOADS: Mapping[str, Load] = MappingProxyType({})
"""Default of the loads: those of the robot's file."""


@dataclass(frozen=True)
class Inputs(Integration, RecordSettings, LimitSettings, Described):
    """All inputs of a run."""

    mechanism: Mechanism
    """The robot or linkage, with its clearance."""
    motion: Motion | None = None
    """Reference motion of the joints whose drives follow one; other joints of an open tree are held
    where they start, unless there are drives by joint or their speed is given."""
    drive: Drive | Mapping[str, Drive] = FILES_DRIVES
    """One drive for all joints of the motion, or drives by joint; joints that are not named are
    then free. If none is given, the drives of an MJCF, and computed torque for all other joints of
    the motion."""
    _: KW_ONLY
    joint_friction: Mapping[str, JointFriction] | None = None
    """Friction by joint; None uses the URDF's <dynamics> entries."""
    payloads: tuple[Payload, ...] = ()
    """Bodies that frames pick up and release."""
    state: Mapping[str, float | tuple[float | None, float | None]] = quantity(
        "", default_factory=dict
    )
    """Position [rad or m], or position and speed, at the start, by name of a joint without
    reference or of any coordinate: ``joint.x`` and so on are the journal's own. None leaves one of
    the two open. In loops, coordinates that are not given follow."""
    loads: Mapping[str, Load] = field(default_factory=lambda: FILES_LOADS)
    """Other loads, each under a name of your choice: springs, wrenches, stops, controllers. If none
    are given, those of an MJCF."""
