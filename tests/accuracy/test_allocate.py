"""Allocation of clearances, classes of bearings and causes of error: the cheapest choice."""

import re
from itertools import product

import numpy as np
import pytest
from conftest import body, joint, tip
from scipy.optimize import minimize

import jointplay as jp
from jointplay import Gear, JointplayError, Mechanism, Motion, RevoluteClearance
from jointplay.accuracy.allocation import (
    COMPENSATION,
    LIMIT,
    PRELOADED,
    Correction,
    allocate,
    offers_of,
)
from jointplay.accuracy.causes import CAUSES
from jointplay.accuracy.cheapest import drawn
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.error_model import play_model
from jointplay.base.errors import MissingName
from jointplay.cli import main
from jointplay.model.robots import robot_urdf
from jointplay.show.plots.design import allocation
from jointplay.simulation.loads import ComputedTorque, JointFriction
from jointplay.study.corners import judge
from jointplay.study.courses import dynamic_error, fitting_step

later = pytest.mark.thorough

# Clearances of any size.


@pytest.fixture
def three(urdf):
    """Two joints about z and one across, half a metre each."""
    return urdf(
        *map(body, ("one", "two", "three")),
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


def test_the_optimum_is_the_known_one_for_weights(three):
    # The least sum w/c with sum c = t has c in proportion to the root of w.
    found = allocate(robot(three), {}, 4e-5, weights={"a": 4.0}, least=1e-6)
    assert found.clearance == pytest.approx([2e-5, 1e-5, 1e-5], rel=1e-2)
    # Where the target binds, all sizes save the same price per error.
    saved = 1e6 * found.column("saved") / found.column("gain")
    assert saved == pytest.approx([found.relief] * 3, rel=2e-2)


costs = pytest.mark.parametrize(
    "cost",
    ["reciprocal", *(pytest.param(c, marks=later) for c in ("reciprocal-squared", "linear"))],
)


@costs
def test_the_target_is_kept_and_used_up(three, cost):
    mechanism = robot(three, spatial)
    q = np.array([mechanism.configuration({"b": b, "c": c}) for b, c in ((0.4, 0.2), (1.5, -0.9))])
    found = allocate(mechanism, q, 1e-3, cost=cost)
    worst = budget(found.mechanism, q).worst.max()
    assert 0.999e-3 < worst <= 1e-3
    assert found.error == pytest.approx(worst)
    ratio = [one.ca / one.cr for one in found.mechanism.clearance.values()]
    assert ratio == pytest.approx([2.0] * 3)


@costs
def test_no_other_clearances_that_keep_the_target_are_cheaper(three, cost):
    mechanism, pose = robot(three, spatial), {"b": 0.6, "c": 0.4}
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
        # Scaled to just keep the target, as errors are in proportion to the clearances.
        other *= 1e-3 / budget(tried, pose, second_order=False).worst[0]
        if other.min() < 2e-6:
            continue
        assert sign * np.sum(other**power) >= cheapest - 2e-3 * abs(cheapest)


def test_a_quantile_allows_more_than_the_worst_case_and_is_kept(three):
    mechanism, pose = robot(three, spatial), {"b": 0.6, "c": 0.4}
    worst = allocate(mechanism, pose, 1e-3)
    most = allocate(mechanism, pose, 1e-3, quantile=0.99)
    assert most.total < worst.total
    assert 0.99e-3 < most.error <= 1e-3 * (1 + 1e-9)
    low, high = most.spread
    assert low <= most.error <= high
    assert "quantile" in str(most)
    # States drawn with other random numbers keep it, too.
    total = drawn(play_model(most.mechanism, pose), 99, 20000).sum(axis=0)
    assert np.quantile(np.linalg.norm(total[0], axis=1), 0.99) == pytest.approx(1e-3, rel=0.03)


def test_an_unreachable_target_says_what_can_be_reached(three):
    with pytest.raises(
        JointplayError, match=r"with 5 µm in every joint the error is 0.015\d* mm at least"
    ):
        allocate(robot(three), {}, 1e-5, least=5e-6)
    gear = jp.StrainWaveGear(hysteresis=1e-3, ratio=50.0, stiffness_1=300.0, rotor_inertia=0.1)
    with pytest.raises(JointplayError, match="cannot be reached"):  # what it has is not chosen
        allocate(robot(three, a=gear), {}, 1e-4)


def test_gears_are_allocated_and_no_journal_is_added(three):
    """Errors are half plays times levers: prices 1/play are least with play ~ 1/sqrt(lever)."""
    gears = {"a": Gear(1e-3, 0.1, 1e4), "b": Gear(1e-3, 0.1, 1e4)}
    found = allocate(Mechanism(three, gears=gears), {}, 1e-4)
    assert found.joints == ("a (gear)", "b (gear)")
    plays = found.column("play")
    levers = budget(Mechanism(three, gears=gears), {}).alone[0] / 5e-4
    assert (plays * levers / 2.0).sum() == pytest.approx(1e-4, rel=1e-5)
    assert plays[0] / plays[1] == pytest.approx(np.sqrt(levers[1] / levers[0]), rel=1e-3)
    assert found.mechanism.gears["b"].play == pytest.approx(plays[1])
    assert not found.mechanism.clearance
    with pytest.raises(JointplayError, match=r"0\.1 arcmin in every gear the error is"):
        allocate(Mechanism(three, gears=gears), {}, 1e-6)


def test_clearances_and_plays_of_gears_are_allocated_together(three):
    mechanism = robot(three, a=Gear(1e-4, 0.1, 1e4))
    found = allocate(mechanism, {}, 2e-4)
    assert found.joints == ("a", "b", "c", "a (gear)")
    assert found.error <= 2e-4
    assert budget(found.mechanism, {}).worst[0] == pytest.approx(found.error, rel=1e-6)


def test_quantities_can_be_text_with_a_unit(three):
    text = allocate(robot(three), {}, target="0.2 mm", least="3 um", most="0.5 mm")
    numbers = allocate(robot(three), {}, target=2e-4, least=3e-6, most=5e-4)
    assert text.clearance == pytest.approx(numbers.clearance)
    turned = allocate(
        Mechanism(three, {"c": spatial()}), {}, target="0.1 deg", turn=True, force=("5 N", 0.0, 0.0)
    )
    assert turned.target == pytest.approx(np.radians(0.1))
    with pytest.raises(JointplayError, match='target: "1 kg" is not a length'):
        allocate(robot(three), {}, target="1 kg")


def test_the_answer_names_the_tightest_clearances_and_how_many_others():
    arm = Mechanism(robot_urdf("ur5"), tool="tool0")
    bearing = RevoluteClearance(radial_clearance=1e-4)
    found = allocate(Mechanism(robot_urdf("ur5"), dict.fromkeys(arm.joints, bearing)), {}, 1e-3)
    tightest, others = found.chosen.split("; ")
    order = np.argsort(found.clearance)
    names = [text.split()[0] for text in tightest.split(", ")]
    assert names == [found.joints[k] for k in order[:4]]
    assert tightest.startswith(f"{names[0]} {1e6 * found.clearance.min():.3g} µm, ")
    assert others == f"2 others up to {1e6 * found.clearance.max():.3g} µm"
    assert found.sentence.endswith(f"within 1 mm: {found.chosen}")


def test_the_answer_names_the_improvements_to_buy_first(three):
    found = allocate(robot(three), {}, 1e-4, causes=["play"])
    first = next(choice for choice in found.choices if choice.order == 1)
    assert found.chosen.startswith(f"play of {first.joint} to {100 * first.remaining:.2g} %, ")
    assert allocate(robot(three), {}, 1.0, causes=["play"]).chosen == "none is needed"


def test_the_command_names_the_gears_and_their_plays(capsys):
    order = ["allocate", "ur5", "--target", "0.2 mm", "--gear", "elbow_joint=1 mrad"]
    assert main(order) == 0
    first, *rest = capsys.readouterr().out.splitlines()
    assert first.startswith("These are the cheapest plays of gears that keep the tool 'tool0'")
    assert re.search(r"within 0\.2 mm: elbow_joint [\d.]+ arcmin$", first)
    assert "note: play alone counts: gears giving way and servos' sag add to it (--whole)" in rest


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
def test_allocations_refuse_what_cannot_be(three, options, message):
    with pytest.raises(JointplayError, match=message):
        allocate(robot(three), {}, **({"target": 1e-4} | options))


def test_slow_dynamic_runs_keep_the_static_bound_but_for_penetration(three):
    mechanism = Mechanism(three, {"b": spatial()})
    motion = Motion(["a", "b", "c"], [0.0, 0.4], [[0.0, 0.3, 0.2], [0.0, 0.35, 0.2]])
    seen = dynamic_error(mechanism, motion, runs=1)
    q = mechanism.configuration({"b": 0.3, "c": 0.2})
    worst = float(budget(mechanism, q).worst[0])
    assert 0.2 * worst < seen.peak.max() < 1.1 * worst
    assert "simulated: 1 perturbed run," in str(seen)
    assert seen.step == fitting_step(mechanism, q)


@pytest.mark.usefixtures("checked_figures")
def test_the_command_prints_the_table_and_writes_files(three, tmp_path, capsys):
    out = tmp_path / "out"
    order = ["allocate", str(three), "--clearance", "0.2 mm", "--target", "0.5 mm"]
    assert main([*order, "--out", str(out)]) == 0
    text = capsys.readouterr().out
    assert "static worst case" in text
    assert "a target 1 % wider saves" in text
    assert (out / "allocation.csv").read_text().count("\n") == 4
    assert (out / "allocation.png").stat().st_size > 5000


def test_allocation_by_the_command_needs_what_it_works_on(capsys):
    rolling = ["--joint", "elbow_joint=6010"]
    for options, says in (
        ([*rolling, "--least", "1 um"], "--least: bearings have classes only"),
        ([*rolling, "--weight", "elbow_joint=2"], "--weight: bearings have classes"),
        ([*rolling, "--cost", "linear"], "--cost: bearings have classes"),
        ([*rolling, "--price", "C2"], "--price must read CLASS=X, got 'C2'"),
        (["--joint", "elbow_joint", "--price", "C2=3"], "prices of C2 are for classes of rolling"),
        (["--joint", "elbow_joint", "--weight", "elbow_joint"], "--weight must read JOINT=X"),
        ([], "say what is to be allocated: --clearance LENGTH"),
        (["--clearance", "0.1 mm", "--verify"], "--verify simulates a motion"),
        (["--gear", "elbow_joint=1 mrad", "--least", "1 um"], "there are plays of gears only"),
        (["--whole", "industrial", "--cost", "linear"], "does not go with --whole"),
        (["--whole", "industrial", "--quantile", "0.9"], "does not go with --whole"),
        (["--keep", "heat"], "needs --whole"),
        (["--statistical"], "needs --whole"),
        (["--payload", "3 kg"], "acts on where the machine rests"),
    ):
        assert main(["allocate", "ur5", "--target", "1 mm", *options]) == 2
        assert says in capsys.readouterr().err


def test_an_angle_is_a_target_where_a_linkages_output_turns(capsys):
    """The rocker's origin lies on its pin: play only turns it, by play over the rocker's length."""
    order = ["allocate", "jointplay:four_bar.toml", "--case", "0.2 mm", "--tool", "rocker"]
    assert main([*order, "--target", "0.1 mm"]) == 2
    assert "or give an angle as the target" in capsys.readouterr().err
    assert main([*order, "--target", "0.1 deg"]) == 0
    shown = capsys.readouterr().out
    assert "keep the tool 'rocker' within 1.75 mrad" in shown.splitlines()[0]
    size = float(re.search(r"rocker_end +(\S+)", shown)[1])
    assert main(["budget", *order[1:], "--clearance", f"{size} um", "--detail"]) == 0
    assert "Play turns the tool 'rocker' by up to 1.75 mrad" in capsys.readouterr().out
    assert main([*order, "--target", "1 kg"]) == 2
    assert "is not a length" in capsys.readouterr().err


# Classes of bearings.

CONFIGURATIONS = np.array([[0.1, -0.9, 1.2, 0.3, 0.2, 0.0], [0.5, -0.2, 0.4, -0.6, 1.0, 0.3]])
PRICED = {"C2": 1.9, "CN": 1.35, "C3": 1.0, "C4": 0.8, "CC0": 1.5, "C0": 1.1, "C1": 0.9}


@pytest.fixture(scope="module")
def rolling():
    """A UR5 with three bearings."""
    return jp.Mechanism(
        "example-robot-data:ur5",
        {
            "shoulder_pan_joint": jp.BallBearing(designation="7210 C DB", radial_clearance=4e-6),
            "elbow_joint": jp.BallBearing(designation="6010"),
            "wrist_1_joint": jp.CrossedRollerBearing(designation="RB2008"),
        },
    )


def at_poses(robot):
    named = (dict(zip(robot.joints, row, strict=True)) for row in CONFIGURATIONS)
    return np.array([robot.configuration(pose) for pose in named])


def test_offers_are_all_classes_of_the_size_and_a_preloaded_pair(rolling):
    pair, deep, crossed = (offers_of(one) for one in rolling.clearance.values())
    assert [one.name for one in deep] == ["C2", "C3", "C4", "CN"]
    assert {one.name for one in crossed} == {"CC0", "C0", "C1"}
    assert [one.name for one in pair] == ["as given", PRELOADED]
    assert pair[1].joint.preloaded
    dear = offers_of(rolling.clearance["elbow_joint"], {"C2": 7.0})
    assert dear[0].price == 7.0


@pytest.mark.parametrize(
    "target", [1.1e-3, *(pytest.param(size, marks=later) for size in (2e-3, 8.5e-4, 7e-4))]
)
def test_no_cheaper_choice_of_classes_keeps_the_target(rolling, target):
    poses, best, names = at_poses(rolling), np.inf, list(rolling.clearance)
    for choice in product(*(offers_of(rolling.clearance[name], PRICED) for name in names)):
        price = sum(one.price for one in choice)
        made = {name: one.joint for name, one in zip(names, choice, strict=True)}
        if price < best and budget(rolling.with_clearance(made), poses).worst.max() <= target:
            best = price
    if not np.isfinite(best):
        with pytest.raises(JointplayError, match="with the tightest bearings offered"):
            allocate(rolling, poses, target, prices=PRICED)
        return
    found = allocate(rolling, poses, target, prices=PRICED)
    assert found.total == pytest.approx(best)
    assert found.error <= target
    assert budget(found.mechanism, poses).worst.max() == pytest.approx(found.error, rel=1e-3)
    assert found.column("after").sum() == pytest.approx(found.error, rel=1e-9)


@pytest.mark.thorough
@pytest.mark.parametrize("cost", [pytest.param("reciprocal", marks=pytest.mark.nightly), "linear"])
def test_sizes_and_classes_are_chosen_together_and_no_other_choice_is_cheaper(rolling, cost):
    journal = RevoluteClearance(radial_clearance=5e-5, axial_clearance=5e-5)
    joints = {**rolling.clearance, "shoulder_lift_joint": journal, "wrist_2_joint": journal}
    robot = rolling.with_clearance(joints)
    poses, options = at_poses(robot), {"prices": PRICED, "cost": cost, "most": 5e-5}
    # Prices at which a tighter class and a larger clearance compete.
    options["weights"] = dict.fromkeys(("shoulder_lift_joint", "wrist_2_joint"), 0.02)
    if cost == "linear":
        options["weights"] = dict.fromkeys(options["weights"], 20.0)
    found = allocate(robot, poses, 1.4e-3, **options)
    assert budget(found.mechanism, poses).worst.max() == pytest.approx(found.error, rel=1e-6)
    assert 0.999 * 1.4e-3 < found.error <= 1.4e-3
    names, best = list(rolling.clearance), np.inf
    every = [offers_of(robot.clearance[name], PRICED) for name in names]
    for choice in product(*every):
        made = {name: one.joint for name, one in zip(names, choice, strict=True)}
        try:
            fixed = allocate(
                robot.with_clearance({**joints, **made}), poses, 1.4e-3, keep=names,
                **{**options, "prices": {}},
            )  # fmt: skip
        except JointplayError:
            continue
        best = min(best, fixed.total + sum(one.price for one in choice))
    assert found.total == pytest.approx(best, rel=1e-5)
    assert set(found.column("held")) > {"class"}
    assert {"class", "clearance", "price"} <= {one.head for one in found.table().columns}


def test_classes_that_cannot_be_are_refused(rolling):
    poses = at_poses(rolling)
    with pytest.raises(MissingName, match="C3"):
        allocate(rolling, poses, 1e-3, prices={"C9": 1.0})
    with pytest.raises(MissingName, match="elbow_joint"):
        allocate(rolling, poses, 1e-3, offers={"elbow": ()})
    with pytest.raises(JointplayError, match="no joint or gear has play to allocate"):
        allocate(rolling, poses, 1e-3, keep=list(rolling.clearance))


def test_the_command_line_allocates_by_class(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["allocate", "ur5", "--joint", "elbow_joint=6010", "--target", "1 mm"]
    assert main([*options, "--price", "C2=3", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "elbow_joint" in shown
    assert "of 1.0000 mm" in shown
    assert (out / "allocation.csv").read_text().startswith("joint,cause,class,")


@pytest.mark.parametrize(
    ("joint", "says"),
    [
        ("elbow_joint=0.1mm", "; assumed: bearings of 20 x 40 mm"),
        ("elbow_joint=20H8/f7", "; assumed: bearings 40 mm long"),
        ("elbow_joint=6010", ""),
    ],
)
def test_the_first_line_says_what_sizes_of_bearings_are_assumed(joint, says, capsys):
    assert main(["allocate", "ur5", "--joint", joint, "--target", "1 mm"]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert first.endswith(says)
    assert ("assumed" in first) == bool(says)


# Causes of error.

POSE = {"shoulder_lift_joint": -0.7, "elbow_joint": 0.9, "wrist_1_joint": 0.3}
PULL = (20.0, 0.0, -50.0)
ELBOW = {"joint_a": 0.3, "joint_b": 0.8}
WHOLE = {"causes": CAUSES, "kind": "industrial"}
both = pytest.mark.parametrize("statistical", [False, True])


@pytest.fixture(scope="module")
def scara():
    """The SCARA with a journal in joint B."""
    journal = jp.RevoluteClearance(radial_clearance=5e-5, axial_clearance=5e-5)
    return jp.Mechanism(jp.shipped("scara.urdf"), {"joint_b": journal}, tool="suction_cup")


@pytest.fixture(scope="module")
def arm():
    """A UR5 with a preloaded pair, a crossed roller bearing, a journal and a gear with play."""
    joints = {
        "elbow_joint": jp.BallBearing(designation="7010 C DB", preload=200.0),
        "wrist_1_joint": jp.CrossedRollerBearing(designation="RB2008"),
        "wrist_2_joint": jp.RevoluteClearance(radial_clearance=2e-5, axial_clearance=2e-5),
    }
    gears = {"wrist_1_joint": jp.Gear(3e-4, 0.1, 1e4)}
    return jp.Mechanism("example-robot-data:ur5", joints, gears=gears)


def largest(budget, statistical):
    return float((budget.rms if statistical else budget.worst).max())


@both
def test_a_general_method_finds_no_cheaper_sizes(scara, statistical):
    ideal = scara.ideal()
    first = budget(ideal, ELBOW, **WHOLE)
    target = 0.4 * largest(first, statistical)
    options = {"weights": {"joint_a": 2.0, "joint_b": 0.5}, "prices": {"encoder": 3.0}}
    found = allocate(ideal, ELBOW, target, statistical=statistical, **WHOLE, **options)
    keys = [(one.joint, one.cause) for one in found.choices]
    weight = np.array([options["weights"].get(joint, 1.0) * options["prices"].get(cause, 1.0)
                       for joint, cause in keys])  # fmt: skip

    def over(x):
        parts = dict(zip(keys, x, strict=True))
        scale = [parts.get((one.joint, one.cause), 1.0) for one in first.model.contributions]
        model = first.model.scaled(np.array(scale))
        return 1.0 - (model.rms if statistical else model.farthest().size)[0] / target

    other = minimize(
        lambda x: weight @ (1.0 / x - 1.0), np.full(len(keys), 0.3),
        jac=lambda x: -weight / x**2, bounds=[(LIMIT, 1.0)] * len(keys),
        constraints={"type": "ineq", "fun": over}, method="SLSQP", options={"maxiter": 500},
    )  # fmt: skip
    assert found.total == pytest.approx(other.fun, rel=1e-5)


@both
@pytest.mark.parametrize("part", [0.6, pytest.param(0.3, marks=later)])
def test_the_whole_budget_with_what_remains_is_the_target(arm, statistical, part):
    first = budget(arm, POSE, force=PULL, **WHOLE)
    target = part * largest(first, statistical)
    found = allocate(arm, POSE, target, statistical=statistical, force=PULL, **WHOLE)
    again = budget(arm, POSE, force=PULL, remaining=found.parts, **WHOLE)
    assert largest(again, statistical) == pytest.approx(target, rel=1e-6)
    assert largest(again, statistical) <= target * (1.0 + 1e-7)
    assert found.column("after").sum() == pytest.approx(target, rel=1e-6)
    assert found.column("before").sum() == pytest.approx(largest(first, statistical), rel=1e-9)
    assert max(found.column("order")) == sum(
        how in ("target", "limit") for how in found.column("held")
    )


def test_the_target_is_kept_by_the_sizes_themselves(scara):
    """A budget of the remaining clearance, resolutions, tolerances and heating has the target."""
    causes = [one for one in CAUSES if one != "elasticity"]
    start = jp.accuracy.robot_errors.ERROR_CLASSES["industrial"]
    whole = {"causes": causes, "kind": "industrial"}
    target = 0.4 * float(budget(scara, ELBOW, **whole).worst[0])
    found = allocate(scara, ELBOW, target, **whole)
    left = {
        name: {cause: found.parts.get((name, cause), 1.0) for cause in CAUSES}
        for name in scara.joints
    }
    turning = {"encoder": "encoder", "zero_offset": "encoder", "gear_error": "gear error"}
    others = {"axis_offset": "geometry", "axis_tilt": "geometry", "heating": "heat"}
    sized = {}
    for name, x in left.items():
        pinion = 0.01 if scara.description.joints[name].slides else 1.0
        own = {k: getattr(start, k) * pinion * x[cause] for k, cause in turning.items()}
        own |= {k: getattr(start, k) * x[cause] for k, cause in others.items()}
        sized[name] = jp.JointErrors(**own)
    journal = scara.clearance["joint_b"].scaled(left["joint_b"]["play"])
    made = scara.with_clearance({"joint_b": journal})
    again = budget(made, ELBOW, **whole, errors=jp.RobotErrors(joints=sized))
    assert again.worst[0] == pytest.approx(target, rel=1e-6)
    assert left["joint_b"]["play"] < 1.0


@pytest.mark.parametrize("statistical", [False, pytest.param(True, marks=later)])
def test_the_marginal_price_is_that_of_a_target_a_little_wider(arm, statistical):
    target = 0.4 * largest(budget(arm, POSE, force=PULL, **WHOLE), statistical)
    options = {"statistical": statistical, "force": PULL, "keep": ["play"]}
    low, mid, high = (
        allocate(arm, POSE, target * part, **options, **WHOLE) for part in (0.999, 1.0, 1.001)
    )
    saved = (low.total - high.total) / (0.002 * target)
    assert mid.relief == pytest.approx(saved, rel=1e-3)


@pytest.mark.thorough
@both
def test_bearings_are_chosen_with_the_causes_and_no_other_choice_is_cheaper(rolling, statistical):
    names = ("elbow_joint", "wrist_1_joint")
    whole = {"causes": ("play", "geometry", "encoder"), "kind": "industrial"}
    options = {**whole, "statistical": statistical, "prices": {"C2": 3.0}}
    target = 0.5 * largest(budget(rolling, POSE, **whole), statistical)
    found = allocate(rolling, POSE, target, offers=dict.fromkeys(names, ()), **options)
    again = budget(found.mechanism, POSE, **whole, remaining=found.parts)
    assert largest(again, statistical) == pytest.approx(target, rel=1e-6)
    best = np.inf
    for choice in product(*(offers_of(rolling.clearance[name], {"C2": 3.0}) for name in names)):
        made = {name: one.joint for name, one in zip(names, choice, strict=True)}
        other = rolling.with_clearance({**rolling.clearance, **made})
        try:
            sizes = allocate(other, POSE, target, **options)
        except JointplayError:
            continue
        best = min(best, sizes.total + sum(one.price for one in choice))
    assert found.total == pytest.approx(best, rel=1e-5)
    assert {"class", "remains"} <= {one.head for one in found.table().columns}


def test_play_of_rolling_bearings_stays_but_that_of_their_gears_does_not(arm):
    target = 0.15 * budget(arm, POSE, **WHOLE).worst[0]
    found = allocate(arm, POSE, float(target), **WHOLE)
    assert found.parts[("wrist_1_joint", "play")] < 1.0
    assert any("kept: the play of the bearings of wrist_1_joint" in one for one in found.notes)
    for remaining, part in (({}, 1.0), (found.parts, found.parts["wrist_1_joint", "play"])):
        model = budget(arm, POSE, **WHOLE, remaining=remaining).model
        own = [k for k, one in enumerate(model.contributions) if one.cause == "play"]
        scale = {model.names[k]: model.scale[k] for k in own}
        assert (scale["wrist_1_joint"], scale["wrist_1_joint (gear)"]) == (1.0, part)
    alone = arm.with_clearance(arm.clearance, {})
    with pytest.raises(JointplayError, match="not proportional to its clearance"):
        budget(alone, POSE, remaining={("wrist_1_joint", "play"): 0.5}, **WHOLE)
    with pytest.raises(JointplayError, match="no cause is left that may be improved"):
        allocate(
            alone.with_clearance({"wrist_1_joint": arm.clearance["wrist_1_joint"]}), POSE, 1e-3,
            causes=["play"],
        )  # fmt: skip


def test_a_target_that_cannot_be_reached_names_the_cause(arm):
    with pytest.raises(JointplayError, match=r"most of it by geometry .*kept"):
        allocate(arm, POSE, 1e-3, keep=["geometry"], **WHOLE)
    with pytest.raises(JointplayError, match=r"most of it by elasticity .*at least 0.5 of it"):
        allocate(arm, POSE, 1e-3, force=(0.0, 0.0, -500.0), limits={"elasticity": 0.5}, **WHOLE)


def test_a_target_that_is_met_already_costs_nothing(arm):
    found = allocate(arm, POSE, 1.0, **WHOLE)
    assert found.total == 0.0
    assert found.parts == {}
    assert set(found.column("held")) <= {"as is", "kept"}
    assert "already within the target, so nothing is spent" in str(found)


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"keep": ["wear"]}, "elasticity"),
        ({"prices": {"gear": 1.0}}, "gear error"),
        ({"prices": {"play": 0.0}}, "price of 'play'"),
        ({"weights": {"elbow": 1.0}}, "elbow_joint"),
        ({"limits": {"heat": 2.0}}, "at most 1 remains"),
        ({"keep": CAUSES}, "no cause is left"),
        ({"target": -1.0}, "target"),
        ({"quantile": 0.99}, "nor other causes"),
    ],
)
def test_what_cannot_be_of_causes_is_refused_with_the_choices(arm, options, says):
    with pytest.raises((JointplayError, MissingName), match=says):
        allocate(arm, POSE, **{"target": 1e-3, **options}, **WHOLE)


def test_the_figure_shows_all_parts_and_prices(arm):
    found = allocate(arm, POSE, 1e-3, **WHOLE)
    figure = allocation(found)
    _, parts, prices = (
        sum(bar.get_width() for bars in panel.containers for bar in bars) for panel in figure.axes
    )
    assert parts == pytest.approx(
        1e3 * (found.column("before").sum() + found.column("after").sum()), rel=1e-9
    )
    assert prices == pytest.approx(100.0, rel=1e-9)


@pytest.mark.usefixtures("checked_figures")
def test_the_command_line_spends_on_causes(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["allocate", "ur5", "--whole", "industrial", "--target", "2 mm", "--payload", "3 kg"]
    more = ["--keep", "heat", "--price", "encoder=2", "--limit", "geometry=0.2"]
    more += ["--weight", "elbow_joint=3", "--detail"]
    assert main([*options, *more, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "worst case: 2.0000 mm of 2.0000 mm" in shown
    assert (
        "assumed: prices: halving costs 1 at each joint, of elasticity, gear error, geometry, sag"
        in shown
    )
    assert (out / "allocation.csv").read_text().startswith("joint,cause,added_m,adds_m,")
    assert (out / "allocation.png").read_bytes().startswith(b"\x89PNG")
    pair = ["--joint", "elbow_joint=6010", "--by-class", "elbow_joint"]
    assert main([*options, *pair, "--causes", "play,geometry", "--price", "CN=2"]) == 0
    assert ["elbow_joint", "play", "C2"] in [
        line.split()[:3] for line in capsys.readouterr().out.splitlines()
    ]
    assert main([*options, "--statistical", "--causes", "geometry"]) == 0
    assert "RMS" in capsys.readouterr().out
    path = tmp_path / "arm.toml"
    path.write_text(
        '[robot]\nurdf = "jointplay:scara.urdf"\ntool = "suction_cup"\n'
        '[errors]\nassumed = "industrial"\naxis_offset = "0.2 mm"\n'
    )
    assert main(["allocate", str(path), "--whole", "--target", "1 mm"]) == 0
    assert "given: geometry: offset 0.0002 m (all joints)" in capsys.readouterr().out


# Compensation, offered beside sizes.


def corrected(mechanism, pose, **known):
    offers = {COMPENSATION: [Correction(1.0, **known)]}
    return allocate(mechanism, pose, 1e-3, causes=["play"], offers=offers).corrections[0]


@pytest.mark.thorough
@pytest.mark.parametrize("count", [1, 2])
def test_what_compensation_leaves_is_what_runs_with_other_play_show(urdf, count):
    """With play 30 % larger or smaller than the correction assumes, at the motion's last stop."""
    names, above = ["j", "k"][:count], ["base", "j1"]
    parts = [
        part
        for k, name in enumerate(names)
        for part in (
            body(f"j{k + 1}", 2.0 - k, f"{0.3 - 0.1 * k} 0 0"),
            joint(name, above[k], f"j{k + 1}", axis="0 -1 0"),
        )
    ]
    path = urdf(*parts, tip(f"j{count}"))
    gears = {
        name: Gear((4e-3, 2e-3)[k], (0.05, 0.03)[k], (800.0, 400.0)[k], 2.0 - k)
        for k, name in enumerate(names)
    }
    arm = Mechanism(path, gears=gears, gravity=(0.0, 0.0, -9.81))
    stop = [0.05, -0.4][:count]
    motion = Motion(names, [0.0, 0.4, 0.8], [[0.0] * count, stop, stop])
    drive = ComputedTorque(encoder="motor")
    simulation = jp.Simulation(arm, motion, drive=drive, step="20 us", record_every=50)
    corners = judge(jp.compensate(simulation), {"play": 0.3}, jobs=1).corners[1:]
    shown = max(float(np.linalg.norm(one.after.values[-1, :3])) for one in corners)
    pose = dict(zip(names, stop, strict=True))
    assert shown < corrected(arm, pose).error < 1.25 * shown
    exactly = corrected(arm, pose, play=0.0).error
    assert corrected(arm, pose).error - exactly == pytest.approx(shown, rel=0.15)
    # The sag of drives is left, too, and grows with unknown friction like the rest.
    rough = corrected(arm, pose, play=0.0, friction=0.5).error
    assert rough == pytest.approx(1.5 * exactly, rel=0.05)


def moving_scara():
    joints = {"joint_b": RevoluteClearance(radial_clearance=2e-4, axial_clearance=2e-4)}
    robot = Mechanism(jp.shipped("scara.urdf"), joints, gravity=(0.0, 0.0, -9.81))
    places = [[0.0, 0.4, 0.0, 0.0], [0.3, -0.4, 0.0, 0.0]]  # stretched between
    return jp.Simulation(robot, Motion(robot.joints, [0.0, 0.8, 1.0], [*places, places[1]]))


def moving_ur5():
    path = robot_urdf("ur5")
    names = Mechanism(path).joints
    bearing = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4)
    places = [[0.0, -1.2, 1.5, -1.9, -1.57, 0.0], [0.4, -1.0, 1.6, -2.2, -1.57, 0.4]]
    motion = Motion(names, [0.0, 1.5, 2.0], [*places, places[1]])  # it swings after a fast stop
    return jp.Simulation(Mechanism(path, dict.fromkeys(names, bearing)), motion)


def moving_gantry():
    gears = {"x": Gear(1e-4, 4.0, 2e6, 1500.0), "z": Gear(5e-5, 16.0, 2e7, 5000.0)}
    robot = Mechanism(jp.shipped("gantry.urdf"), gears=gears, tool="gripper")
    places = [[0.1, 0.0], [0.25, -0.03]]
    return jp.Simulation(
        robot, Motion(("x", "z"), [0.0, 0.5, 0.7], [*places, places[1]]),
        ComputedTorque(encoder="motor"), joint_friction={"x": JointFriction(coulomb=5.0)},
    )  # fmt: skip


@later
@pytest.mark.parametrize(
    "machine", [moving_scara, pytest.param(moving_ur5, marks=pytest.mark.nightly), moving_gantry]
)
def test_no_run_leaves_more_at_a_stop_than_compensation_is_said_to(machine):
    """With play 30 % larger or smaller; of the SCARA also where it is stretched on the way."""
    simulation = machine()
    motion, robot = simulation.motion, simulation.mechanism
    corners = judge(jp.compensate(simulation), {"play": 0.3}, jobs=1).corners
    for time in (motion.duration, *((0.4,) if machine is moving_scara else ())):
        pose = dict(zip(motion.joints, motion(np.array([time]))[0][0].tolist(), strict=True))
        shown = [np.linalg.norm(x.after.values[:, :3], axis=1) for x in corners]
        shown = [one[np.abs(x.after.times - time) <= 1e-2].max()
                 for one, x in zip(shown, corners, strict=True)]  # fmt: skip
        said = corrected(robot, pose).error, corrected(robot, pose, play=0.0).error
        assert max(shown) < said[0]
        assert shown[0] < said[1]
        if time == 0.4:
            assert shown[0] > 0.6 * said[1]  # what the stretched arm cannot take back


@pytest.mark.thorough
def test_compensation_stands_beside_what_is_allocated(capsys, tmp_path):
    options = ["allocate", "scara", "--clearance", "50 um", "--target", "0.2 mm", "--quiet"]
    trust = ["--compensation", "20", "--trust", "play 20 %, friction 50 %"]
    assert main([*options, *trust]) == 0
    shown = capsys.readouterr().out
    assert "sizes as given, compensated, do not" in shown.splitlines()[0]
    assert "(price 20, play known to 20 %, friction to 50 %); allocated 0.2 mm" in shown
    assert main([*options[:4], "--target", "3 mm", *options[6:], "--compensation", "20"]) == 0
    assert "keep it, too, at rest" in capsys.readouterr().out.splitlines()[0]
    for bad, words in [
        (["--compensation", "-1"], "price of a compensation must not be negative, got -1"),
        (["--trust", "play 20 %"], "give its price, --compensation"),
        (["--compensation", "1", "--trust", "payload 20 %"], "only play and friction may be off"),
    ]:
        assert main([*options, *bad]) == 2
        assert words in capsys.readouterr().err


def test_a_target_that_sizes_cannot_keep_is_refused_with_what_compensation_leaves(three):
    offers = {COMPENSATION: [Correction(1.0)]}
    with pytest.raises(JointplayError, match=r"cannot be reached: .*; compensated .* at rest"):
        allocate(robot(three), {}, 1e-6, offers=offers)
