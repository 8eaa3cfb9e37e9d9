"""In what two sweeps differ: whether an old store is of this one, or of this one made larger."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from jointplay.sweeps.plan import Plan
from jointplay.sweeps.sampling import GROWING

GROWS = ("samples", "repeats")
"""Keys of a sweep that may grow."""


def differences(old: Mapping[str, str], new: Mapping[str, str]) -> list[Any]:
    """In what two sweeps differ: key, and a few words."""
    changes = []
    for key in dict.fromkeys((*old, *new)):
        was, now = old.get(key, "not given"), new.get(key, "not given")
        if was != now:
            if key.startswith("file ") and "not given" not in (was, now):
                changes.append((key, f"{key} has changed"))
            else:
                changes.append((key, f"{key} is {_short(now)}, and was {_short(was)}"))
    return changes


def _short(text: str) -> str:
    return text if len(text) <= 80 else f"{text[:60]}...{text[-15:]}"


def grown(attrs: Mapping[str, Any], plan: Plan) -> set[str]:
    """Keys in which the plan is the old one made larger."""
    old, new = attrs["identity"], plan.identity
    keys = set()
    for word in GROWS:
        key = f"sweep.{word}"
        grows = word != "samples" or plan.sampling in GROWING
        if grows and json.loads(new.get(key, "0")) >= json.loads(old.get(key, "1")):
            keys.add(key)
    for key in new:
        if key.startswith("sweep.axes.") and key in old:
            was, now = json.loads(old[key]), json.loads(new[key])
            if isinstance(was, list) and isinstance(now, list) and now[: len(was)] == was:
                keys.add(key)
    same_dims = list(attrs["sizes"]) == list(plan.sizes)
    return keys if same_dims else set()
