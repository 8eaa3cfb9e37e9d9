"""Gaps against brute force, the paper's special cases, and their own gradients."""

import numpy as np
import pytest
from conftest import gaps, journal_axis
from hypothesis import given, settings
from hypothesis import strategies as st

from jointplay.base.compiler import compiled
from jointplay.physics.geometry import (
    CONTACT_TOLERANCE_M,
    EDGE_ROUNDING_M,
    Form,
    Mode,
    Shape,
    classify_form,
    classify_many,
    classify_mode,
    clear_of_cylinder,
    deepest_rim_direction,
    touch_cylinder,
    touch_faces,
    touch_rims,
)

RI, LI, RJ, LJ = 10e-3, 40e-3, 9.8e-3, 39.6e-3
SIZES = (RI, LI, RJ, LJ)
PHI = np.linspace(0.0, 2.0 * np.pi, 20001)

small = st.floats(-3e-4, 3e-4)
angle = st.floats(-0.03, 0.03)
poses = st.tuples(small, small, small, angle, angle)


def pose(x, y, z, pitch, roll):
    return np.array([x, y, z]), journal_axis([0.0, pitch, roll])


def rim(centre, axis, side):
    """Points of one rim, densely sampled."""
    e1 = np.cross(axis, [0.0, 1.0, 0.0])
    e1 /= np.linalg.norm(e1)
    e2 = np.cross(axis, e1)
    end = centre + side * 0.5 * LJ * axis
    return end + RJ * (np.outer(np.cos(PHI), e1) + np.outer(np.sin(PHI), e2))


@settings(max_examples=60)
@given(poses)
def test_gaps_are_those_of_the_deepest_rim_points(values):
    centre, axis = pose(*values)
    gap, point, _ = gaps(centre, axis, *SIZES)
    for end, side in enumerate((1.0, -1.0)):
        points = rim(centre, axis, side)
        # Sampled at 0.3 mrad, the largest distance is missed by less than R_j (3e-4)^2 / 8.
        radial = RI - np.hypot(points[:, 0], points[:, 1]).max()
        assert gap[end] == pytest.approx(radial, abs=2e-10)
        axial = LI / 2 - (side * points[:, 2]).max()
        assert -1e-10 <= gap[2 + end] - axial <= EDGE_ROUNDING_M + 1e-10
        assert np.hypot(*point[end, :2]) == pytest.approx(RI - gap[end], abs=1e-12)


@settings(max_examples=20)
@given(st.floats(0.3, 1.2), st.floats(-2e-3, 2e-3), st.floats(-2e-3, 2e-3))
def test_deepest_point_is_found_at_large_tilts_too(tilt, x, y):
    centre, axis = pose(x, y, 0.0, tilt, 0.0)
    gap, _, _ = gaps(centre, axis, *SIZES)
    for end, side in enumerate((1.0, -1.0)):
        points = rim(centre, axis, side)
        assert gap[end] == pytest.approx(RI - np.hypot(*points.T[:2]).max(), abs=3e-9)


@compiled
def of_both_ends(k, cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj):
    """What `touch_rims` and `touch_faces` say of contact k."""
    one, other = touch_rims(cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj)
    if k > 1:
        one, other = touch_faces(cx, cy, cz, ax, ay, az, ri, rj, half_li, half_lj)
    return other if k & 1 else one


@settings(max_examples=60)
@given(poses)
def test_both_ends_at_once_are_each_end_alone(values):
    centre, axis = pose(*values)
    where = (*map(float, centre), *map(float, axis), RI, RJ, LI / 2, LJ / 2)
    for k in range(4):
        assert of_both_ends(k, *where) == touch_cylinder(k, *where)


@settings(max_examples=200)
@given(poses)
def test_what_is_plainly_clear_does_not_touch(values):
    centre, axis = pose(*values)
    where = (*map(float, centre), *map(float, axis), RI, RJ, LI / 2, LJ / 2)
    for k in range(4):
        if clear_of_cylinder(k, *where):
            assert touch_cylinder(k, *where)[0] >= 0.0  # 0: just


def test_parallel_axes_are_plainly_clear_until_they_touch():
    for away in (0.999, 1.001):
        where = (away * (RI - RJ), 0.0, away * (LI - LJ) / 2, 0.0, 0.0, 1.0, RI, RJ, LI / 2, LJ / 2)
        clear = [clear_of_cylinder(k, *where) for k in range(4)]
        assert clear == ([1, 1, 1, 1] if away < 1.0 else [0, 0, 0, 1])


