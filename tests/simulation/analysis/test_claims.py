"""Verdicts on ensembles with known differences."""

from dataclasses import replace

import numpy as np
import pytest

from jointplay.paper import scara
from jointplay.simulation.analysis.claims import CLAIMS, can_be_measured, judge

TYPICAL = {
    "deviation_mm": 3.0,
    "path_mm": 2.0,
    "speed_mm_s": 50.0,
    "free": 0.1,
    "continuous": 0.1,
    "penetration": 0.8,
    "fx": 700.0,
    "fy": 700.0,
    "fz": 700.0,
    "busy": 0.01,
    "peak_time": 1.8,
    "rate": 60.0,
    "impulse": 1.0,
    "crossings": 15.0,
    "swing_mm": 1.0,
}
GROWING = ("deviation_mm", "path_mm", "speed_mm_s", "fx", "fy", "fz", "swing_mm")


def ensemble(factor: float, spread: float, changes=(), runs: int = 8):
    """Runs whose growing measures are `factor` times the typical, crossings its inverse."""
    random = np.random.default_rng(1)
    made = []
    for _ in range(runs):
        run = {key: value * (1.0 + spread * random.normal()) for key, value in TYPICAL.items()}
        for key in GROWING:
            run[key] *= factor
        run["crossings"] /= factor
        run.update(changes)
        made.append(run)
    return made


def verdicts(small, large):
    return {v.claim: v.holds for v in judge(small, large, "test")}


def test_clear_differences_hold():
    assert set(verdicts(ensemble(1.0, 0.02), ensemble(2.0, 0.02)).values()) == {"yes"}


def test_opposite_differences_fail_all_but_the_modes():
    found = verdicts(ensemble(2.0, 0.02), ensemble(1.0, 0.02))
    assert found.pop(4) == "yes"
    assert set(found.values()) == {"no"}


def test_differences_within_the_spread_are_undecided():
    found = verdicts(ensemble(1.0, 0.3), ensemble(1.02, 0.3))
    assert {found[n] for n in (1, 2, 3, 5, 6)} == {"undecided"}


def test_identical_runs_do_not_divide_by_zero():
    assert verdicts(ensemble(1.0, 0.0), ensemble(1.5, 0.0))[1] == "yes"
    assert verdicts(ensemble(1.0, 0.0), ensemble(1.0, 0.0))[1] == "undecided"


@pytest.mark.parametrize(
    ("claim", "changes"), [(4, {"free": 0.0}), (5, {"busy": 0.4})], ids=["no flight", "no peaks"]
)
def test_one_missing_feature_fails_its_claim_alone(claim, changes):
    found = verdicts(ensemble(1.0, 0.02), ensemble(2.0, 0.02, changes))
    assert found.pop(claim) == "no"
    assert set(found.values()) == {"yes"}


def test_every_claim_is_judged_with_its_numbers():
    found = judge(ensemble(1.0, 0.02), ensemble(2.0, 0.02), "balanced, consistent")
    assert [v.claim for v in found] == list(CLAIMS)
    for verdict in found:
        assert "→" in verdict.numbers
        assert any(character.isdigit() for character in verdict.numbers)


@pytest.mark.parametrize(("judge_from", "right"), [(0.02, True), (0.025, False), (None, False)])
def test_runs_of_any_length_are_measured_if_more_of_them_is_judged_than_not(judge_from, right):
    """A start that lasts longer than the run is in all of it."""
    run = replace(scara(2e-4), duration=0.045, judge_from=judge_from).run(estimate=False)
    assert not can_be_measured(run)
    run["tool_error"]
    assert can_be_measured(run) is right
