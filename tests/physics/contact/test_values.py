"""Laws are values: equal when equal, frozen, shown as one would write them; parameters by name."""

import math
import pickle
from dataclasses import FrozenInstanceError, fields, replace

import pytest

import jointplay as jp
from jointplay import JointplayError
from jointplay.physics.contact import (
    FILM_LAWS,
    FRICTION_LAWS,
    NORMAL_LAWS,
    FilmForce,
    FilmLaw,
    FrictionLaw,
    NormalForceLaw,
)
from jointplay.physics.contact.film import FilmProperties
from jointplay.physics.contact.machine_code import compiled_law, parameter_names

NEEDED = {
    "kelvin-voigt": {"damping": 30.0},
    "anagnostopoulos": {"mass": 2.0},
    "short-bearing": {"viscosity": 0.05},
    "pinkus-sternlicht": {"viscosity": 0.05},
}
EVERY = [
    (base, name)
    for base, laws in (
        (NormalForceLaw, NORMAL_LAWS),
        (FrictionLaw, FRICTION_LAWS),
        (FilmLaw, FILM_LAWS),
    )
    for name in laws
]
every = pytest.mark.parametrize(
    ("base", "name"), EVERY, ids=lambda part: part if isinstance(part, str) else part.__name__
)
JOINT = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
FILM = FilmProperties(2e-4, 10e-3, 20e-3, 2)


def made(name, base):
    return base.from_description({"law": name, **NEEDED.get(name, {})})


@every
def test_equal_laws_are_equal_hash_alike_and_are_shown_as_one_writes_them(base, name):
    law = made(name, base)
    assert law == made(name, base)
    assert hash(law) == hash(made(name, base))
    assert eval(repr(law), vars(jp) | {type(law).__name__: type(law)}) == law
    assert law != jp.contact.Hertz() or name == "hertz"


@every
def test_laws_are_frozen_and_each_number_has_a_unit(base, name):
    law = made(name, base)
    with pytest.raises(FrozenInstanceError):
        law.name = "another"
    for field in fields(law):
        assert ("units" in field.metadata) == isinstance(getattr(law, field.name), float | None), (
            field.name
        )


@every
def test_a_law_gives_its_function_as_many_numbers_as_that_names(base, name):
    law = made(name, base)
    given = {NormalForceLaw: (JOINT.radial_contact,), FilmLaw: (FILM,)}.get(base, ())
    assert len(parameter_names(law.function, law.state)) == len(law.parameters(*given))


def test_a_changed_law_is_another_law():
    law = jp.contact.Ambrosio(0.3)
    assert replace(law, mu_d=0.2) == jp.contact.Ambrosio(0.2) != law
    assert jp.contact.KelvinVoigt(30) == jp.contact.KelvinVoigt(30.0)
    assert repr(jp.contact.KelvinVoigt(30)) == "KelvinVoigt(damping=30.0, stiffness=None)"


def test_a_wrong_number_says_at_which_field():
    with pytest.raises(JointplayError) as caught:
        jp.contact.Coulomb(v_t=-1.0)
    assert caught.value.where == ("v_t",)
    assert pickle.loads(pickle.dumps(caught.value)).where == ("v_t",)


# A user's own laws.


def named(delta, ddelta, ddelta0, stiffness, alpha):
    return stiffness * delta * math.sqrt(delta) * (1.0 + alpha * ddelta / ddelta0)


def listed(delta, ddelta, ddelta0, p):
    return p[0] * delta * math.sqrt(delta) * (1.0 + p[1] * ddelta / ddelta0)


def rubbing(speed, mu):
    return mu * min(speed / 1e-3, 1.0)


def brushing(speed, normal, dwell, sigma, mu):
    return 1.0, sigma * speed / mu, sigma * normal, 0.0, 0.0, math.inf, 0.0, 0.0


def oil(eccentricity, rate, whirl, spin, clearance, radius, length, viscosity, share):
    return FilmForce(-viscosity * length * rate, 0.0, 0.0, share)


def compiled(law, *state, parameters, answers=0):
    import ctypes

    array = (ctypes.c_double * 8)(*parameters)
    if not answers:
        return compiled_law(law).ctypes(*state, array)
    out = (ctypes.c_double * answers)()
    compiled_law(law).ctypes(*state, array, out)
    return list(out)


def test_parameters_by_name_are_those_by_number_bit_for_bit():
    first = jp.contact.CustomNormalForce(named, {"alpha": 0.3, "stiffness": 1e11})
    second = jp.contact.CustomNormalForce(listed, (1e11, 0.3))
    assert first.values == second.values
    for state in ((1e-5, 0.02, 0.1), (3e-6, -0.1, 0.4)):
        forces = {compiled(law, *state, parameters=law.values) for law in (first, second)}
        assert forces == {named(*state, 1e11, 0.3)}


def test_friction_bristles_and_films_name_their_parameters_too():
    assert compiled(jp.contact.CustomFriction(rubbing, {"mu": 0.2}), 1.0, parameters=(0.2,)) == 0.2
    law = jp.contact.CustomBristle(brushing, {"mu": 0.1, "sigma": 1e5})
    numbers = compiled(law, 0.5, 3.0, 0.0, parameters=law.parameters(), answers=8)
    assert numbers == list(brushing(0.5, 3.0, 0.0, 1e5, 0.1))
    film = jp.contact.CustomFilm(oil, {"share": 7.0}, viscosity=0.1)
    numbers = compiled(film, 0.1, 2.0, 0.0, 0.0, parameters=film.parameters(FILM), answers=4)
    assert numbers == pytest.approx([-0.1 * 20e-3 * 2.0, 0.0, 0.0, 7.0])


def test_users_laws_are_values():
    law = jp.contact.CustomNormalForce(named, (1e11, 0.3))
    assert law == jp.contact.CustomNormalForce(named, {"stiffness": 1e11, "alpha": 0.3})
    names = {"CustomNormalForce": jp.contact.CustomNormalForce, "named": named}
    assert eval(repr(law), names) == law
    assert law != jp.contact.CustomNormalForce(named, (1e11, 0.2))
    film = jp.contact.CustomFilm(oil, (1.0,), viscosity=0.1)
    assert eval(repr(film), {"oil": oil, "CustomFilm": jp.contact.CustomFilm}) == film
    with pytest.raises(FrozenInstanceError):
        law.values = ()


@pytest.mark.parametrize(
    ("function", "parameters", "message"),
    [
        (named, (1e11,), r"'named' takes 2 parameters \(stiffness, alpha\), got 1"),
        (named, {"stiffness": 1e11}, "'named' needs the parameter 'alpha'"),
        (named, {"stiffness": 1, "beta": 1}, "no parameter 'beta'; its own are: stiffness, alpha"),
        (listed, {"stiffness": 1e11}, "takes its parameters as an array; give a list"),
        (lambda d, v, v0, k: k * d, (1.0,), r"or \(delta, ddelta, ddelta0\) and then its param"),
    ],
)
def test_parameters_that_do_not_fit_are_named(function, parameters, message):
    with pytest.raises(JointplayError, match=message):
        jp.contact.CustomNormalForce(function, parameters)


def test_an_elastic_force_that_depends_on_the_approach_is_refused_at_once():
    def remembers(delta, ddelta, ddelta0, stiffness):
        return stiffness * delta * (1.0 + ddelta0)

    with pytest.raises(JointplayError, match=r"'remembers'.*must not depend on ddelta0"):
        jp.contact.CustomNormalForce(remembers, (1e8,))
