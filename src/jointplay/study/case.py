"""One case of a sweep, run in a process that keeps what the next cases can use."""

from __future__ import annotations

import json
import os
import tempfile
import threading
import time
import warnings
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from jointplay.base.errors import JointplayError
from jointplay.base.files import temporary
from jointplay.base.modules import import_module
from jointplay.model.robots import PREFIXES
from jointplay.physics.kernel import Status
from jointplay.scenario import Scenario
from jointplay.scenario.reading import Setting
from jointplay.simulation.analysis.tool_error import compare_tools, difference
from jointplay.simulation.analysis.twins import ideal_simulation, task, tool_motion
from jointplay.simulation.result import netcdf
from jointplay.simulation.result.result import Result
from jointplay.simulation.result.stored import versions
from jointplay.simulation.simulation import Simulation
from jointplay.study.measures import (
    COST,
    NUMERICAL_ERROR,
    measure,
    measure_function,
    needed,
    rests_of,
)
from jointplay.study.store import DONE, FAILED, Index, Outcome
from jointplay.study.sweep_plan import SweepPlan

Case = tuple[Index, Mapping[str, Any]]
"""A case of a sweep: its index, and the changes of the scenario."""
KEPT_IDEALS = 16
"""Runs of ideal mechanisms that a process keeps for the tool errors of later cases."""
_SETTINGS = ("step", "integrator", "macro_step", "tolerance", "record_every", "duration")
"""Settings of a run that its ideal run shares."""
LONGEST_ERROR = 500
"""Most characters of a failed case's message that are kept."""


@dataclass(frozen=True)
class Job:
    """All that a process needs to run cases of a sweep; it is sent between machines."""

    text: str
    path: str
    settings: tuple[Setting, ...]
    case: str
    joints: tuple[str, ...]
    measures: tuple[str, ...]
    results: bool
    start: float | None
    tool_error: bool
    version: str
    inputs: Mapping[str, str] | None = None
    """Texts of the files that the scenario names, by name, for processes that cannot read them."""


def job(plan: SweepPlan, send_files: bool = False) -> Job:
    """The job of a sweep; `send_files` includes the files, for processes without its folder."""
    scenario = plan.scenario
    path = scenario.path.name if send_files else str(scenario.path.absolute())
    of_plan = plan.measures, plan.results, plan.start, plan.tool_error, versions()["jointplay"]
    return Job(
        scenario.text, path, scenario.settings, plan.case, tuple(plan.joints),
        *of_plan, plan.inputs if send_files else None,
    )  # fmt: skip


