"""The audit: what it counts, and when it warns."""

import math

import numpy as np
import pytest
from conftest import body, joint, still

import jointplay as jp
from jointplay.model.impact import friction_step_limit
from jointplay.simulation.result import Audit

MASS, SPEED = 2.0, 0.2
GOOD = Audit(
    energy_residual=1e-4,
    energy_exchanged=1.0,
    impacts=5,
    shortest_contact_steps=30,
    under_resolved=0,
    under_resolved_impulse=0.0,
    normal_impulse=2.0,
    largest_penetration=1e-6,
    penetration_over_clearance=0.01,
    step=1e-5,
    friction_step_limit=2e-5,
)


def bouncing(free_mass, **options):
    """A frictionless elastic body flying to and fro between both end walls."""
    elastic = {
        "normal": jp.contact.Hertz(),
        "restitution": 1.0,
        "friction": jp.contact.Ambrosio(0.0),
    }
    return free_mass(velocity=(0, 0, SPEED, 0, 0, 0), mass=MASS, **(elastic | options)).finish()


def test_impacts_impulse_and_depth_of_a_bouncing_mass(free_mass):
    result = bouncing(free_mass, duration=12e-3, record_every=1)
    audit = result.audit
    turns = np.count_nonzero(np.diff(np.sign(result["v"].values[:, 2])))
    assert audit.impacts == turns > 4
    assert audit.normal_impulse == pytest.approx(2.0 * MASS * SPEED * turns, rel=2e-3)
    joint = result.simulation.mechanism.clearance["pin"]
    depth = (5.0 * MASS * SPEED**2 / (4.0 * joint.hertz_stiffness)) ** 0.4
    assert audit.largest_penetration == pytest.approx(depth, rel=2e-3)
    assert audit.penetration_over_clearance == pytest.approx(depth / joint.ca, rel=2e-3)
    assert audit.energy_exchanged == pytest.approx(MASS * SPEED**2 * turns, rel=0.02)
    steps = 2.9432 * depth / SPEED / 1e-6
    assert audit.shortest_contact_steps == pytest.approx(steps, abs=3)
    assert audit.under_resolved == 0
    assert not audit.warnings


def test_contact_that_still_lasts_has_begun_but_not_ended(free_mass):
    audit = bouncing(free_mass, offset=(0, 0, 1.99e-4, 0, 0, 0), duration=5e-5).audit
    assert (audit.impacts, audit.shortest_contact_steps) == (1, 0)
    assert 0.0 < audit.normal_impulse < MASS * SPEED


DOUBTS = [
    ({"energy_residual": 0.0099}, {"energy_residual": 0.011}, "energy balance is off by 1.1 %"),
    ({"energy_residual": 0.0198, "energy_exchanged": 2.0}, {"energy_residual": math.nan}, "nan %"),
    ({}, {"energy_exchanged": 0.0}, "energy balance is off by inf %"),
    (
        {"under_resolved": 1, "under_resolved_impulse": 0.99e-3},
        {"under_resolved": 2, "under_resolved_impulse": 1.01e-3},
        "2 of 5 contacts lasted fewer",
    ),
    ({"unsolved": 10}, {"unsolved": 11}, "velocity equations of 11 steps"),
    ({"unresolved": 0}, {"unresolved": 1}, "1 of the shortest micro steps did not reach"),
    ({"friction_fed": 0.0099}, {"friction_fed": 0.0101}, "friction returned 0.0101 J"),
    ({"penetration_over_clearance": 0.49}, {"penetration_over_clearance": 0.51}, "51 % of its"),
    (
        {"relative_step_error": 0.01, "step_error": 1.0},
        {"relative_step_error": 0.0101, "step_error": 8e-3},
        "tool is off by about 0.008 m",
    ),
    ({}, {"relative_step_error": 0.09}, "results: all coordinates by 9 %"),  # a file edited
    ({}, {"step_error": math.inf, "relative_step_error": math.inf}, "the run ends differently"),
    ({"tooth_steps": 10.0}, {"tooth_steps": 9.9}, "gear teeth last 9.9 steps"),
    (  # another step gives the same
        {"tooth_steps": 6.0, "relative_step_error": 0.0, "step_error": 0.0},
        {"tooth_steps": 6.0},
        "gear teeth last 6 steps",
    ),
    ({"friction_step_limit": 1e-5}, {"friction_step_limit": 0.99e-5}, "does not follow friction"),
    ({"loop_drift": 1e-6}, {"loop_drift": 1.01e-6}, "ideal loops drifted apart"),
]


