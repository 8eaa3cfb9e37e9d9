import runpy
from pathlib import Path

from jointplay.physics.joints import JOINT_KINDS
from jointplay.show.reports.sections import all_assumptions, conditions

SITE = Path(__file__).parents[1] / "docs" / "site" / "assumptions.py"


def test_the_page_says_what_reports_say():
    script = runpy.run_path(str(SITE))
    page = script["PAGE"].read_text(encoding="utf-8")
    assert page == script["renewed"](page), "run: python docs/site/assumptions.py"
    assert all(text in page for _, text in all_assumptions())


def test_it_is_known_when_each_assumption_is_made():
    assert {when for when, _ in all_assumptions()} == set(conditions([]))
    assert {when for when, _ in all_assumptions()} >= set(JOINT_KINDS)
