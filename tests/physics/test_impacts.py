"""Single impacts under every law: restitution, losses, depth, alone and in the time loop."""

import math

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq

import jointplay as jp
from jointplay.model.impact import impact_depth
from jointplay.physics.contact import FRICTION_LAWS, NORMAL_LAWS
from jointplay.physics.contact.hertzian import HysteresisLaw
from jointplay.physics.contact.line_contact import LineContactLaw
from jointplay.physics.kernel import Status

SLOW = ("gonthier", "brown-mcphee")
"""Friction laws whose runs take seconds."""
FAMILY = [law() for law in NORMAL_LAWS.values() if issubclass(law, HysteresisLaw)]
CYLINDRICAL = [law for law in FAMILY if isinstance(law, (LineContactLaw, jp.contact.Pereira))]
hysteresis = pytest.mark.parametrize("law", FAMILY, ids=lambda law: law.name)
cylindrical = pytest.mark.parametrize("law", CYLINDRICAL, ids=lambda law: law.name)
MASS = 2.0
SLIPPERY = {name: {"mu_s": 0.3} for name in ("bengisu-akay", "brown-mcphee", "lugre", "gonthier")}


def joint(c_e):
    return jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4, restitution=c_e)


def closed_form(a):
    """Solve a (1 + e) = ln((1 + a)/(1 - a e)) for e; written anew, not the package's own."""
    if a == 0.0:
        return 1.0
    high = min(1.0, (1.0 - 1e-14) / a)
    return brentq(lambda e: a * (1 + e) - math.log((1 + a) / (1 - a * e)), 1e-9, high)


def impact(law, p, speed, mass=MASS, adhesion=True):
    """Integrate m d2delta = -F until the bodies part.

    Returns rebound over approach speed, work lost [J], largest depth [m], smallest force [N].
    """
    forces = []

    def force(delta, rate):
        value = law.function(max(delta, 0.0), rate, speed, *p)
        return value if adhesion else max(value, 0.0)

    def slope(_, y):
        delta = max(y[0], 0.0)
        whole = force(delta, y[1])
        forces.append(whole)
        return y[1], -whole / mass, (whole - law.function(delta, 0.0, speed, *p)) * y[1]

    def parted(_, y):
        return y[0]

    parted.terminal, parted.direction = True, -1

    def turned(_, y):
        return y[1]

    depth = impact_depth(law, p, mass, speed)
    end = solve_ivp(
        slope,
        (0.0, 1e3 * depth / speed),
        (1e-9 * depth, speed, 0.0),
        method="DOP853",
        rtol=1e-10,
        atol=(1e-13 * depth, 1e-12 * speed, 1e-12 * mass * speed**2),
        events=(parted, turned),
    )
    assert end.status == 1
    return -end.y[1, -1] / speed, end.y[2, -1], end.y_events[1][0][0], min(forces)


@hysteresis
@pytest.mark.parametrize("speed", [0.01, 1.0])
@pytest.mark.parametrize("c_e", [0.1, 0.5, 0.95])
def test_restitution_and_loss_are_the_closed_form(law, speed, c_e):
    contact = joint(c_e).radial_contact
    rebound, lost, _, least = impact(law, law.parameters(contact), speed)
    exact = closed_form(law.factor(c_e))
    assert rebound == pytest.approx(exact, abs=1e-6)
    assert lost == pytest.approx(0.5 * MASS * speed**2 * (1 - exact**2), rel=1e-6)
    assert law.effective_restitution(c_e) == pytest.approx(exact, abs=1e-9)
    assert least >= 0.0  # the bodies never hold each other back


@hysteresis
def test_nothing_is_lost_without_damping(law):
    if law.factor(1.0) > 0.0:  # Gharib-Hurmuzlu, for soft impacts
        return
    rebound, lost, depth, _ = impact(law, law.parameters(joint(1.0).radial_contact), 0.1)
    assert rebound == pytest.approx(1.0, abs=1e-8)
    assert abs(lost) < 1e-15
    p = law.parameters(joint(1.0).radial_contact)
    stored, _ = quad(lambda d: law.function(d, 0.0, 1.0, *p), 0.0, depth, epsrel=1e-10)
    assert stored == pytest.approx(0.5 * MASS * 0.1**2, rel=1e-5)


