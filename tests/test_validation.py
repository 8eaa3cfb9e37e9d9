"""Validation cases: each fails with its deliberate mistake, and the page says what was found.

That their short forms pass is said by the quick form of the benchmark (`test_benchmarks.py`).
"""

import pytest
from truth.validate import main, page
from truth.validation import CASES, load

load()


@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_case_fails_with_its_deliberate_mistake(name):
    assert not CASES[name].run(True, True).passed


def test_page_says_what_was_found(tmp_path):
    assert main(["--quick", "--only", "ideal_slider_crank", "--out", str(tmp_path)]) == 0
    text = (tmp_path / "validation.md").read_text(encoding="utf-8")
    assert "1 of 1 cases pass" in text
    assert "Ideal slider-crank" in text
    assert (tmp_path / "images" / "validation" / "ideal_slider_crank.png").stat().st_size > 5000


def test_page_names_what_fails():
    case = CASES["hertz_impact"]
    text = page({"hertz_impact": (case, case.run(True, True), 1.0)}, "images")
    assert "0 of 1 cases pass" in text
    assert "**fails**" in text
