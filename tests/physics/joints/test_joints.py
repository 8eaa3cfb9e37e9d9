"""Dimensions and stiffness of a clearance joint."""

import dataclasses
import math

import pytest

from jointplay import (
    BallBearing,
    CrossedRollerBearing,
    JointplayError,
    Material,
    Mechanism,
    PrismaticClearance,
    RevoluteClearance,
    SphericalClearance,
)
from jointplay.base.schema import read
from jointplay.physics.contact import CustomFriction, Hertz, LuGre
from jointplay.physics.joints import Clearance, RoundClearance, SlidingClearance


def test_clearances_give_the_journal():
    joint = RevoluteClearance(radial_clearance=0.2e-3, axial_clearance=0.5e-3)
    assert joint.rj == pytest.approx(9.8e-3)
    assert joint.lj == pytest.approx(39e-3)


def test_journal_gives_the_clearances():
    joint = RevoluteClearance(journal_radius=9.8e-3, journal_length=39e-3)
    assert joint.cr == pytest.approx(0.2e-3)
    assert joint.ca == pytest.approx(0.5e-3)


def test_both_may_be_given_if_they_agree():
    RevoluteClearance(radial_clearance=2e-4, journal_radius=9.8e-3, axial_clearance=2e-4)


def test_stiffness_follows_equations_11_to_13():
    joint = RevoluteClearance(radial_clearance=0.2e-3, axial_clearance=0.2e-3)
    sigma = (1 - 0.3**2) / (math.pi * 207e9)
    radius = 10e-3 * 9.8e-3 / 0.2e-3
    by_hand = 4 / (3 * math.pi * 2 * sigma) * math.sqrt(radius)
    assert joint.hertz_stiffness == pytest.approx(by_hand, rel=1e-12)
    assert joint.hertz_stiffness == pytest.approx(1.0615e11, rel=1e-4)
    assert joint.axial_contact.stiffness == joint.hertz_stiffness


def test_materials_are_in_series():
    soft = RevoluteClearance(
        radial_clearance=2e-4, axial_clearance=2e-4, journal_material=Material(3e9, 0.4)
    )
    sigma = (1 - 0.3**2) / (math.pi * 207e9) + (1 - 0.4**2) / (math.pi * 3e9)
    by_hand = 4 / (3 * math.pi * sigma) * math.sqrt(10e-3 * 9.8e-3 / 2e-4)
    assert soft.hertz_stiffness == pytest.approx(by_hand)


def test_given_stiffnesses_win():
    joint = RevoluteClearance(
        radial_clearance=2e-4, axial_clearance=2e-4, stiffness=1e10, axial_stiffness=2e10
    )
    assert joint.radial_contact.stiffness == 1e10
    assert joint.axial_contact.stiffness == 2e10


GOOD = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
BAD = [
    ({"radial_clearance": -1e-4}, "-0.1 mm"),
    ({"axial_clearance": float("nan")}, "nan"),
    ({"radial_clearance": float("inf")}, "inf"),
    ({"radial_clearance": "wide"}, '"wide" is not a length'),
    ({"radial_clearance": None}, "give the radial clearance or the journal radius"),
    ({"radial_clearance": 11e-3}, "11 mm leaves no room for a journal"),
    ({"journal_radius": 12e-3}, "12 mm does not fit into the bearing's 10 mm"),
    ({"journal_length": 41e-3}, "41 mm does not fit into the bearing's 40 mm"),
    ({"journal_radius": 9.7e-3}, "0.2 mm contradicts the dimensions"),
    ({"bearing_radius": 0.0}, "bearing radius"),
    ({"restitution": 0.0}, "has no plastic impact (at 0 it springs back with 0.66)"),
    ({"restitution": -0.1}, "[0, 1], got -0.1"),
    ({"restitution": 1.01}, "[0, 1], got 1.01"),
    ({"stiffness": -1.0}, "stiffness"),
    ({"bearing_length": 2e-3}, "too short"),
    ({"normal": "hertzian"}, 'no normal-force law "hertzian"; did you mean "hertz"'),
    ({"friction": -0.1}, "friction coefficient must not be negative"),
]


