"""Limits and fits by ISO 286-1: tables, texts that are no fits, joints, budgets, commands."""

import subprocess
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from warm import JOINTPLAY

import jointplay as jp
from jointplay.accuracy.allocation import LEAST_M, allocate, offers_of
from jointplay.base.errors import JointplayError
from jointplay.cli import main
from jointplay.physics.joints.fits import PREFERRED, Fit, is_fit, letters, limits
from jointplay.study import plan_of
from jointplay.study.sweep_plan import Cases

UM = 1e-6


@pytest.mark.parametrize(
    ("size", "letter", "grade", "lower", "upper"),
    [
        # As printed in shops' and books' copies of ISO 286-2 (seen).
        (20, "H", 7, 0, 21), (20, "g", 6, -20, -7), (20, "k", 6, 2, 15), (20, "p", 6, 22, 35),
        (10, "a", 12, -430, -280), (18, "m", 6, 7, 18), (30, "u", 7, 48, 69), (3, "j", 6, -2, 4),
        (25, "js", 6, -6.5, 6.5), (50, "F", 8, 25, 64), (20, "JS", 7, -10.5, 10.5),
        (40, "N", 9, -62, 0), (40, "K", 7, -18, 7), (40, "P", 7, -42, -17), (20, "J", 7, -9, 12),
        (30, "R", 7, -41, -20), (280, "M", 6, -41, -9), (5, "P", 8, -30, -12),
        # As ISO 286-2:1988/Cor.1:2006 puts them right (seen).
        (340, "A", 13, 1200, 2090), (100, "E", 8, 72, 126), (24, "R", 10, -112, -28),
        (280, "f", 9, -186, -56),
    ],
)  # fmt: skip
def test_limit_deviations_are_those_that_are_printed(size, letter, grade, lower, upper):
    assert limits(size, letter, grade) == (lower, upper)


sizes = st.floats(0.01, 500.0)


@given(sizes, st.booleans(), st.data(), st.integers(1, 18))
def test_limits_enclose_a_tolerance_that_grows_with_the_grade(size, hole, data, grade):
    letter = data.draw(st.sampled_from(letters(hole)))
    found = []
    for one in (grade, grade + 1):
        try:
            found.append(limits(size, letter, one))
        except JointplayError:
            assume(False)
    widths = [one.upper - one.lower for one in found]
    assert 0.0 < widths[0] < widths[1]
    if letter.lower() <= "h":  # the fundamental deviation is the same for all grades
        assert found[0][not hole] == found[1][not hole]


@given(sizes, st.sampled_from(PREFERRED))
def test_fits_of_holes_and_of_shafts_have_the_same_clearance(size, pair):
    hole, shaft = pair.split("/")
    try:
        one = Fit(f"{size:.6g}{pair}")
    except JointplayError:
        assume(False)
    assert 0.0 <= one.least < one.middle < one.most
    assert one.kind == "clearance"
    other = Fit(f"{size:.6g}{shaft[0].upper()}{hole[1:]}/h{shaft[1:]}")
    assert (other.least, other.most) == pytest.approx((one.least, one.most))


def test_a_fit_has_its_clearance_on_each_side():
    fit = Fit("20H7/g6")
    assert (fit.least, fit.middle, fit.most) == pytest.approx((3.5 * UM, 12 * UM, 20.5 * UM))
    assert Fit("20 H7/k6").kind == "transition"
    assert Fit("20H7/p6").kind == "interference"
    assert Fit("20,0mm Js7-h6") == Fit("20JS7/h6")


def test_clearances_at_random_are_those_of_two_sizes_at_random():
    fit, random = Fit("30H8/f7"), np.random.default_rng(1)
    holes, shafts = (random.uniform(*one, 200_000) for one in (fit.hole, fit.shaft))
    drawn = 0.5 * UM * (holes - shafts)
    shares = np.linspace(0.0, 1.0, 21)
    assert fit.quantile(shares) == pytest.approx(np.quantile(drawn, shares), abs=0.3 * UM)
    assert fit.deviation == pytest.approx(drawn.std(), rel=0.01)
    assert fit.quantile([0.0, 1.0]) == pytest.approx([fit.least, fit.most])


