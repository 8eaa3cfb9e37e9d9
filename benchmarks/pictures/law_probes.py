"""One contact law by itself: an impact, a slow sinusoid of sliding, the forces of a film.

Impacts and sliding are runs of jointplay's own time loop on the smallest mechanisms that show the
law; films are evaluated directly, by the compiled function that the time loop calls.
"""

import ctypes
import math
from typing import NamedTuple

import numpy as np
from robots import body, flying, joint, urdf

import jointplay as jp
from jointplay.model.impact import impact_duration
from jointplay.physics.contact import FILM_LAWS, FRICTION_LAWS, NORMAL_LAWS, FilmProperties
from jointplay.physics.contact.compiled import MAX_PARAMETERS, compiled_law

REGISTRIES = {"normal": NORMAL_LAWS, "friction": FRICTION_LAWS, "film": FILM_LAWS}
"""All laws, by family and name."""

CHOSEN = {
    ("normal", "kelvin-voigt"): {"damping": 1e3},
    ("normal", "hunt-crossley"): {"n": 1.5, "p": 1.0, "q": 1.0},
}
"""Parameters that differ from the defaults.

Kelvin-Voigt has none for its damping; Hunt-Crossley's default is the paper's law, and shows nothing
of its own.
"""

MASS = 1.0  # of the body in the impact [kg]
RADIAL, LENGTH = 0.2e-3, 20e-3
"""Radial clearance and length of the bore that it hits: about one half of the SCARA's joint [m]."""
LOOP_SPEED, SPEEDS = 0.1, (0.02, 0.2)
"""Approach speeds: of the hysteresis loops, of the restitutions [m/s]."""
STEPS_OF_AN_IMPACT = 400

BLOCK, AMPLITUDE, FREQUENCY = 2.0, 30e-3, 2.0
"""Mass [kg] of the block that slides, its largest speed [m/s], and how often it goes back [Hz]."""

FILM = {
    "short-bearing": FilmProperties(clearance=50e-6, radius=10e-3, length=9e-3, contacts=1),
    "pinkus-sternlicht": FilmProperties(clearance=50e-6, radius=10e-3, length=42e-3, contacts=1),
}
"""Bearings with a slenderness that each film is made for."""


def build(family, name, mass=MASS, **parameters):
    """The law as its card has it; `mass` [kg] is that of Anagnostopoulos."""
    fields = CHOSEN.get((family, name), {}) | parameters
    if name == "anagnostopoulos":
        fields = {"mass": float(f"{mass:.3g}")} | fields
    return REGISTRIES[family][name](**fields)


class Impact(NamedTuple):
    """One impact: depth [m] and force [N] while it lasts, and the restitution."""

    depth: np.ndarray
    force: np.ndarray
    rebound: float


def impact(law, restitution, speed):
    """Let a free body of `MASS` fly at the bore once."""
    bearing = jp.RevoluteClearance.planar(
        radial_clearance=RADIAL,
        bearing_length=LENGTH,
        restitution=restitution,
        normal=law,
        friction=jp.contact.Ambrosio(0.0),
    )
    contact = bearing.radial_contact
    whole = impact_duration(law, law.parameters(contact), MASS, speed)
    step = whole / STEPS_OF_AN_IMPACT
    # A plastic impact takes long to come out.
    options = {"step": step, "duration": 13 * whole, "record_every": 1}
    result = flying(bearing, MASS, 0.5 * step * speed, speed, **options).finish()
    depth = -result["gap"].values[:, 0, 0]
    within = np.flatnonzero(depth > 0.0)
    out = within[0] + np.flatnonzero(depth[within[0] :] <= 0.0)
    if not out.size:
        raise SystemExit(f"{law.name}: an impact at {speed:g} m/s did not end")
    during = slice(within[0], out[0])
    force = result["normal_force"].values[during, 0, 0]
    return Impact(depth[during], force, -float(result["v"].values[out[0], 0]) / speed)


