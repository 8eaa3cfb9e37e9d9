"""Errors of robots besides play: classes, and the table of them in scenario files."""

from dataclasses import replace

import numpy as np
import pytest

import jointplay as jp
from jointplay import cli
from jointplay.accuracy.causes import CAUSES
from jointplay.accuracy.error_budget import budget
from jointplay.accuracy.robot_errors import CLASSES, ERROR_CLASSES, JointErrors, RobotErrors
from jointplay.base.errors import JointplayError, MissingName
from jointplay.base.schema import fields_of
from jointplay.scenario import Scenario
from jointplay.study.keys import kinds

ARM = """
[robot]
urdf = "jointplay:scara.urdf"
tool = "suction_cup"
[start]
joint_b = 0.5
"""
GUIDE = 'radial = "300 N/um", tilt = 2e5, torsion = 1e5'
TABLE = """
[errors]
assumed = "industrial"
axis_offset = "0.1 mm"
heating = "8 K"
zero_offset = "0.01 deg"
[errors.joints.joint_b]
encoder = "0.001 deg"
torsional_stiffness = "3e4 N*m/rad"
elasticity = { radial = "300 N/um", axial = "200 N/um", tilt = 2e5 }
[errors.joints.stroke]
encoder = "2 um"
elasticity = { radial = "300 N/um", tilt = 2e5, torsion = 1e5 }
"""
KNOWN = RobotErrors(
    assumed="industrial",
    axis_offset=1e-4,
    heating=8.0,
    zero_offset=np.radians(0.01),
    joints={
        "joint_b": JointErrors(
            encoder=np.radians(0.001),
            torsional_stiffness=3e4,
            elasticity=jp.Elasticity(radial=3e8, axial=2e8, tilt=2e5),
        ),
        "stroke": JointErrors(
            encoder=2e-6, elasticity=jp.Elasticity(radial=3e8, tilt=2e5, torsion=1e5)
        ),
    },
)


@pytest.fixture(scope="module")
def scara():
    """The SCARA without play."""
    return jp.Mechanism(jp.shipped("scara.urdf"), {}, tool="suction_cup")


def test_classes_say_all_that_a_robot_can_say():
    assert tuple(ERROR_CLASSES) == CLASSES
    for one in ERROR_CLASSES.values():
        unsaid = {name for name in fields_of(RobotErrors) if getattr(one, name) is None}
        assert unsaid == {"assumed", "torsional_stiffness"}  # which a rule has


def test_a_file_says_what_python_says_and_is_read_back():
    found = Scenario(ARM + TABLE, "here/arm.toml").robot_errors()
    assert found == KNOWN
    assert RobotErrors.from_description(found.describe()) == KNOWN
    assert Scenario(ARM, "here/arm.toml").robot_errors() is None


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('"8 K"', '"8 mm"', r"errors.heating: .* expected a temperature difference"),
        ('"0.1 mm"', '"-0.1 mm"', r"errors.axis_offset: .*must not be negative"),
        ("axis_offset", "axis_ofset", 'did you mean "axis_offset"'),
        ('"industrial"', '"industrail"', 'did you mean "industrial"'),
        ("joints.joint_b", "joints.joint_x", r"errors.joints.joint_x: .*joint_b"),
        ('"2 um"', '"2 arcmin"', r'errors.joints.stroke.encoder: "2 arcmin" is not a length'),
        (
            GUIDE,
            "radial = 1e8, axial = 1e8, tilt = 1e5",
            r"elasticity: along its axis a joint is free",
        ),
        ("0.001 deg", "0.001 m", r"errors.joints.joint_b.encoder: .*joint 'joint_b' is"),
        ("tilt = 2e5 }", "tilt = -1 }", r"errors.joints.joint_b.elasticity"),
    ],
)
def test_bad_input_is_refused_where_it_stands(old, new, says):
    assert old in TABLE
    with pytest.raises(JointplayError, match=says) as refused:
        Scenario(ARM + TABLE.replace(old, new, 1), "here/arm.toml").simulation()
    assert "here/arm.toml, line" in str(refused.value)


def test_values_that_cannot_be_are_refused_in_python(scara):
    with pytest.raises(JointplayError, match="at most 1"):
        RobotErrors(stiffness_spread=1.5)
    with pytest.raises(JointplayError, match="resolution"):
        JointErrors(encoder=-1.0)
    springs = JointErrors(elasticity=jp.Elasticity(radial=1e8, axial=1e8, tilt=1e5))
    with pytest.raises(JointplayError, match="along its axis a joint is free: it has no axial"):
        budget(scara, {}, errors=RobotErrors(joints={"stroke": springs}), causes=CAUSES)
    with pytest.raises(MissingName, match="joint_b"):
        budget(scara, {}, errors=RobotErrors(joints={"joint_x": JointErrors()}), causes=CAUSES)


