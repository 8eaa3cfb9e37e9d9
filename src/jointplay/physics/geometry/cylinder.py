"""Gaps of a cylinder in its bearing, round or worn, for skew axes (eqs 4-9)."""

from __future__ import annotations

import math

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.physics.geometry.shapes import _WORN_NODE, EDGE_ROUNDING_M


@compiled
def deepest_rim_direction(pt: float, pn: float, sin_tilt: float, cos_tilt: float, radius: float):
    """Direction on the rim of the point farthest from the bearing's axis.

    Seen along the bore, a tilted rim is an ellipse: semi-axis R cos(tilt) along the tilt direction
    t, R along n. Its centre is (pt, pn). The farthest point (cos phi, sin phi) satisfies

        pn cos(phi) - pt cos(tilt) sin(phi) + R sin(tilt)^2 sin(phi) cos(phi) = 0

    and lies in the quadrant of (pt, pn), where the root is unique. A circle's farthest point would
    be in the direction alpha of (x, y) = (|pt cos(tilt)|, |pn|); from there it is turned by delta:

        sin(delta) = kappa sin(2 alpha + 2 delta),   kappa = R sin(tilt)^2 / (2 |(x, y)|)

    It is solved by Newton's method with the slope at delta = 0, starting from the expansion to
    third order; where kappa is not small, by bisection.

    Returns (cos phi, sin phi).
    """
    bulge = radius * sin_tilt * sin_tilt
    x = abs(pt) * abs(cos_tilt)
    y = abs(pn)
    norm = math.sqrt(x * x + y * y)
    # Also the limit of a centred, tilted rim, whose long half-axis wins (a centred, untilted one
    # has no deepest point, and none is needed: its gap is the whole clearance).
    if norm <= 1e-150:  # its square would be denormal
        return 0.0, 1.0
    inverse = 1.0 / norm
    c = x * inverse
    s = y * inverse
    kappa = 0.5 * bulge * inverse
    if kappa < 0.05:
        twice_sin, twice_cos = 2.0 * kappa * s * c, 2.0 * kappa * (c * c - s * s)
        relief = 1.0 + twice_cos + twice_cos * twice_cos  # about 1 / (1 - twice_cos)
        turn = twice_sin * relief
        cubic = turn * turn * (2.0 * twice_sin + 0.5 * twice_cos * turn)
        turn -= relief * (cubic - twice_sin * twice_cos * twice_cos * twice_cos)
        across = 1.0
        for _ in range(12):
            across = math.sqrt(1.0 - turn * turn)
            wrong = turn - twice_sin * (1.0 - 2.0 * turn * turn) - twice_cos * turn * across
            across += turn * wrong * relief
            turn -= wrong * relief
            # The error left is about 4 kappa^2 of the last.
            if abs(wrong) * kappa * kappa < 1e-18:
                break
        c, s = c * across - s * turn, s * across + c * turn
    else:
        low = 0.0
        high = 0.5 * math.pi
        for _ in range(60):
            phi = 0.5 * (low + high)
            c = math.cos(phi)
            s = math.sin(phi)
            if y * c - x * s + bulge * s * c > 0.0:
                low = phi
            else:
                high = phi
    return math.copysign(c, pt), math.copysign(s, pn)


@compiled
def _tilt_of(ax, ay):
    """Sine of an axis' tilt, and the unit direction of the tilt across the bore (2)."""
    sin_tilt = math.sqrt(ax * ax + ay * ay)
    if sin_tilt > 1e-15:
        return sin_tilt, ax / sin_tilt, ay / sin_tilt
    return sin_tilt, 1.0, 0.0


@compiled
def _rim_gap(px, py, az, tilt, bore_radius, journal_radius):
    """Gap of a rim, given the tilt of its axis (`_tilt_of`); see `radial_gap`."""
    sin_tilt, tx, ty = tilt
    c, s = deepest_rim_direction(px * tx + py * ty, py * tx - px * ty, sin_tilt, az, journal_radius)
    along = journal_radius * c * az
    across = journal_radius * s
    ox = along * tx - across * ty
    oy = along * ty + across * tx
    oz = -journal_radius * c * sin_tilt
    rx = px + ox
    ry = py + oy
    distance = math.sqrt(rx * rx + ry * ry)
    inverse = 1.0 / distance if distance > 0.0 else 0.0
    return bore_radius - distance, ox, oy, oz, rx * inverse, ry * inverse


