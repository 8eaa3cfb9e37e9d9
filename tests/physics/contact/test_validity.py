"""Warnings of runs that left a law's range."""

import dataclasses
import math

import pytest

import jointplay as jp
from jointplay import JointplayError
from jointplay.physics.contact import NORMAL_LAWS

PLAY = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}
GENTLE = {"max_depth": 5e-6, "max_speed": 1e-3}


def joint(c_e=0.9, **material):
    steel = jp.Material(**({"density": 7800.0} | material))
    return jp.RevoluteClearance(
        **PLAY, restitution=c_e, bearing_material=steel, journal_material=steel
    )


@pytest.mark.parametrize("name", NORMAL_LAWS)
def test_a_gentle_run_is_not_warned_of_and_a_silent_joint_not_checked(name):
    needed = {"kelvin-voigt": (1.0,), "anagnostopoulos": (2.0,)}
    if name == "gharib-hurmuzlu":  # for soft impacts only: it warns of c_e = 0.95, and should
        assert (
            "delivers"
            in jp.contact.GharibHurmuzlu().warnings(joint(0.95).radial_contact, **GENTLE)[0]
        )
        return
    law = NORMAL_LAWS[name](*needed.get(name, ()))
    for contact in (joint(0.95).radial_contact, joint(0.95).axial_contact):
        assert law.warnings(contact, **GENTLE) == []
        assert law.warnings(contact, max_depth=0.0, max_speed=0.0) == []
    unknown = jp.RevoluteClearance(**PLAY, restitution=0.95).radial_contact  # no density, no yield
    assert law.warnings(unknown, max_depth=5e-6, max_speed=10.0) == []


def test_restitution_that_is_not_delivered():
    law = jp.contact.LankaraniNikravesh()
    assert law.warnings(joint(0.8).radial_contact, **GENTLE) == []
    (line,) = law.warnings(joint(0.5).radial_contact, **GENTLE)
    assert "delivers a restitution of 0.725 instead of the nominal 0.5" in line
    assert jp.contact.ZhangSharf().warnings(joint(0.5).radial_contact, **GENTLE) == []
    assert jp.contact.Hertz().warnings(joint(0.5).radial_contact, **GENTLE) == []
    (line,) = jp.contact.Anagnostopoulos(2.0).warnings(joint(0.3).radial_contact, **GENTLE)
    assert "delivers" in line


def test_speed_of_waves():
    limit = 1e-5 * math.sqrt(207e9 / 7800.0)  # 0.05 m/s for steel
    contact = joint().radial_contact
    assert jp.contact.Hertz().warnings(contact, max_depth=1e-6, max_speed=0.99 * limit) == []
    (line,) = jp.contact.Hertz().warnings(contact, max_depth=1e-6, max_speed=1.01 * limit)
    assert "quasi-static" in line
    assert "0.0515 m/s" in line


def test_the_faster_waves_of_both_bodies_count():
    """As Lankarani and Nikravesh (1990) have it; and nothing counts if one is not known."""
    hard, soft = jp.material("steel"), jp.material("pom")
    for pair in ((hard, soft), (soft, hard)):
        both = jp.RevoluteClearance(**PLAY, bearing_material=pair[0], journal_material=pair[1])
        assert both.radial_contact.wave_speed == hard.wave_speed > 3 * soft.wave_speed
    unknown = jp.RevoluteClearance(**PLAY, bearing_material=hard)
    assert unknown.radial_contact.wave_speed == math.inf


def test_contact_grown_out_of_its_theory():
    contact = joint().radial_contact
    edge = (0.3 * contact.journal_radius) ** 2 / contact.radius
    for law, at in ((jp.contact.Hertz(), contact), (jp.contact.Johnson(), joint().axial_contact)):
        assert law.warnings(at, max_depth=0.99 * edge, max_speed=0.0) == []
        (line,) = law.warnings(at, max_depth=1.01 * edge, max_speed=0.0)
        assert "assumes a small contact" in line