WRONG = {
    "20Q7/g6": r"no hole has the letter 'Q'; holes: A, B, .*ZC",
    "20H7/w6": "no shaft has the letter 'w'; shafts: a, b, .*zc",
    "20H19/g6": "no grade 19 .of H19.; grades: 1 to 18",
    "600H7/g6": "600 mm is out of range: the tables have sizes above 0 up to 500 mm",
    "0H7/g6": "0 mm is out of range",
    "20g6/H7": 'has its shaft first; .*: "20H7/g6"',
    "20H7g6": 'has no slash before its shaft: "20H7/g6"',
    "20H7": 'has no shaft; a fit reads "20H7/g6"',
    "20g6": "has no hole",
    "20H7/F6": "has two holes",
    "20h7/g6": "has two shafts",
    "20T7/h6": "T7 is not defined for 20 mm",
    "20K9/h6": "K9 is not defined for 20 mm: above 3 mm it has the grades up to 8",
    "0.8H14/h6": "H14 is not defined for 0.8 mm",
    "20/h6": "is no fit; a fit reads",
}


@pytest.mark.parametrize(("text", "words"), WRONG.items())
def test_what_is_wrong_with_a_fit_is_said(text, words):
    with pytest.raises(JointplayError, match=words):
        Fit(text)
    assert is_fit(text)


@pytest.mark.parametrize("text", ["0.2 mm", "20", "2e4", "2E-5", "50 um", "6010/C3", "RB2008 C0"])
def test_lengths_and_bearings_are_no_fits(text):
    assert not is_fit(text)


def test_a_joint_takes_size_and_clearance_of_its_fit():
    joint = jp.RevoluteClearance(fit="20H7/g6", bearing_length=30e-3)
    assert (joint.ri, joint.cr, joint.li) == pytest.approx((10e-3, 12 * UM, 30e-3))
    assert "20H7/g6: 3.5 to 20.5 µm" in joint.summary
    slider = jp.PrismaticClearance(fit="50H7/f7")
    assert (slider.width, slider.cx, slider.cy) == pytest.approx((50e-3, 25 * UM, 25 * UM))
    rod = jp.CylindricalClearance(fit="8F7/h6")
    assert (rod.ri, rod.cr) == pytest.approx((4e-3, 0.5 * (13 + 0.5 * (15 + 9)) * UM))


def test_another_clearance_of_the_fit_may_be_given_and_no_other():
    joint = jp.RevoluteClearance(fit="20H7/g6", radial_clearance=5 * UM)
    assert joint.cr == 5 * UM
    for wrong, at in (
        ({"radial_clearance": 0.1e-3}, "radial_clearance"),
        ({"bearing_radius": 15e-3}, "bearing_radius"),
        ({"journal_radius": 9.9e-3}, "radial_clearance"),
    ):
        with pytest.raises(JointplayError, match="contradicts") as caught:
            jp.RevoluteClearance(fit="20H7/g6", **wrong)
        assert caught.value.where == (at,)


def test_a_joint_of_another_clearance_has_no_fit_any_more():
    joint = jp.RevoluteClearance(fit="20H7/g6")
    assert replace(joint, restitution=0.5).fitted == Fit("20H7/g6")
    assert joint.scaled(2.0).fitted is None
    assert joint.at_clearance(20 * UM).ca == joint.ca


@pytest.mark.parametrize("pair", ["H7/k6", "H7/p6", "H7/js6"])
def test_what_may_be_pressed_in_is_refused(pair):
    with pytest.raises(JointplayError, match=r"a joint needs a clearance fit, such as 20H7/f6"):
        jp.RevoluteClearance(fit=f"20{pair}")


def test_balls_have_no_fit():
    with pytest.raises(JointplayError, match=r"a spherical joint has no fit.*radial_clearance"):
        jp.SphericalClearance(fit="20H7/g6")


POSE = {"shoulder_lift_joint": -0.7, "elbow_joint": 1.2}
FITS = {"shoulder_lift_joint": "30H8/f7", "elbow_joint": "20H7/g6"}


def arm(part=None, **changes):
    """The UR5 with fits, or with the clearances that `part` takes from each fit."""
    joints = {}
    for name, text in FITS.items():
        joint = jp.RevoluteClearance(fit=text, **changes)
        joints[name] = joint if part is None else joint.at_clearance(float(part(joint.fitted)))
    return jp.Mechanism("ur5", joints)


