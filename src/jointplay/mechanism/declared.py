"""What a URDF says of its joints beyond the tree: limits, mimicry, transmissions.

yourdfpy reads it, from the URDF without its pictures: no mesh is looked for, no file opened. It is
slow to import and comes with the first question.
"""

from __future__ import annotations

import io
import xml.etree.ElementTree as ElementTree
from collections.abc import Collection
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

from jointplay.errors import JointplayError

if TYPE_CHECKING:
    import yourdfpy

_PICTURES = ("visual", "collision")
_READ = ("link", "joint")
"""Elements of a robot that are read."""
_SEEN = ("link", "joint", "material")
"""Elements of a robot that its pictures need."""


class Limits(NamedTuple):
    """Limits of a joint; None where there are none."""

    lower: float | None = None
    upper: float | None = None
    speed: float | None = None
    effort: float | None = None


class Mimic(NamedTuple):
    """A joint follows another: its position is multiplier * that of the leader + offset."""

    leader: str
    multiplier: float
    """[1, or rad/m or m/rad where one of them slides]."""
    offset: float
    """[rad or m]."""

    def formula(self) -> str:
        """Its position, as one would write it."""
        factor = "" if self.multiplier == 1.0 else f"{self.multiplier:g} "
        sign = "+" if self.offset > 0.0 else "-"
        return f"{factor}{self.leader}" + (f" {sign} {abs(self.offset):g}" if self.offset else "")


@dataclass(frozen=True)
class Transmission:
    """What stands between a motor and a joint."""

    name: str
    reduction: float | None
    """Turns of the motor for one of the joint; None if it is not given."""


class Declared:
    """All that a URDF declares, read when it is asked for.

    Args:
        text: the URDF, whose names and numbers have been checked.
    """

    def __init__(self, text: str) -> None:
        """Keep the text."""
        self._text = text

    @cached_property
    def robot(self) -> yourdfpy.urdf.Robot:
        """yourdfpy's reading: links with inertials only, joints with all they have.

        Raises:
            JointplayError: yourdfpy cannot read it.
        """
        return self._read(_READ, _PICTURES, "the URDF")

    @cached_property
    def pictured(self) -> yourdfpy.urdf.Robot:
        """yourdfpy's reading of the links with their visuals, meshes unread.

        Raises:
            JointplayError: yourdfpy cannot read it.
        """
        return self._read(_SEEN, (), "the URDF's visuals")

    def _read(self, read: Collection[str], left_out: Collection[str], of: str) -> Any:
        """Read some elements of the robot, their links without others."""
        import yourdfpy

        root = ElementTree.fromstring(self._text)
        part = ElementTree.Element("robot", {"name": root.get("name", "robot")})
        part.extend(element for element in root if element.tag in read)
        for link in part.findall("link"):
            for element in [one for one in link if one.tag in left_out]:
                link.remove(element)
        text = io.BytesIO(ElementTree.tostring(part))
        try:
            return yourdfpy.URDF.load(text, build_scene_graph=False, load_meshes=False).robot
        except (ValueError, TypeError, KeyError, AttributeError, IndexError) as error:
            raise JointplayError(f"yourdfpy cannot read {of}: {error}") from None

    @cached_property
    def _joints(self) -> dict[str, Any]:
        return {joint.name: joint for joint in self.robot.joints}

    def limits(self, name: str) -> Limits:
        """Limits of a joint; exporters write zeros, or twice the same, where they know none."""
        joint = self._joints[name]
        limit = joint.limit
        if limit is None or joint.type in ("fixed", "floating", "ball"):
            return Limits()
        lower, upper = limit.lower or 0.0, limit.upper or 0.0
        speed, effort = limit.velocity or None, limit.effort or None
        if not lower < upper or joint.type == "continuous":
            return Limits(None, None, speed, effort)
        return Limits(lower, upper, speed, effort)

    def mimic(self, name: str) -> Mimic | None:
        """What a joint follows; None if nothing."""
        mimic = self._joints[name].mimic
        return None if mimic is None else Mimic(mimic.joint, mimic.multiplier, mimic.offset)

    @cached_property
    def transmissions(self) -> dict[str, Transmission]:
        """By joint. yourdfpy (0.0.60) leaves them out."""
        transmissions = {}
        for element in ElementTree.fromstring(self._text).findall("transmission"):
            texts = [one.text for one in element.iter("mechanicalReduction")]
            try:
                reduction = float(texts[0]) if texts and texts[0] else None
            except ValueError:
                reduction = None
            for joint in element.findall("joint"):
                transmissions[joint.get("name", "")] = Transmission(
                    element.get("name", ""), reduction
                )
        return transmissions
