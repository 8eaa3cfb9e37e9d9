"""Oil films and wear against closed forms."""

from __future__ import annotations

import cmath
import math

import numpy as np
from scipy.optimize import brentq
from truth.validation import Outcome, Rows, case, off
from truth.validation.impacts import disc

import jointplay as jp

VISCOSITY, RADIUS, LENGTH, CLEARANCE = 0.02, 50e-3, 25e-3, 100e-6
"""Oil [Pa s], bearing [m]."""
TURNING = {"joint_friction": {}, "drive": {"turn": jp.loads.Prescribed()}, "start": "centred"}


def _oiled(cavitation: str) -> jp.RevoluteClearance:
    return jp.RevoluteClearance.planar(
        bearing_radius=RADIUS + CLEARANCE, bearing_length=LENGTH, radial_clearance=CLEARANCE,
        lubricant=jp.contact.ShortBearing(VISCOSITY, cavitation=cavitation),
    )  # fmt: skip


def _spin(speed: float, duration: float) -> jp.Motion:
    return jp.Motion(["turn"], [0, duration], [[0], [speed * duration]], "constant-speed")


@case(
    origin="theory",
    title="Short bearing under a steady load",
    compared="A journal (R 50 mm, L 25 mm, c 0.1 mm, oil of 20 mPa s) turns at constant speed "
    "under its weight and settles: eccentricity and attitude against F. W. Ocvirk's closed form "
    "(NACA TN 2808, 1952), W c^2/(mu omega R L^3) = e sqrt(16 e^2 + pi^2 (1 - e^2))/(4 (1 - "
    "e^2)^2), tan(attitude) = pi sqrt(1 - e^2)/(4 e). Started in the middle. rk4.",
    measures="largest error: of the eccentricity ratio, of the attitude [rad]",
    wrong="the load is that of a film that does not cavitate",
)
def short_bearing(quick: bool = False, wrong: bool = False) -> Outcome:
    rows = Rows("weight [N]|g", "turns a minute|g", "eccentricity|.6f", "theory|.6f",
                "attitude [°]|.4f", "theory|.4f", "thinnest [µm]|.3f")  # fmt: skip
    for weight, rpm in ((1000.0, 3000.0),) if quick else ((300.0, 3000.0), (1000.0, 3000.0),
                                                        (1000.0, 1500.0)):  # fmt: skip
        speed, lasts, g = rpm * 2 * math.pi / 60, 0.4, 9.81
        result = jp.simulate(
            disc(_oiled("sommerfeld" if wrong else "gumbel"), (0, -g, 0), weight / g),
            _spin(speed, lasts), step=1e-5, integrator="rk4", record_every=100, **TURNING,
        )  # fmt: skip
        x, y = result["journal_centre"].values[-1, 0, :2]
        found = math.hypot(x, y) / CLEARANCE
        attitude = abs(math.atan2(x, -y))
        unit = VISCOSITY * speed * RADIUS * LENGTH**3 / CLEARANCE**2

        def load(e, weight, unit=unit):
            root = math.sqrt(16 * e**2 + math.pi**2 * (1 - e**2))
            return unit * e * root / (4 * (1 - e**2) ** 2) - weight

        e = brentq(load, 1e-3, 0.99, args=(weight,))
        angle = math.atan2(math.pi * math.sqrt(1 - e**2), 4 * e)
        turned, thinnest = map(math.degrees, (attitude, angle)), 1e6 * CLEARANCE * (1 - found)
        errors = abs(found - e), abs(attitude - angle)
        rows.add(weight, rpm, found, e, *turned, thinnest, errors=errors)
    return rows.outcome(1e-3)


