"""Gear pairs: two joints coupled through teeth with play, as two gears or rack and pinion."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from jointplay.base.errors import JointplayError, require_known
from jointplay.base.schema import OptionalQuantity, Quantity, quantity
from jointplay.model.urdf import Mimic
from jointplay.physics.kernel.constants import ALWAYS, IF_PRESSED, NEVER
from jointplay.simulation.loads import base

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism
    from jointplay.simulation.motion.reference import Motion


def _teeth_law(time: Any, x: Any, dx: Any, p: Any, out: Any) -> None:
    """p: stiffness, damping, half of the play, ratio, offset. Teeth with play never pull."""
    twist = x[0] - p[3] * x[1] - p[4]
    rate = dx[0] - p[3] * dx[1]
    if p[2] == 0.0:
        torque = p[0] * twist + p[1] * rate
    elif twist > p[2]:
        torque = max(p[0] * (twist - p[2]) + p[1] * rate, 0.0)
    elif twist < -p[2]:
        torque = min(p[0] * (twist + p[2]) + p[1] * rate, 0.0)
    else:
        torque = 0.0
    out[0] = -torque
    out[1] = p[3] * torque


@dataclass(frozen=True)
class GearPair(base.OnJoint):
    """Two meshing gears: `joint` follows `leader` as q = ratio q_leader + offset, within play.

    Beyond the play, teeth are a spring and a damper, which never pull; without play they act both
    ways. The law is that of Modelica's ElastoBacklash2 (Rotational.Components of its standard
    library). All is referred to `joint`; -ratio times its torque acts on the leader.

    Either gear may be driven, or neither. Bearings do not feel the force of the teeth. A gear whose
    start neither the motion nor a state gives begins where the other one puts it, in the middle of
    the play.
    """

    kind: ClassVar[str] = "gear-pair"
    stores: ClassVar[bool] = True

    leader: str | None = None
    """Joint that `joint` follows. Give it with `ratio`, or neither: then both are those of the
    URDF's mimic."""
    _: KW_ONLY
    ratio: OptionalQuantity = quantity("", default=None, label="gear ratio")
    """Speed of `joint` over the leader's, negative for external teeth: -z_leader/z_joint [1, or
    rad/m or m/rad where one of them slides]."""
    offset: OptionalQuantity = quantity("rad", "m", default=None)
    """Position of `joint` with the leader at 0, in the middle of the play [rad or m]; 0 or the
    mimic's if not given."""
    play: Quantity = quantity("rad", "m", default=0.0, least=0.0, label="play of teeth")
    """Play of `joint` with the leader held, from one flank to the other [rad or m]."""
    stiffness: Quantity = quantity("N*m/rad", "N/m", above=0.0)
    """Stiffness of the teeth [N m/rad, or N/m for prismatic joints]."""
    damping: Quantity = quantity("N*m*s/rad", "N*s/m", default=0.0, least=0.0)
    """Damping of the teeth [N m s/rad or N s/m]."""
    centre_distance: OptionalQuantity = quantity("m", default=None, above=0.0)
    """Distance of the axes; if given, results have the force of the teeth [m]."""
    pressure_angle: Quantity = quantity("rad", default=math.radians(20.0), least=0.0)
    """Angle between that force and the common tangent of the pitch circles, 20 degrees if not given
    [rad]."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.leader == self.joint:
            raise JointplayError(f"joint {self.joint!r} cannot mesh with itself", ("leader",))
        if self.ratio == 0.0:
            raise JointplayError("gear ratio must not be zero", ("ratio",))
        if (self.leader is None) != (self.ratio is None):
            lacking = "leader" if self.leader is None else "ratio"
            raise JointplayError(
                f"gears that mesh with {self.joint!r} need leader and ratio, or neither to take "
                f"them from the URDF's mimic; {lacking} is missing",
                (lacking,),
            )
        if self.pressure_angle >= math.radians(45.0):
            degrees = math.degrees(self.pressure_angle)
            raise JointplayError(
                f"pressure angle must be below 45 degrees, got {degrees:g}", ("pressure_angle",)
            )

    def follows(self, mechanism: Mechanism) -> Mimic:
        """Leader, ratio and offset of `joint`; refused if not given, or impossible for gears."""
        for name in (self.joint, self.leader or self.joint):
            require_known("moving joint", name, mechanism.joints)
        entries = mechanism.description.joints
        mimic = entries[self.joint].mimic
        if self.leader is not None and self.ratio is not None:
            mimic = Mimic(self.leader, self.ratio, 0.0)
        elif mimic is None:
            raise JointplayError(
                f"gears at {self.joint!r} need leader and ratio: the URDF has it mimic no joint"
            )
        elif mimic.leader not in mechanism.joints:
            raise JointplayError(
                f"{self.joint!r} mimics {mimic.leader!r}, which does not move: nothing to mesh with"
            )
        if self.centre_distance is not None:
            slides = [name for name in (self.joint, mimic.leader) if entries[name].slides]
            if slides:
                raise JointplayError(
                    f"{slides[0]!r} slides: gears have no centre distance there",
                    ("centre_distance",),
                )
            if mimic.multiplier == 1.0:
                raise JointplayError(
                    "gears of the ratio 1, which turn the same way, have no centre distance",
                    ("centre_distance",),
                )
        return mimic if self.offset is None else mimic._replace(offset=self.offset)

    def site(self, mechanism: Mechanism) -> base.Site:
        mimic = self.follows(mechanism)
        both = mechanism.coordinate(self.joint), mechanism.coordinate(mimic.leader)
        return base.Site(both, both, levers=(1.0, -mimic.multiplier))

    def law(self) -> Callable[..., None]:
        return _teeth_law

    def numbers(self, mechanism: Mechanism) -> np.ndarray:
        _, ratio, offset = self.follows(mechanism)
        return np.array([self.stiffness, self.damping, 0.5 * self.play, ratio, offset])

    def implicit(self) -> int:
        if self.damping == 0.0:
            return NEVER
        return IF_PRESSED if self.play > 0.0 else ALWAYS

    def energy(self, x: np.ndarray, numbers: np.ndarray) -> np.ndarray:
        stiffness, _, half, ratio, offset = numbers
        twist = x[:, 0] - ratio * x[:, 1] - offset
        depth = np.maximum(np.abs(twist) - half, 0.0)
        return np.asarray(0.5 * stiffness * depth**2)

    def steepest(self) -> float:
        return self.stiffness

    def record(self, x: np.ndarray, answers: np.ndarray) -> Sequence[base.Series]:
        """Torque on `joint`; with a `centre_distance` also the force along the line of action.

        That is the sum of both gears' torques over the sum of their base radii (the difference, of
        internal teeth): the centre distance times the cosine of the pressure angle.
        """
        series = tuple(super().record(x, answers))
        if self.centre_distance is None:
            return series
        reach = self.centre_distance * math.cos(self.pressure_angle)
        force = np.copysign(answers.sum(axis=1) / reach, answers[:, 0])
        return *series, base.Series("force", force, "N")

    def tight(self) -> GearPair:
        return replace(self, play=0.0)

    def left_out(self) -> str:
        return "poses hold both joints of a gear pair, so its play does not count"


def led_by_teeth(load: base.Load, mechanism: Mechanism, motion: Motion) -> set[str]:
    """The joint of a gear pair that teeth lead, so that it needs no drive where a motion names
    others: the one that follows, or the leader where the motion names that.
    """
    if not isinstance(load, GearPair):
        return set()
    return {load.follows(mechanism).leader if load.joint in motion.joints else load.joint}
