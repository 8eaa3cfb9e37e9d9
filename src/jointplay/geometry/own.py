"""Kinds of joint that bring their own geometry: its compiled function is called by address.

Such a function gets the index of the contact, the pose of the journal in the bearing frame (its
centre, then its orientation row by row), and the joint's dimensions; it writes what
`geometry.touch` returns. `contact.compiled.compiled_touch` makes one.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

POSE, ANSWER = 12, 7
"""Numbers of a pose, and of what touching answers: gap, place (3), normal (3)."""


@intrinsic
def call_touch(
    typingctx: Any, address: Any, k: Any, d: Any, at: Any, centre: Any, turn: Any, last: Any
) -> Any:
    """Call the function at `address` for contact k.

    The pose comes in three tuples: centre (3), and rows of the orientation (6 and 3).

    The dimensions begin at index `at` of d, an array or a pointer (compiled code only).
    """

    def codegen(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        double = ir.DoubleType()
        array = double.as_pointer()
        dimensions = args[2]
        if isinstance(signature.args[2], types.Array):
            dimensions = context.make_array(signature.args[2])(context, builder, dimensions).data
        dimensions = builder.gep(builder.bitcast(dimensions, array), [args[3]])
        there = cgutils.alloca_once(builder, double, size=POSE)
        parts = [
            builder.extract_value(values, i)
            for kind, values in zip(signature.args[4:], args[4:], strict=True)
            for i in range(len(kind))
        ]
        for i, number in enumerate(parts):
            builder.store(number, cgutils.gep_inbounds(builder, there, i))
        out = cgutils.alloca_once(builder, double, size=ANSWER)
        kind = ir.FunctionType(ir.VoidType(), [ir.IntType(64), array, array, array])
        function = builder.inttoptr(args[0], kind.as_pointer())
        builder.call(function, [args[1], there, dimensions, out])
        numbers = [builder.load(cgutils.gep_inbounds(builder, out, i)) for i in range(ANSWER)]
        return context.make_tuple(builder, signature.return_type, numbers)

    answer = types.UniTuple(types.float64, ANSWER)
    return answer(types.int64, types.int64, d, types.int64, centre, turn, last), codegen
