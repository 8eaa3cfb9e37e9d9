"""Which cause to improve at which joint: against all choices, the budget anew, refusals."""

import dataclasses

import numpy as np
import pytest
from scipy.optimize import minimize

import jointplay as jp
from jointplay import cli
from jointplay.core.errors import JointplayError, MissingName
from jointplay.design.cause_allocation import LIMIT, allocate_causes
from jointplay.design.error_budget import CAUSES, error_budget
from jointplay.plots.design import cause_allocation

POSE = {"shoulder_lift_joint": -0.7, "elbow_joint": 0.9, "wrist_1_joint": 0.3}
PULL = (20.0, 0.0, -50.0)
ELBOW = {"joint_a": 0.3, "joint_b": 0.8}


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


@pytest.mark.parametrize("statistical", [False, True])
def test_no_cheaper_choice_of_a_grid_keeps_the_target(scara, statistical):
    causes, weights = ("geometry", "encoder"), {"joint_a": 2.0, "joint_b": 0.5}
    kept = [name for name in scara.joints if name not in ELBOW]
    quiet = jp.RobotErrors(
        joints={
            name: jp.JointErrors(encoder=0.0, zero_offset=0.0, axis_offset=0.0, axis_tilt=0.0)
            for name in kept
        }
    )
    options = {"errors": quiet, "causes": causes}
    keys = [(joint, cause) for joint in ELBOW for cause in causes]
    first = error_budget(scara, ELBOW, **options)
    target = 0.45 * largest(first, statistical)
    found = allocate_causes(
        scara, ELBOW, target, statistical=statistical, weights=weights,
        prices={"encoder": 3.0}, **options,
    )  # fmt: skip
    weight = [weights[joint] * (3.0 if cause == "encoder" else 1.0) for joint, cause in keys]
    steps = np.geomspace(LIMIT, 1.0, 12)
    grid = np.stack(np.meshgrid(*[steps] * 4), -1).reshape(-1, 4)
    prices = (weight * (1.0 / grid - 1.0)).sum(axis=1)
    best = np.inf
    for k in np.argsort(prices):
        parts = dict(zip(keys, map(float, grid[k]), strict=True))
        if largest(error_budget(scara, ELBOW, remaining=parts, **options), statistical) <= target:
            best = prices[k]
            break
    assert found.total <= best
    assert found.total >= 0.75 * best  # the grid is coarse
    x = np.array([found.parts.get(key, 1.0) for key in keys])
    assert found.total == pytest.approx(float((weight * (1.0 / x - 1.0)).sum()))


def test_a_general_method_finds_the_same_root_mean_square(scara):
    ideal = scara.ideal()
    first = error_budget(ideal, ELBOW)
    target = 0.4 * float(first.rms[0])
    found = allocate_causes(ideal, ELBOW, target, statistical=True)
    keys = list(zip(found.joints, found.causes, strict=True))

    def over(x):
        parts = dict(zip(keys, x, strict=True))
        made = [
            dataclasses.replace(one, factor=parts.get((one.joint, one.cause), 1.0))
            for one in first.contributions
        ]
        return 1.0 - dataclasses.replace(first, contributions=tuple(made)).rms[0] / target

    other = minimize(
        lambda x: (1.0 / x).sum() - len(x), np.full(len(keys), 0.3),
        jac=lambda x: -1.0 / x**2, bounds=[(LIMIT, 1.0)] * len(keys),
        constraints={"type": "ineq", "fun": over}, method="SLSQP", options={"maxiter": 500},
    )  # fmt: skip
    assert found.total == pytest.approx(other.fun, rel=1e-5)


@pytest.mark.parametrize("statistical", [False, True])
@pytest.mark.parametrize("part", [0.6, 0.3])
def test_the_whole_budget_with_what_remains_is_the_target(arm, statistical, part):
    first = error_budget(arm, POSE, force=PULL)
    target = part * largest(first, statistical)
    found = allocate_causes(arm, POSE, target, statistical=statistical, force=PULL)
    again = error_budget(arm, POSE, force=PULL, remaining=found.parts)
    assert largest(again, statistical) == pytest.approx(target, rel=1e-6)
    assert largest(again, statistical) <= target * (1.0 + 1e-7)
    assert found.after.sum() == pytest.approx(target, rel=1e-6)
    assert found.before.sum() == pytest.approx(largest(first, statistical), rel=1e-9)
    assert sorted(found.order)[-1] == sum(how in ("target", "limit") for how in found.held)


def test_the_target_is_kept_by_the_sizes_themselves(scara):
    """Not by factors: with the clearance, resolutions, tolerances and warmth that are left."""
    causes = [one for one in CAUSES if one != "elasticity"]
    start = jp.design.robot_errors.ERROR_CLASSES["industrial"]
    first = error_budget(scara, ELBOW, causes=causes)
    target = 0.4 * float(first.worst[0])
    found = allocate_causes(scara, ELBOW, target, causes=causes)
    left = {
        name: {cause: found.parts.get((name, cause), 1.0) for cause in CAUSES}
        for name in scara.joints
    }
    sized = {}
    for name, x in left.items():
        pinion = 0.01 if scara.description.joints[name].slides else 1.0
        sized[name] = jp.JointErrors(
            encoder=start.encoder * pinion * x["encoder"],
            zero_offset=start.zero_offset * pinion * x["encoder"],
            gear_error=start.gear_error * pinion * x["gear error"],
            axis_offset=start.axis_offset * x["geometry"],
            axis_tilt=start.axis_tilt * x["geometry"],
            heating=start.heating * x["heat"],
        )
    journal = scara.clearance["joint_b"].scaled(left["joint_b"]["play"])
    made = scara.with_clearance({"joint_b": journal})
    again = error_budget(made, ELBOW, causes=causes, errors=jp.RobotErrors(joints=sized))
    assert again.worst[0] == pytest.approx(target, rel=1e-6)
    assert left["joint_b"]["play"] < 1.0