def sliding(law, cycles=1.5):
    """Draw a block along a wall it is pressed to by its weight, the speed a sinusoid.

    Returns:
        speed [m/s] and friction over normal force [-], shape (n,), of the last whole cycle.
    """
    robot = urdf(
        body("carriage", 1.0),
        joint("along", "base", "carriage", "prismatic"),
        body("block", BLOCK),
        joint("press", "carriage", "block", "prismatic", "1 0 0"),
    )
    guide = jp.PrismaticClearance(
        clearance=1e-5, planar=True, lock_tilt=True, restitution=0.5, friction=law
    )
    mechanism = jp.Mechanism(
        robot, {"guide": guide}, loops={"guide": jp.Loop("base", "block")}, gravity=(-9.81, 0, 0)
    )
    turn = 2 * np.pi * FREQUENCY
    times = np.linspace(0.0, cycles / FREQUENCY, round(80 * cycles) + 1)
    places = -AMPLITUDE / turn * np.cos(turn * times)
    motion = jp.Motion(["along"], times, places[:, None], "spline")
    result = jp.simulate(
        mechanism,
        motion,
        drive={"along": jp.loads.Prescribed()},
        start="centred",
        joint_friction={},
        step=1e-5,
    )
    # The block has fallen on the wall, and lies still, long before the last cycle.
    late = result.time > (cycles - 1.0) / FREQUENCY
    speed = result["v"].sel(coordinate="along").values[late]
    force = result["joint_force"].values[late, 0]
    return speed, -force[:, 2] / force[:, 0]


def steady(law, speeds):
    """Coefficient of lasting sliding at `speeds` >= 0 [m/s]."""
    p = (ctypes.c_double * MAX_PARAMETERS)(*law.parameters())
    function = compiled_law(law).ctypes
    if not law.bristles:
        return np.array([function(speed, p) for speed in speeds])
    # Bristles at rest in themselves: z = A v/r, F = k z + c v, under a normal force of 1 N.
    out = (ctypes.c_double * 8)()
    found = []
    for speed in speeds:
        function(speed, 1.0, 0.0, p, out)
        away, rate, stiffness, _, viscous, _, dwell, _ = out
        function(speed, 1.0, dwell, p, out)  # the cap for a dwell that has settled
        held = stiffness * away * speed / rate if rate > 0.0 else 0.0
        found.append(min(held, out[5]) + viscous * speed)
    return np.array(found)


def film_forces(law, properties, eccentricities, rate=0.0, spin=0.0):
    """F_r and F_t [N], shape (2, n): `rate` of the eccentricity ratio [1/s], `spin` [rad/s]."""
    p = (ctypes.c_double * MAX_PARAMETERS)(*law.parameters(properties))
    out = (ctypes.c_double * 4)()
    function = compiled_law(law).ctypes
    found = []
    for eccentricity in eccentricities:
        function(eccentricity, rate, 0.0, spin, p, out)
        found.append(out[:2])
    return np.array(found).T


def published_rotation(name, e):
    """Load over mu w L R^3/c^2 (L^3 R for the short bearing) and attitude [rad], steady turning.

    Ocvirk's short bearing; half Sommerfeld's long one.
    """
    root = np.sqrt(1.0 - e * e)
    if name == "short-bearing":
        load = e / (4.0 * root**4) * np.sqrt(16.0 * e * e + np.pi**2 * root**2)
        return load, np.arctan2(np.pi * root, 4.0 * e)
    load = 6.0 * e / ((2.0 + e * e) * root**2) * np.sqrt(4.0 * e * e + np.pi**2 * root**2)
    return load, np.arctan2(np.pi * root, 2.0 * e)


def published_squeeze(name, e):
    """Squeeze force over the same with de/dt for w: half the film (positive pressure), all of it.

    Half a film is Reynolds' equation integrated here; a whole one has a closed form.
    """
    rest = 1.0 - e * e
    angle, step = np.linspace(-np.pi, np.pi, 200001, retstep=True)
    half = []
    for each in e:
        if name == "short-bearing":  # p ~ cos/(1 - e cos)^3
            pressure = np.cos(angle) / (1.0 - each * np.cos(angle)) ** 3
        else:  # zero at the film's ends, a quarter turn from the thinnest place
            pressure = 6.0 / each * (1.0 / (1.0 - each * np.cos(angle)) ** 2 - 1.0)
        half.append(step * np.sum(np.maximum(pressure, 0.0) * np.cos(angle)))
    whole = math.pi * (1.0 + 2.0 * e * e) / rest**2.5
    if name != "short-bearing":
        whole = 12.0 * math.pi / rest**1.5
    return np.array(half), whole


def film_unit(law, properties):
    """The force mu L R^3/c^2, or mu L^3 R/c^2 for the short bearing, for 1 rad/s [N]."""
    c, radius, length, _ = properties
    if law.name == "short-bearing":
        return law.viscosity * length**3 * radius / c**2
    return law.viscosity * length * radius**3 / c**2
