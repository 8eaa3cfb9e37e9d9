"""What becomes of the joints that a scenario's motion does not name."""

from __future__ import annotations

from typing import Any

from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.reference import Motion
from jointplay.motion.whole import whole
from jointplay.scenario.model import Model


def complete(
    model: Model, mechanism: Mechanism, motion: Motion, start: dict[str, float]
) -> tuple[Motion, list[str]]:
    """The motion with what it does not name held, or following; takes out of `start` what it uses.

    Joints of which [drives], a controller in [loads] or [start_speed] says something are left
    alone, and, where there are [drives] at all, those of which [start] does: they were meant to
    move.
    """
    shared: Any = model.drive
    if shared is not None and not shared.kind.follows:
        return motion, []
    entries = mechanism.description.joints
    drives: dict[str, Any] = dict(model.drives)
    followers = {name for name, entry in entries.items() if entry.mimics}
    alone = {
        name for name, draft in drives.items() if name not in followers or not draft.kind.follows
    } | set(model.start_speed)
    loads: dict[str, Any] = dict(model.loads)
    for load in loads.values():
        alone |= set(load.fields.get("joints", ()))  # a controller's
    if drives:
        alone |= set(start)
    added = whole(mechanism, motion, start, alone)
    for name in added.held:
        start.pop(name, None)
    return added.motion, added.told()
