"""Impacts in a row, and impacts of a spinning journal, against rigid-body mechanics."""

from __future__ import annotations

import math

import numpy as np
from robots import FREE, body, joint, urdf
from truth.validation import Outcome, Rows, case, off

import jointplay as jp

MASS, INERTIA = 2.0, 1e-2
"""Of the free disc [kg, kg m^2]."""


def disc(
    bearing: jp.RevoluteClearance,
    gravity: tuple[float, float, float] = (0, 0, 0),
    mass: float = MASS,
    moment: float = INERTIA,
) -> jp.Mechanism:
    """A disc free in the plane: ideal joints x, y and turn carry it, `pin` is its bearing."""
    path = urdf(
        body("cross", 0.0, inertia=0.0), body("slide", 0.0, inertia=0.0),
        body("disc", mass, inertia=moment),
        joint("x", "base", "cross", "prismatic", axis="1 0 0"),
        joint("y", "cross", "slide", "prismatic", axis="0 1 0"),
        joint("turn", "slide", "disc", "continuous"),
    )  # fmt: skip
    loop = jp.Loop("base", "disc")
    return jp.Mechanism(path, {"pin": bearing}, loops={"pin": loop}, gravity=gravity, tool="disc")


@case(
    origin="theory",
    title="Bouncing in the bore",
    compared="A disc falls from the middle of its bearing (2 mm of clearance, k = 1e13 N/m^1.5) "
    "and bounces; with Zhang and Sharf's law, which delivers the nominal restitution. "
    "Each flight is shorter than the one before by the factor c_e, after n bounces by "
    "c_e^n. rk4.",
    measures="largest error of a flight's duration, over the first flight's",
    wrong="the flights shorten by c_e^2",
)
def bouncing(quick: bool = False, wrong: bool = False) -> Outcome:
    fall, g = 2e-3, 9.81
    flights = 2 if quick else 5
    rows = Rows("c_e|g", "flight|d", "duration [ms]|.3f", "theory [ms]|.3f")
    for c_e in (0.8,) if quick else (0.9, 0.7, 0.5):
        bearing = jp.RevoluteClearance.planar(
            bearing_radius=0.05, radial_clearance=fall, stiffness=1e13, restitution=c_e,
            normal=jp.contact.ZhangSharf(), friction=jp.contact.Coulomb(0.0, 1e-3),
        )  # fmt: skip
        arrives = math.sqrt(2 * g * fall)
        last = arrives / g * (1 + 2 * sum(c_e**n for n in range(1, flights + 1))) + 2e-3
        result = jp.simulate(
            disc(bearing, (0, -g, 0)), duration=last, step=4e-7, integrator="rk4",
            record_every=5, **FREE,
        )  # fmt: skip
        gap, time = result["gap"].values[:, 0, 0], result.time
        # Where the gap crosses zero between two records.
        down, up = ((gap[:-1] > 0) & (gap[1:] <= 0)), ((gap[:-1] <= 0) & (gap[1:] > 0))
        lands, leaves = (
            time[:-1][at] + np.diff(time)[at] * gap[:-1][at] / (gap[:-1][at] - gap[1:][at])
            for at in (down, up)
        )
        for n in range(1, flights + 1):
            lasts = lands[n] - leaves[n - 1]
            theory = 2 * arrives / g * (c_e ** (2 * n) if wrong else c_e**n)
            error = abs(lasts - theory) / (2 * arrives / g * c_e)
            rows.add(c_e, n, 1e3 * lasts, 1e3 * theory, errors=(error,))
    note = "The weight also acts during an impact, so the remaining difference grows with n."
    return rows.outcome(1e-2, None, note)


@case(
    origin="theory",
    title="Impact of a spinning disc",
    compared="A spinning disc falls on its bore and slides during the whole impact. Its impulse is "
    "m (1 + e) v along the normal and mu times that across: the disc leaves with the sideways "
    "speed mu (1 + e) v and has lost mu (1 + e) v m R/I of its spin. mu = 0.05 to 0.2, Coulomb's "
    "law with a ramp of 1 mm/s; rk4.",
    measures="largest relative error of sideways speed and lost spin",
    wrong="the impulse is m v: it stops the disc, without rebound",
)
def spinning_impact(quick: bool = False, wrong: bool = False) -> Outcome:
    e, spin, fall, g = 0.6, 50.0, 2e-3, 9.81
    speed = math.sqrt(2 * g * fall)
    rows = Rows("mu|g", "sideways speed [mm/s]|.4f", "theory|.4f", "lost spin [rad/s]|.5f",
                "theory|.5f")  # fmt: skip
    for mu in (0.1,) if quick else (0.05, 0.1, 0.2):
        bearing = jp.RevoluteClearance.planar(
            bearing_radius=0.05, radial_clearance=fall, stiffness=1e13, restitution=e,
            normal=jp.contact.ZhangSharf(), friction=jp.contact.Coulomb(mu, 1e-3),
        )  # fmt: skip
        result = jp.simulate(
            disc(bearing, (g, 0, 0)), duration=speed / g + 1e-3, step=4e-7, integrator="rk4",
            record_every=100, state={"turn": (None, spin)}, **FREE,
        )  # fmt: skip
        _, sideways, turning = result["v"].values[-1]
        impulse = (1.0 if wrong else 1.0 + e) * speed
        lost = mu * impulse * MASS * bearing.rj / INERTIA
        away, gone = mu * impulse, spin - turning
        errors = off(abs(sideways), away), off(gone, lost)
        rows.add(mu, 1e3 * abs(sideways), 1e3 * away, gone, lost, errors=errors)
    return rows.outcome(2e-3)
