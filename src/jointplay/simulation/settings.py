"""What the settings of a simulation say of its run, checked."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

from jointplay.errors import JointplayError, MissingName, require_positive
from jointplay.kernel.integrators import DEFAULT, Integrator
from jointplay.loads import limits as limits_of_joints
from jointplay.loads.drive import JointFriction
from jointplay.simulation import limits

if TYPE_CHECKING:
    from jointplay.simulation.simulation import Simulation


def duration(simulation: Simulation) -> float:
    """Simulated time [s]: what is given, or the motion's.

    Raises:
        JointplayError: neither, or a time that is not positive.
    """
    given, motion = simulation.duration, simulation.motion
    if given is None:
        if motion is None:
            raise JointplayError(
                "a simulation without motion needs a duration [s]", where=("duration",)
            )
        given = motion.duration
    return require_positive("duration", given, "s", ("duration",))


def steps(simulation: Simulation, length: float, method: Integrator) -> int:
    """Number of steps in a run of this length [s].

    Raises:
        JointplayError: a step, tolerance, record interval or seed that makes no sense.
    """
    step = require_positive("step", simulation.step, "s", ("step",))
    if simulation.macro_step is not None:
        require_positive("macro step", simulation.macro_step, "s", ("macro_step",))
    if simulation.tolerance is not None:
        require_positive("tolerance", simulation.tolerance, "", ("tolerance",))
    for option in ("macro_step", "tolerance"):
        value = getattr(simulation, option)
        if value is not None and method.single_rate:
            raise JointplayError(
                f"{option} (got {value:g}) belongs to the integrator {DEFAULT!r}; "
                f"{method.name!r} has a fixed step: leave it out, or take {DEFAULT!r}",
                where=(option,),
            )
    limits.check_numbers(step, length, simulation.record_every, simulation.seed)
    number = round(length / step)
    if number < 1:
        raise JointplayError(
            f"duration {length:g} s is shorter than the step {step:g} s", where=("duration",)
        )
    return number


def friction(simulation: Simulation) -> Mapping[str, JointFriction]:
    """Friction by joint: what is given, or the URDF's.

    Raises:
        MissingName: no such joint.
    """
    joints = simulation.mechanism.joints
    given = simulation.joint_friction
    if given is None:
        entries = simulation.mechanism.description.joints
        given = {
            name: JointFriction(entries[name].friction, entries[name].damping) for name in joints
        }
    for name in given:
        if name not in joints:
            raise MissingName("moving joint", name, joints)
    return given


def bounds(simulation: Simulation, followed: Sequence[str]) -> dict[str, float]:
    """Hold the motion against the URDF's limits; returns the efforts that are to be cut.

    Args:
        simulation: has the motion.
        followed: joints whose drives follow it.

    Raises:
        JointplayError: a motion beyond the limits of positions.
    """
    mechanism = simulation.mechanism
    way = limits_of_joints.require_known(simulation.limits)
    if way == "ignore":
        return {}
    if followed:
        assert simulation.motion is not None
        for text in limits_of_joints.check_motion(mechanism, simulation.motion, followed):
            warnings.warn(text, RuntimeWarning, stacklevel=5)
    return limits_of_joints.bounds(mechanism) if way == "cut" else {}
