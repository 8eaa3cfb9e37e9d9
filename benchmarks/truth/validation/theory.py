"""Theory: single impacts, friction, tops, wedges, pendulums."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
from common import COLOURS, new_figure
from robots import FREE, body, flying, joint, urdf
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk
from truth.validation import Outcome, Rows, case, off

import jointplay as jp
from jointplay.model.impact import impact_duration
from jointplay.physics.contact import NORMAL_LAWS

SOUND_DEPTH = (5.0 / 4.0) ** 0.4
"""Depth of a Hertz impact is this times (m v^2/k)^(2/5)."""
SOUND_TIME = 2.9432751
"""Its duration is this times depth over speed (W. Goldsmith, Impact, 1960)."""


@case(
    origin="theory",
    title="Hertz impact",
    compared="Depth and duration of elastic impacts of a journal on its bore against Hertz's "
    "closed form (W. Goldsmith, Impact, Edward Arnold, 1960): depth (5 m v^2/4 k)^(2/5), duration "
    "2.9433 depth/v.",
    measures="largest relative error of depth and duration",
    wrong="the exponent 3/2 of the force is replaced by 1.45 in the depth",
)
def hertz_impact(quick: bool = False, wrong: bool = False) -> Outcome:
    mass, stiffness = 2.0, 1e10
    bearing = jp.RevoluteClearance.planar(
        radial_clearance=2e-4, stiffness=stiffness, normal=jp.contact.Hertz(), restitution=1.0,
        friction=jp.contact.Ambrosio(0.0),
    )  # fmt: skip
    speeds = np.geomspace(0.01, 1.0, 3 if quick else 9)
    rows = Rows(
        "speed [m/s]|.3g", "depth [µm]|.4g", "theory|.4g", "duration [µs]|.4g", "theory|.4g"
    )
    for speed in speeds:
        power = 0.4 if not wrong else 1.0 / 2.45
        depth = (1.25 * mass * speed**2 / stiffness) ** power
        duration = SOUND_TIME * depth / speed
        options = {"step": duration / 400, "integrator": "rk4", "record_every": 1}
        lasts = 3e-4 / speed + duration
        result = flying(bearing, mass, bearing.cr, speed, duration=lasts, **options).finish()
        gap = result["gap"].values[:, 0, 0]
        # Where the gap crosses zero, between the records.
        inside = np.flatnonzero(gap < 0.0)
        first, last = inside[0], inside[-1]
        begin, end = (
            np.interp(0.0, gap[[inner, outer]], result.time[[inner, outer]])
            for inner, outer in ((first, first - 1), (last, last + 1))
        )
        deepest, lasted = -result["gap_min"].values.min(), end - begin
        shown = (1e6 * one for one in (deepest, depth, lasted, duration))
        rows.add(speed, *shown, errors=(off(deepest, depth), off(lasted, duration)))
    return rows.outcome(2e-4)


FACTORS = {
    "lankarani-nikravesh": lambda c: 0.75 * (1 - c**2),
    "hunt-crossley": lambda c: 0.75 * (1 - c**2),
    "hunt-crossley-1975": lambda c: 1.5 * (1 - c),
    "herbert-mcwhannell": lambda c: 6 * (1 - c) / ((2 * c - 1) ** 2 + 3),
    "lee-wang": lambda c: 0.75 * (1 - c),
    "gonthier": lambda c: (1 - c**2) / c,
    "qin-lu": lambda c: 0.75 * (1 - c**2) * math.exp(2 * (1 - c)),
    "flores": lambda c: 8 * (1 - c) / (5 * c),
    "hu-guo": lambda c: 1.5 * (1 - c) / c,
    "carvalho-martins": lambda c: 1.5 * (1 - c) * (11 - c) / (1 + 9 * c),
    "gharib-hurmuzlu": lambda c: 1 / c,
}
"""Hysteresis factor a(c_e) of F = g(delta) (1 + a ddelta/ddelta0), from the papers in laws.md."""
LINES = (
    "johnson", "radzimovsky", "goldsmith", "dubowsky-freudenstein", "pereira", "esdu-78035", "liu"
)  # fmt: skip
"""Lines have no loss in their references; their damping is Lankarani and Nikravesh's."""
IMPACT_MASS = 2.0  # kg
DASHPOT = 6e3  # N s/m
SPRING = 1e8  # N/m


