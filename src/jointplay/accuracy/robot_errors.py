"""Errors of a robot besides play: of all its joints, of single ones, and typical of a class.

The numbers of a class are assumed, not measured on any robot, and every answer that uses them says
so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from jointplay.base.errors import JointplayError, require_known, within
from jointplay.base.schema import Described, OptionalQuantity, check_fields, choice, quantity
from jointplay.physics.joints.elasticity import ABOUT_AXIS, ALONG_AXIS, Elasticity

if TYPE_CHECKING:
    from jointplay.model.mechanism import Mechanism

CLASSES = ("calibrated-industrial", "industrial", "printed")
"""An industrial arm after geometric calibration; as delivered; a printed arm with hobby servos."""


@dataclass(frozen=True, kw_only=True)
class JointErrors(Described):
    """Errors of one joint besides its play; numbers not given are those of the robot."""

    encoder: OptionalQuantity = quantity("rad", "m", default=None, least=0.0, label="resolution")
    """Resolution of the encoder, at the joint [rad or m]."""
    zero_offset: OptionalQuantity = quantity(
        "rad", "m", default=None, least=0.0, label="zero offset"
    )
    """Largest error of the encoder's zero, to either side [rad or m]."""
    gear_error: OptionalQuantity = quantity("rad", "m", default=None, least=0.0, label="gear error")
    """Amplitude of the gear's transmission error [rad or m]."""
    axis_offset: OptionalQuantity = quantity("m", default=None, least=0.0, label="axis offset")
    """Largest offset of the axis along each of x, y, z, to either side [m]."""
    axis_tilt: OptionalQuantity = quantity("rad", default=None, least=0.0, label="axis tilt")
    """Largest tilt of the axis about x and y, to either side [rad]."""
    heating: OptionalQuantity = quantity("K", default=None, least=0.0, label="heating")
    """Largest rise of its link's temperature [K]."""
    torsional_stiffness: OptionalQuantity = quantity("N*m/rad", "N/m", default=None, above=0.0)
    """Stiffness of gear and shaft about (along) the axis [N m/rad or N/m]; if not given, that of
    the gear, or by a rule."""
    elasticity: Elasticity | None = None
    """Elasticity of housings and links at the joint, besides its bearing's; free in the direction
    in which the joint moves. Without it, a joint without bearing has the robot's
    ``tilt_stiffness``."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True)
class RobotErrors(Described):
    """Errors of a robot's joints besides play, all together and single ones, or of a class."""

    assumed: str | None = choice("class of errors", CLASSES, default=None)
    """Class of robots whose numbers are assumed where none are given: ``calibrated-industrial``,
    ``industrial`` or ``printed``."""
    encoder: OptionalQuantity = quantity("rad", default=None, least=0.0, label="resolution")
    """Resolution of the encoders of joints that turn, at the joint [rad]."""
    zero_offset: OptionalQuantity = quantity("rad", default=None, least=0.0, label="zero offset")
    """Largest error of these encoders' zeros, to either side [rad]."""
    gear_error: OptionalQuantity = quantity("rad", default=None, least=0.0, label="gear error")
    """Amplitude of the transmission error of gears of joints that turn [rad]."""
    axis_offset: OptionalQuantity = quantity("m", default=None, least=0.0, label="axis offset")
    """Largest offset of each axis along each of x, y, z, to either side [m]."""
    axis_tilt: OptionalQuantity = quantity("rad", default=None, least=0.0, label="axis tilt")
    """Largest tilt of each axis about x and y, to either side [rad]."""
    heating: OptionalQuantity = quantity("K", default=None, least=0.0, label="heating")
    """Largest rise of the links' temperature [K]."""
    expansion: OptionalQuantity = quantity("1/K", default=None, least=0.0, label="expansion")
    """Coefficient of thermal expansion of the links [1/K]."""
    stiffness_spread: OptionalQuantity = quantity("", default=None, least=0.0, label="spread")
    """Relative uncertainty of all stiffnesses, to either side."""
    tilt_stiffness: OptionalQuantity = quantity("N*m/rad", default=None, above=0.0)
    """Stiffness in tilt of joints without bearing or clearance of their own [N m/rad]."""
    torsional_stiffness: OptionalQuantity = quantity("N*m/rad", default=None, above=0.0)
    """Stiffness about the axes of joints that turn without gear [N m/rad]; if not given, by a
    rule."""
    joints: Mapping[str, JointErrors] = field(default_factory=dict)
    """Errors that differ at single joints."""

    def __post_init__(self) -> None:
        check_fields(self)
        if self.stiffness_spread is not None and self.stiffness_spread > 1.0:
            raise JointplayError(
                f"a stiffness spread is at most 1, got {self.stiffness_spread:g}",
                where=("stiffness_spread",),
            )


_ASSUMED: dict[str, tuple[Any, ...]] = {  # by the order of `CLASSES`; 4096 counts a turn
    "encoder": (5e-6, 5e-6, 1.53e-3),
    "zero_offset": (2e-5, 3e-4, 8e-3),
    "gear_error": (1.5e-4, 2.5e-4, 2e-3),
    "axis_offset": (5e-5, 3e-4, 5e-4),
    "axis_tilt": (5e-5, 3e-4, 4e-3),
    "stiffness_spread": (0.2, 0.3, 0.5),
    "heating": (10.0, 15.0, 20.0),
    "expansion": (2.3e-5, 2.3e-5, 7e-5),
    "tilt_stiffness": (5e5, 2e5, 300.0),
}
ERROR_CLASSES: Mapping[str, RobotErrors] = {
    name: RobotErrors(**{key: values[k] for key, values in _ASSUMED.items()})
    for k, name in enumerate(CLASSES)
}
"""Errors besides play by class of robots, for lack of other knowledge: assumed, of no source."""


def refuse_misfit(errors: RobotErrors, mechanism: Mechanism) -> None:
    """Refuse errors of unknown joints, and elasticities of another kind of joint."""
    for name, joint_errors in errors.joints.items():
        require_known("joint", name, mechanism.joints, where=("joints", name))
        slides = mechanism.description.joints[name].slides
        if joint_errors.elasticity is not None:
            with within("joints", name, "elasticity"):
                joint_errors.elasticity.require_free(ALONG_AXIS if slides else ABOUT_AXIS)
