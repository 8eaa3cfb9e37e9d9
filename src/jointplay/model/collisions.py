"""Self-collision of a robot, by the collision shapes of its URDF and Pinocchio's coal."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np
import pinocchio as pin

from jointplay.base.tables import few
from jointplay.model.mechanism import Mechanism


class SelfCollision:
    """Pairs of a robot's collision shapes that must not meet, in its ideal mechanism.

    Left out are pairs of links that a joint joins, pairs that an SRDF in a folder ``srdf`` beside
    the URDF's folder disables, and pairs that touch in the neutral pose, as shapes that are drawn
    too large do.

    Attributes:
        notes: lines on pairs that were left out, or that there are no shapes.
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self._mechanism = mechanism.ideal()
        model = self._mechanism.model
        geometry = self._mechanism.collision_model.copy()  # with pairs of its own
        self.notes: tuple[str, ...] = ()
        self._geometry = geometry
        if geometry.ngeoms < 2:
            self.notes = (
                "self-collision was not checked: the URDF has no collision geometry that can be "
                "read",
            )
            return
        shapes = geometry.geometryObjects
        pairs = [
            (a, b)
            for a in range(geometry.ngeoms)
            for b in range(a + 1, geometry.ngeoms)
            if not _joined(model, shapes[a].parentJoint, shapes[b].parentJoint)
        ]
        allowed = set(pairs) - self._disabled(pairs)
        for pair in sorted(allowed):
            geometry.addCollisionPair(pin.CollisionPair(*pair))
        touching = self._pairs(pin.neutral(model))
        for pair in touching:
            geometry.removeCollisionPair(pin.CollisionPair(*pair))
        if touching:
            names = [" and ".join(self._link(k) for k in pair) for pair in touching]
            text = few(list(dict.fromkeys(names)))
            self.notes = (f"not checked for self-collision, for they touch at zero: {text}",)

    def hits(self, positions: Mapping[str, float]) -> bool:
        """Whether the robot hits itself with its joints at these positions [rad or m]."""
        if not len(self._geometry.collisionPairs):
            return False
        return bool(self._pairs(self._mechanism.configuration(positions), first=True))

    def _pairs(self, q: np.ndarray, first: bool = False) -> list[tuple[int, int]]:
        """Pairs that touch in a configuration (nq,); with `first` one is enough."""
        model, data = self._mechanism.model, self._mechanism.data
        results = pin.GeometryData(self._geometry)
        pin.computeCollisions(model, data, self._geometry, results, q, first)
        return [
            (int(pair.first), int(pair.second))
            for pair, result in zip(
                self._geometry.collisionPairs, results.collisionResults, strict=True
            )
            if result.isCollision()
        ]

    def _link(self, shape: int) -> str:
        frame = self._geometry.geometryObjects[shape].parentFrame
        return str(self._mechanism.model.frames[frame].name)

    def _disabled(self, pairs: Iterable[tuple[int, int]]) -> set[tuple[int, int]]:
        """Pairs that SRDFs beside the URDF disable."""
        import xml.etree.ElementTree as ElementTree

        path = self._mechanism.description.path
        if self._mechanism.description.stored:
            return set()
        disabled: set[frozenset[str]] = set()
        for file in sorted((path.parent.parent / "srdf").glob("*.srdf")):
            if file.stem.split(".")[0].removesuffix("_robot") not in path.stem:
                continue
            try:
                root = ElementTree.parse(file).getroot()
            except (ElementTree.ParseError, OSError):
                continue
            for element in root.iter("disable_collisions"):
                disabled.add(frozenset((element.get("link1", ""), element.get("link2", ""))))
        return {pair for pair in pairs if frozenset(map(self._link, pair)) in disabled}


def _joined(model: pin.Model, a: int, b: int) -> bool:
    """Whether the bodies of two Pinocchio joints are the same, or joined by a joint."""
    return a == b or model.parents[a] == b or model.parents[b] == a
