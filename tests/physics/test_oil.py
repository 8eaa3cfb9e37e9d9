"""Journals in oil, against closed forms and an independent integration."""

import numpy as np
import pytest
from conftest import body, joint
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import jointplay as jp
from jointplay.physics.contact import CustomFilm, PinkusSternlicht, ShortBearing

C, RADIUS, LENGTH = 1e-4, 10e-3, 8e-3
FREE = {"drive": jp.loads.Free(), "joint_friction": {}, "start": "centred"}


def robot(urdf, lubricant, *, planar=True, mass=2.0, gravity=(-9.81, 0, 0), **fields):
    """One body that hangs in one bearing fixed to the ground."""
    make = jp.RevoluteClearance.planar if planar else jp.RevoluteClearance
    fields = {"radial_clearance": C, "bearing_radius": RADIUS, "bearing_length": LENGTH} | fields
    path = urdf(body("arm", mass), joint("pin", "base", "arm"))
    return jp.Mechanism(path, {"pin": make(**fields, lubricant=lubricant)}, gravity=gravity)


def sunk(result):
    """Eccentricity ratio by record."""
    return np.hypot(*result["journal_centre"].values[:, 0, :2].T) / C


def squeezed(mass, viscosity, times):
    """Eccentricity of a journal sinking under its weight, by scipy at tight tolerance."""
    size = viscosity * (RADIUS - C) * LENGTH**3 / (2 * C * C)

    def resistance(e):
        half = np.arccos(-e)
        integral = half + np.sin(half) * np.cos(half) + 4 * e * np.sin(half) + 2 * half * e * e
        return 2 * size * integral / (1 - e * e) ** 2.5

    def slope(_, y):
        return y[1], 9.81 / C - resistance(y[0]) * y[1] / (mass * C)

    found = solve_ivp(
        slope, (0, times[-1]), (0, 0), method="Radau", rtol=1e-9, atol=1e-12, t_eval=times
    )
    return found.y[0]


@pytest.mark.parametrize(
    ("integrator", "order"),
    [
        ("multi-rate", 2),
        pytest.param("semi-implicit-euler", 1, marks=pytest.mark.thorough),
        pytest.param("rk4", 2, marks=pytest.mark.thorough),
    ],
)
def test_journal_sinks_in_oil_as_an_independent_integration_says(urdf, integrator, order):
    """At 1e-5 s the film soon is too stiff to be followed explicitly: dt C/m passes 100.

    The explicit methods let it lag; multi-rate solves for it.
    """
    errors = []
    for step in (1e-5, 2.5e-6):
        result = jp.simulate(
            robot(urdf, ShortBearing(0.05)), duration=0.2, step=step, integrator=integrator,
            record_every=round(1e-3 / step), **FREE,
        )  # fmt: skip
        expected = squeezed(2.0, 0.05, result.time)
        errors.append(np.abs(sunk(result) - expected).max())
        assert result.audit.relative_energy_residual < 0.01
    assert expected[-1] > 0.95
    assert errors[0] < 2e-3
    assert errors[1] < errors[0] / 4**order * 1.6
    thinner = squeezed(2.0, 0.049, result.time)
    assert np.abs(thinner - expected).max() > 3 * errors[0]


def half_sommerfeld(spin, weight, viscosity):
    size = viscosity * LENGTH * (RADIUS - C) ** 3 / C**2 * spin

    def parts(e):
        wide = 2 + e * e
        return 12 * e * e / (wide * (1 - e * e)), 6 * np.pi * e / (wide * np.sqrt(1 - e * e))

    e = brentq(lambda e: size * np.hypot(*parts(e)) - weight, 1e-6, 0.999)
    return e, np.arctan2(*parts(e)[::-1])


def test_loaded_journal_finds_its_place_in_the_oil(urdf):
    spin, weight, film = 200.0, 2.0 * 9.81, PinkusSternlicht(0.002)
    motion = jp.Motion(["pin"], [0, 0.1], [[0], [0.1 * spin]], "constant-speed")
    result = jp.simulate(
        robot(urdf, film), motion, duration=1.0, drive=jp.loads.ComputedTorque(300.0),
        joint_friction={}, start="centred", limits="ignore",
    )  # fmt: skip
    x, y = result["journal_centre"].values[-1, 0, :2]
    e, attitude = half_sommerfeld(spin, weight, film.viscosity)
    assert np.hypot(x, y) / C == pytest.approx(e, rel=1e-6)
    # The load points along -x; the journal runs ahead in the direction of its spin.
    assert np.arctan2(-y, -x) == pytest.approx(attitude, rel=1e-5)
    assert not result["normal_force"].values.any()
    force = result["film_force"].values[-1, 0]
    assert force == pytest.approx([weight, 0, 0], abs=1e-4)
    assert result["joint_force"].values[-1, 0] == pytest.approx(force)
    assert result.audit.relative_energy_residual < 1e-4


