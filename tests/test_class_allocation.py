"""Which class each rolling bearing must have: against all choices, and what cannot be."""

from itertools import product

import numpy as np
import pytest

import jointplay as jp
from jointplay import cli
from jointplay.core.errors import JointplayError, MissingName
from jointplay.design.class_allocation import PRELOADED, allocate_classes, offers_of
from jointplay.design.static_budget import budget

POSES = np.array([[0.1, -0.9, 1.2, 0.3, 0.2, 0.0], [0.5, -0.2, 0.4, -0.6, 1.0, 0.3]])


@pytest.fixture(scope="module")
def robot():
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
    """Both poses as configurations."""
    joints = ("shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint",
              "wrist_2_joint", "wrist_3_joint")  # fmt: skip
    return np.array([robot.configuration(dict(zip(joints, row, strict=True))) for row in POSES])


def test_offers_are_all_classes_of_the_size_and_a_preloaded_pair(robot):
    deep, crossed, pair = (
        offers_of(robot.clearance[name])
        for name in ("elbow_joint", "wrist_1_joint", "shoulder_pan_joint")
    )
    assert [one.name for one in deep] == ["C2", "C3", "C4", "CN"]
    assert {one.name for one in crossed} == {"CC0", "C0", "C1"}
    assert [one.name for one in pair] == ["as given", PRELOADED]
    assert pair[1].joint.preloaded
    dear = offers_of(robot.clearance["elbow_joint"], {"C2": 7.0})
    assert dear[0].price == 7.0


@pytest.mark.parametrize("target", [2e-3, 1.1e-3, 8.5e-4, 7e-4])
def test_no_cheaper_choice_keeps_the_target(robot, target):
    prices = {"C2": 1.9, "CN": 1.35, "C3": 1.0, "C4": 0.8, "CC0": 1.5, "C0": 1.1, "C1": 0.9}
    poses, found = at_poses(robot), None
    best = np.inf
    names = list(robot.clearance)
    every = [offers_of(robot.clearance[name], prices) for name in names]
    for choice in product(*every):
        price = sum(one.price for one in choice)
        if price >= best:
            continue
        made = robot.with_clearance(
            {name: one.joint for name, one in zip(names, choice, strict=True)}
        )
        if budget(made, poses).worst.max() <= target:
            best = price
    if not np.isfinite(best):
        with pytest.raises(JointplayError, match="cannot be reached"):
            allocate_classes(robot, poses, target, prices=prices)
        return
    found = allocate_classes(robot, poses, target, prices=prices)
    assert found.total == pytest.approx(best)
    assert found.error <= target
    assert budget(found.mechanism, poses).worst.max() == pytest.approx(found.error, rel=1e-3)
    assert found.parts.sum() == pytest.approx(found.error, rel=1e-9)


def test_what_cannot_be_is_refused(robot):
    poses = at_poses(robot)
    with pytest.raises(JointplayError, match="cannot be reached"):
        allocate_classes(robot, poses, 1e-6)
    with pytest.raises(MissingName, match="C3"):
        allocate_classes(robot, poses, 1e-3, prices={"C9": 1.0})
    with pytest.raises(MissingName, match="elbow_joint"):
        allocate_classes(robot, poses, 1e-3, offers={"elbow": ()})
    plain = jp.Mechanism("example-robot-data:ur5", {})
    with pytest.raises(JointplayError, match="no joint has a rolling bearing"):
        allocate_classes(plain, {}, 1e-3)


def test_the_command_line_allocates_by_class(tmp_path, capsys):
    out = tmp_path / "out"
    options = ["allocate", "ur5", "--joint", "elbow_joint=6010", "--target", "1 mm"]
    assert cli.main([*options, "--price", "C2=3", "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert "elbow_joint" in shown
    assert "of 1000.00 um" in shown
    assert (out / "allocation.csv").read_text().startswith("joint,class,")


@pytest.mark.parametrize(
    ("joint", "option", "says"),
    [
        ("elbow_joint=6010", ["--least", "1 um"], "--least is for clearances that can be any"),
        ("elbow_joint=6010", ["--weight", "elbow_joint=2"], "--weight is for clearances"),
        ("elbow_joint=6010", ["--cost", "linear"], "--cost is for clearances"),
        ("elbow_joint=6010", ["--price", "C2"], "--price must read CLASS=X, got 'C2'"),
        ("elbow_joint", ["--price", "C2=3"], "--price C2=3 is for classes of rolling bearings"),
        ("elbow_joint", ["--weight", "elbow_joint"], "--weight must read JOINT=X"),
    ],
)
def test_options_that_do_not_fit_the_joints_are_refused(joint, option, says, capsys):
    assert cli.main(["allocate", "ur5", "--joint", joint, "--target", "1 mm", *option]) == 2
    assert says in capsys.readouterr().err