def restitution_in_theory(law: str, c_e: float, wrong: bool) -> float:
    """Restitution of a free impact under a law, from the formula of its paper alone."""
    if law in ("hertz", "linear-spring"):
        return 1.0
    if law == "zhang-sharf":
        return c_e
    if law in ("kelvin-voigt", "anagnostopoulos"):
        # A dashpot that never pulls: Schwager and Poeschel, Granular Matter 9 (2007).
        zeta = -math.log(c_e) / math.hypot(math.pi, math.log(c_e))
        if law == "kelvin-voigt":
            zeta = DASHPOT / (2.0 * math.sqrt(SPRING * IMPACT_MASS))
        phi = math.acos(zeta)
        return math.exp(-2.0 * phi / math.tan(phi))
    a = FACTORS["lankarani-nikravesh" if law in LINES else law](c_e)
    if wrong:
        return 1.0 - a / 1.5
    # m v dv/ddelta = -g (1 + a v/v0) separates; both ends of the impact have the same depth.
    high = min(1.0, (1.0 - 1e-14) / a)
    return brentq(lambda e: a * (1 + e) - math.log((1 + a) / (1 - a * e)), 1e-6, high)


def rebound(law: jp.contact.NormalForceLaw, c_e: float, speed: float, steps: int) -> float:
    """Rebound over approach speed of a free journal that hits its bore."""
    bearing = jp.RevoluteClearance.planar(
        radial_clearance=1e-3, stiffness=1e10, normal=law, restitution=c_e,
        friction=jp.contact.Ambrosio(0.0),
    )  # fmt: skip
    contact = bearing.contact_properties(0)
    lasts = impact_duration(law, law.parameters(contact), IMPACT_MASS, speed)
    near = 0.05 * lasts * speed
    result = flying(
        bearing, IMPACT_MASS, near, speed, duration=8.0 * lasts, step=lasts / steps,
        integrator="rk4", record_every=steps,
    ).finish()  # fmt: skip
    assert result["gap"].values[-1, 0, 0] > 0.0
    return float(-result["v"].values[-1, 0] / speed)


@case(
    origin="theory",
    title="Restitution of every normal-force law",
    compared="Rebound speed of a free journal from its bore against the closed form of each law: "
    "a(1 + e) = ln((1 + a)/(1 - a e)) for all with the hysteresis damping of Hunt and Crossley, "
    "with the factor a of each paper; exp(-2 phi cot phi), phi = arccos zeta, for linear dashpots "
    "that never pull (Schwager, Poeschel, Granular Matter 9, 2007); 1 without damping.",
    measures="largest absolute error of the restitution",
    wrong="1 - 2a/3, the first order of e in a, instead of the root",
)
def restitution(quick: bool = False, wrong: bool = False) -> Outcome:
    asked = (0.7,) if quick else (0.9, 0.7, 0.5, 0.3)
    rows, worst = Rows("law", *(f"c_e = {c:g}: e (theory)" for c in asked)), {}
    for name, law in NORMAL_LAWS.items():
        needed = {"kelvin-voigt": (DASHPOT, SPRING), "anagnostopoulos": (IMPACT_MASS, SPRING)}
        made = law(*needed.get(name, ()))
        pairs = [
            (rebound(made, c, 0.1, 200 if quick else 500), restitution_in_theory(name, c, wrong))
            for c in asked
        ]
        worst[name] = max(abs(e - theory) for e, theory in pairs)
        rows.add(f"`{name}`", *("{:.4f} ({:.4f})".format(*one) for one in pairs),
                 errors=(worst[name],))  # fmt: skip
    note = (
        f"The largest error is that of `{max(worst, key=worst.__getitem__)}`. Differences from c_e "
        "are a property of each law, not of the program: only `zhang-sharf` delivers the nominal "
        "restitution."
    )
    return rows.outcome(2e-3 if quick else 1e-3, None, note)


GRAVITY = 9.81  # m/s^2


