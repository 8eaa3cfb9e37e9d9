"""Public benchmarks of multibody programs: what anybody can look up, with source and commit.

Of each a few numbers are quoted here, none of its code is used.
"""

from __future__ import annotations

import cmath
import math

import numpy as np
from robots import FREE, body, joint, urdf
from scipy.integrate import solve_ivp
from truth.four_bar_control import REFERENCE, crank, machine
from truth.validation import Outcome, Rows, case

import jointplay as jp


def _points(places: dict[str, complex]) -> dict[str, tuple[float, float]]:
    return {name: (at.real, at.imag) for name, at in places.items()}


# Siconos: a four-bar with three clearances


@case(
    origin="engine",
    title="Siconos: four-bar with three clearances",
    compared="The controlled four-bar of Akhadkar, Acary and Brogliato, 5 mm of clearance in three "
    "of its four pins: angle of the crank at up to eleven instants of 0.8 s against Siconos's own "
    "reference result (github.com/siconos/siconos-tutorials, commit 1d9dc81, "
    "`examples/mechanics/FourBarLinkageWith3clearance/FourBarClearance.ref`, Apache-2.0). There "
    "walls are rigid and do not throw back; here they are steel with a restitution of 0.1. "
    "Step 5 µs.",
    measures="largest difference of the crank's angle [rad]",
    wrong="the controller with the desired speed where the example's code has the actual one",
)
def siconos_four_bar(quick: bool = False, wrong: bool = False) -> Outcome:
    result = machine(wrong, 0.15 if quick else 0.8).run(estimate=False).completed()
    rows = Rows(
        "time [s]|g", "Siconos [rad]|.6f", "jointplay [rad]|.6f", "speeds apart [rad/s]|.3f"
    )
    for (time, angle, speed), ours, rate in zip(REFERENCE, *crank(result), strict=True):
        if time <= result.time[-1] + 1e-9:
            rows.add(time, angle, ours, rate - speed, errors=(abs(ours - angle),))
    return rows.outcome(1e-3)


# IFToMM A02: two four-bars in a row, which fall through positions where they could part

BAR_GRAVITY = 9.81
BAR_STEPS = (
    # Step [s], and at 10 s place [m] and speed [m/s] of B0.
    (0.00025, 0.3284552113, 0.9445195467, 1.423045728, -0.4948619021),
    (0.000125, 0.3284573768, 0.9445187937, 1.423050003, -0.4948670827),
)
"""Of Exudyn, written in main/pythonDev/TestModels/fourBarMechanismIftomm.py of
github.com/jgerstmayr/EXUDYN at commit 30ec2d5."""


