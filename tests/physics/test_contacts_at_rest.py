"""Contacts that began at rest: what they bear, how they are damped, what is recorded of them."""

import math

import numpy as np
import pytest
from conftest import body, joint
from scipy.integrate import solve_ivp

import jointplay as jp
from jointplay.physics.contact import NORMAL_LAWS
from jointplay.simulation.prepare import REST_SPEED

MASS, GRAVITY = 1.51, 9.80665
WEIGHT = MASS * GRAVITY
LAWS = ("lankarani-nikravesh", "flores", "zhang-sharf", "hunt-crossley", "johnson", "hertz")
METHODS = ("multi-rate", "semi-implicit-euler", "rk4")


@pytest.fixture
def hung(urdf):
    """A run of a body that hangs in its bearing, at rest, without friction."""

    def make(law="lankarani-nikravesh", *, down=(0.0, -1.0, 0.0), friction=0.0, restitution=0.6,
             gravity=GRAVITY, lock_tilt=False, **given):  # fmt: skip
        bearing = jp.RevoluteClearance(
            radial_clearance=2e-4,
            axial_clearance=2e-4,
            normal=NORMAL_LAWS[law](),
            restitution=restitution,
            lock_tilt=lock_tilt,
            friction=jp.contact.Ambrosio(friction),
        )
        path = urdf(body("arm", MASS), joint("pin", "base", "arm"))
        gravity = tuple(gravity * np.array(down))
        mechanism = jp.Mechanism(path, {"pin": bearing}, gravity=gravity)
        options = {"drive": {}, "duration": 0.01, "step": 1e-6, "start": "rest"} | given
        options = {"record_every": max(round(1e-5 / options["step"]), 1)} | options
        return jp.Run(jp.Simulation(mechanism, **options))

    return make


@pytest.mark.parametrize("down", [(0.0, -1.0, 0.0), (0.0, 0.0, -1.0)], ids=["on rims", "on wall"])
@pytest.mark.parametrize(
    ("method", "step"), [(name, 1e-6) for name in METHODS] + [("multi-rate", 1e-5), ("rk4", 1e-7)]
)
@pytest.mark.parametrize("law", LAWS)
def test_the_bearing_of_a_hanging_body_bears_its_weight_at_every_record(
    hung, law, method, step, down
):
    result = hung(law, integrator=method, step=step, down=down, duration=1e3 * step).finish()
    force = result["joint_force"].values[:, 0] @ -np.array(down)
    assert force.mean() == pytest.approx(WEIGHT, rel=1e-6)
    # The velocity solve's tolerance, as a momentum over half a step, is 6e-4 N at 10 us.
    assert np.abs(force - WEIGHT).max() < 5e-5 * WEIGHT
    peak = np.linalg.norm(result["joint_force_peak"].values[1:, 0], axis=1)
    assert np.abs(peak - WEIGHT).max() < 5e-5 * WEIGHT
    assert not [text for text in result.audit.warnings if "restitution" not in text]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", LAWS)
def test_the_mean_bearing_force_is_the_weight_where_a_step_cannot_follow_the_damping(
    hung, law, method
):
    result = hung(law, integrator=method, step=1e-5, record_every=1).finish()
    force = result["joint_force"].values[:, 0].mean(axis=0)
    assert force == pytest.approx([0.0, WEIGHT, 0.0], abs=1e-3 * WEIGHT)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("law", ["lankarani-nikravesh", "flores"])
def test_a_nudged_contact_is_a_viscous_damper_for_all_methods_alike(hung, law, method):
    """m d'' = m g - k d^1.5 (1 + a d'/v), v = REST_SPEED sqrt(4/5 k d^2.5/m), from |d'| = v/2."""
    run = hung(law, integrator=method, step=2e-7, duration=5e-4, record_every=10, lock_tilt=True)
    bearing = run.mechanism.clearance["pin"]
    stiffness, factor = bearing.normal.parameters(bearing.contact_properties(0))

    def reference(depth):
        return REST_SPEED * math.sqrt(0.8 * stiffness * depth**2.5 / MASS)

    nudge = 0.5 * reference((WEIGHT / stiffness) ** (2.0 / 3.0))
    run.workspace.v[1] = -nudge
    result = run.finish()
    found = -result["gap"].values[:, 0, 0]

    def slope(_, y):
        damping = 1.0 + factor * y[1] / max(reference(y[0]), abs(y[1]))
        return y[1], GRAVITY - stiffness * y[0] ** 1.5 * damping / MASS

    span, start = (0.0, result.time[-1]), (found[0], nudge)
    exact = solve_ivp(slope, span, start, "LSODA", result.time, rtol=1e-10, atol=1e-18).y[0]
    undamped = nudge / math.sqrt(1.5 * stiffness * math.sqrt(found[0]) / MASS)
    assert np.ptp(exact) < 0.8 * undamped
    tolerance = 3e-2 if method == "semi-implicit-euler" else 1e-3
    assert np.abs(found - exact).max() < tolerance * np.ptp(exact)


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("speed", [1e-4, 0.02])
def test_recorded_forces_are_the_change_of_momentum_and_the_impulse_of_the_weight(
    hung, method, speed
):
    """Falling, bouncing, sliding and at rest: the sum of F dt, by the rule of the method."""
    given = {"integrator": method, "step": 2e-6, "duration": 0.03, "record_every": 1}
    run = hung(down=(0.6, -0.64, -0.48), friction=0.2, start="centred", **given)
    run.workspace.v[:3] = speed
    result = run.finish()
    force, step = result["joint_force"].values[:, 0], 2e-6
    taken = {
        "multi-rate": 0.5 * (force[1:] + force[:-1]),  # half a step before and after
        "semi-implicit-euler": force[:-1],  # the step after
        "rk4": force[1:],  # the step before
    }[method]
    velocity = result["v"].values[:, :3]
    weight = WEIGHT * np.array([0.6, -0.64, -0.48])
    left = MASS * (velocity[-1] - velocity[0]) - weight * result.time[-1] - step * taken.sum(axis=0)
    assert result.audit.impacts > 3
    assert np.abs(left).max() < 1e-9 * WEIGHT * result.time[-1]


@pytest.mark.parametrize("c_e", [0.9, 0.3])
def test_an_impact_is_damped_by_its_approach_speed_alone(hung, c_e):
    """Of the heaviest mass that a bearing knows, and of one 100 times heavier than the start's."""
    for heavier in (1.0, 100.0):
        run = hung(start="centred", duration=6e-3, lock_tilt=True, restitution=c_e, gravity=0.0)
        run.workspace.v[0] = 0.1
        run.workspace.joints["rest_mass"] /= heavier
        run.begin()
        contact, seen = run.workspace.contacts[0, 0], 0
        while run.advance(1) and contact["onsets"] + contact["ended"] < 2:
            if contact["touching"]:
                seen += 1
                assert contact["reference"] == contact["approach"]
        assert seen > 100
