"""Rows of numbers, one for each value of a study, kept in a CSV file as soon as they are found."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from jointplay.errors import JointplayError
from jointplay.host import files, workers

_BEGIN = "# jointplay dynamics "


class Table:
    """Rows by value, in a file that a later process goes on with.

    Args:
        path: CSV file; its first line says what was asked for.
        asked: all that rows depend on but for their values, as plain data.
        columns: names of the numbers of a row, units in them.

    Attributes:
        rows: what is there, by value; a failed value has no numbers.
        failures: messages of failed values.

    Raises:
        JointplayError: the file is there and was made for something else, or cannot be read.
    """

    def __init__(self, path: Path, asked: Mapping[str, Any], columns: Sequence[str]) -> None:
        """Read what is there, or begin the file."""
        self.path = path
        self.columns = list(columns)
        self.rows: dict[tuple[float, ...], np.ndarray] = {}
        self.failures: dict[tuple[float, ...], str] = {}
        self._head = _BEGIN + json.dumps(dict(asked), sort_keys=True)
        if path.exists():
            self._read()
        else:
            files.write(path, f"{self._head}\nvalue,message,{','.join(columns)}\n")

    def _read(self) -> None:
        try:
            text = self.path.read_text(encoding="utf-8")
        except (OSError, ValueError) as error:
            raise JointplayError(f"cannot read {str(self.path)!r}: {error}") from None
        lines = text.split("\n")
        if lines[0] != self._head:
            raise JointplayError(
                f"{str(self.path)!r} was made for something else"
                f"{_difference(lines[0], self._head)}; name another folder"
            )
        whole = lines[2:-1]  # after the last line end is nothing, or half a row
        for row in csv.reader(whole):
            if len(row) != len(self.columns) + 2:
                raise JointplayError(f"{str(self.path)!r} is damaged; delete it")
            key = tuple(float(part) for part in row[0].split())
            self._take(key, row[1], np.array([float(x or "nan") for x in row[2:]]))
        if lines[-1]:
            files.write(self.path, "\n".join(lines[:-1]) + "\n", overwrite=True)

    def _take(self, key: tuple[float, ...], message: str, numbers: np.ndarray) -> None:
        self.rows[key] = numbers
        if message:
            self.failures[key] = message

    def add(self, key: tuple[float, ...], numbers: np.ndarray | None, message: str = "") -> None:
        """Keep a row, in memory and on disk at once.

        Raises:
            JointplayError: the file cannot be written.
        """
        cells = [""] * len(self.columns) if numbers is None else [repr(float(x)) for x in numbers]
        text = io.StringIO(newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow([" ".join(map(repr, key)), " ".join(message.split()), *cells])
        try:
            with self.path.open("ab", buffering=0) as file:
                file.write(text.getvalue().encode())  # at once: no kill leaves half a row
        except OSError as error:
            raise files.cannot_write(self.path, error) from None
        self._take(key, message, np.array([float(x or "nan") for x in cells]))

    def fill(
        self,
        work: Callable[[tuple[float, ...]], np.ndarray],
        keys: Sequence[tuple[float, ...]],
        jobs: int,
        progress: bool = False,
    ) -> int:
        """Find the rows of `keys` that are missing, in processes; returns how many there were.

        A value that fails with a `JointplayError` is kept with its message; the others go on.

        Args:
            work: finds a row; can be sent to another process.
            keys: values.
            jobs: processes; with 1 it is done here.
            progress: show a bar with the time left.
        """
        missing = [key for key in keys if key not in self.rows]
        if not missing:
            return 0
        bar = tqdm(total=len(missing), unit="run", disable=not progress, smoothing=0.1)
        kept = f"what is done is in {str(self.path)!r}; the same command goes on with it"
        if jobs == 1 or len(missing) == 1:
            with bar:
                for key in missing:
                    self.add(key, *_found(partial(work, key)))
                    bar.update()
            return len(missing)
        with bar, workers.pool(min(jobs, len(missing)), kept) as pool:
            futures = {pool.submit(work, key): key for key in missing}
            for future in as_completed(futures):
                self.add(futures[future], *_found(future.result))
                bar.update()
        return len(missing)

    def values(self, keys: Sequence[tuple[float, ...]]) -> np.ndarray:
        """Numbers of `keys`, not a number for those that failed, shape (keys, columns)."""
        return np.array([self.rows[key] for key in keys]).reshape(len(keys), len(self.columns))


def _found(find: Callable[[], np.ndarray]) -> tuple[np.ndarray | None, str]:
    try:
        return find(), ""
    except JointplayError as error:
        return None, str(error)


def _difference(there: str, asked: str) -> str:
    """What two first lines differ in, in words."""
    try:
        one, other = (json.loads(line.removeprefix(_BEGIN)) for line in (there, asked))
        names = [name for name in {**one, **other} if one.get(name) != other.get(name)]
    except (ValueError, AttributeError):
        return ""
    return f" (another {', '.join(names)})" if names else ""
