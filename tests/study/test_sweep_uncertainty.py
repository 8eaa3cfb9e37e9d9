"""Coverage of confidence intervals, and Sobol indices of functions for which they are known."""

import numpy as np
import pytest

import jointplay as jp
from jointplay.simulation.analysis.uncertainty import (
    Until,
    convergence,
    enough,
    interval_estimate,
    read_until,
    sobol_indices,
)
from jointplay.study.axes import points


@pytest.mark.parametrize(
    ("statistic", "probability", "truth"),
    [("mean", 0.5, 1.0), ("quantile", 0.5, np.log(2)), ("quantile", 0.9, np.log(10)),
     ("std", 0.5, 1.0)],
)  # fmt: skip
def test_intervals_cover_the_truth_of_exponential_samples(statistic, probability, truth):
    rng = np.random.default_rng(3)
    covered = 0
    for _ in range(100):
        found = interval_estimate(rng.exponential(size=200), statistic, probability)
        covered += found.low <= truth <= found.high
    assert covered >= (85 if statistic == "std" else 92)


def test_quantiles_of_too_few_values_have_no_upper_end():
    found = interval_estimate(np.arange(10.0), "quantile", 0.99)
    assert found.high == np.inf
    assert found.relative == np.inf


def test_order_statistics_of_the_median_are_those_of_the_tables():
    # n = 20: the 6th and the 15th enclose the median with 95.9 %.
    found = interval_estimate(np.arange(20.0), "quantile", 0.5, 0.95)
    assert (found.low, found.high) == (5.0, 14.0)


def test_values_that_are_missing_are_left_out():
    found = interval_estimate(np.array([1.0, np.nan, 3.0]))
    assert (found.runs, found.value) == (2, 2.0)
    assert np.isnan(interval_estimate(np.array([np.nan])).value)


def test_enough_is_where_the_precision_is_reached_and_kept():
    rng = np.random.default_rng(0)
    history = convergence(10.0 + rng.normal(size=4000))
    runs = enough(history, 0.01)
    assert 100 < runs < 1600  # (1.96 / (10 * 0.01))^2 = 384
    assert enough(history, 1e-4) is None


def ishigami(x):
    a, b, c = np.pi * (2.0 * x.T - 1.0)
    return np.sin(a) + 7.0 * np.sin(b) ** 2 + 0.1 * c**4 * np.sin(a)


def test_indices_of_ishigamis_function_are_those_that_theory_gives():
    pytest.importorskip("SALib")
    found = sobol_indices(ishigami(points("saltelli", 4096, 3, 0)), ("a", "b", "c"))
    np.testing.assert_allclose(found.first, [0.3139, 0.4424, 0.0], atol=0.02)
    np.testing.assert_allclose(found.total, [0.5576, 0.4424, 0.2437], atol=0.02)


def test_indices_need_every_case():
    pytest.importorskip("SALib")
    values = ishigami(points("saltelli", 64, 3, 0))
    values[7] = np.nan
    with pytest.raises(jp.JointplayError, match="1 of 320 cases have no value"):
        sobol_indices(values, ("a", "b", "c"))


def test_a_precision_is_reached_when_the_interval_is_narrow_enough():
    until = Until("x", precision=0.1)
    assert until.reached(np.array([1.0, 1.01, 0.99]))
    assert not until.reached(np.array([1.0, 2.0, 0.5]))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (3, "is not a table"),
        ({"measure": "x"}, "precision is missing"),
        ({"measure": "x", "precision": 2}, "between 0 and 1"),
        ({"measure": "x", "precision": 0.1, "statistic": "median"}, "available: mean"),
        ({"measure": "x", "precisoin": 0.1}, 'did you mean "precision"'),
        ({"measure": "x", "precision": 0.1, "most": 1}, "whole number >= 2, got 1"),
    ],
)
def test_aims_that_make_no_sense_are_refused(given, words):
    with pytest.raises(jp.JointplayError, match=words):
        read_until(given)