@pytest.mark.parametrize("kappa", [1e-9, 1e-4, 1e-2, 0.04, 0.049999, 0.050001, 0.3])
@pytest.mark.parametrize("alpha", [0.0, 1e-7, 0.3, np.pi / 4, 1.2, np.pi / 2])
def test_deepest_direction_is_a_root_to_rounding(kappa, alpha):
    """Whichever way it is found, small kappa or not."""
    tilt = 0.2
    norm = RJ * np.sin(tilt) ** 2 / (2 * kappa)
    x, y = norm * np.cos(alpha), norm * np.sin(alpha)
    c, s = deepest_rim_direction(x / np.cos(tilt), y, np.sin(tilt), np.cos(tilt), RJ)
    assert np.hypot(c, s) == pytest.approx(1.0, abs=4e-16)
    wrong = y * c - x * s + RJ * np.sin(tilt) ** 2 * s * c
    assert abs(wrong) < 1e-15 * (norm + RJ * np.sin(tilt) ** 2)


def meeting_axes(theta, m, reach, azimuth):
    """Axes that meet in M at height m; the journal's +z end centre lies `reach` beyond M."""
    axis = np.array(
        [np.sin(theta) * np.cos(azimuth), np.sin(theta) * np.sin(azimuth), np.cos(theta)]
    )
    return np.array([0.0, 0.0, m]) + (reach - LJ / 2) * axis, axis


@pytest.mark.parametrize("theta", [1e-3, 5e-3, 2e-2])
@pytest.mark.parametrize("azimuth", [0.0, 1.0, 4.0])
def test_meeting_axes_give_equations_4_and_5(theta, azimuth):
    m, reach = 2e-3, 15e-3
    gap, _, _ = gaps(*meeting_axes(theta, m, reach, azimuth), *SIZES)
    assert gap[0] == pytest.approx(RI - reach * np.sin(theta) - RJ * np.cos(theta), abs=1e-15)
    equation_5 = (LI / 2 - m) - reach * np.cos(theta) - RJ * np.sin(theta)
    assert abs(gap[2] - equation_5) <= EDGE_ROUNDING_M


def test_second_order_of_the_tilt_is_kept():
    theta = 0.02
    gap, _, _ = gaps(*meeting_axes(theta, 0.0, LJ / 2, 0.3), *SIZES)
    first_order = RI - LJ / 2 * theta - RJ
    assert gap[0] - first_order == pytest.approx(RJ * (1 - np.cos(theta)), rel=0.02)
    assert gap[0] - first_order > 1.9e-6


@pytest.mark.parametrize("alpha", [-1.0, 0.0, 0.4])
def test_parallel_axes_give_equations_6_and_7(alpha):
    distance = 1.5e-4
    centre = distance * np.array([np.cos(alpha), 0.0, np.sin(alpha)])
    gap, _, _ = gaps(centre, np.array([0.0, 0.0, 1.0]), *SIZES)
    assert gap[2] == pytest.approx(LI / 2 - LJ / 2 - distance * np.sin(alpha), abs=1e-16)
    assert gap[0] == pytest.approx(RI - RJ - distance * np.cos(alpha), abs=1e-16)
    assert gap[0] == gap[1]


@pytest.mark.parametrize("azimuth", np.linspace(0.0, 3.0, 7))
def test_gap_and_contact_point_are_continuous_through_zero_tilt(azimuth):
    # A journal pressed against bore and end wall, tilted from one side to the other.
    tilts = np.linspace(-1e-5, 1e-5, 4001)
    axes = np.stack(
        [np.sin(tilts) * np.cos(azimuth), np.sin(tilts) * np.sin(azimuth), np.cos(tilts)], axis=1
    )
    centre = np.array([2.01e-4, 0.0, 2.01e-4])
    found = [gaps(centre, axis, *SIZES) for axis in axes]
    gap, point = np.array([f[0] for f in found]), np.array([f[1] for f in found])
    assert np.abs(np.diff(gap, axis=0)).max() < 3e-10
    # The deepest point crosses the whole face, 20 mm, in steps below 40 um.
    crossed = point[-1, 2] - point[0, 2]
    assert np.linalg.norm(crossed) > 1.3 * RJ
    assert np.linalg.norm(np.diff(point, axis=0), axis=2).max() < 4e-5


