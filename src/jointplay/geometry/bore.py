"""Gaps in a bore that wear has made out of round."""

from __future__ import annotations

import math

import numpy as np

from jointplay.core.compiler import njit
from jointplay.geometry.shapes import _WORN_NODE


def worn_bore(depths: np.ndarray) -> tuple[float, ...]:
    """Numbers by which `worn_gap` knows a bore worn by `depths` at equal azimuths, shape (n,) [m].

    The number of azimuths; then for each the depth, its cubic B-spline's value there, and the
    azimuth's cosine and sine.
    """
    n = len(depths)
    azimuths = 2.0 * np.pi * np.arange(n) / n
    values = (np.roll(depths, 1) + 4.0 * depths + np.roll(depths, -1)) / 6.0
    nodes = np.column_stack([depths, values, np.cos(azimuths), np.sin(azimuths)])
    return float(n), *nodes.ravel().tolist()


@njit(cache=True, error_model="numpy")
def _least_near(node, px, py, ax, ay, d, at, journal_radius):
    """Least of g(u) - R_i between the neighbours of a node, and its u (2); see `worn_gap`.

    Newton's method, kept between the neighbours by bisection.
    """
    n = int(d[at])
    spacing = 2.0 * math.pi / n
    w0 = d[at + 1 + _WORN_NODE * ((node + n - 2) % n)]
    w1 = d[at + 1 + _WORN_NODE * ((node + n - 1) % n)]
    w2 = d[at + 1 + _WORN_NODE * node]
    w3 = d[at + 1 + _WORN_NODE * ((node + 1) % n)]
    w4 = d[at + 1 + _WORN_NODE * ((node + 2) % n)]
    low, high, t = -1.0, 1.0, 0.0
    wear, c, s, root = 0.0, 1.0, 0.0, 1.0
    for _ in range(40):
        # The four depths that shape the spline about t, and how far t is in their middle interval.
        if t < 0.0:
            b0, b1, b2, b3, x = w0, w1, w2, w3, t + 1.0
        else:
            b0, b1, b2, b3, x = w1, w2, w3, w4, t
        y = 1.0 - x
        wear = (
            y * y * y * b0
            + (3.0 * x * x * x - 6.0 * x * x + 4.0) * b1
            + (3.0 * y * y * y - 6.0 * y * y + 4.0) * b2
            + x * x * x * b3
        ) / 6.0
        slope = (
            -y * y * b0 + (3.0 * x * x - 4.0 * x) * b1 + (4.0 * y - 3.0 * y * y) * b2 + x * x * b3
        ) / (2.0 * spacing)
        bend = (y * b0 + (3.0 * x - 2.0) * b1 + (3.0 * y - 2.0) * b2 + x * b3) / spacing**2
        phi = (node + t) * spacing
        c, s = math.cos(phi), math.sin(phi)
        lean, turn = ax * c + ay * s, ay * c - ax * s
        root = math.sqrt(1.0 - lean * lean)
        first = slope + px * s - py * c + journal_radius * lean * turn / root
        second = (
            bend
            + px * c
            + py * s
            + journal_radius
            * (
                (turn * turn - lean * lean) / root
                + lean * lean * turn * turn / (root * root * root)
            )
        )
        if first > 0.0:
            high = t
        else:
            low = t
        step = -first / (second * spacing) if second > 0.0 else 2.0
        if abs(step) < 1e-10 or high - low < 1e-12:
            break
        t += step
        if not low < t < high:
            t = 0.5 * (low + high)
    return wear - px * c - py * s - journal_radius * root, c, s


@njit(cache=True, error_model="numpy")
def worn_gap(px, py, ax, ay, d, at, bore_radius, journal_radius):
    """Gap between a rim of the journal and a worn bore.

    The bore is what its supporting planes leave: the points x with x.u <= R_i + w(u) for all
    directions u across its axis, w being the worn depth, a periodic cubic B-spline through which
    the rim sees no nodes. A rim with the axis `a` and the centre p reaches p.u + R_j |u - (u.a) a|
    in the direction u, so the gap is the minimum of

        g(u) = R_i + w(u) - p.u - R_j sqrt(1 - (u.a)^2)

    and its gradient -u: contact forces do exactly the work that the change of the gap implies. For
    constant w this is `radial_gap` of a wider bore. The minimum is sought about the two lowest
    nodes that are lower than their neighbours, for their order between the nodes may differ.
    Depths that jump by tens of micrometres from azimuth to azimuth may have two minima about one
    node: of 6000 gaps, jumps of up to 5 um left none, of 20 um nine (1.1 um off at most).

    Returns the gap [m] and the direction u (2) at which it is found.
    """
    n = int(d[at])
    lowest, second = 1e300, 1e300
    node, other = n - 1, -n  # not literals: numba would compile `_least_near` for each
    last = at + 1 + _WORN_NODE * (n - 1)
    lean = ax * d[last + 2] + ay * d[last + 3]
    before = d[last + 1] - px * d[last + 2] - py * d[last + 3] + 0.5 * journal_radius * lean * lean
    lean = ax * d[at + 3] + ay * d[at + 4]
    here = d[at + 2] - px * d[at + 3] - py * d[at + 4] + 0.5 * journal_radius * lean * lean
    for i in range(n):
        place = at + 1 + _WORN_NODE * ((i + 1) % n)
        c, s = d[place + 2], d[place + 3]
        lean = ax * c + ay * s
        after = d[place + 1] - px * c - py * s + 0.5 * journal_radius * lean * lean
        if here <= before and here < after:
            if here < lowest:
                second, other = lowest, node if lowest < 1e300 else -n
                lowest, node = here, i
            elif here < second:
                second, other = here, i
        before, here = here, after
    g, c, s = _least_near(node, px, py, ax, ay, d, at, journal_radius)
    if other >= 0:
        g2, c2, s2 = _least_near(other, px, py, ax, ay, d, at, journal_radius)
        if g2 < g:
            g, c, s = g2, c2, s2
    return bore_radius + g, c, s
