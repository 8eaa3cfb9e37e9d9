"""Laws against their formulas, alone and in impacts of a free mass."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import jointplay as jp
from jointplay import JointplayError
from jointplay.model.impact import elastic_energy, impact_duration
from jointplay.physics.contact import (
    FRICTION_LAWS,
    NORMAL_LAWS,
    ContactProperties,
    FrictionLaw,
    NormalForceLaw,
)
from jointplay.physics.kernel import Status

STEEL = ContactProperties(1.06e11, 0.8)
DELTA, DDELTA, DDELTA0 = 7e-6, -0.03, 0.1


def value(law, *state):
    p = law.parameters() if len(state) == 1 else law.parameters(STEEL)
    return law.function(*state, *p)


def test_the_laws_that_texts_count_are_those_that_there_are():
    root = Path(__file__).parents[3]
    for name in ("docs/what_it_computes.md", "paper/paper.md"):
        text = " ".join((root / name).read_text(encoding="utf-8").split())
        normal = r"(\d+) (?:normal-force laws|laws of normal force)"
        counts = normal + r".*? and (\d+) (?:friction|of friction)"
        normal, friction = map(int, re.search(counts, text).groups())
        assert (normal, friction) == (len(NORMAL_LAWS), len(FRICTION_LAWS)), name


def test_each_law_is_its_formula():
    k, a = STEEL.stiffness, 0.75 * (1 - 0.8**2)
    state = (DELTA, DDELTA, DDELTA0)
    hertz = k * DELTA**1.5
    assert value(jp.contact.Hertz(), *state) == pytest.approx(hertz)
    assert value(jp.contact.LinearSpring(3e8), *state) == pytest.approx(3e8 * DELTA)
    assert value(jp.contact.KelvinVoigt(50.0, 3e8), *state) == pytest.approx(
        3e8 * DELTA - 50 * 0.03
    )
    equation_19 = hertz * (1 + a * DDELTA / DDELTA0)
    assert value(jp.contact.LankaraniNikravesh(), *state) == pytest.approx(equation_19)
    assert value(jp.contact.HuntCrossley(), *state) == pytest.approx(equation_19)


def test_hunt_crossley_keeps_equation_14_at_the_reference_depth():
    # At 10 um and |ddelta| = ddelta0 the damping part is 3/4 (1 - c_e^2) of the elastic one.
    for n, p, q in ((1.5, 1.5, 1.0), (2.0, 1.0, 1.0), (1.5, 0.5, 2.0)):
        law = jp.contact.HuntCrossley(n, p, q)
        elastic = value(law, 1e-5, 0.0, 0.2)
        assert elastic == pytest.approx(STEEL.stiffness * 1e-5**1.5)
        damping = value(law, 1e-5, 0.2, 0.2) - elastic
        assert damping == pytest.approx(0.75 * (1 - 0.8**2) * elastic)
        assert value(law, 1e-5, -0.2, 0.2) == pytest.approx(elastic - damping)


def test_equation_10_has_equations_15_to_18_as_cases():
    k, b, c = 3e8, 50.0, 0.75 * (1 - 0.8**2)
    general, hertz = jp.contact.HuntCrossley, STEEL.stiffness
    for n, p, damping, stiffness, law in (
        (1.5, 0.0, 0.0, None, jp.contact.Hertz()),
        (1.0, 0.0, 0.0, k, jp.contact.LinearSpring(k)),
        (1.0, 0.0, b, k, jp.contact.KelvinVoigt(b, k)),
        # As printed, eq. 18 has p = 0 and the b of eq. 14 at this depth and this onset.
        (1.5, 0.0, c * hertz * DELTA**1.5 / DDELTA0, None, jp.contact.LankaraniNikravesh()),
    ):
        case = general(n, p, 1.0, stiffness, damping)
        assert value(case, DELTA, DDELTA, DDELTA0) == pytest.approx(
            value(law, DELTA, DDELTA, DDELTA0), rel=1e-12
        )
    assert value(general(2.0, 0.5, 2.0, 7e12, 4e3), DELTA, -0.3, DDELTA0) == pytest.approx(
        7e12 * DELTA**2 - 4e3 * DELTA**0.5 * 0.3**2
    )
    assert general(damping=b).effective_restitution(0.9) is None
    assert general(damping=0.0).effective_restitution(0.9) == 1.0


@pytest.mark.parametrize("depth", [1e-7, 1e-5])
def test_stored_energy_is_the_integral_of_the_elastic_force(depth):
    law = jp.contact.Hertz()
    exact = 0.4 * STEEL.stiffness * depth**2.5
    assert elastic_energy(law, law.parameters(STEEL), depth) == pytest.approx(exact, rel=1e-5)
    assert elastic_energy(law, law.parameters(STEEL), -depth) == 0.0


def test_friction_has_the_branches_of_equation_21():
    law = jp.contact.Ambrosio(0.1, 1e-4, 1e-3)
    assert value(law, 0.5e-4) == 0.0
    assert value(law, 5.5e-4) == pytest.approx(0.05)
    assert value(law, 2e-3) == 0.1  # the paper prints 1 here
    assert value(law, 1e-3) == pytest.approx(value(law, 1e-3 - 1e-12))


@pytest.mark.parametrize(
    "make",
    [
        lambda: jp.contact.Ambrosio(-0.1),
        lambda: jp.contact.Ambrosio(0.1, 1e-3, 1e-3),
        lambda: jp.contact.KelvinVoigt(-1.0),
        lambda: jp.contact.LinearSpring(0.0),
        lambda: jp.contact.HuntCrossley(n=0.5),
        lambda: jp.contact.HuntCrossley(p=-0.1),
        lambda: jp.contact.HuntCrossley(damping=-1.0),
        lambda: jp.contact.HuntCrossley(q=float("nan")),
    ],
)
def test_impossible_parameters_are_refused(make):
    with pytest.raises(JointplayError):
        make()


# Impacts: a body flies along z against the end wall, one axial contact, nothing else.

SPEED, MASS = 0.2, 2.0


def impact(free_mass, law, restitution=0.8, **options):
    """Run the impact; returns rebound/approach speed, duration, depth."""
    run = free_mass(
        normal=law,
        restitution=restitution,
        friction=jp.contact.Ambrosio(0.0),
        offset=(0, 0, 1.99e-4, 0, 0, 0),
        velocity=(0, 0, SPEED, 0, 0, 0),
        mass=MASS,
        **options,
    )
    result = run.finish()
    assert result.status == Status.COMPLETED
    touching = result["gap"].values[:, 0, 2] < 0.0
    duration = touching.sum() * 1e-6
    rebound = -result["v"].values[-1, 2] / SPEED
    return rebound, duration, float(-result["gap"].values[:, 0, 2].min())


def k_axial():
    return jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4).hertz_stiffness


@pytest.mark.parametrize(
    "law", [jp.contact.LankaraniNikravesh(), jp.contact.Hertz(), jp.contact.LinearSpring(4e8)]
)
def test_expected_impact_duration_is_close(free_mass, law):
    _, duration, _ = impact(free_mass, law)
    joint = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4, restitution=0.8)
    expected = impact_duration(law, law.parameters(joint.axial_contact), MASS, SPEED)
    assert duration == pytest.approx(expected, rel=0.1)


def test_a_slow_onset_does_not_blow_the_damping_up(free_mass):
    # A journal that lies on the wall from rest and is then loaded: |ddelta|/ddelta0 stays <= 1,
    # so eq. 19's bracket stays within 1 -+ 3/4 (1 - c_e^2).
    run = free_mass(
        normal=jp.contact.LankaraniNikravesh(),
        restitution=0.5,
        friction=jp.contact.Ambrosio(0.0),
        offset=(0, 0, 2e-4 - 1e-12, 0, 0, 0),
        velocity=(0, 0, 1e-9, 0, 0, 0),
        gravity=(0, 0, 500.0),
        duration=2e-3,
    )
    result = run.finish()
    depth = np.maximum(-result["gap"].values[:, 0, 2], 0.0)
    elastic = k_axial() * depth**1.5
    force = result["normal_force"].values[:, 0, 2]
    loaded = elastic > 1e-3
    ratio = force[loaded] / elastic[loaded]
    a = 0.75 * (1 - 0.5**2)
    assert loaded.sum() > 500
    assert ratio.max() <= 1 + a + 1e-9
    assert ratio.min() >= 1 - a - 1e-9
    assert np.ptp(ratio) > 0.5  # it does damp


# A user's own laws.


def my_hertz(delta, ddelta, ddelta0, p):
    return p[0] * delta * math.sqrt(delta)


def my_friction(speed, p):
    return p[0]


def broken(delta, ddelta, ddelta0, p):  # only once the impact turns
    return 1e11 * delta**1.5 if ddelta >= 0.0 else math.nan * p[0]


def uncompilable(delta, ddelta, ddelta0, p):
    return {"force": delta}


def test_a_users_law_equals_the_built_in_one_bit_for_bit(free_mass):
    own = jp.contact.CustomNormalForce(my_hertz, (k_axial(),))
    assert impact(free_mass, own) == impact(free_mass, jp.contact.Hertz())


def test_a_users_law_survives_its_description():
    law = jp.contact.CustomNormalForce(my_hertz, (5.0,))
    assert law.describe()["function"].endswith(":my_hertz")
    assert NormalForceLaw.from_description(law.describe()).parameters(STEEL) == (5.0,)
    friction = jp.contact.CustomFriction(my_friction, (0.3,))
    assert FrictionLaw.from_description(friction.describe()).parameters() == (0.3,)


def test_wrong_laws_are_refused_with_the_right_signature():
    with pytest.raises(JointplayError, match=r"must take \(delta, ddelta, ddelta0, p\)"):
        jp.contact.CustomNormalForce(my_friction)
    with pytest.raises(JointplayError, match=r"must take \(speed, p\)"):
        jp.contact.CustomFriction(my_hertz)
    with pytest.raises(JointplayError, match="at most 8"):
        jp.contact.CustomNormalForce(my_hertz, (1.0,) * 9)
    with pytest.raises(JointplayError, match="non-finite"):
        jp.contact.CustomNormalForce(my_hertz, (math.inf,))
    nowhere = {"law": "custom", "function": "nowhere:law", "parameters": []}
    with pytest.raises(JointplayError, match="--import nowhere"):
        NormalForceLaw.from_description(nowhere)


@pytest.mark.thorough
def test_a_law_that_does_not_compile_is_named(free_mass):
    with pytest.raises(JointplayError, match="'uncompilable' does not compile"):
        free_mass(normal=jp.contact.CustomNormalForce(uncompilable))


def without_name(delta, ddelta, ddelta0, p):
    return nobody_knows(delta)  # noqa: F821


def without_attribute(delta, ddelta, ddelta0, p):
    return math.gamm(delta)


@pytest.mark.parametrize(
    ("law", "reason"),
    [
        (
            without_name,
            r"NameError: name 'nobody_knows' is not defined( \(line \d+ of its file\))?",
        ),
        (without_attribute, "module 'math' has no attribute 'gamm'"),
    ],
)
def test_the_reason_why_a_law_does_not_compile_is_its_own(free_mass, law, reason):
    with pytest.raises(JointplayError, match=rf"{law.__name__}' does not compile: {reason}$"):
        free_mass(normal=jp.contact.CustomNormalForce(law))


def nowhere_finite(delta, ddelta, ddelta0, p):
    return math.nan * p[0]


def test_a_law_that_is_never_finite_is_refused_before_the_run(free_mass):
    with pytest.raises(JointplayError, match="'nowhere_finite' returns a non-finite force"):
        free_mass(normal=jp.contact.CustomNormalForce(nowhere_finite, (1.0,)))


def divides(delta, ddelta, ddelta0, p):
    return p[0] / (ddelta - ddelta)


def test_division_by_zero_is_a_non_finite_force(free_mass):
    with pytest.raises(JointplayError, match="'divides' returns a non-finite force"):
        free_mass(normal=jp.contact.CustomNormalForce(divides, (1.0,)))


def driving(speed, p):
    return -p[0]


def test_friction_that_drives_stops_the_run(free_mass):
    run = free_mass(
        friction=jp.contact.CustomFriction(driving, (0.1,)),
        offset=(0, 0, 1.99e-4, 0, 0, 0),
        velocity=(0.1, 0, SPEED, 0, 0, 0),
    )
    with pytest.warns(RuntimeWarning):
        assert run.finish().status == Status.BAD_FORCE


def test_a_compiled_function_is_taken_as_the_function_it_was_made_from():
    import numba

    assert jp.contact.CustomNormalForce(numba.njit(my_hertz)).function is my_hertz


def test_a_non_finite_force_stops_the_run_and_keeps_its_records(free_mass):
    run = free_mass(
        normal=jp.contact.CustomNormalForce(broken, (1.0,)),
        offset=(0, 0, 1.99e-4, 0, 0, 0),
        velocity=(0, 0, SPEED, 0, 0, 0),
    )
    with pytest.warns(RuntimeWarning, match="returned a non-finite value"):
        result = run.finish()
    assert result.status == Status.BAD_FORCE
    assert "axial_A" in result.message
    assert len(result.time) > 5
    assert np.isfinite(result["q"].values).all()
