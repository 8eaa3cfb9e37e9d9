"""The static error set of the tool as an ellipsoid that encloses it, pose by pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from jointplay.accuracy.error_model import ErrorModel, half_sphere

_DIRECTIONS = 90
"""Directions over half a sphere, about 15 degrees apart, to fit a form of six numbers (judged)."""
_ROUNDS = 4
"""Fits, each in axes in which the last one is a sphere: thin sets need a second one (judged)."""
_FLAT = 1e-3
"""Least half axis of an ellipsoid, relative to its largest, for sets that are flat."""
_SMALLEST = 1e-12
"""Half axis of an ellipsoid whose set is a point [m]."""


@dataclass(frozen=True)
class Ellipsoids:
    """Ellipsoids about the tool without play, at n poses; world axes."""

    root: np.ndarray
    """Symmetric matrix that maps the unit sphere to the ellipsoid, shape (n, 3, 3) [m]. The
    ellipsoid's support, sqrt(d . root root d), is nowhere smaller than the set's."""
    worst: np.ndarray
    """Largest distance in the set along the directions sampled, (n,) [m]."""
    rms: np.ndarray
    """RMS distance under loads of random direction, (n,) [m]."""


def ellipsoids(plays: ErrorModel) -> Ellipsoids:
    """An ellipsoid close around the set of errors, at each pose.

    The squared support of an ellipsoid is a quadratic form of the direction: it is fitted to the
    set's by least squares and widened until it is nowhere smaller; then again in axes in which the
    ellipsoid found is a sphere, so that thin sets are fitted as well as round ones.
    """
    n, sphere = plays.poses, half_sphere(_DIRECTIONS)
    evenly = np.broadcast_to(sphere, (n, *sphere.shape))
    states = plays.along(evenly)
    total = states.error.sum(axis=0)[..., :3]
    worst = states.value.sum(axis=0).max(axis=1)
    square = np.einsum("n,ij->nij", np.maximum(worst, _SMALLEST) ** 2, np.eye(3))
    for _ in range(_ROUNDS):
        root = _root(square)
        back = np.linalg.inv(root)
        d = np.einsum("nij,mj->nmi", back, sphere)
        size = np.linalg.norm(d, axis=2)
        support = plays.along(d / size[..., None]).value.sum(axis=0) * size
        square = _thickened(root @ _fitted(sphere, support) @ root)
    rms = np.sqrt((total**2).sum(axis=2).mean(axis=1))
    return Ellipsoids(_root(square), worst, rms)


def _fitted(d: np.ndarray, support: np.ndarray) -> np.ndarray:
    """Quadratic forms (n, 3, 3) nowhere below the squared supports (n, m) at directions (m, 3)."""
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    products = np.stack([d[:, i] * d[:, k] * (1.0 + (i != k)) for i, k in pairs], axis=1)
    numbers = np.linalg.lstsq(products, (support**2).T, rcond=None)[0].T
    square = np.empty((len(support), 3, 3))
    for column, (i, k) in enumerate(pairs):
        square[:, i, k] = square[:, k, i] = numbers[:, column]
    square = _thickened(square)
    fitted = np.einsum("mi,nij,mj->nm", d, square, d)
    return square * (support**2 / fitted).max(axis=1)[:, None, None]


def _thickened(square: np.ndarray) -> np.ndarray:
    """Quadratic forms (n, 3, 3) with no half axis below `_FLAT` of the largest."""
    sizes, axes = np.linalg.eigh(square)
    least = np.maximum(_FLAT**2 * sizes[:, -1:], _SMALLEST**2)
    return np.einsum("nik,nk,njk->nij", axes, np.maximum(sizes, least), axes)


def _root(square: np.ndarray) -> np.ndarray:
    """Symmetric square roots of quadratic forms (n, 3, 3)."""
    sizes, axes = np.linalg.eigh(square)
    return np.einsum("nik,nk,njk->nij", axes, np.sqrt(sizes), axes)
