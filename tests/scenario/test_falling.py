"""A robot that nothing holds is warned of, before it falls."""

import pytest

from jointplay.cli import main

SCENARIO = """
[robot]
urdf = "example-robot-data:ur5"
[joints.elbow_joint]
radial_clearance = "0.05 mm"
[integration]
duration = "1 ms"
"""


@pytest.mark.parametrize(
    ("more", "warned"),
    [("", True), ("[drives]\nelbow_joint = 'free'\n", False)],
)
def test_an_arm_that_nothing_holds_is_warned_of(more, warned, tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SCENARIO + more)
    assert main(["check", str(tmp_path / "s.toml"), "--no-picture"]) == 0
    assert ("no motion and no drive: the arm falls" in capsys.readouterr().out) == warned


SERVO = """[drive]
kind = "servo"
voltage = "24 V"
torque_constant = 1.0
resistance = 1.0
p_gain = 100.0
"""
SERVO_IN_MJCF = """<mujoco><worldbody><body name="arm"><joint name="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass="1"/></body></worldbody>
<actuator><position joint="hinge" kp="200"/></actuator></mujoco>"""


@pytest.mark.parametrize(
    ("robot", "drive", "warned"),
    [
        ("example-robot-data:ur5", SERVO, True),
        ("example-robot-data:ur5", "[drive]\nkind = 'free'\n", False),
        pytest.param("arm.xml", "", True, marks=pytest.mark.needs("mujoco")),
        pytest.param(
            "arm.xml", "[drives]\nhinge = 'free'\n", False, marks=pytest.mark.needs("mujoco")
        ),
    ],
)
def test_a_drive_that_follows_no_motion_is_said_to_do_nothing(
    robot, drive, warned, tmp_path, capsys
):
    (tmp_path / "arm.xml").write_text(SERVO_IN_MJCF)
    (tmp_path / "s.toml").write_text(
        f'[robot]\nurdf = "{robot}"\n{drive}[integration]\nduration = "1 ms"\n'
    )
    assert main(["check", str(tmp_path / "s.toml"), "--no-picture"]) == 0
    out = capsys.readouterr().out
    assert ("no motion, without which drives do nothing: the arm falls" in out) == warned


def test_a_law_that_is_not_the_default_is_named_and_restitution_only_where_it_counts():
    from jointplay.physics.contact import Hertz
    from jointplay.physics.joints import RevoluteClearance
    from jointplay.simulation.values import of_joint

    usual = [*of_joint(RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4), ())]
    assert ("restitution", "0.9", False) in usual
    assert not any(field == "normal" for field, *_ in usual)
    elastic = RevoluteClearance(radial_clearance=1e-4, axial_clearance=1e-4, normal=Hertz())
    parts = [*of_joint(elastic, ())]
    assert ("normal", Hertz.name, True) in parts
    assert not any(field == "restitution" for field, *_ in parts)
