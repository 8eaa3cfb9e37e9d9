"""Friction laws against their formulas."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp
from jointplay import JointplayError
from jointplay.physics.contact import FRICTION_LAWS

ALL = pytest.mark.parametrize(
    "law", [law() for law in FRICTION_LAWS.values() if not law.bristles], ids=lambda x: x.name
)


def mu(law, speed):
    return law.function(speed, *law.parameters())


@ALL
@given(speed=st.floats(0.0, 100.0), change=st.floats(-1e-9, 1e-9))
def test_coefficient_is_never_negative_never_above_its_largest_and_continuous(law, speed, change):
    largest = max(getattr(law, "mu_s", 0.0), law.mu_d)
    here = mu(law, speed)
    assert 0.0 <= here <= 1.01 * largest
    beside = mu(law, max(speed + change, 0.0))
    assert abs(beside - here) < 1e-6  # the steepest, 500 s/m, over 1e-9 m/s


@ALL
def test_no_force_at_rest_and_dynamic_friction_when_fast(law):
    assert mu(law, 0.0) == 0.0
    plateau = 1 - math.exp(-3) if law.name == "threlfall" else 1.0
    assert mu(law, 1.0) == pytest.approx(plateau * law.mu_d, rel=1e-5)


def test_coulomb_is_a_ramp_and_a_plateau():
    law = jp.contact.Coulomb(0.2, 1e-3)
    assert mu(law, 0.25e-3) == pytest.approx(0.05)
    assert mu(law, 1e-3) == mu(law, 7.0) == 0.2


def test_threlfall_is_its_formula():
    law = jp.contact.Threlfall(0.2, 2e-3)
    assert mu(law, 1e-3) == pytest.approx(0.2 * (1 - math.exp(-1.5)))
    assert mu(law, 2e-3) == mu(law, 1.0) == pytest.approx(0.2 * 0.950213, rel=1e-5)


def test_bengisu_akay_peaks_at_static_friction_and_falls_at_its_rate():
    law = jp.contact.BengisuAkay(0.3, 0.1, 2e-3, 50.0)
    assert mu(law, 1e-3) == pytest.approx(-0.3 / 2e-3**2 * (1e-3 - 2e-3) ** 2 + 0.3)
    assert mu(law, 2e-3) == pytest.approx(0.3)
    assert mu(law, 22e-3) == pytest.approx(0.1 + 0.2 * math.exp(-1.0))
    speeds = np.linspace(0.0, 0.05, 2001)
    assert speeds[np.argmax([mu(law, float(v)) for v in speeds])] == pytest.approx(2e-3)


def test_brown_mcphee_is_its_formula_and_peaks_near_the_transition_speed():
    law = jp.contact.BrownMcPhee(0.3, 0.1, 2e-3)
    for x in (0.3, 1.0, 2.5):
        printed = 0.1 * math.tanh(4 * x) + 0.2 * x / (0.25 * x**2 + 0.75) ** 2
        assert mu(law, 2e-3 * x) == pytest.approx(printed)
    assert mu(law, 2e-3) == pytest.approx(0.3, rel=1e-3)
    speeds = np.linspace(0.0, 0.01, 2001)
    assert speeds[np.argmax([mu(law, float(v)) for v in speeds])] == pytest.approx(2e-3, rel=0.02)


@pytest.mark.parametrize(
    ("make", "named"),
    [
        (lambda: jp.contact.Coulomb(-0.1), "-0.1"),
        (lambda: jp.contact.Coulomb(0.1, 0.0), "v_t"),
        (lambda: jp.contact.Threlfall(0.1, -1.0), "v_r"),
        (lambda: jp.contact.BengisuAkay(mu_s=0.05, mu_d=0.1), "mu_s must be at least mu_d = 0.1"),
        (lambda: jp.contact.BengisuAkay(xi=0.0), "xi"),
        (lambda: jp.contact.BrownMcPhee(mu_s=math.nan), "mu_s"),
        (lambda: jp.contact.BrownMcPhee(v_t=math.inf), "v_t"),
    ],
)
def test_impossible_friction_is_refused(make, named):
    with pytest.raises(JointplayError, match=named):
        make()


def bristle(law, speed, normal=3.0, dwell=0.0):
    return law.function(speed, normal, dwell, *law.parameters())


@pytest.mark.parametrize("speed", [1e-4, 3e-3, 0.2])
def test_steadily_sliding_bristles_rub_as_their_laws_say(speed):
    """A v = r z: the force is k A v/r + c v, and no more than the cap."""
    lugre = jp.contact.LuGre(0.1, 0.15, 1e-2, 1e5, 10.0, 0.5)
    stribeck = 0.1 + 0.05 * math.exp(-((speed / 1e-2) ** 2))
    for law, expected in ((jp.contact.Dahl(0.2, 3e4), 0.2), (lugre, stribeck + 0.5 * speed)):
        bend, rate, stiff, _, viscous, cap, *dwell = bristle(law, speed)
        assert dwell == [0.0, 0.0]  # no memory of the time at rest
        assert (stiff * bend * speed / rate + viscous * speed) / 3.0 == pytest.approx(expected)
        assert cap == math.inf
    assert bristle(lugre, speed)[3] == pytest.approx(10.0 * 3.0)
    assert bristle(jp.contact.Dahl(), speed)[3] == 0.0


@pytest.mark.parametrize("speed", [0.0, 1e-4, 3e-3])
def test_gonthiers_bristles_stick_and_slide_in_parts(speed):
    law = jp.contact.GonthierFriction(0.1, 0.15, 1e-3, 1e5, 10.0, 0.5, 0.1)
    stick = math.exp(-((speed / 1e-3) ** 2))
    slide = (1 - stick) * 1e5 / 10.0
    bend, rate, stiff, damp, viscous, cap, target, pace = bristle(law, speed, dwell=0.4)
    assert bend == pytest.approx(stick + (slide * 0.1 / 1e5 / speed if speed else 0.0))
    assert rate == pytest.approx(slide)
    assert (stiff, damp, viscous) == pytest.approx((3e5, 30.0, 1.5))
    assert cap == pytest.approx((0.1 + 0.05 * 0.4) * 3.0)
    assert target == pytest.approx(stick)
    assert pace == pytest.approx(10.0 if stick >= 0.4 else 1e4)


@pytest.mark.parametrize("name", ["bengisu-akay", "brown-mcphee", "lugre", "gonthier"])
@pytest.mark.parametrize("mu_d", [0.02, 0.05, 0.3])
def test_static_friction_follows_the_dynamic_one_where_it_is_not_given(name, mu_d):
    law = FRICTION_LAWS[name]
    assert law(mu_d=mu_d).mu_s == pytest.approx(1.5 * mu_d, rel=1e-11)
    assert law(mu_d=mu_d, mu_s=0.4).mu_s == 0.4
    assert law() == law(mu_s=0.15)


DEFAULTS = {
    "Ambrosio": "mu_d=0.1, v0=1e-4, v1=1e-3",
    "BengisuAkay": "mu_s=0.15, mu_d=0.1, v0=1e-3, xi=100.0",
    "BrownMcPhee": "mu_s=0.15, mu_d=0.1, v_t=1e-3",
    "Coulomb": "mu_d=0.1, v_t=1e-3",
    "Dahl": "mu_d=0.1, sigma0=1e5",
    "GonthierFriction": "mu_d=0.1, mu_s=0.15, v_s=1e-3, sigma0=1e5, sigma1=10.0, sigma2=0.0, "
    "dwell_time=0.1",
    "LuGre": "mu_d=0.1, mu_s=0.15, v_s=0.01, sigma0=1e5, sigma1=10.0, sigma2=0.0",
    "Threlfall": "mu_d=0.1, v_r=1e-3",
}
"""What stored scenarios and results mean by a law without numbers."""


@pytest.mark.parametrize("name", DEFAULTS)
def test_laws_without_numbers_mean_what_they_always_meant(name):
    law = getattr(jp.contact, name)
    assert law() == eval(f"law({DEFAULTS[name]})", {"law": law})


def test_lugre_is_passive_from_the_published_bound_on():
    """sigma_2 >= sigma_1 (mu_s - mu_d)/mu_d: here 10 x 0.02/0.4 = 0.5."""
    friction = {"mu_d": 0.4, "mu_s": 0.42, "sigma1": 10.0}
    assert jp.contact.LuGre(**friction, sigma2=0.501).passive
    assert not jp.contact.LuGre(**friction, sigma2=0.499).passive
