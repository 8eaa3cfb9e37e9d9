"""What is checked of a run before anything is made: its steps, memory, friction and efforts."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from jointplay.base.errors import (
    JointplayError,
    require_known,
    require_positive,
    require_whole,
)
from jointplay.model.mechanism import Mechanism
from jointplay.physics.kernel.integrators import DEFAULT, Integrator
from jointplay.simulation.loads import limits as limits_of_joints
from jointplay.simulation.loads.drive import JointFriction, urdf_friction
from jointplay.simulation.result.netcdf import MEMORY_SHARE, memory

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation

MOST_STEPS = 10**12
"""Most steps of a run: they would take months."""


def check_integration(simulation: Simulation, method: Integrator) -> tuple[float, float, int]:
    """Refuse settings that make no sense; returns step, end [s] and the number of steps.

    The end is the duration, or that of the last step, if it is later.
    """
    step = require_positive("step", simulation.step, "s", ("step",))
    for option, words, unit in (("macro_step", "macro step", "s"), ("tolerance", "tolerance", "")):
        value = getattr(simulation, option)
        if value is None:
            continue
        require_positive(words, value, unit, (option,))
        if method.single_rate:
            raise JointplayError(
                f"{option} (got {value:g}) belongs to the integrator {DEFAULT!r}; "
                f"{method.name!r} has a fixed step: leave it out, or take {DEFAULT!r}",
                (option,),
            )
    if simulation.tolerance is not None and simulation.tolerance > 1.0:
        said = f"tolerance is relative, at most 1, got {simulation.tolerance:g}"
        raise JointplayError(said, ("tolerance",))
    duration, motion = simulation.duration, simulation.motion
    if duration is None:
        if motion is None:
            said = "a simulation without motion needs a duration [s]"
            raise JointplayError(said, ("duration",))
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
        said = f"duration {duration:g} s is shorter than the step {step:g} s"
        raise JointplayError(said, ("duration",))
    end = count * step
    return step, end if end > (1.0 + 1e-9) * duration else duration, count


def joint_friction(simulation: Simulation) -> Mapping[str, JointFriction]:
    """Friction by joint: what is given, or the URDF's."""
    given, joints = simulation.joint_friction, simulation.mechanism.joints
    for name in given or ():
        require_known("moving joint", name, joints)
    return urdf_friction(simulation.mechanism) if given is None else given


def effort_bounds(simulation: Simulation, followed: Sequence[str]) -> dict[str, float]:
    """Check the motion against the URDF's limits; returns the efforts at which drives are cut."""
    if simulation.limits == "ignore":
        return {}
    if followed:
        assert simulation.motion is not None
        motion = simulation.motion
        for text in limits_of_joints.check_motion(simulation.mechanism, motion, followed):
            warnings.warn(text, RuntimeWarning, stacklevel=6)
    if simulation.limits != "cut":
        return {}
    return limits_of_joints.bounds(simulation.mechanism)


def check_memory(mechanism: Mechanism, duration: float, steps: int, every: int, nodes: int) -> None:
    """Refuse a run whose tables (of `nodes`) and records would not fit, before any are made."""
    nv, contacts = mechanism.model.nv, sum(len(j.contacts) for j in mechanism.clearance.values())
    reference = nodes * 9.0 * max(len(mechanism.joints), 1)
    record = 3.0 * nv + 20.0 + 10.0 * len(mechanism.clearance) + 3.0 * contacts
    # Records are there twice when they are made into histories.
    needed = 8.0 * (reference + 2.0 * record * (steps / every))
    most = MEMORY_SHARE * memory()
    if needed > most:
        fitting = needed - 8.0 * reference
        ratio = fitting / (most - 8.0 * reference) if most > 8.0 * reference else math.inf
        advice = (
            f"record_every = {math.ceil(every * ratio):.3g} would fit, or a shorter duration"
            if math.isfinite(ratio) and every * ratio < steps
            else "take a shorter duration"
        )
        raise JointplayError(
            f"duration {duration:g} s with a record every {every} steps needs about "
            f"{needed / 1e9:.3g} GB of memory, of which there are {most / 1e9:.3g}; {advice}",
            where=("duration",),
        )
