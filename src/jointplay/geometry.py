"""Gaps of a journal in its bearing, for skew axes (eqs 4-9, Table 1, Figure 2).

The bearing frame has its origin at the bearing's centre and z along the bore; the journal frame
likewise. A pose is the journal's centre and orientation in the bearing frame; of the orientation a
cylinder needs its axis `a` only. The four possible contacts of a cylinder are, in this order
everywhere in the package (`Shape` has the other shapes):

    0  radial at end A   rim of the journal's +z end against the bore
    1  radial at end B   rim of the journal's -z end against the bore
    2  axial at end A    rim of the +z end against the +z end wall
    3  axial at end B    rim of the -z end against the -z end wall

A gap is positive in free flight and negative in penetration. Each gap's gradient is the contact
normal, and its rate is the normal velocity of the contact point, so contact forces do exactly the
work that the change of the gap implies.
"""

from __future__ import annotations

import math
from enum import IntEnum

import numpy as np
from numba import njit

from jointplay import numba_cache

numba_cache.ensure()

CONTACTS = ("radial_A", "radial_B", "axial_A", "axial_B")

CONTACT_TOLERANCE_M = 1e-7
"""A gap within this of zero counts as continuous contact: the paper's integration tolerance."""

EDGE_ROUNDING_M = 1e-7
"""Height over which a flat end face passes to edge contact; see `axial_gap`."""


class Shape(IntEnum):
    """Shape of a journal in its bearing; its dimensions are those of `touch`.

    CYLINDER           R_i, R_j, L_i/2, L_j/2         radial_A, radial_B, axial_A, axial_B
    ALIGNED_CYLINDER   R_i, R_j, L_i/2, L_j/2         radial, axial_A, axial_B
    BALL               R_i, R_j                       one contact
    BLOCK              half widths of the guide across x and y; then for each contact its point
                       on the journal (3), 0 or 1 for a wall across x or y, and the wall's side +-1
    WORN_CYLINDER          as CYLINDER, then `worn_bore` of end A and of end B
    WORN_ALIGNED_CYLINDER  as ALIGNED_CYLINDER, then `worn_bore`
    """

    CYLINDER = 0
    ALIGNED_CYLINDER = 1
    BALL = 2
    BLOCK = 3
    WORN_CYLINDER = 4
    WORN_ALIGNED_CYLINDER = 5


_CYLINDER, _ALIGNED_CYLINDER, _BALL, _BLOCK, _WORN, _WORN_ALIGNED = (int(shape) for shape in Shape)

_WORN_NODE = 4
"""Numbers of `worn_bore` for each azimuth."""


class Mode(IntEnum):
    """Mode of the joint (Table 1)."""

    FREE_FLIGHT = 0
    CONTINUOUS_CONTACT = 1
    PSEUDO_PENETRATION = 2


