"""One table: text and Markdown in handy units, data in SI."""

import csv
import io
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointplay.base.tables import Column, Table, counted
from jointplay.base.units import displayed


@pytest.fixture
def table():
    return Table(
        (
            Column("joint", ["elbow", "wrist_1"]),
            Column("adds", np.array([1.23456e-3, 2e-6]), "m", "worst_part_m"),
            Column("clearance", [1e-4, None], "m", fine=True, digits=3),
            Column("share", [0.9, 0.1], "1", digits=3, errors=[0.02, math.nan]),
            Column("seed", [1, 2], only="data"),
            Column("held by", ["target", "a | b"], only="text"),
        ),
        totals=[("all", 1.23656e-3, None, 1.0, None)],
        notes=["a note"],
    )


def test_text_is_aligned_in_handy_units(table):
    lines = str(table).splitlines()
    titles = ["joint", "adds [mm]", "clearance [µm]", "share [%]", "held by"]
    assert re.split(r"  +", lines[0]) == titles
    assert lines[1].split() == ["elbow", "1.2346", "100", "90", "+-", "2", "target"]
    assert lines[2].split() == ["wrist_1", "0.0020", "10", "a", "|", "b"]
    assert lines[3].split() == ["all", "1.2366", "100"]
    assert lines[4] == "a note"
    ends = [
        line.rindex(last) + len(last)
        for line, last in zip(lines, ("by", "target", "b"), strict=False)
    ]
    assert len(set(ends)) == 1


def test_data_are_si_and_quoted(table):
    rows = list(csv.DictReader(io.StringIO(table.csv())))
    assert list(rows[0]) == ["joint", "worst_part_m", "clearance_m", "share", "share_error", "seed"]
    assert rows[0]["worst_part_m"] == "0.00123456"
    assert rows[1]["clearance_m"] == rows[1]["share_error"] == ""
    assert table.records()[0]["seed"] == 1
    odd = Table([Column('a "b", c', ["x, y", 'z "'])]).csv()
    assert list(csv.reader(io.StringIO(odd)))[1:] == [["x, y"], ['z "']]


def test_markdown_and_html_escape_what_they_must(table):
    assert table.markdown().splitlines()[1] == "| --- | --- | --- | --- | --- |"
    assert "a \\| b" in table.markdown()
    html = Table([Column("<b>", ["<script>"])])._repr_html_()
    assert "<script>" not in html
    assert "&lt;b&gt;" in html


@given(st.lists(st.floats(-1e6, 1e6), min_size=1), st.integers(2, 6))
def test_a_number_is_shown_within_half_of_its_last_digit(values, digits):
    column = Column("x", values, digits=digits)
    largest = max(map(abs, values))
    for value, text in zip(values, column.texts(), strict=True):
        assert abs(float(text) - value) <= 0.51 * 10.0 ** (1 - digits) * 10 * max(largest, 1e-300)


def test_what_is_small_is_told_from_nothing():
    assert Column("x", [1.8043, 3.81e-5, 0.0, 1e-12]).texts() == [
        "1.8043",
        "4e-05",
        "0.0000",
        "0.0000",
    ]
    assert Column("x", [0.0, 0.0]).texts() == ["0", "0"]


def test_every_display_unit_is_a_size_of_its_own():
    for unit in ("m", "rad", "m/N", "rad/(N*m)"):
        factor, word = displayed(unit)
        fine, small = displayed(unit, fine=True)
        assert fine >= factor > 0.0
        assert word
        assert small
    assert displayed("furlong") == (1.0, "furlong")


@pytest.mark.parametrize(
    ("number", "words"), [(0, "0 blocks"), (1, "1 block"), ("1", "1 block"), ("1.2", "1.2 blocks")]
)
def test_one_thing_is_singular(number, words):
    assert counted(number, "block") == words


def test_a_plural_can_be_given():
    assert counted(2, "mesh", "meshes") == "2 meshes"


def test_numbers_beside_a_far_larger_one_keep_their_units():
    assert Column("ratio", [103787.0, 12.6, 8.52, 0.3], digits=3).texts() == [
        "103787", "13", "9", "0.3"
    ]  # fmt: skip
