"""The store of a sweep as a dataset, for those who read it."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import xarray as xr

from jointplay.core.errors import JointplayError, require_a
from jointplay.core.files import is_file
from jointplay.study.sealed import METADATA, WRITTEN, SealedStore, damaged, plain_name

FORMAT = 3
"""Version of the store's format."""

_KINDS: dict[str, type] = {
    "sizes": dict,
    "sampled": list,
    "versions": dict,
    "scenario": str,
    "identity": dict,
}
"""Attributes that every store has."""


def open_sweep(path: str | Path) -> xr.Dataset:
    """The store of a sweep as one dataset over its dimensions, read when it is looked at.

    Variables are the measures (docs/sweeps.md), ``state`` (0: not run, 1: done, 2: failed) and
    ``error``. Of a sweep that is under way it shows what has been written so far. What has changed
    since it was written, or is gone since the sweep ended, is refused when it is looked at, naming
    array and chunk.

    Raises:
        JointplayError: no such store, none of a sweep, or a damaged one.
    """
    require_a("path", path, "str", "Path")
    path = Path(path)
    if not is_file(path / METADATA):
        raise JointplayError(f"no sweep {str(path)!r}")
    try:
        with quiet():
            dataset = xr.open_zarr(
                SealedStore(path, read_only=True), chunks=None, consolidated=True, zarr_format=3,
                mask_and_scale=False,
            )  # fmt: skip
    except JointplayError:
        raise
    except Exception as error:  # zarr and xarray raise whatever they stumble over
        raise damaged(path, " ".join(str(error).split()) or type(error).__name__) from None
    check_format(dataset.attrs, path)
    dataset.attrs.pop(WRITTEN, None)
    folders = map(str, {*dataset.variables, *dataset.dims})
    dataset = dataset.rename({f: plain_name(f) for f in folders if f != plain_name(f)})
    coordinates = [*dataset.attrs["sizes"], *dataset.attrs["sampled"]]
    dataset = dataset.set_coords([name for name in coordinates if name in dataset.variables])
    dataset.encoding["source"] = str(path)
    return dataset


def check_format(attrs: Mapping[str, Any], path: Path) -> None:
    """Refuse the attributes of what is no sweep of this format.

    Raises:
        JointplayError: it is none.
    """
    if attrs.get("jointplay_sweep") != FORMAT:
        raise JointplayError(
            f"{str(path)!r} is not a sweep of format {FORMAT} "
            f"(found {attrs.get('jointplay_sweep')!r})"
        )
    for name, kind in _KINDS.items():
        if not isinstance(attrs.get(name), kind):
            raise JointplayError(
                f"{str(path)!r} is damaged: its attribute {name!r} is {attrs.get(name)!r:.60}"
            )


@contextmanager
def reading(path: str | Path) -> Iterator[None]:
    """Say of what zarr stumbles over in the block, long after a store was opened, that it is
    damaged.

    Raises:
        JointplayError: it is.
    """
    try:
        yield
    except (RuntimeError, json.JSONDecodeError) as error:  # of codecs, and of arrays' metadata
        raise JointplayError(f"{str(path)!r} is damaged: {error}") from None


@contextmanager
def quiet() -> Iterator[None]:
    """Without zarr's notes on what Zarr 3 has not settled, and on the journal beside the arrays."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
