"""Checks of a result file: whether its inputs, audit and histories can be what a run wrote.

Files come from anywhere. What is checked here, by the declarations of inputs, audit and histories,
need not be checked again by each reader.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay.base import schema
from jointplay.base.errors import JointplayError, damaged
from jointplay.model.free_base import BASE, FREE
from jointplay.model.mechanism import Mechanism
from jointplay.physics.joints import MOTOR, VIRTUAL_LINK, Coordinate
from jointplay.physics.kernel import Status
from jointplay.simulation.result.audit import Audit
from jointplay.simulation.result.certificate import Certificate
from jointplay.simulation.result.inputs import Inputs
from jointplay.simulation.result.variables import HISTORIES

if TYPE_CHECKING:
    import xarray as xr

_TEXTS = ("status", "message", "audit", "simulation", "values")
"""Attributes that must be there, as text."""

_AT_ONCE = 1 << 16
"""Number of times that are checked together."""


def stored_coordinates(mechanism: Mapping[str, Any]) -> dict[str, Coordinate]:
    """Coordinates of virtual links, carriages, motors and a free base of a described mechanism, by
    their names in results; any other coordinate is a joint's own.
    """
    loose = [*mechanism["clearance"], *([BASE] if mechanism.get("base") == FREE else [])]
    links = [(joint, part) for joint in loose for part in VIRTUAL_LINK]
    motors = [(joint, MOTOR) for joint in mechanism.get("gears") or {}]
    named = [Coordinate(joint, part) for joint, part in (*links, *motors)]
    return {str(coordinate): coordinate for coordinate in named}


def check(dataset: xr.Dataset, path: Path) -> None:
    """Refuse a file whose content no run can have written; the error names `path` and the fault."""
    try:
        _check_attributes(dataset)
        step = _described(dataset, "audit", Audit)["step"]
        description = _described(dataset, "simulation", Inputs)
        _require_all("simulation: mechanism", Mechanism, description["mechanism"])
        if step != description["step"]:
            raise JointplayError(
                f"its step is {description['step']!r} s in one place and {step!r} in another"
            )
        if "certificate" in dataset.attrs:
            certificate = _described(dataset, "certificate", Certificate)
            try:
                for figure in Certificate.from_description(certificate).figures:
                    str(figure)
            except (ArithmeticError, ValueError) as error:
                raise JointplayError(f"certificate: a figure is invalid: {error}") from None
        _check_histories(dataset, description)
    except JointplayError as error:
        raise damaged(path, "result", error) from None


def _check_attributes(dataset: xr.Dataset) -> None:
    for name in _TEXTS:
        if not isinstance(dataset.attrs.get(name), str):
            raise JointplayError(f"its attribute {name!r} is missing or not text")
    for name, value in dataset.attrs.items():
        if isinstance(value, str) and not _writable(value):
            raise JointplayError(f"its attribute {name!r} is not text")
    status = dataset.attrs["status"]
    if status.upper() not in Status.__members__:
        known = ", ".join(member.name.lower() for member in Status)
        raise JointplayError(f"it has the status {status!r:.60}; known are {known}")
    versions = dataset.attrs.get("versions", "{}")
    if not isinstance(_json("versions", versions), dict):
        raise JointplayError(f"its attribute 'versions' is not a table: {versions!r:.60}")
    listed = _json("values", dataset.attrs["values"])
    if not isinstance(listed, list) or not all(
        isinstance(row, list) and [type(text) for text in row] == [str] * 4 for row in listed
    ):
        raise JointplayError("its attribute 'values' is not a list of values with their origins")
    wall = dataset.attrs.get("wall_time_s", 0.0)
    try:
        float(wall)
    except (TypeError, ValueError):
        raise JointplayError(f"its attribute 'wall_time_s' is not a number: {wall!r:.60}") from None


def _json(name: str, text: Any) -> Any:
    try:
        data = json.loads(text)
        json.dumps(data, ensure_ascii=False).encode()  # lone surrogates cannot be shown
        return data
    except (TypeError, ValueError, RecursionError) as error:
        raise JointplayError(f"its attribute {name!r} is not valid JSON: {error}") from None


def _described(dataset: xr.Dataset, name: str, kind: type) -> Any:
    """An attribute as plain data, checked to describe a `kind`; no object is made of it."""
    data = _json(name, dataset.attrs[name])
    try:
        schema.check(kind, data)
    except (JointplayError, RecursionError, OverflowError) as error:
        where = ".".join(map(str, getattr(error, "where", ())))
        place = f"{where}: " if where else ""
        raise JointplayError(f"{name}: {place}{error}") from None
    _require_all(name, kind, data)
    return data


def _require_all(name: str, kind: type, table: Mapping[str, Any]) -> None:
    """Refuse a table that lacks a key: runs write all, defaults too."""
    for key in schema.fields_of(kind):
        if key not in table:
            raise JointplayError(f"{name}: the key {key} is missing")


def _check_histories(dataset: xr.Dataset, inputs: Any) -> None:
    loose = "joint" in dataset.dims
    if loose:
        names = inputs["mechanism"]["clearance"]
        for joint in _names(dataset, "joint"):
            if joint not in names:
                raise JointplayError(f"it has histories of the joint {joint!r:.60}, not its inputs")
        _names(dataset, "contact")
    for name, history in HISTORIES.items():
        if name not in dataset.data_vars:
            if history.of in ("all", "play" if loose else "ideal"):
                raise JointplayError(f"it has no variable {name!r}")
            continue
        if dataset[name].dims != (dims := ("time", *history.dims)):
            shape = ", ".join(map(str, dataset[name].dims))
            raise JointplayError(f"{name} has the dimensions ({shape}), not ({', '.join(dims)})")
        if not isinstance(dataset[name].attrs.get("units"), str):
            raise JointplayError(f"{name} has no units")
    for variable, values in dataset.data_vars.items():
        if values.dtype.kind not in "fiu":
            raise JointplayError(f"{variable} holds {values.dtype}, not real numbers")
    _check_times(dataset)
    _names(dataset, "coordinate")
    _names(dataset, "coordinate_unit", "coordinate")
    for name, parts in (("axis", "xyz"), ("quaternion", "wxyz")):
        listed = _names(dataset, name)
        if listed != [*parts]:
            raise JointplayError(f"along {name!r} it has {listed!r:.60}, not {', '.join(parts)}")
    if "moving_joint" in dataset.dims:
        _names(dataset, "moving_joint")


def _check_times(dataset: xr.Dataset) -> None:
    if "time" not in dataset.coords or dataset["time"].dtype.kind != "f":
        raise JointplayError("it has no times")
    time, before = dataset.variables["time"], -np.inf
    for first in range(0, time.size, _AT_ONCE):
        values = np.append(before, time[first : first + _AT_ONCE].values)
        late = np.flatnonzero(~(np.diff(values) > 0.0))
        if late.size or not np.isfinite(values[-1]):
            at = int(late[0]) if late.size else len(values) - 2
            raise JointplayError(
                f"its times must increase, but record {first + at + 1} of {time.size} is at "
                f"{values[at + 1]:g} s behind {values[at]:g} s"
            )
        before = values[-1]


def _names(dataset: xr.Dataset, name: str, dimension: str = "") -> list[str]:
    """The texts of the coordinate `name`, along the dimension of that name or another one."""
    dimension = dimension or name
    if name not in dataset.coords or dataset[name].dims != (dimension,):
        raise JointplayError(f"it has no {name!r} along {dimension!r}")
    values = dataset[name].values.tolist()
    if not values and dimension != "contact":
        raise JointplayError(f"it has nothing along {dimension!r}")
    if not all(isinstance(value, str) and _writable(value) for value in values):
        raise JointplayError(f"names along {dimension!r} are not text: {values!r:.60}")
    return values


def _writable(text: str) -> bool:
    """Whether a text can be encoded: without lone surrogates."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


@cache  # it takes milliseconds
def versions() -> dict[str, str]:
    """Versions of this package, Python and the libraries that enter a result."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    software = {"python": platform.python_version(), "machine": platform.machine()}
    for name in ("jointplay", "pin", "numpy", "numba", "scipy"):
        try:
            software[name] = version(name)
        except PackageNotFoundError:  # run from a source tree that is not installed
            software[name] = "unknown"
    return software
