"""Preparing a run: its settings checked, its tables made, its arrays laid out.

`prepare` goes in this order:

1. the number of steps, and whether their records fit in memory;
2. the drive of each joint, its friction, and the effort at which its drive saturates;
3. the initial state, loops closed and nothing loaded yet;
4. the drives along the whole motion as tables;
5. a Pinocchio model of the run's own, with the armature of prescribed motion;
6. the arrays that the kernels step, and whether the step resolves contacts and loads.

Where the machine then rests is found by `initial.find_rest`.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pinocchio as pin

from jointplay.base.errors import (
    JointplayError,
    JointplayWarning,
    require_known,
    require_positive,
    require_whole,
)
from jointplay.base.tables import few
from jointplay.model.impact import REFERENCE_SPEED, contact_duration, effective_mass, tooth_duration
from jointplay.model.massless import require_inertia
from jointplay.model.mechanism import Mechanism
from jointplay.physics import kernel
from jointplay.physics.contact import elastic, resultant
from jointplay.physics.contact.law import Law
from jointplay.physics.contact.machine_code import address, check_parameters
from jointplay.physics.kernel import ahead as kernel_ahead
from jointplay.physics.kernel import layout
from jointplay.physics.kernel.constants import DEFAULT, Integrator, integrator
from jointplay.physics.kernel.layout import JointSite, LoadSite
from jointplay.physics.kernel.workspace import Workspace
from jointplay.simulation import acting, base_chart, time_loop
from jointplay.simulation.initial import InitialState, behind_gears, initial_state
from jointplay.simulation.loads import limits as limits_of_joints
from jointplay.simulation.loads.drive import (
    ComputedTorque,
    Drive,
    JointFriction,
    Servo,
    assign,
    urdf_friction,
)
from jointplay.simulation.loads.drive_tables import Reference, table_nodes, tabulate
from jointplay.simulation.result.netcdf import MEMORY_SHARE, memory

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation


# Checks of the settings: steps, memory, friction and efforts.

MOST_STEPS = 10**12
"""Most steps of a run: more would take months."""


def check_integration(simulation: Simulation, method: Integrator) -> tuple[float, float, int]:
    """Refuse settings that make no sense; returns step, end [s] and the number of steps.

    The end is the duration, or the end of the last step if that is later.
    """
    step = require_positive("step", simulation.step, "s", ("step",))
    for option, noun, unit in (("macro_step", "macro step", "s"), ("tolerance", "tolerance", "")):
        value = getattr(simulation, option)
        if value is None:
            continue
        require_positive(noun, value, unit, (option,))
        if method.single_rate:
            raise JointplayError(
                f"{option} (got {value:g}) belongs to the integrator {DEFAULT!r}; "
                f"{method.name!r} has a fixed step: leave it out, or take {DEFAULT!r}",
                (option,),
            )
    if simulation.tolerance is not None and simulation.tolerance > 1.0:
        raise JointplayError(
            f"tolerance is relative, at most 1, got {simulation.tolerance:g}", ("tolerance",)
        )
    duration, motion = simulation.duration, simulation.motion
    if duration is None:
        if motion is None:
            raise JointplayError("a simulation without motion needs a duration [s]", ("duration",))
        duration = motion.duration
    duration = require_positive("duration", duration, "s", ("duration",))
    require_whole("record_every", simulation.record_every, 1, MOST_STEPS, ("record_every",))
    if simulation.seed is not None:
        require_whole("seed", simulation.seed, 0, 2**63 - 1, ("seed",))
    if duration / step > MOST_STEPS:
        steps = f"{duration / step:.3g} steps of {step:g} s; at most {MOST_STEPS:.0e} are possible"
        raise JointplayError(f"duration {duration:g} s is {steps}", ("duration",))
    count = round(duration / step)
    if count < 1:
        raise JointplayError(
            f"duration {duration:g} s is shorter than the step {step:g} s", ("duration",)
        )
    end = count * step
    return step, end if end > (1.0 + 1e-9) * duration else duration, count


def joint_friction(simulation: Simulation) -> Mapping[str, JointFriction]:
    """Friction of each joint: as given, or the URDF's."""
    friction, joints = simulation.joint_friction, simulation.mechanism.joints
    for name in friction or ():
        require_known("moving joint", name, joints)
    return urdf_friction(simulation.mechanism) if friction is None else friction


