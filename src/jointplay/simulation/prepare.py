"""A run made ready to step: its settings checked, its tables made, its arrays laid out.

In this order: the number of steps, and whether they fit in memory; by joint its drive, what rubs
and which effort cuts it; the state in which loops are closed and nothing is loaded yet; the drives
along the whole motion as tables; a model of the run's own, with the armature that prescribed motion
and rotors need; and the arrays that the kernels step. Where the machine then stands is found by
`initial.rest_of`.
"""

from __future__ import annotations

import sys
import threading
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from jointplay.base.tables import few
from jointplay.model.massless import require_inertia
from jointplay.physics.kernel import ahead as kernel_ahead
from jointplay.physics.kernel.integrators import Integrator, integrator
from jointplay.physics.kernel.sites import LoadSite
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation import acting, base_chart, checks, time_loop
from jointplay.simulation.assemble import check_step, joint_site
from jointplay.simulation.initial import InitialState, behind_gears, initial_state
from jointplay.simulation.loads.drive import ComputedTorque, Drive, JointFriction, Servo, assign
from jointplay.simulation.loads.drive_tables import Reference, table_nodes, tabulate

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

EXPLICIT_DECAY = 0.2
"""Part of a journal's speed that a drive's damping may take in a step explicitly, if it flies: then
the step is off by 2 % of that speed, 1 - 0.2 for exp(-0.2)."""

LONG_STEP_S = 1e-4
"""Step for which that is asked where steps go by their error [s]: judged."""

CHUNK = 2000
"""Steps between two looks at the clock and the keyboard, at most: some milliseconds of work."""


@dataclass(frozen=True)
class Prepared:
    """What `prepare` makes ready."""

    method: Integrator
    total_steps: int
    loop: type[time_loop.TimeLoop]
    longest_macro_step: float
    """[s]."""
    drives: Mapping[str, Drive]
    friction: Mapping[str, JointFriction]
    """Of each joint, that of the servo that turns it directly counted."""
    start: InitialState
    reference: Reference
    model: pin.Model
    """The run's own, for payloads and prescribed motion change its inertias."""
    data: pin.Data
    sites: list[LoadSite]
    workspace: Workspace
    compiles: bool
    """Whether its kernel is being compiled by another process."""


def prepare(simulation: Simulation, in_memory: bool, progress: bool, ahead: bool) -> Prepared:
    """Make a run ready; see `Run` for what is refused.

    Args:
        simulation: what is run.
        in_memory: whether all its records stay in memory.
        progress: show a bar while a long motion is tabulated.
        ahead: begin to compile its kernel if it is not kept.
    """
    mechanism, every = simulation.mechanism, simulation.record_every
    method = integrator(simulation.integrator)
    step, duration, total_steps = checks.check_integration(simulation, method)
    acting.check(simulation.loads)
    drives = assign(mechanism, simulation.motion, simulation.drive)
    if in_memory:
        nodes = table_nodes(simulation.motion, drives, duration)
        checks.check_memory(mechanism, duration, total_steps, every, nodes)
    friction = dict(checks.joint_friction(simulation))
    for name, drive in drives.items():
        if isinstance(drive, Servo) and name not in mechanism.gears:
            friction[name] = drive.with_friction(friction.get(name, JointFriction()))
    followed = [name for name, drive in drives.items() if drive.follows]
    undamped = [
        name
        for name, gear in mechanism.gears.items()
        if gear.damping == 0.0 and isinstance(drive := drives[name], ComputedTorque)
        if drive.encoder == "link" and drive.bandwidth is None
    ]
    if undamped:
        text = "without damping no bandwidth of a drive that its encoder is behind is stable: give "
        text += "the gear's damping or the drive's bandwidth, or put the encoder on the motor"
        warnings.warn(f"through the teeth of {few(undamped)} {text}", RuntimeWarning, stacklevel=5)
    bounds = checks.effort_bounds(simulation, followed)
    start = initial_state(simulation, followed)
    base_chart.check_start(mechanism, start.q)
    require_inertia(mechanism, start.q)
    if simulation.seed is not None and not simulation.starts_at_rest:
        start.perturb(simulation.seed, at_rest=False, behind=behind_gears(drives))
    loop = time_loop.Adaptive if simulation.tolerance else time_loop.MultiRate
    macro_step = simulation.macro_step or loop.longest_macro_step_s
    tables, armature, reference = tabulate(
        mechanism,
        simulation.motion,
        drives,
        duration,
        friction,
        start.q,
        progress,
        bounds,
        ahead=2.0 * (CHUNK * step + macro_step),
        speed=start.v,
    )
    start.move()
    with saying_if_long(progress and ahead):
        # What else is compiled, by this process, is so while another one ends the kernel.
        compiles = ahead and kernel_ahead(method.command)
    model = mechanism.model.copy()
    for at, value in armature.items():
        model.armature[at] += value
    sites = [acting.load_site(load, mechanism, bounds) for load in simulation.loads.values()]
    data = model.createData()
    workspace = Workspace(
        data,
        model.nv,
        [joint_site(mechanism, name, start.q) for name in mechanism.clearance],
        tables,
        step,
        every,
        total_steps // every + 2 if in_memory else 1,
        own_acceleration=not method.single_rate,
        loads=sites,
    )
    workspace.q[:], workspace.v[:] = start.q, start.v
    # The damping of drives that no step follows, or no long one, is solved for implicitly. A drive
    # is tuned to what it carries at rest. While the journal that it turns flies, there is only that
    # journal's inertia, which may be a ten-thousandth.
    longest = step if simulation.tolerance is None else LONG_STEP_S
    inverse = np.diag(pin.computeMinverse(model, data, workspace.q))
    rate = workspace.drives["kd"] * inverse[workspace.drives["coordinate"]]
    workspace.drives["implicit"] = rate * longest > EXPLICIT_DECAY
    equal = step if simulation.tolerance is None else None
    check_step(mechanism, pin.computeTotalMass(model), equal, start.q)
    if equal is not None:
        acting.check_step(simulation.loads, mechanism, equal, start.q)
    return Prepared(
        method,
        total_steps,
        time_loop.SingleRate if method.single_rate else loop,
        macro_step,
        drives,
        friction,
        start,
        reference,
        model,
        data,
        sites,
        workspace,
        compiles,
    )


_COMPILES_S = 5.0
"""Loading compiled kernels takes less than this; compiling them, at the first start, much more."""

_said = threading.Event()
"""Whether this process has said so: each of several kernels is compiled when it is called for."""


@contextmanager
def saying_if_long(say: bool) -> Iterator[None]:
    """Say on standard error, once in a process, that kernels are compiled, if that takes long."""
    words = "compiling the kernels, half a minute or two; the next start loads them"

    def tell() -> None:
        _said.set()
        print(words, file=sys.stderr, flush=True)

    timer = threading.Timer(_COMPILES_S, tell)
    timer.daemon = True
    if say and not _said.is_set():
        timer.start()
    try:
        yield
    finally:
        timer.cancel()
