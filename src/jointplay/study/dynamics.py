"""What `jointplay dynamics` finds for one value: rows of numbers, made in other processes."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from importlib.metadata import version
from typing import Any

import numpy as np

from jointplay.analysis import ideal_simulation, lyapunov, nonlinear
from jointplay.analysis.poincare import once_per_turn
from jointplay.analysis.run_up import RunUp
from jointplay.errors import JointplayError
from jointplay.scenario import Scenario
from jointplay.scenario.settings import Setting, parse, tree
from jointplay.simulation.simulation import Simulation

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
        key, _, rest = text.partition("=")
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
        """For an axis of a figure."""
        return f"{self.key} [{self.unit or 'SI'}]"


@dataclass(frozen=True)
class Study:
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

    def turning(self, simulation: Simulation) -> nonlinear.Turning:
        """Over the turns of this study."""
        return nonlinear.Turning.of(simulation, self.settle, self.keep, self.records)

    def section(self, key: tuple[float, ...]) -> np.ndarray:
        """Quantities once a turn, turn by turn, shape (keep names,)."""
        turning = self.turning(self.simulation(*key))
        kept = turning.kept(turning.run(), self.names)[:-1]
        return once_per_turn(kept, self.records, self.phase).ravel()

    def spectrum(self, key: tuple[float, ...]) -> np.ndarray:
        """Amplitudes of the first quantity by order."""
        turning = self.turning(self.simulation(*key))
        kept = turning.kept(turning.run(), self.names[:1])[:-1, 0]
        return nonlinear.orders(kept, self.keep, self.highest)[1]

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
        turning = self.turning(self.simulation(*key))
        return turning.kept(turning.run(), self.names)[: -1 : self.every].ravel()

    def beside_ideal(self, key: tuple[float, ...]) -> np.ndarray:
        """Quantities by record, then the same of the ideal mechanism."""
        turning = self.turning(self.simulation(*key))
        result = turning.run()
        ideal = ideal_simulation(result).run(check_step=False)
        return np.concatenate([turning.kept(r, self.names).ravel() for r in (result, ideal)])

    def section_from(self, key: tuple[float, ...]) -> np.ndarray:
        """As `section`, the journal put to (x, y) [m] at the start."""
        centred = dataclasses.replace(self.simulation(), start="centred", seed=None)
        turning = self.turning(centred)
        kept = turning.kept(turning.run(nonlinear.placing(self.joint, *key)), self.names)[:-1]
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