@case(
    origin="engine",
    title="IFToMM A02: double four-bar",
    compared="Five bars of 1 m and 1 kg, two parallelograms in a row (problem A02 of the IFToMM "
    "library of multibody benchmarks, with N = 2), pushed from upright by 1 m/s: place and speed "
    "of B0 after 10 s. Whenever all bars lie in line the loops could part. Against the numbers "
    "that Exudyn's example prints for its two smallest steps (github.com/jgerstmayr/EXUDYN, commit "
    "30ec2d5, `fourBarMechanismIftomm.py`), taken to step zero, and against the one equation that "
    "is left if nothing parts, θ'' = 7 g sin θ / 6, integrated by scipy. The table of the library "
    "itself was not at hand. rk4, step 1 ms.",
    measures="largest difference of a place [m] or speed [m/s] from either",
    wrong="gravity is 9.80665 instead of 9.81 m/s^2",
)
def iftomm_double_four_bar(quick: bool = False, wrong: bool = False) -> Outcome:
    rails = range(3)
    bars = {f"bar {k}": [f"A{k}", f"B{k}"] for k in rails}
    bars |= {f"rod {k}": [f"B{k}", f"B{k + 1}"] for k in rails[:2]}
    linkage = jp.Linkage(
        points=_points({f"A{k}": k + 0j for k in rails} | {f"B{k}": k + 1j for k in rails}),
        ground=[f"A{k}" for k in rails],
        links={name: jp.LinkageLink(two, mass=1.0, inertia=1 / 12) for name, two in bars.items()},
        output="bar 0",
    )
    gravity = 9.80665 if wrong else BAR_GRAVITY
    mechanism = jp.Mechanism(linkage, gravity=(0, 0, -gravity))
    turning = {name: (0.0, -1.0 if name[0] == "A" else 1.0) for name in mechanism.joints}
    result = jp.simulate(
        mechanism, duration=10.0, step=1e-3, record_every=100, integrator="rk4", state=turning,
        **FREE,
    )  # fmt: skip

    def b0(angle: float, rate: float) -> np.ndarray:
        sin, cos = math.sin(angle), math.cos(angle)
        return np.array([sin, cos, rate * cos, -rate * sin])

    at = mechanism.coordinate("A0")
    ours = b0(-result["q"].values[-1, at], -result["v"].values[-1, at])
    fall = solve_ivp(
        lambda _, x: (x[1], 7 / 6 * BAR_GRAVITY * math.sin(x[0])),
        (0.0, 10.0), (0.0, 1.0), method="DOP853", rtol=1e-12, atol=1e-13,
    )  # fmt: skip
    coarse, fine = np.array(BAR_STEPS)[:, 1:]
    exudyn, alone = fine + (fine - coarse) / 3.0, b0(*fall.y[:, -1])  # of second order
    rows = Rows("B0 at 10 s", "Exudyn, step 0|.9f", "one equation|.11f", "jointplay|.11f")
    names = ("x [m]", "y [m]", "speed along x [m/s]", "speed along y [m/s]")
    for name, *found in zip(names, exudyn, alone, ours, strict=True):
        rows.add(name, *found, errors=(abs(found[2] - found[0]), abs(found[2] - found[1])))
    return rows.outcome(2e-7)


# Andrews' squeezer: seven bodies that a torque spins up in 30 ms

SQUEEZER_START = (
    -0.0617138900142764496, 0.0, 0.455279819163070380, 0.222668390165885885,
    0.487364979543842550, -0.222668390165885885, 1.23054744454982119,
)  # fmt: skip
"""The test set's seven angles at the start [rad]."""
SQUEEZER_PINS = "O", "P1", "B", "P5", "A_k5", "P7", "A_k7"
"""The pins that turn by them, in the drawing of `_squeezer`."""
SQUEEZER_ENDS = (
    15.81077119629904, -15.75637105984298, 0.04082224013073101, -0.5347301163226948,
    0.5244099658805304, 0.5347301163226948, 1.048080741042263,
)  # fmt: skip
"""The same after 30 ms [rad]: y(1) to y(7) of the reference solution."""
SQUEEZER_SPEEDS = (
    1139.920302151208, -1424.379294994111, 11.03291221937134, 19.29337464421385,
    0.5735699284790808, -19.29337464421385, 0.3231791658026955,
)  # fmt: skip
"""y(8) to y(14) [rad/s]."""