@compiled
def radial_gap(px, py, pz, ax, ay, az, bore_radius, journal_radius):
    """Gap between one rim of the journal and the bore.

    (px, py, pz) is the end centre, (ax, ay, az) the journal's axis, both in the bearing frame [m].
    Exact for any tilt; eq. 4 is the case of axes that meet, eq. 7 that of parallel axes.

    Returns the gap [m], the rim point's offset from the end centre (3) [m], and the outward radial
    direction (2) at which it touches.
    """
    return _rim_gap(px, py, az, _tilt_of(ax, ay), bore_radius, journal_radius)


@compiled
def _face_point(ax, ay, az, journal_radius):
    """Height of the deepest point of a face turned to -z, and its offset from the face's centre."""
    hx = journal_radius * ax
    hy = journal_radius * ay
    height = math.sqrt(hx * hx + hy * hy + EDGE_ROUNDING_M * EDGE_ROUNDING_M)
    scale = journal_radius / height
    return height - EDGE_ROUNDING_M, scale * hx * az, scale * hy * az, -scale * (hx * ax + hy * ay)


@compiled
def axial_gap(pz, ax, ay, az, side, half_bore_length, journal_radius):
    """Gap between one rim of the journal and the end wall on the same `side` (+1 or -1).

    pz is the end centre's height [m]. The deepest point of the rim stands R_j sin(tilt) above the
    end centre (eq. 5; eq. 6 for parallel axes). At zero tilt the whole face touches, and the
    deepest point would jump from one side of the rim to the other, and the force's moment with it.
    The face is therefore given an edge rounded over EPS = 1e-7 m (`EDGE_ROUNDING_M`):

        height = sqrt((R_j sin(tilt))^2 + EPS^2) - EPS

    which changes the gap by at most EPS, is exact for parallel axes, and lets the contact point
    move continuously from the rim through the centre of the face, as the gradient requires.

    Returns the gap [m] and the contact point's offset from the end centre (3) [m].
    """
    height, ox, oy, oz = _face_point(ax, ay, az, journal_radius)
    return half_bore_length - side * pz - height, -side * ox, -side * oy, -side * oz


@compiled
def touch_cylinder(k, cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj):
    """Gap, contact point and normal of contact k of a cylinder; see `touch`.

    (cx, cy, cz) is the journal's centre [m], (ax, ay, az) its axis, both in the bearing frame.
    """
    side = 1.0 - 2.0 * (k & 1)
    reach = side * half_lj
    ex, ey, ez = reach * ax, reach * ay, reach * az
    if k < 2:
        gap, ox, oy, oz, nx, ny = radial_gap(cx + ex, cy + ey, cz + ez, ax, ay, az, ri, rj)
        return gap, ex + ox, ey + oy, ez + oz, -nx, -ny, 0.0
    gap, ox, oy, oz = axial_gap(cz + ez, ax, ay, az, side, half_li, rj)
    return gap, ex + ox, ey + oy, ez + oz, 0.0, 0.0, -side


@compiled
def touch_rims(cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj):
    """Results of `touch_cylinder` for both rims (contacts 0, 1), at less than twice the cost."""
    tilt = _tilt_of(ax, ay)
    ex, ey, ez = half_lj * ax, half_lj * ay, half_lj * az
    gap, ox, oy, oz, nx, ny = _rim_gap(cx + ex, cy + ey, az, tilt, ri, rj)
    end_a = gap, ex + ox, ey + oy, ez + oz, -nx, -ny, 0.0
    gap, ox, oy, oz, nx, ny = _rim_gap(cx - ex, cy - ey, az, tilt, ri, rj)
    return end_a, (gap, ox - ex, oy - ey, oz - ez, -nx, -ny, 0.0)


@compiled
def touch_faces(cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj):
    """Results of `touch_cylinder` for both end faces (contacts 2, 3)."""
    height, ox, oy, oz = _face_point(ax, ay, az, rj)
    ex, ey, ez = half_lj * ax, half_lj * ay, half_lj * az
    end_a = half_li - (cz + ez) - height, ex - ox, ey - oy, ez - oz, 0.0, 0.0, -1.0
    return end_a, (half_li + (cz - ez) - height, ox - ex, oy - ey, oz - ez, 0.0, 0.0, 1.0)


