"""Play and elasticity are told apart, or it is said that they cannot be."""

import importlib
import math
from dataclasses import replace

import numpy as np
import pytest
from conftest import body, joint, tip
from scipy.optimize import minimize
from test_identify import about
from truth import elastic

from jointplay import Gear, JointplayError, Mechanism, RevoluteClearance, identify
from jointplay.cli import main
from jointplay.estimate import Measurement
from jointplay.estimate.machine import apply, compliances
from jointplay.estimate.unknowns import Estimate, Unknown
from jointplay.estimate.visits import cut_into_visits
from jointplay.physics.contact import Ambrosio
from jointplay.simulation.loads import JointFriction

LENGTHS, MASSES = (0.5, 0.4), (6.0, 3.0)
RATE = 50.0
NOISE = 1e-6
TWO, THREE = (-80.0, 160.0), (-80.0, 160.0, 80.0, -160.0, 40.0, -40.0)


@pytest.fixture
def arm(urdf):
    """The planar arm of two links in a horizontal plane."""
    return urdf(
        body("upper", mass=MASSES[0], com="0.25 0 0", inertia=0.03),
        joint("shoulder", "base", "upper"),
        body("lower", mass=MASSES[1], com="0.2 0 0", inertia=0.03),
        joint("elbow", "upper", "lower", at="0.5 0 0"),
        tip("lower", at="0.4 0 0"),
    )


def links(**shoulder):
    """The arm's joints; the elbow is stiff."""
    bodies = [(LENGTHS[k], MASSES[k], 0.5 * LENGTHS[k], 0.03) for k in (0, 1)]
    return (
        elastic.Joint(*bodies[0], sinks=1e-9, **shoulder),
        elastic.Joint(*bodies[1], sinks=1e-9, torsional=1e-9),
    )


def seen(machine, pushes, seed=0, links_too=()):
    """Both ways through some poses, and at two of them pushes along x and along y."""
    random = np.random.default_rng(seed)
    rows = [np.tile([0.0, 0.6, 0.0, 0.0, 0.0], (20, 1))]

    def go(goal):
        last = rows[-1][-1, :2]
        n = int(np.abs(goal - last).max() / 0.4 * RATE) + 15
        part = np.cumsum(np.convolve(np.ones(n - 14), np.hanning(15)))
        way = last + (part / part[-1])[:, None] * (goal - last)
        rows.append(np.column_stack([way, np.zeros((len(way), 2)), np.ones(len(way))]))

    for goal in ((0.5, 1.1), (0.0, 0.6), (0.2, 0.8)):
        go(np.array(goal))
        for _ in range(2):
            for push in pushes:
                for force in ((push, 0.0), (0.0, push)) if goal[0] else ():
                    for given in (force, (0.0, 0.0)):
                        rows.append(np.tile([*rows[-1][-1, :2], *given, 0.0], (30, 1)))
    table = np.concatenate(rows)
    time, motor, force = np.arange(len(table)) / RATE, table[:, :2], table[:, 2:4]
    way = np.sign(np.round(np.gradient(motor, axis=0), 9)) * table[:, 4:]
    tool, twist = elastic.statics(machine, motor, force, way, time)
    signals = {("tool", "z"): NOISE * random.standard_normal(len(time))}
    for i, axis in enumerate("xy"):
        signals["tool", axis] = tool[:, i] + NOISE * random.standard_normal(len(time))
        signals["force", axis] = force[:, i]
    for k, name in enumerate(("shoulder", "elbow")):
        signals["motor", name] = motor[:, k]
        if name in links_too:
            noise = 1e-6 * random.standard_normal(len(time))
            signals["link", name] = motor[:, k] + twist[:, k] + noise
    return Measurement(time, signals)


def expected(arm, play):
    """What somebody believes: some play in the shoulder, no friction."""
    bearing = RevoluteClearance.planar(radial_clearance=play, friction=Ambrosio(0.0))
    return Mechanism(arm, {"shoulder": bearing})


def honest(found, label, truth):
    """Whether an unknown is not told, or its interval holds the truth."""
    one = found[label]
    return bool(one.reason) or one.low <= truth <= one.high


CASES = {
    "1 um, 1e5 N m/rad": (1e-6, {"torsional": 1e-5}, 0.0),
    "60 um, 1e6 N m/rad": (60e-6, {"torsional": 1e-6}, 0.0),
    "60 um, 1e5 N m/rad": (60e-6, {"torsional": 1e-5}, 0.0),
    "1 um, 1 um/N at the tool": (1e-6, {"torsional": 1e-9}, 1e-6),
}


@pytest.mark.parametrize("case", CASES)
def test_elasticity_is_not_taken_for_play(arm, case):
    play, gives, tool = CASES[case]
    machine = elastic.Arm(links(clearance=play, **gives), False, tool * np.eye(2))
    believed = expected(arm, 60e-6)
    label = "shoulder radial clearance"
    assert honest(identify(believed, seen(machine, TWO)), label, play)
    found = identify(believed, seen(machine, THREE))
    assert not found[label].reason
    assert honest(found, label, play)
    assert found[label].half_width < 8e-6
    assert found.excess < 3.0
    # Who believes the machine to be rigid is misled, and by the elasticity.
    rigid = identify(believed, seen(machine, TWO), stiffness={"all": math.inf})
    assert not honest(rigid, label, play) or rigid.excess > 3.0
    for fitted in (found, rigid):
        assert ("the model does not explain all of it" in str(fitted)) == (fitted.excess > 3.0)