@pytest.mark.thorough
def test_budgets_bound_and_average_parts_at_random():
    found, random = jp.budget(arm(), POSE), np.random.default_rng(2)
    drawn = [jp.budget(arm(lambda fit: fit.quantile(random.uniform())), POSE) for _ in range(60)]
    assert max(one.worst[0] for one in drawn) < found.worst[0]
    rms = np.sqrt(np.mean([one.rms[0] ** 2 for one in drawn]))
    assert found.rms[0] == pytest.approx(rms, rel=0.05)


@pytest.mark.parametrize("changes", [{}, {"lock_axial": True}, {"axial_clearance": 50e-6}])
def test_budgets_have_the_loosest_parts_any_and_the_middle_ones(changes):
    found = jp.budget(arm(**changes), POSE)
    assert found.rms_parts.sum() == pytest.approx(found.rms[0])
    # The mean of squares, by Gauss's quadrature with three points of each clearance.
    weights, square = {-1: 1 / 6, 0: 2 / 3, 1: 1 / 6}, 0.0
    for pair in product(weights, repeat=len(FITS)):
        ways = iter(pair)
        own = arm(lambda fit: fit.middle + next(ways) * np.sqrt(3.0) * fit.deviation, **changes)  # noqa: B023
        square += np.prod([weights[way] for way in pair]) * jp.budget(own, POSE).rms[0] ** 2
    assert found.rms[0] == pytest.approx(np.sqrt(square), rel=2e-3)
    loosest = jp.budget(arm(lambda fit: fit.most, **changes), POSE)
    assert found.worst == pytest.approx(loosest.worst)
    middle = jp.budget(arm(lambda fit: fit.middle, **changes), POSE)
    assert found.rest_tool == pytest.approx(middle.rest_tool, abs=1e-9)


def test_the_whole_error_has_the_variance_of_parts_and_states():
    found = jp.budget(arm(), POSE, causes=["play"])
    assert found.worst == pytest.approx(jp.budget(arm(), POSE).worst)
    drawn = np.linalg.norm(found.sample(20_000), axis=1)
    assert np.sqrt((drawn**2).mean()) == pytest.approx(found.rms[0], rel=0.02)
    assert drawn.max() < found.worst[0] * 1.001
    assert "its fit 20H7/g6, 3.5 to 20.5 µm" in found.data().csv()


PRICED = {"IT5": 4.0, "IT8": 0.5}


def test_no_cheaper_choice_of_fits_keeps_the_target():
    robot, best, target = arm(), np.inf, 1.2e-3
    offers = {name: offers_of(one, PRICED)[:6] for name, one in robot.clearance.items()}
    for choice in product(*offers.values()):
        price = sum(one.price for one in choice)
        made = dict(zip(robot.clearance, (one.joint for one in choice), strict=True))
        if price < best and jp.budget(robot.with_clearance(made), POSE).worst[0] <= target:
            best = price
    found = allocate(robot, POSE, target, offers=offers)
    assert found.total == pytest.approx(best)
    assert found.error <= target
    assert jp.budget(found.mechanism, POSE).worst[0] == pytest.approx(found.error, rel=1e-3)
    assert set(found.column("held")) == {"fit"}
    assert "30H8/f7 becomes 30H" in found.sentence


def test_offers_are_loose_enough_to_be_made_and_keep_the_size():
    own, *others = offers_of(jp.RevoluteClearance(fit="20H9/h9", axial_clearance=52e-6))
    assert own.name == own.instead == "20H9/h9"
    assert {one.joint.ri for one in others} == {10e-3}
    assert min(one.joint.fitted.least for one in others) >= LEAST_M
    assert all(one.joint.ca == pytest.approx(2.0 * one.joint.cr) for one in others)
    assert not [one for one in others if "h" in one.name]
    prices = {one.name: one.price for one in others}
    assert prices["20H7/g6"] == pytest.approx((1.0 + 1.6) / 2)


def test_bearings_and_fits_are_chosen_together():
    robot = arm().with_clearance(
        {**arm().clearance, "wrist_1_joint": jp.BallBearing(designation="6010/C3")}
    )
    found = allocate(robot, POSE, 1.6e-3)
    assert set(found.column("held")) == {"fit", "class"}
    assert found.sentence.startswith("These are the cheapest fits and classes of bearings that")
    with pytest.raises(JointplayError, match="with the tightest fits and bearings offered"):
        allocate(robot, POSE, 1e-4)


