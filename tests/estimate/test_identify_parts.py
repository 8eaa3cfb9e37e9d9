"""Rolling bearings, seats and gears are unknowns, of moving measurements and of static poses."""

from dataclasses import replace

import numpy as np
import pytest
from robots import serial
from truth import parts
from truth.identify import part_machine, rows_of

import jointplay as jp
from jointplay.estimate.machine import Machine, apply, compliances
from jointplay.estimate.model import StaticModel
from jointplay.estimate.parts import Elements, Springs, Teeth, with_values
from jointplay.estimate.unknowns import Estimate, Unknown
from jointplay.estimate.visits import cut_into_visits

BALL = jp.BallBearing(designation="6204", radial_clearance=15e-6)
PAIR = jp.BallBearing(designation="7206 B", arrangement="DB", preload=200.0)
CROSSED = jp.CrossedRollerBearing(designation="RB5013")
SEAT = jp.Elasticity(radial=5e7, axial=8e7, tilt=2e4)
WAVE = jp.StrainWaveGear(
    ratio=100.0, stiffness_1=1.5e4, stiffness_2=2e4, stiffness_3=2.5e4, torque_1=8.0,
    torque_2=25.0, rotor_inertia=0.1, hysteresis=3e-4, rated_torque=200.0,
)  # fmt: skip
LINKS = [
    ("shoulder", "0 1 0", (0, 0, 0), 8.0, (0.25, 0, 0)),
    ("elbow", "0 1 0", (0.5, 0, 0), 5.0, (0.2, 0, 0)),
    ("wrist", "0 0 1", (0.4, 0, 0), 3.0, (0.1, 0, 0)),
]


def arm(bearings=None, gears=None):
    return serial(LINKS, (0.2, 0, 0), bearings or {}, gears=gears)


@pytest.mark.parametrize(
    "bearing",
    [BALL, PAIR, CROSSED, pytest.param(replace(BALL, seat=SEAT), marks=pytest.mark.nightly)],
)
def test_many_rests_are_those_of_each(bearing):
    random = np.random.default_rng(1)
    loads = random.normal(size=(6, 6)) * [50.0, 50.0, 20.0, 2.0, 2.0, 0.0]
    cage = random.uniform(0.0, 1.0, 6)
    places, told = bearing.rests(loads, cage)
    assert told.all()
    for load, turn, place in zip(loads, cage, places, strict=True):
        assert place == pytest.approx(bearing.deflection(load[:3], load[3:], turn), abs=1e-13)
        # The elements' wrench balances the load, in the axes that the ring leans by.
        balance = bearing.load(place, turn).wrench[:5] + load[:5]
        assert np.abs(balance).max() < 2e-3 * np.abs(load).max()


def test_parts_hold_what_was_found():
    ring = Elements("a", BALL).holding({"radial_clearance": -2e-6, "stiffness_factor": 1.2})
    assert ring.cr == -2e-6
    assert ring.stiffness_of_element == pytest.approx(1.2 * BALL.stiffness_of_element)
    assert Elements("a", PAIR).holding({"preload": 50.0}).preload == 50.0
    seated = with_values("a", replace(BALL, seat=SEAT), {"tilt_compliance": 1e-4, "friction": 1.0})
    assert (seated.seat.tilt, seated.seat.radial) == (pytest.approx(1e4), 5e7)
    whole = jp.Elasticity(matrix=np.diag([5e7, 5e7, 8e7, 2e4, 2e4, 0.0]).tolist())
    softer = Springs("a", jp.CompliantJoint(elasticity=whole)).holding({"axial_compliance": 1e-7})
    assert np.diag(softer.springs.stiffness)[2:4] == pytest.approx([1e7, 2e4])
    curve = jp.Elasticity(radial=5e7, axial=8e7, tilt_curve=[(1e-3, 20.0), (2e-3, 60.0)])
    bent = Springs("a", replace(BALL, seat=curve)).holding({"tilt_compliance": 1e-4})
    assert bent.seat.tilt_curve[1] == pytest.approx((2e-3, 30.0))
    gear = Teeth("a", WAVE).holding({"gear_compliance": 1e-4})
    slopes = [1e4, 4e4 / 3.0, 5e4 / 3.0]  # the whole curve in proportion
    assert gear.curve().slopes == pytest.approx(slopes)
    one = Teeth("a", WAVE).holding({"gear_compliance_2": 1e-4, "hysteresis": 1e-4})
    assert one.curve().slopes == pytest.approx([1.5e4, 1e4, 2.5e4])
    assert one.hysteresis == 1e-4
    stated = replace(WAVE, hysteresis=1e-4, stated_lost_motion=1.2e-3)
    least, most = stated.lost_motion_range()
    lost = Teeth("a", stated).holding({"lost_motion": 100.0, "gear_compliance": 1e-4})
    assert lost.lost_motion() == pytest.approx(lost.lost_motion_range()[1], rel=1e-6)
    assert least < 1.2e-3 < most
    assert stated.lost_motion() == pytest.approx(1.2e-3, rel=1e-4)
    stages = (jp.GearStage(ratio=5.0, backlash=1e-3), jp.GearStage(ratio=4.0, backlash=2e-3))
    train = jp.GearTrain(stages=stages, stiffness=1e4, rotor_inertia=0.1)
    assert Teeth("a", train).holding({"gear_play": 1e-3}).play == pytest.approx(1e-3)


