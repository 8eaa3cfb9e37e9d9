"""What the records of a run point to, opened: arrays, records, and the run's first failure."""

from __future__ import annotations

from numba import carray, from_dtype, types

from jointplay.core.compiler import internal, pointer, pointer_to
from jointplay.kernel.layout import (
    BODY,
    CONTACT,
    DRIVE_ROW,
    FRICTION_ROW,
    GEAR_ROW,
    HOLD,
    JOINT,
    LOAD,
    REFINED_GEAR,
    RUN,
    SERVO,
)

_CONTACT_SIZE = CONTACT.itemsize


_whole = pointer_to(types.int64)
_joint, _contact = pointer_to(from_dtype(JOINT)), pointer_to(from_dtype(CONTACT))
_drive, _friction = pointer_to(from_dtype(DRIVE_ROW)), pointer_to(from_dtype(FRICTION_ROW))
_gear, _load = pointer_to(from_dtype(GEAR_ROW)), pointer_to(from_dtype(LOAD))
_refined, _servo = pointer_to(from_dtype(REFINED_GEAR)), pointer_to(from_dtype(SERVO))
_body, _hold = pointer_to(from_dtype(BODY)), pointer_to(from_dtype(HOLD))


@internal
def floats(at, size):
    """Array of `size` floats at an address."""
    return carray(pointer(at), (size,))


@internal
def matrix(at, rows, columns):
    """Array (rows, columns) of floats at an address."""
    return carray(pointer(at), (rows, columns))


@internal
def integers(at, size):
    """Array of `size` whole numbers at an address."""
    return carray(_whole(at), (size,))


@internal
def joints(run):
    """Records of the joints with clearance."""
    return carray(_joint(run.joints), (run.nj,))


@internal
def contacts(run, j):
    """Records of the contacts of joint j."""
    return carray(_contact(run.contacts + _CONTACT_SIZE * run.width * j), (run.width,))


@internal
def drives(run):
    """Records of the drives."""
    return carray(_drive(run.drives), (run.nd,))


@internal
def servos(run):
    """Records of the servos' controllers."""
    return carray(_servo(run.servos), (run.ns,))


@internal
def frictions(run):
    """Records of the joints' friction."""
    return carray(_friction(run.frictions), (run.nf,))


@internal
def gears(run):
    """Records of the gears that have only play, a spring and a damper."""
    return carray(_gear(run.gears), (run.ng,))


@internal
def refined_gears(run):
    """Records of all others."""
    return carray(_refined(run.refined_gears), (run.nr,))


@internal
def loads(run):
    """Records of the loads."""
    return carray(_load(run.loads), (run.nl,))


@internal
def bodies(run):
    """Records of the bodies to be placed, parents first."""
    return carray(_body(run.bodies), (run.nb,))


@internal
def held_pairs(run):
    """Records of the points held together."""
    return carray(_hold(run.holds), (run.nh,))


@internal
def record_failure(run, status, contact):
    """Keep the first failure: later ones follow from it."""
    if run.status == 0:
        run.status = status
        run.bad_contact = contact


TABLE = (from_dtype(RUN)[::1], types.int64)
"""Signature of the kernels' entries."""