def effort_bounds(simulation: Simulation, followed: Sequence[str]) -> dict[str, float]:
    """Check the motion against the URDF's limits; returns the efforts at which drives saturate."""
    if simulation.limits == "ignore":
        return {}
    if followed:
        assert simulation.motion is not None
        motion = simulation.motion
        for text in limits_of_joints.check_motion(simulation.mechanism, motion, followed):
            warnings.warn(text, JointplayWarning, stacklevel=6)
    if simulation.limits != "cut":
        return {}
    return limits_of_joints.bounds(simulation.mechanism)


def check_memory(mechanism: Mechanism, end: float, steps: int, interval: int, nodes: int) -> None:
    """Refuse a run whose tables (of `nodes`) and records would not fit in memory."""
    nv, contacts = mechanism.model.nv, sum(len(j.contacts) for j in mechanism.clearance.values())
    reference = nodes * 9.0 * max(len(mechanism.joints), 1)
    record = 3.0 * nv + 20.0 + 10.0 * len(mechanism.clearance) + 3.0 * contacts
    # Records are there twice when they are made into histories.
    needed = 8.0 * (reference + 2.0 * record * (steps / interval))
    most = MEMORY_SHARE * memory()
    if needed > most:
        fitting = needed - 8.0 * reference
        ratio = fitting / (most - 8.0 * reference) if most > 8.0 * reference else math.inf
        advice = (
            f"record_every = {math.ceil(interval * ratio):.3g} would fit, or a shorter duration"
            if math.isfinite(ratio) and interval * ratio < steps
            else "take a shorter duration"
        )
        raise JointplayError(
            f"duration {end:g} s with a record every {interval} steps needs about "
            f"{needed / 1e9:.3g} GB of memory, of which there are {most / 1e9:.3g}; {advice}",
            where=("duration",),
        )


# Joints as the kernels have them, and whether the step resolves their contacts.

MIN_CONTACT_STEPS = 4.0
"""Number of steps in an impact below which the step is refused.

At 4 steps the restitution of an impact scatters by 0.03 (0.07 at c_e = 0.5), at 2 an impact can
gain energy (docs/validation.md).
"""
NO_MASS = 1e-9
"""Part of the mechanism's mass below which the effective mass of a contact counts as none."""
FILM_LAG = 0.5
"""Part of the effective mass at the start by which a film's lag is set: that mass may fall on the
way."""
REST_SPEED = 0.05
"""Speed to which the damping of a resting contact is referred, relative to that of an impact which
would store the same energy.

If it were smaller, explicit steps could not resolve the damping of a resting contact; if larger,
it would also damp moving contacts: the restitution of an impact is left as it is while the mass
that it meets is below 1/REST_SPEED^2 = 400 times the smallest one of the start (docs/theory.md,
section 5).
"""


LARGEST_TURN = 1.0
"""Step times natural frequency on a preloaded bearing above which the step is refused [rad]."""


def joint_site(mechanism: Mechanism, name: str, q: np.ndarray) -> JointSite:
    """The joint with clearance `name` as the kernels have it; q is the start's."""
    joint = mechanism.clearance[name]
    mass = effective_mass(mechanism, name, q)
    record = np.zeros(1, layout.JOINT)
    parameters = np.zeros((len(joint.contacts), layout.MAX_PARAMETERS))
    for contact, row in enumerate(parameters):
        _fill(row, joint.normal, joint.normal.parameters(joint.contact_properties(contact)))
    _fill(record["friction_parameters"][0], joint.friction, joint.friction.parameters())
    record["normal_law"], record["friction_law"] = address(joint.normal), address(joint.friction)
    record["bristles"] = joint.friction.bristles
    record["shape"], record["count"] = int(joint.shape), len(joint.contacts)
    if joint.resultant is not None:
        record["resultant"], record["element_law"] = 1, elastic.address(joint.law)
        record["cage"] = joint.resultant[resultant.CAGE]
    record["wearing"] = len(joint.wear.widths) if joint.wear else 0
    record["limit"] = -joint.depth_limit
    record["rest_mass"] = mass / REST_SPEED**2
    if joint.film is not None:
        law, properties = joint.film
        _fill(record["film_parameters"][0], law, law.parameters(properties))
        record["film_law"] = address(law)
        record["must_not_touch"] = 0 if law.hybrid else properties.contacts
        record["sections"] = properties.contacts
        record["section"] = law.section * properties.length if properties.tilts else 0.0
        record["clearance"] = properties.clearance
        record["thinnest"] = law.thickest(properties.clearance)
        record["transition"] = law.transition
        record["lag_mass"] = FILM_LAG * mass
    holds = joint.law in resultant.HOLDING
    if mechanism.has_virtual_link(name):
        record["first"] = mechanism.virtual_link(name)
        return JointSite(record, parameters, joint.dimensions, holds)
    record["first"] = layout.NO_VIRTUAL_LINK
    carriers = mechanism.frames(name)
    return JointSite(record, parameters, joint.dimensions, holds, carriers, mechanism.signs(name))


