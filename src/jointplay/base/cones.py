"""How far points are from cones, of many at once.

`scipy.optimize.nnls` tells it of one point, and takes half a second to import.
"""

import numpy as np

MOST_STEPS = 100
_ROUNDING, _NOTHING = 1e-13, 1e-300


def near_cones(rays: np.ndarray, points: np.ndarray, distance: np.ndarray) -> np.ndarray:
    """Whether each point lies within a distance of its cone, all non-negative sums of its rays.

    By non-negative least squares with active sets, see C. L. Lawson, R. J. Hanson: Solving Least
    Squares Problems, SIAM 1995, chapter 23.

    Args:
        rays: k in d dimensions for each of n points, zero where there are fewer, (n, k, d).
        points: shape (n, d).
        distance: shape (n,).

    Returns:
        Shape (n,).
    """
    near, number = np.zeros(len(points), bool), np.arange(len(points))
    lengths = np.linalg.norm(rays, axis=2, keepdims=True)
    rays = np.divide(rays, lengths, out=np.zeros_like(rays), where=lengths > 0.0)
    least = _ROUNDING * np.linalg.norm(points, axis=1)
    # Of each point the rays whose sum is nearest so far, and their weights: d places, some free.
    basis = np.zeros((*points.shape, points.shape[1]))
    used, weights = np.zeros(points.shape, bool), np.zeros(points.shape)
    for _ in range(MOST_STEPS):
        left = points - (weights[:, None] @ basis)[:, 0]
        done = np.linalg.norm(left, axis=1) <= distance
        near[number[done]] = True
        gain = (rays @ left[..., None])[..., 0]
        enters = gain.argmax(axis=1)
        goes_on = ~done & (gain.max(axis=1) > least) & ~used.all(axis=1)
        if not goes_on.any():
            break
        if not goes_on.all():
            rays, points, distance, least, number, basis, used, weights, enters = (
                one[goes_on]
                for one in (rays, points, distance, least, number, basis, used, weights, enters)
            )
        each, place = np.arange(len(points)), used.argmin(axis=1)
        basis[each, place], used[each, place] = rays[each, enters], True
        while True:
            matrix = basis @ basis.swapaxes(1, 2)
            matrix += np.eye(points.shape[1]) * np.where(used, _ROUNDING, 1.0)[:, None]
            best = np.linalg.solve(matrix, basis @ points[..., None])[..., 0]
            leaves = used & (best <= 0.0)
            if not leaves.any():
                break
            # As far towards the best as no weight becomes negative.
            share = weights / np.where(leaves, np.maximum(weights - best, _NOTHING), 1.0)
            part = share.min(axis=1, keepdims=True, initial=1.0, where=leaves)
            weights = weights + part * (best - weights)
            used &= ~(leaves & (share <= part))
            basis[~used] = weights[~used] = 0.0
        weights = best
    return near
