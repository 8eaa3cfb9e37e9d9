"""The page of the paper's study: its numbers, and the places of code that it names."""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jointplay
from jointplay.paper import METHODS, Findings, MethodFigures, early_peak, errors_table, scara
from jointplay.paper.cases import EARLY, EARLY_S, judged
from jointplay.paper.page import (
    PRINTED_PEAKS,
    forms_table,
    largest_peaks,
    page,
    peaks_table,
    rim_reading,
)
from jointplay.physics.geometry import Form, Mode

SOURCE = Path(jointplay.__file__).parent


@pytest.fixture(scope="module")
def cases():
    return {
        "ideal": replace(scara(None), duration=0.3).run(),
        **{f"{c:g} mm": judged(scara(1e-3 * c)).run() for c in (0.2, 0.5)},
    }


def test_every_equation_is_where_the_page_says():
    text = (SOURCE / "paper" / "pages" / "paper.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\d, ]+) \| .* \| (\w+/.*) \|$", text, re.M)
    numbers = [int(one) for entry, _ in rows for one in entry.split(", ")]
    assert sorted(numbers) == list(range(1, 24))
    for number, where in rows:
        for place in where.split("; "):
            file, _, name = place.partition(", ")
            text = (SOURCE / file).read_text()
            for part in filter(None, name.split(".")):
                assert re.search(rf"\b(def|class) {part}\b|^{part} = ", text, re.M), (number, place)


def test_the_forms_that_occur_are_those_that_an_independent_check_found(cases):
    head, *rows = forms_table(cases)
    assert head == ("form", "contacts", "0.2 mm", "0.5 mm")
    assert [row[0] for row in rows] == [form.letter for form in Form if form]
    for letter, _, *shares in rows:
        assert all((share == "never") == (letter in "dhijl") for share in shares), letter


def test_figure_12_reads_as_in_the_paper_for_rims(cases):
    for label in ("0.2 mm", "0.5 mm"):
        found = rim_reading(cases[label])
        assert sum(share for share, *_ in found.values()) == pytest.approx(1.0)
        _, rim, middle = found[Mode.PSEUDO_PENETRATION]
        assert rim >= 0.99
        assert middle < 0.001  # the paper's figure, if read for the middle, would show none
        assert found[Mode.FREE_FLIGHT][1] < 0.5


def test_peaks_are_beside_the_papers_six_times(cases):
    assert PRINTED_PEAKS == {"x": (1.6, 2.5), "y": (0.2, 1.8), "z": (2.1, 2.5)}
    (at, size), _ = sorted(largest_peaks(cases["0.2 mm"], "x"), key=lambda peak: -peak[1])
    force = np.abs(cases["0.2 mm"]["joint_force_peak"].sel(axis="x").values[:, 0])
    late = cases["0.2 mm"].time >= cases["0.2 mm"].judge_from
    assert size == force[late].max()
    assert at == cases["0.2 mm"].time[late][force[late].argmax()]
    rows = peaks_table(cases)
    assert rows[1][1] == "1.6 s, 2.5 s"
    assert "1.80 s (772 N)" in rows[1][2]


def test_the_explicit_method_is_too_high_in_the_first_strokes_and_every_cell_says_so(cases):
    method = "semi-implicit-euler, 10 µs"
    options = METHODS[method]
    explicit = judged(replace(scara(2e-4), **options, duration=EARLY_S)).run()
    default = early_peak(cases["0.2 mm"])
    assert default == pytest.approx(476.9, abs=0.1)  # 476.90 by an independent integrator
    found = MethodFigures({EARLY: early_peak(explicit)}, tuple(explicit.audit.warnings))
    assert found.figures[EARLY] > 1.3 * default
    assert any("explicit step" in warning for warning in found.warnings)
    rows = errors_table(cases, {("0.2 mm", method): found})
    head, *rest = rows
    assert head[-1] == method
    assert all(row[-1] for row in rest)
    (early,) = (row for row in rest if row[:2] == ("0.2 mm", EARLY))
    assert re.search(r"\(\+4\d\.\d %\)", early[-1])
    study = Findings(cases, rows, [f"0.2 mm, {found.warnings[0]}"], [])
    text = page(study, "Balanced, consistent, multi-rate")
    for figure in range(9, 16):
        assert f"](fig{figure:02d}.png)" in text
    assert "Warnings of these runs are in errors.md" in text
    for said in ("last branch of eq. 21", "no rigid body has", "Section 6", "Figure 12 read for"):
        assert said in text
