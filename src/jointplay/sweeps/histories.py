"""Time histories in the store of a sweep: arrays over its dimensions, the time, and axes or joints.

Cases can differ in length and in joints: an array grows as needed, and what a case has not is NaN.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.sweeps.case import History
from jointplay.sweeps.plan import Index

if TYPE_CHECKING:
    from jointplay.sweeps.store import Store

SUFFIX = "_history"
"""What the names of the arrays end with."""


def write(store: Store, name: str, index: Index, history: History) -> None:
    """Write a variable of a case's result.

    A chunk is one case, so that writing it again, after a kill, gives what it was.

    Args:
        store: where.
        name: of the variable.
        index: the case.
        history: its values; without attributes if the case does not have the variable.
    """
    if not history.attrs:
        return
    key, group = name + SUFFIX, store.group
    values = np.asarray(history.values, float)
    if key not in group:
        tail = dict(zip(history.dims, values.shape, strict=True))
        unit, text = (str(history.attrs.get(word, "")) for word in ("units", "long_name"))
        store.array(key, "float64", np.nan, text, unit, tail)
    array = group[key]
    places = [_places(store, d, history) for d in history.dims]
    sizes = array.shape[len(index) :]
    needed = [max(int(p.max(initial=-1)) + 1, size) for p, size in zip(places, sizes, strict=True)]
    if tuple(needed) != tuple(sizes):
        array.resize((*array.shape[: len(index)], *needed))
    block = np.full(needed, np.nan)
    block[np.ix_(*places)] = values
    array[index] = block


def _places(store: Store, dimension: str, history: History) -> np.ndarray:
    """Positions of a case's labels along a dimension, to which new ones are added."""
    own: list[Any] = np.asarray(history.labels[dimension]).tolist()
    known: list[Any] = []
    if dimension in store.group:
        known = np.asarray(store.group[dimension][...]).tolist()
    if dimension == "time":  # the longest case has the times of all, if records are as frequent
        if len(own) > len(known):
            store.labels(dimension, dimension, np.asarray(own), {"units": "s"})
        return np.arange(len(own))
    new = [label for label in own if label not in known]
    if new:
        known += new
        store.labels(dimension, dimension, np.asarray(known), {})
    return np.array([known.index(label) for label in own], int)