@pytest.mark.parametrize(("below", "above", "said"), DOUBTS)
def test_each_doubt_is_voiced_once_beyond_its_limit(below, above, said):
    sound, doubtful = (Audit(**(GOOD.describe() | change)) for change in (below, above))
    assert sound.warnings == []
    assert "warning" not in str(sound)
    (warning,) = doubtful.warnings
    assert said in warning
    assert f"warning: {warning}" in str(doubtful)


def test_nothing_that_moves_has_nothing_to_balance(urdf):
    path = urdf(body("arm", 2.0, "0.1 0 0"), joint("pin", "base", "arm"))
    robot = jp.Mechanism(path, gravity=(0, 0, 0))
    audit = jp.simulate(robot, still(robot, 0.01)).audit
    assert audit.relative_energy_residual == 0.0
    assert audit.impacts == 0
    assert "contacts" not in str(audit)


def test_under_resolved_contacts_are_counted_and_warned_of(free_mass):
    run = free_mass(
        offset=(0, 0, 1.9e-4, 0, 0, 0), velocity=(0, 0, 0.1, 0, 0, 0), step=4e-5, duration=4e-3
    )
    audit = run.finish().audit
    assert audit.under_resolved == audit.impacts > 0
    assert audit.shortest_contact_steps < 10
    assert any("fewer than 10 steps" in text for text in audit.warnings)


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({}, "starts centred"),
        (
            {"start": "rest", "start_residual": 1e-8, "start_load": 72.41, "peak_force": 82.7},
            "starts at rest (residual force 1e-08 N of 72.4 N); largest joint force "
            "82.7 N, judged from the start",
        ),
        (
            {"start_residual": 0.2, "start_load": 3.0},
            "starts centred, because no equilibrium was found (residual force 0.2 N of 3.00 N)",
        ),
        (
            {"start_residual": math.inf, "start_load": math.inf, "peak_force": 4.0},
            "starts centred, because the search for an equilibrium diverged; largest joint force "
            "4.00 N, judged from the start, with the fall of the journals",
        ),
        (
            {"judged_from": 0.5, "judged_impacts": 3, "peak_force": 4.0, "peak_force_before": 9.0},
            "starts centred; from 0.5 s on, 3 contacts began, largest joint force 4.00 N "
            "(before: 9.00 N)",
        ),
    ],
)
def test_headline_says_how_the_run_began_and_what_is_judged(change, line):
    audit = Audit(**(GOOD.describe() | change))
    assert audit.headline_with(None) == line
    assert (line in str(audit)) == (audit.peak_force is not None)


def test_figures_are_printed_with_their_units():
    change = {"step_error": 2e-3, "relative_step_error": 0.005, "loop_drift": 5e-7}
    assert str(Audit(**(GOOD.describe() | change))).splitlines() == [
        "  energy residual: 100 µJ, 0.01 % of 1 J exchanged",
        "  contacts: 5, shortest 30 steps, 0 under 10 steps",
        "  largest penetration: 1 µm, 1 % of the clearance",
        "  error by the step: tool 2 mm, 0.5 % of the motion",
        "  drift of ideal loops: 500 nm",
    ]


def test_largest_force_of_any_contact_asks_for_the_smallest_explicit_step(free_mass):
    """Friction's limit falls with the normal force: the peak counts, not a typical record."""
    hard = bouncing(
        free_mass,
        duration=5e-3,
        friction=jp.contact.Ambrosio(0.1),
        integrator="semi-implicit-euler",
        record_every=1,
    )
    peak = float(hard["normal_force_peak"].max())
    mechanism = hard.simulation.mechanism
    q = hard["q"].values[0]
    assert hard.audit.friction_step_limit == friction_step_limit(mechanism, "pin", q, peak)
