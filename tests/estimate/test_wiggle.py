"""Wiggle test: the two-inertia joint against `Simulation`, and what logs tell of play."""

import os
import platform
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.estimate import wiggle
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint, limit
from jointplay.estimate.wiggle import Known, ServoLog, wiggle_goal
from jointplay.estimate.wiggle_logs import FACTOR, Wiggle, change_of, ends_by, told_of
from jointplay.estimate.wiggle_profile import Profile
from jointplay.simulation.loads import JointFriction, Servo

SERVO = Servo.of(
    "STS3215", voltage=7.4, p_gain=30.0, resolution=2.0 * np.pi / 4096.0, dead_band_counts=1.0
)
PLAYS = (0.0, 0.3, 0.8, 1.4)
ROTOR, LINK, PLAY = 0.0284, 0.02, np.radians(0.6)


@pytest.mark.parametrize(
    "changes",
    [
        {"encoder": "link", "resolution": 0.0, "dead_band_counts": 0.0},
        {"encoder": "motor", "d_gain": 0.5},
        {"encoder": "motor", "period": 2e-3},
    ],
    ids=["output", "motor", "sampled"],
)
def test_two_inertias_move_as_in_the_full_simulation(urdf, changes):
    servo = replace(SERVO, **changes)
    disc = urdf(body("disc", 1.0, "0 0 0", LINK), joint("a", "base", "disc", "continuous"))
    gear = jp.Gear(play=PLAY, rotor_inertia=ROTOR, stiffness=120.0, damping=0.4)
    goals = np.radians([[0.0], [3.0], [-3.0], [3.0], [3.0]])
    motion = jp.Motion(["a"], [0.0, 0.12, 0.3, 0.5, 0.6], goals, interpolation="spline")
    mechanism = jp.Mechanism(disc, gears={"a": gear})
    losses = {"a": JointFriction(0.02)}
    result = jp.simulate(
        mechanism, motion, drive=servo, joint_friction=losses, step=1e-5, record_every=100,
        estimate=False,
    )  # fmt: skip
    numbers = {"play": PLAY, "stiffness": 120.0, "damping": 0.4, "link_friction": 0.02}
    now = np.arange(601) * RECORD_S
    goal = motion(np.minimum(now + 0.5 * RECORD_S, 0.6))[0][:, 0]  # held for a record
    own = ServoJoint.of(servo, ROTOR, LINK, **numbers).move(goal)
    for angle, at in zip(own, (mechanism.motor("a"), mechanism.coordinate("a")), strict=True):
        there = np.interp(now, result.time, result["q"].values[:, at])
        assert np.ptp(there) > np.radians(1.5)
        assert np.abs(angle - there).max() < 0.01 * np.ptp(there)


OUTPUT = replace(SERVO, encoder="link", period=1e-3)
KNOWN = Known(OUTPUT, ROTOR, LINK)


def log_of(play, *, rate=100.0, stiffness=300.0, servo=OUTPUT, inertia=LINK, most=np.inf, load=0.0):
    """What the servo of a joint of such a play reports of its wiggle; its goals' acceleration is
    limited by `most`."""
    numbers = {"play": play, "stiffness": stiffness, "damping": 0.4, "link_friction": 0.03}
    numbers["load"] = load
    times, goals = wiggle_goal(servo.encoder)
    now = np.arange(0.0, times[-1] + 0.6, RECORD_S)
    goal = np.interp(now - 0.3, times, goals)
    passed = goal.copy()
    if np.isfinite(most):
        limit(goal, most, passed)
    angles = ServoJoint.of(servo, ROTOR, inertia, **numbers).move(passed)
    seen_by = angles[0 if servo.encoder == "motor" else 1]
    read = np.arange(0.0, now[-1], 1.0 / rate)
    count = servo.resolution
    seen = np.round(np.interp(read, now, seen_by) / count) * count
    return ServoLog("elbow", read, np.interp(read - 0.3, times, goals), seen)


def play_of(log, known):
    return told_of(Wiggle(log, known))[0]


def band(log, known):
    return ends_by(Wiggle(log, known))["gear_play"]


@pytest.mark.parametrize("encoder", ["link", "motor"])
def test_the_wiggle_is_small_and_lasts_from_4_to_10_seconds(encoder):
    times, goals = wiggle_goal(encoder)
    assert 4.0 <= times[-1] <= 10.0
    assert (np.diff(times) > 0.0).all()
    assert np.abs(goals).max() == pytest.approx(np.radians(3.0))
    assert goals[0] == goals[-1] == 0.0
    speeds = np.abs(np.diff(goals) / np.diff(times))
    assert len(np.unique(np.round(np.degrees(speeds)))) >= 5


def test_a_band_is_in_tenths_of_a_degree_and_holds_the_play():
    told = [play_of(log_of(np.radians(play)), KNOWN) for play in PLAYS]
    for play, one in zip(PLAYS, told, strict=True):
        low, high = band(log_of(np.radians(play)), KNOWN)
        assert low <= np.radians(play) <= high
        for end in (low, high):
            assert np.isinf(end) or 10.0 * np.degrees(end) == pytest.approx(
                round(10.0 * np.degrees(end))
            )
        if not one.reason:
            assert one.unknown.name == "gear_play"
            assert one.interval == (low, high)
            assert one.found == (low > 0.0)