@pytest.mark.parametrize("c_e", [0.2, 0.5, 0.9])
def test_anagnostopoulos_with_and_without_the_pull_of_its_dashpot(c_e):
    law = jp.contact.Anagnostopoulos(MASS)
    p = law.parameters(joint(c_e).radial_contact)
    pulled, _, _, least = impact(law, p, 0.1)
    assert pulled == pytest.approx(c_e, abs=1e-6)  # the formula's own claim
    assert least < 0.0
    free, *_ = impact(law, p, 0.1, adhesion=False)
    assert free == pytest.approx(law.effective_restitution(c_e), abs=1e-6)
    assert free > pulled


# In the time loop: a free body flies at the end wall, or at the bore with both its ends.


def fly(free_mass, law, axis, c_e, speed=0.2):
    """Rebound over approach speed, largest depth [m], and energy lost in the contact [J]."""
    offset, velocity = [0.0] * 6, [0.0] * 6
    offset[axis], velocity[axis] = 1.99e-4, speed
    run = free_mass(
        normal=law,
        restitution=c_e,
        friction=jp.contact.Ambrosio(0.0),
        offset=offset,
        velocity=velocity,
        mass=MASS,
        duration=8e-4,
        step=2.5e-7,  # what is lost is counted to first order of the step
    )
    result = run.finish()
    assert result.status == Status.COMPLETED
    assert (result["gap"].values[-1] > 0.0).all()
    column = 2 if axis == 2 else 0
    depth = -float(result["gap"].values[:, 0, column].min())
    rebound = -float(result["v"].values[-1, axis]) / speed
    return rebound, depth, float(result["normal_dissipation"].values[-1])


@pytest.mark.parametrize(
    "law",
    [
        jp.contact.Hertz(),
        jp.contact.LinearSpring(),
        jp.contact.KelvinVoigt(2e3),
        jp.contact.Anagnostopoulos(MASS),
        jp.contact.HuntCrossley(1.5, 1.2, 1.0),
        jp.contact.HuntCrossley(1.2, 1.5, 2.0),
        jp.contact.HuntCrossley(1.0, 0.0, 1.0, 4e8, 2e3),
        jp.contact.HuntCrossley(1.5, 0.0, 1.0, None, 2e3),
        jp.contact.HuntCrossley(1.5, 0.5, 1.0, None, 5e5),
    ],
    ids=lambda law: law.name,
)
@pytest.mark.parametrize(("c_e", "speed"), [(0.5, 0.05), (0.9, 0.5)])
def test_the_time_loop_integrates_every_other_law(free_mass, law, c_e, speed):
    p = law.parameters(joint(c_e).axial_contact)
    exact, _, deepest, _ = impact(law, p, speed, adhesion=False)
    rebound, depth, lost = fly(free_mass, law, 2, c_e, speed)
    assert rebound == pytest.approx(exact, abs=4e-3)
    assert depth == pytest.approx(deepest, rel=5e-3)
    # A dashpot that stops pulling leaves a spring to unwind against it: that is lost as well.
    energy = 0.5 * MASS * speed**2
    assert lost == pytest.approx(energy * (1 - exact**2), abs=8e-3 * energy)


@cylindrical
def test_a_parallel_journal_hits_the_bore_as_one_line(free_mass, law):
    """Both ends touch at once, and together they are the line contact of the whole length."""
    rebound, depth, _ = fly(free_mass, law, 0, 0.8)
    assert rebound == pytest.approx(closed_form(law.factor(0.8)), abs=4e-3)
    elastic, deepest, _ = fly(free_mass, law, 0, 1.0)
    assert elastic == pytest.approx(1.0, abs=2e-3)
    whole = joint(1.0).radial_contact
    whole = whole._replace(contact_length=whole.journal_length)
    exact = impact_depth(law, law.parameters(whole), MASS, 0.2)
    assert deepest == pytest.approx(exact, rel=3e-3)
    assert depth < deepest


@cylindrical
def test_the_end_wall_is_hertz_for_a_line_law(free_mass, law):
    _, depth, _ = fly(free_mass, law, 2, 1.0)
    hertz = (5 * MASS * 0.2**2 / (4 * joint(1.0).hertz_stiffness)) ** 0.4
    assert depth == pytest.approx(hertz, rel=2e-3)


