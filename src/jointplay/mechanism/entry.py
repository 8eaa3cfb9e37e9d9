"""A joint as the URDF declares it."""

from __future__ import annotations

from dataclasses import dataclass, field

from jointplay.mechanism.declared import Declared, Mimic


@dataclass(frozen=True)
class JointEntry:
    """A joint as the URDF declares it."""

    name: str
    kind: str
    """URDF type: revolute, continuous, prismatic, fixed, ..."""
    parent: str
    child: str
    friction: float
    """Dry friction torque [N m or N]."""
    damping: float
    """Viscous friction [N m s/rad or N s/m]."""
    mimics: bool
    """Whether it follows another joint that exists, see `mimic`."""
    declared: Declared = field(compare=False, repr=False)
    """Where the rest of what the URDF says is read."""

    @property
    def turns(self) -> bool:
        """Whether it turns about an axis."""
        return self.kind in ("revolute", "continuous")

    @property
    def slides(self) -> bool:
        """Whether it is measured in metres, and its effort in newtons; else it turns."""
        return self.kind == "prismatic"

    @property
    def lower(self) -> float | None:
        """Lower limit of its position [rad or m]; None where there is none, or `upper`'s."""
        return self.declared.limits(self.name).lower

    @property
    def upper(self) -> float | None:
        """Upper limit of its position [rad or m]; likewise."""
        return self.declared.limits(self.name).upper

    @property
    def speed(self) -> float | None:
        """Limit of its speed [rad/s or m/s]; None where there is none, or 0."""
        return self.declared.limits(self.name).speed

    @property
    def effort(self) -> float | None:
        """Limit of its effort [N m or N]; likewise."""
        return self.declared.limits(self.name).effort

    @property
    def mimic(self) -> Mimic | None:
        """The joint that it follows, and how; None if it follows none."""
        return self.declared.mimic(self.name) if self.mimics else None
