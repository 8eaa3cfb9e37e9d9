from jointplay.physics.joints import JOINT_KINDS
from jointplay.show.reports.assumptions import all_assumptions, conditions


def test_it_is_known_when_each_assumption_is_made():
    assert {when for when, _ in all_assumptions()} == set(conditions([]))
    assert {when for when, _ in all_assumptions()} >= set(JOINT_KINDS)
