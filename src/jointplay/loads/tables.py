"""Drives as tables that the kernels read: references, efforts, gains, by time."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pinocchio as pin

from jointplay.kernel import layout, workspace
from jointplay.kernel.workspace import Tables
from jointplay.loads.drive import (
    PRESCRIBED_ARMATURE,
    REFERENCE_NODE_S,
    ComputedTorque,
    Drive,
    JointFriction,
    Prescribed,
    Torque,
)
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.ideal import ideal_motion
from jointplay.motion.reference import Motion


def table_nodes(motion: Motion | None, drives: Mapping[str, Drive], duration: float) -> int:
    """Nodes of the table of all drives for a run of `duration` seconds.

    It ends where nothing changes any more: the kernels go on with its last node.
    """
    ends = [0.0]
    for drive in drives.values():
        if isinstance(drive, Torque):
            ends.append(drive.times[-1])
        elif drive.follows and motion is not None:
            ends.append(motion.still_from)
    last = min(max(ends), duration)
    still = 1 if last < duration else 0  # both of the last two nodes, for cubics
    return max(math.ceil(last / REFERENCE_NODE_S - 1e-9) + 1 + still, 2)


def tabulate(
    mechanism: Mechanism,
    motion: Motion | None,
    drives: Mapping[str, Drive],
    duration: float,
    friction: Mapping[str, JointFriction],
    start: np.ndarray,
    progress: bool = False,
    bounds: Mapping[str, float] | None = None,
) -> tuple[Tables, dict[int, float]]:
    """Tabulate all drives.

    Args:
        mechanism: what is driven.
        motion: reference of the joints whose drives follow one.
        drives: drive of every moving joint.
        duration: until when the table must reach [s].
        friction: friction by joint.
        start: configuration of `mechanism` at the start, loops closed, shape (nq,).
        progress: show a bar on standard error if it takes long.
        bounds: efforts to which the drives are cut, by joint; prescribed motion is not.

    Returns:
        The tables, and the armature that the model needs, by coordinate [kg m^2 or kg].
    """
    nodes = table_nodes(motion, drives, duration)
    times = np.arange(nodes) * REFERENCE_NODE_S
    driven = [name for name, drive in drives.items() if drive.kind != "free"]
    follows = [name for name in driven if drives[name].follows]
    rows = []
    columns = np.zeros((3, nodes, max(len(driven), 1)))
    if follows:
        assert motion is not None
        order = [motion.joints.index(name) for name in follows]
        position, velocity, acceleration = (values[:, order] for values in motion(times))
        if any(isinstance(drives[name], ComputedTorque) for name in follows):
            effort, carried = ideal_motion(mechanism, motion, follows, times, start, progress)
    model = mechanism.model
    own = pin.crba(model, mechanism.data, start).reshape(model.nv, model.nv).diagonal().copy()
    armature: dict[int, float] = {}
    for u, name in enumerate(driven):
        drive, at = drives[name], mechanism.motor(name)
        gear = mechanism.gears.get(name)
        losses, limit = friction.get(name, JointFriction()), (bounds or {}).get(name, np.inf)
        if isinstance(drive, Torque):
            columns[2, :, u] = np.interp(times, drive.times, drive.values)
            row = workspace.drive_row(u, at, limit=limit)
        else:
            k = follows.index(name)
            columns[0, :, u], columns[1, :, u] = position[:, k], velocity[:, k]
        if isinstance(drive, Prescribed):
            armature[at] = PRESCRIBED_ARMATURE * own[at]
            row = workspace.drive_row(u, at, armature=armature[at])
        if isinstance(drive, ComputedTorque):
            rotor = gear.rotor_inertia if gear else 0.0
            inertia = carried[k] + rotor
            columns[2, :, u] = (
                effort[:, k] + rotor * acceleration[:, k] + losses.torque(velocity[:, k])
            )
            seen = at if drive.encoder == "motor" else mechanism.coordinate(name)
            kp = drive.bandwidth**2 * inertia
            kd = 2.0 * drive.damping_ratio * drive.bandwidth * inertia
            row = workspace.drive_row(u, at, seen, kp, kd, limit=limit)
        rows.append(row)
    frictions = [
        workspace.friction_row(
            mechanism.coordinate(name),
            losses.coulomb,
            losses.excess,
            losses.stribeck_speed,
            losses.viscous,
        )
        for name, losses in friction.items()
        if losses.coulomb or losses.excess or losses.viscous
    ]
    gears = [
        workspace.gear_row(
            mechanism.motor(name),
            mechanism.coordinate(name),
            gear.play / 2.0,
            gear.stiffness,
            gear.damping,
        )
        for name, gear in mechanism.gears.items()
    ]
    tables = Tables(
        workspace.stacked(rows, layout.DRIVE_ROW),
        workspace.stacked(frictions, layout.FRICTION_ROW),
        workspace.stacked(gears, layout.GEAR_ROW),
        np.hstack(list(columns)),
        REFERENCE_NODE_S,
    )
    return tables, armature