def _fill(row: np.ndarray, law: Law, parameters: tuple[float, ...]) -> None:
    row[: len(parameters)] = check_parameters(parameters, law.name)


def _link_masses(mechanism: Mechanism, name: str) -> str:
    """The masses of the two links of a joint, in words."""
    sides = [index for index, _ in mechanism.frames(name)]
    if name in mechanism.loops:
        loop = mechanism.loops[name]
        links = (loop.bearing_link, loop.journal_link)
    else:
        entry = mechanism.description.joints[name]
        links = (entry.parent, entry.child)
    if mechanism.clearance[name].exchanged:
        sides = sides[::-1]
    masses = [float(mechanism.model.inertias[index].mass) for index in sides]
    return " and ".join(
        f"link {link!r} belongs to the ground" if index == 0 else f"link {link!r} has {mass:.2g} kg"
        for link, index, mass in zip(links, sides, masses, strict=True)
    )


def _check_step_follows(mechanism: Mechanism, name: str, step: float, q: np.ndarray) -> None:
    """Refuse a step [s] too large for the vibration on springs or on a preloaded bearing."""
    joint = mechanism.clearance[name]
    assert joint.resultant is not None
    centred = np.concatenate([np.zeros(3), np.eye(3).ravel()])
    answer = elastic.answers(joint.law, joint.resultant, centred[None])[0]
    stiffness = answer[resultant.TANGENT : resultant.ANSWERS].reshape(6, 6)
    jacobian = mechanism.relative_jacobian(name, q)
    # The squares of the natural frequencies are the eigenvalues of J M^-1 J^T K.
    squares = np.linalg.eigvals(
        jacobian @ mechanism.inverse_mass_matrix(q) @ jacobian.T @ stiffness
    ).real
    frequency = float(np.sqrt(max(squares.max(), 0.0)))
    if frequency * step > LARGEST_TURN:
        raise JointplayError(
            f"step {step:g} s is too large for the stiffness of {name!r}: what it carries "
            f"would swing at {frequency / (2.0 * np.pi):.3g} Hz, so take at most "
            f"{LARGEST_TURN / frequency:.2g} s, or a tolerance",
            where=("step",),
        )


def check_step(mechanism: Mechanism, mass_of_all: float, step: float | None, q: np.ndarray) -> None:
    """Refuse contacts without effective mass, and a step [s] too large for an impact.

    `step`: None where steps are chosen by their error, of which none is too large.
    """
    for name in mechanism.clearance:
        mass = effective_mass(mechanism, name, q)
        if not mass >= NO_MASS * mass_of_all:
            raise JointplayError(
                f"a contact in joint {name!r} would meet a mass of {mass:.2g} kg only, of "
                f"{mass_of_all:.3g} kg in all: {_link_masses(mechanism, name)}; give the "
                "lighter one more mass or inertia in the URDF"
            )
    if step is None:
        return
    for name, joint in mechanism.clearance.items():
        if joint.resultant is not None:
            _check_step_follows(mechanism, name, step, q)
        if joint.law not in resultant.HOLDING:  # in those there are no impacts
            impact = f"the contact stiffness at {name!r}: an impact at {REFERENCE_SPEED:g} m/s"
            _check_step_resolves(step, contact_duration(mechanism, name, q), impact)
    for name in mechanism.gears:
        impact = f"the stiffness of the gear at {name!r}: an impact of its teeth"
        _check_step_resolves(step, tooth_duration(mechanism, name, q), impact)


def _check_step_resolves(step: float, duration: float, impact: str) -> None:
    if duration < MIN_CONTACT_STEPS * step:
        raise JointplayError(
            f"step {step:g} s is too large for {impact} lasts {duration:.2g} s, so take at most "
            f"{duration / kernel.WELL_RESOLVED_STEPS:.2g} s",
            where=("step",),
        )


EXPLICIT_DECAY = 0.2
"""Largest part of a free journal's speed that a drive's damping takes in an explicit step; stronger
damping is solved implicitly. At this limit the step errs by 2 %: 1 - 0.2 instead of exp(-0.2)."""
LONG_STEP_S = 1e-4
"""Step to which `EXPLICIT_DECAY` is applied where steps are chosen by their error [s]: judged."""
CHUNK = 2000
"""Most steps between two looks at the clock and the keyboard: some milliseconds of work."""