def test_line_contact_warns_where_its_formula_ends():
    contact = joint().radial_contact
    for law, limit in ((jp.contact.Johnson(), 0.3983), (jp.contact.Radzimovsky(), 0.5245)):
        depth = limit * contact.clearance
        below, above = (
            law.warnings(contact, max_depth=factor * depth, max_speed=0.0)
            for factor in (0.999, 1.001)
        )
        assert not any("tangent" in line for line in below)
        assert any("tangent" in line for line in above)


def test_yield_of_points_and_lines():
    """Johnson (1985): the peak pressure at first yield is 1.60 Y of a point, 1.79 Y of a line."""
    contact = joint(yield_strength=400e6).radial_contact
    point = contact.radius * (1.60 * 400e6 * math.pi / (2 * contact.modulus)) ** 2
    force = math.pi * contact.radius * (1.79 * 400e6) ** 2 / contact.modulus
    line = jp.contact.Johnson().depth(force * contact.contact_length, contact)
    for law, depth in ((jp.contact.Hertz(), point), (jp.contact.Johnson(), line)):
        below, above = (
            law.warnings(contact, max_depth=factor * depth, max_speed=0.0)
            for factor in (0.999, 1.001)
        )
        assert not any("yield" in text for text in below), law
        assert any("yield" in text for text in above), law


@pytest.mark.parametrize("name", NORMAL_LAWS)
def test_warnings_are_single_lines_that_begin_with_the_law(name):
    needed = {"kelvin-voigt": (1.0,), "anagnostopoulos": (2.0,)}
    law = NORMAL_LAWS[name](*needed.get(name, ()))
    hard = joint(0.2, yield_strength=1e6)
    for contact in (hard.radial_contact, hard.axial_contact):
        found = law.warnings(contact, max_depth=1e-3, max_speed=5.0)
        assert found
        for line in found:
            assert line.startswith(f"{name} ")
            assert "\n" not in line


def test_contacts_of_other_joints_have_their_radius():
    ball = jp.SphericalClearance(radial_clearance=2e-4)
    socket = ball.contact_properties(0)
    assert socket.radius == pytest.approx(ball.bearing_radius * ball.rj / ball.cr)
    slider = jp.PrismaticClearance(clearance=1e-4, corner_radius=2e-3)
    corner = slider.contact_properties(0)
    assert corner.radius == corner.journal_radius == 2e-3
    for contact in (socket, corner):
        assert contact.stiffness == pytest.approx(
            4 / 3 * contact.modulus * math.sqrt(contact.radius)
        )
        assert contact.contact_length == 0.0


def test_a_parallel_journal_touches_with_its_whole_length():
    tilting, planar = (
        jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4),
        jp.RevoluteClearance.planar(radial_clearance=2e-4, journal_length=39.6e-3),
    )
    assert tilting.contact_properties(0).contact_length == tilting.lj / 2
    assert planar.contact_properties(0).contact_length == planar.lj


@pytest.mark.parametrize(
    "law", [jp.contact.Johnson(), jp.contact.Pereira()], ids=lambda law: law.name
)
def test_joints_without_a_bore_refuse_laws_of_cylinders(law):
    for make in (
        lambda: jp.SphericalClearance(radial_clearance=2e-4, normal=law),
        lambda: jp.PrismaticClearance(clearance=1e-4, normal=law),
    ):
        with pytest.raises(JointplayError, match=f"'{law.name}' is for a cylinder in a bore"):
            make()


# In a run: the audit asks the laws what its extremes mean.


def hit(free_mass, **bearing):
    """Let a body hit the end wall at 0.2 m/s; it touches nothing else."""
    return free_mass(
        offset=(0, 0, 1.99e-4, 0, 0, 0), velocity=(0, 0, 0.2, 0, 0, 0), **bearing
    ).finish()


