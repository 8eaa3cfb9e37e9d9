"""Allocation of clearances."""

import numpy as np
import pytest
from conftest import body, joint, tip

from jointplay import Gear, JointplayError, Mechanism, Motion, RevoluteClearance
from jointplay.cli import main
from jointplay.design.allocation import allocate
from jointplay.design.static_budget import budget
from jointplay.study.courses import dynamic_error, fitting_step


@pytest.fixture
def arm(urdf):
    """Two joints about z and one across, half a metre each."""
    return urdf(
        body("one"),
        body("two"),
        body("three"),
        joint("a", "base", "one"),
        joint("b", "one", "two", at="0.5 0 0"),
        joint("c", "two", "three", axis="0 1 0", at="0.5 0 0"),
        tip("three"),
    )


def planar(play=1e-4):
    return RevoluteClearance.planar(radial_clearance=play)


def robot(path, make=planar, **gears):
    return Mechanism(path, {name: make() for name in "abc"}, gears=gears)


def spatial():
    return RevoluteClearance(radial_clearance=1e-4, axial_clearance=2e-4)


def test_joints_that_weigh_alike_get_the_same_clearance(arm):
    # Discs about z and about y share the x axis, along which all three add up alike.
    found = allocate(robot(arm), {}, 3e-5, cost="reciprocal")
    assert found.clearance == pytest.approx([1e-5] * 3, rel=1e-2)
    assert found.error == pytest.approx(3e-5, rel=1e-3)


def test_the_optimum_is_the_known_one_for_weights(arm):
    # Cost sum w/c with sum c = t: c in proportion to the root of w.
    found = allocate(robot(arm), {}, 4e-5, weights={"a": 4.0}, least=1e-6)
    assert found.clearance == pytest.approx([2e-5, 1e-5, 1e-5], rel=1e-2)
    # Each micrometre saves the same cost by error, where the target decides.
    assert found.price / found.gain == pytest.approx([found.relief] * 3, rel=2e-2)


def test_the_price_of_the_target_is_what_a_wider_one_saves(arm):
    mechanism, pose = robot(arm, spatial), {"b": 0.6, "c": 0.4}
    one, other = (allocate(mechanism, pose, target) for target in (2e-3, 2.04e-3))
    saved = (one.total - other.total) / 40.0
    assert saved == pytest.approx(one.relief, rel=0.05)


@pytest.mark.parametrize("cost", ["reciprocal", "reciprocal-squared", "linear"])
def test_the_target_is_kept_and_used_up(arm, cost):
    mechanism = robot(arm, spatial)
    q = np.array([mechanism.configuration({"b": b, "c": c}) for b, c in ((0.4, 0.2), (1.5, -0.9))])
    found = allocate(mechanism, q, 1e-3, cost=cost)
    worst = budget(found.mechanism, q).worst.max()
    assert 0.999e-3 < worst <= 1e-3
    assert found.error == pytest.approx(worst)
    ratio = [one.ca / one.cr for one in found.mechanism.clearance.values()]
    assert ratio == pytest.approx([2.0] * 3)


@pytest.mark.parametrize("cost", ["reciprocal", "reciprocal-squared", "linear"])
def test_no_other_clearances_that_keep_the_target_are_cheaper(arm, cost):
    mechanism, pose = robot(arm, spatial), {"b": 0.6, "c": 0.4}
    found = allocate(mechanism, pose, 1e-3, cost=cost)
    power = {"reciprocal": -1, "reciprocal-squared": -2, "linear": 1}[cost]
    sign = -1.0 if cost == "linear" else 1.0
    cheapest = sign * np.sum(found.clearance**power)
    random = np.random.default_rng(0)
    for _ in range(8):
        other = found.clearance * np.exp(0.3 * random.normal(size=3))
        joints = mechanism.clearance.items()
        factors = other / 1e-4
        tried = mechanism.with_clearance(
            {name: one.scaled(f) for (name, one), f in zip(joints, factors, strict=True)}
        )
        # Scaled to just keep the target: errors are in proportion to the clearances.
        other *= 1e-3 / budget(tried, pose, second_order=False).worst[0]
        if other.min() < 2e-6:
            continue
        assert sign * np.sum(other**power) >= cheapest - 2e-3 * abs(cheapest)