@compiled
def clear_of_cylinder(k, cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj):
    """Whether a bound from centre and tilt alone shows that contact k does not touch.

    A rim reaches no farther out than its centre plus its radius, a face no higher than R_j
    sin(tilt) above its centre. Neither needs a root or a division.
    """
    side = 1.0 - 2.0 * (k & 1)
    if k < 2:
        play, px, py = ri - rj, cx + side * half_lj * ax, cy + side * half_lj * ay
        return play > 0.0 and px * px + py * py < play * play
    room = half_li - side * cz - half_lj * az
    return room > 0.0 and rj * rj * (ax * ax + ay * ay) < room * room


# Gaps in a worn bore, which is out of round.


def worn_bore(depths: np.ndarray) -> tuple[float, ...]:
    """Parameters of a worn bore for `worn_gap`, from depths at equal azimuths, shape (n,) [m].

    The number of azimuths; then for each the depth (coefficient of the B-spline), the spline's
    value there, and the azimuth's cosine and sine.
    """
    n = len(depths)
    azimuths = 2.0 * np.pi * np.arange(n) / n
    values = (np.roll(depths, 1) + 4.0 * depths + np.roll(depths, -1)) / 6.0
    nodes = np.column_stack([depths, values, np.cos(azimuths), np.sin(azimuths)])
    return float(n), *nodes.ravel().tolist()


@compiled
def _least_near(node, px, py, ax, ay, d, at, journal_radius):
    """Minimum of g(u) - R_i between the neighbours of a node, and its u (2); see `worn_gap`.

    Newton's method, safeguarded by bisection.
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
        # The four coefficients that shape the spline about t, and t's fraction of their interval.
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


@compiled
def worn_gap(px, py, ax, ay, d, at, bore_radius, journal_radius):
    """Gap between a rim of the journal and a worn bore.

    The bore is described by its supporting planes: the points x with x.u <= R_i + w(u) for all
    directions u across its axis. The worn depth w is a periodic cubic B-spline, smooth across its
    nodes. A rim with the axis `a` and the centre p reaches p.u + R_j |u - (u.a) a| in the direction
    u, so the gap is the minimum of

        g(u) = R_i + w(u) - p.u - R_j sqrt(1 - (u.a)^2)

    and its gradient by p is -u: contact forces do exactly the work that the change of the gap
    implies. For constant w this is `radial_gap` of a wider bore. The minimum is sought about the
    two lowest nodes that are lower than their neighbours, for between the nodes their order may
    differ. Depths that jump by tens of micrometres from azimuth to azimuth may have two minima
    about one node: of 6000 gaps, jumps of up to 5 µm led to no wrong one, of 20 µm to nine (off by
    1.1 µm at most).

    Returns the gap [m] and the direction u (2) at which it is found.
    """
    n = int(d[at])
    lowest, second = 1e300, 1e300
    node, second_node = n - 1, -n  # not literals: numba would compile `_least_near` for each
    last = at + 1 + _WORN_NODE * (n - 1)
    lean = ax * d[last + 2] + ay * d[last + 3]
    before = d[last + 1] - px * d[last + 2] - py * d[last + 3] + 0.5 * journal_radius * lean * lean
    lean = ax * d[at + 3] + ay * d[at + 4]
    value = d[at + 2] - px * d[at + 3] - py * d[at + 4] + 0.5 * journal_radius * lean * lean
    for i in range(n):
        place = at + 1 + _WORN_NODE * ((i + 1) % n)
        c, s = d[place + 2], d[place + 3]
        lean = ax * c + ay * s
        after = d[place + 1] - px * c - py * s + 0.5 * journal_radius * lean * lean
        if value <= before and value < after:
            if value < lowest:
                second, second_node = lowest, node if lowest < 1e300 else -n
                lowest, node = value, i
            elif value < second:
                second, second_node = value, i
        before, value = value, after
    g, c, s = _least_near(node, px, py, ax, ay, d, at, journal_radius)
    if second_node >= 0:
        g2, c2, s2 = _least_near(second_node, px, py, ax, ay, d, at, journal_radius)
        if g2 < g:
            g, c, s = g2, c2, s2
    return bore_radius + g, c, s
