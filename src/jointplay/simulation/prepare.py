"""A simulation made ready to step."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from jointplay.errors import JointplayError
from jointplay.kernel.integrators import Integrator, integrator
from jointplay.kernel.sites import LoadSite
from jointplay.kernel.workspace import Workspace
from jointplay.loads.drive import Drive, assign
from jointplay.loads.tables import table_nodes, tabulate
from jointplay.mechanism.massless import require_inertia
from jointplay.simulation import initial, limits
from jointplay.simulation import loads as acting
from jointplay.simulation.assemble import check_step, contact_site
from jointplay.simulation.events import Events
from jointplay.simulation.loop import LOOP_CORRECTION, Loop
from jointplay.simulation.multi_rate import LONGEST_MACRO_STEP_S, Adaptive, MultiRate
from jointplay.simulation.on_disk import OnDisk
from jointplay.simulation.single_rate import SingleRate
from jointplay.simulation.standing import StandingLoads
from jointplay.simulation.watch import Watch

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

CHUNK = 2000
"""Steps between two looks at the clock and the keyboard, at most."""


class Prepared:
    """The workspace of a simulation, the initial state in it, and what a run of it goes by."""

    def __init__(
        self, simulation: Simulation, progress: bool = False, records: Path | None = None
    ) -> None:
        """Check the numbers, place the journals, tabulate the drives; see `Simulation.prepare`."""
        self.simulation = simulation
        self.label = ""  # what the progress bar calls the run
        self.mechanism = mechanism = simulation.mechanism
        limits.check_names(mechanism)
        self.method: Integrator = integrator(simulation.integrator)
        step, duration, self.steps = limits.numbers(simulation, self.method)
        acting.check(simulation.loads)
        drives = assign(mechanism, simulation.motion, simulation.drive)
        every = simulation.record_every
        if records is None:
            nodes = table_nodes(simulation.motion, drives, duration)
            limits.check_memory(mechanism, duration, self.steps, every, nodes)
        self.friction = limits.friction(simulation)
        followed = [name for name, drive in drives.items() if drive.follows]
        bounds = limits.bounds(simulation, followed)
        start = initial.place(simulation, mechanism, followed)
        require_inertia(mechanism, start.q)
        if simulation.seed is not None and not simulation.stands:
            start.perturb(simulation.seed, at_rest=False)
        macro = simulation.macro_step or LONGEST_MACRO_STEP_S
        tables, armature, self._reference = tabulate(
            mechanism,
            simulation.motion,
            drives,
            duration,
            self.friction,
            start.q,
            progress,
            bounds,
            ahead=2.0 * (CHUNK * step + macro),
        )
        start.move()
        # The run's own, for payloads and prescribed motion change its inertias.
        self.model = mechanism.model.copy()
        for at, value in armature.items():
            self.model.armature[at] = value
        self.data = self.model.createData()
        sites = [acting.load_site(load, mechanism, bounds) for load in simulation.loads.values()]
        self.workspace = w = Workspace(
            self.data,
            self.model.nv,
            [contact_site(mechanism, name, start.q) for name in mechanism.clearance],
            tables,
            step,
            every,
            self.steps // every + 2 if records is None else 1,
            own_acceleration=not self.method.single_rate,
            loads=sites,
        )
        self.on_disk = None if records is None else self._written(records, macro)
        """Where records go that memory has no room for."""
        self._watch = Watch(simulation.loads, sites, mechanism, self.model, w, step)
        w.q[:], w.v[:] = start.q, start.v
        self._events = Events(
            mechanism, self.model, simulation.payloads, step, simulation.record_every
        )
        check_step(mechanism, pin.computeTotalMass(self.model), step, start.q)
        acting.check_step(simulation.loads, mechanism, step, start.q)
        self.rest: initial.Rest | None = None
        """Where the search for the place of rest ended; None if journals start centred."""
        if simulation.stands and (mechanism.clearance or mechanism.gears):
            self._stand(start, drives, sites)
        self.judged_from = simulation.judged_from
        """When figures begin to be judged [s]."""
        self._unjudged: dict[str, np.ndarray] | None = None
        self._begun = False
        self._elapsed = 0.0
        self._since: float | None = None
        self._origin: tuple[np.ndarray, np.ndarray] | None = None
        self.guards: list[Callable[[], AbstractContextManager[object]]] = []
        """Contexts in which the time loop runs, such as one that takes signals."""
        self.between: list[Callable[[], bool]] = []
        """Called between stretches; the run stops, to be continued or not, if one says True."""
        self._loop = self._make_loop(mechanism.constraints(w.q, LOOP_CORRECTION / step))

    def _written(self, records: Path, macro: float) -> OnDisk:
        """Have the records written to a file as they are made."""
        step, every = self.simulation.step, self.simulation.record_every
        most = CHUNK + math.ceil(macro / step) + 2
        return OnDisk(records, self.workspace, self.steps // every + 2, most)

    def _stand(
        self, start: initial.Start, drives: Mapping[str, Drive], sites: Sequence[LoadSite]
    ) -> None:
        """Let the journals begin where they rest, if they do."""
        simulation, w = self.simulation, self.workspace
        self._events.happen(w)  # what is picked at 0 weighs from the first
        bodies = self._events.phases[-1].model
        pushing = StandingLoads(simulation.loads, self.mechanism, sites)
        rest = initial.rest(simulation, start, bodies, w, drives, self.friction, pushing)
        self.rest = rest
        if not rest.solved:
            if simulation.start == "rest":
                what = (
                    f"after {rest.trials} trials {rest.residual:.3g} N of {rest.load:.3g} N are "
                    "not balanced"
                    if rest.inside
                    else "a journal would break out of its bearing"
                )
                raise JointplayError(
                    f"no place of rest was found: {what}; start 'centred', or give a state in "
                    "which the drives hold the machine"
                )
            # As the result says: to run it again is to run it like this.
            self.simulation = replace(simulation, start="centred")
            if simulation.seed is not None:
                start.perturb(simulation.seed, at_rest=False)
        else:
            self.simulation = replace(simulation, start="rest")
            start.q = rest.q
            if simulation.seed is not None:
                start.perturb(simulation.seed, at_rest=True)
        start.move()
        self.workspace.q[:], self.workspace.v[:] = start.q, start.v

    def _make_loop(self, constraints: list[pin.RigidConstraintModel]) -> Loop:
        simulation = self.simulation
        parts = (self.model, self.data, self.workspace, self.method, constraints)
        if self.method.single_rate:
            return SingleRate(*parts)
        if simulation.tolerance is None:
            return MultiRate(*parts, macro_step=simulation.macro_step)
        return Adaptive(*parts, macro_step=simulation.macro_step, tolerance=simulation.tolerance)