def _squeezer(torque: float) -> tuple[jp.Mechanism, dict]:
    """The mechanism, and its drive and spring; lengths as in the test set [m]."""
    beta, theta, gamma, phi, delta, omega, epsilon = SQUEEZER_START
    rr, d, e, zt, zf, u = 7e-3, 28e-3, 20e-3, 40e-3, 20e-3, 40e-3
    da, ea, fa = 11.5e-3, 14.21e-3, 14.21e-3
    quarter = math.pi / 2
    a, b, fixed = -0.06934 - 0.00227j, -0.03635 + 0.03273j, 0.014 + 0.072j
    away = {  # From the first point of each body towards its next.
        "k1": cmath.rect(1, beta), "k2": -cmath.rect(1, beta + theta),
        "k3": cmath.rect(1, gamma - quarter), "k4": cmath.rect(1, phi + delta - quarter),
        "k5": cmath.rect(1, delta), "k6": cmath.rect(1, omega + epsilon),
        "k7": cmath.rect(1, epsilon - quarter),
    }  # fmt: skip
    points = {"O": 0j, "A": a, "B": b, "P1": rr * away["k1"], "P5": a + zt * away["k5"]}
    points |= {"P7": a + u * away["k7"], "E": points["P1"] + d * away["k2"]}
    points["D"] = b + 0.02 * cmath.rect(1, gamma) + 0.018 * away["k3"]
    # Points, mass, inertia, and how far the centre is; where a body turns on a fixed pin, its
    # direction counts for nothing, for there is no gravity.
    bodies = {
        "k1": (["O", "P1"], 0.04325, 2.194e-6, 0.92e-3),
        "k2": (["P1", "E"], 0.00365, 4.410e-7, da),
        "k3": (["B", "E", "D"], 0.02373, 5.255e-6, math.hypot(18.74e-3, 10.43e-3)),
        "k4": (["P5", "E"], 0.00706, 5.667e-7, e - ea),
        "k5": (["A", "P5"], 0.07050, 1.169e-5, math.hypot(23.08e-3, 9.16e-3)),
        "k6": (["P7", "E"], 0.00706, 5.667e-7, zf - fa),
        "k7": (["A", "P7"], 0.05498, 1.912e-5, math.hypot(12.28e-3, 4.49e-3)),
    }
    links = {}
    for name, (joined, mass, inertia, reach) in bodies.items():
        centre = points[joined[0]] + reach * away[name]
        links[name] = jp.LinkageLink(
            joined, mass=mass, centre=(centre.real, centre.imag), inertia=inertia
        )
    linkage = jp.Linkage(
        points=_points(points), ground=["O", "A", "B"], links=links, output="k1",
        plane="horizontal",
    )  # fmt: skip
    mechanism = jp.Mechanism(linkage, gravity=(0, 0, 0))
    arm = points["D"] - b
    spring = jp.loads.Spring(
        "k3", 4530.0, 0.07785, at=(arm.real, arm.imag, 0), other_at=(fixed.real, fixed.imag, 0)
    )
    drive = dict.fromkeys(mechanism.joints, jp.loads.Free())
    drive["O"] = jp.loads.Torque((0.0,), (torque,))
    return mechanism, {"drive": drive, "loads": {"spring": spring}}


@case(
    origin="literature",
    title="Andrews' squeezer",
    compared="Seven bodies, three loops and a spring, spun up by 33 mN m to 11000 turns a minute "
    "in 30 ms, against the reference solution of the Test Set for IVP Solvers ("
    "PSIDE on a Cray C90, tolerances 1e-14; github.com/rforge/bvpsolve, commit 0007f92, "
    "`pkg/deTestSet/src/Ex_andrews.f`, subroutine `andsoln`). A linkage drawn by points, ideal "
    "pins. rk4, step 1 µs; short form 4 µs.",
    measures="largest difference of the seven angles after 30 ms [rad]",
    wrong="torque larger by a thousandth",
)
def andrews_squeezer(quick: bool = False, wrong: bool = False) -> Outcome:
    mechanism, acting = _squeezer(0.033 * (1.001 if wrong else 1.0))
    result = jp.simulate(
        mechanism, duration=0.03, step=4e-6 if quick else 1e-6, record_every=500,
        integrator="rk4", **FREE | acting,
    )  # fmt: skip
    at = [mechanism.coordinate(name) for name in SQUEEZER_PINS]
    q, v = (result[name].values[-1, at] for name in "qv")
    rows = Rows("", "test set [rad]|.12g", "jointplay [rad]|.12g", "test set [rad/s]|.9g",
                "jointplay [rad/s]|.9g")  # fmt: skip
    names = ("β", "Θ", "γ", "Φ", "δ", "Ω", "ε")
    every = zip(names, SQUEEZER_ENDS, q + SQUEEZER_START, SQUEEZER_SPEEDS, v, strict=True)
    for name, angle, ours, speed, rate in every:
        rows.add(name, angle, ours, speed, rate, errors=(abs(ours - angle),))
    return rows.outcome(1e-8)


# Modelica's backlash