def steel(**known):
    material = dataclasses.replace(jp.Material(), **known)
    return {"bearing_material": material, "journal_material": material}


def test_a_run_within_the_range_is_silent(free_mass):
    assert hit(free_mass).audit.law_warnings == ()
    fine = hit(free_mass, **steel(density=0.05 * 7800.0, yield_strength=5e9))
    assert fine.audit.law_warnings == ()


def test_a_run_too_fast_for_a_quasi_static_law_says_so(free_mass, tmp_path):
    result = hit(free_mass, **steel(density=7800.0))
    (line,) = result.audit.law_warnings
    assert line.startswith("joint 'pin': lankarani-nikravesh is quasi-static: an approach at 0.2 m")
    assert line in result.audit.warnings
    assert f"warning: {line}" in str(result.audit)
    result.save(tmp_path / "run.nc")
    assert jp.Result.load(tmp_path / "run.nc").audit == result.audit


def test_the_fastest_approach_counts_whether_or_not_its_contact_has_ended(free_mass):
    lasting = free_mass(
        offset=(0, 0, 1.99e-4, 0, 0, 0), velocity=(0, 0, 0.2, 0, 0, 0), duration=5e-5
    )
    again = free_mass(velocity=(0, 0, 0.2, 0, 0, 0), restitution=0.5, duration=8e-3)
    for run, impacts in ((lasting, 1), (again, 2)):
        audit = run.finish().audit
        assert audit.impacts >= impacts
        found = run.workspace.contact_statistics()["fastest_approach"]
        assert found[0, 2:].max() == pytest.approx(0.2, rel=1e-3)
        assert found[0, :2].max() == 0.0


def test_yield_is_judged_by_the_deepest_penetration(free_mass):
    depth = hit(free_mass).audit.largest_penetration
    contact = joint().axial_contact
    pressure = 2 * contact.modulus / math.pi * math.sqrt(depth / contact.radius)
    for factor, said in ((1.01, 0), (0.99, 1)):
        audit = hit(free_mass, **steel(yield_strength=factor * pressure / 1.60)).audit
        assert sum("yield strength" in line for line in audit.law_warnings) == said


def test_restitution_out_of_reach_is_said_once_and_only_of_joints_that_touched(free_mass):
    (line,) = hit(free_mass, restitution=0.4).audit.law_warnings
    assert "instead of the nominal 0.4" in line
    both = free_mass(velocity=(0.2, 0.0, 0.2, 0, 0, 0), restitution=0.4).finish().audit
    assert both.impacts >= 3
    assert both.law_warnings == (line,)
    assert free_mass(restitution=0.4).finish().audit.law_warnings == ()


def own_force(delta, ddelta, ddelta0, p):
    return p[0] * delta


def test_of_a_users_law_nobody_else_knows_the_range(free_mass):
    own = jp.contact.CustomNormalForce(own_force, (4e8,))
    audit = hit(free_mass, normal=own, **steel(density=7800.0, yield_strength=1e6)).audit
    assert audit.impacts == 1
    assert audit.law_warnings == ()


def test_the_half_width_of_a_line_contact_is_hertzs():
    """b = sqrt(4 F R/(pi E* l)) is 0.3 of the journal's radius (K. L. Johnson, 1985, eq. 4.43)."""
    contact = joint().radial_contact
    half = 0.3 * contact.journal_radius
    force = half**2 * math.pi * contact.modulus * contact.contact_length / (4.0 * contact.radius)
    law, unyielding = jp.contact.Pereira(), contact._replace(yield_strength=math.inf)
    stiffness, _, power = law.parameters(unyielding)
    wider, narrower = ((factor * force / stiffness) ** (1 / power) for factor in (1.01, 0.99))
    (line,) = law.warnings(unyielding, max_depth=wider, max_speed=0.0)
    assert "half-width is 0.3 of" in line
    assert law.warnings(unyielding, max_depth=narrower, max_speed=0.0) == []
