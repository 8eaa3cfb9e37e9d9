"""Studies of nonlinear dynamics as rows of numbers, kept in a CSV file once they are found."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.analysis import ideal_simulation
from jointplay.core import files
from jointplay.core.errors import JointplayError
from jointplay.nonlinear import lyapunov, steady_motion
from jointplay.nonlinear.poincare import once_per_turn
from jointplay.nonlinear.run_up import RunUp
from jointplay.nonlinear.steady_motion import Place
from jointplay.scenario import Scenario
from jointplay.scenario.settings import Setting, divided, parse, tree
from jointplay.simulation.simulation import Simulation
from jointplay.study.study import Study

PIECES = 20
"""Intervals in a turn after which neighbours are put back to each other."""


@dataclass(frozen=True)
class Varied:
    """A key of a scenario, and the values that it takes."""

    key: str
    values: tuple[float, ...]
    unit: str = ""

    @classmethod
    def parse(cls, text: str) -> Varied:
        """As ``KEY=FROM:TO:COUNT``, a unit behind it: ``motion.speeds.crank=100:5000:400 rpm``.

        Raises:
            JointplayError: it reads otherwise.
        """
        key, _, rest = divided(text)
        span, _, unit = rest.strip().partition(" ")
        parts = span.split(":")
        try:
            low, high, count = float(parts[0]), float(parts[1]), int(parts[2])
            good = len(parts) == 3 and count >= 1 and bool(key.strip()) and np.isfinite(high - low)
        except (IndexError, ValueError):
            good = False
        if not good:
            raise JointplayError(
                f"--vary must read KEY=FROM:TO:COUNT and a unit, such as "
                f"'motion.speeds.crank_pin=1000:5000:400 rpm', got {text!r}"
            )
        parse(f"{key}=0")  # is it a key?
        values = np.linspace(low, high, count)
        return cls(key.strip(), tuple(float(f"{value:.12g}") for value in values), unit.strip())

    def setting(self, value: float) -> Setting:
        """That gives the key this value."""
        text = f'"{value!r} {self.unit}"' if self.unit else repr(value)
        return parse(f"{self.key}={text}")

    @property
    def label(self) -> str:
        """For an axis of a figure: ``radial clearance of piston_pin [mm]``."""
        return f"{self.words} [{self.unit or 'SI unit'}]"

    @property
    def words(self) -> str:
        """The key in words: ``radial clearance of piston_pin``."""
        *group, name = self.key.split(".")
        words, of = name.replace("_", " "), ".".join(group[1:])
        if group[:2] == ["motion", "speeds"]:  # the last part names a joint
            words, of = "speed", name
        return f"{words}{f' of {of}' if of else ''}"


@dataclass(frozen=True)
class Observation:
    """What is simulated, and for how long; makes the rows."""

    path: str
    text: str
    trust: tuple[str, ...]
    settings: tuple[Setting, ...]
    case: str | None
    settle: int
    """Turns at the start that are not looked at."""
    keep: int
    """Turns that are."""
    records: int
    """In a turn."""
    phase: float
    """Where in the turn a section is, in turns."""
    names: tuple[str, ...]
    """Quantities."""
    varied: Varied | None = None
    highest: float = 20.0
    """Largest order of spectra."""
    joint: str = ""
    """Whose journal is put aside at the start."""
    every: int = 1
    """Records from one point of a course to the next."""
    window: int = 0
    """Turns of a spectrum in a run-up."""

    @property
    def end(self) -> int:
        """The last turn."""
        return self.settle + self.keep

    def simulation(self, value: float | None = None) -> Simulation:
        """The scenario's, the key that varies at a value."""
        scenario = Scenario(self.text, self.path, self.trust, self.settings)
        changes: dict[str, Any] = {}
        if value is not None and self.varied is not None:
            changes = tree([self.varied.setting(value)])
        return scenario.simulation(self.case, changes)

    def turning(self, simulation: Simulation) -> steady_motion.Turning:
        """Over the turns of this study."""
        return steady_motion.Turning.of(simulation, self.settle, self.keep, self.records)

    def _kept(self, simulation: Simulation, place: Place | None = None) -> np.ndarray:
        """Quantities in the turns that are looked at, shape (keep records, names)."""
        turning = self.turning(simulation)
        return turning.kept(turning.run(place), self.names)[:-1]

    def section(self, key: tuple[float, ...]) -> np.ndarray:
        """Quantities once a turn, turn by turn, shape (keep names,)."""
        kept = self._kept(self.simulation(*key))
        return once_per_turn(kept, self.records, self.phase).ravel()

    def spectrum(self, key: tuple[float, ...]) -> np.ndarray:
        """Amplitudes of the first quantity by order."""
        first = self._kept(self.simulation(*key))[:, 0]
        return steady_motion.orders(first, self.keep, self.highest)[1]

    def run_up(self) -> RunUp:
        """From the first of the values to the last."""
        assert self.varied is not None
        slow, fast = (self.simulation(self.varied.values[k]) for k in (0, -1))
        return RunUp.of(slow, fast, self.settle, self.keep, self.records)

    def rising(self, key: tuple[float, ...]) -> np.ndarray:
        """Amplitudes of the first quantity in each window of a run-up, window by window."""
        assert self.varied is not None
        rising = self.run_up()
        values = rising.over_angle(rising.run(), self.names[0])
        number = len(self.varied.values)
        return rising.spectra(values, number, self.window, self.highest)[1].ravel()

    def growth(self, key: tuple[float, ...]) -> np.ndarray:
        """Mean growth of a small difference in each turn that is looked at [1/s], shape (keep,)."""
        turning = self.turning(self.simulation(*key))
        grown = lyapunov.stretching(turning.simulation, turning.turn / PIECES)
        per_turn = grown.reshape(self.settle + self.keep, PIECES).sum(axis=1)
        return per_turn[self.settle :] / turning.turn

    def course(self, key: tuple[float, ...]) -> np.ndarray:
        """Quantities every so many records, record by record."""
        return self._kept(self.simulation(*key))[:: self.every].ravel()

    def beside_ideal(self, key: tuple[float, ...]) -> np.ndarray:
        """Quantities by record, then the same of the ideal mechanism."""
        turning = self.turning(self.simulation(*key))
        result = turning.run()
        ideal = ideal_simulation(result).run(check_step=False, estimate=False)
        return np.concatenate([turning.kept(r, self.names).ravel() for r in (result, ideal)])

    def section_from(self, key: tuple[float, ...]) -> np.ndarray:
        """As `section`, the journal put to (x, y) [m] at the start."""
        centred = dataclasses.replace(self.simulation(), start="centred", seed=None)
        kept = self._kept(centred, steady_motion.placing(self.joint, *key))
        return once_per_turn(kept, self.records, self.phase).ravel()

    def asked(self) -> dict[str, Any]:
        """All that its rows depend on, but for their values, as plain data."""
        given = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        del given["path"]  # its text counts
        given["version"] = version("jointplay")
        given["settings"] = [[list(s.key), repr(s.value)] for s in self.settings]
        given["varied"] = None if self.varied is None else [self.varied.key, self.varied.unit]
        if self.window and self.varied is not None:  # one row holds all its values
            given["varied"] += list(self.varied.values)
        return {name: list(v) if isinstance(v, tuple) else v for name, v in given.items()}


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
        self.kept = f"finished values are in {str(path)!r}; the same command continues"
        self._head = _BEGIN + json.dumps(dict(asked), sort_keys=True)
        if path.exists():
            self._read()
        else:
            files.write(path, f"{self._head}\nvalue,message,{','.join(columns)}\n")

    def _read(self) -> None:
        text = files.read_text(self.path, "table")
        lines = text.split("\n")
        if lines[0] != self._head:
            raise JointplayError(
                f"{str(self.path)!r} was made for something "
                f"else{_difference(lines[0], self._head)}; choose another folder"
            )
        whole = lines[2:-1]  # after the last line end is nothing, or half a row
        try:
            for row in csv.reader(whole, strict=True):
                key = tuple(float(part) for part in row[0].split())
                numbers = np.array([float(x or "nan") for x in row[2:]])
                if len(numbers) != len(self.columns):
                    raise ValueError
                self._take(key, row[1], numbers)
        except (csv.Error, ValueError, IndexError):
            raise JointplayError(f"{str(self.path)!r} is damaged; delete it") from None
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
        files.append(self.path, text.getvalue())
        self._take(key, message, np.array([float(x or "nan") for x in cells]))

    def __contains__(self, key: object) -> bool:
        """Whether there is a row of a value."""
        return key in self.rows

    def __getitem__(self, key: tuple[float, ...]) -> tuple[np.ndarray | None, str]:
        """The row of a value, and why it failed."""
        return self.rows[key], self.failures.get(key, "")

    def keep(self, key: tuple[float, ...], value: tuple[np.ndarray | None, str]) -> None:
        """See `add`."""
        self.add(key, *value)

    def fill(
        self,
        work: Callable[[tuple[float, ...]], np.ndarray],
        keys: Sequence[tuple[float, ...]],
        jobs: int | None = None,
        progress: bool = False,
    ) -> int:
        """Find the rows of `keys` that are missing, in processes; returns how many there were.

        A value that fails with a `JointplayError` is kept with its message; the others go on.
        """
        before = len(self.rows)
        Study({key: key for key in keys}, partial(_found, work), self).run(jobs, progress)
        return len(self.rows) - before

    def values(self, keys: Sequence[tuple[float, ...]]) -> np.ndarray:
        """Numbers of `keys`, not a number for those that failed, shape (keys, columns)."""
        return np.array([self.rows[key] for key in keys]).reshape(len(keys), len(self.columns))


def _found(
    work: Callable[[tuple[float, ...]], np.ndarray], key: tuple[float, ...]
) -> tuple[np.ndarray | None, str]:
    try:
        return work(key), ""
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
