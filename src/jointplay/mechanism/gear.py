"""Play in a drive: a motor, and the gear between it and its joint."""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.core.schema import Described, check_fields, quantity


@dataclass(frozen=True)
class Gear(Described):
    """A motor that turns its joint through a gear with backlash.

    The motor becomes a coordinate of its own, ``<joint>.motor``. Within the play no torque passes;
    beyond, the teeth are a spring and a damper in parallel that never pull. All quantities are
    referred to the joint's side: an inertia J behind a ratio N counts N^2 J. The rotor's gyroscopic
    effect is left out. Reference: M. Nordin, P.-O. Gutman, Automatica 38 (2002) 1633-1649.

    Raises:
        JointplayError: a value that is negative, zero where it must not be, or not finite.
    """

    play: float = quantity("rad", least=0.0, words="gear play")
    """Angle by which the joint turns freely while the motor stands [rad]."""
    rotor_inertia: float = quantity("kg*m^2", above=0.0, words="rotor inertia")
    """Inertia of the rotor, referred to the joint [kg m^2]."""
    stiffness: float = quantity("N*m/rad", above=0.0, words="gear stiffness")
    """Stiffness of the teeth in contact and the shaft [N m/rad]."""
    damping: float = quantity("N*m*s/rad", default=0.0, least=0.0, words="gear damping")
    """Damping of the teeth in contact and the shaft [N m s/rad]."""

    def __post_init__(self) -> None:
        """Check the values."""
        check_fields(self)
