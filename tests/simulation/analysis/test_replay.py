"""Runs repeated step by step."""

import numpy as np
import pytest

import jointplay as jp
from jointplay.paper import scara
from jointplay.simulation.analysis.replay import follow, largest_impacts, replay, window


@pytest.fixture(scope="module")
def played():
    made = scara(0.2e-3)
    return jp.simulate(made.mechanism, made.motion, duration=0.2, judge_from=0.0)


def test_windows_hold_every_step_and_the_same_bits(played):
    again = replay(played, [(0.1, 0.1005), (0.15, 0.1502)])
    assert again.faithful
    first, second = again.windows
    assert np.diff(first["time"].values) == pytest.approx(np.full(50, 1e-5))
    assert len(second["time"]) == 21
    shared = np.isin(np.rint(played.time / 1e-5), np.rint(first["time"].values / 1e-5))
    inside = first.isel(time=slice(None, None, 10))
    assert np.array_equal(played["q"].values[shared], inside["q"].values)
    counted = again.statistics["onsets"].sum()
    assert counted == played.audit.impacts


def test_largest_impacts_are_followed(played):
    chosen = largest_impacts(played, 3)
    peaks = [place.peak[i] for place, i in chosen]
    assert peaks == sorted(peaks, reverse=True)
    assert peaks[0] == played["normal_force_peak"].values.max()
    place, index = chosen[0]
    again = replay(played, [window(place, index, played.audit.step)])
    impact = follow(again.windows[0], place.joint, place.contact)
    assert impact.peak_force == pytest.approx(peaks[0], rel=1e-12)
    assert impact.steps > 10
    assert impact.penetration == pytest.approx(
        -played["gap_min"].sel(joint=place.joint, contact=place.contact).values.min(), rel=0.5
    )


def test_impact_has_the_restitution_of_its_law(urdf):
    """Separation over approach speed; the body's acceleration takes a few per cent of it."""
    from conftest import body, joint

    bearing = jp.RevoluteClearance.planar(
        radial_clearance=2e-4, restitution=0.8, friction=jp.contact.Ambrosio(0.0)
    )
    robot = jp.Mechanism(
        urdf(body("arm"), joint("pin", "base", "arm")), {"pin": bearing}, gravity=(-1e3, 0, 0)
    )
    free = {"drive": jp.loads.Free(), "joint_friction": {}, "start": "centred"}
    result = jp.simulate(robot, duration=2e-3, step=1e-6, **free)
    (place,) = [p for p in (largest_impacts(result, 1))]
    again = replay(result, [window(*place, result.audit.step)])
    impact = follow(again.windows[0], "pin", "radial")
    assert impact.complete
    expected = bearing.normal.effective_restitution(0.8)
    assert impact.separation_speed / impact.approach_speed == pytest.approx(expected, abs=0.05)


def test_a_run_without_records_cannot_be_repeated(played):
    empty = jp.Result(played.dataset.isel(time=slice(0, 1)))
    with pytest.raises(jp.JointplayError, match="cannot be repeated"):
        replay(empty, [])