@pytest.mark.parametrize("name", [n for n, law in FRICTION_LAWS.items() if not law.bristles])
def test_a_sliding_body_is_slowed_by_its_friction_law(free_mass, name):
    """A body too inert to turn lies on the wall and slides: dv/dt = -mu(v) g."""
    law = FRICTION_LAWS[name]()
    g, start, duration = 20.0, 3e-3, 1.5e-3
    depth = (MASS * g / joint(1.0).hertz_stiffness) ** (2 / 3)
    run = free_mass(
        normal=jp.contact.Hertz(),
        friction=law,
        inertia=1e4,
        mass=MASS,
        gravity=(0, 0, g),
        offset=(0, 0, 2e-4 + depth, 0, 0, 0),
        velocity=(start, 0, 0, 0, 0, 0),
        duration=duration,
    )
    result = run.finish()
    p = law.parameters()
    exact = solve_ivp(
        lambda _, v: -g * law.function(max(float(v[0]), 0.0), *p),
        (0.0, duration),
        (start,),
        rtol=1e-9,
        atol=1e-12,
    )
    speed = float(result["v"].values[-1, 0])
    assert speed == pytest.approx(exact.y[0, -1], abs=2e-6)
    assert speed < 0.8 * start  # it has slowed down, into the law's ramp
    lost = float(result["friction_dissipation"].values[-1])
    assert lost == pytest.approx(0.5 * MASS * (start**2 - speed**2), rel=2e-3)
    assert np.all(np.diff(result["friction_dissipation"].values) >= 0.0)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.thorough if name in SLOW else ())
        for name in FRICTION_LAWS
    ],
)
def test_friction_takes_and_never_gives(free_mass, name):
    """A spinning body bounces and rubs everywhere; what bristles give back they were given."""
    run = free_mass(
        friction=FRICTION_LAWS[name](mu_d=0.2, **SLIPPERY.get(name, {})),
        restitution=0.6,
        normal=jp.contact.Flores(),
        velocity=(0.1, -0.05, 0.2, 20.0, 1.5, -1.0),
        duration=1e-2,
        step=2e-6,
    )
    result = run.finish()
    assert result.status == Status.COMPLETED
    assert result.audit.impacts >= 4
    lost = result["friction_dissipation"].values
    start = float(result["kinetic_energy"][0])
    assert lost[-1] > 1e-3 * start
    assert lost.min() >= -1e-9 * start
    if not FRICTION_LAWS[name].bristles:
        assert np.diff(lost).min() >= 0.0
    assert result.audit.energy_residual < 0.02 * start


@pytest.mark.parametrize("name", NORMAL_LAWS)
def test_no_normal_law_gives_energy(free_mass, name):
    needed = {"kelvin-voigt": (2e3,), "anagnostopoulos": (MASS,)}
    run = free_mass(
        normal=NORMAL_LAWS[name](*needed.get(name, ())),
        restitution=0.5,
        velocity=(0.1, -0.05, 0.2, 20.0, 1.5, -1.0),
        duration=1e-2,
        step=2e-6,
    )
    result = run.finish()
    assert result.status == Status.COMPLETED
    start = float(result["kinetic_energy"][0])
    assert (result["normal_force"].values >= 0.0).all()
    assert np.diff(result["normal_dissipation"].values).min() >= -1e-6 * start
    assert float(result["kinetic_energy"].values.max()) < 1.001 * start


PLASTIC_LAWS = ["zhang-sharf", "gonthier", "flores", "hu-guo", "gharib-hurmuzlu"]


@pytest.mark.parametrize("name", PLASTIC_LAWS)
def test_what_drops_with_a_restitution_of_0_stays(free_mass, name):
    speed, offset, velocity = 0.2, [0.0] * 6, [0.0] * 6
    offset[2], velocity[2] = 1.99e-4, speed
    run = free_mass(
        normal=NORMAL_LAWS[name](),
        restitution=0.0,
        friction=jp.contact.Ambrosio(0.0),
        offset=offset,
        velocity=velocity,
        gravity=(0.0, 0.0, 9.81),
        mass=MASS,
        duration=0.01,
        step=2.5e-7,
    )
    result = run.finish()
    after = result["time"].values > 1e-3
    assert np.abs(result["v"].values[after, 2]).max() < 0.011 * speed
    assert np.abs(result["v"].values[-1, 2]) < 1e-3 * speed
    assert result["gap"].values[after, 0, 2].max() < 0.5 * (0.011 * speed) ** 2 / 9.81
    assert result["normal_dissipation"].values[-1] > 0.999 * 0.5 * MASS * speed**2


@pytest.mark.parametrize("name", sorted({*NORMAL_LAWS} - {*PLASTIC_LAWS}))
def test_laws_without_a_plastic_impact_refuse_a_restitution_of_0(name):
    needed = {"kelvin-voigt": (2e3,), "anagnostopoulos": (MASS,)}
    with pytest.raises(jp.JointplayError, match=r"has no plastic impact.*choose normal = 'zhang"):
        jp.RevoluteClearance(
            radial_clearance=2e-4, restitution=0.0, normal=NORMAL_LAWS[name](*needed.get(name, ()))
        )
