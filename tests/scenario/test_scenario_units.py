"""Quantities of scenario files."""

import math
from contextlib import nullcontext

import pytest
from hypothesis import given
from hypothesis import strategies as st

from jointplay import shipped
from jointplay.base.errors import JointplayError
from jointplay.base.pairs import quantity
from jointplay.base.units import WORDS, convert, plain_number, readable
from jointplay.scenario.reading import Scenario


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("0.2 mm", "m", 0.2e-3),
        ("0.2mm", "m", 0.2e-3),
        ("207 GPa", "Pa", 207e9),
        ("10 us", "s", 1e-5),
        ("10 µs", "s", 1e-5),
        ("180 deg", "rad", math.pi),
        ("60 rpm", "rad/s", 2 * math.pi),
        ("1 Hz", "rad/s", 2 * math.pi),
        ("1 inch", "m", 0.0254),
        ("1 kgf", "N", 9.80665),
        ("3 N*mm", "N*m", 3e-3),
        ("2 g*cm^2", "kg*m^2", 2e-7),
        ("-1.62 m/s^2", "m/s^2", -1.62),
        ("1e5 /m", "1/m", 1e5),
        ("100 1/mm", "1/m", 1e5),
        ("50 %", "", 0.5),
    ],
)
def test_text_is_converted_to_si(text, unit, value):
    assert convert(text, unit) == pytest.approx(value, rel=1e-12)


@given(st.decimals(-1000, 1000, places=4), st.sampled_from([("mm", "e-3"), ("um", "e-6")]))
def test_decimal_prefixes_are_exact(number, prefix):
    unit, power = prefix
    assert float(convert(f"{number:f} {unit}", "m")) == float(f"{number:f}{power}")


@given(st.floats(allow_nan=False, allow_infinity=False))
def test_bare_numbers_are_si(value):
    assert all(float(convert(value, unit)) == value for unit in WORDS)


@pytest.mark.parametrize(
    ("value", "unit", "words"),
    [
        ("0.2 mmm", "m", 'unknown unit "mmm" in "0.2 mmm"; expected a length such as "0.2 mm"'),
        ("3 kg", "m", '"3 kg" is not a length'),
        ("3", "m", '"3" without a unit is not a length'),
        ("30 deg", "", '"30 deg" is not a number'),
        ("3", "rad", '"3" without a unit is not an angle'),
        ("wide", "m", '"wide" is not a length'),
        (True, "m", "true is not a length"),
        ([1, "2 mm"], "m", '[1, "2 mm"] is not a length'),
        (math.nan, "m", "nan is not finite"),
        ("1e999 m", "m", "is not finite"),
        ("5 mm; import os", "m", "unknown unit"),
    ],
)
def test_what_is_no_such_quantity_is_refused(value, unit, words):
    with pytest.raises(ValueError) as refused:
        convert(value, unit)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_either_of_two_units_is_remembered():
    assert convert("30 deg", "rad", "m").unit == "rad"
    assert convert("30 mm", "rad", "m").unit == "m"
    assert convert(3, "rad", "m").unit == ""


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        *((2e-4, "m", "0.2 mm"), (1e-5, "s", "10 µs"), (207e9, "Pa", "207 GPa"), (0.9, "", "0.9")),
        *((0.00872665, "rad", "0.5 deg"), (1e-3, "rad", "1 mrad"), (0.2, "rad", "0.2 rad")),
    ],
)
def test_values_are_shown_with_handy_prefixes(value, unit, text):
    assert readable(value, unit) == text


def test_usual_units_are_what_pint_says():
    """Those that need no pint give bit for bit what it gives."""
    from jointplay.base import units

    for text, (goal, factor) in units.COMMON.items():
        unit = units.unit_of(text)
        assert units.fits(unit, goal), text
        assert unit.factor / units.unit_of(goal).factor == pytest.approx(factor, rel=1e-15), text
        for number in ("0.2", "1.7e3", "30"):
            exact = units.exact(number, unit.factor / units.unit_of(goal).factor)
            assert float(units.convert(f"{number} {text}", goal)) == exact, text


@pytest.mark.parametrize(
    "text",
    ["0.2 mm ; 1", "0.2 mm # x", "0.2 mm,", "0.2 mm=1", "0.2 mm !", "0.2 mm ~", "0.2 $mm",
     "\uff14 mm", "0.2 mm \\"],
)  # fmt: skip
def test_nothing_of_a_text_is_lost(text):
    with pytest.raises(ValueError, match="expected a length"):
        convert(text, "m")


