"""Film laws against Reynolds' equation integrated here, and the published limits."""

import ctypes
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import brentq

import jointplay as jp
from jointplay.physics.contact import (
    CustomFilm,
    FilmLaw,
    FilmProperties,
    PinkusSternlicht,
    ShortBearing,
)
from jointplay.physics.contact.machine_code import compiled_law

OIL = 0.03
FILM = FilmProperties(clearance=1e-4, radius=10e-3, length=8e-3, contacts=1)
eccentricities = st.floats(1e-3, 0.97)
rates = st.floats(-100.0, 100.0).filter(lambda x: x == 0.0 or abs(x) > 1e-3)


def evaluate(law, eccentricity, rate=0.0, whirl=0.0, spin=0.0, film=FILM):
    """F_r [N], F_t [N], moment [N m] and damping [N s/m]."""
    p = (ctypes.c_double * 8)(*law.parameters(film))
    out = (ctypes.c_double * 4)()
    compiled_law(law).ctypes(eccentricity, rate, whirl, spin, p, out)
    return np.array(out)


def reynolds(eccentricity, rate, whirl, spin, cavitation, film=FILM):
    """F_r and F_t of the short bearing's pressure, by quadrature over the bore [N]."""
    c, radius, length, _ = film
    a = np.linspace(0.0, 2.0 * np.pi, 40001)
    thickness = c * (1.0 - eccentricity * np.cos(a))
    growth = c * (spin / 2 * eccentricity - whirl) * np.sin(a) - c * rate * np.cos(a)
    # d/dz(h^3/(12 mu) dp/dz) = growth, p = 0 at both ends; integrated over z.
    pressure = -OIL * length**3 / thickness**3 * growth
    if cavitation == "gumbel":
        pressure = np.maximum(pressure, 0.0)
    return [-radius * np.trapezoid(pressure * way(a), a) for way in (np.cos, np.sin)]


@pytest.mark.parametrize("cavitation", ["gumbel", "sommerfeld"])
@given(e=eccentricities, rate=rates, whirl=rates, spin=rates)
def test_short_bearing_is_the_integral_of_its_pressure(cavitation, e, rate, whirl, spin):
    found = evaluate(ShortBearing(OIL, cavitation=cavitation), e, rate, whirl, spin)[:2]
    expected = reynolds(e, rate, whirl, spin, cavitation)
    assert found == pytest.approx(expected, rel=1e-5, abs=1e-6 * np.abs(expected).max() + 1e-12)


@pytest.mark.parametrize("law", [ShortBearing(OIL), PinkusSternlicht(OIL)], ids=lambda x: x.name)
@given(e=eccentricities, rate=rates, whirl=rates, spin=rates)
def test_damping_bounds_the_slope_of_the_force(law, e, rate, whirl, spin):
    step = 1e-4
    steepest = 0.0
    for dr, dw in ((step, 0.0), (0.0, step), (step, step), (step, -step)):
        ahead = evaluate(law, e, rate + dr, whirl + dw, spin)[:2]
        behind = evaluate(law, e, rate - dr, whirl - dw, spin)[:2]
        speed = 2.0 * math.hypot(dr, dw) * FILM.clearance
        steepest = max(steepest, np.linalg.norm(ahead - behind) / speed)
    assert steepest <= 1.05 * evaluate(law, e, rate, whirl, spin)[3]


@pytest.mark.parametrize("law", [ShortBearing(OIL), PinkusSternlicht(OIL)], ids=lambda x: x.name)
@pytest.mark.parametrize("e", [1e-3, 0.1, 0.3, 0.5, 0.7, 0.9, 0.97])
def test_damping_is_near_the_slope_where_the_film_is_squeezed(law, e):
    """A bound that is far too high would be one as well: it is twice the slope at most."""
    step, rate = 1e-4, 5.0
    ends = [evaluate(law, e, rate + way * step)[:2] for way in (1.0, -1.0)]
    slope = np.linalg.norm(ends[0] - ends[1]) / (2.0 * step * FILM.clearance)
    assert 1.0 <= evaluate(law, e, rate)[3] / slope <= 2.05


