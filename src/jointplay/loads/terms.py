"""Terms of the energy balance: what loads do to it, in the words of results, charts and audit.

One entry for each power that the kernels count (`kernel.words.POWERS`). Results, the audit, the
certificate and the energy chart go through this list; a power without an entry is refused here.
"""

from __future__ import annotations

from dataclasses import dataclass

from jointplay.kernel import POWERS


@dataclass(frozen=True)
class Term:
    """Work that one kind of load has done since the start."""

    power: str
    """Which of the kernels' powers."""
    variable: str
    """Name of its time history in results."""
    label: str
    """What charts call it."""
    lost: bool = True
    """Whether it takes energy out of the mechanism; else it brings it in."""


TERMS = (
    Term("drive", "drive_work", "work of the drives", lost=False),
    Term("normal_dissipation", "normal_dissipation", "lost in normal contact"),
    Term("friction_dissipation", "friction_dissipation", "lost in sliding"),
    Term("joint_friction", "joint_friction_loss", "lost in joint friction"),
    Term("gear_dissipation", "gear_dissipation", "lost in gears"),
    Term("film_dissipation", "film_dissipation", "lost in oil"),
)
"""In the order of the kernels' powers."""

if tuple(term.power for term in TERMS) != POWERS:
    raise TypeError(f"the terms of the energy balance are not the kernels': {', '.join(POWERS)}")

LOSSES = tuple(term.variable for term in TERMS if term.lost)
"""Time histories of energy lost."""
