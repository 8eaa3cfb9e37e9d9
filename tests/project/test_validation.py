"""Validation cases: each fails with its deliberate mistake, and the page says what was found.

That their short forms pass is said by the quick form of the benchmark (`test_benchmarks.py`).
"""

import json
import runpy
from pathlib import Path

import pytest
from truth.validate import main, record
from truth.validation import CASES, load

load()
TABLES = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "site" / "tables.py"))


@pytest.mark.thorough
@pytest.mark.parametrize("name", CASES)
def test_case_fails_with_its_deliberate_mistake(name):
    assert not CASES[name].run(True, True).passed


def test_tables_say_what_was_found(tmp_path):
    assert main(["--quick", "--only", "ideal_slider_crank", "--out", str(tmp_path)]) == 0
    data = json.loads((tmp_path / "data" / "validation.json").read_text(encoding="utf-8"))
    made = TABLES["validation"](data)
    assert "1 of 1 cases pass" in made["summary"]
    assert "### Ideal slider-crank" in made["cases"]
    assert (tmp_path / "images" / "validation" / "ideal_slider_crank.png").stat().st_size > 5000


def test_tables_name_what_fails():
    case = CASES["hertz_impact"]
    one = record(case, case.run(True, True), 1.0)
    made = TABLES["validation"]({"machine": {}, "cases": [one], "not_compared": []})
    assert "0 of 1 cases pass" in made["summary"]
    assert "**fails**" in made["cases"]


def test_the_documentation_has_every_case_and_engine():
    kept = TABLES["read"]("validation")["cases"]
    assert [case["name"] for case in kept] == list(CASES)
    assert all(case["passed"] for case in kept)
    for page in ("validation", "peers"):
        assert "made here" not in TABLES["filled"](f"{page}.md", TABLES[page]())
    assert all(part in TABLES["peers_numbers"]() for part in TABLES["peers"]().values())
