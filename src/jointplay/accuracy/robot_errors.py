"""Errors of a robot besides play: of all joints and of single ones, and what classes have of them.

Nothing of a class was measured on a robot: its numbers are assumed, and whatever uses them says so.
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
    """Errors of one joint besides its play; what is not given is that of the robot."""

    encoder: OptionalQuantity = quantity("rad", "m", default=None, least=0.0, label="resolution")
    """Resolution of the encoder, at the joint [rad or m]."""
    zero_offset: OptionalQuantity = quantity(
        "rad", "m", default=None, least=0.0, label="zero offset"
    )
    """How far the encoder's zero may be off, either way [rad or m]."""
    gear_error: OptionalQuantity = quantity("rad", "m", default=None, least=0.0, label="gear error")
    """Amplitude of the gear's own error [rad or m]."""
    axis_offset: OptionalQuantity = quantity("m", default=None, least=0.0, label="axis offset")
    """How far the axis may be off along each of x, y, z, either way [m]."""
    axis_tilt: OptionalQuantity = quantity("rad", default=None, least=0.0, label="axis tilt")
    """How far it may be tilted about x and y, either way [rad]."""
    heating: OptionalQuantity = quantity("K", default=None, least=0.0, label="heating")
    """By how much its link may become warmer [K]."""
    torsional_stiffness: OptionalQuantity = quantity("N*m/rad", "N/m", default=None, above=0.0)
    """About (along) the axis, of gear and shaft [N m/rad or N/m]; if not given, a gear's own, or by
    a rule."""
    elasticity: Elasticity | None = None
    """Of housings and links at the joint, besides its bearing's; free in the direction in which the
    joint moves. Of a joint without bearing, if not given, the robot's
    ``tilt_stiffness``."""

    def __post_init__(self) -> None:
        check_fields(self)


@dataclass(frozen=True, kw_only=True)
class RobotErrors(Described):
    """Errors of all joints of a robot besides play, and of single ones; else those of a class."""

    assumed: str | None = choice("class of errors", CLASSES, default=None)
    """Class of robots from which all that is not given is assumed: ``calibrated-industrial``,
    ``industrial`` or ``printed``."""
    encoder: OptionalQuantity = quantity("rad", default=None, least=0.0, label="resolution")
    """Resolution of the encoders of joints that turn, at the joint [rad]."""
    zero_offset: OptionalQuantity = quantity("rad", default=None, least=0.0, label="zero offset")
    """How far their zeros may be off, either way [rad]."""
    gear_error: OptionalQuantity = quantity("rad", default=None, least=0.0, label="gear error")
    """Amplitude of the error of their gears [rad]."""
    axis_offset: OptionalQuantity = quantity("m", default=None, least=0.0, label="axis offset")
    """How far each axis may be off along each of x, y, z, either way [m]."""
    axis_tilt: OptionalQuantity = quantity("rad", default=None, least=0.0, label="axis tilt")
    """How far it may be tilted about x and y, either way [rad]."""
    heating: OptionalQuantity = quantity("K", default=None, least=0.0, label="heating")
    """By how much links may become warmer [K]."""
    expansion: OptionalQuantity = quantity("1/K", default=None, least=0.0, label="expansion")
    """By how much they grow [1/K]."""
    stiffness_spread: OptionalQuantity = quantity("", default=None, least=0.0, label="spread")
    """Relative uncertainty of all stiffnesses, either way."""
    tilt_stiffness: OptionalQuantity = quantity("N*m/rad", default=None, above=0.0)
    """In tilt, of joints without bearing or clearance of their own [N m/rad]."""
    torsional_stiffness: OptionalQuantity = quantity("N*m/rad", default=None, above=0.0)
    """About the axes of joints that turn without gear [N m/rad]; by a rule if not given."""
    joints: Mapping[str, JointErrors] = field(default_factory=dict)
    """What differs at single joints."""

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
"""Errors besides play of robots of which nothing else is known: assumed, of no source."""


def refuse_misfit(errors: RobotErrors, mechanism: Mechanism) -> None:
    """Refuse errors of joints that there are not, and springs of another kind of joint."""
    for name, joint_errors in errors.joints.items():
        require_known("joint", name, mechanism.joints, where=("joints", name))
        slides = mechanism.description.joints[name].slides
        if joint_errors.elasticity is not None:
            with within("joints", name, "elasticity"):
                joint_errors.elasticity.require_free(ALONG_AXIS if slides else ABOUT_AXIS)
