"""What a URDF may say, and how it is refused."""

import numpy as np
import pytest
from conftest import body, joint

from jointplay import JointplayError, shipped
from jointplay.mechanism.urdf import read


def dynamics(attributes):
    return joint("j", "base", "l").replace("</joint>", f"<dynamics {attributes}/></joint>")


def tensor(ixx, iyy, izz, ixy=0.0):
    return body("l").replace(
        'ixx="0.01" iyy="0.01" izz="0.01" ixy="0"',
        f'ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="{ixy}"',
    )


def test_joints_are_listed_in_the_order_of_the_file():
    description = read(shipped("scara.urdf"))
    assert [j.kind for j in description.joints.values()][:4] == [
        "revolute",
        "revolute",
        "prismatic",
        "revolute",
    ]
    assert description.revolute == ["joint_a", "joint_b", "joint_c"]


@pytest.mark.parametrize(
    ("attributes", "friction", "damping"),
    [('friction="0.3" damping="2"', 0.3, 2.0), ('damping="2"', 0.0, 2.0), ("", 0.0, 0.0)],
)
def test_dynamics_are_read(urdf, attributes, friction, damping):
    entry = read(urdf(body("l"), dynamics(attributes))).joints["j"]
    assert (entry.friction, entry.damping) == (friction, damping)


@pytest.mark.parametrize("attributes", ['friction="much"', 'damping="inf"'])
def test_dynamics_that_are_no_numbers_are_named(urdf, attributes):
    value = attributes.split('"')[1]
    with pytest.raises(JointplayError, match=f"joint 'j'.*got '{value}'"):
        read(urdf(body("l"), dynamics(attributes)))


@pytest.mark.parametrize("frame", ['<link name="l"/>', body("l", mass=0.0, inertia=0.0)])
def test_frames_without_mass_are_no_bodies(urdf, frame):
    read(urdf(frame, joint("j", "base", "l", "fixed")))


def test_flat_plate_is_the_limit_of_what_can_be(urdf):
    read(urdf(tensor(1.0, 2.0, 3.0), joint("j", "base", "l")))
    with pytest.raises(JointplayError, match=r"no rigid body has 3\.01 > 1 \+ 2"):
        read(urdf(tensor(1.0, 2.0, 3.01), joint("j", "base", "l")))


def test_products_of_inertia_are_judged_by_principal_moments(urdf):
    # diag(2, 2, 2) with ixy has the principal moments 2 - ixy, 2, 2 + ixy: possible up to 2/2.
    read(urdf(tensor(2.0, 2.0, 2.0, 0.99), joint("j", "base", "l")))
    with pytest.raises(JointplayError, match=r"'l' has principal moments 0\.99, 2, 3\.01"):
        read(urdf(tensor(2.0, 2.0, 2.0, 1.01), joint("j", "base", "l")))


def test_both_shipped_robots_differ_in_inertia_only():
    robots = [read(shipped("scara.urdf"))]
    robots += [read(shipped("scara_as_printed.urdf"), allow_unphysical=["arm1"])]
    assert robots[0].joints == robots[1].joints
    for text in (robot.text for robot in robots):
        assert np.isclose(sum(float(part.split('"')[0]) for part in text.split('mass value="')[1:]),
                          5.78 + 4.35 + 3.03)  # fmt: skip


def test_file_that_is_no_text_is_refused(tmp_path):
    path = tmp_path / "robot.urdf"
    path.write_bytes(b"\xff\xfe\x00robot")
    with pytest.raises(JointplayError, match=r"cannot read the URDF .*robot\.urdf"):
        read(path)
