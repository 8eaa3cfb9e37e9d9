"""What the records of a run point to, opened: `run.minv` is an array in compiled code.

It has the shape that `layout` declares, by the sizes that the record has at that moment.
"""

from __future__ import annotations

import numpy as np

from jointplay.base.compiler import (
    address_of,
    calling,
    carray,
    compiled,
    open_arrays,
    place_of,
    pointer_to,
)
from jointplay.physics.kernel.layout import ARRAYS, JOINT, RUN, term

for _record, _arrays in ARRAYS.items():
    open_arrays(
        _record,
        {
            name: (array.kind, [term(size) for size in array.shape])
            for name, array in _arrays.items()
        },
    )


@compiled
def flat(array):
    """All numbers of an array in a row."""
    return carray(address_of(array), (array.size,))


@compiled
def square(array, n):
    """Matrix (n, n) of floats, the first that an array has: n may be known to the compiler."""
    return carray(address_of(array), (n, n))


_integer_pointer = pointer_to(np.int64)


@compiled
def machine_words(address, size):
    """Array of `size` whole numbers, or what else has 8 bytes, at an address."""
    return carray(_integer_pointer(address), (size,))


@compiled
def record_failure(run, status, contact):
    """Keep the first failure: later ones follow from it."""
    if run.status == 0:
        run.status = status
        run.bad_contact = contact


PART = "d(i,i,i,i)"
"""Signature of what is compiled apart and called by address, as most runs do without it: of the
addresses of run and joint, the joint's number, and what is to be done."""
RUN_PART = "v(i,p,p,p,d,i)"
"""The same of parts of the whole run: of its address, the vectors q, v and tau, the time, and which
of its tasks it is to do. A task reads and writes those of them that it needs."""

call_part, _call_run_part = calling(PART), calling(RUN_PART)

_run, _joint = pointer_to(RUN), pointer_to(JOINT)


@compiled
def run_at(address):
    """The record of a run at an address."""
    return carray(_run(address), (1,))[0]


@compiled
def joint_at(address):
    """The record of a joint at an address."""
    return carray(_joint(address), (1,))[0]


@compiled
def run_part(part, run, q, v, tau, time, task):
    """Have a part of the whole run, by its address, do one of its tasks (`RUN_PART`)."""
    vectors = address_of(q), address_of(v), address_of(tau)
    _call_run_part(part, (place_of(run), *vectors, time, task))