TEETH = {"play": math.pi / 4, "stiffness": 20e3, "damping": 50.0}
WHEEL = 5.0
"""[kg m^2]."""
WOUND = math.pi / 2
"""Angle at the start [rad]."""
MODELICA = (
    # t [s], elastoBacklash.phi_rel [rad]
    (0.005, 1.51334093681637), (0.01, 1.3502862101149), (0.015, 1.10255540048586),
    (0.02, 0.798241640172016), (0.025, 0.469435217712844), (0.03, 0.138452742831078),
    (0.0375, -0.35802096949157), (0.04, -0.52282645898749), (0.05, -1.07836432626739),
    (0.06, -1.32862334706559), (0.07, -1.21052326865712), (0.08, -0.802594865159773),
    (0.09, -0.279106318462485), (0.92, 0.406264067583985), (0.95, 0.195576152919408),
    (1.0, -0.155570367236903),
)  # fmt: skip
TOUCHED = 0.038
"""When the wheel meets the other side for the first time [s]."""


def backlash_law(time, q, v, p, out):
    """Modelica's torque: the damper never pulls, nor pushes more than the spring does."""
    side = 1.0 if q[0] > 0.0 else -1.0
    depth = abs(q[0]) - 0.5 * p[0]
    spring, damper = p[1] * depth, p[2] * side * v[0]
    out[0] = -side * max(spring + min(spring, damper), 0.0) if depth > 0.0 else 0.0


@case(
    origin="commercial code",
    title="Modelica's backlash",
    compared="`Modelica.Mechanics.Rotational.Examples.Backlash`: a wheel behind a play of 45°, "
    "released from 90°. Angle against the reference result that the Modelica Association keeps "
    "(Dymola 2020x, Dassl at 1e-6; github.com/modelica/MAP-LIB_ReferenceResults, commit 668b76c, "
    "`elastoBacklash.phi_rel`). Until the wheel first meets the other side (38 ms) by a `Gear` "
    "between two free bodies of twice the inertia, which move relative to each other as "
    "the wheel does; over 1 s with `ElastoBacklash`'s law as a controller of the user's own. "
    "rk4, step 10 µs; short form: 0.1 s.",
    measures="largest difference of the angle [rad]",
    wrong="play larger by 1 %",
)
def modelica_backlash(quick: bool = False, wrong: bool = False) -> Outcome:
    teeth = TEETH | ({"play": 1.01 * TEETH["play"]} if wrong else {})
    duration = 0.1 if quick else 1.0

    def turned(inertia: float, state: dict, until: float, **more) -> tuple[np.ndarray, ...]:
        robot = urdf(body("wheel", inertia=inertia), joint("pin", "base", "wheel", "continuous"))
        gears = more.pop("gears", {})
        mechanism = jp.Mechanism(robot, gears=gears, gravity=(0, 0, 0))
        result = jp.simulate(
            mechanism, duration=until, step=1e-5, record_every=50, integrator="rk4", state=state,
            **FREE, **more,
        )  # fmt: skip
        angles = dict(zip(mechanism.coordinates, result["q"].values.T, strict=True))
        return result.time, angles["pin"] - angles.get("pin.motor", 0.0)

    gear = jp.Gear(rotor_inertia=2 * WHEEL, **teeth)
    law = jp.loads.Controller(["pin"], backlash_law, tuple(teeth[k] for k in
                              ("play", "stiffness", "damping")))  # fmt: skip
    apart = {"pin": WOUND, "pin.motor": 0.0}
    geared = turned(2 * WHEEL, apart, TOUCHED, gears={"pin": gear})
    written = turned(WHEEL, {"pin": WOUND}, duration, loads={"law": law})
    rows = Rows("time [s]|g", "Modelica [rad]|.6f", "`Gear`", "its law here [rad]|.6f")
    for time, theirs in MODELICA:
        if time <= duration:
            ours = float(np.interp(time, *written))
            cell, errors = "", [abs(ours - theirs)]
            if time < TOUCHED:
                found = float(np.interp(time, *geared))
                cell = f"{found:.6f}"
                errors.append(abs(found - theirs))
            rows.add(time, theirs, cell, ours, errors=errors)
    return rows.outcome(
        5e-5, None,
        "At a touch `ElastoBacklash` lets the damper push no more than the spring; teeth of a "
        "`Gear` push with all of their damping, as `ElastoBacklash2` does, for which no "
        "result is kept.",
    )  # fmt: skip