@case(
    origin="theory",
    title="Cylinder rolling in its bore",
    compared="A journal of 20 mm radius, a solid cylinder, rolls without slipping in a bore of 30 "
    "mm (LuGre friction): a pendulum with omega^2 = g/(3/2 (R - r)). Its period at any amplitude "
    "theta is 4 K(sin^2(theta/2))/omega, K the complete elliptic integral. Without friction it "
    "slides, and the factor 3/2 is 1.",
    measures="largest relative error of the period",
    wrong="the rolling cylinder is a ring: 2 instead of 3/2",
)
def rolling(quick: bool = False, wrong: bool = False) -> Outcome:
    outer, inner, mass = 30e-3, 20e-3, 2.0
    rows = Rows("amplitude [rad]|g", "friction", "period [ms]|.4f", "theory [ms]|.4f",
                "relative error|.1e")  # fmt: skip
    rough = jp.contact.LuGre(mu_d=0.8, mu_s=0.8, sigma0=1e6, sigma1=100.0)
    cases = [(0.5, rough)] if quick else [(a, rough) for a in (0.1, 0.5, 1.0)]
    cases += [(0.5, jp.contact.Ambrosio(0.0))]
    for amplitude, friction in cases:
        bearing = jp.RevoluteClearance.planar(
            bearing_radius=outer, journal_radius=inner, friction=friction, restitution=0.5
        )
        inertia = 0.5 * mass * inner**2
        path = urdf(body("roller", mass, inertia=inertia), joint("pin", "base", "roller"))
        robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0, -GRAVITY, 0))
        run = jp.Run(
            jp.Simulation(robot, duration=0.6 if quick else 1.2, step=1e-5, record_every=10, **FREE)
        )
        depth = (mass * GRAVITY * math.cos(amplitude) / bearing.hertz_stiffness) ** (2 / 3)
        length = outer - inner
        where = np.array([math.sin(amplitude), -math.cos(amplitude)])
        run.workspace.q[:2] = (length + depth) * where
        result = run.finish()
        x = result["q"].values[:, 0]
        ups = np.flatnonzero((x[:-1] < 0.0) & (x[1:] >= 0.0))
        crossings = [np.interp(0.0, x[i : i + 2], result.time[i : i + 2]) for i in ups]
        period = (crossings[-1] - crossings[0]) / (len(crossings) - 1)
        rolls = friction is rough
        share = (2.0 if wrong else 1.5) if rolls else 1.0
        omega = math.sqrt(GRAVITY / (share * length))
        theory = 4.0 * ellipk(math.sin(amplitude / 2) ** 2) / omega
        error = off(period, theory)
        word = "LuGre, 0.8" if rolls else "none"
        rows.add(amplitude, word, 1e3 * period, 1e3 * theory, error, errors=(error,))
    return rows.outcome(1e-3)


@case(
    origin="theory",
    title="Slider on an incline",
    compared="A slider in a guide inclined by alpha, held up by its corners and rubbing with mu = "
    "0.3: acceleration g (sin alpha - mu cos alpha) above the friction angle (16.7 deg); below, "
    "LuGre friction holds it, and with the ramp of eq. 21 it creeps at v0 + (v1 - v0) tan(alpha)/"
    "mu.",
    measures="largest error of the acceleration over g, or of the creeping speed over v1",
    wrong="the friction coefficient is 2 % larger",
)
def incline(quick: bool = False, wrong: bool = False) -> Outcome:
    mu, mass, v0, v1 = 0.3, 2.0, 1e-4, 1e-3
    lugre = jp.contact.LuGre(mu_d=mu, mu_s=mu, sigma0=1e5, sigma1=100.0)
    ramp = jp.contact.Ambrosio(mu, v0, v1)
    degrees = (12.0, 25.0) if quick else (5.0, 10.0, 14.0, 16.0, 17.5, 20.0, 25.0, 35.0, 45.0)
    rows = Rows("alpha [deg]|g", "friction", "what", "found|.5f", "theory|.5f")
    rubs = mu * (1.02 if wrong else 1.0)
    for degree, (word, friction) in product(degrees, (("LuGre", lugre), ("eq. 21", ramp))):
        alpha = math.radians(degree)
        bearing = jp.PrismaticClearance(
            clearance=1e-4, friction=friction, restitution=0.5, stiffness=1e10
        )
        # z of the guide points downhill and x into the ground.
        element = joint("guide", "base", "block", "prismatic", rpy=f"0 {math.pi / 2 + alpha!r} 0")
        robot = jp.Mechanism(
            urdf(body("block", mass), element), {"guide": bearing}, gravity=(0, 0, -GRAVITY)
        )
        run = jp.Run(
            jp.Simulation(
                robot, duration=0.15 if quick else 0.4, step=1e-5, record_every=20, **FREE
            )
        )
        load = mass * GRAVITY * math.cos(alpha) / 4.0
        run.workspace.q[0] = 1e-4 + (load / 1e10) ** (2 / 3)
        result = run.finish()
        late = result.time > 0.5 * result.time[-1]
        time, speed = result.time[late], result["v"].sel(coordinate="guide.z").values[late]
        slides = math.tan(alpha) > mu
        if slides or word == "LuGre":
            rate = math.sin(alpha) - rubs * math.cos(alpha)
            theory = max(rate, 0.0) if slides else 0.0
            found = np.polyfit(time, speed, 1)[0] / GRAVITY
            rows.add(degree, word, "acceleration / g", found, theory, errors=(abs(found - theory),))
        else:
            theory, found = v0 + (v1 - v0) * math.tan(alpha) / rubs, speed.mean()
            error = abs(found - theory) / v1
            rows.add(degree, word, "speed [mm/s]", 1e3 * found, 1e3 * theory, errors=(error,))
    return rows.outcome(1e-3)


