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


@njit(cache=True)
def compose(near, shown, lit, normals, jump, samples):
    """Colour each pixel by the mean of its samples, with dark lines along outlines and edges.

    Args:
        near, shown: from `rasterise`, at `samples` samples per pixel each way.
        lit: colour of each triangle, float array of shape (n, 3).
        normals: of each triangle towards the viewer, float array of shape (n, 3).
        jump: difference in nearness from which one body ends in front of another.
        samples: each way.

    Returns:
        Red, green, blue, opacity; shape (height / samples, width / samples, 4).
    """
    height, width = near.shape
    image = np.zeros((height // samples, width // samples, 4))
    for y in range(image.shape[0] * samples):
        for x in range(image.shape[1] * samples):
            here = shown[y, x]
            if here < 0:
                continue
            edge = False
            for dy, dx in ((0, 1), (0, -1), (1, 0), (-1, 0)):
                v, u = y + dy, x + dx
                if v < 0 or u < 0 or v >= height or u >= width:
                    continue
                there = shown[v, u]
                if there < 0:
                    edge = True
                elif there != here:
                    bend = 0.0
                    for k in range(3):
                        bend += normals[here, k] * normals[there, k]
                    step = abs(near[y, x] - near[v, u])
                    # What is seen flat on the side is deep from pixel to pixel, but no edge.
                    facing = max(normals[here, 2], normals[there, 2])
                    edge = edge or bend < 0.75 or (step > jump and facing > 0.35)
            shade = 0.42 if edge else 1.0
            pixel = image[y // samples, x // samples]
            for k in range(3):
                pixel[k] += shade * lit[here, k]
            pixel[3] += 1.0
    for row in image:
        for pixel in row:
            if pixel[3] > 0.0:
                pixel[:3] /= pixel[3]
                pixel[3] /= samples * samples
    return image