@pytest.mark.parametrize("statistical", [False, True])
def test_the_marginal_price_is_that_of_a_target_a_little_wider(arm, statistical):
    target = 0.4 * largest(error_budget(arm, POSE, force=PULL), statistical)
    options = {"statistical": statistical, "force": PULL, "keep": ["play"]}
    low, mid, high = (
        allocate_causes(arm, POSE, target * part, **options) for part in (0.999, 1.0, 1.001)
    )
    saved = (low.total - high.total) / (0.002 * target)
    assert mid.relief == pytest.approx(saved, rel=1e-3)


def test_several_poses_keep_the_target_at_all(arm):
    random = np.random.default_rng(1)
    poses = np.array([arm.configuration(dict(zip(arm.joints, random.uniform(-1.5, 1.5, 6),
                                                 strict=True))) for _ in range(8)])  # fmt: skip
    target = 0.5 * error_budget(arm, poses).worst.max()
    found = allocate_causes(arm, poses, float(target))
    assert found.budget.worst.max() == pytest.approx(target, rel=1e-6)
    assert found.total > 0.0


def test_play_of_rolling_bearings_stays_but_that_of_their_gears_does_not(arm):
    target = 0.15 * error_budget(arm, POSE).worst[0]
    found = allocate_causes(arm, POSE, float(target))
    assert found.parts[("wrist_1_joint", "play")] < 1.0
    assert any("kept: the play of the bearings of wrist_1_joint" in one for one in found.notes)
    bearing, gear = (
        [one for one in budget.contributions if (one.joint, one.cause) == ("wrist_1_joint", "play")]
        for budget in (found.first, found.budget)
    )
    assert bearing[0].factor == gear[0].factor == 1.0
    assert gear[1].factor == found.parts[("wrist_1_joint", "play")]
    alone = arm.with_clearance(arm.clearance, {})
    with pytest.raises(JointplayError, match="not proportional to its clearance"):
        error_budget(alone, POSE, remaining={("wrist_1_joint", "play"): 0.5})
    with pytest.raises(JointplayError, match="no cause is left that may be improved"):
        allocate_causes(
            alone.with_clearance({"wrist_1_joint": arm.clearance["wrist_1_joint"]}), POSE, 1e-3,
            causes=["play"],
        )  # fmt: skip


def test_a_target_that_cannot_be_reached_names_the_cause(arm):
    with pytest.raises(JointplayError, match=r"most of it by geometry .*kept"):
        allocate_causes(arm, POSE, 1e-3, keep=["geometry"])
    with pytest.raises(JointplayError, match=r"most of it by elasticity .*at least 0.5 of it"):
        allocate_causes(arm, POSE, 1e-3, force=(0.0, 0.0, -500.0), limits={"elasticity": 0.5})


def test_a_target_that_is_met_already_costs_nothing(arm):
    found = allocate_causes(arm, POSE, 1.0)
    assert found.total == 0.0
    assert found.parts == {}
    assert set(found.held) <= {"as is", "kept"}
    assert "within the target already, nothing is spent" in str(found)


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
    ],
)
def test_wrong_input_is_refused_with_the_choices(arm, options, says):
    with pytest.raises((JointplayError, MissingName), match=says):
        allocate_causes(arm, POSE, **{"target": 1e-3, **options})


def test_the_figure_shows_all_parts_and_prices(arm):
    found = allocate_causes(arm, POSE, 1e-3)
    figure = cause_allocation(found)
    parts, prices = (
        sum(bar.get_width() for bars in panel.containers for bar in bars) for panel in figure.axes
    )
    assert parts == pytest.approx(1e3 * (found.before.sum() + found.after.sum()), rel=1e-9)
    assert prices == pytest.approx(found.total, rel=1e-9)


def test_the_command_line_spends_on_causes(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["allocate", "ur5", "--whole", "industrial", "--target", "2 mm", "--payload", "3 kg"]
    more = ["--keep", "heat", "--price", "encoder=2", "--limit", "geometry=0.2"]
    assert cli.main([*options, *more, "--weight", "elbow_joint=3", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "worst case 2.0000 mm of 2.0000 mm" in shown
    assert "assumed: prices: halving costs 1 at each joint, of elasticity, gear error" in shown
    assert (out / "allocation.csv").read_text().startswith("joint,cause,before_m,after_m,")
    assert (out / "allocation.png").read_bytes().startswith(b"\x89PNG")
    assert cli.main([*options, "--statistical", "--causes", "geometry"]) == 0
    assert "RMS" in capsys.readouterr().out
    path = tmp_path / "arm.toml"
    path.write_text(
        '[robot]\nurdf = "jointplay:scara.urdf"\ntool = "suction_cup"\n'
        '[errors]\nassumed = "industrial"\naxis_offset = "0.2 mm"\n'
    )
    assert cli.main(["allocate", str(path), "--whole", "--target", "1 mm"]) == 0
    assert "given: geometry: offset 0.0002 m (all joints)" in capsys.readouterr().out
    for wrong in (["--cost", "linear"], ["--quantile", "0.9"]):
        assert cli.main([*options, *wrong]) == 2
        assert "does not go with --whole" in capsys.readouterr().err
    plain = ["allocate", "ur5", "--target", "2 mm"]
    for wrong in (["--keep", "heat"], ["--statistical"], ["--payload", "3 kg"]):
        assert cli.main([*plain, *wrong]) == 2
        assert "needs --whole" in capsys.readouterr().err
