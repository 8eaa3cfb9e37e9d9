"""Observations of steady motion as rows of numbers, one for each value, kept in a file."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base import files
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import misread, pair
from jointplay.base.tables import Column, Table
from jointplay.scenario import Scenario
from jointplay.scenario.reading import Setting, parse, tree
from jointplay.simulation.analysis import ideal_simulation
from jointplay.simulation.run import Run
from jointplay.simulation.simulation import Simulation
from jointplay.study.nonlinear import lyapunov, steady_motion
from jointplay.study.nonlinear.poincare import once_per_turn
from jointplay.study.nonlinear.run_up import RunUp
from jointplay.study.nonlinear.steady_motion import Prepare
from jointplay.study.runs import Runs
from jointplay.study.study import Study

Key = tuple[float, ...]
"""Key of a row: the value of the key that varies, or the journal's starting position (x, y)."""
PIECES = 20
"""Intervals of a turn in the computation of Lyapunov exponents."""


@dataclass(frozen=True)
class Varied:
    """A key of a scenario, and the values that it takes."""

    key: str
    values: tuple[float, ...]
    unit: str = ""

    @classmethod
    def parse(cls, text: str) -> Varied:
        """Read ``KEY=FROM:TO:COUNT UNIT``, such as ``motion.speeds.crank=100:5000:400 rpm``.

        Raises:
            JointplayError: the text has another form.
        """
        usage = (
            "--vary KEY=FROM:TO:COUNT and a unit, such as "
            "'motion.speeds.crank_pin=1000:5000:400 rpm'"
        )
        key, numbers = pair(text, usage)
        span, _, unit = numbers.partition(" ")
        try:
            first, last, number = span.split(":")
            low, high, count = float(first), float(last), int(number)
        except ValueError:
            raise misread(text, usage) from None
        if count < 1 or not np.isfinite(high - low):
            raise misread(text, usage)
        parse(f"{key}=0")  # raises if it is not a key
        values = np.linspace(low, high, count)
        return cls(key, tuple(float(f"{value:.12g}") for value in values), unit.strip())

    def setting(self, value: float) -> Setting:
        text = f'"{value!r} {self.unit}"' if self.unit else repr(value)
        return parse(f"{self.key}={text}")

    @property
    def label(self) -> str:
        """Label of a figure's axis: ``radial clearance of piston_pin [mm]``."""
        return f"{self.quantity} [{self.unit or 'SI unit'}]"

    @property
    def quantity(self) -> str:
        *group, name = self.key.split(".")
        quantity, subject = name.replace("_", " "), ".".join(group[1:])
        if group[:2] == ["motion", "speeds"]:  # the last part names a joint
            quantity, subject = "speed", name
        return f"{quantity}{f' of {subject}' if subject else ''}"