STICKY = {"mu_d": 0.15, "mu_s": 0.3, "v_s": 2e-3, "sigma0": 2e4, "sigma1": 20.0, "sigma2": 0.0}


def stick_slip_reference(p: dict, mass: float, rate: float, speed: float, times: np.ndarray):
    """Force of the spring [N] that pulls a block rubbing with LuGre friction, by Radau's method."""
    weight = mass * GRAVITY

    def slope(t, y):
        x, v, z = y
        g = p["mu_d"] + (p["mu_s"] - p["mu_d"]) * math.exp(-((v / p["v_s"]) ** 2))
        dz = v - p["sigma0"] * abs(v) / g * z
        rub = weight * (p["sigma0"] * z + p["sigma1"] * dz)
        return v, rate**2 * (speed * t - x) - rub / mass, dz

    found = solve_ivp(
        slope, (0, times[-1]), (0.0, speed, 0.0), method="Radau", t_eval=times, rtol=1e-7,
        atol=1e-10,
    )  # fmt: skip
    return mass * rate**2 * (speed * times - found.y[0])


def period_of(times: np.ndarray, force: np.ndarray) -> tuple[float, float]:
    """Period and peak-to-peak amplitude of the second half."""
    late = times > 0.4 * times[-1]
    times, force = times[late], force[late]
    level = 0.5 * (force.max() + force.min())
    ups = np.flatnonzero((force[:-1] < level) & (force[1:] >= level))
    at = [np.interp(level, force[i : i + 2], times[i : i + 2]) for i in ups]
    return (at[-1] - at[0]) / (len(at) - 1), float(np.ptp(force))


@case(
    origin="integrator",
    title="Stick-slip",
    compared="A block of 2 kg in a guide, pressed on its wall by its weight and pulled by a spring "
    "(20 rad/s) whose end moves at constant speed; LuGre friction, mu_s = 0.3, mu_d = 0.15. Period "
    "and amplitude of the spring's force against an independent integration of the three "
    "equations (scipy, Radau).",
    measures="largest relative error of period and amplitude",
    wrong="mu_s is 0.29",
)
def stick_slip(quick: bool = False, wrong: bool = False) -> Outcome:
    mass, rate = 2.0, 20.0
    speeds = (0.03,) if quick else (0.02, 0.03, 0.05)
    rows = Rows("speed [mm/s]|g", "period [s]|.4f", "reference|.4f", "stiction|.4f",
                "amplitude [N]|.4f", "reference|.4f")  # fmt: skip
    for speed in speeds:
        duration = 1.6 if quick else 0.05 / speed + 1.0
        path = urdf(body("block", mass), joint("guide", "base", "block", "prismatic"))
        play = jp.PrismaticClearance(
            clearance=1e-4, planar=True, lock_tilt=True, friction=jp.contact.LuGre(**STICKY)
        )
        robot = jp.Mechanism(path, {"guide": play}, gravity=(-GRAVITY, 0, 0))
        ramp = jp.Motion(["guide"], [0, 1], [[0], [speed]], "constant-speed")
        result = jp.simulate(
            robot, ramp, drive=jp.loads.ComputedTorque(rate, 0.0), duration=duration, step=2e-5,
            record_every=20,
        )  # fmt: skip
        found = result["drive"].sel(coordinate="guide.z").values
        p = STICKY | ({"mu_s": 0.29} if wrong else {})
        reference = stick_slip_reference(p, mass, rate, speed, result.time)
        (period, size), (true, exact) = (period_of(result.time, one) for one in (found, reference))
        # Sticking until mu_s, then half an oscillation about mu_d and back to rest.
        jump = (p["mu_s"] - p["mu_d"]) * GRAVITY / rate**2
        stiction = 2.0 * jump / speed + 2.0 / rate * (math.pi - math.atan(jump * rate / speed))
        rows.add(1e3 * speed, period, true, stiction, size, exact,
                 errors=(off(period, true), off(size, exact)))  # fmt: skip
    figure, axes = new_figure(1, 1, 6.5, 3.2)
    axes[0, 0].plot(result.time, found, color=COLOURS[0], lw=1.4, label="run")
    axes[0, 0].plot(result.time, reference, "--", color=COLOURS[1], lw=1, label="reference")
    title = f"end of the spring at {1e3 * speed:g} mm/s"
    axes[0, 0].set(xlabel="time [s]", ylabel="force of the spring [N]", title=title)
    axes[0, 0].legend()
    note = (
        "*Stiction* is the closed form for friction that falls from mu_s to mu_d at once: 2 J/V + "
        "(2/omega)(pi - arctan(J omega/V)), J = (mu_s - mu_d) g/omega^2. LuGre approaches it as "
        "its bristles stiffen; the difference is the law's, and the same in the reference. In the "
        "figure the run lags by a few milliseconds: the block falls onto its wall first."
    )
    return rows.outcome(5e-3, figure, note)


