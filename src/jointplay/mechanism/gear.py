"""Play in a drive: a motor, and the gear between it and its joint."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from jointplay.errors import require_non_negative, require_positive


@dataclass(frozen=True)
class Gear:
    """A motor that turns its joint through a gear with backlash.

    The motor becomes a coordinate of its own, ``<joint>.motor``. Within the play no torque passes;
    beyond, the teeth are a spring and a damper in parallel that never pull. All quantities are
    referred to the joint's side: an inertia J behind a ratio N counts N^2 J. The rotor's gyroscopic
    effect is left out. Reference: M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633-1649.

    Raises:
        JointplayError: a value that is negative, zero where it must not be, or not finite.
    """

    play: float
    """Angle by which the joint turns freely while the motor stands [rad]."""
    rotor_inertia: float
    """[kg m^2]."""
    stiffness: float
    """Of the teeth in contact and the shaft [N m/rad]."""
    damping: float = 0.0
    """Of the teeth in contact and the shaft [N m s/rad]."""

    def __post_init__(self) -> None:
        """Check the values."""
        require_non_negative("gear play", self.play, "rad")
        require_positive("rotor inertia", self.rotor_inertia, "kg m^2")
        require_positive("gear stiffness", self.stiffness, "N m/rad")
        require_non_negative("gear damping", self.damping, "N m s/rad")

    def describe(self) -> dict[str, Any]:
        """All fields as plain data."""
        return asdict(self)