@dataclass(frozen=True)
class Prepared:
    """All that `prepare` makes for a run."""

    method: Integrator
    total_steps: int
    loop: type[time_loop.TimeLoop]
    longest_macro_step: float
    """Longest macro step of the multi-rate method [s]."""
    drives: Mapping[str, Drive]
    """Drive of each moving joint."""
    friction: Mapping[str, JointFriction]
    """Friction of each joint, that of a servo that turns it directly included."""
    start: InitialState
    reference: Reference
    model: pin.Model
    """The run's own model, for payloads and prescribed motion change its inertias."""
    data: pin.Data
    sites: list[LoadSite]
    """The loads as the kernels have them."""
    workspace: Workspace
    compiles: bool
    """Whether another process is compiling the kernel."""


def prepare(simulation: Simulation, in_memory: bool, progress: bool, ahead: bool) -> Prepared:
    """Make a run ready; see `Run` for what is refused.

    Args:
        simulation: the inputs of the run.
        in_memory: whether all its records stay in memory.
        progress: show a bar while a long motion is tabulated.
        ahead: begin to compile the kernel in another process if it is not cached.
    """
    mechanism, record_every = simulation.mechanism, simulation.record_every
    method = integrator(simulation.integrator)
    step, duration, total_steps = check_integration(simulation, method)
    drives = assign(mechanism, simulation.motion, simulation.drive)
    if in_memory:
        nodes = table_nodes(simulation.motion, drives, duration)
        check_memory(mechanism, duration, total_steps, record_every, nodes)
    # Friction, and drives through teeth that no bandwidth keeps stable.
    friction = dict(joint_friction(simulation))
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
        text = f"the gear of {few(undamped)} has no damping, so that no bandwidth of a drive with "
        text += "its encoder on the link is stable: give the gear's damping or the drive's "
        text += "bandwidth, or put the encoder on the motor"
        warnings.warn(text, JointplayWarning, stacklevel=5)
    bounds = effort_bounds(simulation, followed)
    # The initial state.
    start = initial_state(simulation, followed)
    base_chart.check_start(mechanism, start.q)
    require_inertia(mechanism, start.q)
    if simulation.seed is not None and not simulation.starts_at_rest:
        start.perturb(simulation.seed, at_rest=False, behind=behind_gears(drives))
    # Tables of the drives; those kept in memory reach two stretches ahead.
    loop = time_loop.Adaptive if simulation.tolerance else time_loop.MultiRate
    macro_step = simulation.macro_step or loop.longest_macro_step_s
    ahead_s = 2.0 * (CHUNK * step + macro_step)
    tables, reference = tabulate(
        mechanism, simulation.motion, drives, duration, friction, start.q, progress, bounds,
        ahead_s, start.v,
    )  # fmt: skip
    start.move()
    # What else must be compiled, this process compiles while another one ends the kernel.
    compiles = ahead and kernel_ahead(method.command)
    # The run's own model, and the arrays of the kernels.
    model = mechanism.model.copy()
    for row in tables.drives:
        model.armature[row["coordinate"]] += row["armature"]
    sites = [acting.load_site(load, mechanism, bounds) for load in simulation.loads.values()]
    data = model.createData()
    workspace = Workspace(
        data,
        model.nv,
        [joint_site(mechanism, name, start.q) for name in mechanism.clearance],
        tables,
        step,
        record_every,
        total_steps // record_every + 2 if in_memory else 1,
        own_acceleration=not method.single_rate,
        loads=sites,
    )
    workspace.q[:], workspace.v[:] = start.q, start.v
    # The damping of drives that the step, or a long one, does not follow is solved implicitly. A
    # drive is tuned to what it carries at rest. While the journal that it turns flies, it meets
    # only that journal's inertia, which may be a ten-thousandth.
    longest = step if simulation.tolerance is None else LONG_STEP_S
    inverse = np.diag(pin.computeMinverse(model, data, workspace.q))
    rate = workspace.drives["kd"] * inverse[workspace.drives["coordinate"]]
    workspace.drives["implicit"] = rate * longest > EXPLICIT_DECAY
    equal = step if simulation.tolerance is None else None
    check_step(mechanism, pin.computeTotalMass(model), equal, start.q)
    if equal is not None:
        acting.check_step(simulation.loads, mechanism, equal, start.q)
    stepper = time_loop.SingleRate if method.single_rate else loop
    return Prepared(
        method, total_steps, stepper, macro_step, drives, friction, start, reference,
        model, data, sites, workspace, compiles,
    )  # fmt: skip
