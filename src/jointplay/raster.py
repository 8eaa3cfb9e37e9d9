"""Which triangle each pixel shows: a depth buffer, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def rasterise(corners, width, height):
    """Draw triangles into a depth buffer.

    Args:
        corners: x to the right and y downwards [pixels], nearness to the viewer [any unit], float
            array of shape (n, 3 corners, 3).
        width, height: of the picture [pixels].

    Returns:
        Nearness of what each pixel shows, -inf where nothing is, and the triangle's number, -1
        where nothing is; shape (height, width) each.
    """
    near = np.full((height, width), -np.inf)
    shown = np.full((height, width), -1, np.int32)
    for n in range(corners.shape[0]):
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = corners[n, 0], corners[n, 1], corners[n, 2]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        left, right = max(0, int(np.ceil(min(ax, bx, cx)))), min(width - 1, int(max(ax, bx, cx)))
        top, bottom = max(0, int(np.ceil(min(ay, by, cy)))), min(height - 1, int(max(ay, by, cy)))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) / area
                v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) / area
                w = 1.0 - u - v
                if u >= 0.0 and v >= 0.0 and w >= 0.0:
                    z = u * az + v * bz + w * cz
                    if z > near[y, x]:
                        near[y, x] = z
                        shown[y, x] = n
    return near, shown