@given(e=eccentricities)
def test_turning_steadily_is_ocvirk(e):
    along, across, moment, _ = evaluate(ShortBearing(OIL), e, spin=50.0)
    c, radius, length, _ = FILM
    load = OIL * 50.0 * radius * length**3 * e / (4 * c * c) / (1 - e * e) ** 2
    load *= math.sqrt(16 * e * e + math.pi**2 * (1 - e * e))
    assert math.hypot(along, across) == pytest.approx(load, rel=1e-9)
    assert across / -along == pytest.approx(math.pi * math.sqrt(1 - e * e) / (4 * e), rel=1e-9)
    # Petroff's moment, and half the couple of journal against bearing.
    petroff = 2 * math.pi * OIL * 50.0 * length * radius**3 / c
    expected = -petroff / math.sqrt(1 - e * e) - e * c * across / 2
    assert moment == pytest.approx(expected, rel=1e-9)


@given(e=eccentricities)
def test_long_bearing_turning_steadily_is_half_sommerfeld(e):
    """Its pressure 6 mu w (R/c)^2 e sin(2 + e cos)/((2 + e^2)(1 + e cos)^2), where positive."""
    a = np.linspace(0.0, np.pi, 40001)  # from the thickest film to the thinnest
    pressure = e * np.sin(a) * (2 + e * np.cos(a))
    pressure = pressure / ((2 + e * e) * (1 + e * np.cos(a)) ** 2)
    c, radius, length, _ = FILM
    size = 6 * OIL * 50.0 * (radius / c) ** 2 * radius * length
    expected = [size * np.trapezoid(pressure * way(a), a) for way in (np.cos, np.sin)]
    found = evaluate(PinkusSternlicht(OIL), e, spin=50.0)[:2]
    assert found == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_long_bearing_squeezed_between_its_limits(sign):
    """Half of the film, 6 pi, where centred; all of it, 12 pi, where it nearly touches."""
    c, radius, length, _ = FILM
    size = OIL * length * radius**3 / c**2 * 10.0
    law = PinkusSternlicht(OIL)
    assert evaluate(law, 1e-5, sign * 10.0)[0] == pytest.approx(-sign * 6 * math.pi * size, 1e-3)
    near = 1 - 1e-7
    full = 12 * math.pi * size / (1 - near**2) ** 1.5
    if sign > 0:
        assert evaluate(law, near, 10.0)[0] == pytest.approx(-full, rel=2e-3)
    else:
        assert 0.0 < evaluate(law, near, -10.0)[0] < 1e-3 * full


@given(e=eccentricities, rate=rates, whirl=rates, spin=rates)
def test_a_film_takes_energy(e, rate, whirl, spin):
    """Its power on journal and bearing together is never positive; with both conditions."""
    for law in (ShortBearing(OIL), ShortBearing(OIL, cavitation="sommerfeld")):
        along, across, moment, _ = evaluate(law, e, rate, whirl, spin)
        given_ = FILM.clearance * (along * rate + across * whirl) + moment * spin
        assert given_ <= 1e-9 * abs(moment * spin) + 1e-15


def _bend(eccentricity, rate, whirl, spin, p, out):
    out[0] = -p[4] * eccentricity - p[5] * rate
    out[1] = -p[5] * whirl
    out[2] = 0.0
    out[3] = p[5] / p[0]


