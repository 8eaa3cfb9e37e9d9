"""Cylindrical laws against their formulas as the literature prints them."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import jointplay as jp
from jointplay import JointplayError
from jointplay.physics.contact import NORMAL_LAWS, ContactProperties
from jointplay.physics.contact.line_contact import (
    CHANGE_M,
    LARGEST_S,
    LineContactLaw,
    pereira_exponent,
)

IMPLICIT = [law() for law in NORMAL_LAWS.values() if issubclass(law, LineContactLaw)]
CYLINDRICAL = [*IMPLICIT, jp.contact.Pereira(), jp.contact.Liu()]
by_name = pytest.mark.parametrize("law", CYLINDRICAL, ids=lambda law: law.name)
implicit = pytest.mark.parametrize("law", IMPLICIT, ids=lambda law: law.name)


def contact(ri=10e-3, cr=0.2e-3, length=15e-3, young=207e9, poisson=0.3, c_e=1.0, stiffness=1e11):
    """One contact that carries the whole journal; the standard steel joint of the literature."""
    modulus = young / (2 * (1 - poisson**2))
    return ContactProperties(stiffness, c_e, ri, ri - cr, cr, length, length, modulus)


STANDARD = contact()


def rest(law, depth, properties=STANDARD):
    return law.function(depth, 0.0, 1.0, *law.parameters(properties))


def printed(name, force, ri, cr, length, young, poisson):
    """Depth [m] under a force [N]: the formulas of the references, in their own symbols."""
    rj = ri - cr
    e_star = 1 / (2 * (1 - poisson**2) / young)
    sigma = 2 * (1 - poisson**2) / (math.pi * young)  # sigma_i + sigma_j
    f = force / length
    r = ri * rj / cr
    if name == "johnson":
        return f / (math.pi * e_star) * (math.log(4 * math.pi * e_star * cr / f) - 1)
    if name == "radzimovsky":
        b = 1.60 * math.sqrt(f * 2 * r / e_star)
        inside = 2 / 3 + math.log(4 * ri / b) + math.log(4 * rj / b)
        return f / (math.pi * e_star) * inside
    if name == "esdu-78035":
        return f / (math.pi * e_star) * (math.log(4 * math.pi * e_star * cr / f) + 1)
    m = {"goldsmith": 1, "dubowsky-freudenstein": 3}[name]
    return force * sigma / length * (math.log(length**m / (force * r * sigma)) + 1)


joints = {
    "ri": st.floats(2e-3, 0.1),
    "cr": st.floats(1e-5, 1e-3),
    "length": st.floats(5e-3, 0.2),
    "young": st.floats(5e8, 4e11),
    "poisson": st.floats(0.0, 0.5),
}


@implicit
@settings(max_examples=60)
@given(joint=st.fixed_dictionaries(joints), share=st.floats(1e-11, 0.999))
def test_force_solves_the_printed_formula(law, joint, share):
    properties = contact(**joint)
    # Up to ln(K/F) = 2: K/e^2 is the largest force that the formula gives before its tangent.
    force = share * law.scale(properties) * math.exp(-2.0)
    depth = printed(law.name, force, **joint)
    assert rest(law, depth, properties) == pytest.approx(force, rel=1e-9)
    assert law.depth(force, properties) == pytest.approx(depth, rel=1e-9)


@by_name
@pytest.mark.parametrize("cr", [1e-5, 2e-4, 2e-3])
def test_force_is_finite_and_rises_up_to_a_tenth_of_the_radius(law, cr):
    properties = contact(cr=cr)
    depths = np.geomspace(1e-12, 0.1 * properties.journal_radius, 3000)
    force = np.array([rest(law, float(depth), properties) for depth in depths])
    assert np.isfinite(force).all()
    assert force[0] > 0.0
    assert (np.diff(force) > 0.0).all()


@implicit
def test_tangent_continues_the_formula_without_a_kink(law):
    limit = LARGEST_S / law.parameters(STANDARD)[2]
    step = 1e-6 * limit
    below, at, above = (rest(law, limit + shift) for shift in (-step, 0.0, step))
    slope = math.pi * STANDARD.modulus * STANDARD.contact_length
    assert (at - below) / step == pytest.approx(slope, rel=1e-5)  # the formula's own side
    assert (above - at) / step == pytest.approx(slope, rel=1e-9)


@by_name
def test_two_halves_carry_what_the_whole_carries(law):
    half = STANDARD._replace(contact_length=STANDARD.journal_length / 2)
    for depth in (1e-7, 1e-5, 1e-4):
        assert 2 * rest(law, depth, half) == pytest.approx(rest(law, depth), rel=1e-12)


@by_name
def test_damping_is_that_of_lankarani_and_nikravesh(law):
    p = law.parameters(contact(c_e=0.6))
    a = 0.75 * (1 - 0.6**2)
    still = law.function(1e-5, 0.0, 0.2, *p)
    assert law.function(1e-5, 0.1, 0.2, *p) == pytest.approx(still * (1 + a / 2))
    assert law.function(1e-5, -0.2, 0.2, *p) == pytest.approx(still * (1 - a))


@by_name
def test_a_contact_that_is_no_line_is_hertz(law):
    wall = contact(c_e=0.8)._replace(contact_length=0.0)
    hertz, damped = jp.contact.Hertz(), jp.contact.LankaraniNikravesh()
    for state in ((1e-6, 0.0, 0.1), (2e-5, 0.05, 0.1), (2e-5, -0.1, 0.1)):
        given = law.function(*state, *law.parameters(wall))
        assert given == pytest.approx(damped.function(*state, *damped.parameters(wall)), rel=1e-14)
    assert rest(law, 1e-5, wall) == pytest.approx(hertz.function(1e-5, 0, 1, 1e11))


def test_a_joint_gives_its_dimensions_to_the_law():
    soft = jp.Material(3e9, 0.4)
    joint = jp.RevoluteClearance(
        radial_clearance=2e-4, axial_clearance=2e-4, journal_material=soft, axial_stiffness=5e9
    )
    radial, axial = joint.radial_contact, joint.axial_contact
    assert 1 / radial.modulus == pytest.approx((1 - 0.3**2) / 207e9 + (1 - 0.4**2) / 3e9)
    assert (radial.bearing_radius, radial.journal_radius) == (joint.ri, joint.rj)
    assert (radial.clearance, radial.journal_length) == (joint.cr, joint.lj)
    assert radial.contact_length == joint.lj / 2
    assert radial.radius == pytest.approx(joint.ri * joint.rj / joint.cr)
    assert axial == radial._replace(contact_length=0.0, stiffness=5e9)


def test_laws_agree_in_size_at_the_standard_joint():
    """R_i 10 mm, C_r 0.2 mm, L 15 mm, steel: forces over Johnson's [1]."""
    hertz = ContactProperties(
        4 / 3 * STANDARD.modulus * math.sqrt(STANDARD.radius), 1.0
    )  # eq. 11, whose 1/(pi (sigma_i + sigma_j)) is E*
    for depth, ratios in {
        1e-6: {
            "radzimovsky": 0.96,
            "dubowsky-freudenstein": 0.83,
            "pereira": 1.00,
            "hertz": 0.15,
            "esdu-78035": 0.77,
            "liu": 0.19,
        },
        1e-5: {
            "radzimovsky": 0.94,
            "dubowsky-freudenstein": 0.74,
            "pereira": 0.99,
            "hertz": 0.31,
            "esdu-78035": 0.68,
            "liu": 0.39,
        },
    }.items():
        johnson = rest(jp.contact.Johnson(), depth)
        for name, ratio in ratios.items():
            law = NORMAL_LAWS[name]()
            force = rest(law, depth, hertz if name == "hertz" else STANDARD)
            assert force / johnson == pytest.approx(ratio, abs=0.01), (name, depth)
    assert 0.3 < rest(jp.contact.Goldsmith(), 1e-5) / rest(jp.contact.Johnson(), 1e-5) < 0.35