class Form(IntEnum):
    """Contact form (Figure 2 a-l); NONE is free flight."""

    NONE = 0
    RADIAL_BOTH_ENDS_OPPOSITE = 1
    RADIAL_AXIAL_SAME_END = 2
    RADIAL_AXIAL_OTHER_END = 3
    AXIAL_BOTH_ENDS = 4
    ONE_RADIAL = 5
    ONE_AXIAL = 6
    TWO_RADIAL_ONE_AXIAL = 7
    ONE_RADIAL_TWO_AXIAL = 8
    FOUR_POINTS = 9
    SURFACE = 10
    LINE = 11
    SURFACE_AND_LINE = 12

    @property
    def letter(self) -> str:
        """Letter of the form in Figure 2 of the paper, '-' for none."""
        return "-abcdefghijkl"[self.value]


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

    Returns the gap [m] and the direction u (2) at which it is found.
    """
    n = int(d[at])
    lowest, second = 1e300, 1e300
    node, other = 0, -1
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
                second, other = lowest, node if lowest < 1e300 else -1
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


@njit(cache=True, error_model="numpy")
def touch(shape, d, at, k, cx, cy, cz, r, first):
    """Gap, place and normal of contact k of a joint.

    Args:
        shape: value of a `Shape`.
        d, at: array in which the joint's dimensions begin at index `at`.
        k: index of the contact.
        cx, cy, cz: journal centre in the bearing frame [m].
        r, first: array in which the orientation of the journal frame in the bearing frame begins at
            index `first`, nine elements row by row. A cylinder needs its third column only, a
            ball none.

    Returns:
        gap [m], the contact point's offset from the journal's centre (3) [m], and the unit normal
        from the bearing into the journal (3), all in the bearing frame.
    """
    if shape == _CYLINDER:
        ax, ay, az = r[first + 2], r[first + 5], r[first + 8]
        return touch_cylinder(k, cx, cy, cz, ax, ay, az, d[at], d[at + 1], d[at + 2], d[at + 3])
    if shape in (_WORN, _WORN_ALIGNED):
        aligned = shape == _WORN_ALIGNED
        ax, ay, az = r[first + 2], r[first + 5], r[first + 8]
        if k < (1 if aligned else 2):
            reach = 0.0 if aligned else (1.0 - 2.0 * k) * d[at + 3]
            profile = at + 4
            if k == 1:
                profile += 1 + _WORN_NODE * int(d[profile])
            ex, ey, ez = reach * ax, reach * ay, reach * az
            gap, ux, uy = worn_gap(cx + ex, cy + ey, ax, ay, d, profile, d[at], d[at + 1])
            lean = ux * ax + uy * ay
            size = d[at + 1] / math.sqrt(1.0 - lean * lean)
            ox, oy, oz = size * (ux - lean * ax), size * (uy - lean * ay), -size * lean * az
            return gap, ex + ox, ey + oy, ez + oz, -ux, -uy, 0.0
        if not aligned:
            return touch_cylinder(k, cx, cy, cz, ax, ay, az, d[at], d[at + 1], d[at + 2], d[at + 3])
    if shape == _BLOCK:
        place = at + 2 + 5 * k
        px, py, pz = d[place], d[place + 1], d[place + 2]
        ox = r[first] * px + r[first + 1] * py + r[first + 2] * pz
        oy = r[first + 3] * px + r[first + 4] * py + r[first + 5] * pz
        oz = r[first + 6] * px + r[first + 7] * py + r[first + 8] * pz
        side = d[place + 4]
        if d[place + 3] == 0.0:
            return d[at] - side * (cx + ox), ox, oy, oz, -side, 0.0, 0.0
        return d[at + 1] - side * (cy + oy), ox, oy, oz, 0.0, -side, 0.0
    if shape in (_ALIGNED_CYLINDER, _WORN_ALIGNED) and k > 0:
        side = 3.0 - 2.0 * k
        oz = side * d[at + 3]
        return d[at + 2] - side * (cz + oz), 0.0, 0.0, oz, 0.0, 0.0, -side
    # Along the line of centres: a ball, or a cylinder that does not tilt.
    if shape != _BALL:
        cz = 0.0
    distance = math.sqrt(cx * cx + cy * cy + cz * cz)
    inverse = 1.0 / distance if distance > 0.0 else 0.0
    nx, ny, nz = cx * inverse, cy * inverse, cz * inverse
    rj = d[at + 1]
    return d[at] - rj - distance, rj * nx, rj * ny, rj * nz, -nx, -ny, -nz


@njit(cache=True, error_model="numpy")
def gaps(centre, axis, bore_radius, bore_length, journal_radius, journal_length):
    """All four gaps of a cylinder in its bearing, and where they are measured.

    Args:
        centre: journal centre in the bearing frame, shape (3,) [m].
        axis: journal axis in the bearing frame, unit vector, shape (3,).
        bore_radius, bore_length, journal_radius, journal_length: R_i, L_i, R_j, L_j [m].

    Returns:
        gap (4,) [m], contact point in the bearing frame (4, 3) [m], and the unit normal pointing
        from the bearing into the journal (4, 3), in the order of `CONTACTS`.
    """
    gap, point, normal = np.empty(4), np.empty((4, 3)), np.empty((4, 3))
    for k in range(4):
        g, ox, oy, oz, nx, ny, nz = touch_cylinder(
            k,
            centre[0],
            centre[1],
            centre[2],
            axis[0],
            axis[1],
            axis[2],
            bore_radius,
            journal_radius,
            0.5 * bore_length,
            0.5 * journal_length,
        )
        gap[k] = g
        point[k, 0], point[k, 1], point[k, 2] = centre[0] + ox, centre[1] + oy, centre[2] + oz
        normal[k, 0], normal[k, 1], normal[k, 2] = nx, ny, nz
    return gap, point, normal


@njit(cache=True, error_model="numpy")
def classify_mode(gap) -> int:
    """Mode of the joint from all its gaps [m] (Table 1), as the value of a `Mode`."""
    smallest = gap[0]
    for k in range(1, gap.size):
        smallest = min(smallest, gap[k])
    if smallest < -CONTACT_TOLERANCE_M:
        return 2
    if smallest <= CONTACT_TOLERANCE_M:
        return 1
    return 0


@njit(cache=True, error_model="numpy")
def classify_form(gap, normal, face_drop) -> int:
    """Contact form (Figure 2), as the value of a `Form`.

    Args:
        gap: the four gaps, shape (4,) [m].
        normal: their contact normals, shape (4, 3).
        face_drop: 2 R_j sin(tilt), the height of a tilted end face between its two rims [m].

    Two radial contacts on the same side of the bore are one line contact. An axial contact is a
    surface contact when the far side of the face lies within the wall too.
    """
    rim_a = gap[0] <= CONTACT_TOLERANCE_M
    rim_b = gap[1] <= CONTACT_TOLERANCE_M
    wall_a = gap[2] <= CONTACT_TOLERANCE_M
    wall_b = gap[3] <= CONTACT_TOLERANCE_M
    radial = int(rim_a) + int(rim_b)
    axial = int(wall_a) + int(wall_b)
    line = radial == 2 and (normal[0, 0] * normal[1, 0] + normal[0, 1] * normal[1, 1]) > 0.0
    surface = axial == 1 and min(gap[2], gap[3]) + face_drop <= CONTACT_TOLERANCE_M
    if radial == 0:
        if axial == 0:
            return 0
        if axial == 2:
            return 4
        return 10 if surface else 6
    if radial == 1:
        if axial == 0:
            return 5
        if axial == 2:
            return 8
        return 2 if rim_a == wall_a else 3
    if axial == 0:
        return 11 if line else 1
    if axial == 2:
        return 9
    return 12 if line and surface else 7


@njit(cache=True, error_model="numpy")
def classify_many(shape, dimensions, count, poses):
    """Gaps, mode and form for many poses.

    Args:
        shape: value of a `Shape`.
        dimensions: of the joint.
        count: number of its contacts.
        poses: (n, 12), journal centre [m], then its orientation row by row, in the bearing frame.

    Returns:
        gaps (n, count) [m], modes (n,) and forms (n,) as int8; the form is -1 for joints that
        Figure 2 does not show.
    """
    # Element by element: slices would triple the compilation time of the whole package.
    n = poses.shape[0]
    all_gaps = np.empty((n, count))
    modes = np.empty(n, np.int8)
    forms = np.full(n, -1, np.int8)
    turn, gap, normal = np.empty(9), np.empty(count), np.empty((count, 3))
    for i in range(n):
        for k in range(9):
            turn[k] = poses[i, 3 + k]
        for k in range(count):
            g, _, _, _, nx, ny, nz = touch(
                shape, dimensions, 0, k, poses[i, 0], poses[i, 1], poses[i, 2], turn, 0
            )
            gap[k] = g
            all_gaps[i, k] = g
            normal[k, 0], normal[k, 1], normal[k, 2] = nx, ny, nz
        modes[i] = classify_mode(gap)
        if shape in (_CYLINDER, _WORN) and count == 4:
            drop = 2.0 * dimensions[1] * math.sqrt(turn[2] * turn[2] + turn[5] * turn[5])
            forms[i] = classify_form(gap, normal, drop)
    return all_gaps, modes, forms


def journal_axis(angles: np.ndarray) -> np.ndarray:
    """Journal axis in the bearing frame for yaw, pitch, roll (n, 3) [rad]: shape (n, 3)."""
    yaw, pitch, roll = angles.T
    cy, sy, cp, sp, cr, sr = (
        function(angle) for angle in (yaw, pitch, roll) for function in (np.cos, np.sin)
    )
    return np.column_stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])
