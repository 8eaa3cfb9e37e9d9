"""The store of a sweep as a dataset, for those who read it."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import xarray as xr

from jointplay.errors import JointplayError

FORMAT = 1
"""Version of the store's format."""


def open_sweep(path: str | Path) -> xr.Dataset:
    """The store of a sweep as one dataset over its dimensions, read when it is looked at.

    Variables are the measures (docs/sweeps.md), ``state`` (0: not run, 1: done, 2: failed) and
    ``error``. Of a sweep that is under way it shows what has been written so far.

    Raises:
        JointplayError: no such store, or none of a sweep.
    """
    path = Path(path)
    if not (path / "zarr.json").is_file():
        raise JointplayError(f"no sweep {str(path)!r}")
    try:
        with quiet():
            dataset = xr.open_zarr(path, chunks=None, consolidated=None, mask_and_scale=False)
    except Exception as error:  # zarr and xarray raise whatever they stumble over
        words = " ".join(str(error).split()) or type(error).__name__
        raise JointplayError(f"{str(path)!r} is damaged or not a sweep: {words}") from None
    check_format(dataset.attrs, path)
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


@contextmanager
def quiet() -> Iterator[None]:
    """Without zarr's notes on what Zarr 3 has not settled, and on the journal beside the arrays."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        yield
