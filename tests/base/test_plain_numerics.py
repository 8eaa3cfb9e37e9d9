"""What is computed here rather than by scipy, which takes long to import, has scipy's numbers."""

import math

import numpy as np
import pytest
from scipy import interpolate, optimize, signal
from scipy.spatial.transform import Rotation

from jointplay.accuracy.rest import near_cones
from jointplay.base.roots import brentq
from jointplay.simulation.analysis.tool_error import _turns
from jointplay.simulation.analysis.vibration import _welch
from jointplay.simulation.motion.piecewise import Piecewise

RANDOM = np.random.default_rng(7)


def same_curves(ours, theirs, at):
    assert np.array_equal(ours(at), theirs(at))
    for order in (1, 2):
        mine, its = ours.derivative(order), theirs.derivative(order)
        assert np.array_equal(mine.c, its.c)
        assert np.array_equal(mine(at), its(at))


@pytest.mark.parametrize("number", [2, 3, 8])
def test_motions_from_rest_to_rest_bit_for_bit(number):
    ends, values = np.cumsum(RANDOM.uniform(0.01, 1.0, number)), RANDOM.normal(size=(number, 3))
    still = np.zeros_like(values)
    nodes = np.stack([values, still, still], axis=1)
    theirs = interpolate.PPoly.from_bernstein_basis(interpolate.BPoly.from_derivatives(ends, nodes))
    at = np.concatenate([ends, np.linspace(ends[0] - 0.1, ends[-1] + 0.1, 300)])
    same_curves(Piecewise.rest_to_rest(ends, values), theirs, at)


@pytest.mark.parametrize("powers", [2, 3])
def test_straight_lines_and_parabolas_bit_for_bit(powers):
    c, ends = RANDOM.normal(size=(powers, 4, 2)), np.array([0.0, 0.3, 0.5, 1.1, 2.0])
    at = np.linspace(-1.0, 3.0, 200)
    same_curves(Piecewise(c, ends), interpolate.PPoly(c, ends), at)


ROOTS = {
    "exponential": lambda x: math.exp(x) - 1.7,
    "flat": lambda x: x**3 - 0.3,
    "steep": lambda x: math.atan(200.0 * (x - 0.77)),
    "jump": lambda x: 1.0 if x > 0.123 else -1.0,
    "tiny": lambda x: 1e-300 * (x - 0.4),
}


@pytest.mark.parametrize("name", ROOTS)
@pytest.mark.parametrize("options", [{}, {"xtol": 1e-15}, {"xtol": 1e-16, "rtol": 1e-14}])
def test_roots_bit_for_bit(name, options):
    function = ROOTS[name]
    assert brentq(function, -1.0, 2.5, **options) == optimize.brentq(function, -1.0, 2.5, **options)


def test_a_root_at_an_end_and_none_at_all():
    assert brentq(lambda x: x, 0.0, 1.0) == 0.0
    assert brentq(lambda x: x - 1.0, 0.0, 1.0) == 1.0
    with pytest.raises(ValueError, match="different signs"):
        brentq(lambda x: x, 1.0, 2.0)


@pytest.mark.parametrize(("count", "length"), [(900, 256), (900, 257), (40, 40), (17, 16)])
def test_spectra(count, length):
    values = 3.0 + RANDOM.normal(size=(count, 3))
    ours = _welch(values, 1e-3, length)
    theirs = signal.welch(values, 1e3, "hann", length, detrend="constant", axis=0)
    for mine, its in zip(ours, theirs, strict=True):
        assert mine == pytest.approx(its, rel=1e-11, abs=1e-14)


@pytest.mark.parametrize("size", [0.0, 1e-12, 1e-4, 1.0, 3.0])
def test_turns(size):
    reference = Rotation.from_rotvec(RANDOM.normal(size=(50, 3)))
    turn = Rotation.from_rotvec(size * RANDOM.normal(size=(50, 3)) / 3.0)
    ours, those = ((one.as_quat()[:, [3, 0, 1, 2]]) for one in (turn * reference, reference))
    ours = ours * RANDOM.choice([-1.0, 1.0], size=(50, 1))
    assert _turns(ours, those) == pytest.approx(turn.as_rotvec(), rel=1e-9, abs=1e-15)


@pytest.mark.parametrize("seed", range(12))
def test_points_are_near_cones_where_least_squares_without_negative_parts_say_so(seed, monkeypatch):
    random = np.random.default_rng(seed)
    count, rank, m = 200, int(random.integers(2, 7)), int(random.integers(1, 60))
    edges = random.normal(size=(count, m, rank)) * 10.0 ** random.uniform(-3, 3, (count, 1, 1))
    if seed % 3 == 0:  # narrow ones
        edges += 2.0 * np.abs(edges[:, :1])
    if seed % 4 == 0:  # with edges that nearly agree
        edges[:, ::2] = edges[:, :1] + 1e-3 * edges[:, ::2]
    edges[random.random((count, m)) < 0.2] = 0.0
    points = random.normal(size=(count, rank)) * 10.0 ** random.uniform(-10, 10)
    parts = random.exponential(size=(count, m)) * (random.random((count, m)) < 0.3)
    points = np.where(
        random.random((count, 1)) < 0.5, np.einsum("nm,nmr->nr", parts, edges), points
    )
    distance = np.linalg.norm(points, axis=1) * 10.0 ** random.uniform(-5, -1)
    left = [optimize.nnls(one.T, point)[1] for one, point in zip(edges, points, strict=True)]
    asked = []
    nnls = optimize.nnls
    monkeypatch.setattr(optimize, "nnls", lambda *about: asked.append(1) or nnls(*about))
    sure = np.abs(left - distance) > 1e-6 * distance
    near = near_cones(edges, points, distance)
    assert np.array_equal(near[sure], (left <= distance)[sure])
    assert len(asked) <= 0.02 * count
