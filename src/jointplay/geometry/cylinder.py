"""Gaps of a cylinder in its bearing, for skew axes (eqs 4-9)."""

from __future__ import annotations

import math

from jointplay.core.compiler import njit
from jointplay.geometry.shapes import EDGE_ROUNDING_M


@njit(cache=True, error_model="numpy")
def deepest_rim_direction(pt: float, pn: float, sin_tilt: float, cos_tilt: float, radius: float):
    """Direction on the rim of the point farthest from the bearing's axis.

    Seen along the bore, a tilted rim is an ellipse: semi-axis R cos(tilt) along the tilt direction
    t, R along n. Its centre is (pt, pn). The farthest point (cos phi, sin phi) satisfies

        g(phi) = pn cos(phi) - pt cos(tilt) sin(phi) + R sin(tilt)^2 sin(phi) cos(phi) = 0

    and lies in the quadrant of (pt, pn), where the root is unique: Newton's method, kept inside
    the quadrant by bisection, therefore finds the global maximum.

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
    c = x / norm
    s = y / norm
    if bulge > 0.0:
        if bulge < 0.1 * norm:
            for _ in range(4):
                g = y * c - x * s + bulge * s * c
                slope = -y * s - x * c + bulge * (c * c - s * s)
                step = -g / slope
                c, s = c - step * s, s + step * c
                scale = 1.0 / math.sqrt(c * c + s * s)
                c *= scale
                s *= scale
                if abs(step) < 1e-9:  # quadratic convergence: the next error is below 1e-17
                    break
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


@njit(cache=True, error_model="numpy")
def radial_gap(px, py, pz, ax, ay, az, bore_radius, journal_radius):
    """Gap between one rim of the journal and the bore.

    (px, py, pz) is the end centre, (ax, ay, az) the journal's axis, both in the bearing frame [m].
    Exact for any tilt; eq. 4 is the case of axes that meet, eq. 7 that of parallel axes.

    Returns the gap [m], the rim point's offset from the end centre (3) [m], and the outward radial
    direction (2) at which it touches.
    """
    sin_tilt = math.sqrt(ax * ax + ay * ay)
    if sin_tilt > 1e-15:
        tx = ax / sin_tilt
        ty = ay / sin_tilt
    else:
        tx = 1.0
        ty = 0.0
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


@njit(cache=True, error_model="numpy")
def axial_gap(pz, ax, ay, az, side, half_bore_length, journal_radius):
    """Gap between one rim of the journal and the end wall on the same `side` (+1 or -1).

    pz is the end centre's height [m]. The deepest point of the rim stands R_j sin(tilt) above the
    end centre (eq. 5; eq. 6 for parallel axes). At zero tilt the whole face touches and the
    deepest point would jump from one side of the rim to the other, and the force's moment with it.
    The face is therefore given an edge rounded over EPS = 1e-7 m:

        height = sqrt((R_j sin(tilt))^2 + EPS^2) - EPS

    which moves the gap by at most EPS, is exact for parallel axes, and lets the contact point
    travel continuously from the rim through the centre of the face as its true gradient.

    Returns the gap [m] and the contact point's offset from the end centre (3) [m].
    """
    hx = journal_radius * ax
    hy = journal_radius * ay
    height = math.sqrt(hx * hx + hy * hy + EDGE_ROUNDING_M * EDGE_ROUNDING_M)
    scale = -side * journal_radius / height
    ox = scale * hx * az
    oy = scale * hy * az
    oz = -scale * (hx * ax + hy * ay)
    return half_bore_length - side * pz - (height - EDGE_ROUNDING_M), ox, oy, oz


@njit(cache=True, error_model="numpy", inline="always")
def touch_cylinder(k, cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj):
    """Gap, place and normal of contact k of a cylinder; see `touch`.

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