def test_pushes_of_one_size_cannot_tell_and_the_message_names_more(arm):
    machine = elastic.Arm(links(clearance=60e-6, torsional=1e-5), False)
    found = identify(expected(arm, 60e-6), seen(machine, (-80.0, 80.0)))
    assert found.estimates[0].reason.startswith("elasticity (")
    assert "pushes of 1 size are not enough" in found.estimates[0].reason
    assert "--known-stiffness" in found.estimates[0].reason
    assert "would determine it" in found.estimates[0].advice
    assert "N and" in found.estimates[0].advice  # two sizes, or a third besides


@pytest.mark.thorough
def test_advice_is_the_simplest_kind_of_experiment_that_determines_an_unknown():
    machine = importlib.import_module("truth.identify").elastic_machine(5)
    found = identify(machine.believed, machine.measured, **machine.options)
    advice = found["elbow radial clearance"].advice
    assert advice.startswith("would determine it, to +- ")
    assert "100 N" in advice  # 20 N would have to push more than once


def test_a_stiffness_that_is_given_is_used_and_printed(arm):
    machine = elastic.Arm(links(clearance=60e-6, torsional=1e-5), False)
    measured = seen(machine, (-80.0, 80.0))
    rigid = {"all": math.inf, "shoulder torsional": 1e5}
    found = identify(expected(arm, 30e-6), measured, stiffness=rigid)
    value, half = about(found["shoulder radial clearance"])
    assert abs(value - 60e-6) < half < 6e-6
    for words in (
        "shoulder torsional 1e+05 N*m/rad", "--reference place", "--known-stiffness", "--drift 3",
        "shoulder dry friction 0 N m", "shoulder bearing 0", "contacts deform", "(of the records)",
    ):  # fmt: skip
        assert words in str(found)
    roughly = identify(
        expected(arm, 30e-6), measured, stiffness=rigid | {"shoulder torsional": (0.8e5, 0.3)}
    )
    assert roughly["shoulder radial clearance"].half_width > half
    assert honest(roughly, "shoulder radial clearance", 60e-6)
    assert "+- 30 %" in str(roughly)


@pytest.mark.thorough
def test_backlash_is_found_whatever_stiffness_the_gear_is_said_to_have(arm):
    joints = links(play=2e-3, torsional=1e-6, dry=0.5)
    measured = seen(elastic.Arm(joints, False), THREE, links_too=("shoulder",))
    for stiffness in (1e4, 1e6):
        believed = Mechanism(arm, gears={"shoulder": Gear(1e-3, 0.1, stiffness)})
        friction = {"shoulder": JointFriction(coulomb=0.3)}
        found = identify(believed, measured, joint_friction=friction)
        value, half = about(found["shoulder gear play"])
        assert abs(value - 2e-3) < half < 1e-4


@pytest.mark.thorough
def test_friction_is_asked_of_joints_that_have_some_and_unsure_visits_do_not_count(arm):
    measured = seen(elastic.Arm(links(clearance=60e-6, torsional=1e-6), False), THREE)
    found = identify(expected(arm, 60e-6), measured)
    assert "shoulder friction" not in [one.label for one in found.estimates]
    # Where the load leaves the journal where it was: horizontal, inertia alone.
    pushed = np.linalg.norm(found.visits.force, axis=1) > 1.0
    used = np.isfinite(found.error).any(axis=1)
    assert used[pushed].all()
    assert not used[~pushed].any()
    rubs = RevoluteClearance.planar(radial_clearance=1e-4, friction=Ambrosio(0.1))
    friction = {"elbow": JointFriction(coulomb=0.2)}
    found = identify(Mechanism(arm, {"shoulder": rubs}), measured, joint_friction=friction)
    labels = {one.label for one in found.estimates}
    assert {"shoulder friction", "elbow dry friction", "elbow torsional compliance"} <= labels


def test_drift_of_the_readings_is_no_play(arm):
    machine = elastic.Arm(links(clearance=60e-6, torsional=1e-6), False)
    measured = seen(machine, THREE)
    warm = 100e-6 * measured.time / measured.time[-1]
    drifting = {k: v + warm if k[0] == "tool" else v for k, v in measured.signals.items()}
    found = identify(expected(arm, 60e-6), Measurement(measured.time, drifting))
    value, half = about(found["shoulder radial clearance"])
    assert abs(value - 60e-6) < half < 8e-6
    with pytest.raises(JointplayError, match="must not be negative"):
        identify(expected(arm, 60e-6), measured, drift=-1)