def test_a_number_too_small_for_a_float_is_not_zero(tmp_path):
    with pytest.raises(ValueError, match='"1e-400 m" is too small'):
        convert("1e-400 m", "m")
    assert convert("0e-400 m", "m") == 0.0
    path = tmp_path / "small.toml"
    path.write_text("[joints.joint_b]\nradial_clearance = 1e-400\n")
    with pytest.raises(JointplayError, match="1e-400 is too small"):
        Scenario.load(path)


@pytest.mark.parametrize("text", ["4_35", "\uff14", "0x4", "1e-400", "4,35", ""])
def test_plain_numbers_are_plain(text):
    with pytest.raises(ValueError):
        plain_number(text)


def test_plain_numbers_are_read():
    assert plain_number(" -4.35e-1 ") == -0.435
    assert math.isnan(plain_number("nan"))


MOTION = """
[robot]
urdf = "jointplay:scara.urdf"
[joints.joint_b]
radial_clearance = "{clearance}"
[motion]
times = [0, 1]
joints = {{ joint_a = [0, {angle}], joint_b = [0, 0], stroke = [0, 0], joint_c = [0, 0] }}
"""


@pytest.mark.parametrize(("speed", "asks"), [("5000", True), ("5000.5", False), ("100", False)])
def test_whole_speeds_that_look_like_rpm_are_asked_about(tmp_path, speed, asks):
    text = shipped("slider_crank.toml").read_text()
    text = text.replace('"slider_crank.urdf"', '"jointplay:slider_crank.urdf"')
    path = tmp_path / "crank.toml"
    path.write_text(text.replace('"5000 rpm"', speed))
    told = pytest.raises(JointplayError, match=r'rpm. write "5000 rpm", or "5000 rad/s"')
    with told if asks else nullcontext():
        scenario = Scenario.load(path)
        scenario.simulation(scenario.cases[0])


@pytest.mark.parametrize(
    ("old", "new", "asks"),
    [
        (
            'bearing_radius = "10 mm"',
            "bearing_radius = 10",
            "line 17, .*would be m: mm. write",
        ),
        ('v1 = "10 mm/s"', "v1 = 10", 'v1: 10 without a unit would be m/s: mm/s. write "10 mm/s"'),
        ("restitution = 0.9", "journal_material.young = 207", "207 .* would be Pa: GPa. write"),
        ('"120 mm"', "120", "xyz.*: 120 without a unit would be m: mm"),
        ('"0.5 mm"\n', "7\n", "7 without a unit would be m: mm"),
        ('"120 mm"', '"5deg mm"', "is not a length"),
        ('bearing_radius = "10 mm"', "bearing_radius = 0.01", ""),
    ],
)
def test_numbers_without_a_unit_of_an_odd_size_are_asked_about(tmp_path, old, new, asks):
    text = shipped("slider_crank.toml").read_text()
    assert old in text
    path = tmp_path / "crank.toml"
    path.write_text(text.replace(old, new).replace('"slider', '"jointplay:slider'))
    with pytest.raises(JointplayError, match=asks) if asks else nullcontext():
        Scenario.load(path)


def test_whole_numbers_that_look_like_degrees_are_asked_about(tmp_path):
    path = tmp_path / "turn.toml"
    path.write_text(MOTION.format(clearance="0.2 mm", angle="-90"))
    with pytest.raises(JointplayError, match=r'14.3 turns: degrees. write "-90 deg", or "-90 rad"'):
        Scenario.load(path).simulation()
    for angle, value in (('"-90 deg"', -math.pi / 2), ("-1.5", -1.5), ('"-90 rad"', -90.0)):
        path.write_text(MOTION.format(clearance="0.2 mm", angle=angle))
        motion = Scenario.load(path).simulation().motion
        assert motion.positions[1][0] == pytest.approx(value)
    with pytest.raises(JointplayError, match=r"--pose joint_a: 45 without a unit.*degrees"):
        quantity("45", "rad", "--pose joint_a")


def test_a_clearance_of_half_the_bearing_is_told(tmp_path):
    path = tmp_path / "wide.toml"
    for clearance, told in (("5 mm", True), ("0.2 mm", False)):
        path.write_text(MOTION.format(clearance=clearance, angle="0.1"))
        scenario = Scenario.load(path)
        scenario.simulation()
        said = "a radial clearance of 5 mm in a bearing of radius 10 mm, 50% of it"
        assert any(said in note for note in scenario.notes) is told