@dataclass(frozen=True)
class Observation:
    """What is simulated and observed, and for how long; its methods compute the rows."""

    scenario: Scenario
    case: str | None
    leave_out: int
    """Settling turns at the start, which are not observed."""
    keep: int
    """Observed turns."""
    records: int
    """Records in a turn."""
    phase: float
    """Phase of the section in the turn, in turns."""
    names: tuple[str, ...]
    """Observed quantities."""
    varied: Varied | None = None
    highest: float = 20.0
    """Largest order of spectra."""
    joint: str = ""
    """Joint whose journal is displaced at the start."""
    every: int = 1
    """Records from one point of `course` to the next."""
    window: int = 0
    """Turns of each spectrum in a run-up."""

    @property
    def end(self) -> int:
        return self.leave_out + self.keep

    def orders(self, turns: int) -> np.ndarray:
        """Orders of the spectrum of `turns` turns, shape (m,)."""
        highest = min(self.highest, self.records / 2)
        return np.arange(int(highest * turns + 1e-6) + 1) / turns

    def simulation(self, value: float | None = None) -> Simulation:
        varied = self.varied if value is not None else None
        changes = {} if varied is None else tree([varied.setting(value or 0.0)])
        return self.scenario.simulation(self.case, changes)

    def turning(self, simulation: Simulation) -> steady_motion.Turning:
        return steady_motion.Turning.of(simulation, self.leave_out, self.keep, self.records)

    def _observed(self, simulation: Simulation, prepare: Prepare | None = None) -> np.ndarray:
        """Quantities by record in the observed turns, shape (keep records, names)."""
        turning = self.turning(simulation)
        return turning.observed(turning.run(prepare), self.names)[:-1]

    def section(self, key: Key) -> np.ndarray:
        """Quantities once a turn, turn after turn, shape (keep names,)."""
        points = self._observed(self.simulation(*key))
        return once_per_turn(points, self.records, self.phase).ravel()

    def spectrum(self, key: Key) -> np.ndarray:
        """Amplitudes of the first quantity by order."""
        first = self._observed(self.simulation(*key))[:, 0]
        return steady_motion.orders(first, self.keep, self.highest)[1]

    def run_up(self) -> RunUp:
        """The run-up from the first of the values to the last."""
        assert self.varied is not None
        slow, fast = (self.simulation(self.varied.values[k]) for k in (0, -1))
        return RunUp.of(slow, fast, self.leave_out, self.keep, self.records)

    def rising(self, key: Key) -> np.ndarray:
        """Amplitudes of the first quantity by order in each window of a run-up, one by one."""
        assert self.varied is not None
        rising = self.run_up()
        values = rising.over_angle(rising.run(), self.names[0])
        number = len(self.varied.values)
        return rising.spectra(values, number, self.window, self.highest)[1].ravel()

    def growth(self, key: Key) -> np.ndarray:
        """Rate of growth of a small difference in each observed turn, shape (keep,) [1/s]."""
        turning = self.turning(self.simulation(*key))
        grown = lyapunov.stretching(turning.simulation, turning.turn / PIECES)
        per_turn = grown.reshape(self.leave_out + self.keep, PIECES).sum(axis=1)
        return per_turn[self.leave_out :] / turning.turn

    def course(self, key: Key) -> np.ndarray:
        """Quantities at every `every`-th record, record by record."""
        return self._observed(self.simulation(*key))[:: self.every].ravel()

    def beside_ideal(self, key: Key) -> np.ndarray:
        """Quantities by record, then those of the ideal mechanism."""
        turning = self.turning(self.simulation(*key))
        result = turning.run()
        ideal = Run(ideal_simulation(result)).finish(check_step=False)
        return np.concatenate([turning.observed(r, self.names).ravel() for r in (result, ideal)])

    def section_from(self, key: Key) -> np.ndarray:
        """`section` of a run whose journal starts at (x, y) [m], the key."""
        x, y = key
        centred = dataclasses.replace(self.simulation(), start="centred", seed=None)
        points = self._observed(centred, partial(steady_motion.place, self.joint, x, y))
        return once_per_turn(points, self.records, self.phase).ravel()

    def inputs(self) -> dict[str, Any]:
        """All that the rows depend on beside their keys, as plain data."""
        entries = {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        scenario = entries.pop("scenario")
        entries |= {"text": scenario.text, "version": version("jointplay")}
        entries["settings"] = [[list(s.key), repr(s.value)] for s in scenario.settings]
        entries["varied"] = None if self.varied is None else [self.varied.key, self.varied.unit]
        if self.window and self.varied is not None:  # one row holds all its values
            entries["varied"] += list(self.varied.values)
        return {name: list(v) if isinstance(v, tuple) else v for name, v in entries.items()}


def rows(
    path: Path,
    inputs: Mapping[str, Any],
    jobs: int | None,
    progress: bool,
    say: Callable[[str], object],
    columns: Sequence[str],
    work: Callable[[Key], np.ndarray],
    keys: Sequence[Key],
) -> np.ndarray:
    """Compute rows of numbers in parallel, and write their table, a CSV file.

    Rows are kept as they are computed, in the file of the same name that ends in ``.runs``; those
    that are there are not computed again. A key that fails with a `JointplayError` is kept with its
    message, and the others continue.

    Args:
        path: file of the table.
        inputs: all that rows depend on beside their keys, as plain data.
        jobs, progress: see `Study.outcomes`.
        say: called with lines that tell how many rows are computed now, and which failed.
        columns: names of the numbers of a row, with units.
        work: function of a key that returns its row.
        keys: keys of the rows.

    Returns:
        Numbers, shape (keys, columns), NaN where a key failed.

    Raises:
        JointplayError: no run was completed; the file was made with other inputs, or cannot be read
            or written.
    """
    runs_file = path.with_suffix(".runs")
    if path.exists() and not runs_file.exists():
        raise JointplayError(f"{str(path)!r} is not of this analysis; choose another folder")
    with closing(Runs(runs_file, inputs)) as store:
        present = len(store)
        Study({key: key for key in keys}, partial(_computed, work), store).run(jobs, progress)
    missing = np.full(len(columns), np.nan)
    numbers = np.array([store[key].get("row", missing) for key in keys])
    numbers = numbers.reshape(len(keys), len(columns))
    failures = {key: str(store[key]["message"]) for key in keys if "message" in store[key]}
    values = Column("value", [" ".join(map(repr, key)) for key in keys])
    messages = Column("message", [failures.get(key, "") for key in keys])
    quantities = [Column(name, x, key=name) for name, x in zip(columns, numbers.T, strict=True)]
    table = Table((values, messages, *quantities)).csv(None)
    files.write(path, table, overwrite=True, announced=False)
    computed = len(store) - present
    say(f"{computed} of {len(keys)} runs computed now, {len(keys) - computed} earlier")
    failed = [key for key in keys if key in failures]
    for key in failed[:3]:
        location = f" at {', '.join(f'{x:g}' for x in key)}" if key else ""
        say(f"failed{location}: {failures[key]}")
    if len(failed) > 3:
        say(f"... and {len(failed) - 3} more, see {path}")
    if len(failed) == len(keys):
        raise JointplayError(f"no run was completed: {failures[keys[0]]}")
    return numbers


def _computed(work: Callable[[Key], np.ndarray], key: Key) -> dict[str, np.ndarray]:
    try:
        return {"row": np.asarray(work(key), float)}
    except JointplayError as error:
        return {"message": np.array(" ".join(str(error).split()))}