def linear(eccentricity, rate, whirl, spin, p, out):
    """A film that damps its centre's velocity with 1 N s/m."""
    out[0] = -p[0] * rate
    out[1] = -p[0] * whirl
    out[2] = 0.0
    out[3] = 1.0


@pytest.mark.parametrize("law", [ShortBearing(0.05, cavitation="sommerfeld"), CustomFilm(linear)])
def test_film_resists_tilting_with_the_second_moment_of_its_pressure(urdf, law):
    """A centred short bearing's damping C is spread as L^2/4 - z^2: the moment is C L^2/20.

    For a pressure that is constant along the axis it is C L^2/12.
    """
    play = {"axial_clearance": C, "bearing_length": 8 * LENGTH, "bearing_radius": 8 * RADIUS}
    machine = robot(urdf, law, planar=False, gravity=(0, 0, 0), **play)
    clearance = machine.clearance["pin"]
    length = clearance.lj
    damping = 1.0
    if law.name == "short-bearing":
        damping = np.pi * law.viscosity * clearance.rj * length**3 / C**3
    share = 20.0 if law.name == "short-bearing" else 12.0
    run = jp.Run(jp.Simulation(machine, duration=1e-4, step=1e-8, record_every=1, **FREE))
    run.workspace.v[4] = 1e-3
    result = run.finish()
    rate = result["v"].values[:, 4]
    decay = -np.log(rate[-1] / rate[0]) / result.time[-1]
    assert decay == pytest.approx(damping * length**2 / share / 1e-2, rel=2e-3)


def test_hybrid_film_hands_over_to_dry_contact(urdf):
    """Thrown hard, the journal breaks through the film and bounces on the bore; energy adds up."""
    film = ShortBearing(0.002, transition=2e-6)
    machine = robot(urdf, film, gravity=(0, 0, 0), mass=20.0)
    run = jp.Run(
        jp.Simulation(machine, duration=5e-3, step=1e-6, integrator="rk4", record_every=1, **FREE)
    )
    run.workspace.v[:2] = 0.3, 0.1
    result = run.finish()
    assert result.status.name == "COMPLETED"
    assert result.audit.impacts > 0
    assert result["normal_force"].values.max() > 0.0
    assert 0.5 < result["film_dissipation"].values[-1] < 1.0  # of the 1 J it had
    assert result.audit.relative_energy_residual < 1e-4


def test_audit_says_where_a_film_leaves_its_range(urdf):
    slim = jp.simulate(robot(urdf, ShortBearing(0.05)), duration=0.01, **FREE)
    assert not slim.audit.law_warnings
    wide = jp.simulate(robot(urdf, ShortBearing(0.05), bearing_length=30e-3), duration=0.01, **FREE)
    assert any("length/diameter up to 0.5" in text for text in wide.audit.law_warnings)
    short = jp.simulate(robot(urdf, PinkusSternlicht(0.05)), duration=0.01, **FREE)
    assert any("length/diameter from 2" in text for text in short.audit.law_warnings)
    thin = ShortBearing(0.01, least_thickness=2e-5)
    sunken = jp.simulate(robot(urdf, thin), duration=0.1, **FREE)
    assert any("too rough" in text for text in sunken.audit.law_warnings)


def test_film_alone_ends_the_run_when_it_breaks(urdf):
    film = ShortBearing(0.0005, hybrid=False)
    machine = robot(urdf, film, gravity=(0, 0, 0), mass=20.0)
    run = jp.Run(jp.Simulation(machine, duration=5e-3, step=1e-6, **FREE))
    run.workspace.v[0] = 0.3
    with pytest.warns(RuntimeWarning, match=r"touched its bore through the film.*hybrid"):
        result = run.finish()
    assert result.status.name == "FILM_BROKE"


def test_oil_keeps_the_assembly_robot_off_its_bore():
    """The paper's robot at 10 us: its rims strike the bore, but not through thick oil."""
    peaks = []
    for lubricant in (None, ShortBearing(0.5)):
        play = jp.RevoluteClearance(
            radial_clearance=0.2e-3, axial_clearance=0.2e-3, bearing_length=10e-3,
            lubricant=lubricant,
        )  # fmt: skip
        machine = jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": play}, gravity=(0, 0, 0))
        motion = jp.Motion.from_csv(jp.shipped("scara_motion.csv"))
        result = jp.simulate(machine, motion, duration=0.3)
        assert result.status.name == "COMPLETED"
        assert result.audit.relative_energy_residual < 0.01
        peaks.append(result["normal_force_peak"].sel(contact=["radial_A", "radial_B"]).max())
    assert peaks[0] > 10.0
    assert peaks[1] == 0.0
