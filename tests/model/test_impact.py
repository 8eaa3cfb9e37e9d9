"""What is foretold of an impact, against closed forms and against the impact itself."""

import math

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.model.impact import (
    contact_duration,
    effective_mass,
    impact_depth,
    impact_duration,
)

PLAY = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)
K = PLAY.hertz_stiffness
MASS, INERTIA = 2.0, 1e-4  # a turning mass so light that rims give way


@pytest.mark.parametrize("speed", [1e-3, 0.1, 2.0])
@pytest.mark.parametrize("mass", [0.1, 50.0])
def test_depth_and_duration_are_the_closed_forms(mass, speed):
    hertz = (5.0 * mass * speed**2 / (4.0 * K)) ** 0.4
    assert impact_depth(jp.contact.Hertz(), (K,), mass, speed) == pytest.approx(hertz, rel=1e-5)
    exact = 2.9432 * hertz / speed
    assert impact_duration(jp.contact.Hertz(), (K,), mass, speed) == pytest.approx(exact, rel=0.025)
    spring = math.sqrt(mass / 1e8)
    assert impact_depth(jp.contact.LinearSpring(), (1e8,), mass, speed) == pytest.approx(
        speed * spring
    )
    exact = math.pi * spring
    assert impact_duration(jp.contact.LinearSpring(), (1e8,), mass, speed) == pytest.approx(
        exact, rel=0.05
    )


def no_force(delta, ddelta, ddelta0, p):
    return 0.0 * p[0]


def test_law_that_stores_nothing_stops_nothing():
    assert (
        impact_depth(jp.contact.CustomNormalForce(no_force, (1.0,)), (1.0,), 1.0, 0.1) == math.inf
    )


def point_mobility(com, point, normal, mass=MASS, inertia=INERTIA):
    """Compliance 1/m + |r x n|^2/I of a free body with an isotropic inertia [1/kg]."""
    return 1.0 / mass + np.sum(np.cross(point - com, normal) ** 2, axis=-1) / inertia


@pytest.mark.parametrize("com", [(0, 0, 0), (5e-3, 0, 0), (4e-3, -7e-3, 0.03)])
@pytest.mark.parametrize("yaw", [0.0, 0.7, -2.0])
@pytest.mark.parametrize("long", [40e-3, 12e-3])
def test_effective_mass_is_the_least_over_the_rims(urdf, com, yaw, long):
    bearing = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4, bearing_length=long)
    path = urdf(body("arm", MASS, "{} {} {}".format(*com), INERTIA), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, {"pin": bearing})
    phi = np.linspace(0.0, 2.0 * np.pi, 3601)
    around = np.stack([np.cos(phi), np.sin(phi), 0.0 * phi], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    softest = 0.0
    for side in (1.0, -1.0):
        end = side * 0.5 * bearing.lj * up
        # A frictionless radial force passes through the axis, so any point of its line will do.
        softest = max(softest, point_mobility(com, end, around).max())
        softest = max(softest, point_mobility(com, end + bearing.rj * around, up).max())
    found = effective_mass(robot, "pin", robot.configuration({"pin": yaw}))
    assert found == pytest.approx(1.0 / softest, rel=2e-3)


def test_bearing_on_a_slider_shares_the_blow(urdf):
    """Bodies too inert to turn meet with their reduced mass along the slider."""
    path = urdf(
        body("one", 3.0, inertia=1e4),
        body("two", 2.0, inertia=1e4),
        joint("s", "base", "one", "prismatic", axis="0 0 1"),
        joint("pin", "one", "two"),
    )
    robot = jp.Mechanism(path, {"pin": PLAY})
    found = effective_mass(robot, "pin", robot.configuration({}))
    assert found == pytest.approx(3.0 * 2.0 / 5.0, rel=1e-6)


@pytest.mark.parametrize("azimuth", [0.0, 2.0])
def test_blow_on_the_rim_meets_the_effective_mass(free_mass, azimuth):
    """A tilted body flies at the wall: one rim point, off the centre of mass by R_j."""
    tilt, speed = 4e-3, 0.05
    run = free_mass(
        normal=jp.contact.Hertz(),
        restitution=1.0,
        friction=jp.contact.Ambrosio(0.0),
        inertia=INERTIA,
        mass=MASS,
        offset=(0, 0, 1.55e-4, 0, tilt * math.cos(azimuth), tilt * math.sin(azimuth)),
        velocity=(0, 0, speed, 0, 0, 0),
        duration=5e-4,
        step=5e-7,
    )
    result = run.finish()
    assert result.audit.impacts == 1
    lever = PLAY.rj * math.cos(tilt) - 0.5 * PLAY.lj * math.sin(tilt)
    mass = 1.0 / (1.0 / MASS + lever**2 / INERTIA)
    depth = impact_depth(jp.contact.Hertz(), (K,), mass, speed)
    assert result.audit.largest_penetration == pytest.approx(depth, rel=5e-3)
    assert abs(impact_depth(jp.contact.Hertz(), (K,), MASS, speed) / depth - 1.0) > 0.2


def test_shortest_contact_is_that_of_the_stiffer_direction(urdf):
    path = urdf(body("arm", MASS), joint("pin", "base", "arm"))
    found = []
    for stiffness in ({}, {"axial_stiffness": 100.0 * K}, {"stiffness": 100.0 * K}):
        bearing = jp.RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4, **stiffness)
        robot = jp.Mechanism(path, {"pin": bearing})
        found.append(contact_duration(robot, "pin", robot.configuration({})))
    ratio = 100.0**-0.4
    assert found[1] == pytest.approx(ratio * found[0], rel=1e-4)
    assert found[2] == pytest.approx(ratio * found[0], rel=1e-4)
