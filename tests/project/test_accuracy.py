"""The accuracy benchmark: cases it draws, what it takes for true, and what is silent."""

import types
from dataclasses import replace

import numpy as np
import pytest
from truth import accuracy
from truth import random_cases as cases

from jointplay.physics.contact import FRICTION_LAWS, NORMAL_LAWS
from jointplay.simulation.result.certificate import Certificate, CertifiedFigure


def test_every_mechanism_and_law_is_drawn_about_as_often_as_any_other():
    for which, choices in enumerate((cases.KINDS, tuple(NORMAL_LAWS), tuple(FRICTION_LAWS))):
        drawn = [cases.in_turn(choices, 3, number, which) for number in range(200)]
        counts = [drawn.count(name) for name in choices]
        assert min(counts) >= 200 // len(choices)
        assert max(counts) <= 200 // len(choices) + 1


@pytest.mark.thorough
def test_a_case_hangs_on_its_seed_and_number_alone():
    several = [cases.drawn(5, number) for number in range(len(cases.KINDS))]
    assert {case.kind for case in several} == set(cases.KINDS)
    assert sum(bool(case.simulation.mechanism.clearance) for case in several) >= 10
    for number in (9, 2):
        again = cases.drawn(5, number)
        assert again == replace(several[number], simulation=again.simulation)
        assert again.simulation.describe() == several[number].simulation.describe()
        other = cases.drawn(6, number).simulation.describe()
        assert other != several[number].simulation.describe()


def truth(draws, coarser, target=0.01):
    return accuracy.Truth(tuple(draws), coarser, "N", target)


def test_a_figure_is_calm_sensitive_or_not_converged():
    assert truth((100.0, 100.1, 100.2, 100.0), 100.1).state == "calm"
    assert truth((100.0, 103.0, 99.0, 100.0), 101.0).state == "sensitive"
    assert truth((100.0, 100.1, 100.2, 100.0), 101.0).state == "open"
    assert truth((100.0, 103.0, 99.0, 100.0), 120.0).state == "open"


def test_the_distance_from_the_truth_is_that_from_the_interval():
    known = truth((100.0, 102.0, 101.0, 100.5), 99.0)
    assert [known.away(value) for value in (98.5, 99.0, 101.5, 104.0)] == [0.5, 0.0, 0.0, 2.0]


def test_only_what_no_error_and_no_warning_tells_of_is_silent():
    known = truth((100.0, 100.1, 100.2, 100.0), 100.1)
    assert known.verdict(101.0, np.nan, False) == ""
    assert known.verdict(103.0, np.nan, False) == "silent"
    assert known.verdict(103.0, 1.0, False) == "silent"
    assert known.verdict(103.0, 3.0, False) == "outside"
    assert known.verdict(103.0, np.nan, True) == "outside"
    assert truth((100.0, 100.0, 100.0), 101.0).verdict(150.0, np.nan, False) == ""


def test_what_a_run_states_is_that_of_its_certificate():
    run = types.SimpleNamespace(certificate=None)
    assert accuracy.stated_errors(run) == {}
    run.certificate = Certificate((CertifiedFigure("impacts", 9.0, 2.0, ""),))
    assert accuracy.stated_errors(run) == {"impacts": 2.0}


def test_a_case_is_judged():
    """The first 10 ms of a slider."""
    number = next(k for k in range(99) if cases.in_turn(cases.KINDS, 1, k, 0) == "slider")
    case = cases.drawn(1, number)
    short = replace(case, simulation=replace(case.simulation, duration=0.01))
    outcome = accuracy.judge(lambda: short)
    assert not outcome.note
    found = {row["figure"]: row for row in outcome.rows}
    assert {accuracy.kind_of(name) for name in found} == set(accuracy.HEADLINE)
    for row in found.values():
        assert row["low"] <= row["finest"] <= row["high"]
        assert row["away"] <= max(0.05 * abs(row["mean"]), 1.0)
        assert {"certified_error", "covered", "agreed"} <= set(row)
    lines = accuracy.table([outcome])
    assert [entries[0] for entries in lines] == ["slider", *accuracy.HEADLINE, "all"]