@case(
    origin="theory",
    title="Heavy top in a ball joint with clearance",
    compared="Steady precession of a spinning body on a smooth ball with 0.2 mm of clearance. "
    "The ball's centre is displaced by the clearance against the force and rotates with "
    "it, which the formula includes: I3 w W - I1 W^2 cos(theta) = m l (g + W^2 r "
    "cot(theta)), r the distance of the centre of mass from the axis, I1 about the "
    "centre of mass. For fast spin W = m g l/(I3 w).",
    measures="largest relative error of the rate of precession W",
    wrong="the term with I1 has the opposite sign",
)
def top(quick: bool = False, wrong: bool = False) -> Outcome:
    mass, arm, across, along, theta = 1.0, 0.05, 8e-4, 5e-4, 0.4
    play = 2e-4
    bearing = jp.SphericalClearance(
        radial_clearance=play, friction=jp.contact.Ambrosio(0.0), restitution=0.5
    )
    ball = joint("ball", "base", "top", "floating")
    path = urdf(body("top", mass, f"0 0 {arm}", (across, across, along)), ball)
    robot = jp.Mechanism(path, {"ball": bearing}, gravity=(0, 0, -GRAVITY))
    rows = Rows("spin w [rad/s]|g", "W [rad/s]|.6f", "theory|.6f", "m g l/(I3 w)|.6f",
                "relative error|.1e")  # fmt: skip
    s, c = math.sin(theta), math.cos(theta)

    def steady(spin: float, sign: float) -> tuple[float, np.ndarray]:
        """Rate of precession, and the ball's centre."""
        centre = np.zeros(3)
        for _ in range(30):
            out = centre[0] + arm * s

            def balance(rate, out=out):
                gyro = along * spin * rate - sign * across * rate**2 * c
                return gyro * s - mass * arm * (GRAVITY * s + rate**2 * out * c)

            slow = mass * GRAVITY * arm / (along * spin)
            rate = brentq(balance, 0.0, 2.0 * slow)
            force = mass * np.array([-(rate**2) * out, 0.0, GRAVITY])
            size = np.linalg.norm(force)
            depth = (size / bearing.hertz_stiffness) ** (2 / 3)
            centre = -(play + depth) * force / size
        return rate, centre

    for spin in (300.0,) if quick else (200.0, 300.0, 500.0):
        rate, centre = steady(spin, 1.0)
        run = jp.Run(jp.Simulation(
            robot, duration=0.15 if quick else 0.6, step=1e-5, integrator="rk4",
            record_every=50, **FREE,
        ))  # fmt: skip
        # Turned by pitch alone; the rates of yaw and roll that W e_z + psi a come to.
        psi = spin - rate * c
        run.workspace.q[:3], run.workspace.q[4] = centre, theta
        run.workspace.v[:] = 0, rate * centre[0], 0, rate + psi / c, 0, psi * s / c
        result = run.finish()
        axis = journal_axis(result["q"].values[:, 3:])
        azimuth = np.unwrap(np.arctan2(axis[:, 1], axis[:, 0]))
        found = np.polyfit(result.time, azimuth, 1)[0]
        theory = steady(spin, -1.0 if wrong else 1.0)[0]
        fast, error = mass * GRAVITY * arm / (along * spin), off(found, theory)
        rows.add(spin, found, theory, fast, error, errors=(error,))
    return rows.outcome(1e-4)