def test_what_was_found_is_put_into_the_mechanism():
    robot = arm({"elbow": replace(BALL, seat=SEAT)}, {"shoulder": WAVE})
    machine = Machine(robot, {}, compliances(robot, {}))
    labels = [one.label for one in machine.unknowns([], True, ["stiffness"]) if one.sought]
    assert labels == [
        "elbow radial clearance", "elbow stiffness factor", "elbow radial compliance",
        "elbow axial compliance", "elbow tilt compliance", "shoulder gear compliance",
        "shoulder gear compliance 2", "shoulder gear compliance 3", "shoulder hysteresis",
    ]  # fmt: skip
    told = {"elbow radial_clearance": 1e-5, "elbow tilt_compliance": 1e-4, "shoulder hysteresis": 0}
    found = [Estimate(Unknown(*key.split()), value, 0.0) for key, value in told.items()]
    after = apply(robot, found)
    assert after.clearance["elbow"].radial_clearance == 1e-5
    assert after.clearance["elbow"].seat.tilt == pytest.approx(1e4)
    assert after.gears["shoulder"].hysteresis == 0.0
    rigid = Machine(robot, {}, compliances(robot, {"elbow": np.inf, "shoulder": 1e4}))
    left = [one.label for one in rigid.unknowns([], True) if one.sought]
    assert left == ["elbow radial clearance", "shoulder hysteresis"]
    with pytest.raises(jp.JointplayError, match="friction, stiffness, hysteresis"):
        machine.unknowns([], True, ["preload"])


@pytest.mark.parametrize("seed", [0, 1, 2, pytest.param(5, marks=pytest.mark.thorough), 7])
def test_the_static_model_is_that_of_the_parts(seed, monkeypatch):
    """With true values it shows what another solver found, of arms that are rigid otherwise."""
    kept, statics = {}, parts.statics

    def rigid(joints, reach, tool, *rest):
        kept["joints"] = [replace(one, soft=np.zeros(6)) for one in joints]
        kept["tool"], _ = statics(kept["joints"], reach, np.zeros((3, 3)), *rest)
        kept["motor"], kept["force"] = rest[:2]
        return kept["tool"], np.zeros_like(kept["motor"])

    monkeypatch.setattr(parts, "statics", rigid)
    one = part_machine(seed)
    names = ("shoulder", "elbow")
    real = dict(zip(names, kept["joints"], strict=True))
    robot = one.believed.with_clearance(
        {name: joint.bearing for name, joint in real.items() if joint.bearing},
        {name: joint.gear for name, joint in real.items() if joint.gear},
    )
    signals = {("motor", name): kept["motor"][:, k] for k, name in enumerate(names)}
    for i, axis in enumerate("xyz"):
        signals["tool", axis], signals["force", axis] = kept["tool"][:, i], kept["force"][:, i]
    made, observed = cut_into_visits(robot, jp.Measurement(one.measured.time, signals), None)
    machine = Machine(robot, {}, compliances(robot, {}))
    unknowns = machine.unknowns([], True, ["stiffness"])
    model = StaticModel(machine, made, observed.keys, unknowns)
    off = observed.mean - model.predict(np.array([x.nominal for x in unknowns]))
    assert model.certain.sum() > 0.3 * len(made)
    size = np.abs(observed.mean).max()
    assert np.sqrt(np.mean(off[model.certain] ** 2)) < 1e-2 * size


@pytest.mark.parametrize("seed", [*(pytest.param(n, marks=pytest.mark.nightly) for n in (1, 2)), 5])
def test_intervals_hold_the_truth(seed):
    rows = rows_of(part_machine(seed), seed)
    assert any(row["told"] for row in rows)
    assert not any(row["wrong"] for row in rows)


@pytest.mark.thorough
def test_a_load_that_never_reverses_does_not_show_a_clearance():
    one = part_machine(8)
    time = one.measured.time
    pushed = np.any([one.measured.signals["force", axis] != 0.0 for axis in "xyz"], axis=0)
    first = int(np.argmax(pushed)) - 10
    short = {key: values[:first] for key, values in one.measured.signals.items()}
    # Without any push the weight alone presses the rings together.
    found = jp.identify(one.believed, jp.Measurement(time[:first], short), drift=0)
    (told,) = found.sought[:1]
    assert told.label == "shoulder radial clearance"
    assert "never reverses at a place" in told.reason
    assert "push" in told.reason


