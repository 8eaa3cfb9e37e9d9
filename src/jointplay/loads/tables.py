"""Drives as tables that the kernels read: references, efforts, gains, by time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from jointplay.kernel import layout
from jointplay.kernel.tables import Tables, drive_row, friction_row, gear_row, stacked
from jointplay.loads.drive import (
    PRESCRIBED_ARMATURE,
    ComputedTorque,
    Drive,
    JointFriction,
    Prescribed,
    Torque,
)
from jointplay.loads.reference import REFERENCE_NODE_S, Efforts, Reference, nodes_ahead
from jointplay.mechanism.mechanism import Mechanism
from jointplay.motion.ideal import IdealMotion
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
    ahead: float = 0.0,
) -> tuple[Tables, dict[int, float], Reference]:
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
        ahead: how far beyond the present the table must always reach [s].

    Returns:
        The tables as they are at the start, the armature that the model needs, by coordinate
        [kg m^2 or kg], and what the tables of later times come from.
    """
    nodes = table_nodes(motion, drives, duration)
    driven = [name for name, drive in drives.items() if drive.kind != "free"]
    follows = [name for name in driven if drives[name].follows]
    ideal = None
    if any(isinstance(drives[name], ComputedTorque) for name in follows):
        assert motion is not None
        end = (nodes - 1) * REFERENCE_NODE_S
        ideal = IdealMotion(mechanism, motion, follows, end, start)
    columns: list[Any] = []
    efforts: dict[int, Efforts] = {}
    rows = []
    model = mechanism.model
    own = pin.crba(model, mechanism.data, start).reshape(model.nv, model.nv).diagonal().copy()
    armature: dict[int, float] = {}
    for u, name in enumerate(driven):
        drive, at = drives[name], mechanism.motor(name)
        gear = mechanism.gears.get(name)
        losses, limit = friction.get(name, JointFriction()), (bounds or {}).get(name, np.inf)
        if isinstance(drive, Torque):
            columns.append((drive.times, drive.values))
            row = drive_row(u, at, limit=limit)
        else:
            columns.append(k := follows.index(name))
        if isinstance(drive, Prescribed):
            armature[at] = PRESCRIBED_ARMATURE * own[at]
            row = drive_row(u, at, armature=armature[at])
        if isinstance(drive, ComputedTorque):
            assert ideal is not None
            rotor = gear.rotor_inertia if gear else 0.0
            inertia = ideal.inertia[k] + rotor
            efforts[k] = partial(_effort, rotor, losses)
            seen = at if drive.encoder == "motor" else mechanism.coordinate(name)
            kp = drive.bandwidth**2 * inertia
            kd = 2.0 * drive.damping_ratio * drive.bandwidth * inertia
            row = drive_row(u, at, seen, kp, kd, limit=limit)
        rows.append(row)
    reference = Reference(
        columns, nodes, follows, motion, ideal, efforts, nodes_ahead(ahead), progress
    )
    tables = Tables(
        stacked(rows, layout.DRIVE_ROW),
        _friction_rows(mechanism, friction),
        _gear_rows(mechanism),
        reference.table,
        REFERENCE_NODE_S,
        nodes,
    )
    return tables, armature, reference


def _effort(
    rotor: float,
    losses: JointFriction,
    ideal: np.ndarray,
    velocity: np.ndarray,
    acceleration: np.ndarray,
) -> np.ndarray:
    """Effort of a drive that also turns its rotor and overcomes its joint's friction."""
    effort: np.ndarray = ideal + rotor * acceleration + losses.torque(velocity)
    return effort


def _friction_rows(mechanism: Mechanism, friction: Mapping[str, JointFriction]) -> np.ndarray:
    """Records of the joints that have friction."""
    rows = [
        friction_row(
            mechanism.coordinate(name),
            losses.coulomb,
            losses.excess,
            losses.stribeck_speed,
            losses.viscous,
        )
        for name, losses in friction.items()
        if losses.coulomb or losses.excess or losses.viscous
    ]
    return stacked(rows, layout.FRICTION_ROW)


def _gear_rows(mechanism: Mechanism) -> np.ndarray:
    """Records of the gears."""
    rows = [
        gear_row(
            mechanism.motor(name),
            mechanism.coordinate(name),
            gear.play / 2.0,
            gear.stiffness,
            gear.damping,
        )
        for name, gear in mechanism.gears.items()
    ]
    return stacked(rows, layout.GEAR_ROW)