def test_a_quantile_allows_more_than_the_worst_case_and_is_kept(arm):
    mechanism, pose = robot(arm, spatial), {"b": 0.6, "c": 0.4}
    worst = allocate(mechanism, pose, 1e-3)
    most = allocate(mechanism, pose, 1e-3, quantile=0.99)
    assert most.total < worst.total
    assert 0.99e-3 < most.error <= 1e-3 * (1 + 1e-9)
    low, high = most.spread
    assert low <= most.error <= high
    assert "quantile" in str(most)
    # States drawn anew, with other random numbers, keep it, too.
    from jointplay.design.levers import sources

    random, total = np.random.default_rng(99), 0.0
    plays = sources(most.mechanism, pose)
    for j in range(len(plays.names)):
        d = random.normal(size=(1, 20000, 3))
        d /= np.linalg.norm(d, axis=2, keepdims=True)
        total = total + plays.subset([j]).along(d).error[0, 0, :, :3]
    assert np.quantile(np.linalg.norm(total, axis=1), 0.99) == pytest.approx(1e-3, rel=0.03)


def test_a_target_that_all_keep_leaves_all_at_the_most(arm):
    found = allocate(robot(arm), {}, 1e-2, most=1e-4)
    assert found.bound == ("most",) * 3
    assert found.clearance == pytest.approx([1e-4] * 3)


def test_an_unreachable_target_says_what_can_be_reached(arm):
    with pytest.raises(
        JointplayError, match=r"with 5 um in every joint the error is 15(\.\d*)? um"
    ):
        allocate(robot(arm), {}, 1e-5, least=5e-6)
    with pytest.raises(JointplayError, match="cannot be reached"):
        allocate(robot(arm, a=Gear(1e-3, 0.1, 1e4)), {}, 1e-4)


def test_the_play_of_gears_is_taken_off_the_target(arm):
    gear = Gear(1e-4, 0.1, 1e4)  # 75 um at the tool
    free, geared = (allocate(robot(arm, **g), {}, 2e-4) for g in ({}, {"a": gear}))
    assert geared.clearance.sum() < free.clearance.sum()
    assert geared.error <= 2e-4


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"target": 0.0}, "target must be greater than zero"),
        ({"quantile": 1.0}, "quantile must lie between"),
        ({"cost": "cubic"}, "no cost 'cubic'; available: reciprocal"),
        ({"weights": {"z": 1.0}}, "no joint with clearance 'z'; available: a, b, c"),
        ({"least": 1e-3, "most": 1e-4}, "must be below the most"),
        ({"cost": "linear", "quantile": 0.9}, "worst case only"),
    ],
)
def test_allocations_refuse_what_cannot_be(arm, options, message):
    with pytest.raises(JointplayError, match=message):
        allocate(robot(arm), {}, **({"target": 1e-4} | options))


def test_slow_dynamic_runs_keep_the_static_bound_but_for_penetration(arm):
    mechanism = Mechanism(arm, {"b": spatial()})
    motion = Motion(["a", "b", "c"], [0.0, 0.4], [[0.0, 0.3, 0.2], [0.0, 0.35, 0.2]])
    seen = dynamic_error(mechanism, motion, runs=1)
    q = mechanism.configuration({"b": 0.3, "c": 0.2})
    worst = float(budget(mechanism, q).worst[0])
    assert 0.2 * worst < seen.peak.max() < 1.1 * worst
    assert "simulated: 1 perturbed run," in str(seen)
    assert seen.step == fitting_step(mechanism, q)


def test_the_command_prints_the_table_and_writes_files(arm, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(["allocate", str(arm), "--target", "0.5 mm", "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "static worst case" in text
    assert "a target one um wider saves" in text
    assert (out / "allocation.csv").read_text().count("\n") == 4
    assert (out / "allocation.png").stat().st_size > 5000


def test_the_command_says_that_verification_needs_a_motion(arm, capsys):
    assert main(["allocate", str(arm), "--target", "0.5 mm", "--verify"]) == 2
    assert "--verify simulates a motion" in capsys.readouterr().err
