"""Access from compiled code to what records point to: `run.minv` is an array there.

It has the shape that `layout` declares, with the sizes that the record has at that moment.
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
    """View of all numbers of an array, shape (size,)."""
    return carray(address_of(array), (array.size,))


@compiled
def square(array, n):
    """View of an array's first n^2 floats as a matrix (n, n); n may be a compile-time constant."""
    return carray(address_of(array), (n, n))


_integer_pointer = pointer_to(np.int64)


@compiled
def machine_words(address, size):
    """Array of `size` 8-byte words at an address, as whole numbers."""
    return carray(_integer_pointer(address), (size,))


@compiled
def record_failure(run, status, contact):
    """Keep the first failure: later ones follow from it."""
    if run.status == 0:
        run.status = status
        run.bad_contact = contact


PART = "d(i,i,i,i)"
"""Signature of a joint's part, compiled apart and called by address as most runs do without it. It
takes the addresses of run and joint, the joint's index, and a task."""
RUN_PART = "v(i,p,p,p,d,i)"
"""Signature of a run's part, compiled apart likewise. It takes the run's address, the vectors q, v
and tau, the time, and a task, which uses those of them that it needs."""

call_part, _call_run_part = calling(PART), calling(RUN_PART)

_run, _joint = pointer_to(RUN), pointer_to(JOINT)


@compiled
def run_at(address):
    """Record of a run at an address."""
    return carray(_run(address), (1,))[0]


@compiled
def joint_at(address):
    """Record of a joint at an address."""
    return carray(_joint(address), (1,))[0]


@compiled
def run_part(part, run, q, v, tau, time, task):
    """Call a part of the run at the address `part` for one of its tasks (`RUN_PART`)."""
    vectors = address_of(q), address_of(v), address_of(tau)
    _call_run_part(part, (place_of(run), *vectors, time, task))
