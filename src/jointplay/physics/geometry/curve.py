"""Plane curves through points, and the point of a curve nearest to a given one.

The curve is the cubic spline through its points, parametrised by the length of the chords between
them: periodic if it is closed, else natural, so that beyond its ends it goes on straight without a
jump of curvature. `Curve.numbers` writes it as a flat array for `nearest_on_curve`, in pieces so
short that each has one nearest point.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cached_property
from itertools import pairwise

import numpy as np

from jointplay.base.compiler import compiled
from jointplay.base.errors import JointplayError
from jointplay.base.units import readable

_TURN = 0.25
"""Largest change of direction within a piece [rad]: an arc is then 0.8 % of its length off its
chord (judged)."""
_PIECE = 10
"""Numbers of a piece: range of its parameter, its length, four coefficients of x and of y."""
_SAMPLES = 32
"""Most samples on each interval between points, at which direction and curvature are evaluated
(judged)."""
_MOST_SAMPLES = 2000
"""Most samples in all, about, where there are many points (judged)."""
_LONGER = 1.05
"""Margin of a piece's length over that from its largest speed at `_SAMPLES` samples (judged)."""
MOST_PIECES = 5000
"""Most pieces, as all are searched in each step; a finer curve is refused."""


class Curve:
    """A smooth curve through points (n, 2) [m], open or closed.

    Raises:
        JointplayError: too few points, two successive points that coincide, or a curve that crosses
            itself; the message names the place.
    """

    def __init__(self, points: Sequence[Sequence[float]], closed: bool) -> None:
        places = np.array(points, float)
        least = 3 if closed else 2
        form = "closed" if closed else "open"
        if len(places) < least:
            raise JointplayError(
                f"{form} curve through {len(places)} points: it needs {least} or more"
            )
        if (bad := np.flatnonzero(~np.isfinite(places).all(axis=1))).size:
            raise JointplayError(f"point {bad[0] + 1} is not finite")
        if closed and np.array_equal(places[0], places[-1]):
            raise JointplayError(
                "a closed curve comes back by itself: leave out the last point, which repeats the "
                "first"
            )
        path = np.vstack([places, places[:1]]) if closed else places
        chords = np.linalg.norm(np.diff(path, axis=0), axis=1)
        same = int(np.argmin(chords))
        if chords[same] <= 1e-9 * chords.sum():
            raise JointplayError(
                f"points {same + 1} and {(same + 1) % len(places) + 1} are in one place, "
                f"{place_words(path[same])}"
            )
        from scipy.interpolate import CubicSpline  # takes long to import

        self.closed = closed
        self.parameters = np.concatenate([[0.0], np.cumsum(chords)])
        kind = "periodic" if closed else "natural"
        self.spline = CubicSpline(self.parameters, path, bc_type=kind)
        self._refuse_crossing()

    def at(self, parameter: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Points [m] and unit tangents (n, 2), and curvatures (n,), positive to the left [1/m]."""
        first, second = self.spline(parameter, 1), self.spline(parameter, 2)
        speed = np.linalg.norm(first, axis=1)
        turn = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        return self.spline(parameter), first / speed[:, None], turn / speed**3

    @cached_property
    def dense(self) -> np.ndarray:
        """Parameters of dense samples, up to `_SAMPLES` on each interval between points."""
        each = min(max(_MOST_SAMPLES // len(self.parameters), 4), _SAMPLES)
        pieces = [np.linspace(a, b, each, endpoint=False) for a, b in pairwise(self.parameters)]
        return np.concatenate([*pieces, self.parameters[-1:]])

    @property
    def length(self) -> float:
        """Arc length [m]."""
        speed = np.linalg.norm(self.spline(self.dense, 1), axis=1)
        return float(np.trapezoid(speed, self.dense))

    @property
    def mean_curvature(self) -> float:
        """Change of direction, positive to the left, over arc length [1/m]."""
        _, tangents, _ = self.at(self.dense)
        heading = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
        return float(heading[-1] - heading[0]) / self.length

    def sharpest(self) -> tuple[float, float, np.ndarray, np.ndarray]:
        """Largest curvature to the left and to the right [1/m], and the points of both (2)."""
        places, _, bend = self.at(self.dense)
        left, right = int(np.argmax(bend)), int(np.argmin(bend))
        return float(bend[left]), float(-bend[right]), places[left], places[right]

    def narrowest(self, left: bool, right: bool) -> tuple[float, np.ndarray]:
        """Smallest distance at which the curve passes itself after turning back, and the point (2).

        Only points between which it has turned by at least nine tenths of half a turn count, and
        with `left` or `right` alone only those on that side. Infinite if it never turns back so.
        """
        places, tangents, _ = self.at(self.dense)
        heading = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
        turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(heading)))])
        apart = np.abs(turned[:, None] - turned[None, :])
        if self.closed:
            apart = np.minimum(apart, turned[-1] - apart)
        between = places[None, :] - places[:, None]
        side = tangents[:, None, 0] * between[..., 1] - tangents[:, None, 1] * between[..., 0]
        distance = np.linalg.norm(between, axis=2)
        counts = (apart > 0.9 * math.pi) & ((left & (side > 0.0)) | (right & (side < 0.0)))
        distance[~counts] = math.inf
        i = int(np.argmin(distance.min(axis=1)))
        return float(distance[i].min()), places[i]

    def _refuse_crossing(self) -> None:
        """Raise where two chords between dense samples, not successive, intersect."""
        line = self.spline(self.dense)
        start, step = line[:-1], np.diff(line, axis=0)
        count = len(start)
        for i in range(count - 2):
            others = slice(i + 2, count - 1 if self.closed and i == 0 else count)
            between = start[others] - start[i]
            cross = step[i, 0] * step[others, 1] - step[i, 1] * step[others, 0]
            # The cross product of parallel chords is rounding, 1e-16 of their lengths: no crossing.
            lengths = np.linalg.norm(step[others], axis=1) * np.linalg.norm(step[i])
            cross[np.abs(cross) <= 1e-14 * lengths] = np.nan
            with np.errstate(invalid="ignore"):
                mine = (between[:, 0] * step[others, 1] - between[:, 1] * step[others, 0]) / cross
                theirs = (between[:, 0] * step[i, 1] - between[:, 1] * step[i, 0]) / cross
            hit = (mine >= 0.0) & (mine <= 1.0) & (theirs >= 0.0) & (theirs <= 1.0)
            if hit.any():
                where = start[i] + mine[int(np.argmax(hit))] * step[i]
                raise JointplayError(f"the curve crosses itself at {place_words(where)}")

    def numbers(self, longest: float) -> tuple[float, ...]:
        """Parameters of the curve for `nearest_on_curve`, no piece longer than `longest` [m].

        Number of nodes, 1 if the curve is closed; x and y of the nodes; then the pieces between
        them, `_PIECE` numbers each.

        Raises:
            JointplayError: more than `MOST_PIECES` pieces.
        """
        cuts: list[float] = []
        lengths: list[float] = []
        for a, b in pairwise(self.parameters):
            at = np.linspace(a, b, _SAMPLES + 1)
            places, tangents, _ = self.at(at)
            heading = np.unwrap(np.arctan2(tangents[:, 1], tangents[:, 0]))
            turning = float(np.abs(np.diff(heading)).sum())
            size = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())
            count = max(math.ceil(turning / _TURN), math.ceil(size / longest), 1)
            fastest = float(np.linalg.norm(self.spline(at, 1), axis=1).max())
            lengths += [_LONGER * fastest * (b - a) / count] * count
            cuts += np.linspace(a, b, count, endpoint=False).tolist()
        if len(cuts) > MOST_PIECES:
            raise JointplayError(
                f"the curve is {readable(self.length, 'm')} long, and its groove so narrow that it "
                f"would be searched in {len(cuts)} pieces; at most {MOST_PIECES} are allowed"
            )
        ends = np.array([*cuts, self.parameters[-1]])
        low = ends[:-1]
        taylor = np.array([self.spline(low, k) / math.factorial(k) for k in range(4)])
        parts = np.diff(ends), np.array(lengths), *taylor[:, :, 0].copy(), *taylor[:, :, 1].copy()
        pieces = np.column_stack(parts)
        nodes = self.spline(low if self.closed else ends)
        head = [float(len(nodes)), float(self.closed)]
        return *head, *nodes.ravel().tolist(), *pieces.ravel().tolist()


def place_words(point: np.ndarray) -> str:
    """Format a point for messages, rounded to a nanometre."""
    x, y = (readable(round(float(along), 9) + 0.0, "m") for along in point)
    return f"({x}, {y})"


@compiled
def _nearest_on_piece(d, at, px, py):
    """Point (2) of a piece nearest to p = (px, py), the curve's derivative there (2), and u.

    (P(u) - p).P'(u) = 0 by Newton's method, safeguarded by bisection.
    """
    h = d[at]
    x0, x1, x2, x3 = d[at + 2], d[at + 3], d[at + 4], d[at + 5]
    y0, y1, y2, y3 = d[at + 6], d[at + 7], d[at + 8], d[at + 9]
    low, high = 0.0, h
    u = min(max(((px - x0) * x1 + (py - y0) * y1) / (x1 * x1 + y1 * y1), 0.0), h)
    x, y, tx, ty = x0, y0, x1, y1
    for _ in range(60):
        x = x0 + u * (x1 + u * (x2 + u * x3))
        y = y0 + u * (y1 + u * (y2 + u * y3))
        tx = x1 + u * (2.0 * x2 + 3.0 * u * x3)
        ty = y1 + u * (2.0 * y2 + 3.0 * u * y3)
        first = (x - px) * tx + (y - py) * ty
        if first > 0.0:
            high = u
        else:
            low = u
        bend = (x - px) * (2.0 * x2 + 6.0 * u * x3) + (y - py) * (2.0 * y2 + 6.0 * u * y3)
        second = tx * tx + ty * ty + bend
        step = -first / second if second > 0.0 else -math.copysign(h, first)
        then = min(max(u + step, 0.0), h)
        if not low <= then <= high:
            then = 0.5 * (low + high)
        if abs(then - u) < 1e-15 * h:
            break
        u = then
    return x, y, tx, ty, u


@compiled
def nearest_on_curve(d, at, px, py):
    """Find the point of a curve nearest to (px, py); its `Curve.numbers` begin at d[at].

    The nearest node gives a bound; then every piece is searched that begins near enough to come
    nearer.

    Returns the signed distance, positive where the point is left of the curve [m], the unit
    direction of the curve there (2), and how far beyond an end of an open curve the point lies,
    negative before its first point [m]. The distance is then that from the tangent at the end.
    """
    n, closed = int(d[at]), d[at + 1] != 0.0
    count = n if closed else n - 1
    nodes, pieces = at + 2, at + 2 + 2 * n
    nearest = 1e300
    for i in range(n):
        dx, dy = d[nodes + 2 * i] - px, d[nodes + 2 * i + 1] - py
        nearest = min(nearest, dx * dx + dy * dy)
    limit = math.sqrt(nearest)
    best, bx, by, tx, ty, end = 1e300, 0.0, 0.0, 1.0, 0.0, False
    for i in range(count):
        piece = pieces + _PIECE * i
        dx, dy = d[nodes + 2 * i] - px, d[nodes + 2 * i + 1] - py
        reach = limit + d[piece + 1]
        if dx * dx + dy * dy > reach * reach:
            continue
        x, y, sx, sy, u = _nearest_on_piece(d, piece, px, py)
        square = (x - px) * (x - px) + (y - py) * (y - py)
        if square < best:
            best, bx, by, tx, ty = square, x, y, sx, sy
            limit = min(limit, math.sqrt(square))
            end = not closed and ((i == 0 and u == 0.0) or (i == count - 1 and u == d[piece]))
    inverse = 1.0 / math.sqrt(tx * tx + ty * ty)
    tx, ty = inverse * tx, inverse * ty
    beyond = tx * (px - bx) + ty * (py - by) if end else 0.0
    return tx * (py - by) - ty * (px - bx), tx, ty, beyond