@case(
    origin="theory",
    title="Oil whirl",
    compared="An unloaded journal in a full film is pushed out of the middle: with the film's "
    "damping C = pi mu R L^3/c^3 and its cross coupling, m z'' + C z' - i C omega/2 z = 0, it "
    "whirls at about half the speed of its turning, and its orbit grows. Growth and frequency "
    "against the root of that equation. rk4.",
    measures="largest error of growth rate and whirl frequency, over the frequency",
    wrong="the cross coupling is C omega, as if the oil turned with the journal",
)
def oil_whirl(quick: bool = False, wrong: bool = False) -> Outcome:
    rows = Rows("turns a minute|g", "growth [1/s]|.4f", "theory|.4f", "whirl [rad/s]|.3f",
                "theory|.3f", "whirl / turning|.4f")  # fmt: skip
    mass = 20.0
    for rpm in (6000.0,) if quick else (3000.0, 6000.0, 12000.0):
        speed = rpm * 2 * math.pi / 60
        damping = math.pi * VISCOSITY * RADIUS * LENGTH**3 / CLEARANCE**3
        couple = damping * speed * (1.0 if wrong else 0.5)
        root = (-damping + cmath.sqrt(damping**2 + 4j * mass * couple)) / (2 * mass)
        lasts = 4 * 2 * math.pi / (speed / 2)
        kick = lasts / 20
        result = jp.simulate(
            disc(_oiled("sommerfeld"), mass=mass), _spin(speed, lasts), step=5e-6,
            integrator="rk4", record_every=10, joint_friction={},
            drive={
                "turn": jp.loads.Prescribed(),
                "x": jp.loads.Torque([0, kick, 1.1 * kick], [0.05, 0.05, 0.0]),
            },
        )  # fmt: skip
        z = result["journal_centre"].values[:, 0, :2] @ [1, 1j]
        late = result.time > lasts / 2  # the other root has died away
        rate = np.polyfit(result.time[late], np.log(np.abs(z[late])), 1)[0]
        whirl = np.polyfit(result.time[late], np.unwrap(np.angle(z[late])), 1)[0]
        errors = abs(rate - root.real) / root.imag, abs(whirl - root.imag) / root.imag
        rows.add(rpm, rate, root.real, whirl, root.imag, whirl / speed, errors=errors)
    return rows.outcome(2e-3)


@case(
    origin="theory",
    title="Archard's wear of a turning journal",
    compared="A dry journal turns at constant speed on the bottom of its bore, pressed by its "
    "weight: the volume worn off the bore against k W s (J. F. Archard, J. Appl. Phys. 24, 1953), "
    "s the way of its surface. rk4.",
    measures="relative error of the worn volume",
    wrong="the way is that of the journal's centre line, R_i instead of R_j",
)
def archard(quick: bool = False, wrong: bool = False) -> Outcome:
    rate, weight, g, speed, lasts = 1e-13, 500.0, 9.81, 100.0, 0.1 if quick else 0.3
    bearing = jp.RevoluteClearance.planar(
        bearing_radius=20e-3, bearing_length=20e-3, radial_clearance=1e-3, restitution=0.2,
        wear_rate=rate, friction=jp.contact.Coulomb(0.0, 1e-3), stiffness=1e10,
    )  # fmt: skip
    robot = disc(bearing, (0, -g, 0), weight / g)
    result = jp.simulate(
        robot, _spin(speed, lasts), step=2e-6, integrator="rk4", record_every=50, **TURNING
    )
    depth = jp.study.worn_depth(result, "pin")[0]
    volume = float(depth.sum() * bearing.ri * 2 * math.pi / len(depth) * bearing.lj)
    # Pressed down by its weight in the mean, also while it bounces: the impulse is weight x time,
    # but for the momentum that is left.
    fallen = float(np.trapezoid(result["normal_force"].values[:, 0, 0], result.time))
    way = (bearing.ri if wrong else bearing.rj) * speed
    theory = rate * weight * way * lasts
    rows = Rows("worn volume [mm^3]|.6f", "theory|.6f", "impulse of the contact force [N s]|.4f",
                "weight x time|.4f")  # fmt: skip
    error = off(volume, theory)
    rows.add(1e9 * volume, 1e9 * theory, fallen, weight * lasts, errors=(error,))
    return rows.outcome(1e-2)
