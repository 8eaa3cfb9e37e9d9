"""What the records of a run point to, opened: arrays, records, and the run's first failure."""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import carray, from_dtype, types
from numba.extending import intrinsic

from jointplay.contact.calls import pointer
from jointplay.kernel.layout import (
    BODY,
    CONTACT,
    DRIVE_ROW,
    FRICTION_ROW,
    GEAR_ROW,
    HOLD,
    JOINT,
    LOAD,
    RUN,
)
from jointplay.kernel.parts import internal

_CONTACT_SIZE = CONTACT.itemsize


def _pointer_to(element: Any) -> Any:
    """Compiled function that reinterprets an integer address as a pointer to `element`."""

    @intrinsic
    def reinterpret(typingctx: Any, at: Any) -> Any:
        def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            return builder.inttoptr(args[0], context.get_value_type(signature.return_type))

        return types.CPointer(element)(at), codegen

    return reinterpret


_whole = _pointer_to(types.int64)
_joint, _contact = _pointer_to(from_dtype(JOINT)), _pointer_to(from_dtype(CONTACT))
_drive, _friction = _pointer_to(from_dtype(DRIVE_ROW)), _pointer_to(from_dtype(FRICTION_ROW))
_gear, _load = _pointer_to(from_dtype(GEAR_ROW)), _pointer_to(from_dtype(LOAD))
_body, _hold = _pointer_to(from_dtype(BODY)), _pointer_to(from_dtype(HOLD))


@intrinsic
def address_of(typingctx: Any, array: Any) -> Any:
    """Pointer to the first element of an array of floats within a record."""

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = signature.args[0]
        value = context.make_array(kind)(context, builder, args[0])
        return builder.bitcast(value.data, ir.PointerType(ir.DoubleType()))

    return types.CPointer(types.float64)(array), codegen


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
def frictions(run):
    """Records of the joints' friction."""
    return carray(_friction(run.frictions), (run.nf,))


@internal
def gears(run):
    """Records of the gears."""
    return carray(_gear(run.gears), (run.ng,))


@internal
def loads(run):
    """Records of the loads."""
    return carray(_load(run.loads), (run.nl,))


@internal
def bodies(run):
    """Records of the bodies to be placed, parents first."""
    return carray(_body(run.bodies), (run.nb,))


@internal
def holds(run):
    """Records of the points held together."""
    return carray(_hold(run.holds), (run.nh,))


@internal
def fail(run, status, contact):
    """Keep the first failure: what follows it only echoes it."""
    if run.status == 0:
        run.status = status
        run.bad_contact = contact


TABLE = (from_dtype(RUN)[::1], types.int64)
"""Signature of the kernels' entries."""