def test_what_is_given_counts_more_than_the_class_and_that_of_a_joint_most(scara):
    def geometry(**errors):
        found = budget(scara, {}, errors=RobotErrors(**errors), causes=["geometry"])
        return found.by("joint")["joint_b"][0]

    tilt = {"axis_tilt": 0.0}
    own = {"joint_b": JointErrors(axis_offset=2e-4, axis_tilt=0.0)}
    assert geometry(axis_offset=1e-4, **tilt) == pytest.approx(np.sqrt(3.0) * 1e-4, rel=1e-6)
    assert geometry(axis_offset=1e-4, **tilt, joints=own) > 1.9e-4
    assumed = budget(scara, {}, kind="printed", causes=["geometry"]).by("joint")["joint_b"]
    assert geometry(assumed="printed") == pytest.approx(assumed[0])


def test_no_sweep_goes_over_what_runs_do_not_have():
    with pytest.raises(JointplayError, match="a sweep cannot vary 'errors'"):
        kinds(("errors", "heating"))


def test_given_and_assumed_numbers_are_told_apart(scara):
    found = budget(scara, {}, errors=KNOWN, causes=CAUSES)
    given, assumed = "\n".join(found.given), "\n".join(found.assumed)
    assert "geometry: offset 0.0001 m (all joints)" in given
    assert "geometry: tilt 0.0003 rad (class 'industrial')" in assumed
    assert "offset 0.0001 m" not in assumed
    assert "encoder: resolution 2e-06 m (stroke)" in given
    assert "encoder: resolution 1.745e-05 rad (joint_b)" in given
    assert "heat: up to 8 K" in given
    assert "heat: 23 µm/(m K) (class 'industrial')" in assumed
    text = str(found.table())
    assert "\ngiven: heat" in text
    assert "\nassumed: heat" in text


def test_a_slider_on_springs_gives_way_across_and_in_torsion(scara):
    """It does not give way along its axis, where the drive holds it."""
    guide = jp.Elasticity(radial=1e6, tilt=1e4, torsion=1e3)
    robot = jp.Mechanism(
        jp.shipped("scara.urdf"), {"stroke": jp.CompliantSlider(elasticity=guide)},
        tool="suction_cup", gravity=(0.0, 0.0, 0.0),
    )  # fmt: skip
    known = RobotErrors(stiffness_spread=0.0, tilt_stiffness=1e9)
    options = {"force": (10.0, 0.0, 0.0), "causes": ["elasticity"]}
    found = budget(robot, {}, errors=known, **options)
    own = next(one for one in found.model.contributions if one.joint == "stroke")
    assert np.abs(own.shift[0]).max() >= 1e-5
    assert own.shift[0, 2] == 0.0
    given = replace(known, joints={"stroke": JointErrors(elasticity=guide)})
    other = budget(scara.ideal(), {}, errors=given, **options)
    same = next(one for one in other.model.contributions if one.joint == "stroke")
    across = np.linalg.norm(same.shift[0, :2])
    assert across == pytest.approx(10.0 / 1e6, rel=1e-6)
    assert np.linalg.norm(own.shift[0, :2]) == pytest.approx(across, rel=1e-6)


def test_budgets_read_the_table_of_a_scenario(tmp_path, capsys):
    path = tmp_path / "arm.toml"
    path.write_text(ARM + TABLE)
    assert cli.main(["budget", str(path), "--detail", "--whole"]) == 0
    shown = capsys.readouterr().out
    assert "given: encoder: resolution 1.745e-05 rad (joint_b)" in shown
    assert "assumed: encoder: " in shown
    assert "(class 'industrial')" in shown
    assert cli.main(["budget", str(path), "--detail", "--whole", "printed"]) == 0
    shown = capsys.readouterr().out
    assert "assumed: encoder: " in shown
    assert "(class 'printed')" in shown
    path.write_text(ARM)
    assert cli.main(["budget", str(path), "--whole"]) == 2
    assert (
        "name a class of robots, from which all such numbers are taken (--whole"
        in capsys.readouterr().err
    )


def test_check_lists_what_is_known_of_the_errors(tmp_path, capsys):
    path = tmp_path / "arm.toml"
    path.write_text(ARM + TABLE + '[integration]\nduration = "0.1 s"\n')
    assert cli.main(["check", str(path)]) == 0
    shown = capsys.readouterr().out
    assert "errors           assumed industrial" in shown
    assert "errors of joint_b encoder" in shown