def test_the_command_answers_in_fits(capsys):
    given_fits = [f"--joint={name}={text}" for name, text in FITS.items()]
    pose = ",".join(f"{name}={place}" for name, place in POSE.items())
    assert main(["allocate", "ur5", *given_fits, "--target", "1.2 mm", "--pose", pose]) == 0
    first = capsys.readouterr().out.splitlines()[0]
    assert "the cheapest fits that keep the tool 'tool0' within 1.2 mm: 30H8/f7 becomes" in first
    assert main(["allocate", "ur5", *given_fits, "--target", "1 mm", "--cost", "linear"]) == 2
    assert "fits grades (--price IT6=X)" in capsys.readouterr().err


def command(*arguments):
    return subprocess.run([JOINTPLAY, *arguments], capture_output=True, text=True, check=False)


@pytest.mark.parametrize(
    ("robot", "joint", "fit"),
    [("ur5", "elbow_joint", "20H7/g6"), ("so101", "elbow_flex", "6H8/e8"),
     ("scara", "joint_b", "100H7/g6")],
)  # fmt: skip
def test_commands_take_fits(robot, joint, fit):
    done = command("budget", robot, "--joint", f"{joint}={fit}", "--detail")
    assert done.returncode == 0, done.stderr
    assert f"{fit}: {Fit(fit).range}" in done.stdout
    assert "loosest parts that fits allow" in done.stdout


@pytest.mark.parametrize("text", ["20g6/H7", "20H7g6", "20Q7/g6", "20H7", "20H7/k6"])
def test_commands_say_what_is_wrong_with_a_fit(text):
    done = command("budget", "ur5", "--joint", f"elbow_joint={text}")
    assert done.returncode == 2
    line = done.stderr.strip()
    assert f"elbow_joint={text}: " in line
    assert "\n" not in line


def test_options_for_clearances_are_for_the_joints_without_a_fit():
    more = ("--joint", "wrist_1_joint", "--clearance", "0.05 mm", "--bearing-radius", "12 mm")
    done = command("budget", "ur5", "--joint", "elbow_joint=20H7/g6", *more, "--detail")
    assert done.returncode == 0, done.stderr
    assert "wrist_1_joint: bearing radius 12 mm, radial clearance 0.05 mm, " in done.stdout
    assert "bearing length 40 mm (assumed), axial clearance 0.05 mm (assumed)" in done.stdout
    done = command("budget", "ur5", "--joint", "elbow_joint=20H7/g6", *more[4:])
    assert "bearing radius 12 mm contradicts the fit 20H7/g6" in done.stderr


def test_a_scenario_takes_a_fit(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(
        '[robot]\nurdf = "jointplay:scara.urdf"\n[joints.joint_b]\nfit = "20H7/g6"\n'
        "[integration]\nduration = 0.02\n",
        encoding="utf-8",
    )
    joint = jp.Scenario.load(file).simulation().mechanism.clearance["joint_b"]
    assert joint.fitted == Fit("20H7/g6")
    file.write_text(file.read_text().replace("20H7", "20h7"), encoding="utf-8")
    with pytest.raises(JointplayError, match="fit '20h7/g6' has two shafts"):
        jp.Scenario.load(file).simulation()


def test_a_sweep_draws_from_a_fit(tmp_path):
    file = tmp_path / "arm.toml"
    file.write_text(
        '[robot]\nurdf = "jointplay:scara.urdf"\n[joints.joint_b]\nfit = "20H7/g6"\n'
        "[integration]\nduration = 0.01\n[sweep]\nsamples = 4\n[sweep.axes]\n"
        'c = { key = "joints.joint_b.radial_clearance", distribution = "fit", fit = "20H7/g6" }\n',
        encoding="utf-8",
    )
    made = plan_of(jp.Scenario.load(file))
    for index in Cases(made):
        joint = made.scenario.simulation(made.case, made.changes(index)).mechanism.clearance[
            "joint_b"
        ]
        assert 3.5 * UM <= joint.cr <= 20.5 * UM
        assert joint.fitted == Fit("20H7/g6")