@pytest.mark.parametrize(
    ("smallest", "mode"),
    [
        (2.0 * CONTACT_TOLERANCE_M, Mode.FREE_FLIGHT),
        (0.5 * CONTACT_TOLERANCE_M, Mode.CONTINUOUS_CONTACT),
        (-0.5 * CONTACT_TOLERANCE_M, Mode.CONTINUOUS_CONTACT),
        (-2.0 * CONTACT_TOLERANCE_M, Mode.PSEUDO_PENETRATION),
    ],
)
@pytest.mark.parametrize("place", range(4))
def test_mode_follows_table_1(smallest, mode, place):
    gap = np.full(4, 1e-4)
    gap[place] = smallest
    assert classify_mode(gap) == mode


UP, DOWN = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
FORMS = {  # touching contacts (rA, rB, aA, aB), same side of the bore, flat face
    Form.NONE: ("", True, False),
    Form.RADIAL_BOTH_ENDS_OPPOSITE: ("01", False, False),
    Form.RADIAL_AXIAL_SAME_END: ("02", True, False),
    Form.RADIAL_AXIAL_OTHER_END: ("03", True, False),
    Form.AXIAL_BOTH_ENDS: ("23", True, False),
    Form.ONE_RADIAL: ("1", True, False),
    Form.ONE_AXIAL: ("3", True, False),
    Form.TWO_RADIAL_ONE_AXIAL: ("012", False, False),
    Form.ONE_RADIAL_TWO_AXIAL: ("023", True, False),
    Form.FOUR_POINTS: ("0123", False, False),
    Form.SURFACE: ("2", True, True),
    Form.LINE: ("01", True, False),
    Form.SURFACE_AND_LINE: ("012", True, True),
}


@pytest.mark.parametrize(("form", "case"), FORMS.items(), ids=[f.name for f in FORMS])
def test_every_contact_form_of_figure_2(form, case):
    touching, same_side, flat = case
    gap = np.array([-1e-6 if str(k) in touching else 1e-4 for k in range(4)])
    normal = np.array([UP, UP if same_side else DOWN, (0, 0, -1.0), (0, 0, 1.0)])
    assert classify_form(gap, normal, 0.0 if flat else 1e-4) == form


def test_letters_are_those_of_figure_2():
    assert "".join(form.letter for form in Form) == "-abcdefghijkl"


@pytest.mark.parametrize(
    ("values", "letter"),
    [
        ((0, 0, 0, 0, 0), "-"),
        ((2.01e-4, 0, 0, 0, 0), "k"),
        ((0, 0, 2.01e-4, 0, 0), "j"),
        ((2.01e-4, 0, 2.01e-4, 0, 0), "l"),
        ((0, 0, 0, 0.0104, 0), "a"),
        ((1.5e-4, 0, 0, 0.003, 0), "e"),
        ((0, 0, 1.9e-4, 0.002, 0), "f"),
        ((1.5e-4, 0, 1.8e-4, 0.003, 0), "b"),
        ((1.5e-4, 0, -1.8e-4, 0.003, 0), "c"),
        ((0, 0, 1.5e-4, 0.0104, 0), "g"),
    ],
)
def test_forms_of_real_poses(values, letter):
    assert form_of(values, SIZES).letter == letter


def form_of(values, sizes):
    """Contact form of a pose x, y, z, pitch, roll; `sizes` are R_i, L_i, R_j, L_j."""
    centre, axis = pose(*values)
    turn = np.zeros((3, 3))
    turn[:, 2] = axis
    ri, li, rj, lj = sizes
    dimensions = np.array([ri, rj, li / 2, lj / 2])
    poses = np.concatenate([centre, turn.ravel()])[None]
    _, _, forms = classify_many(int(Shape.CYLINDER), dimensions, 4, poses)
    return Form(forms[0])


@pytest.mark.parametrize(
    ("journal", "x", "pitch", "letter"),
    [
        ((9.5e-3, 39.9e-3), 0.0, 5.35e-3, "d"),  # wide bore, close walls: both walls at once
        ((9.5e-3, 39.9e-3), 4e-4, 5.35e-3, "h"),
        ((9.8e-3, 39.81e-3), 0.0, 1.022e-2, "i"),  # stuck in every corner
    ],
)
def test_forms_that_need_other_clearances(journal, x, pitch, letter):
    assert form_of((x, 0.0, 0.0, pitch, 0.0), (RI, LI, *journal)).letter == letter
