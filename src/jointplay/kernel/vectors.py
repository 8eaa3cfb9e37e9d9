"""Vectors of three numbers as tuples: what compiled code reckons with. All are inlined."""

from __future__ import annotations

import math

from jointplay.host.numba_cache import njit

inlined = njit(inline="always", error_model="numpy")


@inlined
def vector(array, at):
    """Three numbers of an array, from index `at` on."""
    return array[at], array[at + 1], array[at + 2]


@inlined
def put(array, at, a):
    """Write a vector into an array, from index `at` on."""
    array[at], array[at + 1], array[at + 2] = a


@inlined
def add(a, b):
    """a + b."""
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


@inlined
def scale(s, a):
    """S times a."""
    return s * a[0], s * a[1], s * a[2]


@inlined
def along(a, s, b):
    """a + s b."""
    return a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2]


@inlined
def dot(a, b):
    """a . b."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@inlined
def cross(a, b):
    """A x b."""
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@inlined
def length(a):
    """|a|."""
    return math.sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2])
