"""Histories as a wide table: a row for each record, a column for each number.

Columns are named by the variable and its labels along the other dimensions: ``tool_position.x``,
``q.joint_b.yaw``, ``normal_force_peak.joint_b.radial_A``. Contacts that a joint does not have give
no column.
"""

from __future__ import annotations

import io
import itertools
import json
import re
from typing import TYPE_CHECKING, Any

import numpy as np

from jointplay import bridges
from jointplay.base.errors import JointplayError
from jointplay.base.imports import extra
from jointplay.simulation.result.result import Result

if TYPE_CHECKING:
    import pandas as pd

_BLOCK = 1000
"""Rows written between updates of the progress bar."""
EFFORT_UNITS = {"rad": "N m", "m": "N"}
"""Unit of a drive's effort, by the unit of its coordinate."""


def columns(result: Result) -> dict[str, tuple[np.ndarray, str]]:
    """Values (n,) and unit of each column, by its name; the first is the time."""
    histories: dict[str, tuple[np.ndarray, str]] = {"time": (result.time, "s")}
    for name, variable in result.dataset.data_vars.items():
        if "time" not in variable.dims:
            continue  # over the whole run, such as sliding_work
        variable = variable.transpose("time", ...)
        labels = [variable[dimension].values for dimension in variable.dims[1:]]
        for index in itertools.product(*(range(len(label)) for label in labels)):
            place: Any = (slice(None), *index)
            values = variable.values[place]
            if values.dtype.kind == "f" and len(values) and np.isnan(values).all():
                continue
            parts = [str(label[i]) for label, i in zip(labels, index, strict=True)]
            histories[".".join([str(name), *parts])] = (values, _unit(result, str(name), index))
    return histories


def _unit(result: Result, name: str, index: tuple[int, ...]) -> str:
    if name in ("q", "v", "drive"):
        unit = str(result.dataset["coordinate_unit"].values[index[0]])
        return {"q": unit, "v": f"{unit}/s", "drive": EFFORT_UNITS[unit]}[name]
    return str(result[name].attrs.get("units", ""))


def dataframe(result: Result, every: int = 1) -> pd.DataFrame:
    """The table in pandas, with a row for each record; its index is the `time` [s].

    ``attrs["units"]`` has the units by column and of the time; ``attrs["message"]`` says how the
    run ended.

    Raises:
        JointplayError: `every` is not a whole number from 1 on.
    """
    import xarray as xr

    histories = columns(result.thinned(every))
    dataset = xr.Dataset({name: ("time", values) for name, (values, _) in histories.items()})
    table: pd.DataFrame = dataset.to_dataframe()
    table.attrs = {
        "units": {name: unit for name, (_, unit) in histories.items()},
        "message": result.message,
    }
    return table


def csv(result: Result, suffix: str, progress: bool) -> bytes:
    """Text with a header line of names and units, ``tool_position.x [m]``.

    Numbers have enough digits to be read back bit for bit.
    """
    table = dataframe(result)
    units = table.attrs["units"]
    table.columns = [f"{name} [{units[name]}]" for name in table.columns]
    parts = [
        table.iloc[block].to_csv(index_label="time [s]", header=block.start == 0)
        for block in bridges.in_blocks(len(table), _BLOCK, "table", progress)
    ]
    return "".join(parts).encode()


def parquet(result: Result, suffix: str, progress: bool) -> bytes:
    """Apache Parquet, with each column's unit in its field's metadata and in pandas' ``attrs``."""
    with extra("tables", "pyarrow"):
        import pyarrow as pa
        import pyarrow.parquet as pq
    frame = dataframe(result)
    table = pa.Table.from_pandas(frame, preserve_index=True).select(["time", *frame.columns])
    units = frame.attrs["units"]
    fields = [field.with_metadata({"units": units[field.name]}) for field in table.schema]
    audit: dict[Any, Any] = {"jointplay_audit": json.dumps(result.audit.describe())}
    described = table.cast(pa.schema(fields, {**(table.schema.metadata or {}), **audit}))
    sink = io.BytesIO()
    pq.write_table(described, sink, compression="zstd")
    return sink.getvalue()


_MOST_LETTERS = 63
"""Longest name in MATLAB."""


def mat(result: Result, suffix: str, progress: bool) -> bytes:
    """MATLAB 5: each column as a vector, dots in its name as underscores, units in ``units``.

    Raises:
        JointplayError: two columns whose names would be the same there.
    """
    from scipy.io import savemat

    histories = columns(result)
    names = {name: re.sub(r"\W", "_", name)[:_MOST_LETTERS] for name in histories}
    if len({*names.values()}) < len(names):
        twin = next(name for name in names.values() if [*names.values()].count(name) > 1)
        raise JointplayError(f"several columns would be called {twin!r} in MATLAB; export a table")
    content = {names[name]: values[:, None] for name, (values, _) in histories.items()}
    units = {names[name]: unit for name, (_, unit) in histories.items()}
    sink = io.BytesIO()
    savemat(sink, {**content, "units": units, "message": result.message}, do_compression=True,
            long_field_names=True)  # fmt: skip
    return sink.getvalue()