@pytest.mark.parametrize(("change", "named"), BAD)
def test_impossible_joints_are_refused_by_value(change, named):
    with pytest.raises(JointplayError) as caught:
        RevoluteClearance(**(GOOD | change))
    assert named in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_clearance_of_zero_is_an_ideal_joint():
    for joint in (
        RevoluteClearance(radial_clearance=0.0, axial_clearance=2e-4),
        RevoluteClearance(radial_clearance="0 mm", axial_clearance=0),
        SphericalClearance(radial_clearance=0.0),
        PrismaticClearance(clearance=0.0),
    ):
        assert joint.ideal
        assert read(Clearance, joint.describe()) == joint
    assert not Mechanism("scara", {"joint_b": RevoluteClearance(radial_clearance=0.0)}).clearance


def test_a_clearance_of_zero_in_one_direction_locks_that_direction():
    journal = RevoluteClearance(radial_clearance=2e-4, axial_clearance=0.0)
    assert journal.lock_axial
    assert not journal.ideal
    assert journal == RevoluteClearance(radial_clearance=2e-4, lock_axial=True)
    slider = PrismaticClearance(clearance=2e-4, clearance_y=0.0)
    assert slider.planar
    assert not slider.ideal
    for joint in (journal, slider):
        assert read(Clearance, joint.describe()) == joint


@pytest.mark.parametrize("fields", [{"young": -1.0}, {"poisson": 0.7}, {"young": float("nan")}])
def test_impossible_materials_are_refused(fields):
    with pytest.raises(JointplayError):
        Material(**fields)


def test_description_round_trip_is_exact():
    joint = RevoluteClearance(
        radial_clearance=0.3e-3,
        journal_length=39.1e-3,
        restitution=0.7,
        normal=Hertz(),
        journal_material=Material(110e9, 0.34),
    )
    again = RevoluteClearance.from_description(joint.describe())
    assert again.describe() == joint.describe()
    assert again.hertz_stiffness == joint.hertz_stiffness


KINDS = {
    "revolute": RevoluteClearance(radial_clearance=2e-4, axial_clearance=3e-4),
    "by its journal": RevoluteClearance(journal_radius=9.8e-3, journal_length=39.4e-3),
    "planar": RevoluteClearance.planar(radial_clearance=2e-4),
    "ball": SphericalClearance(radial_clearance=2e-4),
    "slider": PrismaticClearance(clearance=2e-4, clearance_y=3e-4),
    "planar slider": PrismaticClearance(clearance=2e-4, planar=True),
    "deep groove": BallBearing(designation="6010/C3"),
    "angular contact pair": BallBearing(designation="7206 B DB", radial_clearance=5e-6),
    "crossed rollers": CrossedRollerBearing(designation="RB5013"),
}


@pytest.mark.parametrize("joint", KINDS.values(), ids=KINDS)
def test_every_kind_names_its_clearances_and_takes_others_in_the_same_bearing(joint):
    given = joint.clearances
    assert set(given) <= {field.name for field in dataclasses.fields(joint)}
    assert joint.with_clearances(given).clearances == pytest.approx(given)
    for name in given:
        wider = joint.with_clearances({name: 2.5 * given[name]})
        assert wider.clearances == pytest.approx(given | {name: 2.5 * given[name]})
    halved = joint.scaled(0.5)
    assert halved.clearances == pytest.approx({name: 0.5 * c for name, c in given.items()})
    assert halved.half_width == joint.half_width


def test_a_kind_must_say_how_it_touches_and_what_it_looks_like_only():
    whole = {"contacts", "contact_properties", "outline"}
    assert SlidingClearance.__abstractmethods__ == whole
    assert Clearance.__abstractmethods__ == whole | {"shape", "dimensions"}
    assert RoundClearance.__abstractmethods__ == {"contacts", "outline"}


def test_laws_of_friction_are_scaled_in_all_their_coefficients():
    rough = LuGre(mu_d=0.2, mu_s=0.3).scaled(1.5)
    assert rough.coefficients == pytest.approx({"mu_d": 0.3, "mu_s": 0.45})
    assert rough.sigma0 == LuGre().sigma0
    own = CustomFriction(lambda speed: 0.1)
    assert own.coefficients == {}
    assert own.scaled(2.0) is own