def journal_axis(angles: np.ndarray) -> np.ndarray:
    """Third column of Rz(yaw) Ry(pitch) Rx(roll), shape (n, 3)."""
    (cy, cp, cr), (sy, sp, sr) = np.cos(angles).T, np.sin(angles).T
    return np.column_stack([cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr])


WEDGE = {"radial_clearance": 2e-4, "axial_clearance": 2e-4}


def wedge_statics(bearing, mass, overhang, lever=1.0):
    """Tilt [rad] and radial force [N] of an arm whose journal is wedged in its bore.

    Tilted in a plane it has three unknowns: the journal's place across, its tilt and the forces of
    both rims, opposite and equal; and stands on the lower wall by the rim's lowest point, R_j away
    from the axis (times `lever`).
    """

    def opposite(tilt, depth):
        reach = bearing.lj * math.sin(tilt) + 2.0 * bearing.rj * math.cos(tilt)
        return reach - 2.0 * (bearing.ri + depth)

    depth = 0.0
    for _ in range(50):
        tilt = brentq(opposite, 0.0, 0.1, args=(depth,), xtol=1e-16)
        s, c = math.sin(tilt), math.cos(tilt)
        foot = -0.5 * bearing.lj * s + lever * bearing.rj * c
        couple = bearing.lj * c - 2.0 * bearing.rj * s
        radial = mass * GRAVITY * (overhang * c - foot) / couple
        depth = (radial / bearing.hertz_stiffness) ** (2 / 3)
    return tilt, radial


@case(
    origin="theory",
    title="Wedged journal: statics",
    compared="A vertical bearing carries an overhanging arm: the tilted journal is wedged between "
    "two opposite rims and stands on the end wall. The rims carry the overhang's moment about the "
    "foot as a couple, N = M/(L_j cos(tilt) - 2 R_j sin(tilt)); the tilt follows from geometry and "
    "Hertz's depth.",
    measures="largest relative error of rim forces, wall force and tilt",
    wrong="the journal touches the wall at its axis, not at its rim",
)
def wedge(quick: bool = False, wrong: bool = False) -> Outcome:
    mass = 4.0
    bearing = jp.RevoluteClearance(**WEDGE, restitution=0.2, friction=jp.contact.Ambrosio(0.0))
    rows = Rows("overhang [mm]|g", "rim A [N]|.3f", "rim B [N]|.3f", "theory|.3f", "wall [N]|.3f",
                "weight|.3f", "tilt [mrad]|.4f", "theory|.4f")  # fmt: skip
    for overhang in (0.25,) if quick else (0.05, 0.1, 0.25, 0.5):
        tilt, radial = wedge_statics(bearing, mass, overhang, 0.0 if wrong else 1.0)
        path = urdf(body("arm", mass, f"{overhang} 0 0"), joint("pin", "base", "arm"))
        robot = jp.Mechanism(path, {"pin": bearing}, gravity=(0, 0, -GRAVITY))
        run = jp.Run(
            jp.Simulation(
                robot, duration=0.3 if quick else 0.5, step=1e-5, record_every=100, **FREE
            )
        )
        lean = 0.01
        run.workspace.q[:] = 0, 0, -bearing.ca + bearing.rj * lean + 2e-5, 0, lean, 0
        result = run.finish()
        rest = slice(int(0.9 * len(result.time)), None)
        forces = result["normal_force"].values[rest, 0].mean(axis=0)
        leans = float(result["tilt"].values[-1, 0])
        weight = mass * GRAVITY
        found = *forces[:2], forces[3], leans
        errors = map(off, found, (radial, radial, weight, tilt))
        lean = 1e3 * leans, 1e3 * tilt
        rows.add(1e3 * overhang, *forces[:2], radial, forces[3], weight, *lean, errors=errors)
    return rows.outcome(2e-4)