@pytest.mark.nightly  # half a minute
def test_a_stiffness_is_not_told_that_no_torque_reaches():
    one = part_machine(7)
    strong = replace(one.believed.gears["shoulder"], torque_2=400.0, rated_torque=600.0)
    machine = one.believed.with_clearance({}, one.believed.gears | {"shoulder": strong})
    found = jp.identify(machine, one.measured, also=["stiffness"])
    told = found["shoulder gear compliance 3"]
    assert "does not reach the 400 N m" in told.reason


def test_plans_rank_what_tells_of_parts():
    robot = arm({"elbow": replace(BALL, seat=SEAT)}, {"shoulder": WAVE})
    plan = jp.plan_measurement(robot, count=2, seed=1)
    sought = [one.label for one in plan.unknowns if one.sought]
    assert sought[0] == "elbow radial clearance"
    assert "shoulder hysteresis" in sought
    assert "shoulder hysteresis" in str(plan)
    poses = jp.estimate.plan_calibration(robot, ["gear", "bearing", "seat"], count=2)
    assert "shoulder gear compliance 3" in str(poses)


def test_static_poses_tell_of_gears_and_bearings():
    random = np.random.default_rng(0)
    soft = np.zeros(6)
    loose = replace(BALL, radial_clearance=22e-6)
    real = replace(WAVE, stiffness_1=1.2e4, stiffness_2=1.8e4, hysteresis=0.0)
    joints = [
        parts.Joint((0, 1, 0), 0.0, 8.0, 0.25, soft, None, real),
        parts.Joint((0, 1, 0), 0.5, 5.0, 0.2, soft, loose),
        parts.Joint((0, 0, 1), 0.4, 3.0, 0.1, soft),
    ]
    n = 60
    motor = random.uniform(-2.5, 2.5, (n, 3))
    motor[:, 2] = np.sign(motor[:, 2]) * random.uniform(0.6, 2.5, n)  # tilted one way or the other
    still = np.zeros((3, 3)), motor, np.zeros((n, 3)), 1e6 * np.arange(n), np.zeros(2)
    tool, _ = parts.statics(joints, 0.2, *still)
    robot = arm({"elbow": BALL}, {"shoulder": replace(WAVE, hysteresis=0.0)})
    poses = jp.StaticPoses(
        ("shoulder", "elbow", "wrist"), motor, position=tool + 1e-6 * random.normal(size=(n, 3))
    )
    fit = jp.calibrate(robot, poses, ["offset", "gear shoulder", "bearing elbow"])
    truth = {
        "elbow radial clearance": 22e-6, "shoulder gear compliance": 1.0 / 1.2e4,
        "shoulder gear compliance 2": 1.0 / 1.8e4, "shoulder gear compliance 3": 1.0 / 2.5e4,
    }  # fmt: skip
    assert {str(one) for one in fit.kept} == {"gear shoulder", "bearing elbow"}
    for label, value in truth.items():
        assert fit[label].low <= value <= fit[label].high
        assert fit[label].high - fit[label].low < 0.5 * value
    with pytest.raises(jp.JointplayError, match=r"has no rolling bearing.*: elbow"):
        jp.calibrate(robot, poses, ["bearing shoulder"])
    with pytest.raises(jp.JointplayError, match=r"springs or a bearing in a seat.*'seat' needs"):
        jp.calibrate(robot, poses, ["seat"])


def test_the_slopes_of_parts_are_those_of_differences():
    robot = arm({"elbow": replace(BALL, seat=SEAT)}, {"shoulder": WAVE})
    random = np.random.default_rng(3)
    motor = random.uniform(-2.0, 2.0, (9, 3))
    names, zero = ("shoulder", "elbow", "wrist"), np.zeros((9, 3))
    from jointplay.estimate.calibration import Placed
    from jointplay.estimate.kinematic_model import Poses, Term

    poses = Poses(robot, jp.StaticPoses(names, motor, position=zero))
    columns = [one for kind in ("gear", "bearing", "seat") for one in poses.columns(Term(kind))]
    least = Placed(poses, (1e-3, 1e-3), tuple(columns)).at(np.arange(9))
    theta = np.array([one.nominal for one in least.unknowns])
    theta[-len(columns) :] = 0.3 * least.scale[-len(columns) :]
    step = 1e-4 * np.minimum(least.scale, 1.0)
    slopes = least.jacobian(theta)
    for k in range(len(theta)):
        ends = [theta.copy(), theta.copy()]
        ends[0][k] -= step[k]
        ends[1][k] += step[k]
        change = (least.predict(ends[1]) - least.predict(ends[0])) / (2.0 * step[k])
        size = np.abs(change).max() + 1e-12
        assert np.abs(slopes[:, k] - change).max() < 1e-2 * size
