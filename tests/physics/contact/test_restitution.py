"""The equation between hysteresis factor and restitution, and what each law makes of c_e."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp
from jointplay.physics.contact import NORMAL_LAWS
from jointplay.physics.contact.hertzian import HysteresisLaw, effective_restitution, exact_factor

FAMILY = [law for law in NORMAL_LAWS.values() if issubclass(law, HysteresisLaw)]
GRID = np.linspace(0.02, 1.0, 99)

# The factors as their authors print them.


@given(st.floats(1e-3, 1.0))
def test_exact_factor_and_restitution_are_inverse(e):
    a = exact_factor(e)
    assert effective_restitution(a) == pytest.approx(e, abs=1e-9)
    if 0.1 < e < 0.999:  # below, 1 - a e is lost in rounding
        assert a * (1 + e) == pytest.approx(math.log((1 + a) / (1 - a * e)), rel=1e-9)


def test_small_factors_pass_over_into_their_first_order():
    assert effective_restitution(0.0) == 1.0
    assert exact_factor(1.0) == 0.0
    for a in (0.9e-6, 1.1e-6, 1e-5):  # both sides of where the equation takes over
        assert 1.0 - effective_restitution(a) == pytest.approx(2 * a / 3, rel=2e-3)


@pytest.mark.parametrize("law", FAMILY, ids=lambda law: law.name)
def test_restitution_rises_with_the_nominal_one_and_ends_at_one(law):
    delivered = [law().effective_restitution(float(c)) for c in GRID]
    assert (np.diff(delivered) > 0.0).all()
    if law is jp.contact.GharibHurmuzlu:  # a law for soft impacts, and for no other
        return
    assert delivered[-1] == 1.0
    assert law.factor(1.0) == 0.0


# Where a law is said to be good, within what: c_e from, to, largest error.
CLAIMS = {
    "hunt-crossley-1975": (0.8, 1.0, 0.05),
    "herbert-mcwhannell": (0.7, 1.0, 0.025),
    "lankarani-nikravesh": (0.8, 1.0, 0.05),
    "gonthier": (0.02, 1.0, 0.033),
    "zhang-sharf": (0.02, 1.0, 1e-9),
    "qin-lu": (0.25, 1.0, 0.046),
    "flores": (0.02, 1.0, 0.046),
    "hu-guo": (0.02, 1.0, 0.035),
    "carvalho-martins": (1 / 3, 1.0, 0.003),
}


@pytest.mark.parametrize("name", CLAIMS)
def test_stated_validity_is_true(name):
    low, high, within = CLAIMS[name]
    law = NORMAL_LAWS[name]()
    inside = [float(c) for c in GRID if low <= c <= high]
    assert max(abs(law.effective_restitution(c) - c) for c in inside) <= within


def test_slope_at_the_elastic_end():
    """First order in 1 - c_e: e = 1 - 2 a/3."""
    for name, slope in {
        "lankarani-nikravesh": 1.0,
        "hunt-crossley-1975": 1.0,
        "herbert-mcwhannell": 1.0,
        "hu-guo": 1.0,
        "carvalho-martins": 1.0,
        "qin-lu": 1.0,
        "lee-wang": 0.5,
        "gonthier": 4 / 3,
        "flores": 16 / 15,
    }.items():
        loss = 1.0 - NORMAL_LAWS[name]().effective_restitution(1.0 - 1e-4)
        assert loss == pytest.approx(slope * 1e-4, rel=1e-3), name


def test_general_hunt_crossley_knows_its_restitution_only_where_there_is_one():
    assert jp.contact.HuntCrossley().effective_restitution(0.5) == pytest.approx(
        jp.contact.LankaraniNikravesh().effective_restitution(0.5)
    )
    assert jp.contact.HuntCrossley(2.0, 1.0).effective_restitution(0.5) is None
    assert jp.contact.KelvinVoigt(1.0).effective_restitution(0.5) is None


def test_hu_guo_is_the_balance_of_energies_along_hertz_speeds():
    """The derivation in its docstring, by quadrature; half the factor, as DyS has it, is not."""
    x = np.linspace(0.0, 1.0, 200001)
    taken = np.trapezoid(x**1.5 * np.sqrt(1.0 - x**2.5), x) / (2 / 5)  # over a U, one way
    assert taken == pytest.approx(2 / 3, rel=1e-6)
    for c in (0.2, 0.5, 0.9):
        a = jp.contact.HuGuo.factor(c)
        assert (1 - a * c * taken) / (1 + a * taken) == pytest.approx(c**2, rel=1e-5)
        half = a / 2
        assert (1 - half * c * taken) / (1 + half * taken) > 1.1 * c**2


def test_carvalho_martins_meets_gonthier_where_exudyn_changes_over():
    assert jp.contact.CarvalhoMartins.factor(1 / 3) == pytest.approx(
        jp.contact.Gonthier.factor(1 / 3), rel=1e-12
    )


def test_gharib_hurmuzlu_is_the_soft_limit_of_the_exact_factor():
    law = jp.contact.GharibHurmuzlu()
    for c in (1e-3, 1e-2, 0.1):
        assert law.factor(c) == pytest.approx(exact_factor(c), rel=0.02)
    inside = [float(c) for c in GRID if c <= 0.33]
    assert max(abs(law.effective_restitution(c) - c) for c in inside) <= 0.03
    assert law.effective_restitution(1.0) == pytest.approx(0.5936, abs=1e-4)


def test_anagnostopoulos_is_a_spring_and_a_dashpot():
    law = jp.contact.Anagnostopoulos(2.0, 1e8)
    p = law.parameters(jp.RevoluteClearance.planar(radial_clearance=1e-4).contact_properties(0))
    assert law.function(1e-5, 0.2, 1.0, *p) == pytest.approx(p[0] * 1e-5 + p[1] * 0.2, rel=1e-12)
    damping = -2.0 * math.log(0.9) / math.hypot(math.pi, math.log(0.9)) * math.sqrt(2.0 * 1e8)
    assert p == pytest.approx((1e8, damping))  # restitution is 0.9 if none is given


def test_a_dashpot_that_never_pulls_gives_back_less_than_asked():
    """exp(-2 phi cot phi) of the damping ratio -ln(c)/sqrt(pi^2 + ln^2 c)."""
    for c in (0.3, 0.5, 0.9):
        zeta = -math.log(c) / math.hypot(math.pi, math.log(c))
        phi = math.acos(zeta)
        expected = math.exp(-2 * phi / math.tan(phi))
        assert jp.contact.Anagnostopoulos(2.0).effective_restitution(c) == pytest.approx(expected)


def test_linear_spring_stores_hertz_energy_at_ten_micrometres():
    contact = jp.RevoluteClearance.planar(radial_clearance=1e-4).contact_properties(0)
    k, *_ = jp.contact.LinearSpring().parameters(contact)
    assert jp.contact.LinearSpring().effective_restitution(0.5) == 1.0
    assert k * 1e-5**2 / 2 == pytest.approx(0.4 * contact.stiffness * 1e-5**2.5, rel=1e-12)
