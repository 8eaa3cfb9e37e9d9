"""Wiggle test: the two-inertia joint against `Simulation`, and what logs tell of play."""

from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint

import jointplay as jp
from jointplay.base.errors import JointplayError
from jointplay.estimate import wiggle
from jointplay.estimate.servo_joint import RECORD_S, ServoJoint
from jointplay.estimate.wiggle import Known, ServoLog, play_of, wiggle_goal
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


def log_of(play, *, rate=100.0, stiffness=300.0, servo=OUTPUT):
    """What the servo of a joint of such a play reports of its wiggle."""
    numbers = {"play": play, "stiffness": stiffness, "damping": 0.4, "link_friction": 0.03}
    times, goals = wiggle_goal()
    now = np.arange(0.0, times[-1] + 0.6, RECORD_S)
    _, link = ServoJoint.of(servo, ROTOR, LINK, **numbers).move(np.interp(now - 0.3, times, goals))
    read = np.arange(0.0, now[-1], 1.0 / rate)
    count = servo.resolution
    seen = np.round(np.interp(read, now, link) / count) * count
    return ServoLog("elbow", read, np.interp(read - 0.3, times, goals), seen)


def test_the_wiggle_is_small_and_lasts_from_4_to_10_seconds():
    times, goals = wiggle_goal()
    assert 4.0 <= times[-1] <= 10.0
    assert (np.diff(times) > 0.0).all()
    assert np.abs(goals).max() == pytest.approx(np.radians(3.0))
    assert goals[0] == goals[-1] == 0.0
    speeds = np.abs(np.diff(goals) / np.diff(times))
    assert len(np.unique(np.round(np.degrees(speeds)))) >= 5


def test_a_band_is_in_tenths_of_a_degree_and_holds_the_play():
    told = [play_of(log_of(np.radians(play)), KNOWN) for play in PLAYS]
    for play, one in zip(PLAYS, told, strict=True):
        low, high = wiggle.band(log_of(np.radians(play)), KNOWN)
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
    assert wiggle.band(there, KNOWN) == pytest.approx(wiggle.band(log, KNOWN))


def test_small_play_is_bounded_above_and_large_play_below():
    small, large = (play_of(log_of(np.radians(x)), KNOWN) for x in (0.1, 1.6))
    assert not small.found
    assert np.radians(0.1) <= small.upper <= np.radians(0.7)
    assert large.low >= np.radians(0.5)
    assert "inf" not in large.words()[0]


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
        ({}, {"servo": replace(SERVO, encoder="motor")}, "the encoder is on the motor"),
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
