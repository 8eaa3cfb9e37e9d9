"""Materials, wear pairs and oils by name."""

import itertools
import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

import jointplay as jp
from jointplay import JointplayError
from jointplay.base.errors import MissingName
from jointplay.physics.joints.materials import (
    Oil,
    material,
    materials,
    oil,
    oils,
    source,
    wear_pair,
    wear_pairs,
)


@pytest.mark.parametrize("name", materials())
def test_every_material_is_possible_and_has_a_source(name):
    found = material(name)
    assert found.name == name
    assert 1e8 < found.young < 1e12
    assert 0.2 < found.poisson < 0.5
    assert found.density is None or 900 < found.density < 1e4
    assert found.yield_strength is None or 1e-3 < found.yield_strength / found.young < 0.05
    assert source(name)
    joint = jp.RevoluteClearance(
        radial_clearance=2e-4, axial_clearance=2e-4, journal_material=found
    )
    assert jp.RevoluteClearance.from_description(joint.describe()).describe() == joint.describe()


def test_the_paper_steel_is_the_default():
    assert material("paper-steel").compliance == jp.Material().compliance
    assert material("carbon-steel").wave_speed == pytest.approx(5151, abs=1)


def test_everyday_words_and_spellings():
    assert jp.material("steel") == jp.material("Carbon Steel") == jp.material("carbon_steel")
    assert jp.material("bronze").name == "phosphor-bronze"
    assert source("nylon") == source("pa66")
    assert jp.oil("ISO VG 46") == jp.oil("iso-vg-46")


def test_metals_are_in_the_right_order():
    stiffness = [material(name).young for name in ("peek", "aluminium", "brass", "carbon-steel")]
    assert stiffness == sorted(stiffness)


def test_a_viscosity_grade_is_its_own_definition():
    for grade in (10, 46, 460):
        found = oil(f"iso-vg-{grade}")
        assert found.kinematic_viscosity(40.0) == pytest.approx(grade * 1e-6)
        assert found.viscosity(40.0) == pytest.approx(grade * 1e-6 * 870.0)
    # Each grade is half as viscous again as the one below it, but for rounding.
    nu = [oil(name).kinematic_40 for name in oils()]
    assert all(1.4 < high / low < 1.56 for low, high in itertools.pairwise(nu))


@pytest.mark.parametrize("name", oils())
def test_oils_follow_walther_between_their_two_temperatures(name):
    """ASTM D341: log10 log10(nu + 0.7) = A - B log10 T, nu in mm^2/s."""
    found = oil(name)
    assert found.kinematic_viscosity(100.0) == pytest.approx(found.kinematic_100, rel=1e-12)

    def level(nu):
        return math.log10(math.log10(1e6 * nu + 0.7))

    b = (level(found.kinematic_40) - level(found.kinematic_100)) / math.log10(373.15 / 313.15)
    assert 3.0 < b < 4.5  # of mineral oils
    a = level(found.kinematic_40) + b * math.log10(313.15)
    for celsius in (0.0, 20.0, 70.0):
        nu = 1e-6 * (10 ** (10 ** (a - b * math.log10(celsius + 273.15))) - 0.7)
        assert found.kinematic_viscosity(celsius) == pytest.approx(nu, rel=1e-9)
        assert found.viscosity(celsius) == pytest.approx(nu * found.density(celsius), rel=1e-9)


def test_viscosity_index_of_the_grades_in_between():
    """ASTM D2270: VI = 100 (L - U)/(L - H), and its table at whole viscosities at 100 C."""
    table = {4.0: (25.32, 19.56), 6.0: (57.97, 38.19), 8.0: (100.0, 59.60), 10.0: (147.7, 82.87)}
    points = sorted(
        (oil(name).kinematic_100 * 1e6, oil(name).kinematic_40 * 1e6) for name in oils()
    )
    for hot, (loose, high) in table.items():
        (y0, u0), (y1, u1) = next(
            pair for pair in itertools.pairwise(points) if pair[0][0] <= hot <= pair[1][0]
        )
        share = math.log(hot / y0) / math.log(y1 / y0)
        u = u0 * (u1 / u0) ** share
        assert 100 * (loose - u) / (loose - high) == pytest.approx(95, abs=2.5)


@given(st.floats(-10.0, 100.0), st.floats(-10.0, 100.0))
def test_oil_thins_when_heated(one, other):
    cold, hot = sorted((one, other))
    found = oil("iso-vg-46")
    assert found.viscosity(cold) >= found.viscosity(hot) > 0.0
    assert found.density(cold) >= found.density(hot) > 0.0


@pytest.mark.parametrize(
    ("ask", "named"),
    [
        (lambda: oil("iso-vg-10").viscosity(150.0), "'iso-vg-10' at 150 C is out of the range"),
        (lambda: oil("iso-vg-10").viscosity(-272.0), "at -272 C is out of the range"),
        (lambda: oil("iso-vg-10").viscosity(-300.0), "above -273.15 C, got -300 C"),
        (lambda: oil("iso-vg-10").viscosity(math.nan), "temperature"),
        (lambda: Oil("tar", 1e-5, 2e-5), "'tar' must be thinner at 100 C than at 40 C"),
        (lambda: Oil("tar", 1e-5, -1.0), "kinematic viscosity at 100 C"),
    ],
)
def test_impossible_oils_and_temperatures_are_refused(ask, named):
    with pytest.raises(JointplayError) as caught:
        ask()
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_archard_coefficients():
    """k = K/H, 3.8e-12 m^3/(N m) for steel on steel."""
    steel = wear_pair("low-carbon-steel", "low-carbon-steel")
    assert steel.specific == pytest.approx(3.8e-12, rel=0.02)
    assert wear_pair("PTFE", "tool steel").specific == pytest.approx(5.0e-13, rel=0.02)
    for pair in wear_pairs():
        found = wear_pair(*pair)
        assert 1e-8 < found.coefficient < 1e-2
        assert 1e-16 < found.specific < 1e-11


@pytest.mark.parametrize(
    ("ask", "named"),
    [
        (lambda: material("steal"), "no material 'steal'; did you mean \"steel\"? available: "),
        (lambda: source("steal"), "no material 'steal'"),
        (lambda: oil("iso-vg-7"), "no oil 'iso-vg-7'; did you mean \"iso-vg-"),
        (lambda: wear_pair("ptfe", "brass"), "no pair 'ptfe on brass'; available: low-carbon-"),
    ],
)
def test_unknown_names_list_the_known(ask, named):
    with pytest.raises(MissingName) as caught:
        ask()
    assert named in str(caught.value)


@pytest.mark.parametrize("field", ["density", "yield_strength"])
def test_impossible_constants_are_refused(field):
    with pytest.raises(JointplayError, match="greater than zero"):
        jp.Material(**{field: 0.0})