@case(
    origin="theory",
    title="Self-locking",
    compared="A slider of length L and width w in a vertical guide, its centre of mass x away "
    "from the axis, tilted and pressed against both walls. Its support along the axis "
    "is slowly removed. Statics: N (L cos(tilt) - w sin(tilt)) = m g x, and it is held "
    "by friction alone if 2 mu N > m g, that is, apart from the tilt, beyond x = L/(2 mu). "
    "The limit is found by bisection of runs with LuGre friction.",
    measures="largest relative error of the overhang at which it jams",
    wrong="only one corner rubs instead of two: x = L/mu",
)
def self_locking(quick: bool = False, wrong: bool = False) -> Outcome:
    mass, duration = 2.0, 0.18
    frictions = (0.3,) if quick else (0.1, 0.2, 0.3, 0.5)
    rows = Rows("mu|g", "jams beyond [mm]|.2f", "theory [mm]|.2f", "relative error|.1e")
    for mu in frictions:
        friction = jp.contact.LuGre(mu_d=mu, mu_s=mu, sigma0=1e5, sigma1=300.0)
        guide = jp.PrismaticClearance(
            clearance=1e-4, friction=friction, restitution=0.3, planar=True, stiffness=1e10
        )
        tilt = 2.0 * guide.clearance / guide.length
        lever = guide.length * math.cos(tilt) - guide.width * math.sin(tilt)
        theory = lever / (mu if wrong else 2.0 * mu)
        support = jp.loads.Torque((0.0, 0.02, 0.12), (mass * GRAVITY, mass * GRAVITY, 0.0))

        def fall(x, guide=guide, tilt=tilt, lever=lever, support=support):
            """How far it has slid at the end [m]."""
            path = urdf(body("arm", mass, f"{x} 0 0", 0.1), joint("g", "base", "arm", "prismatic"))
            robot = jp.Mechanism(path, {"g": guide}, gravity=(0, 0, -GRAVITY))
            run = jp.Run(
                jp.Simulation(
                    robot,
                    drive={"g": support},
                    joint_friction={},
                    duration=duration,
                    record_every=50,
                )
            )
            depth = (mass * GRAVITY * x / lever / 1e10) ** (2 / 3)
            leaning = tilt + 2.0 * depth / lever
            run.workspace.q[robot.coordinates.index("g.pitch")] = leaning
            return -float(run.finish()["q"].sel(coordinate="g.z")[-1])

        low, high = (factor * lever / (2.0 * mu) for factor in (0.7, 1.4))
        assert fall(low) > SLID > fall(high)
        for _ in range(5 if quick else 8):
            x = 0.5 * (low + high)
            low, high = (x, high) if fall(x) > SLID else (low, x)
        found = 0.5 * (low + high)
        error = off(found, theory)
        rows.add(mu, 1e3 * found, 1e3 * theory, error, errors=(error,))
    note = (
        "The bristles are well damped (sigma1 = 300 s/m). Before contacts at rest were damped, a "
        "jammed slider with 30 s/m came loose by its own oscillation up to about 10 % beyond the "
        "static limit; this was not measured again."
    )
    return rows.outcome(0.03, None, note)


SLID = 2e-4
"""Sliding by which a jammed slider is told from one that falls [m]."""


def linked_period(mass, inertia, length, play, amplitude, periods) -> float:
    """Period of a body hung on a massless link of length `play` [s], by DOP853.

    That is what a pendulum on a smooth journal is as long as its weight keeps it on the bore. It
    starts at rest at the angle `amplitude`, the link along the force on it.
    """

    moment = mass * length**2 + inertia

    def accelerations(alpha, beta, da, db):
        """Both angles' accelerations from Lagrange's equations."""
        turn, lean = math.cos(alpha - beta), math.sin(alpha - beta)
        first = -length * db * db * lean - GRAVITY * math.sin(alpha)
        second = mass * length * (play * da * da * lean - GRAVITY * math.sin(beta))
        # play dda + l turn ddb = first;  m l turn play dda + moment ddb = second
        ddb = (second - mass * length * turn * first) / (moment - mass * (length * turn) ** 2)
        return (first - length * turn * ddb) / play, ddb

    def slope(_, y):
        return y[2], y[3], *accelerations(*y)

    def upright(_, y):
        return y[1]

    upright.direction = -1.0
    alpha = link_angle(mass, inertia, length, amplitude)
    end = periods * 2.0 * math.pi * math.sqrt((inertia / mass + length**2) / (GRAVITY * length))
    found = solve_ivp(
        slope, (0.0, end), (alpha, amplitude, 0.0, 0.0), method="DOP853", rtol=1e-9, atol=1e-12,
        events=upright,
    )  # fmt: skip
    events = found.t_events[0]
    return float((events[-1] - events[0]) / (len(events) - 1))