class Bench:
    """Runs cases of one sweep in this process, one at a time."""

    def __init__(self, work: Job) -> None:
        """Read the scenario and find the measures."""
        here = versions()["jointplay"]
        if here != work.version:
            mismatch = f"a worker has jointplay {here}, the sweep was started with {work.version}"
            raise JointplayError(f"{mismatch}; install the same version")
        self.job = work
        self._folder: tempfile.TemporaryDirectory[str] | None = None
        path, text = Path(work.path), work.text
        self._names: dict[str, str] = {}
        if work.inputs is not None:
            self._folder = temporary("sweep")
            path = self._unpack(work.inputs, Path(self._folder.name)) / path.name
        self.scenario = Scenario(text, path, work.settings)
        for name in work.inputs or ():
            if name.endswith(".py"):
                import_module(path.parent / name)
        self.measures = {name: measure_function(name) for name in work.measures}
        self._integration = self.scenario.data(work.case).get("integration", {})
        self._ideals: OrderedDict[str, Result] = OrderedDict()

    def _unpack(self, inputs: Mapping[str, str], folder: Path) -> Path:
        """Write the files into a folder of this process, and note the new path of each.

        Each has a folder of its own, as names may be the same; modules are together, as they may
        import each other.
        """
        for number, (name, text) in enumerate(inputs.items()):
            if name.startswith(PREFIXES):
                continue
            path = folder / Path(name).name
            if path.suffix == ".xacro":  # its text is what it was expanded to
                path = path.with_suffix(".urdf")
            if not name.endswith(".py"):
                path = folder / str(number) / path.name
                path.parent.mkdir()
                self._names[name] = str(path)
            path.write_text(text, encoding="utf-8")
        return folder

    def run(self, index: Index, changes: Mapping[str, Any]) -> Outcome:
        """Run a case; an error is part of the outcome."""
        began = time.process_time()
        values: dict[str, float] = {}
        packed = None
        status, message = DONE, ""
        try:
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                values, packed = self._run(changes)
        except Exception as error:  # noqa: BLE001 - a measure of the user's own can raise anything
            kind = "" if isinstance(error, JointplayError) else f"{type(error).__name__}: "
            status, message = FAILED, f"{kind}{error}"
        values[COST] = time.process_time() - began
        return Outcome(index, status, values, self._portable(message)[:LONGEST_ERROR], packed)

    def _portable(self, text: str) -> str:
        """An error in one line, with files named as in the scenario, on whatever machine it ran."""
        for name, path in self._names.items():
            text = text.replace(path, name)
        folder = str(self.scenario.path.parent)
        return " ".join(text.replace(f"{folder}{os.sep}", "").split())

    def simulation(self, changes: Mapping[str, Any]) -> Simulation:
        """The simulation of a case."""
        if self._names:
            changes = self._relocated(changes)
        simulation = self.scenario.simulation(self.job.case, changes)
        if self.job.start is not None:
            simulation = replace(simulation, judge_from=self.job.start, settle=None)
        return simulation

    def _relocated(self, changes: Mapping[str, Any]) -> dict[str, Any]:
        """Changes of a case that also lead to the files where this process has written them."""
        tables = dict(changes)
        data = self.scenario.data(self.job.case)
        for table, key in (("robot", "urdf"), ("motion", "file")):
            name = {**data.get(table, {}), **tables.get(table, {})}.get(key)
            if name in self._names:
                tables[table] = {**tables.get(table, {}), key: self._names[name]}
        return tables

    def _run(self, changes: Mapping[str, Any]) -> tuple[dict[str, float], bytes | None]:
        simulation = self.simulation(changes)
        integration = {**self._integration, **changes.get("integration", {})}
        certify = bool(integration.get("certify"))
        # All histories are recorded only where something reads them; the user's measures may.
        complete = certify or self.measures or self.job.results
        only = None if complete else needed(simulation)
        result = simulation.run(certify=certify, estimate=False, only=only)
        if result.status != Status.COMPLETED:
            raise JointplayError(result.message)
        error, rests = None, tuple[float, ...]()
        if self.job.tool_error:
            ideal = self._ideal(result, simulation)
            if complete and ideal is not result:
                compare_tools(result, ideal)
            error = difference(result, ideal)
            rests = rests_of(simulation.motion, float(result.time[-1]))
        values = measure(result, error, self.job.joints, rests)
        for name, function in self.measures.items():
            returned = function(result)
            if not isinstance(returned, dict):  # one number
                returned = {name.rpartition(":")[2]: returned}
            own_values = {str(label): float(value) for label, value in returned.items()}
            for label in own_values:
                if label in values or label == COST or label.startswith(NUMERICAL_ERROR):
                    raise JointplayError(
                        f"{name} returns {label!r}, which is the name of another measure"
                    )
            values |= own_values
        return values, netcdf.pack(result.dataset) if self.job.results else None

    def _ideal(self, result: Result, simulation: Simulation) -> Result:
        """The ideal mechanism's run of the same task; the result itself if that is ideal."""
        if not result.joints and not simulation.mechanism.gears:
            return result
        inputs = task(result)
        inputs |= {name: getattr(simulation, name) for name in _SETTINGS}
        key = json.dumps(inputs, sort_keys=True)
        if key not in self._ideals:
            twin = replace(ideal_simulation(result), duration=simulation.duration)
            run = tool_motion(twin)
            if run.status != Status.COMPLETED:
                raise JointplayError(f"the ideal mechanism: {run.message}")
            self._ideals[key] = run
            while len(self._ideals) > KEPT_IDEALS:
                self._ideals.popitem(last=False)
        self._ideals.move_to_end(key)
        return self._ideals[key]


_benches: list[Bench] = []
_turns = threading.Lock()


def run_case(work: Job, case: Case) -> Outcome:
    """Run a case in this process, which keeps its `Bench` until it is given another sweep.

    Raises:
        JointplayError: the sweep cannot be run here; see `Bench`.
    """
    with _turns:  # a cluster's worker may have several threads
        if not _benches or _benches[0].job != work:
            _benches[:] = [Bench(work)]
        return _benches[0].run(*case)
