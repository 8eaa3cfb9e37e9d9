"""What a joint that closes a loop locks, where nothing else in the loop does.

Pinocchio's constraints hold points or whole frames, not single freedoms. So the bearing carries one
more body, a carriage, which has the freedoms that the joint leaves; three points fix
the journal to it. The carriage takes part of the inertia of the journal's link: fixed to each
other, the two move exactly as that link did.
"""

from __future__ import annotations

from dataclasses import dataclass

import pinocchio as pin

from jointplay.errors import JointplayError

SHARE = 0.1
"""Part of the journal's inertia that the carriage takes."""

_CLOSED = {
    frozenset[str](): frozenset[str](),
    frozenset({"yaw"}): frozenset("xy"),
    frozenset({"pitch"}): frozenset("xz"),
    frozenset({"yaw", "pitch", "roll"}): frozenset("xyz"),
}
"""Translations that must be free with these rotations for the inverse motion to have the same
freedoms."""


@dataclass(frozen=True)
class Lock:
    """A carriage and what is fixed to it, by names that outlast a new build of the model."""

    carrier: str
    """Pinocchio joint whose body carries the carriage; ``universe`` for the ground."""
    placement: pin.SE3
    """Of the carriage's axes in that joint's frame."""
    freedoms: tuple[str, ...]
    """The carriage's."""
    held: str
    """Pinocchio joint whose body is fixed to the carriage."""
    frame: pin.SE3
    """What of it coincides with the carriage."""

    @classmethod
    def between(
        cls,
        name: str,
        freedoms: tuple[str, ...],
        model: pin.Model,
        bearing: tuple[int, pin.SE3],
        journal: tuple[int, pin.SE3],
    ) -> Lock:
        """For loop `name`, whose joint leaves `freedoms`, between two frames of `model`.

        Raises:
            JointplayError: the journal belongs to the ground, and freedoms are not the same seen
                from there; or its link has no mass.
        """
        carrier, held = bearing, journal
        if journal[0] == 0:
            turns = frozenset(freedoms) - frozenset("xyz")
            if turns not in _CLOSED or not _CLOSED[turns] <= frozenset(freedoms):
                raise JointplayError(
                    f"loop {name!r} locks freedoms against a journal that belongs to the ground; "
                    "exchange bearing_link and journal_link"
                )
            carrier, held = journal, bearing
        if not model.inertias[held[0]].mass > 0.0:
            raise JointplayError(
                f"loop {name!r} locks freedoms of a link without mass; give it some"
            )
        return cls(model.names[carrier[0]], carrier[1], freedoms, model.names[held[0]], held[1])

    def share(self, model: pin.Model, carriage: int) -> tuple[int, pin.SE3]:
        """Move part of the inertia of what is held to the carriage.

        Returns:
            Pinocchio joint and frame of what is held.
        """
        at = int(model.getJointId(self.held))
        whole = model.inertias[at].copy()  # what Pinocchio gives changes with the model
        model.inertias[at] = _scaled(whole, 1.0 - SHARE)
        model.inertias[carriage] = self.frame.actInv(_scaled(whole, SHARE))
        return at, self.frame


def _scaled(inertia: pin.Inertia, factor: float) -> pin.Inertia:
    return pin.Inertia(factor * inertia.mass, inertia.lever, factor * inertia.inertia)