@pytest.mark.parametrize("cr", [0.05e-3, 0.1e-3, 0.2e-3, 0.5e-3, 1e-3, 5e-3])
def test_pereira_is_a_fit_to_johnson(cr):
    properties = contact(cr=cr)
    for depth in np.geomspace(0.01 * cr, 0.1 * cr, 5):
        ratio = rest(jp.contact.Pereira(), float(depth), properties) / rest(
            jp.contact.Johnson(), float(depth), properties
        )
        assert 0.75 < ratio < 1.25, (cr, depth)


@pytest.mark.parametrize(("gap", "y"), [(0.1, 1.51 * math.log(100.0) ** -0.151), (1.0, 1.1661)])
def test_pereira_is_the_printed_formula(gap, y):
    """Lengths in mm, E* in MPa, the force in N."""
    for depth in (1e-3, 2e-2):
        line = 15.0 * STANDARD.modulus * 1e-6
        force = (0.965 * gap + 0.0965) * line / gap * depth ** (y * gap**-0.005)
        found = rest(jp.contact.Pereira(), 1e-3 * depth, contact(cr=1e-3 * gap))
        assert found == pytest.approx(force, rel=1e-9)


def test_pereira_exponent_changes_its_branch_without_a_jump():
    below, above = (pereira_exponent(1e3 * CHANGE_M * (1 + shift)) for shift in (-1e-9, 1e-9))
    assert below == pytest.approx(above, rel=3e-4)


@pytest.mark.parametrize(("cr", "words"), [(4e-6, "4 .m"), (11e-3, "11 mm")])
def test_pereira_refuses_clearances_that_it_was_not_fitted_for(cr, words):
    with pytest.raises(JointplayError, match=f"'pereira' is fitted .* got {words}"):
        jp.contact.Pereira().parameters(contact(ri=50e-3, cr=cr))


@settings(max_examples=60)
@given(joint=st.fixed_dictionaries(joints), share=st.floats(1e-4, 3.0))
def test_liu_is_the_printed_formula(joint, share):
    properties = contact(**joint)
    depth = share * joint["cr"]
    e_star = joint["young"] / (2 * (1 - joint["poisson"] ** 2))
    force = math.pi / 2 * joint["length"] * e_star * depth
    force *= math.sqrt(depth / (2 * (joint["cr"] + depth)))
    assert rest(jp.contact.Liu(), depth, properties) == pytest.approx(force, rel=1e-9)


def test_liu_stiffens_like_hertz_and_ends_as_a_spring():
    law, cr = jp.contact.Liu(), STANDARD.clearance
    assert rest(law, 2e-4 * cr) / rest(law, 1e-4 * cr) == pytest.approx(2**1.5, rel=1e-3)
    assert rest(law, 2e4 * cr) / rest(law, 1e4 * cr) == pytest.approx(2.0, rel=1e-3)