def test_laws_are_described_and_built_again():
    custom = CustomFilm(_bend, (3.0, 0.2), viscosity=0.1)
    for law in (
        ShortBearing(0.02, hybrid=False, cavitation="sommerfeld"),
        PinkusSternlicht(0.02, least_thickness=2e-6),
        custom,
    ):
        again = FilmLaw.from_description(law.describe())
        assert again.describe() == law.describe()
        assert again.parameters(FILM) == law.parameters(FILM)
        assert pickle.loads(pickle.dumps(law)).describe() == law.describe()
    assert evaluate(custom, 0.5, rate=2.0)[0] == pytest.approx(-1.5 - 0.4)


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: ShortBearing(0.0), "viscosity"),
        (lambda: ShortBearing(0.1, cavitation="reynolds"), "gumbel, sommerfeld"),
        (lambda: PinkusSternlicht(0.1, transition=-1.0), "transition"),
        (lambda: CustomFilm(lambda e, p: None), "must take"),
        (lambda: CustomFilm(_bend, (1.0,) * 5), "at most"),
        (lambda: FilmLaw.from_description({"law": "grease"}), "pinkus-sternlicht"),
        (
            lambda: jp.RevoluteClearance.planar(radial_clearance=1e-6, lubricant=ShortBearing(0.1)),
            "least film thickness",
        ),
        (lambda: jp.RevoluteClearance.planar(radial_clearance=1e-4, lubricant=0.1), "film law"),
    ],
)
def test_wrong_values_are_named(make, text):
    with pytest.raises(jp.JointplayError, match=text) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_published_values_of_the_short_bearing():
    """Ocvirk's load and attitude at e = 0.5, and the bearing that carries 1 kN at 3000 rpm."""
    film = FilmProperties(clearance=1e-4, radius=50e-3, length=25e-3, contacts=1)
    law, spin = ShortBearing(0.02), 3000 * 2 * math.pi / 60

    def load(e):
        along, across, *_ = evaluate(law, e, spin=spin, film=film)
        return math.hypot(along, across), math.degrees(math.atan2(across, -along))

    force, attitude = load(0.5)
    unit = 0.02 * spin * 50e-3 * 25e-3**3 / 1e-4**2
    assert force / unit == pytest.approx(0.750381081812, rel=1e-11)
    assert attitude == pytest.approx(53.68020060, rel=1e-9)
    e = brentq(lambda e: load(e)[0] - 1000.0, 0.1, 0.95, xtol=1e-13)
    assert e == pytest.approx(0.6757879254, rel=1e-9)
    assert load(e)[1] == pytest.approx(40.58502207, rel=1e-8)
    assert 1e-4 * (1 - e) == pytest.approx(32.421207e-6, rel=1e-7)


@given(e=st.floats(0.01, 0.95), rate=rates, whirl=rates, spin=rates)
def test_long_bearing_is_the_printed_formula(e, rate, whirl, spin):
    """In the printed symbols: s, k, and F_r, F_t, the moment, as in the class."""
    if abs(spin - 2 * whirl / e) < 1e-3:
        return
    c, radius, length, _ = FILM
    size = OIL * length * radius**3 / c**2
    turn = spin - 2 * whirl / e
    k = math.sqrt((1 - e**2) * ((turn / (2 * rate)) ** 2 + 1 / e**2)) if rate else math.inf
    s = 1.0 if rate == 0.0 else (k + 3) / (k + 1.5) if rate > 0.0 else k / (k + 1.5)
    squeeze = 4 * e**2 * (k * abs(rate) if rate else math.sqrt(1 - e**2) * abs(turn) / 2)
    wide = 2 + e**2
    along = -size * 6 / (wide * (1 - e**2) ** 1.5) * (squeeze + wide * math.pi * rate) * s
    across = size * 6 * math.pi * e * turn / (wide * math.sqrt(1 - e**2)) * s
    shear = 2 * math.pi * OIL * spin * length * radius**3 / (c * math.sqrt(1 - e**2))
    found = evaluate(PinkusSternlicht(OIL), e, rate, whirl, spin)
    scale = abs(along) + abs(across)
    assert found[:2] == pytest.approx([along, across], rel=1e-6, abs=1e-9 * scale)
    assert found[2] == pytest.approx(-shear - e * c * across / 2, rel=1e-6, abs=1e-12)


def test_sections_are_the_radius_of_gyration_of_the_axial_pressure():
    """Two Gauss points have the second moment of the pressure along the axis, over the length."""
    z = np.linspace(-0.5, 0.5, 20001)
    parabola, even = 0.25 - z**2, np.ones_like(z)
    for law, pressure in ((ShortBearing(OIL), parabola), (PinkusSternlicht(OIL), even)):
        gyration = np.trapezoid(pressure * z**2, z) / np.trapezoid(pressure, z)
        assert law.section == pytest.approx(math.sqrt(gyration), rel=1e-6)
    assert ShortBearing.slenderness == (0.0, 0.5)
    assert PinkusSternlicht.slenderness == (2.0, math.inf)