def link_angle(mass, inertia, length, amplitude) -> float:
    """Angle of the force on the pivot of an ideal pendulum at rest at `amplitude` [rad]."""
    turning = -mass * GRAVITY * length * math.sin(amplitude) / (inertia + mass * length**2)
    along, across = GRAVITY * math.cos(amplitude), GRAVITY * math.sin(amplitude) + length * turning
    # The force along the arm, and across it: what gravity asks less what the arm gives way.
    return amplitude - math.atan2(across, along)


@case(
    origin="theory",
    title="Pendulum: clearance to zero",
    compared="Period of a physical pendulum on a smooth journal with clearance, as the clearance "
    "falls to zero. It tends to the ideal pendulum's, 4 K(sin^2(theta/2))/omega, and the journal "
    "on its bore is a massless link of length C_r plus Hertz's depth: an independent integration "
    "of this double pendulum (scipy, DOP853) gives the difference, which is of first order in C_r.",
    measures="largest relative error of the difference to the ideal period",
    wrong="the link has half the length",
)
def clearance_limit(quick: bool = False, wrong: bool = False) -> Outcome:
    mass, inertia, length, amplitude = 2.0, 1e-2, 0.1, 0.3
    periods = 1.4 if quick else 3.4
    omega = math.sqrt(mass * GRAVITY * length / (inertia + mass * length**2))
    ideal = 4.0 * ellipk(math.sin(amplitude / 2) ** 2) / omega
    plays = (1e-3, 2e-4) if quick else (1e-3, 5e-4, 2e-4, 1e-4, 5e-5, 2e-5)
    rows, shifts = Rows("C_r [mm]|g", "period [s]|.7f", "off the ideal|.3e", "theory|.3e",
                        "relative error|.1e"), []  # fmt: skip
    for play in plays:
        bearing = jp.RevoluteClearance.planar(
            radial_clearance=play, friction=jp.contact.Ambrosio(0.0), restitution=0.9
        )
        path = urdf(body("arm", mass, f"{length} 0 0", inertia), joint("pin", "base", "arm"))
        robot = jp.Mechanism(path, {"pin": bearing}, gravity=(GRAVITY, 0, 0))
        run = jp.Run(jp.Simulation(
            robot, duration=periods * ideal, step=1e-5, integrator="semi-implicit-euler",
            record_every=20, state={"pin": amplitude}, **FREE,
        ))  # fmt: skip
        depth = (mass * GRAVITY * math.cos(amplitude) / bearing.hertz_stiffness) ** (2 / 3)
        angle = link_angle(mass, inertia, length, amplitude)
        run.workspace.q[:2] = (play + depth) * np.array([math.cos(angle), math.sin(angle)])
        result = run.finish()
        yaw = result["q"].sel(coordinate="pin.yaw").values
        downs = np.flatnonzero((yaw[:-1] > 0.0) & (yaw[1:] <= 0.0))
        at = [
            result.time[i] + (result.time[i + 1] - result.time[i]) * yaw[i] / (yaw[i] - yaw[i + 1])
            for i in downs
        ]
        period = (at[-1] - at[0]) / (len(at) - 1)
        link = play + (mass * GRAVITY / bearing.hertz_stiffness) ** (2 / 3)
        theory = linked_period(
            mass, inertia, length, link / (2 if wrong else 1), amplitude, periods
        )
        found, exact = period / ideal - 1.0, theory / ideal - 1.0
        error = off(found, exact)
        shifts.append(abs(found))
        rows.add(1e3 * play, period, found, exact, error, errors=(error,))
    exponent = np.polyfit(np.log(plays), np.log(shifts), 1)[0]
    note = f"Fitted exponent of the difference in C_r: {exponent:.3f} (theory: 1)."
    return rows.outcome(0.02, None, note)