def test_where_the_joint_stands_and_when_its_log_begins_do_not_matter():
    log = log_of(np.radians(1.4))
    there = replace(log, time=log.time + 1e3, goal=log.goal + 0.7, position=log.position + 0.7)
    assert band(there, KNOWN) == pytest.approx(band(log, KNOWN))


def test_small_play_is_bounded_above_and_large_play_below():
    small, large = (play_of(log_of(np.radians(x)), KNOWN) for x in (0.1, 1.6))
    assert not small.found
    assert np.radians(0.1) <= small.upper <= np.radians(0.7)
    assert large.low >= np.radians(0.5)
    assert "inf" not in large.words()[0]


@pytest.mark.parametrize("friction", [0.5, 1.0, 2.0])
def test_the_motors_friction_is_told_and_what_is_too_wide_is_not(friction):
    servo = replace(OUTPUT, friction=friction * OUTPUT.friction)
    _, rubs, gives = told_of(Wiggle(log_of(np.radians(0.4), servo=servo), KNOWN))
    assert rubs.label == "elbow servo friction"
    assert rubs.low <= servo.friction <= rubs.high
    assert gives.low <= 1.0 / 300.0 <= gives.high
    for one in (rubs, gives):
        assert bool(one.reason) == (one.high > FACTOR * one.low)
        assert one.reason == "" or "would look alike in this log" in str(one)


def change(before, after, known=KNOWN, **changes):
    logs = [log_of(np.radians(play), **changes) for play in (before, after)]
    return np.degrees(change_of(*(Wiggle(log, known) for log in logs)))


@pytest.mark.parametrize(("before", "after"), [(0.1, 1.4), (1.4, 0.1), (0.6, 0.6), (0.2, 0.9)])
def test_a_change_of_play_is_told_by_two_logs_together(before, after):
    low, high, least = change(before, after)
    assert low <= after - before <= high
    assert change(after, before)[:2] == pytest.approx([-high, -low])
    assert low <= least <= high
    assert (least > 0.0) == (after > before)  # it is told that there is growth, not how much
    if abs(after - before) > 1.0:
        assert low * high > 0.0


def test_a_change_is_told_closer_than_by_two_bands():
    bands = [np.degrees(band(log_of(np.radians(play)), KNOWN)) for play in (0.6, 0.9)]
    low, high, _ = change(0.6, 0.9)
    widest = min(bands[1][1], 1.65) - bands[0][0] - (bands[1][0] - min(bands[0][1], 1.65))
    assert high - low < 0.8 * widest


def test_joints_of_which_nothing_is_known_tell_nothing():
    one = Wiggle(log_of(0.01))
    assert "no servo with gains" in told_of(one)[0].reason
    with pytest.raises(wiggle.Untold, match="no servo with gains"):
        change_of(one, one)


HEAVY = Known(replace(SERVO, resolution=SERVO.resolution / 100.0, period=1e-3), ROTOR, 2.5 * ROTOR)


@pytest.mark.parametrize(("play", "most"), [(0.2, np.inf), (0.9, 20.0)])
def test_with_the_encoder_on_the_motor_a_heavy_link_shows_its_play(play, most):
    """Though the firmware softens the goals and half of what is known is a little off."""
    log = log_of(np.radians(play), servo=HEAVY.servo, inertia=2.6 * ROTOR, most=most)
    low, high = band(log, HEAVY)
    assert low <= np.radians(play) <= high
    assert high - low <= np.radians(0.5)


def test_with_the_encoder_on_the_motor_a_change_is_as_wide_as_both_bands(monkeypatch):
    found = iter([(0.002, 0.006), (0.009, 0.015), (0.002, 0.006), (0.009, wiggle.LARGEST)])
    monkeypatch.setattr(Profile, "ends", lambda _: next(found))
    one = Wiggle(log_of(0.005, servo=HEAVY.servo, inertia=2.5 * ROTOR), HEAVY)
    assert np.degrees(change_of(one, one)) == pytest.approx((0.5 - 0.4, 0.9 - 0.1, 0.1))
    with pytest.raises(wiggle.Untold, match=r"beyond 1\.6"):
        change_of(one, one)


def test_with_the_encoder_on_the_motor_a_log_that_no_joint_explains_is_refused():
    log = log_of(np.radians(0.5), servo=HEAVY.servo, inertia=2.5 * ROTOR)
    shaken = log.position + 0.02 * np.sin(40.0 * log.time)
    assert "no joint of the model moves" in play_of(replace(log, position=shaken), HEAVY).reason


def test_with_the_encoder_on_the_motor_a_link_that_a_load_holds_to_one_side_is_refused():
    log = log_of(np.radians(0.5), servo=HEAVY.servo, inertia=2.5 * ROTOR, load=0.08)
    assert "leans on the link" in play_of(log, replace(HEAVY, load=0.08)).reason