@pytest.mark.thorough
@pytest.mark.parametrize("vertical", [True, pytest.param(False, marks=pytest.mark.nightly)])
def test_the_arms_of_the_benchmark_lie_where_their_energy_is_least(vertical):
    joints = (
        elastic.Joint(0.5, 6.0, 0.25, clearance=5e-5, radial=5e-9, torsional=1e-5, bends=5e-7),
        elastic.Joint(0.4, 3.0, 0.2, radial=5e-9, torsional=3e-6, bends=3e-7, play=1e-3),
    )
    arm = elastic.Arm(joints, vertical, np.array([[3e-7, 1e-7], [1e-7, 5e-7]]))
    motor, force = np.array([0.3, -0.7]), np.array([50.0, -120.0])
    tool, _ = elastic.statics(arm, motor[None], force[None], np.zeros((1, 2)), np.zeros(1))
    scale = np.array([1e-5, 1e-5, 1e-3, 1e-5, 1e-4] * 2 + [1e-5, 1e-5])
    x = np.zeros(12)
    for _ in range(12):
        for method in ("Nelder-Mead", "BFGS"):
            x = minimize(
                lambda y: 1e3 * elastic.energy(arm, motor, force, y * scale), x, method=method
            ).x
    own = (x * scale)[:10].reshape(2, 5)
    shape = elastic.Shape(
        own[None, :, :2], *(own[None, :, k] for k in (2, 3, 4)), (x * scale)[None, 10:]
    )
    assert tool == pytest.approx(elastic.places(arm, motor[None], shape)[-1], abs=3e-7)


def test_a_stiffness_that_cannot_be_is_refused(arm, tmp_path, capsys):
    mechanism = expected(arm, 60e-6)
    for given, words in (
        ({"wrist": 1e5}, "no stiffness 'wrist'"),
        ({"shoulder": -1.0}, "must be positive"),
        ({"shoulder": (1e5, -0.1)}, "must be positive"),
        ({"all": 1e5}, "can only be inf"),
    ):
        with pytest.raises(JointplayError, match=words):
            compliances(mechanism, given)
    order = ["identify", str(arm), str(tmp_path / "none.csv"), "--joint", "shoulder=0.1 mm"]
    for option, words in (("shoulder", "must read"), ("shoulder=1 kg", "kg")):
        assert main([*order, "--tool", "tool", "--known-stiffness", option]) == 2
        assert words in capsys.readouterr().err


@pytest.mark.parametrize(("rate", "apart"), [(20.0, 0.0), (22.0, 0.0), (100.0, 3e-4)])
def test_a_stop_holds_the_records_within_which_nothing_moves(arm, rate, apart):
    """Windows of an even and an odd number of records (0.15 s), and records in pairs."""
    time = np.arange(0.0, 6.0, 1.0 / rate)
    time = np.sort(np.concatenate([time, time + apart])) if apart else time
    angle = np.interp(time, [0.0, 2.0, 4.0, 6.0], [0.0, 0.5, 0.5, 1.0])
    signals = {("motor", "shoulder"): angle, ("motor", "elbow"): 0.0 * time, ("tool", "x"): angle}
    made, _ = cut_into_visits(expected(arm, 60e-6), Measurement(time, signals), None)
    (stop,) = np.flatnonzero(made.stopped)
    assert made.time[stop, 1] == pytest.approx(4.0, abs=max(1.01 / rate, 0.04))
    moving = ~made.stopped
    assert (made.time[moving, 1] < 2.0 + max(1.01 / rate, 0.04))[
        made.position[moving, 0] < 0.49
    ].all()
    path = made.path_visit >= 0
    assert (made.path_near[path] == made.path_visit[path]).all()


SOFT = {
    "a bush along the normal": (
        312, {"clearance": 3e-5, "friction": 0.2, "sinks": 1e-5}, 1.0, "shoulder friction",
    ),
    "2 um and 0.6 um/N that stiffens": (
        313, {"clearance": 2e-6, "sinks": 6e-5}, 0.9, "elbow radial clearance",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", SOFT)
def test_soft_bearings_are_not_taken_for_friction_or_play(monkeypatch, case):
    """Friction turns what a bush gives way by; a contact that stiffens looks like play."""
    benchmark = importlib.import_module("truth.identify")
    seed, change, exponent, label = SOFT[case]
    drawn = benchmark.elastic_arm

    def arm(random, kind):
        made = drawn(random, kind)
        joints = [replace(one, dry=0.0, **(change if one.clearance else {})) for one in made.joints]
        return replace(made, joints=tuple(joints), vertical=True)

    monkeypatch.setattr(benchmark, "elastic_arm", arm)
    monkeypatch.setattr(elastic, "HERTZ", exponent)
    rows = benchmark.rows_of(benchmark.elastic_machine(seed), seed)
    row = next(row for row in rows if row["unknown"] == label)
    assert not row["wrong"], row


def test_what_holds_at_rest_is_no_value_of_the_mechanism(arm):
    """Stiction is fitted because others depend on it; a gear's joint has no bearing to change."""
    gear = Mechanism(arm, gears={"shoulder": Gear(1e-3, 0.1, 1e5)})
    at_rest = Unknown("shoulder", "stiction", "", 1.0, 1.0, 3.0, sought=False)
    assert apply(gear, [Estimate(at_rest, 1.0, 0.1)]).gears == gear.gears
