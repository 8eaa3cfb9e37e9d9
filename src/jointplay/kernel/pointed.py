"""A record of addresses, and the arrays to which it points: made, kept alive, and copied."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import numpy as np

from jointplay.errors import JointplayError

LEFT_OUT = "reference"
"""Array that a simulation makes again and no copy needs."""


class Pointed:
    """A record that points to arrays.

    Args:
        kind: of the record.
        rows: names of arrays of records, in which there are addresses, too.

    Attributes:
        run: the record, an array of one.
    """

    def __init__(self, kind: np.dtype, rows: Collection[str]) -> None:
        """Have the record, all zero."""
        self.run = np.zeros(1, kind)
        self._kept: list[np.ndarray] = []  # what the record points to must live as long
        self._arrays: dict[str, np.ndarray] = {}  # the same by name, but for Pinocchio's frames
        self._changing: list[np.ndarray] = []  # those that a macro step changes
        self._addresses: dict[str, set[str]] = {"run": set(), **{name: set() for name in rows}}

    def _set(self, **fields: float) -> None:
        for name, value in fields.items():
            self.run[name] = value

    def _point(self, name: str, array: np.ndarray) -> np.ndarray:
        """Let the record's field `name` point to an array."""
        self.run[name] = array.ctypes.data
        self._kept.append(array)
        self._arrays[name] = array
        self._addresses["run"].add(name)
        return array

    def _room(self, name: str, *shape: int) -> np.ndarray:
        """Let the record's field `name` point to an array of zeros."""
        return self._point(name, np.zeros(shape))

    def _point_row(self, row: np.ndarray, arrays: Mapping[str, np.ndarray], called: str) -> None:
        """Let fields of one of an array of records point to arrays, to be `called` so."""
        for name, array in arrays.items():
            row[name] = array.ctypes.data
            self._kept.append(array)
            self._arrays[called.format(name)] = array

    def _own(self) -> dict[str, np.ndarray]:
        own = {name: array for name, array in self._arrays.items() if name != LEFT_OUT}
        return own | {"run": self.run}

    def _taken(self) -> dict[str, np.ndarray]:
        """Copies of all arrays by name, without `LEFT_OUT`; addresses are zero."""
        copies = {name: array.copy() for name, array in self._own().items()}
        for name, fields in self._addresses.items():
            for field in fields:
                copies[name][field] = 0
        return copies

    def _put_back(self, kept: Mapping[str, np.ndarray]) -> None:
        """Write what `_taken` found into the arrays, all but the addresses.

        Raises:
            JointplayError: it is that of another simulation; nothing is written then.
        """
        own = self._own()
        for name, array in own.items():
            given = kept.get(name)
            if given is None or given.shape != array.shape or given.dtype != array.dtype:
                raise JointplayError(f"the state of {name!r} is not that of this simulation")
        for name, array in own.items():
            if array.dtype.names is None:
                np.copyto(array, kept[name])
                continue
            for field in set(array.dtype.names) - self._addresses.get(name, set()):
                array[field] = kept[name][field]