def test_a_softened_goal_arrives_late_but_arrives():
    goal = np.radians(3.0) * (np.arange(400) > 10)
    slow, fast = np.empty(400), np.empty(400)
    limit(goal, 5.0, slow)
    limit(goal, 50.0, fast)
    for passed, most in ((slow, 5.0), (fast, 50.0)):
        change = np.abs(np.diff(passed, 2)) / RECORD_S**2
        assert change[change > 0.0].max() == pytest.approx(most, rel=0.02)
        assert passed[-1] == pytest.approx(goal[-1], rel=1e-3)
        # half of the way is speeded up, half slowed down: 2 sqrt(way / most)
        assert RECORD_S * np.argmax(passed > 0.99 * goal[-1]) == pytest.approx(
            0.01 + 2.0 * np.sqrt(goal[-1] / most), rel=0.15
        )


def worse(log, **changes):
    return replace(log, **{name: change(getattr(log, name)) for name, change in changes.items()})


def stepping(position):
    return 0.05 * np.round(position / 0.05)


@pytest.mark.parametrize(
    ("changes", "known", "why"),
    [
        ({"time": lambda x: 10.0 * x}, {}, "10 records a second, and at least 80 are needed"),
        ({"time": lambda x: x + 6e-3 * (np.arange(len(x)) % 10 == 0)}, {}, "off their rhythm"),
        ({"time": lambda x: x[::-1]}, {}, "do not increase"),
        ({"others": lambda _: np.array([0.0, 0.02])}, {}, "other joints moved by 1.1 deg"),
        ({"goal": lambda x: 0.4 * x}, {}, "are not those of the wiggle test"),
        ({"goal": lambda x: 0.0 * x}, {}, "goals do not move"),
        ({"position": lambda x: 0.1 * x}, {}, "hardly followed"),
        ({"position": lambda x: np.nan * x}, {}, "all finite"),
        ({"position": stepping}, {}, "no simulated joint moves as this log does"),
        ({}, {"load": 0.5}, "leans on one side"),
        (
            {},
            {"servo": replace(SERVO, encoder="motor")},
            "0.02 kg m^2 is below 1.2 times",
        ),
        ({}, {"link_inertia": 50.0 * ROTOR}, "link's inertia by the rotor's is outside"),
    ],
)
def test_a_log_that_cannot_tell_is_refused_with_the_reason(changes, known, why):
    told = play_of(worse(log_of(0.01), **changes), replace(KNOWN, **known))
    assert why in told.reason
    assert "cannot tell" in str(told)


def test_half_a_wiggle_is_refused():
    log = log_of(0.01)
    half = slice(len(log.time) // 2)
    part = ServoLog("elbow", log.time[half], log.goal[half], log.position[half])
    assert "has not the whole wiggle" in play_of(part, KNOWN).reason


TRAINED = """
import hashlib, sys
import numpy as np
sys.path.insert(0, "benchmarks")
from truth import wiggle as benchmark

benchmark.WIDENERS, benchmark.EPOCHS = range(24), 1
members = [one for k in range(160) if (one := benchmark.of_family(k)) is not None]
numbers = benchmark.trained(*(np.array(x) for x in zip(*members)))
print("numbers", hashlib.sha256(b"".join(x.tobytes() for x in numbers.values())).hexdigest())
other = np.linspace(0.1, 3.0, 4000).reshape(40, 100)
print("others", hashlib.sha256(np.exp(other @ other.T / 1e3).tobytes()).hexdigest())
"""
OLD = {"OPENBLAS_CORETYPE": "Prescott", "NPY_DISABLE_CPU_FEATURES": "X86_V3 X86_V4"}


@pytest.mark.thorough
@pytest.mark.skipif(platform.machine() != "x86_64", reason="imitates an older x86")
def test_training_gives_the_same_numbers_on_another_processor():
    said = [
        subprocess.run(
            [sys.executable, "-W", "ignore", "-c", TRAINED], check=True, text=True,
            capture_output=True, env=os.environ | more, cwd=Path(__file__).parents[2],
        ).stdout.splitlines()
        for more in ({}, OLD)
    ]  # fmt: skip
    here, there = (dict(line.split() for line in one if line.count(" ") == 1) for one in said)
    if here["others"] == there["others"]:
        pytest.skip("this processor's libraries round as the old one's")
    assert here["numbers"] == there["numbers"]


def test_numbers_that_are_damaged_are_noticed(tmp_path, monkeypatch):
    content = bytearray(wiggle.DATA.read_bytes())
    content[len(content) // 2] ^= 1
    copy = tmp_path / "wiggle.npz"
    copy.write_bytes(content)
    copy.with_suffix(".sha256").write_text(wiggle.DATA.with_suffix(".sha256").read_text())
    monkeypatch.setattr(wiggle, "DATA", copy)
    wiggle.regression.cache_clear()
    with pytest.raises(JointplayError, match="is damaged: its SHA-256 is not"):
        play_of(log_of(0.01), KNOWN)
    wiggle.regression.cache_clear()
